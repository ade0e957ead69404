"""Channels that stand still: what else may look so, and what is said of two that are one."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest

from lptn.logs.alike import duplicates
from lptn.logs.channels import Channels, Silence
from lptn.logs.columns import ColumnSource
from lptn.logs.issue import Issue
from lptn.logs.reading import read_log
from lptn.logs.silence import silences, silences_of
from tests.hardening.corruptions import healthy, issues_in


def _log() -> pd.DataFrame:
    return healthy("leg", 1, 0.1)


def _issues(log: pd.DataFrame) -> list[Issue]:
    issues = issues_in(log)
    assert issues is not None
    return issues


def _silences(values: dict[str, npt.NDArray[np.float64]]) -> dict[str, list[Silence]]:
    return silences_of(Channels(values))


def _channels(one: npt.NDArray[np.float64], other: npt.NDArray[np.float64]) -> Channels:
    return Channels({"time": np.arange(float(one.size)), "temperature.a": one, "temperature.b": other})


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
    assert [silence.kind for silence in silences(time, fine, resolution=0.1)] == ["frozen"]


def test_one_move_by_two_steps_in_forty_is_chance_and_no_noise() -> None:
    """A housing read every three seconds in steps of 1 K stands for ten minutes, as it may at the middle of a step."""
    time = np.arange(2400.0, step=3.0)
    readings = np.concatenate([np.full(300, 25.0), 26.0 + np.arange(500) // 25 % 2])
    readings[:100] += np.arange(100) // 5 % 2
    readings[50] = readings[49] + 2.0
    assert (np.diff(readings) != 0).sum() > 40
    assert not silences(time, readings, resolution=1.0)
    noisy = np.round(readings + np.random.default_rng(5).normal(0.0, 0.6, readings.size))
    noisy[100:300] = 25.0  # its noise is plain, so that a live sensor would not stand
    assert [silence.kind for silence in silences(time, noisy, resolution=1.0)] == ["frozen"]


def test_what_stands_on_both_sides_of_a_gap_did_not_stand_in_it() -> None:
    rng = np.random.default_rng(1)
    time = np.concatenate([np.arange(0.0, 600.0, 2.0), np.arange(900.0, 1500.0, 2.0)])
    readings = np.round(30.0 + rng.normal(0.0, 0.1, time.size), 2)
    readings[297:303] = 30.0  # six seconds before the gap and after it
    assert not silences(time, readings)
    readings[250:350] = 30.0
    assert [silence.kind for silence in silences(time, readings)] == ["frozen"]


@pytest.mark.parametrize(
    "apart",
    [
        np.tile([0.001, 0.999], 1200),  # pairs of rows, once a second
        np.tile([0.1, 0.1, 4.8], 800),  # three of a burst, every five seconds
        np.repeat([1.0, 15.0], [1500, 200]),  # a logger that slows down
    ],
    ids=["pairs", "bursts", "slower"],
)
def test_rows_that_come_in_bursts_are_no_gaps(apart: npt.NDArray[np.float64]) -> None:
    time = np.cumsum(apart)
    readings = np.round(30.0 + np.random.default_rng(2).normal(0.0, 0.1, time.size), 2)
    stands = (time > time[-1] - 1500) & (time < time[-1] - 300)
    readings[stands] = 30.0
    assert [silence.kind for silence in silences(time, readings)] == ["frozen"]


def test_a_torque_of_nothing_but_zero_is_frozen_only_if_it_was_logged_for_long() -> None:
    time = np.concatenate([np.arange(30.0), np.arange(1000.0, 1030.0)])
    zero = {"time": time, "torque.knee": np.zeros(time.size), "velocity.knee": np.full(time.size, 1.0)}
    assert "torque.knee" not in _silences(zero)
    time = np.arange(300.0)
    zero = {"time": time, "torque.knee": np.zeros(time.size), "velocity.knee": np.sin(time)}
    assert [silence.kind for silence in _silences(zero)["torque.knee"]] == ["frozen"]


def test_two_joints_at_rest_that_read_alike_are_no_copies() -> None:
    """Both cool in steps of 1 K and flicker; of 2400 rows they differ in less than one in a hundred."""
    rng, one = np.random.default_rng(4), np.full(2400, 31.0)
    one[1200:] = 30.0
    other = one.copy()
    for readings in (one, other):
        readings[rng.choice(np.arange(1201, 2399, 3), 11, replace=False)] = 31.0
    assert np.count_nonzero(np.diff(one)) >= 20
    assert np.mean(one == other) > 0.99
    assert not duplicates(_channels(one, other))
    assert duplicates(_channels(one, one.copy())) == {"temperature.b": "temperature.a"}


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


def test_a_speed_that_stands_at_its_encoders_noise_is_that_of_a_joint_at_rest() -> None:
    """The mean of |speed| over a row is two steps of the column in one joint of a standing robot, row after row."""
    rng, time = np.random.default_rng(0), np.arange(2400.0)
    walking, stands = rng.normal(1.0, 0.3, time.size), (time > 900) & (time < 1500)
    for value, found in ((0.002, 0), (-0.009, 0), (0.011, 1), (0.7, 1)):
        speed = np.where(stands, value, walking)
        assert len(_silences({"time": time, "velocity.knee": speed}).get("velocity.knee", [])) == found
    # So does the load that it holds all the while.
    torque = np.where(stands, 3.2, rng.normal(0.0, 4.0, time.size))
    for value, found in ((0.0, 0), (0.002, 0), (0.02, 1)):
        speed = np.where(stands, value + 1e-4 * rng.standard_normal(time.size) * (value > 0), walking)
        assert len(_silences({"time": time, "velocity.knee": speed, "torque.knee": torque})) == found


def test_torques_that_are_asked_for_hold_still_and_one_that_froze_is_found() -> None:
    """A commanded or simulated torque shows no noise where it holds; while the joint moves it would not hold."""
    rng, time = np.random.default_rng(0), np.arange(3600.0)
    walking = (time < 600) | ((time > 1200) & (time < 2400))
    torque = np.where(walking, 9 * np.sin(time), np.where(time <= 1200, 5.2, 6.1))
    speed = np.where(walking, np.cos(time), 0.0)
    logged = {"time": time, "torque.knee": torque, "velocity.knee": speed}
    assert not _silences(logged)
    assert not _silences({key: logged[key] for key in ("time", "torque.knee")})
    moving = rng.normal(0, 1, time.size)
    assert len(_silences(logged | {"velocity.knee": moving})["torque.knee"]) == 2
    once = logged | {"torque.knee": np.where(time > 2400, 9 * np.sin(time), torque)}
    assert not _silences(once)  # from the row in which the knee comes to rest to the row in which it moves again
    rising = logged | {"torque.knee": np.where(time < 600, 0, np.where(time > 2400, 9 * np.sin(time), torque))}
    assert not _silences(rising | {"velocity.knee": np.where(time < 600, 0, speed)})  # it lay before it stood
    froze = np.where((time > 650) & (time < 1150), 5.2, 9 * np.sin(time))
    assert len(_silences(logged | {"torque.knee": froze})["torque.knee"]) == 1


def test_a_torque_that_no_joint_bears_is_refused() -> None:
    log = _log()
    log.loc[700, "torque.FR_calf"] = 18_000.0
    with pytest.raises(ValueError, match="more than any joint bears"):
        read_log(log)
    source = ColumnSource(("torque.FR_calf",), unit="N*m")
    with pytest.raises(ValueError, match="more than any joint bears"):
        read_log(log, {"torque.FR_calf": source})
    read_log(log, {"torque.FR_calf": replace(source, valid=(-100.0, 100.0))})


@pytest.mark.parametrize(("quantity", "value"), [("current", -4e4), ("velocity", 9e3), ("torque", -2e3)])
def test_single_values_that_no_joint_has_are_refused_and_their_line_leaves_them_out(
    quantity: str, value: float
) -> None:
    log, key = _log(), f"{quantity}.FR_calf"
    log["current.FR_calf"] = 2 * log["torque.FR_calf"]
    log.loc[[700, 9000], key] = value
    with pytest.raises(ValueError, match="2 values up to"):
        read_log(log)
    (issue,) = _issues(log)
    assert issue.corrected is not None
    (run,) = read_log(log, {key: issue.corrected})
    assert max(np.abs(run.columns[name]).max() for name in run.columns if quantity in name) < 100


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
    assert issue.remedy.startswith("it is used as it is")
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
    assert "no other sensor moves, so it counts all the same" in issue.remedy
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


@pytest.mark.parametrize("steps", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("again", [1, 3, 50])
def test_a_reading_that_a_topic_repeats_is_one_reading(steps: float, again: int) -> None:
    """Its highest stands for several rows and is no limit; a sensor that freezes, or is clamped, is found."""
    rng, time = np.random.default_rng(7), np.arange(0.0, 1200.0, 1 / again)
    true = 30 + 3 * np.sin(time / 200)
    readings = np.repeat((true[::again] + rng.normal(0, 0.2, 1200)), again)
    readings = np.round(readings / steps) * steps if steps else readings
    assert not silences(time, readings, resolution=steps)
    froze = np.where((time >= 500) & (time < 800), readings[500 * again], readings)
    (frozen,) = silences(time, froze, resolution=steps)
    assert frozen.kind == "frozen"
    assert frozen.stop - frozen.start == pytest.approx(300, abs=5)
    limit = 31.5 if steps else 31.47
    (clamped, *_) = silences(time, np.minimum(readings, limit), resolution=steps)
    assert clamped.kind == "clamped"
    assert clamped.value == pytest.approx(limit)


def test_a_filtered_reading_that_comes_to_rest_is_not_frozen_after_a_minute() -> None:
    rng, time = np.random.default_rng(4), np.arange(0.0, 1200.0, 0.5)
    readings = 30 + 0.01 * time + rng.normal(0, 0.1, time.size)
    readings[790:800] = readings[800] + 0.1 * 0.5 ** np.arange(1, 11)
    readings[800:1000] = readings[800]
    assert not silences(time, readings)


@pytest.mark.parametrize("steps", [0.0, 0.1])
def test_a_sensor_that_freezes_at_its_highest_loses_no_reading_before(steps: float) -> None:
    time = np.arange(1200.0)
    readings = 30 + 0.01 * time + np.random.default_rng(8).normal(0, 0.1, time.size)
    readings = np.round(readings / steps) * steps if steps else readings
    readings[900:] = readings.max()
    (stands,) = silences(time, readings, resolution=steps)
    assert stands.start >= 899


# --- A limit at which a coarse sensor stands --------------------------------------------------------


def _heated(load: npt.NDArray[np.float64], constant: float = 600.0) -> npt.NDArray[np.float64]:
    """A mass in air of 20 degC whose losses go with the square of the load, read in steps of 1 K; one row a second."""
    temperature = np.full(load.size, 20.0)
    for k in range(1, load.size):
        gain = 60.0 * load[k - 1] ** 2
        temperature[k] = temperature[k - 1] + (20.0 + gain - temperature[k - 1]) / constant
    return np.round(temperature)


def _said(time: npt.NDArray[np.float64], readings: npt.NDArray[np.float64], load: npt.NDArray[np.float64]) -> list[str]:
    log = {"time": time, "temperature.a": readings, "torque.a": load, "temperature.ambient": np.full(time.size, 20.0)}
    return [one.kind for one in _silences(log).get("temperature.a", [])]


def test_a_coarse_sensor_at_a_limit_is_clamped_while_the_load_goes_on() -> None:
    time = np.arange(2400.0)
    load = np.where((time % 800) < 500, 1.0, 0.6)
    readings = np.minimum(_heated(load), 45.0)
    assert set(_said(time, readings, load)) == {"clamped"}


@pytest.mark.parametrize("level", np.linspace(0.4, 1.0, 13))
def test_a_coarse_sensor_that_comes_to_its_end_is_not(level: float) -> None:
    time = np.arange(6000.0)
    load = np.full(time.size, level)
    assert not _said(time, _heated(load), load)


def test_a_coarse_sensor_that_a_derating_drive_holds_at_a_limit_is_not() -> None:
    time, load, readings = np.arange(2400.0), np.ones(2400), np.full(2400, 20.0)
    temperature = 20.0
    for k in range(1, time.size):
        load[k] = 1.0 if temperature < 45.2 else 0.5
        temperature += (20.0 + 60.0 * load[k] ** 2 - temperature) / 600.0
        readings[k] = np.round(temperature)
    assert (readings[-1200:] == 45).all()
    assert not _said(time, readings, load)


def test_readings_of_which_a_limit_cuts_the_noise_off_are_left_out() -> None:
    rng, time = np.random.default_rng(3), np.arange(1200.0)
    true = np.interp(time, [0, 300, 600, 1000, 1200], [30, 39.9, 42, 39.9, 36])
    noise = rng.normal(0, 0.1, time.size)
    log = pd.DataFrame(
        {"time": time, "temperature.a": np.minimum(true + noise, 40.0), "temperature.b": true + noise[::-1]}
    )
    (run,) = read_log(log)
    left = run.columns["temperature.a"] - true
    near = np.abs(true - 40.0) < 0.2
    assert np.isnan(left[near]).mean() > 0.9
    assert abs(np.nanmean(left)) < 0.01


# --- Codes, and counters that wrap --------------------------------------------------------------------


@pytest.mark.parametrize("code", [-1.0, 65535.0, 127.0, 0.0])
def test_a_number_that_comes_back_far_from_all_around_is_a_code(code: float) -> None:
    log, rng = _log(), np.random.default_rng(5)
    log.loc[rng.random(len(log)) < 0.02, "temperature.FR_calf"] = code
    (issue,) = _issues(log)
    assert (issue.kind, issue.key) == ("code", "temperature.FR_calf")
    assert issue.corrected is not None
    assert issue.corrected.invalid == (code,)


def test_what_is_dead_for_long_is_a_code_for_short() -> None:
    log = _log()
    time = log["time"] - log["time"].iloc[0]
    for start, length in ((300, 400), (900, 20), (1200, 100)):
        log.loc[_between(log, start, start + length), "temperature.FR_calf"] = 126.0
    issues = _issues(log)
    assert {issue.kind for issue in issues} == {"dead", "code"}
    (run,) = read_log(log)
    assert np.nanmax(run.columns["temperature.FR_calf"]) < 110
    assert time.iloc[-1] > 1300


def test_a_signed_byte_of_half_degrees_that_wraps_is_put_right() -> None:
    rng, time = np.random.default_rng(6), np.arange(1200.0)
    true = 40 + 35 * np.sin(time / 400) + rng.normal(0, 0.2, time.size)
    counts = np.round(2 * true)
    log = pd.DataFrame(
        {"time": time, "temperature.a": ((counts + 128) % 256 - 128) / 2, "torque.a": rng.normal(0, 1, 1200)}
    )
    (issue,) = _issues(log)
    assert issue.kind == "wrap"
    assert issue.certain
    assert issue.corrected is not None
    (run,) = read_log(log, {"temperature.a": issue.corrected})
    assert run.columns["temperature.a"] == pytest.approx(counts / 2)


@pytest.mark.parametrize("number", [0.0, -127.0])
def test_air_that_is_one_code_throughout_is_dead(number: float) -> None:
    log = _log().assign(**{"temperature.ambient": number})
    issues = _issues(log)
    assert [(issue.key, issue.kind) for issue in issues] == [("temperature.ambient", "dead")]
    assert not _issues(_log().assign(**{"temperature.ambient": 12.0}))  # a number that someone wrote


def _of_levels(seed: int, joints: int, steps: float) -> pd.DataFrame:
    """Joints beside each other, an hour of currents in six levels, each joint at its own."""
    rng, time = np.random.default_rng(seed), np.arange(3600.0)
    log = {"time": time, "temperature.ambient": np.full(3600, 21.0)}
    for joint in range(joints):
        current = np.repeat(rng.choice(np.arange(6.0), 120), 30)
        warm = np.zeros(3600)
        for k in range(3599):
            warm[k + 1] = warm[k] + (0.4 * current[k] ** 2 - warm[k] / 5) / (200 + 60 * joint)
        readings = 21 + warm + rng.normal(0, 0.05, 3600)
        log |= {f"temperature.j{joint}": np.round(readings / steps) * steps, f"current.j{joint}": current}
    return pd.DataFrame(log)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("joints", "steps"), [(2, 0.01), (3, 0.1), (6, 0.1)])
def test_of_two_equal_columns_of_few_levels_the_temperatures_tell_which_is_another_joints(
    seed: int, joints: int, steps: float
) -> None:
    log = _of_levels(seed, joints, steps)
    assert _issues(log) == []
    (issue,) = _issues(log.assign(**{"current.j1": log["current.j0"]}))
    assert (issue.key, issue.kind) == ("current.j1", "duplicate")


@pytest.mark.parametrize("steps", [0.01, 0.1, 1.0])
def test_two_joints_that_are_commanded_alike_warm_by_it_and_are_no_copies(steps: float) -> None:
    log = _of_levels(4, 2, steps)
    other = _of_levels(4, 1, steps)
    warm = np.round((21 + 0.7 * (other["temperature.j0"] - 21)) / steps) * steps
    log["temperature.j1"], log["current.j1"] = warm, log["current.j0"]
    assert _issues(log) == []


@pytest.mark.parametrize("sensors", [1, 3])
@pytest.mark.parametrize("value", [25.0, 21.0, 0.0])
def test_sensors_that_all_give_one_number_while_loads_come_and_go_are_said(sensors: int, value: float) -> None:
    log = _of_levels(5, sensors, 0.1)
    still = {f"temperature.j{k}": value + k for k in range(sensors)}
    issues = _issues(log.assign(**still))
    assert {issue.key for issue in issues} == set(still)
    assert all("while loads come and go" in issue.problem for issue in issues)
    resting = {f"current.j{k}": np.random.default_rng(k).normal(0, 0.02, 3600) for k in range(sensors)}
    assert _issues(log.assign(**still).assign(**resting)) == []
