"""What the how-to page's recipes run: MuJoCo as a robot; the commands of the service and of the container."""

from __future__ import annotations

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
import urllib.request
from ast import literal_eval
from contextlib import suppress
from pathlib import Path

import pytest

from lptn.robots.presets import presets
from tests.live.robot import log, model_file

PAGE = (Path(__file__).parents[2] / "src" / "site" / "pages" / "how_to" / "watch.md").read_text(encoding="utf-8")


def block(language: str, word: str) -> str:
    """A block of code of the page that holds a word."""
    blocks = re.findall(rf"^```{language}\b[^\n]*\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    (found,) = (text for text in blocks if word in text)
    return str(found)


@pytest.mark.long
def test_mujoco_is_watched(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="needs the extra `robots`")
    (tmp_path / "fitted.toml").write_text(presets()["leg"])
    script = block("python", "import mujoco") + "\nprint((AIR + data.act).tolist())\n"
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True)
    said, exact = map(literal_eval, done.stdout.splitlines())
    assert [node["temperature"] for node in said["nodes"].values()] == pytest.approx(exact, abs=0.5)


@pytest.mark.long
@pytest.mark.parametrize("recipe", ["service", "container"])
def test_the_commands_of_service_and_container_run(tmp_path: Path, recipe: str) -> None:
    if recipe == "service":
        words = shlex.split(block("ini", "ExecStart").partition("ExecStart=")[2].splitlines()[0])
        assert words[0].endswith("/bin/lptn")
    else:
        lines = dict(line.split(maxsplit=1) for line in block("dockerfile", "ENTRYPOINT").splitlines())
        words = json.loads(lines["ENTRYPOINT"]) + json.loads(lines["CMD"])
    model, growing = model_file(tmp_path), tmp_path / "log.csv"
    log(100).to_csv(growing, index=False)
    # Paths are those of this test, a file stands for the robot's network, and loopback for its interface.
    places = {"/etc/lptn/fitted.toml": str(model), "/var/lib/lptn": str(tmp_path), "192.168.123.99:0": "127.0.0.1:79"}
    words[3] = str(growing)
    words = [re.sub("|".join(places), lambda found: places[found[0]], word) for word in words]
    if any(word.startswith("dds://") for word in words):
        pytest.importorskip("cyclonedds", reason="the extra dds is not installed")
    command = [sys.executable, "-m", "lptn", *words[1:]]
    nobody = {name: value for name, value in os.environ.items() if name not in ("HOME", "XDG_CACHE_HOME")}
    opened = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with subprocess.Popen(command, cwd=tmp_path, env=nobody | {"HOME": "/nonexistent"}) as watch:
        for _ in range(600):
            with suppress(OSError), opened.open("http://127.0.0.1:9464/metrics", timeout=5) as answer:
                if "lptn_rows_total 100" in answer.read().decode():
                    break
            time.sleep(0.1)
        watch.send_signal(signal.SIGTERM)
        assert watch.wait(30) == 0
    assert (tmp_path / "watch.npz").stat().st_size > 1000
