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
from .variables import unit_definitions

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
    units = {
        unit.name: _base(unit.exponents, unit.factor)
        for unit in unit_definitions(parameter.unit for parameter in parameters)
        if unit.exponents is not None
    }
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
            return _number(child.get("factor", "1"), path, place), _number(child.get("offset", "0"), path, place)
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
        unit = unit_of(variable) or ""
        try:
            converted[name] = convert(value.value, value.unit, unit) if value.unit and unit else value.value
        except ValueError as error:
            raise InputError(Path(source), name, str(error), f"a value in {unit}") from error
    return converted


# --- systems of FMUs ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Connection:
    """An output of one component to an input of another: `factor` times it plus `offset`.

    An empty component is the system itself: its inputs are driven from outside, its outputs seen there.
    """

    start: tuple[str, str]
    end: tuple[str, str]
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class SystemStructure:
    """A system of FMUs.

    Args:
        name: of the system.
        components: FMU files by the component's name.
        connections: what is connected.
        values: start values by component and variable.
    """

    name: str
    components: Mapping[str, Path]
    connections: Sequence[Connection]
    values: Mapping[str, Mapping[str, Value]] = field(default_factory=dict)


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
        _check_connections(pairs, opened, target)
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
    return SystemStructure(name, files, pairs)


def _end(text: str, opened: Iterable[str], path: Path) -> tuple[str, str]:
    for component in opened:
        if text.startswith(f"{component}."):
            return component, text[len(component) + 1 :]
    raise InputError(path, "connection", f'"{text}"', f"component.variable, with one of {', '.join(opened)}")


def _check_connections(pairs: Iterable[Connection], opened: Mapping[str, Unpacked], path: Path) -> None:
    """Refuse what can't be connected: each end there and of its kind, the same unit, an input once."""
    driven: set[tuple[str, str]] = set()
    for pair in pairs:
        units = []
        for (component, name), causalities in ((pair.start, ("output",)), (pair.end, ("input",))):
            if not component:
                continue
            variable = opened[component].variables.get(name)
            if variable is None or variable.causality not in causalities:
                raise InputError(path, "connection", f"{component}.{name}", f"an {causalities[0]} of {component}")
            units.append(unit_of(variable))
        if len(set(units)) == 2 and None not in units and (pair.factor, pair.offset) == (1.0, 0.0):
            both = f"{'.'.join(pair.start)} in {units[0]} to {'.'.join(pair.end)} in {units[1]}"
            raise InputError(path, "connection", both, "the same unit, or a transformation")
        if pair.end in driven:
            raise InputError(path, "connection", f"{'.'.join(pair.end)} twice", "one connection to an input")
        driven.add(pair.end)


def _system_text(
    name: str, sources: Mapping[str, str], opened: Mapping[str, Unpacked], pairs: Sequence[Connection]
) -> str:
    connectors: dict[str, list[tuple[Any, str | None]]] = {}
    units: dict[str, dict[str, str]] = {}
    for component, unpacked in opened.items():
        shown = [variable for variable in unpacked.variables.values() if variable.causality in ("input", "output")]
        definitions = _units_of(unpacked)
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
        InputError: it can't be read, or holds what is not supported here: systems within systems, signal dictionaries;
            or as it was raised within.
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
    components, values = _components(system, file, shown)
    for name, value in _bound(system, file, shown).items():
        component, variable = _end(name, components, shown)
        values[component].setdefault(variable, value)
    connections = []
    for entry in system.iterfind("ssd:Connections/ssd:Connection", _NAMESPACES):
        start = (entry.get("startElement") or "", entry.get("startConnector") or "")
        end = (entry.get("endElement") or "", entry.get("endConnector") or "")
        for component, _ in (start, end):
            if component and component not in components:
                raise InputError(shown, "Connections", f'"{component}"', f"one of {', '.join(components)}")
        factor, offset = _transformation(entry, shown, ".".join(end))
        if not (start[0] and end[0]) and (factor, offset) != (1.0, 0.0):
            outside = "a transformation of the system's own connector"
            raise InputError(shown, "Connections", outside, "transformations between components alone")
        connections.append(Connection(start, end, factor, offset))
    return SystemStructure(system.get("name") or root.get("name") or "system", components, connections, values)


def _components(system: Any, file: Path, shown: Path) -> tuple[dict[str, Path], dict[str, dict[str, Value]]]:
    """The files of a system's components, and the values that their parameters are bound to, by name."""
    components: dict[str, Path] = {}
    values: dict[str, dict[str, Value]] = {}
    for element in system.iterfind("ssd:Elements/*", _NAMESPACES):
        kind, name = element.tag.rpartition("}")[2], element.get("name") or ""
        if kind != "Component":
            raise InputError(shown, f"Elements/{name}", kind, "components alone: no systems within systems")
        if name in components:
            raise InputError(shown, f"Elements/{name}", "a name twice", "components with names of their own")
        components[name] = _file(element.get("source") or "", file, shown)
        values[name] = _bound(element, file, shown)
    if not components:
        raise InputError(shown, "Elements", "no component", "one FMU or more")
    _COMPONENTS.check(len(components), shown, "Elements")
    ARCHIVE.check(sum(map(unpacked_size, components.values())), shown, "Elements, unpacked")
    return components, values


def _bound(element: Any, file: Path, shown: Path) -> dict[str, Value]:
    """The values that an element's parameter bindings give; the last one wins."""
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
        parameters |= {prefix + name: value for name, value in values.items()}
    return parameters


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


def _units_of(unpacked: Unpacked) -> dict[str, dict[str, str]]:
    """The base units of an FMU's own units, as SSP gives them, by unit."""
    names = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
    units = {}
    for unit in unpacked.description.unitDefinitions:
        base = unit.baseUnit
        if base is not None:
            exponents = {name: int(getattr(base, name) or 0) for name in names}
            units[unit.name] = _base(exponents, float(base.factor or 1), float(base.offset or 0))
    return units


def _base(exponents: Mapping[str, int] | None, factor: float = 1.0, offset: float = 0.0) -> dict[str, str]:
    bases = {base: str(power) for base, power in (exponents or {}).items() if power}
    numbers = {"factor": (factor, 1.0), "offset": (offset, 0.0)}
    return bases | {name: repr(value) for name, (value, usual) in numbers.items() if value != usual}


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
