"""Held-out runs that a fitted model predicts badly: which one parameter would have to differ in such a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.parameters import Parameter
from lptn.basics.places import EVERYWHERE, in_run
from lptn.basics.processes import one_blas_thread
from lptn.diagnose.candidates import Candidate, candidates
from lptn.diagnose.fit_statistics import CLEARLY, cost_of_noise, criterion_difference, standing_out
from lptn.diagnose.probability import (
    are_rivals,
    implausible_amplitude,
    in_occams_window,
    log_prior_of_sizes,
    log_priors,
    probabilities,
)
from lptn.diagnose.refits import refit
from lptn.identify.comparison import Errors, Prediction, predict, with_own_errors
from lptn.identify.data import Segment
from lptn.identify.fitting import Fit
from lptn.identify.problem import Problem
from lptn.model.model import Model
from lptn.model.network import Network
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import SimulationError


@dataclass(frozen=True)
class Cause:
    """One parameter that may be what differs in a run, and how large it would be there.

    Args:
        effect: key of the effect.
        at: its place: a node, a class, or `"*"`.
        amplitude: its amplitude, in the effect's own unit.
        rmse: error of the run's evaluation window with it [K].
        words: what it means, a sentence without its full stop.
    """

    effect: str
    at: str
    amplitude: float
    rmse: float
    words: str


@dataclass(frozen=True)
class RunDifference:
    """A held-out run that a model predicts clearly worse than it fits, and what would explain it.

    The amplitude was fitted on the run itself, so that `rmse_after` is the error of an explanation and
    not of a prediction.

    Args:
        run: its name.
        rmse_before: error of the prediction in the run's evaluation window [K].
        rmse_fit: error of the model on the fitted runs [K].
        causes: what explains the run, the best first, then what these data can't tell from it; empty where no one
            parameter removes most of the error.
        where: the nodes where it stands out, the worst first, with the root mean square of one-minute means of the
            error there [K], in this run and in the fitted ones.
    """

    run: str
    rmse_before: float
    rmse_fit: float
    causes: tuple[Cause, ...]
    where: Mapping[str, tuple[float, float]] = field(default_factory=dict)

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
        """Error of the explained run in its evaluation window [K]."""
        return self.causes[0].rmse if self.causes else None

    @property
    def explained(self) -> bool:
        """Whether with it the run is predicted about as well as the fitted runs are met."""
        return self.rmse_after is not None and self.rmse_after <= CLEARLY * self.rmse_fit

    @property
    def indistinguishable(self) -> tuple[Cause, ...]:
        """Causes that these data can't tell from the best."""
        return self.causes[1:]

    @property
    def sentence(self) -> str:
        """What differs in the run, in a sentence; empty where nothing explains it."""
        return _sentence(self.causes[0].words) if self.causes else ""

    def text(self) -> str:
        """The difference in a few sentences."""
        if not self.causes:
            worst = ""
            if self.where:
                node, (here, there) = next(iter(self.where.items()))
                worst = f", most clearly at {node} ({short(here)} for {short(there)} K)"
            return (
                f"{self.run} is predicted with an error of {short(self.rmse_before)} K, against "
                f"{short(self.rmse_fit)} K on the fitted runs{worst}, and no one parameter that may "
                "differ from run to run explains half of it."
            )
        best = self.causes[0]
        text = (
            f"{self.sentence} With that its error goes from {short(self.rmse_before)} to {short(best.rmse)} K "
            "(the size was fitted on this run: an explanation, not a prediction)."
        )
        if not self.explained:
            text += f" It does not explain all: the fitted runs are met within {short(self.rmse_fit)} K."
        if not self.indistinguishable:
            return text
        others = "; or: ".join(_without_question(each.words) for each in self.indistinguishable[:_MOST_LISTED])
        more = len(self.indistinguishable) - _MOST_LISTED
        return f"{text} The run can't tell that from: {others}{f'; or {more} more' if more > 0 else ''}."

    def as_json(self) -> dict[str, object]:
        """The difference as other tools read it; what is `null` is not known."""
        indistinguishable = [
            {"effect": each.effect, "at": each.at, "amplitude": each.amplitude, "rmse_after": each.rmse}
            for each in self.indistinguishable
        ]
        return {
            "run": self.run,
            "effect": self.effect,
            "at": self.at,
            "amplitude": self.amplitude,
            "rmse_before": self.rmse_before,
            "rmse_after": self.rmse_after,
            "rmse_fit": self.rmse_fit,
            "indistinguishable": indistinguishable,
            "alike": indistinguishable,  # its older name
            "text": self.text(),
        }


# --- The procedure: every effect that may differ from run to run is tried in this run alone ---------


_HALF = 0.5  # of the error beyond noise must go before a cause is named
_PROMISING = 0.5  # share of the best promise, to first order, below which no size is searched


@dataclass(frozen=True)
class _Trial:
    """A candidate at its best amplitude: the run's fit with it, and its error in the evaluation window [K].

    `log_odds` is the logarithm of the odds beforehand that it is this cause.
    """

    search: CauseSearch
    log_odds: float
    amplitude: float
    fit: Fit
    rmse: float


@one_blas_thread
def runs_that_differ(fit: Fit, segments: Sequence[Segment]) -> list[RunDifference]:
    """For each run that a fitted model predicts clearly worse than it fits: what would have to differ in it.

    Every effect that may differ from run to run is tried at each of its places, confined to that run, all other
    parameters held. The initial states come from the run's initialisation window as in any prediction; the amplitude
    is fitted on the whole run. Causes are compared by `probabilities`: those that the best does not rule out on the run
    itself by a fit of all runs together, all parameters free.

    Args:
        fit: the fitted model.
        segments: held-out runs; the rest of a run whose beginning was fitted is left out, since one parameter can't
            differ within a run.

    Returns:
        The runs whose error is beyond noise and clearly beyond that of the fitted runs; others are not mentioned.

    Raises:
        InputError: a run lacks an input of the model.
    """
    fitted = {bound.run.source for bound in fit.problem.bound_runs}
    step = fit.problem.bound_runs[0].run.step
    differences = (
        _difference(fit, segment.coarsened(step)) for segment in segments if segment.run.source not in fitted
    )
    return [each for each in differences if each is not None]


def _difference(fit: Fit, segment: Segment) -> RunDifference | None:
    model = with_own_errors(fit.model, segment, fit.problem.sigma)
    before = predict(model, segment, fit.problem.sigma)
    where = standing_out(fit, before)
    if not where:
        return None
    base = _as_fit(fit, model, before, ())
    possible = possible_causes(model.network, segment)
    searches = [cause_search(model, segment, each, fit.problem.sigma) for each in possible]
    least = _PROMISING * max((each.promise for each in searches), default=0.0)
    trials = [
        _tried(fit, each, float(log_odds))
        for each, log_odds in zip(searches, log_priors(possible), strict=True)
        if each.promise >= least
    ]
    causes = (_cause(each) for each in _best_and_indistinguishable(fit, before, base, trials))
    return RunDifference(segment.run.name, Errors.of(before.error).rmse, fit.rmse, tuple(causes), where)


def _tried(fit: Fit, search: CauseSearch, log_odds: float) -> _Trial:
    amplitude = search.best()
    explained = search.at(amplitude)
    after = predict(explained, search.segment, search.sigma)
    done = _as_fit(fit, explained, after, (search.index,))
    return _Trial(search, log_odds, amplitude, done, Errors.of(after.error).rmse)


def _as_fit(fit: Fit, model: Model, prediction: Prediction, free: tuple[int, ...]) -> Fit:
    """A predicted run as a fit of so many parameters to all of its readings, to be compared with others."""
    bound = prediction.bound.count((float("-inf"), float("inf")))
    problem = Problem(model, [bound], fit.problem.sigma, free=free)
    error = (prediction.readings - bound.measured) / fit.problem.sigma[:, None]
    cost = 0.5 * float(np.sum(error[bound.counted] ** 2))
    z = problem.guess(model.values, [prediction.states[:, 0]])
    return Fit(model, problem, z, cost, fit.noise, 0, "converged")


def _best_and_indistinguishable(fit: Fit, before: Prediction, base: Fit, trials: Sequence[_Trial]) -> list[_Trial]:
    """The best of those that halve the error beyond noise and pay for themselves, and what explains the run as well.

    None of a size that nobody would believe.
    """
    noise = cost_of_noise(base)
    most = noise + _HALF**2 * max(base.cost - noise, 0.0)
    believed = [each for each in trials if not implausible_amplitude(each.search.candidate, each.amplitude)]
    ranked = sorted((each for each in believed if each.fit.cost <= most), key=lambda each: each.fit.cost)
    if not ranked or criterion_difference(base, ranked[0].fit) <= 0:
        return []
    kept = [each for each in ranked if each is ranked[0] or are_rivals(each.fit, ranked[0].fit)]
    return kept if len(kept) == 1 else _decided_together(fit, base.model, before, kept)


def _decided_together(fit: Fit, model: Model, before: Prediction, kept: list[_Trial]) -> list[_Trial]:
    """Causes by what they explain of all runs together, the other parameters free: those are unsure themselves."""
    whole = _with_fitted(fit, model, before)
    declared = [each.search.candidate.declaration(each.amplitude, each.search.candidate.shapes[0]) for each in kept]
    done = [refit(whole, each) for each in declared]
    priors = [
        trial.log_odds + log_prior_of_sizes(after, [each])
        for trial, after, each in zip(kept, done, declared, strict=True)
    ]
    return [kept[k] for k in in_occams_window(probabilities(done, np.array(priors)))]


def _with_fitted(fit: Fit, model: Model, before: Prediction) -> Fit:
    """The fitted runs and one more, at the fitted values, to be fitted further."""
    bound = before.bound.count((float("-inf"), float("inf")))
    fitted = [replace(bind(model, each.run), counted=each.counted) for each in fit.problem.bound_runs]
    problem = Problem(model, [*fitted, bound], fit.problem.sigma, fit.problem.symmetry_penalty)
    z = problem.guess(model.values, [*fit.point.starts, before.states[:, 0]])
    return Fit(model, problem, z, problem.cost(z), fit.noise, 0, "converged")


def _cause(trial: _Trial) -> Cause:
    candidate, size = trial.search.candidate, trial.amplitude
    return Cause(candidate.effect.key, candidate.pattern, size, trial.rmse, trial.search.in_words(size))


# --- The size that one effect would need in one run, everything else of a fitted model held -------


_DIFFERENCE = 0.05  # of the typical size: step of the finite difference by the amplitude
_EVALUATIONS = 25  # at most, in the search for an amplitude
_FAILED = 1e3  # weighted residual of an amplitude at which the model can't be simulated
_AT_BOUND = 1e-3  # relative; so near a bound, the size is only a limit
_NEARLY_ONE = 0.1  # a factor that differs from one by less is said to the third decimal
_PLAIN = "in {run}{at}: {title}, {amplitude}"


@dataclass(frozen=True)
class CauseSearch:
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
        """Weighted errors (predicted − measured) of the whole run at an amplitude, shape (readings,)."""
        try:
            prediction = predict(self.at(value), self.segment, self.sigma)
        except SimulationError:
            return np.full(int(self.counted.sum()), _FAILED)
        return np.asarray(((prediction.readings - prediction.bound.measured) / self.sigma[:, None])[self.counted])

    def slope(self, value: float, residuals: FloatArray) -> FloatArray:
        """Derivative by the amplitude, over a step large against what is unsure about the start, shape (readings,)."""
        step = _DIFFERENCE * abs(self.declared.typical)
        step = step if value + step < self.declared.bounds[1] else -step
        return np.asarray((self.residuals(value + step) - residuals) / step)

    @cached_property
    def promise(self) -> float:
        """Share of the squared error that the amplitude removes to first order; 0 where that has the wrong sign."""
        off = self.declared.off or 0.0
        error = self.residuals(off)
        slope = self.slope(off, error)
        product, length = float(error @ slope), float(np.linalg.norm(error) * np.linalg.norm(slope))
        one_sided = self.declared.bounds[0] == off
        return 0.0 if length == 0 or (one_sided and product > 0) else (product / length) ** 2

    def best(self) -> float:
        """The amplitude with the least misfit over the whole run."""
        from scipy.optimize import least_squares  # heavy, and few commands need it

        typical = abs(self.declared.typical)
        lower, upper = (bound / typical for bound in self.declared.bounds)

        def residuals(share: FloatArray) -> FloatArray:
            return self.residuals(typical * float(share[0]))

        def jacobian(share: FloatArray) -> FloatArray:
            slope = self.slope(typical * float(share[0]), residuals(share))
            return np.asarray(typical * slope)[:, None]

        guess = [max(_DIFFERENCE, lower)]  # a one-sided amplitude can't be searched from its bound
        solved = least_squares(residuals, guess, jac=jacobian, bounds=([lower], [upper]), max_nfev=_EVALUATIONS)
        return float(typical * solved.x[0])

    def in_words(self, size: float) -> str:
        """What an amplitude in this run means, by the effect's own sentence."""
        at, effect = self.candidate.pattern, self.candidate.effect
        lower, upper = self.declared.bounds
        most, least = (abs(size - bound) <= _AT_BOUND * abs(bound) for bound in (upper, lower))
        times = f"{1 + size:.3f}" if abs(size) < _NEARLY_ONE else short(1 + size)
        more, less = effect.in_one_run
        return ((more if size >= 0 else less) or _PLAIN).format(
            run=self.segment.run.name,
            title=effect.title,
            at="" if at == EVERYWHERE else f" at {at}",
            of="every sensor" if at == EVERYWHERE else f"the sensor of {at}",
            into="every node" if at == EVERYWHERE else at,
            place=at,
            size=("at least " if most or least else "") + short(abs(size)),
            factor=("at least " if most else "at most " if least else "") + times,
            amplitude=f"{size:.3g} {self.declared.unit}",
        )


def possible_causes(network: Network, segment: Segment) -> list[Candidate]:
    """Every effect that may differ from run to run, at each of its places, in this run alone."""
    run = segment.run.name.partition("#")[0]
    return [each for each in candidates(network, segment.run.columns, ["", run]) if each.run == run]


def granted_differences(model: Model, fit: Fit, segments: Sequence[Segment]) -> tuple[Model, tuple[RunDifference, ...]]:
    """A model whose badly predicted held-out runs have a parameter of their own, and which; as it is where that fails.

    Args:
        model: the model to question.
        fit: the likeliest fit of it, or of it with an effect more: its predictions say which runs differ.
        segments: the held-out runs.

    Returns:
        The model and what it grants; nothing where a run that differs is not explained, since held-out runs must not
        be excused by halves.
    """
    differing = runs_that_differ(fit, segments)
    if not all(each.explained for each in differing):
        return model, ()
    return with_differences(model, differing, segments), tuple(differing)


def with_differences(model: Model, differing: Sequence[RunDifference], segments: Sequence[Segment]) -> Model:
    """The model with what differs in held-out runs as a nuisance of each, which every prediction of the run fits anew.

    A run that is predicted so judges the rest of a model, and no longer the one parameter that is its own.
    """
    for each in differing:
        segment = next(segment for segment in segments if segment.run.name == each.run)
        causes = possible_causes(model.network, segment)
        cause = next(cause for cause in causes if (cause.effect.key, cause.pattern) == (each.effect, each.at))
        declared = cause.declaration(0.0, cause.shapes[0])
        spread = max(abs(each.amplitude or 0.0), cause.typical)
        parameters = tuple(
            replace(one, fixed=True)
            if one.off is None
            else replace(one, fixed=True, prior=(one.off, spread), nuisance=True)
            for one in declared.parameters
        )
        model = Model(model.network.with_effects([replace(declared, parameters=parameters)]))
    return model


def cause_search(fitted: Model, segment: Segment, candidate: Candidate, sigma: FloatArray) -> CauseSearch:
    """The search for a candidate's amplitude, every parameter of a fitted model held."""
    declaration = candidate.declaration(0.0, candidate.shapes[0])
    model = Model(fitted.network.with_effects([declaration]))
    amplitude = candidate.effect.amplitude()
    own_name = "" if amplitude is None else amplitude.name
    name = in_run(f"{declaration.name}.{own_name}.{candidate.pattern}", candidate.run)
    index = next(number for number, each in enumerate(model.parameters) if each.name == name)
    return CauseSearch(candidate, model, index, segment, sigma)


# --- Words ----------------------------------------------------------------------------------------


_MOST_LISTED = 3  # causes that a sentence can carry


def short(value: float) -> str:
    """Two digits, whole numbers from a hundred on."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.2g}"


def _sentence(words: str) -> str:
    """A sentence that begins and ends as one; a run's name stays as it is."""
    begun = words.replace("in ", "In ", 1) if words.startswith("in ") else words
    return begun if begun.endswith("?") else f"{begun}."


def _without_question(words: str) -> str:
    """A sentence without the question behind it."""
    return words.rpartition(": ")[0] if words.endswith("?") else words
