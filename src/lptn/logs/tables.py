"""An open log is a table of named number columns: data frames, Parquet files, and columns with times of their own."""

from __future__ import annotations

import hashlib
import io
import re
import warnings
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pandas as pd
import pyarrow as pa
from pandas.api import types as kinds

from lptn.basics.arrays import FloatArray
from lptn.basics.bounds import Bound
from lptn.basics.errors import InputError
from lptn.logs.columns import ColumnSource, is_key

COLUMNS = Bound(100_000, "columns")
"""Of a table: a file of so many takes 8 s to open; of a robot's log a thousand are many."""
MOST_NUMBERS = 500_000_000  # 4 GB; a day of twelve joints at 100 Hz has 400 million
UNPACKED = 4_000_000_000
"""Bytes that any packed log may unfold to: half a minute to read as text. How small it was packed says nothing: a robot
that stands still packs to a hundredth."""
UNPACKED_AT_ONCE = 100_000_000  # bytes that any may unfold to in memory …
TIMES_PACKED = 50  # … and either, where it is more: times its own size
_SMALL = 10_000_000  # bytes of a file that fits any memory: one that asks for more has a false length in it
_MOST_WORDS, _MOST_LISTED = 5, 30  # words that a note gives as examples, names of columns in a message
LONGEST_CELL = 100  # characters of a cell: no number has more, and a date with its time and zone has forty
_NO_NUMBER = re.compile(r"[-+]?1\.#(?:INF|IND|QNAN|SNAN)\d*", re.IGNORECASE)  # as Windows prints what is no number
_YES_OR_NO = dict.fromkeys(("true", "t", "yes", "y", "on"), 1.0) | dict.fromkeys(("false", "f", "no", "n", "off"), 0.0)
_NOT_PLAIN = (bytes, list, dict, np.ndarray)  # cells of a binary or nested column, of which nothing makes numbers
_TEXTS = (pa.string(), pa.large_string(), pa.binary(), pa.large_binary())  # of which a file holds each once
_DATE = re.compile(r"\d{4,}-\d\d-\d\d.*")
_YEARS = (1900, 2200)  # of a date that a logger's clock says
_THOUSANDS = re.compile(r"[-+]?\d{1,3}(?P<sign>[.,'\u2019\u00a0\u202f ])\d{3}(?:(?P=sign)\d{3})*(?:[.,]\d*)?")


@dataclass(frozen=True)
class Table:
    """An open log.

    Attributes:
        read: gives some of its columns.
        where: a row's place in the file, in words; rows count from 0.
        kind: its format, in words.
        mixed: its rows come from several sources, each at a rate of its own.
        defaults: where quantities stand in a format that says so itself; a user's mapping wins.
        notes: what opening and reading it brought up, a sentence each.
        digest: SHA-256 of all its bytes.
        whole: what is expected where a library that reads the file finds it broken.
        units: what a row of units says of a column, by its name.
    """

    path: Path
    names: tuple[str, ...]
    read: Callable[[Sequence[str]], pd.DataFrame]
    where: Callable[[int], str] = lambda row: f"row {row + 1}"
    kind: str = "CSV"
    mixed: bool = False
    defaults: Mapping[str, ColumnSource] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    digest: Callable[[], str] = str
    units: Mapping[str, str] = field(default_factory=dict)
    whole: str = "a table that can be read"

    def numbers(self, names: Iterable[str], worded: Collection[str] = ()) -> dict[str, FloatArray]:
        """The columns `names` as floats, (n,) each, NaN where empty; dates in s since 1970, durations in s.

        Of the columns `worded` a word among the numbers says that there is none.

        Raises:
            InputError: a name stands twice in the file, the file is broken, or a cell holds text.
        """
        wanted, times = tuple(dict.fromkeys(names)), Counter(self.names)
        for name in wanted:
            if times[name] > 1:
                raise InputError(self.path, f"column '{name}'", "that name more than once", "one such column")
        if not wanted:
            return {}
        with one_line_if_broken(self.path, self.whole):
            frame = self.read(wanted)
        return {name: self._floats(name, frame[name], worded=name in worded) for name in wanted}

    def some_numbers(self, names: Iterable[str]) -> dict[str, FloatArray]:
        """As `numbers`, of those columns that hold numbers at all: words are no reading, and text is left out."""
        times = Counter(self.names)
        wanted = [name for name in dict.fromkeys(names) if times[name] == 1]
        with one_line_if_broken(self.path, self.whole):
            frame = self.read(wanted) if wanted else pd.DataFrame()
        numbers = dict[str, FloatArray]()
        for name in wanted:
            with suppress(InputError):
                numbers[name] = self._floats(name, frame[name], worded=True)
        return numbers

    def refuse(self, row: int, name: str, found: str, expected: str) -> NoReturn:
        """Raise the InputError for a cell; `row` counts from 0."""
        raise InputError(self.path, f"{self.where(row)}, column '{name}'", found, expected)

    def _floats(self, name: str, series: pd.Series, *, worded: bool) -> FloatArray:
        of_words = worded and kinds.is_bool_dtype(series)  # True is no reading of a sensor
        if of_words or not (kinds.is_numeric_dtype(series) or _is_time(series)):
            series = self._of_text(name, series, worded=worded)
        if kinds.is_datetime64_any_dtype(series):
            strange = ((series.dt.year < _YEARS[0]) | (series.dt.year > _YEARS[1])).to_numpy()
            if strange.any():
                row = int(strange.argmax())
                expected = f"a date in the years from {_YEARS[0]} to {_YEARS[1]}"
                self.refuse(row, name, f"the year {series.iloc[row].year}", expected)
            series = pd.to_datetime(series, utc=True) - pd.Timestamp(0, tz="UTC")
        if kinds.is_timedelta64_dtype(series):
            return np.asarray(series.dt.total_seconds(), dtype=np.float64)
        # A copy of millions of rows only where it is needed.
        return series.to_numpy() if series.dtype == np.float64 else series.to_numpy(dtype=np.float64, na_value=np.nan)

    def _of_text(self, name: str, series: pd.Series, *, worded: bool) -> pd.Series:
        """Cells of text as numbers, dates or durations; NaN for words by which a sensor says that it has no reading.

        What has a digit in it is no such word, but a number in some other way, and is refused.
        """
        # A text that a file holds once stands once in memory, and may be a megabyte.
        series = series.astype(object).map(
            lambda cell: str(cell)[:LONGEST_CELL] if isinstance(cell, str | bool) else cell
        )
        if (nested := series.map(type).isin(_NOT_PLAIN).to_numpy()).any():
            row = int(nested.argmax())
            self.refuse(row, name, f"a cell of type {type(series.iloc[row]).__name__}", "a number or an empty cell")
        numbers = pd.to_numeric(series, errors="coerce")
        text = (numbers.isna() & series.notna()).to_numpy()
        if not text.any():
            return numbers
        cells = series.map(str).astype("str")
        other = text & ~cells.str.fullmatch(_NO_NUMBER).to_numpy(dtype=bool)
        yes_or_no = cells.str.lower().map(_YES_OR_NO)
        if not worded and (yes_or_no.notna() | series.isna() | (text & ~other)).all():
            return yes_or_no
        if other.all() and (times := _times_of(cells)) is not None:
            return times
        refused = other & (cells.str.contains(r"\d").to_numpy(dtype=bool) | (not worded or bool(other.all())))
        if refused.any():
            row = int(refused.argmax())
            cell, expected = cells.iloc[row], "a number or an empty cell"
            if ":" in cell or _DATE.match(cell):
                expected = "a number; of times also 2026-11-23T14:05:03.5, 23.11.2026 14:05:03, or 0:12:30 since the "
                expected += "start" + f", in years from {_YEARS[0]} to {_YEARS[1]}" * bool(_DATE.match(cell))
            elif _THOUSANDS.fullmatch(cell):
                expected += ", without a sign between thousands"
            self.refuse(row, name, repr(cell), expected)
        words = cells[text]
        shown = ", ".join(f"'{word}'" for word in words.unique()[:_MOST_WORDS])
        self.note(f"{name}: {words.size} cells hold a word ({shown}), which is no reading.")
        return numbers

    @property
    def listing(self) -> str:
        """The names of its columns, for a message of one line."""
        more = len(self.names) - _MOST_LISTED
        return ", ".join(self.names[:_MOST_LISTED]) + (f" and {more} more" if more > 0 else "")

    def note(self, *notes: str) -> None:
        """Add what reading brought up, once though it is read twice, and nothing for an empty text."""
        self.notes.extend(note for note in notes if note and note not in self.notes)


def _is_time(values: pd.Series | pd.Index) -> bool:
    """Whether these are dates or durations."""
    return kinds.is_datetime64_any_dtype(values) or kinds.is_timedelta64_dtype(values)


def column_sources(table: Table, columns: Mapping[str, ColumnSource]) -> dict[str, ColumnSource]:
    """Where each quantity stands: by its own name, by the format's own rules, or, above both, by the mapping."""
    own = {name: ColumnSource((name,)) for name in table.names if is_key(name)}
    return own | dict(table.defaults) | dict(columns)


# --- Times as people write them: dates, clocks of the day, durations ------------------------------------

_OF_MINUTES = r"\d+:\d\d\.\d+"  # minutes and seconds, which only a fraction tells from hours and minutes
_OF_HOURS = r"\d+:\d+:\d\d(?:\.\d*)?"
# The year last: 23.11.2026 14:05:03, 11/23/2026 2:05:03 PM.
_YEAR_LAST = (
    r"(?P<one>\d{1,2})(?P<sign>[./-])(?P<two>\d{1,2})[./-](?P<year>\d{4})[T .]+"
    r"(?P<clock>\d{1,2}:\d\d(?::\d\d(?:\.\d*)?)?)\s*(?P<half>[aApP])?\.?[mM]?\.?"
)


def _times_of(cells: pd.Series) -> pd.Series | None:
    """Cells of text of which each is a time, as durations or as dates; `None` for other text.

    Either a date as ISO 8601 writes it, in UTC if it names no zone; a date with the year last; or a time such as
    0:12:30 or 12:30.5. Of a date with the year last nothing may tell the day from the month. With points the day comes
    first. With strokes it is what makes the log the shorter: there is no 23rd month, from one midnight to the next no
    month passes, and while the date stays both are the same.
    """
    text = cells.str.strip().str.replace(",", ".")
    clock = text.where(~text.str.fullmatch(_OF_MINUTES), "0:" + text)
    if clock.str.fullmatch(_OF_HOURS).all():
        return pd.to_timedelta(clock, errors="coerce")
    dates = pd.to_datetime(cells, errors="coerce", utc=True, format="ISO8601")
    if not dates.isna().any():
        return dates
    parts = text.str.extract(f"^{_YEAR_LAST}$")
    if parts["clock"].isna().any():
        return None
    clock, half = parts["clock"].where(parts["clock"].str.count(":") == 2, parts["clock"] + ":00"), parts["half"]
    of_day, noon = pd.to_timedelta(clock, errors="coerce"), pd.Timedelta(hours=12)
    late, twelve = half.isin(["p", "P"]).astype("int64"), (half.notna() & (of_day >= noon)).astype("int64")
    of_day += noon * (late - twelve)
    orders = [("two", "one"), ("one", "two")][: 1 if (parts["sign"] == ".").all() else 2]
    days = [parts["year"] + "-" + parts[month] + "-" + parts[day] for month, day in orders]
    readings = [pd.to_datetime(day, errors="coerce", utc=True, format="%Y-%m-%d") + of_day for day in days]
    whole = (dates for dates in readings if not dates.isna().any())
    return min(whole, key=lambda dates: dates.max() - dates.min(), default=None)


# --- Files that are larger than they look, broken, or of a format without its package ---------------------


def too_large(path: Path, size: str) -> InputError:
    """What to raise for a table that would fill the memory."""
    return InputError(path, "log", size, f"at most {MOST_NUMBERS:.0e} numbers; cut the log into pieces")


def refuse_too_large(path: Path, rows: int, columns: int) -> None:
    """Refuse a table of so many rows and columns that would fill the memory: such a number takes few bytes to write."""
    if rows * columns > MOST_NUMBERS:
        raise too_large(path, f"{rows} rows of {columns} columns")


def most_unpacked(path: Path, *, at_once: bool) -> int:
    """Bytes that a packed file may unfold to, read piece by piece or at once."""
    return max(UNPACKED_AT_ONCE if at_once else UNPACKED, TIMES_PACKED * path.stat().st_size)


class Bounded(io.RawIOBase):
    """A file that is unpacked as it is read, of which at most so many bytes may come, else an error is raised."""

    def __init__(self, file: io.BufferedIOBase, most: int, error: Exception) -> None:
        self._file, self._left, self._error = file, most, error

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        piece = self._file.read(len(buffer))
        self._left -= len(piece)
        if self._left < 0:
            raise self._error
        buffer[: len(piece)] = piece
        return len(piece)

    def close(self) -> None:
        self._file.close()
        super().close()


def require_package(path: Path, package: str, log: str, instead: str) -> None:
    """Refuse a log whose format a package reads that is not installed.

    Raises:
        InputError: it is not; what is expected is `instead`.
    """
    if find_spec(package) is None:
        raise InputError(path, "log", f"{log}, and no package to read it", instead)


@contextmanager
def one_line_if_broken(path: Path, expected: str) -> Iterator[None]:
    """Make one line of whatever a library raises of broken bytes, which are errors of many kinds, and none of warnings.

    Raises:
        InputError: there is such an error within, or an InputError, which stays as it is.
        MemoryError: the machine has too little memory, which is not the fault of a file that is not small.
    """
    try:
        with warnings.catch_warnings(action="ignore"):
            yield
    except InputError:
        raise
    except Exception as error:
        small = path.is_file() and path.stat().st_size < _SMALL
        if isinstance(error, MemoryError) and not small:
            raise
        raise InputError(path, "log", f"a broken file ({str(error) or type(error).__name__})", expected) from error


# --- Data frames and Parquet files ---------------------------------------------------------------------


def table_of(frame: pd.DataFrame, name: str) -> Table:
    """A data frame as a table; an index of dates, durations, or called `time` stands for a missing column `time`.

    It is called `name` in messages and as its run's name.

    Raises:
        InputError: it has no rows, or its columns have names of several levels.
    """
    if frame.columns.nlevels > 1:
        raise InputError(name, "columns", "names of several levels", "one name for each column")
    if frame.empty:
        raise InputError(name, "log", "an empty data frame", "a column of times and at least 10 rows")
    labelled = frame.set_axis([str(column) for column in frame.columns], axis="columns").reset_index(drop=True)
    if "time" not in labelled and (_is_time(frame.index) or frame.index.name == "time"):
        labelled.insert(0, "time", frame.index.to_series().reset_index(drop=True))

    def digest() -> str:
        rows = pd.util.hash_pandas_object(labelled, index=False).to_numpy()
        return hashlib.sha256("\n".join(labelled.columns).encode() + rows.tobytes()).hexdigest()

    def read(wanted: Sequence[str]) -> pd.DataFrame:
        return labelled[list(wanted)]

    return Table(Path(name), tuple(labelled.columns), read, kind="DataFrame", digest=digest)


def open_parquet(path: Path) -> Table:
    """Open a Parquet file and read its column names.

    Raises:
        InputError: it can't be read.
    """
    import pyarrow.parquet as pq  # here, since most logs are CSV

    with pq.ParquetFile(path) as file:
        names, rows = tuple(file.schema_arrow.names), int(file.metadata.num_rows)
        texts = [field.name for field in file.schema_arrow if field.type in _TEXTS]
    COLUMNS.check(len(names), path, "columns")

    def read(wanted: Sequence[str]) -> pd.DataFrame:
        refuse_too_large(path, rows, len(wanted))
        with pq.ParquetFile(path, read_dictionary=texts) as file:
            columns = file.read(list(wanted))
        # Each column is freed as soon as it is copied, so that few numbers stand twice.
        frame: pd.DataFrame = columns.to_pandas(ignore_metadata=True, split_blocks=True, self_destruct=True)
        return frame

    return Table(path, names, read, kind="Parquet")


# --- Columns with times of their own, put on the union of their times -----------------------------------

Source = tuple[FloatArray, Mapping[str, FloatArray]]
"""Times, (n,) s, and columns by name, (n,) each."""


def table_of_sources(
    path: Path,
    names: tuple[str, ...],
    read_sources: Callable[[Sequence[str]], Sequence[Source]],
    kind: str,
    **known: Any,
) -> Table:
    """Columns of several rates as one table, on the union of their times, with attributes of it that are `known`.

    `read_sources` gives those that hold the wanted ones of the columns `names`, `time` among them; at least one.
    """
    stamps = [np.zeros(0)]  # of the rows that were read last, by which a row is named in messages

    def read(wanted: Sequence[str]) -> pd.DataFrame:
        sources = read_sources(wanted)
        refuse_too_large(path, sum(own.size for own, _ in sources), len(wanted))
        columns = on_one_time(sources)
        stamps[0] = columns["time"]
        return pd.DataFrame({name: columns[name] for name in wanted}, copy=False)

    return Table(path, names, read, lambda row: f"at {stamps[0][row]:.6f} s", kind, mixed=True, **known)


def on_one_time(sources: Sequence[Source]) -> dict[str, FloatArray]:
    """All times as `time`, (n,) s, increasing, and each column on them, (n,), NaN at the times of others.

    Where a source has several values of a column at one time the first counts: messages of one stamp may hold some of
    the joints each.
    """
    time = np.unique(np.concatenate([own for own, _ in sources]))
    columns = {"time": time}
    for own, values in sources:
        at = np.searchsorted(time, own)
        for name, column in values.items():
            backwards = np.flatnonzero(~np.isnan(column))[::-1]
            columns[name] = np.full(time.size, np.nan)
            columns[name][at[backwards]] = column[backwards]
    return columns
