"""A model's step with everything that an estimator doubts made a state, and the step's exact derivative."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import ceil

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.model.model import Model

# --- How wrong a model may be: heat that it lacks, air that cools otherwise, inputs that are off ---


Sizes = float | Mapping[str, float]


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
            sizes = getattr(self, name)
            for size in sizes.values() if isinstance(sizes, Mapping) else (sizes,):
                if not (math.isfinite(size) and size >= 0):
                    raise ValueError(f"{name}: found {size:g}; expected a finite size, 0 or above")
        if not (math.isfinite(self.heat_time) and self.heat_time > 0):
            raise ValueError(f"heat_time: found {self.heat_time:g}; expected a time above 0 s")


def by_node(sizes: Sizes, nodes: Sequence[str]) -> FloatArray:
    """One size a node, shape (nodes,); 0 for a node that a mapping leaves out."""
    if isinstance(sizes, Mapping):
        return np.array([sizes.get(node, 0.0) for node in nodes], dtype=float)
    return np.full(len(nodes), float(sizes))


# --- The expressions behind an estimator: the model's rates with errors and doubted parameters among the states ---


@dataclass(frozen=True)
class Layout:
    """Where each kind of state stands in the estimator's state vector z.

    In order: the model's own states, wandering heats [W], lasting heats [W], logarithm of the air's factor,
    errors of inputs, coordinates of doubted parameters.
    """

    lengths: tuple[int, int, int, int, int, int]

    @classmethod
    def of(cls, model: Model, error: ModelError, parameters: int) -> Layout:
        """The layout that a model and its allowed errors need; what is allowed nothing takes no place."""
        nodes = len(model.nodes)
        heat = nodes * bool(by_node(error.heat, model.nodes).any() or by_node(error.change, model.nodes).any())
        bias = nodes * bool(by_node(error.bias, model.nodes).any())
        return cls((len(model.states), heat, bias, int(error.air > 0), len(error.inputs), parameters))

    @property
    def size(self) -> int:
        """Number of states in all."""
        return sum(self.lengths)

    @property
    def states(self) -> slice:
        """The model's own states."""
        return self._at(0)

    @property
    def heat(self) -> slice:
        """Wandering heats."""
        return self._at(1)

    @property
    def bias(self) -> slice:
        """Lasting heats."""
        return self._at(2)

    @property
    def air(self) -> slice:
        """The air's factor."""
        return self._at(3)

    @property
    def inputs(self) -> slice:
        """Errors of inputs."""
        return self._at(4)

    @property
    def parameters(self) -> slice:
        """Coordinates of doubted parameters."""
        return self._at(5)

    def _at(self, place: int) -> slice:
        start = sum(self.lengths[:place])
        return slice(start, start + self.lengths[place])


class Call:
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


def functions(
    model: Model, layout: Layout, columns: tuple[str, ...], doubted: tuple[int, ...]
) -> tuple[ca.Function, ca.Function, ca.Function]:
    """RK4 stages with their Jacobians; rates with theirs; readings with theirs. Matrices are dense.

    Args:
        columns: inputs that may be off.
        doubted: indices of the parameters that are states.
    """
    x, u, p, rates, readings = model.symbols
    z, times, h = ca.SX.sym("z", layout.size), ca.SX.sym("times", 2), ca.SX.sym("h")
    values, shifted = _values(model, layout, doubted, p, z), ca.SX(u)
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
    jacobian = ca.densify(ca.jacobian(slope, z))
    rate = ca.Function("rate", [z, u, p, times], [ca.densify(slope), jacobian])
    # What the sensors read knows no air and no inputs.
    reading = ca.Function("reading", [z, p], [ca.densify(read), ca.densify(ca.jacobian(read, z))])
    return _stages(rate, z, u, p, times, h), rate, reading


def _values(model: Model, layout: Layout, doubted: tuple[int, ...], p: ca.SX, z: ca.SX) -> ca.SX:
    """Parameter values with doubted ones and the air's factor taken from the state."""
    values = ca.SX(p)
    for place, index in enumerate(doubted):
        parameter = model.parameters[index]
        coordinate = z[layout.parameters.start + place]
        scale = abs(parameter.declared.typical) or 1.0
        values[index] = ca.exp(coordinate) if parameter.logarithmic else coordinate * scale
    if layout.lengths[3]:
        prescribed = model.network.prescribed
        to_air = {link.resistance for link in model.network.resistors if not prescribed.keys().isdisjoint(link.ends)}
        for index in sorted(to_air):
            values[index] *= ca.exp(-z[layout.air.start])
    return values


def _stages(rate: ca.Function, z: ca.SX, u: ca.SX, p: ca.SX, times: ca.SX, h: ca.SX) -> ca.Function:
    k1, j1 = rate(z, u, p, times)
    k2, j2 = rate(z + h / 2 * k1, u, p, times)
    k3, j3 = rate(z + h / 2 * k2, u, p, times)
    k4, j4 = rate(z + h * k3, u, p, times)
    following = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return ca.Function("stages", [z, u, p, times, h], [following, j1, j2, j3, j4])


def variances(model: Model, layout: Layout, error: ModelError) -> FloatArray:
    """Variance of each allowed error before anything was read, shape (z,); 0 for states and parameters."""
    found = np.zeros(layout.size)
    for where, sizes in ((layout.heat, error.heat), (layout.bias, error.bias)):
        if where.stop > where.start:
            found[where] = by_node(sizes, model.nodes) ** 2
    found[layout.air] = error.air**2
    found[layout.inputs] = np.square(list(error.inputs.values()))
    return found


BIAS_TIME = 3600.0
"""s; time constant of heat that is missing all along."""
_MAX_RATE = 1.0  # product of an internal step and a bound of the fastest rate; RK4 is exact to 1 % there
_LEAST_WALK = 1e-6  # K²/s; a node without any would cease to listen


@dataclass(frozen=True)
class Step:
    """States after a step, shape (z,); its derivative by those before it, (z, z); covariance gained, (z, z)."""

    states: FloatArray
    transition: FloatArray
    gained: FloatArray


class Dynamics:
    """Steps and readings of the enlarged state, with derivatives.

    Args:
        model: the model; its values serve where no parameter is doubted.
        error: what may be wrong with it.
        doubted: indices of the parameters that are states.
        walks: variance that each doubted parameter's coordinate gains [1/s], shape (doubted,).
    """

    def __init__(self, model: Model, error: ModelError, doubted: Sequence[int], walks: FloatArray) -> None:
        self.model = model
        self.layout = layout = Layout.of(model, error, len(doubted))
        columns = tuple(error.inputs)
        key = ("online", layout.lengths, columns, tuple(doubted))
        stages, rate, reading = model.made_once(key, lambda: functions(model, layout, columns, tuple(doubted)))
        n, nodes, values = layout.size, len(model.nodes), model.values
        self._z, self._u, self._h = np.zeros(n), np.zeros(len(model.inputs)), np.zeros(1)
        times = np.array([error.heat_time, BIAS_TIME])
        self._fastest = 1 / float(times.min())
        self.errors = variances(model, layout, error)
        self._times, self._walks = np.ones(n), np.zeros(n)
        self._times[layout.heat], self._times[layout.bias] = times
        self._walks[:nodes], self._walks[layout.parameters] = _LEAST_WALK, walks
        self._fading = self.errors.copy()
        self._fading[layout.bias.stop :] = 0.0  # the others last as long as the run
        self._next, self._jacobians = np.zeros(n), np.zeros((4, n, n))
        self._slope, self._jacobian = np.zeros(n), np.zeros((n, n))
        self._read, self._read_by = np.zeros(nodes), np.zeros((n, nodes))
        # CasADi writes columns first, so each matrix arrives transposed.
        self._stages = Call(stages, [self._z, self._u, values, times, self._h], [self._next, *self._jacobians])
        self._rate = Call(rate, [self._z, self._u, values, times], [self._slope, self._jacobian])
        self._reading = Call(reading, [self._z, values], [self._read, self._read_by])
        self._identity = np.eye(n)
        self._capacities = values[[model.network.capacities[node] for node in model.nodes]]

    def step(self, z: FloatArray, u: FloatArray, h: float) -> Step:
        """Advance by `h` seconds with the inputs held, in as many RK4 steps as the fastest rate asks for."""
        parts = self._parts(z, u, h)
        half = 0.5 * self._gained(h / parts)
        states, transition = self._one(z, u, h / parts)
        gained = self._spread(transition, half)
        for _ in range(parts - 1):
            states, by_last = self._one(states, u, h / parts)
            transition = by_last @ transition
            gained = by_last @ gained @ by_last.T + self._spread(by_last, half)
        return Step(states, transition, gained)

    def _spread(self, transition: FloatArray, half: FloatArray) -> FloatArray:
        """Covariance gained in a step, half of the variances before it and half behind it."""
        covariance = (transition * half) @ transition.T
        np.einsum("ii->i", covariance)[:] += half
        return covariance

    def readings(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What the sensors read [degC], shape (nodes,), and its derivative, shape (nodes, z)."""
        self._z[:] = z
        self._reading()
        return self._read.copy(), self._read_by.T.copy()

    def heat_flow(self, z: FloatArray, u: FloatArray) -> FloatArray:
        """Heat that flows into each node, less what leaves it [W], shape (nodes,)."""
        self._z[:], self._u[:] = z, u
        self._rate()
        return np.asarray(self._slope[: len(self._capacities)] * self._capacities)

    def _parts(self, z: FloatArray, u: FloatArray, h: float) -> int:
        self._z[:], self._u[:] = z, u
        self._rate()
        core = self._jacobian[self.layout.states, self.layout.states]
        # The largest row sum bounds every eigenvalue from above; the matrix is transposed.
        fastest = max(float(np.abs(core).sum(axis=0).max()), self._fastest)
        return max(1, ceil(h * fastest / _MAX_RATE))

    def _one(self, z: FloatArray, u: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """One RK4 step and its exact derivative, from the stages' Jacobians."""
        self._z[:], self._u[:], self._h[0] = z, u, h
        self._stages()
        first, second, third, fourth = (stage.T for stage in self._jacobians)
        second = second + h / 2 * (second @ first)
        third = third + h / 2 * (third @ second)
        fourth = fourth + h * (fourth @ third)
        return self._next.copy(), self._identity + h / 6 * (first + 2 * (second + third) + fourth)

    def _gained(self, h: float) -> FloatArray:
        """Variance that each state gains in a step, so that fading errors keep their size in the long run."""
        gained: FloatArray = 2 * self._fading * np.tanh(h / self._times) + self._walks * h
        return gained
