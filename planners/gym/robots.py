"""Many robots of one model, each with temperatures and parameters of its own, stepped at once."""

from __future__ import annotations

from math import ceil

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.model.array_function import ArrayFunction
from lptn.model.model import Model
from lptn.simulate.dynamics import longest_step

HOT = 100.0  # degC, and inputs at their largest: where rates are near their fastest


class Robots:
    """States of `number` robots under a model.

    Args:
        model: at the values that the robots scatter about.
        number: of robots.
        period: seconds of one `advance`.
        fastest: inputs under which the network is at its fastest, shape (inputs,); largest speeds for one.
        spread: relative standard deviation of each free parameter from robot to robot.

    Attributes:
        states: degC, shape (states, number).
        values: parameters, shape (m, number).
    """

    def __init__(self, model: Model, number: int, period: float, fastest: FloatArray, spread: float = 0.0) -> None:
        self.model, self._spread = model, spread
        self._free = model.free
        self.states = np.full((len(model.states), number), 25.0)
        self.values = np.repeat(model.values[:, None], number, axis=1)
        longest = longest_step(model, np.full(len(model.states), HOT), fastest, model.values)
        self._steps = max(1, ceil(period / longest))
        self._advance = ArrayFunction(_steps(model, self._steps), number, (3,))
        self._period = period / self._steps

    def draw(self, robot: int, temperature: float, rng: np.random.Generator) -> None:
        """Begin anew with one robot.

        Args:
            robot: its number.
            temperature: of all its states [degC].
            rng: draws its parameters.
        """
        self.states[:, robot] = temperature
        self.values[:, robot] = self.model.values
        if self._spread > 0:
            # Capacities, resistances and coefficients are positive: their logarithms scatter.
            self.values[self._free, robot] *= np.exp(self._spread * rng.standard_normal(len(self._free)))

    def advance(self, inputs: FloatArray) -> None:
        """One period with the inputs held, shape (inputs, number)."""
        self.states = np.array(self._advance(self.states, inputs, self.values, [self._period]))


def _steps(model: Model, number: int) -> ca.Function:
    """(x, u, p, h) -> x after so many steps of h seconds."""
    if number == 1:
        return model.step("rk4")
    sizes = (len(model.states), len(model.inputs), len(model.parameters), 1)
    x, u, p, h = (ca.MX.sym(name, size) for name, size in zip("xuph", sizes, strict=True))
    end = model.step("rk4").mapaccum(number)(x, *(ca.repmat(symbol, 1, number) for symbol in (u, p, h)))[:, -1]
    return ca.Function("period", [x, u, p, h], [ca.densify(end)])
