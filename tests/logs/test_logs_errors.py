"""Each fault of a log is one line that says where it is and what would be right."""

from __future__ import annotations

import gzip
from collections.abc import Callable, Mapping
from pathlib import Path

import pandas as pd
import pytest

from lptn.logs.columns import ColumnSource
from lptn.logs.reading import read_log

Write = Callable[..., Path]
Refuse = Callable[..., str]

TIME: list[object] = list(range(20))
GOOD: dict[str, list[object]] = {"time": TIME, "temperature.a": [20.0] * 20, "torque.a": [1.0] * 20}


def spoilt(column: str, row: int, value: object) -> dict[str, list[object]]:
    """The good log with one cell changed; row 0 is on line 2."""
    values = list(GOOD[column])
    values[row] = value
    return GOOD | {column: values}


@pytest.mark.parametrize(
    ("columns", "place", "found", "expected"),
    [
        (spoilt("torque.a", 3, "off"), "line 5, column 'torque.a'", "'off'", "a number or an empty cell"),
        (spoilt("torque.a", 3, "inf"), "line 5, column 'torque.a'", "an infinite value", "a number"),
        (spoilt("torque.a", 3, 1e300), "line 5, column 'torque.a'", "1e+300", "a number within"),
        (spoilt("time", 3, None), "line 5, column 'time'", "no time", "a time in every row"),
        (spoilt("time", 3, "inf"), "line 5, column 'time'", "inf", "a time in every row"),
        (spoilt("time", 3, 1.5), "line 5, column 'time'", "1.5 s after 2 s", "time that runs forwards"),
        (spoilt("temperature.a", 3, -300), "line 5, column 'temperature.a'", "-300 degC", "above -273.15"),
        (
            GOOD | {"temperature.a": [293, 333] * 10},
            "column 'temperature.a'",
            "values 293 … 333",
            'unit = "K"',
        ),
        (GOOD | {"temperature.a": [45000] * 20}, "column 'temperature.a'", "values around 4.5e+04", "0.001"),
        (
            GOOD | {"time": [k * 1e9 for k in range(20)]},
            "column 'time'",
            "1e+09 s from row to row",
            "seconds",
        ),
        ({name: values[:9] for name, values in GOOD.items()}, "log", "9 rows", "at least 10"),
        ({name: [] for name in GOOD}, "log", "0 rows", "at least 10"),
        (GOOD | {"time": [1] * 20}, "log", "1 rows", "at least 10 at different times"),
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
        ({"0": TIME, "20.5": TIME}, "header", "numbers (0, 20.5)", "a line of column names"),
        (
            {"time": TIME, "torque.a": [None] * 20},
            "column 'torque.a'",
            "no value in any row",
            "numbers for torque.a",
        ),
    ],
)
def test_a_fault_in_the_table(
    write: Write, refuse: Refuse, columns: dict[str, list[object]], place: str, found: str, expected: str
) -> None:
    path = write(columns)
    line = refuse(path, read_log, path)
    assert line.startswith(f"{path}: {place}: found {found}")
    assert expected in line.partition("; expected ")[2]


def test_lines_are_counted_past_comments_and_blanks(tmp_path: Path, refuse: Refuse) -> None:
    path = tmp_path / "log.csv"
    rows = [f"{k},{20 + k}" for k in range(20)]
    path.write_text("\n".join(["# remark", "", "time,temperature.a", *rows[:5], "# more", "", "5,hot", *rows[6:]]))
    assert "line 11, column 'temperature.a': found 'hot'" in refuse(path, read_log, path)


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
    ("options", "found"),
    [
        ({"step": 0.0}, "step: found 0 s"),
        ({"max_gap": -1.0}, "max_gap: found -1 s"),
        ({"max_gap": 1.0}, "1 s"),
    ],
)
def test_wrong_options(write: Write, refuse: Refuse, options: dict[str, float], found: str) -> None:
    path = write(GOOD)
    assert found in refuse(path, read_log, path, **options)


def test_a_name_that_stands_twice_is_refused_when_needed(tmp_path: Path, refuse: Refuse) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,temperature.a,x,x\n" + "".join(f"{k},20,1,2\n" for k in range(20)))
    assert len(read_log(path)) == 1
    line = refuse(path, read_log, path, {"torque.a": ColumnSource(("x",))})
    assert "column 'x': found that name more than once" in line


def test_files_that_are_no_logs(tmp_path: Path, refuse: Refuse) -> None:
    (tmp_path / "log.xlsx").write_text("x")
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x81" * 50)
    (tmp_path / "folder.csv").mkdir()
    for name, found in [
        ("none.csv", "no such file"),
        ("folder.csv", "a folder"),
        ("log.xlsx", "the ending '.xlsx'"),
        ("empty.csv", "an empty file"),
        ("binary.csv", "a file that can't be read"),
    ]:
        assert f"log: found {found}" in refuse(tmp_path / name, read_log, tmp_path / name)


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
