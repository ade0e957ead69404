"""Forward selection: diagnose, add the missing effect, refit, step by step, and the errors on the way.

Missing effects come in pairs whose first alone explains little, and short logs leave several first effects equally
good. So the most probable models are followed side by side:

1. Each model that is followed is asked what it lacks; each answer is a longer branch, with the probability of all its
   effects together: their evidence on the fitted data, and how often they are met.
2. The most probable branches are fitted to the end and followed, as long as none is clearly more probable.
3. The search ends when no longer branch is more probable than the best.
4. Where held-out runs are given, effects are kept as far as the error on these falls, and where the fitted data leave
   several branches, they choose. They are no proof of it then, and that is said.
5. Steps that later ones made superfluous are taken out, and each model left is fitted at full resolution.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from math import log

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from lptn.basics.errors import InputError
from lptn.basics.tables import Tabular
from lptn.diagnose.candidates import with_ambient_bias
from lptn.diagnose.diagnosis import (
    CREDIBLE,
    Diagnosis,
    Key,
    Question,
    Report,
    Step,
    Verdict,
    common_columns,
    continued,
    contradicted,
    explains_most,
    for_search,
    is_small,
    probabilities_as_json,
    unless_interrupted,
)
from lptn.diagnose.evidence import Likelihood
from lptn.identify.data import DataSplit
from lptn.identify.fitting import Fit, finished
from lptn.identify.validation import fit_segments, holdout_errors
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration


@dataclass(frozen=True, repr=False)
class History(Tabular):
    """The models from the given one to the best.

    Args:
        verdict: on the model as given: adequate, missing effects that were identified, or unexplained.
        remaining: the same question asked of the last step.
        steps: the given model first.
        first: the diagnosis of the given model.
        last: the diagnosis of the last step.
        probabilities: of each effect being among what the given model lacks, and of nothing (`None`): by the fitted
            data, over all models that were fitted to them.
        considered: how many models were followed, the given one among them.
        chosen_by_holdout: whether held-out data, and not the fitted data alone, chose between them.
    """

    verdict: Verdict
    remaining: Verdict
    steps: tuple[Step, ...]
    first: Diagnosis
    last: Diagnosis
    probabilities: list[tuple[Key | None, float]]
    considered: int
    chosen_by_holdout: bool = False

    @property
    def best(self) -> Step:
        """The last step."""
        return self.steps[-1]

    def declarations(self) -> list[EffectDeclaration]:
        """The effects that were added, with the values that the last step's fit gave them."""
        return effects_added(self.steps)

    @property
    def summary(self) -> str:
        """Verdicts and the last step in one line."""
        return f"{self.verdict}, then {self.remaining}; {self.best.summary}"

    def to_pandas(self) -> pd.DataFrame:
        """A row for each step, as `table_of_steps` gives them."""
        return table_of_steps(self.steps)

    def as_json(self) -> dict[str, object]:
        """The history as other tools read it; `ladder`, `rung` and `rmse_proof` are older names of what it holds."""
        table = [
            {
                "step": number,
                "rung": number,
                "effect": step.effect,
                "at": step.at,
                "parameters": step.parameters,
                "rmse_fit": step.fit.rmse,
                "rmse_holdout": step.holdout.rmse if step.holdout else None,
                "max_holdout": step.holdout.max if step.holdout else None,
                "rmse_test": step.test.rmse if step.test else None,
                "rmse_proof": step.test.rmse if step.test else None,
                "probability": step.probability if step.effect else None,
                "indistinguishable_from": [list(key) for key in step.indistinguishable],
            }
            for number, step in enumerate(self.steps)
        ]
        return {
            "verdict": self.verdict,
            "remaining": self.remaining,
            "probabilities": probabilities_as_json(self.probabilities),
            "chosen_by_holdout": self.chosen_by_holdout,
            "history": table,
            "ladder": table,
        }


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
    fitted = {parameter.name: parameter.value for parameter in steps[-1].fit.model.parameters}
    effects = []
    for step in steps:
        if step.declaration is not None:
            declared, owner = step.declaration, step.declaration.at
            values = tuple(
                replace(parameter, value=fitted.get(f"{declared.name}.{parameter.name}.{owner}", parameter.value))
                for parameter in declared.parameters
            )
            effects.append(replace(declared, parameters=values))
    return effects


def improve(
    model: Model,
    data: DataSplit,
    *,
    most: int = 6,
    ambient_error: float = 0.0,
    executor: Executor | None = None,
    report: Report = lambda _: None,
) -> History:
    """Diagnose, add the missing effect, refit, until nothing beyond chance is left or nothing helps.

    Effects are proposed on the fit data, by probability. They are kept as far as the error on held-out data falls;
    without any the most probable model is kept. Test data choose nothing.

    Args:
        model: the model to start from.
        data: runs to fit, to hold out, and to test.
        most: how many effects to add at most.
        ambient_error: how far the ambient sensor may be off in each run [K], one standard deviation.
        executor: where refits run; here, one after the other, by default.
        report: called with a sentence on what is being done.

    Raises:
        InputError: a run lacks an input of the model.

    Example:
        >>> import lptn
        >>> loaded = lptn.load_model("examples/tclab/two_heaters.toml")
        >>> data = lptn.split_data(loaded.runs(["examples/tclab/log.csv"]), holdout_after=300)
        >>> history = lptn.improve(loaded.model, data, most=2)
        >>> [(step.effect, step.at) for step in history.steps]
        [(None, None), ('sensor_lag', '*'), ('conduction', 'heater1~heater2')]
    """
    coarse = for_search(data)
    model = with_ambient_bias(model, data, ambient_error)
    report("fitting the model as it stands")
    base = unless_interrupted(fit_segments(model, coarse.fit))
    likelihood = Likelihood(base, common_columns(coarse))
    search = _Search(Question(likelihood, coarse, executor=executor, report=report))
    given: Branch = (search.question.on_held_out(Step(base, evidence=likelihood.of(base))),)
    branches = search.follow(given, most)
    chosen = _chosen(branches)
    kept = search.pruned(chosen)
    first, last = search.diagnosis(given), search.diagnosis(kept)
    report("fitting the steps at full resolution")
    return History(
        _verdict(first, kept),
        last.verdict,
        _at_full_resolution(kept, data),
        first,
        last,
        search.probabilities(),
        len(branches),
        bool(data.holdout) and chosen is not branches[0],
    )


# --- Branches of models, the most probable followed side by side -----------------------------------------------


Branch = tuple[Step, ...]
"""The given model, then a step for each effect that was added; the last step's fit is that of them all."""

_WIDTH, _WIDTH_LATER = 4, 2  # branches followed side by side after the first step, and after later ones
_FOLLOWED = 7.0  # log odds against the best branch (1 in 1000) up to which one is followed: its pair may be the best


def _effects(branch: Branch) -> frozenset[Key]:
    return frozenset(step.key for step in branch[1:])


def _added(branch: Branch) -> list[EffectDeclaration]:
    return [step.declaration for step in branch if step.declaration]


def _log_probability(branch: Branch) -> float:
    """Logarithm of a branch's odds against the given model, by the fitted data: those of all its steps."""
    return sum(step.log_odds for step in branch[1:])


def _by_all_data(branch: Branch) -> float:
    """The same by all data, held-out ones included."""
    return _log_probability(branch) + branch[-1].log_predictive - branch[0].log_predictive


def _chosen(branches: Sequence[Branch]) -> Branch:
    """The shortest branch that reaches the least held-out error; without held-out runs the most probable one.

    Held-out runs may keep effects that the fitted ones leave open, none that they speak clearly against.

    Args:
        branches: the most probable by the fitted data first.
    """
    possible = [each for each in branches if all(step.log_odds > -log(CREDIBLE) for step in each[1:])]
    errors = [branch[-1].holdout.rmse if branch[-1].holdout else 0.0 for branch in possible]
    enough = [each for each, error in zip(possible, errors, strict=True) if error <= (1 + WORTH) * min(errors)]
    return min(enough, key=len) if min(errors) > 0 else branches[0]


WORTH = 0.01
"""Share by which a step must lower the held-out error."""


class _Search:
    """Follows branches side by side; remembers every diagnosis.

    Args:
        question: what a model lacks, asked of each.
    """

    def __init__(self, question: Question) -> None:
        self.question = question
        self._diagnoses: dict[frozenset[Key], Diagnosis] = {}
        self._odds: dict[frozenset[Key], float] = {frozenset(): 0.0}  # logarithms, against the given model

    def follow(self, given: Branch, most: int) -> list[Branch]:
        """Follow branches until none that is longer is more probable.

        Args:
            given: the given model, fitted.
            most: how many effects to add at most.

        Returns:
            The branches that were followed, the most probable by the fitted data first.
        """
        best, beam, ended = given, [given], [given]
        for depth in range(1, most + 1):
            width = _WIDTH if depth == 1 else _WIDTH_LATER
            beam = self._next([longer for branch in beam for longer in self._longer(branch)], width)
            if not beam:
                break
            ended += beam
            self.question.report(f"step {depth}: {_in_words(beam)}")
            reached = max(beam, key=_by_all_data)
            if _by_all_data(reached) < _by_all_data(best) and depth > 1:
                break  # the first of a pair may help nobody alone, so one step without a gain is allowed at the start
            best = max(best, reached, key=_by_all_data)
        return sorted(ended, key=_log_probability, reverse=True)

    def diagnosis(self, branch: Branch) -> Diagnosis:
        """What a branch's last model lacks, asked once."""
        effects = _effects(branch)
        if effects not in self._diagnoses:
            self._diagnoses[effects] = self.question.ask(branch[-1].fit, _added(branch))
        return self._diagnoses[effects]

    def _longer(self, branch: Branch) -> list[Branch]:
        longer = [(*branch, step) for step in self.diagnosis(branch).refits]
        self._odds |= {_effects(each): _log_probability(each) for each in longer}
        return longer

    def _next(self, pool: Sequence[Branch], width: int) -> list[Branch]:
        """The most probable branches, each set of effects once, fitted to the end."""
        unique: dict[frozenset[Key], Branch] = {}
        for branch in sorted(pool, key=_log_probability, reverse=True):
            unique.setdefault(_effects(branch), branch)
        branches = list(unique.values())
        best = max(branches, key=_by_all_data, default=None)
        near = [each for each in branches if best and _by_all_data(best) - _by_all_data(each) < _FOLLOWED]
        followed = list(dict.fromkeys([*branches[:1], *near]))[:width]  # the best by the fitted data alone, too
        executor = self.question.executor
        fits = (executor.map if executor else map)(finished, [branch[-1].fit for branch in followed])
        return [self._ending_in(branch, unless_interrupted(fit)) for branch, fit in zip(followed, fits, strict=True)]

    def probabilities(self) -> list[tuple[Key | None, float]]:
        """Probability of each effect being in the model, and of the given model, over all models that were fitted."""
        effects, odds = zip(*self._odds.items(), strict=True)
        # What the first question left unfitted has its probability, too, under no name.
        first = self._diagnoses.get(frozenset())
        unnamed = [] if first is None else [first.unnamed_log_odds]
        shares = np.exp(np.array(odds) - logsumexp([*odds, *unnamed]))
        listed: list[tuple[Key | None, float]] = [
            (key, float(sum(share for each, share in zip(effects, shares, strict=True) if key in each)))
            for key in frozenset().union(*effects)
        ]
        return sorted([*listed, (None, float(shares[effects.index(frozenset())]))], key=lambda each: -each[1])

    def _ending_in(self, branch: Branch, fit: Fit) -> Branch:
        """The branch with another fit of its last model, and the odds and errors that go with it."""
        last = branch[-1]
        evidence = self.question.likelihood.of(fit, _added(branch))
        before = last.evidence.log_evidence if last.evidence else 0.0
        odds = last.log_odds + evidence.log_evidence - before
        done = (*branch[:-1], self.question.on_held_out(replace(last, fit=fit, evidence=evidence, log_odds=odds)))
        self._odds[_effects(done)] = _log_probability(done)
        return done

    def pruned(self, branch: Branch) -> Branch:
        """The branch without the steps that later ones made superfluous; what lowers the misfit most comes first."""
        last = branch[-1]
        if len(branch) < 3 or last.evidence is None:
            return branch
        costs: dict[Key, float] = {}
        for step in branch[1:]:
            rest = tuple(other for other in branch if other is not step)
            try:
                network = last.fit.model.network.without_effect(*step.key)
            except InputError:  # another effect stands at the edge that this one made
                costs[step.key] = np.inf
                continue
            fit = continued(last.fit, network)
            evidence = self.question.likelihood.of(fit, _added(rest))
            end = self.question.on_held_out(replace(rest[-1], fit=fit, evidence=evidence))
            costs[step.key] = fit.cost
            loss = last.evidence.log_evidence - evidence.log_evidence + step.log_prior
            worse = last.holdout and end.holdout and end.holdout.rmse > (1 + WORTH) * last.holdout.rmse
            if loss + last.log_predictive - end.log_predictive < 0 and not worse:
                self.question.report(f"{step.effect} at {step.at} is no longer needed")
                return self.pruned((*rest[:-1], end))
        steps = sorted(branch[1:], key=lambda step: -costs[step.key])
        end = replace(
            steps[-1],
            fit=last.fit,
            evidence=last.evidence,
            holdout=last.holdout,
            log_predictive=last.log_predictive,
        )
        return (branch[0], *steps[:-1], end)


def _in_words(beam: Sequence[Branch]) -> str:
    """The branches of a step and how probable they are among each other, for progress."""
    logs = np.array([_by_all_data(branch) for branch in beam])
    shares = np.exp(logs - logsumexp(logs))
    return "; ".join(
        f"{branch[-1].effect} at {branch[-1].at} ({100 * share:.0f} %)"
        for branch, share in zip(beam, shares, strict=True)
    )


# --- The verdict, and the branch that is kept at full resolution ------------------------------------


def _verdict(first: Diagnosis, kept: Branch) -> Verdict:
    """On the model as given."""
    if len(kept) == 1:
        # What the fitted data would add helps no held-out run: it is adequate only if what is left does not matter.
        small = is_small(first.evidence) and not contradicted(first.fit, first.holdout)
        return "adequate" if small else "unexplained"
    return "missing" if explains_most(first, kept[-1]) else "unexplained"


def _at_full_resolution(branch: Branch, data: DataSplit) -> Branch:
    """Each model of a branch fitted at full resolution, with its errors.

    The first and the last start from their fits on coarse data, those between from the one before.
    """
    steps: list[Step] = []
    network = branch[0].fit.model.network
    for step in branch:
        network = network.with_effects([step.declaration] if step.declaration else [])
        if step in (branch[0], branch[-1]):
            fit = unless_interrupted(fit_segments(step.fit.model, data.fit, step.fit.point))
        else:
            fit = unless_interrupted(finished(continued(steps[-1].fit, network)))
        errors = (holdout_errors(fit, data.holdout), holdout_errors(fit, data.test))
        steps.append(replace(step, fit=fit, holdout=errors[0], test=errors[1]))
    return tuple(steps)
