"""The symbolic heat balance of a network: rates of the states and readings of the sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache, cached_property
from types import SimpleNamespace
from typing import Any

import casadi as ca

from lptn.basics.places import edge
from lptn.logs.columns import START
from lptn.model.bodies import HottestPoint
from lptn.model.network import EffectInstance, Link, Network

# Input features of which a log has one column for the whole robot; any other has one for each place.
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

    Attributes:
        p: all parameters.
        columns: inputs by log column: quantity by quantity in the order in which the balance reads them, each in the
            network's order of places.
        started: those inputs that are taken from the start of a run.
        hidden: effect instances that have a state, in the order of the states behind the nodes'.
        temperature: temperatures of all places, those of prescribed nodes as the others feel them [degC].
        x: states: nodes, then the hottest points of elements, then those of effects.
        rates: dx/dt [K/s].
        readings: what the sensors of the nodes read [degC].
        delays: how late each node's readings come [s].
        u: inputs, in the order of `columns`.

    Source: [QuadrupedLPTN, eq. 4, 5], with the sign that lets heat flow from hot to cold.
    """

    def __init__(self, network: Network) -> None:
        self.network = network
        self.p = ca.SX.sym("p", len(network.parameters))
        self.columns: dict[str, ca.SX] = {}
        self.started: list[str] = []
        self.hidden = [instance for instance in network.effect_instances if instance.effect.has_state]
        self._conditions = {id(instance): _Conditions(self, instance) for instance in network.effect_instances}
        self._at_ends: dict[frozenset[str], list[EffectInstance]] = {}
        self._at_first_end: dict[str, list[EffectInstance]] = {}
        for instance in network.effect_instances:
            self._at_ends.setdefault(frozenset(instance.ends), []).append(instance)
            self._at_first_end.setdefault(instance.ends[0], []).append(instance)

        self._nodes = {name: ca.SX.sym(name) for name in network.dynamic}
        self.states = {id(instance): ca.SX.sym(instance.label) for instance in self.hidden}
        self.given = {name: self._prescribed(name) for name in network.prescribed}
        self._faces = {name: ca.SX.sym(name) for name in network.massless}
        self._solved: dict[str, ca.SX] = {}  # the faces' temperatures as expressions of all else
        self._flows: dict[str, Any] = {}
        self._heats: dict[int, list[Any]] = {}  # what `heat_into_ends` found with no effect left out
        self.at_sensor = cache(self._at_sensor)
        felt = {name: self._felt(name) for name in self.given}
        self.temperature: dict[str, ca.SX] = self._nodes | felt | self._faces
        self.warming = self._balance()
        hottest = {point.name: ca.SX.sym(point.name) for point in network.hottest}
        self.x = ca.vertcat(*self._nodes.values(), *hottest.values(), *self.states.values())
        hottest_rates = [self._hottest_rate(point, hottest[point.name]) for point in network.hottest]
        state_rates = [self.with_faces_solved(item.effect.state_rate(self._here(item))) for item in self.hidden]
        self.rates = ca.vertcat(*self.warming.values(), *hottest_rates, *state_rates)
        self.readings = ca.vertcat(*(self._reading(name) for name in self._nodes))
        self.delays = ca.vertcat(*(self._delay(name) for name in self._nodes))
        self.columns = {column: self.columns[column] for column in network.columns_in_order(self.columns)}
        self.u = ca.vertcat(*self.columns.values()) if self.columns else ca.SX(0, 1)

    def input(self, column: str) -> ca.SX:
        """The symbol of a log column, which becomes an input of the model."""
        return self.columns.setdefault(column, ca.SX.sym(column))

    def _here(self, instance: EffectInstance) -> _Conditions:
        return self._conditions[id(instance)]

    def _in_its_run(self, instance: EffectInstance, amount: Any) -> Any:
        """An amount as it is, or times the indicator of the run to which the effect is confined."""
        return amount if instance.indicator is None else self.p[instance.indicator] * amount

    def _factor_in_its_run(self, instance: EffectInstance, factor: Any) -> Any:
        """The same for a factor, which is 1 outside the run."""
        return factor if instance.indicator is None else 1 + self.p[instance.indicator] * (factor - 1)

    # --- temperatures of prescribed nodes ---------------------------------------------------------

    def _prescribed(self, name: str) -> ca.SX:
        source = self.network.prescribed[name]
        if isinstance(source, int):
            return self.p[source]
        if source == START:
            self.started.append(f"temperature.{name}")
        return self.input(f"temperature.{name}" if source == START else source)

    def _felt(self, name: str) -> ca.SX:
        """A prescribed temperature with the errors that effects put on it."""
        felt = self.given[name]
        for instance in self._at_first_end.get(name, []):
            felt = felt + self._in_its_run(instance, instance.effect.prescribed_error(self._here(instance)))
        return felt

    # --- heat -------------------------------------------------------------------------------------

    def exchange(self, link: Link, left_out: EffectInstance | None = None) -> Any:
        """Heat that a link carries into its first end [W], perhaps with one effect left out."""
        one, other = link.ends
        factor, extra = ca.SX(1), ca.SX(0)
        for instance in self._at_ends.get(frozenset(link.ends), []):
            if instance is left_out or not instance.effect.changes_link:
                continue
            here = self._here(instance)
            factor = factor * self._factor_in_its_run(instance, instance.effect.link_factor(here))
            inward = self._in_its_run(instance, instance.effect.link_heat(here))
            extra = extra + (inward if instance.ends[0] == one else -inward)
        drop = self.temperature[other] - self.temperature[one]
        return factor * drop / self.p[link.resistance] + extra

    def heat_into_ends(self, instance: EffectInstance, left_out: EffectInstance | None = None) -> list[Any]:
        """Heat that an effect brings into each of its ends [W], `[]` if it brings none.

        Effects that scale the heat of another (`Effect.scales_heat`) are in it, perhaps with one of them left out.
        """
        if left_out is None and id(instance) in self._heats:
            return self._heats[id(instance)]
        factor = ca.SX(1)
        for other in self._at_ends[frozenset(instance.ends)]:
            if other is not left_out and other.effect.scales_heat and other.effect.heat_of == instance.effect.key:
                changed = other.effect.heat_factor(self._here(other))
                factor = factor * self._factor_in_its_run(other, changed)
        heats = instance.effect.heat_into_ends(self._here(instance))
        inward = [self._in_its_run(instance, heat * factor) for heat in heats]
        return inward if left_out else self._heats.setdefault(id(instance), inward)

    def heat_of(self, key: str, ends: tuple[str, ...]) -> Any:
        """Heat that the effects of one key bring into a place [W]."""
        there = (other for other in self._at_ends[frozenset(ends)] if other.effect.key == key)
        return sum((self.heat_into_ends(other)[0] for other in there), start=ca.SX(0))

    @property
    def flows(self) -> dict[str, Any]:
        """What flows [W]: through each link into its first end, `"a~b"`, and from each effect into its first end,
        `"copper_loss.FR_calf"`.
        """
        return {name: self.with_faces_solved(flow) for name, flow in self._flows.items()}

    def with_faces_solved(self, expression: Any) -> Any:
        """An expression with the temperatures of faces without capacitance put in: one of states and inputs alone."""
        if not self._solved:
            return expression
        names = list(self._solved)
        faces, solved = ca.vertcat(*(self._faces[name] for name in names)), ca.vertcat(*self._solved.values())
        return ca.substitute(ca.SX(expression), faces, solved)

    def _balance(self) -> dict[str, ca.SX]:
        """Rate of each node [K/s]."""
        network, temperature = self.network, self.temperature
        heat = {name: ca.SX(0) for name in (*self._nodes, *self._faces)}

        def give(node: str, flow: Any) -> None:
            if node in heat:  # a prescribed node swallows it
                heat[node] = heat[node] + flow

        links = [(link.place, link.ends, self.exchange(link)) for link in network.resistors]
        for inside in network.conductors:
            one, other = inside.ends
            flow = self.p[inside.conductivity] * inside.shape * (temperature[other] - temperature[one])
            links.append((edge(one, other), inside.ends, flow))
        for place, (one, other), flow in links:
            self._flows[place] = flow
            give(one, flow)
            give(other, -flow)
        for instance in network.effect_instances:
            for node, flow in zip(instance.ends, self.heat_into_ends(instance), strict=False):
                self._flows.setdefault(instance.label, flow)
                give(node, flow)
        if self._faces:
            means = [self._nodes[element] for element in network.massless.values()]
            solved = temperatures_of_faces(heat, self._faces, means)
            flows = ca.vertcat(*(heat[name] for name in self._nodes))
            flows = ca.substitute(flows, ca.vertcat(*self._faces.values()), solved)
            heat = dict(zip(self._nodes, ca.vertsplit(flows), strict=True))
            self._solved = dict(zip(self._faces, ca.vertsplit(solved), strict=True))
        return {name: heat[name] / self.p[network.capacities[name]] for name in self._nodes}

    def _hottest_rate(self, point: HottestPoint, hottest: ca.SX) -> Any:
        """Rate of an element's hottest point [K/s]: with the mean, and towards the profile that the faces tell."""
        mean, capacity = self._nodes[point.element], self.p[self.network.capacities[point.element]]
        formed = mean + point.above_mean(self.temperature | self._solved)
        return self.warming[point.element] + point.forming_rate(self.p, capacity) * (formed - hottest)

    # --- sensors ----------------------------------------------------------------------------------

    def _reading(self, node: str) -> Any:
        reading = self.at_sensor(node)
        for instance in self._at_first_end.get(node, []):
            if instance.effect.changes_reading and not instance.effect.moves_sensor:
                reading = reading + self._reading_error(instance)
        return reading

    def _at_sensor(self, node: str) -> Any:
        """The temperature where a node's sensor sits [degC]."""
        temperature = self.temperature[node]
        for instance in self._at_first_end.get(node, []):
            if instance.effect.moves_sensor:
                temperature = temperature + self._reading_error(instance)
        return temperature

    def _reading_error(self, instance: EffectInstance) -> Any:
        return self._in_its_run(instance, instance.effect.reading_error(self._here(instance)))

    def _delay(self, node: str) -> ca.SX:
        delay = ca.SX(0)
        for instance in self._at_first_end.get(node, []):
            if instance.effect.delays_readings:
                delay = delay + self._in_its_run(instance, instance.effect.reading_delay(self._here(instance)))
        return delay


class _Conditions:
    """What an effect reads at its place: `lptn.effects.base.Conditions` in a heat balance that is being written."""

    def __init__(self, balance: HeatBalance, instance: EffectInstance) -> None:
        self._balance, self._instance = balance, instance

    @property
    def temperatures(self) -> list[Any]:
        return [self._balance.temperature[end] for end in self._instance.ends]

    @property
    def at_sensor(self) -> Any:
        return self._balance.at_sensor(self._instance.ends[0])

    @property
    def given(self) -> Any:
        return self._balance.given[self._instance.ends[0]]

    @property
    def surroundings(self) -> Any:
        network, ends = self._balance.network, self._instance.ends
        near = [other for node, other in network.surroundings.values() if node in ends]
        name = next(iter([*near, *network.prescribed]), None)
        return None if name is None else self._balance.temperature[name]

    @property
    def around(self) -> Any:
        network, (node, *_) = self._balance.network, self._instance.ends
        own = {node, *(face for face, element in network.massless.items() if element == node)}
        links = [link for link in network.resistors if not own.isdisjoint(link.ends)]
        beside = [link.ends[link.ends[0] in own] for link in links]
        if not links or not network.prescribed.keys().isdisjoint(beside):
            return self.surroundings
        conductances = [1 / self._balance.p[link.resistance] for link in links]
        weighted = (g * self._balance.temperature[name] for g, name in zip(conductances, beside, strict=True))
        return sum(weighted) / sum(conductances)

    @property
    def warming(self) -> Any:
        return self._balance.warming[self._instance.ends[0]]

    @property
    def state(self) -> Any:
        return self._balance.states.get(id(self._instance))

    @cached_property
    def inputs(self) -> SimpleNamespace:
        place, features = self._instance.driven_by, self._instance.effect.needed()
        return SimpleNamespace(**{name: self._balance.input(input_column(name, place)) for name in features})

    @cached_property
    def p(self) -> SimpleNamespace:
        return SimpleNamespace(**{name: self._balance.p[index] for name, index in self._instance.parameters.items()})

    def heat_of(self, key: str) -> Any:
        return self._balance.heat_of(key, self._instance.ends)


# --- Faces without capacitance taken out of a heat balance, so that no algebraic loop is left in the model ---


def temperatures_of_faces(heat: Mapping[str, ca.SX], faces: Mapping[str, ca.SX], means: Sequence[ca.SX]) -> ca.SX:
    """Temperatures of the faces, at which heat in equals heat out, as expressions of all else.

    Where the heat at the faces is linear in their temperatures this is exact. Where it is not (radiation from a
    face), five Newton steps from the elements' mean temperatures take the place of the loop.

    Args:
        heat: heat into each node and face [W].
        faces: symbols of the faces' temperatures.
        means: for each face the mean temperature of its element, where Newton's steps start.
    """
    unknown = ca.vertcat(*faces.values())
    residual = ca.vertcat(*(heat[name] for name in faces))
    slope = ca.jacobian(residual, unknown)
    linear = not ca.depends_on(slope, unknown)
    temperatures = ca.SX.zeros(len(faces)) if linear else ca.vertcat(*means)
    newton_steps = 5  # of a law that is not linear at a face; each step squares the error
    for _ in range(1 if linear else newton_steps):
        imbalance, matrix = ca.substitute([residual, slope], [unknown], [temperatures])
        temperatures = temperatures + _solved(-matrix, imbalance)
    return temperatures


def _solved(matrix: ca.SX, side: ca.SX) -> ca.SX:
    """Solution of a symmetric positive definite system, by sparse LDLᵀ.

    It is definite because every face hangs on its element, and no element takes in work (`lptn.model.bodies`).
    """
    diagonal, upper, order = ca.ldl(matrix)
    return ca.ldl_solve(side, diagonal, upper, order)
