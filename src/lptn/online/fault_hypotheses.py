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
_LIFTS = (1 / 60, 1 / 600, 1 / 6)  # K/s; so fast heat that nobody knows of warms its node: the last, a motor's peak


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

    def with_unknown_input(self, column: str, lift: float = _LIFTS[0]) -> Suspicion:
        """The same with heat [K/s] at a joint that its load doesn't tell, or air that is far off."""
        if column.startswith("temperature."):
            return replace(self, error=replace(self.error, inputs={**self.error.inputs, column: _FREE}))
        place = column.partition(".")[2]
        capacity = float(self.model.values[self.model.network.capacities[place]])
        heat = dict(zip(self.model.nodes, by_node(self.error.heat, self.model.nodes).tolist(), strict=True))
        return replace(self, error=replace(self.error, heat=heat | {place: capacity * lift}))


# --- What a sensor that is wrong reads ------------------------------------------------------------

_FREE = 10.0  # K; so far off a wrong sensor may be at the onset, and the air all the while
_LAGS = (30.0, 60.0, 120.0, 240.0, 480.0, 960.0)  # s; a factor of two is as finely as a lag is known
_LEAST_LAG_GAIN = 10.0  # nats by which a lag, which a missing mass resembles, must explain more than any other
_FEWEST = 12  # readings behind the onset, that a name needs
_WALKS = tuple(np.geomspace(0.003, 3.0, 7))  # K; by how much what a sensor adds may wander from one step to the next
_SLOPE = 0.3  # K a step; and so fast it may drift: 1 K in half a minute


class _Course(NamedTuple):
    """What a sensor reads with one fault: kind, size, words, readings [degC] of shape (n,), free numbers, nats owed."""

    kind: Kind
    size: float | None
    detail: str
    path: FloatArray
    free: int = 0
    owed: float = 0.0


def _courses(given: Suspicion, measured: FloatArray, row: int, onset: float) -> Iterator[_Course]:
    """The table of a sensor's faults, beside what the model and all other sensors let expect behind the onset."""
    behind, time = given.run.run.time >= onset, given.run.run.time
    expected, readings = given.without([row], onset).filtered[1][row], measured[row]
    seen, since = behind & np.isfinite(readings), np.maximum(time - onset, 0.0)
    level, rate = _level_and_rate(readings - expected, behind, since)
    yield _Course("offset", level, "", expected + level, 1)
    yield _Course("drift", rate, "", expected + rate * since, 1)
    for column, values in zip(given.model.inputs, given.run.inputs, strict=True):
        if column.startswith("temperature."):
            yield _Course("disconnected", None, f"reads {column}", values)
    for lag in _LAGS:
        yield _Course("lag", lag, "", _lagged(expected, lag, given.run.run.step, behind), 1, _LEAST_LAG_GAIN)
    for other, node in enumerate(given.model.nodes):
        beside = seen & np.isfinite(measured[other])
        # The other one reads what this one should, too.
        if other != row and beside.sum() >= _FEWEST and _nearer(measured[other], readings, expected, beside):
            both = given.without([row, other], onset).filtered[1]
            if _nearer(both[row], both[other], measured[other], beside):
                yield _Course("swapped", None, f"with {node}", both[other])


def _nearer(one: FloatArray, other: FloatArray, to: FloatArray, where: BoolArray) -> bool:
    """Whether one course is nearer to a third than another, by squares."""
    return bool(np.square(one - to)[where].sum() < np.square(other - to)[where].sum())


def named(given: Suspicion, measured: FloatArray, alarm: Alarm) -> Alarm:
    """The same alarm, named by all that was read behind its onset, the model being right.

    The fault whose course leaves least of the readings unexplained gives the name, each free number having to pay for
    itself by the Bayesian information criterion.

    Args:
        given: the run with those readings that nothing speaks against.
        measured: all readings [degC], NaN where missing, shape (nodes, n).
        alarm: an offset, a drift or a lag.
    """
    row = given.model.nodes.index(alarm.node)
    seen = (given.run.run.time >= alarm.onset) & np.isfinite(measured[row])
    count, noise = int(seen.sum()), float(given.calibration.noise.floor[row]) ** 2
    if count < _FEWEST:
        return alarm

    def cost(course: _Course) -> float:
        """Minus the logarithm of the likelihood, with what the free numbers cost."""
        left = float(np.mean(np.square(measured[row] - course.path)[seen])) + noise
        return 0.5 * count * float(np.log(left)) + 0.5 * course.free * float(np.log(count)) + course.owed

    best = min(_courses(given, measured, row, alarm.onset), key=cost)
    return replace(alarm, kind=best.kind, size=best.size, detail=best.detail)


def _lagged(path: FloatArray, lag: float, step: float, behind: BoolArray) -> FloatArray:
    """A path that is followed with a time constant [s] from the onset on."""
    lagged, keep = path.copy(), float(np.exp(-step / lag))
    for k in np.flatnonzero(behind).tolist():
        lagged[k] = keep * lagged[max(k - 1, 0)] + (1 - keep) * path[k]
    return lagged


def _level_and_rate(off: FloatArray, behind: BoolArray, since: FloatArray) -> tuple[float, float]:
    """What a sensor is off by behind an onset, as a level [K] and as a drift from 0 [K/s], by least squares."""
    seen = behind & np.isfinite(off)
    if not seen.any():
        return 0.0, 0.0
    return float(off[seen].mean()), float(off[seen] @ since[seen]) / max(float(since[seen] @ since[seen]), 1e-9)


def _of_a_sensor(given: Suspicion, row: int, onset: float) -> float:
    """Logarithm of the likelihood behind the onset that a sensor is wrong, in the way that is likeliest.

    It is off by a number, or drifts; or it reads anything: a level with a slope that wanders, beside what a filter
    without this sensor expects there, or beside that with a lag.
    """
    behind, since = given.behind(onset), np.maximum(given.run.run.time - onset, 0.0)
    others = given.without([row], onset)
    expected, readings = others.filtered[1][row], given.measured[row]
    level, rate = _level_and_rate(readings - expected, behind, since)
    of_shapes = [
        given.with_readings([row], readings - added).nats(onset) for added in (level * behind, np.asarray(rate * since))
    ]
    paths = [expected, *(_lagged(expected, lag, given.run.run.step, behind) for lag in _LAGS)]
    noise = max(float(given.calibration.noise.floor[row]), LEAST_NOISE) ** 2
    return max(
        *of_shapes, others.nats(onset) + max(_level_and_slope((readings - path)[behind], noise) for path in paths)
    )


def _level_and_slope(off: FloatArray, noise: float) -> float:
    """Logarithm of the likelihood of readings that are off by a level with a slope, in noise of a variance [K²]."""
    wandering = np.square(_WALKS)
    level, slope, total = (np.zeros(len(_WALKS)) for _ in range(3))
    of_level, of_slope, of_both = (np.full(len(_WALKS), size**2) for size in (_FREE, _SLOPE, 0.0))
    for error in off.tolist():
        if np.isfinite(error):
            variance, surprise = of_level + noise, error - level
            total -= 0.5 * (surprise**2 / variance + np.log(variance))
            level, slope = level + of_level / variance * surprise, slope + of_both / variance * surprise
            of_slope = of_slope - of_both**2 / variance
            of_level, of_both = of_level * noise / variance, of_both * noise / variance
        level = level + slope
        of_level, of_both = of_level + 2 * of_both + of_slope + wandering, of_both + of_slope
    return float(total.max())


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
    likeliest = max(freed, key=lambda column: freed[column].nats(onset), default="")
    for column, trial in freed.items():
        trials, place = [trial], column.partition(".")[2]
        if column == likeliest and place in loads(model):
            trials += [given.with_unknown_input(column, lift) for lift in _LIFTS[1:]]
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
