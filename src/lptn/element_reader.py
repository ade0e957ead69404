"""The `element` table of a node in a model file: a body of a material, its dimensions in any unit."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from lptn.elements import KINDS, Element, Shape
from lptn.errors import InputError, shown
from lptn.model_schema import ElementTable
from lptn.parameters import Parameter

_DIMENSIONS = {
    "m": Parameter("length", 0.01, "m", (1e-6, 2.0)),
    "rad": Parameter("angle", math.tau, "rad", (1e-3, math.tau * (1 + 1e-9))),
    "1": Parameter("count", 1.0, "dimensionless", (1.0, 1e4)),
}
_OPTIONAL = ("angle", "count")
_MATERIAL = {
    "density": Parameter("density", 1e3, "kg/m^3", (1.0, 3e4)),
    "specific_heat": Parameter("specific_heat", 1e3, "J/(kg*K)", (10.0, 2e4)),
}
_CONDUCTIVITY = Parameter(
    "conductivity", 1.0, "W/(m*K)", (1e-4, 1e4), typical=1.0, title="thermal conductivity", fixed=True
)
_CAPACITY = Parameter("capacity", 300.0, "J/K", (1e-3, 1e6), typical=300.0, title="heat capacity", fixed=True)
Read = Callable[[Parameter, object, str], Parameter]
"""Reads a parameter's table: what is known of it, what the file says, where."""


class ElementReader:
    """Turns one node's `element` table into a body.

    Args:
        path: the model file, for messages.
        table: what the file says.
        place: where the table stands in it.
        read: reads a parameter with its unit.
    """

    def __init__(self, path: Path, table: ElementTable, place: str, read: Read) -> None:
        self.path, self.place, self.read = path, place, read
        self.given = dict(table.model_extra or {})
        kind = KINDS.get(table.kind)
        if kind is None:
            raise self._mistake("kind", f'unknown element "{table.kind}"', f"one of {', '.join(KINDS)}")
        self.kind: type[Shape] = kind
        allowed = [*kind.units, *self._conductivities(), *_MATERIAL]
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
        return Element(shape, self._conductivity())

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
        found = {name: self._material(name) for name in dict.fromkeys(names)}
        return {direction: found[name] for direction, name in zip(self.kind.directions, names, strict=True)}

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

    def _mistake(self, key: str, found: str, expected: str) -> InputError:
        return InputError(self.path, f"{self.place}.{key}", found, expected)
