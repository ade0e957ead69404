"""Messages on one clock, in the model's columns and steps: what `lptn.logs.read_log` makes of a log, as it comes."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from pathlib import Path

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray, IntArray
from lptn.basics.errors import InputError
from lptn.identify.data import LoadedModel
from lptn.live.messages import Numbers
from lptn.logs.columns import ColumnSource
from lptn.logs.guess import guess
from lptn.logs.reading import GUESSED, choose_columns
from lptn.logs.resampling import SEVERAL, STEADY_GAP, Grid, feature, raw_keys, sample_values
from lptn.logs.tables import table_of
from lptn.model.model import Model
from lptn.online.operating_point import LOOKED_AT
from lptn.simulate.bound_run import needed_columns

GAP = 10.0
"""s; an input that is silent for so long is not known any more, as in logs, and a clock that moves by so much more or
less than time passes has jumped."""
_STEPS_BRIDGED = 5.0  # steps of the model, where that is longer
_LEARNING = 5.0  # s from the first message, by which each quantity has been in one
_ENOUGH = 5000  # messages, or as many, of a file that says them at once: those of 1 kHz
_SAMPLES_FOR_RATE = 10  # samples from which their rate is known


# --- One clock ------------------------------------------------------------------------------------


class Clock:
    """Time stamps made a clock that never goes back, whatever the source's does.

    A step back, or of a live source one that differs from the time that passed by more than `GAP`, is a jump: the clock
    goes on by the time that passed. A live source's silence is a gap, and so is a step ahead in a file.

    Args:
        live: whether messages come as things happen.
    """

    def __init__(self, *, live: bool) -> None:
        self._live = live
        self.last, self.received, self.shift = math.nan, math.nan, 0.0
        """s: the newest time, when it was received, and what a stamp has to be moved by."""
        self.jumps, self.late = 0, 0

    def of(self, stamps: FloatArray, received: FloatArray) -> FloatArray:
        """Times of messages [s] in order of their coming, (n,), and when each was received; none earlier than another.

        A message that comes late is taken for one of the newest time; stamps that are no number have that time, too.
        """
        own = stamps + self.shift
        before = np.append(self.last, own[:-1]) if math.isfinite(self.last) else np.append(own[:1], own[:-1])
        usual = np.isfinite(own) & (np.abs(own - before) < GAP)
        if not (usual.all() and (own >= before).all()):
            own = np.array([self._one(*pair) for pair in zip(stamps.tolist(), received.tolist(), strict=True)])
        if own.size and np.isfinite(own[-1]):
            self.last, self.received = float(own[-1]), float(received[-1])
        return own

    def _one(self, stamp: float, received: float) -> float:
        if not math.isfinite(stamp):
            return self.last
        own = stamp + self.shift
        if math.isfinite(self.last):
            step, passed = own - self.last, max(received - self.received, 0.0)
            if step < -GAP or (self._live and step - passed > GAP):
                self.jumps += 1
                self.shift += self.last + passed - own
            elif step < 0:
                self.late += 1
            own = max(stamp + self.shift, self.last)
        self.last, self.received = own, received
        return own


# --- The columns of messages -----------------------------------------------------------------------


def wanted_columns(model: Model) -> tuple[list[str], list[str], list[str]]:
    """Columns that a model needs, and that it predicts; and the joints' speeds, which show a gait where they are."""
    return *needed_columns(model), [f"signed_velocity.{node}" for node in model.nodes]


class Columns:
    """Which of the messages' numbers are the model's quantities, learnt from the first messages.

    Args:
        loaded: the model file.
        source: what the messages come from, for messages of errors.
        defaults: where quantities stand in a format that says so itself.
    """

    def __init__(self, loaded: LoadedModel, source: str, defaults: Mapping[str, ColumnSource]) -> None:
        self._loaded, self._source, self._defaults = loaded, source, defaults  # which grow while topics are found
        self._first: dict[str, object] = {}
        self._began = math.nan
        self.sources: dict[str, ColumnSource] = {}
        """Where each raw quantity stands; empty until it is known."""
        self.inputs, self.outputs, self._speeds = wanted_columns(loaded.model)
        self.bad, self.last_bad = 0, ""
        """How many messages could not be used, and why the last."""
        self._count, self._rate = 0, 0.0

    def learn(self, messages: Sequence[tuple[Numbers, float]], *, enough: bool = False) -> list[str]:
        """Look at some of the first messages; what is taken for what, a sentence each, once that is known.

        Args:
            messages: with the times when each was received [s].
            enough: no more will come.

        Raises:
            InputError: after some seconds a quantity has been in no message, or its entry can't be used live.
        """
        for message, received in messages:
            self._first |= {name: x for name, x in message.items() if name not in self._first or x is not None}
            self._began = received if math.isnan(self._began) else self._began
            self._count += 1
            enough = enough or received - self._began > _LEARNING or self._count > _ENOUGH
        every, values = self._loaded.sources_of(self._source)
        for key in values:
            expected = "a column; of the air a number under [model], ambient = 22"
            raise InputError(self._source, f"[columns] {key}", "a value", expected)
        columns = {key: source for key, source in every.items() if not source.rate}
        self._rate = every.get("time", ColumnSource()).rate
        for key, source in columns.items():
            if source.wrap or source.how == "ratio":
                found = "wrap" if source.wrap else "ratio"
                raise InputError(
                    self._source, f"[columns] {key}", found, "an entry that needs no other rows of the log"
                )
        table = replace(table_of(pd.DataFrame([self._first]), self._source), defaults=self._defaults)
        guesses = guess(table, columns, self.inputs, self.outputs) if self._loaded.guessing else []
        columns |= {one.key: one.source for one in guesses}
        notes = [f"{GUESSED}{one.line} ({one.why})." for one in guesses]
        if "time" not in columns and "time" not in table.names and "time" not in self._defaults:
            table = replace(table, names=("time", *table.names))
            of_time = f"counted from the messages, {self._rate:g} a second" if self._rate else "that of reception"
            notes.append(f"time: {of_time}, for the messages have none.")
        try:
            choice = choose_columns(table, columns, self.inputs, self.outputs, self._speeds)
        except InputError:
            if enough:
                raise
            return []
        if not enough and not set(self.outputs).issubset((*choice.outputs, *choice.inputs)):
            return []  # sensors may have messages of their own
        self.sources, self.outputs, self._count = dict(choice.sources), list(choice.outputs), 0
        self._names = list(dict.fromkeys(name for source in self.sources.values() for name in source.columns))
        self._row = itemgetter(*self._names)
        named = (f"{key} is {' '.join(source.columns)}" for key, source in self.sources.items()
                 if (key,) != source.columns)  # fmt: skip
        return [*notes, *choice.notes, f"columns: {', '.join(named) or 'as the model names them'}."]

    def values(self, messages: Sequence[Numbers], received: FloatArray) -> tuple[dict[str, FloatArray], FloatArray]:
        """Raw quantities of messages in SI and degC, (n,) each, NaN where one says nothing of it; when each came, (n,).

        What can't be used is left out and counted.
        """
        numbers, kept = self._numbers(messages)
        received = received[kept]
        if self._rate:
            numbers["time"] = (self._count + np.arange(received.size)) / self._rate
        elif "time" not in self._first and self.sources["time"].columns == ("time",):
            numbers["time"] = received
        self._count += received.size
        # What stands until the next is held by the sampler, from batch to batch.
        found = {key: replace(source, hold=False).values(key, numbers) for key, source in self.sources.items()}
        return {key: np.where(np.isfinite(x), x, np.nan) for key, x in found.items()}, received

    def _numbers(self, messages: Sequence[Numbers]) -> tuple[dict[str, FloatArray], IntArray]:
        try:
            try:
                rows = [self._row(message) for message in messages]
            except KeyError:
                rows = [tuple(message.get(name) for name in self._names) for message in messages]
            table = np.array(rows, dtype=np.float64).reshape(len(messages), len(self._names))
            return dict(zip(self._names, table.T, strict=True)), np.arange(len(messages))
        except (ValueError, TypeError):
            return self._texts(messages)

    def _texts(self, messages: Sequence[Numbers]) -> tuple[dict[str, FloatArray], IntArray]:
        """The same of messages that hold dates, words or nonsense; what a log's reader refuses is left out.

        A word without a digit is no reading of a sensor, as in logs.
        """
        sensors = {name for key, x in self.sources.items() if key.startswith("temperature.") for name in x.columns}
        rows = [{name: message.get(name) for name in self._names} for message in messages]
        for row in rows:
            row |= {name: None for name in sensors if isinstance(x := row[name], str) and not any(map(str.isdigit, x))}
        try:
            frame, name = pd.DataFrame(rows).astype(object), Path(self._source).name or self._source
            table = table_of(frame.where(frame.notna(), None), name)
            return table.numbers(self._names, sensors), np.arange(len(rows))
        except InputError as error:
            if len(rows) == 1:
                self.bad, self.last_bad = self.bad + 1, str(error)
                return {name: np.zeros(0) for name in self._names}, np.zeros(0, dtype=int)
        parts = [self._texts([message]) for message in messages]
        kept = np.flatnonzero([own.size for _, own in parts])
        return {name: np.concatenate([numbers[name] for numbers, _ in parts]) for name in self._names}, kept


# --- Rows in the model's steps ----------------------------------------------------------------------


@dataclass(frozen=True)
class Rows:
    """Rows as a run has them.

    Attributes:
        time: (n,) s, where each begins.
        columns: the model's inputs and temperatures, (n,) each; temperatures are NaN where nothing was read.
        raw: raw quantities, (n,) each, of rows that are samples; of means the newest reading of each sensor in a row,
            which shows its steps.
        first: nothing is known of what lies before them: the log's beginning, or a gap.
    """

    time: FloatArray
    columns: Mapping[str, FloatArray]
    raw: Mapping[str, FloatArray]
    first: bool


class Sampler:
    """Puts samples, whose inputs hold until the next, on the model's steps; rarer ones stay as they are.

    Args:
        inputs: `<feature>.<place>` columns that the model is driven by.
        outputs: temperature columns that it predicts.
        sources: where the raw quantities stand, of which `afterwards` says what holds when one is silent.
        step: of the model [s].
        period: s between samples, where that is known from before.
    """

    def __init__(
        self,
        inputs: Sequence[str],
        outputs: Sequence[str],
        sources: Mapping[str, ColumnSource],
        step: float,
        period: float | None = None,
    ) -> None:
        self._inputs, self._outputs, self._step = list(inputs), list(outputs), step
        self._driving = list(dict.fromkeys(key for column in inputs for key in raw_keys(column, sources)))
        others = [key for key in sources if key != "time" and key not in self._driving]
        self._keys = [*self._driving, *others]
        self._sources = sources
        longest = max(GAP, _STEPS_BRIDGED * step)
        steady = {key: STEADY_GAP if key.startswith("temperature.") else longest for key in self._driving}
        self._most = np.array([np.inf if sources[key].hold else most for key, most in steady.items()])
        self._gap = longest
        self._known = np.full((2, len(self._driving)), np.nan)  # value and time of each input's last word
        self._time, self._pending = np.zeros(0), np.zeros((0, len(self._keys)))
        self._start = math.nan  # s, of the next row; NaN until the first after a gap
        self.period = period
        """s between samples, once that is known."""
        self._speeds = deque[tuple[float, FloatArray]]()  # of the last seconds, at the source's own rate
        self._moving = [k for k, key in enumerate(self._keys) if key.startswith("velocity.")]
        speeds = (self._keys[k] for k in self._moving)
        # Beside what the model needs, what shows a torque to be false: that its joint moves without it.
        self._columns = [*self._inputs, *(key for key in speeds if key not in self._inputs)]
        self.missing: tuple[str, ...] = ()
        """Inputs that are silent, so that nothing can be said."""
        self.gone = set[str]()
        """Those that fell silent since this was emptied."""

    @property
    def averaged(self) -> bool:
        """Whether rows are means over a step, which holds several samples."""
        return self.period is not None and self._step >= SEVERAL * self.period

    @property
    def step(self) -> float:
        """s between rows."""
        return self._step if self.averaged or self.period is None else max(self._step, float(f"{self.period:.3g}"))

    @property
    def speeds(self) -> list[FloatArray]:
        """Joints' speeds in the last half minute, with their sign, a `period` apart, (n,) each: what shows a gait."""
        return list(np.vstack([block for _, block in self._speeds]).T) if self.averaged and self._speeds else []

    def add(self, time: FloatArray, raw: Mapping[str, FloatArray], *, end: bool = False) -> list[Rows]:
        """Take in samples at times (n,), increasing; the rows that are complete.

        Args:
            time: s, of `Clock`.
            raw: quantities, (n,) each.
            end: nothing more comes.
        """
        if time.size:
            samples = self._held(time, raw)
            there = ~np.isnan(samples[:, : len(self._driving)]).any(axis=1)
            self._time = np.append(self._time, time[there])
            self._pending = np.vstack([self._pending, samples[there]])
            if self._moving:
                self._speeds.append((float(time[-1]), samples[there][:, self._moving]))
                while self._speeds[0][0] < time[-1] - LOOKED_AT:
                    self._speeds.popleft()
        if self.period is not None and not self.averaged and time.size >= _SAMPLES_FOR_RATE:
            self.period = min(self.period, float(np.median(np.diff(time))) or self.period)
        if self.period is None and (self._time.size >= _SAMPLES_FOR_RATE or (end and self._time.size > 1)):
            self.period = float(np.median(np.diff(self._time))) or self._step / _SAMPLES_FOR_RATE
        if self.period is None:
            return []
        # What lies before a gap and behind it is put on a grid of its own.
        if self._time.size and not self.averaged and self._time[0] - self._start > self._gap:
            self._start = math.nan
        borders = np.flatnonzero(np.diff(self._time) > self._gap) + 1
        found = list[Rows]()
        for size in np.diff(borders, prepend=0).tolist():
            found += self._taken(size, end=True)
            self._start = math.nan
        return [*found, *self._taken(self._time.size, end=end)]

    def _held(self, time: FloatArray, raw: Mapping[str, FloatArray]) -> FloatArray:
        """Samples of the driving quantities, held until their next, NaN where that is too late; and readings."""
        given = np.column_stack([raw.get(key, np.full(time.size, np.nan)) for key in self._keys])
        count, n = len(self._driving), np.arange(time.size)[:, None]
        latest = np.maximum.accumulate(np.where(np.isnan(given[:, :count]), -1, n), axis=0)
        new, places = latest >= 0, np.arange(count)
        values = np.where(new, given[np.maximum(latest, 0), places], self._known[0])
        since = np.where(new, time[np.maximum(latest, 0)], self._known[1])
        self._known = np.array([values[-1], since[-1]])
        silent = ~(time[:, None] - since <= self._most)
        for place in np.flatnonzero(silent.any(axis=0)).tolist():
            afterwards = self._sources[self._driving[place]].afterwards
            if afterwards is not None:
                values[:, place] = np.where(silent[:, place], afterwards, values[:, place])
                silent[:, place] = False
        self.missing = tuple(key for key, one in zip(self._driving, silent[-1], strict=True) if one)
        gone = silent & np.isfinite(since)
        self.gone |= {self._driving[place] for place in np.flatnonzero(gone.any(axis=0)).tolist()}
        given[:, :count] = np.where(silent, np.nan, values)
        return given

    def _taken(self, size: int, *, end: bool) -> list[Rows]:
        """The complete rows of the first samples; those that are needed no more are forgotten."""
        time, samples = self._time[:size], self._pending[:size]
        if not size:
            return []
        first = math.isnan(self._start)
        start = float(time[0]) if first else self._start
        raw = dict(zip(self._keys, samples.T, strict=True))
        if not self.averaged:
            self._start, self._time, self._pending = float(time[-1]), self._time[size:], self._pending[size:]
            rules = {column: feature(column) for column in self._inputs}
            columns = {column: rule.after(rule.before(sample_values(column, raw))) for column, rule in rules.items()}
            return [Rows(time, columns | {key: raw[key] for key in self._outputs}, raw, first)]
        # A step is taken a step late, so that what is read once in it has a reading on either side.
        until = float(time[-1]) + (self.period or 0.0) if end else float(time[-1]) - self._step
        count = math.floor((until - start) / self._step + 1e-6)
        found = []
        if count > 0:
            on = Grid(start, self._step, count)
            held, columns = on.held(time), {}
            for column in self._columns:
                rule = feature(column)
                columns[column] = rule.after(held(rule.before(sample_values(column, raw))))
            columns |= {key: on.averages(time, raw[key], self._gap) for key in self._outputs}
            readings = {key: _newest(time, raw[key], on.starts, self._step) for key in self._outputs}
            found = [Rows(on.starts, columns, readings, first)]
            self._start = start + count * self._step
        elif first:
            self._start = start
        keep = size if end else max(int(np.searchsorted(time, self._start - self._step)) - 1, 0)
        self._time, self._pending = self._time[keep:], self._pending[keep:]
        return found


def _newest(time: FloatArray, values: FloatArray, starts: FloatArray, step: float) -> FloatArray:
    """The newest of values (n,) at times (n,) in each step from its start on, (m,), NaN where it has none."""
    there = np.flatnonzero(np.isfinite(values))
    if not there.size:
        return np.full(starts.size, np.nan)
    last = there[np.maximum(np.searchsorted(time[there], starts + step) - 1, 0)]
    return np.where((time[last] >= starts) & (time[last] < starts + step), values[last], np.nan)
