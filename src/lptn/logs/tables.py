"""CSV and Parquet files opened as tables of named number columns."""

from __future__ import annotations

import csv
import gzip
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import NoReturn

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from lptn.arrays import FloatArray
from lptn.errors import InputError

_FORMATS = ".csv, .csv.gz or .parquet"


@dataclass(frozen=True)
class Table:
    """An open log: its column names, a way to read some of them, and where a row stands in the file."""

    path: Path
    names: tuple[str, ...]
    read: Callable[[Sequence[str]], pd.DataFrame]
    where: Callable[[int], str]

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
        if pd.api.types.is_datetime64_any_dtype(series.dtype):
            series = pd.to_datetime(series, utc=True) - pd.Timestamp(0, tz="UTC")
        if pd.api.types.is_timedelta64_dtype(series.dtype):
            return np.asarray(series.dt.total_seconds(), dtype=np.float64)
        if not pd.api.types.is_numeric_dtype(series.dtype):
            numbers = pd.to_numeric(series, errors="coerce")
            text = (numbers.isna() & series.notna()).to_numpy()
            if text.any():
                row = int(text.argmax())
                self.refuse(row, name, repr(str(series.iloc[row])), "a number or an empty cell")
            series = numbers
        return series.to_numpy(dtype=np.float64, na_value=np.nan)


def open_table(path: Path) -> Table:
    """Open a log and read its column names.

    Raises:
        InputError: there is no such file, its format is not known, or it can't be read.
    """
    if not path.exists():
        raise InputError(path, "log", "no such file", f"a {_FORMATS} file")
    if path.is_dir():
        raise InputError(path, "log", "a folder", f"a {_FORMATS} file")
    if path.name.endswith(".parquet"):
        return _open_parquet(path)
    if path.name.endswith((".csv", ".csv.gz")):
        return _open_csv(path)
    raise InputError(path, "log", f"the ending '{path.suffix}'", _FORMATS)


def _open_csv(path: Path) -> Table:
    try:
        head = [text for _, text in islice(_lines(path), 2)]
    except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
        raise InputError(path, "log", f"a file that can't be read ({error})", "CSV text in UTF-8") from error
    if not head:
        raise InputError(path, "log", "an empty file", "a header line and at least 10 rows")
    separator = max(",;\t", key=head[0].count)
    names = tuple(name.strip() for name in next(csv.reader(head[:1], delimiter=separator)))
    if all(_is_number(name) for name in names):
        raise InputError(path, "header", f"numbers ({', '.join(names[:3])})", "a line of column names")
    first = next(csv.reader(head[1:], delimiter=separator), [])
    if len(first) > len(names) + 1 or any(first[len(names) :]):
        found = f"{len(first)} values in the first row under {len(names)} names"
        raise InputError(path, "header", found, "a name for each column, and numbers with a decimal point")
    # Where ; separates, a comma in the first row can only be a decimal comma.
    decimal = "," if separator == ";" and "," in "".join(head[1:]) else "."

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
            )
        except (OSError, EOFError, zlib.error, ValueError) as error:
            raise InputError(path, "log", f"a broken file ({error})", "rows as long as the header") from error
        return frame.iloc[:, [names.index(name) for name in wanted]].set_axis(list(wanted), axis="columns")

    def where(row: int) -> str:
        return f"line {next(islice(_lines(path), row + 1, None))[0]}"

    return Table(path, names, read, where)


def _open_parquet(path: Path) -> Table:
    try:
        names = tuple(pq.ParquetFile(path).schema_arrow.names)
    except (OSError, pa.ArrowException) as error:
        raise InputError(path, "log", f"a broken file ({error})", "a whole Parquet file") from error

    def read(wanted: Sequence[str]) -> pd.DataFrame:
        try:
            frame: pd.DataFrame = pq.read_table(path, columns=list(wanted)).to_pandas(ignore_metadata=True)
        except (OSError, pa.ArrowException) as error:
            raise InputError(path, "log", f"a broken file ({error})", "a whole Parquet file") from error
        return frame

    return Table(path, names, read, lambda row: f"row {row + 1}")


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """The lines that hold data, each with its number from 1: neither blank nor comment."""
    opener = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rt", encoding="utf-8-sig", newline="") as stream:
        for number, line in enumerate(stream, start=1):
            text = line.split("#")[0].strip()
            if text:
                yield number, text


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
