"""Which catalogue effect is missing, where, how sure, what else would look the same: refits and the verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from math import log, log2
from typing import Literal

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.diagnose.candidates import Candidate, candidates, with_ambient_bias
from lptn.diagnose.lack_of_fit import TOO_MUCH, clearly_differ, explained, lack_of_fit
from lptn.diagnose.scores import Score, Scores, score
from lptn.identify.comparison import Errors
from lptn.identify.data import DataSplit
from lptn.identify.fitting import Fit, finished, fit
from lptn.identify.problem import Point
from lptn.identify.validation import fit_segments, holdout_errors
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network
from lptn.simulate.simulation import BoundRun, bind, default_start, start_from

# --- Candidates refitted exactly: the score is a first-order guess, the refit is what counts ------


TIE = 10.0
"""Information criteria closer than this decide nothing ([BurnhamAnderson2002]: beyond 10, no support)."""
SIGNIFICANT = 0.05
"""A score that chance alone reaches less often than this is beyond chance."""
# Enough to rank candidates; the rung that is kept is fitted to the end.
_ITERATIONS, _PRECISION = 25, 3e-4
_SAME_FAMILY_SHARE = 0.2  # the best place of an effect is refitted if it scores so much of the best gain
_HOPELESS = 1.5  # times the misfit of the most promising candidate
_NEAR = 1.3  # times the least misfit; a fit that was cut off so near to it may yet reach it
_COMPARABLE = 0.5  # share of the best gain below which no scatter makes two candidates alike
_TYPICAL_RANGE = (0.02, 20.0)  # first-order amplitudes outside this share of the typical size are not trusted


@dataclass(frozen=True)
class Refit:
    """One candidate, fitted with everything else free.

    Args:
        candidate: effect and place.
        declaration: the effect as it was added.
        fit: the fit of the larger model.
        parameters: how many free parameters were added.
        gain: how much better it explains the data than the baseline, parameters paid for.
    """

    candidate: Candidate
    declaration: EffectDeclaration
    fit: Fit
    parameters: int
    gain: float

    @property
    def size(self) -> float:
        """The fitted amplitude in units of its typical size."""
        amplitude = self.candidate.effect.amplitude()
        if amplitude is None:
            return 1.0
        name = f"{self.declaration.name}.{amplitude.name}."
        fitted = next(each.value for each in self.fit.model.parameters if each.name.startswith(name))
        return fitted / amplitude.typical

    @property
    def unusual(self) -> int:
        """By how many factors of two the size differs from the typical one; constants of materials hardly vary."""
        return round(abs(log2(max(abs(self.size), 1e-6))))


def shortlist(scores: Scores, most: int) -> list[Score]:
    """The candidates worth an exact refit: the best few, and the best place of every effect that scores well.

    None that chance alone would score. Effects with an inner state look alike to first order, so each effect
    gets its chance.
    """
    noticed = [score for score in scores.ranked if scores.p_value(score.gain) < SIGNIFICANT]
    chosen = noticed[:most]
    families = {score.candidate.effect for score in chosen}
    for score in noticed[most:]:
        if chosen and score.gain < _SAME_FAMILY_SHARE * chosen[0].gain:
            break
        if score.candidate.effect not in families:
            families.add(score.candidate.effect)
            chosen.append(score)
    return chosen


def refit_all(base: Fit, scores: Sequence[Score], executor: Executor | None = None) -> list[Refit]:
    """Refit each candidate, the one that explains most first.

    Args:
        base: the fitted baseline.
        scores: candidates with their first-order sizes.
        executor: where to run them; here, one after the other, by default.
    """
    if not scores:
        return []
    run = executor.map if executor else map
    # What has no hope to come near the most promising one is not fitted to the end.
    done = [_refit((base, score, np.inf)) for score in scores[:1]]
    done += run(_refit, [(base, score, _HOPELESS * done[0].fit.cost) for score in scores[1:]])
    # A large effect is a long way from the baseline; cut off, it would seem worse than another name for the same.
    most = _NEAR * min(each.fit.cost for each in done)
    cut_off = [each for each in done if each.fit.status == "not converged" and each.fit.cost <= most]
    for each, longer in zip(cut_off, run(finished, [each.fit for each in cut_off]), strict=True):
        done[done.index(each)] = replace(each, fit=unless_interrupted(longer), gain=criterion_difference(base, longer))
    return _plausible_first(sorted(done, key=lambda each: -each.gain))


def _plausible_first(done: list[Refit]) -> list[Refit]:
    """Of those that explain the data as well as the best does, typical sizes come first, then few parameters."""
    level = [each for each in done if indistinguishable(each, done[0])]
    rest = [each for each in done if each not in level]
    return [*sorted(level, key=lambda each: (each.unusual, each.parameters, -each.gain)), *rest]


def refit(base: Fit, declaration: EffectDeclaration, rival: float = np.inf) -> Fit:
    """The baseline and one more effect, started from the baseline's solution; `rival` as for `identify.fit`."""
    network = base.model.network.with_effects([declaration])
    return continued(base, network, rival)


def continued(base: Fit, network: Network, rival: float = np.inf) -> Fit:
    """Fit a network that differs from a fitted one by some effects, started from its solution."""
    model = Model(network)
    problem = base.problem
    bound_runs = [_redriven(model, bound) for bound in problem.bound_runs]
    known = {parameter.name: parameter.value for parameter in base.model.parameters}
    guess = np.array([known.get(parameter.name, parameter.value) for parameter in model.parameters])
    starts = [
        _carried(base.model, model, start, bound) for start, bound in zip(base.point.starts, bound_runs, strict=True)
    ]
    done = fit(
        model,
        bound_runs,
        symmetry_penalty=problem.symmetry_penalty,
        sigma=problem.sigma,
        guess=Point(guess, starts),
        iterations=_ITERATIONS,
        rival=rival,
        precision=_PRECISION,
    )
    return unless_interrupted(done)


def unless_interrupted(done: Fit) -> Fit:
    """A fit as it is; a search of many fits stops where one was stopped, since a half-done one decides nothing.

    Raises:
        KeyboardInterrupt: Ctrl-C ended the fit.
    """
    if done.status == "interrupted":
        raise KeyboardInterrupt
    return done


def criterion_difference(one: Fit, other: Fit) -> float:
    """How much worse `one` explains the data than `other`: a difference of information criteria.

    Residuals that repeat each other are not independent evidence. The logarithm of the ratio of misfits
    therefore counts as often as there are independent residuals in the better of the two fits, and each
    free parameter costs the logarithm of that number (Schwarz's criterion [Schwarz1978]).
    """
    better = one if one.cost < other.cost else other
    independent = independent_readings(better)
    misfit = independent * log(max(one.cost, 1e-300) / max(other.cost, 1e-300))
    return misfit + (len(one.problem.free) - len(other.problem.free)) * log(independent)


def indistinguishable(one: Refit, other: Refit) -> bool:
    """Whether two refits of one baseline are one answer with two names."""
    less, more = sorted((one.gain, other.gain))
    return more - less <= TIE or (less >= _COMPARABLE * more and tied(one.fit, other.fit))


def tied(one: Fit, other: Fit) -> bool:
    """Whether two fits explain the data equally well: by the criterion, or within its scatter over the runs."""
    return abs(criterion_difference(one, other)) <= TIE or not clearly_differ(one, other)


def independent_readings(done: Fit) -> float:
    """Number of readings that are as good as independent, from the residuals' correlation in time."""
    found = 0.0
    for bound, error in zip(done.problem.bound_runs, done.residuals, strict=True):
        for row in range(len(error)):
            residual = error[row][bound.counted[row]]
            if residual.size > 2:
                found += residual.size / _correlation_time(residual)
    return max(found, 3.0)


def _correlation_time(residual: FloatArray) -> float:
    """Samples that repeat each other: the autocorrelation summed while pairs of lags stay positive [Geyer1992]."""
    spectrum = np.abs(np.fft.rfft(residual, 2 * residual.size)) ** 2
    correlation = np.fft.irfft(spectrum)[: residual.size]
    if correlation[0] <= 0:
        return 1.0
    correlation = correlation / correlation[0]
    pairs = correlation[: residual.size // 2 * 2].reshape(-1, 2).sum(axis=1)
    positive = pairs[: int(np.argmax(pairs <= 0)) if (pairs <= 0).any() else len(pairs)]
    return max(1.0, 2.0 * float(positive.sum()) - 1.0)


def _refit(task: tuple[Fit, Score, float]) -> Refit:
    base, score, rival = task
    amplitude = score.candidate.effect.amplitude()
    size = None
    if amplitude is not None:
        least, most = (share * abs(amplitude.typical) for share in _TYPICAL_RANGE)
        size = float(np.sign(score.amplitude) * np.clip(abs(score.amplitude), least, most))
    declaration = score.candidate.declaration(size, score.shape)
    done = refit(base, declaration, rival)
    added = len(done.problem.free) - len(base.problem.free)
    return Refit(score.candidate, declaration, done, added, criterion_difference(base, done))


def _redriven(model: Model, bound: BoundRun) -> BoundRun:
    """The same run and the same counted readings for another model."""
    again = bind(model, bound.run)
    return BoundRun(again.run, again.inputs, again.measured, bound.counted, again.start)


def _carried(old: Model, new: Model, states: FloatArray, bound: BoundRun) -> FloatArray:
    """Initial states of the new model: those of the old one by name, new hidden states in equilibrium."""
    nodes = dict(zip(new.nodes, default_start(new, bound).tolist(), strict=False))
    return start_from(new, bound, nodes | dict(zip(old.states, states.tolist(), strict=True)))


# --- Which catalogue effect is missing, where, how sure, and what else would look the same --------


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
    indistinguishable: tuple[tuple[str, str], ...]

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
                "indistinguishable_from": [list(other) for other in finding.indistinguishable],
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
    data: DataSplit,
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
    model = with_ambient_bias(model, data, ambient_error)
    report("fitting the model as it stands")
    base = unless_interrupted(fit_segments(model, coarse.fit))
    found = examine(base, coarse, refits=refits, executor=executor, report=report)
    if found.verdict == "unexplained" and found.findings:
        report("looking for several effects at once")
        if _together(found, coarse, refits, executor):
            return replace(found, verdict="missing")
    return found


def for_search(data: DataSplit) -> DataSplit:
    """The same evidence in steps that a search takes: 5 s, longer for more than five hours to fit."""
    seconds = sum(len(part.run) * part.run.step for part in data.fit)
    return data.coarsened(max(_STEP, seconds / _MOST_STEPS))


def examine(
    base: Fit,
    data: DataSplit,
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


def _findings(base: Fit, done: Sequence[Refit], scores: Scores, data: DataSplit) -> tuple[Finding, ...]:
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
    names = {found[0].key, *found[0].indistinguishable}
    errors = [each.holdout.rmse for each in found if each.holdout and each.key in names]
    refuted = [
        each.key in names and each.holdout is not None and each.holdout.rmse > MUCH_WORSE * min(errors)
        for each in found
    ]
    order = [2 if each.key not in names else int(no) for each, no in zip(found, refuted, strict=True)]
    return [each for _, each in sorted(zip(order, found, strict=True), key=lambda pair: pair[0])]


def _alike(one: Refit, done: Sequence[Refit]) -> tuple[tuple[str, str], ...]:
    """Candidates that explain the data as well as one does."""
    return tuple(other.candidate.key for other in done if other is not one and indistinguishable(one, other))


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


def _together(found: Diagnosis, data: DataSplit, refits: int, executor: Executor | None) -> bool:
    """Whether three effects, each the best after the one before, remove what one alone can't."""
    fitted = DataSplit(data.fit)
    path = found
    for _ in range(2):
        if not path.findings:
            break
        path = examine(path.findings[0].refit.fit, fitted, refits=refits, executor=executor)
    last = path.findings[0].refit.fit if path.findings else path.fit
    enough = explained(found.fit, last, found.scores.by_chance) > _THREE
    return enough and explained_elsewhere(found.fit, found.holdout, holdout_errors(last, data.holdout))
