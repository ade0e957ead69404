"""Turn true temperatures into readings: lag, noise, rounding, gaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from .truth import Array


@dataclass(frozen=True)
class Sensor:
    """How the joints' temperatures are read.

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
        disturbance, luck = rng.standard_normal(temperature.shape), rng.uniform(size=temperature.shape)
        readings = temperature + self.noise * disturbance
        if self.quantisation > 0:
            readings = np.round(readings / self.quantisation) * self.quantisation
        return np.where(luck < self.dropouts, np.nan, readings)


def lagged(temperature: Array, lag: Array) -> Array:
    """Pass each column through a first-order lag, exactly for straight lines between the seconds.

    Args:
        temperature: degC at 0, 1, … s, of shape (seconds, joints).
        lag: time constants, s, one a column; 0 leaves the column as it is.
    """
    result = temperature.copy()
    for i in np.flatnonzero(lag > 0):
        keep = np.exp(-1 / lag[i])
        fresh = 1 - lag[i] * (1 - keep)
        taps = [fresh, 1 - keep - fresh]
        # The filter's memory is that of a sensor which has long been at the first temperature.
        memory = [(1 - fresh) * temperature[0, i]]
        result[:, i] = lfilter(taps, [1, -keep], temperature[:, i], zi=memory)[0]
    return result
