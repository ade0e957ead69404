"""The least-squares problem itself: derivatives, the left-right regulariser, bounds, warnings, interrupts."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from lptn.basics.parameters import Share
from lptn.identify.comparison import fit_start
from lptn.identify.fitting import fit
from lptn.identify.problem import Problem
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, LinkDeclaration, Network, NodeDeclaration
from lptn.simulate.bound_run import bind
from tests.builders import AMBIENT, bound_runs, capacity, effect, make_run, random_run, resistance, with_every_effect
from tests.identify.truth import TRUTH, network, truth_run

COARSE = 5.0  # s


def _with(effects: list[EffectDeclaration]) -> Network:
    declared = network()
    return replace(declared, effects=(*declared.effects, *effects))


def _sides(share: Share = "sides") -> Network:
    joints = ("left_knee", "right_knee")
    copper = effect("copper_loss", "*", resistance=0.2, torque_constant=1.0)
    return Network(
        "sides",
        (NodeDeclaration("*_knee", capacity(300.0, share=share)), AMBIENT),
        (LinkDeclaration(("*_knee", "ambient"), resistance(5.0, share=share)),),
        (copper,),
        joints,
    )


def _sides_run(model: Model, left: float = 200.0, right: float = 300.0) -> list[float]:
    return [{"capacity.left_knee": left, "capacity.right_knee": right}.get(u.name, u.value) for u in model.parameters]


def _simulated(model: Model, values: list[float]) -> dict[str, np.ndarray]:
    run = random_run(model, 200, seed=1, step=COARSE)
    path = model.run(200)(np.full(len(model.states), 22.0), _inputs(model, run.columns), values, COARSE).full()
    states = np.hstack([np.full((len(model.states), 1), 22.0), path])[:, :-1]
    noise = 0.05 * np.random.default_rng(2).standard_normal(states.shape)
    return {**run.columns, **{f"temperature.{n}": states[i] + noise[i] for i, n in enumerate(model.nodes)}}


def _inputs(model: Model, columns: object) -> np.ndarray:
    assert isinstance(columns, dict)
    return np.array([columns[name] for name in model.inputs])


def _offsets() -> tuple[Model, dict[str, np.ndarray]]:
    """Two nodes of which all is known but how far their sensors read too much, and what they read at 9 and 3 K."""
    nodes = (NodeDeclaration("a", capacity(120.0, fixed=True)), NodeDeclaration("b", capacity(250.0, fixed=True)))
    links = tuple(LinkDeclaration((name, "ambient"), resistance(4.0, fixed=True)) for name in ("a", "b"))
    model = Model(Network("two", (*nodes, AMBIENT), links, tuple(effect("sensor_offset", name) for name in ("a", "b"))))
    columns = _simulated(model, model.values.tolist())
    return model, {
        **columns,
        "temperature.a": columns["temperature.a"] + 9,
        "temperature.b": columns["temperature.b"] + 3,
    }


def test_an_optimum_beyond_a_steps_reach_is_reached_though_each_step_gains_what_it_promised() -> None:
    model, columns = _offsets()
    names = [parameter.name for parameter in model.parameters]
    guess = np.where([name.startswith("sensor_offset") for name in names], 0.0, model.values)
    found = fit(model, [make_run(columns, step=COARSE)], guess=guess)
    values = dict(zip(names, found.model.values, strict=True))
    assert found.status == "converged"
    assert values["sensor_offset.offset.a"] == pytest.approx(9.0, abs=0.1)
    assert values["sensor_offset.offset.b"] == pytest.approx(3.0, abs=0.1)


def test_the_end_of_a_linear_problem_takes_no_second_derivatives(monkeypatch: pytest.MonkeyPatch) -> None:
    model, columns = _offsets()
    offsets = {"sensor_offset.offset.a": 9.0, "sensor_offset.offset.b": 3.0}
    model = model.with_values(np.array([offsets.get(p.name, p.value) for p in model.parameters]))
    calls = Mock(side_effect=Problem.normal)
    monkeypatch.setattr(Problem, "normal", lambda self, z: calls(self, z))
    start = fit_start(model, bind(model, make_run(columns, step=COARSE)), np.array([0.05, 0.05]))
    assert start == pytest.approx([22.0, 22.0], abs=0.1)
    assert calls.call_count == 1


@pytest.mark.long
def test_jacobian_with_priors_and_mirrors_equals_finite_differences() -> None:
    model = Model(with_every_effect())
    bound = bound_runs(model, [random_run(model, 60, seed=1), random_run(model, 40, seed=2)])
    problem = Problem(model, bound, np.array([0.3, 0.5]), symmetry_penalty=2.0)
    z = problem.guess(model.values)
    z[-3:] += 1.0
    residuals, jacobian = problem.jacobian(z)
    np.testing.assert_allclose(residuals, problem.residuals(z), rtol=1e-12, atol=1e-12)
    for column in range(problem.size):
        e = np.zeros_like(z)
        e[column] = 1e-4
        slope = (problem.residuals(z + e) - problem.residuals(z - e)) / 2e-4
        size = np.abs(slope).max()
        np.testing.assert_allclose(jacobian[:, column], slope, rtol=1e-5, atol=1e-6 * size + 1e-9)


_FIVE = ("a", "b", "c", "d", "e")
_LATE = [effect("sensor_lag", "b"), effect("sensor_loose", "e"), effect("hot_spot", "c"), effect("second_mass", "d")]


@pytest.mark.parametrize("averaged", [False, True])
@pytest.mark.parametrize("added", [[], [effect("clock_offset", "*", delay=10.0)], _LATE], ids=["none", "clock", "late"])
@pytest.mark.parametrize("seen", ["abcde", "bcd", "ace", "e", ""])
def test_gradient_and_hessian_are_of_the_nodes_with_readings(
    seen: str, added: list[EffectDeclaration], averaged: bool
) -> None:
    """All, next to each other, apart, one, or none in the second run, against derivatives by differences."""
    nodes = tuple(NodeDeclaration(name, capacity(200.0)) for name in _FIVE)
    links = tuple(LinkDeclaration((name, "ambient"), resistance(5.0)) for name in _FIVE)
    model = Model(Network("five", (*nodes, AMBIENT), links, (effect("copper_loss"), *added)))
    runs = [replace(random_run(model, 40, seed=seed, step=2.0), averaged=averaged) for seed in (1, 2)]
    first, second = bound_runs(model, runs)
    hidden = np.array([name not in seen for name in model.nodes])
    problem = Problem(model, [first, replace(second, counted=second.counted & ~hidden[:, None])], np.full(5, 0.3))
    z = problem.guess(model.values)
    residuals, jacobian = problem.residuals(z), problem.jacobian(z)[1]
    gradient, hessian = problem.normal(z)
    np.testing.assert_allclose(problem.jacobian(z)[0], residuals, atol=1e-9)
    for column, e in enumerate(1e-4 * np.eye(problem.size)):
        slope = (problem.residuals(z + e) - problem.residuals(z - e)) / 2e-4
        np.testing.assert_allclose(jacobian[:, column], slope, rtol=1e-4, atol=1e-5 * np.abs(slope).max() + 1e-7)
    np.testing.assert_allclose(gradient, jacobian.T @ residuals, rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(hessian, jacobian.T @ jacobian, rtol=1e-9, atol=1e-6)
    assert problem.measured.all()


def test_a_parameters_prior_pulls_by_standard_deviations() -> None:
    declared = [capacity(300.0), replace(capacity(300.0), prior=(200.0, 20.0))]
    model = Model(replace(network(), nodes=(*map(NodeDeclaration, "ab", declared), AMBIENT)))
    problem = Problem(model, bound_runs(model, [truth_run(200.0, step=5.0)]), np.ones(2))
    z = problem.guess(model.values)
    residuals, jacobian = problem.jacobian(z)
    assert residuals[-1] == pytest.approx((300 - 200) / 20)
    where = [model.parameters[index].name for index in problem.free].index("capacity.b")
    assert jacobian[-1, where] == pytest.approx(300 / 20)  # a capacity is searched by its logarithm
    assert np.count_nonzero(jacobian[-1]) == 1


def test_point_and_guess_are_inverses() -> None:
    model = Model(with_every_effect())
    problem = Problem(model, bound_runs(model, [random_run(model, 30)]), np.ones(2))
    start = np.arange(20.0, 20.0 + len(model.states))
    point = problem.point(problem.guess(model.values, [start]))
    np.testing.assert_allclose(point.values, model.values, rtol=1e-14)
    np.testing.assert_allclose(point.starts[0], start, rtol=1e-14)


@pytest.mark.parametrize(
    ("reading", "spread"),
    [(20.0, 0.5), (23.0, 3.5), (45.0, 5.0), (np.nan, 5.0)],
    ids=["cold", "warmer", "hot", "unread"],
)
def test_a_hidden_mass_starts_no_farther_from_its_node_than_that_from_the_air(reading: float, spread: float) -> None:
    """To one standard deviation, and half a kelvin for what sensors are off; nor than 5 K."""
    model = Model(_with([effect("second_mass", "a")]))
    run = truth_run(200.0, step=5.0)
    columns = {"temperature.a": np.full(len(run), reading), "temperature.ambient": np.full(len(run), 20.0)}
    problem = Problem(model, bound_runs(model, [replace(run, columns={**run.columns, **columns})]), np.ones(2))
    z = problem.guess(model.values)
    moved = z.copy()
    moved[-1] += 1.0
    prior = len(model.states)  # the last residuals: of the starts
    assert (problem.residuals(moved) - problem.residuals(z))[-prior:][-1] == pytest.approx(1 / spread)


def test_a_point_that_cannot_be_simulated_costs_infinitely_much() -> None:
    model = Model(network())
    problem = Problem(model, bound_runs(model, [truth_run(100.0)]), np.ones(2))
    z = problem.guess(model.values)
    z[:4] = np.log(1e-3)
    assert problem.cost(z) == float("inf")


def test_no_symmetry_penalty_leaves_left_and_right_free() -> None:
    model = Model(_sides())
    run = make_run(_simulated(model, _sides_run(model)), step=COARSE)
    values = {u.name: u.value for u in fit(model, bound_runs(model, [run])).model.parameters}
    assert values["capacity.left_knee"] == pytest.approx(200.0, rel=0.05)
    assert values["capacity.right_knee"] == pytest.approx(300.0, rel=0.05)


def test_a_large_symmetry_penalty_makes_left_and_right_equal() -> None:
    model = Model(_sides())
    run = make_run(_simulated(model, _sides_run(model)), step=COARSE)
    values = {u.name: u.value for u in fit(model, bound_runs(model, [run]), symmetry_penalty=1e9).model.parameters}
    assert values["capacity.left_knee"] == pytest.approx(values["capacity.right_knee"], rel=1e-3)
    assert 200.0 < values["capacity.left_knee"] < 300.0
    assert values["resistance.ambient~left_knee"] == pytest.approx(values["resistance.ambient~right_knee"], rel=1e-3)


def test_a_larger_symmetry_penalty_brings_them_closer() -> None:
    model = Model(_sides())
    run = make_run(_simulated(model, _sides_run(model)), step=COARSE)

    def gap(weight: float) -> float:
        values = {
            u.name: u.value for u in fit(model, bound_runs(model, [run]), symmetry_penalty=weight).model.parameters
        }
        return abs(float(np.log(values["capacity.left_knee"] / values["capacity.right_knee"])))

    assert gap(0.0) > gap(1e4) > gap(1e7)


def test_places_that_are_not_shared_by_sides_are_never_pulled_together() -> None:
    model = Model(_sides("each"))
    run = make_run(_simulated(model, _sides_run(model)), step=COARSE)
    values = {u.name: u.value for u in fit(model, bound_runs(model, [run]), symmetry_penalty=1e9).model.parameters}
    assert values["capacity.right_knee"] / values["capacity.left_knee"] == pytest.approx(1.5, rel=0.05)


def test_a_scale_that_nothing_fixes_is_said() -> None:
    """Every capacity and heat times s, every resistance over s: the same temperatures."""
    declared = network()
    copper = declared.effects[0]
    free = replace(copper, parameters=tuple(replace(p, fixed=p.name != "resistance") for p in copper.parameters))
    model = Model(replace(declared, effects=(free,)))
    result = fit(model, bound_runs(model, [truth_run(900.0, step=COARSE)]))
    (warning,) = [text for text in result.uncertainty.warnings if "fix one of them" in text]
    assert "if all are multiplied by one factor" in warning
    for name in [*TRUTH, "copper_loss.resistance.a"]:
        assert name in warning
        assert result.standard_errors[name] == float("inf")


def test_a_parameter_that_the_data_cannot_see_is_named() -> None:
    model = Model(_with([effect("forced_convection", "b")]))
    run = truth_run(900.0, step=COARSE)
    run = replace(run, columns={**run.columns, "speed.base": np.zeros(len(run))})
    result = fit(model, bound_runs(model, [run]))
    assert any("forced_convection.gamma.b" in text for text in result.uncertainty.warnings)
    assert result.standard_errors["forced_convection.gamma.b"] == float("inf")
    assert np.isfinite(result.standard_errors["capacity.a"])


def test_a_parameter_that_the_data_hardly_see_is_named() -> None:
    """A run of a minute says nothing of the way out of a node that a resistance of 4 K/W cools."""
    model = Model(network())
    result = fit(model, bound_runs(model, [truth_run(60.0)]))
    assert any(text.startswith("resistance.ambient~b:") for text in result.uncertainty.warnings)


def test_bounds_are_kept_and_the_end_at_one_is_said() -> None:
    declared = network()
    narrow = NodeDeclaration("a", capacity(150.0, bounds=(140.0, 160.0)))
    model = Model(replace(declared, nodes=(narrow, *declared.nodes[1:])))
    result = fit(model, bound_runs(model, [truth_run(900.0, step=COARSE)]))
    values = {u.name: u.value for u in result.model.parameters}
    assert 140.0 - 1e-9 <= values["capacity.a"] < 140.1
    said = "capacity.a: ends at its bound, 140 (140 to 160 J/K)"
    assert any(text.startswith(said) for text in result.uncertainty.warnings)


def test_a_guess_outside_the_bounds_is_brought_inside() -> None:
    declared = network()
    narrow = NodeDeclaration("a", capacity(110.0, bounds=(100.0, 200.0)))
    model = Model(replace(declared, nodes=(narrow, *declared.nodes[1:])))
    guess = model.values
    guess[0] = 900.0
    result = fit(model, bound_runs(model, [truth_run(900.0, step=COARSE)]), guess=guess)
    assert result.model.values[0] == pytest.approx(TRUTH["capacity.a"], rel=0.05)


def _interrupting(at: int) -> Callable[[int, float], None]:
    def progress(iteration: int, _rms: float) -> None:
        if iteration == at:
            os.kill(os.getpid(), signal.SIGINT)

    return progress


@pytest.mark.parametrize("guessed", [True, False])
def test_ctrl_c_keeps_the_best_point_so_far(guessed: bool) -> None:
    model = Model(network())
    bound = bound_runs(model, [truth_run(900.0, step=COARSE)])
    before = signal.getsignal(signal.SIGINT)
    result = fit(model, bound, guess=model.values if guessed else None, progress=_interrupting(1))
    assert result.status == "interrupted"
    assert signal.getsignal(signal.SIGINT) is before
    assert result.cost <= result.problem.cost(result.problem.guess(model.values))
    assert result.cost == pytest.approx(result.problem.cost(result.z), rel=1e-9)
    assert result.iterations < 5


def test_progress_hears_every_iteration_and_the_error_falls() -> None:
    model = Model(network())
    heard: list[tuple[int, float]] = []
    result = fit(
        model,
        bound_runs(model, [truth_run(900.0, step=COARSE)]),
        guess=model.values,
        progress=lambda iteration, rms: heard.append((iteration, rms)),
    )
    assert [iteration for iteration, _ in heard] == list(range(result.iterations + 1))
    errors = [rms for _, rms in heard]
    assert errors == sorted(errors, reverse=True)


def test_a_mistake_in_the_progress_callback_is_not_swallowed() -> None:
    model = Model(network())

    def fail(_iteration: int, _rms: float) -> None:
        raise RuntimeError("broken bar")

    with pytest.raises(RuntimeError, match="broken bar"):
        fit(model, bound_runs(model, [truth_run(200.0, step=COARSE)]), guess=model.values, progress=fail)


def test_few_iterations_end_as_not_converged() -> None:
    model = Model(network())
    result = fit(model, bound_runs(model, [truth_run(900.0, step=COARSE)]), guess=model.values, iterations=1)
    assert result.status == "not converged"
    assert result.cost <= result.problem.cost(result.problem.guess(model.values))
