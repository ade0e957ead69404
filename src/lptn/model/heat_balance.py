"""The symbolic heat balance of a network: rates of the states and readings of the sensors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any, cast

import casadi as ca

from lptn.effects import (
    BoundaryEffect,
    ClockEffect,
    EdgeEffect,
    ExcessEffect,
    GroupEffect,
    LinkEffect,
    LossEffect,
    MassEffect,
    NodeEffect,
    PairSensorEffect,
    SensorEffect,
)
from lptn.model.network import START, EffectInstance, Link, Network

# --- Faces without capacitance taken out of a heat balance, so that no algebraic loop is left in the model ---


_NEWTON_STEPS = 5  # of a law that is not linear at a face; each step squares the error


def without_faces(heat: Mapping[str, ca.SX], faces: Mapping[str, ca.SX], means: Sequence[ca.SX]) -> dict[str, ca.SX]:
    """Heat into each node with the temperatures of the faces, at which heat in equals heat out, put in.

    Where the heat at the faces is linear in their temperatures this is exact. Where it is not (radiation from a
    face), five Newton steps from the elements' mean temperatures take the place of the loop.

    Args:
        heat: heat into each node and face [W].
        faces: symbols of the faces' temperatures.
        means: for each face the mean temperature of its element, where Newton's steps start.
    """
    parameter = ca.vertcat(*faces.values())
    residual = ca.vertcat(*(heat[name] for name in faces))
    slope = ca.jacobian(residual, parameter)
    linear = not ca.depends_on(slope, parameter)
    found = ca.SX.zeros(len(faces)) if linear else ca.vertcat(*means)
    for _ in range(1 if linear else _NEWTON_STEPS):
        left, matrix = ca.substitute([residual, slope], [parameter], [found])
        found = found + _solved(-matrix, left)
    nodes = [name for name in heat if name not in faces]
    flows = ca.substitute(ca.vertcat(*(heat[name] for name in nodes)), parameter, found)
    return dict(zip(nodes, ca.vertsplit(flows), strict=True))


def _solved(matrix: ca.SX, side: ca.SX) -> ca.SX:
    """Solution of a symmetric positive definite system, by sparse LDLᵀ.

    It is definite because every face hangs on its element, and no element takes in work (`lptn.model.bodies`).
    """
    diagonal, upper, order = ca.ldl(matrix)
    return ca.ldl_solve(side, diagonal, upper, order)


_GLOBAL_INPUTS = {
    "base_speed": "speed.base",
    "fan_speed": "speed.fan",
    "pc_power": "power.pc",
    "computer_power": "power.computer",
    "battery_power": "power.battery",
    "global_irradiance": "irradiance.global",
}


def input_column(feature: str, place: str) -> str:
    """The log column that holds an input feature at a place: `torque.FR_calf`, `speed.base`."""
    return _GLOBAL_INPUTS.get(feature, f"{feature}.{place}")


class HeatBalance:
    r"""Symbols for states, inputs and parameters, and the expressions of them that make a model.

    .. math:: C_i \dot T_i = \sum_j (T_j - T_i) / R_{ij} + \sum Q

    An effect of one run has a factor, the indicator of that run, on its heat, its reading error or its change
    of a conductance: 1 in that run, 0 everywhere else.

    Args:
        network: what to write the balance of.

    Source: [QuadrupedLPTN, eq. 4, 5], with the sign that lets heat flow from hot to cold.
    """

    def __init__(self, network: Network) -> None:
        self.network = network
        self.p = ca.SX.sym("p", len(network.parameters))
        """All parameters."""
        self.columns: dict[str, ca.SX] = {}
        """Inputs by log column, in order."""
        self.started: list[str] = []
        """Those that are taken from the start of a run."""
        self.hidden = [instance for instance in network.effect_instances if instance.effect.has_state]
        """Uses that have a state, in the order of the states behind the nodes'."""
        self._nodes = {name: ca.SX.sym(name) for name in network.dynamic}
        self._states = {id(instance): ca.SX.sym(instance.label) for instance in self.hidden}
        given = {name: self._prescribed(name) for name in network.prescribed}
        self._given = dict(given)
        self._faces = {name: ca.SX.sym(name) for name in network.massless}
        self.temperature: dict[str, ca.SX] = self._nodes | {name: self._felt(name) for name in given} | self._faces
        """Temperatures of all places, those of prescribed nodes as the others feel them."""
        self._warming = self._balance()
        self.x = ca.vertcat(*self._nodes.values(), *self._states.values())
        """States: nodes, then those of effects."""
        self.rates = ca.vertcat(*self._warming.values(), *(self._rate(instance) for instance in self.hidden))
        """dx/dt [K/s]."""
        self.readings = ca.vertcat(*self._readings())
        """What the sensors read [degC]."""
        self.delays = ca.vertcat(*(self._delay(node) for node in self._nodes))
        """How late each node's readings come [s]."""
        self.u = ca.vertcat(*self.columns.values()) if self.columns else ca.SX(0, 1)
        """Inputs, in the order of `columns`."""

    # --- what a use reads -------------------------------------------------------------------------

    def parameters_of(self, instance: EffectInstance) -> SimpleNamespace:
        """The parameters of an effect at its place."""
        return SimpleNamespace(**{name: self.p[index] for name, index in instance.parameters.items()})

    def inputs_of(self, instance: EffectInstance) -> SimpleNamespace:
        """The input features of an effect at its place."""
        place = instance.declaration.driven_by or instance.ends[0]
        return SimpleNamespace(**{name: self._input(input_column(name, place)) for name in instance.effect.needed()})

    def state_of(self, instance: EffectInstance) -> Any:
        """The state of an effect at its place, `None` if it has none."""
        return self._states.get(id(instance))

    def in_its_run(self, instance: EffectInstance, amount: Any) -> Any:
        """An amount as it is, or times the indicator of the run to which the effect is confined."""
        return amount if instance.indicator is None else self.p[instance.indicator] * amount

    def factor_in_its_run(self, instance: EffectInstance, factor: Any) -> Any:
        """The same for a factor, which is 1 outside the run."""
        return factor if instance.indicator is None else 1 + self.p[instance.indicator] * (factor - 1)

    def _prescribed(self, name: str) -> ca.SX:
        source = self.network.prescribed[name]
        if isinstance(source, int):
            return self.p[source]
        if source == START:
            self.started.append(f"temperature.{name}")
        return self._input(f"temperature.{name}" if source == START else source)

    def _felt(self, name: str) -> ca.SX:
        """A prescribed temperature with the errors that effects put on it."""
        felt = self._given[name]
        for instance in self.network.effect_instances:
            if isinstance(instance.effect, BoundaryEffect) and instance.ends[0] == name:
                error = instance.effect.error(self._given[name], self.state_of(instance), self.parameters_of(instance))
                felt = felt + self.in_its_run(instance, error)
        return felt

    def _input(self, column: str) -> ca.SX:
        return self.columns.setdefault(column, ca.SX.sym(column))

    # --- heat -------------------------------------------------------------------------------------

    def exchange(self, link: Link, left_out: EffectInstance | None = None) -> Any:
        """Heat that a link carries into its first end [W], perhaps with one effect left out."""
        one, other = link.ends
        factor, extra = ca.SX(1), ca.SX(0)
        for instance in self.network.effect_instances:
            if (
                instance is left_out
                or not isinstance(instance.effect, LinkEffect)
                or set(instance.ends) != set(link.ends)
            ):
                continue
            node, around = (self.temperature[end] for end in instance.ends)
            p = self.parameters_of(instance)
            changed = instance.effect.conductance_factor(node, around, self.inputs_of(instance), p)
            factor = factor * self.factor_in_its_run(instance, changed)
            inward = self.in_its_run(instance, instance.effect.extra_heat(node, around, p))
            extra = extra + (inward if instance.ends[0] == one else -inward)
        drop = self.temperature[other] - self.temperature[one]
        return factor * drop / self.p[link.resistance] + extra

    def heat_of(self, instance: EffectInstance, left_out: EffectInstance | None = None) -> Any:
        """Heat that an effect brings into its node [W], with the factors of loss effects, perhaps one left out."""
        node, effect = self.temperature[instance.ends[0]], cast(NodeEffect, instance.effect)
        factor = ca.SX(1)
        for other in self.network.effect_instances:
            if other is left_out or not isinstance(other.effect, LossEffect) or other.ends != instance.ends:
                continue
            if other.effect.acts_on == effect.key:
                changed = other.effect.factor(node, self.parameters_of(other))
                factor = factor * self.factor_in_its_run(other, changed)
        return self.in_its_run(
            instance, effect.heat(node, self.inputs_of(instance), self.parameters_of(instance)) * factor
        )

    def state_heat(self, instance: EffectInstance, node: str) -> Any:
        """Heat that an effect with a state brings into one of its nodes [W]."""
        effect = cast(MassEffect | GroupEffect, instance.effect)
        return self.in_its_run(
            instance, effect.heat(self.temperature[node], self.state_of(instance), self.parameters_of(instance))
        )

    def edge_flow(self, instance: EffectInstance) -> Any:
        """Heat that an edge effect carries into its first end [W]."""
        one, other = instance.ends
        effect = cast(EdgeEffect, instance.effect)
        drop = self.temperature[other] - self.temperature[one]
        return self.in_its_run(instance, effect.conductance(self.parameters_of(instance))) * drop

    def _balance(self) -> dict[str, ca.SX]:
        """Rate of each node [K/s]."""
        network, temperature = self.network, self.temperature
        heat = {name: ca.SX(0) for name in (*self._nodes, *self._faces)}
        for link in network.resistors:
            _pass(heat, link.ends, self.exchange(link))
        for inside in network.conductors:
            one, other = inside.ends
            flow = self.p[inside.conductivity] * inside.shape * (temperature[other] - temperature[one])
            _pass(heat, inside.ends, flow)
        for instance in network.effect_instances:
            if isinstance(instance.effect, EdgeEffect):
                _pass(heat, instance.ends, self.edge_flow(instance))
            elif isinstance(instance.effect, MassEffect | GroupEffect):
                for node in instance.ends:
                    _give(heat, node, self.state_heat(instance, node))
            elif isinstance(instance.effect, NodeEffect):
                _give(heat, instance.ends[0], self.heat_of(instance))
        if self._faces:
            means = [self._nodes[element] for element in network.massless.values()]
            heat = without_faces(heat, self._faces, means)
        return {name: heat[name] / self.p[network.capacities[name]] for name in self._nodes}

    # --- states of effects, and readings ----------------------------------------------------------

    def _rate(self, instance: EffectInstance) -> Any:
        node, state, p, effect = (
            instance.ends[0],
            self.state_of(instance),
            self.parameters_of(instance),
            instance.effect,
        )
        if isinstance(effect, GroupEffect):
            members = [self.temperature[end] for end in instance.ends]
            around = self.network.around(instance)
            return effect.rate(_mean(members), state, state if around is None else self.temperature[around], p)
        if isinstance(effect, ExcessEffect):
            driving = (
                each
                for each in self.network.effect_instances
                if each.effect.key == effect.heat_of and each.ends == instance.ends
            )
            heat = sum((self.heat_of(each) for each in driving), start=ca.SX(0))
            return self._warming[node] + effect.excess_rate(state - self.temperature[node], heat, p)
        temperature = self._given[node] if isinstance(effect, BoundaryEffect) else self.temperature[node]
        return cast(MassEffect | SensorEffect | BoundaryEffect, effect).rate(temperature, state, p)

    def _readings(self) -> Iterable[ca.SX]:
        readings = {name: self.temperature[name] for name in self._nodes}
        for instance in self.network.effect_instances:
            if isinstance(instance.effect, SensorEffect):
                node = instance.ends[0]
                seen = (
                    self.temperature[instance.ends[1]]
                    if isinstance(instance.effect, PairSensorEffect)
                    else self.state_of(instance)
                )
                error = instance.effect.error(self.temperature[node], seen, self.parameters_of(instance))
                readings[node] = readings[node] + self.in_its_run(instance, error)
        return readings.values()

    def _delay(self, node: str) -> ca.SX:
        delay = ca.SX(0)
        for instance in self.network.effect_instances:
            if isinstance(instance.effect, ClockEffect) and instance.ends[0] == node:
                delay = delay + self.in_its_run(instance, instance.effect.delay(self.parameters_of(instance)))
        return delay


def _pass(heat: dict[str, ca.SX], ends: tuple[str, ...], flow: ca.SX) -> None:
    """Let a heat flow into the first end and out of the second."""
    _give(heat, ends[0], flow)
    _give(heat, ends[1], -flow)


def _give(heat: dict[str, ca.SX], node: str, flow: ca.SX) -> None:
    """Add a heat flow to a node; a prescribed node swallows it."""
    if node in heat:
        heat[node] = heat[node] + flow


def _mean(values: list[ca.SX]) -> Any:
    return sum(values[1:], start=values[0]) / len(values)
