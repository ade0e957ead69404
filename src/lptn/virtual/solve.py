"""Integrate the true heat balance of the leg.

The scheme is RK4 with steps of 1 s, fed with the exact means over each second of τ², |ω|, ω², |ω|^1.5
and |v|. Heat is linear in these means, and the factors that depend on temperature hardly move in a second.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .protocol import SAMPLES_PER_SECOND, Signals
from .truth import JOINTS, Array, Leg

STEFAN_BOLTZMANN = 5.670374419e-8  # W/(m² K⁴)
KELVIN = 273.15
REFERENCE = 25.0  # degC, at which resistance and torque constant are given
COUNT = len(JOINTS)


@dataclass(frozen=True)
class Drive:
    """What acts on the joints in each interval; every array has the shape (intervals, joints).

    copper: W at 25 degC. other: W, independent of temperature. to_air: W/K at the ambient's temperature.
    """

    copper: Array
    other: Array
    to_air: Array


def drive(leg: Leg, signals: Signals, extra: Array, block: int = SAMPLES_PER_SECOND) -> Drive:
    """Average the inputs over intervals of ``block`` samples.

    Args:
        leg: the truth.
        signals: inputs at 10 Hz, each sample held until the next.
        extra: further heat, W, of shape (samples, joints).
        block: samples an interval; must divide the number of samples.
    """

    def mean(values: Array) -> Array:
        means: Array = values.reshape(-1, block, values.shape[1]).mean(axis=1)
        return means

    speed = np.abs(signals.velocity)
    copper = mean(signals.torque**2) * leg.resistance / leg.torque_constant**2
    friction = mean(speed) * leg.coulomb + mean(speed**2) * leg.viscous + mean(speed**1.5) * leg.iron
    wind = 1 + mean(np.abs(signals.base[:, None])) * leg.forced_convection
    return Drive(copper, friction + leg.constant + mean(extra), wind * leg.to_air)


class Network:
    """The heat balance at one ambient temperature (degC); states are the joints, then the hidden masses."""

    def __init__(self, leg: Leg, ambient: float) -> None:
        self.leg, self.ambient = leg, ambient
        links = leg.links + [(m.joint, COUNT + k, 1 / m.resistance) for k, m in enumerate(leg.masses)]
        hidden_air = np.array([0.0] * COUNT + [m.to_air for m in leg.masses])
        self.exchange = -np.diag(hidden_air)
        for i, j, conductance in links:
            self.exchange[[i, j], [i, j]] -= conductance
            self.exchange[[i, j], [j, i]] += conductance
        self.supply = hidden_air * ambient + np.array([0.0] * COUNT + [m.heat for m in leg.masses])
        self.capacity = np.concatenate([leg.capacity, [m.capacity for m in leg.masses]])
        self.ambient_glow = (ambient + KELVIN) ** 4
        self.glow = leg.emissive_area * STEFAN_BOLTZMANN

    def slope(self, T: Array, copper: Array, other: Array, to_air: Array) -> Array:
        """Return dT/dt in K/s at the temperatures T (degC), under one interval of a ``Drive``."""
        leg, joint = self.leg, T[:COUNT]
        above, warm = joint - self.ambient, joint - REFERENCE
        made = copper * (1 + leg.resistance_rise * warm) / (1 - leg.torque_constant_drop * warm) ** 2
        convected = to_air * np.exp(leg.natural_convection * above) * above
        radiated = self.glow * ((joint + KELVIN) ** 4 - self.ambient_glow)
        heat: Array = self.exchange @ T + self.supply
        heat[:COUNT] += made + other - convected - radiated
        slope: Array = heat / self.capacity
        return slope

    def start(self, joints: Array) -> Array:
        """Return the state with the joints at these temperatures (degC), each hidden mass at its joint's."""
        return np.concatenate([joints, [joints[m.joint] for m in self.leg.masses]])

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
