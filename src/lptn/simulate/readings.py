"""From a trajectory to what a log holds of it: what its sensors read, at the log's own clock.

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


def delayed(readings: FloatArray, delays: FloatArray) -> FloatArray:
    """Readings of n rows, shape (nodes, n), each node's late by its delay [rows], shape (nodes,)."""
    late, rows = np.empty_like(readings), np.arange(readings.shape[1])
    for node, delay in enumerate(delays):
        before, share = _between(rows, float(delay), len(rows))
        late[node] = _interpolated(readings[node], before, share)
    return late


@dataclass(frozen=True)
class Piece:
    """What a run's sensors would read without delay, in w rows, with derivatives.

    Args:
        first: number of the first of these rows in the run.
        readings: degC, shape (nodes, w).
        derivatives: shape (w, nodes, columns).
    """

    first: int
    readings: FloatArray
    derivatives: FloatArray

    @property
    def stop(self) -> int:
        """Number of the row behind the last one."""
        return self.first + int(self.readings.shape[1])

    def joined(self, following: Piece) -> Piece:
        """With the piece behind it."""
        readings = np.concatenate([self.readings, following.readings], axis=1)
        return Piece(self.first, readings, np.concatenate([self.derivatives, following.derivatives]))

    def without_rows_before(self, row: int) -> Piece:
        """The later part of it."""
        cut = max(0, row - self.first)
        return Piece(self.first + cut, self.readings[:, cut:], self.derivatives[cut:])


def delayed_pieces(
    pieces: Iterator[Piece], delays: FloatArray, by_column: FloatArray, step: float, count: int
) -> Iterator[Piece]:
    """The pieces of a run, in order and next to each other, read late.

    Args:
        delays: of each node's readings [rows], shape (nodes,).
        by_column: derivative of each node's delay [s] by the columns of the derivatives, shape (nodes, columns).
        step: length of a row [s].
        count: rows of the whole run.
    """
    margin = ceil(float(np.abs(delays).max(initial=0.0))) + 1
    held: Piece | None = None
    waiting: list[tuple[int, int]] = []
    for piece in pieces:
        waiting.append((piece.first, piece.stop))
        held = piece if held is None else held.joined(piece)
        stop = held.stop
        while waiting and (stop == count or waiting[0][1] + margin <= stop):
            rows = np.arange(*waiting.pop(0))
            yield _read(held, rows, delays, by_column, step, count)
            held = held.without_rows_before(int(rows[-1]) - margin)


def _between(rows: IntArray, delay: float, count: int) -> tuple[IntArray, FloatArray]:
    """Rows before the wanted instants, and the share of a row's length by which they lie behind these."""
    wanted = np.clip(rows - delay, 0, count - 1)
    before = wanted.astype(int)
    return before, wanted - before


def _interpolated(values: FloatArray, before: IntArray, share: FloatArray) -> FloatArray:
    """Between rows of values, along the first axis, and those behind them."""
    found = values[before]
    if share.any():
        share = share.reshape(-1, *[1] * (values.ndim - 1))
        found = (1 - share) * found + share * values[np.minimum(before + 1, len(values) - 1)]
    return found


def _read(piece: Piece, rows: IntArray, delays: FloatArray, by_column: FloatArray, step: float, count: int) -> Piece:
    readings = np.empty((len(delays), len(rows)))
    derivatives = np.empty((len(rows), *piece.derivatives.shape[1:]))
    for node, delay in enumerate(delays):
        before, share = _between(rows, float(delay), count)
        own = before - piece.first
        readings[node] = _interpolated(piece.readings[node], own, share)
        derivatives[:, node] = _interpolated(piece.derivatives[:, node], own, share)
        inside = (rows - delay >= 0) & (rows - delay <= count - 1)
        slope = np.where(inside, _slope(piece.readings[node], own, share), 0.0) / step
        columns = np.flatnonzero(by_column[node])
        derivatives[:, node, columns] -= slope[:, None] * by_column[node, columns]
    return Piece(int(rows[0]), readings, derivatives)


def _slope(values: FloatArray, before: IntArray, share: FloatArray) -> FloatArray:
    """Rise from row to row where an instant lies; at a row the mean of both sides, outside the run none."""
    rise = np.concatenate([[0.0], np.diff(values), [0.0]])
    return np.where(share > 0, rise[before + 1], 0.5 * (rise[before] + rise[before + 1]))
