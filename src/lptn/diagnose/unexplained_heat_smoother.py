"""Fixed-interval smoothing of the heat that a model lacks: forward filter, backward adjoint, and the likelihood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lptn.arrays import FloatArray
from lptn.diagnose.unexplained_heat_blocks import Blocks


@dataclass(frozen=True)
class Prior:
    """What is known before the first reading.

    Args:
        deviations: standard deviations of states [K], heats [W] and parameters' coordinates, shape (D,).
        walk: by how much each heat wanders, standard deviation after one second [W], grows with √time.
    """

    deviations: FloatArray
    walk: float


@dataclass(frozen=True)
class _Step:
    """What the backward pass needs of one block, before its readings are taken in."""

    heat: FloatArray  # (M,)
    covariance: FloatArray  # rows of the heats, (M, D)
    by: FloatArray  # (seen, D)
    gain: FloatArray  # (D, seen)
    precision: FloatArray  # of the innovation, (seen, seen)
    innovation: FloatArray  # (seen,)


def likelihood(run: Blocks, prior: Prior) -> float:
    """Logarithm of the readings' probability density at these assumptions, by prediction errors."""
    return _forward(run, prior, None)


def smoothed(run: Blocks, prior: Prior) -> tuple[FloatArray, FloatArray]:
    """Each heat given all readings, and its standard deviation [W], shape (M, n) each.

    Source: [Rauch1965], in the form of [Bierman1973], which inverts no covariance of the states: parameters that
    stay the same make that singular.
    """
    steps: list[_Step] = []
    _forward(run, prior, steps)
    states, nodes = run.top.shape[1], len(run.rows)
    size = run.top.shape[2]
    heat, spread = np.empty((nodes, len(steps))), np.empty((nodes, len(steps)))
    back, curve = np.zeros(size), np.zeros((size, size))
    heats = slice(states, states + nodes)
    for k in range(len(steps) - 1, -1, -1):
        back, curve = _before_step(back, curve, run.top[k])
        step = steps[k]
        rest = np.eye(size) - step.gain @ step.by
        weighed = step.by.T @ step.precision
        back = rest.T @ back - weighed @ step.innovation
        curve = rest.T @ curve @ rest + weighed @ step.by
        heat[:, k] = step.heat - step.covariance @ back
        less = np.einsum("ij,jk,ik->i", step.covariance, curve, step.covariance)
        spread[:, k] = np.sqrt(np.maximum(np.diag(step.covariance[:, heats]) - less, 0.0))
    return heat, spread


def _forward(run: Blocks, prior: Prior, steps: list[_Step] | None) -> float:
    """The filter; keeps what smoothing needs where a list is given."""
    states, nodes = run.top.shape[1], len(run.rows)
    heats = slice(states, states + nodes)
    d, p, found = np.zeros(run.top.shape[2]), np.diag(prior.deviations**2), 0.0
    gained = prior.walk**2 * run.seconds
    for k in range(len(run.time)):
        seen = np.isfinite(run.residual[k])
        by = run.by[k][seen]
        crossed = p @ by.T
        root = np.linalg.cholesky(by @ crossed + np.diag(run.variance[k][seen]))
        inverse = np.linalg.inv(root)
        precision = inverse.T @ inverse
        innovation = run.residual[k][seen] - by @ d
        gain = crossed @ precision
        if steps is not None:
            steps.append(_Step(d[heats].copy(), p[heats].copy(), by, gain, precision, innovation))
        found -= 0.5 * float(np.sum((inverse @ innovation) ** 2)) + float(np.log(np.diag(root)).sum())
        d = d + gain @ innovation
        p = p - gain @ crossed.T
        d, p = _after_step(d, p, run.top[k])
        np.einsum("ii->i", p)[heats] += gained
    return found


def _after_step(d: FloatArray, p: FloatArray, top: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance after a block; heats and parameters stay."""
    states = len(top)
    mixed = top @ p
    p = 0.5 * (p + p.T)
    p[:states] = mixed
    p[:, :states] = mixed.T
    p[:states, :states] = mixed @ top.T
    d = d.copy()
    d[:states] = top @ d
    return d, p


def _before_step(back: FloatArray, curve: FloatArray, top: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The adjoint carried back over a block."""
    states = len(top)
    transition = np.eye(top.shape[1])
    transition[:states] = top
    return transition.T @ back, transition.T @ curve @ transition
