"""Names of places: globs, classes of like joints, left and right, edges."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase, translate
from functools import lru_cache

EVERYWHERE = "*"
_SIDES = {"FL": "FR", "RL": "RR", "left": "right", "Left": "Right", "l": "r", "L": "R"}
_OTHER_SIDE = _SIDES | {right: left for left, right in _SIDES.items()}


def matching(pattern: str, names: Iterable[str]) -> list[str]:
    """The names that a glob such as `"*_calf"` matches, in their own order."""
    return list(_matching(pattern, tuple(names)))


@lru_cache(4096)  # a search asks for the same places of hundreds of models
def _matching(pattern: str, names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(name for name in names if fnmatchcase(name, pattern))


def in_listed_order(names: Iterable[str], listed: Sequence[str]) -> list[str]:
    """The names in the order of a list; those that it lacks behind, as they come."""
    at = {name: number for number, name in enumerate(listed)}
    return sorted(names, key=lambda name: at.get(name, len(at)))


def is_glob(name: str) -> bool:
    """Whether a name stands for many."""
    return any(character in name for character in "*?[")


def is_pattern(name: str) -> bool:
    """Whether a name may mean several places: a glob, or a pair `{leg}_hip~{leg}_thigh` on every leg."""
    return is_glob(name) or "{" in name


def class_of(name: str) -> str:
    """The class of a place: `FR_calf` is a `*_calf`, `knee_left` a `knee_*`, `heater2` a `heater*`."""
    if "~" in name:
        return edge(*(class_of(end) for end in name.split("~")))
    words = name.split("_")
    for number, word in enumerate(words):
        if word in _OTHER_SIDE:
            return "_".join([*words[:number], EVERYWHERE, *words[number + 1 :]])
    stem = name.rstrip("0123456789")
    if stem not in ("", name):
        return stem + EVERYWHERE
    return "_".join([EVERYWHERE, *words[1:]]) if len(words) > 1 else name


def limb_of(name: str) -> str:
    """A pattern of all that is on the same leg, arm or motor: `FR_*` of `FR_calf`, `*_left` of `knee_left`; else the
    name.
    """
    words = name.split("_")
    if "~" in name or len(words) == 1:
        return name
    number = next((number for number, word in enumerate(words) if word in _OTHER_SIDE), 0)
    return "_".join([EVERYWHERE] * (number > 0) + [words[number]] + [EVERYWHERE] * (number < len(words) - 1))


def mirrored(name: str) -> str | None:
    """The same place on the other side of the robot, `None` where it has no side."""
    if "~" in name:
        ends = name.split("~")
        others = [mirrored(end) or end for end in ends]
        return None if others == ends else edge(*others)
    words = name.split("_")
    for number, word in enumerate(words):
        if word in _OTHER_SIDE:
            return "_".join([*words[:number], _OTHER_SIDE[word], *words[number + 1 :]])
    return None


def edge(one: str, other: str) -> str:
    """The name of the edge between two places: `"a~b"`, names in alphabetical order."""
    return "~".join(sorted((one, other)))


def in_run(name: str, run: str) -> str:
    """A name with the run that it is confined to behind it, `"FR_calf@monday"`; without a run as it is."""
    return f"{name}@{run_label(run)}" if run else name


def run_label(run: str) -> str:
    """A run's name as part of another name: characters that mean something there become commas."""
    return re.sub(r"[.~{}\s]", ",", run)


def is_of_run(name: str, pattern: str) -> bool:
    """Whether a run, or the log that it is a piece of (`monday#2`), is what a name or glob means."""
    whole = name.partition("#")[0]
    piece = name.startswith(f"{pattern}#")  # of a piece that was cut once more, `monday#2#1`
    return piece or pattern in (name, whole) or fnmatchcase(name, pattern) or fnmatchcase(whole, pattern)


def expand_pair(patterns: Sequence[str], names: Sequence[str]) -> list[tuple[str, str]]:
    """All pairs of places that two patterns stand for.

    `{leg}` in both patterns means the same text in both; a glob pairs each name that it matches with
    each name of the other pattern.
    """
    first, second = patterns
    if not is_pattern(first) and not is_pattern(second):  # as of most links
        return [(first, second)] if first != second and first in names and second in names else []
    pairs = []
    for one in names:
        captured = _capture(first, one)
        if captured is None:
            continue
        filled = re.sub(r"\{(\w+)\}", lambda field: captured.get(field[1], field[0]), second)  # noqa: B023
        pairs += [(one, other) for other in names if other != one and _capture(filled, other) is not None]
    unique: dict[str, tuple[str, str]] = {}
    for pair in pairs:
        unique.setdefault(edge(*pair), pair)
    return list(unique.values())


def _capture(pattern: str, name: str) -> dict[str, str] | None:
    """What each `{field}` of the pattern stands for in the name; `None` if they don't match."""
    if "{" not in pattern:  # its many stars take no time there
        return {} if fnmatchcase(name, pattern) else None
    match = _expression(pattern).fullmatch(name)
    return None if match is None else match.groupdict()


@lru_cache(maxsize=1024)  # a motor in many pieces asks for the same pattern a thousand times
def _expression(pattern: str) -> re.Pattern[str]:
    parts = re.split(r"(\{[A-Za-z_]\w*\}|\*|\?|\[[^\]]+\])", pattern)
    expression, seen = "", set()
    for part in parts:
        field = part[1:-1] if re.fullmatch(r"\{[A-Za-z_]\w*\}", part) and part[1:-1].isidentifier() else ""
        if field and field in seen:
            expression += f"(?P={field})"
        elif field:
            expression += f"(?P<{field}>[^~]+?)"
            seen.add(field)
        elif part.startswith("[") and part.endswith("]"):
            expression += translate(part).removeprefix("(?s:").rpartition(")")[0]
        else:
            expression += {"*": ".*", "?": "."}.get(part, re.escape(part))
    return re.compile(expression)
