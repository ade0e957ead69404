"""Which readings of a temperature channel one passive, heated part could have given.

A part with a heat capacity moves at a bounded rate, and faster only with the heat that is put in. So a channel is cut
where it moves as no part of a robot does, within a row or within half a minute. Of the stretches between these cuts the
longest chain is believed through which one part can have passed; rather one that begins as warm as the rest of the
robot, and hardly one that is colder than all that surrounds it. What is not of that chain is no reading, whatever it
came from: a broken wire, a short, a code, a spike, a filter that starts, a plug that comes loose, a counter that turns,
another unit from some row on.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray, IntArray
from lptn.logs.channels import Kind, Silence, spans
from lptn.logs.law import SHORTEST

FEWEST = 20  # readings, to know what a sensor is like
_LEAP = 3.0  # K, beside noise: so much any part may seem to move at once
_NOISE, _STEPS = 8.0, 2.5  # times the usual move from reading to reading; steps of a coarse sensor
_RATE = 1.0  # K/s: a winding at stall warms as fast, for some seconds
_ALONE = 0.5  # of a move from row to row, that the moves beside it have at the most: a part that goes fast goes on so
_SAMPLED = 2.0  # s between readings: in more a small part goes on no longer
_QUICK = 10.0  # s between readings: in more a winding may warm and cool again by any number
_SLOW_LEAP = 30.0  # K, then
_WINDOWS = (3.0, 10.0, 30.0)  # s, within which a filter, or a wire that corrodes, lets a channel leave
_FASTEST = 1e-6  # s between two readings; clocks of loggers tell no less
_SAMPLE = 100_000  # moves, of which the usual one is taken
_COLDER = 10.0  # K, below all others
_HOTTEST = 300.0  # degC: insulation of the best class bears 240, magnets less
_BEFORE, _LAG = 20.0, 2.0  # s, in which the heat before is meant; by which a sensor may come late
_AS_LARGE, _NEARLY, _GAIN = 0.5, 0.9, 3.0  # of a change of heat; share of such moves; times the largest of these
_BEGINNING, _QUICKER, _NEARLY_ALL = 60.0, 12.0, 0.98  # s; times what it does elsewhere; share of a channel's moves
_MOST = 2000  # stretches; in more pieces a channel is noise, and nothing is known of it
_TAIL = 3  # times ten seconds, in which the rest of a filter's way is lost in what is usual


def off(
    time: FloatArray,
    values: FloatArray,
    resolution: float = 0.0,
    *,
    start: float = np.nan,
    coldest: float = -np.inf,
    load: FloatArray | None = None,
    heated: bool = True,
) -> list[Silence]:
    """The readings that no passive part could have given with the others.

    Args:
        time: (n,) s.
        values: (n,) degC, NaN where missing.
        resolution: the sensor's steps [K], 0 for none.
        start: degC, what other channels begin at; NaN where there is none.
        coldest: degC, the least that any of them has for long.
        load: (n,) whose square goes with the heat put in, as torque or current; None where nothing says it.
        heated: whether heat may be put in that nobody logs; none is put into the air.
    """
    there = np.flatnonzero(np.isfinite(values))
    if there.size < FEWEST:
        return []
    heat = None if load is None else np.square(np.nan_to_num(load[there]))
    channel = _Channel(time[there], values[there], resolution, start, coldest, heat, heated)
    cuts = channel.cuts()
    # First and last reading of each stretch without a cut; readings within a slow leap are of none.
    slow = (np.append(cuts[:1], cuts) == 2) & (np.append(cuts, cuts[-1:]) == 2)
    begins, ends = (np.flatnonzero(np.append(*edges) & ~slow) for edges in ((True, cuts > 0), (cuts > 0, True)))
    if begins.size > _MOST or not begins.size:
        return []
    kept = np.ones(there.size, dtype=bool)
    if cuts.any():
        kept[:] = False
        believed, rows = channel.chain(begins, ends), max(1, round(_WINDOWS[1] / channel.every))
        for begin, end in zip(begins[believed].tolist(), ends[believed].tolist(), strict=True):
            if end - begin > rows + FEWEST:  # what is left of a slow leap moves faster than usual
                moves = np.abs(channel.readings[begin + rows : end + 1] - channel.readings[begin : end + 1 - rows])
                calm = np.flatnonzero(moves <= 2 * float(np.quantile(moves, 0.9)))
                if begin > 0 and cuts[begin - 1] == 2 and calm[0] > 0:
                    begin = min(begin + int(calm[0]) + _TAIL * rows, end)
                if end < there.size - 1 and cuts[end] == 2 and calm[-1] < moves.size - 1:
                    end = max(end - (moves.size - 1 - int(calm[-1])) - _TAIL * rows, begin)
            kept[begin : end + 1] = True
    out = np.zeros(values.size, dtype=bool)
    out[there[~kept]] = True
    turn = channel.turn(cuts, kept)
    return [Silence.at(time, "wrap", turn, out)] if turn else list(_named(time, values, out, channel.every))


class _Channel:
    """A channel's readings (m,), what they move by, and the heat that is put in at each, if that is known."""

    def __init__(
        self,
        stamps: FloatArray,
        readings: FloatArray,
        resolution: float,
        start: float,
        coldest: float,
        heat: FloatArray | None,
        heated: bool,
    ) -> None:
        self.stamps, self.readings, self.start, self.coldest, self.heat = stamps, readings, start, coldest, heat
        # All heat that is put in is logged, so that what moves otherwise is no part.
        self.is_known = heat is not None or not heated
        apart, moves = np.diff(stamps), np.abs(np.diff(readings))
        thin = max(1, apart.size // _SAMPLE)
        every = float(np.median(apart[::thin]))
        self.every = max(every, _FASTEST) if np.isfinite(every) else np.inf
        self.least = max(_LEAP, _STEPS * resolution if resolution > 0 else _NOISE * float(np.median(moves[::thin])))

    def cuts(self) -> IntArray:
        """For each step from reading to reading whether no part makes it: 1 alone, 2 as a part of a slow leap."""
        moves, apart = np.diff(self.readings), np.diff(self.stamps)
        size, quick = np.abs(moves), apart <= _QUICK
        cuts = np.zeros(moves.size, dtype=np.int64)
        suspects = np.flatnonzero(size > np.where(quick, self.least, max(self.least, _SLOW_LEAP)))
        if suspects.size:
            padded = np.concatenate(([0.0], moves, [0.0]))
            before, after = padded[suspects], padded[suspects + 2]
            own, direction = size[suspects], np.sign(moves[suspects])
            # What goes away and comes back at once is no heat.
            back = np.maximum(-before * direction, -after * direction) > self.least
            alone = np.maximum(before * direction, after * direction) < _ALONE * own
            known = (apart[suspects] <= _SAMPLED) | self.is_known | self._nowhere(suspects + 1)
            far = own > self.least + _RATE * np.minimum(apart[suspects], _QUICK)
            leap = (back & quick[suspects]) | (far & alone & known)
            cuts[suspects[leap & ~self._heated(suspects, 1)]] = 1
        for window in _WINDOWS:
            rows = round(window / self.every)
            if 2 <= rows < self.readings.size:
                self._cut_slow(cuts, window, rows)
        return cuts

    def _cut_slow(self, cuts: IntArray, window: float, rows: int) -> None:
        """Mark the steps of windows in which the channel goes as far as no part does."""
        moves = self.readings[rows:] - self.readings[:-rows]
        suspects = np.flatnonzero(np.abs(moves) > self.least + _RATE * window)
        if not suspects.size:
            return
        passed = np.concatenate(([0], np.cumsum(cuts > 0)))
        inside = passed[suspects + rows] == passed[suspects]
        suspects = suspects[inside & (self.stamps[suspects + rows] - self.stamps[suspects] < 2 * window)]
        impossible = self._nowhere(suspects + rows) | self._nowhere(suspects)
        if self.is_known:
            # A log may begin where a small part is hot, and cools: then it is as quick later on.
            later = moves[self.stamps[: moves.size] > self.stamps[0] + 2 * _BEGINNING]
            usual = float(np.quantile(np.abs(later), _NEARLY_ALL)) if later.size else np.inf
            cools = (self.stamps[suspects] < self.stamps[0] + _BEGINNING) & (moves[suspects] < 0)
            impossible |= ~self._heated(suspects, rows) & (~cools | (np.abs(moves[suspects]) > _QUICKER * usual))
        edges = np.zeros(cuts.size + 1, dtype=np.int64)
        np.add.at(edges, suspects[impossible], 1)
        np.add.at(edges, suspects[impossible] + rows, -1)
        cuts[(np.cumsum(edges)[:-1] > 0) & (cuts == 0)] = 2

    def _nowhere(self, at: IntArray) -> BoolArray:
        """Whether readings are where no part of this robot is."""
        readings = self.readings[at]
        return np.asarray((readings < self.coldest - _COLDER) | (readings > _HOTTEST))

    def _heated(self, at: IntArray, rows: int) -> BoolArray:
        """Whether a change of the heat put in explains moves over some rows: one as large moves it alike elsewhere."""
        explained = np.zeros(at.size, dtype=bool)
        if self.heat is None or not at.size:
            return explained
        total = np.concatenate(([0.0], np.cumsum(self.heat)))
        back, lag = max(1, round(_BEFORE / self.every)), round(_LAG / self.every)
        k = np.arange(self.readings.size - rows)
        middle, first, last = np.maximum(k - lag, 0), np.maximum(k - lag - back, 0), k + rows
        after = (total[last] - total[middle]) / (last - middle)
        change = after - (total[middle] - total[first]) / back  # before the log there was none
        moves = self.readings[rows:] - self.readings[:-rows]
        for number, k_at in enumerate(at.tolist()):
            if change[k_at] * moves[k_at] > 0:
                alike = np.sign(change[k_at]) * change >= _AS_LARGE * abs(change[k_at])
                gain = float(np.quantile(moves[alike] / change[alike], _NEARLY))
                explained[number] = abs(moves[k_at]) <= _GAIN * gain * abs(change[k_at])
        return explained

    def chain(self, begins: IntArray, ends: IntArray) -> IntArray:
        """The numbers of the stretches through which one part can have passed, and which hold the most readings."""
        size = np.minimum(_EDGE, ends - begins + 1)
        first = np.array([np.median(self.readings[b : b + n]) for b, n in zip(begins, size, strict=True)])
        last = np.array([np.median(self.readings[e + 1 - n : e + 1]) for e, n in zip(ends, size, strict=True)])
        still = np.array([np.ptp(self.readings[b : e + 1]) == 0 for b, e in zip(begins, ends, strict=True)])
        still &= (self.stamps[ends] - self.stamps[begins] >= SHORTEST) & ~still.all()
        begun, ended = self.stamps[begins + size // 2], self.stamps[ends - size // 2]
        nowhere = (np.maximum(first, last) < self.coldest - _COLDER) | (np.minimum(first, last) > _HOTTEST)
        weight = (ends - begins + 1.0) * np.where(still | nowhere, _UNLIKELY, 1.0)
        if abs(first[0] - self.start) < _BEGINS and not still[0]:
            weight[0] *= _LIKELY
        rows, rates = max(1, round(_WINDOWS[-1] / self.every)), [np.zeros(1)]  # K/s, in the longest stretches
        for k in np.argsort(begins - ends)[:_EDGE]:
            own, when = (x[begins[k] : ends[k] + 1] for x in (self.readings, self.stamps))
            rates.append(np.abs(own[rows:] - own[:-rows]) / (when[rows:] - when[:-rows]))
        rate = 2 * float(np.quantile(np.concatenate(rates), 0.9))
        score, before = weight.copy(), np.full(begins.size, -1)
        for k in range(1, begins.size):
            near = np.abs(first[k] - last[:k]) <= self.least + rate * (begun[k] - ended[:k])
            if near.any():
                best = int(np.argmax(np.where(near, score[:k], -np.inf)))
                score[k], before[k] = weight[k] + score[best], best
        chain = [int(np.argmax(score))]
        while before[chain[-1]] >= 0:
            chain.append(int(before[chain[-1]]))
        return np.array(chain[::-1])

    def turn(self, cuts: IntArray, kept: BoolArray) -> float:
        """By how much a channel leaps whose leaps are alike, and that goes on between them [K]; 0 for any other."""
        leaps = np.diff(self.readings)[cuts == 1]
        if leaps.size < _ALIKE or leaps.min() > 0 or leaps.max() < 0:
            return 0.0
        if np.count_nonzero(~kept) < _EDGE * leaps.size / 2 or np.unique(self.readings[~kept]).size < _EDGE:
            return 0.0
        middle = float(np.median(np.abs(leaps)))
        near = np.abs(np.abs(leaps) - middle) <= max(_OF_TURN * middle, self.least / 2)
        return middle if middle > 2 * self.least and near.mean() > _MOSTLY else 0.0


_EDGE = 5  # readings at the ends of a stretch, whose middle value is taken
_BEGINS, _LIKELY, _UNLIKELY = 6.0, 3.0, 0.1
"""K from the others, and times that a stretch counts that begins so; that no part can have."""
_ALIKE, _OF_TURN, _MOSTLY = 4, 0.03, 0.8  # leaps; of a turn; share of the leaps


CODES = (0.0, -127.0, 85.0, -999.0, 999.0, 127.0, 255.0, 65535.0, 32767.0, -32768.0)
"""degC that failing sensors are known to give: DS18B20 at power-up (85) and disconnected (-127), codes of drives and of
converters of 8 and 16 bit."""
_AGAIN, _OF_ALL = 3, 0.2  # times, and share of all that is left out, that one number comes back as a code
_TOO_HOT = 150.0  # degC: a number beyond, or below its negative, may be a code though it occurs but once


def _named(time: FloatArray, values: FloatArray, out: BoolArray, every: float) -> Iterator[Silence]:
    """What the readings are that are left out: those of one number together, single ones, and each long stretch."""
    there = np.flatnonzero(np.isfinite(values))
    runs = [there[a:b] for a, b in spans(out[there])]
    by_value: dict[float, list[IntArray]] = {}

    def named(kind: Kind, value: float, stretches: list[IntArray]) -> Silence:
        rows = np.zeros(values.size, dtype=bool)
        rows[np.concatenate(stretches)] = True
        return Silence.at(time, kind, value, rows)

    for rows in runs:
        value = float(values[rows[0]])
        if not (values[rows] == value).all():
            yield named("disconnected", float(np.median(values[rows])), [rows])
        elif time[rows[-1]] - time[rows[0]] >= SHORTEST:
            yield named("dead", value, [rows])
        else:
            by_value.setdefault(value, []).append(rows)
    single = []
    for value, own in by_value.items():
        shortest = min(rows.size for rows in own)
        often = len(own) >= max(_AGAIN, _OF_ALL * len(runs)) or any(rows.size > 1 for rows in own)
        if often and shortest > 1:  # it is one where the part is nearly as warm, too
            again = [np.arange(a, b) for a, b in spans((values == value) & ~out) if b - a > shortest // 2]
            own = [*own, *again]
        if often or value in CODES or abs(value) > _TOO_HOT:
            yield named("code", value, own)
        elif every <= _QUICK:
            single += own
    if single:
        good, first = np.flatnonzero(np.isfinite(values) & ~out), np.array([rows[0] for rows in single])
        beside = values[good[np.maximum(np.searchsorted(good, first) - 1, 0)]] if good.size else np.nan
        yield named("spike", float(np.max(np.abs(values[first] - beside))), single)
