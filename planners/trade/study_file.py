"""`study.toml` read: every mistake named with its line, its key, what was found and what was expected."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lptn.errors import InputError, shown
from lptn.model_file import load_model, parse_model
from lptn.model_mistakes import text_of, told_by_line, toml_of
from lptn.network import Network
from lptn.robots import presets
from lptn.units import convert

from ..motors import MAGNET_COEFFICIENT, MOTORS
from . import profiles
from .parts import Fan, MotorChoice, Pipes, Sink, Sweep, Task, sweep_values
from .schema import File, MotorTable, SweepTable, TaskTable
from .sink import Air, blown_air, still_air
from .study import Study

_UNITS = {"mass": "kg", "volume": "m^3", "torque": "N*m", "duration": "s"}
_MOST_FACTOR = 1e6  # kg of body on a motor without gear
_NEEDED = {"mass": "a mass in kg", "volume": "a volume in m^3", "torque_constant": "a torque constant in N*m/A"}


def load_study(path: Path) -> Study:
    """Read a study file.

    Args:
        path: of the TOML file; models that it names stand beside it.

    Raises:
        InputError: it can't be read, is not TOML, or says something that can't be a study; with its line.
    """
    return parse_study(text_of(path, "a study file"), path)


def parse_study(text: str, path: Path) -> Study:
    """Read a study from the text of its file; `path` serves for messages and for models beside it.

    Raises:
        InputError: with the line of the mistake.
    """
    with told_by_line(path, text):
        tables = File.model_validate(toml_of(path, text))
        return _study(tables, path)


def _study(tables: File, path: Path) -> Study:
    motors = tuple(_motor(motor, number, tables, path) for number, motor in enumerate(tables.motors))
    _refuse_twice([motor.name for motor in motors], path)
    sink, fan = tables.sink, tables.fan
    still = still_air(sink.excess, sink.fin_height)
    study = Study(
        tables.study.name,
        tables.study.goal,
        _task(tables.task, tables.study.goal, path),
        motors,
        tuple(dict.fromkeys(tables.study.cooling)),
        {name: value for name, value in tables.limits.model_dump().items() if value is not None},
        Sink(
            sink.at,
            sink.node,
            _range(sink.capacity, "sink.capacity", path),
            _range(sink.resistance, "sink.resistance", path),
            sink.fin_thickness,
            sink.fin_depth,
        ),
        Pipes(tuple(dict.fromkeys(tables.pipes.count)), tables.pipes.resistance, tables.pipes.power,
              tables.pipes.mass, tables.pipes.mount),
        Fan(fan.mass + fan.power * fan.runtime / fan.battery, fan.volume, fan.power),
        {"none": Air(1.0, 1.0), "passive": still, "fan": blown_air(fan.speed, sink.fin_height)},
        origin=str(path),
    )  # fmt: skip
    _check(study, path)
    return study if tables.pareto is None else replace(study, sweep=_sweep(tables.pareto, study, path))


# --- motors -------------------------------------------------------------------------------------


def _motor(table: MotorTable, number: int, tables: File, path: Path) -> MotorChoice:
    place = f"motors[{number}]"
    known = MOTORS.get(table.name)
    if known is None and table.model is None:
        expected = f"one of {', '.join(MOTORS)}, or a motor of your own with model, mass, volume and torque_constant"
        raise InputError(path, f"{place}.name", f'unknown motor "{table.name}"', expected)
    given = {"mass": table.mass, "volume": table.volume, "torque_constant": table.torque_constant}
    if known is not None:
        own = {"mass": known.mass.value, "volume": known.volume, "torque_constant": known.torque_constant.value}
        given = {name: own[name] if value is None else value for name, value in given.items()}
    numbers = {}
    for name, value in given.items():
        if value is None:
            raise InputError(path, place, f'"{table.name}" without {name}', f"{name} = … ({_NEEDED[name]})")
        numbers[name] = value
    limits = {}
    if known is not None:
        data = {"winding": known.winding_limit, "magnet": known.magnet_limit, "current": known.most_current}
        limits = {name: datum.value for name, datum in data.items()}
    model = table.model or (known.model if known is not None else "")
    network = _network(model, f"{place}.model", path)
    coefficient = MAGNET_COEFFICIENT if table.magnet_coefficient is None else table.magnet_coefficient
    for key, node in (("winding", table.winding), ("magnet", table.magnet), ("sink", tables.sink.at)):
        if node not in network.dynamic and not (key == "sink" and set(tables.study.cooling) == {"none"}):
            where = "sink.at" if key == "sink" else f"{place}.{key}"
            raise InputError(path, where, f'node "{node}"', f"one of {', '.join(network.dynamic)}, nodes of {model}")
    return MotorChoice(table.name, network, table.winding, table.magnet, magnet_coefficient=coefficient,
                       limits=limits, **numbers)  # fmt: skip


def _network(name: str, place: str, path: Path) -> Network:
    ready = presets()
    if name in ready:
        network = parse_model(ready[name], Path(f"{name}.toml")).network
    elif (path.parent / name).is_file():
        network = load_model(path.parent / name).network
    else:
        raise InputError(path, place, f'"{name}"', f"a model file beside the study, or one of {', '.join(ready)}")
    if len(network.prescribed) != 1:
        raise InputError(path, place, f"{len(network.prescribed)} prescribed temperatures", "one, the air's")
    return network


def _refuse_twice(names: list[str], path: Path) -> None:
    """Answers are kept by the motor's name."""
    for number, name in enumerate(names):
        if name in names[:number]:
            found = f'"{name}" a second time'
            raise InputError(path, f"motors[{number}].name", found, "a name of its own for each motor")


# --- task ---------------------------------------------------------------------------------------


def _task(table: TaskTable, goal: str, path: Path) -> Task:
    start = table.ambient if table.start is None else table.start
    if table.kind == "hold":
        return _hold(table, goal, start, path)
    if goal == "time_to_limit":
        raise InputError(path, "task.kind", f'"{table.kind}"', 'kind = "hold" for the goal time_to_limit')
    shape, period = _cycle(table, path)
    peak: float | None = float(shape.max())
    if not peak:
        raise InputError(path, "task.profile", "no torque at all", "one part of the cycle at least above 0 N*m")
    shape = shape / peak
    if goal == "held_torque":
        peak = None
    return Task(shape, peak, period, table.cycles, False, table.longest, table.ambient, start)


def _hold(table: TaskTable, goal: str, start: float, path: Path) -> Task:
    torque, duration = table.torque, table.duration
    for name, value, sought in (("torque", torque, "held_torque"), ("duration", duration, "time_to_limit")):
        if value is None and goal != sought:
            raise InputError(path, "task", f"no {name}", f"{name} = … for the goal {goal}")
        if value is not None and goal == sought:
            raise InputError(path, f"task.{name}", f"{value:g}", f"no {name}, for the goal {goal} seeks it")
    for name in ("profile", "period", "cycles"):
        if getattr(table, name) is not None:
            raise InputError(path, f"task.{name}", "a key of a duty cycle", 'kind = "cycle" with it')
    return Task(np.ones(1), torque, duration, 1, True, table.longest, table.ambient, start)


def _cycle(table: TaskTable, path: Path) -> tuple[Any, float]:
    """Torque at the motor [N·m] in each part of the cycle, and the cycle's time [s]."""
    if table.duration is not None:
        raise InputError(path, "task.duration", f"{table.duration:g} s", "period and cycles for a duty cycle")
    if table.kind == "cycle":
        if table.profile is None or table.period is None:
            missing = "profile" if table.profile is None else "period"
            raise InputError(path, "task", f"no {missing}", f"{missing} = … for a duty cycle")
        return np.array(table.profile), table.period
    if table.torque is not None or table.profile is not None:
        raise InputError(path, "task", "a torque of its own", f"body_mass, gear and share for {table.kind}")
    moment = {"level_walking": profiles.level_walking, "jump": profiles.jump}[table.kind](table.samples)
    period = {"level_walking": profiles.WALKING_PERIOD, "jump": profiles.JUMP_PERIOD}[table.kind]
    factor = table.body_mass * table.share / table.gear
    if not 0 < factor < _MOST_FACTOR:
        expected = f"body_mass * share / gear below {_MOST_FACTOR:g} kg"
        raise InputError(path, "task", f"{factor:g} kg", expected)
    return moment * factor, table.period or period


# --- the rest -----------------------------------------------------------------------------------


def _range(given: list[float], place: str, path: Path) -> tuple[float, float]:
    if not given[0] <= given[1]:
        raise InputError(path, place, f"{given[0]:g} above {given[1]:g}", "[least, greatest]")
    return given[0], given[1]


def _check(study: Study, path: Path) -> None:
    """Mistakes that only the whole study shows."""
    for option in study.options():
        limit = option.limits.get("winding")
        if limit is None and study.goal != "worst_temperature":
            expected = f"winding = … in degC, for nothing is known of {option.motor.name}'s"
            raise InputError(path, "limits", "no limit of the winding's temperature", expected)
        hottest = max(study.task.start, study.task.ambient)
        if limit is not None and limit <= hottest:
            where = "limits.winding" if "winding" in study.limits else f"motors[{study.motors.index(option.motor)}]"
            raise InputError(path, where, f"{limit:g} degC", f"more than the {hottest:g} degC of the start and the air")


def _sweep(table: SweepTable, study: Study, path: Path) -> Sweep:
    unit, against = _UNITS[table.against], table.against
    ends = []
    for name, given in (("least", table.least), ("most", table.most)):
        try:
            value = convert(float(given["value"]), given["unit"], unit) if isinstance(given, dict) else float(given)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(path, f"pareto.{name}", shown(given), f"a number in {unit}") from error
        if not abs(value) < 1e15:
            raise InputError(path, f"pareto.{name}", shown(given), f"a number in {unit} below 1e15")
        ends.append(value)
    if not 0 < ends[0] < ends[1]:
        raise InputError(path, "pareto.least", f"{ends[0]:g} to {ends[1]:g} {unit}", "a least above 0, below the most")
    task = study.task
    swept_is_sought = {"torque": task.torque is None, "duration": task.duration is None or not task.hold}
    if swept_is_sought.get(against, against == study.goal):
        raise InputError(path, "pareto.against", f'"{against}"', f"what a study of {study.goal} is given, not seeks")
    return Sweep(against, sweep_values(ends[0], ends[1], table.points))
