"""What is said when a user's input can't be used: one line, four facts."""

from __future__ import annotations

from pathlib import Path


class InputError(ValueError):
    """A file, option or value from outside that can't be used.

    Args:
        file: the file (or option) that holds the mistake.
        place: where in it: a line, a column, a key.
        found: what stands there.
        expected: what would have been right, with the mend where there is one.
    """

    def __init__(self, file: str | Path, place: str, found: str, expected: str) -> None:
        self.file, self.place, self.found, self.expected = str(file), place, found, expected
        super().__init__(file, place, found, expected)

    def __str__(self) -> str:
        return " ".join(f"{self.file}: {self.place}: found {self.found}; expected {self.expected}".split())
