"""How far single readings scatter by themselves: off the line between their neighbours; of steps, by their jumps."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.logs.resampling import SEVERAL

_MAD_TO_SIGMA = 1.4826  # standard deviation of normal noise over its median absolute value
_JUMP_TO_SIGMA = 0.5 * np.sqrt(np.pi)  # the same over the mean absolute difference of two readings
_SPAN = 30  # readings over which a movement of the temperature itself is told from noise, a thirtieth of it there
_FARTHEST = 10.0  # steps; a jump that is farther counts as so far, so that rare ones hardly enter


class Scatter(NamedTuple):
    """White noise of a sensor's readings.

    Args:
        noise: standard deviation of one reading [K].
        every: s, the usual time between readings.
        readings: how many there are.
    """

    noise: float
    every: float
    readings: int

    def within(self, step: float) -> float:
        """Standard deviation of a mean of as many readings as a step of so many seconds holds, one at least [K]."""
        return self.noise * min(1.0, float(np.sqrt(self.every / step)))


def scatter_of(pieces: Sequence[tuple[FloatArray, FloatArray]], step: float = 0.0) -> Scatter:
    """Of a sensor's readings as they were logged, however irregular; 0 of fewer than three.

    Args:
        pieces: time [s], shape (n,), increasing, and readings [K], shape (n,), NaN where none is, of each piece.
        step: K, of readings that are rounded to it; 0 for others, and for means of rounded ones.
    """
    logged = [(time[there], values[there]) for time, values in pieces for there in [~np.isnan(values)]]
    spans = [stamps[2:] - stamps[:-2] for stamps, _ in logged if stamps.size > 2]
    every = 0.5 * float(np.median(np.concatenate(spans))) if spans else 0.0
    noise = 0.0
    if spans:
        noise = _noise_in_steps(logged, step) if step > 0 else _noise(logged)
    return Scatter(noise, every, sum(stamps.size for stamps, _ in logged))


def usual(scatters: Collection[Scatter], step: float) -> float:
    """What half of all readings of several logs scatter by at most, in steps of so many seconds [K]; 0 of none."""
    ordered = sorted((scatter.within(step), scatter.readings) for scatter in scatters)
    counts = np.cumsum([count for _, count in ordered])
    return ordered[int(np.searchsorted(counts, 0.5 * counts[-1]))][0] if ordered else 0.0


def _noise(pieces: Sequence[tuple[FloatArray, FloatArray]]) -> float:
    """Standard deviation of white noise by the median of how far readings are off their neighbours [K].

    Rare jumps hardly enter.
    """
    off = np.concatenate([_off_their_neighbours(stamps, readings) for stamps, readings in pieces])
    return _MAD_TO_SIGMA * float(np.median(np.abs(off))) if off.size else 0.0


def _off_their_neighbours(stamps: FloatArray, readings: FloatArray) -> FloatArray:
    """How far readings are off the line between their neighbours, over what white noise of 1 K makes: K, (m,).

    A slow temperature hardly enters. Of neighbours farther apart than usual, across a gap, it might: left out.
    """
    if readings.size < 3:
        return np.zeros(0)
    apart = np.diff(stamps)
    span = apart[:-1] + apart[1:]
    near = span <= SEVERAL * np.median(span)
    before = apart[1:] / span  # weight of the neighbour before
    off = readings[1:-1] - before * readings[:-2] - (1 - before) * readings[2:]
    return np.asarray((off / np.sqrt(1 + before**2 + (1 - before) ** 2))[near])


def _noise_in_steps(pieces: Sequence[tuple[FloatArray, FloatArray]], step: float) -> float:
    r"""Standard deviation of the noise before rounding [K], by the mean absolute jump from reading to reading.

    Two numbers that differ by d are, rounded, d apart on average, wherever the steps lie: a temperature that moves
    through several of them makes that average, and white noise a mean jump of :math:`2\sigma/\sqrt\pi`. What the
    temperature's own movement adds, in squares, is told from readings farther apart.
    """
    jumps, moves = [], []
    for stamps, readings in pieces:
        far = np.flatnonzero(np.diff(stamps) > SEVERAL * np.median(np.diff(stamps))) + 1
        for whole in (one for one in np.split(readings, far) if one.size > 1):
            span = min(_SPAN, whole.size - 1)
            jumps.append(np.abs(np.diff(whole)))
            moves.append(np.abs(whole[span:] - whole[:-span]) / span)
    if not jumps:
        return 0.0
    jump = float(np.concatenate(jumps).clip(max=_FARTHEST * step).mean())
    move = float(np.concatenate(moves).clip(max=_FARTHEST * step).mean())
    return float(_JUMP_TO_SIGMA * np.sqrt(max(jump**2 - move**2, 0.0)))
