"""Forecast trial: how long until a trotting virtual quadruped's first joint is at 60 °C?

Run it with ``python -m tests.benchmarks.forecast``: robots unlike those it was tuned on (201, 202, 301), the 20 trots
of each robot's forecast plan, which all get well past 60 °C. ``--creeping`` draws trots of any load and ambient
instead, some of which creep up to the limit or never reach it. For each robot a model is fitted to the logs of its
protocol (other runs, another day); the log of a trot is then read up to the moment at which its hottest joint passes
48 °C, and up to 60, 120, 240, 360 and 480 s where that joint is not at its limit yet, and the forecast is set against
the noise-free truth of the rest. The truth comes from `lptn.virtual`, which
shares no code with the model; logs go through files, as a user's would.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite
from pathlib import Path

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.identify.data import LoadedModel, load_model, split_data
from lptn.identify.validation import fit_segments
from lptn.online.forecasting import Forecast, NodeForecast, forecast
from lptn.online.operating_point import GaitPeriod, find_gait
from lptn.online.present import ModelUncertainty
from lptn.robots.presets import preset_text
from lptn.virtual import Bout, Job, Probe, Record, quadruped, quadruped_logs, rows, write_logs
from lptn.virtual import simulate_runs as live
from tests.truth.plans import trots

LIMIT, LASTS, RATE = 60.0, 5400, 100.0  # degC, s, Hz
EARLIEST, LATEST = 60, 600  # s of trot before the forecast; the latter where the moment to make it never comes
FIT_STEP = 10.0  # s


@dataclass(frozen=True)
class Robot:
    """A robot's fitted model, and what its fit knows of its errors."""

    seed: int
    loaded: LoadedModel
    uncertainty: ModelUncertainty


@dataclass(frozen=True)
class Trot:
    """What was drawn: robot, load [kg], ambient [degC]."""

    robot: int
    load: float
    ambient: float


@dataclass(frozen=True)
class Trial:
    """Forecasts of one trot made after `at` s of it: from the steady stretch, and from ten gait cycles."""

    trot: Trot
    moment: str
    at: int
    truth: dict[str, float]
    steady: Forecast
    cycles: Forecast
    seconds: float

    @property
    def first(self) -> str:
        """The joint that is at its limit first, or the hottest one of a robot that never is."""
        return min(self.truth, key=lambda node: (self.truth[node], -self.steady.nodes[node].steady))


def fitted(seed: int, model: str, folder: Path) -> Robot:
    """Fit the model to the robot's protocol logs."""
    write_logs(folder, quadruped_logs(seed=seed))
    (folder / "model.toml").write_text(preset_text("quadruped", "windings" if model == "windings" else None))
    loaded = load_model(folder / "model.toml")
    data = split_data(loaded.runs(sorted(folder.glob("*.parquet")))).coarsened(FIT_STEP)
    done = fit_segments(loaded.model, data.fit, symmetry_penalty=1.0)
    print(f"robot {seed}: fitted to {len(data.fit)} runs, RMSE {done.rmse:.3f} K, {done.status}", flush=True)
    return Robot(seed, LoadedModel(loaded.file, done.model, loaded.mapped), ModelUncertainty.of_fit(done))


def planned(seed: int, number: int) -> dict[str, Job]:
    """The first trots of the robot's forecast plan, without the cut-out that would hide when other joints get hot."""
    runs = list(trots(seed).items())[:number]
    return {name: replace(run, cutout=None) for name, run in runs}


def creeping(seed: int, number: int) -> dict[str, Job]:
    """Trots of any load, ambient and speed, whether they get to the limit or not."""
    runs = {}
    for k in range(number):
        rng = np.random.default_rng([seed, k])
        load, ambient, speed = rng.uniform(0, 6), rng.uniform(5, 35), rng.uniform(0.2, 1.0)
        runs[f"forecast{k}"] = Job((Bout("trot", LASTS, speed, load),), ambient=ambient, cutout=None)
    return runs


def trials(robot: Robot, name: str, run: Job, at: float, after: Sequence[int], folder: Path) -> list[Trial]:
    """Let the robot trot, forecast at several moments, and look at the truth.

    Args:
        robot: the robot.
        name: of the trot; draws its movement.
        run: the trot.
        at: degC of the hottest joint at which the first forecast is made.
        after: s after which the others are made, while that joint is below its limit.
        folder: for the logs.
    """
    (record,) = live(quadruped(seed=robot.seed), {name: run}, robot.seed, "default")
    hottest = record.sensed[:, : record.robot.joints].max(axis=1)
    moments = {f"at {at:g} °C": _when(hottest, at)}
    moments |= {f"after {now} s": now for now in after if hottest[: now + 1].max() < LIMIT}
    drawn = Trot(robot.seed, run.segments[0].load, run.ambient)
    return [_forecast(robot, record, drawn, moment, now, folder) for moment, now in moments.items()]


def _forecast(robot: Robot, record: Record, trot: Trot, moment: str, now: int, folder: Path) -> Trial:
    joints = record.robot.nodes[: record.robot.joints]
    log = _log(record, robot.seed, now, folder)
    start = time.perf_counter()
    (read,) = robot.loaded.runs([log])
    gait = _gait(log, joints)
    steady, cycles = (
        forecast(robot.loaded.model, read, LIMIT, fit=robot.uncertainty, window=window, gait=gait)
        for window in ("steady", "cycles")
    )
    passed = [np.flatnonzero(column[now:] >= LIMIT) for column in record.sensed[:, : len(joints)].T]
    truth = {joint: float(indices[0]) if indices.size else inf for joint, indices in zip(joints, passed, strict=True)}
    return Trial(trot, moment, now, truth, steady, cycles, time.perf_counter() - start)


def _when(hottest: FloatArray, at: float) -> int:
    passed = np.flatnonzero(hottest >= at)
    return max(int(passed[0]), EARLIEST) if passed.size else LATEST


def _log(record: Record, seed: int, until: int, folder: Path) -> Path:
    """The log's first seconds, at 100 Hz, as a file."""
    pieces: list[pd.DataFrame] = []
    for piece in rows(record, Probe(noise=0.15, quantisation=1.0), seed, RATE):
        pieces.append(piece)
        if len(pieces) * len(pieces[0]) >= until * RATE:
            break
    path = folder / f"{record.name}.parquet"
    pd.concat(pieces).iloc[: int(until * RATE)].to_parquet(path, index=False)
    return path


def _gait(log: Path, joints: Sequence[str]) -> GaitPeriod:
    table = pd.read_parquet(log, columns=[f"velocity.{joint}" for joint in joints])
    return find_gait([table[name].to_numpy() for name in table], 1 / RATE)


def error(found: NodeForecast, true: float) -> float:
    """Error of the time to the limit as a share of the true time still to go."""
    if true == 0:  # a joint may be past the limit already
        return 0.0 if found.time_to_limit == 0 else inf
    return abs(found.time_to_limit - true) / true


def holds(found: NodeForecast, true: float) -> bool:
    """Whether the interval holds the truth; a limit that isn't reached while the truth is watched counts as never."""
    return found.low <= true <= found.high or (not isfinite(true) and found.high > LASTS)


def row(done: Trial) -> str:
    """A line of the table."""
    node, trot = done.first, done.trot
    true, steady, other = done.truth[node], done.steady.nodes[node], done.cycles.nodes[node]
    cells = [f"{trot.robot}", f"{trot.load:.1f}", f"{trot.ambient:.0f}", node, f"{done.at}"]
    cells += [f"{done.steady.window.seconds:.0f}", f"{true:.0f}", f"{steady.time_to_limit:.0f}"]
    cells += [f"{steady.low:.0f} to {steady.high:.0f}"]
    if isfinite(true):
        cells += [f"{error(steady, true):.1%}", f"{error(other, true):.1%}"]
    else:
        cells += ["wrong" if prediction.reaches else "right" for prediction in (steady, other)]
    return f"| {' | '.join(cells)} | {'yes' if holds(steady, true) else 'no'} | {done.seconds:.1f} |"


def summary(done: Sequence[Trial]) -> str:
    """Median, worst and coverage: of the joint that is at its limit first, and of all joints."""
    lines = []
    for name, window in (("first joint", "steady"), ("first joint", "cycles"), ("all joints", "steady")):
        pairs = [
            (getattr(trial, window).nodes[node], true, trial.at)
            for trial in done
            for node, true in trial.truth.items()
            if (node == trial.first or name == "all joints") and true > 0
        ]
        errors = np.array(
            [(error(prediction, true), true / (true + at)) for prediction, true, at in pairs if isfinite(true)]
        )
        nevers = [not prediction.reaches for prediction, true, _ in pairs if not isfinite(true)]
        inside = np.mean([holds(prediction, true) for prediction, true, _ in pairs])
        whole = errors[:, 0] * errors[:, 1]
        lines += [
            f"{name}, {'ten gait cycles' if window == 'cycles' else 'steady stretch'}, {len(errors)} times: median "
            f"{np.median(errors[:, 0]):.1%}, worst {errors[:, 0].max():.1%} of the time still to go; median "
            f"{np.median(whole):.1%}, worst {whole.max():.1%} of the time since the trot began; 90 % interval holds "
            f"{inside:.0%} of {len(pairs)}; 'never' said rightly {sum(nevers)} of {len(nevers)}"
        ]
    return "\n".join(lines)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", nargs="+", type=int, default=[401, 402, 403])
    parser.add_argument("--trots", type=int, default=20, help="of each robot")
    parser.add_argument("--creeping", action="store_true", help="trots of any load and ambient instead of the plan's")
    parser.add_argument("--model", choices=["windings", "preset"], default="windings")
    parser.add_argument("--at", type=float, default=48.0, help="degC of the hottest joint at the one forecast")
    parser.add_argument(
        "--after", type=int, nargs="*", default=[60, 120, 240, 360, 480], help="s of trot before the others"
    )
    chosen = parser.parse_args()
    done: list[Trial] = []
    for seed in chosen.robots:
        with tempfile.TemporaryDirectory() as name:
            robot = fitted(seed, chosen.model, Path(name))
            for trot, run in (creeping if chosen.creeping else planned)(seed, chosen.trots).items():
                for latest in trials(robot, trot, run, chosen.at, chosen.after, Path(name)):
                    done.append(latest)
                    print(f"  {trot} {latest.moment}: {row(latest)}", flush=True)
    for moment in dict.fromkeys(trial.moment for trial in done):
        chosen_ones = [trial for trial in done if trial.moment == moment]
        print(f"\nForecast {moment}\n")
        print("| robot | load, kg | ambient, °C | joint | made at, s | window, s | true, s | forecast, s |", end="")
        print(" 90 % interval, s | error | of ten cycles | inside | took, s |")
        print("|" + " --- |" * 13)
        print(*(row(trial) for trial in chosen_ones), summary(chosen_ones), sep="\n")


if __name__ == "__main__":
    main()
