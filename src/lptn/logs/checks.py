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
_HOTTEST = 1000.0  # degC, of the middle value: no motor or board survives that


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
    if not np.isfinite(time).all():
        row = int(np.argmin(np.isfinite(time)))
        table.refuse(row, name, f"{'no time' if np.isnan(time[row]) else time[row]}", "a time in every row")
    steps = np.diff(time)
    if (steps < 0).any():
        row = int((steps < 0).argmax()) + 1
        table.refuse(row, name, f"{time[row]:.12g} s after {time[row - 1]:.12g} s", "time that runs forwards")
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
    """Refuse infinite values, temperatures below absolute zero, and those that look like another unit.

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
    if not key.startswith("temperature.") or np.isnan(values).all():
        return
    impossible = values < -273.15
    if impossible.any():
        row = int(impossible.argmax())
        table.refuse(row, name, f"{values[row]:.6g} degC", "a temperature above -273.15 degC")
    low, middle, high = np.nanmin(values), np.nanmedian(values), np.nanmax(values)
    if source.unit is None and middle > 200 and low >= 200 and high <= 500:
        found = f"values {low:.4g} … {high:.4g}, which look like kelvin"
        raise InputError(table.path, f"column '{name}'", found, 'degC; write unit = "K" in [columns]')
    if middle > _HOTTEST:
        expected = "degC; for thousandths write scale = 0.001 in [columns]"
        raise InputError(table.path, f"column '{name}'", f"values around {middle:.4g}", expected)


def _enough(table: Table, rows: int) -> None:
    if rows < _FEWEST_ROWS:
        raise InputError(table.path, "log", f"{rows} rows", f"at least {_FEWEST_ROWS} at different times")
