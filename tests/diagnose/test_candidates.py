"""Which effects are proposed, and where."""

from __future__ import annotations

from lptn.diagnose import candidates
from lptn.diagnose.candidates import sites
from lptn.effects import catalogue
from lptn.network import EffectDeclaration
from tests.diagnose.conftest import Leg


def _places(leg: Leg, key: str) -> list[str]:
    model, data = leg()
    return [each.at for each in candidates(model.network, data.fit[0].run.columns) if each.effect.key == key]


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
    for candidate in candidates(model.network, data.fit[0].run.columns):
        larger = model.network.with_effects([candidate.declaration(None, None)])
        assert len(larger.uses) == len(model.network.uses) + len(candidate.places)
