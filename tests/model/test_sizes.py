"""The usual sizes of effects, from a gram of copper to a wall."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lptn.basics.parameters import Parameter
from lptn.effects import catalogue
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, LinkDeclaration, Network, NodeDeclaration
from lptn.model.sizes import JOINT, Sizes
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import simulate
from tests.builders import AMBIENT, capacity, effect, leg, link, node, random_run, resistance


def _sized(network: Network, key: str, *ends: str) -> float:
    amplitude = catalogue()[key].amplitude()
    assert amplitude is not None
    return Sizes(network).typical(amplitude, [ends])


def _one(heat_capacity: float, to_air: float) -> Network:
    part = NodeDeclaration("a", capacity(heat_capacity))
    return Network("one", (part, AMBIENT), (link("a", "ambient", to_air),))


def test_a_joint_of_a_leg_gets_what_the_effects_state() -> None:
    for key, ends in (
        ("second_mass", ("FR_thigh",)),
        ("constant_heat", ("FR_thigh",)),
        ("conduction", ("FR_calf", "FR_hip")),
        ("radiation", ("FR_hip", "ambient")),
        ("hot_spot", ("FR_hip",)),
        ("sensor_offset", ("FR_hip",)),
    ):
        amplitude = catalogue()[key].amplitude()
        assert amplitude is not None
        assert _sized(leg(), key, *ends) == pytest.approx(amplitude.typical, rel=0.4), key


@pytest.mark.parametrize(("heat_capacity", "to_air"), [(0.4, 200.0), (300.0, 10.0), (2e6, 0.02)])
def test_the_usual_heat_warms_a_place_by_some_ten_kelvin_whatever_its_size(heat_capacity: float, to_air: float) -> None:
    network = _one(heat_capacity, to_air)
    assert 10.0 <= _sized(network, "constant_heat", "a") * to_air < 15.0
    assert _sized(network, "second_mass", "a") == pytest.approx(heat_capacity / 6)
    assert _sized(network, "radiation", "a", "ambient") == pytest.approx(0.1 / to_air)
    assert _sized(network, "sensor_drift", "a") == 1.0


def test_the_conductance_is_what_warms_the_node_by_a_kelvin_in_the_long_run() -> None:
    quick = [NodeDeclaration(name, capacity(1.0)) for name in ("a", "b")]
    links = (link("a", "b", 3.0), link("b", "ambient", 5.0), link("a", "ambient", 40.0))
    conductance = Parameter("power", 1.0, "W", relative_to="conductance", typical=JOINT["conductance"])
    network = Network("two", (*quick, AMBIENT), links)
    model = Model(Network("two", (*quick, AMBIENT), links, (effect("constant_heat", "a", power=1.0),)))
    warmed, other = (
        simulate(compared, bind(compared, random_run(model, 200))).readings[0, -1]
        for compared in (model, Model(network))
    )
    assert Sizes(network).typical(conductance, [("a",)]) == pytest.approx(1 / (warmed - other), rel=1e-3)


def test_conduction_that_was_added_counts_as_a_way_out() -> None:
    apart = Network("two", (node("a"), node("b"), AMBIENT), (link("a", "ambient", 100.0), link("b", "ambient", 1.0)))
    joined = apart.with_effects([effect("conduction", "a~b", conductance=1.0)])
    assert _sized(joined, "constant_heat", "a") > 5 * _sized(apart, "constant_heat", "a")


def test_what_radiates_in_the_place_of_a_link_is_a_way_out() -> None:
    """A fit may leave all that a link carried to radiation, and the link at its bound."""
    surface = 0.017  # m², which at 25 degC gives 0.1 W/K
    shining = _one(300.0, 1e4).with_effects([effect("radiation", "a", area=surface)])
    model = Model(shining)
    rates = model.state_jacobian([25.0], [25.0], model.values).full()
    heat = catalogue()["constant_heat"].amplitude()
    assert heat is not None
    by_link, by_all, linked = (
        sizes.typical(heat, [("a",)]) for sizes in (Sizes(shining), Sizes(shining, rates), Sizes(_one(300.0, 10.0)))
    )
    assert by_link < 0.1 * linked
    assert by_all == pytest.approx(linked, rel=0.1)


def test_a_network_without_any_way_out_has_sizes() -> None:
    network = Network("two", (node("a"), node("b")), (LinkDeclaration(("a", "b"), resistance(2.0)),))
    assert 0 < _sized(network, "constant_heat", "a") < 10


def test_a_conduction_that_a_fit_made_negative_leaves_sizes() -> None:
    conduction = effect("conduction", "*", conductance=0.3)
    own = catalogue()["conduction"].stated(difference=True)
    negative = EffectDeclaration(conduction.effect, "a~b", (replace(own[0], value=-5.0),), difference=True)
    network = Network("two", (node("a"), node("b"), AMBIENT), (link("a", "ambient"), link("b", "ambient")))
    assert 0 < _sized(network.with_effects([conduction, negative]), "constant_heat", "a") < 10


def test_places_that_share_an_amplitude_have_the_mean_of_their_sizes() -> None:
    network = Network("two", (node("a", 100.0), node("b", 400.0), AMBIENT), (link("*", "ambient"),))
    amplitude = catalogue()["second_mass"].amplitude()
    assert amplitude is not None
    assert Sizes(network).typical(amplitude, [("a",), ("b",)]) == pytest.approx(200.0 / 6)
