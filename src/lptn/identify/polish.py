"""The last steps to an optimum that is near: Gauss-Newton, each step the exact optimum within the bounds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import lsq_linear

from lptn.arrays import FloatArray
from lptn.identify.evaluator import Evaluator

_GAIN = 1e-6  # of the cost, a log-likelihood: a thousandth of a standard error away from the optimum
_SHARE = 3e-8  # of the cost: where the model misses much, so little is beyond all meaning
_HALVINGS = 4
_MOST = 15
_FAR = 1e6  # no step in the search's coordinates is as long


def polish(
    evaluator: Evaluator,
    z: FloatArray,
    most: int,
    stopped: Callable[[], bool],
    step_taken: Callable[[], None],
) -> bool:
    """Step from `z` until nothing is left to gain; the evaluator keeps the best point.

    An interior-point search shrinks its barrier to the last digit, at a full evaluation each time. Near the optimum
    the quadratic model is good and its bounded optimum is found in milliseconds: a few steps do.

    Args:
        evaluator: of the problem.
        z: where to start, within the bounds.
        most: how many steps to take at most.
        stopped: asked before each step.
        step_taken: called after each step.

    Returns:
        Whether the optimum was reached; not where the start was too far away.
    """
    lower, upper = evaluator.problem.bounds()
    for _ in range(min(most, _MOST)):
        if stopped():
            return False
        gradient, hessian = evaluator.derivatives(z)
        if not np.isfinite(hessian).all():
            return False
        step = _bounded_step(gradient, hessian, lower - z, upper - z)
        gain = -float(gradient @ step + 0.5 * step @ hessian @ step)
        enough = max(_GAIN * evaluator.scale, _SHARE * evaluator.cost(z))
        if gain < enough:
            return True
        following = _downhill(evaluator, z, step, gain)
        if following is None:
            return gain < 100 * enough  # rounding in the simulation hides what is left
        z = following
        step_taken()
    return False


def _bounded_step(gradient: FloatArray, hessian: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """The optimum of the quadratic model within the bounds, shape (size,)."""
    factor = np.linalg.cholesky(hessian)
    free = np.asarray(np.linalg.solve(hessian, -gradient), dtype=float)
    if np.all(free >= lower) and np.all(free <= upper):
        return free
    side = np.linalg.solve(factor, -gradient)
    # The solver wants finite bounds, and a little room between them.
    low, high = np.maximum(lower, -_FAR), np.minimum(upper, _FAR)
    found = lsq_linear(factor.T, side, (low, np.maximum(high, low + 1e-12)), method="bvls")
    return np.clip(found.x, lower, upper)


def _downhill(evaluator: Evaluator, z: FloatArray, step: FloatArray, gain: float) -> FloatArray | None:
    """A point along the step that keeps a fair share of the promised gain, `None` if there is none."""
    before = evaluator.cost(z)
    for halving in range(_HALVINGS):
        share = 0.5**halving
        following = z + share * step
        if evaluator.cost(following) <= before - 0.25 * share * gain:
            return following
    return None
