"""Check each hidden effect: large enough to be found, not so large that anything finds it; where and when it acts."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import pandas as pd
import pytest

from lptn.virtual import (
    EFFECTS,
    LEG_JOINTS,
    QUADRUPED_JOINTS,
    QUADRUPED_NODES,
    SINGLE,
    Bout,
    Hidden,
    Job,
    leg_logs,
    places,
    quadruped_logs,
)
from lptn.virtual.effects import JOINT, NODE
from lptn.virtual.robot import Array
from tests.truth.rough_leg import rough_leg_logs

ONE_PLACE_OR_ALL = pytest.mark.parametrize(
    "every", [pytest.param(False, id="one place"), pytest.param(True, id="all places", marks=pytest.mark.slow)]
)


def one_of(places: Sequence[str], effect: str) -> list[str]:
    """One place for an effect, another one for the next."""
    return [places[list(EFFECTS).index(effect) % len(places)]]


# --- on the leg ----------------------------------------------------------------------------------------------------

SEED = 0


@cache
def temperatures(hidden: tuple[Hidden, ...] = ()) -> Array:
    """Return the noise-free readings of all runs, of shape (rows, joints)."""
    logs = leg_logs(hidden, seed=SEED, noise=0, rate=1)
    return np.concatenate([log[[f"temperature.{joint}" for joint in LEG_JOINTS]].to_numpy() for log in logs.values()])


@pytest.mark.slow
@ONE_PLACE_OR_ALL
@pytest.mark.parametrize("effect", EFFECTS)
def test_peak_of_each_effect(effect: str, every: bool) -> None:
    """The table of peaks is printed by ``pytest -s``."""
    alone = [place for place in places(effect) if place != "*"] or ["*"]
    peaks = {}
    for place in alone if every else one_of(alone, effect):
        # The lag of the ambient brings changes of the ambient with it, which are none of its own.
        usual = temperatures((Hidden(effect, place, 1e-6),) if effect == "ambient_lag" else ())
        trace = np.abs(temperatures((Hidden(effect, place),)) - usual).max(axis=0)
        peaks[place] = float(trace.max())
        ends = place.split("~") if set(place.split("~")) <= set(LEG_JOINTS) else LEG_JOINTS
        assert LEG_JOINTS[int(trace.argmax())] in ends, "the effect is largest where it was put"
    print(f"{effect:20s}", "  ".join(f"{place} {peak:.2f} K" for place, peak in peaks.items()))
    assert all(0.5 < peak < 8 for peak in peaks.values())


def test_size_zero_is_off_to_the_last_bit() -> None:
    nothing = tuple(Hidden(effect, places(effect)[0], 0.0) for effect in EFFECTS)
    assert np.array_equal(temperatures(nothing), temperatures())


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["resistance_rise", "radiation", "sensor_lag", "splash"])
def test_everywhere_is_every_joint(effect: str) -> None:
    separate = tuple(Hidden(effect, joint) for joint in LEG_JOINTS)
    assert temperatures((Hidden(effect, "*"),)) == pytest.approx(temperatures(separate), abs=0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("rough", [False, True])
def test_nothing_is_cooked(seed: int, rough: bool) -> None:
    hottest = max(
        log[f"temperature.{joint}"].max()
        for log in (rough_leg_logs if rough else leg_logs)(seed=seed, noise=0, rate=1).values()
        for joint in LEG_JOINTS
    )
    assert 50 < hottest < 95


def test_hottest_effect_everywhere_stays_below_95() -> None:
    assert temperatures((Hidden("resistance_rise", "*"),)).max() < 95


def test_unknown_effect_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"effect: found 'gremlins'; expected one of resistance_rise, .*splash"):
        Hidden("gremlins", "FR_hip")


@pytest.mark.parametrize(
    ("effect", "place", "allowed"),
    [
        ("radiation", "FL_hip", r"FR_hip, FR_thigh, FR_calf, \*"),
        ("radiation", "FR_calf~FR_hip", r"FR_hip, FR_thigh, FR_calf, \*"),
        ("conduction", "FR_hip", "FR_calf~FR_hip"),
        ("conduction", "*", "FR_calf~FR_hip"),
        ("sensor_position", "FR_calf~FR_hip", "FR_calf~FR_thigh, FR_thigh~FR_calf, FR_hip~FR_thigh, FR_thigh~FR_hip"),
        ("sensor_position", "FR_calf~FR_calf_case", "FR_calf~FR_thigh, .*"),
        ("shared_mass", "FR_hip", r"\*"),
        ("clock_offset", "FR_hip", r"\*"),
        ("ambient_offset", "*", "ambient"),
    ],
)
def test_unknown_place_is_refused_with_the_allowed_ones(effect: str, place: str, allowed: str) -> None:
    with pytest.raises(ValueError, match=f"place of {effect}: found .* expected one of {allowed}$"):
        Hidden(effect, place)


@pytest.mark.parametrize("size", [-1.0, float("nan"), float("inf")])
def test_bad_size_is_refused(size: float) -> None:
    with pytest.raises(ValueError, match="size of radiation"):
        Hidden("radiation", "*", size)


@pytest.mark.slow
@pytest.mark.parametrize("effect", [name for name, effect in EFFECTS.items() if effect.signed])
def test_signed_effect_goes_either_way(effect: str) -> None:
    place = places(effect)[0]
    up, down = (temperatures((Hidden(effect, place, size),)) - temperatures() for size in (0.5, -0.5))
    assert np.abs(up + down).mean() < 0.3 * np.abs(up).mean()


@pytest.mark.parametrize(("effect", "least"), [("loss_scale", "-4.50"), ("surface_scale", "-3.00")])
def test_scale_that_leaves_nothing_is_refused(effect: str, least: str) -> None:
    with pytest.raises(ValueError, match=f"size of {effect}: found -5; expected {least} or above"):
        leg_logs([Hidden(effect, "*", -5.0)], seed=0)


def test_second_mass_larger_than_its_node_is_refused() -> None:
    with pytest.raises(ValueError, match=r"size of second_mass: found 3; expected at most 2\.\d\d at FR_hip"):
        leg_logs([Hidden("second_mass", "FR_hip", 3.0)], seed=0)


def test_burning_leg_is_refused() -> None:
    with pytest.raises(ValueError, match="passes 150 degC in fit1; expected smaller sizes"):
        leg_logs([Hidden("constant_heat", "*", 30.0)], seed=0)


# --- on the quadruped ----------------------------------------------------------------------------------------------

SECONDS = 900


@cache
def quadruped_temperatures(*hidden: tuple[str, str, float]) -> Array:
    """Return the readings without noise of one session of the plain robot, of shape (rows, nodes)."""
    acts = (
        Bout("hold", SECONDS, joints=("FR_calf", "FL_thigh", "RL_hip"), torque=10.0),
        Bout("trot", SECONDS, 1.2, 6.0),
        Bout("leg_sweep", SECONDS, 1.1),
        Bout("rest", SECONDS),
    )
    run = Job(acts, 15.0, cutout=None)
    log = quadruped_logs(hidden, seed=1, runs={"mix": run}, physics="plain", noise=0, quantisation=0)["mix"]
    return log[[f"temperature.{node}" for node in QUADRUPED_NODES]].to_numpy()


def peaks(*hidden: tuple[str, str, float]) -> Array:
    peak: Array = np.abs(quadruped_temperatures(*hidden) - quadruped_temperatures()).max(axis=0)
    return peak


@pytest.mark.long
@ONE_PLACE_OR_ALL
@pytest.mark.parametrize("effect", [name for name, effect in EFFECTS.items() if effect.kind in (JOINT, NODE)])
def test_effect_is_largest_where_it_was_put(effect: str, every: bool) -> None:
    alone = [place for place in ("FR_calf", "FL_thigh", "RL_hip", "pc") if place in places(effect, "quadruped")]
    moved = {place: peaks((effect, place, 1.0)) for place in (alone if every else one_of(alone, effect))}
    print(f"{effect:20s}", "  ".join(f"{place} {peak.max():.2f} K" for place, peak in moved.items()))
    for place, peak in moved.items():
        assert QUADRUPED_NODES[int(peak.argmax())] == place
        # The session has no movement that loads a hip at speed.
        assert (0.1 if effect == "gear_loss" else 0.3) < peak.max() < 12


def test_shared_mass_is_largest_in_its_class() -> None:
    peak = peaks(("shared_mass", "*_thigh", 1.0))
    assert QUADRUPED_NODES[int(peak.argmax())].endswith("_thigh")
    assert 0.5 < peak.max() < 8


def test_sensor_position_moves_one_reading_only() -> None:
    one, other = (QUADRUPED_NODES.index(node) for node in ("FR_calf", "FR_hip"))
    moved, usual = quadruped_temperatures(("sensor_position", "FR_calf~FR_hip", 1.0)), quadruped_temperatures()
    assert moved[:, one] == pytest.approx(0.8 * usual[:, one] + 0.2 * usual[:, other])
    assert not peaks(("sensor_position", "FR_calf~FR_hip", 1.0))[[k for k in range(13) if k != one]].any()


def test_conduction_joins_two_nodes_that_were_apart() -> None:
    for edge in ("FL_calf~FR_calf", "RL_hip~RR_calf", "FR_calf~pc"):
        peak = peaks(("conduction", edge, 1.0))
        assert QUADRUPED_NODES[int(peak.argmax())] in edge.split("~")
        assert 0.5 < peak.max() < 8


@pytest.mark.long
@pytest.mark.parametrize("effect", ["resistance_rise", "radiation", "sensor_lag", "splash"])
def test_class_and_everywhere_are_all_their_nodes(effect: str) -> None:
    calves = tuple((effect, joint, 0.5) for joint in QUADRUPED_JOINTS if joint.endswith("_calf"))
    assert quadruped_temperatures((effect, "*_calf", 0.5)) == pytest.approx(quadruped_temperatures(*calves), abs=0)
    separate = tuple(
        (effect, node, 0.5) for node in (QUADRUPED_JOINTS if effect == "resistance_rise" else QUADRUPED_NODES)
    )
    assert quadruped_temperatures((effect, "*", 0.5)) == pytest.approx(quadruped_temperatures(*separate), abs=0)


def test_size_zero_is_off_to_the_last_bit_on_the_quadruped() -> None:
    nothing = ((effect, places(effect, "quadruped")[-1], 0.0) for effect in EFFECTS)
    assert np.array_equal(quadruped_temperatures(*nothing), quadruped_temperatures())


def test_two_effects_may_be_hidden_at_once() -> None:
    two = (("constant_heat", "RR_thigh", 1.0), ("sensor_offset", "pc", 1.0))
    assert peaks(*two)[QUADRUPED_NODES.index("pc")] > 1.9
    assert peaks(*two)[QUADRUPED_NODES.index("RR_thigh")] == pytest.approx(
        peaks(two[0])[QUADRUPED_NODES.index("RR_thigh")]
    )


@pytest.mark.parametrize("effect", ["second_mass", "conduction", "natural_convection", "sensor_lag", "iron_loss"])
def test_full_physics_takes_effects_too(effect: str) -> None:
    run = {"mix": Job((Bout("trot", 600, 0.5, 4.0),), cutout=None)}
    hidden = [Hidden(effect, places(effect, "quadruped")[-1], robot="quadruped")]
    changed, usual = (quadruped_logs(h, seed=1, runs=run, noise=0, quantisation=0)["mix"] for h in (hidden, ()))
    seen = [f"temperature.{node}" for node in QUADRUPED_NODES]
    assert 0.2 < (changed[seen] - usual[seen]).abs().max().max() < 12
    assert not (changed.drop(columns=seen) - usual.drop(columns=seen)).to_numpy().any()


def test_places_of_the_quadruped() -> None:
    assert places("coulomb_friction", "quadruped") == (*QUADRUPED_JOINTS, "*_hip", "*_thigh", "*_calf", "*")
    assert "pc" in places("sensor_offset", "quadruped")
    edges = places("conduction", "quadruped")
    assert len(edges) == 13 * 12 // 2 - 12 - 4 - 2
    assert all(edge.split("~") == sorted(edge.split("~")) for edge in edges)


@pytest.mark.parametrize(
    ("effect", "place", "robot", "message"),
    [
        ("iron_loss", "pc", "quadruped", "place of iron_loss: found 'pc'; expected one of FR_hip"),
        ("conduction", "FR_hip~pc", "quadruped", "place of conduction: found 'FR_hip~pc'; expected an edge such as"),
        (
            "sensor_position",
            "FL_calf~FR_calf",
            "quadruped",
            "place of sensor_position: .*; expected an edge such as .*, linked",
        ),
        ("shared_mass", "pc", "quadruped", r"place of shared_mass: found 'pc'; expected one of \*_hip, "),
        ("ambient_lag", "*", "quadruped", "place of ambient_lag: found '\\*'; expected one of ambient"),
        ("radiation", "trunk", "quadruped", "place of radiation: found 'trunk'"),
        ("radiation", "FR_hip", "hexapod", "robot: found 'hexapod'; expected one of leg, quadruped"),
    ],
)
def test_unknown_place_is_refused(effect: str, place: str, robot: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Hidden(effect, place, 1.0, robot)


def test_burning_robot_is_refused() -> None:
    with pytest.raises(ValueError, match="passes 150 degC in mix; expected smaller sizes"):
        quadruped_temperatures(("constant_heat", "*", 40.0))


# --- in one run alone ----------------------------------------------------------------------------------------------

TEMPERATURES = [f"temperature.{node}" for node in QUADRUPED_NODES]
ACT = (Bout("trot", 500, 0.8, 4.0),)
RUNS = {"one": Job(ACT, 20.0), "two": Job(ACT, 26.0), "three": Job(ACT, 20.0)}


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


@pytest.mark.long
def test_leg_has_them_too() -> None:
    usual = leg_logs(seed=3, noise=0, rate=1)
    single = leg_logs([Hidden("surface_scale", "*", 4.0, run="fit2")], seed=3, noise=0, rate=1)
    for name, log in usual.items():
        gap = (log - single[name]).filter(like="temperature").to_numpy().max()
        assert gap > 3 if name == "fit2" else gap == 0


def test_temperatures_that_are_carried_over_stay_changed() -> None:
    runs = {"one": RUNS["one"], "next": Job(ACT, 20.0, carried=True, gap=0)}
    usual = quadruped_logs(seed=2, runs=runs, noise=0)
    heated = quadruped_logs([("constant_heat", "FR_calf", 4.0, "one")], seed=2, runs=runs, noise=0)
    gap = (heated.truth["next"] - usual.truth["next"])["temperature.FR_calf"].to_numpy()
    assert gap[0] > 2
    assert gap[-1] < 0.7 * gap[0]
    assert not usual.robot.single_run
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
