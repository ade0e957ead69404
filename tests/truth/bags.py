"""Write a log in MCAP, as ROS 2 would record it.

The topics are /joint_states (velocity and effort of the joints; positions aren't simulated), /dynamic_joint_states
(temperature and, of joints, powered; of others, power; torque_abs and mechanical_power where the log has them),
/base_velocity and /ambient_temperature; a message of each a row.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

# Not among the types that come with ROS 2 itself: ros-controls/control_msgs, Apache-2.0.
DEFINITIONS = {
    "control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values\n",
    "control_msgs/msg/DynamicJointState": (
        "std_msgs/Header header\nstring[] joint_names\ncontrol_msgs/InterfaceValue[] interface_values\n"
    ),
}
QUANTITIES = ("temperature", "powered", "power", "torque_abs", "mechanical_power")


def write_bag(file: Path, log: pd.DataFrame) -> Path:
    """Write a log of `lptn.virtual`; columns that no topic has, such as ``speed.fan``, are left out."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    types = {name.replace("/msg/", "/"): made for name, made in store.types.items()}
    joints, nodes = (
        [name.partition(".")[2] for name in map(str, log) if name.startswith(quantity)]
        for quantity in ("torque.", "temperature.")
    )
    nodes.remove("ambient")
    own = [[quantity for quantity in QUANTITIES if f"{quantity}.{node}" in log] for node in nodes]
    efforts, velocities = (
        np.ascontiguousarray(log[[f"{name}.{joint}" for joint in joints]]) for name in ("torque", "velocity")
    )
    values = [
        np.ascontiguousarray(log[[f"{quantity}.{node}" for quantity in names]])
        for node, names in zip(nodes, own, strict=True)
    ]
    vector = types["geometry_msgs/Vector3"]

    def messages(k: int, header: Any) -> dict[str, Any]:
        states = [types["control_msgs/InterfaceValue"](names, x[k]) for names, x in zip(own, values, strict=True)]
        velocity = types["geometry_msgs/Twist"](vector(log["speed.base"][k], 0.0, 0.0), vector(0.0, 0.0, 0.0))
        return {
            "/joint_states": types["sensor_msgs/JointState"](header, joints, np.zeros(0), velocities[k], efforts[k]),
            "/dynamic_joint_states": types["control_msgs/DynamicJointState"](header, nodes, states),
            "/base_velocity": types["geometry_msgs/TwistStamped"](header, velocity),
            "/ambient_temperature": types["sensor_msgs/Temperature"](header, log["temperature.ambient"][k], 0.0),
        }

    with tempfile.TemporaryDirectory(dir=file.parent) as folder:
        bag = Path(folder) / "bag"
        writer = Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer:
            connections: dict[str, Any] = {}
            for k, nanoseconds in enumerate(np.rint(log["time"].to_numpy() * 1e9).astype(int).tolist()):
                stamp = types["builtin_interfaces/Time"](nanoseconds // 10**9, nanoseconds % 10**9)
                for topic, message in messages(k, types["std_msgs/Header"](stamp, "")).items():
                    if topic not in connections:
                        connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=store)
                    raw = store.serialize_cdr(message, message.__msgtype__)
                    writer.write(connections[topic], nanoseconds, raw)
        return next(bag.glob("*.mcap")).replace(file)
