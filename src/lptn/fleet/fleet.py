"""One model fitted to each robot of a fleet, resumable; what they have in common, and which stand apart or drift."""

from __future__ import annotations

import math
import pickle
import uuid
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing, nullcontext
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from lptn.basics.errors import InputError
from lptn.fleet.pooling import DRIFT, FleetParameter, RobotValue, Session, pool
from lptn.fleet.robots import RobotLogs, by_day, robots_of
from lptn.fleet.work import FleetFit, Outcome, ResultFolder, Status, Work, elsewhere, here, in_processes
from lptn.identify.data import GUESS, LoadedModel, load_model
from lptn.model.model import Model

# --- What the fleet has in common, and which robots stand apart or drift --------------------------


RMSE = "rmse"
_OF_RMSE = 0.05
"""Relative; standard error of an RMSE of some hundred independent errors."""
_ANY = date(2000, 1, 1)  # where no log says its day: all are of one


@dataclass(frozen=True)
class Deviation:
    """A robot that is not one of its likes, in one parameter.

    Args:
        robot: its name.
        of: the parameter over the fleet.
        drifts: whether it drifts, beside the fleet; else it stands apart.
    """

    robot: str
    of: FleetParameter
    drifts: bool

    @property
    def own(self) -> RobotValue:
        """The robot's value."""
        return self.of.robots[self.robot]

    @property
    def probability(self) -> float:
        """That it does."""
        return self.own.drifts if self.drifts else self.own.apart

    def __str__(self) -> str:
        """One line."""
        own, of = self.own, self.of
        sure = "more than 99 %" if self.probability > 0.995 else f"{100 * self.probability:.0f} %"  # as it is rounded
        if self.drifts:
            size, unit = (of.size, of.unit.replace("*", "·")) if of.size else (100.0, "%")
            change = f"{size * own.trend:+.2g} ± {size * own.trend_error:.2g} {unit} a month"
            since = f", seen since {own.seen}" if own.seen else ""
            return f"{self.robot}: {of.name} drifts by {change} beside its fleet ({sure}{since})"
        value, mean = of.value(own.value), of.value(of.mean)
        times = f"{value / mean:.2g} times the fleet's" if mean and value / mean > 0 else "far from the fleet's"
        return f"{self.robot}: {of.name} {times}: {value:.3g} against {mean:.3g} {of.unit} ({sure})"

    def as_json(self) -> dict[str, object]:
        """As other tools read it."""
        own, of = self.own, self.of
        value = of.value(own.value)
        per = of.size or value
        return {
            "robot": self.robot,
            "parameter": of.name,
            "unit": of.unit,
            "value": value,
            "error": own.error * per,
            "fleet": of.value(of.mean),
            "per_month": own.trend * per,
            "per_month_error": own.trend_error * per,
            "drifts": self.drifts,
            "probability": self.probability,
            "seen": str(own.seen) if own.seen else None,
        }


def pooled_of(
    model: Model, fitted: Sequence[Outcome], robots: Mapping[str, RobotLogs] | None = None
) -> tuple[FleetParameter, ...]:
    """The RMSE and each parameter over the robots that determine it.

    Args:
        model: the model that was fitted to each robot.
        fitted: robots with a result, or days of them.
        robots: by the outcomes' names, whose and of which day they are; by default a robot each, of one day.
    """
    declared = {parameter.name: parameter for parameter in model.parameters}
    whose = robots or {}
    unknown = max((robot.day for robot in whose.values() if robot.day), default=_ANY)
    told: dict[str, dict[str, tuple[float, float, str]]] = {RMSE: {}}
    for outcome in fitted:
        told[RMSE][outcome.robot] = outcome.rmse, _OF_RMSE * outcome.rmse, "K"
        for name, said in outcome.parameters.items():
            error = math.nan if said["error"] is None else said["error"]
            told.setdefault(name, {})[outcome.robot] = said["value"], error, said["unit"]
    parameters = []
    for name, entries in told.items():
        known = {robot: entry for robot, entry in entries.items() if math.isfinite(entry[1])}
        if not known:
            continue
        values = np.array([value for value, _, _ in known.values()])
        of_logarithm = (name == RMSE or (name in declared and declared[name].logarithmic)) and bool((values > 0).all())
        # What may be none at all changes by as much as it usually is where it ages, not by a share of that.
        usual = declared[name].declared.typical if name in declared else 0.0
        size = 0.0 if of_logarithm else (max(float(np.median(np.abs(values))), usual) or 1.0) / DRIFT
        sessions = []
        for called, (value, error, _) in known.items():
            robot = whose.get(called, RobotLogs(called, ()))
            x, e = (math.log(value), error / value) if of_logarithm else (value / size, error / size)
            sessions.append(Session(robot.of, robot.day or unknown, x, e))
        parameters.append(pool(sessions, name, next(iter(known.values()))[2], size))
    return tuple(parameters)


# --- One model fitted to each robot of a fleet, and what came of it -------------------------------


Report = Callable[[str], None]


@dataclass(frozen=True, repr=False)
class Fleet:
    """What became of every robot.

    Args:
        outcomes: one for each robot, or each of its days, in the order in which they were given.
        robots: by the outcomes' names, whose logs they are, and of which day.
        parameters: the RMSE and each parameter, pooled over the robots that were fitted.
    """

    outcomes: tuple[Outcome, ...]
    robots: Mapping[str, RobotLogs]
    parameters: tuple[FleetParameter, ...]

    def __repr__(self) -> str:
        return f"<Fleet: {len(self.fitted)} fitted, {len(self.failed)} failed, {len(self.deviations)} stand apart>"

    @property
    def deviations(self) -> list[Deviation]:
        """Robots that stand apart, or drift, more probably than not, the most probable first."""
        robots = [(of, robot) for of in self.parameters for robot in of.robots]
        found = [Deviation(robot, of, drifts) for of, robot in robots for drifts in (False, True)]
        return sorted((one for one in found if one.probability > 1 / 2), key=lambda one: -one.probability)

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
                outcome.robot: {
                    "status": outcome.status,
                    "message": outcome.message or None,
                    "robot": self.robots[outcome.robot].of,
                    "day": str(day) if (day := self.robots[outcome.robot].day) else None,
                    **outcome.result,
                }
                for outcome in self.outcomes
            },
            "parameters": {parameter.name: parameter.as_json() for parameter in self.parameters},
            "deviations": [deviation.as_json() for deviation in self.deviations],
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
    """Fit one model to each robot's logs on its own, those of each day apart where the logs' names say it; pool them.

    Logs are read by the workers, which must find them, and this package, where they are. What travels is the model
    and a few kilobytes of results; at most `in_flight` robots are handed out at a time. A robot that can't be fitted
    is an outcome of its own and stops no other.

    Args:
        model: the path of a model file, or a loaded model, which may have columns mapped.
        robots: the robots, or files and folders as `robots_of` takes them, by day.
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
    report("pooling")
    return Fleet(ordered, named, pooled_of(loaded.model, good, named))


def _as_robots(robots: Sequence[RobotLogs] | Sequence[Path]) -> list[RobotLogs]:
    places = [place for place in robots if not isinstance(place, RobotLogs)]
    fleet = [robot for robot in robots if isinstance(robot, RobotLogs)] + (by_day(robots_of(places)) if places else [])
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
    """One row a robot, or a day of it: status, errors [K], warnings, then parameters with standard errors, in SI units.

    A standard error is missing where the logs don't determine the parameter; all numbers of a robot that failed are.
    """
    names = list(dict.fromkeys(name for outcome in fleet.outcomes for name in outcome.parameters))
    rows = []
    for outcome in fleet.outcomes:
        of, result = fleet.robots[outcome.robot], outcome.result
        row: dict[str, object] = {
            "robot": of.of,
            "day": of.day,
            "fitted": outcome.fitted,
            "converged": outcome.converged,
            "search": result.get("status"),
            "rmse": outcome.rmse,
            "rmse_holdout": result.get("rmse_holdout"),
            "logs": len(result.get("data", ())),
            "warnings": "; ".join(result.get("warnings", ())),
            "message": outcome.message,
        }
        for name in names:
            parameter = outcome.parameters.get(name, {})
            row |= {name: parameter.get("value"), f"{name}.error": parameter.get("error")}
        rows.append(row)
    numbers = ["rmse_holdout", *names, *(f"{name}.error" for name in names)]
    return pd.DataFrame(rows).astype(dict.fromkeys(numbers, float))
