"""Two publishers on one topic, or in one table, are not averaged: one is taken and said, or the log is refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from lptn.basics.arrays import FloatArray
from lptn.logs.columns import ColumnSource
from lptn.logs.reading import read_log
from lptn.logs.run import Run
from lptn.logs.streams import conflicts
from tests.logs.conftest import Refuse

rosbags = pytest.importorskip("rosbags")

from tests.logs.test_bags import START, Recorder  # noqa: E402 - only where there is the package

N = 400
LEVELS = np.repeat(np.random.default_rng(1).choice([0.0, 2.0, 4.0, 5.0, 6.0, 8.0], N // 20), 20)
OTHER = np.repeat(np.random.default_rng(2).choice([0.0, 2.0, 4.0, 5.0, 6.0, 8.0], N // 20), 20)
SPEED = 0.3 * np.sin(0.7 * np.arange(N))
Names = tuple[str, ...]


def bag(path: Path, plugin: str, second: Callable[[Recorder, int], Any]) -> Path:
    """A drive's messages once a second, and half a second later those of another node."""
    made = Recorder(path, plugin)
    made.writer.open()
    for k in range(N):
        made.send("/joint_states", 1.0 * k, made.joints(k, ["a", "b"], [SPEED[k], -SPEED[k]], [LEVELS[k], OTHER[k]]))
        if (message := second(made, k)) is not None:
            made.send("/joint_states", k + 0.5, message)
    made.writer.close()
    return path


def is_the_drive(runs: list[Run]) -> None:
    (run,) = runs
    rows = np.round(run.time - START).astype(int)
    assert rows[0] <= 1  # the first speed of all is zero, as another source's
    for key, truth in (("torque.a", LEVELS), ("torque.b", OTHER)):
        np.testing.assert_allclose(run.columns[key][: N - 2], truth[rows[: N - 2]])


def zeros(names: Names, every: int = 1, speeds: bool = False) -> Callable[[Recorder, int], Any]:
    def message(made: Recorder, k: int) -> Any:
        own = [SPEED[k], -SPEED[k]] if speeds else [0.0, 0.0]
        return made.joints(k + 0.5, list(names), own, [0.0, 0.0]) if k % every == 0 else None

    return message


PLUGINS = pytest.mark.parametrize("plugin", ["sqlite3", "mcap"])


@PLUGINS
@pytest.mark.parametrize(
    "second",
    [zeros(("b", "a")), zeros(("a", "b")), zeros(("a", "b"), 2), zeros(("b", "a"), 3), zeros(("a", "b"), 1, True)],
    ids=["other order", "same order", "every second", "every third", "true speeds"],
)
def test_a_stream_of_zeros_is_left_out(tmp_path: Path, plugin: str, second: Callable[[Recorder, int], Any]) -> None:
    runs = read_log(bag(tmp_path / "bag", plugin, second))
    is_the_drive(runs)
    assert any("left out" in note and "zero" in note for note in runs[0].notes)
    (run,) = read_log(tmp_path / "bag", step=1.0, inputs=["torque.a", "torque.b"], optional=["velocity.a"])
    np.testing.assert_allclose(run.columns["velocity.a"][1 : N - 1], np.abs(SPEED[1 : N - 1]), atol=0.2)


@PLUGINS
def test_bursts_of_zeros_are_left_out(tmp_path: Path, plugin: str) -> None:
    made = Recorder(tmp_path / "bag", plugin)
    made.writer.open()
    for k in range(N):
        made.send("/joint_states", 1.0 * k, made.joints(k, ["a", "b"], [0.1, 0.1], [LEVELS[k], OTHER[k]]))
        for late in (0.2, 0.4, 0.6, 0.8):
            made.send("/joint_states", k + late, made.joints(k + late, ["b", "a"], [0.0, 0.0], [0.0, 0.0]))
    made.writer.close()
    is_the_drive(read_log(tmp_path / "bag", step=1.0))


def half(made: Recorder, k: int) -> Any:
    return made.joints(k + 0.5, ["b", "a"], [0.0, 0.0], [OTHER[k] / 2, LEVELS[k] / 2])


def framed(made: Recorder, k: int) -> Any:
    message = made.joints(k + 0.5, ["a", "b"], [0.0, 0.0], [LEVELS[k] / 2, OTHER[k] / 2])
    message.header.frame_id = "desired"
    return message


def like_the_drive_s(made: Recorder, k: int) -> Any:
    return made.joints(k + 0.5, ["a", "b"], [0.0, 0.0], [LEVELS[k] / 2, OTHER[k] / 2])


@PLUGINS
def test_commands_that_know_no_speeds_are_left_out(tmp_path: Path, plugin: str) -> None:
    runs = read_log(bag(tmp_path / "bag", plugin, like_the_drive_s), step=1.0)
    is_the_drive(runs)
    assert any("left out" in note for note in runs[0].notes)


@PLUGINS
@pytest.mark.parametrize("second", [half, framed], ids=["other order", "other frame"])
def test_two_streams_that_both_speak_are_refused_until_one_is_named(
    tmp_path: Path, refuse: Refuse, plugin: str, second: Callable[[Recorder, int], Any]
) -> None:
    path = bag(tmp_path / "bag", plugin, second)
    said = refuse(path, read_log, path, inputs=["torque.a", "torque.b"])
    assert "/joint_states" in said
    assert "2 sources" in said
    assert "/joint_states:1.effort[" in said
    for number, share in ((1, 1.0), (2, 0.5)):
        named = {f"torque.{joint}": ColumnSource((f"/joint_states:{number}.effort[{joint}]",)) for joint in "ab"}
        (run,) = read_log(path, named, inputs=["torque.a", "torque.b"], step=1.0)
        usual = run.columns["torque.a"]
        assert np.median(np.abs(usual[: N - 2] - share * LEVELS[: N - 2])) < 1e-9


@pytest.mark.parametrize(
    ("one", "other", "differ"),
    [
        (LEVELS, LEVELS / 2, True),
        (LEVELS, 0 * LEVELS, True),
        (LEVELS, LEVELS, False),
        (30 + 0.01 * np.arange(N), 31 + 0.01 * np.arange(N), True),
        (SPEED, 0.9 * SPEED, False),  # a speed that nobody can follow from message to message
    ],
)
def test_channels_of_one_topic_that_differ_are_two_sources(one: FloatArray, other: FloatArray, differ: bool) -> None:
    """As recorders that keep publishers apart write MCAP; `rosbags` writes none such."""
    values = np.column_stack([one, other]).ravel()[:, None]
    found = conflicts(["effort[a]"], values, [(channel, ("", ("a",))) for _ in range(N) for channel in (1, 2)])
    assert bool(found) == differ
    assert not conflicts(
        ["effort[a]"], values, [(1 + (k > N), ("", ("a",))) for k in range(2 * N)]
    )  # one, then the other


def test_thermometers_that_share_a_topic_are_told_apart_by_their_frames(tmp_path: Path, refuse: Refuse) -> None:
    made = Recorder(tmp_path / "bag", "sqlite3")
    made.writer.open()
    for k in range(N):
        for frame, reading in (("a", 30 + 0.01 * k), ("b", 32 + 0.005 * k)):
            message = made.make("sensor_msgs/Temperature", made.header(k), reading, 0.0)
            message.header.frame_id = frame
            made.send("/motor/temperature", k + 0.001 * (frame == "b"), message)
    made.writer.close()
    assert "2 sources" in refuse(tmp_path / "bag", read_log, tmp_path / "bag")
    columns = {
        f"temperature.{name}": ColumnSource((f"/motor/temperature:{k}.temperature",))
        for k, name in ((1, "a"), (2, "b"))
    }
    (run,) = read_log(tmp_path / "bag", columns, outputs=["temperature.a", "temperature.b"], step=1.0)
    np.testing.assert_allclose(run.temperature("b"), 32 + 0.005 * np.arange(len(run)), atol=0.01)


def torque_of_a_gait(joint: int, k: np.ndarray | int) -> Any:
    """A measured torque that swings faster than it is logged, with pauses."""
    noise = np.random.default_rng(joint).normal(0, 0.05, 4 * N)[k]
    return np.round((np.asarray(k) // 60 % 3 > 0) * (4 + 3 * np.sin(1.9 * np.asarray(k) + joint)) + noise, 3)


@pytest.mark.parametrize("joints", [("grip",), ("a", "b"), ("hip", "thigh", "calf")], ids=len)
@pytest.mark.parametrize("speeds", [True, False], ids=["true speeds", "none"])
@pytest.mark.parametrize("every", [1, 2])
def test_zeros_that_take_turns_with_a_swinging_torque_are_left_out(
    tmp_path: Path, joints: Names, speeds: bool, every: int
) -> None:
    """The same connection, frame and order, and no course that would be steady."""
    made = Recorder(tmp_path / "bag", "mcap")
    made.writer.open()
    for k in range(2 * N):
        own = [float(np.round(np.sin(0.7 * k + j), 3)) for j in range(len(joints))]
        torque = [float(torque_of_a_gait(j, k)) for j in range(len(joints))]
        made.send("/joint_states", 1.0 * k, made.joints(k, list(joints), own, torque))
        if k % every == 0:
            zero = [0.0] * len(joints)
            second = made.joints(k + 0.4, list(joints), own if speeds else zero, zero)
            made.send("/joint_states", k + 0.4, second)
    made.writer.close()
    (run,) = read_log(tmp_path / "bag", step=1.0)
    assert any("another source" in note for note in run.notes)
    rows = np.round(run.time - START).astype(int)
    truth = torque_of_a_gait(0, rows)
    told = np.abs(run.columns[f"torque.{joints[0]}"] - np.abs(truth)) < 1e-6
    assert told.mean() > 0.95


@pytest.mark.parametrize("levels", [[0.0, 4.0], [0.0, 4.0, 0.0, -4.0], [0.0, 3.0, 0.0, 5.0]])
def test_a_joint_that_is_commanded_on_and_off_from_row_to_row_is_one_stream(levels: list[float]) -> None:
    torque = np.tile(levels, 2000 // len(levels)) * np.repeat(np.random.default_rng(0).choice([0.0, 1.0, 1.5], 40), 50)
    (run,) = read_log(frame_of(torque), step=1.0, strict=False, inputs=["torque.a"], outputs=["temperature.a"])
    assert not any("source" in note for note in run.notes)


# --- What is one stream all the same ----------------------------------------------------------------


def test_one_source_that_changes_its_order_or_frame_stays_one(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    for name, efforts in (("noise", rng.normal(0, 3, (N, 2))), ("levels", np.column_stack([LEVELS, OTHER]))):
        made = Recorder(tmp_path / name, "sqlite3")
        made.writer.open()
        for k in range(N):
            order = [0, 1] if rng.random() < 0.6 else [1, 0]
            message = made.joints(
                k, ["ab"[place] for place in order], [0.0, 0.0], [efforts[k, place] for place in order]
            )
            message.header.frame_id = "start" if k < N // 2 else "run"
            made.send("/joint_states", 1.0 * k, message)
        made.writer.close()
        (run,) = read_log(tmp_path / name, step=1.0)
        np.testing.assert_allclose(run.columns["torque.a"], np.abs(efforts[:, 0]))
        assert not any("source" in note or "left out" in note for note in run.notes)


def frame_of(torque: FloatArray, period: float = 0.1, other: FloatArray | None = None) -> pd.DataFrame:
    time = period * np.arange(torque.size)
    warm = 25 + 0.01 * np.cumsum(torque**2) * period / 10
    columns = {"time": time, "torque.a": torque, "temperature.a": warm}
    return pd.DataFrame(columns if other is None else columns | {"torque.b": other})


def swinging(rng: np.random.Generator, n: int) -> FloatArray:
    return np.asarray(5 * np.sin(2 * np.pi * 1.7 * 0.1 * np.arange(n)) + rng.normal(0, 0.3, n))


@pytest.mark.parametrize(
    "course",
    [
        lambda rng, n: np.repeat(rng.choice([0.0, 4.0], n // 10), 10),  # driven now and then
        lambda rng, n: np.where(np.arange(n) // 10 % 2, 4.0, 0.0),  # on and off, a second each
        lambda rng, n: np.round(rng.normal(0, 0.6, n)) * 0.02,  # at rest, in coarse steps
        lambda rng, n: np.round(swinging(rng, n)),  # through 0 in coarse steps
        lambda rng, n: swinging(rng, n),
        lambda rng, n: rng.normal(0, 3, n),
        lambda rng, n: 5 + 2 * np.sin(np.pi * 1.01 * np.arange(n)),  # a gait that is logged at twice its rate
        lambda rng, n: rng.choice([1.0, 2.0], n) * 0.02,
        lambda rng, n: np.abs(np.round(rng.normal(0, 1.5, n))),
    ],
)
def test_a_joint_that_rests_now_and_then_is_one_stream(
    course: Callable[[np.random.Generator, int], FloatArray],
) -> None:
    for seed in range(3):
        torque = course(np.random.default_rng(seed), 2000)
        runs = read_log(frame_of(torque), step=1.0, strict=False, inputs=["torque.a"], outputs=["temperature.a"])
        said = [*runs[0].notes, *(issue.sentence for issue in runs[0].issues)]
        assert not any("source" in note or "zero" in note for note in said), said


def test_speeds_that_are_zero_now_and_then_are_of_one_source() -> None:
    rng = np.random.default_rng(4)
    moves = np.repeat(rng.random(200) < 0.5, 10)[:, None]
    for speeds in (
        np.round(rng.normal(0, 0.5, (2000, 2))),  # in coarse steps
        moves * rng.normal(0, 3, (2000, 2)),  # moved now and then
        np.round(3 * np.sin(0.7 * np.arange(2000)))[:, None] * [1, -1],  # through zero, both at once, in coarse steps
    ):
        frame = frame_of(rng.normal(0, 3, 2000)).assign(**{"velocity.a": speeds[:, 0], "velocity.b": speeds[:, 1]})
        runs = read_log(frame, step=1.0, strict=False)
        assert not any("another source" in note for note in runs[0].notes)


# --- Tables ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("every", [1, 2])
def test_rows_of_zeros_between_those_of_a_drive_are_left_out(every: int) -> None:
    rows = []
    for k in range(N):
        rows.append((1.0 * k, LEVELS[k], OTHER[k], 25 + 0.01 * k))
        if k % every == 0:
            rows.append((k + 0.5, 0.0, 0.0, 25 + 0.01 * k))
    frame = pd.DataFrame(rows, columns=["time", "torque.a", "torque.b", "temperature.a"])
    (run,) = read_log(frame, step=1.0)
    np.testing.assert_allclose(run.columns["torque.a"][: N - 1], LEVELS[: N - 1])
    assert any("zero" in note and "left out" in note for note in run.notes)
