"""Study files: their tables and keys, checked by pydantic; each mistake said with its line and what was expected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError, shown
from lptn.basics.files import text_of
from lptn.basics.places import matching
from lptn.basics.toml import mistakes_by_line, toml_of
from lptn.model.file import Number, Strict, parse_model, read_model_file
from lptn.model.network import Network
from lptn.robots.presets import presets

from ..values import (
    Capacity,
    Celsius,
    Current,
    ExtraMass,
    ExtraPower,
    ExtraVolume,
    Kelvins,
    Length,
    Mass,
    NotNegative,
    Positive,
    Power,
    Resistance,
    Runtime,
    Seconds,
    SpecificEnergy,
    Speed,
    Torque,
    TorqueConstant,
    Volume,
)
from . import profiles
from .motors import MAGNET_COEFFICIENT, MOTORS
from .sink import Air, blown_air, still_air
from .study import Cooling, Fan, Goal, MotorChoice, Pipes, Sink, Study, Sweep, Task, attachable, pipe_places

_SWEPT = {"mass": Mass, "volume": Volume, "torque": Torque, "duration": Seconds}
_UNITS = {"mass": "kg", "volume": "m^3", "torque": "N*m", "duration": "s"}
_MOST_FACTOR = 1e6  # kg of body on a motor without gear
_NEEDED = {"mass": "kg", "volume": "m^3", "torque_constant": "N*m/A at 25 degC"}

# --- tables and keys ----------------------------------------------------------------------------


class StudyTable(Strict):
    name: str = "study"
    goal: Goal
    cooling: list[Cooling] = Field(default=["none", "passive", "fan"], min_length=1)


class TaskTable(Strict):
    kind: Literal["hold", "cycle", "level_walking", "jump"] = "hold"
    torque: Torque | None = None
    profile: Annotated[list[NotNegative], Field(min_length=2, max_length=400)] | None = None
    duration: Seconds | None = None
    longest: Seconds = 3600.0
    ambient: Celsius = 25.0
    start: Celsius | None = None
    period: Seconds | None = None
    cycles: Annotated[int, Field(ge=1, le=100, strict=True)] | None = None
    samples: Annotated[int, Field(ge=5, le=400, strict=True)] = 40
    body_mass: Mass = 75.0
    gear: Positive = 50.0
    share: Annotated[Number, Field(gt=0, le=1)] = 1.0


class LimitsTable(Strict):
    winding: Celsius | None = None
    magnet: Celsius | None = None
    current: Current | None = None
    pipe_power: Power | None = None
    mass: Mass | None = None
    volume: Volume | None = None


class MotorTable(Strict):
    name: str
    model: str | None = None
    winding: str | None = None  # node or pattern; the nodes with copper loss
    magnet: str | None = None  # node or pattern; nodes called magnet…, else the housing
    sink_at: str | None = None  # node, body's face or pattern; else [sink] at, else the stator or housing's outside
    mass: Mass | None = None
    volume: Volume | None = None
    torque_constant: TorqueConstant | None = None
    magnet_coefficient: Annotated[Number, Field(gt=-0.01, le=0)] | None = None


class SinkTable(Strict):
    at: str | None = None
    node: str = "sink"
    capacity: list[Capacity] = Field(default=[20.0, 1500.0], min_length=2, max_length=2)
    resistance: list[Resistance] = Field(default=[0.05, 10.0], min_length=2, max_length=2)
    fin_thickness: Length = 1e-3
    fin_depth: Length = 0.03
    fin_height: Length = 0.08
    excess: Kelvins = 30.0


class PipesTable(Strict):
    count: list[Annotated[int, Field(ge=1, le=64, strict=True)]] = Field(default=[4], min_length=1)
    resistance: Resistance = 0.708  # each, with its contacts: four make the 0.177 K/W of the thesis's exchanger
    power: Power = 65.0  # each; [Chen2017, appendix A.4]
    mass: ExtraMass = 0.03  # each; assumed
    mount: ExtraMass = 0.06  # the insert that holds them; assumed


class FanTable(Strict):
    mass: ExtraMass = 0.05
    volume: ExtraVolume = 1e-4
    power: ExtraPower = 2.0
    speed: Speed = 3.0
    runtime: Runtime = 0.0
    battery: SpecificEnergy = 5.4e5  # 150 W·h/kg


class SweepTable(Strict):
    against: Literal["mass", "volume", "torque", "duration"] = "mass"
    least: Any
    most: Any
    points: Annotated[int, Field(ge=2, le=200, strict=True)] = 12


class File(Strict):
    study: StudyTable
    task: TaskTable = TaskTable()
    limits: LimitsTable = LimitsTable()
    motors: Annotated[list[MotorTable], Field(min_length=1)]
    sink: SinkTable = SinkTable()
    pipes: PipesTable = PipesTable()
    fan: FanTable = FanTable()
    pareto: SweepTable | None = None


# --- reading ------------------------------------------------------------------------------------


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
    with mistakes_by_line(path, text):
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
        expected = (
            f'one of {", ".join(MOTORS)}, or for a motor of your own any name with model = "its model file", '
            f"{_needed(_NEEDED)}"
        )
        raise InputError(path, f"{place}.name", f'unknown motor "{table.name}"', expected)
    given = {"mass": table.mass, "volume": table.volume, "torque_constant": table.torque_constant}
    limits: dict[str, float] = {}
    if known is not None:
        sheet = {"mass": known.mass.value, "volume": known.volume, "torque_constant": known.torque_constant.value}
        given = {name: sheet[name] if value is None else value for name, value in given.items()}
        data = {"winding": known.winding_limit, "magnet": known.magnet_limit, "current": known.most_current}
        limits = {name: datum.value for name, datum in data.items()}
    absent = [name for name, value in given.items() if value is None]
    if absent:
        raise InputError(path, place, f'"{table.name}" without {", ".join(absent)}', _needed(absent))
    numbers = {name: value for name, value in given.items() if value is not None}
    network = _network(table.model or (known.model if known is not None else ""), f"{place}.model", path)
    return MotorChoice(
        table.name,
        network,
        _winding(table, network, place, path),
        _magnet(table, network, place, path),
        _sink_at(table, tables, network, place, path),
        magnet_coefficient=MAGNET_COEFFICIENT if table.magnet_coefficient is None else table.magnet_coefficient,
        limits=limits,
        **numbers,
    )


def _needed(names: Sequence[str] | dict[str, str]) -> str:
    return ", ".join(f"{name} = … [{_NEEDED[name]}]" for name in names)


def _winding(table: MotorTable, network: Network, place: str, path: Path) -> tuple[str, ...]:
    """Nodes whose temperature the enamel limits: as the study says, else those that copper loss heats."""
    if table.winding is not None:
        return _nodes(table.winding, network, f"{place}.winding", path)
    heated = network.nodes_with("copper_loss")
    if not heated:
        expected = f"one from a current, or winding = … (one of {', '.join(network.dynamic)})"
        raise InputError(path, f"{place}.model", "a network without copper loss", expected)
    return tuple(heated)


def _magnet(table: MotorTable, network: Network, place: str, path: Path) -> tuple[str, ...]:
    """Nodes taken as the magnets: as the study says, else those called magnet…, else the housing."""
    if table.magnet is not None:
        return _nodes(table.magnet, network, f"{place}.magnet", path)
    magnets = matching("magnet*", network.dynamic) or matching("housing", network.dynamic)
    if not magnets:
        found = "no node called magnet… or housing"
        expected = f"magnet = …, whose temperature sets the torque constant: one of {', '.join(network.dynamic)}"
        raise InputError(path, place, found, expected)
    return tuple(magnets)


def _nodes(pattern: str, network: Network, place: str, path: Path) -> tuple[str, ...]:
    nodes = matching(pattern, network.dynamic)
    if not nodes:
        expected = f"one of {', '.join(network.dynamic)}, nodes of {network.origin}, or a pattern of them"
        raise InputError(path, place, f'node "{pattern}"', expected)
    return tuple(nodes)


def _sink_at(table: MotorTable, tables: File, network: Network, place: str, path: Path) -> str:
    """What the heat pipes touch: as the study says, else the stator, else the outside of the housing."""
    if set(tables.study.cooling) == {"none"}:
        return ""
    usual = ("stator", "housing*.outer", "housing*.front", "housing")
    own = table.sink_at if table.sink_at is not None else tables.sink.at
    for at in usual if own is None else [own]:
        if pipe_places(network, at):
            return at
    where = f"{place}.sink_at" if table.sink_at is not None else "sink.at"
    found = "nothing said, and no stator or housing" if own is None else f'node "{own}"'
    if own is not None and own in network.dynamic:
        found = f'"{own}", a body, which a heat pipe touches at a face'
    places = ", ".join(attachable(network))
    expected = f"one of {places}, where heat pipes can touch {network.origin}, or a pattern of them"
    raise InputError(path, where, found, expected)


def _network(name: str, place: str, path: Path) -> Network:
    ready = presets()
    if name in ready:
        network = parse_model(ready[name], Path(f"{name}.toml")).network
    elif (path.parent / name).is_file():
        network = read_model_file(path.parent / name).network
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


def _cycle(table: TaskTable, path: Path) -> tuple[FloatArray, float]:
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
            expected = f"winding = … in degC, for no data sheet gives {option.motor.name}'s"
            raise InputError(path, "limits", "no limit of the winding's temperature", expected)
        hottest = max(study.task.start, study.task.ambient)
        if limit is not None and limit <= hottest:
            where = "limits.winding" if "winding" in study.limits else f"motors[{study.motors.index(option.motor)}]"
            raise InputError(path, where, f"{limit:g} degC", f"more than the {hottest:g} degC of the start and the air")


def _sweep(table: SweepTable, study: Study, path: Path) -> Sweep:
    unit, against, ends = _UNITS[table.against], table.against, []
    for name, given in (("least", table.least), ("most", table.most)):
        try:
            ends.append(float(TypeAdapter(_SWEPT[against]).validate_python(given)))
        except ValidationError as error:
            raise InputError(path, f"pareto.{name}", shown(given), f"a number above 0 in {unit}") from error
    if not ends[0] < ends[1]:
        raise InputError(path, "pareto.least", f"{ends[0]:g} to {ends[1]:g} {unit}", "a least below the most")
    task = study.task
    is_sought = {"torque": task.torque is None, "duration": task.duration is None or not task.hold}
    if is_sought.get(against, against == study.goal):
        raise InputError(path, "pareto.against", f'"{against}"', f"what a study of {study.goal} is given, not seeks")
    return Sweep(against, tuple(np.linspace(ends[0], ends[1], table.points).tolist()))
