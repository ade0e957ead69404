"""Hold the truth about a robot: what a tool under test may not see."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mass:
    """A mass that no sensor sees, tied to one node.

    capacity: J/K. joint: index of the node. resistance: to the node, K/W. to_air: conductance to the ambient, W/K.
    heat: its own, W.
    """

    capacity: float
    joint: int
    resistance: float
    to_air: float = 0.0
    heat: float = 0.0


def _unset() -> Array:
    return np.zeros(0)


@dataclass
class Robot:
    """The truth about one robot. Arrays have one entry a node, in the order of ``nodes``.

    The first six fields are the baseline. All below is zero there: it is what richer physics and hidden effects set.
    """

    nodes: tuple[str, ...]
    """joints first, then other nodes with a sensor, then nodes without one"""
    capacity: Array
    """J/K"""
    to_air: Array
    """conductance to the ambient, W/K"""
    links: list[tuple[int, int, float]]
    """(node, node, conductance in W/K)"""
    resistance: Array
    """winding resistance at 25 degC, ohm; 0 where there is no motor"""
    torque_constant: Array
    """torque at the joint per ampere at 25 degC, N·m/A; 1 where there is no motor"""

    joints: int = -1
    """how many of the nodes are joints; -1 for all"""
    sensed: int = -1
    """how many of the nodes have a sensor; -1 for all"""
    drive: Array = field(default_factory=_unset)
    """W, while the joint is powered"""
    winding: Array = field(default_factory=_unset)
    """J/K of a winding apart from the node, which then is the housing: it makes the copper's heat and has the sensor;
    0 where winding and housing are one"""
    inside: Array = field(default_factory=_unset)
    """K/W between winding and housing"""
    resistance_rise: Array = field(default_factory=_unset)
    """1/K"""
    torque_constant_drop: Array = field(default_factory=_unset)
    """1/K"""
    natural_convection: Array = field(default_factory=_unset)
    """1/K, in exp(beta (T - ambient))"""
    forced_convection: Array = field(default_factory=_unset)
    """s/m, in 1 + gamma |v|^exponent"""
    wind_exponent: float = 1.0
    emissive_area: Array = field(default_factory=_unset)
    """emissivity × area, m²"""
    coulomb: Array = field(default_factory=_unset)
    """N·m"""
    viscous: Array = field(default_factory=_unset)
    """N·m·s"""
    iron: Array = field(default_factory=_unset)
    """W/(rad/s)^1.5"""
    constant: Array = field(default_factory=_unset)
    """W"""
    masses: list[Mass] = field(default_factory=list)
    lag: Array = field(default_factory=_unset)
    """time constant of the sensor, s"""
    offset: Array = field(default_factory=_unset)
    """K, on the reading"""
    bursts: Array = field(default_factory=_unset)
    """W, while a burst lasts"""
    step: Array = field(default_factory=_unset)
    """K, on the reading after the step"""
    splash: Array = field(default_factory=_unset)
    """J taken away by each splash"""

    def __post_init__(self) -> None:
        count = len(self.nodes)
        self.joints = count if self.joints < 0 else self.joints
        self.sensed = count if self.sensed < 0 else self.sensed
        for one in fields(self):
            value = getattr(self, one.name)
            if isinstance(value, np.ndarray) and value.size == 0:
                setattr(self, one.name, np.zeros(count))

    @property
    def seen(self) -> tuple[str, ...]:
        """The nodes that have a sensor."""
        return self.nodes[: self.sensed]
