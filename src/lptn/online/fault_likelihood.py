"""Faults followed through a Kalman filter: the likelihood ratio of an offset or a drift at each sensor."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.identify.noise import Noise
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.online.augmented_model import ModelError
from lptn.online.estimator import Correction, Estimator, run_filter
from lptn.online.sensor_faults import Alarm, Kind
from lptn.simulate.bound_run import BoundRun, bind

OFFSET, DRIFT = 0, 1
"""Rows of what is said of both kinds of fault."""
_FRESH = 360.0  # s; an offset that was not noticed by then is absorbed: later on it looks like a drift
_DRIFTS = 60  # onsets of drifts that are followed at once
_BETWEEN_DRIFTS = 60.0  # s between these onsets; doubled when there would be too many
_LEAST_INFORMATION = 1e-9  # 1/K²; keeps a fault that no reading has shown yet from a division by zero


class FaultStatistics(NamedTuple):
    """The weightiest hypothesis of each kind (offset, drift) at each sensor; arrays of shape (2, nodes).

    weight: √ of the likelihood ratio, in standard deviations. onset: s. size: K for an offset, K/s for a drift.
    """

    weight: FloatArray
    onset: FloatArray
    size: FloatArray


class LikelihoodRatios:
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
        slots = self._fresh + _DRIFTS
        self._shift = np.zeros((states, nodes, slots))
        self._score = np.zeros((nodes, slots))
        self._information = np.zeros((nodes, slots))
        self._onset = np.full(slots, np.nan)
        self._between_drifts, self._updates = max(_BETWEEN_DRIFTS, step), 0

    def update(self, time: float, correction: Correction | None, read: BoolArray) -> FaultStatistics:
        """Take in one update of the filter, made at a time [s] from the readings of the nodes that were `read`."""
        self._follow_new(time)
        if correction is not None:
            flat = self._shift.reshape(len(self._shift), -1)
            flat = correction.transition @ flat
            signature = -correction.by_state @ flat
            signature = signature.reshape(-1, *self._score.shape)
            fault = self._fault(time)
            for row, node in enumerate(np.flatnonzero(read)):
                signature[row, node] += fault
            across = signature.reshape(len(signature), -1)
            self._shift = (flat + correction.gain @ across).reshape(self._shift.shape)
            root = cholesky(correction.covariance, lower=True, check_finite=False)
            both = np.column_stack([across, correction.innovation])
            white = solve_triangular(root, both, lower=True, check_finite=False)
            self._score += (white[:, -1] @ white[:, :-1]).reshape(self._score.shape)
            self._information += np.einsum("ij,ij->j", white[:, :-1], white[:, :-1]).reshape(self._score.shape)
        return self._best()

    def _fault(self, time: float) -> FloatArray:
        """Size of the unit fault now, for each slot; 0 for a slot in which none is followed."""
        sizes = np.where(np.isnan(self._onset), 0.0, 1.0)
        drifts = self._onset[self._fresh :]
        sizes[self._fresh :] = np.where(np.isnan(drifts), 0.0, time - drifts)
        return sizes

    def _follow_new(self, time: float) -> None:
        """Begin a new offset, and a new drift now and then."""
        self._begin(self._updates % self._fresh, time)
        self._updates += 1
        drifts = self._onset[self._fresh :]
        followed = int(np.isfinite(drifts).sum())
        if followed and time - self._step < drifts[followed - 1] + self._between_drifts:
            return
        if followed == _DRIFTS:
            self._thin()
            followed = _DRIFTS // 2
        self._begin(self._fresh + followed, time - self._step)

    def _begin(self, slot: int, onset: float) -> None:
        self._onset[slot] = onset
        self._shift[:, :, slot] = 0.0
        self._score[:, slot] = 0.0
        self._information[:, slot] = 0.0

    def _thin(self) -> None:
        """Keep every second drift, so that a long log costs no more than a short one."""
        kept, rest = slice(self._fresh, None, 2), slice(self._fresh + _DRIFTS // 2, None)
        for array in (self._onset, self._score, self._information, self._shift):
            array[..., self._fresh : self._fresh + _DRIFTS // 2] = array[..., kept].copy()
        self._onset[rest] = np.nan
        self._between_drifts *= 2

    def _best(self) -> FaultStatistics:
        information = np.maximum(self._information, _LEAST_INFORMATION)
        weight = np.abs(self._score) / np.sqrt(information)
        size = self._score / information
        kinds = []
        for slots in (slice(0, self._fresh), slice(self._fresh, None)):
            chosen = weight[:, slots].argmax(axis=1)
            rows = np.arange(self._nodes)
            kinds.append((weight[:, slots][rows, chosen], self._onset[slots][chosen], size[:, slots][rows, chosen]))
        return FaultStatistics(*(np.array(values) for values in zip(*kinds, strict=True)))


# --- A run watched --------------------------------------------------------------------------------

STEP = 10.0
"""s; how often the statistical detector looks."""
_FEWEST = 20  # steps that a short run keeps


def coarsely_bound(model: Model, run: Run, step: float) -> BoundRun:
    """A run in steps of about so many seconds, where it is long enough for it."""
    factor = min(max(1, round(step / run.step)), max(1, len(run) // _FEWEST))
    return bind(model, run.coarsen(factor))


def gaussian_estimator(model: Model, noise: Noise, error: ModelError) -> Estimator:
    """An estimator for coarse steps; rounding enters as white noise, since the likelihood ratios are of Gaussians."""
    white = dict(zip(model.nodes, noise.floor.tolist(), strict=True))
    return Estimator(model, noise=white, error=error, watch=False)


def fault_statistics(
    estimator: Estimator, bound: BoundRun, measured: FloatArray
) -> Iterator[tuple[float, FaultStatistics]]:
    """Time [s] of each reading, and what speaks for faults by then.

    Args:
        estimator: fresh.
        bound: the run.
        measured: readings [degC] as they are to be believed, shape (nodes, n).
    """
    step = bound.run.step
    delay = step if bound.run.averaged else 0.0  # a mean is known at the end of its step
    ratios = LikelihoodRatios(len(measured), estimator.size, step)
    for k, _ in enumerate(run_filter(estimator, bound, measured)):
        time = float(bound.run.time[k]) + delay
        yield time, ratios.update(time, estimator.last, np.isfinite(measured[:, k]))


# --- The first sensor that is called --------------------------------------------------------------

_SETTLED = 240.0  # s behind an alarm: by then offset and drift can be told apart


def first_alarm(estimator: Estimator, bound: BoundRun, measured: FloatArray, limits: FloatArray) -> Alarm | None:
    """The first alarm among the sensors that are read; its kind as it looks some minutes later.

    Args:
        estimator: fresh.
        bound: the run.
        measured: readings [degC] as they are to be believed, shape (nodes, n).
        limits: weight that calls an offset, a drift [standard deviations], shape (2, nodes).
    """
    alarm: Alarm | None = None
    row = 0
    for time, statistics in fault_statistics(estimator, bound, measured):
        if alarm is None:
            excess = statistics.weight / limits
            if excess.max() > 1:
                row = int(excess.max(axis=0).argmax())
                alarm = _alarm(estimator.model.nodes[row], statistics, row, limits, time)
        elif time <= alarm.time + _SETTLED:
            alarm = _alarm(estimator.model.nodes[row], statistics, row, limits, alarm.time)
        else:
            break
    return alarm


def _alarm(node: str, statistics: FaultStatistics, row: int, limits: FloatArray, time: float) -> Alarm:
    kind = int((statistics.weight[:, row] / limits[:, row]).argmax())
    name: Kind = "drift" if kind == DRIFT else "offset"
    return Alarm(node, name, time, float(statistics.onset[kind, row]), float(statistics.size[kind, row]))
