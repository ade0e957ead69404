"""Tables of text and spreadsheets opened as logs. Comma, semicolon, tab or blanks separate, quoted or not.

Loggers and spreadsheets write what they like above their table. The line of names is the one without a number below
which the most rows of values follow; a table without one has columns called `column 1`, `column 2` and so on. A cell
stands under a name if its row has as many cells as there are names: any other row is refused, never shifted.
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
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import pandas as pd

from lptn.basics.bounds import Bound
from lptn.basics.errors import InputError
from lptn.logs import tables
from lptn.logs.clock import DAY
from lptn.logs.columns import ColumnSource, is_number, is_unit
from lptn.logs.tables import Bounded, Table, most_unpacked, require_package, too_large

# --- Where the table begins among rows of cells, and under which names they stand -------------------------

_LOOKED_AT = 200  # rows at most, from the first: nobody writes more above a table
_FEWEST_ALIKE = 5  # rows of numbers alone, and of one length, that begin a table without names

# A number with either decimal sign, a date or a time of the day, or what people write where there is none.
_NUMBER = r"[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:e[-+]?\d+)?"
_CLOCK = r"\d+:\d\d(?::\d\d)?(?:[.,]\d*)?"
_DATE = rf"\d{{1,4}}[-/.]\d{{1,2}}[-/.]\d{{1,4}}(?:[T ]{_CLOCK})?(?:Z| ?[-+]\d\d:?\d\d)?"
_NOTHING = r"[-+]?(?:nan|inf|infinity)|n/a|na|null|none"
_VALUE = re.compile(f"{_NUMBER}|{_CLOCK}|{_DATE}|{_NOTHING}", re.IGNORECASE)


def _is_value(cell: str) -> bool:
    """Whether a cell is one of a table's values: a number, a date or time, or what people write where there is none."""
    return len(cell) <= tables.LONGEST_CELL and _VALUE.fullmatch(cell.strip()) is not None


def _width_of(cells: Sequence[str]) -> int:
    """How many cells a row has, without the empty ones behind its last."""
    return max((k for k, cell in enumerate(cells, start=1) if cell.strip()), default=0)


def _names_of(cells: Sequence[str]) -> tuple[str, ...]:
    """The names in a row, without blanks and byte order marks (of a file that was joined); `column 3` of no third."""
    return tuple(cell.strip("\ufeff \t") or f"column {number}" for number, cell in enumerate(cells, start=1))


def _units_of(cells: Sequence[str]) -> tuple[str, ...]:
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


def find_layout(rows: Sequence[Sequence[str]]) -> Layout:
    """The layout of a file's first rows of cells, neither blank ones nor comments among them.

    Where nothing looks like a table, that of one that begins with its names.
    """
    widths, of_values = list(map(_width_of, rows)), [any(map(_is_value, row)) for row in rows]
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
    alike = [width > 1 and all(map(_is_value, row[:width])) for row, width in zip(rows, widths, strict=True)]
    for first in range(len(rows) - _FEWEST_ALIKE + 1):
        here = slice(first, first + _FEWEST_ALIKE)
        if all(alike[here]) and len(set(widths[here])) == 1:
            return Layout(first - 1, (), sum(alike[first:]), named=False)
    return best


def _holds_values(path: Path, place: str, names: tuple[str, ...], units: tuple[str, ...], cells: Sequence[str]) -> bool:
    """Whether a row below a table's names and units is one of the table's, or one of words, which is left out.

    Names may stand again, and units.

    Raises:
        InputError: the row, `place` in words, has more or fewer cells than there are names; other names, or units.
    """
    filled, count = [cell.strip() for cell in cells if cell.strip()], _width_of(cells)
    width = count if count > len(names) else min(len(cells), len(names))
    if any(map(_is_value, filled)):
        if width != len(names):
            said = f"{width} cell{'s' * (width != 1)} under {len(names)} names"
            raise InputError(path, place, said, "as many cells in each row as there are names")
        return True
    if not filled and width == len(names):
        return True
    other, again, units_again = "", _names_of(cells[:width]), _units_of(cells[:width])
    as_names = not set(names).isdisjoint(filled) or (width > 1 and len(set(filled)) == width == len(names))
    if width == len(names) and all(map(is_unit, filled)):
        if units_again != units:
            other = f"units ({', '.join(units_again)}) that the table does not begin with"
    elif as_names and again != names:
        other = f"other names, or another order of them ({', '.join(again)}), than the table begins with"
    if other:
        raise InputError(path, place, other, "a table of one kind of rows; what follows, in a file of its own")
    return False


# --- The lines of a text ----------------------------------------------------------------------------------

_UTF_8 = "utf-8-sig"  # Excel writes a byte order mark
_LONGEST = 1 << 24
"""Characters of a line, and of what is looked through for a table: 100,000 columns with long names have as many, and
binary files may have no line end at all."""
_MOST_LINES = 50_000_000
"""At a µs each: five days at 100 Hz. Blank ones pack into nothing."""
_HEAD, _FEWEST_LINES = 1 << 19, 4  # characters that are looked at for the layout, and lines that are in any case


class _Lines:
    """The lines of a text whose bytes are opened again and again, each called `row` and its number, from 1.

    Attributes:
        encoding: UTF-16 says so by its first bytes; what is not UTF-8 is as Windows had it.
        cut: its last line has no end: its writer was stopped, or the copy. A packed file is not asked for its end.

    Raises:
        OSError, EOFError, zlib.error, UnicodeError: it can't be read, or is no text.
    """

    def __init__(self, path: Path, opened: Callable[[], BinaryIO], row: str) -> None:
        self.path, self.row, self._opened, self.encoding, self.cut = path, row, opened, _UTF_8, False
        with opened() as file:
            head = file.read(_HEAD)
            if file.seekable():
                file.seek(-min(2, file.seek(0, os.SEEK_END)), os.SEEK_END)
                end = file.read().strip(b"\0")  # in UTF-16 it has a zero beside it
                self.cut = not end.endswith((b"\n", b"\r"))
        try:
            codecs.getincrementaldecoder("utf-8")().decode(head)  # the last character may be cut
        except UnicodeDecodeError:
            wide = head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) and "\n" in head.decode(
                "utf-16", "replace"
            )
            if b"\0" in head and not wide:
                raise
            self.encoding = "utf-16" if wide else "cp1252"

    def __iter__(self) -> Iterator[tuple[int, str]]:
        """All lines but a cut one, and their numbers, without blanks around what they hold.

        Raises:
            InputError: a line, or their number, is beyond all bounds.
        """
        number, rest = 0, ""
        with self._opened() as file:
            stream = io.TextIOWrapper(file, encoding=self.encoding, errors="replace")
            while block := stream.read(_BLOCK):
                *lines, rest = (rest + block).split("\n")
                for line in lines:
                    number += 1
                    yield number, line.strip(" ")
                if number > _MOST_LINES:
                    raise InputError(self.path, "log", f"more than {_MOST_LINES:,} lines", "a log cut into pieces")
                if len(rest) >= _LONGEST:
                    place = f"{self.row} {number + 1}"
                    raise InputError(self.path, place, "a line of 16 million characters", "a table of readings")
        if rest and not (self.cut and number):
            yield number + 1, rest.strip(" ")

    def begin(self) -> tuple[dict[int, str], list[tuple[int, str]]]:
        """The first lines that hold data, by their numbers, and those of comment with theirs.

        Raises:
            InputError: there is none.
        """
        texts, comments, characters = dict[int, str](), list[tuple[int, str]](), 0
        for number, line in self:
            characters += len(line) + 1
            if line.startswith("#"):
                comments.append((number, line.lstrip("# ")))
            elif line.strip():
                texts[number] = line
            if len(texts) == _LOOKED_AT or (characters > _HEAD and len(texts) >= _FEWEST_LINES):
                break
            if characters > _LONGEST:
                found = f"no table within its first {characters:,} characters"
                raise InputError(self.path, "log", found, "a line of column names, and rows")
        if not texts:
            raise InputError(self.path, "log", "an empty file", "a header line and at least 10 rows")
        return texts, comments


_SEPARATORS = ",;\t"
_BLANK, _WIDE = _BLANKS = " ", "  "  # any number of blanks and tabs; two or more, where names have blanks of their own


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


# --- A table of text --------------------------------------------------------------------------------------

_WORDS = Bound(200_000, "lines of words without a number")
"""Of a table of numbers, which a logger's messages may stand among; a look at each takes 0.1 ms."""
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

    return _table_of_text(path, unpacked, "line", "CSV", [])


def _table_of_text(path: Path, opened: Callable[[], BinaryIO], row: str, kind: str, notes: list[str]) -> Table:
    """A text as a log of a kind, whose lines are called `row`; the first of them say what is in it.

    Raises:
        InputError: it can't be read, or its lines begin no table.
    """
    try:
        lines = _Lines(path, opened, row)
        texts, comments = lines.begin()
    except (OSError, EOFError, zlib.error, UnicodeError) as error:
        raise InputError(path, "log", f"a file that can't be read ({error})", "CSV text in UTF-8") from error

    def tried(separator: str) -> tuple[int, bool, int, str, Layout, list[list[str]]]:
        rows = [_cells(text, separator) for text in texts.values()]
        layout = find_layout(rows)
        width, width_of_first = (len(row) for row in (rows[max(layout.header, 0)], [*rows, []][layout.first]))
        return layout.rows, width == width_of_first, width, separator, layout, rows

    best = max(map(tried, _SEPARATORS), key=lambda one: one[:3])
    if best[0] == 0 or best[2] == 1:  # blanks stand in names and dates, too
        best = max(best, tried(_WIDE), tried(_BLANK), key=lambda one: one[:3])
    _, _, width, separator, layout, rows = best
    tables.COLUMNS.check(width, path, "header")
    numbers = [*texts, max(texts) + 1]  # of the lines that were looked at, and of one below them
    first = numbers[layout.first]
    comment = max((one for one in comments if one[0] < first), default=(0, ""))[1]
    names, of_names = _named(path, layout, rows, _cells(comment, separator), blank=separator in _BLANKS)
    cells = (cell.strip() for row in rows[layout.first :] for cell in row)
    decimal = "," if separator != "," and any(map(_DECIMAL_COMMA.fullmatch, cells)) else "."
    if lines.cut:
        notes.append("the file ends within a line, which is left out: its last number may be cut.")
    if lines.encoding != _UTF_8:
        notes.append(f"log: its text is read as {lines.encoding}, for it is not in UTF-8.")
    if not layout.named:
        notes.append(f"log: there are no names above {row} {first}; {of_names}.")
    elif layout.header:
        notes.append(f"log: its table begins on {row} {numbers[layout.header]}; what stands above is left out.")
    kept = array("q")  # the numbers of the lines that were read last

    def read(wanted: Sequence[str]) -> pd.DataFrame:
        words, positions = array("q"), list(map(names.index, wanted))
        del kept[:]
        rows = _rows_below(lines, first, names, layout.units, separator, kept, words)
        frame = _parsed(path, rows, positions, len(names), separator, decimal)
        if words:
            table.note(f"log: {len(words)} lines below its names hold words and no number; left out.")
        return frame.set_axis(list(wanted), axis="columns")

    units, (known, said) = dict(zip(names, layout.units, strict=False)), _known_columns(names)
    notes = [*notes, *said]
    table = Table(path, names, read, lambda k: f"{row} {kept[k]}", kind, defaults=known, notes=notes, units=units)
    return table


def _named(
    path: Path, layout: Layout, rows: list[list[str]], comment: list[str], *, blank: bool
) -> tuple[tuple[str, ...], str]:
    """The names of a table's columns, and where they come from if no line of their own has them.

    Raises:
        InputError: the first row has another number of cells than there are names, or all names are numbers.
    """
    above, first = rows[max(layout.header, 0)], [*rows, []][layout.first]
    names, origin = _names_of(above), ""
    found = f"{len(first)} values in the first row under {len(above)} names"
    other_count = InputError(path, "header", found, "a name for each column, and numbers with a decimal point")
    if not layout.named and first:
        names = _names_of([""] * len(first))
        origin = f"its columns are called {', '.join(names[:_MOST_SHOWN])}" + " …" * (len(names) > _MOST_SHOWN)
        if len(comment) == len(names) and not all(map(_is_value, comment)):
            names, origin = _names_of(comment), "those of the comment above are taken"
        elif layout.header >= 0 and not blank and len(list(filter(None, above))) > 1:
            raise other_count
    if layout.rows == 0 and all(map(is_number, names)):
        raise InputError(path, "header", f"numbers ({', '.join(names[:3])})", "a line of column names, and rows")
    if len(first) > len(names) + 1 or any(first[len(names) :]):
        raise other_count
    return names, origin


def _rows_below(
    lines: _Lines,
    first: int,
    names: tuple[str, ...],
    units: tuple[str, ...],
    separator: str,
    kept: array[int],
    words: array[int],
) -> Iterator[str]:
    """The rows from the `first` line on as texts for pandas.

    A comment is a line that begins with #: in a name, or within a row, it is a character like any other. A row of words
    without a number is no row of the table: its names again, a logger's message, a last line that says how many there
    were. The numbers of lines go to `kept`, and to `words`.

    Raises:
        InputError: a row has more or fewer cells than there are names.
    """
    blank = separator in _BLANKS
    between, signs = "\t" if blank else separator, len(names) - 1
    for number, line in lines:
        if number < first:
            continue
        row = between.join(_cells(line, separator)) if blank else line
        # Most begin with a number, and their cells need no look.
        if not (line[:1] in _BEGINS_A_NUMBER and '"' not in line and row.count(between) == signs):
            if not line or line.isspace() or line[0] == "#":
                continue
            place = f"{lines.row} {number}"
            if not _holds_values(lines.path, place, names, units, _cells(line, separator)):
                words.append(number)
                _WORDS.check(len(words), lines.path, place)
                continue
        kept.append(number)
        yield row


def _parsed(
    path: Path, rows: Iterator[str], positions: list[int], width: int, separator: str, decimal: str
) -> pd.DataFrame:
    """Some columns of rows of a table so wide.

    Raises:
        InputError: there are too many rows.
    """
    most, at_once, count = tables.MOST_NUMBERS // max(len(positions), 1), max(_CELLS_IN_A_CHUNK // width, 1), 0
    frames = [pd.DataFrame({position: [] for position in positions})]
    while some := "\n".join(islice(rows, at_once)):
        frame = pd.read_csv(
            io.BytesIO(some.encode()),  # three times as fast as of a text
            sep="\t" if separator in _BLANKS else separator,
            decimal=decimal,
            header=None,
            usecols=sorted(positions),
            skipinitialspace=True,
            skip_blank_lines=False,
            low_memory=False,
        )
        frames.append(frame)
        if (count := count + len(frame)) >= most:
            raise too_large(path, f"{most} rows or more")
    whole = pd.concat(frames[1:] or frames, ignore_index=True)[positions]
    for name in whole if decimal == "," else ():
        if not pd.api.types.is_numeric_dtype(whole[name]):  # words made text of the numbers beside them
            cells = whole[name].astype("str")
            whole[name] = whole[name].mask(cells.str.fullmatch(_DECIMAL_COMMA.pattern), cells.str.replace(",", "."))
    return whole


# --- Tables of drives, known by their makers' names --------------------------------------------------------


class _Maker(NamedTuple):
    """A drive's names, in the units that it writes.

    Args:
        known: where quantities stand; of two entries of one quantity the first that is there.
        always: names that each of its tables has.
        said: what else a reader must know.
    """

    known: Sequence[tuple[str, ColumnSource]]
    always: frozenset[str]
    said: str


_PEAKS = 'its currents are peaks: amperes = "amplitude"'
_MAKERS = {
    # Electrical turns a minute are no speed without the pole pairs.
    "VESC": _Maker(
        (
            ("time", ColumnSource(("ms_today",), "ms", wrap=1000 * DAY)),
            ("temperature.motor", ColumnSource(("temp_motor",), "degC")),
            ("temperature.mosfet", ColumnSource(("temp_mos_max",), "degC")),
            ("current.motor", ColumnSource(("d_axis_current", "q_axis_current"))),
            ("power.battery", ColumnSource(("input_voltage", "current_in"), how="product")),
            ("speed.base", ColumnSource(("speed_meters_per_sec",))),
        ),
        frozenset(("ms_today", "temp_motor", "temp_mos_max")),
        _PEAKS,
    ),
    # Registers as moteus' Python library calls them, in the units of its register reference. POWER is left out: it
    # is electrical, what the shaft delivers is in it.
    "moteus": _Maker(
        (
            ("temperature.motor", ColumnSource(("MOTOR_TEMPERATURE",), "degC")),
            ("temperature.board", ColumnSource(("TEMPERATURE",), "degC")),
            ("torque.motor", ColumnSource(("TORQUE",))),
            ("current.motor", ColumnSource(("D_CURRENT", "Q_CURRENT"))),
            ("velocity.motor", ColumnSource(("VELOCITY",), "turn/s")),
        ),
        frozenset(("time", "MODE", "TORQUE", "TEMPERATURE")),
        "torque and speed are those of its output shaft",
    ),
}
# The paths of an ODrive's properties, behind its axis (and its own name): firmware 0.5, then 0.6.
_ODRIVE = (
    ("temperature.{}", ColumnSource(("motor.motor_thermistor.temperature",), "degC")),
    ("temperature.{}_mosfet", ColumnSource(("motor.fet_thermistor.temperature",), "degC")),
    ("current.{}", ColumnSource(("motor.current_control.Id_measured", "motor.current_control.Iq_measured"))),
    ("current.{}", ColumnSource(("motor.foc.Id_measured", "motor.foc.Iq_measured"))),
    ("velocity.{}", ColumnSource(("encoder.vel_estimate",), "turn/s")),
    ("velocity.{}", ColumnSource(("vel_estimate",), "turn/s")),
)
_AXIS = re.compile(r"((?:\w+\.)?axis\d)\.motor\.(?:motor|fet)_thermistor\.temperature")


def _known_columns(names: Sequence[str]) -> tuple[dict[str, ColumnSource], list[str]]:
    """Where the quantities of a table stand that a drive wrote, and a note on it; nothing of other tables."""
    there, known, notes = set(names), dict[str, ColumnSource](), list[str]()
    axes = dict.fromkeys(match[1] for name in names if (match := _AXIS.fullmatch(name)))
    of_axes = [
        (key.format(axis.replace(".", "_")), replace(source, columns=tuple(f"{axis}.{one}" for one in source.columns)))
        for axis in axes
        for key, source in _ODRIVE
    ]
    for name, maker in (_MAKERS | {"ODrive": _Maker(of_axes, frozenset(), _PEAKS)}).items():
        if there.issuperset(maker.always):
            own = {key: source for key, source in reversed(maker.known) if there.issuperset(source.columns)}
            own = {key: own[key] for key, _ in maker.known if key in own}
            known |= own
            notes += [f"{', '.join(own)}: known by {name}'s names; {maker.said}."] if own else []
    return known, notes


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

    with zipfile.ZipFile(path) as archive:
        unpacked = sum(part.file_size for part in archive.infolist())
    if unpacked > min(_MOST_BYTES, most_unpacked(path, at_once=True)):
        raise InputError(path, "log", f"{unpacked / 1e9:.2g} GB unpacked", "a spreadsheet of readings, or CSV")
    with closing(load_workbook(path, read_only=True, data_only=True, keep_links=False)) as book:
        heads = {sheet.title: list(islice(filter(any, _rows(sheet)), _LOOKED_AT)) for sheet in book.worksheets}
        layouts = {name: find_layout(rows) for name, rows in heads.items()}
        found = [name for name, layout in layouts.items() if layout.rows]
        if not found:
            expected = "a row of column names, and rows of numbers below it"
            raise InputError(path, "log", "no table in any sheet", expected)
        name = max(found, key=lambda name: layouts[name].rows)
        width = _width_of(heads[name][layouts[name].header if layouts[name].named else layouts[name].first])
        text, count = io.StringIO(newline=""), 0
        write = csv.writer(text, quoting=csv.QUOTE_ALL, lineterminator="\n").writerow
        for cells in _rows(book[name]):
            filled = _width_of(cells)
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
    return _table_of_text(path, lambda: io.BytesIO(content), f"sheet '{name}', row", "spreadsheet", notes)


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
