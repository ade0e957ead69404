"""Tables written as text: CSV and its kin, opened as a log. Comma, semicolon or tab separate, quoted or not."""

from __future__ import annotations

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
import pandas as pd
import pyarrow as pa
import pyarrow.csv as pa_csv

from lptn.basics.errors import InputError
from lptn.basics.files import fingerprint
from lptn.logs import tables
from lptn.logs.layout import LOOKED_AT, Layout, find_layout
from lptn.logs.tables import Table, broken, too_large

ENDINGS = (".csv", ".tsv", ".txt", ".csv.gz", ".tsv.gz", ".txt.gz")

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
    try:
        head = _head(path)
    except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
        raise InputError(path, "log", f"a file that can't be read ({error})", "CSV text in UTF-8") from error
    if not head:
        raise InputError(path, "log", "an empty file", "a header line and at least 10 rows")
    if len(head[0][1]) >= _LONGEST_LINE - 1:
        raise InputError(path, "header", "a line of 16 million characters", "a line of column names")
    text = _Text.of(path, head)
    cut = _ends_within_a_line(path)
    notes = ["the file ends within a line, which is left out: its last number may be cut."] if cut else []
    if text.layout.header:
        notes.append(f"log: its table begins on line {text.header_line}; what stands above is left out.")

    place = {name: number for number, name in reversed(list(enumerate(text.names)))}

    def read(wanted: Sequence[str]) -> pd.DataFrame:
        positions = [place[name] for name in wanted]
        frame = text.read_regular(positions)
        frame = text.read_any(positions) if frame is None else frame
        return frame.iloc[: len(frame) - cut].set_axis(list(wanted), axis="columns")

    def where(row: int) -> str:
        line, _ = next(islice(_lines(path), text.layout.first + row, None), (0, ""))
        return f"line {line}" if line else f"row {row + 1}"  # of a file that pandas cuts into lines another way

    units = dict(zip(text.names, text.layout.units, strict=False))
    return Table(path, text.names, read, where, units=units, notes=notes, digest=partial(fingerprint, path))


@dataclass(frozen=True)
class _Text:
    """What is known of a table of text before it is read as a whole.

    Args:
        path: the file.
        separator: of its cells.
        decimal: the sign in its numbers.
        layout: where the table begins, among lines that are neither blank nor comments.
        lines: the numbers of those lines in the file, from 1.
        names: of its columns.
        first: cells of the first row.
    """

    path: Path
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
    def of(cls, path: Path, head: Sequence[tuple[int, str]]) -> _Text:
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
        return cls(path, separator, decimal, layout, tuple(number for number, _ in head), names, tuple(first))

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

    def read_any(self, positions: Sequence[int]) -> pd.DataFrame:
        """The columns at `positions` of any file of rows, comments and blanks among them.

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
        chunks = []
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
                encoding="utf-8-sig",
                chunksize=rows,
            ) as reader:
                for chunk in reader:
                    count += len(chunk)
                    if count >= most:
                        raise too_large(self.path, f"{most} rows or more")
                    chunks.append(chunk.iloc[:, list(positions)].copy())
        except InputError:
            raise
        except (OSError, EOFError, zlib.error, ValueError, OverflowError, MemoryError) as error:
            raise broken(self.path, error, "rows as long as the header") from error
        return pd.concat(chunks, ignore_index=True)


def _joined(pieces: list[pa.Array]) -> object:
    """Pieces of a column as one; numbers with NaN for what is empty."""
    column = pa.chunked_array(pieces)
    if not pa.types.is_floating(column.type):
        return column.to_pandas()
    return np.concatenate([piece.to_numpy(zero_copy_only=False) for piece in pieces])


def _head(path: Path) -> list[tuple[int, str]]:
    """The first lines that hold something, each with its number."""
    head: list[tuple[int, str]] = []
    characters = 0
    for number, text in islice(_lines(path), LOOKED_AT):
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
        file.seek(-1, os.SEEK_END)
        return file.read(1) not in (b"\n", b"\r")


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """The lines that hold data, each with its number from 1: neither blank nor comment."""
    opener = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rt", encoding="utf-8-sig", newline="") as stream:
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
