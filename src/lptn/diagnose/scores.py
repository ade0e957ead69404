"""The score test: how much each candidate would lower the misfit, to first order, at the fitted baseline.

All sites are switched off in one model with every candidate in it, which equals the baseline to the last bit. The
derivative of its readings by a site's amplitude, with everything that the fitted parameters could imitate projected
out, is the trace that the candidate would leave on the residuals; how much of the residuals lies along that trace is
its score (Lagrange-multiplier test). One pass of sensitivities scores the whole catalogue, without any refit.

Then: which candidates these data can't tell apart, and what size of each they would have shown.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.processes import one_blas_thread
from lptn.diagnose.candidates import Candidate, Site, sites
from lptn.diagnose.fit_statistics import NEGLIGIBLE, NoiseLevel, block_numbers, lack_of_fit
from lptn.identify.fitting import Fit
from lptn.identify.problem import rows_of_readings
from lptn.model.model import Model
from lptn.simulate.bound_run import bind, start_from
from lptn.simulate.simulation import sensitivity_windows

_TOGETHER = 32  # traces multiplied at once
_LOGS = 200  # simulated for the distribution by chance: p-values down to 0.005
_AT_BOUND = 1e-4  # in the search's coordinates
_IMITATED = 1e-8  # share of a trace's length left after projection: the fitted parameters imitate it wholly


@dataclass(frozen=True)
class Score:
    """One candidate, scored.

    Args:
        candidate: effect and place.
        gain: by how much adding it would lower the sum of squared weighted residuals, to first order.
        amplitude: its size to first order, in the amplitude's unit.
        shape: the shape of the grid that scores best.
        direction: its trace on the residuals, projected and normalised, shape (rows,).
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
        null_gains: largest gain among all candidates in each simulated log without any missing effect, sorted.
        noise: what a perfect model would leave of each node's readings.
        lack_of_fit: of each node: mean square of its one-minute means over the most that noise leaves.
        negligible: the gain of an effect too small to matter, however far beyond chance.
    """

    ranked: list[Score]
    null_gains: FloatArray
    noise: NoiseLevel
    lack_of_fit: dict[str, float]
    negligible: float

    @property
    def threshold(self) -> float:
        """The gain that chance exceeds once in twenty logs, and that matters."""
        beyond = float(np.quantile(self.null_gains, 0.95)) if self.null_gains.size else 0.0
        return max(beyond, self.negligible)

    def p_value(self, gain: float) -> float:
        """How often chance alone reaches a gain, over all candidates; 1 for a gain too small to matter."""
        if gain < self.negligible:
            return 1.0
        return float((1 + np.sum(self.null_gains >= gain)) / (1 + len(self.null_gains)))


@one_blas_thread
def score(fit: Fit, candidates: Sequence[Candidate], seed: int = 0) -> Scores:
    """Score every candidate against the residuals of a fit.

    Args:
        fit: the fitted baseline.
        candidates: effects and places.
        seed: of the simulated logs.
    """
    places = sites(candidates)
    baseline, by_site = derivatives(fit, places)
    residuals = fit.problem.residuals(fit.z)
    basis = np.linalg.qr(_regular(baseline[:, ~granted_no_more(fit, baseline.T @ residuals)]))[0]
    residuals = _projected(residuals, basis)
    directions = _directions(candidates, places, by_site, _projected(by_site, basis))
    del baseline, by_site  # as large as all traces together, like each of the two sets of logs below
    ranked = [_score(candidate, own, residuals) for candidate, own in zip(candidates, directions, strict=True)]
    ranked.sort(key=lambda each: -each.gain)
    # Chance is the worse of two models of it: the sensors' noise alone, and what else the residuals hold at random.
    rng = np.random.default_rng(seed)
    noise = _projected(_simulated_noise(fit, rng), basis)
    level, by_noise = NoiseLevel.of(fit, noise), np.sort(_largest_gains(directions, noise))
    del noise
    resampled = _projected(_wild_bootstrap(fit, _less_the_best(residuals, ranked), rng), basis)
    null_gains = np.maximum(by_noise, np.sort(_largest_gains(directions, resampled)))
    return Scores(ranked, null_gains, level, lack_of_fit(fit, level, residuals), _negligible_gain(fit))


def derivatives(fit: Fit, places: Sequence[Site]) -> tuple[FloatArray, FloatArray]:
    """Weighted derivatives of the residuals: by the fit's unknowns, and by the sites' amplitudes."""
    problem = fit.problem
    _, baseline = problem.jacobian(fit.z)
    full = Model(fit.model.network.with_effects(site.declaration() for site in places))
    index = {parameter.name: number for number, parameter in enumerate(full.parameters)}
    amplitudes = [index[site.amplitude_name] for site in places]
    core = len(fit.model.states)  # effects are added behind the network's own, and so are their states
    # By columns, as candidates sum them up; the penalties' rows stay zero, for no site enters them.
    by_site = np.zeros((len(baseline), len(places)), order="F")
    first = 0
    for bound, start in zip(problem.bound_runs, fit.point.starts, strict=True):
        wide = bind(full, bound.run)
        states = start_from(full, wide, dict(zip(fit.model.states, start.tolist(), strict=True)))
        row_of = rows_of_readings(bound) + first
        for window, moved in sensitivity_windows(full, wide, full.values, amplitudes, states, core):
            counted = bound.counted[:, window]
            scale = 1.0 / np.repeat(problem.sigma, counted.sum(axis=1))[:, None]
            by_site[row_of[:, window][counted]] = moved.by_parameter[counted] * scale
        first += int(bound.counted.sum())
    return baseline, by_site


def granted_no_more(fit: Fit, gradient: FloatArray) -> BoolArray:
    """Which unknowns are errors of a run that are pushed beyond what is granted, shape (size,).

    They can't follow what a candidate would do. (Parameters of the model itself at a bound could, if it were moved.)
    """
    lower, upper = fit.problem.bounds()
    granted = np.zeros(len(fit.z), dtype=bool)
    parameters = fit.model.parameters
    granted[: len(fit.problem.free)] = [parameters[k].declared.prior is not None for k in fit.problem.free]
    below, above = fit.z - lower < _AT_BOUND, upper - fit.z < _AT_BOUND
    return np.asarray(granted & ((below & (gradient > 0)) | (above & (gradient < 0))))


def _regular(baseline: FloatArray) -> FloatArray:
    """The baseline's columns scaled to length one; empty ones left out."""
    length = np.linalg.norm(baseline, axis=0)
    kept = length > 0
    return np.asarray(baseline[:, kept] / length[kept])


def _projected(columns: FloatArray, basis: FloatArray) -> FloatArray:
    """What the fitted parameters can't imitate of columns, (rows,) or (rows, k)."""
    return np.asarray(columns - basis @ (basis.T @ columns))


class _Direction(NamedTuple):
    """A candidate's projected trace at one shape, of length 1; the length of a unit amplitude's; whether one-sided."""

    shape: float | None
    trace: FloatArray
    length: float
    one_sided: bool


def _directions(
    candidates: Sequence[Candidate], places: Sequence[Site], by_site: FloatArray, projected: FloatArray
) -> list[list[_Direction]]:
    """For each candidate the sum of its places' columns, at each shape of its grid."""
    where = {site: number for number, site in enumerate(places)}
    # A candidate's columns lie side by side in memory when the matrices are stored by columns.
    projected, by_site = np.asfortranarray(projected), np.asfortranarray(by_site)
    directions = []
    for candidate in candidates:
        own = []
        for shape in candidate.shapes:
            members = [where[site] for site in candidate.sites(shape)]
            trace = projected[:, members].sum(axis=1)
            whole = float(np.linalg.norm(by_site[:, members].sum(axis=1)))
            length = float(np.linalg.norm(trace))
            if length > _IMITATED * whole:
                own.append(_Direction(shape, trace / length, length, candidate.one_sided))
        directions.append(own)
    return directions


def _score(candidate: Candidate, directions: Sequence[_Direction], residuals: FloatArray) -> Score:
    longest = max((each.length for each in directions), default=0.0)
    best = Score(candidate, 0.0, 0.0, None, np.zeros_like(residuals), longest)
    for shape, trace, length, one_sided in directions:
        statistic = -float(trace @ residuals)  # predicted too low along the trace: more of the effect is wanted
        if one_sided and statistic < 0:
            continue
        if statistic**2 > best.gain:
            best = Score(candidate, statistic**2, statistic / length, shape, trace, length)
    return best


def _largest_gains(directions: Sequence[Sequence[_Direction]], residuals: FloatArray) -> FloatArray:
    """The largest gain over all candidates in each simulated log, shape (logs,), of residuals (rows, logs)."""
    flat = [each for own in directions for each in own]
    if not flat:
        return np.zeros(residuals.shape[1])
    # All traces in one matrix would be a second copy of what takes most memory.
    groups = (flat[first : first + _TOGETHER] for first in range(0, len(flat), _TOGETHER))
    statistics = -np.vstack([np.array([each.trace for each in group]) @ residuals for group in groups])
    one_sided = np.array([each.one_sided for each in flat])[:, None]
    return np.asarray(np.max(np.where(one_sided & (statistics < 0), 0.0, statistics) ** 2, axis=0))


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


def _less_the_best(residuals: FloatArray, ranked: Sequence[Score]) -> FloatArray:
    """What the best candidate leaves of the residuals."""
    if not ranked:
        return residuals
    direction = ranked[0].direction
    return np.asarray(residuals - direction * (direction @ residuals))


def _wild_bootstrap(fit: Fit, residuals: FloatArray, rng: np.random.Generator) -> FloatArray:
    """The residuals with random signs, one for each ten-minute block of each run, (rows, logs).

    It keeps what residuals have beside the sensors' noise: loads that the log does not hold to the last per cent
    leave errors for minutes, which all nodes of a block share.

    Source: [Wu1986]; blocks after [Shao2010].
    """
    signs = np.zeros((len(residuals), _LOGS))
    start = 0
    for bound in fit.problem.bound_runs:
        numbers = block_numbers(bound)
        drawn = rng.choice((-1.0, 1.0), (int(numbers[-1]) + 1, _LOGS))
        for counted in bound.counted:
            rows = numbers[counted]
            signs[start : start + len(rows)] = drawn[rows]
            start += len(rows)
    return np.asarray(signs * residuals[:, None])


def _negligible_gain(fit: Fit) -> float:
    """The gain of removing a negligible error at the node where it counts least."""
    readings = np.sum([bound.counted.sum(axis=1) for bound in fit.problem.bound_runs], axis=0)
    gains = readings * (NEGLIGIBLE / fit.problem.sigma) ** 2
    return float(gains[readings > 0].min(initial=np.inf))


def linearised(fit: Fit, score: Score) -> list[FloatArray]:
    """What the readings of the fitted runs would be with a candidate added and all else refitted, to first order.

    The candidate moves them along its trace, with what the fitted parameters take back of it, by its first-order size.

    Args:
        fit: the baseline that was scored.
        score: of the candidate.

    Returns:
        Predicted readings [degC] of each run, shape (nodes, n), NaN where nothing was measured.
    """
    moved = score.direction * np.sign(score.amplitude) * np.sqrt(score.gain)
    predicted, first = [], 0
    for bound, error in zip(fit.problem.bound_runs, fit.residuals, strict=True):
        readings = np.where(bound.counted, bound.measured + error, np.nan)
        rows = rows_of_readings(bound) + first
        readings += np.where(bound.counted, moved[rows] * fit.problem.sigma[:, None], 0.0)
        predicted.append(readings)
        first += int(bound.counted.sum())
    return predicted


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
        from scipy.sparse.csgraph import connected_components  # heavy, and few commands need it

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

    To first order, at the place's best shape: a size larger than the threshold by what noise takes off in one log
    of five. What the fitted parameters imitate wholly is not listed, since no size of it would show.
    """
    needed = float(np.sqrt(scores.threshold)) + _POWER * float(np.sqrt(np.median(scores.null_gains)))
    sizes = []
    for score in scores.ranked:
        amplitude = score.candidate.effect.amplitude()
        if amplitude is not None and score.per_unit > 0:
            effect, at = score.candidate.key
            size = needed / score.per_unit
            sizes.append(Detectable(effect, at, size, amplitude.unit, size / score.candidate.typical))
    return sorted(sizes, key=lambda each: each.share)
