"""Which FMUs were written here: only their native code runs without being asked for."""

from __future__ import annotations

import hashlib
import os
from contextlib import suppress
from pathlib import Path

from lptn.files import write_whole

_MOST = 2000  # FMUs remembered; the oldest are forgotten first


def remember(content: bytes) -> None:
    """Note the SHA-256 of an FMU that was just written; without a writable home nothing is noted."""
    known = [digest for digest in _known() if digest != _digest(content)]
    with suppress(OSError, ValueError):
        _store().parent.mkdir(parents=True, exist_ok=True)
        write_whole(_store(), "\n".join([*known, _digest(content)][-_MOST:]) + "\n")


def is_own(content: bytes) -> bool:
    """Whether an FMU with these bytes was written here."""
    return _digest(content) in _known()


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _store() -> Path:
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "lptn" / "exported_fmus"


def _known() -> list[str]:
    try:
        return _store().read_text(encoding="ascii").split()
    except (OSError, ValueError, RuntimeError):  # no home at all is a RuntimeError
        return []
