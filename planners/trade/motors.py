"""Motors: what a study needs to know of one beside its thermal network, and those whose data are known here."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

from pydantic import Field

from lptn.basics.toml import Number, Strict
from lptn.model.file import parse_model
from lptn.model.network import Network

from ..values import (
    Celsius,
    Current,
    Inertia,
    Length,
    Mass,
    NotNegative,
    Ohms,
    Resistance,
    Seconds,
    ShaftSpeed,
    SpeedConstant,
    TorqueConstant,
    Volume,
)

MAGNET_COEFFICIENT = -0.0012
"""Temperature coefficient of the flux density of NdFeB magnets [1/K], [Chen2017, eq. 2.6]."""
ENAMEL_LIMIT = 105.0
"""Winding temperature at which the enamel fails [degC], [Chen2017, fig. 4-9]; curves without a limit go to it."""
MAGNET_LIMIT = 150.0
"""Of the average NdFeB magnet [degC], [Chen2017, eq. 2.6]."""
REFERENCE = 25.0
"""Temperature at which data sheets are taken to hold [degC]; neither sheet states it."""


class MotorLimits(Strict):
    """What a motor's data sheet limits; none where it is silent."""

    winding: Celsius | None = None
    magnet: Celsius | None = None
    current: Current | None = None
    speed: ShaftSpeed | None = None  # of the motor's shaft

    @property
    def given(self) -> dict[str, float]:
        """The limits that are given, by name."""
        return self.model_dump(exclude_none=True)


class DataSheet(Strict):
    """The thermal numbers that makers of motors print: two resistances, two time constants."""

    resistance: Ohms
    winding_to_housing: Resistance
    housing_to_ambient: Resistance
    winding_time: Seconds
    motor_time: Seconds


class CatalogueMotor(Strict):
    """A motor of a study or of a catalogue."""

    name: str
    model: str | None = None
    data_sheet: DataSheet | None = None
    winding: str | None = None  # node or pattern; the nodes with copper loss
    magnet: str | None = None  # node or pattern; nodes called magnet…, else the housing
    sink_at: str | None = None  # node, body's face or pattern; else [sink] at, else the stator or housing's outside
    mass: Mass | None = None
    volume: Volume | None = None
    diameter: Length | None = None
    length: Length | None = None
    torque_constant: TorqueConstant | None = None  # at 25 degC
    speed_constant: SpeedConstant | None = None
    magnet_coefficient: Annotated[Number, Field(gt=-0.01, le=0)] = MAGNET_COEFFICIENT  # of the torque constant, 1/K
    rotor_inertia: Inertia = 0.0
    price: NotNegative | None = None  # none where nobody said
    limits: MotorLimits = MotorLimits()
    source: str | None = None

    def over(self, other: CatalogueMotor) -> CatalogueMotor:
        """This motor, and where it says nothing, what the other one says."""
        said = self.model_dump(exclude_unset=True)
        kept = other.model_dump(exclude_unset=True) | said | {"limits": other.limits.given | self.limits.given}
        # Two ways to say the same: the later one counts alone.
        for one, another in _EITHER:
            if any(key in said for key in one) and not any(key in said for key in another):
                kept = {key: value for key, value in kept.items() if key not in another}
        return CatalogueMotor(**kept)

    @property
    def package(self) -> float | None:
        """Its volume [m³], perhaps that of the cylinder which it fills."""
        if self.volume is not None or self.diameter is None or self.length is None:
            return self.volume
        return math.pi * self.diameter**2 / 4 * self.length

    @property
    def constant(self) -> float | None:
        """Torque by the ampere [N·m/A], which is voltage by the radian per second."""
        if self.torque_constant is not None or self.speed_constant is None:
            return self.torque_constant
        return 1 / self.speed_constant


_EITHER = [(one, other) for pair in ((("volume",), ("diameter", "length")), (("torque_constant",), ("speed_constant",)),
                                     (("model",), ("data_sheet",))) for one, other in (pair, pair[::-1])]  # fmt: skip


def data_sheet_network(name: str, sheet: DataSheet) -> Network:
    """Winding, housing and air, after a data sheet.

    A winding's time constant is taken as its heat capacity times its resistance to the housing, the motor's as the
    housing's capacity times its resistance to the air.
    """
    text = f"""
[model]
name = "data-sheet"
ambient = "temperature.ambient"
[nodes.winding]
capacity = {sheet.winding_time / sheet.winding_to_housing!r}
[nodes.housing]
capacity = {sheet.motor_time / sheet.housing_to_ambient!r}
[[links]]
between = ["winding", "housing"]
resistance = {sheet.winding_to_housing!r}
[[links]]
between = ["housing", "ambient"]
resistance = {sheet.housing_to_ambient!r}
[[effects]]
kind = "copper_loss"
at = "winding"
input = "current"
resistance = {sheet.resistance!r}
[[effects]]
kind = "resistance_rise"
at = "winding"
alpha = 0.0039  # 1/K, copper; [Chen2017, eq. 2.5]
reference = {REFERENCE}
"""
    return parse_model(text, Path(f"data sheet of {name}")).network


class KnownMotor(CatalogueMotor):
    """A motor whose data sheet is known here; its model is a ready one."""

    mass: Mass
    diameter: Length
    length: Length
    torque_constant: TorqueConstant
    source: str


U8 = KnownMotor(
    name="U8",
    model="u8",
    mass=0.240,
    diameter=0.0871,
    length=0.02665,
    torque_constant=60 / (2 * math.pi * 100),
    limits=MotorLimits(winding=ENAMEL_LIMIT, magnet=MAGNET_LIMIT, current=35.0),
    source="mass, stall current: [Chen2017, table A.1]; size: T-Motor's drawing of the U8, not in the thesis; "
    "100 rpm/V: [Chen2017, eq. 2.1], whose text rounds to 0.1 N·m/A",
)
U10 = KnownMotor(
    name="U10",
    model="u10",
    mass=0.400,
    diameter=0.0868,
    length=0.0355,
    torque_constant=60 / (2 * math.pi * 100),
    limits=MotorLimits(winding=ENAMEL_LIMIT, magnet=MAGNET_LIMIT, current=35.0),
    source="mass, size, 100 rpm/V, maximum continuous current for 180 s: [Chen2017, appendix A.2]",
)
MOTORS: dict[str, CatalogueMotor] = {motor.name: motor for motor in (U8, U10)}
"""The motors whose data are known here, by name."""
