"""Whether each temperature sensor is alive, reading by reading, by what a model without it expects.

Each reading is compared with its *reference*, one prediction that takes in no reading: the model alone since the start;
of a sensor that was never trusted, from what it read when it last contradicted. A node follows the heat that is put in:
so a sensor is trusted once it has moved as its reference did, for half a minute at least, and as long as it agrees with
it. Until then limits are planned by the hotter of the two. A sensor that contradicts its reference, or stays where it
is while that moves, is lost. It is trusted again when it has agreed for as long as it contradicted or, where that was
over a minute or not the first time that it contradicted without having moved, for as long as its node takes to settle,
and has moved as the model does; as much time again has to pass until that is forgotten. A sensor that repeats its last
reading bit for bit for longer than noise, steps and the model's movement explain is lost, too. The C code of
`lptn.planners.mpc` judges each reading alike, with the constants of this file; what a filter does with the verdict is
its own.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.logs.silence import CHANCE

ERROR = 0.2
"""Relative error of heat flows in the model that tests sensors, whatever its stated accuracy: a model is rarely worse,
and a better one gains nothing that would be worth a healthy sensor."""
BELOW = 3.5
"""Standard deviations below the reference. Chance makes a model so wrong in one node of 4000, sensors fail oftener."""
BELOW_IF_LOST = 2.0
"""The same for a sensor that has been lost: a fault is no longer rare for it."""
MISLEADS = 2.5
"""Standard deviations by which the model must be wrong for cold readings where the sensor is the likelier culprit."""
ABOVE = 6.0
"""Standard deviations above it: to disbelieve a hot sensor burns motors, to disbelieve a cold one costs torque."""
NOISE = 6.0  # standard deviations of a reading; chance gives one in 500 million
LEAST = 1.0  # K; the accuracy of sensors of motors, and the least movement (root sum of squares) by which one is known
LEAST_SHARE = 0.1
"""Of the reference's movement, root mean square: a sensor that moves by less, beside a reference that moves, does not
follow it, however little is known of the model. No model of a machine is wrong tenfold."""
FOLLOWS = 0.7
"""Of the reference's movement, that a sensor has to make to follow it: with every value 10 % off it makes 0.8."""
FEWEST = 4  # readings; the regression of one on the other needs two, its scatter more
STANDS = float(-np.log(CHANCE))
"""Evidence from which a sensor counts as frozen, as for whole logs."""
SHORTEST = 60.0  # s; nothing thermal is lost in less
LEAST_CHANCE = 1e-3  # of one reading like the one before: no single one decides
COARSEST = 5.0  # K; steps that a sensor may have of which nothing is known yet
_ARRAYS = ("last", "since", "evidence", "grain", "moves", "due", "agreed_for", "contradicted_for",
           "stands", "agrees", "proven", "trusted", "lost")  # fmt: skip
_FLAGS = _ARRAYS[-5:]


class LivingSensors:
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
        self.last, self.since = np.full(count, np.nan), np.zeros(count)
        """degC, the last reading; s of the clock, the first of those that are like it."""
        self.evidence = np.zeros(count)
        self.grain = np.full(count, np.inf)  # K, the smallest move so far
        self.moves, self.due = np.zeros(count), np.zeros(count)  # moves seen, and to be expected
        self.agreed_for = np.zeros(count)
        """s for which each has agreed with its reference."""
        self.regression = np.zeros((6, count))
        """Readings and reference since then: count, means of reference and reading, sums of squares and products."""
        self.contradicted_for = np.full(count, SHORTEST / 2)
        """s for which it had contradicted its reference before, less those for which it has been trusted again.

        At first none has shown anything."""
        self.stands, self.agrees, self.proven = (np.zeros(count, dtype=bool) for _ in range(3))
        """Whether it repeats itself bit for bit; agrees with its reference; has moved as its reference did."""
        self.trusted, self.lost = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        """Whether its readings may be taken in; whether it was found not to be alive and has not come back."""

    def judge(
        self,
        seconds: float,
        readings: FloatArray,
        predicted: FloatArray,
        variance: FloatArray,
        reference: FloatArray,
        deviation: FloatArray,
        learned: FloatArray,
        settles: FloatArray,
    ) -> None:
        """Look at the readings of one update; arrays have shape (nodes,).

        Args:
            seconds: since the last update.
            readings: degC, NaN where missing.
            predicted: by the filter, which has not taken them in [degC].
            variance: of the predicted temperatures [K²].
            reference: the same without the sensor [degC].
            deviation: of the reference, its standard deviation [K].
            learned: what the model must be wrong by for the readings to be true, in standard deviations, negative where
                it must cool the node; infinite where no values of its parameters explain them.
            settles: time constants of the nodes [s].
        """
        noise, seen = np.sqrt(self._noise + self._step**2 / 12), np.isfinite(readings)
        below = np.where(self.lost, BELOW_IF_LOST, BELOW)
        with np.errstate(invalid="ignore", divide="ignore"):
            away = readings - reference
            near = away >= -np.maximum(below * deviation + NOISE * noise, LEAST)
            near &= away <= np.maximum(ABOVE * deviation + NOISE * noise, LEAST)
            near &= np.abs(readings - predicted) <= LEAST + NOISE * np.sqrt(np.maximum(variance, 0) + noise**2)
            misleads = (learned < -np.where(self.proven, MISLEADS, BELOW)) | (learned > ABOVE)
            self._watch_repeats(seen, readings, predicted, variance, near)
            agrees = seen & near & ~misleads & ~self.stands
            begins = agrees & ~self.agrees
            self.agreed_for = np.where(begins, 0.0, self.agreed_for + seconds * agrees)
            self.regression[:, begins] = 0.0
            self.proven |= self._follow_reference(agrees, readings, reference, noise)
            count, _, _, squares, of_readings, _ = self.regression
            idle = agrees & (squares >= count * LEAST**2) & (of_readings + count * noise**2 < LEAST_SHARE**2 * squares)
            agrees &= ~idle
        contradicts = seen & ~agrees
        contradicted_for = self.contradicted_for + seconds
        gone = misleads | idle | (contradicted_for > SHORTEST) | (self.lost & ~self.proven)
        contradicted_for = np.where(gone, np.maximum(settles, SHORTEST), contradicted_for)
        contradicted_for = np.where(self.stands, np.minimum(self.clock - self.since, settles), contradicted_for)
        self.contradicted_for = np.where(contradicts, contradicted_for, self.contradicted_for)
        self.proven &= ~(contradicts & ((self.contradicted_for > SHORTEST) | misleads | idle))
        earned = self.agreed_for >= self.contradicted_for
        self.agrees = np.where(seen, agrees, self.agrees)
        self.trusted = np.where(seen, agrees & self.proven & earned, self.trusted)
        self.lost = (self.lost | contradicts) & ~(seen & self.trusted)
        self.contradicted_for -= np.minimum(seconds, self.contradicted_for) * (seen & self.trusted)

    def _follow_reference(
        self, agrees: BoolArray, readings: FloatArray, reference: FloatArray, noise: FloatArray
    ) -> BoolArray:
        """Which sensors have moved as their reference did: by the regression of one on the other since they agree."""
        count, mean_reference, mean_reading, squares, of_readings, products = self.regression
        count += agrees
        along = np.where(agrees, reference - mean_reference, 0.0)
        up = np.where(agrees, readings - mean_reading, 0.0)
        mean_reference += along / np.maximum(count, 1)
        mean_reading += up / np.maximum(count, 1)
        squares += np.where(agrees, along * (reference - mean_reference), 0.0)
        of_readings += np.where(agrees, up * (readings - mean_reading), 0.0)
        products += np.where(agrees, along * (readings - mean_reading), 0.0)
        slope = products / squares
        scatter = np.sqrt(np.maximum(of_readings - slope * products, 0) / (count - 2))
        enough = agrees & (count >= FEWEST) & (squares >= LEAST**2) & (slope >= FOLLOWS)
        return np.asarray(enough & (slope * np.sqrt(squares) >= NOISE * np.maximum(scatter, noise)))

    def _watch_repeats(
        self, seen: BoolArray, readings: FloatArray, predicted: FloatArray, variance: FloatArray, counts: BoolArray
    ) -> None:
        """Count towards sensors that stand."""
        same, changed = seen & (readings == self.last), seen & np.isfinite(self.last) & (readings != self.last)
        grain = np.where(np.isfinite(self.grain), self.grain, np.where(self._step > 0, self._step, COARSEST))
        cell, spread = np.maximum(self._step, grain), np.maximum(np.sqrt(variance + self._noise), 1e-12)
        away = readings - predicted
        # Chance that this reading lies within a step of what is predicted.
        inside = ndtr((away + cell / 2) / spread) - ndtr((away - cell / 2) / spread)
        # A topic repeats its last value until the next one comes: only so large a share of readings is new.
        fresh = np.minimum((self.moves + 1) / (self.due + 1), 1.0)
        chance = np.maximum(1 - fresh * (1 - inside), LEAST_CHANCE)
        self.evidence[same] -= np.log(chance[same])
        self.evidence[changed] = 0.0
        self.grain[changed] = np.minimum(self.grain, np.abs(readings - self.last))[changed]
        self.since[seen & ~same] = self.clock
        counted = seen & counts & ~self.stands
        self.moves += counted & changed
        self.due[counted] += 1 - inside[counted]
        self.last = np.where(seen, readings, self.last)
        lasting = self.clock - self.since >= SHORTEST
        self.stands = np.where(seen, same & (self.stands | ((self.evidence > STANDS) & lasting)), self.stands)

    def why_not(self, node: int) -> str:
        """Why a sensor is not used at present, in words; "" where it is used, or has not yet shown that it works."""
        if self.stands[node]:
            return f"has read {self.last[node]:.6g} degC, bit for bit, for {self.clock - self.since[node]:.0f} s"
        if self.lost[node]:
            return f"reads {self.last[node]:.6g} degC, which the heat put in contradicts"
        return ""

    def state(self) -> FloatArray:
        """All that is remembered, shape (20, nodes)."""
        clock = np.full(self.last.size, self.clock)
        return np.array([clock, *self.regression, *(np.asarray(getattr(self, name), dtype=float) for name in _ARRAYS)])

    def restore(self, state: FloatArray) -> None:
        """Go on from what `state` returned."""
        self.clock = float(state[0, 0])
        self.regression = state[1:7].copy()
        for name, row in zip(_ARRAYS, state[7:], strict=True):
            setattr(self, name, row > 0 if name in _FLAGS else row.copy())
