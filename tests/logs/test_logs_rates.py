"""Columns that are logged more seldom than the rest: held or averaged at their own rate, and no gap for it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lptn.logs.reading import read_log

Write = Callable[..., Path]


def every(n: int, period: int, values: list[float]) -> list[object]:
    """The values in every so manieth of n cells, the others empty."""
    return [values[k // period] if k % period == 0 else None for k in range(n)]


def test_one_reading_a_step_stands_for_its_moment_and_not_for_the_step(write: Write) -> None:
    slow = every(200, 5, [20 + 0.5 * k for k in range(40)])
    path = write({"time": list(range(200)), "temperature.a": slow, "torque.a": [1.0] * 200})
    (run,) = read_log(path, step=5.0)
    # 0.1 K/s: the mean over a step is 0.25 K above the reading at its start.
    np.testing.assert_allclose(run.temperature("a")[:-1], 20.25 + 0.5 * np.arange(39))
    assert "temperature.a: logged every 5 s." in run.notes


def test_steps_without_a_reading_stay_empty(write: Write) -> None:
    slow = every(200, 5, [20.0 + k for k in range(40)])
    slow[50] = slow[55] = None
    path = write({"time": list(range(200)), "temperature.a": slow, "torque.a": [1.0] * 200})
    (run,) = read_log(path, step=2.0)
    known = np.flatnonzero(np.isfinite(run.temperature("a")))
    assert len(known) == 38
    assert "temperature.a: logged every 5 s, 1 times later." in run.notes


@pytest.mark.parametrize("needed", [True, False])
def test_a_slow_input_is_held_and_does_not_split_the_log(write: Write, needed: bool) -> None:
    room = every(600, 60, [20.0 + k for k in range(10)])
    path = write(
        {"time": list(range(600)), "temperature.ambient": room, "temperature.a": [30.0] * 600, "torque.a": [1.0] * 600}
    )
    inputs = ["torque.a", "temperature.ambient"] if needed else ["torque.a"]
    (run,) = read_log(path, inputs=inputs, outputs=["temperature.a"], optional=["temperature.ambient"])
    assert len(run) == 600
    np.testing.assert_allclose(run.columns["temperature.ambient"][[0, 59, 60, 599]], [20.0, 20.0, 21.0, 29.0])
    assert "temperature.ambient: logged every 60 s, held in between." in run.notes


def test_a_slow_input_that_pauses_is_spared_or_splits(write: Write) -> None:
    room = every(600, 10, [20.0] * 60)
    for k in range(200, 300):
        room[k] = None
    path = write(
        {"time": list(range(600)), "temperature.ambient": room, "temperature.a": [30.0] * 600, "torque.a": [1.0] * 600}
    )
    both = ["torque.a", "temperature.ambient"]
    assert len(read_log(path, inputs=both, outputs=["temperature.a"])) == 2
    (run,) = read_log(path, inputs=["torque.a"], outputs=["temperature.a"], optional=["temperature.ambient"])
    assert not run.has("temperature.ambient")
