"""The last steps to an optimum that is near: Levenberg-Marquardt, each step the exact optimum within the bounds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from scipy.optimize import lsq_linear

from lptn.arrays import FloatArray
from lptn.identify.evaluator import Evaluator

Ending = Literal["converged", "given up", "stopped"]

_GAIN = 1e-6  # of the cost, a log-likelihood: a thousandth of a standard error away from the optimum
PRECISION = 3e-8  # of the cost: where the model misses much, so little is beyond all meaning
_FAR = 1e6  # no step in the search's coordinates is as long
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-7, 1e3  # relative to the Hessian's diagonal
_HOPE, _TRIED = 3.0, 3  # times the gain that the quadratic model promises, after so many steps
_POOR, _GOOD = 0.1, 0.7  # shares of the promised gain that a step kept


def polish(
    evaluator: Evaluator,
    z: FloatArray,
    most: int,
    stopped: Callable[[], bool],
    step_taken: Callable[[], None],
    rival: float = np.inf,
    precision: float = PRECISION,
) -> Ending:
    """Step from `z` until nothing is left to gain; the evaluator keeps the best point.

    An interior-point search shrinks its barrier to the last digit, at a full evaluation each time. Near the optimum
    the quadratic model is good and its bounded optimum is found in milliseconds: a few steps do. Where the valley is
    curved, damping keeps them short.

    Args:
        evaluator: of the problem.
        z: where to start, within the bounds.
        most: how many steps to take at most.
        stopped: asked before each step.
        step_taken: called after each step.
        rival: a cost to beat, scaled as the evaluator's; a search that has no hope of it ends.
        precision: share of the cost that is not worth another step.

    Returns:
        `"converged"`: the optimum was reached; `"given up"`: it is no match for the rival; `"stopped"` before either.
    """
    lower, upper = evaluator.problem.bounds()
    damping = 0.0
    for taken in range(most):
        if stopped():
            return "stopped"
        gradient, hessian = evaluator.derivatives(z)
        if not np.isfinite(hessian).all():
            return "stopped"
        enough = max(_GAIN * evaluator.scale, precision * evaluator.cost(z))
        free = _bounded_step(gradient, hessian, lower - z, upper - z)
        promised, before = _promised(gradient, hessian, free), evaluator.cost(z)
        if promised < enough:
            return "converged"
        if taken >= _TRIED and before - _HOPE * promised > rival:
            return "given up"
        following, damping = _downhill(evaluator, z, (gradient, hessian), free, damping)
        if following is None:  # rounding in the simulation hides what is left, or the model is no guide here
            return "converged" if promised < 100 * enough else "stopped"
        step_taken()
        if before - evaluator.cost(following) < 0.01 * enough:
            return "converged"
        z = following
    return "stopped"


def _downhill(
    evaluator: Evaluator, z: FloatArray, model: tuple[FloatArray, FloatArray], free: FloatArray, damping: float
) -> tuple[FloatArray | None, float]:
    """A point that keeps a fair share of the gain promised, and the damping to go on with; `None` if there is none."""
    gradient, hessian = model
    lower, upper = evaluator.problem.bounds()
    before, diagonal = evaluator.cost(z), np.diag(np.diag(hessian))
    while damping <= _MOST_DAMPING:
        step = free if damping == 0 else _bounded_step(gradient, hessian + damping * diagonal, lower - z, upper - z)
        kept = (before - evaluator.cost(z + step)) / max(_promised(gradient, hessian, step), 1e-300)
        if kept > _POOR:
            if kept > _GOOD:
                damping = 0.0 if damping < _LEAST_DAMPING else damping / 10
                step = _further(evaluator, z, step)
            return z + step, damping
        damping = max(4 * damping, _FIRST_DAMPING)
    return None, damping


def _further(evaluator: Evaluator, z: FloatArray, step: FloatArray) -> FloatArray:
    """The step, doubled as long as that gains: simulations cost a tenth of derivatives."""
    lower, upper = evaluator.problem.bounds()
    while True:
        longer = np.clip(z + 2 * step, lower, upper) - z
        if not evaluator.cost(z + longer) < evaluator.cost(z + step):
            return step
        step = longer


def _promised(gradient: FloatArray, hessian: FloatArray, step: FloatArray) -> float:
    """What the quadratic model says that a step gains."""
    return -float(gradient @ step + 0.5 * step @ hessian @ step)


def _bounded_step(gradient: FloatArray, hessian: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """The optimum of the quadratic model within the bounds, shape (size,)."""
    free = np.asarray(np.linalg.solve(hessian, -gradient), dtype=float)
    if np.all(free >= lower) and np.all(free <= upper):
        return free
    factor = np.linalg.cholesky(hessian)
    side = np.linalg.solve(factor, -gradient)
    # The solver wants finite bounds, and a little room between them.
    low, high = np.maximum(lower, -_FAR), np.minimum(upper, _FAR)
    found = lsq_linear(factor.T, side, (low, np.maximum(high, low + 1e-12)), method="bvls")
    return np.clip(found.x, lower, upper)
