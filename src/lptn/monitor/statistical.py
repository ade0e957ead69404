"""The statistical detector: a Kalman filter's innovations, and what a fault of each kind would do to them."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np

from lptn.arrays import FloatArray
from lptn.model import Model
from lptn.monitor.alarms import Alarm, Kind, earliest
from lptn.monitor.calibration import Calibration
from lptn.monitor.naming import dropouts, shaped, stuck
from lptn.monitor.scene import Scene, believable
from lptn.monitor.suspicion import DRIFT, Best
from lptn.monitor.watch import STEP, coarse_drive, estimator_of, watch
from lptn.simulate import Drive

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


def _first(model: Model, coarse: Drive, measured: FloatArray, calibration: Calibration) -> Alarm | None:
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


def _without(measured: FloatArray, model: Model, coarse: Drive, distrusted: dict[str, float]) -> FloatArray:
    since = np.array([distrusted.get(node, inf) for node in model.nodes])
    return np.where(coarse.run.time >= since[:, None], np.nan, measured)
