"""Candidates refitted exactly: the score is a first-order guess, the refit is what counts."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from math import log, log2

import numpy as np

from lptn.arrays import FloatArray
from lptn.diagnose.candidates import Candidate
from lptn.diagnose.score import Score, Scores
from lptn.diagnose.stretches import clearly_differ
from lptn.identify import Fit, finished, fit
from lptn.model import Model
from lptn.network import EffectDeclaration, Network
from lptn.simulate import Drive, default_start, drive, start_from

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
        fitted = next(each.value for each in self.fit.model.unknowns if each.name.startswith(name))
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
        done[done.index(each)] = replace(each, fit=unless_interrupted(longer), gain=worse_by(base, longer))
    return _plausible_first(sorted(done, key=lambda each: -each.gain))


def _plausible_first(done: list[Refit]) -> list[Refit]:
    """Of those that explain the data as well as the best does, typical sizes come first, then few parameters."""
    level = [each for each in done if alike(each, done[0])]
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
    drives = [_redriven(model, driven) for driven in problem.drives]
    known = {unknown.name: unknown.value for unknown in base.model.unknowns}
    guess = np.array([known.get(unknown.name, unknown.value) for unknown in model.unknowns])
    starts = [
        _carried(base.model, model, start, driven) for start, driven in zip(base.point.starts, drives, strict=True)
    ]
    done = fit(
        model,
        drives,
        mirror_weight=problem.mirror_weight,
        sigma=problem.sigma,
        guess=guess,
        starts=starts,
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


def worse_by(one: Fit, other: Fit) -> float:
    """How much worse `one` explains the data than `other`: a difference of information criteria.

    Residuals that repeat each other are not independent evidence. The logarithm of the ratio of misfits
    therefore counts as often as there are independent residuals in the better of the two fits, and each
    free parameter costs the logarithm of that number (Schwarz's criterion [Schwarz1978]).
    """
    better = one if one.cost < other.cost else other
    independent = independent_readings(better)
    misfit = independent * log(max(one.cost, 1e-300) / max(other.cost, 1e-300))
    return misfit + (len(one.problem.free) - len(other.problem.free)) * log(independent)


def alike(one: Refit, other: Refit) -> bool:
    """Whether two refits of one baseline are one answer with two names."""
    less, more = sorted((one.gain, other.gain))
    return more - less <= TIE or (less >= _COMPARABLE * more and tied(one.fit, other.fit))


def tied(one: Fit, other: Fit) -> bool:
    """Whether two fits explain the data equally well: by the criterion, or within its scatter over the runs."""
    return abs(worse_by(one, other)) <= TIE or not clearly_differ(one, other)


def independent_readings(done: Fit) -> float:
    """Number of readings that are as good as independent, from the residuals' correlation in time."""
    found = 0.0
    for driven, error in zip(done.problem.drives, done.residuals, strict=True):
        for row in range(len(error)):
            residual = error[row][driven.counted[row]]
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
    return Refit(score.candidate, declaration, done, added, worse_by(base, done))


def _redriven(model: Model, driven: Drive) -> Drive:
    """The same run and the same counted readings for another model."""
    again = drive(model, driven.run)
    return Drive(again.run, again.inputs, again.measured, driven.counted, again.start)


def _carried(old: Model, new: Model, states: FloatArray, driven: Drive) -> FloatArray:
    """Initial states of the new model: those of the old one by name, new hidden states in equilibrium."""
    nodes = dict(zip(new.nodes, default_start(new, driven).tolist(), strict=False))
    return start_from(new, driven, nodes | dict(zip(old.states, states.tolist(), strict=True)))
