"""One model fitted to each robot of a fleet, resumable; how each parameter spreads, and which robots stand apart."""

from __future__ import annotations

import math
import pickle
import uuid
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import closing, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd

from lptn.basics.errors import InputError
from lptn.basics.tables import write_table
from lptn.fleet.robots import RobotLogs, robots_of
from lptn.fleet.work import FleetFit, Outcome, ResultFolder, Status, Work, elsewhere, here, in_processes
from lptn.identify.data import GUESS, LoadedModel, load_model
from lptn.model.model import Model

# --- How each parameter spreads over a fleet, and which robots stand apart ------------------------


FAR = 4.0  # robust standard deviations
RMSE = "rmse"
_ROUNDING = 1e-6  # share of the size by which searches scatter


@dataclass(frozen=True)
class Spread:
    """One parameter over the robots that determine it.

    Args:
        what: the parameter's name, or `"rmse"`.
        unit: of all values here.
        robots: how many determine it.
        median: half of them lie below.
        quartiles: a quarter of them lies below the first, a quarter above the second.
        scale: 1.4826 times the median absolute deviation, of the logarithm where that is what is searched.
        logarithmic: whether robots are told apart by ratios.
    """

    what: str
    unit: str
    robots: int
    median: float
    quartiles: tuple[float, float]
    scale: float
    logarithmic: bool

    def as_json(self) -> dict[str, object]:
        """As other tools read it."""
        low, high = self.quartiles
        return {"unit": self.unit, "robots": self.robots, "median": self.median, "quartiles": [low, high]}


@dataclass(frozen=True)
class Outlier:
    """A robot that stands apart from its fleet.

    Args:
        robot: its name.
        spread: of the parameter, or the RMSE, over the fleet.
        value: the robot's.
        z: distance from the median in standard deviations: the fleet's robust one and the robot's own standard error
            together, so that a robot whose logs hardly determine the value does not count as different.
    """

    robot: str
    spread: Spread
    value: float
    z: float

    def __str__(self) -> str:
        """One line."""
        what, unit, median = self.spread.what, self.spread.unit, self.spread.median
        ratio = self.value / median if median else math.nan
        times = f"{ratio:.2g} times the fleet's" if ratio > 0 else "far from the fleet's"
        sizes = f"{self.value:.3g} against {median:.3g} {unit}"
        return f"{self.robot}: {what} {times}: {sizes} (robust z {self.z:+.1f})"

    def as_json(self) -> dict[str, object]:
        """As other tools read it."""
        numbers = {"value": self.value, "median": self.spread.median, "unit": self.spread.unit, "z": self.z}
        return {"robot": self.robot, "parameter": self.spread.what, **numbers}


def spread_of(model: Model, fitted: Sequence[Outcome]) -> tuple[Spread, ...]:
    """Median, quartiles and robust scatter of the RMSE and of each parameter, over robots that determine it.

    Args:
        model: the model that was fitted to each robot.
        fitted: robots with a result.
    """
    logarithmic = {parameter.name: parameter.logarithmic for parameter in model.parameters} | {RMSE: True}
    names = [RMSE, *dict.fromkeys(name for outcome in fitted for name in outcome.parameters)]
    spreads = []
    mad_to_sigma = 1.4826
    for name in names:
        entries = [entry for outcome in fitted if (entry := _entry(outcome, name)) is not None]
        if not entries:
            continue
        values = np.array([value for value, _, _ in entries])
        low, median, high = (float(share) for share in np.quantile(values, (0.25, 0.5, 0.75)))
        straight = logarithmic.get(name, False) and bool((values > 0).all())
        coordinate = np.log if straight else np.asarray
        apart = coordinate(values) - coordinate([median])
        scale = mad_to_sigma * float(np.median(np.abs(apart)))
        spreads.append(Spread(name, entries[0][2], len(entries), median, (low, high), scale, straight))
    return tuple(spreads)


def outliers(spread: Sequence[Spread], fitted: Sequence[Outcome]) -> tuple[Outlier, ...]:
    """Robots further than four robust standard deviations from the median, the furthest first.

    Args:
        spread: of the fleet.
        fitted: its robots.
    """
    result = []
    fewest = 5  # robots, below which nobody can be said to stand apart
    for distribution in spread:
        if distribution.robots < fewest:
            continue
        for outcome in fitted:
            entry = _entry(outcome, distribution.what)
            if entry is not None and abs(z := _distance(distribution, *entry[:2])) > FAR:
                result.append(Outlier(outcome.robot, distribution, entry[0], z))
    return tuple(sorted(result, key=lambda outlier: -abs(outlier.z)))


def _distance(spread: Spread, value: float, error: float) -> float:
    if spread.logarithmic:
        apart, own = math.log(value / spread.median), error / value
        rounding = _ROUNDING
    else:
        apart, own = value - spread.median, error
        rounding = _ROUNDING * max(abs(spread.median), abs(value))
    return apart / max(math.hypot(spread.scale, own), rounding, 1e-300)


def _entry(outcome: Outcome, name: str) -> tuple[float, float, str] | None:
    """Value, standard error and unit; `None` where the robot's logs don't determine it."""
    if name == RMSE:
        return (outcome.rmse, 0.0, "K") if math.isfinite(outcome.rmse) else None
    parameter: Any = outcome.parameters.get(name)
    if parameter is None or parameter["error"] is None or not math.isfinite(parameter["error"]):
        return None
    return float(parameter["value"]), float(parameter["error"]), str(parameter["unit"])


# --- One model fitted to each robot of a fleet, and what came of it -------------------------------


Report = Callable[[str], None]


@dataclass(frozen=True, repr=False)
class Fleet:
    """What became of every robot.

    Args:
        outcomes: one for each robot, in the order in which they were given.
        spread: of each parameter, and of the RMSE, over the robots that were fitted.
        outliers: the robots that stand apart, the furthest first.
    """

    outcomes: tuple[Outcome, ...]
    spread: tuple[Spread, ...]
    outliers: tuple[Outlier, ...]

    def __repr__(self) -> str:
        return f"<Fleet: {len(self.fitted)} fitted, {len(self.failed)} failed, {len(self.outliers)} stand apart>"

    @property
    def fitted(self) -> tuple[Outcome, ...]:
        """Those with a result, of this call or an earlier one."""
        return tuple(outcome for outcome in self.outcomes if outcome.fitted)

    @property
    def failed(self) -> tuple[Outcome, ...]:
        """Those without."""
        return tuple(outcome for outcome in self.outcomes if not outcome.fitted)

    def as_json(self) -> dict[str, object]:
        """The fleet as other tools read it."""
        return {
            "robots": {
                outcome.robot: {"status": outcome.status, "message": outcome.message or None, **outcome.result}
                for outcome in self.outcomes
            },
            "spread": {distribution.what: distribution.as_json() for distribution in self.spread},
            "outliers": [outlier.as_json() for outlier in self.outliers],
        }


def fit_each(
    model: Path | LoadedModel,
    robots: Sequence[RobotLogs] | Sequence[Path],
    *,
    into: Path | None = None,
    executor: Executor | None = None,
    jobs: int = 1,
    in_flight: int | None = None,
    symmetry_penalty: float | Literal["auto"] = 0.0,
    holdout_after: float | str | None = None,
    report: Report = lambda _: None,
    on_outcome: Callable[[Outcome], None] = lambda _: None,
) -> Fleet:
    """Fit one model to each robot's logs on its own.

    Logs are read by the workers, which must find them, and this package, where they are. What travels is the model
    and a few kilobytes of results; at most `in_flight` robots are handed out at a time. A robot that can't be fitted
    is an outcome of its own and stops no other.

    Args:
        model: the path of a model file, or a loaded model, which may have columns mapped.
        robots: the robots, or files and folders as `robots_of` takes them.
        into: folder for one model and one record a robot, written as they come. A robot whose record was made from
            the same model, options and logs is not fitted again. Without it, outcomes hold the models' text.
        executor: where to work, such as `dask.distributed.Client(...).get_executor()`. Processes, please: fits in
            threads wait for each other.
        jobs: without an executor, how many processes of one's own; 1 works here.
        in_flight: most robots handed out and not yet done; by default 64, or two for each process of one's own.
        symmetry_penalty: λ of the pull of left and right parameters towards each other; `"auto"` with
            `holdout_after`.
        holdout_after: time [s, in each log's clock] from which each robot's own logs are held out.
        report: called with what is being done, in words.
        on_outcome: called with each outcome as it comes.

    Raises:
        InputError: the model, a place of logs or the folder can't be used, or another process works in the folder.
    """
    loaded = model if isinstance(model, LoadedModel) else load_model(model)
    if not loaded.model.free:
        raise InputError(loaded.file.path, "parameters", "none that is free", "one at least without fixed = true")
    words = (*(f"{key}={column}" for key, column in sorted(loaded.mapped.items())), *[GUESS] * loaded.guessing)
    order = FleetFit(pickle.dumps(loaded), loaded.file.text, words, symmetry_penalty, holdout_after, uuid.uuid4().hex)
    fleet = _as_robots(robots)
    results = ResultFolder(into) if into is not None else None
    named = {robot.name: robot for robot in fleet}
    by_robot: dict[str, Outcome] = {}
    done: Counter[Status] = Counter()
    report(f"fitting {len(fleet)} robots")
    work = Work(order, results)
    with results.alone() if results else nullcontext():
        if executor is not None:
            outcomes = elsewhere(work, fleet, executor, in_flight or 64)
        elif jobs > 1:
            outcomes = in_processes(work, fleet, jobs, in_flight or 2 * jobs)
        else:
            outcomes = here(work, fleet)
        with closing(outcomes):
            for outcome in outcomes:
                by_robot[outcome.robot] = work.kept(outcome, named[outcome.robot])
                on_outcome(by_robot[outcome.robot])
                done[outcome.status] += 1
                if left := len(fleet) - done.total():
                    failed, new = done["failed"] + done["interrupted"], done.total() - done["unchanged"]
                    report(f"fitting robot {new + 1} of {new + left}" + (f", {failed} failed" if failed else ""))
    ordered = tuple(by_robot[robot.name] for robot in fleet)
    good = [outcome for outcome in ordered if outcome.fitted]
    spread = spread_of(loaded.model, good)
    return Fleet(ordered, spread, outliers(spread, good))


def _as_robots(robots: Sequence[RobotLogs] | Sequence[Path]) -> list[RobotLogs]:
    places = [place for place in robots if not isinstance(place, RobotLogs)]
    fleet = [robot for robot in robots if isinstance(robot, RobotLogs)] + (robots_of(places) if places else [])
    if not fleet:
        raise InputError("robots", "names", "none", "one robot or more")
    names: set[str] = set()
    for robot in fleet:  # a name becomes the name of files
        if not robot.name or robot.name.startswith(".") or robot.name != Path(robot.name).name:
            raise InputError("robots", "names", repr(robot.name), "a name without / that does not begin with a dot")
        if robot.name in names:
            raise InputError("robots", "names", f"{robot.name!r} twice", "robots of different names")
        names.add(robot.name)
    return fleet


# --- A fleet's results as a table, a row for each robot -------------------------------------------


def table_of(fleet: Fleet) -> pd.DataFrame:
    """One row a robot: status, errors [K], warnings, then value and standard error of each parameter in SI units.

    A standard error is missing where the logs don't determine the parameter; all numbers of a robot that failed are.
    """
    names = list(dict.fromkeys(name for outcome in fleet.outcomes for name in outcome.parameters))
    return pd.DataFrame([_row(outcome, names) for outcome in fleet.outcomes])


def write_tables(fleet: Fleet, folder: Path) -> None:
    """Write `fleet.csv` and `fleet.parquet`, each whole."""
    table = table_of(fleet)
    for name in ("fleet.csv", "fleet.parquet"):
        write_table(folder / name, table)


def _row(outcome: Outcome, names: list[str]) -> dict[str, object]:
    row: dict[str, object] = {
        "robot": outcome.robot,
        "fitted": outcome.fitted,
        "converged": outcome.converged,
        "search": outcome.result.get("status"),
        "rmse": outcome.rmse,
        "rmse_holdout": _number(outcome.result.get("rmse_holdout")),
        "logs": len(outcome.result.get("data", ())),
        "warnings": "; ".join(outcome.result.get("warnings", ())),
        "message": outcome.message,
    }
    for name in names:
        parameter = outcome.parameters.get(name, {})
        row[name] = _number(parameter.get("value"))
        row[f"{name}.error"] = _number(parameter.get("error"))
    return row


def _number(value: float | None) -> float:
    return float("nan") if value is None else value
