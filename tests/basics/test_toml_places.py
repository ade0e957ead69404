"""The line of a key in a TOML text."""

from __future__ import annotations

import pytest

from lptn.basics.toml import locate

TEXT = """\
# resistance = 1
[model]   # the model
name = "m"

[nodes."*_calf"]
capacity = { value = 300, bounds = [1, 2] }

[nodes.pc]
capacity.value = 400

[[links]]
between = ["a", "b"]

[[links]]  # second
between = ["b", "c"]
resistance.bounds = [1, 2]

[columns]
temperature.a = "T1"
"temperature.b" = "T2"
"""


@pytest.mark.parametrize(
    ("place", "line"),
    [
        ("model.name", 3),
        ("model", 2),
        ('nodes."*_calf"', 5),
        ('nodes."*_calf".capacity', 6),
        ('nodes."*_calf".capacity.bounds', 6),
        ("nodes.pc.capacity", 8),
        ("nodes.pc.capacity.value", 9),
        ("links[0].between", 12),
        ("links[1].between[0]", 15),
        ("links[1].resistance.bounds", 16),
        ("links[1].nothing", 14),
        ("columns temperature.a", 19),
        ('columns."temperature.b"', 20),
        ("links[7].between", None),
        ("elsewhere", None),
    ],
)
def test_locate_finds_the_key_or_the_table_that_should_hold_it(place: str, line: int | None) -> None:
    assert locate(TEXT, place) == line


def test_an_empty_text_has_no_lines() -> None:
    assert locate("", "model.name") is None
