"""How far residuals are beyond noise, node by node: means over a minute, where noise averages out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lptn.arrays import FloatArray
from lptn.identify import Fit

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
    return 0.5 * float(sum((driven.counted.sum(axis=1) * share).sum() for driven in fit.problem.drives))


def _mean_squares(fit: Fit, residuals: FloatArray) -> dict[str, FloatArray]:
    """Mean square of each node's block means, shape (trials,)."""
    start = 0
    found: dict[str, list[FloatArray]] = {node: [] for node in fit.model.nodes}
    for driven in fit.problem.drives:
        size = max(1, round(BLOCK / driven.run.step))
        for row, node in enumerate(fit.model.nodes):
            count = int(driven.counted[row].sum())
            span = slice(start, start + count // size * size)
            found[node].append(residuals[span].reshape(-1, size, residuals.shape[1]).mean(axis=1) ** 2)
            start += count
    stacked = {node: np.vstack(squares) for node, squares in found.items()}
    return {node: np.asarray(squares.mean(axis=0)) for node, squares in stacked.items() if squares.size}
