"""Study files: their tables read, motors found in catalogues and models, and mistakes that single keys do not show."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from lptn.basics.errors import InputError
from lptn.basics.files import text_of
from lptn.basics.places import matching
from lptn.basics.toml import mistakes_by_line, toml_of
from lptn.model.file import parse_model, read_model_file
from lptn.model.network import Network
from lptn.model.tables import File, Reader
from lptn.robots.presets import presets

from .motors import MOTORS, CatalogueMotor, data_sheet_network, read_catalogue
from .plant import KNOWN
from .study import SWEPT, Axis, DutyTask, MotorChoice, StudyTables, TradeStudy, attachable, pipe_places

_COPPER = "copper_loss.resistance"
"""How the names of parameters begin that are a winding's electrical resistance."""
_NEEDED = {"mass": "kg", "volume": "m^3", "torque_constant": "N*m/A at 25 degC"}


def load_study(path: Path) -> TradeStudy:
    """Read a study file.

    Args:
        path: of the TOML file; models that it names stand beside it.

    Raises:
        InputError: it can't be read, is not TOML, or says something that can't be a study; with its line.
    """
    return parse_study(text_of(path, "a study file"), path)


def parse_study(text: str, path: Path) -> TradeStudy:
    """Read a study from the text of its file; `path` serves for messages and for models beside it.

    Raises:
        InputError: with the line of the mistake.
    """
    with mistakes_by_line(path, text):
        tables = StudyTables.model_validate(toml_of(path, text))
        chosen = [_motor(motor, place, tables, path) for place, motor in _chosen_motors(tables, path)]
        motors = [_wound(motor, turns) for motor in chosen for turns in dict.fromkeys(motor.turns)]
        if "gears" in tables.model_fields_set:
            _refuse(path, _mistakes_of_gears([gear.name for gear in tables.gears]))
        named = (*tables.question.catalogue, *(motor.model for motor in tables.motors if motor.model))
        files = tuple(path.parent / name for name in named)
        reader = Reader(path, File())
        effects = [reader.effect(number, effect) for number, effect in enumerate(tables.effects)]
        found = {"motors": motors, "effects": effects, "origin": str(path), "files": files}
        study = TradeStudy(**dict(tables) | found)
        _refuse(path, _mistakes(study))
        for option in study.options():
            option.network()  # raises where an effect finds no place
        return study


def _refuse(path: Path, mistakes: Iterable[tuple[str, str, str]]) -> None:
    for place, found, expected in mistakes:
        raise InputError(path, place, found, expected)


# --- motors -------------------------------------------------------------------------------------


def _chosen_motors(tables: StudyTables, path: Path) -> list[tuple[str, CatalogueMotor]]:
    """Each motor with the place that asks for it: a name or pattern of the catalogue, or a motor of the study's own."""
    catalogue = dict(MOTORS)
    for name in tables.question.catalogue:
        if not (path.parent / name).is_file():
            raise InputError(path, "study.catalogue", f'"{name}"', "a CSV or TOML file beside the study")
        catalogue |= read_catalogue(path.parent / name)
    chosen: dict[str, tuple[str, CatalogueMotor]] = {}
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


def _motor(table: CatalogueMotor, place: str, tables: StudyTables, path: Path) -> MotorChoice:
    given = table.model_dump(exclude_unset=True)
    given |= {"volume": table.package, "torque_constant": table.constant}
    absent = [name for name in _NEEDED if given.get(name) is None]
    if absent:
        raise InputError(path, place, f'"{table.name}" without {", ".join(absent)}', _needed(absent))
    errors: dict[str, float] = {}
    if table.data_sheet is not None:
        network = data_sheet_network(table.name, table.data_sheet)
    else:
        network, errors = _network(table.model or "", f"{place}.model", path)
    one_of = f"one of {', '.join(network.dynamic)}"
    # Nodes whose temperature the enamel limits: as the study says, else those that copper loss heats.
    windings = _nodes(table.winding, network, f"{place}.winding", path) or network.nodes_with("copper_loss")
    if not windings:
        expected = f"one from a current, or winding = … ({one_of})"
        raise InputError(path, f"{place}.model", "a network without copper loss", expected)
    # Nodes taken as the magnets: as the study says, else those called magnet…, else the housing.
    magnets = _nodes(table.magnet, network, f"{place}.magnet", path)
    magnets = magnets or matching("magnet*", network.dynamic) or matching("housing", network.dynamic)
    if not magnets:
        expected = f"magnet = …, whose temperature sets the torque constant: {one_of}"
        raise InputError(path, place, "no node called magnet… or housing", expected)
    found = {
        "network": network,
        "winding_nodes": tuple(windings),
        "magnet_nodes": tuple(magnets),
        "sink_at": _sink_at(table, tables, network, place, path),
        "standard_errors": errors,
    }
    return MotorChoice(**given | found)


def _wound(motor: MotorChoice, turns: float) -> MotorChoice:
    """A motor with so many times the turns of as much copper: the torque constant goes with them, resistance with their
    square, and its own largest current with their inverse; the drive's stays."""
    copper = {p.name: p.value * turns**2 for p in motor.network.parameters if p.name.startswith(_COPPER)}
    errors = {name: error * turns**2 for name, error in motor.standard_errors.items() if name in copper}
    current = motor.limits.current
    limits = {"current": None if current is None else current / turns}
    wound = {
        "name": f"{motor.name}, {turns:.12g} × turns" if len(motor.turns) > 1 else motor.name,
        "torque_constant": motor.torque_constant * turns,
        "network": motor.network.with_values(copper),
        "standard_errors": motor.standard_errors | errors,
        "limits": motor.limits.model_copy(update=limits),
    }
    return motor.model_copy(update=wound)


def _needed(names: Iterable[str]) -> str:
    return ", ".join(f"{name} = … [{_NEEDED[name]}]" for name in names)


def _nodes(pattern: str | None, network: Network, place: str, path: Path) -> list[str]:
    """The nodes that a pattern names; none where nothing is said."""
    nodes = [] if pattern is None else matching(pattern, network.dynamic)
    if pattern is not None and not nodes:
        expected = f"one of {', '.join(network.dynamic)}, nodes of {network.origin}, or a pattern of them"
        raise InputError(path, place, f'node "{pattern}"', expected)
    return nodes


def _sink_at(table: CatalogueMotor, tables: StudyTables, network: Network, place: str, path: Path) -> str:
    """What the heat pipes touch: as the study says, else the stator, else the outside of the housing."""
    if tables.question.cooling == ["none"]:
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


# --- mistakes that only the whole study shows ---------------------------------------------------

Mistake = tuple[str, str, str]
"""Its place in the file, what was found there, what was expected."""


def _mistakes_of_gears(names: Sequence[str]) -> Iterator[Mistake]:
    """Answers are kept by name."""
    for number, name in enumerate(names):
        if not name:
            yield f"gears[{number}].name", '""', "a name"
        if name in names[:number]:
            yield f"gears[{number}].name", f'"{name}" a second time', "a name of its own for each"


def _mistakes(study: TradeStudy) -> Iterator[Mistake]:
    goal, task = study.question.goal, study.task
    yield from _mistakes_of_hold(task, goal) if task.is_hold else _mistakes_of_cycle(task, goal)
    for name in study.sink.material:
        if name not in study.materials:
            yield "sink.material", f'"{name}"', f"one of {', '.join(study.materials)}, or a table [materials.{name}]"
    if study.sweep is not None:
        for place, axis in zip(("pareto", "pareto.also"), study.sweep.axes, strict=False):
            yield from _mistakes_of_axis(axis, study, place)
        if study.sweep.also is not None and study.sweep.also.against == study.sweep.against:
            yield "pareto.also.against", f'"{study.sweep.against}" again', "another quantity"
    for name in ("voltage", "speed"):
        if name in study.limits.given and not (task.is_hold or task.speeds):
            expected = 'speeds = […] in [task], with kind = "cycle": nobody knows how fast this cycle turns'
            yield f"limits.{name}", "a task without speeds", expected
    if study.asks_for_prices:
        yield from _mistakes_of_prices(study)
    yield from _mistakes_of_winding(study, goal)
    yield from _mistakes_of_heat(study)


def _mistakes_of_heat(study: TradeStudy) -> Iterator[Mistake]:
    """Of what a gear heats, and of what drives effects."""
    for number, gear in enumerate(study.gears):
        for motor in study.motors:
            if gear.heats not in (None, *motor.network.dynamic):
                expected = f"one of {', '.join(motor.network.dynamic)}, nodes of {motor.name}"
                yield f"gears[{number}].heats", f'"{gear.heats}"', expected
    for name in study.task.inputs:
        if name.partition(".")[0] in KNOWN:
            yield f'task.inputs."{name}"', "what the task says already", "a column of another quantity"


def _mistakes_of_prices(study: TradeStudy) -> Iterator[Mistake]:
    """What has no price must not pass for free."""
    for table, choices in (("motors", study.motors), ("gears", study.gears)):
        for choice in choices:
            if choice.price is None:
                yield table, f'"{choice.name}" without a price', f"price = … for each {table.removesuffix('s')}"
    for name in study.sink.material if study.question.cooling != ["none"] else ():
        if study.materials[name].price is None:
            expected = f"[materials.{name}] with price = …, by the kilogram"
            yield "sink.material", f'"{name}" without a price', expected


def _mistakes_of_winding(study: TradeStudy, goal: str) -> Iterator[Mistake]:
    hottest = max(study.task.start, study.task.ambient)
    for option in study.options():
        limit = option.limits.get("winding")
        if limit is None and goal != "worst_temperature":
            expected = f"winding = … in degC, for no data sheet gives {option.motor.name}'s"
            yield "limits", "no limit of the winding's temperature", expected
        if limit is not None and limit <= hottest:
            own = f"motors[{study.motors.index(option.motor)}]" if study.limits.winding is None else "limits.winding"
            yield own, f"{limit:g} degC", f"more than the {hottest:g} degC of the start and the air"


def _mistakes_of_hold(task: DutyTask, goal: str) -> Iterator[Mistake]:
    yield from _keys_of("cycle", ("profile", "period", "cycles", "speeds"), task)
    for name, value, sought in (("torque", task.torque, "held_torque"), ("duration", task.duration, "time_to_limit")):
        if value is None and goal != sought:
            yield "task", f"no {name}", f"{name} = … for the goal {goal}"
        if value is not None and goal == sought:
            yield f"task.{name}", f"{value:g}", f"no {name}, for the goal {goal} seeks it"


def _mistakes_of_cycle(task: DutyTask, goal: str) -> Iterator[Mistake]:
    yield from _keys_of("hold", ("torque", "duration", "speed"), task)
    if goal == "time_to_limit":
        yield "task.kind", '"cycle"', 'kind = "hold" for the goal time_to_limit'
    for name in ("profile", "period"):
        if name not in task.model_fields_set:
            yield "task", f"no {name}", f"{name} = … for a duty cycle"
    if task.speeds is not None and len(task.speeds) != len(task.torques):
        yield "task.speeds", f"{len(task.speeds)} speeds", f"{len(task.torques)}, one for each part of the profile"
    if not task.torques.any():
        yield "task.profile", "no torque at all", "one part of the cycle at least above 0 N*m"


def _keys_of(other: str, names: Sequence[str], task: DutyTask) -> Iterator[Mistake]:
    """Keys of the other kind of task."""
    for name in names:
        if name in task.model_fields_set:
            yield f"task.{name}", f"a key of a {other}", f'kind = "{other}" with it'


def _mistakes_of_axis(axis: Axis, study: TradeStudy, place: str) -> Iterator[Mistake]:
    against, goal = axis.against, study.question.goal
    if not axis.least < axis.most:
        unit = SWEPT[against].unit or study.question.currency
        yield f"{place}.least", f"{axis.least:g} to {axis.most:g} {unit}", "a least below the most"
    if against == "ratio" and not any(gear.name and not gear.is_sought for gear in study.gears):
        yield f"{place}.against", '"ratio"', "a [[gears]] with one ratio, which the sweep replaces"
    is_sought = {"torque": study.torque is None, "duration": study.task.time is None or not study.task.is_hold}
    if is_sought.get(against, against == goal):
        yield f"{place}.against", f'"{against}"', f"what a study of {goal} is given, not seeks"
