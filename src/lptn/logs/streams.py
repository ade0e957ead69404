"""Streams of several publishers under one name, told apart: their mean is nobody's torque.

A bag says who speaks: messages of one topic come over connections, and bear frames and names of joints in an order.
Sources whose messages take turns, and say different things of one quantity, are two. Where nothing names them, rows of
zeros between those of a steady course do. Two that both speak are not known by their courses: a gait that is logged
at twice its rate goes back and forth as well.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from itertools import combinations

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.logs.channels import FEWEST, Channels, is_measured, spans, usual_length
from lptn.logs.clock import FEWEST_ROWS
from lptn.logs.columns import INPUTS

ANOTHER_SOURCE = "of another source"
"""What notes on messages and rows say that are left out."""

# --- Sources that a topic's messages name -----------------------------------------------------------

_TAKE_TURNS = 0.5  # share of the messages of the rarer source that lie between those of the other
_APART = 3.0  # times the usual step of one source, by which another's readings lie from the reading before
_OTHER_SIZE = 1.5  # times the mean square, by which two sources of one noisy quantity can't differ


Conflict = tuple[tuple[Hashable, Hashable], str, tuple[Hashable, ...]]
"""Two sources that say different things of one number: who they are, the number, and which of them say zero alone."""


def conflicts(names: Sequence[str], values: FloatArray, sources: Sequence[Hashable]) -> list[Conflict]:
    """Pairs of sources that take turns and differ, each with the first number in which they do.

    Values are (n, names), in order of time, NaN where a message lacks one; `sources`, (n,), says whose each is.
    """
    number = {source: k for k, source in enumerate(dict.fromkeys(sources))}
    label = np.array([number[source] for source in sources])
    found: list[Conflict] = []
    for pair in combinations(number, 2):
        one, other = (label == number[source] for source in pair)
        second = other[one | other]
        rarer, turns = min(int(second.sum()), int((~second).sum())), int(np.count_nonzero(second[1:] != second[:-1]))
        if rarer < FEWEST_ROWS or turns < 2 * _TAKE_TURNS * rarer:
            continue
        name = next((name for name, x in zip(names, values.T, strict=True) if _differ(x, one, other)), "")
        if name:
            silent = (source for source in pair if not np.nan_to_num(values[label == number[source]]).any())
            found.append((pair, name, tuple(silent)))
    return found


def _differ(x: FloatArray, one: BoolArray, other: BoolArray) -> bool:
    """Whether two sources of one number say different things of it."""
    there = np.isfinite(x) & (one | other)
    a, b = x[one & there], x[other & there]
    if min(a.size, b.size) < FEWEST_ROWS:
        return False
    across = np.abs(np.diff(x[there]))[np.diff(other[there].astype(int)) != 0]
    within = max(float(np.median(np.abs(np.diff(own)))) for own in (a, b))
    small = 1e-9 * float(np.abs(x[there]).max())  # rounding
    less, more = sorted((float(np.mean(a**2)), float(np.mean(b**2))))
    apart = bool(across.size and np.median(across) > _APART * within + small)
    return apart or more > _OTHER_SIZE * less + small**2


# --- A source that says zero of all joints, where nothing names it ---------------------------------------

_SAME, _MOSTLY = 0.25, 0.7  # of its size, by which a course differs at most across another's row, and how often
_LOUD = 0.1  # of the size of all: steps of a coarse sensor at rest are none
_FEWEST_SIZES = 3  # that a course has, and none that turns between two steps of a coarse sensor
_FINE = 10.0  # steps of its sensor, that a speed has around zeros that are another's


def rows_of_zeros(log: Channels) -> tuple[BoolArray, list[str]]:
    """Rows, (n,), of a second source that says zero of all joints between those of one that does not, and of what.

    A joint that is driven now and then rests longer than a row, or comes back with another torque; one that turns
    round goes through zero; several joints do not stop all at once for a row; and none stops by the clock. Who says in
    an entry of [columns] what is valid is believed.
    """
    none = np.zeros(log.time.size, dtype=bool)
    said = [key for quantity in INPUTS for key in log.of(quantity) if not log.is_believed(key)]
    for quantity in INPUTS:
        keys, speeds = [key for key in said if key in log.of(quantity)], quantity == "velocity"
        if min((np.count_nonzero(log.values[key] == 0) for key in keys), default=0) < FEWEST:
            continue
        table = np.column_stack([log.values[key] for key in keys])
        rows = np.flatnonzero(np.isfinite(table).all(axis=1))
        zero = _between_others(table[rows], stopped=speeds)
        if zero.any():
            none[rows[zero]] = True
            # What does not know the joints' speeds is no drive; what knows no torque may know speeds.
            return none, [k for k in said if k in keys or speeds or not np.nan_to_num(log.values[k][none]).any()]
    return none, []


def _between_others(drives: FloatArray, *, stopped: bool) -> BoolArray:
    """Rows of (n, joints) that are zero, single ones or between single others; of speeds, where joints stop at once."""
    size = np.linalg.norm(drives, axis=1)
    zero, nowhere = np.asarray(size == 0), np.zeros(size.size, dtype=bool)
    inner = np.array([one for one in spans(zero) if one[0] > 0 and one[1] < zero.size], np.int_).reshape(-1, 2)
    spoken = np.array(spans(~zero), np.int_).reshape(-1, 2)
    lengths = [usual_length(np.diff(some).ravel()) for some in (inner, spoken[1:-1])]
    if len(inner) < FEWEST or min(length for length, _ in lengths) > 1:
        return nowhere
    before, behind = drives[inner[:, 0] - 1], drives[inner[:, 1]]
    largest = np.maximum(np.linalg.norm(before, axis=1), np.linalg.norm(behind, axis=1))
    if all(by_the_clock for _, by_the_clock in lengths) and is_measured(largest):
        return zero
    if stopped and drives.shape[1] == 1:  # of speeds one alone says nothing else
        return nowhere
    tells = largest > _LOUD * float(np.sqrt(np.mean(size[~zero] ** 2)))
    if stopped:
        tells &= largest > _FINE * float(np.abs(drives[drives != 0]).min())
    else:
        tells &= np.linalg.norm(before - behind, axis=1) <= _SAME * largest
    return zero if np.mean(tells) >= _MOSTLY and np.unique(largest).size >= _FEWEST_SIZES else nowhere
