"""Where the numbers of a ROS 2 message stand among its bytes: CDR, little-endian, as one given message is laid out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

_TYPES = {
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
        made = cls()
        made._fields(store, kind, message, "", longest)
        return made

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
        if form == _BASE and inner[0] in _TYPES and len(values) > longest:
            size = int(_TYPES[inner[0]][-1])
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
        size = int(_TYPES[kind][-1])
        self._align(size)
        self.numbers[path] = self.end, _TYPES[kind]
        self.end += size

    def _count(self) -> None:
        self._align(4)
        self.fixed.append((self.end, self.end + 4))
        self.end += 4

    def _align(self, size: int) -> None:
        self.end += -(self.end - _HEAD) % size
