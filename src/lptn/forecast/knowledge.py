"""What is known of a model's errors: doubt about its parameters, and how far it strays from readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lptn.arrays import BoolArray, FloatArray
from lptn.identify import Fit
from lptn.model import Model
from lptn.model_schema import FitTable
from lptn.parameters import Transform, Unknown

_UNKNOWN_ERROR = 1.0  # K; of a model of which nobody says how well it fitted
_LEAST_ERROR = 0.1  # K; no model is better on a run that it never saw
_DOUBT = 2.0  # times the standard errors: of another activity a fit knows less than of those that it saw
_CLOSE = 1e-3  # in the fit's coordinates; nearer to a bound than this a parameter is at it
_WIDEST = 0.5  # in the fit's coordinates; a derivative says nothing of what lies further away


@dataclass(frozen=True)
class Knowledge:
    """How far a model is to be trusted.

    Args:
        covariance: of the free parameters in the fit's coordinates (logarithms of positive ones, else shares of
            the typical size), shape (free, free).
        error: how far a free-running simulation strays from noise-free readings, root mean square [K], shape (nodes,).
        source: where this is from, in words.
        adequate: whether the model followed what it was fitted to as well as the sensors' noise allows.
    """

    covariance: FloatArray
    error: FloatArray
    source: str
    adequate: bool = True

    @classmethod
    def of_fit(cls, fit: Fit) -> Knowledge:
        """Of a fit in memory: the same that its model file keeps."""
        return cls.of_table(fit.model, fit.table(), fit.noise.floor)

    @classmethod
    def of_table(cls, model: Model, table: FitTable, floor: FloatArray) -> Knowledge:
        """Of the `[fit]` table of a model file: standard errors, and the RMSE less what the sensors leave.

        Correlations are left out, though a fit knows them: they say how well the fitted runs hold combinations of
        parameters together if the model is right. For the same reason standard errors are doubled: of virtual
        trots' times to a limit, all joints, 90 % intervals then held 94 %, else 86 %.

        Args:
            model: the model.
            table: as the model file holds it; without a fit, a model error of 1 K is assumed.
            floor: RMSE that noise and steps of the sensors leave [K], shape (nodes,).
        """
        if table.rmse is None:
            return cls.nothing(model)
        free = [model.unknowns[index] for index in model.free]
        slope = np.abs(Transform(free).slope(np.array([unknown.value for unknown in free], dtype=float)))
        errors = [table.parameters[each.name].error if each.name in table.parameters else None for each in free]
        # What a fit left undetermined stands there without a standard error.
        known = np.array([np.nan if error is None else error for error in errors], dtype=float)
        variance = (_DOUBT * known / np.where(slope > 0, slope, 1.0)) ** 2
        variance = np.where(np.isnan(known) | _at_bound(free), _WIDEST**2, _bounded(variance))
        error = _beyond(np.full(len(model.nodes), table.rmse**2), floor)
        adequate = table.rmse**2 < 2 * float(floor.max()) ** 2  # what the model adds is less than the noise
        source = "standard errors and RMSE of its fit"
        if not adequate:
            source += ", which is worse than the sensors' noise: something is missing, see lptn diagnose"
        return cls(np.diag(variance), error, source, adequate)

    @classmethod
    def nothing(cls, model: Model) -> Knowledge:
        """Of a model that nobody fitted: its parameters are taken for exact, and its error for 1 K."""
        free = len(model.free)
        error = np.full(len(model.nodes), _UNKNOWN_ERROR)
        return cls(np.zeros((free, free)), error, f"no fit is known; a model error of {_UNKNOWN_ERROR:g} K is assumed")


def _beyond(mean_square: FloatArray, floor: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.maximum(mean_square - floor**2, _LEAST_ERROR**2)))


def _at_bound(free: Sequence[Unknown]) -> BoolArray:
    """Parameters that a bound stopped: their standard errors don't say how far the data would have moved them."""
    transform = Transform(free)
    bounds = transform.forward(np.array([unknown.declared.bounds for unknown in free], dtype=float).reshape(-1, 2).T)
    values = transform.forward(np.array([unknown.value for unknown in free], dtype=float))
    return np.asarray(np.abs(bounds - values).min(axis=0, initial=np.inf) < _CLOSE)


def _bounded(variance: FloatArray) -> FloatArray:
    """Variances of what the data leave open made no wider than what a derivative is good for."""
    return np.asarray(variance * _WIDEST**2 / (variance + _WIDEST**2))
