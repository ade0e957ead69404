"""Units without the registry, and with it."""

from __future__ import annotations

from lptn.basics.units import _MULTIPLES, registry


def test_multiples_of_units_are_those_of_the_registry() -> None:
    for (unit, target), factor in _MULTIPLES.items():
        assert registry().Quantity(3.7, unit).to(target).magnitude == 3.7 * factor
