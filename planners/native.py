"""C sources of a planner as a shared library for Python, kept in the user's cache."""

from __future__ import annotations

import hashlib
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

import platformdirs

from lptn.compiled import compiler
from lptn.files import write_whole

OPTIONS = ("-std=c99", "-O2", "-ftree-vectorize", "-ffp-contract=off")
"""For the robot too: without contraction it computes the same digits as Python does here."""


def library(sources: Mapping[str, str], main: str) -> Path:
    """A shared library, from the cache or built anew.

    Args:
        sources: contents by file name.
        main: the one to compile; it takes in the others.

    Raises:
        OSError: no C compiler, or the cache can't be written.
        subprocess.CalledProcessError: the compiler failed.
    """
    command = compiler()
    if command is None:
        raise OSError("no C compiler")
    told = "\n".join([command, *OPTIONS, main, *(f"{name}\n{text}" for name, text in sorted(sources.items()))])
    path = platformdirs.user_cache_path("lptn") / f"planner-{hashlib.sha256(told.encode()).hexdigest()[:32]}.so"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            for file, text in sources.items():
                (folder / file).write_text(text, encoding="utf-8")
            words = [command, *OPTIONS, "-shared", "-fPIC", main, "-o", "planner.so", "-lm"]
            subprocess.run(words, cwd=folder, check=True, capture_output=True)
            write_whole(path, (folder / "planner.so").read_bytes())
    return path
