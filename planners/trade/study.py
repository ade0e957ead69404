"""A trade study: what is asked, what may be chosen, what must hold; all in SI, temperatures in degC.

The tables of a study file are the classes here: a field's type has its unit and its bounds, its comment what it means.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Generic, Literal, NamedTuple, TypeVar

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
from lptn.model.network import LinkDeclaration, Network, NodeDeclaration

from ..values import (
    AnySpeed,
    Capacity,
    Celsius,
    ExtraMass,
    ExtraPower,
    ExtraVolume,
    Kelvins,
    Length,
    Mass,
    NotNegative,
    Positive,
    Power,
    Resistance,
    Runtime,
    Seconds,
    SpecificEnergy,
    Speed,
    Torque,
    TorqueConstant,
    Voltage,
    Volume,
)
from . import profiles
from .catalogue import MotorLimits, MotorTable
from .sink import MATERIALS, Air, Material, blown_air, fin_efficiency, fin_mass, sink_volume, still_air

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
    "mass": Swept(Mass, "kg", 1),
    "volume": Swept(Volume, "m^3", 1),
    "price": Swept(Positive, "", 1),
    "voltage": Swept(Voltage, "V", 1),
    "torque": Swept(Torque, "N*m", -1),
    "duration": Swept(Seconds, "s", -1),
    "ratio": Swept(Positive, "revolutions of the motor by one of the load", 0),
}
"""What may be swept, by name; the unit of prices is the study's currency."""


# --- kinds of values ----------------------------------------------------------------------------


def _ascending(ends: list[float]) -> list[float]:
    if not ends[0] <= ends[1]:
        raise ValueError("[least, greatest]")
    return ends


def _pair(given: Any) -> Any:
    if isinstance(given, bool) or not isinstance(given, int | float | list):
        raise ValueError("a number above 0, or [least, greatest]")
    return given if isinstance(given, list) else [given, given]


def _standard_error(given: Any) -> StandardError:
    is_absolute = isinstance(given, dict) and set(given) == {"value", "unit"}
    number = given["value"] if is_absolute else given
    if is_absolute and given["unit"] not in ("K", "SI"):
        raise ValueError('unit = "K", or "SI" for a number in SI units')
    if isinstance(number, bool) or not isinstance(number, int | float) or not 0 <= number < math.inf:
        raise ValueError('a relative standard error such as 0.1, or { value = 3, unit = "K" }')
    return StandardError(float(number), not is_absolute)


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


class StandardError(NamedTuple):
    """Of a parameter: in its unit, or as a share of its value."""

    size: float
    is_relative: bool


Of = TypeVar("Of")
Ends = Annotated[list[Of], Field(min_length=2, max_length=2), AfterValidator(_ascending)]
"""The least and the greatest of a range."""
Choices = Annotated[list[Of], Field(min_length=1), AfterValidator(lambda values: list(dict.fromkeys(values)))]
"""What may be chosen, each once."""
Parts = Annotated[list[Of], Field(min_length=2, max_length=400)]
"""A number for each equal part of a duty cycle."""
Share = Annotated[Number, Field(gt=0, le=1)]


# --- tables of the file -------------------------------------------------------------------------


class Question(Strict):
    """Table `[study]`: what is made best, and between which kinds of cooling."""

    name: str = "study"
    goal: Goal
    cooling: Choices[Cooling] = Field(default=["none", "passive", "fan"])
    catalogue: str | list[str] = Field(default=[])  # files of motors beside the study's
    currency: Annotated[str, Field(pattern=r"^\S{1,8}$")] = "EUR"  # of all prices


class Task(Strict):
    """Table `[task]`: what torque must be given behind the gear, at which speed, and for how long."""

    kind: Literal["hold", "cycle", "level_walking", "jump"] = "hold"
    torque: Torque | None = None  # of a hold; none where it is sought
    profile: Parts[NotNegative] | None = None  # N*m, of a cycle
    duration: Seconds | None = None  # of a hold; none where it is sought
    longest: Seconds = 3600.0  # a sought duration is not looked for beyond
    ambient: Celsius = 25.0
    start: Celsius = Field(default_factory=lambda said: said.get("ambient"))  # all nodes at the beginning
    period: Seconds | None = None  # of one cycle
    cycles: Annotated[int, Field(ge=1, le=100, strict=True)] | None = None  # from the start; none for ever (periodic)
    samples: Annotated[int, Field(ge=5, le=400, strict=True)] = 40  # parts of a walking or jumping cycle
    body_mass: Mass = 75.0
    speed: AnySpeed = 0.0  # of a hold; negative where the load drives the motor
    speeds: Parts[AnySpeed] | None = None  # of a cycle; none where nobody said
    gear: Positive = 50.0  # between ankle and motor in walking and jumping; 1 in a study of gears
    share: Share = 1.0  # of the ankle's moment that the motor gives

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
        usual = {"level_walking": profiles.WALKING_PERIOD, "jump": profiles.JUMP_PERIOD}
        return self.duration if self.is_hold else self.period or usual.get(self.kind)

    @property
    def factor(self) -> float:
        """Torque of the motor [N·m] by the ankle's moment by the kilogram of body [N·m/kg]."""
        return self.body_mass * self.share / self.gear

    @property
    def torques(self) -> FloatArray:
        """In each equal part of a cycle [N·m], shape (n,); 1 for a hold."""
        if self.kind == "level_walking":
            return profiles.level_walking(self.samples) * self.factor
        if self.kind == "jump":
            return profiles.jump(self.samples) * self.factor
        return np.array([1.0] if self.profile is None else self.profile)

    @property
    def shape(self) -> FloatArray:
        """Torque in each part over its peak, shape (n,)."""
        return np.asarray(self.torques / self.torques.max())

    @property
    def has_speeds(self) -> bool:
        """Whether anybody said how fast it turns."""
        return self.kind in ("hold", "level_walking") or self.speeds is not None

    @property
    def motion(self) -> FloatArray:
        """Speed in each part [rad/s], standstill where nobody said, shape (n,)."""
        if self.is_hold:
            return np.array([self.speed])
        if self.kind == "level_walking":
            return profiles.walking_speed(self.samples, self.time or profiles.WALKING_PERIOD) * self.gear
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

    voltage: Voltage | None = None
    pipe_power: Power | None = None
    mass: Mass | None = None
    volume: Volume | None = None
    price: Positive | None = None


class Gear(Strict):
    """Table `[[gears]]`: a gearbox between motor and task."""

    name: str
    ratio: Annotated[Ends[Positive], BeforeValidator(_pair)]  # speed of the motor over that of the task
    efficiency: Share = 1.0  # of the power, from the motor to the load or back
    mass: ExtraMass = 0.0
    volume: ExtraVolume = 0.0
    price: NotNegative | None = None

    @property
    def is_sought(self) -> bool:
        """Whether the ratio is part of the design."""
        return self.ratio[0] < self.ratio[1]


NO_GEAR = Gear(name="", ratio=[1.0, 1.0], price=0.0)
"""The only one of a study without any."""


class Sink(Strict):
    """Table `[sink]`: within which bounds a heat sink may be built, and what its fins are like."""

    at: str | None = None  # what the heat pipes touch, a node, a body's face or a pattern, where the motor doesn't say
    node: str = "sink"  # name of the sink's own node
    material: str | Annotated[list[str], Field(min_length=1)] = "aluminium"
    price: NotNegative = 0.0  # of making it, beside its metal
    capacity: Ends[Capacity] = Field(default=[20.0, 1500.0])
    resistance: Ends[Resistance] = Field(default=[0.05, 10.0])  # to the air
    fin_thickness: Length = 1e-3
    fin_depth: Length = 0.03  # root to tip
    fin_height: Length = 0.08  # along the air
    excess: Kelvins = 30.0  # fins above still air

    @property
    def bounds(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Least and greatest capacity [J/K], least and greatest resistance [K/W]."""
        return (self.capacity[0], self.capacity[1]), (self.resistance[0], self.resistance[1])

    @property
    def metals(self) -> list[str]:
        """Names of the metals to choose from."""
        return list(dict.fromkeys([self.material] if isinstance(self.material, str) else self.material))


class Pipes(Strict):
    """Table `[pipes]`: the heat pipes between motor and sink."""

    count: Choices[Annotated[int, Field(ge=1, le=64, strict=True)]] = Field(default=[4])
    resistance: Resistance = 0.708  # each, with its contacts: four make the 0.177 K/W of the thesis's exchanger
    power: Power = 65.0  # each; [Chen2017, appendix A.4]
    mass: ExtraMass = 0.03  # each; assumed
    mount: ExtraMass = 0.06  # the insert that holds them; assumed
    price: NotNegative = 0.0  # each


class Fan(Strict):
    """Table `[fan]`: a fan and its battery."""

    mass: ExtraMass = 0.05
    volume: ExtraVolume = 1e-4
    power: ExtraPower = 2.0  # electrical
    speed: Speed = 3.0  # of the air between the fins
    runtime: Runtime = 0.0
    battery: SpecificEnergy = 5.4e5  # 150 W·h/kg
    price: NotNegative = 0.0

    @property
    def mass_with_battery(self) -> float:
        """With the battery for its runtime [kg]."""
        return self.mass + self.power * self.runtime / self.battery


class Sweep(Strict):
    """Table `[pareto]`: values of one given quantity over which the study is solved again."""

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


class Uncertainty(Strict):
    """Table `[uncertainty]`: what is not known for sure."""

    draws: Annotated[int, Field(ge=8, le=4096, strict=True)] = 128  # of all of them; 4096 take an hour
    level: Annotated[Number, Field(ge=0.5, lt=1)] = 0.95  # probability of the intervals
    errors: dict[str, Annotated[StandardError, PlainValidator(_standard_error)]] = Field(default={})  # by pattern


class MotorChoice(MotorTable):
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


Motor = TypeVar("Motor", bound=MotorTable)


class StudyTables(Strict, Generic[Motor]):
    """All tables of a study file, with motors as the file has them or as they were found."""

    question: Question = Field(alias="study")
    task: Task = Task()
    limits: Limits = Limits()
    motors: Annotated[list[Motor], Field(min_length=1)]
    sink: Sink = Sink()
    gears: Annotated[list[Gear], Field(min_length=1)] = Field(default=[NO_GEAR])
    materials: Annotated[dict[str, Material], BeforeValidator(_with_known_metals)] = Field(default=MATERIALS)
    pipes: Pipes = Pipes()
    fan: Fan = Fan()
    sweep: Sweep | None = Field(default=None, alias="pareto")  # of the Pareto front
    uncertainty: Uncertainty | None = None  # none where everything is taken as known


class Study(StudyTables[MotorChoice]):
    """A whole study, with its motors found; `origin` is its file, for messages."""

    model_config = ConfigDict(populate_by_name=True)

    origin: str

    @property
    def unit(self) -> str:
        """Of the goal."""
        return GOALS[self.question.goal][1] or self.question.currency

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


# --- discrete choices ---------------------------------------------------------------------------


@dataclass(frozen=True)
class Option:
    """One discrete choice of a study."""

    study: Study
    motor: MotorChoice
    cooling: Cooling
    pipes: int
    gear: Gear
    material: str

    @property
    def metal(self) -> Material:
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
    def fixed_mass(self) -> float:
        """Motor, gear, pipes, mount and fan, all but the sink [kg]."""
        pipes = self.study.pipes.mount + self.pipes * self.study.pipes.mass if self.has_sink else 0.0
        return (
            self.motor.mass
            + self.gear.mass
            + pipes
            + (self.study.fan.mass_with_battery if self.cooling == "fan" else 0.0)
        )

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
        sink, metal, resistance = self.study.sink, self.metal, self.study.sink.resistance[1]
        fins = metal.specific_heat * float(fin_mass(resistance, self.film, sink.fin_thickness, metal.density))
        capacity = max(sink.capacity[0], fins)
        if budget != "volume":
            return fixed + capacity / metal.specific_heat * (1.0 if budget == "mass" else metal.price or 0.0)
        spacing, density, heat = self.air.spacing, metal.density, metal.specific_heat
        return fixed + float(sink_volume(capacity, resistance, self.film, sink.fin_thickness, spacing, density, heat))

    @property
    def air(self) -> Air:
        """At the fins."""
        sink, fan = self.study.sink, self.study.fan
        is_blown = self.cooling == "fan"
        return blown_air(fan.speed, sink.fin_height) if is_blown else still_air(sink.excess, sink.fin_height)

    @property
    def film(self) -> float:
        """Film coefficient times fin efficiency [W/(m² K)]."""
        film, sink = self.air.film, self.study.sink
        return film * fin_efficiency(film, sink.fin_thickness, sink.fin_depth, self.metal.conductivity)

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
