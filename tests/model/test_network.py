"""Nodes, links and effects spread over places; the heat balance that follows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from lptn.basics.errors import InputError
from lptn.basics.parameters import Parameter, Share
from lptn.effects import catalogue
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, LinkDeclaration, Network, NodeDeclaration
from tests.builders import AMBIENT, LEG, capacity, effect, leg, link, node, random_inputs, random_value, resistance

JOINTS = ("FL_thigh", "FL_calf", "FR_thigh", "FR_calf")


def _shared(share: Share) -> Network:
    return Network(
        "two legs",
        (NodeDeclaration("*_*", capacity(share=share)), AMBIENT),
        (
            LinkDeclaration(("{leg}_thigh", "{leg}_calf"), resistance(share=share)),
            LinkDeclaration(("*_*", "ambient"), resistance(share=share)),
        ),
        joints=JOINTS,
    )


def _names(network: Network, prefix: str) -> list[str]:
    return [parameter.name for parameter in network.parameters if parameter.name.startswith(prefix)]


def _conductance(model: Model) -> np.ndarray:
    """Minus the heat into each node by the temperature of each [W/K]."""
    p = model.values
    capacities = [p[model.network.capacities[name]] for name in model.nodes]
    u = [20.0] * len(model.inputs)
    matrix: np.ndarray = -np.diag(capacities) @ model.state_jacobian([20.0] * len(model.states), u, p).full()
    return matrix


# --- who has a parameter in common -----------------------------------------------------------------


def test_share_each_gives_every_place_its_own() -> None:
    network = _shared("each")
    assert _names(network, "capacity") == [f"capacity.{name}" for name in JOINTS]
    assert _names(network, "resistance.F") == [
        "resistance.FL_calf~FL_thigh",
        "resistance.FR_calf~FR_thigh",
        *(f"resistance.{name}~ambient" for name in JOINTS),
    ]


def test_share_class_gives_like_joints_one() -> None:
    network = _shared("class")
    assert _names(network, "capacity") == ["capacity.*_thigh", "capacity.*_calf"]
    assert _names(network, "resistance") == [
        "resistance.*_calf~*_thigh",
        "resistance.*_thigh~ambient",
        "resistance.*_calf~ambient",
    ]


def test_share_all_gives_the_whole_pattern_one() -> None:
    network = _shared("all")
    assert _names(network, "capacity") == ["capacity.*_*"]
    assert len(_names(network, "resistance")) == 2
    assert len({network.capacities[name] for name in JOINTS}) == 1


def test_share_sides_keeps_both_and_says_which_belong_together() -> None:
    mirrors = {parameter.name: parameter.mirror for parameter in _shared("sides").parameters}
    assert mirrors["capacity.FL_calf"] == "capacity.FR_calf"
    assert mirrors["capacity.FR_calf"] == "capacity.FL_calf"
    assert mirrors["resistance.FL_calf~FL_thigh"] == "resistance.FR_calf~FR_thigh"
    assert all(mirror in mirrors for mirror in mirrors.values())


def test_effects_name_their_parameters_after_effect_parameter_and_place() -> None:
    network = leg([effect("coulomb_friction", "*_calf")])
    assert network.parameters[-1].name == "coulomb_friction.torque.FR_calf"


def test_a_label_names_an_effect_that_stands_twice_at_one_place() -> None:
    twice = [effect("constant_heat", "FR_calf"), replace(effect("constant_heat", "FR_calf"), label="brake")]
    names = [parameter.name for parameter in leg(twice).parameters]
    assert names[-2:] == ["constant_heat.power.FR_calf", "brake.power.FR_calf"]


@pytest.mark.parametrize("order", [slice(None), slice(None, None, -1)])
def test_of_two_declarations_that_cover_a_place_the_one_of_fewer_places_holds(order: slice) -> None:
    power = catalogue()["constant_heat"].parameters[0]
    everywhere = replace(effect("constant_heat"), parameters=(replace(power, share="all"),))
    network = leg([everywhere, effect("constant_heat", "FR_calf")][order])
    owners = {instance.place: instance.declaration.at for instance in network.effect_instances}
    assert owners == {"FR_hip": "*", "FR_thigh": "*", "FR_calf": "FR_calf"}
    assert {instance.place for instance in network.in_common("constant_heat")} == {"FR_hip", "FR_thigh"}


def test_values_replace_declared_ones_by_name() -> None:
    network = leg().with_values({"capacity.FR_calf": 111.0})
    assert [u.value for u in network.parameters if u.name == "capacity.FR_calf"] == [111.0]
    assert [u.value for u in network.with_values({}).parameters] == [u.value for u in network.parameters]


def test_surroundings_take_the_node_name_where_there_is_one_way_out() -> None:
    coolant = NodeDeclaration("coolant", temperature="temperature.coolant")
    network = Network(
        "n",
        (node("a"), node("b"), AMBIENT, coolant),
        (link("a", "ambient"), link("b", "ambient"), link("b", "coolant")),
    )
    assert network.surroundings == {
        "a": ("a", "ambient"),
        "ambient~b": ("b", "ambient"),
        "b~coolant": ("b", "coolant"),
    }


def test_a_link_between_two_prescribed_nodes_is_left_out() -> None:
    coolant = NodeDeclaration("coolant", temperature="start")
    network = Network(
        "n", (node("a"), AMBIENT, coolant), (link("a", "ambient"), link("ambient", "coolant"), link("a", "coolant"))
    )
    assert [one.place for one in network.resistors] == ["a~ambient", "a~coolant"]


def test_effects_can_be_taken_out_again() -> None:
    network = leg([effect("constant_heat", "*_calf"), effect("coulomb_friction")])
    left = network.without_effect("constant_heat", "*_calf")
    assert [one.effect.key for one in left.effects] == ["coulomb_friction"]


def test_an_effect_that_comes_back_has_the_values_it_is_declared_with() -> None:
    network = leg([effect("constant_heat", "*_calf")]).with_values({"constant_heat.power.FR_calf": 7.0})
    left = network.without_effect("constant_heat", "*_calf")
    assert left == leg([])
    again = left.with_effects([effect("constant_heat", "*_calf")])
    assert again.parameters == leg([effect("constant_heat", "*_calf")]).parameters


def test_the_effect_of_an_edge_pattern_acts_once_on_each_edge() -> None:
    assert [instance.place for instance in leg([effect("conduction", "*")]).effect_instances] == [
        "FR_hip~FR_thigh",
        "FR_calf~FR_hip",
        "FR_calf~FR_thigh",
    ]
    legs = Network(
        "legs",
        (NodeDeclaration("*_*", capacity()), AMBIENT),
        (LinkDeclaration(("*", "ambient"), resistance()),),
        (effect("conduction", "{leg}_thigh~{leg}_calf"),),
        JOINTS,
    )
    assert [instance.place for instance in legs.effect_instances] == ["FL_calf~FL_thigh", "FR_calf~FR_thigh"]


# --- mistakes ----------------------------------------------------------------------------------------

MISTAKES: dict[str, tuple[Callable[[], Network], str]] = {
    "isolated node": (lambda: Network("n", (node("a"), node("b"), AMBIENT), (link("a", "ambient"),)), "isolated"),
    "node twice": (lambda: Network("n", (node("a"), node("a"), AMBIENT), (link("a", "ambient"),)), "declared twice"),
    "node and ambient of one name": (
        lambda: Network("n", (node("a"), NodeDeclaration("a", temperature="start"))),
        "declared twice",
    ),
    "node pattern without joints": (lambda: Network("n", (NodeDeclaration("*_x", capacity()),)), "matches no joint"),
    "neither capacity nor temperature": (lambda: Network("n", (NodeDeclaration("a"),)), "neither"),
    "link to nowhere": (
        lambda: Network("n", (node("a"), AMBIENT), (link("a", "air"),)),
        "match no pair",
    ),
    "link to itself": (lambda: Network("n", (node("a"), AMBIENT), (link("a", "a"),)), "match no pair"),
    "two links": (
        lambda: Network("n", (node("a"), AMBIENT), (link("a", "ambient"), link("ambient", "a"))),
        "second link a~ambient",
    ),
    "effect twice": (lambda: leg([effect("constant_heat", "FR_calf")] * 2), "a second"),
    "effect with no place left": (
        lambda: leg(
            [*(effect("constant_heat", f"FR_{part}") for part in ("hip", "thigh", "calf")), effect("constant_heat")]
        ),
        "of fewer places",
    ),
    "effect nowhere": (lambda: leg([effect("constant_heat", "FL_calf")]), "matches no place"),
    "loss without its source": (lambda: leg([effect("resistance_rise")]), "a node that has copper_loss"),
    "edge to ambient": (lambda: leg([effect("conduction", "FR_calf~ambient")]), "matches no place"),
    "edge without a tilde": (lambda: leg([effect("conduction", "FR_calf")]), "matches no place"),
    "link effect without ambient": (
        lambda: leg([effect("radiation")], ambient=None),
        "linked to a prescribed temperature",
    ),
    "value outside its bounds": (lambda: leg().with_values({"capacity.FR_hip": -1.0}), "a value from 0.001"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line_with_what_was_found(mistake: str) -> None:
    build, text = MISTAKES[mistake]
    with pytest.raises(InputError) as caught:
        build()
    line = str(caught.value)
    assert "\n" not in line
    assert text in line
    assert "found " in line
    assert "expected " in line


def test_conduction_alone_saves_a_node_from_isolation() -> None:
    network = Network(
        "n", (node("a"), node("b"), AMBIENT), (link("a", "ambient"),), (effect("conduction", "a~b", conductance=1.0),)
    )
    assert _conductance(Model(network))[0, 1] == pytest.approx(-1.0)


def test_bounds_in_the_wrong_order_and_values_outside_are_refused() -> None:
    with pytest.raises(ValueError, match="wrong order"):
        Parameter("x", 1.0, "1", (2.0, 1.0))
    with pytest.raises(ValueError, match="outside"):
        Parameter("x", 3.0, "1", (1.0, 2.0))


# --- the heat balance ----------------------------------------------------------------------------------


def test_conductance_matrix_is_symmetric_with_row_sums_of_the_loss_to_ambient() -> None:
    matrix = _conductance(Model(leg()))
    np.testing.assert_allclose(matrix, matrix.T, rtol=1e-14)
    np.testing.assert_allclose(matrix.sum(axis=1), 0.1, rtol=1e-12)
    closed = _conductance(Model(leg(ambient=None)))
    np.testing.assert_allclose(closed, closed.T, rtol=1e-14)
    np.testing.assert_allclose(closed.sum(axis=1), 0.0, atol=1e-15)


def test_with_ambient_every_mode_dies_out_without_one_stays() -> None:
    """[QuadrupedLPTN, eq. 5] with the corrected sign: printed as it is, all eigenvalues are positive."""
    cooled = np.sort(np.linalg.eigvals(-_conductance(Model(leg())) / 300.0).real)
    closed = np.sort(np.linalg.eigvals(-_conductance(Model(leg(ambient=None))) / 300.0).real)
    assert (cooled < -1e-4).all()
    assert closed[-1] == pytest.approx(0.0, abs=1e-15)
    assert (closed[:-1] < -1e-4).all()


def test_heat_flows_from_the_hot_joint_to_the_cold_ones() -> None:
    """[QuadrupedLPTN, eq. 5]: 50, 25, 25 degC in air of 25 degC for 300 s; the printed sign heats the hot joint."""
    links = (link("a", "b", 5.0), link("b", "c", 2.5), link("a", "c", 12.0), *(link(x, "ambient", 4.5) for x in "abc"))
    model = Model(Network("leg", (*(node(x) for x in "abc"), AMBIENT), links))
    start = np.array([50.0, 25.0, 25.0])
    end = model.step("zoh")(start, [25.0], model.values, 300.0).full().ravel()
    assert end == pytest.approx([40.4, 27.9, 26.7], abs=0.05)
    # The same conductances with the printed sign, in plain SciPy.
    turned = expm(300.0 * _conductance(model) / 300.0) @ (start - 25.0) + 25.0
    assert turned == pytest.approx([67.4, 15.7, 23.0], abs=0.05)


def test_without_air_heat_only_spreads() -> None:
    model = Model(leg(ambient=None))
    end = model.step("zoh")(np.array([50.0, 25.0, 25.0]), [], model.values, 300.0).full().ravel()
    assert 25.0 < end[2] < end[1] < end[0] < 50.0
    assert end.sum() == pytest.approx(100.0, rel=1e-12)


@st.composite
def _networks(draw: st.DrawFn) -> Network:
    """1 to 6 nodes with random links, each with a way out, and heat of three kinds."""
    names = [f"n{i}" for i in range(draw(st.integers(1, 6)))]
    pairs = [(one, other) for row, one in enumerate(names) for other in names[row + 1 :]]
    joined = draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else []
    out = {name for name in names if draw(st.booleans())} | (set(names) - {end for pair in joined for end in pair})
    ohms = st.floats(0.1, 50.0)
    links = [link(*pair, draw(ohms)) for pair in joined] + [link(name, "ambient", draw(ohms)) for name in sorted(out)]
    nodes = [node(name, draw(st.floats(5.0, 2000.0))) for name in names]
    effects = [effect("copper_loss"), effect("heat_input"), effect("constant_heat")]
    return Network("random", (*nodes, AMBIENT), tuple(links), tuple(effects))


@given(_networks(), st.integers(0, 10_000))
def test_stored_heat_is_heat_in_less_loss_to_ambient(network: Network, seed: int) -> None:
    model, rng = Model(network), np.random.default_rng(seed)
    inputs = random_inputs(model, rng)
    x = rng.uniform(0.0, 90.0, len(model.nodes))
    rates = model.rhs(x, [inputs[c] for c in model.inputs], model.values).full().ravel()
    values = {parameter.name: parameter.value for parameter in network.parameters}
    stored = sum(values[f"capacity.{name}"] * rate for name, rate in zip(model.nodes, rates, strict=True))
    heat = [0.15 * (inputs[f"torque.{name}"] / 0.84) ** 2 + inputs[f"power.{name}"] + 3.0 for name in model.nodes]
    losses = [
        (temperature - inputs["temperature.ambient"]) / values[f"resistance.{name}~ambient"]
        if f"resistance.{name}~ambient" in values
        else (temperature - inputs["temperature.ambient"]) / values[f"resistance.ambient~{name}"]
        for name, temperature in zip(model.nodes, x, strict=True)
        if name in network.surroundings
    ]
    size = sum(map(abs, heat)) + sum(map(abs, losses)) + float(np.abs(rates).max())
    assert stored == pytest.approx(sum(heat) - sum(losses), abs=1e-9 * size)


@pytest.mark.long
@given(_networks(), st.integers(0, 10_000))
def test_a_warmer_neighbour_never_cools(network: Network, seed: int) -> None:
    """The balance is cooperative: no off-diagonal of the state Jacobian is negative, whatever the effects."""
    rng = np.random.default_rng(seed)
    present = {declared.effect.key for declared in network.effects} | {"ambient_drift", "winding_mass"}
    # The state of the first is a clock, that of the second a node's temperature and an excess.
    more: list[EffectDeclaration] = []
    for key, kind in catalogue().items():
        places = Network.places_for(network, EffectDeclaration(kind(), "*"))
        if key not in present and kind.site != "sensor" and places:
            more.append(EffectDeclaration(kind(), "*"))
    model = Model(network.with_effects(more))
    p = np.array([random_value(parameter, rng) for parameter in model.parameters])
    u = list(random_inputs(model, rng).values())
    jacobian = model.state_jacobian(rng.uniform(0.0, 90.0, len(model.states)), u, p).full()
    assert (jacobian - np.diag(np.diag(jacobian)) >= 0).all()


def test_nodes_come_in_the_order_of_their_declaration() -> None:
    assert Model(leg()).nodes == list(LEG)


@pytest.mark.parametrize(
    ("effect", "at", "run", "apart"),
    [
        ("sensor_lag", "*", "", False),
        ("sensor_lag", "*", "fit1", True),
        ("sensor_lag", "*_*", "", False),  # all joints, of a robot whose computer has a sensor, too
        ("sensor_lag", "FR_calf", "", True),
        ("conduction", "FR_calf~FR_hip", "", True),
        ("shared_mass", "*", "", False),
        ("sensor_lag", "*_calf", "", True),  # one place, by whatever name
        ("ambient_offset", "ambient", "", False),
    ],
)
def test_a_step_of_few_places_or_one_run_sets_them_apart(effect: str, at: str, run: str, apart: bool) -> None:
    plain = leg()
    nodes, links = (*plain.nodes, node("pc")), (*plain.links, link("pc", "ambient", 3.0))
    network = replace(plain, nodes=nodes, links=links, joints=LEG)
    assert network.sets_apart(EffectDeclaration(catalogue()[effect](), at, run=run)) == apart


def test_the_only_plate_or_computer_of_a_machine_is_set_apart_by_how_it_is_built() -> None:
    motors = [f"{motor}_{part}" for motor in ("m1", "m2") for part in ("winding", "housing")]
    links = [link(f"{motor}_winding", f"{motor}_housing") for motor in ("m1", "m2")]
    links += [link(f"{motor}_housing", "plate") for motor in ("m1", "m2")] + [
        link("plate", "ambient"),
        link("pc", "plate"),
    ]
    heat = (effect("copper_loss", "*_winding"), effect("heat_input", "pc"))
    network = Network("bench", (*map(node, [*motors, "plate", "pc"]), AMBIENT), tuple(links), heat)
    apart = [
        name for name in network.dynamic if network.sets_apart(EffectDeclaration(catalogue()["second_mass"](), name))
    ]
    assert apart == motors
    assert network.sets_apart(EffectDeclaration(catalogue()["second_mass"](), "plate", run="fit1"))


def test_parts_of_one_drive_are_not_alike() -> None:
    parts = ("winding", "housing", "gearbox", "inverter")
    links = [link(one, other) for one, other in pairwise(parts)] + [link("housing", "ambient")]
    network = Network(
        "hub",
        (*map(node, parts), AMBIENT),
        tuple(links),
        (effect("copper_loss", "winding"), effect("copper_loss", "inverter")),
    )
    second_mass = catalogue()["second_mass"]()
    assert not any(network.sets_apart(EffectDeclaration(second_mass, part)) for part in parts)


def test_a_class_of_like_joints_is_built_alike_and_a_leg_is_set_apart() -> None:
    joints = tuple(f"{side}_{joint}" for side in ("left", "right") for joint in ("hip", "knee", "ankle"))
    network = Network("legs", (node("*_*"), AMBIENT), (link("*_*", "ambient"),), joints=joints)
    apart = {
        at: network.sets_apart(EffectDeclaration(catalogue()["sensor_lag"](), at))
        for at in ("*_hip", "left_hip", "left_*", "*")
    }
    assert apart == {"*_hip": False, "left_hip": True, "left_*": True, "*": False}
    one_leg = replace(network, joints=joints[:3])
    assert not one_leg.sets_apart(EffectDeclaration(catalogue()["sensor_lag"](), "left_*"))
