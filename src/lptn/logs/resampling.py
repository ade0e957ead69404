"""Raw samples put on a uniform grid: features from raw quantities, gaps, inputs held, temperatures averaged."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lptn.basics.arrays import FloatArray
from lptn.logs.columns import place_of, quantity_of

SEVERAL = 1.5  # sampling periods: two samples this far apart are no neighbours, and a step this long holds several
_HELD = 2.5  # of its own periods, for which an input that is logged more seldom than the rest holds: one may be lost
ROUNDING = 1e-6  # of a step: what the rounding of a time stamp may make, and must not decide

# --- Features: what a model is driven by, formed from raw quantities and reduced with no integral lost ---


class Feature(NamedTuple):
    """A model's input: the raw quantities whose product it is, and how a block of samples is reduced to one value.

    That is a generalised mean, `after(mean(before(x)))`: what a block preserves is the mean of `before(x)`.
    """

    needs: tuple[str, ...]
    before: Callable[[FloatArray], FloatArray] = np.positive
    after: Callable[[FloatArray], FloatArray] = np.positive


# Copper loss goes with the square of torque or current, so these keep their RMS; the loss of a motor's drive goes with
# |current|. Friction goes with |speed| and with its square, so velocity gives two features. Any quantity that is not
# listed keeps its plain mean.
FEATURES: Mapping[str, Feature] = {
    "temperature": Feature(("temperature",)),
    "torque": Feature(("torque",), np.square, np.sqrt),
    "torque_abs": Feature(("torque",), np.abs),
    "current": Feature(("current",), np.square, np.sqrt),
    "current_abs": Feature(("current",), np.abs),
    "velocity": Feature(("velocity",), np.abs),
    "velocity_rms": Feature(("velocity",), np.square, np.sqrt),
    "mechanical_power": Feature(("torque", "velocity"), np.abs),
    "speed": Feature(("speed",), np.abs),
}

# Of no use to a model, which has no sense of direction; who looks for a gait asks for it by name.
_ON_REQUEST: Mapping[str, Feature] = {"signed_velocity": Feature(("velocity",))}


def feature(column: str) -> Feature:
    """The rule for a column `<feature>.<place>`."""
    quantity = quantity_of(column)
    return FEATURES.get(quantity) or _ON_REQUEST.get(quantity) or Feature((quantity,))


def raw_keys(column: str, available: Iterable[str] = ()) -> tuple[str, ...]:
    """The raw columns that `column` is formed from.

    A log that already holds the feature itself (an earlier run, written to a file) gives it as it is.
    """
    if column in available:
        return (column,)
    return tuple(f"{quantity}.{place_of(column)}" for quantity in feature(column).needs)


def features_of(raw: Iterable[str]) -> tuple[str, ...]:
    """Every feature that a log with the raw columns `raw` gives, raw ones first."""
    present = dict.fromkeys(raw)
    derived = (f"{quantity}.{place}" for place in dict.fromkeys(map(place_of, present)) for quantity in FEATURES)
    return *present, *(key for key in derived if key not in present and all(k in present for k in raw_keys(key)))


def sample_values(column: str, raw: Mapping[str, FloatArray]) -> FloatArray:
    """The feature at each raw sample, (n,), before any reduction; products keep their sign."""
    first, *rest = (raw[key] for key in raw_keys(column, raw))
    for values in rest:
        first = first * values
    return first


def reduce_blocks(column: str, values: FloatArray, factor: int) -> FloatArray:
    """Samples (n,) of `<feature>.<place>` by its rule reduced to full blocks of `factor`, (n // factor,).

    NaN is left out of a block; a block of nothing but NaN gives NaN. A rest at the end is dropped.
    """
    rule = feature(column)
    return rule.after(means_of_blocks(rule.before(values), factor))


def means_of_blocks(values: FloatArray, size: int) -> FloatArray:
    """Mean of each full block of `size` samples, of those that are there, along the last axis: shape (..., n // size).

    NaN for a block of nothing but NaN; a rest at the end is dropped.
    """
    count = values.shape[-1] // size
    blocks = values[..., : count * size].reshape(*values.shape[:-1], count, size)
    return _ratio(np.nansum(blocks, axis=-1), np.sum(~np.isnan(blocks), axis=-1))


def means_of_windows(values: FloatArray, size: int) -> FloatArray:
    """Mean of each `size` samples of (n,) in turn, of those that are there: shape (n - size + 1,), NaN of none."""
    sums, counts = (np.append(0, np.cumsum(x)) for x in (np.nan_to_num(values), np.isfinite(values)))
    return _ratio(sums[size:] - sums[:-size], counts[size:] - counts[:-size])


def _ratio(total: FloatArray, count: npt.NDArray[np.integer]) -> FloatArray:
    """`total / count`, NaN where the count is 0; numpy's own nanmean warns about an empty block."""
    return np.asarray(np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0))


# --- Where a log can be used without a break: short gaps are bridged, long ones split it ----------

Span = tuple[float, float]  # start and stop, s


STEADY_GAP = 300.0
"""s; a temperature among the inputs, such as the room's, is held so long if it has moved by no more than `_STEADY`."""
_STEADY = 1.0  # K; one step of a coarse sensor


def gaps_in_words(gaps: FloatArray) -> str:
    """How many gaps there are, and how long the longest is [s]."""
    return f"{_count(gaps)} up to {gaps.max():.4g} s"


def _count(gaps: FloatArray) -> str:
    return f"{gaps.size} gap{'s' * (gaps.size > 1)}"


# --- Raw samples put on a uniform grid: held inputs, mean or interpolated temperatures ------------


@dataclass(frozen=True)
class Grid:
    """`n` bins of `step` seconds, the first from `start` [s] on."""

    start: float
    step: float
    n: int

    @property
    def starts(self) -> FloatArray:
        """Where the bins begin, (n,) s."""
        return self.start + self.step * np.arange(self.n, dtype=np.float64)

    def held(self, time: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """A function to the means over the bins, (n,), of samples (m,) without NaN, each held until the next.

        Times are (m,) s, increasing, the first not after `start`. No integral of the held signal is lost.
        """
        edges = Grid(self.start, self.step, self.n + 1).starts
        cuts = np.union1d(time[(time > self.start) & (time < edges[-1])], edges[:-1])
        sample, first = np.searchsorted(time, cuts, side="right") - 1, np.searchsorted(cuts, edges[:-1])
        widths = np.diff(cuts, append=edges[-1])
        total = np.add.reduceat(widths, first)
        return lambda values: np.add.reduceat(values[sample] * widths, first) / total

    def means(self, time: FloatArray, values: FloatArray) -> FloatArray:
        """Plain mean of the samples that fall in each bin, (n,); NaN where there is none."""
        # A stamp such as 2.9999999999 belongs to the bin that starts at 3.
        index = np.floor((time - self.start) / self.step + ROUNDING).astype(np.int64)
        inside = (index >= 0) & (index < self.n) & ~np.isnan(values)
        total = np.bincount(index[inside], weights=values[inside], minlength=self.n).astype(np.float64)
        return _ratio(total, np.bincount(index[inside], minlength=self.n))

    def averages(self, time: FloatArray, values: FloatArray, max_gap: float) -> FloatArray:
        """The same, or where bins hold about one reading what a straight line has in their middles.

        The mean of one reading early in a bin would come half a step too soon.
        """
        there, means = ~np.isnan(values), self.means(time, values)
        own, readings = time[there], values[there]
        if own.size < 2 or np.median(np.diff(own)) < self.step / SEVERAL:
            return means
        joined = interpolate(own, readings, self.starts + 0.5 * self.step, max(max_gap, SEVERAL * self.step))
        return np.where(np.isnan(means) | np.isnan(joined), means, joined)


@dataclass(frozen=True)
class Samples:
    """Samples of a log, (n,) s and quantities (n,) each in SI and degC, or means over the intervals that rows begin."""

    time: FloatArray
    raw: Mapping[str, FloatArray]
    means: bool = False

    @cached_property
    def period(self) -> float:
        """The usual time between samples, s."""
        return float(np.median(np.diff(self.time)))

    def averaged(self, step: float) -> bool:
        """Whether a temperature is a mean over a step of so many seconds, which holds several samples or a mean."""
        return self.means or step >= SEVERAL * self.period

    def stretches(self, keys: Collection[str], max_gap: float, steady_gap: float) -> tuple[list[Span], list[str]]:
        """The stretches [start, stop), s, in which every input has a value or is bridged, and notes on the gaps.

        Args:
            keys: raw inputs, NaN where missing, each with at least one number.
            max_gap: s, the longest time between two samples of an input that is bridged. An input that is logged more
                seldom than the rest holds for 2.5 of its own periods at least.
            steady_gap: s, the same for a temperature that is as good as the same before and after.
        """
        missing, notes = self._gaps("time", np.zeros(self.time.size), max_gap, 0.0)
        for name in keys:
            if np.isnan(self.raw[name]).any():
                steady = steady_gap if name.startswith("temperature.") else 0.0
                spans, of_gaps = self._gaps(name, self.raw[name], max_gap, steady)
                missing += spans
                notes += of_gaps
        stretches, start, end = list[Span](), self.time[0], self.time[-1] + self.period
        for low, high in sorted(missing):
            if low > start:
                stretches.append((start, min(low, end)))
            start = max(start, high)
        return stretches, notes

    def _gaps(self, name: str, values: FloatArray, max_gap: float, steady_gap: float) -> tuple[list[Span], list[str]]:
        """Where an input has no value and is not bridged, s, the log's two ends among them; and notes.

        The last sample before a gap holds for the usual time between samples.
        """
        rows, time, period, notes = np.flatnonzero(~np.isnan(values)), self.time, self.period, list[str]()
        stamps = time[rows]
        apart = np.diff(stamps)
        usual = float(np.median(apart)) if apart.size else period
        if slow := usual > SEVERAL * period:
            # How often a temperature is read is said of all of them, by `reading.py`.
            how = "" if name.startswith("temperature.") else f"logged every {usual:.4g} s, "
            notes.append(f"{name}: {how}held between its readings.")
            period, max_gap = usual, max(max_gap, _HELD * usual)
        long = (apart > max_gap) & ((apart > steady_gap) | (np.abs(np.diff(values[rows])) > _STEADY))
        # In a column only its own gaps are counted: those where rows stand without a value.
        own = (np.diff(rows) > 1) & (apart > SEVERAL * usual) if name != "time" else apart > SEVERAL * period
        if (own & ~long).any():
            notes.append(f"{name}: {gaps_in_words(apart[own & ~long])}, bridged by holding the last value.")
        if (own & long).any():
            longest = f"over {max_gap:.4g} s, the longest {apart[long].max():.4g} s"
            notes.append(f"{name}: {_count(apart[own & long])} {longest}; the log is split there.")
        lead, trail = stamps[0] - time[0], time[-1] - stamps[-1]
        if max(lead, trail) > (usual if slow else 0.0):
            ends = [f"the {end} {length:.4g} s" for end, length in (("first", lead), ("last", trail)) if length > 0]
            zero = "; where it was 0 after that, write afterwards = 0 in its entry of [columns]" * bool(trail > max_gap)
            notes.append(f"{name}: no value in {' and '.join(ends)}; cut off{zero if name != 'time' else ''}.")
        outside = [(-np.inf, float(stamps[0])), (float(stamps[-1] + period), np.inf)]
        return outside + list(zip((stamps[:-1] + period)[long].tolist(), stamps[1:][long].tolist(), strict=True)), notes

    def inputs(self, columns: Collection[str], on: Grid) -> dict[str, FloatArray]:
        """Features on a grid, (n,) each, from samples without NaN there."""
        held, averaged, found = on.held(self.time), self.averaged(on.step), dict[str, FloatArray]()
        for column in columns:
            rule = feature(column)
            if column.startswith("temperature.") and not averaged:  # read off as the measured ones are
                found[column] = interpolate(self.time, self.raw[column], on.starts, np.inf)
            else:
                found[column] = rule.after(held(rule.before(sample_values(column, self.raw))))
        return found

    def temperatures(self, columns: Collection[str], on: Grid, max_gap: float) -> dict[str, FloatArray]:
        """Temperatures at each bin's start or, of several samples, their mean, (n,) each, NaN where missing.

        Where a sensor gives about one reading a bin, its readings' straight line is read off, in bins with a reading,
        and so it is at a bin's start, about which a bin may lie; there between rows that follow each other, too, where
        both have a reading. Of rows that are means each counts for the seconds that it has in a bin; a bin of which
        half or less is known stays empty.
        """
        time, period, found = self.time, self.period, dict[str, FloatArray]()
        if self.means:
            ends = time + period
            lost = np.flatnonzero(time[1:] > ends[:-1] + 0.5 * period)  # rows that the log lacks
            held = on.held(np.insert(time, lost + 1, ends[lost]))
        for name in columns:
            values = self.raw[name]
            own = time[np.isfinite(values)]
            if self.means and own.size > 1 and np.median(np.diff(own)) >= SEVERAL * period:
                found[name] = on.averages(time + 0.5 * period, values, max_gap)  # read more seldom than there are rows
            elif self.means:
                known = np.insert(values, lost + 1, np.nan)
                share, total = held(np.isfinite(known) * 1.0), held(np.nan_to_num(known))
                found[name] = np.divide(total, share, out=np.full(on.n, np.nan), where=share > 0.5)
            elif self.averaged(on.step):
                found[name] = on.averages(time, values, max_gap)
            else:
                about = replace(on, start=on.start - 0.5 * on.step).averages(time, values, np.inf)
                between = interpolate(time, values, on.starts, max_gap)
                found[name] = np.where(np.isnan(between), about, between)
        return found


def interpolate(time: FloatArray, values: FloatArray, at: FloatArray, max_gap: float) -> FloatArray:
    """`values` at the times `at`, (n,), on straight lines between neighbouring samples.

    NaN where a neighbour is NaN or the neighbours are more than `max_gap` seconds apart; a sample that is hit
    counts alone. Beyond the ends the first and the last sample hold.
    """
    right = np.clip(np.searchsorted(time, at), 1, time.size - 1)
    left = right - 1
    width = time[right] - time[left]
    weight = np.clip((at - time[left]) / width, 0.0, 1.0)
    between = (1 - weight) * values[left] + weight * values[right]
    between[width > max_gap] = np.nan
    # Rounding of a time stamp must not drag a NaN neighbour in.
    return np.where(weight < ROUNDING, values[left], np.where(weight > 1 - ROUNDING, values[right], between))
