"""How far residuals are beyond noise, node by node, and whether two fits differ by more than their scatter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lptn.basics.arrays import FloatArray, IntArray
from lptn.identify.fitting import Fit
from lptn.simulate.simulation import BoundRun

# --- Runs cut into stretches so long that what is left of one says little about the next ----------


_STRETCH, _STRETCHES = 600.0, 8  # s; a run is cut into so many at least
_DRAWS, _RARE = 5000, 0.01


def stretches(bound: BoundRun) -> IntArray:
    """The number of the stretch that each step of a run lies in, shape (n,)."""
    size = max(1, min(round(_STRETCH / bound.run.step), len(bound) // _STRETCHES))
    return np.arange(len(bound)) // size


def misfits(fit: Fit) -> FloatArray:
    """Sum of squared weighted residuals of each stretch of each run, shape (stretches,)."""
    found = []
    for bound, error in zip(fit.problem.bound_runs, fit.residuals, strict=True):
        squares = np.where(bound.counted, error / fit.problem.sigma[:, None], 0.0) ** 2
        found.append(np.bincount(stretches(bound), squares.sum(axis=0)))
    return np.concatenate(found)


def clearly_differ(one: Fit, other: Fit) -> bool:
    """Whether two fits to the same runs differ by more than chance: signs of the stretches' differences, drawn anew.

    Fits that are equally good win as many stretches as they lose. A difference that one stretch makes alone is no
    evidence, however large; one that nearly all stretches share is, however uneven.

    Source: Fisher's randomisation test [Fisher1935], on stretches in place of independent observations.
    """
    differences = misfits(one) - misfits(other)
    signs = np.random.default_rng(0).choice((-1.0, 1.0), (_DRAWS, len(differences)))
    by_chance = np.abs(signs @ differences) >= abs(differences.sum()) * (1 - 1e-12)
    return bool(by_chance.mean() <= _RARE)


# --- How far residuals are beyond noise, node by node: means over a minute, where noise averages out ---


BLOCK = 60.0  # s; noise averages out over a block, a missing effect does not
NEGLIGIBLE = 0.04  # K; nobody looks for an effect that leaves less on one node's one-minute means
_PLAIN = 2.0  # times what noise leaves: a misfit that single readings show
TOO_MUCH = 1.5  # mean squares above so much of their bound by chance are more than noise


@dataclass(frozen=True)
class ByChance:
    """What a perfect model would leave at each node: mean squares of block means of weighted residuals.

    Args:
        usual: their mean over many logs.
        most: what they exceed once in twenty logs, and what is negligible on top.
    """

    usual: dict[str, float]
    most: dict[str, float]

    @classmethod
    def of(cls, fit: Fit, noise: FloatArray) -> ByChance:
        """From simulated noise.

        Args:
            fit: whose residuals are asked about.
            noise: weighted residuals of a perfect model, shape (rows, trials), in the order of the problem's.
        """
        squares = _mean_squares(fit, noise)
        sigma = dict(zip(fit.model.nodes, fit.problem.sigma, strict=True))
        return cls(
            {node: float(each.mean()) for node, each in squares.items()},
            {node: float(np.quantile(each, 0.95)) + (NEGLIGIBLE / sigma[node]) ** 2 for node, each in squares.items()},
        )


def lack_of_fit(fit: Fit, chance: ByChance, residual: FloatArray | None = None) -> dict[str, float]:
    """Mean square of each node's block means as a share of the most that chance leaves.

    Args:
        fit: a fit to the runs that `chance` was made from.
        chance: what a perfect model would leave.
        residual: weighted residuals, shape (rows,); the fit's own by default.
    """
    residual = fit.problem.residuals(fit.z) if residual is None else residual
    squares = _mean_squares(fit, residual[:, None])
    return {node: float(squares[node][0] / most) for node, most in chance.most.items() if node in squares}


def explained(base: Fit, done: Fit, chance: ByChance) -> float:
    """Share that a larger model removes of the misfit beyond noise.

    Of single readings where these show it plainly, since a lag or a clock is over within a minute; else of block
    means, since noise and steps of 1 K hide the rest.

    Args:
        base: the smaller model's fit.
        done: the larger model's fit to the same runs.
        chance: what a perfect model would leave.
    """
    noise = cost_of_noise(base)
    if base.cost > _PLAIN * noise:
        return (base.cost - done.cost) / (base.cost - noise)
    before, after = (_beyond_noise(each, chance) for each in (base, done))
    return (before - after) / max(before, 1e-12)


def _beyond_noise(fit: Fit, chance: ByChance) -> float:
    squares = _mean_squares(fit, fit.problem.residuals(fit.z)[:, None])
    return sum(float(squares[node][0]) - usual for node, usual in chance.usual.items() if node in squares)


def cost_of_noise(fit: Fit) -> float:
    """The misfit that the sensors' noise and steps alone would leave: half a sum of squared weighted residuals."""
    share = (fit.noise.floor / fit.problem.sigma) ** 2
    return 0.5 * float(sum((bound.counted.sum(axis=1) * share).sum() for bound in fit.problem.bound_runs))


def _mean_squares(fit: Fit, residuals: FloatArray) -> dict[str, FloatArray]:
    """Mean square of each node's block means, shape (trials,)."""
    start = 0
    found: dict[str, list[FloatArray]] = {node: [] for node in fit.model.nodes}
    for bound in fit.problem.bound_runs:
        size = max(1, round(BLOCK / bound.run.step))
        for row, node in enumerate(fit.model.nodes):
            count = int(bound.counted[row].sum())
            span = slice(start, start + count // size * size)
            found[node].append(residuals[span].reshape(-1, size, residuals.shape[1]).mean(axis=1) ** 2)
            start += count
    stacked = {node: np.vstack(squares) for node, squares in found.items()}
    return {node: np.asarray(squares.mean(axis=0)) for node, squares in stacked.items() if squares.size}
