"""What the tables of a model file may say, and the network that they declare."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from lptn.basics.errors import InputError, shown
from lptn.basics.parameters import LARGEST, Parameter, Share
from lptn.basics.places import is_glob
from lptn.basics.toml import Number, Strict, expectation, first_mistake, found_in, place_of
from lptn.basics.units import convert
from lptn.effects import effect_named
from lptn.logs.columns import START
from lptn.model.bodies import HOTTEST, KINDS, Element, Shape
from lptn.model.network import ROUNDING, EffectDeclaration, Key, LinkDeclaration, Network, NodeDeclaration

# --- What may stand in a model file: its tables and keys, checked by pydantic -----------------------


class ParameterTable(Strict):
    value: Number | dict[str, Number] | None = None  # a table gives each place, or group of places, its own
    unit: str | None = None
    bounds: Annotated[list[Number], Field(min_length=2, max_length=2)] | None = None
    prior: Annotated[list[Number], Field(min_length=2, max_length=2)] | None = None  # mean, standard deviation
    share: Share | None = None
    fixed: bool | None = None


NumberOrTable = Number | ParameterTable


class ModelTable(Strict):
    name: str = "model"
    joints: list[str] = Field(default_factory=list)
    ambient: str | NumberOrTable | None = None
    step: Annotated[Number, Field(gt=0)] | None = None


class ElementTable(BaseModel):
    model_config = ConfigDict(extra="allow")
    kind: str


class NodeTable(Strict):
    capacity: NumberOrTable | None = None
    temperature: str | NumberOrTable | None = None
    element: ElementTable | None = None


class LinkTable(Strict):
    between: Annotated[list[str], Field(min_length=2, max_length=2)]
    resistance: NumberOrTable | None = None
    perfect: bool = False


class EffectTable(BaseModel):
    model_config = ConfigDict(extra="allow")
    kind: str
    at: str
    share: Share | None = None
    run: Annotated[str, Field(min_length=1)] | None = None
    driven_by: Annotated[str, Field(pattern=r"^(\*|[^\s.~*?\[\]{}]+)$")] | None = None
    difference: Annotated[bool, Field(strict=True)] = False


class FittedTable(Strict):
    value: Number
    error: float | None = None
    unit: str | None = None


class DataTable(Strict):
    file: str
    sha256: str


class FitTable(Strict):
    rmse: float | None = None
    status: str | None = None
    warnings: list[str] = Field(default_factory=list)
    data: list[DataTable] = Field(default_factory=list)
    parameters: dict[str, FittedTable] = Field(default_factory=dict)
    """Values, where they can't stand with the parameter's declaration; in files of older versions all of them."""
    standard_errors: dict[str, float] = Field(default_factory=dict)


class File(Strict):
    model: ModelTable = ModelTable()
    columns: dict[str, Any] = Field(default_factory=dict)
    nodes: dict[str, NodeTable] = Field(default_factory=dict)
    links: list[LinkTable] = Field(default_factory=list)
    effects: list[EffectTable] = Field(default_factory=list)
    fit: FitTable = FitTable()


# --- The `element` table of a node: a body of a material, its dimensions in any unit ----------------

_DIMENSIONS = {
    "m": Parameter("length", 0.01, "m", (1e-6, 2.0)),
    "rad": Parameter("angle", math.tau, "rad", (1e-3, math.tau * (1 + ROUNDING))),
    "1": Parameter("count", 1.0, "dimensionless", (1.0, 1e4)),
}
_OPTIONAL = ("angle", "count")
_MATERIAL = {
    "density": Parameter("density", 1e3, "kg/m^3", (1.0, 3e4)),
    "specific_heat": Parameter("specific_heat", 1e3, "J/(kg*K)", (10.0, 2e4)),
}
_CONDUCTIVITY = Parameter("conductivity", 1.0, "W/(m*K)", (1e-4, 1e4), title="thermal conductivity", fixed=True)
_CAPACITY = Parameter("capacity", 300.0, "J/K", (1e-3, 1e8), title="heat capacity", fixed=True)
ReadParameter = Callable[[Parameter, object, str], Parameter]
"""A parameter as the file has it: from its declaration, what the file says, and where."""


class ElementReader:
    """Turns one node's `element` table into a body.

    Args:
        path: the model file, for messages.
        table: what the file says.
        place: where the table stands in it.
        read: reads a parameter with its unit.
    """

    def __init__(self, path: Path, table: ElementTable, place: str, read: ReadParameter) -> None:
        self.path, self.place, self.read = path, place, read
        self.given = dict(table.model_extra or {})
        kind = KINDS.get(table.kind)
        if kind is None:
            raise self._mistake("kind", f'unknown element "{table.kind}"', f"one of {', '.join(KINDS)}")
        self.kind: type[Shape] = kind
        allowed = [*kind.units, *self._conductivities(), *_MATERIAL, HOTTEST]
        for name in self.given:
            if name not in allowed:
                raise self._mistake(name, f'unknown key "{name}"', f"one of kind, {', '.join(allowed)}")

    def element(self) -> Element:
        """The body.

        Raises:
            InputError: a dimension or a conductivity is missing, or makes no body.
        """
        sizes = {
            name: self._number(name, _DIMENSIONS[unit])
            for name, unit in self.kind.units.items()
            if name in self.given or name not in _OPTIONAL
        }
        if sizes.get("count", 1.0) % 1.0:
            raise self._mistake("count", f"{sizes['count']:g}", "a whole number")
        shape = self.kind(**sizes)
        wrong = shape.wrong()
        if wrong is not None:
            raise self._mistake(*wrong)
        hottest = self.given.get(HOTTEST, False)
        if not isinstance(hottest, bool):
            raise self._mistake(HOTTEST, shown(hottest), "true or false")
        return Element(shape, self._conductivity(), hottest)

    def capacity(self, shape: Shape) -> Parameter | None:
        """Heat capacity from density, specific heat and volume; `None` where the table gives neither.

        Raises:
            InputError: only one of the two is given, or the body is no part of a robot.
        """
        if not set(_MATERIAL) & set(self.given):
            return None
        density, specific = (self._number(name, declared) for name, declared in _MATERIAL.items())
        value = density * specific * shape.volume
        lower, upper = _CAPACITY.bounds
        if not lower <= value <= upper:
            expected = f"{lower:g} to {upper:g} J/K (are the dimensions in m, or do they say their unit?)"
            raise InputError(self.path, self.place, f"a body of {value:.3g} J/K", expected)
        return replace(_CAPACITY, value=value)

    def _conductivities(self) -> list[str]:
        return ["conductivity", *(f"conductivity_{direction}" for direction in self.kind.directions)]

    def _conductivity(self) -> dict[str, Parameter]:
        """For each direction its own parameter, or one that serves for all."""
        common, *single = self._conductivities()
        names = [common] * len(single) if common in self.given else single
        if common in self.given and set(single) & set(self.given):
            both = next(name for name in single if name in self.given)
            raise self._mistake(both, f"{both} beside {common}", f"one {common}, or {' and '.join(single)}")
        read = {name: self._material(name) for name in dict.fromkeys(names)}
        return {direction: read[name] for direction, name in zip(self.kind.directions, names, strict=True)}

    def _material(self, name: str) -> Parameter:
        given = self._given(name)
        if isinstance(given, Mapping) and "value" not in given:
            raise self._mistake(name, shown(given), 'a key "value"')
        return self.read(replace(_CONDUCTIVITY, name=name), given, f"{self.place}.{name}")

    def _number(self, name: str, declared: Parameter) -> float:
        """A number that no fit may change."""
        given = self._given(name)
        if isinstance(given, Mapping):
            for key in given:
                if key not in ("value", "unit"):
                    raise self._mistake(f"{name}.{key}", shown(given[key]), f"no key {key}: {name} can't be fitted")
            if "value" not in given:
                raise self._mistake(name, shown(given), 'a key "value"')
        return self.read(declared, given, f"{self.place}.{name}").value

    def _given(self, name: str) -> object:
        if name not in self.given:
            keys = "conductivity, or its own for each direction" if name.startswith("conductivity") else f'"{name}"'
            raise InputError(self.path, self.place, f"{self.kind.kind} without {name}", f"a key {keys}")
        return self.given[name]

    def _mistake(self, key: str, problem: str, expected: str) -> InputError:
        return InputError(self.path, f"{self.place}.{key}", problem, expected)


# --- The checked tables turned into the declarations of a network -----------------------------------

_NODE_CAPACITY = Parameter("capacity", 300.0, "J/K", (1e-6, LARGEST), title="heat capacity")
_RESISTANCE = Parameter("resistance", 5.0, "K/W", (1e-9, LARGEST), title="thermal resistance")
_TEMPERATURE = Parameter(
    "temperature", 20.0, "degC", (-80.0, 200.0), typical=10.0, title="prescribed temperature", fixed=True
)
AMBIENT: Key = ("nodes", "ambient", "temperature")
"""What `[model] ambient = …` declares."""
_MOST_PATTERNS = 4  # of {…} and * in one name: the ways to divide its letters among them go with a power of that


class Reader:
    """Turns checked tables into a network.

    Args:
        path: the model file, for messages.
        tables: what it says.
    """

    def __init__(self, path: Path, tables: File) -> None:
        self.path, self.tables = path, tables
        self._own_values: dict[str, dict[str, float]] = {}
        """By the place of a parameter in the file: its values by owner, where it has one for each."""

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
            tuple(self.effect(number, effect) for number, effect in enumerate(self.tables.effects)),
            tuple(dict.fromkeys((*model.joints, *named))),
            str(self.path),
            fitted,
        )
        names = {parameter.name for parameter in network.parameters}
        for name in fitted:
            if name not in names:
                problem = "a fitted value that no part of the model uses"
                expected = "none, or [fit] removed: the model was changed after the fit"
                raise InputError(self.path, f'fit.parameters."{name}"', problem, expected)
        own = self._values_by_name(network)
        return network.with_values(own | fitted) if own else network

    def _values_by_name(self, network: Network) -> dict[str, float]:
        """The values that places have for themselves, by the names of the parameters.

        Raises:
            InputError: a place has no value, or a value no place.
        """
        values: dict[str, float] = {}
        for key, owners in network.declared_at.items():
            place = self._place(key)
            own = self._own_values.get(place)
            if own is None:
                continue
            for owner in own:
                if owner not in owners.values():
                    expected = f"one of {', '.join(owners.values())}"
                    raise InputError(self.path, f"{place}.value", f"a value for {owner}", expected)
            for name, owner in owners.items():
                if owner not in own:
                    raise InputError(self.path, f"{place}.value", f"no value for {owner}", "one for each place")
                values[name] = own[owner]
        return values

    def _place(self, key: Key) -> str:
        """Where a key of a declaration stands in the file."""
        if key == AMBIENT and "ambient" not in self.tables.nodes:
            return "model.ambient"
        kind, which, *rest = key
        return ".".join([f'nodes."{which}"' if kind == "nodes" else f"{kind}[{which}]", *map(str, rest)])

    def _node(self, name: str, table: NodeTable) -> NodeDeclaration:
        place = f'nodes."{name}"'
        if table.element is not None:
            return self._body(name, table, table.element, place)
        if (table.capacity is None) == (table.temperature is None):
            problem = "neither capacity nor" if table.capacity is None else "both capacity and"
            raise InputError(self.path, place, f"{problem} temperature", "one of the two")
        if table.capacity is not None:
            return NodeDeclaration(name, capacity=self._parameter(_NODE_CAPACITY, table.capacity, f"{place}.capacity"))
        return NodeDeclaration(name, temperature=self._temperature(table.temperature, f"{place}.temperature"))

    def _body(self, name: str, table: NodeTable, given: ElementTable, place: str) -> NodeDeclaration:
        """A node with an element: its capacity follows from the material, or is given."""
        if table.temperature is not None:
            raise InputError(self.path, place, "both element and temperature", "one of the two")
        reader = ElementReader(self.path, given, f"{place}.element", self._parameter)
        element = reader.element()
        computed = reader.capacity(element.shape)
        if (computed is None) == (table.capacity is None):
            problem = "neither capacity nor" if computed is None else "both capacity and"
            expected = "either capacity, or density and specific_heat in the element"
            raise InputError(self.path, f"{place}.element", f"{problem} density", expected)
        capacity = computed or self._parameter(_NODE_CAPACITY, table.capacity, f"{place}.capacity")
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
            if "{" in end and wild > _MOST_PATTERNS:
                expected = f"at most {_MOST_PATTERNS}, such as {{leg}}_*"
                raise InputError(self.path, f"links[{number}].between", f"{wild} of {{…}} and * in one name", expected)
        if link.perfect:
            if link.resistance is not None:
                raise InputError(self.path, f"links[{number}]", "both perfect and resistance", "one of the two")
            return LinkDeclaration((one, other), None)
        resistance = self._parameter(_RESISTANCE, link.resistance, f"links[{number}].resistance")
        return LinkDeclaration((one, other), resistance)

    def effect(self, number: int, table: EffectTable) -> EffectDeclaration:
        """An entry of `[[effects]]` by its number.

        Raises:
            InputError: no such effect, or a key or value that it does not have.
        """
        place = f"effects[{number}]"
        kind = effect_named(table.kind, self.path, f"{place}.kind")
        given = dict(table.model_extra or {})
        words = {name: given.pop(name) for name in kind.options if name in given}
        declared = {parameter.name: parameter for parameter in kind.stated(table.difference)}
        for name in given:
            if name not in declared:
                allowed = ", ".join(("kind", "at", "run", "share", "driven_by", "difference", *kind.options, *declared))
                raise InputError(self.path, f"{place}.{name}", f'unknown key "{name}"', f"one of {allowed}")
        parameters = []
        for name, parameter in declared.items():
            shared = parameter if table.share is None else replace(parameter, share=table.share)
            parameters.append(self._parameter(shared, given.get(name), f"{place}.{name}"))
        try:
            effect = kind(**words)
        except (TypeError, ValueError) as error:
            name = next(name for name, word in words.items() if word not in kind.options[name])
            expected = " or ".join(f'"{word}"' for word in kind.options[name])
            raise InputError(self.path, f"{place}.{name}", shown(words[name]), expected) from error
        driven_by, run = table.driven_by or "", table.run or ""
        return EffectDeclaration(
            effect, table.at, tuple(parameters), driven_by=driven_by, run=run, difference=table.difference
        )

    def _parameter(self, declared: Parameter, given: object, place: str) -> Parameter:
        """A declared parameter with what the file says of it, converted to its SI unit.

        Values for single places are kept for `_values_by_name`; the parameter then has the first of them.
        """
        table = given if isinstance(given, ParameterTable) else self._table(given, place)
        unit = table.unit or declared.unit
        numbers = table.value if isinstance(table.value, dict) else {} if table.value is None else {"": table.value}
        bounds, prior = declared.bounds, declared.prior
        try:
            values = {owner: convert(number, unit, declared.unit) for owner, number in numbers.items()}
            if table.bounds is not None:
                least, greatest = table.bounds
                bounds = convert(least, unit, declared.unit), convert(greatest, unit, declared.unit)
            if table.prior is not None:
                mean, above = (convert(number, unit, declared.unit) for number in (table.prior[0], sum(table.prior)))
                prior = mean, above - mean  # a deviation of 1 degF is 0.56 K
        except ValueError as error:
            raise InputError(self.path, f"{place}.unit", f'"{unit}"', f"a unit like {declared.unit}") from error
        if declared.bounds[0] >= 0:  # what can't be negative by nature is not made so by a file
            bounds = max(bounds[0], declared.bounds[0]), bounds[1]
        lower, upper = bounds
        if lower > upper:
            problem = f"a lower bound {lower:g} above the upper {upper:g}"
            raise InputError(self.path, f"{place}.bounds", problem, "[least, greatest]")
        if prior is not None:
            self._check_prior(prior, bounds, declared.unit_behind, f"{place}.prior")
        for owner, value in values.items():
            slack = 0.0 if unit == declared.unit else ROUNDING * abs(value)
            if not lower - slack <= value <= upper + slack:
                problem = f"{value:g}{declared.unit_behind}" + (f" for {owner}" if owner else "")
                expected = f"a value from {lower:g} to {upper:g}{declared.unit_behind}"
                raise InputError(self.path, f"{place}.value", problem, expected)
            values[owner] = min(max(value, lower), upper)
        if isinstance(table.value, dict):
            self._own_values[place] = values
        start = declared.value if lower <= declared.value <= upper else (lower + upper) / 2  # if only bounds are given
        fixed = declared.fixed and table.prior is None  # what has a prior is fitted
        return replace(
            declared,
            value=next(iter(values.values()), start if prior is None else prior[0]),
            bounds=bounds,
            prior=prior,
            share=table.share or declared.share,
            fixed=lower == upper or (fixed if table.fixed is None else table.fixed),
        )

    def _check_prior(self, prior: tuple[float, float], bounds: tuple[float, float], unit: str, place: str) -> None:
        (mean, deviation), (lower, upper) = prior, bounds
        expected = f"[mean, standard deviation], the mean from {lower:g} to {upper:g}{unit}, the deviation above 0"
        if not lower <= mean <= upper:
            raise InputError(self.path, place, f"a mean of {mean:g}{unit}", expected)
        if not deviation > 0:
            raise InputError(self.path, place, f"a standard deviation of {deviation:g}{unit}", expected)

    def _table(self, given: object, place: str) -> ParameterTable:
        """A bare number, or an effect's table that pydantic has not looked at yet."""
        if given is None:
            return ParameterTable()
        if isinstance(given, int | float) and not isinstance(given, bool) and math.isfinite(given):
            return ParameterTable(value=float(given))
        try:
            return ParameterTable.model_validate(given)
        except ValidationError as error:
            first = first_mistake(error)
            raise InputError(self.path, place + place_of(first), found_in(first), expectation(first)) from error


def flat_columns(columns: Mapping[str, Any]) -> dict[str, object]:
    """`temperature.a = …` without quotes is a nested table in TOML; people write it all the same. Time has no place."""
    flat: dict[str, object] = {}
    for key, entry in columns.items():
        if (
            isinstance(entry, Mapping)
            and not {"column", "norm"} & set(entry)
            and "." not in key
            and key.partition("@")[0] != "time"
        ):
            flat.update({f"{key}.{place}": inner for place, inner in entry.items()})
        else:
            flat[key] = entry
    return flat
