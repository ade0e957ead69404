"""The expressions behind an estimator: the model's rates with errors and doubted parameters among the states."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from lptn.arrays import FloatArray
from lptn.model import Model
from lptn.online.model_error import ModelError, by_node


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
        unknown = model.unknowns[index]
        coordinate = z[layout.parameters.start + place]
        scale = abs(unknown.declared.typical) or 1.0
        values[index] = ca.exp(coordinate) if unknown.logarithmic else coordinate * scale
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
