"""Units without the registry, and with it."""

from __future__ import annotations

import pytest

from lptn.basics.units import convert, registry


@pytest.mark.parametrize(("unit", "target"), [("cm", "m"), ("mm", "m"), ("min", "s"), ("h", "s")])
def test_multiples_of_units_are_those_of_the_registry(unit: str, target: str) -> None:
    assert convert(3.7, unit, target) == registry().Quantity(3.7, unit).to(target).magnitude
