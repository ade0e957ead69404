"""What may stand in a study file: its tables and keys, checked by pydantic, converted to SI."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from lptn.model_schema import Number, Strict
from lptn.units import convert

_LEAST = 1e-12  # SI
Goal = Literal["held_torque", "time_to_limit", "worst_temperature", "mass", "volume"]
Cooling = Literal["none", "passive", "fan"]
Kind = Literal["hold", "cycle", "level_walking", "jump"]


def _quantity(unit: str) -> BeforeValidator:
    """A bare number in `unit`, or `{ value = …, unit = "…" }`."""

    def read(given: Any) -> Any:
        if not isinstance(given, Mapping):
            return _not_dust(given)
        if set(given) != {"value", "unit"}:
            raise ValueError(f'a number in {unit}, or {{ value = …, unit = "…" }}')
        number, named = given["value"], given["unit"]
        if isinstance(number, bool) or not isinstance(number, int | float) or not isinstance(named, str):
            raise ValueError(f'a number in {unit}, or {{ value = …, unit = "…" }}')
        try:
            return _not_dust(convert(float(number), named, unit))
        except ValueError as error:
            raise ValueError(f"a unit like {unit}") from error

    return BeforeValidator(read)


def _not_dust(value: Any) -> Any:
    """Refuse what is above 0 by a hair: the inverse of it is no number any more."""
    if isinstance(value, float) and 0 < abs(value) < _LEAST:
        raise ValueError(f"0, or a size of at least {_LEAST:g}")
    return value


_POSITIVE, _NOT_NEGATIVE = Field(gt=0), Field(ge=0)
Mass = Annotated[Number, _POSITIVE, _quantity("kg")]
ExtraMass = Annotated[Number, _NOT_NEGATIVE, _quantity("kg")]
Volume = Annotated[Number, _POSITIVE, _quantity("m^3")]
ExtraVolume = Annotated[Number, _NOT_NEGATIVE, _quantity("m^3")]
Length = Annotated[Number, _POSITIVE, _quantity("m")]
Speed = Annotated[Number, _POSITIVE, _quantity("m/s")]
Seconds = Annotated[Number, Field(gt=0, le=86400), _quantity("s")]  # a day: fine simulations take steps of a second
Torque = Annotated[Number, _POSITIVE, _quantity("N*m")]
Current = Annotated[Number, _POSITIVE, _quantity("A")]
Power = Annotated[Number, _POSITIVE, _quantity("W")]
ExtraPower = Annotated[Number, _NOT_NEGATIVE, _quantity("W")]
Celsius = Annotated[Number, Field(gt=-80, lt=500), _quantity("degC")]
Kelvins = Annotated[Number, _POSITIVE, _quantity("K")]
Capacity = Annotated[Number, _POSITIVE, _quantity("J/K")]
Resistance = Annotated[Number, _POSITIVE, _quantity("K/W")]
TorqueConstant = Annotated[Number, _POSITIVE, _quantity("N*m/A")]
Energy = Annotated[Number, _POSITIVE, _quantity("J/kg")]
Positive = Annotated[Number, _POSITIVE]
Count = Annotated[int, Field(ge=1, le=64, strict=True)]


class StudyTable(Strict):
    name: str = "study"
    goal: Goal
    cooling: list[Cooling] = Field(default=["none", "passive", "fan"], min_length=1)


class TaskTable(Strict):
    kind: Kind = "hold"
    torque: Torque | None = None
    profile: Annotated[list[Annotated[Number, _NOT_NEGATIVE]], Field(min_length=2, max_length=400)] | None = None
    duration: Seconds | None = None
    longest: Seconds = 3600.0
    ambient: Celsius = 25.0
    start: Celsius | None = None
    period: Seconds | None = None
    cycles: Annotated[int, Field(ge=1, le=100, strict=True)] | None = None
    samples: Annotated[int, Field(ge=5, le=400, strict=True)] = 40
    body_mass: Mass = 75.0
    gear: Positive = 50.0
    share: Annotated[Number, Field(gt=0, le=1)] = 1.0


class LimitsTable(Strict):
    winding: Celsius | None = None
    magnet: Celsius | None = None
    current: Current | None = None
    pipe_power: Power | None = None
    mass: Mass | None = None
    volume: Volume | None = None


class MotorTable(Strict):
    name: str
    model: str | None = None
    winding: str = "winding"
    magnet: str = "housing"
    mass: Mass | None = None
    volume: Volume | None = None
    torque_constant: TorqueConstant | None = None
    magnet_coefficient: Annotated[Number, Field(gt=-0.01, le=0)] | None = None


class SinkTable(Strict):
    at: str = "stator"
    node: str = "sink"
    capacity: list[Capacity] = Field(default=[20.0, 1500.0], min_length=2, max_length=2)
    resistance: list[Resistance] = Field(default=[0.05, 10.0], min_length=2, max_length=2)
    fin_thickness: Length = 1e-3
    fin_depth: Length = 0.03
    fin_height: Length = 0.08
    excess: Kelvins = 30.0


class PipesTable(Strict):
    count: list[Count] = Field(default=[4], min_length=1)
    resistance: Resistance = 1.844  # each, with its contacts: four make the 0.461 K/W of source S1's exchanger
    power: Power = 65.0  # each; source S1, appendix A.4
    mass: ExtraMass = 0.03  # each; assumed
    mount: ExtraMass = 0.06  # the insert that holds them; assumed


class FanTable(Strict):
    mass: ExtraMass = 0.05
    volume: ExtraVolume = 1e-4
    power: ExtraPower = 2.0
    speed: Speed = 3.0
    runtime: Annotated[Number, _NOT_NEGATIVE, _quantity("s")] = 0.0
    battery: Energy = 5.4e5  # 150 W·h/kg


class SweepTable(Strict):
    against: Literal["mass", "volume", "torque", "duration"] = "mass"
    least: Any
    most: Any
    points: Annotated[int, Field(ge=2, le=200, strict=True)] = 12


class File(Strict):
    study: StudyTable
    task: TaskTable = TaskTable()
    limits: LimitsTable = LimitsTable()
    motors: Annotated[list[MotorTable], Field(min_length=1)]
    sink: SinkTable = SinkTable()
    pipes: PipesTable = PipesTable()
    fan: FanTable = FanTable()
    pareto: SweepTable | None = None
