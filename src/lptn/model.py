"""The assembled model: one symbolic heat balance and the CasADi functions made from it."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from types import SimpleNamespace
from typing import Any, Literal, NamedTuple, TypeVar, cast

import casadi as ca
import numpy as np

from lptn.arrays import FloatArray
from lptn.balanced_faces import without_faces
from lptn.effects import EdgeEffect, LinkEffect, LossEffect, MassEffect, NodeEffect, SensorEffect
from lptn.network import START, Network, Use
from lptn.parameters import Unknown

Made = TypeVar("Made")
Method = Literal["rk4", "euler", "zoh"]
_GLOBAL_INPUTS = {"base_speed": "speed.base"}
_SQUARINGS = 12  # scaling-and-squaring steps of the symbolic matrix exponential: exact up to h |λ| of some 2000
_TAYLOR_ORDER = 10


class Symbols(NamedTuple):
    """States, inputs, parameters; rates of the states and readings of the sensors."""

    x: ca.SX
    u: ca.SX
    p: ca.SX
    rates: ca.SX
    readings: ca.SX


def input_column(feature: str, place: str) -> str:
    """The log column that holds an input feature at a place: `torque.FR_calf`, `speed.base`."""
    return _GLOBAL_INPUTS.get(feature, f"{feature}.{place}")


class Model:
    r"""A network as functions of states x, inputs u and parameters p.

    .. math:: C_i \dot T_i = \sum_j (T_j - T_i) / R_{ij} + \sum Q

    Temperatures are in degC, all else in SI. The states are the temperatures of the dynamic nodes, then
    the states of effects that have one.

    Args:
        network: what to assemble.

    Source: source S0, rows E4 and E5, with the sign that lets heat flow from hot to cold.
    """

    def __init__(self, network: Network) -> None:
        self.network = network
        self.nodes: list[str] = network.dynamic
        """Dynamic nodes, which are also the outputs, in order."""
        self.unknowns: list[Unknown] = network.unknowns
        self.inputs: list[str] = []
        """Log columns that drive the model, in order."""
        self.started: list[str] = []
        """Those inputs that are taken from the start of a run instead of a column."""
        self.states: list[str] = list(self.nodes)
        self.owners: list[int] = list(range(len(self.nodes)))
        """For each state the index of the node it belongs to."""
        self.made: dict[Hashable, Any] = {}
        """What `made_once` keeps, shared with copies at other values."""
        self._assemble()

    def __reduce__(self) -> tuple[type[Model], tuple[Network]]:
        # CasADi's expressions don't travel between processes; the network does, and makes the same model.
        return Model, (self.network,)

    @property
    def values(self) -> FloatArray:
        """Parameter values as the network declares them, shape (m,)."""
        return np.array([unknown.value for unknown in self.unknowns], dtype=float)

    def with_values(self, values: FloatArray) -> Model:
        """The same model at other parameter values, shape (m,); its functions are shared, not made again."""
        other = object.__new__(Model)
        other.__dict__.update(self.__dict__)
        names = (unknown.name for unknown in self.unknowns)
        other.network = self.network.with_values(dict(zip(names, values.tolist(), strict=True)))
        other.unknowns = other.network.unknowns
        return other

    def made_once(self, key: Hashable, make: Callable[[], Made]) -> Made:
        """What `make` returns, kept under `key` for this model and all its copies at other values."""
        if key not in self.made:
            self.made[key] = make()
        return cast(Made, self.made[key])

    @property
    def free(self) -> list[int]:
        """Indices of the parameters that a fit may change."""
        return [index for index, unknown in enumerate(self.unknowns) if unknown.free]

    # --- assembly -----------------------------------------------------------------------------

    def _assemble(self) -> None:
        network = self.network
        self._p = ca.SX.sym("p", len(self.unknowns))
        self._column: dict[str, ca.SX] = {}
        symbols = {name: ca.SX.sym(name) for name in self.nodes}
        states = {id(use): ca.SX.sym(_label(use)) for use in network.uses if use.effect.has_state}
        temperature = symbols | {name: self._prescribed(name) for name in network.prescribed}
        faces = {name: ca.SX.sym(name) for name in network.massless}
        temperature |= faces
        heat = {name: ca.SX(0) for name in (*self.nodes, *faces)}
        for link, factor, extra in self._exchange(temperature):
            one, other = link.ends
            flow = factor * (temperature[other] - temperature[one]) / self._p[link.resistance] + extra
            _give(heat, one, flow)
            _give(heat, other, -flow)
        for inside in network.conductors:
            one, other = inside.ends
            flow = self._p[inside.conductivity] * inside.shape * (temperature[other] - temperature[one])
            _give(heat, one, flow)
            _give(heat, other, -flow)
        self._add_heat(heat, temperature, states)
        if faces:
            means = [symbols[element] for element in network.massless.values()]
            heat = without_faces(heat, faces, means)
        rates, readings = self._states_and_readings(temperature, states)
        warming = [heat[name] / self._p[network.capacities[name]] for name in self.nodes]
        self._x = ca.vertcat(*symbols.values(), *states.values())
        self._u = ca.vertcat(*self._column.values()) if self._column else ca.SX(0, 1)
        self._rhs = ca.vertcat(*warming, *rates)
        self._y = ca.vertcat(*readings)
        self.inputs = list(self._column)

    def _prescribed(self, name: str) -> ca.SX:
        source = self.network.prescribed[name]
        if isinstance(source, int):
            return self._p[source]
        if source == START:
            self.started.append(f"temperature.{name}")
        return self._input(f"temperature.{name}" if source == START else source)

    def _input(self, column: str) -> ca.SX:
        return self._column.setdefault(column, ca.SX.sym(column))

    def _inputs_of(self, use: Use) -> SimpleNamespace:
        place = use.declaration.driven_by or use.ends[0]
        return SimpleNamespace(**{name: self._input(input_column(name, place)) for name in use.effect.needed()})

    def _parameters_of(self, use: Use) -> SimpleNamespace:
        return SimpleNamespace(**{name: self._p[index] for name, index in use.parameters.items()})

    def _exchange(self, temperature: dict[str, ca.SX]) -> list[tuple[Any, ca.SX, ca.SX]]:
        """Each link with the factor on its conductance and the extra heat into its first end."""
        found = []
        for link in self.network.resistors:
            factor, extra = ca.SX(1), ca.SX(0)
            for use in self.network.uses:
                if isinstance(use.effect, LinkEffect) and set(use.ends) == set(link.ends):
                    node, other = use.ends
                    p = self._parameters_of(use)
                    factor = factor * use.effect.conductance_factor(
                        temperature[node], temperature[other], self._inputs_of(use), p
                    )
                    inward = use.effect.extra_heat(temperature[node], temperature[other], p)
                    extra = extra + (inward if node == link.ends[0] else -inward)
            found.append((link, factor, extra))
        return found

    def _loss_factor(self, use: Use, temperature: ca.SX) -> ca.SX:
        """Product of the factors that other effects put on this effect's heat."""
        factor = ca.SX(1)
        for other in self.network.uses:
            if (
                isinstance(other.effect, LossEffect)
                and other.ends == use.ends
                and other.effect.acts_on == use.effect.key
            ):
                factor = factor * other.effect.factor(temperature, self._parameters_of(other))
        return factor

    def _add_heat(self, heat: dict[str, ca.SX], temperature: dict[str, ca.SX], states: dict[int, ca.SX]) -> None:
        for use in self.network.uses:
            p, node = self._parameters_of(use), use.ends[0]
            if isinstance(use.effect, EdgeEffect):
                flow = use.effect.conductance(p) * (temperature[use.ends[1]] - temperature[node])
                _give(heat, node, flow)
                _give(heat, use.ends[1], -flow)
            elif isinstance(use.effect, MassEffect):
                _give(heat, node, use.effect.heat(temperature[node], states[id(use)], p))
            elif isinstance(use.effect, NodeEffect):
                flow = use.effect.heat(temperature[node], self._inputs_of(use), p)
                _give(heat, node, flow * self._loss_factor(use, temperature[node]))

    def _states_and_readings(
        self, temperature: dict[str, ca.SX], states: dict[int, ca.SX]
    ) -> tuple[list[ca.SX], list[ca.SX]]:
        rates, readings = [], {name: temperature[name] for name in self.nodes}
        for use in self.network.uses:
            node, state, p = use.ends[0], states.get(id(use)), self._parameters_of(use)
            if isinstance(use.effect, SensorEffect):
                readings[node] = readings[node] + use.effect.error(temperature[node], state, p)
            if state is not None:
                effect = cast(MassEffect | SensorEffect, use.effect)
                rates.append(effect.rate(temperature[node], state, p))
                self.states.append(_label(use))
                self.owners.append(self.nodes.index(node))
        return rates, list(readings.values())

    @property
    def symbols(self) -> Symbols:
        """The expressions behind the functions, for whoever differentiates them further."""
        return Symbols(self._x, self._u, self._p, self._rhs, self._y)

    # --- functions ----------------------------------------------------------------------------

    @property
    def rhs(self) -> ca.Function:
        """(x, u, p) -> dx/dt [K/s]."""
        return self._function("rhs", lambda: self._rhs, "xdot")

    @property
    def output(self) -> ca.Function:
        """(x, p) -> what the sensors of the dynamic nodes read [degC]."""
        make = lambda: ca.Function("output", [self._x, self._p], [self._y], ["x", "p"], ["y"])  # noqa: E731
        return self.made_once("output", make)

    @property
    def reads_directly(self) -> bool:
        """Whether every sensor reads its node's temperature as it is."""
        return not any(isinstance(use.effect, SensorEffect) for use in self.network.uses)

    def readings_of(self, states: FloatArray, p: FloatArray) -> FloatArray:
        """What the sensors read [degC], shape (nodes, n), at many states, shape (states, n)."""
        if self.reads_directly:
            return states[: len(self.nodes)]
        n = states.shape[1]
        readings = self.made_once(("output", n), lambda: self.output.map(n))
        return np.asarray(readings(states, np.repeat(p[:, None], n, axis=1)).full())

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

        Source: source S0, rows E11 and E12.
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
        following = {"rk4": self._rk4, "euler": self._euler, "zoh": self._zero_order_hold}[method](h)
        return ca.Function("step", [self._x, self._u, self._p, h], [following], ["x", "u", "p", "h"], ["x_next"])

    def _make_run(self, n: int, method: Method) -> ca.Function:
        x, u = ca.MX.sym("x", len(self.states)), ca.MX.sym("u", len(self.inputs), n)
        p, h = ca.MX.sym("p", len(self.unknowns)), ca.MX.sym("h")
        path = self.step(method).mapaccum(n)(x, u, ca.repmat(p, 1, n), ca.repmat(h, 1, n))
        return ca.Function("run", [x, u, p, h], [path], ["x0", "U", "p", "h"], ["X"])

    def _euler(self, h: ca.SX) -> ca.SX:
        return self._x + h * self._rhs

    def _rk4(self, h: ca.SX) -> ca.SX:
        rhs = self.rhs
        k1 = rhs(self._x, self._u, self._p)
        k2 = rhs(self._x + h / 2 * k1, self._u, self._p)
        k3 = rhs(self._x + h / 2 * k2, self._u, self._p)
        k4 = rhs(self._x + h * k3, self._u, self._p)
        return self._x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def _zero_order_hold(self, h: ca.SX) -> ca.SX:
        """x + h φ₁(hA) f(x): exact for f affine in x, by scaling and squaring of a Taylor series."""
        if not self.is_linear:
            raise ValueError(f"model {self.network.name}: not linear in its temperatures, so no exact step; use rk4")
        a = ca.densify(ca.jacobian(self._rhs, self._x)) * h / 2**_SQUARINGS
        n = len(self.states)
        identity = ca.SX.eye(n)
        phi = identity
        for order in range(_TAYLOR_ORDER, 1, -1):
            phi = identity + ca.mtimes(a, phi) / order
        for _ in range(_SQUARINGS):
            phi = ca.mtimes(phi, 2 * identity + ca.mtimes(a, phi)) / 2
            a = 2 * a
        return self._x + h * ca.mtimes(phi, self._rhs)


def _label(use: Use) -> str:
    """The name of an effect's state."""
    return f"{use.declaration.name}.{use.place}"


def _give(heat: dict[str, ca.SX], node: str, flow: ca.SX) -> None:
    """Add a heat flow to a node; a prescribed node swallows it."""
    if node in heat:
        heat[node] = heat[node] + flow
