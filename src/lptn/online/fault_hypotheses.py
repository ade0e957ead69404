"""Which channel is wrong where readings and model disagree: hypotheses, scored by the likelihood of a filter.

A node that is warmer than the model says has a sensor that reads too much, or more heat than the log's torque, current
or speed says, or air that the log has wrong. A wrong sensor goes its own way, and all others follow the model; heat
moves the neighbours, too, and moves nothing at once. Each hypothesis leaves what it speaks of free, over the model's
own errors, and takes the readings behind the onset in. A sensor is blamed if they are clearly likelier where it may be
wrong than where heat or air alone may be; else an input, if they are clearly likelier where that may be; else neither.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.logs.silence import INPUTS
from lptn.model.model import Model
from lptn.online.augmented_model import ModelError, by_node
from lptn.online.calibration import Calibration
from lptn.online.estimator import run_filter
from lptn.online.fault_likelihood import OFFSET, fault_statistics, first_alarm, gaussian_estimator
from lptn.online.fault_naming import LAGS, lagged
from lptn.online.sensor_faults import Alarm
from lptn.simulate.bound_run import BoundRun
from lptn.simulate.simulation import simulate

DECIDES = 10.0
"""nats by which readings must be likelier: odds of 20,000, for a thermal model is wrong for minutes on end, and its
readings say less than if each stood for itself."""
_FREE = 10.0  # K; so far off a wrong sensor may be at the onset, and the air all the while
_WALKS = tuple(np.geomspace(0.003, 3.0, 7))  # K; by how much that may wander from one step to the next
_SCALES = (0.5, 0.7, 1.4, 2.0)  # of a load; its heat is half to twice as much between two of them
_SLOPE = 0.3  # K a step; and so fast it may drift: 1 K in half a minute
_LIFT = 10.0  # K; so far heat that nobody knows of may warm its node while what the model lacks wanders


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
        estimator = gaussian_estimator(self.model, self.calibration.noise, self.error)
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
        for row in rows:
            measured[row, self.behind(onset)] = np.nan
        return replace(self, measured=measured)

    def with_added(self, row: int, added: FloatArray) -> Suspicion:
        """The same with something added to a sensor's readings [K], shape (n,)."""
        measured = self.measured.copy()
        measured[row] += added
        return replace(self, measured=measured)

    def with_unknown_input(self, column: str) -> Suspicion:
        """The same with heat at a joint that its torque, current or speed doesn't tell, or air that is far off."""
        quantity, _, place = column.partition(".")
        if quantity == "temperature":
            return replace(self, error=replace(self.error, inputs={**self.error.inputs, column: _FREE}))
        capacity = float(self.model.values[self.model.network.capacities[place]])
        lasting = dict(zip(self.model.nodes, by_node(self.error.bias, self.model.nodes).tolist(), strict=True))
        lasting[place] = max(lasting[place], capacity * _LIFT / self.error.heat_time)
        return replace(self, error=replace(self.error, bias=lasting))

    def with_scaled_input(self, column: str, onset: float, factor: float) -> Suspicion:
        """The same with a load that is so many times what the log says behind a time [s]."""
        inputs = self.run.inputs.copy()
        inputs[self.model.inputs.index(column), self.behind(onset)] *= factor
        return replace(self, run=replace(self.run, inputs=inputs))

    def exchanged(self, one: int, other: int) -> Suspicion:
        """The same with the readings of two sensors exchanged."""
        measured = self.measured.copy()
        measured[[one, other]] = self.measured[[other, one]]
        return replace(self, measured=measured)

    def with_exchanged_inputs(self, one: int, other: int) -> Suspicion:
        """The same with two inputs exchanged."""
        inputs = self.run.inputs.copy()
        inputs[[one, other]] = self.run.inputs[[other, one]]
        return replace(self, run=replace(self.run, inputs=inputs))

    @cached_property
    def loads(self) -> dict[str, str]:
        """The input that tells what heats a joint, by node."""
        columns = [(*column.partition(".")[::2], column) for column in self.model.inputs]
        return {place: column for quantity, place, column in reversed(columns)
                if quantity in INPUTS and place in self.model.nodes}  # fmt: skip


# --- One sensor, or an input ----------------------------------------------------------------------


def attributed(given: Suspicion, alarm: Alarm) -> tuple[Alarm | None, Suspicion]:
    """The alarm of a sensor, or that of an input, or of either; none where the model's own errors explain as much.

    Args:
        given: the run, with all that was found before.
        alarm: of a sensor that goes its own way.

    Returns:
        It, and the run without the sensor's readings, or with the input as it may be.
    """
    model, onset = given.model, alarm.onset
    row, loads = model.nodes.index(alarm.node), given.loads
    near = {end for link in model.network.resistors if alarm.node in link.ends for end in link.ends} | {alarm.node}
    suspects = [loads[node] for node in model.nodes if node in near & loads.keys()]
    suspects += [column for column in model.inputs if column.startswith("temperature.")]
    freed = {column: given.with_unknown_input(column) for column in suspects}
    likeliest = max(freed, key=lambda column: freed[column].nats(onset), default="")
    trials = [freed[likeliest]] if likeliest else []
    if likeliest in loads.values():
        trials += [given.with_scaled_input(likeliest, onset, factor) for factor in _SCALES]
    as_input = max(trials, key=lambda trial: trial.nats(onset), default=given)
    nothing, of_input, of_sensor = given.nats(onset), as_input.nats(onset), _of_a_sensor(given, row, onset)
    without = given.without([row], min(onset, alarm.time))
    if not np.isnan(without.measured[row]).sum() > np.isnan(given.measured[row]).sum():
        without = given.without([row], -np.inf)  # it is called again for what was read before
    if max(of_sensor, of_input) < nothing + DECIDES:
        return None, without
    if of_sensor > max(of_input, nothing) + DECIDES or not likeliest:
        return alarm, without
    as_input = as_input.with_unknown_input(likeliest)
    # Without healthy logs nobody knows how wrong the model is about a node's heat.
    if of_input > of_sensor + DECIDES and given.calibration.hours > 0:
        place = likeliest.partition(".")[2]
        node = place if place in model.nodes else alarm.node
        detail = "does not explain the temperatures"
        return Alarm(node, "input", alarm.time, onset, detail=detail, channel=likeliest), as_input
    return undecided(alarm, f"temperature.{alarm.node} or {likeliest}"), replace(as_input, measured=without.measured)


def undecided(alarm: Alarm, what: str) -> Alarm:
    """An alarm of one or the other."""
    return Alarm(alarm.node, "undecided", alarm.time, alarm.onset, detail=f"{what} is wrong: not decided which")


def _of_a_sensor(given: Suspicion, row: int, onset: float) -> float:
    """Logarithm of the likelihood behind the onset that a sensor is wrong, in the way that is likeliest.

    It is off by a number, or drifts; or it reads anything: a level with a slope that wanders, beside what a filter
    without this sensor expects there, or beside that with a lag.
    """
    behind, since = given.behind(onset), np.maximum(given.run.run.time - onset, 0.0)
    of_shapes = []
    for added in (behind.astype(float), np.asarray(since / max(float(since[-1]), 1.0))):
        # Of a linear filter it is a parabola in the size of what is added; three points tell its vertex.
        one, two = (given.with_added(row, np.asarray(size * added)).nats(onset) for size in (-1.0, -2.0))
        nothing = given.nats(onset)
        slope, bend = 2 * one - 0.5 * two - 1.5 * nothing, two - 2 * one + nothing
        of_shapes.append(nothing - 0.5 * slope**2 / bend if bend < 0 else nothing)
    others = given.without([row], onset)
    expected, readings = others.filtered[1][row], given.measured[row]
    paths = [expected, *(lagged(expected, lag, given.run.run.step, behind) for lag in LAGS)]
    noise = float(given.calibration.noise.floor[row]) ** 2
    free = max(_level_and_slope((readings - path)[behind], noise) for path in paths)
    return max(*of_shapes, others.nats(onset) + free)


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


# --- Two sensors, or two inputs, that stand for each other ---------------------------------------------


def exchanged_channels(given: Suspicion) -> tuple[list[Alarm], Suspicion]:
    """Pairs of sensors, or of loads, swapped from the beginning of a run: nobody swaps plugs while a robot works.

    A filter on the model takes the log in as it is, and with the two exchanged; the logarithm of the likelihood that
    this gains decides: it has to pass the limit of an offset, and to explain more than a fault of any one sensor. Only
    pairs are tried that bring the model, run freely, nearer to the readings.
    """
    alarms: list[Alarm] = []
    while found := sorted(_exchanges(given), key=lambda one: -one.gain):
        best, start = found[0], float(given.run.run.time[0])
        if best.gain <= _of_one_fault(given):
            break
        rivals = [other for other in found[1:] if other.gain > best.gain - DECIDES]
        for node, other in (best.nodes, best.nodes[::-1]):
            alarm = Alarm(node, "swapped", best.time, start, detail=f"with {other}")
            if rivals:
                alarm = undecided(
                    alarm, f"{best.quantity}, or {rivals[0].quantity} of {' and '.join(rivals[0].nodes)},"
                )
            elif best.quantity != "temperature":
                channel = f"{best.quantity}.{node}"
                alarm = replace(alarm, kind="input", detail=f"exchanged with {best.quantity}.{other}", channel=channel)
            alarms.append(alarm)
        given = best.after
    return alarms, given


class _Exchange(NamedTuple):
    """Two channels of one quantity exchanged: nats gained, when that is clear [s], nodes, and the run with them so."""

    gain: float
    time: float
    quantity: str
    nodes: tuple[str, str]
    after: Suspicion


def _exchanges(given: Suspicion) -> Iterator[_Exchange]:
    """Those that gain more than the limit of an offset."""
    model, step = given.model, given.run.run.step
    predicted = simulate(model, given.run).readings
    apart = _squares(given.measured, predicted)
    for one, other in combinations(model.nodes, 2):
        rows = [model.nodes.index(node) for node in (one, other)]
        trials = []
        if np.isfinite(given.measured[rows]).any(axis=1).all():
            trials.append(("temperature", given.exchanged(*rows), predicted))
        columns = [given.loads.get(node, "") for node in (one, other)]
        quantity, same = columns[0].partition(".")[0], columns[1].partition(".")[0]
        if quantity and quantity == same:
            after = given.with_exchanged_inputs(*map(model.inputs.index, columns))
            trials.append((quantity, after, simulate(model, after.run).readings))
        for what, after, expected in trials:
            if _squares(after.measured, expected) < apart:
                gained = np.cumsum(after.filtered[0] - given.filtered[0])
                limit = 0.5 * float(given.calibration.limits[OFFSET, rows].max()) ** 2
                if gained[-1] > limit:
                    time = float(given.run.run.time[int(np.argmax(gained > limit))]) + step
                    yield _Exchange(float(gained[-1]), time, what, (one, other), after)


def _squares(measured: FloatArray, predicted: FloatArray) -> float:
    """Sum of squared errors of the readings that are there [K²]."""
    return float(np.nansum((measured - predicted) ** 2))


def _of_one_fault(given: Suspicion) -> float:
    """The most that an offset, a drift or a lag of one sensor adds to the logarithm of the likelihood, by any time."""
    estimator = gaussian_estimator(given.model, given.calibration.noise, given.error)
    weights = [statistics.weight.max() for _, statistics in fault_statistics(estimator, given.run, given.measured)]
    return 0.5 * float(max(weights)) ** 2
