"""What a kind of file is to the fuzzer: good ones, a way to spoil one, and the code that reads it."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random

EXAMPLES = Path(__file__).parents[2] / "examples"


@dataclass(frozen=True)
class Target:
    """One kind of file.

    Args:
        seeds: good files by name.
        spoil: makes a bad one of a good one, with the others at hand.
        read: reads it as the commands do, in the folder where it lies; `InputError` is the only exception that it
            may raise.
    """

    seeds: Callable[[], Mapping[str, bytes]]
    spoil: Callable[[Random, bytes, list[bytes]], bytes]
    read: Callable[[Path, Random], None]


def command(words: Sequence[str]) -> int:
    """Run `lptn`, which must end well, or with exit status 2 and one line; returns the status.

    Raises:
        AssertionError: it ended otherwise.
    """
    from lptn.cli.main import main

    said, status = io.StringIO(), 0
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        try:
            main(words)
        except SystemExit as stop:
            status = int(stop.code or 0)
    if status not in (0, 2) or (status == 2 and said.getvalue().count("\n") != 1):
        raise AssertionError(f"exit status {status}: {said.getvalue()}")
    return status
