"""Which channel is wrong where readings and model disagree: hypotheses, scored by the likelihood of one filter.

A node that is warmer than the model says has a sensor that reads too much, or more heat than the log's torque, current
or speed says, or air that the log has wrong; or the model is off there. A wrong sensor goes its own way, and all others
follow the model; heat moves the neighbours, too, and moves nothing at once. Each hypothesis is a `Suspicion`: the run,
and what of it is free over the model's own errors. That every capacity, resistance and loss may be off belongs to all
of them, so a model that is a little wrong never has to be a fault of somebody else.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.logs.columns import INPUTS
from lptn.model.model import Model
from lptn.online.augmented_model import ModelError, by_node
from lptn.online.calibration import Calibration
from lptn.online.estimator import run_filter
from lptn.online.fault_likelihood import LEAST_NOISE, first_alarm, gaussian_estimator
from lptn.online.sensor_faults import Alarm, Kind
from lptn.simulate.bound_run import BoundRun
from lptn.simulate.simulation import simulate

MODEL_OFF = 0.1
"""Relative standard deviation of each of the model's free parameters: data sheets, and fits to other loads, are so far
off. Readings learn more of them within minutes."""
DECIDES = 10.0
"""nats by which readings must be likelier: odds of 20,000, for a thermal model is wrong for minutes on end, and its
readings say less than if each stood for itself."""
_LIFTS = np.geomspace(1 / 600, 1 / 6, 5)  # K/s; so fast unknown heat warms its node: a motor's peak at most


def loads(model: Model) -> dict[str, str]:
    """The input that tells what heats a joint, by node."""
    columns = [(*column.partition(".")[::2], column) for column in model.inputs]
    return {place: column for quantity, place, column in reversed(columns)
            if quantity in INPUTS and place in model.nodes}  # fmt: skip


def suspects(model: Model, node: str) -> list[str]:
    """The inputs that lead a node's temperature astray: loads of its own and of its neighbours, and the air."""
    near = {node, *(end for link in model.network.resistors if node in link.ends for end in link.ends)}
    own = [column for place, column in sorted(loads(model).items(), key=lambda one: one[0] != node) if place in near]
    return own + [column for column in model.inputs if column.startswith("temperature.")]


@dataclass(frozen=True)
class Suspicion:
    """A run in the detector's steps, and what may be wrong with it.

    Args:
        model: the model.
        run: the run.
        measured: readings that are believed [degC], NaN elsewhere, shape (nodes, n).
        calibration: noise and limits.
        error: what the model and the log's inputs may be wrong by.
    """

    model: Model
    run: BoundRun
    measured: FloatArray
    calibration: Calibration
    error: ModelError

    @cached_property
    def filtered(self) -> tuple[FloatArray, FloatArray]:
        """Logarithms of the likelihood of each step's innovations, (n,); temperatures [degC], shape (nodes, n)."""
        estimator = gaussian_estimator(self.model, self.calibration.noise, self.error, MODEL_OFF)
        log_likelihoods, temperatures = np.zeros(len(self.run)), []
        for k, estimate in enumerate(run_filter(estimator, self.run, self.measured)):
            temperatures.append(estimate.temperatures)
            if estimator.last is not None:
                log_likelihoods[k] = estimator.last.log_likelihood
        return log_likelihoods, np.array(temperatures).T

    @cached_property
    def alarm(self) -> Alarm | None:
        """The first one among the sensors that are believed."""
        if not np.isfinite(self.measured).any():
            return None
        estimator = gaussian_estimator(self.model, self.calibration.noise, self.error)
        return first_alarm(estimator, self.run, self.measured, self.calibration.limits)

    def behind(self, onset: float) -> BoolArray:
        """Steps that end behind a time [s], shape (n,)."""
        return np.asarray(self.run.run.time > onset - self.run.run.step)

    def nats(self, onset: float = -np.inf) -> float:
        """Logarithm of the likelihood of all readings behind a time [s]."""
        return float(self.filtered[0][self.behind(onset)].sum())

    def without(self, rows: Sequence[int], onset: float) -> Suspicion:
        """The same without some sensors' readings behind a time [s]."""
        measured = self.measured.copy()
        measured[np.array(rows)[:, None], self.behind(onset)] = np.nan
        return replace(self, measured=measured)

    def with_readings(self, rows: Sequence[int], values: FloatArray) -> Suspicion:
        """The same with other readings of some sensors [degC], shape (rows, n)."""
        measured = self.measured.copy()
        measured[list(rows)] = values
        return replace(self, measured=measured)

    def with_inputs(self, rows: Sequence[int], values: FloatArray) -> Suspicion:
        """The same with other values of some inputs, shape (rows, n)."""
        inputs = self.run.inputs.copy()
        inputs[list(rows)] = values
        return replace(self, run=replace(self.run, inputs=inputs))

    def with_unknown_input(self, column: str, lift: float = float(_LIFTS[2])) -> Suspicion:
        """The same with heat [K/s] at a joint that its load doesn't tell, or air that is far off."""
        if column.startswith("temperature."):
            return replace(self, error=replace(self.error, inputs={**self.error.inputs, column: _FREE}))
        place = column.partition(".")[2]
        capacity = float(self.model.values[self.model.network.capacities[place]])
        heat = dict(zip(self.model.nodes, by_node(self.error.heat, self.model.nodes).tolist(), strict=True))
        return replace(self, error=replace(self.error, heat=heat | {place: capacity * lift}))


# --- What a sensor that is wrong reads ------------------------------------------------------------

_FREE = 10.0  # K; so far off a wrong sensor may be at the onset, and the air all the while
_SLOPE = 0.3  # K a step; and so fast it may drift: 1 K in half a minute
_WALKS = np.geomspace(0.003, 3.0, 7)  # K; by how much what a sensor adds may wander from one step to the next
_BENDS = _WALKS / 10  # K a step; or its slope, for the air, a surface, a body that it touches now move smoothly
_LAGS = (30.0, 60.0, 120.0, 240.0, 480.0, 960.0)  # s; a factor of two is as finely as a lag is known
_OWED = 10.0  # nats by which a lag, which a missing mass resembles, or part of the air must explain more than others
_LOOSENS = 100.0  # s; a sensor in a drop of glue follows the air so late
_FEWEST = 12  # readings behind the onset, that a name needs


class _Course(NamedTuple):
    """What a sensor reads with one fault: kind, size, words, readings [degC] of shape (n,), nats owed."""

    kind: Kind
    size: float | None
    detail: str
    path: FloatArray  # (n,)
    owed: float = 0.0


def _courses(others: Suspicion, measured: FloatArray, row: int, onset: float) -> Iterator[_Course]:
    """The table of a sensor's faults, beside what the model and all other sensors let expect behind the onset."""
    behind, since, step = others.behind(onset), np.maximum(others.run.run.time - onset, 0.0), others.run.run.step
    expected, readings = others.filtered[1][row], measured[row]
    seen, level = behind & np.isfinite(readings), np.ones(len(since))
    number = 0.5 * float(np.log(seen.sum()))  # what a free number costs, by the Bayesian information criterion

    def size(of: FloatArray) -> float:
        """By how much of a course the readings are off, by least squares."""
        return float((readings - expected)[seen] @ of[seen]) / max(float(of[seen] @ of[seen]), 1e-9)

    yield _Course("offset", size(level), "", expected + size(level), number)
    yield _Course("drift", size(since), "", expected + size(since) * since, number)
    for column, values in zip(others.model.inputs, others.run.inputs, strict=True):
        if column.startswith("temperature."):
            near = _lagged(np.where(behind, values - expected, 0.0), _LOOSENS, step, behind)
            share = size(near)
            yield _Course("disconnected", None, f"reads {column}", values)
            if 0 < share <= 1:
                detail = f"reads {share:.0%} of {column}"
                yield _Course("disconnected", None, detail, expected + share * near, number + _OWED)
    constant = float(readings[seen].mean())
    yield _Course("stuck", None, f"at {constant:.3g} degC", np.full(len(since), constant), number)
    for lag in _LAGS:
        yield _Course("lag", lag, "", _lagged(expected, lag, step, behind), number + _OWED)
    for other, node in enumerate(others.model.nodes):
        beside = seen & np.isfinite(measured[other])
        # The other one reads what this one should, too.
        if other != row and beside.sum() >= _FEWEST and _nearer(measured[other], readings, expected, beside):
            both = others.without([other], onset).filtered[1]
            if _nearer(both[row], both[other], measured[other], beside):
                yield _Course("swapped", None, f"with {node}", both[other])


def _nearer(one: FloatArray, other: FloatArray, to: FloatArray, where: BoolArray) -> bool:
    """Whether one course is nearer to a third than another, by squares."""
    return bool(np.square(one - to)[where].sum() < np.square(other - to)[where].sum())


def _lagged(path: FloatArray, lag: float, step: float, behind: BoolArray) -> FloatArray:
    """A path that is followed with a time constant [s] from the onset on."""
    lagged, keep = path.copy(), float(np.exp(-step / lag))
    for k in np.flatnonzero(behind).tolist():
        lagged[k] = keep * lagged[max(k - 1, 0)] + (1 - keep) * path[k]
    return lagged


def _nats(off: FloatArray, along: FloatArray, noise: float) -> float:
    """Logarithm of the likelihood of readings that are off a course, in noise of a variance [K²].

    Beside the noise they are off by a multiple of another course: this, or its slope, wanders, in the size that is
    likeliest. Arrays have shape (n,).
    """
    wandering, bending = np.square([[*_WALKS, *0 * _BENDS], [*0 * _WALKS, *_BENDS]])
    level, slope, total = (np.zeros(wandering.size) for _ in range(3))
    of_level, of_slope, of_both = (np.full(wandering.size, size**2) for size in (_FREE, _SLOPE, 0.0))
    for error, share in zip(off.tolist(), along.tolist(), strict=True):
        if np.isfinite(error):
            variance, surprise = share**2 * of_level + noise, error - share * level
            total -= 0.5 * (surprise**2 / variance + np.log(variance))
            moved = share * surprise / variance
            level, slope = level + of_level * moved, slope + of_both * moved
            of_slope = of_slope - (share * of_both) ** 2 / variance
            of_level, of_both = of_level * noise / variance, of_both * noise / variance
        level = level + slope
        of_level, of_both = of_level + 2 * of_both + of_slope + wandering, of_both + of_slope
        of_slope = of_slope + bending
    return float(total.max())


def _of_a_sensor(given: Suspicion, row: int, onset: float) -> float:
    """Logarithm of the likelihood behind the onset that a sensor is wrong, in the way that is likeliest.

    It is off by a number, or drifts, and goes on to tell of its node. Or it reads anything, beside the course of a
    fault or in a mean of its node and of cooler air.
    """
    others, behind, readings = given.without([row], onset), given.behind(onset), given.measured[row]
    if not np.isfinite(readings[behind]).any():
        return others.nats(onset)
    expected, courses = others.filtered[1][row], list(_courses(others, given.measured, row, onset))
    wandering = [(readings - course.path, np.ones(behind.size)) for course in courses]
    for column, air in zip(given.model.inputs, given.run.inputs, strict=True):
        if column.startswith("temperature.") and np.nansum(((readings - expected) * (air - expected))[behind]) > 0:
            wandering.append((readings - expected, (air - expected) / _FREE))
    noise = max(float(given.calibration.noise.floor[row]), LEAST_NOISE) ** 2
    nats = [others.nats(onset) + max(_nats(off[behind], along[behind], noise) for off, along in wandering)]
    for course in courses[:2]:
        added = np.where(behind, course.path - expected, 0.0)
        nats.append(given.with_readings([row], readings - added).nats(onset))
    return max(nats)


def named(given: Suspicion, measured: FloatArray, alarm: Alarm) -> Alarm:
    """The same alarm, named by the fault whose course leaves least of all readings behind its onset unexplained.

    Args:
        given: the run with those readings that nothing speaks against.
        measured: all readings [degC], NaN where missing, shape (nodes, n).
        alarm: an offset, a drift or a lag.
    """
    row = given.model.nodes.index(alarm.node)
    seen, noise = given.behind(alarm.onset) & np.isfinite(measured[row]), float(given.calibration.noise.floor[row]) ** 2

    def cost(course: _Course) -> float:
        """Minus the logarithm of the likelihood, with what the free numbers cost."""
        left = float(np.square(measured[row] - course.path)[seen].mean())
        return 0.5 * float(seen.sum()) * float(np.log(left + noise)) + course.owed

    if seen.sum() < _FEWEST:
        return alarm
    best = min(_courses(given.without([row], alarm.onset), measured, row, alarm.onset), key=cost)
    return replace(alarm, kind=best.kind, size=best.size, detail=best.detail)


# --- The table of what may be wrong ---------------------------------------------------------------

_SCALES = (0.5, 0.7, 1.4, 2.0)  # of a load; its heat is half to twice as much between two of them


class _Answer(NamedTuple):
    """What explains an alarm: nats gained, the channels in words, their alarms, the run with them as they may be."""

    gain: float
    what: str
    alarms: list[Alarm]
    after: Suspicion


def attributed(given: Suspicion, alarm: Alarm) -> tuple[list[Alarm], Suspicion]:
    """Whose alarm it is: of the hypothesis under which the readings are clearly likelier than under any other.

    Args:
        given: the run, with all that was found before.
        alarm: of a sensor that goes its own way.

    Returns:
        The alarms, none where the model's own errors explain as much; and the run with what was found, or without the
        sensor's readings.
    """
    row = given.model.nodes.index(alarm.node)
    without = given.without([row], alarm.onset)
    if not np.isnan(without.measured[row]).sum() > np.isnan(given.measured[row]).sum():
        without = given.without([row], -np.inf)  # it is called again for what was read before
    gain = _of_a_sensor(given, row, alarm.onset) - given.nats(alarm.onset)
    sensor = _Answer(gain, f"temperature.{alarm.node}", [alarm], without)
    others = sorted([*_inputs(given, alarm), *_exchanges(given, alarm)], key=lambda answer: -answer.gain)
    best, *rivals = sorted([sensor, *others], key=lambda answer: -answer.gain)
    if best.gain < DECIDES:
        return [], without
    # Without healthy logs nobody knows how wrong the model is about a node's heat.
    unsure = best.alarms[0].kind == "input" and len(best.alarms) == 1 and given.calibration.hours == 0
    rivals = [rival for rival in rivals if rival.gain > best.gain - DECIDES] or [sensor] * unsure
    if not rivals:
        return best.alarms, best.after
    what = undecided(alarm, f"{best.what} or {rivals[0].what}")
    # The sensor is not believed, and the rest is as the likeliest of the others says.
    return [what], (others[0] if best is sensor else best).after.without([row], alarm.onset)


def undecided(alarm: Alarm, what: str) -> Alarm:
    """An alarm of one or the other."""
    return Alarm(alarm.node, "undecided", alarm.time, alarm.onset, detail=f"{what} is wrong: not decided which")


def _inputs(given: Suspicion, alarm: Alarm) -> Iterator[_Answer]:
    """A load that is wrong, at the node or near it, or the air; of the likeliest load the size, too."""
    model, onset = given.model, alarm.onset
    freed = {column: given.with_unknown_input(column) for column in suspects(model, alarm.node)}
    driving = freed.keys() & loads(model).values()
    likeliest = max(driving, key=lambda column: freed[column].nats(onset), default="")
    for column, trial in freed.items():
        trials, place = [trial], column.partition(".")[2]
        if column == likeliest:
            trials += [given.with_unknown_input(column, lift) for lift in _LIFTS]
            index, scales = model.inputs.index(column), np.where(given.behind(onset), np.array(_SCALES)[:, None], 1.0)
            trials += [given.with_inputs([index], scale * given.run.inputs[index]) for scale in scales]
        best = max(trials, key=lambda trial: trial.nats(onset))
        node = place if place in model.nodes else alarm.node
        detail = "does not explain the temperatures"
        told = Alarm(node, "input", alarm.time, onset, detail=detail, channel=column)
        gain = best.nats(onset) - given.nats(onset)
        yield _Answer(gain, column, [told], best.with_unknown_input(column, _LIFTS[-1]))


def _exchanges(given: Suspicion, alarm: Alarm) -> Iterator[_Answer]:
    """The node's sensor, or load, and that of another node, swapped from the beginning of a run.

    Nobody swaps plugs while a robot works. Only pairs are tried that bring the model, run freely, nearer to the
    readings.
    """
    model, measured, start = given.model, given.measured, float(given.run.run.time[0])
    predicted, driven, row = simulate(model, given.run).readings, loads(model), model.nodes.index(alarm.node)
    everywhere = np.isfinite(measured)
    for other, node in enumerate(model.nodes):
        pair, trials = (alarm.node, node), []
        if node != alarm.node and everywhere[[row, other]].any(axis=1).all():
            trials.append(("temperature", given.with_readings([row, other], measured[[other, row]]), predicted))
        quantity, *differ = {driven.get(place, place).partition(".")[0] for place in pair}
        if node != alarm.node and driven.keys() >= set(pair) and not differ:
            here, there = (model.inputs.index(driven[place]) for place in pair)
            after = given.with_inputs([here, there], given.run.inputs[[there, here]])
            trials.append((quantity, after, simulate(model, after.run).readings))
        for what, after, expected in trials:
            if np.nansum(np.square(after.measured - expected)) < np.nansum(np.square(measured - predicted)):
                alarms = [
                    Alarm(one, "swapped", alarm.time, start, detail=f"with {two}") for one, two in (pair, pair[::-1])
                ]
                if what != "temperature":
                    alarms = [
                        replace(one, kind="input", detail=f"exchanged {one.detail}", channel=driven[one.node])
                        for one in alarms
                    ]
                yield _Answer(after.nats() - given.nats(), f"{what} of {' and '.join(pair)}", alarms, after)
