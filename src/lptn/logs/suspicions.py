"""Values that look like another unit, or a counter that wrapped: what they are, and the line that mends it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from lptn.arrays import FloatArray
from lptn.logs.columns import ColumnSource
from lptn.logs.names import parts_of
from lptn.logs.writing import either

_HOTTEST = 1000.0  # degC, of the middle value: no motor or board survives that
_WORDS = {  # endings that mean nothing else; "c" or "s" at a name's end may
    "time": {"ms", "us", "ns", "min"},
    "temperature": {"degF", "K"},
    "torque": {"mN*m"},
    "current": {"mA"},
    "velocity": {"rpm", "deg/s", "turn/s"},
    "power": {"mW", "kW"},
}
_HALF_A_DAY = 43200.0  # s
AMBIENT = "temperature.ambient"


@dataclass(frozen=True)
class Suspicion:
    """Something about a column that can't be right, or hardly.

    Args:
        key: the quantity, `temperature.FR_calf`.
        column: its name in the file.
        found: what is odd.
        mend: what to write, or to do.
        sure: it can't be right as it is read.
        mended: the entry of [columns] that the mend proposes, if it proposes one.
    """

    key: str
    column: str
    found: str
    mend: str
    sure: bool
    mended: ColumnSource | None = None

    @property
    def sentence(self) -> str:
        """As a note of a run."""
        return f"{self.key}: {self.found}; {self.mend}."


def suspect_units(key: str, source: ColumnSource, values: FloatArray) -> list[Suspicion]:
    """Another unit than SI, by the column's name or its values; nothing where the mapping names a unit.

    Args:
        key: `<quantity>.<place>`, or `time`.
        source: where the values come from.
        values: (n,) as read, in SI or degC if `source` says nothing else; NaN where missing.
    """
    known = values[np.isfinite(values)]
    if source.unit is not None or len(source.columns) > 1 or known.size == 0:
        return []
    quantity = key.partition(".")[0]
    column = source.columns[0]
    named = parts_of(column).unit(quantity)
    if named in _WORDS.get(quantity, ()) and source.scale == 1 and not (named == "K" and np.median(known) < 150):
        found = f"no unit is given for '{column}', whose name says {named}"
        return [_unit(key, source, named, found, True)]
    if key == AMBIENT:
        return suspect_temperature(key, source, known) or _fahrenheit(key, source, known)
    rule = {"temperature": suspect_temperature, "current": _current, "velocity": _velocity}.get(quantity)
    return rule(key, source, known) if rule else []


def suspect_temperature(key: str, source: ColumnSource, known: FloatArray) -> list[Suspicion]:
    """Kelvin, or tenths, hundredths or thousandths of a degree."""
    low, middle, high = (float(value) for value in (known.min(), np.median(known), known.max()))
    if middle > _HOTTEST:
        scale = 0.001 if middle > 10 * _HOTTEST else 0.01
        words = "thousandths" if scale == 0.001 else "hundredths"
        return [_scale(key, source, scale, f"values around {middle:.4g}", words, True)]
    if middle > 200 and low >= 200 and high <= 500:
        return [_unit(key, source, "K", f"values {low:.4g} … {high:.4g}, which look like kelvin", True)]
    if 240 < middle < 450 and float((known > 240).mean()) > 0.9:
        return [_unit(key, source, "K", f"most values around {middle:.4g}, which look like kelvin", False)]
    if middle > 200:
        return [_scale(key, source, 0.1, f"values around {middle:.4g}", "tenths", False)]
    return []


def suspect_time(source: ColumnSource, time: FloatArray) -> list[Suspicion]:
    """Time in another unit than s; `time` is (n,) s."""
    if source.unit is not None or source.scale != 1.0 or time.size < 2 or not np.isfinite(time).all():
        return []
    first, period = float(abs(time[0])), float(np.median(np.abs(np.diff(time))))
    span = float(abs(time[-1] - time[0]))
    since_1970 = [
        unit for unit, low, high in (("ms", 3e11, 1e13), ("us", 3e14, 1e16), ("ns", 3e17, 1e19)) if low < first < high
    ]
    if since_1970:
        found = f"times around {first:.4g}, which look like {since_1970[0]} since 1970"
        return [_unit("time", source, since_1970[0], found, True)]
    named = parts_of(source.columns[0]).unit("time")
    if named in _WORDS["time"]:
        found = f"no unit is given for '{source.columns[0]}', whose name says {named}"
        return [_unit("time", source, named, found, True)]
    whole = bool((np.round(time) == time).all())
    if whole and period >= 20 and span > _HALF_A_DAY:
        unit = next((name for name, factor in (("ms", 1e3), ("us", 1e6)) if period / factor <= 10), "ns")
        found = f"{period:.4g} s from row to row over {span / 3600:.3g} h, which looks like {unit}"
        return [_unit("time", source, unit, found, False)]
    return []


def suspect_wrap(key: str, source: ColumnSource, raw: FloatArray) -> list[Suspicion]:
    """A counter of 16 or 32 bit that jumps from one end of its range to the other; `raw` is (n,) as in the file."""
    known = raw[np.isfinite(raw)]
    if source.wrap or len(source.columns) > 1 or known.size < 2 or not (np.round(known) == known).all():
        return []
    jumps = np.abs(np.diff(known))
    jumped = -np.diff(known) if key == "time" else jumps  # time that leaps ahead is a gap
    for bits in (16, 32):
        turn = float(2**bits)
        inside = (known.min() >= 0 and known.max() < turn) or (known.min() >= -turn / 2 and known.max() < turn / 2)
        wrapped = int((jumped > 0.75 * turn).sum())
        # A signal about 0 jumps at every change of sign: short are its steps the other way round.
        if inside and wrapped and np.median(np.minimum(jumps, turn - jumps)) < 0.1 * turn:
            found = f"{wrapped} jumps of some {turn:.0f}: a counter of {bits} bit that wraps"
            mended = replace(source, wrap=turn)
            return [Suspicion(key, source.columns[0], found, write_line(key, mended), True, mended)]
    return []


def _fahrenheit(key: str, source: ColumnSource, known: FloatArray) -> list[Suspicion]:
    middle = float(np.median(known))
    found = f"surroundings at {middle:.4g} degC, which look like degF"
    return [_unit(key, source, "degF", found, False)] if 55 < middle < 120 else []


def suspect_all(sources: Mapping[str, ColumnSource], values: Mapping[str, FloatArray]) -> list[Suspicion]:
    """Fahrenheit, by the temperatures of the whole log: none that a room can have, or a start where the room's is then.

    Args:
        sources: where the quantities stand.
        values: (n,) each, as read.
    """
    keys = [key for key in sources if key.startswith("temperature.") and np.isfinite(values[key]).any()]
    if not keys or any(sources[key].unit for key in keys):
        return []
    coldest = min(float(np.nanmin(values[key])) for key in keys)
    if 48 < coldest < 120:
        found = f"no temperature of the whole log is below {coldest:.4g} degC, which looks like degF"
        return [_unit(keys[0], sources[keys[0]], "degF", found, False)]
    doubts = []
    room = _first(values[AMBIENT]) if AMBIENT in keys else np.nan
    for key in keys:
        first = _first(values[key])
        if key != AMBIENT and first > room + 30 and abs(first - (1.8 * room + 32)) < 6:
            found = f"begins at {first:.4g} degC where the surroundings have {room:.4g} degC, which looks like degF"
            doubts.append(_unit(key, sources[key], "degF", found, False))
    return doubts


def _first(values: FloatArray) -> float:
    return float(values[np.isfinite(values)][0])


def _current(key: str, source: ColumnSource, known: FloatArray) -> list[Suspicion]:
    high = float(np.percentile(np.abs(known), 99))
    sure = high > 1000
    if sure or (high > 250 and (np.round(known) == known).all()):
        return [_unit(key, source, "mA", f"values up to {high:.4g}, which look like mA", sure)]
    return []


def _velocity(key: str, source: ColumnSource, known: FloatArray) -> list[Suspicion]:
    if parts_of(source.columns[0]).electrical:
        mended = replace(source, unit="rpm", scale=1 / 14)
        mend = f"for 14 pole pairs, say, {write_line(key, mended)}"
        return [Suspicion(key, source.columns[0], "electrical turns, by the column's name", mend, True)]
    high = float(np.percentile(np.abs(known), 99))
    sure = high > 2000
    if sure or (high > 300 and (np.round(known) == known).all()):
        return [_unit(key, source, "rpm", f"values up to {high:.4g}, which look like rpm", sure)]
    return []


def _unit(key: str, source: ColumnSource, unit: str, found: str, sure: bool) -> Suspicion:
    si = {"time": "s", "temperature": "degC", "torque": "N*m", "current": "A", "velocity": "rad/s", "power": "W"}
    own = si.get(key.partition(".")[0], "")
    mended = replace(source, unit=unit)
    mend = f"{write_line(key, mended)}; if it is {own} all the same, say so as its unit"
    return Suspicion(key, source.columns[0], found, mend, sure, mended)


def _scale(key: str, source: ColumnSource, scale: float, found: str, words: str, sure: bool) -> Suspicion:
    mended = replace(source, scale=source.scale * scale)
    return Suspicion(key, source.columns[0], found, f"for {words} {write_line(key, mended)}", sure, mended)


def write_line(key: str, source: ColumnSource) -> str:
    """What to write, as an imperative."""
    return f"write {either(key, source)}"
