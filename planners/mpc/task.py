"""Tasks of `kind = "track"`: what is asked of the joints phase by phase, read from a task file."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import Field

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.toml import Strict
from lptn.model.model import Model

from ..heating import Request, heating
from ..tasks import check_limits_at_rest, conditions_of, start_of
from ..values import ByPlace, Celsius, NotNegative, Positive, Seconds, by_place
from .settings import LostSensor

_OF_JOINTS = ("current_limits", "weights", "rates", "floors", "priorities")
"""Tables of numbers by joint, arguments of `TorqueMPC`."""


class TrackTable(Strict):
    kind: Literal["track"]
    name: str = "torque within temperature limits"
    period: Seconds = 5.0
    repeat: Annotated[int, Field(ge=1, le=1000, strict=True)] = 1
    margin: NotNegative = 0.15
    recovery: NotNegative | None = None
    smoothing: NotNegative = 0.0
    power_limit: Positive | None = None  # W


class PhaseTable(Strict):
    name: str = ""
    duration: Positive
    torque: ByPlace = Field(default_factory=dict)
    current: ByPlace = Field(default_factory=dict)
    conditions: ByPlace = Field(default_factory=dict)


class ControllerTable(Strict):
    horizon: Positive = 300.0
    stages: Annotated[int, Field(ge=1, le=200, strict=True)] = 16
    noise: NotNegative = 0.1
    resolution: NotNegative = 0.0
    level: Annotated[float, Field(ge=0.5, lt=1)] = 0.95
    model_error: NotNegative = 0.2
    lost_sensor: LostSensor = "model"


class TrackFile(Strict):
    task: TrackTable
    limits: dict[str, Celsius] = Field(min_length=1)
    start: dict[str, Celsius] = Field(min_length=1)
    phases: list[PhaseTable] = Field(min_length=1)
    conditions: ByPlace = Field(default_factory=dict)
    current_limits: dict[str, Positive] = Field(default_factory=dict)
    weights: dict[str, Positive] = Field(default_factory=dict)
    rates: dict[str, NotNegative] = Field(default_factory=dict)
    floors: dict[str, NotNegative] = Field(default_factory=dict)
    priorities: ByPlace = Field(default_factory=dict)
    controller: ControllerTable = ControllerTable()


class TrackTask:
    """What is asked, in steps of one period.

    Args:
        file: the task file's tables, for limits, weights and the controller.
        origin: its name.
        model: the model.

    Attributes:
        heating: the model, and what is asked of its joints.
        asked: RMS torque [N*m] or current [A], shape (steps, joints).
        conditions: the model's other inputs, shape (steps, conditions).
        start: states [degC].
        period: length of a step [s].

    Raises:
        InputError: something in the file can't be used.
    """

    def __init__(self, file: TrackFile, origin: str, model: Model) -> None:
        named = [what for what in get_args(Request) if any(getattr(phase, what) for phase in file.phases)]
        if len(named) > 1:
            raise InputError(origin, "phases", "torque and current", "one of the two in all phases")
        self.file, self.period = file, file.task.period
        self.heating = heat = heating(model, named[0] if named else None, file.task.power_limit is not None)
        limits = by_place(file.limits, model.places, origin, "limits")
        for name in _OF_JOINTS:
            by_place(getattr(file, name), heat.joints, origin, name)
        self.start = start_of(file.start, model, origin)
        self.asked, self.conditions = self._phases(origin)
        rates, none = heat.rate_function(), np.zeros(len(heat.joints))

        def idle(time: float, x: FloatArray) -> FloatArray:
            given = self.conditions[min(int(time / self.period), len(self.conditions) - 1)]
            return np.asarray(rates(x, none, given, model.values).full()).ravel()

        hottest = zip(heat.conditions, self.conditions.max(axis=0).tolist(), strict=True)
        air = {name: most for name, most in hottest if name.startswith("temperature.")}
        ends = np.asarray(self.period * np.arange(1, len(self.asked) + 1), dtype=np.float64)
        check_limits_at_rest(model, origin, limits, self.start, idle, ends, air)

    def _phases(self, origin: str) -> tuple[FloatArray, FloatArray]:
        """What is asked, and the conditions, by step."""
        file, heat, most = self.file, self.heating, 400  # steps that are planned at once: each is a stage of the solver
        asked: list[FloatArray] = []
        around: list[FloatArray] = []
        for number, phase in enumerate(file.phases):
            steps = round(phase.duration / self.period)
            if abs(steps * self.period - phase.duration) > 1e-6 * phase.duration:
                place = f"phases[{number}].duration"
                raise InputError(origin, place, f"{phase.duration:g}", f"a multiple of {self.period:g} s")
            if (count := (len(asked) + steps) * file.task.repeat) > most:
                problem = f"{count} steps of {self.period:g} s"
                raise InputError(origin, "task.period", problem, f"at most {most}: a longer period, or a shorter task")
            levels = by_place(getattr(phase, heat.request), heat.joints, origin, f"phases[{number}].{heat.request}")
            amounts = np.array([levels.get(joint, 0.0) for joint in heat.joints])
            asked += [amounts] * steps
            around += [conditions_of(file.conditions | phase.conditions, heat, amounts, origin)] * steps
        return np.array(asked * file.task.repeat), np.array(around * file.task.repeat)

    @property
    def settings(self) -> dict[str, Any]:
        """Arguments of `TorqueMPC` that the file gives, apart from model, limits, request and horizon."""
        table = self.file.task
        own = {"period": table.period, "margin": table.margin, "recovery": table.recovery, "smoothing": table.smoothing}
        if table.power_limit is not None:
            own["power_limit"] = table.power_limit
        return own | {name: values for name in _OF_JOINTS if (values := getattr(self.file, name))}
