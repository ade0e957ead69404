"""Where the table begins in a file of rows: lines of metadata before it, the line of names, a row of units below.

Loggers and spreadsheets write what they like above their table. The line of names is the one without a number below
which the most rows of values follow.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from lptn.logs.columns import is_unit

Cells = Sequence[str]

LOOKED_AT = 200  # rows at most, from the first: nobody writes more above a table

# A number with either decimal sign, a date or a time of the day, or what people write where there is none.
_NUMBER = r"[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:e[-+]?\d+)?"
_CLOCK = r"\d+:\d\d(?::\d\d)?(?:[.,]\d*)?"
_DATE = rf"\d{{1,4}}[-/.]\d{{1,2}}[-/.]\d{{1,4}}(?:[T ]{_CLOCK})?(?:Z| ?[-+]\d\d:?\d\d)?"
_NOTHING = r"[-+]?(?:nan|inf|infinity)|n/a|na|null|none"
_VALUE = re.compile(f"{_NUMBER}|{_CLOCK}|{_DATE}|{_NOTHING}", re.IGNORECASE)


@dataclass(frozen=True)
class Layout:
    """Where things stand among rows.

    Attributes:
        header: index of the row of names.
        units: what the row below it says of each name, '' for nothing; empty where there is no such row.
        rows: how many rows of values follow among those that were looked at.
    """

    header: int
    units: tuple[str, ...] = ()
    rows: int = 0

    @property
    def first(self) -> int:
        """Index of the first row of values."""
        return self.header + (2 if self.units else 1)


def find_layout(rows: Sequence[Cells]) -> Layout:
    """The layout of a file's first rows; where nothing looks like a table, that of one that begins with its names.

    Args:
        rows: cells as text, neither blank rows nor comments among them.
    """
    widths = [max((k for k, cell in enumerate(row, start=1) if cell.strip()), default=0) for row in rows]
    of_values = [any(map(is_value, row)) for row in rows]
    best = Layout(0)
    for header, row in enumerate(rows[:-1]):
        if of_values[header] or not any(map(str.isalpha, "".join(row))):
            continue
        below = rows[header + 1]
        units = not of_values[header + 1] and widths[header + 1] <= len(row) and all(map(is_unit, filter(None, below)))
        layout = Layout(header, tuple(_without_bracket(cell) for cell in below) if units else ())
        count = 0
        for k in range(layout.first, len(rows)):
            if rows[k] == row:  # a logger that was started again wrote its names once more
                continue
            if not (of_values[k] and widths[k] <= len(row)):
                break
            count += 1
        if count > best.rows:
            best = Layout(layout.header, layout.units, count)
    return best


def is_value(cell: str) -> bool:
    """Whether a cell is one of a table's values: a number, a date or time, or what people write where there is none."""
    return _VALUE.fullmatch(cell.strip()) is not None


def _without_bracket(cell: str) -> str:
    return cell.strip().strip("[]()").strip()
