"""A model driven by a run, free-running: its readings, and how they change with parameters and initial states."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from math import ceil, isfinite, log2

import numpy as np

from lptn.basics.arrays import FloatArray, IntArray
from lptn.basics.errors import InputError
from lptn.model.model import Model
from lptn.simulate.bound_run import BoundRun, default_start
from lptn.simulate.dynamics import RATE_OF_A_STEP, Stepper, slopes_at_points, stepped, stepper
from lptn.simulate.readings import Piece, delayed, delayed_pieces, readings_of

# --- Substeps: how finely a run is integrated -----------------------------------------------------

_SMALLER = "inputs and parameters for which temperatures stay finite"
_MOST_SUBSTEPS = 32  # a time constant below 1/32 of the log's step can't be seen in it, and would take all the time


class SimulationError(InputError):
    """The model at these parameters is too stiff, or runs away."""


@cache
def _sample(steps: int) -> IntArray:
    # steps of a run at which the rates are looked at: inputs change resistances, but seldom the fastest one
    sampled = 25
    return np.unique(np.linspace(0, steps - 1, min(steps, sampled)).astype(int))


def substeps(model: Model, bound: BoundRun, values: FloatArray, start: FloatArray) -> int:
    """How many Runge-Kutta steps each row of the run needs, a power of two, so that few functions are made.

    The fastest rate is the largest eigenvalue of the Jacobian at a sample of the inputs.

    Raises:
        SimulationError: more than 32 would be needed.
    """
    sample, step = _sample(len(bound)), bound.run.step
    at_start = np.repeat(start[:, None], len(sample), axis=1)
    stacked = step * slopes_at_points(model, at_start, bound.inputs[:, sample], values)
    sizes = np.abs(stacked)
    of_rows = sizes.sum(axis=2)
    at_most = float(of_rows.max())  # no eigenvalue is larger than the largest sum of a row
    if not isfinite(at_most):
        raise SimulationError(bound.run.source, "run", "rates of temperature that are not finite", _SMALLER)
    if at_most <= RATE_OF_A_STEP:
        return 1
    # The largest eigenvalue is no smaller than that of the matrix with the largest row sum, and no larger than that of
    # the largest sizes of all, entry by entry (Perron and Frobenius), nor than those sums. Mostly all say the same.
    fastest = _eigenvalue(stacked[of_rows.max(axis=1).argmax()])
    if (least := _parts(fastest)) != _parts(at_most) and least != _parts(_eigenvalue(sizes.max(axis=0))):
        fastest = _eigenvalue(stacked)
    if (parts := _parts(fastest)) > _MOST_SUBSTEPS:
        place = model.states[int(of_rows.max(axis=0).argmax())]
        found = f"a time constant of {step / fastest:.2g} s in a log of steps of {step:g} s"
        expected = f"{step / (_MOST_SUBSTEPS * RATE_OF_A_STEP):.2g} s or more: a larger capacity or resistance"
        raise SimulationError(model.network.origin, place, found, expected)
    return parts


def _parts(fastest: float) -> int:
    """Runge-Kutta steps for a row with this product of its length and the fastest rate."""
    return 1 << ceil(log2(max(fastest / RATE_OF_A_STEP, 1.0)))


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
    parts = substeps(model, bound, values, start)
    path = stepped(model, start, bound.inputs, values, bound.run.step, parts, bound.run.averaged)
    _refuse_runaway(path.ends, bound)
    readings = readings_of(model, path.held, values)
    if not model.in_time:
        readings = delayed(readings, model.delays(values)[0] / bound.run.step)
    return Trajectory(path.ends, path.held, readings)


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
    parts = substeps(model, bound, values, start)
    pieces = _pieces(stepper(model, core, chosen), bound, values, start, parts, nodes)
    if not model.in_time:
        delays, slopes = (of_all[nodes] for of_all in model.delays(values))
        by_column = np.hstack([slopes[:, list(chosen)], np.zeros((len(delays), core))])
        pieces = delayed_pieces(pieces, delays / run.step, by_column, run.step, len(bound))
    for piece in pieces:
        derivatives = np.moveaxis(piece.derivatives, 0, 1)
        yield slice(piece.first, piece.stop), Sensitivities(piece.readings, derivatives, len(chosen))


def _pieces(
    steps: Stepper, bound: BoundRun, values: FloatArray, start: FloatArray, parts: int, nodes: slice | IntArray
) -> Iterator[Piece]:
    """Pieces of the run, of the nodes that are asked for."""
    model, core, chosen = steps.model, steps.core, len(steps.chosen)
    # Columns: one for each chosen parameter, then one for each core state's initial value.
    states, derivative = start, np.hstack([np.zeros((core, chosen)), np.eye(core)])
    block = 4_000_000  # derivatives, 32 MB
    most = max(1, min(WINDOW, block // derivative.size))
    for first in range(0, len(bound), most):
        inputs = bound.inputs[:, first : first + most]
        path = steps.run(states, derivative, inputs, values, bound.run.step, parts, bound.run.averaged)
        _refuse_runaway(path.ends, bound)
        states, derivative = path.ends[:, -1], path.last
        of_readings = steps.of_readings(path.held, values, path.derivatives, nodes)
        yield Piece(first, readings_of(model, path.held, values)[nodes], of_readings)
