"""Stretches in which a channel says nothing: its sensor stands still, is gone, or is at the end of its range.

A sensor that is alive shows its noise. One that gives bit for bit the same number for longer than its own noise and
steps allow is *frozen*; *clamped* where that is the highest or lowest number that it gives; *dead* where the number is
far from all around it, as 0 or full scale is. A torque that stands still, or is exactly zero while its joint moves, is
found in the same way. What a channel says in such a stretch is no reading.

What no heated part could have given is found in `passive.py`: spikes, codes, broken wires, counters that turn.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from lptn.basics.arrays import FloatArray, IntArray
from lptn.logs.channels import (
    FEWEST,
    GAP,
    NEARLY_ALL,
    SHORTEST,
    STILL,
    Channels,
    Kind,
    Silence,
    few_of,
    spans,
    standing,
    usual_length,
    without_silent,
)
from lptn.logs.columns import HEATS, INPUTS, place_of, quantity_of
from lptn.logs.law import against_heat
from lptn.logs.passive import off
from lptn.logs.plausible import ALIKE, AT_REST, CODES, FAR, MOVING
from lptn.logs.scatter import off_their_neighbours, white_noise

CHANCE = 1e-6  # that a live sensor would ever give the same number for so long
_REPEATS = 0.02  # share of readings like the one before, below which a sensor shows all of its noise
_LEAST_STAYS = 0.01  # share of repeats that any channel may have
_REVERSALS = 0.2  # share of changes that turn back: above it, what changes is noise; of a smooth rise there are none
_BY_TWO = 0.02
"""Of a sensor's moves, by two steps at once, where its noise is 0.35 of a step. With less it may give the number in the
middle of a step for ever, however lively it is near an edge."""
_SURELY = 1.64  # standard deviations of a count: so few moves by two steps may be chance in one sensor of twenty
_LAST_MOVES, _RESTS = 5, 0.125
"""Moves before a stretch, and the share of the usual move below which they are at rest; of white noise 3 in 1000."""
_CLEAR = 20  # readings without a touch: what is cut off of the noise then shifts the mean by a hundredth of it
_BENT, _TIMES_USUAL = 1e-9, 3.0  # of a channel's largest slope, by which a line may bend; times its lines' usual length


def silences(
    time: FloatArray, values: FloatArray, *, resolution: float = 0.0, temperature: bool = True
) -> list[Silence]:
    """Stretches in which a channel gives one number for longer than chance allows by its noise, in order of time.

    Times are (n,) s, values (n,) in SI or degC, NaN where missing, in steps of `resolution`, 0 for none. A temperature
    can be clamped, or dead at a number far from those around it; any other channel can be frozen.
    """
    there = np.flatnonzero(np.isfinite(values))
    # A topic that repeats itself until the next reading comes is read once a reading.
    there = there[:: usual_length(np.diff(standing(values[there])[0], append=there.size))[0]]
    readings = values[there]
    changes = np.diff(readings)[np.diff(readings) != 0]
    back = changes[1:] * changes[:-1] < 0
    # Without noise it may stand for as long as the temperature does.
    if changes.size < FEWEST or (temperature and np.mean(back) <= _REVERSALS):
        return []
    first, last = standing(readings)
    logged = _logged(time[there])
    lengths, sizes = logged[last] - logged[first], np.abs(changes)
    repeated = int((last - first)[lengths < SHORTEST].sum())
    stays = repeated / (repeated + changes.size)
    if resolution > 0:  # in the middle of a step, where noise shows least
        # By two steps at once, and back: what goes on that way is heated.
        by_two = np.count_nonzero((sizes[1:] > 1.5 * resolution) & back)
        shows = by_two - _SURELY * np.sqrt(by_two) >= _BY_TWO * changes.size
        noise = white_noise(off_their_neighbours(time[there], readings), resolution) if shows else 0.0
        stays = math.erf(resolution / noise / math.sqrt(8)) if noise > 0 else 1.0
    at_end = temperature & np.isin(readings[first], (readings.min(), readings.max()))
    at_end[[0, -1]] = False  # where the log begins or ends the joint may rest, and make no noise
    least = np.where(at_end, 0.0, SHORTEST if temperature and stays < _REPEATS else STILL)
    most = max(np.log(CHANCE) / np.log(np.clip(stays, _LEAST_STAYS, 1 - _LEAST_STAYS**2)), FEWEST)
    found = list[Silence]()
    for k in np.flatnonzero((lengths >= least) & (last - first > most)):
        # Moves that die away are those of a filtered reading, that come to rest: a live sensor stops at once.
        before = sizes[k - _LAST_MOVES : k] if k >= _LAST_MOVES else sizes[k : k + _LAST_MOVES]
        if lengths[k] < STILL and before.size and np.median(before) < _RESTS * np.median(sizes):
            continue
        one = _no_reading(time, values, int(there[first[k]]), int(there[last[k]]))
        if one.kind != "dead" or lengths[k] >= SHORTEST:
            found.append(one if temperature else replace(one, kind="frozen"))
    found += _lines(time, values, there)
    limits = {one.value for one in found if one.kind == "clamped"}
    found = [one for one in found if one.kind != "clamped"]
    for limit in limits:
        # Where noise only touches the limit, what is left of it is too high on average, or too low.
        touches = np.flatnonzero(readings == limit)
        for some in np.split(touches, np.flatnonzero(np.diff(touches) > _CLEAR) + 1):
            beside = _CLEAR if np.ptp(some) >= some.size else 0  # of a number that stands no noise is cut off
            begin, end = there[np.clip([some[0] - beside, some[-1] + beside], 0, there.size - 1)]
            found.append(Silence.at(time, "clamped", limit, np.arange(begin, end + 1)))
    return sorted(found, key=lambda one: one.start)


def _lines(time: FloatArray, values: FloatArray, there: IntArray) -> list[Silence]:
    """Stretches of straight lines, of readings in rows `there`, (m,): what was filled in between two of them.

    Where somebody put the whole channel on another clock so, lines between readings are as long as usual.
    """
    apart = np.diff(time[there])
    if not (apart > 0).all():  # a log that is refused for its times
        return []
    slopes = np.diff(values[there]) / apart
    straight = np.abs(np.diff(slopes)) <= _BENT * np.abs(slopes).max(initial=0.0)
    lines = np.array(spans(straight & (slopes[1:] != 0)), np.int64).reshape(-1, 2)
    rows = lines[:, 1] - lines[:, 0]
    usual = np.quantile(np.append(rows, np.ones(np.count_nonzero(~straight))), NEARLY_ALL) if rows.size else 0.0
    long = (rows >= max(FEWEST, _TIMES_USUAL * usual)) & (
        time[there[lines[:, 1] + 1]] - time[there[lines[:, 0]]] >= SHORTEST
    )
    found = [there[first : last + 2] for first, last in lines[long].tolist()]
    return [Silence.at(time, "interpolated", float(np.median(values[one])), one) for one in found]


def _no_reading(time: FloatArray, values: FloatArray, first: int, last: int) -> Silence:
    """What is no reading between two rows: dead if far from what is beside it, clamped at an end of the range."""
    there = np.flatnonzero(np.isfinite(values))
    begin, end = np.searchsorted(there, [first, last + 1])
    rows, beside = there[begin:end], values[[*there[:begin][-1:], *there[end:][:1]]]
    value, moves = float(np.median(values[rows])), np.ptp(values[rows]) > 0
    if not moves and (np.abs(beside - value) > FAR).all():
        return Silence.at(time, "dead", value, rows)
    at_end = value in (values[there].min(), values[there].max())
    return Silence.at(time, "disconnected" if moves else "clamped" if at_end else "frozen", value, rows)


def _logged(stamps: FloatArray) -> FloatArray:
    """The time without gaps [s], shape (n,): nothing stands where nothing is read."""
    apart = np.diff(stamps)
    in_gap = apart > max(GAP * float(np.median(few_of(apart))), SHORTEST) if apart.size else np.zeros(0, dtype=bool)
    return np.concatenate(([0.0], np.cumsum(np.where(in_gap, 0.0, apart))))


# --- A whole log ----------------------------------------------------------------------------------

_STUCK = 600.0  # s
_MOVED_STEPS = 5.0
"""Of the coarsest of the others, by which another temperature moves while this one gives one number: a motor that idles
beside one that works warms by a part of that."""


_FEW_OR_MOST, _WORKS = (0.1, 0.9), 10.0
"""Shares of a log, and times by which a load's square is more for one of them than for the other where it works."""


def silences_of(log: Channels) -> dict[str, list[Silence]]:
    """Stretches in which sensors, torques, currents or speeds say nothing, spikes, and codes, by quantity."""
    time, resting = log.time, np.zeros(log.time.size)
    speeds = {key: np.abs(channel) for key, channel in log.of("velocity").items()}
    of_all = np.max(list(speeds.values()), axis=0) if speeds else resting  # a motor's may stand at its housing
    # Speeds first: a joint of which nobody knows whether it moves may have no torque.
    held = {key for key, source in log.sources.items() if source.hold}  # logged on change: they stand by their entry
    inputs = {key: x for key, x in log.values.items() if quantity_of(key) in INPUTS and key not in held}
    silent = {
        key: _of_input(time, inputs[key], speed, resting, AT_REST) for key, speed in speeds.items() if key in inputs
    }
    for key, effort in ((key, x) for key, x in inputs.items() if quantity_of(key) in HEATS):
        speed = f"velocity.{place_of(key)}"
        moving = without_silent(speeds.get(speed, resting), silent.get(speed, []))
        silent[key] = _of_input(time, effort, speeds.get(speed, of_all), moving)
    silent |= _still_throughout(log)
    outside = dict[str, list[Silence]]()
    for key in log.sensors.keys() - silent.keys():
        silent[key] = silences(time, log.values[key], resolution=log.sensors[key].step)
        outside[key] = off(log, key, without_silent(log.values[key], silent[key]))
    cleaned = log.without({key: [*some, *outside.get(key, [])] for key, some in silent.items()})
    for key, load in ((key, log.load_of(place_of(key))) for key in outside):
        channel = without_silent(log.values[key], [*silent[key], *(one for one in outside[key] if not one.lasts)])
        one_off = cleaned.with_channels({key: channel})
        if load and (stretches := against_heat(one_off, key, load, log.sensors[key].step)):
            silent[key] += [_no_reading(time, channel, *stretch) for stretch in stretches]
            outside[key] = off(log, key, without_silent(log.values[key], silent[key]))
        silent[key] += outside[key]
    return {key: some for key in log.values if (some := silent.get(key))}


def _of_input(
    time: FloatArray, channel: FloatArray, speed: FloatArray, moving: FloatArray, at_rest: float = 0.0
) -> list[Silence]:
    """Stretches in which a torque, a current or a speed stands without its joint being at rest.

    Once is a fault, again and again at other numbers is a column's way: it gives what was asked for, as commanded and
    simulated torques do. A fault that comes twice looks the same, unless the joint moves.

    The size of its joint's speed, or of that of all, and where it is known that of its joint, are (n,) as the channel.
    At rest it gives `at_rest` at the most: a speed fails at what it said last, which is seldom so little.
    """
    stands, rows = silences(time, channel, temperature=False), np.isfinite(channel)
    if not stands and rows.sum() >= FEWEST and not channel[rows].any() and _logged(time[rows])[-1] >= STILL:
        # Nothing but zero, as of drives that don't measure what they are asked for.
        stands = [Silence.at(time, "frozen", 0.0, rows, whole=True)]
    loaded = {one.value for one in stands if abs(one.value) > at_rest}

    def is_said(one: Silence) -> bool:
        known = moving[one.rows][np.isfinite(moving[one.rows])]
        moves = known.size > 0 and float(known.mean()) > MOVING
        return moves or (loaded == {one.value} and not _only_while_it_rests(time, channel, speed, one))

    return [one for one in stands if is_said(one)]


def _only_while_it_rests(time: FloatArray, values: FloatArray, speed: FloatArray, silence: Silence) -> bool:
    """Whether a number stands while its joint rests, and no longer: it moves, or bears another load, before and after.

    A joint that holds a load needs the same torque all the while; a fault keeps no such hours, and what a channel says
    as it fails is what it said before.
    """
    before = np.flatnonzero((time >= silence.start - SHORTEST) & (time < silence.start))
    after = np.flatnonzero((time > silence.stop) & (time <= silence.stop + SHORTEST))
    beside = [(rows, rows[nearest]) for rows, nearest in ((before, -1), (after, 0)) if rows.size]
    changes = [speed[nearest] >= AT_REST or np.ptp(values[rows]) == 0 for rows, nearest in beside]
    return bool(beside) and all(changes) and bool((speed[silence.rows] < AT_REST).all())


def _still_throughout(log: Channels) -> dict[str, list[Silence]]:
    """Temperatures that are one number throughout while another one moves, or all while a load comes and goes.

    People write one number for the room: that is dead where it is a fault code, and the robot begins elsewhere.
    """
    stuck = {key: sensor.first for key, sensor in log.sensors.items() if sensor.least == sensor.most}
    moving = [sensor for key, sensor in log.sensors.items() if key not in stuck]
    least = max(ALIKE, *(_MOVED_STEPS * sensor.step for sensor in moving), 0.0)
    told, still = any(sensor.most - sensor.least > least for sensor in moving), dict[str, list[Silence]]()
    if not told and log.block and stuck.keys() | {log.air} == log.sensors.keys() | {log.air}:
        of_loads = [log.means(log.load_of(place)) for place in log.loads]
        few_most = [np.nanquantile(x, _FEW_OR_MOST) for x in of_loads if np.isfinite(x).any()]
        told = any(most > _WORKS * few for few, most in few_most)
    for key, value in stuck.items() if told else ():
        rows = np.isfinite(log.values[key])
        a_code = value in CODES and all(abs(sensor.first - value) > FAR for sensor in moving)
        if rows.sum() > 2 and _logged(log.time[rows])[-1] >= _STUCK and (key != log.air or a_code):
            kind: Kind = "dead" if key == log.air else "frozen"
            still[key] = [Silence.at(log.time, kind, value, rows, whole=True)]
    return still
