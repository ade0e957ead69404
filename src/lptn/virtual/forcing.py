"""Turn what a robot does into what acts on its nodes: heat and conductances, interval by interval.

Fed with the exact means over each interval of |τ|, τ², |ω|, ω², |ω|^1.5, |τ ω| and |v|: heat is linear in these.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .protocol import SAMPLES_PER_SECOND, Signals
from .robot import Array, Robot
from .truth import GEAR, MOTOR_CONSTANT, WINDING_RESISTANCE


@dataclass(frozen=True)
class Common:
    """Means of what all nodes share, each of shape (intervals, 1).

    computer, battery: power, W. fan: share of its full speed. sun: irradiance, W/m².
    """

    computer: Array
    battery: Array
    fan: Array
    sun: Array


@dataclass(frozen=True)
class Means:
    """Means of the inputs over intervals: of shape (intervals, joints), and (intervals, 1) for the wind.

    torque1: |τ|. torque2: τ². speed: |ω|. speed2: ω². speed15: |ω|^1.5. power: |τ ω|. wind: |v| to the robot's
    exponent. powered: share of the interval with the joint's drive on; ``None`` where no drive is known of.
    common: what the nodes share, ``None`` for nothing.
    """

    torque1: Array
    torque2: Array
    speed: Array
    speed2: Array
    speed15: Array
    power: Array
    wind: Array
    powered: Array | None = None
    common: Common | None = None


@dataclass(frozen=True)
class Drive:
    """What acts on the nodes in each interval; arrays have the shape (intervals, nodes).

    copper: W at 25 degC. other: W, independent of temperature; further columns are for the windings that are masses of
    their own. to_air: W/K at the ambient's temperature. shift: K of the ambient above the network's, of shape
    (intervals,); ``None`` for none.
    """

    copper: Array
    other: Array
    to_air: Array
    shift: Array | None = None

    def since(self, interval: int) -> Drive:
        """Return what acts from this interval on."""
        shift = None if self.shift is None else self.shift[interval:]
        return Drive(self.copper[interval:], self.other[interval:], self.to_air[interval:], shift)

    def shifted(self, shift: Array | None) -> Drive:
        """Return the same with the ambient above the network's by the shift (K) at the intervals' ends."""
        return self if shift is None else replace(self, shift=(shift[:-1] + shift[1:]) / 2)


def averaged(robot: Robot, signals: Signals, block: int) -> Means:
    """Average samples, each held until the next, over intervals of ``block`` samples."""
    torque, speed = np.abs(signals.torque), np.abs(signals.velocity)
    wind = np.abs(signals.base[:, None]) ** robot.wind_exponent
    values = torque, signals.torque**2, speed, speed**2, speed**1.5, torque * speed
    torque1, torque2, speed1, speed2, speed15, power = (mean(one, block) for one in values)
    wind = mean(np.abs(signals.base[:, None]) ** robot.wind_exponent, block)
    return Means(torque1, torque2, speed1, speed2, speed15, power, wind)


def mean(values: Array, block: int) -> Array:
    """Average rows over blocks of this many."""
    means: Array = values.reshape(-1, block, values.shape[1]).mean(axis=1)
    return means


def drive(robot: Robot, signals: Signals, extra: Array, block: int = SAMPLES_PER_SECOND) -> Drive:
    """Turn samples into what acts on the nodes.

    Args:
        robot: the truth.
        signals: inputs at 10 Hz, each sample held until the next.
        extra: further heat, W, of shape (samples, nodes).
        block: samples an interval; must divide the number of samples.
    """
    return act(robot, averaged(robot, signals, block), mean(extra, block))


def act(robot: Robot, means: Means, extra: Array) -> Drive:
    """Turn means into what acts on the nodes; ``extra`` is further heat, W, of shape (intervals, nodes)."""
    friction = _at_nodes(robot, means.speed) * robot.coulomb + _at_nodes(robot, means.speed2) * robot.viscous
    friction = friction + _at_nodes(robot, means.speed15) * robot.iron + _at_nodes(robot, means.power) * robot.gear
    other = friction + robot.constant + extra
    drives = _at_nodes(robot, means.torque1) * robot.driver
    to_air = 1 + means.wind * robot.forced_convection
    if means.common is not None:
        common = means.common
        other = other + common.computer * robot.computer + common.battery * robot.battery + common.sun * robot.sunlit
        to_air = to_air + common.fan * robot.fanned
    if means.powered is not None:
        drives = _at_nodes(robot, means.powered) * robot.drive + drives
    # The drive's board sits on the motor's back: it heats the winding where that is a mass of its own.
    wound = np.flatnonzero(robot.winding > 0)
    other = np.concatenate([other + drives * (robot.winding == 0), drives[:, wound]], axis=1)
    return Drive(copper_loss(robot, means), other, to_air * robot.to_air)


def battery_power(rest: Array, means: Means) -> Array:
    """Return what the battery gives to the nominal robot, W, of shape (intervals, 1).

    Copper loss and mechanical power of all joints, beside the rest: computer and drives.
    """
    copper = WINDING_RESISTANCE / (GEAR * MOTOR_CONSTANT) ** 2 * means.torque2
    power: Array = rest + (copper + means.power).sum(axis=1, keepdims=True)
    return power


def copper_loss(robot: Robot, means: Means) -> Array:
    """Return each node's copper loss at 25 degC, W, of shape (intervals, nodes)."""
    loss: Array = _at_nodes(robot, means.torque2) * robot.resistance / robot.torque_constant**2
    return loss


def _at_nodes(robot: Robot, values: Array) -> Array:
    missing = len(robot.nodes) - values.shape[1]
    return np.pad(values, ((0, 0), (0, missing))) if missing else values
