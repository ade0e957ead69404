"""The pieces of a trade study: motors to choose from, sink, heat pipes, fan, the task, a sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lptn.arrays import FloatArray
from lptn.network import Network


@dataclass(frozen=True)
class MotorChoice:
    """A motor that may be chosen: its network and what the network does not say.

    Args:
        name: what people call it.
        network: its thermal network without a heat sink, or with one.
        winding: node whose temperature the enamel limits.
        magnet: node taken as the magnets' temperature, which sets the torque constant.
        mass: kg.
        volume: m³.
        torque_constant: N·m/A at 25 degC.
        magnet_coefficient: of the torque constant [1/K].
        limits: winding, magnet [degC] and current [A] of its data sheet, where known.
    """

    name: str
    network: Network
    winding: str
    magnet: str
    mass: float
    volume: float
    torque_constant: float
    magnet_coefficient: float
    limits: dict[str, float]


@dataclass(frozen=True)
class Sink:
    """Where a heat sink may be attached, within which bounds, and what its fins are like.

    Args:
        at: node that the heat pipes touch.
        node: name of the sink's own node.
        capacity: least and greatest heat capacity [J/K].
        resistance: least and greatest resistance to the air [K/W].
        thickness: of a fin [m].
        depth: of a fin, root to tip [m].
    """

    at: str
    node: str
    capacity: tuple[float, float]
    resistance: tuple[float, float]
    thickness: float
    depth: float


@dataclass(frozen=True)
class Pipes:
    """Heat pipes: how many may be chosen; resistance [K/W], power [W], mass [kg] of each; mass of their mount [kg]."""

    counts: tuple[int, ...]
    resistance: float
    power: float
    mass: float
    mount: float


@dataclass(frozen=True)
class Fan:
    """A fan: its mass with the battery for its runtime [kg], volume [m³], electrical power [W]."""

    mass: float
    volume: float
    power: float


@dataclass(frozen=True)
class Task:
    """What torque the motor must give, and for how long.

    Args:
        shape: torque in each equal part of a cycle, over its peak, shape (n,); one entry for a hold.
        torque: its peak [N·m], `None` where it is sought.
        duration: of a hold, or of one cycle [s]; `None` where it is sought.
        cycles: how many cycles from the start, `None` for ever (periodic); 1 for a hold.
        hold: whether torque is held constant.
        longest: a sought duration is not looked for beyond [s].
        ambient: degC.
        start: all nodes at the beginning [degC].
    """

    shape: FloatArray
    torque: float | None
    duration: float | None
    cycles: int | None
    hold: bool
    longest: float
    ambient: float
    start: float


@dataclass(frozen=True)
class Sweep:
    """Values of one given quantity (mass, volume, torque, duration) over which the study is solved again."""

    against: str
    values: tuple[float, ...]


def sweep_values(least: float, most: float, points: int) -> tuple[float, ...]:
    """Evenly spaced values from the least to the greatest."""
    return tuple(np.linspace(least, most, points).tolist())
