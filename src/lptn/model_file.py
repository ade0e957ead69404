"""`model.toml` in and out: comments kept, every mistake named with its line."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import tomlkit
from pydantic import ValidationError
from tomlkit.exceptions import ParseError, TOMLKitError

from lptn.effects import catalogue
from lptn.errors import InputError
from lptn.files import write_whole
from lptn.identify import Fit
from lptn.logs import ColumnSource, parse_columns
from lptn.model_schema import EffectTable, File, LinkTable, NodeTable, ParameterTable
from lptn.network import START, EffectDeclaration, LinkDeclaration, Network, NodeDeclaration
from lptn.parameters import Parameter
from lptn.places import is_glob
from lptn.toml_places import locate
from lptn.units import convert

_CAPACITY = Parameter("capacity", 300.0, "J/K", (1e-3, 1e6), typical=300.0, title="heat capacity")
_RESISTANCE = Parameter("resistance", 5.0, "K/W", (1e-4, 1e4), typical=5.0, title="thermal resistance")
_TEMPERATURE = Parameter(
    "temperature", 20.0, "degC", (-80.0, 200.0), typical=10.0, title="prescribed temperature", fixed=True
)
_SIGNIFICANT = 6  # digits of a fitted value: more would claim what no fit knows


@dataclass(frozen=True)
class ModelFile:
    """A model file as text, and what it says.

    Args:
        path: where it was read from, for messages.
        text: its text, comments and all.
        network: the network that it declares, fitted values in place.
        columns: where the log columns stand under other names.
        step: sampling step that logs are brought to [s], `None` for each log's own.
    """

    path: Path
    text: str
    network: Network
    columns: dict[str, ColumnSource]
    step: float | None

    def with_effects(self, effects: Iterable[EffectDeclaration]) -> ModelFile:
        """The file with more `[[effects]]` at its end, everything else as it stands."""
        document = tomlkit.parse(self.text)
        tables = document.get("effects")
        if not isinstance(tables, tomlkit.items.AoT):
            written = [] if tables is None else tables.unwrap()
            tables = tomlkit.aot()
            for entry in written:  # an inline array can't be continued by [[effects]]
                tables.append(tomlkit.item(entry))
            document.pop("effects", None)
            document["effects"] = tables
        for effect in effects:
            table = _effect_table(effect)
            table.trivia.indent = "\n"
            tables.append(table)
        return parse_model(tomlkit.dumps(document), self.path)

    def with_fit(self, fit: Fit) -> ModelFile:
        """The file with a `[fit]` table: values, standard errors, warnings and the data's fingerprints."""
        document = tomlkit.parse(self.text)
        document.pop("fit", None)
        table = tomlkit.table()
        table.add("rmse", _rounded(fit.rmse))
        table["rmse"].comment("K, over the readings that were fitted")
        table.add("status", fit.status)
        if fit.uncertainty.warnings:
            table.add("warnings", tomlkit.item(list(fit.uncertainty.warnings)).multiline(True))
        data = tomlkit.array()
        for source, digest in {driven.run.source: driven.run.fingerprint for driven in fit.problem.drives}.items():
            data.append({"file": Path(source).name, "sha256": digest})
        table.add("data", data.multiline(True))
        parameters = tomlkit.table()
        for index in fit.problem.free:
            unknown = fit.model.unknowns[index]
            lower, upper = unknown.declared.bounds
            entry: dict[str, float | str] = {"value": min(max(_rounded(unknown.value), lower), upper)}
            if math.isfinite(fit.errors[unknown.name]):
                entry["error"] = _rounded(fit.errors[unknown.name])
            parameters.add(unknown.name, _inline({**entry, "unit": unknown.declared.unit}))
        table.add("parameters", parameters)
        document.add("fit", table)
        return parse_model(tomlkit.dumps(document), self.path)

    def write(self, path: Path) -> None:
        """Write it whole or not at all."""
        write_whole(path, self.text)


def load_model(path: Path) -> ModelFile:
    """Read a model file.

    Raises:
        InputError: it can't be read, is not TOML, or says something that can't be a model; with its line.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "bytes that are not UTF-8 text"
        raise InputError(path, "file", reason or "no file", "a model file (`lptn new` writes one)") from error
    return parse_model(text, path)


def parse_model(text: str, path: Path) -> ModelFile:
    """Read a model from the text of its file; `path` serves for messages.

    Raises:
        InputError: with the line of the mistake.
    """
    try:
        content = tomlkit.parse(text).unwrap()
        tables = File.model_validate(content)
        columns = parse_columns(_flat(tables.columns), path, "columns")
        network = _Reader(path, tables).network()
    except ParseError as error:
        raise InputError(path, f"line {error.line}", _sentence(str(error)), "TOML") from error
    except TOMLKitError as error:
        raise InputError(path, "file", _sentence(str(error)), "TOML") from error
    except ValidationError as error:
        raise _validation_error(error, path, text) from error
    except InputError as error:
        raise _with_line(error, path, text) from error
    return ModelFile(path, text, network, columns, tables.model.step)


class _Reader:
    """Turns checked tables into the declarations of a network."""

    def __init__(self, path: Path, tables: File) -> None:
        self.path, self.tables = path, tables

    def network(self) -> Network:
        model = self.tables.model
        nodes = [self._node(name, table) for name, table in self.tables.nodes.items()]
        if model.ambient is not None and "ambient" not in self.tables.nodes:
            nodes.append(NodeDeclaration("ambient", temperature=self._temperature(model.ambient, "model.ambient")))
        if not any(node.capacity is not None for node in nodes):
            raise InputError(self.path, "nodes", "no node with a capacity", "a [nodes.NAME] table with capacity = …")
        fitted = {name: entry.value for name, entry in self.tables.fit.parameters.items()}
        named = tuple(name for name in self.tables.nodes if not is_glob(name))
        network = Network(
            model.name,
            tuple(nodes),
            tuple(self._link(number, link) for number, link in enumerate(self.tables.links)),
            tuple(self._effect(number, effect) for number, effect in enumerate(self.tables.effects)),
            tuple(dict.fromkeys((*model.joints, *named))),
            str(self.path),
            fitted,
        )
        known = {unknown.name for unknown in network.unknowns}
        for name in fitted:
            if name not in known:
                raise InputError(
                    self.path,
                    f'fit.parameters."{name}"',
                    "a fitted value that no part of the model uses",
                    "none, or [fit] removed: the model was changed after the fit",
                )
        return network

    def _node(self, name: str, table: NodeTable) -> NodeDeclaration:
        place = f'nodes."{name}"'
        if (table.capacity is None) == (table.temperature is None):
            found = "neither" if table.capacity is None else "both"
            raise InputError(self.path, place, f"{found} capacity and temperature", "one of the two")
        if table.capacity is not None:
            return NodeDeclaration(name, capacity=self._parameter(_CAPACITY, table.capacity, f"{place}.capacity"))
        return NodeDeclaration(name, temperature=self._temperature(table.temperature, f"{place}.temperature"))

    def _temperature(self, given: object, place: str) -> str | Parameter:
        if isinstance(given, str):
            if given == START or given.startswith("temperature."):
                return given
            raise InputError(self.path, place, f'"{given}"', 'a log column "temperature.<place>", "start", or a number')
        return self._parameter(_TEMPERATURE, given, place)

    def _link(self, number: int, link: LinkTable) -> LinkDeclaration:
        one, other = link.between
        resistance = self._parameter(_RESISTANCE, link.resistance, f"links[{number}].resistance")
        return LinkDeclaration((one, other), resistance)

    def _effect(self, number: int, table: EffectTable) -> EffectDeclaration:
        place = f"effects[{number}]"
        kind = catalogue().get(table.kind)
        if kind is None:
            near = get_close_matches(table.kind, catalogue(), n=1, cutoff=0.5)
            hint = f"{near[0]} (`lptn effects` lists them all)" if near else f"one of {', '.join(catalogue())}"
            raise InputError(self.path, f"{place}.kind", f'unknown effect "{table.kind}"', hint)
        given = dict(table.model_extra or {})
        words = {name: given.pop(name) for name in kind.options if name in given}
        declared = {parameter.name: parameter for parameter in kind.parameters}
        for name in given:
            if name not in declared:
                allowed = ", ".join(("kind", "at", "share", *kind.options, *declared))
                raise InputError(self.path, f"{place}.{name}", f'unknown key "{name}"', f"one of {allowed}")
        parameters = []
        for name, parameter in declared.items():
            shared = parameter if table.share is None else replace(parameter, share=table.share)
            parameters.append(self._parameter(shared, given.get(name), f"{place}.{name}"))
        try:
            effect = kind(**words)
        except (TypeError, ValueError) as error:
            name = next(iter(words))
            expected = " or ".join(f'"{word}"' for word in kind.options[name])
            raise InputError(self.path, f"{place}.{name}", f"{words[name]!r}", expected) from error
        return EffectDeclaration(effect, table.at, tuple(parameters))

    def _parameter(self, declared: Parameter, given: object, place: str) -> Parameter:
        """A declared parameter with what the file says of it, converted to its SI unit."""
        table = given if isinstance(given, ParameterTable) else self._table(given, place)
        unit = table.unit or declared.unit
        try:
            value = declared.value if table.value is None else convert(table.value, unit, declared.unit)
            bounds = declared.bounds
            if table.bounds is not None:
                bounds = (
                    convert(table.bounds[0], unit, declared.unit),
                    convert(table.bounds[1], unit, declared.unit),
                )
        except ValueError as error:
            raise InputError(self.path, f"{place}.unit", f'"{unit}"', f"a unit like {declared.unit}") from error
        if declared.bounds[0] >= 0:  # what can't be negative by nature is not made so by a file
            bounds = max(bounds[0], declared.bounds[0]), bounds[1]
        if bounds[0] > bounds[1]:
            found = f"a lower bound {bounds[0]:g} above the upper {bounds[1]:g}"
            raise InputError(self.path, f"{place}.bounds", found, "[least, greatest]")
        if not bounds[0] <= value <= bounds[1]:
            if table.value is None:  # only bounds were given: start inside them
                value = sum(bounds) / 2
            else:
                within = f"a value from {bounds[0]:g} to {bounds[1]:g} {declared.unit}"
                raise InputError(self.path, f"{place}.value", f"{value:g} {declared.unit}", within)
        return replace(
            declared,
            value=value,
            bounds=bounds,
            share=table.share or declared.share,
            fixed=declared.fixed if table.fixed is None else table.fixed,
        )

    def _table(self, given: object, place: str) -> ParameterTable:
        """A bare number, or an effect's table that pydantic has not looked at yet."""
        if given is None:
            return ParameterTable()
        if isinstance(given, int | float) and not isinstance(given, bool) and math.isfinite(given):
            return ParameterTable(value=float(given))
        try:
            return ParameterTable.model_validate(given)
        except ValidationError as error:
            first = error.errors()[0]
            inner = ".".join(str(part) for part in first["loc"])
            where = f"{place}.{inner}" if inner else place
            raise InputError(self.path, where, _shown(first["input"]), _expectation(first)) from error


def _effect_table(effect: EffectDeclaration) -> tomlkit.items.Table:
    table = tomlkit.table()
    table.add("kind", effect.effect.key)
    table.add("at", effect.at)
    for name, word in effect.effect.chosen.items():
        table.add(name, word)
    resolved = effect.resolved
    share = next(iter(resolved.values())).share
    if share != "each":
        table.add("share", share)
    for name, parameter in resolved.items():
        lower, upper = parameter.bounds
        entry: dict[str, object] = {"value": min(max(_rounded(parameter.value), lower), upper), "unit": parameter.unit}
        if parameter.bounds not in [own.bounds for own in effect.effect.parameters if own.name == name]:
            entry["bounds"] = [lower, upper]
        if parameter.fixed:
            entry["fixed"] = True
        table.add(name, _inline(entry))
    return table


def _inline(entries: Mapping[str, object]) -> tomlkit.items.InlineTable:
    table = tomlkit.inline_table()
    table.update(entries)
    return table


def _rounded(value: float) -> float:
    return float(f"{value:.{_SIGNIFICANT}g}")


def _flat(columns: Mapping[str, Any]) -> dict[str, object]:
    """`temperature.a = …` without quotes is a nested table in TOML; people write it all the same."""
    flat: dict[str, object] = {}
    for key, entry in columns.items():
        if isinstance(entry, Mapping) and not {"column", "norm"} & set(entry) and "." not in key:
            flat.update({f"{key}.{place}": inner for place, inner in entry.items()})
        else:
            flat[key] = entry
    return flat


def _validation_error(error: ValidationError, path: Path, text: str) -> InputError:
    first = error.errors()[0]
    if isinstance(first["input"], Mapping):  # a table was meant: what is wrong inside it says more
        first = max(error.errors(), key=lambda each: len(each["loc"]))
    # A union reports each alternative with its own name in the path; only the file's own keys are wanted.
    keys = [part for part in first["loc"] if isinstance(part, int) or not _is_alternative(part)]
    place = ""
    for key in keys:
        place += f"[{key}]" if isinstance(key, int) else f'."{key}"' if "." in key or is_glob(key) else f".{key}"
    place = place.lstrip(".") or "file"
    return _with_line(InputError(path, place, _shown(first["input"]), _expectation(first)), path, text)


def _is_alternative(part: str) -> bool:
    return part in {"str", "float", "ParameterTable"} or part.startswith("constrained")


def _expectation(error: Any) -> str:
    kind, message = error["type"], str(error["msg"])
    if kind == "extra_forbidden":
        return f'no key "{error["loc"][-1]}" here'
    if kind == "missing":
        return f'a key "{error["loc"][-1]}"'
    return _sentence(message.removeprefix("Input should be ").removeprefix("Value error, "))


def _shown(found: object) -> str:
    text = repr(found)
    return text if len(text) <= 60 else text[:57] + "…"


def _sentence(message: str) -> str:
    return message[:1].lower() + message[1:]


def _with_line(error: InputError, path: Path, text: str) -> InputError:
    if error.file != str(path) or error.place.startswith("line "):
        return error
    line = locate(text, error.place)
    return error if line is None else InputError(path, f"line {line}, {error.place}", error.found, error.expected)
