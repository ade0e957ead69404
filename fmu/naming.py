"""Structured variable names: `FR_calf.torque` for the log column `torque.FR_calf`, and back."""

from __future__ import annotations

import re
from collections.abc import Iterable

_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_QUOTABLE = re.compile(r"[A-Za-z0-9_!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]+")
_PARTS = re.compile(r"'(?:[^'\\]|\\.)+'|[^.']+")


def part(text: str) -> str:
    """One part of a structured name; quoted, as FMI allows, where it is no identifier.

    A character outside ASCII, which FMI's structured names lack, becomes `_uXXXX`.
    """
    plain = "".join(letter if letter.isascii() else f"_u{ord(letter):04X}" for letter in text)
    if _IDENTIFIER.fullmatch(plain):
        return plain
    kept = "".join(letter if _QUOTABLE.fullmatch(letter) else f"_u{ord(letter):04X}" for letter in plain)
    return f"'{kept}'"


def joined(*texts: str) -> str:
    """A structured name of several parts."""
    return ".".join(part(text) for text in texts)


def of_column(column: str) -> str:
    """The variable of a log column: `torque.FR_calf` gives `FR_calf.torque`."""
    feature, dot, place = column.partition(".")
    return joined(place, feature) if dot else part(feature)


def to_column(name: str) -> str:
    """The log column of a variable: `FR_calf.torque` gives `torque.FR_calf`; a name of one part stays."""
    parts = [text.strip("'") for text in _PARTS.findall(name)]
    return f"{parts[-1]}.{'.'.join(parts[:-1])}" if len(parts) > 1 else name


def described(column: str) -> str:
    """What a person reads of the variable of a log column."""
    feature, _, place = column.partition(".")
    words: dict[str, str] = {
        "velocity": "Joint speed",
        "velocity_rms": "RMS of the joint speed over the communication step (the speed itself at short steps)",
        "torque": "Joint torque",
        "current": "Winding current",
        "speed": "Speed",
        "power": "Power",
        "temperature": "Temperature",
    }
    return f"{words.get(feature, feature)} of {place}" if place else feature


def of_owner(owner: str, prescribed: Iterable[str]) -> tuple[str, str]:
    """Where a parameter hangs: a place, and behind it the other end of an edge or an empty text.

    Args:
        owner: a node, a class (`*_calf`), a pattern, or an edge `a~b` of such.
        prescribed: nodes of given temperature, which stand last in an edge's name.
    """
    one, tilde, other = owner.partition("~")
    if tilde and one in set(prescribed):
        one, other = other, one
    return _spelt(one), _spelt(other) if tilde else ""


def of_group(label: str, pattern: str) -> str:
    """What an effect on a group of nodes is called at each of them: `shared_mass_all_calf`."""
    return f"{label}_{_spelt(pattern)}"


def _spelt(pattern: str) -> str:
    """A glob as a word: `*_calf` is `all_calf`, `heater*` is `heater_all`."""
    word = re.sub(r"(?<=[A-Za-z0-9])\*", "_all", pattern)
    word = re.sub(r"\*(?=[A-Za-z0-9])", "all_", word)
    return word.replace("*", "all")
