"""Task files of `kind = "firmware"`: what the drives of a robot are, beside a model of it."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.toml import Strict
from lptn.model.model import Model

from ..heating import Heating, heating
from ..tasks import conditions_of
from ..values import LONGEST, ByPlace, Celsius, NotNegative, Positive, Seconds, by_place

_BRIEFEST = 1e-3  # s: of what averages for less than a drive's period nothing is left


class FirmwareTable(Strict):
    kind: Literal["firmware"]
    name: str = "limits of the firmware"
    air: Annotated[list[Celsius], Field(min_length=2, max_length=2)]
    margin: NotNegative = 0.0
    level: Annotated[float, Field(ge=0.5, lt=1)] = 0.95
    warning: Seconds = 10.0
    burst: Seconds = 10.0
    sensor_error: NotNegative = 0.0
    delay: Annotated[NotNegative, Field(le=LONGEST)] = 0.0


class FirmwareFile(Strict):
    task: FirmwareTable
    limits: dict[str, Celsius] = Field(min_length=1)
    current_limits: dict[str, Positive] = Field(min_length=1)
    nominal_currents: dict[str, Positive] = Field(default_factory=dict)
    time_constants: dict[str, Annotated[Seconds, Field(ge=_BRIEFEST)]] = Field(default_factory=dict)
    sensors: dict[str, str] = Field(default_factory=dict)
    conditions: ByPlace = Field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class FirmwareTask:
    """A model, and what its drives are.

    Args:
        origin: of the task file.
        heating: the model, of requested currents.
        table: of the task file.
        limits: less the margin [degC], infinite without one, by state.
        peak, nominal: squares of the drives' currents [A²], by joint.
        constants: time constants that are fixed [s], by joint.
        sensors: row of the model's readings that each joint's drive reads.
        ends: the model's other inputs in the coldest and in the hottest air.
    """

    origin: str
    heating: Heating
    table: FirmwareTable
    limits: FloatArray
    peak: FloatArray
    nominal: FloatArray
    constants: dict[str, float]
    sensors: list[int]
    ends: tuple[FloatArray, FloatArray]


def firmware_task(file: FirmwareFile, origin: str, model: Model) -> FirmwareTask:
    """A task from its file."""
    heat = heating(model, "current")
    bounds = by_place(file.limits, model.places, origin, "limits")
    peaks = by_place(file.current_limits, heat.joints, origin, "current_limits")
    nominal = peaks | by_place(file.nominal_currents, heat.joints, origin, "nominal_currents")
    constants = by_place(file.time_constants, heat.joints, origin, "time_constants")
    sensors: dict[str, str] = {}
    for pattern, node in ({joint: joint for joint in heat.joints} | file.sensors).items():
        sensors |= dict.fromkeys(by_place({pattern: 0.0}, heat.joints, origin, "sensors"), node)
    for joint, node in sensors.items():
        if joint not in peaks:
            raise InputError(origin, "current_limits", f"no {joint}", "the peak current of each drive")
        if nominal[joint] > peaks[joint]:
            expected = f"at most the peak current, {peaks[joint]:g} A"
            raise InputError(origin, f"nominal_currents.{joint}", f"{nominal[joint]:g}", expected)
        if node not in model.nodes:
            raise InputError(origin, f"sensors.{joint}", node, f"one of {', '.join(model.nodes)}")
    told = next((name for name in file.conditions if name.startswith("temperature.")), None)
    if told:
        raise InputError(origin, f"conditions.{told}", "a temperature", 'other inputs: [task] "air" has both ends')
    air = any(name.startswith("temperature.") for name in heat.conditions)
    ends = [file.conditions | ({"temperature.*": end} if air else {}) for end in sorted(file.task.air)]
    cold, hot = (conditions_of(end, heat, np.zeros(len(heat.joints)), origin) for end in ends)
    limits = np.full(heat.x.numel(), inf)
    limits[: len(model.places)] = [bounds.get(place, inf) - file.task.margin for place in model.places]
    squares = np.array([[peaks[joint], nominal[joint]] for joint in heat.joints]).T ** 2
    rows = [model.nodes.index(sensors[joint]) for joint in heat.joints]
    return FirmwareTask(origin, heat, file.task, limits, squares[0], squares[1], constants, rows, (cold, hot))
