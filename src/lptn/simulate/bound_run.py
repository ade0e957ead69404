"""A run as one model sees it: its inputs, the readings of its nodes, and the states from which to start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.errors import InputError
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import START


@dataclass(frozen=True)
class BoundRun:
    """A run bound to a model.

    Args:
        run: the log.
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

    def until(self, stop: float) -> BoundRun:
        """The same up to a time [s]; a simulation of it costs no more than it shows."""
        cut = self.run.slice(float("-inf"), stop)
        keep = len(cut)
        if keep == len(self):
            return self
        return BoundRun(cut, self.inputs[:, :keep], self.measured[:, :keep], self.counted[:, :keep], self.start)

    def count(self, window: tuple[float, float]) -> BoundRun:
        """The same, counting only readings with start <= time < stop [s]."""
        inside = (self.run.time >= window[0]) & (self.run.time < window[1])
        return replace(self, counted=np.isfinite(self.measured) & inside)


def needed_columns(model: Model) -> tuple[list[str], list[str]]:
    """Log columns that the model needs as inputs, and those that it predicts."""
    inputs = [column for column in model.inputs if column not in model.started]
    return inputs, [f"temperature.{node}" for node in model.nodes]


def bind(model: Model, run: Run) -> BoundRun:
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
    start = np.array([_first_reading(row, run.step) for row in measured])
    inputs = np.empty((len(model.inputs), len(run)))
    for row, column in enumerate(model.inputs):
        if column in model.started:
            inputs[row] = _resting_temperature(model, run, start)
        elif run.has(column):
            inputs[row] = run.columns[column]
        else:
            raise InputError(run.source, f"column {column}", "no such column", f"the input {column} of the model")
    return BoundRun(run, inputs, measured, np.isfinite(measured), start)


# --- Where a simulation starts --------------------------------------------------------------------

_FIRST_READINGS = 5.0  # s; averaged into the start: the noise of a single reading would stay for a time constant
_LATEST_FIRST = 30.0  # s; a first reading that comes later says little about the start, with time constants of minutes
_AT_REST = 5.0  # K; with sensors of 1 K steps and their offsets, nodes of a robot at rest lie no further apart


def default_start(model: Model, bound: BoundRun) -> FloatArray:
    """States to start from [degC], shape (number of states,): the first readings, hidden states in equilibrium."""
    measured = bound.start[np.isfinite(bound.start)]
    elsewhere = float(measured.mean()) if measured.size else float(np.nanmean(bound.measured))
    nodes = np.where(np.isnan(bound.start), elsewhere, bound.start)
    return start_from(model, bound, dict(zip(model.nodes, nodes.tolist(), strict=True)))


def start_from(model: Model, bound: BoundRun, states: Mapping[str, float]) -> FloatArray:
    """States to start from [degC], shape (number of states,), those that aren't given in equilibrium.

    Args:
        states: by name, all nodes among them.
    """
    places = dict(states) | {name: _prescribed_at_start(model, bound, name) for name in model.network.prescribed}
    resting = (float(np.mean([places[place] for place in rests])) for rests in model.rests)
    return np.array([states.get(name, rest) for name, rest in zip(model.states, resting, strict=True)])


def _prescribed_at_start(model: Model, bound: BoundRun, name: str) -> float:
    """The first value of a prescribed temperature [degC]."""
    source = model.network.prescribed[name]
    if isinstance(source, int):
        return float(model.values[source])
    return float(bound.inputs[model.inputs.index(f"temperature.{name}" if source == START else source), 0])


def _first_reading(readings: FloatArray, step: float) -> float:
    """Mean of the first few seconds' readings [degC]; NaN where the first one comes late or never."""
    finite = np.flatnonzero(np.isfinite(readings))
    if finite.size == 0 or finite[0] * step > _LATEST_FIRST:
        return float("nan")
    early = finite[finite * step < finite[0] * step + max(_FIRST_READINGS, step)]
    return float(readings[early].mean())


def _resting_temperature(model: Model, run: Run, start: FloatArray) -> float:
    """The temperature that all nodes have at the start of a log that begins at rest.

    Raises:
        InputError: the log has no readings at its start, or its nodes differ there.
    """
    columns = [f"temperature.{node}" for node in model.nodes]
    beginning = [run.beginning[column] for column in columns if column in run.beginning]
    first = np.array(beginning) if beginning else start
    first = first[np.isfinite(first)]
    expected = 'a log that begins at rest, or an ambient column or number in place of ambient = "start"'
    if first.size == 0:
        raise InputError(run.source, "start", f"no temperature in the first {_LATEST_FIRST:g} s", expected)
    if np.ptp(first) > _AT_REST:
        raise InputError(run.source, "start", f"nodes from {first.min():.1f} to {first.max():.1f} degC", expected)
    return float(first.mean())
