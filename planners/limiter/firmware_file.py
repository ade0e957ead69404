"""Task files of `kind = "firmware"`: what the drives of a robot are, beside a model of it."""

from __future__ import annotations

from math import inf
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from lptn.basics.errors import InputError
from lptn.basics.toml import Strict
from lptn.model.model import Model

from ..heating import heating
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


class FirmwareTask:
    """A model, and what its drives are.

    Args:
        file: the task file's tables.
        origin: its name.
        model: the model.

    Attributes:
        heating: the model, of requested currents.
        table: `[task]` of the file.
        limits: less the margin [degC], infinite without one, by state.
        peak, nominal: squares of the drives' currents [A²], by joint.
        constants: time constants that are fixed [s], by joint.
        sensors: row of the model's readings that each joint's drive reads.
        ends: the model's other inputs in the coldest and in the hottest air.

    Raises:
        InputError: something in the file can't be used.
    """

    def __init__(self, file: FirmwareFile, origin: str, model: Model) -> None:
        self.origin, self.table, self.heating = origin, file.task, heating(model, "current")
        heat, joints = self.heating, self.heating.joints
        bounds = by_place(file.limits, model.places, origin, "limits")
        peaks = by_place(file.current_limits, joints, origin, "current_limits")
        nominal = peaks | by_place(file.nominal_currents, joints, origin, "nominal_currents")
        self.constants = by_place(file.time_constants, joints, origin, "time_constants")
        sensors: dict[str, str] = {}
        for pattern, node in ({joint: joint for joint in joints} | file.sensors).items():
            sensors |= dict.fromkeys(by_place({pattern: 0.0}, joints, origin, "sensors"), node)
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
        self.ends = [conditions_of(end, heat, np.zeros(len(joints)), origin) for end in ends]
        self.limits = np.full(heat.x.numel(), inf)
        self.limits[: len(model.places)] = [bounds.get(place, inf) - file.task.margin for place in model.places]
        self.peak, self.nominal = (np.array([squared[joint] for joint in joints]) ** 2 for squared in (peaks, nominal))
        self.sensors = [model.nodes.index(sensors[joint]) for joint in joints]
