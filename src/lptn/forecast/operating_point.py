"""What the robot is doing now: the stretch over which its operating point is unchanged, and its averaged inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lptn.arrays import BoolArray, FloatArray
from lptn.logs.features import feature
from lptn.simulate import Drive

_BLOCK = 10.0  # s; means over it are compared
_CLEAR = 4.5  # standard errors by which an operating point must have changed to count as another one
_CORRELATED = 1.5  # neighbouring blocks resemble each other, so their differences understate the scatter
_FLOOR = 0.03  # of an input's size in the log: changes so small are none
_FLOOR_KELVIN = 0.5  # K; the same for temperatures, whose zero means nothing
_LEAST_BLOCKS = 2  # on either side of a change
_MEMORY = 40.0  # s over which inputs may resemble themselves


@dataclass(frozen=True)
class OperatingPoint:
    """Averaged inputs of a window at the end of a log, and how far they are to be trusted.

    Args:
        seconds: length of the window.
        inputs: shape (inputs,): root mean squares where heat goes with the square, else means.
        error: covariance of these as the mean of what goes on, shape (inputs, inputs).
        scatter: covariance of a mean over one second, for means over much longer times: divided by a duration
            [s] it is the covariance of the mean over it, shape (inputs, inputs).
    """

    seconds: float
    inputs: FloatArray
    error: FloatArray
    scatter: FloatArray


def steady_seconds(driven: Drive, columns: list[str]) -> float:
    """How long, at the end of a log, the operating point has been unchanged [s].

    Block means of all inputs are searched for their clearest change, by the largest difference of the means
    before and behind it in standard errors. What lies before a clear change is dropped, until there is none.

    Args:
        driven: the log.
        columns: its inputs, `<feature>.<place>`, in order.
    """
    size = max(1, round(_BLOCK / driven.run.step))
    blocks = len(driven) // size
    if blocks < 2 * _LEAST_BLOCKS:
        return len(driven) * driven.run.step
    means = _before(driven.inputs, columns)[:, len(driven) - blocks * size :]
    means = means.reshape(len(columns), blocks, size).mean(axis=2)
    given = np.array([column.startswith("temperature.") for column in columns], dtype=bool)
    floor = np.where(given, _FLOOR_KELVIN, _FLOOR * np.abs(means).max(axis=1))
    first = 0
    while (change := _clearest_change(means[:, first:], floor)) is not None:
        first += change
    whole = first == 0
    return (len(driven) if whole else (blocks - first) * size) * driven.run.step


def operating_point(driven: Drive, columns: list[str], seconds: float, scatter_seconds: float) -> OperatingPoint:
    """The inputs averaged over the last `seconds` of a log, their scatter taken from the last `scatter_seconds`."""
    step, n = driven.run.step, len(driven)
    weights = np.clip(np.arange(1, n + 1) - (n - seconds / step), 0.0, 1.0)
    before = _before(driven.inputs, columns)
    mean = before @ weights / weights.sum()
    squared = _squared(columns)
    inputs = np.where(squared, np.sqrt(np.maximum(mean, 0.0)), mean)
    # d input / d mean of what is averaged; an input that rests at zero is taken to stay there.
    slope = np.where(squared, 0.5 / np.where(inputs > 0, inputs, np.inf), 1.0)
    scatter, memory = _long_run(before[:, -max(1, round(scatter_seconds / step)) :], step)
    scatter = scatter * np.outer(slope, slope)
    return OperatingPoint(seconds, inputs, scatter / max(seconds, memory), scatter)


def _before(inputs: FloatArray, columns: list[str]) -> FloatArray:
    """What the mean of each input is taken of: the square of a torque, the value itself of others."""
    return np.stack([feature(column).reduction.before(row) for column, row in zip(columns, inputs, strict=True)])


def _squared(columns: list[str]) -> BoolArray:
    probe = np.array([2.0])
    return np.array([feature(column).reduction.before(probe)[0] == 4.0 for column in columns], dtype=bool)


def _clearest_change(means: FloatArray, floor: FloatArray) -> int | None:
    """The block with which another operating point begins, `None` where none is clear."""
    count = means.shape[1]
    if count < 2 * _LEAST_BLOCKS:
        return None
    scatter = np.median(np.abs(np.diff(means, axis=1)), axis=1) * 1.4826 / np.sqrt(2) * _CORRELATED
    scatter = np.hypot(scatter, floor)
    total = np.cumsum(means, axis=1)
    before = np.arange(_LEAST_BLOCKS, count - _LEAST_BLOCKS + 1)
    behind = count - before
    difference = total[:, before - 1] / before - (total[:, -1:] - total[:, before - 1]) / behind
    clear = np.abs(difference) / np.where(scatter > 0, scatter, np.inf)[:, None] / np.sqrt(1 / before + 1 / behind)
    best = int(np.argmax(clear.max(axis=0)))
    return int(before[best]) if clear.max() > _CLEAR else None


def _long_run(series: FloatArray, step: float) -> tuple[FloatArray, float]:
    """Covariance of a mean over one second, for means over much longer times, and how long values stay alike [s].

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
    # The mean that was taken off took some slow scatter along, and few independent stretches leave it unsure.
    freedom = max(3.0, 1.5 * count / (lags + 1))
    return total * step * count / (count - lags) * freedom / (freedom - 2), memory
