"""A log's channels: what the file has and what it says in SI, and what all checks ask of them, worked out once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd

from lptn.basics.arrays import BoolArray, FloatArray, IntArray
from lptn.logs.clock import counted_from, stretch_in_words
from lptn.logs.columns import AMBIENT, HEATS, ColumnSource, as_line_or_option, column_unit, place_of, quantity_of
from lptn.logs.issue import Issue
from lptn.logs.resampling import means_of_blocks, means_of_windows

# --- Stretches of rows ----------------------------------------------------------------------------

FEWEST = 20  # readings, or changes of these, that tell what a channel is like
NEARLY_ALL = 0.9  # share of rows, blocks or stretches that do the same, where the others do otherwise by chance
GAP = 10.0  # times the usual distance of readings, or of their means: nothing was logged for a while
SHORTEST, STILL = 60.0, 180.0
"""s, of a number at an end of the range, and of one among others: filters in drives let a steady motor's reading stand
for two minutes."""
Kind = Literal["frozen", "clamped", "dead", "disconnected", "wrap", "spike", "code", "interpolated"]


@dataclass(frozen=True)
class Silence:
    """A stretch in which what a channel says is no reading; or all its spikes, or all readings of one code, together.

    Args:
        kind: "spike" for single readings, "code" for a number that stands again and again, "wrap" where all leaps are
            alike, "dead" for one far number that stands for a minute, "frozen" for one that it had, "clamped" for the
            end of its range, "interpolated" for a straight line, "disconnected" for all else.
        value: what the channel gives, or the middle of it, in SI or degC; of spikes and counters that wrap how far they
            leap.
        start: s, of the first of these readings.
        stop: s, of the last.
        rows: which rows of the log it covers, shape (n,).
        column: of several that are averaged the one; '' for a quantity of one column.
        whole: the channel never says anything else.
        left_out: a model does not read it.
    """

    kind: Kind
    value: float
    start: float
    stop: float
    rows: BoolArray
    column: str = ""
    whole: bool = False
    left_out: bool = True

    @classmethod
    def at(
        cls, time: FloatArray, kind: Kind, value: float, rows: BoolArray | IntArray, *, whole: bool = False
    ) -> Silence:
        """That of some rows, true ones of (n,) or numbers of (rows,), at times (n,) s."""
        which = np.zeros(time.size, dtype=bool)
        which[rows] = True
        stamps = time[which]
        return cls(kind, value, float(stamps[0]), float(stamps[-1]), which, whole=whole)

    @property
    def lasts(self) -> bool:
        """Whether it is a stretch, and not single readings here and there."""
        return self.kind not in ("spike", "code", "wrap")


def without_silent(values: FloatArray, silent: Sequence[Silence]) -> FloatArray:
    """A channel's values, (n,), NaN where it is silent."""
    return np.where(np.any([one.rows for one in silent], axis=0), np.nan, values) if silent else values


def spans(rows: BoolArray) -> list[tuple[int, int]]:
    """The first of each stretch of rows (n,) that are true, and the one behind its last."""
    edges = np.flatnonzero(np.diff(rows, prepend=False, append=False)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def standing(readings: FloatArray) -> tuple[IntArray, IntArray]:
    """First and last of each stretch of readings (n,) in which all are the same, (stretches,) each."""
    changes = np.flatnonzero(readings[1:] != readings[:-1])
    return np.append(0, changes + 1), np.append(changes, readings.size - 1)


_FEW = 10_000  # readings that tell what is usual
_MEASURED = 50  # numbers that a measured load takes; fewer are what was asked for


def few_of(values: FloatArray) -> FloatArray:
    """Of values (n,) some ten thousand at the most, as far apart; an odd number, so that of two by turns both count."""
    return values[:: max(1, values.size // _FEW) | 1]


def is_measured(values: FloatArray) -> bool:
    """Whether values (n,) take as many numbers as a sensor's do."""
    few = few_of(values)
    return np.unique(few[np.isfinite(few)]).size >= _MEASURED


def usual_length(lengths: IntArray) -> tuple[int, bool]:
    """How many rows stretches (n,) usually have, 1 of none, and whether nearly all of them have as many."""
    counts = np.bincount(lengths, minlength=2)  # most are alike, which takes a median long
    usual = max(int(np.searchsorted(np.cumsum(counts), 0.5 * lengths.size)), 1)
    return usual, bool(counts[usual] >= NEARLY_ALL * lengths.size)


# --- A sensor, by all its readings -----------------------------------------------------------------

_FINEST, _COARSEST = 0.02, 5.0  # K; finer is the file's rounding, coarser is a fault code such as 85 or 0
_RETURNS = 3  # times that each level returns on average, before a grid is believed
_OFF_GRID = 0.02  # of the step, by which a level may lie beside the grid


def quantisation_step(values: FloatArray) -> float:
    """The step, K, of the regular grid on which raw readings (n,) sit, NaN where missing; 0.0 if there is none.

    A grid is believed when each level returns three times on average, and all levels fit it within 2 %.
    """
    readings = values[np.isfinite(values)]
    # float32 and unit conversion blur the last digits; pandas needs no sorting of millions of rows
    few = pd.unique(np.round(few_of(readings), 4))
    if not few.size or few.size > 1.1 * (1 + np.ptp(readings) / _FINEST):  # more levels than a grid has
        return 0.0
    levels = pd.unique(np.round(readings, 4))
    if levels.size < 2 or readings.size < _RETURNS * levels.size:
        return 0.0
    gaps = np.diff(np.sort(levels))
    step = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
    counts = np.round(gaps / step)
    step = float(gaps.sum() / counts.sum())
    regular = np.abs(gaps - counts * step).max() <= _OFF_GRID * step
    return float(f"{step:.4g}") if regular and _FINEST <= step <= _COARSEST else 0.0


class Sensor(NamedTuple):
    """What all readings of a temperature say: its first, least, largest, middle one, what hardly any is below; steps.

    All in degC, the step in K, 0 for none.
    """

    first: float
    least: float
    most: float
    middle: float
    low: float
    step: float


class GainChange(NamedTuple):
    """A load that in some stretch makes another heat in its part.

    Args:
        rows: the first and the last of the log's rows in which it does.
        ratio: of the heat for its square to that else, where it may be in another unit; 0 where it makes none.
        still: where it makes none, whether the part's temperature stands all the same: its sensor is stuck.
    """

    rows: tuple[int, int]
    ratio: float
    still: bool


# --- All channels of a log ---------------------------------------------------------------------------

_LOW = 0.05  # share of readings, below which a channel seldom is
_OF_MOST = 0.05  # of what goes with the heat of the joint that has most: with less a part is warmed by its neighbours
_PARTS, _BLOCK, _MOST_PARTS = 120, 30.0, 500
"""Blocks of a log at least, in whose means a part's warming stands out of its sensor's noise; s of one in a longer log,
so that a stretch of three minutes has six; and so many at the most."""
_BEYOND = 100.0  # times what 99 of 100 squares of a load are, that none has


@dataclass
class Channels:
    """Quantities of a log, and where they stand in its file.

    Args:
        values: `time` [s] and the quantities, (n,) each, in SI and degC, NaN where missing.
        sources: where they stand.
        numbers: the file's columns, (n,) each, as they stand there.
        units: what a row of units in the file says of a column.
        where: a row's place in the file, in words, where each row has one.
        air: the temperature of what surrounds the robot, whether it is logged or not.
        known_means: `means`, and rows of `heats`, that were asked for already, by the channels that they are made of.
        gains: how a load's heat changes, by load, as it was found (`law.py`), of all that is made of this log.
    """

    values: Mapping[str, FloatArray]
    sources: Mapping[str, ColumnSource] = field(default_factory=dict)
    numbers: Mapping[str, FloatArray] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    where: Callable[[int], str] | None = None
    air: str = AMBIENT
    known_means: dict[tuple[str, ...], FloatArray] = field(default_factory=dict)
    gains: dict[str, GainChange | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.time = self.values["time"]

    def of(self, quantity: str) -> dict[str, FloatArray]:
        """Its channels, (n,) each, by their keys."""
        return {key: x for key, x in self.values.items() if quantity_of(key) == quantity}

    def when(self, start: float, stop: float) -> str:
        """A stretch from one of its times [s] to another in words, with the rows of the file if they are known."""
        words = stretch_in_words(start, stop, counted_from(float(self.time[0])))
        if self.where is None:
            return words
        first, last = (self.where(int(row)) for row in np.searchsorted(self.time, [start, stop]))
        return f"{words} ({first} to {last.rpartition(' ')[2]})"

    def with_channels(self, values: Mapping[str, FloatArray]) -> Channels:
        """The same with another course of some channels, (n,) each."""
        means = {key: x for key, x in self.known_means.items() if values.keys().isdisjoint(key)}
        return replace(self, values={**self.values, **values}, known_means=means)

    def without(self, silent: Mapping[str, Sequence[Silence]]) -> Channels:
        """The same with NaN where channels are silent."""
        return self.with_channels({key: without_silent(self.values[key], some) for key, some in silent.items() if some})

    @cached_property
    def sensors(self) -> dict[str, Sensor]:
        """What the readings of each temperature say that has some, by its key."""
        found = {}
        for key, values in self.of("temperature").items():
            if (x := values[np.isfinite(values)]).size:
                told = (x[0], x.min(), x.max(), np.median(x), np.quantile(few_of(x), _LOW), quantisation_step(x))
                found[key] = Sensor(*map(float, told))
        return found

    @cached_property
    def loads(self) -> dict[str, FloatArray]:
        """Torque or current of each place of which a part's own heat goes with the square, (n,) each, by place."""
        loads: dict[str, FloatArray] = {}
        for quantity in reversed(HEATS):
            own = {place_of(key): x for key, x in self.of(quantity).items()}
            few = {place: few_of(x) for place, x in own.items()}
            power = {place: float(np.nanmean(np.square(x))) for place, x in few.items() if np.isfinite(x).any()}
            most = max(power.values(), default=0.0)
            loads |= {place: own[place] for place, mean in power.items() if mean > _OF_MOST * most}
        return loads

    def load_of(self, place: str) -> str:
        """The key of what heats a place, '' where nothing of it is logged."""
        return next((key for quantity in HEATS if (key := f"{quantity}.{place}") in self.values), "")

    def is_believed(self, key: str) -> bool:
        """Whether somebody said which readings of a channel are valid, who knows the machine."""
        return bool(np.isfinite(self.sources[key].valid).any())

    def believed(self, key: str) -> str:
        """The entry by which all that a channel says is valid: a range with some room around all its numbers."""
        raw = np.concatenate([x[np.isfinite(x)] for x in map(self.numbers.__getitem__, self.sources[key].columns)])
        far = float(f"{max(2 * np.abs(raw).max(initial=0.0), 1.0):.0e}")
        return as_line_or_option(key, replace(self.sources[key], valid=(-far, far)))

    def issue(
        self,
        key: str,
        problem: str,
        remedy: str,
        kind: str = "unit",
        *,
        certain: bool = False,
        corrected: ColumnSource | None = None,
        stretch: tuple[float, float] | None = None,
    ) -> Issue:
        """What is odd about a channel, or in a stretch of it; {} in the remedy is the line of the corrected entry."""
        column = (*(corrected or self.sources[key]).columns, key)[0]  # times by a rate have no column
        remedy = remedy.replace("{}", as_line_or_option(key, corrected)) if corrected else remedy
        return Issue(key, column, problem, remedy, certain, corrected, kind, stretch)

    def in_unit(self, key: str, unit: str, problem: str, *, certain: bool = True) -> Issue:
        """That a column seems to be in another unit."""
        remedy = f"write {{}}; if it is {column_unit(key)} all the same, say so as its unit"
        return self.issue(key, problem, remedy, certain=certain, corrected=replace(self.sources[key], unit=unit))

    # Means over some hundred blocks: times, temperatures, the squares of loads, the sizes of speeds.

    @cached_property
    def block(self) -> int:
        """Rows of a block; 0 where time does not run forwards, so that nothing is told."""
        forwards = self.time.size > 0 and bool((np.diff(self.time) > 0).all())
        parts = np.clip((self.time[-1] - self.time[0]) / _BLOCK, _PARTS, _MOST_PARTS) if forwards else np.inf
        return int(self.time.size // parts)

    def means(self, key: str) -> FloatArray:
        """Of one channel, (blocks,)."""
        if (key,) not in self.known_means:
            values, quantity = self.values[key], quantity_of(key)
            values = np.square(self._borne(key)) if quantity in HEATS else values
            values = np.abs(values) if quantity == "velocity" else values
            self.known_means[key,] = means_of_blocks(values, self.block)
        return self.known_means[key,]

    def heats(self, load: str) -> list[FloatArray]:
        """A load's square and, where its joint moves, the size of its speed and of their product, (blocks - 1,) each.

        As a mean temperature moves by them from a block to the next: what comes late in a block counts for that.
        """
        borne, speed = self._borne(load), f"velocity.{place_of(load)}"
        made: dict[tuple[str, ...], FloatArray] = {(load,): np.square(borne)}
        if speed in self.values:
            made |= {(speed,): np.abs(self.values[speed]), (load, speed): np.abs(borne * self.values[speed])}
        return [self._between((*channels, "between"), values) for channels, values in made.items()]

    def _between(self, key: tuple[str, ...], values: FloatArray) -> FloatArray:
        """Of each row the mean over a block's length from there on, of these the mean over each block, but the last."""
        if key not in self.known_means:
            onwards = means_of_windows(values, self.block)[: self.block * (values.size // self.block - 1)]
            self.known_means[key] = means_of_blocks(onwards, self.block)
        return self.known_means[key]

    def _borne(self, load: str) -> FloatArray:
        """A load's values, (n,), NaN where it is one that nothing bears beside the others."""
        values = self.values[load]
        few = np.square(few_of(values))
        usual = float(np.quantile(few[np.isfinite(few)], 0.99)) if np.isfinite(few).any() else 0.0
        return np.where(np.square(values) > _BEYOND * usual, np.nan, values) if usual > 0 else values
