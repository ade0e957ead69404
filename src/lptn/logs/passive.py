"""Which readings of a temperature channel one passive, heated part could have given.

A part with a heat capacity moves at a bounded rate, and faster only with the heat that is put in. So a channel is cut
where it moves as no part of a robot does, within a row or within half a minute. Of the stretches between these cuts the
longest chain is believed through which one part can have passed; rather one that begins as warm as the rest of the
robot, and hardly one that is colder than all that surrounds it. What is not of that chain is no reading, whatever it
came from: a broken wire, a short, a code, a spike, a filter that starts, a plug that comes loose, a counter that turns,
another unit from some row on.
"""

from __future__ import annotations

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray, IntArray
from lptn.logs.channels import FEWEST, NEARLY_ALL, SHORTEST, Channels, Silence, few_of, spans
from lptn.logs.columns import place_of
from lptn.logs.law import contradicted
from lptn.logs.plausible import ALIKE, CODES, FAR, HOTTEST, OUTDOORS, RATE

_MOST = 2000  # stretches; in more pieces a channel is noise, and nothing is known of it
_FASTEST = 1e-6  # s between two readings; clocks of loggers tell no less


def off(log: Channels, key: str, values: FloatArray) -> list[Silence]:
    """The readings of a temperature, (n,) degC, that no passive part could have given with the others."""
    there = np.flatnonzero(np.isfinite(values))
    if there.size < FEWEST:
        return []
    part = _Part(log, key, there, values[there])
    cuts = part.cuts()
    # First and last reading of each stretch without a cut; readings within a slow leap are of none.
    slow = (np.append(cuts[:1], cuts) == 2) & (np.append(cuts, cuts[-1:]) == 2)
    begins, ends = (np.flatnonzero(np.append(*edges) & ~slow) for edges in ((True, cuts > 0), (cuts > 0, True)))
    if not cuts.any() or not 0 < begins.size <= _MOST:
        return []
    kept = np.zeros(there.size, dtype=bool)
    for begin, end in part.chain(begins, ends):
        kept[slice(*part.calm(begin, end, cuts))] = True
    out = np.zeros(values.size, dtype=bool)
    out[there[~kept]] = True
    if turn := part.turn(cuts, kept):  # each leap says how often the counter has turned
        turns = np.append(0.0, np.cumsum(np.where(cuts == 1, np.round(np.diff(part.readings) / turn), 0.0)))
        out[there] = turns != turns[np.argmax(kept)]
    return [Silence.at(log.time, "wrap", turn, out)] if turn else _named(log.time, values, out, part.every)


# --- Where a channel moves as no part does ----------------------------------------------------------

_NOISE, _STEPS = 8.0, 2.5
"""Times the usual move from reading to reading, and steps of a coarse sensor, that a part may seem to move at once."""
_ALONE = 0.5  # of a move from row to row, that the moves beside it have at the most: a part that goes fast goes on so
_SAMPLED = 2.0  # s between readings: in more a small part goes on no longer
_QUICK, _SLOW_LEAP = 10.0, 30.0  # s between readings: in more a winding may warm and cool again by any number; K, then
_WINDOWS = (3.0, 10.0, 30.0)  # s, within which a filter, or a wire that corrodes, lets a channel leave
_TAIL = 3  # times ten seconds, in which the rest of its way is lost in what is usual
_BEFORE = 20.0, 5.0  # s, over which the heat before is meant, of slow parts and of quick ones
_LAG = 2.0  # s, by which a sensor lags
_AS_LARGE, _GAIN = 0.5, 3.0  # of a change of heat; times the largest of nearly all such moves
_QUICKER, _MOST_MOVES = 12.0, 0.98  # times what it does elsewhere; share of a channel's moves
_EDGE = 5  # readings at the ends of a stretch, whose middle value is taken
_LIKELY, _UNLIKELY = 3.0, 0.1  # times that a stretch counts that begins as the others; that no part can have
_LEAPS = 4  # of a counter that turns


class _Part:
    """What a temperature reads, (m,), in those rows of a log in which it does, and what could have moved it."""

    def __init__(self, log: Channels, key: str, there: IntArray, readings: FloatArray) -> None:
        self.stamps, self.readings = log.time[there], readings
        self.log, self.key, self.rows = log, key, there
        others = [sensor for other, sensor in log.sensors.items() if other != key]
        self.start = float(np.median([sensor.first for sensor in others])) if others else np.nan
        self.coldest = min((sensor.low for sensor in others), default=-np.inf) if key != log.air else OUTDOORS[0]
        load, step = log.loads.get(place_of(key)), log.sensors[key].step
        self.heat = None if load is None else np.square(np.nan_to_num(load[there]))
        # All heat that is put in is logged, so that what moves otherwise is no part; into the air none is put.
        self.is_known = load is not None or key == log.air
        apart, moves = np.diff(self.stamps), np.abs(np.diff(readings))
        every = float(np.median(few_of(apart)))
        self.every = max(every, _FASTEST) if np.isfinite(every) else np.inf
        self.least = max(ALIKE, _STEPS * step if step > 0 else _NOISE * float(np.median(few_of(moves))))

    def cuts(self) -> IntArray:
        """For each step from reading to reading whether no part makes it: 1 alone, 2 as a part of a slow leap."""
        moves, apart = np.diff(self.readings), np.diff(self.stamps)
        size, quick = np.abs(moves), apart <= _QUICK
        cuts = np.zeros(moves.size, dtype=np.int64)
        suspects = np.flatnonzero(size > np.where(quick, self.least, max(self.least, _SLOW_LEAP)))
        if suspects.size:
            padded, direction = np.concatenate(([0.0], moves, [0.0])), np.sign(moves[suspects])
            beside = np.stack([padded[suspects], padded[suspects + 2]]) * direction
            # What goes away and comes back at once is no heat.
            back = -beside.min(axis=0) > self.least
            alone = beside.max(axis=0) < _ALONE * size[suspects]
            known = (apart[suspects] <= _SAMPLED) | self.is_known | self._nowhere(self.readings[suspects + 1])
            far = size[suspects] > self.least + RATE * np.minimum(apart[suspects], _QUICK)
            leap = (back & quick[suspects]) | (far & alone & known)
            cuts[suspects[leap & ~self._heated(suspects, 1)]] = 1
        for window in _WINDOWS:
            rows = round(window / self.every)
            if 2 <= rows < self.readings.size:
                self._cut_slow(cuts, window, rows)
        # A part may begin as cold, and warm up, but goes there at no rate; noise doesn't bring it back.
        below = self.coldest - FAR - self.readings
        cold, back = below > 0, below <= -self.least
        gone = cold[np.maximum.accumulate(np.where(cold | back, np.arange(cold.size), 0))]
        gone &= np.maximum.accumulate(~gone)
        for begin, end in spans(gone):
            steps = slice(max(begin - 1, 0), end)
            # Where it goes as its part does in the rest of the log, it is in colder air that nobody logged.
            if cuts[steps].any() or contradicted(self.log, self.key, self.rows[[begin, end - 1]]):
                cuts[steps][cuts[steps] == 0] = 2
                cuts[begin : end - 1] = 2
        return cuts

    def _cut_slow(self, cuts: IntArray, window: float, rows: int) -> None:
        """Mark the steps of windows in which the channel goes as far as no part does."""
        moves = self.readings[rows:] - self.readings[:-rows]
        passed = np.concatenate(([0], np.cumsum(cuts > 0)))
        at = np.flatnonzero(np.abs(moves) > self.least + RATE * window)
        at = at[(passed[at + rows] == passed[at]) & (self.stamps[at + rows] - self.stamps[at] < 2 * window)]
        if not at.size:
            return
        impossible = self._nowhere(self.readings[at + rows]) | self._nowhere(self.readings[at])
        if self.is_known:
            # A log may begin where a small part is hot, and cools: then it is as quick later on.
            later = moves[self.stamps[: moves.size] > self.stamps[0] + 2 * SHORTEST]
            usual = float(np.quantile(np.abs(later), _MOST_MOVES)) if later.size else np.inf
            cools = (self.stamps[at] < self.stamps[0] + SHORTEST) & (moves[at] < 0)
            impossible |= ~self._heated(at, rows) & ~(cools & (np.abs(moves[at]) <= _QUICKER * usual))
        edges = np.zeros(cuts.size + 1, dtype=np.int64)
        np.add.at(edges, at[impossible], 1)
        np.add.at(edges, at[impossible] + rows, -1)
        cuts[(np.cumsum(edges)[:-1] > 0) & (cuts == 0)] = 2

    def _nowhere(self, readings: FloatArray) -> BoolArray:
        """Whether readings are where no part of this robot is."""
        return np.asarray((readings < self.coldest - FAR) | (readings > HOTTEST))

    def _heated(self, at: IntArray, rows: int) -> BoolArray:
        """Whether a change of the heat put in explains moves over some rows: one as large moves it alike elsewhere."""
        explained = np.zeros(at.size, dtype=bool)
        if self.heat is None or not at.size:
            return explained
        total, lag = np.concatenate(([0.0], np.cumsum(self.heat))), round(_LAG / self.every)
        k = np.arange(self.readings.size - rows)
        middle, last = np.maximum(k - lag, 0), k + rows
        after, moves = (total[last] - total[middle]) / (last - middle), self.readings[rows:] - self.readings[:-rows]
        for back in (max(1, round(before / self.every)) for before in _BEFORE):
            first = np.maximum(k - lag - back, 0)
            change = after - (total[middle] - total[first]) / back  # before the log there was none
            for number, k_at in enumerate(at.tolist()):
                if change[k_at] * moves[k_at] > 0 and not explained[number]:
                    alike = np.sign(change[k_at]) * change >= _AS_LARGE * abs(change[k_at])
                    gain = float(np.quantile(moves[alike] / change[alike], NEARLY_ALL))
                    explained[number] = abs(moves[k_at]) <= _GAIN * gain * abs(change[k_at])
        return explained

    def chain(self, begins: IntArray, ends: IntArray) -> list[tuple[int, int]]:
        """The stretches, of some from reading to reading, that one part can have had, and that hold the most."""
        pieces = [self.readings[begin : end + 1] for begin, end in zip(begins, ends, strict=True)]
        first = np.array([np.median(piece[:_EDGE]) for piece in pieces])
        last = np.array([np.median(piece[-_EDGE:]) for piece in pieces])
        half = np.minimum(_EDGE, ends - begins + 1) // 2
        begun, ended = self.stamps[begins + half], self.stamps[ends - half]
        still = np.array([np.ptp(piece) == 0 for piece in pieces])
        still &= (self.stamps[ends] - self.stamps[begins] >= SHORTEST) & ~still.all()
        unlikely = still | (self._nowhere(first) & self._nowhere(last))
        weight = (ends - begins + 1.0) * np.where(unlikely, _UNLIKELY, 1.0)
        if abs(first[0] - self.start) < 2 * ALIKE and not still[0]:
            weight[0] *= _LIKELY
        rows, rates = max(1, round(_WINDOWS[-1] / self.every)), [np.zeros(1)]  # K/s, in the longest stretches
        for k in np.argsort(begins - ends)[:_EDGE]:
            when = self.stamps[begins[k] : ends[k] + 1]
            rates.append(np.abs(pieces[k][rows:] - pieces[k][:-rows]) / (when[rows:] - when[:-rows]))
        rate = 2 * float(np.quantile(np.concatenate(rates), NEARLY_ALL))
        score, before = weight.copy(), np.full(begins.size, -1)
        for k in range(1, begins.size):
            near = np.abs(first[k] - last[:k]) <= self.least + rate * (begun[k] - ended[:k])
            if near.any():
                before[k] = np.argmax(np.where(near, score[:k], -np.inf))
                score[k] += score[before[k]]
        chain = [int(np.argmax(score))]
        while before[chain[-1]] >= 0:
            chain.append(int(before[chain[-1]]))
        return [(int(begins[k]), int(ends[k])) for k in chain]

    def calm(self, begin: int, end: int, cuts: IntArray) -> tuple[int, int]:
        """A stretch, and the one behind its last, without what is left of a slow leap: it moves faster than usual."""
        rows = max(1, round(_WINDOWS[1] / self.every))
        if end - begin > rows + FEWEST:
            moves = np.abs(self.readings[begin + rows : end + 1] - self.readings[begin : end + 1 - rows])
            calm, last = np.flatnonzero(moves <= 2 * float(np.quantile(moves, NEARLY_ALL))), end
            if end < cuts.size and cuts[end] == 2 and calm[-1] < moves.size - 1:
                last = max(end - (moves.size - 1 - int(calm[-1])) - _TAIL * rows, begin)
            if begin > 0 and cuts[begin - 1] == 2 and calm[0] > 0:
                begin = min(begin + int(calm[0]) + _TAIL * rows, end)
            end = last
        return begin, end + 1

    def turn(self, cuts: IntArray, kept: BoolArray) -> float:
        """By how much a channel leaps that keeps within one turn, and goes on between leaps [K]; 0 for any other."""
        leaps, left_out = np.diff(self.readings)[cuts == 1], self.readings[~kept]
        if leaps.size < _LEAPS or leaps.min() > 0 or leaps.max() < 0:
            return 0.0
        goes_on = left_out.size >= _EDGE * leaps.size / 2 and np.unique(left_out).size >= _EDGE
        turn = float(np.median(np.abs(leaps)))
        within = 2 * self.least < turn > np.ptp(self.readings) - self.least
        return turn if goes_on and within else 0.0


# --- What the readings are that are left out --------------------------------------------------------

_AGAIN, _OF_ALL = 3, 0.2  # times, and share of all that is left out, that one number comes back as a code
_TOO_HOT = 150.0  # degC: a number beyond, or below its negative, may be a code though it occurs but once


def _named(time: FloatArray, values: FloatArray, out: BoolArray, every: float) -> list[Silence]:
    """What the readings are that are left out: those of one number together, single ones, and each long stretch."""
    there = np.flatnonzero(np.isfinite(values))
    runs = [there[begin:end] for begin, end in spans(out[there])]
    found, single, by_value = list[Silence](), list[IntArray](), dict[float, list[IntArray]]()
    for rows in runs:
        value = float(np.median(values[rows]))
        if np.ptp(values[rows]) > 0:
            found.append(Silence.at(time, "disconnected", value, rows))
        elif time[rows[-1]] - time[rows[0]] >= SHORTEST:
            found.append(Silence.at(time, "dead", value, rows))
        else:
            by_value.setdefault(value, []).append(rows)
    for value, own in by_value.items():
        shortest = min(rows.size for rows in own)
        often = len(own) >= max(_AGAIN, _OF_ALL * len(runs)) or any(rows.size > 1 for rows in own)
        if often and shortest > 1:  # it is one where the part is nearly as warm, too
            own = [
                *own,
                *(np.arange(*span) for span in spans((values == value) & ~out) if np.ptp(span) > shortest // 2),
            ]
        if often or value in CODES or abs(value) > _TOO_HOT:
            found.append(Silence.at(time, "code", value, np.concatenate(own)))
        elif every <= _QUICK:
            single += own
    if single:
        good, first = np.flatnonzero(np.isfinite(values) & ~out), np.array([rows[0] for rows in single])
        beside = values[good[np.maximum(np.searchsorted(good, first) - 1, 0)]] if good.size else np.nan
        far = float(np.max(np.abs(values[first] - beside)))
        found.append(Silence.at(time, "spike", far, np.concatenate(single)))
    return found
