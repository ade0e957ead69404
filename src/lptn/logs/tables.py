"""An open log is a table of named number columns; here CSV files, Parquet files and data frames are opened as such."""

from __future__ import annotations

import csv
import gzip
import hashlib
import os
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from pathlib import Path
from typing import NoReturn

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.files import fingerprint
from lptn.logs.columns import ColumnSource, is_key

_MOST_NUMBERS = 500_000_000  # 4 GB; a day of twelve joints at 100 Hz has 400 million
_LONGEST_LINE = 1 << 20  # characters; binary files may have no line end at all
_LONGEST_REASON = 200  # characters of another library's error that go into a message
_LONGEST_CELL = 100  # characters of a cell that go into a message


@dataclass(frozen=True)
class Table:
    """An open log.

    Attributes:
        path: its file or folder.
        names: of its columns.
        read: gives some of them.
        where: a row's place in the file, in words; rows count from 0.
        kind: its format, in words.
        mixed: its rows come from several sources, each at a rate of its own.
        defaults: where quantities stand in a format that says so itself; a user's mapping wins.
        notes: what opening and reading it brought up, a sentence each.
        digest: SHA-256 of all its bytes.
    """

    path: Path
    names: tuple[str, ...]
    read: Callable[[Sequence[str]], pd.DataFrame]
    where: Callable[[int], str]
    kind: str = "CSV"
    mixed: bool = False
    defaults: Mapping[str, ColumnSource] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    digest: Callable[[], str] = str

    def numbers(self, names: Iterable[str]) -> dict[str, FloatArray]:
        """The columns `names` as floats, (n,) each, NaN where empty; dates in s since 1970, durations in s.

        Raises:
            InputError: a name stands twice in the file, the file is broken, or a cell holds text.
        """
        wanted = tuple(dict.fromkeys(names))
        for name in wanted:
            if self.names.count(name) > 1:
                raise InputError(self.path, f"column '{name}'", "that name more than once", "one such column")
        frame = self.read(wanted)
        return {name: self._floats(name, frame[name]) for name in wanted}

    def refuse(self, row: int, name: str, found: str, expected: str) -> NoReturn:
        """Raise the InputError for a cell; `row` counts from 0."""
        raise InputError(self.path, f"{self.where(row)}, column '{name}'", found, expected)

    def _floats(self, name: str, series: pd.Series) -> FloatArray:
        kinds = pd.api.types
        if not (kinds.is_numeric_dtype(series) or _is_time(series)):
            numbers = pd.to_numeric(series, errors="coerce")
            text = (numbers.isna() & series.notna()).to_numpy()
            dates = _dates(series) if text.all() else None
            if text.any() and dates is None:
                row = int(text.argmax())
                self.refuse(row, name, repr(str(series.iloc[row])[:_LONGEST_CELL]), "a number or an empty cell")
            series = numbers if dates is None else dates
        if kinds.is_datetime64_any_dtype(series):
            series = pd.to_datetime(series, utc=True) - pd.Timestamp(0, tz="UTC")
        if kinds.is_timedelta64_dtype(series):
            return np.asarray(series.dt.total_seconds(), dtype=np.float64)
        return series.to_numpy(dtype=np.float64, na_value=np.nan)


def _is_time(values: pd.Series | pd.Index) -> bool:
    """Whether these are dates or durations."""
    return pd.api.types.is_datetime64_any_dtype(values) or pd.api.types.is_timedelta64_dtype(values)


def _dates(series: pd.Series) -> pd.Series | None:
    """Text in which every cell is a date as ISO 8601 writes it, in UTC if it names no zone; `None` for other text."""
    dates = pd.to_datetime(series, errors="coerce", utc=True, format="ISO8601")
    return dates if len(dates) and not dates.isna().any() else None


def column_sources(table: Table, columns: Mapping[str, ColumnSource]) -> dict[str, ColumnSource]:
    """Where each quantity stands: by its own name, by the format's own rules, or, above both, by the mapping."""
    own = {name: ColumnSource((name,)) for name in table.names if is_key(name)}
    return own | dict(table.defaults) | dict(columns)


def check_size(path: Path, rows: int, columns: int) -> None:
    """Refuse a table that would fill the memory.

    Raises:
        InputError: it holds more than 500 million numbers.
    """
    if rows * columns > _MOST_NUMBERS:
        raise _too_large(path, f"{rows} rows of {columns} columns")


def _too_large(path: Path, size: str) -> InputError:
    return InputError(path, "log", size, f"at most {_MOST_NUMBERS:.0e} numbers; cut the log into pieces")


def broken(path: Path, error: Exception, expected: str) -> InputError:
    """What to raise for a file that a library can't read."""
    reason = (str(error) or type(error).__name__)[:_LONGEST_REASON]
    return InputError(path, "log", f"a broken file ({reason})", expected)


# --- Data frames, CSV files and Parquet files ------------------------------------------------------


def table_of(frame: pd.DataFrame, name: str) -> Table:
    """A data frame as a table; an index of dates, durations, or called `time` stands for a missing column `time`.

    Args:
        frame: a row for each sample.
        name: what the log is called, in messages and as its run's name.

    Raises:
        InputError: it has no rows, or its columns have names of several levels.
    """
    path = Path(name)
    if frame.columns.nlevels > 1:
        raise InputError(path, "columns", "names of several levels", "one name for each column")
    if frame.empty:
        raise InputError(path, "log", "an empty data frame", "a column of times and at least 10 rows")
    labelled = frame.set_axis([str(column) for column in frame.columns], axis="columns").reset_index(drop=True)
    if "time" not in labelled and (_is_time(frame.index) or frame.index.name == "time"):
        labelled.insert(0, "time", frame.index.to_series().reset_index(drop=True))

    def digest() -> str:
        rows = pd.util.hash_pandas_object(labelled, index=False).to_numpy()
        return hashlib.sha256("\n".join(labelled.columns).encode() + rows.tobytes()).hexdigest()

    def read(wanted: Sequence[str]) -> pd.DataFrame:
        return labelled[list(wanted)]

    return Table(path, tuple(labelled.columns), read, lambda row: f"row {row + 1}", "DataFrame", digest=digest)


def open_csv(path: Path) -> Table:
    """Open a CSV file, perhaps compressed, and read its column names; comma, semicolon or tab separate.

    Raises:
        InputError: it can't be read, or has no line of names.
    """
    try:
        head = [text for _, text in islice(_lines(path), 2)]
    except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
        raise InputError(path, "log", f"a file that can't be read ({error})", "CSV text in UTF-8") from error
    if not head:
        raise InputError(path, "log", "an empty file", "a header line and at least 10 rows")
    if len(head[0]) >= _LONGEST_LINE - 1:
        raise InputError(path, "header", "a line of a million characters", "a line of column names")
    separator = max(",;\t", key=head[0].count)
    names = tuple(name.strip() for name in next(csv.reader(head[:1], delimiter=separator)))
    if all(_is_number(name) for name in names):
        raise InputError(path, "header", f"numbers ({', '.join(names[:3])})", "a line of column names")
    first = next(csv.reader(head[1:], delimiter=separator), [])
    if len(first) > len(names) + 1 or any(first[len(names) :]):
        problem = f"{len(first)} values in the first row under {len(names)} names"
        raise InputError(path, "header", problem, "a name for each column, and numbers with a decimal point")
    # Where ; separates, a comma in the first row can only be a decimal comma.
    decimal = "," if separator == ";" and "," in "".join(head[1:]) else "."

    most = _MOST_NUMBERS // len(names)
    cut = _ends_within_a_line(path)
    notes = ["the file ends within a line, which is left out: its last number may be cut."] if cut else []

    def read(wanted: Sequence[str]) -> pd.DataFrame:
        # All columns are parsed: with usecols pandas lets a row pass that is too long, such as a torn one.
        try:
            frame = pd.read_csv(
                path,
                sep=separator,
                decimal=decimal,
                comment="#",
                index_col=False,
                skipinitialspace=True,
                low_memory=False,
                encoding="utf-8-sig",
                nrows=most,
            )
        except (OSError, EOFError, zlib.error, ValueError, OverflowError, MemoryError) as error:
            raise broken(path, error, "rows as long as the header") from error
        if len(frame) >= most:
            raise _too_large(path, f"{most} rows or more")
        whole = frame.iloc[: len(frame) - cut, [names.index(name) for name in wanted]]
        return whole.set_axis(list(wanted), axis="columns")

    def where(row: int) -> str:
        line, _ = next(islice(_lines(path), row + 1, None), (0, ""))
        return f"line {line}" if line else f"row {row + 1}"  # of a file that pandas cuts into lines another way

    return Table(path, names, read, where, notes=notes, digest=partial(fingerprint, path))


def _ends_within_a_line(path: Path) -> bool:
    """Whether the last line of a plain file has no end: its writer was stopped, or the copy."""
    if path.suffix != ".csv":
        return False
    with path.open("rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read(1) not in (b"\n", b"\r")


def open_parquet(path: Path) -> Table:
    """Open a Parquet file and read its column names.

    Raises:
        InputError: it can't be read.
    """
    import pyarrow.parquet as pq  # here, since most logs are CSV

    try:
        with pq.ParquetFile(path) as file:
            names, rows = tuple(file.schema_arrow.names), int(file.metadata.num_rows)
    except Exception as error:  # of broken bytes the library makes errors of many kinds
        raise broken(path, error, "a whole Parquet file") from error

    def read(wanted: Sequence[str]) -> pd.DataFrame:
        check_size(path, rows, len(wanted))  # such a number of rows takes few bytes to write
        try:
            frame: pd.DataFrame = pq.read_table(path, columns=list(wanted)).to_pandas(ignore_metadata=True)
        except Exception as error:
            raise broken(path, error, "a whole Parquet file") from error
        return frame

    return Table(path, names, read, lambda row: f"row {row + 1}", "Parquet", digest=partial(fingerprint, path))


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """The lines that hold data, each with its number from 1: neither blank nor comment."""
    opener = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rt", encoding="utf-8-sig", newline="") as stream:
        for number, line in enumerate(iter(partial(stream.readline, _LONGEST_LINE), ""), start=1):
            text = line.split("#")[0].strip()
            if text:
                yield number, text


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
