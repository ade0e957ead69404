"""What can't be right in a log's time and values, refused with the line it stands on."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lptn.arrays import FloatArray
from lptn.errors import InputError
from lptn.logs.columns import ColumnSource
from lptn.logs.tables import Table

_FEWEST_ROWS = 10
_DAY = 86400.0  # s
_LATEST = 1e20  # s, or in whatever unit was meant
_LARGEST = 1e12  # of any quantity in SI, so that its square is still a number


def check_time(table: Table, name: str, time: FloatArray) -> tuple[npt.NDArray[np.intp], tuple[str, ...]]:
    """The rows to keep, (m,), and notes: of rows with the same time stamp the first is kept.

    Args:
        table: the log, for the line numbers.
        name: the time column's name in the file.
        time: (n,) s.

    Raises:
        InputError: time is missing somewhere, runs backwards, or is too short or too coarse to be in s.
    """
    _enough(table, time.size)
    told = np.abs(time) < _LATEST
    if not told.all():
        row = int(np.argmin(told))
        table.refuse(row, name, f"{'no time' if np.isnan(time[row]) else time[row]}", "a time in every row")
    steps = np.diff(time)
    if (steps < 0).any():
        row = int((steps < 0).argmax()) + 1
        found = f"{time[row]:.12g} s after {time[row - 1]:.12g} s"
        table.refuse(row, name, found, f"time that runs forwards{_restart(time, row)}")
    keep = np.flatnonzero(np.concatenate(([True], steps > 0)))
    _enough(table, keep.size)
    period = float(np.median(np.diff(time[keep])))
    if period > _DAY:
        expected = f'seconds; for another unit write time = {{ column = "{name}", unit = "ns" }} in [columns]'
        raise InputError(table.path, f"column '{name}'", f"{period:.3g} s from row to row", expected)
    dropped = time.size - keep.size
    note = f"time: {dropped} of {time.size} rows repeat a time stamp; the first of each is kept."
    return keep, (note,) if dropped else ()


def check_values(table: Table, key: str, source: ColumnSource, values: FloatArray) -> None:
    """Refuse infinite values, those that nothing can have, and temperatures below absolute zero.

    Args:
        table: the log, for the line numbers.
        key: `<quantity>.<place>`.
        source: where the values come from.
        values: (n,) in SI or degC, NaN where missing.

    Raises:
        InputError: as said.
    """
    name = source.columns[0]
    infinite = np.isinf(values)
    if infinite.any():
        table.refuse(int(infinite.argmax()), name, "an infinite value", "a number or an empty cell")
    huge = np.abs(values) > _LARGEST
    if huge.any():
        row = int(huge.argmax())
        table.refuse(row, name, f"{values[row]:.3g}", f"a number within ±{_LARGEST:.0e}, in SI")
    if not key.startswith("temperature.") or np.isnan(values).all():
        return
    impossible = values < -273.15
    if impossible.any():
        row = int(impossible.argmax())
        mend = "; a code for no reading is written as invalid = [NUMBER] in [columns]"
        table.refuse(row, name, f"{values[row]:.6g} degC", f"a temperature above -273.15 degC{mend}")


def _enough(table: Table, rows: int) -> None:
    if rows < _FEWEST_ROWS:
        raise InputError(table.path, "log", f"{rows} rows", f"at least {_FEWEST_ROWS} at different times")


def _restart(time: FloatArray, row: int) -> str:
    """What else it may be where a clock starts again from about 0."""
    if abs(time[row]) > 0.1 * abs(time[row - 1]):
        return ""
    return "; a counter that overflows is written as wrap = 65536, or whatever it counts to, in its entry of [columns]"
