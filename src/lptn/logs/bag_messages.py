"""Numbers in ROS 2 messages: their names, the quantities that they are, and a quick way to read many."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lptn.basics.arrays import BoolArray, FloatArray, IntArray
from lptn.logs.columns import ColumnSource, is_key, words_of

# --- The numbers of a message, and their names -----------------------------------------------------


COMMON_TYPES = {  # that do not come with ROS 2 itself: ros-controls/control_msgs, Apache-2.0
    "control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values\n",
    "control_msgs/msg/DynamicJointState": (
        "std_msgs/Header header\nstring[] joint_names\ncontrol_msgs/InterfaceValue[] interface_values\n"
    ),
}
_LONGEST = 64  # entries of an array; longer ones are pictures and clouds


def numbers_in(message: Any) -> Iterator[tuple[str, float]]:
    """Each number in a message and its name: `twist.linear.x`, `motor_state[3].temperature`, `effort[FR_calf]`."""
    return ((name, value) for name, _, value in _named(message, ""))


def _named(message: Any, prefix: str) -> Iterator[tuple[str, str, float]]:
    """Name, path and value of each number; they differ where joints have names."""
    names = getattr(message, "joint_names", None) or getattr(message, "name", None)
    if hasattr(message, "interface_values") and names is not None:
        for row, (joint, entry) in enumerate(zip(names, message.interface_values, strict=False)):
            for column, (what, value) in enumerate(zip(entry.interface_names, entry.values, strict=False)):
                yield f"{prefix}{joint}.{what}", f"{prefix}interface_values[{row}].values[{column}]", float(value)
        return
    labels = names if isinstance(names, list) and hasattr(message, "effort") else None
    for member in fields(message):
        if member.name != "header" and not member.name.startswith("_"):
            path = f"{prefix}{member.name}"
            yield from _of_value(getattr(message, member.name), path, path, labels)


def _of_value(value: Any, name: str, path: str, labels: Sequence[str] | None) -> Iterator[tuple[str, str, float]]:
    if isinstance(value, bool | int | float | np.number):
        yield name, path, float(value)
    elif isinstance(value, np.ndarray | list) and len(value) <= _LONGEST:
        marks = labels if labels is not None and len(labels) == len(value) else range(len(value))
        for number, (mark, entry) in enumerate(zip(marks, value, strict=True)):
            yield from _of_value(entry, f"{name}[{mark}]", f"{path}[{number}]", None)
    elif is_dataclass(value):
        yield from _named(value, f"{path}.")


def label_of(message: Any) -> Hashable:
    """What a message says of who sent it: its frame, and the names of its joints in their order."""
    header = getattr(message, "header", None)
    names = getattr(message, "joint_names", None) or getattr(message, "name", None)
    return getattr(header, "frame_id", ""), tuple(names) if isinstance(names, list) else ()


# --- The quantities that messages of well-known types hold -----------------------------------------


_JOINT_STATE = {"velocity": "velocity", "effort": "torque", "position": "position"}
_INTERFACES = {
    "temperature": "temperature",
    "motor_temperature": "temperature",
    "winding_temperature": "temperature",
    "effort": "torque",
    "torque": "torque",
    "current": "current",
    "motor_current": "current",
    "velocity": "velocity",
    "powered": "powered",
    "power": "power",
    "torque_abs": "torque_abs",
    "mechanical_power": "mechanical_power",
}
# Words of topics that say what was wanted, and not what was.
_COMMANDED = {"cmd", "command", "commands", "desired", "target", "ref", "reference", "setpoint"}


def quantities(topics: Mapping[str, Sequence[str]], kinds: Mapping[str, str]) -> dict[str, ColumnSource]:
    """Where quantities stand in messages of well-known types; of two topics that give one, the first by type.

    Args:
        topics: for each topic the names of its numbers.
        kinds: for each topic its messages' type.
    """
    sources: dict[str, ColumnSource] = {}
    for kind, rule in _RULES.items():
        for topic, names in topics.items():
            if kinds[topic].endswith(f"/{kind}") and not _COMMANDED.intersection(words_of(topic)):
                for key, columns in rule(topic, names):
                    if is_key(key):
                        sources.setdefault(key, ColumnSource(tuple(f"{topic}.{name}" for name in columns)))
    return sources


def _joint_state(_: str, names: Sequence[str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    for name in names:
        field, _, joint = name.removesuffix("]").partition("[")
        if field in _JOINT_STATE and joint:
            yield f"{_JOINT_STATE[field]}.{joint}", (name,)


def _dynamic(_: str, names: Sequence[str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    for name in names:
        joint, _, what = name.rpartition(".")
        if what in _INTERFACES:
            yield f"{_INTERFACES[what]}.{joint}", (name,)


def _temperature(topic: str, names: Sequence[str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    words = [word for word in topic.split("/") if word and word not in {"temperature", "temp"}]
    place = "_".join(words).removesuffix("_temperature").removesuffix("_temp").removeprefix("temperature_")
    if "temperature" in names and place:
        yield f"temperature.{place}", ("temperature",)


def _base(_: str, names: Sequence[str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    columns = tuple(name for name in names if name.endswith(("twist.linear.x", "twist.linear.y", "twist.linear.z")))
    if len(columns) == 3:
        yield "speed.base", columns


_RULES = {
    "JointState": _joint_state,
    "DynamicJointState": _dynamic,
    "Temperature": _temperature,
    "Odometry": _base,
    "TwistStamped": _base,
}


# --- Where the numbers of a message stand among its bytes: CDR, little-endian, as one message is laid out ---


_NUMPY_TYPES = {
    "bool": "u1",
    "byte": "u1",
    "char": "u1",
    "uint8": "u1",
    "int8": "i1",
    "uint16": "<u2",
    "int16": "<i2",
    "uint32": "<u4",
    "int32": "<i4",
    "uint64": "<u8",
    "int64": "<i8",
    "float32": "<f4",
    "float64": "<f8",
}
_HEAD = 4  # bytes that say how a message is encoded
_LITTLE_ENDIAN = 1  # the second of them
_PADDED = 4  # bytes, to a multiple of which a message may be filled up
_BASE, _NAME, _ARRAY, _SEQUENCE = 1, 2, 3, 4  # kinds of types, as rosbags numbers them


@dataclass
class Layout:
    """The layout of one message.

    Attributes:
        numbers: first byte and numpy type of each number by its path, such as `motor_state[3].temperature`.
        fixed: spans of bytes, first and behind the last, that hold texts and counts: messages in which these are
            the same have the same layout.
        end: byte behind the message's last.
    """

    numbers: dict[str, tuple[int, str]] = field(default_factory=dict)
    fixed: list[tuple[int, int]] = field(default_factory=list)
    end: int = _HEAD

    @classmethod
    def of(cls, store: Any, kind: str, message: Any, longest: int) -> Layout:
        """The layout of a message; arrays longer than `longest` are passed over.

        Raises:
            KeyError: a type that is no number, text or message.
        """
        layout = cls()
        layout._fields(store, kind, message, "", longest)
        return layout

    def _fields(self, store: Any, kind: str, message: Any, prefix: str, longest: int) -> None:
        for name, described in store.fielddefs[kind][1]:
            self._value(store, described, getattr(message, name), f"{prefix}{name}", longest)

    def _value(self, store: Any, described: Any, value: Any, path: str, longest: int) -> None:
        form, inner = described
        if form == _NAME:
            self._fields(store, inner, value, f"{path}.", longest)
        elif form == _BASE:
            self._base(inner[0], value, path)
        else:
            if form == _SEQUENCE:
                self._count()
            self._many(store, inner[0], value, path, longest)

    def _many(self, store: Any, described: Any, values: Any, path: str, longest: int) -> None:
        form, inner = described
        if form == _BASE and inner[0] in _NUMPY_TYPES and len(values) > longest:
            size = int(_NUMPY_TYPES[inner[0]][-1])
            self._align(size)
            self.end += size * len(values)
            return
        for number, value in enumerate(values):
            self._value(store, described, value, f"{path}[{number}]", longest)

    def _base(self, kind: str, value: Any, path: str) -> None:
        if kind == "string":
            self._count()
            length = len(value.encode()) + 1
            self.fixed.append((self.end, self.end + length))
            self.end += length
            return
        size = int(_NUMPY_TYPES[kind][-1])
        self._align(size)
        self.numbers[path] = self.end, _NUMPY_TYPES[kind]
        self.end += size

    def _count(self) -> None:
        self._align(4)
        self.fixed.append((self.end, self.end + 4))
        self.end += 4

    def _align(self, size: int) -> None:
        self.end += -(self.end - _HEAD) % size


# --- Many messages read at once --------------------------------------------------------------------


_LAYOUTS = 8  # of a type that are read by their bytes


class Decoder:
    """Reads some numbers from messages of one type.

    Messages that are laid out alike, as nearly all of a topic are, are read a few thousand at a time from where the
    numbers stand among their bytes; those of a ninth layout and on one by one, at many times the cost.

    Args:
        store: the types that rosbags knows.
        kind: of the messages.
        wanted: names of the numbers, as `numbers_in` gives them.
    """

    def __init__(self, store: Any, kind: str, wanted: Sequence[str]) -> None:
        self._store, self._kind, self._wanted = store, kind, wanted
        self.templates: list[_Template] = []
        self._labels: list[Hashable] = []
        self._learns = True

    def read(self, raws: Sequence[bytes]) -> tuple[IntArray, FloatArray, list[Hashable]]:
        """Header stamps, (n,) ns and 0 where there is none, and values, (n, wanted), NaN where a message lacks one.

        And what each message says of who sent it.
        """
        stamps = np.zeros(len(raws), np.int64)
        labels: list[Hashable] = [None] * len(raws)
        values = np.full((len(raws), len(self._wanted)), np.nan)
        rest = np.arange(len(raws))
        for number in range(_LAYOUTS):
            if not rest.size or not self._has_template(number, raws[int(rest[0])]):
                break
            rows, like = self.templates[number].like([raws[row] for row in rest.tolist()])
            stamps[rest[like]], values[rest[like]] = self.templates[number].read(rows)
            for row in rest[like].tolist():
                labels[row] = self._labels[number]
            rest = rest[~like]
        for row in rest.tolist():
            message = self._store.deserialize_cdr(raws[row], self._kind)
            numbers = dict(numbers_in(message))
            values[row] = [numbers.get(name, np.nan) for name in self._wanted]
            labels[row] = label_of(message)
            if (header := getattr(message, "header", None)) is not None:
                stamps[row] = header.stamp.sec * 10**9 + header.stamp.nanosec
        return stamps, values, labels

    def _has_template(self, number: int, raw: bytes) -> bool:
        """Whether there is a template of this number, after a look at a message that none of the others fits."""
        if number == len(self.templates) and self._learns:
            template = _Template.of(self._store, self._kind, raw, self._wanted)
            self._learns = template is not None
            if template is not None:
                self.templates.append(template)
                self._labels.append(label_of(self._store.deserialize_cdr(raw, self._kind)))
        return number < len(self.templates)


@dataclass(frozen=True)
class _Template:
    """A message's bytes, those that show its layout, and where its stamp and the wanted numbers stand."""

    raw: NDArray[np.uint8]
    fixed: IntArray
    at: tuple[tuple[int, str], ...]
    stamp: tuple[tuple[int, str], ...]

    @classmethod
    def of(cls, store: Any, kind: str, raw: bytes, wanted: Sequence[str]) -> _Template | None:
        """`None` where the message is laid out in another way than `Layout` reads it."""
        message = store.deserialize_cdr(raw, kind)
        try:
            layout = Layout.of(store, kind, message, _LONGEST)
        except (KeyError, AttributeError, TypeError):
            return None
        paths = {name: path for name, path, _ in _named(message, "")}
        at = tuple(layout.numbers.get(paths.get(name, ""), (0, "")) for name in wanted)
        if raw[1] != _LITTLE_ENDIAN or not 0 <= len(raw) - layout.end < _PADDED:
            return None
        fixed = np.array([place for start, stop in layout.fixed for place in range(start, stop)], np.int64)
        clock = ("header.stamp.sec", "header.stamp.nanosec")
        stamp = tuple(layout.numbers[path] for path in clock if path in layout.numbers)
        template = cls(np.frombuffer(raw, np.uint8), fixed, at, stamp)
        values = template.read(template.raw[None])[1][0]
        numbers = dict(numbers_in(message))
        expected = [numbers.get(name, np.nan) for name in wanted]
        return template if np.array_equal(values, expected, equal_nan=True) else None

    def like(self, raws: Sequence[bytes]) -> tuple[NDArray[np.uint8], BoolArray]:
        """The messages laid out like this one as rows of bytes, and which they are, (n,)."""
        like = np.array([len(raw) == self.raw.size for raw in raws])
        joined = b"".join(raw for raw in raws if len(raw) == self.raw.size)
        rows = np.frombuffer(joined, np.uint8).reshape(-1, self.raw.size)
        same = (rows[:, self.fixed] == self.raw[self.fixed]).all(axis=1) & (rows[:, :2] == self.raw[:2]).all(axis=1)
        like[like] = same
        return rows[same], like

    def read(self, rows: NDArray[np.uint8]) -> tuple[IntArray, FloatArray]:
        """Stamps, (n,) ns and 0 without one, and values, (n, wanted), of rows of bytes."""
        stamps = np.zeros(len(rows), np.int64)
        for place, factor in zip(self.stamp, (10**9, 1), strict=False):
            stamps += factor * _column(rows, place).astype(np.int64)
        columns = [_column(rows, place).astype(np.float64) for place in self.at]
        return stamps, np.column_stack(columns) if columns else np.empty((len(rows), 0))


def _column(rows: NDArray[np.uint8], place: tuple[int, str]) -> NDArray[Any]:
    """The numbers that stand at one place of each row, (n,), in their own type; NaN for no place."""
    start, kind = place
    if not kind:
        return np.full(len(rows), np.nan)
    return np.ascontiguousarray(rows[:, start : start + int(kind[-1])]).view(kind)[:, 0]
