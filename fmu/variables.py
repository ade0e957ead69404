"""The variables that an FMU shows: their structured names, units and start values, in SI with kelvin."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from lptn.basics.units import registry

Kind = Literal[
    "time", "state", "rate", "input", "parameter", "output", "admissible", "forecast", "indicator", "crossed", "clock"
]
ZERO_CELSIUS = 273.15  # K


@dataclass(frozen=True)
class DeclaredType:
    """A type that all variables of a quantity share.

    Args:
        name: of the type.
        quantity: its physical quantity, as the Modelica Standard Library (`Modelica.Units.SI`) calls it.
        unit: unit of the values.
        nominal: their usual size in a robot's joint.
        celsius: whether people see it in degC.
        relative: whether it is a difference, to which no offset of a display unit applies.
    """

    name: str
    quantity: str
    unit: str
    nominal: float
    celsius: bool = False
    relative: bool = False


_TEMPERATURE = DeclaredType("Temperature", "ThermodynamicTemperature", "K", 300.0, celsius=True)
_DIFFERENCE = DeclaredType("TemperatureDifference", "ThermodynamicTemperature", "K", 10.0, relative=True)
_HEAT_FLOW = DeclaredType("HeatFlowRate", "Power", "W", 10.0)
_TYPES = {
    declaration.unit: declaration
    for declaration in (
        DeclaredType("TemperatureSlope", "TemperatureSlope", "K/s", 0.1),
        DeclaredType("Torque", "Torque", "N*m", 10.0),
        DeclaredType("AngularVelocity", "AngularVelocity", "rad/s", 10.0),
        DeclaredType("Current", "ElectricCurrent", "A", 10.0),
        DeclaredType("Velocity", "Velocity", "m/s", 1.0),
        DeclaredType("Power", "Power", "W", 10.0),
        DeclaredType("HeatCapacity", "HeatCapacity", "J/K", 100.0),
        DeclaredType("ThermalResistance", "ThermalResistance", "K/W", 1.0),
        DeclaredType("Time", "Time", "s", 100.0),
        DeclaredType("Ratio", "", "1", 1.0),
    )
}


@dataclass(frozen=True)
class Variable:
    """One variable.

    Args:
        name: structured name.
        reference: FMI's value reference; the kinds stand one behind the other in the order of `Kind`.
        kind: what it is to the model.
        unit: unit of its value, empty where it is unknown.
        start: start value; `None` where it is calculated.
        description: what a person reads.
        celsius: whether it is a temperature (not a difference) that people see in degC.
        minimum: the least value that is accepted.
        maximum: the largest value that is accepted.
        hidden: whether it is internal to the component: neither input, output nor parameter.
        of: for a rate, the reference of its state.
        entrance: for a clock, whether the importer sets it.
        elements: for an array, the scalar variables that it joins; `name`, `reference` and `start` are the array's.
    """

    name: str
    reference: int
    kind: Kind
    unit: str
    start: float | None
    description: str
    celsius: bool = False
    minimum: float | None = None
    maximum: float | None = None
    hidden: bool = False
    of: int | None = None
    entrance: bool = False
    elements: tuple[Variable, ...] = ()

    @property
    def base(self) -> str:
        """The type that FMI 3 gives it."""
        return {"crossed": "Boolean", "clock": "Clock"}.get(self.kind, "Float64")

    @property
    def starts(self) -> tuple[float, ...]:
        """Its start values: none where it is calculated, one, or one for each element."""
        return tuple(element.start for element in self.elements or (self,) if element.start is not None)

    @property
    def causality(self) -> str:
        """FMI's causality."""
        if self.kind == "time":
            return "independent"
        if self.kind in ("input", "parameter"):
            return self.kind
        if self.kind == "clock":
            return "input" if self.entrance else "output"
        return "local" if self.hidden else "output"

    @property
    def variability(self) -> str:
        """FMI's variability."""
        if self.kind in ("crossed", "clock"):
            return "discrete"
        return "tunable" if self.kind == "parameter" else "continuous"

    @property
    def initial(self) -> str | None:
        """FMI's `initial`; `None` where the standard wants none."""
        given = {"state": "exact", "parameter": "exact", "time": None, "input": None, "clock": None}
        return given.get(self.kind, "calculated")

    @property
    def type(self) -> DeclaredType | None:
        """The declared type that it shares with others of its quantity, `None` for a unit of its own."""
        if self.unit == "K":
            return _TEMPERATURE if self.celsius else _DIFFERENCE
        if self.kind in ("output", "admissible") and self.unit == "W":
            return _HEAT_FLOW
        return _TYPES.get(self.unit)


# --- names: `FR_calf.torque` for the log column `torque.FR_calf` -----------------------------------

_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_QUOTABLE = re.compile(r"[A-Za-z0-9_!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]+")
_NAME_PARTS = re.compile(r"'(?:[^'\\]|\\.)+'|[^.']+")
_MEAN = "leave it at -1, or connect it where steps are so coarse that the input itself tells too little"
_QUANTITIES = {
    "velocity": ("Joint speed", "connect the speed of the joint, of either sign"),
    "velocity_rms": ("RMS of the joint speed over a step", _MEAN),
    "torque": ("Joint torque", "connect the torque of the joint's drive, measured or commanded, of either sign"),
    "torque_abs": ("Mean magnitude of the joint torque over a step", _MEAN),
    "current": ("Winding current", "connect the current of the joint's motor (q-axis), of either sign"),
    "current_abs": ("Mean magnitude of the winding current over a step", _MEAN),
    "mechanical_power": ("Mean magnitude of the mechanical power over a step", _MEAN),
    "speed": ("Speed", "connect how fast it moves through the air"),
    "power": ("Power", "connect the electrical power that becomes heat there"),
    "powered": ("Whether the drive is on", "connect 1 while it is on, 0 while it is off, or the share of a step"),
    "fan": ("Speed of the fan", "connect 0 for a fan that stands to 1 for full speed"),
    "irradiance": ("Irradiance", "connect the radiation that falls on it"),
    "temperature": ("Temperature", "connect what is measured there, or the output of another model, in kelvin"),
}


def structured_name(*parts: str) -> str:
    """A structured name of several parts, quoted, as FMI allows, where they are no identifiers.

    A character outside ASCII, which FMI's structured names lack, becomes `_uXXXX`.
    """
    return ".".join(_name_part(part) for part in parts)


def place_name(place: str, quantity: str) -> str:
    """The name of a quantity at a place: a node, or the hottest point of one, `winding.hottest`."""
    return structured_name(*place.split("."), quantity)


def name_between(place: str, effect: str, other: str, quantity: str) -> str:
    """The name of a quantity at a place, of an effect there, towards another place; empty for what there is not."""
    middle = f"{effect}_to_{other}" if effect and other else f"to_{other}" if other else effect
    return structured_name(place, middle, quantity) if middle else structured_name(place, quantity)


def _name_part(text: str) -> str:
    ascii_text = "".join(letter if letter.isascii() else f"_u{ord(letter):04X}" for letter in text)
    if _IDENTIFIER.fullmatch(ascii_text):
        return ascii_text
    quotable = "".join(letter if _QUOTABLE.fullmatch(letter) else f"_u{ord(letter):04X}" for letter in ascii_text)
    return f"'{quotable}'"


def from_column(column: str) -> str:
    """The variable of a log column: `torque.FR_calf` gives `FR_calf.torque`."""
    quantity, dot, place = column.partition(".")
    return structured_name(place, quantity) if dot else structured_name(quantity)


def to_column(name: str) -> str:
    """The log column of a variable: `FR_calf.torque` gives `torque.FR_calf`; a name of one part stays."""
    parts = [text.strip("'") for text in _NAME_PARTS.findall(name)]
    return f"{parts[-1]}.{'.'.join(parts[:-1])}" if len(parts) > 1 else name


def first_place(name: str) -> tuple[str, str]:
    """A variable's place as it stands in its name, and the rest: `FR_calf` and `to_ambient.heat_flow`."""
    place = _NAME_PARTS.match(name)
    return (place[0], name[place.end() + 1 :]) if place else (name, "")


def is_temperature(column: str) -> bool:
    """Whether a log column is a temperature or a sensor's reading, which logs hold in degC."""
    return column.partition(".")[0] in ("temperature", "reading")


def column_description(column: str) -> str:
    """What a person reads of the variable of a log column."""
    quantity, _, place = column.partition(".")
    title, advice = _QUANTITIES.get(quantity, (quantity.replace("_", " ").capitalize(), "connect the log's column"))
    return f"{title} of {place}: {advice}" if place else f"{title}: {advice}"


def places_of_owner(owner: str, prescribed: Iterable[str]) -> tuple[str, str]:
    """The places that a parameter belongs to: one, and the other end of an edge or an empty text.

    Args:
        owner: a node, a class (`*_calf`), a pattern, or an edge `a~b` of such.
        prescribed: nodes of given temperature, which stand last in an edge's name.
    """
    one, tilde, other = owner.partition("~")
    if tilde and one in set(prescribed):
        one, other = other, one
    return pattern_as_word(one), pattern_as_word(other) if tilde else ""


def pattern_as_word(pattern: str) -> str:
    """A glob as a word: `*_calf` is `all_calf`, `heater*` is `heater_all`."""
    word = re.sub(r"(?<=[A-Za-z0-9])\*", "_all", pattern)
    word = re.sub(r"\*(?=[A-Za-z0-9])", "all_", word)
    return word.replace("*", "all")


# --- units ------------------------------------------------------------------------------------------

BASES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
"""Base units of FMI and SSP."""


@dataclass(frozen=True)
class UnitDefinition:
    """One entry of `UnitDefinitions`.

    Args:
        name: as the variables give it.
        exponents: of FMI's base units; `None` where the unit has no fixed ones (`W*(s/rad)^n`).
        factor: from this unit to the base units.
        offset: to be added then, as 273.15 K to degC.
    """

    name: str
    exponents: Mapping[str, int] | None
    factor: float = 1.0
    offset: float = 0.0

    def conversion(self, target: UnitDefinition) -> tuple[float, float]:
        """Factor and offset of a value in this unit to one in `target`; to FMI, too, an angle is a pure number.

        Raises:
            ValueError: a unit of something else.
        """
        if self.name == target.name or self.exponents is None or target.exponents is None:
            return 1.0, 0.0
        one, other = ({**unit.exponents, "rad": 0} for unit in (self, target) if unit.exponents is not None)
        if {base for base in one | other if one.get(base, 0) != other.get(base, 0)}:
            raise ValueError(f"{self.name!r} can't be turned into {target.name!r}")
        return self.factor / target.factor, (self.offset - target.offset) / target.factor


def fmi_unit(unit: str) -> str:
    """A unit of the model as FMI gets it: kelvin for degC, `1` for a ratio of equals."""
    return {"degC": "K", "W/W": "1"}.get(unit, unit)


def celsius_offset(unit: str) -> float:
    """What an FMU's value exceeds the model's by, in a unit of the model: 273.15 for degC, else 0."""
    return ZERO_CELSIUS if unit == "degC" else 0.0


def unit_definitions(units: Iterable[str]) -> list[UnitDefinition]:
    """The definitions of the units that variables use, each once, in order of first use."""
    return [_unit_definition(unit) for unit in dict.fromkeys(units) if unit]


def _unit_definition(unit: str) -> UnitDefinition:
    try:
        parsed = registry().parse_units(unit)
    except Exception:  # pint raises a dozen kinds; a unit that depends on an exponent has no definition
        return UnitDefinition(unit, None)
    exponents: dict[str, int] = {}
    factor = 1.0
    for name, power in parsed._units.items():
        if name == "radian":  # to pint a pure number, to FMI a base unit
            bases, size = {"radian": 1}, 1.0
        else:
            quantity = registry().Quantity(1.0, name).to_base_units()
            bases, size = dict(quantity.units._units), float(quantity.magnitude)
        factor *= size**power
        for base, exponent in bases.items():
            symbol = registry().get_symbol(base)  # FMI's base units are called as pint's
            exponents[symbol] = exponents.get(symbol, 0) + round(exponent * power)
    return UnitDefinition(unit, {base: power for base, power in exponents.items() if power}, factor)
