"""Faults followed through a Kalman filter: the likelihood ratio of an offset, a drift or a lag at each sensor."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import FloatArray, IntArray
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
_LAGS = (60.0, 240.0, 960.0)  # s; a lag between two of them shows as the nearer one
_LEAST_INFORMATION = 1e-9  # 1/K²; keeps a fault that no reading has shown from a division by zero

# --- A run in the detector's steps ----------------------------------------------------------------

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


# --- What a fault does to the innovations, for all onsets at once ---------------------------------


class FaultStatistics(NamedTuple):
    """What speaks for an offset, a drift or a lag that begins with each reading; arrays of shape (n, 3, nodes).

    weight: √ of twice the logarithm of the likelihood ratio, in standard deviations; 0 where a lag is less likely than
    no fault. size: K for an offset, K/s for a drift, s for a lag.
    """

    weight: FloatArray
    size: FloatArray


class _Filtered(NamedTuple):
    """A filter's way through a run: corrections, nodes read, and how faults of unit size grow from step to step.

    Each sensor has the same few fault states: level and rate of what is added to its reading, and for each lag a
    switch and what a lagging sensor adds. All of them add to the reading with the weights `_ADDS`.
    """

    corrections: list[Correction | None]
    read: list[IntArray]
    growth: FloatArray  # (n, nodes, states, states)


_STATES = 2 + 2 * len(_LAGS)
_ADDS = np.array([1.0, 0.0] + [0.0, 1.0] * len(_LAGS))
_BEGINS = [0, 1, *range(2, _STATES, 2)]  # the states in which an offset, a drift, each lag begin


def _filtered(estimator: Estimator, bound: BoundRun, measured: FloatArray) -> _Filtered:
    path, step = simulate(estimator.model, bound).readings.T, bound.run.step
    growth = np.tile(np.eye(_STATES), (*path.shape, 1, 1))
    growth[..., 0, 1] = step
    for state, lag in zip(range(2, _STATES, 2), _LAGS, strict=True):
        # A lagging sensor is behind the model's path by what it was before, and by what the path has moved.
        keep = np.exp(-step / lag)
        growth[..., state + 1, state + 1] = keep
        growth[1:, :, state + 1, state] = -keep * np.diff(path, axis=0)
    corrections = [estimator.last for _ in run_filter(estimator, bound, measured)]
    return _Filtered(corrections, [np.flatnonzero(np.isfinite(row)) for row in measured.T], growth)


def fault_statistics(estimator: Estimator, bound: BoundRun, measured: FloatArray) -> FaultStatistics:
    r"""What speaks for a fault at each sensor, for each time of onset, by all that was read from then on.

    A fault of unit size shifts the innovations :math:`\nu` of covariance :math:`S` by a signature :math:`g`. With the
    information :math:`J = \sum g^\top S^{-1} g` and the score :math:`s = \sum g^\top S^{-1}\nu` its size is
    :math:`\hat b = s/J`, its weight :math:`|\hat b| \sqrt J`. Score and information of all onsets come from one pass
    backwards through the filter, the disturbance smoother of [DeJongPenzer1998]: a fault is a shock to a state that
    the filter doesn't have. So what a fault at one sensor does to its neighbours' innovations counts for it.

    What a lag adds to the reading is known beforehand: the path that the model predicts, followed with a time constant,
    less that path. Its size is 1, and its weight :math:`\sqrt{2s - J}`. If no sensor lags, the ratio of these
    likelihoods ever exceeds a number A with a probability of 1/A at most [Ville1939].

    Args:
        estimator: fresh.
        bound: the run.
        measured: readings [degC] as they are to be believed, shape (nodes, n).
    """
    return _backwards(estimator.size, _filtered(estimator, bound, measured), len(bound))


def _backwards(size: int, filtered: _Filtered, n: int) -> FaultStatistics:
    nodes = filtered.growth.shape[1]
    score, information = np.zeros(size), np.zeros((size, size))  # of a shock to the filter's own states
    of_fault, of_both = np.zeros((nodes, _STATES)), np.zeros((nodes, size, _STATES))
    of_faults = np.zeros((nodes, _STATES, _STATES))
    scores, squares = np.zeros((n, nodes, len(_BEGINS))), np.zeros((n, nodes, len(_BEGINS)))
    for k in reversed(range(n)):
        correction, read, grow = filtered.corrections[k], filtered.read[k], filtered.growth[k]
        if correction is not None:
            h, gain, inverse = correction.by_state, correction.gain, np.linalg.inv(correction.covariance)
            kept = np.eye(size) - gain @ h
            by_gain = information @ gain
            smoothed = inverse @ correction.innovation - gain.T @ score
            precision = np.diag(inverse + gain.T @ by_gain)
            across = h.T @ inverse - kept.T @ by_gain
            of_fault[read] += smoothed[:, None] * _ADDS
            with_gain = _ADDS[:, None] * np.einsum("zr,rzs->rs", gain, of_both[read])[:, None, :]
            of_faults[read] += precision[:, None, None] * np.outer(_ADDS, _ADDS)
            of_faults[read] -= with_gain + with_gain.transpose(0, 2, 1)
            moved = kept @ correction.transition
            of_both = moved.T @ of_both
            of_both[read] += (correction.transition.T @ across).T[..., None] * _ADDS
            score = correction.transition.T @ (h.T @ (inverse @ correction.innovation)) + moved.T @ score
            h = h @ correction.transition
            information = h.T @ inverse @ h + moved.T @ information @ moved
        turned = grow.transpose(0, 2, 1)
        of_fault = (turned @ of_fault[..., None])[..., 0]
        of_both, of_faults = of_both @ grow, turned @ of_faults @ grow
        scores[k], squares[k] = of_fault[:, _BEGINS], of_faults[:, _BEGINS, _BEGINS]
    squares = np.maximum(squares, _LEAST_INFORMATION)
    lag_weights = np.sqrt(np.maximum(2 * scores - squares, 0.0))[..., LAG:]
    which = lag_weights.argmax(axis=2)
    weight, sizes = np.abs(scores[..., :LAG]) / np.sqrt(squares[..., :LAG]), scores[..., :LAG] / squares[..., :LAG]
    weight = np.concatenate([weight, lag_weights.max(axis=2, keepdims=True)], axis=2)
    sizes = np.concatenate([sizes, np.array(_LAGS)[which][..., None]], axis=2)
    return FaultStatistics(weight.transpose(0, 2, 1), sizes.transpose(0, 2, 1))


# --- The first fault that is called ---------------------------------------------------------------

_SETTLED = 240.0  # s behind an alarm: by then offset and drift can be told apart


def first_alarm(estimator: Estimator, bound: BoundRun, measured: FloatArray, limits: FloatArray) -> Alarm | None:
    """The first alarm among the sensors that are read; its kind as it looks some minutes later.

    Where the whole run passes a limit, bisection finds the reading with which it is first passed: of what a large fault
    does later on the filter's linearisation says nothing. A lag counts where no offset or drift explains more.

    Args:
        estimator: fresh.
        bound: the run.
        measured: readings [degC] as they are to be believed, shape (nodes, n).
        limits: weight that calls an offset, a drift, a lag [standard deviations], shape (3, nodes).
    """
    filtered, delay = _filtered(estimator, bound, measured), bound.run.step if bound.run.averaged else 0.0

    def by(end: int) -> tuple[FloatArray, FloatArray]:
        """Weights by the first readings, as shares of their limits, and sizes."""
        weight, size = _backwards(estimator.size, filtered, end)
        excess = weight / limits
        excess[:, LAG] *= weight[:, LAG] >= weight[:, :LAG].max()
        return excess, size

    before, end = 0, len(bound)
    if by(end)[0].max() <= 1:
        return None
    while end - before > 1:
        middle = (before + end) // 2
        before, end = (before, middle) if by(middle)[0].max() > 1 else (middle, end)
    row = int(by(end)[0].max(axis=(0, 1)).argmax())
    excess, size = by(min(end + round(_SETTLED / bound.run.step), len(bound)))
    begin, kind = np.unravel_index(int(excess[:end, :, row].argmax()), (end, len(KINDS)))
    time = float(bound.run.time[end - 1]) + delay  # a mean is known at the end of its step
    onset, found = float(bound.run.time[begin]), float(size[begin, kind, row])
    return Alarm(estimator.model.nodes[row], KINDS[kind], time, onset, found)
