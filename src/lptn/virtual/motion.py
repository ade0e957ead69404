"""What the quadruped does: activities, their periodic torques and speeds at 100 Hz, and the exact means of each second.

A segment's gait is one pattern, a whole number of samples long, repeated; its size is constant over each second and
wanders slowly from second to second. So the means of τ², |ω| and so on follow from the pattern's running sums, and the
samples themselves need to be made only where they are logged.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .heat import Means, Shared, battery_power
from .robot import DRIVE, PC_BUSY, PC_IDLE, QUADRUPED_JOINTS, Array, check_one_of, wandering

SAMPLES = 100  # a second
BODY = 12.0  # kg: torque grows as body and load together
LOADED = 4.0  # kg, the load at which the torques below are given
MODULATION = 0.02  # standard deviation of the slow wandering of torque and speed
SHARE = 0.06  # half-width of each joint's own factor on torque and on speed in each segment
COUNT = len(QUADRUPED_JOINTS)

# --- activities ----------------------------------------------------------------------------------------------------

_TROT = (0.0, 0.5, 0.5, 0.0)  # of FR, FL, RR, RL
_WALK = (0.0, 0.5, 0.75, 0.25)
_TOGETHER = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class QuadrupedActivity:
    """How the robot moves. Triples are hip, thigh, calf.

    torque: RMS with a load of 4 kg, at speed 0, N·m. growth: of the torque with speed, relative, s/m.
    bias: constant part of the torque's pattern, beside a sine of size 1. sweep: amplitude of the joints' speed at
    speed 1, rad/s, and reach_at_zero the share of it at speed 0. stride: Hz at speed 0, and its growth with speed.
    phases: of the legs, in cycles. travels: whether the speed is the base's, in m/s; else a factor on sweep.
    """

    torque: tuple[float, float, float] = (0.0, 0.0, 0.0)
    growth: float = 0.0
    bias: float = 0.6
    sweep: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reach_at_zero: float = 0.0
    stride: tuple[float, float] = (0.5, 0.0)
    phases: tuple[float, float, float, float] = _TOGETHER
    travels: bool = False
    powered: bool = True

    def reach(self, speed: float) -> float:
        """Return the factor on the sweep at this speed."""
        return self.reach_at_zero + (1 - self.reach_at_zero) * speed


ACTIVITIES = {
    "rest": QuadrupedActivity(powered=False),
    "stand": QuadrupedActivity((1.3, 2.2, 5.6), bias=8.0, stride=(0.3, 0.0)),
    "trot": QuadrupedActivity(
        (2.242, 3.767, 8.078), 0.15, 0.6, (1.5, 6.0, 10.41), 0.6, (1.6, 1.2), _TROT, travels=True
    ),
    "walk": QuadrupedActivity((2.0, 3.4, 7.0), 0.15, 0.8, (1.2, 5.0, 8.0), 0.5, (1.0, 0.9), _WALK, travels=True),
    "squat": QuadrupedActivity((1.5, 4.5, 8.0), 0.0, 1.2, (0.3, 2.5, 4.0), 0.0, (0.4, 0.0)),
    "sway": QuadrupedActivity((7.0, 3.5, 5.0), 0.0, 0.6, (6.0, 2.5, 3.0), 0.0, (0.5, 0.0)),
    "leg_sweep": QuadrupedActivity((0.6, 0.6, 0.5), 0.0, 0.0, (8.0, 8.0, 9.0), 0.0, (0.9, 0.4)),
    "hold": QuadrupedActivity(bias=12.0, stride=(0.5, 0.0)),
}


@dataclass(frozen=True)
class Bout:
    """One activity for whole seconds.

    Args:
        activity: a key of ``ACTIVITIES``; "rest" has all drives off, "hold" powers ``joints`` alone.
        seconds: 1 or above.
        speed: m/s for trot and walk; for squat, sway and leg_sweep a factor on the joints' speed; the leg's alike.
        load: kg on the back, 0 to 20.
        joints: for "hold", which joints push.
        torque: for "hold", RMS torque of each, N·m.

    Raises:
        ValueError: a value outside its range.
    """

    activity: str
    seconds: int
    speed: float = 0.0
    load: float = 0.0
    joints: tuple[str, ...] = ()
    torque: float = 0.0

    def __post_init__(self) -> None:
        check_one_of("activity", self.activity, ACTIVITIES)
        if self.seconds != int(self.seconds) or self.seconds < 1:
            raise ValueError(f"seconds of {self.activity}: found {self.seconds:g}; expected a whole number, 1 or above")
        for name, top, unit in (("speed", 3.0, "m/s"), ("load", 20.0, "kg"), ("torque", 33.5, "N·m")):
            value = getattr(self, name)
            if not (math.isfinite(value) and 0 <= value <= top):
                raise ValueError(f"{name} of {self.activity}: found {value:g}; expected 0 to {top:g} {unit}")
        if (self.activity == "hold") != bool(self.joints):
            raise ValueError(
                f"joints of {self.activity}: found {len(self.joints)}; expected joints for hold, else none"
            )
        if unknown := [joint for joint in self.joints if joint not in QUADRUPED_JOINTS]:
            raise ValueError(f"joints of hold: found {unknown[0]!r}; expected some of {', '.join(QUADRUPED_JOINTS)}")


# --- movement ------------------------------------------------------------------------------------------------------


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
        return replace(means, shared=self.shared(means))

    def shared(self, means: Means) -> Shared:
        """Return what the nodes share; ``means`` are those of this movement."""
        computer = self.pc[:, None]
        battery = battery_power(computer + DRIVE * self.powered.sum(axis=1, keepdims=True), means)
        return {"power.pc": computer, "power.battery": battery, "speed.fan": self.fan, "irradiance.global": self.sun}

    def only(self, on: Array) -> Motion:
        """Return the same movement with all drives off in the seconds in which ``on`` is 0."""
        column = on[:, None]
        moved = {"torque": self.torque * column, "velocity": self.velocity * column, "powered": self.powered * column}
        return replace(self, **moved, base=self.base * on, pc=np.where(on > 0, self.pc, PC_IDLE))  # type: ignore[arg-type]

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


def draw_motion(segments: Sequence[Bout], rng: np.random.Generator) -> Motion:
    """Draw the movement of these segments, one after the other."""
    motions, begin = [], 0
    for segment in segments:
        motions.append(_perform(segment, begin, rng))
        begin += segment.seconds
    names = ("torque", "velocity", "powered", "base", "pc", "fan", "sun")
    moved = {name: np.concatenate([getattr(motion, name) for motion in motions]) for name in names}
    parts = tuple(part for motion in motions for part in motion.parts)
    return Motion(**moved, parts=parts, unit=Means.joined([motion.unit for motion in motions]))


def _perform(segment: Bout, begin: int, rng: np.random.Generator) -> Motion:
    act, seconds = ACTIVITIES[segment.activity], segment.seconds
    # All is drawn whether used or not: a segment's draws don't depend on what it is.
    deviation, share = rng.uniform(-1, 1), rng.uniform(1 - SHARE, 1 + SHARE, (2, COUNT))
    shift, wander = rng.uniform(0, 1), wandering(seconds, np.arange(float(seconds)), MODULATION, 3, rng)
    cycle = round(SAMPLES / (act.stride[0] + act.stride[1] * segment.speed) * (1 + 0.06 * deviation))
    turn = np.arange(cycle)[:, None] / cycle + np.repeat(act.phases, COUNT // 4) + shift
    pattern = act.bias + np.sin(2 * np.pi * turn) + 0.3 * np.sin(4 * np.pi * turn)
    part = Part(begin, seconds, pattern / np.sqrt(np.mean(pattern**2, axis=0)), np.sin(2 * np.pi * (turn + 0.15)))
    size = np.tile(act.torque, 4) * (1 + act.growth * segment.speed) * (BODY + segment.load) / (BODY + LOADED)
    reach = np.tile(act.sweep, 4) * act.reach(segment.speed)
    powered = np.full(COUNT, float(act.powered))
    if segment.joints:
        powered = np.array([float(joint in segment.joints) for joint in QUADRUPED_JOINTS])
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

    return Means.of_samples(part.torque, part.velocity, np.zeros((part.seconds, 1)), mean)
