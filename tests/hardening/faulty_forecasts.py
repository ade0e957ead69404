"""Forecasts from logs in which one sensor is not alive up to the end: time to the limit against truth.

    python -m tests.hardening.faulty_forecasts --seeds 31 32 33 --versions old=OLD/bin/lptn new=NEW/bin/lptn

A virtual leg stands and then trots; the log ends while its joints still warm, and the sensor of one of them has
been faulty for 2 to 30 min by then. Each version is asked with `lptn forecast` when this joint reaches the temperature
that it truly has some minutes later. The model was fitted to other, healthy runs of that robot. Each fault has one log
a seed; from seed to seed its length changes, and the steps of the sensors are 0.1 K and 1 K in turn. What is printed,
for each kind: the median and the largest error as a share of the true time, how often "never" was said wrongly, and
how often the 90 % interval holds the truth.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

from lptn.robots.presets import presets
from lptn.virtual import LEG_JOINTS, Bout, Job, leg_logs
from tests.benchmarks.verdict_answers import command_of

Array = npt.NDArray[np.float64]
STAND, TROT, AHEAD = 1500, 900, 4200  # s
LIMIT = 100  # s of CPU for an answer: one takes some seconds


def _held(value: float | None) -> Callable[[Array, Array, Array, np.random.Generator], Array]:
    """A sensor that gives the same number all the while: its first one where no number is said."""
    return lambda since, readings, _true, _rng: np.full(since.size, float(readings[0]) if value is None else value)


def _clamped(since: Array, readings: Array, _true: Array, _rng: np.random.Generator) -> Array:
    """Firmware that gives no more than what the sensor reads at the beginning."""
    return np.asarray(np.minimum(readings, readings[: max(1, since.size // 20)].max()))


def _drifting(rate: float) -> Callable[[Array, Array, Array, np.random.Generator], Array]:
    return lambda since, readings, _true, _rng: readings + rate * since


def _lagging(since: Array, readings: Array, true: Array, _rng: np.random.Generator) -> Array:
    """A sensor that has come loose and follows with a time constant of 3 min; its noise is as before."""
    path, keep = true.copy(), np.exp(-1 / 180.0)
    for k in range(1, since.size):
        path[k] = keep * path[k - 1] + (1 - keep) * true[k]
    return readings + path - true


def _spiking(_since: Array, readings: Array, _true: Array, rng: np.random.Generator) -> Array:
    """A bad contact: one reading of 50 is 10 to 60 K off."""
    struck = rng.random(readings.size) < 0.02
    return np.asarray(readings + struck * rng.uniform(10, 60, readings.size) * rng.choice([-1, 1], readings.size))


FAULTS: dict[str, Callable[[Array, Array, Array, np.random.Generator], Array]] = {
    "healthy": lambda _since, readings, _true, _rng: readings,
    "stuck": _held(None),
    "dead, 0": _held(0.0),
    "dead, −127": _held(-127.0),
    "dead, 125": _held(125.0),
    "clamped": _clamped,
    "drifting, 0.01 K/s": _drifting(0.01),
    "drifting, −0.05 K/s": _drifting(-0.05),
    "lagging, 180 s": _lagging,
    "spiking": _spiking,
}
MINUTES = (2, 4, 10, 30)
STEPS = (0.1, 1.0)  # K


@dataclass(frozen=True)
class Asked:
    """One log: its fault, and the joint, its limit [degC] and the true time until then [s]."""

    fault: str
    minutes: int
    joint: str
    limit: float
    true: float


@dataclass(frozen=True)
class Answer:
    """Time to the limit [s], the 90 % interval, and what the command printed; `nan` where nothing was said."""

    time: float
    low: float
    high: float
    text: str


def forecasts(seed: int, folder: Path, faults: Sequence[str], minutes: Sequence[int]) -> dict[Path, Asked]:
    """The model file `model.toml`, fitted runs and the logs to forecast from, in a folder."""
    rng = np.random.default_rng([seed, 15])
    (folder / "preset.toml").write_text(presets()["leg"], encoding="utf-8")
    for name, frame in leg_logs(seed=seed, quantisation=0.1, rate=1.0).items():
        frame.to_parquet(folder / f"{name}.parquet")
    now, names = STAND + TROT, [f"temperature.{joint}" for joint in LEG_JOINTS]
    made: dict[Path, Asked] = {}
    for number, fault in enumerate(faults):
        length, step = minutes[(seed + number) % len(minutes)], STEPS[(seed + number // 2) % len(STEPS)]
        # Each log has a movement of its own: its load wanders, and with it the time to the limit.
        path = folder / f"{number}_{length}_{step:g}.parquet"
        log, truth = _walked(seed, path.stem, step, rng)
        # Of joints that still warm by some kelvins any may be struck.
        warms = [joint for joint in names if truth[joint].iloc[now + 1200] > truth[joint].iloc[now] + 3.0]
        name = warms[int(rng.integers(len(warms)))]
        true, ahead = truth[name].to_numpy(), int(rng.uniform(300, 1500))
        table = log.iloc[:now].copy()
        rows = slice(now - 60 * length, now)
        since = np.arange(60.0 * length)
        readings = table[name].to_numpy().copy()
        readings[rows] = FAULTS[fault](since, readings[rows], true[rows], rng)
        table[name] = np.round(readings / step) * step
        limit = float(true[now + ahead])
        reached = float(np.flatnonzero(true[now:] >= limit)[0])
        table.to_parquet(path)
        made[path] = Asked(fault, length, name.removeprefix("temperature."), limit, reached)
    return made


def _walked(seed: int, name: str, step: float, rng: np.random.Generator) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The log of a run and its true temperatures; what no leg bears or ceases to warm it is drawn again."""
    now, names = STAND + TROT, [f"temperature.{joint}" for joint in LEG_JOINTS]
    while True:
        stand = Bout("stand", STAND, load=float(rng.uniform(0, 2)))
        trot = Bout("trot", TROT + AHEAD, float(rng.uniform(0.5, 1.2)), float(rng.uniform(1, 4)))
        run = {name: Job((stand, trot), float(rng.uniform(12, 26)), cutout=None)}
        try:
            truth = leg_logs(seed=seed, noise=0.0, rate=1.0, runs=run)[name]
        except ValueError:
            continue
        if (truth[names].iloc[now + 1200] > truth[names].iloc[now] + 3.0).any():
            return leg_logs(seed=seed, quantisation=step, rate=1.0, runs=run)[name], truth


def fit(folder: Path, command: Path) -> None:
    """Fit the preset to the healthy runs."""
    words = [command, "fit", "preset.toml", "fit1.parquet", "fit2.parquet", "-o", "model.toml"]
    subprocess.run([str(word) for word in words], cwd=folder, check=True, capture_output=True)


def ask(command: Path, log: Path, asked: Asked) -> Answer:
    """What a version says."""
    words = [command, "forecast", "model.toml", log.name, "--limit", f"{asked.joint}={asked.limit}", "--json", "f.json"]
    (log.parent / "f.json").unlink(missing_ok=True)
    limited = ["prlimit", f"--cpu={LIMIT}", *map(str, words)]
    done = subprocess.run(limited, cwd=log.parent, check=False, capture_output=True, text=True, encoding="utf-8")
    text = done.stdout + done.stderr
    if done.returncode:
        return Answer(np.nan, np.nan, np.nan, text)
    said = json.loads((log.parent / "f.json").read_text(encoding="utf-8"))["nodes"][asked.joint]
    time, low, high = (inf if said[name] is None else said[name] for name in ("time_to_limit", "low", "high"))
    return Answer(time, low, high, text)


def row(kind: str, pairs: Sequence[tuple[Asked, Answer]]) -> str:
    """A line of the table."""
    said = [(asked, answer) for asked, answer in pairs if not np.isnan(answer.time)]
    errors = [abs(answer.time - asked.true) / asked.true for asked, answer in said if isfinite(answer.time)]
    nevers = sum(not isfinite(answer.time) for _, answer in said)
    inside = sum(answer.low <= asked.true <= answer.high for asked, answer in said)
    middle, worst = (f"{share:.0%}" for share in (np.median(errors), max(errors))) if errors else ("–", "–")
    return f"| {kind} | {len(said)} of {len(pairs)} | {middle} | {worst} | {nevers} | {inside} of {len(said)} |"


def table(results: Mapping[str, list[tuple[Asked, Answer]]], minutes: Sequence[int]) -> str:
    """All kinds, and all lengths."""
    lines = []
    for version, pairs in results.items():
        lines += [f"\n{version}\n\n| fault | answers | median error | largest | never | 90 % interval holds |"]
        lines += ["| --- | --- | --- | --- | --- | --- |"]
        for kind in dict.fromkeys(asked.fault for asked, _ in pairs):
            lines.append(row(kind, [pair for pair in pairs if pair[0].fault == kind]))
        faulty = [pair for pair in pairs if pair[0].fault != "healthy"]
        lines += [row(f"all, {long} min", [pair for pair in faulty if pair[0].minutes == long]) for long in minutes]
        lines.append(row("all faults", faulty))
    return "\n".join(lines)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[31, 32, 33])
    parser.add_argument("--versions", type=command_of, nargs="+", required=True, metavar="NAME=COMMAND")
    parser.add_argument("--faults", nargs="+", choices=list(FAULTS), default=list(FAULTS))
    parser.add_argument("--minutes", type=int, nargs="+", default=list(MINUTES))
    parser.add_argument("--verbose", action="store_true", help="a line for each answer")
    chosen = parser.parse_args()
    versions = {name: command.absolute() for name, command in chosen.versions}
    results: dict[str, list[tuple[Asked, Answer]]] = {name: [] for name in versions}
    for seed in chosen.seeds:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            made = forecasts(seed, folder, chosen.faults, chosen.minutes)
            fit(folder, next(iter(versions.values())))
            for log, asked in made.items():
                for version, command in versions.items():
                    answer = ask(command, log, asked)
                    results[version].append((asked, answer))
                    if chosen.verbose:
                        interval = f"{answer.low:.0f} to {answer.high:.0f}"
                        kind = f"{seed} {log.stem} {asked.fault} {asked.joint} {version}"
                        print(f"{kind}: true {asked.true:.0f}, said {answer.time:.0f} ({interval})", flush=True)
    print(table(results, chosen.minutes))


if __name__ == "__main__":
    main()
