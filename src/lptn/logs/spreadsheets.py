"""Spreadsheets (.xlsx) as logs: the sheet that holds a table, read as the text that a program would save of it.

Values are those that the program which saved the file had worked out; formulas are not evaluated.
"""

from __future__ import annotations

import csv
import datetime
import io
import zipfile
from collections.abc import Iterator
from contextlib import closing
from itertools import islice
from pathlib import Path
from typing import Any

from lptn.basics.errors import InputError
from lptn.logs.csv_files import Content, table_of_text
from lptn.logs.layout import LOOKED_AT, find_layout, width_of
from lptn.logs.tables import Table, most_unpacked, one_line_if_broken, require_package, too_large

_MOST_CELLS = 10_000_000  # a sheet has a million rows at most; so many cells take half a minute and 1 GB
_MOST_BYTES = 1_000_000_000  # of what is packed in the file: as many cells, at a hundred bytes each
_MOST_ROWS = 1 << 20  # of a sheet, by its format


def open_spreadsheet(path: Path) -> Table:
    """Open a spreadsheet, and find the sheet with the longest table among the first rows of each.

    Raises:
        InputError: `openpyxl` is not installed, the file is broken or too large, or no sheet holds a table.
    """
    require_package(path, "openpyxl", "a spreadsheet", "pip install 'lptn[excel]', or the sheet saved as CSV")
    from openpyxl import load_workbook

    with one_line_if_broken(path, "a whole .xlsx file"):
        with zipfile.ZipFile(path) as archive:
            unpacked = sum(part.file_size for part in archive.infolist())
        if unpacked > min(_MOST_BYTES, most_unpacked(path)):
            raise InputError(path, "log", f"{unpacked / 1e9:.2g} GB unpacked", "a spreadsheet of readings, or CSV")
        with closing(load_workbook(path, read_only=True, data_only=True, keep_links=False)) as book:
            heads = {sheet.title: list(islice(filter(any, _rows(sheet)), LOOKED_AT)) for sheet in book.worksheets}
            layouts = {name: find_layout(rows) for name, rows in heads.items()}
            found = [name for name, layout in layouts.items() if layout.rows]
            if not found:
                expected = "a row of column names, and rows of numbers below it"
                raise InputError(path, "log", "no table in any sheet", expected)
            name = max(found, key=lambda name: layouts[name].rows)
            width = width_of(heads[name][layouts[name].header if layouts[name].named else layouts[name].first])
            text, count = io.StringIO(newline=""), 0
            write = csv.writer(text, quoting=csv.QUOTE_ALL, lineterminator="\n").writerow
            for cells in _rows(book[name]):
                filled = width_of(cells)
                count += max(filled, width)
                if count > _MOST_CELLS:
                    raise too_large(path, f"a spreadsheet of more than {_MOST_CELLS:.0e} cells")
                if filled:
                    write([*cells[: max(filled, width)], *[""] * (width - len(cells))])
                else:
                    text.write("\n")
    others = ", ".join(f"'{other}'" for other in found if other != name)
    notes = [f"log: sheet '{name}' is read; {others} not (another sheet: save it as CSV)."] if others else []
    content = text.getvalue().encode()
    return table_of_text(Content(path, lambda: io.BytesIO(content), f"sheet '{name}', row"), "spreadsheet", notes)


def _rows(sheet: Any) -> Iterator[list[str]]:
    """The rows as text, from the first of the sheet on; times of the day and durations in s."""
    sheet.reset_dimensions()  # what a file says of its own size may be wrong
    for number, values in enumerate(sheet.iter_rows(values_only=True), start=1):
        if number > _MOST_ROWS:  # the library fills up to whatever number a row has
            raise ValueError(f"a row beyond {_MOST_ROWS}")
        yield ["" if value is None else str(_plain(value)).replace("\n", " ").strip() for value in values]


def _plain(value: Any) -> Any:
    if isinstance(value, datetime.time):
        value = datetime.datetime.combine(datetime.date.min, value) - datetime.datetime.min
    return value.total_seconds() if isinstance(value, datetime.timedelta) else value
