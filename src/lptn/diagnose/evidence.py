"""How probable a fitted model is: one likelihood, one prior, and the integral over all parameters at the fit (Laplace).

What a model gets wrong repeats from reading to reading, so the readings count as many times as there are independent
errors (a tempered likelihood, [MillerDunson2019]); how large errors are is unknown. Small errors of the log in each run
(air, torque, surface, each sensor's offset), and how like parts scatter about what they have in common, are part of
every model: allowances, with a prior of their own and integrated out in closed form. An error that nobody looks for, of
`NEGLIGIBLE` over a minute, bounds how much a long log can say. Held-out runs move no parameter of the fit. They speak
of the model after the fitted ones, with errors of their own size, so that a run of another machine says little. Robots
begin at rest, or warm, and not colder than what surrounds them.

The size of an effect has a prior with long tails (Cauchy's): an unusual size is improbable, and never forbidden.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import log, pi, sqrt

import numpy as np
from scipy.special import chdtri, erfcx, log_ndtr, logsumexp, ndtri

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.parameters import Parameter
from lptn.basics.places import EVERYWHERE, is_of_run
from lptn.basics.processes import one_blas_thread
from lptn.diagnose.candidates import AMBIENT_ERROR, SURFACE_ERROR, TORQUE_ERROR, USUAL, Candidate
from lptn.diagnose.fit_statistics import (
    LACKING,
    NEGLIGIBLE,
    RunErrors,
    independent_readings,
    lack_of_fit,
    standing_out,
)
from lptn.effects import Effect
from lptn.effects.ambient_offset import AmbientOffset
from lptn.effects.loss_scale import LossScale
from lptn.effects.sensor_offset import SensorOffset
from lptn.effects.surface_scale import SurfaceScale
from lptn.identify.comparison import Errors
from lptn.identify.data import Segment
from lptn.identify.fitting import Fit
from lptn.identify.noise import LEAST_NOISE
from lptn.identify.problem import AT_REST, Problem, rows_of_readings, tolerance_of
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration
from lptn.simulate.bound_run import BoundRun, bind, default_start, start_from
from lptn.simulate.kernel import asked_once
from lptn.simulate.simulation import sensitivity_windows

SCATTER = 0.15
"""Share, one standard deviation: how far one of several like parts is off what they have in common. Resistances of
windings are toleranced to 10 %, film coefficients of like surfaces in one machine differ by as much again."""
_MIXTURE = (1.0, 3.0, 10.0, 30.0), (0.5, 0.3, 0.15, 0.05)
"""Cauchy's density of a size as normal ones of so many typical sizes, with these weights: the integral is closed."""
_ROUNDS, _SETTLED = 50, 0.01
"""How often it is asked how large errors are, and how many are independent, each by the other; and the share by which
the precision then changes no more."""
_CHANCE = 0.05  # of one log in twenty it is said that it needs more than what every log may be off by


@dataclass(frozen=True)
class ErrorsOfRuns:
    """How far a log may be off in each run: one standard deviation of the air [K], of torques and of surfaces."""

    ambient: float = AMBIENT_ERROR
    torque: float = TORQUE_ERROR
    surface: float = SURFACE_ERROR


@dataclass(frozen=True)
class Allowance:
    """A small deviation that every model may have, and its standard deviation in its own unit."""

    candidate: Candidate
    shape: float | None
    spread: float


def may_deviate(fit: Fit) -> set[type[Effect]]:
    """Effects of which a model may have small deviations: those of logs, and what its like parts have in common."""
    of_logs = LossScale, SurfaceScale, AmbientOffset, SensorOffset
    return {*of_logs, *(type(declared.effect) for declared in fit.model.network.effects)}


def allowances(fit: Fit, possible: Iterable[Candidate], errors: ErrorsOfRuns) -> list[Allowance]:
    """The small deviations that every model may have: of runs, of sensors, of like parts.

    Args:
        fit: the fitted model.
        possible: all that it may lack, of the effects that `may_deviate`, or of all.
        errors: how far a log may be off.
    """
    spreads = {LossScale: 2 * errors.torque, SurfaceScale: errors.surface, AmbientOffset: errors.ambient}
    values = fit.model.named
    common = {declared.effect.key: declared for declared in fit.model.network.effects if not declared.difference}
    allowed = []
    for one in possible:
        if len(one.places) > 1:
            continue
        if one.run:
            spread = spreads.get(one.effect, 0.0)
        elif one.effect is SensorOffset:
            spread = AMBIENT_ERROR  # of any thermometer
        elif one.difference and one.effect.key in common:
            amplitude = one.amplitude
            shared = values.get(common[one.effect.key].shared_name(amplitude.name))
            size = 1.0 if amplitude.on is not None or shared is None else abs(shared.value - (amplitude.off or 0.0))
            spread = SCATTER * size
        else:
            continue
        if spread > 0:
            shape = min(one.shapes, key=lambda value: abs(log((value or 1.0) / (one.common_shape or 1.0))))
            allowed.append(Allowance(one, shape, spread))
    return allowed


@dataclass(frozen=True)
class FirstOrder:
    """What a candidate would explain, to first order.

    Args:
        candidate: effect and place.
        log_odds: of the model with it, and the candidate's prior odds, to the model without.
        amplitude: its size beside where it is off, in the amplitude's unit.
        shape: the shape of its grid that explains most.
        standard_error: of the amplitude, beside all else.
    """

    candidate: Candidate
    log_odds: float
    amplitude: float
    shape: float | None
    standard_error: float

    def declaration(self) -> EffectDeclaration:
        """The effect as it is fitted, from this size and shape."""
        return self.candidate.declaration(self.amplitude, self.shape)


@dataclass(frozen=True)
class _Group:
    """What some runs say of a model.

    Args:
        independent: number of independent errors.
        precision: of each, in weighted residuals.
        misfit: sum of squares that is left with all parameters at their best, in units of these errors.
    """

    independent: float
    precision: float
    misfit: float


class Evidence:
    """A fit and all that it may be off by, to first order; how probable that makes its model.

    Args:
        fit: the fitted model.
        allowed: small deviations that every model may have.
        among: candidates that are to be weighed besides, see `first_order`.
        beside: evidence of another model of the same readings, whose errors say how many of them are independent, and
            whose traces of allowances are taken over; this one's own by default.
        held_out: runs that moved no parameter, and speak of the model all the same; their starts are integrated out.

    Raises:
        SimulationError: a held-out run can't be simulated.
    """

    @one_blas_thread
    def __init__(
        self,
        fit: Fit,
        allowed: Sequence[Allowance],
        among: Sequence[Candidate] = (),
        beside: Evidence | None = None,
        held_out: Sequence[Segment] = (),
    ) -> None:
        self.fitted = fit
        fit = self.fit = with_runs(fit, held_out)
        self._allowed = allowed
        problem = fit.problem
        residuals, jacobian = problem.jacobian(fit.z)
        n, n_fitted, weight = problem.readings, self.fitted.problem.readings, problem.weight_of_priors
        moving = np.r_[:n_fitted, n : problem.rows]  # rows that have moved parameters
        self._free = ~pushed_beyond_bounds(fit, jacobian[moving].T @ residuals[moving])
        self._residuals = residuals[:n]

        prior, off = jacobian[n:] / weight, residuals[n:] / weight
        declared = [fit.model.parameters[index].declared for index in problem.free]
        self._amplitudes = [row for row, one in enumerate(declared) if one.off is not None]
        first = problem.rows_of_priors.start - n
        for number, row in enumerate(row for row, one in enumerate(declared) if one.prior is not None):
            if declared[row].off is not None:  # the density of sizes has tails longer than what the fit was held by
                prior[first + number], off[first + number] = 0.0, 0.0
        # What is given without a prior is right to a factor of three or so, one in its logarithm: the same for all
        # models, of which it decides nothing.
        weak = np.zeros(problem.size)
        slope = problem.slope(fit.point.values)
        for row, one in enumerate(declared):
            if one.off is not None:
                weak[row] = _curvature(one, fit.model.parameters[problem.free[row]].value) * slope[row] ** 2
            elif one.prior is None:
                weak[row] = 1.0

        small = [next(iter(allowance.candidate.sites(allowance.shape).items())) for allowance in allowed]
        scored = [(one, {shape: one.sites(shape) for shape in one.shapes}) for one in among]
        every = dict(small) | {name: at for _, by in scored for own in by.values() for name, at in own.items()}
        column = {name: place for place, name in enumerate(every)}
        self._among = [(one, {k: [column[name] for name in own] for k, own in by.items()}) for one, by in scored]
        """Candidates to be weighed; for each shape the columns of its sites among the traces."""
        traces: dict[str, FloatArray] = dict(beside._small_traces) if beside else {}
        unknown = {name: site for name, site in every.items() if name not in traces}
        if unknown:
            traces |= zip(unknown, derivatives(fit, [*unknown.values()])[:n].T, strict=True)
        self._traces = np.array([traces[name] for name in every]).reshape(len(every), n).T
        self._small_traces: dict[str, FloatArray] = {name: traces[name] for name, _ in small}
        """Of the allowances, unweighted: they are small, so that another fit to the same readings has the same."""
        spreads = np.array([allowance.spread for allowance in allowed])
        of_allowed = self._traces[:, [column[name] for name, _ in small]] * spreads
        self._columns = np.hstack([jacobian[:n, self._free], of_allowed])
        sizes = [fit.model.parameters[problem.free[row]].value for row in self._amplitudes]
        held = [(row, size) for row, size in zip(self._amplitudes, sizes, strict=True) if not self._free[row]]
        self._at_ends = [row for row, size in held if size != declared[row].off]
        """Amplitudes that nature ends elsewhere than at none, such as a surface that loses nothing."""
        self._end_columns = jacobian[:n, self._at_ends]
        count = int(self._free.sum())
        self._information, self._gradient = np.eye(self._columns.shape[1]), np.zeros(self._columns.shape[1])
        self._information[:count, :count] = prior[:, self._free].T @ prior[:, self._free] + np.diag(weak[self._free])
        self._gradient[:count] = prior[:, self._free].T @ off
        self._squares = float(off @ off)
        self.left, weights = np.zeros(n), np.ones(n)
        self._groups: list[_Group] = []
        # The fitted runs come first; held-out runs are judged by the model fitted to them.
        runs, count = problem.bound_runs, len(self.fitted.problem.bound_runs)
        of_both = (slice(0, n_fitted), runs[:count]), (slice(n_fitted, n), runs[count:])
        for number, (rows, bound_runs) in enumerate(of_both):
            if bound_runs:
                self._groups.append(self._learn(rows, bound_runs, beside._groups[number] if beside else None))
                weights[rows] = sqrt(self._groups[-1].precision)
        self._columns *= weights[:, None]
        self._traces *= weights[:, None]
        self._end_columns *= weights[:, None]
        self._residuals = self._residuals * weights
        proper = np.einsum("ij,ij->j", prior[:, self._free], prior[:, self._free])
        proper += np.where(np.isin(np.flatnonzero(self._free), self._amplitudes), 0.0, weak[self._free])
        self._log_prior_volume = float(np.log(proper[proper > 0]).sum())

    def _learn(self, rows: slice, bound_runs: Sequence[BoundRun], known: _Group | None) -> _Group:
        """Take in what some runs say; how large their errors are, and how many, is found unless it is known."""
        columns, residuals, sigma = self._columns[rows], self._residuals[rows], self.fit.problem.sigma
        information, gradient = columns.T @ columns, columns.T @ residuals
        # A log without any noise is met to the last digit, and no reading says infinitely much.
        exact = sum(float((LEAST_NOISE / sigma) ** 2 @ bound.counted.sum(axis=1)) for bound in bound_runs)
        independent, precision, left = (
            (known.independent, known.precision, residuals) if known else (1.0, 0.0, residuals)
        )
        for _ in range(1 if known else _ROUNDS):
            before = precision
            if not known:  # what errors of the log leave repeats for hours: independent are those beside them
                independent = independent_readings(_by_run(bound_runs, sigma, left), NEGLIGIBLE)
                precision = independent / max(float(left @ left), exact)
            self._factorise(self._information + precision * information)
            self._moved = self._solve(self._gradient + precision * gradient)
            left = residuals - columns @ self._moved
            if abs(precision - before) < _SETTLED * precision:
                break
        self.left[rows] = left
        self._information = self._information + precision * information
        self._gradient = self._gradient + precision * gradient
        self._squares += precision * max(float(residuals @ residuals), exact)
        before = sum(group.misfit for group in self._groups)
        return _Group(independent, precision, self._squares - float(self._gradient @ self._moved) - before)

    @property
    def precision(self) -> float:
        """Of an independent error of the fitted runs' readings, in weighted residuals."""
        return self._groups[0].precision

    @property
    def tolerance(self) -> FloatArray:
        """What a fit should leave to the allowances, as `Problem` takes it."""
        precision, rows = self.precision, self.fitted.problem.readings
        return tolerance_of(self._columns[:rows, int(self._free.sum()) :] / sqrt(precision), precision)

    def is_lacking(self, *, held_out: bool = True) -> bool:
        """Whether some node's readings are met worse than noise and what every log may be off by leave.

        Args:
            held_out: of held-out runs as well.
        """
        runs, count = self._left_by_run, len(self.fitted.problem.bound_runs)
        of_air = [allowance.spread for allowance in self._allowed if allowance.candidate.effect is AmbientOffset]
        least = max(of_air, default=AMBIENT_ERROR)
        beyond_noise = any(lack > LACKING for lack in lack_of_fit(self.fitted, runs[:count]).values()) or any(
            standing_out(self.fitted, run, least, fitted=runs[:count]) for run in runs[count:] if held_out
        )
        fitted, of_run = [bound.run.name for bound, _ in runs[:count]], [one.candidate.run for one in self._allowed]
        counted = [held_out or any(is_of_run(name, run or EVERYWHERE) for name in fitted) for run in of_run]
        allowed = self._moved[int(self._free.sum()) :][counted]
        number = max(len(allowed), 1)
        largest, together = -ndtri(0.5 * _CHANCE / number), chdtri(number, _CHANCE)
        return bool(beyond_noise or (np.abs(allowed) > largest).any() or allowed @ allowed > together)

    @property
    def _left_by_run(self) -> list[RunErrors]:
        return _by_run(self.fit.problem.bound_runs, self.fit.problem.sigma, self.left)

    @property
    def left_of_held_out(self) -> float | None:
        """RMSE that is left of held-out runs beside starts and allowances [K], `None` without any."""
        runs = self._left_by_run[len(self.fitted.problem.bound_runs) :]
        return Errors.of(np.concatenate([error.ravel() for _, error in runs])).rmse if runs else None

    @cached_property
    def log_evidence(self) -> float:
        """Logarithm of the probability of the fitted readings, up to a constant that their models have in common."""
        problem, total = self.fit.problem, 0.0
        for group in self._groups:
            total -= 0.5 * group.independent * log(max(group.misfit, np.finfo(float).tiny) / group.independent)
        slope = problem.slope(self.fit.point.values)
        for row in self._amplitudes:
            if self._free[row]:
                instance = self.fit.model.parameters[problem.free[row]]
                total += _log_density(instance.declared, instance.value) + log(abs(slope[row])) + 0.5 * log(2 * pi)
                if instance.declared.one_sided:
                    off = instance.value - (instance.declared.off or 0.0)
                    total += float(log_ndtr(off / sqrt(self._variance(row))))
        # An amplitude at an end: the likelihood falls from there to the inside, over which it is integrated.
        beside = self._solve(self._columns.T @ self._end_columns)
        information = np.sum(self._end_columns * (self._end_columns - self._columns @ beside), axis=0)
        information = np.maximum(information, np.finfo(float).eps * np.sum(self._end_columns**2, axis=0))
        pull = np.abs(self._gradient @ beside - self._residuals @ self._end_columns)
        for row, known, outward in zip(self._at_ends, information.tolist(), pull.tolist(), strict=True):
            instance = self.fit.model.parameters[problem.free[row]]
            total += _log_density(instance.declared, instance.value) + log(abs(slope[row]))
            total += log(sqrt(0.5 * pi / known) * float(erfcx(outward / sqrt(2.0 * known))))
        return total + log_prior_of_starts(self.fitted) + 0.5 * (self._log_prior_volume - self._log_volume)

    def log_odds_of_none(self, name: str) -> float:
        """Logarithm of the odds that an amplitude is none to that it is not, by its posterior and prior density there.

        The ratio of Savage and Dickey [Dickey1971], to first order; infinite where the amplitude is at none, or nothing
        is known of it.
        """
        problem, parameters = self.fit.problem, self.fit.model.parameters
        row = self._row_of(name)
        if row is None:
            return float("inf")
        variance, declared = self._variance(row), parameters[problem.free[row]].declared
        none = declared.off or 0.0
        off = (parameters[problem.free[row]].value - none) / sqrt(variance)
        density = -0.5 * (off**2 + log(2 * pi * variance))
        if declared.one_sided:
            density -= float(log_ndtr(off))
        return density - _log_density(declared, none)

    def exchanges(self, name: str) -> list[FirstOrder]:
        """The model with each candidate in place of an amplitude; `log_odds` are those to this model.

        Of what is collinear neither is told from the other, however sure the data are of both together. To first order,
        without the candidates' prior odds: the amplitude set to none moves all else, and the candidate takes it up.
        """
        row = self._row_of(name)
        if row is None:
            return []
        instance = self.fit.model.parameters[self.fit.problem.free[row]]
        slope = float(self.fit.problem.slope(self.fit.point.values)[row])
        off = (instance.value - (instance.declared.off or 0.0)) / slope
        variance, place = float(self.covariance[row, row]), int(self._free[:row].sum())
        entries, pull, information, beside = self._beside
        along = beside[place] / variance
        return _weighed(entries, pull + along * off, information + along * beside[place], self.log_odds_of_none(name))

    def _row_of(self, name: str) -> int | None:
        """The number of a parameter among those that move; `None` if it doesn't, or is pushed beyond a bound."""
        problem, parameters = self.fit.problem, self.fit.model.parameters
        row = next((row for row, index in enumerate(problem.free) if parameters[index].name == name), None)
        return row if row is not None and self._free[row] else None

    @cached_property
    def covariance(self) -> FloatArray:
        """Of the free parameters in the search's coordinates, beside starts and allowances, shape (free, free).

        None of a parameter that is pushed beyond a bound that holds.
        """
        count = len(self.fit.problem.free)
        moving = np.flatnonzero(self._free[:count])
        covariance = np.zeros((count, count))
        every = self._solve(np.eye(len(self._gradient))[:, : len(moving)])
        covariance[np.ix_(moving, moving)] = every[: len(moving)]
        return covariance

    def _variance(self, row: int) -> float:
        """Of a free parameter, in its unit, with all others free."""
        slope = float(self.fit.problem.slope(self.fit.point.values)[row])
        return max(float(self.covariance[row, row]) * slope**2, np.finfo(float).tiny)

    def first_order(self, log_priors: FloatArray) -> list[FirstOrder]:
        """The candidates that a model was given to weigh, the most probable first.

        Args:
            log_priors: logarithm of the prior odds of each, shape (candidates,).
        """
        independent = sum(group.independent for group in self._groups)
        misfit = sum(group.misfit for group in self._groups)
        priors = dict(zip((one for one, _ in self._among), log_priors.tolist(), strict=True))
        entries, pull, information, _ = self._beside
        beforehand = np.array([priors[one] for one, _ in entries])
        return _weighed(entries, pull, information, beforehand, independent, misfit)

    @cached_property
    def _beside(self) -> tuple[list[tuple[Candidate, float | None]], FloatArray, FloatArray, FloatArray]:
        """Candidates and their shapes; of each what pulls its amplitude from none, the information on that beside all
        else, and by how much all else then gives way, by a unit of it, shape (all else, entries)."""
        entries = [(one, shape, sites) for one, by in self._among for shape, sites in by.items()]
        of_entries = np.zeros((self._traces.shape[1], len(entries)))
        of_sites = np.einsum("ij,ij->j", self._traces, self._traces)
        whole = np.array([of_sites[sites[0]] for _, _, sites in entries])
        for number, (_, _, sites) in enumerate(entries):
            of_entries[sites, number] = 1.0
            if len(sites) > 1:
                whole[number] = np.sum(self._traces[:, sites].sum(axis=1) ** 2)
        shared = self._columns.T @ self._traces @ of_entries
        beside = self._solve(shared)
        information = whole - np.einsum("ij,ij->j", shared, beside)
        pull = self._gradient @ beside - self._residuals @ self._traces @ of_entries
        told = np.flatnonzero((information > sqrt(np.finfo(float).eps) * whole) & (whole != 0.0))
        return [entries[number][:2] for number in told], pull[told], information[told], beside[:, told]

    def _factorise(self, information: FloatArray) -> None:
        from scipy.linalg import cho_factor  # heavy, and few commands need it

        self._scale = 1.0 / np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
        scaled = information * np.outer(self._scale, self._scale) + 1e-10 * np.eye(len(information))
        self._factor = cho_factor(scaled)
        self._log_volume = 2.0 * float(np.log(np.diag(self._factor[0]) / self._scale).sum())

    def _solve(self, vector: FloatArray) -> FloatArray:
        from scipy.linalg import cho_solve

        return np.asarray((cho_solve(self._factor, (vector.T * self._scale).T).T * self._scale).T)


# --- Traces: what effects that are switched off would do to the residuals of a fit, to first order ---------------


_ANY_RUN = "?*"  # a glob of all runs that no model file writes


def derivatives(fit: Fit, sites: Sequence[EffectDeclaration]) -> FloatArray:
    """Weighted derivatives of the residuals by the amplitudes of `Candidate.sites`, shape (rows, sites), by columns.

    All sites are switched off in one model, which equals the fitted one to the last bit: one pass of sensitivities
    gives the whole catalogue. What acts in one run alone does there what it does in every run.
    """
    problem, in_any = fit.problem, [replace(site, run=_ANY_RUN) if site.run else site for site in sites]
    names = [site.shared_name(amplitude.name) for site in in_any if (amplitude := site.effect.amplitude())]
    distinct = dict(zip(names, in_any, strict=True))
    number_of = {name: number for number, name in enumerate(distinct)}
    full = fit.model.made_once(
        ("sites", tuple(distinct)), lambda: asked_once(Model(fit.model.network.with_effects(distinct.values())))
    )
    values, index = full.values, {parameter.name: number for number, parameter in enumerate(full.parameters)}
    values[[index[parameter.name] for parameter in fit.model.parameters]] = fit.model.values
    amplitudes = [index[name] for name in distinct]
    core = len(fit.model.states)  # effects are added behind the network's own, and so are their states
    numbers = [number_of[name] for name in names]
    # By columns, as candidates sum them up; the penalties' rows stay zero, for no site enters them.
    by_site = np.zeros((problem.rows, len(sites)), order="F")
    first = 0
    for bound, start in zip(problem.bound_runs, fit.point.starts, strict=True):
        wide = bind(full, bound.run)
        states = start_from(full, wide, dict(zip(fit.model.states, start.tolist(), strict=True)))
        row_of = rows_of_readings(bound) + first
        acting = np.array([is_of_run(bound.run.name, site.run or EVERYWHERE) for site in sites])
        for window, moved in sensitivity_windows(full, wide, values, amplitudes, states, core):
            counted = bound.counted[:, window]
            scale = 1.0 / np.repeat(problem.sigma, counted.sum(axis=1))[:, None]
            by_site[row_of[:, window][counted]] = (moved.by_parameter[counted] * scale)[:, numbers] * acting
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


# --- Held-out runs beside the fitted ones -----------------------------------------------------------------------


def with_runs(fit: Fit, segments: Sequence[Segment]) -> Fit:
    """A fit with further runs, which begin as their first readings say and have moved no parameter."""
    if not segments:
        return fit
    problem, model = fit.problem, fit.model
    ends = [(one.initialisation[0], one.evaluation[1]) for one in segments]
    others = [bind(model, one.run).count(end).until(end[1]) for one, end in zip(segments, ends, strict=True)]
    bound_runs = [*problem.bound_runs, *others]
    wide = Problem(model, bound_runs, problem.sigma, problem.symmetry_penalty, problem.free)
    starts = [*fit.point.starts, *(default_start(model, bound) for bound in others)]
    return replace(fit, problem=wide, z=wide.guess(fit.point.values, starts))


def _by_run(bound_runs: Sequence[BoundRun], sigma: FloatArray, residuals: FloatArray) -> list[RunErrors]:
    """Weighted residuals of all readings as errors of each run."""
    runs, first = [], 0
    for bound in bound_runs:
        error, rows = np.full(bound.counted.shape, np.nan), int(bound.counted.sum())
        error[bound.counted] = residuals[first : first + rows] * np.repeat(sigma, bound.counted.sum(axis=1))
        runs.append((bound, error))
        first += rows
    return runs


def _weighed(
    entries: Sequence[tuple[Candidate, float | None]],
    pull: FloatArray,
    information: FloatArray,
    log_odds: FloatArray | float,
    independent: float = np.inf,
    misfit: float = np.inf,
) -> list[FirstOrder]:
    """Of each candidate the shape that explains most, the most probable candidate first, amplitudes integrated out.

    Args:
        entries: candidates and their shapes.
        pull: derivative of the log likelihood by each amplitude, at none.
        information: on it.
        log_odds: beforehand.
        independent, misfit: of the errors, whose size is known as well as so many tell; infinite where it is known.
    """
    amplitudes = {one: one.amplitude for one, _ in entries}
    own = [amplitudes[one] for one, _ in entries]
    one_sided = np.array([amplitude.one_sided for amplitude in own], dtype=bool)
    least, most = (np.array([one.bounds[end] - (one.off or 0.0) for one in own]) for end in (0, 1))
    scales, weights = (np.array(numbers)[:, None] for numbers in _MIXTURE)
    variances = (scales * [one.typical for one in own]) ** 2
    explained = np.where(one_sided & (pull < 0), 0.0, pull**2 * variances / (1.0 + variances * information))
    if np.isfinite(independent):
        explained = -independent * np.log(np.maximum(1.0 - explained / misfit, np.finfo(float).eps))
    sides = np.where(one_sided & (pull > 0), log(2.0), 0.0)
    gained = logsumexp(0.5 * explained - 0.5 * np.log1p(variances * information), axis=0, b=weights)
    odds, sizes = log_odds + sides + gained, np.clip(pull / information, least, most)
    best = dict[Candidate, FirstOrder]()
    for (one, shape), log_odd, size, known in zip(entries, odds.tolist(), sizes.tolist(), information, strict=True):
        if one not in best or log_odd > best[one].log_odds:
            best[one] = FirstOrder(one, log_odd, size, shape, float(known**-0.5))
    return sorted(best.values(), key=lambda entry: -entry.log_odds)


def _log_density(amplitude: Parameter, value: float) -> float:
    """Logarithm of the prior density of an effect's size, per unit: Cauchy's about none."""
    scale = USUAL * abs(amplitude.typical)
    sides = 2.0 if amplitude.one_sided else 1.0
    return log(sides / (pi * scale * (1.0 + ((value - (amplitude.off or 0.0)) / scale) ** 2)))


def _curvature(amplitude: Parameter, value: float) -> float:
    """The precision of a normal density that is as narrow as this one is there; of what the data say nothing of, too,
    the prior then holds the size."""
    scale = USUAL * abs(amplitude.typical)
    return 2.0 / (scale**2 + (value - (amplitude.off or 0.0)) ** 2)


# --- How robots begin --------------------------------------------------------------------------------


_WARMER = 10.0
"""K, by which a robot's node is usually warmer than its surroundings while it works, or another room than this one."""
_ROOMS = 400  # temperatures of the other room over which is summed, as far beyond the nodes as these are warmer


def log_prior_of_starts(fit: Fit) -> float:
    """How usual it is that the measured nodes start each run where the fit has them, as a logarithm.

    A robot that rested is as warm as what surrounds it, or as another room that it was carried from. Of its nodes each
    may be warmer than that, from what it did before or from its electronics, but none is colder. So the error of a
    sensor that reads off the air before anything runs is likely, and one that reads as it should, because its node was
    colder by as much, is not. Either is as probable beforehand; how much warmer has long tails (Cauchy's).
    """
    model, total = fit.model, 0.0
    if not model.network.prescribed:
        return total
    for bound, start in zip(fit.problem.bound_runs, fit.point.starts, strict=True):
        values = model.in_run(bound.run.name, fit.point.values)
        felt = model.surroundings(start, bound.inputs[:, 0], values).full().ravel()
        nodes = start[: len(model.nodes)][np.isfinite(bound.start)]
        off = nodes - np.clip(nodes, felt.min(), felt.max())
        rooms = np.linspace(off.min(initial=0.0) - _WARMER, off.max(initial=0.0) + _WARMER, _ROOMS)
        of_rooms = np.append(_log_cauchy(rooms) + log(rooms[1] - rooms[0]), 0.0)
        total += float(logsumexp(of_rooms + _log_density_of_starts(off, np.append(rooms, 0.0)))) - log(2.0)
    return total


def _log_density_of_starts(off: FloatArray, rooms: FloatArray) -> FloatArray:
    """Of nodes that start so much off their surroundings [K], in a robot that rested in each of some rooms."""
    above = off - rooms[:, None]
    at_rest = -0.5 * (above / AT_REST) ** 2 - log(AT_REST * sqrt(2 * pi))
    warmer = np.where(above > 0, log(2.0) + _log_cauchy(above), -np.inf)
    return np.asarray(np.sum(np.logaddexp(at_rest, warmer) - log(2.0), axis=1))


def _log_cauchy(kelvin: FloatArray) -> FloatArray:
    return np.asarray(-np.log1p((kelvin / _WARMER) ** 2) - log(pi * _WARMER))
