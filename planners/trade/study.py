"""A trade study: what is asked, what may be chosen, what must hold; all in SI, temperatures in degC."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.parameters import Parameter
from lptn.basics.places import edge, matching
from lptn.model.network import LinkDeclaration, Network, NodeDeclaration

from .sink import ALUMINIUM, Air, Material, fin_efficiency, fin_mass, sink_volume

Goal = Literal["held_torque", "time_to_limit", "worst_temperature", "mass", "volume", "price"]
Cooling = Literal["none", "passive", "fan"]
GOALS: dict[Goal, tuple[str, str, bool]] = {
    "held_torque": ("held torque", "N*m", True),
    "time_to_limit": ("time to the limit", "s", True),
    "worst_temperature": ("worst winding temperature", "degC", False),
    "mass": ("mass", "kg", False),
    "volume": ("volume", "m^3", False),
    "price": ("price", "", False),
}
"""For each goal its words, its unit, and whether more is better; the unit of prices is the study's currency."""
CURRENCY = "EUR"
"""Of prices, where a study names no other."""
LIMITS = {
    "winding": "degC", "magnet": "degC", "current": "A", "voltage": "V", "speed": "rad/s", "pipe_power": "W",
    "mass": "kg", "volume": "m^3", "price": "",
}  # fmt: skip
"""What may be limited, and its unit; that of prices is the study's currency."""


@dataclass(frozen=True)
class MotorChoice:
    """A motor that may be chosen: its network and what the network does not say.

    Args:
        name: what people call it.
        network: its thermal network without a heat sink, or with one.
        winding: nodes whose temperature the enamel limits.
        magnet: nodes whose mean is taken as the magnets' temperature, which sets the torque constant.
        sink_at: pattern of the nodes, or faces of bodies, that the heat pipes touch; empty without a sink.
        mass: kg.
        volume: m³.
        torque_constant: N·m/A at 25 degC.
        magnet_coefficient: of the torque constant [1/K].
        rotor_inertia: kg m².
        price: `None` where nobody said.
        limits: winding, magnet [degC], current [A] and speed [rad/s] of its data sheet, where known.
        standard_errors: of the network's parameters by name, where its model file was fitted.
    """

    name: str
    network: Network
    winding: tuple[str, ...]
    magnet: tuple[str, ...]
    sink_at: str
    mass: float
    volume: float
    torque_constant: float
    magnet_coefficient: float
    limits: dict[str, float]
    rotor_inertia: float = 0.0
    price: float | None = None
    standard_errors: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Gear:
    """A gearbox between motor and task; the first one of a study without any has the ratio 1.

    Args:
        name: what people call it; empty for none.
        ratio: least and greatest speed of the motor over that of the task; between the two it is sought.
        efficiency: share of the power that passes, from the motor to the load or back.
        mass: kg.
        volume: m³.
        price: `None` where nobody said.
    """

    name: str = ""
    ratio: tuple[float, float] = (1.0, 1.0)
    efficiency: float = 1.0
    mass: float = 0.0
    volume: float = 0.0
    price: float | None = 0.0

    @property
    def is_sought(self) -> bool:
        """Whether the ratio is part of the design."""
        return self.ratio[0] < self.ratio[1]


@dataclass(frozen=True)
class Sink:
    """Within which bounds a heat sink may be built, and what its fins are like.

    Args:
        node: name of the sink's own node.
        capacity: least and greatest heat capacity [J/K].
        resistance: least and greatest resistance to the air [K/W].
        thickness: of a fin [m].
        depth: of a fin, root to tip [m].
        materials: to choose from.
        price: beside that of the metal.
    """

    node: str
    capacity: tuple[float, float]
    resistance: tuple[float, float]
    thickness: float
    depth: float
    materials: tuple[Material, ...] = (ALUMINIUM,)
    price: float = 0.0


@dataclass(frozen=True)
class Pipes:
    """Heat pipes: how many may be chosen; resistance [K/W], power [W], mass [kg], price of each; mount's mass [kg]."""

    counts: tuple[int, ...]
    resistance: float
    power: float
    mass: float
    mount: float
    price: float = 0.0


@dataclass(frozen=True)
class Fan:
    """A fan: its mass with the battery for its runtime [kg], volume [m³], electrical power [W], price."""

    mass: float
    volume: float
    power: float
    price: float = 0.0


@dataclass(frozen=True)
class Task:
    """What torque must be given behind the gear, at which speed, and for how long.

    Args:
        shape: torque in each equal part of a cycle, over its peak, shape (n,); one entry for a hold.
        speed: in each part [rad/s], negative where the load drives the motor, shape (n,); `None` where nobody said.
        torque: its peak [N·m], `None` where it is sought.
        duration: of a hold, or of one cycle [s]; `None` where it is sought.
        cycles: how many cycles from the start, `None` for ever (periodic); 1 for a hold.
        hold: whether torque is held constant.
        longest: a sought duration is not looked for beyond [s].
        ambient: degC.
        start: all nodes at the beginning [degC].
    """

    shape: FloatArray
    torque: float | None
    duration: float | None
    cycles: int | None
    hold: bool
    longest: float
    ambient: float
    start: float
    speed: FloatArray | None = None

    @property
    def speeds(self) -> FloatArray:
        """In each part [rad/s]; standstill where nobody said, shape (n,)."""
        return np.zeros(len(self.shape)) if self.speed is None else self.speed

    @property
    def accelerations(self) -> FloatArray:
        """In each part [rad/s²], from the speeds of its neighbours in a cycle that repeats itself, shape (n,)."""
        if self.hold or self.duration is None or self.speed is None:
            return np.zeros(len(self.shape))
        part = self.duration / len(self.shape)
        return np.asarray((np.roll(self.speed, -1) - np.roll(self.speed, 1)) / (2 * part))

    @property
    def operation(self) -> FloatArray:
        """Share of the peak torque, speed [rad/s] and acceleration [rad/s²] in each part, shape (n, 3)."""
        return np.column_stack([self.shape, self.speeds, self.accelerations])


@dataclass(frozen=True)
class Sweep:
    """Values of one given quantity (a key of `SWEPT`) over which the study is solved again."""

    against: str
    values: tuple[float, ...]


SWEPT: dict[str, int] = {
    "mass": 1, "volume": 1, "price": 1, "voltage": 1, "torque": -1, "duration": -1, "ratio": 0,
}  # fmt: skip
"""What may be swept: 1 where more of it allows more, -1 where more asks for more, 0 where it may do either."""


@dataclass(frozen=True)
class Uncertainty:
    """What is not known for sure.

    Args:
        errors: standard errors by pattern of the parameters' names: the number, and whether it is relative.
        draws: how many times all of them are drawn.
        level: probability of the intervals.
    """

    errors: dict[str, tuple[float, bool]]
    draws: int
    level: float


@dataclass(frozen=True)
class Study:
    """A whole study.

    Args:
        name: what people call it.
        goal: what is made best.
        task: what the motor must do.
        motors: to choose from.
        cooling: to choose from.
        limits: by their names; one that is missing does not bind, or falls back on the motor's own.
        sink: the heat sink.
        pipes: the heat pipes.
        fan: the fan.
        air: film at the fins in still air and under the fan.
        sweep: of the Pareto front, `None` for none.
        gears: to choose from.
        uncertainty: `None` where everything is taken as known.
        origin: the file, for messages.
        currency: of all prices.
    """

    name: str
    goal: Goal
    task: Task
    motors: tuple[MotorChoice, ...]
    cooling: tuple[Cooling, ...]
    limits: dict[str, float]
    sink: Sink
    pipes: Pipes
    fan: Fan
    air: dict[Cooling, Air]
    sweep: Sweep | None = None
    gears: tuple[Gear, ...] = (Gear(),)
    uncertainty: Uncertainty | None = None
    origin: str = "study"
    currency: str = CURRENCY

    @property
    def unit(self) -> str:
        """Of the goal."""
        return GOALS[self.goal][1] or self.currency

    def options(self) -> list[Option]:
        """Every discrete choice: motor, gear, cooling, number of heat pipes, material of the sink."""
        options = []
        for motor, gear, cooling in itertools.product(self.motors, self.gears, self.cooling):
            counts: Sequence[int] = (0,) if cooling == "none" else self.pipes.counts
            materials = self.sink.materials[:1] if cooling == "none" else self.sink.materials
            for count, material in itertools.product(counts, materials):
                options.append(Option(self, motor, cooling, count, gear, material))
        return options

    @property
    def asks_for_prices(self) -> bool:
        """Whether the price is sought, limited or swept."""
        return "price" in (self.goal, *self.limits) or (self.sweep is not None and self.sweep.against == "price")


@dataclass(frozen=True)
class Option:
    """One discrete choice of a study."""

    study: Study
    motor: MotorChoice
    cooling: Cooling
    pipes: int
    gear: Gear = Gear()
    material: Material = ALUMINIUM

    @property
    def name(self) -> str:
        """In words: `U8, 50:1, fan, 4 pipes, copper`; what is no choice is left out."""
        words = [self.motor.name]
        if len(self.study.gears) > 1:
            words.append(self.gear.name)
        words.append("no sink" if self.cooling == "none" else self.cooling)
        if self.has_sink and len(self.study.pipes.counts) > 1:
            words.append(f"{self.pipes} pipes")
        if self.has_sink and len(self.study.sink.materials) > 1:
            words.append(self.material.name)
        return ", ".join(words)

    @property
    def has_sink(self) -> bool:
        return self.cooling != "none"

    @property
    def fixed_mass(self) -> float:
        """Motor, gear, pipes, mount and fan, all but the sink [kg]."""
        pipes = self.study.pipes.mount + self.pipes * self.study.pipes.mass if self.has_sink else 0.0
        return self.motor.mass + self.gear.mass + pipes + (self.study.fan.mass if self.cooling == "fan" else 0.0)

    @property
    def fixed_volume(self) -> float:
        """Motor, gear and fan, all but the sink [m³]; the pipes' is neglected."""
        return self.motor.volume + self.gear.volume + (self.study.fan.volume if self.cooling == "fan" else 0.0)

    @property
    def fixed_price(self) -> float:
        """All but the sink's metal; what has no price counts for nothing."""
        study = self.study
        sink = study.sink.price + self.pipes * study.pipes.price if self.has_sink else 0.0
        fan = study.fan.price if self.cooling == "fan" else 0.0
        return (self.motor.price or 0.0) + (self.gear.price or 0.0) + sink + fan

    def least(self, budget: str) -> float:
        """Mass [kg], volume [m³] or price below which nothing can be built, whatever the temperatures."""
        fixed = {"mass": self.fixed_mass, "volume": self.fixed_volume, "price": self.fixed_price}[budget]
        if not self.has_sink:
            return fixed
        sink, metal, resistance = self.study.sink, self.material, self.study.sink.resistance[1]
        fins = metal.specific_heat * float(fin_mass(resistance, self.film, sink.thickness, metal.density))
        capacity = max(sink.capacity[0], fins)
        if budget != "volume":
            return fixed + capacity / metal.specific_heat * (1.0 if budget == "mass" else metal.price or 0.0)
        spacing = self.study.air[self.cooling].spacing
        return fixed + float(sink_volume(capacity, resistance, self.film, sink.thickness, spacing,
                                         metal.density, metal.specific_heat))  # fmt: skip

    @property
    def film(self) -> float:
        """Film coefficient times fin efficiency [W/(m² K)]."""
        film, sink = self.study.air[self.cooling].film, self.study.sink
        return film * fin_efficiency(film, sink.thickness, sink.depth, self.material.conductivity)

    @property
    def limits(self) -> dict[str, float]:
        """The study's limits; where it says nothing, the motor's, and the heat pipes' own."""
        own = dict(self.motor.limits)
        if self.study.goal == "worst_temperature":
            own.pop("winding", None)  # what is sought is not limited unless the study says so
        if self.has_sink:
            own["pipe_power"] = self.pipes * self.study.pipes.power
        limits = own | self.study.limits
        if not self.has_sink:
            limits.pop("pipe_power", None)
        return limits

    def network(self) -> Network:
        """The motor's network with the sink on it, or as it is.

        Several places that the heat pipes touch share them evenly.

        Raises:
            InputError: the network has a sink's node that is not linked as a sink's is.
        """
        if not self.has_sink:
            return self.motor.network
        network, sink, at = self.motor.network, self.study.sink, self.motor.sink_at
        touched = pipe_places(network, at)
        resistance = self.study.pipes.resistance / self.pipes * len(touched)
        if sink.node in network.dynamic:
            pipes = [edge(place, sink.node) for place in touched]
            linked = {link.place for link in network.resistors}
            absent = [pipe for pipe in pipes if pipe not in linked]
            if absent:
                where = f"{sink.node} without a link to {at}"
                raise InputError(self.study.origin, "sink.node", where, f"a link {absent[0]}")
            return network.with_values({f"resistance.{pipe}": resistance for pipe in pipes})
        air = next(iter(network.prescribed))
        added = NodeDeclaration(sink.node, _parameter("capacity", 300.0, "J/K"))
        links = (
            LinkDeclaration((at, sink.node), replace(_parameter("resistance", resistance, "K/W"), share="all")),
            LinkDeclaration((sink.node, air), _parameter("resistance", 1.0, "K/W")),
        )
        return replace(network, nodes=(*network.nodes, added), links=(*network.links, *links))


def attachable(network: Network) -> list[str]:
    """Places that a heat pipe may touch: dynamic nodes; of a node with a body its faces (`"housing.outer"`)."""
    faces = {
        name: [f"{name}.{face}" for face in node.element.shape.faces]
        for node in network.nodes
        if node.element is not None
        for name in matching(node.pattern, network.dynamic)
    }
    return [place for name in network.dynamic for place in faces.get(name, [name])]


def pipe_places(network: Network, at: str) -> list[str]:
    """The nodes or faces that heat pipes at `at` touch; only a pattern with a dot means faces, as in a link."""
    return [place for place in matching(at, attachable(network)) if ("." in place) == ("." in at)]


def _parameter(name: str, value: float, unit: str) -> Parameter:
    return Parameter(name, value, unit, (1e-9, math.inf), typical=value)
