"""The line that says what is being done, for how long, and how long it will take where a total is known."""

from __future__ import annotations

import re
import time
from collections.abc import Callable

_QUIET = 2.0  # s without a word about time
_COUNTED = re.compile(r"(\d+) of (\d+)\b")


class ProgressLine:
    """What is being done, as said last, with the time that it took and will take.

    A message with "7 of 20" in it tells how far a count has come: 6 are done, and the 14 left are taken to last as long
    each as those did. The clock of a count starts when its total is first said.

    Args:
        first: what is said at the start.
        clock: seconds from anywhere.
    """

    def __init__(self, first: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._began = clock()
        self._count: tuple[str, float, int] | None = None  # what is counted, since when, from which number
        self._said = first
        self.say(first)

    def say(self, message: str) -> None:
        """Say what is being done now."""
        found = _COUNTED.search(message)
        if found is None:
            self._count = None
        elif self._count is None or self._count[0] != found[2]:
            self._count = (found[2], self._clock(), int(found[1]))
        self._said = message

    def __rich__(self) -> str:
        """The line as it stands now: rich asks for it many times a second."""
        now = self._clock()
        if now - self._began < _QUIET:
            return _plain(self._said)
        left = self._left(now)
        rest = f", about {duration(left)} left" if left is not None else ""
        return _plain(f"{self._said} ({duration(now - self._began)}{rest})")

    def _left(self, now: float) -> float | None:
        found = _COUNTED.search(self._said)
        if found is None or self._count is None:
            return None
        total, since, first = self._count
        done = int(found[1]) - first
        return (now - since) / done * (int(total) - first - done + 1) if done > 0 else None


def duration(seconds: float) -> str:
    """Seconds as a person says them: `8 s`, `3 min 5 s`, `2 h 10 min`."""
    whole = max(0, round(seconds))
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def _plain(text: str) -> str:
    """Brackets are units and names here, not rich's markup."""
    return text.replace("[", r"\[")
