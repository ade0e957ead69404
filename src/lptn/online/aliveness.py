"""Whether each temperature sensor is alive, reading by reading, by what a filter expects of it.

The principle is that of `lptn.logs.silence`, which sees a whole log and no model: a sensor that is alive shows its
noise and follows the temperature. Here a reading that is bit for bit the last one again has a probability, for the
filter knows how far the temperature has moved within the sensor's steps and how far the noise reaches; of a sensor that
stands, it is 1. What these probabilities multiply to is the evidence. A reading that leaps further than noise and model
explain is not believed either, for as long as it is so far off.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.logs.silence import CHANCE

STANDS = float(-np.log(CHANCE))
"""Evidence that makes a sensor one that stands, as for whole logs."""
SHORTEST = 60.0  # s; nothing thermal is lost in less, and a sensor that stands still for so long is not called
LEAST_CHANCE = 1e-3  # of one reading like the one before: no single one decides
COARSEST = 5.0  # K; steps that a sensor may have of which nothing is known yet
LEAP = 6.0  # standard deviations of a reading from its prediction; chance gives one in 500 million
LEAST_LEAP = 3.0  # K; no smaller leap is a fault of the sensor rather than of the model
_SAME_TIME = 1e-6  # s
FEWEST = 5  # readings; of a sensor that gave fewer nothing says which of them was the leap


class Aliveness:
    """What is remembered of each sensor; arrays have one entry for each node.

    Args:
        noise: variance of the readings before rounding [K²], shape (nodes,).
        step: steps of the sensors [K], 0 where they are fine or not known, shape (nodes,).
    """

    def __init__(self, noise: FloatArray, step: FloatArray) -> None:
        count = noise.size
        self._noise, self._step = noise, step
        self.clock = 0.0
        """s since the first update."""
        self.last = np.full(count, np.nan)
        """degC, the last reading."""
        self.since = np.zeros(count)
        """s of the clock: the first of the readings that are like the last one."""
        self.silent = np.zeros(count, dtype=bool)
        """Whether the sensor stands."""
        self.far = np.zeros(count, dtype=bool)
        """Whether its last reading leapt."""
        self._far_since = np.zeros(count)
        self._evidence = np.zeros(count)
        self._grain = np.full(count, np.inf)  # K, the smallest move so far
        self._moves, self._due = np.zeros(count), np.zeros(count)  # moves seen, and to be expected
        self._taken = np.zeros(count)

    def judge(self, readings: FloatArray, predicted: FloatArray, variance: FloatArray) -> tuple[BoolArray, BoolArray]:
        """Look at the readings of one update.

        Args:
            readings: degC, NaN where missing, shape (nodes,).
            predicted: by the filter, which has not taken them in [degC], shape (nodes,).
            variance: of the predicted temperatures [K²], shape (nodes,).

        Returns:
            which readings may be taken in, and those among them in spite of a leap, since nothing says that the
            sensor leapt and not the filter, shape (nodes,) each.
        """
        seen = np.isfinite(readings)
        same, changed = seen & (readings == self.last), seen & np.isfinite(self.last) & (readings != self.last)
        grain = np.where(np.isfinite(self._grain), self._grain, np.where(self._step > 0, self._step, COARSEST))
        cell, spread = np.maximum(self._step, grain), np.sqrt(variance + self._noise)
        with np.errstate(invalid="ignore"):
            away = readings - predicted
            inside = ndtr((away + cell / 2) / spread) - ndtr((away - cell / 2) / spread)
            # A topic repeats its last value until the next one comes: only so large a share of readings is new.
            fresh = np.minimum((self._moves + 1) / (self._due + 1), 1.0)
            chance = np.maximum(1 - fresh * (1 - inside), LEAST_CHANCE)
            far = seen & (np.abs(away) > np.maximum(LEAP * np.sqrt(spread**2 + cell**2 / 12), LEAST_LEAP))
        self._evidence[same] -= np.log(chance[same])
        self._evidence[changed] = 0.0
        self._grain[changed] = np.minimum(self._grain, np.abs(readings - self.last))[changed]
        self.since[seen & ~same] = self.clock
        counted = seen & ~(self.silent | far)
        self._moves += counted & changed
        self._due[counted] += 1 - inside[counted]
        self.last = np.where(seen, readings, self.last)
        lasting = self.clock - self.since >= SHORTEST
        self.silent = np.where(seen, same & (self.silent | ((self._evidence > STANDS) & lasting)), self.silent)
        self._far_since = np.where(far & self.far, self._far_since, self.clock)
        self.far = np.where(seen, far, self.far)
        # A filter that most sensors contradict for long is itself wrong.
        most = 2 * np.count_nonzero(far & ~self.silent) > np.count_nonzero(seen & ~self.silent)
        doubtful = (self._taken < FEWEST) | (most & (self.clock - self._far_since >= SHORTEST))
        again = far & doubtful & ~self.silent
        taken = seen & ~self.silent & (~far | again)
        self._taken += taken
        return taken, again

    def silent_at(self, clock: float) -> BoolArray:
        """Of the sensors that stand, those that already stood at a time [s of the clock], shape (nodes,).

        The first of the readings that stand was one, unless the sensor has never moved.
        """
        first = np.where(np.isfinite(self._grain), self.since + _SAME_TIME, self.since - _SAME_TIME)
        return np.asarray(self.silent & (clock > first))

    def why_not(self, node: int) -> str:
        """Why a sensor is not believed at present, in words; "" where it is."""
        if self.silent[node]:
            return f"has read {self.last[node]:.6g} degC, bit for bit, for {self.clock - self.since[node]:.0f} s"
        if self.far[node]:
            lasting = self.clock - self._far_since[node]
            return f"has been far from what is expected for {lasting:.0f} s, and reads {self.last[node]:.6g} degC"
        return ""

    def state(self) -> FloatArray:
        """All that is remembered, shape (11, nodes)."""
        clock = np.full(self.last.size, self.clock)
        return np.array([clock, *(np.asarray(array, dtype=float) for array in self._remembered())])

    def restore(self, state: FloatArray) -> None:
        """Go on from what `state` returned."""
        self.clock = float(state[0, 0])
        self.last, self.since, silent, far, self._far_since, self._evidence = (row.copy() for row in state[1:7])
        self._grain, self._moves, self._due, self._taken = (row.copy() for row in state[7:])
        self.silent, self.far = silent > 0, far > 0

    def _remembered(self) -> tuple[FloatArray | BoolArray, ...]:
        first = (self.last, self.since, self.silent, self.far, self._far_since, self._evidence)
        return (*first, self._grain, self._moves, self._due, self._taken)
