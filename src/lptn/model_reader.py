"""The checked tables of a model file turned into the declarations of a network."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from lptn.effects import catalogue
from lptn.element_reader import ElementReader
from lptn.errors import InputError, shown
from lptn.model_mistakes import expectation, found_in
from lptn.model_schema import EffectTable, ElementTable, File, LinkTable, NodeTable, ParameterTable
from lptn.network import START, EffectDeclaration, LinkDeclaration, Network, NodeDeclaration
from lptn.parameters import Parameter
from lptn.places import is_glob
from lptn.units import convert

_CAPACITY = Parameter("capacity", 300.0, "J/K", (1e-3, 1e6), typical=300.0, title="heat capacity")
_RESISTANCE = Parameter("resistance", 5.0, "K/W", (1e-4, 1e4), typical=5.0, title="thermal resistance")
_TEMPERATURE = Parameter(
    "temperature", 20.0, "degC", (-80.0, 200.0), typical=10.0, title="prescribed temperature", fixed=True
)
_MOST_WILD = 4  # in one name: trying all ways to share out its letters takes a power of that


class Reader:
    """Turns checked tables into a network.

    Args:
        path: the model file, for messages.
        tables: what it says.
    """

    def __init__(self, path: Path, tables: File) -> None:
        self.path, self.tables = path, tables

    def network(self) -> Network:
        """The network that the tables declare.

        Raises:
            InputError: with the path of the key that is wrong.
        """
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
        if table.element is not None:
            return self._body(name, table, table.element, place)
        if (table.capacity is None) == (table.temperature is None):
            found = "neither capacity nor" if table.capacity is None else "both capacity and"
            raise InputError(self.path, place, f"{found} temperature", "one of the two")
        if table.capacity is not None:
            return NodeDeclaration(name, capacity=self._parameter(_CAPACITY, table.capacity, f"{place}.capacity"))
        return NodeDeclaration(name, temperature=self._temperature(table.temperature, f"{place}.temperature"))

    def _body(self, name: str, table: NodeTable, given: ElementTable, place: str) -> NodeDeclaration:
        """A node with an element: its capacity follows from the material, or is given."""
        if table.temperature is not None:
            raise InputError(self.path, place, "both element and temperature", "one of the two")
        reader = ElementReader(self.path, given, f"{place}.element", self._parameter)
        element = reader.element()
        computed = reader.capacity(element.shape)
        if (computed is None) == (table.capacity is None):
            found = "neither capacity nor" if computed is None else "both capacity and"
            expected = "either capacity, or density and specific_heat in the element"
            raise InputError(self.path, f"{place}.element", f"{found} density", expected)
        capacity = computed or self._parameter(_CAPACITY, table.capacity, f"{place}.capacity")
        return NodeDeclaration(name, capacity=capacity, element=element)

    def _temperature(self, given: object, place: str) -> str | Parameter:
        if isinstance(given, str):
            if given == START or given.startswith("temperature."):
                return given
            raise InputError(self.path, place, f'"{given}"', 'a log column "temperature.<place>", "start", or a number')
        return self._parameter(_TEMPERATURE, given, place)

    def _link(self, number: int, link: LinkTable) -> LinkDeclaration:
        one, other = link.between
        for end in link.between:
            wild = end.count("{") + end.count("*")
            if "{" in end and wild > _MOST_WILD:
                expected = f"at most {_MOST_WILD}, such as {{leg}}_*"
                raise InputError(self.path, f"links[{number}].between", f"{wild} of {{…}} and * in one name", expected)
        if link.perfect:
            if link.resistance is not None:
                raise InputError(self.path, f"links[{number}]", "both perfect and resistance", "one of the two")
            return LinkDeclaration((one, other), None)
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
                allowed = ", ".join(("kind", "at", "run", "share", "driven_by", *kind.options, *declared))
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
            raise InputError(self.path, f"{place}.{name}", shown(words[name]), expected) from error
        driven_by, run = table.driven_by or "", table.run or ""
        return EffectDeclaration(effect, table.at, tuple(parameters), driven_by=driven_by, run=run)

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
            raise InputError(self.path, where, found_in(first), expectation(first)) from error


def flat_columns(columns: Mapping[str, Any]) -> dict[str, object]:
    """`temperature.a = …` without quotes is a nested table in TOML; people write it all the same."""
    flat: dict[str, object] = {}
    for key, entry in columns.items():
        if isinstance(entry, Mapping) and not {"column", "norm"} & set(entry) and "." not in key:
            flat.update({f"{key}.{place}": inner for place, inner in entry.items()})
        else:
            flat[key] = entry
    return flat
