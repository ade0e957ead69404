"""One clock of all stamps, and rows as `read_log` makes them of the finished log."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.identify.data import load_model
from lptn.live.sampling import Clock, Columns, Rows, Sampler
from lptn.logs.columns import ColumnSource
from lptn.logs.reading import read_log
from tests.live.robot import log, model_file

INPUTS = ["temperature.ambient", "torque.knee", "torque.hip"]
OUTPUTS = ["temperature.knee", "temperature.hip"]
SOURCES = {key: ColumnSource((key,)) for key in (*INPUTS, *OUTPUTS)}

# --- the clock ------------------------------------------------------------------------------------


def times(clock: Clock, stamps: list[float], received: list[float]) -> list[float]:
    return list(clock.of(np.array(stamps, dtype=float), np.array(received, dtype=float)))


@pytest.mark.parametrize("jump", [-3600.0, -1.7e9, 3600.0, 1.7e9])
def test_a_live_clock_that_jumps_goes_on_by_the_time_that_passed(jump: float) -> None:
    clock = Clock(live=True)
    first, last = times(clock, [0, 1, 2], [50, 51, 52])[::2]
    after = times(clock, [2.5 + jump, 3.5 + jump], [52.5, 53.5])
    np.testing.assert_allclose([first, last, *after], [0, 2, 2.5, 3.5])
    assert clock.jumps == 1
    assert times(clock, [4.5 + jump], [54.5]) == pytest.approx([4.5])
    assert clock.jumps == 1


def test_silence_is_a_gap_and_no_jump() -> None:
    clock = Clock(live=True)
    assert times(clock, [0, 1, 61], [50, 51, 111]) == [0, 1, 61]
    assert clock.jumps == 0


def test_a_file_says_by_its_stamps_alone_how_long_a_gap_is() -> None:
    clock = Clock(live=False)
    assert times(clock, [0, 1, 3601], [50, 50, 50]) == [0, 1, 3601]
    assert times(clock, [0, 1], [50, 50]) == [3601, 3602]  # its logger was started anew
    assert clock.jumps == 1


def test_a_late_message_is_taken_for_one_of_now() -> None:
    clock = Clock(live=True)
    assert times(clock, [0, 1, 0.9, 1.1, np.nan], [50, 51, 51, 51.1, 51.2]) == [0, 1, 1, 1.1, 1.1]
    assert (clock.late, clock.jumps) == (1, 0)


# --- rows -----------------------------------------------------------------------------------------


def rows_of(frame: pd.DataFrame, size: int, step: float = 1.0) -> tuple[list[Rows], Sampler]:
    """A log given in portions of some rows."""
    sampler, found = Sampler(INPUTS, OUTPUTS, SOURCES, step), list[Rows]()
    for first in range(0, len(frame), size):
        part = frame.iloc[first : first + size]
        raw = {key: part[key].to_numpy(float) for key in (*INPUTS, *OUTPUTS)}
        found += sampler.add(part["time"].to_numpy(float), raw)
    return [*found, *sampler.add(np.zeros(0), {}, end=True)], sampler


def joined(found: list[Rows], name: str) -> FloatArray:
    return np.concatenate([rows.time if name == "time" else rows.columns[name] for rows in found])


@pytest.mark.parametrize(("rate", "size"), [(1.0, 7), (20.0, 13), (20.0, 200), (0.25, 3)])
def test_rows_are_those_of_the_finished_log(rate: float, size: int) -> None:
    frame = log(240, rate)
    frame.loc[frame.index % 20 > 0, "temperature.hip"] = np.nan  # read more seldom than the rest
    found, sampler = rows_of(frame, size)
    (run,) = read_log(frame, {"time": ColumnSource(("time",), rows="samples")}, inputs=INPUTS, outputs=OUTPUTS)
    assert (sampler.averaged, sampler.step) == (run.averaged, run.step)
    np.testing.assert_allclose(joined(found, "time"), run.time)
    for column in (*INPUTS, "temperature.knee"):
        np.testing.assert_allclose(joined(found, column), run.columns[column], atol=1e-12)
    if rate > 1:
        np.testing.assert_allclose(joined(found, "temperature.hip")[1:-2], run.temperature("hip")[1:-2], atol=1e-12)


def test_rows_begin_anew_behind_a_gap_of_an_input() -> None:
    frame = log(120, 20.0)
    silent = (frame["time"] > 40) & (frame["time"] < 70)
    frame.loc[silent, "torque.knee"] = np.nan
    found, _ = rows_of(frame, 50)
    firsts = [float(rows.time[0]) for rows in found if rows.first]
    assert firsts == [0, 70]
    assert not ((joined(found, "time") > 51) & (joined(found, "time") < 70)).any()


def test_what_holds_afterwards_bridges_a_silent_input() -> None:
    frame = log(120, 20.0)
    frame.loc[frame["time"] > 40, "torque.knee"] = np.nan
    sampler = Sampler(INPUTS, OUTPUTS, SOURCES | {"torque.knee": ColumnSource(("t",), afterwards=0.0)}, 1.0)
    found = sampler.add(frame["time"].to_numpy(float), {key: frame[key].to_numpy(float) for key in SOURCES})
    assert sampler.missing == ()
    torque = joined(found, "torque.knee")
    np.testing.assert_allclose(torque[:40], 9.0)
    np.testing.assert_allclose(torque[55:], 0.0)


def test_what_is_sent_on_change_stands_until_the_next() -> None:
    sources = SOURCES | {"torque.knee": ColumnSource(("torque.knee",), hold=True)}
    sampler = Sampler(INPUTS, OUTPUTS, sources, 1.0)
    time = np.arange(0.0, 600.0, 0.1)
    raw = {key: np.full(time.size, 20.0) for key in (*INPUTS, *OUTPUTS)}
    raw["torque.knee"] = np.where(np.isclose(time % 200, 0), 1 + time // 200, np.nan)  # each 200 s
    rows = [row for k in range(0, time.size, 700) for row in sampler.add(time[k : k + 700],
            {key: x[k : k + 700] for key, x in raw.items()}, end=k + 700 >= time.size)]  # fmt: skip
    assert not sampler.missing
    assert sum(row.first for row in rows) == 1
    np.testing.assert_allclose(joined(rows, "torque.knee"), 1 + (joined(rows, "time") + 1e-6) // 200)


def test_a_silent_input_is_named() -> None:
    frame = log(60, 20.0)
    frame.loc[frame["time"] > 20, "torque.hip"] = np.nan
    _, sampler = rows_of(frame, 50)
    assert sampler.missing == ("torque.hip",)


# --- columns --------------------------------------------------------------------------------------


def columns_of(tmp_path: Path, *mapped: str) -> Columns:
    return Columns(load_model(model_file(tmp_path), mapped), "udp", {})


MESSAGE = {"temperature.ambient": 22, "torque.knee": 1.0, "torque.hip": -1.0, "temperature.knee": 30, "T2": 86.0}


def test_units_and_names_are_those_of_the_mapping(tmp_path: Path) -> None:
    columns = columns_of(tmp_path, "temperature.hip=T2[degF]")
    said = columns.learn([(MESSAGE | {"time": 0.5}, 100.0)])
    assert any("temperature.hip is T2" in note for note in said)
    values, received = columns.values([MESSAGE | {"time": 1.5}, MESSAGE | {"time": 2.5, "T2": None}], np.arange(2.0))
    np.testing.assert_allclose(values["temperature.hip"], [30.0, np.nan])
    np.testing.assert_allclose(values["time"], [1.5, 2.5])
    assert received.tolist() == [0, 1]


def test_messages_without_time_have_that_of_their_reception(tmp_path: Path) -> None:
    columns = columns_of(tmp_path, "temperature.hip=T2")
    assert any("reception" in note for note in columns.learn([(MESSAGE, 100.0)]))
    assert columns.values([MESSAGE], np.array([123.0]))[0]["time"].tolist() == [123.0]


def test_quantities_may_come_in_messages_of_their_own(tmp_path: Path) -> None:
    columns = columns_of(tmp_path, "temperature.hip=T2")
    one = {key: value for key, value in MESSAGE.items() if not key.startswith("torque")}
    other = {key: value for key, value in MESSAGE.items() if key.startswith("torque")}
    assert columns.learn([(one, 100.0)]) == []
    assert columns.learn([(other, 100.1)])
    values, _ = columns.values([one, other], np.array([0.0, 1.0]))
    np.testing.assert_allclose(values["torque.knee"], [np.nan, 1.0])


def test_a_sensor_that_is_rare_in_a_file_is_waited_for(tmp_path: Path) -> None:
    columns = columns_of(tmp_path)
    motors = {key: value for key, value in MESSAGE.items() if not key.startswith("temp")} | {"temperature.ambient": 22}
    assert columns.learn([(motors, 100.0)] * 4000) == []  # 4 s at 1 kHz, read at once
    assert columns.learn([({"temperature.knee": 30.0, "temperature.hip": 31.0}, 100.0)])
    assert columns.outputs == ["temperature.knee", "temperature.hip"]


def test_what_no_message_holds_is_refused_after_a_while(tmp_path: Path) -> None:
    columns = columns_of(tmp_path)
    lacking = {key: value for key, value in MESSAGE.items() if key != "torque.hip"} | {"tau_hip": 1.0}
    assert columns.learn([(lacking, 100.0)]) == []
    with pytest.raises(InputError, match=r"udp: column torque.hip: found no such column.* torque.hip=tau_hip"):
        columns.learn([(lacking, 106.0)])


def test_a_bad_value_costs_its_message_alone(tmp_path: Path) -> None:
    columns = columns_of(tmp_path, "temperature.hip=T2")
    columns.learn([(MESSAGE, 100.0)])
    values, received = columns.values(
        [MESSAGE, MESSAGE | {"torque.knee": "1.2.3"}, MESSAGE | {"T2": "ERR"}], np.arange(3.0)
    )
    assert received.tolist() == [0, 2]
    np.testing.assert_allclose(values["temperature.hip"], [86.0, np.nan])
    assert columns.bad == 1
    assert "'1.2.3'" in columns.last_bad


def test_dates_are_times(tmp_path: Path) -> None:
    columns = columns_of(tmp_path, "temperature.hip=T2")
    messages = [MESSAGE | {"time": f"2026-11-23T14:05:0{k}.5"} for k in range(2)]
    columns.learn([(messages[0], 100.0)])
    values, _ = columns.values(messages, np.arange(2.0))
    np.testing.assert_allclose(np.diff(values["time"]), 1.0)


def test_entries_that_need_other_rows_are_refused(tmp_path: Path) -> None:
    columns = columns_of(tmp_path, "temperature.hip=T2[degC; wrap=256]")
    with pytest.raises(InputError, match=r"\[columns\] temperature.hip: found wrap"):
        columns.learn([(MESSAGE, 100.0)])
