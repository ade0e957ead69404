"""A model's motion over a time step, with derivatives by all that a forecast doubts."""

from __future__ import annotations

from math import ceil
from typing import NamedTuple

import casadi as ca
import numpy as np
from scipy.linalg import expm

from lptn.arrays import FloatArray
from lptn.jacobians import Jacobians
from lptn.model import Model
from lptn.parameters import Transform

_MAX_RATE = 1.0  # product of an RK4 step and a bound of the fastest rate


class Motion(NamedTuple):
    """One step: the states behind it, and their derivatives.

    Args:
        states: shape (states,).
        by_state: shape (states, states).
        by_heat: by heat [W] that the model lacks at the nodes, held over the step, shape (states, nodes).
        by_air: by the logarithm of a factor on all conductances to prescribed temperatures, shape (states, 1).
        by_parameter: by the coordinates of the free parameters, shape (states, free).
        by_input: by inputs held over the step, shape (states, inputs).
    """

    states: FloatArray
    by_state: FloatArray
    by_heat: FloatArray
    by_air: FloatArray
    by_parameter: FloatArray
    by_input: FloatArray


class Dynamics:
    """Steps of any length of a model, and its readings, with derivatives.

    Args:
        model: the model, at the values to use.
    """

    def __init__(self, model: Model) -> None:
        self.model, self._values, self._free = model, model.values, model.free
        free = [model.unknowns[index] for index in self._free]
        self._transform = Transform(free)
        self._fitted = self._transform.forward(self._values[self._free])
        bounds = np.array([unknown.declared.bounds for unknown in free], dtype=float).reshape(-1, 2)
        self._bounds = [self._transform.forward(bound) for bound in bounds.T]
        prescribed = model.network.prescribed
        outward = [link.resistance for link in model.network.resistors if not prescribed.keys().isdisjoint(link.ends)]
        self._outward = list(dict.fromkeys(outward))
        chosen = list(dict.fromkeys([*self._free, *self._outward]))
        self._outward_columns = [chosen.index(index) for index in self._outward]
        key = ("jacobians", len(model.states), tuple(chosen))
        self._jacobians = model.made_once(key, lambda: Jacobians(model, len(model.states), chosen))
        self._by_input = model.made_once("input jacobian", self._make_by_input)
        self._capacities = [model.network.capacities[node] for node in model.nodes]

    def values(self, errors: FloatArray) -> FloatArray:
        """Parameter values, shape (m,), corrected.

        Args:
            errors: logarithm of a factor on all conductances to prescribed temperatures, then what is added
                to the free parameters' coordinates, shape (1 + free,).
        """
        values = self._values.copy()
        values[self._free] = self._transform.backward(self._fitted + errors[1:])
        values[self._outward] *= np.exp(-errors[0])
        return values

    def bounded(self, errors: FloatArray) -> FloatArray:
        """What `values` takes, changed so that each parameter stays within its bounds."""
        return np.concatenate([errors[:1], np.clip(self._fitted + errors[1:], *self._bounds) - self._fitted])

    def rates(self, x: FloatArray, u: FloatArray, p: FloatArray) -> FloatArray:
        """d rates / d states [1/s]."""
        return np.asarray(self._jacobians.rates(x[:, None], u[:, None], p)[0][0])

    def step(self, x: FloatArray, heat: FloatArray, u: FloatArray, p: FloatArray, h: float) -> Motion:
        """States after `h` seconds with everything held.

        Args:
            x: states [degC].
            heat: that the model lacks at each node [W].
            u: inputs.
            p: all parameter values.
        """
        n, nodes = len(x), len(heat)
        by_state, by_value = (stack[0] for stack in self._jacobians.rates(x[:, None], u[:, None], p))
        free = len(self._free)
        by_parameter = by_value[:, :free] * self._slope(p)
        by_air = -by_value[:, self._outward_columns] @ p[self._outward]
        # The exponential's integral comes with it, as a block of a larger exponential.
        block = expm(np.block([[by_state * h, np.eye(n) * h], [np.zeros((n, 2 * n))]]))
        transition, held = block[:n, :n], block[:n, n:]
        parts = max(1, ceil(float(np.abs(by_state).sum(axis=1).max()) * h / _MAX_RATE))
        function, following = self.model.step("rk4"), x
        for _ in range(parts):
            following = function(following, u, p, h / parts).full().ravel()
        by_heat = held[:, :nodes] / p[self._capacities]
        by_input = held @ self._by_input(x, u, p).full()
        following = following + by_heat @ heat
        return Motion(following, transition, by_heat, held @ by_air[:, None], held @ by_parameter, by_input)

    def readings(self, x: FloatArray, p: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Expected readings [degC], and their derivative by states, heat, air and the free parameters' coordinates."""
        by_state, by_value = (stack[0] for stack in self._jacobians.readings(x[:, None], p))
        nodes, free = len(self.model.nodes), len(self._free)
        by_parameter = by_value[:, :free] * self._slope(p)
        slope = np.hstack([by_state, np.zeros((nodes, nodes + 1)), by_parameter])
        return self.model.output(x, p).full().ravel(), slope

    def _slope(self, p: FloatArray) -> FloatArray:
        return self._transform.slope(p[self._free])

    def _make_by_input(self) -> ca.Function:
        x, u, p, rates, _ = self.model.symbols
        return ca.Function("by_input", [x, u, p], [ca.densify(ca.jacobian(rates, u))])
