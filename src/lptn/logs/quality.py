"""What is wrong with a log's values: refused where they can't be used, else issues with what would correct them.

`check_values` refuses, with the line of the file, what no run can be made of. `issues_of` looks for what is suspicious
and can be read all the same: another unit, a counter that wraps, a frozen sensor. Each of its checks gives a list of
`Issue`; a new check is one more function and its call in `issues_of`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.logs.alike import copies_in
from lptn.logs.clock import FEWEST_ROWS
from lptn.logs.columns import AMBIENT, HEATS, INPUTS, ColumnSource, as_line_or_option, column_unit
from lptn.logs.issue import Issue, correctable, in_unit
from lptn.logs.law import Blocks, gain_change
from lptn.logs.passive import Silence
from lptn.logs.tables import Table
from lptn.logs.units import PLAUSIBLE, believed, room_of, suspect_starts, suspect_unit, suspect_wrap

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


# --- Channels that stand still, or say the same as another ---------------------------------------


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
    issues, of_kind = [], {kind: [one for one in silent if one.kind == kind] for kind in ("code", "disconnected")}
    said = [silence for silence in silent if silence.kind not in of_kind]
    codes, off = of_kind.values()
    if codes and (len(source.columns) == 1 or source.how == "mean"):
        count = int(sum(code.rows.sum() for code in codes))
        listed = " and ".join(f"{code.value:.6g}" for code in codes)
        problem = f"{count} reading{'s' * (count > 1)} of exactly {listed} degC, far from those around: a fault code"
        in_file = [_in_file(source, code, numbers) for code in codes]
        corrected = replace(source, invalid=tuple(dict.fromkeys((*source.invalid, *in_file))))
        remedy = "these readings are left out; to have it in the model file, write {}"
        issues.append(correctable(key, problem, corrected, False, remedy, kind="code"))
    if len(off) > _MANY:  # a sensor that is off again and again: all in one
        rows, middle = np.any([silence.rows for silence in off], axis=0), float(np.median([one.value for one in off]))
        off = [replace(off[0], value=middle, stop=off[-1].stop, rows=rows)]
    for silence in (*said, *off):
        problem, remedy = _what(key, silence), _done(key, source, silence, numbers, roles)
        if silence.column:
            problem = f"its column '{silence.column}' {'is ' * (not silence.whole)}{problem}"
        stretch, column = (silence.start, silence.stop), silence.column or source.columns[0]
        issues.append(Issue(key, column, problem, remedy, False, kind=silence.kind, stretch=stretch))
    return issues


_MANY = 4  # stretches of one kind that are said one by one


def _what(key: str, silence: Silence) -> str:
    """What a channel does in a silence."""
    number, unit, count = f"{silence.value + 0.0:.6g}", column_unit(key), int(silence.rows.sum())  # no zero with a sign
    when, length = f"from {silence.start:.10g} to {silence.stop:.10g} s", f"{silence.stop - silence.start:.4g} s"
    if silence.whole:
        others = "the joint" if key.partition(".")[0] in INPUTS else "another one"
        return f"reads {number} {unit} throughout, {length}, while {others} moves"
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
    right = f"if the column is right, write {believed(key, source, numbers)}, a range to believe it in"
    if silence.kind == "wrap":
        meant = replace(source, wrap=float(f"{silence.value / abs(source.scale):.4g}"))
        return f"these readings are left out; to have a counter unwrapped, write {as_line_or_option(key, meant)}"
    if not roles.left_out(key, source, silence):
        if silence.whole and key in roles.predicted:
            return "it is the only sensor, and counts all the same; if it was stuck, nothing can be concluded from it"
        gap = replace(source, invalid=(*source.invalid, _in_file(source, silence, numbers)))
        return f"it is used as it is; to have a gap there, write {as_line_or_option(key, gap)}"
    if not silence.lasts or key in roles.predicted:
        return f"it is left out; {right}" if silence.whole else "these readings are left out"
    what = f"the heat of {place}" if quantity in INPUTS else "what it gives to the model"
    cut = "; map the column that has it" if silence.whole else " there, so that the log is cut"
    return f"{what} is not known{cut}; {right}"


def _in_file(source: ColumnSource, silence: Silence, numbers: Mapping[str, FloatArray]) -> float:
    """The number that the file has in a silence."""
    return float(np.median(numbers[silence.column or source.columns[0]][silence.rows]))


def _suspect_power(key: str, source: ColumnSource, values: Mapping[str, FloatArray]) -> list[Issue]:
    """A speed with which the torque of its joint would be a power that no joint has: turns a minute, or the rotor's."""
    torque = values.get(key.replace("velocity.", "torque.", 1))
    if (
        source.unit is not None
        or torque is None
        or not np.nanmax(np.abs(torque), initial=0.0) < PLAUSIBLE["torque"].most
    ):
        return []
    power = np.abs(torque * values[key])
    if not np.isfinite(power).any() or (high := float(np.nanpercentile(power, 99))) <= PLAUSIBLE["power"].most:
        return []
    problem = (
        f"with the joint's torque a power of {high / 1000:.3g} kW, which looks like rpm, or the speed of the rotor"
    )
    return [in_unit(key, source, "rpm", problem, certain=False)]


def _suspect_gains(
    sources: Mapping[str, ColumnSource],
    numbers: Mapping[str, FloatArray],
    values: Mapping[str, FloatArray],
    said: Collection[str],
) -> list[Issue]:
    """Loads that heat their parts as no load does from some row on, in columns of which nothing else is said."""
    if "time" in said:
        return []
    blocks = Blocks({key: x for key, x in values.items() if key not in said})
    issues = []
    for key in (key for key in sources if key.partition(".")[0] in HEATS and key not in said):
        place, source = key.partition(".")[2], sources[key]
        part = f"temperature.{place}"
        if part not in blocks.values or np.isfinite(source.valid).any():
            continue
        change = gain_change(blocks, part, key)
        if change is None:
            continue
        start, stop = float(values["time"][change.start]), float(values["time"][-1])
        problem = f"from about {start:.4g} s on it heats {part} {max(change.ratio, 0.0):.2g} times as much "
        problem += "as before for its square, which looks like another unit from there on"
        remedy = "cut the log there, and say each part's unit; if the column is right, write "
        remedy += believed(key, source, numbers)
        issues.append(Issue(key, source.columns[0], problem, remedy, False, stretch=(start, stop)))
    return issues


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
    for key in (key for key in sources if key.startswith("temperature.") and key != AMBIENT):
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
            remedy += f" write {believed(AMBIENT, sources[AMBIENT], numbers)}"
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
    room = room_of(values)
    for key, source in sources.items():
        of_column = suspect_wrap(key, source, numbers, room)
        stated = units.get(source.columns[0], "")
        of_column = of_column or suspect_unit(key, source, numbers, values[key], stated, room)
        said = silent.get(key, [])
        if of_column:
            # Readings in another unit look like those of no part; a converter rests at another number than 0.
            said = [one for one in said if one.kind in _STILL and of_column[0].kind != "counts"]
        elif key.startswith("torque."):
            of_column = _suspect_sign(key, source, values)
        elif key.startswith("velocity."):
            of_column = _suspect_power(key, source, values)
        issues += [*of_column, *suspect_silence(key, source, said, numbers, roles)]
    issues += [*copies_in(sources, numbers, values), *_suspect_ambient(sources, numbers, values)]
    if not any(issue.key.startswith("temperature.") and issue.kind == "unit" for issue in issues):
        issues += suspect_starts(sources, numbers, values)
    return (*issues, *_suspect_gains(sources, numbers, values, {issue.key for issue in issues}))
