"""Integrate the true heat balance of a robot.

The scheme is RK4 with steps of 1 s, fed with the exact means over each second of τ², |ω|, ω², |ω|^1.5
and |v|. Heat is linear in these means, and the factors that depend on temperature hardly move in a second.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .protocol import SAMPLES_PER_SECOND, Signals
from .robot import Array, Robot

STEFAN_BOLTZMANN = 5.670374419e-8  # W/(m² K⁴)
KELVIN = 273.15
REFERENCE = 25.0  # degC, at which resistance and torque constant are given


@dataclass(frozen=True)
class Means:
    """Means of the inputs over intervals: of shape (intervals, joints), and (intervals, 1) for the wind.

    torque2: τ². speed: |ω|. speed2: ω². speed15: |ω|^1.5. wind: |v| to the robot's exponent.
    powered: share of the interval with the joint's drive on; ``None`` where no drive is known of.
    """

    torque2: Array
    speed: Array
    speed2: Array
    speed15: Array
    wind: Array
    powered: Array | None = None


@dataclass(frozen=True)
class Drive:
    """What acts on the nodes in each interval; every array has the shape (intervals, nodes).

    copper: W at 25 degC. other: W, independent of temperature; further columns are for the windings that are masses of
    their own. to_air: W/K at the ambient's temperature.
    """

    copper: Array
    other: Array
    to_air: Array

    def since(self, interval: int) -> Drive:
        """Return what acts from this interval on."""
        return Drive(self.copper[interval:], self.other[interval:], self.to_air[interval:])


def averaged(robot: Robot, signals: Signals, block: int) -> Means:
    """Average samples, each held until the next, over intervals of ``block`` samples."""
    speed = np.abs(signals.velocity)
    wind = np.abs(signals.base[:, None]) ** robot.wind_exponent
    squares = signals.torque**2, speed, speed**2, speed**1.5, wind
    return Means(*(_mean(values, block) for values in squares))


def _mean(values: Array, block: int) -> Array:
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
    return act(robot, averaged(robot, signals, block), _mean(extra, block))


def act(robot: Robot, means: Means, extra: Array) -> Drive:
    """Turn means into what acts on the nodes; ``extra`` is further heat, W, of shape (intervals, nodes)."""

    def at_nodes(values: Array) -> Array:
        missing = len(robot.nodes) - values.shape[1]
        return np.pad(values, ((0, 0), (0, missing))) if missing else values

    copper = at_nodes(means.torque2) * robot.resistance / robot.torque_constant**2
    friction = at_nodes(means.speed) * robot.coulomb + at_nodes(means.speed2) * robot.viscous
    friction = friction + at_nodes(means.speed15) * robot.iron
    other = friction + robot.constant + extra
    if means.powered is not None:
        # The drive's board sits on the motor's back: it heats the winding where that is a mass of its own.
        drives, wound = at_nodes(means.powered) * robot.drive, np.flatnonzero(robot.winding > 0)
        other = np.concatenate([other + drives * (robot.winding == 0), drives[:, wound]], axis=1)
    return Drive(copper, other, (1 + means.wind * robot.forced_convection) * robot.to_air)


class Network:
    """The heat balance at one ambient temperature (degC); states are the nodes, the windings, the hidden masses.

    ``sensed`` are the indices of the states that the nodes' sensors sit on.
    """

    def __init__(self, robot: Robot, ambient: float) -> None:
        self.robot, self.ambient, self.count = robot, ambient, len(robot.nodes)
        self.wound = np.flatnonzero(robot.winding > 0)
        first = self.count + len(self.wound)
        self.windings = slice(self.count, first)
        # Without a winding of its own, the node makes the copper's heat and has the sensor.
        self.copper = np.arange(self.count)
        self.copper[self.wound] = np.arange(self.count, first)
        self.whole = np.where(robot.winding > 0, 0.0, 1.0)
        self.sensed = self.copper[: robot.sensed]
        links = robot.links + [(int(i), self.count + k, 1 / robot.inside[i]) for k, i in enumerate(self.wound)]
        links = links + [(m.joint, first + k, 1 / m.resistance) for k, m in enumerate(robot.masses)]
        hidden_air = np.array([0.0] * first + [m.to_air for m in robot.masses])
        self.exchange = -np.diag(hidden_air)
        for i, j, conductance in links:
            self.exchange[[i, j], [i, j]] -= conductance
            self.exchange[[i, j], [j, i]] += conductance
        self.supply = hidden_air * ambient + np.array([0.0] * first + [m.heat for m in robot.masses])
        masses = [m.capacity for m in robot.masses]
        self.capacity = np.concatenate([robot.capacity, robot.winding[self.wound], masses])
        self.ambient_glow = (ambient + KELVIN) ** 4
        self.glow = robot.emissive_area * STEFAN_BOLTZMANN

    def slope(self, T: Array, copper: Array, other: Array, to_air: Array) -> Array:
        """Return dT/dt in K/s at the temperatures T (degC), under one interval of a ``Drive``."""
        robot, node = self.robot, T[: self.count]
        above, warm = node - self.ambient, T[self.copper] - REFERENCE
        made = copper * (1 + robot.resistance_rise * warm) / (1 - robot.torque_constant_drop * warm) ** 2
        convected = to_air * np.exp(robot.natural_convection * above) * above
        radiated = self.glow * ((node + KELVIN) ** 4 - self.ambient_glow)
        heat: Array = self.exchange @ T + self.supply
        heat[: self.count] += self.whole * made + other[: self.count] - convected - radiated
        if len(self.wound):
            heat[self.windings] += made[self.wound] + other[self.count :]
        slope: Array = heat / self.capacity
        return slope

    def start(self, nodes: Array) -> Array:
        """Return the state with the nodes at these temperatures (degC), each winding and hidden mass at its node's."""
        inner = [nodes[m.joint] for m in self.robot.masses]
        return np.concatenate([nodes, nodes[self.wound], inner])

    def solve(self, forcing: Drive, start: Array) -> Array:
        """Return temperatures (degC) at 0, 1, … s, of shape (seconds + 1, states), by RK4 steps of 1 s."""
        T = np.empty((len(forcing.copper) + 1, len(start)))
        T[0] = start
        for k, held in enumerate(zip(forcing.copper, forcing.other, forcing.to_air, strict=True)):
            now = T[k]
            a = self.slope(now, *held)
            b = self.slope(now + a / 2, *held)
            c = self.slope(now + b / 2, *held)
            d = self.slope(now + c, *held)
            T[k + 1] = now + (a + 2 * b + 2 * c + d) / 6
        return T
