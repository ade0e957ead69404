"""Readings that come late or early: a trajectory read at other times than those that the log says."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np

from lptn.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Piece:
    """What a run's sensors would read in time, at the w + 1 ends of w steps, with derivatives.

    Args:
        first: number of the first of these ends in the run.
        readings: degC, shape (nodes, w + 1).
        derivatives: shape (w + 1, nodes, columns).
    """

    first: int
    readings: FloatArray
    derivatives: FloatArray


def read_late(readings: FloatArray, late: FloatArray) -> FloatArray:
    """Values at the ends of a run's steps, shape (nodes, n + 1), read `late` steps late, shape (nodes,)."""
    count = readings.shape[1]
    where = [_between(np.arange(count), steps, count) for steps in late]
    # Written so that no delay at all gives the same numbers to the last bit.
    return np.array(
        [(1 - share) * row[j] + share * row[j + 1] for row, (j, share) in zip(readings, where, strict=True)]
    )


def pieces_read_late(
    pieces: Iterator[Piece], late: FloatArray, by_delay: FloatArray, step: float, count: int
) -> Iterator[Piece]:
    """The pieces of a run, in order and next to each other, read late; no more of them is held than the delay needs.

    Args:
        late: steps by which each node's readings come late, shape (nodes,).
        by_delay: derivative of each node's delay [s] by the columns, shape (nodes, columns).
        step: s.
        count: ends of steps in the whole run.
    """
    if not late.any():
        yield from (_not_late_yet(piece, by_delay, step) for piece in pieces)
        return
    margin = ceil(float(np.abs(late).max())) + 1
    held: Piece | None = None
    waiting: list[tuple[int, int]] = []
    for piece in pieces:
        waiting.append((piece.first, piece.first + piece.readings.shape[1]))
        held = piece if held is None else _joined(held, piece)
        known = held.first + held.readings.shape[1]
        while waiting and (known == count or waiting[0][1] + margin <= known):
            first, stop = waiting.pop(0)
            yield _read(held, np.arange(first, stop), late, by_delay, step, count)
            held = _less(held, stop - 1 - margin)


def _between(ends: IntArray, late: float, count: int) -> tuple[IntArray, FloatArray]:
    """Before and behind which ends of steps the wanted instants lie: the former, and the share of the way."""
    wanted = np.clip(ends - late, 0, count - 1)
    before = np.minimum(wanted.astype(int), count - 2)
    return before, wanted - before


def _read(piece: Piece, ends: IntArray, late: FloatArray, by_delay: FloatArray, step: float, count: int) -> Piece:
    readings = np.empty((len(late), len(ends)))
    derivatives = np.empty((len(ends), *piece.derivatives.shape[1:]))
    for node, steps in enumerate(late):
        before, share = _between(ends, float(steps), count)
        j = before - piece.first
        values, moved = piece.readings[node], piece.derivatives[:, node]
        readings[node] = (1 - share) * values[j] + share * values[j + 1]
        derivatives[:, node] = (1 - share)[:, None] * moved[j] + share[:, None] * moved[j + 1]
        inside = (ends - steps >= 0) & (ends - steps <= count - 1)
        slope = np.where(inside, _slope(values, j, share), 0.0) / step
        derivatives[:, node] -= slope[:, None] * by_delay[node]
    return Piece(int(ends[0]), readings, derivatives)


def _not_late_yet(piece: Piece, by_delay: FloatArray, step: float) -> Piece:
    """The same for delays of 0, where only their derivatives are to be added."""
    slopes = np.gradient(piece.readings, step, axis=1)
    for node, slope in enumerate(slopes):
        moving = np.flatnonzero(by_delay[node])
        piece.derivatives[:, node, moving] -= slope[:, None] * by_delay[node, moving]
    return piece


def _slope(values: FloatArray, before: IntArray, share: FloatArray) -> FloatArray:
    """Rise in the step in which an instant lies; where it lies between two steps the mean of both.

    Before the first value and behind the last there is no rise.
    """
    rise = np.concatenate([[0.0], np.diff(values), [0.0]])
    node = before + (share == 1)
    between = 0.5 * (rise[node] + rise[node + 1])
    return np.where((share > 0) & (share < 1), rise[before + 1], between)


def _joined(one: Piece, other: Piece) -> Piece:
    """Two pieces next to each other, the end that they share taken once."""
    readings = np.concatenate([one.readings, other.readings[:, 1:]], axis=1)
    return Piece(one.first, readings, np.concatenate([one.derivatives, other.derivatives[1:]]))


def _less(piece: Piece, first: int) -> Piece:
    """A piece without what lies before an end."""
    cut = max(0, first - piece.first)
    return Piece(piece.first + cut, piece.readings[:, cut:], piece.derivatives[cut:])
