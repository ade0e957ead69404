"""Sensor faults in logs, found in two ways: by a threshold on the residual, and by a filter's innovations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lptn.logs import Run
from lptn.model import Model
from lptn.monitor.alarms import Alarm
from lptn.monitor.calibration import Calibration, uncalibrated
from lptn.monitor.direct import direct_alarms
from lptn.monitor.scene import Scene
from lptn.monitor.statistical import statistical_alarms

THRESHOLD = 10.0
"""K; the threshold of [QuadrupedLPTN, application 2]."""


@dataclass(frozen=True)
class Watched:
    """One run and the alarms of both detectors, each in order of time."""

    scene: Scene
    direct: tuple[Alarm, ...]
    statistical: tuple[Alarm, ...]

    @property
    def largest(self) -> dict[str, float]:
        """Largest distance of measured from expected [K] at each node that is measured."""
        return {
            node: float(np.nanmax(np.abs(residual)))
            for node, residual in zip(self.scene.nodes, self.scene.residual, strict=True)
            if np.isfinite(residual).any()
        }


@dataclass(frozen=True)
class Monitoring:
    """What both detectors found in several runs."""

    threshold: float
    calibration: Calibration
    runs: tuple[Watched, ...]

    def as_json(self) -> dict[str, object]:
        """The findings as other tools read them; times in s of each log's clock."""
        found: dict[str, object] = {}
        for watched in self.runs:
            run = watched.scene.run
            # Logs of one name from two folders must not hide each other.
            name = run.name if run.name not in found else f"{run.name} ({run.source})"
            found[name] = {
                "start": float(run.time[0]),
                "end": float(run.time[-1] + run.step),
                "threshold": {
                    "alarms": [alarm.as_json() for alarm in watched.direct],
                    "largest_residual": watched.largest,
                },
                "statistical": {"alarms": [alarm.as_json() for alarm in watched.statistical]},
            }
        nodes = self.runs[0].scene.nodes
        return {"threshold": self.threshold, "calibration": self.calibration.as_json(nodes), "runs": found}


def monitor(
    model: Model,
    runs: Sequence[Run],
    *,
    threshold: float = THRESHOLD,
    calibration: Calibration | None = None,
    rmse: float | None = None,
    report: Callable[[str], None] = lambda _: None,
) -> Monitoring:
    """Look for faults of temperature sensors: drift, offset, stuck, dropout ([QuadrupedLPTN, application 2]).

    The plain detector sets the readings against the model, which runs freely from the log's first readings. The
    statistical one weighs the innovations of a Kalman filter on the same model against what each fault
    would do to them, with limits learnt from healthy logs.

    Args:
        model: a fitted model.
        runs: the runs to watch.
        threshold: of the plain detector [K].
        calibration: from `calibrate`; without it cautious guesses serve.
        rmse: of the model's fit [K], for those guesses.
        report: told what is being done.

    Raises:
        InputError: a run lacks an input, or measures none of the model's nodes.
        ValueError: a threshold that is not above 0.
    """
    if not threshold > 0:
        raise ValueError(f"threshold: found {threshold:g}; expected a number of kelvin above 0")
    calibration = calibration or uncalibrated(model, runs, rmse)
    watched = []
    for number, run in enumerate(runs, start=1):
        report(f"watching log {number} of {len(runs)}")
        scene = Scene.of(model, run)
        direct, statistical = direct_alarms(scene, threshold), statistical_alarms(model, scene, calibration)
        watched.append(Watched(scene, tuple(direct), tuple(statistical)))
    return Monitoring(threshold, calibration, tuple(watched))
