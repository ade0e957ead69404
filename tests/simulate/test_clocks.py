"""Readings late or early by a clock: pieces of a run give what the whole run gives."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from lptn.model.model import Model
from lptn.simulate.bound_run import bind, default_start
from lptn.simulate.readings import Piece, delayed, delayed_pieces
from lptn.simulate.simulation import sensitivities, simulate, substeps
from tests.builders import effect, random_run, two_nodes

N = 200


def _whole() -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(3)
    return rng.normal(size=(2, N)).cumsum(axis=1), rng.normal(size=(N, 2, 4)).cumsum(axis=0)


def _pieces(width: int) -> Iterator[Piece]:
    readings, derivatives = _whole()
    for first in range(0, N, width):
        stop = min(first + width, N)
        yield Piece(first, readings[:, first:stop], derivatives[first:stop].copy())


@pytest.mark.parametrize("late", [(3.0, 3.0), (0.4, -7.25), (-25.0, 60.0), (1000.0, -1000.0)])
@pytest.mark.parametrize("width", [1, 7, 64, N])
def test_pieces_of_any_length_give_the_whole(width: int, late: tuple[float, float]) -> None:
    steps, by_delay = np.array(late), np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 2.0, 0.0]])
    (whole,) = delayed_pieces(_pieces(N), steps, by_delay, 2.0, N)
    pieces = list(delayed_pieces(_pieces(width), steps, by_delay, 2.0, N))
    assert [piece.first for piece in pieces] == list(range(0, N, width))
    for piece in pieces:
        span = slice(piece.first, piece.first + piece.readings.shape[1])
        np.testing.assert_array_equal(piece.readings, whole.readings[:, span])
        np.testing.assert_array_equal(piece.derivatives, whole.derivatives[span])
    np.testing.assert_array_equal(whole.readings, delayed(_whole()[0], steps))


def test_late_readings_are_those_of_earlier_instants() -> None:
    readings, _ = _whole()
    shifted = delayed(readings, np.array([2.0, -0.25]))
    np.testing.assert_array_equal(shifted[0, 2:], readings[0, :-2])
    np.testing.assert_array_equal(shifted[0, :2], readings[0, 0])
    np.testing.assert_allclose(shifted[1, :-1], 0.75 * readings[1, :-1] + 0.25 * readings[1, 1:], rtol=1e-12)
    np.testing.assert_array_equal(delayed(readings, np.zeros(2)), readings)


@pytest.mark.parametrize("delay", [0.0, 7.5, -12.0])
def test_a_long_run_is_told_in_windows_as_in_one(delay: float, monkeypatch: pytest.MonkeyPatch) -> None:
    model = Model(two_nodes([effect("copper_loss"), effect("clock_offset", delay=delay)]))
    bound = bind(model, random_run(model, 300, seed=2, averaged=True))
    chosen = list(range(len(model.parameters)))
    whole = sensitivities(model, bound, model.values, chosen)
    monkeypatch.setattr("lptn.simulate.simulation.WINDOW", 50)
    pieces = sensitivities(model, bound, model.values, chosen)
    np.testing.assert_allclose(pieces.readings, whole.readings, rtol=1e-12)
    np.testing.assert_allclose(pieces.derivatives, whole.derivatives, atol=1e-9)


@pytest.mark.parametrize("delay", [0.0, 90.0, -130.0])
def test_late_means_over_rows_as_long_as_a_time_constant(delay: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows of 60 s are cut finer than a winding's time constant, and late by so many seconds, not by so many steps."""
    network = two_nodes([effect("copper_loss"), effect("clock_offset", delay=delay)])
    model = Model(network.with_values({"capacity.a": 8.0}))
    run = random_run(model, 120, seed=2, step=60.0, averaged=True)
    bound, chosen = bind(model, run), list(range(len(model.parameters)))
    assert substeps(model, bound, model.values, default_start(model, bound)) > 1
    monkeypatch.setattr("lptn.simulate.simulation.WINDOW", 12)
    result = sensitivities(model, bound, model.values, chosen)
    np.testing.assert_allclose(result.readings, simulate(model, bound).readings, rtol=1e-12)
    for column, name in enumerate(parameter.name for parameter in model.parameters):
        e = np.zeros(len(chosen))
        e[column] = 1e-5 * max(abs(model.values[column]), 1.0)
        there, back = (simulate(model, bound, model.values + sign * e).readings for sign in (1, -1))
        slope = (there - back) / (2 * e[column])
        exact = result.by_parameter[:, :, column]
        if delay == 0 and "delay" in name:  # at the run's ends the mean of a slope and of none
            slope, exact = slope[:, 1:-1], exact[:, 1:-1]
        np.testing.assert_allclose(exact, slope, rtol=1e-4, atol=1e-4 * np.abs(slope).max(), err_msg=name)
