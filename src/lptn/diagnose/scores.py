"""The score test: how much each candidate would lower the misfit, to first order, at the fitted baseline.

All sites are switched off in one model with every candidate in it, which equals the baseline to the last bit. The
derivative of its readings by a site's amplitude, with everything that the fitted parameters could imitate projected
out, is the trace that the candidate would leave on the residuals; how much of the residuals lies along that trace is
its score (Lagrange-multiplier test). One pass of sensitivities scores the whole catalogue, without any refit.

Then: which candidates these data can't tell apart, and what size of each they would have shown.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray, IntArray
from lptn.basics.processes import one_blas_thread
from lptn.diagnose.candidates import Candidate, Site, sites
from lptn.diagnose.fit_statistics import LACKING, NEGLIGIBLE, POWER, NoiseLevel, block_numbers, lack_of_fit
from lptn.identify.fitting import Fit
from lptn.identify.problem import rows_of_readings
from lptn.model.model import Model
from lptn.simulate.bound_run import bind, start_from
from lptn.simulate.simulation import sensitivity_windows

_LOGS = 200  # simulated for the distribution by chance: p-values down to 0.005
_IMITATED = 1e-6
"""Share of a trace's length left after projection, below which the fitted parameters imitate it wholly: the length is
a difference of squares, of which double precision leaves no digit at 1e-8."""
_COMPARED = 12  # of the best candidates, whose traces are held against each other
_BLOCK = 2**26  # numbers, half a gigabyte: columns of sites in memory at once
_TOGETHER = 32  # traces multiplied at once


@dataclass(frozen=True)
class Score:
    """One candidate, scored.

    Args:
        candidate: effect and place.
        gain: by how much adding it would lower the sum of squared weighted residuals, to first order.
        amplitude: its size to first order, in the amplitude's unit.
        shape: the shape of the grid that scores best.
        per_unit: length of the trace of a unit amplitude, 0 where the fitted parameters imitate it wholly.
    """

    candidate: Candidate
    gain: float
    amplitude: float
    shape: float | None
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
        confusability: of the best few, those that score nothing left out.
    """

    ranked: list[Score]
    null_gains: FloatArray
    noise: NoiseLevel
    lack_of_fit: dict[str, float]
    negligible: float
    confusability: Confusability

    @property
    def threshold(self) -> float:
        """The gain that chance exceeds once in twenty logs, and that matters."""
        beyond = float(np.quantile(self.null_gains, 0.95)) if self.null_gains.size else 0.0
        return max(beyond, self.negligible)

    @property
    def is_lacking(self) -> bool:
        """Whether some node's readings are met worse than noise would leave them."""
        return any(value > LACKING for value in self.lack_of_fit.values())

    def p_value(self, gain: float) -> float:
        """How often chance alone reaches a gain, over all candidates; 1 for a gain too small to matter."""
        if gain < self.negligible:
            return 1.0
        return float((1 + np.sum(self.null_gains >= gain)) / (1 + len(self.null_gains)))


@one_blas_thread
def score(fit: Fit, candidates: Sequence[Candidate]) -> Scores:
    """Score every candidate against the residuals of a fit.

    Memory is bounded: beyond `_BLOCK` numbers the traces are made twice, a block at a time, and never held together.

    Args:
        fit: the fitted baseline.
        candidates: effects and places.
    """
    rng = np.random.default_rng(0)  # of the simulated logs
    residuals = fit.problem.residuals(fit.z)
    basis = _imitable(fit, residuals)
    residuals -= basis @ (basis.T @ residuals)
    noise = _simulated_noise(fit, rng)
    noise -= basis @ (basis.T @ noise)
    level = NoiseLevel.of(fit, noise)
    traces = _Traces(fit, candidates, basis)

    # Chance is the worse of two models of it: the sensors' noise alone, and what else the residuals hold at random.
    scores, by_noise = {candidate: Score(candidate, 0.0, 0.0, None, 0.0) for candidate in candidates}, np.zeros(_LOGS)
    best, best_trace = 0.0, np.zeros_like(residuals)
    for group in traces:
        for number, (trace, statistic) in enumerate(zip(group.traces, -(group.rows @ residuals), strict=True)):
            scores[trace.candidate] = scored = _better(scores[trace.candidate], trace, float(statistic))
            if scored.gain > best:
                best, best_trace = scored.gain, group.projected(number, basis)
        by_noise = np.maximum(by_noise, group.largest_gains(-(group.rows @ noise)))
    del noise
    ranked = sorted(scores.values(), key=lambda entry: -entry.gain)

    compared = {
        (entry.candidate, entry.shape): place for place, entry in enumerate(ranked[:_COMPARED]) if entry.gain > 0
    }
    compared_traces = np.zeros((len(compared), len(residuals)))
    resampling = _WildBootstrap(fit, residuals - best_trace * (best_trace @ residuals), basis, rng)
    by_resampling = np.zeros(_LOGS)
    for group in traces:
        for number, trace in enumerate(group.traces):
            if (trace.candidate, trace.shape) in compared:
                compared_traces[compared[trace.candidate, trace.shape]] = group.projected(number, basis)
        by_resampling = np.maximum(by_resampling, group.largest_gains(resampling.statistics(group)))
    null_gains = np.maximum(np.sort(by_noise), np.sort(by_resampling))
    confusable = Confusability.of([candidate.key for candidate, _ in compared], compared_traces)
    return Scores(ranked, null_gains, level, lack_of_fit(fit, level), _negligible_gain(fit), confusable)


def derivatives(fit: Fit, places: Sequence[Site]) -> FloatArray:
    """Weighted derivatives of the residuals by the sites' amplitudes, shape (rows, places), stored by columns."""
    problem, network = fit.problem, fit.model.network
    full = Model(network.with_effects(site.declaration() for site in places))
    index = {parameter.name: number for number, parameter in enumerate(full.parameters)}
    amplitudes = [index[site.amplitude_name] for site in places]
    core = len(fit.model.states)  # effects are added behind the network's own, and so are their states
    # By columns, as candidates sum them up; the penalties' rows stay zero, for no site enters them.
    by_site = np.zeros((problem.rows, len(places)), order="F")
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
    return by_site


def pushed_beyond_bounds(fit: Fit, gradient: FloatArray) -> BoolArray:
    """Which unknowns are pushed beyond bounds that hold, shape (size,): they can't follow what a candidate would do.

    So are an effect where it vanishes (no friction cools a joint in place of air that is cooler than the log says), and
    a whole share. (Other parameters at a bound could follow, if it were moved: it is a user's guess.)
    """
    problem, holds = fit.problem, np.zeros((2, len(fit.z)), dtype=bool)
    for row, index in enumerate(problem.free):
        own = fit.model.parameters[index].declared
        for side, end in enumerate(own.bounds):
            holds[side, row] = end in own.ends_by_nature
    below, above = problem.at_bounds(fit.z)
    return np.asarray((holds[0] & below & (gradient > 0)) | (holds[1] & above & (gradient < 0)))


# --- Traces: what a candidate would leave on the residuals that the fitted parameters can't imitate ---------


def _imitable(fit: Fit, residuals: FloatArray) -> FloatArray:
    """What the fitted parameters can imitate, as orthonormal columns, shape (rows, k)."""
    _, baseline = fit.problem.jacobian(fit.z)
    length = np.linalg.norm(baseline, axis=0)
    kept = ~pushed_beyond_bounds(fit, baseline.T @ residuals) & (length > 0)
    columns, triangle = np.linalg.qr(baseline[:, kept] / length[kept])
    # Where the data leave a combination of parameters free, as the scale of all heat, the last columns are rounding.
    axes, spans, _ = np.linalg.svd(triangle)
    return np.asarray(columns @ axes[:, spans > _ROUNDING * spans.max(initial=0.0)])


_ROUNDING = 1e-8
"""Of the longest direction: half of a double's digits, so that what is shorter is what derivatives are rounded by."""
_Wanted = tuple[Candidate, float | None, IntArray]
"""A candidate, a shape of its grid, and the numbers of its sites there."""


class _Trace(NamedTuple):
    """A candidate's trace at one shape of its grid, and its length for a unit amplitude, after projection."""

    candidate: Candidate
    shape: float | None
    length: float


@dataclass(frozen=True)
class _Group:
    """Some traces, scaled to length 1 after projection.

    Args:
        traces: which.
        rows: they themselves, not projected, shape (traces, rows).
        imitated: how much of each column of the basis is in them, shape (traces, k).
    """

    traces: list[_Trace]
    rows: FloatArray
    imitated: FloatArray

    def projected(self, number: int, basis: FloatArray) -> FloatArray:
        """One of them, shape (rows,)."""
        return np.asarray(self.rows[number] - basis @ self.imitated[number])

    def largest_gains(self, statistics: FloatArray) -> FloatArray:
        """The largest gain of any of them in each simulated log, shape (logs,), from statistics (traces, logs)."""
        lengths = np.array([trace.length for trace in self.traces])[:, None]
        lower, upper = np.array([trace.candidate.room for trace in self.traces]).reshape(-1, 2).T[:, :, None]
        gains, _ = _gains(statistics, lengths, lower, upper)
        return np.asarray(np.max(gains, axis=0, initial=0.0))


_Numbers = FloatArray | float


def _gains(statistics: _Numbers, lengths: _Numbers, lower: _Numbers, upper: _Numbers) -> tuple[FloatArray, FloatArray]:
    """What traces of these lengths gain, and the amplitudes, which go no farther than they may."""
    amplitudes = np.clip(np.asarray(statistics) / lengths, lower, upper)
    removed = lengths * amplitudes
    return np.asarray(removed * (2.0 * statistics - removed)), amplitudes


class _Traces:
    """The candidates' traces at each shape of their grids, in groups, as often as they are gone through.

    The columns of all sites stay in memory if they are few; else they are made a block at a time, each time anew. What
    the fitted parameters imitate of a column is taken off products with it, not off the column.
    """

    def __init__(self, fit: Fit, candidates: Sequence[Candidate], basis: FloatArray) -> None:
        self._fit, self._basis, self._places = fit, basis, sites(candidates)
        self._imitated = np.empty((basis.shape[1], len(self._places)))
        self._held: FloatArray | None = None
        where = {site: number for number, site in enumerate(self._places)}
        wanted = [
            (candidate, shape, np.array([where[site] for site in candidate.sites(shape)]))
            for candidate in candidates
            for shape in candidate.shapes
        ]
        self._single = [trace for trace in wanted if len(trace[2]) == 1]
        self._sums = [trace for trace in wanted if len(trace[2]) > 1]

    def __iter__(self) -> Iterator[_Group]:
        sums = np.zeros((len(self._sums), len(self._basis)))
        for first, columns in self._blocks():
            last = first + columns.shape[1]
            single = [trace for trace in self._single if first <= trace[2][0] < last]
            for some in _groups(len(single)):
                numbers = np.concatenate([members for _, _, members in single[some]])
                yield self._group(single[some], columns[:, numbers - first].T)
            for row, (_, _, members) in zip(sums, self._sums, strict=True):
                row += columns[:, members[(first <= members) & (members < last)] - first].sum(axis=1)
        for some in _groups(len(sums)):
            yield self._group(self._sums[some], sums[some])

    def _blocks(self) -> Iterator[tuple[int, FloatArray]]:
        """The number of a block's first site, and the sites' columns."""
        most = max(1, _BLOCK // len(self._basis))
        for first in range(0, len(self._places), most):
            if self._held is None:
                columns = derivatives(self._fit, self._places[first : first + most])
                self._imitated[:, first : first + most] = self._basis.T @ columns
            else:
                columns = self._held
            if len(self._places) <= most:
                self._held = columns
            yield first, columns

    def _group(self, wanted: Sequence[_Wanted], rows: FloatArray) -> _Group:
        """Without those that the fitted parameters imitate wholly."""
        imitated = np.array([self._imitated[:, members].sum(axis=1) for _, _, members in wanted])
        whole = np.linalg.norm(rows, axis=1)
        squares = whole**2 - np.linalg.norm(imitated, axis=1) ** 2
        left = np.flatnonzero(squares > (_IMITATED * whole) ** 2)
        lengths = np.sqrt(squares[left])
        traces = [
            _Trace(wanted[int(k)][0], wanted[int(k)][1], length)
            for k, length in zip(left, lengths.tolist(), strict=True)
        ]
        return _Group(traces, rows[left] / lengths[:, None], imitated[left] / lengths[:, None])


def _groups(count: int) -> list[slice]:
    return [slice(first, first + _TOGETHER) for first in range(0, count, _TOGETHER)]


def _better(before: Score, trace: _Trace, statistic: float) -> Score:
    """A candidate's score with one more shape: the better one; the longest trace of all shapes."""
    per_unit = max(before.per_unit, trace.length)
    gain, amplitude = map(float, _gains(statistic, trace.length, *trace.candidate.room))
    if gain <= before.gain:
        return replace(before, per_unit=per_unit) if before.gain == 0 else before
    return Score(trace.candidate, gain, amplitude, trace.shape, trace.length)


# --- What chance alone would score --------------------------------------------------------------------------


def _simulated_noise(fit: Fit, rng: np.random.Generator) -> FloatArray:
    """Weighted residuals of a perfect model, (rows, logs).

    White noise and rounding about the predicted readings; of what has a prior a true value that is drawn from it.
    """
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
    others = np.zeros((problem.rows - len(noise), _LOGS))  # penalties on starts and mirrors are without noise
    drawn = np.vstack([noise, others])
    of_priors = drawn[problem.rows_of_priors]
    of_priors += problem.weight_of_priors * rng.standard_normal(of_priors.shape)
    return drawn


class _WildBootstrap:
    """The residuals with random signs, one for each ten-minute block of each run.

    It keeps what residuals have beside the sensors' noise: loads that the log does not hold to the last per cent
    leave errors for minutes, which all nodes of a block share.

    Source: [Wu1986]; blocks after [Shao2010].
    """

    def __init__(self, fit: Fit, residuals: FloatArray, basis: FloatArray, rng: np.random.Generator) -> None:
        drawn, numbers, count = [], [], 0
        for bound in fit.problem.bound_runs:
            own = block_numbers(bound)
            numbers += [count + own[counted] for counted in bound.counted]
            count += int(own[-1]) + 1
            drawn.append(rng.choice((-1.0, 1.0), (int(own[-1]) + 1, _LOGS)))
        block_of: IntArray = np.concatenate(numbers)
        self._firsts = np.flatnonzero(np.diff(block_of, prepend=-1))  # of each node's rows in each block
        self._signs = np.vstack(drawn)[block_of[self._firsts]]
        self._residuals = residuals[: len(block_of)]  # the rest are penalties
        self._imitated = self._along(basis.T)

    def statistics(self, group: _Group) -> FloatArray:
        """How much of each log lies against each trace, shape (traces, logs)."""
        return group.imitated @ self._imitated - self._along(group.rows)

    def _along(self, rows: FloatArray) -> FloatArray:
        """Products of each row with the residuals of each log, shape (rows, logs): sums over blocks, then signs."""
        products = rows[:, : len(self._residuals)] * self._residuals
        return np.asarray(np.add.reduceat(products, self._firsts, axis=1) @ self._signs)


def _negligible_gain(fit: Fit) -> float:
    """The gain of removing a negligible error at the node where it counts least."""
    readings = np.sum([bound.counted.sum(axis=1) for bound in fit.problem.bound_runs], axis=0)
    gains = readings * (NEGLIGIBLE / fit.problem.sigma) ** 2
    return float(gains[readings > 0].min(initial=np.inf))


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

    @classmethod
    def of(cls, keys: Sequence[tuple[str, str]], traces: FloatArray) -> Confusability:
        """From the traces, each of length 1, shape (n, rows)."""
        return cls(tuple(keys), np.asarray(np.minimum(np.abs(traces @ traces.T), 1.0)))

    def groups(self, least: float = INDISTINGUISHABLE) -> list[tuple[tuple[str, str], ...]]:
        """Candidates linked by pairs with at least that correlation, two or more to a group, the best first."""
        from scipy.sparse.csgraph import connected_components  # heavy, and few commands need it

        count, labels = connected_components(self.matrix >= least, directed=False) if self.keys else (0, np.zeros(0))
        members = [tuple(self.keys[row] for row in np.flatnonzero(labels == label)) for label in range(count)]
        return [group for group in members if len(group) > 1]


# --- Power: the smallest size of each effect that these data would have shown ---------------------


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
    needed = float(np.sqrt(scores.threshold)) + POWER * float(np.sqrt(np.median(scores.null_gains)))
    sizes = []
    for score in scores.ranked:
        if score.per_unit > 0:
            effect, at = score.candidate.key
            size = needed / score.per_unit
            sizes.append(Detectable(effect, at, size, score.candidate.amplitude.unit, size / score.candidate.typical))
    return sorted(sizes, key=lambda limit: limit.share)
