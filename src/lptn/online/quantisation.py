"""Readings rounded to the steps of a coarse sensor: what each says of the temperature, and their noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtr

from lptn.basics.arrays import FloatArray
from lptn.identify.noise import Noise
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


# --- The noise before rounding that a filter may believe -----------------------------------------------

_GUESSED_NOISE = 0.3  # of a step: too much noise costs a filter little, too little makes it sure of what is wrong
_LEAST_NOISE = 0.02  # of a step
_FEWEST = 600  # single readings; from fewer such a noise is no better known than to a fifth


def believed_noise(noise: Noise, bound_runs: Sequence[BoundRun]) -> FloatArray:
    """Standard deviations of each node's noise before rounding [K], shape (nodes,); of a fine sensor's, what was found.

    A coarse sensor's noise shows in how often its readings change; in a few of them, or in means, not well enough.
    """
    single = [np.isfinite(bound.measured).sum(axis=1) for bound in bound_runs if not bound.run.averaged]
    told = np.sum(single, axis=0) >= _FEWEST if single else np.zeros(len(noise.step), dtype=bool)
    return np.asarray(np.maximum(noise.white, np.where(told, _LEAST_NOISE, _GUESSED_NOISE) * noise.step))
