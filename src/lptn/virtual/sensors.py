"""What sensors show of the true temperatures: position, lag, clock, steps, noise, rounding, gaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .heat import REFERENCE, Balance
from .robot import Array, Robot, stream

HOT_SPOT = 3.0  # s, time constant of a hot spot


@dataclass(frozen=True)
class Probe:
    """How temperatures are read.

    Args:
        noise: standard deviation of the white noise of each reading, K.
        quantisation: step that readings are rounded to, K; 0 for none.
        dropouts: share of readings that are missing (NaN), 0 to 1.

    Raises:
        ValueError: a value outside its range.
    """

    noise: float = 0.15
    quantisation: float = 0.0
    dropouts: float = 0.0

    def __post_init__(self) -> None:
        for name in ("noise", "quantisation"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"{name}: found {value:g}; expected a number of kelvin, 0 or above")
        if not 0 <= self.dropouts < 1:
            raise ValueError(f"dropouts: found {self.dropouts:g}; expected a share from 0 to below 1")

    def read(self, temperature: Array, rng: np.random.Generator) -> Array:
        """Return readings of these temperatures (degC), same shape."""
        # Everything is drawn whether used or not, so that one option leaves the others' draws alone.
        disturbance, chance = rng.standard_normal(temperature.shape), rng.uniform(size=temperature.shape)
        readings = temperature + self.noise * disturbance
        if self.quantisation > 0:
            readings = np.round(readings / self.quantisation) * self.quantisation
        return np.where(chance < self.dropouts, np.nan, readings)


def noise_free_readings(network: Balance, states: Array, copper: Array) -> Array:
    """Return what the sensors would show (degC) at 0, 1, … s, of shape (seconds + 1, nodes with a sensor).

    Args:
        network: its robot's sensors, and the order of the states.
        states: degC at 0, 1, … s, of shape (seconds + 1, states).
        copper: loss at 25 degC in each second, W, of shape (seconds, nodes).
    """
    robot, count = network.robot, network.robot.sensed
    true = states[:, network.sensed]
    readings = true + _hot_spots(network, states, copper)
    for one, other, share in robot.positions:
        elsewhere = states[:, one] if other < 0 else true[:, other]
        readings[:, one] += share * (elsewhere - true[:, one])
    readings = lagged(readings, robot.lag[:count])
    if robot.clock:
        readings = _delayed(readings, robot.clock)
    return readings + np.arange(len(readings))[:, None] * robot.drift[:count] + robot.offset[:count]


def lagged(temperature: Array, lag: Array) -> Array:
    """Pass each column through a first-order lag, exactly for straight lines between the seconds.

    Args:
        temperature: degC at 0, 1, … s, of shape (seconds, joints).
        lag: time constants, s, one a column; 0 leaves the column as it is.
    """
    from scipy.signal import lfilter  # here, as it takes a second to import

    result = temperature.copy()
    for i in np.flatnonzero(lag > 0):
        keep = np.exp(-1 / lag[i])
        fresh = 1 - lag[i] * (1 - keep)
        taps = [fresh, 1 - keep - fresh]
        # The filter's memory is that of a sensor which has long been at the first temperature.
        memory = [(1 - fresh) * temperature[0, i]]
        result[:, i] = lfilter(taps, [1, -keep], temperature[:, i], zi=memory)[0]
    return result


def _hot_spots(network: Balance, states: Array, copper: Array) -> Array:
    """Return what hot spots have above the mass around them, K: at zero when the run begins."""
    from scipy.signal import lfilter

    robot, count = network.robot, network.robot.sensed
    above = np.zeros((len(states), count))
    for i in np.flatnonzero(robot.hot_spot[:count]):
        warm = states[:-1, network.copper[i]] - REFERENCE
        loss = copper[:, i] * (1 + robot.resistance_rise[i] * warm) / (1 - robot.torque_constant_drop[i] * warm) ** 2
        keep = np.exp(-1 / HOT_SPOT)
        above[1:, i] = lfilter([1 - keep], [1, -keep], robot.hot_spot[i] * loss)
    return above


def _delayed(readings: Array, delay: float) -> Array:
    """Return what was, or below 0 what will be, shown this many seconds away.

    Before the first second it was as it is then; after the last it goes on as it went.
    """
    seconds = np.arange(len(readings))
    ahead = np.ceil(-delay)
    last = readings[-1] + max(0, int(ahead)) * (readings[-1] - readings[-2])
    times, columns = np.append(seconds, seconds[-1] + max(1, ahead)), np.vstack([readings, last])
    return np.column_stack([np.interp(seconds - delay, times, column) for column in columns.T])


def sensor_steps(robot: Robot, seconds: int, seed: int, run: str) -> Array:
    """Return what steps add to the readings (K) in each second of a run, of shape (seconds, nodes)."""
    when = np.array([stream(seed, "step", run, node).uniform(0.2, 0.8) * seconds for node in robot.nodes])
    return (np.arange(seconds)[:, None] >= when) * robot.step


def by_place(quantity: str, values: Array, places: Sequence[str]) -> dict[str, Array]:
    """Return the columns ``<quantity>.<place>`` of a log, from values of shape (rows, places)."""
    return {f"{quantity}.{place}": values[:, i] for i, place in enumerate(places)}
