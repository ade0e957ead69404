"""Runs cut into stretches so long that what is left of one says little about the next."""

from __future__ import annotations

import numpy as np

from lptn.arrays import FloatArray, IntArray
from lptn.identify import Fit
from lptn.simulate import Drive

_STRETCH, _STRETCHES = 600.0, 8  # s; a run is cut into so many at least
_DRAWS, _RARE = 5000, 0.01


def stretches(driven: Drive) -> IntArray:
    """The number of the stretch that each step of a run lies in, shape (n,)."""
    size = max(1, min(round(_STRETCH / driven.run.step), len(driven) // _STRETCHES))
    return np.arange(len(driven)) // size


def misfits(fit: Fit) -> FloatArray:
    """Sum of squared weighted residuals of each stretch of each run, shape (stretches,)."""
    found = []
    for driven, error in zip(fit.problem.drives, fit.residuals, strict=True):
        squares = np.where(driven.counted, error / fit.problem.sigma[:, None], 0.0) ** 2
        found.append(np.bincount(stretches(driven), squares.sum(axis=0)))
    return np.concatenate(found)


def clearly_differ(one: Fit, other: Fit) -> bool:
    """Whether two fits to the same runs differ by more than chance: signs of the stretches' differences, drawn anew.

    Fits that are equally good win as many stretches as they lose. A difference that one stretch makes alone is no
    evidence, however large; one that nearly all stretches share is, however uneven.

    Source: Fisher's randomisation test [Fisher1935], on stretches in place of independent observations.
    """
    differences = misfits(one) - misfits(other)
    signs = np.random.default_rng(0).choice((-1.0, 1.0), (_DRAWS, len(differences)))
    by_chance = np.abs(signs @ differences) >= abs(differences.sum()) * (1 - 1e-12)
    return bool(by_chance.mean() <= _RARE)
