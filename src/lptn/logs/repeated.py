"""Whether two runs hold the same readings, in another format, in part, or resampled: then one can't test the other.

Two sensors, or two days, never repeat each other's noise, which second differences leave alone where a temperature
moves little from row to row. So these are correlated at every shift of one run over the other. The runs are the same
where the noise of some columns together goes with that of the other's, and they are as warm. A copy at a lower rate has
rows picked out of the other's, or read between them, or the means of several: it keeps a part of its noise. Where a
temperature has no noise, or its sensor's steps hide it, the two may differ by what a format rounds off.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy.fft import irfft, next_fast_len, rfft

from lptn.basics.arrays import FloatArray, IntArray
from lptn.logs.channels import quantisation_step
from lptn.logs.resampling import means_of_blocks
from lptn.logs.run import Run

_MOST_FACTOR = 60  # times that one run's steps may be the other's
_MEANS = 1.5  # times, from which on a copy may hold means of several readings
_FINER = 10  # places that are tried within a step of the finer run: clocks may be set by less than one
_MOST_COLUMNS, _MOST_SHIFTS = 4, 20  # that are compared; the likeliest, that are looked at
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
    at = np.round(_FINER * ratio * np.arange(len(coarse))).astype(int)  # its rows, in parts of the other's steps
    for mean_of in (1.0, ratio) if ratio > _MEANS else (1.0,):
        pairs = [(coarse.columns[name], _between(fine.columns[name], mean_of)) for name in names[:_MOST_COLUMNS]]
        shift = _best_shift(at, [(*pair, _OF_NOISE if _shows_noise(pair[0]) else _ROUNDED) for pair in pairs])
        if shift is not None:
            rows = np.flatnonzero((at + shift >= 0) & (at + shift < pairs[0][1].size))[[0, -1]]
            begin, end = coarse.step * rows if other is coarse else fine.step * (at[rows] + shift) / _FINER
            return float(other.time[0] + begin), float(other.time[0] + end)
    return None


def _between(readings: FloatArray, mean_of: float) -> FloatArray:
    """What a copy reads that begins at any part of a step: on the lines between readings, or the mean of several.

    NaN where it has none.
    """
    if mean_of == 1.0:
        lines = readings[:-1, None] + np.diff(readings)[:, None] * np.arange(_FINER) / _FINER
        lines[:, 0] = readings[:-1]
        return np.append(lines, readings[-1])
    size = round(_FINER * mean_of)
    return pd.Series(np.repeat(readings, _FINER)).rolling(size).mean().to_numpy(np.float64)[size - 1 :]


Columns = Sequence[tuple[FloatArray, FloatArray, float]]
"""Readings of each column, (n,), what the other run has of it, and the correlation of noise that a copy of it has."""


def _best_shift(at: IntArray, columns: Columns) -> int | None:
    """Where in others' columns readings begin whose noise some of these share, and which are all as warm, if anywhere.

    How far apart the readings are in those columns is `at`, (n,).
    """
    if at.size < _LEAST or columns[0][1].size <= 2 * at[1]:
        return None
    step, score, rows = int(at[1]), np.zeros(()), np.zeros(())

    def shifted(of_other: FloatArray, of_own: FloatArray) -> FloatArray:
        """Sums of products at each shift, by transforms: `scipy.signal.correlate` takes a second to import."""
        placed = np.zeros(at[-3] + 1)
        placed[at[-3] - at[:-2]] = of_own  # backwards, since a product of transforms turns one of the two
        count = of_other.size + placed.size - 1
        size = next_fast_len(count, real=True)
        return np.asarray(irfft(rfft(of_other, size) * rfft(placed, size), size)[:count])

    for own, other, needed in columns:
        a, b = np.diff(own, n=2), other[2 * step :] - 2 * other[step:-step] + other[: -2 * step]
        there, there_too = np.isfinite(a) * 1.0, np.isfinite(b) * 1.0
        a, b = np.nan_to_num(a), np.nan_to_num(b)
        count, powers = np.round(shifted(there_too, there)), [shifted(there_too, a**2), shifted(b**2, there)]
        known = np.min([power > _NEXT_TO_NONE * power.max(initial=0.0) for power in powers], axis=0)
        power = np.sqrt(np.prod(powers, axis=0).clip(0))
        shared = np.divide(shifted(b, a), power, out=np.zeros(count.size), where=known)
        together = shared > needed
        score = score + np.where(together, shared * count, 0.0)
        rows = rows + np.where(together, count, 0.0)
    weight = score / (_SPREAD * np.sqrt(np.maximum(rows, 1)))
    for k in np.argsort(weight)[: -_MOST_SHIFTS - 1 : -1]:
        shift = int(k) - int(at[-3])
        inside = (at + shift >= 0) & (at + shift < columns[0][1].size)
        parts = [(own[inside], other[at[inside] + shift], needed) for own, other, needed in columns]
        if weight[k] > _CHANCE and _are_one(parts):
            return shift
    return None


def _are_one(parts: Columns) -> bool:
    """Whether columns that may be one, (n,) each, are as warm, and change often enough where they share their noise."""
    changes = 0
    for one, copy, needed in parts:
        both = np.isfinite(one) & np.isfinite(copy)
        own, other = one[both], copy[both]
        a, b = np.diff(own, n=2), np.diff(other, n=2)
        power = float(max(a @ a, b @ b))
        if power == 0:
            continue  # a sensor that says nothing says nothing against it
        apart = means_of_blocks(own - other, _TOGETHER)
        if not apart.size or np.mean(apart**2) > _OFF**2 * power / a.size / 6:
            return False
        if min(a @ a, b @ b) > 0 and float(a @ b) > needed * float(np.sqrt((a @ a) * (b @ b))):
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
