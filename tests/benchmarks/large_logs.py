"""Large and slow logs: time and memory of `lptn check`, or of `lptn fit`.

    python -m tests.benchmarks.large_logs --folder BIG --versions old=OLD/bin/lptn new=NEW/bin/lptn

makes the logs in a folder (6 GB; they are taken as they are where they stand already), asks each version in a process
of its own, and prints CPU seconds, the most memory that was resident, and the last line where it refused.
`--rows 500000` makes the long ones shorter; `--ask fit` fits the model to the log in place of looking at it.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq

from lptn.robots.presets import presets

_CHUNK = 200_000  # rows that are made at once
_WALL = """
[model]
ambient = "temperature.ambient"

[nodes.wall]
capacity = { value = 2, unit = "MJ/K" }

[[links]]
between = ["wall", "ambient"]
resistance = 0.02

[[effects]]
kind = "constant_heat"
at = "wall"
power = 300
"""


def joints() -> list[str]:
    """Of the quadruped."""
    return [f"{leg}_{joint}" for leg in ("FR", "FL", "RR", "RL") for joint in ("hip", "thigh", "calf")]


def chunks(rows: int, rate: float, columns: int) -> Iterator[pa.Table]:
    """A quadruped that stands and walks for ten minutes each, in degC, N·m and rad/s, in tables of some rows each.

    Args:
        rows: in all.
        rate: of them a second.
        columns: in all; what the robot does not fill is noise that nobody asks for.
    """
    rng = np.random.default_rng(1)
    for start in range(0, rows, _CHUNK):
        time = np.arange(start, min(start + _CHUNK, rows)) / rate
        walks = (time // 600) % 2
        table = {"time": time, "temperature.ambient": 22 + rng.normal(0, 0.05, time.size), "speed.base": 0.8 * walks}
        table["power.pc"] = 30 + rng.normal(0, 1, time.size)
        table["temperature.pc"] = 45 + rng.normal(0, 0.2, time.size)
        for number, joint in enumerate(joints()):
            load = (4 + number) * (0.5 + walks)
            table[f"powered.{joint}"] = np.ones(time.size)
            table[f"torque.{joint}"] = load + rng.normal(0, 0.5, time.size)
            table[f"velocity.{joint}"] = walks * np.sin(9 * time) + rng.normal(0, 0.02, time.size)
            warm = (5 + number) * (1 - np.exp(-time / 1800)) + 2 * np.sin(time * np.pi / 600)
            table[f"temperature.{joint}"] = 24 + warm + rng.normal(0, 0.05, time.size)
        for number in range(columns - len(table)):
            table[f"unused{number}"] = rng.normal(0, 1, time.size)
        yield pa.table({name: np.round(values, 4) for name, values in table.items()})


def write(path: Path, tables: Iterator[pa.Table]) -> None:
    """Write tables of one log, CSV or Parquet by the path's ending, under another name until it is whole."""
    part = path.with_name(f"part_{path.name}")
    first = next(tables)
    parquet = path.suffix == ".parquet"
    with pq.ParquetWriter(part, first.schema) if parquet else pa_csv.CSVWriter(part, first.schema) as writer:
        writer.write_table(first)
        for table in tables:
            writer.write_table(table)
    part.rename(path)


def slow() -> Iterator[pa.Table]:
    """Forty days of a wall, one reading in half an hour."""
    rng, time = np.random.default_rng(2), np.arange(1920) * 1800.0
    outside = 8 + 6 * np.sin(2 * np.pi * time / 86400)
    wall = np.empty(time.size)
    wall[0] = 12.0
    for k in range(1, time.size):
        wall[k] = wall[k - 1] + 1800 / 2e6 * (300 - (wall[k - 1] - outside[k - 1]) / 0.02)
    readings = {"temperature.wall": wall + rng.normal(0, 0.05, time.size), "temperature.ambient": outside}
    yield pa.table({"time": time} | readings)


@dataclass(frozen=True)
class Log:
    """A log, how it is made, and the model that it is read for."""

    file: str
    make: Callable[[], Iterator[pa.Table]]
    model: str = "quadruped"


def logs(rows: int) -> dict[str, Log]:
    """By what they are."""
    long = f"{rows / 1e6:g} million rows × 60 columns"
    two_days = 48 * 3600 * 10
    return {
        "100,000 columns × 300 rows, CSV": Log("wide.csv", lambda: chunks(300, 1.0, 100_000)),
        "100,000 columns × 300 rows, Parquet": Log("wide.parquet", lambda: chunks(300, 1.0, 100_000)),
        f"{long}, Parquet": Log("long.parquet", lambda: chunks(rows, 100.0, 60)),
        f"{long}, CSV": Log("long.csv", lambda: chunks(rows, 100.0, 60)),
        "48 h at 10 Hz × 53 columns, Parquet": Log("two_days.parquet", lambda: chunks(two_days, 10.0, 53)),
        "40 days, a reading in half an hour, walls of 2 MJ/K, CSV": Log("slow.csv", slow, "wall"),
    }


def measure(command: Sequence[str]) -> tuple[float, float, str]:
    """CPU seconds and the most resident memory [MB] of a command, and its last line if it failed."""
    with tempfile.TemporaryFile("w+") as said:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=said)
        _, status, used = os.wait4(process.pid, 0)
        said.seek(0)
        lines = said.read().strip().splitlines()
    refused = lines[-1][:160] if os.waitstatus_to_exitcode(status) and lines else ""
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, refused


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--rows", type=int, default=5_000_000)
    parser.add_argument("--only", default="", help="logs whose file names hold this")
    parser.add_argument("--ask", choices=("check", "fit"), default="check")
    parser.add_argument("--versions", nargs="+", default=["lptn=lptn"])
    asked = parser.parse_args()
    folder: Path = asked.folder
    folder.mkdir(exist_ok=True)
    (folder / "quadruped.toml").write_text(presets()["quadruped"], encoding="utf-8")
    (folder / "wall.toml").write_text(_WALL, encoding="utf-8")
    print("| log | version | CPU [s] | memory [MB] | refused |\n| --- | --- | --- | --- | --- |")
    for name, log in logs(asked.rows).items():
        path = folder / log.file
        if asked.only not in log.file:
            continue
        if not path.exists():  # by a process of its own: what this one holds would count as its children's
            maker = get_context("fork").Process(target=write, args=(path, log.make()))
            maker.start()
            maker.join()
        for version in asked.versions:
            label, _, command = version.partition("=")
            words = [command, asked.ask, str(folder / f"{log.model}.toml"), str(path)]
            words += ["-o", str(folder / "fitted.toml")] if asked.ask == "fit" else []
            seconds, memory, refused = measure(words)
            print(f"| {name} | {label} | {seconds:.1f} | {memory:.0f} | {refused} |", flush=True)


if __name__ == "__main__":
    main()
