"""Forward selection: diagnose, add, refit, step by step, and the errors on the way down."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.diagnose.candidates import with_ambient_bias
from lptn.diagnose.diagnosis import (
    MUCH_WORSE,
    SIGNIFICANT,
    TIE,
    Diagnosis,
    Finding,
    Verdict,
    continued,
    criterion_difference,
    examine,
    explained_elsewhere,
    for_search,
    tied,
    unless_interrupted,
)
from lptn.diagnose.lack_of_fit import explained
from lptn.identify.comparison import Errors, Prediction, predict
from lptn.identify.data import DataSplit
from lptn.identify.fitting import Fit, finished
from lptn.identify.validation import fit_segments, holdout_errors
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration

# --- A ladder in the making: a model with some effects added, fitted on coarse data, and its held-out error ---


WORTH = 0.01
"""Share by which a rung must lower the held-out error."""


@dataclass(frozen=True)
class Selection:
    """A ladder in the making.

    Args:
        fit: of the model with the effects added so far.
        steps: the effects, in the order in which they were added.
        data: the evidence, in the steps of the search.
    """

    fit: Fit
    steps: tuple[Finding, ...]
    data: DataSplit

    @property
    def effects(self) -> frozenset[tuple[str, str]]:
        """Effect and place of all steps."""
        return frozenset(step.key for step in self.steps)

    @cached_property
    def predictions(self) -> list[Prediction]:
        """Of the held-out runs."""
        return [predict(self.fit.model, part, self.fit.problem.sigma) for part in self.data.holdout]

    @cached_property
    def holdout(self) -> Errors | None:
        """Errors on the held-out runs, `None` without any."""
        if not self.data.holdout:
            return None
        return Errors.of(np.concatenate([prediction.error.ravel() for prediction in self.predictions]))

    @property
    def rank(self) -> float:
        """What orders ladders: the held-out error where there is one, else the misfit."""
        return self.holdout.rmse if self.holdout else self.fit.cost


# --- Ladders followed side by side as long as the fitted data can't tell them apart ---------------


_WIDTH, _WIDTH_LATER = 4, 2  # ladders followed side by side where the fitted data can't tell them apart
_BY_HOLDOUT = 2  # more ladders that are looked at because they do well on held-out data
_UNOPPOSED = 1e-3  # share by which a held-out error may rise and still speak against nothing
_ALIAS = 1e-3  # two rungs on one ladder whose misfits differ by less are one rung with two names

Report = Callable[[str], None]


class Search:
    """Follows ladders side by side; remembers every diagnosis and every model it came by.

    Args:
        data: the evidence, in the steps of the search.
        executor: where refits run; here, one after the other, by default.
        report: told what is being done.
    """

    def __init__(self, data: DataSplit, executor: Executor | None, report: Report) -> None:
        self.data, self.executor, self.report = data, executor, report
        self.paths: list[Selection] = []
        self._diagnoses: dict[frozenset[tuple[str, str]], Diagnosis] = {}

    def climb(self, root: Selection, most: int) -> None:
        """Follow ladders from a root until nothing is left to add or nothing helps; they end up in `paths`.

        Args:
            root: the given model, fitted.
            most: how many effects to add at most.
        """
        self.paths = [root]
        beam = [root]
        best = root.rank
        for depth in range(1, most + 1):
            if any(self.diagnosis(path).verdict == "adequate" for path in beam):
                return  # nothing is left to add; a longer ladder could only be longer
            width = _WIDTH if depth == 1 else _WIDTH_LATER
            beam = self._next([child for path in beam for child in self._children(path)], width)
            if not beam:
                return
            self.paths += beam
            reached = min(path.rank for path in beam)
            self.report(f"rung {depth}: {_in_words(beam)}")
            # The first of a pair may help nobody alone, so one rung without a gain is allowed at the start.
            if reached > (1 - WORTH) * best and depth > 1:
                return
            best = min(best, reached)

    def diagnosis(self, path: Selection) -> Diagnosis:
        """What a ladder's model lacks, asked once."""
        if path.effects not in self._diagnoses:
            self._diagnoses[path.effects] = examine(path.fit, self.data, executor=self.executor)
        return self._diagnoses[path.effects]

    def complete(self, chosen: Selection) -> Selection:
        """The chosen ladder, or one that leaves nothing unexplained where held-out data have nothing against it."""
        if self.diagnosis(chosen).verdict == "adequate":
            return chosen
        known = [path for path in self.paths if path.effects in self._diagnoses]
        whole = [path for path in known if self.diagnosis(path).verdict == "adequate"]
        unopposed = [path for path in whole if path.rank <= chosen.rank * (1 + _UNOPPOSED)]
        return min(unopposed, key=lambda path: len(path.steps), default=chosen)

    def _children(self, path: Selection) -> list[Selection]:
        children: list[Selection] = []
        for finding in self.diagnosis(path).findings:
            cost = finding.refit.fit.cost
            same = any(abs(child.fit.cost - cost) < _ALIAS * cost for child in children)
            hopeless = finding.refit.fit.status == "given up"
            if finding.p_value < SIGNIFICANT and not same and not hopeless:
                children.append(Selection(finding.refit.fit, (*path.steps, finding), self.data))
        return children

    def _next(self, pool: Sequence[Selection], width: int) -> list[Selection]:
        """The best children and those that the fitted data can't tell from it, each set of effects once."""
        unique: dict[frozenset[tuple[str, str]], Selection] = {}
        for path in sorted(pool, key=lambda each: each.fit.cost):
            unique.setdefault(path.effects, path)
        paths = list(unique.values())
        if not paths:
            return []
        level = [path for path in paths if tied(path.fit, paths[0].fit)]
        # A short log may favour an alias; what held-out data prefer by more than any scatter is followed as well.
        least = min(path.rank for path in level)
        preferred = [path for path in paths if path in level or MUCH_WORSE * path.rank < least]
        by_holdout = sorted(preferred, key=lambda each: each.rank)[:_BY_HOLDOUT]
        # Fits that only ranked candidates ended early: where a valley is long, their held-out errors are accidents.
        followed = [*level[:width], *(path for path in by_holdout if path not in level[:width])]
        fits = (self.executor.map if self.executor else map)(finished, [path.fit for path in followed])
        done = [replace(path, fit=unless_interrupted(fit)) for path, fit in zip(followed, fits, strict=True)]
        best = min(done, key=lambda each: each.rank)
        return done[:width] if best in done[:width] else [*done[:width], best]


def _in_words(beam: Sequence[Selection]) -> str:
    """The ladders of a rung and their errors, for progress."""
    kind = "held out" if beam[0].holdout else "misfit"
    unit = " K" if beam[0].holdout else ""
    named = (f"{path.steps[-1].key[0]} at {path.steps[-1].key[1]} ({kind} {path.rank:.3g}{unit})" for path in beam)
    return "; ".join(named)


# --- Which of the ladders that were followed is kept, how far, and without which rungs ------------


_BLOCK = 120.0  # s; held-out errors further apart than this count as independent
_CLEAR = 2.0  # standard errors


def chosen(paths: Sequence[Selection]) -> Selection:
    """The shortest ladder that reaches the best error; of equally long ones the clearly better, else the first."""
    if paths[0].holdout is None:
        best = paths[0]
        for path in paths[1:]:
            if criterion_difference(best.fit, path.fit) > 0:
                best = path
        return best
    least = min(path.rank for path in paths)
    enough = [path for path in paths if path.rank <= least * (1 + WORTH)]
    depth = min(len(path.steps) for path in enough)
    level = _plausible_first([path for path in paths if len(path.steps) == depth])
    best = next(path for path in level if path in enough)
    near = [path for path in level if path is best or path.rank <= MUCH_WORSE * best.rank]
    return next(path for path in near if path is best or not _clearly_worse(path, best))


def _plausible_first(paths: Sequence[Selection]) -> list[Selection]:
    """By misfit; of those that the fitted data can't tell from the best, typical sizes, then few parameters, first."""
    least = min(paths, key=lambda each: each.fit.cost)

    def order(path: Selection) -> tuple[bool, int, int, float]:
        level = tied(path.fit, least.fit)
        unusual, free = sum(step.refit.unusual for step in path.steps), len(path.fit.problem.free)
        return (not level, unusual if level else 0, free if level else 0, path.fit.cost)

    return sorted(paths, key=order)


def _clearly_worse(path: Selection, than: Selection) -> bool:
    """Whether held-out errors differ by more than their own scatter."""
    differences = np.concatenate(
        [
            _block_squares(one) - _block_squares(other)
            for one, other in zip(path.predictions, than.predictions, strict=True)
        ]
    )
    if differences.size < 2:
        return path.rank > than.rank
    scatter = float(differences.std(ddof=1)) / np.sqrt(differences.size)
    return bool(differences.mean() > _CLEAR * scatter)


def _block_squares(prediction: Prediction) -> FloatArray:
    """Mean squared error of each block of held-out time that counts."""
    size = max(1, round(_BLOCK / prediction.bound.run.step))
    squares = prediction.error**2
    squares = squares[:, np.isfinite(squares).any(axis=0)]
    whole = squares.shape[1] // size * size
    return np.asarray(np.nanmean(squares[:, :whole].reshape(len(squares), -1, size), axis=(0, 2)))


def pruned(path: Selection, report: Callable[[str], None]) -> Selection:
    """The ladder less the rungs that later ones made superfluous."""
    for step in path.steps[:-1]:
        rest = tuple(other for other in path.steps if other is not step)
        network = path.fit.model.network.without_effect(*step.key)
        shorter = Selection(continued(path.fit, network), rest, path.data)
        cheaper = criterion_difference(shorter.fit, path.fit) < TIE
        if cheaper and shorter.rank <= path.rank * (1 + WORTH):
            report(f"{step.key[0]} at {step.key[1]} is no longer needed")
            return pruned(shorter, report)
    return path


# --- The ladder: diagnose, add, refit, rung by rung, and the errors on the way down ---------------
# Missing effects come in pairs whose first alone explains little, and short logs leave several first rungs equally
# good. So all rungs that the fitted data can't tell apart are followed a step further, without a held-out gate, and
# the held-out data decide at the end which ladder is kept and how far.


_MOST = 0.5  # share of the misfit beyond noise that the ladder must remove to be what was missing


@dataclass(frozen=True)
class Step:
    """One model of the ladder.

    Args:
        effect: key of the effect added, `None` for the model as it was given.
        at: its place.
        alike: effects and places that the fitted data could not tell from it.
        declaration: the effect as added.
        fit: the fitted model.
        holdout: errors on held-out runs.
        proof: errors on runs never looked at before.
    """

    effect: str | None
    at: str | None
    indistinguishable: tuple[tuple[str, str], ...]
    declaration: EffectDeclaration | None
    fit: Fit
    holdout: Errors | None
    test: Errors | None

    @property
    def parameters(self) -> int:
        """Number of free parameters."""
        return len(self.fit.problem.free)

    def as_json(self, number: int) -> dict[str, object]:
        """The rung as other tools read it."""
        holdout, test = self.holdout, self.test
        return {
            "rung": number,
            "effect": self.effect,
            "at": self.at,
            "parameters": self.parameters,
            "rmse_fit": self.fit.rmse,
            "rmse_holdout": holdout.rmse if holdout else None,
            "max_holdout": holdout.max if holdout else None,
            "rmse_proof": test.rmse if test else None,
            "indistinguishable_from": [list(key) for key in self.indistinguishable],
        }


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


@dataclass(frozen=True)
class History:
    """The models from the given one to the best.

    Args:
        verdict: on the model as given: adequate, missing something that was found, or unexplained.
        remaining: the same question asked of the last rung.
        rungs: the given model first.
        first: the diagnosis of the given model.
        last: the diagnosis of the last rung.
        considered: how many ladders were followed.
    """

    verdict: Verdict
    remaining: Verdict
    steps: tuple[Step, ...]
    first: Diagnosis
    last: Diagnosis
    considered: int

    @property
    def best(self) -> Step:
        """The last rung."""
        return self.steps[-1]

    def declarations(self) -> list[EffectDeclaration]:
        """The effects that were added, with the values that the last step's fit gave them."""
        return effects_added(self.steps)

    def as_json(self) -> dict[str, object]:
        """The ladder as other tools read it."""
        steps = [step.as_json(number) for number, step in enumerate(self.steps)]
        return {"verdict": self.verdict, "remaining": self.remaining, "ladder": steps}


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

    Effects are chosen on the fitted data. Held-out data choose among ladders that the fitted data can't tell
    apart, and say where the ladder ends; without them Schwarz's criterion does. Proof data choose nothing.

    Args:
        model: the model to start from.
        data: runs to fit, to hold out, and for proof.
        most: how many effects to add at most.
        ambient_error: how far the ambient sensor may be off in each run [K], one standard deviation.
        executor: where refits run; here, one after the other, by default.
        report: told what is being done.

    Raises:
        InputError: a run lacks an input of the model.
    """
    coarse = for_search(data)
    model = with_ambient_bias(model, data, ambient_error)
    report("fitting the model as it stands")
    search = Search(coarse, executor, report)
    root = Selection(unless_interrupted(fit_segments(model, coarse.fit)), (), coarse)
    search.climb(root, most)
    kept = pruned(search.complete(chosen(search.paths)), report)
    first, last = search.diagnosis(root), search.diagnosis(kept)
    report("fitting the rungs at full resolution")
    steps = _rungs(root, kept, data)
    return History(_verdict(first, last, root, kept), last.verdict, steps, first, last, len(search.paths))


def _verdict(first: Diagnosis, last: Diagnosis, root: Selection, kept: Selection) -> Verdict:
    """On the model as given; effects that only the fitted runs ask for explain nothing."""
    if first.verdict == "adequate":
        return "adequate"
    if last.verdict == "adequate":
        return "missing"
    elsewhere = explained_elsewhere(root.fit, root.holdout, kept.holdout)
    return "missing" if explained(root.fit, kept.fit, first.scores.by_chance) > _MOST and elsewhere else "unexplained"


def _rungs(root: Selection, kept: Selection, data: DataSplit) -> tuple[Step, ...]:
    """Each model of the ladder fitted at full resolution, with its errors."""
    network = root.fit.model.network
    done = _refined(root.fit, data)
    steps = [Step(None, None, (), None, done, holdout_errors(done, data.holdout), holdout_errors(done, data.test))]
    for step in kept.steps:
        network = network.with_effects([step.refit.declaration])
        last = step is kept.steps[-1]
        done = _refined(kept.fit, data) if last else unless_interrupted(finished(continued(done, network)))
        effect, at = step.key
        holdout, test = holdout_errors(done, data.holdout), holdout_errors(done, data.test)
        steps.append(Step(effect, at, step.indistinguishable, step.refit.declaration, done, holdout, test))
    return tuple(steps)


def _refined(coarse: Fit, data: DataSplit) -> Fit:
    """The same model fitted at full resolution, from the coarse solution."""
    return unless_interrupted(fit_segments(coarse.model, data.fit, coarse.point))
