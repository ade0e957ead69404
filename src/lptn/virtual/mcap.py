"""Write a log as MCAP, as ROS 2 would record it.

Topics: /joint_states (velocity and effort of the joints; positions aren't simulated), /dynamic_joint_states
(temperature and, of joints, powered; of others, power; torque_abs and mechanical_power where the log has them),
/base_velocity and /ambient_temperature;
a message of each a row.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .robot import Array

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


def check_installed() -> None:
    """Say what is missing.

    Raises:
        ValueError: the package rosbags isn't installed.
    """
    if find_spec("rosbags") is None:
        raise ValueError("format: mcap needs the package rosbags; pip install 'lptn[robots]'")


@dataclass(frozen=True)
class Topic:
    """A topic: its messages have one layout, and only the time and the values of these columns differ."""

    name: str
    kind: str
    columns: list[str]
    make: Callable[[Array], Any]


def write(pieces: Iterable[pd.DataFrame], file: Path) -> None:
    """Write a log, given in pieces, to one file."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    store = _types()
    with tempfile.TemporaryDirectory(dir=file.parent, prefix=f"{file.name}.") as folder:
        bag = Path(folder) / "bag"
        writer = Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer:
            topics: list[tuple[Any, Topic, _Template]] = []
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


def _types() -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    return store


def _topics(columns: list[str], store: Any) -> list[Topic]:
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
        Topic("/joint_states", "sensor_msgs/msg/JointState", moving, joint_state),
        Topic(
            "/dynamic_joint_states",
            "control_msgs/msg/DynamicJointState",
            [name for names in own for name in names],
            dynamic,
        ),
        Topic("/base_velocity", "geometry_msgs/msg/TwistStamped", ["speed.base"], base),
        Topic("/ambient_temperature", "sensor_msgs/msg/Temperature", ["temperature.ambient"], ambient),
    ]


class _Template:
    """One serialised message and where its numbers stand: to serialise each one anew takes twenty times as long."""

    def __init__(self, topic: Topic, store: Any) -> None:
        marks: Array = MARK * np.arange(1.0, 1 + len(topic.columns))
        self.bytes = np.frombuffer(store.serialize_cdr(topic.make(marks), topic.kind), np.uint8)
        found = [self.bytes.tobytes().find(np.float64(mark).tobytes()) for mark in marks]
        self.at = np.array(found)[:, None] + np.arange(8)

    def fill(self, when: NDArray[np.int64], values: Array) -> NDArray[np.uint8]:
        """Return the messages of these times (ns) and values, of shape (messages, bytes)."""
        messages = np.tile(self.bytes, (len(when), 1))
        stamps = np.column_stack([when // 10**9, when % 10**9]).astype("<i4")
        messages[:, STAMP] = stamps.view(np.uint8).reshape(len(when), 8)
        messages[:, self.at.ravel()] = np.ascontiguousarray(values, "<f8").view(np.uint8).reshape(len(when), -1)
        return messages
