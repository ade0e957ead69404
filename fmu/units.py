"""Unit strings of the model as FMI's unit definitions: base-unit exponents and factor."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from lptn.units import registry

ZERO_CELSIUS = 273.15  # K
_BASES = {
    "kilogram": "kg",
    "meter": "m",
    "second": "s",
    "ampere": "A",
    "kelvin": "K",
    "mole": "mol",
    "candela": "cd",
    "radian": "rad",
}
_FEATURES = {
    "temperature": "degC",
    "torque": "N*m",
    "current": "A",
    "current_abs": "A",
    "velocity": "rad/s",
    "velocity_rms": "rad/s",
    "speed": "m/s",
    "power": "W",
    "mechanical_power": "W",
    "powered": "1",
    "torque_abs": "N*m",
    "fan": "1",
    "irradiance": "W/m^2",
}


@dataclass(frozen=True)
class UnitDefinition:
    """One entry of `UnitDefinitions`.

    Args:
        name: as the variables give it.
        exponents: of FMI's base units; `None` where the unit has no fixed ones (`W*(s/rad)^n`).
        factor: from this unit to the base units.
        celsius: whether people see it as degC.
    """

    name: str
    exponents: dict[str, int] | None = field(default_factory=dict)
    factor: float = 1.0
    celsius: bool = False


def feature_unit(column: str) -> str:
    """The unit of a log column's quantity, empty where it is not known."""
    return _FEATURES.get(column.partition(".")[0], "")


def plain(unit: str) -> str:
    """The unit as FMI gets it: kelvin for degC, `1` for a ratio of equals."""
    return {"degC": "K", "W/W": "1", "": ""}.get(unit, unit)


def definitions(units: Iterable[str]) -> list[UnitDefinition]:
    """The definitions of the units that variables use, each once, in order of first use."""
    return [_definition(unit) for unit in dict.fromkeys(units) if unit]


def _definition(unit: str) -> UnitDefinition:
    if unit == "K":
        return UnitDefinition("K", {"K": 1}, celsius=True)
    if unit == "1":
        return UnitDefinition("1")
    try:
        parsed = registry().parse_units(unit)
    except Exception:  # pint raises a dozen kinds; a unit that depends on an exponent has no definition
        return UnitDefinition(unit, None)
    exponents: dict[str, int] = {}
    factor = 1.0
    for name, power in parsed._units.items():
        if name == "radian":  # to pint a pure number, to FMI a base unit
            base, size = {"radian": 1}, 1.0
        else:
            quantity = registry().Quantity(1.0, name).to_base_units()
            base, size = dict(quantity.units._units), float(quantity.magnitude)
        factor *= size**power
        for each, inner in base.items():
            exponents[_BASES[each]] = exponents.get(_BASES[each], 0) + round(inner * power)
    return UnitDefinition(unit, {name: power for name, power in exponents.items() if power}, factor)
