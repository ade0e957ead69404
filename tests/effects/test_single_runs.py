"""Effects that are confined to one run, whatever the effect."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lptn.basics.places import is_of_run
from lptn.effects import Effect, catalogue
from lptn.logs.run import Run
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import sensitivities, simulate
from tests.builders import base_network, effect, random_run, two_nodes

KINDS = [kind for kind in catalogue().values() if kind.amplitude() is not None]
every_amplitude = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.key)


def _on(kind: type[Effect], run: str = "") -> EffectDeclaration:
    return EffectDeclaration(kind(), "*", tuple(parameter.switched_on for parameter in kind.parameters), run=run)


def _named(run: Run, name: str) -> Run:
    return replace(run, name=name)


@every_amplitude
def test_acts_in_its_run_as_it_always_would_and_in_no_other_at_all(kind: type[Effect]) -> None:
    base = base_network(kind)
    without, always, confined = (
        Model(base.with_effects(effects)) for effects in ([], [_on(kind)], [_on(kind, "monday")])
    )
    run = random_run(always, 60, seed=3, rise=5.0)
    paths = {
        name: [simulate(model, bind(model, _named(run, name))).readings for model in (without, always, confined)]
        for name in ("monday", "friday")
    }
    off, on, path = paths["monday"]
    np.testing.assert_allclose(path, on, rtol=1e-12, atol=0)
    assert np.abs(path - off).max() > 1e-4
    off, _, path = paths["friday"]
    np.testing.assert_array_equal(path, off)


@every_amplitude
def test_no_other_run_tells_anything_of_it(kind: type[Effect]) -> None:
    model = Model(base_network(kind).with_effects([_on(kind, "monday")]))
    amplitude = kind.amplitude()
    assert amplitude is not None
    own = [i for i, u in enumerate(model.parameters) if u.name.startswith(f"{kind.key}.{amplitude.name}.")]
    run = random_run(model, 60, seed=4, rise=5.0)
    for name, moves in (("monday", True), ("friday", False)):
        moved = sensitivities(model, bind(model, _named(run, name)), model.values, own).by_parameter
        assert bool(np.abs(moved).max() > 0) is moves


def test_it_is_off_wherever_no_run_is_driven() -> None:
    """An estimator, a forecast or an FMU takes the values as they stand, and gets what holds in any run."""
    always, confined = Model(two_nodes()), Model(two_nodes([effect_in("constant_heat", "monday", power=9.0)]))
    x, u = [50.0, 30.0], [20.0]
    np.testing.assert_array_equal(always.rhs(x, u, always.values).full(), confined.rhs(x, u, confined.values).full())
    assert confined.inputs == always.inputs


def effect_in(key: str, run: str, at: str = "*", **values: float) -> EffectDeclaration:
    return replace(effect(key, at, **values), run=run)


def test_two_runs_have_each_their_own_value() -> None:
    confined = [
        effect_in("sensor_offset", "monday", "a", offset=1.0),
        effect_in("sensor_offset", "friday", "a", offset=-2.0),
    ]
    model = Model(two_nodes(confined))
    names = [u.name for u in model.parameters if u.name.startswith("sensor_offset")]
    assert names == ["sensor_offset.offset.a@monday", "sensor_offset.offset.a@friday"]
    run = random_run(model, 20, seed=1, rise=5.0)
    other, monday, friday = (
        simulate(model, bind(model, _named(run, name))).readings[0] for name in ("sunday", "monday", "friday")
    )
    np.testing.assert_allclose(monday - other, 1.0, rtol=1e-12)
    np.testing.assert_allclose(friday - other, -2.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "pattern", "means"),
    [
        ("monday", "monday", True),
        ("monday#2", "monday", True),
        ("monday#2", "monday#2", True),
        ("monday#1", "monday#2", False),
        ("monday2", "monday", False),
        ("monday2", "monday*", True),
        ("friday", "[fs]*", True),
        ("log[1]", "log[1]", True),
    ],
)
def test_a_run_is_meant_by_its_name_its_log_or_a_glob(name: str, pattern: str, means: bool) -> None:
    assert is_of_run(name, pattern) is means


@pytest.mark.parametrize("run", ["monday", "2026.11.21 hot", "log*", 'say "x"'])
def test_the_file_keeps_the_run(run: str, tmp_path: Path) -> None:
    text = (
        '[model]\nambient = "temperature.ambient"\n[nodes.a]\ncapacity = 300\n[[links]]\nbetween = ["a", "ambient"]\n'
    )
    file = parse_model(text, tmp_path / "a.toml").with_effects([effect_in("surface_scale", run, "a", change=0.4)])
    again = parse_model(file.text, tmp_path / "a.toml").network
    assert [declaration.run for declaration in again.effects] == [run]
    assert [(u.name, u.value) for u in again.parameters] == [(u.name, u.value) for u in file.network.parameters]


def test_the_effect_of_one_run_is_taken_away_alone() -> None:
    network: Network = two_nodes([effect("constant_heat", "a"), effect_in("constant_heat", "monday", "a")])
    assert [declaration.run for declaration in network.without_effect("constant_heat", "a@monday").effects] == [""]
    assert [declaration.run for declaration in network.without_effect("constant_heat", "a").effects] == ["monday"]
