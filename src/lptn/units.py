"""The one unit registry, and numbers converted through it at the edges."""

from __future__ import annotations

from functools import cache
from typing import Any


@cache
def registry() -> Any:
    """Pint's registry, made on first use: it takes a third of a second."""
    import pint

    return pint.UnitRegistry()


def convert(value: float, unit: str, target: str) -> float:
    """A number in `unit` as a number in `target`.

    Raises:
        ValueError: the unit is unknown, or measures something else.
    """
    if unit == target:
        return value
    try:
        return float(registry().Quantity(value, registry().parse_units(unit)).to(target).magnitude)
    except Exception as error:  # pint raises a dozen kinds of its own, and Python's for a text that is no unit
        raise ValueError(f"unit {unit!r} can't be turned into {target!r}") from error
