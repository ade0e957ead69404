"""Parameters from runs: start values, coarse search, fine search, checkpoints, and what the result predicts."""

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
from typing import Any

import numpy as np
import pandas as pd
import platformdirs

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.files import write_whole
from lptn.basics.processes import one_blas_thread
from lptn.basics.tables import Tabular
from lptn.identify.comparison import Prediction, errors_of
from lptn.identify.data import EVERYTHING, Segment
from lptn.identify.integral_start import integral_start
from lptn.identify.noise import Noise, balanced_sigma, estimate_noise
from lptn.identify.problem import Point, Problem
from lptn.identify.solvers import PRECISION, Progress, Solution, minimise
from lptn.identify.uncertainty import Uncertainty, uncertainty
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.tables import DataTable, FitTable, FittedTable
from lptn.simulate.bound_run import BoundRun, bind
from lptn.simulate.simulation import simulate

Keep = Callable[[Point], None]
"""Called with the best point so far."""

ROUGH = 3e-5  # share of the cost that a search on averages leaves: the next one takes a step or two from there


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Tabular):
    """A fitted model.

    Args:
        model: the model that was fitted, with the values of the fit in it.
        problem: the least-squares problem at full resolution.
        z: its unknowns at the solution, shape (size,).
        cost: half the sum of squared weighted residuals, priors included.
        noise: the sensors' noise.
        iterations: of all searches together.
        status: `"converged"`, `"not converged"` or `"interrupted"`.
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

    @property
    def free(self) -> list[int]:
        """Numbers of the model's parameters that were fitted."""
        return list(self.problem.free)

    @cached_property
    def uncertainty(self) -> Uncertainty:
        """Of the free parameters; worked out when asked for, since a search asks of few of its many fits."""
        return uncertainty(self.problem, self.z)

    @cached_property
    def predictions(self) -> list[Prediction]:
        """The fitted runs as the fit predicts them; others are predicted by `predict`."""
        runs = []
        for bound, start in zip(self.problem.bound_runs, self.point.starts, strict=True):
            path = simulate(self.model, bound, self.point.values, start)
            runs.append(Prediction(Segment(bound.run, EVERYTHING, EVERYTHING), bound, path))
        return runs

    @property
    def rmse(self) -> float:
        """Root mean square error over all readings that count [K]."""
        return errors_of(self.predictions).rmse

    @property
    def summary(self) -> str:
        """How the search ended, and the error that is left, in one line."""
        return f"{self.status}, {len(self.free)} free parameters, RMSE {self.rmse:.3g} K"

    def to_pandas(self) -> pd.DataFrame:
        """A row for each parameter: name, value, standard error (NaN where undetermined), unit, whether it is free."""
        errors = self.standard_errors
        rows = [
            {
                "parameter": parameter.name,
                "value": parameter.value,
                "standard error": errors.get(parameter.name, float("nan")),
                "unit": parameter.declared.unit,
                "free": parameter.free,
            }
            for parameter in self.model.parameters
        ]
        return pd.DataFrame(rows, columns=["parameter", "value", "standard error", "unit", "free"])

    def table(self) -> FitTable:
        """The result as a model file keeps it, without infinite standard errors."""
        sources = {bound.run.source: bound.run.fingerprint for bound in self.problem.bound_runs}
        return FitTable(
            rmse=self.rmse,
            status=self.status,
            warnings=list(self.uncertainty.warnings),
            data=[DataTable(file=Path(source).name, sha256=digest) for source, digest in sources.items()],
            parameters={
                name: FittedTable(**entry | {"error": entry["error"] if isfinite(entry["error"]) else None})
                for name, entry in self._estimates.items()
            },
        )

    def as_json(self) -> dict[str, object]:
        """The result as other tools read it."""
        return {
            "rmse_fit": self.rmse,
            "status": self.status,
            "parameters": self._estimates,
            "correlations": self.uncertainty.correlations.tolist(),
            "warnings": list(self.uncertainty.warnings),
        }

    @property
    def _estimates(self) -> dict[str, dict[str, Any]]:
        """Value, standard error and unit of each free parameter by name."""
        free, errors = (self.model.parameters[index] for index in self.free), self.standard_errors
        return {one.name: {"value": one.value, "error": errors[one.name], "unit": one.declared.unit} for one in free}

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard error of each free parameter by name, in its unit; infinite where undetermined."""
        names = [self.model.parameters[index].name for index in self.problem.free]
        return dict(zip(names, self.uncertainty.standard_errors.tolist(), strict=True))


@one_blas_thread
def fit(
    model: Model,
    runs: Sequence[Run | BoundRun],
    *,
    symmetry_penalty: float = 0.0,
    sigma: FloatArray | None = None,
    guess: FloatArray | Point | None = None,
    iterations: int = 80,
    progress: Progress | None = None,
    keep: Keep | None = None,
    precision: float = PRECISION,
    free: Sequence[int] | None = None,
    tolerance: FloatArray | None = None,
) -> Fit:
    """Fit the free parameters, and the initial states of each run, to free-running simulations.

    Without a guess a search on averages of 10 s comes first; its start is the declared values, or the linear least
    squares of the integrated heat balance where those cost less.

    Args:
        model: the model.
        runs: the runs; all their readings count, unless they are bound to the model with those that do.
        symmetry_penalty: λ of the penalty on left-right differences.
        sigma: standard deviation that weighs each node [K], shape (nodes,); by default balanced between nodes with
            large and small excursions.
        guess: parameter values to start from, shape (m,), or a point with initial states; a point on averages is
            where a search that was cut off goes on.
        iterations: how many the last search may take.
        progress: called after each iteration.
        keep: called after each iteration with the best point so far.
        precision: share of the cost that is not worth another step of the last search.
        free: indices of the parameters to fit; the model's own free ones by default.
        tolerance: as for `Problem`; needs a `guess`.

    Raises:
        InputError: a run lacks an input, or measures none of the model's nodes.

    Example:
        >>> import lptn
        >>> loaded = lptn.load_model("examples/tclab/two_heaters.toml")
        >>> fitted = lptn.fit(loaded.model, loaded.runs(["examples/tclab/log.csv"]))
        >>> fitted
        <Fit: converged, 3 free parameters, RMSE 1.27 K>
        >>> fitted.to_pandas().loc[0, "parameter"]
        'capacity.heater*'
    """
    bound_runs = [run if isinstance(run, BoundRun) else bind(model, run) for run in runs]
    noise = estimate_noise(bound_runs, model.nodes)
    sigma = balanced_sigma(bound_runs, noise) if sigma is None else sigma
    problem = Problem(model, bound_runs, sigma, symmetry_penalty, free, tolerance)
    values, starts = (guess.values, guess.starts) if isinstance(guess, Point) else (guess, None)
    before = 0
    if values is None or (isinstance(guess, Point) and guess.averaged):
        averaged = [_coarse(model, bound) for bound in bound_runs]
        coarse = Problem(model, averaged, sigma, symmetry_penalty, free)
        z = coarse.guess(model.values if values is None else values, starts)
        if values is None:
            z = min(z, coarse.guess(integral_start(model, averaged, sigma)), key=coarse.cost)
        keep_coarse = None if keep is None else lambda z: keep(replace(coarse.point(z), averaged=True))
        rough = minimise(coarse, z, progress, keep=keep_coarse, precision=max(precision, ROUGH))
        before, point = rough.iterations, coarse.point(rough.z)
        z = problem.guess(point.values, point.starts)
        if rough.status == "interrupted":
            return _as_fit(problem, replace(rough, z=z, cost=problem.cost(z)), noise, before)
    else:
        balanced = integral_start(model, bound_runs, sigma)
        z = min((np.clip(problem.guess(own, starts), *problem.bounds) for own in (values, balanced)), key=problem.cost)
    keep_fine = None if keep is None else lambda z: keep(problem.point(z))
    rescued = precision <= PRECISION  # one that only ranks is left where it fails
    solution = minimise(problem, z, progress, iterations, keep=keep_fine, precision=precision, rescued=rescued)
    return _as_fit(problem, solution, noise, before + solution.iterations)


def _coarse(model: Model, bound: BoundRun) -> BoundRun:
    """The same run in steps of about 10 s, where it is long enough."""
    coarse_step = 10.0  # s; the first search is on averages so long: a tenth of the readings, near the same optimum
    least_coarse = 150  # steps that a run must keep for such averages
    factor = min(round(coarse_step / bound.run.step), len(bound) // least_coarse)
    if factor < 2:
        return bound
    coarse = bind(model, bound.run.coarsen(factor))
    left_out = np.isfinite(bound.measured) & ~bound.counted
    blocks = left_out[:, : len(coarse) * factor].reshape(len(model.nodes), -1, factor)
    return replace(coarse, counted=coarse.counted & ~blocks.any(axis=2))


def _as_fit(problem: Problem, solution: Solution, noise: Noise, iterations: int) -> Fit:
    model = problem.model.with_values(problem.point(solution.z).values)
    return Fit(model, problem, solution.z, solution.cost, noise, iterations, solution.status)


def finished(done: Fit, precision: float = PRECISION) -> Fit:
    """A fit that was ended early because it only ranked, gone on with to the end; arguments as for `tolerant`."""
    return tolerant(done, done.problem.tolerance, precision=precision)


@one_blas_thread
def tolerant(done: Fit, tolerance: FloatArray | None, *, precision: float = PRECISION) -> Fit:
    """A fit gone on with with another tolerance, see `Problem`; with none, it is plain least squares.

    Args:
        done: the fit.
        tolerance: what is left out of account.
        precision: share of the cost that is not worth another step.
    """
    old = done.problem
    problem = Problem(done.model, old.bound_runs, old.sigma, old.symmetry_penalty, old.free, tolerance)
    guess = problem.guess(done.point.values, done.point.starts)
    solution = minimise(problem, guess, precision=precision, rescued=precision <= PRECISION)
    return _as_fit(problem, solution, done.noise, done.iterations + solution.iterations)


# --- Checkpoints: the best point of a fit that is running, where the next attempt at the same fit starts ---


_EVERY = 3.0  # s between two writes


def fingerprint_of(text: str, logs: Iterable[tuple[str, str]], options: Mapping[str, object]) -> str:
    """What a fit depends on, as hexadecimal digits: the model's text, the logs' contents and names, the options.

    Args:
        text: the model file.
        logs: name and SHA-256 of each.
        options: whatever else changes the result; JSON must be able to hold it.
    """
    content = [text, [list(log) for log in logs], dict(options)]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


class Checkpoint:
    """One fit's best point, in a file of the user's cache.

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

    def load(self, model: Model, runs: int) -> Point | None:
        """The point where an earlier fit of this model to so many runs was cut off, `None` where there is none."""
        try:
            table = json.loads(self.path.read_text(encoding="utf-8"))
            averaged = bool(table["averaged"])
            values = np.array([float(table["values"][parameter.name]) for parameter in model.parameters])
            starts = [np.array([float(start[state]) for state in model.states]) for start in table["starts"]]
        except (OSError, ValueError, KeyError, TypeError):
            return None
        usable = len(starts) == runs and np.isfinite([*values, *np.ravel(starts)]).all()
        return Point(values, starts, averaged) if usable else None

    def offer(self, model: Model, point: Point) -> None:
        """Save a point, unless one was saved a moment ago."""
        if time.monotonic() - self._written >= self._every:
            self.save(model, point)

    def save(self, model: Model, point: Point) -> None:
        """Save a point, whole or not at all."""
        values = dict(zip((parameter.name for parameter in model.parameters), point.values.tolist(), strict=True))
        starts = [dict(zip(model.states, start.tolist(), strict=True)) for start in point.starts]
        with contextlib.suppress(OSError, InputError):
            if not self._folder.is_dir():
                self._folder.mkdir(parents=True)
            write_whole(self.path, json.dumps({"averaged": point.averaged, "values": values, "starts": starts}))
        self._written = time.monotonic()

    def remove(self) -> None:
        """Remove the point, the fit being done, and expired ones of other fits."""
        expired = 30 * 86400.0  # s; checkpoints of fits that nobody went on with for a month are removed
        with contextlib.suppress(OSError):
            self.path.unlink(missing_ok=True)
            oldest = time.time() - expired
            for other in self._folder.glob("*.json"):
                if other.stat().st_mtime < oldest:
                    other.unlink(missing_ok=True)
