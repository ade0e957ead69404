"""What is special in a stretch: the input that is, and none where nothing is."""

from __future__ import annotations

import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.workbench.special import special

TIME: FloatArray = np.arange(0.0, 3600.0)
START, STOP = 1800.0, 2100.0
INSIDE = (TIME >= START) & (TIME < STOP)


def _walk(rng: np.random.Generator, seconds: float) -> FloatArray:
    """A load that changes every so often, as a robot's does."""
    return np.repeat(rng.normal(0.0, 1.0, int(TIME.size / seconds)), int(seconds))


def _inputs(rng: np.random.Generator) -> dict[str, FloatArray]:
    drift = 20 + np.cumsum(rng.normal(0.0, 0.01, TIME.size))
    return {
        "torque.a": _walk(rng, 30),
        "torque.b": _walk(rng, 30),
        "velocity.a": _walk(rng, 60),
        "temperature.ambient": drift,
        "power.b": np.full(TIME.size, 3.0),
    }


def test_an_input_that_is_different_there_comes_first() -> None:
    rng = np.random.default_rng(0)
    inputs = _inputs(rng)
    inputs["velocity.a"] = inputs["velocity.a"] * (1 + 3 * INSIDE)
    heat = np.square(inputs["velocity.a"]) * INSIDE
    error = np.convolve(heat, np.exp(-TIME / 60) / 60)[: TIME.size] + rng.normal(0.0, 0.2, TIME.size)
    result = special(TIME, error, inputs, START, STOP)
    first = result.companions[0]
    assert first.column == "velocity.a"
    assert first.score > result.chance
    assert all(companion.score < result.chance for companion in result.companions[1:])
    assert {companion.column for companion in result.companions} == inputs.keys() - {"power.b"}  # it never changes


def test_a_level_that_is_another_there_is_found_and_its_means_are_told() -> None:
    rng = np.random.default_rng(1)
    inputs = _inputs(rng) | {"temperature.ambient": 20 + 0.1 * rng.normal(0.0, 1.0, TIME.size) + 6 * INSIDE}
    result = special(TIME, 1.5 * INSIDE + rng.normal(0.0, 0.2, TIME.size), inputs, START, STOP)
    first = result.companions[0]
    assert first.column == "temperature.ambient"
    assert first.score > result.chance
    assert first.inside - first.outside == pytest.approx(6.0, abs=0.1)


def test_chance_is_held_where_nothing_is_special() -> None:
    beyond = 0
    for seed in range(100):
        rng = np.random.default_rng(seed)
        error = _walk(rng, 100) + rng.normal(0.0, 0.2, TIME.size)
        result = special(TIME, error, _inputs(rng), START, STOP)
        beyond += result.companions[0].score > result.chance
    assert beyond <= 15  # one of twenty is promised; fifteen of a hundred would come once in ten thousand such tests


def test_what_can_not_be_compared_is_refused() -> None:
    for start, stop in ((0.0, 3000.0), (10.0, 12.0), (9000.0, 9100.0)):
        with pytest.raises(InputError, match="a third of the run"):
            special(TIME, np.ones(TIME.size), {"torque.a": TIME}, start, stop)
