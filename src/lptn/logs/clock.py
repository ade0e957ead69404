"""What is wrong with a log's time: refused where no run can be made of it, else spread over its rows, or an issue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NoReturn

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray, IntArray
from lptn.basics.errors import InputError
from lptn.logs.columns import ColumnSource, as_line_or_option, is_number, to_si
from lptn.logs.tables import Table

FEWEST_ROWS = 10
"""Rows at different times, of which something can be said."""
_OTHER_CLOCK = 1e6
"""s, 12 days: no log is that long, so a clock that shows more did not begin with the log."""


def counted_from(first: float) -> float:
    """Where sentences and figures begin to count [s, in the log's own clock], of a log whose first time is `first`.

    At the log's start where its clock began long before, as in 1970; else at 0.
    """
    return first if abs(first) > _OTHER_CLOCK else 0.0


def stretch_in_words(start: float, stop: float, origin: float) -> str:
    """From when to when [s, in the log's own clock], counted from `origin`: the one way in which a time is written."""
    return f"from {start - origin:.7g} to {stop - origin:.7g} s{' after the log began' * bool(origin)}"


DAY = 86400.0  # s
_SUMMER_TIME = 3600.0  # s
LATEST = 1e20  # s, or in whatever unit was meant: times since 1970 in ns are below 2e18
_FEW = 5.0  # rows, and usual steps, by which a row may be out of order: loggers of several threads write so


def in_order(time: FloatArray) -> IntArray | None:
    """The order in which times (n,) run forwards, (n,); `None` where they do, or go back by more than a few steps."""
    steps = np.diff(time)
    if not (np.abs(time) < LATEST).all() or not (steps < 0).any():  # the first is refused by `check_time`
        return None
    order, ahead = np.argsort(time, kind="stable"), np.maximum.accumulate(time) - time
    by_few = np.abs(order - np.arange(time.size)).max() <= _FEW and ahead.max() <= _FEW * np.median(np.abs(steps))
    return order if by_few else None


def check_time(table: Table, key: str, source: ColumnSource, time: FloatArray) -> IntArray:
    """The rows to keep, (m,): of rows with the same time (n,) s the first is kept. It is mapped as `key`.

    Raises:
        InputError: time is missing somewhere, runs backwards, or is too short.
    """
    usable, steps, name = np.abs(time) < LATEST, np.diff(time), (*source.columns, "time")[0]
    if time.size >= FEWEST_ROWS and not usable.all():
        row = int(np.argmin(usable))
        table.refuse(row, name, "no time" if np.isnan(time[row]) else f"{time[row]}", "a time in every row")
    if time.size >= FEWEST_ROWS and (steps < 0).any():
        _refuse_backwards(table, key, source, time, int((steps < 0).argmax()) + 1)
    keep = np.flatnonzero(np.append(True, steps > 0)[: time.size])
    if keep.size < FEWEST_ROWS:
        problem = f"{time.size} rows" + f" at {keep.size} different times" * (time.size >= FEWEST_ROWS)
        raise InputError(table.path, "log", problem, f"at least {FEWEST_ROWS} at different times")
    if dropped := time.size - keep.size:
        table.note(f"time: {dropped} of {time.size} rows repeat a time stamp; the first of each is kept.")
    return keep


def _refuse_backwards(table: Table, key: str, source: ColumnSource, time: FloatArray, row: int) -> NoReturn:
    """Refuse a clock that goes back in a row, with both times as they are written, and what would mend it."""
    name, before, now = source.columns[0], float(time[row - 1]), float(time[row])
    found, expected = f"{now:.12g} s after {before:.12g} s", "time that runs forwards"
    cells = table.read([name])[name].iloc[[row - 1, row]].astype("str").tolist()
    as_text = len(table.numbers([name])[name]) == time.size and not all(map(is_number, cells))
    if as_text:
        found = f"{cells[1]} after {cells[0]}"
    if as_text and 0 <= now - (before - _SUMMER_TIME) <= _FEW * float(np.median(np.abs(np.diff(time)))):
        expected += "; this is the hour that clocks repeat where summer time ends: write UTC, or each time with its"
        expected += " offset (+02:00)"
    elif 0.9 * DAY < before < DAY and 0 <= now < 0.1 * DAY:
        seconds = float(to_si(np.array([source.scale]), "time", source.unit)[0])  # of one in the file
        midnight = as_line_or_option(key, replace(source, wrap=float(f"{DAY / seconds:.12g}")))
        expected += f"; for a clock of the day that passes midnight write {midnight}"
    elif abs(now) <= 0.1 * abs(before):  # the clock starts again from about 0
        expected += "; a counter that overflows is written as wrap = 65536, or whatever it counts to, in its entry"
        expected += " of [columns]"
    table.refuse(row, name, found, expected)


_MOSTLY_TWICE = 0.5  # share of the rows of one stamp that say something else than the one before; else it is a copy
COARSEST_CLOCK = 10.0
"""s between the times of a log: rows that are spread may come as late, and move temperatures little."""
_OF_DEVICES = 3.0
"""Times by which temperatures differ more within a time stamp than from one to the next, where rows of several devices
follow each other; of one sensor's rows they differ less."""


def within_stamps(table: Table, source: ColumnSource, time: FloatArray, values: Mapping[str, FloatArray]) -> FloatArray:
    """Times (n,) s in which rows of one stamp are evenly apart, where the clock is coarser than the rows.

    Whole seconds under fifty rows a second would leave one torque of fifty, whose square says little of the heat. Rows
    whose values, (n,) each, are there twice, number by number, are not spread.

    Raises:
        InputError: the rows of a stamp seem to be of several devices, or its clock has lost its digits.
    """
    first = np.flatnonzero(np.diff(time, prepend=-np.inf))
    counts = np.diff(first, append=time.size)
    usable = first.size >= FEWEST_ROWS and bool((np.abs(time) < LATEST).all())  # else `check_time` refuses it
    if not usable or np.median(counts) < 2:
        return time
    inside, rows = np.setdiff1d(np.arange(1, time.size), first), pd.DataFrame(values)
    copies = rows.eq(rows.shift()) | (rows.isna() & rows.shift().isna())
    if 1 - copies.all(axis=1).to_numpy()[inside].mean() < _MOSTLY_TWICE:
        return time
    apart, count = np.diff(time[first]), f"{np.median(counts):.0f} rows"
    usual, place = float(np.median(apart)), f"column '{source.columns[0]}'"
    for key, column in values.items():
        if key.startswith("temperature.") and np.isfinite(column).any():
            within = np.nanmedian(np.abs(np.diff(column))[inside - 1])
            if within > _OF_DEVICES * np.nanmedian(np.abs(np.diff(column[first]))):
                problem = f"{count} at each time, in which {key} differs by {within:.3g} K"
                expected = "one row for each time: rows of several devices want a column for each of their quantities"
                raise InputError(table.path, place, problem, expected)
    if usual > COARSEST_CLOCK:
        rated = ColumnSource((), rate=float(f"{np.median(counts) / usual:.3g}"), rows=source.rows)
        problem = f"times {usual:.3g} s apart for {count} each, of which the digits behind are lost"
        expected = f"a time for each row; if they come at one rate, {as_line_or_option('time', rated)}"
        raise InputError(table.path, place, problem, expected)
    lasts = np.minimum(np.append(apart, usual), usual)
    table.note(f"time: stamps {usual:.3g} s apart for {count} each, which are spread evenly.")
    return np.asarray(time + (np.arange(time.size) - np.repeat(first, counts)) * np.repeat(lasts / counts, counts))
