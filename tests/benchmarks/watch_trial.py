"""What `lptn.live.Watch` says while virtual legs walk: limits ahead, faults of sensors, false alarms, changes.

    python -m tests.benchmarks.watch_trial --robots 20

The model of each leg is fitted to two other runs of it. Four logs of each are then replayed at 1 Hz, with an
assessment every two minutes:

- a trot of seventy minutes, with the limit at seven tenths of the hottest joint's rise: how long before is it told
  first, and does the interval hold the moment at which the truth gets there, told 10, 5 and 2 min before;
- three quarters of an hour of walking, standing and squatting, without a fault: all that is said is false;
- the same with a fault at one joint from the twentieth minute on (`tests.hardening.faulty_sensors`): when it is told,
  be it as an alarm or as a sensor that is not trusted, and whether another channel is blamed;
- another day of the same leg, of which one joint has changed: when that is told, and what is said to be likely.

The truth comes from `lptn.virtual`, which shares no code with the model.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from pathlib import Path

import numpy as np
import pandas as pd

from lptn.identify.data import LoadedModel, load_model
from lptn.live.sources import Replay
from lptn.live.status import Status
from lptn.live.watch import Watch
from lptn.virtual import LEG_JOINTS, Bout, Hidden, Job, leg_logs
from tests.hardening.faulty_sensors import BEGIN, KINDS, judged, watched_logs

STEP, EVERY, SMOOTH = 1.0, 120.0, 31  # K, of the sensors; s between assessments; readings over which truth is averaged
BEFORE = (600, 300, 120)  # s before a limit at which the forecast is judged
SHARE = 0.7  # of the hottest joint's rise, at which its limit stands
CHANGES = ("surface_scale", "coulomb_friction", "constant_heat", "loss_scale")


@dataclass
class Told:
    """What was said in time: intervals to limits, by which channel is called what and since when, events."""

    ahead: list[tuple[float, str, float, float, float]] = field(default_factory=list)
    called: dict[str, tuple[float, str]] = field(default_factory=dict)
    events: list[tuple[float, str]] = field(default_factory=list)

    def show(self, status: Status) -> None:
        """Take a status."""
        self.events += [(status.time, event) for event in status.events]
        for one in status.nodes:
            if one.time_to_limit is not None and one.earliest is not None and one.latest is not None:
                self.ahead.append((status.time, one.node, one.earliest, one.time_to_limit, one.latest))
            if one.trust not in ("trusted", "not yet", "none"):
                self.called.setdefault(f"temperature.{one.node}", (status.time, one.trust))
        for alarm in status.alarms:
            name = alarm.channel or f"temperature.{alarm.node}"
            self.called[name] = (self.called.get(name, (status.time, ""))[0], alarm.kind)

    def close(self) -> None:
        """Nothing is held."""

    @property
    def changed(self) -> float:
        """When it was said that the robot is not its model [s]."""
        return min((time for time, event in self.events if "not as its model" in event), default=inf)

    @property
    def alarms(self) -> list[dict[str, str]]:
        """What is called by channel, as `judged` takes it."""
        return [{"kind": kind, "channel": name, "node": ""} for name, (_, kind) in self.called.items()]


def watched(loaded: LoadedModel, log: Path, limits: Mapping[str, float] | None = None) -> Told:
    """A log replayed as fast as it goes."""
    told = Told()
    Watch(loaded, Replay(log, 0.0, loaded), [told], limits=limits, every=EVERY).run()
    return told


def rounded(log: pd.DataFrame, path: Path) -> Path:
    """The log with its sensors' steps, in a file."""
    names = [f"temperature.{joint}" for joint in LEG_JOINTS]
    log.assign(**{name: np.round(log[name] / STEP) * STEP for name in names}).to_parquet(path)
    return path


def limit_ahead(loaded: LoadedModel, seed: int, folder: Path) -> tuple[float, list[bool]]:
    """How long before its limit the hottest joint is first told to reach it [s]; whether each judged interval holds."""
    rng = np.random.default_rng([seed, 9])
    trot = Bout("trot", 4200, float(rng.uniform(0.4, 0.8)), float(rng.uniform(0, 2)))
    job = Job((trot,), float(rng.uniform(10, 25)), cutout=None)
    true = leg_logs(seed=seed, quantisation=0.0, rate=1.0, runs={"trot": job})["trot"]
    columns = {joint: true[f"temperature.{joint}"] for joint in LEG_JOINTS}
    smooth = {joint: one.rolling(SMOOTH, center=True, min_periods=1).mean() for joint, one in columns.items()}
    hottest = max(LEG_JOINTS, key=lambda joint: float(smooth[joint].iloc[-1]))
    first, last = smooth[hottest].iloc[[0, -1]]
    limit = float(first + SHARE * (last - first))
    crossed = int((smooth[hottest] >= limit).to_numpy().argmax())
    told = watched(loaded, rounded(true, folder / "trot.parquet"), {hottest: limit})
    said = [(time, low, high) for time, node, low, middle, high in told.ahead if node == hottest and middle < inf]
    early = crossed - min((time for time, _, _ in said), default=float(crossed))
    held = []
    for before in BEFORE:
        then = [(low, high, crossed - time) for time, low, high in said if time <= crossed - before]
        held += [low <= left <= high for low, high, left in then[-1:]]
    return early, held


def another_day(loaded: LoadedModel, seed: int, folder: Path) -> tuple[str, float, str]:
    """What has changed at a joint, when that was told [s], and what was said last to be likely."""
    rng = np.random.default_rng([seed, 10])
    hidden = Hidden(CHANGES[seed % len(CHANGES)], LEG_JOINTS[int(rng.integers(len(LEG_JOINTS)))])
    bouts = [
        Bout(act, 450, float(rng.uniform(0.5, 1.1)), float(rng.uniform(0, 3))) for act in ("trot", "stand", "walk") * 2
    ]
    job = Job(tuple(bouts), float(rng.uniform(12, 28)), cutout=None)
    log = leg_logs([hidden], seed=seed, quantisation=0.0, rate=1.0, runs={"day": job})["day"]
    told = watched(loaded, rounded(log, folder / "day.parquet"))
    words = [event for _, event in told.events if event.startswith("likely cause")]
    return f"{hidden.effect} at {hidden.at}", told.changed, words[-1] if words else ""


def main() -> None:
    """Print what was told."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=20)
    parser.add_argument("--first", type=int, default=301, help="seed of the first robot")
    chosen = parser.parse_args()
    early, held, false = list[float](), list[bool](), list[str]()
    found, blamed = defaultdict[str, list[float]](list), defaultdict[str, list[str]](list)
    for seed in range(chosen.first, chosen.first + chosen.robots):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            logs = watched_logs(seed, folder, STEP)
            fit = "lptn", "fit", "preset.toml", "fit1.parquet", "fit2.parquet", "-o", "model.toml"
            subprocess.run([sys.executable, "-m", *fit], cwd=folder, check=True, capture_output=True)
            loaded = load_model(folder / "model.toml")
            warned, holds = limit_ahead(loaded, seed, folder)
            early, held = [*early, warned], [*held, *holds]
            faulty = list(KINDS)[1:][seed % (len(KINDS) - 1)]
            by_kind = {asked.kind: (folder / f"{log}.parquet", asked) for log, asked in logs.items()}
            told = watched(loaded, by_kind["healthy"][0])
            said = [f"{channel} {kind}" for channel, (_, kind) in told.called.items()]
            false += [f"{seed}: {words}" for words in said + ["changed"] * (told.changed < inf)]
            path, asked = by_kind[faulty]
            told = watched(loaded, path)
            right, others = judged(asked, told.alarms)
            own = [time for channel, (time, _) in told.called.items() if channel.endswith(asked.joint)]
            begin = 0 if KINDS[faulty].right == ("swapped",) else BEGIN
            found[faulty].append(min(own) - begin if right else inf)
            blamed[faulty] += [str(told.called)] * (others > 0) + [f"{seed}: changed"] * (told.changed < inf)
            change = another_day(loaded, seed, folder)
            print(f"{seed}: {warned / 60:.0f} min before, {holds}; {faulty}: {right or 'nothing'} after "
                  f"{found[faulty][-1]:.0f} s, {others} others; {change}", flush=True)  # fmt: skip
    print(f"\nlimits: told {np.median(early) / 60:.0f} min before, at least {min(early) / 60:.0f}; "
          f"{sum(held)} of {len(held)} intervals hold")  # fmt: skip
    print(f"healthy: {len(false)} false in {chosen.robots * 0.75:g} h: {'; '.join(false) or 'none'}")
    for kind, times in found.items():
        after = ", ".join(f"{time:.0f}" for time in times)
        count = sum(time < inf for time in times)
        print(f"{kind}: {count} of {len(times)}, after {after} s; {blamed[kind] or 'nobody'} blamed")


if __name__ == "__main__":
    main()
