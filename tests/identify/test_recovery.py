"""Known parameters come back from noisy runs of an independent simulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lptn.basics.parameters import Transform
from lptn.identify.comparison import fit_start
from lptn.identify.fitting import Fit, fit
from lptn.identify.integral_start import integral_start
from lptn.identify.noise import balanced_sigma, estimate_noise
from lptn.identify.solvers import minimise
from lptn.model.model import Model
from lptn.model.network import Network
from lptn.simulate.bound_run import bind
from tests.builders import bound_runs
from tests.identify.truth import TRUTH, network, truth_run, with_garbage


def _values(result: Fit) -> dict[str, float]:
    return {u.name: u.value for u in result.model.parameters if u.free}


@pytest.fixture(scope="module")
def model() -> Model:
    return Model(network())


@pytest.fixture(scope="module")
def fitted(model: Model) -> Fit:
    return fit(model, bound_runs(model, [truth_run(1800.0)]))


def test_parameters_are_within_five_percent_and_four_standard_errors(fitted: Fit) -> None:
    assert fitted.status == "converged"
    assert _values(fitted) == pytest.approx(TRUTH, rel=0.05)
    for name, value in _values(fitted).items():
        assert 0 < fitted.standard_errors[name] < 0.05 * TRUTH[name]
        assert abs(value - TRUTH[name]) < 4 * fitted.standard_errors[name], name
    assert fitted.uncertainty.warnings == ()


def test_residuals_are_the_noise(fitted: Fit) -> None:
    assert fitted.rmse == pytest.approx(0.1, rel=0.05)
    assert fitted.noise.white == pytest.approx([0.1, 0.1], rel=0.1)
    (prediction,) = fitted.predictions
    assert abs(np.mean(prediction.error)) < 0.01


def test_fixed_parameters_stay(fitted: Fit, model: Model) -> None:
    held = [i for i in range(len(model.values)) if i not in model.free]
    np.testing.assert_array_equal(fitted.model.values[held], model.values[held])


def test_the_fitted_model_holds_the_values_of_the_point(fitted: Fit) -> None:
    np.testing.assert_allclose(fitted.model.values, fitted.point.values, rtol=1e-15)
    assert fitted.problem.cost(fitted.z) == pytest.approx(fitted.cost, rel=1e-9)


def test_json_holds_every_free_parameter_with_error_and_unit(fitted: Fit) -> None:
    written = fitted.as_json()
    parameters = written["parameters"]
    assert isinstance(parameters, dict)
    assert set(parameters) == set(TRUTH)
    assert set(parameters["capacity.a"]) == {"value", "error", "unit"}
    assert parameters["capacity.a"]["unit"] == "J/K"
    assert written["rmse_fit"] == pytest.approx(fitted.rmse)


def test_ten_random_starts_reach_the_same_optimum(model: Model) -> None:
    """The search alone, without the help of the integrated heat balance."""
    coarse = bound_runs(model, [truth_run(1800.0, step=5.0)])
    reference = fit(model, coarse)
    rng = np.random.default_rng(1)
    for _ in range(10):
        guess = model.values
        guess[model.free] = np.array(list(TRUTH.values())) * np.exp(rng.uniform(-np.log(5), np.log(5), len(TRUTH)))
        problem = reference.problem
        optimum = minimise(problem, problem.guess(guess))
        assert optimum.status == "converged"
        assert optimum.cost == pytest.approx(reference.cost, rel=1e-3)
        np.testing.assert_allclose(problem.point(optimum.z).values, reference.point.values, rtol=0.01)


def test_a_poor_guess_leads_to_the_same_optimum(model: Model) -> None:
    coarse = bound_runs(model, [truth_run(1800.0, step=5.0)])
    assert fit(model, coarse, guess=model.values * 3.0).cost == pytest.approx(fit(model, coarse).cost, rel=1e-3)


def test_missing_readings_do_not_count(model: Model) -> None:
    run = with_garbage(truth_run(1800.0))
    missing = sum(int(np.isnan(run.temperature(name)).sum()) for name in model.nodes)
    assert missing > 500
    result = fit(model, bound_runs(model, [run]))
    assert result.problem.readings == 2 * len(run) - missing
    assert _values(result) == pytest.approx(TRUTH, rel=0.05)
    assert result.rmse == pytest.approx(0.1, rel=0.05)


def test_a_node_without_a_sensor_is_found_through_the_others(model: Model) -> None:
    run = truth_run(1800.0)
    run = replace(run, columns={name: values for name, values in run.columns.items() if name != "temperature.b"})
    result = fit(model, bound_runs(model, [run]))
    assert result.rmse == pytest.approx(0.1, rel=0.05)
    assert _values(result)["capacity.a"] == pytest.approx(TRUTH["capacity.a"], rel=0.1)


def test_runs_of_different_length_are_fitted_together(model: Model) -> None:
    runs = [truth_run(400.0, seed=1), truth_run(900.0, seed=2), truth_run(1300.0, seed=3)]
    result = fit(model, bound_runs(model, runs))
    assert [prediction.error.shape for prediction in result.predictions] == [(2, 400), (2, 900), (2, 1300)]
    assert len(result.point.starts) == 3
    for start, run in zip(result.point.starts, runs, strict=True):
        air = run.columns["temperature.ambient"][0]
        assert start == pytest.approx([air, air], abs=0.2)
    assert _values(result) == pytest.approx(TRUTH, rel=0.05)


def test_readings_outside_the_counted_window_do_not_pull(model: Model) -> None:
    run = truth_run(1800.0)
    run.columns["temperature.a"][1200:] += 40.0
    result = fit(model, [bind(model, run).count((0.0, 1200.0))])
    assert _values(result) == pytest.approx(TRUTH, rel=0.05)


def test_integral_start_lands_near_without_a_guess(model: Model) -> None:
    bound = bound_runs(model, [truth_run(1800.0)])
    sigma = balanced_sigma(bound, estimate_noise(bound, model.nodes))
    start = integral_start(model, bound, sigma)
    guessed = {model.parameters[i].name: start[i] for i in model.free}
    assert guessed == pytest.approx(TRUTH, rel=0.3)


def test_integral_start_of_a_model_with_nothing_free_is_the_model() -> None:
    declared = network()
    held = Network(
        "held",
        tuple(
            n if n.capacity is None else replace(n, capacity=replace(n.capacity, fixed=True)) for n in declared.nodes
        ),
        tuple(replace(one, resistance=replace(one.resistance, fixed=True)) for one in declared.links if one.resistance),
        declared.effects,
    )
    model = Model(held)
    bound = bound_runs(model, [truth_run(300.0)])
    np.testing.assert_array_equal(integral_start(model, bound, np.ones(2)), model.values)
    assert fit(model, bound).problem.free == []


def test_starts_alone_are_found_with_the_parameters_held(model: Model) -> None:
    true = model.with_values(np.array([TRUTH.get(u.name, u.value) for u in model.parameters]))
    start = fit_start(true, bind(true, truth_run(300.0, noise=0.5)), np.array([0.5, 0.5]))
    assert start == pytest.approx([18.0, 18.0], abs=0.3)


def test_transform_goes_there_and_back(model: Model) -> None:
    transform = Transform(model.parameters)
    coordinates = transform.forward(model.values)
    np.testing.assert_allclose(transform.backward(coordinates), model.values, rtol=1e-14)
    e = 1e-6
    slope = (transform.backward(coordinates + e) - transform.backward(coordinates - e)) / (2 * e)
    np.testing.assert_allclose(transform.slope(model.values), slope, rtol=1e-8)


def test_a_resistance_is_searched_by_its_conductance_which_may_be_none(model: Model) -> None:
    resistances = [parameter for parameter in model.parameters if parameter.resistance]
    transform = Transform(resistances)
    endless = np.full(len(resistances), 1e12)
    coordinates = transform.forward(endless)
    np.testing.assert_allclose(transform.backward(coordinates), endless, rtol=1e-9)
    assert (transform.backward(0.0 * coordinates + 1.0) >= 1e12).all()  # K/W
    assert np.isfinite(transform.slope(transform.backward(0.0 * coordinates))).all()
    # A step back from there is a conductance that counts, and few steps are a link as it was.
    assert (transform.backward(coordinates - 1.0) < 1000.0).all()
    usual = np.array([parameter.declared.typical for parameter in resistances])
    logarithms = transform.forward(usual) - transform.forward(usual / 2)
    np.testing.assert_allclose(logarithms, np.log(2.0), rtol=0.01)
