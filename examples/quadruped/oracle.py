"""How well the held-out runs can be predicted at all: the robot's own equations, without the errors of each run.

At the levels `default` and `strong` the air is a little warmer or colder than logged, cools a little better or worse,
and the battery heats more or less, in each run anew; no log shows it. The oracle has the robot's own physics and
parameters, its true state at the beginning of a run, and what it did; only these three it lacks. A model that
predicts from logs alone can't be better, but by luck.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lptn.virtual import PLANS, Record, quadruped, simulate_runs
from lptn.virtual.heat import Exponential, Network, forcing
from lptn.virtual.robot import PC, Level
from lptn.virtual.surroundings import ambient, event_heat

READING = 1.0**2 / 12 + 0.15**2
"""Mean square error of a reading in steps of 1 K with noise of 0.15 K [K²]: nobody's prediction is nearer to it."""


def floor(seed: int, level: Level) -> Mapping[str, tuple[float, float]]:
    """Largest error [K] and mean square error [K²] of the oracle in each held-out run, against readings.

    Args:
        seed: of the robot.
        level: hidden errors of each run: none, default or strong.
    """
    found = {}
    for record in simulate_runs(quadruped(seed=seed), PLANS["tests"](seed), seed, level):
        error = oracle(record, seed) - record.sensed
        found[record.name] = float(np.abs(error).max()), float((error**2).mean()) + READING
    return found


def oracle(record: Record, seed: int) -> np.ndarray:
    """The temperatures at the sensors as they would be without the run's errors, shape (seconds + 1, sensors)."""
    run, robot = record.run, quadruped(seed=seed).in_run(record.name)
    air = ambient(robot, run.ambient, 0.0, run.swing, run.seconds, seed, record.name)
    network = Network(robot, float(air.true[0]))
    heat = np.zeros((run.seconds, len(robot.nodes))) + event_heat(robot, run.seconds, seed, record.name)
    heat[:, robot.nodes.index(PC)] += record.motion.pc
    acting = forcing(robot, record.motion.means(robot.wind_exponent), heat).shifted(air.shift)
    states = Exponential(network).solve(acting, record.states[0])
    return np.asarray(states[:, network.sensed])
