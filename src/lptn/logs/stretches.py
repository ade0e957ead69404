"""Where a log can be used without a break: short gaps are bridged, long ones split it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lptn.arrays import FloatArray

Span = tuple[float, float]


def find_stretches(
    time: FloatArray, period: float, inputs: Mapping[str, FloatArray], max_gap: float
) -> tuple[list[Span], list[str]]:
    """The stretches [start, stop), s, in which every input is known or bridged, and notes on the gaps.

    Args:
        time: (n,) s, strictly increasing.
        period: s, the usual time between samples; the last sample before a gap holds so long.
        inputs: raw inputs by name, (n,) each, NaN where missing, each with at least one number.
        max_gap: s, the longest time between two samples of an input that is bridged.
    """
    blocked, notes = _gaps("time", time, np.zeros(time.size), period, max_gap)
    for name, values in inputs.items():
        if np.isnan(values).any():
            more, said = _gaps(name, time, values, period, max_gap)
            blocked += more
            notes += said
    return _complement(blocked, time[0], time[-1] + period), notes


def _gaps(
    name: str, time: FloatArray, values: FloatArray, period: float, max_gap: float
) -> tuple[list[Span], list[str]]:
    known = np.flatnonzero(~np.isnan(values))
    stamps = time[known]
    apart = np.diff(stamps)
    long = apart > max_gap
    # In a column only its own gaps are counted: those where rows stand without a value.
    own = np.diff(known) > 1 if name != "time" else apart > 1.5 * period
    short = own & ~long
    notes = []
    if short.any():
        treated = "bridged by holding the last value"
        notes.append(f"{name}: {_count(int(short.sum()))} up to {apart[short].max():.4g} s, {treated}.")
    if (own & long).any():
        longest = f"over {max_gap:.4g} s, the longest {apart[long].max():.4g} s"
        notes.append(f"{name}: {_count(int((own & long).sum()))} {longest}; the log is split there.")
    lead, trail = stamps[0] - time[0], time[-1] - stamps[-1]
    if lead > 0 or trail > 0:
        notes.append(f"{name}: no value in the first {lead:.4g} s and the last {trail:.4g} s; cut off.")
    blocked = [(-np.inf, float(stamps[0])), (float(stamps[-1] + period), np.inf)]
    blocked += zip((stamps[:-1] + period)[long].tolist(), stamps[1:][long].tolist(), strict=True)
    return blocked, notes


def _count(gaps: int) -> str:
    return f"{gaps} gap{'s' * (gaps > 1)}"


def _complement(blocked: list[Span], first: float, last: float) -> list[Span]:
    free, start = [], first
    for low, high in sorted(blocked):
        if low > start:
            free.append((start, min(low, last)))
        start = max(start, high)
    return free
