"""Tables of text and spreadsheets opened as logs. Comma, semicolon, tab or blanks separate, quoted or not.

Lines are looked at one by one, which takes a µs each, and read by pandas many at a time.
"""

from __future__ import annotations

import codecs
import csv
import datetime
import gzip
import io
import os
import re
import zipfile
import zlib
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import pandas as pd

from lptn.basics.bounds import Bound
from lptn.basics.errors import InputError
from lptn.basics.files import fingerprint
from lptn.logs import tables
from lptn.logs.columns import is_number
from lptn.logs.layout import LOOKED_AT, Layout, find_layout, holds_values, is_value, names_of, width_of
from lptn.logs.tables import Bounded, Table, most_unpacked, one_line_if_broken, require_package, too_large

_ENCODING = "utf-8"
_LONGEST = 1 << 24
"""Characters of a line, and of what is looked through for a table: 100,000 columns with long names have as many, and
binary files may have no line end at all."""
_MOST_LINES = 50_000_000
"""At a µs each: five days at 100 Hz. Blank ones pack into nothing."""
_WORDS = Bound(200_000, "lines of words without a number")
"""Of a table of numbers, which a logger's messages may stand among; a look at each takes 0.1 ms."""
_HEAD, _FEWEST_LINES = 1 << 19, 4  # characters that are looked at for the layout, and lines that are in any case
_SEPARATORS = ",;\t"
_BLANK, _WIDE = " ", "  "  # any number of blanks and tabs; two or more, where names have blanks of their own
_MOST_SHOWN = 6  # names of columns in a note
_BEGINS_A_NUMBER = frozenset("+-.0123456789")
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")
_BLOCK, _CELLS_IN_A_CHUNK = 1 << 22, 4_000_000  # bytes that are unpacked at once, cells that are parsed


def open_csv(path: Path) -> Table:
    """Open a table of text, perhaps compressed, and find its column names.

    Raises:
        InputError: it can't be read, or begins no table.
    """

    def unpacked() -> BinaryIO:
        if path.suffix != ".gz":
            return path.open("rb")
        most = most_unpacked(path, at_once=False)
        error = InputError(path, "log", f"a file that unfolds to more than {most / 1e9:g} GB", "a log cut into pieces")
        packed = gzip.open(path)  # noqa: SIM115 - closed with what is returned
        return io.BufferedReader(Bounded(packed, most, error), _BLOCK)

    return _Text(path, unpacked, "line").table("CSV", [])


class _Text:
    """A table of text, of which the first lines say what is in it.

    Args:
        path: the file that it is from.
        opened: opens its bytes, again and again.
        row: what a line is called in messages.

    Attributes:
        cut: its last line has no end: its writer was stopped, or the copy.
        layout: where the table begins, among lines that are neither blank nor comments.
        lines: the numbers of those lines in the file, from 1.
        first_line: the number of the first row's line; of the one below the names where none was found.
        said_of_names: where names come from that no line of their own has.

    Raises:
        InputError: it can't be read, or its lines begin no table.
    """

    def __init__(self, path: Path, opened: Callable[[], BinaryIO], row: str) -> None:
        self.path, self.opened, self.row = path, opened, row
        texts, comments = self._begin()

        def tried(separator: str) -> tuple[int, bool, int, str, Layout, list[list[str]]]:
            rows = [_cells(text, separator) for text in texts]
            layout = find_layout(rows)
            width, width_of_first = (len(row) for row in (rows[max(layout.header, 0)], [*rows, []][layout.first]))
            return layout.rows, width == width_of_first, width, separator, layout, rows

        best = max(map(tried, _SEPARATORS), key=lambda one: one[:3])
        if best[0] == 0 or best[2] == 1:  # blanks stand in names and dates, too
            best = max(best, tried(_WIDE), tried(_BLANK), key=lambda one: one[:3])
        _, _, width, self.separator, self.layout, rows = best
        tables.COLUMNS.check(width, path, "header")
        layout, first_row = self.layout, [*rows, []][self.layout.first]
        self.first_line = (*self.lines, self.lines[-1] + 1)[layout.first]
        above, self.said_of_names = rows[max(layout.header, 0)], ""
        self.names = names_of(above)
        said = f"{len(first_row)} values in the first row under {len(above)} names"
        other_count = InputError(path, "header", said, "a name for each column, and numbers with a decimal point")
        if not layout.named and first_row:
            last = max((one for one in comments if one[0] < self.first_line), default=(0, ""))[1]
            comment = _cells(last, self.separator)
            self.names = names_of([""] * len(first_row))
            listed = ", ".join(self.names[:_MOST_SHOWN]) + " …" * (len(self.names) > _MOST_SHOWN)
            self.said_of_names = f"its columns are called {listed}"
            if len(comment) == len(self.names) and not all(map(is_value, comment)):
                self.names, self.said_of_names = names_of(comment), "those of the comment above are taken"
            elif layout.header >= 0 and self.separator.strip(" ") and len(list(filter(None, above))) > 1:
                raise other_count
        if layout.rows == 0 and all(map(is_number, self.names)):
            found = f"numbers ({', '.join(self.names[:3])})"
            raise InputError(path, "header", found, "a line of column names, and rows")
        if len(first_row) > len(self.names) + 1 or any(first_row[len(self.names) :]):
            raise other_count
        cells = (cell.strip() for row in rows[layout.first :] for cell in row)
        self.decimal = "," if self.separator != "," and any(map(_DECIMAL_COMMA.fullmatch, cells)) else "."

    def _begin(self) -> tuple[list[str], list[tuple[int, str]]]:
        """The first lines of data, and those of comment with their numbers; encoding, and whether the end is cut.

        UTF-16 says so by its first bytes; what is not UTF-8 is as Windows had it. A packed file is not asked for its
        end.
        """
        self.lines, self.cut = list[int](), False
        texts, comments, characters = list[str](), list[tuple[int, str]](), 0
        try:
            with self.opened() as file:
                head = file.read(_HEAD)
                if file.seekable():
                    file.seek(-min(2, file.seek(0, os.SEEK_END)), os.SEEK_END)
                    end = file.read().strip(b"\0")  # in UTF-16 it has a zero beside it
                    self.cut = not end.endswith((b"\n", b"\r"))
            self.encoding = _encoding_of(head)
            for number, text in self._all_lines():
                characters += len(text)
                if text.startswith("#"):
                    comments.append((number, text.lstrip("# ")))
                elif text.strip():
                    self.lines.append(number)
                    texts.append(text.rstrip("\r\n "))
                if len(texts) == LOOKED_AT or (characters > _HEAD and len(texts) >= _FEWEST_LINES):
                    break
                if characters > _LONGEST:
                    found = f"no table within its first {characters:,} characters"
                    raise InputError(self.path, "log", found, "a line of column names, and rows")
        except (OSError, EOFError, zlib.error, UnicodeError) as error:
            raise InputError(self.path, "log", f"a file that can't be read ({error})", "CSV text in UTF-8") from error
        if not texts:
            raise InputError(self.path, "log", "an empty file", "a header line and at least 10 rows")
        return texts, comments

    def _all_lines(self) -> Iterator[tuple[int, str]]:
        """All lines with their ends, and their numbers from 1, without blanks before what they hold.

        Raises:
            InputError: a line, or their number, is beyond all bounds.
        """
        with self.opened() as file:
            marked = "utf-8-sig" if self.encoding == _ENCODING else self.encoding  # Excel writes a byte order mark
            stream = io.TextIOWrapper(file, encoding=marked, errors="replace", newline="")
            for number, line in enumerate(iter(partial(stream.readline, _LONGEST), ""), start=1):
                if number > _MOST_LINES:
                    raise InputError(self.path, "log", f"more than {_MOST_LINES:,} lines", "a log cut into pieces")
                if len(line) == _LONGEST:
                    place = f"{self.row} {number}"
                    raise InputError(self.path, place, "a line of 16 million characters", "a table of readings")
                yield number, line.lstrip(" ")

    def _data_lines(self) -> Iterator[tuple[int, str]]:
        """The lines that hold data: neither blank, nor comment, nor the last one where it is cut.

        A comment is a line that begins with #: in a name, or within a row, it is a character like any other.
        """
        for number, line in self._all_lines():
            whole = line.endswith(("\n", "\r")) or not self.cut
            if whole and line.strip() and not line.startswith("#"):
                yield number, line.rstrip("\r\n ")

    def table(self, kind: str, notes: list[str]) -> Table:
        """It as a log of a kind, with what else is noteworthy about it."""
        layout, row, lines = self.layout, self.row, array("q")
        if self.cut:
            notes.append("the file ends within a line, which is left out: its last number may be cut.")
        if self.encoding != _ENCODING:
            notes.append(f"log: its text is read as {self.encoding}, for it is not in UTF-8.")
        if not layout.named:
            notes.append(f"log: there are no names above {row} {self.first_line}; {self.said_of_names}.")
        elif layout.header:
            notes.append(f"log: its table begins on {row} {self.lines[layout.header]}; what stands above is left out.")
        place = {name: number for number, name in reversed(list(enumerate(self.names)))}

        def read(wanted: Sequence[str]) -> pd.DataFrame:
            frame, lines[:], said = self._read([place[name] for name in wanted])
            table.note(said)
            return frame.set_axis(list(wanted), axis="columns")

        units, digest = dict(zip(self.names, layout.units, strict=False)), partial(fingerprint, self.path)
        table = Table(
            self.path, self.names, read, lambda k: f"{row} {lines[k]}", kind, units=units, notes=notes, digest=digest
        )
        return table

    def _read(self, positions: Sequence[int]) -> tuple[pd.DataFrame, array[int], list[str]]:
        """The columns at `positions`, the numbers of the rows' lines, and notes.

        A row of words without a number is no row of the table: its names again, a logger's message, a last line that
        says how many there were.

        Raises:
            InputError: a row has more or fewer cells than there are names, or the file is broken.
        """
        lines, words, blank = array("q"), 0, self.separator in (_BLANK, _WIDE)
        between = "\t" if blank else self.separator

        def rows() -> Iterator[str]:
            nonlocal words
            for number, line in self._data_lines():
                if number < self.first_line:
                    continue
                row = between.join(_cells(line, self.separator)) if blank else line
                # Most begin with a number, and their cells need no look.
                plain = line[0] in _BEGINS_A_NUMBER and '"' not in line and row.count(between) + 1 == len(self.names)
                place, cells = f"{self.row} {number}", () if plain else _cells(line, self.separator)
                if plain or holds_values(self.path, place, self.names, self.layout.units, cells):
                    lines.append(number)
                    yield row
                else:
                    words += 1
                    _WORDS.check(words, self.path, place)

        most, at_once = tables.MOST_NUMBERS // max(len(positions), 1), max(_CELLS_IN_A_CHUNK // len(self.names), 1)
        frames, remaining = [pd.DataFrame({position: [] for position in positions})], rows()
        with one_line_if_broken(self.path, "a whole table"):
            while some := "\n".join(islice(remaining, at_once)):
                if len(lines) >= most:
                    raise too_large(self.path, f"{most} rows or more")
                frame = pd.read_csv(
                    io.BytesIO(some.encode()),  # three times as fast as of a text
                    sep=between,
                    decimal=self.decimal,
                    header=None,
                    usecols=sorted(set(positions)),
                    skipinitialspace=True,
                    skip_blank_lines=False,
                    low_memory=False,
                )
                frames.append(frame)
        whole = pd.concat(frames[1:] or frames, ignore_index=True)
        whole = whole[list(positions)].set_axis(range(len(positions)), axis="columns")
        for name in whole if self.decimal == "," else ():
            if not pd.api.types.is_numeric_dtype(whole[name]):  # words made text of the numbers beside them
                cells = whole[name].astype("str")
                numbers = cells.str.fullmatch(_DECIMAL_COMMA.pattern)
                whole[name] = whole[name].mask(numbers, cells.str.replace(",", "."))
        left_out = f"log: {words} lines below its names hold words and no number; left out."
        return whole, lines, [left_out] * bool(words)


def _encoding_of(head: bytes) -> str:
    """How characters are written; a UnicodeError where it is no text."""
    try:
        codecs.getincrementaldecoder(_ENCODING)().decode(head)  # the last character may be cut
    except UnicodeDecodeError:
        if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) and "\n" in head.decode("utf-16", "replace"):
            return "utf-16"
        if b"\0" in head:
            raise
        return "cp1252"
    return _ENCODING


def _cells(text: str, separator: str) -> list[str]:
    if separator == _BLANK:
        return text.split()
    if separator == _WIDE:
        return re.split(r"\s{2,}|\t", text.strip())
    if separator not in text:
        return [text.strip('"')]
    with suppress(csv.Error):  # a cell of a hundred thousand characters
        return next(csv.reader([text], delimiter=separator, skipinitialspace=True), [])
    return [text]


# --- Spreadsheets, as the text that a program would save of the sheet that holds a table ------------------

# Values are those that the program which saved the file had worked out; formulas are not evaluated.
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
        if unpacked > min(_MOST_BYTES, most_unpacked(path, at_once=True)):
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
    return _Text(path, lambda: io.BytesIO(content), f"sheet '{name}', row").table("spreadsheet", notes)


def _rows(sheet: Any) -> Iterator[list[str]]:
    """The rows as text, from the first of the sheet on; times of the day and durations in s."""
    sheet.reset_dimensions()  # what a file says of its own size may be wrong
    for number, values in enumerate(sheet.iter_rows(values_only=True), start=1):
        if number > _MOST_ROWS:  # the library fills up to whatever number a row has
            raise ValueError(f"a row beyond {_MOST_ROWS}")
        midnight = datetime.datetime.min
        cells = [midnight.combine(midnight, x) - midnight if isinstance(x, datetime.time) else x for x in values]
        cells = [x.total_seconds() if isinstance(x, datetime.timedelta) else x for x in cells]
        yield ["" if x is None else str(x).replace("\n", " ").strip() for x in cells]
