"""A model fitted to the runs that are there to fit, and judged on those held out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lptn.compare import Errors, predict
from lptn.errors import InputError
from lptn.evidence import Evidence, Part
from lptn.identify import Fit, Point, Progress, fit
from lptn.model import Model
from lptn.simulate import drive

_SEARCH_STEP = 10.0  # s; averages that are long enough to compare regularisers
_MIRROR_WEIGHTS = (0.0, *(10.0**power for power in range(1, 7)))


def fit_parts(
    model: Model,
    parts: Sequence[Part],
    near: Point | None = None,
    *,
    mirror_weight: float = 0.0,
    progress: Progress | None = None,
) -> Fit:
    """Fit a model to the counted stretches of runs.

    Args:
        model: the model.
        parts: the runs.
        near: a solution on coarser data, to start from.
        mirror_weight: λ of the left-right regulariser.
        progress: called after each iteration.
    """
    drives = [drive(model, part.run).count(part.counted).until(part.counted[1]) for part in parts]
    guess, starts = (None, None) if near is None else (near.values, near.starts)
    return fit(model, drives, mirror_weight=mirror_weight, guess=guess, starts=starts, progress=progress)


def holdout_errors(done: Fit, parts: Sequence[Part]) -> Errors | None:
    """Errors of a fitted model on runs that it never saw, `None` without any."""
    if not parts:
        return None
    errors = [predict(done.model, part, done.problem.sigma).error.ravel() for part in parts]
    return Errors.of(np.concatenate(errors))


@dataclass(frozen=True)
class MirrorTrial:
    """One λ of the left-right regulariser: the fit with it, and its errors on held-out runs."""

    weight: float
    fit: Fit
    holdout: Errors


def mirror_trials(
    model: Model,
    data: Evidence,
    weights: Sequence[float] = _MIRROR_WEIGHTS,
    report: Callable[[str], None] = lambda _: None,
) -> list[MirrorTrial]:
    """Fits under ever stronger pulls of left and right parameters towards each other, on averages of 10 s.

    The one with the least held-out error is the λ to take: `min(trials, key=lambda each: each.holdout.rmse)`.

    Raises:
        InputError: nothing is held out, or no free parameter has a mirror image.

    Source: source S0, row E14 (there λ is not chosen by anything that is said).
    """
    names = {model.unknowns[index].name for index in model.free}
    if not any(model.unknowns[index].mirror in names for index in model.free):
        expected = 'free parameters with share = "sides" on a left and a right joint'
        raise InputError(model.network.origin, "mirror weight", "no left-right pair to weigh", expected)
    if not data.holdout:
        raise InputError("command line", "--mirror-weight auto", "nothing held out", "--holdout or --holdout-after")
    coarse = data.coarsened(_SEARCH_STEP)
    trials: list[MirrorTrial] = []
    for weight in weights:
        report(f"left-right weight {weight:g}")
        near = trials[-1].fit.point if trials else None
        done = fit_parts(model, coarse.fit, near, mirror_weight=weight)
        errors = holdout_errors(done, coarse.holdout)
        trials.append(MirrorTrial(weight, done, errors or Errors.of(np.zeros(0))))
    return trials
