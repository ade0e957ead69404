"""The present operating point held: temperatures to come, and how sure they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from lptn.arrays import FloatArray
from lptn.forecast.dynamics import Dynamics
from lptn.forecast.operating_point import OperatingPoint
from lptn.forecast.present import Present, advance
from lptn.model import Model

_FIRST_STEP, _LAST_STEP, _GROWTH = 5.0, 300.0, 1.05  # s
_TIME_CONSTANTS = 5.0  # of the slowest heat flow, after which little moves
_LONGEST = 12 * 3600.0  # s
_HOTTEST = 500.0  # degC; beyond it nothing more is computed


@dataclass(frozen=True)
class Future:
    """Expected readings.

    Args:
        time: s from now, shape (n,), the first 0.
        mean: degC, shape (nodes, n).
        spread: standard deviation [K], shape (nodes, n).
        settled: whether the path goes on until little moves; else the temperatures run away.
    """

    time: FloatArray
    mean: FloatArray
    spread: FloatArray
    settled: bool


def future(model: Model, present: Present, point: OperatingPoint) -> Future:
    """Carry the present forwards with the operating point held.

    The operating point is known as the mean over a window, so its error is one more unknown; besides, the inputs go
    on to vary as they did in that window.
    """
    dynamics = Dynamics(model)
    n, nodes, size, mean = len(model.states), len(model.nodes), present.mean.size, present.mean
    covariance = block_diag(present.covariance, point.error)
    p = dynamics.values(mean[n + nodes :])  # the unknowns behind missing heat stay as they are
    time, step = [0.0], _FIRST_STEP
    paths = [_shown(dynamics, mean[:n], p, covariance[:size, :size])]
    slowest = float(np.abs(np.linalg.eigvals(dynamics.rates(mean[:n], point.inputs, p)).real).min())
    horizon = min(_TIME_CONSTANTS / max(slowest, 1e-9), _LONGEST)
    while time[-1] < horizon:
        motion = dynamics.step(mean[:n], mean[n : n + nodes], point.inputs, p, step)
        mean, covariance = advance(mean, covariance, motion, present.heat, step)
        covariance[:n, :n] += motion.by_input @ (point.scatter / step) @ motion.by_input.T
        if not np.isfinite(mean).all() or mean[:n].max() > _HOTTEST:
            break
        time.append(time[-1] + step)
        paths.append(_shown(dynamics, mean[:n], p, covariance[:size, :size]))
        step = min(step * _GROWTH, _LAST_STEP)
    shown, spread = (np.array([path[part] for path in paths]).T for part in (0, 1))
    return Future(np.array(time), shown, spread, time[-1] >= horizon)


def _shown(dynamics: Dynamics, x: FloatArray, p: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    shown, slope = dynamics.readings(x, p)
    return shown, np.sqrt(np.maximum(np.sum((slope @ covariance) * slope, axis=1), 0.0))


def crossing(time: FloatArray, path: FloatArray, limit: float) -> float:
    """When a path first reaches a limit [s], straight between its points; infinite where it never does."""
    above = np.flatnonzero(path >= limit)
    if above.size == 0:
        return float("inf")
    k = int(above[0])
    if k == 0:
        return 0.0
    share = (limit - path[k - 1]) / (path[k] - path[k - 1])
    return float(time[k - 1] + share * (time[k] - time[k - 1]))
