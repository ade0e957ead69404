"""Readings that no heated, passive part could have given are left out; what a part can do is believed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest
from scipy.signal import lfilter

from lptn.logs.columns import ColumnSource
from lptn.logs.issue import Issue
from lptn.logs.reading import read_log

Array = npt.NDArray[np.float64]
CAPACITY, RESISTANCE, WINDING = 300.0, 5.0, 0.2  # J/K, K/W, ohm
KNEE = "temperature.knee"


def _knee(
    air: float = 25.0, start: float = 25.0, step: float = 1.0, capacity: float = CAPACITY, scale: float = 1.0
) -> tuple[Array, Array, Array]:
    """An hour of one mass that a current heats in steps of a minute: time, current, temperature."""
    time = np.arange(0.0, 3600.0, step)
    levels = np.random.default_rng(1).choice([0.0, 2.0, 4.0, 6.0, 8.0, 5.0], size=60) * scale
    current = levels[(time // 60).astype(int)]
    ends, kept = air + RESISTANCE * WINDING * current[:-1] ** 2, np.exp(-step / capacity / RESISTANCE)
    later, _ = lfilter([1 - kept], [1, -kept], ends, zi=[kept * start])
    return time, current, np.append(start, later)


def _log(time: Array, current: Array, readings: Array, air: float = 25.0) -> pd.DataFrame:
    return pd.DataFrame({"time": time, KNEE: readings.round(2), "current.knee": current, "temperature.ambient": air})


def _read(log: pd.DataFrame, columns: dict[str, ColumnSource] | None = None) -> tuple[Array, tuple[Issue, ...]]:
    (run,) = read_log(
        log, columns or {}, inputs=["current.knee", "temperature.ambient"], outputs=[KNEE], strict=False, step=None
    )
    return run.columns[KNEE], run.issues


def _dies(since: Array, constant: float) -> Array:
    return np.exp(-np.maximum(since, 0.0) / constant)


Fault = Callable[[Array, Array, np.random.Generator], Array]
FAULTS: dict[str, Fault] = {
    "an open thermistor": lambda t, x, r: np.where((t > 1500) & (t < 2200), r.normal(-94.6, 0.3, t.size), x),
    "an open Pt100": lambda t, x, r: np.where((t > 1500) & (t < 2200), r.normal(850, 3, t.size), x),
    "a shorted Pt100": lambda t, x, r: np.where((t > 1500) & (t < 2200), r.normal(-88.6, 2, t.size), x),
    "open for 5 s, each 5 min": lambda t, x, r: np.where(t % 300 > 294, r.normal(-40, 1, t.size), x),
    "open from the first row on": lambda t, x, r: np.where(t < 900, r.normal(-40, 0.5, t.size), x),
    "opens slowly": lambda t, x, _: np.where(t > 2400, -50 + 90 * _dies(t - 2400, 20), x),
    "opens through a filter of 2 s": lambda t, x, _: np.where(t > 2400, -50 + 90 * _dies(t - 2400, 2), x),
    "a filter that begins 117 K above": lambda t, x, _: x + 117 * np.exp(-t / 20),
    "a filter that begins 60 K below": lambda t, x, _: x - 60 * np.exp(-t / 12),
    "goes to 0 slowly and comes back": lambda t, x, _: np.where((t > 900) & (t < 2100), x * _dies(t - 900, 60), x),
    "goes to 0 slowly for good": lambda t, x, _: np.where(t > 2000, x * _dies(t - 2000, 60), x),
    "goes to -20 slowly and comes back": lambda t, x, _: np.where(
        (t > 1500) & (t < 3000), (x + 20) * _dies(t - 1500, 45) - 20, x
    ),
    "comes loose": lambda t, x, r: np.where(t > 1800, r.normal(25 + 15 * _dies(t - 1800, 100), 0.05), x),
    "jumps by 30 K": lambda t, x, _: np.where(t > 2000, x + 30, x),
    "jumps down by 12 K": lambda t, x, _: np.where(t > 2000, x - 12, x),
    "in degF from the middle on": lambda t, x, _: np.where(t > 1900, 1.8 * x + 32, x),
    "turns at 44 K": lambda _, x, __: np.where(np.round(x * 64) >= 44 * 64, x - 44, x),
    "turns at 40 K": lambda _, x, __: np.where(x >= 40, x - 40, x),
    "turns at 32 K": lambda _, x, __: np.where(x >= 32, x - 32, x),
    "turns at 29 and 58 K": lambda _, x, __: x % 29,
    "falls to 25.0 for 20 s": lambda t, x, _: np.where(t % 300 < 20, 25.0, x),
    "rises to 99.5 for 7 s": lambda t, x, _: np.where(t % 200 < 7, 99.5, x),
    "stands at 60 from the first tenth on, in steps of 1 K": lambda t, x, _: np.where(t > 400, 60.0, np.round(x)),
    "stands at 60 until the last tenth, in steps of 1 K": lambda t, x, _: np.where(t < 3200, 60.0, np.round(x)),
}


@pytest.mark.parametrize("step", [0.2, 1.0, 5.0])
@pytest.mark.parametrize("fault", FAULTS)
def test_what_no_part_could_have_given_is_left_out_and_said(fault: str, step: float) -> None:
    time, current, true = _knee(step=step)
    rng = np.random.default_rng(3)
    readings = FAULTS[fault](time, true + rng.normal(0, 0.05, time.size), rng)
    (run,) = read_log(
        _log(time, current, readings), inputs=["current.knee", "temperature.ambient"], outputs=[KNEE], step=step
    )
    assert {issue.key for issue in run.issues} == {KNEE}
    taken, truth, given = run.columns[KNEE], np.interp(run.time, time, true), np.interp(run.time, time, readings)
    wrong, false = np.abs(given - truth) > 2.5, np.abs(taken - truth) > 2.5
    assert false.sum() <= 0.02 * wrong.sum()
    assert np.isnan(taken[~wrong]).mean() < 0.12


@pytest.mark.parametrize("stands", [(600, 1000), (900, 1500), (1200, 1900), (2000, 2600)])
@pytest.mark.parametrize("again", [0.0, 100.0])
def test_what_comes_after_a_sensor_that_stood_is_believed(stands: tuple[int, int], again: float) -> None:
    """How warm it was when it stopped says when it was as warm: it had until now to become as warm as it is."""
    time, current, true = _knee(step=0.2, capacity=60.0, scale=1.4)
    readings = true + np.random.default_rng(3).normal(0, 0.05, time.size)
    for start, stop in [stands] + [(stands[1], stands[1] + again)] * bool(again):
        readings[(time >= start) & (time < stop)] = readings[time >= start][0]
    (run,) = read_log(_log(time, current, readings), inputs=["current.knee"], outputs=[KNEE], step=0.2)
    assert "frozen" in {issue.kind for issue in run.issues}
    taken = np.isfinite(run.columns[KNEE])
    assert taken[run.time >= stands[1] + again].mean() > 0.9
    assert taken[run.time < stands[0]].mean() > 0.9


HEALTHY: dict[str, dict[str, float]] = {
    "a knee": {},
    "in the cold": {"air": -20.0, "start": -20.0},
    "that comes out of a warm room": {"air": -20.0, "start": 22.0},
    "that begins hot": {"start": 120.0},
    "that comes out of a fridge": {"start": -15.0},
    "of a small mass": {"capacity": 4.0},
    "of a small mass that begins hot": {"capacity": 4.0, "start": 80.0},
    "of a mass smaller still": {"capacity": 1.0},
    "of an oven": {"scale": 1.7},
}


@pytest.mark.parametrize("steps", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("step", [0.2, 1.0, 5.0, 20.0])
@pytest.mark.parametrize("robot", HEALTHY)
def test_of_a_part_that_its_heat_explains_nothing_is_said(robot: str, step: float, steps: float) -> None:
    time, current, true = _knee(**HEALTHY[robot], step=step)
    readings = true + np.random.default_rng(4).normal(0, 0.05, time.size)
    readings = np.round(readings / steps) * steps if steps else readings
    taken, issues = _read(_log(time, current, readings, HEALTHY[robot].get("air", 25.0)))
    assert [issue.sentence for issue in issues] == []
    assert np.isfinite(taken).all()


@pytest.mark.parametrize("step", [5.0, 10.0, 20.0])
def test_of_a_winding_whose_current_nobody_logged_nothing_is_said(step: float) -> None:
    """Between two rows it warms by all that it will: in rows so far apart nothing tells that from a broken wire."""
    time, current, true = _knee(capacity=1.0, step=step)
    readings = true + np.random.default_rng(4).normal(0, 0.05, time.size)
    (run,) = read_log(_log(time, current, readings).drop(columns="current.knee"), step=step)
    assert [issue.sentence for issue in run.issues] == []
    assert np.isfinite(run.columns[KNEE]).all()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("constant", [8.0, 12.0, 20.0])
def test_a_small_winding_in_short_moves_is_explained_by_its_heat(constant: float, seed: int) -> None:
    """Its load comes and goes before the mean of the last twenty seconds knows of it."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 1800.0, 0.1)
    lengths = rng.uniform(3, 20, 400)
    current = np.repeat(rng.choice([0.0, 2.0, 3.5, 5.0], 400), (10 * lengths).astype(int))[: time.size]
    true, case = np.full(time.size, 25.0), 25.0
    for k in range(time.size - 1):
        case += 0.1 / 60 * ((true[k] - case) / 3 - (case - 25) / 9)
        true[k + 1] = true[k] + 0.1 / constant * (1.5 * current[k] ** 2 - (true[k] - case))
    _, issues = _read(_log(time, current, true + rng.normal(0, 0.1, time.size)))
    assert [issue.sentence for issue in issues] == []


@pytest.mark.parametrize("constant", [40.0, 90.0, 300.0])
@pytest.mark.parametrize("outside", [-12.0, 0.0, 12.0])
def test_the_air_may_be_colder_than_all_that_it_surrounds(constant: float, outside: float) -> None:
    """A robot is carried outdoors, where its parts stay warm for an hour."""
    time, current, true = _knee()
    air = np.where(time < 900, 25.0, outside + (25 - outside) * _dies(time - 900, constant))
    log = _log(time, current, true + np.random.default_rng(0).normal(0, 0.05, time.size))
    _, issues = _read(log.assign(**{"temperature.ambient": air.round(1)}))
    assert [issue.sentence for issue in issues] == []


@pytest.mark.parametrize("share", [0.6, 0.8, 1.0])
def test_a_sensor_of_the_air_that_says_what_a_joints_does_is_doubted(share: float) -> None:
    time, current, true = _knee()
    noise = np.random.default_rng(2).normal(0, 0.05, (2, time.size))
    readings = (true + noise[0]).round(2)
    air = readings if share == 1 else (25 + share * (true - 25) + noise[1]).round(2)
    _, (issue,) = _read(_log(time, current, readings).assign(**{"temperature.ambient": air}))
    assert (issue.key, issue.kind) == ("temperature.ambient", "follows")


@pytest.mark.parametrize(("capacity", "load"), [(300.0, 0.0), (20.0, 0.0), (20.0, 0.3), (300.0, 1.0)])
def test_air_that_warms_a_joint_does_not_follow_it(capacity: float, load: float) -> None:
    """A heater goes on and off in the room."""
    rng, time = np.random.default_rng(3), np.arange(3600.0)
    current = load * rng.choice([0.0, 2.0, 4.0, 6.0, 8.0], size=60)[(time // 60).astype(int)]
    air = 25 + 3 * np.sin(2 * np.pi * time / 700)
    true = np.full(time.size, 25.0)
    for k in range(time.size - 1):
        true[k + 1] = true[k] + (WINDING * current[k] ** 2 - (true[k] - air[k]) / RESISTANCE) / capacity
    log = _log(time, current, true + rng.normal(0, 0.05, time.size))
    _, issues = _read(log.assign(**{"temperature.ambient": (air + rng.normal(0, 0.05, time.size)).round(2)}))
    assert [issue.sentence for issue in issues] == []


@pytest.mark.parametrize(("every", "hold"), [(0.1, 5.0), (1.0, 5.0), (1.0, 20.0), (0.5, 3.0)])
def test_a_load_that_is_sampled_and_held_beside_others_is_said_and_used(every: float, hold: float) -> None:
    time, rng = np.arange(0.0, 1200.0, every), np.random.default_rng(8)
    log = pd.DataFrame({"time": time} | {f"torque.{joint}": rng.normal(0, 3, time.size) for joint in "abc"})
    rows = np.arange(time.size)
    held = log["torque.b"].to_numpy()[rows // round(hold / every) * round(hold / every)]
    (run,) = read_log(log.assign(**{"torque.b": held}))
    (issue,) = run.issues
    assert (issue.key, issue.kind) == ("torque.b", "held")
    assert len(run) == pytest.approx(1200 / run.step, abs=1)
    of_all = {name: log[name].to_numpy()[rows // round(hold / every) * round(hold / every)] for name in log.columns[1:]}
    assert not read_log(log.assign(**of_all))[0].issues  # commands of so many seconds
    commanded = np.repeat(rng.choice([0.0, 1.0, 2.0, 3.0], time.size), round(hold / every))[: time.size]
    assert not read_log(log.assign(**{"torque.b": commanded}))[0].issues


@pytest.mark.parametrize("count", [1, 2, 9, 10])
def test_so_few_readings_that_they_say_next_to_nothing_are_said(count: int) -> None:
    time, current, true = _knee()
    log = _log(time, current, true).assign(**{"temperature.hip": np.nan})
    rows = np.linspace(300, 3000, count).astype(int)
    log.loc[rows, "temperature.hip"] = true[rows]
    (run,) = read_log(log, inputs=["current.knee", "temperature.ambient"], outputs=[KNEE, "temperature.hip"])
    said = [issue.problem for issue in run.issues]
    assert said == [f"{count} reading{'s' * (count > 1)} in 3600 rows, which tell next to nothing of its part"] * (
        count < 10
    )


LAB = "temperature.lab"


def _in_a_lab(air: Array, knee: Array | None = None) -> tuple[Issue, ...]:
    """What is said of a knee whose surroundings are a node of the model with a given temperature."""
    time, current, true = _knee()
    readings = true + np.random.default_rng(0).normal(0, 0.05, time.size) if knee is None else knee
    log = _log(time, current, readings).drop(columns="temperature.ambient").assign(**{LAB: air.round(2)})
    return read_log(log, inputs=["current.knee", LAB], outputs=[KNEE], strict=False)[0].issues


def test_surroundings_by_another_name_are_the_air() -> None:
    time, _, true = _knee()
    noise = np.random.default_rng(1).normal(0, 0.02, time.size)
    outdoors = np.where(time < 900, 25.0, -5 + 30 * _dies(time - 900, 90))
    assert _in_a_lab(outdoors) == ()
    assert _in_a_lab(np.full(time.size, 25.0)) == ()  # people write one number for a room
    (issue,) = _in_a_lab(25 + 0.3 * (true - 25) + noise)
    assert (issue.key, issue.kind) == (LAB, "follows")
    (issue,) = _in_a_lab(25 + noise, np.where(time < 1800, true, 25 + 15 * _dies(time - 1800, 100)) + noise[::-1])
    assert (issue.key, issue.kind) == (KNEE, "disconnected")
    (issue,) = _in_a_lab(25 + noise, np.round(true) + 40)
    assert (issue.key, issue.kind) == (KNEE, "offset")


def test_a_jump_of_all_channels_is_said_of_each_and_the_log_is_cut_where_the_air_jumps() -> None:
    time, current, true = _knee()
    rng = np.random.default_rng(5)
    log = _log(time, current, true + rng.normal(0, 0.05, time.size) + 28.0 * (time > 2100))
    log["temperature.ambient"] = 25.0 + rng.normal(0, 0.03, time.size) + 31.0 * (time > 2100)
    run, *_ = read_log(log, inputs=["current.knee", "temperature.ambient"], outputs=[KNEE])
    assert {issue.key for issue in run.issues} == {KNEE, "temperature.ambient"}
    assert run.time[-1] <= 2101
    assert np.abs(run.columns[KNEE] - true[: len(run)]).max() < 1.0


@pytest.mark.parametrize("shift", [0, 1500])  # s, between the loads of two joints
def test_a_copy_has_its_sensors_noise_whatever_the_loads_and_as_warm_a_part_has_not(shift: int) -> None:
    time, current, true = _knee()
    rng = np.random.default_rng(6)
    hip, noise = true + rng.normal(0, 0.1, time.size), rng.normal(0, 0.1, time.size)
    log = _log(time, current, hip).assign(**{"current.hip": np.roll(current, shift)})
    assert [issue.kind for issue in read_log(log.assign(**{"temperature.hip": hip + noise}))[0].issues] == ["duplicate"]
    assert not read_log(log.assign(**{"temperature.hip": true + noise}))[0].issues


def test_rows_that_a_logger_repeats_are_left_out_and_a_robot_at_rest_is_logged() -> None:
    time, current, true = _knee(step=0.1)
    rng = np.random.default_rng(7)
    log = _log(time, current + rng.normal(0, 0.1, time.size), true + rng.normal(0, 0.05, time.size))
    log["velocity.knee"] = rng.normal(0, 1, time.size)
    names = [name for name in map(str, log) if name != "time"]
    assert not read_log(log)[0].issues
    for start in (6000, 17000, 30000):
        log.loc[start : start + 50, names] = log.loc[start, names].to_numpy()
    (issue,) = read_log(log)[0].issues
    assert (issue.key, issue.kind) == ("time", "held")


@pytest.mark.parametrize("seed", range(4))
def test_a_code_beside_a_coarse_sensor_that_rests_is_no_repeated_row(seed: int) -> None:
    """Both flicker between two numbers until the one fails for three seconds, in which the other happens to stand."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 900.0, 0.1)
    flickers = 50.0 + rng.integers(0, 2, (2, time.size))
    off = (time > 600) & (time < 603)
    flickers[0, off], flickers[1, off] = 30.0, 50.0
    log = pd.DataFrame({"time": time, "temperature.a": flickers[0], "temperature.b": flickers[1]})
    assert {issue.key for issue in read_log(log)[0].issues} == {"temperature.a"}


@pytest.mark.parametrize(("sigma", "steps"), [(0.1, 0.1), (0.1, 1.0), (0.3, 1.0), (0.5, 1.0), (0.0, 0.1)])
def test_coarse_sensors_that_seldom_move_are_no_repeated_rows(sigma: float, steps: float) -> None:
    time, current, true = _knee()
    rng = np.random.default_rng(9)
    read = [np.round((true + rng.normal(0, sigma, time.size)) / steps) * steps for _ in range(3)]
    log = _log(time, current, read[0]).assign(**{"temperature.a": read[1], "temperature.b": read[2]})
    assert "held" not in {issue.kind for issue in read_log(log)[0].issues}


def test_one_torque_in_two_columns_is_said_of_joints_that_move_apart() -> None:
    time, rng = np.arange(900.0), np.random.default_rng(8)
    torque, speed = rng.normal(0, 3, 900), rng.normal(0, 1, 900)
    log = pd.DataFrame({"time": time, "torque.a": torque, "torque.b": torque, "velocity.a": speed})
    apart, together = log.assign(**{"velocity.b": rng.normal(0, 1, 900)}), log.assign(**{"velocity.b": speed})
    assert [issue.kind for issue in read_log(apart)[0].issues] == ["duplicate"]
    assert not read_log(together)[0].issues
    stated = {"torque.b": ColumnSource(("torque.b",), valid=(-100.0, 100.0))}
    assert not read_log(apart, stated)[0].issues


@pytest.mark.parametrize("offset", [30.0, 40.0, 50.0])
def test_a_byte_with_an_offset_is_doubted_and_its_line_corrects_it(offset: float) -> None:
    time, current, true = _knee()
    log = _log(time, current, np.round(true) + offset)
    _, issues = _read(log)
    (issue,) = (issue for issue in issues if issue.kind == "offset")
    assert issue.corrected is not None
    taken, left = _read(log, {KNEE: issue.corrected})
    assert (not left, bool(np.abs(taken - true).max() < 1.0)) == (True, True)


JOINTS = ("base", "elbow", "wrist")


def _arm(start: float | tuple[float, ...] = 18.0, seed: int = 0, load: float = 1.0) -> pd.DataFrame:
    """45 min of an arm in air of 18 degC, whose joints warm each other, are moved by turns, and rest by turns."""
    rng, time = np.random.default_rng(seed), np.arange(2700.0)
    heat = rng.choice([0.0, 2.0, 5.0, 9.0], size=(45, 3)) * [1.5, 1.0, 0.4]  # W
    heat[[10, 11, 12, 13, 14, 30, 31, 32, 33, 34]] = 0.0
    current = np.sqrt(heat / WINDING)[(time // 60).astype(int)] * np.sqrt(load)
    capacities, outside, between = np.array([800.0, 300.0, 120.0]), np.array([2.5, 5.0, 9.0]), np.array([3.0, 4.0])
    flow = np.diff(np.eye(3), axis=0) / between[:, None]  # between neighbours, of their temperatures
    lost = np.diag(1 / outside) + np.diff(np.eye(3), axis=0).T @ flow
    warm = np.empty((time.size, 3))
    warm[0] = start
    for k, power in enumerate(WINDING * current[:-1] ** 2):
        warm[k + 1] = warm[k] + (power - lost @ (warm[k] - 18.0)) / capacities
    log = pd.DataFrame({"time": time, "temperature.ambient": 18.0})
    for k, joint in enumerate(JOINTS):
        log[f"current.{joint}"], log[f"temperature.{joint}"] = current[:, k], warm[:, k] + rng.normal(0, 0.1, time.size)
    return log


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("whole", [True, False], ids=["bytes", "fine"])
@pytest.mark.parametrize(
    ("shifted", "offset"), [(("elbow",), 40.0), (("wrist",), 30.0), (("base", "wrist"), 40.0), (JOINTS, 30.0)]
)
def test_an_offset_shows_though_neighbours_warm_the_joint(
    shifted: tuple[str, ...], offset: float, whole: bool, seed: int
) -> None:
    log = _arm(seed=seed)
    for joint in shifted:
        log[f"temperature.{joint}"] = log[f"temperature.{joint}"].round(0 if whole else 2) + offset
    issues = [issue for issue in read_log(log, strict=False)[0].issues if issue.kind == "offset"]
    of_air = shifted == JOINTS and not whole  # nothing says then that it is rather the sensors
    assert {issue.key for issue in issues} == {f"temperature.{joint}" for joint in (() if of_air else shifted)}
    for issue in issues:
        assert issue.corrected is not None
        assert issue.corrected.offset == pytest.approx(-offset, abs=1.0)
    meant = {issue.key: issue.corrected for issue in issues if issue.corrected}
    assert not read_log(log, meant)[0].issues


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("start", [58.0, 48.0, (58.0, 48.0, 48.0), (18.0, 58.0, 18.0), (30.0, 35.0, 48.0)])
@pytest.mark.parametrize("whole", [True, False], ids=["bytes", "fine"])
def test_a_joint_that_was_warm_has_no_offset(start: float | tuple[float, ...], whole: bool, seed: int) -> None:
    log = _arm(start, seed, load=3.5)  # which hardly lets it cool
    for name in log.filter(like="temperature."):
        log[name] = log[name].round(0 if whole else 2)
    assert not [issue.sentence for issue in read_log(log)[0].issues]


@pytest.mark.parametrize("every", [5.0, 60.0, 120.0])
def test_an_offset_shows_beside_air_of_a_clock_of_its_own(every: float) -> None:
    log = _arm()
    log["temperature.elbow"] = log["temperature.elbow"].round() + 40
    beside = pd.DataFrame({"time": np.arange(0.5, 2700, every), "temperature.ambient": 18.0})
    both = pd.concat([log.drop(columns="temperature.ambient"), beside]).sort_values("time", ignore_index=True)
    assert [issue.key for issue in read_log(both)[0].issues] == ["temperature.elbow"]


def _with_trunk(start: float = 18.0, seed: int = 0) -> tuple[pd.DataFrame, Array]:
    """That arm, and a trunk without a load that its base warms."""
    log, rng = _arm(seed=seed), np.random.default_rng(seed)
    into, kept = (0.5 * log["temperature.base"].to_numpy()[:-1] + 0.3 * 18.0) / 900, 1 - 0.8 / 900
    trunk = np.append(start, lfilter([1.0], [1.0, -kept], into, zi=[kept * start])[0])
    return log, trunk + rng.normal(0, 0.1, trunk.size)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("offset", [30.0, 40.0, 50.0])
def test_a_byte_with_an_offset_is_doubted_of_a_part_without_a_load(offset: float, seed: int) -> None:
    log, trunk = _with_trunk(seed=seed)
    (run,) = read_log(log.assign(**{"temperature.trunk": trunk.round() + offset}))
    meant = {issue.key: issue.corrected for issue in run.issues if issue.kind == "offset" and issue.corrected}
    assert meant.keys() == {issue.key for issue in run.issues} == {"temperature.trunk"}
    assert meant["temperature.trunk"].offset == -offset
    for start in (18.0 + offset, 18.0):  # one that was warm cools
        log, trunk = _with_trunk(start, seed)
        assert not read_log(log.assign(**{"temperature.trunk": trunk.round()}))[0].issues


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("joints", [("elbow",), ("wrist",), JOINTS], ids=str)
@pytest.mark.parametrize("air", [4.0, 18.0])
def test_degrees_that_are_stated_are_doubted_where_the_log_says_that_they_are_fahrenheit(
    joints: tuple[str, ...], air: float, seed: int
) -> None:
    log = _arm(seed=seed)
    names = [str(name) for name in log if str(name).startswith("temperature.")]
    log[names] += air - 18.0
    stated = {name: ColumnSource((name,), unit="degC") for name in names}
    assert not read_log(log, stated)[0].issues
    wrong = [f"temperature.{joint}" for joint in joints]
    log[wrong] = 1.8 * log[wrong] + 32
    issues = read_log(log, stated)[0].issues
    assert {issue.key for issue in issues if issue.corrected and issue.corrected.unit == "degF"} == set(wrong)
    assert {issue.key for issue in issues} == set(wrong)
    believed = {name: ColumnSource((name,), unit="degC", valid=(-500.0, 500.0)) for name in wrong}
    assert "valid = [" in issues[0].remedy
    assert not read_log(log, stated | believed)[0].issues


@pytest.mark.parametrize("warm", [30.4, 40.4, 22.5])
def test_a_computer_that_is_warm_by_itself_has_no_offset(warm: float) -> None:
    for seed in range(3):
        noise = np.random.default_rng(seed).normal(0, 0.3, 2700)
        log = _arm(seed=seed).assign(**{"temperature.pc": 18.0 + warm + noise})
        (run,) = read_log(log.round({"temperature.pc": 0}))
        assert "offset" not in {issue.kind for issue in run.issues}


def test_a_hot_knee_that_cools_has_no_offset() -> None:
    time, current, true = _knee(start=65.0)
    assert not _read(_log(time, current, np.round(true)))[1]


@pytest.mark.parametrize("air", [10.0, 18.0, 25.0, 30.0])
@pytest.mark.parametrize(("scale", "capacity"), [(1.7, 300.0), (1.4, 1000.0), (1.7, 3000.0)])
def test_a_joint_that_begins_as_warm_as_its_air_is_in_fahrenheit_is_told_by_where_it_would_settle(
    air: float, scale: float, capacity: float
) -> None:
    noise = np.random.default_rng(1).normal(0, 0.05, 3600)
    time, current, hot = _knee(air=air, start=1.8 * air + 32, scale=scale, capacity=capacity)
    assert hot.min() > hot[0] - 10.0  # it hardly cools, as one that begins at rest
    assert not _read(_log(time, current, hot + noise, air))[1]
    _, _, rested = _knee(air=air, start=air, scale=scale, capacity=capacity)
    log = _log(time, current, 1.8 * (rested + noise) + 32, air)
    (issue,) = _read(log)[1]
    assert "looks like degF" in issue.problem
    assert "if it is degC all the same" in issue.remedy
    assert issue.corrected is not None
    taken, left = _read(log, {KNEE: issue.corrected})
    assert (not left, bool(np.abs(taken - rested).max() < 0.5)) == (True, True)


@pytest.mark.parametrize(("unit", "shift"), [("degC", 273.15), ("K", 0.0)])
def test_a_unit_that_is_stated_is_doubted_where_nothing_has_such_temperatures(unit: str, shift: float) -> None:
    time, current, true = _knee()
    log = _log(time, current, true + shift)
    stated = {KNEE: ColumnSource((KNEE,), unit=unit)}
    _, (issue,) = _read(log, stated)
    assert (issue.kind, issue.certain, "in the unit that is stated" in issue.problem) == ("unit", True, True)
    assert issue.corrected is not None
    taken, left = _read(log, {KNEE: issue.corrected})
    assert (not left, bool(np.abs(taken - true).max() < 0.1)) == (True, True)
    believed = ColumnSource((KNEE,), unit=unit, valid=(-500.0, 500.0))
    assert not _read(log, {KNEE: believed})[1]


def test_a_nozzle_that_begins_cold_is_read_in_the_unit_that_is_stated() -> None:
    time, current, true = _knee(scale=4.5)
    log = _log(time, current, true)
    assert true.max() > np.median(true) > 250
    _, (issue,) = _read(log, {KNEE: ColumnSource((KNEE,), unit="degC")})
    assert (issue.kind, issue.certain) == ("unit", False)


def test_a_wire_that_is_open_for_one_slow_row_is_left_out_without_a_load() -> None:
    """Rows 20 s apart, and nothing that heats is logged: no part is 70 K colder in one row of them."""
    time, current, temperature = _knee(step=20.0)
    temperature[60] = -40.0
    log = _log(time, current, temperature).drop(columns="current.knee")
    (run,) = read_log(log, {}, inputs=["temperature.ambient"], outputs=[KNEE], strict=False, step=None)
    out = np.flatnonzero(np.isnan(run.columns[KNEE])).tolist()
    assert out in ([60], [60, 61])  # with the row in which it comes back, perhaps


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_loose_wire_is_no_counter_that_wraps(seed: int) -> None:
    """A sensor of 0.1 K, whose wire is open for 40 s: 1024 such steps reach from there to its part."""
    time, current, temperature = _knee(air=31.0, start=31.0, scale=0.5)
    loose = (time > 1500) & (time < 1541)
    temperature[loose] = -45.0 + np.random.default_rng(seed).normal(0.0, 0.5, loose.sum())
    readings, _ = _read(_log(time, current, temperature.round(1), air=31.0))
    assert np.isnan(readings[loose]).all()
    assert np.mean(np.isnan(readings)) < 0.05
