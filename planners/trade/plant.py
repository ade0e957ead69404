"""A motor with its sink as symbols: the model's own rates, driven by torque, and every number of it a parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.places import edge
from lptn.logs.columns import column_unit
from lptn.model.model import Model

from .motors import REFERENCE
from .sink import SinkNumbers
from .study import GEAR, LIMITS, SINK, Option, pipe_places

CAPACITY, RESISTANCE = "design.capacity", "design.resistance"
"""The sink's two design variables [J/K, K/W], as they are called among the parameters of a given design."""
KNOWN = ("temperature", "current", "current_abs", "torque_abs", "mechanical_power", "velocity", "velocity_rms")
"""Quantities of a model's inputs that follow from the air, the motor's current and its speed."""
_GEAR_HEAT = f"power.{GEAR}"
_SINK_UNITS = ("W/(m^2*K)", "m", "m", "kg/m^3", "J/(kg*K)", "{}/kg")
"""Of `SinkNumbers`, in order; money in the study's currency."""


class Load(NamedTuple):
    """What the task asks for behind the gear at one moment: torque [N·m], speed [rad/s], acceleration [rad/s²].

    A negative speed is a load that drives the motor; a torque is never negative.
    """

    torque: Any
    speed: Any = 0.0
    acceleration: Any = 0.0


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
        ratio: of the gear, where it is sought; else that of a gear becomes a parameter.
    """

    def __init__(
        self, option: Option, parameters: Parameters, capacity: Any, resistance: Any, ratio: Any = None
    ) -> None:
        self.option, self.parameters = option, parameters
        self.capacity, self.resistance = capacity, resistance
        self.model = Model(option.network())
        self.states = self.model.states
        self._p = self._model_parameters()
        add = parameters.add
        self.ambient = add("ambient", option.study.task.ambient, "degC")
        self._constant = add("torque_constant", option.motor.torque_constant, "N*m/A")
        self._coefficient = add("magnet_coefficient", option.motor.magnet_coefficient, "1/K")
        currency, fixed = option.study.question.currency, option.fixed.items()
        self._fixed = {name: add(f"fixed_{name}", value, LIMITS[name] or currency) for name, value in fixed}
        self._inertia = add("rotor_inertia", option.motor.rotor_inertia, "kg*m^2")
        self.ratio, self._efficiency = (ca.SX(1.0) if ratio is None else ratio), ca.SX(1.0)
        if option.gear.name:
            self.ratio = add("gear.ratio", option.gear.ratio[0], "1") if ratio is None else ratio
            self._efficiency = add("gear.efficiency", option.gear.efficiency, "1")
        if option.has_sink:
            named = zip(option.sink(resistance)._asdict().items(), _SINK_UNITS, strict=True)
            # What a fan's curve makes of the resistance is no number of its own: a factor on it is.
            self.sink = SinkNumbers(
                *(
                    value * add(name, 1.0, "1") if isinstance(value, ca.SX) else add(name, value, unit.format(currency))
                    for (name, value), unit in named
                )
            )
        given = option.study.task.inputs
        self._given = {name: add(name, given[name], column_unit(name)) for name in self.model.inputs if name in given}
        self._refuse_other_inputs()

    def _refuse_other_inputs(self) -> None:
        """A study knows the motor's current, its speed, the air, and what the task says by column."""
        origin = self.option.motor.network.origin
        currents = [column for column in self.model.inputs if column.startswith("current.")]
        for column in self.model.inputs:
            if column.startswith("torque."):
                expected = 'input = "current" in its copper_loss: the study knows the torque constant'
                raise InputError(origin, f"input {column}", "a model driven by torque", expected)
            known = column == _GEAR_HEAT or column in self._given or column.partition(".")[0] in KNOWN
            if not known:
                expected = f'current, speed of the motor and ambient alone, or [task] inputs = {{ "{column}" = … }}'
                raise InputError(origin, f"input {column}", "a model that needs it", expected)
        if len(currents) != 1:
            mistake = f"{len(currents)} currents that heat it" if currents else "no copper loss from a current"
            raise InputError(origin, "effects", mistake, 'one current: kind = "copper_loss", input = "current"')

    def _model_parameters(self) -> Any:
        """The model's parameter vector, the sink's two replaced by the design variables."""
        network = self.model.network
        own: dict[str, Any] = {}
        if self.option.has_sink:
            air = next(iter(network.prescribed))
            by_place = {link.place: self.model.parameters[link.resistance].name for link in network.resistors}
            outer = edge(SINK, air)
            if outer not in by_place:
                found = f"a node {SINK} without a link to {air}"
                raise InputError(network.origin, "links", found, f"a link {outer}")
            own = {
                self.model.parameters[network.capacities[SINK]].name: self.capacity,
                by_place[outer]: self.resistance,
            }
            places = pipe_places(network, self.option.motor.sink_at)
            self._pipes = {place: by_place[edge(place, SINK)] for place in places}
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

    def motor_speed(self, load: Load) -> Any:
        """Of the shaft [rad/s]."""
        return self.ratio * load.speed

    def current(self, x: Any, load: Load) -> Any:
        """Current [A] that gives a torque with the magnets as warm as they are; [Chen2017, eq. 2.6]."""
        # At the rotor's windings [N·m]: through the gear, and to accelerate the rotor.
        torque = load.torque / self.ratio * self.through(load) + self._inertia * self.ratio * load.acceleration
        return torque / self._torque_constant(x)

    def through(self, load: Load) -> Any:
        """Torque before the gear over what a gear without losses would take."""
        gear, efficiency = self.option.gear, self._efficiency
        if gear.map is not None:
            efficiency = efficiency * gear.map.at(self.motor_speed(load), load.torque)
        efficiency = ca.fmin(efficiency, 1.0)  # a draw of it may be above
        return ca.if_else(load.speed < 0, efficiency, 1 / efficiency)

    def _torque_constant(self, x: Any) -> Any:
        nodes = self.option.motor.magnet_nodes
        warm = ca.sum1(self.temperatures(x, nodes)) / len(nodes) - REFERENCE
        return self._constant * (1 + self._coefficient * warm)

    def rates(self, x: Any, load: Load) -> Any:
        """dx/dt [K/s] under a load, by the model's own function."""
        lost = load.torque * load.speed * (self.through(load) - 1)  # in the gear
        return self.rates_at_current(x, self.current(x, load), self.motor_speed(load), lost)

    def rates_at_current(self, x: Any, current: Any, speed: Any = 0.0, gear_heat: Any = 0.0) -> Any:
        """dx/dt [K/s] at a current [A], a speed of the motor [rad/s] and a heat of the gear [W]."""
        return self.model.rhs(x, self._inputs(x, current, speed, gear_heat), self._p)

    def _inputs(self, x: Any, current: Any, speed: Any, gear_heat: Any = 0.0) -> Any:
        torque = self._torque_constant(x) * current
        values = {"temperature": self.ambient, "current": current, "current_abs": current, "torque_abs": torque,
                  "mechanical_power": torque * speed}  # fmt: skip
        named = self._given | {_GEAR_HEAT: gear_heat}
        return ca.vertcat(*(named.get(name, values.get(name.partition(".")[0], speed)) for name in self.model.inputs))

    def voltage(self, x: Any, load: Load) -> Any:
        r"""Supply voltage [V] that a load takes, in the equivalent of direct current.

        .. math:: U = R(T) \, I + k_t(T) \, \omega

        with R the heat in the copper by the square of the current, so that U I is the power into the motor. What the
        inductance takes is left out.
        """
        resistance = self._copper_heat(x, self._inputs(x, 1.0, 0.0), self._p)
        return resistance * self.current(x, load) + self._torque_constant(x) * self.motor_speed(load)

    @cached_property
    def _copper_heat(self) -> ca.Function:
        """(x, u, p) -> heat in the copper [W]."""
        instances, symbols = self.model.network.effect_instances, self.model.symbols
        of_copper = [self.model.balance.heat_into_ends(one) for one in instances if one.effect.key == "copper_loss"]
        heat = sum((ca.sum1(ca.vertcat(*ends)) for ends in of_copper), start=ca.SX(0))
        return ca.Function("heat", [symbols.x, symbols.u, symbols.p], [heat])

    def pipe_power(self, x: Any, load: Load) -> Any:
        """Heat through the heat pipes [W]; a body's face has no state, so there it is what the sink takes in."""
        sink = self.states.index(SINK)
        if all(place in self.states for place in self._pipes):
            return sum(
                (x[self.states.index(place)] - x[sink]) / self.parameters.symbols[name]
                for place, name in self._pipes.items()
            )
        return self.capacity * self.rates(x, load)[sink] + (x[sink] - self.ambient) / self.resistance

    @property
    def spent(self) -> dict[str, Any]:
        """Mass [kg], volume [m³] and price of motor, gear, pipes, fan and sink."""
        if not self.option.has_sink:
            return self._fixed
        return {name: self._fixed[name] + of for name, of in self.sink.spent(self.capacity, self.resistance).items()}
