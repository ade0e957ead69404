"""An extended Kalman filter on a model: temperatures of all nodes, and how sure they are, sample by sample."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray, IntArray
from lptn.basics.bounds import Bound
from lptn.basics.errors import InputError
from lptn.basics.parameters import Transform
from lptn.identify.noise import LEAST_NOISE
from lptn.model.array_function import ArrayFunction
from lptn.model.model import Model
from lptn.online.augmented_model import AugmentedModel, ModelError, Sizes, by_node, refuse_negative
from lptn.online.living_sensors import ABOVE, ERROR, LivingSensor
from lptn.online.quantisation import as_gaussian, noise_and_steps
from lptn.simulate.bound_run import BoundRun

if TYPE_CHECKING:
    from lptn.identify.fitting import Fit

_STATES = Bound(600, "states (nodes, their errors, fitted parameters)")
"""Of a filter, whose step takes the cube: a forecast from ten minutes at 1 Hz takes 40 s with 240, ten minutes with so
many."""


@dataclass(frozen=True)
class Estimate:
    """What is known after an update; arrays have one entry for each node, in the order of `nodes`.

    Args:
        nodes: names of the nodes.
        temperatures: of the nodes [degC].
        deviations: their standard deviations [K].
        innovations: measured − predicted reading [K], NaN where nothing was read. An innovation is what a
            measurement adds, so by the Kalman filter's definition its sign is the opposite of an error's, which is
            predicted − measured everywhere else.
        parameters: learnt parameters in their units, by name, each with its standard deviation.
        untrusted: sensors whose readings are not taken in at present, by node, each with the reason in words.
        hottest: temperatures [degC] of the hottest points of elements, by name, each with its standard deviation [K].
    """

    nodes: tuple[str, ...]
    temperatures: FloatArray
    deviations: FloatArray
    innovations: FloatArray
    parameters: dict[str, tuple[float, float]]
    untrusted: dict[str, str] = field(default_factory=dict)
    hottest: dict[str, tuple[float, float]] = field(default_factory=dict)

    def temperature(self, node: str) -> tuple[float, float]:
        """Temperature of a node, or of a hottest point, [degC] and its standard deviation [K].

        Raises:
            ValueError: the model has no such node.
        """
        if node in self.hottest:
            return self.hottest[node]
        row = self.nodes.index(node)
        return float(self.temperatures[row]), float(self.deviations[row])


@dataclass(frozen=True)
class Correction:
    """The linear algebra of one correction, for whoever follows a fault through the filter.

    Args:
        transition: derivative of the state by that after the correction before, shape (z, z).
        by_state: derivative of the readings made, shape (read, z).
        gain: shape (z, read).
        covariance: of the innovations [K²], shape (read, read).
        innovation: measured − predicted, shape (read,) [K].
    """

    transition: FloatArray
    by_state: FloatArray
    gain: FloatArray
    covariance: FloatArray
    innovation: FloatArray

    @property
    def log_likelihood(self) -> float:
        """Logarithm of the innovations' likelihood, up to a constant for each reading."""
        root = np.linalg.cholesky(self.covariance)
        return -0.5 * self.normalised_square - float(np.log(np.diag(root)).sum())

    @property
    def normalised_square(self) -> float:
        """Innovations in their standard deviations, squared and summed: about one for each reading if all is well."""
        return float(self.innovation @ np.linalg.solve(self.covariance, self.innovation))


_UNMEASURED = 5.0  # K; standard deviation at the start of a node without a reading: robots start near one temperature
_UNREAD = 15.0  # K; of all nodes where nothing is read at the start: about the ambient, a robot may come from work
_HIDDEN = 2.0  # K; of a hidden state about its node
UNKNOWN = 0.3  # standard deviation of a learnt parameter's coordinate: some 30 %, as far as data sheets are off
_WALK = 0.05  # how far a learnt parameter's coordinate walks in an hour
_HOUR, _DAY = 3600.0, 86400.0  # s; what was known a day ago is worth no more than a new start
_GAP = 600.0  # s; inputs older than this are invalid: the temperature estimates start again
_REMEMBERED = ("mean", "covariance", "resting", "last_inputs", "coldest", "without")
_PLAUSIBLE = 6.0  # standard deviations of what may be wrong with the model; more is not learnt of it


class Estimator:
    r"""Extended Kalman filter on the model's RK4 step and its exact derivative.

    The state is the model's own, augmented by what `error` allows and by the doubtful parameters. The covariance
    is corrected in Joseph's form, :math:`(I-KH)P(I-KH)^\top + KRK^\top`, which keeps it positive for any gain.

    It leans on no sensor that is not alive (`lptn.online.living_sensors`): beside the estimate goes the model alone
    since the start, that takes in no reading. What contradicts it is left out, `Estimate.untrusted` says why, and
    what the sensor taught is taken back. Until a sensor has moved as the model does it tells of its own node alone. A
    node that no sensor tells is never estimated colder than all that surrounds it and the coldest start of a sensor
    that lives, nor warmer than its heat allows. Drifts and small offsets are found by `lptn.monitor`.

    Args:
        model: the model, at the values to start from.
        noise: standard deviation of the white noise of a reading, before rounding [K], for all nodes, by node, or an
            array of shape (nodes,). For a coarse sensor rather too large than too small: `from_fit` finds it.
        step: step of the sensors [K], 0 for fine ones, likewise: a reading is known to lie in a cell.
        error: what may be wrong with the model.
        learn: parameters to learn while running; a mapping gives how far each may walk in an hour, as a share
            of its value (of its typical size where zero is admissible). Slow walks: 0.05 by default.
        covariance: of the fit's coordinates of the model's free parameters, shape (free, free): doubt about
            parameters that aren't learnt widens the temperatures' uncertainty and is never narrowed (a Schmidt–Kalman
            filter).
        learn_air: whether the air's error is learnt; else it only widens the uncertainty.
        watch: whether sensors that are not alive are left out.
        repeats: whether readings that repeat bit for bit count against their sensor; not where a whole log says more.
        unknown: nodes whose heat no input tells; there the model alone takes the readings in, lest sensors of their
            neighbours be judged by a temperature that nobody knows.

    Raises:
        InputError: an unknown node, parameter or column; more than 600 states.
        ValueError: a size that is negative or not finite, or a covariance of the wrong shape.

    Example:
        >>> import lptn
        >>> loaded = lptn.load_model("examples/tclab/two_heaters.toml")
        >>> (run,) = loaded.runs(["examples/tclab/log.csv"])
        >>> estimator = lptn.Estimator(loaded.model, noise=0.1)
        >>> powers = {"power.heater1": 0.5, "power.heater2": 0.0}
        >>> for reading in (23.1, 23.2, 23.4):
        ...     estimate = estimator.update(powers, {"heater1": reading}, dt=1.0)
        >>> temperature, deviation = estimate.temperature("heater1")
    """

    def __init__(
        self,
        model: Model,
        *,
        noise: Sizes | FloatArray = 0.15,
        step: Sizes | FloatArray = 0.0,
        error: ModelError | None = None,
        learn: Sequence[str] | Mapping[str, float] = (),
        covariance: FloatArray | None = None,
        learn_air: bool = True,
        watch: bool = True,
        repeats: bool = True,
        unknown: Collection[str] = (),
    ) -> None:
        self.model, self.error = model, error or ModelError()
        self._noise = np.maximum(_sizes_of(model, noise, "noise"), LEAST_NOISE) ** 2
        self._step = _sizes_of(model, step, "step")
        self._read_as = self._noise + self._step**2 / 12  # K², variance of a reading
        self._owners = np.array(model.owners)
        self._change = by_node(self.error.change, model.nodes)
        _refuse_unknown(self.error.inputs, model.inputs, model, "error.inputs")
        walks = dict(learn) if isinstance(learn, Mapping) else dict.fromkeys(learn, _WALK)
        names = [parameter.name for parameter in model.parameters]
        _refuse_unknown(walks, names, model, "learn")
        refuse_negative(walks, "learn")
        free = model.free if covariance is not None else []
        if covariance is not None and np.shape(covariance) != (len(free), len(free)):
            raise ValueError(f"covariance: found shape {np.shape(covariance)}; expected {(len(free), len(free))}")
        learnt = [names.index(name) for name in walks]
        self.doubtful = [*free, *(index for index in learnt if index not in free)]
        """Indices of the parameters that are states of the filter."""
        self._learnt = np.isin(self.doubtful, learnt)
        parameters = [model.parameters[index] for index in self.doubtful]
        self._transform = Transform(parameters)
        self._given = self._transform.forward(model.values[self.doubtful])
        declared = np.array([parameter.declared.bounds for parameter in parameters]).reshape(-1, 2)
        self._bounds = [self._transform.forward(bound) for bound in declared.T]
        self._prior = np.diag(np.full(len(parameters), UNKNOWN**2))
        if covariance is not None:
            self._prior[: len(free), : len(free)] = covariance
        hourly = np.array([walks.get(parameter.name, 0.0) for parameter in parameters])
        self.augmented = AugmentedModel(model, self.error, self.doubtful, hourly**2 / _HOUR)
        layout = self.augmented.layout
        _STATES.check(layout.size, model.network.origin, "filter")
        self._doubt = self.augmented.errors.copy()
        self._doubt[layout.parameters] = np.diag(self._prior)
        """Variance of what may be wrong with the model, before anything was read; 0 for states, shape (z,)."""
        self._unknown = np.flatnonzero(np.isin(np.array(model.nodes)[self._owners], list(unknown)))
        self._only_doubtful = np.zeros(layout.size, dtype=bool)
        self._only_doubtful[layout.air] = not learn_air
        self._only_doubtful[layout.parameters] = ~self._learnt
        self._of_node = np.full(layout.size, -1)  # the node to which each state belongs, -1 for what all have in common
        self._of_node[layout.states] = self._owners
        for errors in (layout.heat, layout.bias):
            self._of_node[errors] = range(errors.stop - errors.start)
        self._resting = np.full(1, math.nan)
        self._coldest = np.full(1, math.inf)  # degC, of all that has surrounded the nodes, and of starts that are known
        self._surroundings, self._values = ArrayFunction(model.surroundings), model.values
        self._last_inputs = np.full(len(model.inputs), math.nan)
        self._mean = np.full(layout.size, np.nan)
        self._covariance = np.zeros((len(self._mean), len(self._mean)))
        self._since_correction = np.eye(len(self._mean))
        self._without = np.zeros(layout.size)  # by how much the state of the model alone differs
        self.watch, self._repeats = watch, repeats
        """Whether sensors that are not alive are left out."""
        self.sensors = self._new_sensors()
        """What is known of each node's sensor."""
        self._capacities = model.values[[model.network.capacities[node] for node in model.nodes]]
        self._is_temperature = np.array([column.startswith("temperature.") for column in model.inputs], dtype=float)
        self.last: Correction | None = None
        """The linear algebra of the last update's correction; `None` where nothing was read."""

    @classmethod
    def from_fit(
        cls, fit: Fit, *, error: ModelError | None = None, learn: Sequence[str] | Mapping[str, float] = ()
    ) -> Estimator:
        """An estimator on a fitted model, with the parameter covariance of the fit.

        Noise and steps of the sensors are those of readings as the fitted runs hold them: means where these are means.
        """
        (noise, step), covariance = noise_and_steps(fit.noise), fit.uncertainty.covariance
        return cls(fit.model, noise=noise, step=step, error=error, learn=learn, covariance=covariance)

    def update(self, inputs: Mapping[str, float], readings: Mapping[str, float | None], dt: float) -> Estimate:
        """Advance by `dt` at constant inputs, then use the readings.

        Args:
            inputs: a value for each of the model's input columns; others are left aside.
            readings: temperatures [degC] by node; NaN, `None` or no entry for a missing one.
            dt: time since the last update [s]; 0 at the first one.

        Raises:
            InputError: an input that is missing or not finite, a reading that is infinite or of no node, a
                time step that is negative, not finite or longer than a day. The estimator stays as it was.
        """
        u, y = _inputs_of(self.model, inputs), _readings_of(self.model, readings)
        self._refuse_time(dt)
        return self._estimate(self._update(u, y, dt))

    def run(self, bound: BoundRun, measured: FloatArray | None = None) -> Iterator[int]:
        """Take in a run, from the state in which it begins: the number of each of its n readings once it is taken in.

        A reading that is the mean over its step is taken in at the middle of it.

        Args:
            bound: the run as the model sees it.
            measured: readings [degC], shape (nodes, n), that stand for the run's own.

        Raises:
            InputError: as `update`.
        """
        readings, step = bound.measured if measured is None else measured, bound.run.step
        last, before = bound.inputs[:, 0], 0.0  # inputs, and s since the last update that they act
        for k, (u, y) in enumerate(zip(bound.inputs.T, readings.T, strict=True)):
            if not np.isfinite(u).all():
                _inputs_of(self.model, dict(zip(self.model.inputs, u.tolist(), strict=True)))
            if bound.run.averaged:
                if before:
                    self._advance(last, before)
                self._update(u, y, step / 2 if self.running else 0.0)
                last, before = u, step / 2
            else:
                self._update(last, y, before)
                last, before = u, step
            yield k

    def advance(self, inputs: Mapping[str, float], dt: float) -> None:
        """Advance by `dt` seconds without any reading.

        Raises:
            InputError: as `update`.
        """
        u = _inputs_of(self.model, inputs)
        self._refuse_time(dt)
        if not self.running:
            self._begin(np.full(len(self.model.nodes), math.nan), u)
        self._advance(u, dt)

    @property
    def model_errors(self) -> dict[str, float]:
        """What is wrong with the model by what was read so far, in standard deviations of what may be: missing heat by
        node, `heat.knee`; `air`, inputs and doubtful parameters by their names."""
        rows, off = list(self._error_rows.values()), self._mean.copy()
        off[self.augmented.layout.parameters] -= self._given
        return dict(zip(self._error_rows, (off[rows] / np.sqrt(self._doubt[rows])).tolist(), strict=True))

    @cached_property
    def _error_rows(self) -> dict[str, int]:
        """By the name of what may be wrong its row in the state."""
        layout, rows = self.augmented.layout, dict[str, int]()
        for what, own in (("heat", layout.heat), ("bias", layout.bias)):
            nodes = self.model.nodes[: own.stop - own.start]
            rows |= {f"{what}.{node}": row for row, node in enumerate(nodes, own.start)}
        rows |= dict.fromkeys(["air"] if self.error.air else [], layout.air.start)
        rows |= {name: row for row, name in enumerate(self.error.inputs, layout.inputs.start)}
        doubtful = (self.model.parameters[index].name for index in self.doubtful)
        rows |= {name: row for row, name in enumerate(doubtful, layout.parameters.start)}
        return {name: row for name, row in rows.items() if self._doubt[row] > 0}

    @property
    def running(self) -> bool:
        """Whether a first update was made, or a state restored."""
        return bool(np.isfinite(self._mean).all())

    @property
    def size(self) -> int:
        """Number of the filter's states."""
        return self.augmented.layout.size

    @property
    def values(self) -> FloatArray:
        """The model's parameter values as they are learnt so far, shape (m,)."""
        values = self.model.values
        values[self.doubtful] = self._transform.backward(self._mean[self.augmented.layout.parameters])
        return values

    @property
    def estimate(self) -> Estimate:
        """What is known now, without any new reading."""
        return self._estimate(np.full(len(self.model.nodes), np.nan))

    @property
    def states(self) -> FloatArray:
        """The model's states as they are estimated now [degC], shape (states,)."""
        return self._mean[self.augmented.layout.states].copy()

    def deviations_ahead(self, inputs: Mapping[str, float], seconds: float) -> FloatArray:
        """Standard deviations of the places' temperatures after so many seconds without readings [K], shape (places,).

        Args:
            inputs: held until then, by column.
            seconds: how far ahead; the linearisation now is taken for the whole of it.

        Raises:
            InputError: as `update`.
        """
        self._refuse_time(seconds)
        u = _inputs_of(self.model, inputs)
        step = self.augmented.long_step(self._mean, np.where(np.isnan(u), self._resting, u), seconds)
        variances = np.diag(step.covariance(self._covariance))
        return np.asarray(np.sqrt(np.maximum(variances[: len(self.model.places)], 0.0)))

    def state(self) -> dict[str, FloatArray]:
        """All that the estimator remembers, as plain arrays: `numpy.savez(file, **estimator.state())`."""
        own = {name: np.array(getattr(self, f"_{name}"), dtype=float) for name in _REMEMBERED}
        return own | {"sensors": np.array([sensor.state() for sensor in self.sensors])}

    def restore(self, state: Mapping[str, FloatArray]) -> None:
        """Go on from what `state` returned, by an estimator of the same model and options.

        Raises:
            InputError: an array is absent, or of another shape.
        """
        for name, array in self.state().items():
            shape = np.shape(state[name]) if name in state else None
            if shape != array.shape:
                problem = "no such array" if shape is None else f"shape {shape}"
                raise InputError(
                    self.model.network.origin, f"state {name}", problem, f"an array of shape {array.shape}"
                )
        for name in _REMEMBERED:
            setattr(self, f"_{name}", np.array(state[name], dtype=float))
        for sensor, numbers in zip(self.sensors, state["sensors"], strict=True):
            sensor.restore(numbers)

    def _update(self, u: FloatArray, y: FloatArray, dt: float) -> FloatArray:
        """As `update`, of inputs and readings in the model's order; the innovations [K]."""
        if not self.running or (dt > _GAP and np.isfinite(y).any()):
            self._begin(y, u)
        else:
            self._advance(u, dt)
        if self.watch:
            self._judge(y, dt)
        return self._correct(y, np.isfinite(y) & [not sensor.lost for sensor in self.sensors])

    def _judge(self, y: FloatArray, dt: float) -> None:
        """Judge all sensors; use each, or take back what it taught."""
        predicted, by_state = self.augmented.readings(self._mean)
        without = (predicted + by_state @ self._without).tolist()
        variance = np.einsum("ij,jk,ik->i", by_state, self._covariance, by_state).tolist()
        # A sensor that was never trusted is judged by its own readings alone.
        alone = [sensor.lost and not sensor.once_trusted for sensor in self.sensors]
        for node, sensor in enumerate(self.sensors):
            reference = without[node] + sensor.woken
            by_filter = (reference, sensor.deviation**2) if alone[node] else (float(predicted[node]), variance[node])
            sensor.judge(dt, float(y[node]), by_filter[0], by_filter[1], reference, repeats=self._repeats)
        lived = any(sensor.once_trusted for sensor in self.sensors)
        for node in np.flatnonzero(np.isfinite(y)).tolist():
            self._follow(node, float(y[node]), alone[node])
        if not lived and any(sensor.once_trusted for sensor in self.sensors):
            for node, sensor in enumerate(self.sensors):
                if not (sensor.used or sensor.lost):
                    self._begin_like_others(node)

    def _follow(self, node: int, reading: float, alone: bool) -> None:
        """After a node's sensor was judged: use it, or take back what it taught.

        It was judged by its own reading [degC] `alone` if it had never been trusted.
        """
        sensor, noise = self.sensors[node], math.sqrt(self._read_as[node])
        if not sensor.lost:
            if alone:
                self._begin_node(node, reading, noise)
                sensor.began = reading
            sensor.used = True
            if sensor.trusted:
                sensor.once_trusted, self._coldest = True, np.minimum(self._coldest, sensor.began)
        elif not sensor.agrees and not sensor.once_trusted:
            # It says nothing of its node: robots start near one temperature. What it reads now may wake.
            if not alone:
                self._begin_like_others(node)
            predicted, by_state = self.augmented.readings(self._mean)
            sensor.woken = reading - float((predicted + by_state @ self._without)[node])
            sensor.deviation, sensor.used = noise, False
        elif sensor.used and not sensor.proven:
            sensor.used = False
            # What others read is kept, but no surer than a reading: it was estimated beside a false temperature.
            kept = np.flatnonzero(np.array([sensor.used for sensor in self.sensors])[self._owners])
            without, self._without[kept] = self._without[kept], 0.0
            taught = np.flatnonzero(~self._only_doubtful)
            self._mean[taught] += self._without[taught]
            self._forget(taught)
            self._without[kept] = without
            self._covariance[kept, kept] = self._read_as[self._owners[kept]]

    def _begin_like_others(self, node: int) -> None:
        """A node of which no sensor tells began as warm as those whose sensors live, and while there are none as the
        others, or what surrounds them if that is warmer. Since then it was warmed as the model says."""
        own, lives = self.sensors[node], [sensor.began for sensor in self.sensors if sensor.once_trusted]
        others = [sensor.began for sensor in self.sensors if sensor is not own] or [own.began]
        start = float(np.mean(lives) if lives else max(np.mean(others), self._coldest[0]))
        warmed = float(self._mean[node] + self._without[node]) - own.began
        own.began = start
        self._begin_node(node, start + warmed, _UNMEASURED if lives else _UNREAD)

    def _begin_node(self, node: int, temperature: float, deviation: float) -> None:
        """A node as it is known at a temperature [degC] with an error [K], the model's errors unknown."""
        rows = np.flatnonzero(self._of_node == node)
        self._mean[rows] = np.where(rows < self.augmented.layout.states.stop, temperature, 0.0)
        self.sensors[node].deviation, self.sensors[node].woken = deviation, 0.0
        self._forget(rows)

    def _forget(self, rows: IntArray) -> None:
        """Rows of the state of which nothing is known but what the model alone says."""
        self._without[rows] = 0.0
        variance, states = self._doubt.copy(), self.augmented.layout.states
        variance[states] = np.square([sensor.deviation for sensor in self.sensors])[self._owners]
        self._covariance[rows], self._covariance[:, rows] = 0.0, 0.0
        self._covariance[rows, rows] = variance[rows]

    def _new_sensors(self) -> list[LivingSensor]:
        return [LivingSensor(*own) for own in zip(self._noise.tolist(), self._step.tolist(), strict=True)]

    def _begin(self, y: FloatArray, u: FloatArray) -> None:
        """Start at the first readings; without any at the ambient, far from sure."""
        model, layout, seen = self.model, self.augmented.layout, np.isfinite(y)
        known = y[seen] if seen.any() else u[(self._is_temperature > 0) & np.isfinite(u)]
        if known.size == 0:
            raise InputError(model.network.origin, "first update", "no reading of any node", "one reading at least")
        near = float(known.mean())
        self._resting, self._coldest[0] = np.array([near]), math.inf if model.network.prescribed else near
        self._surround(np.full(len(model.states), near), u)
        warmer = max(near, float(self._coldest[0]))
        elsewhere = max(_UNMEASURED, warmer - near) if seen.any() else _UNREAD
        self.sensors = self._new_sensors()
        for sensor, reading, variance in zip(self.sensors, y.tolist(), self._read_as.tolist(), strict=True):
            read = math.isfinite(reading)
            sensor.began, sensor.deviation = (reading, math.sqrt(variance)) if read else (warmer, elsewhere)
        z, learnt = np.zeros(layout.size), (self._given, self._prior)
        if self.running:  # after a gap: what was learnt of the parameters stays
            learnt = self._mean[layout.parameters], self._covariance[layout.parameters, layout.parameters].copy()
        z[layout.states] = np.array([sensor.began for sensor in self.sensors])[self._owners]
        z[layout.parameters], self._mean = learnt[0], z
        self._forget(np.arange(layout.size))
        hidden = np.arange(len(model.nodes), layout.states.stop)
        self._covariance[hidden, hidden] += _HIDDEN**2
        self._covariance[layout.parameters, layout.parameters] = learnt[1]

    def _surround(self, states: FloatArray, u: FloatArray) -> None:
        """Remember the coldest of what surrounds the nodes, unless some of it is not known."""
        if self.model.network.prescribed:
            felt = self._surroundings(states, u, self._values)
            self._coldest[0] = np.nan_to_num(felt, nan=-math.inf).min(initial=self._coldest[0])

    def _keep_passive(self) -> None:
        """A node that no sensor in use reads is no colder than all around it was, no warmer than its heat allows."""
        if not self.watch:
            return
        coldest = float(self._coldest[0])
        for node, sensor in enumerate(self.sensors):
            if not sensor.used:
                alone = max(float(self._mean[node] + self._without[node]), coldest)
                self._mean[node] = min(max(self._mean[node], coldest), alone + ABOVE * sensor.deviation)
                self._without[node] = alone - self._mean[node]

    def _advance(self, u: FloatArray, dt: float) -> None:
        if dt == 0:
            return
        if self.watch:
            self._surround(self._mean[self.augmented.layout.states], u)
        u, rates, nodes = np.where(np.isnan(u), self._resting, u), self.augmented.rates, len(self.model.nodes)
        if self._change.any():
            # What was learnt of the missing heat counts for less after a change of load. Before the first update the
            # robot is taken to have been in balance, so that all of its imbalance is new.
            change = rates(self._mean, u)[0][:nodes]
            if np.isfinite(self._last_inputs).all():
                change = change - rates(self._mean, self._last_inputs)[0][:nodes]
            heat = np.arange(self.size)[self.augmented.layout.heat]
            self._covariance[heat, heat] += (self._change * change * self._capacities) ** 2
            self._last_inputs = u
        if self.watch:
            # The model alone becomes less sure: by the relative error of heat put in and of heat that leaves, and
            # `error`. What a sensor read that was never trusted is forgotten as its node settles.
            left = rates(self._mean, u * self._is_temperature)[0][:nodes]
            warming, by_state = (array[:nodes] for array in rates(self._mean, u))
            rate = np.sqrt(ERROR**2 * ((warming - left) ** 2 + left**2) + by_state**2 @ self._doubt)
            settles = 1 / np.maximum(-np.diag(by_state), 1 / _DAY)
            for sensor, *own in zip(self.sensors, settles.tolist(), rate.tolist(), strict=True):
                sensor.wait(dt, *own)
        step = self.augmented.step(self._mean, u, dt)
        self._mean = step.states
        self._without = step.transition @ self._without
        self._covariance = step.covariance(self._covariance)
        self._since_correction[: step.moving] = step.transition[: step.moving] @ self._since_correction
        self._keep_passive()

    def _correct(self, y: FloatArray, taken: BoolArray) -> FloatArray:
        """Take in the readings that are `taken`; innovations are those of all."""
        self.last = None
        predicted, by_state = self.augmented.readings(self._mean)
        innovation: FloatArray = y - predicted
        if not taken.any():
            return innovation
        h, step, surprise, variance = by_state[taken], self._step[taken], innovation[taken], self._read_as[taken]
        of_readings = self._covariance @ h.T
        prior = h @ of_readings
        if step.any():
            surprise, variance = as_gaussian(surprise, np.diag(prior), self._noise[taken], step)
        covariance = prior + np.diag(variance)
        gain = np.asarray(np.linalg.solve(covariance, of_readings.T).T, dtype=float)
        # What is only doubtful, not learnt, keeps its value; Joseph's form holds for that gain too.
        gain[self._only_doubtful] = 0.0
        if self.watch:  # one that has not shown yet that it lives teaches of nothing but its own node
            for column, node in enumerate(np.flatnonzero(taken).tolist()):
                if not self.sensors[node].trusted:
                    gain[self._of_node != node, column] = 0.0
        after = self._covariance - gain @ of_readings.T
        after = after - (after @ h.T - gain * variance) @ gain.T
        self._covariance = 0.5 * (after + after.T)
        before, self._mean = self._mean, self._mean + gain @ surprise
        # What is learnt of the model is bounded by what may be wrong with it: a false sensor would run away with it.
        layout, most = self.augmented.layout, _PLAUSIBLE * np.sqrt(self._doubt)
        for where, middle in ((slice(layout.air.start, layout.inputs.stop), 0.0), (layout.parameters, self._given)):
            self._mean[where] = np.clip(self._mean[where], middle - most[where], middle + most[where])
        self._mean[layout.parameters] = np.clip(self._mean[layout.parameters], *self._bounds)
        self._without += before - self._mean  # the model alone stays where it was
        self._without[self._unknown] = 0.0
        self._keep_passive()
        self.last = Correction(self._since_correction, h, gain, covariance, surprise)
        self._since_correction = np.eye(self.size)
        return innovation

    def _estimate(self, innovation: FloatArray) -> Estimate:
        nodes, where = len(self.model.nodes), self.augmented.layout.parameters
        deviations = np.sqrt(np.maximum(np.diag(self._covariance), 0.0))  # rounding may go below 0
        values = self._transform.backward(self._mean[where])
        errors = deviations[where] * np.abs(self._transform.slope(values))
        learnt = {
            self.model.parameters[index].name: (float(value), float(error))
            for index, value, error, chosen in zip(self.doubtful, values, errors, self._learnt, strict=True)
            if chosen
        }
        doubts = {node: sensor.why_not for node, sensor in zip(self.model.nodes, self.sensors, strict=True)
                  if sensor.why_not}  # fmt: skip
        inside = zip(self.model.places[nodes:], self._mean[nodes:].tolist(), deviations[nodes:].tolist(), strict=False)
        hottest = {place: (temperature, deviation) for place, temperature, deviation in inside}
        return Estimate(
            tuple(self.model.nodes), self._mean[:nodes].copy(), deviations[:nodes], innovation, learnt, doubts, hottest
        )

    def _refuse_time(self, dt: float) -> None:
        if not 0 <= dt <= _DAY:
            raise InputError(self.model.network.origin, "time step", f"{dt:g} s", f"a time from 0 to {_DAY:g} s")


# --- What comes from outside: checked, and put in the model's order -------------------------------


def _inputs_of(model: Model, inputs: Mapping[str, float]) -> FloatArray:
    """Values of the model's inputs, shape (inputs,); NaN for one that stands for the resting temperature.

    Raises:
        InputError: one is missing or not finite.
    """
    values = np.empty(len(model.inputs))
    for place, column in enumerate(model.inputs):
        if column not in inputs:
            if column not in model.started:
                raise InputError(model.network.origin, f"input {column}", "no such input", f"a value for {column}")
            values[place] = math.nan
            continue
        values[place] = inputs[column]
        if not math.isfinite(values[place]):
            raise InputError(model.network.origin, f"input {column}", f"{values[place]:g}", "a finite number")
    return values


def _readings_of(model: Model, readings: Mapping[str, float | None]) -> FloatArray:
    """Readings of the model's nodes [degC], shape (nodes,), NaN where missing.

    Raises:
        InputError: a reading of no node, or an infinite one.
    """
    _refuse_unknown(readings, model.nodes, model, "readings")
    given = (readings.get(node) for node in model.nodes)
    values = np.array([math.nan if reading is None else reading for reading in given], dtype=float)
    if np.isinf(values).any():
        node = model.nodes[int(np.isinf(values).argmax())]
        raise InputError(model.network.origin, f"readings of {node}", "an infinite value", "a number, or NaN for none")
    return values


def _sizes_of(model: Model, sizes: Sizes | FloatArray, what: str) -> FloatArray:
    """One size a node, shape (nodes,); 0 for a node that a mapping leaves out.

    Raises:
        InputError: a node that the model doesn't have.
        ValueError: a size that is negative or not finite.
    """
    if isinstance(sizes, np.ndarray):
        sizes = dict(zip(model.nodes, sizes.tolist(), strict=True))
    _refuse_unknown(sizes if isinstance(sizes, Mapping) else (), model.nodes, model, what)
    refuse_negative(sizes, what)
    return by_node(sizes, model.nodes)


def _refuse_unknown(names: Iterable[str], expected: Sequence[str], model: Model, what: str) -> None:
    for name in names:
        if name not in expected:
            raise InputError(model.network.origin, what, f"'{name}'", f"one of {', '.join(expected)}")
