"""What `lptn.monitor` says of 17 faults of sensors and of inputs, and whom it blames beside them.

    python -m tests.hardening.monitored_faults --robots leg quadruped --seeds 1 2

Robots are plain networks with exact steps (`tests.hardening.plants`) whose every capacity, resistance and loss is off
by 10 % of the model's, up or down at random; their joints change between loads every few minutes. Each log of 50 min
has one fault, from 20 min on or all the while. It is watched with the model as it stands and nothing learnt, then with
what two healthy logs teach, then so with a model that was fitted to these (`--modes`). Sensors are of several kinds
(`--sensors`). Printed for each fault: how often one of its channels is called, what by, and how often a
channel is blamed that is healthy; that a joint's sensor or its load is wrong blames none where one of them is.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.identify.data import load_model
from lptn.identify.fitting import fit
from lptn.online.calibration import calibrate
from lptn.online.fault_bank import Alarm
from lptn.online.monitoring import monitor
from lptn.simulate.bound_run import bind
from tests.hardening.plants import AIR, ROBOTS, Plant, Robot

LENGTH, BEGIN, HOLD = 3000, 1200, 150  # s; of a log; a fault's begin; between two loads
MODES = ("untaught", "taught", "fitted")
Rng = np.random.Generator


@dataclass(frozen=True)
class Sensors:
    """How temperatures are read.

    Args:
        noise: standard deviation [K].
        step: of the readings, which are rounded to it [K].
        rate: readings a second [Hz].
    """

    noise: float
    step: float = 1e-4
    rate: int = 1


SENSORS = {"fine": Sensors(0.005), "usual": Sensors(0.1), "noisy": Sensors(0.3), "steps": Sensors(0.1, 1.0, 10)}


def healthy_log(robot: Robot, true: Robot, sensors: Sensors, random: Rng) -> pd.DataFrame:
    """A log without a fault, whose readings are not rounded yet."""
    plant, driven, rows = Plant(true, AIR, 1 / sensors.rate), len(robot.driven), LENGTH * sensors.rate
    # What holds a joint near 60 degC, and as much again for minutes.
    common = np.sqrt(35.0 * float(robot.to_air.mean()) / float(robot.loss.max()))
    loads = np.repeat(common * random.uniform(0.0, 1.6, (LENGTH // HOLD, driven)), HOLD * sensors.rate, axis=0)
    currents = loads * (1 + 0.1 * random.standard_normal((rows, driven)))
    path = np.empty((rows, len(robot.nodes)))
    for k, row in enumerate(currents):
        path[k] = plant.temperature
        plant.step(row)
    columns: dict[str, FloatArray] = {"time": np.arange(rows) / sensors.rate, "temperature.ambient": np.full(rows, AIR)}
    for node in robot.measured:
        columns[f"temperature.{robot.nodes[node]}"] = path[:, node] + sensors.noise * random.standard_normal(rows)
    columns |= {f"current.{robot.nodes[node]}": currents[:, column] for column, node in enumerate(robot.driven)}
    return pd.DataFrame(columns)


# --- Faults: each spoils a log at a joint, beside which another is told --------------------------------

Spoil = Callable[[pd.DataFrame, str, str, Rng], None]


def at(begin: float, change: Callable[[FloatArray, FloatArray, Rng], object], what: str = "temperature") -> Spoil:
    """A channel of the joint from a time on: its values then and the time since, made into others."""

    def spoil(log: pd.DataFrame, joint: str, _other: str, random: Rng) -> None:
        name, time = f"{what}.{joint}" if what != "ambient" else "temperature.ambient", log["time"].to_numpy()
        values, later = log[name].to_numpy().copy(), time >= begin
        values[later] = change(values[later], time[later] - begin, random)
        log[name] = values

    return spoil


def _lagging(values: FloatArray, since: FloatArray, _random: Rng) -> object:
    smooth = pd.Series(values).rolling(round(40 / since[1]) + 1, center=True, min_periods=1).mean().to_numpy()
    path, keep = smooth.copy(), np.exp(-since[1] / 300.0)
    for k in range(1, path.size):
        path[k] = keep * path[k - 1] + (1 - keep) * smooth[k]
    return values + path - smooth


def loose(share: float, seconds: float = 100.0) -> Callable[[FloatArray, FloatArray, Rng], object]:
    """The sensor goes that far to the air's temperature with a time constant; its noise stays."""

    def change(values: FloatArray, since: FloatArray, random: Rng) -> object:
        gone = share * (1 - np.exp(-since / seconds))
        return (1 - gone) * values + gone * (AIR + 0.1 * random.standard_normal(values.size))

    return change


def _exchanged(what: str) -> Spoil:
    def spoil(log: pd.DataFrame, joint: str, other: str, _random: Rng) -> None:
        one, two = f"{what}.{joint}", f"{what}.{other}"
        log[one], log[two] = log[two].copy(), log[one].copy()

    return spoil


def _copied(log: pd.DataFrame, joint: str, other: str, random: Rng) -> None:
    log[f"temperature.{joint}"] = log[f"temperature.{other}"] + 0.1 * random.standard_normal(len(log))


@dataclass(frozen=True)
class Fault:
    """What spoils a log, and the channels that may be blamed for it: of the joint "j", of the other "o"."""

    spoil: Spoil
    channels: tuple[str, ...]


_SENSOR, _LOAD = ("temperature.j",), ("current.j",)
FAULTS: dict[str, Fault] = {
    "healthy": Fault(lambda _log, _joint, _other, _random: None, ()),
    "current 1.5 times too large": Fault(at(0, lambda x, t, r: 1.5 * x, "current"), _LOAD),
    "current half, later": Fault(at(BEGIN, lambda x, t, r: 0.5 * x, "current"), _LOAD),
    "current 0, later": Fault(at(BEGIN, lambda x, t, r: 0 * x, "current"), _LOAD),
    "current 0": Fault(at(0, lambda x, t, r: 0 * x, "current"), _LOAD),
    "currents exchanged": Fault(_exchanged("current"), (*_LOAD, "current.o")),
    "air 8 K too warm": Fault(at(0, lambda x, t, r: x + 8.0, "ambient"), ("temperature.ambient",)),
    "offset of +6 K": Fault(at(BEGIN, lambda x, t, r: x + 6.0), _SENSOR),
    "offset of -4 K": Fault(at(BEGIN, lambda x, t, r: x - 4.0), _SENSOR),
    "drift of +0.01 K/s": Fault(at(BEGIN, lambda x, t, r: x + 0.01 * t), _SENSOR),
    "drift of -0.02 K/s": Fault(at(BEGIN, lambda x, t, r: x - 0.02 * t), _SENSOR),
    "lag of 300 s": Fault(at(BEGIN, _lagging), _SENSOR),
    "stuck": Fault(at(BEGIN, lambda x, t, r: 0 * x + x[0]), _SENSOR),
    "stuck with dither": Fault(at(BEGIN, lambda x, t, r: x[0] + 0.1 * r.standard_normal(x.size)), _SENSOR),
    "sensors exchanged": Fault(_exchanged("temperature"), (*_SENSOR, "temperature.o")),
    "copy of the neighbour": Fault(_copied, (*_SENSOR, "temperature.o")),
    "come loose": Fault(at(BEGIN, loose(1.0)), _SENSOR),
    "come loose by 60 %": Fault(at(BEGIN, loose(0.6)), _SENSOR),
}


def channel(alarm: Alarm) -> str:
    """What an alarm blames."""
    return alarm.channel or f"temperature.{alarm.node}"


@dataclass(frozen=True)
class Said:
    """Of one log: what the faulty channels are called, and the healthy ones that are blamed, each with its alarm."""

    called: tuple[str, ...]
    blamed: tuple[str, ...]


def watched(name: str, seed: int, sensors: Sensors, modes: list[str], chosen: list[str]) -> dict[tuple[str, str], Said]:
    """What is said of each fault in each mode."""

    def write(log: pd.DataFrame, path: Path) -> None:
        read = log.columns[log.columns.str.startswith("temperature.")]
        log[read] = (log[read] / sensors.step).round() * sensors.step
        log.round(4).to_csv(path, index=False)

    robot, random = ROBOTS[name](), np.random.default_rng([seed, 21])
    true = robot.off_by(0.1, "signs", random)
    joints = [robot.nodes[node] for node in robot.driven]
    said: dict[tuple[str, str], Said] = {}
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        (folder / "robot.toml").write_text(robot.toml())
        loaded = load_model(folder / "robot.toml")
        paths = [folder / f"healthy{number}.csv" for number in range(2)]
        for path in paths:
            write(healthy_log(robot, true, sensors, random), path)
        taught = loaded.runs(paths)
        fitted = loaded.model
        if "fitted" in modes:
            fitted = fit(loaded.model, [bind(loaded.model, run.coarsen(10)) for run in taught]).model
        learnt = {mode: None if mode == "untaught" else calibrate(fitted if mode == "fitted" else loaded.model, taught)
                  for mode in modes}  # fmt: skip
        for number, fault in enumerate(chosen):
            place = int(random.integers(len(joints)))
            joint, other = joints[place], joints[(place + 1) % len(joints)]
            log = healthy_log(robot, true, sensors, random)
            FAULTS[fault].spoil(log, joint, other, random)
            path = folder / f"watched{number}.csv"
            write(log, path)
            faulty = {text.replace(".j", f".{joint}").replace(".o", f".{other}") for text in FAULTS[fault].channels}
            try:
                runs = loaded.runs([path])
            except InputError as error:  # a log that is not read; the line says which column is wrong
                told = Said(("refused",), ()) if error.place in faulty else Said((), (f"{error.place} refused",))
                said |= {(mode, fault): told for mode in modes}
                continue
            for mode in modes:
                model = fitted if mode == "fitted" else loaded.model
                (run,) = monitor(model, runs, calibration=learnt[mode]).runs
                own = {channel(alarm): alarm for alarm in (*run.threshold_alarms, *run.statistical_alarms)}
                right = {key for key, alarm in own.items() if key in faulty or _names_one(alarm, faulty)}
                blamed = tuple(_words(alarm) for key, alarm in own.items() if key not in right)
                called = tuple(alarm.kind for key, alarm in own.items() if key in right)
                said[mode, fault] = Said(called, blamed)
    return said


def _names_one(alarm: Alarm, faulty: set[str]) -> bool:
    """Whether an alarm of one channel or another is of the joint that is at fault, or names the one that is."""
    return alarm.kind == "undecided" and any(
        alarm.node == name.partition(".")[2] or name in alarm.detail for name in faulty
    )


def _words(alarm: Alarm) -> str:
    return f"{channel(alarm)} {alarm.kind}" + (f" {alarm.size:+.3g}" if alarm.size is not None else "")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", nargs="+", choices=list(ROBOTS), default=["leg", "quadruped"])
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--sensors", nargs="+", choices=list(SENSORS), default=["usual", "fine"],
                        help="noise of 0.005, 0.1 or 0.3 K, or 1 K steps at 10 Hz")  # fmt: skip
    parser.add_argument("--modes", nargs="+", choices=MODES, default=list(MODES))
    parser.add_argument("--faults", nargs="+", choices=list(FAULTS), default=list(FAULTS))
    parser.add_argument("--verbose", action="store_true", help="a line for each log with what is blamed wrongly")
    chosen = parser.parse_args()
    before, all_said = time.time(), dict[tuple[str, str], list[Said]]()
    for name in chosen.robots:
        for seed in chosen.seeds:
            for kind in chosen.sensors:
                for key, said in watched(name, seed, SENSORS[kind], chosen.modes, chosen.faults).items():
                    all_said.setdefault(key, []).append(said)
                    if chosen.verbose:
                        told = f"called {', '.join(said.called) or '–'}; blamed {', '.join(said.blamed) or '–'}"
                        print(f"{name} {seed}, {kind} sensors, {', '.join(key)}: {told}", flush=True)
    for mode in chosen.modes:
        print(f"\n{mode}\n\n| fault | logs | called | as | healthy channels blamed | of them by |\n|" + " --- |" * 6)
        for fault in chosen.faults:
            answers = all_said[mode, fault]
            kinds = Counter(kind for said in answers for kind in said.called)
            blamed = [words for said in answers for words in said.blamed]
            by = Counter(words.split()[1] for words in blamed)
            cells = (fault, len(answers), sum(bool(said.called) for said in answers), _counts(kinds), len(blamed))
            print(f"| {' | '.join(map(str, cells))} | {_counts(by)} |")
        logs = [said for (own, fault), answers in all_said.items() if own == mode for said in answers]
        print(f"\nLogs in which a healthy channel is blamed: {sum(bool(said.blamed) for said in logs)} of {len(logs)}.")
    print(f"\n{time.time() - before:.0f} s.")


def _counts(counter: Counter[str]) -> str:
    return ", ".join(f"{kind} {count}" for kind, count in counter.most_common()) or "–"


if __name__ == "__main__":
    main()
