"""Which FMUs were written here: only their native code runs without being asked for.

For each there is an empty file that has the SHA-256 of the whole FMU for its name: processes that export at the same
time can't lose each other's.
"""

from __future__ import annotations

import hashlib
import os
from contextlib import suppress
from pathlib import Path

_MOST = 2000  # FMUs remembered; the oldest are forgotten first


def remember(content: bytes) -> None:
    """Note the SHA-256 of an FMU that was just written; without a writable home nothing is noted."""
    with suppress(OSError, RuntimeError):  # no home at all is a RuntimeError
        store = _store()
        store.mkdir(parents=True, exist_ok=True, mode=0o700)
        (store / _digest(content)).touch()
        for path in sorted(store.iterdir(), key=lambda path: path.stat().st_mtime)[:-_MOST]:
            path.unlink(missing_ok=True)


def is_own(content: bytes) -> bool:
    """Whether an FMU with these bytes was written here."""
    try:
        return (_store() / _digest(content)).is_file()
    except (OSError, RuntimeError):
        return False


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _store() -> Path:
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "lptn" / "own_fmus"
