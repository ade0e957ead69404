"""The command `lptn`: a thin wrapper of the library, one file a command."""

from __future__ import annotations

import atexit
import gc
import os
import re
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from traceback import walk_tb
from typing import Annotated

import cyclopts
from cyclopts import Parameter as Option

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

from lptn.basics.errors import InputError
from lptn.basics.processes import heard_interrupts
from lptn.cli.completion import add_completion
from lptn.cli.terminal import complain, library_log_shown, spared_closed_pipes

app = cyclopts.App(
    name="lptn",
    help="""Thermal networks of electric robot joints: fit, compare, and find the physical effect that is missing.

    Example: lptn improve leg.toml monday.parquet --holdout friday.parquet -o better.toml --report story.html""",
    help_format="plaintext",
    default_parameter=Option(
        negative="", show_default=lambda value: None if value in (None, "", False) else str(value)
    ),
    suppress_keyboard_interrupt=False,  # `main` says what becomes of the files
)
_COMMANDS = (
    "new check fit fleet compare diagnose add improve effects simulate report forecast monitor watch fmu cosim export "
    "trade plan motor open"
)
for _name in _COMMANDS.split():  # a file of its own each
    app.command(getattr(import_module(f"lptn.cli.{_name}"), _name), name=_name)
add_completion(app)
app.meta.group_parameters = cyclopts.Group("Every command", sort_key=99)
app.meta.suppress_keyboard_interrupt = False


@app.meta.default
def _command_of(
    *words: Annotated[str, Option(show=False, allow_leading_hyphen=True)],
    verbose: Annotated[bool, Option(name=["--verbose", "-v"])] = False,
    quiet: Annotated[bool, Option(name=["--quiet", "-q"])] = False,
) -> None:
    """Run the command that words make.

    Args:
        verbose: Also print what is being done.
        quiet: Print only the answer, without progress, warnings and tables.
    """
    if verbose and quiet:
        raise InputError("command line", "--verbose", "--quiet beside it", "one of the two")
    with library_log_shown(verbose, quiet):
        app(words, exit_on_error=False, print_error=False)


_MADE = 100_000
"""Objects made between two searches for garbage, in place of some hundreds: imports make as many and keep them all, and
to search among these took a twentieth of a short command's time."""


def main(words: Sequence[str] | None = None) -> None:
    """Run the command line; a user's mistake is one line and exit status 2.

    Args:
        words: what stands behind `lptn`; by default what the shell gave, and the process ends with the command.
    """
    if words is not None:
        _obey(words)
        return
    gc.set_threshold(_MADE)
    status: object = 0
    try:
        _obey(sys.argv[1:])
    except SystemExit as stop:
        status = stop.code
    # Arrow's threads may still free memory, which aborts an interpreter that is shutting down.
    atexit._run_exitfuncs()
    for stream in filter(None, (sys.stdout, sys.stderr)):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(status if isinstance(status, int) else int(status is not None))


def _obey(words: Sequence[str]) -> None:
    try:
        with spared_closed_pipes(), heard_interrupts():
            _refuse_too_little_memory()
            app.meta(words, exit_on_error=False, print_error=False)
    except InputError as error:
        complain(error)
        sys.exit(2)
    except cyclopts.CycloptsError as error:
        complain(f"{error} ({_hint(words)})")
        sys.exit(2)
    except KeyboardInterrupt:
        complain("stopped; nothing was written")
        sys.exit(130)
    except Exception as error:
        if (line := _of_the_machine(error)) is None:
            raise  # a bug of this package: the traceback says where
        complain(line)
        sys.exit(2)


_NO_MEMORY = re.compile(r"bad_alloc|failed to map segment|[Cc]annot allocate memory|can't start new thread")
"""What C++, the dynamic loader and threads say where Python would raise a `MemoryError`."""


def _of_the_machine(error: Exception) -> str | None:
    """The message for errors of the machine: no memory, a full disk, a folder that was deleted."""
    if isinstance(error, MemoryError):
        return f"not enough memory: {error}" if str(error) else "not enough memory"
    if _NO_MEMORY.search(str(error)):
        return "not enough memory"
    if isinstance(error, OSError):
        # Of what is gone the system names all but the folder in which the command runs.
        nameless = "the current folder" if isinstance(error, FileNotFoundError) else "system"
        return f"{error.filename or nameless}: {error.strerror or error}"
    importing = any(frame.f_code.co_name == "<module>" for frame, _ in walk_tb(error.__traceback__))
    if isinstance(error, ImportError) or importing:
        return f"a library can't be loaded: {(str(error).strip().splitlines() or [type(error).__name__])[-1]}"
    return None


_LEAST_MEMORY = (
    1_200_000 * 1024
)  # bytes of addresses: the libraries of a report map 1.1 GB; OpenBLAS ends without a word


def _refuse_too_little_memory() -> None:
    """Refuse a `ulimit -v` under which numerical libraries would break off or wait without end.

    Raises:
        MemoryError: it is too low.
    """
    most = -1 if resource is None else resource.getrlimit(resource.RLIMIT_AS)[0]
    if 0 <= most < _LEAST_MEMORY:
        raise MemoryError(
            f"`ulimit -v` allows {most // 10**6} MB, and numerical libraries need {_LEAST_MEMORY // 10**6}"
        )


_LOOKS_LIKE_A_FILE = re.compile(r"-[^-].*\.\w+")


def _hint(words: Sequence[str]) -> str:
    """How to correct the command line, in particular a file name that looks like an option."""
    for word in words:
        if _LOOKS_LIKE_A_FILE.fullmatch(word) or (word[:1] == "-" and word not in ("-", "--") and Path(word).is_file()):
            return f"a file of the name {word} is written ./{word}"
    return "`lptn --help` shows how"


if __name__ == "__main__":
    main()
