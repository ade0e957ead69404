"""What a faulty sensor does: the explanation that leaves least of its readings unexplained, the model being right.

The temperature at the sensor is what a filter makes of the model and all other sensors. Of an offset, a drift, a lag, a
sensor that hangs in the air and one that is swapped with another, each says what would then be read; the one with the
least squares names the fault, each free number having to pay for itself by the Bayesian information criterion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.model.model import Model
from lptn.online.calibration import Calibration
from lptn.online.estimator import run_filter
from lptn.online.fault_likelihood import gaussian_estimator
from lptn.online.sensor_faults import Alarm, Kind
from lptn.simulate.bound_run import BoundRun

LAGS = (30.0, 60.0, 120.0, 240.0, 480.0, 960.0)  # s; a factor of two is as finely as a lag is known
_LEAST_LAG_GAIN = 10.0  # nats by which a lag, which a missing mass resembles, must explain more than any other
_FEWEST = 12  # readings behind the onset, that a name needs


def named(
    model: Model, coarse: BoundRun, measured: FloatArray, healthy: FloatArray, calibration: Calibration, alarm: Alarm
) -> Alarm:
    """The same alarm, named by all that was read behind its onset.

    Args:
        model: the model.
        coarse: the run in the detector's steps.
        measured: readings [degC], NaN where missing, shape (nodes, n).
        healthy: those of them that nothing speaks against, shape (nodes, n).
        calibration: noise and the model's errors.
        alarm: an offset, a drift or a lag.
    """
    row, onset = model.nodes.index(alarm.node), alarm.onset
    behind = coarse.run.time >= onset
    if np.isfinite(measured[row, behind]).sum() < _FEWEST:
        return alarm
    alone = _expected(model, coarse, healthy, calibration, (row,), behind)[row]
    readings, time = measured[row], coarse.run.time
    seen = behind & np.isfinite(readings)
    count, floor = int(seen.sum()), float(calibration.noise.floor[row])

    def nats(path: FloatArray, free: int) -> float:
        """Minus the logarithm of the likelihood that a path leaves, with what its free numbers cost."""
        left = float(np.mean((readings - path)[seen] ** 2)) + floor**2
        return 0.5 * count * float(np.log(left)) + 0.5 * free * float(np.log(count))

    since = np.maximum(time - onset, 0.0)
    off = (readings - alone)[seen]
    rate = float(off @ since[seen]) / max(float(since[seen] @ since[seen]), 1e-9)
    best: dict[tuple[Kind, float | None, str], float] = {
        ("offset", float(off.mean()), ""): nats(alone + off.mean(), 1),
        ("drift", rate, ""): nats(alone + rate * since, 1),
    }
    for column, values in zip(model.inputs, coarse.inputs, strict=True):
        if column.startswith("temperature."):
            best["disconnected", None, f"reads {column}"] = nats(values, 0)
    lags = {lag: nats(lagged(alone, lag, coarse.run.step, behind), 1) + _LEAST_LAG_GAIN for lag in LAGS}
    slowest = min(lags, key=lags.__getitem__)
    best["lag", slowest, ""] = lags[slowest]
    for other in range(len(model.nodes)):
        if other == row or np.isfinite(measured[other, behind]).sum() < _FEWEST:
            continue
        both = _expected(model, coarse, healthy, calibration, (row, other), behind)
        mutual = seen & np.isfinite(measured[other])
        apart = [measured[other] - both[row], measured[other] - both[other]]
        crossed, straight = (float(np.mean(difference[mutual] ** 2)) for difference in apart)
        if crossed < straight:  # the other one reads what this one should, too
            best["swapped", None, f"with {model.nodes[other]}"] = nats(both[other], 0)
    kind, size, detail = min(best, key=best.__getitem__)
    return replace(alarm, kind=kind, size=size, detail=detail)


def _expected(
    model: Model,
    coarse: BoundRun,
    healthy: FloatArray,
    calibration: Calibration,
    rows: tuple[int, ...],
    behind: BoolArray,
) -> FloatArray:
    """Readings that the model and the sensors but these let expect behind the onset [degC], shape (nodes, n)."""
    others = healthy.copy()
    for row in rows:
        others[row, behind] = np.nan
    estimator = gaussian_estimator(model, calibration.noise, calibration.error)
    return np.array([estimate.temperatures for estimate in run_filter(estimator, coarse, others)]).T


def lagged(path: FloatArray, lag: float, step: float, behind: BoolArray) -> FloatArray:
    """A path that is followed with a time constant [s] from the onset on."""
    lagged, keep = path.copy(), float(np.exp(-step / lag))
    for k in np.flatnonzero(behind).tolist():
        lagged[k] = keep * lagged[max(k - 1, 0)] + (1 - keep) * path[k]
    return lagged
