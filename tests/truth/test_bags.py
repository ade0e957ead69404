"""Check the bags of virtual logs, which readers are tried on: every value is in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lptn.virtual import QUADRUPED_JOINTS, QUADRUPED_NODES, Bout, Job, quadruped_logs

RUNS = {"mix": Job((Bout("trot", 500, 0.5), Bout("rest", 200)))}


def test_mcap_holds_every_value(tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="MCAP needs the extra 'robots'")
    from rosbags.highlevel import AnyReader

    from tests.truth.bags import write_bag

    log = quadruped_logs(seed=1, runs=RUNS, dropouts=0.05)["mix"]
    file = write_bag(tmp_path / "mix.mcap", log)
    assert sorted(tmp_path.iterdir()) == [file]
    topics: dict[str, list[tuple[float, Any]]] = {}
    with AnyReader([file]) as reader:
        for connection, stamp, raw in reader.messages():
            message: Any = reader.deserialize(raw, connection.msgtype)
            assert message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec == pytest.approx(stamp / 1e9)
            topics.setdefault(connection.topic, []).append((stamp / 1e9, message))
    joint, dynamic, base, ambient = (
        topics[topic] for topic in ("/joint_states", "/dynamic_joint_states", "/base_velocity", "/ambient_temperature")
    )
    assert [time for time, _ in joint] == log["time"].tolist()
    assert joint[0][1].name == list(QUADRUPED_JOINTS)
    for quantity, attribute in (("torque", "effort"), ("velocity", "velocity")):
        values = np.array([getattr(message, attribute) for _, message in joint])
        assert np.array_equal(values, log[[f"{quantity}.{name}" for name in QUADRUPED_JOINTS]])
    assert dynamic[0][1].joint_names == list(QUADRUPED_NODES)
    temperatures = np.array([[value.values[0] for value in message.interface_values] for _, message in dynamic])
    assert np.array_equal(temperatures, log[[f"temperature.{node}" for node in QUADRUPED_NODES]], equal_nan=True)
    assert dynamic[0][1].interface_values[0].interface_names == ["temperature", "powered"]
    assert dynamic[-1][1].interface_values[12].values[1] == log["power.pc"].iloc[-1]
    assert np.array_equal([message.twist.linear.x for _, message in base], log["speed.base"])
    assert np.array_equal([message.temperature for _, message in ambient], log["temperature.ambient"])
