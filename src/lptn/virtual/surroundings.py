"""Draw what surrounds a robot in a run: the ambient as it changes, the sun, a fan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .robot import Array, Robot
from .sensors import lagged
from .streams import stream

STAYS, DOOR = (600, 1500), 60  # s in one place, and on the way to the next
SUN = 700.0  # W/m², without clouds
CLOUDS, BLOWS = 300, 420  # s between the knots of the clouds, and of the fan's speed


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
    logged = logged + swing * _doors(stream(seed, "ambient", run), seconds)
    follows = lagged(logged[:, None], np.array([robot.ambient_lag]))[:, 0]
    return Ambient(logged, follows + above, follows - first)


def sun(seconds: int, seed: int, run: str) -> Array:
    """Return the mean irradiance of each second, W/m², of shape (seconds, 1)."""
    knots = stream(seed, "sun", run).uniform(-1, 1, seconds // CLOUDS + 2)
    clouds = _between(knots, CLOUDS, seconds)[:-1, None]
    light: Array = SUN * (0.5 + clouds).clip(0, 1)
    return light


def fan(seconds: int, seed: int, run: str) -> Array:
    """Return a fan's share of its full speed in each second, of shape (seconds, 1): off, or on at some speed."""
    knots = seconds // BLOWS + 1
    speed = stream(seed, "fan", run).uniform(-1, 1, knots).clip(0, 1)
    return speed.repeat(BLOWS)[:seconds, None]


def _doors(rng: np.random.Generator, seconds: int) -> Array:
    """Return 0 indoors and 1 or -1 out of doors, where it is warmer or colder all day, of shape (seconds + 1,)."""
    outside, when = rng.choice([-1.0, 1.0]), np.cumsum(rng.uniform(*STAYS, seconds // min(STAYS) + 2))
    there = outside * (np.arange(len(when) + 1) % 2)
    return np.interp(np.arange(seconds + 1), np.ravel([when, when + DOOR], "F"), np.ravel([there[:-1], there[1:]], "F"))


def _between(knots: Array, every: int, seconds: int) -> Array:
    """Return straight lines between knots this many seconds apart, of shape (seconds + 1,)."""
    return np.interp(np.arange(seconds + 1), every * np.arange(len(knots)), knots)
