"""Check the leg's logs: columns, seeds, sensors, rates, files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.virtual import LEG_JOINTS, Format, Hidden, leg_logs, write_logs
from lptn.virtual.leg import draw_runs
from tests.truth.rough_leg import rough_leg_logs

TEMPERATURES = [f"temperature.{joint}" for joint in LEG_JOINTS]
COLUMNS = [
    "time",
    *(f"torque.{joint}" for joint in LEG_JOINTS),
    *(f"velocity.{joint}" for joint in LEG_JOINTS),
    "speed.base",
    *TEMPERATURES,
    "temperature.ambient",
]


@pytest.fixture(scope="module")
def logs() -> dict[str, pd.DataFrame]:
    return leg_logs(seed=5)


@pytest.mark.long
def test_runs_and_columns(logs: dict[str, pd.DataFrame]) -> None:
    lasts = {"fit1": 2400, "fit2": 2400, "holdout": 1800}
    ambients = {"fit1": 22.0, "fit2": 12.0, "holdout": 28.0}
    assert list(logs) == list(lasts)
    for name, log in logs.items():
        assert list(log.columns) == COLUMNS
        assert len(log) == 10 * lasts[name]
        assert log["time"].to_numpy() == pytest.approx(np.arange(len(log)) / 10)
        assert (log["temperature.ambient"] == ambients[name]).all()
        above = log[TEMPERATURES].iloc[:20].mean() - ambients[name]
        assert ((above > 0.3) & (above < 3)).all()


def test_every_activity_is_seen_and_every_run_ends_at_rest() -> None:
    runs = draw_runs(5)
    assert all(run.segments[-1].activity == "rest" for run in runs.values())
    assert all(8 <= len(run.segments) <= 12 for run in runs.values())
    fitted = {s.activity for name in ("fit1", "fit2") for s in runs[name].segments}
    assert fitted == {"rest", "stand", "trot", "walk", "squat", "leg_sweep"}


def test_base_speed_and_joint_speed_are_told_apart(logs: dict[str, pd.DataFrame]) -> None:
    """Load without speed, joint speed without load, joint speed without base speed, and rest."""
    log = pd.concat([logs["fit1"], logs["fit2"]])
    minute = log.abs().groupby(np.arange(len(log)) // 600).mean()
    torque, joint, base = minute["torque.FR_calf"], minute["velocity.FR_calf"], minute["speed.base"]
    for seen in (
        (torque > 4) & (joint < 0.01),
        (torque < 1) & (joint > 2) & (base == 0),
        (torque > 4) & (joint > 2) & (base > 0.8),
        (torque == 0) & (joint == 0),
    ):
        assert seen.sum() >= 2


@pytest.mark.long
def test_same_seed_same_logs_other_seed_other_logs(logs: dict[str, pd.DataFrame]) -> None:
    again, other = leg_logs(seed=5), leg_logs(seed=6)
    for name, log in logs.items():
        pd.testing.assert_frame_equal(log, again[name], check_exact=True)
        for column in ("torque.FR_hip", "velocity.FR_calf", "temperature.FR_thigh"):
            assert not np.allclose(log[column], other[name][column])


@pytest.mark.long
@pytest.mark.parametrize("place", ["FR_hip", "*"])
def test_hidden_effect_leaves_movement_and_noise_alone(logs: dict[str, pd.DataFrame], place: str) -> None:
    changed = leg_logs([Hidden("sensor_offset", place)], seed=5)
    for name, log in logs.items():
        difference = changed[name] - log
        assert difference["temperature.FR_hip"].to_numpy() == pytest.approx(2.0, abs=1e-9)
        assert not difference.drop(columns=TEMPERATURES).to_numpy().any()


@pytest.mark.long
def test_noise_is_as_large_as_asked(logs: dict[str, pd.DataFrame]) -> None:
    quiet = leg_logs(seed=5, noise=0)
    noise = logs["fit1"][TEMPERATURES] - quiet["fit1"][TEMPERATURES]
    assert noise.std().to_numpy() == pytest.approx(0.15, rel=0.03)
    assert abs(noise.mean()).max() < 0.005


@pytest.mark.long
def test_quantised_readings_are_the_rounded_ones(logs: dict[str, pd.DataFrame]) -> None:
    coarse = leg_logs(seed=5, quantisation=0.5)
    for name, log in logs.items():
        read = coarse[name][TEMPERATURES].to_numpy()
        assert np.array_equal(read * 2, np.round(read * 2))
        assert np.abs(read - log[TEMPERATURES].to_numpy()).max() <= 0.25 + 1e-9


@pytest.mark.long
def test_dropouts_take_their_share_and_leave_the_rest_alone(logs: dict[str, pd.DataFrame]) -> None:
    gappy = leg_logs(seed=5, dropouts=0.1)["fit1"]
    missing = gappy[TEMPERATURES].isna()
    assert missing.to_numpy().mean() == pytest.approx(0.1, rel=0.05)
    assert not gappy.drop(columns=TEMPERATURES).isna().to_numpy().any()
    kept = ~missing.to_numpy()
    whole = logs["fit1"][TEMPERATURES].to_numpy()
    assert np.array_equal(gappy[TEMPERATURES].to_numpy()[kept], whole[kept])


@pytest.mark.long
def test_one_row_a_second_holds_the_features_of_its_second() -> None:
    fine, slow = leg_logs(seed=5, noise=0)["holdout"], leg_logs(seed=5, noise=0, rate=1)["holdout"]
    second = np.arange(len(fine)) // 10
    assert slow["time"].to_numpy() == pytest.approx(np.arange(1800.0))
    rms = np.sqrt((fine["torque.FR_calf"] ** 2).groupby(second).mean())
    assert slow["torque.FR_calf"].to_numpy() == pytest.approx(rms.to_numpy())
    assert (slow["temperature.FR_calf"].to_numpy() == fine["temperature.FR_calf"].to_numpy()[::10]).all()
    for column in ("velocity.FR_calf", "speed.base"):
        expected = fine[column].abs().groupby(second).mean()
        assert slow[column].to_numpy() == pytest.approx(expected.to_numpy())


def test_torque_and_velocity_are_signed_at_ten_hertz(logs: dict[str, pd.DataFrame]) -> None:
    assert (logs["fit1"][COLUMNS[1:7]].min() < 0).all()


@pytest.mark.long
def test_rough_tier_spoils_ambient_and_torque() -> None:
    clean, rough = leg_logs(seed=5, noise=0, scatter=0.1), rough_leg_logs(seed=5, noise=0)
    errors = [rough[name]["temperature.ambient"].iloc[0] - clean[name]["temperature.ambient"].iloc[0] for name in clean]
    assert len(set(errors)) == 3
    assert 0 < max(map(abs, errors)) < 2
    moved = clean["fit1"]["torque.FR_calf"] != 0
    scale = (rough["fit1"]["torque.FR_calf"] / clean["fit1"]["torque.FR_calf"])[moved]
    assert np.ptp(scale) < 1e-9
    assert 0 < abs(scale.iloc[0] - 1) < 0.08
    gap = rough["fit1"][TEMPERATURES] - clean["fit1"][TEMPERATURES]
    assert 0.5 < gap.abs().max().max() < 8


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"seed": -1}, "seed: found -1"),
        ({"noise": -0.1}, "noise: found -0.1"),
        ({"quantisation": float("nan")}, "quantisation: found nan"),
        ({"dropouts": 1.0}, "dropouts: found 1"),
        ({"scatter": 0.7}, "scatter: found 0.7"),
        ({"rate": 3.0}, "rate: found 3; expected one of 10, 5, 2, 1 Hz"),
    ],
)
def test_bad_options_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        leg_logs(**{"seed": 0, **options})  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["parquet", "csv"])
def test_files_hold_the_logs(logs: dict[str, pd.DataFrame], tmp_path: Path, kind: Format) -> None:
    files = write_logs(tmp_path / "new", {"holdout": logs["holdout"]}, kind)
    assert files == [tmp_path / "new" / f"holdout.{kind}"]
    assert sorted((tmp_path / "new").iterdir()) == files
    read = pd.read_parquet(files[0]) if kind == "parquet" else pd.read_csv(files[0])
    pd.testing.assert_frame_equal(read, logs["holdout"], rtol=1e-6, check_dtype=kind == "parquet")
