"""What may be wrong with a log: one bank of hypotheses, scored by the likelihood of one filter.

A node that is warmer than the model says has a sensor that reads too much, or more heat than the log's torque, current
or speed says, or air that the log has wrong; or the model is off there. A wrong sensor goes its own way, and all others
follow the model; heat moves the neighbours, too, and moves nothing at once.

A cheap filter's innovations say where to look: one pass backwards scores an offset, a drift and a lag of each sensor,
each load and the air, for all onsets. Where one of them stands out, each `Hypothesis` is weighed by a filter of its
own: the run, and what of it is free over the model's own errors. That every capacity, resistance and loss may
be off belongs to all of these, so a model that is a little wrong never has to be a fault of somebody else. A second
pass backwards, with that free, tells which of them are worth their filters. Of several guesses of one hypothesis the
mean counts; that the model lacks heat at a node is one more; and where it is wrong for minutes at other sensors,
too, readings count as fewer.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.logs.columns import INPUTS
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.online.augmented_model import ModelError, by_node
from lptn.online.estimator import Estimator
from lptn.online.quantisation import SENSOR_ERROR
from lptn.simulate.bound_run import BoundRun, bind, default_start
from lptn.simulate.simulation import simulate

Kind = Literal["drift", "offset", "stuck", "dropout", "dead", "clamped", "spikes", "duplicate", "noise", "lag",
               "disconnected", "swapped", "input", "undecided"]  # fmt: skip
"""Disconnected: reads the air, or whatever else is prescribed. Input: not the sensor, but what the log says of the
joint's torque, current or speed, or of the air. Undecided: one or the other. Duplicate: the readings of another
column. The others are as people say."""
OFFSET, DRIFT, LAG = 0, 1, 2
"""Rows of what is said of each kind of fault of a sensor."""
KINDS: tuple[Kind, ...] = ("offset", "drift", "lag")
Limits = Mapping[Kind, float]
"""Weights that call these kinds [standard deviations]."""


@dataclass(frozen=True)
class Alarm:
    """One channel's fault as a detector sees it.

    The size of a sensor's fault is what it adds to the reading, so a sensor 3 K too high has an offset of +3 K: there
    error = predicted − measured is −3 K.

    Args:
        node: whose sensor, or load.
        kind: named from the log up to some minutes behind the alarm.
        time: of the alarm [s, in the log's clock].
        onset: at which the fault seems to have begun [s].
        size: K for an offset, K/s for a drift, positive where the reading is too high, s for a lag; else `None`.
        detail: what more is known, in words.
        channel: the log's column, where it is not the node's temperature.
    """

    node: str
    kind: Kind
    time: float
    onset: float
    size: float | None = None
    detail: str = ""
    channel: str = ""

    @property
    def words(self) -> str:
        """What is wrong, to stand behind the sensor's name."""
        size = {"offset": "{:+.2g} K", "drift": "{:+.2g} K/s", "lag": "{:.0f} s"}.get(self.kind, "").format(self.size)
        return " ".join(word for word in (self.kind, size, self.detail) if word)

    def as_json(self) -> dict[str, object]:
        """The alarm as other tools read it."""
        return asdict(self) | {"channel": self.channel or f"temperature.{self.node}"}


# --- What is free in each hypothesis ----------------------------------------------------------------

MODEL_OFF = 0.1
"""Relative standard deviation of each of the model's free parameters: data sheets, and fits to other loads, are so far
off. Readings learn more of them within minutes."""
DECIDES = float(np.log(1000))
"""nats by which readings must be likelier: one sensor in a thousand logs is faulty."""
_LASTS = 600.0  # s; errors of a model last as long as its nodes' time constants
_SUSPECT = 2.0  # nats for a load, of which its hypothesis is worth a filter
FREE = 10.0
"""K; so far off a wrong sensor may be at the onset, and the air all the while."""
_LIFTS = np.geomspace(1 / 600, 1 / 6, 5)  # K/s; so fast unknown heat warms its node: a motor's peak at most
_SHARES = (1.0, 1 / 4, 1 / 16)  # of a guess how wrong a model is
_LOAD_SCALES = (0.5, 0.7, 1.4, 2.0)  # of a load; its heat is half to twice as much between two of them

# --- A run in the detector's steps ----------------------------------------------------------------

STEP = 10.0
"""s; how often the statistical detector looks."""
_FEWEST_STEPS = 20  # that a short run keeps


def coarsely_bound(model: Model, run: Run, step: float) -> BoundRun:
    """A run in steps of about so many seconds, where it is long enough for it, none of its last seconds lost."""
    factor = min(max(1, round(step / run.step)), max(1, len(run) // _FEWEST_STEPS))
    over = (len(run) if run.averaged else len(run) - 1) % factor
    return bind(model, run.slice(float(run.time[over]), float("inf")).coarsen(factor) if factor > 1 else run)


def warming_by_loads(model: Model, bound: BoundRun) -> FloatArray:
    """How fast loads warm each node by what the model says [K/s], at the temperatures of the start, (nodes, n)."""
    start, loaded = default_start(model, bound), np.nan_to_num(bound.inputs)
    air = np.isin(model.inputs, prescribed(model))[:, None]
    rates = [model.rhs(start, u, model.values).full() for u in (loaded, loaded * air)]
    return np.asarray((rates[0] - rates[1])[: len(model.nodes)])


def loads(model: Model) -> dict[str, str]:
    """The input that heats a joint, by node."""
    columns = [(*column.partition(".")[::2], column) for column in model.inputs]
    return {place: column for quantity, place, column in reversed(columns)
            if quantity in INPUTS and place in model.nodes}  # fmt: skip


def prescribed(model: Model) -> list[str]:
    """The inputs that are temperatures: the air, and what else surrounds the nodes."""
    return [column for column in model.inputs if column.startswith("temperature.")]


# --- A hypothesis, with a filter of its own -------------------------------------------------------


class Filtered(NamedTuple):
    """A run that was filtered: the estimator at its end; of each step's innovations the logarithm of the likelihood and
    the square in standard deviations, shape (n,); temperatures [degC], and each innovation in its own standard
    deviations, NaN where nothing is read, shape (nodes, n)."""

    estimator: Estimator
    log_likelihoods: FloatArray
    squares: FloatArray
    temperatures: FloatArray
    surprises: FloatArray


@dataclass(frozen=True)
class Hypothesis:
    """A run, and what may be wrong with it, the log or the model: one filter tells how likely its readings are then.

    Args:
        model: the model.
        run: the run.
        measured: readings that are believed [degC], NaN elsewhere, shape (nodes, n).
        noise: of the sensors [K], shape (nodes,). Rounding is part of it, since likelihood ratios are of Gaussians.
        error: what the model and the log's inputs may be wrong by.
        covariance: of the model's free parameters, in the fit's coordinates, where they are estimated along.
        learn_air: whether the air's error is estimated along.
        share: of heat and air that the model may be wrong by.
        unknown: heat [W] at joints that their loads don't tell.
        lasting: heat [W] that the model lacks at nodes for an hour and more, where its parameters are estimated.
    """

    model: Model
    run: BoundRun
    measured: FloatArray
    noise: Sequence[float] | FloatArray
    error: ModelError
    covariance: FloatArray | None = None
    learn_air: bool = True
    share: float = 1.0
    unknown: Mapping[str, float] = field(default_factory=dict)
    lasting: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, model: Model, run: Run, noise: Sequence[float], error: ModelError, step: float = STEP) -> Hypothesis:
        """All readings of a run are right, in steps of about so many seconds."""
        bound = coarsely_bound(model, run, step)
        return cls(model, bound, bound.measured, noise, error)

    def estimator(self, step: FloatArray | float = 0.0, *, watch: bool = False, repeats: bool = True) -> Estimator:
        """A fresh filter that allows for all of this, for sensors with steps [K], or one that watches its sensors."""
        nodes, own, free = self.model.nodes, self.error, self.covariance is not None
        heat, change = (
            dict(zip(nodes, (self.share * by_node(sizes, nodes)).tolist(), strict=True))
            for sizes in (own.heat, own.change)
        )
        bias = self.lasting if free else own.bias  # what else lasts for a run is a parameter that is off
        return Estimator(
            self.model,
            noise=np.maximum(self.noise, SENSOR_ERROR),
            step=step,
            error=replace(own, heat=heat | {**self.unknown}, change=change, air=self.share * own.air, bias=bias),
            learn={self.model.parameters[index].name: 0.0 for index in self.model.free} if free else {},
            covariance=self.covariance,
            learn_air=self.learn_air,
            watch=watch,
            repeats=repeats,
            unknown=list(self.unknown),
        )

    @cached_property
    def filtered(self) -> Filtered:
        """The run as its filter sees it."""
        estimator, temperatures = self.estimator(), []
        log_likelihoods, squares = np.zeros((2, len(self.run)))
        surprises, seen = np.full(self.measured.shape, np.nan), np.isfinite(self.measured)
        for k in estimator.run(self.run, self.measured):
            temperatures.append(estimator.states[: len(self.model.nodes)])
            if (last := estimator.last) is not None:
                log_likelihoods[k], squares[k] = last.log_likelihood, last.normalised_square
                surprises[seen[:, k], k] = last.innovation / np.sqrt(np.diag(last.covariance))
        return Filtered(estimator, log_likelihoods, squares, np.array(temperatures).T, surprises)

    def behind(self, onset: float) -> BoolArray:
        """Steps that end behind a time [s], shape (n,)."""
        return np.asarray(self.run.run.time > onset - self.run.run.step)

    def nats(self, onset: float = -np.inf) -> float:
        """Logarithm of the likelihood of all readings behind a time [s]."""
        return float(self.filtered.log_likelihoods[self.behind(onset)].sum())

    def readings_of_one(self, row: int) -> float:
        """How many readings say as much of a fault at a node as one of independent errors would.

        A model is wrong for minutes on end: innovations of other sensors then have sums over these whose mean square is
        so many times that of as many independent ones; 1 at least. What the model does at one node it may do at any;
        of the other sensors one may be faulty, too, so it is that where it is most but one.
        """
        others = np.nan_to_num(np.delete(self.filtered.surprises, row, axis=0))
        others = others[others.any(axis=1)]
        length = min(max(1, round(_LASTS / self.run.run.step)), len(self.run))
        total = np.pad(np.cumsum(others, axis=1), ((0, 0), (1, 0)))
        sums = total[:, length:] - total[:, :-length]
        return float(max([1.0, *np.sort(np.square(sums).mean(axis=1) / length)[-2:-1]]))

    def without(self, row: int, onset: float = -np.inf) -> Hypothesis:
        """The same without a sensor's readings behind a time [s]."""
        return self.with_readings([row], np.where(self.behind(onset), np.nan, self.measured[row]))

    def with_readings(self, rows: Sequence[int], values: FloatArray) -> Hypothesis:
        """The same with other readings of some sensors [degC], shape (rows, n)."""
        measured = self.measured.copy()
        measured[list(rows)] = values
        return replace(self, measured=measured)

    def with_inputs(self, rows: Sequence[int], values: FloatArray) -> Hypothesis:
        """The same with other values of some inputs, shape (rows, n)."""
        inputs = self.run.inputs.copy()
        inputs[list(rows)] = values
        return replace(self, run=replace(self.run, inputs=inputs))

    def with_lasting_heat(self, node: str, lift: float) -> Hypothesis:
        """The same with heat [K/s] that the model lacks at a node for an hour and more."""
        return replace(self, lasting={node: lift * float(self.model.values[self.model.network.capacities[node]])})

    def with_unknown_input(self, column: str, lift: float = float(_LIFTS[2])) -> Hypothesis:
        """The same with heat [K/s] at a joint that its load doesn't tell, or air that is far off."""
        if column in prescribed(self.model):
            return replace(self, error=replace(self.error, inputs={**self.error.inputs, column: FREE}))
        place = column.partition(".")[2]
        capacity = float(self.model.values[self.model.network.capacities[place]])
        return replace(self, unknown={**self.unknown, place: capacity * lift})


# --- What each fault does to the innovations, for all onsets at once ------------------------------

_LAGS = (60.0, 240.0, 960.0)  # s; a lag between two of them shows as the nearer one
_LEAST_INFORMATION = 1e-9  # 1/K²; keeps a fault that no reading has shown from a division by zero
# Each sensor has the same few fault states: level and rate of what is added to its reading, and for each lag a switch
# and what a lagging sensor adds.
_STATES = 2 + 2 * len(_LAGS)
_ADDS = np.array([1.0, 0.0] + [0.0, 1.0] * len(_LAGS))  # to the reading, by each state
_BEGINS = [0, 1, *range(2, _STATES, 2)]  # the states in which an offset, a drift, each lag begin


class FaultStatistics(NamedTuple):
    """The evidence for a fault that begins with each reading.

    weight: for an offset, a drift, a lag, √ of twice the logarithm of the likelihood ratio, in standard deviations; 0
    where a lag is less likely than no fault; shape (n, 3, nodes). load: logarithm of the Bayes factor for heat at a
    node that is unknown by as much as its load gives, against heat that is off by `MODEL_OFF` of it, (n, nodes).
    air: of each of `error.inputs` all the while, unknown by `FREE`.
    """

    weight: FloatArray
    load: FloatArray
    air: FloatArray


class Innovations:
    r"""A filter's innovations over a run, and what speaks in them for each fault, for each time of onset.

    A fault of unit size shifts the innovations :math:`\nu` of covariance :math:`S` by a signature :math:`g`. With the
    information :math:`J = \sum g^\top S^{-1} g` and the score :math:`s = \sum g^\top S^{-1}\nu` its size is
    :math:`\hat b = s/J`, its weight :math:`|\hat b| \sqrt J`. Score and information of all onsets come from one pass
    backwards through the filter, the disturbance smoother of [DeJongPenzer1998]: a fault of a sensor is a shock to a
    state that the filter doesn't have, one of a load or of the air to states that it has. So what a fault at one
    sensor does to its neighbours' innovations counts for it.

    What a lag adds to the reading is known beforehand: the path that the model predicts, followed with a time constant,
    less that path. Its size is 1, and its weight :math:`\sqrt{2s - J}`. If no sensor lags, the ratio of these
    likelihoods ever exceeds a number A with a probability of 1/A at most [Ville1939].

    """

    def __init__(self, given: Hypothesis) -> None:
        model, bound, step = given.model, given.run, given.run.run.step
        self.estimator, path = given.estimator(), simulate(model, bound).readings.T
        self._growth = np.tile(np.eye(_STATES), (*path.shape, 1, 1))  # of faults of unit size, from step to step
        self._growth[..., 0, 1] = step
        for state, lag in zip(range(2, _STATES, 2), _LAGS, strict=True):
            # A lagging sensor is behind the model's path by what it was before, and by what the path has moved.
            keep = np.exp(-step / lag)
            self._growth[..., state + 1, state + 1] = keep
            self._growth[1:, :, state + 1, state] = -keep * np.diff(path, axis=0)
        self._corrections = [self.estimator.last for _ in self.estimator.run(bound, given.measured)]
        self._read = [np.flatnonzero(np.isfinite(row)) for row in given.measured.T]
        self._warms = step * warming_by_loads(model, bound).T  # K, each node by loads in each step
        known = np.square(list(given.error.inputs.values()))
        self._air = np.maximum(FREE**2 - known, 0.0)  # K², variances that wrong air would add

    def faults(self, n: int) -> FaultStatistics:
        """By the first `n` readings."""
        size, nodes, inputs = self.estimator.size, self._growth.shape[1], self.estimator.augmented.layout.inputs
        own = np.arange(nodes)
        score, information = np.zeros(size), np.zeros((size, size))  # of a shock to the filter's own states
        of_fault, of_both = np.zeros((nodes, _STATES)), np.zeros((nodes, size, _STATES))
        of_faults = np.zeros((nodes, _STATES, _STATES))
        of_load, of_loads, load_and_own = np.zeros(nodes), np.zeros(nodes), np.zeros((size, nodes))
        scores, squares = np.zeros((n, nodes, len(_BEGINS))), np.zeros((n, nodes, len(_BEGINS)))
        loads = np.zeros((n, nodes))
        for k in reversed(range(n)):
            correction, grow = self._corrections[k], self._growth[k]
            if correction is not None:
                h, gain, inverse = correction.by_state, correction.gain, np.linalg.inv(correction.covariance)
                read, kept, back = self._read[k], np.eye(size) - gain @ h, correction.transition.T
                by_gain = information @ gain
                smoothed = inverse @ correction.innovation - gain.T @ score
                precision = np.diag(inverse + gain.T @ by_gain)
                of_fault[read] += smoothed[:, None] * _ADDS
                with_gain = _ADDS[:, None] * np.einsum("zr,rzs->rs", gain, of_both[read])[:, None, :]
                of_faults[read] += precision[:, None, None] * np.outer(_ADDS, _ADDS)
                of_faults[read] -= with_gain + with_gain.transpose(0, 2, 1)
                of_both = (kept @ correction.transition).T @ of_both
                of_both[read] += (back @ (h.T @ inverse - kept.T @ by_gain)).T[..., None] * _ADDS
                score = h.T @ (inverse @ correction.innovation) + kept.T @ score
                information = h.T @ inverse @ h + kept.T @ information @ kept
                load_and_own, warms = kept.T @ load_and_own, self._warms[k]
                of_load += warms * score[:nodes]
                of_loads += 2 * warms * load_and_own[own, own] + warms**2 * information[own, own]
                load_and_own = back @ (load_and_own + warms * information[:, :nodes])
                score, information = back @ score, back @ information @ back.T
            turned = grow.transpose(0, 2, 1)
            of_fault = (turned @ of_fault[..., None])[..., 0]
            of_both, of_faults = of_both @ grow, turned @ of_faults @ grow
            scores[k], squares[k] = of_fault[:, _BEGINS], of_faults[:, _BEGINS, _BEGINS]
            loads[k] = _log_bayes_factor(of_load, of_loads, 1.0) - _log_bayes_factor(of_load, of_loads, MODEL_OFF**2)
        squares = np.maximum(squares, _LEAST_INFORMATION)
        of_lag = np.sqrt(np.maximum(2 * scores - squares, 0.0))[..., LAG:].max(axis=2, keepdims=True)
        weight = np.concatenate([np.abs(scores[..., :LAG]) / np.sqrt(squares[..., :LAG]), of_lag], axis=2)
        air = _log_bayes_factor(score[inputs], np.diag(information)[inputs], self._air)
        return FaultStatistics(weight.transpose(0, 2, 1), loads, air)


def _log_bayes_factor(score: FloatArray, information: FloatArray, variance: FloatArray | float) -> FloatArray:
    """Of a shock of unknown size, Gaussian with a variance, against none."""
    with_prior = 1 + np.maximum(information, 0.0) * variance
    return np.asarray(0.5 * (variance * score**2 / with_prior - np.log(with_prior)))


# --- Where to look: the first significant fault -----------------------------------------------

_SETTLED = 240.0  # s after an alarm: by then an offset can be distinguished from a drift


def first_alarm(given: Hypothesis, limits: Limits, inputs: Collection[str] = ()) -> Alarm | None:
    """The first alarm among the sensors that are read; its kind as it looks some minutes later.

    Where the whole run passes a limit, bisection finds the reading with which it is first passed: of what a large fault
    does later on the filter's linearisation says nothing. A lag counts where no offset or drift explains more. A load
    comes first where it explains more than any sensor's fault, and the air where no limit is passed.

    Args:
        given: the run, with what is known of it.
        limits: of each kind.
        inputs: columns of loads and of the air that may be wrong.
    """
    if not np.isfinite(given.measured).any():
        return None
    innovations, bound, count, model = Innovations(given), given.run, len(given.run), given.model
    time = bound.run.time + bound.run.step * bound.run.averaged  # a mean is known at the end of its step
    whole, driving = innovations.faults(count), loads(model)
    suspected = np.where([driving.get(node, "") in inputs for node in model.nodes], whole.load, 0.0)
    begin, heated = map(int, np.unravel_index(int(suspected.argmax()), suspected.shape))

    def first(passes: Callable[[FaultStatistics], bool]) -> int:
        """The number of readings with which a limit is first passed that all of them pass."""
        return 1 + bisect_left(range(1, count), True, key=lambda end: passes(innovations.faults(end)))

    def of_input(end: int, row: int, column: str, onset: int) -> Alarm:
        return Alarm(model.nodes[row], "input", float(time[end - 1]), float(bound.run.time[onset]), channel=column)

    def excess(said: FaultStatistics) -> FloatArray:
        """Weights as shares of their limits."""
        share = said.weight / np.array([[limits[kind]] for kind in KINDS])
        share[:, LAG] *= said.weight[:, LAG] >= said.weight[:, :LAG].max()
        return np.asarray(share)

    if suspected.max() > max(DECIDES, 0.5 * float(whole.weight.max()) ** 2):
        end = first(lambda said: bool(said.load[begin:, heated].max(initial=0) > DECIDES))
        return of_input(end, heated, driving[model.nodes[heated]], begin)
    if excess(whole).max() > 1:
        end = first(lambda said: bool(excess(said).max() > 1))
        row = int(excess(innovations.faults(end)).max(axis=(0, 1)).argmax())
        settled = innovations.faults(min(end + round(_SETTLED / bound.run.step), count))
        onset, kind = map(int, np.unravel_index(int(excess(settled)[:end, :, row].argmax()), (end, len(KINDS))))
        return Alarm(model.nodes[row], KINDS[kind], float(time[end - 1]), float(bound.run.time[onset]))
    if suspected.max() > _SUSPECT:
        return of_input(count, heated, driving[model.nodes[heated]], begin)
    for column, evidence in zip(given.error.inputs, whole.air.tolist(), strict=True):
        if column in inputs and evidence > 0:
            # The readings that tell most of the air are of the node that it cools most.
            augmented, mean = innovations.estimator.augmented, innovations.estimator.state()["mean"]
            _, by_state = augmented.rates(mean, bound.inputs[:, -1])
            cooled = np.abs(by_state[: len(model.nodes), augmented.layout.inputs].sum(axis=1))
            return of_input(count, int((cooled * np.isfinite(given.measured).any(axis=1)).argmax()), column, 0)
    return None


def suspects(model: Model, node: str, channel: str = "") -> list[str]:
    """The inputs that lead a node's temperature astray: loads of its own and of its neighbours, and the air.

    Where the air is suspected, which touches all nodes, any load may look like it.
    """
    near = {node, *(end for link in model.network.resistors if node in link.ends for end in link.ends)}
    near |= loads(model).keys() if channel in prescribed(model) else set()
    own = [column for place, column in sorted(loads(model).items(), key=lambda one: one[0] != node) if place in near]
    return own + prescribed(model)


# --- What a sensor that is wrong reads ------------------------------------------------------------

_SLOPE = 0.3  # K a step; and so fast it may drift: 1 K in half a minute
_WALKS = np.geomspace(0.003, 3.0, 7)  # K; by how much what a sensor adds may wander from one step to the next
_BENDS = _WALKS / 10  # K a step; or its slope, for the air, a surface, a body that it touches now move smoothly
_FINE_LAGS = (30.0, 60.0, 120.0, 240.0, 480.0, 960.0)  # s; a factor of two is as finely as a lag is known
_OWED = 10.0  # nats by which a lag, which a missing mass resembles, or part of the air must explain more than others
_LOOSENS = 100.0  # s; a sensor in a drop of glue follows the air so late
_READINGS_TO_NAME = 12  # readings behind the onset, that another name than offset or drift needs


class _Course(NamedTuple):
    """What a sensor reads with one fault: kind, size, words, readings [degC] of shape (n,), nats owed."""

    kind: Kind
    size: float | None
    detail: str
    path: FloatArray  # (n,)
    owed: float = 0.0


def _courses(others: Hypothesis, readings: FloatArray, expected: FloatArray, onset: float) -> Iterator[_Course]:
    """The table of a sensor's faults, beside what the model and all other sensors let expect behind the onset."""
    behind, since, step = others.behind(onset), np.maximum(others.run.run.time - onset, 0.0), others.run.run.step
    seen, level = behind & np.isfinite(readings), np.ones(len(since))
    number = 0.5 * float(np.log(seen.sum()))  # what a free number costs, by the Bayesian information criterion

    def size(of: FloatArray) -> float:
        """By how much of a course the readings are off, by least squares."""
        return float((readings - expected)[seen] @ of[seen]) / max(float(of[seen] @ of[seen]), 1e-9)

    yield _Course("offset", size(level), "", expected + size(level), number)
    yield _Course("drift", size(since), "", expected + size(since) * since, number)
    for column, values in _surroundings(others):
        near = _lagged(np.where(behind, values - expected, 0.0), _LOOSENS, step, behind)
        share = size(near)
        yield _Course("disconnected", None, f"reads {column}", values)
        if 0 < share <= 1:
            yield _Course(
                "disconnected", None, f"reads {share:.0%} of {column}", expected + share * near, number + _OWED
            )
    constant = float(readings[seen].mean())
    yield _Course("stuck", None, f"at {constant:.3g} degC", np.full(len(since), constant), number)
    for lag in _FINE_LAGS:
        yield _Course("lag", lag, "", _lagged(expected, lag, step, behind), number + _OWED)


def _surroundings(given: Hypothesis) -> list[tuple[str, FloatArray]]:
    """The temperatures that are inputs, by column [degC], shape (n,) each."""
    inputs = zip(given.model.inputs, given.run.inputs, strict=True)
    return [(column, values) for column, values in inputs if column in prescribed(given.model)]


def _lagged(path: FloatArray, lag: float, step: float, behind: BoolArray) -> FloatArray:
    """A path that is followed with a time constant [s] from the onset on."""
    lagged, keep = path.copy(), float(np.exp(-step / lag))
    for k in np.flatnonzero(behind).tolist():
        lagged[k] = keep * lagged[max(k - 1, 0)] + (1 - keep) * path[k]
    return lagged


def _nats(off: FloatArray, along: FloatArray, noise: float) -> float:
    """Logarithm of the likelihood of readings that are off a course, in noise of a variance [K²].

    Beside the noise they are off by a multiple of another course: this, or its slope, wanders, in one of some sizes.
    Arrays have shape (n,).
    """
    wandering, bending = np.square([[*_WALKS, *0 * _BENDS], [*0 * _WALKS, *_BENDS]])
    level, slope, total = (np.zeros(wandering.size) for _ in range(3))
    of_level, of_slope, of_both = (np.full(wandering.size, size**2) for size in (FREE, _SLOPE, 0.0))
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
    return _of_any(total)


def _of_any(nats: Sequence[float] | FloatArray) -> float:
    """Logarithm of the likelihood where one of several is right and none the likelier beforehand: their mean.

    The largest of many is large by chance, so that many guesses would explain more than one.
    """
    return float(np.logaddexp.reduce(nats) - np.log(len(nats)))


def _of_a_sensor(given: Hypothesis, others: Hypothesis, alarm: Alarm) -> tuple[float, Alarm]:
    """Logarithm of the likelihood behind an alarm's onset if its sensor is wrong, and the fault that is likeliest.

    It is off by a number, or drifts, and goes on to tell of its node. Or it reads anything, beside the course of a
    fault or in a mean of its node and of cooler air.
    """
    row, onset = given.model.nodes.index(alarm.node), alarm.onset
    behind, readings = given.behind(onset), given.measured[row]
    count = int(np.isfinite(readings[behind]).sum())
    if not count:
        return others.nats(onset), replace(alarm, channel="")
    noise = max(given.noise[row], SENSOR_ERROR) ** 2
    expected = others.filtered.temperatures[row]
    courses = list(_courses(others, readings, expected, onset))[: None if count >= _READINGS_TO_NAME else 2]
    nats = [_nats((readings - course.path)[behind], np.ones(behind.sum()), noise) for course in courses]
    left = [np.nanmean(np.square(readings - course.path)[behind]) for course in courses]  # K²
    best = min(range(len(courses)), key=lambda k: 0.5 * count * np.log(left[k] + noise) + courses[k].owed)
    named = replace(alarm, kind=courses[best].kind, size=courses[best].size, detail=courses[best].detail, channel="")
    for _, air in _surroundings(given):
        if np.nansum(((readings - expected) * (air - expected))[behind]) > 0:
            nats.append(_nats((readings - expected)[behind], ((air - expected) / FREE)[behind], noise))
    corrected = [
        given.with_readings([row], readings - np.where(behind, course.path - expected, 0.0)).nats(onset) - course.owed
        for course in courses[:2]
    ]
    return _of_any([_of_any(nats) + others.nats(onset), _of_any(corrected)]), named


# --- Whose fault it is ----------------------------------------------------------------------------


class _Answer(NamedTuple):
    """What explains an alarm: nats gained, the channels in words, their alarms, the run with them as they may be.

    under: the run as it is explained.
    """

    gain: float
    what: str
    alarms: list[Alarm]
    after: Hypothesis
    under: Hypothesis


def faults(
    given: Hypothesis, limits: Limits, inputs: Collection[str], *, covariance: FloatArray | None = None, taught: bool
) -> list[Alarm]:
    """All faults of a run.

    Once a sensor is called faulty, the filter does without it from the fault's onset on, and the search for others
    starts again: else its error would spread over its neighbours.

    Args:
        given: the run, with what is known of it.
        limits: of each kind.
        inputs: columns that may be wrong; where there are none, sensors alone are judged.
        covariance: of the model's free parameters, in the fit's coordinates, as its fit leaves them; each is
            `MODEL_OFF` besides.
        taught: whether healthy logs told how wrong the model is.
    """
    found, inputs, wrong = list[Alarm](), set(inputs), 1.0
    off = MODEL_OFF**2 * np.eye(len(given.model.free)) + (0.0 if covariance is None else covariance)
    while (first := first_alarm(given, limits, inputs)) is not None:
        called = {name for alarm in found for name in (alarm.node, alarm.channel)}
        told, after, wrong = _attributed(replace(given, covariance=off), first, called, taught, wrong, bool(inputs))
        # A sensor can't be judged with a wrong load; and no channel is reported twice.
        twice = any((alarm.channel or alarm.node) in called for alarm in told)
        if twice or (not first.channel and first.node in called):
            told, after = [], given.without(given.model.nodes.index(first.node))  # what that leaves
        given = replace(after, share=1.0, covariance=None)
        inputs -= {first.channel, *(alarm.channel for alarm in told)}
        found += told
    return found


def _attributed(
    given: Hypothesis, alarm: Alarm, called: Collection[str], taught: bool, wrong: float, with_inputs: bool
) -> tuple[list[Alarm], Hypothesis, float]:
    """Whose alarm it is: of the hypothesis under which the readings are clearly likelier than under any other.

    None where the model's own errors, or an input that is `called` already, explain as much; beside it the run with
    what was found, or without the sensor's readings, and how many readings say as much as one, at least `wrong`.
    """
    row = given.model.nodes.index(alarm.node)
    if not taught:  # the likeliest share of the model's errors: if it is better than guessed, readings say more
        given = max((replace(given, share=share) for share in _SHARES), key=Hypothesis.nats)
    without = given.without(row, alarm.onset)
    if not np.isnan(without.measured[row]).sum() > np.isnan(given.measured[row]).sum():
        without = given.without(row)  # it is called again for what was read before
    dismissed = given if alarm.channel else without
    asked = _worth_asking(given, alarm, with_inputs)
    if max(asked.values()) <= DECIDES * wrong:
        return [], dismissed, wrong
    nats, named = _of_a_sensor(given, without, alarm)
    sensor = _Answer(nats - given.nats(alarm.onset), f"temperature.{alarm.node}", [named], without, without)
    # The model may lack heat at the node all the while; healthy logs would have told. What reads as that is no fault of
    # the sensor, and cannot be told from one of the load.
    lacks = [] if taught else [given.with_lasting_heat(alarm.node, lift).nats(alarm.onset) for lift in _LIFTS[:3]]
    of_model = max(_of_any(lacks) - given.nats(alarm.onset), 0.0) if lacks else 0.0
    if not with_inputs and sensor.gain - of_model <= DECIDES * wrong:
        return [], dismissed, wrong
    answers = [*_inputs(given, alarm, list(asked)), *_exchanges(given, alarm)]
    answers += [sensor] if sensor.gain - of_model > DECIDES * max(without.readings_of_one(row), wrong) else []
    if not answers:
        return [], dismissed, wrong
    best, *rivals = sorted(answers, key=lambda answer: -answer.gain)
    wrong_here = max(best.under.readings_of_one(row), wrong)
    decides = DECIDES * wrong_here
    # Of one sensor and one load that both explain it nothing says which is wrong.
    alone = not np.isfinite(np.delete(given.measured, row, axis=0)).any()
    least = decides if alone else best.gain - decides
    likely = [answer for answer in (best, *rivals) if answer.gain > least]
    if alarm.channel and likely == [sensor]:
        return [], given, wrong  # sensors are called by what they read themselves
    unasked = not with_inputs and best.alarms[0].kind == "input"
    if unasked or best.gain <= decides or any(answer.what in called for answer in likely):
        return [], dismissed, wrong_here
    if len(likely) > 1:
        # The sensor is not used, and the rest follows the most probable of the other hypotheses.
        after = next(one for one in (best, *rivals) if one is not sensor).after.without(row, alarm.onset)
        return [replace(undecided(alarm, f"{best.what} or {likely[1].what}"), channel="")], after, wrong
    if not taught and best.alarms[0].kind == "input" and len(best.alarms) == 1:
        # Without healthy logs the model's error in a node's heat is unknown.
        return [undecided(best.alarms[0], f"{best.what} or the model")], best.after, wrong
    return best.alarms, best.after, wrong


def _worth_asking(given: Hypothesis, alarm: Alarm, with_inputs: bool) -> dict[str, float]:
    """What may explain an alarm, by column, and the nats that it gains to first order.

    One backward pass tells it, where each hypothesis needs filters of its own: of loads near the node, and of the air,
    those stay that gain any. A load that makes no heat shows nothing to first order.
    """
    said, model = Innovations(given).faults(len(given.run)), given.model
    row, number = model.nodes.index(alarm.node), 0.5 * float(np.log(len(given.run)))
    of_sensor = max(_of_any(0.5 * weight**2) for weight in said.weight[:, :, row].T) - number
    asked = {f"temperature.{alarm.node}": of_sensor}
    if with_inputs:
        heated, driven = np.any(warming_by_loads(model, given.run), axis=1).tolist(), loads(model)
        gains = dict(zip(given.error.inputs, said.air.tolist(), strict=True))
        for node, load, heats in zip(model.nodes, said.load.T, heated, strict=True):
            if node in driven:
                gains[driven[node]] = _of_any(load) if heats else of_sensor
        near = suspects(model, alarm.node, alarm.channel)
        asked |= {column: gain for column, gain in gains.items() if column in near and gain > 0}
    return asked


def undecided(alarm: Alarm, what: str) -> Alarm:
    """An alarm of one or the other."""
    return replace(alarm, kind="undecided", size=None, detail=f"{what} is wrong: not decided which")


def _inputs(given: Hypothesis, alarm: Alarm, asked: Collection[str]) -> Iterator[_Answer]:
    """A load that is wrong, at the node or near it, or the air; of the likeliest load the size, too.

    The node's own load is asked, and those that are worth it.
    """
    model, onset = given.model, alarm.onset
    asked = {*asked, loads(model).get(alarm.node, "")}
    freed = {column: given.with_unknown_input(column)
             for column in suspects(model, alarm.node, alarm.channel) if column in asked}  # fmt: skip
    driving = freed.keys() & loads(model).values()
    likeliest = max(driving, key=lambda column: freed[column].nats(onset), default="")
    for column, trial in freed.items():
        trials, place = [trial], column.partition(".")[2]
        if column == likeliest:
            trials += [given.with_unknown_input(column, lift) for lift in _LIFTS]
            index, scales = (
                model.inputs.index(column),
                np.where(given.behind(onset), np.array(_LOAD_SCALES)[:, None], 1.0),
            )
            trials += [given.with_inputs([index], scale * given.run.inputs[index]) for scale in scales]
        best = max(trials, key=lambda trial: trial.nats(onset))
        node = place if place in model.nodes else alarm.node
        detail = "does not explain the temperatures"
        told = Alarm(node, "input", alarm.time, onset, detail=detail, channel=column)
        gain = max(
            _of_any([trial.nats(since) for trial in trials]) - given.nats(since) for since in (onset, -np.inf)
        )  # or all the while
        yield _Answer(gain, column, [told], best.with_unknown_input(column, _LIFTS[-1]), best)


def _exchanges(given: Hypothesis, alarm: Alarm) -> Iterator[_Answer]:
    """The node's sensor and another one's exchanged, from the onset on or all the while; or their loads, all the while.

    Only pairs are tried that bring the model, run freely, as much nearer to the readings as decides.
    """
    model, measured, driven, start = given.model, given.measured, loads(given.model), float(given.run.run.time[0])
    row = model.nodes.index(alarm.node)

    def squares(trial: Hypothesis) -> float:
        errors = np.square(trial.measured - simulate(model, trial.run).readings)
        return float(np.nansum(errors / np.maximum(given.noise, SENSOR_ERROR)[:, None] ** 2))

    now = squares(given)
    for other, node in enumerate(model.nodes):
        if other == row:
            continue
        trials, rows = list[tuple[str, float, Hypothesis]](), [row, other]
        if np.isfinite(measured[rows]).any(axis=1).all():
            for begin in {alarm.onset, start}:
                exchanged = np.where(given.behind(begin), measured[rows[::-1]], measured[rows])
                trials.append(("temperature", begin, given.with_readings(rows, exchanged)))
        indices = [model.inputs.index(driven[place]) for place in (alarm.node, node) if place in driven]
        quantity, *differ = {model.inputs[index].partition(".")[0] for index in indices} or {""}
        if len(indices) == 2 and not differ:
            trials.append((quantity, start, given.with_inputs(indices, given.run.inputs[indices[::-1]])))
        for what, begin, after in trials:
            if squares(after) < now - 2 * DECIDES:
                alarms = [
                    Alarm(one, "swapped", alarm.time, begin, detail=f"with {two}")
                    if what == "temperature"
                    else Alarm(one, "input", alarm.time, begin, detail=f"exchanged with {two}", channel=driven[one])
                    for one, two in ((alarm.node, node), (node, alarm.node))
                ]
                yield _Answer(after.nats() - given.nats(), f"{what} of {alarm.node} and {node}", alarms, after, after)
