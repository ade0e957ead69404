"""What `lptn monitor` calls faults that were put into one sensor, or one input, of a virtual leg's logs.

    python -m tests.hardening.faulty_sensors --seeds 61 62 63 --versions old=OLD/bin/lptn new=NEW/bin/lptn

The model is fitted to other, healthy runs of that leg. Each log has one fault from its middle on, in a joint that is
drawn; swapped sensors are swapped from the beginning. Each version watches all logs with `--healthy`, given the fitted
runs, and without. Printed for each kind: how often the channel is called, how often by the right name, what else it is
called, and how many other channels are blamed.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from lptn.robots.presets import presets
from lptn.virtual import LEG_JOINTS, Bout, Job, leg_logs
from tests.benchmarks.verdict_answers import command_of

LENGTH, BEGIN = 2700, 1200  # s
Rng = np.random.Generator
Spoil = Callable[[pd.DataFrame, str, Rng], None]


def _behind(log: pd.DataFrame) -> pd.Series[bool]:
    return log["time"] >= BEGIN


def _set(value: float | None) -> Spoil:
    """One number from the fault on: what is read there where no number is said."""

    def spoil(log: pd.DataFrame, joint: str, _rng: Rng) -> None:
        name = f"temperature.{joint}"
        log.loc[_behind(log), name] = log[name].iloc[BEGIN] if value is None else value

    return spoil


def _added(path: Callable[[pd.Series[float], Rng], object]) -> Spoil:
    """Something added to the reading, by the time since the fault."""

    def spoil(log: pd.DataFrame, joint: str, rng: Rng) -> None:
        since = log["time"] - BEGIN
        log[f"temperature.{joint}"] += path(since, rng) * _behind(log)  # type: ignore[operator]

    return spoil


def _clamped(log: pd.DataFrame, joint: str, _rng: Rng) -> None:
    name = f"temperature.{joint}"
    log[name] = np.minimum(log[name], np.round(log[name].quantile(0.55)))


def _lagging(log: pd.DataFrame, joint: str, _rng: Rng) -> None:
    """A time constant of 5 min from the fault on; the noise is the sensor's own, and stays."""
    name = f"temperature.{joint}"
    readings = log[name].to_numpy().copy()
    smooth = pd.Series(readings).rolling(41, center=True, min_periods=1).mean().to_numpy()
    path, keep = smooth.copy(), np.exp(-1 / 300.0)
    for k in range(BEGIN, path.size):
        path[k] = keep * path[k - 1] + (1 - keep) * smooth[k]
    log[name] = readings + path - smooth


def _spiky(_since: pd.Series[float], rng: Rng) -> object:
    return (rng.random(LENGTH) < 0.02) * rng.uniform(15, 60, LENGTH) * rng.choice([-1.0, 1.0], LENGTH)


def _disconnected(log: pd.DataFrame, joint: str, rng: Rng) -> None:
    """A plug that hangs in the air beside the robot."""
    air = log["temperature.ambient"] + rng.normal(0.0, 0.15, len(log))
    log.loc[_behind(log), f"temperature.{joint}"] = air[_behind(log)]


def _swapped(log: pd.DataFrame, joint: str, _rng: Rng) -> None:
    one, other = f"temperature.{joint}", f"temperature.{_other(joint)}"
    log[one], log[other] = log[other].copy(), log[one].copy()


def _other(joint: str) -> str:
    return LEG_JOINTS[(LEG_JOINTS.index(joint) + 1) % len(LEG_JOINTS)]


def _torque_dies(log: pd.DataFrame, joint: str, _rng: Rng) -> None:
    log.loc[_behind(log), f"torque.{joint}"] = 0.0


@dataclass(frozen=True)
class Kind:
    """A fault, and the names for it that are right."""

    spoil: Spoil
    right: tuple[str, ...]


KINDS: dict[str, Kind] = {
    "healthy": Kind(lambda _log, _joint, _rng: None, ()),
    "dead, 0": Kind(_set(0.0), ("dead",)),
    "dead, −127": Kind(_set(-127.0), ("dead",)),
    "stuck": Kind(_set(None), ("stuck", "clamped")),  # at the end of its range the one is the other
    "clamped": Kind(_clamped, ("clamped", "stuck")),
    "offset of 6 K": Kind(_added(lambda _since, rng: 6.0 * rng.choice([-1.0, 1.0])), ("offset",)),
    "drift of 0.02 K/s": Kind(_added(lambda since, rng: 0.02 * rng.choice([-1.0, 1.0]) * since), ("drift",)),
    "lag of 300 s": Kind(_lagging, ("lag",)),
    "spikes": Kind(_added(_spiky), ("spikes",)),
    "noise of 2 K": Kind(_added(lambda _since, rng: rng.normal(0.0, 2.0, LENGTH)), ("noise",)),
    "disconnected, reads the air": Kind(_disconnected, ("disconnected",)),
    "swapped with another": Kind(_swapped, ("swapped",)),
    "torque dies": Kind(_torque_dies, ("input",)),
}


@dataclass(frozen=True)
class Asked:
    """One log: its kind of fault, and the joint."""

    kind: str
    joint: str


def watched_logs(seed: int, folder: Path, steps: float) -> dict[str, Asked]:
    """Fitted runs, the preset and the logs to watch, in a folder, by the name of the file."""
    rng = np.random.default_rng([seed, 4])
    (folder / "preset.toml").write_text(presets()["leg"], encoding="utf-8")
    for name, log in leg_logs(seed=seed, quantisation=steps, rate=1.0).items():
        log.to_parquet(folder / f"{name}.parquet")
    acts = ("trot", "stand", "squat", "walk", "trot", "stand")
    loads = rng.uniform(0, 4, len(acts))
    pieces = [
        Bout(act, LENGTH // 6, float(rng.uniform(0.5, 1.2)), float(load)) for act, load in zip(acts, loads, strict=True)
    ]
    healthy = leg_logs(
        seed=seed, quantisation=0.0, rate=1.0, runs={"now": Job(tuple(pieces), float(rng.uniform(12, 28)), cutout=None)}
    )["now"]
    made = {}
    for number, (kind, fault) in enumerate(KINDS.items()):
        log, joint = healthy.copy(), LEG_JOINTS[int(rng.integers(len(LEG_JOINTS)))]
        fault.spoil(log, joint, rng)
        for name in (f"temperature.{joint}" for joint in LEG_JOINTS):
            log[name] = np.round(np.round(log[name] / steps) * steps, 6)
        log.to_parquet(folder / f"watched{number}.parquet")
        made[f"watched{number}"] = Asked(kind, joint)
    return made


def ask(command: Path, folder: Path, logs: Sequence[str], *, healthy: bool) -> dict[str, list[dict[str, str]]]:
    """The alarms of both detectors by log; what was refused has one whose kind says so."""
    by_log: dict[str, list[dict[str, str]]] = {}
    words = [command, "monitor", "model.toml", *(f"{log}.parquet" for log in logs), "--json", "found.json"]
    words += ["--healthy", "fit1.parquet", "fit2.parquet"] if healthy else []
    done = subprocess.run([str(word) for word in words], cwd=folder, check=False, capture_output=True, text=True)
    if done.returncode:
        if len(logs) == 1:
            return {logs[0]: [{"kind": "refused", "channel": done.stderr.strip(), "node": ""}]}
        for log in logs:
            by_log |= ask(command, folder, [log], healthy=healthy)
        return by_log
    runs = json.loads((folder / "found.json").read_text(encoding="utf-8"))["runs"]
    for name, both in runs.items():
        # What the statistical detector calls is what is named; the plain one adds what that one does not call.
        alarms = both["statistical"]["alarms"]
        called = {alarm["node"] for alarm in alarms}
        alarms = alarms + [alarm for alarm in both["threshold"]["alarms"] if alarm["node"] not in called]
        by_log.setdefault(name.partition("#")[0], []).extend(alarms)
    return by_log


def channel(alarm: Mapping[str, str]) -> str:
    """The channel that an alarm names; older versions know temperatures alone."""
    return alarm.get("channel") or f"temperature.{alarm['node']}"


def judged(asked: Asked, alarms: Sequence[Mapping[str, str]]) -> tuple[str, int]:
    """What the faulty channel is called, "" for nothing; and how many other channels are blamed."""
    faulty = [f"torque.{asked.joint}" if asked.kind == "torque dies" else f"temperature.{asked.joint}"]
    faulty += [f"temperature.{_other(asked.joint)}"] * (asked.kind == "swapped with another")
    faulty *= asked.kind != "healthy"
    called = [alarm["kind"] for alarm in alarms if channel(alarm) in faulty]
    refused = [alarm["kind"] for alarm in alarms if alarm["kind"] == "refused"]
    right = [name for name in called if name in KINDS[asked.kind].right]
    blamed = {channel(alarm) for alarm in alarms if alarm["kind"] != "refused"} - set(faulty)
    return (right or called or refused or [""])[0], len(blamed)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[61, 62, 63])
    parser.add_argument("--steps", type=float, nargs="+", default=[0.1, 1.0], help="of the sensors, K")
    parser.add_argument("--versions", type=command_of, nargs="+", required=True, metavar="NAME=COMMAND")
    chosen = parser.parse_args()
    versions = {name: command.absolute() for name, command in chosen.versions}
    results: dict[tuple[str, bool], dict[str, list[tuple[str, int]]]] = {}
    for seed in chosen.seeds:
        for steps in chosen.steps:
            with tempfile.TemporaryDirectory() as name:
                folder = Path(name)
                logs = watched_logs(seed, folder, steps)
                fit = [next(iter(versions.values())), "fit", "preset.toml", "fit1.parquet", "fit2.parquet"]
                subprocess.run([*map(str, fit), "-o", "model.toml"], cwd=folder, check=True, capture_output=True)
                for version, command in versions.items():
                    for healthy in (True, False):
                        by_log = ask(command, folder, list(logs), healthy=healthy)
                        of_version = results.setdefault((version, healthy), {kind: [] for kind in KINDS})
                        for log, asked in logs.items():
                            answer = judged(asked, by_log.get(log, []))
                            of_version[asked.kind].append(answer)
                            mode = "with" if healthy else "without"
                            said = f"'{answer[0]}', {answer[1]} others blamed"
                            print(f"{seed}, {steps:g} K, {version}, {mode}: {asked.kind}, {said}", flush=True)
    for (version, healthy), kinds in results.items():
        print(f"\n{version}, {'with' if healthy else 'without'} --healthy\n")
        print("| fault | logs | called | by its name | also called | others blamed |")
        print("|" + " --- |" * 6)
        for kind, answers in kinds.items():
            called, right = [name for name, _ in answers if name], KINDS[kind].right
            also = Counter(name for name in called if name not in right)
            listed = ", ".join(f"{name} {count}" for name, count in also.items()) or "–"
            blamed = sum(count for _, count in answers)
            named = sum(name in right for name in called)
            print(f"| {kind} | {len(answers)} | {len(called)} | {named} | {listed} | {blamed} |")


if __name__ == "__main__":
    main()
