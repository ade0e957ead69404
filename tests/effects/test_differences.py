"""What one place has beside an effect that it has in common with others, whatever the effect."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.effects import Effect, catalogue
from lptn.model.file import added, parse_model
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import simulate
from tests.builders import base_for, base_network, effect, random_run, two_nodes

ADDING = (
    *("constant_heat", "coulomb_friction", "radiation", "conduction", "second_mass", "shared_mass", "sensor_lag"),
    *("drive_heat", "sensor_offset", "sensor_drift", "hot_spot", "solar", "clock_offset", "sensor_position"),
)
FACTORS = ("surface_scale", "loss_scale")


def _shared(key: str, size: float, at: str = "*") -> EffectDeclaration:
    kind = catalogue()[key]
    parameters = tuple(
        replace(parameter, value=size, share="all") if parameter.off is not None else replace(parameter, share="all")
        for parameter in kind.parameters
    )
    return EffectDeclaration(kind(), at, parameters)


def _difference(key: str, at: str, size: float) -> EffectDeclaration:
    kind = catalogue()[key]
    stated = kind.stated(difference=True)
    parameters = tuple(
        replace(parameter, value=size) if parameter.off is not None else parameter for parameter in stated
    )
    return EffectDeclaration(kind(), at, parameters, difference=True)


def _place(kind: type[Effect], network: Network) -> str:
    return network.places_for(EffectDeclaration(kind(), "*"))[0][0]


def _readings(network: Network) -> FloatArray:
    model = Model(network)
    return simulate(model, bind(model, random_run(model, 120, seed=6, rise=5.0))).readings


@pytest.mark.parametrize("key", ADDING)
def test_a_difference_adds_to_what_is_common(key: str) -> None:
    kind = catalogue()[key]
    amplitude = kind.amplitude()
    assert amplitude is not None
    base = two_nodes([declaration for declaration in base_for(kind) if declaration.effect.key != key])
    place = _place(kind, base)
    size = 0.4 * amplitude.typical
    both = base.with_effects([_shared(key, size), _difference(key, place, size / 2)])
    whole = base.with_effects([_shared(key, 1.5 * size, place)])
    others = [other for other, _ in base.places_for(EffectDeclaration(kind(), "*")) if other != place]
    if others and not kind.one_place_a_pattern:
        whole = whole.with_effects([replace(_shared(key, size, other)) for other in others])
    np.testing.assert_allclose(_readings(both), _readings(whole), rtol=1e-9)


@pytest.mark.parametrize("key", FACTORS)
def test_a_difference_multiplies_a_common_factor(key: str) -> None:
    kind = catalogue()[key]
    base = base_network(kind)
    both = base.with_effects([_shared(key, 0.3), _difference(key, "a", 0.2)])
    apart = base.with_effects([_shared(key, 1.3 * 1.2 - 1, "a"), _shared(key, 0.3, "b")])
    np.testing.assert_allclose(_readings(both), _readings(apart), rtol=1e-9)


def test_a_joint_may_have_less_than_the_others() -> None:
    both = two_nodes([_shared("constant_heat", 5.0), _difference("constant_heat", "a", -2.0)])
    apart = two_nodes([effect("constant_heat", "a", power=3.0), effect("constant_heat", "b", power=5.0)])
    np.testing.assert_allclose(_readings(both), _readings(apart), rtol=1e-12)
    with pytest.raises(ValueError, match="lies outside its bounds"):
        _difference("second_mass", "a", -10.0)  # it would run away


def test_a_sensor_may_sit_less_in_the_heat_than_the_others() -> None:
    """As in the largest motor of an arm: a kelvin more for a watt, at all joints, is too much there."""
    heated = base_for(catalogue()["hot_spot"])
    both = two_nodes([*heated, _shared("hot_spot", 0.5), _difference("hot_spot", "a", -0.2)])
    apart = two_nodes([*heated, _shared("hot_spot", 0.3, "a"), _shared("hot_spot", 0.5, "b")])
    np.testing.assert_allclose(_readings(both), _readings(apart), rtol=1e-9)


def test_it_has_names_of_its_own_and_is_taken_away_alone() -> None:
    network = two_nodes([_shared("second_mass", 20.0), _difference("second_mass", "a", 10.0)])
    names = [parameter.name for parameter in network.parameters]
    assert names[-4:] == [
        "second_mass.capacity.*",
        "second_mass.time_constant.*",
        "second_mass_difference.capacity.a",
        "second_mass_difference.time_constant.a",
    ]
    assert len(set(names)) == len(names)
    states = Model(network).states
    assert states == ["a", "b", "second_mass.a", "second_mass.b", "second_mass_difference.a"]
    assert [declaration.at for declaration in network.without_effect("second_mass", "a").effects] == ["*"]
    assert [declaration.at for declaration in network.without_effect("second_mass", "*").effects] == ["a"]


FILE = """
[model]
ambient = "temperature.ambient"
[nodes.a]
capacity = 300
[nodes.b]
capacity = 300
[[links]]
between = ["*", "ambient"]
[[effects]]
kind = "constant_heat"
at = "*"
share = "all"
"""


def test_the_file_keeps_it(tmp_path: Path) -> None:
    file = parse_model(FILE, tmp_path / "a.toml").with_effects([_difference("constant_heat", "a", -1.5)])
    assert "difference = true" in file.text
    assert "bounds" not in file.text.partition("difference")[2]
    (common, own) = parse_model(file.text, tmp_path / "a.toml").network.effects
    assert (common.difference, own.difference) == (False, True)
    assert own.resolved["power"].value == -1.5
    assert own.resolved["power"].bounds[0] < -100


def test_what_is_added_where_a_common_one_stands_is_a_difference(tmp_path: Path) -> None:
    file = added(parse_model(FILE, tmp_path / "a.toml"), "constant_heat", "a")
    assert [declaration.difference for declaration in file.network.effects] == [False, True]
    alone = added(parse_model(FILE.replace("all", "each"), tmp_path / "a.toml"), "constant_heat", "a")
    assert [(instance.place, instance.declaration.at) for instance in alone.network.effect_instances] == [
        ("b", "*"),
        ("a", "a"),
    ]


def test_what_is_all_or_nothing_is_added_instead_of_the_common_one(tmp_path: Path) -> None:
    file = parse_model(FILE.replace("constant_heat", "sensor_lag"), tmp_path / "a.toml")
    network = added(file, "sensor_lag", "a").network
    assert not any(declaration.difference for declaration in network.effects)
    assert [(instance.place, instance.declaration.at) for instance in network.effect_instances] == [
        ("b", "*"),
        ("a", "a"),
    ]


def test_without_the_word_an_effect_of_fewer_places_stands_in_place_of_the_common_one(tmp_path: Path) -> None:
    second = '[[effects]]\nkind = "constant_heat"\nat = "a"\n'
    instances = parse_model(FILE + second, tmp_path / "a.toml").network.effect_instances
    assert [(instance.place, instance.declaration.at) for instance in instances] == [("b", "*"), ("a", "a")]
    with pytest.raises(InputError, match="difference = true"):
        parse_model(FILE + second + second, tmp_path / "a.toml")
    parse_model(FILE + second + "difference = true\n", tmp_path / "a.toml")
    with pytest.raises(InputError, match="difference"):
        parse_model(FILE + second + 'difference = "yes"\n', tmp_path / "a.toml")


def test_a_mass_that_is_added_where_a_common_one_stands_is_the_place_s_own(tmp_path: Path) -> None:
    """Less of one could not be a difference: a negative mass would send its temperature away."""
    text = FILE.replace("constant_heat", "second_mass")
    file = added(parse_model(text, tmp_path / "a.toml"), "second_mass", "a")
    common, own = file.network.effects
    assert (common.difference, own.difference) == (False, False)
    assert own.in_place_of(common)
    assert not common.in_place_of(own)
    assert Model(file.network).states == ["a", "b", "second_mass.b", "second_mass.a"]
