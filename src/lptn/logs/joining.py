"""Two logs of one run with clocks of their own, joined to one table: `a.csv+b.csv`."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from lptn.arrays import FloatArray
from lptn.errors import InputError
from lptn.logs.checks import check_time
from lptn.logs.columns import ColumnSource
from lptn.logs.merging import on_one_time
from lptn.logs.onset import NoOnsetError, Shift, shift_of
from lptn.logs.suspicions import suspect_time
from lptn.logs.tables import Table, check_size, known_columns

SECOND_TIME = "time.2"
"""What the second log's time column is mapped as."""
_HEAT = {"power": 1, "current": 2, "current_abs": 2, "torque": 2, "torque_abs": 2}  # exponent that makes it a heat
_AGREE = 5.0  # s


def join(
    path: Path, first: Table, second: Table, shift: float | None, columns: Mapping[str, ColumnSource]
) -> tuple[Table, dict[str, ColumnSource]]:
    """Join two logs, the second on the clock of the first; each keeps its own rate.

    Args:
        path: what the user wrote.
        first: one log.
        second: the other; where both have a column of one name, this one's is called `NAME:2`.
        shift: s to add to the second's clock; `None` to find it from the onset of heating.
        columns: where the quantities stand in either; `time.2` is the second's time.

    Returns:
        the table, whose time is in s, and the mapping without the time columns.

    Raises:
        InputError: a log has no usable time, or there is no onset of heating.
    """
    rest = {key: source for key, source in columns.items() if key not in {"time", SECOND_TIME}}
    time_key = {key: columns[key] for key in ("time",) if key in columns}
    one = _Timed(first, known_columns(first, time_key).get("time"), "time")
    own = columns.get(SECOND_TIME) or known_columns(second, time_key).get("time")
    other = _Timed(second, own, SECOND_TIME)
    if shift is None:
        seconds, note = _found(path, one, other, rest)
    else:
        seconds, note = shift, f"{second.path.name}: its clock set forward by {shift:.6g} s, as given."
    renamed = {name: f"{name}:2" if name in first.names else name for name in second.names if name != other.column}
    names = ("time", *(name for name in first.names if name not in {one.column, "time"}), *renamed.values())
    notes = [note, *first.notes, *second.notes]
    doubled = [name for name, new in renamed.items() if new != name]
    if doubled:
        notes.append(f"{', '.join(doubled)}: in both files; the second's is called {renamed[doubled[0]]}.")

    def read(wanted: Sequence[str]) -> pd.DataFrame:
        originals = {new: name for name, new in renamed.items() if new in wanted}
        mine = [name for name in wanted if name not in originals and name != "time"]
        check_size(path, one.time.size + other.time.size, len(wanted))
        return _merged(one, other, seconds, mine, originals, wanted)

    def where(row: int) -> str:
        return f"row {row + 1} of both"

    defaults = dict(second.defaults) | dict(first.defaults)
    kind = f"{first.kind} joined with {second.kind}"
    return Table(path, names, read, where, kind, defaults, notes, lambda: _digest(first, second)), rest


class _Timed:
    """A log with its times, s, and the rows that have one of their own."""

    def __init__(self, table: Table, source: ColumnSource | None, key: str) -> None:
        self.table = table
        missing = source is None or any(name not in table.names for name in source.columns)
        if source is None or missing:
            found = f"no such column; the log has: {', '.join(table.names[:30])}"
            raise InputError(table.path, f"column {key}", found, f"a line in [columns] / --map {key}=YOURNAME")
        self.column = source.columns[0]
        time = source.values("time", table.numbers(source.columns))
        for doubt in suspect_time(source, time):
            if doubt.sure:
                mend = doubt.mend.replace('"time=', f'"{key}=').replace("write time =", f'write "{key}" =')
                raise InputError(table.path, f"column '{doubt.column}'", doubt.found, mend)
        self.rows, _ = check_time(table, self.column, time)
        self.time = time[self.rows]

    def values(self, known: Mapping[str, ColumnSource], quantities: Sequence[str]) -> dict[str, FloatArray]:
        """The columns of some quantities that this log has, (n,) each."""
        found = {}
        for key, source in known.items():
            if key.partition(".")[0] in quantities and set(source.columns) <= set(self.table.names):
                found[key] = source.values(key, self.table.numbers(source.columns))[self.rows]
        return {key: values for key, values in found.items() if np.isfinite(values).sum() > 10}


def _found(path: Path, one: _Timed, other: _Timed, columns: Mapping[str, ColumnSource]) -> tuple[float, str]:
    """The shift of the second log's clock, and what is said of it."""
    both = [(each, known_columns(each.table, columns)) for each in (one, other)]
    warm = [
        {k: v for k, v in each.values(known, ["temperature"]).items() if k != "temperature.ambient"}
        for each, known in both
    ]
    heat = [each.values(known, list(_HEAT)) for each, known in both]
    if warm[0] and heat[1]:
        sign, pairs = 1.0, _pairs(one, warm[0], other, heat[1])
    elif warm[1] and heat[0]:
        sign, pairs = -1.0, _pairs(other, warm[1], one, heat[0])
    else:
        found = "no temperature in one of the logs, or no torque, current or power in the other"
        raise InputError(path, "join", found, f"lines in [columns] for them, or the shift: {path}@SECONDS")
    shifts: dict[str, Shift] = {}
    reasons = []
    for name, pair in pairs.items():
        try:
            shifts[name] = shift_of(*pair)
        except NoOnsetError as reason:
            reasons.append(str(reason))
    if not shifts:
        expected = f"logs that begin before the heating does, or the shift: {path}@SECONDS"
        raise InputError(path, "join", f"no onset of heating to align on ({reasons[0]})", expected)
    best = min(shifts, key=lambda name: shifts[name].error)
    seconds, error = sign * shifts[best].seconds, shifts[best].error
    note = f"{other.table.path.name}: its clock set forward by {seconds:.2f} ± {error:.2g} s, so that the onset of "
    note += f"heating fits ({best}); a sensor's own lag is in it."
    apart = {
        name: sign * each.seconds for name, each in shifts.items() if abs(each.seconds - shifts[best].seconds) > _AGREE
    }
    if apart:
        note += f" Not alike: {', '.join(f'{name} {value:.1f} s' for name, value in apart.items())}."
    return seconds, note


Pair = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def _pairs(
    warm: _Timed, temperatures: Mapping[str, FloatArray], hot: _Timed, inputs: Mapping[str, FloatArray]
) -> dict[str, Pair]:
    """Each temperature with the heat at its own place, or where there is none with the sum of all of one kind."""
    heats = {key: np.abs(values) ** _HEAT[key.partition(".")[0]] for key, values in inputs.items()}
    kind = next(each for each in _HEAT if any(key.startswith(f"{each}.") for key in heats))
    total = np.sum([np.nan_to_num(values) for key, values in heats.items() if key.startswith(f"{kind}.")], axis=0)
    pairs = {}
    for key, readings in temperatures.items():
        place = key.partition(".")[2]
        own = next((f"{each}.{place}" for each in _HEAT if f"{each}.{place}" in heats), "")
        heat = heats.get(own, total)
        known, fed = np.isfinite(readings), np.isfinite(heat)
        name = f"{key} against {own or f'all {kind}s'}"
        pairs[name] = (warm.time[known], readings[known], hot.time[fed], heat[fed])
    return pairs


def _merged(
    one: _Timed, other: _Timed, shift: float, mine: Sequence[str], others: Mapping[str, str], wanted: Sequence[str]
) -> pd.DataFrame:
    """Both logs' columns on the union of their times; empty where the other log has a row."""
    parts = []
    for each, own, names in (
        (one, one.time, {name: name for name in mine}),
        (other, other.time + shift, others),
    ):
        numbers = each.table.numbers(names.values())
        parts.append((own, {new: numbers[name][each.rows] for new, name in names.items()}))
    time, columns = on_one_time(parts)
    columns["time"] = time
    return pd.DataFrame({name: columns[name] for name in wanted}, copy=False)


def _digest(first: Table, second: Table) -> str:
    return hashlib.sha256(f"{first.digest()} {second.digest()}".encode()).hexdigest()
