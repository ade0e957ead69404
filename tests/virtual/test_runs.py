"""Check the sets of runs: what they hold, and whether the trial excites every effect and tells them apart."""

from __future__ import annotations

from functools import cache

import numpy as np
import pandas as pd
import pytest

from lptn.virtual import (
    EFFECTS,
    QUADRUPED_JOINTS,
    QUADRUPED_NODES,
    Bout,
    Job,
    places,
    plan,
    quadruped_logs,
)
from lptn.virtual.robot import Array
from tests.truth.plans import swing, trial

HOT = [f"temperature.{joint}" for joint in QUADRUPED_JOINTS]


def test_trial_powers_every_joint_alone_with_three_others() -> None:
    runs = trial(5)
    assert list(runs) == ["fit1", "fit2", "holdout"]
    for name in ("fit1", "fit2"):
        held = [joint for segment in runs[name].segments for joint in segment.joints]
        assert sorted(held) == sorted(3 * QUADRUPED_JOINTS)
    assert all(run.segments[-1].activity == "rest" and run.cutout is None for run in runs.values())
    for physics, coldest in (("full", 60), ("plain", 50)):
        logs = quadruped_logs(seed=5, runs=runs, physics=physics)  # type: ignore[arg-type]
        hottest = max(truth[HOT].max().max() for truth in logs.truth.values())
        assert coldest < hottest < 95


@pytest.mark.long
def test_tests_are_the_sources_conditions() -> None:
    runs = plan("tests", 1)
    named = ["stand", "trot_0kg_low", "trot_0kg_high", "trot_4kg_low", "walk_4kg", "cooling", "multi_gait"]
    assert list(runs) == named
    assert all(run.seconds == 1800 for run in runs.values())
    multi = [(segment.activity, segment.load) for segment in runs["multi_gait"].segments]
    assert multi == [("stand", 0), ("stand", 4), ("trot", 2), ("trot", 4), ("walk", 4)]
    cooling = quadruped_logs(seed=1, runs=runs).truth["cooling"][HOT]
    assert cooling.iloc[0].max() > 50
    assert cooling.iloc[-1].max() < 45


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Bout("fly", 10), "activity: found 'fly'; expected one of rest, stand"),
        (lambda: Bout("trot", 0), "seconds of trot: found 0"),
        (lambda: Bout("trot", 10, 9.0), "speed of trot: found 9; expected 0 to 3 m/s"),
        (lambda: Bout("hold", 10), "joints of hold: found 0"),
        (lambda: Bout("hold", 10, joints=("knee",)), "joints of hold: found 'knee'"),
        (lambda: Job(()), "segments: found none"),
        (lambda: plan("tests", -1), "seed: found -1"),
    ],
)
def test_bad_plans_are_refused(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]


# --- the trial -----------------------------------------------------------------------------------------------------

SEED = 1
SOME = (
    *("FR_hip", "FL_thigh", "RR_calf", "pc", "*_hip", "*_calf", "FL_calf~FR_calf", "RL_hip~RR_calf"),
    *("FR_calf~FR_thigh", "RL_hip~pc", "ambient"),
)


@cache
def temperatures(runs: str, *hidden: tuple[str, str]) -> Array:
    """Return the readings without noise of all runs, of shape (rows, nodes)."""
    planned = swing(SEED) if runs == "swing" else trial(SEED)
    logs = quadruped_logs(hidden, seed=SEED, runs=planned, physics="plain", noise=0, quantisation=0)
    return np.concatenate(
        [log[[f"temperature.{node}" for node in QUADRUPED_NODES]].to_numpy() for log in logs.values()]
    )


@cache
def minutes(run: str) -> pd.DataFrame:
    """Return the means of one run over each minute."""
    logs = quadruped_logs(seed=SEED, runs=trial(SEED), physics="plain", columns="all")
    squares = {f"squared.{joint}": logs[run][f"torque.{joint}"] ** 2 for joint in QUADRUPED_JOINTS}
    log = logs[run].assign(**squares)
    return log.groupby(np.arange(len(log)) // 60).mean()


@pytest.mark.long
def test_torques_move_independently() -> None:
    """No joint's copper loss follows from those of all others, speed and drives."""
    both = pd.concat([minutes("fit1"), minutes("fit2")])
    losses = both[[f"squared.{joint}" for joint in QUADRUPED_JOINTS]].to_numpy()
    losses = losses - losses.mean(axis=0)
    follows = 1 - 1 / (np.diag(np.linalg.inv(np.cov(losses.T))) * losses.var(axis=0, ddof=1))
    assert follows.max() < 0.95


def test_load_and_speed_come_apart() -> None:
    both = pd.concat([minutes("fit1"), minutes("fit2")])
    for joint in QUADRUPED_JOINTS:
        torque, speed = both[f"torque.{joint}"], both[f"velocity.{joint}"]
        assert ((torque < 1) & (speed > 2)).sum() >= 4, "spins without load"
        assert ((torque > 1) & (speed < 0.01) & (both[f"powered.{joint}"] == 1)).sum() >= 4, "stands loaded"
        power = both[f"mechanical_power.{joint}"]
        assert power.max() > 8, "moves loaded"
    standing = (both["velocity.FR_calf"] < 0.01) & (both["speed.base"] == 0)
    assert (both["speed.base"] > 0.5).sum() > 10
    assert (standing & (both["torque.FR_calf"] > 4)).sum() >= 4


def test_every_run_cools_down_in_an_ambient_of_its_own() -> None:
    runs = ("fit1", "fit2", "holdout")
    for run in runs:
        last = minutes(run).iloc[-4:]
        assert not last[[f"powered.{joint}" for joint in QUADRUPED_JOINTS]].to_numpy().any()
        cooled = last[[f"temperature.{joint}" for joint in QUADRUPED_JOINTS]].to_numpy()
        assert (cooled[0] - cooled[-1]).max() > 0.5
    ambients = [minutes(run)["temperature.ambient"].iloc[0] for run in runs]
    assert np.diff(sorted(ambients)).min() >= 5
    assert [len(minutes(run)) for run in runs] == [60, 60, 40]


def test_shorter_one_has_an_hour_to_fit() -> None:
    runs = trial(SEED, fitted=1800)
    assert {name: run.seconds for name, run in runs.items()} == {"fit1": 1800, "fit2": 1800, "holdout": 2400}
    same = trial(SEED)
    assert runs["holdout"] == same["holdout"]
    acts = [(one.activity, one.joints, one.torque) for one in runs["fit2"].segments]
    assert acts == [(one.activity, one.joints, one.torque) for one in same["fit2"].segments]


@pytest.mark.slow
@pytest.mark.parametrize("every", [pytest.param(2, id="some"), pytest.param(1, id="all", marks=pytest.mark.slow)])
@pytest.mark.parametrize("effect", EFFECTS)
def test_every_effect_is_excited(effect: str, every: int) -> None:
    """The table of excursions is printed by ``pytest -s``."""
    runs = "swing" if effect == "ambient_lag" else "trial"
    everywhere = places(effect, "quadruped")
    chosen = [place for place in SOME if place in everywhere][::every] or ["*"]
    moved = {at: float(np.abs(temperatures(runs, (effect, at)) - temperatures(runs)).max()) for at in chosen}
    print(f"{effect:20s}", "  ".join(f"{place} {peak:.2f} K" for place, peak in moved.items()))
    assert all(0.5 < peak < 9 for peak in moved.values())
    single = [peak for place, peak in moved.items() if place != "pc"]
    assert 1 < max(single) < 6
