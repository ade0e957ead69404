"""Whether two runs hold the same readings, in another format, in part, or resampled: then one can't test the other.

Two sensors, or two days, never repeat each other's noise. So one run is laid over the other where it lies closest, and
they are the same if there the noise of the one goes with that of the other, and they are as warm. A copy at a lower
rate has rows picked out of the other's, or read between them, or the means of several: it keeps a part of its noise.
Where a temperature has no noise, or its sensor's steps hide it, the two may differ by what a format rounds off.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import FloatArray, IntArray
from lptn.logs.resampling import means_of_blocks
from lptn.logs.run import Run
from lptn.logs.silence import quantisation_step

_LEAST = 60  # changes of readings that are compared at least; fewer, as of robots that cool, may be alike by accident
_PARTS = 4  # of the shorter run, each of which is sought in the longer one
_FEWEST = 10  # steps of a part
_MOST_FACTOR = 60  # times that one run's steps may be the other's
_MEANS = 1.5  # times, from which on a copy may hold means of several readings
_AROUND, _BETWEEN = 2.0, 10
"""Steps of the coarser run by which the place where it lies closest may be wrong; places that are tried in the finer
run's steps beside it: clocks may be set by less than one."""


def repeated_stretch(one: Run, other: Run) -> tuple[float, float] | None:
    """When in `other`, in s of its clock, its readings are those of `one`; `None` where they are its own.

    Args:
        one: a run.
        other: another; either may be a part of the other, or its readings at a lower rate, as they are or as means.
    """
    names = [name for name in one.columns if name.startswith("temperature.") and other.has(name)]
    coarse, fine = (one, other) if one.step >= other.step else (other, one)
    ratio = coarse.step / fine.step
    if not names or ratio > _MOST_FACTOR:
        return None
    readings = {name: coarse.columns[name] for name in names}
    for means in (False, True) if ratio > _MEANS else (False,):
        copies = {name: _Copy(fine.columns[name], ratio, means) for name in names}
        for stretch in _stretches(readings, copies):
            match = _same(readings, copies, stretch) or _same(readings, copies, _longer(stretch, coarse, fine))
            if match is not None:
                start = other.time[0] + (match.first * coarse.step if other is coarse else match.position * fine.step)
                return float(start), float(start + (match.size - 1) * coarse.step)
    return None


class _Copy:
    """What a copy at a lower rate would hold.

    Args:
        readings: of the run that it is of, (n,) degC, NaN where missing.
        ratio: of the copy's steps to the run's.
        means: whether it holds means over its steps, not readings at their beginning.
    """

    def __init__(self, readings: FloatArray, ratio: float, means: bool) -> None:
        self.length, self.ratio, self._means, self._readings = readings.size, ratio, means, readings
        self._sums = np.concatenate(([0.0], np.cumsum(np.nan_to_num(readings))))
        self._steps = np.arange(readings.size + 1.0)
        self._counts = np.concatenate(([0.0], np.cumsum(np.isfinite(readings))))

    def at(self, position: float, size: int) -> FloatArray:
        """Readings of the copy, (size,), the first at a position in steps of the run; NaN where it has none."""
        return self._at(np.asarray(position + np.arange(size) * self.ratio))

    def everywhere(self) -> FloatArray:
        """What the copy would read at each step of the run, (n,)."""
        return self._at(self._steps[:-1])

    def _at(self, positions: FloatArray) -> FloatArray:
        if not self._means:
            return np.asarray(np.interp(positions, self._steps[:-1], self._readings, left=np.nan, right=np.nan))
        ends = [np.clip(edge, 0, self.length) for edge in (positions, positions + self.ratio)]
        total, count = (
            np.diff([np.interp(end, self._steps, sums) for end in ends], axis=0)[0]
            for sums in (self._sums, self._counts)
        )
        return np.where(count > self.ratio - 1e-6, total / self.ratio, np.nan)


class _Stretch(NamedTuple):
    """Where two runs may be one: the first of so many steps of the coarser one, and its position in the finer one's."""

    first: int
    size: int
    position: float


def _stretches(coarse: Mapping[str, FloatArray], copies: Mapping[str, _Copy]) -> Iterator[_Stretch]:
    """For each part of the shorter run where in the longer one it lies closest."""
    any_copy = next(iter(copies.values()))
    ratio, length = any_copy.ratio, len(next(iter(coarse.values())))
    other = int(any_copy.length / ratio)
    shorter = min(length, other)
    size = min(max(shorter // _PARTS, _LEAST), shorter)
    if size < _FEWEST:
        return
    for begin in range(0, shorter - size + 1, size):
        if length <= other:
            parts = {name: values[begin : begin + size] for name, values in coarse.items()}
        else:
            parts = {name: copy.at(begin * ratio, size) for name, copy in copies.items()}
        changes = {name: _changes(part) for name, part in parts.items()}
        if sum(changes.values()) < _LEAST:
            continue
        name = max(changes, key=changes.__getitem__)
        if length <= other:
            where = np.round(np.arange(size) * ratio).astype(int)
            yield _Stretch(begin, size, _closest(copies[name].everywhere(), parts[name], where)[1])
            continue
        # The copy's first row lies anywhere within a step of its own.
        phases = np.arange(np.ceil(ratio)) + begin * ratio
        tried = [_closest(coarse[name], copies[name].at(phase, size), np.arange(size)) for phase in phases]
        best = int(np.argmin([left for left, _ in tried]))
        yield _Stretch(tried[best][1], size, float(phases[best]))


def _closest(longer: FloatArray, part: FloatArray, where: IntArray) -> tuple[float, int]:
    """The least sum of squared differences of a part, whose readings are `where` steps apart, and the step it is at."""
    middle = float(np.nanmean(part)) if np.isfinite(part).any() else 0.0
    a = np.where(np.isfinite(longer), longer - middle, 0.0)
    comb, teeth = np.zeros(where[-1] + 1), np.zeros(where[-1] + 1)
    comb[where], teeth[where] = np.where(np.isfinite(part), part - middle, 0.0), np.isfinite(part)
    if a.size < comb.size:
        return np.inf, 0
    size = 1 << int(np.ceil(np.log2(a.size + comb.size)))

    def product(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.fft.irfft(np.fft.rfft(x, size) * np.conj(np.fft.rfft(y, size)), size)[: a.size - comb.size + 1]

    left = product(a**2, teeth) - 2 * product(a, comb) + float(comb @ comb)
    return float(left.min()), int(np.argmin(left))


def _changes(readings: FloatArray) -> int:
    return int(np.count_nonzero(np.diff(readings[np.isfinite(readings)])))


# --- Whether what lies there is the same ----------------------------------------------------------


_OF_NOISE, _ROUNDED = 0.1, 0.96
"""Correlation of the noise of one row that is picked from a hundred that the other averages; and of two columns that
differ by a fifth of their noise, as by digits that a format rounds off."""
_CHANCE = 6.0  # standard deviations of it, which other readings reach once in 500 million
_SPREAD = np.sqrt(35 / 18)  # of a correlation of N second differences of white noise, times √N
_MOST_COLUMNS, _MOST_ROWS = 4, 5000  # that are compared at each of the places, of which there may be hundreds
_NOISY = -0.5  # correlation of a second difference with the next one, below which it is noise: -2/3 where it is white
_TOGETHER, _OFF = 20, 0.5
"""Rows whose mean difference is looked at, and how many times the noise of the noisier run it may be: it is 0.2 to 0.3
where both are the same, while two days differ by what the room, the start or the load did."""


def _longer(stretch: _Stretch, coarse: Run, fine: Run) -> _Stretch:
    """All that two runs share if they are one there, up to so many rows: little noise that is shared shows in many."""
    ratio = coarse.step / fine.step
    first = max(0, stretch.first - min(int(stretch.position / ratio), _MOST_ROWS // 2))
    position = stretch.position - (stretch.first - first) * ratio
    return _Stretch(first, min(len(coarse) - first, int((len(fine) - position) / ratio), _MOST_ROWS), position)


def _same(coarse: Mapping[str, FloatArray], copies: Mapping[str, _Copy], stretch: _Stretch) -> _Stretch | None:
    """The stretch, set right by a few steps, if there the noise of some columns together goes with that of the other's.

    Second differences leave noise alone where a temperature moves little from row to row. Days of one motion have one
    ripple, but hardly one level.
    """
    first, size, position = stretch
    ratio = next(iter(copies.values())).ratio
    parts = {name: values[first : first + size] for name, values in coarse.items()}
    names = sorted(parts, key=lambda name: -_changes(parts[name]))[:_MOST_COLUMNS]
    needed = {name: _OF_NOISE if _shows_noise(parts[name]) else _ROUNDED for name in names}
    steps = np.arange(-np.ceil(_AROUND * ratio), np.ceil(_AROUND * ratio) + 1)
    best, match = _CHANCE, None
    for at in position + np.union1d(steps, np.arange(-_BETWEEN, _BETWEEN + 1) / _BETWEEN):
        score, rows, changes = 0.0, 0, 0
        for name in names:
            there = copies[name].at(float(at), size)
            both = np.isfinite(parts[name]) & np.isfinite(there)
            own, other = parts[name][both], there[both]
            a, b = np.diff(own, n=2), np.diff(other, n=2)
            power = float(max(a @ a, b @ b))
            if power == 0:
                continue  # a sensor that says nothing says nothing against it
            apart = means_of_blocks(own - other, _TOGETHER)
            if not apart.size or np.mean(apart**2) > _OFF**2 * power / a.size / 6:
                score = -np.inf
                break
            shared = float(a @ b) / float(np.sqrt((a @ a) * (b @ b))) if min(a @ a, b @ b) > 0 else 0.0
            if shared > needed[name]:
                score, rows = score + shared * a.size, rows + a.size
                changes += _changes(own)
        weight = score / (_SPREAD * np.sqrt(max(rows, 1)))
        if weight > best and changes >= _LEAST / 2:
            best, match = weight, _Stretch(first, size, float(at))
    return match


_OF_STEP, _OVER, _DITHERED = 0.1, 10, 0.5
"""Of a sensor's steps, by which a temperature may move from row to row, on average over so many rows, where its noise
is less than half of them: one that moves further is rounded now up, now down, and on two days of one motion alike."""


def _shows_noise(readings: FloatArray) -> bool:
    """Whether readings turn back from row to row, as noise does, and not because they are rounded."""
    second = np.diff(readings, n=2)
    here, after = second[:-1], second[1:]
    both = np.isfinite(here) & np.isfinite(after)
    power = float(here[both] @ here[both])
    if not power > 0 or not float(here[both] @ after[both]) / power < _NOISY:
        return False
    step, moves = quantisation_step(readings), np.abs(readings[_OVER:] - readings[:-_OVER]) / _OVER
    moved = np.isfinite(moves).any() and float(np.nanmean(moves)) > _OF_STEP * step
    return not (moved and float(np.sqrt(np.nanmean(second**2) / 6)) < _DITHERED * step)
