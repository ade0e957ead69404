"""Bags that grow say what finished ones hold."""

from __future__ import annotations

import shutil
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lptn.basics.bounds import Bound
from lptn.basics.errors import InputError
from lptn.identify.data import load_model
from lptn.live.recordings import GrowingBag, _of_sqlite
from lptn.live.sources import Replay
from lptn.live.watch import Watch
from tests.live.robot import log, model_file

pytest.importorskip("rosbags", reason="the extra ros is not installed")
from tests.logs.test_bags import Recorder
from tests.logs.test_tables import ENDINGS, whole


def recorded(path: Path, plugin: str, seconds: int = 60) -> Path:
    """The finished bag of two motors: their torques, and sensors of their own."""
    recorder, places = Recorder(path, plugin), ("knee", "hip", "ambient")
    with recorder.writer:
        for row in log(seconds).to_dict("records"):
            now = row["time"]
            efforts = [row["torque.hip"], row["torque.knee"]]
            recorder.send("/joint_states", now, recorder.joints(now - 0.2, ["hip", "knee"], [0.0, 0.0], efforts))
            for place in places:
                reading = recorder.make("sensor_msgs/Temperature", recorder.header(now - 0.2),
                                        row[f"temperature.{place}"], 0.0)  # fmt: skip
                recorder.send(f"/{place}_temperature", now + 0.01, reading)
    return path


@contextmanager
def heard(source: GrowingBag) -> Iterator[Callable[[int], list[dict[str, Any]]]]:
    """All that a source has said, once that is so many messages or it has ended."""
    stop, said = threading.Event(), list[dict[str, Any]]()

    def run() -> None:
        try:
            source.run(stop)
            source.inbox.close()
        except InputError as error:
            source.inbox.close(error)

    def until(count: int) -> list[dict[str, Any]]:
        for _ in range(300):
            said.extend(payload for _, payload in source.inbox.take(0.1) if isinstance(payload, dict))
            if len(said) >= count or source.inbox.closed:
                break
        return said

    thread = threading.Thread(target=run)
    thread.start()
    yield until
    stop.set()
    thread.join(30)
    assert not thread.is_alive()


def efforts(said: list[dict[str, Any]]) -> list[float]:
    return [one["/joint_states.effort[knee]"] for one in said if "/joint_states.effort[knee]" in one]


def test_an_mcap_file_is_followed_to_its_footer(tmp_path: Path) -> None:
    (whole,) = recorded(tmp_path / "bag", "mcap").glob("*.mcap")
    content, grown = whole.read_bytes(), tmp_path / "grown.mcap"
    grown.write_bytes(b"")
    with heard(GrowingBag(grown)) as until, grown.open("ab", buffering=0) as stream:
        for first in range(0, len(content), len(content) // 9 + 1):  # in the middle of records, too
            assert until(0) is not None
            stream.write(content[first : first + len(content) // 9 + 1])
        said = until(240)
    assert efforts(said) == pytest.approx(log(60)["torque.knee"])
    times = [one["time"] for one in said if "/joint_states.effort[knee]" in one]
    np.testing.assert_allclose(np.subtract(times, times[0]), log(60)["time"], atol=1e-6)


def test_an_sqlite_bag_is_followed_from_file_to_file_until_it_is_closed(tmp_path: Path) -> None:
    (whole,) = recorded(tmp_path / "whole", "sqlite3").glob("*.db3")
    grown = tmp_path / "grown"
    grown.mkdir()

    def write(name: str, first: int, last: int) -> None:
        with closing(sqlite3.connect(grown / name)) as base:
            base.execute("PRAGMA journal_mode = WAL")
            base.execute("ATTACH ? AS whole", (str(whole),))
            for table in ("topics", "message_definitions"):
                base.execute(f"CREATE TABLE IF NOT EXISTS {table} AS SELECT * FROM whole.{table}")
            base.execute("CREATE TABLE IF NOT EXISTS messages AS SELECT * FROM whole.messages WHERE 0")
            base.execute("INSERT INTO messages SELECT * FROM whole.messages WHERE id BETWEEN ? AND ?", (first, last))
            base.commit()

    write("grown_9.db3", 1, 50)
    with heard(GrowingBag(grown)) as until:
        assert len(until(50)) == 50
        write("grown_9.db3", 51, 100)
        assert len(until(100)) == 100
        write("grown_10.db3", 101, 240)
        assert len(until(240)) == 240
        shutil.copy(whole.parent / "metadata.yaml", grown)
        said = until(1000)  # it ends by itself
    assert efforts(said) == pytest.approx(log(60)["torque.knee"])


def test_messages_whose_topics_cannot_be_read_yet_come_later(tmp_path: Path) -> None:
    (whole,) = recorded(tmp_path / "whole", "sqlite3", 5).glob("*.db3")
    with closing(sqlite3.connect(whole)) as base:
        base.execute("ALTER TABLE topics RENAME TO later")  # as if they were locked
        base.commit()
        batches = _of_sqlite(whole)
        assert next(batches) == []
        base.execute("ALTER TABLE later RENAME TO topics")
        base.commit()
        assert len(next(batches)) == 20


@pytest.mark.parametrize("number", [1, 150])
def test_a_broken_message_costs_no_other(tmp_path: Path, number: int) -> None:
    bag = recorded(tmp_path / "bag", "sqlite3")
    (file,) = bag.glob("*.db3")
    with closing(sqlite3.connect(file)) as base:
        base.execute("UPDATE messages SET data = ? WHERE id = ?", (b"\0\1\0\0?", number))
        base.commit()
    source = GrowingBag(bag)
    with heard(source) as until:
        assert len(until(1000)) == 239
    assert source.inbox.dropped == 1


@pytest.mark.long
@pytest.mark.parametrize("plugin", ["mcap", "sqlite3"])
def test_a_watch_of_a_finished_bag_says_what_its_replay_says(tmp_path: Path, plugin: str) -> None:
    bag, loaded = recorded(tmp_path / "bag", plugin, 120), load_model(model_file(tmp_path))
    grown, replayed = (
        Watch(loaded, source, limits=60.0, every=1e9).run() for source in (GrowingBag(bag), Replay(bag, 0.0, loaded))
    )
    for one, other in zip(grown.nodes, replayed.nodes, strict=True):
        assert one.temperature == pytest.approx(other.temperature, abs=0.1)
        assert one.trust == other.trust


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("nowhere.mcap", None, "source: found no such file; expected a ROS 2 bag that is recorded"),
        ("none.mcap", b"time,a\n0,1\n", r"none\.mcap: source: found a broken file \(its first bytes"),
        ("huge.mcap", b"\x89MCAP0\r\n\x06" + b"\xff" * 8, "at most 1,073,741,824"),
        ("none.db3", b"time,a\n0,1\n" * 100, r"none\.db3: source: found a broken file \(file is not a database"),
    ],
)
def test_what_is_no_bag_is_one_line(tmp_path: Path, name: str, content: bytes | None, message: str) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        GrowingBag(path).run(threading.Event())


def test_topics_are_bounded_as_those_of_a_finished_bag(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = recorded(tmp_path / "bag", "mcap", 10)
    monkeypatch.setattr("lptn.logs.bags._CHANNELS", Bound(2, "channels"))
    with pytest.raises(InputError, match="found 4 channels; expected at most 2"):
        GrowingBag(bag).run(threading.Event())


def test_a_folder_without_a_bag_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"found a folder without \.mcap or \.db3 files"):
        GrowingBag(tmp_path)


@pytest.mark.parametrize("ending", ENDINGS)
def test_logs_of_every_format_are_replayed_at_their_own_time(tmp_path: Path, ending: str) -> None:
    path, stop = tmp_path / f"log{ending}", threading.Event()
    path.write_bytes(whole(ending))
    names = {"torque.a": "esc_status.esc[0].esc_current", "temperature.a": "esc_status.esc[0].esc_temperature"}
    mapped = [f"{key}={name}" for key, name in names.items()] if ending == ".ulg" else []
    model = tmp_path / "model.toml"
    model.write_text(
        "[model]\nambient = 22.0\n[nodes.a]\ncapacity = 300\n[[links]]\nbetween = ['a', 'ambient']\nresistance = 5.0\n"
        "[[effects]]\nkind = 'copper_loss'\nat = 'a'\nresistance = 0.15\ntorque_constant = 0.84\n"
    )
    source = Replay(path, 100.0, load_model(model, mapped))
    began = time.monotonic()
    source.run(stop)
    taken = source.inbox.take(0.0)
    assert len(taken) >= 39
    assert time.monotonic() - began == pytest.approx(0.39, abs=0.3)  # 39 s, a hundred times as fast
    assert taken[-1][0] - taken[0][0] == pytest.approx(0.39, abs=0.1)
