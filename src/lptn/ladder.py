"""The ladder: diagnose, add, refit, rung by rung, and the errors on the way down.

Missing effects come in pairs whose first alone explains little, and short logs leave several first rungs equally
good. So all rungs that the fitted data can't tell apart are followed a step further, without a held-out gate, and
the held-out data decide at the end which ladder is kept and how far.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lptn.arrays import FloatArray
from lptn.compare import Errors, Prediction, predict
from lptn.diagnose import (
    MUCH_WORSE,
    SIGNIFICANT,
    TIE,
    Diagnosis,
    Finding,
    Verdict,
    continued,
    examine,
    explained,
    explained_elsewhere,
    for_search,
    tied,
    unless_interrupted,
    with_ambient_errors,
    worse_by,
)
from lptn.evidence import Evidence
from lptn.identify import Fit, finished
from lptn.model import Model
from lptn.network import EffectDeclaration
from lptn.on_evidence import fit_parts, holdout_errors

_WIDTH, _WIDTH_LATER = 4, 2  # ladders followed side by side where the fitted data can't tell them apart
_BY_HOLDOUT = 2  # more ladders that are looked at because they do well on held-out data
_WORTH = 0.01  # share by which a rung must lower the held-out error
_UNOPPOSED = 1e-3  # share by which a held-out error may rise and still speak against nothing
_MOST = 0.5  # share of the misfit beyond noise that the ladder must remove to be what was missing
_ALIAS = 1e-3  # two rungs on one ladder whose misfits differ by less are one rung with two names
_BLOCK = 120.0  # s; held-out errors further apart than this count as independent
_CLEAR = 2.0  # standard errors

Report = Callable[[str], None]


@dataclass(frozen=True)
class Rung:
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
    alike: tuple[tuple[str, str], ...]
    declaration: EffectDeclaration | None
    fit: Fit
    holdout: Errors | None
    proof: Errors | None

    @property
    def parameters(self) -> int:
        """Number of free parameters."""
        return len(self.fit.problem.free)

    def as_json(self, number: int) -> dict[str, object]:
        """The rung as other tools read it."""
        holdout, proof = self.holdout, self.proof
        return {
            "rung": number,
            "effect": self.effect,
            "at": self.at,
            "parameters": self.parameters,
            "rmse_fit": self.fit.rmse,
            "rmse_holdout": holdout.rmse if holdout else None,
            "max_holdout": holdout.max if holdout else None,
            "rmse_proof": proof.rmse if proof else None,
            "indistinguishable_from": [list(key) for key in self.alike],
        }


@dataclass(frozen=True)
class Ladder:
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
    rungs: tuple[Rung, ...]
    first: Diagnosis
    last: Diagnosis
    considered: int

    @property
    def best(self) -> Rung:
        """The last rung."""
        return self.rungs[-1]

    def declarations(self) -> list[EffectDeclaration]:
        """The effects that were added, with the values that the last rung's fit gave them."""
        fitted = {unknown.name: unknown.value for unknown in self.best.fit.model.unknowns}
        found = []
        for rung in self.rungs:
            if rung.declaration is not None:
                added, owner = rung.declaration, rung.declaration.at
                values = tuple(
                    replace(parameter, value=fitted.get(f"{added.name}.{parameter.name}.{owner}", parameter.value))
                    for parameter in added.parameters
                )
                found.append(replace(added, parameters=values))
        return found

    def as_json(self) -> dict[str, object]:
        """The ladder as other tools read it."""
        rungs = [rung.as_json(number) for number, rung in enumerate(self.rungs)]
        return {"verdict": self.verdict, "remaining": self.remaining, "ladder": rungs}


@dataclass(frozen=True)
class _Path:
    """A ladder in the making, on coarse data."""

    fit: Fit
    steps: tuple[Finding, ...]
    data: Evidence

    @property
    def effects(self) -> frozenset[tuple[str, str]]:
        return frozenset(step.key for step in self.steps)

    @cached_property
    def predictions(self) -> list[Prediction]:
        return [predict(self.fit.model, part, self.fit.problem.sigma) for part in self.data.holdout]

    @cached_property
    def holdout(self) -> Errors | None:
        if not self.data.holdout:
            return None
        return Errors.of(np.concatenate([prediction.error.ravel() for prediction in self.predictions]))

    @property
    def rank(self) -> float:
        """What orders ladders: the held-out error where there is one, else the misfit."""
        return self.holdout.rmse if self.holdout else self.fit.cost


def improve(
    model: Model,
    data: Evidence,
    *,
    most: int = 6,
    ambient_error: float = 0.0,
    executor: Executor | None = None,
    report: Report = lambda _: None,
) -> Ladder:
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
    model = with_ambient_errors(model, data, ambient_error)
    report("fitting the model as it stands")
    search = _Search(coarse, executor, report)
    root = _Path(unless_interrupted(fit_parts(model, coarse.fit)), (), coarse)
    search.climb(root, most)
    chosen = _pruned(search.complete(_chosen(search.paths)), report)
    first, last = search.diagnosis(root), search.diagnosis(chosen)
    report("fitting the rungs at full resolution")
    rungs = _rungs(root, chosen, data)
    return Ladder(_verdict(first, last, root, chosen), last.verdict, rungs, first, last, len(search.paths))


class _Search:
    """Follows ladders side by side; remembers every diagnosis and every model it came by."""

    def __init__(self, data: Evidence, executor: Executor | None, report: Report) -> None:
        self.data, self.executor, self.report = data, executor, report
        self.paths: list[_Path] = []
        self._diagnoses: dict[frozenset[tuple[str, str]], Diagnosis] = {}

    def climb(self, root: _Path, most: int) -> None:
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
            if reached > (1 - _WORTH) * best and depth > 1:
                return
            best = min(best, reached)

    def diagnosis(self, path: _Path) -> Diagnosis:
        if path.effects not in self._diagnoses:
            self._diagnoses[path.effects] = examine(path.fit, self.data, executor=self.executor)
        return self._diagnoses[path.effects]

    def complete(self, chosen: _Path) -> _Path:
        """The chosen ladder, or one that leaves nothing unexplained where held-out data have nothing against it."""
        if self.diagnosis(chosen).verdict == "adequate":
            return chosen
        known = [path for path in self.paths if path.effects in self._diagnoses]
        whole = [path for path in known if self.diagnosis(path).verdict == "adequate"]
        unopposed = [path for path in whole if path.rank <= chosen.rank * (1 + _UNOPPOSED)]
        return min(unopposed, key=lambda path: len(path.steps), default=chosen)

    def _children(self, path: _Path) -> list[_Path]:
        children: list[_Path] = []
        for finding in self.diagnosis(path).findings:
            cost = finding.refit.fit.cost
            same = any(abs(child.fit.cost - cost) < _ALIAS * cost for child in children)
            hopeless = finding.refit.fit.status == "given up"
            if finding.p_value < SIGNIFICANT and not same and not hopeless:
                children.append(_Path(finding.refit.fit, (*path.steps, finding), self.data))
        return children

    def _next(self, pool: Sequence[_Path], width: int) -> list[_Path]:
        """The best children and those that the fitted data can't tell from it, each set of effects once."""
        unique: dict[frozenset[tuple[str, str]], _Path] = {}
        for path in sorted(pool, key=lambda each: each.fit.cost):
            unique.setdefault(path.effects, path)
        paths = list(unique.values())
        if not paths:
            return []
        level = [path for path in paths if tied(path.fit, paths[0].fit)]
        by_holdout = sorted(level, key=lambda each: each.rank)[:_BY_HOLDOUT]
        # Fits that only ranked candidates ended early: where a valley is long, their held-out errors are accidents.
        followed = [*level[:width], *(path for path in by_holdout if path not in level[:width])]
        fits = (self.executor.map if self.executor else map)(finished, [path.fit for path in followed])
        done = [replace(path, fit=unless_interrupted(fit)) for path, fit in zip(followed, fits, strict=True)]
        best = min(done, key=lambda each: each.rank)
        return done[:width] if best in done[:width] else [*done[:width], best]


def _verdict(first: Diagnosis, last: Diagnosis, root: _Path, chosen: _Path) -> Verdict:
    """On the model as given; effects that only the fitted runs ask for explain nothing."""
    if first.verdict == "adequate":
        return "adequate"
    if last.verdict == "adequate":
        return "missing"
    elsewhere = explained_elsewhere(root.fit, root.holdout, chosen.holdout)
    return "missing" if explained(root.fit, chosen.fit, first.scores.by_chance) > _MOST and elsewhere else "unexplained"


def _chosen(paths: Sequence[_Path]) -> _Path:
    """The shortest ladder that reaches the best error; of equally long ones the clearly better, else the first."""
    if paths[0].holdout is None:
        best = paths[0]
        for path in paths[1:]:
            if worse_by(best.fit, path.fit) > 0:
                best = path
        return best
    least = min(path.rank for path in paths)
    enough = [path for path in paths if path.rank <= least * (1 + _WORTH)]
    depth = min(len(path.steps) for path in enough)
    level = _plausible_first([path for path in paths if len(path.steps) == depth])
    best = next(path for path in level if path in enough)
    near = [path for path in level if path is best or path.rank <= MUCH_WORSE * best.rank]
    return next(path for path in near if path is best or not _clearly_worse(path, best))


def _plausible_first(paths: Sequence[_Path]) -> list[_Path]:
    """By misfit; of those that the fitted data can't tell from the best, typical sizes, then few parameters, first."""
    least = min(paths, key=lambda each: each.fit.cost)

    def order(path: _Path) -> tuple[bool, int, int, float]:
        level = tied(path.fit, least.fit)
        unusual, free = sum(step.refit.unusual for step in path.steps), len(path.fit.problem.free)
        return (not level, unusual if level else 0, free if level else 0, path.fit.cost)

    return sorted(paths, key=order)


def _clearly_worse(path: _Path, than: _Path) -> bool:
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
    size = max(1, round(_BLOCK / prediction.drive.run.step))
    squares = prediction.error**2
    squares = squares[:, np.isfinite(squares).any(axis=0)]
    whole = squares.shape[1] // size * size
    return np.asarray(np.nanmean(squares[:, :whole].reshape(len(squares), -1, size), axis=(0, 2)))


def _pruned(path: _Path, report: Report) -> _Path:
    """The ladder less the rungs that later ones made superfluous."""
    for step in path.steps[:-1]:
        rest = tuple(other for other in path.steps if other is not step)
        network = path.fit.model.network.without_effect(*step.key)
        shorter = _Path(continued(path.fit, network), rest, path.data)
        cheaper = worse_by(shorter.fit, path.fit) < TIE
        if cheaper and shorter.rank <= path.rank * (1 + _WORTH):
            report(f"{step.key[0]} at {step.key[1]} is no longer needed")
            return _pruned(shorter, report)
    return path


def _rungs(root: _Path, chosen: _Path, data: Evidence) -> tuple[Rung, ...]:
    """Each model of the ladder fitted at full resolution, with its errors."""
    network = root.fit.model.network
    done = _refined(root.fit, data)
    rungs = [Rung(None, None, (), None, done, holdout_errors(done, data.holdout), holdout_errors(done, data.proof))]
    for step in chosen.steps:
        network = network.with_effects([step.refit.declaration])
        done = _refined(chosen.fit, data) if step is chosen.steps[-1] else continued(done, network)
        effect, at = step.key
        holdout, proof = holdout_errors(done, data.holdout), holdout_errors(done, data.proof)
        rungs.append(Rung(effect, at, step.alike, step.refit.declaration, done, holdout, proof))
    return tuple(rungs)


def _refined(coarse: Fit, data: Evidence) -> Fit:
    """The same model fitted at full resolution, from the coarse solution."""
    return unless_interrupted(fit_parts(coarse.model, data.fit, coarse.point))


def _in_words(beam: Sequence[_Path]) -> str:
    """The ladders of a rung and their errors, for progress."""
    kind = "held out" if beam[0].holdout else "misfit"
    unit = " K" if beam[0].holdout else ""
    named = (f"{path.steps[-1].key[0]} at {path.steps[-1].key[1]} ({kind} {path.rank:.3g}{unit})" for path in beam)
    return "; ".join(named)
