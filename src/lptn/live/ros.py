"""Messages of ROS 2 and of Unitree's robots without ROS: their types, the numbers they hold, a status as messages."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import field, make_dataclass
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any

from lptn.live.messages import Numbers
from lptn.live.sources import Source
from lptn.live.status import NodeStatus, Status
from lptn.logs.bag_messages import numbers_of, quantities
from lptn.logs.bags import store_of

# Source: the IDL of Unitree's SDK 2, for Go2 and B2 (unitree_go), for G1 and H1-2 (unitree_hg). ROS 2's own messages
# are described by rosbags, those of ros-controls where bags are read.
_UNITREE = {
    "unitree_go/msg/IMUState": "float32[4] quaternion, float32[3] gyroscope, float32[3] accelerometer, "
    "float32[3] rpy, uint8 temperature",
    "unitree_go/msg/MotorState": "uint8 mode, float32 q, float32 dq, float32 ddq, float32 tau_est, "
    "float32 q_raw, float32 dq_raw, float32 ddq_raw, uint8 temperature, uint32 lost, uint32[2] reserve",
    "unitree_go/msg/BmsState": "uint8 version_high, uint8 version_low, uint8 status, uint8 soc, "
    "int32 current, uint16 cycle, uint8[2] bq_ntc, uint8[2] mcu_ntc, uint16[15] cell_vol",
    "unitree_go/msg/LowState": "uint8[2] head, uint8 level_flag, uint8 frame_reserve, uint32[2] sn, "
    "uint32[2] version, uint16 bandwidth, IMUState imu_state, MotorState[20] motor_state, BmsState bms_state, "
    "int16[4] foot_force, int16[4] foot_force_est, uint32 tick, uint8[40] wireless_remote, uint8 bit_flag, "
    "float32 adc_reel, uint8 temperature_ntc1, uint8 temperature_ntc2, float32 power_v, float32 power_a, "
    "uint16[4] fan_frequency, uint32 reserve, uint32 crc",
    "unitree_hg/msg/IMUState": "float32[4] quaternion, float32[3] gyroscope, float32[3] accelerometer, "
    "float32[3] rpy, int16 temperature",
    "unitree_hg/msg/MotorState": "uint8 mode, float32 q, float32 dq, float32 ddq, float32 tau_est, "
    "int16[2] temperature, float32 vol, uint32[2] sensor, uint32 motorstate, uint32[4] reserve",
    "unitree_hg/msg/LowState": "uint32[2] version, uint8 mode_pr, uint8 mode_machine, uint32 tick, "
    "IMUState imu_state, MotorState[35] motor_state, uint8[40] wireless_remote, uint32[4] reserve, uint32 crc",
}
READ = (
    *(f"sensor_msgs/msg/{word}" for word in ("JointState", "Temperature")),
    "control_msgs/msg/DynamicJointState",
    "diagnostic_msgs/msg/DiagnosticArray",
    *(f"unitree_{series}/msg/LowState" for series in ("go", "hg")),
)
"""Types of messages that are read."""
OWN = "lptn"
"""The first word of topics, and of statuses in diagnostics, that are written here: they are not read."""


def ros_name(name: str) -> str:
    """`sensor_msgs/msg/JointState` of the name that DDS and Zenoh have for it."""
    return name.replace("::dds_::", "::").replace("::", "/").removesuffix("_")


@cache
def types_of_messages() -> Any:
    """How the messages are laid out, as rosbags has it."""
    from rosbags.typesys import get_types_from_msg

    store = store_of(Path(), [])
    for name, members in _UNITREE.items():
        store.register(get_types_from_msg(members.replace(", ", "\n"), name))
    return store


@cache
def message_types() -> dict[str, Any]:
    """The classes of messages that are read or written, and of their parts, by their name in DDS."""
    from cyclonedds.idl import IdlStruct, annotations, types
    from rosbags.interfaces import Nodetype

    made, described = dict[str, Any](), types_of_messages().fielddefs

    def type_of(kind: Nodetype, inner: Any) -> Any:
        if kind == Nodetype.BASE:
            return str if inner[0] == "string" else getattr(types, inner[0])
        if kind == Nodetype.NAME:
            return class_of(inner)
        element, count = type_of(*inner[0]), inner[1]
        return types.array[element, count] if kind == Nodetype.ARRAY else types.sequence[element]

    def class_of(name: str) -> Any:
        package, _, word = name.split("/")
        in_dds = f"{package}::msg::dds_::{word}_"
        if in_dds not in made:
            members = [(member, type_of(*how), field()) for member, how in described[name][1]]
            own = {"__idl_typename__": in_dds, "__msgtype__": name}
            made[in_dds] = make_dataclass(f"{word}_", members, bases=(IdlStruct,), namespace=own)
            annotations.final(made[in_dds])
        return made[in_dds]

    for name in (*READ, "std_msgs/msg/Float64"):
        class_of(name)
    return made


class RosSource(Source):
    """A source of messages by topic: numbers are called as in bags, `/joint_states.effort[knee]`."""

    def __init__(self, name: str, *, live: bool = True) -> None:
        super().__init__(name, live=live)
        self._known = set[tuple[str, ...]]()

    def hear(self, topic: str, message: Any) -> None:
        """Say the numbers of a message; a topic without stamps, as LowState, has the time of its reception."""
        header = getattr(message, "header", None)
        seconds = header.stamp.sec + header.stamp.nanosec / 1e9 if header else 0.0
        numbers = numbers_of(types_of_messages(), message)
        read = {name: x for name, x in numbers.items() if not name.startswith(f"{OWN}: ")}
        self.say(topic, message.__msgtype__, read, seconds)

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
