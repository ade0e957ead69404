"""Answers to what a fitted model lacks: candidates scored, the best few refitted, and how probable each of them is.

Of every candidate the score is a guess to first order; what counts is the fit with it, everything else free, but that
what the given model tells must not vanish beside it. Nothing missing is one of the answers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from math import log
from weakref import WeakKeyDictionary

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.basics.parameters import ParameterInstance
from lptn.basics.places import is_pattern
from lptn.basics.tables import Tabular
from lptn.diagnose.candidates import Candidate
from lptn.diagnose.fit_statistics import criterion_difference
from lptn.diagnose.probability import (
    OCCAM,
    is_implausible,
    log_evidence_of_starts,
    log_odds_by_score,
    log_prior_of_sizes,
    log_prior_of_starts,
    log_priors,
    open_pairs,
    probabilities,
)
from lptn.diagnose.refits import continued, kept_beside, refit, unless_interrupted
from lptn.diagnose.scores import Score, Scores, score
from lptn.effects import Effect
from lptn.identify.comparison import Errors, Prediction, errors_of, predict
from lptn.identify.data import DataSplit
from lptn.identify.fitting import Fit, finished
from lptn.identify.validation import holdout_errors
from lptn.model.network import EffectDeclaration
from lptn.simulate.simulation import SimulationError

Key = tuple[str, str]
"""Effect and place, such as `("sensor_offset", "FR_calf")`; `"FR_calf@monday"` for an effect in one run only."""
NOTHING: Key = ("", "")
"""The answer that nothing is missing."""
Report = Callable[[str], None]
"""Called with a sentence on what is being done."""


LIKELY = 0.5
"""The probability from which an answer is likelier than all others together."""


def named(key: Key) -> str:
    """An effect and its place, as the library's own sentences have it."""
    return f"{key[0]} at {key[1]}"


_EVIDENCE_OF_STARTS: WeakKeyDictionary[Fit, float] = WeakKeyDictionary()
"""Of each fit that somebody still has: the steps of a search are copied often, with the same fit."""


@dataclass(frozen=True, eq=False, repr=False)
class Step(Tabular):
    """A fitted model, and the effect that it has beyond the model before it.

    A candidate that was refitted is a step that could be taken; a history is made of the steps that were.

    Args:
        fit: of the model with the effect.
        declaration: the effect as added; `None` for the model as given.
        gain: by how much the information criterion prefers it to the model without it.
        log_odds: logarithm of the odds beforehand that it is this effect at this place that is missing.
        probability: of this answer by the fitted runs, given that one of those that were refitted is right.
        in_some_run: probability that it, or the same in another run instead, is missing, of an effect of one run: which
            of two runs is odd is for held-out ones to tell.
        places: where it stands, in whichever run, and where the fitted data can't tell the same effect from it: of two
            joints that share a resistance, more loss at one is less at the other. Of several places together these are
            other patterns, such as all joints beside everything.
        at_its_place: probability that anything is missing at these places, by whatever name; by all runs where
            `by_all_runs` is known.
        by_all_runs: probability by the held-out runs as well, which may have chosen it; `None` without any, or where no
            search asked.
        p_value: how often chance alone would score as much, over all candidates.
        indistinguishable: candidates that the fitted data can't tell from it.
        holdout: errors on held-out runs, each with nuisance parameters of its own, `None` without any.
        plain: of the same model without nuisance parameters, where that predicts held-out runs better as they were
            logged; `None` where it does not, and where nobody asked.
        holdout_as_logged: errors of `for_use` on held-out runs without nuisance parameters, as the model in a file
            predicts them; `None` where nobody asked.
        test: errors on runs that chose nothing, `None` without any.
        predicted: the held-out runs that `holdout` is of; empty where they were not kept.
    """

    fit: Fit
    declaration: EffectDeclaration | None = None
    gain: float = 0.0
    log_odds: float = 0.0
    probability: float = 0.0
    in_some_run: float = 0.0
    places: tuple[str, ...] = ()
    at_its_place: float = 0.0
    by_all_runs: float | None = None
    p_value: float = 1.0
    indistinguishable: tuple[Key, ...] = ()
    holdout: Errors | None = None
    plain: Fit | None = None
    holdout_as_logged: Errors | None = None
    test: Errors | None = None
    predicted: tuple[Prediction, ...] = ()

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
    def amplitude(self) -> ParameterInstance | None:
        """The effect's fitted amplitude; `None` for the model as given, and for an effect without one."""
        declared = self.declaration
        amplitude = declared.effect.amplitude() if declared else None
        if declared is None or amplitude is None:
            return None
        name = declared.shared_name(amplitude.name)
        return next((parameter for parameter in self.fit.model.parameters if parameter.name == name), None)

    @property
    def size(self) -> float:
        """The amplitude in units of its usual size, 1 for an effect without one."""
        amplitude = self.amplitude
        return 1.0 if amplitude is None else amplitude.value / amplitude.declared.typical

    @property
    def for_use(self) -> Fit:
        """The fit whose values a file gets: of two that there may be the one that predicts what is logged better."""
        return self.plain or self.fit

    @property
    def likely(self) -> bool:
        """Whether the fitted data alone make it likelier than all others together, whichever run it is in."""
        return max(self.probability, self.in_some_run) >= LIKELY

    @property
    def outweighed(self) -> bool:
        """Whether the fitted data alone speak for another answer; several steps together may begin with it even so."""
        return 0.0 < self.probability < LIKELY and not self.indistinguishable

    @property
    def parameters(self) -> int:
        """Number of free parameters of the model."""
        return len(self.fit.free)

    @property
    def summary(self) -> str:
        """Effect, place and errors in one line."""
        what = named(self.key) if self.declaration else "as given"
        rmse = {"fitted": self.fit.rmse}
        rmse |= {"held out": self.holdout.rmse} if self.holdout else {}
        rmse |= {"test": self.test.rmse} if self.test else {}
        errors = ", ".join(f"{value:.3g} K {data}" for data, value in rmse.items())
        return f"{what}, {self.parameters} parameters, RMSE {errors}"

    def to_pandas(self) -> pd.DataFrame:
        """The model's parameters, as `Fit.to_pandas` gives them."""
        return self.fit.to_pandas()

    @property
    def log_evidence_of_starts(self) -> float:
        """Of measured and of hidden states, as `probability` has it; kept, since a search asks for it often."""
        if self.fit not in _EVIDENCE_OF_STARTS:
            _EVIDENCE_OF_STARTS[self.fit] = log_prior_of_starts(self.fit) + log_evidence_of_starts(self.fit)
        return _EVIDENCE_OF_STARTS[self.fit]

    @property
    def declarations(self) -> list[EffectDeclaration]:
        """The effect as a list, empty for the model as given."""
        return [self.declaration] if self.declaration else []

    def predicting(self, data: DataSplit) -> Step:
        """The step with the held-out runs as it predicts them, and its errors there."""
        predicted = tuple(predict(self.fit.model, segment, self.fit.problem.sigma) for segment in data.holdout)
        return replace(self, predicted=predicted, holdout=errors_of(predicted))

    def predicting_if_it_can(self, data: DataSplit) -> Step | None:
        """The same; `None` where the model is too stiff for a held-out run: it predicts nothing that was not fitted."""
        try:
            return self.predicting(data)
        except SimulationError:
            return None

    def fitted_as(self, other: Step) -> Step:
        """The step with another's fit of the same model, and what that predicts."""
        return replace(self, fit=other.fit, predicted=other.predicted, holdout=other.holdout)

    def judged_on(self, data: DataSplit) -> Step:
        """The step with its errors on held-out and test runs."""
        return replace(self.predicting(data), test=holdout_errors(self.fit, data.test))

    def made_for_use(self, data: DataSplit) -> Step:
        """The step with the fit whose values a file gets, and its errors on held-out runs as they were logged.

        What is each fitted run's own takes from the parameters what is wrong in the logs, or, in logs without such
        errors, what is right; held-out runs tell which.
        """
        network, plain = self.fit.model.network, None
        errors = holdout_errors(self.fit, data.holdout, own_errors=False)
        if errors is not None and any(declaration.nuisance for declaration in network.effects):
            without = unless_interrupted(finished(continued(self.fit, network.without_nuisances())))
            fewer = holdout_errors(without, data.holdout)
            if fewer is not None and fewer.rmse < errors.rmse:
                plain, errors = without, fewer
        return replace(self, plain=plain, holdout_as_logged=errors)


# --- The procedure --------------------------------------------------------------------------------


SIGNIFICANT = 0.05
"""A score that chance alone reaches less often than this is beyond chance."""
MOST_REFITS = 6
"""The most probable by score; the best places of further effects, and places like these, come on top."""


@dataclass(frozen=True)
class Answers:
    """What a fitted model may lack.

    Args:
        fit: the model as it stands; a better fit than the one asked about, where that had ended in a local minimum.
        scores: all candidates, scored.
        steps: those that were refitted and have a size that somebody would believe, the most probable first.
    """

    fit: Fit
    scores: Scores
    steps: tuple[Step, ...]


def answers(
    base: Fit,
    possible: Sequence[Candidate],
    *,
    refits: int = MOST_REFITS,
    executor: Executor | None = None,
    report: Report = lambda _: None,
) -> Answers:
    """Score candidates, refit the best of those beyond chance, and say how probable each of them is.

    Args:
        base: the fitted model.
        possible: what it may lack.
        refits: how many to refit at least.
        executor: where refits run; here, one after the other, by default.
        report: called with a sentence on what is being done.
    """
    report(f"scoring {len(possible)} candidates")
    scores = score(base, possible)
    odds = {candidate.key: float(log_odds) for candidate, log_odds in zip(possible, log_priors(possible), strict=True)}
    worthwhile = _shortlist(base, scores, odds, refits)
    report(f"refitting {len(worthwhile)} of them")
    refitted = refit_all(base, worthwhile, executor)
    if (better := _beside_an_optimum(base, refitted)) is not None:
        report("a refit found a better fit of the model as it stands: again from there")
        return answers(better, possible, refits=refits, executor=executor, report=report)
    gains = {entry.candidate.key: entry.gain for entry in worthwhile}
    steps = [
        replace(step, log_odds=odds[step.key], p_value=scores.p_value(gains[step.key]))
        for step in refitted
        if not _is_implausible(base, step)
    ]
    return Answers(base, scores, tuple(_by_probability(base, steps)))


# --- Refits: the score is a first-order guess, the refit is what counts ---------------------------


HOPELESS = 1.5
"""Times the misfit of the most promising candidate from which on none is fitted to the end, or followed."""
_SAME_EFFECT_SHARE = 0.2  # the best place of an effect is refitted if it scores so much of the best gain
_TYPICAL_RANGE = (0.02, 20.0)  # first-order amplitudes outside this share of the typical size are not trusted


def _shortlist(base: Fit, scores: Scores, log_priors: Mapping[Key, float], most: int) -> list[Score]:
    """The candidates worth an exact refit; none that chance alone would score.

    The most probable to first order; of every effect that scores well the most probable place and the most probable
    group of places, in all runs and in each alone; and places like one of these, where first order leaves open which.
    Effects with an inner state look the same to first order, so each effect gets its chance. Which of two runs is the
    odd one, the fitted data can't tell, nor which of two like places, where these share a parameter: more at one is
    less at the other.
    """
    significant = [entry for entry in scores.ranked if scores.p_value(entry.gain) < SIGNIFICANT]
    if not significant:
        return []
    odds = log_odds_by_score(base, significant, np.array([log_priors[entry.candidate.key] for entry in significant]))
    least = _SAME_EFFECT_SHARE * significant[0].gain
    chosen: list[Score] = []
    kinds: set[tuple[type[Effect], str, bool]] = set()
    most_probable: dict[tuple[type[Effect], str, object], float] = {}  # of the chosen ones at like places
    for number in np.argsort(-odds, kind="stable"):
        entry, log_odds = significant[number], float(odds[number])
        kind, like = _kind(entry.candidate), _like_places(entry.candidate, base.model.network.dynamic)
        first_of_its_kind = entry.gain >= least and kind not in kinds
        left_open = log_odds > most_probable.get(like, np.inf) - log(OCCAM)
        if len(chosen) < most or first_of_its_kind or left_open:
            chosen.append(entry)
            kinds.add(kind)
            most_probable.setdefault(like, log_odds)
    return chosen


def _kind(candidate: Candidate) -> tuple[type[Effect], str, bool]:
    """Effect, run, and whether it acts at a single place."""
    return candidate.effect, candidate.run, len(candidate.places) == 1


def _like_places(candidate: Candidate, nodes: Sequence[str]) -> tuple[type[Effect], str, object]:
    """Effect, run, and the pattern of a single place and its like; several places are like no others."""
    single = len(candidate.places) == 1
    pattern = candidate.effect.like_places(candidate.places[0], nodes) if single else candidate.places
    return candidate.effect, candidate.run, pattern


def refit_all(base: Fit, scores: Sequence[Score], executor: Executor | None = None) -> list[Step]:
    """Refit each candidate; the one that explains most comes first.

    Args:
        base: the fitted baseline.
        scores: candidates with their first-order sizes, the most promising first.
        executor: where to run them; here, one after the other, by default.
    """
    run = executor.map if executor else map
    steps: list[Step] = []
    for entry in scores:
        steps.append(_refitted((base, entry, np.inf)))
        if not _is_implausible(base, steps[-1]):
            break
    if not steps:
        return []
    # What has no hope to come near the most promising one that somebody would believe is not fitted to the end.
    steps += run(_refitted, [(base, entry, HOPELESS * steps[-1].fit.cost) for entry in scores[len(steps) :]])
    # A large effect is a long way from the baseline; cut off, it would seem worse than another name for the same.
    believed = [step for step in steps if not _is_implausible(base, step)]
    near = HOPELESS * min(step.fit.cost for step in believed or steps)
    cut_off = [k for k, step in enumerate(steps) if step.fit.status == "not converged" and step.fit.cost <= near]
    for k, longer in zip(cut_off, run(finished, [steps[k].fit for k in cut_off]), strict=True):
        steps[k] = _step(base, steps[k].declaration, unless_interrupted(longer))
    least = min([step.fit.cost for step in steps if not _is_implausible(base, step)], default=base.cost)
    steps = [_with_all_that_is_given(base, step, least / HOPELESS) for step in steps]
    return sorted(steps, key=lambda step: -step.gain)


def _with_all_that_is_given(base: Fit, step: Step, rival: float) -> Step:
    """A refit beside which something given vanishes, where that is kept; as it was where others have a hope beside it.

    Nobody believes such a refit: the effect may stand for what vanishes. It may also be right, and what else is still
    missing may drive the rest there; if all that is believed has no hope beside it, it is the one to go on with.

    Args:
        base: the fitted baseline.
        step: the refit.
        rival: a cost to beat; all others have no hope beside what does.
    """
    done, within = step.fit, dict(base.problem.within)
    while step.declaration is not None and done.cost < rival and (kept := kept_beside(done, base)):
        within |= kept
        done = refit(base, step.declaration, rival, within)
    return step if done is step.fit or done.cost >= rival else _step(base, step.declaration, done)


_LOWER = 0.01  # share of the misfit; a fit that only ranks ends within 3e-4 of its minimum


def _is_implausible(base: Fit, step: Step) -> bool:
    return is_implausible(step.fit, step.declarations, base)


def _beside_an_optimum(base: Fit, refitted: Sequence[Step]) -> Fit | None:
    """A better fit of the baseline, where it had ended in a local minimum; `None` where it had not.

    Any effect is a way out of a local minimum, and would seem to explain what it frees. So the refit with the least
    misfit is gone on with from where it is, but without its effect.
    """
    if not refitted:
        return None
    least = min((step.fit for step in refitted), key=lambda fit: fit.cost)
    without = continued(least, base.model.network, base.cost, base.problem.within)
    return unless_interrupted(finished(without)) if without.cost < (1 - _LOWER) * base.cost else None


def _refitted(task: tuple[Fit, Score, float]) -> Step:
    """One candidate from its first-order size; one argument, so that any executor's `map` takes it."""
    base, score, rival = task
    least, most = (share * score.candidate.typical for share in _TYPICAL_RANGE)
    size = float(np.sign(score.amplitude) * np.clip(abs(score.amplitude), least, most))
    declaration = score.candidate.declaration(size, score.shape)
    return _step(base, declaration, refit(base, declaration, rival))


def _step(base: Fit, declaration: EffectDeclaration | None, done: Fit) -> Step:
    return Step(done, declaration, criterion_difference(base, done))


# --- The order of the answers ---------------------------------------------------------------------


def _by_probability(base: Fit, steps: Sequence[Step]) -> list[Step]:
    """The most probable first, each with its probability and with those that can't be told from it.

    Nothing missing is one of the answers that share the probability.
    """
    priors = _log_priors(base, steps)
    fits = [base, *(step.fit for step in steps)]
    of_all, left_open = probabilities(fits, priors)[1:], open_pairs(fits, priors)[1:, 1:]

    judged = []
    for step, probability, rivalled in zip(steps, of_all, left_open, strict=True):
        rivals = [other for other, open_ in zip(steps, rivalled, strict=True) if open_]
        places = _places(step, rivals)
        judged.append(
            replace(
                step,
                probability=float(probability),
                in_some_run=float(of_all[[_but_for_the_run(other) == _but_for_the_run(step) for other in steps]].sum()),
                places=places,
                at_its_place=_at(places, steps, of_all),
                indistinguishable=tuple(rival.key for rival in rivals),
            )
        )
    return [judged[k] for k in sorted(range(len(judged)), key=lambda k: (-judged[k].probability, -judged[k].gain))]


def _but_for_the_run(step: Step) -> tuple[str | None, str, bool]:
    """Effect and place, and whether it acts in one run alone."""
    declared = step.declaration
    return step.effect, declared.at if declared else "", bool(declared and declared.run)


def _places(step: Step, rivals: Sequence[Step]) -> tuple[str, ...]:
    """As `Step.places` has it, of a step and what the fitted data can't tell from it."""
    own = _place(step)
    others = (_place(rival) for rival in rivals if rival.effect == step.effect)
    return tuple(dict.fromkeys([own, *(place for place in others if is_pattern(place) == is_pattern(own))]))


def _at(places: Sequence[str], steps: Sequence[Step], probabilities: FloatArray) -> float:
    """Probability of all steps that stand at some places."""
    return float(probabilities[[_place(step) in places for step in steps]].sum())


def _place(step: Step) -> str:
    """The place without the run; of several places with it: everywhere in one run is no place that a fault may have."""
    declared = step.declaration
    if declared is None:
        return ""
    return declared.where if is_pattern(declared.at) else declared.at


def compared(base: Fit, known: Sequence[Step], step: Step, data: DataSplit) -> Step:
    """A step that could be taken from a model, fitted elsewhere, among the answers to what that model lacks."""
    others = [other for other in known if other.key != step.key]
    steps = [replace(step, gain=criterion_difference(base, step.fit)), *others]
    judged = next(answer for answer in _by_probability(base, steps) if answer.key == step.key)
    if not data.holdout:
        return judged
    by_all_runs = _by_all_runs(Step(base), steps, data)
    at_its_place = _at(judged.places, steps, by_all_runs)
    return replace(judged, by_all_runs=float(by_all_runs[0]), at_its_place=at_its_place)


def something_missing(given: Step, steps: Sequence[Step], data: DataSplit) -> float:
    """Probability, by all runs, that one of several effects is missing in a model, and not nothing.

    Args:
        given: the model.
        steps: with one effect more each.
        data: with the held-out runs, which may confirm what the fitted ones ask for, or deny it.
    """
    return float(_by_all_runs(given, steps, data).sum()) if steps else 0.0


def _by_all_runs(given: Step, steps: Sequence[Step], data: DataSplit) -> FloatArray:
    """Probability of each step, beside the others and that nothing is missing, by fitted and held-out runs."""
    every = [given, *steps]
    predicted = held_out(every, data) if data.holdout else ()
    return probabilities([step.fit for step in every], _log_priors(given.fit, steps), predicted)[1:]


def held_out(steps: Sequence[Step], data: DataSplit) -> list[tuple[Prediction, ...]]:
    """The held-out runs as the fit of each of several steps predicts them."""
    return [step.predicted or step.predicting(data).predicted for step in steps]


def _log_priors(base: Fit, steps: Sequence[Step]) -> FloatArray:
    """Of nothing missing, then of each step: logarithms of what is thought of them beforehand, shape (1 + steps,)."""
    of_sizes = [step.log_odds + log_prior_of_sizes(step.fit, step.declarations) for step in steps]
    of_starts = [step.log_evidence_of_starts for step in (Step(base), *steps)]
    return np.asarray(np.array([0.0, *of_sizes]) + np.array(of_starts))
