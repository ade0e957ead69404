"""How far residuals are beyond noise, node by node: means over a minute, where noise averages out."""

from __future__ import annotations

import numpy as np

from lptn.arrays import FloatArray
from lptn.identify import Fit

BLOCK = 60.0  # s; noise averages out over a block, a missing effect does not
NEGLIGIBLE = 0.03  # K; nobody looks for an effect that leaves less on one node's one-minute means
TOO_MUCH = 1.5  # mean squares above so much of their bound by chance are more than noise


def bounds_by_chance(fit: Fit, noise: FloatArray) -> dict[str, float]:
    """For each node the mean square of block means that chance exceeds once in twenty logs.

    Args:
        fit: whose residuals are asked about.
        noise: weighted residuals of a perfect model, shape (rows, trials), in the order of the problem's.
    """
    by_chance = _mean_squares(fit, noise)
    bounds = {}
    for node, squares in by_chance.items():
        least = (NEGLIGIBLE / fit.problem.sigma[fit.model.nodes.index(node)]) ** 2
        bounds[node] = max(float(np.quantile(squares, 0.95)), least)
    return bounds


def lack_of_fit(fit: Fit, bounds: dict[str, float], residual: FloatArray | None = None) -> dict[str, float]:
    """Mean square of each node's block means as a share of its bound.

    Args:
        fit: a fit to the runs that the bounds were made from.
        bounds: from `bounds_by_chance`.
        residual: weighted residuals, shape (rows,); the fit's own by default.
    """
    residual = fit.problem.residuals(fit.z) if residual is None else residual
    squares = _mean_squares(fit, residual[:, None])
    return {node: float(squares[node][0] / bound) for node, bound in bounds.items() if node in squares}


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
