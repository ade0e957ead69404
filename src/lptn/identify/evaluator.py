"""Cost, gradient and Gauss-Newton Hessian of a problem, each point worked out once."""

from __future__ import annotations

import numpy as np

from lptn.arrays import FloatArray
from lptn.identify.problem import Problem
from lptn.simulate import SimulationError

_REMEMBERED = 4  # points whose costs are kept: a line search comes back to the last few
_DAMPING = 1e-10  # relative; keeps the Hessian positive where the data say nothing


class Evaluator:
    """A problem's cost and derivatives, scaled to a mean over the readings; the best point is kept."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.scale = 1.0 / max(problem.readings, 1)
        self.best = (float("inf"), np.zeros(problem.size))
        """The least cost seen, scaled, and where."""
        self._costs: dict[bytes, float] = {}
        self._key: bytes = b""
        self._derivatives: tuple[FloatArray, FloatArray] = (np.zeros(0), np.zeros(0))

    def cost(self, z: FloatArray) -> float:
        """Scaled cost; infinite where the model can't be simulated."""
        key = z.tobytes()
        if key not in self._costs:
            if len(self._costs) >= _REMEMBERED:
                self._costs.pop(next(iter(self._costs)))
            self._costs[key] = self.problem.cost(z) * self.scale
            if self._costs[key] < self.best[0]:
                self.best = (self._costs[key], z.copy())
        return self._costs[key]

    def derivatives(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Scaled gradient (size,) and Hessian (size, size); NaN where the model can't be simulated."""
        if z.tobytes() != self._key:
            try:
                gradient, hessian = self.problem.normal(z)
            except SimulationError:
                gradient = np.full(len(z), np.nan)
                hessian = np.full((len(z), len(z)), np.nan)
            damping = _DAMPING * max(float(np.trace(hessian)), 1e-12) * np.eye(len(z))
            self._derivatives = gradient * self.scale, (hessian + damping) * self.scale
            self._key = z.tobytes()
        return self._derivatives
