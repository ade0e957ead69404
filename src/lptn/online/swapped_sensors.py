"""Sensors that are plugged in where another one belongs: readings that are likelier when the two are exchanged."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.model.model import Model
from lptn.online.calibration import Calibration
from lptn.online.estimator import run_filter
from lptn.online.fault_likelihood import OFFSET, fault_statistics, gaussian_estimator
from lptn.online.sensor_faults import Alarm
from lptn.simulate.bound_run import BoundRun
from lptn.simulate.simulation import simulate


def swapped_sensors(
    model: Model, coarse: BoundRun, measured: FloatArray, calibration: Calibration
) -> list[tuple[Alarm, Alarm]]:
    """Pairs of sensors that are swapped from the beginning of a run: nobody swaps plugs while a robot works.

    A filter on the model takes the readings in as they are, and with those of the two exchanged; the logarithm of the
    likelihood that this gains decides: it has to pass the limit of an offset, and to explain more than a fault of
    any one sensor. Only pairs are tried whose readings are nearer to what the model predicts for each other.

    Args:
        model: the model.
        coarse: the run in the detector's steps.
        measured: readings [degC], NaN where they are missing or not believed, shape (nodes, n).
        calibration: noise, the model's errors and limits.
    """
    predicted = simulate(model, coarse).readings
    measured, alarms = measured.copy(), list[tuple[Alarm, Alarm]]()
    while pairs := [pair for pair in combinations(range(len(measured)), 2) if _crossed(measured, predicted, pair)]:
        as_read = _log_likelihoods(model, coarse, measured, calibration)
        best, gain, at = tuple[int, ...](), 0.0, 0
        for pair in pairs:
            exchanged = measured.copy()
            exchanged[list(pair)] = measured[list(pair[::-1])]
            gained = np.cumsum(_log_likelihoods(model, coarse, exchanged, calibration) - as_read)
            limit = 0.5 * float(calibration.limits[OFFSET, list(pair)].max()) ** 2
            if gained[-1] > max(gain, limit):
                best, gain, at = pair, float(gained[-1]), int(np.argmax(gained > limit))
        if not best or gain <= _of_one_fault(model, coarse, measured, calibration):
            break
        start, when = float(coarse.run.time[0]), float(coarse.run.time[at]) + coarse.run.step
        one, other = (model.nodes[row] for row in best)
        alarms.append(
            (
                Alarm(one, "swapped", when, start, detail=f"with {other}"),
                Alarm(other, "swapped", when, start, detail=f"with {one}"),
            )
        )
        measured[list(best)] = np.nan
    return alarms


def _crossed(measured: FloatArray, predicted: FloatArray, pair: tuple[int, int]) -> bool:
    """Whether two sensors' readings are nearer to the predictions of each other than to their own, in all."""
    one, other = pair
    both = np.isfinite(measured[one]) & np.isfinite(measured[other])
    own, crossed = (measured[list(pair)] - predicted[list(rows)] for rows in ((one, other), (other, one)))
    return bool((crossed[:, both] ** 2).sum() < (own[:, both] ** 2).sum())


def _of_one_fault(model: Model, coarse: BoundRun, measured: FloatArray, calibration: Calibration) -> float:
    """The most that an offset, a drift or a lag of one sensor adds to the logarithm of the likelihood, by any time."""
    estimator = gaussian_estimator(model, calibration.noise, calibration.error)
    weights = [statistics.weight.max() for _, statistics in fault_statistics(estimator, coarse, measured)]
    return 0.5 * float(max(weights)) ** 2


def _log_likelihoods(model: Model, coarse: BoundRun, measured: FloatArray, calibration: Calibration) -> FloatArray:
    """Logarithm of the likelihood of each step's innovations, shape (n,)."""
    estimator = gaussian_estimator(model, calibration.noise, calibration.error)
    log_likelihoods = np.zeros(len(coarse))
    for k, _ in enumerate(run_filter(estimator, coarse, measured)):
        if estimator.last is not None:
            log_likelihoods[k] = estimator.last.log_likelihood
    return log_likelihoods
