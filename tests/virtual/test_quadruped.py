"""Check the quadruped's logs: columns, runs, carried temperatures, cut-outs, rates, sensors."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from lptn.virtual import (
    QUADRUPED_JOINTS,
    QUADRUPED_NODES,
    Bout,
    Hidden,
    Job,
    Logs,
    quadruped_logs,
)
from lptn.virtual.motion import draw_motion
from lptn.virtual.robot import Array, stream

TEMPERATURES = [f"temperature.{node}" for node in QUADRUPED_NODES]
MIX = Job((Bout("trot", 240, 0.5, 2.0), Bout("stand", 60), Bout("hold", 60, joints=("RL_calf",), torque=8.0)))


def columns(*, slow: bool) -> list[str]:
    moves = ["torque", "velocity", *["velocity_rms"] * slow]
    return [
        "time",
        *(f"{quantity}.{joint}" for quantity in moves for joint in QUADRUPED_JOINTS),
        "speed.base",
        *(f"powered.{joint}" for joint in QUADRUPED_JOINTS),
        "power.pc",
        *TEMPERATURES,
        "temperature.ambient",
    ]


@pytest.fixture(scope="module")
def protocol() -> Logs:
    return quadruped_logs(seed=4)


def test_joints_are_those_of_the_urdf() -> None:
    assert (
        tuple(f"{leg}_{part}" for leg in ("FR", "FL", "RR", "RL") for part in ("hip", "thigh", "calf"))
        == QUADRUPED_JOINTS
    )


@pytest.mark.long
def test_protocol_is_the_sources_table(protocol: Logs) -> None:
    assert len(protocol) == 25
    for diagonal in ("RF_LR", "LF_RR"):
        for word, torques in (("abd", (2, 4, 6)), ("hip", (2, 4, 6)), ("knee", (2, 4, 6, 10))):
            assert all(f"{word}_{diagonal}_{torque}Nm" in protocol for torque in torques)
    assert {"unpowered", "cooling", "trot_low", "trot_medium", "trot_high"} < set(protocol)
    for log in protocol.values():
        assert list(log.columns) == columns(slow=True)
        assert log["time"].to_numpy() == pytest.approx(np.arange(1800.0))
        assert not log.isna().any().any()


def test_only_the_named_joints_are_powered(protocol: Logs) -> None:
    log = protocol["hip_RF_LR_4Nm"]
    powered = [joint for joint in QUADRUPED_JOINTS if log[f"powered.{joint}"].all()]
    assert powered == ["FR_thigh", "RL_thigh"]
    assert log[[f"torque.{joint}" for joint in powered]].mean().to_numpy() == pytest.approx([4.0, 4.0], rel=0.05)
    idle = [
        f"{quantity}.{joint}"
        for quantity in ("torque", "powered")
        for joint in QUADRUPED_JOINTS
        if joint not in powered
    ]
    assert not log[idle].to_numpy().any()
    assert not protocol["cooling"][[f"powered.{joint}" for joint in QUADRUPED_JOINTS]].to_numpy().any()
    assert protocol["trot_high"]["speed.base"].max() == pytest.approx(1.0)
    assert set(protocol["trot_low"]["power.pc"]) <= {16.0, 26.0}


def test_temperatures_are_carried_from_run_to_run(protocol: Logs) -> None:
    for one, other in pairwise(name for name in protocol if name != "cooling"):
        before, after = protocol.truth[one].iloc[-1], protocol.truth[other].iloc[0]
        # The trunk hardly moves in a minute; nothing but a gap of rest lies between.
        assert after["temperature.trunk"] == pytest.approx(before["temperature.trunk"], abs=0.6)
        assert (after[TEMPERATURES] - before[TEMPERATURES]).max() < 1.5
    # A trot without a log: cooling begins with windings hotter than their housings.
    first = protocol.truth["cooling"].iloc[0]
    assert first["temperature.FR_calf"] > 50
    assert first["temperature.FR_calf"] - first["housing.FR_calf"] > 5
    hottest = max(truth[TEMPERATURES].max().max() for truth in protocol.truth.values())
    assert 64 < hottest < 66.5


def test_cut_out_switches_off_and_on_again(protocol: Logs) -> None:
    log, truth = protocol["knee_RF_LR_10Nm"], protocol.truth["knee_RF_LR_10Nm"]
    on = log["powered.RL_calf"].to_numpy()
    hottest = truth[[f"temperature.{joint}" for joint in QUADRUPED_JOINTS]].max(axis=1).to_numpy()
    off_at, on_at = np.flatnonzero(np.diff(on) < 0) + 1, np.flatnonzero(np.diff(on) > 0) + 1
    assert len(off_at) > 2
    assert ((hottest[off_at] > 65) & (hottest[off_at - 1] <= 65)).all()
    assert ((hottest[on_at] < 50) & (hottest[on_at - 1] >= 50)).all()
    assert not log.loc[on == 0, "torque.RL_calf"].any()


def test_cut_out_without_resuming_lasts() -> None:
    run = Job((Bout("trot", 1200, 0.5, 6.0),), 30.0)
    log = quadruped_logs(seed=1, runs={"trot": run})["trot"]
    on = log["powered.FR_hip"].to_numpy()
    first = int(on.argmin())
    assert 60 < first < 600
    assert on[:first].all()
    assert not on[first:].any()
    assert not log.loc[first:, "speed.base"].any()
    assert (log.loc[first:, "power.pc"] == 16).all()


def test_fresh_run_begins_where_it_is_told_to() -> None:
    runs = {"cold": MIX, "warm": Job(MIX.segments, start=40.0), "next": Job(MIX.segments, 31.0, carried=True, gap=0)}
    logs = quadruped_logs(seed=0, runs=runs, level="none")
    begins = {name: truth.iloc[0] for name, truth in logs.truth.items()}
    assert (begins["cold"][TEMPERATURES] == 25.0).all()
    assert (begins["warm"][TEMPERATURES] == 40.0).all()
    assert begins["next"]["temperature.FR_calf"] > 41
    assert begins["next"]["temperature.ambient"] == 31.0


def test_same_seed_same_logs_other_seed_other_logs() -> None:
    one, same, other = (quadruped_logs(seed=seed, runs={"mix": MIX})["mix"] for seed in (7, 7, 8))
    pd.testing.assert_frame_equal(one, same, check_exact=True)
    for column in ("torque.RL_thigh", "velocity.FR_hip", "temperature.FL_calf"):
        assert not np.allclose(one[column], other[column])


def test_one_hertz_is_the_reduction_of_a_hundred() -> None:
    fine, slow = (
        quadruped_logs(seed=3, runs={"mix": MIX}, noise=0, quantisation=0, rate=rate)["mix"] for rate in (100, 1)
    )
    assert list(fine.columns) == columns(slow=False)
    assert len(fine) == 36000
    assert fine["time"].to_numpy() == pytest.approx(np.arange(36000) / 100)
    second = np.arange(len(fine)) // 100
    for joint in ("FR_hip", "RL_calf"):
        for quantity, reduced in (("torque", "torque"), ("velocity", "velocity_rms")):
            square = (fine[f"{quantity}.{joint}"].astype(float) ** 2).groupby(second).mean()
            assert slow[f"{reduced}.{joint}"].to_numpy() == pytest.approx(
                np.sqrt(square.to_numpy()), rel=1e-5, abs=1e-6
            )
        mean = fine[f"velocity.{joint}"].astype(float).abs().groupby(second).mean()
        assert slow[f"velocity.{joint}"].to_numpy() == pytest.approx(mean.to_numpy(), rel=1e-5, abs=1e-6)
    assert fine[TEMPERATURES].iloc[::100].to_numpy() == pytest.approx(slow[TEMPERATURES].to_numpy(), abs=1e-4)
    for column in ("speed.base", "powered.RL_calf", "power.pc"):
        assert fine[column].iloc[::100].to_numpy() == pytest.approx(slow[column].to_numpy())


@pytest.mark.parametrize(("act", "speed"), [("trot", 0.2), ("trot", 1.0), ("walk", 0.3)])
def test_gait_can_be_seen_in_the_joint_speeds(act: str, speed: float) -> None:
    log = quadruped_logs(seed=2, runs={"gait": Job((Bout(act, 60, speed),))}, rate=100)["gait"]
    assert (log[["torque.FR_calf", "velocity.FR_calf"]].min() < 0).all()
    spectrum = np.abs(np.fft.rfft(log["velocity.FR_calf"].to_numpy(float)))
    frequency = spectrum.argmax() / 60
    assert 1.0 < frequency < 3.2
    assert spectrum.max() > 10 * np.median(np.sort(spectrum)[-100:])
    diagonal, beside = (log[f"velocity.{leg}_calf"].to_numpy(float) for leg in ("RL", "FL"))
    if act == "trot":
        own = log["velocity.FR_calf"].to_numpy(float)
        assert np.corrcoef(own, diagonal)[0, 1] > 0.99
        assert np.corrcoef(own, beside)[0, 1] < -0.9


def test_readings_have_the_noise_and_the_steps_asked_for() -> None:
    quiet = quadruped_logs(seed=5, runs={"mix": MIX}, noise=0, quantisation=0)
    noisy = quadruped_logs(seed=5, runs={"mix": MIX}, quantisation=0)["mix"]
    usual = quadruped_logs(seed=5, runs={"mix": MIX})["mix"]
    gappy = quadruped_logs(seed=5, runs={"mix": MIX}, dropouts=0.1)["mix"]
    true = quiet.truth["mix"][TEMPERATURES].to_numpy()
    assert quiet["mix"][TEMPERATURES].to_numpy() == pytest.approx(true, abs=1e-12)
    assert (noisy[TEMPERATURES].to_numpy() - true).std() == pytest.approx(0.15, rel=0.05)
    assert np.array_equal(usual[TEMPERATURES], np.round(noisy[TEMPERATURES]))
    assert gappy[TEMPERATURES].isna().to_numpy().mean() == pytest.approx(0.1, rel=0.1)
    moved = draw_motion(MIX.segments, stream(5, "movement", "mix"))
    scale: Array = usual["torque.FR_calf"].to_numpy()[:300] / np.sqrt(moved.means().torque2[:300, 2])
    assert scale.std() == pytest.approx(0.02, rel=0.15)
    assert scale.mean() == pytest.approx(1.0, abs=0.004)


def test_ambient_column_lacks_the_hidden_error() -> None:
    logs = quadruped_logs(seed=5, runs={f"mix{k}": MIX for k in range(5)}, level="strong")
    errors = [truth["temperature.ambient"].iloc[0] - 25 for truth in logs.truth.values()]
    assert np.std(errors) > 0.3
    assert all((log["temperature.ambient"] == 25).all() for log in logs.values())
    plain = quadruped_logs(seed=5, runs={"mix": MIX}, physics="plain").truth["mix"]
    assert (plain["temperature.ambient"] == 25).all()
    assert "temperature.trunk" not in plain
    assert not any(str(name).startswith("housing") for name in plain)


def test_leg_and_quadruped_do_not_take_each_others_places() -> None:
    logs = quadruped_logs([Hidden("sensor_offset", "FR_calf")], seed=0, runs={"mix": MIX}, noise=0, quantisation=0)
    own = logs["mix"]["temperature.FR_calf"] - logs.truth["mix"]["temperature.FR_calf"]
    assert own.to_numpy() == pytest.approx(2.0)
    with pytest.raises(ValueError, match="place of conduction: found 'FR_calf~FR_hip'; expected an edge such as"):
        quadruped_logs([Hidden("conduction", "FR_calf~FR_hip")], seed=0, runs={"mix": MIX})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"seed": -1}, "seed: found -1"),
        ({"rate": 10.0}, "rate: found 10; expected one of 1, 100 Hz"),
        ({"runs": "holidays"}, "runs: found 'holidays'; expected one of protocol, tests"),
        ({"level": "huge"}, "level: found 'huge'; expected one of none, default, strong"),
        ({"physics": "ideal"}, "physics: found 'ideal'; expected one of full, plain"),
        ({"scatter": 3.0}, "scatter: found 3"),
        ({"noise": -1.0}, "noise: found -1"),
    ],
)
def test_bad_options_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        quadruped_logs(**{"seed": 0, "runs": {"mix": MIX}, **options})  # type: ignore[arg-type]
