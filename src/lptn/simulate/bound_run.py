"""A run as one model sees it: its inputs, the readings of its nodes, and the states from which to start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.errors import InputError
from lptn.logs.columns import START
from lptn.logs.run import LATEST_FIRST, Run
from lptn.model.model import Model


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
            inputs[row] = resting_temperature(model, run)
        elif run.has(column):
            inputs[row] = run.columns[column]
        else:
            raise InputError(run.source, f"column {column}", "no such column", f"the input {column} of the model")
    return BoundRun(run, inputs, measured, np.isfinite(measured), start)


# --- Where a simulation starts --------------------------------------------------------------------

_FIRST_READINGS = 5.0  # s; averaged into the start: the noise of a single reading would stay for a time constant
_AT_REST = 5.0  # K; with sensors of 1 K steps and their offsets, nodes of a robot at rest lie no further apart


def most_in_a_row(bound: BoundRun) -> FloatArray:
    """How far each node may have moved within the run's first row [K], shape (nodes,), where that is a long mean.

    The run then begins half a row before its first reading, and no node moves further in a row than from one row to
    the next, once at least. Zero where rows are samples, or means over no more than the first few seconds.
    """
    moved = np.abs(np.diff(bound.measured, axis=1))
    if not bound.run.averaged or bound.run.step <= _FIRST_READINGS:
        return np.zeros(len(moved))
    return np.asarray(np.where(np.isfinite(moved), moved, 0.0).max(axis=1, initial=0.0))


def default_start(model: Model, bound: BoundRun) -> FloatArray:
    """States to start from [degC], shape (number of states,): the first readings, hidden states in equilibrium."""
    measured = bound.start[np.isfinite(bound.start)]
    elsewhere = float(measured.mean()) if measured.size else float(np.nanmean(bound.measured))
    nodes = np.where(np.isnan(bound.start), elsewhere, bound.start)
    return start_from(model, bound, dict(zip(model.nodes, nodes.tolist(), strict=True)))


def start_from(model: Model, bound: BoundRun, states: Mapping[str, float]) -> FloatArray:
    """States to start from [degC], shape (number of states,), those that aren't given in equilibrium.

    Those that keep the time since the log began have risen by what a later piece of a log comes after that.

    Args:
        states: by name, all nodes among them.
    """
    places = dict(states) | {name: _prescribed_at_start(model, bound, name) for name in model.network.prescribed}
    resting = np.array([np.mean([places[place] for place in rests]) for rests in model.rests])
    begun = resting + model.rises * bound.run.late
    return np.array([states.get(name, value) for name, value in zip(model.states, begun.tolist(), strict=True)])


def excess_at_start(model: Model, bound: BoundRun) -> FloatArray:
    """How far the nodes of each hidden state start from what surrounds the robot [K], shape (hidden states,).

    The farthest of the prescribed temperatures counts, of several nodes their mean, of a state of a prescribed place
    that of all nodes. NaN where a node has no reading at the start or nothing is prescribed.
    """
    around = np.array([_prescribed_at_start(model, bound, name) for name in model.network.prescribed])
    if not around.size:
        return np.full(len(model.states) - len(model.nodes), np.nan)
    excess = np.abs(bound.start[:, None] - around).max(axis=1)
    shares = model.resting_shares
    shares = np.where(shares.any(axis=1, keepdims=True), shares, 1 / len(model.nodes))
    return np.array([excess[row > 0] @ row[row > 0] for row in shares])


def _prescribed_at_start(model: Model, bound: BoundRun, name: str) -> float:
    """The first value of a prescribed temperature [degC]."""
    source = model.network.prescribed[name]
    if isinstance(source, int):
        return float(model.values[source])
    return float(bound.inputs[model.inputs.index(f"temperature.{name}" if source == START else source), 0])


def _first_reading(readings: FloatArray, step: float) -> float:
    """Mean of the first few seconds' readings [degC]; NaN where the first one comes late or never."""
    finite = np.flatnonzero(np.isfinite(readings))
    if finite.size == 0 or finite[0] * step > LATEST_FIRST:
        return float("nan")
    early = finite[finite * step < finite[0] * step + max(_FIRST_READINGS, step)]
    return float(readings[early].mean())


def resting_temperature(model: Model, run: Run) -> float:
    """The temperature that all nodes have at the start of a log that begins at rest [degC].

    Raises:
        InputError: the log has no readings at its start, its nodes differ there, or fall far below it later, as nothing
            does in air that is as warm.
    """
    began = {node: run.beginning.get(f"temperature.{node}", np.nan) for node in model.nodes}
    if not np.isfinite(list(began.values())).any():
        logged = {node: run.temperature(node) for node in model.nodes if run.has(f"temperature.{node}")}
        began = {node: _first_reading(readings, run.step) for node, readings in logged.items()}
    began = {node: value for node, value in began.items() if np.isfinite(value)}
    expected = 'a log that begins at rest, or an ambient column or number in place of ambient = "start"'
    if not began:
        raise InputError(run.source, "start", f"no temperature in the first {LATEST_FIRST:g} s", expected)
    first = np.array(list(began.values()))
    if np.ptp(first) > _AT_REST:
        raise InputError(run.source, "start", _one_apart(began), expected)
    rest = float(first.mean())
    readings = {node: run.temperature(node) for node in began if run.has(f"temperature.{node}")}
    coldest = {node: float(np.nanmin(values)) for node, values in readings.items() if np.isfinite(values).any()}
    node = min(coldest, key=lambda node: coldest[node], default="")
    if node and coldest[node] < rest - _AT_REST:
        problem = f"{rest:.1f} degC, below which {node} falls to {coldest[node]:.1f} degC later: the air was colder"
        raise InputError(run.source, "start", problem, expected)
    return rest


def _one_apart(began: Mapping[str, float]) -> str:
    """Where nodes begin, in words: the one that is farthest from most, and the others; degC."""
    usual = float(np.median(list(began.values())))
    apart = max(began, key=lambda node: abs(began[node] - usual))
    others = sorted(value for node, value in began.items() if node != apart)
    beside = " to ".join(dict.fromkeys((f"{others[0]:.1f}", f"{others[-1]:.1f}")))
    few = 5  # nodes whose names go into a message
    names = ", ".join(node for node in began if node != apart) if len(others) <= few else f"the other {len(others)}"
    return f"{apart} at {began[apart]:.1f} degC, and {names} at {beside} degC"
