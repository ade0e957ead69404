"""The tables of a study file: what is asked, what may be chosen, what must hold; all in SI, temperatures in degC.

A field's type has its unit and its bounds, its comment what it means; a study is made of these tables (`study.py`).
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

import numpy as np
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    PlainValidator,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    field_validator,
)

from lptn.basics.arrays import FloatArray
from lptn.basics.toml import Number, Strict

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
    Voltage,
    Volume,
)
from . import profiles
from .motors import MotorLimits

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
BUDGETS: tuple[str, ...] = ("mass", "volume", "price")
"""What a design spends."""
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


class DutyTask(Strict):
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


class SinkFan(Strict):
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


class StudyUncertainty(Strict):
    """Table `[uncertainty]`: what is not known for sure."""

    draws: Annotated[int, Field(ge=8, le=4096, strict=True)] = 128  # of all of them; 4096 take an hour
    level: Annotated[Number, Field(ge=0.5, lt=1)] = 0.95  # probability of the intervals
    errors: dict[str, Annotated[StandardError, PlainValidator(_standard_error)]] = Field(default={})  # by pattern
