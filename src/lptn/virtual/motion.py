"""Move the quadruped: periodic torques and speeds at 100 Hz, and their exact means over each second.

A segment's gait is one pattern, a whole number of samples long, repeated; its size is constant over each second and
wanders slowly from second to second. So the means of τ², |ω| and so on follow from the pattern's running sums, and the
samples themselves need to be made only where somebody wants to see them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .activities import ACTIVITIES, BODY, LOADED, Segment
from .forcing import Common, Means, battery_power
from .quadruped_truth import DRIVE, JOINTS, PC_BUSY, PC_IDLE
from .robot import Array

SAMPLES = 100  # a second
MODULATION = 0.02  # standard deviation of the slow wandering of torque and speed
KNOT = 8.0  # s between the knots of that wandering
SHARE = 0.06  # half-width of each joint's own factor on torque and on speed in each segment
COUNT = len(JOINTS)


@dataclass(frozen=True)
class Part:
    """One segment's pattern: torque and velocity of size 1, of shape (samples of a cycle, joints)."""

    begin: int
    seconds: int
    torque: Array
    velocity: Array


@dataclass(frozen=True)
class Motion:
    """A run's movement, second by second.

    torque: size of the torque, N·m, velocity: of the speed, rad/s, powered: 0 or 1; of shape (seconds, joints).
    base: m/s, pc: heat of the computer, W; of shape (seconds,). parts: the patterns. unit: means of the patterns.
    fan: share of its full speed, sun: W/m², of shape (seconds, 1).
    """

    torque: Array
    velocity: Array
    powered: Array
    base: Array
    pc: Array
    parts: tuple[Part, ...]
    unit: Means
    fan: Array
    sun: Array

    def means(self, exponent: float = 1.0) -> Means:
        """Return the exact means over each second; ``exponent`` is the wind's."""
        reach, unit = self.velocity, self.unit
        means = Means(
            torque1=self.torque * unit.torque1,
            torque2=self.torque**2 * unit.torque2,
            speed=reach * unit.speed,
            speed2=reach**2 * unit.speed2,
            speed15=reach**1.5 * unit.speed15,
            power=self.torque * reach * unit.power,
            wind=np.abs(self.base[:, None]) ** exponent,
            powered=self.powered,
        )
        return replace(means, common=self.common(means))

    def common(self, means: Means) -> Common:
        """Return what the nodes share; ``means`` are those of this movement."""
        computer = self.pc[:, None]
        battery = battery_power(computer + DRIVE * self.powered.sum(axis=1, keepdims=True), means)
        return Common(computer, battery, self.fan, self.sun)

    def only(self, on: Array) -> Motion:
        """Return the same movement with all drives off in the seconds in which ``on`` is 0."""
        column = on[:, None]
        pc = np.where(on > 0, self.pc, PC_IDLE)
        return replace(
            self,
            torque=self.torque * column,
            velocity=self.velocity * column,
            powered=self.powered * column,
            base=self.base * on,
            pc=pc,
        )

    def samples(self, begin: int, end: int) -> tuple[Array, Array]:
        """Return torque and velocity at 100 Hz from second ``begin`` to ``end``, of shape (samples, joints)."""
        torque, velocity = np.empty((2, (end - begin) * SAMPLES, COUNT))
        for part in self.parts:
            first, last = max(begin, part.begin), min(end, part.begin + part.seconds)
            if first >= last:
                continue
            cycle = np.arange((first - part.begin) * SAMPLES, (last - part.begin) * SAMPLES) % len(part.torque)
            rows = slice((first - begin) * SAMPLES, (last - begin) * SAMPLES)
            torque[rows] = part.torque[cycle] * self.torque[first:last].repeat(SAMPLES, axis=0)
            velocity[rows] = part.velocity[cycle] * self.velocity[first:last].repeat(SAMPLES, axis=0)
        return torque, velocity


def draw_motion(segments: Sequence[Segment], rng: np.random.Generator) -> Motion:
    """Draw the movement of these segments, one after the other."""
    motions, begin = [], 0
    for segment in segments:
        motions.append(_perform(segment, begin, rng))
        begin += segment.seconds
    parts = tuple(part for motion in motions for part in motion.parts)

    def joined(things: Sequence[object], name: str) -> Array:
        return np.concatenate([getattr(thing, name) for thing in things])

    units = [motion.unit for motion in motions]
    names = ("torque1", "torque2", "speed", "speed2", "speed15", "power", "wind")
    torque1, torque2, speed, speed2, speed15, power, wind = (joined(units, name) for name in names)
    unit = Means(torque1, torque2, speed, speed2, speed15, power, wind)
    moved = {name: joined(motions, name) for name in ("torque", "velocity", "powered", "base", "pc", "fan", "sun")}
    return Motion(**moved, parts=parts, unit=unit)


def _perform(segment: Segment, begin: int, rng: np.random.Generator) -> Motion:
    act, seconds = ACTIVITIES[segment.activity], segment.seconds
    # All is drawn whether used or not: a segment's draws don't depend on what it is.
    luck, share = rng.uniform(-1, 1), rng.uniform(1 - SHARE, 1 + SHARE, (2, COUNT))
    shift, wander = rng.uniform(0, 1), _wander(seconds, rng)
    cycle = round(SAMPLES / (act.stride[0] + act.stride[1] * segment.speed) * (1 + 0.06 * luck))
    turn = np.arange(cycle)[:, None] / cycle + np.repeat(act.phases, COUNT // 4) + shift
    pattern = act.bias + np.sin(2 * np.pi * turn) + 0.3 * np.sin(4 * np.pi * turn)
    part = Part(begin, seconds, pattern / np.sqrt(np.mean(pattern**2, axis=0)), np.sin(2 * np.pi * (turn + 0.15)))
    size = np.tile(act.torque, 4) * (1 + act.growth * segment.speed) * (BODY + segment.load) / (BODY + LOADED)
    reach = np.tile(act.sweep, 4) * act.reach(segment.speed)
    powered = np.full(COUNT, float(act.powered))
    if segment.joints:
        powered = np.array([float(joint in segment.joints) for joint in JOINTS])
        size, reach = powered * segment.torque, reach * powered
    still = np.ones((seconds, 1))
    base = (wander[:, 2] * segment.speed).clip(max=segment.speed) * act.travels
    return Motion(
        torque=size * share[0] ** (not segment.joints) * wander[:, :1],
        velocity=reach * share[1] * wander[:, 1:2],
        powered=powered * still,
        base=base,
        pc=np.full(seconds, PC_BUSY if act.travels else PC_IDLE),
        parts=(part,),
        unit=_unit_means(part),
        fan=0 * still,
        sun=0 * still,
    )


def _unit_means(part: Part) -> Means:
    """Average a pattern over each second of its segment."""

    def mean(values: Array) -> Array:
        cycle = len(values)
        sums = np.concatenate([np.zeros((1, COUNT)), np.cumsum(values, axis=0)])
        edges = np.arange(part.seconds + 1) * SAMPLES
        running = (edges // cycle)[:, None] * sums[-1] + sums[edges % cycle]
        means: Array = np.diff(running, axis=0) / SAMPLES
        return means

    torque, speed = np.abs(part.torque), np.abs(part.velocity)
    values = torque, part.torque**2, speed, speed**2, speed**1.5, torque * speed
    torque1, torque2, speed1, speed2, speed15, power = (mean(one) for one in values)
    return Means(torque1, torque2, speed1, speed2, speed15, power, wind=np.zeros((part.seconds, 1)))


def _wander(seconds: int, rng: np.random.Generator) -> Array:
    """Return three factors around 1 that wander slowly, of shape (seconds, 3)."""
    knots = np.arange(0.0, seconds + 2 * KNOT, KNOT)
    factors = rng.normal(1, MODULATION, (3, len(knots)))
    return np.column_stack([np.interp(np.arange(seconds), knots, one) for one in factors])
