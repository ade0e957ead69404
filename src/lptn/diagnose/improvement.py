"""Forward selection: diagnose, add the missing effect, refit, step by step, and the errors on the way.

Missing effects come in pairs whose first alone explains little, and short logs leave several first effects equally
good. So several models are followed a step further, side by side:

1. Each model that is followed is diagnosed; each of its refits beyond chance is a longer branch, errors of
   the log only where they are believed.
2. Of these the most probable are fitted to the end and followed, by the fitted runs, and by all runs: what predicts
   held-out runs much worse than another comes last there, however well it fits. Where none of them is believed at its
   end, the next ones are.
3. The search ends when a model is adequate, nothing helps, or a step has made no model more probable by all runs.
4. Kept is the most probable by all runs; a longer branch must predict held-out runs better than all shorter ones.
5. Each step is left out, or gives way to another, where that is more probable by all runs, beside the other steps: what
   a step is taken for while much else is missing says little of it; left out, too, where it explains less than anyone
   looks for. Told first is where something is missing more probably than not by all runs, whatever it is; of that, and
   of the rest, what may be a fault, as it sets a place, a limb or a run apart or is an error of what was logged, then
   what several places have in common, as that is how the model is made; of each what would be missed most.
6. Each model left is fitted at full resolution, with masses as fast as their effects allow; the first and the last also
   without nuisance parameters.

Where nothing explains the data, or a held-out run alone objects to what the fitted runs make likeliest, and one
parameter that differs in that run would explain it, that difference becomes the run's own, and the question is asked
once more: such a run would else choose the effects. So it is, without that run, where no one parameter explains it, nor
any model that was tried.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.places import EVERYWHERE
from lptn.basics.tables import Tabular
from lptn.diagnose.answers import HOPELESS, LIKELY, SIGNIFICANT, Key, Report, Step, compared, held_out, named
from lptn.diagnose.candidates import AMBIENT_ERROR, SURFACE_ERROR, TORQUE_ERROR, with_errors_of_runs
from lptn.diagnose.diagnosis import MUCH_WORSE, RUNS_DIFFER, Diagnosis, Verdict, examine, for_search
from lptn.diagnose.fit_statistics import (
    HALF,
    Removed,
    criterion_difference,
    explained_elsewhere,
    explains,
    is_negligible,
    standing_out,
)
from lptn.diagnose.probability import is_implausible, log_prior_of_sizes, log_priors, probabilities
from lptn.diagnose.refits import continued, refit, unless_interrupted
from lptn.diagnose.runs_that_differ import (
    RunDifference,
    explained_differences,
    is_of_another_log,
    nuisances_at_limit,
)
from lptn.identify.comparison import Prediction, errors_of
from lptn.identify.data import DataSplit
from lptn.identify.fitting import Fit, finished
from lptn.identify.problem import Point
from lptn.identify.validation import fit_segments
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network

Branch = tuple[Step, ...]
"""The given model, then a step for each effect that was added; the last step's fit is that of them all."""


@dataclass(frozen=True, repr=False)
class History(Tabular):
    """The models from the given one to the best.

    Args:
        verdict: on the model as given: adequate, missing effects that were identified, or unexplained.
        remaining: the same question asked of the last step.
        steps: the given model first.
        first: the diagnosis of the given model.
        last: the diagnosis of the last step.
        considered: how many models were followed.
        differing: held-out runs that are predicted with one parameter of their own, fitted on the run itself.
        searched_from: the step from which the search went on until nothing helped; `None` where somebody chose all
            steps, and nobody asked whether others would help.
        set_aside: names of held-out runs that no model which was tried explains, and which therefore chose nothing.
        rivals: the first step that the fitted data leave open beside all others, and what they can't tell from it
            there; empty where they leave none open.
    """

    verdict: Verdict
    remaining: Verdict
    steps: tuple[Step, ...]
    first: Diagnosis
    last: Diagnosis
    considered: int
    differing: tuple[RunDifference, ...] = ()
    searched_from: int | None = 0
    rivals: tuple[Step, ...] = ()
    set_aside: tuple[str, ...] = ()

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
                "rmse_holdout_as_logged": step.holdout_as_logged.rmse if step.holdout_as_logged else None,
                "rmse_test": step.test.rmse if step.test else None,
                "rmse_proof": step.test.rmse if step.test else None,
                "probability": step.probability if step.effect else None,
                "probability_by_all_runs": step.by_all_runs,
                "probability_at_its_place": step.at_its_place if step.effect else None,
                "removed": asdict(Removed.between(self.steps[number - 1].fit, step.fit)) if number else None,
                "indistinguishable_from": [list(key) for key in step.indistinguishable],
            }
            for number, step in enumerate(self.steps)
        ]
        return {
            "verdict": self.verdict,
            "remaining": self.remaining,
            "nuisances_at_limit": [asdict(nuisance) for nuisance in nuisances_at_limit(self.best.fit)],
            "held_out_set_aside": list(self.set_aside),
            "probabilities": self.first.probabilities_as_json(),
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
    """The effects that were added step by step, with the values that the last step's fit for use gave them."""
    fitted = {parameter.name: parameter.value for parameter in steps[-1].for_use.model.parameters}
    effects = []
    for declared in _declarations(steps):
        values = tuple(
            replace(parameter, value=fitted.get(declared.shared_name(parameter.name), parameter.value))
            for parameter in declared.parameters
        )
        effects.append(replace(declared, parameters=values))
    return effects


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
    on_step: Callable[[Branch], None] = lambda _: None,
) -> History:
    """Diagnose, add the missing effect, refit, until nothing beyond chance is left or nothing helps.

    Effects are proposed by the fit data; which of the models that were tried is kept, and where the selection ends, all
    runs say, held-out ones included, or without any the fit data alone. Test data choose nothing.

    Args:
        model: the model to start from.
        data: runs to fit, to hold out, and to test.
        most: how many effects to add at most.
        ambient_error: how far the ambient sensor may be off in each run [K], one standard deviation.
        torque_error: how far each joint's torque or current may be off in each run, as a share, one standard deviation.
        surface_error: how far each surface's loss to the air may be off in each run, as a share, one standard
            deviation.
        executor: where refits run; here, one after the other, by default.
        report: called with a sentence on what is being done.
        on_step: called after each step with the best steps so far, the model as given first; on the search's coarse
            data.

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
    model = with_errors_of_runs(model, data, ambient_error, torque_error, surface_error)
    search, kept, verdicts = _searched(model, coarse, most, executor, report, on_step)
    differing: tuple[RunDifference, ...] = ()
    likeliest = _ranked(search.branches)[0]
    if coarse.holdout and (verdicts[0] == "unexplained" or search.diagnosis(likeliest).only_held_out_runs_object):
        report("looking for what differs in held-out runs")
        differs, differing = explained_differences(model, likeliest[-1].fit, coarse.holdout)
        if differing:
            model = differs
            search, kept, verdicts = _searched(model, coarse, most, executor, report, on_step)
    # Where the fitted runs ask for nothing, there is nothing to choose.
    choice = verdicts[0] == "unexplained" and not search.diagnosis(search.branches[0]).only_held_out_runs_object
    set_aside = search.never_explained() if choice else ()
    choosing = data.without_held_out(set_aside)
    if set_aside:
        report(f"no model explains {', '.join(set_aside)}, held out: again without")
        asked = coarse.without_held_out(set_aside)
        search, kept, (verdict, remaining) = _searched(model, asked, most, executor, report, on_step, coarse)
        # With what no run objects to a model is adequate, and that one does.
        verdicts = verdict, "unexplained" if remaining == "adequate" else remaining
    first, last = search.diagnosis(search.branches[0]), search.diagnosis(kept)
    report("fitting the steps at full resolution")
    steps = tuple(step.judged_on(data) for step in _at_full_resolution(kept, choosing))
    rivals = search.left_open(kept)
    considered = len(search.branches)
    return History(*verdicts, steps, first, last, considered, differing, rivals=rivals, set_aside=set_aside)


def _searched(
    model: Model,
    data: DataSplit,
    most: int,
    executor: Executor | None,
    report: Report,
    on_step: Callable[[Branch], None],
    vetoing: DataSplit | None = None,
) -> tuple[_Search, Branch, tuple[Verdict, Verdict]]:
    """All branches from a model, the one that is kept, and the verdicts on the model as given and on that one.

    Kept is none that predicts the held-out runs of `vetoing` worse than a shorter one.
    """
    report("fitting the model as it stands")
    base = unless_interrupted(fit_segments(model, data.fit))
    given: Branch = (Step(base).predicting(data),)
    search = _Search(data, executor, report, on_step)
    search.follow(given, most)
    branches = search.branches if vetoing is None else _not_worse(search.branches, vetoing)
    kept = search.reconsidered(search.settled(_chosen(branches, data)))
    remaining = search.remaining(kept)
    return search, kept, (_verdict(search.diagnosis(given), remaining, given, kept), remaining)


# --- Branches of models, followed side by side as long as the fit data can't tell them apart ---------


_WIDTH, _WIDTH_LATER = 4, 2  # branches followed side by side after the first step, and after later ones
_SAME = 1e-3  # two steps from one model whose misfits differ by less are one step with two names


def _stands_on(step: Step, other: Step) -> bool:
    """Whether a step is a difference from what another gave to all, or stands at an edge that it may have made."""
    one, base = step.declaration, other.declaration
    if one is None or base is None or step is other:
        return False
    return (one.difference and one.effect.key == base.effect.key) or ("~" in one.at and one.at == base.at)


def _errs(step: Step) -> bool:
    return step.declaration is not None and step.declaration.effect.errs


def _is_same(fit: Fit, other: Fit) -> bool:
    return abs(fit.cost - other.cost) < _SAME * other.cost


def _effects(branch: Branch) -> frozenset[Key]:
    return frozenset(step.key for step in branch[1:])


def _error(branch: Branch) -> float:
    """What orders branches: the held-out error [K] where there is one, else the misfit."""
    last = branch[-1]
    return last.holdout.rmse if last.holdout else last.fit.cost


class _Search:
    """Follows branches side by side; remembers every branch and every diagnosis.

    Args:
        data: in the steps of the search.
        executor: where refits run; here, one after the other, by default.
        report: called with a sentence on what is being done.
        on_step: called after each step with the best branch so far.
    """

    def __init__(
        self, data: DataSplit, executor: Executor | None, report: Report, on_step: Callable[[Branch], None]
    ) -> None:
        self.data, self.executor, self.report, self.on_step = data, executor, report, on_step
        self.branches: list[Branch] = []
        self._believed: dict[frozenset[Key], bool] = {}
        self._standing: dict[Key, bool] = {}  # of each error of the log that some model made the likeliest
        self._standing_beside: dict[tuple[frozenset[Key], Key], bool] = {}  # of others, beside a model's effects
        self._diagnoses: dict[frozenset[Key], Diagnosis] = {}
        self._other_answers: dict[tuple[frozenset[Key], Key], tuple[Step, ...]] = {}

    def follow(self, given: Branch, most: int) -> None:
        """Follow branches until nothing is left to add or nothing helps; they end up in `branches`.

        Args:
            given: the given model, fitted.
            most: how many effects to add at most.
        """
        self.branches = [given]
        beam = [given]
        for depth in range(1, most + 1):
            beam = [self._examined(branch) for branch in beam]
            if any(self.diagnosis(branch).verdict == "adequate" for branch in beam):
                return  # nothing is left to add; a longer branch could only be longer
            width = _WIDTH if depth == 1 else _WIDTH_LATER
            beam = self._next([longer for branch in beam for longer in self._longer(branch)], width)
            if not beam:
                return
            self.branches += beam
            self.report(f"step {depth}: {_in_words(beam)}")
            self.on_step(min(self.branches, key=_error))
            # The first of a pair may help nobody alone, so one step without a gain is allowed at the start.
            if depth > 1 and _ranked(self.branches, self.data)[0] not in beam:
                return

    def diagnosis(self, branch: Branch) -> Diagnosis:
        """What a branch's last model lacks, asked once."""
        effects = _effects(branch)
        if effects not in self._diagnoses:
            self._diagnoses[effects] = examine(branch[-1].fit, self.data, executor=self.executor)
        return self._diagnoses[effects]

    def _examined(self, branch: Branch) -> Branch:
        """The branch with the fit that its diagnosis is of, which may have found a better one of its last model."""
        fit = self.diagnosis(branch).fit
        if fit is branch[-1].fit:
            return branch
        better = _ending_in(branch, fit, self.data)
        self.branches = [better if other is branch else other for other in self.branches]
        return better

    def settled(self, branch: Branch) -> Branch:
        """The branch with each step left out, or exchanged, where that is more probable by all runs.

        A step was chosen while much else was missing, and may only have stood for that. Left out, too, is what explains
        less than anyone looks for beside the others, however sure it is; an error of the log gives way to what may be
        in the robot, see `_in_the_robot`.
        """
        tried, number = {_effects(branch)}, 1
        while number < len(branch):
            step, number = branch[number], number + 1
            in_the_robot = self._in_the_robot(branch, step, tried) if _errs(step) else None
            if len(branch) == 2 and in_the_robot is None:
                break  # the only step was compared with all others, and with none, when it was chosen
            for other in [in_the_robot] if in_the_robot else self._instead_of(branch, step):
                if _effects(other) in tried:
                    continue
                tried.add(_effects(other))
                left_out = len(other) < len(branch) and _is_negligible(other, branch)
                if other is in_the_robot or left_out or _chosen([branch, other], self.data) is other:
                    added = [successor for successor in other[1:] if successor.key not in _effects(branch)]
                    successors = " and ".join(named(successor.key) for successor in added)
                    self.report(f"{named(step.key)} {f'gives way to {successors}' if added else 'is not needed'}")
                    branch, number = other, 1
                    break
        return branch

    def _instead_of(self, branch: Branch, step: Step) -> Iterator[Branch]:
        """The branch without a step, then with what is more probable in its place, by the fitted runs, and by all."""
        without = self._without(branch, step)
        if without is None:
            return
        yield without
        others = [other for other in self._longer(without) if other[-1].key != step.key]
        by_fitted = max(others, key=lambda other: other[-1].probability, default=branch)
        if by_fitted[-1].probability <= self._beside_the_others(branch, step).probability:
            by_fitted = branch
        for other in dict.fromkeys([by_fitted, _ranked([branch, *others], self.data)[0]]):
            done = self._to_the_end(other) if other is not branch else None
            if done is not None:
                yield done

    def _in_the_robot(self, branch: Branch, error: Step, tried: Container[frozenset[Key]]) -> Branch | None:
        """The branch with what may be in the robot in place of an error of the log; `None` where that is believed."""
        without = self._without(branch, error)
        if without is None or self._is_believed(without, error.fitted_as(branch[-1])):
            return None
        longer = [other for other in self._longer(without) if not _errs(other[-1]) and _effects(other) not in tried]
        done = (self._to_the_end(other) for other in (_ranked(longer, self.data) if longer else ()))
        replacement = next((other for other in done if other is not None), without)
        return _ranked([without, replacement], self.data)[0]

    def _to_the_end(self, branch: Branch) -> Branch | None:
        """The branch with its last model fitted to the end; `None` where nobody believes that."""
        return self._believed_with(branch, unless_interrupted(finished(branch[-1].fit)))

    def _believed_with(self, branch: Branch, fit: Fit) -> Branch | None:
        """The branch with a fit of its last model; `None` where nobody believes that, or it predicts nothing."""
        if is_implausible(fit, _declarations(branch), branch[0].fit):
            return None
        last = replace(branch[-1], fit=fit).predicting_if_it_can(self.data)
        return None if last is None else (*branch[:-1], last)

    def reconsidered(self, branch: Branch) -> Branch:
        """The branch with each step asked anew beside all others, in the order in which they are told."""
        given, *added = branch
        if not added:
            return branch
        self.report("asking each step anew, beside all others")
        last, asked = branch[-1], [self._beside_the_others(branch, step) for step in added]
        network = last.fit.model.network

        def of_its_own(step: Step) -> tuple[bool, bool, float]:
            fault = _errs(step) or network.sets_apart(*step.declarations)
            return step.at_its_place < LIKELY, not fault, -step.gain

        def place(step: Step) -> tuple[bool, bool, float]:
            # Who misses a step misses what stands on it.
            return min(of_its_own(other) for other in asked if other is step or _stands_on(other, step))

        ordered = sorted(asked, key=place)
        return (given, *ordered[:-1], ordered[-1].fitted_as(last))

    def never_explained(self) -> tuple[str, ...]:
        """Names of held-out runs that stand out for every branch, the given model too, and that none explains by half.

        Such a run differs in something else than what the fitted runs lack, and would choose what happens to suit it.
        The rest of a fitted run does not: there the model is at fault.
        """
        given = self.branches[0][-1]
        return tuple(
            before.bound.run.name
            for number, before in enumerate(given.predicted)
            if is_of_another_log(given.fit, before.bound.run)
            and all(
                standing_out(branch[-1].fit, branch[-1].predicted[number], RUNS_DIFFER)
                and not explained_elsewhere(given.fit, errors_of([before]), errors_of([branch[-1].predicted[number]]))
                for branch in self.branches
            )
        )

    def remaining(self, branch: Branch) -> Verdict:
        """What its diagnosis says of a branch's last model, but that chance is no lack.

        That is what the fitted runs ask for though they are met within noise, and held-out runs, when it was tried, did
        not confirm; of what is said to act in one fitted run they know nothing.
        """
        last = self.diagnosis(branch)
        if last.verdict != "missing" or last.scores.is_lacking or branch[-1].holdout is None:
            return last.verdict
        asked = last.best.declaration if last.best else None
        tried = any(_effects(branch) < _effects(other) for other in self.branches)
        return "adequate" if tried and asked is not None and not asked.run else last.verdict

    def left_open(self, branch: Branch) -> tuple[Step, ...]:
        """As `History.rivals` has it, of a branch whose steps were reconsidered."""
        for step in branch[1:]:
            rivals = [other for other in self._others(branch, step) if other.key in step.indistinguishable]
            if rivals:
                return (step.fitted_as(branch[-1]), *rivals)
        return ()

    def _beside_the_others(self, branch: Branch, step: Step) -> Step:
        """A step of the branch as it is judged where all the other steps are there already."""
        last, diagnosis = branch[-1], self._diagnosis_without(branch, step)
        if diagnosis is None:
            return step
        return compared(diagnosis.fit, self._others(branch, step), step.fitted_as(last), self.data)

    def _others(self, branch: Branch, step: Step) -> tuple[Step, ...]:
        """All answers to what the branch lacks without one of its steps.

        Refits start where nothing stands for the step, and may end in another optimum than the branch, which came to
        its own over other models. Where they do, what a refit of the step leaves open beside it, or, without one, the
        most probable answer beside itself, is fitted from the branch, too.
        """
        asked = _effects(branch), step.key
        if asked not in self._other_answers:
            diagnosis, last = self._diagnosis_without(branch, step), branch[-1].fit
            refits = () if diagnosis is None else diagnosis.refits
            own = next((other for other in refits if other.key == step.key), refits[0] if refits else step)
            worse = last.cost < (1 - _SAME) * own.fit.cost
            rivals = {own.key, *own.indistinguishable} - {step.key} if worse else set()
            self._other_answers[asked] = tuple(
                self._refitted_from(branch, step, other) if other.key in rivals else other for other in refits
            )
        return self._other_answers[asked]

    def _refitted_from(self, branch: Branch, step: Step, rival: Step) -> Step:
        """A rival of one of the branch's steps, refitted in its place; as it was where that fits it no better."""
        network, others = _less(branch, step)
        added = rival.declarations
        names = {declared.shared_name(parameter.name) for declared in added for parameter in declared.parameters}
        sizes = {parameter.name: parameter.value for parameter in rival.fit.model.parameters if parameter.name in names}
        fit = continued(branch[-1].fit, network.with_effects(added).with_values(sizes))
        if fit.cost >= rival.fit.cost or is_implausible(fit, [*_declarations(others), *added], branch[0].fit):
            return rival
        gain = rival.gain + criterion_difference(rival.fit, fit)
        return replace(rival, fit=fit, gain=gain).predicting(self.data)

    def _without(self, branch: Branch, step: Step) -> Branch | None:
        """The branch without one of its steps; `None` where a later one stands at an edge that this made."""
        left = _effects(branch) - {step.key}
        match = next((other for other in self.branches if _effects(other) == left), None)
        if match is not None:
            return match
        last = branch[-1].fit
        try:
            network, others = _less(branch, step)
        except InputError:
            return None
        shorter = _ending_in(others, unless_interrupted(finished(continued(last, network))), self.data)
        self.branches.append(shorter)
        return shorter

    def _diagnosis_without(self, branch: Branch, step: Step) -> Diagnosis | None:
        """What the branch lacks without one of its steps."""
        shorter = self._without(branch, step)
        return None if shorter is None else self.diagnosis(shorter)

    def _longer(self, branch: Branch) -> list[Branch]:
        """The branch with each refit of its last model that is beyond chance, each name for one step once.

        Errors of sensors, clocks and the air are added where they are believed, see `_is_believed`. Of several names
        for one step, such as less air in one run and more in the other, that one is taken which held-out runs make most
        probable.
        """
        longer: list[Branch] = []
        for step in self.diagnosis(branch).refits:
            if _errs(step) and not self._is_believed(branch, step):
                continue
            believed = not is_implausible(step.fit, _declarations((*branch, step)), branch[0].fit)
            beyond_chance = step.p_value < SIGNIFICANT and step.gain > 0
            if not (believed and beyond_chance) or step.fit.status == "given up":
                continue
            one = (*branch, step)
            same = [k for k, other in enumerate(longer) if _is_same(other[-1].fit, step.fit)]
            if same:
                longer[same[0]] = _ranked([longer[same[0]], one], self.data)[0]
            else:
                longer.append(one)
        return longer

    def _is_believed(self, branch: Branch, error: Step) -> bool:
        """Whether an error of the log may be added: where such are believed, and it is among them.

        It must stand beside what it may be confused with, see `_stands`, and explain half at least of what the model
        gets wrong where it is read: what a model lacks leaves smooth errors, of which any smooth curve takes its share.
        """
        believed = self._errors_are_believed(branch)
        return believed and self._explains_half(branch, error) and self._stands(branch, error)

    def _explains_half(self, branch: Branch, error: Step) -> bool:
        """Whether an error of the log explains half of the misfit at its sensors, in its run if it is of one.

        An error of the air is read by no node of the model: of it that is asked of all of them.
        """
        diagnosis, network = self.diagnosis(branch), error.fit.model.network
        touched = {node for declared in error.declarations for _, ends in network.places_for(declared) for node in ends}
        nodes, run = touched.intersection(error.fit.model.nodes), error.declaration.run if error.declaration else ""
        return explains(HALF, diagnosis.fit, error.fit, diagnosis.scores.noise, nodes, run or EVERYWHERE)

    def _errors_are_believed(self, branch: Branch) -> bool:
        """Whether by the fitted runs errors of the log are likelier than all else that the branch may lack.

        They are fitted so easily that a better prediction says nothing for them, and one number imitates what several
        things in a robot do together: a clock's delay the lags of sensors, windings and masses. So the likeliest of
        them must stand beside everything in the robot that it may be confused with, see `_stands`. That is asked of
        the first model that makes it likely, and holds for all: later steps may have some of these things in its place.
        Those that explain little where they are read are left out of it, as those that don't stand.
        """
        effects = _effects(branch)
        if effects not in self._believed:
            self._believed[effects] = False
            errors = [step for step in self.diagnosis(branch).refits if _errs(step)]
            half = [step for step in errors if self._explains_half(branch, step)]
            while left := [step for step in half if self._standing.get(step.key, True)]:
                # Of what is left without those that are not believed, half at least.
                of_left, of_all = (sum(step.probability for step in steps) for steps in (left, errors))
                if of_left < LIKELY * (1 - of_all + of_left):
                    break
                likeliest = max(left, key=lambda step: step.probability)
                self._standing[likeliest.key] = self._stands(branch, likeliest)
                if self._standing[likeliest.key]:
                    self._believed[effects] = True
                    break
        return self._believed[effects]

    def _stands(self, branch: Branch, error: Step) -> bool:
        """Whether an error of the log is likelier than all in the robot that it is confused with.

        That is asked of each model, until one makes it the likeliest error.
        """
        if error.key in self._standing:
            return self._standing[error.key]
        asked = _effects(branch), error.key
        if asked not in self._standing_beside:
            self._standing_beside[asked] = self._beats_all_confused(branch, error)
        return self._standing_beside[asked]

    def _beats_all_confused(self, branch: Branch, error: Step) -> bool:
        """Whether, by all runs, all in the robot together that an error is confused with is less probable than it.

        Or than both together: a clock that is late is late in a robot whose heat is late as well.
        """
        confused = self._with_all_confused(branch, error)
        last = confused[-1].fit
        if len(confused) == len(branch) or is_implausible(last, _declarations(confused), branch[0].fit):
            return True
        rivals: list[Branch] = [confused, (*branch, error)]
        both = (*confused, *(replace(error, fit=refit(last, declaration)) for declaration in error.declarations))
        if not is_implausible(both[-1].fit, _declarations(both), branch[0].fit):
            rivals.append(both)
        predicted = [_ending_in(rival, rival[-1].fit, self.data) for rival in rivals]
        return _ranked(predicted, self.data)[0] is not predicted[0]

    def _with_all_confused(self, branch: Branch, error: Step) -> Branch:
        """The branch with all in the robot that an error is confused with, there; of the surroundings, everywhere."""
        diagnosis = self.diagnosis(branch)
        candidates, fit = {score.candidate.key: score for score in diagnosis.scores.ranked}, diagnosis.fit
        odds = dict(zip(candidates, log_priors([score.candidate for score in candidates.values()]), strict=True))
        if error.declaration is None:
            return branch
        effect = error.declaration.effect
        places = (error.at or "", error.declaration.at, *([EVERYWHERE] if effect.site == "boundary" else []))
        for kind in effect.signature.confused_with:
            key = next(((kind, at) for at in places if (kind, at) in candidates), None)
            if key is not None and not candidates[key].candidate.effect.errs:
                declared = candidates[key].candidate.declaration(None, candidates[key].shape)
                fit = refit(fit, declared)
                branch = (*branch, Step(fit, declared, log_odds=float(odds[key])))
        return branch

    def _next(self, pool: Sequence[Branch], width: int) -> list[Branch]:
        """The most probable branches that have a hope, each set of effects once, fitted to the end."""
        unique: dict[frozenset[Key], Branch] = {}
        for branch in sorted(pool, key=lambda branch: branch[-1].fit.cost):
            unique.setdefault(_effects(branch), branch)
        branches = list(unique.values())
        if not branches:
            return []
        hopeful = [branch for branch in branches if branch[-1].fit.cost <= HOPELESS * branches[0][-1].fit.cost]
        # A short log may favour an alias; what is probable by all runs is followed as well.
        by_fitted, by_all, done = _ranked(hopeful), _ranked(branches, self.data), list[Branch]()
        # To the end, each of those may go where nobody believes it: then the next ones that have a hope are asked.
        while not done and (followed := list(dict.fromkeys([*by_fitted[:width], *by_all[:width]]))):
            # Fits that only ranked candidates ended early: where a valley is long, their held-out errors are accidents.
            fits = (self.executor.map if self.executor else map)(finished, [branch[-1].fit for branch in followed])
            ends = (
                self._believed_with(branch, unless_interrupted(fit)) for branch, fit in zip(followed, fits, strict=True)
            )
            done = [longer for longer in ends if longer is not None]
            by_fitted = [branch for branch in by_fitted if branch not in followed]
            by_all = [branch for branch in by_all if branch in by_fitted]
        return list(dict.fromkeys([*done[:width], _ranked(done, self.data)[0]])) if done else []


def _less(branch: Branch, step: Step) -> tuple[Network, Branch]:
    """The branch's network without a step, and its other steps; what was a place's difference from it is its own.

    Made from the given one, so that a run has back the nuisance parameter that the step stood for.

    Raises:
        InputError: another step stands at an edge that this made.
    """
    left = [other for other in branch if other is not step]
    network, others = branch[0].fit.model.network.with_effects(_declarations(left)), []
    for other in left:
        declared = other.declaration
        if declared is not None and declared.difference:
            common = {instance.place for instance in network.in_common(declared.effect.key)}
            if not common.issuperset(place for place, _ in network.places_for(declared)):
                own = _as_its_own(declared, branch[-1].fit, step)
                network = network.without_effect(*other.key).with_effects([own])
                other = replace(other, declaration=own)
        others.append(other)
    return network, tuple(others)


def _as_its_own(difference: EffectDeclaration, fit: Fit, common: Step) -> EffectDeclaration:
    """What a place had beside a common effect, as an effect of its own that starts from both."""
    fitted = {parameter.name: parameter.value for parameter in fit.model.parameters}
    amplitude, shared = difference.effect.amplitude(), replace(common, fit=fit).amplitude
    parameters = []
    for stated in difference.effect.stated():
        own = next((parameter for parameter in difference.parameters if parameter.name == stated.name), stated)
        value = fitted.get(difference.shared_name(own.name), own.value)
        if amplitude is not None and shared is not None and own.name == amplitude.name:
            value += shared.value
        lower, upper = stated.bounds
        parameters.append(replace(own, bounds=stated.bounds, value=min(max(value, lower), upper)))
    return replace(difference, parameters=tuple(parameters), difference=False)


def _ending_in(branch: Branch, fit: Fit, data: DataSplit) -> Branch:
    """The branch with another fit of its last model."""
    return (*branch[:-1], replace(branch[-1], fit=fit).predicting(data))


def _in_words(beam: Sequence[Branch]) -> str:
    """The branches of a step and their errors, for progress."""
    kind, unit = ("held out", " K") if beam[0][-1].holdout else ("misfit", "")
    return "; ".join(f"{named(branch[-1].key)} ({kind} {_error(branch):.3g}{unit})" for branch in beam)


# --- Which of the branches is kept, how far, and without which steps ---------------------------------


def _chosen(branches: Sequence[Branch], data: DataSplit) -> Branch:
    """The most probable by all runs of the branches that predict held-out runs better than all shorter ones."""
    if branches[0][-1].holdout is None:
        return _ranked(branches)[0]
    return _ranked(_better_than_shorter(branches, [_error(branch) for branch in branches]), data)[0]


def _not_worse(branches: Sequence[Branch], data: DataSplit) -> list[Branch]:
    """Those that predict held-out runs, which choose nothing, better than all shorter ones."""
    steps = [branch[-1].predicting_if_it_can(data) for branch in branches]
    return _better_than_shorter(branches, [step.holdout.rmse if step and step.holdout else np.inf for step in steps])


def _better_than_shorter(branches: Sequence[Branch], errors: Sequence[float]) -> list[Branch]:
    """Those of which the error is below that of every shorter one."""
    by_length = list(zip(map(len, branches), errors, strict=True))
    return [
        branch
        for branch, error in zip(branches, errors, strict=True)
        if all(error < other for length, other in by_length if length < len(branch))
    ]


def _is_negligible(shorter: Branch, longer: Branch) -> bool:
    one, other = shorter[-1], longer[-1]
    return is_negligible(one.fit, other.fit, one.predicted, other.predicted)


def _ranked(branches: Sequence[Branch], data: DataSplit | None = None) -> list[Branch]:
    """The most probable first: by the fitted runs, or, with `data`, by all runs.

    Then what predicts held-out runs much worse than another comes last, however well it fits.
    """
    predicted = held_out([branch[-1] for branch in branches], data) if data is not None and data.holdout else []
    shares = _probabilities(branches, predicted)
    errors = [_error(branch) for branch in branches] if predicted else [0.0] * len(branches)
    most = MUCH_WORSE * min(errors)
    order = sorted(range(len(branches)), key=lambda k: (errors[k] > most, -shares[k], branches[k][-1].fit.cost))
    return [branches[k] for k in order]


def _probabilities(branches: Sequence[Branch], predicted: Sequence[Sequence[Prediction]] = ()) -> FloatArray:
    """Of each branch's last model, given that one of them is right, shape (branches,); see `probabilities`."""
    odds = [sum(step.log_odds for step in branch) for branch in branches]
    sizes = [log_prior_of_sizes(branch[-1].fit, _declarations(branch)) for branch in branches]
    starts = [branch[-1].log_evidence_of_starts for branch in branches]
    priors = np.array([odds, sizes, starts]).sum(axis=0)
    return probabilities([branch[-1].fit for branch in branches], priors, predicted)


def _declarations(branch: Sequence[Step]) -> list[EffectDeclaration]:
    return [declaration for step in branch for declaration in step.declarations]


# --- The verdict, and the branch that is kept at full resolution ------------------------------------


def _verdict(first: Diagnosis, remaining: Verdict, given: Branch, kept: Branch) -> Verdict:
    """On the model as given; effects that only the fitted runs ask for explain nothing."""
    if first.verdict == "adequate":
        return "adequate"
    if remaining == "adequate":
        return "missing" if len(kept) > 1 else "adequate"
    before, after = given[-1], kept[-1]
    elsewhere = explained_elsewhere(before.fit, before.holdout, after.holdout)
    enough = explains(HALF, before.fit, after.fit, first.scores.noise)
    return "missing" if enough and elsewhere else "unexplained"


def _at_full_resolution(branch: Branch, data: DataSplit) -> Branch:
    """Each model of a branch fitted at full resolution; the first and the last made for use.

    These start from their fits on coarse data, those between from the one before. Masses may be as fast as
    their effects allow; in a search they were no faster than half its steps.
    """
    steps: list[Step] = []
    network = branch[0].fit.model.network
    for number, step in enumerate(branch):
        step = replace(step, declaration=_with_own_bounds(step.declaration) if step.declaration else None)
        network = network.with_effects(step.declarations)
        if number == 0:
            fit = unless_interrupted(fit_segments(step.fit.model, data.fit, step.fit.point))
        elif number == len(branch) - 1:
            # The effects, and their states, may stand in another order than in the model that was searched.
            searched = step.fit
            model = Model(network.with_values({one.name: one.value for one in searched.model.parameters}))
            order = [searched.model.states.index(state) for state in model.states]
            point = Point(model.values, [start[order] for start in searched.point.starts])
            fit = unless_interrupted(fit_segments(model, data.fit, point, within=searched.problem.within))
        else:
            fit = unless_interrupted(finished(continued(steps[-1].fit, network, within=step.fit.problem.within)))
        step = replace(step, fit=fit)
        steps.append(step.made_for_use(data) if number in (0, len(branch) - 1) else step)
    return tuple(steps)


def _with_own_bounds(declared: EffectDeclaration) -> EffectDeclaration:
    own = {stated.name: stated.bounds for stated in declared.effect.stated(declared.difference)}
    return replace(
        declared, parameters=tuple(replace(one, bounds=own.get(one.name, one.bounds)) for one in declared.parameters)
    )
