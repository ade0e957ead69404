"""Numbers that a user gives: with a unit (`{ value = 550, unit = "g" }`), by place (`"*_calf" = 60`), or in order."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.places import matching
from lptn.basics.toml import Number, quantity
from lptn.model.model import Model

LONGEST = 86400.0  # s, a day: fine simulations take steps of a second
SINE = math.pi / (2 * math.sqrt(2))
"""RMS over mean magnitude of a sine: of a joint's speed in a gait, where only its mean is known."""

# --- quantities of a TOML file ------------------------------------------------------------------

_POSITIVE, _NOT_NEGATIVE = Field(gt=0), Field(ge=0)
Positive = Annotated[Number, _POSITIVE]
NotNegative = Annotated[Number, _NOT_NEGATIVE]
Celsius = Annotated[Number, Field(gt=-80, lt=500), quantity("degC")]
Kelvins = Annotated[Number, _POSITIVE, quantity("K")]
Seconds = Annotated[Number, Field(gt=0, le=LONGEST), quantity("s")]
Runtime = Annotated[Number, _NOT_NEGATIVE, quantity("s")]
Length = Annotated[Number, _POSITIVE, quantity("m")]
Speed = Annotated[Number, _POSITIVE, quantity("m/s")]
Mass = Annotated[Number, _POSITIVE, quantity("kg")]
ExtraMass = Annotated[Number, _NOT_NEGATIVE, quantity("kg")]
Volume = Annotated[Number, _POSITIVE, quantity("m^3")]
ExtraVolume = Annotated[Number, _NOT_NEGATIVE, quantity("m^3")]
Torque = Annotated[Number, _POSITIVE, quantity("N*m")]
TorqueConstant = Annotated[Number, _POSITIVE, quantity("N*m/A")]
SpeedConstant = Annotated[Number, _POSITIVE, quantity("rad/s/V")]
Inertia = Annotated[Number, _NOT_NEGATIVE, quantity("kg*m^2")]
ShaftSpeed = Annotated[Number, _POSITIVE, quantity("rad/s")]
AnySpeed = Annotated[Number, quantity("rad/s")]
Voltage = Annotated[Number, _POSITIVE, quantity("V")]
Ohms = Annotated[Number, _POSITIVE, quantity("ohm")]
Density = Annotated[Number, _POSITIVE, quantity("kg/m^3")]
SpecificHeat = Annotated[Number, _POSITIVE, quantity("J/(kg*K)")]
Conductivity = Annotated[Number, _POSITIVE, quantity("W/(m*K)")]
Current = Annotated[Number, _POSITIVE, quantity("A")]
Power = Annotated[Number, _POSITIVE, quantity("W")]
ExtraPower = Annotated[Number, _NOT_NEGATIVE, quantity("W")]
Flow = Annotated[Number, _NOT_NEGATIVE, quantity("m^3/s")]
Pressure = Annotated[Number, _NOT_NEGATIVE, quantity("Pa")]
SpecificEnergy = Annotated[Number, _POSITIVE, quantity("J/kg")]
Capacity = Annotated[Number, _POSITIVE, quantity("J/K")]
Resistance = Annotated[Number, _POSITIVE, quantity("K/W")]


def _ascending(ends: list[float]) -> list[float]:
    if not ends[0] <= ends[1]:
        raise ValueError("[least, most]")
    return ends


def _both_ends(given: Any) -> Any:
    if isinstance(given, str | bool):
        raise ValueError("a number, or [least, most]")
    return given if isinstance(given, list) else [given, given]


Of = TypeVar("Of")
Ends = Annotated[list[Of], Field(min_length=2, max_length=2), AfterValidator(_ascending)]
"""The least and the most of a range."""
Span = Annotated[Ends[Of], BeforeValidator(_both_ends)]
"""Likewise; one number is both."""
ByPlace = dict[str, Number]
"""Numbers by name or pattern; a later entry overrides an earlier one."""


# --- numbers by place, or in order --------------------------------------------------------------

Each = float | Mapping[str, float]
"""One number for all places, or numbers by name or pattern (`"*_calf"`); a later entry overrides an earlier one."""
Values = Mapping[str, float] | Sequence[float] | FloatArray
"""Numbers by name, or in order."""


def by_place(given: Mapping[str, float], places: Sequence[str], origin: str, table: str) -> dict[str, float]:
    """Numbers spread over the places that their patterns match.

    Args:
        given: numbers by name or pattern.
        places: names to choose from.
        origin: the file (or object) that gives them, for messages.
        table: the key under which they stand, for messages.

    Raises:
        InputError: a pattern that matches nothing.
    """
    spread: dict[str, float] = {}
    for pattern, value in given.items():
        names = matching(pattern, places)
        if not names:
            raise InputError(origin, f'{table}."{pattern}"', "no such place", f"some of {', '.join(places)}")
        spread |= dict.fromkeys(names, float(value))
    return spread


def checked_by_place(
    given: Each, places: Sequence[str], table: str, *, infinite: bool = False, least: float = -273.15
) -> dict[str, float]:
    """Settings of a controller spread over its places, in the places' order.

    Args:
        given: one number, or numbers by name or pattern.
        places: names to choose from.
        table: what the numbers are, for messages.
        infinite: whether infinity is allowed.
        least: the smallest number that is allowed.

    Raises:
        InputError: a pattern that matches nothing, or a number out of range.
    """
    pairs = given if isinstance(given, Mapping) else {"*": given}
    spread = by_place(pairs, places, "settings", table)
    for pattern, value in pairs.items():
        number = float(value)
        if math.isnan(number) or (math.isinf(number) and not infinite) or number < least:
            raise InputError("settings", f"{table}.{pattern}", f"{value}", f"a number from {least:g} up")
    return {place: spread[place] for place in places if place in spread}


def limits_of(given: Each, model: Model) -> dict[str, float]:
    """Limits [degC] by place of a model, in its order.

    Args:
        given: one number, or numbers by name or pattern of nodes, or of what else the model gives a temperature of.
        model: whose places they are for.

    Raises:
        InputError: a pattern that matches nothing, a number out of range, or no limit at all.
    """
    limits = checked_by_place(given, model.places, "limits")
    if not limits:
        raise InputError(model.network.origin, "limits", "none", f"a limit for one of {', '.join(model.places)}")
    return limits


def in_order(values: Values, names: Sequence[str], what: str, missing: float) -> FloatArray:
    """Values in the order of their names, `missing` for those left out.

    Raises:
        InputError: an unknown name, or a wrong number of values.
    """
    if isinstance(values, Mapping):
        unknown = set(values) - set(names)
        if unknown:
            raise InputError(what, sorted(unknown)[0], "an unknown name", f"one of {', '.join(names)}")
        return np.array([values.get(name, missing) for name in names], dtype=float)
    array = np.asarray(values, dtype=float)
    if array.shape != (len(names),):
        raise InputError(what, "values", f"shape {array.shape}", f"{len(names)} values: {', '.join(names)}")
    return array
