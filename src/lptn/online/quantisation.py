"""Readings rounded to the steps of a coarse sensor: what each says of the temperature, and the noise hidden in them."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from lptn.basics.arrays import FloatArray
from lptn.identify.noise import Noise

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


# --- The noise before rounding, sensors of a kind together ------------------------------------------

SENSOR_ERROR = 0.05
"""K; of a reading, and of a mean over some seconds: a sensor's own errors don't average out."""


def noise_and_steps(noise: Noise) -> tuple[FloatArray, FloatArray]:
    """White noise of each sensor before rounding, and its steps [K], of readings as the runs hold them, (nodes,) each.

    Sensors of one step are of one kind, so the median of their noise is a coarse sensor's: one that stands shows none,
    one that dwells between two steps too much. A fine sensor has no less than that, and no less than its own.
    """
    usual = np.array([np.median(noise.white[noise.step == step]) for step in noise.step])
    white = np.where(noise.step > 0, usual, np.maximum(usual, noise.white))
    return np.maximum(white, SENSOR_ERROR), noise.step if noise.left is None else noise.left
