"""Stages of a horizon, and means over them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lptn.planners.mpc.settings import growing_stages
from tests.planners.truth import stage_means


@given(st.floats(0.1, 20), st.floats(1, 100), st.integers(1, 40))
def test_stages_begin_with_a_period_grow_and_fill_the_horizon(period: float, periods: float, count: int) -> None:
    lengths = growing_stages(period, period * periods, count)
    assert lengths.sum() == pytest.approx(period * periods)
    assert len(lengths) <= count
    assert np.all(np.diff(lengths) >= -1e-9 * period)
    if len(lengths) > 1 and periods > count:
        assert lengths[0] == pytest.approx(period)


def test_as_many_stages_as_periods_are_all_alike() -> None:
    np.testing.assert_allclose(growing_stages(5, 300, 60), 5.0)


def test_means_are_those_of_a_fine_sampling() -> None:
    random = np.random.default_rng(0)
    values, stages = random.uniform(size=(40, 3)), np.array([1.3, 2.9, 7.0, 20.0])
    fine = np.repeat(values, 1000, axis=0)  # steps of 0.5 s in pieces of 0.5 ms
    fine = np.vstack([fine, np.tile(values[-1], (40_000, 1))])
    ends = np.round(np.concatenate([[0], np.cumsum(stages)]) * 2000).astype(int)
    expected = [fine[a:b].mean(axis=0) for a, b in pairwise(ends)]
    np.testing.assert_allclose(stage_means(values, 0.5, stages), expected, atol=1e-9)


@pytest.mark.parametrize(("period", "horizon", "count"), [(0, 10, 3), (5, 4, 3), (1, 10, 0), (1, float("inf"), 3)])
def test_what_can_not_be_is_refused(period: float, horizon: float, count: int) -> None:
    with pytest.raises(ValueError, match="period"):
        growing_stages(period, horizon, count)
