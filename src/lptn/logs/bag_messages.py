"""Numbers in ROS messages: their names, the quantities that they are, and a quick way to read many."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray, IntArray
from lptn.logs.columns import ColumnSource, is_key, words_of

# --- The numbers of a message: their names, and where they stand among its bytes (CDR, little-endian; or ROS 1) ---

COMMON_TYPES = {  # that do not come with ROS 2 itself: ros-controls/control_msgs, Apache-2.0
    "control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values\n",
    "control_msgs/msg/DynamicJointState": (
        "std_msgs/Header header\nstring[] joint_names\ncontrol_msgs/InterfaceValue[] interface_values\n"
    ),
}
_NUMPY_TYPES = {"bool": "u1", "byte": "u1", "char": "u1", "float32": "<f4", "float64": "<f8"} | {
    f"{sign}int{8 * size}": f"<{sign or 'i'}{size}" for sign in ("", "u") for size in (1, 2, 4, 8)
}
_NAMED_ELSEWHERE = ("interface_values", "values")  # members whose entries another member names
_DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
_QUANTITY = re.compile(  # a number, and a unit that is no more digits, nor those of a hexadecimal number
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?!x[\dA-Fa-f])([^\W\d_][^\d]*?|[°%µ][^\d]*?)?\s*"
)
_LONGEST = 64  # entries of an array; longer ones are pictures and clouds
_HEAD = 4  # bytes that say how a message is encoded
_BASE, _NAME, _SEQUENCE = 1, 2, 4  # kinds of types, as rosbags numbers them
_COUNT, _TEXT = "count", "string"  # what stands before the entries of an array, 4 bytes; and letters, with their count


def numbers_of(store: Any, message: Any) -> dict[str, float]:
    """The numbers of a message by their names: `twist.linear.x`, `motor_state[3].temperature`, `effort[FR_calf]`.

    Diagnostics give theirs as text, by a key of what they are about: `motor FR_calf.Temperature [C]`.
    """
    if message.__msgtype__ == _DIAGNOSTICS:
        return numbers_of_diagnostics(message)
    entries = _entries(store.fielddefs, (_NAME, None), message, "")
    return {name: float(x) for name, kind, x in entries if kind in _NUMPY_TYPES and name and name[:7] != "header."}


def numbers_of_diagnostics(message: Any) -> dict[str, float]:
    """The numbers that the texts of a DiagnosticArray hold."""
    pairs = [(f"{status.name}.{pair.key}", pair.value) for status in message.status for pair in status.values]
    said = [(name, match) for name, value in pairs if (match := _QUANTITY.fullmatch(value))]
    return {f"{name} [{match[2]}]" if match[2] else name: float(match[1]) for name, match in said}


def _entries(
    types: Mapping[str, Any], described: Any, value: Any, name: str | None, own: Sequence[str] = ()
) -> Iterator[tuple[str, str, Any]]:
    """All that a message, or a member of one, holds, in the order of its bytes: name, type and value.

    What is called `None` nobody asks for, and its members neither: their name is ''. The entries of an array are called
    by names of their `own`, or by their number.
    """
    form, inner = described
    if form == _NAME:
        joints, prefix = _joints(value), f"{name}." if name else ""
        for member, of_member in types[value.__msgtype__][1]:
            names: Sequence[str] = [f"{member}[{joint}]" for joint in joints] if hasattr(value, "effort") else ()
            if member in _NAMED_ELSEWHERE:
                names = joints if member == "interface_values" else getattr(value, "interface_names", ())
            hidden = name is None or (member == "header" and name)
            yield from _entries(types, of_member, getattr(value, member), None if hidden else prefix + member, names)
        return
    if form == _BASE:
        yield name or "", inner[0], value
        return
    if form == _SEQUENCE:
        yield "", _COUNT, len(value)
    element, prefix = inner[0], (name or "").rpartition(".")[0]
    if len(own) == len(value):
        own = [f"{prefix}.{entry}" if prefix else entry for entry in own]
    elif len(value) > _LONGEST and element[0] == _BASE and element[1][0] in _NUMPY_TYPES:
        yield "", element[1][0], value
        return
    else:
        own = [f"{name}[{k}]" if len(value) <= _LONGEST else "" for k in range(len(value))]
    for entry, called in zip(value, own, strict=True):
        yield from _entries(types, element, entry, (called or None) if name else None)


def _joints(message: Any) -> Sequence[str]:
    names = getattr(message, "joint_names", None) or getattr(message, "name", None)
    return names if isinstance(names, list) else ()


def deserialized(store: Any, raw: bytes, kind: str, ros_1: bool) -> Any:
    """A message of its bytes."""
    return store.deserialize_ros1(raw, kind) if ros_1 else store.deserialize_cdr(raw, kind)


def label_of(message: Any) -> Hashable:
    """What a message says of who sent it: its frame, and the names of its joints in their order."""
    return getattr(getattr(message, "header", None), "frame_id", ""), tuple(_joints(message))


# --- The quantities that messages of well-known types hold -----------------------------------------

_INTERFACES = {
    **dict.fromkeys(("temperature", "motor_temperature", "winding_temperature"), "temperature"),
    **dict.fromkeys(("effort", "torque", "tau_est", "tauEst"), "torque"),
    **dict.fromkeys(("current", "motor_current"), "current"),
    "dq": "velocity",
    **{name: name for name in ("velocity", "powered", "power", "torque_abs", "mechanical_power")},
}
# Words of topics that name a command and no reading.
_COMMANDED = {"cmd", "command", "commands", "desired", "target", "ref", "reference", "setpoint"}
_UNITREE = ("unitree_go/msg/LowState", "unitree_legged_msgs/msg/LowState")
"""Of Unitree's quadrupeds; humanoids (unitree_hg) have other orders of motors, and two temperatures each."""
_LEGS = [f"{leg}_{joint}" for leg in ("FR", "FL", "RR", "RL") for joint in ("hip", "thigh", "calf")]
"""Motors of Unitree's quadrupeds in their order, by its SDK, as its URDFs call them."""
_MOTOR = re.compile(r"motor_?[sS]tate\[(\d+)\]\.(temperature|tau_?[eE]st|dq)")
_TYPES = ("JointState", "DynamicJointState", "Temperature", "Odometry", "TwistStamped", *_UNITREE)


def quantities(topics: Mapping[str, tuple[str, Sequence[str]]]) -> dict[str, ColumnSource]:
    """Where quantities stand in messages of well-known types; of two topics that give one, the first by type.

    Of each topic it wants its messages' type, and the names of its numbers.
    """
    sources: dict[str, ColumnSource] = {}
    for kind in _TYPES:
        for topic, (own, names) in topics.items():
            if f"/{own}".endswith(f"/{kind}") and not _COMMANDED.intersection(words_of(topic)):
                for key, *columns in _known(kind, topic, names):
                    if is_key(key):
                        sources.setdefault(key, ColumnSource(tuple(f"{topic}.{name}" for name in columns)))
    return sources


def _known(kind: str, topic: str, names: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """The quantities among the numbers of a topic, each with the numbers that it is made of."""
    if kind == "JointState":
        for name in names:
            member, _, joint = name.removesuffix("]").partition("[")
            yield f"{(_INTERFACES | {'position': 'position'}).get(member, '')}.{joint}", name
    elif kind == "DynamicJointState":
        for name in names:
            joint, _, interface = name.rpartition(".")
            yield f"{_INTERFACES.get(interface, '')}.{joint}", name
    elif kind in _UNITREE:
        motors = [motor for name in names if (motor := _MOTOR.fullmatch(name)) and int(motor[1]) < len(_LEGS)]
        yield from ((f"{_INTERFACES[motor[2]]}.{_LEGS[int(motor[1])]}", motor[0]) for motor in motors)
    elif kind == "Temperature":
        words = [word for word in topic.split("/") if word and word not in {"temperature", "temp"}]
        place = "_".join(words).removesuffix("_temperature").removesuffix("_temp").removeprefix("temperature_")
        if "temperature" in names:
            yield f"temperature.{place}", "temperature"
    else:
        of_base = [name for name in names if name.endswith(("twist.linear.x", "twist.linear.y", "twist.linear.z"))]
        if len(of_base) == 3:
            yield "speed.base", *of_base


# --- Many messages read at once --------------------------------------------------------------------

_LAYOUTS = 8  # of a type that are read by their bytes
_LITTLE_ENDIAN = 1  # the second byte of a message
_PADDED = 4  # bytes, to a multiple of which a message may be filled up
_STAMP = {"header.stamp.sec": 10**9, "header.stamp.nanosec": 1}  # ns


class Decoder:
    """Reads some numbers from messages of one type.

    Messages that are laid out alike, as nearly all of a topic are, are read a few thousand at a time from where the
    numbers stand among their bytes; those of a ninth layout and on one by one, at many times the cost.

    Args:
        store: the types that rosbags knows.
        kind: of the messages.
        fields: names of the numbers, as `numbers_of` has them.
        ros_1: messages are encoded as ROS 1 does.
    """

    def __init__(self, store: Any, kind: str, fields: Sequence[str], ros_1: bool = False) -> None:
        self._store, self._kind, self._fields, self._ros_1 = store, kind, (*fields, *_STAMP), ros_1
        self.templates: list[_Template] = []
        self._learns = True

    def read(self, raws: Sequence[bytes]) -> tuple[IntArray, FloatArray, list[Hashable]]:
        """Header stamps, (n,) ns and 0 where there is none, and values, (n, fields), NaN where a message lacks one.

        And what each message says of who sent it.
        """
        values, labels = np.full((len(raws), len(self._fields)), np.nan), list[Hashable]([None] * len(raws))
        rest = np.arange(len(raws))
        for number in range(_LAYOUTS):
            if number == len(self.templates) and self._learns and rest.size:
                raw = raws[int(rest[0])]
                message, (expected, _) = deserialized(self._store, raw, self._kind, self._ros_1), self._one(raw)
                template = _Template(self._store, message, raw, self._fields, self._ros_1)
                # It is laid out in another way than its type says, perhaps.
                self._learns = template.usable and np.array_equal(template.read([raw])[0][0], expected, equal_nan=True)
                self.templates += [template] * self._learns
            if number == len(self.templates) or not rest.size:
                break
            template = self.templates[number]
            values_alike, like = template.read([raws[row] for row in rest.tolist()])
            values[rest[like]] = values_alike
            for row in rest[like].tolist():
                labels[row] = template.label
            rest = rest[~like]
        for row in rest.tolist():
            values[row], labels[row] = self._one(raws[row])
        stamps = np.nan_to_num(values[:, -len(_STAMP) :]).astype(np.int64) @ np.array(list(_STAMP.values()))
        return stamps, values[:, : -len(_STAMP)], labels

    def _one(self, raw: bytes) -> tuple[list[float], Hashable]:
        """The numbers of a message, and who sent it."""
        message = deserialized(self._store, raw, self._kind, self._ros_1)
        numbers = numbers_of(self._store, message)
        if (stamp := getattr(getattr(message, "header", None), "stamp", None)) is not None:
            numbers |= zip(_STAMP, (stamp.sec, stamp.nanosec), strict=True)
        return [numbers.get(name, np.nan) for name in self._fields], label_of(message)


class _Template:
    """A message whose bytes show where those of others like it have the fields' numbers; its sender.

    It is not `usable` where it is laid out in another way than its type says.
    """

    def __init__(self, store: Any, message: Any, raw: bytes, fields: Sequence[str], ros_1: bool) -> None:
        self.label, self._fields, self.usable = label_of(message), fields, False
        places: dict[str, tuple[int, str]] = {}
        # Bytes that are the same in all messages of this layout.
        fixed, end = ([], 0) if ros_1 else ([0, 1], _HEAD)
        for name, base, value in _entries(store.fielddefs, (_NAME, None), message, ""):
            if base not in _NUMPY_TYPES and base not in (_COUNT, _TEXT):
                return
            size = int(_NUMPY_TYPES.get(base, "4")[-1])
            begin = end if ros_1 else end + -(end - _HEAD) % size
            end = begin + size * np.size(value)
            if base in _NUMPY_TYPES:
                places[name] = begin, _NUMPY_TYPES[base]
            else:
                end += len(value.encode()) + (not ros_1) if base == _TEXT else 0
                fixed += range(begin, end)
        self.usable = end == len(raw) if ros_1 else raw[1] == _LITTLE_ENDIAN and 0 <= len(raw) - end < _PADDED
        self._places = [places.get(name) for name in fields]
        self._raw, self._fixed = np.frombuffer(raw, np.uint8), np.array(fixed, np.int64)

    def read(self, raws: Sequence[bytes]) -> tuple[FloatArray, BoolArray]:
        """Values, (alike, fields), NaN where there is none, of the messages that are laid out like it; which, (n,)."""
        like = np.array([len(raw) == self._raw.size for raw in raws])
        joined = b"".join(raw for raw in raws if len(raw) == self._raw.size)
        rows = np.frombuffer(joined, np.uint8).reshape(-1, self._raw.size)
        like[like] = same = (rows[:, self._fixed] == self._raw[self._fixed]).all(axis=1)
        rows, values = rows[same], np.full((int(same.sum()), len(self._places)), np.nan)
        for k, (begin, form) in ((k, place) for k, place in enumerate(self._places) if place):
            values[:, k] = np.ascontiguousarray(rows[:, begin : begin + int(form[-1])]).view(form)[:, 0]
        return values, like
