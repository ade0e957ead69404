"""Say what the temperature sensors would show without noise: where they sit, how late, how wrong."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from .robot import Array
from .sensors import lagged
from .solve import REFERENCE, Network

SPOT = 3.0  # s, time constant of a hot spot


def shown(network: Network, states: Array, copper: Array, before: int = 0) -> Array:
    """Return what the sensors would show (degC) at 0, 1, … s, of shape (seconds + 1, nodes with a sensor).

    Args:
        network: its robot's sensors, and the order of the states.
        states: degC at 0, 1, … s, of shape (seconds + 1, states).
        copper: loss at 25 degC in each second, W, of shape (seconds, nodes).
        before: s that happened before the log begins; they aren't returned.
    """
    robot, count = network.robot, network.robot.sensed
    true = states[:, network.sensed]
    seen = true + _hot_spots(network, states, copper)
    for one, other, share in robot.positions:
        there = states[:, one] if other < 0 else true[:, other]
        seen[:, one] += share * (there - true[:, one])
    seen = lagged(seen, robot.lag[:count])[before:]
    if robot.clock:
        seen = _late(seen, robot.clock)
    return seen + np.arange(len(seen))[:, None] * robot.drift[:count] + robot.offset[:count]


def _hot_spots(network: Network, states: Array, copper: Array) -> Array:
    """Return what hot spots have above the mass around them, K: at zero when the run begins."""
    robot, count = network.robot, network.robot.sensed
    above = np.zeros((len(states), count))
    for i in np.flatnonzero(robot.hot_spot[:count]):
        warm = states[:-1, network.copper[i]] - REFERENCE
        made = copper[:, i] * (1 + robot.resistance_rise[i] * warm) / (1 - robot.torque_constant_drop[i] * warm) ** 2
        keep = np.exp(-1 / SPOT)
        above[1:, i] = lfilter([1 - keep], [1, -keep], robot.hot_spot[i] * made)
    return above


def _late(seen: Array, delay: float) -> Array:
    """Return what was, or below 0 what will be, seen this many seconds away.

    Before the first second it was as it is then; after the last it goes on as it went.
    """
    seconds = np.arange(len(seen))
    past = max(0, int(np.ceil(-delay))) * (seen[-1] - seen[-2])
    known, columns = np.append(seconds, seconds[-1] + max(1, np.ceil(-delay))), np.vstack([seen, seen[-1] + past])
    return np.column_stack([np.interp(seconds - delay, known, column) for column in columns.T])
