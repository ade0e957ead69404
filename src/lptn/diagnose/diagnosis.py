"""The decision what a model lacks: every effect of the catalogue scored, the best few refitted, a verdict.

1. The model is fitted as it stands, on means over 5 s.
2. Every effect at every place is scored to first order at that fit (`lptn.diagnose.scores`), and what chance alone
   would score is simulated.
3. The best of those beyond chance are refitted exactly, everything else free.
4. They are ordered by probability (`lptn.diagnose.probability`): by how well they explain the fitted data, and how
   usual such an effect is and its size. Those that the best does not rule out are one answer with several names; names
   that held-out runs speak against come last. What has a size that nobody would believe is no answer.
5. The verdict: `"adequate"` if nothing is beyond noise, nothing is missing more probably than not by all runs, and no
   held-out run stands out; `"missing"` if the best candidate, or three one after the other, remove most of the misfit,
   on held-out runs too, where these show any; else `"unexplained"`.
6. Where nothing explains a held-out run, and one parameter that differs in it would, it gets its own value there,
   and the question is asked once more: a fan in one run says nothing of the model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Literal

import pandas as pd

from lptn.basics.tables import Tabular
from lptn.diagnose.answers import LIKELY, MOST_REFITS, NOTHING, Key, Report, Step, answers, named, something_missing
from lptn.diagnose.candidates import AMBIENT_ERROR, SURFACE_ERROR, TORQUE_ERROR, possible_effects, with_errors_of_runs
from lptn.diagnose.fit_statistics import LACKING, MOST, explained_elsewhere, explains, lack_of_fit, standing_out
from lptn.diagnose.probability import probabilities_by_score
from lptn.diagnose.refits import continued, unless_interrupted
from lptn.diagnose.runs_that_differ import RunDifference, explained_differences, nuisances_at_limit
from lptn.diagnose.scores import Scores
from lptn.identify.comparison import Errors
from lptn.identify.data import DataSplit
from lptn.identify.fitting import Fit
from lptn.identify.validation import fit_segments, holdout_errors
from lptn.model.model import Model

Verdict = Literal["adequate", "missing", "unexplained"]


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
        likely: probability, by all runs, that one of these is missing.
        differing: held-out runs that are predicted with one parameter of their own, fitted on the run itself.
    """

    verdict: Verdict
    fit: Fit
    holdout: Errors | None
    scores: Scores
    refits: tuple[Step, ...]
    likely: float = 0.0
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
        alternatives = [(step.key, step.probability) for step in self.refits] or self._by_score
        of_nothing = 1.0 - sum(probability for _, probability in alternatives)
        listed = [answer for answer in alternatives if self.refits or answer[1] >= _WORTH_A_LINE]
        return sorted([(NOTHING, of_nothing), *listed], key=lambda answer: -answer[1])

    @cached_property
    def _by_score(self) -> list[tuple[Key, float]]:
        ranked = self.scores.ranked
        shares = probabilities_by_score(self.fit, ranked, self.scores.negligible)
        return [(score.candidate.key, float(share)) for score, share in zip(ranked, shares, strict=True)]

    def probabilities_as_json(self) -> list[dict[str, object]]:
        """The same as other tools read it, `null` for nothing."""
        return [
            {"effect": effect or None, "at": at or None, "probability": probability}
            for (effect, at), probability in self.probabilities
        ]

    @property
    def only_held_out_runs_object(self) -> bool:
        """Whether the fitted runs have nothing against the model, and held-out runs have."""
        return self.verdict == "unexplained" and not _more_is_wanted(self.scores, self.likely)

    @property
    def summary(self) -> str:
        """Verdict and first answer in one line."""
        error = f"RMSE {self.fit.rmse:.3g} K fitted"
        if self.holdout:
            error += f", {self.holdout.rmse:.3g} K held out"
        answer = f"; first answer {named(self.best.key)}" if self.best else ""
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
                "indistinguishable from": ", ".join(map(named, step.indistinguishable)),
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
            "nuisances_at_limit": [asdict(nuisance) for nuisance in nuisances_at_limit(self.fit)],
            "probabilities": self.probabilities_as_json(),
            "candidates": listed,
        }


# --- The procedure --------------------------------------------------------------------------------


_WORTH_A_LINE = 0.01  # probability; of some hundred candidates most are improbable
_SEARCH_STEP = 5.0  # s; effects are sought on means over so long, which loses little and saves most of the time
_MOST_STEPS = 4000  # of all fitted runs together: days of data get longer means, so that memory stays bounded


def diagnose(
    model: Model,
    data: DataSplit,
    *,
    refits: int = MOST_REFITS,
    ambient_error: float = AMBIENT_ERROR,
    torque_error: float = TORQUE_ERROR,
    surface_error: float = SURFACE_ERROR,
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
        surface_error: how far each surface's loss to the air may be off in each run, as a share, one standard
            deviation.
        executor: where refits run; here, one after the other, by default.
        report: called with a sentence on what is being done.

    Raises:
        InputError: a run lacks an input of the model.
    """
    coarse = for_search(data)
    model = with_errors_of_runs(model, data, ambient_error, torque_error, surface_error)
    report("fitting the model as it stands")
    base = unless_interrupted(fit_segments(model, coarse.fit))
    diagnosis = examine(base, coarse, refits=refits, executor=executor, report=report)
    if diagnosis.verdict == "unexplained" and coarse.holdout:
        report("looking for what differs in held-out runs")
        likeliest = diagnosis.best.fit if diagnosis.best else diagnosis.fit
        differs, differing = explained_differences(model, likeliest, coarse.holdout)
        if differing:
            base = continued(diagnosis.fit, differs.network)
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
    refits: int = MOST_REFITS,
    executor: Executor | None = None,
    report: Report = lambda _: None,
) -> Diagnosis:
    """`diagnose` for a model that is fitted already, on data of the step it was fitted with.

    Where that fit had ended in a local minimum, the diagnosis is of a better one.
    """
    columns = set.intersection(*(set(segment.run.columns) for segment in data.fit))
    result = answers(base, possible_effects(base, columns), refits=refits, executor=executor, report=report)
    steps = [step for step in (step.predicting_if_it_can(data) for step in result.steps) if step is not None]
    ordered = _holdout_decides(steps)
    predicted = Step(result.fit).predicting(data)
    likely = something_missing(predicted, ordered, data)
    verdict = _verdict(predicted, result.scores, ordered, likely)
    return Diagnosis(verdict, result.fit, predicted.holdout, result.scores, tuple(ordered), likely)


# --- Held-out runs among the names of the first answer ---------------------------------------------


MUCH_WORSE = 1.2
"""Times the least held-out error: too much for any scatter to excuse."""


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


RUNS_DIFFER = 0.3
"""K; two runs differ by so much in their air and sensors alone."""


def _verdict(given: Step, scores: Scores, steps: Sequence[Step], likely: float) -> Verdict:
    base = given.fit
    if not _more_is_wanted(scores, likely):
        agree = not any(standing_out(base, prediction, RUNS_DIFFER) for prediction in given.predicted)
        return "adequate" if agree else "unexplained"
    if not steps or not explained_elsewhere(base, given.holdout, steps[0].holdout):
        return "unexplained"
    best = steps[0].fit
    nothing_left = all(value <= LACKING for value in lack_of_fit(best, scores.noise).values())
    return "missing" if nothing_left or explains(MOST, base, best, scores.noise) else "unexplained"


def _more_is_wanted(scores: Scores, likely: float) -> bool:
    """Whether something is missing: the fitted runs are met worse than noise leaves them, or all runs say so.

    In one log of twenty chance alone puts a candidate beyond chance, which held-out runs then don't confirm.
    """
    return scores.is_lacking or likely >= LIKELY


def _three_together_explain(first: Diagnosis, data: DataSplit, refits: int, executor: Executor | None) -> bool:
    """Whether three effects, each the best after the one before, remove what one alone can't."""
    last = first
    for _ in range(2):
        if not last.refits:
            break
        last = examine(last.refits[0].fit, DataSplit(data.fit), refits=refits, executor=executor)
    done = last.refits[0].fit if last.refits else last.fit
    enough = explains(MOST, first.fit, done, first.scores.noise)
    return enough and explained_elsewhere(first.fit, first.holdout, holdout_errors(done, data.holdout))
