"""Blocks and bins keep the integral of what they reduce."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lptn.basics.arrays import FloatArray
from lptn.logs.resampling import (
    Grid,
    Samples,
    feature,
    features_of,
    interpolate,
    raw_keys,
    reduce_blocks,
    sample_values,
)
from lptn.logs.tables import on_one_time

COLUMNS = ["torque.a", "current.a", "current_abs.a", "velocity.a", "velocity_rms.a", "speed.base", "power.pc"]
numbers = st.floats(-1e3, 1e3).map(lambda x: round(x, 6))


@given(st.sampled_from(COLUMNS), st.integers(1, 7), arrays(np.float64, 42, elements=numbers))
def test_a_block_keeps_the_integral(column: str, factor: int, values: FloatArray) -> None:
    rule = feature(column)
    reduced = reduce_blocks(column, values, factor)
    assert reduced.shape == (42 // factor,)
    whole = rule.before(values[: 42 // factor * factor])
    assert np.isclose(factor * rule.before(reduced).sum(), whole.sum(), rtol=1e-9, atol=1e-9)


@given(st.sampled_from(COLUMNS), arrays(np.float64, 30, elements=st.floats(0.01, 3.0)), st.data())
def test_a_bin_keeps_the_integral_of_the_held_signal(column: str, gaps: FloatArray, data: st.DataObject) -> None:
    values = data.draw(arrays(np.float64, 30, elements=numbers))
    time = 5.0 + np.concatenate(([0.0], np.cumsum(gaps[:-1])))
    end = time[-1] + gaps[-1]
    rule = feature(column)
    reduced = Samples(time, {column: values}).inputs([column], Grid(5.0, (end - 5.0) / 7, 7))[column]
    integral = (rule.before(values) * np.diff(time, append=end)).sum()
    assert np.isclose(rule.before(reduced).sum() * (end - 5.0) / 7, integral, rtol=1e-9, atol=1e-9)


def test_each_quantity_has_its_own_mean() -> None:
    values = np.array([3.0, -4.0, 0.0, -2.0])
    assert reduce_blocks("torque.a", values, 2).tolist() == [np.sqrt(12.5), np.sqrt(2.0)]
    assert reduce_blocks("current_abs.a", values, 2).tolist() == [3.5, 1.0]
    assert reduce_blocks("power.a", values, 2).tolist() == [-0.5, -1.0]
    assert reduce_blocks("torque.a", values, 1).tolist() == [3.0, 4.0, 0.0, 2.0]


def test_a_small_bin_after_large_ones_is_exact() -> None:
    values = np.concatenate((np.full(1000, 1e6), np.full(1000, 1e-6)))
    samples = Samples(np.arange(2000.0), {"torque.a": values})
    reduced = samples.inputs(["torque.a"], Grid(0.0, 10.0, 200))["torque.a"]
    assert reduced[-1] == pytest.approx(1e-6, rel=1e-12)


def test_nan_is_left_out_of_a_temperature_block() -> None:
    values = np.array([20.0, np.nan, np.nan, np.nan])
    np.testing.assert_array_equal(reduce_blocks("temperature.a", values, 2), [20.0, np.nan])


def test_mechanical_power_needs_torque_and_velocity_at_one_place() -> None:
    assert "mechanical_power.a" in features_of(["torque.a", "velocity.a"])
    assert "mechanical_power.a" not in features_of(["torque.a", "velocity.b"])
    raw = {"torque.a": np.array([2.0, 2.0]), "velocity.a": np.array([3.0, -3.0])}
    power = sample_values("mechanical_power.a", raw)
    assert reduce_blocks("mechanical_power.a", power, 2).tolist() == [6.0]


def test_a_feature_in_the_log_goes_before_the_raw_quantity() -> None:
    assert raw_keys("velocity_rms.a") == ("velocity.a",)
    assert raw_keys("velocity_rms.a", ["velocity.a", "velocity_rms.a"]) == ("velocity_rms.a",)


def test_means_of_samples_tolerate_rounded_stamps() -> None:
    time = np.array([0.0, 0.5, 0.9999999999, 1.5, 3.0])
    means = Grid(0.0, 1.0, 4).means(time, np.array([1.0, 3.0, 5.0, 7.0, 9.0]))
    np.testing.assert_array_equal(means, [2.0, 6.0, np.nan, 9.0])


def test_interpolation_stops_at_nan_and_at_gaps() -> None:
    time, values = np.array([0.0, 1.0, 2.0, 3.0, 9.0]), np.array([10.0, 11.0, np.nan, 13.0, 19.0])
    at = np.array([0.5, 1.0, 1.5, 3.0, 5.0, 9.5])
    np.testing.assert_array_equal(interpolate(time, values, at, 5.0), [10.5, 11.0, np.nan, 13.0, np.nan, 19.0])


@pytest.mark.parametrize("every", [1.0, 2.5, 2.52, 7.0])
@pytest.mark.parametrize("late", [0.0, 0.3, 0.5])
@pytest.mark.parametrize("jitter", [0.0, 0.4])
def test_readings_between_the_rows_of_another_clock_are_kept(every: float, late: float, jitter: float) -> None:
    rng = np.random.default_rng(0)
    own = late + every * (np.arange(100) + rng.uniform(-jitter, jitter, 100) * (np.arange(100) > 0))
    driven = np.arange(0.0, own[-1] + 2.0)
    warms = 20 + 0.5 * own
    raw = on_one_time([(own, {"temperature.a": warms}), (driven, {"current.a": np.ones(driven.size)})])
    samples = Samples(raw.pop("time"), raw)
    step = max(1.0, samples.period)
    at = step * np.arange(int(own[-1] / step) + 1)
    (resampled,) = samples.temperatures(["temperature.a"], Grid(0.0, step, at.size), 10.0).values()
    there = np.isfinite(resampled)
    assert there.sum() >= 0.7 * min(own.size, at.size)  # two readings of one step are one
    meant = at + 0.5 * step * samples.averaged(step)
    inside = there & (meant >= own[0]) & (meant <= own[-1])
    np.testing.assert_allclose(resampled[inside], 20 + 0.5 * meant[inside], atol=1e-9)
