"""What a worker does for one robot, the folder that keeps its result, and how work is handed to any executor."""

from __future__ import annotations

import json
import os
import pickle
import time
from collections import deque
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from lptn import __version__
from lptn.basics.errors import InputError, one_line
from lptn.basics.files import fingerprint, finite, held, write_whole
from lptn.basics.processes import heard_interrupts, pool_of
from lptn.fleet.robots import RobotLogs
from lptn.identify.data import LoadedModel, split_data
from lptn.identify.fitting import fingerprint_of
from lptn.identify.validation import fit_split, holdout_errors

# --- What a worker does: read one robot's logs, fit, and send back a few kilobytes ----------------

Status = Literal["fitted", "unchanged", "failed", "interrupted"]


@dataclass(frozen=True)
class FleetFit:
    """What is the same for all robots of a fleet.

    Args:
        model: the loaded model, pickled: a few kilobytes, unpickled once in each worker.
        text: of the model file.
        mapped: `--map` options.
        symmetry_penalty: λ of the pull of left and right parameters towards each other, or `"auto"`.
        holdout_after: time [s] from which each robot's own logs are held out.
        number: different for each call: an executor that remembers results must not take those of other days.
    """

    model: bytes
    text: str
    mapped: tuple[str, ...] = ()
    symmetry_penalty: float | Literal["auto"] = 0.0
    holdout_after: float | str | None = None
    number: str = ""

    @property
    def options(self) -> dict[str, object]:
        """What a result depends on besides the model and the logs."""
        return {
            "lptn": __version__,  # another one may read, or fit, in another way
            "map": list(self.mapped),
            "symmetry_penalty": self.symmetry_penalty,
            "holdout_after": self.holdout_after,
        }


@dataclass(frozen=True)
class Outcome:
    """What became of one robot.

    Args:
        robot: its name.
        status: `"fitted"`; `"unchanged"`: an earlier result still holds; `"failed"`; `"interrupted"`.
        fingerprint: of model, options and logs.
        message: why it failed, one line.
        result: `Fit.as_json()`, with `rmse_holdout`, the logs' names and SHA-256, notes on what was guessed in them or
            looks wrong, and the seconds it took.
        text: the fitted model file, empty once it is kept in a folder.
    """

    robot: str
    status: Status
    fingerprint: str = ""
    message: str = ""
    result: Mapping[str, Any] = field(default_factory=dict)
    text: str = ""

    @property
    def fitted(self) -> bool:
        """Whether there is a result, of this call or an earlier one."""
        return self.status in ("fitted", "unchanged")

    @property
    def converged(self) -> bool:
        """Whether the search ended at an optimum."""
        return self.result.get("status") == "converged"

    @property
    def parameters(self) -> Mapping[str, Mapping[str, Any]]:
        """Value, standard error (`None` where undetermined) and unit of each parameter by name."""
        parameters: Mapping[str, Mapping[str, Any]] = self.result.get("parameters", {})
        return parameters

    @property
    def rmse(self) -> float:
        """Over the fitted readings [K]; NaN where nothing was fitted."""
        return float(self.result.get("rmse_fit", float("nan")))


def fit_robot(order: FleetFit, name: str, logs: Sequence[str], known: str = "") -> Outcome:
    """Fit one robot's logs; whatever goes wrong with them is an outcome, not an exception.

    Args:
        order: model and options.
        name: the robot's.
        logs: its files; they are read here, where the worker is.
        known: fingerprint of a result that is kept already.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed in the process that does the work.
    """
    started = time.perf_counter()
    try:
        with heard_interrupts():
            key = fingerprint_of(order.text, _contents(logs), order.options)
            if key == known:
                return Outcome(name, "unchanged", key)
            result, text = _fitted(order, logs)
    except Exception as error:  # one robot's logs must not end the work on all others
        return Outcome(name, "failed", message=in_one_line(error))
    status: Status = "interrupted" if result["status"] == "interrupted" else "fitted"
    return Outcome(name, status, key, result=result | {"seconds": time.perf_counter() - started}, text=text)


def in_one_line(error: BaseException) -> str:
    """A failure in one line: a user's mistake as it is, anything else with its kind."""
    if isinstance(error, InputError):
        return str(error)
    return one_line(f"{type(error).__name__}: {error}").rstrip(": ")


def _fitted(order: FleetFit, logs: Sequence[str]) -> tuple[dict[str, Any], str]:
    loaded = _unpickled(order.model)
    notes: dict[str, None] = {}
    runs = loaded.runs([Path(log) for log in logs], notify=lambda _, note: notes.setdefault(note))
    data = split_data(runs, holdout_after=order.holdout_after)
    done, _ = fit_split(loaded.model, data, order.symmetry_penalty)
    held = holdout_errors(done, data.holdout)
    table = done.table()
    more = {
        "rmse_holdout": held.rmse if held else None,
        "data": [x.model_dump() for x in table.data],
        "notes": list(notes),
    }
    result = done.as_json() | more
    result.pop("correlations")  # grows with the square of the parameters
    return finite(result), loaded.file.with_fit(table).text


def _contents(logs: Sequence[str]) -> list[tuple[str, str]]:
    """Name and SHA-256 of each file of each log; a bag is a folder of files."""
    try:
        return [
            (str(file.relative_to(Path(log).parent)), fingerprint(file))
            for log in logs
            for file in (sorted(Path(log).iterdir()) if Path(log).is_dir() else [Path(log)])
            if file.is_file() or not file.exists()
        ]
    except OSError as error:
        raise InputError(str(error.filename), "log", error.strerror or str(error), "a file that can be read") from error


@lru_cache(maxsize=2)
def _unpickled(model: bytes) -> LoadedModel:
    loaded: LoadedModel = pickle.loads(model)
    return loaded


# --- Results of a fleet in a folder: one model and one record a robot, each written whole as it comes ---


_PATIENCE = 5.0  # s; workers of a process that was killed hold its lock for a moment more


class ResultFolder:
    """`models/<robot>.toml` and `records/<robot>.json` in a folder.

    The record is written last: where it stands, the model stands.

    Args:
        folder: it, and the two in it, are made if need be.

    Raises:
        InputError: the folder can't be made.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            for part in (folder, folder / "models", folder / "records"):
                part.mkdir(exist_ok=True)
        except OSError as error:
            raise InputError(folder, "output", error.strerror or str(error), "a folder, or room for one") from error

    def model(self, robot: str) -> Path:
        """Where a robot's fitted model stands."""
        return self.folder / "models" / f"{robot}.toml"

    def kept(self, robot: str) -> Outcome | None:
        """A robot's earlier result; `None` where there is none that is whole."""
        try:
            read = json.loads(self._record(robot).read_text(encoding="utf-8"))
            whole = self.model(robot).is_file() and isinstance(read["result"]["parameters"], dict)
            return Outcome(robot, "unchanged", str(read["fingerprint"]), result=read["result"]) if whole else None
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def keep(self, outcome: Outcome) -> Outcome:
        """Write a fitted robot; the outcome without the model's text."""
        self._record(outcome.robot).unlink(missing_ok=True)  # an old record must not vouch for a new model
        write_whole(self.model(outcome.robot), outcome.text)
        record = {"robot": outcome.robot, "fingerprint": outcome.fingerprint, "result": outcome.result}
        write_whole(self._record(outcome.robot), json.dumps(record, indent=2) + "\n")
        return replace(outcome, text="")

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Within it no other process fits into the folder.

        Raises:
            InputError: another one does.
        """
        stop = time.monotonic() + _PATIENCE
        while (handle := held(self.folder / ".lock")) is None:
            if time.monotonic() > stop:
                problem = "another process that fits into this folder"
                raise InputError(self.folder, "output", problem, "a folder of its own for each")
            time.sleep(0.1)
        try:
            for folder in ("models", "records"):  # what a killed process was writing
                for half in (self.folder / folder).glob(".*.part"):
                    half.unlink(missing_ok=True)
            yield
        finally:
            os.close(handle)

    def _record(self, robot: str) -> Path:
        return self.folder / "records" / f"{robot}.json"


# --- Robots handed to workers, a few at a time, and their results taken as they come --------------


_DIED = "its worker died (out of memory?)"


@dataclass(frozen=True)
class Work:
    """The task of each robot, and what is kept of its outcome."""

    order: FleetFit
    results: ResultFolder | None

    def task(self, robot: RobotLogs) -> tuple[FleetFit, str, list[str], str]:
        """Arguments of `fit_robot`."""
        earlier = self.results.kept(robot.name) if self.results else None
        logs = [str(log.absolute()) for log in robot.logs]
        return self.order, robot.name, logs, earlier.fingerprint if earlier else ""

    def kept(self, outcome: Outcome, robot: RobotLogs) -> Outcome:
        """The outcome, once its files are written; a message names logs as they were given."""
        for log in robot.logs if outcome.message else ():
            outcome = replace(outcome, message=outcome.message.replace(str(log.absolute()), str(log)))
        if self.results is None or not outcome.fitted:
            return outcome
        earlier = self.results.kept(outcome.robot) if outcome.status == "unchanged" else self.results.keep(outcome)
        return earlier or outcome


def here(work: Work, fleet: Iterable[RobotLogs]) -> Generator[Outcome]:
    """In this process, one after the other."""
    for robot in fleet:
        outcome = fit_robot(*work.task(robot))
        if outcome.status == "interrupted":
            raise KeyboardInterrupt
        yield outcome


def elsewhere(work: Work, fleet: Iterable[RobotLogs], executor: Executor, in_flight: int) -> Generator[Outcome]:
    """In an executor of the caller's."""
    left = deque(fleet)
    for robot, outcome in _handed_out(work, left, executor, in_flight):
        yield outcome or Outcome(robot.name, "failed", message=_DIED)
    for robot in left:
        yield Outcome(robot.name, "failed", message=_DIED)


def in_processes(work: Work, fleet: Iterable[RobotLogs], jobs: int, in_flight: int) -> Generator[Outcome]:
    """In processes of one's own; where one dies, those who were out are tried alone, and the rest in new ones."""
    left = deque(fleet)
    while left:
        lost = []
        with pool_of(min(jobs, len(left))) as pool:
            for robot, outcome in _handed_out(work, left, pool, in_flight):
                if outcome is None:
                    lost.append(robot)
                else:
                    yield outcome
        for robot in lost:
            with pool_of(1) as pool:
                yield from elsewhere(work, [robot], pool, 1)


def _handed_out(
    work: Work, left: deque[RobotLogs], executor: Executor, in_flight: int
) -> Iterator[tuple[RobotLogs, Outcome | None]]:
    """Outcomes as they come, none of robots that were out when the executor broke; those it was not given are left."""
    out: dict[Future[Outcome], RobotLogs] = {}
    try:
        while True:
            with suppress(BrokenExecutor):
                while left and len(out) < in_flight:
                    future = executor.submit(fit_robot, *work.task(left[0]))
                    out[future] = left.popleft()
            if not out:
                return
            for future in wait(out, return_when=FIRST_COMPLETED).done:
                robot, outcome = out.pop(future), None
                try:
                    outcome = future.result()
                except BrokenExecutor:
                    pass
                except (Exception, CancelledError) as error:
                    outcome = Outcome(robot.name, "failed", message=in_one_line(error))
                yield robot, outcome
    finally:
        for future in out:
            future.cancel()
