"""First-order scores: every candidate effect tried at the fitted baseline, without a refit.

One set of sensitivities says how each effect would move the residuals. What the fitted parameters can imitate is
integrated out, signs are enforced, and the evidence (`lptn.diagnose.evidence`) says by what factor each effect would
raise the probability of the readings. How often an effect is met, and where, is its prior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import lil_array
from scipy.sparse.csgraph import connected_components
from scipy.special import logsumexp

from lptn.basics.arrays import FloatArray
from lptn.basics.processes import one_blas_thread
from lptn.diagnose.candidates import Candidate, sites
from lptn.diagnose.evidence import Amplitude, Likelihood, derivatives_by_sites
from lptn.diagnose.fit_statistics import NEGLIGIBLE, NoiseLevel, lack_of_fit
from lptn.identify.fitting import Fit
from lptn.model.network import EffectDeclaration

_LOGS = 100  # simulated, to see what noise alone leaves of one-minute means
COMPARED = 12
"""So many of the best candidates are compared with each other, trace by trace."""
_IMITATED = 1e-8  # share of a trace's length left after projection: the fitted parameters imitate it wholly


@dataclass(frozen=True)
class Score:
    """One candidate, scored.

    Args:
        candidate: effect and place.
        log_prior: logarithm of the prior odds that it is what the model lacks, against nothing being missing.
        log_bayes_factor: logarithm of the factor by which it raises the evidence, to first order.
        gain: by how much adding it would lower the sum of squared weighted residuals, to first order.
        amplitude: its size to first order, in the amplitude's unit.
        shape: the shape of the grid that scores best.
        direction: its trace on the residuals, projected and normalised, shape (rows,); of the best `COMPARED` only.
        per_unit: length of the trace of a unit amplitude, 0 where the fitted parameters imitate it wholly.
        precision: one over the variance with which these data hold the amplitude, the discrepancy allowed for.
        reach: root mean square of its trace, to first order, at the node where that is largest [K].
    """

    candidate: Candidate
    log_prior: float
    log_bayes_factor: float
    gain: float
    amplitude: float
    shape: float | None
    direction: FloatArray
    per_unit: float
    precision: float
    reach: float = 0.0

    @property
    def log_odds(self) -> float:
        """Logarithm of the odds that the model lacks it, against nothing."""
        return self.log_prior + self.log_bayes_factor


@dataclass(frozen=True)
class Scores:
    """All candidates, the most probable first.

    Args:
        ranked: the scores.
        noise: what a perfect model would leave of each node's readings.
        lack_of_fit: of each node: mean square of its one-minute means over the most that noise leaves.
    """

    ranked: list[Score]
    noise: NoiseLevel
    lack_of_fit: dict[str, float]

    @property
    def worthwhile(self) -> list[Score]:
        """Those that leave more than a negligible trace, the most probable first."""
        return [each for each in self.ranked if each.reach >= NEGLIGIBLE]


@one_blas_thread
def score(
    fit: Fit,
    candidates: Sequence[Candidate],
    likelihood: Likelihood,
    added: Sequence[EffectDeclaration] = (),
    seed: int = 0,
) -> Scores:
    """Score every candidate against the residuals of a fit.

    Args:
        fit: the fitted baseline.
        candidates: effects and places.
        likelihood: of the readings.
        added: effects that the baseline has beyond the model that was given.
        seed: of the simulated logs.
    """
    shaped = [(number, shape) for number, each in enumerate(candidates) for shape in each.shapes]
    columns = _traces(fit, candidates, shaped)
    owner = np.array([number for number, _ in shaped])
    known = [Amplitude(candidates[number].typical, candidates[number].one_sided) for number in owner]
    factors, precisions = likelihood.of_candidates(fit, added, columns, known)
    # What the fitted parameters can't imitate of the traces; effects enter none of the problem's priors.
    basis = np.linalg.qr(_regular(fit.problem.jacobian(fit.z)[1]))[0]
    all_residuals = fit.problem.residuals(fit.z)
    residuals = _projected(all_residuals, basis)
    lengths = np.linalg.norm(columns, axis=0)
    columns = _projected(np.vstack([columns, np.zeros((len(basis) - len(columns), len(owner)))]), basis)
    left = np.linalg.norm(columns, axis=0)
    left[left <= _IMITATED * lengths] = 0.0
    sizes = np.divide(-(columns.T @ residuals), left**2, out=np.zeros_like(left), where=left > 0)
    sizes[np.array([each.one_sided for each in known], dtype=bool) & (sizes < 0)] = 0.0
    reach = np.abs(sizes) * _largest_root_mean_square(fit, columns)
    ranked = []
    for number, (candidate, prior) in enumerate(zip(candidates, log_priors(candidates).tolist(), strict=True)):
        own = np.flatnonzero(owner == number)
        best = own[np.argmax((sizes[own] * left[own]) ** 2)]
        ranked.append(
            Score(
                candidate,
                prior,
                float(logsumexp(factors[own]) - np.log(len(own))),  # all shapes are as probable as each other
                float((sizes[best] * left[best]) ** 2),
                float(sizes[best]),
                shaped[best][1],
                columns[:, best] / (left[best] or 1.0),
                float(left[best] if sizes[best] else left[own].max()),
                float(precisions[own].max()),
                float(reach[best]),
            )
        )
    ranked.sort(key=lambda each: -each.log_odds)
    # Only the traces of the best are compared with each other later; those of hundreds would fill the memory.
    ranked[COMPARED:] = [replace(each, direction=np.zeros(0)) for each in ranked[COMPARED:]]
    noise = NoiseLevel.of(fit, _projected(_simulated_noise(fit, np.random.default_rng(seed)), basis))
    return Scores(ranked, noise, lack_of_fit(fit, noise, residuals))


def _traces(fit: Fit, candidates: Sequence[Candidate], shaped: Sequence[tuple[int, float | None]]) -> FloatArray:
    """What unit amplitudes of candidates, each at one shape, do to the weighted residuals, shape (rows, shaped)."""
    places = sites(candidates)
    where = {site: number for number, site in enumerate(places)}
    members = lil_array((len(places), len(shaped)))
    for column, (number, shape) in enumerate(shaped):
        for site in candidates[number].sites(shape):
            members[where[site], column] = 1.0
    return np.asarray(derivatives_by_sites(fit, places) @ members.tocsc())


# --- What is thought of each candidate beforehand ---------------------------------------------------------


LACKING_SOMETHING = 0.5
"""Prior probability that a model lacks an effect: an even question, which only the data answer."""


def log_priors(candidates: Sequence[Candidate]) -> FloatArray:
    """Logarithms of prior odds that it is this candidate that is missing, against nothing, shape (candidates,).

    Effects have equal odds, or those that they state; an effect's own are split evenly over its levels (everywhere, a
    class of nodes, one node; in all runs or in one), and over the places of a level.
    """
    weights = np.zeros(len(candidates))
    odds = {each.effect: each.effect.prior_odds for each in candidates}
    for effect in odds:
        own = [k for k, each in enumerate(candidates) if each.effect is effect]
        most = max(len(candidates[k].places) for k in own)
        levels = [(bool(candidates[k].run), _level(candidates[k], most)) for k in own]
        of_level = {level: candidates[k].prior_odds for k, level in zip(own, levels, strict=True)}  # one run is rarer
        for k, level in zip(own, levels, strict=True):
            weights[k] = odds[effect] * of_level[level] / sum(of_level.values()) / levels.count(level)
    return np.asarray(np.log(weights / sum(odds.values()) * LACKING_SOMETHING / (1 - LACKING_SOMETHING)))


def _level(candidate: Candidate, most: int) -> str:
    if len(candidate.places) == 1:
        return "one"
    return "all" if candidate.pattern == "*" or len(candidate.places) == most else "class"


# --- What the fitted parameters can't imitate, and what noise alone leaves -------------------------------------


def _regular(baseline: FloatArray) -> FloatArray:
    """The baseline's columns scaled to length one; empty ones left out."""
    length = np.linalg.norm(baseline, axis=0)
    kept = length > 0
    return np.asarray(baseline[:, kept] / length[kept])


def _projected(columns: FloatArray, basis: FloatArray) -> FloatArray:
    """What the fitted parameters can't imitate of columns, (rows,) or (rows, k)."""
    return np.asarray(columns - basis @ (basis.T @ columns))


def _simulated_noise(fit: Fit, rng: np.random.Generator) -> FloatArray:
    """Weighted residuals of a perfect model: white noise and rounding about the predicted readings, (rows, logs)."""
    problem, columns = fit.problem, []
    for bound, error in zip(problem.bound_runs, fit.residuals, strict=True):
        predicted = bound.measured + error
        for row, sigma in enumerate(problem.sigma):
            clean = predicted[row][bound.counted[row]][:, None]
            measured = clean + rng.normal(0.0, fit.noise.white[row] or 1e-12, (len(clean), _LOGS))
            step = fit.noise.step[row]
            if step > 0:
                # The sensor's steps lie anywhere: a random phase makes the logs differ.
                phase = rng.uniform(0.0, step, _LOGS)
                measured = np.round((measured + phase) / step) * step - phase
            columns.append((clean - measured) / sigma)
    noise = np.vstack(columns)
    penalties = np.zeros((len(problem.residuals(fit.z)) - len(noise), _LOGS))  # without noise
    return np.vstack([noise, penalties])


def _largest_root_mean_square(fit: Fit, columns: FloatArray) -> FloatArray:
    """Of each weighted column at the node where it is largest [K], shape (k,)."""
    counts = np.array([bound.counted.sum(axis=1) for bound in fit.problem.bound_runs])  # (runs, nodes)
    squares = np.zeros((counts.shape[1], columns.shape[1]))
    first = 0
    for node, count in (pair for row in counts.tolist() for pair in enumerate(row)):
        squares[node] += (columns[first : first + count] ** 2).sum(axis=0)
        first += count
    sigma = fit.problem.sigma / np.sqrt(np.maximum(counts.sum(axis=0), 1))
    return np.asarray(np.max(np.sqrt(squares) * sigma[:, None], axis=0))


# --- Collinear candidates: those whose traces these data can't tell apart -------------------------


INDISTINGUISHABLE = 0.95
"""Correlation of traces from which on two candidates are called indistinguishable."""


@dataclass(frozen=True)
class Confusability:
    """Correlation of some candidates' traces, with what the fitted parameters could imitate projected out.

    Args:
        keys: effect and place of each candidate, the best first, shape (n,).
        matrix: absolute correlation of their traces, 1 for the same trace, shape (n, n).
    """

    keys: tuple[tuple[str, str], ...]
    matrix: FloatArray

    def indistinguishable(
        self, least: float = INDISTINGUISHABLE
    ) -> list[tuple[tuple[str, str], tuple[str, str], float]]:
        """Pairs of candidates whose traces correlate by at least `least`, the closest first."""
        rows, columns = np.triu_indices(len(self.keys), 1)
        pairs = [
            (self.keys[row], self.keys[column], float(self.matrix[row, column]))
            for row, column in zip(rows, columns, strict=True)
            if self.matrix[row, column] >= least
        ]
        return sorted(pairs, key=lambda pair: -pair[2])

    def groups(self, least: float = INDISTINGUISHABLE) -> list[tuple[tuple[str, str], ...]]:
        """Candidates linked by pairs with at least that correlation, two or more to a group, the best first."""
        count, labels = connected_components(self.matrix >= least, directed=False) if self.keys else (0, np.zeros(0))
        members = [tuple(self.keys[row] for row in np.flatnonzero(labels == label)) for label in range(count)]
        return [group for group in members if len(group) > 1]


def confusability(scores: Scores, most: int = COMPARED) -> Confusability:
    """The best candidates against each other.

    Args:
        scores: of a diagnosis.
        most: how many candidates to compare at most; those that score nothing leave no trace to compare.
    """
    chosen = [each for each in scores.ranked if each.gain > 0 and each.direction.any()][:most]
    keys = tuple(each.candidate.key for each in chosen)
    if not chosen:
        return Confusability(keys, np.zeros((0, 0)))
    traces = np.array([each.direction / np.linalg.norm(each.direction) for each in chosen])
    return Confusability(keys, np.asarray(np.minimum(np.abs(traces @ traces.T), 1.0)))


# --- Power: the smallest size of each effect that these data would have shown ---------------------


_POWER = 0.84  # standard deviations above the threshold at which four of five logs would show it (80 % power)


@dataclass(frozen=True)
class Detectable:
    """The smallest size of one effect at one place that these data would show, four times out of five.

    Args:
        effect: its key.
        at: its place.
        amplitude: the size, in the amplitude's unit.
        unit: of the amplitude.
        share: the size as a share of the typical one.
    """

    effect: str
    at: str
    amplitude: float
    unit: str
    share: float

    def as_json(self) -> dict[str, object]:
        """The size as other tools read it."""
        return {
            "effect": self.effect,
            "at": self.at,
            "smallest": self.amplitude,
            "unit": self.unit,
            "share_of_typical": self.share,
        }


def smallest(scores: Scores) -> list[Detectable]:
    """For each candidate that was scored the size that would have been noticed, the easiest to see first.

    To first order, at the place's best shape: the size at which its odds against nothing being missing are even, and
    by so much more as noise takes off in one log of five; and no less than what matters. What the fitted parameters
    imitate wholly is not listed, since no size of it would show.
    """
    sizes = []
    for score in scores.ranked:
        amplitude = score.candidate.effect.amplitude()
        if amplitude is not None and score.per_unit > 0 and score.precision > 0:
            effect, at = score.candidate.key
            typical = score.candidate.typical
            seen = typical**2 * score.precision
            needed = 0.5 * np.log1p(seen) - score.log_prior  # log Bayes factor of even odds
            even = float(np.sqrt(2.0 * needed * (1.0 + 1.0 / seen) / score.precision))
            size = even + _POWER / float(np.sqrt(score.precision))
            if score.reach > 0:  # what leaves less is not worth a name
                size = max(size, abs(score.amplitude) * NEGLIGIBLE / score.reach)
            sizes.append(Detectable(effect, at, size, amplitude.unit, size / typical))
    return sorted(sizes, key=lambda each: each.share)
