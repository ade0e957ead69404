"""Derivatives of rates and readings, evaluated at many points of a trajectory at once."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from lptn.arrays import FloatArray
from lptn.model import Model


class Jacobians:
    """Derivatives of a model's rates and readings.

    Args:
        model: the model to differentiate.
        core: how many leading states count.
        chosen: indices of the parameters to differentiate by.
    """

    def __init__(self, model: Model, core: int, chosen: Sequence[int]) -> None:
        x, u, p, rates, readings = model.symbols
        states, parameters = x[:core], p[list(chosen)]
        self._rates = _Stacked([x, u, p], [(rates[:core], states), (rates[:core], parameters)])
        self._readings = _Stacked([x, p], [(readings, states), (readings, parameters)])

    def rates(self, x: FloatArray, u: FloatArray, p: FloatArray) -> list[FloatArray]:
        """Stacks of d rate/dx, shape (n, core, core), and d rate/dp, shape (n, core, chosen)."""
        return self._rates(x, u, np.repeat(p[:, None], x.shape[1], axis=1))

    def readings(self, x: FloatArray, p: FloatArray) -> list[FloatArray]:
        """Stacks of d reading/dx, shape (n, nodes, core), and d reading/dp, shape (n, nodes, chosen)."""
        return self._readings(x, np.repeat(p[:, None], x.shape[1], axis=1))


class _Stacked:
    """Sparse Jacobians of several expressions, evaluated over columns of arguments into dense stacks."""

    def __init__(self, arguments: list[ca.SX], pairs: list[tuple[ca.SX, ca.SX]]) -> None:
        jacobians = [ca.jacobian(expression, variable) for expression, variable in pairs]
        self._shapes = [jacobian.shape for jacobian in jacobians]
        self._patterns = [
            np.array(jacobian.sparsity().get_triplet(), dtype=int).reshape(2, -1) for jacobian in jacobians
        ]
        entries = [entry for jacobian in jacobians for entry in jacobian.nonzeros()]
        nonzeros = ca.vertcat(*entries)  # type: ignore[call-overload]
        self._function = ca.Function("nonzeros", arguments, [ca.densify(nonzeros)])
        self._maps: dict[int, ca.Function] = {}

    def __call__(self, *arguments: FloatArray) -> list[FloatArray]:
        n = arguments[0].shape[1]
        mapped = self._maps.setdefault(n, self._function.map(n))
        values = mapped(*arguments).full().T.reshape(n, -1)
        stacks, start = [], 0
        for (rows, columns), shape in zip(self._patterns, self._shapes, strict=True):
            stack = np.zeros((n, *shape))
            stack[:, rows, columns] = values[:, start : start + len(rows)]
            start += len(rows)
            stacks.append(stack)
        return stacks
