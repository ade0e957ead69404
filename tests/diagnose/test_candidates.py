"""Which effects are proposed, and where."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lptn.basics.parameters import LARGEST, Parameter
from lptn.diagnose.candidates import Candidate, candidates, separate_runs
from lptn.effects import catalogue
from lptn.logs.columns import START
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, LinkDeclaration, Network, NodeDeclaration
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import sensitivities
from tests.builders import AMBIENT, capacity, effect, link, node, random_run, resistance
from tests.builders import leg as leg_network
from tests.diagnose.conftest import Leg

JOINTS = ("FL_thigh", "FL_calf", "FR_thigh", "FR_calf")


def _sites(proposed: list[Candidate]) -> dict[str, EffectDeclaration]:
    every = (candidate.sites(shape) for candidate in proposed for shape in candidate.shapes)
    return {name: site for sites in every for name, site in sites.items()}


def _places(leg: Leg, key: str) -> list[str]:
    model, data = leg()
    return [
        candidate.at for candidate in candidates(model.network, data.fit[0].run.columns) if candidate.effect.key == key
    ]


@pytest.mark.long
def test_a_node_effect_is_proposed_at_each_joint_and_everywhere(leg: Leg) -> None:
    assert _places(leg, "constant_heat") == ["FR_hip", "FR_thigh", "FR_calf", "*"]


def test_conduction_is_proposed_only_where_no_link_is(leg: Leg) -> None:
    assert _places(leg, "conduction") == ["FR_calf~FR_hip"]


def test_an_effect_whose_input_the_log_lacks_is_not_proposed(leg: Leg) -> None:
    model, data = leg()
    columns = [column for column in data.fit[0].run.columns if column != "speed.base"]
    assert not [
        candidate for candidate in candidates(model.network, columns) if candidate.effect.key == "forced_convection"
    ]


def test_an_effect_that_stands_somewhere_is_not_proposed_there_but_at_the_others_and_at_all_of_them(leg: Leg) -> None:
    model, data = leg()
    network = model.network.with_effects([EffectDeclaration(catalogue()["constant_heat"](), "FR_hip")])
    proposed = [
        candidate
        for candidate in candidates(network, data.fit[0].run.columns)
        if candidate.effect.key == "constant_heat"
    ]
    assert [candidate.at for candidate in proposed] == ["FR_thigh", "FR_calf", "*"]
    others = proposed[-1]
    assert others.places == ("FR_thigh", "FR_calf")
    larger = network.with_effects([others.declaration(2.0, None)])
    assert [
        (instance.place, instance.declaration.at)
        for instance in larger.effect_instances
        if instance.effect.key == "constant_heat"
    ] == [
        ("FR_hip", "FR_hip"),
        ("FR_thigh", "*"),
        ("FR_calf", "*"),
    ]


def test_what_class_and_place_hold_is_not_among_the_others() -> None:
    legs = Network(
        "two legs",
        (NodeDeclaration("*_*", capacity()), AMBIENT),
        (LinkDeclaration(("*_*", "ambient"), resistance()),),
        effects=(effect("constant_heat", "*_calf"),),
        joints=JOINTS,
    )
    places = {
        candidate.at: candidate.places for candidate in candidates(legs, []) if candidate.effect.key == "constant_heat"
    }
    assert places["*"] == ("FL_thigh", "FR_thigh")
    assert "*_thigh" not in places  # the same places


def test_effects_with_a_shape_are_scored_on_its_grid(leg: Leg) -> None:
    model, data = leg()
    proposed = [
        candidate
        for candidate in candidates(model.network, data.fit[0].run.columns)
        if candidate.effect.key == "second_mass"
    ]
    shapes = {site.resolved["time_constant"].value for site in _sites(proposed).values()}
    assert shapes == set(catalogue()["second_mass"].shape().grid)  # type: ignore[union-attr]


def test_every_candidate_can_be_added_to_the_network(leg: Leg) -> None:
    model, data = leg()
    for candidate in candidates(model.network, data.fit[0].run.columns, ["fit1", "fit2"]):
        larger = model.network.with_effects([candidate.declaration(None, None)])
        assert len(larger.effect_instances) == len(model.network.effect_instances) + len(candidate.places)
        assert larger.without_effect(*candidate.key) == model.network


def test_with_two_runs_what_may_differ_between_them_is_proposed_for_each_alone(leg: Leg) -> None:
    model, data = leg()
    columns = data.fit[0].run.columns
    single = [candidate for candidate in candidates(model.network, columns, ["fit1", "fit2"]) if candidate.run]
    assert {candidate.run for candidate in single} == {"fit1", "fit2"}
    assert {candidate.effect.key for candidate in single} >= {
        "surface_scale",
        "loss_scale",
        "ambient_offset",
        "sensor_offset",
        "constant_heat",
    }
    places = [
        candidate.at for candidate in single if candidate.effect.key == "constant_heat" and candidate.run == "fit2"
    ]
    assert places == ["FR_hip@fit2", "FR_thigh@fit2", "FR_calf@fit2", "*@fit2"]
    assert not [candidate for candidate in candidates(model.network, columns, ["fit1"]) if candidate.run]


def test_a_drift_is_rarer_than_a_mass_and_what_acts_in_one_run_rarer_still(leg: Leg) -> None:
    model, data = leg()
    by_key = {
        candidate.key: candidate for candidate in candidates(model.network, data.fit[0].run.columns, ["fit1", "fit2"])
    }
    assert by_key["second_mass", "FR_hip"].prior_odds == 1.0
    assert by_key["sensor_drift", "FR_hip"].prior_odds == pytest.approx(0.03)
    assert by_key["sensor_drift", "FR_hip@fit2"].prior_odds == pytest.approx(0.003)


def test_pieces_of_one_log_are_runs_of_their_own_only_where_there_is_no_other_log() -> None:
    assert separate_runs(["a#1", "a#2"]) == ["a#1", "a#2"]
    assert separate_runs(["a#1", "a#2", "b"]) == ["a", "b"]
    assert separate_runs(["a"]) == separate_runs([]) == []


def test_every_site_says_the_name_of_its_amplitude(leg: Leg) -> None:
    model, data = leg()
    proposed = _sites(candidates(model.network, data.fit[0].run.columns, ["fit1", "fit2"]))
    names = {parameter.name for parameter in Model(model.network.with_effects(proposed.values())).parameters}
    assert set(proposed) <= names


def test_an_effect_of_one_run_does_not_stand_in_the_way_of_the_same_in_all(leg: Leg) -> None:
    model, data = leg()
    columns = data.fit[0].run.columns
    taken = EffectDeclaration(catalogue()["constant_heat"](), "FR_hip", run="fit1")
    network = model.network.with_effects([taken])
    places = [
        candidate.at
        for candidate in candidates(network, columns, ["fit1", "fit2"])
        if candidate.effect.key == "constant_heat"
    ]
    assert "FR_hip" in places
    assert "FR_hip@fit2" in places
    assert "FR_hip@fit1" not in places


def test_the_ambient_is_a_place_unless_the_model_gives_it_as_a_number(leg: Leg) -> None:
    assert _places(leg, "ambient_offset") == ["ambient"]


COLUMNS = [f"{feature}.{joint}" for feature in ("torque", "torque_abs", "velocity") for joint in JOINTS]


def _legs() -> Network:
    """Two legs, each with a link from thigh to calf, all joints with copper loss."""
    links = (
        LinkDeclaration(("{leg}_thigh", "{leg}_calf"), resistance()),
        LinkDeclaration(("*_*", "ambient"), resistance()),
    )
    nodes = (NodeDeclaration("*_*", capacity()), AMBIENT)
    return Network("legs", nodes, links, (effect("copper_loss"),), joints=JOINTS)


def _ats(key: str, *more: str, network: Network | None = None) -> list[str]:
    proposed = candidates(network or _legs(), ["temperature.ambient", *COLUMNS, *more])
    return [candidate.at for candidate in proposed if candidate.effect.key == key]


def test_a_shared_mass_is_proposed_for_groups_of_three_nodes_or_more() -> None:
    assert _ats("shared_mass") == ["*"]  # the classes have two nodes each: what lies between those is an edge
    taken = _legs().with_effects([effect("shared_mass", "*")])
    assert _ats("shared_mass", network=taken) == []


def test_a_sensor_is_proposed_to_read_its_neighbour_either_way_and_on_all_legs() -> None:
    places = _ats("sensor_position")
    ways = (("calf", "thigh"), ("thigh", "calf"))
    single = {f"{leg}_{one}~{leg}_{other}" for leg in ("FL", "FR") for one, other in ways}
    assert set(places) == single | {"{leg}_calf~{leg}_thigh", "{leg}_thigh~{leg}_calf"}
    assert len(places) == len(set(places))


def test_a_sensor_comes_loose_alone() -> None:
    """All of them late and low alike is how a robot is made, which lags and masses say."""
    proposed = candidates(_legs(), ["temperature.ambient"])
    loose = [candidate.places for candidate in proposed if candidate.effect.key == "sensor_loose"]
    assert loose == [(joint,) for joint in JOINTS]


def test_the_clock_is_that_of_the_whole_robot() -> None:
    assert _ats("clock_offset") == ["*"]


def test_an_effect_takes_the_columns_that_there_are() -> None:
    assert _ats("fan") == []
    assert _ats("fan", "speed.fan") == [*JOINTS, "*_thigh", "*_calf", "*"]
    assert _ats("solar", "irradiance.FR_calf") == ["FR_calf"]
    proposed = candidates(_legs(), ["temperature.ambient", "irradiance.global"])
    (whole,) = (candidate for candidate in proposed if candidate.key == ("solar", "*"))
    assert whole.declaration(0.01, None).effect.chosen == {"input": "global_irradiance"}
    assert "irradiance.global" in Model(_legs().with_effects([whole.declaration(None, None)])).inputs


def test_a_drive_is_scored_by_torque_where_there_is_torque() -> None:
    currents = [f"current_abs.{joint}" for joint in JOINTS]
    for columns, word in ((COLUMNS, "torque_abs"), (currents, "current_abs"), ([*COLUMNS, *currents], "torque_abs")):
        proposed = [candidate for candidate in candidates(_legs(), columns) if candidate.effect.key == "driver_loss"]
        assert {candidate.declaration(None, None).effect.chosen["input"] for candidate in proposed} == {word}


def test_a_guessed_ambient_may_be_wrong_like_a_sensor() -> None:
    """A log without an ambient column: in all runs, or in one."""
    for ambient in (START, Parameter("temperature", 20.0, "degC", (-40.0, 60.0), fixed=True)):
        air = NodeDeclaration("ambient", temperature=ambient)
        network = replace(_legs(), nodes=(NodeDeclaration("*_*", capacity()), air))
        assert _ats("ambient_offset", network=network) == ["ambient"]
        keys = {candidate.key for candidate in candidates(network, [], ["monday", "tuesday"])}
        assert ("ambient_offset", "ambient@monday") in keys


def test_a_candidate_has_the_size_that_is_usual_at_its_place() -> None:
    """A wall of 2 MJ/K beside a gram of copper."""
    parts = (
        NodeDeclaration("wall", replace(capacity(), value=2e6, bounds=(1e-3, 1e9))),
        NodeDeclaration("foil", capacity(0.4)),
        AMBIENT,
    )
    links = (
        LinkDeclaration(("wall", "ambient"), resistance(0.05)),
        LinkDeclaration(("foil", "ambient"), resistance(200)),
    )
    network = Network("wall and foil", parts, links)
    by_key = {proposal.key: proposal for proposal in candidates(network, ["temperature.ambient"])}
    for key, wall, foil in (("second_mass", 2e6 / 6, 0.4 / 6), ("constant_heat", 430.0, 0.05)):
        for place, size in (("wall", wall), ("foil", foil)):
            candidate = by_key[key, place]
            assert candidate.typical == pytest.approx(size, rel=0.2)
            added = candidate.declaration(None, candidate.shapes[0]).parameters[0]
            assert added.typical == pytest.approx(candidate.typical)
            assert added.value == pytest.approx(0.3 * candidate.typical)
        both = by_key[key, "*"]
        assert both.typical == pytest.approx((wall * foil) ** 0.5, rel=0.2)


@pytest.mark.parametrize("key", ["second_mass", "sensor_lag", "shared_mass", "ambient_lag", "hot_spot", "iron_loss"])
def test_time_constants_are_those_that_the_log_can_show(key: str) -> None:
    shape = catalogue()[key].shape()
    assert shape is not None
    network = _legs()
    columns = ["temperature.ambient", *COLUMNS, *(f"velocity_rms.{joint}" for joint in JOINTS)]

    def shapes(step: float, duration: float) -> tuple[float | None, ...]:
        proposed = candidates(network, columns, step=step, duration=duration)
        return next(candidate.shapes for candidate in proposed if candidate.effect.key == key)

    for step in (1.0, 10.0):
        assert shapes(step, 3600.0) == shape.grid
    for step, duration in ((300.0, 2 * 86400.0), (1800.0, 30 * 86400.0), (1800.0, 6 * 3600.0), (5.0, 200.0)):
        if shape.unit == "s":
            values = [value for value in shapes(step, duration) if value is not None]
            assert 1 <= len(values) <= 8
            assert all(value >= step / 2 for value in values)
            assert len(values) == 1 or values[-1] <= duration


@pytest.mark.parametrize("step", [None, 1.0, 5.0, 300.0])
def test_no_masss_time_constant_is_shorter_than_half_a_step(step: float | None) -> None:
    """It shows as more of its node, and a fit would take many steps within each row for it; no lag's shows either."""
    for key, own in (("second_mass", 1.0), ("shared_mass", 10.0), ("sensor_lag", 0.5)):
        proposed = candidates(_legs(), ["temperature.ambient"], step=step, duration=86400.0)
        mass = next(candidate for candidate in proposed if candidate.effect.key == key)
        bounds = max(own, 0.5 * (step or 0.0)), LARGEST
        assert mass.declaration(0.5, mass.shapes[0]).resolved["time_constant"].bounds == bounds


def test_a_drift_is_asked_only_where_heat_that_rises_would_be_known() -> None:
    """Of a computer that is taken to give off 20 W all the time nobody knows whether it does."""

    def drifting(*added: EffectDeclaration) -> set[str]:
        network = _legs_and("pc").with_effects([effect("constant_heat", "*", power=20.0), *added])
        return {
            place
            for candidate in candidates(network, ["temperature.ambient", "power.pc", *COLUMNS])
            if candidate.effect.key == "sensor_drift"
            for place in candidate.places
        }

    assert drifting() == set(JOINTS)
    assert drifting(effect("heat_input", "pc")) == {*JOINTS, "pc"}


def test_a_long_log_shows_slow_masses() -> None:
    network = _legs()
    proposed = candidates(network, ["temperature.ambient"], step=300.0, duration=4 * 86400.0)
    mass = next(candidate for candidate in proposed if candidate.effect.key == "second_mass")
    assert len(mass.shapes) >= 4
    assert max(shape for shape in mass.shapes if shape) > 5 * 3600.0
    Model(network.with_effects(_sites([mass]).values()))


def _legs_and(name: str, *, pattern: bool = True) -> Network:
    """The two legs with one more node, whose joints are declared by a pattern or one by one."""
    joints = ("*_*",) if pattern else JOINTS
    nodes = (*(NodeDeclaration(joint, capacity()) for joint in joints), NodeDeclaration(name, capacity()), AMBIENT)
    links = (LinkDeclaration(("*", "ambient"), resistance()),)
    return Network("legs", nodes, links, (effect("copper_loss", "*_*"),), joints=JOINTS)


@pytest.mark.parametrize("pattern", [True, False])
def test_beside_a_computer_everywhere_on_the_joints_is_a_place(pattern: bool) -> None:
    network = _legs_and("pc", pattern=pattern)
    expected = [*JOINTS, "pc", "*_thigh", "*_calf", "*_*", "*"]
    assert sorted(_ats("second_mass", network=network)) == sorted(expected)
    assert sorted(_ats("surface_scale", network=network)) == sorted([*expected, "FL_*", "FR_*"])
    assert _ats("shared_mass", network=network) == ["*_*", "*"]
    assert "*_*" not in _ats("constant_heat", network=_legs_and("main_board", pattern=False))


def test_each_set_of_places_has_one_name(leg: Leg) -> None:
    for network in (leg()[0].network, _legs(), _legs_and("pc")):
        proposed = candidates(network, ["temperature.ambient", "speed.base", *COLUMNS], ["monday", "tuesday"])
        sets = [(candidate.effect.key, candidate.run, frozenset(candidate.places)) for candidate in proposed]
        assert len(set(sets)) == len(sets)
        for proposal in proposed:
            network.with_effects([proposal.declaration(None, proposal.shapes[0])])


def test_a_pattern_of_the_model_itself_is_a_place() -> None:
    network = _legs().with_effects([effect("forced_convection", "FR_*")])
    assert "FR_*" in _ats("constant_heat", network=network)
    assert "FR_*" not in _ats("forced_convection", "speed.base", network=network)


def _shared(key: str, at: str = "*") -> EffectDeclaration:
    kind = catalogue()[key]
    return EffectDeclaration(kind(), at, tuple(replace(parameter, share="all") for parameter in kind.parameters))


def test_where_an_effect_is_shared_each_place_may_differ() -> None:
    network = _legs_and("pc").with_effects([_shared("constant_heat"), _shared("forced_convection", "*_*")])
    columns = ["temperature.ambient", "speed.base", *COLUMNS]
    proposed = [candidate for candidate in candidates(network, columns, ["monday", "tuesday"]) if candidate.difference]
    assert {candidate.effect.key for candidate in proposed} == {"constant_heat", "forced_convection"}
    assert [candidate.at for candidate in proposed if candidate.effect.key == "constant_heat"] == [*JOINTS, "pc"]
    assert [candidate.at for candidate in proposed if candidate.effect.key == "forced_convection"] == list(JOINTS)
    assert not [
        candidate
        for candidate in candidates(network, ["temperature.ambient"])
        if candidate.effect.key == "forced_convection"
    ]
    (calf,) = (candidate for candidate in proposed if candidate.key == ("constant_heat", "FR_calf"))
    assert not calf.amplitude.one_sided
    ((name, site),) = calf.sites(None).items()
    larger = network.with_effects([site])
    assert name == larger.parameters[-1].name == "constant_heat_difference.power.FR_calf"
    added = network.with_effects([calf.declaration(-1.5, None)])
    assert added.parameters[-1].value == -1.5
    assert added.without_effect(*calf.key) == network
    again = [
        candidate.at
        for candidate in candidates(added, columns)
        if candidate.difference and candidate.effect.key == "constant_heat"
    ]
    assert again == ["FL_thigh", "FL_calf", "FR_thigh", "pc"]


def test_what_comes_from_outside_may_befall_a_leg_as_a_whole() -> None:
    legs = {at for at in _ats("surface_scale") if at.endswith("_*")}
    assert legs == {"FL_*", "FR_*"}
    assert "FL_*" in _ats("constant_heat")
    assert "FL_*" not in _ats("second_mass")  # how a joint is built, its like on the other legs are, too
    assert "FL_*" not in _ats("sensor_offset")  # nor do all sensors of a leg err alike
    in_a_run = {candidate.at for candidate in candidates(_legs(), ["temperature.ambient"], ["monday", "tuesday"])}
    assert "FL_*@monday" in in_a_run


def test_nothing_differs_from_what_each_place_has_for_itself() -> None:
    own = _legs().with_effects([effect("constant_heat")])
    assert not [candidate for candidate in candidates(own, ["temperature.ambient", *COLUMNS]) if candidate.difference]
    clock = _legs().with_effects([_shared("clock_offset")])
    assert not [candidate for candidate in candidates(clock, ["temperature.ambient", *COLUMNS]) if candidate.difference]


def test_of_what_is_all_or_nothing_a_place_may_have_its_own_instead_of_what_the_others_have() -> None:
    lagging, columns = _legs().with_effects([_shared("sensor_lag")]), ["temperature.ambient", *COLUMNS]
    proposed = [candidate for candidate in candidates(lagging, columns) if candidate.difference]
    assert [candidate.key for candidate in proposed] == [("sensor_lag", name) for name in JOINTS]
    calf = next(candidate for candidate in proposed if candidate.at == "FR_calf")
    assert not calf.amplitude.one_sided  # it may be earlier, too
    for amplitude, expected in ((1.2, 15.0 + 1.2 * 45.0), (-0.2, 15.0 - 0.2 * 45.0), (-1.0, 4.5)):
        added = lagging.with_effects([calf.declaration(amplitude, 45.0)])
        assert not added.effects[-1].difference
        times = {parameter.name: parameter.value for parameter in added.parameters if "time_constant" in parameter.name}
        assert times == {
            "sensor_lag.time_constant.*": 15.0,
            "sensor_lag.time_constant.FR_calf": pytest.approx(expected),
        }
        assert {instance.place for instance in added.in_common("sensor_lag")} == set(JOINTS) - {"FR_calf"}
        assert added.without_effect(*calf.key) == lagging
        again = [candidate.at for candidate in candidates(added, columns) if candidate.difference]
        assert again == [name for name in JOINTS if name != "FR_calf"]


def test_friction_at_a_rotors_speed_is_expected_no_larger_than_the_motor_bears() -> None:
    network, columns = _legs(), [*COLUMNS, *(f"velocity_rms.{joint}" for joint in JOINTS)]

    def typical(key: str, rms: dict[str, float] | None) -> float:
        proposed = candidates(network, columns, rms=rms)
        return next(candidate for candidate in proposed if candidate.key == (key, "FR_calf")).typical

    for key in ("coulomb_friction", "viscous_friction", "iron_loss"):
        stated = typical(key, None)
        assert typical(key, dict.fromkeys(columns, 2.0)) == stated
        assert typical(key, dict.fromkeys(columns, 0.0)) == stated
        friction = effect(
            key, "FR_calf", **{catalogue()[key].parameters[0].name: typical(key, dict.fromkeys(columns, 600.0))}
        )
        model = Model(replace(network, effects=(friction,)))
        inputs = [25.0 if column.startswith("temperature.") else 600.0 for column in model.inputs]
        heat = 300.0 * float(model.rhs([25.0] * 4, inputs, model.values).full().max())
        assert 3.0 < heat < 10.0  # W: 30 K at some 0.2 W/K


@pytest.mark.parametrize("step", [300.0, 1800.0])
def test_candidates_of_a_slow_log_can_all_be_scored(step: float) -> None:
    """A wall with a reading every 5 or 30 min: time constants of seconds would be too stiff for such steps."""
    wall = NodeDeclaration("wall", replace(capacity(), value=1e6, bounds=(1e-3, 1e9)))
    links = (LinkDeclaration(("wall", "ambient"), resistance(0.1)),)
    network = Network("wall", (wall, AMBIENT), links, (effect("heat_input", "wall"), effect("copper_loss", "wall")))
    base = Model(network)
    run = random_run(base, 200, step=step, hold=24, rise=10.0)
    proposed = _sites(candidates(network, run.columns, step=step, duration=200 * step))
    full = Model(network.with_effects(proposed.values()))
    names = [parameter.name for parameter in full.parameters]
    chosen = [names.index(name) for name in proposed]
    moved = sensitivities(full, bind(full, run), full.values, chosen, core=1)
    assert np.isfinite(moved.derivatives).all()
    assert (np.abs(moved.by_parameter).max(axis=(0, 1)) > 0).all()


def _knee() -> Network:
    """Winding, housing and foot of a knee, in a row, each with a sensor; the winding's current is logged."""
    return Network(
        "knee",
        (node("knee"), node("knee_case"), node("foot"), AMBIENT),
        (link("knee", "knee_case"), link("knee_case", "foot"), link("foot", "ambient")),
        effects=(replace(effect("copper_loss", "knee"), effect=catalogue()["copper_loss"](input="current")),),
    )


def test_a_joints_heat_is_proposed_in_its_housing_too_by_the_columns_of_its_winding() -> None:
    columns = ("current.knee", "velocity.knee", "velocity_rms.knee")
    proposed = [candidate for candidate in candidates(_knee(), columns) if candidate.effect.key == "viscous_friction"]
    assert [(candidate.at, candidate.driven_by) for candidate in proposed] == [("knee", ""), ("knee_case", "knee")]
    case = proposed[1]
    declared = case.declaration(0.1, None)
    assert (declared.at, declared.driven_by) == ("knee_case", "knee")
    assert [site.driven_by for site in case.sites(None).values()] == ["knee"]
    assert "velocity_rms.knee" in Model(_knee().with_effects([declared])).inputs


def test_heat_of_all_housings_is_proposed_with_one_coefficient_each_by_its_own_winding() -> None:
    windings, current = ("FL", "FR"), catalogue()["copper_loss"](input="current")
    network = Network(
        "wheels",
        (*(node(f"{wheel}{part}") for wheel in windings for part in ("", "_hub")), AMBIENT),
        tuple(link(*pair) for wheel in windings for pair in ((wheel, f"{wheel}_hub"), (f"{wheel}_hub", "ambient"))),
        effects=tuple(replace(effect("copper_loss", wheel), effect=current) for wheel in windings),
    )
    columns = [f"{quantity}.{wheel}" for quantity in ("current", "velocity") for wheel in windings]
    proposed = [candidate for candidate in candidates(network, columns) if candidate.effect.key == "coulomb_friction"]
    (hubs,) = (candidate for candidate in proposed if candidate.at == "*_hub")
    declared = hubs.declaration(0.2, None)
    assert (hubs.places, hubs.windings, declared.driven_by) == (("FL_hub", "FR_hub"), windings, "*")
    model = Model(network.with_effects([declared]))
    assert {"velocity.FL", "velocity.FR"} <= set(model.inputs)
    assert "coulomb_friction.torque.*_hub" in [parameter.name for parameter in model.parameters]
    assert [site.driven_by for site in hubs.sites(None).values()] == list(windings)
    left = [candidate for candidate in candidates(model.network, columns) if candidate.effect.key == "coulomb_friction"]
    assert [(candidate.at, candidate.driven_by) for candidate in left if candidate.difference] == [
        ("FL_hub", "FL"),
        ("FR_hub", "FR"),
    ]


def test_a_housing_with_columns_of_its_own_is_driven_by_them() -> None:
    columns = ("velocity.knee", "velocity.knee_case")
    proposed = [candidate for candidate in candidates(_knee(), columns) if candidate.effect.key == "coulomb_friction"]
    assert [(candidate.at, candidate.driven_by) for candidate in proposed] == [("knee", ""), ("knee_case", "")]


def test_a_part_between_two_windings_is_driven_by_neither() -> None:
    both = ("FR_hip", "FR_calf")
    current = catalogue()["copper_loss"](input="current")
    network = leg_network([replace(effect("copper_loss", at), effect=current) for at in both])
    columns = [f"velocity.{at}" for at in both]
    places = [candidate.at for candidate in candidates(network, columns) if candidate.effect.key == "coulomb_friction"]
    assert "FR_thigh" not in places
