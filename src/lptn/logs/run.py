"""A run: one uninterrupted stretch of a log on a uniform time grid, in SI and degC."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from math import isfinite, nan

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.logs.clock import counted_from
from lptn.logs.issue import Issue
from lptn.logs.resampling import reduce_blocks
from lptn.logs.scatter import Scatter

LATEST_FIRST = 30.0
"""s; a first reading that comes later says little about the start of a run, with time constants of minutes."""


_SINCE_1970 = 3e8, 1e10  # s, from 1979 to 2286: clocks that count from 1970


@dataclass(frozen=True)
class Run:
    """One stretch of a log.

    Attributes:
        name: file stem; pieces of a split log are `stem#1`, `stem#2`.
        step: s, the same throughout.
        time: (n,) s, start of each interval, in the log's own clock.
        columns: `<feature>.<place>` -> (n,); temperatures in degC, NaN where missing; all else SI, never NaN.
        averaged: temperatures are means over [t, t+step); if False, values at t. Inputs hold over the step.
        source: the file it came from.
        fingerprint: SHA-256 of the file's bytes.
        scatter: of a temperature column's readings in the whole log, as they were logged; none of rows that are means.
        beginning: the log's first readings, degC, by temperature column; all pieces of a split log share them.
        resolution: for a temperature column whose sensor moves in steps, the step in K.
        notes: what is noteworthy about the file and how it was treated, a sentence each.
        issues: those of the notes that name something wrong, with the line that would correct it.
        log_start: s, in the log's own clock, where the log begins; before the run, where that is a later piece of it.
        log_end: s, in the log's own clock, where the log ends; behind the run, where it is cut at a gap.

    Example:
        >>> import lptn
        >>> (run,) = lptn.load_model("examples/tclab/two_heaters.toml").runs(["examples/tclab/log.csv"])
        >>> run.slice(0, 60)
        <Run log: 60 steps of 1 s, 4 columns>
        >>> run.temperature("heater1").shape
        (599,)
    """

    name: str
    step: float
    time: FloatArray
    columns: Mapping[str, FloatArray]
    averaged: bool
    source: str
    fingerprint: str
    notes: tuple[str, ...] = ()
    resolution: Mapping[str, float] = field(default_factory=dict)
    scatter: Mapping[str, Scatter] = field(default_factory=dict)
    beginning: Mapping[str, float] = field(default_factory=dict)
    issues: tuple[Issue, ...] = ()
    log_start: float = nan
    log_end: float = nan

    def __len__(self) -> int:
        return int(self.time.size)

    def __repr__(self) -> str:
        return f"<Run {self.name}: {len(self)} steps of {self.step:g} s, {len(self.columns)} columns>"

    @property
    def late(self) -> float:
        """How long after its log the run begins [s], 0 where that is not known."""
        return max(float(self.time[0]) - self.log_start, 0.0) if isfinite(self.log_start) else 0.0

    @property
    def origin(self) -> float:
        """Where figures and sentences begin to count [s, in the log's own clock]: at the log's start where the clock
        began long before it, as in 1970; else at 0.
        """
        return counted_from(self.log_start if isfinite(self.log_start) else float(self.time[0]))

    @property
    def began(self) -> datetime | None:
        """The time of day at `origin`, where the log's clock counts from 1970, as those of computers do."""
        return datetime.fromtimestamp(self.origin, UTC) if _SINCE_1970[0] < self.origin < _SINCE_1970[1] else None

    @property
    def elapsed(self) -> FloatArray:
        """(n,) s, start of each interval, counted from `origin`."""
        return self.time - self.origin

    def has(self, column: str) -> bool:
        """Whether the run holds `<feature>.<place>`."""
        return column in self.columns

    def temperature(self, place: str) -> FloatArray:
        """Temperatures at `place`, (n,) degC, NaN where missing.

        Raises:
            InputError: that place is not measured.
        """
        column = f"temperature.{place}"
        if column not in self.columns:
            measured = ", ".join(name for name in self.columns if name.startswith("temperature."))
            raise InputError(self.source, f"column {column}", "no such column", f"one of: {measured or 'none'}")
        return self.columns[column]

    def to_pandas(self) -> pd.DataFrame:
        """The columns, indexed by the start of each interval: the time of day (UTC) where the log knows it, else s."""
        seconds = pd.Index(self.time, name="time [s]")
        index = pd.to_datetime(self.time, unit="s", utc=True).rename("time") if self.began else seconds
        return pd.DataFrame(dict(self.columns), index=index)

    def slice(self, start: float, stop: float) -> Run:
        """The intervals that begin at or after `start` and before `stop`, both s in the log's clock.

        Raises:
            InputError: no interval begins there.
        """
        # Grid points carry rounding errors; a millionth of a step must not decide.
        inside = (self.time >= start - 1e-6 * self.step) & (self.time < stop - 1e-6 * self.step)
        if not inside.any():
            span = f"{self.time[0]:.10g} to {self.time[-1] + self.step:.10g} s" if len(self) else "a run with data"
            raise InputError(self.source, f"time window {start:.10g} to {stop:.10g} s", "no data in it", span)
        columns = {name: values[inside] for name, values in self.columns.items()}
        return replace(self, time=self.time[inside], columns=columns)

    def coarsen(self, factor: int) -> Run:
        """Blocks of `factor` steps made one: RMS where the feature is an RMS, else means; a rest is dropped.

        Raises:
            InputError: `factor` is below 1 or longer than the run.
        """
        if not 1 <= factor <= len(self):
            raise InputError(self.source, "coarsen", f"factor {factor}", f"a whole number from 1 to {len(self)}")
        if factor == 1:
            return self
        columns = {name: self._in_blocks(name, values, factor) for name, values in self.columns.items()}
        blocks = min(len(values) for values in columns.values())
        return replace(
            self,
            step=self.step * factor,
            time=self.time[: blocks * factor : factor],
            columns={name: values[:blocks] for name, values in columns.items()},
            averaged=True,
        )

    def _in_blocks(self, column: str, values: FloatArray, factor: int) -> FloatArray:
        """Blocks of a column; samples of a temperature are joined by straight lines, the last has no successor."""
        if self.averaged or not column.startswith("temperature."):
            return reduce_blocks(column, values, factor)
        there = np.flatnonzero(np.isfinite(values))
        if not there.size:
            return reduce_blocks(column, values[:-1], factor)
        joined = np.interp(np.arange(len(self)), there, values[there], left=np.nan, right=np.nan)
        means = reduce_blocks(column, 0.5 * (joined[:-1] + joined[1:]), factor)
        means[np.setdiff1d(np.arange(means.size), there // factor)] = np.nan  # where nothing was read
        return means
