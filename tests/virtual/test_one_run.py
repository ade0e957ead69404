"""Check effects that act in one run alone."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from lptn.virtual import EFFECTS, SINGLE, Hidden, Run, Segment, leg_logs, places, quadruped_logs
from lptn.virtual.__main__ import main
from lptn.virtual.quadruped_truth import NODES

TEMPERATURES = [f"temperature.{node}" for node in NODES]
ACT = (Segment("trot", 500, 0.8, 4.0),)
RUNS = {"one": Run(ACT, 20.0), "two": Run(ACT, 26.0), "three": Run(ACT, 20.0)}


def logs(*hidden: tuple[str, str, float, str]) -> dict[str, pd.DataFrame]:
    return quadruped_logs(hidden, seed=2, runs=RUNS, physics="plain", noise=0, quantisation=0)


def test_those_that_may() -> None:
    named = {"surface_scale", "loss_scale", "constant_heat", "sensor_offset", "sensor_drift", "ambient_offset"}
    assert set(SINGLE) == {*named, "clock_offset"}


@pytest.mark.parametrize("effect", SINGLE)
def test_other_runs_are_as_they_were_to_the_last_bit(effect: str) -> None:
    place, usual = places(effect, "quadruped")[-1], logs()
    single, always = logs((effect, place, 1.0, "two")), logs((effect, place, 1.0, ""))
    for name in ("one", "three"):
        pd.testing.assert_frame_equal(single[name], usual[name], check_exact=True)
    pd.testing.assert_frame_equal(single["two"], always["two"], check_exact=True)
    assert (single["two"] - usual["two"])[TEMPERATURES].abs().max().max() > 0.3
    assert not (single["two"] - usual["two"]).drop(columns=TEMPERATURES).to_numpy().any()


def test_leg_has_them_too() -> None:
    usual = leg_logs(seed=3, noise=0, rate=1)
    single = leg_logs([Hidden("surface_scale", "*", 4.0, run="fit2")], seed=3, noise=0, rate=1)
    for name, log in usual.items():
        gap = (log - single[name]).filter(like="temperature").to_numpy().max()
        assert gap > 3 if name == "fit2" else gap == 0


def test_temperatures_that_are_carried_over_stay_changed() -> None:
    runs = {"one": RUNS["one"], "next": Run(ACT, 20.0, carried=True, gap=0)}
    usual = quadruped_logs(seed=2, runs=runs, noise=0)
    heated = quadruped_logs([("constant_heat", "FR_calf", 4.0, "one")], seed=2, runs=runs, noise=0)
    gap = (heated.truth["next"] - usual.truth["next"])["temperature.FR_calf"].to_numpy()
    assert gap[0] > 2
    assert gap[-1] < 0.7 * gap[0]
    assert not usual.robot.later
    assert np.array_equal(heated.robot.constant, usual.robot.constant)


@pytest.mark.parametrize("effect", [effect for effect in EFFECTS if effect not in SINGLE])
def test_others_are_refused_in_one_line(effect: str) -> None:
    with pytest.raises(ValueError, match=f"^run of {effect}: found 'fit1'; expected none, which only .* may have$"):
        Hidden(effect, places(effect)[-1], run="fit1")


def test_run_that_there_is_not_is_refused() -> None:
    with pytest.raises(ValueError, match="run: found 'monday'; expected one of one, two, three"):
        logs(("surface_scale", "*", 1.0, "monday"))
    with pytest.raises(ValueError, match="run: found 'monday'; expected one of fit1, fit2, holdout"):
        leg_logs([Hidden("surface_scale", "*", run="monday")], seed=0)


def test_command_takes_runs(tmp_path: object, capsys: pytest.CaptureFixture[str]) -> None:
    text = "leg --hidden surface_scale --at * --run fit2 --hidden radiation --at FR_calf --run * --rate 1 --columns all"
    assert main([*text.split(), "-o", str(tmp_path)]) == 0
    hidden = [Hidden("surface_scale", "*", run="fit2"), Hidden("radiation", "FR_calf")]
    expected = leg_logs(hidden, seed=0, rate=1, columns="all")
    for name, log in expected.items():
        pd.testing.assert_frame_equal(pd.read_parquet(f"{tmp_path}/{name}.parquet"), log)
    capsys.readouterr()
    assert main(["leg", "--hidden", "solar", "--at", "*", "--run", "fit1", "-o", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
