"""A model driven by a run, and its readings at the times that the log says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, log2

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray, IntArray
from lptn.basics.errors import InputError
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import START
from lptn.simulate.steps import states_along

# --- Readings that come late or early: a trajectory read at other times than those that the log says ---


@dataclass(frozen=True)
class Piece:
    """What a run's sensors would read in time, at the w + 1 ends of w steps, with derivatives.

    Args:
        first: number of the first of these ends in the run.
        readings: degC, shape (nodes, w + 1).
        derivatives: shape (w + 1, nodes, columns).
    """

    first: int
    readings: FloatArray
    derivatives: FloatArray


def read_late(readings: FloatArray, late: FloatArray) -> FloatArray:
    """Values at the ends of a run's steps, shape (nodes, n + 1), read `late` steps late, shape (nodes,)."""
    count = readings.shape[1]
    where = [_between(np.arange(count), steps, count) for steps in late]
    # Written so that no delay at all gives the same numbers to the last bit.
    return np.array(
        [(1 - share) * row[j] + share * row[j + 1] for row, (j, share) in zip(readings, where, strict=True)]
    )


def pieces_read_late(
    pieces: Iterator[Piece], late: FloatArray, by_delay: FloatArray, step: float, count: int
) -> Iterator[Piece]:
    """The pieces of a run, in order and next to each other, read late; no more of them is held than the delay needs.

    Args:
        late: steps by which each node's readings come late, shape (nodes,).
        by_delay: derivative of each node's delay [s] by the columns, shape (nodes, columns).
        step: s.
        count: ends of steps in the whole run.
    """
    if not late.any():
        yield from (_not_late_yet(piece, by_delay, step) for piece in pieces)
        return
    margin = ceil(float(np.abs(late).max())) + 1
    held: Piece | None = None
    waiting: list[tuple[int, int]] = []
    for piece in pieces:
        waiting.append((piece.first, piece.first + piece.readings.shape[1]))
        held = piece if held is None else _joined(held, piece)
        known = held.first + held.readings.shape[1]
        while waiting and (known == count or waiting[0][1] + margin <= known):
            first, stop = waiting.pop(0)
            yield _read(held, np.arange(first, stop), late, by_delay, step, count)
            held = _less(held, stop - 1 - margin)


def _between(ends: IntArray, late: float, count: int) -> tuple[IntArray, FloatArray]:
    """Before and behind which ends of steps the wanted instants lie: the former, and the share of the way."""
    wanted = np.clip(ends - late, 0, count - 1)
    before = np.minimum(wanted.astype(int), count - 2)
    return before, wanted - before


def _read(piece: Piece, ends: IntArray, late: FloatArray, by_delay: FloatArray, step: float, count: int) -> Piece:
    readings = np.empty((len(late), len(ends)))
    derivatives = np.empty((len(ends), *piece.derivatives.shape[1:]))
    for node, steps in enumerate(late):
        before, share = _between(ends, float(steps), count)
        j = before - piece.first
        values, moved = piece.readings[node], piece.derivatives[:, node]
        readings[node] = (1 - share) * values[j] + share * values[j + 1]
        derivatives[:, node] = (1 - share)[:, None] * moved[j] + share[:, None] * moved[j + 1]
        inside = (ends - steps >= 0) & (ends - steps <= count - 1)
        slope = np.where(inside, _slope(values, j, share), 0.0) / step
        derivatives[:, node] -= slope[:, None] * by_delay[node]
    return Piece(int(ends[0]), readings, derivatives)


def _not_late_yet(piece: Piece, by_delay: FloatArray, step: float) -> Piece:
    """The same for delays of 0, where only their derivatives are to be added."""
    slopes = np.gradient(piece.readings, step, axis=1)
    for node, slope in enumerate(slopes):
        moving = np.flatnonzero(by_delay[node])
        piece.derivatives[:, node, moving] -= slope[:, None] * by_delay[node, moving]
    return piece


def _slope(values: FloatArray, before: IntArray, share: FloatArray) -> FloatArray:
    """Rise in the step in which an instant lies; where it lies between two steps the mean of both.

    Before the first value and behind the last there is no rise.
    """
    rise = np.concatenate([[0.0], np.diff(values), [0.0]])
    node = before + (share == 1)
    between = 0.5 * (rise[node] + rise[node + 1])
    return np.where((share > 0) & (share < 1), rise[before + 1], between)


def _joined(one: Piece, other: Piece) -> Piece:
    """Two pieces next to each other, the end that they share taken once."""
    readings = np.concatenate([one.readings, other.readings[:, 1:]], axis=1)
    return Piece(one.first, readings, np.concatenate([one.derivatives, other.derivatives[1:]]))


def _less(piece: Piece, first: int) -> Piece:
    """A piece without what lies before an end."""
    cut = max(0, first - piece.first)
    return Piece(piece.first + cut, piece.readings[:, cut:], piece.derivatives[cut:])


# --- A model driven by a run ----------------------------------------------------------------------


_MAX_RATE = 1.0  # product of an internal step and the fastest rate; RK4 is stable to 2.78, exact to 1 % at 1
_MAX_SUBSTEPS = 32  # a trial point that needs more is no robot, and would take all the time
_BEGINNING = 5.0  # s; readings so early are averaged into the start
_LATE = 30.0  # s; a first reading that comes later says little about the start
_AT_REST = 5.0  # K; nodes of a robot at rest lie no further apart


class SimulationError(ArithmeticError):
    """The model at these parameters is too stiff, or runs away."""


@dataclass(frozen=True)
class BoundRun:
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

    def until(self, stop: float) -> BoundRun:
        """The same drive up to a time [s]; a simulation of it costs no more than it shows."""
        cut = self.run.slice(float("-inf"), stop)
        keep = len(cut)
        if keep == len(self):
            return self
        return BoundRun(cut, self.inputs[:, :keep], self.measured[:, :keep], self.counted[:, :keep], self.start)

    def count(self, window: tuple[float, float]) -> BoundRun:
        """The same drive, counting only readings with start <= time < stop [s]."""
        inside = (self.run.time >= window[0]) & (self.run.time < window[1])
        return replace(self, counted=np.isfinite(self.measured) & inside)


@dataclass(frozen=True)
class Trajectory:
    """States at the n + 1 ends of the steps, shape (number of states, n + 1), and n readings of each node."""

    states: FloatArray
    readings: FloatArray


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
    start = np.array([_first(row, run.step) for row in measured])
    inputs = np.empty((len(model.inputs), len(run)))
    for row, column in enumerate(model.inputs):
        if column in model.started:
            inputs[row] = _resting_temperature(model, run, start)
        elif run.has(column):
            inputs[row] = run.columns[column]
        else:
            raise InputError(run.source, f"column {column}", "no such column", f"the input {column} of the model")
    return BoundRun(run, inputs, measured, np.isfinite(measured), start)


def default_start(model: Model, bound: BoundRun) -> FloatArray:
    """States to start from [degC], shape (number of states,): the first readings, hidden states in equilibrium."""
    known = bound.start[np.isfinite(bound.start)]
    somewhere = float(known.mean()) if known.size else float(np.nanmean(bound.measured))
    nodes = np.where(np.isnan(bound.start), somewhere, bound.start)
    return start_from(model, bound, dict(zip(model.nodes, nodes.tolist(), strict=True)))


def start_from(model: Model, bound: BoundRun, known: Mapping[str, float]) -> FloatArray:
    """States to start from [degC], shape (number of states,), those that nothing is known of in equilibrium.

    Args:
        known: states by name, all nodes among them.
    """
    places = dict(known) | {name: _given(model, bound, name) for name in model.network.prescribed}
    resting = (float(np.mean([places[place] for place in rests])) for rests in model.rests)
    return np.array([known.get(name, rest) for name, rest in zip(model.states, resting, strict=True)])


def substeps(model: Model, bound: BoundRun, values: FloatArray, start: FloatArray) -> int:
    """How many internal steps each step of the run needs: a power of two.

    The fastest rate is the largest eigenvalue of the Jacobian at a sample of the inputs.

    Raises:
        SimulationError: more than 32 would be needed.
    """
    picked = np.unique(np.linspace(0, len(bound) - 1, min(len(bound), 25)).astype(int))
    n = len(picked)
    jacobians = model.made_once(("state_jacobian", n), lambda: model.state_jacobian.map(n))
    repeated = (np.repeat(column[:, None], n, axis=1) for column in (start, values))
    states, parameters = repeated
    stacked = jacobians(states, bound.inputs[:, picked], parameters).full().reshape(len(start), n, -1)
    if not np.isfinite(stacked).all():
        raise SimulationError(f"the rates of run {bound.run.name} are not finite at these parameters")
    fastest = float(np.abs(np.linalg.eigvals(np.moveaxis(stacked, 1, 0))).max())
    if fastest * bound.run.step > _MAX_RATE * _MAX_SUBSTEPS:
        raise SimulationError(f"fastest rate {fastest:.3g} 1/s is too fast for steps of {bound.run.step:g} s")
    return 1 << max(0, ceil(log2(max(fastest * bound.run.step / _MAX_RATE, 1e-9))))


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
    states = states_along(model, start, bound.inputs, values, bound.run.step, parts)
    if not np.isfinite(states).all():
        raise SimulationError(f"the temperatures of run {bound.run.name} run away at these parameters")
    readings = model.readings_of(states, values)
    if not model.in_time:
        readings = read_late(readings, model.delays(values)[0] / bound.run.step)
    return Trajectory(states, over_steps(readings, bound.run.averaged))


def over_steps(ends: FloatArray, averaged: bool) -> FloatArray:
    """From values at the n + 1 ends of steps, along the last axis, to what a log holds: means, or samples."""
    return 0.5 * (ends[..., :-1] + ends[..., 1:]) if averaged else ends[..., :-1]


def needed_columns(model: Model) -> tuple[list[str], list[str]]:
    """Log columns that the model needs as inputs, and those that it predicts."""
    inputs = [column for column in model.inputs if column not in model.started]
    return inputs, [f"temperature.{node}" for node in model.nodes]


def bound_runs(model: Model, runs: Sequence[Run]) -> list[BoundRun]:
    """`drive` for each of several runs."""
    return [bind(model, run) for run in runs]


def _given(model: Model, bound: BoundRun, name: str) -> float:
    """The first value of a prescribed temperature [degC]."""
    source = model.network.prescribed[name]
    if isinstance(source, int):
        return float(model.values[source])
    return float(bound.inputs[model.inputs.index(f"temperature.{name}" if source == START else source), 0])


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
