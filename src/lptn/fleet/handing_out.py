"""Robots handed to workers, a few at a time, and their results taken as they come."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from dataclasses import replace
from typing import Literal

from lptn.fleet.keeping import Shelf
from lptn.fleet.robots import Robot
from lptn.fleet.work import Order, Outcome, fit_robot, in_one_line
from lptn.workers import pool_of

_DIED = "its worker died (out of memory?)"
_Lost = Literal["out", "unsent"]


class Work:
    """What is handed out for each robot, and what is kept of it."""

    def __init__(self, order: Order, shelf: Shelf | None) -> None:
        self.order, self.shelf = order, shelf

    def task(self, robot: Robot) -> tuple[Order, str, list[str], str]:
        """Arguments of `fit_robot`."""
        earlier = self.shelf.kept(robot.name) if self.shelf else None
        logs = [str(log.absolute()) for log in robot.logs]
        return self.order, robot.name, logs, earlier.fingerprint if earlier else ""

    def kept(self, outcome: Outcome, robot: Robot) -> Outcome:
        """The outcome, once its files are written; a message names logs as they were given."""
        for log in robot.logs if outcome.message else ():
            outcome = replace(outcome, message=outcome.message.replace(str(log.absolute()), str(log)))
        if self.shelf is None or outcome.status not in ("fitted", "unchanged"):
            return outcome
        return self.shelf.kept(outcome.robot) or outcome if outcome.status == "unchanged" else self.shelf.keep(outcome)


def here(work: Work, fleet: Iterable[Robot]) -> Generator[Outcome]:
    """In this process, one after the other."""
    for robot in fleet:
        outcome = fit_robot(*work.task(robot))
        if outcome.status == "interrupted":
            raise KeyboardInterrupt
        yield outcome


def elsewhere(work: Work, fleet: Iterable[Robot], executor: Executor, in_flight: int) -> Generator[Outcome]:
    """In an executor of the caller's."""
    for robot, outcome in _handed_out(work, fleet, executor, in_flight):
        yield outcome if isinstance(outcome, Outcome) else Outcome(robot.name, "failed", message=_DIED)


def in_processes(work: Work, fleet: Sequence[Robot], jobs: int, in_flight: int) -> Generator[Outcome]:
    """In processes of one's own; where one dies, those who were out are tried alone, and the rest in new ones."""
    rest = list(fleet)
    while rest:
        lost: dict[_Lost, list[Robot]] = {"out": [], "unsent": []}
        with pool_of(min(jobs, len(rest))) as pool:
            for robot, outcome in _handed_out(work, rest, pool, in_flight):
                if isinstance(outcome, Outcome):
                    yield outcome
                else:
                    lost[outcome].append(robot)
        for robot in lost["out"]:
            with pool_of(1) as pool:
                yield from elsewhere(work, [robot], pool, 1)
        rest = lost["unsent"]


def _handed_out(
    work: Work, fleet: Iterable[Robot], executor: Executor, in_flight: int
) -> Iterator[tuple[Robot, Outcome | _Lost]]:
    """Outcomes as they come; which robots were out, or were not sent, when the executor broke."""
    out: dict[Future[Outcome], Robot] = {}
    try:
        for robot in fleet:
            while len(out) >= in_flight:
                yield from _done(out)
            try:
                out[executor.submit(fit_robot, *work.task(robot))] = robot
            except BrokenExecutor:
                yield robot, "unsent"
        while out:
            yield from _done(out)
    finally:
        for future in out:
            future.cancel()


def _done(out: dict[Future[Outcome], Robot]) -> Iterator[tuple[Robot, Outcome | _Lost]]:
    """Those that are done, once one is; they are no longer out."""
    for future in wait(out, return_when=FIRST_COMPLETED).done:
        robot = out.pop(future)
        try:
            yield robot, future.result()
        except BrokenExecutor:
            yield robot, "out"
        except (Exception, CancelledError) as error:
            yield robot, Outcome(robot.name, "failed", message=in_one_line(error))
