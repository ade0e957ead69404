"""A model fitted to the runs that are there to fit, and judged on those held out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lptn.basics.errors import InputError
from lptn.identify.comparison import Errors, predict
from lptn.identify.data import DataSplit, Segment
from lptn.identify.fitting import Checkpoint, Fit, Kept, fit
from lptn.identify.problem import Point
from lptn.identify.solvers import Progress
from lptn.model.model import Model
from lptn.simulate.simulation import BoundRun, bind

_SEARCH_STEP = 10.0  # s; averages that are long enough to compare regularisers
_MIRROR_WEIGHTS = (0.0, *(10.0**power for power in range(1, 7)))


def fit_parts(
    model: Model,
    parts: Sequence[Segment],
    near: Point | None = None,
    *,
    symmetry_penalty: float = 0.0,
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
    bound_runs = _drives(model, parts)
    guess, starts = (None, None) if near is None else (near.values, near.starts)
    return fit(model, bound_runs, symmetry_penalty=symmetry_penalty, guess=guess, starts=starts, progress=progress)


def fit_parts_again(
    model: Model,
    parts: Sequence[Segment],
    checkpoint: Checkpoint,
    *,
    near: Point | None = None,
    symmetry_penalty: float = 0.0,
    progress: Progress | None = None,
) -> Fit:
    """Fit a model as `fit_parts` does, from where an earlier attempt was cut off, and so that this one may be.

    Args:
        model: the model.
        parts: the runs.
        checkpoint: keeps the best point while the search runs, and if Ctrl-C ends it; empty once the fit is done.
        near: a solution on coarser data, to start from where nothing was kept.
        mirror_weight: λ of the left-right regulariser.
        progress: called after each iteration.
    """
    kept = checkpoint.load(model, len(parts))
    start = kept.point if kept else near
    done = fit(
        model,
        _drives(model, parts),
        symmetry_penalty=symmetry_penalty,
        guess=start.values if start else None,
        starts=start.starts if start else None,
        averaged=bool(kept and kept.averaged),
        progress=progress,
        keep=lambda point, averaged: checkpoint.offer(model, Kept(point, averaged)),
    )
    if done.status == "interrupted":
        checkpoint.save(model, Kept(done.point, averaged=False))
    else:
        checkpoint.remove()
    return done


def _drives(model: Model, parts: Sequence[Segment]) -> list[BoundRun]:
    return [bind(model, part.run).count(part.counted).until(part.counted[1]) for part in parts]


@dataclass(frozen=True)
class Judged:
    """A fit, its errors on held-out runs, and the left-right weights that were tried for it."""

    fit: Fit
    holdout: Errors | None
    trials: tuple[SymmetryTrial, ...]


def fit_split(
    model: Model,
    data: DataSplit,
    symmetry_penalty: float | Literal["auto"] = 0.0,
    *,
    checkpoint: Callable[[float], Checkpoint] | None = None,
    report: Callable[[str], None] = lambda _: None,
) -> Judged:
    """Fit the runs that are there to fit, and look at those held out.

    Args:
        model: the model.
        data: the runs by their jobs.
        mirror_weight: λ of the left-right regulariser; `"auto"` for the one best on held-out runs.
        checkpoint: where the best point is kept, for the λ that is used; by default nowhere.
        report: told what is being done.

    Raises:
        InputError: λ can't be chosen from these runs, or a run lacks an input of the model.
    """
    trials = symmetry_trials(model, data, report=report) if symmetry_penalty == "auto" else []
    best = min(trials, key=lambda each: each.holdout.rmse) if trials else None
    weight = best.weight if best else float(symmetry_penalty)
    near = best.fit.point if best else None

    def progress(number: int, rms: float) -> None:
        report(f"fitting: iteration {number}, weighted residual {rms:.4g}")

    if checkpoint is None:
        done = fit_parts(model, data.fit, near, symmetry_penalty=weight, progress=progress)
    else:
        kept = checkpoint(weight)
        done = fit_parts_again(model, data.fit, kept, near=near, symmetry_penalty=weight, progress=progress)
    return Judged(done, holdout_errors(done, data.holdout), tuple(trials))


def holdout_errors(done: Fit, parts: Sequence[Segment]) -> Errors | None:
    """Errors of a fitted model on runs that it never saw, `None` without any."""
    if not parts:
        return None
    errors = [predict(done.model, part, done.problem.sigma).error.ravel() for part in parts]
    return Errors.of(np.concatenate(errors))


@dataclass(frozen=True)
class SymmetryTrial:
    """One λ of the left-right regulariser: the fit with it, and its errors on held-out runs."""

    weight: float
    fit: Fit
    holdout: Errors


def symmetry_trials(
    model: Model,
    data: DataSplit,
    weights: Sequence[float] = _MIRROR_WEIGHTS,
    report: Callable[[str], None] = lambda _: None,
) -> list[SymmetryTrial]:
    """Fits under ever stronger pulls of left and right parameters towards each other, on averages of 10 s.

    The one with the least held-out error is the λ to take: `min(trials, key=lambda each: each.holdout.rmse)`.

    Raises:
        InputError: nothing is held out, or no free parameter has a mirror image.

    Source: [QuadrupedLPTN, eq. 14] (there λ is not chosen by anything that is said).
    """
    names = {model.parameters[index].name for index in model.free}
    if not any(model.parameters[index].mirror in names for index in model.free):
        expected = 'free parameters with share = "sides" on a left and a right joint'
        raise InputError(model.network.origin, "mirror weight", "no left-right pair to weigh", expected)
    if not data.holdout:
        raise InputError("command line", "--mirror-weight auto", "nothing held out", "--holdout or --holdout-after")
    coarse = data.coarsened(_SEARCH_STEP)
    trials: list[SymmetryTrial] = []
    for weight in weights:
        report(f"left-right weight {weight:g}")
        near = trials[-1].fit.point if trials else None
        done = fit_parts(model, coarse.fit, near, symmetry_penalty=weight)
        errors = holdout_errors(done, coarse.holdout)
        trials.append(SymmetryTrial(weight, done, errors or Errors.of(np.zeros(0))))
    return trials
