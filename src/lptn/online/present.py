"""The present state, estimated from the log so far, with what is known of the model's errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, exp, log, pi
from typing import NamedTuple

import casadi as ca
import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.parameters import ParameterInstance, Transform
from lptn.identify.fitting import Fit
from lptn.identify.noise import Noise
from lptn.logs.run import Run
from lptn.model.file import FitTable
from lptn.model.model import Model
from lptn.simulate.bound_run import BoundRun, bind, default_start
from lptn.simulate.dynamics import Linearisation, zero_order_hold

# --- A model's motion over a time step, with derivatives by all that a forecast doubts ------------


_MAX_RATE = 1.0  # product of an RK4 step and a bound of the fastest rate


class Motion(NamedTuple):
    """One step: the states behind it, and their derivatives.

    Args:
        states: shape (states,).
        by_state: shape (states, states).
        by_heat: by heat [W] that the model lacks at the nodes, held over the step, shape (states, nodes).
        by_air: by the logarithm of a factor on all conductances to prescribed temperatures, shape (states, 1).
        by_parameter: by the coordinates of the free parameters, shape (states, free).
        by_input: by inputs held over the step, shape (states, inputs).
    """

    states: FloatArray
    by_state: FloatArray
    by_heat: FloatArray
    by_air: FloatArray
    by_parameter: FloatArray
    by_input: FloatArray


class Dynamics:
    """Steps of any length of a model, and its readings, with derivatives.

    Args:
        model: the model, at the values to use.
    """

    def __init__(self, model: Model) -> None:
        self.model, self._values, self._free = model, model.values, model.free
        free = [model.parameters[index] for index in self._free]
        self._transform = Transform(free)
        self._fitted = self._transform.forward(self._values[self._free])
        bounds = np.array([parameter.declared.bounds for parameter in free], dtype=float).reshape(-1, 2)
        self._bounds = [self._transform.forward(bound) for bound in bounds.T]
        prescribed = model.network.prescribed
        outward = [link.resistance for link in model.network.resistors if not prescribed.keys().isdisjoint(link.ends)]
        self._outward = list(dict.fromkeys(outward))
        chosen = list(dict.fromkeys([*self._free, *self._outward]))
        self._outward_columns = [chosen.index(index) for index in self._outward]
        key = ("jacobians", len(model.states), tuple(chosen))
        self._jacobians = model.made_once(key, lambda: Linearisation(model, len(model.states), chosen))
        self._by_input = model.made_once("input jacobian", self._make_by_input)
        self._capacities = [model.network.capacities[node] for node in model.nodes]

    def values(self, errors: FloatArray) -> FloatArray:
        """Parameter values, shape (m,), corrected.

        Args:
            errors: logarithm of a factor on all conductances to prescribed temperatures, then what is added
                to the free parameters' coordinates, shape (1 + free,).
        """
        values = self._values.copy()
        values[self._free] = self._transform.backward(self._fitted + errors[1:])
        values[self._outward] *= np.exp(-errors[0])
        return values

    def bounded(self, errors: FloatArray) -> FloatArray:
        """What `values` takes, changed so that each parameter stays within its bounds."""
        return np.concatenate([errors[:1], np.clip(self._fitted + errors[1:], *self._bounds) - self._fitted])

    def rates(self, x: FloatArray, u: FloatArray, p: FloatArray) -> FloatArray:
        """d rates / d states [1/s]."""
        return np.asarray(self._jacobians.rates(x[:, None], u[:, None], p)[0][:, : len(x)])

    def step(self, x: FloatArray, heat: FloatArray, u: FloatArray, p: FloatArray, h: float) -> Motion:
        """States after `h` seconds with everything held.

        Args:
            x: states [degC].
            heat: that the model lacks at each node [W].
            u: inputs.
            p: all parameter values.
        """
        n, nodes = len(x), len(heat)
        by_state, by_value = np.split(self._jacobians.rates(x[:, None], u[:, None], p)[0], [n], axis=1)
        free = len(self._free)
        by_parameter = by_value[:, :free] * self._slope(p)
        by_air = -by_value[:, self._outward_columns] @ p[self._outward]
        transition, held = zero_order_hold(by_state, h)
        parts = max(1, ceil(float(np.abs(by_state).sum(axis=1).max()) * h / _MAX_RATE))
        function, following = self.model.step("rk4"), x
        for _ in range(parts):
            following = function(following, u, p, h / parts).full().ravel()
        by_heat = held[:, :nodes] / p[self._capacities]
        by_input = held @ self._by_input(x, u, p).full()
        following = following + by_heat @ heat
        return Motion(following, transition, by_heat, held @ by_air[:, None], held @ by_parameter, by_input)

    def readings(self, x: FloatArray, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Expected readings [degC], and their derivative by states, heat, air and the free parameters' coordinates."""
        by_state, by_value = np.split(self._jacobians.readings(x[:, None], p)[0], [len(x)], axis=1)
        nodes, free = len(self.model.nodes), len(self._free)
        by_parameter = by_value[:, :free] * self._slope(p)
        slope = np.hstack([by_state, np.zeros((nodes, nodes + 1)), by_parameter])
        return self.model.output(x, p).full().ravel(), slope

    def _slope(self, p: FloatArray) -> FloatArray:
        return self._transform.slope(p[self._free])

    def _make_by_input(self) -> ca.Function:
        x, u, p, rates, _ = self.model.symbols
        return ca.Function("by_input", [x, u, p], [ca.densify(ca.jacobian(rates, u))])


# --- What is known of a model's errors: doubt about its parameters, and how far it strays from readings ---


_UNKNOWN_ERROR = 1.0  # K; of a model of which nobody says how well it fitted
_LEAST_ERROR = 0.1  # K; no model is better on a run that it never saw
_DOUBT = 2.0  # times the standard errors: of another activity a fit knows less than of those that it saw
_CLOSE = 1e-3  # in the fit's coordinates; nearer to a bound than this a parameter is at it
_WIDEST = 0.5  # in the fit's coordinates; a derivative says nothing of what lies further away


@dataclass(frozen=True)
class Knowledge:
    """How far a model is to be trusted.

    Args:
        covariance: of the free parameters in the fit's coordinates (logarithms of positive ones, else shares of
            the typical size), shape (free, free).
        error: how far a free-running simulation strays from noise-free readings, root mean square [K], shape (nodes,).
        source: where this is from, in words.
        adequate: whether the model followed what it was fitted to as well as the sensors' noise allows.
    """

    covariance: FloatArray
    error: FloatArray
    source: str
    adequate: bool = True

    @classmethod
    def of_fit(cls, fit: Fit) -> Knowledge:
        """Of a fit in memory: the same that its model file keeps."""
        return cls.of_table(fit.model, fit.table(), fit.noise.floor)

    @classmethod
    def of_table(cls, model: Model, table: FitTable, floor: FloatArray) -> Knowledge:
        """Of the `[fit]` table of a model file: standard errors, and the RMSE less what the sensors leave.

        Correlations are left out, though a fit knows them: they say how well the fitted runs hold combinations of
        parameters together if the model is right. For the same reason standard errors are doubled: of virtual
        trots' times to a limit, all joints, 90 % intervals then held 94 %, else 86 %.

        Args:
            model: the model.
            table: as the model file holds it; without a fit, a model error of 1 K is assumed.
            floor: RMSE that noise and steps of the sensors leave [K], shape (nodes,).
        """
        if table.rmse is None:
            return cls.nothing(model)
        free = [model.parameters[index] for index in model.free]
        slope = np.abs(Transform(free).slope(np.array([parameter.value for parameter in free], dtype=float)))
        errors = [table.parameters[each.name].error if each.name in table.parameters else None for each in free]
        # What a fit left undetermined stands there without a standard error.
        known = np.array([np.nan if error is None else error for error in errors], dtype=float)
        variance = (_DOUBT * known / np.where(slope > 0, slope, 1.0)) ** 2
        variance = np.where(np.isnan(known) | _at_bound(free), _WIDEST**2, _bounded(variance))
        error = _beyond(np.full(len(model.nodes), table.rmse**2), floor)
        adequate = table.rmse**2 < 2 * float(floor.max()) ** 2  # what the model adds is less than the noise
        source = "standard errors and RMSE of its fit"
        if not adequate:
            source += ", which is worse than the sensors' noise: something is missing, see lptn diagnose"
        return cls(np.diag(variance), error, source, adequate)

    @classmethod
    def nothing(cls, model: Model) -> Knowledge:
        """Of a model that nobody fitted: its parameters are taken for exact, and its error for 1 K."""
        free = len(model.free)
        error = np.full(len(model.nodes), _UNKNOWN_ERROR)
        return cls(np.zeros((free, free)), error, f"no fit is known; a model error of {_UNKNOWN_ERROR:g} K is assumed")


def _beyond(mean_square: FloatArray, floor: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.maximum(mean_square - floor**2, _LEAST_ERROR**2)))


def _at_bound(free: Sequence[ParameterInstance]) -> BoolArray:
    """Parameters that a bound stopped: their standard errors don't say how far the data would have moved them."""
    transform = Transform(free)
    bounds = transform.forward(
        np.array([parameter.declared.bounds for parameter in free], dtype=float).reshape(-1, 2).T
    )
    values = transform.forward(np.array([parameter.value for parameter in free], dtype=float))
    return np.asarray(np.abs(bounds - values).min(axis=0, initial=np.inf) < _CLOSE)


def _bounded(variance: FloatArray) -> FloatArray:
    """Variances of what the data leave open made no wider than what a derivative is good for."""
    return np.asarray(variance * _WIDEST**2 / (variance + _WIDEST**2))


# --- The present state, estimated from the log so far, with what the model gets wrong on this log ---


_BLOCK = 10.0  # s; readings are averaged over it
_MEMORY = 3600.0  # s of the log that are looked at
_HEAT_TIME = 1800.0  # s over which the heat that a model lacks stays alike
_AIR = 0.1  # relative error of all conductances to the air in one run: a draught, a load on the back
_SCALES = (0.5, 1.0, 2.0, 4.0)
_TYPICAL = 1.5  # times the fit's own residuals: on a run that it never saw a model is worse
_START = 0.5  # K, by which first readings may be off, beside the sensor's steps
_UNSEEN = 5.0  # K, by which a node without a sensor may start away from the others
_LEAST_NOISE = 0.05  # K


@dataclass(frozen=True)
class Present:
    """What is known at the end of a log.

    Its unknowns are, in this order: the model's states [degC]; heat that it lacks at each node [W]; the logarithm of
    a factor on all conductances to prescribed temperatures; errors of the free parameters' coordinates.

    Args:
        mean: of the unknowns, shape (states + nodes + 1 + free,).
        covariance: of the same.
        heat: standard deviation of the missing heat in the long run [W].
        likelihood: its logarithm, of the log with missing heat of that size.
    """

    mean: FloatArray
    covariance: FloatArray
    heat: float
    likelihood: float


def present(model: Model, run: Run, noise: Noise, knowledge: Knowledge) -> Present:
    """Estimate the present from the end of a log by an extended Kalman filter.

    The parameters and the draught are estimated along, from what the fit leaves open: a trot says more of its own
    friction than an identification with few trots. Not so for a model that lacks something, such as a second mass: it
    would bend them to suit the log so far, so their errors only widen the uncertainty. Missing heat is of the size
    that the fit's residuals suggest, times a factor that makes this log likeliest.

    Raises:
        InputError: the log lacks an input, or measures none of the model's nodes.
    """
    blocks = _blocks(run)
    bound = bind(model, blocks)
    white = noise.white / np.sqrt(max(1.0, blocks.step / run.step))
    quiet = Noise(np.maximum(white, _LEAST_NOISE), noise.step)
    dynamics = Dynamics(model)
    filtered = _Filter(dynamics, bound, quiet, knowledge)
    size = float(np.sqrt(np.mean((knowledge.error / _response(dynamics, bound)) ** 2)))
    tried = {scale: filtered.run(scale * size) for scale in _SCALES}
    chance = {scale: each.likelihood - 0.5 * (log(scale / _TYPICAL) / log(2.0)) ** 2 for scale, each in tried.items()}
    return tried[max(chance, key=lambda scale: chance[scale])]


def advance(
    mean: FloatArray, covariance: FloatArray, motion: Motion, heat: float, step: float
) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance of the unknowns one step later: missing heat fades, and new one appears.

    Where the covariance has rows for the inputs behind those of the mean, the inputs' errors stay as they are.
    """
    n, nodes = motion.by_heat.shape
    fading = exp(-step / _HEAT_TIME)
    moved = np.hstack([motion.by_state, motion.by_heat, motion.by_air, motion.by_parameter, motion.by_input])
    transition = np.eye(len(covariance))
    transition[:n] = moved[:, : len(covariance)]
    transition[n : n + nodes, n : n + nodes] *= fading
    following = mean.copy()
    following[:n] = motion.states
    following[n : n + nodes] *= fading
    covariance = transition @ covariance @ transition.T
    covariance[n : n + nodes, n : n + nodes] += np.eye(nodes) * heat**2 * (1 - fading**2)
    return following, covariance


class _Filter:
    """The filter over one log, in blocks.

    Args:
        dynamics: the model's steps.
        driven: the log.
        noise: of a block's readings.
        knowledge: of the model.
    """

    def __init__(self, dynamics: Dynamics, bound: BoundRun, noise: Noise, knowledge: Knowledge) -> None:
        self._dynamics, self._driven, self._knowledge = dynamics, bound, knowledge
        self._variance = noise.white**2 + noise.step**2 / 12
        self._steps = noise.step
        model = dynamics.model
        self._states, self._nodes, self._free = len(model.states), len(model.nodes), len(model.free)

    def run(self, heat: float) -> Present:
        """The present, with missing heat of this standard deviation [W]."""
        mean, covariance = self._start(heat)
        likelihood, step = 0.0, self._driven.run.step
        for k in range(len(self._driven)):
            mean, covariance, gained = self._corrected(mean, covariance, k)
            likelihood += gained
            mean, covariance = advance(mean, covariance, self._motion(mean, k), heat, step)
        return Present(mean, covariance, heat, likelihood)

    def _start(self, heat: float) -> tuple[FloatArray, FloatArray]:
        n, nodes = self._states, self._nodes
        spread = np.full(n, _UNSEEN)
        near = np.hypot(_START, self._steps / np.sqrt(12))
        spread[:nodes] = np.where(np.isfinite(self._driven.start), near, _UNSEEN)
        variances = np.concatenate([spread**2, np.full(nodes, heat**2), [_AIR**2], np.zeros(self._free)])
        covariance = np.diag(variances)
        covariance[n + nodes + 1 :, n + nodes + 1 :] = self._knowledge.covariance
        start = default_start(self._dynamics.model, self._driven)
        return np.concatenate([start, np.zeros(nodes + 1 + self._free)]), covariance

    def _motion(self, mean: FloatArray, k: int) -> Motion:
        n, nodes = self._states, self._nodes
        p = self._dynamics.values(mean[n + nodes :])
        return self._dynamics.step(mean[:n], mean[n : n + nodes], self._driven.inputs[:, k], p, self._driven.run.step)

    def _corrected(self, mean: FloatArray, covariance: FloatArray, k: int) -> tuple[FloatArray, FloatArray, float]:
        """Mean and covariance with a block's readings, and the logarithm of their likelihood."""
        measured = self._driven.measured[:, k]
        seen = np.isfinite(measured)
        if not seen.any():
            return mean, covariance, 0.0
        expected, slope = self._expected(mean, k)
        slope, noise = slope[seen], np.diag(self._variance[seen])
        spread = slope @ covariance @ slope.T + noise
        innovation = measured[seen] - expected[seen]
        gain = np.linalg.solve(spread, slope @ covariance).T
        if not self._knowledge.adequate:
            gain[self._states + self._nodes :] = 0.0
        kept = np.eye(len(mean)) - gain @ slope
        covariance = kept @ covariance @ kept.T + gain @ noise @ gain.T
        size = float(np.linalg.slogdet(2 * pi * spread)[1])
        gained = -0.5 * (float(innovation @ np.linalg.solve(spread, innovation)) + size)
        mean, first = mean + gain @ innovation, self._states + self._nodes
        mean[first:] = self._dynamics.bounded(mean[first:])
        return mean, 0.5 * (covariance + covariance.T), gained

    def _expected(self, mean: FloatArray, k: int) -> tuple[FloatArray, FloatArray]:
        """Expected readings and their derivative; the mean over a block lies half-way between its ends."""
        n, nodes = self._states, self._nodes
        p = self._dynamics.values(mean[n + nodes :])
        shown, slope = self._dynamics.readings(mean[:n], p)
        if not self._driven.run.averaged:
            return shown, slope
        motion = self._motion(mean, k)
        later, by_later = self._dynamics.readings(motion.states, p)
        by_state = by_later[:, :n]
        moved = np.hstack([motion.by_state, motion.by_heat, motion.by_air, motion.by_parameter])
        by_later = np.hstack([np.zeros_like(by_state), by_later[:, n:]]) + by_state @ moved
        return 0.5 * (shown + later), 0.5 * (slope + by_later)


def _blocks(run: Run) -> Run:
    """The end of a run in steps of about 10 s, none of its last seconds lost."""
    run = run.slice(float(run.time[-1]) - _MEMORY, float("inf"))
    factor = max(1, round(_BLOCK / run.step))
    steps = len(run) if run.averaged else len(run) - 1
    if factor == 1 or steps < factor:
        return run
    return run.slice(float(run.time[steps % factor]), float("inf")).coarsen(factor)


def _response(dynamics: Dynamics, bound: BoundRun) -> FloatArray:
    """Warming of each node by 1 W at each for as long as missing heat stays alike, added as squares [K/W]."""
    model, inputs = dynamics.model, bound.inputs.mean(axis=1)
    start = default_start(model, bound)
    motion = dynamics.step(start, np.zeros(len(model.nodes)), inputs, model.values, _HEAT_TIME)
    return np.asarray(np.linalg.norm(motion.by_heat[: len(model.nodes)], axis=1))
