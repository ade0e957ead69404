"""Columns and rows of a log that say the same: one of two channels is not what it is said to be; a logger stopped.

Two sensors never repeat each other's noise, and two parts with other heats are not as warm as each other. Rows in which
all columns stand, though some hardly ever do, are what the logger had last.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.logs.channels import Channels, spans
from lptn.logs.columns import AMBIENT, HEATS, place_of
from lptn.logs.issue import Issue

_HELD, _HELD_ROWS, _AROUND = 2.0, 3, 50  # s, and rows in turn, that stand; rows on both sides that tell what is usual
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
    measured = [*log.of("temperature").values(), *log.of("velocity").values()] if alike.any() else []
    lively = [x for x in measured if _back_and_forth(np.diff(x)) > _NEW * alike.size]
    held, rows = [], np.zeros(time.size, dtype=bool)
    for first, last in spans(alike):
        if last - first < _HELD_ROWS or time[last] - time[first] < _HELD:
            continue
        beside = np.r_[max(first - _AROUND, 0) : first, last : min(last + _AROUND, alike.size)]
        moves = [_back_and_forth(x[beside + 1] - x[beside]) for x in lively if x[first] != 0]
        shares = [(beside.size - count + 1) / (beside.size + 2) for count in moves]
        telling = [share for share in shares if share < 1 - _NEW]
        if len(telling) >= _SEVERAL and (last - first) * np.log(telling).sum() < np.log(_SURE):
            held.append(time[last] - time[first])
            rows[first + 1 : last + 1] = True
    if not held:
        return log, []
    start, stop = float(time[rows][0]), float(time[rows][-1])
    problem = f"all columns stand {len(held)} time{'s' * (len(held) > 1)}, {sum(held):.4g} s in all, "
    problem += f"from {start:.10g} to {stop:.10g} s"
    column, remedy = log.sources["time"].columns[0], "these rows are left out"
    issue = Issue("time", column, problem, remedy, certain=False, kind="held", stretch=(start, stop))
    return log.with_channels({key: np.where(rows, np.nan, x) for key, x in channels.items()}), [issue]


def _back_and_forth(moves: FloatArray) -> int:
    """How many of a channel's moves are noise: on average, every second one turns back."""
    moves = moves[np.abs(moves) > 0]
    return min(moves.size, 2 * int(np.count_nonzero(moves[1:] * moves[:-1] < 0)))


# --- Channels that say the same -------------------------------------------------------------------

_FEWEST, _ALIKE = 20, 0.99  # changes that a copy makes; share of rows in which two channels give the same number
_MOVED = 0.5  # K; of two that stand still nothing is known
_TOGETHER = 0.5
"""Share of its changes that a copy makes in the same row. Two joints at rest, as warm as each other and read in steps
of 1 K, give the same number in 99 of 100 rows, but cross a step at different ones."""
_MEASURED = 50  # numbers that a measured torque takes; fewer are what was asked for
_WHOSE = "one of the two is not where it is said to be"


def duplicates(log: Channels) -> dict[str, str]:
    """Of temperatures that say the same, number by number or to their noise, the later ones, each with the first."""

    def is_one(key: str, earlier: str) -> bool:
        if _is_copy(log.values[key], log.values[earlier]):
            return True
        return (
            log.block > 0 and {place_of(key), place_of(earlier)} <= log.loads.keys() and _is_as_warm(log, key, earlier)
        )

    return _pairs(log, [key for key in log.of("temperature") if key != AMBIENT], is_one)


def copies_in(log: Channels, twice: Mapping[str, str]) -> list[Issue]:
    """Temperatures that are another column's, by `duplicates`; torques and currents that are another joint's."""
    issues = []
    for key, other in twice.items():
        remedy = f"{_WHOSE}, and beside others neither is used; map its own column"
        column = log.sources[key].columns[0]
        issues.append(Issue(key, column, f"the same readings as {other}", remedy, False, kind="duplicate"))

    def is_one(key: str, other: str) -> bool:
        # Two joints that are made alike, and commanded alike, have one speed as well.
        speeds = [log.values.get(f"velocity.{place_of(one)}") for one in (key, other)]
        together = speeds[0] is not None and speeds[1] is not None and _is_copy(speeds[0], speeds[1], moved=0.0)
        return not together and _is_copy(log.values[key], log.values[other], moved=0.0, levels=_MEASURED)

    for quantity in HEATS:
        for key, other in _pairs(log, list(log.of(quantity)), is_one).items():
            if not log.is_believed(key):
                remedy = f"{_WHOSE}: map its own column; if both are right, write {log.believed(key)}"
                column = log.sources[key].columns[0]
                issues.append(Issue(key, column, f"the same numbers as {other}", remedy, False, kind="duplicate"))
    return issues


def _pairs(log: Channels, keys: Sequence[str], is_one: Callable[[str, str], bool]) -> dict[str, str]:
    """Of channels that are one the later ones, each with the first; but those that somebody mapped to one column."""
    pairs: dict[str, str] = {}
    for number, key in enumerate(keys):
        first = next((other for other in keys[:number] if other not in pairs and is_one(key, other)), None)
        pairs |= {key: first} if first else {}
    of = {key: log.sources[key].columns if key in log.sources else (key,) for key in keys}
    return {key: other for key, other in pairs.items() if of[key] != of[other]}


def _is_copy(one: FloatArray, other: FloatArray, moved: float = _MOVED, levels: int = 0) -> bool:
    """Whether two channels give the same numbers, and move by so much, through so many numbers."""
    equal = int(np.count_nonzero(one == other))
    if equal < _FEWEST:  # the usual case, said by one look at millions of rows
        return False
    both = np.isfinite(one) & np.isfinite(other)
    if equal < _ALIKE * np.count_nonzero(both):
        return False
    moves, others = np.diff(one[both]), np.diff(other[both])
    changes = np.count_nonzero(moves)
    if changes < _FEWEST or np.ptp(one[both]) < moved or np.unique(one[both]).size < levels:
        return False
    return bool(np.count_nonzero((moves == others) & (moves != 0)) >= _TOGETHER * changes)


_WARMED, _SAME = 5.0, 0.02  # K, by which both move; of it, by which they may differ
_APART, _LEAST_APART = 5.0, 0.1  # times what they differ by, K: so far apart would other heats bring them
_ROUNDED, _LAG = 0.1, 0.3  # of the noise, which blocks may differ by beside; of the log, in which a slow part warms


def _is_as_warm(log: Channels, one: str, other: str) -> bool:
    """Whether two parts are as warm as each other to their noise, though the heat that is put in is not the same."""
    apart = log.means(one) - log.means(other)
    if not np.isfinite(apart).all():
        return False
    moved, differ = min(np.ptp(log.means(one)), np.ptp(log.means(other))), float(np.sqrt(np.mean(apart**2)))
    if moved < _WARMED or differ > _SAME * moved:
        return False
    noise = float(np.nanstd(np.diff(log.values[one] - log.values[other]))) / np.sqrt(2)
    # What would make their temperatures differ: the heats, as a part means them that warms within a third of the log,
    # scaled to be as alike as can be.
    heats = [np.nan_to_num(log.means(log.load_of(place_of(key)))) for key in (one, other)]
    weights = np.exp(-np.arange(apart.size) / (_LAG * apart.size))
    a, b = (np.convolve(heat, weights)[: apart.size] for heat in heats)
    if differ > (2 / np.sqrt(log.block) + _ROUNDED) * noise or not a @ a > 0 or not b @ b > 0:
        return False
    left = a - b * float(a @ b / (b @ b))
    return float(np.ptp(left) / np.ptp(a) * moved) > _APART * max(differ, _LEAST_APART)
