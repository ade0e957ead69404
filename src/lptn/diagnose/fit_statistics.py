"""Statistics of fits: how many readings are independent, which of two fits is better, how far errors are beyond noise.

All of them respect that errors of a thermal model repeat each other for minutes: independent ones are counted, and what
noise leaves is asked of means over a minute.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import log, sqrt

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.identify.fitting import Fit
from lptn.identify.noise import LEAST_NOISE
from lptn.logs.resampling import means_of_blocks
from lptn.simulate.bound_run import BoundRun

# --- The information criterion: which of two fits to the same runs is better, parameters paid for --


def criterion_difference(one: Fit, other: Fit) -> float:
    """How much worse `one` explains the data than `other`: a difference of information criteria.

    Residuals that repeat each other are not independent. The logarithm of the ratio of misfits therefore counts as
    often as there are independent residuals in the better of the two fits, and each free parameter costs the logarithm
    of that number (Schwarz's criterion [Schwarz1978]).
    """
    better = one if one.cost < other.cost else other
    independent = independent_readings(fitted_errors(better))
    misfit = independent * log(max(one.cost, 1e-300) / max(other.cost, 1e-300))
    return misfit + (len(one.free) - len(other.free)) * log(independent)


RunErrors = tuple[BoundRun, FloatArray]
"""A run, and a model's errors there (predicted − measured) [K], shape (nodes, n); those count that the run counts."""


def fitted_errors(fit: Fit) -> list[RunErrors]:
    """The fitted runs with what the fit leaves of them."""
    return [(run.bound, run.error) for run in fit.predictions]


def independent_readings(runs: Sequence[RunErrors], beside: float = 0.0) -> float:
    """Number of readings that are as good as independent, from the errors' correlation in time.

    Args:
        runs: with their errors.
        beside: standard deviation of an error beside them that stays the same for `BLOCK` [K].
    """
    count = 0.0
    for bound, error in runs:
        block = BLOCK / bound.run.step
        for row in range(len(error)):
            residual = error[row][bound.counted[row]]
            if residual.size > 2:
                square = max(float(np.mean(residual**2)), LEAST_NOISE**2)
                count += residual.size / (_correlation_time(residual) + block * beside**2 / square)
    return max(count, 1.0)


def _correlation_time(residual: FloatArray) -> float:
    """Samples that repeat each other: the autocorrelation summed while pairs of lags stay positive [Geyer1992]."""
    spectrum = np.abs(np.fft.rfft(residual, 2 * residual.size)) ** 2
    correlation = np.fft.irfft(spectrum)[: residual.size]
    if correlation[0] <= 0:
        return 1.0
    correlation = correlation / correlation[0]
    pairs = correlation[: residual.size // 2 * 2].reshape(-1, 2).sum(axis=1)
    positive = pairs[: int(np.argmax(pairs <= 0)) if (pairs <= 0).any() else len(pairs)]
    return max(1.0, 2.0 * float(positive.sum()) - 1.0)


# --- What a larger model removes ----------------------------------------------------------------


@dataclass(frozen=True)
class Removed:
    """What a larger model removes of the squared errors of the runs that it and a smaller one were fitted to.

    Args:
        share: of them all; below 0 where they grow.
        by_node: share of what is removed, for each node; what one loses another may have gained.
        by_run: likewise.
    """

    share: float
    by_node: dict[str, float]
    by_run: dict[str, float]

    @classmethod
    def between(cls, smaller: Fit, larger: Fit) -> Removed:
        """By two fits to the same readings, each weighed by the smaller one's standard deviations."""
        before, after = (
            np.array([np.sum(np.where(bound.counted, error / sigma, 0.0) ** 2, axis=1) for bound, error in runs])
            for sigma, runs in ((smaller.problem.sigma[:, None], fitted_errors(fit)) for fit in (smaller, larger))
        )
        gone, names = before - after, [bound.run.name for bound in smaller.problem.bound_runs]
        total = float(gone.sum())
        whole = total or 1.0
        return cls(
            total / max(float(before.sum()), 1e-300),
            dict(zip(smaller.model.nodes, (gone.sum(axis=0) / whole).tolist(), strict=True)),
            dict(zip(names, (gone.sum(axis=1) / whole).tolist(), strict=True)),
        )


# --- How far errors are beyond noise, over means of a minute: there noise averages out, a missing effect does not --
# The sensitivity of verdicts to each number was tested on the examples' logs, with 1.5 times and two thirds of it.


BLOCK = 60.0
"""s; what a sensor's noise changes from reading to reading is gone in means over so long, and no joint's temperature
changes much faster."""
NEGLIGIBLE = 0.04
"""K; nobody looks for an effect that leaves less on one node's one-minute means. With .06 K one finding less is told of
an arm of six joints, with .027 K one more."""
LACKING = 1.5
"""Times what chance leaves at most, beyond which a misfit is no noise: of a sensor's noise, which is estimated from the
readings, a fifth more or less is within the estimate's error. No verdict changes with 1 or 2.25."""
CLEARLY = 2.0
"""Times the error on the fitted runs: no model predicts quite as well as it fits. With 3 a stator's run is no longer
said to differ; with 1.3 none more is."""
WORTH = 0.05
"""Share by which held-out errors must differ to speak for an effect that no evidence chose: the RMSE of some 200
independent residuals, an hour or two of a few nodes, is itself known to 1/√400. Nothing changes with 3 or 8 %."""


def noise_of_means(clean: FloatArray, white: float, step: float, size: int, logs: int = 200) -> FloatArray:
    """What a sensor leaves of a perfect model on means over so many readings, in logs that are simulated.

    Args:
        clean: the true readings [K], shape (n,).
        white: standard deviation of white noise [K].
        step: of a coarse sensor [K], 0 for a fine one; the steps lie anywhere.
        size: readings of a mean.
        logs: how many; of 200 what one in twenty exceeds is known to a tenth.

    Returns:
        Errors [K], shape (logs, n // size).
    """
    if step == 0:
        return white * _means_of_noise(clean.size, size, logs)
    rng, errors = np.random.default_rng(0), []
    for _ in range(logs):  # one after the other, so that ten days of readings fill no memory
        noise, true = rng.normal(0.0, white, clean.size), clean + rng.uniform(0.0, step)
        error = np.round((true + noise) / step) * step - true
        errors.append(error[: clean.size // size * size].reshape(-1, size).mean(axis=1))
    return np.array(errors)


@lru_cache(maxsize=4)  # runs of one length each; of ten days they are 23 MB
def _means_of_noise(readings: int, size: int, logs: int) -> FloatArray:
    """Means over so many readings of white noise of a standard deviation of one, shape (logs, readings // size)."""
    rng, whole = np.random.default_rng(0), readings // size * size
    return np.array([rng.normal(0.0, 1.0, readings)[:whole].reshape(-1, size).mean(axis=1) for _ in range(logs)])


def minute_means(fit: Fit, runs: Sequence[RunErrors] | None = None, fewest: int = 10) -> dict[str, tuple[float, float]]:
    """Mean squares of each node's errors over minutes [K²], and of those that its sensor's noise alone would leave.

    The latter is what noise and steps exceed in one log of twenty, with what is negligible on top.

    Args:
        fit: has the sensors' noise.
        runs: with their errors; the fitted ones with what the fit leaves of them, by default.
        fewest: blocks, however short the logs are: in less than ten minutes over a tenth of them. Over two minutes an
            error that turns within each is gone as well, and of less than one there would be no block.

    Returns:
        For the nodes of which some minute is whole.
    """
    found, runs = {}, fitted_errors(fit) if runs is None else runs
    for row, (node, white, step) in enumerate(zip(fit.model.nodes, fit.noise.white, fit.noise.step, strict=True)):
        squares, simulated = [], []
        of_runs = [bound.counted[row] & np.isfinite(error[row]) for bound, error in runs]
        seconds = sum(bound.run.step * int(counted.sum()) for (bound, _), counted in zip(runs, of_runs, strict=True))
        for (bound, error), counted in zip(runs, of_runs, strict=True):
            size = max(1, round(min(BLOCK, seconds / fewest) / bound.run.step))
            own = error[row][counted]
            squares.append(means_of_blocks(own, size) ** 2)
            simulated.append(noise_of_means(bound.measured[row][counted] + own, white, step, size) ** 2)
        square = np.concatenate(squares)
        if square.size:
            noise = np.hstack(simulated).mean(axis=1)
            found[node] = float(square.mean()), float(np.quantile(noise, 0.95)) + NEGLIGIBLE**2
    return found


def lack_of_fit(fit: Fit, runs: Sequence[RunErrors] | None = None) -> dict[str, float]:
    """Mean square of each node's one-minute means over the fitted runs, as a share of the most that noise leaves.

    Args:
        fit: the fit.
        runs: these with other errors than the fit's own.
    """
    return {node: square / limit for node, (square, limit) in minute_means(fit, runs).items()}


def is_met(lack: dict[str, float]) -> bool:
    """Whether every node's errors are explained by noise, from `lack_of_fit`."""
    return all(value <= LACKING for value in lack.values())


def explained_share(base: Fit, before: float, after: float) -> float:
    """Share of the squared error beyond the sensors' noise that a larger model removes; 1 where there was none beyond.

    Args:
        base: the smaller model's fit, with the noise.
        before: RMSE of its errors [K].
        after: that of the larger model, of the same readings [K].
    """
    floor = float(np.mean(base.noise.floor**2))
    return 1.0 - max(after**2 - floor, 0.0) / max(before**2 - floor, np.finfo(float).tiny)


def standing_out(
    fit: Fit, run: RunErrors, least: float = 0.0, fitted: Sequence[RunErrors] | None = None
) -> dict[str, tuple[float, float]]:
    """Nodes where a run is predicted clearly worse than the fitted runs are met, with both errors [K].

    There one-minute means of the error are beyond noise, and clearly beyond those of the fitted runs.

    Args:
        fit: the fitted model.
        run: the run, and the errors of its prediction.
        least: K; means that are off by less stand out nowhere.
        fitted: the fitted runs and what is left of them; by the fit, by default.

    Returns:
        For each such node the root mean square of one-minute means in this run and in the fitted ones, the worst first.
    """
    errors, usual = {}, minute_means(fit, fitted)
    for node, (square, limit) in minute_means(fit, [run]).items():
        known = usual[node][0] if node in usual else 0.0
        if square > max(CLEARLY**2 * known, LACKING * limit, least**2):
            errors[node] = sqrt(square), sqrt(known)
    return dict(sorted(errors.items(), key=lambda item: -item[1][0]))
