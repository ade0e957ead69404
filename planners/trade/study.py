"""A trade study: what is asked, what may be chosen, what must hold; all in SI, temperatures in degC."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.parameters import Parameter
from lptn.basics.places import edge, matching
from lptn.model.network import LinkDeclaration, Network, NodeDeclaration

from .sink import SPECIFIC_HEAT, Air, fin_efficiency, fin_mass, sink_volume

Goal = Literal["held_torque", "time_to_limit", "worst_temperature", "mass", "volume"]
Cooling = Literal["none", "passive", "fan"]
GOALS: dict[Goal, tuple[str, str, bool]] = {
    "held_torque": ("held torque", "N*m", True),
    "time_to_limit": ("time to the limit", "s", True),
    "worst_temperature": ("worst winding temperature", "degC", False),
    "mass": ("mass", "kg", False),
    "volume": ("volume", "m^3", False),
}
"""For each goal its words, its unit, and whether more is better."""
LIMITS = {
    "winding": "degC", "magnet": "degC", "current": "A", "pipe_power": "W", "mass": "kg", "volume": "m^3",
}  # fmt: skip
"""What may be limited, and its unit."""


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
        limits: winding, magnet [degC] and current [A] of its data sheet, where known.
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


@dataclass(frozen=True)
class Sink:
    """Within which bounds a heat sink may be built, and what its fins are like.

    Args:
        node: name of the sink's own node.
        capacity: least and greatest heat capacity [J/K].
        resistance: least and greatest resistance to the air [K/W].
        thickness: of a fin [m].
        depth: of a fin, root to tip [m].
    """

    node: str
    capacity: tuple[float, float]
    resistance: tuple[float, float]
    thickness: float
    depth: float


@dataclass(frozen=True)
class Pipes:
    """Heat pipes: how many may be chosen; resistance [K/W], power [W], mass [kg] of each; mass of their mount [kg]."""

    counts: tuple[int, ...]
    resistance: float
    power: float
    mass: float
    mount: float


@dataclass(frozen=True)
class Fan:
    """A fan: its mass with the battery for its runtime [kg], volume [m³], electrical power [W]."""

    mass: float
    volume: float
    power: float


@dataclass(frozen=True)
class Task:
    """What torque the motor must give, and for how long.

    Args:
        shape: torque in each equal part of a cycle, over its peak, shape (n,); one entry for a hold.
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


@dataclass(frozen=True)
class Sweep:
    """Values of one given quantity (mass, volume, torque, duration) over which the study is solved again."""

    against: str
    values: tuple[float, ...]


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
        origin: the file, for messages.
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
    origin: str = "study"

    def options(self) -> list[Option]:
        """Every discrete choice: motor, cooling, number of heat pipes."""
        options = []
        for motor in self.motors:
            for cooling in self.cooling:
                counts: Sequence[int] = (0,) if cooling == "none" else self.pipes.counts
                options += [Option(self, motor, cooling, count) for count in counts]
        return options


@dataclass(frozen=True)
class Option:
    """One discrete choice of a study."""

    study: Study
    motor: MotorChoice
    cooling: Cooling
    pipes: int

    @property
    def name(self) -> str:
        """In words: `U8, fan, 4 pipes`."""
        if self.cooling == "none":
            return f"{self.motor.name}, no sink"
        return f"{self.motor.name}, {self.cooling}" + (
            f", {self.pipes} pipes" if len(self.study.pipes.counts) > 1 else ""
        )

    @property
    def has_sink(self) -> bool:
        return self.cooling != "none"

    @property
    def fixed_mass(self) -> float:
        """Motor, pipes, mount and fan, all but the sink [kg]."""
        pipes = self.study.pipes.mount + self.pipes * self.study.pipes.mass if self.has_sink else 0.0
        return self.motor.mass + pipes + (self.study.fan.mass if self.cooling == "fan" else 0.0)

    @property
    def fixed_volume(self) -> float:
        """Motor and fan, all but the sink [m³]; the pipes' is neglected."""
        return self.motor.volume + (self.study.fan.volume if self.cooling == "fan" else 0.0)

    def least(self, budget: str) -> float:
        """Mass [kg] or volume [m³] below which nothing can be built, whatever the temperatures."""
        fixed = self.fixed_mass if budget == "mass" else self.fixed_volume
        if not self.has_sink:
            return fixed
        sink, resistance = self.study.sink, self.study.sink.resistance[1]
        capacity = max(sink.capacity[0], SPECIFIC_HEAT * fin_mass(resistance, self.film, sink.thickness))
        if budget == "mass":
            return fixed + float(capacity) / SPECIFIC_HEAT
        spacing = self.study.air[self.cooling].spacing
        return fixed + float(sink_volume(capacity, resistance, self.film, sink.thickness, spacing))

    @property
    def film(self) -> float:
        """Film coefficient times fin efficiency [W/(m² K)]."""
        film, sink = self.study.air[self.cooling].film, self.study.sink
        return film * fin_efficiency(film, sink.thickness, sink.depth)

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
