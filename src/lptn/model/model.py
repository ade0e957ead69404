"""The model: one symbolic heat balance, and the CasADi functions made from it."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from functools import cached_property
from typing import Any, Literal, NamedTuple, TypeVar, cast

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.parameters import ParameterInstance
from lptn.basics.places import is_of_run
from lptn.model.heat_balance import HeatBalance
from lptn.model.network import Network

Made = TypeVar("Made")
Method = Literal["rk4", "euler", "zoh"]
# The symbolic matrix exponential, by scaling and squaring: up to h |λ| of some 2000 the scaled matrix stays below 1/2,
# where the first term of Taylor's series that is left out is below 1e-10.
_SQUARINGS = 12


def rk4(rate: Callable[[Any], Any], x: Any, h: Any) -> Any:
    """The state after one step of the classical Runge-Kutta scheme of fourth order.

    Args:
        rate: dx/dt at a state; called for the four stages in order, at the start, twice in the middle, at the end.
        x: the state, an expression of CasADi or an array.
        h: the step [s].
    """
    k1 = rate(x)
    k2 = rate(x + h / 2 * k1)
    k3 = rate(x + h / 2 * k2)
    k4 = rate(x + h * k3)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


class Symbols(NamedTuple):
    """States x, inputs u and parameters p; rates of the states [K/s] and readings of the sensors [degC]."""

    x: ca.SX
    u: ca.SX
    p: ca.SX
    rates: ca.SX
    readings: ca.SX


class Model:
    r"""A network as functions of states x, inputs u and parameters p.

    .. math:: C_i \dot T_i = \sum_j (T_j - T_i) / R_{ij} + \sum Q

    Temperatures are in degC, all else in SI. The states are the temperatures of the dynamic nodes, then
    the hottest points of elements that have one as a place, then the states of effects that have one.

    Args:
        network: what to make the model of.
        standard_errors: of its parameters by name, where a fit told them.

    Source: [QuadrupedLPTN, eq. 4, 5], with the sign that lets heat flow from hot to cold.

    Example:
        >>> import lptn
        >>> model = lptn.load_model("examples/tclab/two_heaters.toml").model
        >>> model.states, model.inputs
        (['heater1', 'heater2'], ['temperature.ambient', 'power.heater1', 'power.heater2'])
        >>> model.rhs  # dx/dt
        Function(rhs:(x[2],u[3],p[4])->(xdot[2]) SXFunction)
    """

    def __init__(self, network: Network, standard_errors: Mapping[str, float] | None = None) -> None:
        self.network = network
        self.standard_errors = dict(standard_errors or {})
        """Of parameters by name, each in its unit, where a fit told them."""
        self.nodes: list[str] = network.dynamic
        """Dynamic nodes, which are also the outputs, in order."""
        self.parameters: list[ParameterInstance] = network.parameters
        self.balance = HeatBalance(network)
        """The expressions behind the functions."""
        self.inputs: list[str] = list(self.balance.columns)
        """Log columns that drive the model, in order."""
        self.started: list[str] = self.balance.started
        """Those inputs that are taken from the start of a run instead of a column."""
        self.places: list[str] = [*self.nodes, *(point.name for point in network.hottest)]
        """Places that a limit may be set for, the first of the states: nodes, then hottest points of elements."""
        self.states: list[str] = [*self.places, *(instance.label for instance in self.balance.hidden)]
        inside = ((point.element,) for point in network.hottest)
        hidden = (instance.effect.rests_with(instance.ends) for instance in self.balance.hidden)
        self.rests: list[tuple[str, ...]] = [*((name,) for name in self.nodes), *inside, *hidden]
        """For each state the places whose mean temperature it has in equilibrium."""
        behind = len(self.places)
        of_log = (0.0 if "#" in instance.declaration.run else instance.effect.rises for instance in self.balance.hidden)
        self.rises = np.array([0.0] * behind + [*of_log])
        """K/s; how fast each state rises that keeps the time since a log began, and no piece of it; shape (states,)."""
        self.owners: list[int] = [self._owner(places) for places in self.rests]
        """For each state the index of the node it belongs to."""
        self.made: dict[Hashable, Any] = {}
        """What `made_once` keeps, shared with copies at other values."""
        self._x, self._u, self._p = self.balance.x, self.balance.u, self.balance.p
        self._rhs, self._y = self.balance.rates, self.balance.readings

    def __reduce__(self) -> tuple[type[Model], tuple[Network, dict[str, float]]]:
        # CasADi's expressions don't travel between processes; the network does, and makes the same model.
        return Model, (self.network, self.standard_errors)

    @property
    def values(self) -> FloatArray:
        """Parameter values as the network declares them, shape (m,)."""
        return np.array([parameter.value for parameter in self.parameters], dtype=float)

    @property
    def named(self) -> dict[str, ParameterInstance]:
        """Its parameters by name."""
        return {parameter.name: parameter for parameter in self.parameters}

    def with_values(self, values: FloatArray) -> Model:
        """The same model at other parameter values, shape (m,); its functions are shared, not made again."""
        other = object.__new__(Model)
        other.__dict__.update(self.__dict__)
        names = (parameter.name for parameter in self.parameters)
        other.network = self.network.with_values(dict(zip(names, values.tolist(), strict=True)))
        other.parameters = other.network.parameters
        return other

    def made_once(self, key: Hashable, make: Callable[[], Made]) -> Made:
        """What `make` returns, kept under `key` for this model and all its copies at other values."""
        if key not in self.made:
            self.made[key] = make()
        return cast(Made, self.made[key])

    def __repr__(self) -> str:
        sizes = {"state": len(self.states), "input": len(self.inputs), "free parameter": len(self.free)}
        counts = ", ".join(f"{count} {what}{'s' * (count != 1)}" for what, count in sizes.items())
        return f"<Model {self.network.name}: {counts}>"

    @property
    def free(self) -> list[int]:
        """Indices of the parameters that a fit may change."""
        return [index for index, parameter in enumerate(self.parameters) if parameter.free]

    def _owner(self, places: tuple[str, ...]) -> int:
        """A node to name a state after: of a prescribed place the first that exchanges heat with it."""
        around = (node for node, other in self.network.surroundings.values() if other in places)
        return next((self.nodes.index(name) for name in (*places, *around) if name in self.nodes), 0)

    def in_run(self, name: str, values: FloatArray) -> FloatArray:
        """Parameter values, shape (m,), with the indicators of a run's own effects set as the run's name says."""
        if not self.network.runs:
            return values
        values = values.copy()
        for pattern, index in self.network.runs.items():
            values[index] = float(is_of_run(name, pattern))
        return values

    def acting_in(self, name: str) -> set[int]:
        """Indices of the parameters that act in a run: all but those of other runs' own effects."""
        elsewhere = (
            instance
            for instance in self.network.effect_instances
            if instance.declaration.run and not is_of_run(name, instance.declaration.run)
        )
        return set(range(len(self.parameters))).difference(*(instance.parameters.values() for instance in elsewhere))

    @property
    def resting_shares(self) -> FloatArray:
        """Each hidden state's equilibrium as shares of the nodes' temperatures, shape (hidden, nodes)."""
        shares = np.zeros((len(self.states) - len(self.nodes), len(self.nodes)))
        for row, places in enumerate(self.rests[len(self.nodes) :]):
            for place in places:
                if place in self.nodes:
                    shares[row, self.nodes.index(place)] += 1 / len(places)
        return shares

    @property
    def symbols(self) -> Symbols:
        """The expressions behind the functions, for whoever differentiates them further."""
        return Symbols(self._x, self._u, self._p, self._rhs, self._y)

    # --- functions ----------------------------------------------------------------------------

    @property
    def rhs(self) -> ca.Function:
        """(x, u, p) -> dx/dt [K/s]."""
        return self._function("rhs", lambda: ca.densify(self._rhs), "xdot")

    @property
    def output(self) -> ca.Function:
        """(x, p) -> what the sensors of the dynamic nodes read [degC]."""
        make = lambda: ca.Function("output", [self._x, self._p], [ca.densify(self._y)], ["x", "p"], ["y"])  # noqa: E731
        return self.made_once("output", make)

    @property
    def surroundings(self) -> ca.Function:
        """(x, u, p) -> the prescribed temperatures as the nodes feel them [degC], errors put right."""
        felt = [self.balance.temperature[name] for name in self.network.prescribed]
        return self._function("surroundings", lambda: ca.densify(ca.vertcat(*felt)), "felt")

    @cached_property
    def reads_directly(self) -> bool:
        """Whether every sensor reads its node's temperature as it is."""
        return not any(instance.effect.changes_reading for instance in self.network.effect_instances)

    @cached_property
    def in_time(self) -> bool:
        """Whether all readings belong to the instants that the log says."""
        return not any(instance.effect.delays_readings for instance in self.network.effect_instances)

    def delays(self, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """How late each node's readings come [s], shape (nodes,), and its derivative by p, shape (nodes, m)."""
        late = self.balance.delays
        make = lambda: ca.Function("delays", [self._p], [late, ca.densify(ca.jacobian(late, self._p))])  # noqa: E731
        delays, slopes = self.made_once("delays", make)(p)
        return delays.full().ravel(), slopes.full()

    @property
    def state_jacobian(self) -> ca.Function:
        """(x, u, p) -> d(dx/dt)/dx [1/s], dense."""
        return self._function("state_jacobian", lambda: ca.densify(ca.jacobian(self._rhs, self._x)), "A")

    @property
    def parameter_jacobian(self) -> ca.Function:
        """(x, u, p) -> d(dx/dt)/dp, dense."""
        return self._function("parameter_jacobian", lambda: ca.densify(ca.jacobian(self._rhs, self._p)), "B")

    @property
    def is_linear(self) -> bool:
        """Whether the heat balance is linear in the temperatures, at any inputs and parameters."""
        return not ca.depends_on(ca.jacobian(self._rhs, self._x), self._x)

    def step(self, method: Method = "rk4") -> ca.Function:
        """(x, u, p, h) -> x after h seconds with the inputs held.

        Args:
            method: `"rk4"`; `"euler"`, the first source's `G = I + hA`; `"zoh"`, exact where the model
                is linear in its temperatures.

        Raises:
            ValueError: `"zoh"` for a model that is not linear.

        Source: [QuadrupedLPTN, eq. 11, 12].
        """
        return self.made_once(("step", method), lambda: self._make_step(method))

    def run(self, n: int, method: Method = "rk4") -> ca.Function:
        """(x0, U, p, h) -> the n states after each of n steps, shape (number of states, n).

        `U` has shape (number of inputs, n).
        """
        return self.made_once(("run", n, method), lambda: self._make_run(n, method))

    def _function(self, name: str, expression: Callable[[], ca.SX], result: str) -> ca.Function:
        arguments, names = [self._x, self._u, self._p], ["x", "u", "p"]
        return self.made_once(name, lambda: ca.Function(name, arguments, [expression()], names, [result]))

    def _make_step(self, method: Method) -> ca.Function:
        h = ca.SX.sym("h")
        if method == "rk4":
            following = rk4(lambda x: self.rhs(x, self._u, self._p), self._x, h)
        else:
            following = self._x + h * self._rhs if method == "euler" else self._zero_order_hold(h)
        return ca.Function("step", [self._x, self._u, self._p, h], [following], ["x", "u", "p", "h"], ["x_next"])

    def _make_run(self, n: int, method: Method) -> ca.Function:
        x, u = ca.MX.sym("x", len(self.states)), ca.MX.sym("u", len(self.inputs), n)
        p, h = ca.MX.sym("p", len(self.parameters)), ca.MX.sym("h")
        path = self.step(method).mapaccum(n)(x, u, ca.repmat(p, 1, n), ca.repmat(h, 1, n))
        return ca.Function("run", [x, u, p, h], [path], ["x0", "U", "p", "h"], ["X"])

    def _zero_order_hold(self, h: ca.SX) -> ca.SX:
        """x + h φ₁(hA) f(x): exact for f affine in x, by scaling and squaring of a Taylor series."""
        if not self.is_linear:
            raise ValueError(f"model {self.network.name}: not linear in its temperatures, so no exact step; use rk4")
        a = ca.densify(ca.jacobian(self._rhs, self._x)) * h / 2**_SQUARINGS
        n = len(self.states)
        identity = ca.SX.eye(n)
        phi = identity
        taylor_order = 10
        for order in range(taylor_order, 1, -1):
            phi = identity + ca.mtimes(a, phi) / order
        for _ in range(_SQUARINGS):
            phi = ca.mtimes(phi, 2 * identity + ca.mtimes(a, phi)) / 2
            a = 2 * a
        return self._x + h * ca.mtimes(phi, self._rhs)
