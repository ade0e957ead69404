"""In which other unit a column is that leaves what its quantity can be.

A column is doubted where a row of units or its name says another unit, or where its values leave what `plausible.py`
says of its quantity. It is then read in each way in which such numbers are written, and those are proposed by which it
is what it can be and begins as a robot does: as warm as the air, or warmer. The nearest stands first; where several fit
all are named, and none is taken unseen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.logs.channels import FEWEST, Channels, quantisation_step
from lptn.logs.clock import COARSEST_CLOCK, DAY, LATEST
from lptn.logs.columns import (
    UNITS,
    ColumnName,
    ColumnSource,
    as_line_or_option,
    column_unit,
    place_of,
    quantity_of,
    words_of,
)
from lptn.logs.issue import Issue
from lptn.logs.law import rest_evidence
from lptn.logs.plausible import (
    ALIKE,
    COLDER,
    COLDEST,
    FAR,
    HOTTEST,
    KELVIN,
    OUTDOORS,
    OVER,
    PLAUSIBLE,
    USUAL,
    WARMER,
)

_EXAMPLE_POLE_PAIRS = 14  # in the line that is proposed: a common number for robots' outrunners


def suspect_unit(log: Channels, key: str) -> list[Issue]:
    """Another unit than the entry's, or SI, by a row of units, the column's name or its values."""
    source, quantity = log.sources[key], quantity_of(key)
    readings = log.values[key][np.isfinite(log.values[key])]
    if not readings.size or source.rate or (len(source.columns) > 1 and source.how != "mean"):
        return []
    if source.unit is None and (named := _suspect_name(log, key)):
        return named
    if key == "time":
        return _suspect_time(log) if source.unit is None else []
    if not log.is_believed(key):
        if quantity == "temperature":
            return _suspect_temperature(log, key, readings)
        if quantity in ("torque", "current", "velocity"):
            return _suspect_counts(log, key, readings) or _suspect_size(log, key, readings)
    return []


_SINCE_1970 = (("ms", 3e11, 1e13), ("us", 3e14, 1e16), ("ns", 3e17, 1e19))  # first times from 1979 to 2286
_LONG_PERIOD = 20.0  # s: a log of whole numbers this far apart, over half a day, is rather one in a smaller unit
_SHORTEST_LOG, _NEAREST, _DAYS = 10.0, 5e-4, 20_000
"""s, of a whole log and between rows: as short and close none of temperatures is; rows a second apart are in hours, or
days; a spreadsheet's days, from 1954 on."""


def _suspect_time(log: Channels) -> list[Issue]:
    """Milliseconds and less of a time that is read as s, by a time since 1970, or rows that are far apart."""
    time = log.time
    if log.sources["time"].scale != 1.0 or time.size < 2 or not (np.abs(time) < LATEST).all():
        return []
    steps = np.abs(np.diff(time))
    steps = steps[steps > 0]  # stamps that several rows share
    if not steps.size:
        return []
    first, period, span = float(abs(time[0])), float(np.median(steps)), float(abs(time[-1] - time[0]))
    for unit, low, high in _SINCE_1970:
        if low < first < high:
            return [log.in_unit("time", unit, f"times around {first:.4g}, which look like {unit} since 1970")]
    if span < _SHORTEST_LOG and period < _NEAREST and log.sources["time"].unit is None:
        unit, like = ("d", "d") if first > _DAYS else ("h", "h, or d")
        problem = f"{time.size} rows within {span:.3g} s, {period:.2g} s apart, which look like {like}"
        return [log.in_unit("time", unit, problem)]
    of_minutes = period % 60 == 0  # buildings are logged so; nobody logs every 60 ms
    certain = period > DAY  # nothing thermal is logged once a day
    if certain or (period >= _LONG_PERIOD and not of_minutes and span > DAY / 2 and _are_whole(time)):
        unit = next((name for name, n in {"ms": 1e3, "us": 1e6}.items() if period / n <= COARSEST_CLOCK), "ns")
        problem = f"{period:.4g} s from row to row over {span / 3600:.3g} h, which looks like {unit}"
        return [log.in_unit("time", unit, problem, certain=certain)]
    return []


def _suspect_name(log: Channels, key: str) -> list[Issue]:
    """Another unit than SI, by a row of units or, beyond doubt, the column's name."""
    source, quantity, name = log.sources[key], quantity_of(key), log.sources[key].columns[0]
    for column, cell in ((column, log.units[column]) for column in source.columns if log.units.get(column)):
        stated = ColumnName.of("", cell).unit(quantity)
        if not stated and words_of(cell) and quantity in UNITS:
            remedy = f"a unit of {quantity}; if it is one all the same, write {{}}"
            meant = replace(source, columns=(column,), unit=column_unit(key))
            return [log.issue(key, f"a unit in the file that says {cell}", remedy, certain=True, corrected=meant)]
        if stated and stated != column_unit(key) and source.scale == 1:
            return [log.in_unit(key, stated, f"a unit of {stated} in the file")]
    unit = ColumnName.of(name).unit(quantity)
    named = source.scale == 1 and unit not in ("", column_unit(key))
    if named and quantity == "temperature":  # a column T_K that was converted to degC keeps its name
        named = _can_be(_middle(replace(source, unit=unit).values(key, log.numbers)))
    if named:
        return [log.in_unit(key, unit, f"no unit is given for '{name}', whose name says {unit}")]
    if quantity == "velocity" and "erpm" in words_of(name):
        meant = replace(source, unit="rpm", scale=1 / _EXAMPLE_POLE_PAIRS)
        remedy = f"for {_EXAMPLE_POLE_PAIRS} pole pairs, say, write {as_line_or_option(key, meant)}"
        # No log says how many there are, so that nobody is to take this line unseen.
        return [log.issue(key, "electrical turns, by the column's name", remedy, certain=True)]
    return []


def _suspect_size(log: Channels, key: str, readings: FloatArray) -> list[Issue]:
    """Values larger than any joint's; fewer than one reading in a hundred are outliers, and no other unit."""
    source, can, size = log.sources[key], PLAUSIBLE[quantity_of(key)], np.abs(readings)
    high, beyond = float(np.percentile(size, 99)), int(np.count_nonzero(size > can.most))
    if beyond and high <= can.most:
        problem = f"{beyond} value{'s' * (beyond > 1)} up to {size.max():.4g} {column_unit(key)}, "
        problem += "more than any joint bears"
        if source.scale == 1 and source.unit is None and len(source.columns) == 1:
            meant = replace(source, valid=(-can.most, can.most))
            return [log.issue(key, problem, "to leave them out, write {}", "size", certain=True, corrected=meant)]
        remedy = "write another unit, or in its entry of [columns] a range, valid = [LEAST, MOST], without these"
        return [log.issue(key, problem, remedy, "size", certain=True)]
    if not beyond and (high <= can.most_whole or source.unit is not None or not _are_whole(readings)):
        return []
    problem = f"values up to {high:.4g}, which look like {can.unit}"
    if source.unit is None:
        return [log.in_unit(key, can.unit, problem, certain=beyond > 0)]
    remedy = f"write another unit; if it is right, write {log.believed(key)}"
    return [log.issue(key, problem, remedy, "size", certain=True)]


_CONVERTERS = (10, 12, 14, 16)  # bits that converters have
_LEAST_COUNTS = 0.25  # of a converter's range, that whole numbers reach
_MOST_AWAY, _AT_REST = 0.125, 0.01  # of it, from the middle: usually, and now and then


def _bits_of(readings: FloatArray) -> int:
    """How many bits a converter has whose counts, from 0 up, these may be; 0 where they can't."""
    high = float(readings.max())
    if readings.min() < 0 or not _are_whole(readings):
        return 0
    return next((bits for bits in _CONVERTERS if _LEAST_COUNTS * 2**bits < high < 2**bits), 0)


def _suspect_counts(log: Channels, key: str, readings: FloatArray) -> list[Issue]:
    """Whole numbers about the middle of a converter's range, which stand for none; or of torques large ones about 0."""
    can, bits, high = PLAUSIBLE[quantity_of(key)], _bits_of(readings), float(np.percentile(np.abs(readings), 99))
    source = log.sources[key]
    zero, full = 2.0 ** (bits - 1), can.full_scale
    away = np.abs(readings - zero) / (2 * zero)
    if source.unit is not None or not full:
        return []
    certain = bool(bits and readings.min() > 0 and np.median(away) < _MOST_AWAY and away.min() < _AT_REST)
    if certain:
        what, meant = "one", replace(source, scale=full / zero, offset=-full)
        problem = f"whole numbers from {readings.min():.6g} to {readings.max():.6g}, as a converter of {bits} bit gives"
    elif key.startswith("torque.") and can.most_whole < high <= can.most and _are_whole(readings):
        what, meant = "12 bit", replace(source, scale=full / 2**11)
        problem = f"whole numbers up to {high:.4g}, which look like the counts of a converter"
    else:
        return []
    # No number tells its full scale, so that nobody is to take this line unseen.
    remedy = f"for {what} with ±{full:g} {column_unit(key)} at full scale, say, write {as_line_or_option(key, meant)}"
    return [log.issue(key, problem, remedy, "counts", certain=certain)]


# --- Temperatures, read in all ways in which they are written ---------------------------------------

_PARTS = {"tenths": 0.1, "hundredths": 0.01, "thousandths": 0.001}
_UNITS = {"kelvin": "K", "degC": "degC", "degF": "degF"}
_NOT_FROZEN = 5.0  # degC, that the middle of a column in parts of a degree has: of less any number would be one
_TURNS = (256.0, 65536.0)  # of numbers of 8 and 16 bit


def _suspect_temperature(log: Channels, key: str, readings: FloatArray) -> list[Issue]:
    """A temperature that as it is read can be no robot's, and the other entries by which it could be read.

    Nor does a part begin where no robot does, and in another unit than the one that is stated as warm as the air.
    """
    source, middle, can = log.sources[key], _middle(readings), PLAUSIBLE["temperature"]
    raw, air = log.numbers[source.columns[0]], log.sensors[log.air].first if log.air in log.sensors else np.nan
    above = float(readings[0]) - air
    elsewhere = OUTDOORS[0] < air < OUTDOORS[1] and not -2 * COLDER <= above <= WARMER
    inside = middle < can.most and (middle > COLDEST or source.unit is None)  # who fails at -127 is no other unit's
    if inside and (source.unit is None or not elsewhere):
        return []
    raw = raw[np.isfinite(raw)]
    counted, whole = _middle(raw) * source.scale, _are_whole(raw)
    turns = [source.wrap] if source.wrap else [turn for turn in _TURNS if turn / 2 <= raw.min() <= raw.max() < turn]
    units = _UNITS if source.unit else {"kelvin": "K"}
    ways = {words: replace(source, unit=unit) for words, unit in units.items() if unit != source.unit}
    if whole or counted > HOTTEST + KELVIN:
        parts = {words: _in_parts(source, part) for words, part in _PARTS.items() if counted * part > _NOT_FROZEN}
        ways |= {f"{words} of a degree": replace(way, unit=None) for words, way in parts.items()}
        ways |= {f"{words} of a kelvin": replace(way, unit="K") for words, way in parts.items()}
    if inside and not any(abs(_begins(log, key, way) - air) < ALIKE for way in ways.values()):
        return []
    below = {"a number that began below 0": _below_zero(source, turns[0])} if whole and turns and not inside else {}
    problem, stays = f"values around {middle:.4g}", "if it is degC all the same, say so as its unit"
    if source.unit is not None:
        problem += f" degC, in the unit that is stated, {source.unit}: "
        problem += f"begins {above:+.3g} K from its surroundings" if inside else "no part of a robot has that"
        stays = f"if it is right, write {log.believed(key)}"
    low, high = np.percentile(readings, [10, 90])
    # What begins, or cools, where robots are may be an oven whose unit somebody stated.
    certain = bool(low > can.most or high < COLDEST or (source.unit is None and middle > HOTTEST))
    if middle > HOTTEST + KELVIN and (bits := _bits_of(readings)):
        counts = replace(source, scale=float(f"{can.full_scale / (2**bits - 1):.6g}"))
        of_counts = f"for counts of a converter, with {can.full_scale:g} degC at full scale, say, write "
        stays = f"{of_counts}{as_line_or_option(key, counts)}; {stays}"
    return [_proposed(log, key, problem, ways | below, _in_parts_of_a_degree(below), certain=certain, stays=stays)]


def _in_parts(source: ColumnSource, part: float) -> ColumnSource:
    """The same numbers in parts of their unit."""
    return replace(source, scale=source.scale * part, offset=source.offset * part)


def _in_parts_of_a_degree(ways: Mapping[str, ColumnSource]) -> dict[str, ColumnSource]:
    """The ways in which a counter's numbers may be such parts: decimal ones, or those of digital thermometers."""
    parts = _PARTS | {"sixteenths": 1 / 16}
    return {f"{words} in {one} of a degree": _in_parts(way, parts[one]) for words, way in ways.items() for one in parts}


def _below_zero(source: ColumnSource, turn: float) -> ColumnSource:
    """A counter of a temperature that begins below 0, and is written from 0 up."""
    return replace(source, wrap=turn, offset=source.offset - turn * source.scale)


def _room(log: Channels, key: str) -> float | None:
    """Where a robot begins [degC] by the other sensors that read what one has: the air's, else the coldest of them."""
    told = {k: x.first for k, x in log.sensors.items() if k != key and _can_be(x.first) and _can_be(x.middle)}
    return told.get(log.air, min(told.values(), default=None))


def _begins(log: Channels, key: str, way: ColumnSource) -> float:
    """The first reading of a temperature by another entry [degC]; NaN where no part of a robot has its middle one."""
    readings = way.values(key, log.numbers)
    readings = readings[np.isfinite(readings)]
    return float(readings[0]) if readings.size and _can_be(_middle(readings)) else np.nan


def _proposed(
    log: Channels,
    key: str,
    problem: str,
    *groups: Mapping[str, ColumnSource],
    certain: bool,
    stays: str = "",
    kind: str = "unit",
) -> Issue:
    """The issue that a temperature is rather read in other ways, those first by which it can be a robot's.

    Of `groups` of entries, named by their words, the first counts by one of which the log begins where robots do;
    `stays` says what to do where the channel is right.
    """
    room, source = _room(log, key), log.sources[key]
    usual = USUAL if room is None else room
    near: list[tuple[bool, float, str, ColumnSource, float]] = []  # unlikely, by how much, words, entry, start
    for group in groups:
        if near and not near[0][0]:
            break
        for words, way in group.items():
            if np.isfinite(start := _begins(log, key, way)):
                above = usual - start if key == log.air else start - usual
                fits = OUTDOORS[0] <= start <= OUTDOORS[1] if room is None else -COLDER <= above <= WARMER
                near.append((not fits, abs(start - usual), words, way, start))
        near.sort(key=lambda one: one[:2])
    fitting = [one for one in near if not one[0]] or near[:1]
    if kind == "unit" and fitting and source.unit is None:
        problem += f", which look like {' or '.join(words for _, _, words, *_ in fitting)}"
    lines = [f"for {words} write {as_line_or_option(key, way)}" for _, _, words, way, _ in fitting]
    for _, _, words, way, start in near[len(fitting) :]:
        where = f"{'below' if start < usual else 'above'} {'any room' if room is None else 'its surroundings'}"
        less_likely = f"less likely for {words}, by which it begins at {start:.3g} degC, {where}: "
        lines.append(less_likely + as_line_or_option(key, way))
    remedy = "; ".join([*lines, *[stays] * bool(stays)]) if lines else f"write its unit; {stays}"
    return Issue(key, source.columns[0], problem, remedy, certain, fitting[0][3] if len(fitting) == 1 else None, kind)


def _can_be(reading: float) -> bool:
    return COLDEST < reading < PLAUSIBLE["temperature"].most


def _middle(values: FloatArray) -> float:
    return float(np.median(values[np.isfinite(values)]))


def _are_whole(readings: FloatArray) -> bool:
    return bool((np.round(readings) == readings).all())


# --- Counters that jump from one end of their range to the other ------------------------------------

_JUMP, _SHORT = 0.75, 0.1  # of the range: a jump from end to end; the usual step, taken the shorter way round
_USUALLY, _ONE_MORE = 0.95, 3.0  # share of a counter's steps; counts more than these that a step over the end has


def suspect_wrap(log: Channels, key: str) -> list[Issue]:
    """A counter of 8, 16 or 32 bit that wraps."""
    source, temperature = log.sources[key], key.startswith("temperature.")
    if source.wrap or len(source.columns) != 1:
        return []
    raw = log.numbers[source.columns[0]]
    raw = raw[np.isfinite(raw)]
    # The decimal place to which all numbers are written, a thousandth at the least.
    places = (place for place in (0.1, 0.01, 0.001) if np.abs(np.round(raw / place) * place - raw).max() < 1e-9)
    unit = 1.0 if _are_whole(raw) else quantisation_step(raw) if temperature else next(places, 0.0)
    if raw.size < 2 or unit == 0:
        return []
    counts = np.round(raw / unit) if unit < 1 and not temperature else raw / unit
    steps = np.abs(np.diff(counts))
    jumps = -np.diff(counts) if key == "time" else steps  # time that leaps ahead is a gap
    low, high = counts.min(), counts.max()
    for bits in (8, 16, 32) if temperature else (16, 32):  # torques of a byte may change so much
        turn = float(2**bits)
        unsigned = low >= 0 and high < turn
        in_range = unsigned or (low >= -turn / 2 and high < turn / 2)
        if unit < 1 and not temperature:  # loads swing so far that only what never is in the middle tells a counter
            in_range = unsigned and not (np.abs(counts - turn / 2) < turn / 4).any()
        wraps = int((jumps > _JUMP * turn).sum())
        # A signal about 0 jumps at every change of sign: short are its steps the other way round.
        other_way, over = np.minimum(steps, turn - steps), jumps > _JUMP * turn
        if not (in_range and wraps and np.median(other_way) < _SHORT * turn):
            continue
        usual = np.quantile(other_way[~over], _USUALLY) if not over.all() else turn
        ends = (np.unique(counts[side]).size for side in (counts > (low + high) / 2, counts <= (low + high) / 2))
        if np.median(other_way[over]) > usual + _ONE_MORE and min(ends) < FEWEST:
            continue  # it leaps to a code for no reading, or to a few spikes, and not over the end of the range
        turn *= unit
        problem = f"{wraps} jumps of some {turn:.6g}: a counter of {bits} bit that wraps"
        meant = replace(source, wrap=turn)
        if not temperature:
            return [log.issue(key, problem, "write {}", "wrap", certain=True, corrected=meant)]
        ways = {"a counter from 0 up": meant, "a counter that began below 0": _below_zero(source, turn)}
        return [_proposed(log, key, problem, ways, _in_parts_of_a_degree(ways), certain=True, kind="wrap")]
    return []


# --- Temperatures beside each other, and beside the heat that is put in -----------------------------

_FAHRENHEIT = (48.0, 120.0)  # degF, 9 … 49 degC: surroundings, and the coldest reading of a log in a room
_WARM_ROOM = 55.0  # degC: surroundings that are doubted
_OFFSETS = (30.0, 40.0, 50.0)  # K, that drives add to a temperature so that a byte holds it below zero, too
_SURE = float(np.log(100))
"""Of `rest_evidence`: if errors were independent, at most one healthy log in a hundred would have more; of 218 virtual
ones none has."""


def suspect_starts(log: Channels) -> list[Issue]:
    """Fahrenheit and bytes with an offset, by how warm a log begins and where its parts would settle without a load."""
    sources, sensors = log.sources, log.sensors
    free = {key: x for key, x in sensors.items() if sources[key].unit is None and not log.is_believed(key)}
    starts = {key: sensor.first for key, sensor in sensors.items()}
    in_kelvin = any(sources[key].unit not in (None, "degF") for key in sensors)
    warm_air = sensors[log.air].middle if log.air in free else -np.inf
    coldest, begun = min((x.least for x in free.values()), default=np.nan), [x.first for x in free.values()]
    # Sensors that begin apart are those of a robot that was warm.
    if not in_kelvin and _FAHRENHEIT[0] < coldest < _FAHRENHEIT[1] and np.ptp(begun) < 2 * ALIKE:
        problem = f"no temperature of the whole log is below {coldest:.4g} degC, which looks like degF"
        certain = len(sensors) > 1 and coldest > max(OUTDOORS[1], min(begun) - ALIKE)
        if certain:
            problem = "begins at {:.4g} degC, as all sensors do, and none of them ever cools: which looks like degF"
        certain |= warm_air > OUTDOORS[1]
        return [log.in_unit(key, "degF", problem.format(starts[key]), certain=certain) for key in free]
    if log.air not in starts:
        return []
    room = starts.pop(log.air)
    robot = float(np.median(list(starts.values()))) if starts else np.nan
    around = room - robot > OVER and abs((room - 32) / 1.8 - robot) < ALIKE and not in_kelvin
    if log.air in free and _FAHRENHEIT[0] < room < _FAHRENHEIT[1] and (around or warm_air > _WARM_ROOM):
        problem = f"surroundings of {room:.4g} degC around a robot that begins at {robot:.4g} degC, "
        problem += "which look like degF"
        return [log.in_unit(log.air, "degF", problem, certain=around or warm_air > OUTDOORS[1])]
    # Sensors that begin warmer than the air and hardly cool: their parts were warm, or at rest as the air.
    above, evidence, issues = {key: start - room for key, start in starts.items()}, dict[object, float](), list[Issue]()
    warm = {k: x for k, x in above.items() if x > FAR and sensors[k].least > sensors[k].first - FAR}
    doubted = [
        k for k in warm if sources[k].unit in (None, "degC") and not sources[k].offset and not log.is_believed(k)
    ]
    for key in doubted:
        group = tuple(other for other in warm if abs(warm[other] - warm[key]) <= ALIKE)
        if group not in evidence:
            alike = {other: warm[other] for other in group}
            evidence[group] = rest_evidence(log, alike, all_warm=len(alike) == len(warm))
        others = [x for other, x in above.items() if other not in group]
        issues += _suspect_rest(log, key, warm[key], evidence[group], others, alone=len(group) == 1)
    return issues


def _suspect_rest(
    log: Channels, key: str, start: float, evidence: float, others: Sequence[float], *, alone: bool
) -> list[Issue]:
    """A sensor that begins so much above the air [K], `alone` or with some, by the evidence that its part was at rest.

    What a usual mistake makes of a robot at rest is doubted unless the log contradicts it, and where somebody stated
    the unit only if the log says so. Of a part without a load any other offset may be heat that nobody logged. If all
    sensors of a robot begin alike, and no such mistake explains it, it is rather the air that is another's.
    """
    source, room, has_load = log.sources[key], log.sensors[log.air].first, bool(log.load_of(place_of(key)))
    offset = min(_OFFSETS, key=lambda one: abs(one - start))
    byte = _are_whole(log.values[key][np.isfinite(log.values[key])]) and -1.0 <= start - offset <= ALIKE
    degf = start > OVER and abs(start - (0.8 * room + 32)) < 2 * ALIKE
    rested, issues = not others or float(np.median(others)) < 2 * ALIKE, list[Issue]()
    usual = rested and source.unit is None and (byte or degf)
    told = evidence > (-_SURE if usual else _SURE) or (np.isnan(evidence) and usual and degf)
    if not told or not (byte or degf or (has_load and (others or alone))):
        return []
    stays = "and would stay so at rest" if evidence > _SURE else "and the log does not tell whether it was so warm"
    right = f"if the part is as warm, write {log.believed(key)}"
    if degf:
        problem = f"begins at {start + room:.4g} degC where the surroundings have {room:.4g} degC, {stays}, "
        problem += "which looks like degF"
        in_degf = log.in_unit(key, "degF", problem, certain=False)
        in_degf = replace(in_degf, remedy=in_degf.remedy.partition(";")[0] + f"; {right}") if source.unit else in_degf
        issues.append(in_degf)
    if not degf or (byte and np.isfinite(evidence)):
        what = f"a byte with an offset of {offset:g}" if byte else "an offset, or heat that is not logged"
        problem = f"begins {start:.3g} K above the surroundings{' in whole numbers' * byte}, {stays}: {what}?"
        meant = replace(source, offset=-offset if byte else -float(f"{start:.3g}"))
        remedy = f"if it has an offset, write {{}}; {right}"
        issues.append(log.issue(key, problem, remedy, "offset", corrected=meant))
    return issues
