"""The network in state-space form about an operating point, its exact steps, and the steps at which Euler fails."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.model.model import Model
from lptn.simulate.dynamics import zero_order_hold


@dataclass(frozen=True)
class StateSpace:
    r"""The heat balance at one operating point.

    .. math:: \dot x = A x + B u, \qquad y = C x

    The inputs u are the heat of each node [W], then the prescribed temperatures [degC]. Where the model is linear in
    its temperatures the form holds everywhere; else A and B hold about the point, since resistances change with
    temperature and with the robot's speed.

    Args:
        A: 1/s, shape (states, states).
        B: K/J for heat, 1/s for temperatures, shape (states, inputs).
        C: shape (nodes, states).
        u: the inputs at the operating point, with which A x + B u is the model's own rate, shape (inputs,).
        states: names of the states.
        inputs: names of the inputs.

    Source: [QuadrupedLPTN, eq. 9 to 12]; equation 9 leaves out that A and B depend on temperature and speed, and
    that the ambient temperature is an input.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    u: FloatArray
    states: tuple[str, ...]
    inputs: tuple[str, ...]

    @property
    def eigenvalues(self) -> FloatArray:
        """Of A [1/s], fastest first, shape (states,); those of a passive network are real."""
        return np.sort(np.linalg.eigvals(self.A).real)

    @property
    def time_constants(self) -> FloatArray:
        """Of the modes [s], fastest first, infinite for a mode that keeps its heat."""
        with np.errstate(divide="ignore"):
            return np.asarray(-1.0 / np.minimum(self.eigenvalues, -0.0))

    @property
    def euler_stable(self) -> float:
        """The longest Euler step that does not blow up [s], 2/|λ|max."""
        return 2.0 * float(self.time_constants[0])

    def exact(self, step: float) -> tuple[FloatArray, FloatArray]:
        """G and H of x(k+1) = G x(k) + H u(k), inputs held over the step [s]: the exact zero-order hold.

        Source: [QuadrupedLPTN, eq. 11], by the exponential of a larger matrix ([VanLoan1978]).
        """
        transition, integral = zero_order_hold(self.A, step)
        return transition, integral @ self.B

    def euler(self, step: float) -> tuple[FloatArray, FloatArray]:
        """G = I + hA and H = hB, as the source approximates them.

        Raises:
            InputError: the step is so long that the temperatures would blow up.

        Source: [QuadrupedLPTN, eq. 12].
        """
        if step > self.euler_stable:
            raise InputError("Euler", f"step {step:g} s", "a step that blows up", f"at most {self.euler_stable:.3g} s")
        return np.eye(len(self.A)) + step * self.A, step * self.B

    def euler_error(self, step: float, duration: float, rise: FloatArray | None = None) -> float:
        """The largest difference between Euler and the exact hold [K] after a step of the inputs.

        Args:
            step: of both [s].
            duration: time looked at [s]; at most 20,000 steps, after which a mode's error is below 1e-4 of its rise.
            rise: the inputs' step, shape (inputs,); by default the operating point's own heat, switched on.

        Raises:
            InputError: the step is so long that the temperatures would blow up.
        """
        heats = np.array([name.startswith("heat.") for name in self.inputs])
        rise = np.where(heats, self.u, 0.0) if rise is None else rise
        (g, h), (g_euler, h_euler) = self.exact(step), self.euler(step)
        exact, euler, largest = np.zeros(len(self.A)), np.zeros(len(self.A)), 0.0
        # of a comparison, half a second; a model with time constants of microseconds would take days
        most_steps = 20_000
        for _ in range(min(max(1, round(duration / step)), most_steps)):
            exact, euler = g @ exact + h @ rise, g_euler @ euler + h_euler @ rise
            largest = max(largest, float(np.abs(euler - exact).max()))
        return largest

    def euler_step(self, error: float, duration: float = 600.0) -> float:
        """The longest Euler step [s] whose error stays below `error` [K], to 1 %.

        Args:
            error: admissible difference from the exact hold [K], above 0.
            duration: time looked at [s].
        """
        low, high = 0.0, min(self.euler_stable, duration)
        if self.euler_error(high, duration) <= error:
            return high
        while high - low > 0.01 * high:
            middle = 0.5 * (low + high)
            if self.euler_error(middle, duration) <= error:
                low = middle
            else:
                high = middle
        return low


def state_space(model: Model, temperatures: FloatArray, inputs: FloatArray) -> StateSpace:
    """The model's state-space form about an operating point.

    Args:
        model: the model, at its own values.
        temperatures: the states [degC], shape (states,).
        inputs: the model's inputs, shape (inputs,), in the order of `model.inputs`.
    """
    function = model.made_once("state space", lambda: _linearised(model))
    results = (result.full() for result in function(temperatures, inputs, model.values))
    rates, a, by_prescribed, prescribed, c = results
    capacities = model.values[[model.network.capacities[node] for node in model.nodes]]
    by_heat = np.zeros((len(model.states), len(model.nodes)))
    by_heat[: len(model.nodes)] = np.diag(1.0 / capacities)
    # What the linear part leaves of the rates is the nodes' own heat.
    heat = (rates.ravel() - a @ temperatures - by_prescribed @ prescribed.ravel())[: len(model.nodes)] * capacities
    names = [f"heat.{node}" for node in model.nodes] + [f"temperature.{name}" for name in model.network.prescribed]
    point = np.concatenate([heat, prescribed.ravel()])
    return StateSpace(a, np.hstack([by_heat, by_prescribed]), c, point, tuple(model.states), tuple(names))


def _linearised(model: Model) -> ca.Function:
    """(x, u, p) -> rates, their derivatives by states and by prescribed temperatures, those temperatures, C."""
    x, u, p, rates, readings = model.symbols
    prescribed = []
    for name, source in model.network.prescribed.items():
        if isinstance(source, int):
            prescribed.append(p[source])
        else:
            column = f"temperature.{name}" if f"temperature.{name}" in model.started else source
            prescribed.append(u[model.inputs.index(column)])
    by_prescribed = [ca.densify(ca.jacobian(rates, symbol)) for symbol in prescribed]
    results = [
        rates,
        ca.densify(ca.jacobian(rates, x)),
        ca.horzcat(ca.SX(len(model.states), 0), *by_prescribed),
        ca.vertcat(ca.SX(0, 1), *prescribed),
        ca.densify(ca.jacobian(readings, x)),
    ]
    return ca.Function("state_space", [x, u, p], results)
