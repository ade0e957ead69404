"""Which catalogue effect is missing, where, how sure, and what else would look the same."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from lptn.compare import Errors
from lptn.diagnose.candidates import candidates
from lptn.diagnose.lack import TOO_MUCH, explained, lack_of_fit
from lptn.diagnose.nuisance import with_ambient_errors
from lptn.diagnose.refit import TIE, Refit, alike, refit_all, shortlist, unless_interrupted
from lptn.diagnose.score import Scores, score
from lptn.evidence import Evidence
from lptn.identify import Fit
from lptn.model import Model
from lptn.on_evidence import fit_parts, holdout_errors

Verdict = Literal["adequate", "missing", "unexplained"]
Report = Callable[[str], None]
"""Called with a sentence on what is being done."""

_STEP = 5.0  # s; effects are sought on means over so long, which loses little and saves most of the time
_MOST_STEPS = 4000  # of all fitted runs together: days of data get longer means, so that memory stays bounded
_MOST_REFITS = 6
_ELSEWHERE = 0.3  # share of the held-out error, squared and beyond noise, that must go with it
_SILENT = 1.1  # mean squares so little above the noise show nothing that could go
_HELPS = 1e-3  # share of the misfit that a refit must remove to be worth a line
MUCH_WORSE = 1.2
"""Times the least held-out error: too much for any scatter to excuse."""
_ONE, _THREE = 0.6, 0.8  # shares of the excess misfit that one effect, or three, must remove to be what is missing


@dataclass(frozen=True)
class Finding:
    """One candidate that was refitted.

    Args:
        refit: the fitted larger model.
        rmse_fit: error on the fitted runs [K].
        holdout: errors on held-out runs, `None` without any.
        p_value: how often chance alone would score as much, over all candidates.
        alike: candidates that these data can't tell from it.
    """

    refit: Refit
    rmse_fit: float
    holdout: Errors | None
    p_value: float
    alike: tuple[tuple[str, str], ...]

    @property
    def key(self) -> tuple[str, str]:
        """Effect and place."""
        return self.refit.candidate.key


@dataclass(frozen=True)
class Diagnosis:
    """What a fitted model lacks.

    Args:
        verdict: `"adequate"`: within the noise; `"missing"`: an effect of the catalogue, or a few together,
            remove most of the misfit; `"unexplained"`: misfit that the catalogue does not remove.
        fit: the fitted baseline.
        rmse_fit: its error on the fitted runs [K].
        holdout: its errors on held-out runs, `None` without any.
        scores: all candidates, scored.
        findings: those that were refitted, best first.
    """

    verdict: Verdict
    fit: Fit
    rmse_fit: float
    holdout: Errors | None
    scores: Scores
    findings: tuple[Finding, ...]

    @property
    def helpful(self) -> tuple[Finding, ...]:
        """The findings that lower the misfit; the score promised as much of the others, their refit did not keep it."""
        return tuple(each for each in self.findings if each.refit.fit.cost < (1 - _HELPS) * self.fit.cost)

    def as_json(self) -> dict[str, object]:
        """The diagnosis as other tools read it."""
        before = None if self.holdout is None else self.holdout.rmse
        listed = [
            {
                "effect": finding.key[0],
                "at": finding.key[1],
                "rank": rank,
                "rmse_fit": finding.rmse_fit,
                "rmse_holdout_before": before,
                "rmse_holdout_after": None if finding.holdout is None else finding.holdout.rmse,
                "p_value": finding.p_value,
                "indistinguishable_from": [list(other) for other in finding.alike],
                "separate_by": finding.refit.candidate.effect.signature.separate_by,
            }
            for rank, finding in enumerate(self.helpful, start=1)
        ]
        return {
            "verdict": self.verdict,
            "rmse_fit": self.rmse_fit,
            "rmse_holdout": before,
            "lack_of_fit": self.scores.lack,
            "candidates": listed,
        }


def diagnose(
    model: Model,
    data: Evidence,
    *,
    refits: int = _MOST_REFITS,
    ambient_error: float = 0.0,
    executor: Executor | None = None,
    report: Report = lambda _: None,
) -> Diagnosis:
    """Fit the model, score every candidate, refit the best few, and judge.

    Args:
        model: the model to question.
        data: the runs to fit, and those held out.
        refits: how many candidates to refit at least.
        ambient_error: how far the ambient sensor may be off in each run [K], one standard deviation.
        executor: where refits run; here, one after the other, by default.
        report: told what is being done.

    Raises:
        InputError: a run lacks an input of the model.
    """
    coarse = for_search(data)
    model = with_ambient_errors(model, data, ambient_error)
    report("fitting the model as it stands")
    base = unless_interrupted(fit_parts(model, coarse.fit))
    found = examine(base, coarse, refits=refits, executor=executor, report=report)
    if found.verdict == "unexplained" and found.findings:
        report("looking for several effects at once")
        if _together(found, coarse, refits, executor):
            return replace(found, verdict="missing")
    return found


def for_search(data: Evidence) -> Evidence:
    """The same evidence in steps that a search takes: 5 s, longer for more than five hours to fit."""
    seconds = sum(len(part.run) * part.run.step for part in data.fit)
    return data.coarsened(max(_STEP, seconds / _MOST_STEPS))


def examine(
    base: Fit,
    data: Evidence,
    *,
    refits: int = _MOST_REFITS,
    executor: Executor | None = None,
    report: Report = lambda _: None,
) -> Diagnosis:
    """`diagnose` for a model that is fitted already, on data of the step it was fitted with."""
    columns = set.intersection(*(set(part.run.columns) for part in data.fit))
    found = candidates(base.model.network, columns, [part.run.name for part in data.fit])
    report(f"scoring {len(found)} candidates")
    scores = score(base, found)
    worthwhile = shortlist(scores, refits)
    report(f"refitting {len(worthwhile)} of them")
    done = refit_all(base, worthwhile, executor)
    findings = _findings(base, done, scores, data)
    holdout = holdout_errors(base, data.holdout)
    verdict = _verdict(base, findings, scores, holdout)
    return Diagnosis(verdict, base, base.rmse, holdout, scores, findings)


def _findings(base: Fit, done: Sequence[Refit], scores: Scores, data: Evidence) -> tuple[Finding, ...]:
    gains = {each.candidate.key: each.gain for each in scores.ranked}
    found = [
        Finding(
            each,
            each.fit.rmse,
            holdout_errors(each.fit, data.holdout),
            scores.p_value(gains[each.candidate.key]),
            _alike(each, done),
        )
        for each in done
    ]
    return tuple(_held_out_decides(found))


def _held_out_decides(found: list[Finding]) -> list[Finding]:
    """Of names for one answer those come last that held-out runs speak against."""
    if not found or found[0].holdout is None:
        return found
    names = {found[0].key, *found[0].alike}
    errors = [each.holdout.rmse for each in found if each.holdout and each.key in names]
    refuted = [
        each.key in names and each.holdout is not None and each.holdout.rmse > MUCH_WORSE * min(errors)
        for each in found
    ]
    order = [2 if each.key not in names else int(no) for each, no in zip(found, refuted, strict=True)]
    return [each for _, each in sorted(zip(order, found, strict=True), key=lambda pair: pair[0])]


def _alike(one: Refit, done: Sequence[Refit]) -> tuple[tuple[str, str], ...]:
    """Candidates that explain the data as well as one does."""
    return tuple(other.candidate.key for other in done if other is not one and alike(one, other))


def _verdict(base: Fit, findings: Sequence[Finding], scores: Scores, holdout: Errors | None) -> Verdict:
    lacking = any(value > TOO_MUCH for value in scores.lack.values())
    helps = bool(findings) and findings[0].refit.gain > TIE  # only candidates beyond chance were refitted
    if not lacking and not helps:
        return "adequate"
    if not findings:
        return "unexplained"
    best = findings[0].refit.fit
    nothing_left = all(value <= TOO_MUCH for value in lack_of_fit(best, scores.by_chance).values())
    elsewhere = explained_elsewhere(base, holdout, findings[0].holdout)
    return (
        "missing" if elsewhere and (nothing_left or explained(base, best, scores.by_chance) > _ONE) else "unexplained"
    )


def explained_elsewhere(base: Fit, before: Errors | None, after: Errors | None) -> bool:
    """Whether most of the held-out error beyond noise goes, too; true where nothing is held out, or shows it."""
    if before is None or after is None:
        return True
    floor = float(np.mean(base.noise.floor**2))
    if before.rmse**2 < _SILENT * floor:
        return after.rmse <= before.rmse
    return before.rmse**2 - after.rmse**2 > _ELSEWHERE * max(before.rmse**2 - floor, 0.0)


def _together(found: Diagnosis, data: Evidence, refits: int, executor: Executor | None) -> bool:
    """Whether three effects, each the best after the one before, remove what one alone can't."""
    fitted = Evidence(data.fit)
    path = found
    for _ in range(2):
        if not path.findings:
            break
        path = examine(path.findings[0].refit.fit, fitted, refits=refits, executor=executor)
    last = path.findings[0].refit.fit if path.findings else path.fit
    enough = explained(found.fit, last, found.scores.by_chance) > _THREE
    return enough and explained_elsewhere(found.fit, found.holdout, holdout_errors(last, data.holdout))
