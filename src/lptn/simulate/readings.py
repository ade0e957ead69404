"""From a trajectory to what a log holds of it: means over steps or samples, read at the log's own clock.

A sensor's readings may come late, or early, by a delay that is itself fitted. A long run is simulated in pieces, so
they are read late piece by piece, too, and no more is held at once than the delay needs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray, IntArray
from lptn.model.model import Model
from lptn.simulate.kernel import AtPoints


def readings_of(model: Model, x: FloatArray, p: FloatArray) -> FloatArray:
    """What the sensors read at n points [degC], shape (nodes, n).

    Args:
        x: shape (states, n).
        p: shape (m,).
    """
    if model.reads_directly:
        return x[: len(model.nodes)]

    def at_points() -> AtPoints:
        states, _, parameters, _, readings = model.symbols
        return AtPoints(ca.Function("readings", [states, ca.SX(0, 1), parameters], [ca.densify(readings)]))

    return model.made_once("readings at points", at_points)(x, np.zeros((0, x.shape[1])), p)[:, :, 0].T


def over_steps(ends: FloatArray, averaged: bool, parts: int = 1) -> FloatArray:
    """From values at the ends of steps, along the last axis, to what a log's n rows hold: means, or samples.

    A mean over one step is that of its two ends. Over an even number of steps it is Simpson's rule, whose error of a
    transient is x⁴/180 of it for steps of x time constants.

    Args:
        ends: shape (..., n · parts + 1).
        averaged: whether rows are means.
        parts: steps in a row, 1 or an even number.
    """
    rows = (ends.shape[-1] - 1) // parts
    if not averaged:
        return ends[..., : rows * parts : parts]
    if parts == 1:  # of derivatives this is a good part of a fit's time: nothing is copied twice
        means = ends[..., :-1] + ends[..., 1:]
        means *= 0.5
        return means
    weights = [factor / (3 * parts) for factor in (1, *(4, 2) * (parts // 2 - 1), 4, 1)]
    means = weights[0] * ends[..., : rows * parts : parts]
    for first, weight in enumerate(weights[1:], start=1):
        means += weight * ends[..., first : first + (rows - 1) * parts + 1 : parts]
    return means


def delayed(readings: FloatArray, delays: FloatArray) -> FloatArray:
    """Readings at the ends of steps, shape (nodes, n + 1), each node's late by its delay [steps], shape (nodes,)."""
    count = readings.shape[1]
    instants = [_between(np.arange(count), delay, count) for delay in delays]
    # Written so that a delay of 0 gives the same numbers to the last bit.
    return np.array(
        [(1 - share) * row[j] + share * row[j + 1] for row, (j, share) in zip(readings, instants, strict=True)]
    )


@dataclass(frozen=True)
class Piece:
    """What a run's sensors would read without delay, at the w + 1 ends of w steps, with derivatives.

    Args:
        first: number of the first of these ends in the run.
        readings: degC, shape (nodes, w + 1).
        derivatives: shape (w + 1, nodes, columns).
    """

    first: int
    readings: FloatArray
    derivatives: FloatArray

    @property
    def stop(self) -> int:
        """Number of the end behind the last one."""
        return self.first + int(self.readings.shape[1])

    def joined(self, following: Piece) -> Piece:
        """With the piece behind it, which begins at this one's last end."""
        readings = np.concatenate([self.readings, following.readings[:, 1:]], axis=1)
        return Piece(self.first, readings, np.concatenate([self.derivatives, following.derivatives[1:]]))

    def without_ends_before(self, end: int) -> Piece:
        """The later part of it."""
        cut = max(0, end - self.first)
        return Piece(self.first + cut, self.readings[:, cut:], self.derivatives[cut:])


def delayed_pieces(
    pieces: Iterator[Piece], delays: FloatArray, by_column: FloatArray, step: float, count: int
) -> Iterator[Piece]:
    """The pieces of a run, in order and next to each other, read late.

    Args:
        delays: of each node's readings [steps], shape (nodes,).
        by_column: derivative of each node's delay [s] by the columns of the derivatives, shape (nodes, columns).
        step: s.
        count: ends of steps in the whole run.
    """
    if not delays.any():
        yield from (_with_slopes_of_no_delay(piece, by_column, step) for piece in pieces)
        return
    margin = ceil(float(np.abs(delays).max())) + 1
    held: Piece | None = None
    waiting: list[tuple[int, int]] = []
    for piece in pieces:
        waiting.append((piece.first, piece.stop))
        held = piece if held is None else held.joined(piece)
        stop = held.stop
        while waiting and (stop == count or waiting[0][1] + margin <= stop):
            ends = np.arange(*waiting.pop(0))
            yield _read(held, ends, delays, by_column, step, count)
            held = held.without_ends_before(int(ends[-1]) - margin)


def _between(ends: IntArray, delay: float, count: int) -> tuple[IntArray, FloatArray]:
    """Ends of steps before the wanted instants, and the share of the following step that lies before them."""
    wanted = np.clip(ends - delay, 0, count - 1)
    before = np.minimum(wanted.astype(int), count - 2)
    return before, wanted - before


def _read(piece: Piece, ends: IntArray, delays: FloatArray, by_column: FloatArray, step: float, count: int) -> Piece:
    readings = np.empty((len(delays), len(ends)))
    derivatives = np.empty((len(ends), *piece.derivatives.shape[1:]))
    for node, delay in enumerate(delays):
        before, share = _between(ends, float(delay), count)
        j = before - piece.first
        values, by_values = piece.readings[node], piece.derivatives[:, node]
        readings[node] = (1 - share) * values[j] + share * values[j + 1]
        derivatives[:, node] = (1 - share)[:, None] * by_values[j] + share[:, None] * by_values[j + 1]
        inside = (ends - delay >= 0) & (ends - delay <= count - 1)
        slope = np.where(inside, _slope(values, j, share), 0.0) / step
        derivatives[:, node] -= slope[:, None] * by_column[node]
    return Piece(int(ends[0]), readings, derivatives)


def _with_slopes_of_no_delay(piece: Piece, by_column: FloatArray, step: float) -> Piece:
    """Delays of 0 leave the readings as they are, but not their derivatives."""
    slopes = np.gradient(piece.readings, step, axis=1)
    for node, slope in enumerate(slopes):
        columns = np.flatnonzero(by_column[node])
        piece.derivatives[:, node, columns] -= slope[:, None] * by_column[node, columns]
    return piece


def _slope(values: FloatArray, before: IntArray, share: FloatArray) -> FloatArray:
    """Rise in the step in which an instant lies; between two steps the mean of both, outside the run none."""
    rise = np.concatenate([[0.0], np.diff(values), [0.0]])
    end = before + (share == 1)
    return np.where((share > 0) & (share < 1), rise[before + 1], 0.5 * (rise[end] + rise[end + 1]))
