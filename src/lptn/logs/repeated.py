"""Whether two runs hold the same readings, in another format, in part, or resampled: then one can't test the other.

Two sensors, or two days, never repeat each other's noise, which second differences leave alone where a temperature
moves little from row to row. So these are correlated at every shift of one run over the other. The runs are the same
where the noise of some columns together goes with that of the other's, and they are as warm. A copy at a lower rate has
rows picked out of the other's, or read between them, or the means of several: it keeps a part of its noise. Where a
temperature has no noise, or its sensor's steps hide it, the two may differ by what a format rounds off.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.logs.channels import quantisation_step
from lptn.logs.resampling import means_of_blocks
from lptn.logs.run import Run

_MOST_FACTOR = 60  # times that one run's steps may be the other's
_MEANS = 1.5  # times, from which on a copy may hold means of several readings
_BETWEEN = 10  # places that are tried within a step of the finer run: clocks may be set by less than one
_MOST_COLUMNS, _MOST_SHIFTS = 4, 5  # that are compared; the likeliest, that are looked at
_OF_NOISE, _ROUNDED = 0.1, 0.96
"""Correlation of the noise of one row that is picked from a hundred that the other averages; and of two columns that
differ by a fifth of their noise, as by digits that a format rounds off."""
_CHANCE = 6.0  # standard deviations of it, which other readings reach once in 500 million
_SPREAD = np.sqrt(35 / 18)  # of a correlation of N second differences of white noise, times √N
_LEAST = 30  # changes of readings that are the same at least; fewer, as of robots that cool, may be by accident
_NEXT_TO_NONE = 1e-9  # of the largest power of a shift: what a sum by Fourier transforms is wrong by
_TOGETHER, _OFF = 20, 0.5
"""Rows whose mean difference is looked at, and how many times the noise of the noisier run it may be: it is 0.2 to 0.3
where both are the same, while two days differ by what the room, the start or the load did."""


def repeated_stretch(one: Run, other: Run) -> tuple[float, float] | None:
    """When in `other`, in s of its clock, its readings are those of `one`; `None` where they are its own.

    Either may be a part of the other, or its readings at a lower rate, as they are or as means.
    """
    names = [name for name in one.columns if name.startswith("temperature.") and other.has(name)]
    coarse, fine = (one, other) if one.step >= other.step else (other, one)
    ratio = coarse.step / fine.step
    if not names or ratio > _MOST_FACTOR:
        return None
    names.sort(key=lambda name: -_changes(coarse.columns[name]))
    readings = {name: coarse.columns[name] for name in names[:_MOST_COLUMNS]}
    needed = {name: _OF_NOISE if _shows_noise(values) else _ROUNDED for name, values in readings.items()}
    for means in (False, True) if ratio > _MEANS else (False,):
        copies = {name: _lower_rate(fine.columns[name], ratio, means) for name in readings}
        # The copy's first row lies anywhere within a step of its own.
        matches = [_best(readings, copies, needed, phase) for phase in range(int(np.ceil(ratio)))]
        near = max(matches, key=lambda match: match.weight).phase
        between = near + np.delete(np.arange(-_BETWEEN, _BETWEEN + 1) / _BETWEEN, _BETWEEN)
        matches += [_best(readings, copies, needed, phase) for phase in between]
        best = max(matches, key=lambda match: match.weight)
        if best.weight > _CHANCE:
            begin, start = (best.first * coarse.step, other.time[0])
            if other is fine:
                begin = (best.phase + (best.first - best.shift) * ratio) * fine.step
            return float(start + begin), float(start + begin + (best.size - 1) * coarse.step)
    return None


def _lower_rate(readings: FloatArray, ratio: float, means: bool) -> Callable[[float], FloatArray]:
    """What a copy holds whose steps are so many of a run's: its readings, or their means over its steps; by its first.

    NaN where it has none.
    """
    sums = np.concatenate(([0.0], np.cumsum(np.nan_to_num(readings))))
    counts = np.concatenate(([0.0], np.cumsum(np.isfinite(readings))))
    steps, rows = np.arange(readings.size + 1.0), np.arange(int(readings.size / ratio))

    def copy(phase: float) -> FloatArray:
        at = phase + rows * ratio
        if not means:
            return np.asarray(np.interp(at, steps[:-1], readings, left=np.nan, right=np.nan))
        ends = [np.clip(edge, 0, readings.size) for edge in (at, at + ratio)]
        total, count = (np.diff([np.interp(end, steps, x) for end in ends], axis=0)[0] for x in (sums, counts))
        return np.where(count > ratio - 1e-6, total / ratio, np.nan)

    return copy


class _Match(NamedTuple):
    """Where two runs may be one: of a copy with that phase row i at row i + shift of the coarser run.

    The weight is in standard deviations of chance, 0 for none; so many rows are shared, from a first one on.
    """

    weight: float
    phase: float
    shift: int = 0
    first: int = 0
    size: int = 0


def _best(
    readings: Mapping[str, FloatArray],
    copies: Mapping[str, Callable[[float], FloatArray]],
    needed: Mapping[str, float],
    phase: float,
) -> _Match:
    """The shift of most weight at which some columns together share their noise, and all are as warm."""
    from scipy.signal import correlate  # here, since it takes a while to import

    others = {name: copy(phase) for name, copy in copies.items()}
    length, other = len(next(iter(readings.values()))), len(next(iter(others.values())))
    if min(length, other) < _LEAST:
        return _Match(0.0, phase)
    score = np.zeros(length + other - 5)
    rows = np.zeros(length + other - 5)
    for name, values in readings.items():
        a, b = np.diff(values, n=2), np.diff(others[name], n=2)
        there, there_too = np.isfinite(a) * 1.0, np.isfinite(b) * 1.0
        a, b = np.nan_to_num(a), np.nan_to_num(b)
        shared, count = correlate(a, b, method="fft"), np.round(correlate(there, there_too, method="fft"))
        powers = [correlate(a**2, there_too, method="fft"), correlate(there, b**2, method="fft")]
        known = np.min([power > _NEXT_TO_NONE * power.max(initial=0.0) for power in powers], axis=0)
        shared = np.divide(shared, np.sqrt(np.prod(powers, axis=0).clip(0)), out=np.zeros(count.size), where=known)
        together = shared > needed[name]
        score += np.where(together, shared * count, 0.0)
        rows += np.where(together, count, 0.0)
    weight = score / (_SPREAD * np.sqrt(np.maximum(rows, 1)))
    for k in np.argsort(weight)[: -_MOST_SHIFTS - 1 : -1]:
        shift = int(k) - (other - 3)
        first, last = max(0, shift), min(length, other + shift)
        parts = {
            name: (values[first:last], others[name][first - shift : last - shift]) for name, values in readings.items()
        }
        if weight[k] > _CHANCE and _are_one(parts, needed):
            return _Match(float(weight[k]), phase, shift, first, last - first)
    return _Match(0.0, phase)


def _are_one(parts: Mapping[str, tuple[FloatArray, FloatArray]], needed: Mapping[str, float]) -> bool:
    """Whether columns that may be one, (n,) each, are as warm, and change often enough where they share their noise."""
    changes = 0
    for name, pair in parts.items():
        both = np.isfinite(pair[0]) & np.isfinite(pair[1])
        own, other = (values[both] for values in pair)
        a, b = np.diff(own, n=2), np.diff(other, n=2)
        power = float(max(a @ a, b @ b))
        if power == 0:
            continue  # a sensor that says nothing says nothing against it
        apart = means_of_blocks(own - other, _TOGETHER)
        if not apart.size or np.mean(apart**2) > _OFF**2 * power / a.size / 6:
            return False
        if min(a @ a, b @ b) > 0 and float(a @ b) > needed[name] * float(np.sqrt((a @ a) * (b @ b))):
            changes += _changes(own)
    return changes >= _LEAST


def _changes(readings: FloatArray) -> int:
    return int(np.count_nonzero(np.diff(readings[np.isfinite(readings)])))


_NOISY = -0.5  # correlation of a second difference with the next one, below which it is noise: -2/3 where it is white
_OF_STEP, _OVER, _DITHERED = 0.1, 10, 0.5
"""Of a sensor's steps, by which a temperature may move from row to row, on average over so many rows, where its noise
is less than half of them: one that moves further is rounded now up, now down, and on two days of one motion alike."""


def _shows_noise(readings: FloatArray) -> bool:
    """Whether readings turn back from row to row, as noise does, and not because they are rounded."""
    second = np.diff(readings, n=2)
    here, after = second[:-1], second[1:]
    both = np.isfinite(here) & np.isfinite(after)
    power = float(here[both] @ here[both])
    if not power > 0 or not float(here[both] @ after[both]) / power < _NOISY:
        return False
    step, moves = quantisation_step(readings), np.abs(readings[_OVER:] - readings[:-_OVER]) / _OVER
    moved = np.isfinite(moves).any() and float(np.nanmean(moves)) > _OF_STEP * step
    return not (moved and float(np.sqrt(np.nanmean(second**2) / 6)) < _DITHERED * step)
