"""Hold the truth about a robot: what a tool under test may not see."""

from __future__ import annotations

import copy
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mass:
    """A mass that no sensor sees, tied to one node, or to several alike.

    capacity: J/K. joint: index of the node. resistance: to each node, K/W. to_air: conductance to the ambient, W/K.
    heat: its own, W. also: indices of further nodes.
    """

    capacity: float
    joint: int
    resistance: float
    to_air: float = 0.0
    heat: float = 0.0
    also: tuple[int, ...] = ()

    @property
    def ends(self) -> list[int]:
        """The nodes that it is tied to."""
        return [self.joint, *self.also]


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
    gear: Array = field(default_factory=_unset)
    """share of the mechanical power |τ ω|"""
    driver: Array = field(default_factory=_unset)
    """W/(N·m), on |τ|"""
    computer: Array = field(default_factory=_unset)
    """share of the computer's power that comes beside what its own node gets"""
    battery: Array = field(default_factory=_unset)
    """share of the battery's power"""
    sunlit: Array = field(default_factory=_unset)
    """absorptivity × area towards the sun, m²"""
    fanned: Array = field(default_factory=_unset)
    """in 1 + gamma × the fan's share of its full speed"""
    constant: Array = field(default_factory=_unset)
    """W"""
    masses: list[Mass] = field(default_factory=list)
    lag: Array = field(default_factory=_unset)
    """time constant of the sensor, s"""
    offset: Array = field(default_factory=_unset)
    """K, on the reading"""
    drift: Array = field(default_factory=_unset)
    """K/s, on the reading, from each run's beginning"""
    hot_spot: Array = field(default_factory=_unset)
    """K/W of copper loss, on the reading"""
    positions: list[tuple[int, int, float]] = field(default_factory=list)
    """(node, other, share of the other in the node's reading); the other is -1 for the node's own housing"""
    clock: float = 0.0
    """s by which the temperatures in the rows are old"""
    ambient_offset: float = 0.0
    """K, of the true ambient above the logged one"""
    ambient_lag: float = 0.0
    """time constant with which the true ambient follows the logged one, s"""
    ambient_swing: float = 0.0
    """K by which the logged ambient changes out of doors, in runs that don't say"""
    bursts: Array = field(default_factory=_unset)
    """W, while a burst lasts"""
    step: Array = field(default_factory=_unset)
    """K, on the reading after the step"""
    splash: Array = field(default_factory=_unset)
    """J taken away by each splash"""
    later: list[tuple[str, Callable[[Robot], None]]] = field(default_factory=list)
    """(run, what sets an effect in the robot of that run)"""

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

    def in_run(self, run: str) -> Robot:
        """Return the robot as it is in this run: a copy with what acts in it alone."""
        own = copy.deepcopy(replace(self, later=[]))
        for name, set_in in self.later:
            if name == run:
                set_in(own)
        return own

    def check_runs(self, runs: Collection[str]) -> None:
        """Refuse an effect in a run that there isn't.

        Raises:
            ValueError: it waits for a run not among these.
        """
        for name, _ in self.later:
            if name not in runs:
                raise ValueError(f"run: found {name!r}; expected one of {', '.join(runs)}")
