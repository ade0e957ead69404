"""Draw what happens at random times in a run: bursts of heat, splashes, a step of the sensor."""

from __future__ import annotations

import numpy as np

from .robot import Array, Robot
from .streams import stream

BURST_EVERY = 600  # s, on the average
SPLASH_EVERY = 700  # s, on the average


def event_heat(robot: Robot, seconds: int, seed: int, run: str) -> Array:
    """Return the heat (W) of bursts and splashes in each second of a run, of shape (seconds, nodes)."""
    heat = np.zeros((seconds, len(robot.nodes)))
    for i, node in enumerate(robot.nodes):
        rng = stream(seed, "bursts", run, node)
        for begin in rng.integers(60, max(61, seconds - 180), seconds // BURST_EVERY):
            heat[begin : begin + rng.integers(60, 181), i] = robot.bursts[i]
        rng = stream(seed, "splash", run, node)
        # Not in the first fifth: a node near the ambient has little to lose.
        when = rng.choice(np.arange(seconds // 5, seconds - 60), seconds // SPLASH_EVERY, replace=False)
        heat[when, i] -= robot.splash[i]
    return heat


def sensor_steps(robot: Robot, seconds: int, seed: int, run: str) -> Array:
    """Return what steps add to the readings (K) in each second of a run, of shape (seconds, nodes)."""
    when = np.array([stream(seed, "step", run, node).uniform(0.2, 0.8) * seconds for node in robot.nodes])
    return (np.arange(seconds)[:, None] >= when) * robot.step
