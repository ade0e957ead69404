"""Temperature sensors that are dead: fault codes among the readings, and readings that do not move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lptn.arrays import FloatArray
from lptn.logs.columns import ColumnSource
from lptn.logs.suspicions import AMBIENT, Suspicion, write_line

_CODES = (0.0, -127.0, 85.0, -999.0, 999.0, 255.0, 65535.0, 32767.0, -32768.0)
_APART = 30.0  # K, from the readings on both sides: no sensor on a motor moves so far from row to row
_LEAST = 10.0  # K, the same for a number that sensors are known to give when they fail
_STUCK = 600.0  # s


def suspect_readings(
    key: str, source: ColumnSource, time: FloatArray, raw: FloatArray, values: FloatArray, moving: bool
) -> list[Suspicion]:
    """Fault codes among the readings of a temperature sensor, and one that does not move.

    Args:
        key: `temperature.<place>`.
        source: where the readings come from.
        time: (n,) s.
        raw: (n,) as in the file.
        values: (n,) degC.
        moving: whether another temperature of the log moves.
    """
    found = []
    known = np.flatnonzero(np.isfinite(values))
    codes = _codes(values[known])
    if codes and len(source.columns) == 1:
        marked = [float(np.median(raw[known][values[known] == code])) for code in codes]
        count = int(np.isin(values[known], codes).sum())
        listed = " and ".join(f"{code:.6g}" for code in codes)
        said = f"{count} reading{'s' * (count > 1)} of exactly {listed} degC, far from those around"
        mended = replace(source, invalid=(*source.invalid, *marked))
        found.append(Suspicion(key, source.columns[0], f"{said}: a fault code", write_line(key, mended), False, mended))
    rest = known[~np.isin(values[known], codes)]
    return found + _stuck(key, source, time[rest], values[rest], moving)


def _codes(readings: FloatArray) -> list[float]:
    """Values that stand exactly alike, and each time far from the readings on both sides."""
    if readings.size < 3:
        return []
    starts = np.flatnonzero(np.concatenate(([True], np.diff(readings) != 0)))
    levels = readings[starts]
    before = np.abs(np.diff(levels, prepend=np.nan))
    after = np.abs(np.diff(levels, append=np.nan))
    far = np.fmin(before, after)
    codes = []
    for level in np.unique(levels[far > _LEAST]):
        distances = far[levels == level]
        limit = _LEAST if level in _CODES else _APART
        if (distances > limit).all() and (level in _CODES or abs(level) > 150 or distances.size > 1):
            codes.append(float(level))
    # A minority: of a sensor that reads nothing else, nothing tells which is the code.
    return codes if np.isin(readings, codes).mean() < 0.5 and len(codes) <= 4 else []


def _stuck(key: str, source: ColumnSource, time: FloatArray, values: FloatArray, moving: bool) -> list[Suspicion]:
    """One value for ten minutes, of a sensor that otherwise moves by less than a tenth of a kelvin at a time."""
    if time.size < 3:
        return []
    changes = np.flatnonzero(np.diff(values) != 0)
    if changes.size == 0:
        long = float(time[-1] - time[0])
        odd = long >= _STUCK and moving and key != AMBIENT  # people write one number for the room
        found = f"reads {values[0]:.6g} degC throughout, {long:.4g} s" if odd else ""
    else:
        ends = np.concatenate(([0], changes + 1, [time.size - 1]))
        spans = np.diff(time[ends])
        longest = int(spans.argmax())
        usual = float(np.median(np.abs(np.diff(values)[changes])))
        odd = spans[longest] >= _STUCK and usual < 0.1 and spans[longest] > 20 * np.median(spans)
        found = (
            f"reads {values[ends[longest]]:.6g} degC for {spans[longest]:.4g} s from {time[ends[longest]]:.6g} s on"
            if odd
            else ""
        )
    mend = "if the sensor was stuck, write invalid = [that number] in its entry of [columns]"
    return [Suspicion(key, source.columns[0], found, mend, False)] if found else []
