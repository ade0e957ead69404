"""ROS 1 bags: what a robot of either ROS says is read alike, compressed or not, and within bounds."""

from __future__ import annotations

import bz2
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import pytest

from lptn.logs.columns import ColumnSource
from lptn.logs.reading import open_log, read_log
from tests.logs.test_bags import CONTROL, START, Recorder

rosbag1 = pytest.importorskip("rosbags.rosbag1")
typesys = pytest.importorskip("rosbags.typesys")

Refuse = Callable[..., str]


class Recorder1(Recorder):
    """The same messages as ROS 1 encodes them, each publisher with a connection of its own."""

    def __init__(self, path: Path, compression: Any = None) -> None:
        self.store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
        for name, text in CONTROL.items():
            self.store.register(typesys.get_types_from_msg(text, name))
        self.writer = rosbag1.Writer(path)
        if compression is not None:
            self.writer.set_compression(compression)
        self.connections, self.sent = {}, 0

    def header(self, stamp: float | None) -> Any:
        self.sent += 1
        whole = 0 if stamp is None else round((START + stamp) * 1e9)
        time = self.make("builtin_interfaces/Time", whole // 10**9, whole % 10**9)
        return self.make("std_msgs/Header", self.sent, time, "walker")

    def send(self, topic: str, received: float, message: Any, publisher: str = "/driver") -> None:
        kind, who = message.__msgtype__, f"{topic} {publisher}"
        if who not in self.connections:
            self.connections[who] = self.writer.add_connection(topic, kind, typestore=self.store, callerid=publisher)
        raw = self.store.serialize_ros1(message, kind)
        self.writer.write(self.connections[who], round((START + received) * 1e9), raw)


def walk(recorder: Recorder, rows: int = 200) -> None:
    """Joints at 10 Hz, one name in two kinds of messages, temperatures each second, speed; a second late on arrival."""
    for k in range(rows):
        at = 0.1 * k
        recorder.send("/joint_states", at + 1, recorder.joints(at, ["a", "bb"], [0.1 * k, 2.0], [1.0 + 0.01 * k, -3.0]))
        recorder.send("/base", at + 1, recorder.twist(at, 0.3, 0.4))
        if k % 10 == 0:
            states = {"a": {"temperature": 30 + 0.02 * k}, "bb": {"temperature": 25.0 + 0.01 * k, "voltage": 24.0}}
            recorder.send("/dynamic", at + 1, recorder.dynamic(at, states))


@pytest.mark.parametrize("compression", [None, "BZ2", "LZ4"])
def test_either_ros_is_read_alike(tmp_path: Path, compression: str | None) -> None:
    first = Recorder1(tmp_path / "walk.bag", compression and getattr(rosbag1.Writer.CompressionFormat, compression))
    second = Recorder(tmp_path / "walk", "mcap")
    for recorder in (first, second):
        with recorder.writer:
            walk(recorder)
    columns = {"power.a": ColumnSource(("/dynamic.bb.voltage",))}
    (one,), (other,) = (read_log(tmp_path / name, columns, step=1.0) for name in ("walk.bag", "walk"))
    assert one.columns.keys() == other.columns.keys() >= {"torque.a", "velocity.bb", "temperature.a", "speed.base"}
    for name, values in one.columns.items():
        np.testing.assert_array_equal(values, other.columns[name], err_msg=name)
    np.testing.assert_allclose(one.columns["speed.base"], 0.5)
    np.testing.assert_allclose(one.columns["torque.a"][3], np.sqrt(np.mean((1.3 + 0.01 * np.arange(10)) ** 2)))


def test_two_publishers_on_one_topic_are_refused(tmp_path: Path, refuse: Refuse) -> None:
    recorder = Recorder1(tmp_path / "two.bag")
    with recorder.writer:
        for k in range(60):
            recorder.send("/joint_states", 1.0 * k, recorder.joints(k, ["a"], [1.0], [5.0 + 0.1 * (k % 3)]), "/left")
            recorder.send("/joint_states", k + 0.5, recorder.joints(k + 0.5, ["a"], [1.0], [9.0]), "/right")
    said = refuse(tmp_path / "two.bag", read_log, tmp_path / "two.bag")
    assert "connections 0 and 1, which say different things of velocity[a]" in said or "effort[a]" in said


def test_a_type_that_only_the_bag_defines(tmp_path: Path) -> None:
    recorder = Recorder1(tmp_path / "own.bag")
    with recorder.writer:
        for k in range(30):
            motors = [
                recorder.make("maker_msgs/Motor", 40.0 + k, 0.5, 1),
                recorder.make("maker_msgs/Motor", 30.0, 0.1, 1),
            ]
            message = recorder.make("maker_msgs/LowState", recorder.header(float(k)), motors, 24.0)
            recorder.send("/low_state", float(k), message)
    table, _ = open_log(tmp_path / "own.bag", {})
    assert "/low_state.motor_state[1].tau_est" in table.names
    columns = {"temperature.a": ColumnSource(("/low_state.motor_state[0].temperature",))}
    (run,) = read_log(tmp_path / "own.bag", columns, outputs=list(columns))
    np.testing.assert_allclose(run.temperature("a"), 40.0 + np.arange(30), atol=0.5)


@pytest.mark.parametrize("pack", [bz2.compress, lz4.frame.compress])
def test_a_chunk_that_unfolds_to_more_than_it_may(
    tmp_path: Path, refuse: Refuse, monkeypatch: pytest.MonkeyPatch, pack: Callable[[bytes], bytes]
) -> None:
    """In place of a good bag's chunk zeros stand that unfold to sixty times the bound."""
    size = 1_000_000
    monkeypatch.setattr("lptn.logs.bags.UNPACKED", size)
    monkeypatch.setattr("lptn.logs.bags.TIMES_PACKED", 1)
    way = rosbag1.Writer.CompressionFormat
    path = tmp_path / "bomb.bag"
    recorder = Recorder1(path, way.BZ2 if pack is bz2.compress else way.LZ4)
    recorder.writer.compressor = lambda _chunk: pack(bytes(60 * size))
    with recorder.writer:
        walk(recorder, 400)
    tracemalloc.start()
    try:
        assert "pieces that unfold to more than 0.001 GB" in refuse(path, read_log, path)
        assert tracemalloc.get_traced_memory()[1] < 30 * size
    finally:
        tracemalloc.stop()


def test_a_bag_that_was_not_closed(tmp_path: Path, refuse: Refuse) -> None:
    recorder = Recorder1(tmp_path / "cut.bag")
    with recorder.writer:
        walk(recorder)
    whole = (tmp_path / "cut.bag").read_bytes()
    (tmp_path / "cut.bag").write_bytes(whole[: len(whole) // 2])
    assert "`rosbag reindex`" in refuse(tmp_path / "cut.bag", read_log, tmp_path / "cut.bag")
