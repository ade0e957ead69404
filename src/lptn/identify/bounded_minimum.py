"""The least of a convex quadratic within bounds."""

from __future__ import annotations

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray

_ROUNDING = 1e-12  # of a slope's terms


def bounded_minimum(gradient: FloatArray, hessian: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Where gᵀx + ½ xᵀHx is least within bounds, shape (size,).

    By guessing which unknowns end at a bound: those that a step leaves beyond one do, those that the slope there pushes
    off it don't [Hintermueller2003]. Guesses may go round in a circle, where data leave much open; then from the best
    of them step by step, along one face of the bounds after the other [NocedalWright2006, alg. 16.3].

    Args:
        gradient: g, shape (size,).
        hessian: H, symmetric, positive definite, shape (size, size).
        lower: least x, shape (size,).
        upper: largest x, shape (size,).
    """
    below, above = np.zeros((2, len(gradient)), dtype=bool)
    best = np.clip(0.0, lower, upper)
    least = gradient @ best + 0.5 * best @ hessian @ best
    guessed: set[bytes] = set()
    guesses = 30  # of which unknowns end at a bound; in fits seldom more than four are needed
    while len(guessed) < guesses and (key := np.concatenate([below, above]).tobytes()) not in guessed:
        guessed.add(key)
        step, free = np.where(below, lower, np.where(above, upper, 0.0)), ~(below | above)
        _settle(step, free, gradient, hessian)
        slope = gradient + hessian @ step
        guess = np.where(free, step < lower, below & (slope > 0)), np.where(free, step > upper, above & (slope < 0))
        if np.array_equal(guess[0], below) and np.array_equal(guess[1], above):
            return step
        below, above = guess
        within = np.clip(step, lower, upper)
        if (height := gradient @ within + 0.5 * within @ hessian @ within) < least:
            best, least = within, height
    return _along_faces(best, gradient, hessian, lower, upper)


def _settle(x: FloatArray, free: BoolArray, gradient: FloatArray, hessian: FloatArray) -> None:
    """Put the free unknowns where the quadratic is least beside the others."""
    fixed = np.where(free, 0.0, x)
    x[free] = np.linalg.solve(hessian[np.ix_(free, free)], -(gradient + hessian @ fixed)[free])


def _along_faces(
    x: FloatArray, gradient: FloatArray, hessian: FloatArray, lower: FloatArray, upper: FloatArray
) -> FloatArray:
    """The minimum from a point within the bounds: each step goes downhill, and keeps to the bounds that it meets."""
    free = (x > lower) & (x < upper)
    most_faces = 10  # times the number of unknowns: ends what rounding would never end
    for _ in range(most_faces * len(x)):
        goal = x.copy()
        _settle(goal, free, gradient, hessian)
        room = np.where(goal < lower, lower - x, upper - x)
        outside = free & ((goal < lower) | (goal > upper))
        if outside.any():
            shares = np.divide(room, goal - x, out=np.full(len(x), np.inf), where=outside)
            first = int(np.argmin(shares))
            end = lower[first] if goal[first] < lower[first] else upper[first]
            x = np.clip(x + shares[first] * (goal - x), lower, upper)
            x[first], free[first] = end, False
            continue
        x, slope = goal, gradient + hessian @ goal
        inward = np.where(x <= lower, -slope, slope)
        rounding = _ROUNDING * (np.abs(gradient) + np.abs(hessian) @ np.abs(x))
        inward[free | (lower == upper) | (np.abs(slope) <= rounding)] = 0.0
        if inward.max(initial=0.0) <= 0.0:
            break
        free[int(np.argmax(inward))] = True
    return x
