"""Follow what a sensor's fault would do to a Kalman filter, and weigh it against what the filter meets."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from lptn.arrays import BoolArray, FloatArray
from lptn.online.estimate import Correction

OFFSET, DRIFT = 0, 1
_FRESH = 360.0  # s; an offset that was not noticed by then is absorbed: later on it looks like a drift
_ONSETS = 60  # beginnings of drifts that are followed at once
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
        slots = self._fresh + _ONSETS
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
        if open_ == _ONSETS:
            self._thin()
            open_ = _ONSETS // 2
        self._begin(self._fresh + open_, time - self._step)

    def _begin(self, slot: int, onset: float) -> None:
        self._onset[slot] = onset
        self._shift[:, :, slot] = 0.0
        self._met[:, slot] = 0.0
        self._information[:, slot] = 0.0

    def _thin(self) -> None:
        """Keep every second drift, so that a long log costs no more than a short one."""
        kept, rest = slice(self._fresh, None, 2), slice(self._fresh + _ONSETS // 2, None)
        for array in (self._onset, self._met, self._information, self._shift):
            array[..., self._fresh : self._fresh + _ONSETS // 2] = array[..., kept].copy()
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
