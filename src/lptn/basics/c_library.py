"""C sources as a shared library, compiled once and kept in the user's cache."""

from __future__ import annotations

import hashlib
import logging
import math
import os
import shlex
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

import platformdirs

from lptn.basics.errors import InputError
from lptn.basics.files import fingerprint, write_whole
from lptn.basics.own_folder import is_own_file, own_folder

_LONGEST = 600.0  # s, of one compilation: what is compiled here takes seconds, on a busy machine a minute
_DIGITS = 32  # of a hash in a library's name


def compiler() -> tuple[str, ...] | None:
    """The C compiler with the flags that stand behind it: `$CC`, or the system's; `None` where there is none."""
    try:
        named = shlex.split(os.environ.get("CC", ""))
    except ValueError:  # a quotation mark that is not closed
        return None
    path = next((path for path in map(shutil.which, named[:1] or ("cc", "gcc", "clang")) if path), None)
    return None if path is None else (path, *named[1:])


def shared_library(sources: Mapping[str, str], main: str, options: Sequence[str]) -> Path:
    """A shared library, from the cache or compiled anew.

    The cache is native code that is loaded without a question, so its folder is the user's alone, and a file in it is
    taken only if it is whole. Where it can't be used (a full disk, a folder that others can write to), that is said and
    the library is this process's own.

    Args:
        sources: contents by file name.
        main: the one to compile; it includes the others.
        options: of the compiler.

    Returns:
        The library's path; its name is a hash of all that it was made from, and one of its bytes.

    Raises:
        OSError: no C compiler, or it does not come to an end, or there is no place to write at all.
        subprocess.CalledProcessError: the compiler failed.
    """
    command = compiler()
    if command is None:
        raise OSError("no C compiler")
    content = "\n".join([*command, *options, main, *(f"{name}\n{text}" for name, text in sorted(sources.items()))])
    name = hashlib.sha256(content.encode()).hexdigest()[:_DIGITS]
    try:
        folder = own_folder(platformdirs.user_cache_path("lptn") / "native")
    except OSError as error:
        folder = _of_this_process(f"{error.filename}: {error.strerror}" if error.filename else str(error))
    for path in folder.glob(f"{name}-*.so"):
        # Whole: a file of the user's, no link to elsewhere, with the bytes that its name says.
        if is_own_file(path) and fingerprint(path)[:_DIGITS] == path.stem.partition("-")[2]:
            with suppress(OSError):
                path.touch()  # it is in use
            return path
        path.unlink(missing_ok=True)
    oldest = time.time() - 30 * 86400.0  # s; what nobody asked for in a month, or the cache would only grow
    for path in folder.glob("*.so"):
        with suppress(OSError):  # another process removes it
            if path.lstat().st_mtime < oldest:
                path.unlink()
    with tempfile.TemporaryDirectory() as scratch:
        for file, text in sources.items():
            (Path(scratch) / file).write_text(text, encoding="utf-8")
        run_compiler([*command, *options, "-shared", "-fPIC", main, "-o", "library.so", "-lm"], Path(scratch))
        library = (Path(scratch) / "library.so").read_bytes()
    path = folder / f"{name}-{hashlib.sha256(library).hexdigest()[:_DIGITS]}.so"
    try:
        write_whole(path, library)
    except InputError as error:
        path = _of_this_process(f"{folder}: {error.found}") / path.name
        path.write_bytes(library)
    return path


@cache
def _of_this_process(reason: str) -> Path:
    """A folder of this process alone, removed with it."""
    logging.getLogger("lptn").warning("%s; what is compiled is not kept, which costs some seconds each time", reason)
    _temporary.append(tempfile.TemporaryDirectory(prefix="lptn-native-"))
    return Path(_temporary[-1].name)


_temporary: list[tempfile.TemporaryDirectory[str]] = []  # until the process ends


def run_compiler(
    command: Sequence[str],
    folder: Path,
    environment: Mapping[str, str] | None = None,
    still: Callable[[], None] = lambda: None,
    patience: float = math.inf,
) -> None:
    """Run a compiler; what it started ends with it, in the time that it has or at Ctrl-C.

    Args:
        command: what to run.
        folder: where.
        environment: its environment variables; this process's by default.
        still: called where it takes longer than `patience`.
        patience: s.

    Raises:
        OSError: it can't be started, or does not come to an end.
        subprocess.CalledProcessError: it failed, with what it said as `stderr`.
    """
    process = subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,  # a program that is no compiler may wait for a line
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        start_new_session=True,  # a compiler is several processes
    )
    try:
        try:
            _, said = process.communicate(timeout=min(patience, _LONGEST))
        except subprocess.TimeoutExpired:
            still()
            _, said = process.communicate(timeout=max(0.0, _LONGEST - patience))
    except BaseException as error:
        with suppress(ProcessLookupError):
            if hasattr(os, "killpg"):
                os.killpg(process.pid, signal.SIGKILL)
            else:  # Windows
                process.kill()
        process.communicate()
        if isinstance(error, subprocess.TimeoutExpired):
            raise TimeoutError(f"{command[0]}: no end of the compilation after {_LONGEST:g} s") from error
        raise
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command, stderr=said)
