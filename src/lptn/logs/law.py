r"""How the part warms that a sensor reads, by the log itself; and what of the log contradicts that.

By block means a part with a heat capacity follows

.. math:: \frac{dT}{dt} = a q^2 + \sum_j b_j (T_j - T) + c + d |\omega|, \quad a, b_j, d \ge 0

with its load q, what surrounds it and the speed of its joint, by least squares. A reading that stands, or that is the
air's, is right where the part would have stayed so; it is none where what the law adds up to over that stretch is far
beyond what the law is off elsewhere in as long a time. A load that from some row on makes another heat for its square
is in another unit from there on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray, IntArray
from lptn.logs.columns import AMBIENT, HEATS
from lptn.logs.resampling import means_of_blocks

_PARTS, _BLOCK, _MOST = 120, 30.0, 500
"""Blocks of a log at least, in whose means a part's warming stands out of its sensor's noise; s of one in a longer log,
so that a stretch of three minutes has six; and so many at the most."""
_THIN, _BEYOND = 10_000, 100.0  # readings that tell a load's usual square; times what 99 of 100 are, that none has
_FEWEST = 30  # blocks that tell a law


class Blocks:
    """Block means of a log's channels: times, temperatures, the squares of loads, the sizes of speeds.

    Args:
        values: time [s] and the quantities, (n,) each, in SI and degC.
    """

    def __init__(self, values: Mapping[str, FloatArray]) -> None:
        self.values, self._means = values, dict[str, FloatArray]()
        time = values["time"]
        forwards = time.size > 0 and bool((np.diff(time) > 0).all())  # else nothing is told
        self.size = int(time.size // np.clip((time[-1] - time[0]) / _BLOCK, _PARTS, _MOST)) if forwards else 0

    def with_channel(self, key: str, values: FloatArray) -> Blocks:
        """The same with another course of one channel, (n,)."""
        other = copy(self)
        other.values = {**self.values, key: values}
        other._means = {name: means for name, means in self._means.items() if name != key}
        return other

    def means(self, key: str) -> FloatArray:
        """Of one channel, (blocks,)."""
        if key not in self._means:
            values, quantity = self.values[key], key.partition(".")[0]
            if quantity in HEATS:
                values = np.square(values)
                few = values[:: max(1, values.size // _THIN)]
                usual = float(np.quantile(few[np.isfinite(few)], 0.99)) if np.isfinite(few).any() else 0.0
                values = np.where(values > _BEYOND * usual, np.nan, values) if usual > 0 else values
            values = np.abs(values) if quantity == "velocity" else values
            self._means[key] = means_of_blocks(values, self.size)
        return self._means[key]

    def warming(self, key: str, load: str) -> Warming | None:
        """How a part warms beside what makes it; `None` where the log is too short to tell.

        Args:
            key: its temperature.
            load: the quantity that heats it.
        """
        if self.size == 0 or not np.isfinite(self.means(key)).any():
            return None
        warm, speed = self.means(key), f"velocity.{load.partition('.')[2]}"
        around = [other for other in self.values if other.startswith("temperature.") and other != key]
        around = [other for other in around if np.isfinite(self.means(other)).mean() > _THERE]
        around.sort(key=lambda other: other != AMBIENT)
        known = [np.ones(warm.size - 1), *(_between(self.means(other) - warm) for other in around)]
        if AMBIENT not in around:
            known.insert(1, _between(-warm))
        if speed in self.values:
            known.append(_between(self.means(speed)))
        apart = np.diff(self.means("time"))
        columns = np.column_stack([np.diff(warm) / apart, _between(self.means(load)), *known])
        rows = np.flatnonzero(np.isfinite(columns).all(axis=1))
        if rows.size < _FEWEST:
            return None
        return Warming(rows, columns[rows, 0], apart[rows], columns[rows, 1:], speed in self.values)


_THERE = 0.9  # share of the blocks in which a neighbour has readings


class Warming(NamedTuple):
    """A part's warming beside what makes it.

    Args:
        rows: blocks before those steps from block to block in which all is known, (m,).
        rate: K/s, (m,).
        apart: s between the middles of the two blocks, (m,).
        design: the load's square, 1, air less temperature, other temperatures less it, size of the speed: (m, columns).
        speed: whether that last column is there.
    """

    rows: IntArray
    rate: FloatArray
    apart: FloatArray
    design: FloatArray
    speed: bool

    def off(self, used: BoolArray) -> FloatArray:
        """By how much a part warms otherwise than its law in each step [K], (m,).

        Args:
            used: steps of which the law is taken, (m,); as most of them say, whatever a few that are far off say.
        """
        sizes = np.sqrt(np.square(self.design[used]).mean(axis=0)) + np.finfo(float).tiny
        likely = np.full(sizes.size, _CONDUCTANCE)  # of the air and other parts
        likely[:2] = _HEATS / np.array([sizes[0], 1.0])
        if self.speed:
            likely[-1] = _HEATS / sizes[-1]
        columns = self.design * self.apart[:, None] * likely
        moved, weights, noise = self.rate * self.apart, np.ones(used.sum()), _NOISE
        for _ in range(_REWEIGHTED):
            kept = np.arange(sizes.size)
            while True:
                part = columns[used][:, kept]
                normal = (part.T * weights) @ part + noise**2 * np.eye(kept.size)
                fitted = np.linalg.solve(normal, part.T @ (weights * moved[used]))
                below = np.where(kept == 1, 0.0, fitted)
                if below.min() >= 0:
                    break
                kept = np.delete(kept, below.argmin())
            off = moved - columns[:, kept] @ fitted
            noise = max(_MAD * float(np.median(np.abs(off[used]))), _LEAST)
            weights = 1 / np.maximum(np.abs(off[used]) / (_FAR * noise), 1.0)
        return off


_CONDUCTANCE, _HEATS = 1 / 500, 0.1
"""1/s, of a conductance to a capacity, and K/s of heat, as they are likely: where a log does not tell two of them
apart, neither is large."""
_NOISE, _LEAST = 0.1, 1e-4  # K, of a step, with which the first fit is made; that a log without any has
_MAD, _FAR = 1.48, 2.0  # standard deviation of noise over its median size; times that, what counts by its size alone
_REWEIGHTED = 6  # least squares whose weights make them least absolute errors: a fall is far off, and rare


def _between(values: FloatArray) -> FloatArray:
    """Means of neighbours, shape (n - 1,)."""
    return np.asarray(0.5 * (values[:-1] + values[1:]))


# --- Stretches in which a part would not have stayed where its sensor says that it was --------------


_APART, _STEPS, _TIMES, _USUAL = 3.0, 3.0, 3.0, 0.95
"""K, and steps of the sensor, and times what so many of the stretches as long are off by, at the most: what a part does
by itself, as where a fan starts, is less than that in a stretch in which its sensor happens to stand."""
_WORSE, _LIKELIER = 1.5, 9.0
"""Times the usual error of a step, by which such stretches make the law worse if they count, for each of their steps or
of the others, whichever are fewer; and that, times how far beyond `most` they are: a law that has never seen how a part
cools is wrong where it does, and no worse for learning it. Of healthy quadrupeds and legs the product was up to 7.2."""
_OF_MOVES, _OF_FALL = 0.1, 0.5
"""Of what a part moves by, up to which a law is off in a step, and of a way down to the air: resistances and surfaces
that change with temperature are no part of it."""
_ASKED = 10  # stretches, the longest: those of a whole day's coarse sensor at rest would take minutes
_SPARE = 8  # steps more than the law has coefficients
_WARM, _AT_AIR, _RISES = 6.0, 1.5, 0.2  # K above the air; K from it; K from block to block: it does not fall to the air
SHORTEST, STILL = 60.0, 180.0
"""s, of a number at an end of the range, and of one among others: filters in drives let a steady motor's reading stand
for two minutes."""


def against_heat(blocks: Blocks, key: str, load: str, resolution: float) -> list[tuple[int, int]]:
    """First and last rows of stretches in which a temperature stands, or is the air's, and the part is elsewhere.

    Args:
        blocks: of the log.
        key: the temperature.
        load: what heats its part.
        resolution: the sensor's steps [K], 0 for none.
    """
    time, values, size = blocks.values["time"], blocks.values[key], blocks.size
    there = np.flatnonzero(np.isfinite(values))
    found: list[tuple[int, int]] = []
    if not there.size or (warming := blocks.warming(key, load)) is None:
        return found
    readings, groups = values[there], [[stretch] for stretch in _at_the_air(blocks, key, resolution)]
    for limit in (float(readings.max()), float(readings.min()), None):
        first, last = (there[rows] for rows in standing(readings if limit is None else readings == limit))
        stands = time[last] - time[first] >= (STILL if limit is None else SHORTEST)
        stands &= True if limit is None else values[first] == limit
        stretches = list(zip(first[stands].tolist(), last[stands].tolist(), strict=True))
        # A limit that holds once holds whenever it is reached.
        groups += [[stretch] for stretch in stretches] if limit is None or not stretches else [stretches]
    known = np.ones(warming.rate.size, dtype=bool)
    with_all = warming.off(known) if groups else known
    for group in sorted(groups, key=lambda group: -sum(last - first for first, last in group))[:_ASKED]:
        new = [
            tuple(np.searchsorted(warming.rows, np.array(stretch) // size)) for stretch in group if stretch not in found
        ]
        if new and _is_contradicted(warming, new, known, with_all, resolution):
            found += [stretch for stretch in group if stretch not in found]
            for begin, end in new:
                known[max(begin - 1, 0) : end + 1] = False
            with_all = warming.off(known)
    return found


def standing(readings: FloatArray | BoolArray) -> tuple[IntArray, IntArray]:
    """First and last of each stretch of readings (n,) in which all are the same, (stretches,) each."""
    changes = np.flatnonzero(readings[1:] != readings[:-1])
    return np.append(0, changes + 1), np.append(changes, readings.size - 1)


def _at_the_air(blocks: Blocks, key: str, resolution: float) -> list[tuple[int, int]]:
    """Stretches in which a temperature is that of the air after it was warmer, and before in which it falls to it."""
    if AMBIENT not in blocks.values or key == AMBIENT:
        return []
    warmth = blocks.means(key) - blocks.means(AMBIENT)
    cold = (np.abs(warmth) < _AT_AIR) & np.logical_or.accumulate(warmth > _WARM)
    edges, rises = np.flatnonzero(np.diff(cold, prepend=False, append=False)), np.diff(blocks.means(key))
    stretches = []
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        before = np.flatnonzero(rises[:begin] > max(_RISES, 0.5 * resolution))
        stretches.append(((int(before[-1]) + 1 if before.size else 0) * blocks.size, end * blocks.size - 1))
    return stretches


def _is_contradicted(
    warming: Warming, stretches: Sequence[tuple[int, int]], known: BoolArray, with_all: FloatArray, resolution: float
) -> bool:
    """Whether in one of some stretches the part would have moved otherwise.

    Args:
        warming: of the part.
        stretches: first step of each, and the one behind its last.
        known: steps that are no others', (m,).
        with_all: what the law is off that these stretches are a part of [K], (m,).
        resolution: the sensor's steps [K], 0 for none.
    """
    asked = np.zeros(warming.rate.size, dtype=bool)
    for begin, end in stretches:
        asked[max(begin - 1, 0) : end + 1] = True
    told = known & ~asked
    if np.count_nonzero(told) < _SPARE + warming.design.shape[1]:
        return False
    off = warming.off(told)
    moved = warming.rate * warming.apart
    usual = max(float(np.mean(np.abs(off[told]))), _OF_MOVES * float(np.mean(np.abs(moved[told]))))
    usual = max(usual, float(np.finfo(float).tiny))  # of a robot at rest without any noise
    few = min(np.count_nonzero(asked), np.count_nonzero(told))
    worse = float(np.abs(with_all[known | asked]).sum() - np.abs(off[told]).sum()) / few / usual
    total, elsewhere = (np.concatenate(([0.0], np.cumsum(x))) for x in (off, np.where(told, off, 0.0)))
    for begin, end in stretches:
        as_long = np.abs(elsewhere[end - begin :] - elsewhere[: elsewhere.size - end + begin])
        most = max(_APART, _STEPS * resolution, _TIMES * float(np.quantile(as_long, _USUAL)))
        most = max(most, _OF_FALL * abs(float(moved[begin:end].sum())))
        times = abs(total[end] - total[begin]) / most
        if end > begin and worse > _WORSE and times > 1 and worse * times > _LIKELIER:
            return True
    return False


# --- A load that from some row on makes another heat --------------------------------------------------


_ROWS = 10  # of a block: in fewer the mean square of a load that swings is not known
_CHANGES, _LEAST_PARTS = 100, 15  # places at which it may change; steps on each side, that tell six numbers
_RATIO = 3.0
"""By which heats differ: friction, iron and a winding that warms change them by less, a unit by the square of more."""
_LOADED = 0.02  # of the mean square, on each side: with less load other heat is all that warms a part
_OF_ONE_GAIN = 0.5
"""Of the squares that one gain leaves with all else free to change: a load that is another explains half of them."""
_RIDGE = 1e-9  # of the squares of a column, so that two temperatures that are one leave the rest to be told


class GainChange(NamedTuple):
    """A change of a load's heat.

    Args:
        start: row from which it is another.
        ratio: of the heat that as large a load makes from there on to that before.
    """

    start: int
    ratio: float


def gain_change(blocks: Blocks, key: str, load: str) -> GainChange | None:
    """The change of the heat that a load makes in a part; `None` where there is none beyond doubt.

    Args:
        blocks: of the log.
        key: the part's temperature.
        load: torque or current.
    """
    warming = blocks.warming(key, load) if blocks.size >= _ROWS else None
    if warming is None or warming.rows.size < _PARTS // 2:
        return None
    rate, square, count = warming.rate, warming.design[:, 0], warming.rows.size
    design = warming.design / (np.sqrt(np.square(warming.design).sum(axis=0)) + np.finfo(float).tiny)
    changes = np.arange(_LEAST_PARTS, count - _LEAST_PARTS, max(1, count // _CHANGES))
    of_late = np.cumsum(square[::-1])[::-1][changes]
    means = of_late / (count - changes), (square.sum() - of_late) / changes
    changes = changes[np.minimum(*means) > _LOADED * np.maximum(*means)]
    if not changes.size:
        return None
    # From each row on the load's heat changes, other heat, and what leaves to the air.
    late = np.where(np.arange(count) >= changes[:, None], 1.0, 0.0)[:, :, None] * design[:, :3]
    designs = np.concatenate([late, np.broadcast_to(design, (changes.size, *design.shape))], axis=2)
    fitted, squares = _least_squares(designs, rate)
    best = int(squares.argmin())
    if squares[best] > _OF_ONE_GAIN * _least_squares(designs[:, :, 1:], rate)[1].min():
        return None
    before = float(fitted[best, late.shape[2]])
    gains = before, before + float(fitted[best, 0])
    if max(gains) <= _RATIO * max(min(gains), 0.0):
        return None
    return GainChange(int((warming.rows[changes[best]] + 1) * blocks.size), gains[1] / gains[0])


def _least_squares(designs: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Of each design (n, columns) the coefficients, and the squares that are left."""
    turned = np.swapaxes(designs, 1, 2)
    fitted = np.linalg.solve(turned @ designs + _RIDGE * np.eye(designs.shape[2]), (turned @ values)[:, :, None])
    squares: FloatArray = np.square(values - (designs @ fitted)[:, :, 0]).sum(axis=1)
    return np.asarray(fitted[:, :, 0], dtype=float), squares
