"""Whether two runs hold the same readings, in another format, in part, or averaged: then one can't test the other.

Two sensors, or two days, never repeat each other's noise. So a stretch of one run is that of another if all their
columns agree far within their own change from reading to reading, wherever in time the one is laid over the other.
"""

from __future__ import annotations

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.logs.run import Run

_LEAST = 60  # changes of readings that are compared at least; fewer, as of robots that cool, may be alike by accident
_PARTS = 4  # of the shorter run, each of which is sought in the longer one
_OF_NOISE, _OF_SPREAD = 0.2, 1e-4
"""RMS of differences, as shares of the noise and of the standard deviation of a column, up to which two columns are
one: digits that a format rounds off, not readings of another day, which differ by 1.4 times the noise."""
_MOST_FACTOR = 60  # times that one run's steps may be the other's


def repeated_stretch(one: Run, other: Run) -> tuple[float, float] | None:
    """When in `other`, in s of its clock, its readings are those of `one`; `None` where they are its own.

    Args:
        one: a run.
        other: another; either may be a part of the other, or the means of its readings.
    """
    columns = [name for name in one.columns if other.has(name)]
    if not any(name.startswith("temperature.") for name in columns):
        return None
    coarse, fine = sorted((one, other), key=lambda run: -run.step)
    factor = coarse.step / fine.step
    if abs(factor - round(factor)) > 1e-6 or factor > _MOST_FACTOR:
        return None
    for phase in range(round(factor)):
        shifted = fine.slice(fine.time[phase], np.inf) if phase else fine
        if len(shifted) // round(factor) < _LEAST:
            continue
        averaged = shifted.coarsen(round(factor))
        first, second = (coarse, averaged) if coarse is one else (averaged, coarse)
        if (found := _stretch(first, second, columns)) is not None:
            return found
    return None


def _stretch(one: Run, other: Run, columns: list[str]) -> tuple[float, float] | None:
    """The same for runs of equal steps."""
    longer, shorter = (one, other) if len(one) >= len(other) else (other, one)
    size = max(len(shorter) // _PARTS, _LEAST)
    for begin in range(0, len(shorter) - size + 1, size):
        part = {name: shorter.columns[name][begin : begin + size] for name in columns}
        changes = {name: int(np.count_nonzero(np.diff(values[np.isfinite(values)]))) for name, values in part.items()}
        moving = [name for name in columns if changes[name]]
        moving.sort(key=lambda name: (not name.startswith("temperature."), -changes[name]))
        if sum(changes.values()) < _LEAST or not moving[0].startswith("temperature."):
            continue
        at = _best_shift(longer.columns[moving[0]], part[moving[0]])
        if all(_is_one(longer.columns[name][at : at + size], part[name]) for name in moving):
            start = begin if shorter is other else at
            return float(other.time[start]), float(other.time[start + size - 1])
    return None


def _best_shift(longer: FloatArray, part: FloatArray) -> int:
    """Where a part lies closest to a longer run, by the sum of squared differences."""
    middle = np.nanmean(part)
    a, b = (np.where(np.isfinite(values), values - middle, 0.0) for values in (longer, part))
    size = 1 << int(np.ceil(np.log2(a.size + b.size)))
    product = np.fft.irfft(np.fft.rfft(a, size) * np.conj(np.fft.rfft(b, size)), size)[: a.size - b.size + 1]
    squares = np.concatenate(([0.0], np.cumsum(a**2)))
    return int(np.argmin(squares[b.size :] - squares[: a.size - b.size + 1] - 2 * product))


def _is_one(values: FloatArray, part: FloatArray) -> bool:
    both = np.isfinite(values) & np.isfinite(part)
    if not both.any():
        return False
    difference = float(np.sqrt(np.mean((values[both] - part[both]) ** 2)))
    noise = float(np.nanstd(np.diff(part))) / np.sqrt(2)
    return bool(difference <= max(_OF_NOISE * noise, _OF_SPREAD * float(np.nanstd(part))))
