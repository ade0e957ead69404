"""One battery over every effect of the catalogue."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from lptn.basics.equations import equations_of
from lptn.cli.catalogue import docstring_text
from lptn.effects import Effect, Signature, catalogue
from lptn.effects.base import Site
from lptn.effects.excitation import INPUTS_VARY, Excitation
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration
from lptn.references import citations
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import simulate
from tests.builders import (
    base_network,
    off,
    random_inputs,
    random_run,
    random_value,
    with_every_effect,
)

KINDS = list(catalogue().values())
SWITCHED = [kind for kind in KINDS if kind.amplitude() is not None]
SITES: tuple[Site, ...] = get_args(Site)


def _named(kind: type[Effect]) -> str:
    return kind.key


every = pytest.mark.parametrize("kind", KINDS, ids=_named)
every_amplitude = pytest.mark.parametrize("kind", SWITCHED, ids=_named)


def _on(kind: type[Effect]) -> EffectDeclaration:
    return EffectDeclaration(kind(), "*", tuple(parameter.switched_on for parameter in kind.parameters))


class _Pair:
    """A model without and one with an effect, at the same random point."""

    def __init__(self, kind: type[Effect], declaration: EffectDeclaration, seed: int) -> None:
        rng = np.random.default_rng(seed)
        base = base_network(kind)
        self.without, self.extended = Model(base), Model(base.with_effects([declaration]))
        self.n = len(self.without.states)
        amplitude = kind.amplitude()
        held = f"{declaration.name}.{amplitude.name}." if amplitude else " "
        values = {
            parameter.name: parameter.value if parameter.name.startswith(held) else random_value(parameter, rng)
            for parameter in self.extended.parameters
        }
        inputs = random_inputs(self.extended, rng)
        x = rng.uniform(0.0, 90.0, len(self.extended.states))
        self.points = [
            (x[: len(model.states)], [inputs[c] for c in model.inputs], [values[u.name] for u in model.parameters])
            for model in (self.without, self.extended)
        ]

    def rates(self) -> list[FloatArray]:
        models = (self.without, self.extended)
        return [m.rhs(*point).full().ravel() for m, point in zip(models, self.points, strict=True)]

    def steps(self) -> list[FloatArray]:
        models = (self.without, self.extended)
        return [m.step()(*point, 1.5).full().ravel() for m, point in zip(models, self.points, strict=True)]

    def outputs(self) -> list[FloatArray]:
        models = (self.without, self.extended)
        return [m.output(x, p).full().ravel() for m, (x, _, p) in zip(models, self.points, strict=True)]


@every
def test_says_what_it_is(kind: type[Effect]) -> None:
    assert kind.key.isidentifier()
    assert kind.title
    assert kind.source
    assert kind.site in SITES
    assert isinstance(kind.signature, Signature)
    assert len(kind.signature.looks_like) > 20
    assert len(kind.signature.separate_by) > 20
    assert kind.key not in kind.signature.confused_with


@every
def test_says_itself_what_it_needs_of_logs_to_show(kind: type[Effect]) -> None:
    assert "excitation" in vars(kind)
    assert len(kind.excitation.needs) > 10
    nothing = Excitation(0.0, 0, 0, 0.0, 0, 0, 0.0, 0.0, 0.0, 0.0, {}, {})
    plenty = Excitation(600.0, 5, 5, 0.3, 5, 5, 60.0, 20.0, 15.0, 0.1, {}, {"a": 0.1})
    assert kind.excitation.lacking(plenty, {"a", "b"}) == ""
    assert kind.excitation is INPUTS_VARY or kind.excitation.lacking(nothing, {"a"}) or kind.site == "node"


@every
def test_prior_odds_are_odds(kind: type[Effect]) -> None:
    assert 0 < kind.prior_odds <= 1


@every
def test_docstring_has_the_equation_and_its_source(kind: type[Effect]) -> None:
    text = inspect.getdoc(kind) or ""
    assert ".. math::" in text
    assert "Source:" in text


@every
def test_its_equation_is_plain_text_for_a_terminal(kind: type[Effect]) -> None:
    assert equations_of(kind.__doc__ or "")
    left = re.findall(r"\\\w+|[{}]|\^(?!\()|\.\. math|:math:|\[[A-Z]\w+\d{4}", docstring_text(kind))
    assert not left, "PLUGIN.md lists the LaTeX that is known; a new command goes into lptn.basics.equations"


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind.__module__.startswith("lptn.")], ids=_named)
def test_works_of_its_source_are_cited_in_the_docstring_and_stand_in_the_bibliography(kind: type[Effect]) -> None:
    cited = {citation.reference.key for citation in citations(kind.source)}
    assert cited <= {citation.reference.key for citation in citations(kind.__doc__ or "")}


@every
def test_file_is_named_after_the_key(kind: type[Effect]) -> None:
    if kind.__module__.startswith("lptn."):
        assert Path(inspect.getfile(kind)).stem == kind.key


@every
def test_parameters_have_title_unit_and_a_size_within_bounds(kind: type[Effect]) -> None:
    assert kind.parameters
    for parameter in kind.parameters:
        lower, upper = parameter.bounds
        assert parameter.title
        assert parameter.unit
        assert parameter.typical > 0
        assert all(lower <= shape <= upper for shape in parameter.grid)
        assert parameter.off is None or lower <= parameter.off <= upper
        assert parameter.on is None or lower <= parameter.on <= upper


@every
def test_confused_with_names_effects_of_the_catalogue(kind: type[Effect]) -> None:
    assert kind.signature.confused_with
    assert set(kind.signature.confused_with) <= set(catalogue())


@every
def test_has_at_most_one_amplitude_and_one_shape(kind: type[Effect]) -> None:
    assert len([p for p in kind.parameters if p.off is not None]) <= 1
    assert len([p for p in kind.parameters if p.grid]) <= 1


@every
def test_an_option_that_does_not_exist_is_refused(kind: type[Effect]) -> None:
    with pytest.raises(ValueError, match=kind.key):
        kind(nonsense="torque")


@every_amplitude
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_off_is_the_model_without_it_to_the_last_bit(kind: type[Effect], seed: int) -> None:
    pair = _Pair(kind, off(kind), seed)
    for without, extended in (pair.rates(), pair.steps()):
        np.testing.assert_array_equal(without, extended[: pair.n])
    without, extended = pair.outputs()
    np.testing.assert_array_equal(without, extended)


@every_amplitude
def test_off_run_is_the_run_without_it_to_the_last_bit(kind: type[Effect]) -> None:
    base = base_network(kind)
    without, extended = Model(base), Model(base.with_effects([off(kind)]))
    run = random_run(extended, 120, seed=4, rise=5.0)
    path, other = simulate(without, bind(without, run)), simulate(extended, bind(extended, run))
    np.testing.assert_array_equal(path.readings, other.readings)
    np.testing.assert_array_equal(path.states, other.states[: len(without.states)])


@every_amplitude
def test_switched_on_it_moves_the_readings(kind: type[Effect]) -> None:
    base = base_network(kind)
    without, extended = Model(base), Model(base.with_effects([_on(kind)]))
    run = random_run(extended, 120, seed=5, rise=5.0)
    path, other = simulate(without, bind(without, run)), simulate(extended, bind(extended, run))
    assert np.abs(path.readings - other.readings).max() > 1e-4


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind.site == "edge"], ids=_named)
def test_an_edge_takes_from_one_node_what_it_gives_to_the_other(kind: type[Effect]) -> None:
    pair = _Pair(kind, _on(kind), seed=6)
    without, extended = pair.rates()
    values = dict(zip((u.name for u in pair.extended.parameters), pair.points[1][2], strict=True))
    into = [(extended[row] - without[row]) * values[f"capacity.{name}"] for row, name in enumerate(pair.without.nodes)]
    assert abs(into[0]) > 1e-3
    assert into[0] == pytest.approx(-into[1], rel=1e-9)


@pytest.mark.parametrize("seed", [7, 8])
def test_state_jacobian_with_all_effects_equals_finite_differences(seed: int) -> None:
    model = Model(with_every_effect())
    rng = np.random.default_rng(seed)
    p = [random_value(parameter, rng) for parameter in model.parameters]
    u = list(random_inputs(model, rng).values())
    x = rng.uniform(0.0, 90.0, len(model.states))
    columns = []
    for row in range(len(x)):
        e = np.zeros_like(x)
        e[row] = 1e-2
        columns.append((model.rhs(x + e, u, p) - model.rhs(x - e, u, p)).full().ravel() / 2e-2)
    exact = model.state_jacobian(x, u, p).full()
    np.testing.assert_allclose(exact, np.array(columns).T, rtol=1e-6, atol=1e-6 * np.abs(exact).max())


def test_parameter_jacobian_is_finite_for_a_robot_at_rest() -> None:
    model = Model(with_every_effect())
    u = [20.0 if column.startswith("temperature.") else 0.0 for column in model.inputs]
    assert np.isfinite(model.parameter_jacobian(np.full(len(model.states), 30.0), u, model.values).full()).all()
