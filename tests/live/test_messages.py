"""Messages made numbers: JSON, CSV, and what is neither."""

from __future__ import annotations

import pytest

from lptn.basics.errors import InputError
from lptn.live.messages import Decoder


def test_nested_json_bears_the_names_that_bags_give() -> None:
    line = b'{"time": 1.5, "motor_state": [{"temperature": 40}, {"temperature": 41}], "imu": {"t": null}, "q": [1, 2]}'
    assert Decoder("udp").decode(line) == {
        "time": 1.5, "motor_state[0].temperature": 40, "motor_state[1].temperature": 41, "imu.t": None,
        "q[0]": 1, "q[1]": 2,
    }  # fmt: skip


def test_lists_beside_a_list_of_names_bear_these() -> None:
    line = b'{"joints": {"name": ["knee", "hip"], "effort": [3.5, -2], "velocity": []}}'
    assert Decoder("udp").decode(line) == {"joints.effort[knee]": 3.5, "joints.effort[hip]": -2}


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ("time,a\n0,1.5\n", {"time": "0", "a": "1.5"}),
        ("time;a\n0,5;1,5\n", {"time": "0.5", "a": "1.5"}),
        ("time a\n0   1.5\r\n", {"time": "0", "a": "1.5"}),
        ('"time"\t"a"\n0\t\n', {"time": "0", "a": None}),
    ],
)
def test_cells_of_csv_bear_the_names_of_the_first_line(lines: str, expected: dict[str, str]) -> None:
    decoder = Decoder("log.csv")
    names, row = lines.splitlines()
    assert decoder.decode(b"# a remark") is None
    assert decoder.decode(names.encode()) is None
    assert decoder.decode(row.encode()) == expected
    assert decoder.decode(names.encode()) is None  # a logger that was started anew repeats it


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (['{"a": 1'], r"udp: message 1: found '\{\"a\": 1'; expected a JSON object"),
        (["[1, 2]"], "expected a JSON object of numbers"),
        (["1,2,3"], "expected a JSON object, or first a line of names"),
        (["time,a", "1,2,3"], "message 2: found '1,2,3'; expected 2 cells"),
    ],
)
def test_what_is_no_message_is_said_with_its_place(lines: list[str], message: str) -> None:
    decoder = Decoder("udp")
    for line in lines[:-1]:
        decoder.decode(line.encode())
    with pytest.raises(InputError, match=message):
        decoder.decode(lines[-1].encode())
