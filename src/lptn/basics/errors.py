"""The message for input that can't be used: one line with file, place, what was found and what was expected."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

# Characters of each part of a message: a line that can be read, whatever a broken file holds.
_LONGEST = {"file": 300, "place": 200, "found": 300, "expected": 900}


def one_line(text: object) -> str:
    """A text as one line that does nothing to a terminal: blanks single, whatever can't be printed as its escape."""
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in " ".join(str(text).split())
    )


MODEL_FILE = "a model file (`lptn new` writes one)"
"""What is expected where a file is none."""


class InputError(ValueError):
    """A file, option or value from outside that can't be used.

    Args:
        file: the file (or option) that holds the mistake.
        place: where in it: a line, a column, a key.
        found: what stands there.
        expected: what would have been right, with the mend where there is one.

    Example:
        >>> import lptn
        >>> str(lptn.InputError("leg.toml", "line 7, nodes.hip.capacity", "-3 J/K", "a value above 0"))
        'leg.toml: line 7, nodes.hip.capacity: found -3 J/K; expected a value above 0'
    """

    def __init__(self, file: str | Path, place: str, found: str, expected: str) -> None:
        self.file, self.place, self.found, self.expected = str(file), place, found, expected
        super().__init__(file, place, found, expected)

    def __str__(self) -> str:
        file, place, found, expected = (_short(getattr(self, part), most) for part, most in _LONGEST.items())
        file = file if file == self.file else f"…{self.file[-_LONGEST['file'] :]}"  # a path's end says more
        return one_line(f"{file}: {place}: found {found}; expected {expected}")


def _short(text: str, most: int) -> str:
    return text if len(text) <= most else text[: most - 1] + "…"


def shown(found: object, most: int = 60) -> str:
    """A value from a file as TOML would have it, cut to so many characters, which fit a line."""
    return _short(_as_toml(found), most)


def _as_toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_as_toml(inner)}" for key, inner in value.items()) + " }" if value else "{}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_as_toml, value)) + "]"
    return repr(value)
