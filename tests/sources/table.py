"""All rows of the three sources in order, worked out: as lines and as a page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tests.sources import block, quadruped, u8_thesis  # they enter their rows
from tests.sources.row import ROWS, Check, Row, Verdict

NOT_RUN = "not run"
_SOURCES = {"S0": "[QuadrupedLPTN]", "S1": "[Chen2017]", "S2": "[BlockLPTN]"}
_MODULES = (quadruped, u8_thesis, block)


@dataclass(frozen=True)
class Line:
    """A row worked out."""

    row: Row
    checks: tuple[Check, ...]
    verdict: str

    @property
    def short(self) -> bool:
        """Whether the project owes it something."""
        return self.verdict == Verdict.SHORT.value


def rows() -> list[Row]:
    """Every row, in the order of the sources."""
    return sorted(ROWS.values(), key=lambda row: [module.__name__ for module in _MODULES].index(row.check.__module__))


def evaluate(row: Row, fast: bool = False) -> Line:
    """Work a row out; a slow one only if not `fast`."""
    if fast and row.slow:
        return Line(row, (), Verdict.SHORT.value if row.short else NOT_RUN)
    checks = tuple(row.check())
    holds = bool(checks) and all(check.passed for check in checks) and not row.short
    return Line(row, checks, (row.verdict if holds else Verdict.SHORT).value)


def text(line: Line) -> str:
    """A row as lines of a terminal."""
    head = f"{line.row.id:14s} {line.verdict:34s} {line.row.title}: {line.row.printed}"
    marked = (f"    {' ' if check.passed else '!'} {check}" for check in line.checks)
    return "\n".join([head, *marked, *([f"    ! {line.row.short}"] if line.row.short else [])])


def page(lines: Sequence[Line], old: str = "") -> str:
    """The rows as a page of Markdown.

    Args:
        lines: the rows that were worked out.
        old: the page as it was, from which the others are kept.
    """
    cells = {line.row.id: _cells(line) for line in lines if line.verdict != NOT_RUN}
    kept = {text.split(" | ")[0].removeprefix("| "): text for text in old.splitlines() if text.startswith("| S")}
    shown = {row.id: cells.get(row.id) or kept.get(row.id) or _cells(Line(row, (), NOT_RUN)) for row in rows()}
    verdicts = [verdict.value for verdict in Verdict] + [NOT_RUN]
    counts = {verdict: sum(f" | *{verdict}* | " in text for text in shown.values()) for verdict in verdicts}
    said = ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)
    parts = [
        "# The sources, row by row",
        "",
        "What the three sources print or claim, and what we get. `python -m tests.sources -o tests/sources/README.md`",
        "wrote this page, and exits 1 where a row falls short. An id is source, kind (equation, table, figure, number,",
        "method, application) and number. The last printed digit says how far ours may lie from it; where it",
        "doesn't, a reason stands in parentheses. *cannot be met*: the source contradicts itself or physics, and the",
        "checks show it; *an input is missing*: what can be said without it is checked; *not run*: it takes minutes.",
        "A number that missed is marked (!).",
        "",
        f"{len(shown)} rows: {said}.",
    ]
    for source, cited in _SOURCES.items():
        own = [text for name, text in shown.items() if name.startswith(source)]
        parts += ["", f"## {source} {cited}", "", "| row | what is printed | what we get | verdict | test |"]
        parts += ["| --- | --- | --- | --- | --- |", *own]
    return "\n".join(parts) + "\n"


def _cells(line: Line) -> str:
    row = line.row
    numbers = "<br>".join(f"{'' if check.passed else '(!) '}{check}" for check in line.checks)
    cells = (row.id, f"{row.title}: {row.printed}", numbers or row.short or "–", f"*{line.verdict}*", f"`{row.test}`")
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"
