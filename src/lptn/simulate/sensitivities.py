"""How the simulated readings move with parameters and initial states: exact derivatives of the discrete run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.model.model import Model
from lptn.simulate.simulation import (
    BoundRun,
    Piece,
    SimulationError,
    default_start,
    over_steps,
    pieces_read_late,
    substeps,
)
from lptn.simulate.steps import Stepper, stepper

_WINDOW = 2048  # steps whose derivatives are held at once, so that a day's log needs no more memory than an hour's


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
    parts = [part for _, part in sensitivity_windows(model, bound, values, chosen, start, core)]
    readings = np.concatenate([part.readings for part in parts], axis=1)
    return Sensitivities(readings, np.concatenate([part.derivatives for part in parts], axis=1), len(chosen))


def sensitivity_windows(
    model: Model,
    bound: BoundRun,
    values: FloatArray,
    chosen: Sequence[int],
    start: FloatArray | None = None,
    core: int | None = None,
) -> Iterator[tuple[slice, Sensitivities]]:
    """The same piece by piece: the steps of each piece, and their sensitivities.

    Raises:
        SimulationError: the parameters make the model too stiff, or it runs away.
    """
    averaged, step = bound.run.averaged, bound.run.step
    pieces = _pieces(model, bound, values, chosen, start, core)
    if not model.in_time:
        late, slopes = model.delays(model.in_run(bound.run.name, values))
        cores = len(model.states) if core is None else core
        by_delay = np.hstack([slopes[:, list(chosen)], np.zeros((len(late), cores))])
        pieces = pieces_read_late(pieces, late / step, by_delay, step, len(bound) + 1)
    for piece in pieces:
        derivatives = np.moveaxis(over_steps(np.moveaxis(piece.derivatives, 0, 2), averaged), 2, 1)
        window = slice(piece.first, piece.first + len(piece.derivatives) - 1)
        yield window, Sensitivities(over_steps(piece.readings, averaged), derivatives, len(chosen))


def _pieces(
    model: Model,
    bound: BoundRun,
    values: FloatArray,
    chosen: Sequence[int],
    start: FloatArray | None,
    core: int | None,
) -> Iterator[Piece]:
    states = default_start(model, bound) if start is None else start
    values = model.in_run(bound.run.name, values)
    core = len(model.states) if core is None else core
    parts = substeps(model, bound, values, states)
    steps = stepper(model, core, chosen)
    # Columns: one for each chosen parameter, then one for each core state's initial value.
    moved = np.hstack([np.zeros((core, len(chosen))), np.eye(core)])
    for first in range(0, len(bound), _WINDOW):
        window = slice(first, min(first + _WINDOW, len(bound)))
        path, followed = steps.follow(states, moved, bound.inputs[:, window], values, bound.run.step, parts)
        if not np.isfinite(path).all():
            raise SimulationError(f"the temperatures of run {bound.run.name} run away at these parameters")
        yield Piece(first, model.readings_of(path, values), _moved_readings(steps, path, values, followed))
        states, moved = path[:, -1].copy(), followed[-1].copy()


def _moved_readings(steps: Stepper, states: FloatArray, p: FloatArray, followed: FloatArray) -> FloatArray:
    """Derivatives of the readings, shape (n + 1, nodes, chosen + core), from those of the states."""
    model, chosen = steps.model, len(steps.chosen)
    if model.reads_directly:
        return followed[:, : len(model.nodes)]
    by_state, by_parameter = steps.jacobians.readings(states, p)
    moved: FloatArray = by_state @ followed
    moved[:, :, :chosen] += by_parameter
    return moved
