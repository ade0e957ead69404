"""The least of a convex quadratic within bounds."""

from __future__ import annotations

import numpy as np

from lptn.basics.arrays import FloatArray

_ACTIVE_SETS = 30  # tried; in fits seldom more than four are


def bounded_minimum(gradient: FloatArray, hessian: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Where gᵀx + ½ xᵀHx is least within bounds, shape (size,).

    By guessing which unknowns end at a bound: those that a step leaves beyond one do, those that the slope there pushes
    off it don't [Hintermueller2003]. Where the guesses go round in a circle, SciPy's slower search decides.

    Args:
        gradient: g, shape (size,).
        hessian: H, symmetric, positive definite, shape (size, size).
        lower: least x, shape (size,).
        upper: largest x, shape (size,).
    """
    below, above = np.zeros((2, len(gradient)), dtype=bool)
    for _ in range(_ACTIVE_SETS):
        step = np.where(below, lower, np.where(above, upper, 0.0))
        free = ~(below | above)
        step[free] = np.linalg.solve(hessian[np.ix_(free, free)], -(gradient + hessian @ step)[free])
        slope = gradient + hessian @ step
        guess = np.where(free, step < lower, below & (slope > 0)), np.where(free, step > upper, above & (slope < 0))
        if np.array_equal(guess[0], below) and np.array_equal(guess[1], above):
            return step
        below, above = guess
    from scipy.optimize import lsq_linear  # heavy, and seldom needed

    factor = np.linalg.cholesky(hessian)
    side = np.linalg.solve(factor, -gradient)
    # The solver wants a little room between bounds.
    solution = lsq_linear(factor.T, side, (lower, np.maximum(upper, lower + 1e-12)), method="bvls")
    return np.clip(solution.x, lower, upper)
