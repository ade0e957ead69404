"""A fleet: robots a minute and memory, on this machine's processes and on a Dask cluster of it.

    python -m tests.benchmarks.fleet --robots 1000
    python -m tests.benchmarks.fleet --robots 100 --nodes 13 --ways "2 processes" dask

Each robot is a chain of joints with constants of its own (log-normal, 20 %), and has an hour of 1 s logs, as Parquet
files, made with NumPy and SciPy alone (`scaling.write_robot`). Every way of working has a process of its own. Its time
is counted from when it begins to fit, the start of its workers included; its memory, of the largest of its processes
and of all together, is looked at four times a second. Last, the median of how far fitted capacities are off.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from statistics import median
from typing import Any

import psutil  # type: ignore[import-untyped]

from lptn.basics.arrays import FloatArray
from lptn.fleet import Fleet, Outcome, fit_each
from tests.benchmarks.scaling import constants, write_robot

SCATTER = 0.2  # of the logarithms of a robot's constants
LOOK = 0.25  # s between two looks at the memory


def write_fleet(folder: Path, robots: int, nodes: int) -> None:
    """One model file, and a log for each robot."""
    (folder / "logs").mkdir()
    for robot in range(robots):
        _, log = write_robot(folder, nodes, 1.0, robot, SCATTER, fanned=1.0)
        log.rename(folder / "logs" / f"{robot}.parquet")


def one_process(model: Path, logs: Path) -> Fleet:
    """In the process that asks."""
    return fit_each(model, sorted(logs.iterdir()))


def two_processes(model: Path, logs: Path) -> Fleet:
    """In two processes of our own."""
    return fit_each(model, sorted(logs.iterdir()), jobs=2)


def dask(model: Path, logs: Path) -> Fleet:
    """On a local Dask cluster of two workers with one thread each."""
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,  # type: ignore[no-untyped-call]
        Client(cluster) as client,  # type: ignore[no-untyped-call]
    ):
        return fit_each(model, sorted(logs.iterdir()), executor=client.get_executor())


WAYS: dict[str, Callable[[Path, Path], Fleet]] = {"1 process": one_process, "2 processes": two_processes, "dask": dask}


def work(way: str, folder: Path) -> None:
    """One way, in this process; prints a line of JSON."""
    began = time.perf_counter()
    fleet = WAYS[way](folder / "chain.toml", folder / "logs")
    seconds = time.perf_counter() - began
    errors = [
        abs(values["value"] / true - 1)
        for outcome in fleet.outcomes
        for true, values in zip(_true_capacities(outcome), _capacities(outcome), strict=True)
    ]
    print(json.dumps({"seconds": seconds, "robots": len(fleet.outcomes), "error": median(errors)}))


def _capacities(outcome: Outcome) -> list[Any]:
    return [values for name, values in outcome.parameters.items() if name.startswith("capacity")]


def _true_capacities(outcome: Outcome) -> FloatArray:
    return constants(len(_capacities(outcome)), int(outcome.robot), SCATTER).capacity


def measured(way: str, folder: Path) -> str:
    """A row of the table: a way in a process of its own, whose memory is looked at while it works."""
    words = [sys.executable, "-m", "tests.benchmarks.fleet", "--work", way, str(folder)]
    largest = together = 0.0
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, text=True, env=os.environ | {"OMP_NUM_THREADS": "1"}
    ) as process:
        while process.poll() is None:
            sizes = _sizes(process.pid)
            largest, together = max([largest, *sizes]), max(together, sum(sizes))
            time.sleep(LOOK)
        said = process.communicate()[0]
    done = json.loads(said.splitlines()[-1])
    rate = 60 * done["robots"] / done["seconds"]
    return (
        f"| {way} | {done['robots']} | {done['seconds']:.0f} | {rate:.0f} | {largest:.0f} | {together:.0f} "
        f"| {100 * done['error']:.1f} |"
    )


def _sizes(pid: int) -> list[float]:
    """Resident memory of a process and of its descendants [MB]; those that have ended are left out."""
    sizes = []
    with suppress(psutil.NoSuchProcess):
        for process in (psutil.Process(pid), *psutil.Process(pid).children(recursive=True)):
            with suppress(psutil.NoSuchProcess):
                sizes.append(process.memory_info().rss / 2**20)
    return sizes


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=100)
    parser.add_argument("--nodes", type=int, default=3)
    parser.add_argument("--ways", nargs="*", choices=list(WAYS), default=list(WAYS))
    parser.add_argument("--work", nargs=2, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.work:
        work(chosen.work[0], Path(chosen.work[1]))
        return
    print("| way | robots | seconds | robots a minute | largest process, MB | all, MB | capacity off by, % |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_fleet(folder, chosen.robots, chosen.nodes)
        for method in chosen.ways:
            print(measured(method, folder), flush=True)


if __name__ == "__main__":
    main()
