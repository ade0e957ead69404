"""PX4 ULog files opened as tables of number columns, called `topic.field`."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from lptn.basics.arrays import FloatArray, IntArray
from lptn.basics.errors import InputError
from lptn.logs.clock import in_order
from lptn.logs.columns import ColumnSource
from lptn.logs.tables import Source, Table, require_package, table_of_sources

_ESC = re.compile(r"(?P<topic>esc_status|esc_report)\.esc\[(?P<number>\d+)\]\.(?P<field>esc_\w+)")
_ESC_FIELDS = {
    "esc_temperature": ("temperature", "degC"),
    "esc_current": ("current", "A"),
    "esc_rpm": ("velocity", "rpm"),
}
_MOST_FIELDS, _DEEPEST = 20_000, 16  # of one topic, and types within types: more is no log's definition
_HEADER = 3  # bytes of a message's head: with nothing more the file ends well


def open_ulog(path: Path) -> Table:
    """Open a ULog: columns `topic.field`, of further instances `topic:1.field`; time is that since the start, in s.

    Known without a mapping, in the units that PX4 logs them in: each motor controller's temperature, current and
    speed (`temperature.esc0`), the battery's power and temperature, and the speed over ground.

    Raises:
        InputError: the package pyulog is not installed, or the file can't be read.
    """
    require_package(path, "pyulog", "a PX4 ULog", "pip install 'lptn[ulog]'")
    topics: dict[str, Mapping[str, Any]] = {}  # the fields of each, (n,); the time of a message, us, is `timestamp`
    noise = io.StringIO()  # the library prints what it finds odd
    with path.open("rb") as stream, redirect_stdout(noise):
        for data in _bounded_reader()(stream).data_list:
            if np.size(data.data.get("timestamp", ())):
                fields = {name: values for name, values in data.data.items() if "_padding" not in name}
                topics[data.name + (f":{data.multi_id}" if data.multi_id else "")] = fields
    columns = (f"{topic}.{field}" for topic, fields in topics.items() for field in fields if field != "timestamp")
    names = ("time", *columns)
    if len(names) == 1:
        raise InputError(path, "log", "no topic with numbers", "a ULog with esc_status or the like")
    defaults = _defaults(names, topics)
    notes = [f"{', '.join(defaults)}: known by PX4's names; the units are PX4's."] if defaults else []

    def sources(wanted: Sequence[str]) -> list[Source]:
        found, of_all = list[Source](), set(wanted)
        for topic, fields in topics.items():
            asked = [field for field in fields if f"{topic}.{field}" in of_all]
            if asked or of_all == {"time"}:
                time, rows, said = _timed(path, topic, np.asarray(fields["timestamp"], np.float64) / 1e6)  # us
                table.note(*said)
                found.append((time, {f"{topic}.{name}": np.asarray(fields[name], np.float64)[rows] for name in asked}))
        return found

    table = table_of_sources(path, names, sources, "PX4 ULog", defaults=defaults, notes=notes)
    return table


def _bounded_reader() -> Any:
    """The library's reader, with bounds: of what a definition may unfold to, and on files that end among definitions.

    A broken definition would fill the memory, and at such an end the library would go back for ever.
    """
    from pyulog import ULog

    class BoundedMessage(ULog._MessageAddLogged):  # type: ignore[misc]
        def _parse_nested_type(self, prefix: str, name: str, formats: Any) -> None:
            more = sum(max(size, 1) for _, size, _ in formats[name].fields)
            if len(self.field_data) + more > _MOST_FIELDS or prefix.count(".") > _DEEPEST:
                raise ValueError("a definition that unfolds to too many fields")
            super()._parse_nested_type(prefix, name, formats)

    class BoundedULog(ULog):  # type: ignore[misc]
        _MessageAddLogged = BoundedMessage

        def _read_file_definitions(self) -> None:
            whole: Any = self._file_handle

            def read(size: int) -> bytes:
                content: bytes = whole.read(size)
                if len(content) < size and (content or size != _HEADER):
                    raise EOFError("it ends among its definitions")
                return content

            self._file_handle: Any = SimpleNamespace(read=read, tell=whole.tell, seek=whole.seek)
            super()._read_file_definitions()
            self._file_handle = whole

    return BoundedULog


def _defaults(names: Sequence[str], topics: Mapping[str, Mapping[str, Any]]) -> dict[str, ColumnSource]:
    """Where quantities stand by PX4's names; slots of controllers that are not there are left out."""
    sources: dict[str, ColumnSource] = {}
    for match in filter(None, map(_ESC.fullmatch, names)):
        topic, number = topics[match["topic"]], int(match["number"])
        warm = topic.get(f"esc[{number}].esc_temperature")
        there = number < np.max(topic["esc_count"]) if "esc_count" in topic else warm is None or np.any(warm)
        if there and match["field"] in _ESC_FIELDS:
            quantity, unit = _ESC_FIELDS[match["field"]]
            sources[f"{quantity}.esc{number}"] = ColumnSource((match[0],), unit)
    several = {
        "power.battery": ColumnSource(("battery_status.voltage_v", "battery_status.current_a"), how="product"),
        "temperature.battery": ColumnSource(("battery_status.temperature",), "degC"),
        "speed.base": ColumnSource(tuple(f"vehicle_local_position.v{axis}" for axis in "xyz")),
    }
    return sources | {key: source for key, source in several.items() if set(source.columns) <= set(names)}


def _timed(path: Path, topic: str, stamps: FloatArray) -> tuple[FloatArray, IntArray, list[str]]:
    """Times of a topic's messages, (n,) s, and which they are, without those that have no time; notes.

    Raises:
        InputError: its clock goes back by more than a few messages.
    """
    rows = np.flatnonzero(stamps)  # PX4 writes 0 where it has no time
    lost, time = stamps.size - rows.size, stamps[rows]
    notes = [f"{topic}: {lost} message{'s' * (lost > 1)} without a time; left out."] if lost else []
    if (back := np.diff(time) < 0).any():
        if in_order(time) is None:
            before, now = rows[back.argmax() : back.argmax() + 2]
            found = f"{stamps[now]:.10g} s after {stamps[before]:.10g} s"
            raise InputError(path, f"{topic}, message {now + 1}", found, "time that runs forwards; cut the log there")
        notes.append(f"{topic}: messages out of order, by a few; sorted.")  # by `on_one_time`
    return time, rows, notes
