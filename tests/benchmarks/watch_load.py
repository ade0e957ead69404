"""What `lptn watch` costs: thirty joints at 1 kHz over UDP, and a simulated week by replay.

    python -m tests.benchmarks.watch_load --seconds 60
    python -m tests.benchmarks.watch_load --hours 168

Prints the share of a processor that the loop and its assessments take, memory, messages that were lost, and the time
from the message that completes a row of the model to the line of its status in another process.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from contextlib import suppress
from pathlib import Path
from threading import Thread

import numpy as np

from lptn.identify.data import load_model
from lptn.live.sources import Push
from lptn.live.status import Status
from lptn.live.watch import Watch

JOINTS = [f"joint{k}" for k in range(30)]
PORT = 9871
STEP = 1.0  # s, of the model
MODEL = """
[model]
name = "thirty joints"
ambient = "temperature.ambient"

[[links]]
between = ["*", "ambient"]
resistance = 5.0

[[effects]]
kind = "copper_loss"
at = "*"
resistance = 0.15
torque_constant = 0.84

[fit]
rmse = 0.3
"""


def model_file(folder: Path) -> Path:
    """A model of thirty joints."""
    path = folder / "thirty.toml"
    nodes = "\n".join(f"[nodes.{joint}]\ncapacity = 300\n" for joint in JOINTS)
    path.write_text(MODEL.replace("[[links]]", f"{nodes}\n[[links]]", 1))
    return path


def message(seconds: float, temperatures: np.ndarray, rng: np.random.Generator) -> dict[str, float]:
    """What the robot says at a time: ninety-one numbers and the time."""
    sway = np.sin(2 * np.pi * 2.25 * seconds + np.arange(len(JOINTS)))
    said = {"time": seconds, "temperature.ambient": 22.0}
    said |= dict(zip((f"torque.{joint}" for joint in JOINTS), np.round(8 * sway, 3).tolist(), strict=True))
    said |= dict(zip((f"velocity.{joint}" for joint in JOINTS), np.round(3 * sway, 3).tolist(), strict=True))
    readings = np.round(temperatures + 0.1 * rng.standard_normal(len(JOINTS)), 2)
    return said | dict(zip((f"temperature.{joint}" for joint in JOINTS), readings.tolist(), strict=True))


def settled(seconds: float) -> np.ndarray:
    """Temperatures of healthy joints that warm by 34 K [degC]: 8 N m of amplitude through 300 J/K and 5 K/W."""
    rise = 5.0 * 0.15 / 0.84**2 * 8.0**2 / 2
    return np.full(len(JOINTS), 22.0 + rise * (1 - np.exp(-seconds / 1500.0)))


def processor_time(pid: int) -> float:
    """s that a process and its children have worked."""
    total = 0.0
    pids = [pid, *map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split())]
    for one in pids:
        fields = Path(f"/proc/{one}/stat").read_text().rpartition(")")[2].split()
        total += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return total


def memory(pid: int) -> float:
    """MB that a process holds."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1]) / 1000


def listen(watch: subprocess.Popen[bytes], shown: dict[float, float]) -> None:
    """When each row's status was read first, by the row's time."""
    assert watch.stdout is not None
    for line in watch.stdout:
        shown.setdefault(json.loads(line)["time"], time.monotonic())


def live(seconds: float, rate: float) -> None:
    """Send messages over UDP to a watch."""
    with tempfile.TemporaryDirectory() as folder:
        last = Path(folder) / "last.json"
        command = [sys.executable, "-m", "lptn", "watch", str(model_file(Path(folder))), f"udp://:{PORT}", "--limit",
                   "80", "--to", "prometheus://127.0.0.1:9472", "json", "--json", str(last)]  # fmt: skip
        with (
            subprocess.Popen(command, stdout=subprocess.PIPE) as watch,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot,
        ):
            while True:  # until it serves
                with suppress(OSError), urllib.request.urlopen("http://127.0.0.1:9472/metrics"):
                    break
                time.sleep(0.2)
            rng, texts = np.random.default_rng(0), list[bytes]()
            texts = [
                json.dumps(message(k / rate, settled(k / rate), rng)).encode() for k in range(round(seconds * rate))
            ]
            shown = dict[float, float]()
            Thread(target=listen, args=(watch, shown), daemon=True).start()
            began, worked = time.monotonic(), processor_time(watch.pid)
            for k, text in enumerate(texts):
                ahead = began + k / rate - time.monotonic()
                if ahead > 0:
                    time.sleep(ahead)
                robot.sendto(text, ("127.0.0.1", PORT))
                if k % round(15 * rate) == 0 and k:
                    share = (processor_time(watch.pid) - worked) / (time.monotonic() - began)
                    print(f"{k / rate:6.0f} s  {share:.3f} of a processor, {memory(watch.pid):.0f} MB", flush=True)
            lasted = time.monotonic() - began
            share = (processor_time(watch.pid) - worked) / lasted
            print(f"{lasted:6.0f} s  {share:.3f} of a processor, {memory(watch.pid):.0f} MB")
            # A row is complete with the message two steps behind its beginning.
            late = [1000 * (when - began - row - 2 * STEP) for row, when in shown.items()]
            middle, most = np.percentile(late, [50, 99])
            print(f"{len(late)} rows shown {middle:.0f} ms after their last message, 99 % within {most:.0f} ms")
            watch.terminate()
        print(f"sent {len(texts)}; counts {json.loads(last.read_text())['counts']}")


def replayed(hours: float) -> None:
    """A source at 1 Hz for hours, as fast as it goes; an assessment an hour."""
    with tempfile.TemporaryDirectory() as folder:
        loaded = load_model(model_file(Path(folder)))
        source, began = Push(live=False), time.process_time()

        class Memory:
            def show(self, status: Status) -> None:
                if status.time % (hours * 3600 // 8) == 0:
                    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000
                    print(
                        f"{status.time / 3600:6.1f} h  {memory(os.getpid()):.0f} MB, at most {most:.0f} MB", flush=True
                    )

            def close(self) -> None:
                pass

        def speak() -> None:
            rng = np.random.default_rng(0)
            for k in range(round(hours * 3600)):
                source.push(message(float(k), settled(float(k)), rng))
            source.end()

        Thread(target=speak, daemon=True).start()
        last = Watch(loaded, source, [Memory()], limits=80.0, every=3600.0).run()
        print(f"{hours:g} h in {time.process_time() - began:.0f} s of a processor; counts {last.counts}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, help="of messages over UDP")
    parser.add_argument("--rate", type=float, default=1000.0, help="messages a second")
    parser.add_argument("--hours", type=float, help="that are replayed at 1 Hz")
    options = parser.parse_args()
    if options.seconds:
        live(options.seconds, options.rate)
    if options.hours:
        replayed(options.hours)
