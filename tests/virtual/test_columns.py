"""Check the columns that a log has beyond the usual ones: what new effects are driven by."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from lptn.virtual import QUADRUPED_JOINTS, Bout, Hidden, Job, leg_logs, quadruped_logs
from tests.truth.plans import trial

MOVES = (Bout("trot", 200, 0.7, 4.0), Bout("sway", 150, 1.0), Bout("rest", 150), Bout("stand", 100))
RUNS = {"mix": Job(MOVES, 20.0, cutout=None)}
SHARED = ["power.battery", "speed.fan", "irradiance.global"]
UNSIGNED = [f"{quantity}.{joint}" for quantity in ("torque_abs", "mechanical_power") for joint in QUADRUPED_JOINTS]
COLUMNS = {
    "gear_loss": UNSIGNED[12:],
    "driver_loss": UNSIGNED[:12],
    "battery_heat": SHARED[:1],
    "fan": SHARED[1:2],
    "solar": SHARED[2:],
    "computer_heat": [],
    "radiation": [],
}


@pytest.mark.parametrize("effect", COLUMNS)
def test_effect_asks_for_its_columns(effect: str) -> None:
    usual = quadruped_logs(seed=1, runs=RUNS, columns="asked")["mix"]
    log = quadruped_logs([(effect, "FR_calf")], seed=1, runs=RUNS)["mix"]
    assert sorted(set(log.columns) - set(usual.columns)) == sorted(COLUMNS[effect])
    without = quadruped_logs([(effect, "FR_calf", 0.0)], seed=1, runs=RUNS)["mix"]
    pd.testing.assert_frame_equal(usual, without, check_exact=True)


def test_all_columns_give_no_effect_away() -> None:
    usual, every = (quadruped_logs(seed=1, runs=RUNS, columns=which)["mix"] for which in ("asked", "all"))
    assert set(every.columns) - set(usual.columns) == {*SHARED, *UNSIGNED}
    pd.testing.assert_frame_equal(every[usual.columns], usual, check_exact=True)
    assert list(quadruped_logs([("solar", "*")], seed=1, runs=RUNS, columns="all")["mix"]) == list(every)
    with pytest.raises(ValueError, match="columns: found 'some'; expected one of asked, all"):
        quadruped_logs(seed=1, runs=RUNS, columns="some")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="columns: found 'some'; expected one of asked, all"):
        leg_logs(seed=1, columns="some")  # type: ignore[arg-type]


def test_columns_are_those_of_the_samples() -> None:
    fast, slow = (quadruped_logs(seed=1, runs=RUNS, columns="all", rate=rate)["mix"] for rate in (100, 1))
    assert set(slow.columns) - set(fast.columns) > set(UNSIGNED)
    second = np.arange(len(fast)) // 100
    for joint in ("FR_hip", "RL_calf"):
        torque, velocity = (fast[f"{quantity}.{joint}"].astype(float) for quantity in ("torque", "velocity"))
        force, power = (values.abs().groupby(second).mean().to_numpy() for values in (torque, torque * velocity))
        assert slow[f"torque_abs.{joint}"].to_numpy() == pytest.approx(force, rel=1e-5, abs=1e-6)
        assert slow[f"mechanical_power.{joint}"].to_numpy() == pytest.approx(power, rel=1e-5, abs=1e-6)
    for name in SHARED:
        assert fast[name].iloc[::100].to_numpy() == pytest.approx(slow[name].to_numpy(), rel=1e-6)


def test_columns_are_plausible() -> None:
    logs = quadruped_logs(seed=1, runs=trial(1), columns="all").values()
    log = pd.concat(logs)
    resting = log["powered.FR_hip"].eq(0) & log["power.pc"].eq(16) & log["power.battery"].lt(17)
    assert (log.loc[resting, "power.battery"] == 16).all()
    assert resting.sum() > 600
    assert 150 < log["power.battery"].max() < 800
    assert 0.2 < log["speed.fan"].gt(0).mean() < 0.8
    assert log["speed.fan"].between(0, 1).all()
    assert log["irradiance.global"].between(0, 700).all()
    assert log["irradiance.global"].std() > 100


@pytest.mark.long
def test_leg_has_the_columns_too() -> None:
    fast, slow = (leg_logs(seed=2, noise=0, columns="all", rate=rate)["fit2"] for rate in (10, 1))
    second = np.arange(len(fast)) // 10
    power = (fast["torque.FR_calf"] * fast["velocity.FR_calf"]).abs().groupby(second).mean()
    assert slow["mechanical_power.FR_calf"].to_numpy() == pytest.approx(power.to_numpy())
    assert slow["torque_abs.FR_hip"].to_numpy() == pytest.approx(fast["torque.FR_hip"].abs().groupby(second).mean())
    for name in (*SHARED, "power.pc"):
        assert fast[name].groupby(second).mean().to_numpy() == pytest.approx(slow[name].to_numpy())
        assert slow[name].std() > 0
    asked = leg_logs([Hidden("computer_heat", "FR_hip")], seed=2, rate=1)["fit2"]
    assert set(slow.columns) - set(asked.columns) == {*SHARED, *(n for n in UNSIGNED if "FR" in n)}
