"""Statistics of errors beside those of noise: autocorrelation and distribution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import fftconvolve
from scipy.special import ndtri

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.diagnose.unexplained_heat import WIDE

_POINTS = 200  # of each curve
_LONGEST = 0.25  # share of the run: products over longer lags are too few to tell anything
_LEAST = 20  # readings


@dataclass(frozen=True)
class Residuals:
    """Errors of one node in one run.

    Args:
        lag: s.
        correlation: autocorrelation of the errors less their mean, at each lag.
        band: what white noise stays below at 19 of 20 lags.
        memory: s; the residual correlation time: the first lag within the band, `None` if there is none.
        normal: quantiles of the normal distribution with the errors' mean and standard deviation [K].
        quantiles: those of the errors [K].
    """

    lag: tuple[float, ...]
    correlation: tuple[float, ...]
    band: float
    memory: float | None
    normal: tuple[float, ...]
    quantiles: tuple[float, ...]


def residuals(error: FloatArray, step: float) -> Residuals:
    """What the errors of a node look like.

    Args:
        error: predicted − measured [K], evenly spaced in time, (n,), NaN where nothing was measured.
        step: s between them.

    Raises:
        InputError: too few readings, or all errors are the same.
    """
    finite = np.isfinite(error)
    errors = error[finite]
    if errors.size < _LEAST or np.ptp(errors) == 0:
        raise InputError("plot", "residuals", f"{errors.size} readings", f"{_LEAST} or more that differ")
    correlation = _autocorrelation(np.where(finite, error - errors.mean(), 0.0), finite)
    lags = np.unique(np.linspace(0, correlation.size - 1, _POINTS).astype(int))
    band = WIDE / float(np.sqrt(errors.size))
    within = np.flatnonzero(np.abs(correlation) < band)
    probabilities = (np.arange(min(_POINTS, errors.size)) + 0.5) / min(_POINTS, errors.size)
    return Residuals(
        tuple((lags * step).tolist()),
        tuple(correlation[lags].tolist()),
        band,
        float(within[0]) * step if within.size else None,
        tuple((errors.mean() + errors.std() * ndtri(probabilities)).tolist()),
        tuple(np.quantile(errors, probabilities).tolist()),
    )


def _autocorrelation(deviation: FloatArray, finite: np.typing.NDArray[np.bool_]) -> FloatArray:
    """Correlation at lags of 0, 1, 2, … readings; pairs of which one is missing are left out."""
    most = max(int(_LONGEST * deviation.size), 2)
    products, both = (fftconvolve(x, x[::-1])[deviation.size - 1 :][:most] for x in (deviation, finite.astype(float)))
    covariance = products / np.maximum(np.round(both), 1.0)
    return np.asarray(covariance / covariance[0])
