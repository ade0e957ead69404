"""Held-out runs that a fitted model predicts badly: which one parameter would have to differ in such a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from lptn.arrays import FloatArray
from lptn.compare import Errors, Prediction, predict
from lptn.diagnose.differing import CLEARLY, Cause, Differing
from lptn.diagnose.lack import BLOCK, NEGLIGIBLE, TOO_MUCH, cost_of_noise
from lptn.diagnose.other_runs_search import Search, possible, search_of
from lptn.diagnose.refit import TIE, refit, worse_by
from lptn.evidence import Part
from lptn.identify import Fit, Problem
from lptn.model import Model
from lptn.threads import one_blas_thread

_HALF = 0.5  # of the error beyond noise must go before a cause is named
_COMPARABLE = 0.5  # share of the best gain below which nothing makes two causes alike
_LEVEL = 1.0  # difference of criteria that says nothing at all
_PROMISING = 0.5  # share of the best likeness to the error, to first order, below which no size is searched


@dataclass(frozen=True)
class _Trial:
    """A candidate at its best amplitude: the run's fit with it, and its error behind the opening [K]."""

    search: Search
    amplitude: float
    fit: Fit
    rmse: float


@one_blas_thread
def runs_that_differ(fit: Fit, parts: Sequence[Part]) -> list[Differing]:
    """For each run that a fitted model predicts clearly worse than it fits: what would have to differ in it.

    Every effect that may differ from run to run is tried at each of its places, confined to that run, all other
    parameters held. The initial states come from the run's opening as in any prediction; the amplitude is fitted on
    the whole run. Causes are compared by Schwarz's criterion [Schwarz1978], counted in independent residuals; between
    rivals that explain the run alike, a fit of all runs together decides, every parameter let go.

    Args:
        fit: the fitted model.
        parts: held-out runs; the rest of a run whose beginning was fitted is left out, since one parameter can't
            differ within a run.

    Returns:
        The runs whose error is beyond noise and clearly beyond that of the fitted runs; others are not mentioned.

    Raises:
        InputError: a run lacks an input of the model.
    """
    fitted = {driven.run.source for driven in fit.problem.drives}
    step = fit.problem.drives[0].run.step
    found = (_differing(fit, part.coarsened(step)) for part in parts if part.run.source not in fitted)
    return [each for each in found if each is not None]


def _differing(fit: Fit, part: Part) -> Differing | None:
    before = predict(fit.model, part, fit.problem.sigma)
    if not _stands_out(fit, before):
        return None
    base = _as_fit(fit, fit.model, before, ())
    searches = [search_of(fit.model, part, each, fit.problem.sigma) for each in possible(fit.model.network, part)]
    least = _PROMISING * max((each.likeness for each in searches), default=0.0)
    trials = [_tried(fit, each) for each in searches if each.likeness >= least]
    causes = (_cause(each) for each in _best_and_alike(fit, before, base, trials))
    return Differing(part.run.name, Errors.of(before.error).rmse, fit.rmse, tuple(causes))


def _stands_out(fit: Fit, before: Prediction) -> bool:
    """Whether at some node one-minute means of the error are beyond noise and clearly beyond the fitted runs'."""
    size = max(1, round(BLOCK / before.drive.run.step))
    for row in range(len(fit.model.nodes)):
        squares = _block_squares(before.error[row], size)
        if not squares.size:
            continue
        of_fit = [
            _block_squares(np.where(driven.counted, error, np.nan)[row], size)
            for driven, error in zip(fit.problem.drives, fit.residuals, strict=True)
        ]
        usual = float(np.concatenate(of_fit).mean()) if any(each.size for each in of_fit) else 0.0
        # A sensor's steps do not average out while the temperature stands.
        noise = fit.noise.white[row] ** 2 / size + fit.noise.step[row] ** 2 / 12
        chance = noise * float(chi2.ppf(0.95, squares.size)) / squares.size
        if squares.mean() > max(CLEARLY**2 * usual, TOO_MUCH * chance, NEGLIGIBLE**2):
            return True
    return False


def _block_squares(error: FloatArray, size: int) -> FloatArray:
    """Squared means of the error over full blocks of readings that count, shape (blocks,)."""
    counted = error[np.isfinite(error)]
    return np.asarray(counted[: counted.size // size * size].reshape(-1, size).mean(axis=1) ** 2)


def _tried(fit: Fit, search: Search) -> _Trial:
    amplitude = search.best()
    explained = search.at(amplitude)
    after = predict(explained, search.part, search.sigma)
    done = _as_fit(fit, explained, after, (search.index,))
    return _Trial(search, amplitude, done, Errors.of(after.error).rmse)


def _as_fit(fit: Fit, model: Model, found: Prediction, free: tuple[int, ...]) -> Fit:
    """A predicted run as a fit of so many parameters to all of its readings, to be compared with others."""
    driven = found.drive.count((float("-inf"), float("inf")))
    problem = Problem(model, [driven], fit.problem.sigma, free=free)
    error = (found.readings - driven.measured) / fit.problem.sigma[:, None]
    cost = 0.5 * float(np.sum(error[driven.counted] ** 2))
    z = problem.guess(model.values, [found.states[:, 0]])
    return Fit(model, problem, z, cost, fit.noise, 0, "converged")


def _best_and_alike(fit: Fit, before: Prediction, base: Fit, trials: Sequence[_Trial]) -> list[_Trial]:
    """Those that halve the error beyond noise and pay for themselves: the best, and what explains the run as well."""
    noise = cost_of_noise(base)
    most = noise + _HALF**2 * max(base.cost - noise, 0.0)
    ranked = sorted((each for each in trials if each.fit.cost <= most), key=lambda each: each.fit.cost)
    if not ranked or worse_by(base, ranked[0].fit) <= 0:
        return []
    best = ranked[0].fit
    # One count of independent residuals, that of the best, for all.
    near = min(TIE, (1 - _COMPARABLE) * worse_by(base, best))
    kept = [each for each in ranked if worse_by(each.fit, best) <= near]
    return kept if len(kept) == 1 else _decided_together(fit, before, kept)


def _decided_together(fit: Fit, before: Prediction, kept: list[_Trial]) -> list[_Trial]:
    """Causes by what they explain of all runs together, the other parameters let go: those are unsure themselves."""
    whole = _with_fitted(fit, before)
    declared = [each.search.candidate.declaration(each.amplitude, each.search.candidate.shapes[0]) for each in kept]
    done = [refit(whole, each) for each in declared]
    best = min(done, key=lambda each: each.cost)
    behind = [worse_by(each, best) for each in done]
    order = sorted(zip(behind, kept, strict=True), key=lambda each: each[0])
    # All sensors that read high by as much are a warm room: of equals, what supposes the fewest faults comes first.
    level = sorted((each for by, each in order if by <= _LEVEL), key=lambda each: len(each.search.candidate.places))
    return [*level, *(each for by, each in order if _LEVEL < by <= TIE)]


def _with_fitted(fit: Fit, before: Prediction) -> Fit:
    """The fitted runs and one more, at the fitted values, to be fitted further."""
    driven = before.drive.count((float("-inf"), float("inf")))
    problem = Problem(fit.model, [*fit.problem.drives, driven], fit.problem.sigma, fit.problem.mirror_weight)
    z = problem.guess(fit.model.values, [*fit.point.starts, before.states[:, 0]])
    return Fit(fit.model, problem, z, problem.cost(z), fit.noise, 0, "converged")


def _cause(trial: _Trial) -> Cause:
    candidate, size = trial.search.candidate, trial.amplitude
    return Cause(candidate.effect.key, candidate.pattern, size, trial.rmse, trial.search.in_words(size))
