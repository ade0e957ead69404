"""Errors by operating condition as the page shows them: long times in minutes."""

from __future__ import annotations

from dataclasses import replace

from lptn.compare import Comparison, Condition

_LONG = 600.0  # s; longer times are in minutes, as in the figures
_SECONDS, _MINUTES = " [s]", " [min]"


def conditions_of(comparison: Comparison) -> list[Condition]:
    """`Comparison.conditions` with times in the unit in which a person reads them."""
    found = comparison.conditions()
    longest = max((each.upper for each in found if each.quantity.endswith(_SECONDS)), default=0.0)
    return [_in_minutes(each) for each in found] if longest > _LONG else found


def worst(comparison: Comparison) -> Condition | None:
    """The condition in which a model fails worst, `None` where nothing can be binned."""
    return max(conditions_of(comparison), key=lambda each: each.errors.rmse, default=None)


def _in_minutes(each: Condition) -> Condition:
    if not each.quantity.endswith(_SECONDS):
        return each
    quantity = each.quantity.removesuffix(_SECONDS) + _MINUTES
    return replace(each, quantity=quantity, lower=each.lower / 60, upper=each.upper / 60)
