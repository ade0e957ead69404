"""What is wrong with a log's values: refused where they can't be used, else issues with what would correct them.

`check_values` refuses, with the line of the file, what no run can be made of. `issues_of` looks for what is suspicious
and can be read all the same: another unit, a counter that wraps, a frozen sensor. Each of its checks gives a list of
`Issue`; a new check is one more function and its call in `issues_of`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.logs.clock import FEWEST_ROWS, suspect_unit_of_time
from lptn.logs.columns import ColumnName, ColumnSource, as_line_or_option, column_unit
from lptn.logs.issue import Issue, correctable, in_unit
from lptn.logs.resampling import means_of_blocks
from lptn.logs.silence import AMBIENT, INPUTS, Silence, duplicates, held_rows, loads_of, quantisation_step, same_loads
from lptn.logs.tables import Table

# --- What can't be used at all, refused with the line that it stands on ---------------------------


_LARGEST = 1e12  # of any quantity in SI, so that the sum of its squares is still a number
_ABSOLUTE_ZERO = -273.15  # degC


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
    impossible = values < _ABSOLUTE_ZERO
    if key.startswith("temperature.") and impossible.any():
        row = int(impossible.argmax())
        expected = f"a temperature above {_ABSOLUTE_ZERO} degC"
        expected += "; a code for no reading is written as invalid = [NUMBER] in [columns]"
        table.refuse(row, name, f"{values[row]:.6g} degC", expected)


# --- Another unit than SI: by the column's name, or by values that the quantity can't have ---------


_UNAMBIGUOUS = {  # units that nothing else at a name's end means; "c" or "s" may
    "temperature": {"degF", "K"},
    "torque": {"mN*m"},
    "current": {"mA"},
    "velocity": {"rpm", "deg/s", "turn/s"},
    "power": {"mW", "kW"},
}
_COLDEST_KELVIN = 150.0  # a column T_K whose middle value is below was converted to degC, and kept its name


def suspect_unit(key: str, source: ColumnSource, values: FloatArray, stated: str = "") -> list[Issue]:
    """Another unit than SI, by the column's name or its values; nothing where the mapping names a unit.

    Args:
        key: `time` or `<quantity>.<place>`.
        source: where the values come from.
        values: (n,) as read, in SI or degC if `source` says nothing else; NaN where missing.
        stated: what a row of units in the file says.
    """
    readings = values[np.isfinite(values)]
    of_several = len(source.columns) > 1 and source.how != "mean"
    quantity = key.partition(".")[0]
    if source.unit is not None or of_several or readings.size == 0:
        return _suspect_stated(key, source, readings) if quantity == "temperature" and not of_several else []
    unit = ColumnName.of(source.columns[0], stated).unit(quantity) if stated else ""
    if unit and unit != column_unit(key) and source.scale == 1:
        return [in_unit(key, source, unit, f"the row of units below the names says {unit}")]
    if key == "time":
        return suspect_unit_of_time(source, values)
    name = ColumnName.of(source.columns[0])
    named = name.unit(quantity)
    converted = named == "K" and np.median(readings) < _COLDEST_KELVIN
    if named in _UNAMBIGUOUS.get(quantity, ()) and source.scale == 1 and not converted:
        return [in_unit(key, source, named, f"no unit is given for '{source.columns[0]}', whose name says {named}")]
    match quantity:
        case "temperature":
            return _suspect_temperature_unit(key, source, readings)
        case "current" | "torque" if counts := _suspect_counts(key, source, readings):
            return counts
        case "current":
            return _suspect_size(key, source, readings, "mA", _LARGEST_CURRENT, _LARGEST_WHOLE_CURRENT)
        case "velocity" if name.electrical:
            meant = replace(source, unit="rpm", scale=1 / _EXAMPLE_POLE_PAIRS)
            remedy = f"for {_EXAMPLE_POLE_PAIRS} pole pairs, say, write {as_line_or_option(key, meant)}"
            # No log says how many there are, so that nobody is to take this line unseen.
            return [Issue(key, source.columns[0], "electrical turns, by the column's name", remedy, True)]
        case "velocity":
            return _suspect_size(key, source, readings, "rpm", _LARGEST_VELOCITY, _LARGEST_WHOLE_VELOCITY)
    return []


# Middle values of a temperature column, degC, beyond which nobody logs a robot in degC.
_HOTTEST = 1000.0  # no motor or board survives that: 10 … 100 degC in hundredths of a degree
_THOUSANDTHS = 10_000.0  # 10 … 100 degC in thousandths
_TENTHS = 200.0  # 20 degC in tenths
_NO_WINDING = 300.0  # degC: insulation of the best class bears 240, magnets less
_KELVIN = (200.0, 500.0)  # all of a robot's temperatures, K
_MOSTLY_KELVIN = (240.0, 450.0)  # the middle one, where a few readings are codes: -33 … 177 degC
_MOSTLY = 0.9  # share of the readings above the lower of these
_ROOM_FAHRENHEIT = (55.0, 120.0)  # surroundings of 13 … 49 degC, degF
_NO_ROOM = 60.0  # degC: no robot works in surroundings as warm, nor begins at rest so


def _suspect_temperature_unit(key: str, source: ColumnSource, readings: FloatArray) -> list[Issue]:
    """Kelvin, tenths, hundredths or thousandths of a degree, and surroundings in Fahrenheit."""
    low, middle, high = float(readings.min()), float(np.median(readings)), float(readings.max())
    in_parts = None
    if middle > _HOTTEST:
        in_parts = (0.001, "thousandths", True) if middle > _THOUSANDTHS else (0.01, "hundredths", True)
    elif middle > _TENTHS and _KELVIN[0] <= low and high <= _KELVIN[1]:
        return [in_unit(key, source, "K", f"values {low:.4g} … {high:.4g}, which look like kelvin")]
    elif _MOSTLY_KELVIN[0] < middle < _MOSTLY_KELVIN[1] and float((readings > _MOSTLY_KELVIN[0]).mean()) > _MOSTLY:
        return [in_unit(key, source, "K", f"most values around {middle:.4g}, which look like kelvin", certain=False)]
    elif middle > _TENTHS:
        in_parts = (0.1, "tenths", middle > _NO_WINDING)
    if in_parts:
        scale, words, certain = in_parts
        corrected = replace(source, scale=source.scale * scale)
        remedy = f"for {words} write {{}}"
        if _bits_of(readings):
            scale = _EXAMPLE_HOTTEST / (2 ** _bits_of(readings) - 1)
            as_counts = replace(source, scale=float(f"{scale:.6g}"))
            remedy += f"; for counts of a converter, with {_EXAMPLE_HOTTEST:g} degC at full scale, say, "
            remedy += as_line_or_option(key, as_counts)
        return [correctable(key, f"values around {middle:.4g}", corrected, certain, remedy)]
    if key == AMBIENT and _ROOM_FAHRENHEIT[0] < middle < _ROOM_FAHRENHEIT[1]:
        problem = f"surroundings at {middle:.4g} degC, which look like degF"
        return [in_unit(key, source, "degF", problem, certain=middle > _NO_ROOM)]
    return []


_BEARABLE = (-60.0, 240.0)  # degC, the middle value of a sensor on a robot; insulation of the best class bears 240
_READ_IN = {"degC": (1.0, 0.0), "K": (1.0, -273.15), "degF": (1 / 1.8, -32 / 1.8)}  # to degC


def _suspect_stated(key: str, source: ColumnSource, readings: FloatArray) -> list[Issue]:
    """A temperature that in the unit that is stated for it can be no robot's; `readings` as they were read, degC."""
    middle = float(np.median(readings)) if readings.size else _WARM
    if _BEARABLE[0] < middle < _BEARABLE[1] or source.unit not in _READ_IN or np.isfinite(source.valid).any():
        return []
    scale, offset = _READ_IN[source.unit]
    raw = (middle - offset) / scale
    fitting = [unit for unit, (a, b) in _READ_IN.items() if _BEARABLE[0] < a * raw + b < _BEARABLE[1]]
    problem = f"values around {middle:.4g} degC, in the unit that is stated, {source.unit}: no part of a robot has that"
    stays = as_line_or_option(key, replace(source, valid=(float(readings.min()) - 1, float(readings.max()) + 1)))
    if not fitting:
        return [Issue(key, source.columns[0], problem, f"write its unit; if it is right, write {stays}", False)]
    meant = min(fitting, key=lambda unit: abs(_READ_IN[unit][0] * raw + _READ_IN[unit][1] - _WARM))
    remedy = f"write {{}}; if it is right, write {stays}"
    return [correctable(key, problem, replace(source, unit=meant), False, remedy)]


_WARM = 40.0  # degC, of a robot at work: which of several units is proposed
_LARGEST_CURRENT = 1000.0  # A: no robot's joint takes more
_LARGEST_WHOLE_CURRENT = 250.0  # A, doubted where all are whole numbers
_LARGEST_VELOCITY = 2000.0  # rad/s, 19,000 rpm: no joint's motor turns faster
_LARGEST_WHOLE_VELOCITY = 300.0  # rad/s, 2900 rpm, doubted where all are whole numbers
_EXAMPLE_POLE_PAIRS = 14  # in the line that is proposed: a common number for robots' outrunners


def _suspect_size(
    key: str, source: ColumnSource, readings: FloatArray, unit: str, largest: float, largest_whole: float
) -> list[Issue]:
    """Values so large that they are rather in `unit`; one reading in a hundred may be an outlier."""
    high = float(np.percentile(np.abs(readings), 99))
    certain = high > largest
    if certain or (high > largest_whole and (np.round(readings) == readings).all()):
        return [in_unit(key, source, unit, f"values up to {high:.4g}, which look like {unit}", certain)]
    return []


_CONVERTERS = (10, 12, 14, 16)  # bits that converters have
_LEAST_COUNTS = 0.25  # of a converter's range, that whole numbers reach
_MOST_AWAY, _AT_REST = 0.125, 0.01  # of it, from the middle: usually, and now and then
_EXAMPLE_HOTTEST, _EXAMPLE_FULL_SCALE = 125.0, {"current": 40.0, "torque": 50.0}  # degC, A, N*m: in proposed lines
_LARGEST_WHOLE_TORQUE = 150.0  # N*m, doubted where all are whole numbers: nobody measures a large torque so coarsely


def _bits_of(readings: FloatArray) -> int:
    """How many bits a converter has whose counts, from 0 up, these may be; 0 where they can't."""
    high = float(readings.max())
    if readings.min() < 0 or not (np.round(readings) == readings).all():
        return 0
    return next((bits for bits in _CONVERTERS if _LEAST_COUNTS * 2**bits < high < 2**bits), 0)


def _suspect_counts(key: str, source: ColumnSource, readings: FloatArray) -> list[Issue]:
    """Whole numbers about the middle of a converter's range, which stand for none, or large ones about zero."""
    quantity = key.partition(".")[0]
    full, unit = _EXAMPLE_FULL_SCALE[quantity], column_unit(key)
    bits = _bits_of(readings)
    zero = 2 ** (bits - 1)
    away = np.abs(readings - zero) / (2 * zero)
    high = float(np.percentile(np.abs(readings), 99))
    whole = bool((np.round(readings) == readings).all())
    if bits and readings.min() > 0 and np.median(away) < _MOST_AWAY and away.min() < _AT_REST:
        meant = replace(source, scale=full / zero, offset=-full)
        problem = f"whole numbers from {readings.min():.6g} to {readings.max():.6g}, as a converter of {bits} bit gives"
        what, certain = "one", True
    elif quantity == "torque" and whole and _LARGEST_WHOLE_TORQUE < high <= _MOST_TORQUE:
        meant = replace(source, scale=full / 2**11)
        problem = f"whole numbers up to {high:.4g}, which look like the counts of a converter"
        what, certain = "12 bit", False
    else:
        return []
    # No number tells its full scale, so that nobody is to take this line unseen.
    remedy = f"for {what} with ±{full:g} {unit} at full scale, say, write {as_line_or_option(key, meant)}"
    return [Issue(key, source.columns[0], problem, remedy, certain, kind="counts")]


_COLDEST_FAHRENHEIT = (48.0, 120.0)  # degF, 9 … 49 degC: the coldest reading of a log in a room
_COOLED = 3.0  # K, by which a robot that was so warm cools whenever it does less
_OVER_ROBOT = 20.0  # K over the robot at the first reading: robots begin as warm as the room, or warmer
_OVER_ROOM = 30.0  # K over the room at the first reading: hardly any log begins so warm
_COOLS = 10.0  # degF, by which a robot that begins at rest never cools: what does was warm
_SAME_START = 6.0  # degF, how close the first readings then are to each other, and to the room's in degF


def suspect_fahrenheit(sources: Mapping[str, ColumnSource], values: Mapping[str, FloatArray]) -> list[Issue]:
    """Fahrenheit, by the whole log: no temperature that a room can have, or a start in degF where the room's is then.

    Args:
        sources: where the quantities stand.
        values: (n,) each, as read.
    """
    keys = [key for key in sources if _is_read_temperature(key, values[key])]
    if any(sources[key].unit not in (None, "degF") for key in keys):
        return []
    several, keys = len(keys) > 1, [key for key in keys if sources[key].unit is None]
    first = {key: float(values[key][np.isfinite(values[key])][0]) for key in keys}
    starts = list(first.values())
    coldest = min((float(np.nanmin(values[key])) for key in keys), default=np.nan)
    # Sensors that begin apart are those of a robot that was warm.
    if _COLDEST_FAHRENHEIT[0] < coldest < _COLDEST_FAHRENHEIT[1] and max(starts) - min(starts) < _SAME_START:
        problem = f"no temperature of the whole log is below {coldest:.4g} degC, which looks like degF"
        certain = several and coldest > max(_NO_ROOM, min(starts) - _COOLED)
        if certain:
            problem = "begins at {:.4g} degC, as all sensors do, and none of them ever cools: which looks like degF"
        return [in_unit(key, sources[key], "degF", problem.format(first[key]), certain=certain) for key in keys]
    room = first.pop(AMBIENT, np.nan)
    usual = float(np.median(list(first.values()))) if first else np.nan
    in_range = _COLDEST_FAHRENHEIT[0] < room < _COLDEST_FAHRENHEIT[1]
    if in_range and room - usual > _OVER_ROBOT and abs((room - 32) / 1.8 - usual) < _COOLED:
        problem = (
            f"surroundings of {room:.4g} degC around a robot that begins at {usual:.4g} degC, which look like degF"
        )
        return [in_unit(AMBIENT, sources[AMBIENT], "degF", problem)]
    like_room = {
        key: start
        for key, start in first.items()
        if start > room + _OVER_ROOM
        and abs(start - (1.8 * room + 32)) < _SAME_START
        and float(np.nanmin(values[key])) > start - _COOLS  # else it was warm
    }
    # Where the others begin warm as well, or these apart, it is the robot that was warm.
    others = [start for key, start in first.items() if key not in like_room]
    others_warm = bool(others) and float(np.median(others)) > room + _SAME_START
    if others_warm or (like_room and max(like_room.values()) - min(like_room.values()) >= _SAME_START):
        return []
    problem = "begins at {:.4g} degC where the surroundings have {:.4g} degC, which looks like degF"
    return [
        in_unit(key, sources[key], "degF", problem.format(start, room), certain=False)
        for key, start in like_room.items()
    ]


# --- Counters of 16 or 32 bit that jump from one end of their range to the other -------------------


_JUMP = 0.75  # of the range: what counts as a jump from one end to the other
_SHORT = 0.1  # of the range: the usual step, taken the shorter way round
_FEWEST_COUNTS = 5  # different numbers in each half of the range, through which a counter passes


def suspect_wrap(key: str, source: ColumnSource, raw: FloatArray) -> list[Issue]:
    """A counter that wraps; `raw` is (n,) as in the file."""
    numbers = raw[np.isfinite(raw)]
    temperature = key.startswith("temperature.")
    whole = bool((np.round(numbers) == numbers).all())
    unit = 1.0 if whole else quantisation_step(numbers) if temperature else 0.0
    if source.wrap or len(source.columns) > 1 or numbers.size < 2 or unit == 0:
        return []
    counts = numbers / unit
    steps = np.abs(np.diff(counts))
    jumps = -np.diff(counts) if key == "time" else steps  # time that leaps ahead is a gap
    low, high = counts.min(), counts.max()
    for bits in (8, 16, 32) if temperature else (16, 32):  # torques of a byte may change so much
        turn = float(2**bits)
        unsigned = low >= 0 and high < turn
        in_range = unsigned or (low >= -turn / 2 and high < turn / 2)
        wraps = int((jumps > _JUMP * turn).sum())
        # A signal about 0 jumps at every change of sign: short are its steps the other way round.
        if not (in_range and wraps and np.median(np.minimum(steps, turn - steps)) < _SHORT * turn):
            continue
        above = counts > (turn / 2 if unsigned else 0)
        if min(np.unique(counts[above]).size, np.unique(counts[~above]).size) < _FEWEST_COUNTS:
            continue  # always the same number is a code for no reading
        problem = f"{wraps} jumps of some {turn * unit:.6g}: a counter of {bits} bit that wraps"
        return [correctable(key, problem, replace(source, wrap=turn * unit), True, kind="wrap")]
    return []


# --- Channels that stand still, or say the same as another ---------------------------------------


_MOST_TORQUE = 1000.0  # N·m: no robot's joint bears more
_OUTLIERS = 0.01  # of the readings: fewer are single ones gone wrong, not another unit


@dataclass(frozen=True)
class Roles:
    """What a log's columns are to a model: it decides what becomes of what a silent channel says.

    Args:
        predicted: temperatures that the model predicts, and that are not given to it.
        one_speaks: whether one of these says more than one number throughout.
    """

    predicted: frozenset[str]
    one_speaks: bool = True

    def left_out(self, key: str, source: ColumnSource, silence: Silence) -> bool:
        """Whether what a channel says in a silence is taken for no reading: a hole in a sensor's, a gap in an input's.

        Single readings are, and all that a predicted temperature says, but for one number throughout where no other
        says more. Of a torque, current or speed, and of a given temperature that is dead, the log is cut, for what they
        bring in is not known; a given temperature that stands still may well do so. Who says what is valid knows the
        machine.
        """
        stated = bool(np.isfinite(source.valid).any())
        if not silence.lasts:
            return True
        if key in self.predicted:
            return not silence.whole or (self.one_speaks and not stated)
        return not stated and (key.partition(".")[0] in INPUTS or silence.kind in ("dead", "disconnected"))


def suspect_silence(
    key: str, source: ColumnSource, silent: list[Silence], numbers: Mapping[str, FloatArray], roles: Roles
) -> list[Issue]:
    """What a channel's silences mean, and what is done with them.

    Args:
        key: the quantity.
        source: where it stands.
        silent: its silences.
        numbers: the file's columns, (n,) each, as they stand there.
        roles: what the columns are to the model.
    """
    issues = _of_codes(key, source, [silence for silence in silent if silence.kind == "code"], numbers)
    for silence in _few(silent):
        problem, remedy = _what(key, silence, roles), _done(key, source, silence, numbers, roles)
        if silence.column:
            problem = f"its column '{silence.column}' {'is ' * (not silence.whole)}{problem}"
        stretch = (silence.start, silence.stop)
        column = silence.column or source.columns[0]
        issues.append(Issue(key, column, problem, remedy, False, kind=silence.kind, stretch=stretch))
    return issues


_MANY = 4  # stretches of one kind that are said one by one


def _few(silent: list[Silence]) -> list[Silence]:
    """All but the codes; of a sensor that is off again and again all these stretches in one."""
    off = [silence for silence in silent if silence.kind == "disconnected"]
    others = [silence for silence in silent if silence.kind not in ("code", "disconnected")]
    if len(off) <= _MANY:
        return others + off
    rows, middle = np.any([silence.rows for silence in off], axis=0), float(np.median([one.value for one in off]))
    return [*others, replace(off[0], value=middle, stop=off[-1].stop, rows=rows)]


def _what(key: str, silence: Silence, roles: Roles) -> str:
    """What a channel does in a silence."""
    number, unit, count = f"{silence.value + 0.0:.6g}", column_unit(key), int(silence.rows.sum())  # no zero with a sign
    when, length = f"from {silence.start:.6g} to {silence.stop:.6g} s", f"{silence.stop - silence.start:.4g} s"
    if silence.whole and key.partition(".")[0] in INPUTS:
        return f"reads {number} {unit} throughout, {length}, while the joint moves"
    if silence.whole:
        rest = "while another one moves" if key in roles.predicted else "where all others begin elsewhere"
        return f"reads {number} {unit} throughout, {length}, {rest}"
    match silence.kind:
        case "spike":
            return f"{count} spike{'s' * (count > 1)} of up to {silence.value:.3g} K in single readings {when}"
        case "disconnected":
            return f"no reading of a heated part, around {number} {unit}, in {count} rows {when}"
        case "wrap":
            return f"leaps by {number} K, up and down, {when}: a counter that wraps, or a reference that changes"
    return f"{silence.kind} at {number} {unit} {when}"


def _done(key: str, source: ColumnSource, silence: Silence, numbers: Mapping[str, FloatArray], roles: Roles) -> str:
    """What is done with what a channel says in a silence, or what to write."""
    quantity, _, place = key.partition(".")
    believed = f"if the column is right, write {_believed(key, source, numbers)}, a range to believe it in"
    if silence.kind == "wrap":
        meant = replace(source, wrap=float(f"{silence.value / abs(source.scale):.4g}"))
        return f"these readings are left out; to have a counter unwrapped, write {as_line_or_option(key, meant)}"
    if not silence.lasts:
        return "these readings are left out"
    if silence.whole and quantity in INPUTS:
        return f"the heat of {place} is not known; map the column that has it; {believed}"
    if silence.whole and key not in roles.predicted:
        return f"no sensor is there; map another column, or write a number for {place}; {believed}"
    if silence.whole:
        if roles.left_out(key, source, silence):
            return f"it is left out; {believed}"
        return "it is the only sensor, and counts all the same; if it was stuck, nothing can be concluded from it"
    if not roles.left_out(key, source, silence):
        gap = replace(source, invalid=(*source.invalid, _in_file(source, silence, numbers)))
        return f"it is taken as it stands; to have a gap there, write {as_line_or_option(key, gap)}"
    if key in roles.predicted:
        return "these readings are left out"
    what = f"the heat of {place}" if quantity in INPUTS else "what it gives to the model"
    return f"{what} is not known there, so that the log is cut; {believed}"


def _in_file(source: ColumnSource, silence: Silence, numbers: Mapping[str, FloatArray]) -> float:
    """The number that the file has in a silence."""
    return float(np.median(numbers[silence.column or source.columns[0]][silence.rows]))


def _believed(key: str, source: ColumnSource, numbers: Mapping[str, FloatArray]) -> str:
    """The entry by which all that a channel says is valid: a range with some room around all its numbers."""
    raw = np.concatenate([numbers[name][np.isfinite(numbers[name])] for name in source.columns])
    far = float(f"{max(2 * np.abs(raw).max(initial=0.0), 1.0):.0e}")
    return as_line_or_option(key, replace(source, valid=(-far, far)))


def _of_codes(key: str, source: ColumnSource, codes: list[Silence], numbers: Mapping[str, FloatArray]) -> list[Issue]:
    """The fault codes of a channel, all in one."""
    if not codes or (len(source.columns) > 1 and source.how != "mean"):
        return []
    count = int(sum(code.rows.sum() for code in codes))
    listed = " and ".join(f"{code.value:.6g}" for code in codes)
    in_file = [_in_file(source, code, numbers) for code in codes]
    problem = f"{count} reading{'s' * (count > 1)} of exactly {listed} degC, far from those around: a fault code"
    corrected = replace(source, invalid=tuple(dict.fromkeys((*source.invalid, *in_file))))
    remedy = "these readings are left out; to have it in the model file, write {}"
    return [correctable(key, problem, corrected, False, remedy, kind="code")]


def _suspect_torque(key: str, source: ColumnSource, values: FloatArray) -> list[Issue]:
    """Torques that no joint bears."""
    beyond = np.abs(np.nan_to_num(values)) > _MOST_TORQUE
    if np.isfinite(source.valid).any() or not beyond.any():  # who says what is valid knows the machine
        return []
    count, most = int(beyond.sum()), float(np.nanmax(np.abs(values)))
    problem = f"{count} value{'s' * (count != 1)} up to {most:.4g} N*m, more than any joint bears"
    if source.scale == 1 and source.unit is None and len(source.columns) == 1:
        outliers = beyond.mean() < _OUTLIERS
        meant = replace(source, valid=(-_MOST_TORQUE, _MOST_TORQUE)) if outliers else replace(source, unit="mN*m")
        remedy = (
            "to leave them out, write {}" if outliers else "if it is in mN*m, write {}, and any other unit likewise"
        )
        return [correctable(key, problem, meant, True, remedy, kind="size")]
    remedy = f"write another unit, or valid = [{-_MOST_TORQUE:g}, {_MOST_TORQUE:g}], in its entry of [columns]"
    return [Issue(key, source.columns[0], problem, remedy, True, kind="size")]


def duplicates_of(sources: Mapping[str, ColumnSource], values: Mapping[str, FloatArray]) -> dict[str, str]:
    """Temperatures that say number by number what another column says, by quantity, each with that other."""
    read = {key: values[key] for key in sources if key.startswith("temperature.") and key != AMBIENT}
    pairs = duplicates(read, {f"temperature.{place}": load for place, load in loads_of(values).items()})
    return {key: other for key, other in pairs.items() if sources[key].columns != sources[other].columns}


def _suspect_duplicates(sources: Mapping[str, ColumnSource], values: Mapping[str, FloatArray]) -> list[Issue]:
    """Temperatures that are another column's."""
    remedy = "one of the two is not where it is said to be, and beside others neither is used; map its own column"
    return [
        Issue(key, sources[key].columns[0], f"the same readings as {other}", remedy, False, kind="duplicate")
        for key, other in duplicates_of(sources, values).items()
    ]


def _suspect_same_loads(
    sources: Mapping[str, ColumnSource], numbers: Mapping[str, FloatArray], values: Mapping[str, FloatArray]
) -> list[Issue]:
    """Torques and currents that are another joint's."""
    issues = []
    for key, other in same_loads({key: values[key] for key in sources}).items():
        if sources[key].columns == sources[other].columns or np.isfinite(sources[key].valid).any():
            continue
        remedy = "one of the two is not where it is said to be: map its own column; if both are right, write "
        remedy += _believed(key, sources[key], numbers)
        problem = f"the same numbers as {other}"
        issues.append(Issue(key, sources[key].columns[0], problem, remedy, False, kind="duplicate"))
    return issues


def without_held_rows(column: str, values: dict[str, FloatArray]) -> tuple[dict[str, FloatArray], list[Issue]]:
    """Quantities without what stands in rows that the logger did not write, but repeated; and what is said of these.

    Args:
        column: of the times.
        values: time [s] and the quantities, (n,) each.
    """
    held, time = held_rows(values), values["time"]
    if not held:
        return values, []
    rows = np.zeros(time.size, dtype=bool)
    for first, last in held:
        rows[first : last + 1] = True
    length = sum(time[last] - time[first - 1] for first, last in held)
    start, stop = float(time[held[0][0]]), float(time[held[-1][1]])
    problem = f"all columns stand {len(held)} time{'s' * (len(held) > 1)}, {length:.4g} s in all, "
    problem += f"from {start:.6g} to {stop:.6g} s"
    remedy = "these rows are left out"
    issue = Issue("time", column, problem, remedy, certain=False, kind="held", stretch=(start, stop))
    return {key: x if key == "time" else np.where(rows, np.nan, x) for key, x in values.items()}, [issue]


_MOST_POWER = 5000.0  # W, of torque and speed: the strongest joints of legged robots reach some 3 kW for a moment


def _suspect_power(key: str, source: ColumnSource, values: Mapping[str, FloatArray]) -> list[Issue]:
    """A speed with which the torque of its joint would be a power that no joint has: turns a minute, or the rotor's."""
    torque = values.get(key.replace("velocity.", "torque.", 1))
    if source.unit is not None or torque is None or not np.nanmax(np.abs(torque), initial=0.0) < _MOST_TORQUE:
        return []
    power = np.abs(torque * values[key])
    if not np.isfinite(power).any() or (high := float(np.nanpercentile(power, 99))) <= _MOST_POWER:
        return []
    problem = (
        f"with the joint's torque a power of {high / 1000:.3g} kW, which looks like rpm, or the speed of the rotor"
    )
    return [in_unit(key, source, "rpm", problem, certain=False)]


_BRAKES = 0.98  # of the work of a joint, that is taken up: legs and wheels that are driven brake in a part of it
_LEAST_POWER = 1.0  # W, on average: of less the sign is the noise's


def _suspect_sign(key: str, source: ColumnSource, values: Mapping[str, FloatArray]) -> list[Issue]:
    """A torque that opposes its joint's speed all the time: one of the two counts the other way round."""
    speed = values.get(key.replace("torque.", "velocity.", 1))
    if source.unit is not None or source.scale != 1 or speed is None:
        return []
    power = (values[key] * speed)[np.isfinite(values[key]) & np.isfinite(speed)]
    work, braking = float(np.abs(power).sum()), -float(np.minimum(power, 0).sum())
    if not power.size or work < _LEAST_POWER * power.size or braking < _BRAKES * work:
        return []
    problem = (
        f"{braking / work:.0%} of its work with the joint's speed is braking, which looks like a sign turned round"
    )
    remedy = "write {}; if the joint is driven from outside, say the unit: what heats with the square heeds no sign"
    return [correctable(key, problem, replace(source, scale=-1.0), False, remedy, kind="sign")]


_OFFSETS = (30.0, 40.0, 50.0)  # K, that drives add to a temperature so that a byte holds it below zero, too
_NEAR_OFFSET = 3.0  # K, that robots at rest are warmer than the air, and their joints apart from each other
_OF_OFFSET = (0.35, 0.4)  # by which share of it a part may settle off it; where other joints begin as cold as the air
_RESTED = 6.0  # K above the air, where joints begin at rest
_COOLER = 2.0  # K, by which a part that begins at rest never cools: what does was warm
_PARTS = 60  # of a log, whose means tell how a part warms and cools


def _suspect_offsets(
    sources: Mapping[str, ColumnSource], numbers: Mapping[str, FloatArray], values: Mapping[str, FloatArray]
) -> list[Issue]:
    """Whole numbers that begin, and without a load would settle, by one of the usual offsets above the air."""
    loads, air = loads_of(values), values.get(AMBIENT, np.zeros(0))
    sensors = [key for key in sources if _is_read_temperature(key, values[key]) and key != AMBIENT and air.size]
    warmth = {key: values[key] - air for key in sensors}
    starts = {key: float(x[np.isfinite(x)][0]) for key, x in warmth.items() if np.isfinite(x).any()}
    warm = {key: start for key, start in starts.items() if start > _RESTED}
    # A robot that was at work begins with joints that are each as warm as their work made them.
    places = {key: place for key in warm if (place := key.partition(".")[2]) in loads}
    if not places or max(warm.values()) - min(warm.values()) > _NEAR_OFFSET:
        return []
    offset = min(_OFFSETS, key=lambda one: abs(one - max(warm.values())))
    settles = float(np.median([_settles(warmth[key], loads[place]) for key, place in places.items()]))
    near = _OF_OFFSET[len(starts) > 1 and len(warm) < len(starts)] * offset
    if not abs(settles - offset) < near or not -1.0 <= min(warm.values()) - offset <= _NEAR_OFFSET:
        return []
    issues = []
    for key, start in warm.items():
        source, readings = sources[key], values[key][np.isfinite(values[key])]
        stated = source.unit or source.offset or np.isfinite(source.valid).any()
        if stated or not (np.round(readings) == readings).all() or np.nanmin(warmth[key]) < start - _COOLER:
            continue
        problem = f"begins {start:.3g} K above the surroundings, in whole numbers, and at rest it would stay warm: "
        problem += f"a byte with an offset of {offset:g}?"
        remedy = f"if so, write {{}}; if the joint is as warm, write {_believed(key, source, numbers)}"
        meant = replace(source, offset=-offset)
        issues.append(correctable(key, problem, meant, False, remedy, kind="offset"))
    return issues


def _settles(warmth: FloatArray, load: FloatArray) -> float:
    """By how much a part would stay warmer than the air without its load [K], as it warms and cools in a log."""
    size = max(warmth.size // _PARTS, 1)
    warm, heat = means_of_blocks(warmth, size), means_of_blocks(np.square(load), size)
    known = np.isfinite(warm[:-1]) & np.isfinite(warm[1:]) & np.isfinite(heat[:-1]) & np.isfinite(heat[1:])
    if np.count_nonzero(known) < _PARTS // 2 or not np.ptp(heat[np.isfinite(heat)]) > 0:
        return np.nan
    middle = [0.5 * (x[:-1] + x[1:])[known] for x in (heat / np.nanmax(heat), warm)]
    rates = np.linalg.lstsq(np.column_stack([*middle, np.ones(known.sum())]), np.diff(warm)[known], rcond=None)[0]
    return float(-rates[2] / rates[1]) if rates[0] > 0 > rates[1] else np.nan


_FOLLOWS = 0.9  # share of the variance of an ambient that a joint's own warmth explains
_LEAST_FOLLOWED = 2.0  # K, by which the ambient rises: less is the room, which a robot may warm
_MOST_FOLLOWED = 1.0  # of a joint's warmth: what moves farther moves the joint


def _suspect_ambient(
    sources: Mapping[str, ColumnSource], numbers: Mapping[str, FloatArray], values: Mapping[str, FloatArray]
) -> list[Issue]:
    """An ambient sensor that is warmed by a joint: it goes with how much the joint is warmer than it."""
    if AMBIENT not in sources or np.isfinite(sources[AMBIENT].valid).any():  # who says what is valid knows the room
        return []
    air = values[AMBIENT]
    for key in (key for key in sources if _is_read_temperature(key, values[key]) and key != AMBIENT):
        both = np.isfinite(air) & np.isfinite(values[key])
        warmth, ambient = (values[key] - air)[both], air[both]
        if both.sum() < FEWEST_ROWS or min(np.ptp(ambient), np.ptp(warmth)) < _LEAST_FOLLOWED:
            continue
        correlation = float(np.corrcoef(ambient, warmth)[0, 1])
        slope = correlation * float(ambient.std() / warmth.std())
        if correlation > 0 and correlation**2 > _FOLLOWS and slope < _MOST_FOLLOWED:
            problem = f"rises with {key}, by {slope:.2g} K for each kelvin that this is warmer"
            remedy = (
                "is the sensor near that joint? What leaves to the air can't be fitted with it; use one further away,"
            )
            remedy += (
                ' or, for a log that begins at rest, ambient = "start" under [model]; if the room itself is warmed,'
            )
            remedy += f" write {_believed(AMBIENT, sources[AMBIENT], numbers)}"
            return [Issue(AMBIENT, sources[AMBIENT].columns[0], problem, remedy, False, kind="follows")]
    return []


# --- All that looks wrong in a log -----------------------------------------------------------------


_STILL = ("frozen", "clamped", "dead")


def issues_of(
    sources: Mapping[str, ColumnSource],
    numbers: Mapping[str, FloatArray],
    values: Mapping[str, FloatArray],
    silent: Mapping[str, list[Silence]],
    roles: Roles,
    units: Mapping[str, str],
) -> tuple[Issue, ...]:
    """What looks wrong in a log's columns: another unit, a counter that wraps, a sensor that is dead.

    Of a column the first check that finds something speaks: a counter that wraps has values in no unit, and readings in
    another unit look like fault codes.

    Args:
        sources: where the quantities stand, time first.
        numbers: the file's columns, (n,) each, as they stand there.
        values: the quantities, (n,) each, in SI and degC.
        silent: their silences, by `silences_of`.
        roles: what the columns are to the model.
        units: what a row of units in the file says of a column.
    """
    issues: list[Issue] = []
    for key, source in sources.items():
        raw = numbers[source.columns[0]]
        of_column = suspect_wrap(key, source, raw)
        of_column = of_column or suspect_unit(key, source, values[key], units.get(source.columns[0], ""))
        said = silent.get(key, [])
        if of_column:
            # Readings in another unit look like those of no part; a converter rests at another number than 0.
            said = [one for one in said if one.kind in _STILL and of_column[0].kind != "counts"]
        elif key.startswith("torque."):
            of_column = _suspect_torque(key, source, values[key]) or _suspect_sign(key, source, values)
        elif key.startswith("velocity."):
            of_column = _suspect_power(key, source, values)
        issues += [*of_column, *suspect_silence(key, source, said, numbers, roles)]
    issues += [*_suspect_duplicates(sources, values), *_suspect_same_loads(sources, numbers, values)]
    issues += _suspect_offsets(sources, numbers, values)
    issues += [*_suspect_ambient(sources, numbers, values)]
    of_air = [issue.corrected for issue in issues if issue.key == AMBIENT]
    in_other_units = [
        issue
        for issue in issues
        if issue.key.startswith("temperature.") and issue.key != AMBIENT and issue.kind != "offset"
    ]
    if not in_other_units and all(corrected and corrected.unit == "degF" for corrected in of_air):
        others = [issue for issue in suspect_fahrenheit(sources, values) if issue.key != AMBIENT or not of_air]
        issues += others
    return tuple(issues)


def _is_read_temperature(key: str, values: FloatArray) -> bool:
    return key.startswith("temperature.") and bool(np.isfinite(values).any())
