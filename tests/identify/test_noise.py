"""Noise found from the readings themselves, and the weights that follow from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from lptn.identify.noise import Noise, balanced_sigma, estimate_noise
from lptn.logs.reading import read_log
from lptn.logs.run import Run
from lptn.model.model import Model
from tests.builders import bound_runs, make_run, two_nodes

N = 4000


def _run(a: np.ndarray, b: np.ndarray, resolution: dict[str, float] | None = None) -> Run:
    run = make_run({"temperature.a": a, "temperature.b": b, "temperature.ambient": np.full(len(a), 20.0)})
    return replace(run, resolution=resolution or {})


def _noise(*runs: Run) -> Noise:
    model = Model(two_nodes())
    return estimate_noise(bound_runs(model, list(runs)), model.nodes)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_white_noise_is_found_within_ten_percent_under_a_slow_swing(seed: int) -> None:
    rng, time = np.random.default_rng(seed), np.arange(float(N))
    slow = 40.0 + 20.0 * np.sin(time / 300.0)
    noise = _noise(_run(slow + 0.1 * rng.standard_normal(N), slow + 0.5 * rng.standard_normal(N)))
    assert noise.white == pytest.approx([0.1, 0.5], rel=0.1)
    assert noise.floor == pytest.approx(noise.white, rel=1e-9)


def test_rare_jumps_and_gaps_do_not_raise_it() -> None:
    rng = np.random.default_rng(4)
    readings = 30.0 + 0.2 * rng.standard_normal(N)
    readings[::100] += 15.0
    readings[500:900] = np.nan
    assert _noise(_run(readings, readings)).white == pytest.approx([0.2, 0.2], rel=0.1)


def test_a_sensor_slower_than_the_grid_shows_its_noise_too() -> None:
    rng, time = np.random.default_rng(5), np.arange(float(N))
    readings = 40.0 + 20.0 * np.sin(time / 300.0) + 0.2 * rng.standard_normal(N)
    readings[time % 3 == 2] = np.nan
    assert _noise(_run(readings, readings)).white == pytest.approx([0.2, 0.2], rel=0.2)


@pytest.mark.parametrize("step", [None, 5.0])
def test_readings_at_irregular_times_show_the_noise_of_the_log_itself(step: float | None) -> None:
    rng = np.random.default_rng(6)
    time = np.cumsum(rng.uniform(1.0, 4.0, N))
    noisy = 40.0 + 20.0 * np.sin(time / 900.0) + 0.2 * rng.standard_normal(N)
    log = pd.DataFrame({"time": time, "temperature.a": noisy, "temperature.b": noisy, "temperature.ambient": 20.0})
    (run,) = read_log(log, step=step, inputs=["temperature.ambient"], outputs=["temperature.a", "temperature.b"])
    noise = _noise(run)
    # Of means over 5 s, of two readings each, less is left.
    assert noise.white == pytest.approx([0.2 if step is None else 0.2 / np.sqrt(2)] * 2, rel=0.1)


def test_a_loud_log_and_many_short_ones_do_not_raise_it() -> None:
    rng = np.random.default_rng(7)

    def logged(sigma: float, n: int, name: str, time: np.ndarray | None = None) -> Run:
        stamps = np.arange(float(n)) if time is None else time
        readings = 40.0 + sigma * rng.standard_normal(n)
        table = {"time": stamps, "temperature.a": readings, "temperature.b": readings, "temperature.ambient": 20.0}
        outputs = ["temperature.a", "temperature.b"]
        (run,) = read_log(pd.DataFrame(table), name=name, inputs=["temperature.ambient"], outputs=outputs)
        return run

    assert _noise(logged(0.05, N, "long"), logged(0.5, 300, "loud")).white == pytest.approx([0.05] * 2, rel=0.1)
    assert _noise(*(logged(0.1, 60, f"{k}") for k in range(20))).white == pytest.approx([0.1] * 2, rel=0.1)
    bursts = 5.0 * (np.arange(N) // 2) + np.arange(N) % 2
    assert _noise(logged(0.2, N, "bursts", bursts)).white == pytest.approx([0.2] * 2, rel=0.1)


def test_a_sensor_in_steps_of_one_kelvin_has_a_floor_of_one_over_root_twelve() -> None:
    slow = np.round(40.0 + 20.0 * np.sin(np.arange(float(N)) / 300.0))
    noise = _noise(_run(slow, slow, {"temperature.a": 1.0, "temperature.b": 1.0}))
    assert noise.floor == pytest.approx([1 / np.sqrt(12)] * 2, rel=1e-3)
    error = slow - (40.0 + 20.0 * np.sin(np.arange(float(N)) / 300.0))
    assert np.sqrt(np.mean(error**2)) == pytest.approx(noise.floor[0], rel=0.05)


@pytest.mark.parametrize("share", [0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 0.9, 1.2])
@pytest.mark.parametrize("step", [0.1, 1.0])
def test_noise_like_a_coarse_sensors_steps_is_told_though_the_median_of_them_is_one_of_a_few(
    step: float, share: float
) -> None:
    rng, time = np.random.default_rng(8), np.arange(float(N))
    slow = 40.0 + 20.0 * np.sin(time / 1500.0)
    readings = np.round((slow + share * step * rng.standard_normal(N)) / step) * step
    noise = _noise(_run(readings, readings, {"temperature.a": step, "temperature.b": step}))
    if share >= 0.4:
        assert noise.white == pytest.approx([share * step] * 2, rel=0.15)
    assert noise.floor == pytest.approx([np.std(readings - slow)] * 2, rel=0.08 if share >= 0.4 else 0.2)


def test_a_coarse_sensor_of_another_run_hides_no_noise() -> None:
    rng = np.random.default_rng(9)
    fine, coarse = 40.0 + 0.05 * rng.standard_normal(N), np.round(40.0 + 20.0 * np.sin(np.arange(500.0) / 300.0))
    noise = _noise(_run(fine, fine), _run(coarse, coarse, {"temperature.a": 1.0, "temperature.b": 1.0}))
    assert noise.white == pytest.approx([0.05] * 2, rel=0.1)


def test_readings_without_noise_do_not_weigh_infinitely() -> None:
    noise = _noise(_run(np.full(N, 30.0), np.full(N, np.nan)))
    assert (noise.floor == 1e-3).all()


def test_the_coarsest_run_says_the_step() -> None:
    still = np.full(50, 30.0)
    noise = _noise(_run(still, still, {"temperature.a": 0.5}), _run(still, still, {"temperature.a": 1.0}))
    assert noise.step == pytest.approx([1.0, 0.0])


def test_a_node_with_a_small_swing_weighs_more_but_not_without_limit() -> None:
    rng, time = np.random.default_rng(5), np.arange(float(N))
    swing = np.sin(time / 300.0)
    run = _run(40.0 * swing + 0.01 * rng.standard_normal(N), 5.0 * swing + 0.01 * rng.standard_normal(N))
    model = Model(two_nodes())
    bound = bound_runs(model, [run])
    large, small = balanced_sigma(bound, estimate_noise(bound, model.nodes))
    assert 0.01 < small < large
    assert large / small == pytest.approx(np.sqrt(8.0), rel=0.05)


@pytest.mark.parametrize(("rate", "mean"), [(10.0, 1.0), (10.0, 5.0), (1.0, 10.0), (2.0, 30.0)])
@pytest.mark.parametrize("step", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("sigma", [0.02, 0.1, 0.3, 1.0])
def test_means_of_a_coarse_sensor_scatter_as_its_noise_and_its_steps_let_them(
    rate: float, mean: float, step: float, sigma: float
) -> None:
    rng, time = np.random.default_rng(9), np.arange(0.0, 3600.0, 1 / rate)
    true = 40.0 + 20.0 * np.sin(2 * np.pi * time / 7200.0) + 2.0 * np.sin(time / 300.0)
    readings = np.round((true + sigma * rng.standard_normal(time.size)) / step) * step
    log = pd.DataFrame(
        {"time": time, "temperature.a": readings, "temperature.b": readings, "temperature.ambient": 20.0}
    )
    (run,) = read_log(log, step=mean, inputs=["temperature.ambient"], outputs=["temperature.a", "temperature.b"])
    # A mean of samples is that of the time up to the last of them.
    truth = np.interp(run.time + (mean - 1 / rate) / 2, time, true)
    scatter = float(np.sqrt(np.nanmean((run.columns["temperature.a"] - truth) ** 2)))
    floor = _noise(run).floor[0]
    assert floor > 0.75 * scatter
    if mean == 1.0:  # in longer ones the temperature passes through steps
        assert floor < 1.25 * scatter + 0.002
