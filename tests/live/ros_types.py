"""Two messages of ROS 2 as its own IDL has them, written anew, and one of somebody else."""

# mypy: disable-error-code="misc, call-arg"
# No `from __future__ import annotations`: cyclonedds reads the annotations.

from dataclasses import dataclass

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import float64, int32, sequence, uint32


@dataclass
@final
class Time(IdlStruct, typename="builtin_interfaces.msg.dds_.Time_"):
    sec: int32
    nanosec: uint32


@dataclass
@final
class Header(IdlStruct, typename="std_msgs.msg.dds_.Header_"):
    stamp: Time
    frame_id: str


@dataclass
@final
class JointState(IdlStruct, typename="sensor_msgs.msg.dds_.JointState_"):
    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
@final
class Temperature(IdlStruct, typename="sensor_msgs.msg.dds_.Temperature_"):
    header: Header
    temperature: float64
    variance: float64


@dataclass
@final
class Foreign(IdlStruct, typename="sensor_msgs.msg.JointState"):
    """What a publisher of DDS alone may call as ROS does, without its `dds_`."""

    value: float64
