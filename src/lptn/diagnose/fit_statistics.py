"""Statistics of fits: which of two is better, whether they differ beyond chance, how far residuals are beyond noise.

All of them respect that residuals of a thermal model repeat each other for minutes: the information criterion counts
independent residuals only, fits are compared by blocks of ten minutes, and the lack of fit looks at means
over a minute, where noise averages out and a missing effect does not.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from math import log

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray, IntArray
from lptn.basics.places import EVERYWHERE, is_of_run
from lptn.identify.comparison import Errors, Prediction
from lptn.identify.fitting import Fit
from lptn.identify.noise import PLAIN
from lptn.simulate.bound_run import BoundRun

# --- The information criterion: which of two fits to the same runs is better, parameters paid for --


TIE = 10.0
"""Information criteria closer than this decide nothing ([BurnhamAnderson2002]: beyond 10, no support)."""
POWER = 0.84
"""Standard deviations that four of five logs stay above: a power of 80 %."""
_LEAST_INDEPENDENT = 3.0  # readings; keeps the logarithm of their number positive


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
    return list(zip(fit.problem.bound_runs, fit.residuals, strict=True))


def predicted_errors(predictions: Sequence[Prediction]) -> list[RunErrors]:
    """Predicted runs with the errors of their evaluation windows."""
    return [(prediction.bound, prediction.readings - prediction.bound.measured) for prediction in predictions]


def independent_readings(runs: Sequence[RunErrors]) -> float:
    """Number of readings that are as good as independent, from the errors' correlation in time."""
    count = 0.0
    for bound, error in runs:
        for row in range(len(error)):
            residual = error[row][bound.counted[row]]
            if residual.size > 2:
                count += residual.size / _correlation_time(residual)
    return max(count, _LEAST_INDEPENDENT)


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


# --- Blocks of runs, between which what a fit leaves scatters ------------------------------------


_LONG_BLOCK = 600.0  # s; so long that what is left of one block says little about the next
_FEWEST_BLOCKS = 8  # a run; fewer say little about their scatter


def block_numbers(bound: BoundRun) -> IntArray:
    """The number of the block of ten minutes that each step of a run lies in, shape (n,); shorter in a short run."""
    size = max(1, min(round(_LONG_BLOCK / bound.run.step), len(bound) // _FEWEST_BLOCKS))
    return np.arange(len(bound)) // size


def block_misfits(runs: Sequence[RunErrors], sigma: FloatArray) -> tuple[FloatArray, IntArray]:
    """Sum of squared weighted errors of each node in each block, and the number of each block's run.

    Args:
        runs: with their errors.
        sigma: standard deviation that weighs each node's errors [K], shape (nodes,).

    Returns:
        shapes (blocks, nodes) and (blocks,), run after run.
    """
    misfits, numbers = [], []
    for number, (bound, error) in enumerate(runs):
        squares = np.where(bound.counted, error / sigma[:, None], 0.0) ** 2
        blocks = block_numbers(bound)
        misfits.append(np.stack([np.bincount(blocks, row) for row in squares], axis=1))
        numbers += [number] * len(misfits[-1])
    return np.concatenate(misfits), np.array(numbers)


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
        sigma = smaller.problem.sigma
        (before, runs), (after, _) = (block_misfits(fitted_errors(fit), sigma) for fit in (smaller, larger))
        gone = before - after
        total = float(gone.sum())
        names = [bound.run.name for bound in smaller.problem.bound_runs]
        whole = total or 1.0
        return cls(
            total / max(float(before.sum()), 1e-300),
            dict(zip(smaller.model.nodes, (gone.sum(axis=0) / whole).tolist(), strict=True)),
            dict(zip(names, (np.bincount(runs, gone.sum(axis=1)) / whole).tolist(), strict=True)),
        )


# --- Lack of fit: how far residuals are beyond noise, node by node -------------------------------


BLOCK = 60.0
"""s; noise averages out over a block so long, a missing effect does not."""
NEGLIGIBLE = 0.04
"""K; nobody looks for an effect that leaves less on one node's one-minute means."""
LACKING = 1.5
"""Times what chance leaves at most, beyond which a lack of fit is no noise."""
MOST = 0.8
"""Share of the squared misfit beyond noise that what was found must explain to be what is missing: errors fall by more
than half."""
HALF = 0.5
"""Share of it that the steps of a search must explain, since held-out runs chose them; share of a held-out error,
squared and beyond noise, that must go with it; and share of its own sensors' misfit that an error of the log must."""


@dataclass(frozen=True)
class NoiseLevel:
    """What a perfect model would leave at each node: mean squares of block means of weighted residuals.

    Args:
        mean: over many simulated logs.
        limit: exceeded in one log of twenty, with what is negligible on top.
    """

    mean: dict[str, float]
    limit: dict[str, float]

    @classmethod
    def of(cls, fit: Fit, noise: FloatArray) -> NoiseLevel:
        """From simulated noise.

        Args:
            fit: whose residuals are judged.
            noise: weighted residuals of a perfect model, shape (rows, trials), in the order of the problem's.
        """
        squares = _mean_squares(fit, noise)
        sigma = dict(zip(fit.model.nodes, fit.problem.sigma, strict=True))
        return cls(
            {node: float(trials.mean()) for node, trials in squares.items()},
            {
                node: float(np.quantile(trials, 0.95)) + (NEGLIGIBLE / sigma[node]) ** 2
                for node, trials in squares.items()
            },
        )


def lack_of_fit(fit: Fit, noise: NoiseLevel) -> dict[str, float]:
    """Mean square of each node's block means as a share of the most that noise leaves.

    All that the fit left counts. To first order its parameters could imitate some of it: of one that the data say
    nothing of, the derivative may have any shape, and the slope is all but zero.

    Args:
        fit: a fit to the runs that `noise` was simulated for.
        noise: what a perfect model would leave.
    """
    squares = _mean_squares(fit, fit.problem.residuals(fit.z)[:, None])
    return {node: float(squares[node][0] / limit) for node, limit in noise.limit.items() if node in squares}


def explains(
    share: float, base: Fit, larger: Fit, noise: NoiseLevel, nodes: Collection[str] = (), runs: str = EVERYWHERE
) -> bool:
    """Whether a larger model removes more than a share of the misfit beyond noise.

    Of single readings where these show it plainly, since a lag or a clock is over within a minute; else of block
    means, since noise and steps of 1 K hide the rest.

    Args:
        share: of the misfit.
        base: the smaller model's fit.
        larger: the larger model's fit to the same runs.
        noise: what a perfect model would leave.
        nodes: of which it is asked; of all by default.
        runs: name or glob of those of which it is asked; of all by default.
    """
    asked = np.array([not nodes or node in nodes for node in base.model.nodes])
    share_of_noise = (base.noise.floor / base.problem.sigma) ** 2
    own = [bound for bound in base.problem.bound_runs if is_of_run(bound.run.name, runs)]
    floor = float(sum((bound.counted.sum(axis=1) * share_of_noise)[asked].sum() for bound in own))
    before, after = (_squares(fit, base.problem.sigma, asked, runs) for fit in (base, larger))
    if before > PLAIN * floor:
        return before - after > share * (before - floor)
    before, after = (_beyond_noise(fit, noise, asked, runs) for fit in (base, larger))
    return before - after > share * max(before, 0.0)


def _squares(fit: Fit, sigma: FloatArray, asked: BoolArray, runs: str) -> float:
    """Sum of squared weighted errors of some nodes in some of the fitted runs."""
    errors = [(bound, error) for bound, error in fitted_errors(fit) if is_of_run(bound.run.name, runs)]
    return float(block_misfits(errors, sigma)[0][:, asked].sum())


def _beyond_noise(fit: Fit, noise: NoiseLevel, asked: BoolArray, runs: str) -> float:
    squares = _mean_squares(fit, fit.problem.residuals(fit.z)[:, None], runs)
    nodes = [node for node, wanted in zip(fit.model.nodes, asked, strict=True) if wanted and node in squares]
    return sum(float(squares[node][0]) - noise.mean[node] for node in nodes)


def explained_elsewhere(base: Fit, before: Errors | None, after: Errors | None) -> bool:
    """Whether enough of the held-out error beyond noise goes, too, or none is left beyond noise.

    True where nothing is held out.

    Args:
        base: the smaller model's fit, with the sensors' noise.
        before: its errors on held-out runs.
        after: those of the larger model.
    """
    if before is None or after is None:
        return True
    floor = float(np.mean(base.noise.floor**2))
    return after.rmse**2 <= max(before.rmse**2 - HALF * (before.rmse**2 - floor), floor)


def _squares_by_node(runs: Sequence[RunErrors]) -> FloatArray:
    """Mean square of each node's one-minute means of the errors [K²], shape (nodes,); 0 without any."""
    squares: list[list[FloatArray]] = [[] for _ in runs[0][1]]
    for bound, errors in runs:
        size = max(1, round(BLOCK / bound.run.step))
        for own, error in zip(squares, np.where(bound.counted, errors, np.nan), strict=True):
            own.append(_block_squares(error, size))
    return np.array([np.concatenate(own).mean() if any(blocks.size for blocks in own) else 0.0 for own in squares])


def _mean_squares(fit: Fit, residuals: FloatArray, runs: str = EVERYWHERE) -> dict[str, FloatArray]:
    """Mean square of each node's block means in some runs, shape (trials,), of weighted residuals (rows, trials)."""
    start = 0
    squares: dict[str, list[FloatArray]] = {node: [] for node in fit.model.nodes}
    for bound in fit.problem.bound_runs:
        size = max(1, round(BLOCK / bound.run.step))
        for row, node in enumerate(fit.model.nodes):
            count = int(bound.counted[row].sum())
            whole_blocks = residuals[start : start + count // size * size]
            if is_of_run(bound.run.name, runs):
                squares[node].append(whole_blocks.reshape(-1, size, residuals.shape[1]).mean(axis=1) ** 2)
            start += count
    stacked = {node: np.vstack(blocks) for node, blocks in squares.items() if blocks}
    return {node: np.asarray(blocks.mean(axis=0)) for node, blocks in stacked.items() if blocks.size}


# --- Runs that a model predicts clearly worse than it fits ---------------------------------------


CLEARLY = 2.0
"""Times the error on the fitted runs: no model predicts quite as well as it fits."""


def standing_out(fit: Fit, before: Prediction, least: float = NEGLIGIBLE) -> dict[str, tuple[float, float]]:
    """Nodes where a run is predicted clearly worse than the fitted runs are met, with both errors [K].

    There one-minute means of the error are beyond noise, and clearly beyond those of the fitted runs.

    Args:
        fit: the fitted model.
        before: its prediction of the run.
        least: K; means that are off by less stand out nowhere.

    Returns:
        For each such node the root mean square of one-minute means in this run and in the fitted ones, the worst first.
    """
    from scipy.special import chdtri  # heavy, and few commands need it

    size = max(1, round(BLOCK / before.bound.run.step))
    errors = {}
    for row, (node, usual) in enumerate(zip(fit.model.nodes, _squares_by_node(fitted_errors(fit)), strict=True)):
        squares = _block_squares(before.error[row], size)
        if not squares.size:
            continue
        # A sensor's steps do not average out while the temperature stands.
        noise = fit.noise.white[row] ** 2 / size + fit.noise.step[row] ** 2 / 12
        chance = noise * float(chdtri(squares.size, 0.05)) / squares.size
        if squares.mean() > max(CLEARLY**2 * usual, LACKING * chance, least**2):
            errors[node] = (float(np.sqrt(squares.mean())), float(np.sqrt(usual)))
    return dict(sorted(errors.items(), key=lambda item: -item[1][0]))


def _block_squares(error: FloatArray, size: int) -> FloatArray:
    """Squared means of the error over full blocks of readings that count, shape (blocks,)."""
    counted = error[np.isfinite(error)]
    return np.asarray(counted[: counted.size // size * size].reshape(-1, size).mean(axis=1) ** 2)
