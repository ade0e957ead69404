"""A trade study: its tables with the motors found, and each discrete choice with its network."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Generic, TypeVar

from pydantic import BeforeValidator, ConfigDict, Field

from lptn.basics.errors import InputError
from lptn.basics.parameters import Parameter
from lptn.basics.places import edge, matching
from lptn.basics.toml import Strict
from lptn.model.network import LinkDeclaration, Network, NodeDeclaration

from ..values import Mass, TorqueConstant, Volume
from .motors import CatalogueMotor
from .sink import MATERIALS, SinkMetal, SinkNumbers, blown_air, fin_efficiency, still_air
from .tables import (
    BUDGETS,
    GOALS,
    NO_GEAR,
    Cooling,
    DutyTask,
    Gear,
    Limits,
    Pipes,
    Question,
    Sink,
    SinkFan,
    StudyUncertainty,
    Sweep,
)


class MotorChoice(CatalogueMotor):
    """A motor that may be chosen: a table `[[motors]]` over the catalogue's, its network, and its nodes by their part.

    Args:
        network: its thermal network without a heat sink, or with one.
        winding_nodes: nodes whose temperature the enamel limits.
        magnet_nodes: nodes whose mean is taken as the magnets' temperature, which sets the torque constant.
        sink_at: pattern of the nodes, or faces of bodies, that the heat pipes touch; empty without a sink.
        standard_errors: of the network's parameters by name, where its model file was fitted.
    """

    model_config = ConfigDict(arbitrary_types_allowed=True)

    mass: Mass
    volume: Volume
    torque_constant: TorqueConstant
    network: Network
    winding_nodes: tuple[str, ...]
    magnet_nodes: tuple[str, ...]
    sink_at: str
    standard_errors: dict[str, float]


def _with_known_metals(tables: Any) -> Any:
    """Metals of a study over those that are known; of a known one it may change single numbers."""
    if not isinstance(tables, Mapping):
        return tables
    own = {
        name: {**(MATERIALS[name].model_dump() if name in MATERIALS else {}), **table}
        if isinstance(table, Mapping)
        else table
        for name, table in tables.items()
    }
    return MATERIALS | own


Motor = TypeVar("Motor", bound=CatalogueMotor)


class StudyTables(Strict, Generic[Motor]):
    """All tables of a study file, with motors as the file has them or as they were found."""

    question: Question = Field(alias="study")
    task: DutyTask = DutyTask()
    limits: Limits = Limits()
    motors: Annotated[list[Motor], Field(min_length=1)]
    sink: Sink = Sink()
    gears: Annotated[list[Gear], Field(min_length=1)] = Field(default=[NO_GEAR])
    materials: Annotated[dict[str, SinkMetal], BeforeValidator(_with_known_metals)] = Field(default=MATERIALS)
    pipes: Pipes = Pipes()
    fan: SinkFan = SinkFan()
    sweep: Sweep | None = Field(default=None, alias="pareto")  # of the Pareto front
    uncertainty: StudyUncertainty | None = None  # none where everything is taken as known


class TradeStudy(StudyTables[MotorChoice]):
    """A whole study, with its motors found; `origin` is its file, for messages, `files` are those that it names."""

    model_config = ConfigDict(populate_by_name=True)

    origin: str
    files: tuple[Path, ...] = ()

    @property
    def goal(self) -> tuple[str, str, bool]:
        """What is sought in words, its unit, and whether more of it is better."""
        words, unit, more = GOALS[self.question.goal]
        return words, unit or self.question.currency, more

    @property
    def torque(self) -> float | None:
        """Peak torque behind the gear [N·m], `None` where it is sought."""
        if self.question.goal == "held_torque":
            return None
        return self.task.torque if self.task.is_hold else float(self.task.torques.max())

    def options(self) -> list[Option]:
        """Every discrete choice: motor, gear, cooling, number of heat pipes, material of the sink."""
        options = []
        for motor, gear, cooling in itertools.product(self.motors, self.gears, self.question.cooling):
            counts = [0] if cooling == "none" else self.pipes.count
            metals = self.sink.metals[:1] if cooling == "none" else self.sink.metals
            for count, metal in itertools.product(counts, metals):
                options.append(Option(self, motor, cooling, count, gear, metal))
        return options

    @property
    def asks_for_prices(self) -> bool:
        """Whether the price is sought, limited or swept."""
        is_swept = self.sweep is not None and self.sweep.against == "price"
        return self.question.goal == "price" or self.limits.price is not None or is_swept


@dataclass(frozen=True)
class Option:
    """One discrete choice of a study."""

    study: TradeStudy
    motor: MotorChoice
    cooling: Cooling
    pipes: int
    gear: Gear
    material: str

    @property
    def metal(self) -> SinkMetal:
        """Of the sink."""
        return self.study.materials[self.material]

    @property
    def name(self) -> str:
        """In words: `U8, 50:1, fan, 4 pipes, copper`; what is no choice is left out."""
        words = [self.motor.name]
        if len(self.study.gears) > 1:
            words.append(self.gear.name)
        words.append("no sink" if self.cooling == "none" else self.cooling)
        if self.has_sink and len(self.study.pipes.count) > 1:
            words.append(f"{self.pipes} pipes")
        if self.has_sink and len(self.study.sink.metals) > 1:
            words.append(self.material)
        return ", ".join(words)

    @property
    def has_sink(self) -> bool:
        return self.cooling != "none"

    @property
    def fixed(self) -> dict[str, float]:
        """Mass [kg], volume [m³] and price of all but the sink; what has no price counts for nothing.

        The heat pipes' volume is neglected.
        """
        pipes, fan = self.study.pipes, self.study.fan
        parts = [(part.mass, part.volume, part.price or 0.0) for part in (self.motor, self.gear)]
        if self.has_sink:
            parts.append((pipes.mount + self.pipes * pipes.mass, 0.0, self.study.sink.price + self.pipes * pipes.price))
        if self.cooling == "fan":
            parts.append((fan.mass_with_battery, fan.volume, fan.price))
        return dict(zip(BUDGETS, map(sum, zip(*parts, strict=True)), strict=True))

    def least(self, budget: str) -> float:
        """Mass [kg], volume [m³] or price below which nothing can be built, whatever the temperatures."""
        if not self.has_sink:
            return self.fixed[budget]
        numbers, resistance = self.sink, self.study.sink.resistance[1]
        capacity = max(self.study.sink.capacity[0], numbers.specific_heat * numbers.fin_mass(resistance))
        return self.fixed[budget] + float(numbers.spent(capacity, resistance)[budget])

    @property
    def sink(self) -> SinkNumbers:
        """What its sink would be made of, in the air of its cooling."""
        sink, fan, metal = self.study.sink, self.study.fan, self.metal
        is_blown = self.cooling == "fan"
        air = blown_air(fan.speed, sink.fin_height) if is_blown else still_air(sink.excess, sink.fin_height)
        used = fin_efficiency(air.film, sink.fin_thickness, sink.fin_depth, metal.conductivity)
        return SinkNumbers(
            air.film * used, sink.fin_thickness, air.spacing, metal.density, metal.specific_heat, metal.price or 0.0
        )

    @property
    def limits(self) -> dict[str, float]:
        """The study's limits; where it says nothing, the motor's, and the heat pipes' own."""
        own = self.motor.limits.given
        if self.study.question.goal == "worst_temperature":
            own.pop("winding", None)  # what is sought is not limited unless the study says so
        if self.has_sink:
            own["pipe_power"] = self.pipes * self.study.pipes.power
        limits = own | self.study.limits.given
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
