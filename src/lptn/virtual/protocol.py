"""Draw what the leg does: runs of activities, and their torques and speeds at 10 Hz."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .streams import stream
from .truth import JOINTS, Array

SAMPLES_PER_SECOND = 10
BODY = 12.0  # kg: torque grows as (body + load) / body
MODULATION = 0.12  # standard deviation of the slow wandering of torque and speed
KNOT = 8.0  # s between the knots of that wandering


@dataclass(frozen=True)
class Activity:
    """A way of moving. Joint triples are hip, thigh, calf.

    hold, swing: mean and amplitude of the torque, N·m. sweep: amplitude of the speed at pace 1, rad/s.
    stride: Hz at pace 0, and its growth with pace. travels: whether the pace is a base speed in m/s.
    """

    hold: tuple[float, float, float] = (0.0, 0.0, 0.0)
    swing: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sweep: tuple[float, float, float] = (0.0, 0.0, 0.0)
    stride: tuple[float, float] = (0.2, 0.0)
    travels: bool = False


ACTIVITIES = {
    "rest": Activity(),
    "stand": Activity(hold=(5.0, 5.0, 6.0), swing=(0.5, 0.5, 0.6)),
    "trot": Activity((4.0, 3.5, 5.0), (4.0, 4.5, 6.0), (1.5, 5.0, 7.0), (1.4, 0.6), travels=True),
    "walk": Activity((5.0, 3.5, 4.5), (3.0, 3.5, 4.0), (1.5, 6.0, 7.0), (0.8, 0.6), travels=True),
    "squat": Activity((3.0, 6.0, 6.5), (1.0, 5.0, 5.0), (0.3, 2.5, 4.0), (0.4, 0.0)),
    "leg_sweep": Activity(swing=(0.6, 0.6, 0.5), sweep=(8.0, 8.0, 9.0), stride=(0.9, 0.4)),
}


@dataclass(frozen=True)
class Segment:
    """One activity for whole seconds. pace: m/s when travelling, else a factor on speed. load: kg."""

    activity: str
    seconds: int
    pace: float = 1.0
    load: float = 0.0


@dataclass(frozen=True)
class Run:
    """Segments and the ambient temperature (degC) they happen in."""

    segments: tuple[Segment, ...]
    ambient: float


@dataclass(frozen=True)
class Signals:
    """Inputs at 10 Hz: torque (N·m) and velocity (rad/s), of shape (samples, joints); base speed (m/s)."""

    torque: Array
    velocity: Array
    base: Array


# What each run holds: activity, share of its time, range of pace, range of load. The order is drawn, but for
# the last: a cool-down, which shows the losses alone. The second run is the colder and the harder one, so
# that losses are seen far above the ambient, too: else natural convection can't be told from a larger
# conductance. Its legs sweep slowly and fast, which tells the laws of friction apart.
_Plan = tuple[tuple[str, float, tuple[float, float], tuple[float, float]], ...]
_FIT1: _Plan = (
    ("stand", 1.0, (1, 1), (0, 2)),
    ("trot", 1.2, (0.4, 0.7), (0, 1)),
    ("leg_sweep", 1.1, (0.9, 1.2), (0, 0)),
    ("trot", 1.2, (1.2, 1.5), (2, 4)),
    ("rest", 0.6, (1, 1), (0, 0)),
    ("squat", 0.9, (0.8, 1.2), (0, 2)),
    ("walk", 1.1, (0.3, 0.5), (3, 5)),
    ("trot", 1.1, (1.3, 1.6), (0, 0)),
    ("stand", 0.8, (1, 1), (4, 6)),
    ("rest", 2.4, (1, 1), (0, 0)),
)
_FIT2: _Plan = (
    ("squat", 0.9, (0.9, 1.3), (2, 4)),
    ("trot", 1.3, (0.8, 1.1), (6, 7)),
    ("leg_sweep", 1.1, (0.3, 0.45), (0, 0)),
    ("walk", 1.1, (0.4, 0.6), (3, 5)),
    ("stand", 1.2, (1, 1), (8, 9)),
    ("trot", 1.2, (1.4, 1.7), (2, 4)),
    ("stand", 0.8, (1, 1), (0, 1)),
    ("trot", 1.1, (0.4, 0.6), (6, 7)),
    ("leg_sweep", 0.9, (1.4, 1.6), (0, 0)),
    ("rest", 3.0, (1, 1), (0, 0)),
)
_HOLDOUT: _Plan = (
    ("walk", 1.2, (0.5, 0.7), (1, 3)),
    ("stand", 0.8, (1, 1), (2, 4)),
    ("trot", 1.4, (1.0, 1.3), (1, 3)),
    ("rest", 0.7, (1, 1), (0, 0)),
    ("leg_sweep", 0.8, (0.7, 1.1), (0, 0)),
    ("trot", 1.2, (0.5, 0.8), (2, 4)),
    ("squat", 0.8, (0.7, 1.1), (1, 3)),
    ("rest", 1.6, (1, 1), (0, 0)),
)
_RUNS = {"fit1": (_FIT1, 2400, 22.0), "fit2": (_FIT2, 2400, 12.0), "holdout": (_HOLDOUT, 1800, 28.0)}
WARM_UP = Segment("trot", 900, pace=1.0, load=2.0)


def draw_runs(seed: int) -> dict[str, Run]:
    """Draw the runs "fit1" (40 min, 22 degC), "fit2" (40 min, 12 degC) and "holdout" (30 min, 28 degC)."""
    return {name: _draw_run(stream(seed, "protocol", name), *what) for name, what in _RUNS.items()}


def _draw_run(rng: np.random.Generator, plan: _Plan, seconds: int, ambient: float) -> Run:
    order = [*rng.permutation(len(plan) - 1), len(plan) - 1]
    share = np.array([plan[i][1] for i in order]) * rng.uniform(0.8, 1.2, len(order))
    ends = np.rint(seconds * np.cumsum(share) / share.sum()).astype(int)
    lasts = np.diff(ends, prepend=0)
    segments = [
        Segment(plan[i][0], int(last), float(rng.uniform(*plan[i][2])), float(rng.uniform(*plan[i][3])))
        for i, last in zip(order, lasts, strict=True)
    ]
    return Run(tuple(segments), ambient)


def draw_signals(segments: tuple[Segment, ...], rng: np.random.Generator) -> Signals:
    """Draw the inputs of these segments, one after the other."""
    parts = [_perform(segment, rng) for segment in segments]
    return Signals(
        np.concatenate([p.torque for p in parts]),
        np.concatenate([p.velocity for p in parts]),
        np.concatenate([p.base for p in parts]),
    )


def _perform(segment: Segment, rng: np.random.Generator) -> Signals:
    act, count = ACTIVITIES[segment.activity], len(JOINTS)
    time = np.arange(segment.seconds * SAMPLES_PER_SECOND) / SAMPLES_PER_SECOND
    stride = (act.stride[0] + act.stride[1] * segment.pace) * rng.uniform(0.9, 1.1)
    first, second, moving = (2 * np.pi * (n * stride * time[:, None] + rng.uniform(0, 1, count)) for n in (1, 2, 1))
    # Each segment has its own share of work among the joints: else their heats would go hand in hand.
    effort = rng.uniform(0.75, 1.3, count) * (BODY + segment.load) / BODY * _wander(time, rng)
    torque = effort * (np.array(act.hold) + np.array(act.swing) * (np.sin(first) + 0.3 * np.sin(second)))
    reach = rng.uniform(0.6, 1.2, count) * segment.pace * _wander(time, rng)
    velocity = reach * np.array(act.sweep) * np.sin(moving)
    base = segment.pace * _wander(time, rng)[:, 0] * act.travels
    return Signals(torque, velocity, base)


def _wander(time: Array, rng: np.random.Generator) -> Array:
    """Return a factor around 1 that wanders slowly, of shape (samples, 1)."""
    knots = np.arange(0.0, time[-1] + 2 * KNOT, KNOT)
    factor: Array = np.interp(time, knots, rng.normal(1, MODULATION, len(knots)).clip(0.5, 1.5))[:, None]
    return factor
