"""Faults of temperature sensors: what a model expects of a run, alarms, and the suspicion that each fault raises."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.identify.noise import Noise
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.online.augmented_model import ModelError
from lptn.online.estimator import Correction, Estimator, run_filter
from lptn.simulate.bound_run import BoundRun, bind
from lptn.simulate.simulation import simulate

# --- An alarm: which sensor, which kind of fault, when --------------------------------------------


Kind = Literal["drift", "offset", "stuck", "dropout"]


@dataclass(frozen=True)
class Alarm:
    """One sensor's fault as a detector sees it.

    Args:
        node: whose sensor.
        kind: named from the log up to some minutes behind the alarm.
        time: at which it was called [s, in the log's clock].
        onset: at which it seems to have begun [s].
        size: K for an offset, K/s for a drift; `None` for the others.
    """

    node: str
    kind: Kind
    time: float
    onset: float
    size: float | None = None

    def as_json(self) -> dict[str, object]:
        """The alarm as other tools read it."""
        return {"node": self.node, "kind": self.kind, "time": self.time, "onset": self.onset, "size": self.size}


def earliest(alarms: Iterable[Alarm]) -> list[Alarm]:
    """The first alarm at each sensor, in order of time."""
    found: dict[str, Alarm] = {}
    for alarm in sorted(alarms, key=lambda each: each.time):
        found.setdefault(alarm.node, alarm)
    return list(found.values())


# --- One run to be watched: what was read, and what the free-running model expects ----------------


_COLDEST, _HOTTEST = -60.0, 250.0  # degC; what lies beyond is an error code, no temperature
_SAME = 1e-6  # K


@dataclass(frozen=True)
class Scene:
    """Readings and expectation of a run.

    Args:
        run: the run.
        nodes: names of the n nodes, in order.
        measured: readings [degC], NaN where missing or no temperature, shape (nodes, n).
        expected: readings of the model that runs freely from the run's first readings [degC], shape (nodes, n).
    """

    run: Run
    nodes: tuple[str, ...]
    measured: FloatArray
    expected: FloatArray

    @classmethod
    def of(cls, model: Model, run: Run) -> Scene:
        """Let the model run.

        Raises:
            InputError: the run lacks an input, or measures none of the model's nodes.
        """
        bound = bind(model, run)
        return cls(run, tuple(model.nodes), believable(bound.measured), simulate(model, bound).readings)

    @property
    def residual(self) -> FloatArray:
        """Measured minus expected [K], shape (nodes, n)."""
        return self.measured - self.expected

    @property
    def time(self) -> FloatArray:
        """Time of each reading [s, in the log's clock], shape (n,)."""
        return self.run.time

    def after(self, time: float) -> int:
        """Index of the last reading not after a time [s]."""
        return max(0, int(np.searchsorted(self.time, time, side="right")) - 1)

    @cached_property
    def steps(self) -> FloatArray:
        """Step of each sensor [K], 0 for a fine one, shape (nodes,)."""
        return np.array([self.run.resolution.get(f"temperature.{node}", 0.0) for node in self.nodes])

    @cached_property
    def moved(self) -> FloatArray:
        """How far the model moved [K] since each reading last changed, shape (nodes, n).

        A sensor with 1 K steps stands still for minutes when all is well; only where the model moved on is it
        stuck. A missing reading is no change.
        """
        found = np.zeros_like(self.expected)
        for row, path in enumerate(self.expected):
            begins = np.flatnonzero(np.append(self._changed(row), True))
            for begin, end in pairwise(begins):
                stretch = path[begin:end]
                found[row, begin:end] = np.maximum.accumulate(stretch) - np.minimum.accumulate(stretch)
        return np.where(np.isfinite(self.measured), found, 0.0)

    def stands_since(self, row: int, at: int) -> int:
        """Index of the reading since which a sensor's reading has not changed."""
        return int(np.flatnonzero(self._changed(row)[: at + 1])[-1])

    def _changed(self, row: int) -> BoolArray:
        """Where a reading differs from the last one before it that was not missing; the first one does."""
        known = np.isfinite(self.measured[row])
        last = np.maximum.accumulate(np.where(known, np.arange(known.size), 0))
        jumps = np.abs(np.diff(self.measured[row][last]))
        return np.concatenate([[True], jumps > _SAME])


def believable(measured: FloatArray) -> FloatArray:
    """Readings with error codes such as -273 or 999 degC made missing."""
    with np.errstate(invalid="ignore"):
        return np.where((measured > _COLDEST) & (measured < _HOTTEST), measured, np.nan)


# --- Dropouts, and names for what is seen in a residual -------------------------------------------


NAMING = 300.0
"""s behind an alarm that help to name it."""
_SILENT = 10.0  # s without a reading
_SILENT_STEPS = 5
_ONSETS = 100
_MOVED = 0.75  # K beyond the sensor's step that the model moves while a stuck reading stands


def dropouts(scene: Scene) -> list[Alarm]:
    """The first time at each sensor that readings have been missing for 10 s, and for five steps.

    A node without any reading has no sensor.
    """
    found = []
    need = max(_SILENT_STEPS, round(_SILENT / scene.run.step))
    for node, readings in zip(scene.nodes, scene.measured, strict=True):
        missing = np.isnan(readings)
        count = np.arange(missing.size) - np.maximum.accumulate(np.where(missing, -1, np.arange(missing.size)))
        silent = np.flatnonzero(count >= need)
        if silent.size and not missing.all():
            begin = int(silent[0]) - need + 1
            found.append(Alarm(node, "dropout", float(scene.time[silent[0]]), float(scene.time[begin])))
    return found


def stuck(scene: Scene, row: int, at: int) -> float | None:
    """Since when [s] a reading has stood still at an alarm and for minutes behind it, though the model moved.

    `None` where the reading moves again, or the model did not move.

    A drift, too, can hold a reading for a while: against a temperature that moves the other way.

    Args:
        at: index of the alarm.
    """
    end = scene.after(scene.time[at] + NAMING)
    begin = scene.stands_since(row, end)
    if begin > at or scene.moved[row, begin : end + 1].max() <= scene.steps[row] + _MOVED:
        return None
    return float(scene.time[begin])


def shaped(scene: Scene, row: int, at: int) -> Alarm:
    """An alarm named by the residual's shape: a step or a straight line that begins at a time of its own."""
    end = scene.after(scene.time[at] + NAMING)
    time, residual = scene.time[: end + 1], scene.residual[row, : end + 1]
    known = np.isfinite(residual)
    time, residual = time[known], residual[known]
    onsets = np.linspace(time[0], scene.time[at], _ONSETS)
    jumped = [_least_squares((time >= onset).astype(float), residual) for onset in onsets]
    crept = [_least_squares(np.maximum(time - onset, 0.0), residual) for onset in onsets]
    step, line = (min(range(_ONSETS), key=lambda k: fits[k][0]) for fits in (jumped, crept))
    when, node = float(scene.time[at]), scene.nodes[row]
    if jumped[step][0] <= crept[line][0]:
        return Alarm(node, "offset", when, float(onsets[step]), jumped[step][1])
    return Alarm(node, "drift", when, float(onsets[line]), crept[line][1])


def _least_squares(shape: FloatArray, residual: FloatArray) -> tuple[float, float]:
    """Sum of squares that a constant and a multiple of a shape leave, and the multiple."""
    centred, level = shape - shape.mean(), residual - residual.mean()
    power = float(centred @ centred)
    size = float(centred @ level) / power if power > 0 else 0.0
    return float(level @ level) - size * float(centred @ level), size


# --- Follow what a sensor's fault would do to a Kalman filter, and weigh it against what the filter meets ---


OFFSET, DRIFT = 0, 1
_FRESH = 360.0  # s; an offset that was not noticed by then is absorbed: later on it looks like a drift
_ONSETS_HELD = 60  # beginnings of drifts that are followed at once
_APART = 60.0  # s between them; doubled when there would be too many
_LEAST_INFORMATION = 1e-9


class Best(NamedTuple):
    """The weightiest hypothesis of each kind (offset, drift) at each sensor; arrays of shape (2, nodes).

    weight: √ of the likelihood ratio, in standard deviations. onset: s. size: K for an offset, K/s for a drift.
    """

    weight: FloatArray
    onset: FloatArray
    size: FloatArray


class Suspicions:
    r"""Generalised likelihood ratios of an offset or a drift at each sensor, for many times of onset.

    A fault of unit size that begins at some time shifts the innovations :math:`\nu` of covariance :math:`S` by a
    signature :math:`g`, found by passing the fault through the filter's own gains. With the information
    :math:`J = \sum g^\top S^{-1} g` its size is :math:`\hat b = \sum g^\top S^{-1}\nu / J`, its weight
    :math:`|\hat b| \sqrt J`. The signature goes through all sensors: what a fault at one does to its neighbours'
    innovations counts for it.

    Args:
        nodes: number of nodes.
        states: number of the filter's states.
        step: time between updates [s].
    """

    def __init__(self, nodes: int, states: int, step: float) -> None:
        self._nodes, self._step = nodes, step
        self._fresh = max(2, round(_FRESH / step))
        slots = self._fresh + _ONSETS_HELD
        self._shift = np.zeros((states, nodes, slots))
        self._met = np.zeros((nodes, slots))
        self._information = np.zeros((nodes, slots))
        self._onset = np.full(slots, np.nan)
        self._apart, self._updates = max(_APART, step), 0

    def update(self, time: float, correction: Correction | None, seen: BoolArray) -> Best:
        """Take in one update of the filter, made at a time [s] from the readings of the nodes that were `seen`."""
        self._open(time)
        if correction is not None:
            flat = self._shift.reshape(len(self._shift), -1)
            flat = correction.transition @ flat
            signature = -correction.by_state @ flat
            signature = signature.reshape(-1, *self._met.shape)
            fault = self._fault(time)
            for row, node in enumerate(np.flatnonzero(seen)):
                signature[row, node] += fault
            across = signature.reshape(len(signature), -1)
            self._shift = (flat + correction.gain @ across).reshape(self._shift.shape)
            root = cholesky(correction.covariance, lower=True, check_finite=False)
            white = solve_triangular(
                root, np.column_stack([across, correction.innovation]), lower=True, check_finite=False
            )
            self._met += (white[:, -1] @ white[:, :-1]).reshape(self._met.shape)
            self._information += np.einsum("ij,ij->j", white[:, :-1], white[:, :-1]).reshape(self._met.shape)
        return self._best()

    def _fault(self, time: float) -> FloatArray:
        """Size of the unit fault now, for each slot; 0 for a slot that isn't open."""
        sizes = np.where(np.isnan(self._onset), 0.0, 1.0)
        drifts = self._onset[self._fresh :]
        sizes[self._fresh :] = np.where(np.isnan(drifts), 0.0, time - drifts)
        return sizes

    def _open(self, time: float) -> None:
        """Begin a new offset, and a new drift now and then."""
        self._begin(self._updates % self._fresh, time)
        self._updates += 1
        drifts = self._onset[self._fresh :]
        open_ = int(np.isfinite(drifts).sum())
        if open_ and time - self._step < drifts[open_ - 1] + self._apart:
            return
        if open_ == _ONSETS_HELD:
            self._thin()
            open_ = _ONSETS_HELD // 2
        self._begin(self._fresh + open_, time - self._step)

    def _begin(self, slot: int, onset: float) -> None:
        self._onset[slot] = onset
        self._shift[:, :, slot] = 0.0
        self._met[:, slot] = 0.0
        self._information[:, slot] = 0.0

    def _thin(self) -> None:
        """Keep every second drift, so that a long log costs no more than a short one."""
        kept, rest = slice(self._fresh, None, 2), slice(self._fresh + _ONSETS_HELD // 2, None)
        for array in (self._onset, self._met, self._information, self._shift):
            array[..., self._fresh : self._fresh + _ONSETS_HELD // 2] = array[..., kept].copy()
        self._onset[rest] = np.nan
        self._apart *= 2

    def _best(self) -> Best:
        known = np.maximum(self._information, _LEAST_INFORMATION)
        weight = np.abs(self._met) / np.sqrt(known)
        size = self._met / known
        parts = []
        for slots in (slice(0, self._fresh), slice(self._fresh, None)):
            chosen = weight[:, slots].argmax(axis=1)
            rows = np.arange(self._nodes)
            parts.append((weight[:, slots][rows, chosen], self._onset[slots][chosen], size[:, slots][rows, chosen]))
        return Best(*(np.array(values) for values in zip(*parts, strict=True)))


# --- The statistical detector's eye: an estimator led along a run, with suspicions against each sensor ---


STEP = 10.0
"""s; the statistical detector looks so often"""
_FEWEST = 20  # steps that a short run keeps


def estimator_of(model: Model, noise: Noise, error: ModelError) -> Estimator:
    """A filter for a run in coarse steps; rounding enters as white noise, since the ratios are of Gaussians."""
    floor = dict(zip(model.nodes, noise.floor.tolist(), strict=True))
    return Estimator(model, noise=floor, error=error)


def watch(estimator: Estimator, bound: BoundRun, measured: FloatArray) -> Iterator[tuple[float, Best]]:
    """Time [s] of each reading and the suspicions by then.

    Args:
        measured: readings [degC] as they are to be believed, shape (nodes, n).
    """
    step = bound.run.step
    delay = step if bound.run.averaged else 0.0  # a mean is known at the end of its step
    suspicions: Suspicions | None = None
    for k, _ in enumerate(run_filter(estimator, bound, measured)):
        if suspicions is None:
            suspicions = Suspicions(len(measured), estimator.size, step)
        time = float(bound.run.time[k]) + delay
        yield time, suspicions.update(time, estimator.last, np.isfinite(measured[:, k]))


def coarse_drive(model: Model, run: Run, step: float) -> BoundRun:
    """A run in steps of about so many seconds, where it is long enough for it."""
    factor = min(max(1, round(step / run.step)), max(1, len(run) // _FEWEST))
    return bind(model, run.coarsen(factor))
