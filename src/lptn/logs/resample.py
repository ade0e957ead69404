"""Raw samples put on a uniform grid: held inputs, mean or interpolated temperatures."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from lptn.arrays import FloatArray
from lptn.logs.features import feature, ratio, sample_values


@dataclass(frozen=True)
class Samples:
    """Raw samples of a log: `time` (n,) s, strictly increasing, and `raw` quantities (n,), SI and degC."""

    time: FloatArray
    raw: Mapping[str, FloatArray]

    @property
    def period(self) -> float:
        """The usual time between samples, s."""
        return float(np.median(np.diff(self.time)))


def grid(start: float, step: float, n: int) -> FloatArray:
    """`n` times `step` seconds apart from `start`, (n,) s."""
    return start + step * np.arange(n, dtype=np.float64)


def driven(held: Samples, columns: Collection[str], start: float, step: float, n: int) -> dict[str, FloatArray]:
    """Input features on `n` bins of `step` s from `start`, (n,) each, from samples without NaN there."""
    bins = Bins(held.time, start, step, n)
    result = {}
    for column in columns:
        # A prescribed temperature is read off as the measured ones are where steps and samples are alike.
        if column.startswith("temperature.") and step < 1.5 * held.period:
            at = grid(start, step, n)
            result[column] = interpolate(held.time, held.raw[column], at, np.inf)
        else:
            result[column] = bins.reduce(column, sample_values(column, held.raw))
    return result


def measured(
    samples: Samples, columns: Collection[str], start: float, step: float, n: int, max_gap: float
) -> dict[str, FloatArray]:
    """Temperatures at each bin's start or, of several samples, their mean, (n,) each, NaN where missing."""
    if step < 1.5 * samples.period:
        at = grid(start, step, n)
        return {name: interpolate(samples.time, samples.raw[name], at, max_gap) for name in columns}
    return {name: _averaged(samples.time, samples.raw[name], start, step, n, max_gap) for name in columns}


def _averaged(time: FloatArray, values: FloatArray, start: float, step: float, n: int, max_gap: float) -> FloatArray:
    """Means over bins; of a sensor that gives about one reading a bin, its readings' straight line at the middles.

    The mean of one reading early in a bin would come half a step too soon. Bins without a reading stay empty.
    """
    means = mean_in_bins(time, values, start, step, n)
    known = ~np.isnan(values)
    if known.sum() < 2 or np.median(np.diff(time[known])) < step / 1.5:
        return means
    middles = interpolate(time[known], values[known], grid(start, step, n) + 0.5 * step, max(max_gap, 1.5 * step))
    return np.where(np.isnan(means) | np.isnan(middles), means, middles)


class Bins:
    """Held samples cut at the bins' edges: made once for a stretch, used for each of its columns.

    Args:
        time: (m,) s, increasing, the first not after `start`; each sample is held until the next.
        start: s, start of the first bin.
        step: s, length of a bin.
        n: number of bins.
    """

    def __init__(self, time: FloatArray, start: float, step: float, n: int) -> None:
        edges = grid(start, step, n + 1)
        inner = time[(time > start) & (time < edges[-1])]
        cuts = np.union1d(inner, edges[:-1])
        self._widths = np.diff(cuts, append=edges[-1])
        self._sample = np.searchsorted(time, cuts, side="right") - 1
        self._first = np.searchsorted(cuts, edges[:-1])
        self._total = np.add.reduceat(self._widths, self._first)

    def reduce(self, column: str, values: FloatArray) -> FloatArray:
        """One value a bin, (n,), from samples (m,) without NaN; no integral of the held signal is lost."""
        rule = feature(column).reduction
        pieces = rule.before(values)[self._sample] * self._widths
        return rule.after(np.add.reduceat(pieces, self._first) / self._total)


def mean_in_bins(time: FloatArray, values: FloatArray, start: float, step: float, n: int) -> FloatArray:
    """Plain mean of the samples that fall in each of `n` bins, (n,); NaN where there is none."""
    # A stamp such as 2.9999999999 belongs to the bin that starts at 3.
    index = np.floor((time - start) / step + 1e-6).astype(np.int64)
    inside = (index >= 0) & (index < n) & ~np.isnan(values)
    total = np.bincount(index[inside], weights=values[inside], minlength=n).astype(np.float64)
    return ratio(total, np.bincount(index[inside], minlength=n))


def interpolate(time: FloatArray, values: FloatArray, at: FloatArray, max_gap: float) -> FloatArray:
    """`values` at the times `at`, (n,), on straight lines between neighbouring samples.

    NaN where a neighbour is NaN or the neighbours are more than `max_gap` seconds apart; a sample that is hit
    counts alone. Beyond the ends the first and the last sample hold.
    """
    right = np.clip(np.searchsorted(time, at), 1, time.size - 1)
    left = right - 1
    width = time[right] - time[left]
    weight = np.clip((at - time[left]) / width, 0.0, 1.0)
    between = (1 - weight) * values[left] + weight * values[right]
    between[width > max_gap] = np.nan
    # Rounding of a time stamp must not drag a NaN neighbour in.
    return np.where(weight < 1e-6, values[left], np.where(weight > 1 - 1e-6, values[right], between))


def hold(values: FloatArray) -> FloatArray:
    """`values` with each NaN replaced by the last number before it; NaN at the beginning stays."""
    last = np.maximum.accumulate(np.where(np.isnan(values), 0, np.arange(values.size)))
    return values[last]
