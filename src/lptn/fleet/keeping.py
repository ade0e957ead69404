"""Results of a fleet in a folder: one model and one record a robot, each written whole as it comes."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from lptn.errors import InputError
from lptn.files import write_whole
from lptn.fleet.work import Outcome

try:
    import fcntl
except ImportError:  # not on Windows, where two processes on one folder do the work twice
    fcntl = None  # type: ignore[assignment]

_PATIENCE = 5.0  # s; workers of a process that was killed hold its lock for a moment more


class Shelf:
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
            for each in (folder, folder / "models", folder / "records"):
                each.mkdir(exist_ok=True)
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
        if fcntl is None:
            yield
            return
        with (self.folder / ".lock").open("w") as stream:
            self._lock(stream.fileno())
            self._tidy()
            yield

    def _lock(self, handle: int) -> None:
        stop = time.monotonic() + _PATIENCE
        while True:
            try:
                return fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                if time.monotonic() > stop:
                    found = "another process that fits into this folder"
                    raise InputError(self.folder, "output", found, "a folder of its own for each") from error
                time.sleep(0.1)
            except OSError:
                return None  # a file system without locks

    def _tidy(self) -> None:
        """Throw away what a killed process was writing."""
        for folder in ("models", "records"):
            for half in (self.folder / folder).glob(".*.part"):
                half.unlink(missing_ok=True)

    def _record(self, robot: str) -> Path:
        return self.folder / "records" / f"{robot}.json"
