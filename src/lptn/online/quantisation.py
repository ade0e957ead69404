"""Readings rounded to the steps of a coarse sensor: what each says of the temperature, and the noise hidden in them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtr

from lptn.basics.arrays import FloatArray
from lptn.simulate.bound_run import BoundRun

# --- What a rounded reading says: the temperature lies in a cell, no more -------------------------

_LEAST_SHARE = 1e-10  # probability of the cell below which a Gaussian must do: the tails are beyond the floats
_LEAST_WEIGHT = 1e-9  # 1/K²; a reading that says less says nothing
_ROOT = np.sqrt(2 * np.pi)


def as_gaussian(
    innovation: FloatArray, spread: FloatArray, noise: FloatArray, step: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The Gaussian measurement that moves a prediction as the rounded one does, matched in mean and variance.

    The noisy temperature before rounding is Gaussian about the prediction; given the cell it is a truncated
    Gaussian. A prediction well inside its cell learns nothing, however often it is read; one at the edge
    learns which side it is on. Treating the rounding as white noise of variance step²/12 instead
    makes a filter the surer the longer a reading stands still.

    Args:
        innovation: reading minus predicted reading [K], shape (n,).
        spread: variance of the predicted temperature [K²], shape (n,).
        noise: variance of the noise before rounding [K²], shape (n,).
        step: of the sensor [K], 0 for a fine one, shape (n,).

    Returns:
        equivalent innovation [K] and equivalent noise variance [K²], shape (n,) each.
    """
    total = spread + noise
    deviation = np.sqrt(total)
    low, high = (innovation - step / 2) / deviation, (innovation + step / 2) / deviation
    # Both ends on the left: there the distribution function keeps its digits.
    right = low + high > 0
    low, high = np.where(right, -high, low), np.where(right, -low, high)
    share = ndtr(high) - ndtr(low)
    coarse = (step > 0) & (share > _LEAST_SHARE)
    share = np.where(coarse, share, 1.0)
    at_low, at_high = np.exp(-0.5 * low**2) / _ROOT, np.exp(-0.5 * high**2) / _ROOT
    mean = (at_low - at_high) / share
    reduction = mean**2 + (high * at_high - low * at_low) / share  # of the variance, as a share
    weight = np.maximum(np.minimum(reduction, 1.0) / total, _LEAST_WEIGHT)
    equivalent = np.where(right, -mean, mean) / (deviation * weight)
    return (
        np.where(coarse, equivalent, innovation),
        np.where(coarse, np.maximum(1 / weight - spread, 0.0), noise + step**2 / 12),
    )


# --- The noise before rounding, from how often a reading changes between two steps ----------------

_GUESSED_NOISE = 0.3  # of a step: too much noise costs a filter little, too little makes it sure of what is wrong
_LEAST_NOISE = 0.02  # of a step
_SMOOTH = 60  # readings over which a movement of the temperature itself is told from quantisation noise
_FEWEST = 600  # readings; from fewer the share of changes is no better known than to a fifth
_OFF_GRID = 0.02  # of a step, by which readings may miss the grid of steps: rounding of decimals in files


def coarse_noise(bound_runs: Sequence[BoundRun], row: int, step: float) -> float:
    r"""Standard deviation of the noise before rounding [K], of one node's sensor.

    White noise of standard deviation :math:`\sigma` changes the reading from one sample to the next with probability
    :math:`2\sigma / (q\sqrt\pi)`, averaged over a cell of width q; what the temperature's own movement adds is
    taken off. Readings that were averaged after rounding don't show it: then a share of the step serves.

    Args:
        bound_runs: runs of one model.
        row: of the node.
        step: q, of its sensor [K].
    """
    single = [_on_grid(bound.measured[row], step) for bound in bound_runs if not bound.run.averaged]
    pairs = sum(max(0, readings.size - _SMOOTH) for readings in single)
    if pairs < _FEWEST:
        return _GUESSED_NOISE * step
    changes = sum(float(np.abs(np.diff(readings)).clip(max=step).sum()) for readings in single)
    smooth = sum(float(np.abs(readings[_SMOOTH:] - readings[:-_SMOOTH]).sum()) / _SMOOTH for readings in single)
    return float(max(np.sqrt(np.pi) / 2 * (changes - smooth) / pairs, _LEAST_NOISE * step))


def _on_grid(readings: FloatArray, step: float) -> FloatArray:
    """Readings without gaps; none where they don't lie on the sensor's steps."""
    finite = readings[np.isfinite(readings)]
    steps = (finite - finite[:1]) / step
    return finite if finite.size > _SMOOTH and np.abs(steps - np.round(steps)).max() < _OFF_GRID else finite[:0]
