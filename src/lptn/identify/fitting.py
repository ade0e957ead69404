"""Parameters from runs: start values, coarse search, fine search, and what the result is worth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite
from pathlib import Path

import numpy as np

from lptn.arrays import FloatArray
from lptn.identify.gauss_newton import Progress, Solution, minimise
from lptn.identify.integral_start import integral_start
from lptn.identify.polish import PRECISION
from lptn.identify.problem import Point, Problem
from lptn.identify.uncertainty import Uncertainty, uncertainty
from lptn.model import Model
from lptn.model_schema import DataTable, FitTable, FittedTable
from lptn.noise import Noise, balanced_sigma, estimate_noise
from lptn.places import in_run
from lptn.simulate import Drive, drive
from lptn.threads import one_blas_thread

Keep = Callable[[Point, bool], None]
"""Called with the best point so far, and whether it is that of a coarse search."""

_COARSE_STEP = 10.0  # s
_LEAST_COARSE = 150  # steps that a run must keep to be worth a coarse search


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    Args:
        model: the model that was fitted, with the values found in it.
        problem: the least-squares problem at full resolution.
        z: its unknowns at the solution.
        cost: half the sum of squared weighted residuals, priors included.
        noise: the sensors' noise.
        iterations: of all searches together.
        status: IPOPT's word, `"interrupted"`, or `"given up"`.
    """

    model: Model
    problem: Problem
    z: FloatArray
    cost: float
    noise: Noise
    iterations: int
    status: str

    @property
    def point(self) -> Point:
        """Parameter values and initial states."""
        return self.problem.point(self.z)

    @cached_property
    def uncertainty(self) -> Uncertainty:
        """Of the free parameters; worked out when asked for, since a search asks of few of its many fits."""
        return uncertainty(self.problem, self.z)

    @cached_property
    def residuals(self) -> list[FloatArray]:
        """Measured minus predicted [K] for each run, shape (nodes, n), NaN where nothing was measured."""
        return self.problem.errors(self.z)

    @property
    def rmse(self) -> float:
        """Root mean square of the residuals over all readings that count [K]."""
        drives = self.problem.drives
        counted = [error[driven.counted] for error, driven in zip(self.residuals, drives, strict=True)]
        return float(np.sqrt(np.mean(np.concatenate(counted) ** 2)))

    def table(self) -> FitTable:
        """The result as a model file keeps it; infinite standard errors, and nuisances of the logs, are left out."""
        unknowns = [self.model.unknowns[index] for index in self.problem.free]
        free = [unknown for unknown in unknowns if unknown.declared.prior is None]
        sources = {driven.run.source: driven.run.fingerprint for driven in self.problem.drives}
        return FitTable(
            rmse=self.rmse,
            status=self.status,
            warnings=list(self.uncertainty.warnings),
            data=[DataTable(file=Path(source).name, sha256=digest) for source, digest in sources.items()],
            parameters={
                unknown.name: FittedTable(
                    value=unknown.value,
                    error=self.errors[unknown.name] if isfinite(self.errors[unknown.name]) else None,
                    unit=unknown.declared.unit,
                )
                for unknown in free
            },
        )

    def as_json(self) -> dict[str, object]:
        """The result as other tools read it."""
        free = [self.model.unknowns[index] for index in self.problem.free]
        return {
            "rmse_fit": self.rmse,
            "status": self.status,
            "parameters": {
                unknown.name: {
                    "value": unknown.value,
                    "error": self.errors[unknown.name],
                    "unit": unknown.declared.unit,
                }
                for unknown in free
            },
            "correlations": self.uncertainty.correlations.tolist(),
            "warnings": list(self.uncertainty.warnings),
        }

    @property
    def errors(self) -> dict[str, float]:
        """Standard error of each free parameter by name, in its unit."""
        names = [self.model.unknowns[index].name for index in self.problem.free]
        return dict(zip(names, self.uncertainty.errors.tolist(), strict=True))


@one_blas_thread
def fit(
    model: Model,
    drives: Sequence[Drive],
    *,
    mirror_weight: float = 0.0,
    sigma: FloatArray | None = None,
    guess: FloatArray | None = None,
    starts: Sequence[FloatArray] | None = None,
    averaged: bool = False,
    iterations: int = 80,
    progress: Progress | None = None,
    keep: Keep | None = None,
    rival: float = np.inf,
    precision: float = PRECISION,
) -> Fit:
    """Fit the free parameters, and the initial states of each run, to free-running simulations.

    Args:
        model: the model.
        drives: the runs, with the readings that count.
        mirror_weight: λ of the left-right regulariser.
        sigma: standard deviation that weighs each node [K]; by default balanced between nodes with
            large and small excursions.
        guess: parameter values to start from, shape (m,), unless those of the integrated heat balance are
            better; without it, a coarse search comes first.
        starts: initial states to start from, together with `guess`.
        averaged: the guess is of a coarse search that was cut off, and that comes first.
        iterations: how many the last search may take.
        progress: called after each iteration.
        keep: called after each iteration with the best point so far, and whether the search is still coarse.
        rival: a cost to beat; a fit from a `guess` that has no hope of it ends, with status `"given up"`.
        precision: share of the cost that is not worth another step of the last search.
    """
    noise = estimate_noise(drives, model.nodes)
    sigma = balanced_sigma(drives, noise) if sigma is None else sigma
    problem = Problem(model, drives, sigma, mirror_weight)
    before = 0
    if guess is None or averaged:
        coarse = Problem(model, [_coarse(model, driven) for driven in drives], sigma, mirror_weight)
        best = _first_guess(coarse) if guess is None else coarse.guess(guess, starts)
        rough = minimise(coarse, best, progress, keep=_kept(keep, coarse, averaged=True), near=True)
        before = rough.iterations
        found = coarse.point(rough.z)
        z = problem.guess(found.values, found.starts)
        if rough.status == "interrupted":
            return _fit(problem, replace(rough, z=z, cost=problem.cost(z)), noise, before)
    else:
        balanced = integral_start(model, drives, sigma)
        z = min((problem.guess(guess, starts), problem.guess(balanced, starts)), key=problem.cost)
    kept = _kept(keep, problem, averaged=False)
    solution = minimise(problem, z, progress, iterations, keep=kept, near=True, rival=rival, precision=precision)
    return _fit(problem, solution, noise, before + solution.iterations)


@one_blas_thread
def finished(done: Fit) -> Fit:
    """A fit that was ended early because it only ranked, gone on with to the end."""
    solution = minimise(done.problem, done.z, near=True)
    return _fit(done.problem, solution, done.noise, done.iterations + solution.iterations)


@one_blas_thread
def fit_starts(model: Model, drives: Sequence[Drive], sigma: FloatArray) -> list[FloatArray]:
    """Initial states of runs from their counted readings, the parameters being held.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed; half-found initial states are worth nothing.
    """
    found = []
    for driven in drives:
        problem = Problem(model, [driven], sigma, free=())
        solution = minimise(problem, problem.guess(model.values))
        if solution.status == "interrupted":
            raise KeyboardInterrupt
        found += problem.point(solution.z).starts
    return found


@one_blas_thread
def fit_nuisances(model: Model, driven: Drive, sigma: FloatArray) -> Model:
    """The model with what is no part of the robot and is granted to one run alone set as that run's readings ask for.

    Only held parameters with a prior that belong to the run are searched; most models have none, and stay as they are.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed.
    """
    log = driven.run.name.partition("#")[0]
    own = tuple(in_run("", run) for run in (driven.run.name, log))  # a piece of a split log, or all of it
    chosen = [
        index
        for index, unknown in enumerate(model.unknowns)
        if unknown.declared.prior is not None and not unknown.free and unknown.name.endswith(own)
    ]
    if not chosen:
        return model
    problem = Problem(model, [driven], sigma, free=chosen)
    solution = minimise(problem, problem.guess(model.values))
    if solution.status == "interrupted":
        raise KeyboardInterrupt
    return model.with_values(problem.point(solution.z).values)


def _fit(problem: Problem, solution: Solution, noise: Noise, iterations: int) -> Fit:
    model = problem.model.with_values(problem.point(solution.z).values)
    return Fit(model, problem, solution.z, solution.cost, noise, iterations, solution.status)


def _first_guess(problem: Problem) -> FloatArray:
    """The declared values, or those that balance the integrated heat."""
    balanced = integral_start(problem.model, problem.drives, problem.sigma)
    return min((problem.guess(values) for values in (problem.model.values, balanced)), key=problem.cost)


def _kept(keep: Keep | None, problem: Problem, *, averaged: bool) -> Callable[[FloatArray], None] | None:
    """What the search calls with its unknowns, for a caller that wants points."""
    return None if keep is None else lambda z: keep(problem.point(z), averaged)


def _coarse(model: Model, driven: Drive) -> Drive:
    """The same run in steps of about 10 s, where it is long enough."""
    factor = min(round(_COARSE_STEP / driven.run.step), len(driven) // _LEAST_COARSE)
    if factor < 2:
        return driven
    coarse = drive(model, driven.run.coarsen(factor))
    blocks = driven.counted[:, : len(coarse) * factor].reshape(len(model.nodes), -1, factor)
    return replace(coarse, counted=coarse.counted & blocks.all(axis=2))
