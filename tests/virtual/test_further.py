"""Check what new effects are driven by: further columns, and the heat that goes with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from lptn.virtual import Hidden, Run, Segment, leg_logs, quadruped, quadruped_logs, write_quadruped
from lptn.virtual.quadruped_truth import JOINTS
from lptn.virtual.record import live
from lptn.virtual.robot import Array

MOVES = (Segment("trot", 200, 0.7, 4.0), Segment("sway", 150, 1.0), Segment("rest", 150), Segment("stand", 100))
RUNS = {"mix": Run(MOVES, 20.0, cutout=None)}
SHARED = ["power.battery", "speed.fan", "irradiance.global"]
UNSIGNED = [f"{quantity}.{joint}" for quantity in ("torque_abs", "mechanical_power") for joint in JOINTS]
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
    logs = quadruped_logs(seed=1, runs="trial", columns="all").values()
    log = pd.concat(logs)
    resting = log["powered.FR_hip"].eq(0) & log["power.pc"].eq(16) & log["power.battery"].lt(17)
    assert (log.loc[resting, "power.battery"] == 16).all()
    assert resting.sum() > 600
    assert 150 < log["power.battery"].max() < 800
    assert 0.2 < log["speed.fan"].gt(0).mean() < 0.8
    assert log["speed.fan"].between(0, 1).all()
    assert log["irradiance.global"].between(0, 700).all()
    assert log["irradiance.global"].std() > 100


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


def test_mcap_says_what_it_cannot_hold(tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="MCAP needs the extra 'robots'")
    with pytest.raises(ValueError, match=r"format: mcap has no topic for power\.battery; expected parquet or csv"):
        write_quadruped(tmp_path, [("battery_heat", "*")], seed=1, runs=RUNS, format="mcap")
    assert not list(tmp_path.iterdir())


HIDDEN = (
    *(("gear_loss", "*", 1.0), ("driver_loss", "*_hip", 1.0), ("computer_heat", "FR_calf", 1.0)),
    *(("battery_heat", "pc", 1.0), ("solar", "*_thigh", 1.0), ("fan", "*", 1.0), ("shared_mass", "*_calf", 1.0)),
    *(("loss_scale", "RL_calf", 1.0), ("surface_scale", "RR_hip", -1.0), ("ambient_lag", "ambient", 1.0)),
)


def test_heat_is_the_one_written_down() -> None:
    """The robot's log alone, its parameters and the docstrings' numbers, integrated by scipy."""
    robot = quadruped(seed=4, physics="plain")
    (record,) = live(quadruped(HIDDEN, seed=4, physics="plain"), RUNS, 4, "none")
    means, motion, air = record.motion.means(), record.motion, record.ambient
    battery = motion.pc + 4 * motion.powered.sum(axis=1)
    battery += (0.15 / (9.1 * 0.0927) ** 2 * means.torque2 + means.power).sum(axis=1)
    part = np.array([joint.rpartition("_")[2] for joint in JOINTS] + ["pc"])
    calves, loss, surface = np.flatnonzero(part == "calf"), np.ones(12), np.ones(13)
    loss[JOINTS.index("RL_calf")], surface[JOINTS.index("RR_hip")] = 1.2, 0.7
    outside = (air.true[:-1] + air.true[1:]) / 2

    def slope(_: float, T: Array, k: int) -> Array:
        node, frame = T[:13], T[13]
        heat = np.zeros(13)
        heat[:12] = loss * robot.resistance[:12] * means.torque2[k] / (9.1 * 0.0927) ** 2 + 4 * motion.powered[k]
        heat[:12] += 0.1 * means.power[k] + 0.5 * means.torque1[k] * (part[:12] == "hip")
        heat[2] += 0.1 * motion.pc[k]
        heat[12] += motion.pc[k] + 0.01 * battery[k]
        heat += 0.005 * motion.sun[k] * (part == "thigh")
        heat -= surface * (1 + 0.5 * motion.fan[k]) * robot.to_air * (node - outside[k])
        for i, j, conductance in robot.links:
            heat[i] += conductance * (node[j] - node[i])
            heat[j] += conductance * (node[i] - node[j])
        heat[calves] += (frame - node[calves]) / 17
        into = ((node[calves] - frame) / 17).sum() - 4 / 42 * (frame - outside[k])
        return np.append(heat / robot.capacity, into / 480)

    exact = [np.full(14, 20.0)]
    for k in range(600):
        exact.append(solve_ivp(slope, (0, 1), exact[-1], args=(k,), rtol=1e-8, atol=1e-8).y[:, -1])
    assert np.ptp(exact, axis=0).max() > 5
    assert np.abs(record.states - exact).max() < 1e-3
