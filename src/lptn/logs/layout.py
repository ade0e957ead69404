"""Where the table begins in a file of rows, and under which names the cells of each row stand.

Loggers and spreadsheets write what they like above their table. The line of names is the one without a number below
which the most rows of values follow; a table without one has columns called `column 1`, `column 2` and so on. A cell
stands under a name if its row has as many cells as there are names: any other row is refused, never shifted.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from lptn.basics.errors import InputError
from lptn.logs.columns import is_unit

Cells = Sequence[str]

LOOKED_AT = 200  # rows at most, from the first: nobody writes more above a table
_FEWEST_ALIKE = 5  # rows of numbers alone, and of one length, that begin a table without names

# A number with either decimal sign, a date or a time of the day, or what people write where there is none.
_NUMBER = r"[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:e[-+]?\d+)?"
_CLOCK = r"\d+:\d\d(?::\d\d)?(?:[.,]\d*)?"
_DATE = rf"\d{{1,4}}[-/.]\d{{1,2}}[-/.]\d{{1,4}}(?:[T ]{_CLOCK})?(?:Z| ?[-+]\d\d:?\d\d)?"
_NOTHING = r"[-+]?(?:nan|inf|infinity)|n/a|na|null|none"
_LONGEST_VALUE = 100  # characters: a date with its time and zone has forty
_VALUE = re.compile(f"{_NUMBER}|{_CLOCK}|{_DATE}|{_NOTHING}", re.IGNORECASE)


def is_value(cell: str) -> bool:
    """Whether a cell is one of a table's values: a number, a date or time, or what people write where there is none."""
    return len(cell) <= _LONGEST_VALUE and _VALUE.fullmatch(cell.strip()) is not None


def width_of(cells: Cells) -> int:
    """How many cells a row has, without the empty ones behind its last."""
    return max((k for k, cell in enumerate(cells, start=1) if cell.strip()), default=0)


def names_of(cells: Cells) -> tuple[str, ...]:
    """The names in a row, without blanks around them; `column 3` where the third has none."""
    return tuple(cell.strip() or f"column {number}" for number, cell in enumerate(cells, start=1))


def _units_of(cells: Cells) -> tuple[str, ...]:
    """The units in a row, without brackets around them."""
    return tuple(cell.strip().strip("[]()").strip() for cell in cells)


@dataclass(frozen=True)
class Layout:
    """Where things stand among rows.

    Attributes:
        header: index of the row of names; without names, of the row above the first.
        units: what the row below it says of each name, '' for nothing; empty where there is no such row.
        rows: how many rows of values follow among those that were looked at.
        named: whether there is a row of names.
    """

    header: int
    units: tuple[str, ...] = ()
    rows: int = 0
    named: bool = True

    @property
    def first(self) -> int:
        """Index of the first row of values."""
        return self.header + (2 if self.units else 1)


def find_layout(rows: Sequence[Cells]) -> Layout:
    """The layout of a file's first rows of cells, neither blank ones nor comments among them.

    Where nothing looks like a table, that of one that begins with its names.
    """
    widths, of_values = list(map(width_of, rows)), [any(map(is_value, row)) for row in rows]
    best = Layout(0)
    for header, row in enumerate(rows[:-1]):
        if of_values[header] or not any(map(str.isalpha, "".join(row))):
            continue
        below = rows[header + 1]
        units = not of_values[header + 1] and widths[header + 1] <= len(row) and all(map(is_unit, filter(None, below)))
        layout, count = Layout(header, _units_of(below) if units else ()), 0
        for k in range(layout.first, len(rows)):
            # A logger that was started again wrote its names once more.
            if rows[k] != row and not (of_values[k] and widths[k] <= len(row)):
                break
            count += rows[k] != row
        if count > best.rows:
            best = replace(layout, rows=count)
    if best.rows:
        return best
    alike = [width > 1 and all(map(is_value, row[:width])) for row, width in zip(rows, widths, strict=True)]
    for first in range(len(rows) - _FEWEST_ALIKE + 1):
        here = slice(first, first + _FEWEST_ALIKE)
        if all(alike[here]) and len(set(widths[here])) == 1:
            return Layout(first - 1, (), sum(alike[first:]), named=False)
    return best


def holds_values(path: Path, place: str, names: tuple[str, ...], units: tuple[str, ...], cells: Cells) -> bool:
    """Whether a row below a table's names and units is one of the table's, or one of words, which is left out.

    Names may stand again, and units.

    Raises:
        InputError: the row, `place` in words, has more or fewer cells than there are names; other names, or units.
    """
    filled, count = [cell.strip() for cell in cells if cell.strip()], width_of(cells)
    width = count if count > len(names) else min(len(cells), len(names))
    if any(map(is_value, filled)):
        if width != len(names):
            said = f"{width} cell{'s' * (width != 1)} under {len(names)} names"
            raise InputError(path, place, said, "as many cells in each row as there are names")
        return True
    if not filled and width == len(names):
        return True
    other, again, units_again = "", names_of(cells[:width]), _units_of(cells[:width])
    as_names = not set(names).isdisjoint(filled) or (width > 1 and len(set(filled)) == width == len(names))
    if width == len(names) and all(map(is_unit, filled)):
        if units_again != units:
            other = f"units ({', '.join(units_again)}) that the table does not begin with"
    elif as_names and again != names:
        other = f"other names, or another order of them ({', '.join(again)}), than the table begins with"
    if other:
        raise InputError(path, place, other, "a table of one kind of rows; what follows, in a file of its own")
    return False
