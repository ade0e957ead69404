"""Two logs of one run, `a.csv+b.csv`, made one table: each at its own rate, the second's clock perhaps set forward."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from lptn.basics.arrays import FloatArray, IntArray
from lptn.basics.errors import InputError
from lptn.logs.channels import Channels
from lptn.logs.clock import check_time, in_order
from lptn.logs.columns import ColumnSource
from lptn.logs.tables import Source, Table, column_sources, table_of_sources
from lptn.logs.units import suspect_unit

SECOND_TIME = "time.2"
"""What the second log's time column is mapped as."""
ONE_CLOCK = "its clock is taken for that of "
"""What a note says where nobody said how far the second clock is to be moved."""


def join(
    path: Path, first: Table, second: Table, shift: float | None, columns: Mapping[str, ColumnSource]
) -> tuple[Table, dict[str, ColumnSource]]:
    """Join two logs, the second on the clock of the first.

    Args:
        path: what the user wrote.
        first: one log.
        second: the other; where both have a column of one name, this one's is called `NAME:2`.
        shift: s to add to the second's clock; `None` where it is the first's.
        columns: where the quantities stand in either; `time.2` is the second's time.

    Returns:
        the table, whose time is in s, and the mapping without the time columns.

    Raises:
        InputError: a log has no usable time, or their times have nothing in common.
    """
    given = {key: columns[key] for key in ("time",) if key in columns}
    own, other = column_sources(first, given).get("time"), columns.get(SECOND_TIME)
    time, rows, stamp = _in_time(first, own, "time")
    time2, rows2, stamp2 = _in_time(second, other or column_sources(second, given).get("time"), SECOND_TIME)
    time2 = time2 + (shift or 0.0)
    if min(time[-1], time2[-1]) < max(time[0], time2[0]):
        found = f"times from {time[0]:.10g} to {time[-1]:.10g} s, and from {time2[0]:.10g} to {time2[-1]:.10g} s"
        expected = f"logs of one run; {path}@SECONDS sets the second's clock forward"
        raise InputError(path, "join", found, expected if shift is None else "another shift")
    called = {name: name for name in first.names if name not in {stamp, "time"}}
    called2 = {name: f"{name}:2" if name in first.names else name for name in second.names if name != stamp2}
    logs = (first, time, rows, called), (second, time2, rows2, called2)
    notes = [f"{second.path.name}: its clock set forward by {shift or 0:.6g} s, as given.", *first.notes, *second.notes]
    if shift is None:
        notes[0] = f"{second.path.name}: {ONE_CLOCK}{first.path.name}; if it is another, write {path}@SECONDS."
    if doubled := [name for name, new in called2.items() if new != name]:
        notes.append(f"{', '.join(doubled)}: in both files; the second's is called {called2[doubled[0]]}.")

    def sources(wanted: Sequence[str]) -> list[Source]:
        read: list[Source] = []
        for table, times, kept, names in logs:
            numbers = table.numbers(name for name, new in names.items() if new in wanted)
            read.append((times, {names[name]: values[kept] for name, values in numbers.items()}))
        return read

    table = table_of_sources(
        path,
        ("time", *called, *called2.values()),
        sources,
        f"{first.kind} joined with {second.kind}",
        units={names[name]: unit for log, _, _, names in logs for name, unit in log.units.items() if name in names},
        defaults={**second.defaults, **first.defaults},
        notes=notes,
        digest=lambda: hashlib.sha256(f"{first.digest()} {second.digest()}".encode()).hexdigest(),
    )
    return table, {key: source for key, source in columns.items() if key not in {"time", SECOND_TIME}}


def _in_time(table: Table, source: ColumnSource | None, key: str) -> tuple[FloatArray, IntArray, str]:
    """Times of a log, (n,) s, increasing; the rows that have them, (n,); and the column that they stand in."""
    if source is None or not set(source.columns) <= set(table.names):
        problem = f"no such column; the log has: {table.listing}"
        raise InputError(table.path, f"column {key}", problem, f"a line in [columns] / --map {key}=YOURNAME")
    numbers = table.numbers(source.columns or table.names[:1])
    time = source.values("time", numbers)
    table.note(source.counted)
    for issue in suspect_unit(Channels({"time": time}, {"time": source}, numbers, table.units), "time"):
        if issue.certain:
            remedy = issue.remedy.replace('"time=', f'"{key}=').replace("write time =", f'write "{key}" =')
            raise InputError(table.path, f"column '{issue.column}'", issue.problem, remedy)
    order = in_order(time)
    rows = np.arange(time.size) if order is None else order
    rows = rows[check_time(table, key, source, time[rows])]
    return time[rows], rows, "".join(source.columns) or "time"
