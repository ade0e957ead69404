"""The one unit registry, and numbers converted through it at the edges."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

_NUMBER = re.compile(r"(?<!\w)\d[\d.]*")
_POWER = ("**", "^")
_MULTIPLES = {("cm", "m"): 1e-2, ("mm", "m"): 1e-3, ("min", "s"): 60.0, ("h", "s"): 3600.0}
"""What model files hold most often; asking pint, which takes half a second to begin, gives the same numbers."""


@cache
def registry() -> Any:
    """Pint's registry, made on first use: it takes a third of a second."""
    import pint

    return pint.UnitRegistry(preprocessors=[_harmless])


def _harmless(unit: str) -> str:
    """A unit's text, refused where it is arithmetic: pint works `9**9**9` out, for hours.

    Raises:
        ValueError: it is longer than any unit, or holds a number that is neither 1 nor an exponent of two digits.
    """
    longest = 60  # characters; no unit that people write comes near
    if len(unit) > longest:
        raise ValueError("more text than a unit has")
    for number in _NUMBER.finditer(unit):
        before, after = unit[: number.start()].rstrip("-+( "), unit[number.end() :].lstrip(") ")
        exponent = before.endswith(_POWER) and len(number[0]) <= 2
        if not (exponent or number[0] == "1") or (exponent and after.startswith(_POWER)):
            raise ValueError("a number in a unit that is no exponent")
    return unit


def convert(value: float, unit: str, target: str) -> float:
    """A number in `unit` as a number in `target`.

    Raises:
        ValueError: the unit is unknown, or measures something else.
    """
    if unit == target:
        return value
    if (unit, target) in _MULTIPLES:
        return value * _MULTIPLES[unit, target]
    try:
        return float(registry().Quantity(value, registry().parse_units(unit)).to(target).magnitude)
    except Exception as error:  # pint raises a dozen kinds of its own, and Python's for a text that is no unit
        raise ValueError(f"unit {unit!r} can't be turned into {target!r}") from error
