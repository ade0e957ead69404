"""Columns and rows of a log that say the same: one of two channels is not what it is said to be; a logger stopped.

Joints that work alike are as warm as each other, but no sensor repeats another's noise. Rows in which all columns
stand, though some hardly ever do, are what the logger had last.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.logs.channels import FEWEST, NEARLY_ALL, Channels, few_of, is_measured, spans, standing, usual_length
from lptn.logs.columns import HEATS, INPUTS, place_of
from lptn.logs.issue import Issue
from lptn.logs.law import TOLD, heat_told, warming

_HELD, _HELD_ROWS, _AROUND = 2.0, 3, 50  # s, and rows in turn, that stand; rows on both sides that tell what is usual
_USUALLY = 0.2, 0.8  # shares of those rows, between whose numbers, or as far again from them, a column is
_NEW = 0.5  # share of rows in which a column that tells has another number, back and forth
_SEVERAL = 2  # columns that hardly ever stand: one alone is a sensor that froze
_SURE = 1e-9  # chance that temperatures and speeds of a robot that was logged all the while would stand so long


def without_held_rows(log: Channels) -> tuple[Channels, list[Issue]]:
    """A log without what stands in rows that the logger did not write, but repeated; and what is said of these.

    Torques may stand, as they were asked for, and so may what is zero.
    """
    time, channels = log.time, {key: channel for key, channel in log.values.items() if key != "time"}
    alike = np.ones(max(time.size - 1, 0), dtype=bool)
    for channel in channels.values():
        alike &= channel[1:] == channel[:-1]
    measured = [*log.of("temperature").values(), *log.of("velocity").values()]
    held, rows = [], np.zeros(time.size, dtype=bool)
    for first, last in spans(alike):
        if last - first < _HELD_ROWS or time[last] - time[first] < _HELD:
            continue
        beside = np.r_[max(first - _AROUND, 0) : first, last : min(last + _AROUND, alike.size)]
        # What stands where it hardly is beside, as at a code, may stand alone.
        near = list[FloatArray]()
        for x in (x for x in measured if np.isfinite(x[beside]).any()):
            low, high = np.nanquantile(x[beside], _USUALLY)
            near += [x] * bool(2 * low - high <= x[first] <= 2 * high - low)
        moved = (x[beside + 1] - x[beside] for x in near if x[first] != 0)
        moves = [x[np.abs(x) > 0] for x in moved]
        # What is noise turns back in every second move, on average.
        noise = [min(x.size, 2 * int(np.count_nonzero(x[1:] * x[:-1] < 0))) for x in moves]
        shares = [(beside.size - count + 1) / (beside.size + 2) for count in noise]
        telling = [share for share in shares if share < 1 - _NEW]
        if len(telling) >= _SEVERAL and (last - first) * np.log(telling).sum() < np.log(_SURE):
            held.append(time[last] - time[first])
            rows[first + 1 : last + 1] = True
    if not held:
        return log, []
    start, stop = float(time[rows][0]), float(time[rows][-1])
    problem = f"all columns stand {len(held)} time{'s' * (len(held) > 1)}, {sum(held):.4g} s in all, "
    problem += log.when(start, stop)
    issue = log.issue("time", problem, "these rows are left out", "held", stretch=(start, stop))
    return log.with_channels({key: np.where(rows, np.nan, x) for key, x in channels.items()}), [issue]


def suspect_held(log: Channels) -> list[Issue]:
    """Torques, currents or speeds that are sampled more seldom than others of their kind, and repeated between."""
    issues = list[Issue]()
    for quantity in INPUTS:
        usual = dict[str, float]()  # s, that a number stands
        for key, values in log.of(quantity).items():
            rows = np.flatnonzero(np.isfinite(values))
            first, last = standing(values[rows])
            lengths = (last - first + 1)[1:-1]
            if lengths.size < FEWEST or not is_measured(values):
                continue
            length, by_the_clock = usual_length(lengths)
            usual[key] = length * float(np.median(few_of(np.diff(log.time[rows]))))
            if length < _HELD_ROWS or not by_the_clock:
                usual[key] = min(usual[key], _HELD)
        for key in (key for key, each in usual.items() if each > max(_HELD, 2 * min(usual.values()))):
            problem = f"a number each {usual[key]:.3g} s, repeated until the next, while others change in each row"
            remedy = "it is used as it is, late by half of that; log it as often, or as root mean squares"
            issues.append(log.issue(key, problem, remedy, "held"))
    return issues


# --- Channels that say the same -------------------------------------------------------------------

_UNTOLD = 0.3  # of `heat_told`, of a part that its column does not heat: with another joint's at most 0.15
_WHOSE = "one of the two is not where it is said to be"


def reads_alike(log: Channels, one: str, other: str) -> bool:
    """Whether two temperatures say the same, number by number or to their noise."""
    exactly = _moves_alike(log.values[one], log.values[other])
    return exactly or (log.block >= _ROWS and _shares_noise(log, one, other))


def duplicates(log: Channels) -> dict[str, str]:
    """Of temperatures that read alike the later ones, each with the first; but for the air's."""
    return _pairs(log, [key for key in log.of("temperature") if key != log.air], partial(reads_alike, log))


def copies_in(log: Channels, twice: Mapping[str, str]) -> list[Issue]:
    """Temperatures that are another column's, by `duplicates`; torques and currents that are another joint's."""

    def is_one(key: str, other: str) -> bool:
        if not _moves_alike(log.values[key], log.values[other]):
            return False
        # Two joints that are made alike, and commanded alike, have one speed as well.
        speeds = [log.values.get(f"velocity.{place_of(one)}", np.zeros(0)) for one in (key, other)]
        if is_measured(log.values[key]) and not _moves_alike(*speeds):
            return True
        parts = {f"temperature.{place_of(one)}": one for one in (key, other)}
        laws = [warming(log, part, one) for part, one in parts.items() if part in log.values]
        told = [heat_told(law) for law in laws if law]
        return len(told) == len(parts) and min(told) < _UNTOLD and max(told) > TOLD

    unused = f"{_WHOSE}, and beside others neither is used; map its own column"
    issues = [log.issue(key, f"the same readings as {other}", unused, "duplicate") for key, other in twice.items()]
    for quantity in HEATS:
        for key, other in _pairs(log, list(log.of(quantity)), is_one).items():
            if not log.is_believed(key):
                remedy = f"{_WHOSE}: map its own column; if both are right, write {log.believed(key)}"
                issues.append(log.issue(key, f"the same numbers as {other}", remedy, "duplicate"))
    return issues


def _pairs(log: Channels, keys: Sequence[str], is_one: Callable[[str, str], bool]) -> dict[str, str]:
    """Of channels that are one the later ones, each with the first; but those that somebody mapped to one column."""
    pairs: dict[str, str] = {}
    for number, key in enumerate(keys):
        first = next((other for other in keys[:number] if other not in pairs and is_one(key, other)), None)
        pairs |= {key: first} if first else {}
    of = {key: log.sources[key].columns if key in log.sources else (key,) for key in keys}
    return {key: other for key, other in pairs.items() if of[key] != of[other]}


def _moves_alike(one: FloatArray, other: FloatArray) -> bool:
    """Whether two channels give the same numbers, and change in the same rows, of which there are some."""
    if one.size != other.size or np.count_nonzero(one == other) < FEWEST:  # the usual case, said by one look at them
        return False
    both = np.isfinite(one) & np.isfinite(other)
    moves, others = np.diff(one[both]), np.diff(other[both])
    changes = (moves != 0) | (others != 0)
    # Two joints as warm as each other give one number of 1 K in 99 of 100 rows, but cross a step in different ones.
    return bool(np.count_nonzero(changes) >= FEWEST and np.mean((moves == others)[changes]) >= NEARLY_ALL)


_WARMED = 5.0  # K, by which both move
_ROWS = 3  # of a block, 10 s apart at most: over longer a part's warming looks like noise
_ROUNDED = 0.1  # of the noise, by which means over a block may differ beside
_ROUNDING = 1e-6  # K, of two columns that differ by a number
_ORDER = 4  # of the differences between rows that are noise: a part's warming is smooth, and has next to none
_SHARED = 0.5
"""Of the quieter sensor's noise, which a copy repeats whole. What all have of one converter is taken out; of n + 2
sensors, two have 1 / (n + 1) of it left at most."""
_SURELY = 5.0**2 * 2.63
"""Squared correlation times rows that chance does not reach: 5 standard errors of white noise differenced so often,
whose squared autocorrelations add up to 2.63."""


def _shares_noise(log: Channels, one: str, other: str) -> bool:
    """Whether two sensors differ by noise alone, an offset apart, and the one's noise is in the other's."""
    apart, pair = log.means(one) - log.means(other), [log.values[one], log.values[other]]
    if not np.isfinite(apart).all() or min(np.ptp(log.means(one)), np.ptp(log.means(other))) < _WARMED:
        return False
    rows = np.flatnonzero(np.isfinite(pair).all(axis=0))
    if rows.size < FEWEST:
        return False
    noise = float(np.std(np.diff((pair[0] - pair[1])[rows]))) / np.sqrt(2)
    if np.std(apart) > (2 / np.sqrt(log.block) + _ROUNDED) * max(noise, _ROUNDING):
        return False
    # A bus that repeats a reading repeats those of all its sensors.
    rows = rows[np.append(True, np.any([np.diff(x[rows]) != 0 for x in pair], axis=0))]
    if rows.size < FEWEST:
        return False
    others = [x[rows] for key, x in log.of("temperature").items() if key not in (one, other)]
    for beside in ([], [x for x in others if np.isfinite(x).all()]):
        spread = np.cov(np.diff([*(x[rows] for x in pair), *beside], _ORDER))
        common = spread[:2, 2:] @ np.linalg.pinv(spread[2:, 2:], hermitian=True) @ spread[2:, :2]
        (a, shared), (_, b) = spread[:2, :2] - common
        if shared <= _SHARED * min(a, b) or shared**2 * rows.size < _SURELY * a * b:
            return False
    return True
