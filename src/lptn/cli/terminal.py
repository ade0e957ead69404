"""The terminal: what is being done and for how long, what the library logs, tables, JSON, readers that went away."""

from __future__ import annotations

import json
import logging
import os
import re
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

out = Console(highlight=False, soft_wrap=True)
err = Console(stderr=True, highlight=False, soft_wrap=True)


# --- What is being done: one line on the error stream, with its time once it takes long ----------------


_QUIET = 2.0  # s without a word about time
_MINUTE = 60.0  # s between two lines where nobody watches
_COUNTED = re.compile(r"(\d+) of (\d+)\b")


class ProgressLine:
    """What is being done, as said last, with the time that it took and will take.

    A message with "7 of 20" in it says how far a count has come: 6 are done, and the 14 left are taken to last as long
    each as those did. The clock of a count starts when its total is first said.

    Args:
        first: what is said at the start.
        clock: seconds from anywhere.
    """

    def __init__(self, first: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._began = clock()
        self._count: tuple[str, float, int] | None = None  # what is counted, since when, from which number
        self._message = first
        self.say(first)

    def say(self, message: str) -> None:
        """Say what is being done now."""
        count = _COUNTED.search(message)
        if count is None:
            self._count = None
        elif self._count is None or self._count[0] != count[2]:
            self._count = (count[2], self._clock(), int(count[1]))
        self._message = message

    def __str__(self) -> str:
        """The line as it stands now."""
        now = self._clock()
        line = self._message
        if now - self._began >= _QUIET:
            left = self._left(now)
            line += f" ({duration(now - self._began)}{'' if left is None else f', about {duration(left)} left'})"
        return line

    def __rich__(self) -> str:
        """The same for rich, which asks for it many times a second."""
        return str(self).replace("[", r"\[")  # brackets are units and names here, not rich's markup

    def _left(self, now: float) -> float | None:
        count = _COUNTED.search(self._message)
        if count is None or self._count is None:
            return None
        total, since, first = self._count
        done = int(count[1]) - first
        return (now - since) / done * (int(total) - first - done + 1) if done > 0 else None


class ProgressOfALongJob(ProgressLine):
    """The same where nobody watches, in a batch job or a pipe: a line of its own, once a minute at most."""

    def __init__(self, first: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._told = clock()
        super().__init__(first, clock)

    def say(self, message: str) -> None:
        """Say what is being done now; told once a minute has passed."""
        super().say(message)
        if self._clock() - self._told >= _MINUTE:
            self._told = self._clock()
            complain(self)


def duration(seconds: float) -> str:
    """Seconds as a person says them: `8 s`, `3 min 5 s`, `2 h 10 min`."""
    whole = max(0, round(seconds))
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


class _LibraryLog(logging.Handler):
    """What the library logs: progress goes into the line while there is one, a warning is a line of its own."""

    line: ProgressLine | None = None

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno >= logging.WARNING:
            complain(record.getMessage())
        elif self.line is not None:
            self.line.say(record.getMessage())


_library_log = _LibraryLog(logging.INFO)


@contextmanager
def library_log_shown() -> Iterator[None]:
    """Within it the terminal shows what the library logs."""
    logger = logging.getLogger("lptn")
    level = logger.level
    logger.addHandler(_library_log)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(_library_log)
        logger.setLevel(level)


@contextmanager
def progress(first: str) -> Iterator[Callable[[str], None]]:
    """A line that says what is being done, from 2 s on with its time; where nobody watches, a line a minute at most.

    It follows what the library logs, and what is given to the function that it yields. What is said as "7 of 20" also
    gets the time that is left.
    """
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


def show_table(heads: Sequence[str], rows: Iterable[Sequence[str]], title: str = "") -> None:
    """Print a table without lines and without cutting a cell.

    On a terminal long names and texts are folded; into a pipe or a file each row is one line, as wide as it has to be.

    Args:
        heads: of the columns; those of numbers begin with ">", which aligns them right.
        rows: the cells.
        title: a line above it.
    """
    table = Table(box=None, header_style="bold", pad_edge=False, title=title or None, title_justify="left")
    for head in heads:
        numeric = head.startswith(">")
        name = Text(head.removeprefix(">"))
        table.add_column(name, justify="right" if numeric else "left", no_wrap=numeric, overflow="fold")
    for row in rows:
        table.add_row(*map(Text, row))
    if not out.is_terminal:
        table.width = out.measure(table, options=out.options.update(max_width=_WIDEST)).maximum
    out.print(table, crop=False)


def write_json(path: Path | None, content: Mapping[str, object]) -> None:
    """Write a result for other programs; numbers that are not finite become null."""
    if path is not None:
        write_whole(path, json.dumps(finite(content), indent=2) + "\n")


def show_written(files: Mapping[str, Path | None]) -> None:
    """Which files were written, each with what it is."""
    written = [f"{path} ({what})" for what, path in files.items() if path is not None]
    if written:
        print(f"Written: {', '.join(written)}.")


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

    Whatever else is asked of it, the stream answers.
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
        broken = fill(line, self._width or 0, subsequent_indent=further, break_long_words=False, break_on_hyphens=False)
        return broken or line

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
        """Send the rest nowhere, so that Python has nothing to complain of when it ends."""
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
    if usual is None:  # `lptn … >&-`
        with open(os.devnull, "w") as nowhere:  # noqa: PTH123
            sys.stdout = nowhere
            try:
                yield
            finally:
                sys.stdout = usual
        return
    output = _Output(usual)
    sys.stdout = cast("TextIO", output)
    try:
        yield
    finally:
        sys.stdout = usual
        output.flush()
