"""Identification: parameters from runs, by least squares over free-running simulation."""

from lptn.identify.fitting import Fit, finished, fit, fit_nuisances, fit_starts
from lptn.identify.gauss_newton import Progress
from lptn.identify.problem import Point, Problem
from lptn.identify.uncertainty import Uncertainty

__all__ = ["Fit", "Point", "Problem", "Progress", "Uncertainty", "finished", "fit", "fit_nuisances", "fit_starts"]
