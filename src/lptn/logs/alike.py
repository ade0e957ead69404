"""Columns and rows of a log that say the same: one of two channels is not what it is said to be; a logger stopped.

Two sensors never repeat each other's noise, and two parts with other heats are not as warm as each other. Rows in which
all columns stand, though some hardly ever do, are what the logger had last.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.logs.columns import AMBIENT, HEATS, ColumnSource
from lptn.logs.issue import Issue
from lptn.logs.resampling import means_of_blocks
from lptn.logs.silence import loads_of
from lptn.logs.units import believed

_HELD, _HELD_ROWS, _AROUND = 2.0, 3, 50  # s, and rows in turn, that stand; rows on both sides that tell what is usual
_NEW = 0.5  # share of rows in which a column that tells has another number, back and forth
_SEVERAL = 2  # columns that hardly ever stand: one alone is a sensor that froze
_SURE = 1e-9  # chance that temperatures and speeds of a robot that was logged all the while would stand so long


def without_held_rows(column: str, values: dict[str, FloatArray]) -> tuple[dict[str, FloatArray], list[Issue]]:
    """Quantities without what stands in rows that the logger did not write, but repeated; and what is said of these.

    Torques may stand, as they were asked for, and so may what is zero.

    Args:
        column: of the times.
        values: time [s] and the quantities, (n,) each.
    """
    time, channels = values["time"], {key: channel for key, channel in values.items() if key != "time"}
    alike = np.ones(max(time.size - 1, 0), dtype=bool)
    for channel in channels.values():
        alike &= channel[1:] == channel[:-1]
    edges = np.flatnonzero(np.diff(alike, prepend=False, append=False))
    measured = [channel for key, channel in channels.items() if key.startswith(("temperature.", "velocity."))]
    lively = [x for x in measured if alike.any() and _back_and_forth(np.diff(x)) > _NEW * alike.size]
    held, rows = [], np.zeros(time.size, dtype=bool)
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
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
        return values, []
    start, stop = float(time[rows][0]), float(time[rows][-1])
    problem = f"all columns stand {len(held)} time{'s' * (len(held) > 1)}, {sum(held):.4g} s in all, "
    problem += f"from {start:.10g} to {stop:.10g} s"
    issue = Issue("time", column, problem, "these rows are left out", certain=False, kind="held", stretch=(start, stop))
    return {key: x if key == "time" else np.where(rows, np.nan, x) for key, x in values.items()}, [issue]


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


def copies_in(
    sources: Mapping[str, ColumnSource], numbers: Mapping[str, FloatArray], values: Mapping[str, FloatArray]
) -> list[Issue]:
    """Temperatures that are another column's; torques and currents that are another joint's."""
    issues, whose = [], "one of the two is not where it is said to be"
    for key, other in duplicates_of(sources, values).items():
        remedy = f"{whose}, and beside others neither is used; map its own column"
        problem = f"the same readings as {other}"
        issues.append(Issue(key, sources[key].columns[0], problem, remedy, False, kind="duplicate"))

    def is_one(key: str, other: str) -> bool:
        # Two joints that are made alike, and commanded alike, have one speed as well.
        speeds = [values.get(f"velocity.{one.partition('.')[2]}") for one in (key, other)]
        together = speeds[0] is not None and speeds[1] is not None and _is_copy(speeds[0], speeds[1], moved=0.0)
        return not together and _is_copy(values[key], values[other], moved=0.0, levels=_MEASURED)

    for quantity in HEATS:
        loads = [key for key in sources if key.startswith(f"{quantity}.")]
        for key, other in _pairs(loads, is_one).items():
            if sources[key].columns != sources[other].columns and not np.isfinite(sources[key].valid).any():
                remedy = f"{whose}: map its own column; if both are right, write {believed(key, sources[key], numbers)}"
                problem = f"the same numbers as {other}"
                issues.append(Issue(key, sources[key].columns[0], problem, remedy, False, kind="duplicate"))
    return issues


def duplicates_of(sources: Mapping[str, ColumnSource], values: Mapping[str, FloatArray]) -> dict[str, str]:
    """Temperatures that say number by number what another column says, by quantity, each with that other."""
    read = {key: values[key] for key in sources if key.startswith("temperature.") and key != AMBIENT}
    pairs = duplicates(read, {f"temperature.{place}": load for place, load in loads_of(values).items()})
    return {key: other for key, other in pairs.items() if sources[key].columns != sources[other].columns}


def duplicates(values: Mapping[str, FloatArray], loads: Mapping[str, FloatArray]) -> dict[str, str]:
    """Of temperatures that say the same the later ones, each with the first.

    Args:
        values: by channel, (n,) degC each.
        loads: by channel what goes with the square root of the heat put in there, (n,) each: two parts with other
            heats have other temperatures, though their noise is not the same.
    """
    slow = {name: _means(values[name]) for name in loads.keys() & values.keys()}

    def is_one(name: str, earlier: str) -> bool:
        return _is_copy(values[name], values[earlier]) or (
            name in slow and earlier in slow and _is_as_warm(values, slow, loads, name, earlier)
        )

    return _pairs(list(values), is_one)


def _pairs(names: Sequence[str], is_one: Callable[[str, str], bool]) -> dict[str, str]:
    """Of channels that are one the later ones, each with the first."""
    pairs: dict[str, str] = {}
    for number, name in enumerate(names):
        first = next((other for other in names[:number] if other not in pairs and is_one(name, other)), None)
        pairs |= {name: first} if first else {}
    return pairs


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


_BLOCKS = 100  # parts of a log
_WARMED, _SAME = 5.0, 0.02  # K, by which both move; of it, by which they may differ
_APART, _LEAST_APART = 5.0, 0.1  # times what they differ by, K: so far apart would other heats bring them
_ROUNDED, _LAG = 0.1, 0.3  # of the noise, which blocks may differ by beside; of the log, in which a slow part warms


def _is_as_warm(
    values: Mapping[str, FloatArray],
    slow: Mapping[str, FloatArray],
    loads: Mapping[str, FloatArray],
    one: str,
    other: str,
) -> bool:
    """Whether two parts are as warm as each other to their noise, though the heat that is put in is not the same."""
    apart = slow[one] - slow[other]
    if not np.isfinite(apart).all():
        return False
    moved, differ = float(min(np.ptp(slow[one]), np.ptp(slow[other]))), float(np.sqrt(np.mean(apart**2)))
    if moved < _WARMED or differ > _SAME * moved:
        return False
    noise = float(np.nanstd(np.diff(values[one] - values[other]))) / np.sqrt(2)
    # What would make their temperatures differ: the heats, as a slow part means them, scaled to be as alike as can be.
    a, b = (_lagged(_means(np.square(loads[name]))) for name in (one, other))
    of_means = 2 / np.sqrt(max(values[one].size // _BLOCKS, 1)) + _ROUNDED
    if differ > of_means * noise or not a @ a > 0 or not b @ b > 0:
        return False
    left = a - b * float(a @ b / (b @ b))
    return float(np.ptp(left) / np.ptp(a)) * moved > _APART * max(differ, _LEAST_APART)


def _means(values: FloatArray) -> FloatArray:
    return means_of_blocks(values, max(values.size // _BLOCKS, 1))


def _lagged(heat: FloatArray) -> FloatArray:
    """A heat as a part follows it that warms within a third of the log: what differs from stride to stride is gone."""
    weights = np.exp(-np.arange(heat.size) / (_LAG * heat.size))
    return np.convolve(np.nan_to_num(heat), weights)[: heat.size]
