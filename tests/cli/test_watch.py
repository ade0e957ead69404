"""`lptn watch` as a process: what it prints, a clean end at a signal, a kill and what is taken up afterwards."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import Lptn
from tests.live.robot import log, model_file


@pytest.fixture
def motors(tmp_path: Path) -> Path:
    return model_file(tmp_path)


def test_a_replayed_log_gives_lines_and_json(lptn: Lptn, motors: Path, tmp_path: Path) -> None:
    path, last = tmp_path / "log.csv", tmp_path / "last.json"
    log(100).rename(columns={"torque.hip": "tau_hip"}).to_csv(path, index=False)
    words = "watch", motors, path, "--replay", 0, "--limit", 60, "--every", 1000, "--json", last, "--map", "guess"
    status, seen, _ = lptn(*words)
    assert status == 0
    assert 'guessed: "torque.hip" = "tau_hip"' in seen
    assert re.search(r"99 s \w+ \d\d\.\d ± \d\.\d degC, 60 degC (in|never)", seen)
    content = json.loads(last.read_text())
    assert content["counts"]["rows"] == 100
    assert set(content["nodes"]) == {"knee", "hip"}


def test_what_is_learnt_is_written_and_said(lptn: Lptn, motors: Path, tmp_path: Path) -> None:
    path, learnt = tmp_path / "log.csv", tmp_path / "learnt.toml"
    log(200).to_csv(path, index=False)
    status, seen, _ = lptn("watch", motors, path, "--replay", 0, "--every", 1000, "--learn", learnt)
    assert status == 0
    assert re.search(r"Written: .*learnt\.toml \(the model as the last hours have it\)", seen.replace("\n", " "))
    assert "[fit.standard_errors]" in learnt.read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere.csv"], "nowhere.csv: source: found no such file; expected a file of JSON or CSV lines"),
        (["log.csv", "--to", "screen"], "screen: sink: found no such sink; expected terminal, page, json"),
        (["log.csv", "--to", "prometheus://127.0.0.1:x"], "sink: found no port"),
        (["udp://127.0.0.1:99999"], "source: found no port"),
        (["log.csv", "--state", "other.csv"], "other.csv: state: found another or a broken file"),
        (["log.csv", "--state", "numbers.npy"], "numbers.npy: state: found another or a broken file"),
        (["log.csv", "--state", "pipe"], "pipe: state: found another or a broken file"),
        *[
            (["log.csv", *words.split()], ": output: found a file that is read; expected another file")
            for words in ("--state log.csv", "--json log.csv", "--to json json:./log.csv", "--calibration x --json x")
        ],
        (["log.csv", "--to", "json:a", "json:a"], "a: output: found one file for two results"),
        (["log.csv", "--replay", "0"], "column temperature.ambient: found no such column; the log has: time, a"),
    ],
)
def test_what_can_not_be_is_one_line(
    lptn: Lptn, motors: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], message: str
) -> None:
    monkeypatch.chdir(motors.parent)
    Path("log.csv").write_text("time,a\n0,1\n1,2\n")
    Path("other.csv").write_text("time,a\n0,1\n1,2\n")
    np.save("numbers.npy", np.zeros(3))
    os.mkfifo("pipe")
    status, _, told = lptn("watch", motors, *words)
    assert status == 2
    assert message in told
    assert len(told.splitlines()) == 1


@contextmanager
def begun(motors: Path, state: Path, *words: str) -> Iterator[subprocess.Popen[bytes]]:
    """A watch that reads its standard input, ended after two minutes."""
    command = [sys.executable, "-m", "lptn", "watch", str(motors), "-", "--to", "json", "--state", str(state), *words]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0) as watch:
        late = threading.Timer(120.0, watch.kill)
        late.start()
        yield watch
        late.cancel()
        watch.kill()


def say(watch: subprocess.Popen[bytes], first: int, last: int) -> dict[str, object]:
    """Give it the seconds of a log; the status of the last."""
    assert watch.stdin is not None
    assert watch.stdout is not None
    frame = log(last + 2).iloc[first : last + 1]
    watch.stdin.write(frame.to_json(orient="records", lines=True).encode())
    status: dict[str, object] = {}
    for line in iter(watch.stdout.readline, b""):
        status = json.loads(line)
        if status["time"] == last:
            break
    return status


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_cleanly_with_its_state_saved(motors: Path, tmp_path: Path, number: signal.Signals) -> None:
    state, last = tmp_path / "watch.npz", tmp_path / "last.json"
    with begun(motors, state, "--json", str(last)) as watch:
        say(watch, 0, 50)
        watch.send_signal(number)
        assert watch.wait(30) == 0
    assert json.loads(last.read_text())["time"] == 50
    assert state.stat().st_size > 1000
    assert taken_up(motors, state, 51) == {"rows": 56, "gaps": 0}


def taken_up(motors: Path, state: Path, first: int) -> dict[str, int]:
    """What a watch on a saved state counts after seconds of the log from `first` to 55."""
    with begun(motors, state) as again:
        counts = say(again, first, 55)["counts"]
    assert isinstance(counts, dict)
    return {key: counts[key] for key in ("rows", "gaps")}


@pytest.mark.slow
def test_after_a_kill_it_goes_on_from_what_was_saved(motors: Path, tmp_path: Path) -> None:
    state = tmp_path / "watch.npz"
    with begun(motors, state) as watch:
        say(watch, 0, 50)
        deadline = time.monotonic() + 90
        while not state.exists() and time.monotonic() < deadline:  # it saves once a minute
            time.sleep(0.5)
        watch.send_signal(signal.SIGKILL)
    assert taken_up(motors, state, 52) == {"rows": 55, "gaps": 0}  # a second was lost
    assert [path.name for path in tmp_path.glob(".*.part")] == []
