"""A model with its own errors among the states: heat that it lacks, air, inputs that are off, doubtful parameters.

The filter estimates these along with the temperatures. Their steps come with the exact derivative and with the
covariance that the errors add.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, pairwise
from math import ceil
from typing import NamedTuple

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.parameters import LARGEST, Transform
from lptn.model.model import Model, rk4
from lptn.simulate.dynamics import RATE_OF_A_STEP, runge_kutta_derivative, zero_order_hold

# --- How wrong a model may be ---------------------------------------------------------------------

Sizes = float | Mapping[str, float]

BIAS_TIME = 3600.0
"""s; time constant of the lasting part of missing heat: as long as a run."""


@dataclass(frozen=True)
class ModelError:
    """What an estimator allows for besides the sensors' noise: standard deviations, for all nodes or by node.

    Args:
        heat: heat that the model lacks at a node, wandering [W].
        heat_time: time constant with which that heat wanders [s].
        change: more of it right after a node's heat flow changes, as a share of the change: a winding
            that is warm before its housing, where the model has one mass.
        bias: heat that the model lacks at a node for an hour and more [W]: a mass that it doesn't know.
        air: relative error of all conductances to prescribed temperatures, the same over a run: a draught.
        inputs: for log columns the error that stays the same over a run, in the column's unit:
            `{"temperature.ambient": 1.0}`.

    Raises:
        ValueError: a size that is negative or not finite, or a time constant that is not above 0.
    """

    heat: Sizes = 0.5
    heat_time: float = 300.0
    change: Sizes = 0.0
    bias: Sizes = 0.0
    air: float = 0.0
    inputs: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("heat", "change", "bias", "air", "inputs"):
            refuse_negative(getattr(self, name), name)
        if not (math.isfinite(self.heat_time) and self.heat_time > 0):
            raise ValueError(f"heat_time: found {self.heat_time:g}; expected a time above 0 s")


def refuse_negative(sizes: Sizes, what: str) -> None:
    """Refuse a size that is negative, not finite, or whose square is no number that a filter can work with.

    Raises:
        ValueError: it is such a one.
    """
    for name, size in sizes.items() if isinstance(sizes, Mapping) else [("", sizes)]:
        if not 0 <= size <= LARGEST:
            raise ValueError(f"{what}{' of ' * bool(name)}{name}: found {size:g}; expected a finite size, 0 or above")


def by_node(sizes: Sizes, nodes: Sequence[str]) -> FloatArray:
    """One size a node, shape (nodes,); 0 for a node that a mapping leaves out."""
    if isinstance(sizes, Mapping):
        return np.array([sizes.get(node, 0.0) for node in nodes], dtype=float)
    return np.full(len(nodes), float(sizes))


# --- The augmented state and its rates ------------------------------------------------------------


class StateLayout(NamedTuple):
    """The position of each kind of state in the augmented state vector z.

    The model's own states [degC]; wandering and lasting heat that the model lacks at each node [W]; the logarithm of a
    factor on all conductances to prescribed temperatures; errors of inputs; coordinates of doubtful parameters.
    """

    states: slice
    heat: slice
    bias: slice
    air: slice
    inputs: slice
    parameters: slice

    @classmethod
    def of(cls, model: Model, error: ModelError, parameters: int) -> StateLayout:
        """The layout for a model and the errors allowed; an error of size 0 takes no place, but for inputs."""
        nodes = len(model.nodes)
        heat = bool(by_node(error.heat, model.nodes).any() or by_node(error.change, model.nodes).any())
        bias = bool(by_node(error.bias, model.nodes).any())
        lengths = (len(model.states), nodes * heat, nodes * bias, int(error.air > 0), len(error.inputs), parameters)
        return cls(*(slice(start, stop) for start, stop in pairwise(accumulate(lengths, initial=0))))

    @property
    def size(self) -> int:
        """Number of states in all."""
        return int(self.parameters.stop)


def _functions(
    model: Model, layout: StateLayout, columns: tuple[str, ...], doubtful: tuple[int, ...]
) -> tuple[ca.Function, ca.Function, ca.Function]:
    """RK4 stages with their Jacobians; rates with theirs; readings with theirs. Matrices are dense.

    Args:
        columns: inputs that may be off.
        doubtful: indices of the parameters that are states.
    """
    x, u, p, rates, readings = model.symbols
    z, times, h = ca.SX.sym("z", layout.size), ca.SX.sym("times", 2), ca.SX.sym("h")
    values, shifted, transform = ca.SX(p), ca.SX(u), Transform([model.parameters[index] for index in doubtful])
    for place, index in enumerate(doubtful):
        values[index] = transform.expression(place, z[layout.parameters.start + place])
    if layout.air.stop > layout.air.start:
        prescribed = model.network.prescribed
        to_air = {link.resistance for link in model.network.resistors if not prescribed.keys().isdisjoint(link.ends)}
        for index in sorted(to_air):
            values[index] *= ca.exp(-z[layout.air.start])
    for place, column in enumerate(columns):
        shifted[model.inputs.index(column)] += z[layout.inputs.start + place]
    balance = ca.Function("balance", [x, u, p], [rates, readings])
    warming, read = balance(z[layout.states], shifted, values)
    slope = ca.SX.zeros(layout.size)
    for errors, time in ((layout.heat, times[0]), (layout.bias, times[1])):
        heats = z[errors]
        slope[errors] = -heats / time
        for row in range(heats.numel()):
            warming[row] += heats[row] / values[model.network.capacities[model.nodes[row]]]
    slope[layout.states] = warming
    by_state = ca.jacobian(slope[: layout.bias.stop], z)  # all others stay as they are
    rate = ca.Function("rate", [z, u, p, times], [ca.densify(slope), ca.densify(by_state)])
    jacobians = []

    def stage(at: ca.SX) -> ca.SX:
        slope, jacobian = rate(at, u, p, times)
        jacobians.append(jacobian)
        return slope

    following = rk4(stage, z, h)
    stages = ca.Function("stages", [z, u, p, times, h], [following, *jacobians])
    # What the sensors read depends neither on the air nor on inputs.
    reading = ca.Function("reading", [z, p], [ca.densify(read), ca.densify(ca.jacobian(read, z))])
    return stages, rate, reading


class _BufferedCall:
    """A CasADi function that reads and writes fixed arrays: a tenth of an ordinary call's time."""

    def __init__(self, function: ca.Function, arguments: list[FloatArray], results: list[FloatArray]) -> None:
        self._buffer, self._run = function.buffer()
        self._kept = arguments, results  # the buffer itself holds no reference
        for place, argument in enumerate(arguments):
            self._buffer.set_arg(place, memoryview(argument))  # type: ignore[call-arg, arg-type]
        for place, result in enumerate(results):
            self._buffer.set_res(place, memoryview(result))  # type: ignore[call-arg, arg-type]

    def __call__(self) -> None:
        """Read the arguments as they are now; write the results."""
        self._run()


# --- Its steps ------------------------------------------------------------------------------------

_LEAST_WALK = 1e-6  # K²/s, of each node's temperature: a filter that is sure of a node ceases to listen to its sensor


class StateStep(NamedTuple):
    """States after a step, shape (z,); its derivative by those before it, (z, z); covariance added, (z, z).

    States from number `moving` on stay as they are, as the derivative's rows say.
    """

    states: FloatArray
    transition: FloatArray
    added: FloatArray
    moving: int

    def covariance(self, before: FloatArray) -> FloatArray:
        """Covariance of the states after the step by that before it, shape (z, z) each."""
        return _carried(self.transition[: self.moving], before) + self.added


def _carried(rows: FloatArray, covariance: FloatArray) -> FloatArray:
    """T P T' for a transition T that has these rows first, and the identity's behind them."""
    moving, carried, mixed = len(rows), covariance.copy(), rows @ covariance
    carried[:moving], carried[moving:, :moving] = mixed, mixed[:, moving:].T
    carried[:moving, :moving] = mixed @ rows.T
    return carried


class AugmentedModel:
    """Steps and readings of the augmented state, with derivatives.

    Args:
        model: the model; its values serve where no parameter is doubtful.
        error: what may be wrong with it.
        doubtful: indices of the parameters that are states.
        walks: variance that each doubtful parameter's coordinate gains [1/s], shape (doubtful,).
    """

    def __init__(self, model: Model, error: ModelError, doubtful: Sequence[int], walks: FloatArray) -> None:
        self.model = model
        self.layout = layout = StateLayout.of(model, error, len(doubtful))
        columns, places = tuple(error.inputs), tuple(doubtful)
        key = ("augmented", tuple(where.stop for where in layout), columns, places)
        stages, rate, reading = model.made_once(key, lambda: _functions(model, layout, columns, places))
        n, nodes, values = layout.size, len(model.nodes), model.values
        self.errors = np.zeros(n)
        """Variance of each allowed error before anything was read, shape (z,); 0 for states and parameters."""
        for where, sizes in ((layout.heat, error.heat), (layout.bias, error.bias)):
            if where.stop > where.start:
                self.errors[where] = by_node(sizes, model.nodes) ** 2
        self.errors[layout.air] = error.air**2
        self.errors[layout.inputs] = np.square(list(error.inputs.values()))
        times = np.array([error.heat_time, BIAS_TIME])
        self._fastest = 1 / float(times.min())
        self._times, self._walks = np.ones(n), np.zeros(n)
        self._times[layout.heat], self._times[layout.bias] = times
        self._walks[:nodes], self._walks[layout.parameters] = _LEAST_WALK, walks
        self._fading = self.errors.copy()
        self._fading[layout.bias.stop :] = 0.0  # the others last as long as the run
        self._z, self._u, self._h = np.zeros(n), np.zeros(len(model.inputs)), np.zeros(1)
        self._next, self._jacobians = np.zeros(n), np.zeros((4, n, layout.bias.stop))
        self._slope, self._jacobian = np.zeros(n), np.zeros((n, layout.bias.stop))
        self._read, self._read_by = np.zeros(nodes), np.zeros((n, nodes))
        # CasADi writes columns first, so each matrix arrives transposed.
        self._stages = _BufferedCall(stages, [self._z, self._u, values, times, self._h], [self._next, *self._jacobians])
        self._rate = _BufferedCall(rate, [self._z, self._u, values, times], [self._slope, self._jacobian])
        self._reading = _BufferedCall(reading, [self._z, values], [self._read, self._read_by])

    def step(self, z: FloatArray, u: FloatArray, h: float) -> StateStep:
        """Advance by `h` seconds at constant inputs, in as many RK4 steps as the fastest rate needs."""
        self._z[:], self._u[:], self._h[0] = z, u, h
        self._stages()
        states = self.layout.states
        # The largest row sum of the rates' derivative at the start bounds every eigenvalue from above.
        fastest = max(float(np.abs(self._jacobians[0][states, states]).sum(axis=0).max()), self._fastest)
        substeps = max(1, ceil(h * fastest / RATE_OF_A_STEP))
        h /= substeps
        gained, moving = np.diag(0.5 * self._gained(h)), self.layout.bias.stop
        transition, added = np.eye(self.layout.size), np.zeros_like(gained)
        for _ in range(substeps):
            if substeps > 1:
                self._z[:], self._h[0] = z, h
                self._stages()
            rows = runge_kutta_derivative([stage.T for stage in self._jacobians], h)
            z, added = self._next.copy(), _carried(rows, added + gained) + gained
            transition[:moving] = rows @ transition
        return StateStep(z, transition, added, moving)

    def long_step(self, z: FloatArray, u: FloatArray, h: float) -> StateStep:
        """Advance by a step longer than the fastest time constant, by the exact hold of the linearisation at its start.

        Errors are held over the step, and fade behind it. Of a nonlinear model the states are right to second order.
        """
        states, (rates, by_state) = self.layout.states, self.rates(z, u)
        transition, integral = zero_order_hold(by_state[states, states], h)
        fading = np.where(self._fading > 0, np.exp(-h / self._times), 1.0)
        whole, following = np.diag(fading), fading * z
        whole[states] = integral @ by_state[states]
        whole[states, states] = transition
        following[states] = z[states] + integral @ rates[states]
        gained, moving = np.diag(0.5 * self._gained(h)), self.layout.bias.stop
        return StateStep(following, whole, _carried(whole[:moving], gained) + gained, moving)

    def readings(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What the sensors read [degC], shape (nodes,), and its derivative, shape (nodes, z)."""
        self._z[:] = z
        self._reading()
        return self._read.copy(), self._read_by.T.copy()

    def rates(self, z: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rates of the state, shape (z,), and the derivative of those that are not zero by the state, (moving, z)."""
        self._z[:], self._u[:] = z, u
        self._rate()
        return self._slope.copy(), self._jacobian.T.copy()

    def _gained(self, h: float) -> FloatArray:
        """Variance that each state gains in `h` seconds, such that fading errors keep their size in the long run."""
        gained: FloatArray = 2 * self._fading * np.tanh(h / self._times) + self._walks * h
        return gained
