"""How much a file from outside may hold: more than any robot needs, and so little that reading it comes to an end."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lptn.basics.errors import InputError


@dataclass(frozen=True)
class Bound:
    """The most of something that is read.

    Args:
        most: how many there may be.
        noun: what is counted.
    """

    most: int
    noun: str

    def check(self, found: int, file: str | Path, place: str) -> None:
        """Refuse what is beyond the bound.

        Raises:
            InputError: there are more.
        """
        if found > self.most:
            raise InputError(file, place, f"{found:,} {self.noun}", f"at most {self.most:,}")


TEXT = Bound(500_000, "bytes")
"""Of a file that a person edits: a model of 800 joints has 0.1 MB. To parse TOML with its comments takes 1 to 45 s a
megabyte."""

DESCRIPTION = Bound(50_000_000, "bytes")
"""Of a file that programs write (XML, JSON): FMUs of whole vehicles have 20 MB. XML takes 0.1 s and 10 MB of memory a
megabyte."""

LOGS = Bound(2_000, "logs")
"""Of one command: one takes 7 ms at least, and 5,000 take a minute; fleets have a command of their own."""

NODES = Bound(500, "nodes")
"""Of a network: a humanoid of 60 joints, four nodes each, has 240. With 480 `check` takes 42 s, `compare` 3 s."""
