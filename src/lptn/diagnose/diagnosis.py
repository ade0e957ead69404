"""The decision what a model lacks: every effect of the catalogue scored, the best few refitted, a verdict.

1. The model is fitted as it stands, on means over 5 s.
2. Every effect at every place is scored to first order at that fit (`lptn.diagnose.scores`), and what chance alone
   would score is simulated.
3. The best of those beyond chance are refitted exactly, everything else free.
4. They are ordered by probability (`lptn.diagnose.probability`): by how well they explain the fitted data, and how
   usual such an effect is and its size. Those that the best does not rule out are one answer with several names; names
   that held-out runs speak against come last. What has a size that nobody would believe is no answer.
5. The verdict: `"adequate"` if nothing is beyond noise, nothing helps and no held-out run stands out; `"missing"` if
   the best candidate, or three one after the other, remove most of the misfit, on held-out runs too; else
   `"unexplained"`.
6. Where nothing explains a held-out run, and one parameter that differs in it would, it is granted that parameter, and
   the question is asked once more: a fan in one run says nothing of the model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.basics.tables import Tabular
from lptn.diagnose.candidates import AMBIENT_ERROR, TORQUE_ERROR, possible_effects, with_errors_of_runs
from lptn.diagnose.fit_statistics import (
    LACKING,
    criterion_difference,
    explained_share,
    lack_of_fit,
    standing_out,
)
from lptn.diagnose.probability import (
    are_rivals,
    is_implausible,
    log_evidence_of_starts,
    log_odds_by_score,
    log_prior_of_sizes,
    log_prior_of_starts,
    log_priors,
    probabilities,
    probabilities_by_score,
)
from lptn.diagnose.refits import continued, refit, unless_interrupted
from lptn.diagnose.runs_that_differ import RunDifference, granted_differences
from lptn.diagnose.scores import Score, Scores, score
from lptn.identify.comparison import Errors, Prediction, predict
from lptn.identify.data import DataSplit
from lptn.identify.fitting import Fit, finished
from lptn.identify.validation import fit_segments, holdout_errors
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration

Verdict = Literal["adequate", "missing", "unexplained"]
Key = tuple[str, str]
"""Effect and place, such as `("sensor_offset", "FR_calf")`; `"FR_calf@monday"` for an effect in one run only."""
Report = Callable[[str], None]
"""Called with a sentence on what is being done."""


LIKELY = 0.5
"""The probability from which an answer is likelier than all others together."""


@dataclass(frozen=True, eq=False, repr=False)
class Step(Tabular):
    """A fitted model, and the effect that it has beyond the model before it.

    A candidate that was refitted is a step that could be taken; a history is made of the steps that were.

    Args:
        fit: of the model with the effect.
        declaration: the effect as added; `None` for the model as given.
        gain: by how much the information criterion prefers it to the model without it.
        size: the effect's amplitude in units of its typical size, when it was compared with other candidates.
        log_odds: logarithm of the odds beforehand that it is this effect at this place that is missing.
        probability: of this answer by the fitted runs, given that one of those that were refitted is right.
        by_all_runs: the same by the held-out runs as well, which may have chosen it; `None` without any, or where no
            search asked.
        p_value: how often chance alone would score as much, over all candidates.
        indistinguishable: candidates that the fitted data can't tell from it.
        holdout: errors on held-out runs, `None` without any.
        test: errors on runs that chose nothing, `None` without any.
    """

    fit: Fit
    declaration: EffectDeclaration | None = None
    gain: float = 0.0
    size: float = 1.0
    log_odds: float = 0.0
    probability: float = 0.0
    by_all_runs: float | None = None
    p_value: float = 1.0
    indistinguishable: tuple[Key, ...] = ()
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
        what = f"{self.effect} at {self.at}" if self.declaration else "as given"
        rmse = {"fitted": self.fit.rmse}
        rmse |= {"held out": self.holdout.rmse} if self.holdout else {}
        rmse |= {"test": self.test.rmse} if self.test else {}
        errors = ", ".join(f"{value:.3g} K {data}" for data, value in rmse.items())
        return f"{what}, {self.parameters} parameters, RMSE {errors}"

    def to_pandas(self) -> pd.DataFrame:
        """The model's parameters, as `Fit.to_pandas` gives them."""
        return self.fit.to_pandas()

    @cached_property
    def log_evidence_of_starts(self) -> float:
        """Of measured and of hidden states, as `probability` has it; kept, since a search asks for it often."""
        return log_prior_of_starts(self.fit) + log_evidence_of_starts(self.fit)

    @property
    def declarations(self) -> list[EffectDeclaration]:
        """The effect as a list, empty for the model as given."""
        return [self.declaration] if self.declaration else []


@dataclass(frozen=True, repr=False)
class Diagnosis(Tabular):
    """What a fitted model lacks.

    Args:
        verdict: `"adequate"`: within the noise; `"missing"`: an effect of the catalogue, or a few together,
            remove most of the misfit; `"unexplained"`: misfit that the catalogue does not remove.
        fit: the fitted baseline.
        holdout: its errors on held-out runs, `None` without any.
        scores: all candidates, scored.
        refits: those that were refitted, best first.
        differing: held-out runs that are predicted with one parameter of their own, fitted on the run itself.
    """

    verdict: Verdict
    fit: Fit
    holdout: Errors | None
    scores: Scores
    refits: tuple[Step, ...]
    differing: tuple[RunDifference, ...] = ()

    @property
    def helpful(self) -> tuple[Step, ...]:
        """The refits that pay for their parameters; the scores promised as much of the others."""
        return tuple(step for step in self.refits if step.gain > 0)

    @property
    def best(self) -> Step | None:
        """The first answer, `None` where no candidate helps."""
        return self.helpful[0] if self.helpful else None

    @property
    def probabilities(self) -> list[tuple[Key, float]]:
        """What the model lacks and how probable that is by the fitted runs, the most probable first.

        Nothing has an empty key. Given that one of the answers is right: empty where the verdict is that none is. Where
        no candidate was worth a refit, those that may be missing all the same, to first order.
        """
        if self.verdict == "unexplained":
            return []
        answers = [(step.key, step.probability) for step in self.refits] or self._by_score
        of_nothing = 1.0 - sum(probability for _, probability in answers)
        listed = [answer for answer in answers if self.refits or answer[1] >= _WORTH_A_LINE]
        return sorted([(NOTHING, of_nothing), *listed], key=lambda answer: -answer[1])

    @cached_property
    def _by_score(self) -> list[tuple[Key, float]]:
        ranked = self.scores.ranked
        shares = probabilities_by_score(self.fit, ranked, self.scores.negligible)
        return [(each.candidate.key, float(share)) for each, share in zip(ranked, shares, strict=True)]

    def probabilities_as_json(self) -> list[dict[str, object]]:
        """The same as other tools read it, `null` for nothing."""
        return [
            {"effect": effect or None, "at": at or None, "probability": probability}
            for (effect, at), probability in self.probabilities
        ]

    @property
    def only_held_out_runs_object(self) -> bool:
        """Whether the fitted runs have nothing against the model, and held-out runs have."""
        return self.verdict == "unexplained" and not _more_is_wanted(self.scores, self.refits)

    @property
    def summary(self) -> str:
        """Verdict and first answer in one line."""
        error = f"RMSE {self.fit.rmse:.3g} K fitted"
        if self.holdout:
            error += f", {self.holdout.rmse:.3g} K held out"
        answer = f"; first answer {self.best.effect} at {self.best.at}" if self.best else ""
        return f"{self.verdict}: {error}{answer}"

    def to_pandas(self) -> pd.DataFrame:
        """A row for each answer, the best first: effect, place, errors [K] with it, p-value, and its other names."""
        rows = [
            {
                "effect": step.effect,
                "place": step.at,
                "RMSE fitted [K]": step.fit.rmse,
                "RMSE held out [K]": step.holdout.rmse if step.holdout else math.nan,
                "p": step.p_value,
                "indistinguishable from": ", ".join(f"{effect} at {place}" for effect, place in step.indistinguishable),
            }
            for step in self.helpful
        ]
        columns = ["effect", "place", "RMSE fitted [K]", "RMSE held out [K]", "p", "indistinguishable from"]
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
                "p_value": step.p_value,
                "probability": step.probability,
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
            "probabilities": self.probabilities_as_json(),
            "candidates": listed,
        }


# --- The procedure --------------------------------------------------------------------------------


NOTHING: Key = ("", "")
"""The answer that nothing is missing."""
_WORTH_A_LINE = 0.01  # probability; of some hundred candidates most are improbable
SIGNIFICANT = 0.05
"""A score that chance alone reaches less often than this is beyond chance."""
_SEARCH_STEP = 5.0  # s; effects are sought on means over so long, which loses little and saves most of the time
_MOST_STEPS = 4000  # of all fitted runs together: days of data get longer means, so that memory stays bounded
_MOST_REFITS = 6  # the best by score; the best places of further effects come on top


def diagnose(
    model: Model,
    data: DataSplit,
    *,
    refits: int = _MOST_REFITS,
    ambient_error: float = AMBIENT_ERROR,
    torque_error: float = TORQUE_ERROR,
    executor: Executor | None = None,
    report: Report = lambda _: None,
) -> Diagnosis:
    """Fit the model, score every candidate, refit the best few, and judge.

    Args:
        model: the model to question.
        data: the runs to fit, and those held out.
        refits: how many candidates to refit at least.
        ambient_error: how far the ambient sensor may be off in each run [K], one standard deviation.
        torque_error: how far each joint's torque or current may be off in each run, as a share, one standard deviation.
        executor: where refits run; here, one after the other, by default.
        report: called with a sentence on what is being done.

    Raises:
        InputError: a run lacks an input of the model.
    """
    coarse = for_search(data)
    model = with_errors_of_runs(model, data, ambient_error, torque_error)
    report("fitting the model as it stands")
    base = unless_interrupted(fit_segments(model, coarse.fit))
    diagnosis = examine(base, coarse, refits=refits, executor=executor, report=report)
    if diagnosis.verdict == "unexplained" and coarse.holdout:
        report("looking for what differs in held-out runs")
        likeliest = diagnosis.best.fit if diagnosis.best else diagnosis.fit
        granted, differing = granted_differences(model, likeliest, coarse.holdout)
        if differing:
            base = continued(diagnosis.fit, granted.network)
            diagnosis = examine(base, coarse, refits=refits, executor=executor, report=report)
            diagnosis = replace(diagnosis, differing=differing)
    if diagnosis.verdict == "unexplained" and diagnosis.refits:
        report("looking for several effects at once")
        if _three_together_explain(diagnosis, coarse, refits, executor):
            return replace(diagnosis, verdict="missing")
    return diagnosis


def for_search(data: DataSplit) -> DataSplit:
    """The same data in the steps of a search, 5 s, longer for more than five hours to fit, and of common inputs."""
    seconds = sum(len(segment.run) * segment.run.step for segment in data.fit)
    return data.of_common_inputs().coarsened(max(_SEARCH_STEP, seconds / _MOST_STEPS))


def examine(
    base: Fit,
    data: DataSplit,
    *,
    refits: int = _MOST_REFITS,
    executor: Executor | None = None,
    report: Report = lambda _: None,
) -> Diagnosis:
    """`diagnose` for a model that is fitted already, on data of the step it was fitted with.

    Where that fit had ended in a local minimum, the diagnosis is of a better one.
    """
    columns = set.intersection(*(set(segment.run.columns) for segment in data.fit))
    possible = possible_effects(base, columns)
    report(f"scoring {len(possible)} candidates")
    scores = score(base, possible)
    odds = {each.key: float(log_odds) for each, log_odds in zip(possible, log_priors(possible), strict=True)}
    worthwhile = _shortlist(base, scores, odds, refits)
    report(f"refitting {len(worthwhile)} of them")
    refitted = refit_all(base, worthwhile, executor)
    if (better := _beside_an_optimum(base, refitted)) is not None:
        report("a refit found a better fit of the model as it stands: again from there")
        return examine(better, data, refits=refits, executor=executor, report=report)
    gains = {each.candidate.key: each.gain for each in worthwhile}
    steps = [
        replace(
            step,
            log_odds=odds[step.key],
            p_value=scores.p_value(gains[step.key]),
            holdout=holdout_errors(step.fit, data.holdout),
        )
        for step in refitted
        if not is_implausible(step.fit, step.declarations)
    ]
    ordered = _holdout_decides(_by_probability(base, steps))
    holdout = holdout_errors(base, data.holdout)
    return Diagnosis(_verdict(base, data, holdout, scores, ordered), base, holdout, scores, tuple(ordered))


# --- Refits: the score is a first-order guess, the refit is what counts ---------------------------


HOPELESS = 1.5
"""Times the misfit of the most promising candidate from which on none is fitted to the end, or followed."""
_SAME_EFFECT_SHARE = 0.2  # the best place of an effect is refitted if it scores so much of the best gain
_TYPICAL_RANGE = (0.02, 20.0)  # first-order amplitudes outside this share of the typical size are not trusted


def _shortlist(base: Fit, scores: Scores, log_priors: Mapping[Key, float], most: int) -> list[Score]:
    """The candidates worth an exact refit: the most probable to first order, and of every effect that scores well the
    most probable place, in all runs and in each alone.

    None that chance alone would score. Effects with an inner state look the same to first order, so each effect gets
    its chance; and which of two runs is the odd one, the fitted data can't tell.
    """
    significant = [each for each in scores.ranked if scores.p_value(each.gain) < SIGNIFICANT]
    if not significant:
        return []
    odds = log_odds_by_score(base, significant, np.array([log_priors[each.candidate.key] for each in significant]))
    ordered = [significant[k] for k in np.argsort(-odds, kind="stable")]
    chosen, least = ordered[:most], _SAME_EFFECT_SHARE * significant[0].gain
    kinds = {(each.candidate.effect, each.candidate.run) for each in chosen}
    for each in ordered[most:]:
        kind = (each.candidate.effect, each.candidate.run)
        if each.gain >= least and kind not in kinds:
            kinds.add(kind)
            chosen.append(each)
    return chosen


def refit_all(base: Fit, scores: Sequence[Score], executor: Executor | None = None) -> list[Step]:
    """Refit each candidate; the one that explains most comes first.

    Args:
        base: the fitted baseline.
        scores: candidates with their first-order sizes, the most promising first.
        executor: where to run them; here, one after the other, by default.
    """
    if not scores:
        return []
    run = executor.map if executor else map
    # What has no hope to come near the most promising one is not fitted to the end.
    steps = [_refitted((base, scores[0], np.inf))]
    steps += run(_refitted, [(base, each, HOPELESS * steps[0].fit.cost) for each in scores[1:]])
    # A large effect is a long way from the baseline; cut off, it would seem worse than another name for the same.
    near = HOPELESS * min(step.fit.cost for step in steps)
    cut_off = [k for k, step in enumerate(steps) if step.fit.status == "not converged" and step.fit.cost <= near]
    for k, longer in zip(cut_off, run(finished, [steps[k].fit for k in cut_off]), strict=True):
        steps[k] = _step(base, steps[k].declaration, unless_interrupted(longer))
    return sorted(steps, key=lambda step: -step.gain)


_LOWER = 0.01  # share of the misfit; a fit that only ranks ends within 3e-4 of its minimum


def _beside_an_optimum(base: Fit, refitted: Sequence[Step]) -> Fit | None:
    """A better fit of the baseline, where it had ended in a local minimum; `None` where it had not.

    Any effect is a way out of a local minimum, and would seem to explain what it frees. So the refit with the least
    misfit is gone on with from where it is, but without its effect.
    """
    if not refitted:
        return None
    least = min((step.fit for step in refitted), key=lambda fit: fit.cost)
    without = continued(least, base.model.network, base.cost)
    return unless_interrupted(finished(without)) if without.cost < (1 - _LOWER) * base.cost else None


def _refitted(task: tuple[Fit, Score, float]) -> Step:
    """One candidate from its first-order size; one argument, so that any executor's `map` takes it."""
    base, score, rival = task
    amplitude = score.candidate.effect.amplitude()
    size = None
    if amplitude is not None:
        least, most = (share * score.candidate.typical for share in _TYPICAL_RANGE)
        size = float(np.sign(score.amplitude) * np.clip(abs(score.amplitude), least, most))
    declaration = score.candidate.declaration(size, score.shape)
    return _step(base, declaration, refit(base, declaration, rival))


def _step(base: Fit, declaration: EffectDeclaration | None, done: Fit) -> Step:
    return Step(done, declaration, criterion_difference(base, done), _size(declaration, done))


def _size(declaration: EffectDeclaration | None, done: Fit) -> float:
    """The fitted amplitude of an added effect in units of its typical size, 1 for one without an amplitude."""
    amplitude = declaration.effect.amplitude() if declaration else None
    if declaration is None or amplitude is None:
        return 1.0
    name = f"{declaration.name}.{amplitude.name}."
    fitted = next(each for each in done.model.parameters if each.name.startswith(name))
    return fitted.value / fitted.declared.typical


# --- The order of the answers ---------------------------------------------------------------------


MUCH_WORSE = 1.2
"""Times the least held-out error: too much for any scatter to excuse."""


def _by_probability(base: Fit, steps: Sequence[Step]) -> list[Step]:
    """The most probable first, each with its probability and with those that can't be told from it.

    Nothing missing is one of the answers that share the probability.
    """
    priors = _log_priors(base, steps)
    fits = [base, *(step.fit for step in steps)]
    of_all = probabilities(fits, priors)[1:]

    def rivals(number: int) -> tuple[Key, ...]:
        return tuple(
            step.key
            for other, step in enumerate(steps, start=1)
            if other != number and are_rivals(fits[number], fits[other], (priors[number], priors[other]))
        )

    judged = [
        replace(step, probability=float(probability), indistinguishable=rivals(number))
        for number, (step, probability) in enumerate(zip(steps, of_all, strict=True), start=1)
    ]
    return [judged[k] for k in sorted(range(len(judged)), key=lambda k: (-judged[k].probability, -judged[k].gain))]


def compared(diagnosis: Diagnosis, step: Step, data: DataSplit) -> Step:
    """A step that could be taken from a diagnosed model, fitted elsewhere, among the answers of that diagnosis."""
    base = diagnosis.fit
    others = [other for other in diagnosis.refits if other.key != step.key]
    steps = [replace(step, gain=criterion_difference(base, step.fit)), *others]
    judged = next(each for each in _by_probability(base, steps) if each.key == step.key)
    if not data.holdout:
        return judged
    fits = [base, *(each.fit for each in steps)]
    by_all_runs = probabilities(fits, _log_priors(base, steps), held_out(fits, data))
    return replace(judged, by_all_runs=float(by_all_runs[1]))


def held_out(fits: Sequence[Fit], data: DataSplit) -> list[list[Prediction]]:
    """The held-out runs as each of several fits predicts them."""
    return [[predict(fit.model, run, fit.problem.sigma) for run in data.holdout] for fit in fits]


def _log_priors(base: Fit, steps: Sequence[Step]) -> FloatArray:
    """Of nothing missing, then of each step: logarithms of what is thought of them beforehand, shape (1 + steps,)."""
    of_sizes = [step.log_odds + log_prior_of_sizes(step.fit, step.declarations) for step in steps]
    of_starts = [step.log_evidence_of_starts for step in (Step(base), *steps)]
    return np.asarray(np.array([0.0, *of_sizes]) + np.array(of_starts))


def _holdout_decides(steps: list[Step]) -> list[Step]:
    """Of names for the first answer those come last that held-out runs speak against."""
    if not steps or steps[0].holdout is None:
        return steps
    names = {steps[0].key, *steps[0].indistinguishable}
    least = min(step.holdout.rmse for step in steps if step.holdout and step.key in names)

    def order(step: Step) -> int:
        if step.key not in names:
            return 2
        return int(step.holdout is not None and step.holdout.rmse > MUCH_WORSE * least)

    return sorted(steps, key=order)


# --- The verdict ----------------------------------------------------------------------------------


_MOST_BY_ONE, _MOST_BY_THREE = 0.6, 0.8  # shares of the misfit beyond noise that are most of it
_ELSEWHERE = 0.5  # share of the held-out error, squared and beyond noise, that must go with it: most of it
_RUNS_DIFFER = 0.3  # K; two runs differ by so much in their air and sensors alone


def _verdict(base: Fit, data: DataSplit, holdout: Errors | None, scores: Scores, steps: Sequence[Step]) -> Verdict:
    if not _more_is_wanted(scores, steps):
        agree = not any(
            standing_out(base, predict(base.model, each, base.problem.sigma), _RUNS_DIFFER) for each in data.holdout
        )
        return "adequate" if agree else "unexplained"
    if not steps or not explained_elsewhere(base, holdout, steps[0].holdout):
        return "unexplained"
    best = steps[0].fit
    nothing_left = all(value <= LACKING for value in lack_of_fit(best, scores.noise).values())
    return "missing" if nothing_left or explained_share(base, best, scores.noise) > _MOST_BY_ONE else "unexplained"


def _more_is_wanted(scores: Scores, steps: Sequence[Step]) -> bool:
    """Whether the fitted runs have something against the model; only candidates beyond chance were refitted."""
    lacking = any(value > LACKING for value in scores.lack_of_fit.values())
    return lacking or sum(step.probability for step in steps) >= LIKELY


def explained_elsewhere(base: Fit, before: Errors | None, after: Errors | None) -> bool:
    """Whether enough of the held-out error beyond noise goes, too; true where nothing is held out, or shows it.

    Args:
        base: the smaller model's fit, with the sensors' noise.
        before: its errors on held-out runs.
        after: those of the larger model.
    """
    if before is None or after is None:
        return True
    floor = float(np.mean(base.noise.floor**2))
    return before.rmse**2 - after.rmse**2 >= _ELSEWHERE * max(before.rmse**2 - floor, 0.0)


def _three_together_explain(first: Diagnosis, data: DataSplit, refits: int, executor: Executor | None) -> bool:
    """Whether three effects, each the best after the one before, remove what one alone can't."""
    last = first
    for _ in range(2):
        if not last.refits:
            break
        last = examine(last.refits[0].fit, DataSplit(data.fit), refits=refits, executor=executor)
    done = last.refits[0].fit if last.refits else last.fit
    enough = explained_share(first.fit, done, first.scores.noise) > _MOST_BY_THREE
    return enough and explained_elsewhere(first.fit, first.holdout, holdout_errors(done, data.holdout))
