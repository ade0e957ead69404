"""Where the table begins in a file of rows, and under which names the cells of each row stand.

Loggers and spreadsheets write what they like above their table. The line of names is the one without a number below
which the most rows of values follow; a table without one has columns called `column 1`, `column 2` and so on. A cell
stands under a name if its row has as many cells as there are names: any other row is refused, never shifted.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from lptn.basics.bounds import Bound
from lptn.basics.errors import InputError
from lptn.logs.columns import is_unit

Cells = Sequence[str]

LOOKED_AT = 200  # rows at most, from the first: nobody writes more above a table

# A number with either decimal sign, a date or a time of the day, or what people write where there is none.
_NUMBER = r"[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:e[-+]?\d+)?"
_CLOCK = r"\d+:\d\d(?::\d\d)?(?:[.,]\d*)?"
_DATE = rf"\d{{1,4}}[-/.]\d{{1,2}}[-/.]\d{{1,4}}(?:[T ]{_CLOCK})?(?:Z| ?[-+]\d\d:?\d\d)?"
_NOTHING = r"[-+]?(?:nan|inf|infinity)|n/a|na|null|none"
_LONGEST_VALUE = 100  # characters: a date with its time and zone has forty
_VALUE = re.compile(f"{_NUMBER}|{_CLOCK}|{_DATE}|{_NOTHING}", re.IGNORECASE)


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
    """The layout of a file's first rows; where nothing looks like a table, that of one that begins with its names.

    Args:
        rows: cells as text, neither blank rows nor comments among them.
    """
    widths = list(map(width_of, rows))
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
    return best if best.rows else _without_names(rows, widths)


_FEWEST_ALIKE = 5  # rows of numbers alone, and of one length, that begin a table without names


def _without_names(rows: Sequence[Cells], widths: Sequence[int]) -> Layout:
    """The layout of a table that begins with its first row of numbers; that of an empty one where there is none."""
    alike = [width > 1 and all(map(is_value, row[:width])) for row, width in zip(rows, widths, strict=True)]
    for first in range(len(rows) - _FEWEST_ALIKE + 1):
        here = slice(first, first + _FEWEST_ALIKE)
        if all(alike[here]) and len(set(widths[here])) == 1:
            return Layout(first - 1, (), sum(alike[first:]), named=False)
    return Layout(0)


def width_of(cells: Cells) -> int:
    """How many cells a row has, without the empty ones behind its last."""
    return max((k for k, cell in enumerate(cells, start=1) if cell.strip()), default=0)


def names_of(cells: Cells) -> tuple[str, ...]:
    """The names in a row, without blanks around them; `column 3` where the third has none."""
    return tuple(cell.strip() or f"column {number}" for number, cell in enumerate(cells, start=1))


_WORDS = Bound(200_000, "lines of words without a number")
"""Of a table of numbers, which a logger's messages may stand among; a look at each takes 0.1 ms."""


@dataclass
class RowsBelow:
    """The rows below the names: which of them hold values, and under which names their cells stand.

    Args:
        path: the file.
        names: of its columns.
        units: what the row of units says of them.
        order: for each name the place of its cell in a row; another one behind names that stand again.
        notes: what was noticed, a sentence each.
        words: how many rows of words are left out.
    """

    path: Path
    names: tuple[str, ...]
    units: tuple[str, ...] = ()
    order: list[int] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    words: int = 0

    def __post_init__(self) -> None:
        self.order = list(range(len(self.names)))

    def holds_values(self, place: str, cells: Cells) -> bool:
        """Whether a row is one of the table's; one of words is left out, names that stand again are heeded.

        Args:
            place: where the row stands, in words.
            cells: of the row; those behind the last name are empty, or the row is refused.

        Raises:
            InputError: the row has more cells than there are names, or fewer; other names; or other units.
        """
        filled = [cell.strip() for cell in cells if cell.strip()]
        count = width_of(cells)
        width = count if count > len(self.names) else min(len(cells), len(self.names))
        if any(map(is_value, filled)):
            if width != len(self.names):
                said = f"{width} cell{'s' * (width != 1)} under {len(self.names)} names"
                raise InputError(self.path, place, said, "as many cells in each row as there are names")
            return True
        if not filled and width == len(self.names):
            return True
        if width == len(self.names) and all(map(is_unit, filled)):
            self._heed_units(place, cells)
        elif not set(self.names).isdisjoint(filled) or (width > 1 and len(set(filled)) == width == len(self.names)):
            self._heed_names(place, names_of(cells[:width]))
        self.words += 1
        _WORDS.check(self.words, self.path, place)
        return False

    def _heed_units(self, place: str, cells: Cells) -> None:
        units = tuple(map(_without_bracket, cells[: len(self.names)]))
        if units != self.units:
            self._refuse(place, f"units ({', '.join(units)}) that the table does not begin with")

    def _heed_names(self, place: str, names: Sequence[str]) -> None:
        if sorted(names) != sorted(self.names) or (names != self.names and len(set(names)) < len(names)):
            self._refuse(place, f"other names ({', '.join(names)}) than the table begins with")
        order = [names.index(name) for name in self.names] if names != self.names else list(range(len(names)))
        if order != self.order:
            said = f"log: its names stand again, in another order, in {place}; what follows is read by them."
            self.notes.append(said)
        self.order = order

    def _refuse(self, place: str, said: str) -> NoReturn:
        raise InputError(self.path, place, said, "a table of one kind of rows; what follows, in a file of its own")

    def said(self) -> list[str]:
        """Notes on what was left out, or read by other names."""
        left_out = f"log: {self.words} lines below its names hold words and no number; left out."
        return [*self.notes, *[left_out] * bool(self.words)]


def is_value(cell: str) -> bool:
    """Whether a cell is one of a table's values: a number, a date or time, or what people write where there is none."""
    return len(cell) <= _LONGEST_VALUE and _VALUE.fullmatch(cell.strip()) is not None


def _without_bracket(cell: str) -> str:
    return cell.strip().strip("[]()").strip()
