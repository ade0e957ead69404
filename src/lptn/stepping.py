"""A model stepped along its inputs, with or without derivatives: in machine code once that pays."""

from __future__ import annotations

from collections.abc import Sequence
from subprocess import CalledProcessError

import numpy as np

from lptn.arrays import FloatArray
from lptn.compiled import Kernel
from lptn.jacobians import Jacobians
from lptn.model import Model

_WORTH = 1_000  # steps with derivatives after which compiling, a fifth of a second, has been worth it
_CHUNK = 256  # internal steps that CasADi's interpreter differentiates at once


class Stepper:
    """Runge-Kutta steps of one model, with derivatives by the same parameters each time.

    CasADi's interpreter takes the first steps. A model that is stepped often gets compiled on the way, if a C
    compiler is there: a fit of a whole robot then runs ten times as fast.

    Args:
        model: the model.
        core: how many leading states to differentiate; those behind them must not act back on these.
        chosen: indices of the parameters to differentiate by.
    """

    def __init__(self, model: Model, core: int, chosen: Sequence[int]) -> None:
        self.model, self.core, self.chosen = model, core, tuple(chosen)
        self.jacobians = Jacobians(model, core, chosen)
        self._steps_before_compiling: float = _WORTH
        self._kernel: Kernel | None = None

    def compile(self) -> bool:
        """Compile now; whether there is machine code to run."""
        self._steps_before_compiling = float("inf")  # where it fails once it would fail again
        try:
            self._kernel = self.model.made_once(
                ("kernel", self.core, self.chosen), lambda: Kernel(self.model, self.core, self.chosen)
            )
        except (OSError, CalledProcessError):
            return False
        self.model.made_once("any kernel", lambda: self._kernel)
        return True

    def follow(
        self, start: FloatArray, moved: FloatArray, inputs: FloatArray, p: FloatArray, step: float, parts: int
    ) -> tuple[FloatArray, FloatArray]:
        """States, and their derivatives, at the n + 1 ends of n steps.

        Args:
            start: initial states, shape (states,).
            moved: their derivatives, shape (core, chosen + core).
            inputs: held over each step, shape (inputs, n).
            p: parameters, shape (m,).
            step: length of a step [s].
            parts: internal Runge-Kutta steps of each.

        Returns:
            Shapes (states, n + 1) and (n + 1, core, chosen + core).
        """
        self._steps_before_compiling -= inputs.shape[1] * parts
        if self._steps_before_compiling < 0:
            self.compile()
        if self._kernel is not None:
            states, followed = self._kernel.run(start, inputs, p, step, parts, moved)
            return states.T, followed
        return self._interpreted(start, moved, np.repeat(inputs, parts, axis=1), p, step / parts, parts)

    def _interpreted(
        self, start: FloatArray, moved: FloatArray, inputs: FloatArray, p: FloatArray, h: float, parts: int
    ) -> tuple[FloatArray, FloatArray]:
        path = self.model.run(inputs.shape[1])(start, inputs, p, h).full()
        states = np.hstack([start[:, None], path])
        followed = np.empty((inputs.shape[1] // parts + 1, *moved.shape))
        followed[0] = moved
        for first in range(0, inputs.shape[1], _CHUNK):
            window = slice(first, min(first + _CHUNK, inputs.shape[1]))
            transition, forcing = self._discrete(states[:, window], inputs[:, window], p, h)
            for k in range(window.stop - window.start):
                moved = transition[k] @ moved
                moved[:, : len(self.chosen)] += forcing[k]
                if (first + k + 1) % parts == 0:
                    followed[(first + k + 1) // parts] = moved
        return states[:, ::parts], followed

    def _discrete(self, x: FloatArray, u: FloatArray, p: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """Derivative of each RK4 step by the state and by the parameters, stacked over the steps."""
        rate = self.model.made_once(("rates", x.shape[1]), lambda: self.model.rhs.map(x.shape[1]))
        repeated = np.repeat(p[:, None], x.shape[1], axis=1)
        point = x
        by_state, by_parameter = self.jacobians.rates(point, u, p)
        state_sum, parameter_sum = by_state.copy(), by_parameter.copy()
        identity = np.eye(by_state.shape[1])
        stage_state, stage_parameter = by_state, by_parameter
        for share, weight in ((h / 2, 2.0), (h / 2, 2.0), (h, 1.0)):
            point = x + share * rate(point, u, repeated).full()
            a, b = self.jacobians.rates(point, u, p)
            stage_parameter = b + share * (a @ stage_parameter)
            stage_state = a @ (identity + share * stage_state)
            state_sum += weight * stage_state
            parameter_sum += weight * stage_parameter
        return identity + h / 6 * state_sum, h / 6 * parameter_sum


def stepper(model: Model, core: int, chosen: Sequence[int]) -> Stepper:
    """The stepper of a model, made once for it and all its copies at other values."""
    return model.made_once(("stepper", core, tuple(chosen)), lambda: Stepper(model, core, chosen))


def states_along(
    model: Model, start: FloatArray, inputs: FloatArray, p: FloatArray, step: float, parts: int
) -> FloatArray:
    """States at the n + 1 ends of n steps, shape (states, n + 1); arguments as for `Stepper.follow`."""
    kernel = model.made.get("any kernel")
    if kernel is not None:
        return np.ascontiguousarray(kernel.run(start, inputs, p, step, parts, None)[0].T)
    fine = np.repeat(inputs, parts, axis=1)
    path = model.run(fine.shape[1])(start, fine, p, step / parts).full()
    return np.hstack([start[:, None], path[:, parts - 1 :: parts]])
