"""What a fitted model lacks: its error beyond noise, structure, findings, and a verdict.

The model is fitted as it stands, on means over 5 s. Where that leaves more than noise, `lptn.diagnose.composition` says
what is missing. The verdict: `"adequate"` if no more is left than noise and usual errors of the log leave, in held-out
runs too, and nothing is missing more probably than not; `"missing"` if what was found leaves no more than that on the
fitted runs, or removes more of the misfit than it leaves, on held-out runs too, as logged or beside what their logs may
be off by; else `"unexplained"`, and what was found is told beside that unless it removes nothing, or predicts held-out
runs worse.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
import pandas as pd

from lptn.basics.tables import Tabular
from lptn.diagnose.answers import NOTHING, Key, Report, Step, named
from lptn.diagnose.candidates import AMBIENT_ERROR, SURFACE_ERROR, TORQUE_ERROR, log_priors, possible_effects
from lptn.diagnose.composition import composition
from lptn.diagnose.evidence import ErrorsOfRuns, Evidence, FirstOrder, allowances
from lptn.diagnose.fit_statistics import explained_share, is_met, lack_of_fit
from lptn.diagnose.refits import RANKING, unless_interrupted
from lptn.effects.learned_heat import UNNAMED, LearnedHeat, goes_with
from lptn.identify.comparison import Errors
from lptn.identify.data import DataSplit
from lptn.identify.fitting import Fit
from lptn.identify.problem import REPEATED
from lptn.identify.validation import fit_segments, holdout_errors
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration

Verdict = Literal["adequate", "missing", "unexplained"]


@dataclass(frozen=True, repr=False)
class Diagnosis(Tabular):
    """What a fitted model lacks.

    Args:
        verdict: `"adequate"`: within the noise; `"missing"`: effects of the catalogue remove more of the misfit than
            they leave; `"unexplained"`: misfit that the catalogue does not remove.
        remaining: on the model with all that is missing: adequate, or unexplained.
        fit: the fitted baseline.
        holdout: its errors on held-out runs as they were logged, `None` without any.
        lack_of_fit: of each node: mean square of the one-minute means of what the baseline leaves, over the most that
            noise would.
        steps: what is missing, each with the fit of the model that has all of it: what all parts have in common, then
            what sets one apart.
        rivals: for what the data can't tell from another of these, the exact fits of both; empty where all are told.
        refused: what was fitted exactly beside all that, and not added.
        errors: how far a log may be off.
    """

    verdict: Verdict
    remaining: Verdict
    fit: Fit
    holdout: Errors | None
    lack_of_fit: dict[str, float]
    steps: tuple[Step, ...] = ()
    rivals: tuple[Step, ...] = ()
    refused: tuple[Step, ...] = ()
    errors: ErrorsOfRuns = field(default_factory=ErrorsOfRuns)

    @property
    def best(self) -> Step | None:
        """The first answer, `None` where nothing helps."""
        return self.steps[0] if self.steps else None

    @property
    def probabilities(self) -> list[tuple[Key, float]]:
        """What is missing and how probable that is, the most probable first; nothing has an empty key.

        Each answer beside all others: several things may be missing at once. Where nothing was found, what may be
        missing all the same.
        """
        answers = self.steps or self.refused
        listed = [(step.key, step.probability) for step in answers]
        of_nothing = (
            float(np.prod([1.0 - share for _, share in listed]))
            if self.steps
            else max(0.0, 1.0 - sum(share for _, share in listed))
        )
        return sorted([(NOTHING, of_nothing), *listed], key=lambda answer: -answer[1])

    def probabilities_as_json(self) -> list[dict[str, object]]:
        """The same as other tools read it, `null` for nothing."""
        return [
            {"effect": effect or None, "at": at or None, "probability": probability}
            for (effect, at), probability in self.probabilities
        ]

    @cached_property
    def weighed(self) -> list[FirstOrder]:
        """All candidates that the fitted model may lack, to first order, most probable first; computed on first use."""
        return weighed(self.fit, self.errors)

    @property
    def learned(self) -> list[EffectDeclaration]:
        """Heat in the fitted model that was learned as a curve: it has no name, and stays unexplained."""
        return [declared for declared in self.fit.model.network.effects if declared.effect.key == LearnedHeat.key]

    @property
    def only_held_out_runs_object(self) -> bool:
        """Whether the model agrees with the fitted runs, but not with held-out runs."""
        return self.verdict == "unexplained" and not self.steps and is_met(self.lack_of_fit)

    @property
    def summary(self) -> str:
        """Verdict and first answer in one line."""
        error = f"RMSE {self.fit.rmse:.3g} K fitted"
        if self.holdout:
            error += f", {self.holdout.rmse:.3g} K held out"
        answer = f"; {', '.join(named(step.key) for step in self.steps)}" if self.steps else ""
        return f"{self.verdict}: {error}{answer}"

    def to_pandas(self) -> pd.DataFrame:
        """A row for each answer: effect, place, size, probability, and its other names."""
        sizes = [step.amplitude.value if step.amplitude else 1.0 for step in self.steps]
        rows = [
            (step.effect, step.at, size, step.probability, ", ".join(map(named, step.indistinguishable)))
            for step, size in zip(self.steps, sizes, strict=True)
        ]
        return pd.DataFrame(rows, columns=["effect", "place", "size", "probability", "indistinguishable from"])

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
                "p_value": 1.0 - step.probability,
                "probability": step.probability,
                "indistinguishable_from": [list(other) for other in step.indistinguishable],
                "separate_by": step.declaration.effect.signature.separate_by if step.declaration else "",
            }
            for rank, step in enumerate(self.steps, start=1)
        ]
        return {
            "verdict": self.verdict,
            "rmse_fit": self.fit.rmse,
            "rmse_holdout": before,
            "lack_of_fit": self.lack_of_fit,
            "learned": [
                {"at": one.where, "verdict": UNNAMED + goes_with(one.effect, one.driven_by or one.at)}
                for one in self.learned
            ],
            "probabilities": self.probabilities_as_json(),
            "candidates": listed,
        }


def diagnose(
    model: Model,
    data: DataSplit,
    *,
    most: int = 6,
    ambient_error: float = AMBIENT_ERROR,
    torque_error: float = TORQUE_ERROR,
    surface_error: float = SURFACE_ERROR,
    executor: Executor | None = None,
    report: Report = lambda _: None,
) -> Diagnosis:
    """Fit the model, find what it lacks, and judge.

    Args:
        model: the model to question.
        data: the runs to fit, and those held out.
        most: how many findings to look for at most, beside what all parts have in common.
        ambient_error: how far the ambient sensor may be off in each run [K], one standard deviation.
        torque_error: how far each joint's torque or current may be off in each run, as a share, one standard deviation.
        surface_error: how far each surface's loss to the air may be off in each run, as a share, one standard
            deviation.
        executor: where exact fits run; here, one after the other, by default.
        report: called with a sentence on what is being done.

    Raises:
        InputError: a run lacks an input of the model.
    """
    coarse = for_search(data)
    report("fitting the model as it stands")
    base = unless_interrupted(fit_segments(model, coarse.fit))
    errors = ErrorsOfRuns(ambient_error, torque_error, surface_error)
    return examine(base, coarse, most=most, errors=errors, executor=executor, report=report)


def for_search(data: DataSplit, most: int = 8000) -> DataSplit:
    """The same data of common inputs in the steps of a search: 5 s, longer where there are very many readings.

    Readings that are closer say several times what a model gets wrong, and cost most of the time.

    Args:
        data: the runs.
        most: readings of all nodes in all fitted runs together: robots of many joints and days of data get longer
            means.
    """
    sensors = [sum(key.startswith("temperature.") for key in one.run.columns) for one in data.fit]
    seconds = sum(len(one.run) * one.run.step * count for one, count in zip(data.fit, sensors, strict=True))
    return data.of_common_inputs().coarsened(max(REPEATED, seconds / most))


def examine(
    base: Fit,
    data: DataSplit,
    *,
    most: int = 6,
    errors: ErrorsOfRuns | None = None,
    executor: Executor | None = None,
    report: Report = lambda _: None,
) -> Diagnosis:
    """`diagnose` for a model that is fitted already, on data of the step it was fitted with."""
    lack, given, errors = lack_of_fit(base), holdout_errors(base, data.holdout), errors or ErrorsOfRuns()
    made = composition(base, data, most=most, errors=errors, executor=executor, report=report)
    if not made.steps and made.fit.cost < (1.0 - RANKING) * base.cost:  # the given fit stood in a local minimum
        return examine(made.fit, data, most=most, errors=errors, executor=executor, report=report)
    last = holdout_errors(made.fit, data.holdout)
    steps = tuple(replace(step, holdout=last) for step in made.steps)
    remaining: Verdict = "unexplained" if made.after.is_lacking() else "adequate"
    verdict, refused, rivals = remaining, made.refused, made.rivals
    if steps:
        shares = [explained_share(base, base.rmse, made.fit.rmse)]
        if given and last:  # an error of the log hides it as logged; what such an error could stand for, beside these
            left = made.before.left_of_held_out or 0.0, made.after.left_of_held_out or 0.0
            shares.append(max(explained_share(base, *pair) for pair in ((given.rmse, last.rmse), left)))
        share = max(0.0, min(shares))
        explained = share > 0.5 or not made.after.is_lacking(held_out=False)  # more than is left, or all of it
        verdict = "missing" if explained else "unexplained"
        if not explained:  # something without a name is at work, and may have made what they explain
            steps = tuple(replace(step, probability=share * step.probability) for step in steps)
            if share == 0.0 or (given and last and last.rmse > given.rmse):  # the latter as logged
                steps, refused, rivals, remaining = (), (*steps, *refused), (), verdict
    return Diagnosis(verdict, remaining, base, given, lack, steps, rivals, refused, errors)


def weighed(fit: Fit, errors: ErrorsOfRuns | None = None) -> list[FirstOrder]:
    """All that a fitted model may lack beside errors of the log, to first order, the most probable first."""
    columns = set.intersection(*(set(bound.run.columns) for bound in fit.problem.bound_runs))
    possible = possible_effects(fit, columns)
    evidence = Evidence(fit, allowances(fit, possible, errors or ErrorsOfRuns()), possible)
    return evidence.first_order(log_priors(possible))
