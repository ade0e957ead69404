"""Stretches in which a channel says nothing: its sensor stands still, is gone, or is at the end of its range.

A sensor that is alive shows its noise. One that gives bit for bit the same number for longer than its own noise and
steps allow is *frozen*; *clamped* where that is the highest or lowest number that it gives, and one that it gives again
and again; *dead* where the number is far from all around it, as 0 or full scale is. A torque that stands still, or is
exactly zero while its joint moves, is found in the same way. What a channel says in such a stretch is no reading.

What no heated part could have given is found in `passive.py`: spikes, codes, broken wires, counters that turn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.logs.columns import AMBIENT, HEATS, INPUTS
from lptn.logs.law import SHORTEST, STILL, Blocks, against_heat
from lptn.logs.passive import CODES, Kind, Silence, Surroundings, off, silence_at
from lptn.logs.resampling import means_of_blocks

CHANCE = 1e-6  # that a live sensor would ever give the same number for so long
_REPEATS = 0.02  # share of readings like the one before, below which a sensor shows all of its noise
_REVERSALS = 0.2  # share of changes that turn back: above it, what changes is noise; of a smooth rise there are none
_LIVELY = 0.7  # share of readings like the one before, up to which a sensor without steps shows its noise
_BY_TWO, _STAYS = 0.02, 0.85
"""Where noise is 0.35 of a sensor's steps, such a share of its moves is by two steps at once, and a temperature in the
middle of a step, where it shows least, gives the same number with this chance. With less noise it may do so for ever,
however lively the sensor is near an edge."""
_GAP = 10.0  # times the usual distance of readings, and a minute: none were logged for a while
_SURELY = 1.64  # standard deviations of a count: so few moves by two steps may be chance in one sensor of twenty
_LONGER = 20.0  # times the median time that a number stands: topics that repeat themselves stand for long
_LAST_MOVES, _RESTS = 5, 0.125
"""Readings before a stretch, and the share of the usual move below which they are at rest; of white noise 3 in 1000."""
_TOUCHES = 30  # readings at the end of a channel's range: of so many noise of half a step would lead beyond
_PILED, _NEXT, _NOISY = 2.0, 8.0, 0.5  # times the readings of the next number; noise to it; steps, as noise
_TURNS = 0.5  # share of readings that are noise, as `_back_and_forth` counts it; of swings over ten readings 0.4
_CLEAR = 20  # readings without a touch: what is cut off of the noise then shifts the mean by a hundredth of it
_FAR = 10.0  # K from what was read before and after: a number that is dead, or a code
_FEWEST = 20  # readings, to know what a sensor is like


def silences(
    time: FloatArray, values: FloatArray, *, resolution: float = 0.0, temperature: bool = True
) -> list[Silence]:
    """Stretches in which a channel is silent, in order of time.

    Args:
        time: (n,) s.
        values: (n,) in SI or degC, NaN where missing.
        resolution: the sensor's steps, 0 for none.
        temperature: whether it can be clamped, or dead at a number far from those around it; else it can be frozen.
    """
    there = np.flatnonzero(np.isfinite(values))
    if there.size < _FEWEST:
        return []
    readings = values[there]
    in_gap, logged = _gaps(time[there])
    moves = np.diff(readings)
    changes = np.flatnonzero(moves != 0)
    first, last = np.append(0, changes + 1), np.append(changes, readings.size - 1)
    spans = logged[last] - logged[first]
    stretches: list[Silence] = []

    def add(kind: Kind, begin: int, end: int, value: float) -> None:
        rows = np.zeros(values.size, dtype=bool)
        rows[there[begin] : there[end] + 1] = True
        stretches.append(silence_at(time, kind, value, rows))

    for limit in _limits(readings, resolution) if temperature else ():
        # Where noise only touches the limit, what is left of it is too high on average, or too low.
        touches = np.flatnonzero(readings == limit)
        for some in np.split(touches, np.flatnonzero(np.diff(touches) > _CLEAR) + 1):
            add("clamped", max(int(some[0]) - _CLEAR, 0), min(int(some[-1]) + _CLEAR, readings.size - 1), limit)
    rests = (spans >= SHORTEST) & (readings[first] == 0) & (not temperature)  # joints that stand say so for long
    repeated = int((last - first)[spans < SHORTEST].sum())
    steps = repeated + first.size - 1  # from reading to reading, but for those in long stretches
    never_repeats = temperature and steps >= _FEWEST and repeated < _REPEATS * steps
    usual = float(np.median(np.abs(moves[changes]))) if changes.size else 0.0
    few = np.log(CHANCE) / np.log(_STAYS) if resolution > 0 else 0.0  # repeats that any such sensor shows
    for k in np.flatnonzero((spans >= (SHORTEST if never_repeats else STILL)) & (last - first > few)):
        begin, end = first[k], last[k]
        if any(stretch.rows[there[begin]] for stretch in stretches):
            continue
        # Moves that die away are those of a filtered reading, that come to rest: a live sensor stops at once.
        before = np.abs(moves[max(begin - _LAST_MOVES, 0) : begin])
        before = before if before.size == _LAST_MOVES else np.abs(moves[end : end + _LAST_MOVES])
        if spans[k] < STILL and before.size and np.median(before) < _RESTS * usual:
            continue
        alive = ~in_gap  # of the steps from each reading to the next
        for span in (k, *np.flatnonzero(rests)):
            alive[max(first[span] - 1, 0) : last[span] + 1] = False
        longest = _longest(moves[alive], resolution, temperature, np.delete(spans, k))
        if end - begin > longest.readings and spans[k] > longest.seconds:
            beside = readings[[at for at in (begin - 1, end + 1) if 0 <= at < readings.size]]
            far = temperature and beside.size > 0 and bool((np.abs(beside - readings[begin]) > _FAR).all())
            add("dead" if far else "frozen", begin, end, float(readings[begin]))
    return sorted(stretches, key=lambda stretch: stretch.start)


def _gaps(stamps: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Which steps from reading to reading are gaps, shape (n − 1,), and the time without these [s], shape (n,).

    Nothing stands where nothing is read.
    """
    apart = np.diff(stamps)
    in_gap = apart > max(_GAP * float(np.median(apart)), SHORTEST) if apart.size else np.zeros(0, dtype=bool)
    return in_gap, np.concatenate(([0.0], np.cumsum(np.where(in_gap, 0.0, apart))))


class _Longest(NamedTuple):
    """For how many readings, and how long, a live channel may give one number."""

    readings: float = 0.0
    seconds: float = 0.0


def _longest(steps: FloatArray, resolution: float, temperature: bool, spans: FloatArray) -> _Longest:
    """For how long a live sensor may stand that otherwise makes these steps from reading to reading.

    Args:
        steps: (m,).
        resolution: the sensor's steps, 0 for none.
        temperature: whether it may stand when it has risen, as one that is filtered does.
        spans: for how long its other numbers stand [s].
    """
    moves = steps[steps != 0]
    if moves.size < _FEWEST:
        return _Longest(np.inf)
    alike = 1.0 - moves.size / steps.size
    noisy = float(np.mean(np.sign(moves[1:]) != np.sign(moves[:-1]))) > _REVERSALS
    lively = alike <= _LIVELY
    if resolution > 0:
        # By two steps at once, and back: what goes on that way is heated.
        by_two = np.count_nonzero((np.abs(moves[1:]) > 1.5 * resolution) & (moves[1:] * moves[:-1] < 0))
        alike, lively = _STAYS, by_two - _SURELY * np.sqrt(by_two) >= _BY_TWO * moves.size
    if lively and (noisy or not temperature):
        return _Longest(np.log(CHANCE) / np.log(max(alike, 0.01)))
    if noisy and resolution == 0:  # a topic that repeats itself until the next reading comes
        return _Longest(seconds=_LONGER * float(np.median(spans)))
    return _Longest(np.inf)  # a sensor of coarse steps may stand for as long as the temperature does


def _limits(readings: FloatArray, resolution: float) -> list[float]:
    """The highest and the lowest number of a noisy channel, where they stand so often that noise is cut off there."""
    moves, limits = np.diff(readings), []
    for limit in (float(readings.max()), float(readings.min())):
        away = np.abs(readings - limit)
        inside = moves[(away[1:] > 0) & (away[:-1] > 0)]
        noise = float(np.median(np.abs(inside))) if inside.size else 0.0
        # Its steps may hide whether it is alive, and what moves in long swings comes to rest at their ends.
        if noise == 0 or noise < _NOISY * resolution or _back_and_forth(inside) < _TURNS * inside.size:
            continue
        edges = np.flatnonzero(np.diff(away > 0))  # noise comes and goes there; a code is far from what is beside it
        if edges.size and float(np.median(np.maximum(away[edges], away[edges + 1]))) > _NEXT * noise:
            continue
        beyond = float(np.min(away, where=away > 0, initial=np.inf))
        at, near = (np.count_nonzero(away <= size) for size in (0.0, beyond))
        if at >= _TOUCHES and at >= _PILED * (near - at) and beyond < _NEXT * noise:
            limits.append(limit)
    return limits


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


_MOVING = 0.05  # rad/s, mean of |speed|: a joint that moves
_AT_REST = 0.01  # rad/s: an encoder's noise, and so little that friction of 10 N·m makes 0.1 W of it


def silences_of(values: Mapping[str, FloatArray]) -> dict[str, list[Silence]]:
    """Stretches in which sensors, torques, currents or speeds say nothing, spikes, and codes, by quantity.

    Args:
        values: time [s] and the quantities, (n,) each, in SI and degC.
    """
    silent: dict[str, list[Silence]] = {}
    still, around = _still_throughout(values), _surroundings(values)
    speeds = [np.abs(velocity) for key, velocity in values.items() if key.startswith("velocity.")]
    of_all = np.max(speeds, axis=0) if speeds else np.zeros(values["time"].size)  # a motor's may stand at its housing
    # Speeds first: a joint of which nobody knows whether it moves may have no torque.
    for key in sorted(values, key=lambda key: not key.startswith("velocity.")):
        channel, (quantity, _, place) = values[key], key.partition(".")
        if quantity == "temperature":
            silent[key] = still.get(key) or silences(values["time"], channel, resolution=quantisation_step(channel))
        elif quantity in INPUTS:
            speed = f"velocity.{place}"
            moving = without_silent(values.get(speed, np.zeros(channel.size)), silent.get(speed, []))
            stands = silences(values["time"], channel, temperature=False)
            rows = np.isfinite(channel)
            if (
                not stands
                and rows.sum() >= _FEWEST
                and not channel[rows].any()
                and _gaps(values["time"][rows])[1][-1] >= STILL
            ):
                # Nothing but zero, as of drives that don't measure what they are asked for.
                stands = [silence_at(values["time"], "frozen", 0.0, rows, whole=True)]
            # Once is a fault, again and again at other numbers is a column's way: it gives what was asked for, as
            # commanded and simulated torques do. A fault that comes twice looks the same, unless the joint moves.
            several = len({one.value for one in stands if not _is_rest(quantity, one)}) > 1
            silent[key] = [
                one
                for one in stands
                if (_moves(moving, one) and key != speed)
                or not (
                    _is_rest(quantity, one)
                    or several
                    or _only_while_it_rests(values["time"], channel, values.get(speed, of_all), one)
                )
            ]
    steps = {key: quantisation_step(values[key]) for key in around.keys() - still.keys()}

    def off_beside(key: str) -> list[Silence]:
        return off(values["time"], without_silent(values[key], silent[key]), steps[key], around[key])

    outside = {key: off_beside(key) for key in steps}
    said = {key: [*stretches, *outside.get(key, [])] for key, stretches in silent.items()}
    blocks = Blocks({key: without_silent(channel, said.get(key, [])) for key, channel in values.items()})
    for key, resolution in steps.items():
        loads = [f"{quantity}.{key.partition('.')[2]}" for quantity in HEATS]
        load = next((load for load in loads if load in values), None)
        channel = without_silent(values[key], [*silent[key], *(one for one in outside[key] if not one.lasts)])
        stretches = against_heat(blocks.with_channel(key, channel), key, load, resolution) if load else []
        if stretches:
            silent[key] += [_elsewhere(values["time"], channel, *stretch) for stretch in stretches]
            outside[key] = off_beside(key)
        silent[key] += outside[key]
    return {key: stretches for key, stretches in silent.items() if stretches}


def _elsewhere(time: FloatArray, values: FloatArray, first: int, last: int) -> Silence:
    """A stretch of rows in which a sensor is not where its part is."""
    rows = np.zeros(values.size, dtype=bool)
    rows[first : last + 1] = np.isfinite(values[first : last + 1])
    readings, beside = values[rows], values[np.isfinite(values) & ~rows]
    if np.ptp(readings) > 0:
        return silence_at(time, "disconnected", float(np.median(readings)), rows)
    value, others = float(readings[0]), np.flatnonzero(np.isfinite(values) & ~rows)
    nearest = others[np.unique(np.clip(np.searchsorted(others, first) + np.array([-1, 0]), 0, others.size - 1))]
    if (np.abs(values[nearest] - value) > _FAR).all():
        return silence_at(time, "dead", value, rows)
    return silence_at(time, "frozen" if beside.min() < value < beside.max() else "clamped", value, rows)


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
    read = {key: readings for key, readings in read.items() if readings.size}
    ranges = {key: float(np.ptp(readings)) for key, readings in read.items()}
    if all(ranges.values()):
        return {}
    coarsest = max((quantisation_step(readings) for key, readings in read.items() if ranges.get(key)), default=0.0)
    moved = max(ranges.values(), default=0.0) > max(_MOVED_APART, _MOVED_STEPS * coarsest)
    still = {}
    for key, extent in ranges.items():
        rows = np.isfinite(values[key])
        stamps = values["time"][rows]
        if not moved or extent or stamps.size < 3 or _gaps(stamps)[1][-1] < _STUCK:
            continue
        one = Silence("frozen", float(read[key][0]), float(stamps[0]), float(stamps[-1]), rows, whole=True)
        if key != AMBIENT:
            still[key] = [one]
        elif one.value in CODES and all(
            abs(readings[0] - one.value) > _FAR for readings in read.values() if np.ptp(readings)
        ):
            still[key] = [replace(one, kind="dead")]
    return still


def _is_rest(quantity: str, one: Silence) -> bool:
    """Whether a number that stands is what a joint at rest gives: none, or of speeds the noise of its encoder.

    A speed fails at what it said last, which is seldom so little.
    """
    return one.value == 0 or (quantity == "velocity" and abs(one.value) < _AT_REST)


def _only_while_it_rests(time: FloatArray, values: FloatArray, speed: FloatArray, silence: Silence) -> bool:
    """Whether a number stands while its joint rests, and no longer: it moves, or bears another load, before and after.

    A joint that holds a load needs the same torque all the while; a fault keeps no such hours, and what a channel says
    as it fails is what it said before.
    """
    before = np.flatnonzero((time >= silence.start - SHORTEST) & (time < silence.start))
    after = np.flatnonzero((time > silence.stop) & (time <= silence.stop + SHORTEST))
    beside = [(rows, rows[nearest]) for rows, nearest in ((before, -1), (after, 0)) if rows.size]
    changes = [abs(speed[nearest]) >= _AT_REST or np.ptp(values[rows]) == 0 for rows, nearest in beside]
    return bool(beside) and all(changes) and bool((np.abs(speed[silence.rows]) < _AT_REST).all())


def _moves(speed: FloatArray, silence: Silence) -> bool:
    inside = np.abs(speed[silence.rows])
    return bool(np.isfinite(inside).any()) and float(np.nanmean(inside)) > _MOVING


def without_silent(values: FloatArray, silent: list[Silence]) -> FloatArray:
    """A channel's values, NaN where it is silent."""
    return np.where(np.any([stretch.rows for stretch in silent], axis=0), np.nan, values) if silent else values


# --- Rows that say the same -----------------------------------------------------------------------


_HELD, _HELD_ROWS, _AROUND = 2.0, 3, 50  # s, and rows in turn, that stand; rows on both sides that tell what is usual
_NEW = 0.5  # share of rows in which a column that tells has another number, back and forth
_SEVERAL = 2  # columns that hardly ever stand: one alone is a sensor that froze
_SURE = 1e-9  # chance that temperatures and speeds of a robot that was logged all the while would stand so long


def held_rows(values: Mapping[str, FloatArray]) -> list[tuple[int, int]]:
    """First and last of rows in which all columns stand, though some hardly ever do: rows that the logger repeated.

    Torques may stand, as they were asked for, and so may what is zero.

    Args:
        values: time [s] and the quantities, (n,) each.
    """
    time, channels = values["time"], {key: channel for key, channel in values.items() if key != "time"}
    alike = np.ones(max(time.size - 1, 0), dtype=bool)
    for channel in channels.values():
        alike &= channel[1:] == channel[:-1]
    edges = np.flatnonzero(np.diff(alike, prepend=False, append=False))
    measured = [channel for key, channel in channels.items() if key.startswith(("temperature.", "velocity."))]
    lively = [x for x in measured if alike.any() and _back_and_forth(np.diff(x)) > _NEW * alike.size]
    held = []
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if last - first < _HELD_ROWS or time[last] - time[first] < _HELD:
            continue
        beside = np.r_[max(first - _AROUND, 0) : first, last : min(last + _AROUND, alike.size)]
        moves = [_back_and_forth(x[beside + 1] - x[beside]) for x in lively if x[first] != 0]
        shares = [(beside.size - count + 1) / (beside.size + 2) for count in moves]
        telling = [share for share in shares if share < 1 - _NEW]
        if len(telling) >= _SEVERAL and (last - first) * np.log(telling).sum() < np.log(_SURE):
            held.append((first + 1, last))
    return held


def _back_and_forth(moves: FloatArray) -> int:
    """How many of a channel's moves are noise: on average, every second one turns back."""
    moves = moves[np.abs(moves) > 0]
    return min(moves.size, 2 * int(np.count_nonzero(moves[1:] * moves[:-1] < 0)))


# --- Channels that say the same -------------------------------------------------------------------


_ALIKE = 0.99  # share of rows in which two channels give the same number
_MOVED = 0.5  # K; of two that stand still nothing is known
_TOGETHER = 0.5
"""Share of its changes that a copy makes in the same row. Two joints at rest, as warm as each other and read in steps
of 1 K, give the same number in 99 of 100 rows, but cross a step at different ones."""


def duplicates(values: Mapping[str, FloatArray], loads: Mapping[str, FloatArray] | None = None) -> dict[str, str]:
    """Of channels that say the same the later ones, each with the first.

    Args:
        values: by channel, (n,) degC or SI each.
        loads: by channel what goes with the square root of the heat put in there, (n,) each: two parts with other
            heats have other temperatures, though their noise is not the same.
    """
    pairs: dict[str, str] = {}
    names = list(values)
    slow = {name: _means(values[name]) for name in names if name in (loads or {})}
    for number, name in enumerate(names):
        for earlier in names[:number]:
            if earlier in pairs:
                continue
            if _is_copy(values[name], values[earlier]) or (
                loads and name in slow and earlier in slow and _is_as_warm(values, slow, loads, name, earlier)
            ):
                pairs[name] = earlier
                break
    return pairs


def same_loads(values: Mapping[str, FloatArray]) -> dict[str, str]:
    """Torques and currents that are number by number those of another joint, which moves otherwise, with that other.

    Two joints that are made alike, and commanded alike, have one speed as well.
    """
    pairs = {}
    for quantity in HEATS:
        names = [key for key in values if key.startswith(f"{quantity}.")]
        for number, name in enumerate(names):
            for earlier in names[:number]:
                one, other = (f"velocity.{key.partition('.')[2]}" for key in (name, earlier))
                alike = one in values and other in values and _is_copy(values[one], values[other], moved=0.0)
                if not alike and _is_copy(values[name], values[earlier], moved=0.0, levels=_MEASURED):
                    pairs[name] = earlier
                    break
    return pairs


_MEASURED = 50  # numbers that a measured channel takes; fewer are what was asked for


def _is_copy(one: FloatArray, other: FloatArray, moved: float = _MOVED, levels: int = 0) -> bool:
    """Whether two channels give the same numbers, and move by so much, through so many numbers."""
    equal = int(np.count_nonzero(one == other))
    if equal < _FEWEST:  # the usual case, said by one look at millions of rows
        return False
    both = np.isfinite(one) & np.isfinite(other)
    if equal < _ALIKE * np.count_nonzero(both):
        return False
    moves, others = np.diff(one[both]), np.diff(other[both])
    changes = np.count_nonzero(moves)
    if changes < _FEWEST or np.ptp(one[both]) < moved or np.unique(one[both]).size < levels:
        return False
    return bool(np.count_nonzero((moves == others) & (moves != 0)) >= _TOGETHER * changes)


_BLOCKS = 100  # parts of a log
_WARMED, _SAME = 5.0, 0.02  # K, by which both move; of it, by which they may differ
_APART, _LEAST_APART = 5.0, 0.1  # times what they differ by, K: so far apart would other heats bring them
_ROUNDED, _LAG = 0.1, 0.1  # of the noise, which blocks may differ by beside; of the log, in which a slow part warms


def _is_as_warm(
    values: Mapping[str, FloatArray],
    slow: Mapping[str, FloatArray],
    loads: Mapping[str, FloatArray],
    one: str,
    other: str,
) -> bool:
    """Whether two parts are as warm as each other to their noise, though the heat that is put in is not the same."""
    apart = slow[one] - slow[other]
    if not np.isfinite(apart).all():
        return False
    moved, differ = float(min(np.ptp(slow[one]), np.ptp(slow[other]))), float(np.sqrt(np.mean(apart**2)))
    if moved < _WARMED or differ > _SAME * moved:
        return False
    noise = float(np.nanstd(np.diff(values[one] - values[other]))) / np.sqrt(2)
    if differ > (2 / np.sqrt(max(values[one].size // _BLOCKS, 1)) + _ROUNDED) * noise:
        return False
    # What would make their temperatures differ: the heats, as a slow part means them, scaled to be as alike as can be.
    a, b = (_lagged(_means(np.square(loads[name]))) for name in (one, other))
    if not a @ a > 0 or not b @ b > 0:
        return False
    left = a - b * float(a @ b / (b @ b))
    return float(np.ptp(left) / np.ptp(a)) * moved > _APART * max(differ, _LEAST_APART)


def _means(values: FloatArray) -> FloatArray:
    return means_of_blocks(values, max(values.size // _BLOCKS, 1))


def _lagged(heat: FloatArray) -> FloatArray:
    """A heat as a part follows it that warms within a tenth of the log."""
    weights = np.exp(-np.arange(heat.size) / (_LAG * heat.size))
    return np.convolve(np.nan_to_num(heat), weights)[: heat.size]
