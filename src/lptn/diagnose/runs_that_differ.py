"""Held-out runs that a fitted model predicts badly: which one parameter would have to differ in such a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isclose

from scipy.special import softmax

from lptn.basics.parameters import ParameterInstance
from lptn.basics.places import EVERYWHERE
from lptn.basics.processes import one_blas_thread
from lptn.basics.words import short_size
from lptn.diagnose.answers import Step
from lptn.diagnose.candidates import Candidate, in_occams_window, log_priors, possible_effects
from lptn.diagnose.evidence import ErrorsOfRuns, Evidence, allowances
from lptn.diagnose.fit_statistics import CLEARLY, explained_share, standing_out
from lptn.diagnose.refits import continued, refit
from lptn.effects import catalogue
from lptn.identify.comparison import Errors, predict
from lptn.identify.data import Segment
from lptn.identify.fitting import Fit
from lptn.identify.problem import Problem
from lptn.model.network import EffectDeclaration


@dataclass(frozen=True)
class RunDifference:
    """A held-out run that a model predicts clearly worse than it fits, and what would explain it.

    The amplitude was fitted on the run itself, so that `rmse_after` is the error of an explanation and
    not of a prediction.

    Args:
        run: its name.
        rmse_before: error of the prediction in the run's evaluation window [K].
        rmse_fit: error of the model on the fitted runs [K].
        causes: fits of the run alone with what explains it, and the errors then held out, the best first, then what
            these data can't tell from it; empty where no one parameter removes most of the error.
        where: the nodes where it stands out, the worst first, with the root mean square of one-minute means of the
            error there [K], in this run and in the fitted ones.
    """

    run: str
    rmse_before: float
    rmse_fit: float
    causes: tuple[Step, ...]
    where: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def rmse_after(self) -> float:
        """Error of the run's evaluation window with the best cause [K]; as before without any."""
        best = self.causes[0].holdout if self.causes else None
        return best.rmse if best else self.rmse_before

    @property
    def words(self) -> list[str]:
        """What each cause means, a sentence without its full stop."""
        found = ((cause.declaration, cause.amplitude) for cause in self.causes)
        return [in_words(declared, size, self.run) for declared, size in found if declared and size]

    @property
    def sentence(self) -> str:
        """What differs in the run, in a sentence; empty where nothing explains it."""
        words = self.words[0] if self.causes else ""
        begun = words.replace("in ", "In ", 1) if words.startswith("in ") else words  # a run's name stays as it is
        return begun if begun.endswith("?") or not begun else f"{begun}."

    def text(self) -> str:
        """The difference in a few sentences."""
        before, fitted = short_size(self.rmse_before), short_size(self.rmse_fit)
        if not self.causes:
            worst = [
                f", most clearly at {node} ({short_size(here)} for {short_size(there)} K)"
                for node, (here, there) in self.where.items()
            ]
            return (
                f"{self.run} is predicted with an error of {before} K, against {fitted} K on the fitted runs"
                f"{''.join(worst[:1])}, and no one parameter that may differ from run to run explains half of it."
            )
        text = (
            f"{self.sentence} With that its error goes from {before} to {short_size(self.rmse_after)} K (the size was "
            "fitted on this run: an explanation, not a prediction)."
        )
        if self.rmse_after > CLEARLY * self.rmse_fit:
            text += f" It does not explain all: the RMSE of the fitted runs is {fitted} K."
        names = "; or: ".join(map(_without_question, self.words[1:]))
        return f"{text} Indistinguishable in this run: {names}." if names else text

    def as_json(self) -> dict[str, object]:
        """The difference as other tools read it; `null` where a value is unknown."""
        causes: list[dict[str, object]] = [
            {
                "effect": cause.effect,
                "at": cause.declaration.at,
                "amplitude": cause.amplitude.value,
                "rmse_after": cause.holdout.rmse,
            }
            for cause in self.causes
            if cause.declaration and cause.amplitude and cause.holdout
        ]
        best = causes[0] if causes else dict.fromkeys(("effect", "at", "amplitude", "rmse_after"))
        table = {"run": self.run, "rmse_before": self.rmse_before, "rmse_fit": self.rmse_fit, "text": self.text()}
        return table | best | {"indistinguishable": causes[1:]}


# --- The procedure: how a run differs from the fitted model ---------------------------------------


@one_blas_thread
def runs_that_differ(fit: Fit, segments: Sequence[Segment], *, exact: int = 4) -> list[RunDifference]:
    """For each run that a fitted model predicts clearly worse than it fits: the parameters that would explain it.

    The run is asked what it lacks, as in any diagnosis, of what may differ from run to run; the model's own parameters
    are held.

    Args:
        fit: the fitted model.
        segments: held-out runs; the rest of a run whose beginning was fitted is left out, since one parameter can't
            differ within a run.
        exact: how many causes are fitted exactly, and may be told.

    Returns:
        The runs whose error is beyond noise and clearly beyond that of the fitted runs; others are not mentioned.

    Raises:
        InputError: a run lacks an input of the model.
    """
    differences, sigma = [], fit.problem.sigma
    fitted = {bound.run.source for bound in fit.problem.bound_runs}
    for segment in (one.coarsened(fit.problem.bound_runs[0].run.step) for one in segments):
        before = predict(fit.model, segment, sigma)
        if segment.run.source in fitted or not (where := standing_out(fit, (before.bound, before.error))):
            continue
        problem = Problem(fit.model, [before.bound.count((float("-inf"), float("inf")))], sigma, free=())
        z = problem.guess(fit.model.values, [before.path.states[:, 0]])
        alone = continued(Fit(fit.model, problem, z, problem.cost(z), fit.noise, 0, "converged"), fit.model.network)
        error, causes = Errors.of(before.error), []
        for step in _causes(alone, exact):
            after = Errors.of(predict(step.fit.model, segment, sigma).error)
            if explained_share(fit, error.rmse, after.rmse) > 0.5:  # more than it leaves
                causes.append(replace(step, holdout=after))
        differences.append(RunDifference(segment.run.name, error.rmse, fit.rmse, tuple(causes), where))
    return differences


def _causes(alone: Fit, exact: int) -> list[Step]:
    """Causes of a run's error, the most probable first, then those that are indistinguishable from it."""
    run, errors, steps = alone.problem.bound_runs[0].run, ErrorsOfRuns(), list[Step]()
    log = run.name.partition("#")[0]
    effects = {effect for effect in catalogue().values() if effect.per_run}

    def lacking(fit: Fit, *, single: bool = False) -> list[Candidate]:
        others = ""  # the other runs, by whatever name: what differs in a run differs from them
        every = possible_effects(fit, run.columns, [others, log], effects, single)
        return [candidate for candidate in every if candidate.run == log]

    possible = lacking(alone)
    base, odds = Evidence(alone, allowances(alone, possible, errors), possible), log_priors(possible)
    prior = dict(zip((candidate.key for candidate in possible), odds.tolist(), strict=True))
    for entry in base.first_order(odds)[:exact]:
        declared = entry.declaration()
        fit = refit(alone, declared)
        evidence = Evidence(fit, allowances(fit, lacking(fit, single=True), errors), beside=base).log_evidence
        steps.append(Step(fit, declared, evidence + prior[entry.candidate.key]))
    return [steps[number] for number in in_occams_window(softmax([step.log_odds for step in steps]))] if steps else []


# --- Words ----------------------------------------------------------------------------------------


def in_words(declaration: EffectDeclaration, amplitude: ParameterInstance, run: str, nearly_one: float = 0.1) -> str:
    """What an amplitude in one run means, by the effect's own sentence.

    Args:
        declaration: the effect.
        amplitude: as it was fitted.
        run: name of the run.
        nearly_one: a share: a factor that differs from one by less is given to the third decimal, without a question,
            for a per cent or two more is no fan, and one less no cover.
    """
    size, at, effect = amplitude.value, declaration.at, declaration.effect
    lower, upper = amplitude.declared.bounds
    most, least = (isclose(size, bound, rel_tol=1e-3) for bound in (upper, lower))  # there a size is only a limit
    times = f"{1 + size:.3f}" if abs(size) < nearly_one else short_size(1 + size)
    more, less = effect.in_one_run
    sentence = (more if size >= 0 else less) or "in {run}{at}: {title}, {amplitude}"
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
    return _without_question(words) if amplitude.declared.unit == "1" and abs(size) < nearly_one else words


def _without_question(words: str) -> str:
    """A sentence without the question behind it."""
    return words.rpartition(": ")[0] if words.endswith("?") else words
