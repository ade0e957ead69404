"""Check the plan "trial": does it excite every effect, and does it tell them apart?"""

from __future__ import annotations

from functools import cache

import numpy as np
import pandas as pd
import pytest

from lptn.virtual import EFFECTS, places, plan, quadruped_logs
from lptn.virtual.quadruped_truth import JOINTS, NODES
from lptn.virtual.robot import Array

SEED = 1
SOME = (
    *("FR_hip", "FL_thigh", "RR_calf", "pc", "*_hip", "*_calf", "FL_calf~FR_calf", "RL_hip~RR_calf"),
    *("FR_calf~FR_thigh", "RL_hip~pc", "ambient"),
)


@cache
def temperatures(runs: str, *hidden: tuple[str, str]) -> Array:
    """Return the readings without noise of all runs, of shape (rows, nodes)."""
    logs = quadruped_logs(hidden, seed=SEED, runs=runs, physics="plain", noise=0, quantisation=0)  # type: ignore[arg-type]
    return np.concatenate([log[[f"temperature.{node}" for node in NODES]].to_numpy() for log in logs.values()])


@pytest.mark.parametrize("effect", EFFECTS)
def test_every_effect_is_excited(effect: str) -> None:
    """The table of excursions is printed by ``pytest -s``."""
    runs = "swing" if effect == "ambient_lag" else "trial"
    everywhere = places(effect, "quadruped")
    chosen = [place for place in SOME if place in everywhere] or ["*"]
    moved = {at: float(np.abs(temperatures(runs, (effect, at)) - temperatures(runs)).max()) for at in chosen}
    print(f"{effect:20s}", "  ".join(f"{place} {peak:.2f} K" for place, peak in moved.items()))
    assert all(0.5 < peak < 9 for peak in moved.values())
    single = [peak for place, peak in moved.items() if place != "pc"]
    assert 1 < max(single) < 6


@cache
def minutes(run: str) -> pd.DataFrame:
    """Return the means of one run over each minute."""
    logs = quadruped_logs(seed=SEED, runs="trial", physics="plain", columns="all")
    squares = {f"squared.{joint}": logs[run][f"torque.{joint}"] ** 2 for joint in JOINTS}
    log = logs[run].assign(**squares)
    return log.groupby(np.arange(len(log)) // 60).mean()


def test_torques_move_independently() -> None:
    """No joint's copper loss follows from those of all others, speed and drives."""
    both = pd.concat([minutes("fit1"), minutes("fit2")])
    losses = both[[f"squared.{joint}" for joint in JOINTS]].to_numpy()
    losses = losses - losses.mean(axis=0)
    follows = 1 - 1 / (np.diag(np.linalg.inv(np.cov(losses.T))) * losses.var(axis=0, ddof=1))
    assert follows.max() < 0.95


def test_load_and_speed_come_apart() -> None:
    both = pd.concat([minutes("fit1"), minutes("fit2")])
    for joint in JOINTS:
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
        assert not last[[f"powered.{joint}" for joint in JOINTS]].to_numpy().any()
        cooled = last[[f"temperature.{joint}" for joint in JOINTS]].to_numpy()
        assert (cooled[0] - cooled[-1]).max() > 0.5
    ambients = [minutes(run)["temperature.ambient"].iloc[0] for run in runs]
    assert np.diff(sorted(ambients)).min() >= 5
    assert [len(minutes(run)) for run in runs] == [60, 60, 40]


def test_shorter_one_has_an_hour_to_fit() -> None:
    runs = plan("hour", SEED)
    assert {name: run.seconds for name, run in runs.items()} == {"fit1": 1800, "fit2": 1800, "holdout": 2400}
    same = plan("trial", SEED)
    assert runs["holdout"] == same["holdout"]
    acts = [(one.activity, one.joints, one.torque) for one in runs["fit2"].segments]
    assert acts == [(one.activity, one.joints, one.torque) for one in same["fit2"].segments]
