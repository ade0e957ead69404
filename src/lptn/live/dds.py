"""ROS 2 topics and Unitree's low-level state by DDS, without ROS: each topic of a known type that is published."""

from __future__ import annotations

import os
from dataclasses import field, make_dataclass
from threading import Event
from typing import Any

from lptn.basics.errors import InputError
from lptn.live.messages import flat
from lptn.live.sources import LOOPBACK, Source
from lptn.logs.bag_messages import quantities

_PAUSE = 0.01  # s between two looks at a topic: Python takes a tenth of that for a message of twenty motors
_LAST_DOMAIN = 232  # a greater one has no port

# What the messages hold, as ROS 2 writes it: type, how many in brackets, name; a sequence has empty brackets. Source of
# Unitree's: the IDL of its SDK 2, for Go2 and B2 (unitree_go), for G1 and H1-2 (unitree_hg).
_TYPES = {
    "builtin_interfaces::msg::dds_::Time_": "int32 sec, uint32 nanosec",
    "std_msgs::msg::dds_::Header_": "builtin_interfaces::msg::dds_::Time_ stamp, string frame_id",
    "sensor_msgs::msg::dds_::JointState_": "std_msgs::msg::dds_::Header_ header, string[] name, float64[] position, "
    "float64[] velocity, float64[] effort",
    "sensor_msgs::msg::dds_::Temperature_": "std_msgs::msg::dds_::Header_ header, float64 temperature, "
    "float64 variance",
    "unitree_go::msg::dds_::IMUState_": "float32[4] quaternion, float32[3] gyroscope, float32[3] accelerometer, "
    "float32[3] rpy, uint8 temperature",
    "unitree_go::msg::dds_::MotorState_": "uint8 mode, float32 q, float32 dq, float32 ddq, float32 tau_est, "
    "float32 q_raw, float32 dq_raw, float32 ddq_raw, uint8 temperature, uint32 lost, uint32[2] reserve",
    "unitree_go::msg::dds_::BmsState_": "uint8 version_high, uint8 version_low, uint8 status, uint8 soc, "
    "int32 current, uint16 cycle, uint8[2] bq_ntc, uint8[2] mcu_ntc, uint16[15] cell_vol",
    "unitree_go::msg::dds_::LowState_": "uint8[2] head, uint8 level_flag, uint8 frame_reserve, uint32[2] sn, "
    "uint32[2] version, uint16 bandwidth, unitree_go::msg::dds_::IMUState_ imu_state, "
    "unitree_go::msg::dds_::MotorState_[20] motor_state, unitree_go::msg::dds_::BmsState_ bms_state, "
    "int16[4] foot_force, int16[4] foot_force_est, uint32 tick, uint8[40] wireless_remote, uint8 bit_flag, "
    "float32 adc_reel, uint8 temperature_ntc1, uint8 temperature_ntc2, float32 power_v, float32 power_a, "
    "uint16[4] fan_frequency, uint32 reserve, uint32 crc",
    "unitree_hg::msg::dds_::IMUState_": "float32[4] quaternion, float32[3] gyroscope, float32[3] accelerometer, "
    "float32[3] rpy, int16 temperature",
    "unitree_hg::msg::dds_::MotorState_": "uint8 mode, float32 q, float32 dq, float32 ddq, float32 tau_est, "
    "int16[2] temperature, float32 vol, uint32[2] sensor, uint32 motorstate, uint32[4] reserve",
    "unitree_hg::msg::dds_::LowState_": "uint32[2] version, uint8 mode_pr, uint8 mode_machine, uint32 tick, "
    "unitree_hg::msg::dds_::IMUState_ imu_state, unitree_hg::msg::dds_::MotorState_[35] motor_state, "
    "uint8[40] wireless_remote, uint32[4] reserve, uint32 crc",
}
_PUBLISHED = ("JointState_", "Temperature_", "LowState_")
"""Types that topics have; the others are parts of these."""


def message_types() -> dict[str, Any]:
    """The classes of messages, by their name in DDS."""
    from cyclonedds.idl import IdlStruct, annotations, types

    made: dict[str, Any] = {"string": str}
    for name, described in _TYPES.items():
        members = []
        for member in described.split(", "):
            kind, _, called = member.partition(" ")
            kind, _, count = kind.removesuffix("]").partition("[")
            element = made.get(kind) or getattr(types, kind)
            many = member.partition(" ")[0].endswith("]")
            whole = types.array[element, int(count)] if count else types.sequence[element] if many else element
            members.append((called, whole, field()))
        own = {"__idl_typename__": name}
        made[name] = make_dataclass(name.rpartition("::")[2], members, bases=(IdlStruct,), namespace=own)
        annotations.final(made[name])
    return made


class Dds(Source):
    """Topics of JointState, Temperature and LowState in one domain, from whoever publishes them.

    Numbers are called as in bags: `/joint_states.effort[knee]`, `/lowstate.motor_state[3].temperature`. Of each topic
    the newest message counts, a hundred times a second.

    Args:
        address: of this machine's interface; '' for the one that `CYCLONEDDS_URI` names or else loopback.
        domain: its number.

    Raises:
        InputError: the package is not installed, or there is no such domain or interface.
    """

    def __init__(self, address: str, domain: int) -> None:
        super().__init__(f"dds://{address}:{domain}", live=True)
        self._known = set[tuple[str, ...]]()
        if not 0 <= domain <= _LAST_DOMAIN:
            raise InputError(self.name, "source", f"domain {domain}", f"a number from 0 to {_LAST_DOMAIN}")
        try:
            from cyclonedds.core import DDSException
            from cyclonedds.domain import Domain, DomainParticipant
        except ImportError as error:
            raise InputError(self.name, "source", str(error), "pip install 'lptn[dds]'") from error
        try:
            if address or "CYCLONEDDS_URI" not in os.environ:
                self._domain = Domain(domain, _CONFIGURATION.format(address=address or LOOPBACK))
            self._participant = DomainParticipant(domain)
        except DDSException as error:
            raise InputError(self.name, "source", str(error), "an interface of this machine, a free domain") from error

    def run(self, stop: Event) -> None:
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
        from cyclonedds.core import Policy, Qos
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        known, readers = message_types(), dict[str, Any]()
        publications = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        newest = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(1))
        while not stop.wait(_PAUSE):
            for one in publications.take(100):
                kind, topic = getattr(one, "type_name", ""), getattr(one, "topic_name", "")
                if kind in known and kind.endswith(_PUBLISHED) and topic not in readers:
                    readers[topic] = DataReader(self._participant, Topic(self._participant, topic, known[kind]), newest)
            for topic, reader in readers.items():
                for message in reader.take(1):
                    self._say(f"/{topic.removeprefix('rt/')}", message)

    def _say(self, topic: str, message: Any) -> None:
        """Put a message into the inbox; what is known of its type is where its quantities stand."""
        content: dict[str, Any] = _plain(message)
        stamp = content.pop("header", {}).get("stamp", {"sec": 0, "nanosec": 0})
        numbers = flat(content)
        if (names := (topic, *numbers)) not in self._known:
            self._known.add(names)
            kind = f"/{type(message).__name__.removesuffix('_')}"
            self.defaults |= quantities({topic: (kind, list(numbers))}) | self.defaults
        said = {f"{topic}.{name}": value for name, value in numbers.items()}
        # A topic without stamps, as LowState, has the time of its reception.
        seconds = stamp["sec"] + stamp["nanosec"] / 1e9
        self.inbox.put(said | ({"time": seconds} if seconds else {}))


def _plain(value: Any) -> Any:
    """A message as nested dictionaries and lists; `asdict` copies each number, and takes three times as long."""
    if fields := getattr(value, "__dataclass_fields__", None):  # beside them stands how a sample was received
        return {name: _plain(getattr(value, name)) for name in fields}
    return [_plain(own) for own in value] if isinstance(value, list | tuple) else value


_CONFIGURATION = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface address="{address}"/></Interfaces>
</General></Domain></CycloneDDS>"""
