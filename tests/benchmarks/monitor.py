"""Monitor trial: a fitted quadruped watches 50 healthy logs and 50 with one sensor's fault. What is called, and when?

Run it with ``python -m tests.benchmarks.monitor --seeds 101``; some minutes a seed. The truth comes from
`lptn.virtual`, which shares no code with the model. The model is fitted on other logs of the same robot: the
protocol and tests of [QuadrupedLPTN], and ten healthy outings of an earlier day. The same logs calibrate the
statistical detector.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.identify.data import LoadedModel, load_model
from lptn.identify.fitting import fit
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.online.calibration import FALSE_ALARMS, Calibration, calibrate, rare
from lptn.online.fault_bank import Alarm
from lptn.online.monitoring import MonitoredRun, alarms_by_threshold, monitor
from lptn.robots.presets import presets
from lptn.simulate.bound_run import bind
from lptn.virtual import plan, quadruped_logs, write_logs
from tests.truth.faults import Fault
from tests.truth.plans import outings

OUTINGS = 10
THRESHOLD = 10.0  # K
SEEN = 2.0  # K; a stuck sensor whose temperature moves less has done no harm yet
HALF_HOUR = 1800.0  # s
QUANTISATION = 1.0  # K, of the sensors


@dataclass(frozen=True)
class Watch:
    """One log: its fault (`None` for a healthy one), how far its truth leaves a stuck reading, and all alarms."""

    name: str
    fault: Fault | None
    moved: float
    alarms: dict[str, Sequence[Alarm]]

    def hit(self, detector: str) -> Alarm | None:
        """The alarm at the faulty sensor after the fault's beginning."""
        fault = self.fault
        alarms = self.alarms[detector]
        return next((alarm for alarm in alarms if fault and alarm.node == fault.at and alarm.time >= fault.time), None)

    def false(self, detector: str) -> int:
        """Alarms at healthy sensors, or before the fault."""
        hit = self.hit(detector)
        return sum(alarm is not hit for alarm in self.alarms[detector])

    @property
    def harmless(self) -> bool:
        """Whether nothing can be seen of the fault: a stuck sensor of a motor that keeps its temperature."""
        return self.fault is not None and self.fault.kind == "stuck" and self.moved < SEEN


@dataclass(frozen=True)
class Robot:
    """A fitted robot, what its healthy logs taught, and a threshold that gives the plain detector as few alarms."""

    loaded: LoadedModel
    model: Model
    calibration: Calibration
    fair: float


def prepare(seed: int, folder: Path, ordinary: bool) -> Robot:
    """Make the logs to fit, fit, calibrate."""
    earlier = [run for name, run in outings(seed + 1000)[0].items() if name.startswith("healthy")][:OUTINGS]
    runs = plan("protocol", seed) | plan("tests", seed)
    if ordinary:
        runs |= {f"outing_{number:02d}": run for number, run in enumerate(earlier)}
    files = write_logs(folder, quadruped_logs(seed=seed, runs=runs))
    model_file = folder / "quadruped.toml"
    model_file.write_text(presets()["quadruped"])
    loaded = load_model(model_file)
    healthy = loaded.runs(files)
    start = time.perf_counter()
    done = fit(loaded.model, [bind(loaded.model, run.coarsen(10)) for run in healthy], symmetry_penalty=1.0)
    print(f"seed {seed}: fit {time.perf_counter() - start:.0f} s, RMSE {done.rmse:.2f} K, {done.status}", flush=True)
    start = time.perf_counter()
    calibration = calibrate(done.model, healthy)
    limits = ", ".join(f"{kind} {limit:.1f}" for kind, limit in calibration.limits.items())
    print(f"calibration {time.perf_counter() - start:.0f} s, limits {limits}", flush=True)
    return Robot(loaded, done.model, calibration, _fair(done.model, healthy))


def _fair(model: Model, healthy: Sequence[Run]) -> float:
    """The plain threshold [K] that gives as few false alarms, found as the statistical detector's limits are."""
    maxima: list[FloatArray] = []
    for run in healthy:
        error = np.abs(np.nan_to_num(MonitoredRun.of(model, run).error))
        blocks = max(1, round(len(run) * run.step / HALF_HOUR))
        maxima += [block.max(axis=1) for block in np.array_split(error, blocks, axis=1)]
    hours = sum(len(run) * run.step for run in healthy) / 3600
    return rare(np.concatenate(maxima), FALSE_ALARMS * hours / len(maxima) / len(model.nodes))


def watch(seed: int, robot: Robot, folder: Path, count: int) -> list[Watch]:
    """Make the logs to watch, and watch them."""
    runs, faults = outings(seed)
    runs = {name: run for name, run in runs.items() if int(name[-2:]) < count}
    logs, fine = (quadruped_logs(seed=seed, runs=runs, quantisation=step) for step in (QUANTISATION, 0.0))
    shown = dict(logs) | {name: faults[name].shown(fine[name], QUANTISATION) for name in logs if name in faults}
    watched = []
    for name, path in zip(logs, write_logs(folder, shown), strict=True):
        result = monitor(robot.model, robot.loaded.runs([path]), threshold=THRESHOLD, calibration=robot.calibration)
        (monitored,) = result.runs
        fair = alarms_by_threshold(monitored, robot.fair)
        alarms: dict[str, Sequence[Alarm]] = {
            "plain": monitored.threshold_alarms,
            "fair": fair,
            "statistical": monitored.statistical_alarms,
        }
        fault = faults.get(name)
        moved = 0.0
        if fault is not None:
            true = logs.truth[name].query("time >= @begin", local_dict={"begin": fault.time})[f"temperature.{fault.at}"]
            moved = float(np.abs(true - true.iloc[0]).max())
        watched.append(Watch(name, fault, moved, alarms))
    return watched


def row(each: Watch) -> str:
    """A line of the table of faults."""
    fault = each.fault
    if fault is None:
        raise ValueError(f"{each.name}: expected a log with a fault")
    size = {"drift": f"{fault.size:+.3f} K/s", "offset": f"{fault.size:+.1f} K"}.get(fault.kind, "")
    size = size or (f"moves {each.moved:.1f} K" if fault.kind == "stuck" else "")
    ideal = f"{THRESHOLD / abs(fault.size):.0f}" if fault.kind == "drift" else "–"
    cells = []
    for detector in each.alarms:
        hit, false = each.hit(detector), each.false(detector)
        answer = "–" if hit is None else f"{hit.time - fault.time:.0f} {hit.kind}"
        cells.append(answer + f" ({false} false)" * (false > 0))
    return f"| {fault.kind} | {fault.at} | {size} | {ideal} | {' | '.join(cells)} |"


def summary(watched: Sequence[Watch], detector: str) -> str:
    """A line of the table of detectors."""
    healthy = [log for log in watched if log.fault is None]
    faulty = [log for log in watched if log.fault is not None]
    hits = [(log, log.hit(detector)) for log in faulty]
    missed = [log for log, hit in hits if hit is None]
    named = sum(hit is not None and log.fault is not None and hit.kind == log.fault.kind for log, hit in hits)
    cells = [
        f"{sum(bool(log.alarms[detector]) for log in healthy)} of {len(healthy)}",
        f"{sum(log.false(detector) > 0 for log in faulty)} of {len(faulty)}",
        f"{len(missed)} of {len(faulty)} ({sum(log.harmless for log in missed)} harmless)",
        f"{named} of {len(faulty) - len(missed)}",
    ]
    for kind in ("drift", "offset", "stuck", "dropout"):
        times = [hit.time - log.fault.time for log, hit in hits if hit and log.fault and log.fault.kind == kind]
        all_ = sum(log.fault is not None and log.fault.kind == kind for log in faulty)
        cells.append(f"{np.median(times):.0f} s, {len(times)}/{all_}" if times else f"–, 0/{all_}")
    return f"| {detector} | {' | '.join(cells)} |"


def compared(watched: Sequence[Watch]) -> str:
    """Detection times of drifts as shares of the ideal one, and how often the statistical detector came first."""
    lines = []
    drifts = [(log, log.fault) for log in watched if log.fault is not None and log.fault.kind == "drift"]
    for detector in drifts[0][0].alarms if drifts else ():
        shares = [
            (hit.time - fault.time) * abs(fault.size) / THRESHOLD
            for log, fault in drifts
            if (hit := log.hit(detector)) is not None
        ]
        if shares:
            lines.append(
                f"{detector}: drifts called after {np.median(shares):.2f} of 10 K / rate (median; "
                f"{min(shares):.2f} to {max(shares):.2f}), {len(shares)} of {len(drifts)}"
            )
    return "\n".join(lines)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", nargs="+", type=int, default=[101])
    parser.add_argument("--count", type=int, default=50, help="healthy logs, and faulty ones, a seed")
    parser.add_argument("--without-outings", action="store_true", help="fit and calibrate on protocol and tests alone")
    chosen = parser.parse_args()
    watched: list[Watch] = []
    for seed in chosen.seeds:
        with tempfile.TemporaryDirectory() as one, tempfile.TemporaryDirectory() as other:
            robot = prepare(seed, Path(one), ordinary=not chosen.without_outings)
            print(f"plain threshold at the same rate of false alarms: {robot.fair:.1f} K", flush=True)
            start = time.perf_counter()
            watched += watch(seed, robot, Path(other), chosen.count)
            print(f"watching {time.perf_counter() - start:.0f} s", flush=True)
    print("\nTimes in s from the fault's beginning; fair: the plain detector at that other threshold.\n")
    print(
        "| fault | at | size | ideal | plain 10 K | fair | statistical |\n| --- | --- | --- | --- | --- | --- | --- |"
    )
    for log in watched:
        if log.fault is not None:
            print(row(log))
    print(
        "\n| detector | false alarms, healthy logs | false alarms, faulty logs | misses | named right of those found ",
        end="",
    )
    print("| drift, median | offset | stuck | dropout |\n" + "| --- " * 9 + "|")
    for detector in watched[0].alarms:
        print(summary(watched, detector))
    print(f"\n{compared(watched)}")


if __name__ == "__main__":
    main()
