"""Task files of missions: tables and keys, checked by pydantic; mistakes said with their line and what was expected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.places import matching
from lptn.basics.toml import Number, Strict
from lptn.logs.columns import parse_columns
from lptn.model.model import Model

from ..tasks import check_limits_at_rest, start_of
from ..values import LONGEST, Celsius, ExtraMass, Length, Runtime, Seconds, Span, Speed, by_place
from .gait import REST, Gait, LogPart, gait_from_logs, gait_from_tables, with_surroundings
from .mission import Activity, GivesUp, Mission, Range, Transition

# --- tables and keys ----------------------------------------------------------------------------


def _rising(values: list[float]) -> list[float]:
    if np.any(np.diff(values) <= 0):
        raise ValueError("rising numbers")
    return values


def _by_pattern(given: Any) -> Any:
    return given if isinstance(given, Mapping) and set(given) != {"value", "unit"} else {"*": given}


Of = TypeVar("Of")
Cells = Annotated[list[Of], Field(min_length=1, max_length=12), AfterValidator(_rising)]


class MissionTable(Strict):
    kind: Literal["mission"] = "mission"
    name: str = "mission"
    ambient: Celsius = 25.0
    start: Annotated[dict[str, Celsius], BeforeValidator(_by_pattern)] = Field(default={})  # else the ambient's
    deadline: Seconds | None = None
    longest_rest: Annotated[Number, Field(ge=0, le=86400)] = 900.0
    carry: ExtraMass = 0.0
    gives_up: GivesUp = "deadline"
    begins: str = ""  # the gait in which the robot is; none: the first activity may begin at once


class ActivityTable(Strict):
    do: str
    distance: Length | None = None
    duration: Span[Runtime] | None = None
    speed: Span[Speed] | None = None
    load: Span[ExtraMass] | None = None
    posture: dict[str, Span[Number]] = Field(default_factory=dict)
    pieces: Annotated[int, Field(ge=1, le=12, strict=True)] | None = None


class GaitTable(BaseModel):
    """Further keys are quantities (`torque`, `velocity`, `power`, …): for each pattern of places a table."""

    model_config = ConfigDict(extra="allow")
    speeds: Cells[Speed] | None = None
    loads: Cells[ExtraMass] = [0.0]
    postures: dict[str, Cells[Number]] = Field(default_factory=dict)
    logs: Annotated[list[LogPart], Field(min_length=1)] | None = None
    window: Annotated[Number, Field(ge=2, le=600)] = 10.0


class TransitionTable(BaseModel):
    """Further keys are quantities, as in a gait; tables have a row for each load."""

    model_config = ConfigDict(extra="allow")
    before: str = Field(alias="from")
    to: str
    duration: Annotated[Number, Field(gt=0, le=600)]
    loads: Cells[ExtraMass] = [0.0]


class MissionFile(Strict):
    task: MissionTable
    limits: Annotated[dict[str, Celsius], Field(min_length=1)]
    activities: Annotated[list[ActivityTable], Field(min_length=1, max_length=24)]
    gaits: dict[str, GaitTable]
    transitions: Annotated[list[TransitionTable], Field(max_length=24)] = Field(default_factory=list)
    columns: dict[str, Any] = Field(default_factory=dict)


# --- reading ------------------------------------------------------------------------------------


def mission_of(tables: MissionFile, origin: str, model: Model) -> Mission:
    """A mission from its task file, beside which its logs lie."""
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
    warm = task.start if "*" in task.start else {"*": task.ambient} | task.start
    start = start_of(warm, model, origin, "task.start")
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
    off = with_surroundings(np.zeros(len(model.inputs)), model.inputs, 0.0, task.ambient)

    def idle(_: float, x: FloatArray) -> FloatArray:
        return np.asarray(model.rhs(x, off, model.values).full()).ravel()

    ends = np.array([task.deadline or mission.fastest])
    check_limits_at_rest(model, origin, limits, start, idle, ends, {"task.ambient": task.ambient})
    return mission


# --- gaits and activities -----------------------------------------------------------------------


def _gait(name: str, table: GaitTable, tables: MissionFile, model: Model, origin: str) -> Gait:
    speeds = [0.0] if table.speeds is None else table.speeds
    given = dict(table.model_extra or {})
    if table.logs is None:
        return gait_from_tables(name, speeds, table.loads, given, model, origin, table.postures)
    if given:
        raise InputError(origin, f"gaits.{name}", f"{next(iter(given))} beside logs", "tables or logs, not both")
    for k, log in enumerate(table.logs):
        if log.posture.keys() != table.postures.keys():
            expected = f"a number for each of {', '.join(table.postures)}" if table.postures else "none"
            keys = ", ".join(log.posture) or "none"
            raise InputError(origin, f"gaits.{name}.logs[{k}].posture", keys, expected)
    parts = [log.model_copy(update={"file": Path(origin).parent / log.file}) for log in table.logs]
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
    for key in table.posture:
        if key not in gait.postures:
            some = ", ".join(gait.postures)
            expected = f"some of {some}" if some else f"none, for {gait.name} has no postures"
            raise InputError(origin, f"{place}.posture.{key}", "a posture that the gait has not", expected)
    posture = {
        key: _range(table.posture.get(key), knots, f"{place}.posture.{key}", "", origin)
        for key, knots in gait.postures.items()
    }
    if travels:
        speed = _range(table.speed, gait.speeds, f"{place}.speed", "m/s", origin)
        return Activity(table.do, gait, table.distance, (0.0, 0.0), speed, load, posture, table.pieces or 3)
    if table.duration is None or table.speed is not None:
        raise InputError(origin, place, "no duration" if table.duration is None else "a speed", "a duration [s]")
    least, most = table.duration
    if not most:
        raise InputError(origin, f"{place}.duration", "0 s", "a time [s], or the least and the most")
    return Activity(table.do, gait, None, (least, most), (0.0, 0.0), load, posture, table.pieces or 1)


def _range(given: Sequence[float] | None, cells: FloatArray, place: str, unit: str, origin: str) -> Range:
    """Least and most of a speed or load, within the cells of the gait."""
    low, high = float(cells[0]), float(cells[-1])
    if given is None:
        return (low, low) if unit == "kg" else (low, high)
    least, most = given
    if not low - 1e-9 <= least <= most <= high + 1e-9:
        found, unit = f"{least:g}" if least == most else f"[{least:g}, {most:g}]", f" {unit}" if unit else ""
        raise InputError(origin, place, f"{found}{unit}", f"within {low:g} to {high:g}{unit}, the gait's cells")
    return least, most
