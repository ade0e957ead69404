"""Whether two runs hold the same readings, in another format, in part, or resampled: then one can't test the other.

Two sensors, or two days, never repeat each other's noise. So a stretch of one run is that of another if all their
temperatures agree within their own noise, wherever in time the one is laid over the other; or, where the one keeps but
a part of the other's readings, if what is noise in the one goes with what is noise in the other. A copy at a lower rate
has rows picked out of the other's, or read between them, or the means of several.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import FloatArray, IntArray
from lptn.logs.run import Run
from lptn.logs.silence import quantisation_step

_LEAST = 60  # changes of readings that are compared at least; fewer, as of robots that cool, may be alike by accident
_PARTS = 4  # of the shorter run, each of which is sought in the longer one
_FEWEST = 10  # steps of a part
_OF_NOISE, _OF_SPREAD = 0.2, 1e-4
"""RMS of differences, as shares of the noise and of the standard deviation of a column, up to which two columns are
one: digits that a format rounds off, not readings of another day, which differ by 1.4 times the noise."""
_MOST_FACTOR = 60  # times that one run's steps may be the other's
_MEANS = 1.5  # times, from which on a copy may hold means of several readings
_AROUND = 2.0  # steps of the coarser run, by which the place where it lies closest may be wrong
_BETWEEN = 10  # places that are tried in each step of the finer run: clocks may be set by less than one


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
            match = _same(readings, copies, stretch) or _same_noise(readings, copies, stretch)
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


def _same(coarse: Mapping[str, FloatArray], copies: Mapping[str, _Copy], stretch: _Stretch) -> _Stretch | None:
    """The stretch, set right by less than a step of the finer run, if all columns agree within their noise."""
    first, size, position = stretch
    parts = {name: values[first : first + size] for name, values in coarse.items()}
    name = max(parts, key=lambda name: _changes(parts[name]))
    around = position + np.arange(-_BETWEEN, _BETWEEN + 1) / _BETWEEN
    apart = [_difference(parts[name], copies[name].at(at, size)) for at in around]
    position = float(around[np.argmin(apart)])
    there = {name: copies[name].at(position, size) for name in parts}
    # Where one of them has a gap, what is laid over it agrees with nothing.
    shared = sum(_changes(np.where(np.isfinite(there[name]), part, np.nan)) for name, part in parts.items())
    if shared >= _LEAST / 2 and all(_is_one(part, there[name]) for name, part in parts.items()):
        return _Stretch(first, size, position)
    return None


def _difference(one: FloatArray, other: FloatArray) -> float:
    """RMS of what two columns differ by; infinite where less than half of them can be compared."""
    apart = (one - other)[np.isfinite(one) & np.isfinite(other)]
    return float(np.sqrt(np.mean(apart**2))) if 2 * apart.size > np.isfinite(one).sum() > 0 else np.inf


def _is_one(part: FloatArray, other: FloatArray) -> bool:
    if not np.isfinite(part).any():
        return True  # a sensor that says nothing says nothing against it
    noise = float(np.nanstd(np.diff(part))) / np.sqrt(2)
    return bool(_difference(part, other) <= max(_OF_NOISE * noise, _OF_SPREAD * float(np.nanstd(part))))


_LEAST_SHARED = 0.1  # correlation of the noise: of one row that is picked from a hundred that the other averages
_CHANCE = 6.0  # standard deviations of it, which other readings reach once in 500 million
_SPREAD = np.sqrt(35 / 18)  # of a correlation of N second differences of white noise, times √N
_MOST_COLUMNS = 4  # that are compared at each of the places, of which there may be hundreds
_MOST_ROWS = 5000  # that are compared: such a correlation shows in a tenth of them
_NOISY = -0.5  # correlation of a second difference with the next one, below which it is noise: -2/3 where it is white


def _same_noise(coarse: Mapping[str, FloatArray], copies: Mapping[str, _Copy], stretch: _Stretch) -> _Stretch | None:
    """A long stretch there, if the noise of some columns together goes with that of the other's.

    Second differences leave noise alone where a temperature moves little from row to row. Days of one motion have one
    ripple, but hardly one level.
    """
    copy = next(iter(copies.values()))
    length, ratio = len(next(iter(coarse.values()))), copy.ratio
    first = max(0, stretch.first - min(int(stretch.position / ratio), _MOST_ROWS // 2))
    position = stretch.position - (stretch.first - first) * ratio
    size = min(length - first, int((copy.length - position) / ratio), _MOST_ROWS)
    parts = {name: values[first : first + size] for name, values in coarse.items()}
    noises = {name: np.diff(part, n=2) for name, part in parts.items() if not _is_rounding(part)}
    noises = {name: noises[name] for name in [name for name in noises if _is_noise(noises[name])][:_MOST_COLUMNS]}
    best, match = 0.0, None
    for at in position + np.arange(-np.ceil(_AROUND * ratio), np.ceil(_AROUND * ratio) + 1):
        score, rows = 0.0, 0
        for name, noise in noises.items():
            there = copies[name].at(float(at), size)
            other = np.diff(there, n=2)
            both = np.isfinite(noise) & np.isfinite(other)
            if both.sum() < _LEAST or not _is_noise(other):
                continue
            a, b = noise[both], other[both]
            if not _is_level(parts[name] - there, float(np.sqrt(max(np.mean(a**2), np.mean(b**2)) / 6))):
                score = -np.inf
            score, rows = score + float(a @ b) / float(np.sqrt((a @ a) * (b @ b))) * a.size, rows + a.size
        weight = score / (_SPREAD * np.sqrt(max(rows, 1)))
        if weight > max(best, _CHANCE) and score > _LEAST_SHARED * rows:
            best, match = weight, _Stretch(first, size, float(at))
    return match


_TOGETHER, _OFF = 20, 0.5
"""Rows whose mean difference is looked at, and how many times the noise of the noisier run it may be: it is 0.2 to 0.3
where both are the same, while two days differ by what the room, the start or the load did."""


def _is_level(apart: FloatArray, noise: float) -> bool:
    """Whether two columns agree on the average of some rows."""
    blocks = apart[: apart.size // _TOGETHER * _TOGETHER].reshape(-1, _TOGETHER)
    means = blocks[np.isfinite(blocks).all(axis=1)].mean(axis=1)
    return means.size > 0 and float(np.sqrt(np.mean(means**2))) <= _OFF * noise


_OF_STEP, _OVER, _DITHERED = 0.1, 10, 0.5
"""Of a sensor's steps, by which a temperature may move from row to row, on average over so many rows, where its noise
is less than half of them: one that moves further is rounded now up, now down, and on two days of one motion alike."""


def _is_rounding(readings: FloatArray) -> bool:
    step, moves = quantisation_step(readings), np.abs(readings[_OVER:] - readings[:-_OVER]) / _OVER
    moved = np.isfinite(moves).any() and float(np.nanmean(moves)) > _OF_STEP * step
    return bool(moved) and float(np.sqrt(np.nanmean(np.diff(readings, n=2) ** 2) / 6)) < _DITHERED * step


def _is_noise(second: FloatArray) -> bool:
    """Whether second differences turn back from row to row, as those of noise do."""
    here, after = second[:-1], second[1:]
    both = np.isfinite(here) & np.isfinite(after)
    power = float(here[both] @ here[both])
    return power > 0 and float(here[both] @ after[both]) / power < _NOISY
