"""What may stand in a geometry file: its tables and keys, numbers in any unit, checked by pydantic."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from lptn.model_schema import Strict
from lptn.units import convert

_LEAST = 1e-12


def _not_dust(value: float, expected: str) -> float:
    """Refuse what is above 0 by a hair: the inverse of it is no number any more."""
    if 0 < abs(value) < _LEAST:
        raise ValueError(expected)
    return value


def _in(unit: str) -> Callable[[object], float]:
    def read(given: object) -> float:
        expected = f'a number in {unit}, or such as {{ value = 1, unit = "{unit}" }}'
        value = given.get("value") if isinstance(given, Mapping) else given
        extra = set(given) - {"value", "unit"} if isinstance(given, Mapping) else set()
        if extra or isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ValueError(expected)
        if isinstance(given, Mapping):
            try:
                return _not_dust(convert(float(value), str(given.get("unit", unit)), unit), expected)
            except ValueError as error:
                raise ValueError(expected) from error
        return _not_dust(float(value), expected)

    return read


Length = Annotated[float, BeforeValidator(_in("m")), Field(gt=0, le=2)]
Conductivity = Annotated[float, BeforeValidator(_in("W/(m*K)")), Field(gt=0, le=5000)]
Density = Annotated[float, BeforeValidator(_in("kg/m^3")), Field(gt=0, le=3e4)]
SpecificHeat = Annotated[float, BeforeValidator(_in("J/(kg*K)")), Field(gt=0, le=2e4)]
Film = Annotated[float, BeforeValidator(_in("W/(m^2*K)")), Field(gt=0, le=1e7)]
Resistance = Annotated[float, BeforeValidator(_in("K/W")), Field(gt=0, le=1e4)]
Ohm = Annotated[float, BeforeValidator(_in("ohm")), Field(gt=0, le=100)]
TorqueConstant = Annotated[float, BeforeValidator(_in("N*m/A")), Field(gt=0, le=1e3)]
Number = Annotated[float, BeforeValidator(_in("dimensionless"))]
Pieces = Annotated[int, Field(ge=1, le=20, strict=True)]


class MotorTable(Strict):
    name: str = "motor"
    kind: Literal["inrunner", "outrunner"]
    length: Length
    slots: Annotated[int, Field(ge=2, le=200, strict=True)]
    tooth_width: Length
    overhang: Length


class WindingTable(Strict):
    resistance: Ohm
    input: Literal["current", "torque"] = "current"
    torque_constant: TorqueConstant | None = None
    fill: Annotated[Number, Field(gt=0.05, lt=0.95)] = 0.45
    impregnation: Conductivity = 0.2
    liner: Length = 0.3e-3
    liner_conductivity: Conductivity = 0.15


class CoolingTable(Strict):
    outside: Film = 12.0
    ends: Film = 15.0
    fit: Film = 1500.0
    gap_conductivity: Conductivity = 0.027
    bearing: Resistance = 4.0
    mount: Resistance | None = None


class MaterialTable(Strict):
    conductivity: Conductivity | None = None
    conductivity_radial: Conductivity | None = None
    conductivity_axial: Conductivity | None = None
    density: Density
    specific_heat: SpecificHeat


class PiecesTable(Strict):
    axial: Pieces = 1
    winding: Pieces = 1
    yoke: Pieces = 1
    rotor: Pieces = 1
    housing: Pieces = 1


class LossTable(Strict):
    iron_gain: Annotated[Number, Field(ge=0)] = 0.0
    iron_exponent: Annotated[Number, Field(ge=1, le=2)] = 1.5


class GeometryFile(Strict):
    motor: MotorTable
    outer_radius: dict[str, Length]
    winding: WindingTable
    cooling: CoolingTable = CoolingTable()
    materials: dict[str, str | MaterialTable] = Field(default_factory=dict)
    pieces: PiecesTable = PiecesTable()
    losses: LossTable = LossTable()
