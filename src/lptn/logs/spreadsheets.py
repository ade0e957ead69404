"""Spreadsheets (.xlsx) as logs: the sheet that holds a table, perhaps with metadata above it and units below its names.

Values are those that the program which saved the file had worked out; formulas are not evaluated.
"""

from __future__ import annotations

import datetime
import zipfile
from collections.abc import Sequence
from contextlib import closing
from functools import cache, partial
from itertools import islice
from pathlib import Path
from typing import Any

import pandas as pd

from lptn.basics.errors import InputError
from lptn.basics.files import fingerprint
from lptn.logs.layout import LOOKED_AT, RowsBelow, find_layout, names_of
from lptn.logs.tables import Table, most_unpacked, one_line_if_broken, require_package, too_large

_MOST_CELLS = 10_000_000  # a sheet has a million rows at most; so many cells take half a minute and 1 GB
_MOST_BYTES = 1_000_000_000  # of what is packed in the file: as many cells, at a hundred bytes each
_MOST_ROWS = 1 << 20  # of a sheet, by its format
_EXPECTED = "a whole .xlsx file"


def open_spreadsheet(path: Path) -> Table:
    """Open a spreadsheet, and find the sheet with the longest table among the first rows of each.

    Raises:
        InputError: `openpyxl` is not installed, the file is broken or too large, or no sheet holds a table.
    """
    require_package(path, "openpyxl", "a spreadsheet", "pip install 'lptn[excel]', or the sheet saved as CSV")
    with one_line_if_broken(path, _EXPECTED):
        with zipfile.ZipFile(path) as archive:
            unpacked = sum(part.file_size for part in archive.infolist())
        if unpacked > min(_MOST_BYTES, most_unpacked(path)):
            raise InputError(path, "log", f"{unpacked / 1e9:.2g} GB unpacked", "a spreadsheet of readings, or CSV")
        with _book(path) as book:
            heads = {sheet.title: list(islice(_rows(sheet), LOOKED_AT)) for sheet in book.worksheets}
    layouts = {name: find_layout([_texts(row) for _, row in rows]) for name, rows in heads.items()}
    tables = [name for name, layout in layouts.items() if layout.rows]
    if not tables:
        raise InputError(path, "log", "no table in any sheet", "a row of column names, and rows of numbers below it")
    sheet = max(tables, key=lambda name: layouts[name].rows)
    head, layout, notes = heads[sheet], layouts[sheet], []
    if len(tables) > 1:
        others = ", ".join(f"'{other}'" for other in tables if other != sheet)
        notes.append(f"log: sheet '{sheet}' is read; {others} not (another sheet: save it as CSV).")
    first = head[layout.first][0]
    above = _texts(head[layout.header if layout.named else layout.first][1])
    while not above[-1].strip():  # empty cells behind the last name
        above.pop()
    if not layout.named:
        notes.append(f"log: there are no names above row {first}; columns are called column 1, column 2 ….")
        above = [""] * len(above)
    elif layout.header:
        notes.append(f"log: its table begins in row {head[layout.header][0]}; what stands above is left out.")
    names = names_of(above)

    @cache
    def values() -> tuple[list[int], pd.DataFrame]:
        below = RowsBelow(path, names, layout.units)
        numbers, frame = _values(path, sheet, first, below)
        table.note(below.said())
        return numbers, frame

    def read(wanted: Sequence[str]) -> pd.DataFrame:
        return values()[1][list(wanted)]

    def where(row: int) -> str:
        return f"sheet '{sheet}', row {values()[0][row]}"

    units, digest = dict(zip(names, layout.units, strict=False)), partial(fingerprint, path)
    table = Table(path, names, read, where, "spreadsheet", units=units, notes=notes, digest=digest)
    return table


def _values(path: Path, sheet: str, first: int, below: RowsBelow) -> tuple[list[int], pd.DataFrame]:
    """The numbers of the rows from the `first` on that hold values, and these; refused where a row fits no names."""
    width = len(below.names)
    numbers: list[int] = []
    rows: list[list[Any]] = []
    with one_line_if_broken(path, _EXPECTED), _book(path) as book:
        for number, cells in _rows(book[sheet]):
            if number < first:
                continue
            if len(rows) * width > _MOST_CELLS:
                raise too_large(path, f"a spreadsheet of more than {_MOST_CELLS:.0e} cells")
            row = [_plain(value) for value in cells] + [None] * (width - len(cells))
            fits = all(value is None for value in row[width:])
            plain = fits and any(isinstance(value, int | float) for value in row[:width])
            if plain or below.holds_values(f"sheet '{sheet}', row {number}", _texts(row)):
                numbers.append(number)
                rows.append([row[place] for place in below.order])
    columns = {name: pd.Series([row[k] for row in rows]) for k, name in reversed(list(enumerate(below.names)))}
    return numbers, pd.DataFrame(columns)


def _book(path: Path) -> closing[Any]:
    """A workbook, open for reading row by row, closed in the end."""
    from openpyxl import load_workbook

    return closing(load_workbook(path, read_only=True, data_only=True, keep_links=False))


def _rows(sheet: Any) -> Any:
    """The rows that hold something, each with its number from 1."""
    sheet.reset_dimensions()  # what a file says of its own size may be wrong
    for number, values in enumerate(sheet.iter_rows(values_only=True), start=1):
        if number > _MOST_ROWS:  # the library fills up to whatever number a row has
            raise ValueError(f"a row beyond {_MOST_ROWS}")
        if any(value is not None for value in values):
            yield number, values


def _texts(values: Sequence[Any]) -> list[str]:
    return ["" if value is None else str(_plain(value)) for value in values]


def _plain(value: Any) -> Any:
    """Times of the day and durations in s; all else as it is."""
    if isinstance(value, datetime.timedelta):
        return value.total_seconds()
    if isinstance(value, datetime.time):
        return 3600.0 * value.hour + 60.0 * value.minute + value.second + 1e-6 * value.microsecond
    return value
