"""Remedies are tried on the log before they are proposed, beside its air; where several fit all are named."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.logs.columns import ColumnSource, parse_columns
from lptn.logs.guess import guess
from lptn.logs.reading import read_log
from lptn.logs.tables import table_of

N = 3000
TIME = np.arange(N, dtype=float)
LOAD = np.repeat(np.random.default_rng(1).choice([0.0, 2.0, 4.0, 6.0], N // 60), 60)


def warmed(air: float, start: float | None = None) -> FloatArray:
    """300 J/K behind 5 K/W, at I² 0.2 ohm."""
    rise = np.empty(N)
    rise[0] = 0.0 if start is None else start - air
    for k in range(N - 1):
        rise[k + 1] = rise[k] + (0.2 * LOAD[k] ** 2 - rise[k] / 5) / 300
    return air + rise


def log(knee: FloatArray, air: float | None, **others: FloatArray) -> pd.DataFrame:
    columns: dict[str, object] = {"time": TIME, "temperature.knee": knee, "current.knee": LOAD}
    columns |= {f"temperature.{name}": values for name, values in others.items()}
    return pd.DataFrame(columns | ({} if air is None else {"temperature.ambient": air}))


def refused(frame: pd.DataFrame, columns: dict[str, ColumnSource] | None = None) -> str:
    with pytest.raises(InputError) as caught:
        read_log(frame, columns)
    return str(caught.value)


def proposals(said: str) -> list[str]:
    return re.findall(r'("temperature\.\w+" = \{[^}]*\})', said)


def pasted(line: str) -> dict[str, ColumnSource]:
    return parse_columns(tomllib.loads(line), "m.toml", "[columns]")


def first_pasted(frame: pd.DataFrame, times: int = 1) -> tuple[dict[str, ColumnSource], FloatArray]:
    """The first proposals of so many messages in turn, and what is read then."""
    columns: dict[str, ColumnSource] = {}
    for _ in range(times):
        columns |= pasted(proposals(refused(frame, columns))[0])
    (run,) = read_log(frame, columns)
    return columns, run.columns["temperature.knee"]


@pytest.mark.parametrize("air", [-25.0, -15.0, -5.0, 5.0, 25.0])
def test_a_counter_of_a_byte_begins_at_the_air(air: float) -> None:
    truth = warmed(air)
    frame = log(np.round(truth) % 256, air)
    if air > 0:
        (run,) = read_log(frame)
        assert run.columns["temperature.knee"] == pytest.approx(truth, abs=0.6)
        return
    columns, knee = first_pasted(frame)
    assert knee == pytest.approx(truth, abs=0.6)
    assert columns["temperature.knee"].wrap == 256
    # Who has written the counter, but not its turn, is told of the turn.
    half = {"temperature.knee": ColumnSource(("temperature.knee",), wrap=256)}
    assert "offset = -256" in proposals(refused(frame, half))[0]


def test_a_counter_in_a_unit_of_the_user_s_keeps_it() -> None:
    truth = warmed(-5.0)
    frame = log(np.round(10 * truth) % 65536, -5.0)
    said = refused(frame, {"temperature.knee": ColumnSource(("temperature.knee",), "degC", scale=0.1)})
    assert 'unit = "degC", scale = 0.1, offset = -6553.6, wrap = 65536' in said
    (run,) = read_log(frame, pasted(proposals(said)[0]))
    assert run.columns["temperature.knee"] == pytest.approx(truth, abs=0.06)


@pytest.mark.parametrize(("parts", "air"), [(10, 25.0), (10, 21.0), (10, 33.0), (100, 25.0)])
def test_parts_of_a_degree_stand_before_kelvin_where_the_air_says_so(parts: int, air: float) -> None:
    truth = warmed(air)
    frame = log(np.round(parts * truth), air)
    _, knee = first_pasted(frame)
    assert knee == pytest.approx(truth, abs=0.6 / parts)
    said = refused(frame)
    if parts == 10:
        assert 'unit = "K"' in proposals(said)[1]
        assert ("below" in said) == (air < 30)  # of 33 degC it would be a warm robot's


@pytest.mark.parametrize("air", [None, 5.0, 22.0])
@pytest.mark.parametrize("step", [0.0, 1.0])
def test_kelvin_stands_first_where_it_fits(air: float | None, step: float) -> None:
    truth = warmed(22.0 if air is None else air) + 273.15
    _, knee = first_pasted(log(np.round(truth) if step else truth, air))
    assert knee == pytest.approx(truth - 273.15, abs=0.6)


def test_where_nothing_else_is_logged_both_are_named() -> None:
    truth = np.round(10 * warmed(25.0))
    for frame in (log(truth, None), log(truth, 250.0)):
        lines = proposals(refused(frame))
        assert "scale = 0.1" in lines[0]
        assert 'unit = "K"' in lines[1]
    # What was said of the one decides the other.
    tenths = {"temperature.knee": ColumnSource(("temperature.knee",), scale=0.1)}
    assert "scale = 0.1" in proposals(refused(log(truth, 250.0), tenths))[0]
    kelvin = {"temperature.knee": ColumnSource(("temperature.knee",), "K")}
    assert 'unit = "K"' in proposals(refused(log(truth, 250.0), kelvin))[0]


def test_another_sensor_says_where_a_robot_begins() -> None:
    truth = warmed(25.0)
    frame = log(np.round(10 * truth), None, hip=25 + 0.001 * TIME)
    assert "scale = 0.1" in proposals(refused(frame))[0]
    warm = log(warmed(20.0, 55.0) + 273.15, 20.0)
    _, knee = first_pasted(warm)
    assert knee == pytest.approx(warmed(20.0, 55.0))


def test_a_guess_takes_no_unit_that_the_air_contradicts() -> None:
    truth = warmed(25.0)
    frame = log(np.round(10 * truth), 25.0).rename(columns={"temperature.knee": "knee_temp"})
    wanted = ["temperature.ambient", "current.knee"], ["temperature.knee"]
    (guessed,) = guess(table_of(frame, "log"), {}, *wanted)
    assert (guessed.source.unit, guessed.source.scale) == (None, 0.1)
    (guessed,) = guess(table_of(frame.drop(columns="temperature.ambient"), "log"), {}, *wanted)
    assert (guessed.source.unit, guessed.source.scale) == (None, 1.0)  # open, and asked for


def test_files_are_told_alike(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    log(np.round(10 * warmed(25.0)), 25.0).to_csv(path, index=False)
    with pytest.raises(InputError, match=r"scale = 0\.1"):
        read_log(path)


@pytest.mark.parametrize(("parts", "air"), [(10, 22.0), (100, 19.0), (10, 4.0), (1000, 25.0)])
def test_parts_of_a_kelvin_are_read_as_such(parts: int, air: float) -> None:
    """Batteries' gauges log tenths of a kelvin."""
    truth = warmed(air)
    columns, knee = first_pasted(log(np.round(parts * (truth + 273.15)), air))
    assert columns["temperature.knee"].unit == "K"
    assert knee == pytest.approx(truth, abs=0.6 / parts)


@pytest.mark.parametrize(
    ("parts", "turn", "air"), [(16, 65536.0, -9.0), (10, 65536.0, -20.0), (100, 65536.0, -4.0), (1, 256.0, -2.0)]
)
def test_a_counter_below_zero_may_count_parts_of_a_degree(parts: int, turn: float, air: float) -> None:
    truth = warmed(air)
    columns, knee = first_pasted(log(np.round(parts * truth) % turn, air))
    assert columns["temperature.knee"].wrap == turn
    assert knee == pytest.approx(truth, abs=0.6 / parts)


def test_a_counter_that_passes_its_end_once_is_no_code() -> None:
    """Of the numbers beyond the end of its range there are four."""
    truth = np.minimum(-8 + 0.004 * TIME, 3.0)
    columns, knee = first_pasted(log(np.asarray(np.round(truth) % 256, np.float64), -8.0))
    assert columns["temperature.knee"].wrap == 256
    assert knee == pytest.approx(truth, abs=0.6)


@pytest.mark.parametrize(
    ("stated", "as_written", "air"),
    [
        ("degF", lambda x: x, 22.0),
        ("degF", lambda x: x + 273.15, -9.0),
        ("K", lambda x: 1.8 * x + 32, 18.0),
        ("K", lambda x: np.round(10 * x), 25.0),
    ],
    ids=["degC as degF", "K as degF", "degF as K", "tenths of a degree as K"],
)
def test_a_unit_by_which_a_robot_begins_far_from_its_air_is_doubted(
    stated: str, as_written: Callable[[FloatArray], FloatArray], air: float
) -> None:
    truth = warmed(air)
    key = "temperature.knee"
    (run,) = read_log(log(as_written(truth), air), {key: ColumnSource((key,), stated)}, strict=False)
    (issue,) = run.issues
    line = proposals(issue.remedy)[0]
    (run,) = read_log(log(as_written(truth), air), pasted(line), strict=False)
    assert run.columns[key] == pytest.approx(truth, abs=0.06)
    assert not run.issues


@pytest.mark.parametrize(("air", "start"), [(22.0, 80.0), (22.0, 15.0), (-20.0, 20.0), (30.0, 85.0)])
def test_a_unit_that_is_stated_is_believed_of_robots_that_begin_warm_or_cold(air: float, start: float) -> None:
    key = "temperature.knee"
    truth = warmed(air, start)
    for unit, as_written in (("degC", truth), ("K", truth + 273.15), ("degF", 1.8 * truth + 32)):
        (run,) = read_log(log(as_written, air), {key: ColumnSource((key,), unit)}, strict=False)
        assert not run.issues
