"""Check hidden effects on the quadruped: each at a joint, the computer, a class, an edge, everywhere."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from lptn.virtual import EFFECTS, Hidden, Run, Segment, places, quadruped_logs
from lptn.virtual.quadruped_truth import JOINTS, NODES
from lptn.virtual.registry import JOINT, NODE
from lptn.virtual.robot import Array

LASTS = 900


@cache
def temperatures(*hidden: tuple[str, str, float]) -> Array:
    """Return the readings without noise of one session of the plain robot, of shape (rows, nodes)."""
    acts = (
        Segment("hold", LASTS, joints=("FR_calf", "FL_thigh", "RL_hip"), torque=10.0),
        Segment("trot", LASTS, 1.2, 6.0),
        Segment("leg_sweep", LASTS, 1.1),
        Segment("rest", LASTS),
    )
    run = Run(acts, 15.0, cutout=None)
    log = quadruped_logs(hidden, seed=1, runs={"mix": run}, physics="plain", noise=0, quantisation=0)["mix"]
    return log[[f"temperature.{node}" for node in NODES]].to_numpy()


def peaks(*hidden: tuple[str, str, float]) -> Array:
    peak: Array = np.abs(temperatures(*hidden) - temperatures()).max(axis=0)
    return peak


@pytest.mark.parametrize("effect", [name for name, effect in EFFECTS.items() if effect.kind in (JOINT, NODE)])
def test_effect_is_largest_where_it_was_put(effect: str) -> None:
    alone = [place for place in ("FR_calf", "FL_thigh", "RL_hip", "pc") if place in places(effect, "quadruped")]
    found = {place: peaks((effect, place, 1.0)) for place in alone}
    print(f"{effect:20s}", "  ".join(f"{place} {peak.max():.2f} K" for place, peak in found.items()))
    for place, peak in found.items():
        assert NODES[int(peak.argmax())] == place
        # The session has no movement that loads a hip at speed.
        assert (0.1 if effect == "gear_loss" else 0.3) < peak.max() < 12


def test_shared_mass_is_largest_in_its_class() -> None:
    peak = peaks(("shared_mass", "*_thigh", 1.0))
    assert NODES[int(peak.argmax())].endswith("_thigh")
    assert 0.5 < peak.max() < 8


def test_sensor_position_moves_one_reading_only() -> None:
    one, other = (NODES.index(node) for node in ("FR_calf", "FR_hip"))
    moved, usual = temperatures(("sensor_position", "FR_calf~FR_hip", 1.0)), temperatures()
    assert moved[:, one] == pytest.approx(0.8 * usual[:, one] + 0.2 * usual[:, other])
    assert not peaks(("sensor_position", "FR_calf~FR_hip", 1.0))[[k for k in range(13) if k != one]].any()


def test_conduction_joins_two_nodes_that_were_apart() -> None:
    for edge in ("FL_calf~FR_calf", "RL_hip~RR_calf", "FR_calf~pc"):
        peak = peaks(("conduction", edge, 1.0))
        assert NODES[int(peak.argmax())] in edge.split("~")
        assert 0.5 < peak.max() < 8


@pytest.mark.parametrize("effect", ["resistance_rise", "radiation", "sensor_lag", "splash"])
def test_class_and_everywhere_are_all_their_nodes(effect: str) -> None:
    calves = tuple((effect, joint, 0.5) for joint in JOINTS if joint.endswith("_calf"))
    assert temperatures((effect, "*_calf", 0.5)) == pytest.approx(temperatures(*calves), abs=0)
    each = tuple((effect, node, 0.5) for node in (JOINTS if effect == "resistance_rise" else NODES))
    assert temperatures((effect, "*", 0.5)) == pytest.approx(temperatures(*each), abs=0)


@pytest.mark.parametrize("effect", EFFECTS)
def test_size_zero_is_off_to_the_last_bit(effect: str) -> None:
    assert np.array_equal(temperatures((effect, places(effect, "quadruped")[-1], 0.0)), temperatures())


def test_two_effects_may_be_hidden_at_once() -> None:
    two = (("constant_heat", "RR_thigh", 1.0), ("sensor_offset", "pc", 1.0))
    assert peaks(*two)[NODES.index("pc")] > 1.9
    assert peaks(*two)[NODES.index("RR_thigh")] == pytest.approx(peaks(two[0])[NODES.index("RR_thigh")])


@pytest.mark.parametrize("effect", ["second_mass", "conduction", "natural_convection", "sensor_lag", "iron_loss"])
def test_full_physics_takes_effects_too(effect: str) -> None:
    run = {"mix": Run((Segment("trot", 600, 0.5, 4.0),), cutout=None)}
    hidden = [Hidden(effect, places(effect, "quadruped")[-1], robot="quadruped")]
    changed, usual = (quadruped_logs(h, seed=1, runs=run, noise=0, quantisation=0)["mix"] for h in (hidden, ()))
    seen = [f"temperature.{node}" for node in NODES]
    assert 0.2 < (changed[seen] - usual[seen]).abs().max().max() < 12
    assert not (changed.drop(columns=seen) - usual.drop(columns=seen)).to_numpy().any()


def test_places_of_the_quadruped() -> None:
    assert places("coulomb_friction", "quadruped") == (*JOINTS, "*_hip", "*_thigh", "*_calf", "*")
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
        temperatures(("constant_heat", "*", 40.0))
