r"""The evidence for a model and for each effect that it may lack: one likelihood, with priors that are physics.

The error of a free-running prediction is taken apart into what is known to be in it,

.. math:: y - \hat y(u_0) = U\,(u - u_0) + N n + G a + d + e

* :math:`u`: the model's free parameters, in the coordinates of the fit, and the initial temperatures of each run;
* :math:`n`: what every log has wrong by itself: the scale of its losses and its ambient sensor, run by run;
* :math:`a`: amplitudes of effects that the model lacks, zero for those that are not there;
* :math:`d`: the *discrepancy*, what neither of these explains: at each node an Ornstein-Uhlenbeck process, which is
  what a random heat flow into a node leaves of its temperature. Its size and time constant are unknown and summed
  over, and size zero has half of the probability: then the model is enough;
* :math:`e`: noise of the sensors, white, and their steps, which stay for as long as a temperature needs to cross one.

All of it is linear and Gaussian at a fitted point, so that the probability of the readings, with everything unknown
integrated out, is a closed form (Laplace's approximation [MacKay2003, ch. 27]). A slow misfit counts little where a
discrepancy that is as slow would do as well: it is that which keeps a wrong model from being certain of nonsense.

Source: [KennedyOHagan2001] (discrepancy); [Kristensen2004] (the process noise that a wrong equation needs);
[MacKay2003, ch. 28] (evidence, Occam factors).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr, logsumexp

from lptn.basics.arrays import FloatArray, IntArray
from lptn.basics.parameters import ParameterInstance
from lptn.basics.processes import one_blas_thread
from lptn.diagnose.candidates import Candidate, Site, candidates, separate_runs, sites
from lptn.identify.comparison import Prediction
from lptn.identify.fitting import Fit
from lptn.identify.noise import Noise
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration
from lptn.simulate.bound_run import BoundRun, bind, start_from
from lptn.simulate.simulation import sensitivities

# --- The discrepancy: sizes and time constants that are summed over ------------------------------------------


SIZES = (0.0, 1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0)
"""Standard deviations of the discrepancy, as shares of what the model that was given misses at a node, noise apart [K].

A factor of two apart, which the data hardly resolve. What a fit leaves is the most that can be unexplained: without an
end the discrepancy would take slow errors over from parameters that a fit can hold well.
"""
_ELSEWHERE = (2.0, 4.0, 8.0, 16.0)  # times that a model may miss on runs that it was not fitted to
_ENOUGH = 0.5  # prior probability that the model is enough: size zero
_SHORTEST, _TIME_CONSTANTS = 60.0, 3  # s; below it a discrepancy is noise. So many, evenly spread up to the longest run


@dataclass(frozen=True)
class DiscrepancyLevel:
    """One size and time constant of the discrepancy.

    Args:
        size: standard deviation as a share of what the given model misses.
        time_constant: s.
        log_prior: logarithm of its prior probability.
    """

    size: float
    time_constant: float
    log_prior: float


def discrepancy_levels(step: float, duration: float, sizes: Sequence[float] = SIZES) -> list[DiscrepancyLevel]:
    """All levels, for means over `step` in runs up to `duration` long [s]; the first of `sizes` is zero."""
    shortest = max(_SHORTEST, 5 * step)  # means over a fifth of a time constant are as good as the process itself
    times = np.geomspace(shortest, max(duration, 2 * shortest), _TIME_CONSTANTS)
    present = np.log((1 - _ENOUGH) / ((len(sizes) - 1) * len(times)))
    levels = [DiscrepancyLevel(0.0, float(times[0]), float(np.log(_ENOUGH)))]
    return levels + [DiscrepancyLevel(size, float(time), float(present)) for size, time in product(sizes[1:], times)]


# --- Whitening: errors of a run that are as good as independent, by a Kalman filter for each node --------------


class Whitening:
    """Takes the correlation in time out of weighted residuals and of their derivatives.

    Args:
        bound_runs: the runs, with the readings that count; rows come run after run, node after node.
        sigma: what the residuals were divided by [K], shape (nodes,).
        noise: of the sensors.
        missed: what the sizes of the discrepancy are shares of [K], shape (nodes,).
        sizes: of the discrepancy, the first zero.
    """

    def __init__(
        self,
        bound_runs: Sequence[BoundRun],
        sigma: FloatArray,
        noise: Noise,
        missed: FloatArray,
        sizes: Sequence[float] = SIZES,
    ) -> None:
        self.rows = sum(int(bound.counted.sum()) for bound in bound_runs)
        step = float(np.median([bound.run.step for bound in bound_runs]))
        duration = max(len(bound) * bound.run.step for bound in bound_runs)
        block = max(_BLOCK, duration / _MOST_BLOCKS)
        self.levels = discrepancy_levels(max(step, block), duration, sizes)
        series, starts, first = [], [], 0
        for bound in bound_runs:
            for node, counted in enumerate(bound.counted):
                time = bound.run.time[counted]
                if time.size == 0:
                    continue
                begins = np.flatnonzero(np.diff(time // block, prepend=-np.inf))
                counts = np.diff(begins, append=time.size)
                coarse = float(noise.step[node])
                slow = _step_time(bound.measured[node][counted], time, coarse)
                white = float(noise.white[node]) * (1.0 + _UNSURE_NOISE / np.sqrt(time.size))
                white = max(white, _LEAST_NOISE * float(sigma[node])) / np.sqrt(counts)
                steps = coarse / np.sqrt(12.0) * _of_means(max(block, bound.run.step), slow)
                series.append((time[begins], white, (steps, slow, float(missed[node]))))
                starts.append(first + begins)
                first += time.size
        self._starts = np.concatenate(starts)  # the row at which each block begins
        self._counts = np.diff(self._starts, append=self.rows)
        self._sigma = np.concatenate([np.repeat(sigma, bound.counted.sum(axis=1)) for bound in bound_runs])
        longest = max(len(time) for time, *_ in series)
        self._there = np.zeros((longest, len(series)), dtype=bool)
        self._gap = np.zeros((longest, len(series)))  # s since the block before
        self._white = np.ones((longest, len(series)))  # K, of a block's mean
        for number, (time, white, _) in enumerate(series):
            self._there[: len(time), number] = True
            self._gap[1 : len(time), number] = np.diff(time)
            self._white[: len(time), number] = white
        self._coarse, self._step_time, self._missed = np.array([numbers for *_, numbers in series]).T

    def __call__(
        self, columns: FloatArray, among: Collection[DiscrepancyLevel] | None = None
    ) -> Iterator[tuple[DiscrepancyLevel, FloatArray, float]]:
        """Weighted columns (rows, k) as a white process with variance 1, at each level of the discrepancy.

        Args:
            columns: derivatives of the weighted residuals, and themselves.
            among: the levels that are wanted; all by default.

        Yields:
            The level; the columns, shape (longest · series, k), with rows of zeros where a series has ended; and half
            the logarithm of the covariance's determinant.
        """
        gains, spread, decay = self._filter
        chosen = [k for k, level in enumerate(self.levels) if among is None or level in among]
        means = np.add.reduceat(columns * self._sigma[:, None], self._starts) / self._counts[:, None]
        arranged = np.zeros((*self._there.shape, columns.shape[1]))
        arranged.transpose(1, 0, 2)[self._there.T] = means
        together = max(1, _MEMORY // max(arranged.nbytes, 1))  # levels that share a pass in time
        for first in range(0, len(chosen), together):
            part = chosen[first : first + together]
            white = np.empty((len(arranged), len(part), *arranged.shape[1:]))
            slow = np.zeros((2, *white.shape[1:]))  # discrepancy, and error of the sensor's steps
            for k in range(len(arranged)):
                slow *= decay[k][:, part, :, None]
                innovation = arranged[k] - slow[0] - slow[1]
                slow += gains[k][:, part, :, None] * innovation
                np.divide(innovation, spread[k][part, :, None], out=white[k])
            white *= self._there[:, None, :, None]
            for k, number in enumerate(part):
                determinant = float(np.log(spread[:, number][self._there]).sum())
                yield self.levels[number], white[:, k].reshape(-1, columns.shape[1]), determinant

    @cached_property
    def _filter(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Gains (longest, 2, levels, series), standard deviations of the innovations (longest, levels, series), decays.

        The state is the discrepancy and the error of the sensor's steps; decays are from the reading before.
        """
        sizes = np.array([level.size for level in self.levels])[:, None] * self._missed
        times = np.array([level.time_constant for level in self.levels])[:, None] + 0.0 * sizes
        variance = np.array([sizes**2, np.broadcast_to(self._coarse**2, sizes.shape)])
        decay = np.exp(-self._gap[:, None, None, :] / np.array([times, np.broadcast_to(self._step_time, sizes.shape)]))
        gains, spread = np.empty_like(decay), np.empty_like(decay[:, 0])
        own, cross = variance.copy(), np.zeros_like(sizes)
        for k in range(len(decay)):
            own = variance + decay[k] ** 2 * (own - variance)
            cross = decay[k, 0] * decay[k, 1] * cross
            seen = own + cross
            total = seen[0] + seen[1] + self._white[k] ** 2
            gains[k], spread[k] = seen / total, np.sqrt(total)
            cross = cross - seen[0] * seen[1] / total
            own = own - seen**2 / total
        return gains, spread, decay


_BLOCK, _MOST_BLOCKS = 10.0, 360  # s; the likelihood is that of means over so long, of longer ones in long runs
_MEMORY = 50_000_000  # bytes of columns that are whitened in one pass
_UNSURE_NOISE = 3.0  # two relative standard errors (1.5/√n) of noise that is estimated from the median of n differences
_LEAST_NOISE = 0.02  # share of the fit's own weight; a simulated log without noise must not weigh infinitely


def missed_by(fit: Fit) -> FloatArray:
    """Root mean square of what a fit leaves at each node, less its noise [K], shape (nodes,)."""
    missed = []
    for node, floor in enumerate(fit.noise.floor):
        pairs = zip(fit.residuals, fit.problem.bound_runs, strict=True)
        errors = np.concatenate([error[node][bound.counted[node]] for error, bound in pairs])
        square = float(np.mean(errors**2)) if errors.size else 0.0
        missed.append(max(square - float(floor) ** 2, (_LEAST_MISSED * float(floor)) ** 2))
    return np.asarray(np.sqrt(missed))


_LEAST_MISSED = 0.1  # share of a node's noise; less could not be told from nothing


def _step_time(readings: FloatArray, time: FloatArray, step: float) -> float:
    """Time constant of the error of a sensor's steps [s].

    While a temperature rises the error is a sawtooth, with the time that one step takes as its period T. Its
    autocorrelation begins as 1 − 6 t/T, as that of a process with the time constant T/6 does.
    """
    if step <= 0 or time.size < 2:
        return 1.0
    travelled = float(np.abs(np.diff(readings)).sum())
    return float((time[-1] - time[0]) / max(travelled / step, 1.0)) / 6.0


def _of_means(block: float, time_constant: float) -> float:
    """Standard deviation of an Ornstein-Uhlenbeck process's means over a block, as a share of the process's own."""
    ratio = block / time_constant
    return float(np.sqrt(2.0 * (ratio - 1.0 + np.exp(-ratio)) / ratio**2))


# --- Priors on what is free in every model ---------------------------------------------------------------------


_LOGARITHM = 1.0  # prior standard deviation of ln C and ln R about the fit: hand-made values are off by factors of 3
_SHAPE = 1.5  # the same for a time constant or an exponent of an effect that was added, about its usual value
_SHARE = 3.0  # of a parameter that may have either sign, in units of its typical size
_NODE_START, _HIDDEN_START = 10.0, 2.0  # K; of an initial temperature, and of a hidden mass's against its node's
AMPLITUDES = ((0.3, 0.2), (1.0, 0.4), (3.0, 0.3), (10.0, 0.1))
"""Standard deviation of an amplitude in units of its usual size, and the prior probability of that.

The usual size is meant to a factor of three either way; one that is ten times as large is rare, not excluded."""
IMPLAUSIBLE = 30.0
"""Times the usual size beyond which no amplitude is believed: three standard deviations of the widest prior."""


def prior_of(parameter: ParameterInstance, added: bool) -> float:
    """Prior standard deviation of a free parameter that is no amplitude, in the fit's coordinates."""
    declared = parameter.declared
    if declared.prior is not None:
        return declared.prior / (abs(declared.typical) or 1.0)
    if parameter.logarithmic or declared.bounds[0] == 0:
        return _SHAPE if added else _LOGARITHM
    return _SHARE


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


# --- Evidence ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Amplitude:
    """What is known beforehand of one amplitude.

    Args:
        usual: its usual size, in its unit.
        one_sided: whether it can't be negative.
        name: of the parameter in the model; empty for a candidate.
    """

    usual: float
    one_sided: bool
    name: str = ""


@dataclass(frozen=True)
class Level:
    """A likelihood at one level of the discrepancy, everything but the amplitudes integrated out.

    Args:
        level: of the discrepancy.
        log_evidence: of the readings with all amplitudes at zero, prior of the level included.
        precision: of the amplitudes, shape (m, m) or, for many that are alternatives, its diagonal (m,).
        towards: precision times the most likely amplitudes, shape (m,).
        unknowns: most likely unknowns minus their prior means without the amplitudes, shape (p,); empty for
            alternatives.
        by_amplitudes: how they change with the amplitudes, shape (p, m); empty for alternatives.
    """

    level: DiscrepancyLevel
    log_evidence: float
    precision: FloatArray
    towards: FloatArray
    unknowns: FloatArray
    by_amplitudes: FloatArray


def levels_of(
    whitening: Whitening,
    residuals: FloatArray,
    unknowns: FloatArray,
    prior: FloatArray,
    amplitudes: FloatArray,
    alternatives: bool = False,
    among: Collection[DiscrepancyLevel] | None = None,
) -> list[Level]:
    """Integrate everything but amplitudes out, at each level of the discrepancy.

    Args:
        whitening: of the readings.
        residuals: predicted − measured at the prior means of all unknowns, weighted, shape (rows,).
        unknowns: their derivatives by parameters, initial states and nuisances, shape (rows, p).
        prior: prior standard deviations of these, shape (p,).
        amplitudes: derivatives by the amplitudes, shape (rows, m).
        alternatives: whether one amplitude at a time is asked about; then only the diagonal of the precision is given.
        among: levels of the discrepancy that are wanted; all by default.
    """
    count = len(prior)
    levels = []
    columns = np.column_stack([residuals, unknowns * prior, amplitudes])
    for level, white, half_determinant in whitening(columns, among):
        error, free, moved = white[:, 0], white[:, 1 : count + 1], white[:, count + 1 :]
        root = np.linalg.cholesky(free.T @ free + np.eye(count))
        of_error = solve_triangular(root, free.T @ error, lower=True)
        of_moved = solve_triangular(root, free.T @ moved, lower=True)
        evidence = -0.5 * float(error @ error - of_error @ of_error)
        evidence -= half_determinant + float(np.log(np.diag(root)).sum())
        towards = -(moved.T @ error - of_moved.T @ of_error)
        if alternatives:
            precision = np.einsum("ij,ij->j", moved, moved) - np.einsum("ij,ij->j", of_moved, of_moved)
            solved = np.zeros((0, 1))
        else:
            precision = moved.T @ moved - of_moved.T @ of_moved
            solved = -prior[:, None] * solve_triangular(root.T, np.column_stack([of_error, of_moved]))
        levels.append(Level(level, evidence + level.log_prior, precision, towards, solved[:, 0], solved[:, 1:]))
    return levels


def log_bayes_factors(level: Level, amplitudes: Sequence[Amplitude]) -> FloatArray:
    """For each of many alternatives, by how much its amplitude raises the log evidence, shape (m,); `-inf` for none."""
    usual = np.array([each.usual for each in amplitudes])
    one_sided = np.array([each.one_sided for each in amplitudes], dtype=bool)
    terms = []
    for multiple, probability in AMPLITUDES:
        variance = (multiple * usual) ** 2
        gain = 1.0 + variance * np.maximum(level.precision, 0.0)
        term = 0.5 * level.towards**2 * variance / gain - 0.5 * np.log(gain)
        mean_over_sd = level.towards * np.sqrt(variance / gain)
        term += np.where(one_sided, np.log(2.0) + log_ndtr(mean_over_sd), 0.0)
        terms.append(term + np.log(probability))
    return np.asarray(logsumexp(terms, axis=0))


@dataclass(frozen=True)
class Together:
    """Amplitudes that are present together, at one level of the discrepancy.

    Args:
        log_evidence: of the readings with all of them, integrated out.
        means: of the amplitudes, in their units, shape (m,).
        deviations: their standard deviations, shape (m,).
        prior: standard deviations of the most probable prior of the mixture, shape (m,).
    """

    log_evidence: float
    means: FloatArray
    deviations: FloatArray
    prior: FloatArray


def together(level: Level, amplitudes: Sequence[Amplitude]) -> Together:
    """Evidence and amplitudes with all of them present, summed over the mixture of their priors."""
    if not amplitudes:
        return Together(level.log_evidence, np.zeros(0), np.zeros(0), np.zeros(0))
    one_sided = np.array([each.one_sided for each in amplitudes], dtype=bool)
    chosen = np.array(list(product(AMPLITUDES, repeat=len(amplitudes))))  # (combinations, m, multiple and probability)
    sd = chosen[:, :, 0] * np.array([each.usual for each in amplitudes])
    scaled = level.precision * sd[:, :, None] * sd[:, None, :] + np.eye(len(amplitudes))
    covariance = np.linalg.inv(scaled)
    towards = sd * level.towards
    mean = np.einsum("cij,cj->ci", covariance, towards)
    spread = np.sqrt(np.einsum("cii->ci", covariance))
    terms = 0.5 * np.einsum("ci,ci->c", towards, mean) - 0.5 * np.linalg.slogdet(scaled)[1]
    terms += np.where(one_sided, np.log(2.0) + log_ndtr(mean / spread), 0.0).sum(axis=1)
    terms += np.log(chosen[:, :, 1]).sum(axis=1)
    total = float(logsumexp(terms))
    weights = np.exp(terms - total)
    means = weights @ (sd * mean)
    squares = weights @ ((sd * spread) ** 2 + (sd * mean) ** 2)
    return Together(
        level.log_evidence + total,
        means,
        np.sqrt(np.maximum(squares - means**2, 0.0)),
        sd[int(weights.argmax())],
    )


# --- The likelihood of one set of runs: of any model of them, and of any effect that a model may lack ---------------


@dataclass(frozen=True)
class Evidence:
    """What the readings say for a model.

    Args:
        log_evidence: logarithm of their probability, all that is unknown integrated out; up to a constant of the data.
        sizes: probability of each of `SIZES` of the discrepancy.
        discrepancy: its standard deviation at the node where it is largest, K, in root mean square over `sizes`.
        amplitudes: mean and standard deviation of each added amplitude, by its parameter's name and in its unit, the
            discrepancy allowed for.
    """

    log_evidence: float
    sizes: tuple[float, ...]
    discrepancy: float
    amplitudes: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def enough(self) -> float:
        """Probability that nothing is left but noise."""
        return self.sizes[0]


class _Linearised(NamedTuple):
    """Readings linearised at a point.

    Args:
        residuals: weighted, shape (rows,).
        by_rest: their derivatives by all unknowns but the amplitudes, shape (rows, p).
        prior: prior standard deviations of these, shape (p,).
        offset: their prior means minus what they are, shape (p,).
        by_amplitudes: derivatives by the amplitudes, shape (rows, m).
        amplitudes: their values, shape (m,).
        known: what is known of these beforehand.
        rest: where the others stand among the problem's unknowns, shape (p,).
        columns: where the amplitudes stand there.
    """

    residuals: FloatArray
    by_rest: FloatArray
    prior: FloatArray
    offset: FloatArray
    by_amplitudes: FloatArray
    amplitudes: FloatArray
    known: list[Amplitude]
    rest: IntArray
    columns: list[int]


_LINEARISATIONS = 4  # at the fit, and at what is more probable than that while the steps gain something
_SHARES_OF_A_STEP = (1.0, 0.5, 0.25, 0.125)  # tried in turn, as far as the linearisation holds
_WORTH_A_STEP = 0.5  # of a log probability; less changes no answer


class Likelihood:
    """The likelihood of models of one set of runs.

    Args:
        given: a fit of the model that others extend: its values are the centre of the priors on what is free.
        columns: log columns at hand.
    """

    def __init__(self, given: Fit, columns: Collection[str]) -> None:
        self.given, self.columns = given, columns
        problem = given.problem
        self._missed = missed_by(given)
        self._whitening = Whitening(problem.bound_runs, problem.sigma, given.noise, self._missed)
        self._others: dict[tuple[object, ...], Whitening] = {}
        self._centre = dict(zip((p.name for p in given.model.parameters), given.point.values.tolist(), strict=True))
        self._nuisances, self._nuisance_prior = self._of_every_log()

    def _of_every_log(self) -> tuple[FloatArray, FloatArray]:
        """Derivatives by the nuisances of each run, shape (rows, q), and their standard deviations, shape (q,)."""
        runs = [bound.run.name for bound in self.given.problem.bound_runs]
        separate = separate_runs(runs) or [""]
        possible = possible_effects(self.given, self.columns)
        chosen = [
            each
            for each in possible
            if each.effect.in_every_log is not None
            and each.run in separate
            and not each.difference
            and (len(each.places) == 1 or each.effect.whole_robot)
        ]
        by_site = derivatives_by_sites(self.given, sites(chosen))
        number = {site: k for k, site in enumerate(sites(chosen))}
        summed = [by_site[:, [number[site] for site in each.sites(None)]].sum(axis=1) for each in chosen]
        prior = np.array([each.effect.in_every_log for each in chosen], dtype=float)
        return np.array(summed).reshape(len(chosen), len(by_site)).T, prior

    @one_blas_thread
    def of(self, fit: Fit, added: Sequence[EffectDeclaration] = ()) -> Evidence:
        """The evidence for a fitted model.

        Args:
            fit: of the given model with effects added, to the same readings.
            added: these effects.
        """
        z, nuisances = fit.z, np.zeros(len(self._nuisance_prior))
        for _ in range(_LINEARISATIONS):
            here = self._linearised(fit, z, added)
            unknowns = np.column_stack([here.by_rest, self._nuisances])
            prior = np.concatenate([here.prior, self._nuisance_prior])
            at_prior = here.residuals - here.by_amplitudes @ here.amplitudes + here.by_rest @ here.offset
            levels = levels_of(self._whitening, at_prior, unknowns, prior, here.by_amplitudes)
            evidence, best, added_here = self._evidence(levels, here.known)
            most_likely = best.unknowns + best.by_amplitudes @ added_here.means
            rest, others = np.split(most_likely, [len(here.offset)])
            lower = self._downhill(fit, (z, nuisances), here, (here.offset + rest, added_here, others), best)
            if lower is None:
                break
            z, nuisances = lower
        return evidence

    def _downhill(
        self,
        fit: Fit,
        at: tuple[FloatArray, FloatArray],
        here: _Linearised,
        step: tuple[FloatArray, Together, FloatArray],
        best: Level,
    ) -> tuple[FloatArray, FloatArray] | None:
        """A point that is more probable than the one of the linearisation, `None` if there is none worth going to.

        Args:
            fit: of the model.
            at: the problem's unknowns and the nuisances at the linearisation.
            here: the linearisation.
            step: from there to what is most probable by it: change of the rest, amplitudes, nuisances.
            best: the most probable level of the discrepancy.
        """
        problem, (z, nuisances), (rest, added, others) = fit.problem, at, step
        bounds = np.array([fit.model.parameters[index].declared.bounds for index in problem.free]).reshape(-1, 2)

        def minus_log_posterior(point: FloatArray, extra: FloatArray, offset: FloatArray, sizes: FloatArray) -> float:
            errors = problem.residuals(point)[: self._whitening.rows] + self._nuisances @ extra
            ((_, white, _),) = self._whitening(errors[:, None], [best.level])
            priors = (offset / here.prior, sizes / added.prior, extra / self._nuisance_prior)
            return 0.5 * float((white**2).sum() + sum((each**2).sum() for each in priors))

        now = minus_log_posterior(z, nuisances, here.offset, here.amplitudes)
        for share in _SHARES_OF_A_STEP:
            further = z.copy()
            further[here.rest] += share * rest
            values = problem.point(further).values
            sizes = here.amplitudes + share * (added.means - here.amplitudes)
            values[[problem.free[number] for number in here.columns]] = sizes
            values[problem.free] = np.clip(values[problem.free], *bounds.T)
            further[: len(problem.free)] = problem.guess(values)[: len(problem.free)]
            extra = nuisances + share * (others - nuisances)
            if not np.isfinite(problem.cost(further)):
                continue
            then = minus_log_posterior(further, extra, here.offset - share * rest, sizes)
            if then < now:
                return (further, extra) if now - then > _WORTH_A_STEP else None
        return None

    @one_blas_thread
    def of_predictions(self, predictions: Sequence[Prediction]) -> float:
        """Logarithm of the probability of readings that a model predicts, at its fitted values."""
        sigma, noise = self.given.problem.sigma, self.given.noise
        key = tuple((each.segment.run.name, each.segment.evaluation) for each in predictions)
        if key not in self._others:
            bound_runs = [each.bound for each in predictions]
            self._others[key] = Whitening(bound_runs, sigma, noise, self._missed, (*SIZES, *_ELSEWHERE))
        whitening = self._others[key]
        errors = [(each.error / sigma[:, None])[each.bound.counted] for each in predictions]
        nothing = np.zeros((whitening.rows, 0))
        levels = levels_of(whitening, np.concatenate(errors), nothing, np.zeros(0), nothing)
        return float(logsumexp([level.log_evidence for level in levels]))

    def _evidence(self, levels: Sequence[Level], known: Sequence[Amplitude]) -> tuple[Evidence, Level, Together]:
        """The evidence, the most probable level of the discrepancy, and the amplitudes at that."""
        with_all = [together(level, known) for level in levels]
        logs = np.array([each.log_evidence for each in with_all])
        total = float(logsumexp(logs))
        weights = np.exp(logs - total)
        sizes = np.array([level.level.size for level in levels])
        best = int(np.argmax(weights))
        pairs = zip(with_all[best].means.tolist(), with_all[best].deviations.tolist(), strict=True)
        evidence = Evidence(
            total,
            tuple(float(weights[sizes == size].sum()) for size in SIZES),
            float(np.sqrt(weights @ sizes**2)) * float(self._missed.max()),
            dict(zip((each.name for each in known), pairs, strict=True)),
        )
        return evidence, levels[best], with_all[best]

    def _linearised(self, fit: Fit, z: FloatArray, added: Sequence[EffectDeclaration]) -> _Linearised:
        """The readings of a fitted model, linearised at unknowns z."""
        problem, rows = fit.problem, self._whitening.rows
        residuals, jacobian = problem.jacobian(z)
        free = [fit.model.parameters[index] for index in problem.free]
        point = problem.point(z)
        # Shapes of added effects are expected where they scored best, all else where the given model has it.
        expected = self._centre | {
            f"{each.name}.{parameter.name}.{each.where}": parameter.value
            for each in added
            for parameter in each.parameters
        }
        values = point.values.copy()
        values[problem.free] = [expected.get(each.name, each.declared.typical) for each in free]
        offset = problem.guess(values) - z
        nodes, states = len(fit.model.nodes), len(fit.model.states)
        starts = np.tile([_NODE_START] * nodes + [_HIDDEN_START] * (states - nodes), len(problem.bound_runs))
        prior = np.concatenate([[prior_of(each, each.name not in self._centre) for each in free], starts])
        amplitudes = _amplitudes(free, added)
        columns = [number for number, _ in amplitudes]
        rest = np.setdiff1d(np.arange(jacobian.shape[1]), columns)
        return _Linearised(
            residuals[:rows],
            jacobian[:rows, rest],
            prior[rest],
            offset[rest],
            jacobian[:rows, columns] / problem.slope(point.values)[columns],
            point.values[[problem.free[number] for number in columns]],
            [amplitude for _, amplitude in amplitudes],
            rest,
            columns,
        )

    @one_blas_thread
    def of_candidates(
        self,
        fit: Fit,
        added: Sequence[EffectDeclaration],
        columns: FloatArray,
        amplitudes: Sequence[Amplitude],
    ) -> tuple[FloatArray, FloatArray]:
        """By what factor each of many effects would raise the evidence, to first order.

        Args:
            fit: of the model that may lack one of them.
            added: what it has beyond the given one.
            columns: derivatives of the weighted residuals by the effects' amplitudes, shape (rows, m).
            amplitudes: what is known of these beforehand.

        Returns:
            Logarithms of the factors, and precisions of the amplitudes at the most likely discrepancy, shape (m,) each.
        """
        here = self._linearised(fit, fit.z, added)
        residuals = here.residuals
        unknowns = np.column_stack([here.by_rest, here.by_amplitudes, self._nuisances])
        usual = [each.usual for each in here.known]
        all_prior = np.concatenate([here.prior, usual, self._nuisance_prior])
        nothing = np.zeros((len(residuals), 0))
        without = levels_of(self._whitening, residuals, unknowns, all_prior, nothing)
        likely = max(without, key=lambda level: level.log_evidence).level
        # With one more effect the discrepancy may get smaller, hardly larger or of another time constant.
        among = [
            each
            for each in self._whitening.levels
            if each.size == 0 or (each.size <= likely.size and each.time_constant == likely.time_constant)
        ]
        levels = levels_of(self._whitening, residuals, unknowns, all_prior, columns, alternatives=True, among=among)
        alone = np.array([level.log_evidence for level in levels])
        with_each = np.array([level.log_evidence + log_bayes_factors(level, amplitudes) for level in levels])
        return np.asarray(logsumexp(with_each, axis=0) - logsumexp(alone)), levels[int(alone.argmax())].precision


def possible_effects(fit: Fit, columns: Collection[str]) -> list[Candidate]:
    """Every effect that a fitted model may lack, with time constants that its runs can show."""
    runs = [bound.run for bound in fit.problem.bound_runs]
    squares = {column: [np.nanmean(run.columns[column] ** 2) for run in runs] for column in columns}
    return candidates(
        fit.model.network,
        columns,
        [run.name for run in runs],
        step=max(run.step for run in runs),
        duration=max(len(run) * run.step for run in runs),
        rms={column: float(np.sqrt(np.mean(of_runs))) for column, of_runs in squares.items()},
        joined=[run.name for run in runs if "+" in run.source],
    )


def _amplitudes(free: Sequence[ParameterInstance], added: Sequence[EffectDeclaration]) -> list[tuple[int, Amplitude]]:
    """Where the free amplitudes of added effects stand among the free parameters, with what is known of them."""
    number = {parameter.name: k for k, parameter in enumerate(free)}
    chosen = []
    for declaration in added:
        for parameter in declaration.parameters:
            name = f"{declaration.name}.{parameter.name}.{declaration.where}"
            if parameter.off is not None and name in number:
                chosen.append(
                    (number[name], Amplitude(abs(parameter.typical), parameter.bounds[0] == parameter.off, name))
                )
    return chosen


def derivatives_by_sites(fit: Fit, places: Sequence[Site]) -> FloatArray:
    """Derivatives of the weighted residuals by the amplitudes of effects that are switched off, shape (rows, places).

    Rows are the readings that count, as in the problem's residuals, without its priors.
    """
    problem = fit.problem
    full = Model(fit.model.network.with_effects(site.declaration() for site in places))
    index = {parameter.name: number for number, parameter in enumerate(full.parameters)}
    amplitudes = [index[site.amplitude_name] for site in places]
    core = len(fit.model.states)  # effects are added behind the network's own, and so are their states
    blocks = []
    for bound, start in zip(problem.bound_runs, fit.point.starts, strict=True):
        wide = bind(full, bound.run)
        states = start_from(full, wide, dict(zip(fit.model.states, start.tolist(), strict=True)))
        moved = sensitivities(full, wide, full.values, amplitudes, states, core=core)
        scale = 1.0 / np.repeat(problem.sigma, bound.counted.sum(axis=1))[:, None]
        blocks.append(moved.by_parameter[bound.counted] * scale)
    return np.vstack(blocks)
