"""Faults followed through a Kalman filter: the likelihood ratio of an offset, a drift or a lag at each sensor."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil
from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.identify.noise import Noise
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.online.augmented_model import ModelError
from lptn.online.estimator import Correction, Estimator, run_filter
from lptn.online.sensor_faults import Alarm, Kind
from lptn.simulate.bound_run import BoundRun, bind
from lptn.simulate.simulation import simulate

OFFSET, DRIFT, LAG = 0, 1, 2
"""Rows of what is said of each kind of fault."""
KINDS: tuple[Kind, ...] = ("offset", "drift", "lag")
_FRESH = 360.0  # s; an offset that was not noticed by then is absorbed: later on it looks like a drift
_DRIFTS = 60  # onsets of drifts at most
_BETWEEN_DRIFTS = 60.0  # s between these onsets; more in long runs
_LAGS = (60.0, 240.0, 960.0)  # s; a lag between two of them shows as the nearer one
_LAG_ONSETS = 20
_BETWEEN_LAGS = 240.0  # s; a lag shows over minutes, and one that begins this much later is nearly the same
_LEAST_INFORMATION = 1e-9  # 1/K²; keeps a fault that no reading has shown yet from a division by zero


class FaultStatistics(NamedTuple):
    """The weightiest hypothesis of each kind (offset, drift, lag) at each sensor; arrays of shape (3, nodes).

    weight: √ of twice the logarithm of the likelihood ratio, in standard deviations; 0 where a lag is less likely than
    no fault. onset: s. size: K for an offset, K/s for a drift, s for a lag.
    """

    weight: FloatArray
    onset: FloatArray
    size: FloatArray


class LikelihoodRatios:
    r"""Generalised likelihood ratios of an offset, a drift or a lag at each sensor, for many times of onset.

    A fault of unit size that begins at some time shifts the innovations :math:`\nu` of covariance :math:`S` by a
    signature :math:`g`, found by passing the fault through the filter's own gains. With the information
    :math:`J = \sum g^\top S^{-1} g` and the score :math:`s = \sum g^\top S^{-1}\nu` its size is
    :math:`\hat b = s/J`, its weight :math:`|\hat b| \sqrt J`. The signature goes through all sensors: what a fault at
    one does to its neighbours' innovations counts for it.

    What a lag adds to the reading is known beforehand: the path that the model predicts, followed with a time constant,
    less that path. Its size is 1, and its weight :math:`\sqrt{2s - J}`. If no sensor lags, the ratio of these
    likelihoods ever exceeds a number A with a probability of 1/A at most [Ville1939].

    Args:
        nodes: number of nodes.
        states: number of the filter's states.
        step: time between updates [s].
        count: of updates.
    """

    def __init__(self, nodes: int, states: int, step: float, count: int) -> None:
        self._nodes, self._step = nodes, step
        self._fresh = max(2, round(_FRESH / step))
        drifts = np.arange(0, count, max(1, round(_BETWEEN_DRIFTS / step), ceil(count / _DRIFTS)))
        lags = np.arange(0, count, max(1, round(_BETWEEN_LAGS / step), ceil(count / _LAG_ONSETS)))
        # The update with which each slot begins; slots of offsets begin again and again.
        self._begins = np.concatenate([np.arange(self._fresh), drifts, np.repeat(lags, len(_LAGS))])
        self._drifts = slice(self._fresh, self._fresh + drifts.size)
        self._lags, self._lag_times = slice(self._drifts.stop, self._begins.size), np.tile(_LAGS, lags.size)
        slots = self._begins.size
        self._shift = np.zeros((states, nodes, slots))
        self._score = np.zeros((nodes, slots))
        self._information = np.zeros((nodes, slots))
        self._onset = np.full(slots, np.nan)
        self._path = np.zeros((nodes, slots))  # degC, that a lagging sensor follows
        self._updates, self._predicted = 0, np.zeros(nodes)

    def update(
        self, time: float, correction: Correction | None, read: BoolArray, predicted: FloatArray
    ) -> FaultStatistics:
        """Take in one update of the filter.

        Args:
            time: at which it was made [s].
            correction: its linear algebra.
            read: nodes whose readings were taken in, shape (nodes,).
            predicted: readings of the model that runs freely [degC], shape (nodes,).
        """
        self._begin_new(time, predicted if self._updates == 0 else self._predicted)
        self._updates, self._predicted = self._updates + 1, predicted
        faults = self._faults(time, predicted)
        if correction is not None:
            flat = self._shift.reshape(len(self._shift), -1)
            flat = correction.transition @ flat
            signature = -correction.by_state @ flat
            signature = signature.reshape(-1, *self._score.shape)
            for row, node in enumerate(np.flatnonzero(read)):
                signature[row, node] += faults[node]
            across = signature.reshape(len(signature), -1)
            self._shift = (flat + correction.gain @ across).reshape(self._shift.shape)
            # SciPy's solve_triangular starts threads, which take a thousand times as long as these few numbers.
            whitening = np.linalg.inv(np.linalg.cholesky(correction.covariance))
            white = whitening @ across
            self._score += ((whitening @ correction.innovation) @ white).reshape(self._score.shape)
            self._information += np.einsum("ij,ij->j", white, white).reshape(self._score.shape)
        return self._best()

    def _faults(self, time: float, predicted: FloatArray) -> FloatArray:
        """What each fault of unit size adds to the reading now, (nodes, slots); 0 in a slot that follows none."""
        faults = np.tile(np.where(np.isnan(self._onset), 0.0, 1.0), (self._nodes, 1))
        drifts, lags = self._drifts, self._lags
        faults[:, drifts] *= np.nan_to_num(time - self._onset[drifts])
        keep = np.exp(-self._step / self._lag_times)
        self._path[:, lags] = keep * self._path[:, lags] + (1 - keep) * predicted[:, None]
        faults[:, lags] *= self._path[:, lags] - predicted[:, None]
        return faults

    def _begin_new(self, time: float, before: FloatArray) -> None:
        """Begin a new offset, and a new drift or lag now and then; `before` is what was predicted an update ago."""
        begin = self._begins == self._updates
        begin[: self._fresh] = self._begins[: self._fresh] == self._updates % self._fresh
        self._onset[begin] = np.where(np.flatnonzero(begin) < self._fresh, time, time - self._step)
        self._path[:, begin] = before[:, None]
        for array in (self._shift, self._score, self._information):
            array[..., begin] = 0.0

    def _best(self) -> FaultStatistics:
        information = np.maximum(self._information, _LEAST_INFORMATION)
        weight = np.abs(self._score) / np.sqrt(information)
        size = self._score / information
        lags = self._lags
        weight[:, lags] = np.sqrt(np.maximum(2 * self._score - self._information, 0.0))[:, lags]
        size[:, lags] = self._lag_times
        weight[:, np.isnan(self._onset)] = 0.0
        kinds = []
        for slots in (slice(0, self._fresh), self._drifts, lags):
            chosen = weight[:, slots].argmax(axis=1)
            rows = np.arange(self._nodes)
            kinds.append((weight[:, slots][rows, chosen], self._onset[slots][chosen], size[:, slots][rows, chosen]))
        return FaultStatistics(*(np.array(values) for values in zip(*kinds, strict=True)))


# --- A run watched --------------------------------------------------------------------------------

STEP = 10.0
"""s; how often the statistical detector looks."""
LEAST_NOISE = 0.05
"""K; of a mean over so long: a sensor's own errors don't average out, nor does what a model loses by such steps."""
_FEWEST = 20  # steps that a short run keeps


def coarsely_bound(model: Model, run: Run, step: float) -> BoundRun:
    """A run in steps of about so many seconds, where it is long enough for it."""
    factor = min(max(1, round(step / run.step)), max(1, len(run) // _FEWEST))
    return bind(model, run.coarsen(factor))


def gaussian_estimator(model: Model, noise: Noise, error: ModelError, off: float = 0.0) -> Estimator:
    """An estimator for coarse steps; rounding enters as white noise, since the likelihood ratios are of Gaussians."""
    white = dict(zip(model.nodes, np.maximum(noise.floor, LEAST_NOISE).tolist(), strict=True))
    free = [model.parameters[index].name for index in model.free] if off else []
    covariance = off**2 * np.eye(len(free)) if off else None
    return Estimator(
        model, noise=white, error=error, learn=dict.fromkeys(free, 0.0), covariance=covariance, watch=False
    )


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
    ratios = LikelihoodRatios(len(measured), estimator.size, step, len(bound))
    predicted = simulate(estimator.model, bound).readings
    for k, _ in enumerate(run_filter(estimator, bound, measured)):
        time = float(bound.run.time[k]) + delay
        yield time, ratios.update(time, estimator.last, np.isfinite(measured[:, k]), predicted[:, k])


# --- The first sensor that is called --------------------------------------------------------------

_SETTLED = 240.0  # s behind an alarm: by then offset and drift can be told apart


def first_alarm(estimator: Estimator, bound: BoundRun, measured: FloatArray, limits: FloatArray) -> Alarm | None:
    """The first alarm among the sensors that are read; its kind as it looks some minutes later.

    Args:
        estimator: fresh.
        bound: the run.
        measured: readings [degC] as they are to be believed, shape (nodes, n).
        limits: weight that calls an offset, a drift, a lag [standard deviations], shape (3, nodes).
    """
    alarm: Alarm | None = None
    row = 0
    for time, statistics in fault_statistics(estimator, bound, measured):
        if alarm is None:
            excess = _excess(statistics, limits)
            if excess.max() > 1:
                row = int(excess.max(axis=0).argmax())
                alarm = _alarm(estimator.model.nodes[row], statistics, row, excess, time)
        elif time <= alarm.time + _SETTLED:
            alarm = _alarm(estimator.model.nodes[row], statistics, row, _excess(statistics, limits), alarm.time)
        else:
            break
    return alarm


def _excess(statistics: FaultStatistics, limits: FloatArray) -> FloatArray:
    """Weights as shares of their limits; a lag counts where no offset or drift, at any sensor, explains more."""
    excess = statistics.weight / limits
    excess[LAG, statistics.weight[LAG] < statistics.weight[:LAG].max()] = 0.0
    return excess


def _alarm(node: str, statistics: FaultStatistics, row: int, excess: FloatArray, time: float) -> Alarm:
    kind = int(excess[:, row].argmax())
    onset = min(float(statistics.onset[kind, row]), time)  # what was called had begun
    return Alarm(node, KINDS[kind], time, onset, float(statistics.size[kind, row]))
