"""ROS 2 bags, written by rosbags as a robot's recorder would, and bombs that decompress to far more than they are."""

from __future__ import annotations

import io
import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import pytest

from lptn.logs import bags
from lptn.logs.bag_messages import quantities
from lptn.logs.columns import ColumnSource
from lptn.logs.reading import open_log, read_log

rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

Refuse = Callable[..., str]
CONTROL = {
    "control_msgs/msg/InterfaceValue": "string[] interface_names\nfloat64[] values\n",
    "control_msgs/msg/DynamicJointState": (
        "std_msgs/Header header\nstring[] joint_names\ncontrol_msgs/InterfaceValue[] interface_values\n"
    ),
    "maker_msgs/msg/Motor": "float32 temperature\nfloat32 tau_est\nint8 mode\n",
    "maker_msgs/msg/LowState": "std_msgs/Header header\nmaker_msgs/Motor[2] motor_state\nfloat32 power_v\n",
}
START = 1_700_000_000  # s


class Recorder:
    """Writes messages at times in s since START; the header's stamp may differ from the time of reception."""

    def __init__(self, path: Path, plugin: str) -> None:
        self.store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
        for name, text in CONTROL.items():
            self.store.register(typesys.get_types_from_msg(text, name))
        kinds = {"sqlite3": rosbag2.StoragePlugin.SQLITE3, "mcap": rosbag2.StoragePlugin.MCAP}
        self.writer = rosbag2.Writer(path, version=9, storage_plugin=kinds[plugin])
        self.connections: dict[str, Any] = {}

    def make(self, kind: str, *values: object) -> Any:
        package, _, name = kind.partition("/")
        return self.store.types[f"{package}/msg/{name}"](*values)

    def header(self, stamp: float | None) -> Any:
        whole = 0 if stamp is None else round((START + stamp) * 1e9)
        return self.make("std_msgs/Header", self.make("builtin_interfaces/Time", whole // 10**9, whole % 10**9), "")

    def send(self, topic: str, received: float, message: Any) -> None:
        kind = message.__msgtype__
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        raw = self.store.serialize_cdr(message, kind)
        self.writer.write(self.connections[topic], round((START + received) * 1e9), raw)

    def joints(self, stamp: float | None, names: list[str], velocity: list[float], effort: list[float]) -> Any:
        empty = np.zeros(0)
        return self.make(
            "sensor_msgs/JointState", self.header(stamp), names, empty, np.array(velocity), np.array(effort)
        )

    def dynamic(self, stamp: float | None, values: dict[str, dict[str, float]]) -> Any:
        entries = [
            self.make("control_msgs/InterfaceValue", list(interfaces), np.array(list(interfaces.values())))
            for interfaces in values.values()
        ]
        return self.make("control_msgs/DynamicJointState", self.header(stamp), list(values), entries)

    def twist(self, stamp: float, x: float, y: float) -> Any:
        linear = self.make("geometry_msgs/Vector3", x, y, 0.0)
        twist = self.make("geometry_msgs/Twist", linear, self.make("geometry_msgs/Vector3", 0.0, 0.0, 0.0))
        return self.make("geometry_msgs/TwistStamped", self.header(stamp), twist)


@pytest.fixture(params=["sqlite3", "mcap"])
def recorder(request: pytest.FixtureRequest, tmp_path: Path) -> Recorder:
    made = Recorder(tmp_path / "bag", request.param)
    made.writer.open()
    return made


def test_diagnostics_give_numbers_by_their_keys(recorder: Recorder, tmp_path: Path) -> None:
    """A driver of two motors and a computer take turns on one topic; values are text, some with units, some words."""
    for k in range(60):
        motors = [
            ("motor a", {"Temperature": f"{20 + 0.1 * k:.1f} C", "State": "enabled", "Bus voltage": "24.1V"}),
            ("motor b", {"Temperature": f"{86 + 0.18 * k:.2f} °F", "Firmware": "1.2.3"}),
        ]
        for group in (motors, [("cpu", {"Temperature": "55"})]):
            statuses = [
                recorder.make(
                    "diagnostic_msgs/DiagnosticStatus",
                    0,
                    name,
                    "OK",
                    "",
                    [recorder.make("diagnostic_msgs/KeyValue", key, value) for key, value in said.items()],
                )
                for name, said in group
            ]
            message = recorder.make("diagnostic_msgs/DiagnosticArray", recorder.header(float(k)), statuses)
            recorder.send("/diagnostics", float(k), message)
    recorder.writer.close()
    warm = ("/diagnostics.motor a.Temperature [C]", "/diagnostics.motor b.Temperature [°F]")
    table, _ = open_log(tmp_path / "bag", {})
    assert set(table.names) == {"time", *warm, "/diagnostics.motor a.Bus voltage [V]", "/diagnostics.cpu.Temperature"}
    columns = {"temperature.a": ColumnSource((warm[0],)), "temperature.b": ColumnSource((warm[1],), "degF")}
    (run,) = read_log(tmp_path / "bag", columns, outputs=list(columns))
    np.testing.assert_allclose(run.temperature("a"), 20 + 0.1 * np.arange(60), atol=0.01)
    np.testing.assert_allclose(run.temperature("b"), 30 + 0.1 * np.arange(60), atol=0.01)
    assert not run.issues


def test_topics_of_several_rates(recorder: Recorder, tmp_path: Path) -> None:
    for k in range(600):  # 10 Hz, 0.3 s under way
        stamp = 0.1 * k
        sign = (-1.0) ** k
        recorder.send(
            "/joint_states", stamp + 0.3, recorder.joints(stamp, ["a", "b"], [2 * sign, 0.0], [3 * sign, 1.0])
        )
        if k % 10 == 0:
            warm = {"a": {"temperature": 20 + stamp, "effort": 9.9}, "b": {"temperature": 30.0, "current": 2.5}}
            recorder.send("/dynamic_joint_states", stamp + 0.3, recorder.dynamic(stamp, warm))
            recorder.send("/base/twist", stamp + 0.3, recorder.twist(stamp, 0.3, 0.4))
            recorder.send("/cmd_vel", stamp + 0.3, recorder.twist(stamp, 9.0, 9.0))
        if k % 100 == 0:
            room = recorder.make("sensor_msgs/Temperature", recorder.header(stamp), 22.0, 0.0)
            recorder.send("/ambient_temperature", stamp + 0.3, room)
    recorder.writer.close()
    (run,) = read_log(tmp_path / "bag", step=1.0)
    assert run.name == "bag"
    assert run.averaged
    assert run.time[0] == pytest.approx(START, abs=1e-3)  # the header's, not the time of reception
    assert any("header stamps of" in note and "/joint_states" in note for note in run.notes)
    np.testing.assert_allclose(run.columns["torque.a"], 3.0)  # RMS; of two topics with a torque the joint states count
    np.testing.assert_allclose(run.columns["velocity.a"], 2.0)
    np.testing.assert_allclose(run.columns["mechanical_power.a"], 6.0)
    np.testing.assert_allclose(run.columns["current.b"], 2.5)
    np.testing.assert_allclose(run.columns["speed.base"], 0.5)
    np.testing.assert_allclose(run.columns["temperature.b"], 30.0)
    # A mean over [k, k+1), of a reading at k and one at k+1.
    np.testing.assert_allclose(run.temperature("a")[:-1], 20.5 + np.arange(len(run) - 1), atol=1e-3)
    assert len(run.fingerprint) == 64


def test_without_header_stamps_the_time_of_reception(recorder: Recorder, tmp_path: Path) -> None:
    for k in range(30):
        recorder.send("/joint_states", 1.0 * k, recorder.joints(None, ["a"], [1.0], [1.0]))
    recorder.writer.close()
    (run,) = read_log(tmp_path / "bag")
    assert run.time[0] == pytest.approx(START, abs=1e-3)
    assert "time: of /joint_states the time of reception; no usable header stamps." in run.notes


def test_a_topic_without_stamps_beside_one_with_its_own_clock(recorder: Recorder, tmp_path: Path) -> None:
    for k in range(30):  # a simulator's clock, a thousand seconds behind
        recorder.send("/joint_states", 1.0 * k, recorder.joints(k - 1000.0, ["a"], [1.0], [float(k)]))
        recorder.send("/t", k + 0.0, recorder.make("sensor_msgs/Temperature", recorder.header(None), 20.0 + k, 0.0))
    recorder.writer.close()
    (run,) = read_log(tmp_path / "bag")
    assert run.time[0] == pytest.approx(START - 1000, abs=1e-3)
    np.testing.assert_allclose(run.temperature("t"), 20 + run.columns["torque.a"], atol=1e-5)
    assert any("moved by -1000 s onto the header stamps' clock" in note for note in run.notes)


def test_joints_that_change_places_or_come_apart(recorder: Recorder, tmp_path: Path) -> None:
    for k in range(40):
        names = ["a", "b"] if k % 3 else ["b", "a"]
        effort = [1.0, 2.0] if k % 3 else [2.0, 1.0]
        recorder.send("/joint_states", 1.0 * k, recorder.joints(k, names, [0.0, 0.0], effort))
        recorder.send("/joint_states", k + 0.5, recorder.joints(k + 0.5, ["c"], [0.0], [3.0]))
    recorder.writer.close()
    (run,) = read_log(tmp_path / "bag", step=1.0)
    for joint, torque in (("a", 1.0), ("b", 2.0), ("c", 3.0)):
        np.testing.assert_allclose(run.columns[f"torque.{joint}"], torque)


def test_messages_of_a_maker_s_own_type(recorder: Recorder, tmp_path: Path) -> None:
    """Their definition is in the bag; their numbers are columns that a mapping can name."""
    for k in range(30):
        motors = [recorder.make("maker_msgs/Motor", 20.0 + k, 1.5, 1), recorder.make("maker_msgs/Motor", 30.0, 2.5, 1)]
        recorder.send("/lowstate", 1.0 * k, recorder.make("maker_msgs/LowState", recorder.header(k), motors, 48.0))
    recorder.writer.close()
    columns = {
        "temperature.hip": ColumnSource(("/lowstate.motor_state[0].temperature",)),
        "torque.knee": ColumnSource(("/lowstate.motor_state[1].tau_est",)),
    }
    (file,) = (entry for entry in (tmp_path / "bag").iterdir() if entry.suffix in {".mcap", ".db3"})
    for path in (tmp_path / "bag", file):
        (run,) = read_log(path, columns)
        np.testing.assert_allclose(run.temperature("hip"), 20.0 + np.arange(30))
        np.testing.assert_allclose(run.columns["torque.knee"], 2.5)


UNITREE = {
    "unitree_go/msg/MotorState": "uint8 mode\nfloat32 q\nfloat32 dq\nfloat32 tau_est\nuint8 temperature\n",
    "unitree_go/msg/LowState": "unitree_go/MotorState[20] motor_state\nuint32 tick\n",
}


def test_low_states_of_a_unitree_quadruped_are_known_by_its_order_of_motors(recorder: Recorder, tmp_path: Path) -> None:
    for name, text in UNITREE.items():
        recorder.store.register(typesys.get_types_from_msg(text, name))
    for k in range(30):
        motors = [recorder.make("unitree_go/MotorState", 1, 0.1, -0.5 * m, 1.0 + m, 30 + m + k // 3) for m in range(20)]
        recorder.send("/lowstate", 1.0 * k, recorder.make("unitree_go/LowState", motors, k))
    recorder.writer.close()
    (run,) = read_log(tmp_path / "bag")
    for motor, joint in ((0, "FR_hip"), (4, "FL_thigh"), (8, "RR_calf"), (11, "RL_calf")):
        np.testing.assert_allclose(run.temperature(joint), 30 + motor + np.arange(30) // 3, atol=0.5)
        np.testing.assert_allclose(run.columns[f"torque.{joint}"], 1.0 + motor)
        np.testing.assert_allclose(run.columns[f"velocity.{joint}"], 0.5 * motor)  # of magnitudes
    assert len([name for name in run.columns if name.startswith("temperature.")]) == 12
    assert not quantities({"/lowstate": ("unitree_hg/msg/LowState", ["motor_state[0].dq"])})  # of a humanoid


MIXED = {
    "maker_msgs/msg/Cell": "int8 temperature\nbool on\nstring label\nfloat64 x\nuint16[] counts\n",
    "maker_msgs/msg/Mixed": (
        "uint8 first\nstring text\nstd_msgs/Header header\nmaker_msgs/Cell[] cells\nfloat32 y\nint64 big\n"
        "uint8[] picture\nfloat64[3] triple\nbyte last\n"
    ),
}


def test_numbers_are_found_among_the_bytes_of_any_layout(tmp_path: Path) -> None:
    """The quick way, which looks at bytes, against rosbags' own reading of each message."""
    from lptn.logs.bag_messages import Decoder, numbers_of

    recorder = Recorder(tmp_path / "bag", "mcap")
    for name, text in MIXED.items():
        recorder.store.register(typesys.get_types_from_msg(text, name))
    rng = np.random.default_rng(5)

    def message(k: int, text: str) -> Any:
        cells = [
            recorder.make(
                "maker_msgs/Cell", int(rng.integers(-128, 127)), bool(k % 2), label, float(rng.normal()),
                rng.integers(0, 65535, size).astype(np.uint16)
            )
            for label, size in (("hip", 3), ("", 1), ("ankle", 0))
        ]  # fmt: skip
        picture = rng.integers(0, 255, 1001).astype(np.uint8)
        return recorder.make(
            "maker_msgs/Mixed", k % 256, text, recorder.header(k), cells, float(np.float32(rng.normal())),
            int(rng.integers(-(2**62), 2**62)), picture, rng.normal(size=3), 7
        )  # fmt: skip

    kind = "maker_msgs/msg/Mixed"
    messages = [message(k, "same" if k % 10 else "other text") for k in range(60)]
    raws = [bytes(recorder.store.serialize_cdr(original, kind)) for original in messages]
    wanted = list(numbers_of(recorder.store, messages[0]))
    assert {"cells[2].temperature", "cells[0].counts[2]", "y", "triple[1]", "last"} <= set(wanted)
    assert not any(name.startswith("picture") for name in wanted)
    decoder = Decoder(recorder.store, kind, wanted)
    stamps, values, labels = decoder.read(raws)
    assert len(labels) == len(raws)
    # The first's layout is that of one in ten.
    assert [template.read(raws)[1].sum() for template in decoder.templates] == [6, 54]
    whole = [recorder.store.deserialize_cdr(raw, kind) for raw in raws]
    expected = [list(numbers_of(recorder.store, message).values()) for message in whole]
    np.testing.assert_array_equal(values, expected)
    np.testing.assert_array_equal(stamps, [(START + k) * 10**9 for k in range(60)])


def test_a_field_that_is_called_header_need_not_be_one(tmp_path: Path) -> None:
    from lptn.logs.bag_messages import Decoder

    recorder, kind = Recorder(tmp_path / "bag", "mcap"), "maker_msgs/msg/Plain"
    recorder.store.register(typesys.get_types_from_msg("uint8 header\nfloat64 y\n", kind))
    raw = bytes(recorder.store.serialize_cdr(recorder.make("maker_msgs/Plain", 7, 2.5), kind))
    stamps, values, _ = Decoder(recorder.store, kind, ["y"]).read([raw])
    assert (stamps.tolist(), values.tolist()) == ([0], [[2.5]])


def test_a_file_of_lptn_virtual(tmp_path: Path) -> None:
    from lptn.virtual import Bout, Job, quadruped_logs, write_logs
    from tests.truth.bags import write_bag

    runs = {"mix": Job((Bout("trot", 300, 0.5), Bout("rest", 100)))}
    table = quadruped_logs(seed=1, runs=runs)["mix"]
    (one,), (other,) = map(read_log, (write_bag(tmp_path / "log.mcap", table), *write_logs(tmp_path, {"log": table})))
    assert set(one.columns) == set(other.columns)
    for name, values in one.columns.items():
        if name.startswith("velocity_rms."):  # no topic has it, so it follows from the one-second mean there
            continue
        np.testing.assert_allclose(values, other.columns[name], atol=1e-9, err_msg=name)


def test_a_joint_that_is_not_there_is_one_line(recorder: Recorder, tmp_path: Path, refuse: Refuse) -> None:
    for k in range(30):
        recorder.send("/joint_states", 1.0 * k, recorder.joints(k, ["FR_calf_joint"], [1.0], [1.0]))
    recorder.writer.close()
    path = tmp_path / "bag"
    said = refuse(path, read_log, path, inputs=["torque.FR_calf"], outputs=["temperature.FR_calf"])
    assert "--map torque.FR_calf=/joint_states.effort[FR_calf_joint][]" in said


def test_a_message_that_is_not_of_its_type_costs_its_topic_only(recorder: Recorder, tmp_path: Path) -> None:
    for k in range(30):
        recorder.send("/joint_states", 1.0 * k, recorder.joints(k, ["a"], [1.0], [1.0]))
        recorder.send("/t", 1.0 * k, recorder.make("sensor_msgs/Temperature", recorder.header(k), 20.0, 0.0))
        recorder.writer.write(recorder.connections["/t"], (START + k) * 10**9, b"\x00\x01\x00\x00abc")
    recorder.connections["/u"] = recorder.writer.add_connection(
        "/u", "sensor_msgs/msg/Temperature", typestore=recorder.store
    )
    recorder.writer.write(recorder.connections["/u"], START * 10**9, b"\x00\x01\x00\x00abc")
    recorder.writer.close()
    (run,) = read_log(tmp_path / "bag")
    assert run.has("torque.a")
    assert not run.has("temperature.u")
    assert "/t, /u: its messages do not decode as sensor_msgs/msg/Temperature; left out." in run.notes


def test_joints_in_messages_of_their_own_under_one_stamp(recorder: Recorder, tmp_path: Path) -> None:
    for k in range(200):
        for late, (joint, effort) in enumerate((("a", 2.0), ("b", 4.0))):
            recorder.send(
                "/joint_states", 0.1 * k + 0.001 * late, recorder.joints(0.1 * k, [joint], [-effort], [effort])
            )
    recorder.writer.close()
    (run,) = read_log(tmp_path / "bag", inputs=["torque.a", "torque.b"], optional=["signed_velocity.b"])
    np.testing.assert_allclose(run.columns["torque.a"], 2.0)
    np.testing.assert_allclose(run.columns["torque.b"], 4.0)
    np.testing.assert_allclose(run.columns["signed_velocity.b"], -4.0)  # as a search for a gait asks for it


def test_stamps_of_two_clocks_are_noted(recorder: Recorder, tmp_path: Path) -> None:
    for k in range(200):
        for ahead, topic, joint in ((0.0, "/one", "a"), (7.0, "/two", "b")):
            recorder.send(topic, 0.1 * k, recorder.joints(0.1 * k + ahead, [joint], [0.0], [1.0]))
    recorder.writer.close()
    (run,) = read_log(tmp_path / "bag")
    assert any("the header stamps of /two lie +7 s from those of /one" in note for note in run.notes)


def test_a_topic_of_two_types_is_read_as_its_first_and_that_is_noted(recorder: Recorder, tmp_path: Path) -> None:
    for k in range(100):
        recorder.send("/t", 1.0 * k, recorder.make("sensor_msgs/Temperature", recorder.header(k), 20.0, 0.0))
    first = recorder.connections.pop("/t")
    for k in range(100):
        recorder.send("/t", 1.0 * k, recorder.make("sensor_msgs/Illuminance", recorder.header(k), 900.0, 0.0))
    assert first.msgtype != recorder.connections["/t"].msgtype
    recorder.writer.close()
    (run,) = read_log(tmp_path / "bag", {"temperature.t": ColumnSource(("/t.temperature",))})
    np.testing.assert_allclose(run.temperature("t"), 20.0)
    assert "/t: of several types; only messages of sensor_msgs/msg/Temperature are read." in run.notes


def test_a_bag_without_numbers(recorder: Recorder, tmp_path: Path, refuse: Refuse) -> None:
    recorder.send("/chatter", 0.0, recorder.make("std_msgs/String", "hello"))
    recorder.writer.close()
    assert "no topic whose messages hold numbers" in refuse(tmp_path / "bag", read_log, tmp_path / "bag")


def test_a_cell_of_a_bag_is_named_by_its_time(recorder: Recorder, tmp_path: Path, refuse: Refuse) -> None:
    for k in range(30):
        torque = np.inf if k == 7 else 1.0
        recorder.send("/joint_states", 1.0 * k, recorder.joints(k, ["a"], [1.0], [torque]))
    recorder.writer.close()
    said = refuse(tmp_path / "bag", read_log, tmp_path / "bag")
    assert f"at {START + 7}.000000 s, column '/joint_states.effort[a]': found an infinite value" in said


@pytest.mark.parametrize("plugin", ["sqlite3", "mcap"])
def test_truncated_storage(tmp_path: Path, refuse: Refuse, plugin: str) -> None:
    recorder = Recorder(tmp_path / "bag", plugin)
    with recorder.writer:
        for k in range(500):
            recorder.send("/joint_states", 1.0 * k, recorder.joints(k, ["a"], [1.0], [1.0]))
    storage = next(entry for entry in (tmp_path / "bag").iterdir() if entry.suffix in {".db3", ".mcap"})
    storage.write_bytes(storage.read_bytes()[: storage.stat().st_size // 2])
    for path in (tmp_path / "bag", storage):
        assert "found a broken file" in refuse(path, read_log, path)


@pytest.mark.parametrize(
    "text", ["", "{", "rosbag2_bagfile_information: 3", "rosbag2_bagfile_information: {version: 5}"]
)
def test_broken_metadata(tmp_path: Path, refuse: Refuse, text: str) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "metadata.yaml").write_text(text)
    assert "found a broken file" in refuse(tmp_path / "bag", read_log, tmp_path / "bag")


EVIL = '"""\nimport pathlib; pathlib.Path("EVIL").touch()\n"""'


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        (f"evil_msgs/msg/A{EVIL}", "float64 x\n"),
        ("evil_msgs/msg/A", f"float64 x{EVIL}\n"),
        ("evil_msgs/msg/A", f"string X={EVIL!r}\nfloat64 x\n"),
        ("evil_msgs/msg/A", f"evil_msgs/B{EVIL} x\n"),
    ],
)
def test_a_definition_that_is_code_is_never_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, text: str
) -> None:
    """The library makes Python code of definitions; what is no plain name never gets there."""
    from rosbags.interfaces import MessageDefinition, MessageDefinitionFormat

    from lptn.logs import bags

    monkeypatch.chdir(tmp_path)
    connection = SimpleNamespace(msgtype=kind, msgdef=MessageDefinition(MessageDefinitionFormat.MSG, text))
    bags.store_of(Path("a.mcap"), [connection])
    assert not (tmp_path / "EVIL").exists()


@pytest.mark.parametrize(
    ("types", "plain"),
    [
        ({"a/msg/B": ([], [("x", (1, ("float64", 0)))])}, True),
        ({"a/msg/B": ([("X", "string", "any text")], [("x", (4, ((2, "a/msg/C"), 0)))])}, True),
        ({f"a/msg/B{EVIL}": ([], [("x", (1, ("float64", 0)))])}, False),
        ({"a/msg/B": ([], [(f"x{EVIL}", (1, ("float64", 0)))])}, False),
        ({"a/msg/B": ([(f"X{EVIL}", "string", "")], [])}, False),
        ({"a/msg/B": ([], [("x", (4, ((2, f"a/msg/C{EVIL}"), 0)))])}, False),
    ],
)
def test_which_definitions_are_plain(types: dict[str, Any], plain: bool) -> None:
    from lptn.logs import bags

    assert bags._plain(types) is plain


# --- Bags that decompress to far more than they are: refused before they fill the memory ------------------------------


storage = pytest.importorskip("rosbags.rosbag2.storage_mcap")
reader = pytest.importorskip("rosbags.rosbag2.reader")

_MAGIC = b"\x89MCAP0\r\n"
_SIZE = 256 << 20  # bytes that a bomb unfolds to
_COMPRESSED = {"zstd": reader.zstd.compress, "lz4": lz4.frame.compress}


def write_chunk(path: Path, way: str, data: bytes, declared: int, times: int = 1) -> None:
    """An MCAP file of one chunk, perhaps several times, without an index, as a recorder that was killed leaves it."""
    out, header, chunk, footer = (io.BytesIO() for _ in range(4))
    out.write(_MAGIC)
    for text in ("ros2", "test"):
        storage.write_string(header, text)
    storage.write_record(out, 1, header)
    chunk.write(struct.pack("<QQQI", 0, 1, declared, 0))
    storage.write_string(chunk, way)
    chunk.write(struct.pack("<Q", len(data)) + data)
    for _ in range(times):
        storage.write_record(out, 6, chunk)
    footer.write(struct.pack("<QQI", 0, 0, 0))
    storage.write_record(out, 2, footer)
    path.write_bytes(out.getvalue() + _MAGIC)


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
@pytest.mark.parametrize(("declared", "said"), [(1000, "more than the 1000 bytes"), (1 << 40, "in one piece")])
def test_a_chunk_that_unfolds_to_more_than_it_may(
    tmp_path: Path, refuse: Refuse, compression: str, declared: int, said: str
) -> None:
    path = tmp_path / "bomb.mcap"
    write_chunk(path, compression, _COMPRESSED[compression](bytes(_SIZE)), declared)
    tracemalloc.start()
    try:
        assert said in refuse(path, read_log, path)
        assert tracemalloc.get_traced_memory()[1] < _SIZE / 4
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_many_chunks_that_are_what_they_say(
    tmp_path: Path, refuse: Refuse, monkeypatch: pytest.MonkeyPatch, compression: str
) -> None:
    """Each is as large as it declares, and small; a thousand of them take a kilobyte each, and hours."""
    monkeypatch.setattr("lptn.logs.bags.UNPACKED", 1_000_000)
    path, size = tmp_path / "bomb.mcap", 9 * 44_500  # empty records of 9 bytes
    write_chunk(path, compression, _COMPRESSED[compression](bytes(size)), size, times=1000)
    assert "pieces that unfold to more than 0.001 GB and 50 times their size" in refuse(path, read_log, path)


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
@pytest.mark.parametrize(("content", "count"), [(999_991, 1), (9_991, 100), (591, 1000)])
def test_what_packs_to_nothing_since_nothing_moves_is_no_bomb(compression: str, content: int, count: int) -> None:
    """A simulated camera, a scan without an obstacle, joints at rest: chunks of a robot that stands, 400 MB of them."""
    chunk = (b"\5" + struct.pack("<Q", content) + bytes(content)) * count
    packed = _COMPRESSED[compression](chunk)
    with bags.bounded():
        for _ in range(400_000_000 // len(chunk)):
            assert len(storage.DECOMPRESSORS[compression](packed, len(chunk))) == len(chunk)


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_that_is_cut_off(tmp_path: Path, refuse: Refuse, compression: str) -> None:
    whole = _COMPRESSED[compression](bytes(range(256)) * 8)
    write_chunk(tmp_path / "cut.mcap", compression, whole[:-6], 2048)
    assert "cut off" in refuse(tmp_path / "cut.mcap", read_log, tmp_path / "cut.mcap")


def _channels(count: int, definition: bytes) -> bytes:
    """An MCAP file of so many topics, each with a type of its own, without messages."""

    def record(kind: int, content: bytes) -> bytes:
        return struct.pack("<BQ", kind, len(content)) + content

    def text(content: bytes) -> bytes:
        return struct.pack("<I", len(content)) + content

    out = [_MAGIC, record(1, text(b"ros2") + text(b""))]
    for k in range(1, count + 1):
        schema = text(b"a_msgs/msg/A%d" % k) + text(b"ros2msg") + text(definition)
        channel = text(b"/t%d" % k) + text(b"cdr") + struct.pack("<I", 0)
        out += [record(3, struct.pack("<H", k) + schema), record(4, struct.pack("<HH", k, k) + channel)]
    return b"".join([*out, record(15, bytes(4)), record(2, bytes(20)), _MAGIC])


@pytest.mark.parametrize(
    ("count", "definition", "said"),
    [
        (3000, b"float64 x\n", "3,000 channels; expected at most 2,000"),
        (1, b"float64 x\n" * 1_100_000, "11,000,000 characters that define messages"),
        (20, b"float64 x\n" * 60_000, "12,000,000 characters that define messages"),
        (20, b"float64 x\n", "no topic whose messages hold numbers"),
    ],
)
def test_definitions_and_channels_beyond_any_robot_are_refused_before_they_are_read(
    tmp_path: Path, refuse: Refuse, count: int, definition: bytes, said: str
) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(_channels(count, definition))
    assert said in refuse(path, read_log, path)


def test_a_bag_compressed_as_a_whole_may_not_fill_the_disk(
    tmp_path: Path, refuse: Refuse, monkeypatch: pytest.MonkeyPatch
) -> None:
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    writer = rosbag2.Writer(tmp_path / "bag", version=9)
    writer.set_compression(rosbag2.CompressionMode.FILE, rosbag2.CompressionFormat.ZSTD)
    with writer:
        pass
    (whole,) = (tmp_path / "bag").glob("*.zstd")
    whole.write_bytes(reader.zstd.compress(bytes(10_000_000)))
    with monkeypatch.context() as patch:
        patch.setattr("lptn.logs.bags.UNPACKED", 1_000_000)
        assert "a compressed file of more than 0.001 GB" in refuse(tmp_path / "bag", read_log, tmp_path / "bag")
    monkeypatch.setattr("lptn.logs.bags._SHARE", 0.0)
    assert "half of the disk" in refuse(tmp_path / "bag", read_log, tmp_path / "bag")
