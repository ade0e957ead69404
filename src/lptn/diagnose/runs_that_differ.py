"""Held-out runs that a fitted model predicts badly: which one parameter would have to differ in such a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.parameters import Parameter
from lptn.basics.places import EVERYWHERE, in_run
from lptn.basics.processes import one_blas_thread
from lptn.diagnose.candidates import Candidate, candidates
from lptn.diagnose.diagnosis import refit
from lptn.diagnose.fit_statistics import BLOCK, LACKING, NEGLIGIBLE, TIE, cost_of_noise, criterion_difference
from lptn.identify.comparison import Errors, Prediction, predict
from lptn.identify.data import Segment
from lptn.identify.fitting import Fit
from lptn.identify.problem import Problem
from lptn.model.model import Model
from lptn.model.network import Network
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import SimulationError

# --- A held-out run that differs from the fitted ones: what would explain it, in words and for programs ---


CLEARLY = 2.0
"""Times the error on the fitted runs: no model predicts quite as well as it fits."""
_LISTED = 3  # rivals that a sentence can carry


@dataclass(frozen=True)
class Cause:
    """One parameter that may be what differs in a run, and how large it would be there.

    Args:
        effect: key of the effect.
        at: its place: a node, a class, or `"*"`.
        amplitude: its amplitude, in the effect's own unit.
        rmse: error of the run behind its opening with it [K].
        words: what it means, a sentence without its full stop.
    """

    effect: str
    at: str
    amplitude: float
    rmse: float
    words: str


@dataclass(frozen=True)
class Differing:
    """A held-out run that a model predicts clearly worse than it fits, and what would explain it.

    The amplitude was fitted on the run itself, so that `rmse_after` is the error of an explanation and
    not of a prediction.

    Args:
        run: its name.
        rmse_before: error of the prediction behind the run's opening [K].
        rmse_fit: error of the model on the fitted runs [K].
        causes: what explains the run, the best first, then what these data can't tell from it; empty where no one
            parameter removes most of the error.
    """

    run: str
    rmse_before: float
    rmse_fit: float
    causes: tuple[Cause, ...]

    @property
    def effect(self) -> str | None:
        """Key of the effect that explains the run best, `None` without any."""
        return self.causes[0].effect if self.causes else None

    @property
    def at(self) -> str | None:
        """Its place."""
        return self.causes[0].at if self.causes else None

    @property
    def amplitude(self) -> float | None:
        """Its amplitude in this run, in the effect's own unit."""
        return self.causes[0].amplitude if self.causes else None

    @property
    def rmse_after(self) -> float | None:
        """Error of the explained run behind its opening [K]."""
        return self.causes[0].rmse if self.causes else None

    @property
    def indistinguishable(self) -> tuple[Cause, ...]:
        """Causes that these data can't tell from the best."""
        return self.causes[1:]

    def text(self) -> str:
        """The finding in a few sentences."""
        if not self.causes:
            return (
                f"{self.run} is predicted with an error of {short(self.rmse_before)} K, against "
                f"{short(self.rmse_fit)} K on the fitted runs, and no one parameter that may differ from run to run "
                "explains half of it."
            )
        best = self.causes[0]
        told = (
            f"{_sentence(best.words)} With that its error goes from {short(self.rmse_before)} to {short(best.rmse)} K "
            "(the size was fitted on this run: an explanation, not a prediction)."
        )
        if best.rmse > CLEARLY * self.rmse_fit:
            told += f" It does not explain all: the fitted runs are met within {short(self.rmse_fit)} K."
        if not self.indistinguishable:
            return told
        others = "; or: ".join(_told(each.words) for each in self.indistinguishable[:_LISTED])
        more = len(self.indistinguishable) - _LISTED
        return f"{told} The run can't tell that from: {others}{f'; or {more} more' if more > 0 else ''}."

    def as_json(self) -> dict[str, object]:
        """The finding as other tools read it; what is `null` is not known."""
        return {
            "run": self.run,
            "effect": self.effect,
            "at": self.at,
            "amplitude": self.amplitude,
            "rmse_before": self.rmse_before,
            "rmse_after": self.rmse_after,
            "rmse_fit": self.rmse_fit,
            "alike": [
                {"effect": each.effect, "at": each.at, "amplitude": each.amplitude, "rmse_after": each.rmse}
                for each in self.indistinguishable
            ],
            "text": self.text(),
        }


def short(value: float) -> str:
    """Two digits, whole numbers from a hundred on."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.2g}"


def _sentence(words: str) -> str:
    """A sentence that begins and ends as one; a run's name stays as it is."""
    begun = words.replace("in ", "In ", 1) if words.startswith("in ") else words
    return begun if begun.endswith("?") else f"{begun}."


def _told(words: str) -> str:
    """A sentence without the question behind it."""
    return words.rpartition(": ")[0] if words.endswith("?") else words


# --- The size that one effect would need in one run to explain it, everything else of a fitted model held ---


_STEP = 0.05  # of the typical size, for the slope by the amplitude
_TRIES = 25
_EDGE = 1e-3  # relative; so near a bound, the size is only a limit
_PLAIN = "in {run}{at}: {title}, {amplitude}"
_HOPELESS = 1e3  # weighted residual of an amplitude at which the model can't be simulated


@dataclass(frozen=True)
class Search:
    """A candidate in the model, switched off: which of the model's parameters is its amplitude, and what moves.

    Args:
        candidate: effect, place and run.
        model: the fitted model and the candidate.
        index: of the amplitude among the model's parameters.
        segment: the run.
        sigma: standard deviation that weighs each node [K], shape (nodes,).
    """

    candidate: Candidate
    model: Model
    index: int
    segment: Segment
    sigma: FloatArray

    @property
    def declared(self) -> Parameter:
        """The amplitude."""
        return self.model.parameters[self.index].declared

    @cached_property
    def counted(self) -> BoolArray:
        """All readings of the run, shape (nodes, n)."""
        return np.isfinite(bind(self.model, self.segment.run).measured)

    def at(self, value: float) -> Model:
        """The model at an amplitude."""
        values = self.model.values
        values[self.index] = value
        return self.model.with_values(values)

    def residuals(self, value: float) -> FloatArray:
        """Weighted errors of the whole run at an amplitude, shape (readings,), its start found in the opening."""
        try:
            found = predict(self.at(value), self.segment, self.sigma)
        except SimulationError:
            return np.full(int(self.counted.sum()), _HOPELESS)
        return np.asarray(((found.readings - found.bound.measured) / self.sigma[:, None])[self.counted])

    def slope(self, value: float, residuals: FloatArray) -> FloatArray:
        """Derivative by the amplitude, over a step large against what is unsure about the start, shape (readings,)."""
        step = _STEP * abs(self.declared.typical)
        step = step if value + step < self.declared.bounds[1] else -step
        return np.asarray((self.residuals(value + step) - residuals) / step)

    @cached_property
    def likeness(self) -> float:
        """Squared cosine between the error and what a small amplitude removes; 0 where that has the wrong sign."""
        off = self.declared.off or 0.0
        error = self.residuals(off)
        slope = self.slope(off, error)
        along, length = float(error @ slope), float(np.linalg.norm(error) * np.linalg.norm(slope))
        one_sided = self.declared.bounds[0] == off
        return 0.0 if length == 0 or (one_sided and along > 0) else (along / length) ** 2

    def best(self) -> float:
        """The amplitude with the least misfit over the whole run."""
        typical = abs(self.declared.typical)
        lower, upper = (bound / typical for bound in self.declared.bounds)

        def residuals(share: FloatArray) -> FloatArray:
            return self.residuals(typical * float(share[0]))

        def jacobian(share: FloatArray) -> FloatArray:
            slope = self.slope(typical * float(share[0]), residuals(share))
            return np.asarray(typical * slope)[:, None]

        begun = [max(_STEP, lower)]  # a one-sided amplitude can't be searched from its bound
        solved = least_squares(residuals, begun, jac=jacobian, bounds=([lower], [upper]), max_nfev=_TRIES)
        return float(typical * solved.x[0])

    def in_words(self, size: float) -> str:
        """What an amplitude in this run means, by the effect's own sentence."""
        at, effect = self.candidate.pattern, self.candidate.effect
        lower, upper = self.declared.bounds
        most, least = (abs(size - bound) <= _EDGE * abs(bound) for bound in (upper, lower))
        more, less = effect.in_one_run
        return ((more if size >= 0 else less) or _PLAIN).format(
            run=self.segment.run.name,
            title=effect.title,
            at="" if at == EVERYWHERE else f" at {at}",
            of="every sensor" if at == EVERYWHERE else f"the sensor of {at}",
            into="every node" if at == EVERYWHERE else at,
            place=at,
            size=("at least " if most or least else "") + short(abs(size)),
            factor=("at least " if most else "at most " if least else "") + short(1 + size),
            amplitude=f"{size:.3g} {self.declared.unit}",
        )


def possible(network: Network, part: Segment) -> list[Candidate]:
    """Every effect that may differ from run to run, at each of its places, in this run alone."""
    run = part.run.name.partition("#")[0]
    return [each for each in candidates(network, part.run.columns, ["", run]) if each.run == run]


def search_of(fitted: Model, part: Segment, candidate: Candidate, sigma: FloatArray) -> Search:
    """The search for a candidate's amplitude, every parameter of a fitted model held."""
    declaration = candidate.declaration(0.0, candidate.shapes[0])
    model = Model(fitted.network.with_effects([declaration]))
    amplitude = candidate.effect.amplitude()
    called = "" if amplitude is None else amplitude.name
    name = in_run(f"{declaration.name}.{called}.{candidate.pattern}", candidate.run)
    index = next(number for number, each in enumerate(model.parameters) if each.name == name)
    return Search(candidate, model, index, part, sigma)


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
def runs_that_differ(fit: Fit, parts: Sequence[Segment]) -> list[Differing]:
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
    fitted = {bound.run.source for bound in fit.problem.bound_runs}
    step = fit.problem.bound_runs[0].run.step
    found = (_differing(fit, part.coarsened(step)) for part in parts if part.run.source not in fitted)
    return [each for each in found if each is not None]


def _differing(fit: Fit, part: Segment) -> Differing | None:
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
    size = max(1, round(BLOCK / before.bound.run.step))
    for row in range(len(fit.model.nodes)):
        squares = _block_squares(before.error[row], size)
        if not squares.size:
            continue
        of_fit = [
            _block_squares(np.where(bound.counted, error, np.nan)[row], size)
            for bound, error in zip(fit.problem.bound_runs, fit.residuals, strict=True)
        ]
        usual = float(np.concatenate(of_fit).mean()) if any(each.size for each in of_fit) else 0.0
        # A sensor's steps do not average out while the temperature stands.
        noise = fit.noise.white[row] ** 2 / size + fit.noise.step[row] ** 2 / 12
        chance = noise * float(chi2.ppf(0.95, squares.size)) / squares.size
        if squares.mean() > max(CLEARLY**2 * usual, LACKING * chance, NEGLIGIBLE**2):
            return True
    return False


def _block_squares(error: FloatArray, size: int) -> FloatArray:
    """Squared means of the error over full blocks of readings that count, shape (blocks,)."""
    counted = error[np.isfinite(error)]
    return np.asarray(counted[: counted.size // size * size].reshape(-1, size).mean(axis=1) ** 2)


def _tried(fit: Fit, search: Search) -> _Trial:
    amplitude = search.best()
    explained = search.at(amplitude)
    after = predict(explained, search.segment, search.sigma)
    done = _as_fit(fit, explained, after, (search.index,))
    return _Trial(search, amplitude, done, Errors.of(after.error).rmse)


def _as_fit(fit: Fit, model: Model, found: Prediction, free: tuple[int, ...]) -> Fit:
    """A predicted run as a fit of so many parameters to all of its readings, to be compared with others."""
    bound = found.bound.count((float("-inf"), float("inf")))
    problem = Problem(model, [bound], fit.problem.sigma, free=free)
    error = (found.readings - bound.measured) / fit.problem.sigma[:, None]
    cost = 0.5 * float(np.sum(error[bound.counted] ** 2))
    z = problem.guess(model.values, [found.states[:, 0]])
    return Fit(model, problem, z, cost, fit.noise, 0, "converged")


def _best_and_alike(fit: Fit, before: Prediction, base: Fit, trials: Sequence[_Trial]) -> list[_Trial]:
    """Those that halve the error beyond noise and pay for themselves: the best, and what explains the run as well."""
    noise = cost_of_noise(base)
    most = noise + _HALF**2 * max(base.cost - noise, 0.0)
    ranked = sorted((each for each in trials if each.fit.cost <= most), key=lambda each: each.fit.cost)
    if not ranked or criterion_difference(base, ranked[0].fit) <= 0:
        return []
    best = ranked[0].fit
    # One count of independent residuals, that of the best, for all.
    near = min(TIE, (1 - _COMPARABLE) * criterion_difference(base, best))
    kept = [each for each in ranked if criterion_difference(each.fit, best) <= near]
    return kept if len(kept) == 1 else _decided_together(fit, before, kept)


def _decided_together(fit: Fit, before: Prediction, kept: list[_Trial]) -> list[_Trial]:
    """Causes by what they explain of all runs together, the other parameters let go: those are unsure themselves."""
    whole = _with_fitted(fit, before)
    declared = [each.search.candidate.declaration(each.amplitude, each.search.candidate.shapes[0]) for each in kept]
    done = [refit(whole, each) for each in declared]
    best = min(done, key=lambda each: each.cost)
    behind = [criterion_difference(each, best) for each in done]
    order = sorted(zip(behind, kept, strict=True), key=lambda each: each[0])
    # All sensors that read high by as much are a warm room: of equals, what supposes the fewest faults comes first.
    level = sorted((each for by, each in order if by <= _LEVEL), key=lambda each: len(each.search.candidate.places))
    return [*level, *(each for by, each in order if _LEVEL < by <= TIE)]


def _with_fitted(fit: Fit, before: Prediction) -> Fit:
    """The fitted runs and one more, at the fitted values, to be fitted further."""
    bound = before.bound.count((float("-inf"), float("inf")))
    problem = Problem(fit.model, [*fit.problem.bound_runs, bound], fit.problem.sigma, fit.problem.symmetry_penalty)
    z = problem.guess(fit.model.values, [*fit.point.starts, before.states[:, 0]])
    return Fit(fit.model, problem, z, problem.cost(z), fit.noise, 0, "converged")


def _cause(trial: _Trial) -> Cause:
    candidate, size = trial.search.candidate, trial.amplitude
    return Cause(candidate.effect.key, candidate.pattern, size, trial.rmse, trial.search.in_words(size))
