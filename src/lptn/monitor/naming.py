"""Dropouts, and names for what is seen in a residual."""

from __future__ import annotations

import numpy as np

from lptn.arrays import FloatArray
from lptn.monitor.alarms import Alarm
from lptn.monitor.scene import Scene

NAMING = 300.0
"""s behind an alarm that help to name it."""
_SILENT = 10.0  # s without a reading
_SILENT_STEPS = 5
_ONSETS = 100
_MOVED = 0.75  # K beyond the sensor's step that the model moves while a stuck reading stands


def dropouts(scene: Scene) -> list[Alarm]:
    """The first time at each sensor that readings have been missing for 10 s, and for five steps.

    A node without any reading has no sensor.
    """
    found = []
    need = max(_SILENT_STEPS, round(_SILENT / scene.run.step))
    for node, readings in zip(scene.nodes, scene.measured, strict=True):
        missing = np.isnan(readings)
        count = np.arange(missing.size) - np.maximum.accumulate(np.where(missing, -1, np.arange(missing.size)))
        silent = np.flatnonzero(count >= need)
        if silent.size and not missing.all():
            begin = int(silent[0]) - need + 1
            found.append(Alarm(node, "dropout", float(scene.time[silent[0]]), float(scene.time[begin])))
    return found


def stuck(scene: Scene, row: int, at: int) -> float | None:
    """Since when [s] a reading has stood still at an alarm and for minutes behind it, though the model moved.

    `None` where the reading moves again, or the model did not move.

    A drift, too, can hold a reading for a while: against a temperature that moves the other way.

    Args:
        at: index of the alarm.
    """
    end = scene.after(scene.time[at] + NAMING)
    begin = scene.stands_since(row, end)
    if begin > at or scene.moved[row, begin : end + 1].max() <= scene.steps[row] + _MOVED:
        return None
    return float(scene.time[begin])


def shaped(scene: Scene, row: int, at: int) -> Alarm:
    """An alarm named by the residual's shape: a step or a straight line that begins at a time of its own."""
    end = scene.after(scene.time[at] + NAMING)
    time, residual = scene.time[: end + 1], scene.residual[row, : end + 1]
    known = np.isfinite(residual)
    time, residual = time[known], residual[known]
    onsets = np.linspace(time[0], scene.time[at], _ONSETS)
    jumped = [_least_squares((time >= onset).astype(float), residual) for onset in onsets]
    crept = [_least_squares(np.maximum(time - onset, 0.0), residual) for onset in onsets]
    step, line = (min(range(_ONSETS), key=lambda k: fits[k][0]) for fits in (jumped, crept))
    when, node = float(scene.time[at]), scene.nodes[row]
    if jumped[step][0] <= crept[line][0]:
        return Alarm(node, "offset", when, float(onsets[step]), jumped[step][1])
    return Alarm(node, "drift", when, float(onsets[line]), crept[line][1])


def _least_squares(shape: FloatArray, residual: FloatArray) -> tuple[float, float]:
    """Sum of squares that a constant and a multiple of a shape leave, and the multiple."""
    centred, level = shape - shape.mean(), residual - residual.mean()
    power = float(centred @ centred)
    size = float(centred @ level) / power if power > 0 else 0.0
    return float(level @ level) - size * float(centred @ level), size
