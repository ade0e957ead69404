"""What the command says of a fleet."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from rich.table import Table

from lptn.fleet.each import Fleet
from lptn.fleet.work import Outcome
from lptn.terminal import err, out

_MOST = 20  # lines of outliers and of warnings


def show_failure(outcome: Outcome) -> None:
    """One line for a robot that could not be fitted, as soon as it is known."""
    if outcome.status in ("failed", "interrupted"):
        err.print(f"lptn: {outcome.robot}: not fitted: {outcome.message or outcome.status}", markup=False)


def show_fleet(fleet: Fleet, folder: Path) -> None:
    """The spread of each parameter, robots that stand apart, warnings, and one line that counts."""
    if fleet.fitted:
        out.print(_spread_table(fleet))
    for line in _shortened([str(each) for each in fleet.outliers], "robots that stand apart"):
        out.print(line, markup=False)
    notes = Counter(note for each in fleet.fitted for note in each.result.get("notes", ()))
    for line in _shortened([f"{_robots(count)}: {what}" for what, count in notes.most_common()], "notes on logs"):
        out.print(line, markup=False)
    warnings = Counter(warning for each in fleet.fitted for warning in _subjects(each)).most_common()
    for line in _shortened([f"Warning: {what}, {_robots(count)}." for what, count in warnings], "warnings"):
        out.print(line, markup=False)
    out.print(_count(fleet, folder), markup=False)


def _robots(count: int) -> str:
    return f"{count} robot{'s' * (count != 1)}"


def _spread_table(fleet: Fleet) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False)
    for column in ("parameter", "robots", "25 %", "median", "75 %", "unit"):
        table.add_column(
            column, justify="left" if column in ("parameter", "unit") else "right", no_wrap=True, overflow="fold"
        )
    for each in fleet.spread:
        low, high = each.quartiles
        numbers = (f"{value:.4g}" for value in (low, each.median, high))
        table.add_row(each.what, str(each.robots), *numbers, each.unit)
    return table


def _subjects(outcome: Outcome) -> list[str]:
    """A robot's warnings without its own numbers, so that like ones count together."""
    found = [warning.partition(" (")[0] for warning in outcome.result.get("warnings", ())]
    return found if outcome.converged else [*found, f"search {outcome.result.get('status')}"]


def _shortened(lines: list[str], what: str) -> list[str]:
    rest = len(lines) - _MOST
    return lines if rest <= 0 else [*lines[:_MOST], f"... and {rest} more {what}: see --json"]


def _count(fleet: Fleet, folder: Path) -> str:
    before = sum(each.status == "unchanged" for each in fleet.outcomes)
    words = f"{len(fleet.fitted)} of {len(fleet.outcomes)} robots fitted"
    words += f", {before} of them before" if before else ""
    words += f"; {len(fleet.failed)} not" if fleet.failed else ""
    return f"{words}. Models, records and a table (fleet.csv, fleet.parquet) are in {folder}."
