"""Hidden effects that a diagnosis has no name for."""

from __future__ import annotations

from .registry import NODE, Catalogue, entry
from .robot import Robot

BEYOND: Catalogue = {}


@entry(BEYOND, NODE, beyond=True)
def heat_bursts(robot: Robot, node: int, size: float) -> None:
    """Bursts of 6 W, each 1 to 3 min, at random times."""
    robot.bursts[node] += 6.0 * size


@entry(BEYOND, NODE, beyond=True)
def sensor_step(robot: Robot, node: int, size: float) -> None:
    """The reading jumps up by 3 K at a random time of each run; the next run starts without it."""
    robot.step[node] += 3.0 * size


@entry(BEYOND, NODE, beyond=True)
def splash(robot: Robot, node: int, size: float) -> None:
    """400 J are taken away within a second, at random times."""
    robot.splash[node] += 400.0 * size
