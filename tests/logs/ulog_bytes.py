"""ULog bytes, written from the format's published description; shares nothing with the reader."""

from __future__ import annotations

import struct
from collections.abc import Iterable

FORMATS = {
    "esc_report": "uint64_t timestamp;int32_t esc_rpm;float esc_current;uint8_t esc_temperature;uint8_t[3] _padding0;",
    "esc_status": "uint64_t timestamp;uint8_t esc_count;uint8_t[7] _padding0;esc_report[4] esc;",
    "battery_status": "uint64_t timestamp;float voltage_v;float current_a;float temperature;uint8_t[4] _padding0;",
    "vehicle_local_position": "uint64_t timestamp;float vx;float vy;float vz;uint8_t[4] _padding0;",
}


def message(kind: str, content: bytes) -> bytes:
    """A message of a ULog: size, kind, content."""
    return struct.pack("<HB", len(content), ord(kind)) + content


def header() -> bytes:
    """The first 16 bytes."""
    return b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1_000_000)


def definitions(formats: dict[str, str]) -> bytes:
    """Format messages, then one subscription for each format."""
    text = b"".join(message("F", f"{name}:{fields}".encode()) for name, fields in formats.items())
    logged = (struct.pack("<BH", 0, number) + name.encode() for number, name in enumerate(formats))
    return text + b"".join(message("A", body) for body in logged)


def data(topic: str, content: bytes) -> bytes:
    """A data message of one of `FORMATS`."""
    return message("D", struct.pack("<H", list(FORMATS).index(topic)) + content)


def esc_status(time: float, count: int, escs: Iterable[tuple[int, float, int]]) -> bytes:
    """Speed [rpm], current [A] and temperature [degC] of four slots."""
    stamp = struct.pack("<Q", round(time * 1e6))
    slots = b"".join(stamp + struct.pack("<ifB3x", *esc) for esc in escs)
    return data("esc_status", stamp + struct.pack("<B7x", count) + slots)


def battery(time: float, voltage: float, current: float, temperature: float) -> bytes:
    """Voltage [V], current [A] and temperature [degC]."""
    return data("battery_status", struct.pack("<Qfff", round(time * 1e6), voltage, current, temperature))


def velocity(time: float, x: float, y: float, z: float) -> bytes:
    """Velocity over ground [m/s]."""
    return data("vehicle_local_position", struct.pack("<Qfff", round(time * 1e6), x, y, z))
