"""Parameters from runs: start values, coarse search, fine search, checkpoints, and what the result is worth."""

from __future__ import annotations

import contextlib
import hashlib
import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite
from pathlib import Path

import numpy as np
import platformdirs

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.files import write_whole
from lptn.basics.places import in_run
from lptn.basics.processes import one_blas_thread
from lptn.identify.integral_start import integral_start
from lptn.identify.noise import Noise, balanced_sigma, estimate_noise
from lptn.identify.problem import Point, Problem
from lptn.identify.solvers import PRECISION, Progress, Solution, minimise
from lptn.identify.uncertainty import Uncertainty, uncertainty
from lptn.model.file import DataTable, FitTable, FittedTable
from lptn.model.model import Model
from lptn.simulate.simulation import BoundRun, bind

# --- Parameters from runs: start values, coarse search, fine search, and what the result is worth ---


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
        bound_runs = self.problem.bound_runs
        counted = [error[bound.counted] for error, bound in zip(self.residuals, bound_runs, strict=True)]
        return float(np.sqrt(np.mean(np.concatenate(counted) ** 2)))

    def table(self) -> FitTable:
        """The result as a model file keeps it; infinite standard errors, and nuisances of the logs, are left out."""
        parameters = [self.model.parameters[index] for index in self.problem.free]
        free = [parameter for parameter in parameters if parameter.declared.prior is None]
        sources = {bound.run.source: bound.run.fingerprint for bound in self.problem.bound_runs}
        return FitTable(
            rmse=self.rmse,
            status=self.status,
            warnings=list(self.uncertainty.warnings),
            data=[DataTable(file=Path(source).name, sha256=digest) for source, digest in sources.items()],
            parameters={
                parameter.name: FittedTable(
                    value=parameter.value,
                    error=self.errors[parameter.name] if isfinite(self.errors[parameter.name]) else None,
                    unit=parameter.declared.unit,
                )
                for parameter in free
            },
        )

    def as_json(self) -> dict[str, object]:
        """The result as other tools read it."""
        free = [self.model.parameters[index] for index in self.problem.free]
        return {
            "rmse_fit": self.rmse,
            "status": self.status,
            "parameters": {
                parameter.name: {
                    "value": parameter.value,
                    "error": self.errors[parameter.name],
                    "unit": parameter.declared.unit,
                }
                for parameter in free
            },
            "correlations": self.uncertainty.correlations.tolist(),
            "warnings": list(self.uncertainty.warnings),
        }

    @property
    def errors(self) -> dict[str, float]:
        """Standard error of each free parameter by name, in its unit."""
        names = [self.model.parameters[index].name for index in self.problem.free]
        return dict(zip(names, self.uncertainty.errors.tolist(), strict=True))


@one_blas_thread
def fit(
    model: Model,
    bound_runs: Sequence[BoundRun],
    *,
    symmetry_penalty: float = 0.0,
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
    noise = estimate_noise(bound_runs, model.nodes)
    sigma = balanced_sigma(bound_runs, noise) if sigma is None else sigma
    problem = Problem(model, bound_runs, sigma, symmetry_penalty)
    before = 0
    if guess is None or averaged:
        coarse = Problem(model, [_coarse(model, bound) for bound in bound_runs], sigma, symmetry_penalty)
        best = _first_guess(coarse) if guess is None else coarse.guess(guess, starts)
        rough = minimise(coarse, best, progress, keep=_kept(keep, coarse, averaged=True), near=True)
        before = rough.iterations
        found = coarse.point(rough.z)
        z = problem.guess(found.values, found.starts)
        if rough.status == "interrupted":
            return _fit(problem, replace(rough, z=z, cost=problem.cost(z)), noise, before)
    else:
        balanced = integral_start(model, bound_runs, sigma)
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
def fit_starts(model: Model, bound_runs: Sequence[BoundRun], sigma: FloatArray) -> list[FloatArray]:
    """Initial states of runs from their counted readings, the parameters being held.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed; half-found initial states are worth nothing.
    """
    found = []
    for bound in bound_runs:
        problem = Problem(model, [bound], sigma, free=())
        solution = minimise(problem, problem.guess(model.values))
        if solution.status == "interrupted":
            raise KeyboardInterrupt
        found += problem.point(solution.z).starts
    return found


@one_blas_thread
def fit_nuisances(model: Model, bound: BoundRun, sigma: FloatArray) -> Model:
    """The model with what is no part of the robot and is granted to one run alone set as that run's readings ask for.

    Only held parameters with a prior that belong to the run are searched; most models have none, and stay as they are.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed.
    """
    log = bound.run.name.partition("#")[0]
    own = tuple(in_run("", run) for run in (bound.run.name, log))  # a piece of a split log, or all of it
    chosen = [
        index
        for index, parameter in enumerate(model.parameters)
        if parameter.declared.prior is not None and not parameter.free and parameter.name.endswith(own)
    ]
    if not chosen:
        return model
    problem = Problem(model, [bound], sigma, free=chosen)
    solution = minimise(problem, problem.guess(model.values))
    if solution.status == "interrupted":
        raise KeyboardInterrupt
    return model.with_values(problem.point(solution.z).values)


def _fit(problem: Problem, solution: Solution, noise: Noise, iterations: int) -> Fit:
    model = problem.model.with_values(problem.point(solution.z).values)
    return Fit(model, problem, solution.z, solution.cost, noise, iterations, solution.status)


def _first_guess(problem: Problem) -> FloatArray:
    """The declared values, or those that balance the integrated heat."""
    balanced = integral_start(problem.model, problem.bound_runs, problem.sigma)
    return min((problem.guess(values) for values in (problem.model.values, balanced)), key=problem.cost)


def _kept(keep: Keep | None, problem: Problem, *, averaged: bool) -> Callable[[FloatArray], None] | None:
    """What the search calls with its unknowns, for a caller that wants points."""
    return None if keep is None else lambda z: keep(problem.point(z), averaged)


def _coarse(model: Model, bound: BoundRun) -> BoundRun:
    """The same run in steps of about 10 s, where it is long enough."""
    factor = min(round(_COARSE_STEP / bound.run.step), len(bound) // _LEAST_COARSE)
    if factor < 2:
        return bound
    coarse = bind(model, bound.run.coarsen(factor))
    blocks = bound.counted[:, : len(coarse) * factor].reshape(len(model.nodes), -1, factor)
    return replace(coarse, counted=coarse.counted & blocks.all(axis=2))


# --- The best point of a fit that is running, kept where the next start of the same fit finds it ---


_EVERY = 3.0  # s between two writes
_FORGOTTEN = 30 * 86400.0  # s after which a checkpoint is of no use to anybody


def fingerprint_of(text: str, logs: Iterable[tuple[str, str]], options: Mapping[str, object]) -> str:
    """What a fit depends on, as hexadecimal digits: the model's text, the logs' contents and names, the options.

    Args:
        text: the model file.
        logs: name and SHA-256 of each.
        options: whatever else changes the result; JSON must be able to hold it.
    """
    parts = [text, [list(log) for log in logs], dict(options)]
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True)
class Kept:
    """A point of a search, and whether the search was still on averages of the runs."""

    point: Point
    averaged: bool


class Checkpoint:
    """One fit's best point, in the user's cache.

    A folder that can't be written costs the checkpoint, never the fit; a damaged file is as good as none.

    Args:
        fingerprint: of the fit.
        folder: where to keep it; by default in the user's cache.
        every: least time between two writes [s].
    """

    def __init__(self, fingerprint: str, folder: Path | None = None, every: float = _EVERY) -> None:
        self._folder = platformdirs.user_cache_path("lptn") / "fits" if folder is None else folder
        self.path = self._folder / f"{fingerprint[:32]}.json"
        self._every, self._written = every, time.monotonic()

    def load(self, model: Model, runs: int) -> Kept | None:
        """The point where an earlier fit of this model to so many runs was cut off, `None` where there is none."""
        try:
            kept = json.loads(self.path.read_text(encoding="utf-8"))
            averaged = bool(kept["averaged"])
            values = np.array([float(kept["values"][parameter.name]) for parameter in model.parameters])
            starts = [np.array([float(start[state]) for state in model.states]) for start in kept["starts"]]
        except (OSError, ValueError, KeyError, TypeError):
            return None
        usable = len(starts) == runs and np.isfinite([*values, *np.ravel(starts)]).all()
        return Kept(Point(values, starts), averaged) if usable else None

    def offer(self, model: Model, kept: Kept) -> None:
        """Keep a point, unless one was kept a moment ago."""
        if time.monotonic() - self._written >= self._every:
            self.save(model, kept)

    def save(self, model: Model, kept: Kept) -> None:
        """Keep a point, whole or not at all."""
        point = kept.point
        values = dict(zip((parameter.name for parameter in model.parameters), point.values.tolist(), strict=True))
        starts = [dict(zip(model.states, start.tolist(), strict=True)) for start in point.starts]
        with contextlib.suppress(OSError, InputError):
            if not self._folder.is_dir():
                self._folder.mkdir(parents=True)
            write_whole(self.path, json.dumps({"averaged": kept.averaged, "values": values, "starts": starts}))
        self._written = time.monotonic()

    def remove(self) -> None:
        """Forget the point, the fit being done; and those of fits that nobody went on with for a month."""
        with contextlib.suppress(OSError):
            self.path.unlink(missing_ok=True)
            oldest = time.time() - _FORGOTTEN
            for other in self._folder.glob("*.json"):
                if other.stat().st_mtime < oldest:
                    other.unlink(missing_ok=True)
