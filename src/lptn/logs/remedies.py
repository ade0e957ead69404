"""Remedies for temperatures in another unit, tried on the log before they are proposed.

A robot that rested begins as warm as the air around it, or warmer, and no motor is warmer than its insulation bears. Of
kelvin, parts of a degree, and turns of a counter those stand first by which the column begins so; where several do, all
are named, and none is taken unseen.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.logs.columns import ColumnSource, as_line_or_option
from lptn.logs.issue import Issue
from lptn.logs.silence import AMBIENT

_PARTS = {"tenths": 0.1, "hundredths": 0.01, "thousandths": 0.001}
_NOT_FROZEN = 5.0  # degC, that the middle of a column in parts of a degree has: of less any number would be one
_TURNS = (256.0, 65536.0)  # of numbers of 8 and 16 bit
_COLDER, _WARMER = 5.0, 70.0  # K: a robot's first reading beside the air's; sensors differ, and robots begin warm
_OUTDOORS = (-30.0, 60.0)  # degC, where a robot begins of whose surroundings nothing is known
_USUAL = 22.0  # degC, of a room: which of two readings is named first if both are possible
_BEARABLE = (-60.0, 250.0)  # degC: all that a sensor of a motor reads; insulation of the best class bears 240


@dataclass(frozen=True)
class Reading:
    """A way to read a column.

    Attributes:
        words: what it is called.
        source: its entry.
        start: degC, of the first reading.
        fits: whether that, and all others, can be.
    """

    words: str
    source: ColumnSource
    start: float
    fits: bool


def weighed(
    issues: Collection[Issue],
    sources: Mapping[str, ColumnSource],
    numbers: Mapping[str, FloatArray],
    values: Mapping[str, FloatArray],
) -> tuple[Issue, ...]:
    """The same issues, where they propose to read a temperature in another way with what fits the log first.

    Args:
        issues: what looks wrong.
        sources: where the quantities stand.
        numbers: the file's columns, (n,) each.
        values: the quantities, (n,) each, in SI and degC.
    """
    doubted = {issue.key for issue in issues if _proposes_another_reading(issue)}
    starts = {
        key: float(x[np.isfinite(x)][0])
        for key, x in values.items()
        if key.startswith("temperature.") and key not in doubted and np.isfinite(x).any()
    }
    return tuple(
        _weighed(issue, issue.corrected, sources[issue.key], numbers, starts)
        if issue.corrected and _proposes_another_reading(issue)
        else issue
        for issue in issues
    )


def _proposes_another_reading(issue: Issue) -> bool:
    """In Fahrenheit it is by the air's that a column is doubted."""
    known = issue.corrected is not None and issue.corrected.unit != "degF" and len(issue.corrected.columns) == 1
    return known and issue.key.startswith("temperature.") and issue.kind in {"unit", "wrap"}


def _weighed(
    issue: Issue,
    first: ColumnSource,
    source: ColumnSource,
    numbers: Mapping[str, FloatArray],
    starts: Mapping[str, float],
) -> Issue:
    room = starts.get(AMBIENT, min(starts.values(), default=None))
    proposed, *others = (
        _read(issue.key, words, entry, numbers, room)
        for words, entry in _ways(issue.kind, first, source, numbers).items()
    )
    fitting = sorted((one for one in (proposed, *others) if one.fits), key=lambda one: _off(one, room))
    if not fitting or fitting == [proposed]:
        return issue
    lines = [f"{one.words} write {as_line_or_option(issue.key, one.source)}" for one in fitting]
    remedy = f"for {'; for '.join(lines)}"
    if proposed not in fitting:
        where = "its surroundings" if room is not None else "any room"
        side = "below" if proposed.start < (_USUAL if room is None else room) else "above"
        remedy += (
            f"; less likely for {proposed.words}, by which it begins at {proposed.start:.3g} degC, {side} {where}: "
        )
        remedy += as_line_or_option(issue.key, proposed.source)
    if issue.kind == "unit":
        remedy += "; if it is degC all the same, say so as its unit"
    only = fitting[0].source if len(fitting) == 1 else None
    return replace(issue, remedy=remedy, corrected=only)


def _ways(
    kind: str, proposed: ColumnSource, source: ColumnSource, numbers: Mapping[str, FloatArray]
) -> dict[str, ColumnSource]:
    """Entries by which a column could be read, each with its words; first the one that is proposed."""
    raw = numbers[source.columns[0]][np.isfinite(numbers[source.columns[0]])]
    wrapped = proposed if proposed.wrap else source
    parts = {words: replace(source, scale=source.scale * part) for words, part in _PARTS.items()}
    named = next((words for words, entry in parts.items() if entry == proposed), "kelvin")
    ways = {"a counter from 0 up" if kind == "wrap" else named: proposed}
    if wrapped.wrap:
        turn = wrapped.scale * wrapped.wrap
        ways |= {"a counter that began below 0": replace(wrapped, unit=source.unit, offset=source.offset - turn)}
    if kind == "unit" and source.unit is None:
        ways.setdefault("kelvin", replace(source, unit="K"))
        if bool((np.round(raw) == raw).all()):
            middle = float(np.median(raw)) * source.scale
            ways |= {words: parts[words] for words, part in _PARTS.items() if middle * part > _NOT_FROZEN}
            for turn in (turn for turn in _TURNS if turn / 2 <= raw.min() and raw.max() < turn):
                signed = replace(source, wrap=turn, offset=source.offset - turn * source.scale)
                ways["a number below 0 in so many bits"] = signed
    return ways


def _read(key: str, words: str, source: ColumnSource, numbers: Mapping[str, FloatArray], room: float | None) -> Reading:
    x = source.values(key, numbers)
    x = x[np.isfinite(x)]
    low, high = np.percentile(x, (1, 99))  # one reading in a hundred may be an outlier
    start = float(x[0])
    begins = _OUTDOORS[0] <= start <= _OUTDOORS[1]
    if room is not None:
        begins = -_COLDER <= (room - start if key == AMBIENT else start - room) <= _WARMER
    return Reading(words, source, start, bool(begins and _BEARABLE[0] <= low and high <= _BEARABLE[1]))


def _off(reading: Reading, room: float | None) -> float:
    return abs(reading.start - (_USUAL if room is None else room))
