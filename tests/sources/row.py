"""A row of the sources: what stands there, what we get for it, and whether the two agree.

A row is a function that returns its checks; `row` enters it into `ROWS`. The command, the page and the tests all run
that one function. A printed number is written as it is printed: its last digit says how far ours may lie from it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum

EXACT = 1e-9  # relative: what an equation may differ from the same equation worked apart


class Verdict(Enum):
    """What the checks of a row show, if all of them pass."""

    HOLDS = "holds"
    CORRECTED = "misprint; the corrected form holds"
    CONTRADICTED = "cannot be met"  # it contradicts the source itself, or physics; the checks show it
    MISSING = "an input is missing"  # what can be said without it is checked
    SHORT = "falls short"


@dataclass(frozen=True)
class Check:
    """One number of ours against what it has to be."""

    what: str
    found: float
    wanted: str
    passed: bool
    unit: str = ""
    why: str = ""

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        reason = f" ({self.why})" if self.why else ""
        return f"{self.what} {_number(self.found)}{unit}, {self.wanted}{reason}"


@dataclass(frozen=True)
class Row:
    """One row.

    Args:
        id: source, kind and number, such as `S0-E1`.
        title: what it is about.
        printed: what stands in the source.
        verdict: what its checks show, if they pass.
        check: works its numbers out.
        slow: whether that takes more than some seconds.
        more: where it is tested at greater length.
        short: what is missing yet, if anything: such a row falls short though its checks pass.
    """

    id: str
    title: str
    printed: str
    verdict: Verdict
    check: Callable[[], Iterable[Check]]
    slow: bool
    more: str
    short: str

    @property
    def test(self) -> str:
        """Where the row is checked."""
        module = self.check.__module__.replace(".", "/")
        return f"{module}.py {self.check.__name__}" + (f"; {self.more}" if self.more else "")


ROWS: dict[str, Row] = {}


def row(
    name: str,
    title: str,
    printed: str,
    verdict: Verdict = Verdict.HOLDS,
    *,
    slow: bool = False,
    more: str = "",
    short: str = "",
) -> Callable[[Callable[[], Iterable[Check]]], Callable[[], Iterable[Check]]]:
    """Enter a function that checks a row; see `Row`."""

    def enter(check: Callable[[], Iterable[Check]]) -> Callable[[], Iterable[Check]]:
        if name in ROWS:
            raise ValueError(f"row {name} twice")
        ROWS[name] = Row(name, title, printed, verdict, check, slow, more, short)
        return check

    return enter


def printed(what: str, found: float, text: str, unit: str = "", *, within: float | None = None, why: str = "") -> Check:
    """Ours against a printed number; it may be off by half of the last printed digit.

    Args:
        what: the quantity.
        found: ours.
        text: the number as it is printed.
        unit: of both.
        within: the tolerance where the printed digits don't say it; it needs a reason.
        why: that reason.
    """
    if within is not None and not why:
        raise ValueError(f"{what}: a tolerance without a reason")
    tolerance = half_a_digit(text) if within is None else within
    passed = abs(found - float(text)) <= tolerance * (1 + EXACT)
    return Check(what, found, f"printed {text}", passed, unit, why)


def half_a_digit(text: str) -> float:
    """Half of the last digit of a number as it is printed: 0.05 of 2.5, 0.5 of 160."""
    decimals = text.partition(".")[2]
    return 0.5 * 10.0 ** -len(decimals)


def equal(what: str, found: float, wanted: float, unit: str = "", within: float = EXACT, why: str = "") -> Check:
    """Ours against the same worked out apart; `within` is relative, and absolute below 1."""
    passed = abs(found - wanted) <= within * max(1.0, abs(wanted))
    return Check(what, found, f"apart from it {_number(wanted)}", passed, unit, why)


def below(what: str, found: float, limit: float, unit: str = "", why: str = "") -> Check:
    """Ours under a limit."""
    return Check(what, found, f"below {_number(limit)}", found < limit, unit, why)


def above(what: str, found: float, limit: float, unit: str = "", why: str = "") -> Check:
    """Ours over a limit."""
    return Check(what, found, f"above {_number(limit)}", found > limit, unit, why)


def differs(what: str, found: float, text: str, unit: str = "", why: str = "") -> Check:
    """Ours, which is right, and a printed number that it does not give."""
    apart = abs(found - float(text)) > half_a_digit(text)
    return Check(what, found, f"not the printed {text}", apart, unit, why)


def _number(value: float) -> str:
    return "infinite" if math.isinf(value) else f"{value:.4g}"
