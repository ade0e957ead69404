"""What reading makes of a log: runs on a grid, gaps, slow columns; and each fault as one line that says where it is."""

from __future__ import annotations

import gzip
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.basics.arrays import FloatArray
from lptn.basics.files import fingerprint
from lptn.logs.columns import ColumnSource
from lptn.logs.reading import read_log

Write = Callable[..., Path]


def seconds(n: int, period: float = 1.0) -> list[object]:
    return [round(period * k, 9) for k in range(n)]


def test_about_one_sample_a_step_is_interpolated(write: Write) -> None:
    torque = [-1.0, 2.0] * 10
    path = write({"time": seconds(20), "temperature.a": list(range(20)), "torque.a": torque})
    (run,) = read_log(path)
    assert (run.name, run.step, run.averaged, len(run)) == ("log", 1.0, False, 20)
    assert (run.source, run.fingerprint, run.notes) == (str(path), fingerprint(path), ())
    np.testing.assert_allclose(run.temperature("a"), np.arange(20.0), rtol=1e-12)
    np.testing.assert_allclose(run.columns["torque.a"], np.abs(torque), rtol=1e-12)


def test_jittered_samples_are_held_and_interpolated(write: Write) -> None:
    time = [0, 1, 2.5, *range(3, 15)]
    path = write({"time": time, "temperature.a": time, "torque.a": [1, 1, 3, *([0] * 12)]})
    (run,) = read_log(path)
    np.testing.assert_allclose(run.temperature("a"), np.arange(15.0), rtol=1e-12)
    np.testing.assert_allclose(run.columns["torque.a"][:4], [1, 1, np.sqrt(5.0), 0])


def test_many_samples_a_step_are_averaged(write: Write) -> None:
    rng = np.random.default_rng(0)
    torque, velocity = rng.normal(size=(2, 205)).round(6)
    temperature = (20 + rng.normal(size=205)).round(6)
    columns = {"temperature.a": temperature, "torque.a": torque, "velocity.a": velocity}
    path = write({"time": seconds(205, 0.1)} | {name: list(values) for name, values in columns.items()})
    (run,) = read_log(path, step=2.0)
    assert run.averaged
    assert len(run) == 10
    np.testing.assert_allclose(run.time, 2.0 * np.arange(10))

    def blocks(values: np.ndarray) -> np.ndarray:
        return np.asarray(values[:200].reshape(10, 20))

    np.testing.assert_allclose(run.temperature("a"), blocks(temperature).mean(axis=1), rtol=1e-9)
    np.testing.assert_allclose(run.columns["torque.a"] ** 2, (blocks(torque) ** 2).mean(axis=1), rtol=1e-9)
    np.testing.assert_allclose(run.columns["velocity.a"], np.abs(blocks(velocity)).mean(axis=1), rtol=1e-9)
    power = np.abs(blocks(torque) * blocks(velocity)).mean(axis=1)
    np.testing.assert_allclose(run.columns["mechanical_power.a"], power, rtol=1e-9)


@pytest.mark.parametrize(("period", "expected"), [(0.1, 1.0), (1.0, 1.0), (2.5004, 2.5)])
def test_the_step_comes_from_the_log(write: Write, period: float, expected: float) -> None:
    (run,) = read_log(write({"time": seconds(150, period), "temperature.a": [20.0] * 150}))
    assert run.step == expected


def test_a_step_below_the_sampling_period_is_not_taken(write: Write) -> None:
    (run,) = read_log(write({"time": seconds(20, 2.5), "temperature.a": [20.0] * 20}), step=1.0)
    assert run.step == 2.5
    assert run.notes == ("time: sampled every 2.5 s, so steps of 2.5 s are used in place of 1 s.",)


def test_repeated_stamps_keep_the_first(write: Write) -> None:
    path = write({"time": [0, *seconds(20)], "power.a": [7, 50, *([50] * 19)], "temperature.a": [20] * 21})
    (run,) = read_log(path)
    np.testing.assert_allclose(run.columns["power.a"][:2], [7, 50])
    assert "time: 1 of 21 rows repeat a time stamp; the first of each is kept." in run.notes


def test_missing_temperatures_stay_missing(write: Write) -> None:
    values: list[object] = [20.5, None, "nan", *([21.25] * 17)]
    (run,) = read_log(write({"time": seconds(20), "temperature.a": values, "torque.a": [1] * 20}))
    np.testing.assert_array_equal(run.temperature("a")[:4], [20.5, np.nan, np.nan, 21.25])
    assert "temperature.a: 2 of 20 readings are missing." in run.notes


def test_a_short_gap_in_an_input_is_bridged(write: Write) -> None:
    torque: list[object] = [*[2.0] * 5, *[None] * 3, *[1.0] * 12]
    (run,) = read_log(write({"time": seconds(20), "torque.a": torque, "temperature.a": [20.0] * 20}))
    np.testing.assert_allclose(run.columns["torque.a"], [2.0] * 8 + [1.0] * 12)
    assert run.notes == ("torque.a: 1 gap up to 4 s, bridged by holding the last value.",)


def test_a_long_gap_in_an_input_splits_the_log(write: Write) -> None:
    torque: list[object] = [*[2.0] * 15, *[None] * 20, *[1.0] * 15]
    path = write({"time": seconds(50), "torque.a": torque, "temperature.a": list(range(50))})
    first, second = read_log(path)
    assert (first.name, second.name) == ("log#1", "log#2")
    assert (len(first), len(second)) == (15, 15)
    assert second.time[0] == 35.0
    np.testing.assert_allclose(second.temperature("a"), np.arange(35.0, 50.0))
    assert "torque.a: 1 gap over 10 s, the longest 21 s; the log is split there." in second.notes
    (whole,) = read_log(path, max_gap=30.0)
    assert len(whole) == 50


def test_a_gap_in_time_splits_the_log_and_short_pieces_go(write: Write) -> None:
    time = [*range(20), *range(100, 105), *range(200, 220)]
    runs = read_log(write({"time": time, "temperature.a": [20.0] * 45}))
    assert [(run.name, run.time[0], len(run)) for run in runs] == [("log#1", 0.0, 20), ("log#2", 200.0, 20)]
    assert "log: 1 of 3 stretches hold fewer than 10 steps of 1 s; dropped." in runs[0].notes


def test_missing_inputs_at_the_ends_are_cut_off(write: Write) -> None:
    torque: list[object] = [*[None] * 3, *[1.0] * 15, *[None] * 2]
    (run,) = read_log(write({"time": seconds(20), "torque.a": torque, "temperature.a": list(range(20))}))
    assert (run.time[0], len(run)) == (3.0, 15)
    assert run.notes == ("torque.a: no value in the first 3 s and the last 2 s; cut off.",)


def test_a_temperature_that_drives_the_model_is_whole(write: Write) -> None:
    ambient: list[object] = [*[20.0] * 5, *[None] * 2, *[21.0] * 13]
    path = write({"time": seconds(20), "temperature.ambient": ambient, "temperature.a": list(range(20))})
    (run,) = read_log(path, inputs=["temperature.ambient"], outputs=["temperature.a"])
    np.testing.assert_allclose(run.temperature("ambient"), [20.0] * 7 + [21.0] * 13)


def test_only_what_is_asked_for_is_kept_and_judged(write: Write) -> None:
    columns: dict[str, list[object]] = {
        "t": seconds(20),
        "M": [-2.0] * 20,
        "w": ["broken"] * 20,
        "T": [20] * 20,
    }
    mapping = {
        "time": ColumnSource(("t",)),
        "torque.a": ColumnSource(("M",)),
        "velocity.a": ColumnSource(("w",)),
        "temperature.a": ColumnSource(("T",)),
    }
    (run,) = read_log(write(columns), mapping, inputs=["torque.a"], outputs=["temperature.a", "temperature.b"])
    assert set(run.columns) == {"torque.a", "temperature.a"}
    assert run.notes == ("temperature.b: not in the log, so not measured.",)


def test_an_empty_column_is_left_out(write: Write) -> None:
    path = write({"time": seconds(20), "temperature.a": [20] * 20, "torque.a": [None] * 20})
    (run,) = read_log(path)
    assert set(run.columns) == {"temperature.a"}
    assert run.notes == ("torque.a: no value in any row; left out.",)


def test_coarse_sensors_are_said(write: Write) -> None:
    values = [20] * 10 + [21] * 10
    path = write({"time": seconds(20), "temperature.a": values, "temperature.b": values})
    assert read_log(path)[0].notes == ("temperature.a, temperature.b: sensor steps of 1 K.",)


def test_parquet_gives_the_same_run(tmp_path: Path) -> None:
    frame = pd.DataFrame({"time": np.arange(30.0), "temperature.a": np.linspace(20, 30, 30, dtype=np.float32)})
    frame["torque.a"] = [1, 2, 3] * 10
    frame.to_parquet(tmp_path / "log.parquet")
    frame.astype(float).to_csv(tmp_path / "log.csv", index=False)
    (parquet,), (text,) = read_log(tmp_path / "log.parquet"), read_log(tmp_path / "log.csv")
    assert parquet.columns.keys() == text.columns.keys()
    for name, values in parquet.columns.items():
        np.testing.assert_allclose(values, text.columns[name], rtol=1e-12)


def test_a_run_written_to_parquet_reads_back(write: Write, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    columns = {
        "torque.a": rng.normal(size=200),
        "velocity.a": rng.normal(size=200),
        "temperature.a": np.ones(200),
    }
    path = write({"time": seconds(200, 0.1)} | {name: list(values) for name, values in columns.items()})
    (run,) = read_log(path)
    pd.DataFrame({"time": run.time, **run.columns}).to_parquet(tmp_path / "run.parquet")
    (again,) = read_log(tmp_path / "run.parquet")
    for name in ("torque.a", "velocity.a", "velocity_rms.a", "mechanical_power.a"):
        np.testing.assert_allclose(again.columns[name], run.columns[name], rtol=1e-12)


def test_parquet_time_stamps_become_seconds(tmp_path: Path) -> None:
    stamps = pd.date_range("2024-01-01", periods=20, freq="2s", tz="Europe/Berlin")
    pd.DataFrame({"time": stamps, "temperature.a": 20.0}).to_parquet(tmp_path / "log.parquet")
    (run,) = read_log(tmp_path / "log.parquet")
    assert (run.step, run.time[0]) == (2.0, 1704063600.0)
    pd.DataFrame({"time": stamps - stamps[0], "temperature.a": 20.0}).to_parquet(tmp_path / "log.parquet")
    (run,) = read_log(tmp_path / "log.parquet")
    assert (run.step, run.time[-1]) == (2.0, 38.0)


@pytest.mark.parametrize(
    ("separator", "comma", "start"),
    [
        (",", ".", "# made by hand\n"),
        (", ", ".", "\ufeff"),
        (";", ".", ""),
        (";", ",", ""),
        ("\t", ".", "\n\n"),
    ],
)
def test_csv_dialects(tmp_path: Path, separator: str, comma: str, start: str) -> None:
    rows = [f"{k}{separator}{20 + k / 4}".replace(".", comma) for k in range(20)]
    text = start + "\n".join([f"time{separator}temperature.a", *rows[:9], "# a remark", "", *rows[9:]])
    (tmp_path / "log.csv.gz").write_bytes(gzip.compress(text.encode()))
    (run,) = read_log(tmp_path / "log.csv.gz")
    assert run.name == "log"
    np.testing.assert_allclose(run.temperature("a"), 20 + np.arange(20) / 4)


def test_times_written_as_dates(write: Write) -> None:
    dates = [f"2026-01-01T00:00:{k:02d}.250" for k in range(20)]
    (run,) = read_log(write({"time": dates, "temperature.a": [20.0 + k for k in range(20)]}))
    assert run.step == 1.0
    assert run.time[0] == pd.Timestamp("2026-01-01T00:00:00.250Z").timestamp()


# --- Columns that are logged more seldom than the rest: held or averaged at their own rate, and no gap for it ---------


def every(n: int, period: int, values: list[float]) -> list[object]:
    """The values in every so manieth of n cells, the others empty."""
    return [values[k // period] if k % period == 0 else None for k in range(n)]


def test_one_reading_a_step_stands_for_its_moment_and_not_for_the_step(write: Write) -> None:
    slow = every(200, 5, [20 + 0.5 * k for k in range(40)])
    path = write({"time": list(range(200)), "temperature.a": slow, "torque.a": [1.0] * 200})
    (run,) = read_log(path, step=5.0)
    # 0.1 K/s: the mean over a step is 0.25 K above the reading at its start.
    np.testing.assert_allclose(run.temperature("a")[:-1], 20.25 + 0.5 * np.arange(39))
    assert "temperature.a: logged every 5 s." in run.notes


def test_steps_without_a_reading_stay_empty(write: Write) -> None:
    slow = every(200, 5, [20.0 + k for k in range(40)])
    slow[50] = slow[55] = None
    path = write({"time": list(range(200)), "temperature.a": slow, "torque.a": [1.0] * 200})
    (run,) = read_log(path, step=2.0)
    measured = np.flatnonzero(np.isfinite(run.temperature("a")))
    assert len(measured) == 38
    assert "temperature.a: logged every 5 s; 1 gap up to 15 s." in run.notes


@pytest.mark.parametrize("needed", [True, False])
def test_a_slow_input_is_held_and_does_not_split_the_log(write: Write, needed: bool) -> None:
    room = every(600, 60, [20.0 + k for k in range(10)])
    path = write(
        {"time": list(range(600)), "temperature.ambient": room, "temperature.a": [30.0] * 600, "torque.a": [1.0] * 600}
    )
    inputs = ["torque.a", "temperature.ambient"] if needed else ["torque.a"]
    (run,) = read_log(path, inputs=inputs, outputs=["temperature.a"], optional=["temperature.ambient"])
    assert len(run) == 600
    np.testing.assert_allclose(run.columns["temperature.ambient"][[0, 59, 60, 599]], [20.0, 20.0, 21.0, 29.0])
    assert "temperature.ambient: held between its readings." in run.notes


def test_a_slow_input_that_pauses_is_spared_or_splits(write: Write) -> None:
    room = every(600, 10, [20.0] * 30 + [22.0] * 30)
    for k in range(200, 300):
        room[k] = None
    path = write(
        {"time": list(range(600)), "temperature.ambient": room, "temperature.a": [30.0] * 600, "torque.a": [1.0] * 600}
    )
    both = ["torque.a", "temperature.ambient"]
    assert len(read_log(path, inputs=both, outputs=["temperature.a"])) == 2
    (run,) = read_log(path, inputs=["torque.a"], outputs=["temperature.a"], optional=["temperature.ambient"])
    assert not run.has("temperature.ambient")


@pytest.mark.parametrize(("after", "max_gap", "pieces"), [(20.4, None, 1), (21.6, None, 2), (20.4, 10.0, 2)])
def test_a_room_is_held_over_minutes_in_which_it_stays_as_it_was(
    write: Write, after: float, max_gap: float | None, pieces: int
) -> None:
    """The logger of the temperatures pauses, and the robot goes on; unless the user says what to bridge."""
    room: list[object] = [None if 200 <= k < 350 else 20.0 if k < 200 else after for k in range(600)]
    knee: list[object] = [None if 200 <= k < 350 else 30.0 for k in range(600)]
    columns = {"time": list(range(600)), "temperature.ambient": room, "temperature.a": knee, "torque.a": [1.0] * 600}
    both = ["torque.a", "temperature.ambient"]
    runs = read_log(write(columns), inputs=both, outputs=["temperature.a"], max_gap=max_gap)
    assert len(runs) == pieces
    if pieces == 1:
        assert runs[0].columns["temperature.ambient"][300] == 20.0
        assert "temperature.ambient: 1 gap up to 151 s, bridged by holding the last value." in runs[0].notes


def test_a_piece_begins_with_its_first_reading_and_one_without_any_is_dropped(write: Write) -> None:
    """The sensors' logger is silent from 100 to 280 s, that of the torque from 150 to 170 and 200 to 220 s."""
    knee = [None if 100 <= k < 280 else 30.0 for k in range(400)]
    torque = [None if 150 <= k < 170 or 200 <= k < 220 else 1.0 for k in range(400)]
    path = write({"time": list(range(400)), "temperature.a": knee, "torque.a": torque})
    first, last = read_log(path, inputs=["torque.a"], outputs=["temperature.a"])
    assert (first.name, last.name) == ("log#1", "log#3")
    assert last.time[0] == 280.0
    assert "log: cut to the first reading of a temperature: log#3 by 60 s." in first.notes
    assert "log: 1 of 3 stretches hold next to no reading of a node of the model; dropped." in first.notes
    assert np.isfinite(last.temperature("a")).all()


# --- Each fault of a log is one line that says where it is and what would be right ------------------------------------

Refuse = Callable[..., str]

TIME: list[object] = list(range(20))
GOOD: dict[str, list[object]] = {"time": TIME, "temperature.a": [20.0] * 20, "torque.a": [1.0] * 20}


def spoilt(column: str, row: int, value: object) -> dict[str, list[object]]:
    """The good log with one cell changed; row 0 is on line 2."""
    values = list(GOOD[column])
    values[row] = value
    return GOOD | {column: values}


@pytest.mark.parametrize(
    ("columns", "place", "actual", "expected"),
    [
        (spoilt("torque.a", 3, "off"), "line 5, column 'torque.a'", "'off'", "a number or an empty cell"),
        (spoilt("torque.a", 3, "inf"), "line 5, column 'torque.a'", "an infinite value", "a number"),
        (spoilt("torque.a", 3, 1e300), "line 5, column 'torque.a'", "1e+300", "a number within"),
        (spoilt("time", 3, None), "line 5, column 'time'", "no time", "a time in every row"),
        (spoilt("time", 3, "inf"), "line 5, column 'time'", "inf", "a time in every row"),
        (spoilt("time", 3, -9), "line 5, column 'time'", "-9 s after 2 s", "time that runs forwards"),
        (spoilt("temperature.a", 3, -300), "line 5, column 'temperature.a'", "-300 degC", "above -273.15"),
        (
            GOOD | {"temperature.a": [293, 333] * 10},
            "column 'temperature.a'",
            "values around 313",
            'unit = "K"',
        ),
        (GOOD | {"temperature.a": [45000] * 20}, "column 'temperature.a'", "values around 4.5e+04", "0.001"),
        (
            GOOD | {"time": [k * 1e9 for k in range(20)]},
            "column 'time'",
            "1e+09 s from row to row",
            'unit = "ns"',
        ),
        (  # each stamp in two rows
            {name: values * 2 for name, values in GOOD.items()} | {"time": [k // 2 * 1e9 for k in range(40)]},
            "column 'time'",
            "1e+09 s from row to row",
            'unit = "ns"',
        ),
        ({name: values[:9] for name, values in GOOD.items()}, "log", "9 rows", "at least 10"),
        ({name: [] for name in GOOD}, "log", "0 rows", "at least 10"),
        (GOOD | {"time": [1] * 20}, "log", "20 rows at 1 different times", "at least 10 at different times"),
        ({"time": TIME, "T1": [20] * 20}, "columns", "none that is known in: time, T1", "<quantity>.<place>"),
        (
            {"t": TIME, "torque.a": [1] * 20},
            "column time",
            "no such column; the log has: t, torque.a",
            "--map time=",
        ),
        (
            GOOD | {"time": [k + 100 * (k // 5) for k in range(20)]},
            "log",
            "at most 5 steps of 1 s",
            "at least 10",
        ),
        ({"0": TIME, "20.5": TIME}, "columns", "none that is known in: column 1, column 2", "<quantity>.<place>"),
        (
            {"time": TIME, "torque.a": [None] * 20},
            "column 'torque.a'",
            "no value in any row",
            "numbers for torque.a",
        ),
    ],
)
def test_a_fault_in_the_table(
    write: Write, refuse: Refuse, columns: dict[str, list[object]], place: str, actual: str, expected: str
) -> None:
    path = write(columns)
    line = refuse(path, read_log, path)
    assert line.startswith(f"{path}: {place}: found {actual}")
    assert expected in line.partition("; expected ")[2]


def test_lines_are_counted_past_comments_and_blanks(tmp_path: Path, refuse: Refuse) -> None:
    path = tmp_path / "log.csv"
    rows = [f"{k},{20 + k}" for k in range(20)]
    path.write_text("\n".join(["# remark", "", "time,temperature.a", *rows[:5], "# more", "", "5,2o.5", *rows[6:]]))
    assert "line 11, column 'temperature.a': found '2o.5'" in refuse(path, read_log, path)


@pytest.mark.parametrize(
    ("inputs", "outputs", "mapping", "place", "mend"),
    [
        (["torque.b"], [], {}, "column torque.b", "--map torque.b=YOURNAME"),
        (["torque.b"], [], {"torque.b": ColumnSource(("Q1_pct",))}, "column 'Q1_pct'", "--map torque.b="),
        (["velocity_rms.a"], [], {}, "column velocity.a (for velocity_rms.a)", "--map velocity.a="),
        (["mechanical_power.a"], [], {}, "column velocity.a (for mechanical_power.a)", "--map velocity.a="),
        (["mechanical_power.b"], [], {}, "column torque.b (for mechanical_power.b)", "--map torque.b="),
        (
            ["torque.a"],
            ["temperature.b", "temperature.c"],
            {},
            "column temperature.b",
            "--map temperature.b=",
        ),
        ([], [], {"torque.b": ColumnSource(("typo",))}, "column 'typo'", "--map torque.b="),
    ],
)
def test_a_missing_column(
    write: Write,
    refuse: Refuse,
    inputs: list[str],
    outputs: list[str],
    mapping: Mapping[str, ColumnSource],
    place: str,
    mend: str,
) -> None:
    path = write(GOOD)
    line = refuse(path, read_log, path, mapping, inputs=inputs, outputs=outputs)
    assert f"{path}: {place}: found no such column; the log has: time, temperature.a, torque.a; expected" in line
    assert f"or a line in [columns] / {mend}" in line


def test_an_input_without_values_is_named(write: Write, refuse: Refuse) -> None:
    path = write(GOOD | {"torque.a": [None] * 20, "temperature.a": [None] * 20})
    line = refuse(path, read_log, path, inputs=["torque.a"], outputs=["temperature.a"])
    assert "column 'torque.a': found no value in any row; expected numbers for torque.a" in line


def test_kelvin_with_its_unit_is_fine(write: Write) -> None:
    path = write(GOOD | {"temperature.a": [300.0] * 20})
    (run,) = read_log(path, {"temperature.a": ColumnSource(("temperature.a",), "K")})
    assert run.temperature("a")[0] == pytest.approx(26.85)


@pytest.mark.parametrize(
    ("options", "actual"),
    [
        ({"step": 0.0}, "step: found 0 s"),
        ({"max_gap": -1.0}, "max_gap: found -1 s"),
        ({"max_gap": 1.0}, "1 s"),
    ],
)
def test_wrong_options(write: Write, refuse: Refuse, options: dict[str, float], actual: str) -> None:
    path = write(GOOD)
    assert actual in refuse(path, read_log, path, **options)


def test_a_name_that_stands_twice_is_refused_when_needed(tmp_path: Path, refuse: Refuse) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,temperature.a,x,x\n" + "".join(f"{k},20,1,2\n" for k in range(20)))
    assert len(read_log(path)) == 1
    line = refuse(path, read_log, path, {"torque.a": ColumnSource(("x",))})
    assert "column 'x': found that name more than once" in line


def test_files_that_are_no_logs(tmp_path: Path, refuse: Refuse) -> None:
    (tmp_path / "log.docx").write_text("x")
    (tmp_path / "log.xlsx").write_text("x")
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x81" * 50)
    (tmp_path / "folder.csv").mkdir()
    for name, actual in [
        ("none.csv", "no such file"),
        ("folder.csv", "a folder"),
        ("log.docx", "the ending '.docx'"),
        ("log.xlsx", "a broken file"),
        ("empty.csv", "an empty file"),
        ("binary.csv", "a file that can't be read"),
    ]:
        assert f"log: found {actual}" in refuse(tmp_path / name, read_log, tmp_path / name)


def test_truncated_files(tmp_path: Path, refuse: Refuse) -> None:
    pd.DataFrame(GOOD).to_parquet(tmp_path / "log.parquet")
    text = "time,temperature.a\n" + "".join(f"{k},{20 + k % 7 / 3}\n" for k in range(5000))
    (tmp_path / "log.csv.gz").write_bytes(gzip.compress(text.encode()))
    for path in (tmp_path / "log.parquet", tmp_path / "log.csv.gz"):
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        assert "log: found a " in refuse(path, read_log, path)


def test_a_decimal_comma_between_commas(tmp_path: Path, refuse: Refuse) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,temperature.a\n" + "".join(f"{k},0,20,5\n" for k in range(20)))
    assert "header: found 4 values in the first row under 2 names" in refuse(path, read_log, path)
    path.write_text("time,temperature.a\n" + "".join(f"{k},20,5\n" for k in range(20)))
    assert "header: found 3 values in the first row under 2 names" in refuse(path, read_log, path)


def test_two_empty_cells_beyond_the_header(tmp_path: Path, refuse: Refuse) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,temperature.a\n" + "".join(f"{k},20,,\n" for k in range(20)))
    assert "header: found 4 values in the first row under 2 names" in refuse(path, read_log, path)


def test_a_separator_at_the_end_of_each_row_is_fine(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,temperature.a\n" + "".join(f"{k},20,\n" for k in range(20)))
    assert read_log(path)[0].temperature("a")[0] == 20.0


def test_a_row_longer_than_the_header(tmp_path: Path, refuse: Refuse) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,temperature.a\n" + "1,20\n" * 5 + "2,20,30,40\n" + "3,20\n" * 5)
    assert "line 7" in refuse(path, read_log, path)


def test_parquet_rows_are_counted_from_one(tmp_path: Path, refuse: Refuse) -> None:
    path = tmp_path / "log.parquet"
    pd.DataFrame(GOOD | {"torque.a": ["1"] * 10 + ["off"] * 10}).to_parquet(path)
    assert "row 11, column 'torque.a': found 'off'" in refuse(path, read_log, path)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("time", [1e308 * (-1.0) ** np.arange(60), np.full(60, np.inf), 1e300 * np.arange(60)])
def test_times_that_no_clock_has_are_refused_without_a_warning(refuse: Refuse, time: FloatArray) -> None:
    frame = pd.DataFrame({"time": time, "temperature.a": 20 + np.arange(60) / 60, "current.a": 2.0})
    assert "a time in every row" in refuse("data frame", read_log, frame)
