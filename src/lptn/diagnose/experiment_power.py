"""How far rivals' predictions of a run lie apart after each has done what it can to agree.

A rival may change its parameters as far as the old data leave them free: Gauss-Newton information of the old data
is the prior, and what the new run adds is solved for together. What is left is how much worse the wrong rival
explains the new run, in units of the sensors' noise: the noncentrality of the likelihood ratio.

Source: [AtkinsonFedorov1975] (T-optimal design for discrimination), with a prior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from lptn.arrays import FloatArray
from lptn.diagnose.refit import TIE, independent_readings, worse_by
from lptn.diagnose.stretches import misfits, stretches
from lptn.identify import Fit
from lptn.identify.problem import Problem
from lptn.logs import Run
from lptn.sensitivity import sensitivities
from lptn.simulate import drive

_START_SPREAD = 5.0  # K; a state's initial temperature may lie so far from the air's
_LOOSE = 10.0  # in the search's own scale (logarithms, typical sizes): a parameter that no data hold
_MODEL_ERROR, _LASTS = 0.03, 600.0  # K, s: no model of a real robot is better than this, however many readings
_EVEN = 3.3  # evidence so many times its scatter from stretch to stretch; from 3 on two fits differ clearly
_NO_SENSOR = 1e3  # K; a node that isn't measured tells nothing


@dataclass(frozen=True)
class Predicted:
    """A rival's prediction of one run.

    Args:
        readings: degC, shape (nodes, n).
        moved: their derivatives by the rival's parameters and initial states, shape (nodes, n, unknowns).
    """

    readings: FloatArray
    moved: FloatArray


@dataclass(frozen=True)
class Apart:
    """How one rival's prediction differs from another's after the other has adapted.

    Args:
        deviations: square root of the expected rise of the sum of squared weighted residuals.
        decisive: the same, less where few stretches of the run hold all of the evidence: what shows but once may
            be anything, and a refit calls such rivals tied.
        left: what is left of the difference [K], shape (nodes, n).
    """

    deviations: float
    decisive: float
    left: FloatArray


class Rivals:
    """Fits that the old data can't tell apart.

    Args:
        fits: the rivals, all of the same nodes and runs.
    """

    def __init__(self, fits: Sequence[Fit]) -> None:
        self.fits = list(fits)
        self._density = noise_density(min(self.fits, key=lambda each: each.cost))
        self._misfits = [misfits(each) for each in self.fits]
        self._priors = [self._prior(each) for each in self.fits]

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Each two of them once."""
        return list(combinations(range(len(self.fits)), 2))

    def predict(self, run: Run) -> list[Predicted]:
        """All predictions of a run.

        Raises:
            SimulationError: a model runs away.
        """
        return [_predicted(each, run) for each in self.fits]

    def apart(self, predictions: Sequence[Predicted], run: Run) -> dict[tuple[int, int], Apart]:
        """For each pair the less decisive of both ways round: whichever of the two is true, so much is to be seen.

        Args:
            predictions: of one run.
            run: that run.
        """
        weight = np.sqrt(run.step / self._density)
        rows = [(each.moved * weight[:, None, None]).reshape(-1, each.moved.shape[2]) for each in predictions]
        information = [prior + each.T @ each for prior, each in zip(self._priors, rows, strict=True)]
        found = {}
        for pair in self.pairs:
            difference = predictions[pair[0]].readings - predictions[pair[1]].readings
            both = []
            for true, wrong in self._ways(pair):
                rise, left = _absorbed(rows[wrong], information[wrong], difference, weight)
                before = self._misfits[wrong] - self._misfits[true]
                both.append(self._judged(rise, left, weight, run, before))
            found[pair] = min(both, key=lambda each: each.decisive)
        return found

    def _ways(self, pair: tuple[int, int]) -> list[tuple[int, int]]:
        """Which of a pair may be the true one and which the wrong one: what is decided already isn't asked again."""
        better, worse = sorted(pair, key=lambda number: self.fits[number].cost)
        open_still = worse_by(self.fits[worse], self.fits[better]) <= TIE
        return [(better, worse), (worse, better)] if open_still else [(better, worse)]

    def _judged(self, rise: float, left: FloatArray, weight: FloatArray, run: Run, before: FloatArray) -> Apart:
        """How decisive a difference is, together with what the old data say, stretch by stretch."""
        best = self.fits[0]
        repeats = run.step / _mean_step(best)
        squares = np.sum((left / best.problem.sigma[:, None]) ** 2, axis=0) * repeats
        new = np.bincount(stretches(drive(best.model, run)), squares)
        # What adapting to the new run costs on the old data shows all over them.
        seen = float(np.sum((left * weight[:, None]) ** 2))
        cost = new.sum() * max(rise - seen, 0.0) / seen if seen > 0 else 0.0
        evidence = np.concatenate([new, before + cost / len(before)])
        scatter = float(np.sqrt(np.sum((evidence - evidence.mean()) ** 2)))
        share = min(max(float(evidence.sum()) / (_EVEN * scatter), 0.0), 1.0) if scatter > 0 else 1.0
        deviations = float(np.sqrt(max(rise, 0.0)))
        return Apart(deviations, share * deviations, left)

    def _prior(self, done: Fit) -> FloatArray:
        """Information on parameters from the old data, on initial states from the robot's being at rest."""
        old = done.problem
        sigma = np.sqrt(self._density / _mean_step(done))
        hessian = Problem(old.model, old.drives, sigma, old.mirror_weight, old.free).normal(done.z)[1]
        free, states = len(old.free), len(done.model.states)
        across, starts = hessian[:free, free:], hessian[free:, free:]
        information = np.zeros((free + states, free + states))
        known = hessian[:free, :free] - across @ np.linalg.solve(starts, across.T)
        information[:free, :free] = 0.5 * (known + known.T) + np.eye(free) / _LOOSE**2
        information[free:, free:] = np.eye(states) / _START_SPREAD**2
        return information


def noise_density(done: Fit) -> FloatArray:
    """Variance of each node's readings times the time after which they are new information [K²s], shape (nodes,).

    The steps of a coarse sensor repeat their error for as long as the temperature stays within one: such readings
    count as often as their residuals' correlation in time allows. A small error of the model, which lasts, is added:
    a difference of hundredths of a kelvin is no evidence.
    """
    drives, errors = done.problem.drives, done.residuals
    repeated = max(1.0, done.problem.readings / independent_readings(done))
    variance = np.empty(len(done.model.nodes))
    for row, floor in enumerate(done.noise.floor):
        residual = np.concatenate([error[row][each.counted[row]] for error, each in zip(errors, drives, strict=True)])
        variance[row] = max(float(np.mean(residual**2)), floor**2) if residual.size else _NO_SENSOR**2
    return np.asarray(variance * repeated * _mean_step(done) + _MODEL_ERROR**2 * _LASTS)


def _mean_step(done: Fit) -> float:
    """Of the runs, each counted by its readings [s]."""
    drives = done.problem.drives
    counts = [int(driven.counted.sum()) for driven in drives]
    return float(np.average([driven.run.step for driven in drives], weights=counts))


def _predicted(done: Fit, run: Run) -> Predicted:
    model, free = done.model, done.problem.free
    # The fit's own choice of parameters: its stepper, compiled already, is used again.
    found = sensitivities(model, drive(model, run), model.values, free)
    moved = found.derivatives.copy()
    moved[:, :, : len(free)] *= done.problem.slope(model.values)
    nodes, starts = len(model.nodes), moved[:, :, len(free) :]
    starts[:, :, :nodes] += starts[:, :, nodes:] @ model.resting_shares
    return Predicted(found.readings, moved)


def _absorbed(
    rows: FloatArray, information: FloatArray, difference: FloatArray, weight: FloatArray
) -> tuple[float, FloatArray]:
    """The rise of the sum of squares that no change of a rival's parameters avoids, and the difference left [K]."""
    weighted = (difference * weight[:, None]).ravel()
    pull = rows.T @ weighted
    change = np.linalg.solve(information, pull)
    left = (weighted - rows @ change).reshape(difference.shape) / weight[:, None]
    return float(weighted @ weighted - pull @ change), left
