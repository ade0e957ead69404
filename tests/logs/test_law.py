"""A load's column that turns into something else is doubted from there on; what a robot does is not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest

from lptn.basics.errors import InputError
from lptn.logs.beside import refuse_doubtful
from lptn.logs.channels import Channels
from lptn.logs.columns import ColumnSource
from lptn.logs.law import warming
from lptn.logs.reading import read_log
from lptn.virtual import Bout, Job, leg_logs, quadruped_logs

Array = npt.NDArray[np.float64]
STEP, SINCE = 0.5, 1500.0  # s
CAPACITY, TO_AIR, LINK, WINDING = 300.0, 0.2, 0.3, 0.2  # J/K, W/K, W/K, ohm


def _two_joints(
    fan: float = 1.0,
    friction: float = 0.0,
    rise: float = 0.0,
    rest: float = 0.0,
    gear: float = 0.0,
    outside: float = 0.0,
    off: tuple[float, float] = (0.0, 0.0),
) -> pd.DataFrame:
    """50 min of two masses in one air; from the middle on one loses `fan` times as much; a rest.

    The first of them is in air `outside` K off the other's, and its drive is off from one time to another.
    """
    time, rng = np.arange(0.0, 3000.0 + rest, STEP), np.random.default_rng(2)
    load = np.stack(
        [
            rng.choice([0.0, 2.0, 4.0, 6.0, 8.0], size=60)[np.minimum(time // 50, 59).astype(int)] * (time < 3000)
            for _ in range(2)
        ]
    )
    speed = np.stack(
        [rng.choice([0.0, 1.0, 3.0], size=60)[np.minimum(time // 50, 59).astype(int)] * (time < 3000) for _ in range(2)]
    )
    warmth = np.zeros((2, time.size))
    for k in range(time.size - 1):
        to_air = TO_AIR * np.array([fan if time[k] >= SINCE else 1.0, 1.0])
        driven = load[:, k] * [not off[0] <= time[k] < off[1], True]
        heat = WINDING * driven**2 * (1 + rise * warmth[:, k]) + (friction + gear * driven) * speed[:, k]
        flow = heat - to_air * (warmth[:, k] - [outside, 0.0]) + LINK * (warmth[::-1, k] - warmth[:, k])
        warmth[:, k + 1] = warmth[:, k] + STEP * flow / CAPACITY
    readings = 25 + warmth + rng.normal(0, 0.05, warmth.shape)
    joints = {f"{key}.{joint}": rows[j] for j, joint in enumerate("ab")
              for key, rows in {"temperature": readings, "current": load, "velocity": speed}.items()}  # fmt: skip
    return pd.DataFrame({"time": time, "temperature.ambient": 25.0} | joints)


LATE: dict[str, Callable[[pd.DataFrame], Array]] = {
    "in another unit": lambda log: 0.4 * log["current.a"].to_numpy(),
    "in a smaller one": lambda log: 3.0 * log["current.a"].to_numpy(),
    "in steps of a sixth": lambda log: np.round(6.0 * log["current.a"].to_numpy()),
    "its size doubled, with a sign": lambda log: -2.0 * log["current.a"].to_numpy(),
}


@pytest.mark.parametrize("velocity", [True, False])
@pytest.mark.parametrize("what", LATE)
def test_a_load_that_is_something_else_from_some_row_on_is_doubted_and_concluded_from_by_nobody(
    what: str, velocity: bool
) -> None:
    log = _two_joints()
    log.loc[log["time"] >= SINCE, "current.a"] = LATE[what](log)[log["time"] >= SINCE]
    if not velocity:
        log = log.drop(columns=["velocity.a", "velocity.b"])
    (run,) = read_log(log)
    (issue,) = run.issues
    assert (issue.key, issue.kind, issue.certain) == ("current.a", "unit", False)
    assert issue.stretch is not None
    assert issue.stretch[0] == pytest.approx(SINCE, abs=100)
    with pytest.raises(InputError, match=r"times as much as before.*valid = \["):
        refuse_doubtful([run])
    (run,) = read_log(log, {"current.a": ColumnSource(("current.a",), valid=(-80.0, 80.0))})
    assert not run.issues


@pytest.mark.parametrize(
    "robot",
    [{}, {"fan": 3.0}, {"friction": 2.0}, {"rise": 0.01}, {"fan": 0.3, "friction": 1.0}, {"gear": 2.0}],
    ids=str,
)
@pytest.mark.parametrize("velocity", [True, False])
@pytest.mark.parametrize("rest", [False, True])
def test_of_what_a_robot_does_nothing_is_said(robot: dict[str, Any], velocity: bool, rest: bool) -> None:
    log = _two_joints(**robot)
    if not velocity:
        log = log.drop(columns=["velocity.a", "velocity.b"])
    if rest:
        log = log[log["time"] < SINCE + 300]
    assert not read_log(log)[0].issues


@pytest.mark.parametrize("period", [25.0, 30.0, 45.0])
def test_of_a_load_that_swings_as_fast_as_is_averaged_nothing_is_said(period: float) -> None:
    """Half of a block's heat counted for the step before it: a light part moved by a tenth otherwise."""
    time, above = np.arange(0.0, 2400.0, 1.0), 0.0
    rng = np.random.default_rng(int(period))
    level = rng.choice([0.0, 2.0, 4.0, 5.0], size=24)[(time // 100).astype(int)]
    current = level * (1 + 0.5 * np.sin(2 * np.pi * time / period))
    readings = []
    for amperes in current:
        readings.append(25.0 + above + 0.05 * rng.standard_normal())
        above += (WINDING * amperes**2 + 1.0 - TO_AIR * above) / 20.0
    columns = {"time": time, "temperature.ambient": 25.0, "temperature.a": readings, "current.a": current}
    (run,) = read_log(pd.DataFrame(columns))
    assert not run.issues
    law = warming(
        Channels({key: np.broadcast_to(x, time.size) for key, x in columns.items()}), "temperature.a", "current.a"
    )
    assert law is not None
    assert law.error < 0.1  # K; 0.4 to 0.9 before


@pytest.mark.parametrize("outside", [-110.0, -80.0, 50.0])
@pytest.mark.parametrize("friction", [0.0, 1.0])
def test_of_a_part_in_other_air_that_nobody_logged_nothing_is_said(outside: float, friction: float) -> None:
    log = _two_joints(outside=outside, friction=friction)
    assert outside > 0 or friction > 0 or log["temperature.a"].min() < 10
    assert not read_log(log)[0].issues
    assert not read_log(log.drop(columns="temperature.ambient"))[0].issues


def _bouts(rng: np.random.Generator, motions: dict[str, float], shortest: int, longest: int, most: float) -> Job:
    """Each motion with its speed for a while, in some order, and a rest."""
    order = [list(motions.items())[k] for k in rng.permutation(len(motions))]
    bouts = [Bout(name, int(rng.uniform(shortest, longest)), at, float(rng.uniform(0, most))) for name, at in order]
    return Job((*bouts, Bout("rest", 500)), 22.0, cutout=None)


@pytest.mark.long
@pytest.mark.parametrize("seed", [1173, 1176])
def test_of_gaits_that_follow_each_other_nothing_is_said(seed: int) -> None:
    """Hips that hardly work are warmed by their thighs, until a gait comes in which they sway."""
    motions = {"stand": 0.0, "trot": 0.5, "rest": 0.0, "squat": 1.0, "walk": 0.4, "leg_sweep": 1.0, "sway": 1.0}
    job = _bouts(np.random.default_rng([seed, 5]), motions, 200, 400, 3.0)
    log = quadruped_logs(seed=seed, runs={"gaits": job}, noise=0.1, quantisation=0.1)["gaits"].reset_index(drop=True)
    assert not read_log(log)[0].issues


@pytest.mark.parametrize("seed", [1, 6])
def test_of_loads_that_are_sampled_too_seldom_to_tell_their_squares_nothing_is_said(seed: int) -> None:
    motions = {"stand": 1.0, "trot": 0.9, "rest": 1.0, "squat": 1.0, "walk": 0.5, "leg_sweep": 1.0}
    job = _bouts(np.random.default_rng(seed), motions, 240, 500, 5.0)
    log = leg_logs([], seed=seed, noise=0.1, quantisation=0.1, rate=1.0, runs={"gaits": job})["gaits"]
    log = log.reset_index(drop=True)
    torques = [name for name in map(str, log) if name.startswith("torque.")]
    log[torques] = log[torques].iloc[log.index // 5 * 5].to_numpy()
    assert not read_log(log)[0].issues


# --- A sensor that is elsewhere than its part -------------------------------------------------------


def _loose(constant: float, until: float = np.inf) -> Callable[[Array, Array], Array]:
    def change(time: Array, readings: Array) -> Array:
        off = (time > SINCE) & (time < until)
        return np.where(off, 25 + (readings - 25) * np.exp(-np.maximum(time - SINCE, 0.0) / constant), readings)

    return change


ELSEWHERE: dict[str, Callable[[Array, Array], Array]] = {
    "comes loose in air that slowly cools it": _loose(200.0),
    "comes loose, small": _loose(40.0),
    "falls off": _loose(0.1),
    "is put back": _loose(60.0, 2500.0),
    "stands": lambda time, readings: np.where((time > 700) & (time < 2200), readings[int(700 / STEP)], readings),
    "stands to the end": lambda time, readings: np.where(time > 600, readings[int(600 / STEP)], readings),
}


@pytest.mark.parametrize("steps", [0.1, 1.0])
@pytest.mark.parametrize("what", ELSEWHERE)
def test_a_sensor_that_its_parts_heat_does_not_move_is_said_and_left_out(what: str, steps: float) -> None:
    log = _two_joints()
    time, true = log["time"].to_numpy(), log["temperature.a"].to_numpy()
    readings = np.round(ELSEWHERE[what](time, true) / steps) * steps
    log["temperature.a"], log["temperature.b"] = readings, log["temperature.b"].round(1)
    (run,) = read_log(log)
    assert {issue.key for issue in run.issues} == {"temperature.a"}
    taken, truth = run.columns["temperature.a"], np.interp(run.time, time, true)
    wrong = np.abs(np.interp(run.time, time, readings) - truth) > 2.0
    assert wrong.sum() > 100
    assert np.isnan(taken[wrong]).mean() > 0.95
    assert np.isnan(taken[~wrong]).mean() < 0.4  # it may stand where its part passes


@pytest.mark.parametrize("steps", [0.1, 1.0])
def test_a_sensor_that_is_read_upside_down_is_in_no_colder_air(steps: float) -> None:
    """What its load cools is colder than all around it by no law of a part."""
    log = _two_joints()
    log["temperature.a"] = np.round((50 - log["temperature.a"]) / steps) * steps
    (run,) = read_log(log)
    assert {issue.key for issue in run.issues} == {"temperature.a"}
    assert np.isnan(run.columns["temperature.a"]).mean() > 0.7


@pytest.mark.parametrize("robot", [{}, {"fan": 3.0}, {"friction": 2.0}, {"rise": 0.01}])
@pytest.mark.parametrize("velocity", [True, False])
def test_a_coarse_sensor_of_a_joint_that_rests_or_cools_to_the_air_is_believed(
    robot: dict[str, Any], velocity: bool
) -> None:
    """It stands for long, and at last it is the air's: nothing else could be expected where no heat comes."""
    log = _two_joints(**robot, rest=6000.0)
    log = log if velocity else log.drop(columns=["velocity.a", "velocity.b"])
    names = ["temperature.a", "temperature.b"]
    assert not read_log(log.assign(**{name: log[name].round() for name in names}))[0].issues


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("stuck", [(SINCE, np.inf), (2000.0, np.inf), (0.0, 1500.0)], ids=str)
@pytest.mark.parametrize("dither", [0.05, 0.2])
def test_a_sensor_that_is_stuck_but_for_its_noise_is_left_out_and_its_load_is_believed(
    seed: int, stuck: tuple[float, float], dither: float
) -> None:
    log, rng = _two_joints(), np.random.default_rng(seed)
    time, true = log["time"].to_numpy(), log["temperature.a"].to_numpy()
    off = (time >= stuck[0]) & (time < stuck[1])
    level = true[off][-1 if stuck[0] == 0 else 0]
    log["temperature.a"] = np.where(
        off, level + rng.normal(0, dither, time.size), true + rng.normal(0, 0.05, time.size)
    )
    (run,) = read_log(log.round(2))
    assert {(issue.key, issue.kind) for issue in run.issues} == {("temperature.a", "disconnected")}
    taken = np.isfinite(run.columns["temperature.a"])
    inside = (run.time >= stuck[0]) & (run.time < stuck[1])
    assert taken[inside].mean() < 0.15
    assert taken[~inside].mean() > 0.85


def test_of_a_drive_that_is_disabled_the_load_is_said_and_not_the_sensor() -> None:
    """It is commanded as before, but its part cools as parts do."""
    log, real = _two_joints(), _two_joints(rest=SINCE)
    off = log["time"] >= SINCE
    warm = real["temperature.a"].reindex(log.index).ffill()
    air, since = log.loc[off, "temperature.ambient"], log.loc[off, "time"] - SINCE
    warm[off] = air + (warm[off].iloc[0] - air.iloc[0]) * np.exp(-since / 900)
    log["temperature.a"] = warm + np.random.default_rng(0).normal(0, 0.05, len(log))
    (issue,) = read_log(log.round(3))[0].issues
    assert issue.key == "current.a"
    assert "does not heat temperature.a" in issue.problem


@pytest.mark.parametrize("what", ["temperature", "current"])
@pytest.mark.parametrize("steps", [0.1, 1.0])
def test_columns_of_two_joints_that_are_exchanged_are_said_and_concluded_from_by_nobody(
    what: str, steps: float
) -> None:
    log = _two_joints()
    names = ["temperature.a", "temperature.b"]
    log[names] = np.round(log[names] / steps) * steps
    assert not read_log(log)[0].issues
    own = [f"{what}.a", f"{what}.b"]
    log[own] = log[own[::-1]].to_numpy()
    (run,) = read_log(log)
    assert {(issue.key, issue.kind) for issue in run.issues} == {(name, "exchanged") for name in names}
    with pytest.raises(InputError, match=r"better than current.a.*valid = \["):
        refuse_doubtful([run])
    believed = {name: ColumnSource((name,), valid=(-500.0, 500.0)) for name in names}
    assert not read_log(log, believed)[0].issues


@pytest.mark.parametrize("off", [(0.0, 1100.0), (700.0, 1500.0), (1300.0, 2400.0), (1800.0, 9e9)], ids=str)
@pytest.mark.parametrize("steps", [0.0, 0.25])
def test_of_a_drive_that_is_disabled_for_a_while_the_load_is_said_and_when(
    off: tuple[float, float], steps: float
) -> None:
    log = _two_joints(off=off)
    log["temperature.a"] = np.round(log["temperature.a"] / steps) * steps if steps else log["temperature.a"]
    (issue,) = read_log(log)[0].issues
    assert issue.key == "current.a"
    assert "does not heat temperature.a" in issue.problem
    assert issue.stretch == pytest.approx((off[0], min(off[1], log["time"].max())), abs=150)


@pytest.mark.parametrize(("row", "value"), [(700, 18_000.0), (2200, -3e5), (4000, 2e3)])
def test_a_single_load_that_no_joint_bears_makes_no_sensor_doubtful(row: int, value: float) -> None:
    log = _two_joints()
    log.loc[row, "current.a"] = value
    log["temperature.a"] = log["temperature.a"].round()
    assert {issue.key for issue in read_log(log, strict=False)[0].issues} == {"current.a"}


@pytest.mark.parametrize(("code", "times"), [(850.0, 1), (-127.0, 3), (65535.0, 2)])
def test_a_code_at_rest_is_a_code_and_no_way_back_to_the_air(code: float, times: int) -> None:
    """It makes the mean of a block hot, and what follows in a joint that rests is the air's."""
    log = _two_joints(rest=3000.0)
    for k in range(times):
        log.loc[11000 + 200 * k : 11003 + 200 * k, "temperature.a"] = code
    (issue,) = read_log(log)[0].issues
    assert (issue.key, issue.kind) == ("temperature.a", "code")


def test_a_part_that_settles_under_a_steady_load_follows_it() -> None:
    """Of two masses one law is a little off; where the load is steady, its heat may be called other heat."""
    time, air = np.arange(2000.0), 22.3
    current = np.where((time > 3) & (time < 1850), 20.0, 0.0)
    fast, slow = np.zeros(2000), np.zeros(2000)  # K above the air, of a small driver and of the plate that it is on
    for k in range(1999):
        fast[k + 1] = fast[k] + 4e-4 * current[k] ** 2 - (fast[k] - slow[k]) / 15 - fast[k] / 60
        slow[k + 1] = slow[k] + (fast[k] - slow[k]) / 150 - slow[k] / 400
    rng = np.random.default_rng(5)
    columns = {"time": time, "current.esc": current + 0.1 * rng.standard_normal(2000)}
    columns |= {"temperature.esc": np.round(air + fast + 0.01 * rng.standard_normal(2000), 2)}
    columns |= {"temperature.ambient": air + 0.1 * rng.standard_normal(2000)}
    assert 4.0 < np.ptp(fast) < 5.0
    (run,) = read_log(pd.DataFrame(columns))
    assert not run.issues
