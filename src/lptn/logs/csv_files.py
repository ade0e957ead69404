"""Tables written as text: CSV and its kin, opened as a log. Comma, semicolon, tab or blanks separate, quoted or not."""

from __future__ import annotations

import codecs
import csv
import gzip
import io
import os
import re
import zlib
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from itertools import islice, takewhile
from pathlib import Path
from typing import BinaryIO

import pandas as pd
import pyarrow as pa
import pyarrow.csv as pa_csv

from lptn.basics.errors import InputError
from lptn.basics.files import fingerprint
from lptn.logs import tables
from lptn.logs.columns import is_number
from lptn.logs.layout import LOOKED_AT, Layout, RowsBelow, find_layout, is_value, names_of
from lptn.logs.tables import TIMES_PACKED, Bounded, Table, most_unpacked, one_line_if_broken, too_large

ENDINGS = (".csv", ".tsv", ".txt", ".csv.gz", ".tsv.gz", ".txt.gz")

_ENCODING = "utf-8"
_LONGEST_LINE = 1 << 24  # characters, of 100,000 columns with long names; binary files may have no line end at all
_HEAD, _FEWEST_LINES = 1 << 19, 4  # characters that are looked at for the layout, and lines that are in any case
_SEPARATORS = ",;\t"
_BLANK, _WIDE = " ", "  "  # any number of blanks and tabs; two or more, where names have blanks of their own
_MOST_SHOWN = 6  # names of columns in a note
_BEGINS_A_NUMBER = frozenset("+-.0123456789")
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")
_BLOCK, _LINES_IN_A_BLOCK = 1 << 22, 8  # bytes that are parsed at once, and lines at least
_CELLS_IN_A_CHUNK = 4_000_000  # the same where any row is admitted


def open_csv(path: Path) -> Table:
    """Open a table of text, perhaps compressed, and find its column names.

    Raises:
        InputError: it can't be read, or begins no table.
    """
    text = _Text.of(path, *_begin(path))
    cut = False
    if path.suffix != ".gz":  # the last line of a plain file may have no end: its writer was stopped, or the copy
        with path.open("rb") as file:
            file.seek(-min(2, path.stat().st_size), os.SEEK_END)
            cut = not file.read().strip(b"\0").endswith((b"\n", b"\r"))  # in UTF-16 it has a zero beside it
    notes = ["the file ends within a line, which is left out: its last number may be cut."] if cut else []
    if text.encoding != _ENCODING:
        notes.append(f"log: its text is read as {text.encoding}, for it is not in UTF-8.")
    if not text.layout.named:
        notes.append(f"log: there are no names above line {text.first_line}; {text.said_of_names}.")
    elif text.layout.header:
        line = text.lines[text.layout.header]
        notes.append(f"log: its table begins on line {line}; what stands above is left out.")
    place = {name: number for number, name in reversed(list(enumerate(text.names)))}
    lines: list[int] = []

    def read(wanted: Sequence[str]) -> pd.DataFrame:
        positions = [place[name] for name in wanted]
        frame = text.read_regular(positions)
        if frame is not None:
            frame = frame.iloc[: len(frame) - cut]
        else:
            frame, lines[:], said = text.read_any(positions, cut)
            table.note(said)
        return text.with_points(frame).set_axis(list(wanted), axis="columns")

    def where(row: int) -> str:
        if lines:
            return f"line {lines[row]}"
        line, _ = next(islice(_lines(path, text.encoding), text.layout.first + row, None), (0, ""))
        return f"line {line}" if line else f"row {row + 1}"  # of a file that pyarrow cuts into lines another way

    units = dict(zip(text.names, text.layout.units, strict=False))
    table = Table(path, text.names, read, where, units=units, notes=notes, digest=partial(fingerprint, path))
    return table


@dataclass(frozen=True)
class _Text:
    """What is known of a table of text before it is read as a whole.

    Args:
        path: the file.
        encoding: of its characters.
        separator: of its cells; `_BLANK` and `_WIDE` stand for more.
        decimal: the sign in its numbers.
        layout: where the table begins, among lines that are neither blank nor comments.
        lines: the numbers of those lines in the file, from 1.
        names: of its columns.
        first: cells of the first row.
        said_of_names: where names come from that no line of their own has.
    """

    path: Path
    encoding: str
    separator: str
    decimal: str
    layout: Layout
    lines: tuple[int, ...]
    names: tuple[str, ...]
    first: tuple[str, ...]
    said_of_names: str = ""

    @property
    def first_line(self) -> int:
        """The number of the first row's line; of the one below the names where none was found."""
        return (*self.lines, self.lines[-1] + 1)[self.layout.first]

    @classmethod
    def of(cls, path: Path, encoding: str, head: Sequence[tuple[int, str]]) -> _Text:
        """What the first lines say.

        Raises:
            InputError: they don't begin a table.
        """
        lines, texts = tuple(number for number, _ in head), [text for _, text in head]

        def tried(separator: str) -> tuple[int, int, Layout, list[list[str]], str]:
            rows = [_cells(text, separator) for text in texts]
            layout = find_layout(rows)
            return layout.rows, len(rows[max(layout.header, 0)]), layout, rows, separator

        best = max(map(tried, _SEPARATORS), key=lambda one: one[:2])
        if best[0] == 0 or best[1] == 1:  # blanks stand in names and dates, too
            blanks = tried(_BLANK)
            _, width, layout, rows, _ = wide = tried(_WIDE)
            as_wide = layout.first < len(rows) and len(rows[layout.first]) == width > 1
            best = max(best, wide if as_wide else blanks, key=lambda one: one[:2])
        _, width, layout, rows, separator = best
        tables.COLUMNS.check(width, path, "header")
        first = rows[layout.first] if layout.first < len(rows) else []
        said, above = "", rows[max(layout.header, 0)]
        names = names_of(above)
        if not layout.named and len(rows) > layout.first:
            names = names_of([""] * len(first))
            said = f"its columns are called {', '.join(names[:_MOST_SHOWN])}{' …' * (len(names) > _MOST_SHOWN)}"
            comment = _cells(_comment_above(path, encoding, lines[layout.first]), separator)
            if len(comment) == len(names) and not all(map(is_value, comment)):
                names, said = names_of(comment), "those of the comment above are taken"
            elif layout.header >= 0 and separator.strip(" ") and len(list(filter(None, above))) > 1:
                raise _other_count(path, len(first), len(above))
        if layout.rows == 0 and all(map(is_number, names)):
            raise InputError(path, "header", f"numbers ({', '.join(names[:3])})", "a line of column names, and rows")
        if len(first) > len(names) + 1 or any(first[len(names) :]):
            raise _other_count(path, len(first), len(names))
        cells = (cell.strip() for row in rows[layout.first :] for cell in row)
        decimal = "," if separator != "," and any(map(_DECIMAL_COMMA.fullmatch, cells)) else "."
        return cls(path, encoding, separator, decimal, layout, lines, names, tuple(first), said)

    def read_regular(self, positions: Sequence[int]) -> pd.DataFrame | None:
        """The columns at `positions` of a file whose rows are all as long as the header, and hold what the first does.

        `None` for any other, which `read_any` reads, or says what is wrong with it. Only these columns are turned into
        numbers, so that time and memory are theirs; and the first, where a comment would stand.
        """
        if len(self.first) != len(self.names) or self.separator in (_BLANK, _WIDE):
            return None
        keys = [str(number) for number in range(len(self.names))]
        wanted = [keys[position] for position in dict.fromkeys((*positions, 0))]
        kinds = {key: pa.float64() if self._is_number(int(key)) else pa.string() for key in wanted}
        most, batches = tables.MOST_NUMBERS // max(len(positions), 1), list[pa.RecordBatch]()
        longest = max(map(len, self.first), default=0) * len(self.names)
        reading = pa_csv.ReadOptions(
            use_threads=False,
            skip_rows=self.first_line - 1,
            column_names=keys,
            block_size=max(_BLOCK, _LINES_IN_A_BLOCK * longest),
            encoding=self.encoding,
        )
        conversion = pa_csv.ConvertOptions(
            include_columns=wanted, column_types=kinds, decimal_point=self.decimal, strings_can_be_null=True
        )
        parsing = pa_csv.ParseOptions(delimiter=self.separator)
        try:
            with (
                _unpacked(self.path) if self.path.suffix == ".gz" else nullcontext(self.path) as file,
                pa_csv.open_csv(file, reading, parsing, conversion) as reader,
            ):
                for batch in reader:
                    batches.append(batch)
                    if sum(batch.num_rows for batch in batches) >= most:
                        raise too_large(self.path, f"{most} rows or more")
        except InputError:
            raise
        except (pa.ArrowException, OSError, ValueError):
            return None
        frame = pa.Table.from_batches(batches, reader.schema).to_pandas(split_blocks=True)
        if kinds["0"] == pa.string() and frame["0"].str.lstrip().str.startswith("#", na=False).any():
            return None
        return pd.DataFrame({k: frame[keys[position]] for k, position in enumerate(positions)}, copy=False)

    def _is_number(self, position: int) -> bool:
        cell = self.first[position].strip()
        return not cell or is_number(cell.replace(self.decimal, "."))

    def read_any(self, positions: Sequence[int], cut: bool) -> tuple[pd.DataFrame, list[int], list[str]]:
        """The columns at `positions` of any file of rows, comments among them; the rows' lines; and notes.

        A row of words without a number is no row of the table: its names again, a logger's message, a last line that
        says how many there were. Nor is the last one where it was `cut`.

        Raises:
            InputError: a row has more or fewer cells than there are names, or the file is broken.
        """
        below, lines = RowsBelow(self.path, self.names, self.layout.units), list[int]()
        most, at_once = tables.MOST_NUMBERS // max(len(positions), 1), max(_CELLS_IN_A_CHUNK // len(self.names), 1)
        frames, rows = [pd.DataFrame({position: [] for position in positions})], self._rows(below, lines, cut)
        with one_line_if_broken(self.path, "a whole table"):
            while some := "\n".join(islice(rows, at_once)):
                if len(lines) >= most:
                    raise too_large(self.path, f"{most} rows or more")
                frame = pd.read_csv(
                    io.StringIO(some),
                    sep=self._between,
                    decimal=self.decimal,
                    header=None,
                    usecols=sorted(set(positions)),
                    skipinitialspace=True,
                    skip_blank_lines=False,
                    low_memory=False,
                )
                frames.append(frame)
        whole = pd.concat(frames[1:] or frames, ignore_index=True)
        return whole[list(positions)].set_axis(range(len(positions)), axis="columns"), lines, below.said()

    def _rows(self, below: RowsBelow, lines: list[int], cut: bool) -> Iterator[str]:
        """Rows as lines of text whose cells stand in the order of the names; the lines' numbers go into `lines`."""
        in_order = below.order
        for number, line in _whole_lines(self.path, self.encoding, self.first_line, cut):
            # Most begin with a number, and their cells need no look.
            plain = line[0] in _BEGINS_A_NUMBER and '"' not in line and self.separator not in (_BLANK, _WIDE)
            if plain and below.order == in_order and line.count(self.separator) + 1 == len(self.names):
                lines.append(number)
                yield line
                continue
            cells = _cells(line, self.separator)
            if below.holds_values(f"line {number}", cells):
                lines.append(number)
                text = io.StringIO()
                csv.writer(text, delimiter=self._between, lineterminator="").writerow(cells[k] for k in below.order)
                yield text.getvalue()

    @property
    def _between(self) -> str:
        """What stands between cells where a row is written anew."""
        return "\t" if self.separator in (_BLANK, _WIDE) else self.separator

    def with_points(self, frame: pd.DataFrame) -> pd.DataFrame:
        """The same, where words made text of numbers beside them that are written with a comma."""
        if self.decimal == ",":
            for name in frame:
                if not pd.api.types.is_numeric_dtype(frame[name]):
                    text = frame[name].astype("str")
                    frame[name] = frame[name].where(
                        ~text.str.fullmatch(_DECIMAL_COMMA.pattern), text.str.replace(",", ".")
                    )
        return frame


def _other_count(path: Path, values: int, names: int) -> InputError:
    problem = f"{values} values in the first row under {names} names"
    return InputError(path, "header", problem, "a name for each column, and numbers with a decimal point")


def _begin(path: Path) -> tuple[str, list[tuple[int, str]]]:
    """How a file's characters are written, and its first lines that hold something, each with its number.

    UTF-16 says so by its first bytes; what is not UTF-8 is as Windows had it.

    Raises:
        InputError: it can't be read, or is no table of text.
    """
    lines: list[tuple[int, str]] = []
    try:
        with _unpacked(path) as file:
            head = file.read(_HEAD)
        encoding = _ENCODING
        try:
            # The last character may be cut.
            codecs.getincrementaldecoder(_ENCODING)().decode(head)
        except UnicodeDecodeError:
            is_utf16 = head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
            encoding = "utf-16" if is_utf16 and "\n" in head.decode("utf-16", "replace") else "cp1252"
            if b"\0" in head and encoding == "cp1252":
                raise
        characters = 0
        for number, text in islice(_lines(path, encoding), LOOKED_AT):
            lines.append((number, text))
            characters += len(text)
            if characters > _HEAD and len(lines) >= _FEWEST_LINES:
                break
    except (OSError, EOFError, zlib.error, UnicodeError) as error:
        raise InputError(path, "log", f"a file that can't be read ({error})", "CSV text in UTF-8") from error
    if not lines:
        raise InputError(path, "log", "an empty file", "a header line and at least 10 rows")
    if len(lines[0][1]) >= _LONGEST_LINE - 1:
        raise InputError(path, "header", "a line of 16 million characters", "a line of column names")
    return encoding, lines


def _unpacked(path: Path) -> BinaryIO:
    """A file's bytes, to be read, unpacked where it is compressed."""
    if path.suffix != ".gz":
        return path.open("rb")
    found = f"a file that unfolds to more than {TIMES_PACKED} times its size"
    error = InputError(path, "log", found, "a compressed table of readings")
    packed = gzip.open(path)  # noqa: SIM115 - closed with what is returned
    return io.BufferedReader(Bounded(packed, most_unpacked(path), error), _BLOCK)


def _cells(text: str, separator: str) -> list[str]:
    if separator == _BLANK:
        return text.split()
    if separator == _WIDE:
        return re.split(r"\s{2,}|\t", text.strip())
    if separator not in text:
        return [text.strip('"')]
    try:
        return next(csv.reader([text], delimiter=separator, skipinitialspace=True), [])
    except csv.Error:  # a cell of a hundred thousand characters
        return [text]


def _lines(path: Path, encoding: str, comments: bool = False) -> Iterator[tuple[int, str]]:
    """The lines that hold data, each with its number from 1: neither blank nor comment; or the comments.

    A comment is a line that begins with #: in a name, or within a row, it is a character like any other.
    """
    with _unpacked(path) as file:
        marked = "utf-8-sig" if encoding == _ENCODING else encoding  # Excel writes a byte order mark
        text_stream = io.TextIOWrapper(file, encoding=marked, errors="replace", newline="")
        for number, line in enumerate(iter(partial(text_stream.readline, _LONGEST_LINE), ""), start=1):
            text = line.strip("\r\n ")
            if text.strip() and text.startswith("#") == comments:
                yield number, text


def _whole_lines(path: Path, encoding: str, first: int, cut: bool) -> Iterator[tuple[int, str]]:
    """The lines of data from the `first` on; without the last one where it was `cut`."""
    before: list[tuple[int, str]] = []
    for number, text in _lines(path, encoding):
        if number >= first:
            yield from before
            before = [(number, text)]
    if not cut:
        yield from before


def _comment_above(path: Path, encoding: str, line: int) -> str:
    """What the last line of comment says above one of data, without its mark; '' where there is none."""
    above = takewhile(lambda one: one[0] < line, _lines(path, encoding, comments=True))
    return next((text.lstrip("# ") for _, text in deque(above, maxlen=1)), "")
