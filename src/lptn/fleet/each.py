"""One model fitted to each robot of a fleet, and what came of it."""

from __future__ import annotations

import pickle
import uuid
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import closing, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from lptn.errors import InputError
from lptn.fleet.handing_out import Work, elsewhere, here, in_processes
from lptn.fleet.keeping import Shelf
from lptn.fleet.robots import Robot, robots_of
from lptn.fleet.spread import Outlier, Spread, outliers, spread_of
from lptn.fleet.work import Order, Outcome
from lptn.opening import GUESS, Opened, open_model

_IN_FLIGHT = 64
_A_WORKER = 2  # robots handed out for each process of our own


Report = Callable[[str], None]


@dataclass(frozen=True)
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

    @property
    def fitted(self) -> tuple[Outcome, ...]:
        """Those with a result, of this call or an earlier one."""
        return tuple(each for each in self.outcomes if each.status in ("fitted", "unchanged"))

    @property
    def failed(self) -> tuple[Outcome, ...]:
        """Those without."""
        return tuple(each for each in self.outcomes if each.status in ("failed", "interrupted"))

    def as_json(self) -> dict[str, object]:
        """The fleet as other tools read it."""
        return {
            "robots": {
                each.robot: {"status": each.status, "message": each.message or None, **each.result}
                for each in self.outcomes
            },
            "spread": {each.what: each.as_json() for each in self.spread},
            "outliers": [each.as_json() for each in self.outliers],
        }


def fit_each(
    model: Path | Opened,
    robots: Sequence[Robot] | Sequence[Path],
    *,
    into: Path | None = None,
    executor: Executor | None = None,
    jobs: int = 1,
    in_flight: int | None = None,
    mapped: Sequence[str] = (),
    mirror_weight: float | Literal["auto"] = 0.0,
    holdout_after: float | None = None,
    report: Report = lambda _: None,
    told: Callable[[Outcome], None] = lambda _: None,
) -> Fleet:
    """Fit one model to each robot's logs on its own.

    Logs are read by the workers, which must find them, and this package, where they are. What travels is the model
    and a few kilobytes of results; at most `in_flight` robots are handed out at a time. A robot that can't be fitted
    is an outcome of its own and stops no other.

    Args:
        model: the model file, or one that is open.
        robots: the robots, or files and folders as `robots_of` takes them.
        into: folder for one model and one record a robot, written as they come. A robot whose record was made from
            the same model, options and logs is not fitted again. Without it, outcomes hold the models' text.
        executor: where to work, such as `dask.distributed.Client(...).get_executor()`. Processes, please: fits in
            threads wait for each other.
        jobs: without an executor, how many processes of one's own; 1 works here.
        in_flight: most robots handed out and not yet done; by default 64, or two for each process of one's own.
        mapped: `--map` options; without effect on a model that is open.
        mirror_weight: λ of the left-right regulariser, or `"auto"` with `holdout_after`.
        holdout_after: time [s, in each log's clock] from which each robot's own logs are held out.
        report: told what is being done.
        told: given each outcome as it comes.

    Raises:
        InputError: the model, a place of logs or the folder can't be used, or another process works in the folder.
    """
    opened = model if isinstance(model, Opened) else open_model(model, mapped)
    if not opened.model.free:
        raise InputError(opened.file.path, "parameters", "none that is free", "one at least without fixed = true")
    words = (*(f"{key}={column}" for key, column in sorted(opened.mapped.items())), *[GUESS] * opened.guessing)
    order = Order(pickle.dumps(opened), opened.file.text, words, mirror_weight, holdout_after, uuid.uuid4().hex)
    fleet = _as_robots(robots)
    shelf = Shelf(into) if into is not None else None
    named = {robot.name: robot for robot in fleet}
    found: dict[str, Outcome] = {}
    count = _Count(len(fleet), report)
    work = Work(order, shelf)
    with shelf.alone() if shelf else nullcontext():
        if executor is not None:
            outcomes = elsewhere(work, fleet, executor, in_flight or _IN_FLIGHT)
        elif jobs > 1:
            outcomes = in_processes(work, fleet, jobs, in_flight or _A_WORKER * jobs)
        else:
            outcomes = here(work, fleet)
        with closing(outcomes):
            for outcome in outcomes:
                found[outcome.robot] = work.kept(outcome, named[outcome.robot])
                told(found[outcome.robot])
                count.add(outcome)
    ordered = tuple(found[robot.name] for robot in fleet)
    good = [each for each in ordered if each.status in ("fitted", "unchanged")]
    spread = spread_of(opened.model, good)
    return Fleet(ordered, spread, outliers(spread, good))


def _as_robots(robots: Sequence[Robot] | Sequence[Path]) -> list[Robot]:
    places = [each for each in robots if not isinstance(each, Robot)]
    fleet = [each for each in robots if isinstance(each, Robot)] + (robots_of(places) if places else [])
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


class _Count:
    """How far the fleet is; those that were fitted before are not counted, for they take no time."""

    def __init__(self, robots: int, report: Report) -> None:
        self._left, self._report = robots, report
        self._done = self._failed = 0
        report(f"fitting {robots} robots")

    def add(self, outcome: Outcome) -> None:
        """One more is done."""
        self._left -= 1
        self._done += outcome.status != "unchanged"
        self._failed += outcome.status in ("failed", "interrupted")
        if self._left:
            failed = f", {self._failed} failed" if self._failed else ""
            self._report(f"fitting robot {self._done + 1} of {self._done + self._left}{failed}")
