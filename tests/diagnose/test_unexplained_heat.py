"""Hidden bursts of heat are found at their node and in their minutes; nothing hidden shows nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag

from lptn.basics.arrays import BoolArray
from lptn.diagnose.unexplained_heat import (
    Blocks,
    UnexplainedHeat,
    blocks,
    forward,
    largest,
    means_in_blocks,
    smoothed,
    unexplained_heat,
)
from lptn.identify.fitting import Fit
from lptn.report.shown import input_links
from tests.builders import LEG
from tests.diagnose.hidden_heat import bursts, fitted, nothing, truth_run

SEEDS = (11, 12)


@pytest.fixture(scope="module", params=SEEDS)
def burst_fit(request: pytest.FixtureRequest) -> Fit:
    """The bursts hidden from the model, fine sensors."""
    return fitted(truth_run(request.param, bursts))


def _between(estimate: UnexplainedHeat, start: float, stop: float) -> BoolArray:
    return np.asarray((estimate.time > start) & (estimate.time < stop))


def _quiet(estimate: UnexplainedHeat) -> BoolArray:
    """Blocks a minute and a half from any burst; their edges are blurred."""
    return _between(estimate, 0, 1110) | _between(estimate, 1590, 2310) | _between(estimate, 2610, 3600)


def test_bursts_at_their_node_in_their_minutes(burst_fit: Fit) -> None:
    (estimate,) = unexplained_heat(burst_fit)
    assert estimate.nodes == LEG
    assert estimate.heat.shape == estimate.band.shape == (3, 360)
    for start, stop in ((1200, 1500), (2400, 2520)):
        inside = estimate.heat[:, _between(estimate, start, stop)].mean(axis=1)
        assert 3.0 < inside[1] < 8.0
        assert np.abs(inside[[0, 2]]).max() < 1.2
        assert (estimate.clear[1, _between(estimate, start + 30, stop - 30)] > 0).any()
    peak = largest([estimate])
    assert peak is not None
    assert peak.node == "FR_thigh"
    near = [(1200.0, 1500.0), (2400.0, 2520.0)]
    assert any(abs(peak.start - a) <= 30 and abs(peak.stop - b) <= 30 for a, b in near)
    assert peak.text().startswith("at FR_thigh from ")


def test_zero_elsewhere_within_the_band(burst_fit: Fit) -> None:
    (estimate,) = unexplained_heat(burst_fit)
    quiet = _quiet(estimate)
    assert np.mean(np.abs(estimate.heat[:, quiet]) < estimate.band[:, quiet]) > 0.93
    assert not estimate.clear[:, quiet].any()


@pytest.mark.long
@pytest.mark.parametrize("steps", [0.0, 1.0])
def test_coarse_sensors_and_gaps_still_show_the_node(steps: float) -> None:
    run = truth_run(11, bursts, steps=steps)
    columns = {name: values.copy() for name, values in run.columns.items()}
    columns["temperature.FR_thigh"][600:900] = np.nan
    columns["temperature.FR_hip"][np.random.default_rng(0).uniform(size=3600) < 0.2] = np.nan
    (estimate,) = unexplained_heat(fitted(replace(run, columns=columns)))
    peak = largest([estimate])
    assert peak is not None
    assert peak.node == "FR_thigh"
    assert peak.start < 1500
    assert peak.stop > 1200
    assert np.isfinite(estimate.heat).all()


@pytest.mark.long
@pytest.mark.parametrize("steps", [0.0, 1.0])
def test_nothing_hidden_covers_zero(steps: float) -> None:
    estimates = [unexplained_heat(fitted(truth_run(seed, nothing, steps=steps)))[0] for seed in SEEDS]
    assert np.mean([np.abs(estimate.heat) < estimate.band for estimate in estimates]) > 0.93
    assert largest(estimates) is None


def test_heat_of_one_of_several_runs_is_placed_in_that_run() -> None:
    done = fitted(truth_run(21, nothing, length=1800.0), truth_run(22, bursts, length=1800.0))
    estimates = unexplained_heat(done)
    assert [estimate.run for estimate in estimates] == ["run21", "run22"]
    peak = largest(estimates)
    assert peak is not None
    assert (peak.run, peak.node) == ("run22", "FR_thigh")


def test_smoothing_is_the_least_squares_answer(burst_fit: Fit) -> None:
    """Against one large linear solve for all states, heats and parameters at once."""
    run = _first(blocks(burst_fit, 0), 25)
    size, states, nodes = run.top.shape[2], 3, 3
    start = np.diag(np.r_[np.full(states, 1.5), np.full(nodes, 4.0), np.full(size - states - nodes, 0.5)] ** 2)
    start[-1, -2] = start[-2, -1] = 0.2  # parameters that are off together
    walk = 0.4
    heat, spread, _, _, density = smoothed(run, start, walk)
    # Unknowns: the start, then each block's walk of heat; everything else follows.
    moved, at, rows = np.eye(size), [], []
    wanders = [np.zeros((size, nodes * 24))]
    for k in range(25):
        rows.append(np.hstack([run.by[k] @ moved, run.by[k] @ wanders[k]]))
        at.append(np.hstack([moved, wanders[k]])[states : states + nodes])
        transition = np.eye(size)
        transition[:states] = run.top[k]
        moved, wander = transition @ moved, transition @ wanders[k]
        if k < 24:
            wander[states : states + nodes, nodes * k : nodes * (k + 1)] += np.eye(nodes)
        wanders.append(wander)
    weighted = np.vstack(rows) / np.sqrt(run.variance.ravel())[:, None]
    measured = np.isfinite(run.error.ravel())
    unknown = block_diag(start, walk**2 * run.seconds * np.eye(nodes * 24))
    information = weighted[measured].T @ weighted[measured] + np.linalg.inv(unknown)
    target = (-run.error.ravel() / np.sqrt(run.variance.ravel()))[measured]
    covariance = np.linalg.inv(information)
    solution = covariance @ (weighted[measured].T @ target)
    expected = np.array([state @ solution for state in at]).T
    deviations = np.array([np.sqrt(np.diag(state @ covariance @ state.T)) for state in at]).T
    np.testing.assert_allclose(heat, expected, atol=1e-6)
    np.testing.assert_allclose(spread, deviations, rtol=1e-5)
    loads = weighted[measured] * np.sqrt(run.variance.ravel()[measured])[:, None]
    spreads = loads @ unknown @ loads.T + np.diag(run.variance.ravel()[measured])
    error = run.error.ravel()[measured]
    expected_density = -0.5 * (error @ np.linalg.solve(spreads, error) + np.linalg.slogdet(spreads)[1])  # but for 2π
    assert forward(run, start, walk)[0] == density == pytest.approx(expected_density, rel=1e-6)


def test_a_gap_widens_the_band_where_it_is(burst_fit: Fit) -> None:
    run = blocks(burst_fit, 0)
    start = np.diag(np.r_[np.full(3, 1.5), np.full(3, 4.0), np.zeros(run.top.shape[2] - 6)] ** 2)
    gap = run.error.copy()
    gap[100:130, 1] = np.nan
    without, within = (smoothed(part, start, 0.4).spread for part in (run, replace(run, error=gap)))
    assert (within[1, 105:125] > 1.5 * without[1, 105:125]).all()
    np.testing.assert_allclose(within[:, 200:], without[:, 200:], rtol=0.02)


def _first(run: Blocks, count: int) -> Blocks:
    error = run.error[:count].copy()
    error[7:10, 1] = np.nan
    error[12] = np.nan
    arrays = {name: getattr(run, name)[:count] for name in ("time", "top", "by", "variance")}
    return replace(run, error=error, **arrays)


def test_blocks_carry_heat_as_the_model_does(burst_fit: Fit) -> None:
    """Constant extra heat moves the linear blocks as it moves a free simulation of the truth's equations."""
    run = blocks(burst_fit, 0)
    d = np.zeros(run.top.shape[2])
    d[4] = 2.0  # W at the thigh
    for k in range(len(run.time)):
        d[:3] = run.top[k] @ d
    values = {
        parameter.name: value
        for parameter, value in zip(burst_fit.model.parameters, burst_fit.point.values, strict=True)
    }
    g = {name.removeprefix("resistance."): 1.0 / value for name, value in values.items() if name.startswith("resis")}
    flow = np.diag([g[f"{name}~ambient"] for name in LEG])
    for a, b, key in ((0, 1, "FR_hip~FR_thigh"), (1, 2, "FR_calf~FR_thigh")):
        flow[[a, b], [a, b]] += g[key]
        flow[[a, b], [b, a]] -= g[key]
    settled = np.linalg.solve(flow, np.array([0.0, 2.0, 0.0]))
    c = np.array([values[f"capacity.{name}"] for name in LEG])
    slowest = 1.0 / np.linalg.eigvals(flow / c[:, None]).real.min()
    left = np.exp(-3600.0 / slowest)
    assert np.abs(d[:3] - settled).max() < 2.0 * left * np.abs(settled).max() + 1e-6


@pytest.mark.long
def test_a_node_without_a_sensor_gets_no_heat_of_its_own() -> None:
    # Of one run alone the joint without a sensor takes up the heat, at 1e6 J/K.
    runs = truth_run(12, bursts, length=2400.0), truth_run(13, nothing, length=2400.0)
    sensed = [{name: column for name, column in run.columns.items() if name != "temperature.FR_hip"} for run in runs]
    both = (replace(run, columns=columns) for run, columns in zip(runs, sensed, strict=True))
    estimate, other = unexplained_heat(fitted(*both))
    assert largest([other]) is None
    assert estimate.nodes == ("FR_thigh", "FR_calf")
    peak = largest([estimate])
    assert peak is not None
    assert peak.node == "FR_thigh"
    assert abs(peak.start - 1200) <= 60


def test_the_input_that_heat_follows_comes_first() -> None:
    run = truth_run(31, nothing, length=1800.0)
    done = fitted(run)
    (estimate,) = unexplained_heat(done)
    torque = means_in_blocks(run.columns["torque.FR_hip"] ** 2, run, estimate.time, estimate.seconds)
    made = replace(estimate, heat=np.vstack([np.zeros_like(torque), 0.3 * torque, np.zeros_like(torque)]))
    first = input_links(done, [made], "FR_thigh")[0]
    assert first.what == "torque.FR_hip²"
    assert first.correlation == pytest.approx(1.0)
    assert all(link.column != "temperature.ambient" for link in input_links(done, [estimate], "FR_thigh"))
    assert input_links(done, [made], "FR_hip") == []


def test_a_long_run_gets_longer_blocks() -> None:
    done = fitted(truth_run(41, nothing, length=600.0))
    bound = done.problem.bound_runs[0]
    assert blocks(done, 0).seconds == 10.0
    many = np.tile(bound.inputs, (1, 40))
    run = replace(bound.run, time=np.arange(24_000.0), columns={})
    measured, counted = np.tile(bound.measured, (1, 40)), np.tile(bound.counted, (1, 40))
    long = replace(bound, run=run, inputs=many, measured=measured, counted=counted)
    problem = type(done.problem)(done.model, [long], done.problem.sigma)
    grid = blocks(replace(done, problem=problem), 0)
    assert grid.seconds == 20.0
    assert len(grid.time) == 1200
