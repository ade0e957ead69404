"""Identification at full scale: what is recovered, from where, how fast. Its peers: `fit_peers.py`.

Truth is the plain virtual quadruped (one mass a joint, parameters scattered over the legs, sensors in steps of 1 K),
whose code shares nothing with the model.

    python tests/benchmarks/identification.py parameters --seeds 11 12 13
    python tests/benchmarks/identification.py starts --seed 11
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import numpy as np

from lptn import Model, fit, load_model
from lptn.basics.places import edge
from lptn.identify.noise import balanced_sigma, estimate_noise
from lptn.identify.problem import Problem
from lptn.identify.solvers import minimise
from lptn.robots.presets import preset_text
from lptn.simulate.bound_run import BoundRun, bind
from lptn.virtual import quadruped, quadruped_logs, write_logs

Result = TypeVar("Result")
STARTS = 10
SPREAD = 5.0
TWO_HOURS = ("trot_medium", "hip_RF_LR_6Nm", "knee_LF_RR_10Nm", "abd_LF_RR_6Nm")


def load(seed: int, only: Sequence[str] | None = None, step: int = 1) -> tuple[Model, list[BoundRun]]:
    """The coupled model, its winding resistances as measured with an ohmmeter, and the protocol's runs."""
    logs = quadruped_logs(seed=seed, runs="protocol", physics="plain", quantisation=1.0)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "quadruped.toml"
        path.write_text(preset_text("quadruped", "coupled"))
        loaded = load_model(path)
        files = write_logs(folder, {name: logs[name] for name in only or logs})
        runs = [run if step == 1 else run.coarsen(step) for run in loaded.runs(files)]
    truth = quadruped(seed=seed, physics="plain")
    ohms = {
        f"copper_loss.resistance.{joint}": float(truth.resistance[row])
        for row, joint in enumerate(truth.nodes[: truth.joints])
    }
    model = Model(loaded.model.network.with_values(ohms))
    return model, [bind(model, run) for run in runs]


def true_values(seed: int) -> dict[str, float]:
    """The truth under the names that the model gives its parameters."""
    robot = quadruped(seed=seed, physics="plain")
    values = {f"capacity.{node}": float(robot.capacity[row]) for row, node in enumerate(robot.nodes)}
    values |= {f"resistance.{edge(node, 'ambient')}": 1 / robot.to_air[row] for row, node in enumerate(robot.nodes)}
    values |= {f"resistance.{edge(robot.nodes[i], robot.nodes[j])}": 1 / g for i, j, g in robot.links}
    values |= {f"drive_heat.power.{joint}": robot.drive[row] for row, joint in enumerate(robot.nodes[: robot.joints])}
    return values


def recovered(seed: int) -> None:
    """True parameters against estimates with their standard errors."""
    model, bound_runs = load(seed)
    done, seconds = _timed(lambda: fit(model, bound_runs))
    truth, estimates = true_values(seed), {parameter.name: parameter.value for parameter in done.model.parameters}
    off = {
        name: (estimates[name] - truth[name]) / error for name, error in done.standard_errors.items() if name in truth
    }
    missing = sorted(set(done.standard_errors) - set(truth))
    inside = np.mean([abs(value) <= 1.96 for value in off.values()])
    relative = np.median([abs(estimates[name] / truth[name] - 1) for name in off])
    hours = sum(len(bound) * bound.run.step for bound in bound_runs) / 3600
    print(
        f"robot {seed}: {len(done.standard_errors)} parameters, {hours:.1f} h at {bound_runs[0].run.step:g} s, "
        f"{seconds:.1f} s; "
        f"{inside:.0%} of {len(off)} true values inside 95 % intervals; median error {relative:.2%}"
    )
    for kind in ("capacity", "resistance", "drive_heat"):
        group = {name: value for name, value in off.items() if name.startswith(kind)}
        errors = [abs(estimates[name] / truth[name] - 1) for name in group]
        print(
            f"  {kind:11s} {np.mean([abs(v) <= 1.96 for v in group.values()]):5.0%} inside, "
            f"errors median {np.median(errors):.2%}, worst {max(errors):.2%}"
        )
    for name in sorted(off, key=lambda parameter: -abs(off[parameter]))[:3]:
        print(
            f"  farthest: {name} true {truth[name]:.4g}, found {estimates[name]:.4g} ± {done.standard_errors[name]:.2g}"
        )
    print(f"  without a true value: {', '.join(missing) or 'none'}")
    print(f"  said to be undetermined: {'; '.join(done.uncertainty.warnings) or 'none'}")


def random_starts(seed: int) -> None:
    """Random starts, on two hours in steps of 10 s."""
    model, bound_runs = load(seed, TWO_HOURS, step=10)
    sigma = balanced_sigma(bound_runs, estimate_noise(bound_runs, model.nodes))
    problem, rng = Problem(model, bound_runs, sigma), np.random.default_rng(seed)
    lower, upper = problem.bounds
    typical = model.values
    print(f"{len(problem.free)} parameters, {problem.size} unknowns, {problem.readings} readings")
    reference, first = _timed(lambda: fit(model, bound_runs))
    warm, again = _timed(lambda: fit(model, bound_runs))
    print(f"ours, from the logs alone: {first:.2f} s with compiling, {again:.2f} s without; cost {warm.cost:.4f}")
    costs, times = [], []
    for _ in range(STARTS):
        values = typical.copy()
        values[problem.free] *= SPREAD ** rng.uniform(-1, 1, len(problem.free))
        z = np.clip(problem.guess(values), lower, upper)
        optimum, seconds = _timed(partial(minimise, problem, z))
        costs.append(optimum.cost)
        times.append(seconds)
    same = sum(abs(cost - reference.cost) < 1e-3 * max(reference.cost, 1.0) for cost in costs)
    print(
        f"ours, {STARTS} random starts ×/÷ {SPREAD:g}: {same} reach the same optimum; "
        f"{np.median(times):.2f} s median, {max(times):.2f} s worst; costs {min(costs):.4f} to {max(costs):.4f}"
    )


def _timed(run: Callable[[], Result]) -> tuple[Result, float]:
    began = time.perf_counter()
    return run(), time.perf_counter() - began


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    tasks = parser.add_subparsers(dest="task", required=True)
    tasks.add_parser("parameters").add_argument("--seeds", type=int, nargs="+", default=[11])
    tasks.add_parser("starts").add_argument("--seed", type=int, default=11)
    given = parser.parse_args()
    if given.task == "parameters":
        for seed in given.seeds:
            recovered(seed)
    else:
        random_starts(given.seed)


if __name__ == "__main__":
    main()
