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

from lptn.basics.files import write_whole


@cache
def compiler() -> str | None:
    """The C compiler: `$CC`, or the system's; `None` where there is none."""
    return shutil.which(os.environ.get("CC", "cc"))


def shared_library(sources: Mapping[str, str], main: str, options: Sequence[str]) -> Path:
    """A shared library, from the cache or compiled anew.

    The cache is native code that is loaded without a question, so its folder is the user's alone.

    Args:
        sources: contents by file name.
        main: the one to compile; it includes the others.
        options: of the compiler.

    Returns:
        The library's path; its name is a hash of all that it was made from.

    Raises:
        OSError: no C compiler, or the cache can't be written, or others can write to it.
        subprocess.CalledProcessError: the compiler failed.
    """
    command = compiler()
    if command is None:
        raise OSError("no C compiler")
    content = "\n".join([command, *options, main, *(f"{name}\n{text}" for name, text in sorted(sources.items()))])
    path = _own_folder() / f"{hashlib.sha256(content.encode()).hexdigest()[:32]}.so"
    if not path.exists():
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            for file, text in sources.items():
                (folder / file).write_text(text, encoding="utf-8")
            compile_it = [command, *options, "-shared", "-fPIC", main, "-o", "library.so", "-lm"]
            subprocess.run(compile_it, cwd=folder, check=True, capture_output=True)
            write_whole(path, (folder / "library.so").read_bytes())
    return path


def _own_folder() -> Path:
    """Where libraries are kept, made if need be.

    Raises:
        OSError: it can't be made, or somebody else could put a library into it.
    """
    cache = platformdirs.user_cache_path("lptn")
    cache.mkdir(parents=True, exist_ok=True)
    folder = cache / "native"
    folder.mkdir(mode=0o700, exist_ok=True)
    if hasattr(os, "getuid"):  # Windows keeps a user's folders to the user
        status = folder.stat()
        if status.st_uid != os.getuid() or status.st_mode & 0o022:
            raise PermissionError(f"{folder}: others can write to it, so no native code is loaded from there")
    return folder
