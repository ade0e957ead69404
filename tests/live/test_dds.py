"""Topics of ROS 2 and of Unitree's robots by DDS and Zenoh on loopback, published by types written anew."""

from __future__ import annotations

import json
import socket
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from lptn.basics.errors import InputError
from lptn.identify.data import load_model
from lptn.live.dds import Dds, DdsSink
from lptn.live.ros import RosSource, as_messages, message_types
from lptn.live.status import NodeStatus, Status
from lptn.live.watch import Watch
from tests.live.robot import log, model_file

pytest.importorskip("cyclonedds", reason="the extra dds is not installed")
DOMAIN = 77


def taken(source: RosSource, say: Any, until: int, seconds: float = 30.0) -> list[Any]:
    """What a source hears while something is said; an error of its thread fails the test."""
    stop, heard = threading.Event(), list[Any]()
    thread = threading.Thread(target=source.run, args=(stop,))
    thread.start()
    deadline = time.monotonic() + seconds
    while len(heard) < until and time.monotonic() < deadline:
        say()
        heard += [payload for _, payload in source.inbox.take(0.05)]
    stop.set()
    thread.join()
    return heard


def test_joint_states_and_temperatures_are_watched(tmp_path: Path) -> None:
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    from tests.live.ros_types import Header, JointState, Temperature, Time

    source, statuses = Dds("127.0.0.1", DOMAIN), list[Status]()

    class Kept:
        def show(self, status: Status) -> None:
            statuses.append(status)

        def close(self) -> None:
            pass

    watch = Watch(load_model(model_file(tmp_path)), source, [Kept()])
    thread = threading.Thread(target=watch.run)
    thread.start()
    participant = DomainParticipant(DOMAIN)
    states = DataWriter(participant, Topic(participant, "rt/joint_states", JointState))
    sensors = {
        place: DataWriter(participant, Topic(participant, f"rt/{place}_temperature", Temperature))
        for place in ("knee", "hip", "ambient")
    }
    rows, deadline = log(400).to_dict("records"), time.monotonic() + 60
    for row in rows:
        head = Header(Time(1000 + int(row["time"]), 0), "")
        efforts = [row["torque.hip"], row["torque.knee"]]
        states.write(JointState(head, ["hip", "knee"], [0.0, 0.0], [0.0, 0.0], efforts))
        for place, writer in sensors.items():
            writer.write(Temperature(head, row[f"temperature.{place}"], 0.0))
        time.sleep(0.02)
        if (statuses and statuses[-1].time >= 1050) or time.monotonic() > deadline:
            break
    watch.stop()
    thread.join(30)
    last = statuses[-1]
    assert last.time >= 1050
    readings = {one.node: one.reading for one in last.nodes}
    row = rows[int(last.time) - 1000]
    assert readings == {place: pytest.approx(row[f"temperature.{place}"], abs=0.3) for place in ("knee", "hip")}
    assert last.counts is not None
    assert last.counts["jumps"] == 0


def test_low_states_of_a_unitree_robot_have_the_names_of_bags() -> None:
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    source, types = Dds("127.0.0.1", DOMAIN + 1), message_types()
    go = "unitree_go::msg::dds_::"
    motors = [types[f"{go}MotorState_"](1, 0, -k, 0, 0.5 * k, 0, 0, 0, 30 + k, 0, [0, 0]) for k in range(20)]
    imu = types[f"{go}IMUState_"]([0] * 4, [0] * 3, [0] * 3, [0] * 3, 40)
    battery = types[f"{go}BmsState_"](0, 0, 0, 90, -1500, 3, [25, 26], [27, 28], [0] * 15)
    state = types[f"{go}LowState_"](
        [0] * 2, 0, 0, [0] * 2, [0] * 2, 0, imu, motors, battery, [0] * 4, [0] * 4, 7, [0] * 40, 0, 0.0, 33, 34,
        28.5, 1.5, [0] * 4, 0, 0,
    )  # fmt: skip
    participant = DomainParticipant(DOMAIN + 1)
    writer = DataWriter(participant, Topic(participant, "rt/lowstate", types[f"{go}LowState_"]))
    (heard, *_) = taken(source, lambda: writer.write(state), 1)
    assert heard["/lowstate.motor_state[3].temperature"] == 33
    assert heard["/lowstate.motor_state[4].tau_est"] == 2.0
    assert heard["/lowstate.temperature_ntc1"] == 33
    assert "time" not in heard
    assert not any("sample_info" in name for name in heard)  # how it was received is nothing that was said


def test_a_foreign_type_that_is_called_nearly_as_one_of_ros_is_passed_over() -> None:
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    from tests.live.ros_types import Foreign, Header, JointState, Time

    source, participant = Dds("127.0.0.1", DOMAIN + 5), DomainParticipant(DOMAIN + 5)
    foreign = DataWriter(participant, Topic(participant, "rt/foreign", Foreign))
    states = DataWriter(participant, Topic(participant, "rt/joint_states", JointState))

    def say() -> None:
        foreign.write(Foreign(1.0))
        states.write(JointState(Header(Time(5, 0), ""), ["hip"], [0.0], [0.0], [2.0]))

    (heard, *_) = taken(source, say, 1)
    assert heard["/joint_states.effort[hip]"] == 2.0


def test_a_publisher_that_ends_and_comes_back_is_heard_again() -> None:
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.topic import Topic

    from tests.live.ros_types import Header, JointState, Time

    source, participant = Dds("127.0.0.1", DOMAIN + 6), DomainParticipant(DOMAIN + 6)
    topic = Topic(participant, "rt/joint_states", JointState)
    writers, said = [DataWriter(participant, topic)], list[float]()

    def say() -> None:
        if len(said) == 10:  # the first one ends, and nobody publishes for a while
            writers.clear()
        if len(said) == 20:
            writers.append(DataWriter(participant, topic))
        said.append(float(len(said)))
        for writer in writers:
            writer.write(JointState(Header(Time(5, 0), ""), ["hip"], [0.0], [0.0], [said[-1]]))

    heard = [message["/joint_states.effort[hip]"] for message in taken(source, say, 30, seconds=3.0)]
    assert min(heard) < 10
    assert max(heard) > 20


def test_a_domain_that_is_none_is_one_line() -> None:
    with pytest.raises(InputError, match=r"dds://:999: source: found domain 999; expected a number from 0 to 232"):
        Dds("", 999)
    with pytest.raises(InputError, match="an interface of this machine"):
        Dds("203.0.113.7", DOMAIN + 2)


def test_a_domain_has_one_address_in_a_process() -> None:
    source = Dds("127.0.0.1", DOMAIN + 4)
    with pytest.raises(
        InputError, match=r"dds://127\.0\.0\.2:81: sink: found domain 81 at 127\.0\.0\.2, .* at 127\.0\.0\.1"
    ):
        DdsSink("127.0.0.2", DOMAIN + 4)
    assert source.name == "dds://127.0.0.1:81"


def test_a_status_goes_out_as_ros_messages_and_is_not_read_back() -> None:
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.pub import DataWriter
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic

    from tests.live.ros_types import Header, JointState, Temperature, Time

    knee = NodeStatus("left knee", 55.0, 54.0, 56.0, 55.1, 60.0, 300.0, 200.0, 400.0, "trusted")
    hip = NodeStatus("hip", 61.0, 60.5, 61.5, 20.0, 60.0, 0.0, 0.0, 0.0, "stands")
    source, sink = Dds("127.0.0.1", DOMAIN + 3), DdsSink("127.0.0.1", DOMAIN + 3)
    participant, types = DomainParticipant(DOMAIN + 3), message_types()
    diagnostics = types["diagnostic_msgs::msg::dds_::DiagnosticArray_"]
    said = DataReader(participant, Topic(participant, "rt/diagnostics", diagnostics))
    warm = DataReader(participant, Topic(participant, "rt/lptn/left_knee/temperature", Temperature))
    states = [DataWriter(participant, Topic(participant, "rt/joint_states", JointState))]

    def say() -> None:
        sink.show(Status(1000.5, (knee, hip)))
        states[0].write(JointState(Header(Time(1000, 0), ""), ["hip"], [0.0], [0.0], [2.0]))

    heard = taken(source, say, 30)
    assert {name for message in heard for name in message} == {
        "time", "/joint_states.position[hip]", "/joint_states.velocity[hip]", "/joint_states.effort[hip]",
    }  # fmt: skip
    states.clear()  # a publisher that ends is nothing that was published
    assert taken(source, lambda: None, 1, seconds=0.5) == []
    assert not source.inbox.closed
    (array, *_), (temperature, *_) = said.take(1), warm.take(1)
    assert temperature.temperature == 55.0
    assert (temperature.header.stamp.sec, temperature.header.stamp.nanosec) == (1000, 500_000_000)
    assert [(one.name, one.level, one.message) for one in array.status] == [
        ("lptn: left knee", 1, "near its limit"), ("lptn: hip", 2, "at its limit"), ("lptn: model", 0, ""),
    ]  # fmt: skip
    assert {pair.key: pair.value for pair in array.status[0].values}["torque scale"] == "0.4"


def test_nodes_have_topics_of_their_own_and_times_that_ros_can_say() -> None:
    names = "hip.l", "hip_l", "1"
    nodes = tuple(NodeStatus(name, 50.0, 49.0, 51.0, 50.0, None, None, None, None, "trusted") for name in names)
    for time_of, seconds in ((5.5, 5), (4e9, 0)):
        topics = dict(as_messages(Status(time_of, nodes)))
        assert list(topics) == [*(f"/lptn/{word}/temperature" for word in ("hip_l", "hip_l_1", "n1")), "/diagnostics"]
        assert topics["/diagnostics"].header.stamp.sec == seconds


def test_topics_of_zenoh_are_read_as_those_of_dds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    zenoh = pytest.importorskip("zenoh", reason="the extra zenoh is not installed")
    from lptn.live.zenoh import Zenoh
    from tests.live.ros_types import Header, JointState, Time

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        place = [f"tcp/127.0.0.1:{free.getsockname()[1]}"]
    alone = {"scouting": {"multicast": {"enabled": False}}}
    client = tmp_path / "zenoh.json5"
    client.write_text(json.dumps(alone | {"mode": "client", "connect": {"endpoints": place}}))
    monkeypatch.setenv("ZENOH_CONFIG", str(client))
    config = zenoh.Config.from_json5(json.dumps(alone | {"mode": "router", "listen": {"endpoints": place}}))
    state = JointState(Header(Time(5, 500_000_000), ""), ["hip", "knee"], [0.0, 0.0], [1.0, 2.0], [3.0, 4.0])
    with zenoh.open(config) as router:
        source = Zenoh("", 3)
        key = "3/left/joint_states/sensor_msgs::msg::dds_::JointState_/RIHS01_00"
        nonsense = key.replace("left", "right")

        def say() -> None:
            router.put("3/x", b"?")
            router.put(nonsense, b"?")
            router.put(key, state.serialize())

        (heard, *_) = taken(source, say, 3)  # the first broken one may be looked at for longer than the next
    assert source.inbox.dropped > 0
    assert heard["/left/joint_states.effort[knee]"] == 4.0
    assert heard["time"] == 5.5
    with pytest.raises(InputError, match=r"zenoh://:3: source: found Unable to connect .* expected a router there"):
        Zenoh("", 3)
