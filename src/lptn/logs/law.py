r"""How the part warms that a sensor reads, by the log itself; and what of the log contradicts that.

By block means a part with a heat capacity follows

.. math:: \frac{dT}{dt} = a q^2 + d |\omega| + e |q \omega| + \sum_j b_j (T_j - T) + c, \quad a, b_j, d, e \ge 0

with its load q, the speed of its joint and what surrounds it, by least squares. A reading that stands, or that is the
air's, is right where the part would have stayed so; it is none where what the law adds up to over that stretch is far
beyond what the law is off elsewhere in as long a time. So it is where a part is colder than all around it, which it
may be by its law, in air that nobody logged. A load that from some row on makes another heat for its square is in
another unit from there on, and one that for a while makes none is that of a drive that is off. A temperature whose law
is better with another joint's load is that joint's. And where a log begins warm, without any constant c, its parts cool
as warm ones do, or stay as parts at rest under a sensor with an offset.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view

from lptn.basics.arrays import BoolArray, FloatArray, IntArray
from lptn.logs.channels import GAP, NEARLY_ALL, SHORTEST, STILL, Channels, GainChange, spans, standing, usual_length
from lptn.logs.columns import has_own_heat, place_of
from lptn.logs.plausible import ALIKE
from lptn.logs.scatter import MAD_TO_SIGMA

_FEWEST = 30  # blocks that tell a law
_SELDOM = 10  # blocks between two readings of a neighbour
_CONDUCTANCE, _HEATS = 1 / 500, 0.1
"""1/s, of a conductance to a capacity, and K/s of heat, as they are likely: where a log does not tell two of them
apart, neither is large."""
_NOISE, _LEAST = 0.1, 1e-4  # K, of a step, with which the first fit is made; that a log without any has
_HIDDEN = 600.0  # s, in which a mass that no sensor reads, as a housing behind its winding, follows the part
_FAR = 2.0  # standard deviations, from which on what is off counts by its size alone
_REWEIGHTED = 3  # least squares whose weights make them least absolute errors: a fall is far off, and rare


@dataclass(frozen=True, eq=False)
class Warming:
    """A part's warming beside what makes it.

    Args:
        rows: blocks before those steps from block to block in which all is known, (m,).
        moved: K from that block to the next, (m,).
        design: s between them, times the heats that are put in (the load's square, where it has one, and where its
            speed is logged the size of that, and of the product), 1, air less temperature, other temperatures less it,
            and that of a mass that no sensor reads less it: (m, columns).
        likely: what their coefficients may be, (columns,).
        signed: which of them may be below 0, (columns,): that of a constant heat.
    """

    rows: IntArray
    moved: FloatArray
    design: FloatArray
    likely: FloatArray
    signed: BoolArray

    @property
    def other(self) -> int:
        """The column of a constant heat; those before it are other heats, and the next is what leaves to the air."""
        return int(self.signed.argmax())

    def fitted(self, used: BoolArray | None = None) -> tuple[FloatArray, FloatArray]:
        """The law's coefficients, (columns,), and what a part moves otherwise than by it in each step [K], (m,).

        The law is that of the steps `used`, (m,), as most of them say, whatever a few that are far off say.
        """
        used = np.ones(self.moved.size, dtype=bool) if used is None else used
        columns, noise = self.design * self.likely, _NOISE
        weights, prior = np.ones(np.count_nonzero(used)), np.eye(self.likely.size)
        for _ in range(_REWEIGHTED):
            weighted = columns[used].T * weights
            inverse = np.linalg.inv(weighted @ columns[used] + noise**2 * prior)
            found = inverse @ (weighted @ self.moved[used])
            while (below := np.where(self.signed, 0.0, found)).min() < 0:
                worst = int(below.argmin())  # is taken out, and stays out
                shares, columns[:, worst] = inverse[:, worst] / inverse[worst, worst], 0.0
                found, inverse = found - shares * found[worst], inverse - np.outer(shares, inverse[worst])
            off = self.moved - columns @ found
            noise = max(MAD_TO_SIGMA * float(np.median(np.abs(off[used]))), _LEAST)
            weights = 1 / np.maximum(np.abs(off[used]) / (_FAR * noise), 1.0)
        return found * self.likely, off

    @cached_property
    def off(self) -> FloatArray:
        """What a part moves otherwise than by the law of all steps in each [K], (m,)."""
        return self.fitted()[1]

    @property
    def error(self) -> float:
        """The mean size of that [K]."""
        return float(np.mean(np.abs(self.off)))

    def apart(self, terms: Sequence[int], stretch: BoolArray) -> Warming:
        """The same law, some of whose terms are others in a stretch, (m,): it has its columns of them at the end."""
        design = np.column_stack([self.design, self.design[:, terms] * stretch[:, None]])
        design[:, terms] *= ~stretch[:, None]
        likely, signed = np.append(self.likely, self.likely[terms]), np.append(self.signed, self.signed[terms])
        return replace(self, design=design, likely=likely, signed=signed)

    def over(self, steps: int) -> Warming:
        """The same of so many steps at a time, where they follow each other, and without a constant heat."""
        first = np.flatnonzero(self.rows[steps - 1 :] - self.rows[: 1 - steps] == steps - 1)
        moved, design = (sliding_window_view(x, steps, axis=0).sum(axis=-1)[first] for x in (self.moved, self.design))
        return replace(self, rows=self.rows[first], moved=moved, design=design, likely=self.likely * ~self.signed)


def warming(log: Channels, key: str, load: str) -> Warming | None:
    """How a part of temperature `key` warms beside its load, '' for none; `None` where the log is too short to tell."""
    if log.block == 0 or not np.isfinite(log.means(key)).any():
        return None
    warm, heats = log.means(key), log.heats(load) if load else []
    around = {log.air: np.zeros(warm.size)}  # where no air is logged
    for other in (other for other in log.of("temperature") if other != key):
        read = log.means(other)
        if np.isnan(read).any():  # what is read more seldom than once a block lies between its readings
            read = np.asarray(pd.Series(read).interpolate(limit=_SELDOM, limit_area="inside"), np.float64)
        around |= {other: read} if np.isfinite(read).mean() > NEARLY_ALL else {}
    apart = np.diff(log.means("time"))
    hidden = pd.Series(warm).ewm(com=_HIDDEN / float(np.median(apart)), adjust=False).mean().to_numpy() - warm
    table = np.column_stack([np.ones(warm.size), *(read - warm for read in around.values()), hidden])
    moved, design = np.diff(warm), np.column_stack([*heats, 0.5 * (table[:-1] + table[1:])])
    rows = np.flatnonzero(np.isfinite(moved) & np.isfinite(design).all(axis=1) & (apart < GAP * np.median(apart)))
    if rows.size < _FEWEST:
        return None
    likely = np.full(design.shape[1], _CONDUCTANCE)
    sizes = np.sqrt(np.square(design[rows]).mean(axis=0)) + np.finfo(float).tiny
    likely[: len(heats)], likely[len(heats)] = _HEATS / sizes[: len(heats)], _HEATS
    signed = np.arange(likely.size) == len(heats)
    return Warming(rows, moved[rows], design[rows] * apart[rows, None], likely, signed)


# --- Whether parts were at rest, as warm as the air, where a log begins ---------------------------------

_WINDOW = 10  # steps that are added up: in one, a part at rest would lose less than a coarse sensor rounds
_ROUNDING = 0.41  # of a sensor's step: √(2/12), by which rounding scatters the difference of two readings
_WORKED = 0.2  # of their warmth, by which parts differ that worked together: a standard deviation


def rest_evidence(log: Channels, warm: Mapping[str, float], *, all_warm: bool) -> float:
    r"""Log likelihood ratio that some parts begin at rest, and their sensors read too much, to that no sensor does.

    The sensors begin `warm` [K] above the air, and read as much too much as the middle one; `all_warm` where no other
    does. Either way no part has heat but by its load and speed, and one without a load none at all. So parts that were
    warm cool without a load, each from where its work had left it; parts at rest stay, and are alike, whatever an
    offset says. Both fit the law of each part with as many coefficients: of logs without an offset at most one in
    :math:`e^x` has a ratio above x (Markov's inequality). NaN where none of these parts has a law: a computer is warm
    by heat of its own.
    """
    above, evidence = float(np.median(list(warm.values()))), np.nan
    shifted = log.with_channels({key: log.values[key] - above for key in warm})
    passive = [key for key in log.sensors if key != log.air and not has_own_heat(place_of(key))]
    for key in passive if log.loads and not warm.keys().isdisjoint(passive) else ():
        laws = [warming(told, key, log.load_of(place_of(key))) for told in (log, shifted)]
        windows = (law.over(_WINDOW) for law in laws if law)
        off = [window.off for window in windows if window.rows.size]  # a log in short pieces has none
        if len(off) == 2:
            noise = min(MAD_TO_SIGMA * float(np.median(np.abs(one))) for one in off)
            sizes = [np.abs(one) / max(noise, _ROUNDING * log.sensors[key].step, _NOISE) for one in off]
            # Large errors count by their size alone, and each step once of the windows that it is in.
            right, other = (np.where(x < _FAR, 0.5 * x**2, _FAR * (x - 0.5 * _FAR)).sum() / _WINDOW for x in sizes)
            evidence = float(np.nansum([evidence, right - other]))
    if all_warm:
        worked, at_rest, spread = _WORKED * above, 0.5 * ALIKE, float(np.var(list(warm.values())))
        alike = np.log(worked / at_rest) + 0.5 * spread * (worked**-2 - at_rest**-2)
        evidence += (len(warm) - 1) * float(alike)
    return evidence


# --- Whose heat a temperature follows ---------------------------------------------------------------


TOLD = 2.0
"""Of `heat_told`, where a load surely heats a part: of joints of virtual legs and arms that were commanded alike it was
2.3 and more, with sensors of 0.1 K."""
DOUBTED, AT_MOST = 1.0, 4
"""Of `heat_told`, below which a part may be heated by another's load, and how many of those that are told the least:
where it moves, its speed tells of its heat, too, and all of a quadruped's thighs would take as long as all else."""


def heat_told(law: Warming) -> float:
    r"""By how much a load explains a warming: :math:`\log (e_0^2 / e^2)` of the law's errors without and with it."""
    designs = law.design[:, 1:], law.design
    more, less = (float(law.moved @ (law.moved - x @ np.linalg.lstsq(x, law.moved)[0])) for x in designs)
    noise = law.moved.size * _FLOOR**2
    return float(np.log((more + noise) / (less + noise)))


_FLOOR = 1e-3  # K: what no sensor's means over a block are better than
_BETTER = 0.3
"""Of the statistic of `exchanged`: the other order leaves a quarter less of the squared error. On virtual robots it is
0 in the right one; of joints exchanged, at least 0.39 with sensors of 1 K steps, 1.5 with others."""


def exchanged(
    log: Channels, quantity: str, most: float = np.inf, at_most: int | None = None
) -> tuple[dict[str, str], float]:
    r"""For each place the one whose torque, or current, its temperature follows, if not all their own; the statistic.

    Of places of whose warming their own load tells less than `most`, by `heat_told`, the least. With the mean error
    :math:`e_{ij}` that the law of joint i's temperature leaves where joint j's load heats it, the assignment with the
    least sum of :math:`\log e_{ij}^2` is compared with the given one: the statistic is the mean of
    :math:`\log (e_{ii}^2 / e_{i \pi(i)}^2)` over the joints that change, each of which has to follow the other's load
    better than its own. Joints that work alike give next to 0, whatever their order, and heat from a neighbour does not
    matter, since it would have to fit both ways.
    """
    places = [place for key in log.of("temperature") if f"{quantity}.{(place := place_of(key))}" in log.values]
    own = {place: warming(log, f"temperature.{place}", f"{quantity}.{place}") for place in places}
    told = {place: gain for place, law in own.items() if law and (gain := heat_told(law)) < most}
    least = sorted(told.values())[:at_most]
    places = [place for place in told if told[place] in least]
    laws = [[warming(log, f"temperature.{part}", f"{quantity}.{of}") for of in places] for part in places]
    if len(places) < 2 or any(law is None for row in laws for law in row):
        return {}, 0.0
    errors = np.array([[law.error for law in row if law] for row in laws])
    costs = 2 * np.log(errors + _FLOOR)
    if (np.diag(costs) - costs.min(axis=1)).max() < _BETTER:
        return {}, 0.0
    from scipy.optimize import linear_sum_assignment  # heavy, and few logs need it

    order = linear_sum_assignment(costs)[1]
    moved = np.flatnonzero(order != np.arange(order.size))
    gains = costs[moved, moved] - costs[moved, order[moved]]
    if not moved.size or gains.min() <= 0 or (gain := float(gains.mean())) < _BETTER:
        return {}, 0.0
    return dict(zip(places, (places[k] for k in order), strict=True)), gain


# --- Stretches in which a part would not have stayed where its sensor says that it was --------------

_STEPS, _TIMES, _USUAL = 3.0, 3.0, 0.95
"""Steps of the sensor, and times what so many of the stretches as long are off by, at the most, that a part is off in a
stretch in which its sensor happens to stand."""
_WORSE, _LIKELIER = 1.5, 9.0
"""Times the usual error of a step, by which such stretches make the law worse if they count, for each of their steps or
of the others, whichever are fewer; and that, times how far beyond `most` they are: a law that has never seen how a part
cools is wrong where it does, and no worse for learning it. Of healthy quadrupeds and legs the product was up to 7.2."""
_OF_MOVES, _OF_FALL = 0.1, 0.5
"""Of what a part moves by, up to which a law is off in a step, and of a way down to the air: resistances and surfaces
that change with temperature are no part of it."""
_ASKED = 10  # stretches, the longest: those of a whole day's coarse sensor at rest would take minutes
_SPARE = 8  # steps more than the law has coefficients
_RISES = 0.2  # K from block to block: it does not fall to the air


def against_heat(log: Channels, key: str, load: str, resolution: float) -> list[tuple[int, int]]:
    """First and last rows of stretches in which a temperature stands, or is the air's, and the part is elsewhere.

    Or it does not follow its load from some row on, or up to it, though it stays as warm.

    It reads in steps of `resolution` [K], 0 for none, and `load` heats its part.
    """
    there = np.flatnonzero(np.isfinite(log.values[key]))
    law = warming(log, key, load) if there.size else None
    if law is None:
        return []
    groups: dict[object, list[tuple[int, int]]] = {one: [one] for one in _at_the_air(log, key)}
    readings, (first, last) = log.values[key][there], standing(log.values[key][there])
    at_limit = np.isin(readings[first], (readings.min(), readings.max()))
    long = log.time[there[last]] - log.time[there[first]] >= np.where(at_limit, SHORTEST, STILL)
    for k in np.flatnonzero(long).tolist():
        # A limit that holds once holds whenever it is reached.
        group = groups.setdefault(float(readings[first[k]]) if at_limit[k] else (k,), [])
        group.append((int(there[first[k]]), int(there[last[k]])))
    found: list[tuple[int, int]] = []
    known = np.ones(law.moved.size, dtype=bool)
    for group in sorted(groups.values(), key=lambda group: -sum(last - first for first, last in group))[:_ASKED]:
        steps = [tuple(np.searchsorted(law.rows, np.array(one) // log.block)) for one in group if one not in found]
        if steps and _is_contradicted(law, steps, known, resolution):
            found += [stretch for stretch in group if stretch not in found]
            for begin, end in steps:
                known[max(begin - 1, 0) : end + 1] = False
    log.gains[load] = change = None if found else gain_change(log, law, key, load)
    return [change.rows] if change and change.still else found


def _at_the_air(log: Channels, key: str) -> list[tuple[int, int]]:
    """Stretches in which a temperature is that of the air after it was warmer, and before in which it falls to it."""
    if log.air not in log.values or key == log.air:
        return []
    warmth = log.means(key) - log.means(log.air)
    cold = (np.abs(warmth) < 0.5 * ALIKE) & np.logical_or.accumulate(warmth > 2 * ALIKE)
    return [(_last_rise(log, key, begin) * log.block, end * log.block - 1) for begin, end in spans(cold)]


def contradicted(log: Channels, key: str, stretch: IntArray) -> bool:
    """Whether a part goes otherwise from one row to another, and there from where it last rose, than by its law.

    By that its load does not cool it, and no other heat, nor loss of heat, sets in at some row for good.
    """
    law = warming(log, key, load := log.load_of(place_of(key)))
    if law is None or (load and np.linalg.lstsq(law.design, law.moved)[0][0] < 0):
        return True
    change = changed(law, law.other)
    sets_in = change is not None and (change.begin == 0 or change.end == law.moved.size)
    if change and sets_in and change.error < _CHANGED * law.error:
        return True
    begin, end = (stretch // log.block).tolist()
    steps = np.searchsorted(law.rows, [_last_rise(log, key, begin), end])
    return _is_contradicted(law, [tuple(steps)], np.ones(law.moved.size, dtype=bool), log.sensors[key].step)


def _last_rise(log: Channels, key: str, block: int) -> int:
    """The block from which on a temperature does not rise until some other one."""
    rises = np.flatnonzero(np.diff(log.means(key))[:block] > max(_RISES, 0.5 * log.sensors[key].step))
    return int(rises[-1]) + 1 if rises.size else 0


def _is_contradicted(law: Warming, stretches: Sequence[tuple[int, ...]], known: BoolArray, resolution: float) -> bool:
    """Whether in one of some stretches, from a step to the one behind the last, the part would have moved otherwise.

    Those steps are `known`, (m,), that are no others'.
    """
    asked = np.zeros(law.moved.size, dtype=bool)
    for begin, end in stretches:
        asked[max(begin - 1, 0) : end + 1] = True
    told = known & ~asked
    if np.count_nonzero(told) < _SPARE + law.design.shape[1]:
        return False
    off, moved = law.fitted(told)[1], law.moved
    usual = max(float(np.mean(np.abs(off[told]))), _OF_MOVES * float(np.mean(np.abs(moved[told]))))
    usual = max(usual, float(np.finfo(float).tiny))  # of a robot at rest without any noise
    few = min(np.count_nonzero(asked), np.count_nonzero(told))
    worse = float(np.abs(law.fitted(known)[1][known | asked]).sum() - np.abs(off[told]).sum()) / few / usual
    total, elsewhere = (np.concatenate(([0.0], np.cumsum(x))) for x in (off, np.where(told, off, 0.0)))
    for begin, end in stretches:
        as_long = np.abs(elsewhere[end - begin :] - elsewhere[: elsewhere.size - end + begin])
        most = max(ALIKE, _STEPS * resolution, _TIMES * float(np.quantile(as_long, _USUAL)))
        most = max(most, _OF_FALL * abs(float(moved[begin:end].sum())))
        times = abs(total[end] - total[begin]) / most
        if end > begin and worse > _WORSE and times > 1 and worse * times > _LIKELIER:
            return True
    return False


# --- A stretch in which a term of the law is another: a load's heat, other heat that sets in -----------

_ROWS, _STEPS_AT_LEAST = 10, 60
"""Numbers in a block, of fewer of which the mean square of a load that swings is not known; steps of a log."""
_LEAST_PARTS, _ROUNDS, _EACH = 12, 6, 3
"""Steps of it and of the rest, that tell a term; times that its ends are moved; steps between ends that are tried."""
_CHANGED, _STANDS = 0.7, 0.5
"""Of the mean error of one law, and of one whose other heat, or loss to the air, changes, that is left at the most
where a load's heat changes, and where the part stands. Of 360 joints of healthy virtual robots what differs by `_RATIO`
to the log's end left 0.75 at least, what stands 0.66. Of 48 torques that turn into amperes, half of them beside joints
that work alike, 39 left less; stuck sensors left 0.24 at the most."""
_RATIO = 3.0
"""By which heats differ: friction, iron and a winding that warms change them by less, a unit by the square of more."""
_LOADED = 0.02  # of the mean square, in it and else: with less load other heat is all that warms a part
_NO_HEAT = 0.15  # of the heat else, that a stretch which ends makes at the most: units change for good
_NO_UNIT = 1 / 250  # of it, that a stretch to the end makes at the least: by the square of a gear of 16
_STILL = 0.5  # of the way that a part would go without heat, that a sensor goes at the most which stands


class Change(NamedTuple):
    """Steps of a law, from `begin` to the one before `end`, in which one of its terms is another.

    Args:
        begin: the first of these steps.
        end: the one behind the last.
        sides: the coefficients else, and those in these steps, (columns,) each.
        error: what the law with both leaves, a mean size [K].
    """

    begin: int
    end: int
    sides: tuple[FloatArray, FloatArray]
    error: float


def _where_changed(law: Warming, term: int) -> list[tuple[int, int]]:
    """The stretch, and the one to the end, in which another coefficient of a term explains most of the squared error.

    By the score test, for all at once: with the error r of one law, what the term z has in a stretch explains
    (z·r)² / (z·Mz), where M takes out what the other terms explain of it.
    """
    columns, count = law.design * law.likely, law.moved.size
    inverse = np.linalg.inv(columns.T @ columns + _NOISE**2 * np.eye(law.likely.size))
    size = columns[:, term]
    off = law.moved - columns @ (inverse @ (columns.T @ law.moved))
    summed = np.cumsum(np.column_stack([size * off, size**2, columns * size[:, None]]), axis=0)
    summed = np.concatenate([np.zeros((1, summed.shape[1])), summed])
    ends = np.append(np.arange(0, count, _EACH), count)
    begin, end = (ends[one] for one in np.triu_indices(ends.size, 1))
    long = (end - begin >= _LEAST_PARTS) & (end - begin <= count - _LEAST_PARTS)
    begin, end = begin[long], end[long]
    follows, square, beside = np.split(summed[end] - summed[begin], [1, 2], axis=1)
    own = square[:, 0] - ((beside @ inverse) * beside).sum(axis=1)
    explained = follows[:, 0] ** 2 / (own + _NOISE**2)
    best = (np.argmax(explained), np.argmax(np.where(end == count, explained, -1.0))) if begin.size else ()
    return [(int(begin[one]), int(end[one])) for one in best]


def changed(law: Warming, term: int | None) -> Change | None:
    """The stretch that leaves the least error where a term of the law, one of its columns, is another in it.

    Of no term it is that in which the part does not change at all. It begins as where another coefficient explains
    most, and is then that in which its own law is better than the rest's by most, until that is no better; `None` of
    short ones.
    """
    steps, best, tried = np.arange(law.moved.size), None, set[tuple[int, int]]()
    for begin, end in _where_changed(law, term or 0):
        for _ in range(_ROUNDS):
            if (begin, end) in tried or not _LEAST_PARTS <= end - begin <= steps.size - _LEAST_PARTS:
                break
            tried |= {(begin, end)}
            stretch = (begin <= steps) & (steps < end)
            both = replace(law, design=law.design * ~stretch[:, None]) if term is None else law.apart([term], stretch)
            found, off = both.fitted()
            outside, error = found[: law.likely.size], float(np.abs(off).mean())
            within = np.where(np.arange(outside.size) == term, found[-1], outside if term is not None else 0.0)
            if best is None or error < best.error:
                best = Change(begin, end, (outside, within), error)
            more = np.abs(law.moved - law.design @ outside) - np.abs(law.moved - law.design @ within)
            total = np.concatenate(([0.0], np.cumsum(more)))
            end = int(np.argmax(total - np.minimum.accumulate(total)))
            begin = int(np.argmin(total[: end + 1]))
    return best


def _likely_change(law: Warming) -> Change | None:
    """Where the load's heat is another, or the part stands, if no other term's change explains it nearly as well."""
    changes = [(change, most) for term, most in ((0, _CHANGED), (None, _STANDS)) if (change := changed(law, term))]
    change, most = min(changes, key=lambda one: one[0].error, default=(None, 0.0))
    if change is None or change.error > most * law.error:
        return None
    others = [other.error for term in (law.other, law.other + 1) if (other := changed(law, term))]
    return change if change.error <= most * min(others, default=np.inf) else None


def gain_change(log: Channels, law: Warming | None, key: str, load: str) -> GainChange | None:
    """Where a load makes another heat in the part of temperature `key` than else; `None` where it makes the same.

    Or where the part, which warms by `law`, doesn't change at all, though by the law it would. Other heat, or loss to
    the air, that is another in any stretch explains it worse. A unit changes once, so to the log's end.
    """
    if law is None or log.block < _ROWS or law.rows.size < _STEPS_AT_LEAST:
        return None
    stands = np.subtract(*standing(log.values[load])[::-1]) + 1  # rows, that each number does
    known = log.block / usual_length(stands)[0]  # in fewer than one a number stands for longer, and is known
    if 1 < known < _ROWS or (change := _likely_change(law)) is None:
        return None
    (start, stop, sides, _), count = change, law.rows.size
    square = np.concatenate(([0.0], np.cumsum(law.design[:, 0])))
    # Where there is no load the stretch may as well go on, to the end of the log or to its start.
    idle = [square[b] - square[a] <= _LOADED * (b - a) * square[-1] / count for a, b in ((0, start), (stop, count))]
    stop, stands_still = count if idle[1] else stop, not sides[1].any()
    if start < _LEAST_PARTS and stop == count:
        return None
    if (idle[0] or start < _LEAST_PARTS) and stop < count and not stands_still:
        start, stop, sides = stop, count, sides[::-1]
    without, within = (float(side[0]) for side in sides)
    if max(within, without) <= _RATIO * min(within, without):
        return None
    if without <= _NO_UNIT * within and stop == count:  # it makes no heat until then
        start, stop, within, without, sides = 0, start, without, within, sides[::-1]
    ratio, to_the_end = within / max(without, float(np.finfo(float).tiny)), stop == count
    other_way = law.moved - (law.off if stands_still else law.design[:, 1:] @ sides[0][1:])
    moved, otherwise = (np.ptp(np.cumsum(x[start:stop])) for x in (law.moved, other_way))
    first = (int(law.rows[start]) + 1) * log.block if start else 0
    last = log.time.size - 1 if to_the_end else (int(law.rows[stop - 1]) + 2) * log.block - 1
    still = ratio < _NO_HEAT and bool(moved < min(ALIKE, _STILL * otherwise))
    if stands_still and not (still and otherwise > log.sensors[key].step):
        return None  # it is in equilibrium
    if not (still or to_the_end or ratio < _NO_HEAT):
        return None
    of_a_unit = to_the_end and not still and _NO_UNIT < ratio < 1 / _NO_UNIT
    return GainChange((first, last), of_a_unit * ratio, still)
