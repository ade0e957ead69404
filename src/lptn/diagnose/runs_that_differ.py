"""Held-out runs that a fitted model predicts badly: which one parameter would have to differ in such a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lptn.basics.parameters import ParameterInstance
from lptn.basics.places import EVERYWHERE
from lptn.basics.processes import one_blas_thread
from lptn.basics.words import short_size
from lptn.diagnose.answers import Step, answers
from lptn.diagnose.candidates import possible_effects
from lptn.diagnose.fit_statistics import CLEARLY, explained_elsewhere, standing_out
from lptn.diagnose.plausibility import is_at
from lptn.diagnose.probability import in_occams_window, log_prior_of_sizes, probabilities
from lptn.diagnose.refits import continued, refit
from lptn.identify.comparison import Errors, Prediction, predict, with_own_errors
from lptn.identify.data import Segment
from lptn.identify.fitting import Fit, nuisances
from lptn.identify.problem import Problem
from lptn.identify.uncertainty import rows_at_bounds
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration
from lptn.simulate.bound_run import bind


@dataclass(frozen=True)
class Cause:
    """One parameter that may be what differs in a run, and how large it would be there.

    Args:
        declaration: the effect, at its place and in this run.
        amplitude: its amplitude, in the effect's own unit.
        rmse: error of the run's evaluation window with it [K].
        words: what it means, a sentence without its full stop.
    """

    declaration: EffectDeclaration
    amplitude: float
    rmse: float
    words: str

    @property
    def effect(self) -> str:
        """Key of the effect."""
        return self.declaration.effect.key

    @property
    def at(self) -> str:
        """Its place: a node, a class, or `"*"`."""
        return self.declaration.at


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
                worst = f", most clearly at {node} ({short_size(here)} for {short_size(there)} K)"
            return (
                f"{self.run} is predicted with an error of {short_size(self.rmse_before)} K, against "
                f"{short_size(self.rmse_fit)} K on the fitted runs{worst}, and no one parameter that may "
                "differ from run to run explains half of it."
            )
        best = self.causes[0]
        text = (
            f"{self.sentence} With that its error goes from {short_size(self.rmse_before)} to "
            f"{short_size(best.rmse)} K (the size was fitted on this run: an explanation, not a prediction)."
        )
        if not self.explained:
            text += f" It does not explain all: the fitted runs are met within {short_size(self.rmse_fit)} K."
        if not self.indistinguishable:
            return text
        others = "; or: ".join(_without_question(cause.words) for cause in self.indistinguishable[:_MOST_LISTED])
        more = len(self.indistinguishable) - _MOST_LISTED
        return f"{text} The run can't tell that from: {others}{f'; or {more} more' if more > 0 else ''}."

    def as_json(self) -> dict[str, object]:
        """The difference as other tools read it; what is `null` is not known."""
        return {
            "run": self.run,
            "effect": self.effect,
            "at": self.at,
            "amplitude": self.amplitude,
            "rmse_before": self.rmse_before,
            "rmse_after": self.rmse_after,
            "rmse_fit": self.rmse_fit,
            "indistinguishable": [
                {"effect": cause.effect, "at": cause.at, "amplitude": cause.amplitude, "rmse_after": cause.rmse}
                for cause in self.indistinguishable
            ],
            "text": self.text(),
        }


# --- The procedure: what a run lacks beside the fitted model ---------------------------------------


@one_blas_thread
def runs_that_differ(fit: Fit, segments: Sequence[Segment]) -> list[RunDifference]:
    """For each run that a fitted model predicts clearly worse than it fits: what would have to differ in it.

    The run is asked what it lacks, as in any diagnosis, of what may differ from run to run; the model's own parameters
    are held. What the run itself can't tell apart is refitted to all runs together, all parameters free.

    Args:
        fit: the fitted model.
        segments: held-out runs; the rest of a run whose beginning was fitted is left out, since one parameter can't
            differ within a run.

    Returns:
        The runs whose error is beyond noise and clearly beyond that of the fitted runs; others are not mentioned.

    Raises:
        InputError: a run lacks an input of the model.
    """
    step = fit.problem.bound_runs[0].run.step
    differences = (
        _difference(fit, segment.coarsened(step)) for segment in segments if is_of_another_log(fit, segment.run)
    )
    return [difference for difference in differences if difference is not None]


def is_of_another_log(fit: Fit, run: Run) -> bool:
    """Whether a run is not the rest of one whose beginning was fitted."""
    return run.source not in {bound.run.source for bound in fit.problem.bound_runs}


def _difference(fit: Fit, segment: Segment) -> RunDifference | None:
    before = predict(fit.model, segment, fit.problem.sigma)
    where = standing_out(fit, before)
    if not where:
        return None
    names = _names_of_one_answer(_fitted(fit, before, alone=True))
    answer = _decided_together(fit, before, names) if len(names) > 1 else names
    error, causes = Errors.of(before.error), []
    for step in answer:
        (declaration,), amplitude = step.declarations, step.amplitude
        assert amplitude is not None  # what may differ from run to run has one
        after = Errors.of(predict(step.fit.model, segment, fit.problem.sigma).error)
        if explained_elsewhere(fit, error, after):
            words = _in_words(declaration, amplitude, segment.run.name)
            causes.append(Cause(declaration, amplitude.value, after.rmse, words))
    return RunDifference(segment.run.name, error.rmse, fit.rmse, tuple(causes), where)


def _fitted(fit: Fit, before: Prediction, *, alone: bool) -> Fit:
    """All of a predicted run as the model has it: alone, its start and nuisance parameters fitted and the model's own
    parameters held; or together with the fitted runs, these free to be fitted.
    """
    model = with_own_errors(fit.model, before.segment, fit.problem.sigma)
    others = [] if alone else zip(fit.problem.bound_runs, fit.point.starts, strict=True)
    runs = [(replace(bind(model, bound.run), counted=bound.counted), start) for bound, start in others]
    runs.append((before.bound.count((float("-inf"), float("inf"))), before.states[:, 0]))
    bound_runs, starts = zip(*runs, strict=True)
    free = nuisances(model, before.segment.run.name) if alone else None
    fitted = fit.problem
    problem = Problem(model, bound_runs, fitted.sigma, fitted.symmetry_penalty, free, within=fitted.within)
    z = problem.guess(model.values, starts)
    done = Fit(model, problem, z, problem.cost(z), fit.noise, 0, "converged")
    return continued(done, model.network) if alone else done


def _names_of_one_answer(alone: Fit) -> list[Step]:
    """What a run lacks, the most probable first, then what it can't tell from that."""
    run = alone.problem.bound_runs[0].run
    log = run.name.partition("#")[0]
    fitted = ""  # the other runs, by whatever name: what differs in a run differs from them
    possible = [candidate for candidate in possible_effects(alone, run.columns, [fitted, log]) if candidate.run == log]
    steps = answers(alone, possible).steps
    names = {steps[0].key, *steps[0].indistinguishable} if steps and steps[0].gain > 0 else set()
    return [step for step in steps if step.key in names]


def _decided_together(fit: Fit, before: Prediction, names: Sequence[Step]) -> list[Step]:
    """Names by what they explain of all runs together, the other parameters free: those are unsure themselves."""
    together = _fitted(fit, before, alone=False)
    done = [refit(together, declaration) for step in names for declaration in step.declarations]
    priors = [
        step.log_odds + log_prior_of_sizes(solution, step.declarations)
        for step, solution in zip(names, done, strict=True)
    ]
    return [names[k] for k in in_occams_window(probabilities(done, np.array(priors)))]


def explained_differences(
    model: Model, fit: Fit, segments: Sequence[Segment]
) -> tuple[Model, tuple[RunDifference, ...]]:
    """A model whose badly predicted held-out runs have a parameter of their own, and which; as it is where that fails.

    Args:
        model: the model to question.
        fit: the likeliest fit of it, or of it with an effect more: its predictions say which runs differ.
        segments: the held-out runs.

    Returns:
        The model and these differences; nothing where a run that differs is not explained, since held-out runs must not
        be excused by halves.
    """
    differing = runs_that_differ(fit, segments)
    if not all(difference.explained for difference in differing):
        return model, ()
    return with_differences(model, differing), tuple(differing)


def with_differences(model: Model, differing: Sequence[RunDifference]) -> Model:
    """The model with what differs in held-out runs as a nuisance of each, which every prediction of the run fits anew.

    A run that is predicted so judges the rest of a model, and no longer the one parameter that is its own.
    """
    declared = []
    for cause in (difference.causes[0] for difference in differing):
        parameters = tuple(
            replace(one.switched_off, fixed=True)
            if one.off is None
            else replace(
                one.switched_off,
                fixed=True,
                prior=(one.off, max(abs(cause.amplitude), one.typical)),
                nuisance=True,
            )
            for one in cause.declaration.parameters
        )
        # By a name of its own it stands beside what that run is asked to lack.
        label = f"{cause.declaration.effect.key}_differing"
        declared.append(replace(cause.declaration, parameters=parameters, label=label))
    return Model(model.network.with_effects(declared))


# --- Nuisance parameters of fitted runs that are not enough ------------------------------------------


@dataclass(frozen=True)
class NuisanceAtLimit:
    """An error of a fitted run's inputs: the effect that stands for it, where, in which run, how large, in words.

    Its size is in the unit of the effect's amplitude.
    """

    effect: str
    at: str
    run: str
    size: float
    text: str


def nuisances_at_limit(fit: Fit) -> list[NuisanceAtLimit]:
    """Nuisance parameters of fitted runs that ended at their bounds: these runs differ by more than that."""
    ended = [fit.problem.free[row] for row in rows_at_bounds(fit.problem, fit.z)]
    errors = []
    for instance in fit.model.network.effect_instances:
        for index in set(ended) & set(instance.parameters.values()) if instance.declaration.nuisance else ():
            amplitude, run = fit.model.parameters[index], instance.declaration.run
            words = _in_words(instance.declaration, amplitude, run)
            errors.append(NuisanceAtLimit(instance.effect.key, instance.place, run, amplitude.value, words))
    return errors


# --- Words ----------------------------------------------------------------------------------------


_MOST_LISTED = 3  # causes that a sentence can carry
_NEARLY_ONE = 0.1  # a factor that differs from one by less is said to the third decimal, and asks nobody why
_PLAIN = "in {run}{at}: {title}, {amplitude}"


def _in_words(declaration: EffectDeclaration, amplitude: ParameterInstance, run: str) -> str:
    """What an amplitude in one run means, by the effect's own sentence."""
    size, at, effect = amplitude.value, declaration.at, declaration.effect
    lower, upper = amplitude.declared.bounds
    most, least = is_at(size, upper), is_at(size, lower)
    times = f"{1 + size:.3f}" if abs(size) < _NEARLY_ONE else short_size(1 + size)
    more, less = effect.in_one_run
    sentence = (more if size >= 0 else less) or _PLAIN
    sentence = sentence.replace("only {factor}", "{factor}") if least else sentence
    words = sentence.format(
        run=run,
        title=effect.title,
        at="" if at == EVERYWHERE else f" at {at}",
        of="every sensor" if at == EVERYWHERE else f"the sensor of {at}",
        into="every node" if at == EVERYWHERE else at,
        place=at,
        size=("at least " if most or least else "") + short_size(abs(size)),
        factor=("at least " if most else "at most " if least else "") + times,
        amplitude=f"{size:.3g}{amplitude.declared.unit_behind}",
    )
    # A per cent or two more is no fan, and one less no cover.
    return _without_question(words) if amplitude.declared.unit == "1" and abs(size) < _NEARLY_ONE else words


def _sentence(words: str) -> str:
    """A sentence that begins and ends as one; a run's name stays as it is."""
    begun = words.replace("in ", "In ", 1) if words.startswith("in ") else words
    return begun if begun.endswith("?") else f"{begun}."


def _without_question(words: str) -> str:
    """A sentence without the question behind it."""
    return words.rpartition(": ")[0] if words.endswith("?") else words
