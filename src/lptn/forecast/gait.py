"""The period of the gait, from the joint speeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lptn.arrays import FloatArray

_LOOKED_AT = 30.0  # s, from the end: long enough for ten cycles of a slow walk
_STILL = 0.05  # rad/s; joints that move no faster than this, on the average, stand
_COARSEST = 0.2  # s between samples; of rarer ones a trot at 2 Hz would look like something slower
_LEAST_SAMPLES = 2.2  # a cycle, for the same reason
_LEAST_CYCLES = 3.0
_ALIKE = 0.4  # correlation of the speeds with themselves, one cycle later, that makes a gait
_APART = 0.3  # correlation to which the speeds fall within a cycle
_AS_GOOD = 0.92  # a peak so high beside the highest one counts, so that two cycles aren't taken for one
_FINER = 8  # lags between two samples, so that a peak between them isn't missed


@dataclass(frozen=True)
class Gait:
    """The gait at the end of a log.

    Args:
        period: s, `None` where there is none or where it can't be seen.
        why_not: in words, empty where there is a period.
    """

    period: float | None
    why_not: str = ""


def find_gait(speeds: Sequence[FloatArray], step: float) -> Gait:
    """The gait at the end of a log.

    Its period is the lag at which the joint speeds look most like themselves, all joints together: the first peak of
    their summed autocorrelation that is nearly as high as the highest.

    Args:
        speeds: speed of each joint [rad/s], with its sign, (n,) each. Of speeds without a sign, a cycle of which one
            half mirrors the other shows half its period.
        step: time between samples [s].

    Source: [QuadrupedLPTN, application 3].
    """
    if not speeds:
        return Gait(None, "the log has no joint speeds")
    if step > _COARSEST:
        return Gait(None, f"the gait can't be seen in samples {step:g} s apart")
    count = min(round(_LOOKED_AT / step), *(len(speed) for speed in speeds), len(speeds[0]))
    recent = np.array([speed[-count:] for speed in speeds], dtype=float)
    known = np.isfinite(recent).any(axis=1)
    recent = np.nan_to_num(recent[known] - np.nanmean(recent[known], axis=1, keepdims=True))
    if recent.size == 0 or np.sqrt(np.mean(recent**2)) < _STILL:
        return Gait(None, "the joints stand")
    period = _first_peak(_autocorrelation(recent), step / _FINER, _LEAST_SAMPLES * step)
    return Gait(period, "" if period else "the joint speeds show no period")


def _autocorrelation(series: FloatArray) -> FloatArray:
    """Autocorrelation summed over the rows, at lags of 1/_FINER of a sample, up to a third of the length."""
    count = series.shape[1]
    spectrum = np.sum(np.abs(np.fft.rfft(series, 2 * count)) ** 2, axis=0)
    finer = np.fft.irfft(spectrum, 2 * count * _FINER)[: int(count / _LEAST_CYCLES) * _FINER]
    # Longer lags have fewer pairs; without the factor they would look less alike.
    pairs = 1.0 - np.arange(finer.size) / (count * _FINER)
    return np.asarray(finer / (finer[0] * pairs))


def _first_peak(correlation: FloatArray, step: float, least: float) -> float | None:
    inner = correlation[1:-1]
    peaks = 1 + np.flatnonzero((inner > correlation[:-2]) & (inner >= correlation[2:]))
    apart = np.flatnonzero(correlation < _APART)  # before that, a slow gait only resembles what it just was
    begin = max(float(apart[0]) if apart.size else np.inf, least / step)
    peaks = peaks[peaks >= begin]
    if peaks.size == 0 or correlation[peaks].max() < _ALIKE:
        return None
    first = peaks[correlation[peaks] >= _AS_GOOD * correlation[peaks].max()][0]
    left, top, right = correlation[first - 1 : first + 2]
    bend = left - 2 * top + right
    return float((first + (0.5 * (left - right) / bend if bend < 0 else 0.0)) * step)
