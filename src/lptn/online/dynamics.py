"""A model's step with everything that an estimator doubts made a state, and the step's exact derivative."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np

from lptn.arrays import FloatArray
from lptn.model import Model
from lptn.online.enlarged import Call, Layout, functions, variances
from lptn.online.model_error import ModelError

BIAS_TIME = 3600.0
"""s; time constant of heat that is missing all along."""
_MAX_RATE = 1.0  # product of an internal step and a bound of the fastest rate; RK4 is exact to 1 % there
_LEAST_WALK = 1e-6  # K²/s; a node without any would cease to listen


@dataclass(frozen=True)
class Step:
    """States after a step, shape (z,); its derivative by those before it, (z, z); covariance gained, (z, z)."""

    states: FloatArray
    transition: FloatArray
    gained: FloatArray


class Dynamics:
    """Steps and readings of the enlarged state, with derivatives.

    Args:
        model: the model; its values serve where no parameter is doubted.
        error: what may be wrong with it.
        doubted: indices of the parameters that are states.
        walks: variance that each doubted parameter's coordinate gains [1/s], shape (doubted,).
    """

    def __init__(self, model: Model, error: ModelError, doubted: Sequence[int], walks: FloatArray) -> None:
        self.model = model
        self.layout = layout = Layout.of(model, error, len(doubted))
        columns = tuple(error.inputs)
        key = ("online", layout.lengths, columns, tuple(doubted))
        stages, rate, reading = model.made_once(key, lambda: functions(model, layout, columns, tuple(doubted)))
        n, nodes, values = layout.size, len(model.nodes), model.values
        self._z, self._u, self._h = np.zeros(n), np.zeros(len(model.inputs)), np.zeros(1)
        times = np.array([error.heat_time, BIAS_TIME])
        self._fastest = 1 / float(times.min())
        self.errors = variances(model, layout, error)
        self._times, self._walks = np.ones(n), np.zeros(n)
        self._times[layout.heat], self._times[layout.bias] = times
        self._walks[:nodes], self._walks[layout.parameters] = _LEAST_WALK, walks
        self._fading = self.errors.copy()
        self._fading[layout.bias.stop :] = 0.0  # the others last as long as the run
        self._next, self._jacobians = np.zeros(n), np.zeros((4, n, n))
        self._slope, self._jacobian = np.zeros(n), np.zeros((n, n))
        self._read, self._read_by = np.zeros(nodes), np.zeros((n, nodes))
        # CasADi writes columns first, so each matrix arrives transposed.
        self._stages = Call(stages, [self._z, self._u, values, times, self._h], [self._next, *self._jacobians])
        self._rate = Call(rate, [self._z, self._u, values, times], [self._slope, self._jacobian])
        self._reading = Call(reading, [self._z, values], [self._read, self._read_by])
        self._identity = np.eye(n)
        self._capacities = values[[model.network.capacities[node] for node in model.nodes]]

    def step(self, z: FloatArray, u: FloatArray, h: float) -> Step:
        """Advance by `h` seconds with the inputs held, in as many RK4 steps as the fastest rate asks for."""
        parts = self._parts(z, u, h)
        half = 0.5 * self._gained(h / parts)
        states, transition = self._one(z, u, h / parts)
        gained = self._spread(transition, half)
        for _ in range(parts - 1):
            states, by_last = self._one(states, u, h / parts)
            transition = by_last @ transition
            gained = by_last @ gained @ by_last.T + self._spread(by_last, half)
        return Step(states, transition, gained)

    def _spread(self, transition: FloatArray, half: FloatArray) -> FloatArray:
        """Covariance gained in a step, half of the variances before it and half behind it."""
        covariance = (transition * half) @ transition.T
        np.einsum("ii->i", covariance)[:] += half
        return covariance

    def readings(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What the sensors read [degC], shape (nodes,), and its derivative, shape (nodes, z)."""
        self._z[:] = z
        self._reading()
        return self._read.copy(), self._read_by.T.copy()

    def heat_flow(self, z: FloatArray, u: FloatArray) -> FloatArray:
        """Heat that flows into each node, less what leaves it [W], shape (nodes,)."""
        self._z[:], self._u[:] = z, u
        self._rate()
        return np.asarray(self._slope[: len(self._capacities)] * self._capacities)

    def _parts(self, z: FloatArray, u: FloatArray, h: float) -> int:
        self._z[:], self._u[:] = z, u
        self._rate()
        core = self._jacobian[self.layout.states, self.layout.states]
        # The largest row sum bounds every eigenvalue from above; the matrix is transposed.
        fastest = max(float(np.abs(core).sum(axis=0).max()), self._fastest)
        return max(1, ceil(h * fastest / _MAX_RATE))

    def _one(self, z: FloatArray, u: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """One RK4 step and its exact derivative, from the stages' Jacobians."""
        self._z[:], self._u[:], self._h[0] = z, u, h
        self._stages()
        first, second, third, fourth = (stage.T for stage in self._jacobians)
        second = second + h / 2 * (second @ first)
        third = third + h / 2 * (third @ second)
        fourth = fourth + h * (fourth @ third)
        return self._next.copy(), self._identity + h / 6 * (first + 2 * (second + third) + fourth)

    def _gained(self, h: float) -> FloatArray:
        """Variance that each state gains in a step, so that fading errors keep their size in the long run."""
        gained: FloatArray = 2 * self._fading * np.tanh(h / self._times) + self._walks * h
        return gained
