"""How well the data determine each parameter: standard errors, correlations, and what they leave open."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.parameters import ParameterInstance
from lptn.identify.problem import Problem

_OPEN = 0.7  # standard error of a logarithm (or share of the typical size) above which a value means little
_SINGULAR = 1e-9  # eigenvalue, relative to the largest, of a combination that moves no temperature
_STRETCHES = (600.0, 300.0, 120.0, 60.0)  # s; the longest of which there are enough
_LEAST_STRETCHES = 3  # for each unknown of the fit
_CLOSE = 1e-4  # distance to a bound, in the search's coordinates


@dataclass(frozen=True)
class Uncertainty:
    """What the data say of the free parameters.

    Args:
        errors: standard errors, in each parameter's unit, shape (free,); infinite where undetermined.
        covariance: of the search's coordinates, shape (free, free).
        correlations: shape (free, free).
        warnings: one sentence for each parameter or combination that the data don't determine.
    """

    errors: FloatArray
    covariance: FloatArray
    correlations: FloatArray
    warnings: tuple[str, ...]


def uncertainty(problem: Problem, z: FloatArray) -> Uncertainty:
    """Uncertainty at the solution `z`, widened for residuals that are correlated in time or larger than σ."""
    count = len(problem.free)
    if count == 0:
        return Uncertainty(np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0)), ())
    whole = problem.normal(z)[1]
    information = _without_starts(whole, count)
    residuals = problem.residuals(z)
    eigenvalues, vectors = np.linalg.eigh(information)
    largest = max(float(eigenvalues[-1]), 1e-300)
    open_directions = eigenvalues < _SINGULAR * largest
    inverse = np.where(open_directions, 0.0, 1.0 / np.where(open_directions, 1.0, eigenvalues))
    covariance = (vectors * inverse) @ vectors.T * _widening(residuals[: problem.readings])
    covariance = _as_wide_as_stretches(covariance, problem, z, whole)
    spread = np.sqrt(np.diag(covariance))
    loose = (np.abs(vectors[:, open_directions]) > 0.05).any(axis=1)
    slope = problem.slope(problem.point(z).values)
    errors = np.where(loose, np.inf, spread * np.abs(slope))
    scale = np.where(spread > 0, spread, 1.0)
    names = [problem.model.parameters[index].name for index in problem.free]
    warnings = _combinations(names, vectors[:, open_directions])
    warnings += _loose(problem, z, names, spread, loose)
    return Uncertainty(errors, covariance, covariance / np.outer(scale, scale), tuple(warnings))


def _without_starts(whole: FloatArray, count: int) -> FloatArray:
    """Information on the parameters once the initial states are fitted along: a Schur complement."""
    if whole.shape[0] == count:
        return whole
    cross = whole[:count, count:]
    return whole[:count, :count] - cross @ np.linalg.solve(whole[count:, count:], cross.T)


def _widening(residuals: FloatArray) -> float:
    """Factor on the covariance: mean square of the residuals times their correlation time, in samples."""
    square = float(np.mean(residuals**2)) if residuals.size else 1.0
    if residuals.size < 3 or square == 0:
        return 1.0
    lag_one = float(np.mean(residuals[1:] * residuals[:-1])) / square
    lag_one = min(max(lag_one, 0.0), 0.999)
    return max(square, 1.0) * (1 + lag_one) / (1 - lag_one)


def _as_wide_as_stretches(covariance: FloatArray, problem: Problem, z: FloatArray, whole: FloatArray) -> FloatArray:
    """The covariance, widened to what stretches of minutes say where that is more.

    A coarse sensor reads too high for minutes, then too low; small physics that the model lacks does the same. White
    noise hides this from the correlation of neighbouring readings, but not from the gradients that whole stretches
    add to the cost: their scatter, seen through the Hessian, is what the parameters scatter by.
    """
    count = len(problem.free)
    for seconds in _STRETCHES:
        gradients = problem.block_gradients(z, seconds)
        if len(gradients) >= _LEAST_STRETCHES * problem.size:
            break
    else:
        return covariance
    damped = whole + 1e-10 * max(float(np.trace(whole)), 1e-12) * np.eye(len(whole))
    moved = np.linalg.solve(damped, gradients.T)[:count]
    share = len(gradients) / (len(gradients) - problem.size)
    variance, known = share * np.sum(moved**2, axis=1), np.diag(covariance)
    factor = np.sqrt(np.maximum(1.0, np.divide(variance, known, out=np.ones(count), where=known > 0)))
    return covariance * np.outer(factor, factor)


def _combinations(names: list[str], vectors: FloatArray) -> list[str]:
    warnings = []
    for vector in vectors.T:
        involved = [name for name, share in zip(names, vector, strict=True) if abs(share) > 0.05]
        same_size = np.ptp(np.abs(vector[np.abs(vector) > 0.05])) < 0.01
        advice = "multiplying them all by one factor (resistances: dividing) changes no temperature; fix one of them"
        other = "the data leave this combination open; fix one of them or measure more"
        warnings.append(f"{', '.join(involved)}: {advice if same_size and len(involved) > 1 else other}")
    return warnings


def _loose(problem: Problem, z: FloatArray, names: list[str], spread: FloatArray, open_: FloatArray) -> list[str]:
    lower, upper = problem.bounds()
    values = problem.point(z).values
    warnings = []
    for row, name in enumerate(names):
        parameter = problem.model.parameters[problem.free[row]]
        at_bound = z[row] - lower[row] < _CLOSE or upper[row] - z[row] < _CLOSE
        if at_bound and not _is_off(parameter, values[problem.free[row]]):
            bounds = " to ".join(f"{bound:g}" for bound in parameter.declared.bounds)
            warnings.append(f"{name}: ends at its bound ({bounds} {parameter.declared.unit})")
        elif spread[row] > _OPEN and not open_[row] and parameter.logarithmic:
            warnings.append(
                f"{name}: not determined by these data (a factor of {np.exp(min(spread[row], 20)):.2g} either way)"
            )
        elif not parameter.logarithmic and abs(z[row]) < 2 * spread[row] and not open_[row]:
            warnings.append(f"{name}: these data don't tell it from zero")
    return warnings


def _is_off(parameter: ParameterInstance, value: float) -> bool:
    """Whether an amplitude ended where its effect vanishes, which is a bound but no cause for a warning."""
    off = parameter.declared.off
    return off is not None and abs(value - off) < _CLOSE * abs(parameter.declared.typical)
