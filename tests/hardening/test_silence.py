"""Channels that stand still: what else may look so, and what is said of two that are one."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest

from lptn.logs.columns import ColumnSource
from lptn.logs.quality import Issue
from lptn.logs.reading import read_log
from lptn.logs.silence import duplicates, silences, silences_of
from tests.hardening.corruptions import healthy, issues_in


def _log() -> pd.DataFrame:
    return healthy("leg", 1, 0.1)


def _issues(log: pd.DataFrame) -> list[Issue]:
    issues = issues_in(log)
    assert issues is not None
    return issues


def _between(log: pd.DataFrame, start: float, stop: float) -> npt.NDArray[np.bool_]:
    time = log["time"].to_numpy() - log["time"].iloc[0]
    return np.asarray((time >= start) & (time <= stop))


def test_noise_that_a_coarse_sensor_hides_is_not_missed() -> None:
    """In the middle of a step noise of a sixth of it never shows, however lively the sensor is near an edge."""
    rng, time = np.random.default_rng(0), np.arange(3600.0)
    true = np.interp(time, [0, 1800, 1801, 3600], [23.5, 23.5, 23.02, 23.02])
    readings = np.round(true + rng.normal(0.0, 0.15, time.size))
    assert not silences(time, readings, resolution=1.0)
    fine = np.round(true + rng.normal(0.0, 0.15, time.size), 1)
    fine[2000:2800] = fine[2000]
    assert [each.kind for each in silences(time, fine, resolution=0.1)] == ["frozen"]


def test_two_joints_at_rest_that_read_alike_are_no_copies() -> None:
    """Both cool in steps of 1 K and flicker; of 2400 rows they differ in less than one in a hundred."""
    rng, one = np.random.default_rng(4), np.full(2400, 31.0)
    one[1200:] = 30.0
    other = one.copy()
    for readings in (one, other):
        readings[rng.choice(np.arange(1201, 2399, 3), 11, replace=False)] = 31.0
    assert np.count_nonzero(np.diff(one)) >= 20
    assert np.mean(one == other) > 0.99
    assert not duplicates({"a": one, "b": other})
    assert duplicates({"a": one, "b": one.copy()}) == {"b": "a"}


def test_two_channels_with_the_same_readings() -> None:
    log = _log()
    log["temperature.FR_calf"] = log["temperature.FR_hip"]
    (issue,) = _issues(log)
    assert issue.kind == "duplicate"
    (run,) = read_log(log)
    assert [name for name in run.columns if name.startswith("temperature.FR")] == ["temperature.FR_thigh"]
    assert {issue.key, issue.problem.rpartition(" ")[2]} == {"temperature.FR_calf", "temperature.FR_hip"}


def test_a_torque_of_zero_is_odd_only_while_the_joint_moves() -> None:
    log = _log()
    inside = _between(log, 300, 1200)
    log.loc[inside, "torque.FR_calf"] = 0.0
    log.loc[inside, "velocity.FR_calf"] = 0.0
    assert not _issues(log)
    log.loc[inside, "velocity.FR_calf"] = np.random.default_rng(0).normal(1.5, 0.1, inside.sum())
    (issue,) = _issues(log)
    assert (issue.key, issue.kind) == ("torque.FR_calf", "frozen")


def test_torques_that_are_asked_for_hold_still_and_one_that_froze_is_found() -> None:
    """A commanded or simulated torque shows no noise where it holds; while the joint moves it would not hold."""
    rng, time = np.random.default_rng(0), np.arange(3600.0)
    walking = (time < 600) | ((time > 1200) & (time < 2400))
    torque = np.where(walking, 9 * np.sin(time), np.where(time <= 1200, 5.2, 6.1))
    speed = np.where(walking, np.cos(time), 0.0)
    logged = {"time": time, "torque.knee": torque, "velocity.knee": speed}
    assert not silences_of(logged)
    assert not silences_of({key: logged[key] for key in ("time", "torque.knee")})
    moving = rng.normal(0, 1, time.size)
    assert len(silences_of(logged | {"velocity.knee": moving})["torque.knee"]) == 2
    once = logged | {"torque.knee": np.where(time > 2400, 9 * np.sin(time), torque)}
    assert not silences_of(once)  # from the row in which the knee comes to rest to the row in which it moves again
    rising = logged | {"torque.knee": np.where(time < 600, 0, np.where(time > 2400, 9 * np.sin(time), torque))}
    assert not silences_of(rising | {"velocity.knee": np.where(time < 600, 0, speed)})  # it lay before it stood
    froze = np.where((time > 650) & (time < 1150), 5.2, 9 * np.sin(time))
    assert len(silences_of(logged | {"torque.knee": froze})["torque.knee"]) == 1


def test_a_torque_that_no_joint_bears_is_refused() -> None:
    log = _log()
    log.loc[700, "torque.FR_calf"] = 18_000.0
    with pytest.raises(ValueError, match="more than any joint bears"):
        read_log(log)
    source = ColumnSource(("torque.FR_calf",), unit="N*m")
    with pytest.raises(ValueError, match="more than any joint bears"):
        read_log(log, {"torque.FR_calf": source})
    read_log(log, {"torque.FR_calf": replace(source, valid=(-100.0, 100.0))})


def test_the_heat_of_a_joint_whose_torque_froze_is_a_gap_unless_its_range_is_stated() -> None:
    log = _log()
    log.loc[_between(log, 300, 1200), "torque.FR_calf"] = 4.0
    before, after = read_log(log)
    assert before.time[-1] < 300
    assert after.time[0] >= 1200
    stated = {"torque.FR_calf": ColumnSource(("torque.FR_calf",), valid=(-100.0, 100.0))}
    assert len(read_log(log, stated)) == 1


def test_spikes_of_the_air_are_left_out_too() -> None:
    log = _log()
    log.loc[[700, 9000], "temperature.ambient"] += 20.0
    (issue,) = _issues(log)
    assert (issue.key, issue.kind) == ("temperature.ambient", "spike")
    (run,) = read_log(log)
    assert run.columns["temperature.ambient"].max() < log["temperature.ambient"].median() + 1.0


# --- What is said of a channel is what is done with it ----------------------------------------------------------------


_INPUTS = ["torque.FR_calf", "temperature.ambient"]
_read_as_a_model_does = partial(read_log, inputs=_INPUTS, outputs=["temperature.FR_calf", "temperature.FR_hip"])


def test_a_given_temperature_that_stands_still_is_taken_and_one_that_is_dead_cuts_the_log() -> None:
    log, rng = _log(), np.random.default_rng(3)
    log["temperature.ambient"] = 22 + rng.normal(0, 0.05, len(log))
    still = log.copy()
    still.loc[_between(log, 300, 1200), "temperature.ambient"] = 22.0625
    (run,) = _read_as_a_model_does(still)
    (issue,) = run.issues
    assert issue.kind == "frozen"
    assert issue.remedy.startswith("it is taken as it stands")
    assert (run.columns["temperature.ambient"][400:1100] == 22.0625).all()
    log.loc[_between(log, 300, 1200), "temperature.ambient"] = 0.0
    before, after = _read_as_a_model_does(log)
    assert (before.time[-1] < 300, after.time[0] >= 1200) == (True, True)
    (issue,) = before.issues
    assert (issue.kind, "the log is cut" in issue.remedy) == ("dead", True)


def test_a_sensor_of_one_number_leaves_the_cost_where_another_remains() -> None:
    log = _log()
    log["temperature.FR_hip"] = 31.0
    (run,) = _read_as_a_model_does(log)
    (issue,) = run.issues
    assert (issue.key, issue.kind) == ("temperature.FR_hip", "frozen")
    assert "it is left out" in issue.remedy
    assert not run.has("temperature.FR_hip")
    stated = {"temperature.FR_hip": ColumnSource(("temperature.FR_hip",), valid=(-40.0, 150.0))}
    (run,) = _read_as_a_model_does(log, stated)
    assert (run.temperature("FR_hip") == 31.0).all()
    log["temperature.ambient"] = np.linspace(20.0, 26.0, len(log))
    (run,) = read_log(log, inputs=_INPUTS, outputs=["temperature.FR_hip"])
    (issue,) = run.issues
    assert "it is the only sensor, and counts all the same" in issue.remedy
    assert (run.temperature("FR_hip") == 31.0).all()


def test_a_code_twice_in_a_row_is_no_reading() -> None:
    log = _log()
    log.loc[[700, 701, 9000], "temperature.FR_calf"] = -127.0
    (run,) = _read_as_a_model_does(log)
    (issue,) = run.issues
    assert (issue.kind, "these readings are left out" in issue.remedy) == ("code", True)
    assert np.nanmin(run.temperature("FR_calf")) > 10.0


def test_a_sensor_that_shows_its_noise_is_frozen_after_a_minute() -> None:
    rng, time = np.random.default_rng(3), np.arange(0.0, 1200.0, 0.5)
    readings = 30 + 0.01 * time + rng.normal(0, 0.1, time.size)
    readings[800:1000], readings[1100:1120] = readings[800], readings[1100]  # 100 s, and 10 s
    (frozen,) = silences(time, readings)
    assert (frozen.kind, frozen.start, frozen.stop) == ("frozen", 400.0, 499.5)
    assert not silences(time, np.round(readings / 0.1) * 0.1, resolution=0.1)  # such a one may stand for longer


def test_a_filtered_reading_that_comes_to_rest_is_not_frozen_after_a_minute() -> None:
    rng, time = np.random.default_rng(4), np.arange(0.0, 1200.0, 0.5)
    readings = 30 + 0.01 * time + rng.normal(0, 0.1, time.size)
    readings[790:800] = readings[800] + 0.1 * 0.5 ** np.arange(1, 11)
    readings[800:1000] = readings[800]
    assert not silences(time, readings)
