"""Integrate the true heat balance of a robot.

The scheme is RK4 with steps of 1 s, fed with exact means over each second: the factors that depend on temperature
hardly move in a second.
"""

from __future__ import annotations

from itertools import repeat

import numpy as np

from .forcing import Drive
from .robot import Array, Robot

STEFAN_BOLTZMANN = 5.670374419e-8  # W/(m² K⁴)
KELVIN = 273.15
REFERENCE = 25.0  # degC, at which resistance and torque constant are given


class Network:
    """The heat balance around one ambient temperature (degC); states are the nodes, the windings, the hidden masses.

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
        links = links + [(end, first + k, 1 / m.resistance) for k, m in enumerate(robot.masses) for end in m.ends]
        self.hidden_air = np.array([0.0] * first + [m.to_air for m in robot.masses])
        self.exchange = -np.diag(self.hidden_air)
        for i, j, conductance in links:
            self.exchange[[i, j], [i, j]] -= conductance
            self.exchange[[i, j], [j, i]] += conductance
        self.supply = self.hidden_air * ambient + np.array([0.0] * first + [m.heat for m in robot.masses])
        masses = [m.capacity for m in robot.masses]
        self.capacity = np.concatenate([robot.capacity, robot.winding[self.wound], masses])
        self.ambient_glow = (ambient + KELVIN) ** 4
        self.glow = robot.emissive_area * STEFAN_BOLTZMANN

    def slope(self, T: Array, copper: Array, other: Array, to_air: Array, shift: float | None = None) -> Array:
        """Return dT/dt in K/s at the temperatures T (degC), under one interval of a ``Drive``."""
        robot, node = self.robot, T[: self.count]
        ambient, glow = self.ambient, self.ambient_glow
        if shift is not None:
            ambient, glow = ambient + shift, (ambient + shift + KELVIN) ** 4
        above, warm = node - ambient, T[self.copper] - REFERENCE
        made = copper * (1 + robot.resistance_rise * warm) / (1 - robot.torque_constant_drop * warm) ** 2
        convected = to_air * np.exp(robot.natural_convection * above) * above
        radiated = self.glow * ((node + KELVIN) ** 4 - glow)
        heat: Array = self.exchange @ T + self.supply
        if shift is not None:
            heat += self.hidden_air * shift
        heat[: self.count] += self.whole * made + other[: self.count] - convected - radiated
        if len(self.wound):
            heat[self.windings] += made[self.wound] + other[self.count :]
        slope: Array = heat / self.capacity
        return slope

    def start(self, nodes: Array) -> Array:
        """Return the state with the nodes at these temperatures (degC), each winding and hidden mass at its nodes'."""
        inner = [nodes[m.ends].mean() for m in self.robot.masses]
        return np.concatenate([nodes, nodes[self.wound], inner])

    def solve(self, forcing: Drive, start: Array) -> Array:
        """Return temperatures (degC) at 0, 1, … s, of shape (seconds + 1, states), by RK4 steps of 1 s."""
        T = np.empty((len(forcing.copper) + 1, len(start)))
        T[0] = start
        shifts = repeat(None) if forcing.shift is None else forcing.shift
        # The shifts may go on for ever: not strict.
        for k, (copper, other, to_air, shift) in enumerate(
            zip(forcing.copper, forcing.other, forcing.to_air, shifts, strict=False)
        ):
            now, held = T[k], (copper, other, to_air, shift)
            a = self.slope(now, *held)
            b = self.slope(now + a / 2, *held)
            c = self.slope(now + b / 2, *held)
            d = self.slope(now + c, *held)
            T[k + 1] = now + (a + 2 * b + 2 * c + d) / 6
        return T
