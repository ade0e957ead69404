"""Write logs to files, whole or not at all, in pieces that need not fit into memory together.

A file in MCAP is as ROS 2 would record it: the topics /joint_states (velocity and effort of the joints; positions
aren't simulated), /dynamic_joint_states (temperature and, of joints, powered; of others, power; torque_abs and
mechanical_power where the log has them), /base_velocity and /ambient_temperature; a message of each a row.
"""

from __future__ import annotations

import os
import secrets
import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .robot import Array, check_one_of

Format = Literal["parquet", "csv", "mcap"]


def write_logs(
    folder: str | Path,
    logs: Mapping[str, pd.DataFrame],
    format: Format = "parquet",  # noqa: A002
) -> list[Path]:
    """Write each log to ``<folder>/<name>.<format>``; makes the folder, replaces files that stand there.

    Returns:
        The files, in the order of the logs.

    Raises:
        ValueError: unknown format, or "mcap" without the package rosbags.
        OSError: the folder can't be written to.
    """
    return write_pieces(folder, ((name, (table,)) for name, table in logs.items()), format)


def write_pieces(
    folder: str | Path,
    logs: Iterable[tuple[str, Iterable[pd.DataFrame]]],
    format: Format = "parquet",  # noqa: A002
) -> list[Path]:
    """Write logs whose rows come in pieces, as ``write_logs`` does; only one piece is held at a time.

    Raises:
        ValueError: unknown format, or "mcap" without the package rosbags.
        OSError: the folder can't be written to.
    """
    check_one_of("format", format, get_args(Format))
    if format == "mcap" and find_spec("rosbags") is None:
        raise ValueError("format: mcap needs the package rosbags; pip install 'lptn[robots]'")
    write = {"parquet": _write_parquet, "csv": _write_csv, "mcap": _write_mcap}[format]
    folder = Path(folder)
    files = []
    for name, pieces in logs:
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / f"{name}.{format}"
        half = file.with_name(f".{file.name[:48]}.{secrets.token_hex(6)}.part")  # two processes may write one log
        try:
            write(pieces, half)
            # Forced to the disk, so that its new name never stands for less than the whole.
            with half.open("rb+") as opened:
                os.fsync(opened.fileno())
            half.replace(file)
        finally:
            half.unlink(missing_ok=True)
        files.append(file)
    return files


def _write_parquet(pieces: Iterable[pd.DataFrame], file: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    writer = None
    try:
        for piece in pieces:
            table = pa.Table.from_pandas(piece, preserve_index=False)
            # Measured values repeat too rarely for a dictionary to pay.
            writer = writer or pq.ParquetWriter(file, table.schema, compression="zstd", use_dictionary=False)
            writer.write_table(table)
    finally:
        if writer:
            writer.close()


def _write_csv(pieces: Iterable[pd.DataFrame], file: Path) -> None:
    with file.open("w", encoding="utf-8", newline="") as out:
        for k, piece in enumerate(pieces):
            piece.to_csv(out, index=False, header=k == 0, float_format="%.7g")


# --- MCAP ----------------------------------------------------------------------------------------------------------

# Not among the types that come with ROS 2 itself: ros-controls/control_msgs, Apache-2.0.
DEFINITIONS = {
    "control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values\n",
    "control_msgs/msg/DynamicJointState": (
        "std_msgs/Header header\nstring[] joint_names\ncontrol_msgs/InterfaceValue[] interface_values\n"
    ),
}
QUANTITIES = ("temperature", "powered", "power", "torque_abs", "mechanical_power")
UNSENT = ("power.battery", "speed.fan", "irradiance.global")
MARK = 1.2345678901234567e100  # the first of the numbers that a template is searched for
STAMP = slice(4, 12)  # bytes of a message that hold the header's time: after the encoding's mark


@dataclass(frozen=True)
class _Topic:
    """A topic: its messages have one layout, and only the time and the values of these columns differ."""

    name: str
    kind: str
    columns: list[str]
    make: Callable[[Array], Any]


def _write_mcap(pieces: Iterable[pd.DataFrame], file: Path) -> None:
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    store = _ros_types()
    with tempfile.TemporaryDirectory(dir=file.parent, prefix=f"{file.name}.") as folder:
        bag = Path(folder) / "bag"
        writer = Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer:
            topics: list[tuple[Any, _Topic, _Template]] = []
            for piece in pieces:
                if unsent := [name for name in UNSENT if name in piece]:
                    raise ValueError(f"format: mcap has no topic for {', '.join(unsent)}; expected parquet or csv")
                if not topics:
                    for topic in _topics(list(piece.columns), store):
                        connection = writer.add_connection(topic.name, topic.kind, typestore=store)
                        topics.append((connection, topic, _Template(topic, store)))
                when = np.rint(piece["time"].to_numpy() * 1e9).astype(np.int64)
                messages = [(c, form.fill(when, piece[topic.columns].to_numpy(float))) for c, topic, form in topics]
                for k, stamp in enumerate(when.tolist()):
                    for connection, rows in messages:
                        writer.write(connection, stamp, rows[k].data)
        next(bag.glob("*.mcap")).replace(file)


def _ros_types() -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    return store


def _topics(columns: list[str], store: Any) -> list[_Topic]:
    """Return the topics for a log with these columns."""
    types = {name.replace("/msg/", "/"): made for name, made in store.types.items()}
    header = types["std_msgs/Header"](types["builtin_interfaces/Time"](0, 0), "")
    joints = [column.partition(".")[2] for column in columns if column.startswith("torque.")]
    nodes = [c.partition(".")[2] for c in columns if c.startswith("temperature.") and c != "temperature.ambient"]
    own = [[f"{quantity}.{node}" for quantity in QUANTITIES] for node in nodes]
    own = [[name for name in names if name in columns] for names in own]
    state = types["sensor_msgs/JointState"]
    value = types["control_msgs/InterfaceValue"]
    vector = types["geometry_msgs/Vector3"]
    none = np.zeros(0)

    def joint_state(x: Array) -> Any:
        return state(header, joints, none, x[: len(joints)], x[len(joints) :])

    def dynamic(x: Array) -> Any:
        cuts = np.cumsum([len(names) for names in own])[:-1]
        quantities = [[name.partition(".")[0] for name in names] for names in own]
        values = [value(q, part) for q, part in zip(quantities, np.split(x, cuts), strict=True)]
        return types["control_msgs/DynamicJointState"](header, nodes, values)

    def base(x: Array) -> Any:
        still = vector(0.0, 0.0, 0.0)
        return types["geometry_msgs/TwistStamped"](header, types["geometry_msgs/Twist"](vector(x[0], 0.0, 0.0), still))

    def ambient(x: Array) -> Any:
        return types["sensor_msgs/Temperature"](header, x[0], 0.0)

    moving = [f"{quantity}.{joint}" for quantity in ("velocity", "torque") for joint in joints]
    return [
        _Topic("/joint_states", "sensor_msgs/msg/JointState", moving, joint_state),
        _Topic(
            "/dynamic_joint_states",
            "control_msgs/msg/DynamicJointState",
            [name for names in own for name in names],
            dynamic,
        ),
        _Topic("/base_velocity", "geometry_msgs/msg/TwistStamped", ["speed.base"], base),
        _Topic("/ambient_temperature", "sensor_msgs/msg/Temperature", ["temperature.ambient"], ambient),
    ]


class _Template:
    """One serialised message and where its numbers stand: to serialise each one anew takes twenty times as long."""

    def __init__(self, topic: _Topic, store: Any) -> None:
        marks: Array = MARK * np.arange(1.0, 1 + len(topic.columns))
        self.bytes = np.frombuffer(store.serialize_cdr(topic.make(marks), topic.kind), np.uint8)
        starts = [self.bytes.tobytes().find(np.float64(mark).tobytes()) for mark in marks]
        self.at = np.array(starts)[:, None] + np.arange(8)

    def fill(self, when: NDArray[np.int64], values: Array) -> NDArray[np.uint8]:
        """Return the messages of these times (ns) and values, of shape (messages, bytes)."""
        messages = np.tile(self.bytes, (len(when), 1))
        stamps = np.column_stack([when // 10**9, when % 10**9]).astype("<i4")
        messages[:, STAMP] = stamps.view(np.uint8).reshape(len(when), 8)
        messages[:, self.at.ravel()] = np.ascontiguousarray(values, "<f8").view(np.uint8).reshape(len(when), -1)
        return messages
