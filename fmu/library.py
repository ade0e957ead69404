"""Whether a shared library is whole: loading one that was cut off kills the process, so its headers are read first."""

from __future__ import annotations

import struct
from pathlib import Path


def fault(path: Path) -> str | None:
    """What is wrong with a shared library for Linux, Windows or macOS of 64 bits; `None` where nothing is.

    A library is whole where all that its headers say will be mapped lies inside the file.
    """
    content = path.read_bytes()
    try:
        end = _end(content)
    except (struct.error, ValueError):
        return "cut off or damaged in its headers"
    if end is None:
        return "no shared library of 64 bits"
    return None if end <= len(content) else f"cut off: {len(content)} bytes of at least {end}"


def _end(content: bytes) -> int | None:
    """How many bytes a library's headers ask for; `None` for a file of another kind."""
    if content[:5] == b"\x7fELF\x02":
        return _end_of_elf(content)
    if content[:2] == b"MZ":
        return _end_of_pe(content)
    mach = 0xFEEDFACF  # 64 bits, little-endian
    if content[:4] == struct.pack("<I", mach):
        return _end_of_mach(content)
    fat = 0xCAFEBABE  # Mach-O for several machines, big-endian
    if content[:4] == struct.pack(">I", fat):
        (count,) = struct.unpack_from(">I", content, 4)
        parts = [struct.unpack_from(">IIIII", content, 8 + 20 * row) for row in range(count)]
        return int(max(offset + size for _, _, offset, size, _ in parts))
    return None


def _end_of_elf(content: bytes) -> int:
    """The end of the last segment and of the section table (System V ABI, chapters 4 and 5)."""
    order = "<" if content[5] == 1 else ">"
    segments, sections = struct.unpack_from(f"{order}QQ", content, 32)
    size, count, section_size, section_count = struct.unpack_from(f"{order}HHHH", content, 54)
    ends = [segments + size * count, sections + section_size * section_count]
    for row in range(count):
        offset, _, _, in_file = struct.unpack_from(f"{order}QQQQ", content, segments + size * row + 8)
        ends.append(offset + in_file)
    return int(max(ends))


def _end_of_pe(content: bytes) -> int:
    """The end of the last section's raw data (PE format, section table)."""
    (head,) = struct.unpack_from("<I", content, 60)
    if content[head : head + 4] != b"PE\0\0":
        raise ValueError
    (count,) = struct.unpack_from("<H", content, head + 6)
    (optional,) = struct.unpack_from("<H", content, head + 20)
    table = head + 24 + optional
    ends = [table + 40 * count]
    for row in range(count):
        size, offset = struct.unpack_from("<II", content, table + 40 * row + 16)
        ends.append(size + offset)
    return int(max(ends))


def _end_of_mach(content: bytes) -> int:
    """The end of the last segment (<mach-o/loader.h>)."""
    commands, size = struct.unpack_from("<II", content, 16)
    position, ends = 32, [32 + size]
    segment = 0x19  # LC_SEGMENT_64
    for _ in range(commands):
        command, length = struct.unpack_from("<II", content, position)
        if command == segment:
            offset, in_file = struct.unpack_from("<QQ", content, position + 40)
            ends.append(offset + in_file)
        if length < 8:
            raise ValueError
        position += length
    return int(max(ends))
