"""The present state, estimated from the log so far, with what the model gets wrong on this log."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log, pi

import numpy as np

from lptn.arrays import FloatArray
from lptn.forecast.dynamics import Dynamics, Motion
from lptn.forecast.knowledge import Knowledge
from lptn.logs import Run
from lptn.model import Model
from lptn.noise import Noise
from lptn.simulate import Drive, default_start, drive

_BLOCK = 10.0  # s; readings are averaged over it
_MEMORY = 3600.0  # s of the log that are looked at
_HEAT_TIME = 1800.0  # s over which the heat that a model lacks stays alike
_AIR = 0.1  # relative error of all conductances to the air in one run: a draught, a load on the back
_SCALES = (0.5, 1.0, 2.0, 4.0)
_TYPICAL = 1.5  # times the fit's own residuals: on a run that it never saw a model is worse
_START = 0.5  # K, by which first readings may be off, beside the sensor's steps
_UNSEEN = 5.0  # K, by which a node without a sensor may start away from the others
_LEAST_NOISE = 0.05  # K


@dataclass(frozen=True)
class Present:
    """What is known at the end of a log.

    Its unknowns are, in this order: the model's states [degC]; heat that it lacks at each node [W]; the logarithm of
    a factor on all conductances to prescribed temperatures; errors of the free parameters' coordinates.

    Args:
        mean: of the unknowns, shape (states + nodes + 1 + free,).
        covariance: of the same.
        heat: standard deviation of the missing heat in the long run [W].
        likelihood: its logarithm, of the log with missing heat of that size.
    """

    mean: FloatArray
    covariance: FloatArray
    heat: float
    likelihood: float


def present(model: Model, run: Run, noise: Noise, knowledge: Knowledge) -> Present:
    """Estimate the present from the end of a log by an extended Kalman filter.

    The parameters and the draught are estimated along, from what the fit leaves open: a trot says more of its own
    friction than an identification with few trots. Not so for a model that lacks something, such as a second mass: it
    would bend them to suit the log so far, so their errors only widen the uncertainty. Missing heat is of the size
    that the fit's residuals suggest, times a factor that makes this log likeliest.

    Raises:
        InputError: the log lacks an input, or measures none of the model's nodes.
    """
    blocks = _blocks(run)
    driven = drive(model, blocks)
    white = noise.white / np.sqrt(max(1.0, blocks.step / run.step))
    quiet = Noise(np.maximum(white, _LEAST_NOISE), noise.step)
    dynamics = Dynamics(model)
    filtered = _Filter(dynamics, driven, quiet, knowledge)
    size = float(np.sqrt(np.mean((knowledge.error / _response(dynamics, driven)) ** 2)))
    tried = {scale: filtered.run(scale * size) for scale in _SCALES}
    chance = {scale: each.likelihood - 0.5 * (log(scale / _TYPICAL) / log(2.0)) ** 2 for scale, each in tried.items()}
    return tried[max(chance, key=lambda scale: chance[scale])]


def advance(
    mean: FloatArray, covariance: FloatArray, motion: Motion, heat: float, step: float
) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance of the unknowns one step later: missing heat fades, and new one appears.

    Where the covariance has rows for the inputs behind those of the mean, the inputs' errors stay as they are.
    """
    n, nodes = motion.by_heat.shape
    fading = exp(-step / _HEAT_TIME)
    moved = np.hstack([motion.by_state, motion.by_heat, motion.by_air, motion.by_parameter, motion.by_input])
    transition = np.eye(len(covariance))
    transition[:n] = moved[:, : len(covariance)]
    transition[n : n + nodes, n : n + nodes] *= fading
    following = mean.copy()
    following[:n] = motion.states
    following[n : n + nodes] *= fading
    covariance = transition @ covariance @ transition.T
    covariance[n : n + nodes, n : n + nodes] += np.eye(nodes) * heat**2 * (1 - fading**2)
    return following, covariance


class _Filter:
    """The filter over one log, in blocks.

    Args:
        dynamics: the model's steps.
        driven: the log.
        noise: of a block's readings.
        knowledge: of the model.
    """

    def __init__(self, dynamics: Dynamics, driven: Drive, noise: Noise, knowledge: Knowledge) -> None:
        self._dynamics, self._driven, self._knowledge = dynamics, driven, knowledge
        self._variance = noise.white**2 + noise.step**2 / 12
        self._steps = noise.step
        model = dynamics.model
        self._states, self._nodes, self._free = len(model.states), len(model.nodes), len(model.free)

    def run(self, heat: float) -> Present:
        """The present, with missing heat of this standard deviation [W]."""
        mean, covariance = self._start(heat)
        likelihood, step = 0.0, self._driven.run.step
        for k in range(len(self._driven)):
            mean, covariance, gained = self._corrected(mean, covariance, k)
            likelihood += gained
            mean, covariance = advance(mean, covariance, self._motion(mean, k), heat, step)
        return Present(mean, covariance, heat, likelihood)

    def _start(self, heat: float) -> tuple[FloatArray, FloatArray]:
        n, nodes = self._states, self._nodes
        spread = np.full(n, _UNSEEN)
        near = np.hypot(_START, self._steps / np.sqrt(12))
        spread[:nodes] = np.where(np.isfinite(self._driven.start), near, _UNSEEN)
        variances = np.concatenate([spread**2, np.full(nodes, heat**2), [_AIR**2], np.zeros(self._free)])
        covariance = np.diag(variances)
        covariance[n + nodes + 1 :, n + nodes + 1 :] = self._knowledge.covariance
        start = default_start(self._dynamics.model, self._driven)
        return np.concatenate([start, np.zeros(nodes + 1 + self._free)]), covariance

    def _motion(self, mean: FloatArray, k: int) -> Motion:
        n, nodes = self._states, self._nodes
        p = self._dynamics.values(mean[n + nodes :])
        return self._dynamics.step(mean[:n], mean[n : n + nodes], self._driven.inputs[:, k], p, self._driven.run.step)

    def _corrected(self, mean: FloatArray, covariance: FloatArray, k: int) -> tuple[FloatArray, FloatArray, float]:
        """Mean and covariance with a block's readings, and the logarithm of their likelihood."""
        measured = self._driven.measured[:, k]
        seen = np.isfinite(measured)
        if not seen.any():
            return mean, covariance, 0.0
        expected, slope = self._expected(mean, k)
        slope, noise = slope[seen], np.diag(self._variance[seen])
        spread = slope @ covariance @ slope.T + noise
        innovation = measured[seen] - expected[seen]
        gain = np.linalg.solve(spread, slope @ covariance).T
        if not self._knowledge.adequate:
            gain[self._states + self._nodes :] = 0.0
        kept = np.eye(len(mean)) - gain @ slope
        covariance = kept @ covariance @ kept.T + gain @ noise @ gain.T
        size = float(np.linalg.slogdet(2 * pi * spread)[1])
        gained = -0.5 * (float(innovation @ np.linalg.solve(spread, innovation)) + size)
        mean, first = mean + gain @ innovation, self._states + self._nodes
        mean[first:] = self._dynamics.bounded(mean[first:])
        return mean, 0.5 * (covariance + covariance.T), gained

    def _expected(self, mean: FloatArray, k: int) -> tuple[FloatArray, FloatArray]:
        """Expected readings and their derivative; the mean over a block lies half-way between its ends."""
        n, nodes = self._states, self._nodes
        p = self._dynamics.values(mean[n + nodes :])
        shown, slope = self._dynamics.readings(mean[:n], p)
        if not self._driven.run.averaged:
            return shown, slope
        motion = self._motion(mean, k)
        later, by_later = self._dynamics.readings(motion.states, p)
        by_state = by_later[:, :n]
        moved = np.hstack([motion.by_state, motion.by_heat, motion.by_air, motion.by_parameter])
        by_later = np.hstack([np.zeros_like(by_state), by_later[:, n:]]) + by_state @ moved
        return 0.5 * (shown + later), 0.5 * (slope + by_later)


def _blocks(run: Run) -> Run:
    """The end of a run in steps of about 10 s, none of its last seconds lost."""
    run = run.slice(float(run.time[-1]) - _MEMORY, float("inf"))
    factor = max(1, round(_BLOCK / run.step))
    steps = len(run) if run.averaged else len(run) - 1
    if factor == 1 or steps < factor:
        return run
    return run.slice(float(run.time[steps % factor]), float("inf")).coarsen(factor)


def _response(dynamics: Dynamics, driven: Drive) -> FloatArray:
    """Warming of each node by 1 W at each for as long as missing heat stays alike, added as squares [K/W]."""
    model, inputs = dynamics.model, driven.inputs.mean(axis=1)
    start = default_start(model, driven)
    motion = dynamics.step(start, np.zeros(len(model.nodes)), inputs, model.values, _HEAT_TIME)
    return np.asarray(np.linalg.norm(motion.by_heat[: len(model.nodes)], axis=1))
