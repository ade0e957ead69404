"""Stretches in which a channel says nothing: its sensor stands still, is gone, or is at the end of its range.

A sensor that is alive shows its noise. One that gives bit for bit the same number for longer than its own noise and
steps allow is *frozen*; *clamped* where that is the highest or lowest number that it gives; *dead* where the number is
far from all around it, as 0 or full scale is. A torque that stands still, or is exactly zero while its joint moves, is
found in the same way. What a channel says in such a stretch is no reading.

What no heated part could have given is found in `passive.py`: spikes, codes, broken wires, counters that turn.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.logs.columns import AMBIENT, HEATS
from lptn.logs.law import SHORTEST, STILL, Blocks, against_heat, standing
from lptn.logs.passive import CODES, FEWEST, Kind, Silence, Surroundings, off, silence_at
from lptn.logs.scatter import off_their_neighbours, white_noise

CHANCE = 1e-6  # that a live sensor would ever give the same number for so long
_REPEATS = 0.02  # share of readings like the one before, below which a sensor shows all of its noise
_REVERSALS = 0.2  # share of changes that turn back: above it, what changes is noise; of a smooth rise there are none
_BY_TWO = 0.02
"""Of a sensor's moves, by two steps at once, where its noise is 0.35 of a step. With less it may give the number in the
middle of a step for ever, however lively it is near an edge."""
_SURELY = 1.64  # standard deviations of a count: so few moves by two steps may be chance in one sensor of twenty
_GAP = 10.0  # times the usual distance of readings, and a minute: none were logged for a while
_LAST_MOVES, _RESTS = 5, 0.125
"""Moves before a stretch, and the share of the usual move below which they are at rest; of white noise 3 in 1000."""
_CLEAR = 20  # readings without a touch: what is cut off of the noise then shifts the mean by a hundredth of it
_FAR = 10.0  # K from what was read before and after: a number that is dead, or a code


def silences(
    time: FloatArray, values: FloatArray, *, resolution: float = 0.0, temperature: bool = True
) -> list[Silence]:
    """Stretches in which a channel gives one number for longer than chance allows by its noise, in order of time.

    Args:
        time: (n,) s.
        values: (n,) in SI or degC, NaN where missing.
        resolution: the sensor's steps, 0 for none.
        temperature: whether it can be clamped, or dead at a number far from those around it; else it can be frozen.
    """
    there = np.flatnonzero(np.isfinite(values))
    # A topic that repeats itself until the next reading comes is read once a reading.
    there = there[:: int(np.median(np.diff(standing(values[there])[0], append=there.size))) if there.size else 1]
    readings = values[there]
    changes = np.diff(readings)[np.diff(readings) != 0]
    # Without noise it may stand for as long as the temperature does.
    if changes.size < FEWEST or (temperature and np.mean(changes[1:] * changes[:-1] < 0) <= _REVERSALS):
        return []
    first, last = standing(readings)
    spans = np.diff(np.stack([_logged(time[there])[rows] for rows in (first, last)]), axis=0)[0]
    repeated = int((last - first)[spans < SHORTEST].sum())
    stays = repeated / (repeated + changes.size)
    if resolution > 0:  # in the middle of a step, where noise shows least
        # By two steps at once, and back: what goes on that way is heated.
        by_two = np.count_nonzero((np.abs(changes[1:]) > 1.5 * resolution) & (changes[1:] * changes[:-1] < 0))
        shows = by_two - _SURELY * np.sqrt(by_two) >= _BY_TWO * changes.size
        noise = white_noise(off_their_neighbours(time[there], readings), resolution) if shows else 0.0
        stays = math.erf(resolution / noise / math.sqrt(8)) if noise > 0 else 1.0
    at_end = temperature & np.isin(readings[first], (readings.min(), readings.max()))
    at_end[[0, -1]] = False  # where the log begins or ends the joint may rest, and make no noise
    least = np.where(at_end, 0.0, SHORTEST if temperature and stays < _REPEATS else STILL)
    most = max(np.log(CHANCE) / np.log(np.clip(stays, _LEAST_STAYS, 1 - _LEAST_STAYS**2)), FEWEST)
    sizes, limits, stretches = np.abs(changes), set[float](), list[Silence]()
    for k in np.flatnonzero((spans >= least) & (last - first > most)):
        # Moves that die away are those of a filtered reading, that come to rest: a live sensor stops at once.
        before = sizes[k - _LAST_MOVES : k] if k >= _LAST_MOVES else sizes[k : k + _LAST_MOVES]
        if spans[k] < STILL and before.size and np.median(before) < _RESTS * np.median(sizes):
            continue
        one = _no_reading(time, values, int(there[first[k]]), int(there[last[k]]))
        if one.kind == "dead" and spans[k] < SHORTEST:
            continue
        if one.kind == "clamped" and temperature:
            limits.add(one.value)
        else:
            stretches.append(one if temperature else replace(one, kind="frozen"))
    for limit in limits:
        # Where noise only touches the limit, what is left of it is too high on average, or too low.
        touches = np.flatnonzero(readings == limit)
        for some in np.split(touches, np.flatnonzero(np.diff(touches) > _CLEAR) + 1):
            beside = _CLEAR if np.ptp(some) >= some.size else 0  # of a number that stands no noise is cut off
            ends = there[np.clip([some[0] - beside, some[-1] + beside], 0, there.size - 1)]
            rows = np.arange(values.size)
            stretches.append(silence_at(time, "clamped", limit, (rows >= ends[0]) & (rows <= ends[1])))
    return sorted(stretches, key=lambda stretch: stretch.start)


_LEAST_STAYS = 0.01  # share of repeats that any channel may have


def _no_reading(time: FloatArray, values: FloatArray, first: int, last: int) -> Silence:
    """What is no reading between two rows: dead if far from what is beside it, clamped at an end of the range."""
    rows = np.zeros(values.size, dtype=bool)
    rows[first : last + 1] = np.isfinite(values[first : last + 1])
    value, others = float(np.median(values[rows])), np.flatnonzero(np.isfinite(values) & ~rows)
    if np.ptp(values[rows]) > 0:
        return silence_at(time, "disconnected", value, rows)
    nearest = values[others[np.unique(np.clip(np.searchsorted(others, first) + np.array([-1, 0]), 0, others.size - 1))]]
    if (np.abs(nearest - value) > _FAR).all():
        return silence_at(time, "dead", value, rows)
    inside = values[others].min() < value < values[others].max()
    return silence_at(time, "frozen" if inside else "clamped", value, rows)


def _logged(stamps: FloatArray) -> FloatArray:
    """The time without gaps [s], shape (n,): nothing stands where nothing is read."""
    apart = np.diff(stamps)
    in_gap = apart > max(_GAP * float(np.median(apart)), SHORTEST) if apart.size else np.zeros(0, dtype=bool)
    return np.concatenate(([0.0], np.cumsum(np.where(in_gap, 0.0, apart))))


# --- A sensor's steps -----------------------------------------------------------------------------


_FINEST, _COARSEST = 0.02, 5.0  # K; finer is the file's rounding, coarser is a fault code such as 85 or 0
_RETURNS = 3  # times that each level returns on average, before a grid is believed
_OFF_GRID = 0.02  # of the step, by which a level may lie beside the grid


def quantisation_step(values: FloatArray) -> float:
    """The step, K, of the regular grid on which raw readings sit; 0.0 if there is none.

    A grid is believed when each level returns three times on average, and all levels fit it within 2 %.

    Args:
        values: (n,) raw readings, K or degC; NaN is left out.
    """
    readings = values[np.isfinite(values)]
    # float32 and unit conversion blur the last digits; pandas needs no sorting of millions of rows
    levels = np.sort(pd.unique(np.round(readings, 4)))
    if levels.size < 2 or readings.size < _RETURNS * levels.size:
        return 0.0
    gaps = np.diff(levels)
    step = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
    counts = np.round(gaps / step)
    step = float(gaps.sum() / counts.sum())
    regular = np.abs(gaps - counts * step).max() <= _OFF_GRID * step
    return float(f"{step:.4g}") if regular and _FINEST <= step <= _COARSEST else 0.0


# --- A whole log ----------------------------------------------------------------------------------


def silences_of(values: Mapping[str, FloatArray]) -> dict[str, list[Silence]]:
    """Stretches in which sensors, torques, currents or speeds say nothing, spikes, and codes, by quantity.

    Args:
        values: time [s] and the quantities, (n,) each, in SI and degC.
    """
    time, still, around = values["time"], _still_throughout(values), _surroundings(values)
    silent: dict[str, list[Silence]] = {}
    speeds = {key: np.abs(channel) for key, channel in values.items() if key.startswith("velocity.")}
    resting = np.zeros(time.size)
    of_all = np.max(list(speeds.values()), axis=0) if speeds else resting  # a motor's may stand at its housing
    # Speeds first: a joint of which nobody knows whether it moves may have no torque.
    for key in sorted(values, key=lambda key: key not in speeds):
        quantity, _, place = key.partition(".")
        if quantity == "temperature":
            silent[key] = still.get(key) or silences(time, values[key], resolution=quantisation_step(values[key]))
        elif key in speeds:
            silent[key] = _of_input(time, values[key], speeds[key], resting, _AT_REST)
        elif quantity in HEATS:
            speed = f"velocity.{place}"
            moving = without_silent(speeds.get(speed, resting), silent.get(speed, []))
            silent[key] = _of_input(time, values[key], speeds.get(speed, of_all), moving)
    steps = {key: quantisation_step(values[key]) for key in around.keys() - still.keys()}

    def off_beside(key: str) -> list[Silence]:
        return off(time, without_silent(values[key], silent[key]), steps[key], around[key])

    outside = {key: off_beside(key) for key in steps}
    said = {key: [*stretches, *outside.get(key, [])] for key, stretches in silent.items()}
    blocks = Blocks({key: without_silent(channel, said.get(key, [])) for key, channel in values.items()})
    for key, step in steps.items():
        load = next((load for quantity in HEATS if (load := f"{quantity}.{key.partition('.')[2]}") in values), "")
        channel = without_silent(values[key], [*silent[key], *(one for one in outside[key] if not one.lasts)])
        if load and (stretches := against_heat(blocks.with_channel(key, channel), key, load, step)):
            silent[key] += [_no_reading(time, channel, *stretch) for stretch in stretches]
            outside[key] = off_beside(key)
        silent[key] += outside[key]
    return {key: stretches for key, stretches in silent.items() if stretches}


_MOVING = 0.05  # rad/s, mean of |speed|: a joint that moves
_AT_REST = 0.01  # rad/s: an encoder's noise, and so little that friction of 10 N·m makes 0.1 W of it


def _of_input(
    time: FloatArray, channel: FloatArray, speed: FloatArray, moving: FloatArray, at_rest: float = 0.0
) -> list[Silence]:
    """Stretches in which a torque, a current or a speed stands without its joint being at rest.

    Once is a fault, again and again at other numbers is a column's way: it gives what was asked for, as commanded and
    simulated torques do. A fault that comes twice looks the same, unless the joint moves.

    Args:
        time: s, (n,).
        channel: in SI, (n,).
        speed: size of its joint's speed, or of that of all, (n,).
        moving: size of its joint's speed where that is known, (n,).
        at_rest: what it gives at rest at the most: a speed fails at what it said last, which is seldom so little.
    """
    stands, rows = silences(time, channel, temperature=False), np.isfinite(channel)
    if not stands and rows.sum() >= FEWEST and not channel[rows].any() and _logged(time[rows])[-1] >= STILL:
        # Nothing but zero, as of drives that don't measure what they are asked for.
        stands = [silence_at(time, "frozen", 0.0, rows, whole=True)]
    loaded = {one.value for one in stands if abs(one.value) > at_rest}
    said = []
    for one in stands:
        known = moving[one.rows][np.isfinite(moving[one.rows])]
        moves = known.size > 0 and float(known.mean()) > _MOVING
        if moves or (loaded == {one.value} and not _only_while_it_rests(time, channel, speed, one)):
            said.append(one)
    return said


def of_sensor(time: FloatArray, values: FloatArray) -> list[Silence]:
    """What a temperature sensor says that is no reading, for all that is known of it alone; (n,) s and degC."""
    resolution = quantisation_step(values)
    stands = silences(time, values, resolution=resolution)
    return [*stands, *off(time, without_silent(values, stands), resolution)]


_OF_MOST = 0.05  # of what goes with the heat of the joint that has most: with less a part is warmed by its neighbours
_LOW, _THIN = 0.05, 10_000  # share of readings, below which a channel seldom is; readings that tell it


def loads_of(values: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Torque or current of each place of which a part's own heat goes with the square, (n,) each; as logged."""
    loads: dict[str, FloatArray] = {}
    for quantity in reversed(HEATS):
        own = {key.partition(".")[2]: channel for key, channel in values.items() if key.startswith(f"{quantity}.")}
        thin = {place: channel[:: max(1, channel.size // _THIN)] for place, channel in own.items()}
        power = {place: float(np.nanmean(np.square(x))) for place, x in thin.items() if np.isfinite(x).any()}
        most = max(power.values(), default=0.0)
        loads |= {place: own[place] for place, mean in power.items() if mean > _OF_MOST * most}
    return loads


def _surroundings(values: Mapping[str, FloatArray]) -> dict[str, Surroundings]:
    """What the channels of a log say of each temperature."""
    read = {key: channel[np.isfinite(channel)] for key, channel in values.items() if key.startswith("temperature.")}
    read = {key: readings for key, readings in read.items() if readings.size}
    starts = {key: float(readings[0]) for key, readings in read.items()}
    lows = {key: float(np.quantile(x[:: max(1, x.size // _THIN)], _LOW)) for key, x in read.items()}
    loads = loads_of(values)
    around = {}
    for key in read:
        place = key.partition(".")[2]
        others = [other for other in read if other != key]
        start = float(np.median([starts[other] for other in others])) if others else np.nan
        coldest = min((lows[other] for other in others), default=-np.inf)
        around[key] = Surroundings(start, coldest, loads.get(place), heated=key != AMBIENT)
    return around


_STUCK = 600.0  # s
_MOVED_APART, _MOVED_STEPS = 3.0, 5.0
"""K, and steps of the coarsest of the others, by which another temperature moves while this one gives one number: a
motor that idles beside one that works warms by a part of that."""


def _still_throughout(values: Mapping[str, FloatArray]) -> dict[str, list[Silence]]:
    """Temperatures that are one number throughout while another one moves.

    People write one number for the room: that is dead where it is a fault code, and the robot begins elsewhere.
    """
    read = {key: readings[np.isfinite(readings)] for key, readings in values.items() if key.startswith("temperature.")}
    ranges = {key: float(np.ptp(readings)) for key, readings in read.items() if readings.size}
    if all(ranges.values()):
        return {}
    moving = [read[key] for key, extent in ranges.items() if extent]
    least = max(_MOVED_APART, *(_MOVED_STEPS * quantisation_step(readings) for readings in moving), 0.0)
    still: dict[str, list[Silence]] = {}
    for key in (key for key, extent in ranges.items() if not extent and max(ranges.values()) > least):
        rows, value = np.isfinite(values[key]), float(read[key][0])
        a_code = value in CODES and all(abs(readings[0] - value) > _FAR for readings in moving)
        if rows.sum() > 2 and _logged(values["time"][rows])[-1] >= _STUCK and (key != AMBIENT or a_code):
            kind: Kind = "dead" if key == AMBIENT else "frozen"
            still[key] = [silence_at(values["time"], kind, value, rows, whole=True)]
    return still


def _only_while_it_rests(time: FloatArray, values: FloatArray, speed: FloatArray, silence: Silence) -> bool:
    """Whether a number stands while its joint rests, and no longer: it moves, or bears another load, before and after.

    A joint that holds a load needs the same torque all the while; a fault keeps no such hours, and what a channel says
    as it fails is what it said before.
    """
    before = np.flatnonzero((time >= silence.start - SHORTEST) & (time < silence.start))
    after = np.flatnonzero((time > silence.stop) & (time <= silence.stop + SHORTEST))
    beside = [(rows, rows[nearest]) for rows, nearest in ((before, -1), (after, 0)) if rows.size]
    changes = [speed[nearest] >= _AT_REST or np.ptp(values[rows]) == 0 for rows, nearest in beside]
    return bool(beside) and all(changes) and bool((speed[silence.rows] < _AT_REST).all())


def without_silent(values: FloatArray, silent: list[Silence]) -> FloatArray:
    """A channel's values, NaN where it is silent."""
    return np.where(np.any([stretch.rows for stretch in silent], axis=0), np.nan, values) if silent else values
