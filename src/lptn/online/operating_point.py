"""What the robot is doing now: the period of its gait, how long its operating point is unchanged, its mean inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.identify.data import LoadedModel
from lptn.logs.reading import read_log
from lptn.logs.resampling import feature
from lptn.simulate.bound_run import BoundRun, needed_columns

# --- The period of the gait, from the joint speeds ------------------------------------------------

_FINEST = 1e-3  # s between samples; no robot logs its joints faster
LOOKED_AT = 30.0
"""s, from the end: long enough for ten cycles of a slow walk."""
_STILL = 0.05  # rad/s; joints that move no faster than this, on the average, stand
_COARSEST = 0.2  # s between samples; of rarer ones a trot at 2 Hz would look like something slower
_SHORTEST_PERIOD = 2.2  # samples, for the same reason: twice is Nyquist's limit
_LEAST_CYCLES = 3.0  # in what is looked at; of fewer, any slow movement resembles itself
_PERIODIC = 0.4  # autocorrelation of the speeds, one cycle later, that makes a gait
_FALLEN = 0.3  # autocorrelation to which the speeds fall within a cycle
_AS_HIGH = 0.92  # a peak so high beside the highest one counts, so that two cycles aren't taken for one
_FINER = 8  # lags between two samples, so that a peak between them isn't missed


@dataclass(frozen=True)
class GaitPeriod:
    """The gait at the end of a log.

    Args:
        period: s, `None` where there is none or where it can't be seen.
        why_not: in words, empty where there is a period.
    """

    period: float | None
    why_not: str = ""


def gait_of(loaded: LoadedModel, log: str | Path) -> GaitPeriod:
    """The gait at the end of a log's file, from its joint speeds with their sign and at the log's own rate."""
    inputs, outputs = needed_columns(loaded.model)
    signed = [f"signed_velocity.{node}" for node in loaded.model.nodes]
    last = read_log(
        log,
        loaded.sources_of(log)[0],
        step=_FINEST,
        inputs=inputs if loaded.guessing else (),  # for its guesses are what the model needs
        outputs=outputs,
        optional=signed,
        guessing=loaded.guessing,
    )[-1]
    return find_gait([last.columns[name] for name in signed if last.has(name)], last.step)


def find_gait(speeds: Sequence[FloatArray], step: float) -> GaitPeriod:
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
        return GaitPeriod(None, "the log has no joint speeds")
    if step > _COARSEST:
        return GaitPeriod(None, f"the gait can't be seen in samples {step:g} s apart")
    count = min(round(LOOKED_AT / step), *(len(speed) for speed in speeds), len(speeds[0]))
    recent = np.array([speed[-count:] for speed in speeds], dtype=float)
    recent = recent[np.isfinite(recent).any(axis=1)]
    recent = np.nan_to_num(recent - np.nanmean(recent, axis=1, keepdims=True))
    if recent.size == 0 or np.sqrt(np.mean(recent**2)) < _STILL:
        return GaitPeriod(None, "the joints stand")
    period = _first_peak(recent, step)
    return GaitPeriod(period, "" if period else "the joint speeds show no period")


def _first_peak(series: FloatArray, step: float) -> float | None:
    """Lag of the first peak of the rows' summed autocorrelation that is nearly as high as the highest [s]."""
    count = series.shape[1]
    spectrum = np.sum(np.abs(np.fft.rfft(series, 2 * count)) ** 2, axis=0)
    finer = np.fft.irfft(spectrum, 2 * count * _FINER)[: int(count / _LEAST_CYCLES) * _FINER]
    # Longer lags have fewer pairs; without the factor they would look less alike.
    correlation = finer / (finer[0] * (1.0 - np.arange(finer.size) / (count * _FINER)))
    inner = correlation[1:-1]
    peaks = 1 + np.flatnonzero((inner > correlation[:-2]) & (inner >= correlation[2:]))
    fallen = np.flatnonzero(correlation < _FALLEN)  # before that, a slow gait only resembles what it just was
    peaks = peaks[peaks >= max(float(fallen[0]) if fallen.size else np.inf, _SHORTEST_PERIOD * _FINER)]
    if peaks.size == 0 or correlation[peaks].max() < _PERIODIC:
        return None
    first = peaks[correlation[peaks] >= _AS_HIGH * correlation[peaks].max()][0]
    left, top, right = correlation[first - 1 : first + 2]  # the peak is that of the parabola through three
    bend = left - 2 * top + right
    return float((first + (0.5 * (left - right) / bend if bend < 0 else 0.0)) * step / _FINER)


# --- How long the operating point has been unchanged ----------------------------------------------

_BLOCK_OF_MEANS = 10.0  # s; means over it are compared: some gait cycles, and short against thermal time constants
_CLEAR = 4.5  # standard errors of a change that counts: of 800 means (27 inputs, 30 times) chance makes 0.005
_CORRELATED = 1.5  # neighbouring blocks resemble each other, so their differences understate the scatter
_FLOOR = 0.03  # of an input's size in the log: changes so small are none
_FLOOR_KELVIN = 0.5  # K; the same for temperatures, whose zero means nothing
_LEAST_BLOCKS = 2  # on either side of a change
_NORMAL_MAD = 1.4826  # standard deviation over median absolute deviation of a Gaussian


def steady_seconds(bound: BoundRun, columns: list[str]) -> float:
    """How long, at the end of a log, the operating point has been unchanged [s].

    Block means of all inputs are searched for their clearest change, by the largest difference of the means
    before and behind it in standard errors. What lies before a clear change is dropped, until there is none.

    Args:
        bound: the log.
        columns: its inputs, `<feature>.<place>`, in order.
    """
    size = max(1, round(_BLOCK_OF_MEANS / bound.run.step))
    blocks = len(bound) // size
    if blocks < 2 * _LEAST_BLOCKS:
        return len(bound) * bound.run.step
    means = _before(bound.inputs, columns)[:, len(bound) - blocks * size :]
    means = means.reshape(len(columns), blocks, size).mean(axis=2)
    kelvin = np.array([column.startswith("temperature.") for column in columns], dtype=bool)
    floor = np.where(kelvin, _FLOOR_KELVIN, _FLOOR * np.abs(means).max(axis=1))
    first = 0
    while (count := blocks - first) >= 2 * _LEAST_BLOCKS:
        rest = means[:, first:]
        scatter = np.median(np.abs(np.diff(rest, axis=1)), axis=1) * _NORMAL_MAD / np.sqrt(2) * _CORRELATED
        scatter, total = np.hypot(scatter, floor), np.cumsum(rest, axis=1)
        before = np.arange(_LEAST_BLOCKS, count - _LEAST_BLOCKS + 1)
        behind = count - before
        difference = total[:, before - 1] / before - (total[:, -1:] - total[:, before - 1]) / behind
        clear = np.abs(difference) / np.where(scatter > 0, scatter, np.inf)[:, None] / np.sqrt(1 / before + 1 / behind)
        if clear.max() <= _CLEAR:
            break
        first += int(before[int(np.argmax(clear.max(axis=0)))])
    return ((blocks - first) * size if first else len(bound)) * bound.run.step


# --- The operating point: inputs averaged over the end of the log, and how sure their means are ---

_MEMORY = 40.0  # s over which inputs may resemble themselves: turns and slopes of the ground

WindowChoice = Literal["steady", "cycles"] | float


@dataclass(frozen=True)
class OperatingPoint:
    """The end of a log that is taken to go on: its averaged inputs, and how far they are to be trusted.

    Args:
        seconds: length of the window.
        steady: how long the operating point has been unchanged [s].
        inputs: shape (inputs,): root mean squares where heat goes with the square, else means.
        error: covariance of these as the mean of what goes on, shape (inputs, inputs).
        scatter: covariance of a mean over one second, for means over much longer times: divided by a duration
            [s] it is the covariance of the mean over it, shape (inputs, inputs).
        cycles: gait cycles in the window, `None` where no gait was found.
        period: of the gait [s], `None` likewise.
        why: what the window is, in words.
    """

    seconds: float
    steady: float
    inputs: FloatArray
    error: FloatArray
    scatter: FloatArray
    cycles: int | None = None
    period: float | None = None
    why: str = ""


def present_operating_point(
    bound: BoundRun, columns: list[str], window: WindowChoice, cycles: int, gait: GaitPeriod
) -> OperatingPoint:
    """What the robot does at the end of a log, averaged over whole gait cycles where there is a gait.

    The scatter of the inputs is taken from all that is steady.

    Args:
        bound: the log.
        columns: its inputs, `<feature>.<place>`, in order.
        window: what is averaged, and of how many `cycles`: as `lptn.forecast` takes it.
        gait: of the log.
    """
    length, period = len(bound) * bound.run.step, gait.period
    steady = steady_seconds(bound, columns)
    no_gait = f" ({gait.why_not})" if window == "cycles" and not period else ""
    count: int | None = None
    if not isinstance(window, str):
        seconds = min(float(window), length)
        why = f"the last {seconds:.4g} s, as asked for"
    elif window == "cycles" and period is not None:
        count = min(cycles, int(length / period))
        seconds, why = count * period, f"the last {count} gait cycles"
    else:
        whole = f"the whole log, {steady:.4g} s" if steady >= length - bound.run.step else f"the last {steady:.4g} s"
        seconds, why = steady, f"{whole}, over which the operating point is unchanged{no_gait}"
        if period is not None and steady >= period:
            count = int(steady / period)
            seconds = count * period
    step, n = bound.run.step, len(bound)
    weights = np.clip(np.arange(1, n + 1) - (n - seconds / step), 0.0, 1.0)
    before = _before(bound.inputs, columns)
    mean = before @ weights / weights.sum()
    squared = _before(np.full((len(columns), 1), 2.0), columns)[:, 0] == 4.0
    inputs = np.where(squared, np.sqrt(np.maximum(mean, 0.0)), mean)
    # d input / d mean of what is averaged; an input that rests at zero is taken to stay there.
    slope = np.where(squared, 0.5 / np.where(inputs > 0, inputs, np.inf), 1.0)
    scatter, memory = _long_run(before[:, -max(1, round(max(seconds, steady) / step)) :], step)
    scatter = scatter * np.outer(slope, slope)
    return OperatingPoint(seconds, steady, inputs, scatter / max(seconds, memory), scatter, count, period, why)


def _before(inputs: FloatArray, columns: list[str]) -> FloatArray:
    """What the mean of each input is taken of: the square of a torque, the value itself of others."""
    return np.stack([feature(column).before(row) for column, row in zip(columns, inputs, strict=True)])


def _long_run(series: FloatArray, step: float) -> tuple[FloatArray, float]:
    """Covariance of a mean over one second, for means over much longer times, and correlation time [s].

    The covariances at all lags are summed with falling weights [NeweyWest1987].
    """
    count = series.shape[1]
    centred = series - series.mean(axis=1, keepdims=True)
    lags = min(round(_MEMORY / step), count // 4)
    now = centred @ centred.T / count
    total = now.copy()
    for lag in range(1, lags + 1):
        product = centred[:, lag:] @ centred[:, :-lag].T / count
        total += (1 - lag / (lags + 1)) * (product + product.T)
    varied = np.diag(now) > 0
    memory = float(np.median(np.diag(total)[varied] / np.diag(now)[varied])) * step if varied.any() else 0.0
    # The mean that was taken off took some slow scatter with it. Of few independent samples the variance is uncertain:
    # Student's t of so many degrees of freedom is that much wider than a Gaussian.
    freedom = max(3.0, 1.5 * count / (lags + 1))
    return total * step * count / (count - lags) * freedom / (freedom - 2), memory
