"""The best point of a fit that is running, kept where the next start of the same fit finds it."""

from __future__ import annotations

import contextlib
import hashlib
import json
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import platformdirs

from lptn.errors import InputError
from lptn.files import write_whole
from lptn.identify import Point
from lptn.model import Model

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
            values = np.array([float(kept["values"][unknown.name]) for unknown in model.unknowns])
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
        values = dict(zip((unknown.name for unknown in model.unknowns), point.values.tolist(), strict=True))
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
