"""Numbers that the effects must give: from data sheets, the sources' corrected equations, and first principles."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from lptn.basics.errors import InputError
from lptn.effects.conduction import Conduction
from lptn.effects.constant_heat import ConstantHeat
from lptn.effects.copper_loss import CopperLoss
from lptn.effects.coulomb_friction import CoulombFriction
from lptn.effects.forced_convection import ForcedConvection
from lptn.effects.heat_input import HeatInput
from lptn.effects.iron_loss import IronLoss
from lptn.effects.natural_convection import NaturalConvection
from lptn.effects.radiation import Radiation
from lptn.effects.resistance_rise import ResistanceRise
from lptn.effects.resistance_thermometer import ResistanceThermometer
from lptn.effects.second_mass import SecondMass
from lptn.effects.sensor_offset import SensorOffset
from lptn.effects.torque_constant_drop import TorqueConstantDrop
from lptn.effects.viscous_friction import ViscousFriction
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.model.network import Network
from tests.builders import AMBIENT, effect, link, node, two_nodes


def p(**values: float) -> SimpleNamespace:
    return SimpleNamespace(**values)


@pytest.mark.parametrize(("current", "watts"), [(11.0, 22.506), (15.0, 41.85), (35.0, 227.85), (-11.0, 22.506)])
def test_copper_loss_of_the_u8_motor(current: float, watts: float) -> None:
    heat = CopperLoss(input="current").heat(25.0, p(current=current), p(resistance=0.186, torque_constant=0.1))
    assert heat == pytest.approx(watts, rel=1e-12)


def test_copper_loss_from_torque_goes_through_the_torque_constant() -> None:
    heat = CopperLoss(input="torque").heat(25.0, p(torque=8.4357), p(resistance=0.15, torque_constant=0.84357))
    assert heat == pytest.approx(0.15 * 100.0, rel=1e-12)


# Currents of the three lines [A] over a turn, for 1 ampere of each kind, and the heat of 1 ohm of each kind by them.
_TURN = 2 * np.pi * np.arange(720) / 720
_LINES = np.sin(_TURN + np.array([[0.0], [-2 * np.pi / 3], [2 * np.pi / 3]]))
_CURRENTS = {"amplitude": _LINES, "rms": _LINES * 2**0.5, "power_invariant": _LINES * (2 / 3) ** 0.5}
_CURRENTS["block"] = np.array([1.0, -1.0, 0.0])[(np.arange(3)[:, None] + np.arange(720) // 120) % 3]


def _heat_of_a_star(lines: np.ndarray, phase: float) -> float:
    return float((phase * lines**2).sum(axis=0).mean())


def _heat_of_a_delta(lines: np.ndarray) -> float:
    sides = (lines - np.roll(lines, -1, axis=0)) / 3  # by Kirchhoff: no current circles in equal sides
    return float((sides**2).sum(axis=0).mean())


@pytest.mark.parametrize("amperes", _CURRENTS)
def test_copper_loss_by_what_its_ohm_and_its_ampere_are(amperes: str) -> None:
    lines = _CURRENTS[amperes]
    truth = {
        "phase": _heat_of_a_star(lines, 1.0),
        "line_to_line": _heat_of_a_star(lines, 0.5),  # two phases of a star in series
        "delta": _heat_of_a_delta(lines),
    }
    for resistance_of, watts in truth.items():
        loss = CopperLoss(input="current", resistance_of=resistance_of, amperes=amperes)
        heat = loss.heat(25.0, p(current=3.0), p(resistance=0.2, torque_constant=1.0))
        assert heat == pytest.approx(9.0 * 0.2 * watts, rel=1e-3 if amperes == "block" else 1e-12)


def test_resistance_rises_by_31_percent_over_80_kelvin() -> None:
    factor = ResistanceRise().factor(105.0, p(alpha=0.0039, reference=25.0))
    assert factor == pytest.approx(1.312, rel=1e-12)


def test_torque_constant_falls_by_a_tenth_over_80_kelvin() -> None:
    factor = TorqueConstantDrop().factor(105.0, p(kappa=0.0012, reference=25.0))
    assert factor == pytest.approx(0.904**-2, rel=1e-12)
    assert TorqueConstantDrop().factor(25.0, p(kappa=0.0012, reference=25.0)) == 1.0


def test_resistance_to_ambient_follows_the_first_source() -> None:
    """R = R_c exp(-beta dT) / (1 + gamma |V|), both effects on the same link."""
    r, beta, gamma = 11.0, 0.006, 0.55
    network = two_nodes([effect("natural_convection", "a", beta=beta), effect("forced_convection", "a", gamma=gamma)])
    model = Model(network.with_values({"resistance.a~ambient": r, "capacity.a": 1.0}))
    for difference, speed in ((0.0, 0.0), (40.0, 0.0), (40.0, 1.2), (40.0, -1.2), (-15.0, 0.7)):
        x = np.array([20.0 + difference, 20.0])
        inputs = {"temperature.ambient": 20.0, "speed.base": speed}
        flow = float(model.rhs(x, [inputs[c] for c in model.inputs], model.values)[0])
        expected = -difference * (1 + gamma * abs(speed)) * np.exp(beta * difference) / r
        assert flow == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_natural_convection_leaves_the_link_alone_at_equal_temperatures() -> None:
    assert float(NaturalConvection().conductance_factor(20.0, 20.0, p(), p(beta=0.006))) == 1.0


def test_forced_convection_does_not_ask_for_the_direction() -> None:
    factors = [ForcedConvection().conductance_factor(50.0, 20.0, p(base_speed=v), p(gamma=0.5)) for v in (-2.0, 2.0)]
    assert factors == [2.0, 2.0]


@pytest.mark.parametrize("speed", [-5.0, -0.1, 0.0, 0.1, 5.0])
def test_friction_never_cools(speed: float) -> None:
    coulomb = CoulombFriction().heat(25.0, p(velocity=speed), p(torque=0.25))
    viscous = ViscousFriction().heat(25.0, p(velocity_rms=speed), p(damping=0.04))
    iron = IronLoss().heat(25.0, p(velocity_rms=speed), p(gain=0.05, exponent=1.5))
    assert min(coulomb, viscous, iron) >= 0
    assert coulomb == pytest.approx(0.25 * abs(speed), rel=1e-12)
    assert viscous == pytest.approx(0.04 * speed**2, rel=1e-12)
    assert iron == pytest.approx(0.05 * abs(speed) ** 1.5, rel=1e-9)


def test_friction_of_a_symmetric_gait_is_not_zero() -> None:
    time = np.arange(0.0, 1.0, 1e-4)
    speed = 5.0 * np.sin(2 * np.pi * 2.0 * time)
    mean, rms = np.abs(speed).mean(), np.sqrt(np.mean(speed**2))
    joules = CoulombFriction().heat(25.0, p(velocity=mean), p(torque=0.25))
    joules += ViscousFriction().heat(25.0, p(velocity_rms=rms), p(damping=0.04))
    assert joules == pytest.approx(1.296, rel=0.01)
    assert joules == pytest.approx(np.mean(0.25 * np.abs(speed) + 0.04 * speed**2), rel=1e-9)


def test_radiation_follows_the_fourth_powers_in_kelvin() -> None:
    heat = Radiation().extra_heat(60.0, 20.0, p(area=0.012))
    assert heat == pytest.approx(5.670374419e-8 * 0.012 * (293.15**4 - 333.15**4), rel=1e-12)
    assert heat == pytest.approx(-3.356, abs=0.01)
    assert Radiation().extra_heat(20.0, 60.0, p(area=0.012)) == pytest.approx(-heat, rel=1e-12)


def test_radiation_cools_the_hot_node_whichever_way_round_the_link_is_declared() -> None:
    def rate(one: str, other: str) -> float:
        network = two_nodes([effect("radiation", "a", area=0.01)])
        turned = Network("turned", network.nodes, (link(one, other, 4.0), network.links[1]), network.effects)
        model = Model(turned)
        return float(model.rhs([60.0, 20.0], [20.0], model.values)[0])

    assert rate("a", "ambient") == pytest.approx(rate("ambient", "a"), rel=1e-12)
    assert rate("a", "ambient") < -40.0 / 4.0 / 120.0


def test_second_mass_gives_back_what_it_takes() -> None:
    values = p(capacity=57.0, time_constant=120.0)
    heat = SecondMass().heat(60.0, 25.0, values)
    stored = values.capacity * SecondMass().rate(60.0, 25.0, values)
    assert heat < 0
    assert stored == pytest.approx(-heat, rel=1e-12)


def test_second_mass_and_node_settle_at_their_common_mean() -> None:
    """Without losses the energy stays: C T + C2 T2 is the same after an exchange of many time constants."""
    nodes = (node("a", 100.0), node("b", 100.0))
    network = Network(
        "closed", nodes, (link("a", "b", 1.0),), (effect("second_mass", "*", capacity=50.0, time_constant=60.0),)
    )
    model = Model(network)
    start = np.array([80.0, 20.0, 20.0, 20.0])
    end = model.run(1500)(start, np.zeros((0, 1500)), model.values, 1.0).full()[:, -1]
    weights = np.array([100.0, 100.0, 50.0, 50.0])
    np.testing.assert_allclose(end, weights @ start / weights.sum(), rtol=1e-6)


def test_lag_reaches_63_percent_after_one_time_constant() -> None:
    """The node is huge and stays at 50 degC; its sensor starts at 20 degC."""
    network = two_nodes([effect("sensor_lag", "a", fraction=1.0, time_constant=15.0)])
    model = Model(network.with_values({"capacity.a": 1e6, "resistance.a~ambient": 1e4}))
    start = np.array([50.0, 20.0, 20.0])
    reached = model.run(150)(start, np.full((1, 150), 20.0), model.values, 0.1).full()[:, -1]
    reading = float(model.output(reached, model.values)[0])
    assert (reading - 20.0) / 30.0 == pytest.approx(1 - np.exp(-1), rel=1e-5)


def test_half_a_lag_reads_half_way_between_node_and_bead() -> None:
    model = Model(two_nodes([effect("sensor_lag", "a", fraction=0.5)]))
    assert float(model.output([50.0, 20.0, 30.0], model.values)[0]) == pytest.approx(40.0)


def test_a_loose_sensor_comes_to_rest_between_its_node_and_the_air() -> None:
    """The node is huge and stays at 50 degC, the air at 20 degC; the bead has a quarter of the air."""
    network = two_nodes([effect("sensor_loose", "a", exposure=0.25, time_constant=10.0)])
    model = Model(network.with_values({"capacity.a": 1e6, "resistance.a~ambient": 1e4}))
    states = model.run(1500)(np.array([50.0, 20.0, 50.0]), np.full((1, 1500), 20.0), model.values, 0.1).full()
    readings = [float(model.output(states[:, k], model.values)[0]) for k in (99, -1)]
    assert readings == pytest.approx([42.5 + 7.5 * np.exp(-1.0), 42.5], abs=1e-3)


def test_a_loose_sensor_inside_a_machine_feels_what_its_part_is_linked_to() -> None:
    """A winding at 60 degC, three quarters of whose heat goes to 40 degC, the rest to 20 degC; all three are huge."""
    nodes = (node("winding", 1e7), node("case", 1e7), node("shaft", 1e7), AMBIENT)
    links = (link("winding", "case", 1.0), link("winding", "shaft", 3.0), link("case", "ambient", 100.0))
    loose = effect("sensor_loose", "winding", exposure=0.5, time_constant=10.0)
    model = Model(Network("motor", nodes, links, (loose,)))
    start = np.array([60.0, 40.0, 20.0, 60.0])
    reached = model.run(1500)(start, np.full((1, 1500), 0.0), model.values, 0.1).full()[:, -1]
    assert float(model.output(reached, model.values)[0]) == pytest.approx(60.0 + 0.5 * (35.0 - 60.0), abs=1e-2)


def test_a_loose_sensor_of_an_element_feels_what_its_faces_touch_and_one_beside_it_the_face() -> None:
    ring = """
[model]
ambient = "temperature.ambient"
[nodes.ring.element]
kind = "annulus"
inner_radius = 0.025
outer_radius = 0.04
length = 0.02
conductivity = 28
density = 7650
specific_heat = 490
[nodes]
winding.capacity = 50
housing.capacity = 100
[[links]]
between = ["winding", "ring.inner"]
resistance = 0.2
[[links]]
between = ["ring.outer", "housing"]
resistance = 0.1
[[links]]
between = ["housing", "ambient"]
[[effects]]
kind = "sensor_loose"
at = "*"
exposure = 0.5
time_constant = 10
"""
    built = Model(parse_model(ring, Path("ring.toml")).network)
    temperatures = {"ring": 60.0, "winding": 80.0, "housing": 40.0, "ambient": 20.0}
    states = np.array([temperatures[name] for name in built.nodes] * 2)  # each bead as warm as its part
    of_states = built.rhs(states, [20.0], built.values).full().ravel()
    rates = dict(zip(built.nodes, of_states[len(built.nodes) :], strict=True))
    assert rates["housing"] == pytest.approx(0.5 * (20.0 - 40.0) / 10.0)  # the air
    assert rates["ring"] == pytest.approx(0.5 * ((80.0 / 0.2 + 40.0 / 0.1) / 15.0 - 60.0) / 10.0)
    assert 0.5 * (60.0 - 80.0) / 10.0 < rates["winding"] < 0.0  # the face, between both


def test_no_sensor_is_loose_in_a_model_without_air() -> None:
    with pytest.raises(InputError, match="a model with a prescribed temperature"):
        Model(
            Network("n", (node("a", 100.0), node("b", 100.0)), (link("a", "b", 1.0),), (effect("sensor_loose", "a"),))
        )


@pytest.mark.parametrize("moved", [[("sensor_position", "a~b", {"fraction": 0.4})], [("hot_spot", "a", {})]])
def test_a_lag_follows_what_is_where_the_sensor_sits(moved: list[tuple[str, str, dict[str, float]]]) -> None:
    """Behind a hot spot, or between two parts, the bead reads its own temperature, which follows what is there."""
    heat = [effect("copper_loss", "a", resistance=1.0, torque_constant=1.0), effect("conduction", "a~b")]
    there = heat + [effect(kind, at, **values) for kind, at, values in moved]
    bare, lagged = Model(two_nodes(there)), Model(two_nodes([*there, effect("sensor_lag", "a", time_constant=15.0)]))
    inputs = np.zeros(len(lagged.inputs))
    before = [50.0, 20.0, *[57.0] * (len(bare.states) - 2)]
    here = float(bare.output(before, bare.values)[0])
    assert abs(here - 50.0) > 0.1
    assert float(lagged.output([*before, 31.0], lagged.values)[0]) == pytest.approx(31.0)
    rate = float(lagged.rhs([*before, 31.0], inputs, lagged.values)[-1])
    assert rate == pytest.approx((here - 31.0) / 15.0)


def test_offset_is_added_to_the_reading_only() -> None:
    assert SensorOffset().error(50.0, None, p(offset=-1.5)) == -1.5
    with_offset, without = Model(two_nodes([effect("sensor_offset", "*", offset=5.0)])), Model(two_nodes())
    x, u = [50.0, 20.0], [20.0]
    np.testing.assert_array_equal(
        with_offset.rhs(x, u, with_offset.values).full(), without.rhs(x, u, without.values).full()
    )


def test_a_winding_that_is_its_own_thermometer_is_off_by_its_cold_resistance() -> None:
    """A resistance 2 % above the assumed one, solved for the temperature with the assumed one."""
    assumed, true, alpha, temperature = 0.186, 0.186 * 1.02, 0.0039, 80.0
    measured = true * (1 + alpha * (temperature - 25.0))
    read = 25.0 + (measured / assumed - 1) / alpha
    values = p(change=0.02, alpha=alpha, reference=25.0)
    assert ResistanceThermometer().error(temperature, None, values) == pytest.approx(read - temperature)
    assert ResistanceThermometer().error(25.0, None, values) == pytest.approx(0.02 / alpha)  # 5.1 K at rest


def test_heats_that_are_plain_numbers() -> None:
    assert ConstantHeat().heat(25.0, p(), p(power=4.0)) == 4.0
    assert HeatInput().heat(25.0, p(power=16.0), p(gain=0.5)) == 8.0
    assert Conduction().conductance(p(conductance=0.3)) == 0.3


def test_single_node_settles_at_heat_times_resistance_with_time_constant_rc() -> None:
    """[QuadrupedLPTN, eq. 2]: T = T_E + Q R (1 - exp(-t / RC))."""
    network = Network(
        "one", (node("a", 100.0), AMBIENT), (link("a", "ambient", 3.0),), (effect("constant_heat", "a", power=5.0),)
    )
    model = Model(network)
    after = float(model.step("zoh")([20.0], [20.0], model.values, 300.0))
    assert after == pytest.approx(20.0 + 15.0 * (1 - np.exp(-1)), rel=1e-12)
    assert float(model.step("zoh")([20.0], [20.0], model.values, 300_000.0)) == pytest.approx(35.0, rel=1e-9)
