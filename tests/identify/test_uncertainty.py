"""Standard errors mean what they say, for fine and for coarse sensors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lptn.identify.fitting import fit
from lptn.identify.problem import Problem
from lptn.identify.uncertainty import open_combinations
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import NodeDeclaration
from lptn.simulate.bound_run import bind
from tests.builders import bound_runs, capacity
from tests.identify.truth import TRUTH, network, truth_run


def _rounded(run: Run, step: float) -> Run:
    if step == 0:
        return run
    columns = {
        name: np.round(values / step) * step if name in ("temperature.a", "temperature.b") else values
        for name, values in run.columns.items()
    }
    return replace(run, columns=columns, resolution={"temperature.a": step, "temperature.b": step})


@pytest.mark.parametrize("step", [0.0, 1.0])
def test_nineteen_of_twenty_true_values_lie_within_two_standard_errors(step: float) -> None:
    model, inside = Model(network()), []
    for seed in range(8):
        result = fit(model, bound_runs(model, [_rounded(truth_run(3000.0, step=4.0, noise=0.05, seed=seed), step)]))
        values = {parameter.name: parameter.value for parameter in result.model.parameters}
        inside += [abs(values[name] - true) < 2 * result.standard_errors[name] for name, true in TRUTH.items()]
    assert len(inside) == 32
    # Of 32, 30.4 are expected; fewer than 27 come once in a hundred times.
    assert sum(inside) >= 27


def test_a_coarse_sensor_widens_the_intervals() -> None:
    model, fine = Model(network()), truth_run(3000.0, step=4.0, noise=0.05)
    errors = [fit(model, bound_runs(model, [_rounded(fine, step)])).standard_errors for step in (0.0, 1.0)]
    wider = [errors[1][name] / errors[0][name] for name in TRUTH]
    assert min(wider) > 1
    assert np.mean(wider) > 1.3


def _with_prior_of_winding(mean: float, deviation: float) -> Model:
    given = network()
    winding = replace(given.effects[0].resolved["resistance"], value=mean, fixed=False, prior=(mean, deviation))
    others = tuple(parameter for parameter in given.effects[0].parameters if parameter.name != "resistance")
    return Model(replace(given, effects=(replace(given.effects[0], parameters=(winding, *others)),)))


@pytest.mark.parametrize("step", [1.0, 10.0])
def test_what_the_data_leave_open_is_as_uncertain_as_its_prior(step: float) -> None:
    """All heat, capacities and conductances may be multiplied by one factor: only the winding's prior holds them."""
    model = _with_prior_of_winding(0.22, 0.02)
    result = fit(model, bound_runs(model, [truth_run(1800.0, step=step, noise=0.05)]))
    values = {parameter.name: parameter.value for parameter in result.model.parameters}
    assert values["copper_loss.resistance.a"] == pytest.approx(0.22, rel=0.01)
    assert result.standard_errors["copper_loss.resistance.a"] == pytest.approx(0.02, rel=0.05)
    assert values["capacity.b"] == pytest.approx(1.1 * TRUTH["capacity.b"], rel=0.03)
    assert result.standard_errors["capacity.b"] == pytest.approx(0.02 / 0.22 * values["capacity.b"], rel=0.1)
    assert not result.uncertainty.warnings


def test_data_that_contradict_a_prior_are_told() -> None:
    given = network()
    model = Model(
        replace(given, nodes=(NodeDeclaration("a", replace(capacity(200.0), prior=(200.0, 5.0))), *given.nodes[1:]))
    )
    result = fit(model, bound_runs(model, [truth_run(1800.0, noise=0.05)]))
    (warning,) = result.uncertainty.warnings
    assert warning.startswith("capacity.a: 12")
    assert "standard deviations from its prior, 200 ± 5 J/K" in warning


@pytest.mark.parametrize("seed", range(3))
def test_two_factors_that_change_nothing_are_told_apart_whatever_their_basis(seed: int) -> None:
    """Two motors apart, each with a heat of unknown scale; of a third, one parameter alone is open."""
    open_ = np.zeros((6, 3))
    open_[[0, 3], 0] = open_[[1, 2, 4], 1] = 1.0
    open_[5, 2] = 1.0
    open_ /= np.linalg.norm(open_, axis=0)
    mixed, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    told = [(members.tolist(), factor) for members, factor in open_combinations(open_ @ mixed)]
    assert told == [([0, 3], True), ([1, 2, 4], True), ([5], False)]


def test_gradients_of_all_blocks_add_up_to_the_gradient() -> None:
    model = Model(network())
    runs = [bind(model, truth_run(900.0, seed=seed)) for seed in (0, 1)]
    problem = Problem(model, runs, np.array([0.1, 0.2]))
    z = problem.guess(model.values)
    gradient, _ = problem.normal(z)
    segments = problem.block_gradients(z, 120.0)
    assert len(segments) == 2 * 2 * 8  # runs, nodes, blocks
    np.testing.assert_allclose(segments.sum(axis=0), gradient, rtol=1e-9, atol=1e-6)  # at the guess no prior pulls
