"""How far single readings scatter by themselves: each against the straight line between its neighbours."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.logs.resampling import SEVERAL

MAD_TO_SIGMA = 1.4826  # standard deviation of normal noise over its median absolute value
_ROUNDED_AND_BLURRED = 2 / 12  # of the step squared: variance of rounding, and as much of the blur
_HARMONICS = 30  # of the rounding, in which all but a fiftieth of it is
_HALVINGS = 40  # of the stretch in which the median is: to 1e-12 of it


class Scatter(NamedTuple):
    """White noise of a sensor: standard deviation of one reading [K], s between readings, and how many there are."""

    noise: float
    every: float
    readings: int

    def within(self, step: float) -> float:
        """Standard deviation of a mean of as many readings as a step of so many seconds holds, one at least [K]."""
        return self.noise * min(1.0, float(np.sqrt(self.every / step)))

    def of_means(self, step: float, resolution: float) -> tuple[float, float]:
        """White noise of means over steps of so many seconds, and what they have left of a sensor's steps [K].

        Noise carries a reading over the edges of a step, so that a mean of several lies between these: what is left of
        the rounding are its harmonics in the temperature, each less by the noise (Widrow's theory of quantisation). The
        rest of the rounding is noise from reading to reading. A temperature that passes through steps within a mean
        leaves less, but it comes to rest, too. A step that holds about one reading has that, with all of its rounding.

        Returns:
            the standard deviation, and the steps that would round as much, in the sense of a step over √12.
        """
        count = max(1.0, step / self.every) if self.every > 0 else 1.0
        if resolution == 0.0 or count < SEVERAL:
            return self.noise / float(np.sqrt(count)), resolution
        k = np.arange(1, _HARMONICS + 1)
        power = (resolution / (np.pi * k)) ** 2 / 2 * np.exp(-((2 * np.pi * k * self.noise / resolution) ** 2))
        white = max(self.noise**2 + resolution**2 / 12 - float(power.sum()), 0.0) / count
        return float(np.sqrt(white)), float(np.sqrt(12 * power.sum()))


def scatter_of(time: FloatArray, values: FloatArray, step: float = 0.0) -> Scatter:
    """Of a sensor's readings (n,) at times (n,) s, however irregular, NaN where none is; 0 of fewer than three.

    It reads in steps of `step` K, 0 for a fine one.
    """
    stamps = time[~np.isnan(values)]
    every = 0.5 * float(np.median(stamps[2:] - stamps[:-2])) if stamps.size > 2 else 0.0
    return Scatter(white_noise(off_their_neighbours(time, values), step), every, stamps.size)


def usual(scatters: Collection[Scatter], step: float) -> float:
    """What half of all readings of several logs scatter by at most, in steps of so many seconds [K]; 0 of none."""
    ordered = sorted((scatter.within(step), scatter.readings) for scatter in scatters)
    counts = np.cumsum([count for _, count in ordered])
    return ordered[int(np.searchsorted(counts, 0.5 * counts[-1]))][0] if ordered else 0.0


def off_their_neighbours(time: FloatArray, values: FloatArray) -> FloatArray:
    """How far readings are off the line between their neighbours, over what white noise of 1 K makes: K, (m,).

    Times and readings are (n,), NaN where none is. A slow temperature hardly enters. Of neighbours farther apart than
    usual, across a gap, it might: left out.
    """
    there = ~np.isnan(values)
    stamps, readings = time[there], values[there]
    if readings.size < 3:
        return np.zeros(0)
    apart = np.diff(stamps)
    span = apart[:-1] + apart[1:]
    near = span <= SEVERAL * np.median(span)
    before = apart[1:] / span  # weight of the neighbour before
    off = readings[1:-1] - before * readings[:-2] - (1 - before) * readings[2:]
    return np.asarray((off / np.sqrt(1 + before**2 + (1 - before) ** 2))[near])


def white_noise(off: FloatArray, step: float = 0.0) -> float:
    """Standard deviation by the median absolute value of what `off_their_neighbours` gives [K]; 0 of nothing.

    Rare jumps hardly enter. Of readings in steps [K] that median would be one of a few numbers. Blurred by as much as
    rounding blurs, it grows with the noise; what the blur and the rounding add to it is taken off again. Noise below a
    third of a step hardly moves such readings and is told as less than it is, down to none: beside the rounding it
    counts for little. Of means of rounded readings the step is 0.
    """
    if not off.size:
        return 0.0
    if step == 0.0:
        return MAD_TO_SIGMA * float(np.median(np.abs(off)))
    values, counts = np.unique(np.abs(off) / step, return_counts=True)
    least, most = 0.0, float(values[-1]) + 0.5
    for _ in range(_HALVINGS):
        median = (least + most) / 2
        # Each value is spread evenly over a step, half of it to either side, as what was rounded is.
        within = np.clip(median - values + 0.5, 0.0, 1.0) - np.clip(-median - values + 0.5, 0.0, 1.0)
        least, most = (median, most) if within @ counts < 0.5 * off.size else (least, median)
    return step * float(np.sqrt(max((MAD_TO_SIGMA * median) ** 2 - _ROUNDED_AND_BLURRED, 0.0)))
