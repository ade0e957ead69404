"""What an effect would change, in fitted runs and in runs that no fit saw, to first order: before anybody refits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.processes import one_blas_thread
from lptn.diagnose.evidence import FirstOrder
from lptn.diagnose.traces import derivatives, pushed_beyond_bounds
from lptn.identify.comparison import Prediction, predict
from lptn.identify.data import Segment
from lptn.identify.fitting import Fit
from lptn.identify.problem import rows_of_readings
from lptn.model.model import Model
from lptn.simulate.bound_run import bind, start_from
from lptn.simulate.simulation import sensitivity_windows


class Previews:
    """Runs as they would be predicted with each candidate added and all else refitted, to first order.

    The candidate has the size and shape with which it was weighed, and the fitted parameters take back what they can
    imitate of it; the start of a run goes with both, as its first readings have it.

    Args:
        fit: the baseline.
        candidates: as they were weighed.
    """

    @one_blas_thread
    def __init__(self, fit: Fit, candidates: Sequence[FirstOrder]) -> None:
        self._fit = fit
        acts = [one.candidate.sites(one.shape) for one in candidates]
        self._places = list(dict.fromkeys(site for own in acts for site in own))
        has = np.array([[float(site in own) for own in acts] for site in self._places])
        has = has.reshape(len(self._places), len(acts))
        residuals, baseline = fit.problem.jacobian(fit.z)
        able = ~pushed_beyond_bounds(fit, baseline.T @ residuals)
        length = np.maximum(np.linalg.norm(baseline[:, able], axis=0), np.finfo(float).tiny)
        alone = derivatives(fit, self._places) @ has
        adapted = np.zeros((baseline.shape[1], len(acts)))
        adapted[able] = -np.linalg.lstsq(baseline[:, able] / length, alone)[0] / length[:, None]
        change = alone + baseline @ adapted  # of the weighted residuals by a unit of each candidate
        sizes = np.array([one.amplitude for one in candidates])
        self._change = change * sizes  # shape (rows, candidates)
        parameters = adapted[: len(fit.problem.free)] * fit.problem.slope(fit.point.values)[:, None]
        self._steps = np.vstack([parameters, has]) * sizes  # in their units, (free parameters + places, candidates)

    def of_fitted_runs(self) -> list[FloatArray]:
        """Readings [degC] of each fitted run, shape (candidates, nodes, n), NaN where nothing was measured."""
        predicted, first = [], 0
        for bound, error in zip(self._fit.problem.bound_runs, self._fit.residuals, strict=True):
            change = self._change[rows_of_readings(bound) + first] * self._fit.problem.sigma[:, None, None]
            readings = (bound.measured + error)[:, :, None] + change
            predicted.append(np.moveaxis(np.where(bound.counted[:, :, None], readings, np.nan), 2, 0))
            first += int(bound.counted.sum())
        return predicted

    @one_blas_thread
    def of(self, segment: Segment) -> list[Prediction]:
        """What is predicted of a run that was not fitted, with each candidate.

        Raises:
            InputError: the run lacks an input of a candidate.
        """
        if not self._places:
            return []
        fit, sigma = self._fit, self._fit.problem.sigma
        as_it_is = predict(fit.model, segment, sigma)
        full = Model(fit.model.network.with_effects(site.declaration() for site in self._places))
        index = {parameter.name: number for number, parameter in enumerate(full.parameters)}
        chosen = [index[fit.model.parameters[number].name] for number in fit.problem.free]
        chosen += [index[site.amplitude_name] for site in self._places]
        core = fit.model.states  # effects are added behind the network's own, and so are their states
        bound = bind(full, segment.run)
        start = start_from(full, bound, dict(zip(core, as_it_is.start.tolist(), strict=True)))
        windows = sensitivity_windows(full, bound, full.values, chosen, start, len(core))
        by_all = np.concatenate([piece.derivatives for _, piece in windows], axis=1)
        by_step, by_start = np.split(by_all, [len(chosen)], axis=2)
        change = by_step @ self._steps
        # The start is the one that the initialisation window then gives.
        first = bound.count(segment.initialisation).counted
        weight = np.broadcast_to(1.0 / sigma[:, None], first.shape)[first][:, None]
        change -= by_start @ np.linalg.lstsq(by_start[first] * weight, change[first] * weight)[0]
        return [replace(as_it_is, readings=as_it_is.readings + change[:, :, k]) for k in range(change.shape[2])]
