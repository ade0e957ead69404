"""Units that people write, turned into SI (temperatures into degC)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lptn.arrays import FloatArray
from lptn.errors import InputError
from lptn.units import registry

_TARGETS = {
    "time": ("s", "time, such as s"),
    "temperature": ("degC", "temperature, such as degC"),
    "torque": ("N*m", "torque, such as N*m"),
    "current": ("A", "current, such as A"),
    "current_abs": ("A", "current, such as A"),
    "velocity": ("rad/s", "angular velocity, such as rad/s"),
    "velocity_rms": ("rad/s", "angular velocity, such as rad/s"),
    "speed": ("m/s", "speed, such as m/s"),
    "power": ("W", "power, such as W"),
    "mechanical_power": ("W", "power, such as W"),
}

# pint reads Nm as "number metre" and does not know rev.
_SPELLINGS = {"Nm": "N*m", "mNm": "mN*m", "kNm": "kN*m", "rev/min": "turn/min", "rev/s": "turn/s"}

# To pint these are 1/s, that is rad/s; of a shaft they mean turns, a factor 2 pi apart.
_TURNS = {"Hz": "turn/s", "1/min": "turn/min", "min^-1": "turn/min"}


def check_unit(unit: str, quantity: str, file: str | Path, place: str) -> None:
    """Refuse a unit that is unknown or of the wrong dimension for `quantity`.

    Raises:
        InputError: with `file` and `place` as given.
    """
    try:
        to_si(np.zeros(1), quantity, unit)
    except Exception as error:  # pint raises a dozen kinds of its own and Python's for a text that is no unit
        wanted = _TARGETS[quantity][1] if quantity in _TARGETS else "its quantity, such as V"
        raise InputError(file, place, f"unit '{unit}'", f"a unit of {wanted}") from error


def to_si(values: FloatArray, quantity: str, unit: str | None) -> FloatArray:
    """`values` in `unit` converted to the SI unit of `quantity`, degC for temperatures.

    No unit: unchanged. A quantity that is not known is converted to SI base units.
    """
    if unit is None:
        return values
    name = _SPELLINGS.get(unit, unit)
    if quantity.startswith("velocity"):
        name = _TURNS.get(unit, name)
    measured = registry().Quantity(values, registry().parse_units(name))
    target = _TARGETS.get(quantity)
    converted = measured.to(target[0]) if target else measured.to_base_units()
    return np.asarray(converted.magnitude, dtype=np.float64)
