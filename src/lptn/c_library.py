"""C sources as a shared library, compiled once and kept in the user's cache."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import platformdirs

from lptn.files import write_whole


@cache
def compiler() -> str | None:
    """The C compiler: `$CC`, or the system's; `None` where there is none."""
    return shutil.which(os.environ.get("CC", "cc"))


def shared_library(sources: Mapping[str, str], main: str, options: Sequence[str]) -> Path:
    """A shared library, from the cache or built anew.

    Args:
        sources: contents by file name.
        main: the one to compile; it takes in the others.
        options: of the compiler.

    Raises:
        OSError: no C compiler, or the cache can't be written.
        subprocess.CalledProcessError: the compiler failed.
    """
    command = compiler()
    if command is None:
        raise OSError("no C compiler")
    told = "\n".join([command, *options, main, *(f"{name}\n{text}" for name, text in sorted(sources.items()))])
    path = platformdirs.user_cache_path("lptn") / f"{hashlib.sha256(told.encode()).hexdigest()[:32]}.so"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            for file, text in sources.items():
                (folder / file).write_text(text, encoding="utf-8")
            words = [command, *options, "-shared", "-fPIC", main, "-o", "made.so", "-lm"]
            subprocess.run(words, cwd=folder, check=True, capture_output=True)
            write_whole(path, (folder / "made.so").read_bytes())
    return path
