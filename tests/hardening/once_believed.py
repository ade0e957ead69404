"""Spoilt logs of a virtual leg of which an early version said something false with confidence: what versions say now.

    python -m tests.hardening.once_believed --versions old=OLD/bin/lptn new=NEW/bin/lptn

Nothing is hidden in the leg, and the model is exact: only what is done to the log is wrong. Printed for each case: what
was done, what was asked, and what each version said of it; `--cases 4 5` asks some of them.
"""

from __future__ import annotations

import argparse
import re
import signal
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from lptn.robots.presets import presets
from lptn.virtual import Bout, Job, leg_logs
from tests.benchmarks.verdict_answers import command_of

SEED, LIMIT = 7, 600  # s of CPU for an answer: those of the clock say how busy the machine is
CALF, THIGH = "temperature.FR_calf", "temperature.FR_thigh"
IMPROVE = ("improve", "leg.toml", "fit1.parquet", "fit2.parquet", "--holdout", "holdout.parquet", "-o", "better.toml")
FORECAST = ("forecast", "model.toml", "now.parquet", "--limit", "FR_calf=LIMIT")
Logs = dict[str, pd.DataFrame]


@dataclass(frozen=True)
class Case:
    """One case: what is done to the logs, the questions, and what of the answers is shown."""

    about: str
    spoil: Callable[[Logs], None]
    questions: tuple[tuple[str, ...], ...]
    shown: str = "."


@cache
def _logs() -> Logs:
    logs = {name: log.reset_index(drop=True) for name, log in leg_logs(seed=SEED, quantisation=0.1, rate=1.0).items()}
    now = leg_logs(seed=SEED, quantisation=0.1, rate=1.0, runs=_FORECAST_RUNS)["now"]
    return logs | {"now": now.iloc[:1500].reset_index(drop=True)}


_AHEAD = 720  # s: the limit is what the joint has then
_FORECAST_RUNS = {"now": Job((Bout("stand", 900), Bout("trot", 2400, 1.0, 4.0)), 22.0, cutout=None)}


@cache
def _limit() -> tuple[float, float]:
    """The limit that is asked for [degC], and the true time until then [min]."""
    path = leg_logs(seed=SEED, noise=0.0, rate=1.0, runs=_FORECAST_RUNS)["now"][CALF].to_numpy()[1500:]
    limit = round(float(path[_AHEAD]), 1)
    return limit, float(np.flatnonzero(path >= limit)[0]) / 60


def _stands(log: str, name: str, start: int, stop: int, value: float | None = None) -> Callable[[Logs], None]:
    def spoil(logs: Logs) -> None:
        logs[log].loc[start:stop, name] = logs[log][name].iloc[start] if value is None else value

    return spoil


def _clamped(logs: Logs) -> None:
    for log in logs.values():
        log[CALF] = log[CALF].clip(upper=55.0)


@cache
def _samples() -> Logs:
    """Ten rows a second, in which the torque swings with the gait."""
    return leg_logs(seed=SEED, quantisation=0.1, rate=10.0)


def _averaged(logs: Logs) -> None:
    """Torque as its mean over 20 s, as a logger keeps it: its square is too small where it swings."""
    for name in ("fit1", "fit2", "holdout"):
        log, samples = logs[name], _samples()[name]
        mean = samples["torque.FR_calf"].rolling(200, min_periods=1).mean()
        log["torque.FR_calf"] = np.interp(log["time"], samples["time"], mean)


def _huge(logs: Logs) -> None:
    logs["fit1"].loc[700, "torque.FR_calf"] = 18_000.0


def _kelvin(logs: Logs) -> None:
    for log in logs.values():
        del log["temperature.ambient"]
        for name in [name for name in map(str, log) if name.startswith("temperature.")]:
            log[name] += 273.15


def _warm(logs: Logs) -> None:
    """A robot that comes from work: the coldest reading of the whole log is above 66 degC."""
    now = logs["now"]
    for name, start in zip(
        [name for name in map(str, now) if name.startswith("temperature.FR")], (66.0, 70.0, 74.0), strict=True
    ):
        now[name] = start + 0.5 * (now[name] - now[name].iloc[0])


def _nothing(_logs: Logs) -> None:
    pass


CASES = (
    Case(
        "a sensor bit-identical for 1800 s",
        _stands("fit1", CALF, 300, 2100),
        (("check", "leg.toml", "fit1.parquet"), IMPROVE),
        "FR_calf|explain|adds|adequate|verdict|found",
    ),
    Case(
        "a sensor at exactly 0.0 °C for 1500 s",
        _stands("fit1", CALF, 300, 1800, 0.0),
        (("check", "leg.toml", "fit1.parquet"), IMPROVE),
        "FR_calf|explain|adds|adequate|verdict|found",
    ),
    Case(
        "firmware clamps a sensor at 55.0 °C",
        _clamped,
        (("check", "leg.toml", "fit1.parquet"), IMPROVE),
        "FR_calf|explain|adds|adequate|verdict|hold|found",
    ),
    Case("forecast with a sensor stuck for 4 min", _stands("now", CALF, 1260, 1500), (FORECAST,), "FR_calf"),
    Case("forecast with a sensor dead for 4 min", _stands("now", CALF, 1260, 1500, 0.0), (FORECAST,), "FR_calf"),
    Case(
        "monitor without --healthy, a sensor at 0 °C",
        _stands("now", CALF, 900, 1500, 0.0),
        (("monitor", "model.toml", "now.parquet"),),
        "FR_|alarm",
    ),
    Case(
        "monitor, a torque column that dies",
        _stands("now", "torque.FR_calf", 900, 1500, 0.0),
        (("monitor", "model.toml", "now.parquet"),),
        "FR_|alarm",
    ),
    Case(
        "torque averaged before it was logged",
        _averaged,
        (("check", "leg.toml", "fit1.parquet"), IMPROVE),
        "torque.FR_calf|averag|FR_calf|explain|adds|adequate",
    ),
    Case(
        "18,000 N·m on one joint",
        _huge,
        (("fit", "leg.toml", "fit1.parquet", "fit2.parquet", "-o", "f.toml"), ("compare", "leg.toml", "fit1.parquet")),
        "torque|N.m|W|RMSE",
    ),
    Case(
        "fitted and held-out runs the same data in two formats",
        _nothing,
        (("fit", "leg.toml", "fit1.parquet", "--holdout", "copy.csv", "-o", "f.toml"),),
        "same|RMSE|held",
    ),
    Case(
        "kelvin, no ambient column",
        _kelvin,
        (("fit", "start.toml", "fit1.parquet", "fit2.parquet", "-o", "f.toml"),),
        "kelvin|degK|\\bK\\b|RMSE",
    ),
    Case(
        "a file cut in the middle of its last number",
        _nothing,
        (("check", "leg.toml", "cut.csv"),),
        "cut|last|line|row|FR_calf",
    ),
    Case(
        "a robot that starts warm, 66 to 74 °C", _warm, (("check", "leg.toml", "now.parquet"),), "degF|Fahrenheit|FR_"
    ),
)


def made(case: Case, folder: Path) -> None:
    """The files of a case."""
    logs = {name: log.copy() for name, log in _logs().items()}
    case.spoil(logs)
    (folder / "leg.toml").write_text(presets()["leg"], encoding="utf-8")
    start = presets()["leg"].replace('ambient = "temperature.ambient"', 'ambient = "start"')
    (folder / "start.toml").write_text(start, encoding="utf-8")
    for name, log in logs.items():
        log.to_parquet(folder / f"{name}.parquet")
    logs["fit1"].to_csv(folder / "copy.csv", index=False)
    text = logs["fit1"].to_csv(index=False).rstrip("\n")
    (folder / "cut.csv").write_text(text[: -len(text.rpartition(",")[2]) + 1], encoding="utf-8")


def said(command: Path, words: list[str], folder: Path, shown: str) -> str:
    """What a version says of it, its lines that matter, and the exit status."""
    limited = ["prlimit", f"--cpu={LIMIT}", str(command), *words]
    done = subprocess.run(limited, cwd=folder, check=False, capture_output=True, text=True)
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return f"no answer in {LIMIT} s"
    lines = [" ".join(line.split()) for line in (done.stdout + "\n" + done.stderr).splitlines()]
    kept = [line for line in lines if re.search(shown, line, re.IGNORECASE)] or [line for line in lines if line][-2:]
    return f"exit {done.returncode}: " + " / ".join(kept)


def main() -> None:
    """Print the answers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--versions", type=command_of, nargs="+", required=True, metavar="NAME=COMMAND")
    parser.add_argument("--cases", type=int, nargs="+", default=list(range(1, len(CASES) + 1)))
    parser.add_argument("--width", type=int, default=400, help="characters of each answer that are shown")
    chosen = parser.parse_args()
    versions = {name: command.absolute() for name, command in chosen.versions}
    with tempfile.TemporaryDirectory() as name:
        healthy = Path(name)
        made(Case("", _nothing, ()), healthy)
        words = [str(next(iter(versions.values()))), "fit", "leg.toml", "fit1.parquet", "fit2.parquet"]
        subprocess.run([*words, "-o", "model.toml"], cwd=healthy, check=True, capture_output=True)
        model = (healthy / "model.toml").read_text(encoding="utf-8")
    for number in chosen.cases:
        case = CASES[number - 1]
        truth = f" (in truth {_limit()[1]:.1f} min)" if "forecast" in case.about else ""
        print(f"\n{number}. {case.about}{truth}", flush=True)
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            made(case, folder)
            (folder / "model.toml").write_text(model, encoding="utf-8")
            for question in case.questions:
                words = [word.replace("LIMIT", f"{_limit()[0]:g}") for word in question]
                for version, command in versions.items():
                    answer = said(command, words, folder, case.shown)
                    print(f"   {words[0]}, {version}: {answer[: chosen.width]}", flush=True)


if __name__ == "__main__":
    main()
