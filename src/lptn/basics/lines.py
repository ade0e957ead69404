"""Lines as they are drawn: time in the unit that people read, long series thinned without losing a peak."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from lptn.basics.arrays import FloatArray, IntArray

LONG = 600.0  # s; longer time axes are in minutes


def time_unit(span: float) -> tuple[float, str]:
    """The unit [s] in which a person reads times that span so many seconds, and the label of an axis in it."""
    return (60.0, "time [min]") if span > LONG else (1.0, "time [s]")


def time_axis(time: FloatArray) -> tuple[FloatArray, str]:
    """Times [s] in the unit that a person reads them in, and the axis label."""
    unit, label = time_unit(float(np.ptp(time)) if time.size else 0.0)
    return time / unit, label


def thinned(time: FloatArray, columns: FloatArray, most: int) -> tuple[FloatArray, FloatArray]:
    """Lines that look the same with at most about `most` points, all at the same times.

    Each block of readings keeps the smallest and the largest value of each line; the very last reading stays itself.

    Args:
        time: (n,).
        columns: (lines, n), NaN where missing.
        most: about how many points to keep.
    """
    n = time.size
    if n <= max(most, 3):
        return time, columns
    edges = np.linspace(0, n - 1, max(most, 3) // 2 + 1).astype(int)
    low = np.fmin.reduceat(columns[:, : n - 1], edges[:-1], axis=1)
    high = np.fmax.reduceat(columns[:, : n - 1], edges[:-1], axis=1)
    return joined(time, columns.__getitem__, edges, low, high)


def joined(
    time: FloatArray, lines: Callable[[Any], FloatArray], edges: IntArray, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Lines through the smallest and the largest value of each block, first the one that the block begins nearer to.

    Args:
        time: (n,).
        lines: (lines, n), as an index of NumPy takes values out of it.
        edges: the first reading of each block, then the one behind the last, which stays itself.
        low: the smallest values, (lines, blocks).
        high: the largest.
    """
    starts, ends = edges[:-1], edges[1:] - 1
    falling = lines((slice(None), ends)) < lines((slice(None), starts))
    pairs = np.stack([np.where(falling, high, low), np.where(falling, low, high)], axis=2)
    kept = np.concatenate([pairs.reshape(len(pairs), -1), lines((slice(None), edges[-1:]))], axis=1)
    return np.append(np.stack([time[starts], time[ends]], axis=1).ravel(), time[edges[-1]]), kept
