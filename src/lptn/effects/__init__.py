"""The catalogue of physical effects: one effect, one file; others come in by the entry point `lptn.effects`."""

from __future__ import annotations

from functools import cache
from importlib.metadata import entry_points

from lptn.effects.ambient_lag import AmbientLag
from lptn.effects.ambient_offset import AmbientOffset
from lptn.effects.base import (
    BoundaryEffect,
    ClockEffect,
    EdgeEffect,
    Effect,
    ExcessEffect,
    GroupEffect,
    LinkEffect,
    LossEffect,
    MassEffect,
    NodeEffect,
    PairSensorEffect,
    SensorEffect,
    Signature,
)
from lptn.effects.battery_heat import BatteryHeat
from lptn.effects.clock_offset import ClockOffset
from lptn.effects.computer_heat import ComputerHeat
from lptn.effects.conduction import Conduction
from lptn.effects.constant_heat import ConstantHeat
from lptn.effects.copper_loss import CopperLoss
from lptn.effects.coulomb_friction import CoulombFriction
from lptn.effects.drive_heat import DriveHeat
from lptn.effects.driver_loss import DriverLoss
from lptn.effects.fan import Fan
from lptn.effects.forced_convection import ForcedConvection
from lptn.effects.gear_loss import GearLoss
from lptn.effects.heat_input import HeatInput
from lptn.effects.heat_scale import HeatScale
from lptn.effects.hot_spot import HotSpot
from lptn.effects.iron_loss import IronLoss
from lptn.effects.loss_scale import LossScale
from lptn.effects.natural_convection import NaturalConvection
from lptn.effects.radiation import Radiation
from lptn.effects.resistance_rise import ResistanceRise
from lptn.effects.second_mass import SecondMass
from lptn.effects.sensor_drift import SensorDrift
from lptn.effects.sensor_lag import SensorLag
from lptn.effects.sensor_offset import SensorOffset
from lptn.effects.sensor_position import SensorPosition
from lptn.effects.shared_mass import SharedMass
from lptn.effects.solar import Solar
from lptn.effects.stray_load_loss import StrayLoadLoss
from lptn.effects.surface_scale import SurfaceScale
from lptn.effects.torque_constant_drop import TorqueConstantDrop
from lptn.effects.viscous_friction import ViscousFriction

_BUILT_IN: tuple[type[Effect], ...] = (
    CopperLoss,
    HeatInput,
    HeatScale,
    ConstantHeat,
    DriveHeat,
    ComputerHeat,
    BatteryHeat,
    Solar,
    CoulombFriction,
    ViscousFriction,
    IronLoss,
    GearLoss,
    DriverLoss,
    StrayLoadLoss,
    ResistanceRise,
    TorqueConstantDrop,
    NaturalConvection,
    ForcedConvection,
    Fan,
    Radiation,
    Conduction,
    SecondMass,
    SharedMass,
    SensorLag,
    SensorOffset,
    SensorDrift,
    SensorPosition,
    HotSpot,
    ClockOffset,
    LossScale,
    SurfaceScale,
    AmbientOffset,
    AmbientLag,
)


@cache
def catalogue() -> dict[str, type[Effect]]:
    """Every effect by its key: the built-in ones, then those of installed plug-ins.

    Raises:
        TypeError: a plug-in's entry is not an `Effect`.
    """
    effects = {effect.key: effect for effect in _BUILT_IN}
    for entry in entry_points(group="lptn.effects"):
        effect = entry.load()
        if not (isinstance(effect, type) and issubclass(effect, Effect)):
            raise TypeError(f"plug-in {entry.name} ({entry.value}) is not a subclass of lptn.effects.Effect")
        effects.setdefault(effect.key, effect)
    return effects


__all__ = [
    "BoundaryEffect",
    "ClockEffect",
    "EdgeEffect",
    "Effect",
    "ExcessEffect",
    "GroupEffect",
    "LinkEffect",
    "LossEffect",
    "MassEffect",
    "NodeEffect",
    "PairSensorEffect",
    "SensorEffect",
    "Signature",
    "catalogue",
]
