"""How well the data determine each parameter: standard errors, correlations, and what they leave open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray, IntArray
from lptn.basics.parameters import Parameter, ParameterInstance
from lptn.identify.problem import Problem

_SINGULAR = 1e-9  # eigenvalue, relative to the largest, of a combination that changes no temperature
_INVOLVED = 0.05  # component of a unit vector from which on a parameter is named as part of a combination


@dataclass(frozen=True)
class Uncertainty:
    """What the data say of the free parameters.

    Args:
        standard_errors: in each parameter's unit, shape (free,); infinite where undetermined.
        covariance: of the search's coordinates, shape (free, free).
        correlations: shape (free, free).
        warnings: one sentence for each parameter or combination that the data don't determine.
    """

    standard_errors: FloatArray
    covariance: FloatArray
    correlations: FloatArray
    warnings: tuple[str, ...]


def uncertainty(problem: Problem, z: FloatArray) -> Uncertainty:
    """Uncertainty at the solution `z`, widened for residuals that are correlated in time or larger than σ.

    Args:
        problem: the least-squares problem.
        z: its unknowns at the optimum, shape (size,).
    """
    count = len(problem.free)
    if count == 0:
        return Uncertainty(np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0)), ())
    whole = problem.normal(z)[1]
    information = _without_starts(whole, count)
    residuals = problem.residuals(z)
    eigenvalues, vectors = np.linalg.eigh(information)
    largest = max(float(eigenvalues[-1]), 1e-300)
    singular = eigenvalues < _SINGULAR * largest
    inverse = np.where(singular, 0.0, 1.0 / np.where(singular, 1.0, eigenvalues))
    inverse_of_all = (vectors * inverse) @ vectors.T
    by_priors = problem.information_of_priors(z)
    by_data = (information - by_priors) * _widening(residuals[: problem.readings])
    covariance = inverse_of_all @ (by_data + by_priors * problem.weight_of_priors**2) @ inverse_of_all
    covariance = _widened_by_blocks(covariance, problem, z, whole)
    spread = np.sqrt(np.diag(covariance))
    combinations = open_combinations(vectors[:, singular])
    undetermined = np.zeros(count, dtype=bool)
    for members, _ in combinations:
        undetermined[members] = True
    # Resistances whose conductance is not told from none.
    resistances = np.array([problem.model.parameters[index].resistance for index in problem.free], dtype=bool)
    perhaps_none = np.asarray(resistances & (-z[:count] < 2 * spread))
    slope = problem.slope(problem.point(z).values)
    errors = np.where(undetermined | perhaps_none, np.inf, spread * np.abs(slope))
    scale = np.where(spread > 0, spread, 1.0)
    names = [problem.model.parameters[index].name for index in problem.free]
    warnings = _combinations(names, combinations, perhaps_none)
    warnings += _single_parameters(problem, z, names, spread, undetermined, perhaps_none)
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


def _widened_by_blocks(covariance: FloatArray, problem: Problem, z: FloatArray, whole: FloatArray) -> FloatArray:
    """The covariance, or the block sandwich estimate where that is wider.

    A coarse sensor reads too high for minutes, then too low; small physics that the model lacks does the same. White
    noise hides this from the correlation of neighbouring readings, but not from the gradients that blocks of minutes
    add to the cost: their scatter, seen through the Hessian, is what the parameters scatter by.
    """
    count = len(problem.free)
    blocks = (600.0, 300.0, 120.0, 60.0)  # s; the longest of which there are enough are used
    least_blocks = 3  # for each unknown of the fit
    for seconds in blocks:
        gradients = problem.block_gradients(z, seconds)
        if len(gradients) >= least_blocks * problem.size:
            break
    else:
        return covariance
    damped = whole + 1e-10 * max(float(np.trace(whole)), 1e-12) * np.eye(len(whole))
    influence = np.linalg.solve(damped, gradients.T)[:count]
    correction = len(gradients) / (len(gradients) - problem.size)  # for degrees of freedom
    sandwich, plain = correction * np.sum(influence**2, axis=1), np.diag(covariance)
    factor = np.sqrt(np.maximum(1.0, np.divide(sandwich, plain, out=np.ones(count), where=plain > 0)))
    return covariance * np.outer(factor, factor)


def open_combinations(vectors: FloatArray) -> list[tuple[IntArray, bool]]:
    """Parameters whose combinations change no temperature, those together that belong together.

    Args:
        vectors: orthonormal, in columns, of all such combinations; which of many bases they are is an accident.

    Returns:
        Numbers of the parameters, and whether their one combination is a factor that they have in common.
    """
    from scipy.sparse.csgraph import connected_components  # heavy, and few commands need it

    onto = vectors @ vectors.T
    involved = np.flatnonzero(np.sqrt(np.diag(onto)) > _INVOLVED)
    part = onto[np.ix_(involved, involved)]
    count, labels = connected_components(np.abs(part) > _INVOLVED**2, directed=False)
    combinations = []
    same_size = 0.01  # components of a vector that differ by less are one common factor
    for label in range(count):
        own = labels == label
        shares = np.sqrt(np.diag(part)[own])  # of a single combination: the components of its vector
        single = round(float(np.sum(shares**2))) == 1
        combinations.append((involved[own], bool(single and own.sum() > 1 and np.ptp(shares) < same_size)))
    return combinations


def _combinations(
    names: list[str], combinations: Sequence[tuple[IntArray, bool]], perhaps_none: BoolArray
) -> list[str]:
    """Warnings on parameters, mostly several, that change no temperature; not on a resistance that may be none."""
    factor = "if all are multiplied by one factor (resistances: divided), no temperature changes; fix one of them"
    several = "these data don't determine this combination; fix one of them or measure more"
    alone = "these data don't determine it; fix it or measure more"
    warnings = []
    for members, common_factor in combinations:
        if len(members) > 1 or not perhaps_none[members[0]]:
            said = factor if common_factor else several if len(members) > 1 else alone
            warnings.append(f"{', '.join(names[row] for row in members)}: {said}")
    return warnings


def _single_parameters(
    problem: Problem,
    z: FloatArray,
    names: list[str],
    spread: FloatArray,
    in_combination: BoolArray,
    perhaps_none: BoolArray,
) -> list[str]:
    """Warnings on parameters at a bound, or with a standard error that leaves them open."""
    (below, above), values = problem.at_bounds(z), problem.point(z).values
    warnings = []
    undetermined = 0.7  # standard error of a logarithm, a factor of two, above which a value means little
    for row, name in enumerate(names):
        parameter = problem.model.parameters[problem.free[row]]
        unit = parameter.declared.unit_behind
        if perhaps_none[row]:
            least = problem.point(z - 2 * spread[row] * (np.arange(len(z)) == row)).values[problem.free[row]]
            detail = f"; {least:.2g} K/W at least" if least > parameter.declared.bounds[0] else ""
            warnings.append(f"{name}: these data don't show any heat flow there{detail}")
        elif (
            (below[row] or above[row])
            and not _is_off(parameter, values[problem.free[row]])  # an amplitude may end where its effect vanishes
            and not in_combination[row]
        ):
            bounds = parameter.declared.bounds
            ended = f"ends at its bound, {bounds[int(above[row])]:g} ({bounds[0]:g} to {bounds[1]:g}{unit})"
            warnings.append(f"{name}: {ended}")
        elif parameter.declared.prior is not None and _is_far(parameter.declared, values[problem.free[row]]):
            mean, deviation = parameter.declared.prior
            value = values[problem.free[row]]
            said = f"{abs(value - mean) / deviation:.2g} standard deviations from its prior"
            warnings.append(f"{name}: {value:.3g}{unit} is {said}, {mean:g} ± {deviation:g}{unit}")
        elif spread[row] > undetermined and not in_combination[row] and parameter.logarithmic:
            warnings.append(
                f"{name}: not determined by these data (a factor of {np.exp(min(spread[row], 20)):.2g} either way)"
            )
        elif not parameter.logarithmic and abs(z[row]) < 2 * spread[row] and not in_combination[row]:
            warnings.append(f"{name}: not significantly different from zero")
    return warnings


def _is_far(declared: Parameter, value: float) -> bool:
    """Whether a value is far off what somebody knows of it; the priors of an effect's size and shape only hold them
    where the data say nothing.
    """
    if declared.prior is None or declared.off is not None or declared.grid:
        return False
    mean, deviation = declared.prior
    far = 3.0  # standard deviations of a prior: chance leads so far once in 370 times
    return abs(value - mean) > far * deviation


def _is_off(parameter: ParameterInstance, value: float) -> bool:
    """Whether an amplitude ended where its effect vanishes, which is a bound but no cause for a warning."""
    off = parameter.declared.off
    nearly_off = 1e-4  # of what is typical
    return off is not None and abs(value - off) < nearly_off * abs(parameter.declared.typical)
