"""Residuals: the memory of a process that has one, and none of noise; quantiles of a distribution that is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from lptn.basics.errors import InputError
from lptn.workbench.residuals import residuals


def test_a_memory_is_found_and_noise_has_none() -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(0.0, 0.5, 20_000)
    white = residuals(noise, 2.0)
    assert white.memory == 2.0  # the first lag
    assert np.mean(np.abs(white.correlation[1:]) < white.band) > 0.9
    np.testing.assert_allclose(white.quantiles, white.normal, atol=0.1)
    slow = residuals(lfilter([1.0], [1.0, -np.exp(-2.0 / 60.0)], noise) + 3.0, 2.0)
    at_60 = np.interp(60.0, slow.lag, slow.correlation)
    assert at_60 == pytest.approx(np.exp(-1.0), abs=0.1)
    assert np.median(slow.normal) == pytest.approx(3.0, abs=0.5)


def test_missing_readings_are_left_out() -> None:
    rng = np.random.default_rng(1)
    error = lfilter([1.0], [1.0, -0.98], rng.normal(0.0, 1.0, 20_000))
    gone = np.where(rng.random(error.size) < 0.5, np.nan, error)
    whole, part = residuals(error, 1.0), residuals(gone, 1.0)
    np.testing.assert_allclose(part.correlation[:3], whole.correlation[:3], atol=0.1)
    with pytest.raises(InputError, match="readings"):
        residuals(gone[:20], 1.0)
