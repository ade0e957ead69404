"""How well the held-out runs can be predicted at all: the robot's own equations, without the errors of each run.

At the levels `default` and `strong` the air is a little warmer or colder than logged, cools a little better or worse,
and the battery heats more or less, in each run anew; no log shows it. The oracle has the robot's own physics and
parameters, its true state at the beginning of a run, and what it did; only these three it lacks. A model that
predicts from logs alone can't be better, but by luck.

`python examples/quadruped/oracle.py --seeds 501 502` prints it for each run, and what knowing one of the three would
leave.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from lptn.virtual import PLANS, Record, quadruped, simulate_runs
from lptn.virtual.heat import Balance, Exponential, forcing
from lptn.virtual.robot import PC, Level, Robot, draw_run_errors
from lptn.virtual.surroundings import ambient, event_heat

READING = 1.0**2 / 12 + 0.15**2
"""Mean square error of a reading in steps of 1 K with noise of 0.15 K [K²]: nobody's prediction is nearer to it."""
Errors = Literal["ambient", "air", "battery"]
"""What differs from run to run: the ambient sensor's error, the conductances to the air, the battery's heat."""
UNKNOWN: tuple[Errors, ...] = ("ambient", "air", "battery")


def floor(seed: int, level: Level, known: Sequence[Errors] = ()) -> Mapping[str, tuple[float, float]]:
    """Largest error [K] and mean square error [K²] of the oracle in each held-out run, against readings.

    Args:
        seed: of the robot.
        level: hidden errors of each run: none, default or strong.
        known: which of them the oracle is told.
    """
    return {name: scores[tuple(known)] for name, scores in floors(seed, level, (known,)).items()}


def floors(
    seed: int, level: Level, known: Sequence[Sequence[Errors]]
) -> dict[str, dict[tuple[Errors, ...], tuple[float, float]]]:
    """The same for several oracles at once: by run, then by what is known."""
    scores: dict[str, dict[tuple[Errors, ...], tuple[float, float]]] = {}
    for record in simulate_runs(quadruped(seed=seed), PLANS["tests"](seed), seed, level):
        scores[record.name] = {}
        for subset in known:
            error = oracle(record, seed, level, subset) - record.sensed
            scores[record.name][tuple(subset)] = float(np.abs(error).max()), float((error**2).mean()) + READING
    return scores


def oracle(record: Record, seed: int, level: Level = "none", known: Sequence[Errors] = ()) -> np.ndarray:
    """The temperatures at the sensors as they would be without the errors that are not known.

    Returns:
        degC, shape (seconds + 1, sensors).
    """
    run, (robot, offset) = record.run, _with_errors(record, seed, level, known)
    air = ambient(robot, run.ambient, offset, run.swing, run.seconds, seed, record.name)
    network = Balance(robot, float(air.true[0]))
    heat = np.zeros((run.seconds, len(robot.nodes))) + event_heat(robot, run.seconds, seed, record.name)
    heat[:, robot.nodes.index(PC)] += record.motion.pc
    acting = forcing(robot, record.motion.means(robot.wind_exponent), heat).shifted(air.shift)
    states = Exponential(network).solve(acting, record.states[0])
    return np.asarray(states[:, network.sensed])


def _with_errors(record: Record, seed: int, level: Level, errors: Sequence[Errors]) -> tuple[Robot, float]:
    """The robot with the errors of this run that are known, and the ambient's [K]."""
    robot = quadruped(seed=seed).in_run(record.name)
    true, offset = draw_run_errors(robot, level, seed, record.name)
    if "air" in errors:
        robot = replace(robot, to_air=true.to_air)
    if "battery" in errors:
        robot = replace(robot, constant=true.constant)
    return robot, offset if "ambient" in errors else 0.0


def main(arguments: Sequence[str] | None = None) -> None:
    """A line for each robot and run, then how often the source's numbers could have been met."""
    parser = argparse.ArgumentParser(description="How well the held-out runs can be predicted at all.")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--level", choices=("none", "default", "strong"), default="default")
    given = parser.parse_args(arguments)
    subsets: list[tuple[Errors, ...]] = [(), *((error,) for error in UNKNOWN), UNKNOWN]
    print(f"{'robot, run':24s}" + "".join(f"{'knows ' + ('+'.join(subset) or 'none'):>24s}" for subset in subsets))
    for seed in given.seeds:
        for name, scores in floors(seed, given.level, subsets).items():
            numbers = "".join(f"{f'{scores[subset][0]:.2f} K {scores[subset][1]:.2f} K²':>24s}" for subset in subsets)
            print(f"{f'{seed} {name}':24s}{numbers}", flush=True)


if __name__ == "__main__":
    main()
