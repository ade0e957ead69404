"""A better model, step by step: what the given one lacks, added and fitted, and the errors on the way.

The diagnosis says what is missing. Then each effect is added in its turn and fitted at full resolution, which shows how
the errors fall, on runs that no fit saw as well. Those errors are of the model as its file has it, and as `lptn
compare` says them: nothing but the start is fitted to a held-out run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from math import isfinite

import pandas as pd

from lptn.basics.tables import Tabular
from lptn.diagnose.answers import Report, Step
from lptn.diagnose.candidates import AMBIENT_ERROR, SURFACE_ERROR, TORQUE_ERROR
from lptn.diagnose.diagnosis import Diagnosis, Verdict, diagnose
from lptn.diagnose.fit_statistics import Removed, lack_of_fit
from lptn.diagnose.refits import RANKING, as_fitted, continued, unless_interrupted
from lptn.identify.data import DataSplit
from lptn.identify.fitting import Fit
from lptn.identify.solvers import PRECISION
from lptn.identify.validation import fit_segments
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration


@dataclass(frozen=True, repr=False)
class History(Tabular):
    """The models from the given one to the best.

    Args:
        steps: the given model first.
        first: the diagnosis of the given model.
        last: the diagnosis of the last step.
    """

    steps: tuple[Step, ...]
    first: Diagnosis
    last: Diagnosis

    @property
    def verdict(self) -> Verdict:
        """On the model as given: adequate, missing effects that were identified, or unexplained."""
        return self.first.verdict

    @property
    def remaining(self) -> Verdict:
        """On the last step: adequate, or unexplained."""
        return self.last.verdict

    @property
    def best(self) -> Step:
        """The last step."""
        return self.steps[-1]

    def declarations(self) -> list[EffectDeclaration]:
        """The effects that were added, with the values that the last step's fit for use gave them."""
        return effects_added(self.steps)

    @property
    def summary(self) -> str:
        """Verdicts and the last step in one line."""
        return f"{self.verdict}, then {self.remaining}; {self.best.summary}"

    def to_pandas(self) -> pd.DataFrame:
        """A row for each step, as `table_of_steps` gives them."""
        return table_of_steps(self.steps)

    def as_json(self) -> dict[str, object]:
        """The history as other tools read it."""
        removed = [None, *(Removed.between(before.fit, step.fit) for before, step in pairwise(self.steps))]
        table, findings, structure = [], list[object](), list[object]()
        for number, (step, gone) in enumerate(zip(self.steps, removed, strict=True)):
            name = {"effect": step.effect, "at": step.at}
            others = {"indistinguishable_from": [list(key) for key in step.indistinguishable]}
            errors = {
                "parameters": step.parameters,
                "rmse_fit": step.fit.rmse,
                "rmse_holdout": step.holdout.rmse if step.holdout else None,
                "max_holdout": step.holdout.max if step.holdout else None,
                "rmse_test": step.test.rmse if step.test else None,
                "probability": step.probability if step.effect else None,
                "removed": asdict(gone) if gone else None,
            }
            table.append({"step": number} | name | errors | others)
            if gone and step.declaration:
                part = name | {"probability": step.probability, "explains": gone.share} | _size(step, self.best.fit)
                run = {} if step.is_structure else {"run": step.declaration.run or None}
                (structure if step.is_structure else findings).append(part | run | others)
        return {
            "verdict": self.verdict,
            "remaining": self.remaining,
            "probabilities": self.first.probabilities_as_json(),
            "history": table,
            "structure": structure,
            "findings": findings,
            "refused": [
                {"effect": step.effect, "at": step.at, "probability": step.probability, **_size(step, step.fit)}
                for step in self.first.refused
            ],
        }


def _size(step: Step, fit: Fit) -> dict[str, object]:
    """The size of an effect in a fit, its standard error, and the unit of both."""
    size = replace(step, fit=fit).size_parameter
    if size is None:
        return {"size": None, "standard_error": None, "unit": None}
    error = fit.standard_errors.get(size.name)
    known = error if error is not None and isfinite(error) else None
    return {"size": size.value, "standard_error": known, "unit": size.declared.unit}


def table_of_steps(steps: Sequence[Step]) -> pd.DataFrame:
    """A row for each step: effect, place, free parameters, errors [K] on fitted, held-out and test data."""
    rows = [
        {
            "step": number,
            "effect": step.effect or "",
            "place": step.at or "",
            "parameters": step.parameters,
            "RMSE fitted [K]": step.fit.rmse,
            "RMSE held out [K]": step.holdout.rmse if step.holdout else None,
            "max held out [K]": step.holdout.max if step.holdout else None,
            "RMSE test [K]": step.test.rmse if step.test else None,
        }
        for number, step in enumerate(steps)
    ]
    return pd.DataFrame(rows).dropna(axis="columns", how="all")


def effects_added(steps: Sequence[Step]) -> list[EffectDeclaration]:
    """The effects that were added step by step, with the values that the last step's fit gave them."""
    return [as_fitted(declared, steps[-1].fit) for step in steps for declared in step.declarations]


def improve(
    model: Model,
    data: DataSplit,
    *,
    most: int = 6,
    ambient_error: float = AMBIENT_ERROR,
    torque_error: float = TORQUE_ERROR,
    surface_error: float = SURFACE_ERROR,
    executor: Executor | None = None,
    report: Report = lambda _: None,
    on_step: Callable[[tuple[Step, ...]], None] = lambda _: None,
) -> History:
    """Find what the model lacks, add it, fit at full resolution.

    No parameter is fitted to held-out runs, but how well a model predicts them counts in the choice; test runs only
    tell how good it is.

    Args:
        model: the model to start from.
        data: runs to fit, to hold out, and to test.
        most: how many findings to add at most, beside what all parts have in common.
        ambient_error: how far the ambient sensor may be off in each run [K], one standard deviation.
        torque_error: how far each joint's torque or current may be off in each run, as a share, one standard deviation.
        surface_error: how far each surface's loss to the air may be off in each run, as a share, one standard
            deviation.
        executor: where exact fits run; here, one after the other, by default.
        report: called with a sentence on what is being done.
        on_step: called after each step with the steps so far, the model as given first.

    Raises:
        InputError: a run lacks an input of the model.

    Example:
        >>> import lptn
        >>> loaded = lptn.load_model("examples/tclab/two_heaters.toml")
        >>> data = lptn.split_data(loaded.runs(["examples/tclab/log.csv"]), holdout_after=300)
        >>> history = lptn.improve(loaded.model, data)
        >>> [(step.effect, step.at) for step in history.steps]
        [(None, None), ('sensor_lag', '*'), ('constant_heat', '*'), ('natural_convection', '*')]
    """
    errors = {"ambient_error": ambient_error, "torque_error": torque_error, "surface_error": surface_error}
    first = diagnose(model, data, most=most, executor=executor, report=report, **errors)
    report("fitting the steps at full resolution")
    steps = [Step(unless_interrupted(fit_segments(model, data.fit, first.fit.point))).judged_on(data)]
    coarse, network = first.fit, first.fit.model.network
    for number, step in enumerate(first.steps, start=1):
        network = network.with_effects(step.declarations)
        last = number == len(first.steps)
        precision = PRECISION if last else RANKING
        coarse = step.fit if last else continued(coarse, network, precision)
        fine = unless_interrupted(fit_segments(coarse.model, data.fit, coarse.point, precision=precision))
        steps.append(replace(step, fit=fine).judged_on(data))
        on_step(tuple(steps))
    if len(steps) == 1:
        return History(tuple(steps), first, first)
    best, rest = first.steps[-1], first.remaining
    last_diagnosis = Diagnosis(rest, rest, best.fit, best.holdout, lack_of_fit(best.fit), refused=first.refused)
    return History(tuple(steps), first, last_diagnosis)
