"""Check the changes hidden in the leg of finite volumes: what they alter, what answers are right, what is logged."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.cli.main import main
from lptn.effects import catalogue
from lptn.robots.presets import presets
from lptn.virtual import LEG_JOINTS, write_logs
from tests.truth.changes import ALWAYS, CHANGES, Change, finite_volume_leg_logs

TEMPERATURES = [f"temperature.{joint}" for joint in LEG_JOINTS]
# Heat crosses the leg but slowly: each change moves the reading of its own joint most. K, in any of the runs.
SEEN = 0.8
LOGGED_ONLY = ("wrong_torque_constant", "weak_magnets")  # the leg stays as it is, the driver's torque doesn't


def place(change: Change) -> str:
    return change.places[len(change.places) // 2]


@pytest.fixture(scope="module")
def logs() -> dict[str, pd.DataFrame]:
    return finite_volume_leg_logs(seed=3, noise=0, steps=0)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in CHANGES if name not in LOGGED_ONLY])
def test_each_change_moves_temperatures_and_nothing_else(logs: dict[str, pd.DataFrame], name: str) -> None:
    at = place(CHANGES[name])
    changed = finite_volume_leg_logs(name, at, seed=3, noise=0, steps=0)
    moved = {run: (changed[run] - log).abs().max() for run, log in logs.items()}
    largest = pd.DataFrame(moved).max(axis=1)
    assert SEEN < largest[TEMPERATURES].max() < 12
    assert not largest.drop(TEMPERATURES).any()
    if at in LEG_JOINTS:
        assert largest[TEMPERATURES].idxmax() == f"temperature.{at}"
    runs = {run for run, most in moved.items() if most[TEMPERATURES].max() > 0.01}
    assert runs == ({CHANGES[name].run} if CHANGES[name].run else set(logs))


@pytest.mark.parametrize("name", LOGGED_ONLY)
def test_a_driver_that_reckons_otherwise_changes_its_torque_alone(logs: dict[str, pd.DataFrame], name: str) -> None:
    changed = finite_volume_leg_logs(name, "FR_thigh", seed=3, noise=0, steps=0)
    for run, log in logs.items():
        acts = run == CHANGES[name].run or not CHANGES[name].run
        assert ((changed[run] - log).abs().max()["torque.FR_thigh"] > 0.5) == acts
        assert changed[run].drop(columns="torque.FR_thigh").equals(log.drop(columns="torque.FR_thigh"))
        assert changed[run].equals(log) is not acts


def test_answers_are_effects_of_the_catalogue_at_the_change_s_place() -> None:
    keys = {*catalogue()}
    assert keys >= {
        *(name.partition("@")[0] for name in ALWAYS),
        *(effect for change in CHANGES.values() for effect in change.effects),
    }
    assert CHANGES["fan"].answers("FR_hip") == [("fan", "FR_hip")]
    assert CHANGES["cover"].answers("FR_calf") == [("surface_scale", "FR_calf@fit2")]
    assert CHANGES["bracket"].answers("FR_calf~FR_hip") == [("conduction", "FR_calf~FR_hip")]
    assert CHANGES["paste_missing"].answers("FR_hip")[-1] == ("sensor_position", "FR_hip~FR_hip?*")
    assert sum(change.outside for change in CHANGES.values()) >= 3
    assert sum(not change.outside for change in CHANGES.values()) >= 10
    with pytest.raises(ValueError, match="at: found 'pc'; expected one of FR_hip"):
        CHANGES["fan"].answers("pc")


def test_the_same_call_gives_the_same_logs(logs: dict[str, pd.DataFrame]) -> None:
    again = finite_volume_leg_logs(seed=3, noise=0, steps=0)
    other = finite_volume_leg_logs(seed=4, noise=0, steps=0)
    for name, log in logs.items():
        pd.testing.assert_frame_equal(log, again[name], check_exact=True)
        assert not np.allclose(log[TEMPERATURES], other[name][TEMPERATURES])


def test_drivers_log_as_drivers_do(logs: dict[str, pd.DataFrame]) -> None:
    whole = finite_volume_leg_logs(seed=3, steps=1.0, logging="mean")
    readings = whole["fit1"][TEMPERATURES]
    assert (readings == readings.round()).to_numpy().all()
    assert (readings - logs["fit1"][TEMPERATURES]).abs().to_numpy().max() < 1
    # A reading stays until the next one, half a second to two seconds later.
    held = (logs["fit1"][TEMPERATURES].diff() == 0).mean()
    assert ((held > 0.75) & (held < 0.97)).all()
    torques = [f"torque.{joint}" for joint in LEG_JOINTS]
    sampled, mean = logs["fit1"][torques], whole["fit1"][torques]
    assert ((sampled**2).mean() / (mean**2).mean()).to_numpy() == pytest.approx(1.0064, abs=0.01)
    late = finite_volume_leg_logs("clock", seed=3, noise=0, steps=0)["fit1"][TEMPERATURES[0]]
    assert late.to_numpy()[:-200:200] == pytest.approx(logs["fit1"][TEMPERATURES[0]].to_numpy()[200::200], abs=0.3)


def test_the_computer_is_a_node_with_a_logged_power(logs: dict[str, pd.DataFrame]) -> None:
    log = finite_volume_leg_logs(seed=3, computer=True)["fit1"]
    assert 12 < log["power.pc"].min() < log["power.pc"].max() < 30
    assert log["temperature.pc"].iloc[-1] > 30
    assert log["temperature.FR_hip"].iloc[-1] > logs["fit1"]["temperature.FR_hip"].iloc[-1] + 0.5
    assert {*log} - {*logs["fit1"]} == {"temperature.pc", "power.pc"}


@pytest.mark.long
def test_the_logs_pass_the_check_of_the_preset_leg(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "leg.toml").write_text(presets()["leg"])
    files = write_logs(tmp_path, finite_volume_leg_logs("fan", "FR_calf", seed=1))
    with pytest.raises(SystemExit) as done:
        main(["check", str(tmp_path / "leg.toml"), *map(str, files)])
    assert done.value.code == 0
    assert "error" not in capsys.readouterr().out.lower()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"change": "rust"}, "change: found 'rust'"),
        ({"change": "fan"}, "place of fan: found ''; expected one of FR_hip, FR_thigh, FR_calf"),
        ({"change": "wind", "at": "FR_hip"}, r"place of wind: found 'FR_hip'; expected one of \*"),
        ({"at": "FR_hip"}, "at: found 'FR_hip'; expected none without a change"),
        ({"seed": -1}, "seed: found -1"),
        ({"steps": -0.1}, "quantisation: found -0.1"),
        ({"logging": "rms"}, "logging: found 'rms'"),
    ],
)
def test_bad_options_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        finite_volume_leg_logs(**{"seed": 0, **options})  # type: ignore[arg-type]
