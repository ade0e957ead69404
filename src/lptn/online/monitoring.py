"""Sensor faults in logs, found in two ways: by a threshold on the error, and by a filter's innovations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.online.calibration import Calibration, uncalibrated
from lptn.online.sensor_faults import (
    DRIFT,
    STEP,
    Alarm,
    Best,
    Kind,
    Scene,
    believable,
    coarse_drive,
    dropouts,
    earliest,
    estimator_of,
    shaped,
    stuck,
    watch,
)
from lptn.simulate.bound_run import BoundRun

# --- The plain detector: measured against expected of the free-running model, and a threshold -----
# Source: [QuadrupedLPTN, application 2].


def direct_alarms(scene: Scene, threshold: float) -> list[Alarm]:
    """The first time at each sensor that measured and expected lie apart, or that readings are missing.

    Args:
        threshold: K.
    """
    alarms = dropouts(scene)
    for row, residual in enumerate(scene.residual):
        apart = np.flatnonzero(np.abs(np.nan_to_num(residual)) > threshold)
        if apart.size:
            alarms.append(_named(scene, row, int(apart[0])))
    return earliest(alarms)


def _named(scene: Scene, row: int, at: int) -> Alarm:
    alarm = shaped(scene, row, at)
    stands = stuck(scene, row, at)
    return alarm if stands is None else replace(alarm, kind="stuck", onset=stands, size=None)


# --- The statistical detector: a Kalman filter's innovations, and what a fault of each kind would do to them ---


_SETTLED = 240.0  # s behind an alarm: by then offset and drift can be told apart


def statistical_alarms(model: Model, scene: Scene, calibration: Calibration) -> list[Alarm]:
    """The first alarm at each sensor.

    Once a sensor is called faulty, the filter does without it from the fault's onset on, and the search for others
    starts again: else its error would spread over its neighbours.
    """
    alarms = [*_standing(scene, calibration), *dropouts(scene)]
    coarse = coarse_drive(model, scene.run, STEP)
    measured = believable(coarse.measured)
    distrusted: dict[str, float] = {}
    while (alarm := _first(model, coarse, _without(measured, model, coarse, distrusted), calibration)) is not None:
        distrusted[alarm.node] = alarm.onset - coarse.run.step
        alarms.append(_renamed(scene, alarm))
    return earliest(alarms)


def _standing(scene: Scene, calibration: Calibration) -> list[Alarm]:
    """Sensors whose reading stands still while the model moves further than it ever did when all was well."""
    alarms = []
    for row in range(len(scene.nodes)):
        far = np.flatnonzero(scene.moved[row] > calibration.still[row])
        if far.size:
            alarms.append(_renamed(scene, shaped(scene, row, int(far[0]))))
    return alarms


def _first(model: Model, coarse: BoundRun, measured: FloatArray, calibration: Calibration) -> Alarm | None:
    """The first alarm among sensors that still count; its kind as it looks some minutes later."""
    called: Alarm | None = None
    row = 0
    for time, best in watch(estimator_of(model, calibration.noise, calibration.error), coarse, measured):
        if called is None:
            excess = best.weight / calibration.limits
            if excess.max() > 1:
                row = int(excess.max(axis=0).argmax())
                called = _alarm(model.nodes[row], best, row, calibration, time)
        elif time <= called.time + _SETTLED:
            called = _alarm(model.nodes[row], best, row, calibration, called.time)
        else:
            break
    return called


def _alarm(node: str, best: Best, row: int, calibration: Calibration, time: float) -> Alarm:
    which = int((best.weight[:, row] / calibration.limits[:, row]).argmax())
    kind: Kind = "drift" if which == DRIFT else "offset"
    return Alarm(node, kind, time, float(best.onset[which, row]), float(best.size[which, row]))


def _renamed(scene: Scene, alarm: Alarm) -> Alarm:
    row = scene.nodes.index(alarm.node)
    stands = stuck(scene, row, scene.after(alarm.time))
    return alarm if stands is None else replace(alarm, kind="stuck", onset=stands, size=None)


def _without(measured: FloatArray, model: Model, coarse: BoundRun, distrusted: dict[str, float]) -> FloatArray:
    since = np.array([distrusted.get(node, inf) for node in model.nodes])
    return np.where(coarse.run.time >= since[:, None], np.nan, measured)


# --- Sensor faults in logs, found in two ways: by a threshold on the residual, and by a filter's innovations ---


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
