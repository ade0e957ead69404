"""What `lptn watch` says of virtual quadrupeds that publish by DDS: limits ahead, faults of sensors, false alarms.

    nice -n 19 python -m tests.benchmarks.watch_dds --robots 20 --parallel 2

Each robot is one of its own, and its model is fitted to the 25 logs of its protocol. It trots for twenty minutes, each
joint with a limit at seventeen twentieths of its own rise until then; then it stands, walks and squats with one faulty
sensor or torque (`tests.hardening.faulty_sensors`). Two processes on loopback: this one publishes joint states 500
times a second of the wall's clock, each sensor's temperature once a second of the robot's, that runs faster (`--pace`);
`lptn watch` reads them with an assessment every two minutes of the robot's. The truth comes from `lptn.virtual`, which
shares no code with the model.

An interval is judged when it is told: what is left until the joint's true temperature first passes its limit lies in
it, or does not. One is taken for each joint 10, 5 and 2 min before, and where it is told first.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from lptn.robots.presets import preset_text
from lptn.virtual import (
    QUADRUPED_JOINTS,
    QUADRUPED_NODES,
    Bout,
    Job,
    Probe,
    quadruped,
    quadruped_logs,
    rows,
    simulate_runs,
    write_logs,
)  # fmt: skip
from tests.hardening.faulty_sensors import BEGIN, KINDS, Asked, judged

RATE, SAMPLES = 500, 100  # Hz of the wall's clock, of the robot's samples
UNTIL = 1800  # s, at which a robot ends: ten minutes of its fault
SHARE, STEP, EVERY = 0.85, 1.0, 120.0  # of a joint's rise; K of the sensors; s between assessments
BEFORE = {"10 min before": 600, "5 min before": 300, "2 min before": 120, "when told first": inf}
EPOCH = 1_700_000_000  # s, at which the robot's clock begins
LOOPBACK = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface address='127.0.0.1'/></Interfaces></General></Domain>"
    "</CycloneDDS>"
)
COLUMNS = {
    **{f"torque.{joint}": f"/joint_states.effort[{joint}]" for joint in QUADRUPED_JOINTS},
    **{f"velocity.{joint}": f"/joint_states.velocity[{joint}]" for joint in QUADRUPED_JOINTS},
    **{f"powered.{joint}": f"/drives.position[{joint}]" for joint in QUADRUPED_JOINTS},
    "speed.base": "/base.velocity[base]",
    "power.pc": "/computer.effort[pc]",
}


@dataclass(frozen=True)
class Said:
    """What a watch said of one robot.

    Args:
        held: by `BEFORE` whether an interval holds, and by how much the expected time is off [s], of each joint.
        early: s before its limit at which the first joint there is told to reach it.
        fault: its kind.
        called: what the faulty channel is called, "" for nothing; after so many seconds.
        others: other channels that are blamed behind the fault.
        false: what is said of sensors, inputs and the model before it.
        counts: of messages.
    """

    held: Mapping[str, list[tuple[bool, float]]]
    early: float
    fault: str
    called: str
    after: float
    others: list[str]
    false: list[str]
    counts: Mapping[str, int]


def walked(seed: int, kind: str) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame, Asked]:
    """What a robot publishes: its samples, its sensors once a second; the truth of these; what is wrong."""
    rng = np.random.default_rng([seed, 11])
    acts = [("trot", BEGIN), *((act, 300) for act in ("stand", "walk", "squat", "walk", "trot"))]
    bouts = [Bout(act, seconds, float(rng.uniform(0.2, 0.9)), float(rng.uniform(0, 3))) for act, seconds in acts]
    job = Job(tuple(bouts), float(rng.uniform(12, 28)), cutout=None)
    (record,) = simulate_runs(quadruped(seed=seed), {"watched": job}, seed, "default")
    (slow,) = rows(record, Probe(0.15, 0.0), seed, 1.0)
    fast = pd.concat(rows(record, Probe(0.15, 0.0), seed, float(SAMPLES)), ignore_index=True)
    joint = QUADRUPED_JOINTS[int(rng.integers(3))]  # those of the leg, of which the faults know
    KINDS[kind].spoil(slow, joint, rng)
    if kind == "torque dies":
        fast.loc[fast["time"] >= BEGIN, f"torque.{joint}"] = 0.0
    readings = [f"temperature.{node}" for node in QUADRUPED_NODES]
    slow[readings] = np.round(slow[readings] / STEP) * STEP
    return fast, slow, record.truth(), Asked(kind, joint)


class Robot:
    """Publishes by DDS what a robot says at a time."""

    def __init__(self, domain: int, fast: pd.DataFrame, slow: pd.DataFrame) -> None:
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.pub import DataWriter
        from cyclonedds.topic import Topic

        from tests.live import ros_types

        self._types, self._own = ros_types, DomainParticipant(domain)
        states = "joint_states", "drives", "base", "computer"
        self._states = {
            name: DataWriter(self._own, Topic(self._own, f"rt/{name}", ros_types.JointState)) for name in states
        }
        self._sensors = {
            place: DataWriter(self._own, Topic(self._own, f"rt/{place}_temperature", ros_types.Temperature))
            for place in (*QUADRUPED_NODES, "ambient")
        }
        self._torque, self._speed = (
            fast[[f"{quantity}.{joint}" for joint in QUADRUPED_JOINTS]].to_numpy(float)
            for quantity in ("torque", "velocity")
        )
        self._slow, self._said = slow.to_dict("records"), -1

    def say(self, now: float) -> None:
        """Publish the joints' states, and what is said each second, at a time of the robot's [s]."""
        head, k = self._head(now), int(now * SAMPLES)
        nothing = [0.0] * len(QUADRUPED_JOINTS)
        self._write("joint_states", head, QUADRUPED_JOINTS, nothing, self._speed[k].tolist(), self._torque[k].tolist())
        if int(now) == self._said:
            return
        self._said = int(now)
        row = self._slow[self._said]
        powered = [row[f"powered.{joint}"] for joint in QUADRUPED_JOINTS]
        self._write("drives", head, QUADRUPED_JOINTS, powered, nothing, nothing)
        self._write("base", head, ["base"], [0.0], [row["speed.base"]], [0.0])
        self._write("computer", head, ["pc"], [0.0], [0.0], [row["power.pc"]])
        for place, writer in self._sensors.items():
            writer.write(self._types.Temperature(head, row[f"temperature.{place}"], 0.0))

    def _head(self, now: float) -> Any:
        return self._types.Header(self._types.Time(EPOCH + int(now), int(now % 1 * 1e9)), "")

    def _write(self, topic: str, head: Any, names: Sequence[str], *values: list[float]) -> None:
        self._states[topic].write(self._types.JointState(head, list(names), *values))


def published(robot: Robot, pace: float) -> None:
    """The robot's time goes so many times as fast as the wall's; where this process is kept waiting it waits, too."""
    now, ahead = 0.0, time.monotonic()
    while now < UNTIL:
        robot.say(now)
        now, ahead = now + pace / RATE, ahead + 1 / RATE
        if (left := ahead - time.monotonic()) > 0:
            time.sleep(left)
        else:
            ahead -= left


def watched(seed: int, kind: str, pace: float) -> Said:
    """One robot: its fit, its walk, and what the watch says."""
    os.environ["CYCLONEDDS_URI"] = LOOPBACK
    fast, slow, truth, asked = walked(seed, kind)
    with tempfile.TemporaryDirectory() as name:
        folder, domain = Path(name), seed % 200
        write_logs(folder, quadruped_logs(seed=seed))
        (folder / "preset.toml").write_text(preset_text("quadruped", None), encoding="utf-8")
        logs = (str(path) for path in sorted(folder.glob("*.parquet")))
        command = [sys.executable, "-m", "lptn"]
        subprocess.run([*command, "fit", "preset.toml", *logs, "-o", "model.toml"], cwd=folder, check=True,
                       capture_output=True)  # fmt: skip
        passed = {}
        limits = []
        for joint in QUADRUPED_JOINTS:
            path = truth[f"temperature.{joint}"].to_numpy()
            limit = round(path[0] + SHARE * (path[BEGIN] - path[0]), 2)
            passed[joint] = int((path >= limit).argmax())
            limits += ["--limit", f"{joint}={limit}"]
        lines = "\n".join(f'"{key}" = "{column}"' for key, column in COLUMNS.items())
        with (folder / "model.toml").open("a") as model:
            model.write(f"\n[columns]\n{lines}\n")
        with subprocess.Popen([*command, "watch", "model.toml", f"dds://127.0.0.1:{domain}", *limits, "--to",
                               "json:said.jsonl", "--every", str(EVERY)], cwd=folder) as watch:  # fmt: skip
            time.sleep(10.0)  # until it listens
            published(Robot(domain, fast, slow), pace)
            time.sleep(3.0)
            watch.send_signal(signal.SIGINT)
        with (folder / "said.jsonl").open() as said:
            return told(map(json.loads, said), passed, asked)


def told(statuses: Iterator[dict[str, Any]], passed: Mapping[str, int], asked: Asked) -> Said:
    """What was said, against the truth."""
    intervals = defaultdict[str, list[tuple[float, float, float, float]]](list)
    called = dict[str, tuple[float, str]]()
    counts: Mapping[str, int] = {}
    for status in statuses:
        now, counts = status["time"] - EPOCH, status["counts"]
        for node, one in status["nodes"].items():
            if node in passed and now < passed[node] and one["earliest"] is not None:
                ends = (inf if one[end] is None else one[end] for end in ("earliest", "time_to_limit", "latest"))
                intervals[node].append((now, *ends))
            if one["trust"] not in ("trusted", "not yet", "none"):
                called.setdefault(f"temperature.{node}", (now, one["trust"]))
        for alarm in status["alarms"]:
            called[alarm["channel"]] = (called.get(alarm["channel"], (now,))[0], alarm["kind"])
        if status["changed"] is not None:
            called.setdefault("the model", (now, "changed"))
    begin = BEGIN - 2  # of the row that has the fault's first reading between its middle and the next one's
    before = [f"{channel} {kind}" for channel, (when, kind) in called.items() if when < begin]
    called = {channel: one for channel, one in called.items() if one[0] >= begin}
    held = defaultdict[str, list[tuple[bool, float]]](list)
    for node, said in intervals.items():
        for name, seconds in BEFORE.items():
            until = [one for one in said if one[0] <= passed[node] - seconds]
            for now, low, middle, high in [said[0]] if seconds == inf else until[-1:]:
                left = passed[node] - now
                held[name].append((low <= left <= high, middle - left))
    first = min(passed, key=lambda joint: passed[joint])
    early = passed[first] - min((one[0] for one in intervals[first] if one[2] < inf), default=inf)
    alarms = [{"kind": kind, "channel": channel, "node": ""} for channel, (_, kind) in called.items()]
    right, _ = judged(asked, alarms)
    own = f"{'torque' if asked.kind == 'torque dies' else 'temperature'}.{asked.joint}"
    others = [f"{channel} {kind}" for channel, (_, kind) in called.items() if channel != own]
    return Said(held, early, asked.kind, right, called.get(own, (inf,))[0] - BEGIN, others, before, counts)


def main() -> None:
    """Print what was told."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=20)
    parser.add_argument("--first", type=int, default=421, help="seed of the first robot")
    parser.add_argument("--pace", type=float, default=8.0, help="s of the robot in a second")
    parser.add_argument("--parallel", type=int, default=1, help="robots at once")
    chosen = parser.parse_args()
    kinds = [kind for kind in KINDS if kind not in ("healthy", "swapped with another")]  # those that begin later
    seeds = range(chosen.first, chosen.first + chosen.robots)
    with ProcessPoolExecutor(chosen.parallel) as pool:
        asked = {seed: pool.submit(watched, seed, kinds[seed % len(kinds)], chosen.pace) for seed in seeds}
        found = list[Said]()
        for seed, one in asked.items():
            found.append(said := one.result())
            held = {name: f"{sum(ok for ok, _ in ones)} of {len(ones)}" for name, ones in said.held.items()}
            print(f"{seed}: {said.early / 60:.0f} min before, {held}; {said.fault}: {said.called or 'nothing'} after "
                  f"{said.after:.0f} s, others {said.others}; before it {said.false}; {said.counts}")  # fmt: skip
    early = [said.early / 60 for said in found]
    print(f"\nfirst joint at its limit: told {np.median(early):.0f} min before, at least {min(early):.0f}\n")
    for name in BEFORE:
        judged_all = [pair for said in found for pair in said.held.get(name, [])]
        share = sum(ok for ok, _ in judged_all)
        off = np.median(np.abs([away for _, away in judged_all if np.isfinite(away)]))
        print(f"{name}: {share} of {len(judged_all)} intervals hold; half are off by less than {off:.0f} s")
    hours = chosen.robots * BEGIN / 3600
    false = [words for said in found for words in said.false]
    print(f"\n{len(false)} false in {hours:.1f} h of healthy trot: {'; '.join(false) or 'none'}")
    for kind in kinds:
        ones = [said for said in found if said.fault == kind]
        after = ", ".join(f"{said.called or 'nothing'} after {said.after:.0f} s" for said in ones)
        print(f"{kind}: {after}; others: {[words for said in ones for words in said.others] or 'nobody'}")


if __name__ == "__main__":
    main()
