"""Study files: their tables and keys, checked by pydantic; each mistake said with its line and what was expected."""

from __future__ import annotations

import math
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
from lptn.basics.toml import Number, Strict, mistakes_by_line, toml_of
from lptn.model.file import parse_model, read_model_file
from lptn.model.network import Network
from lptn.robots.presets import presets

from ..values import (
    AnySpeed,
    Capacity,
    Celsius,
    Conductivity,
    Current,
    Density,
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
    ShaftSpeed,
    SpecificEnergy,
    SpecificHeat,
    Speed,
    Torque,
    Voltage,
    Volume,
)
from . import profiles
from .catalogue import MotorTable, data_sheet_network, known_motors, read_catalogue
from .motors import MAGNET_COEFFICIENT
from .sink import MATERIALS, Air, Material, blown_air, still_air
from .study import (
    CURRENCY,
    Cooling,
    Fan,
    Gear,
    Goal,
    MotorChoice,
    Pipes,
    Sink,
    Study,
    Sweep,
    Task,
    Uncertainty,
    attachable,
    pipe_places,
)

_SWEPT: dict[str, tuple[Any, str]] = {
    "mass": (Mass, "kg"),
    "volume": (Volume, "m^3"),
    "price": (Positive, ""),
    "voltage": (Voltage, "V"),
    "torque": (Torque, "N*m"),
    "duration": (Seconds, "s"),
    "ratio": (Positive, "revolutions of the motor by one of the load"),
}
_GEAR = 50.0  # of walking and jumping where no gear is said
_MOST_FACTOR = 1e6  # kg of body on a motor without gear
_NEEDED = {"mass": "kg", "volume": "m^3", "torque_constant": "N*m/A at 25 degC"}
_MOST_DRAWS = 4096  # an hour for a study of some choices

# --- tables and keys ----------------------------------------------------------------------------


class StudyTable(Strict):
    name: str = "study"
    goal: Goal
    cooling: list[Cooling] = Field(default=["none", "passive", "fan"], min_length=1)
    catalogue: str | list[str] = Field(default=[])
    currency: Annotated[str, Field(pattern=r"^\S{1,8}$")] = CURRENCY


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
    speed: AnySpeed | None = None
    speeds: Annotated[list[AnySpeed], Field(min_length=2, max_length=400)] | None = None
    gear: Positive | None = None
    share: Annotated[Number, Field(gt=0, le=1)] = 1.0


class LimitsTable(Strict):
    winding: Celsius | None = None
    magnet: Celsius | None = None
    current: Current | None = None
    voltage: Voltage | None = None
    speed: ShaftSpeed | None = None
    pipe_power: Power | None = None
    mass: Mass | None = None
    volume: Volume | None = None
    price: Positive | None = None


class GearTable(Strict):
    name: str
    ratio: Positive | Annotated[list[Positive], Field(min_length=2, max_length=2)]
    efficiency: Annotated[Number, Field(gt=0, le=1)] = 1.0
    mass: ExtraMass = 0.0
    volume: ExtraVolume = 0.0
    price: NotNegative | None = None


class MaterialTable(Strict):
    density: Density | None = None
    specific_heat: SpecificHeat | None = None
    conductivity: Conductivity | None = None
    price: NotNegative | None = None


class SinkTable(Strict):
    at: str | None = None
    node: str = "sink"
    material: str | Annotated[list[str], Field(min_length=1)] = "aluminium"
    price: NotNegative = 0.0  # of making it, beside its metal
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
    price: NotNegative = 0.0  # each


class FanTable(Strict):
    mass: ExtraMass = 0.05
    volume: ExtraVolume = 1e-4
    power: ExtraPower = 2.0
    speed: Speed = 3.0
    runtime: Runtime = 0.0
    battery: SpecificEnergy = 5.4e5  # 150 W·h/kg
    price: NotNegative = 0.0


class SweepTable(Strict):
    against: Literal["mass", "volume", "price", "voltage", "torque", "duration", "ratio"] = "mass"
    least: Any
    most: Any
    points: Annotated[int, Field(ge=2, le=200, strict=True)] = 12


class UncertaintyTable(Strict):
    draws: Annotated[int, Field(ge=8, le=_MOST_DRAWS, strict=True)] = 128
    level: Annotated[Number, Field(ge=0.5, lt=1)] = 0.95
    errors: dict[str, Any] = Field(default={})


class File(Strict):
    study: StudyTable
    task: TaskTable = TaskTable()
    limits: LimitsTable = LimitsTable()
    motors: Annotated[list[MotorTable], Field(min_length=1)]
    sink: SinkTable = SinkTable()
    gears: Annotated[list[GearTable], Field(min_length=1)] | None = None
    materials: dict[str, MaterialTable] = Field(default={})
    pipes: PipesTable = PipesTable()
    fan: FanTable = FanTable()
    pareto: SweepTable | None = None
    uncertainty: UncertaintyTable | None = None


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
    motors = tuple(_motor(motor, place, tables, path) for place, motor in _chosen_motors(tables, path))
    gears = tuple(_gear(gear, number, path) for number, gear in enumerate(tables.gears or ()))
    _refuse_twice([gear.name for gear in gears], "gears", path)
    sink, fan = tables.sink, tables.fan
    still = still_air(sink.excess, sink.fin_height)
    study = Study(
        tables.study.name,
        tables.study.goal,
        _task(tables.task, tables.study.goal, bool(gears), path),
        motors,
        tuple(dict.fromkeys(tables.study.cooling)),
        {name: value for name, value in tables.limits.model_dump().items() if value is not None},
        Sink(
            sink.node,
            _range(sink.capacity, "sink.capacity", path),
            _range(sink.resistance, "sink.resistance", path),
            sink.fin_thickness,
            sink.fin_depth,
            _materials(tables, path),
            sink.price,
        ),
        Pipes(tuple(dict.fromkeys(tables.pipes.count)), tables.pipes.resistance, tables.pipes.power,
              tables.pipes.mass, tables.pipes.mount, tables.pipes.price),
        Fan(fan.mass + fan.power * fan.runtime / fan.battery, fan.volume, fan.power, fan.price),
        {"none": Air(1.0, 1.0), "passive": still, "fan": blown_air(fan.speed, sink.fin_height)},
        gears=gears or (Gear(),),
        uncertainty=_uncertainty(tables.uncertainty, path),
        origin=str(path),
        currency=tables.study.currency,
    )  # fmt: skip
    if tables.pareto is not None:
        study = replace(study, sweep=_sweep(tables.pareto, study, path))
    _check(study, path)
    return study


# --- motors -------------------------------------------------------------------------------------


def _chosen_motors(tables: File, path: Path) -> list[tuple[str, MotorTable]]:
    """Each motor with the place that asks for it: a name or pattern of the catalogue, or a motor of the study's own."""
    catalogue = known_motors()
    names = tables.study.catalogue
    for name in [names] if isinstance(names, str) else names:
        if not (path.parent / name).is_file():
            raise InputError(path, "study.catalogue", f'"{name}"', "a CSV or TOML file beside the study")
        catalogue |= read_catalogue(path.parent / name)
    chosen: dict[str, tuple[str, MotorTable]] = {}
    for number, motor in enumerate(tables.motors):
        place = f"motors[{number}]"
        matches = [motor.name] if motor.name in catalogue else matching(motor.name, catalogue)
        own = motor.model is not None or motor.data_sheet is not None
        if not matches and not own:
            expected = (
                f"one of {', '.join(catalogue)} or a pattern of them, a motor of study.catalogue, or for a motor of "
                f'your own any name with model = "its model file" or data_sheet = {{…}}, {_needed(_NEEDED)}'
            )
            raise InputError(path, f"{place}.name", f'unknown motor "{motor.name}"', expected)
        for name in matches or [motor.name]:
            if name in chosen:
                mistake = f'"{name}" a second time'
                raise InputError(path, f"{place}.name", mistake, "a name of its own for each motor")
            said = motor.model_copy(update={"name": name})
            chosen[name] = (place, said.over(catalogue[name]) if name in catalogue else said)
    return list(chosen.values())


def _motor(table: MotorTable, place: str, tables: File, path: Path) -> MotorChoice:
    given = {"mass": table.mass, "volume": table.package, "torque_constant": table.constant}
    absent = [name for name, value in given.items() if value is None]
    if absent:
        raise InputError(path, place, f'"{table.name}" without {", ".join(absent)}', _needed(absent))
    numbers = {name: value for name, value in given.items() if value is not None}
    errors: dict[str, float] = {}
    if table.data_sheet is not None:
        network = data_sheet_network(table.name, table.data_sheet)
    else:
        network, errors = _network(table.model or "", f"{place}.model", path)
    return MotorChoice(
        table.name,
        network,
        _winding(table, network, place, path),
        _magnet(table, network, place, path),
        _sink_at(table, tables, network, place, path),
        magnet_coefficient=MAGNET_COEFFICIENT if table.magnet_coefficient is None else table.magnet_coefficient,
        limits=table.limits.model_dump(exclude_none=True),
        rotor_inertia=table.rotor_inertia or 0.0,
        price=table.price,
        standard_errors=errors,
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
        mistake = "no node called magnet… or housing"
        expected = f"magnet = …, whose temperature sets the torque constant: one of {', '.join(network.dynamic)}"
        raise InputError(path, place, mistake, expected)
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
    mistake = "nothing said, and no stator or housing" if own is None else f'node "{own}"'
    if own is not None and own in network.dynamic:
        mistake = f'"{own}", a body, which a heat pipe touches at a face'
    places = ", ".join(attachable(network))
    expected = f"one of {places}, where heat pipes can touch {network.origin}, or a pattern of them"
    raise InputError(path, where, mistake, expected)


def _network(name: str, place: str, path: Path) -> tuple[Network, dict[str, float]]:
    """A motor's network, and the standard errors of its parameters where it was fitted."""
    ready = presets()
    if name in ready:
        model = parse_model(ready[name], Path(f"{name}.toml"))
    elif name and (path.parent / name).is_file():
        model = read_model_file(path.parent / name)
    else:
        raise InputError(path, place, f'"{name}"', f"a model file beside the study, or one of {', '.join(ready)}")
    network = model.network
    if len(network.prescribed) != 1:
        raise InputError(path, place, f"{len(network.prescribed)} prescribed temperatures", "one, the air's")
    return network, {} if model.fit is None else dict(model.fit.standard_errors)


def _refuse_twice(names: list[str], table: str, path: Path) -> None:
    """Answers are kept by name."""
    for number, name in enumerate(names):
        if name in names[:number]:
            raise InputError(path, f"{table}[{number}].name", f'"{name}" a second time', "a name of its own for each")


# --- gears, materials, what is uncertain ----------------------------------------------------------


def _gear(table: GearTable, number: int, path: Path) -> Gear:
    if not table.name:
        raise InputError(path, f"gears[{number}].name", '""', "a name")
    ratio = _range(table.ratio, f"gears[{number}].ratio", path) if isinstance(table.ratio, list) else (table.ratio,) * 2
    return Gear(table.name, ratio, table.efficiency, table.mass, table.volume, table.price)


def _materials(tables: File, path: Path) -> tuple[Material, ...]:
    materials = dict(MATERIALS)
    for name, table in tables.materials.items():
        said = table.model_dump(exclude_none=True)
        absent = [key for key in ("density", "specific_heat", "conductivity") if key not in said]
        if name in materials:
            materials[name] = replace(materials[name], **said)
        elif absent:
            raise InputError(
                path, f"materials.{name}", f"no {', '.join(absent)}", "density, specific_heat, conductivity"
            )
        else:
            materials[name] = Material(name, **said)
    asked = tables.sink.material
    names = [asked] if isinstance(asked, str) else asked
    for name in names:
        if name not in materials:
            expected = f"one of {', '.join(materials)}, or a table [materials.{name}]"
            raise InputError(path, "sink.material", f'"{name}"', expected)
    return tuple(materials[name] for name in dict.fromkeys(names))


def _uncertainty(table: UncertaintyTable | None, path: Path) -> Uncertainty | None:
    """Standard errors by pattern: a number is relative, `{ value = 3, unit = "K" }` is not."""
    if table is None:
        return None
    errors: dict[str, tuple[float, bool]] = {}
    for pattern, given in table.errors.items():
        place = f'uncertainty.errors."{pattern}"'
        number, relative = given, True
        if isinstance(given, dict) and set(given) == {"value", "unit"}:
            number, relative = given["value"], False
            if given["unit"] not in ("K", "SI"):
                raise InputError(path, place, shown(given["unit"]), 'unit = "K", or "SI" for a number in SI units')
        if isinstance(number, bool) or not isinstance(number, int | float) or not 0 <= number < math.inf:
            expected = 'a relative standard error such as 0.1, or { value = 3, unit = "K" }'
            raise InputError(path, place, shown(given), expected)
        errors[pattern] = (float(number), relative)
    return Uncertainty(errors, table.draws, table.level)


# --- task ---------------------------------------------------------------------------------------


def _task(table: TaskTable, goal: str, geared: bool, path: Path) -> Task:
    start = table.ambient if table.start is None else table.start
    if table.gear is not None and geared:
        raise InputError(path, "task.gear", f"{table.gear:g}", "no gear in [task] beside [[gears]]")
    if table.kind == "hold":
        return _hold(table, goal, start, path)
    if goal == "time_to_limit":
        raise InputError(path, "task.kind", f'"{table.kind}"', 'kind = "hold" for the goal time_to_limit')
    shape, speed, period = _cycle(table, geared, path)
    peak: float | None = float(shape.max())
    if not peak:
        raise InputError(path, "task.profile", "no torque at all", "one part of the cycle at least above 0 N*m")
    shape = shape / peak
    if goal == "held_torque":
        peak = None
    return Task(shape, peak, period, table.cycles, False, table.longest, table.ambient, start, speed)


def _hold(table: TaskTable, goal: str, start: float, path: Path) -> Task:
    torque, duration = table.torque, table.duration
    for name, value, sought in (("torque", torque, "held_torque"), ("duration", duration, "time_to_limit")):
        if value is None and goal != sought:
            raise InputError(path, "task", f"no {name}", f"{name} = … for the goal {goal}")
        if value is not None and goal == sought:
            raise InputError(path, f"task.{name}", f"{value:g}", f"no {name}, for the goal {goal} seeks it")
    for name in ("profile", "period", "cycles", "speeds"):
        if getattr(table, name) is not None:
            raise InputError(path, f"task.{name}", "a key of a duty cycle", 'kind = "cycle" with it')
    speed = np.array([table.speed or 0.0])
    return Task(np.ones(1), torque, duration, 1, True, table.longest, table.ambient, start, speed)


def _cycle(table: TaskTable, geared: bool, path: Path) -> tuple[FloatArray, FloatArray | None, float]:
    """Torque [N·m] and speed [rad/s] in each part of the cycle, and the cycle's time [s].

    They are the joint's where the study has gears, else the motor's.
    """
    if table.duration is not None:
        raise InputError(path, "task.duration", f"{table.duration:g} s", "period and cycles for a duty cycle")
    if table.speed is not None:
        raise InputError(
            path, "task.speed", f"{table.speed:g} rad/s", "speeds = […] for a duty cycle, one for each part"
        )
    if table.kind == "cycle":
        if table.profile is None or table.period is None:
            missing = "profile" if table.profile is None else "period"
            raise InputError(path, "task", f"no {missing}", f"{missing} = … for a duty cycle")
        if table.speeds is not None and len(table.speeds) != len(table.profile):
            expected = f"{len(table.profile)}, one for each part of the profile"
            raise InputError(path, "task.speeds", f"{len(table.speeds)} speeds", expected)
        speeds = None if table.speeds is None else np.array(table.speeds, dtype=float)
        return np.array(table.profile), speeds, table.period
    if table.torque is not None or table.profile is not None or table.speeds is not None:
        raise InputError(path, "task", "a torque or speeds of its own", f"body_mass, gear and share for {table.kind}")
    moment = {"level_walking": profiles.level_walking, "jump": profiles.jump}[table.kind](table.samples)
    period = table.period or {"level_walking": profiles.WALKING_PERIOD, "jump": profiles.JUMP_PERIOD}[table.kind]
    speeds = profiles.walking_speed(table.samples, period) if table.kind == "level_walking" else None
    gear = 1.0 if geared else table.gear or _GEAR
    factor = table.body_mass * table.share / gear
    if not 0 < factor < _MOST_FACTOR:
        expected = f"body_mass * share / gear below {_MOST_FACTOR:g} kg"
        raise InputError(path, "task", f"{factor:g} kg", expected)
    return moment * factor, None if speeds is None else speeds * gear, period


# --- the rest -----------------------------------------------------------------------------------


def _range(given: list[float], place: str, path: Path) -> tuple[float, float]:
    if not given[0] <= given[1]:
        raise InputError(path, place, f"{given[0]:g} above {given[1]:g}", "[least, greatest]")
    return given[0], given[1]


def _check(study: Study, path: Path) -> None:
    """Mistakes that only the whole study shows."""
    _check_speed(study, path)
    _check_prices(study, path)
    for option in study.options():
        limit = option.limits.get("winding")
        if limit is None and study.goal != "worst_temperature":
            expected = f"winding = … in degC, for no data sheet gives {option.motor.name}'s"
            raise InputError(path, "limits", "no limit of the winding's temperature", expected)
        hottest = max(study.task.start, study.task.ambient)
        if limit is not None and limit <= hottest:
            where = "limits.winding" if "winding" in study.limits else f"motors[{study.motors.index(option.motor)}]"
            raise InputError(path, where, f"{limit:g} degC", f"more than the {hottest:g} degC of the start and the air")


def _check_speed(study: Study, path: Path) -> None:
    if study.task.speed is not None:
        return
    for name in ("voltage", "speed"):
        if name in study.limits:
            expected = 'speeds = […] in [task], with kind = "cycle": nobody knows how fast this cycle turns'
            raise InputError(path, f"limits.{name}", "a task without speeds", expected)


def _check_prices(study: Study, path: Path) -> None:
    """What has no price must not pass for free."""
    if not study.asks_for_prices:
        return
    motor = next((motor for motor in study.motors if motor.price is None), None)
    if motor is not None:
        raise InputError(path, "motors", f'"{motor.name}" without a price', "price = … for each motor")
    gear = next((gear for gear in study.gears if gear.price is None), None)
    if gear is not None:
        raise InputError(path, "gears", f'"{gear.name}" without a price', "price = … for each gear")
    metal = next((metal for metal in study.sink.materials if metal.price is None), None)
    if metal is not None and set(study.cooling) != {"none"}:
        expected = f"[materials.{metal.name}] with price = …, by the kilogram"
        raise InputError(path, "sink.material", f'"{metal.name}" without a price', expected)


def _sweep(table: SweepTable, study: Study, path: Path) -> Sweep:
    (kind, unit), against, ends = _SWEPT[table.against], table.against, []
    unit = unit or study.currency
    for name, given in (("least", table.least), ("most", table.most)):
        try:
            ends.append(float(TypeAdapter(kind).validate_python(given)))
        except ValidationError as error:
            raise InputError(path, f"pareto.{name}", shown(given), f"a number above 0 in {unit}") from error
    if not ends[0] < ends[1]:
        raise InputError(path, "pareto.least", f"{ends[0]:g} to {ends[1]:g} {unit}", "a least below the most")
    task = study.task
    is_sought = {"torque": task.torque is None, "duration": task.duration is None or not task.hold}
    if against == "ratio" and not any(gear.name and not gear.is_sought for gear in study.gears):
        raise InputError(path, "pareto.against", '"ratio"', "a [[gears]] with one ratio, which the sweep replaces")
    if is_sought.get(against, against == study.goal):
        raise InputError(path, "pareto.against", f'"{against}"', f"what a study of {study.goal} is given, not seeks")
    return Sweep(against, tuple(np.linspace(ends[0], ends[1], table.points).tolist()))
