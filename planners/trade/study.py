"""A trade study: what is asked, what may be chosen, what must hold; all in SI, temperatures in degC."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from lptn.errors import InputError
from lptn.network import LinkDeclaration, Network, NodeDeclaration
from lptn.parameters import Parameter
from lptn.places import edge

from .parts import Fan, MotorChoice, Pipes, Sink, Sweep, Task
from .schema import Cooling, Goal
from .sink import SPECIFIC_HEAT, Air, fin_efficiency, fin_mass, sink_volume

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
        found = []
        for motor in self.motors:
            for cooling in self.cooling:
                counts: Sequence[int] = (0,) if cooling == "none" else self.pipes.counts
                found += [Option(self, motor, cooling, count) for count in counts]
        return found


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
        found = own | self.study.limits
        if not self.has_sink:
            found.pop("pipe_power", None)
        return found

    def network(self) -> Network:
        """The motor's network with the sink on it, or as it is.

        Raises:
            InputError: the network has a sink's node that is not linked as a sink's is.
        """
        if not self.has_sink:
            return self.motor.network
        network, sink = self.motor.network, self.study.sink
        resistance = self.study.pipes.resistance / self.pipes
        inner = edge(sink.at, sink.node)
        if sink.node in network.dynamic:
            if inner not in {link.place for link in network.resistors}:
                raise InputError(
                    self.study.origin, "sink.node", f"{sink.node} without a link to {sink.at}", f"a link {inner}"
                )
            return network.with_values({f"resistance.{inner}": resistance})
        air = next(iter(network.prescribed))
        added = NodeDeclaration(sink.node, _parameter("capacity", 300.0, "J/K"))
        links = (
            LinkDeclaration((sink.at, sink.node), _parameter("resistance", resistance, "K/W")),
            LinkDeclaration((sink.node, air), _parameter("resistance", 1.0, "K/W")),
        )
        return replace(network, nodes=(*network.nodes, added), links=(*network.links, *links))


def _parameter(name: str, value: float, unit: str) -> Parameter:
    return Parameter(name, value, unit, (1e-9, math.inf), typical=value)
