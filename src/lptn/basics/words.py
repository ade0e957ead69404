"""Numbers and lists as sentences have them."""

from __future__ import annotations

import re
from collections.abc import Sequence

UNIT_BEHIND = re.compile(r"(?<=\d) (?=(?:K|W|s|min|h|m/s|°C|N·m|%)(?!\w))")
"""The space between a number and its unit, at which no line ends."""
BOUND = "\N{NO-BREAK SPACE}"


def short_size(value: float) -> str:
    """Two digits, and no exponent where a person can read it without."""
    return f"{value:.0f}" if 10 <= abs(value) < 1e5 else f"{value:.2g}"


def listed(items: Sequence[str], last: str = "and") -> str:
    """`a, b and c`."""
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} {last} {items[-1]}"


FEW = 3
"""Names in a row that a sentence carries, and things of one kind that an answer names; `--details` has all."""


def few(items: Sequence[str], most: int = FEW) -> str:
    """A list, shortened to `a, b and 7 others` where it has more than one item beyond `most`."""
    return listed(items if len(items) <= most + 1 else [*items[:most], f"{len(items) - most} others"])


def count_of(number: int, word: str) -> str:
    """`1 node`, `3 nodes`, `no nodes`."""
    return f"{number or 'no'} {word}{'' if number == 1 else 's'}"
