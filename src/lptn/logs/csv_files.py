"""Tables written as text: CSV and its kin, opened as a log. Comma, semicolon or tab separate, quoted or not."""

from __future__ import annotations

import codecs
import csv
import gzip
import os
import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd
import pyarrow as pa
import pyarrow.csv as pa_csv

from lptn.basics.errors import InputError
from lptn.basics.files import fingerprint
from lptn.logs import tables
from lptn.logs.layout import LOOKED_AT, Layout, find_layout, is_value
from lptn.logs.tables import Table, broken, too_large

ENDINGS = (".csv", ".tsv", ".txt", ".csv.gz", ".tsv.gz", ".txt.gz")

_ENCODING = "utf-8"
_LONGEST_LINE = 1 << 24  # characters, of 100,000 columns with long names; binary files may have no line end at all
_HEAD, _FEWEST_LINES = 1 << 19, 4  # characters that are looked at for the layout, and lines that are in any case
_SEPARATORS = ",;\t"
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")
_BLOCK, _LINES_IN_A_BLOCK = 1 << 22, 8  # bytes that are parsed at once, and lines at least
_CELLS_IN_A_CHUNK = 4_000_000  # the same where any row is admitted


def open_csv(path: Path) -> Table:
    """Open a table of text, perhaps compressed, and find its column names.

    Raises:
        InputError: it can't be read, or has no line of names.
    """
    encoding, head = _begin(path)
    text = _Text.of(path, encoding, head)
    cut = _ends_within_a_line(path)
    notes = ["the file ends within a line, which is left out: its last number may be cut."] if cut else []
    if encoding != _ENCODING:
        notes.append(f"log: its text is read as {encoding}, for it is not in UTF-8.")
    if text.layout.header:
        notes.append(f"log: its table begins on line {text.header_line}; what stands above is left out.")

    place = {name: number for number, name in reversed(list(enumerate(text.names)))}

    def read(wanted: Sequence[str]) -> pd.DataFrame:
        positions = [place[name] for name in wanted]
        frame = text.read_regular(positions)
        if frame is not None:
            frame = frame.iloc[: len(frame) - cut]
        else:
            frame, left_out[:] = text.read_any(positions, cut)
            note = f"log: {len(left_out)} lines below its names hold words and no number; left out."
            if left_out and note not in notes:
                notes.append(note)
        return frame.set_axis(list(wanted), axis="columns")

    left_out: list[int] = []

    def where(row: int) -> str:
        for earlier in left_out:
            row += earlier <= row
        line, _ = next(islice(_lines(path, encoding), text.layout.first + row, None), (0, ""))
        return f"line {line}" if line else f"row {row + 1}"  # of a file that pandas cuts into lines another way

    units = dict(zip(text.names, text.layout.units, strict=False))
    return Table(path, text.names, read, where, units=units, notes=notes, digest=partial(fingerprint, path))


@dataclass(frozen=True)
class _Text:
    """What is known of a table of text before it is read as a whole.

    Args:
        path: the file.
        encoding: of its characters.
        separator: of its cells.
        decimal: the sign in its numbers.
        layout: where the table begins, among lines that are neither blank nor comments.
        lines: the numbers of those lines in the file, from 1.
        names: of its columns.
        first: cells of the first row.
    """

    path: Path
    encoding: str
    separator: str
    decimal: str
    layout: Layout
    lines: tuple[int, ...]
    names: tuple[str, ...]
    first: tuple[str, ...]

    @property
    def header_line(self) -> int:
        """The number of the line of names."""
        return self.lines[self.layout.header]

    @classmethod
    def of(cls, path: Path, encoding: str, head: Sequence[tuple[int, str]]) -> _Text:
        """What the first lines say.

        Raises:
            InputError: they don't begin a table.
        """
        texts = [text for _, text in head]
        tried = {separator: [_cells(text, separator) for text in texts] for separator in _SEPARATORS}
        layouts = {separator: find_layout(rows) for separator, rows in tried.items()}

        def rank(separator: str) -> tuple[int, int]:
            return layouts[separator].rows, len(tried[separator][layouts[separator].header])

        separator = max(tried, key=rank)
        rows, layout = tried[separator], layouts[separator]
        names = tuple(name.strip() for name in rows[layout.header])
        if layout.rows == 0 and names and all(map(_is_number, names)):
            raise InputError(path, "header", f"numbers ({', '.join(names[:3])})", "a line of column names")
        first = rows[layout.first] if layout.first < len(rows) else []
        if len(first) > len(names) + 1 or any(first[len(names) :]):
            problem = f"{len(first)} values in the first row under {len(names)} names"
            raise InputError(path, "header", problem, "a name for each column, and numbers with a decimal point")
        cells = (cell.strip() for row in rows[layout.first :] for cell in row)
        decimal = "," if separator != "," and any(map(_DECIMAL_COMMA.fullmatch, cells)) else "."
        lines = tuple(number for number, _ in head)
        return cls(path, encoding, separator, decimal, layout, lines, names, tuple(first))

    def read_regular(self, positions: Sequence[int]) -> pd.DataFrame | None:
        """The columns at `positions` of a file whose rows are all as long as the header, and hold what the first does.

        `None` for any other, which `read_any` reads, or says what is wrong with it. Only these columns are turned into
        numbers, so that time and memory are theirs.
        """
        if len(self.first) != len(self.names):
            return None
        keys = [str(number) for number in range(len(self.names))]
        wanted = [keys[position] for position in positions]
        numbers = {
            key: pa.float64() for key, position in zip(wanted, positions, strict=True) if self._is_number(position)
        }
        most, count = tables.MOST_NUMBERS // max(len(positions), 1), 0
        longest = max(map(len, self.first), default=0) * len(self.names)
        pieces: list[list[pa.Array]] = [[] for _ in wanted]
        try:
            with pa_csv.open_csv(
                self.path,
                pa_csv.ReadOptions(
                    use_threads=False,
                    skip_rows=self.lines[self.layout.first] - 1,
                    column_names=keys,
                    block_size=max(_BLOCK, _LINES_IN_A_BLOCK * longest),
                    encoding=self.encoding,
                ),
                pa_csv.ParseOptions(delimiter=self.separator),
                pa_csv.ConvertOptions(
                    include_columns=wanted,
                    column_types={key: numbers.get(key, pa.string()) for key in wanted},
                    decimal_point=self.decimal,
                    strings_can_be_null=True,
                ),
            ) as reader:
                for batch in reader:
                    count += batch.num_rows
                    if count >= most:
                        raise too_large(self.path, f"{most} rows or more")
                    for piece, column in zip(pieces, batch.columns, strict=True):
                        piece.append(column)
        except InputError:
            raise
        except (pa.ArrowException, OSError, ValueError):
            return None
        return pd.DataFrame({number: _joined(piece) for number, piece in enumerate(pieces)}, copy=False)

    def _is_number(self, position: int) -> bool:
        cell = self.first[position].strip()
        return not cell or _is_number(cell.replace(self.decimal, "."))

    def read_any(self, positions: Sequence[int], cut: bool) -> tuple[pd.DataFrame, list[int]]:
        """The columns at `positions` of any file of rows, comments and blanks among them; and which rows are left out.

        A row of words without a number is no row of the table: its names again, a logger's message, a last line that
        says how many there were. Nor is the last one where it was `cut`.

        Raises:
            InputError: a row is longer than the header, or the file is broken.
        """
        # All columns are parsed: with usecols pandas lets a row pass that is too long, such as a torn one.
        skipped = [
            *range(self.header_line - 1),
            *([self.lines[self.layout.header + 1] - 1] if self.layout.units else []),
        ]
        rows = max(_CELLS_IN_A_CHUNK // len(self.names), 1)
        most, count = tables.MOST_NUMBERS // max(len(positions), 1), 0
        chunks, of_words = [], list[int]()
        try:
            with pd.read_csv(
                self.path,
                sep=self.separator,
                decimal=self.decimal,
                comment="#",
                skiprows=skipped,
                index_col=False,
                skipinitialspace=True,
                low_memory=False,
                encoding=_with_mark(self.encoding),
                encoding_errors="replace",
                chunksize=rows,
            ) as reader:
                for chunk in reader:
                    words = self._rows_of_words(chunk)
                    of_words += [count + int(row) for row in np.flatnonzero(words)]
                    count += len(chunk)
                    if count >= most:
                        raise too_large(self.path, f"{most} rows or more")
                    chunks.append(chunk.iloc[~words, list(positions)].copy())
        except InputError:
            raise
        except (OSError, EOFError, zlib.error, ValueError, OverflowError, MemoryError) as error:
            raise broken(self.path, error, "rows as long as the header") from error
        frame = pd.concat(chunks, ignore_index=True)
        if cut and count - 1 not in of_words:
            frame = frame.iloc[:-1]
        if of_words and self.decimal == ",":  # words made text of the numbers beside them
            for name in frame:
                if not pd.api.types.is_numeric_dtype(frame[name]):
                    frame[name] = frame[name].str.replace(",", ".")
        return frame, of_words

    @staticmethod
    def _rows_of_words(chunk: pd.DataFrame) -> npt.NDArray[np.bool_]:
        """Which rows hold text and no value, (n,)."""
        numbers = chunk.select_dtypes("number")
        rows = np.flatnonzero(chunk.notna().to_numpy().any(axis=1) & ~numbers.notna().to_numpy().any(axis=1))
        for name in chunk.columns.difference(numbers.columns, sort=False):  # in most rows the first one has a value
            cells = chunk[name].iloc[rows].fillna("").astype("str")
            rows = rows[~cells.map(is_value).to_numpy(dtype=bool)]
        words = np.zeros(len(chunk), dtype=bool)
        words[rows] = True
        return words


def _joined(pieces: list[pa.Array]) -> object:
    """Pieces of a column as one; numbers with NaN for what is empty."""
    column = pa.chunked_array(pieces)
    if not pa.types.is_floating(column.type):
        return column.to_pandas()
    return np.concatenate([piece.to_numpy(zero_copy_only=False) for piece in pieces])


def _begin(path: Path) -> tuple[str, list[tuple[int, str]]]:
    """How a file's characters are written, and its first lines that hold something, each with its number.

    Raises:
        InputError: it can't be read, or is no table of text.
    """
    try:
        encoding = _encoding(path)
        head = _head(path, encoding)
    except (OSError, EOFError, zlib.error, UnicodeError) as error:
        raise InputError(path, "log", f"a file that can't be read ({error})", "CSV text in UTF-8") from error
    if not head:
        raise InputError(path, "log", "an empty file", "a header line and at least 10 rows")
    if len(head[0][1]) >= _LONGEST_LINE - 1:
        raise InputError(path, "header", "a line of 16 million characters", "a line of column names")
    return encoding, head


def _with_mark(encoding: str) -> str:
    """The same, if at the beginning there may be a byte order mark, as Excel writes one."""
    return "utf-8-sig" if encoding == _ENCODING else encoding


def _encoding(path: Path) -> str:
    """How characters are written: UTF-16 says so by its first bytes; what is not UTF-8 is as Windows had it.

    Raises:
        UnicodeError: it is no text at all.
    """
    with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
        head = file.read(_HEAD)
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) and "\n" in head.decode("utf-16", "replace"):
        return "utf-16"
    try:
        # The last character may be cut.
        codecs.getincrementaldecoder(_ENCODING)().decode(head)
    except UnicodeDecodeError:
        if b"\0" in head:
            raise
        return "cp1252"
    return _ENCODING


def _head(path: Path, encoding: str) -> list[tuple[int, str]]:
    """The first lines that hold something, each with its number."""
    head: list[tuple[int, str]] = []
    characters = 0
    for number, text in islice(_lines(path, encoding), LOOKED_AT):
        head.append((number, text))
        characters += len(text)
        if characters > _HEAD and len(head) >= _FEWEST_LINES:
            break
    return head


def _cells(text: str, separator: str) -> list[str]:
    if separator not in text:
        return [text.strip('"')]
    try:
        return next(csv.reader([text], delimiter=separator, skipinitialspace=True), [])
    except csv.Error:  # a cell of a hundred thousand characters
        return [text]


def _ends_within_a_line(path: Path) -> bool:
    """Whether the last line of a plain file has no end: its writer was stopped, or the copy."""
    if path.suffix == ".gz":
        return False
    with path.open("rb") as file:
        file.seek(-min(2, path.stat().st_size), os.SEEK_END)
        return not file.read().strip(b"\0").endswith((b"\n", b"\r"))  # the end of a line in UTF-16 has a zero beside it


def _lines(path: Path, encoding: str) -> Iterator[tuple[int, str]]:
    """The lines that hold data, each with its number from 1: neither blank nor comment."""
    opener = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rt", encoding=_with_mark(encoding), errors="replace", newline="") as stream:
        for number, line in enumerate(iter(partial(stream.readline, _LONGEST_LINE), ""), start=1):
            text = line.split("#")[0].strip("\r\n ")
            if text.strip():
                yield number, text


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
