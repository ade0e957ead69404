"""A fleet over a Dask cluster: killed half-way, and gone on with."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.fleet.truth import MODEL, write_fleet

# Found, not imported: that takes seconds, and only the processes below need it.
pytestmark = pytest.mark.skipif(find_spec("distributed") is None, reason="needs the extra `fleet`")

# A process of its own: it is killed, and a cluster in the tests' process would leave threads behind.
SCRIPT = """
import json, sys
from pathlib import Path
from distributed import Client, LocalCluster
from lptn.fleet import fit_each

if __name__ == "__main__":
    model, logs, into = (Path(word) for word in sys.argv[1:4])
    workers = {"n_workers": 2, "threads_per_worker": 1, "processes": sys.argv[4] == "processes"}
    with LocalCluster(**workers, dashboard_address=None) as cluster, Client(cluster) as client:
        fleet = fit_each(model, sorted(logs.iterdir()), into=into, executor=client.get_executor(), in_flight=8)
    print(json.dumps({each.robot: [each.status, each.message] for each in fleet.outcomes}))
"""


def _start(script: Path, *words: Path | str) -> subprocess.Popen[str]:
    environment = os.environ | {"PYTHONWARNINGS": "error::ResourceWarning"}
    command = [sys.executable, str(script), *map(str, words)]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment, start_new_session=True
    )


def _wait_for_records(folder: Path, count: int, running: subprocess.Popen[str]) -> None:
    stop = time.monotonic() + 60
    while len(list(folder.glob("records/*.json"))) < count:
        assert running.poll() is None
        assert time.monotonic() < stop
        time.sleep(0.02)


def _killed_and_resumed(tmp_path: Path, robots: int, kind: str) -> None:
    script, model, out = tmp_path / "fleet.py", tmp_path / "motor.toml", tmp_path / "out"
    script.write_text(SCRIPT)
    model.write_text(MODEL)
    write_fleet(tmp_path / "logs", robots, bad=2)
    out.mkdir()
    killed = _start(script, model, tmp_path / "logs", out, kind)
    _wait_for_records(out, robots // 2, killed)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.communicate(timeout=60)
    kept = {path.stem: path.stat().st_mtime_ns for path in out.glob("records/*.json")}
    assert robots // 2 <= len(kept) < robots - 1

    again = _start(script, model, tmp_path / "logs", out, kind)
    said, complained = again.communicate(timeout=120)
    assert again.returncode == 0, complained
    on_outcome = json.loads(said)
    assert [name for name, (status, _) in on_outcome.items() if status == "failed"] == ["robot_002"]
    assert "robot_002.csv" in on_outcome["robot_002"][1]
    assert {name for name, (status, _) in on_outcome.items() if status == "unchanged"} == set(kept)
    written = {path.stem: path.stat().st_mtime_ns for path in out.glob("records/*.json")}
    assert len(written) == robots - 1
    assert {name: written[name] for name in kept} == kept
    assert len(list(out.glob("models/*.toml"))) == robots - 1
    assert not list(out.glob("*/.*"))


@pytest.mark.long
def test_forty_robots_over_dask_killed_half_way_and_resumed(tmp_path: Path) -> None:
    _killed_and_resumed(tmp_path, 40, "threads")


@pytest.mark.slow
def test_two_hundred_robots_over_dask_processes_killed_half_way_and_resumed(tmp_path: Path) -> None:
    _killed_and_resumed(tmp_path, 200, "processes")
