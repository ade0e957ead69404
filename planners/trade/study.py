"""A trade study: the tables of its file, which are checked as they are read, and its discrete choices.

All in SI, temperatures in degC. A field's type has its unit and its bounds, its comment what it means.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    field_validator,
)

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.parameters import Parameter
from lptn.basics.places import edge, matching
from lptn.basics.toml import Number, Strict
from lptn.effects import catalogue
from lptn.model.network import EffectDeclaration, LinkDeclaration, Network, NodeDeclaration
from lptn.model.tables import EffectTable

from .. import values as si
from .curves import EfficiencyMap, FanCurve, Share
from .motors import CatalogueMotor, MotorLimits
from .sink import MATERIALS, SinkMetal, SinkNumbers, blown_air, fan_driven_air, fin_efficiency, still_air

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
SINK = "sink"
"""The heat sink's node; a motor's own model may have one."""
BUDGETS: tuple[str, ...] = ("mass", "volume", "price")
"""What a design spends."""
GEAR = "gear"
"""Whose heat drives an effect at the place that a gear heats: its column is `power.gear`."""
LIMITS = {
    "winding": "degC", "magnet": "degC", "current": "A", "voltage": "V", "speed": "rad/s", "pipe_power": "W",
    "mass": "kg", "volume": "m^3", "price": "",
}  # fmt: skip
"""What may be limited, and its unit; that of prices is the study's currency."""


class Swept(NamedTuple):
    """A quantity that may be swept: its type, its unit; 1 where more of it allows more, -1 less, 0 either."""

    kind: Any
    unit: str
    eases: int


SWEPT = {
    "mass": Swept(si.Mass, "kg", 1),
    "volume": Swept(si.Volume, "m^3", 1),
    "price": Swept(si.Positive, "", 1),
    "voltage": Swept(si.Voltage, "V", 1),
    "torque": Swept(si.Torque, "N*m", -1),
    "duration": Swept(si.Seconds, "s", -1),
    "ratio": Swept(si.Positive, "revolutions of the motor by one of the load", 0),
}
"""What may be swept, by name; the unit of prices is the study's currency."""


# --- kinds of values ----------------------------------------------------------------------------


def _standard_error(given: Any) -> StandardError:
    is_absolute = isinstance(given, dict) and set(given) == {"value", "unit"}
    number = given["value"] if is_absolute else given
    if is_absolute and given["unit"] not in ("K", "SI"):
        raise ValueError('unit = "K", or "SI" for a number in SI units')
    if isinstance(number, bool) or not isinstance(number, int | float) or not 0 <= number < math.inf:
        raise ValueError('a relative standard error such as 0.1, or { value = 3, unit = "K" }')
    return StandardError(float(number), not is_absolute)


class StandardError(NamedTuple):
    """Of a parameter: in its unit, or as a share of its value."""

    size: float
    is_relative: bool


Of = TypeVar("Of")
Names = Annotated[
    list[Of],
    AfterValidator(lambda values: list(dict.fromkeys(values))),
    BeforeValidator(lambda given: [given] if isinstance(given, str) else given),
]
"""Each once; one name is a list of it."""
Choices = Annotated[Names[Of], Field(min_length=1)]
"""What may be chosen."""
Parts = Annotated[list[Of], Field(min_length=2, max_length=400)]
"""A number for each equal part of a duty cycle."""


# --- tables of the file -------------------------------------------------------------------------


class Question(Strict):
    """Table `[study]`: what is made best, and between which kinds of cooling."""

    name: str = "study"
    goal: Goal
    cooling: Choices[Cooling] = Field(default=["none", "passive", "fan"])
    catalogue: Names[str] = Field(default=[])  # files of motors beside the study's
    currency: Annotated[str, Field(pattern=r"^\S{1,8}$")] = "EUR"  # of all prices


class DutyTask(Strict):
    """Table `[task]`: what torque must be given behind the gear, at which speed, and for how long."""

    kind: Literal["hold", "cycle"] = "hold"
    torque: si.Torque | None = None  # of a hold; none where it is sought
    profile: Parts[si.NotNegative] | None = None  # N*m, of a cycle
    duration: si.Seconds | None = None  # of a hold; none where it is sought
    longest: si.Seconds = 3600.0  # a sought duration is not looked for beyond
    ambient: si.Celsius = 25.0
    start: si.Celsius = Field(default_factory=lambda said: said.get("ambient"))  # all nodes at the beginning
    period: si.Seconds | None = None  # of one cycle
    cycles: Annotated[int, Field(ge=1, le=100, strict=True)] | None = None  # from the start; none for ever (periodic)
    speed: si.AnySpeed = 0.0  # of a hold; negative where the load drives the motor
    speeds: Parts[si.AnySpeed] | None = None  # of a cycle; none where nobody said
    inputs: dict[str, Number] = Field(default={})  # by column, SI: what else effects read, such as "speed.base"

    @property
    def is_hold(self) -> bool:
        """Whether torque is held constant."""
        return self.kind == "hold"

    @property
    def repeats(self) -> int | None:
        """How many cycles from the start, `None` for ever; 1 for a hold."""
        return 1 if self.is_hold else self.cycles

    @property
    def time(self) -> float | None:
        """Of a hold, or of one cycle [s]; `None` where it is sought."""
        return self.duration if self.is_hold else self.period

    @property
    def torques(self) -> FloatArray:
        """In each equal part of a cycle [N·m], shape (n,); 1 for a hold."""
        return np.array([1.0] if self.profile is None else self.profile)

    @property
    def shape(self) -> FloatArray:
        """Torque in each part over its peak, shape (n,)."""
        return np.asarray(self.torques / self.torques.max())

    @property
    def motion(self) -> FloatArray:
        """Speed in each part [rad/s], standstill where nobody said, shape (n,)."""
        if self.is_hold:
            return np.array([self.speed])
        return np.zeros(len(self.torques)) if self.speeds is None else np.array(self.speeds, dtype=float)

    @property
    def accelerations(self) -> FloatArray:
        """In each part [rad/s²], from the speeds of its neighbours in a cycle that repeats itself, shape (n,)."""
        if self.is_hold or self.time is None:
            return np.zeros(len(self.torques))
        speed = self.motion
        return np.asarray((np.roll(speed, -1) - np.roll(speed, 1)) / (2 * self.time / len(speed)))

    @property
    def operation(self) -> FloatArray:
        """Share of the peak torque, speed [rad/s] and acceleration [rad/s²] in each part, shape (n, 3)."""
        return np.column_stack([self.shape, self.motion, self.accelerations])


class Limits(MotorLimits):
    """Table `[limits]`: what must hold; what it leaves out does not bind, or falls back on the motor's data sheet."""

    voltage: si.Voltage | None = None
    mass: si.Mass | None = None
    volume: si.Volume | None = None
    price: si.Positive | None = None


class Gear(Strict):
    """Table `[[gears]]`: a gearbox between motor and task."""

    name: str
    ratio: si.Span[si.Positive]  # speed of the motor over that of the task
    efficiency: Share = 1.0  # of the power, from the motor to the load or back; a factor on the map where there is one
    map: EfficiencyMap | None = None
    heats: str | None = None  # the motor's node that takes up what the gear loses; none: it stays in the gear
    mass: si.ExtraMass = 0.0
    volume: si.ExtraVolume = 0.0
    price: si.NotNegative | None = None

    @property
    def is_sought(self) -> bool:
        """Whether the ratio is part of the design."""
        return self.ratio[0] < self.ratio[1]


NO_GEAR = Gear(name="", ratio=[1.0, 1.0], price=0.0)
"""The only one of a study without any."""


class Sink(Strict):
    """Table `[sink]`: within which bounds a heat sink may be built, and what its fins are like."""

    at: str | None = None  # what the heat pipes touch, a node, a body's face or a pattern, where the motor doesn't say
    material: Choices[str] = Field(default=["aluminium"])
    price: si.NotNegative = 0.0  # of making it, beside its metal
    capacity: si.Ends[si.Capacity] = Field(default=[20.0, 1500.0])
    resistance: si.Ends[si.Resistance] = Field(default=[0.05, 10.0])  # to the air
    fin_thickness: si.Length = 1e-3
    fin_depth: si.Length = 0.03  # root to tip
    fin_height: si.Length = 0.08  # along the air
    excess: si.Kelvins = 30.0  # fins above still air

    def grid(self, points: int) -> tuple[FloatArray, FloatArray]:
        """Capacities [J/K] and resistances [K/W] between the bounds, evenly on logarithmic axes, each (points,)."""
        (least_c, most_c), (least_r, most_r) = self.capacity, self.resistance
        return np.geomspace(least_c, most_c, points), np.geomspace(least_r, most_r, points)


class Pipes(Strict):
    """Table `[pipes]`: the heat pipes between motor and sink."""

    count: Choices[Annotated[int, Field(ge=1, le=64, strict=True)]] = Field(default=[4])
    resistance: si.Resistance = 0.708  # each, with its contacts: four make the 0.177 K/W of the thesis's exchanger
    power: si.Power = 65.0  # each; [Chen2017, appendix A.4]
    mass: si.ExtraMass = 0.03  # each; assumed
    mount: si.ExtraMass = 0.06  # the insert that holds them; assumed
    price: si.NotNegative = 0.0  # each


class SinkFan(Strict):
    """Table `[fan]`: a fan and its battery."""

    mass: si.ExtraMass = 0.05
    volume: si.ExtraVolume = 1e-4
    power: si.ExtraPower = 2.0  # electrical
    speed: si.Speed = 3.0  # of the air between the fins, where no curve says it
    curve: FanCurve | None = None
    runtime: si.Runtime = 0.0
    battery: si.SpecificEnergy = 5.4e5  # 150 W·h/kg
    price: si.NotNegative = 0.0

    @property
    def mass_with_battery(self) -> float:
        """With the battery for its runtime [kg]."""
        return self.mass + self.power * self.runtime / self.battery


class Inverter(Strict):
    """Table `[inverter]`: what the drive adds; its heat is an effect."""

    mass: si.ExtraMass = 0.0
    volume: si.ExtraVolume = 0.0
    price: si.NotNegative = 0.0


class Axis(Strict):
    """Values of a given quantity over which the study is solved again."""

    against: Literal["mass", "volume", "price", "voltage", "torque", "duration", "ratio"] = "mass"
    least: float
    most: float
    points: Annotated[int, Field(ge=2, le=200, strict=True)] = 12

    @field_validator("least", "most", mode="plain")
    @classmethod
    def _end(cls, given: Any, info: ValidationInfo) -> Any:
        """In the unit of what is swept."""
        swept = SWEPT.get(info.data.get("against", ""))
        if swept is None:
            return given
        try:
            return float(TypeAdapter(swept.kind).validate_python(given))
        except ValidationError as error:
            raise ValueError(f"a number above 0 in {swept.unit or 'the currency'}") from error

    @property
    def values(self) -> FloatArray:
        """In the unit of what is swept, ascending, shape (points,)."""
        return np.linspace(self.least, self.most, self.points)


class Sweep(Axis):
    """Table `[pareto]`: one quantity, or two."""

    also: Axis | None = None

    @property
    def axes(self) -> list[Axis]:
        """One or two."""
        return [self] if self.also is None else [self, self.also]


class StudyUncertainty(Strict):
    """Table `[uncertainty]`: what is not known for sure."""

    draws: Annotated[int, Field(ge=8, le=4096, strict=True)] = 128  # of all of them; 4096 take an hour
    level: Annotated[Number, Field(ge=0.5, lt=1)] = 0.95  # probability of the intervals
    errors: dict[str, Annotated[StandardError, PlainValidator(_standard_error)]] = Field(default={})  # by pattern


# --- a study -------------------------------------------------------------------------------------


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

    mass: si.Mass
    volume: si.Volume
    torque_constant: si.TorqueConstant
    network: Network
    winding_nodes: tuple[str, ...]
    magnet_nodes: tuple[str, ...]
    sink_at: str
    standard_errors: dict[str, float]


def _with_known_metals(tables: Any) -> Any:
    """Metals of a study over those that are known; of a known one it may change single numbers."""
    if not isinstance(tables, Mapping):
        return tables
    known = {name: metal.model_dump() for name, metal in MATERIALS.items()}
    return known | {n: known.get(n, {}) | dict(t) if isinstance(t, Mapping) else t for n, t in tables.items()}


class StudyTables(Strict):
    """All tables of a study file, with motors as the file has them."""

    question: Question = Field(alias="study")
    task: DutyTask = DutyTask()
    limits: Limits = Limits()
    motors: Annotated[list[CatalogueMotor], Field(min_length=1)]
    sink: Sink = Sink()
    gears: Annotated[list[Gear], Field(min_length=1)] = Field(default=[NO_GEAR])
    materials: Annotated[dict[str, SinkMetal], BeforeValidator(_with_known_metals)] = Field(default=MATERIALS)
    pipes: Pipes = Pipes()
    fan: SinkFan = SinkFan()
    inverter: Inverter = Inverter()
    effects: list[EffectTable] = Field(default=[])  # of every choice, as in a model file; at "sink" where there is one
    sweep: Sweep | None = Field(default=None, alias="pareto")  # of the Pareto front
    uncertainty: StudyUncertainty | None = None  # none where everything is taken as known


class TradeStudy(StudyTables):
    """A whole study, with its motors found; `origin` is its file, for messages, `files` are those that it names."""

    model_config = ConfigDict(populate_by_name=True, arbitrary_types_allowed=True)

    motors: list[MotorChoice]  # type: ignore[assignment]  # those of the tables, found
    effects: list[EffectDeclaration]  # type: ignore[assignment]
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
            metals = self.sink.material[:1] if cooling == "none" else self.sink.material
            for count, metal in itertools.product(counts, metals):
                options.append(Option(self, motor, cooling, count, gear, metal))
        return options

    @property
    def asks_for_prices(self) -> bool:
        """Whether the price is sought, limited or swept."""
        swept = [] if self.sweep is None else [axis.against for axis in self.sweep.axes]
        return self.question.goal == "price" or self.limits.price is not None or "price" in swept


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
        if self.has_sink and len(self.study.sink.material) > 1:
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
        parts = [(part.mass, part.volume, part.price or 0.0) for part in (self.motor, self.gear, self.study.inverter)]
        if self.has_sink:
            parts.append((pipes.mount + self.pipes * pipes.mass, 0.0, self.study.sink.price + self.pipes * pipes.price))
        if self.cooling == "fan":
            parts.append((fan.mass_with_battery, fan.volume, fan.price))
        return dict(zip(BUDGETS, map(sum, zip(*parts, strict=True)), strict=True))

    def least(self, budget: str) -> float:
        """Mass [kg], volume [m³] or price below which nothing can be built, whatever the temperatures."""
        if not self.has_sink:
            return self.fixed[budget]
        resistance = self.study.sink.resistance[1]
        numbers = self.sink(resistance)
        capacity = max(self.study.sink.capacity[0], numbers.specific_heat * numbers.fin_mass(resistance))
        return self.fixed[budget] + float(numbers.spent(capacity, resistance)[budget])

    def sink(self, resistance: Any) -> SinkNumbers:
        """What a sink of a resistance [K/W], a number or a symbol, would be made of, in the air of its cooling.

        Natural convection as an effect starts from a sink as warm as the air, where the film is less than at `excess`.
        """
        sink, fan, metal = self.study.sink, self.study.fan, self.metal
        fins = sink.fin_thickness, sink.fin_depth, metal.conductivity
        if self.cooling == "fan" and fan.curve is not None:
            flow, pressure = np.array(fan.curve.flow), np.array(fan.curve.pressure)
            used, spacing = fan_driven_air(resistance, flow, pressure, sink.fin_height, *fins)
        else:
            is_blown = self.cooling == "fan"
            air = blown_air(fan.speed, sink.fin_height) if is_blown else still_air(sink.excess, sink.fin_height)
            used, spacing = air.film * fin_efficiency(air.film, *fins), air.spacing
        rises = [effect.resolved["beta"].value for effect in self._effects if _is_film_of_sink(effect)]
        used *= math.exp(-sink.excess * sum(rises))
        return SinkNumbers(used, sink.fin_thickness, spacing, metal.density, metal.specific_heat, metal.price or 0.0)

    @property
    def limits(self) -> dict[str, float]:
        """The study's limits; where it says nothing, the motor's, and the heat pipes' own."""
        own = self.motor.limits.given
        if self.study.question.goal == "worst_temperature":
            own.pop("winding", None)  # what is sought is not limited unless the study says so
        if self.has_sink:
            own["pipe_power"] = self.pipes * self.study.pipes.power
        return own | self.study.limits.given

    @property
    def _effects(self) -> list[EffectDeclaration]:
        """Of the study; what a fan blows at has no film of its own warmth."""
        return [effect for effect in self.study.effects if self.cooling != "fan" or not _is_film_of_sink(effect)]

    def network(self) -> Network:
        """The motor's network with the sink on it, or as it is, and the effects of study and gear.

        Raises:
            InputError: the network has a sink's node that is not linked as a sink's is, or no place for an effect.
        """
        network, gear = self._with_sink(), self.gear
        effects = [effect for effect in self._effects if effect.at != SINK or SINK in network.dynamic]
        if gear.heats is not None:
            gain = Parameter("gain", 1.0, "1", (0.0, 1.0))
            heat = catalogue()["heat_input"]()
            effects.append(EffectDeclaration(heat, gear.heats, (gain,), label="gear_heat", driven_by=GEAR))
        return replace(network, effects=(*effects, *network.effects), origin=self.study.origin) if effects else network

    def _with_sink(self) -> Network:
        """Several places that the heat pipes touch share them evenly."""
        if not self.has_sink:
            return self.motor.network
        network, at = self.motor.network, self.motor.sink_at
        touched = pipe_places(network, at)
        resistance = self.study.pipes.resistance / self.pipes * len(touched)
        if SINK in network.dynamic:
            pipes = [edge(place, SINK) for place in touched]
            linked = {link.place for link in network.resistors}
            absent = [pipe for pipe in pipes if pipe not in linked]
            if absent:
                found = f"a node {SINK} without a link to {at}"
                raise InputError(network.origin, "links", found, f"a link {absent[0]}")
            return network.with_values({f"resistance.{pipe}": resistance for pipe in pipes})
        air = next(iter(network.prescribed))
        added = NodeDeclaration(SINK, _parameter("capacity", 300.0, "J/K"))
        links = (
            LinkDeclaration((at, SINK), replace(_parameter("resistance", resistance, "K/W"), share="all")),
            LinkDeclaration((SINK, air), _parameter("resistance", 1.0, "K/W")),
        )
        return replace(network, nodes=(*network.nodes, added), links=(*network.links, *links))


def _is_film_of_sink(effect: EffectDeclaration) -> bool:
    return effect.at == SINK and effect.effect.key == "natural_convection"


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
