"""Parameters as they are declared."""

from __future__ import annotations

import pytest

from lptn.basics.parameters import Parameter


@pytest.mark.parametrize(
    ("unit", "bounds", "off", "ends"),
    [
        ("W", (0.0, 20.0), 0.0, (0.0,)),
        ("1", (0.0, 1.0), 0.0, (0.0, 1.0)),
        ("K", (-5.0, 5.0), 0.0, ()),  # an error goes on beyond none
        ("J/K", (20.0, 2000.0), None, ()),
        ("1", (1.0, 3.0), None, ()),  # an exponent, and no share
        ("1", (-1.0, 20.0), 0.0, (-1.0,)),  # a change, by which all may be gone
    ],
)
def test_which_bounds_are_natures(
    unit: str, bounds: tuple[float, float], off: float | None, ends: tuple[float, ...]
) -> None:
    assert Parameter("size", bounds[0], unit, bounds, off=off).ends_by_nature == ends


def test_a_number_without_a_unit_has_nothing_behind_it() -> None:
    assert Parameter("exponent", 1.5, "1", (1.1, 1.9)).unit_behind == ""
    assert Parameter("resistance", 1.5, "K/W", (0.1, 5.0)).unit_behind == " K/W"
