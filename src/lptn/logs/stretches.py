"""Where a log can be used without a break: short gaps are bridged, long ones split it."""

from __future__ import annotations

from collections.abc import Collection, Mapping

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
        max_gap: s, the longest time between two samples of an input that is bridged. An input that is logged more
            seldom than the rest holds for 2.5 of its own periods at least.
    """
    blocked, notes = _gaps("time", time, np.zeros(time.size), period, max_gap)
    for name, values in inputs.items():
        if np.isnan(values).any():
            more, said = _gaps(name, time, values, period, max_gap)
            blocked += more
            notes += said
    return _complement(blocked, time[0], time[-1] + period), notes


def would_cut(
    time: FloatArray, period: float, inputs: Mapping[str, FloatArray], needed: Collection[str], mixed: bool
) -> set[str]:
    """The inputs that have gaps, of those logged more seldom than the rest only what is longer than their own period.

    Args:
        time: (n,) s, strictly increasing.
        period: s, the usual time between samples.
        inputs: raw inputs by name, (n,) each, NaN where missing.
        needed: those that the log is cut to in any case.
        mixed: rows come from several sources, so that a row without a value is no gap.
    """
    stamps = {name: time[~np.isnan(values)] for name, values in inputs.items() if np.isnan(values).any()}
    limits = [(own[0], own[-1]) for name, own in stamps.items() if name in needed and own.size]
    first, last = max([time[0], *(low for low, _ in limits)]), min([time[-1], *(high for _, high in limits)])
    found = set()
    for name, own in stamps.items():
        usual = float(np.median(np.diff(own))) if own.size > 1 else 0.0
        bridged = 2.5 * usual
        whole = own.size > 1 and own[0] <= first + bridged and own[-1] >= last - bridged
        if (usual <= 1.5 * period and not mixed) or not whole or np.diff(own).max() > bridged:
            found.add(name)
    return found


def _gaps(
    name: str, time: FloatArray, values: FloatArray, period: float, max_gap: float
) -> tuple[list[Span], list[str]]:
    known = np.flatnonzero(~np.isnan(values))
    stamps = time[known]
    apart = np.diff(stamps)
    notes = []
    usual = float(np.median(apart)) if apart.size else period
    slow = usual > 1.5 * period
    if slow:
        notes.append(f"{name}: logged every {usual:.4g} s, held in between.")
        period, max_gap = usual, max(max_gap, 2.5 * usual)
    long = apart > max_gap
    # In a column only its own gaps are counted: those where rows stand without a value.
    own = (np.diff(known) > 1) & (apart > 1.5 * usual) if name != "time" else apart > 1.5 * period
    short = own & ~long
    if short.any():
        treated = "bridged by holding the last value"
        notes.append(f"{name}: {_count(int(short.sum()))} up to {apart[short].max():.4g} s, {treated}.")
    if (own & long).any():
        longest = f"over {max_gap:.4g} s, the longest {apart[long].max():.4g} s"
        notes.append(f"{name}: {_count(int((own & long).sum()))} {longest}; the log is split there.")
    lead, trail = stamps[0] - time[0], time[-1] - stamps[-1]
    if max(lead, trail) > (usual if slow else 0.0):
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
