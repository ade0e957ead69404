"""Exact derivatives of the discrete run, against central differences of the run itself."""

from __future__ import annotations

import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from lptn.effects import catalogue
from lptn.model.model import Model
from lptn.simulate.bound_run import BoundRun, bind, default_start
from lptn.simulate.simulation import sensitivities, simulate
from tests.builders import effect as declared
from tests.builders import off, random_run, two_nodes, with_every_effect


@pytest.fixture(scope="module", params=[False, True], ids=["sampled", "averaged"])
def case(request: pytest.FixtureRequest) -> tuple[Model, BoundRun, FloatArray]:
    """Every effect on, and hidden states away from their nodes."""
    model = Model(with_every_effect())
    bound = bind(model, random_run(model, 90, seed=1, step=2.0, averaged=bool(request.param)))
    return model, bound, default_start(model, bound) + np.arange(len(model.states))


def test_readings_are_those_of_the_simulation(case: tuple[Model, BoundRun, FloatArray]) -> None:
    model, bound, start = case
    moved = sensitivities(model, bound, model.values, [0], start)
    np.testing.assert_allclose(moved.readings, simulate(model, bound, start=start).readings, rtol=1e-13)


def test_every_parameter_equals_central_differences(case: tuple[Model, BoundRun, FloatArray]) -> None:
    model, bound, start = case
    p = model.values
    exact = sensitivities(model, bound, p, range(len(p)), start).by_parameter
    for column, parameter in enumerate(model.parameters):
        e = np.zeros_like(p)
        e[column] = 1e-4 * (abs(p[column]) or 1.0)
        slope = (simulate(model, bound, p + e, start).readings - simulate(model, bound, p - e, start).readings) / (
            2 * e[column]
        )
        size = np.abs(slope).max()
        assert size > 0, parameter.name
        np.testing.assert_allclose(exact[:, :, column], slope, rtol=1e-5, atol=1e-5 * size, err_msg=parameter.name)


def test_every_initial_state_equals_central_differences(case: tuple[Model, BoundRun, FloatArray]) -> None:
    model, bound, start = case
    exact = sensitivities(model, bound, model.values, [], start).by_start
    for column, name in enumerate(model.states):
        e = np.zeros_like(start)
        e[column] = 1e-3
        slope = (
            simulate(model, bound, start=start + e).readings - simulate(model, bound, start=start - e).readings
        ) / 2e-3
        np.testing.assert_allclose(exact[:, :, column], slope, rtol=1e-5, atol=1e-6, err_msg=name)


def test_core_states_are_enough_while_the_other_effects_are_off() -> None:
    kinds = [kind for kind in catalogue().values() if kind.amplitude() is not None]
    model = Model(two_nodes([declared("copper_loss"), *(off(kind) for kind in kinds)], linked=True))
    bound = bind(model, random_run(model, 60, seed=2))
    start = default_start(model, bound)
    start[2:] += 4.0
    chosen = range(len(model.values))
    whole = sensitivities(model, bound, model.values, chosen, start)
    core = sensitivities(model, bound, model.values, chosen, start, core=len(model.nodes))
    assert len(model.states) > len(model.nodes)
    np.testing.assert_allclose(core.by_parameter, whole.by_parameter, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(core.by_start, whole.by_start[:, :, : len(model.nodes)], rtol=1e-12)


def test_chosen_parameters_come_in_the_order_asked_for() -> None:
    model = Model(two_nodes([declared("constant_heat")]))
    bound = bind(model, random_run(model, 20))
    one = sensitivities(model, bound, model.values, [0, 4]).by_parameter
    other = sensitivities(model, bound, model.values, [4, 0]).by_parameter
    np.testing.assert_array_equal(one, other[:, :, ::-1])


def test_a_stiff_run_is_differentiated_in_the_same_small_steps() -> None:
    model = Model(two_nodes([declared("constant_heat")]).with_values({"capacity.a": 1.0, "resistance.a~ambient": 0.2}))
    bound = bind(model, random_run(model, 300, seed=5))
    p, column = model.values, 0
    exact = sensitivities(model, bound, p, [column]).by_parameter[:, :, 0]
    e = np.zeros_like(p)
    e[column] = 1e-4
    slope = (simulate(model, bound, p + e).readings - simulate(model, bound, p - e).readings) / 2e-4
    np.testing.assert_allclose(exact, slope, rtol=1e-5, atol=1e-5 * np.abs(slope).max())
