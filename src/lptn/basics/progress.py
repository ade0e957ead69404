"""What is being done and for how long, in one line: below a command, and with a bar below a notebook's cell."""

from __future__ import annotations

import logging
import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from html import escape
from importlib import import_module

_QUIET = 2.0  # s without a word about time
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

    def _repr_html_(self) -> str:
        """The same for a notebook, with a bar; it moves to and fro where nothing is counted."""
        count = _COUNTED.search(self._message)
        done = f' value="{int(count[1]) - 1}" max="{count[2]}"' if count else ""
        return f"<progress{done}></progress> <small>{escape(str(self))}</small>"

    def _left(self, now: float) -> float | None:
        count = _COUNTED.search(self._message)
        if count is None or self._count is None:
            return None
        total, since, first = self._count
        done = int(count[1]) - first
        return (now - since) / done * (int(total) - first - done + 1) if done > 0 else None


def duration(seconds: float) -> str:
    """Seconds as a person says them: `8 s`, `3 min 5 s`, `2 h 10 min`."""
    whole = max(0, round(seconds))
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


@contextmanager
def library_log_to(handler: logging.Handler) -> Iterator[None]:
    """Within it a handler gets all that the library says of its work."""
    logger = logging.getLogger("lptn")
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)


# --- a notebook -----------------------------------------------------------------------------------------------


class _Bar(logging.Handler):
    """The line of progress below a cell, which follows what the library logs."""

    def __init__(self, first: str) -> None:
        super().__init__(logging.INFO)
        self._line = ProgressLine(first)
        self._shown = import_module("IPython.display").display(self._line, display_id=True)

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno < logging.WARNING:
            self._line.say(record.getMessage())
            self._shown.update(self._line)

    def close(self) -> None:
        self._shown.update(import_module("IPython.display").HTML(""))
        super().close()


def in_notebook() -> bool:
    """Whether a notebook runs this."""
    return "ipykernel" in sys.modules


@contextmanager
def shown_in_notebook(first: str) -> Iterator[None]:
    """Within it a notebook shows what the library is doing, until that is done; elsewhere nothing happens.

    Where somebody shows what the library logs already, that stays as it is.
    """
    if not in_notebook() or logging.getLogger("lptn").isEnabledFor(logging.INFO):
        yield
        return
    with closing(_Bar(first)) as bar, library_log_to(bar):
        yield
