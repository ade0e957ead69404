"""What surrounds a robot in a run: the ambient as it changes, the sun, a fan, bursts of heat, splashes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .robot import Array, Robot, stream
from .sensors import lagged

STAYS, DOOR = (600, 1500), 60  # s in one place, and on the way to the next
SUN = 700.0  # W/m², without clouds
CLOUDS, FAN_CHANGES = 300, 420  # s between the knots of the clouds, and of the fan's speed
BURST_EVERY, SPLASH_EVERY = 600, 700  # s, on the average


@dataclass(frozen=True)
class Ambient:
    """The air of one run, degC, at 0, 1, … s, of shape (seconds + 1,) each: as logged, and as it really was.

    shift: K of the true one above its first value; ``None`` for an ambient that stays as it is.
    """

    logged: Array
    true: Array
    shift: Array | None


def ambient(robot: Robot, first: float, error: float, swing: float, seconds: int, seed: int, run: str) -> Ambient:
    """Draw the ambient of a run.

    Args:
        robot: its errors of the ambient.
        first: logged one at the beginning, degC.
        error: what the true one has above it in this run beside the robot's own offset, K.
        swing: by how much it is warmer or colder out of doors, K; 0 for what the robot's lag asks for.
        seconds: how long the run lasts.
        seed, run: what the draw belongs to.
    """
    swing = swing or robot.ambient_swing
    logged = np.full(seconds + 1, first)
    above = error + robot.ambient_offset
    if swing == 0:
        return Ambient(logged, logged + above, None)
    rng = stream(seed, "ambient", run)
    # 0 indoors and 1 or -1 out of doors, where it is warmer or colder all day.
    outside, when = rng.choice([-1.0, 1.0]), np.cumsum(rng.uniform(*STAYS, seconds // min(STAYS) + 2))
    place = outside * (np.arange(len(when) + 1) % 2)
    times, places = np.ravel([when, when + DOOR], "F"), np.ravel([place[:-1], place[1:]], "F")
    logged = logged + swing * np.interp(np.arange(seconds + 1), times, places)
    follows = lagged(logged[:, None], np.array([robot.ambient_lag]))[:, 0]
    return Ambient(logged, follows + above, follows - first)


def sun(seconds: int, seed: int, run: str) -> Array:
    """Return the mean irradiance of each second, W/m², of shape (seconds, 1)."""
    knots = stream(seed, "sun", run).uniform(-1, 1, seconds // CLOUDS + 2)
    clouds = np.interp(np.arange(seconds), CLOUDS * np.arange(len(knots)), knots)[:, None]
    light: Array = SUN * (0.5 + clouds).clip(0, 1)
    return light


def fan(seconds: int, seed: int, run: str) -> Array:
    """Return a fan's share of its full speed in each second, of shape (seconds, 1): off, or on at some speed."""
    speed = stream(seed, "fan", run).uniform(-1, 1, seconds // FAN_CHANGES + 1).clip(0, 1)
    return speed.repeat(FAN_CHANGES)[:seconds, None]


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
