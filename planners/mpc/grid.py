"""Stages of a horizon: the first as long as the control period, each later one longer, in a geometric series."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from lptn.basics.arrays import FloatArray


def growing_stages(period: float, horizon: float, count: int) -> FloatArray:
    """Lengths of the stages [s], shape (stages,): as long as `period` at first, `horizon` in sum.

    Args:
        period: of the controller [s]: length of the first stage.
        horizon: [s].
        count: at most so many stages; fewer where the horizon holds no more periods.

    Raises:
        ValueError: a period that is not positive, a horizon shorter than it, or no stage.
    """
    if not 0 < period <= horizon < float("inf") or count < 1:
        found = f"period {period:g} s, horizon {horizon:g} s, {count} stages"
        raise ValueError(f"found {found}; expected 0 < period <= horizon, one stage or more")
    count = min(count, max(1, round(horizon / period)))
    if count == 1:
        return np.array([horizon])
    powers = np.arange(count)
    if horizon / period <= count * (1 + 1e-9):
        return np.full(count, horizon / count)
    ratio = float(brentq(lambda r: period * float((r**powers).sum()) - horizon, 1.0, horizon / period + 1))
    lengths = period * ratio**powers
    return np.asarray(lengths * np.concatenate([[1.0], np.full(count - 1, (horizon - period) / lengths[1:].sum())]))


def stage_means(values: FloatArray, step: float, stages: FloatArray) -> FloatArray:
    """Means of a piecewise constant signal over each stage; its last value goes on for ever.

    Args:
        values: shape (n, signals), each row held for `step` seconds.
        step: [s].
        stages: lengths [s], shape (stages,).

    Returns:
        Shape (stages, signals).
    """
    ends = np.concatenate([[0.0], np.cumsum(stages)])
    edges = step * np.arange(len(values) + 1)
    edges[-1] = max(edges[-1], ends[-1])
    sums = np.vstack([np.zeros((1, values.shape[1])), np.cumsum(values * np.diff(edges)[:, None], axis=0)])
    if not values.shape[1]:
        return np.zeros((len(stages), 0))
    at = np.column_stack([np.interp(ends, edges, column) for column in sums.T])
    return np.asarray(np.diff(at, axis=0) / np.asarray(stages)[:, None])
