"""Draw what happens at random times in a run: bursts of heat, splashes, a step of the sensor."""

from __future__ import annotations

import numpy as np

from .streams import stream
from .truth import JOINTS, Array, Leg

BURST_EVERY = 600  # s, on the average
SPLASH_EVERY = 700  # s, on the average


def event_heat(leg: Leg, seconds: int, seed: int, run: str) -> Array:
    """Return the heat (W) of bursts and splashes in each second of a run, of shape (seconds, joints)."""
    heat = np.zeros((seconds, len(JOINTS)))
    for i, joint in enumerate(JOINTS):
        rng = stream(seed, "bursts", run, joint)
        for begin in rng.integers(60, seconds - 180, seconds // BURST_EVERY):
            heat[begin : begin + rng.integers(60, 181), i] = leg.bursts[i]
        rng = stream(seed, "splash", run, joint)
        # Not in the first fifth: a leg near the ambient has little to lose.
        when = rng.choice(np.arange(seconds // 5, seconds - 60), seconds // SPLASH_EVERY, replace=False)
        heat[when, i] -= leg.splash[i]
    return heat


def sensor_steps(leg: Leg, seconds: int, seed: int, run: str) -> Array:
    """Return what steps add to the readings (K) in each second of a run, of shape (seconds, joints)."""
    when = np.array([stream(seed, "step", run, joint).uniform(0.2, 0.8) * seconds for joint in JOINTS])
    return (np.arange(seconds)[:, None] >= when) * leg.step
