"""Task files of missions: tables and keys, checked by pydantic; mistakes said with their line and what was expected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WrapValidator,
)

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError, shown
from lptn.basics.places import matching
from lptn.basics.toml import Number, Strict
from lptn.logs.columns import parse_columns
from lptn.model.model import Model

from ..reach import check_limits_at_rest
from ..tasks import mistakes_with_line
from ..values import LONGEST, Celsius, ExtraMass, Length, NotNegative, Positive, Seconds, Speed, by_place
from .gait import REST, Gait, LogPart, gait_from_logs, gait_from_tables
from .mission import Activity, GivesUp, Mission, Range, Transition


def _one_or_two(given: Any, validate: ValidatorFunctionWrapHandler) -> Any:
    try:
        return validate(given)
    except ValidationError as error:
        raise ValueError("a number, or [least, most]") from error


Of = TypeVar("Of")
OneOrTwo = Annotated[Of | Annotated[list[Of], Field(min_length=2, max_length=2)] | None, WrapValidator(_one_or_two)]
"""A number, or the least and the greatest."""

# --- tables and keys ----------------------------------------------------------------------------


class MissionTable(Strict):
    kind: Literal["mission"] = "mission"
    name: str = "mission"
    ambient: Celsius = 25.0
    start: Any = None  # a temperature, or one for each of some patterns of nodes
    deadline: Seconds | None = None
    longest_rest: Annotated[Number, Field(ge=0, le=86400)] = 900.0
    carry: ExtraMass = 0.0
    gives_up: GivesUp = "deadline"
    begins: str = ""  # the gait in which the robot is; none: the first activity may begin at once


class ActivityTable(Strict):
    do: str
    distance: Length | None = None
    duration: Annotated[
        Seconds | Annotated[list[NotNegative], Field(min_length=2, max_length=2)] | None, WrapValidator(_one_or_two)
    ] = None
    speed: OneOrTwo[Speed] = None
    load: OneOrTwo[ExtraMass] = None
    posture: dict[str, OneOrTwo[Number]] = Field(default_factory=dict)
    pieces: Annotated[int, Field(ge=1, le=12, strict=True)] | None = None


class LogTable(Strict):
    file: str
    load: ExtraMass = 0.0
    start: NotNegative = 0.0
    end: Positive | None = None
    posture: dict[str, Number] = Field(default_factory=dict)


class GaitTable(BaseModel):
    """Further keys are quantities (`torque`, `velocity`, `power`, …): for each pattern of places a table."""

    model_config = ConfigDict(extra="allow")
    speeds: Annotated[list[Speed], Field(min_length=1, max_length=12)] | None = None
    loads: Annotated[list[ExtraMass], Field(min_length=1, max_length=12)] = [0.0]
    postures: dict[str, Annotated[list[Number], Field(min_length=1, max_length=12)]] = Field(default_factory=dict)
    logs: Annotated[list[LogTable], Field(min_length=1)] | None = None
    window: Annotated[Number, Field(ge=2, le=600)] = 10.0


class TransitionTable(BaseModel):
    """Further keys are quantities, as in a gait; tables have a row for each load."""

    model_config = ConfigDict(extra="allow")
    before: str = Field(alias="from")
    to: str
    duration: Annotated[Number, Field(gt=0, le=600)]
    loads: Annotated[list[ExtraMass], Field(min_length=1, max_length=12)] = [0.0]


class MissionFile(Strict):
    task: MissionTable
    limits: Annotated[dict[str, Celsius], Field(min_length=1)]
    activities: Annotated[list[ActivityTable], Field(min_length=1, max_length=24)]
    gaits: dict[str, GaitTable]
    transitions: Annotated[list[TransitionTable], Field(max_length=24)] = Field(default_factory=list)
    columns: dict[str, Any] = Field(default_factory=dict)


# --- reading ------------------------------------------------------------------------------------


def read_mission(table: Mapping[str, Any], origin: str, model: Model) -> Mission:
    """A mission from the parsed task file.

    Args:
        table: the whole document.
        origin: the task file, for messages and for logs beside it.
        model: the model that the mission is about.

    Raises:
        InputError: something in it can't be used; with its line where the file is there.
    """
    with mistakes_with_line(origin):
        return _mission(MissionFile.model_validate(dict(table)), origin, model)


def _mission(tables: MissionFile, origin: str, model: Model) -> Mission:
    task = tables.task
    gaits = {name: _gait(name, gait, tables, model, origin) for name, gait in tables.gaits.items()}
    activities = tuple(
        _activity(activity, f"activities[{k}]", gaits, origin) for k, activity in enumerate(tables.activities)
    )
    limits = by_place(tables.limits, model.places, origin, "limits")
    times = [activity.least_time for activity in activities]
    if sum(times) > LONGEST:
        found = f"{sum(times):.3g} s in all, at the greatest speeds"
        expected = f"a day at most, {LONGEST:g} s: fine simulations take steps of a second"
        raise InputError(origin, f"activities[{times.index(max(times))}]", found, expected)
    start = _start(task, model, origin)
    hot = any(start[model.places.index(node)] > most for node, most in limits.items())
    rest = gaits.get(REST) if task.longest_rest > 0 or hot else None
    if rest is None and (task.longest_rest > 0 or hot):
        expected = f"[gaits.{REST}], or longest_rest = 0 and a start below the limits"
        raise InputError(origin, "gaits", "no gait rest", expected)
    if task.carry > sum(activity.load[1] for activity in activities if activity.chooses_load):
        expected = "as much as the activities with load = [least, most] can take together"
        raise InputError(origin, "task.carry", f"{task.carry:g} kg", expected)
    if task.begins and task.begins not in gaits:
        raise InputError(origin, "task.begins", f'"{task.begins}"', f"one of {', '.join(gaits)}")
    unlimited = 3600.0  # s, the longest rest of a mission without rests and deadline that begins too hot
    mission = Mission(
        model, activities, rest, task.longest_rest or task.deadline or unlimited, limits, start, task.ambient,
        task.deadline, task.carry, task.gives_up, task.name, origin,
        transitions=_transitions(tables.transitions, gaits, activities, model, origin), begins=task.begins,
    )  # fmt: skip
    _check_limits_at_rest(mission)
    return mission


def _check_limits_at_rest(mission: Mission) -> None:
    """Refuse a limit that a node passes though everything is switched off all the time.

    Raises:
        InputError: the node, and what warms it.
    """
    model = mission.model
    off = np.array([mission.ambient if name.startswith("temperature.") else 0.0 for name in model.inputs])

    def idle(_: float, x: FloatArray) -> FloatArray:
        return np.asarray(model.rhs(x, off, model.values).full()).ravel()

    ends = np.array([mission.deadline or mission.fastest])
    air = {"task.ambient": mission.ambient}
    check_limits_at_rest(model, mission.origin, mission.limits, mission.start, idle, ends, air)


def _start(task: MissionTable, model: Model, origin: str) -> FloatArray:
    """Temperatures at the start by state; what no pattern names has the ambient's."""
    nodes = np.full(len(model.nodes), task.ambient)
    single = not isinstance(task.start, Mapping) or set(task.start) == {"value", "unit"}
    given = {"*": task.ambient if task.start is None else task.start} if single else task.start
    for pattern, value in given.items():
        matched = matching(pattern, model.nodes)
        if not matched:
            raise InputError(origin, f'task.start."{pattern}"', "no such place", f"some of {', '.join(model.nodes)}")
        try:
            nodes[[model.nodes.index(node) for node in matched]] = TypeAdapter(Celsius).validate_python(value)
        except ValidationError as error:
            place = "task.start" if single else f'task.start."{pattern}"'
            raise InputError(origin, place, shown(value), "a temperature in degC, -80 to 500") from error
    return np.asarray(nodes[np.array(model.owners)])


# --- gaits and activities -----------------------------------------------------------------------


def _gait(name: str, table: GaitTable, tables: MissionFile, model: Model, origin: str) -> Gait:
    speeds = [0.0] if table.speeds is None else table.speeds
    named = {f"postures.{key}": values for key, values in table.postures.items()}
    for key, values in {"speeds": speeds, "loads": table.loads, **named}.items():
        if np.any(np.diff(values) <= 0):
            raise InputError(origin, f"gaits.{name}.{key}", str(values), "rising numbers")
    given = dict(table.model_extra or {})
    if table.logs is None:
        return gait_from_tables(name, speeds, table.loads, given, model, origin, table.postures)
    if given:
        raise InputError(origin, f"gaits.{name}", f"{next(iter(given))} beside logs", "tables or logs, not both")
    folder = Path(origin).parent
    parts = []
    for k, log in enumerate(table.logs):
        if log.posture.keys() != table.postures.keys():
            expected = f"a number for each of {', '.join(table.postures)}" if table.postures else "none"
            keys = ", ".join(log.posture) or "none"
            raise InputError(origin, f"gaits.{name}.logs[{k}].posture", keys, expected)
        parts.append(LogPart(folder / log.file, log.load, log.start, log.end or np.inf, log.posture))
    columns = parse_columns(tables.columns, origin, "[columns]")
    return gait_from_logs(
        name, speeds, table.loads, parts, model, origin, window=table.window, columns=columns, postures=table.postures
    )  # fmt: skip


def _transitions(
    tables: Sequence[TransitionTable],
    gaits: Mapping[str, Gait],
    activities: Sequence[Activity],
    model: Model,
    origin: str,
) -> dict[tuple[str, str], Transition]:
    """By the names of two gaits; a later table overrides an earlier one."""
    transitions = {}
    for number, table in enumerate(tables):
        place = f"transitions[{number}]"
        ends = []
        for key, pattern in (("from", table.before), ("to", table.to)):
            ends.append(matching(pattern, list(gaits)))
            if not ends[-1]:
                raise InputError(origin, f"{place}.{key}", f'"{pattern}"', f"some of {', '.join(gaits)}")
        if np.any(np.diff(table.loads) <= 0):
            raise InputError(origin, f"{place}.loads", str(table.loads), "rising numbers")
        heaviest = max(activity.load[1] for activity in activities)
        if len(table.loads) > 1 and not table.loads[0] <= heaviest <= table.loads[-1]:
            expected = f"cells from the least load to the greatest of the activities, {heaviest:g} kg"
            raise InputError(origin, f"{place}.loads", str(table.loads), expected)
        for before in ends[0]:
            for after in ends[1]:
                if before != after:
                    gait = gait_from_tables(
                        f"{before} to {after}", [0.0], table.loads, dict(table.model_extra or {}), model, origin,
                        place=place,
                    )  # fmt: skip
                    transitions[before, after] = Transition(gait, table.duration)
    return transitions


def _activity(table: ActivityTable, place: str, gaits: Mapping[str, Gait], origin: str) -> Activity:
    if table.do not in gaits:
        raise InputError(origin, f"{place}.do", f'"{table.do}"', f"one of {', '.join(gaits)}, the tables under [gaits]")
    gait = gaits[table.do]
    travels = gait.speeds.size > 1 or gait.speeds[0] > 0
    if travels != (table.distance is not None):
        expected = "a distance [m], for it has speeds" if travels else "a duration [s], for its gait has no speeds"
        raise InputError(origin, place, "a duration" if travels else "a distance", expected)
    load = _range(table.load, gait.loads, f"{place}.load", "kg", origin)
    posture = _postures(table.posture, gait, f"{place}.posture", origin)
    if travels:
        speed = _range(table.speed, gait.speeds, f"{place}.speed", "m/s", origin)
        return Activity(table.do, gait, table.distance, (0.0, 0.0), speed, load, posture, table.pieces or 3)
    if table.duration is None or table.speed is not None:
        raise InputError(origin, place, "no duration" if table.duration is None else "a speed", "a duration [s]")
    given = table.duration
    duration = (given[0], given[1]) if isinstance(given, list) else (given, given)
    if duration[1] <= 0 or duration[1] < duration[0]:
        raise InputError(origin, f"{place}.duration", str(given), "a time [s], or the least and the most")
    return Activity(table.do, gait, None, duration, (0.0, 0.0), load, posture, table.pieces or 1)


def _postures(given: Mapping[str, float | list[float] | None], gait: Gait, place: str, origin: str) -> dict[str, Range]:
    """Least and most of each posture of a gait; all of its cells' range where nothing is said."""
    for key in given:
        if key not in gait.postures:
            expected = (
                f"some of {', '.join(gait.postures)}" if gait.postures else f"none, for {gait.name} has no postures"
            )
            raise InputError(origin, f"{place}.{key}", "a posture that the gait has not", expected)
    return {key: _range(given.get(key), knots, f"{place}.{key}", "", origin) for key, knots in gait.postures.items()}


def _range(given: float | list[float] | None, cells: FloatArray, place: str, unit: str, origin: str) -> Range:
    """Least and most of a speed or load, within the cells of the gait."""
    low, high = float(cells[0]), float(cells[-1])
    if given is None:
        return (low, low) if unit == "kg" else (low, high)
    chosen = (given[0], given[1]) if isinstance(given, list) else (given, given)
    if not low - 1e-9 <= chosen[0] <= chosen[1] <= high + 1e-9:
        unit = f" {unit}" if unit else ""
        raise InputError(origin, place, f"{given}{unit}", f"within {low:g} to {high:g}{unit}, the gait's cells")
    return chosen
