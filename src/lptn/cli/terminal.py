"""The terminal: what is being done and for how long, what the library logs, tables, JSON, readers that went away."""

from __future__ import annotations

import json
import logging
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from shutil import get_terminal_size
from textwrap import fill
from typing import Any, TextIO, cast

from rich.console import Console
from rich.table import Table
from rich.text import Text

from lptn.basics.errors import one_line
from lptn.basics.files import finite, write_whole
from lptn.basics.progress import ProgressLine, library_log_to
from lptn.basics.words import BOUND, UNIT_BEHIND
from lptn.report.sentences import Sentence

out = Console(highlight=False, soft_wrap=True)
err = Console(stderr=True, highlight=False, soft_wrap=True)


# --- What is being done: one line on the error stream, with its time once it takes long ----------------


_MINUTE = 60.0  # s between two lines where nobody watches


class ProgressOfALongJob(ProgressLine):
    """The same for a pipe or a batch job: a line a minute at most."""

    def __init__(self, first: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._told = clock()
        super().__init__(first, clock)

    def say(self, message: str) -> None:
        """Say what is being done now; it is printed once a minute has passed."""
        super().say(message)
        if self._clock() - self._told >= _MINUTE:
            self._told = self._clock()
            complain(self)


class _LibraryLog(logging.Handler):
    """What the library logs: progress goes into the line while there is one, a warning is a line of its own."""

    line: ProgressLine | None = None
    own_line = logging.WARNING  # the level from which on a message is a line of its own

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno >= self.own_line:
            complain(record.getMessage())
        elif self.line is not None:
            self.line.say(record.getMessage())


_library_log = _LibraryLog(logging.INFO)


@contextmanager
def library_log_shown(verbose: bool = False, quiet: bool = False) -> Iterator[None]:
    """Within it the terminal shows what the library logs.

    Args:
        verbose: each message as a line of its own, progress too.
        quiet: nothing; tables beside an answer are left out, too.
    """
    _library_log.own_line = logging.INFO if verbose else logging.CRITICAL if quiet else logging.WARNING
    try:
        with library_log_to(_library_log):
            yield
    finally:
        _library_log.own_line = logging.WARNING


def is_quiet() -> bool:
    """Whether the answer alone was asked for, without tables beside it."""
    return _library_log.own_line > logging.WARNING


@contextmanager
def progress(first: str) -> Iterator[Callable[[str], None]]:
    """A line that says what is being done, from 2 s on with its time; where nobody watches, a line a minute at most.

    It follows what the library logs, and what is given to the function that it yields. What is said as "7 of 20" also
    gets the time that is left.
    """
    if _library_log.own_line != logging.WARNING:  # each message is a line, or none is
        yield lambda message: logging.getLogger("lptn").info(message)
        return
    watched = err.is_terminal
    line = _library_log.line = ProgressLine(first) if watched else ProgressOfALongJob(first)
    try:
        with err.status(line) if watched else nullcontext():
            yield line.say
    finally:
        _library_log.line = None


def complain(message: object) -> None:
    """One line on the error stream."""
    print(f"lptn: {one_line(message)}", file=sys.stderr)


# --- Results: tables for people, JSON for programs --------------------------------------------------------


_WIDEST = 100_000  # characters of a row in a pipe; more than names and numbers ever fill


def show_table(heads: Sequence[str], rows: Iterable[Sequence[str]], title: str = "", most: int | None = None) -> None:
    """Print a table without lines and without cutting a cell.

    On a terminal long names and texts are folded, and a table of few rows that is too wide even so is turned, each row
    a column; into a pipe or a file each row is one line, as wide as it has to be.

    Args:
        heads: of the columns; those of numbers begin with ">", which aligns them right.
        rows: the cells.
        title: a line above it.
        most: how many rows are printed; a line counts the others.
    """
    every = [list(row) for row in rows]
    rows = every[:most]
    if out.is_terminal and not _fits(heads, rows):
        turned = (
            [heads[0].removeprefix(">"), *(row[0] for row in rows)],
            [[head.removeprefix(">"), *(row[place] for row in rows)] for place, head in enumerate(heads) if place],
        )
        if _fits(*turned):
            heads, rows = turned
    if title:
        print(title)
    table = Table(box=None, header_style="bold", pad_edge=False)
    for head in heads:
        numeric = head.startswith(">")
        name = Text(head.removeprefix(">"))
        table.add_column(name, justify="right" if numeric else "left", no_wrap=numeric, overflow="fold")
    for row in rows:
        table.add_row(*map(Text, row))
    if not out.is_terminal or not _fits(heads, rows):
        table.width = out.measure(table, options=out.options.update(max_width=_WIDEST)).maximum
    out.print(table, crop=False)
    if len(rows) < len(every):
        print(f"and {len(every) - len(rows)} more: --details")


_FOLDED = 8  # characters of a text's column that is folded


def _fits(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> bool:
    """Whether a terminal is as wide as numbers are with their heads, and as words are where texts are folded."""
    width = 2 * (len(heads) - 1)
    for place, head in enumerate(heads):
        cells = [head.removeprefix(">"), *(row[place] for row in rows)]
        if head.startswith(">"):
            width += max(map(len, cells))
        else:
            width += min(_FOLDED, max(len(word) for cell in cells for word in cell.split(" ")))
    return width <= out.width


def write_json(path: Path | None, content: Mapping[str, object]) -> None:
    """Write a result for other programs; numbers that are not finite become null."""
    if path is not None:
        write_whole(path, json.dumps(finite(content), indent=2) + "\n")


def show_written(files: Mapping[str, Path | None], next_: str = "") -> None:
    """Which files were written, each with what it is, and what to do next."""
    written = [f"{path} ({what})" for what, path in files.items() if path is not None]
    if written and not is_quiet():
        print(Sentence("Written", f"{', '.join(written)}."))
        if next_:
            print(Sentence("Next", next_))


def print_file(text: str) -> None:
    """Print the text of a file; its lines stay whole, since a comment that is broken is no comment any more."""
    (sys.stdout.write_file if isinstance(sys.stdout, _Output) else sys.stdout.write)(text)


# --- Standard output that nobody reads any more, as in `lptn effects | head` ---------------------------------


_PLAIN = str.maketrans(
    {"−": "-", "°": "deg", "·": "*", "×": "x", "±": "+/-", "…": "...", "²": "^2", "→": "->", "Ω": "ohm"}
)
"""What numbers and units of a result are written with, for a terminal without those characters."""


class _Output:
    """A text stream that breaks sentences between words where a terminal ends, drops what nobody reads, and writes what
    it has no characters for as escapes.

    All other attributes are those of the stream.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._width = get_terminal_size().columns if stream.isatty() else None

    def write(self, text: str) -> int:
        """Write sentences."""
        if self._width is not None and "\x1b" not in text:  # what rich has coloured it has broken as well
            text = "\n".join(self._broken(line) for line in text.split("\n"))
        return self.write_file(text)

    def write_file(self, text: str) -> int:
        """Write a text whose lines stay as they are, such as that of a file."""
        try:
            return self._stream.write(text)
        except UnicodeEncodeError as error:  # a terminal of ASCII, or half a character of a file's name
            plain = text.translate(_PLAIN).encode(error.encoding, "backslashreplace")
            return self._stream.write(plain.decode(error.encoding))
        except OSError as error:
            self._let_go(error)
            return len(text)

    def _broken(self, line: str) -> str:
        """A line as long as the terminal is wide, an indented one with a hanging indent; a name stays whole."""
        indent = line[: len(line) - len(line.lstrip())]
        further = f"{indent}  " if indent else ""
        line = UNIT_BEHIND.sub(BOUND, line)
        broken = fill(line, self._width or 0, subsequent_indent=further, break_long_words=False, break_on_hyphens=False)
        return (broken or line).replace(BOUND, " ")

    def flush(self) -> None:
        try:
            self._stream.flush()
        except OSError as error:
            self._let_go(error)

    def writelines(self, lines: list[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _let_go(self, error: OSError) -> None:
        """Discard the rest, so that Python reports no error when it ends."""
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)
        if not isinstance(error, BrokenPipeError):
            raise error


@contextmanager
def spared_closed_pipes() -> Iterator[None]:
    """Within it a closed standard output is no error; a full disk behind it still is.

    Raises:
        OSError: standard output can't be written for another reason than that nobody reads it.
    """
    usual = sys.stdout
    with open(os.devnull, "w") if usual is None else nullcontext(usual) as stream:  # noqa: PTH123 - `lptn … >&-`
        output = _Output(stream)
        sys.stdout = cast("TextIO", output)
        try:
            yield
        finally:
            sys.stdout = usual
            output.flush()
