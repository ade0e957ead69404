"""A model fitted to the fit data and judged on held-out data; the symmetry penalty chosen by held-out data.

And how far readings may be off what such a model predicts, with nothing missing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.identify.comparison import Errors, Prediction, errors_of, predict
from lptn.identify.data import DataSplit, Segment
from lptn.identify.fitting import Checkpoint, Fit, fit
from lptn.identify.problem import Point
from lptn.identify.solvers import PRECISION, Progress
from lptn.model.model import Model
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import sensitivity_windows

_SYMMETRY_PENALTIES = (0.0, *(10.0**power for power in range(1, 7)))  # λ, from no pull to equal left and right


def fit_segments(
    model: Model,
    segments: Sequence[Segment],
    near: Point | None = None,
    *,
    symmetry_penalty: float = 0.0,
    checkpoint: Checkpoint | None = None,
    progress: Progress | None = None,
    precision: float = PRECISION,
) -> Fit:
    """Fit a model to the evaluation windows of runs.

    Args:
        model: the model.
        segments: the runs.
        near: a solution on coarser data, to start from; an attempt that was cut off comes first.
        symmetry_penalty: λ of the penalty on left-right differences.
        checkpoint: keeps the best point while the search runs, and if Ctrl-C ends it; empty once the fit is done.
        progress: called after each iteration.
        precision: share of the cost that is not worth another step.
    """
    bound_runs = [bind(model, s.run).count(s.evaluation).until(s.evaluation[1]) for s in segments]
    saved = checkpoint.load(model, len(segments)) if checkpoint else None
    done = fit(
        model,
        bound_runs,
        symmetry_penalty=symmetry_penalty,
        guess=saved or near,
        progress=progress,
        keep=None if checkpoint is None else lambda point: checkpoint.offer(model, point),
        precision=precision,
    )
    if checkpoint and done.status == "interrupted":
        checkpoint.save(model, done.point)
    elif checkpoint:
        checkpoint.remove()
    return done


def fit_split(
    model: Model,
    data: DataSplit,
    symmetry_penalty: float | Literal["auto"] = 0.0,
    *,
    checkpoint: Callable[[float], Checkpoint] | None = None,
    report: Callable[[str], None] = lambda _: None,
) -> tuple[Fit, list[SymmetryTrial]]:
    """Fit the fit data, with a symmetry penalty that held-out data choose if that is asked for.

    Args:
        model: the model.
        data: the runs by their jobs.
        symmetry_penalty: λ of the penalty on left-right differences; `"auto"` for the one best on held-out runs.
        checkpoint: where the best point is kept, for the λ that is used; by default nowhere.
        report: called with a sentence on what is being done.

    Returns:
        The fit, and what was tried to choose λ; nothing where λ is given.

    Raises:
        InputError: λ can't be chosen from these runs, or a run lacks an input of the model.
    """
    trials = symmetry_trials(model, data, report=report) if symmetry_penalty == "auto" else []
    best = min(trials, key=lambda trial: trial.holdout.rmse) if trials else None
    penalty = best.symmetry_penalty if best else float(symmetry_penalty)

    def progress(number: int, rms: float) -> None:
        report(f"fitting: iteration {number}, weighted residual {rms:.4g}")

    done = fit_segments(
        model,
        data.fit,
        best.fit.point if best else None,
        symmetry_penalty=penalty,
        checkpoint=checkpoint(penalty) if checkpoint else None,
        progress=progress,
    )
    return done, trials


def holdout_errors(done: Fit, segments: Sequence[Segment]) -> Errors | None:
    """Errors of a fitted model on runs that it never saw, `None` without any."""
    return errors_of([predict(done.model, segment) for segment in segments]) if segments else None


@dataclass(frozen=True)
class SymmetryTrial:
    """One λ of the penalty on left-right differences: the fit with it, and its errors on held-out runs."""

    symmetry_penalty: float
    fit: Fit
    holdout: Errors


def symmetry_trials(
    model: Model,
    data: DataSplit,
    penalties: Sequence[float] = _SYMMETRY_PENALTIES,
    report: Callable[[str], None] = lambda _: None,
) -> list[SymmetryTrial]:
    """Fits under ever stronger pulls of left and right parameters towards each other, on averages of 10 s.

    The λ to take has the least held-out error: `min(trials, key=lambda trial: trial.holdout.rmse)`.

    Raises:
        InputError: nothing is held out, or no free parameter has a mirror image.

    Source: [QuadrupedLPTN, eq. 14] (there λ is not chosen by anything that is said).
    """
    names = {model.parameters[index].name for index in model.free}
    if not any(model.parameters[index].mirror in names for index in model.free):
        expected = 'free parameters with share = "sides" on a left and a right joint'
        raise InputError(model.network.origin, "symmetry penalty", "no left-right pair to weigh", expected)
    if not data.holdout:
        raise InputError("command line", "--symmetry-penalty auto", "nothing held out", "--holdout or --holdout-after")
    search_step = 10.0  # s; averages so long are enough to compare penalties
    coarse = data.coarsened(search_step)
    trials: list[SymmetryTrial] = []
    for penalty in penalties:
        report(f"symmetry penalty {penalty:g}")
        near = trials[-1].fit.point if trials else None
        done = fit_segments(model, coarse.fit, near, symmetry_penalty=penalty)
        trials.append(SymmetryTrial(penalty, done, holdout_errors(done, coarse.holdout) or Errors.of(np.zeros(0))))
    return trials


@dataclass(frozen=True)
class Spread:
    """Standard deviations of readings about a prediction.

    Args:
        time: moments of the run [s], (m,).
        size: there [K], (nodes, m).
    """

    time: FloatArray
    size: FloatArray


def spread_of(fitted: Fit, prediction: Prediction, most: int = 1000) -> Spread:
    """How far a reading may be off what a fit predicts: by what it leaves open of the parameters, and by noise.

    To first order in the parameters; initial temperatures are taken as they are. What the model lacks is in it as far
    as the parameters' covariance is widened for it.

    Args:
        fitted: the fit.
        prediction: of a run, by its model.
        most: moments of the run at which it is worked out.
    """
    model, bound = fitted.model, prediction.bound
    acting = model.acting_in(bound.run.name)
    columns = [k for k, index in enumerate(fitted.free) if index in acting]
    slope = fitted.problem.slope(model.values)[columns]
    covariance = fitted.uncertainty.covariance[np.ix_(columns, columns)] * np.outer(slope, slope)
    moments = np.unique(np.linspace(0, len(bound) - 1, most).astype(int))
    variances, chosen, start = [], [fitted.free[k] for k in columns], prediction.path.states[:, 0]
    for window, moved in sensitivity_windows(model, bound, model.values, chosen, start):
        inside = moments[(moments >= window.start) & (moments < window.stop)] - window.start
        by = moved.by_parameter[:, inside]
        variances.append(np.einsum("nkp,nkp->nk", by @ covariance, by))
    variance = np.maximum(np.concatenate(variances, axis=1), 0.0)
    return Spread(bound.run.time[moments], np.sqrt(variance + fitted.noise.floor[:, None] ** 2))
