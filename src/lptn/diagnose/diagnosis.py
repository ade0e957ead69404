"""The decision what a model lacks: every effect of the catalogue tried, the most probable refitted, a verdict.

1. The model is fitted as it stands, on means over 5 s.
2. Every effect at every place is tried to first order at that fit (`lptn.diagnose.scores`): by what factor would it
   raise the probability of the readings, and how often is such a thing met?
3. The most probable are refitted exactly, everything else free, and their evidence is worked out again at the refit
   (`lptn.diagnose.evidence`), beside that of the model as it stands.
4. These are probabilities: of each effect at its place, and of nothing being missing. Names that share the probability
   are one answer.
5. The verdict is on the fitted data: `"adequate"` if nothing is missing, with what is left too small to matter;
   `"missing"` if an effect, or a few together, account for most of what the model leaves; else `"unexplained"`. How
   held-out runs agree is said beside it. A model that they contradict is not called adequate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from math import exp, log
from typing import Literal

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.basics.parameters import Parameter
from lptn.basics.tables import Tabular
from lptn.diagnose.candidates import with_ambient_bias
from lptn.diagnose.evidence import Evidence, Likelihood, possible_effects
from lptn.diagnose.fit_statistics import NEGLIGIBLE, explained_share
from lptn.diagnose.scores import Score, Scores, score
from lptn.identify.comparison import Errors, predict
from lptn.identify.data import DataSplit
from lptn.identify.fitting import Fit, finished, fit
from lptn.identify.problem import Point
from lptn.identify.validation import fit_segments, holdout_errors
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network
from lptn.simulate.bound_run import BoundRun, bind, default_start, start_from

Verdict = Literal["adequate", "missing", "unexplained"]
Key = tuple[str, str]
"""Effect and place, such as `("sensor_offset", "FR_calf")`; `"FR_calf@monday"` for an effect in one run only."""
Report = Callable[[str], None]
"""Called with a sentence on what is being done."""


@dataclass(frozen=True, eq=False, repr=False)
class Step(Tabular):
    """A fitted model, and the effect that it has beyond the model before it.

    A candidate that was refitted is a step that could be taken; a history is made of the steps that were.

    Args:
        fit: of the model with the effect.
        declaration: the effect as added; `None` for the model as given.
        evidence: what the fitted readings say for the model; `None` where it was not asked.
        log_prior: logarithm of the prior odds that the model before it lacks this effect, against nothing.
        log_odds: logarithm of these odds once the fitted readings are known.
        probability: that it is what the model before it lacks, among all that was tried and nothing.
        indistinguishable: candidates that the fitted data can't tell from it.
        log_predictive: logarithm of the probability that the model gives held-out runs, 0 without any.
        holdout: errors on held-out runs, `None` without any.
        test: errors on runs that chose nothing, `None` without any.
    """

    fit: Fit
    declaration: EffectDeclaration | None = None
    evidence: Evidence | None = None
    log_prior: float = 0.0
    log_odds: float = 0.0
    probability: float = 0.0
    indistinguishable: tuple[Key, ...] = ()
    log_predictive: float = 0.0
    holdout: Errors | None = None
    test: Errors | None = None

    @property
    def effect(self) -> str | None:
        """Key of the effect, `None` for the model as given."""
        return self.declaration.effect.key if self.declaration else None

    @property
    def at(self) -> str | None:
        """Its place, with the run if it acts in one only."""
        return self.declaration.where if self.declaration else None

    @property
    def key(self) -> Key:
        """Effect and place, empty for the model as given."""
        return self.effect or "", self.at or ""

    @property
    def parameters(self) -> int:
        """Number of free parameters of the model."""
        return len(self.fit.problem.free)

    @property
    def summary(self) -> str:
        """Effect, place and errors in one line."""
        what = f"{self.effect} at {self.at}" if self.declaration else "as given"
        rmse = {"fitted": self.fit.rmse}
        rmse |= {"held out": self.holdout.rmse} if self.holdout else {}
        rmse |= {"test": self.test.rmse} if self.test else {}
        errors = ", ".join(f"{value:.3g} K {data}" for data, value in rmse.items())
        return f"{what}, {self.parameters} parameters, RMSE {errors}"

    def to_pandas(self) -> pd.DataFrame:
        """The model's parameters, as `Fit.to_pandas` gives them."""
        return self.fit.to_pandas()

    @property
    def p_value(self) -> float:
        """Probability that nothing is missing, where this is the only alternative."""
        return 1.0 / (1.0 + exp(min(self.log_odds, _LARGEST_EXPONENT)))

    @property
    def at_bounds(self) -> tuple[str, ...]:
        """Names of the effect's own parameters that ended at a bound: there a fit has no curvature to speak of."""
        declared = self.declaration
        owned = {f"{declared.name}.{each.name}.{declared.where}" for each in declared.parameters} if declared else set()
        free = [(self.fit.model.parameters[index], index) for index in self.fit.problem.free]
        values = self.fit.point.values
        return tuple(
            each.name for each, index in free if each.name in owned and _is_at_a_bound(values[index], each.declared)
        )


_LARGEST_EXPONENT = 700.0  # of a double


def _is_at_a_bound(value: float, declared: Parameter) -> bool:
    near = _AT_BOUND * max(abs(declared.typical), abs(value))
    return any(abs(value - bound) <= near for bound in declared.bounds if bound != declared.off and np.isfinite(bound))


_AT_BOUND = 1e-3  # share of a value; no fit tells a parameter from its bound by less


@dataclass(frozen=True, repr=False)
class Diagnosis(Tabular):
    """What a fitted model lacks.

    Args:
        verdict: on the fitted data. `"adequate"`: nothing that matters; `"missing"`: an effect of the catalogue, or a
            few together, account for most of the misfit; `"unexplained"`: misfit that the catalogue does not remove.
        fit: the fitted baseline.
        evidence: what the fitted readings say for it.
        holdout: its errors on held-out runs, `None` without any.
        scores: all candidates, scored.
        refits: those that were refitted, most probable first.
        nothing: probability that nothing is missing, among all candidates.
    """

    verdict: Verdict
    fit: Fit
    evidence: Evidence
    holdout: Errors | None
    scores: Scores
    refits: tuple[Step, ...]
    nothing: float = 1.0

    @property
    def helpful(self) -> tuple[Step, ...]:
        """The refits that are worth a line: no less probable than one in a hundred against nothing being missing."""
        return tuple(step for step in self.refits if step.log_odds > -log(_NO_ANSWER))

    @property
    def best(self) -> Step | None:
        """The first answer, `None` where no candidate helps."""
        return self.helpful[0] if self.helpful else None

    @property
    def unnamed_log_odds(self) -> float:
        """Logarithm of the odds, against nothing, of all candidates that were not refitted."""
        named = self.nothing + sum(step.probability for step in self.refits)
        return log(max(1.0 - named, _LEAST_SHARE)) - log(max(self.nothing, _LEAST_SHARE))

    @property
    def probabilities(self) -> list[tuple[Key | None, float]]:
        """Probability of each refitted effect being what is missing, and of nothing (`None`), the largest first."""
        listed: list[tuple[Key | None, float]] = [(step.key, step.probability) for step in self.refits]
        return sorted([*listed, (None, self.nothing)], key=lambda each: -each[1])

    @property
    def summary(self) -> str:
        """Verdict and first answer in one line."""
        error = f"RMSE {self.fit.rmse:.3g} K fitted"
        if self.holdout:
            error += f", {self.holdout.rmse:.3g} K held out"
        answer = f"; first answer {self.best.effect} at {self.best.at}" if self.best else ""
        return f"{self.verdict}: {error}{answer}"

    def to_pandas(self) -> pd.DataFrame:
        """A row for each answer, the most probable first: effect, place, errors [K] with it, and its other names."""
        rows = [
            {
                "effect": step.effect,
                "place": step.at,
                "RMSE fitted [K]": step.fit.rmse,
                "RMSE held out [K]": step.holdout.rmse if step.holdout else math.nan,
                "probability": step.probability,
                "indistinguishable from": ", ".join(f"{effect} at {place}" for effect, place in step.indistinguishable),
            }
            for step in self.helpful
        ]
        columns = ["effect", "place", "RMSE fitted [K]", "RMSE held out [K]", "probability", "indistinguishable from"]
        table = pd.DataFrame(rows, columns=columns)
        return table if self.holdout else table.drop(columns="RMSE held out [K]")

    def as_json(self) -> dict[str, object]:
        """The diagnosis as other tools read it."""
        before = None if self.holdout is None else self.holdout.rmse
        listed = [
            {
                "effect": step.effect,
                "at": step.at,
                "rank": rank,
                "rmse_fit": step.fit.rmse,
                "rmse_holdout_before": before,
                "rmse_holdout_after": None if step.holdout is None else step.holdout.rmse,
                "probability": step.probability,
                "p_value": step.p_value,
                "indistinguishable_from": [list(other) for other in step.indistinguishable],
                "separate_by": step.declaration.effect.signature.separate_by if step.declaration else "",
            }
            for rank, step in enumerate(self.helpful, start=1)
        ]
        return {
            "verdict": self.verdict,
            "rmse_fit": self.fit.rmse,
            "rmse_holdout": before,
            "lack_of_fit": self.scores.lack_of_fit,
            "discrepancy": self.evidence.discrepancy,
            "probabilities": probabilities_as_json(self.probabilities),
            "candidates": listed,
        }


def probabilities_as_json(probabilities: Sequence[tuple[Key | None, float]]) -> list[dict[str, object]]:
    """Effect, place and probability of each answer; `null` for nothing being missing."""
    pairs = [(key or (None, None), probability) for key, probability in probabilities]
    return [{"effect": effect, "at": at, "probability": probability} for (effect, at), probability in pairs]


# --- The procedure --------------------------------------------------------------------------------


_SEARCH_STEP = 5.0  # s; effects are sought on means over so long, which loses little and saves most of the time
_MOST_STEPS = 4000  # of all fitted runs together: days of data get longer means, so that memory stays bounded
_MOST_REFITS = 6  # the most probable by score; the best places of further effects come on top
_LEAST_SHARE = 1e-300  # of a probability; its logarithm stays finite
_NO_ANSWER = 100.0  # odds against an effect from which on it is not listed as an answer
CREDIBLE = 20.0
"""Odds within which the data do not tell two answers apart: strong evidence begins above them [KassRaftery1995]."""


def diagnose(
    model: Model,
    data: DataSplit,
    *,
    refits: int = _MOST_REFITS,
    ambient_error: float = 0.0,
    executor: Executor | None = None,
    report: Report = lambda _: None,
) -> Diagnosis:
    """Fit the model, score every candidate, refit the most probable, and judge.

    Args:
        model: the model to question.
        data: the runs to fit, and those held out.
        refits: how many candidates to refit at least.
        ambient_error: how far the ambient sensor may be off in each run [K], one standard deviation.
        executor: where refits run; here, one after the other, by default.
        report: called with a sentence on what is being done.

    Raises:
        InputError: a run lacks an input of the model.
    """
    coarse = for_search(data)
    model = with_ambient_bias(model, data, ambient_error)
    report("fitting the model as it stands")
    base = unless_interrupted(fit_segments(model, coarse.fit))
    question = Question(Likelihood(base, common_columns(coarse)), coarse, refits, executor, report)
    diagnosis = question.ask(base)
    if diagnosis.verdict == "unexplained" and diagnosis.best:
        report("looking for several effects at once")
        last, added = diagnosis, []
        for _ in range(_TOGETHER - 1):
            if last.best is None or last.best.declaration is None:
                break
            added.append(last.best.declaration)
            last = question.ask(last.best.fit, added)
        reached = last.best or Step(last.fit, evidence=last.evidence)
        return replace(diagnosis, verdict="missing") if explains_most(diagnosis, reached) else diagnosis
    return diagnosis


def for_search(data: DataSplit) -> DataSplit:
    """The same data in the steps of a search: 5 s, longer for more than five hours to fit."""
    seconds = sum(len(segment.run) * segment.run.step for segment in data.fit)
    return data.coarsened(max(_SEARCH_STEP, seconds / _MOST_STEPS))


def common_columns(data: DataSplit) -> set[str]:
    """Log columns that all fitted runs have."""
    return set.intersection(*(set(segment.run.columns) for segment in data.fit))


@dataclass(frozen=True)
class Question:
    """The question what a model lacks, asked of any fitted model of the same readings.

    Args:
        likelihood: of the readings.
        data: in the steps of the search.
        refits: how many candidates to refit at least.
        executor: where refits run; here, one after the other, by default.
        report: called with a sentence on what is being done.
    """

    likelihood: Likelihood
    data: DataSplit
    refits: int = _MOST_REFITS
    executor: Executor | None = None
    report: Report = lambda _: None

    def ask(self, base: Fit, added: Sequence[EffectDeclaration] = ()) -> Diagnosis:
        """What a fitted model lacks.

        Args:
            base: the fit.
            added: effects that its model has beyond the one that was given.
        """
        possible = possible_effects(base, common_columns(self.data))
        self.report(f"scoring {len(possible)} candidates")
        scores = score(base, possible, self.likelihood, added)
        alone = self.likelihood.of(base, added)
        worthwhile = _shortlist(scores, self.refits)
        self.report(f"refitting {len(worthwhile)} of them")
        steps = self._judged(refit_all(base, worthwhile, self.executor), worthwhile, alone, added)
        refitted = {step.key for step in steps}
        left = [each.log_odds for each in scores.ranked if each.candidate.key not in refitted]
        total = float(np.logaddexp.reduce([0.0, *(step.log_odds for step in steps), *left]))
        steps = [self.on_held_out(step) for step in _shared(steps, total)]
        holdout = holdout_errors(base, self.data.holdout)
        return _judged(Diagnosis("unexplained", base, alone, holdout, scores, tuple(steps), exp(-total)))

    def on_held_out(self, step: Step) -> Step:
        """A step with what held-out runs say of its fit."""
        if not self.data.holdout:
            return step
        predictions = [predict(step.fit.model, each, step.fit.problem.sigma) for each in self.data.holdout]
        errors = Errors.of(np.concatenate([each.error.ravel() for each in predictions]))
        return replace(step, holdout=errors, log_predictive=self.likelihood.of_predictions(predictions))

    def _judged(
        self,
        steps: Sequence[Step],
        scores: Sequence[Score],
        alone: Evidence,
        added: Sequence[EffectDeclaration],
    ) -> list[Step]:
        """The refits with their evidence, the most probable first; none that ended at a bound."""
        judged = []
        for step, each in zip(steps, scores, strict=True):
            if step.declaration is None or step.at_bounds:
                continue
            evidence = self.likelihood.of(step.fit, [*added, step.declaration])
            odds = evidence.log_evidence - alone.log_evidence + each.log_prior
            judged.append(replace(step, evidence=evidence, log_prior=each.log_prior, log_odds=odds))
        return sorted(judged, key=lambda step: -step.log_odds)


def _shared(steps: Sequence[Step], total: float) -> list[Step]:
    """The steps with their probabilities, and with the names that they share them with.

    Args:
        steps: with their odds.
        total: logarithm of the sum of the odds of all candidates and nothing.
    """
    return [
        replace(
            step,
            probability=exp(step.log_odds - total),
            indistinguishable=tuple(
                other.key
                for other in steps
                if other is not step and abs(other.log_odds - step.log_odds) < log(CREDIBLE)
            ),
        )
        for step in steps
    ]


# --- Refits: the score is a first-order guess, the refit is what counts ---------------------------


_ITERATIONS, _PRECISION = 25, 3e-4  # of the cost: enough to rank; the step that is kept is fitted to the end
_SAME_EFFECT_SHARE = 0.2  # the best place of an effect is refitted if its log Bayes factor is so much of the best
_NEAR = 1.3  # times the least misfit; a fit that was cut off so near to it may yet reach it
_TYPICAL_RANGE = (0.02, 20.0)  # first-order amplitudes outside this share of the typical size are not trusted


def _shortlist(scores: Scores, most: int) -> list[Score]:
    """The candidates worth an exact refit: the most probable, and the best place of every effect that scores well.

    None that is a hundred times less probable than nothing, or too small to matter. Effects with an inner state look
    the same to first order, so each effect gets its chance.
    """
    possible = [each for each in scores.worthwhile if each.log_odds > -log(_NO_ANSWER)]
    chosen = possible[:most]
    effects = {each.candidate.effect for each in chosen}
    for each in possible[most:]:
        comparable = each.log_bayes_factor > _SAME_EFFECT_SHARE * chosen[0].log_bayes_factor
        if comparable and each.candidate.effect not in effects:
            effects.add(each.candidate.effect)
            chosen.append(each)
    return chosen


def refit_all(base: Fit, scores: Sequence[Score], executor: Executor | None = None) -> list[Step]:
    """Refit each candidate, in the order given.

    Args:
        base: the fitted baseline.
        scores: candidates with their first-order sizes.
        executor: where to run them; here, one after the other, by default.
    """
    if not scores:
        return []
    run = executor.map if executor else map
    steps = list(run(_refitted, [(base, each) for each in scores]))
    # A large effect is a long way from the baseline; cut off, it would seem worse than another name for the same.
    near = _NEAR * min(step.fit.cost for step in steps)
    cut_off = [k for k, step in enumerate(steps) if step.fit.status == "not converged" and step.fit.cost <= near]
    for k, longer in zip(cut_off, run(finished, [steps[k].fit for k in cut_off]), strict=True):
        steps[k] = replace(steps[k], fit=unless_interrupted(longer))
    return steps


def _refitted(task: tuple[Fit, Score]) -> Step:
    """One candidate from its first-order size; one argument, so that any executor's `map` takes it."""
    base, score = task
    size = None
    if score.candidate.effect.amplitude() is not None:
        least, most = (share * score.candidate.typical for share in _TYPICAL_RANGE)
        size = float(np.sign(score.amplitude) * np.clip(abs(score.amplitude), least, most))
    declaration = score.candidate.declaration(size, score.shape)
    return Step(refit(base, declaration), declaration)


def refit(base: Fit, declaration: EffectDeclaration) -> Fit:
    """The baseline and one more effect, started from the baseline's solution."""
    return continued(base, base.model.network.with_effects([declaration]))


def continued(base: Fit, network: Network) -> Fit:
    """Fit a network that differs from a fitted one by some effects, started from its solution; as far as ranking needs.

    Args:
        base: the fit to start from.
        network: the network to fit, to the same readings.

    Raises:
        KeyboardInterrupt: Ctrl-C ended the fit.
    """
    model, problem = Model(network), base.problem
    bound_runs = [replace(bind(model, bound.run), counted=bound.counted) for bound in problem.bound_runs]
    old_values = {parameter.name: parameter.value for parameter in base.model.parameters}
    values = np.array([old_values.get(parameter.name, parameter.value) for parameter in model.parameters])
    starts = [
        _carried_over(base.model, model, start, bound)
        for start, bound in zip(base.point.starts, bound_runs, strict=True)
    ]
    return unless_interrupted(
        fit(
            model,
            bound_runs,
            symmetry_penalty=problem.symmetry_penalty,
            sigma=problem.sigma,
            guess=Point(values, starts),
            iterations=_ITERATIONS,
            precision=_PRECISION,
        )
    )


def _carried_over(old: Model, new: Model, states: FloatArray, bound: BoundRun) -> FloatArray:
    """Initial states of the new model: those of the old one by name, new hidden states in equilibrium."""
    nodes = dict(zip(new.nodes, default_start(new, bound).tolist(), strict=False))
    return start_from(new, bound, nodes | dict(zip(old.states, states.tolist(), strict=True)))


def unless_interrupted(done: Fit) -> Fit:
    """A fit as it is; a search of many fits stops where one was stopped, since a half-done one decides nothing.

    Raises:
        KeyboardInterrupt: Ctrl-C ended the fit.
    """
    if done.status == "interrupted":
        raise KeyboardInterrupt
    return done


# --- The verdict ----------------------------------------------------------------------------------


_TOGETHER = 3  # effects that may account for the misfit together
_MOST = 0.5  # share of the fitted misfit beyond noise that must go with what is added
_RUNS_DIFFER = 0.3  # K; two runs differ by so much in their air and sensors alone, see `Effect.in_every_log`
_CONTRADICTED = 2.0  # times the larger of noise and fitted error, from which on a held-out error speaks against a model


def explains_most(before: Diagnosis, after: Step) -> bool:
    """Whether a larger model removes most of the misfit beyond noise, or leaves nothing that matters."""
    small = after.evidence is not None and is_small(after.evidence)
    return small or explained_share(before.fit, after.fit, before.scores.noise) > _MOST


def is_small(evidence: Evidence) -> bool:
    """Whether what nothing explains is too little to look for an effect in."""
    return evidence.discrepancy < NEGLIGIBLE


def contradicted(base: Fit, holdout: Errors | None) -> bool:
    """Whether held-out runs speak against a model that the fitted runs have nothing against."""
    if holdout is None:
        return False
    floor = float(np.sqrt(np.mean(base.noise.floor**2)))
    return holdout.rmse > max(_CONTRADICTED * max(floor, base.rmse), _RUNS_DIFFER)


def _judged(diagnosis: Diagnosis) -> Diagnosis:
    """The diagnosis with its verdict."""
    verdict: Verdict
    if not diagnosis.refits or diagnosis.refits[0].log_odds < 0:
        agreed = not contradicted(diagnosis.fit, diagnosis.holdout)
        verdict = "adequate" if agreed and is_small(diagnosis.evidence) else "unexplained"
    else:
        verdict = "missing" if explains_most(diagnosis, diagnosis.refits[0]) else "unexplained"
    return replace(diagnosis, verdict=verdict)
