"""The ladder: diagnose, add, refit, rung by rung, and the errors on the way down.

Missing effects come in pairs whose first alone explains little, and short logs leave several first rungs equally
good. So all rungs that the fitted data can't tell apart are followed a step further, without a held-out gate, and
the held-out data decide at the end which ladder is kept and how far.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, replace

from lptn.compare import Errors
from lptn.diagnose import (
    Diagnosis,
    Verdict,
    continued,
    explained,
    explained_elsewhere,
    for_search,
    unless_interrupted,
    with_ambient_errors,
)
from lptn.evidence import Evidence
from lptn.identify import Fit, finished
from lptn.ladder_choice import chosen, pruned
from lptn.ladder_climb import Climb
from lptn.ladder_search import Report, Search
from lptn.model import Model
from lptn.network import EffectDeclaration
from lptn.on_evidence import fit_parts, holdout_errors

_MOST = 0.5  # share of the misfit beyond noise that the ladder must remove to be what was missing


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
    search = Search(coarse, executor, report)
    root = Climb(unless_interrupted(fit_parts(model, coarse.fit)), (), coarse)
    search.climb(root, most)
    kept = pruned(search.complete(chosen(search.paths)), report)
    first, last = search.diagnosis(root), search.diagnosis(kept)
    report("fitting the rungs at full resolution")
    rungs = _rungs(root, kept, data)
    return Ladder(_verdict(first, last, root, kept), last.verdict, rungs, first, last, len(search.paths))


def _verdict(first: Diagnosis, last: Diagnosis, root: Climb, kept: Climb) -> Verdict:
    """On the model as given; effects that only the fitted runs ask for explain nothing."""
    if first.verdict == "adequate":
        return "adequate"
    if last.verdict == "adequate":
        return "missing"
    elsewhere = explained_elsewhere(root.fit, root.holdout, kept.holdout)
    return "missing" if explained(root.fit, kept.fit, first.scores.by_chance) > _MOST and elsewhere else "unexplained"


def _rungs(root: Climb, kept: Climb, data: Evidence) -> tuple[Rung, ...]:
    """Each model of the ladder fitted at full resolution, with its errors."""
    network = root.fit.model.network
    done = _refined(root.fit, data)
    rungs = [Rung(None, None, (), None, done, holdout_errors(done, data.holdout), holdout_errors(done, data.proof))]
    for step in kept.steps:
        network = network.with_effects([step.refit.declaration])
        last = step is kept.steps[-1]
        done = _refined(kept.fit, data) if last else unless_interrupted(finished(continued(done, network)))
        effect, at = step.key
        holdout, proof = holdout_errors(done, data.holdout), holdout_errors(done, data.proof)
        rungs.append(Rung(effect, at, step.alike, step.refit.declaration, done, holdout, proof))
    return tuple(rungs)


def _refined(coarse: Fit, data: Evidence) -> Fit:
    """The same model fitted at full resolution, from the coarse solution."""
    return unless_interrupted(fit_parts(coarse.model, data.fit, coarse.point))
