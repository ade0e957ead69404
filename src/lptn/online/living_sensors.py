"""Whether a temperature sensor is alive, reading by reading, by what a model without it expects.

Each reading is compared with its *reference*, one prediction that takes in no reading: the model alone since the start
(in `Estimator`, of a sensor that was never trusted, from what it read when it last contradicted). A node follows the
heat that is put in: so a sensor is trusted once it has moved as its reference did, for half a minute at least, and as
long as it agrees with it. Until then limits are planned by the hotter of the two. A sensor that contradicts its
reference, or stays where it is while that moves, is lost. It is trusted again when it has agreed for as long as it
contradicted or, where that was over a minute or not the first time that it contradicted without having moved, for as
long as its node takes to settle, and has moved as the model does; as much time again has to pass until that is
forgotten. A sensor that repeats its last reading bit for bit for longer than noise, steps and the model's movement
explain is lost, too. The C code of `lptn.planners.mpc` judges each reading alike, with the constants of this file; what
a filter does with the verdict is its own.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.special import ndtr

from lptn.basics.arrays import FloatArray
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
FEWEST = 4  # readings; a regression of one on the other needs two, its scatter more; a mass within shows late
STANDS = -math.log(CHANCE)
"""Evidence from which a sensor counts as frozen, as for whole logs."""
SHORTEST = 60.0  # s; nothing thermal is lost in less
LEAST_CHANCE = 1e-3  # of one reading like the one before: no single one decides
COARSEST = 5.0  # K; steps that a sensor may have of which nothing is known yet


class LivingSensor:
    """What is remembered of one sensor; plain numbers, all but its noise and step.

    Args:
        noise: variance of the readings before rounding [K²].
        step: of the sensor [K], 0 where it is fine or not known.
    """

    def __init__(self, noise: float, step: float) -> None:
        self._noise, self._step = noise, step
        self.clock = 0.0
        """s since the first update."""
        self.last, self.since = math.nan, 0.0
        """degC, the last reading; s of the clock, the first of those that are like it."""
        self.evidence = 0.0
        self.grain = math.inf  # K, the smallest move so far
        self.moves, self.due = 0.0, 0.0  # moves seen, and to be expected
        self.agreed_for = 0.0
        """s for which it has agreed with its reference. Since then of readings and reference, in `regression`:"""
        self.regression = [0.0] * 6
        """Count, means of reference and reading, sums of squares and products."""
        self.contradicted_for = SHORTEST / 2
        """s for which it had contradicted its reference before, less those for which it has been trusted again.

        At first it has not shown anything."""
        self.stands = self.agrees = self.proven = False
        """Whether it repeats itself bit for bit; agrees with its reference; has moved as its reference did."""
        self.trusted = self.lost = self.once_trusted = self.used = False
        """Whether its readings may be taken in; whether it was found not to be alive and has not come back; whether it
        was ever trusted; whether the filter has taken in what it reads."""
        self.began, self.deviation = 0.0, 0.0
        """The model alone at its node: degC at which it began; K, its standard deviation."""
        self.settles = 0.0
        """s, time constant of its node."""
        self.woken = 0.0
        """K, of a sensor that was never trusted: what it read when it last contradicted, less the model alone."""

    def wait(self, seconds: float, settles: float, rate: float) -> None:
        """Pass time: the model alone becomes less sure, and what a sensor without trust has read is forgotten.

        Args:
            seconds: that pass.
            settles: time constant of the node [s].
            rate: how far off the model's rate may be, one standard deviation [K/s].
        """
        stays = math.exp(-seconds / settles)
        self.clock, self.settles = self.clock + seconds, settles
        self.deviation = stays * self.deviation + settles * (1 - stays) * rate
        self.woken *= stays

    def judge(
        self,
        seconds: float,
        reading: float,
        predicted: float,
        variance: float,
        reference: float,
        learned: float = 0.0,
        *,
        repeats: bool = True,
    ) -> None:
        """Look at the reading of one update; nothing is known of a missing one.

        Args:
            seconds: since the last update.
            reading: degC, NaN where missing.
            predicted: by the filter, which has not taken it in [degC].
            variance: of the predicted temperature [K²].
            reference: the same without the sensor [degC].
            learned: what the model must be wrong by for the reading to be true, in standard deviations, negative where
                it must cool the node; infinite where no values of its parameters explain it.
            repeats: whether a reading that repeats bit for bit counts.
        """
        if not math.isfinite(reading):
            return
        noise = math.sqrt(self._noise + self._step**2 / 12)
        away, below = reading - reference, BELOW_IF_LOST if self.lost else BELOW
        near = -max(below * self.deviation + NOISE * noise, LEAST) <= away
        near = near and away <= max(ABOVE * self.deviation + NOISE * noise, LEAST)
        near = near and abs(reading - predicted) <= LEAST + NOISE * math.sqrt(max(variance, 0.0) + noise**2)
        misleads = learned < -(MISLEADS if self.proven else BELOW) or learned > ABOVE
        if repeats:
            self._watch_repeats(reading, predicted, max(variance, 0.0), near)
        self.last = reading
        idle = False
        if near and not misleads and not self.stands:
            if not self.agrees:
                self.agrees, self.agreed_for, self.regression = True, -seconds, [0.0] * 6
            self.proven |= self._follows_reference(reading, reference, noise)
            count, _, _, squares, of_readings, _ = self.regression
            idle = count >= FEWEST and squares >= count * LEAST**2
            idle = idle and of_readings + count * noise**2 < LEAST_SHARE**2 * squares
            if not idle:
                self.agreed_for += seconds
                self.trusted = self.proven and self.agreed_for >= self.contradicted_for
                if self.trusted:
                    self.contradicted_for, self.lost = max(self.contradicted_for - seconds, 0.0), False
                return
        self.contradicted_for += seconds
        if self.stands:
            self.contradicted_for = min(self.clock - self.since, self.settles)
        elif misleads or idle or self.contradicted_for > SHORTEST or (self.lost and not self.proven):
            self.contradicted_for = max(self.settles, SHORTEST)
        self.proven &= not (misleads or idle or self.contradicted_for > SHORTEST)
        self.agrees, self.trusted, self.lost = False, False, True

    def _follows_reference(self, reading: float, reference: float, noise: float) -> bool:
        """Whether it has moved as its reference did: by the regression of one on the other since they agree."""
        sums = self.regression
        sums[0] += 1
        along, up = reference - sums[1], reading - sums[2]
        sums[1] += along / sums[0]
        sums[2] += up / sums[0]
        sums[3] += along * (reference - sums[1])
        sums[4] += up * (reading - sums[2])
        sums[5] += along * (reading - sums[2])
        count, _, _, squares, of_readings, products = sums
        if count < FEWEST or squares < LEAST**2:
            return False
        slope = products / squares
        scatter = math.sqrt(max(of_readings - slope * products, 0.0) / (count - 2))
        return slope >= FOLLOWS and slope * math.sqrt(squares) >= NOISE * max(scatter, noise)

    def _watch_repeats(self, reading: float, predicted: float, variance: float, counts: bool) -> None:
        """Count towards a sensor that stands."""
        same, changed = reading == self.last, math.isfinite(self.last) and reading != self.last
        grain = self.grain if math.isfinite(self.grain) else self._step if self._step > 0 else COARSEST
        cell, spread = max(self._step, grain), max(math.sqrt(variance + self._noise), 1e-12)
        away = reading - predicted
        # Chance that this reading lies within a step of what is predicted.
        inside = float(ndtr((away + cell / 2) / spread) - ndtr((away - cell / 2) / spread))
        if same:
            # A topic repeats its last value until the next one comes: only so large a share of readings is new.
            fresh = min((self.moves + 1) / (self.due + 1), 1.0)
            self.evidence -= math.log(max(1 - fresh * (1 - inside), LEAST_CHANCE))
        else:
            self.since = self.clock
        if changed:
            self.evidence, self.grain = 0.0, min(self.grain, abs(reading - self.last))
        if counts and not self.stands:
            self.moves, self.due = self.moves + changed, self.due + 1 - inside
        lasting = self.evidence > STANDS and self.clock - self.since >= SHORTEST
        self.stands = same and (self.stands or lasting)

    @property
    def why_not(self) -> str:
        """Why it is not used at present, in words; "" where it is used, or has not yet shown that it works."""
        if self.stands:
            return f"has read {self.last:.6g} degC, bit for bit, for {self.clock - self.since:.0f} s"
        return f"reads {self.last:.6g} degC, which the heat put in contradicts" if self.lost else ""

    def state(self) -> FloatArray:
        """All that is remembered, shape (numbers,); noise and step, which may be known better later, are not."""
        return np.hstack([np.asarray(value, dtype=float) for value in self._remembered().values()])

    def restore(self, state: FloatArray) -> None:
        """Go on from what `state` returned."""
        numbers = iter(state.tolist())
        for name, own in self._remembered().items():
            setattr(self, name, [next(numbers) for _ in own] if isinstance(own, list) else type(own)(next(numbers)))

    def _remembered(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in ("_noise", "_step")}
