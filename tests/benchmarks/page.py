"""The benchmark page: runs the benchmarks that have named peers, in one run, and writes their table as Markdown.

Run it with ``python -m tests.benchmarks.page --quick`` (some ten minutes) or without ``--quick`` (an hour and more).
Each row is a program beside its peer on the same data, one after the other on the same machine. What is missing here
(do-mpc comes with the extra `benchmarks`, MuJoCo with `robots`) is said to be missing, not left out.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from statistics import fmean

from lptn.basics.files import write_whole

ROOT = Path(__file__).parents[2]
PAGE = Path(__file__).with_name("README.md")
PACKAGES = ("lptn", "casadi", "numpy", "scipy", "fmpy", "pythonfmu", "do-mpc", "mujoco")
_NOT = "not measured"
_CONTROLLERS = ("ours, 16 growing stages", "do-mpc 5")
_PYTHON_FMU = "the same model as a PythonFMU, through fmpy"

EXPLAINED = """\
Program and peer run one after the other on the same data, as single processes. The ratio says how many times better
ours is: their time over ours, or our lasting over theirs. A quick run is one sample of each: times below a second
scatter by some ten percent, more on a busy machine. Refitting each candidate is worked out from as many as `--most`
says, spread evenly, where it is given. Benchmarks without a peer are listed
[with all trials](../README.md)."""


@dataclass(frozen=True)
class Row:
    """One comparison.

    Args:
        what: is done by both.
        ours: as it is written in the table.
        peer: its name.
        theirs: likewise.
        ratio: peer over ours for costs, ours over peer for what is wanted; more is better for us.
    """

    what: str
    ours: str
    peer: str
    theirs: str
    ratio: float | None


@dataclass(frozen=True)
class Benchmark:
    """A program of this folder.

    Args:
        name: what it measures.
        words: behind the interpreter.
        read: rows from what it prints.
        quick: words to add for a quick run.
        needs: a module without which there is no peer.
        surroundings: environment variables to add.
    """

    name: str
    words: tuple[str, ...]
    read: Callable[[str], list[Row]]
    quick: tuple[str, ...] = ()
    needs: str | None = None
    surroundings: dict[str, str] = field(default_factory=dict)


def fits(said: str) -> list[Row]:
    """Rows of `fit_peers.py`."""
    what = "a fit of 56 parameters to 2 h of logs, from one start"
    line = r"^(.*?): ([\d.]+) s, \d+ times ours \(([\d.]+) s\)"
    _one(line, said)
    return [_seconds(what, ours, peer, theirs) for peer, theirs, ours in re.findall(line, said, re.M)]


def diagnosis(said: str) -> list[Row]:
    """The row of `diagnosis_time.py`."""
    ours = _one(r"diagnosis ([\d.]+) s", said)[1]
    count, theirs = _one(r"brute force, (\d+) candidates: ([\d.]+) s", said).groups()
    return [_seconds(f"one diagnosis among {count} candidates, an hour of logs", ours, "refitting each", theirs)]


def fmus(said: str) -> list[Row]:
    """Rows of `fmu_cost.py`."""
    values = dict(re.findall(r"^(.*?\]) {2,}([\d.e+-]+|not measured)$", said, re.M))
    rows = []
    ways = {"called from C": "ours in C [us]", "through fmpy": "ours through fmpy, FMI 2, arrays made once [us]"}
    peer = values["PythonFMU through fmpy [us]"]
    for what, name in ways.items():
        mine = float(values[name])
        ratio = None if peer == _NOT else float(peer) / mine
        theirs = peer if ratio is None else f"{float(peer):.3g} µs"
        rows.append(Row(f"a step of a quadruped's FMU, {what}", f"{mine:.3g} µs", _PYTHON_FMU, theirs, ratio))
    return rows


def trade(said: str) -> list[Row]:
    """Rows of `trade_study.py`."""
    build, solve = _one(r"built (\d+) ms, solved (\d+) ms", said).groups()
    ours = (int(build) + int(solve)) / 1e3
    peers = re.findall(r"^(200 × 200 grid, .*?): ([\d.]+) s", said, re.M)
    return [_seconds("best heat sink of a motor, with building the program", f"{ours:.3g}", *peer) for peer in peers]


def controller(said: str) -> list[Row]:
    """Rows of `torque_mpc.py peers`: one for each start."""
    rows = []
    for start, block in re.findall(r"^start (\d+) degC, (.*?)(?=^start |\Z)", said, re.M | re.S):
        ours, peer = (_one(rf"^{name} +\S+ +\S+ +\d+ +([\d.]+) +([\d.]+)$", block) for name in _CONTROLLERS)
        for group, which in enumerate(("median", "worst"), start=1):
            what = f"a step of thermal MPC, 13 nodes, from {start} °C, {which}"
            ratio = float(peer[group]) / float(ours[group])
            rows.append(Row(what, _ms(ours[group]), "do-mpc 5", _ms(peer[group]), ratio))
    return rows


def sharing(said: str) -> list[Row]:
    """Rows of `load_sharing.py`: the time that true robots stand until their first joint is hot."""
    rows = []
    for posture, block in re.findall(r"^(\w[^:\n]*): pitch(.*?)(?=^\w[^:\n]*: pitch|\Z)", said, re.M | re.S):
        matches = re.findall(r"^  (\w+) +model.*?truth ([\d. ]+) s", block, re.M)
        means = {how: fmean(float(time) for time in times.split()) for how, times in matches}
        ours, equal = means["share"], means["equal"]
        what = f"standing until a joint is at its limit, {posture}; longer is better"
        rows.append(Row(what, f"{ours:.0f} s", "equal sharing", f"{equal:.0f} s", ours / equal))
    return rows


# The short ones first: a run that is stopped has them.
BENCHMARKS = (
    Benchmark("FMU", ("tests/benchmarks/fmu_cost.py",), fmus, surroundings={"PYTHONPATH": "examples/mujoco_a1"}),
    Benchmark("Diagnosis", ("tests/benchmarks/diagnosis_time.py",), diagnosis, ("--most", "8")),
    Benchmark("Trade study", ("-m", "tests.benchmarks.trade_study"), trade),
    Benchmark("Thermal MPC", ("-m", "tests.benchmarks.torque_mpc", "peers"), controller, ("--steps", "24"), "do_mpc"),
    Benchmark("Load sharing", ("-m", "tests.benchmarks.load_sharing"), sharing),
    Benchmark("Fits", ("-m", "tests.benchmarks.fit_peers"), fits),
)
LATER = f"{_NOT} in this run, which was stopped before"


def measure(benchmark: Benchmark, quick: bool) -> tuple[list[Row], str]:
    """Run one benchmark.

    Returns:
        Its rows, and what it printed, or why there is none.

    Raises:
        RuntimeError: it failed, or printed what its reader doesn't know.
    """
    if benchmark.needs and find_spec(benchmark.needs) is None:
        return [], f"{_NOT}: {benchmark.needs} is not installed"
    words = typed(benchmark, quick, sys.executable)
    surroundings = os.environ | {"OMP_NUM_THREADS": "1"} | benchmark.surroundings
    done = subprocess.run(words, cwd=ROOT, env=surroundings, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{benchmark.name}: {done.stderr.strip() or done.stdout.strip()}")
    return benchmark.read(done.stdout), done.stdout


def typed(benchmark: Benchmark, quick: bool, python: str = "python") -> list[str]:
    """The words that run a benchmark."""
    return [python, *benchmark.words, *(benchmark.quick if quick else ())]


def page(results: list[tuple[Benchmark, list[Row], str]], quick: bool, seconds: float, load: float = 0.0) -> str:
    """The page: how it was made, the table, and what each benchmark printed."""
    command = f"python -m tests.benchmarks.page{' --quick' if quick else ''}"
    lines = ["# Benchmarks beside named peers", "", f"Made by `{command}` in {seconds / 60:.0f} min on {_today()}."]
    lines.append(f"Machine: {machine()}; {load:.1f} processes ran or waited on it when this began.")
    lines += [f"Versions: {versions()}.", ""]
    lines += [EXPLAINED, ""]
    lines += ["| what | ours | peer | theirs | ratio |", "| --- | --- | --- | --- | --- |"]
    for benchmark, rows, said in results:
        lines += [f"| {row.what} | {row.ours} | {row.peer} | {row.theirs} | {_ratio(row.ratio)} |" for row in rows]
        if not rows:
            lines.append(f"| {benchmark.name} | – | – | {said} | – |")
    for benchmark, rows, said in results:
        if rows:
            words = " ".join(typed(benchmark, quick))
            lines += ["", f"## {benchmark.name}", "", f"`{words}`", "", "```text", said.strip(), "```"]
    return "\n".join(lines) + "\n"


def machine() -> str:
    """Processor, cores that this process may use, system, Python."""
    name = platform.machine()
    about = Path("/proc/cpuinfo")
    if about.is_file():
        match = re.search(r"^model name\s*: (.*)$", about.read_text(), re.M)
        name = match[1] if match else name
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{name}, {cores} core{'s' * int(cores != 1)}, {platform.system()}, Python {platform.python_version()}"


def versions() -> str:
    """The packages that take part, as they are installed."""
    entries = []
    for name in PACKAGES:
        try:
            entries.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            entries.append(f"{name} missing")
    return ", ".join(entries)


def main() -> None:
    """Run all, print the table, write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer candidates and steps")
    parser.add_argument("--only", nargs="+", choices=[entry.name for entry in BENCHMARKS], help="write no page")
    parser.add_argument("-o", "--output", type=Path, default=PAGE)
    chosen = parser.parse_args()
    began, load = time.monotonic(), os.getloadavg()[0]
    wanted = [entry for entry in BENCHMARKS if not chosen.only or entry.name in chosen.only]
    results: list[tuple[Benchmark, list[Row], str]] = []
    for number, benchmark in enumerate(wanted, start=1):
        rows, said = measure(benchmark, chosen.quick)
        results.append((benchmark, rows, said))
        seconds = time.monotonic() - began
        print(f"{seconds:6.0f} s  {benchmark.name}: {len(rows)} rows", flush=True)
        if not chosen.only:
            # After each: an hour's work isn't lost with the last of it.
            rest: list[tuple[Benchmark, list[Row], str]] = [(entry, [], LATER) for entry in wanted[number:]]
            write_whole(chosen.output, page([*results, *rest], chosen.quick, seconds, load))
    if chosen.only:
        print(page(results, chosen.quick, time.monotonic() - began, load))


def _one(pattern: str, said: str) -> re.Match[str]:
    match = re.search(pattern, said, re.M)
    if match is None:
        raise RuntimeError(f"nothing like {pattern!r} was printed:\n{said}")
    return match


def _seconds(what: str, ours: str, peer: str, theirs: str) -> Row:
    return Row(what, f"{float(ours):g} s", peer, f"{float(theirs):g} s", float(theirs) / float(ours))


def _ms(said: str) -> str:
    value = float(said)
    return f"{value:.0f} ms" if value >= 100 else f"{value:.3g} ms"


def _ratio(value: float | None) -> str:
    return "–" if value is None else f"{value:.2g}" if value < 10 else f"{value:.0f}"


def _today() -> str:
    return datetime.now(UTC).strftime("%d %B %Y")


if __name__ == "__main__":
    main()
