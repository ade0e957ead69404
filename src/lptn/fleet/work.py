"""What a worker does: read one robot's logs, fit, and send back a few kilobytes."""

from __future__ import annotations

import pickle
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from lptn import __version__
from lptn.checkpoint import fingerprint_of
from lptn.errors import InputError, one_line
from lptn.evidence import evidence
from lptn.files import fingerprint
from lptn.for_json import finite
from lptn.interrupts import heard_interrupts
from lptn.on_evidence import fit_evidence
from lptn.opening import Opened

Status = Literal["fitted", "unchanged", "failed", "interrupted"]


@dataclass(frozen=True)
class Order:
    """What is the same for all robots of a fleet.

    Args:
        model: the model file opened, pickled: a few kilobytes, taken apart once in each worker.
        text: its text.
        mapped: `--map` options.
        mirror_weight: λ of the left-right regulariser, or `"auto"`.
        holdout_after: time [s] from which each robot's own logs are held out.
        number: different for each call: an executor that remembers results must not take those of other days.
    """

    model: bytes
    text: str
    mapped: tuple[str, ...] = ()
    mirror_weight: float | Literal["auto"] = 0.0
    holdout_after: float | None = None
    number: str = ""

    @property
    def options(self) -> dict[str, object]:
        """What a result depends on besides the model and the logs."""
        return {
            "lptn": __version__,  # another one may read, or fit, in another way
            "map": list(self.mapped),
            "mirror_weight": self.mirror_weight,
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
    def converged(self) -> bool:
        """Whether the search ended at an optimum."""
        return self.result.get("status") == "converged"

    @property
    def parameters(self) -> Mapping[str, Mapping[str, Any]]:
        """Value, standard error (`None` where undetermined) and unit of each parameter by name."""
        found: Mapping[str, Mapping[str, Any]] = self.result.get("parameters", {})
        return found

    @property
    def rmse(self) -> float:
        """Over the fitted readings [K]; NaN where nothing was fitted."""
        return float(self.result.get("rmse_fit", float("nan")))


def fit_robot(order: Order, name: str, logs: Sequence[str], known: str = "") -> Outcome:
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
    """What is told of a failure: a user's mistake as it is, anything else with its kind."""
    if isinstance(error, InputError):
        return str(error)
    return one_line(f"{type(error).__name__}: {error}").rstrip(": ")


def _fitted(order: Order, logs: Sequence[str]) -> tuple[dict[str, Any], str]:
    opened = _opened(order.model)
    notes: dict[str, None] = {}
    runs = opened.runs([Path(log) for log in logs], tell=lambda _, note: notes.setdefault(note))
    data = evidence(runs, holdout_after=order.holdout_after)
    found = fit_evidence(opened.model, data, order.mirror_weight)
    table = found.fit.table()
    more = {
        "rmse_holdout": found.holdout.rmse if found.holdout else None,
        "data": [x.model_dump() for x in table.data],
        "notes": list(notes),
    }
    result = found.fit.as_json() | more
    result.pop("correlations")  # grows with the square of the parameters
    return finite(result), opened.file.with_fit(table).text


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
def _opened(model: bytes) -> Opened:
    opened = pickle.loads(model)
    if not isinstance(opened, Opened):
        raise TypeError(f"expected an opened model, found {type(opened).__name__}")
    return opened
