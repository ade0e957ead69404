"""What is wrong, or looks wrong, in a log's time, values and units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.logs.columns import ColumnSource, either, parts_of
from lptn.logs.tables import Table

# --- Values that look like another unit, or a counter that wrapped: what they are, and the line that mends it ---


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
            return [Suspicion(key, source.columns[0], found, write_instead(key, mended), True, mended)]
    return []


def _fahrenheit(key: str, source: ColumnSource, known: FloatArray) -> list[Suspicion]:
    middle = float(np.median(known))
    found = f"surroundings at {middle:.4g} degC, which look like degF"
    return [_unit(key, source, "degF", found, False)] if 55 < middle < 120 else []


def suspect_fahrenheit(sources: Mapping[str, ColumnSource], values: Mapping[str, FloatArray]) -> list[Suspicion]:
    """Fahrenheit, by the whole log: no temperature that a room can have, or a start in degF where the room's is then.

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
        mend = f"for 14 pole pairs, say, {write_instead(key, mended)}"
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
    mend = f"{write_instead(key, mended)}; if it is {own} all the same, say so as its unit"
    return Suspicion(key, source.columns[0], found, mend, sure, mended)


def _scale(key: str, source: ColumnSource, scale: float, found: str, words: str, sure: bool) -> Suspicion:
    mended = replace(source, scale=source.scale * scale)
    return Suspicion(key, source.columns[0], found, f"for {words} {write_instead(key, mended)}", sure, mended)


def write_instead(key: str, source: ColumnSource) -> str:
    """What to write, as an imperative."""
    return f"write {either(key, source)}"


# --- Temperature sensors that are dead: fault codes among the readings, and readings that do not move ---


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
        found.append(
            Suspicion(key, source.columns[0], f"{said}: a fault code", write_instead(key, mended), False, mended)
        )
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


# --- All that looks wrong in a log's columns ------------------------------------------------------


_MOVES = 3.0  # K


def doubts_of(
    sources: Mapping[str, ColumnSource], numbers: Mapping[str, FloatArray], values: Mapping[str, FloatArray]
) -> tuple[Suspicion, ...]:
    """What looks wrong in a log's columns: another unit, a counter that wraps, a sensor that is dead.

    Args:
        sources: where the quantities stand, time among them.
        numbers: the file's columns, (n,) each, as they stand there.
        values: the quantities, (n,) each, in SI and degC.
    """
    time = values["time"]
    found = suspect_wrap("time", sources["time"], numbers[sources["time"].columns[0]])
    found = found or suspect_time(sources["time"], time)
    moved = {key: np.ptp(values[key][np.isfinite(values[key])]) for key in values if _is_read(key, values[key])}
    for key, source in sources.items():
        if key == "time":
            continue
        raw = numbers[source.columns[0]]
        odd = suspect_wrap(key, source, raw) or suspect_units(key, source, values[key])
        if not odd and key.startswith("temperature."):
            moving = any(moved[other] > _MOVES for other in moved if other != key)
            odd = suspect_readings(key, source, time, raw, values[key], moving)
        found += odd
    if not any(doubt.key.startswith("temperature.") for doubt in found):
        found += suspect_fahrenheit(sources, values)
    return tuple(found)


def _is_read(key: str, values: FloatArray) -> bool:
    return key.startswith("temperature.") and bool(np.isfinite(values).any())


# --- What can't be right in a log's time and values, refused with the line it stands on -----------


_FEWEST_ROWS = 10
_DAY = 86400.0  # s
_LATEST = 1e20  # s, or in whatever unit was meant
_LARGEST = 1e12  # of any quantity in SI, so that its square is still a number


def check_time(table: Table, name: str, time: FloatArray) -> tuple[npt.NDArray[np.intp], tuple[str, ...]]:
    """The rows to keep, (m,), and notes: of rows with the same time stamp the first is kept.

    Args:
        table: the log, for the line numbers.
        name: the time column's name in the file.
        time: (n,) s.

    Raises:
        InputError: time is missing somewhere, runs backwards, or is too short or too coarse to be in s.
    """
    _enough(table, time.size)
    usable = np.abs(time) < _LATEST
    if not usable.all():
        row = int(np.argmin(usable))
        table.refuse(row, name, f"{'no time' if np.isnan(time[row]) else time[row]}", "a time in every row")
    steps = np.diff(time)
    if (steps < 0).any():
        row = int((steps < 0).argmax()) + 1
        found = f"{time[row]:.12g} s after {time[row - 1]:.12g} s"
        table.refuse(row, name, found, f"time that runs forwards{_restart(time, row)}")
    keep = np.flatnonzero(np.concatenate(([True], steps > 0)))
    _enough(table, keep.size)
    period = float(np.median(np.diff(time[keep])))
    if period > _DAY:
        expected = f'seconds; for another unit write time = {{ column = "{name}", unit = "ns" }} in [columns]'
        raise InputError(table.path, f"column '{name}'", f"{period:.3g} s from row to row", expected)
    dropped = time.size - keep.size
    note = f"time: {dropped} of {time.size} rows repeat a time stamp; the first of each is kept."
    return keep, (note,) if dropped else ()


def check_values(table: Table, key: str, source: ColumnSource, values: FloatArray) -> None:
    """Refuse infinite values, those that nothing can have, and temperatures below absolute zero.

    Args:
        table: the log, for the line numbers.
        key: `<quantity>.<place>`.
        source: where the values come from.
        values: (n,) in SI or degC, NaN where missing.

    Raises:
        InputError: as said.
    """
    name = source.columns[0]
    infinite = np.isinf(values)
    if infinite.any():
        table.refuse(int(infinite.argmax()), name, "an infinite value", "a number or an empty cell")
    huge = np.abs(values) > _LARGEST
    if huge.any():
        row = int(huge.argmax())
        table.refuse(row, name, f"{values[row]:.3g}", f"a number within ±{_LARGEST:.0e}, in SI")
    if not key.startswith("temperature.") or np.isnan(values).all():
        return
    impossible = values < -273.15
    if impossible.any():
        row = int(impossible.argmax())
        mend = "; a code for no reading is written as invalid = [NUMBER] in [columns]"
        table.refuse(row, name, f"{values[row]:.6g} degC", f"a temperature above -273.15 degC{mend}")


def _enough(table: Table, rows: int) -> None:
    if rows < _FEWEST_ROWS:
        raise InputError(table.path, "log", f"{rows} rows", f"at least {_FEWEST_ROWS} at different times")


def _restart(time: FloatArray, row: int) -> str:
    """What else it may be where a clock starts again from about 0."""
    if abs(time[row]) > 0.1 * abs(time[row - 1]):
        return ""
    return "; a counter that overflows is written as wrap = 65536, or whatever it counts to, in its entry of [columns]"
