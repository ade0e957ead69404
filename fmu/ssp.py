"""System Structure and Parameterization (SSP 1.0): parameter values, mappings, systems of FMUs, written and read."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import quote, unquote
from xml.etree import ElementTree

from lptn.basics.bounds import DESCRIPTION, Bound
from lptn.basics.errors import InputError
from lptn.basics.files import bytes_of, real_path, write_whole
from lptn.basics.units import convert
from lptn.model.file import ModelFile
from lptn.model.model import Model
from lptn.model.network import Network

from .archive import ARCHIVE, Unpacked, unit_of, unpack_files, unpacked_size
from .component import Component
from .exporter import archived, model_and_text, rendered
from .variables import BASES, UnitDefinition, unit_definitions

_NAMESPACES = {
    part: f"http://ssp-standard.org/SSP1/SystemStructure{name}"
    for part, name in {
        "ssc": "Common",
        "ssd": "Description",
        "ssv": "ParameterValues",
        "ssm": "ParameterMapping",
    }.items()
}
_ROOT = "SystemStructure.ssd"  # of an SSP archive
_COMPONENTS = Bound(100, "FMUs")
"""Of a system: each is unpacked and loaded, and a process holds some hundred libraries."""
_NUMBERS = ("Real", "Integer")
_SCALES = {"factor": 1.0, "offset": 0.0}  # of a unit and of a transformation, where they are not given
_INWARD, _OUTWARD = ("input", "parameter", "inout"), ("output", "calculatedParameter", "inout")
"""Kinds of a system's connectors by which numbers come in and go out."""
_EXPECTED = "a file of SSP 1.0"


# --- parameter values -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Value:
    """A parameter's value.

    Args:
        value: the number.
        unit: its unit, empty for that of the variable.
    """

    value: float
    unit: str = ""

    def to(self, unit: str | None, source: str | Path, name: str) -> float:
        """The number in a unit, as it is where one of the two units is not known.

        Raises:
            InputError: a unit of something else, said of `name` in `source`.
        """
        try:
            return convert(self.value, self.unit, unit) if self.unit and unit else self.value
        except ValueError as error:
            raise InputError(Path(source), name, str(error), f"a value in {unit}") from error


def write_values(
    model: Model | Network | ModelFile | str | Path,
    path: str | Path,
    limits: Mapping[str, float] | float | None = None,
) -> int:
    """Write all parameters of a model as an SSV file: what an FMU of the same network takes over at once.

    Args:
        model: a model, a network, or a model file or its path.
        path: the file, its name ends in `.ssv`.
        limits: temperature limits [degC] as for `export`.

    Returns:
        How many there are.

    Raises:
        InputError: a model that can't be read, a limit of no node, or another file ending.
    """
    if Path(path).suffix != ".ssv":
        raise InputError(Path(path), "--output", f"a file name ending in '{Path(path).suffix}'", "one ending in .ssv")
    loaded, _ = model_and_text(model)
    parameters = Component(loaded, limits).of("parameter")
    # SSP can't define a unit whose exponents are parameters: it has no dimension.
    used = unit_definitions(parameter.unit for parameter in parameters)
    units = {unit.name: unit for unit in used if unit.exponents is not None}
    values = {"name": loaded.network.name, "parameters": parameters, "units": units, "namespaces": _NAMESPACES}
    write_whole(Path(path), rendered("values.ssv.xml.j2", values))
    return len(parameters)


def read_values(path: str | Path) -> dict[str, Value]:
    """The numbers of an SSV file by name.

    Args:
        path: the file.

    Returns:
        Number and unit by the parameter's name.

    Raises:
        InputError: it can't be read, or holds no numbers.
    """
    root = _read(Path(path), "ssv:ParameterSet")
    return _values(root, Path(path))


def _values(root: Any, path: Path) -> dict[str, Value]:
    values: dict[str, Value] = {}
    for entry in root.iterfind("ssv:Parameters/ssv:Parameter", _NAMESPACES):
        name = entry.get("name") or ""
        for kind in _NUMBERS:
            number = entry.find(f"ssv:{kind}", _NAMESPACES)
            if number is not None:
                values[name] = Value(_number(number.get("value"), path, name), number.get("unit") or "")
    if not values:
        raise InputError(path, "Parameters", "no numbers", "ssv:Real elements with a value")
    return values


def _mapped(values: Mapping[str, Value], root: Any, path: Path) -> dict[str, Value]:
    """Values by the names that a mapping gives them; those that it does not name are left out, as SSP wants it."""
    result = {}
    for entry in root.iterfind("ssm:MappingEntry", _NAMESPACES):
        target = entry.get("target") or ""
        factor, offset = _transformation(entry, path, target)
        if value := values.get(entry.get("source") or ""):
            result[target] = Value(factor * value.value + offset, value.unit)
    return result


def _transformation(entry: Any, path: Path, place: str) -> tuple[float, float]:
    """Factor and offset of a mapping's entry or of a connection."""
    for child in entry:
        kind = child.tag.rpartition("}")[2]
        if kind == "LinearTransformation":
            factor, offset = (_number(child.get(part, str(usual)), path, place) for part, usual in _SCALES.items())
            if factor == 0:
                raise InputError(path, place, "a factor of 0", "a LinearTransformation that can be turned round")
            return factor, offset
        if kind.endswith("Transformation"):
            raise InputError(path, place, kind, "a LinearTransformation, or none")
    return 1.0, 0.0


def in_units_of(values: Mapping[str, Value], unpacked: Unpacked, source: str | Path) -> dict[str, float]:
    """Values as an FMU takes them.

    Args:
        values: by the names of the FMU's variables.
        unpacked: the FMU.
        source: where they come from, for messages.

    Raises:
        InputError: a name that the FMU has no parameter, state or input for, or a unit of something else.
    """
    converted = {}
    for name, value in values.items():
        variable = unpacked.variables.get(name)
        if variable is None or variable.start is None:
            raise InputError(Path(source), name, "no such parameter", f"a parameter of {unpacked.path.name}")
        converted[name] = value.to(unit_of(variable), source, name)
    return converted


# --- systems of FMUs ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Connection:
    """An output of one component to an input of another: `factor` times it plus `offset`.

    In place of a component may stand a system within, and an empty text for the system itself: its connectors are
    driven from outside or seen there.

    Args:
        start: component and variable, or system and connector.
        end: likewise.
        factor: of the transformation, which follows on the conversion of units.
        offset: likewise.
        converts: whether units are converted.
    """

    start: tuple[str, str]
    end: tuple[str, str]
    factor: float = 1.0
    offset: float = 0.0
    converts: bool = True


def dotted(element: str, name: str) -> str:
    """What a variable or an element is called outside; the name alone where the element is the system itself."""
    return f"{element}.{name}" if element else name


@dataclass(frozen=True)
class SystemStructure:
    """A system of FMUs.

    A component of a system within is called `system.component`.

    Args:
        name: of the system.
        components: FMU files by the component's name.
        connections: what is connected.
        values: start values by component and variable, or by system and connector.
        connectors: of the systems, by system and name, with their units where these are defined.
    """

    name: str
    components: Mapping[str, Path]
    connections: Sequence[Connection]
    values: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)
    connectors: Mapping[tuple[str, str], UnitDefinition | None] = field(default_factory=dict)


End = tuple[str, str]
"""Component and variable, or system and connector."""


class Wiring:
    """The connections of a system, each followed back through all systems to where it begins.

    Args:
        structure: the system.
        opened: the FMUs, by component.
        path: of the system's file, for messages.

    Raises:
        InputError: an end that is not there or of another kind, that is driven twice or in a circle, or a unit of
            something else.
    """

    def __init__(self, structure: SystemStructure, opened: Mapping[str, Unpacked], path: Path) -> None:
        self._structure, self._opened, self._path = structure, opened, path
        self._into: dict[End, Connection] = {}
        for connection in structure.connections:
            if connection.end in self._into:
                raise self._refusal(f"{dotted(*connection.end)} twice", "one connection to an input")
            self._check(connection.start, "output")
            self._into[connection.end] = connection
        self.origins = {end: self._origin(end) for end in self._into}
        """By end: where it begins, and factor and offset on the way."""

    def unit(self, end: End) -> UnitDefinition | None:
        """The unit of a variable or of a connector, where it is defined."""
        if end[0] not in self._opened:
            return self._structure.connectors.get(end)
        return self._opened[end[0]].unit(end[1])

    def _origin(self, end: End) -> tuple[End, float, float]:
        path, begin = [], end
        while (connection := self._into.get(begin)) is not None:
            path.append(connection)
            begin = connection.start
            if len(path) > len(self._into):
                raise self._refusal(dotted(*begin), "a beginning, not a circle")
        inner = begin[0] in self._opened
        self._check(end, *(("input",) if inner else ("input", "parameter")))
        factor, offset, unit = 1.0, 0.0, self.unit(begin)
        for connection in reversed(path):
            own, target = (connection.factor, connection.offset), self.unit(connection.end)
            if unit is not None and target is not None and connection.converts:
                try:
                    scale, shift = unit.conversion(target)
                    factor, offset = scale * factor, scale * offset + shift
                except ValueError as error:
                    if own == (1.0, 0.0):
                        raise self._refusal(str(error), "the same unit, or a transformation") from error
            factor, offset = own[0] * factor, own[0] * offset + own[1]
            unit = target or unit
        return begin, factor, offset

    def _check(self, end: End, *causalities: str) -> None:
        component, name = end
        if component in self._opened:
            variable = self._opened[component].variables.get(name)
            if variable is None or variable.causality not in causalities:
                raise self._refusal(dotted(*end), f"an {causalities[0]} of {component}")

    def _refusal(self, found: str, expected: str) -> InputError:
        return InputError(self._path, "connection", found, expected)


def write_system(
    path: str | Path, fmus: Mapping[str, str | Path], connections: Sequence[tuple[str, str]], name: str = "system"
) -> SystemStructure:
    """Write a system of FMUs as an SSD file, or as an SSP archive that holds the FMUs too.

    Args:
        path: the file; it ends in `.ssd` or `.ssp`.
        fmus: FMU files by the name of the component.
        connections: pairs of an output and an input, each `component.variable`.
        name: of the system.

    Raises:
        InputError: an FMU that can't be read, a connection to something that is not there, of different units, or of an
            input twice.
    """
    target = Path(path)
    if target.suffix not in (".ssd", ".ssp"):
        raise InputError(target, "--output", f"a file name ending in '{target.suffix}'", "one ending in .ssd or .ssp")
    files = {component: Path(file) for component, file in fmus.items()}
    with ExitStack() as stack:  # read, not run
        opened = {part: stack.enter_context(closing(Unpacked(file, trust=True))) for part, file in files.items()}
        for component, unpacked in opened.items():
            if any(variable.shape for variable in unpacked.description.modelVariables):
                raise InputError(target, component, "an FMU with arrays, which SSP 1.0 has none of", "one of scalars")
        pairs = [Connection(_end(start, opened, target), _end(end, opened, target)) for start, end in connections]
        structure = SystemStructure(name, files, pairs)
        Wiring(structure, opened, target)
        inside, beside = target.suffix == ".ssp", real_path(target).parent
        sources = {component: f"resources/{component}.fmu" for component in files}
        if not inside:  # addresses as seen from the file
            seen = {component: Path(os.path.relpath(real_path(file), beside)) for component, file in files.items()}
            sources |= {component: quote(file.as_posix()) for component, file in seen.items()}
        text = _system_text(name, sources, opened, pairs)
    content: str | bytes = text
    if inside:
        content = archived({_ROOT: text.encode(), **{sources[part]: file.read_bytes() for part, file in files.items()}})
    write_whole(target, content)
    return structure


def _end(text: str, elements: Iterable[str], path: Path) -> tuple[str, str]:
    """An element and a name of its own of `element.name`."""
    owners = [element for element in elements if text.startswith(f"{element}.")]
    if not owners:
        raise InputError(path, "connection", f'"{text}"', f"component.variable, with one of {', '.join(elements)}")
    owner = max(owners, key=len)  # a name may have dots, too
    return owner, text[len(owner) + 1 :]


def _system_text(
    name: str, sources: Mapping[str, str], opened: Mapping[str, Unpacked], pairs: Sequence[Connection]
) -> str:
    connectors: dict[str, list[tuple[Any, str | None]]] = {}
    units: dict[str, UnitDefinition] = {}
    for component, unpacked in opened.items():
        shown = [variable for variable in unpacked.variables.values() if variable.causality in ("input", "output")]
        definitions = unpacked.units
        own = [unit if (unit := unit_of(variable)) in definitions else None for variable in shown]
        connectors[component] = list(zip(shown, own, strict=True))
        units |= {unit: definitions[unit] for unit in own if unit}
    values = {"name": name, "sources": sources, "connectors": connectors, "connections": pairs, "units": units}
    return rendered("system.ssd.xml.j2", values | {"namespaces": _NAMESPACES})


@contextmanager
def opened_system(path: str | Path) -> Iterator[SystemStructure]:
    """A system read from its file; within the block the FMUs of an SSP archive lie unpacked.

    What is wrong there with a file that was unpacked is said of the archive, and of the file's place in it.

    Args:
        path: an `.ssd` or `.ssp` file.

    Raises:
        InputError: it can't be read, or holds signal dictionaries, which are not supported; or as it was raised within.
    """
    file = archive = Path(path)
    with tempfile.TemporaryDirectory(prefix="lptn-ssp-", ignore_cleanup_errors=True) as folder:
        try:
            if archive.suffix == ".ssp":
                unpack_files(bytes_of(archive, ARCHIVE, _EXPECTED), archive, Path(folder))
                file = Path(folder) / _ROOT
            yield _structure(_read(file, "ssd:SystemStructureDescription"), file, archive)
        except InputError as error:
            if not error.file.startswith(folder):
                raise
            inside = error.file.removeprefix(folder).lstrip("/\\")
            raise InputError(archive, f"{inside}, {error.place}", error.found, error.expected) from error


def _structure(root: Any, file: Path, shown: Path) -> SystemStructure:
    system = root.find("ssd:System", _NAMESPACES)
    if system is None:
        raise InputError(shown, "System", "none", "an SSD file with a System")
    units = _units(root, shown)
    systems: dict[str, Any] = {"": system}
    components: dict[str, Path] = {}
    connectors: dict[End, UnitDefinition | None] = {}
    kinds: dict[str, dict[str, str]] = {}  # of the connectors, by system
    elements: dict[str, set[str]] = {}
    bound: list[tuple[str, str, Value]] = []
    waiting = [""]
    while waiting:  # from outside in, whatever the depth
        within = waiting.pop(0)
        bound += _bound(systems[within], within, file, shown)
        kinds[within] = {}
        for connector in systems[within].iterfind("ssd:Connectors/ssd:Connector", _NAMESPACES):
            real, name = connector.find("ssc:Real", _NAMESPACES), connector.get("name") or ""
            connectors[within, name] = None if real is None else units.get(real.get("unit", ""))
            kinds[within][name] = connector.get("kind") or ""
        elements[within] = own = {within}
        for element in systems[within].iterfind("ssd:Elements/*", _NAMESPACES):
            kind, name = element.tag.rpartition("}")[2], dotted(within, element.get("name") or "")
            if name in components or name in systems:
                raise InputError(shown, f"Elements/{name}", "a name twice", "elements with names of their own")
            if kind == "System":
                systems[name] = element
                waiting.append(name)
            elif kind == "Component":
                components[name] = _file(element.get("source") or "", file, shown)
                bound += _bound(element, name, file, shown)
            else:
                raise InputError(shown, f"Elements/{name}", kind, "components and systems")
            own.add(name)
    _check_components(components, shown)
    connections = [
        connection
        for within, own in elements.items()
        for connection in _connections(systems[within], within, own, kinds, shown)
    ]
    _check_driven(connections, kinds, shown)
    values = _by_element(bound, [*components, *systems], kinds, shown)
    name = system.get("name") or root.get("name") or "system"
    return SystemStructure(name, components, connections, values, connectors)


def _by_element(
    bound: Sequence[tuple[str, str, Value]],
    elements: Sequence[str],
    kinds: Mapping[str, Mapping[str, str]],
    shown: Path,
) -> dict[str, dict[str, Value]]:
    """Bound values by the component or system whose they are; outermost first in `bound`, and first in rank."""
    values: dict[str, dict[str, Value]] = {element: {} for element in elements}
    for within, parameter, value in reversed(bound):  # what a system says comes before what is said within it
        end = (within, parameter)
        if within in kinds and parameter not in kinds[within]:
            end = _end(dotted(*end), [*filter(None, values)], shown)
            if end[0] in kinds and end[1] not in kinds[end[0]]:
                raise InputError(
                    shown,
                    "ParameterBinding",
                    f'"{dotted(*end)}"',
                    f"a connector of {end[0]}, or a parameter of a component",
                )
        values[end[0]][end[1]] = value
    return values


def _check_components(components: Mapping[str, Path], shown: Path) -> None:
    if not components:
        raise InputError(shown, "Elements", "no component", "one FMU or more")
    _COMPONENTS.check(len(components), shown, "Elements")
    ARCHIVE.check(sum(map(unpacked_size, components.values())), shown, "Elements, unpacked")


def _check_driven(connections: Sequence[Connection], kinds: Mapping[str, Mapping[str, str]], shown: Path) -> None:
    """Refuse an output of a system that nothing within drives: it would count as an input."""
    driven = {connection.end for connection in connections}
    for system, name in (connection.start for connection in connections if connection.start not in driven):
        if system in kinds and kinds[system][name] not in _INWARD:
            found = f"{dotted(system, name)}, which nothing drives"
            raise InputError(shown, "Connections", found, "a connection to it")


def _connections(
    system: Any, within: str, elements: set[str], kinds: Mapping[str, Mapping[str, str]], shown: Path
) -> Iterator[Connection]:
    """The connections of a system among its elements and its own connectors; `kinds` are those of all systems."""
    for entry in system.iterfind("ssd:Connections/ssd:Connection", _NAMESPACES):
        ends: list[tuple[str, str]] = []
        for side in ("start", "end"):
            element = entry.get(f"{side}Element")
            name = dotted(within, element) if element else within
            if name not in elements:
                known = ", ".join(sorted(elements - {within}))
                raise InputError(shown, "Connections", f'"{name}"', f"one of {known}")
            connector = entry.get(f"{side}Connector") or ""
            leads = _INWARD if (name == within) == (side == "start") else _OUTWARD
            if name in kinds and kinds[name].get(connector) not in leads:
                found = f'the {side} "{dotted(name, connector)}"'
                raise InputError(shown, "Connections", found, f"a declared connector of kind {', '.join(leads)}")
            ends.append((name, connector))
        converts = entry.get("suppressUnitConversion") not in ("true", "1")
        factor, offset = _transformation(entry, shown, dotted(*ends[1]))
        yield Connection(ends[0], ends[1], factor, offset, converts)


def _units(root: Any, path: Path) -> dict[str, UnitDefinition]:
    """The units that a system's file defines."""
    units = {}
    for entry in root.iterfind("ssd:Units/ssc:Unit", _NAMESPACES):
        name, base = entry.get("name") or "", entry.find("ssc:BaseUnit", _NAMESPACES)
        if base is not None:
            numbers = {part: _number(text, path, name) for part, text in base.items()}
            factor, offset = (numbers.get(part, usual) for part, usual in _SCALES.items())
            powers = {part: round(numbers[part]) for part in BASES if part in numbers}
            if factor == 0:
                raise InputError(path, f"Units/{name}", "a factor of 0", "a unit that can be turned into others")
            units[name] = UnitDefinition(name, powers, factor, offset)
    return units


def _bound(element: Any, name: str, file: Path, shown: Path) -> Iterator[tuple[str, str, Value]]:
    """Element, parameter and value of what an element's parameter bindings give; the last one wins."""
    parameters: dict[str, Value] = {}
    for binding in element.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", _NAMESPACES):
        source, inside = binding.get("source"), binding.find("ssd:ParameterValues/ssv:ParameterSet", _NAMESPACES)
        if binding.get("sourceBase", "SSD") != "SSD":
            raise InputError(shown, "ParameterBinding", 'sourceBase="component"', "files beside the system's")
        values = _values(inside, shown) if source is None else read_values(_file(source, file, shown))
        mapping = binding.find("ssd:ParameterMapping", _NAMESPACES)
        if mapping is not None:
            inner, own, source = mapping.find("ssm:ParameterMapping", _NAMESPACES), shown, mapping.get("source")
            if source is not None:
                own = _file(source, file, shown)
                inner = _read(own, "ssm:ParameterMapping")
            values = _mapped(values, inner, own)
        prefix = binding.get("prefix", "")
        parameters |= {prefix + parameter: value for parameter, value in values.items()}
    return ((name, parameter, value) for parameter, value in parameters.items())


def _file(source: str, file: Path, shown: Path) -> Path:
    """A file that another one names, relative to it; inside the archive where there is one, `shown` then."""
    name = unquote(source)
    if not name or "://" in name or "\0" in name or PurePosixPath(name).is_absolute():
        raise InputError(shown, "source", f'"{source}"', "a path relative to the file")
    path = file.parent / name
    if file != shown and not real_path(path).is_relative_to(real_path(file.parent)):
        raise InputError(shown, "source", f'"{source}", which leads out of the archive', "a file inside it")
    return path


# --- XML ------------------------------------------------------------------------------------------


def _read(path: Path, tag: str) -> Any:
    text = bytes_of(path, DESCRIPTION, _EXPECTED)
    part, _, name = tag.partition(":")
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text or b"\0" in text:
        raise InputError(path, "file", "a document type or entities", "plain XML in UTF-8")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(path, "file", str(error), f"XML with {name} (SSP 1.0)") from error
    if root.tag != f"{{{_NAMESPACES[part]}}}{name}":
        raise InputError(path, "file", root.tag, f"XML with {name} (SSP 1.0)")
    return root


def _number(text: str | None, path: Path, place: str) -> float:
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(path, place, f"'{text}'", "a number")
    return value
