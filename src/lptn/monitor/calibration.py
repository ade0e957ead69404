"""What is usual on healthy logs: how wrong the model is there, and how much suspicion it raises by itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lptn.arrays import FloatArray
from lptn.logs import Run
from lptn.model import Model
from lptn.monitor.error_search import Report, likeliest
from lptn.monitor.scene import Scene
from lptn.monitor.watch import STEP, coarse_drive, estimator_of, watch
from lptn.noise import Noise, estimate_noise
from lptn.online import ModelError
from lptn.simulate import Drive, drive

FALSE_ALARMS = 0.01
"""False alarms an hour that are put up with, all sensors of a robot together."""
_SEARCH_STEP = 30.0  # s
_SEARCH_RUNS = 8
_BLOCK = 1800.0  # s; the largest suspicion is taken over stretches of about so long
_TAIL, _LEAST_TAIL = 0.1, 20  # share, and number, of the largest suspicions that the tail is fitted to
_LEAST_LIMIT = 4.5  # standard deviations; a quieter log is luck
_UNTRIED = 9.0  # standard deviations; the limit where no healthy log was given
_LEAST_MOVE = 0.75  # K, beyond the sensor's step
_STRETCH = 1.5  # the model may move so much more than it ever did over a healthy reading that stood still


@dataclass(frozen=True)
class Calibration:
    """What the statistical detector goes by.

    Args:
        noise: of the sensors.
        error: what the model lacks, as found on healthy logs.
        limits: weight that calls an offset, a drift [standard deviations], shape (2,).
        still: predicted change [K] over which a healthy reading never stands still, shape (nodes,).
        hours: length of the healthy logs; 0 where there were none.
    """

    noise: Noise
    error: ModelError
    limits: FloatArray
    still: FloatArray
    hours: float

    def as_json(self, nodes: Sequence[str]) -> dict[str, object]:
        """The calibration as other tools read it."""
        error = {name: getattr(self.error, name) for name in ("heat", "heat_time", "change", "bias", "air", "inputs")}
        return {
            "nodes": list(nodes),
            "healthy_hours": self.hours,
            "limits": {"offset": float(self.limits[0]), "drift": float(self.limits[1])},
            "still": self.still.tolist(),
            "noise": {"white": self.noise.white.tolist(), "step": self.noise.step.tolist()},
            "model_error": error,
        }


def calibrate(
    model: Model, runs: Sequence[Run], *, false_alarms: float = FALSE_ALARMS, report: Report = lambda _: None
) -> Calibration:
    """Learn from healthy logs, best those that the model was fitted on, what a healthy log looks like.

    The sizes of the model's errors are those under which the filter's innovations are likeliest. The limits
    follow from the largest suspicion at each sensor in each half hour: the tail of these maxima says what is passed
    as rarely as was asked for. What the healthy logs don't hold (a gait, a load) is not in the limits.

    Args:
        runs: healthy runs.
        false_alarms: how many a robot may give in an hour, all sensors and kinds together.
        report: told what is being done.

    Raises:
        ValueError: no run, or a rate that is not above 0.
    """
    if not runs or not false_alarms > 0:
        raise ValueError("calibrate: expected one healthy run or more, and a rate of false alarms above 0")
    drives = [drive(model, run) for run in runs]
    noise = estimate_noise(drives, model.nodes)
    error = likeliest(model, noise, [coarse_drive(model, run, _SEARCH_STEP) for run in _spread(runs)], report)
    maxima = []
    for number, run in enumerate(runs, start=1):
        report(f"learning what is healthy: log {number} of {len(runs)}")
        maxima += block_maxima(model, coarse_drive(model, run, STEP), noise, error)
    hours = sum(len(run) * run.step for run in runs) / 3600
    share = false_alarms * hours / len(maxima) / (2 * len(model.nodes))
    limits = [rare(np.concatenate([each[kind] for each in maxima]), share) for kind in (0, 1)]
    return Calibration(noise, error, np.maximum(limits, _LEAST_LIMIT), _still(model, runs, noise), hours)


def uncalibrated(model: Model, runs: Sequence[Run], rmse: float | None) -> Calibration:
    """A cautious guess for want of healthy logs: errors as large as the fit's, limits set high.

    Args:
        runs: the logs to watch, for their sensors' noise.
        rmse: of the model's fit [K], if it was fitted.
    """
    noise = estimate_noise([drive(model, run) for run in runs], model.nodes)
    size = max(1.0, rmse or 1.0)
    air = [column for column in model.inputs if column.startswith("temperature.")]
    error = ModelError(size, 100.0, 0.5, size, 0.2, dict.fromkeys(air, 2.0))
    return Calibration(noise, error, np.full(2, _UNTRIED), noise.step + 3 * size, 0.0)


def block_maxima(model: Model, driven: Drive, noise: Noise, error: ModelError) -> list[FloatArray]:
    """The largest weight of each kind at each sensor, shape (2, nodes), in each stretch of about half an hour."""
    weights = [best.weight for _, best in watch(estimator_of(model, noise, error), driven, driven.measured)]
    count = max(1, round(len(weights) * driven.run.step / _BLOCK))
    return [np.max(block, axis=0) for block in np.array_split(np.array(weights), count)]


def rare(maxima: FloatArray, share: float) -> float:
    """The value that only this share of maxima passes, by an exponential tail fitted to the largest tenth of them.

    Only the largest count, for quiet logs say nothing of what busy ones can do.
    """
    tail = min(0.5, max(_TAIL, _LEAST_TAIL / maxima.size))
    border = float(np.quantile(maxima, 1 - tail))
    excess = maxima[maxima > border] - border
    slope = float(excess.mean()) if excess.size else 0.0
    return float(max(border + slope * np.log(tail / min(share, tail)), maxima.max()))


def _still(model: Model, runs: Sequence[Run], noise: Noise) -> FloatArray:
    """How far the model moves at most while a healthy reading stands still, with a margin [K]."""
    most = np.zeros(len(model.nodes))
    for run in runs:
        most = np.maximum(most, Scene.of(model, run).moved.max(axis=1, initial=0.0))
    return np.asarray(noise.step + _LEAST_MOVE + _STRETCH * np.maximum(most - noise.step, 0.0))


def _spread(runs: Sequence[Run]) -> list[Run]:
    """Some of the runs, from first to last."""
    chosen = np.unique(np.linspace(0, len(runs) - 1, min(len(runs), _SEARCH_RUNS)).round().astype(int))
    return [runs[index] for index in chosen]
