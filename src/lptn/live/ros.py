"""Messages of ROS 2 and of Unitree's robots without ROS: their types, the numbers they hold, a status as messages."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import field, make_dataclass
from functools import cache
from math import isfinite
from typing import Any

from lptn.live.messages import Numbers, flat
from lptn.live.sources import Source
from lptn.live.status import NodeStatus, Status
from lptn.logs.bag_messages import numbers_of_diagnostics, quantities

# What the messages hold, as ROS 2 writes it: type, how many in brackets, name; a sequence has empty brackets. Source of
# Unitree's: the IDL of its SDK 2, for Go2 and B2 (unitree_go), for G1 and H1-2 (unitree_hg).
_TYPES = {
    "builtin_interfaces::msg::dds_::Time_": "int32 sec, uint32 nanosec",
    "std_msgs::msg::dds_::Header_": "builtin_interfaces::msg::dds_::Time_ stamp, string frame_id",
    "sensor_msgs::msg::dds_::JointState_": "std_msgs::msg::dds_::Header_ header, string[] name, float64[] position, "
    "float64[] velocity, float64[] effort",
    "sensor_msgs::msg::dds_::Temperature_": "std_msgs::msg::dds_::Header_ header, float64 temperature, "
    "float64 variance",
    "std_msgs::msg::dds_::Float64_": "float64 data",
    "control_msgs::msg::dds_::InterfaceValue_": "string[] interface_names, float64[] values",
    "control_msgs::msg::dds_::DynamicJointState_": "std_msgs::msg::dds_::Header_ header, string[] joint_names, "
    "control_msgs::msg::dds_::InterfaceValue_[] interface_values",
    "diagnostic_msgs::msg::dds_::KeyValue_": "string key, string value",
    "diagnostic_msgs::msg::dds_::DiagnosticStatus_": "byte level, string name, string message, string hardware_id, "
    "diagnostic_msgs::msg::dds_::KeyValue_[] values",
    "diagnostic_msgs::msg::dds_::DiagnosticArray_": "std_msgs::msg::dds_::Header_ header, "
    "diagnostic_msgs::msg::dds_::DiagnosticStatus_[] status",
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
READ = ("JointState_", "DynamicJointState_", "Temperature_", "DiagnosticArray_", "LowState_")
"""Types of topics that are read; the others are parts of these, or are written."""
OWN = "lptn"
"""The first word of topics, and of statuses in diagnostics, that are written here: they are not read."""


@cache
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


class RosSource(Source):
    """A source of messages by topic: numbers are called as in bags, `/joint_states.effort[knee]`."""

    def __init__(self, name: str, *, live: bool = True) -> None:
        super().__init__(name, live=live)
        self._known = set[tuple[str, ...]]()

    def hear(self, topic: str, message: Any) -> None:
        """Say the numbers of a message; a topic without stamps, as LowState, has the time of its reception."""
        kind = type(message).__name__.removesuffix("_")
        content: dict[str, Any] = _plain(message)
        stamp = content.pop("header", {}).get("stamp", {"sec": 0, "nanosec": 0})
        self.say(topic, f"/{kind}", _numbers(kind, message, content), stamp["sec"] + stamp["nanosec"] / 1e9)

    def say(self, topic: str, kind: str, numbers: Numbers, seconds: float) -> None:
        """Put a topic's numbers into the inbox; what is known of its type is where its quantities stand.

        Args:
            topic: its name.
            kind: of its messages, as bags have it.
            numbers: by their names in the message.
            seconds: when it was, 0 for its reception.
        """
        if (names := (topic, *numbers)) not in self._known:
            self._known.add(names)
            self.defaults |= quantities({topic: (kind, list(numbers))}) | self.defaults
        said = {f"{topic}.{name}": value for name, value in numbers.items()}
        self.inbox.put(said | ({"time": seconds} if seconds else {}))


def _numbers(kind: str, message: Any, content: dict[str, Any]) -> Numbers:
    """The numbers of a message by the names that they have in bags."""
    if kind == "DynamicJointState":
        pairs = zip(message.joint_names, message.interface_values, strict=False)
        return {
            f"{joint}.{name}": value
            for joint, own in pairs
            for name, value in zip(own.interface_names, own.values, strict=False)
        }
    if kind == "DiagnosticArray":
        said = numbers_of_diagnostics(message)
        return {name: value for name, value in said.items() if not name.startswith(f"{OWN}: ")}
    return flat(content)


def _plain(value: Any) -> Any:
    """A message as nested dictionaries and lists; `asdict` copies each number, and takes three times as long."""
    if fields := getattr(value, "__dataclass_fields__", None):  # beside them stands how a sample was received
        return {name: _plain(getattr(value, name)) for name in fields}
    return [_plain(own) for own in value] if isinstance(value, list | tuple) else value


# --- A status as messages ---------------------------------------------------------------------------

_OK, _WARN, _ERROR, _STALE = range(4)  # levels of diagnostic_msgs/DiagnosticStatus
_END_OF_TIME = 2.0**31  # s, of builtin_interfaces/Time


def as_messages(status: Status) -> Iterator[tuple[str, Any]]:
    """A status as ROS 2 messages, each with its topic.

    `/lptn/NODE/temperature` (sensor_msgs/Temperature) of each node, whether a sensor reads it or not,
    `/lptn/NODE/torque_scale` (std_msgs/Float64) where it has a limit, and `/diagnostics`, a status `lptn: NODE` each
    and `lptn: model`, whether the robot is as its model.
    """
    types = {name.rpartition("::")[2]: kind for name, kind in message_types().items()}
    seconds = status.time if 0 <= status.time < _END_OF_TIME else 0.0  # of a clock of its own nobody knows the time
    head = types["Header_"](types["Time_"](int(seconds), int(seconds % 1 * 1e9)), "")
    alarms, statuses = {alarm.node: alarm.words for alarm in status.alarms}, []
    for one, word in zip(status.nodes, _topic_words([one.node for one in status.nodes]), strict=True):
        topic, scale = f"/{OWN}/{word}", one.torque_scale
        if isfinite(one.temperature):
            yield f"{topic}/temperature", types["Temperature_"](head, one.temperature, 0.0)  # 0: variance not told
        if scale is not None and isfinite(scale):
            yield f"{topic}/torque_scale", types["Float64_"](scale)
        level, words = _level_of(one, alarms.get(one.node, ""))
        if status.missing:
            level, words = _STALE, f"silent: {', '.join(status.missing)}"
        told = {"temperature [C]": one.temperature, "limit [C]": one.limit, "time to limit [s]": one.time_to_limit,
                "earliest [s]": one.earliest, "latest [s]": one.latest, "torque scale": scale}  # fmt: skip
        values = [types["KeyValue_"](key, f"{value:.6g}") for key, value in told.items() if value is not None]
        statuses.append(types["DiagnosticStatus_"](level, f"{OWN}: {one.node}", words, "", values))
    changed = _OK if status.changed is None else _WARN
    words = "" if status.changed is None else f"the robot is not as its model since {status.changed:.0f} s"
    statuses.append(types["DiagnosticStatus_"](changed, f"{OWN}: model", words, "", []))
    yield "/diagnostics", types["DiagnosticArray_"](head, statuses)


def _topic_words(nodes: Sequence[str]) -> list[str]:
    """A word of ROS 2 for each node, which holds letters, digits and `_` and begins with none of the digits."""
    words = list[str]()
    for node in nodes:
        word = re.sub(r"^(?=\d)", "n", re.sub(r"[^0-9A-Za-z_]", "_", node))
        words.append(f"{word}_{len(words)}" if word in words else word)
    return words


def _level_of(one: NodeStatus, alarm: str) -> tuple[int, str]:
    """How bad it is, and why."""
    if one.limit is not None and one.temperature >= one.limit:
        return _ERROR, "at its limit"
    if alarm or one.trust not in ("trusted", "not yet", "none"):
        return _WARN, f"sensor: {alarm or one.trust}"
    if one.torque_scale is not None and one.torque_scale < 1.0:
        return _WARN, "near its limit"
    return _OK, ""
