"""CPU time and memory of a fit and of a diagnosis against nodes and hours, with growth exponents.

Run it with ``python -m tests.benchmarks.scaling``; `--nodes` and `--hours` choose the sizes. Two sweeps: the nodes at
one hour, the hours at `--at-nodes`. A robot is a chain of joints, each beside the next and in the air, on
which heat comes and goes; its logs are made with NumPy and SciPy alone, at 1 s, with 0.05 K of noise. One joint loses
more to the air while a fan blows, of which the fitted model knows nothing: that is what the diagnosis looks for.

Each size has a process of its own; its CPU time and its largest memory count from where the log is read. An exponent
is the slope between the two largest sizes on logarithmic axes.
"""

from __future__ import annotations

import argparse
import json
import math
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.linalg import expm

from lptn.basics.arrays import FloatArray
from lptn.study import Study

CAPACITY, TO_AIR, BETWEEN, AIR = 80.0, 8.0, 6.0, 20.0  # J/K, K/W, K/W, degC
HEAT, SEGMENT = 6.0, 120  # W at most; s between two changes of load
FANNED = 1.6  # times the conductance to the air, of the last joint, while the fan blows
WHAT = ("fit", "diagnosis")


def write_robot(
    folder: Path, nodes: int, hours: float, seed: int = 0, scatter: float = 0.0, fanned: float = FANNED
) -> tuple[Path, Path]:
    """A model file and a log of a chain of joints; every node has parameters of its own.

    Args:
        folder: where to write them.
        nodes: joints of the chain.
        hours: of log.
        seed: of the loads, the noise and the robot's constants.
        scatter: standard deviation of the constants' logarithms, from joint to joint.
        fanned: times the conductance to the air, of the last joint, while the fan blows.
    """
    names = [f"j{k:03d}" for k in range(nodes)]
    text = ["[model]", 'name = "chain"', f"joints = {json.dumps(names)}", 'ambient = "temperature.ambient"', ""]
    text += ['[nodes."*"]', f'capacity = {{ value = {1.5 * CAPACITY}, unit = "J/K", share = "each" }}', ""]
    link = "[[links]]\nbetween = {}\nresistance = {{ value = {}, unit = 'K/W', share = 'each' }}\n"
    text += [link.format('["*", "ambient"]', 0.7 * TO_AIR)]
    text += [link.format(json.dumps([a, b]), 1.4 * BETWEEN) for a, b in pairwise(names)]
    text += ['[[effects]]\nkind = "heat_input"\nat = "*"\ngain = { value = 1, fixed = true }']
    model, log = folder / "chain.toml", folder / "log.parquet"
    model.write_text("\n".join(text))
    rng, count = np.random.default_rng(seed), round(3600 * hours)
    blocks = math.ceil(count / SEGMENT)
    heats = np.repeat(rng.uniform(0, HEAT, (nodes, blocks)) * (rng.random((nodes, blocks)) < 0.6), SEGMENT, axis=1)
    fan = np.repeat(rng.random(math.ceil(count / 600)) < 0.5, 600)[:count].astype(float)
    temperatures = _temperatures(heats[:, :count], fan, constants(nodes, seed, scatter), fanned)
    columns = {"time": np.arange(count, dtype=float)}
    noisy = temperatures + rng.normal(scale=0.05, size=temperatures.shape)
    columns |= {f"temperature.{name}": row for name, row in zip(names, noisy, strict=True)}
    columns |= {f"power.{name}": row for name, row in zip(names, heats[:, :count], strict=True)}
    columns |= {"temperature.ambient": np.full(count, AIR), "speed.base": fan}
    pd.DataFrame(columns).to_parquet(log)
    return model, log


class Constants(NamedTuple):
    """True capacities [J/K] and resistances [K/W] to the air, shape (nodes,), and between neighbours, (nodes − 1,)."""

    capacity: FloatArray
    to_air: FloatArray
    between: FloatArray


def constants(nodes: int, seed: int, scatter: float) -> Constants:
    """Those of one robot, scattered about the usual ones."""
    factors = np.exp(scatter * np.random.default_rng([seed, 1]).normal(size=(3, nodes)))
    return Constants(CAPACITY * factors[0], TO_AIR * factors[1], BETWEEN * factors[2, : nodes - 1])


def _temperatures(heats: FloatArray, fan: FloatArray, true: Constants, fanned: float) -> FloatArray:
    """Means over each second [degC], shape (nodes, n): exact steps of both linear networks, with fan and without."""
    nodes, count = heats.shape
    steps = []
    for factor in (1.0, fanned):
        loss = 1 / true.to_air
        loss[-1] *= factor
        chain = np.diag(1 / true.between, 1)
        chain = chain + chain.T
        a = (chain - np.diag(chain.sum(axis=1) + loss)) / true.capacity[:, None]
        g = expm(a)
        steps.append((g, np.linalg.solve(a, (g - np.eye(nodes)) / true.capacity)))
    above, before, means = np.zeros(nodes), np.zeros(nodes), np.empty_like(heats)
    for k in range(count):
        g, h = steps[int(fan[k])]
        before, above = above, g @ above + h @ heats[:, k]
        means[:, k] = AIR + 0.5 * (before + above)
    return means


def _work(what: str, nodes: int, hours: float) -> None:
    """One measurement, in this process; prints it as JSON."""
    with tempfile.TemporaryDirectory() as name:
        study = Study(*write_robot(Path(name), nodes, hours))
        empty = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        began = time.process_time()
        if what == "fit":
            answer = f"{study.fit().rmse:.4f} K"
        else:
            diagnosis = study.diagnose()
            answer = " at ".join(diagnosis.best.key) if diagnosis.best else diagnosis.verdict
        spent = time.process_time() - began
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(json.dumps({"cpu": spent, "memory": (largest - empty) / 1024, "answer": answer}))


def measured(what: str, nodes: int, hours: float) -> dict[str, Any]:
    """The same in a process of its own: CPU time [s], memory beyond that with the log read [MB], what came out."""
    words = [sys.executable, "-m", "tests.benchmarks.scaling", "--work", what, str(nodes), str(hours)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def exponent(sizes: Sequence[float], costs: Sequence[float]) -> float:
    """Slope between the two largest sizes, on logarithmic axes."""
    return math.log(costs[-1] / costs[-2]) / math.log(sizes[-1] / sizes[-2])


def sweep(what: str, cases: Sequence[tuple[int, float]], axis: int) -> None:
    """Print a row for each size, then the exponents."""
    rows = []
    for nodes, hours in cases:
        rows.append(measured(what, nodes, hours))
        last = rows[-1]
        print(
            f"| {what} | {nodes} | {hours:g} | {last['cpu']:.1f} | {last['memory']:.0f} | {last['answer']} |",
            flush=True,
        )
    if len(rows) > 1:
        sizes = [case[axis] for case in cases]
        powers = [exponent(sizes, [max(row[key], 1e-3) for row in rows]) for key in ("cpu", "memory")]
        name = ("nodes", "hours")[axis]
        print(f"| {what} | | | ~ {name}^{powers[0]:.1f} | ~ {name}^{powers[1]:.1f} | |", flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--nodes", type=int, nargs="*", default=[2, 13, 26, 52])
    parser.add_argument("--hours", type=float, nargs="*", default=[1.0, 4.0, 16.0])
    parser.add_argument("--at-nodes", type=int, default=13, help="nodes of the sweep over hours")
    parser.add_argument("--what", nargs="*", choices=WHAT, default=list(WHAT))
    parser.add_argument("--work", nargs=3, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.work:
        _work(chosen.work[0], int(chosen.work[1]), float(chosen.work[2]))
        return
    print("| | nodes | hours | CPU [s] | memory [MB] | answer |\n| --- | --- | --- | --- | --- | --- |")
    for what in chosen.what:
        sweep(what, [(nodes, 1.0) for nodes in chosen.nodes], 0)
        sweep(what, [(chosen.at_nodes, hours) for hours in chosen.hours], 1)


if __name__ == "__main__":
    main()
