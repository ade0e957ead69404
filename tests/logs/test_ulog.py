"""PX4 ULog files: PX4's names known with their units, everything else by a mapping, broken bytes refused."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lptn.logs.columns import ColumnSource
from lptn.logs.reading import read_log
from tests.logs.ulog_bytes import FORMATS, battery, data, definitions, esc_status, header, message, velocity

pytest.importorskip("pyulog")

Refuse = Callable[..., str]


def flight(path: Path, seconds: int = 60) -> Path:
    """Two of four motor controllers at 10 Hz, battery and speed at 1 Hz."""
    parts = [header(), definitions(FORMATS)]
    for k in range(10 * seconds):
        time = 5 + 0.1 * k
        parts.append(esc_status(time, 2, [(3000, 2.5, 40 + k // 100), (-600, 1.0, 35), (0, 0.0, 0), (0, 0.0, 0)]))
        if k % 10 == 0:
            parts.append(battery(time + 0.02, 16.0, 4.0, 30.0))
            parts.append(velocity(time + 0.03, 3.0, 0.0, 4.0))
    path.write_bytes(b"".join(parts))
    return path


def test_px4_s_own_names(tmp_path: Path) -> None:
    (run,) = read_log(flight(tmp_path / "flight.ulg"), step=1.0)
    assert run.time[0] == pytest.approx(5.03)
    np.testing.assert_allclose(run.columns["velocity.esc0"], 100 * np.pi, rtol=1e-6)
    np.testing.assert_allclose(run.columns["velocity.esc1"], 20 * np.pi, rtol=1e-6)
    np.testing.assert_allclose(run.columns["current.esc0"], 2.5)
    np.testing.assert_allclose(run.columns["power.battery"], 64.0)
    np.testing.assert_allclose(run.columns["speed.base"], 5.0)
    np.testing.assert_allclose(run.temperature("esc0")[[2, 25, 52]], [40, 42, 45])
    assert run.resolution["temperature.esc0"] == 1.0
    assert not run.has("temperature.esc2")  # no controller there
    assert any("the units are PX4's" in note for note in run.notes)


def test_rows_of_other_topics_are_no_gaps(tmp_path: Path) -> None:
    """Battery and speed come between the controllers' messages."""
    (run,) = read_log(
        flight(tmp_path / "flight.ulg"),
        inputs=["current.esc0"],
        outputs=["temperature.esc0"],
        optional=["velocity.esc0", "power.battery"],
        step=1.0,
    )
    assert run.has("velocity.esc0")
    assert run.has("power.battery")
    assert "temperature.esc0: logged every 0.1 s." in run.notes
    assert not any("missing" in note or "left out" in note or "gap" in note for note in run.notes)


def test_a_mapping_names_topics_and_fields(tmp_path: Path) -> None:
    columns = {
        "temperature.motor": ColumnSource(("esc_status.esc[1].esc_temperature",)),
        "power.motor": ColumnSource(("battery_status.voltage_v", "battery_status.current_a"), how="product"),
    }
    (run,) = read_log(
        flight(tmp_path / "flight.ulg"), columns, inputs=["power.motor"], outputs=["temperature.motor"], step=1.0
    )
    np.testing.assert_allclose(run.temperature("motor"), 35.0)
    np.testing.assert_allclose(run.columns["power.motor"], 64.0)


def test_a_cut_file_gives_what_it_holds(tmp_path: Path) -> None:
    path = flight(tmp_path / "flight.ulg")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    (run,) = read_log(path, step=1.0)
    assert 25 <= len(run) <= 30


def test_an_empty_log(tmp_path: Path, refuse: Refuse) -> None:
    path = tmp_path / "flight.ulg"
    path.write_bytes(header() + definitions(FORMATS))
    assert "no topic with numbers" in refuse(path, read_log, path)
    path.write_bytes(header()[:9])
    assert "found a broken file" in refuse(path, read_log, path)


@pytest.mark.parametrize(
    "formats",
    [
        {"a": "uint64_t timestamp;float[2000000000] x;"},
        {"a": "uint64_t timestamp;a[2] again;"},
        {
            "a": "uint64_t timestamp;b[1000] x;",
            **{letter: f"{chr(ord(letter) + 1)}[1000] x;" for letter in "bcdefgh"},
            "i": "float[1000] x;",
        },
    ],
)
def test_definitions_that_unfold_to_more_than_a_memory_holds(
    tmp_path: Path, refuse: Refuse, formats: dict[str, str]
) -> None:
    path = tmp_path / "flight.ulg"
    body = message("D", b"\x00\x00" + bytes(40)) * 20
    path.write_bytes(header() + definitions(formats) + body)
    refuse(path, read_log, path)


def test_data_of_an_unknown_topic(tmp_path: Path, refuse: Refuse, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "flight.ulg"
    path.write_bytes(header() + data("esc_status", bytes(100)) * 30)
    refuse(path, read_log, path)
    assert capsys.readouterr().out == ""


# --- Clocks that go back ---------------------------------------------------------------------------


def motor(path: Path, stamps: list[float], order: list[int]) -> Path:
    """A topic of one motor's temperature, 20 degC and a tenth more each message; as many of another beside it."""
    formats = {name: f"uint64_t timestamp;float {field};" for name, field in (("motor", "temp"), ("other", "x"))}
    parts = [header(), definitions(formats)]
    for k in order:
        for topic, value in ((0, 20 + 0.1 * k), (1, 1.0)):
            stamp = stamps[k] if topic == 0 else 5.0 + k
            parts.append(message("D", struct.pack("<HQf", topic, round(stamp * 1e6), value)))
    path.write_bytes(b"".join(parts))
    return path


MOTOR = {"temperature.motor": ColumnSource(("motor.temp",))}
GOOD = [5.0 + k for k in range(100)]
ORDER = list(range(100))


@pytest.mark.parametrize("swapped", [[1, 0, *ORDER[2:]], [*ORDER[:40], 42, 41, 40, *ORDER[43:]], [*ORDER[:98], 99, 98]])
def test_messages_out_of_order_by_a_few_are_sorted(tmp_path: Path, swapped: list[int]) -> None:
    (run,) = read_log(motor(tmp_path / "a.ulg", GOOD, swapped), MOTOR, outputs=["temperature.motor"])
    np.testing.assert_allclose(run.temperature("motor"), 20 + 0.1 * np.array(ORDER), rtol=1e-6)
    assert any(note.startswith("motor: ") and "out of order" in note for note in run.notes)


@pytest.mark.parametrize("lost", [[0], [50, 51], [99], [3, 30, 60]])
def test_a_stamp_of_zero_is_none(tmp_path: Path, lost: list[int]) -> None:
    stamps = [0.0 if k in lost else stamp for k, stamp in enumerate(GOOD)]
    (run,) = read_log(motor(tmp_path / "a.ulg", stamps, ORDER), MOTOR, outputs=["temperature.motor"])
    assert run.time[0] == pytest.approx(5.0 + (0 in lost))
    readings = run.temperature("motor")
    np.testing.assert_allclose(readings, (20 + 0.1 * (run.time - 5.0))[: readings.size], rtol=1e-6, atol=0.051)
    assert f"motor: {len(lost)} message{'s' * (len(lost) > 1)} without a time; left out." in run.notes


@pytest.mark.parametrize(
    ("stamps", "number", "back"),
    [
        ([stamp - 30 * (k >= 60) for k, stamp in enumerate(GOOD)], 61, "35 s after 64 s"),
        ([5.0 + k % 50 for k in range(100)], 51, "5 s after 54 s"),
        ([stamp + 1e6 * (k == 70) for k, stamp in enumerate(GOOD)], 72, "76 s after 1000075 s"),
        ([stamp - 10 * (k == 20) for k, stamp in enumerate(GOOD)], 21, "15 s after 24 s"),
    ],
)
def test_a_clock_that_goes_back_is_refused_with_its_message(
    tmp_path: Path, refuse: Refuse, stamps: list[float], number: int, back: str
) -> None:
    path = motor(tmp_path / "a.ulg", stamps, ORDER)
    assert f"motor, message {number}: found {back}" in refuse(path, read_log, path, MOTOR)
    other = {"temperature.x": ColumnSource(("other.x",))}
    (run,) = read_log(path, other, outputs=["temperature.x"])  # whose own clock is right
    assert len(run) == 100
