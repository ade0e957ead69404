"""What is wrong with a log's values: refused where they can't be used, else issues with what would correct them.

`check_values` refuses, with the line of the file, what no run can be made of. `issues_of` looks for what is suspicious
and can be read all the same: another unit, a counter that wraps, a frozen sensor. Each of its checks gives a list of
`Issue`; a new check is one more function and its call in `issues_of`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.logs.alike import copies_in, reads_alike, suspect_held
from lptn.logs.channels import Channels, Silence
from lptn.logs.clock import FEWEST_ROWS
from lptn.logs.columns import HEATS, INPUTS, ColumnSource, as_line_or_option, column_unit, place_of, quantity_of
from lptn.logs.issue import Issue
from lptn.logs.law import AT_MOST, DOUBTED, exchanged, gain_change, warming
from lptn.logs.plausible import KELVIN, PLAUSIBLE
from lptn.logs.silence import silences_of
from lptn.logs.tables import Table
from lptn.logs.units import suspect_starts, suspect_unit, suspect_wrap

# --- What can't be used at all, refused with the line that it stands on ---------------------------

_LARGEST = 1e12  # of any quantity in SI, so that the sum of its squares is still a number


def check_values(table: Table, key: str, source: ColumnSource, values: FloatArray) -> None:
    """Refuse infinite values, those that nothing can have, and temperatures below absolute zero, of (n,) in SI or degC.

    Raises:
        InputError: as said, with the line of the table.
    """

    def refuse(which: BoolArray, found: str, expected: str) -> None:
        if which.any():
            row = int(which.argmax())
            table.refuse(row, source.columns[0], found.format(values[row]), expected)

    refuse(np.isinf(values), "an infinite value", "a number or an empty cell")
    refuse(np.abs(values) > _LARGEST, "{:.3g}", f"a number within ±{_LARGEST:.0e}, in SI")
    if key.startswith("temperature."):
        expected = f"a temperature above {-KELVIN} degC"
        expected += "; a code for no reading is written as invalid = [NUMBER] in [columns]"
        refuse(values < -KELVIN, "{:.6g} degC", expected)


# --- Channels that stand still, or say the same as another ---------------------------------------


def silent_channels(log: Channels, predicted: Collection[str]) -> dict[str, list[Silence]]:
    """When each channel is silent, and whether what it says is left out: a hole in a sensor's, a gap in an input's.

    Single readings are, and all that a temperature says that a model predicts, but for one number throughout where no
    other says more. Of a torque, current or speed, and of a given temperature that is dead, the log is cut, for what
    they bring in is not known; a given temperature that stands still may well do so. Who says what is valid knows the
    machine.
    """
    silent = silences_of(log)
    for key in log.of("temperature"):
        if log.sources[key].how == "mean":  # half a dead sensor looks alive
            silent[key] = []
            for part in log.sources[key].parts():
                alone = silences_of(Channels({"time": log.time, key: part.values(key, log.numbers)}, air=log.air))
                silent[key] += [replace(one, column=part.columns[0]) for one in alone.get(key, [])]
    one_speaks = any(not any(one.whole for one in silent.get(key, [])) for key in predicted)

    def is_left_out(key: str, silence: Silence) -> bool:
        if not silence.lasts:
            return True
        if key in predicted:
            return not silence.whole or (one_speaks and not log.is_believed(key))
        known_to_change = quantity_of(key) in INPUTS or silence.kind in ("dead", "disconnected")
        return known_to_change and not log.is_believed(key)

    return {key: [replace(one, left_out=is_left_out(key, one)) for one in some] for key, some in silent.items()}


_MANY = 4  # stretches of one kind that are said one by one
_SAID = {
    "spike": "{count} spike{s} of up to {number} K in single readings {when}",
    "disconnected": "no reading of a heated part, around {number} {unit}, in {count} rows {when}",
    "interpolated": "a straight line through {count} rows {when}, which was filled in",
    "wrap": "leaps by {number} K, up and down, {when}: a counter that wraps, or a reference that changes",
}
"""What a channel does in a silence of a kind; of all others it stands at a number."""


def _suspect_silence(log: Channels, key: str, silent: list[Silence], predicted: Collection[str]) -> list[Issue]:
    """What a channel's silences mean, and what is done with them."""
    issues, source, unit = list[Issue](), log.sources[key], column_unit(key)
    codes, off = ([one for one in silent if one.kind == kind] for kind in ("code", "disconnected"))
    if codes and (len(source.columns) == 1 or source.how == "mean"):
        count, listed = int(sum(code.rows.sum() for code in codes)), " and ".join(f"{code.value:.6g}" for code in codes)
        problem = f"{count} reading{'s' * (count > 1)} of exactly {listed} degC, far from those around: a fault code"
        in_file = (*source.invalid, *(_in_file(log, key, code) for code in codes))
        corrected = replace(source, invalid=tuple(dict.fromkeys(in_file)))
        remedy = "these readings are left out; to have it in the model file, write {}"
        issues.append(log.issue(key, problem, remedy, "code", corrected=corrected))
    if len(off) > _MANY:  # a sensor that is off again and again: all in one
        rows, middle = np.any([silence.rows for silence in off], axis=0), float(np.median([one.value for one in off]))
        off = [replace(off[0], value=middle, stop=off[-1].stop, rows=rows)]
    for silence in (*(one for one in silent if one.kind not in ("code", "disconnected")), *off):
        number, count = f"{silence.value + 0.0:.{3 if silence.kind == 'spike' else 6}g}", int(silence.rows.sum())
        when = log.when(silence.start, silence.stop)
        text = _SAID.get(silence.kind, f"{silence.kind} at {{number}} {{unit}} {{when}}")
        if silence.whole:
            moves = "the joint moves" if quantity_of(key) in INPUTS else "another one moves"
            if key in predicted and not any(s.least < s.most for other, s in log.sensors.items() if other in predicted):
                moves = "loads come and go"
            text = f"reads {{number}} {{unit}} throughout, {silence.stop - silence.start:.4g} s, while {moves}"
        problem = text.format(number=number, unit=unit, when=when, count=count, s="s" * (count > 1))
        if silence.column:
            problem = f"its column '{silence.column}' {'is ' * (not silence.whole)}{problem}"
        stretch, column = (silence.start, silence.stop), silence.column or source.columns[0]
        remedy = _done(log, key, silence, predicted)
        issues.append(Issue(key, column, problem, remedy, False, kind=silence.kind, stretch=stretch))
    return issues


def _done(log: Channels, key: str, silence: Silence, predicted: Collection[str]) -> str:
    """What is done with what a channel says in a silence, or what to write."""
    source, right = log.sources[key], f"if the column is right, write {log.believed(key)}, its valid range"
    if silence.kind == "wrap":
        meant = replace(source, wrap=float(f"{silence.value / abs(source.scale):.4g}"))
        return f"these readings are left out; to have a counter unwrapped, write {as_line_or_option(key, meant)}"
    if not silence.left_out:
        if silence.whole and key in predicted:
            return "no other sensor moves, so it counts all the same; if it is stuck, nothing can be concluded from it"
        gap = replace(source, invalid=(*source.invalid, _in_file(log, key, silence)))
        return f"it is used as it is; to have a gap there, write {as_line_or_option(key, gap)}"
    if not silence.lasts or key in predicted:
        return f"it is left out; {right}" if silence.whole else "these readings are left out"
    what = f"the heat of {place_of(key)}" if quantity_of(key) in INPUTS else "what it gives to the model"
    cut = "; map the column that has it" if silence.whole else " there, so that the log is cut"
    return f"{what} is not known{cut}; {right}"


def _in_file(log: Channels, key: str, silence: Silence) -> float:
    """The number that the file has in a silence."""
    return float(np.median(log.numbers[silence.column or log.sources[key].columns[0]][silence.rows]))


# --- Channels that contradict each other ------------------------------------------------------------

_BRAKES = 0.98  # of the work of a joint, that is taken up: legs and wheels that are driven brake in a part of it
_LEAST_POWER = 1.0  # W, on average: of less the sign is the noise's


def _suspect_power(log: Channels, key: str) -> list[Issue]:
    """A speed or a torque by whose product its joint would have a power that no joint has, or would always brake."""
    source, quantity = log.sources[key], quantity_of(key)
    torque, speed = (log.values.get(f"{one}.{place_of(key)}") for one in ("torque", "velocity"))
    if source.unit is not None or torque is None or speed is None:
        return []
    power = (torque * speed)[np.isfinite(torque * speed)]
    if power.size and quantity == "velocity":
        high = float(np.percentile(np.abs(power), 99))
        if high > PLAUSIBLE["power"].most and np.nanmax(np.abs(torque)) < PLAUSIBLE["torque"].most:
            problem = f"with the joint's torque a power of {high / 1000:.3g} kW, which looks like rpm, "
            return [log.in_unit(key, "rpm", problem + "or the speed of the rotor", certain=False)]
    work, braking = float(np.abs(power).sum()), -float(np.minimum(power, 0).sum())
    tells = quantity == "torque" and source.scale == 1 and work > _LEAST_POWER * power.size
    if tells and braking >= _BRAKES * work:
        problem = f"{braking / work:.0%} of its work with the joint's speed is braking, "
        problem += "which looks like a sign turned round"
        remedy = "write {}; if the joint is driven from outside, say the unit: what heats with the square heeds no sign"
        return [log.issue(key, problem, remedy, "sign", corrected=replace(source, scale=-1.0))]
    return []


def _suspect_gains(log: Channels, said: Collection[str]) -> list[Issue]:
    """Loads that from some row on heat their parts otherwise, in columns of which nothing else is said."""
    issues = list[Issue]()
    if "time" in said:
        return issues
    told = replace(log, values={key: x for key, x in log.values.items() if key not in said})
    for key in [key for quantity in HEATS for key in told.of(quantity) if not log.is_believed(key)]:
        part, change = f"temperature.{place_of(key)}", log.gains.get(key)
        if part not in told.values:
            continue
        if said or key not in log.gains:  # beside a channel in another unit a law is another
            change = gain_change(told, warming(told, part, key), part, key)
        if change is not None:
            start, stop = (float(log.time[row]) for row in change.rows)
            problem, remedy = f"roughly {log.when(start, stop)} it ", "say each part's unit"
            if change.ratio:
                problem += f"heats {part} {change.ratio:.2g} times as much as before for its square, "
                problem += "which looks like another unit there"
            else:
                problem, remedy = f"{problem}does not heat {part}, as it does in the rest of the log", "leave that out"
            remedy = f"cut the log there, and {remedy}; if the column is right, write {log.believed(key)}"
            issues.append(log.issue(key, problem, remedy, stretch=(start, stop)))
    return issues


def _suspect_exchange(log: Channels) -> list[Issue]:
    """Temperatures that follow the loads of each other's joints better than their own."""
    issues = list[Issue]()
    for quantity in HEATS:
        for place, of in exchanged(log, quantity, DOUBTED, AT_MOST)[0].items():
            key, load = f"temperature.{place}", f"{quantity}.{of}"
            if place != of and not log.is_believed(key):
                problem = f"follows {load} better than {quantity}.{place}: columns of joints are probably exchanged"
                remedy = f"map each to its own column; if they are right, write {log.believed(key)}"
                issues.append(log.issue(key, problem, remedy, "exchanged"))
    return issues


_FOLLOWS = 0.8  # share of the variance of an ambient that a joint's temperature explains, beside …
_SMOOTH = 3  # … powers of time: by chance a room may grow warm, or cool, as its robot does
_LEAST_FOLLOWED = 2.0  # K, by which the ambient rises: less is the room, which a robot may warm
_MOST_FOLLOWED = 0.9  # of a joint's warmth: what moves farther moves the joint


def _suspect_ambient(log: Channels) -> list[Issue]:
    """An ambient sensor that is warmed by a joint: it goes with how warm the joint is, or says the same."""
    if log.air not in log.values or log.is_believed(log.air) or log.block == 0:
        return []
    problem = ""
    for key in log.of("temperature"):
        table = np.stack([log.means("time"), log.means(log.air), log.means(key)])
        time, *both = table[:, np.isfinite(table).all(axis=0)]
        if key == log.air or time.size < FEWEST_ROWS or min(np.ptp(x) for x in both) < _LEAST_FOLLOWED:
            continue
        course = np.vander((time - time[0]) / np.ptp(time), _SMOOTH + 1)
        ambient, warmth = (x - course @ np.linalg.lstsq(course, x, rcond=None)[0] for x in both)
        correlation = float(np.corrcoef(ambient, warmth)[0, 1])
        slope = correlation * float(ambient.std() / warmth.std())
        if reads_alike(log, key, log.air):
            problem = f"the same readings as {key}"
        elif correlation > 0 and correlation**2 > _FOLLOWS and slope < _MOST_FOLLOWED:
            problem = f"rises with {key}, by {slope:.2g} K for each kelvin of its warmth"
        if problem:
            remedy = "is the sensor near that joint? What leaves to the air can't be fitted with it; use one further "
            remedy += 'away, or, for a log that begins at rest, ambient = "start" under [model]; if the room itself is '
            remedy += f"warmed, write {log.believed(log.air)}"
            return [log.issue(log.air, problem, remedy, "follows")]
    return []


def _suspect_few(log: Channels, predicted: Collection[str]) -> list[Issue]:
    """Temperatures of which there are so few readings that they tell next to nothing of their part."""
    counts = {key: int(np.isfinite(x).sum()) for key, x in log.of("temperature").items() if key in predicted}
    rows, remedy = log.time.size, "map its own column, or leave that out"
    return [
        log.issue(
            key, f"{n} reading{'s' * (n > 1)} in {rows} rows, which tell next to nothing of its part", remedy, "few"
        )
        for key, n in counts.items()
        if 0 < n < FEWEST_ROWS <= rows
    ]


# --- All that looks wrong in a log -----------------------------------------------------------------

_STILL = ("frozen", "clamped", "dead")


def issues_of(
    log: Channels, silent: Mapping[str, list[Silence]], twice: Mapping[str, str], predicted: Collection[str]
) -> tuple[Issue, ...]:
    """What looks wrong in a log's columns: another unit, a counter that wraps, a sensor that is dead.

    Of a column the first check that finds something speaks: a counter that wraps has values in no unit, and readings in
    another unit look like fault codes. `silent` is of `silent_channels`, `twice` of `duplicates`.
    """
    issues: list[Issue] = []
    of_columns = {key: suspect_wrap(log, key) or suspect_unit(log, key) for key in log.sources}
    for key, of_column in of_columns.items():
        said = silent.get(key, [])
        if of_column:
            # Readings in another unit look like those of no part; a converter rests at another number than 0, and what
            # turns has other ends.
            said = [one for one in said if one.kind in _STILL and of_column[0].kind not in ("counts", "wrap")]
        elif key.startswith(("torque.", "velocity.")) and not of_columns.get(f"torque.{place_of(key)}"):
            of_column = _suspect_power(log, key)
        issues += [*of_column, *_suspect_silence(log, key, said, predicted)]
    issues += [
        *copies_in(log, twice),
        *suspect_held(log),
        *_suspect_exchange(log),
        *_suspect_ambient(log),
        *_suspect_few(log, predicted),
    ]
    dead_air = any(one.whole for one in silent.get(log.air, []))
    if not dead_air and not any(quantity_of(issue.key) == "temperature" and issue.kind == "unit" for issue in issues):
        issues += suspect_starts(log)
    return (*issues, *_suspect_gains(log, {issue.key for issue in issues}))
