"""A model driven by a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, log2

import numpy as np

from lptn.arrays import BoolArray, FloatArray
from lptn.clocks import read_late
from lptn.errors import InputError
from lptn.logs import Run
from lptn.model import Model
from lptn.network import START
from lptn.stepping import states_along

_MAX_RATE = 1.0  # product of an internal step and the fastest rate; RK4 is stable to 2.78, exact to 1 % at 1
_MAX_SUBSTEPS = 32  # a trial point that needs more is no robot, and would take all the time
_BEGINNING = 5.0  # s; readings so early are averaged into the start
_LATE = 30.0  # s; a first reading that comes later says little about the start
_AT_REST = 5.0  # K; nodes of a robot at rest lie no further apart


class SimulationError(ArithmeticError):
    """The model at these parameters is too stiff, or runs away."""


@dataclass(frozen=True)
class Drive:
    """A run as one model sees it.

    Args:
        run: where it comes from.
        inputs: shape (number of inputs, n), held over each step.
        measured: readings of the model's nodes [degC], shape (number of nodes, n), NaN where missing.
        counted: which readings count in the cost, shape (number of nodes, n).
        start: mean of each node's first readings [degC], NaN for a node that isn't measured.
    """

    run: Run
    inputs: FloatArray
    measured: FloatArray
    counted: BoolArray
    start: FloatArray

    def __len__(self) -> int:
        return int(self.inputs.shape[1])

    def until(self, stop: float) -> Drive:
        """The same drive up to a time [s]; a simulation of it costs no more than it shows."""
        cut = self.run.slice(float("-inf"), stop)
        keep = len(cut)
        if keep == len(self):
            return self
        return Drive(cut, self.inputs[:, :keep], self.measured[:, :keep], self.counted[:, :keep], self.start)

    def count(self, window: tuple[float, float]) -> Drive:
        """The same drive, counting only readings with start <= time < stop [s]."""
        inside = (self.run.time >= window[0]) & (self.run.time < window[1])
        return replace(self, counted=np.isfinite(self.measured) & inside)


@dataclass(frozen=True)
class Trajectory:
    """States at the n + 1 ends of the steps, shape (number of states, n + 1), and n readings of each node."""

    states: FloatArray
    readings: FloatArray


def drive(model: Model, run: Run) -> Drive:
    """What of a run the model needs.

    Raises:
        InputError: the run lacks an input, or measures none of the model's nodes.
    """
    measured = np.full((len(model.nodes), len(run)), np.nan)
    for row, node in enumerate(model.nodes):
        if run.has(f"temperature.{node}"):
            measured[row] = run.temperature(node)
    if not np.isfinite(measured).any():
        names = ", ".join(f"temperature.{node}" for node in model.nodes)
        raise InputError(run.source, "temperature columns", "no reading of any node of the model", names)
    start = np.array([_first(row, run.step) for row in measured])
    inputs = np.empty((len(model.inputs), len(run)))
    for row, column in enumerate(model.inputs):
        if column in model.started:
            inputs[row] = _resting_temperature(model, run, start)
        elif run.has(column):
            inputs[row] = run.columns[column]
        else:
            raise InputError(run.source, f"column {column}", "no such column", f"the input {column} of the model")
    return Drive(run, inputs, measured, np.isfinite(measured), start)


def default_start(model: Model, driven: Drive) -> FloatArray:
    """States to start from [degC], shape (number of states,): the first readings, hidden states in equilibrium."""
    known = driven.start[np.isfinite(driven.start)]
    somewhere = float(known.mean()) if known.size else float(np.nanmean(driven.measured))
    nodes = np.where(np.isnan(driven.start), somewhere, driven.start)
    return start_from(model, driven, dict(zip(model.nodes, nodes.tolist(), strict=True)))


def start_from(model: Model, driven: Drive, known: Mapping[str, float]) -> FloatArray:
    """States to start from [degC], shape (number of states,), those that nothing is known of in equilibrium.

    Args:
        known: states by name, all nodes among them.
    """
    places = dict(known) | {name: _given(model, driven, name) for name in model.network.prescribed}
    resting = (float(np.mean([places[place] for place in rests])) for rests in model.rests)
    return np.array([known.get(name, rest) for name, rest in zip(model.states, resting, strict=True)])


def substeps(model: Model, driven: Drive, values: FloatArray, start: FloatArray) -> int:
    """How many internal steps each step of the run needs: a power of two.

    The fastest rate is the largest eigenvalue of the Jacobian at a sample of the inputs.

    Raises:
        SimulationError: more than 32 would be needed.
    """
    picked = np.unique(np.linspace(0, len(driven) - 1, min(len(driven), 25)).astype(int))
    n = len(picked)
    jacobians = model.made_once(("state_jacobian", n), lambda: model.state_jacobian.map(n))
    repeated = (np.repeat(column[:, None], n, axis=1) for column in (start, values))
    states, parameters = repeated
    stacked = jacobians(states, driven.inputs[:, picked], parameters).full().reshape(len(start), n, -1)
    if not np.isfinite(stacked).all():
        raise SimulationError(f"the rates of run {driven.run.name} are not finite at these parameters")
    fastest = float(np.abs(np.linalg.eigvals(np.moveaxis(stacked, 1, 0))).max())
    if fastest * driven.run.step > _MAX_RATE * _MAX_SUBSTEPS:
        raise SimulationError(f"fastest rate {fastest:.3g} 1/s is too fast for steps of {driven.run.step:g} s")
    return 1 << max(0, ceil(log2(max(fastest * driven.run.step / _MAX_RATE, 1e-9))))


def simulate(
    model: Model, driven: Drive, values: FloatArray | None = None, start: FloatArray | None = None
) -> Trajectory:
    """Free-running simulation of a whole run: no measurement corrects it after its start.

    Args:
        values: parameters, shape (m,); the model's own by default. The run's name decides which effects of single
            runs act.
        start: initial states [degC]; by default the first readings.

    Raises:
        SimulationError: the parameters make the model too stiff, or it runs away.
    """
    values = model.in_run(driven.run.name, model.values if values is None else values)
    start = default_start(model, driven) if start is None else start
    parts = substeps(model, driven, values, start)
    states = states_along(model, start, driven.inputs, values, driven.run.step, parts)
    if not np.isfinite(states).all():
        raise SimulationError(f"the temperatures of run {driven.run.name} run away at these parameters")
    readings = model.readings_of(states, values)
    if not model.in_time:
        readings = read_late(readings, model.delays(values)[0] / driven.run.step)
    return Trajectory(states, over_steps(readings, driven.run.averaged))


def over_steps(ends: FloatArray, averaged: bool) -> FloatArray:
    """From values at the n + 1 ends of steps, along the last axis, to what a log holds: means, or samples."""
    return 0.5 * (ends[..., :-1] + ends[..., 1:]) if averaged else ends[..., :-1]


def needed_columns(model: Model) -> tuple[list[str], list[str]]:
    """Log columns that the model needs as inputs, and those that it predicts."""
    inputs = [column for column in model.inputs if column not in model.started]
    return inputs, [f"temperature.{node}" for node in model.nodes]


def drives(model: Model, runs: Sequence[Run]) -> list[Drive]:
    """`drive` for each of several runs."""
    return [drive(model, run) for run in runs]


def _given(model: Model, driven: Drive, name: str) -> float:
    """The first value of a prescribed temperature [degC]."""
    source = model.network.prescribed[name]
    if isinstance(source, int):
        return float(model.values[source])
    return float(driven.inputs[model.inputs.index(f"temperature.{name}" if source == START else source), 0])


def _first(readings: FloatArray, step: float) -> float:
    """Mean of the first few seconds' readings; NaN where the first one comes late or never."""
    finite = np.flatnonzero(np.isfinite(readings))
    if finite.size == 0 or finite[0] * step > _LATE:
        return float("nan")
    early = finite[finite * step < finite[0] * step + max(_BEGINNING, step)]
    return float(readings[early].mean())


def _resting_temperature(model: Model, run: Run, start: FloatArray) -> float:
    """The temperature that all nodes have at the start of a log that begins at rest.

    Raises:
        InputError: the log has no readings at its start, or its nodes differ there.
    """
    known = [run.beginning[f"temperature.{node}"] for node in model.nodes if f"temperature.{node}" in run.beginning]
    first = np.array(known) if known else start
    first = first[np.isfinite(first)]
    expected = 'a log that begins at rest, or an ambient column or number in place of ambient = "start"'
    if first.size == 0:
        raise InputError(run.source, "start", f"no temperature in the first {_LATE:g} s", expected)
    if np.ptp(first) > _AT_REST:
        raise InputError(run.source, "start", f"nodes from {first.min():.1f} to {first.max():.1f} degC", expected)
    return float(first.mean())
