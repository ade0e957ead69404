"""The loop: the answers of `forecast` and `monitor`, the state, sources that restart, sinks that others read."""

from __future__ import annotations

import json
import re
import socket
import threading
import time
import urllib.request
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.basics.errors import InputError
from lptn.identify.data import LoadedModel, load_model
from lptn.live.addresses import source_of
from lptn.live.assessment import Assessment, Question, assess
from lptn.live.sinks import Foxglove, Mcap, Prometheus, Rerun, metrics
from lptn.live.sources import GrowingFile, Lines, Push, Replay, Source, Udp, one_line_if_refused
from lptn.live.status import Status
from lptn.live.watch import Watch
from lptn.online.monitoring import monitor
from lptn.study import Study
from tests.live.robot import AIR, CAPACITY, FIT, PER_TORQUE, RESISTANCE, STEP, log, model_file, worn

LIMIT = 60.0


class Kept:
    """A sink that keeps all."""

    def __init__(self) -> None:
        self.all = list[Status]()

    def show(self, status: Status) -> None:
        self.all.append(status)

    def close(self) -> None:
        pass

    @property
    def events(self) -> list[str]:
        return [event for status in self.all for event in status.events]


@pytest.fixture(scope="module")
def loaded(tmp_path_factory: pytest.TempPathFactory) -> LoadedModel:
    return load_model(model_file(tmp_path_factory.mktemp("model")))


def pushed(rows: Iterable[dict[str, float]]) -> Push:
    """A source that has said some rows and ended."""
    source = Push(live=False)
    for row in rows:
        source.push(row)
    source.end()
    return source


def rows_of(frame: pd.DataFrame) -> list[dict[str, float]]:
    return [{str(key): float(value) for key, value in row.items()} for row in frame.to_dict("records")]


# --- the same answers as of the finished log --------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("rate", [1.0, 10.0])
def test_answers_are_those_of_forecast_and_monitor_on_the_finished_log(
    loaded: LoadedModel, tmp_path: Path, rate: float
) -> None:
    path, frame = tmp_path / "log.parquet", log(600, rate)
    frame["velocity.knee"] = 3.0 * np.sin(2 * np.pi * 1.3 * frame["time"])  # a gait, of which whole cycles are averaged
    frame.to_parquet(path)
    last = Watch(loaded, Replay(path, 0.0, loaded), limits=LIMIT, every=1e9).run()
    runs = loaded.runs([path])
    ahead = Study(loaded.file.path, holdout=[path]).forecast(LIMIT).result
    assert (ahead.window.period is None) == (rate == 1.0)
    assert {alarm.node for alarm in last.alarms} == {
        alarm.node for run in monitor(loaded.model, runs, rmse=0.1).runs for alarm in run.statistical_alarms
    }
    for one in last.nodes:
        expected = ahead.nodes[one.node]
        found = one.time_to_limit, one.earliest, one.latest
        assert found == pytest.approx((expected.time_to_limit, expected.low, expected.high), rel=1e-9)
        assert one.temperature == pytest.approx(expected.now, abs=0.05)
        assert one.trust == "trusted"


@pytest.mark.long
def test_the_time_to_the_limit_is_that_of_the_exact_solution(loaded: LoadedModel) -> None:
    frame = log(600)
    last = Watch(loaded, pushed(rows_of(frame)), limits={"hip": 50.0}, every=1e9).run()
    (hip,) = (one for one in last.nodes if one.node == "hip")
    settled, now = RESISTANCE * PER_TORQUE * 100.0, float(frame["temperature.hip"].iloc[-1]) - AIR
    exact = -RESISTANCE * CAPACITY * np.log((settled - (50.0 - AIR)) / (settled - now)) if settled > 28 else np.inf
    assert hip.time_to_limit == pytest.approx(exact, rel=0.1)
    assert hip.limit == 50.0
    assert [one.limit for one in last.nodes if one.node == "knee"] == [None]


@pytest.mark.long
def test_a_sensor_that_steps_is_named_as_it_happens(loaded: LoadedModel) -> None:
    frame = log(900)
    frame.loc[frame["time"] >= 600, "temperature.knee"] += 8.0
    kept = Kept()
    last = Watch(loaded, pushed(rows_of(frame)), [kept], every=80.0).run()
    assert [alarm.node for alarm in last.alarms] == ["knee"]
    first = next(status.time for status in kept.all if status.alarms)
    assert 600 < first <= 700
    assert not [status for status in kept.all if status.alarms and status.time < 600]
    assert any("knee" in event for event in kept.events)


@pytest.mark.long
def test_a_dead_sensor_is_not_trusted(loaded: LoadedModel) -> None:
    frame = log(900)
    frame.loc[frame["time"] >= 300, "temperature.hip"] = float(frame["temperature.hip"][300])
    last = Watch(loaded, pushed(rows_of(frame)), every=300.0).run()
    trust = {one.node: one.trust for one in last.nodes}
    assert trust["knee"] == "trusted"
    assert "bit for bit" in trust["hip"]
    assert [(alarm.node, alarm.kind) for alarm in last.alarms] == [("hip", "stuck")]
    (hip,) = (one for one in last.nodes if one.node == "hip")
    settled = AIR + RESISTANCE * PER_TORQUE * 100.0
    truth = settled + (float(log(900, noise=0)["temperature.hip"][450]) - settled) * np.exp(-449 / 1500)
    assert hip.low < truth < hip.high


@pytest.mark.long
@pytest.mark.parametrize("rate", [1.0, 10.0])
def test_a_torque_that_dies_while_its_joint_moves_is_named_as_in_the_finished_log(
    loaded: LoadedModel, tmp_path: Path, rate: float
) -> None:
    path, frame = tmp_path / "log.parquet", log(900, rate)
    rng = np.random.default_rng(1)
    for joint in ("knee", "hip"):
        frame[f"velocity.{joint}"] = 3.0 * np.sin(2 * np.pi * 0.13 * frame["time"]) + 0.01 * rng.standard_normal(
            len(frame)
        )
        frame[f"torque.{joint}"] += 0.05 * rng.standard_normal(len(frame))
    frame.loc[frame["time"] >= 400, "torque.hip"] = 0.0
    frame.to_parquet(path)
    kept = Kept()
    last = Watch(loaded, Replay(path, 0.0, loaded), [kept], every=300.0).run()
    (finished,) = monitor(loaded.model, loaded.runs([path], strict=False), rmse=0.1).runs
    assert [(alarm.channel, alarm.kind) for alarm in finished.statistical_alarms] == [("torque.hip", "input")]
    assert [(alarm.channel, alarm.kind) for alarm in last.alarms] == [("torque.hip", "input")]
    assert {alarm.channel for status in kept.all for alarm in status.alarms} == {"torque.hip"}


# --- gaps, clocks, joints that come and go -----------------------------------------------------------


@pytest.mark.long
def test_a_source_that_restarts_with_its_clock_goes_on(loaded: LoadedModel) -> None:
    """A logger that is started anew five times, whose clock begins at 0 each time."""
    frame = log(600)
    whole = Watch(loaded, pushed(rows_of(frame)), every=1e9).run()
    frame["time"] = frame["time"] % 100
    kept = Kept()
    source = Push()
    watch = Watch(loaded, source, [kept], every=1e9)
    # Messages are received a second apart.
    source.inbox._queue.extend((1000.0 + k, row) for k, row in enumerate(rows_of(frame)))
    source.end()
    last = watch.run()
    assert last.counts is not None
    assert (last.counts["jumps"], last.counts["gaps"]) == (5, 0)
    assert sum("jumped" in event for event in kept.events) >= 1
    for one, other in zip(last.nodes, whole.nodes, strict=True):
        assert one.temperature == pytest.approx(other.temperature, abs=0.01)


@pytest.mark.long
def test_a_joint_that_goes_and_comes_back(loaded: LoadedModel) -> None:
    frame = log(900)
    away = (frame["time"] > 300) & (frame["time"] < 500)
    frame.loc[away, ["torque.knee", "temperature.knee"]] = np.nan
    kept = Kept()
    last = Watch(loaded, pushed(rows_of(frame)), [kept], limits=LIMIT, every=1e9).run()
    assert last.counts is not None
    assert last.counts["gaps"] == 1
    assert "190 s without torque.knee: the estimate begins anew" in kept.events
    assert all(one.time_to_limit is not None for one in last.nodes)


@pytest.mark.long
def test_a_sensor_that_goes_costs_its_own_node_alone(loaded: LoadedModel) -> None:
    frame = log(600)
    frame.loc[frame["time"] > 300, "temperature.knee"] = np.nan
    last = Watch(loaded, pushed(rows_of(frame)), every=1e9).run()
    truth = log(600, noise=0).iloc[-1]
    for one in last.nodes:
        assert one.low - 1 < truth[f"temperature.{one.node}"] < one.high + 1
    assert last.counts is not None
    assert last.counts["gaps"] == 0


def test_of_a_flood_the_newest_win_and_the_rest_is_counted() -> None:
    source = Push()
    for k in range(25_000):
        source.push({"time": k})
    taken = source.inbox.take(0.0)
    assert len(taken) == 10_000
    assert taken[-1][1] == {"time": 24_999}
    assert source.inbox.dropped == 15_000


# --- the state -------------------------------------------------------------------------------------


@pytest.mark.long
def test_a_watch_goes_on_where_another_ended(loaded: LoadedModel, tmp_path: Path) -> None:
    rows, state = rows_of(log(700)), tmp_path / "watch.npz"
    whole = Watch(loaded, pushed(rows), limits=LIMIT, every=1e9).run()
    Watch(loaded, pushed(rows[:400]), limits=LIMIT, every=1e9, state=state).run()
    kept = Kept()
    last = Watch(loaded, pushed(rows[400:]), [kept], limits=LIMIT, every=1e9, state=state).run()
    assert "400 rows taken up" in kept.events[0]
    assert last.counts is not None
    assert last.counts["gaps"] == 0
    for one, other in zip(last.nodes, whole.nodes, strict=True):
        assert one.temperature == pytest.approx(other.temperature, abs=0.02)
        assert one.time_to_limit == pytest.approx(other.time_to_limit, rel=1e-9)


@pytest.mark.long
def test_memory_is_bounded(loaded: LoadedModel, tmp_path: Path) -> None:
    frame, state = log(1600).assign(time=lambda rows: 9 * rows["time"]), tmp_path / "watch.npz"
    Watch(loaded, pushed(rows_of(frame)), every=1e9, state=state).run()
    with np.load(state) as kept:
        assert kept["rows"][:, 0].tolist() == list(range(9 * 799, 9 * 1600, 9))  # of two hours


def test_a_state_of_another_model_or_none_is_refused(loaded: LoadedModel, tmp_path: Path) -> None:
    state = tmp_path / "watch.npz"
    Watch(loaded, pushed(rows_of(log(100))), state=state).run()
    other = tmp_path / "other.toml"
    other.write_text(loaded.file.path.read_text() + "\n# refitted\n")
    with pytest.raises(InputError, match="the state of another model"):
        Watch(load_model(other), pushed([]), state=state)
    state.write_bytes(state.read_bytes()[:1000])
    with pytest.raises(InputError, match="a state that lptn watch saved"):
        Watch(loaded, pushed([]), state=state)


# --- sources ---------------------------------------------------------------------------------------


def test_udp_on_loopback(loaded: LoadedModel) -> None:
    source, kept = Udp("127.0.0.1", 0), Kept()
    watch = Watch(loaded, source, [kept], limits=LIMIT)
    thread = threading.Thread(target=watch.run)
    thread.start()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for row in rows_of(log(80)):
            sender.sendto(json.dumps(row).encode(), ("127.0.0.1", source.port))
            time.sleep(0.001)
        deadline = time.monotonic() + 60
        while (not kept.all or kept.all[-1].counts["rows"] < 80) and time.monotonic() < deadline:  # type: ignore[index]
            time.sleep(0.05)
    watch.stop()
    thread.join(30)
    assert not thread.is_alive()
    assert kept.all[-1].counts == {"messages": 80, "rows": 80, "gaps": 0, "dropped": 0, "bad": 0, "late": 0, "jumps": 0}


def test_a_file_that_grows_and_is_rotated(loaded: LoadedModel, tmp_path: Path) -> None:
    path, frame, kept = tmp_path / "log.csv", log(60), Kept()
    frame.iloc[:20].to_csv(path, index=False)
    watch = Watch(loaded, GrowingFile(path), [kept])
    thread = threading.Thread(target=watch.run)
    thread.start()

    def until(rows: int) -> None:
        deadline = time.monotonic() + 30
        while (not kept.all or kept.all[-1].counts["rows"] < rows) and time.monotonic() < deadline:  # type: ignore[index]
            time.sleep(0.05)

    until(20)
    with path.open("a") as stream:
        stream.write(frame.iloc[20:40].to_csv(index=False, header=False))
    until(40)
    path.rename(tmp_path / "old.csv")
    frame.iloc[40:].to_csv(path, index=False)
    until(60)
    watch.stop()
    thread.join(30)
    assert kept.all[-1].counts is not None
    assert kept.all[-1].counts["rows"] == 60
    assert kept.all[-1].time == 59


@pytest.mark.long
def test_lines_of_a_stream(loaded: LoadedModel, tmp_path: Path) -> None:
    path, frame = tmp_path / "lines.json", log(120)
    path.write_text("\n".join([*map(json.dumps, rows_of(frame)), "{broken"]))
    with path.open("rb") as stream:
        last = Watch(loaded, Lines(stream.fileno()), limits=LIMIT).run()
    assert last.time == 119
    assert last.counts is not None
    assert last.counts["bad"] == 1


@pytest.mark.long
def test_a_log_is_replayed_at_its_own_time(loaded: LoadedModel, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    log(40).to_csv(path, index=False)
    began = time.monotonic()
    Watch(loaded, Replay(path, 20.0, loaded)).run()
    assert time.monotonic() - began > 1.9


@pytest.mark.parametrize(
    ("text", "replay", "message"),
    [
        ("nowhere.csv", None, "nowhere.csv: source: found no such file"),
        ("nowhere.csv", 1.0, "nowhere.csv: log: found no such file"),
        ("udp://127.0.0.1", None, "found no port; expected udp://HOST:PORT"),
        ("udp://[::1", None, "found no port; expected udp://HOST:PORT"),
        ("http://127.0.0.1:80", None, "found the scheme http"),
        ("walk.bag", None, "--replay SPEED"),
        ("walk.csv.gz", None, "--replay SPEED"),
    ],
)
def test_a_source_that_is_none_is_one_line(loaded: LoadedModel, text: str, replay: float | None, message: str) -> None:
    with pytest.raises(InputError, match=message):
        source_of(text, loaded, replay)


def test_a_source_without_a_row_is_one_line(loaded: LoadedModel) -> None:
    with pytest.raises(InputError, match="callback: source: found 0 messages"):
        Watch(loaded, pushed([])).run()


def test_a_source_that_fails_says_why(loaded: LoadedModel) -> None:
    class Broken(Source):
        def run(self, stop: threading.Event) -> None:
            raise InputError(self.name, "cable", "none", "one")

    with pytest.raises(InputError, match="robot: cable: found none"):
        Watch(loaded, Broken("robot", live=False)).run()


def test_another_unit_is_refused_as_in_logs(loaded: LoadedModel) -> None:
    frame = log(120)
    for column in ("temperature.knee", "temperature.hip", "temperature.ambient"):
        frame[column] += 273.15
    with pytest.raises(InputError, match="unit"):
        Watch(loaded, pushed(rows_of(frame)), limits=LIMIT).run()


# --- a robot that is not its model any more ----------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("resistance", [RESISTANCE, 1.4 * RESISTANCE])
def test_a_joint_that_has_changed_is_told_and_learnt(tmp_path: Path, resistance: float) -> None:
    own, kept, path = load_model(model_file(tmp_path, FIT, STEP)), Kept(), tmp_path / "learnt.toml"
    source = pushed(rows_of(worn(7200, 3000.0, resistance)))
    last = Watch(own, source, [kept], every=1200.0, learn=path).run()
    told = [event for event in kept.events if "not as its model" in event or event.startswith("likely cause")]
    values = load_model(path).model.named
    assert values["resistance.ambient~hip"].value == pytest.approx(RESISTANCE, rel=0.02)
    assert values["resistance.ambient~knee"].value == pytest.approx(resistance, rel=0.02)
    if resistance == RESISTANCE:
        assert told == []
        assert last.changed is None
        return
    assert last.changed is not None
    assert 3000.0 < last.changed < 4500.0
    assert re.match(r"the robot is not as its model any more, since \d+ s: .*knee", told[0])
    assert re.match(r"likely cause: surface_scale at knee, (9\d|> 99) % probable", told[-1])


def test_readings_of_a_false_sensor_teach_nothing(tmp_path: Path) -> None:
    own, path = load_model(model_file(tmp_path, FIT, STEP)), tmp_path / "learnt.toml"
    frame = worn(1800, np.inf, RESISTANCE)
    frame["temperature.knee"] = 25.0 + 0.05 * np.random.default_rng(1).standard_normal(len(frame))
    Watch(own, pushed(rows_of(frame)), every=1200.0, learn=path).run()
    assert load_model(path).model.named["resistance.ambient~knee"].value == pytest.approx(RESISTANCE, rel=1e-3)


@pytest.mark.long
def test_a_short_suspicion_cuts_nothing_off_what_is_learnt(tmp_path: Path) -> None:
    own, path = load_model(model_file(tmp_path, FIT, STEP)), tmp_path / "learnt.toml"
    last = Watch(own, pushed(rows_of(worn(3500, 3000.0, 2.0 * RESISTANCE))), every=600.0, learn=path).run()
    assert last.changed is None  # not yet: it has not lasted
    assert load_model(path).file.fit.data  # of an hour, not of its last minutes
    assert load_model(path).model.named["capacity.hip"].value == pytest.approx(CAPACITY, rel=0.03)


def test_what_can_not_be_learnt_ends_with_a_line(tmp_path: Path) -> None:
    own, path = load_model(model_file(tmp_path, FIT, STEP)), tmp_path / "learnt.toml"
    frame = worn(1800, np.inf, RESISTANCE).drop(columns=["temperature.knee", "temperature.hip"])
    with pytest.raises(InputError):
        Watch(own, pushed(rows_of(frame)), every=600.0, learn=path).run()
    assert not path.exists()


def test_without_a_viewer_rerun_is_one_line() -> None:
    pytest.importorskip("rerun", reason="the extra rerun is not installed")
    with pytest.raises(InputError, match=r"rerun: sink: found .*; expected a Rerun viewer on this machine"):
        Rerun()


@pytest.mark.long
def test_noise_that_decides_otherwise_on_the_fit_ends_no_watch(tmp_path: Path) -> None:
    own = load_model(model_file(tmp_path, FIT, STEP))  # an error of 0.1 K, of which 0.05 K of noise leave little
    frame = worn(3600, np.inf, RESISTANCE)
    frame.loc[frame["time"] < 900, "temperature.knee"] += 0.3 * np.random.default_rng(1).standard_normal(180)
    kept = Kept()
    last = Watch(own, pushed(rows_of(frame)), [kept], every=300.0).run()
    assert last.counts is not None
    assert last.counts["rows"] == len(frame)


# --- sinks -----------------------------------------------------------------------------------------


@pytest.mark.long
def test_prometheus_is_served_on_loopback(loaded: LoadedModel) -> None:
    sink, texts = Prometheus(port=0), list[str]()

    class Asking(Kept):
        def close(self) -> None:
            opened = urllib.request.build_opener(urllib.request.ProxyHandler({}))
            with opened.open(f"http://127.0.0.1:{sink.port}/metrics", timeout=10) as answer:
                texts.append(answer.read().decode())

    last = Watch(loaded, pushed(rows_of(log(120))), [sink, Asking()], limits=LIMIT).run()
    assert texts == [metrics(last)]
    lines = texts[0].splitlines()
    assert f'lptn_limit_celsius{{node="knee"}} {LIMIT:g}' in lines
    assert "lptn_rows_total 120" in lines
    (knee,) = (line for line in lines if line.startswith('lptn_temperature_celsius{node="knee"}'))
    assert float(knee.split()[1]) == pytest.approx(last.nodes[0].temperature)


@pytest.mark.long
def test_metrics_are_read_by_another_parser(loaded: LoadedModel) -> None:
    parser = pytest.importorskip("prometheus_client.parser", reason="prometheus_client is not installed")
    last = Watch(loaded, pushed(rows_of(log(120))), limits=LIMIT).run()
    families = {family.name: family for family in parser.text_string_to_metric_families(metrics(last))}
    nodes = {sample.labels["node"]: sample.value for sample in families["lptn_limit_seconds"].samples}
    assert nodes == {one.node: pytest.approx(one.time_to_limit) for one in last.nodes}
    assert families["lptn_rows"].type == "counter"


def test_a_package_that_breaks_is_no_address_that_is_refused() -> None:
    only_package = partial(one_line_if_refused, "dds://:0", "source", "", "dds")
    with pytest.raises(InputError, match=r"found no module; expected pip install 'lptn\[dds\]'"), only_package():
        raise ImportError("no module")
    with pytest.raises(OSError, match="cannot open shared object file"), only_package():
        raise OSError("libddsc.so: cannot open shared object file")


@pytest.mark.long
def test_foxglove_reads_each_node(loaded: LoadedModel) -> None:
    pytest.importorskip("foxglove", reason="the extra foxglove is not installed")
    clients = pytest.importorskip("websockets.sync.client", reason="websockets is not installed")
    sink, said = Foxglove(port=0), list[dict[str, object]]()
    statuses = Watch(loaded, pushed(rows_of(log(40))), [Kept()]).run()
    with clients.connect(f"ws://127.0.0.1:{sink.port}", subprotocols=["foxglove.sdk.v1"], proxy=None) as client:
        sink.show(statuses)
        while not said:
            message = client.recv(timeout=10)
            if isinstance(message, bytes):
                said.append(json.loads(message[13:]))  # behind opcode, subscription and time
                continue
            content = json.loads(message)
            for channel in content.get("channels", []):
                if channel["topic"] == "/lptn/knee":
                    one = {"id": 1, "channelId": channel["id"]}
                    client.send(json.dumps({"op": "subscribe", "subscriptions": [one]}))
                    time.sleep(0.3)
                    sink.show(statuses)
    sink.close()
    assert said[0]["reading"] == pytest.approx(statuses.nodes[0].reading)


@pytest.mark.long
def test_statuses_are_recorded_in_an_mcap_file(loaded: LoadedModel, tmp_path: Path) -> None:
    pytest.importorskip("foxglove", reason="the extra foxglove is not installed")
    from mcap.reader import make_reader

    path = tmp_path / "watch.mcap"
    last = Watch(loaded, pushed(rows_of(log(120))), [Mcap(path)], limits=LIMIT).run()
    with path.open("rb") as stream:
        of_knee = list(make_reader(stream).iter_messages(topics=["/lptn/knee"]))
    *_, message = of_knee[-1]
    assert message.log_time == round(last.time * 1e9)
    assert json.loads(message.data)["temperature"] == pytest.approx(last.nodes[0].temperature)
    with pytest.raises(InputError, match=r"watch\.mcap: sink: found .*; expected a file that is not there yet"):
        Mcap(path)


@pytest.mark.long
def test_torque_is_scaled_down_within_ten_kelvin_of_the_limit(loaded: LoadedModel) -> None:
    last = Watch(loaded, pushed(rows_of(log(120))), limits=45.0, every=1e9).run()
    for one in last.nodes:
        assert one.torque_scale == pytest.approx(min(max((45.0 - one.high) / 10.0, 0.0), 1.0))


@pytest.mark.long
def test_what_is_never_reached_is_null_in_json(loaded: LoadedModel) -> None:
    last = Watch(loaded, pushed(rows_of(log(120))), limits=500.0).run()
    content = json.loads(json.dumps(last.as_json(), allow_nan=False))
    assert content["nodes"]["knee"]["time_to_limit"] is None
    assert content["nodes"]["knee"]["trust"] == "trusted"


@pytest.mark.long
def test_steps_of_a_sensor_are_known_from_its_readings_not_from_means(
    loaded: LoadedModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Readings of 1 K steps that stand for a second, said ten times in it; the rows begin between two readings."""
    frame, asked = log(600, rate=10.0), list[Question]()
    for node in ("knee", "hip"):
        held = frame[f"temperature.{node}"].to_numpy()[::10] + 0.3 * np.random.default_rng(3).standard_normal(600)
        frame[f"temperature.{node}"] = np.repeat(np.round(held), 10)

    def keeping(question: Question) -> Assessment:
        asked.append(question)
        return assess(question)

    monkeypatch.setattr("lptn.live.watch.assess", keeping)
    Watch(loaded, pushed(rows_of(frame[5:])), every=60.0).run()
    (run,) = asked[-1].runs()
    assert run.resolution == {"temperature.knee": 1.0, "temperature.hip": 1.0}
    assert run.scatter["temperature.knee"].noise == pytest.approx(0.3, abs=0.05)


@pytest.mark.long
@pytest.mark.parametrize("readings", [1, 10])
def test_sensors_of_coarse_steps_that_stand_in_the_middle_of_one_are_no_fault(
    loaded: LoadedModel, readings: int
) -> None:
    """Joints near their balance, steps of 1 K, noise that hardly crosses them, torques ten times a second."""
    time, rng, told = np.arange(0.3, 900.0, 0.1), np.random.default_rng(2), list[str]()
    columns = {"time": time, "temperature.ambient": np.full(time.size, 22.0)}
    for node, torque, start in (("knee", 6.0, 58.2), ("hip", 5.0, 47.7)):
        settled = 22.0 + RESISTANCE * PER_TORQUE * torque**2
        true = settled + (start - settled) * np.exp(-time / (RESISTANCE * CAPACITY))
        columns[f"torque.{node}"] = torque * np.where(np.arange(time.size) % 2, 1.0, -1.0)
        columns[f"temperature.{node}"] = np.round(true + 0.15 * rng.standard_normal(time.size))
    frame = pd.DataFrame(columns)
    for node in ("knee", "hip"):
        frame[f"temperature.{node}"] = frame[f"temperature.{node}"].where(frame.index % (10 // readings) == 0)

    class Kept:
        def show(self, status: Status) -> None:
            told.extend(alarm.words for alarm in status.alarms)
            told.extend(one.trust for one in status.nodes if one.trust not in ("trusted", "not yet"))

        def close(self) -> None:
            pass

    Watch(loaded, pushed(rows_of(frame)), [Kept()], every=120.0).run()
    assert told == []
