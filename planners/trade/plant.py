"""A motor with its sink as symbols: the model's own rates, driven by torque, and every number of it a parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.places import edge
from lptn.model.model import Model

from .motors import REFERENCE
from .sink import DENSITY, SPECIFIC_HEAT, fin_mass, sink_volume
from .study import Option, pipe_places

CAPACITY, RESISTANCE = "design.capacity", "design.resistance"
"""The two design variables [J/K, K/W], as they are called among the parameters of a given design."""


class Parameters:
    """Named scalars of a problem: symbol, value and unit, in order."""

    def __init__(self) -> None:
        self.symbols: dict[str, Any] = {}
        self.defaults: dict[str, float] = {}
        self.units: dict[str, str] = {}

    def add(self, name: str, value: float, unit: str) -> Any:
        """A new parameter's symbol."""
        self.symbols[name] = ca.SX.sym(name)
        self.defaults[name] = float(value)
        self.units[name] = unit
        return self.symbols[name]

    @property
    def stacked(self) -> Any:
        return ca.vertcat(*self.symbols.values())

    def values(self, changed: Mapping[str, float] | None = None) -> FloatArray:
        """All values, shape (number of parameters,), some of them replaced."""
        return np.array(list((self.defaults | dict(changed or {})).values()), dtype=float)


class Plant:
    """An option of a study as expressions of the states, the torque, the design and the parameters.

    Args:
        option: the discrete choice.
        parameters: gains the model's parameters and those of sink and motor.
        capacity: of the sink [J/K]; an expression or a parameter's symbol, unused without a sink.
        resistance: of the sink to the air [K/W].
    """

    def __init__(self, option: Option, parameters: Parameters, capacity: Any, resistance: Any) -> None:
        self.option, self.parameters = option, parameters
        self.capacity, self.resistance = capacity, resistance
        self.model = Model(option.network())
        self.states = self.model.states
        self._p = self._model_parameters()
        add = parameters.add
        self.ambient = add("ambient", option.study.task.ambient, "degC")
        self._constant = add("torque_constant", option.motor.torque_constant, "N*m/A")
        self._coefficient = add("magnet_coefficient", option.motor.magnet_coefficient, "1/K")
        self._fixed_mass = add("fixed_mass", option.fixed_mass, "kg")
        self._fixed_volume = add("fixed_volume", option.fixed_volume, "m^3")
        if option.has_sink:
            sink = option.study.sink
            self._film = add("film", option.film, "W/(m^2*K)")
            self._thickness = add("fin_thickness", sink.thickness, "m")
            self._spacing = add("fin_spacing", option.study.air[option.cooling].spacing, "m")
            self._density = add("density", DENSITY, "kg/m^3")
            self._heat = add("specific_heat", SPECIFIC_HEAT, "J/(kg*K)")
        self._refuse_other_inputs()

    def _refuse_other_inputs(self) -> None:
        """A study knows the motor's current and the air, nothing else."""
        origin = self.option.motor.network.origin
        currents = [column for column in self.model.inputs if column.startswith("current.")]
        for column in self.model.inputs:
            if column.startswith("torque."):
                expected = 'input = "current" in its copper_loss: the study knows the torque constant'
                raise InputError(origin, f"input {column}", "a model driven by torque", expected)
            if not column.startswith(("temperature.", "current.")):
                raise InputError(origin, f"input {column}", "a model that needs it", "current and ambient alone")
        if len(currents) != 1:
            found = f"{len(currents)} currents that heat it" if currents else "no copper loss from a current"
            raise InputError(origin, "effects", found, 'one current: kind = "copper_loss", input = "current"')

    def _model_parameters(self) -> Any:
        """The model's parameter vector, the sink's two replaced by the design variables."""
        network, sink = self.model.network, self.option.study.sink
        own: dict[str, Any] = {}
        if self.option.has_sink:
            air = next(iter(network.prescribed))
            by_place = {link.place: self.model.parameters[link.resistance].name for link in network.resistors}
            outer = edge(sink.node, air)
            if outer not in by_place:
                where = f"{sink.node} without a link to {air}"
                raise InputError(self.option.study.origin, "sink.node", where, f"a link {outer}")
            own = {
                self.model.parameters[network.capacities[sink.node]].name: self.capacity,
                by_place[outer]: self.resistance,
            }
            places = pipe_places(network, self.option.motor.sink_at)
            self._pipes = {place: by_place[edge(place, sink.node)] for place in places}
        return ca.vertcat(
            *(
                own[parameter.name]
                if parameter.name in own
                else self.parameters.add(parameter.name, parameter.value, parameter.declared.unit)
                for parameter in self.model.parameters
            )
        )

    # --- at one moment ------------------------------------------------------------------------

    def temperatures(self, x: Any, nodes: Sequence[str]) -> Any:
        """Temperatures of some nodes [degC]."""
        return ca.vertcat(*[x[self.states.index(node)] for node in nodes])

    def current(self, x: Any, torque: Any) -> Any:
        """Current [A] that gives a torque [N·m] with the magnets as warm as they are; [Chen2017, eq. 2.6]."""
        nodes = self.option.motor.magnet
        warm = ca.sum1(self.temperatures(x, nodes)) / len(nodes) - REFERENCE
        return torque / (self._constant * (1 + self._coefficient * warm))

    def rates(self, x: Any, torque: Any) -> Any:
        """dx/dt [K/s] under a torque [N·m], by the model's own function."""
        return self.rates_at_current(x, self.current(x, torque))

    def rates_at_current(self, x: Any, current: Any) -> Any:
        """dx/dt [K/s] at a current [A]."""
        inputs = (self.ambient if name.startswith("temperature.") else current for name in self.model.inputs)
        return self.model.rhs(x, ca.vertcat(*inputs), self._p)

    def pipe_power(self, x: Any, torque: Any) -> Any:
        """Heat through the heat pipes [W]; a body's face has no state, so there it is what the sink takes in."""
        sink = self.states.index(self.option.study.sink.node)
        if all(place in self.states for place in self._pipes):
            return sum(
                (x[self.states.index(place)] - x[sink]) / self.parameters.symbols[name]
                for place, name in self._pipes.items()
            )
        return self.capacity * self.rates(x, torque)[sink] + (x[sink] - self.ambient) / self.resistance

    # --- of the design ------------------------------------------------------------------------

    @property
    def mass(self) -> Any:
        """Motor, pipes, fan and sink [kg]."""
        return self._fixed_mass + (self.capacity / self._heat if self.option.has_sink else 0)

    @property
    def volume(self) -> Any:
        """Motor, fan and sink [m³]."""
        if not self.option.has_sink:
            return self._fixed_volume
        return self._fixed_volume + sink_volume(
            self.capacity, self.resistance, self._film, self._thickness, self._spacing, self._density, self._heat
        )

    @property
    def fin_share(self) -> Any:
        """Share of the sink's metal that its fins need; a sink is feasible up to 1."""
        fins = fin_mass(self.resistance, self._film, self._thickness, self._density)
        return fins * self._heat / self.capacity
