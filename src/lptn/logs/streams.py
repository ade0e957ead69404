"""Streams of several publishers under one name, told apart: their mean is nobody's torque.

A bag says who speaks: messages of one topic come over connections, and bear frames and names of joints in an order.
Sources whose messages take turns, and say different things of one quantity, are two. Where nothing names them, a course
that goes back and forth from row to row does.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lptn.basics.arrays import BoolArray, FloatArray, IntArray
from lptn.logs.columns import ColumnSource
from lptn.logs.issue import Issue

ANOTHER_SOURCE = "of another source"
"""What notes on messages and rows say that are left out, and every command says."""

# --- Sources that a topic's messages name -----------------------------------------------------------


_TAKE_TURNS = 0.5  # share of the messages of the rarer source that lie between those of the other
_FEWEST = 10  # messages of a source
_APART = 3.0  # times the usual step of one source, by which another's readings lie from the reading before
_OTHER_SIZE = 1.5  # times the mean square, by which two sources of one noisy quantity can't differ


@dataclass(frozen=True)
class Conflict:
    """Two sources that say different things of one number.

    Attributes:
        sources: who they are.
        name: the number.
        silent: those of them that say zero throughout.
    """

    sources: tuple[Hashable, Hashable]
    name: str
    silent: tuple[Hashable, ...]


def conflicts(names: Sequence[str], values: FloatArray, sources: Sequence[Hashable]) -> list[Conflict]:
    """Pairs of sources that take turns and differ, each with the first number in which they do.

    Args:
        names: of the numbers.
        values: (n, names), in order of time; NaN where a message lacks one.
        sources: (n,), whose message each is.
    """
    order = list(dict.fromkeys(sources))
    if len(order) < 2:
        return []
    label = np.array([order.index(source) for source in sources])
    found = []
    for k, one in enumerate(order):
        for j in range(k + 1, len(order)):
            both = (label == k) | (label == j)
            if not _take_turns(label[both] == j):
                continue
            columns = [np.where(both, values[:, place], np.nan) for place in range(len(names))]
            name = next(
                (name for name, x in zip(names, columns, strict=True) if _differ(x, label == k, label == j)), ""
            )
            if name:
                silent = [
                    source for source, at in ((one, k), (order[j], j)) if not np.nan_to_num(values[label == at]).any()
                ]
                found.append(Conflict((one, order[j]), name, tuple(silent)))
    return found


def _take_turns(second: BoolArray) -> bool:
    rarer = min(int(second.sum()), int((~second).sum()))
    return rarer >= _FEWEST and int((np.diff(second.astype(int)) != 0).sum()) >= 2 * _TAKE_TURNS * rarer


def _differ(x: FloatArray, one: BoolArray, other: BoolArray) -> bool:
    """Whether two sources of one number say different things of it."""
    there = np.isfinite(x)
    a, b = x[one & there], x[other & there]
    if min(a.size, b.size) < _FEWEST:
        return False
    row, is_other = x[there], other[there]
    across = np.abs(np.diff(row))[np.diff(is_other.astype(int)) != 0]
    within = max(float(np.median(np.abs(np.diff(own)))) for own in (a, b))
    small = 1e-9 * float(np.abs(row).max())  # rounding
    sizes = sorted((float(np.mean(a**2)), float(np.mean(b**2))))
    return (
        bool(across.size and np.median(across) > _APART * within + small)
        or sizes[1] > _OTHER_SIZE * sizes[0] + small**2
    )


# --- Courses that go back and forth, where nothing names their sources --------------------------------


_DRIVES = ("torque", "current")
_TURNED_OFF = ("torque", "current", "velocity")
_OFTEN, _SHARE = 20, 0.4  # times, and share of the rows, that a course goes back and forth
_SAME, _MOSTLY = 0.25, 0.7  # of its size, by which a course differs at most across another's row, and how often
_LOUD = 0.1  # of the size of all: steps of a coarse sensor at rest are none
_FEWEST_SIZES = 3  # that a course has, and none that turns between two steps of a coarse sensor
_BETWEEN = 5.0  # times the difference of its neighbours, that a row lies off both


def rows_of_zeros(values: Mapping[str, FloatArray], sources: Mapping[str, ColumnSource]) -> tuple[BoolArray, list[str]]:
    """Rows, (n,), of a second source that says zero of all joints between those of one that does not, and of what.

    A joint that is driven now and then rests longer than a row, or comes back with another torque; one that turns
    round goes through zero. Who says in an entry of [columns] what is valid is believed.

    Args:
        values: (n,) each, in order of time.
        sources: where they stand.
    """
    keys, rows, drives = _drives_of(values, sources)
    none = np.zeros(next(iter(values.values())).size, dtype=bool)
    size = np.linalg.norm(drives, axis=1)
    if not size.any():
        return none, []
    zero = size == 0
    edges = np.flatnonzero(np.diff(zero.astype(int))) + 1
    starts, stops = np.concatenate(([0], edges)), np.concatenate((edges, [zero.size]))
    lengths, of_zeros = stops - starts, zero[starts]
    inner = of_zeros & (starts > 0) & (stops < zero.size)
    if inner.sum() < _OFTEN or min(np.median(lengths[inner]), np.median(lengths[~of_zeros])) > 1:
        return none, []
    before, behind = drives[starts[inner] - 1], drives[stops[inner]]
    largest = np.maximum(np.linalg.norm(before, axis=1), np.linalg.norm(behind, axis=1))
    same = np.linalg.norm(before - behind, axis=1) <= _SAME * largest
    loud = largest > _LOUD * float(np.sqrt(np.mean(size[~zero] ** 2)))
    if np.mean(same & loud) < _MOSTLY or np.unique(largest).size < _FEWEST_SIZES:
        return none, []
    none[rows[zero]] = True
    off = [key for key in values if key.partition(".")[0] in _TURNED_OFF and not np.nan_to_num(values[key][none]).any()]
    return none, [*keys, *(key for key in off if key not in keys)]


def back_and_forth(values: Mapping[str, FloatArray], sources: Mapping[str, ColumnSource]) -> list[Issue]:
    """The doubt that torques or currents are those of two sources in turn: each row lies off both of its neighbours."""
    keys, _, drives = _drives_of(values, sources)
    if len(drives) < 3 * _OFTEN:
        return []
    off = np.linalg.norm(drives[1:-1] - (drives[:-2] + drives[2:]) / 2, axis=1)
    turn = (off > _BETWEEN * np.linalg.norm(drives[2:] - drives[:-2], axis=1)) & (off > 0)
    size = np.linalg.norm(drives, axis=1)
    active = np.maximum(size[1:-1], size[:-2]) > _LOUD * size.max()
    turn &= active
    if turn.sum() < max(_OFTEN, _SHARE * active.sum()) or np.unique(size[1:-1][turn]).size < _FEWEST_SIZES:
        return []
    column = sources[keys[0]].columns[0]
    problem = f"goes back and forth from row to row, {turn.sum()} times, as the courses of two sources would"
    remedy = "log one of them; if it is one all the same, say so by valid = [LEAST, GREATEST] in its entry of [columns]"
    return [Issue(keys[0], column, problem, remedy, False, kind="streams")]


def _drives_of(
    values: Mapping[str, FloatArray], sources: Mapping[str, ColumnSource]
) -> tuple[list[str], IntArray, FloatArray]:
    """Torques, or else currents: their names, the rows that have all of them, (m,), and their values, (m, k)."""
    for quantity in _DRIVES:
        keys = [
            key for key in values if key.partition(".")[0] == quantity and not np.isfinite(sources[key].valid).any()
        ]
        if keys:
            table: npt.NDArray[np.float64] = np.column_stack([values[key] for key in keys])
            rows = np.flatnonzero(np.isfinite(table).all(axis=1))
            return keys, rows, table[rows]
    return [], np.zeros(0, dtype=np.intp), np.zeros((0, 1))
