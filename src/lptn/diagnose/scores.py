"""How much each candidate would lower the misfit, which are collinear, and the least size that would show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components

from lptn.basics.arrays import FloatArray
from lptn.basics.processes import one_blas_thread
from lptn.diagnose.candidates import Candidate, Site, sites
from lptn.diagnose.lack_of_fit import NEGLIGIBLE, ByChance, lack_of_fit, stretches
from lptn.identify.fitting import Fit
from lptn.model.model import Model
from lptn.simulate.sensitivities import sensitivities
from lptn.simulate.simulation import bind, start_from

# --- How much each candidate would lower the misfit, from one pass of sensitivities at the fitted baseline ---
# All sites are switched off in one model with every candidate in it, which equals the baseline to the last bit. The
# derivative of its readings by a site's amplitude, with everything that the fitted parameters could imitate
# projected out, is what the candidate would leave on the residual. This is the score (Lagrange-multiplier) test.


_TRIALS = 200
Options = list[tuple[float | None, FloatArray, float, bool]]
"""For each shape: its value, the normalised direction, the projected column's length, whether one-sided."""
_FAINT = 1e-8  # of a column's length left after projection: the fitted parameters imitate it wholly


@dataclass(frozen=True)
class Score:
    """One candidate, scored.

    Args:
        candidate: effect and place.
        gain: by how much adding it would lower the sum of squared weighted residuals, to first order.
        amplitude: its size to first order, in the amplitude's unit.
        shape: the shape of the grid that scores best.
        direction: its trace on the residual, projected and normalised, shape (rows,).
        per_unit: length of the trace of a unit amplitude, 0 where the fitted parameters imitate it wholly.
    """

    candidate: Candidate
    gain: float
    amplitude: float
    shape: float | None
    direction: FloatArray
    per_unit: float


@dataclass(frozen=True)
class Scores:
    """All candidates, best first, and what chance alone would score.

    Args:
        ranked: the scores.
        chance: largest gain among all candidates in each simulated log without any missing effect.
        by_chance: what a perfect model would leave of each node's readings.
        lack: mean square of 60 s block means of each node's residuals, as a share of the most that chance leaves.
        negligible: the gain of an effect too small to matter, however far beyond chance.
    """

    ranked: list[Score]
    chance: FloatArray
    by_chance: ByChance
    lack: dict[str, float]
    negligible: float

    @property
    def threshold(self) -> float:
        """The gain that chance exceeds once in twenty logs, and that matters."""
        beyond = float(np.quantile(self.chance, 0.95)) if self.chance.size else 0.0
        return max(beyond, self.negligible)

    def p_value(self, gain: float) -> float:
        """How often chance alone reaches a gain, over all candidates; 1 for a gain too small to matter."""
        if gain < self.negligible:
            return 1.0
        return float((1 + np.sum(self.chance >= gain)) / (1 + len(self.chance)))


@one_blas_thread
def score(fit: Fit, found: Sequence[Candidate], seed: int = 0) -> Scores:
    """Score every candidate against the residuals of a fit.

    Args:
        fit: the fitted baseline.
        found: the candidates.
        seed: of the simulated logs.
    """
    places = sites(found)
    baseline, columns = _design(fit, places)
    basis = np.linalg.qr(_regular(baseline))[0]
    residual = _projected(fit.problem.residuals(fit.z), basis)
    projected = _projected(columns, basis)
    directions = _combine(found, places, projected, columns)
    ranked = [_score(candidate, options, residual) for candidate, options in zip(found, directions, strict=True)]
    ranked.sort(key=lambda each: -each.gain)
    rng = np.random.default_rng(seed)
    noise = _projected(_simulated_noise(fit, rng), basis)
    flipped = _projected(_flipped(fit, _beyond(residual, ranked), rng), basis)
    chance = np.maximum(np.sort(_chance(directions, noise)), np.sort(_chance(directions, flipped)))
    usual = ByChance.of(fit, noise)
    return Scores(ranked, chance, usual, lack_of_fit(fit, usual, residual), _negligible(fit))


def _design(fit: Fit, places: Sequence[Site]) -> tuple[FloatArray, FloatArray]:
    """Weighted derivatives of all readings that count: by the fit's unknowns, and by the sites' amplitudes."""
    problem = fit.problem
    _, baseline = problem.jacobian(fit.z)
    full = Model(fit.model.network.with_effects(site.declaration() for site in places))
    index = {parameter.name: number for number, parameter in enumerate(full.parameters)}
    chosen = [index[site.amplitude_name] for site in places]
    core = len(fit.model.states)  # effects are added behind the network's own, and so are their states
    blocks = []
    for bound, start in zip(problem.bound_runs, fit.point.starts, strict=True):
        wide = bind(full, bound.run)
        states = start_from(full, wide, dict(zip(fit.model.states, start.tolist(), strict=True)))
        moved = sensitivities(full, wide, full.values, chosen, states, core=core)
        scale = 1.0 / np.repeat(problem.sigma, bound.counted.sum(axis=1))[:, None]
        blocks.append(moved.by_parameter[bound.counted] * scale)
    columns = np.vstack([*blocks, np.zeros((len(baseline) - sum(map(len, blocks)), len(places)))])
    return baseline, columns


def _regular(baseline: FloatArray) -> FloatArray:
    """The baseline's columns scaled to length one; empty ones left out."""
    length = np.linalg.norm(baseline, axis=0)
    kept = length > 0
    return np.asarray(baseline[:, kept] / length[kept])


def _projected(columns: FloatArray, basis: FloatArray) -> FloatArray:
    return np.asarray(columns - basis @ (basis.T @ columns))


def _combine(
    found: Sequence[Candidate], places: Sequence[Site], projected: FloatArray, columns: FloatArray
) -> list[Options]:
    """For each candidate its directions: the sum of its places' columns, at each shape."""
    where = {site: number for number, site in enumerate(places)}
    # A candidate's columns lie side by side in memory when the matrices are stored by columns.
    projected, columns = np.asfortranarray(projected), np.asfortranarray(columns)
    combined = []
    for candidate in found:
        amplitude = candidate.effect.amplitude()
        options: Options = []
        for value in candidate.shapes:
            members = [where[site] for site in candidate.sites(value)]
            column = projected[:, members].sum(axis=1)
            whole = float(np.linalg.norm(columns[:, members].sum(axis=1)))
            length = float(np.linalg.norm(column))
            if length > _FAINT * whole:
                one_sided = amplitude is not None and amplitude.bounds[0] == amplitude.off
                options.append((value, column / length, length, one_sided))
        combined.append(options)
    return combined


def _score(candidate: Candidate, options: Options, residual: FloatArray) -> Score:
    longest = max((length for _, _, length, _ in options), default=0.0)
    best = Score(candidate, 0.0, 0.0, None, np.zeros_like(residual), longest)
    for shape, direction, length, one_sided in options:
        statistic = -float(direction @ residual)  # what is too cold asks for more of it
        if one_sided and statistic < 0:
            continue
        if statistic**2 > best.gain:
            best = Score(candidate, statistic**2, statistic / length, shape, direction, length)
    return best


def _chance(directions: Sequence[Options], noise: FloatArray) -> FloatArray:
    """The largest gain over all candidates in each simulated log."""
    largest = np.zeros(noise.shape[1])
    flat = [(direction, one_sided) for options in directions for _, direction, _, one_sided in options]
    if not flat:
        return largest
    statistics = -np.array([direction for direction, _ in flat]) @ noise
    one_sided = np.array([side for _, side in flat])[:, None]
    return np.asarray(np.max(np.where(one_sided & (statistics < 0), 0.0, statistics) ** 2, axis=0))


def _simulated_noise(fit: Fit, rng: np.random.Generator) -> FloatArray:
    """Weighted residuals of a perfect model: white noise and rounding about the predicted readings, (rows, trials)."""
    problem, columns = fit.problem, []
    errors = problem.errors(fit.z)
    for bound, error in zip(problem.bound_runs, errors, strict=True):
        predicted = bound.measured + error
        for row, sigma in enumerate(problem.sigma):
            clean = predicted[row][bound.counted[row]][:, None]
            measured = clean + rng.normal(0.0, fit.noise.white[row] or 1e-12, (len(clean), _TRIALS))
            step = fit.noise.step[row]
            if step > 0:
                # The sensor's steps lie anywhere: a random phase makes the trials differ.
                phase = rng.uniform(0.0, step, _TRIALS)
                measured = np.round((measured + phase) / step) * step - phase
            columns.append((clean - measured) / sigma)
    noise = np.vstack(columns)
    # One matrix holds all runs in the order of the residuals; the priors' rows carry no noise.
    rows = len(problem.residuals(fit.z))
    return np.vstack([noise, np.zeros((rows - len(noise), _TRIALS))])


def _beyond(residual: FloatArray, ranked: Sequence[Score]) -> FloatArray:
    """What the best candidate leaves of the residual."""
    if not ranked:
        return residual
    direction = ranked[0].direction
    return np.asarray(residual - direction * (direction @ residual))


def _negligible(fit: Fit) -> float:
    """The gain of removing so little at the node where it counts least."""
    readings = np.sum([bound.counted.sum(axis=1) for bound in fit.problem.bound_runs], axis=0)
    gains = readings * (NEGLIGIBLE / fit.problem.sigma) ** 2
    return float(gains[readings > 0].min(initial=np.inf))


def _flipped(fit: Fit, residual: FloatArray, rng: np.random.Generator) -> FloatArray:
    """The residual with random signs, one for each stretch of each run, (rows, trials): the wild bootstrap.

    It keeps what residuals have beside the sensors' noise: loads that the log does not tell to the last per cent
    leave errors that last, and that all nodes of a stretch share.

    Source: [Wu1986]; stretches after [Shao2010].
    """
    signs = np.zeros((len(residual), _TRIALS))
    start = 0
    for bound in fit.problem.bound_runs:
        stretch = stretches(bound)
        drawn = rng.choice((-1.0, 1.0), (int(stretch[-1]) + 1, _TRIALS))
        for counted in bound.counted:
            rows = stretch[counted]
            signs[start : start + len(rows)] = drawn[rows]
            start += len(rows)
    return np.asarray(signs * residual[:, None])


# --- Which candidates leave the same trace on the data, so that these data can't tell them apart ---


ALIKE = 0.95
"""Correlation of traces from which two candidates are called alike."""


@dataclass(frozen=True)
class Confusability:
    """How alike the traces of some candidates are once the fitted parameters have imitated what they can.

    Args:
        keys: effect and place of each candidate, the best first, shape (n,).
        matrix: size of the correlation of their traces, 1 for the same trace, shape (n, n).
    """

    keys: tuple[tuple[str, str], ...]
    matrix: FloatArray

    def indistinguishable(self, least: float = ALIKE) -> list[tuple[tuple[str, str], tuple[str, str], float]]:
        """Pairs of candidates whose traces correlate by at least `least`, the most alike first."""
        rows, columns = np.triu_indices(len(self.keys), 1)
        pairs = [
            (self.keys[row], self.keys[column], float(self.matrix[row, column]))
            for row, column in zip(rows, columns, strict=True)
            if self.matrix[row, column] >= least
        ]
        return sorted(pairs, key=lambda pair: -pair[2])

    def groups(self, least: float = ALIKE) -> list[tuple[tuple[str, str], ...]]:
        """Candidates that pairs of that likeness link, two or more to a group, the best first."""
        count, labels = connected_components(self.matrix >= least, directed=False) if self.keys else (0, np.zeros(0))
        members = [tuple(self.keys[row] for row in np.flatnonzero(labels == label)) for label in range(count)]
        return [group for group in members if len(group) > 1]


def confusability(scores: Scores, most: int = 12) -> Confusability:
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


# --- What these data could have shown at all: the smallest size of each effect that would have been noticed ---


_POWER = 0.84  # standard deviations above the threshold at which four of five logs would show it


@dataclass(frozen=True)
class Detectable:
    """The smallest size of one effect at one place that these data would reveal, four times out of five.

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

    To first order, at the place's best shape: a size larger than the threshold by what noise takes off in one log
    of five. What the fitted parameters imitate wholly is not listed, since no size of it would show.
    """
    needed = float(np.sqrt(scores.threshold)) + _POWER * float(np.sqrt(np.median(scores.chance)))
    found = []
    for score in scores.ranked:
        amplitude = score.candidate.effect.amplitude()
        if amplitude is not None and score.per_unit > 0:
            effect, at = score.candidate.key
            size = needed / score.per_unit
            found.append(Detectable(effect, at, size, amplitude.unit, size / abs(amplitude.typical)))
    return sorted(found, key=lambda each: each.share)
