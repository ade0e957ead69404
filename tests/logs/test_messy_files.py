"""Text and clocks as loggers and spreadsheets leave them: other characters, words among numbers, coarse times."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.logs.columns import parse_columns
from lptn.logs.reading import open_table, read_log
from tests.logs.conftest import Refuse

N = 40
NAMES = "time,torque.a,temperature.a"
ROWS = [f"{k},{k % 7},{20 + 0.25 * k}" for k in range(N)]
TRUE = 20 + 0.25 * np.arange(N)


@pytest.mark.parametrize("encoding", ["cp1252", "utf-16", "utf-16-le", "utf-8-sig"])
def test_text_that_is_not_in_utf_8(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "log.csv"
    text = "\n".join(["time,torque.a,Motor [°C]", *ROWS]) + "\n"
    mark = b"\xff\xfe" if encoding == "utf-16-le" else b""
    path.write_bytes(mark + text.encode(encoding))
    columns = parse_columns({"temperature.a": {"column": "Motor [°C]", "unit": "degC"}}, path, "[columns]")
    (run,) = read_log(path, columns)
    assert run.columns["temperature.a"] == pytest.approx(TRUE)
    assert any("is read as" in note for note in run.notes) == (encoding != "utf-8-sig")


@pytest.mark.parametrize("decimal", [".", ","])
def test_rows_of_words_are_no_rows(tmp_path: Path, decimal: str) -> None:
    path = tmp_path / "log.csv"
    rows = [NAMES, *ROWS[:9], NAMES, *ROWS[9:20], "ERROR: no bus", "", *ROWS[20:], "END OF LOG", "\0\0\0"]
    if decimal == ",":
        rows = [row.replace(",", ";") if row == NAMES else row.replace(",", ";").replace(".", ",") for row in rows]
    path.write_text("\n".join(rows))
    (run,) = read_log(path)
    assert run.columns["temperature.a"] == pytest.approx(TRUE)
    assert any("words and no number" in note for note in run.notes)


def test_after_rows_of_words_lines_are_counted_in_the_file(tmp_path: Path, refuse: Refuse) -> None:
    path = tmp_path / "log.csv"
    path.write_text("\n".join([NAMES, *ROWS[:9], NAMES, *ROWS[9:20], "20,1,2o.5", *ROWS[21:], ""]))
    assert "line 23, column 'temperature.a': found '2o.5'" in refuse(path, read_log, path)


def test_a_sensors_words_are_no_readings(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("\n".join([NAMES, *ROWS[:9], "9,2,ERR", "10,3,--", *ROWS[11:], ""]))
    (run,) = read_log(path)
    assert np.isfinite(run.columns["temperature.a"][11:]).all()
    assert any("2 cells hold a word ('ERR', '--')" in note for note in run.notes)


@pytest.mark.parametrize(
    "form",
    ["%d.%m.%Y %H:%M:%S", "%m/%d/%Y %I:%M:%S %p", "%d/%m/%Y %H:%M:%S.%f", "%Y-%m-%d %H:%M:%S", "%Y/%m/%d %H:%M:%S"],
)
@pytest.mark.parametrize("begin", ["2026-11-03 23:59:50", "2026-11-23 11:59:50", "2026-01-31 23:59:50"])
def test_dates_of_many_countries(tmp_path: Path, form: str, begin: str) -> None:
    path = tmp_path / "log.csv"
    times = (pd.Timestamp(begin) + pd.to_timedelta(np.arange(N), unit="s")).strftime(form)
    rows = [f"{time},{row.partition(',')[2]}" for time, row in zip(times, ROWS, strict=True)]
    path.write_text("\n".join([NAMES, *rows, ""]))
    (run,) = read_log(path)
    assert np.diff(run.time) == pytest.approx(1.0)
    assert run.time.size == N


def test_a_clock_of_the_day_past_midnight(tmp_path: Path, refuse: Refuse) -> None:
    path = tmp_path / "log.csv"
    times = (pd.Timestamp("2026-11-03 23:59:50") + pd.to_timedelta(np.arange(N), unit="s")).strftime("%H:%M:%S")
    rows = [f"{time},{row.partition(',')[2]}" for time, row in zip(times, ROWS, strict=True)]
    path.write_text("\n".join([NAMES, *rows, ""]))
    line = refuse(path, read_log, path)
    assert 'time = { column = "time", wrap = 86400 }' in line
    columns = parse_columns({"time": {"column": "time", "wrap": 86400}}, path, "[columns]")
    (run,) = read_log(path, columns)
    assert run.time[-1] - run.time[0] == pytest.approx(N - 1)


# --- Clocks that are coarser than the rows -----------------------------------------------------------


def _fast(rate: int = 10, seconds: int = 60) -> pd.DataFrame:
    rng = np.random.default_rng(1)
    time = np.arange(rate * seconds) / rate
    torque = rng.normal(0, 3, time.size)
    return pd.DataFrame(
        {"time": time, "torque.a": torque, "temperature.a": 20 + 0.1 * time + rng.normal(0, 0.05, time.size)}
    )


def test_rows_within_a_whole_second_all_count() -> None:
    log = _fast()
    (fine,) = read_log(log)
    (coarse,) = read_log(log.assign(time=np.floor(log["time"])))
    assert coarse.columns["torque.a"] == pytest.approx(fine.columns["torque.a"])
    assert coarse.columns["temperature.a"] == pytest.approx(fine.columns["temperature.a"])
    assert any("spread evenly" in note for note in coarse.notes)


def test_rows_that_are_there_twice_count_once() -> None:
    log = _fast(rate=1)
    (once,) = read_log(log)
    (twice,) = read_log(log.loc[log.index.repeat(2)].reset_index(drop=True))
    assert twice.columns["temperature.a"] == pytest.approx(once.columns["temperature.a"])
    assert any("repeat a time stamp" in note for note in twice.notes)


def test_a_clock_that_lost_its_digits_is_refused(refuse: Refuse) -> None:
    log = _fast(seconds=3000)
    log["time"] = (1_763_900_000 + log["time"]).to_numpy(dtype=np.float32).astype(float)
    line = refuse("data frame", read_log, log)
    assert "128 s apart" in line
    assert "time = { rate = 9.99 }" in line


def test_rows_of_two_devices_are_refused(refuse: Refuse) -> None:
    log = _fast(rate=1)
    other = log.assign(**{"temperature.a": log["temperature.a"] + 5})
    both = pd.concat([log, other]).sort_values("time", kind="stable").reset_index(drop=True)
    assert "2 rows at each time, in which temperature.a differs by 5" in refuse("data frame", read_log, both)


def test_a_line_of_names_without_an_end_is_no_empty_file(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,torque.a,temperature.a")
    assert open_table(path).names == ("time", "torque.a", "temperature.a")
