"""Tasks of `kind = "track"`: what is asked of the joints phase by phase, read from a task file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.toml import Strict
from lptn.model.model import Model

from ..heating import Request, heating, requested_by
from ..reach import check_limits_at_rest
from ..tasks import conditions_of, mistakes_with_line, start_of
from ..values import ByPlace, Celsius, NotNegative, Positive, Seconds, by_place
from .settings import LostSensor


class TrackTable(Strict):
    kind: Literal["track"]
    name: str = "torque within temperature limits"
    period: Seconds = 5.0
    repeat: Annotated[int, Field(ge=1, le=1000, strict=True)] = 1
    margin: NotNegative = 0.15
    recovery: NotNegative | None = None
    smoothing: NotNegative = 0.0


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


@dataclass(frozen=True)
class TrackTask:
    """What is asked, in steps of one period.

    Args:
        model: the model.
        name: for the figure.
        request: what is asked of a joint.
        period: length of a step [s].
        asked: RMS torque [N*m] or current [A], shape (steps, joints).
        conditions: the model's other inputs, shape (steps, conditions).
        start: states [degC].
        file: the tables, for limits, weights and the controller.
    """

    model: Model
    name: str
    request: Request
    period: float
    asked: FloatArray
    conditions: FloatArray
    start: FloatArray
    file: TrackFile

    @property
    def duration(self) -> float:
        """Of the whole task [s]."""
        return self.period * len(self.asked)

    @property
    def settings(self) -> dict[str, Any]:
        """Arguments of `TorqueMPC` apart from model, limits and horizon."""
        return {
            "request": self.request,
            "current_limits": self.file.current_limits or float("inf"),
            "weights": self.file.weights or 1.0,
            "rates": self.file.rates or 0.0,
            "floors": self.file.floors or 0.0,
            "priorities": self.file.priorities or 0.0,
            "period": self.period,
            "margin": self.file.task.margin,
            "recovery": self.file.task.recovery,
            "smoothing": self.file.task.smoothing,
        }


def read_task(table: Mapping[str, Any], origin: str, model: Model) -> TrackTask:
    """A task from the parsed task file.

    Raises:
        InputError: something in it can't be used.
    """
    with mistakes_with_line(origin):
        file = TrackFile.model_validate(dict(table))
        request = _request(file, model, origin)
        heat = heating(model, request)
        period = file.task.period
        asked: list[FloatArray] = []
        around: list[FloatArray] = []
        for number, phase in enumerate(file.phases):
            steps = round(phase.duration / period)
            if abs(steps * period - phase.duration) > 1e-6 * phase.duration:
                place = f"phases[{number}].duration"
                raise InputError(origin, place, f"{phase.duration:g}", f"a multiple of {period:g} s")
            _refuse_many(len(asked) + steps, period, origin)
            levels = by_place(getattr(phase, request), heat.joints, origin, f"phases[{number}].{request}")
            given = file.conditions | phase.conditions
            amounts = np.array([levels.get(joint, 0.0) for joint in heat.joints])
            asked += [amounts] * steps
            around += [conditions_of(given, heat, amounts, origin)] * steps
        by_place(file.limits, model.places, origin, "limits")
        for name in ("current_limits", "weights", "rates", "floors", "priorities"):
            by_place(getattr(file, name), heat.joints, origin, name)
        repeated = file.task.repeat
        _refuse_many(len(asked) * repeated, period, origin)
        start = start_of(file.start, model, origin)
        rows, others = np.array(asked * repeated), np.array(around * repeated)
        task = TrackTask(model, file.task.name, request, period, rows, others, start, file)
    _check_limits_at_rest(task, origin)
    return task


def _check_limits_at_rest(task: TrackTask, origin: str) -> None:
    """Refuse a limit that a node passes though no torque at all is given.

    Raises:
        InputError: the node, and what warms it.
    """
    heat = heating(task.model, task.request)
    rates, none = heat.rate_function(), np.zeros(len(heat.joints))

    def idle(time: float, x: FloatArray) -> FloatArray:
        given = task.conditions[min(int(time / task.period), len(task.conditions) - 1)]
        return np.asarray(rates(x, none, given, task.model.values).full()).ravel()

    columns = [(number, name) for number, name in enumerate(heat.conditions) if name.startswith("temperature.")]
    air = {name: float(task.conditions[:, number].max()) for number, name in columns}
    limits = by_place(task.file.limits, task.model.places, origin, "limits")
    ends = np.asarray(task.period * np.arange(1, len(task.asked) + 1), dtype=np.float64)
    check_limits_at_rest(task.model, origin, limits, task.start, idle, ends, air)


def _refuse_many(steps: int, period: float, origin: str, most: int = 400) -> None:
    """Refuse a task of more steps than are planned at once: each is a stage of the solver."""
    if steps > most:
        problem = f"{steps} steps of {period:g} s"
        raise InputError(origin, "task.period", problem, f"at most {most}: a longer period, or a shorter task")


def _request(file: TrackFile, model: Model, origin: str) -> Request:
    """Torque or current, whichever the phases name."""
    torque, current = (any(getattr(phase, what) for phase in file.phases) for what in ("torque", "current"))
    if torque and current:
        raise InputError(origin, "phases", "torque and current", "one of the two in all phases")
    if not torque and not current:
        return requested_by(model)
    return "torque" if torque else "current"
