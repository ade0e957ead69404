"""A model driven by a run, against scipy."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, pairwise
from math import ceil, log2

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import Network, NodeDeclaration
from lptn.simulate.bound_run import bind, default_start, needed_columns
from lptn.simulate.simulation import SimulationError, simulate, substeps
from tests.builders import AMBIENT, bound_runs, effect, leg, link, make_run, node, random_run, two_nodes

SIGMA = 5.670374419e-8


def _single(heat_capacity: float, ohms: float, power: float = 0.0) -> Model:
    effects = (effect("constant_heat", "a", power=power),)
    return Model(Network("one", (node("a", heat_capacity), AMBIENT), (link("a", "ambient", ohms),), effects))


def _still(n: int, *, step: float = 1.0, averaged: bool = False) -> Run:
    columns = {"temperature.a": np.full(n, 50.0), "temperature.ambient": np.full(n, 20.0)}
    return make_run(columns, step=step, averaged=averaged)


def test_simulation_equals_solve_ivp() -> None:
    """Two coupled nodes with copper loss, friction, convection and radiation; inputs held over each step."""
    effects = [
        effect("copper_loss", "a", resistance=0.5, torque_constant=1.0),
        effect("coulomb_friction", "b", torque=2.0),
        effect("conduction", "a~b", conductance=0.7),
        effect("natural_convection", "a", beta=0.006),
        effect("radiation", "b", area=0.02),
    ]
    model = Model(two_nodes(effects))
    run = random_run(model, 200, seed=3)
    torque, speed = run.columns["torque.a"], run.columns["velocity.b"]

    def rates(x: FloatArray, k: int) -> list[float]:
        a, b = x
        between = 0.7 * (b - a)
        into_a = 0.5 * torque[k] ** 2 + between - (a - 22.0) / 4.0 * np.exp(0.006 * (a - 22.0))
        into_b = 2.0 * abs(speed[k]) - between - (b - 22.0) / 7.0
        into_b += SIGMA * 0.02 * ((22.0 + 273.15) ** 4 - (b + 273.15) ** 4)
        return [into_a / 120.0, into_b / 250.0]

    start = np.array([25.0, 28.0])
    x, truth = start, [start]
    for k in range(200):
        x = solve_ivp(lambda _, y, k=k: rates(y, k), (0.0, 1.0), x, rtol=1e-10, atol=1e-10).y[:, -1]  # type: ignore[misc]
        truth.append(x)
    path = simulate(model, bind(model, run))
    expected = np.array(truth).T
    assert np.ptp(expected) > 5.0
    np.testing.assert_allclose(path.states, expected, rtol=0, atol=1e-5)
    np.testing.assert_allclose(path.readings, expected[:, :-1], rtol=0, atol=1e-5)


def test_a_stiff_node_is_simulated_in_smaller_steps() -> None:
    model = _single(1.0, 0.1, power=100.0)  # time constant 0.1 s
    bound = bind(model, _still(5))
    parts = substeps(model, bound, model.values, np.array([50.0]))
    assert parts in (4, 8, 16, 32)  # RK4 is stable from 10 / 2.78 on
    time = np.arange(6.0)
    expected = 20.0 + 10.0 + 20.0 * np.exp(-time / 0.1)
    np.testing.assert_allclose(simulate(model, bound).states[0], expected, atol=1e-2)


@pytest.mark.parametrize("rate", [0.5, 0.99, 1.99, 3.9])
def test_the_fastest_transient_is_within_one_percent_of_its_jump(rate: float) -> None:
    """The internal step must be small enough for accuracy, not for stability alone."""
    model = _single(10.0 / rate, 0.1)  # `rate` is the step of 1 s over the time constant
    states = simulate(model, bind(model, _still(5))).states[0]
    np.testing.assert_allclose(states, 20.0 + 30.0 * np.exp(-rate * np.arange(6.0)), atol=0.3)


def test_a_slow_model_is_not_cut_finer() -> None:
    model = _single(300.0, 5.0)
    assert substeps(model, bind(model, _still(5)), model.values, np.array([50.0])) == 1


def test_a_hopelessly_stiff_model_is_refused() -> None:
    model = _single(1e-3, 1e-3)
    with pytest.raises(SimulationError, match="a: found a time constant of 1e-06 s"):
        simulate(model, bind(model, _still(5)))


def test_parameters_that_are_no_numbers_are_refused() -> None:
    model = _single(300.0, 5.0)
    with pytest.raises(SimulationError):
        simulate(model, bind(model, _still(5)), np.full(len(model.values), np.nan))


def test_temperatures_that_run_away_are_refused() -> None:
    """Copper loss that grows by 0.8 1/s, without a limit: after 1000 s no number holds it."""
    effects = (effect("copper_loss", "a", resistance=1.0, torque_constant=1.0), effect("resistance_rise", "a"))
    network = Network("one", (node("a", 1.0), AMBIENT), (link("a", "ambient", 1e3),), effects)
    model = Model(network)
    run = _still(1000)
    run = replace(run, columns={**run.columns, "torque.a": np.full(1000, np.sqrt(0.8 / 0.0039))})
    with pytest.raises(SimulationError, match="run away"):
        simulate(model, bind(model, run))


def test_averaged_readings_are_means_over_the_steps() -> None:
    model = _single(10.0, 1.0)  # time constant 10 s
    sampled = simulate(model, bind(model, _still(30)))
    averaged = simulate(model, bind(model, _still(30, averaged=True)))
    np.testing.assert_array_equal(sampled.states, averaged.states)
    np.testing.assert_array_equal(sampled.readings, sampled.states[:, :-1])
    time = np.arange(30.0)
    mean = 20.0 + 30.0 * np.exp(-time / 10.0) * (1 - np.exp(-0.1)) / 0.1
    np.testing.assert_allclose(averaged.readings[0], mean, atol=1e-4)


@pytest.mark.parametrize("rate", [0.29, 0.31, 0.99, 1.01, 3.0, 8.0])
def test_means_over_rows_as_long_as_a_time_constant_are_exact(rate: float) -> None:
    """The row of 1 s over the time constant; a mean of the row's two ends would be off by 2.3 K at 1, 11 K at 8."""
    model = _single(10.0 / rate, 0.1)
    rows = simulate(model, bind(model, _still(6, averaged=True)))
    mean = 20.0 + 30.0 * np.exp(-rate * np.arange(6.0)) * (1 - np.exp(-rate)) / rate
    np.testing.assert_allclose(rows.readings[0], mean, atol=0.2)
    assert abs(rows.readings[0, 0] - mean[0]) < 0.1  # before any error of a step
    np.testing.assert_array_equal(rows.held, rows.readings)
    assert rows.states.shape == (1, 7)


def test_start_is_the_mean_of_the_first_readings_and_hidden_states_sit_at_their_node() -> None:
    model = Model(leg([effect("second_mass", "FR_calf")]))
    readings = np.array([np.nan, 30.0, 31.0, 32.0, 33.0, 34.0, 90.0])
    columns = {"temperature.FR_calf": readings, "temperature.ambient": np.full(7, 20.0)}
    bound = bind(model, make_run(columns))
    np.testing.assert_array_equal(bound.start, [np.nan, np.nan, 32.0])
    np.testing.assert_array_equal(default_start(model, bound), [32.0, 32.0, 32.0, 32.0])


def test_a_given_start_is_where_the_states_begin() -> None:
    model = Model(leg())
    run = random_run(model, 10)
    path = simulate(model, bind(model, run), start=np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(path.states[:, 0], [1.0, 2.0, 3.0])
    assert path.states.shape == (3, 11)
    assert path.readings.shape == (3, 10)


def test_a_missing_input_is_named() -> None:
    model = Model(leg([effect("coulomb_friction", "FR_calf")]))
    run = make_run({"temperature.FR_calf": np.full(9, 20.0), "temperature.ambient": np.full(9, 20.0)})
    with pytest.raises(InputError, match=r"run\.csv: column velocity\.FR_calf"):
        bind(model, run)


def test_a_run_without_a_reading_of_any_node_is_refused() -> None:
    model = Model(leg())
    run = make_run({"temperature.FR_calf": np.full(9, np.nan), "temperature.ambient": np.full(9, 20.0)})
    with pytest.raises(InputError, match="no reading of any node"):
        bind(model, run)


def test_an_ambient_from_the_start_needs_no_column() -> None:
    network = Network("n", (node("a"), NodeDeclaration("air", temperature="start")), (link("a", "air"),))
    model = Model(network)
    bound = bind(model, make_run({"temperature.a": np.linspace(21.0, 25.0, 5)}))
    np.testing.assert_array_equal(bound.inputs, np.full((1, 5), 23.0))
    assert needed_columns(model) == ([], ["temperature.a"])


def test_needed_columns_are_inputs_and_node_temperatures() -> None:
    model = Model(leg([effect("coulomb_friction", "FR_calf")]))
    inputs, outputs = needed_columns(model)
    assert set(inputs) == {"temperature.ambient", "velocity.FR_calf"}
    assert outputs == [f"temperature.{name}" for name in model.nodes]


def test_a_window_counts_only_readings_inside_it() -> None:
    model = Model(leg())
    run = random_run(model, 10)
    run.columns["temperature.FR_hip"][4] = np.nan
    (bound,) = bound_runs(model, [run])
    counted = bound.count((3.0, 6.0)).counted
    np.testing.assert_array_equal(counted.sum(axis=0), [0, 0, 0, 3, 2, 3, 0, 0, 0, 0])


def test_until_keeps_the_beginning() -> None:
    model = Model(leg())
    bound = bind(model, random_run(model, 10))
    short = bound.until(4.0)
    assert len(short) == len(short.run) == short.measured.shape[1] == short.counted.shape[1] == 4
    assert bound.until(99.0) is bound
    np.testing.assert_array_equal(simulate(model, short).states, simulate(model, bound).states[:, :5])


def test_until_cuts_run_and_readings_alike_despite_rounding() -> None:
    model = Model(leg())
    run = random_run(model, 10, step=0.1)
    short = bind(model, run).until(float(run.time[3]) + 1e-12)
    assert len(short) == len(short.run)


@pytest.mark.parametrize("loops", [False, True])
def test_the_steps_of_a_row_are_those_of_the_largest_eigenvalue_of_all(loops: bool) -> None:
    """Of networks with odd loops, too, where the bound of the largest entries is up to twice as large."""
    rng, names, asked = np.random.default_rng(7), "abcde", set()
    for _ in range(8):
        pairs = combinations(names, 2) if loops else pairwise(names)
        links = [link(*pair, 10 ** rng.uniform(-1, 1)) for pair in pairs]
        links += [link(name, "ambient", 10 ** rng.uniform(-1, 1)) for name in names]
        blown = effect("forced_convection", "*", gamma=2.0)  # so that each row has another Jacobian
        model = Model(Network("loops", (*(node(name, 100.0) for name in names), AMBIENT), tuple(links), (blown,)))
        columns = {f"temperature.{name}": np.full(9, 20.0) for name in (*names, "ambient")}
        for step in (1.0, 10.0, 40.0):
            run = make_run(columns | {"speed.base": rng.uniform(0.0, 3.0, 9)}, step=step)
            bound, start = bind(model, run), np.full(5, 20.0)
            slopes = [model.state_jacobian(start, row, model.values).full() for row in bound.inputs.T]
            largest = step * max(float(np.abs(np.linalg.eigvals(slope)).max()) for slope in slopes)
            if largest <= 32:
                asked.add(parts := 2 ** ceil(log2(max(largest, 1.0))))
                assert substeps(model, bound, model.values, start) == parts
    assert len(asked) >= 4
