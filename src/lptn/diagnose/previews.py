"""What an effect would change in runs that no fit saw, to first order: shown before anybody refits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.processes import one_blas_thread
from lptn.diagnose.candidates import Site
from lptn.diagnose.scores import Score, derivatives, granted_no_more
from lptn.identify.comparison import Prediction, predict, with_own_errors
from lptn.identify.data import Segment
from lptn.identify.fitting import Fit, nuisances
from lptn.model.model import Model
from lptn.simulate.bound_run import bind, start_from
from lptn.simulate.simulation import sensitivity_windows


@one_blas_thread
def previews(fit: Fit, scores: Sequence[Score], segments: Sequence[Segment]) -> list[list[Prediction]]:
    """Runs as they would be predicted with each candidate added and all else refitted, to first order.

    The candidate has its first-order size, and the fitted parameters take back what they can imitate of it in the
    fitted runs; the start of a run goes with both, as its first readings have it.

    Args:
        fit: the baseline that was scored.
        scores: of the candidates.
        segments: runs that were not fitted.

    Returns:
        For each segment what is predicted with each candidate.

    Raises:
        InputError: a run lacks an input of a candidate.
    """
    places = list(dict.fromkeys(site for each in scores for site in each.candidate.sites(each.shape)))
    acts = [set(each.candidate.sites(each.shape)) for each in scores]
    sizes = np.array(
        [[each.amplitude * (site in own) for each, own in zip(scores, acts, strict=True)] for site in places]
    )
    if not segments or not sizes.size:
        return [[] for _ in segments]
    steps = np.vstack([_adapted(fit, places, sizes), sizes])
    return [_moved(fit, places, steps, segment) for segment in segments]


def _adapted(fit: Fit, places: Sequence[Site], sizes: FloatArray) -> FloatArray:
    """By how much each candidate moves the fitted parameters, in their units, (free parameters, candidates)."""
    baseline, by_site = derivatives(fit, places)
    able = ~granted_no_more(fit, baseline.T @ fit.problem.residuals(fit.z))
    moved = np.zeros((baseline.shape[1], sizes.shape[1]))
    length = np.maximum(np.linalg.norm(baseline[:, able], axis=0), np.finfo(float).tiny)
    moved[able] = -np.linalg.lstsq(baseline[:, able] / length, by_site @ sizes)[0] / length[:, None]
    count = len(fit.problem.free)
    return np.asarray(moved[:count] * fit.problem.slope(fit.point.values)[:, None])


def _moved(fit: Fit, places: Sequence[Site], steps: FloatArray, segment: Segment) -> list[Prediction]:
    """A run with the steps of the parameters and of the candidates' sizes, (parameters + places, candidates)."""
    sigma = fit.problem.sigma
    as_it_is = predict(fit.model, segment, sigma)
    own = with_own_errors(fit.model, segment, sigma)
    full = Model(fit.model.network.with_effects(site.declaration() for site in places))
    index = {parameter.name: number for number, parameter in enumerate(full.parameters)}
    values = full.values
    for parameter, value in zip(own.parameters, own.values, strict=True):
        if parameter.name in index:  # what is granted to a fitted run gives way to a candidate that names it
            values[index[parameter.name]] = value
    fitted = [index.get(own.parameters[number].name) for number in fit.problem.free]
    steps = np.delete(steps, [row for row, number in enumerate(fitted) if number is None], axis=0)
    granted = nuisances(full, segment.run.name)
    chosen = [number for number in fitted if number is not None]
    chosen += [*(index[site.amplitude_name] for site in places), *granted]
    states = dict(zip(own.states, as_it_is.states[:, 0].tolist(), strict=True))
    bound = bind(full, segment.run)
    windows = sensitivity_windows(full, bound, values, chosen, start_from(full, bound, states), len(own.states))
    by_all = np.concatenate([piece.derivatives for _, piece in windows], axis=1)
    by_step, by_own, by_start = np.split(by_all, [len(steps), len(chosen)], axis=2)
    change = by_step @ steps
    if granted:  # the run's own errors were fitted to all of it, and make room for what a candidate explains
        every = bound.count((segment.initialisation[0], segment.evaluation[1])).counted
        declared = [full.parameters[number].declared for number in granted]
        spread = np.array([each.prior or 1.0 for each in declared])
        rows = np.concatenate([by_own, by_start], axis=2)[every] * _weight(every, sigma)
        rows = np.vstack([rows, np.hstack([np.diag(1.0 / spread), np.zeros((len(granted), by_start.shape[2]))])])
        left = (as_it_is.readings - bound.measured)[every][:, None] + change[every]
        left = np.vstack(
            [left * _weight(every, sigma), np.repeat((values[granted] / spread)[:, None], left.shape[1], 1)]
        )
        least, most = (np.array(each)[:, None] for each in zip(*(each.bounds for each in declared), strict=True))
        before = values[granted][:, None]
        change += by_own @ (np.clip(before - np.linalg.lstsq(rows, left)[0][: len(granted)], least, most) - before)
    first = bound.count(segment.initialisation).counted
    change -= (
        by_start @ np.linalg.lstsq(by_start[first] * _weight(first, sigma), change[first] * _weight(first, sigma))[0]
    )
    return [
        Prediction(segment, as_it_is.bound, as_it_is.readings + change[:, :, number], as_it_is.states)
        for number in range(steps.shape[1])
    ]


def _weight(counted: BoolArray, sigma: FloatArray) -> FloatArray:
    """1/σ of each reading that counts, (readings, 1)."""
    return np.asarray(np.broadcast_to(1.0 / sigma[:, None], counted.shape)[counted][:, None])
