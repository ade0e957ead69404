"""Which effects are proposed, and where."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lptn.basics.parameters import Parameter
from lptn.diagnose.candidates import candidates, separate_runs, sites
from lptn.effects import catalogue
from lptn.model.model import Model
from lptn.model.network import START, EffectDeclaration, LinkDeclaration, Network, NodeDeclaration
from tests.builders import AMBIENT, capacity, effect, resistance
from tests.diagnose.conftest import Leg

JOINTS = ("FL_thigh", "FL_calf", "FR_thigh", "FR_calf")


def _places(leg: Leg, key: str) -> list[str]:
    model, data = leg()
    return [each.at for each in candidates(model.network, data.fit[0].run.columns) if each.effect.key == key]


@pytest.mark.long
def test_a_node_effect_is_proposed_at_each_joint_and_everywhere(leg: Leg) -> None:
    assert _places(leg, "constant_heat") == ["FR_hip", "FR_thigh", "FR_calf", "*"]


def test_conduction_is_proposed_only_where_no_link_is(leg: Leg) -> None:
    assert _places(leg, "conduction") == ["FR_calf~FR_hip"]


def test_an_effect_whose_input_the_log_lacks_is_not_proposed(leg: Leg) -> None:
    model, data = leg()
    columns = [column for column in data.fit[0].run.columns if column != "speed.base"]
    assert not [each for each in candidates(model.network, columns) if each.effect.key == "forced_convection"]


def test_an_effect_that_stands_somewhere_is_not_proposed_there_nor_everywhere(leg: Leg) -> None:
    model, data = leg()
    network = model.network.with_effects([EffectDeclaration(catalogue()["constant_heat"](), "FR_hip")])
    found = [each.at for each in candidates(network, data.fit[0].run.columns) if each.effect.key == "constant_heat"]
    assert found == ["FR_thigh", "FR_calf"]


def test_effects_with_a_shape_are_scored_on_its_grid(leg: Leg) -> None:
    model, data = leg()
    found = [each for each in candidates(model.network, data.fit[0].run.columns) if each.effect.key == "second_mass"]
    shapes = {site.shape for site in sites(found)}
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
    single = [each for each in candidates(model.network, columns, ["fit1", "fit2"]) if each.run]
    assert {each.run for each in single} == {"fit1", "fit2"}
    assert {each.effect.key for each in single} >= {
        "surface_scale",
        "loss_scale",
        "ambient_offset",
        "sensor_offset",
        "constant_heat",
    }
    places = [each.at for each in single if each.effect.key == "constant_heat" and each.run == "fit2"]
    assert places == ["FR_hip@fit2", "FR_thigh@fit2", "FR_calf@fit2", "*@fit2"]
    assert not [each for each in candidates(model.network, columns, ["fit1"]) if each.run]


def test_pieces_of_one_log_are_runs_of_their_own_only_where_there_is_no_other_log() -> None:
    assert separate_runs(["a#1", "a#2"]) == ["a#1", "a#2"]
    assert separate_runs(["a#1", "a#2", "b"]) == ["a", "b"]
    assert separate_runs(["a"]) == separate_runs([]) == []


def test_every_site_says_the_name_of_its_amplitude(leg: Leg) -> None:
    model, data = leg()
    found = sites(candidates(model.network, data.fit[0].run.columns, ["fit1", "fit2"]))
    names = {
        parameter.name for parameter in Model(model.network.with_effects(s.declaration() for s in found)).parameters
    }
    assert {site.amplitude_name for site in found} <= names
    assert len({site.amplitude_name for site in found}) == len(found)


def test_an_effect_of_one_run_does_not_stand_in_the_way_of_the_same_in_all(leg: Leg) -> None:
    model, data = leg()
    columns = data.fit[0].run.columns
    taken = EffectDeclaration(catalogue()["constant_heat"](), "FR_hip", run="fit1")
    network = model.network.with_effects([taken])
    found = [each.at for each in candidates(network, columns, ["fit1", "fit2"]) if each.effect.key == "constant_heat"]
    assert "FR_hip" in found
    assert "FR_hip@fit2" in found
    assert "FR_hip@fit1" not in found


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
    found = candidates(network or _legs(), ["temperature.ambient", *COLUMNS, *more])
    return [each.at for each in found if each.effect.key == key]


def test_a_shared_mass_is_proposed_for_groups_of_three_nodes_or_more() -> None:
    assert _ats("shared_mass") == ["*"]  # the classes have two nodes each: what lies between those is an edge
    taken = _legs().with_effects([effect("shared_mass", "*")])
    assert _ats("shared_mass", network=taken) == []


def test_a_sensor_is_proposed_to_read_its_neighbour_either_way_and_on_all_legs() -> None:
    found = _ats("sensor_position")
    ways = (("calf", "thigh"), ("thigh", "calf"))
    single = {f"{leg}_{one}~{leg}_{other}" for leg in ("FL", "FR") for one, other in ways}
    assert set(found) == single | {"{leg}_calf~{leg}_thigh", "{leg}_thigh~{leg}_calf"}
    assert len(found) == len(set(found))


def test_the_clock_is_that_of_the_whole_robot() -> None:
    assert _ats("clock_offset") == ["*"]


def test_an_effect_takes_the_columns_that_there_are() -> None:
    assert _ats("fan") == []
    assert _ats("fan", "speed.fan") == [*JOINTS, "*_thigh", "*_calf", "*"]
    assert _ats("solar", "irradiance.FR_calf") == ["FR_calf"]
    found = candidates(_legs(), ["temperature.ambient", "irradiance.global"])
    (whole,) = (each for each in found if each.key == ("solar", "*"))
    assert whole.declaration(0.01, None).effect.chosen == {"input": "global_irradiance"}
    assert "irradiance.global" in Model(_legs().with_effects([whole.declaration(None, None)])).inputs


def test_a_drive_is_scored_by_torque_where_there_is_torque() -> None:
    currents = [f"current_abs.{joint}" for joint in JOINTS]
    for columns, word in ((COLUMNS, "torque_abs"), (currents, "current_abs"), ([*COLUMNS, *currents], "torque_abs")):
        found = [each for each in candidates(_legs(), columns) if each.effect.key == "driver_loss"]
        assert {each.declaration(None, None).effect.chosen["input"] for each in found} == {word}


def test_a_guessed_ambient_may_be_wrong_like_a_sensor() -> None:
    """A log without an ambient column: in all runs, or in one."""
    for ambient in (START, Parameter("temperature", 20.0, "degC", (-40.0, 60.0), fixed=True)):
        air = NodeDeclaration("ambient", temperature=ambient)
        network = replace(_legs(), nodes=(NodeDeclaration("*_*", capacity()), air))
        assert _ats("ambient_offset", network=network) == ["ambient"]
        found = {each.key for each in candidates(network, [], ["monday", "tuesday"])}
        assert ("ambient_offset", "ambient@monday") in found
