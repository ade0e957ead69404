"""A sensor's step is found where there is one, and only there."""

from __future__ import annotations

import numpy as np
import pytest

from lptn.logs.quality import quantisation_step

rng = np.random.default_rng(3)
SMOOTH = 25 + 15 * (1 - np.exp(-np.arange(3000) / 800)) + 0.05 * rng.normal(size=3000)


@pytest.mark.parametrize("step", [1.0, 0.5, 0.0625, 0.1, 5 / 9])
def test_a_step_is_found(step: float) -> None:
    assert quantisation_step(np.round(SMOOTH / step) * step) == pytest.approx(step, rel=1e-3)


def test_nan_and_float32_do_not_hide_a_step() -> None:
    values = (np.round(SMOOTH / 0.0625) * 0.0625 - 273.15 + 273.15).astype(np.float32).astype(np.float64)
    values[::7] = np.nan
    assert quantisation_step(values) == pytest.approx(0.0625, rel=1e-3)


def test_a_rounded_step_is_found_or_not_but_never_wrong() -> None:
    adc = 3.3 / 4096 * 400
    found = quantisation_step(np.round(np.round(SMOOTH / adc) * adc, 2))
    assert found == 0.0 or found == pytest.approx(adc, rel=0.02)


@pytest.mark.parametrize(
    "values",
    [
        SMOOTH,
        np.round(SMOOTH, 2),
        20 + 0.1 * np.arange(200),
        np.full(100, 25.0),
        np.full(100, np.nan),
        np.array([]),
        np.repeat([25.0, 85.0], 50),
    ],
    ids=["smooth", "two decimals", "ramp", "constant", "nan", "none", "fault code"],
)
def test_no_step_where_there_is_none(values: np.ndarray) -> None:
    assert quantisation_step(values) == 0.0
