"""An extended Kalman filter on a model: temperatures of all nodes, and how sure they are, sample by sample."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import ndtr

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.parameters import Transform
from lptn.model.model import Model
from lptn.online.dynamics import Dynamics, ModelError, by_node
from lptn.simulate.bound_run import BoundRun

if TYPE_CHECKING:
    from lptn.identify.fitting import Fit


# --- What an estimator tells: temperatures and their uncertainty; and the algebra behind it -------


@dataclass(frozen=True)
class Estimate:
    """What is known after an update; arrays have one entry for each node, in the order of `nodes`.

    Args:
        nodes: names of the nodes.
        temperatures: of the nodes [degC].
        deviations: their standard deviations [K].
        innovations: reading minus prediction [K], NaN where nothing was read.
        spreads: standard deviations expected of the innovations, rounding included [K].
        parameters: learnt parameters in their units, by name, each with its standard deviation.
    """

    nodes: tuple[str, ...]
    temperatures: FloatArray
    deviations: FloatArray
    innovations: FloatArray
    spreads: FloatArray
    parameters: dict[str, tuple[float, float]]

    def temperature(self, node: str) -> tuple[float, float]:
        """Temperature of a node [degC] and its standard deviation [K].

        Raises:
            ValueError: the model has no such node.
        """
        row = self.nodes.index(node)
        return float(self.temperatures[row]), float(self.deviations[row])


@dataclass(frozen=True)
class Correction:
    """The linear algebra of one correction, for whoever follows a fault through the filter.

    Args:
        transition: derivative of the state by that after the correction before, shape (z, z).
        by_state: derivative of the seen readings, shape (seen, z).
        gain: shape (z, seen).
        covariance: of the seen innovations [K²], shape (seen, seen).
        innovation: shape (seen,) [K].
    """

    transition: FloatArray
    by_state: FloatArray
    gain: FloatArray
    covariance: FloatArray
    innovation: FloatArray


# --- What a reading that is rounded to steps says of the temperature: it lies in a cell, no more ---


_LEAST_SHARE = 1e-10  # probability of the cell below which a Gaussian must do: the tails are beyond the floats
_LEAST_WEIGHT = 1e-9  # 1/K²; a reading that says less says nothing
_ROOT = np.sqrt(2 * np.pi)


def as_gaussian(
    innovation: FloatArray, spread: FloatArray, noise: FloatArray, step: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The Gaussian measurement that moves a prediction as the rounded one does, matched in mean and variance.

    The noisy temperature before rounding is Gaussian about the prediction; given the cell it is a truncated
    Gaussian. A prediction well inside its cell learns nothing, however often it is told; one at the edge
    learns which side it is on. Treating the rounding as white noise of variance step²/12 instead
    makes a filter the surer the longer a reading stands still.

    Args:
        innovation: reading minus predicted reading [K], shape (n,).
        spread: variance of the predicted temperature [K²], shape (n,).
        noise: variance of the noise before rounding [K²], shape (n,).
        step: of the sensor [K], 0 for a fine one, shape (n,).

    Returns:
        equivalent innovation [K] and equivalent noise variance [K²], shape (n,) each.
    """
    total = spread + noise
    deviation = np.sqrt(total)
    low, high = (innovation - step / 2) / deviation, (innovation + step / 2) / deviation
    # Both ends on the left: there the distribution function keeps its digits.
    right = low + high > 0
    low, high = np.where(right, -high, low), np.where(right, -low, high)
    share = ndtr(high) - ndtr(low)
    coarse = (step > 0) & (share > _LEAST_SHARE)
    share = np.where(coarse, share, 1.0)
    at_low, at_high = np.exp(-0.5 * low**2) / _ROOT, np.exp(-0.5 * high**2) / _ROOT
    mean = (at_low - at_high) / share
    shrunk = mean**2 + (high * at_high - low * at_low) / share  # of the variance, as a share
    weight = np.maximum(np.minimum(shrunk, 1.0) / total, _LEAST_WEIGHT)
    moved = np.where(right, -mean, mean) / (deviation * weight)
    return (
        np.where(coarse, moved, innovation),
        np.where(coarse, np.maximum(1 / weight - spread, 0.0), noise + step**2 / 12),
    )


# --- The noise of a coarse sensor, which hides in its steps, from how often its reading flickers between two of them ---


_SAFE = 0.3  # of a step: too much noise costs a filter little, too little makes it sure of what is wrong
_SMOOTH = 60  # readings over which a movement of the temperature itself is told from flicker
_FEWEST = 600  # readings
_LEAST = 0.02  # of a step


def coarse_noise(bound_runs: Sequence[BoundRun], row: int, step: float) -> float:
    r"""Standard deviation of the noise before rounding [K], of one node's sensor.

    White noise of standard deviation :math:`\sigma` changes the reading from one sample to the next with probability
    :math:`2\sigma / (q\sqrt\pi)`, averaged over a cell of width q; what the temperature's own movement adds is
    taken off. Readings that were averaged after rounding don't show it: then a share of the step serves.
    """
    single = [_whole(bound.measured[row], step) for bound in bound_runs if not bound.run.averaged]
    pairs = sum(max(0, readings.size - _SMOOTH) for readings in single)
    if pairs < _FEWEST:
        return _SAFE * step
    changes = sum(float(np.abs(np.diff(readings)).clip(max=step).sum()) for readings in single)
    moved = sum(float(np.abs(readings[_SMOOTH:] - readings[:-_SMOOTH]).sum()) / _SMOOTH for readings in single)
    return float(max(np.sqrt(np.pi) / 2 * (changes - moved) / pairs, _LEAST * step))


def _whole(readings: FloatArray, step: float) -> FloatArray:
    """Readings without gaps; none where they don't lie on the sensor's steps."""
    known = readings[np.isfinite(readings)]
    off = np.abs((known - known[:1]) / step - np.round((known - known[:1]) / step))
    return known if known.size > _SMOOTH and off.max() < 0.02 else known[:0]


# --- What comes to an estimator from outside: checked, and put in the model's order ---------------


def inputs_of(model: Model, inputs: Mapping[str, float]) -> FloatArray:
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


def readings_of(model: Model, readings: Mapping[str, float | None], what: str = "readings") -> FloatArray:
    """Readings of the model's nodes [degC], shape (nodes,), NaN where missing.

    Raises:
        InputError: a reading of no node, or an infinite one.
    """
    refuse_unknown(readings, model.nodes, model, what)
    given = (readings.get(node) for node in model.nodes)
    values = np.array([math.nan if reading is None else reading for reading in given], dtype=float)
    if np.isinf(values).any():
        node = model.nodes[int(np.isinf(values).argmax())]
        raise InputError(model.network.origin, f"{what} of {node}", "an infinite value", "a number, or NaN for none")
    return values


def refuse_unknown(names: Mapping[str, object], known: Sequence[str], model: Model, what: str) -> None:
    """Refuse a name that the model doesn't have: it is a slip of the pen.

    Raises:
        InputError: with the known names.
    """
    for name in names:
        if name not in known:
            raise InputError(model.network.origin, what, f"'{name}'", f"one of {', '.join(known)}")


def refuse_negative(sizes: Mapping[str, float]) -> None:
    """Refuse a size that is negative or not finite.

    Raises:
        ValueError: with its name.
    """
    for name, size in sizes.items():
        if not (math.isfinite(size) and size >= 0):
            raise ValueError(f"{name}: found {size:g}; expected a finite size, 0 or above")


def sizes_of(model: Model, sizes: float | Mapping[str, float], what: str) -> FloatArray:
    """One size a node, shape (nodes,); 0 for a node that a mapping leaves out.

    Raises:
        InputError: a node that the model doesn't have.
        ValueError: a size that is negative or not finite.
    """
    given = sizes if isinstance(sizes, Mapping) else dict.fromkeys(model.nodes, sizes)
    refuse_unknown(given, model.nodes, model, what)
    refuse_negative({f"{what} of {node}": size for node, size in given.items()})
    return np.array([given.get(node, 0.0) for node in model.nodes], dtype=float)


Rounding = Literal["cell", "white", "ignored"]
"""How the steps of a coarse sensor enter: as cells, as white noise of variance step²/12, or not at all."""

_UNMEASURED = 5.0  # K; standard deviation at the start of a node without a reading
_UNREAD = 15.0  # K; of all nodes where nothing is read at the start
_HIDDEN = 2.0  # K; of a hidden state about its node
_UNKNOWN = 0.3  # standard deviation of a learnt parameter's coordinate: some 30 %
_WALK = 0.05  # how far a learnt parameter's coordinate walks in an hour
_HOUR, _DAY = 3600.0, 86400.0  # s; what was known a day ago is worth no more than a new start
_LEAST_NOISE = 0.02  # K


class Estimator:
    r"""Extended Kalman filter on the model's RK4 step and its exact derivative.

    The state is the model's own, enlarged by what `error` allows and by the parameters in doubt. The covariance
    is corrected in Joseph's form, :math:`(I-KH)P(I-KH)^\top + KRK^\top`, which keeps it positive for any gain.

    Args:
        model: the model, at the values to start from.
        noise: standard deviation of the white noise of a reading, before rounding [K], for all nodes or by node.
            For a coarse sensor rather too large than too small: `from_fit` finds it.
        step: step of the sensors [K], 0 for fine ones, for all nodes or by node.
        error: what may be wrong with the model.
        learn: parameters to learn while running; a mapping gives how far each may walk in an hour, as a share
            of its value (of its typical size where zero is admissible). Slow walks: 0.05 by default.
        covariance: of the fit's coordinates of the model's free parameters, shape (free, free): doubt about
            parameters that aren't learnt widens the temperatures' uncertainty and is never narrowed.
        start: temperatures to start from [degC] by node; by default the first readings.
        rounding: how the steps enter; the default is best, the others are there to be compared.

    Raises:
        InputError: an unknown node, parameter or column; a start that is infinite.
        ValueError: a size that is negative or not finite, or a covariance of the wrong shape.
    """

    def __init__(
        self,
        model: Model,
        *,
        noise: float | Mapping[str, float] = 0.15,
        step: float | Mapping[str, float] = 0.0,
        error: ModelError | None = None,
        learn: Sequence[str] | Mapping[str, float] = (),
        covariance: FloatArray | None = None,
        start: Mapping[str, float] | None = None,
        rounding: Rounding = "cell",
    ) -> None:
        if rounding not in get_args(Rounding):
            raise ValueError(f"rounding: found {rounding!r}; expected one of {', '.join(get_args(Rounding))}")
        self.model, self.error = model, error or ModelError()
        self._rounding = rounding
        self._noise = sizes_of(model, noise, "noise") ** 2
        self._step = sizes_of(model, step, "step") * (rounding != "ignored")
        self._change = by_node(self.error.change, model.nodes)
        refuse_unknown(self.error.inputs, model.inputs, model, "error.inputs")
        given = readings_of(model, start or {}, "start")
        walks = dict(learn) if isinstance(learn, Mapping) else dict.fromkeys(learn, _WALK)
        self._doubt(walks, covariance)
        self._given_start = given
        self._resting = np.full(1, math.nan)
        self._last_inputs = np.full(len(model.inputs), math.nan)
        self._z = np.full(self._dynamics.layout.size, np.nan)
        self._covariance = np.zeros((len(self._z), len(self._z)))
        self._moved = np.eye(len(self._z))
        self.last: Correction | None = None
        """The linear algebra of the last update's correction; `None` where nothing was read."""

    @classmethod
    def from_fit(
        cls, fit: Fit, *, error: ModelError | None = None, learn: Sequence[str] | Mapping[str, float] = ()
    ) -> Estimator:
        """An estimator on a fitted model, with the noise, sensor steps and parameter covariance of the fit."""
        nodes = fit.model.nodes
        bound_runs, steps = fit.problem.bound_runs, fit.noise.step
        coarse = [coarse_noise(bound_runs, row, step) if step > 0 else _LEAST_NOISE for row, step in enumerate(steps)]
        white = np.maximum(fit.noise.white, coarse)
        return cls(
            fit.model,
            noise=dict(zip(nodes, white.tolist(), strict=True)),
            step=dict(zip(nodes, steps.tolist(), strict=True)),
            error=error,
            learn=learn,
            covariance=fit.uncertainty.covariance,
        )

    # --- use --------------------------------------------------------------------------------------

    def update(self, inputs: Mapping[str, float], readings: Mapping[str, float | None], dt: float) -> Estimate:
        """Advance by `dt` with the inputs held, then take in the readings.

        Args:
            inputs: a value for each of the model's input columns; others are left aside.
            readings: temperatures [degC] by node; NaN, `None` or no entry for a missing one.
            dt: time since the last update [s]; 0 at the first one.

        Raises:
            InputError: an input that is missing or not finite, a reading that is infinite or of no node, a
                time step that is negative, not finite or longer than a day. The estimator stays as it was.
        """
        u, y = inputs_of(self.model, inputs), readings_of(self.model, readings)
        self._refuse_time(dt)
        if not self.running:
            self._begin(y, u)
        self._advance(u, dt)
        return self._correct(y)

    def advance(self, inputs: Mapping[str, float], dt: float) -> None:
        """Advance by `dt` seconds without any reading.

        Raises:
            InputError: as `update`.
        """
        u = inputs_of(self.model, inputs)
        self._refuse_time(dt)
        if not self.running:
            self._begin(np.full(len(self.model.nodes), math.nan), u)
        self._advance(u, dt)

    @property
    def running(self) -> bool:
        """Whether a first update was made, or a state restored."""
        return bool(np.isfinite(self._z).all())

    @property
    def size(self) -> int:
        """Number of the filter's states."""
        return self._dynamics.layout.size

    @property
    def estimate(self) -> Estimate:
        """What is known now, without any new reading."""
        missing = np.full(len(self.model.nodes), np.nan)
        return self._told(missing, missing)

    def state(self) -> dict[str, FloatArray]:
        """All that the estimator remembers, as plain arrays: `numpy.savez(file, **estimator.state())`."""
        return {
            "mean": self._z.copy(),
            "covariance": self._covariance.copy(),
            "resting": self._resting.copy(),
            "inputs": self._last_inputs.copy(),
        }

    def restore(self, state: Mapping[str, FloatArray]) -> None:
        """Go on from what `state` returned, by an estimator of the same model and options.

        Raises:
            InputError: an array is absent, or of another shape.
        """
        own = self.state()
        for name, array in own.items():
            shape = np.shape(state[name]) if name in state else None
            if shape != array.shape:
                found = "no such array" if shape is None else f"shape {shape}"
                raise InputError(self.model.network.origin, f"state {name}", found, f"an array of shape {array.shape}")
        self._z = np.array(state["mean"], dtype=float)
        self._covariance = np.array(state["covariance"], dtype=float)
        self._resting = np.array(state["resting"], dtype=float)
        self._last_inputs = np.array(state["inputs"], dtype=float)

    # --- what is doubted --------------------------------------------------------------------------

    def _doubt(self, walks: Mapping[str, float], covariance: FloatArray | None) -> None:
        model = self.model
        names = [parameter.name for parameter in model.parameters]
        refuse_unknown(walks, names, model, "learn")
        refuse_negative(walks)
        free = model.free if covariance is not None else []
        if covariance is not None and np.shape(covariance) != (len(free), len(free)):
            raise ValueError(f"covariance: found shape {np.shape(covariance)}; expected {(len(free), len(free))}")
        learnt = [names.index(name) for name in walks]
        doubted = [*free, *(index for index in learnt if index not in free)]
        self._learnt = np.array([index in learnt for index in doubted], dtype=bool)
        self._doubted = [model.parameters[index] for index in doubted]
        self._transform = Transform(self._doubted)
        self._prior = np.diag(np.full(len(doubted), _UNKNOWN**2))
        if covariance is not None:
            self._prior[: len(free), : len(free)] = covariance
        hourly = np.array([walks.get(parameter.name, 0.0) for parameter in self._doubted])
        self._dynamics = Dynamics(model, self.error, doubted, hourly**2 / _HOUR)
        declared = np.array([parameter.declared.bounds for parameter in self._doubted]).reshape(-1, 2)
        self._bounds = [self._transform.forward(bound) for bound in declared.T]

    # --- the filter -------------------------------------------------------------------------------

    def _begin(self, y: FloatArray, u: FloatArray) -> None:
        """Start at the first readings, or where the caller said; without either at the ambient, far from sure."""
        model, layout = self.model, self._dynamics.layout
        known = np.where(np.isfinite(self._given_start), self._given_start, y)
        seen = np.isfinite(known)
        air = u[[column.startswith("temperature.") for column in model.inputs]]
        near = known[seen] if seen.any() else air[np.isfinite(air)]
        if near.size == 0:
            expected = "one reading at least, or start = {...}"
            raise InputError(model.network.origin, "first update", "no reading of any node", expected)
        nodes = np.where(seen, known, near.mean())
        elsewhere = _UNMEASURED if seen.any() else _UNREAD
        scatter = np.where(seen, self._noise + self._step**2 / 12, elsewhere**2)
        owners = np.array(model.owners)
        z, spread = np.zeros(layout.size), self._dynamics.errors.copy()
        z[layout.states], spread[layout.states] = nodes[owners], scatter[owners]
        spread[len(model.nodes) : layout.states.stop] += _HIDDEN**2
        z[layout.parameters] = self._transform.forward(np.array([parameter.value for parameter in self._doubted]))
        self._covariance = np.diag(spread)
        self._covariance[layout.parameters, layout.parameters] = self._prior
        self._resting = np.array([nodes.mean()])
        self._z = z

    def _advance(self, u: FloatArray, dt: float) -> None:
        if dt == 0:
            return
        u = np.where(np.isnan(u), self._resting, u)
        if self._change.any():
            self._unsettle(u)
        moved = self._dynamics.step(self._z, u, dt)
        self._z = moved.states
        self._covariance = moved.transition @ self._covariance @ moved.transition.T + moved.gained
        self._moved = moved.transition @ self._moved

    def _unsettle(self, u: FloatArray) -> None:
        """What was learnt of the missing heat counts for less after a change of load.

        Before the first update the robot is taken to have been in balance, so that all of its imbalance is new.
        """
        change = self._dynamics.heat_flow(self._z, u)
        if np.isfinite(self._last_inputs).all():
            change = change - self._dynamics.heat_flow(self._z, self._last_inputs)
        where = np.arange(self.size)[self._dynamics.layout.heat]
        self._covariance[where, where] += (self._change * change) ** 2
        self._last_inputs = u

    def _correct(self, y: FloatArray) -> Estimate:
        self.last = None
        predicted, by_state = self._dynamics.readings(self._z)
        innovation, spreads = y - predicted, np.full(len(y), math.nan)
        seen = np.isfinite(innovation)
        h, noise, step = by_state[seen], self._noise[seen], self._step[seen]
        cross = self._covariance @ h.T
        prior = h @ cross
        spreads[seen] = np.sqrt(np.diag(prior) + noise + step**2 / 12)
        moved, variance = innovation[seen], noise + step**2 / 12
        if self._rounding == "cell" and step.any():
            moved, variance = as_gaussian(moved, np.diag(prior), noise, step)
        if seen.any():
            self._take_in(h, cross, prior + np.diag(variance), moved, variance)
        return self._told(innovation, spreads)

    def _take_in(
        self, by_state: FloatArray, cross: FloatArray, covariance: FloatArray, moved: FloatArray, variance: FloatArray
    ) -> None:
        factor = cho_factor(covariance, lower=True, check_finite=False)
        gain = cho_solve(factor, cross.T, check_finite=False).T
        # What is only doubted, not learnt, keeps its value; Joseph's form holds for that gain too.
        gain[self._dynamics.layout.parameters][~self._learnt] = 0.0
        self._z = self._z + gain @ moved
        kept = np.eye(len(self._z)) - gain @ by_state
        after = kept @ self._covariance @ kept.T + (gain * variance) @ gain.T
        self._covariance = 0.5 * (after + after.T)
        self._keep_in_bounds()
        self.last = Correction(self._moved, by_state, gain, covariance, moved)
        self._moved = np.eye(len(self._z))

    def _keep_in_bounds(self) -> None:
        where = self._dynamics.layout.parameters
        self._z[where] = np.clip(self._z[where], *self._bounds)

    def _told(self, innovation: FloatArray, spreads: FloatArray) -> Estimate:
        nodes, where = len(self.model.nodes), self._dynamics.layout.parameters
        deviations = np.sqrt(np.maximum(np.diag(self._covariance), 0.0))  # rounding may go below 0
        coordinates = self._z[where]
        values = self._transform.backward(coordinates)
        errors = deviations[where] * np.abs(self._transform.slope(values))
        learnt = {
            parameter.name: (float(value), float(error))
            for parameter, value, error, chosen in zip(self._doubted, values, errors, self._learnt, strict=True)
            if chosen
        }
        return Estimate(
            tuple(self.model.nodes), self._z[:nodes].copy(), deviations[:nodes], innovation, spreads, learnt
        )

    def _refuse_time(self, dt: float) -> None:
        if not 0 <= dt <= _DAY:
            raise InputError(self.model.network.origin, "time step", f"{dt:g} s", f"a time from 0 to {_DAY:g} s")


# --- An estimator led along a whole run -----------------------------------------------------------


def run_filter(estimator: Estimator, bound: BoundRun, measured: FloatArray | None = None) -> Iterator[Estimate]:
    """Estimates at each of a run's n readings, in order of time.

    A reading that is the mean over its step is taken in at the middle of it.

    Args:
        estimator: fresh, or at the state in which the run begins.
        driven: the run as the model sees it.
        measured: readings [degC], shape (nodes, n), that stand for the run's own.
    """
    model, step = estimator.model, bound.run.step
    readings = bound.measured if measured is None else measured
    last: dict[str, float] = {}
    before = 0.0
    for k in range(len(bound)):
        inputs = _named(model.inputs, bound.inputs[:, k])
        present = {model.nodes[row]: float(readings[row, k]) for row in np.flatnonzero(np.isfinite(readings[:, k]))}
        if bound.run.averaged:
            if before:
                estimator.advance(last, before)
            yield estimator.update(inputs, present, step / 2 if estimator.running else 0.0)
            last, before = inputs, step / 2
        else:
            yield estimator.update(last if before else inputs, present, before)
            last, before = inputs, step


def _named(columns: list[str], values: FloatArray) -> dict[str, float]:
    return dict(zip(columns, values.tolist(), strict=True))
