"""A model driven by a run, free-running: its readings, and how they change with parameters and initial states."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from math import ceil, isfinite, log2

import numpy as np

from lptn.basics.arrays import FloatArray, IntArray
from lptn.basics.errors import InputError
from lptn.model.model import Model
from lptn.simulate.bound_run import BoundRun, default_start
from lptn.simulate.dynamics import RATE_OF_A_STEP, Stepper, slopes_at_points, states_at_ends, stepper
from lptn.simulate.readings import Piece, delayed, delayed_pieces, over_steps, readings_of

# --- Substeps: how finely a run is integrated -----------------------------------------------------

_STRAIGHT = 0.3
"""Largest product of a row and the fastest rate for which a mean over the row is taken to be that of its two ends: off
by x²/12 of a transient, 0.7 %, no more than a Runge-Kutta step itself (`RATE_OF_A_STEP`)."""
_SMALLER = "inputs and parameters for which temperatures stay finite"
_MOST_SUBSTEPS = 32  # a time constant below 1/32 of the log's step can't be seen in it, and would take all the time


class SimulationError(InputError):
    """The model at these parameters is too stiff, or runs away."""


@cache
def _sample(steps: int) -> IntArray:
    # steps of a run at which the rates are looked at: inputs change resistances, but seldom the fastest one
    sampled = 25
    return np.unique(np.linspace(0, steps - 1, min(steps, sampled)).astype(int))


def substeps(
    model: Model, bound: BoundRun, values: FloatArray, start: FloatArray, core: int | None = None
) -> tuple[int, int]:
    """How many Runge-Kutta steps each row of the run needs, and in how many steps it is looked at.

    The fastest rate is the largest eigenvalue of the Jacobian at a sample of the inputs. Steps are a power of two, so
    that few functions are made. A row is looked at as one step unless it is a mean and a transient bends within it.

    Args:
        core: how many leading states the mean is taken of, as in `sensitivities`.

    Raises:
        SimulationError: more than 32 would be needed.
    """
    sample, step = _sample(len(bound)), bound.run.step
    at_start = np.repeat(start[:, None], len(sample), axis=1)
    stacked = step * slopes_at_points(model, at_start, bound.inputs[:, sample], values)
    at_most = _row_sums(stacked)
    if not isfinite(at_most):
        raise SimulationError(bound.run.source, "run", "rates of temperature that are not finite", _SMALLER)
    parts = 1
    if at_most > RATE_OF_A_STEP:
        fastest = _largest_eigenvalue(stacked, _parts)
        parts = _parts(fastest)
        if parts > _MOST_SUBSTEPS:
            place = model.states[int(np.abs(stacked).sum(axis=2).max(axis=0).argmax())]
            found = f"a time constant of {step / fastest:.2g} s in a log of steps of {step:g} s"
            expected = f"{step / (_MOST_SUBSTEPS * RATE_OF_A_STEP):.2g} s or more: a larger capacity or resistance"
            raise SimulationError(model.network.origin, place, found, expected)
    if bound.run.averaged and at_most > _STRAIGHT:
        of_core = stacked[:, :core, :core]
        if _row_sums(of_core) > _STRAIGHT and _bends(_largest_eigenvalue(of_core, _bends)):
            return max(parts, 2), max(parts, 2)
    return parts, 1


def _parts(fastest: float) -> int:
    """Runge-Kutta steps for a row with this product of its length and the fastest rate."""
    return 1 << ceil(log2(max(fastest / RATE_OF_A_STEP, 1.0)))


def _bends(fastest: float) -> bool:
    return fastest > _STRAIGHT


def _row_sums(stacked: FloatArray) -> float:
    """The largest sum of a row of several matrices, shape (k, n, n): no eigenvalue is larger."""
    return float(np.abs(stacked).sum(axis=2).max())


def _largest_eigenvalue(stacked: FloatArray, decided: Callable[[float], int]) -> float:
    """The largest eigenvalue of several matrices, shape (k, n, n), or one by which the same is decided.

    It is no smaller than that of the matrix with the largest row sum, and no larger than that of the largest sizes of
    all, entry by entry (Perron and Frobenius). Mostly both decide the same, for a tenth of the time.
    """
    sizes = np.abs(stacked)
    at_least, at_most = _eigenvalue(stacked[sizes.sum(axis=2).max(axis=1).argmax()]), _eigenvalue(sizes.max(axis=0))
    return at_least if decided(at_least) == decided(at_most) else _eigenvalue(stacked)


def _eigenvalue(matrices: FloatArray) -> float:
    return float(np.abs(np.linalg.eigvals(matrices)).max())


# --- The simulation -------------------------------------------------------------------------------


@dataclass(frozen=True)
class Trajectory:
    """A simulated run of n rows.

    Args:
        states: at the n + 1 ends of its rows, shape (number of states, n + 1).
        held: states as rows hold them, means or samples, shape (number of states, n).
        readings: of each node, as rows hold them [degC], shape (nodes, n).
    """

    states: FloatArray
    held: FloatArray
    readings: FloatArray


def simulate(
    model: Model, bound: BoundRun, values: FloatArray | None = None, start: FloatArray | None = None
) -> Trajectory:
    """Free-running simulation of a whole run: no measurement corrects it after its start.

    Args:
        values: parameters, shape (m,); the model's own by default. The run's name decides which effects of single
            runs act.
        start: initial states [degC]; by default the first readings.

    Raises:
        SimulationError: the parameters make the model too stiff, or it runs away.
    """
    values = model.in_run(bound.run.name, model.values if values is None else values)
    start = default_start(model, bound) if start is None else start
    parts, shown = substeps(model, bound, values, start)
    inputs, step = np.repeat(bound.inputs, shown, axis=1), bound.run.step / shown
    states = states_at_ends(model, start, inputs, values, step, parts // shown)
    _refuse_runaway(states, bound)
    readings = readings_of(model, states, values)
    if not model.in_time:
        readings = delayed(readings, model.delays(values)[0] / step)
    held = over_steps(states, bound.run.averaged, shown)
    return Trajectory(states[:, ::shown], held, over_steps(readings, bound.run.averaged, shown))


def _refuse_runaway(states: FloatArray, bound: BoundRun) -> None:
    if not np.isfinite(states).all():
        raise SimulationError(bound.run.source, "run", "temperatures that run away", _SMALLER)


# --- Its sensitivities: exact derivatives of the discrete run -------------------------------------

# What is held at once, so that a day's log needs no more memory than an hour's, and 50 nodes little more than 13:
WINDOW = 2048
"""Steps whose derivatives are held at once."""


@dataclass(frozen=True)
class Sensitivities:
    """Readings of n steps of a run and their derivatives.

    Args:
        readings: degC, shape (nodes, n).
        derivatives: by the chosen parameters, then by the initial core states, shape (nodes, n, chosen + core).
        chosen: number of chosen parameters.
    """

    readings: FloatArray
    derivatives: FloatArray
    chosen: int

    @property
    def by_parameter(self) -> FloatArray:
        """Shape (nodes, n, number of chosen parameters), per unit of the parameter."""
        return self.derivatives[:, :, : self.chosen]

    @property
    def by_start(self) -> FloatArray:
        """Shape (nodes, n, number of core states), K/K."""
        return self.derivatives[:, :, self.chosen :]


def sensitivities(
    model: Model,
    bound: BoundRun,
    values: FloatArray,
    chosen: Sequence[int],
    start: FloatArray | None = None,
    core: int | None = None,
) -> Sensitivities:
    """Forward sensitivities of a free-running simulation.

    Args:
        values: parameters, shape (m,).
        chosen: indices of the parameters to differentiate by.
        start: initial states; by default the first readings.
        core: how many leading states to follow; those behind them must not act back on these (states of
            effects that are switched off). All by default.

    Raises:
        SimulationError: the parameters make the model too stiff, or it runs away.
    """
    windows = [window for _, window in sensitivity_windows(model, bound, values, chosen, start, core)]
    readings = np.concatenate([window.readings for window in windows], axis=1)
    return Sensitivities(readings, np.concatenate([window.derivatives for window in windows], axis=1), len(chosen))


def sensitivity_windows(
    model: Model,
    bound: BoundRun,
    values: FloatArray,
    chosen: Sequence[int],
    start: FloatArray | None = None,
    core: int | None = None,
    nodes: slice | IntArray = slice(None),
) -> Iterator[tuple[slice, Sensitivities]]:
    """The same in windows of time: the steps of each, and their sensitivities.

    Args:
        nodes: whose readings are asked for, a slice or numbers; all by default. Each costs time, sensor or not.

    Raises:
        SimulationError: the parameters make the model too stiff, or it runs away.
    """
    run, values = bound.run, model.in_run(bound.run.name, values)
    start = default_start(model, bound) if start is None else start
    core = len(model.states) if core is None else core
    parts, shown = substeps(model, bound, values, start, core)
    step = run.step / shown
    pieces = _pieces(stepper(model, core, chosen), bound, values, start, parts, shown, nodes)
    if not model.in_time:
        delays, slopes = (of_all[nodes] for of_all in model.delays(values))
        by_column = np.hstack([slopes[:, list(chosen)], np.zeros((len(delays), core))])
        pieces = delayed_pieces(pieces, delays / step, by_column, step, len(bound) * shown + 1)
    for piece in pieces:
        ends = np.moveaxis(piece.derivatives, 0, 2)
        derivatives = np.moveaxis(over_steps(ends, run.averaged, shown), 2, 1)
        window = slice(piece.first // shown, (piece.stop - 1) // shown)
        yield window, Sensitivities(over_steps(piece.readings, run.averaged, shown), derivatives, len(chosen))


def _pieces(
    steps: Stepper,
    bound: BoundRun,
    values: FloatArray,
    start: FloatArray,
    parts: int,
    shown: int,
    nodes: slice | IntArray,
) -> Iterator[Piece]:
    """Pieces of whole rows, at the ends of the steps in which rows are looked at, of the nodes that are asked for."""
    model, core, chosen = steps.model, steps.core, len(steps.chosen)
    # Columns: one for each chosen parameter, then one for each core state's initial value.
    states, derivative = start, np.hstack([np.zeros((core, chosen)), np.eye(core)])
    block = 4_000_000  # derivatives, 32 MB
    most = max(1, min(WINDOW, block // derivative.size) // shown)
    for first in range(0, len(bound), most):
        inputs = np.repeat(bound.inputs[:, first : first + most], shown, axis=1)
        path, derivatives = steps.run(states, derivative, inputs, values, bound.run.step / shown, parts // shown)
        _refuse_runaway(path, bound)
        # Before whoever takes the piece changes it: without an effect on readings these are the derivatives themselves.
        states, derivative = path[:, -1].copy(), derivatives[-1].copy()
        of_readings = steps.of_readings(path, values, derivatives, nodes)
        yield Piece(first * shown, readings_of(model, path, values)[nodes], of_readings)
