"""How the simulated readings move with parameters and initial states: exact derivatives of the discrete run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from lptn.arrays import FloatArray
from lptn.model import Model
from lptn.simulate import Drive, default_start, over_steps, states_along, substeps

_CHUNK = 256  # internal steps differentiated at once: bounds the memory of a long run


@dataclass(frozen=True)
class Sensitivities:
    """Readings of a run and their derivatives.

    Args:
        readings: degC, shape (nodes, n).
        by_parameter: shape (nodes, n, number of chosen parameters), per unit of the parameter.
        by_start: shape (nodes, n, number of core states), K/K.
    """

    readings: FloatArray
    by_parameter: FloatArray
    by_start: FloatArray


def sensitivities(
    model: Model,
    driven: Drive,
    values: FloatArray,
    chosen: Sequence[int],
    start: FloatArray | None = None,
    core: int | None = None,
) -> Sensitivities:
    """Forward sensitivities of a free-running simulation.

    Args:
        values: parameters, shape (m,).
        chosen: indices of the parameters to differentiate by.
        start: initial states; by default the first readings.
        core: how many leading states to follow; those behind them must not act back on these (states of
            effects that are switched off). All by default.

    Raises:
        SimulationError: the parameters make the model too stiff, or it runs away.
    """
    start = default_start(model, driven) if start is None else start
    core = len(model.states) if core is None else core
    parts = substeps(model, driven, values, start)
    states = states_along(model, driven, values, start, parts)
    key = ("jacobians", core, tuple(chosen))
    jacobians = model.made_once(key, lambda: Jacobians(model, core, chosen))
    inputs = np.repeat(driven.inputs, parts, axis=1)
    # Columns: one for each chosen parameter, then one for each core state's initial value.
    followed = np.zeros((states.shape[1], core, len(chosen) + core))
    followed[0, :, len(chosen) :] = np.eye(core)
    step = driven.run.step / parts
    for first in range(0, inputs.shape[1], _CHUNK):
        window = slice(first, min(first + _CHUNK, inputs.shape[1]))
        transition, forcing = _discrete(model, jacobians, states[:, window], inputs[:, window], values, step)
        for k in range(window.stop - window.start):
            following = transition[k] @ followed[first + k]
            following[:, : len(chosen)] += forcing[k]
            followed[first + k + 1] = following
    return _readings(model, jacobians, driven, states[:, ::parts], values, followed[::parts])


def _discrete(
    model: Model, jacobians: Jacobians, x: FloatArray, u: FloatArray, p: FloatArray, h: float
) -> tuple[FloatArray, FloatArray]:
    """Derivative of each RK4 step by the state and by the parameters, stacked over the steps."""
    rate = model.made_once(("rates", x.shape[1]), lambda: model.rhs.map(x.shape[1]))
    repeated = np.repeat(p[:, None], x.shape[1], axis=1)
    point = x
    by_state, by_parameter = jacobians.rates(point, u, p)
    state_sum, parameter_sum = by_state.copy(), by_parameter.copy()
    identity = np.eye(by_state.shape[1])
    stage_state, stage_parameter = by_state, by_parameter
    for share, weight in ((h / 2, 2.0), (h / 2, 2.0), (h, 1.0)):
        point = x + share * rate(point, u, repeated).full()
        a, b = jacobians.rates(point, u, p)
        stage_parameter = b + share * (a @ stage_parameter)
        stage_state = a @ (identity + share * stage_state)
        state_sum += weight * stage_state
        parameter_sum += weight * stage_parameter
    return identity + h / 6 * state_sum, h / 6 * parameter_sum


def _readings(
    model: Model, jacobians: Jacobians, driven: Drive, states: FloatArray, p: FloatArray, followed: FloatArray
) -> Sensitivities:
    ends = states.shape[1]
    by_state, by_parameter = jacobians.readings(states, p)
    moved = by_state @ followed
    chosen = by_parameter.shape[2]
    moved[:, :, :chosen] += by_parameter
    derivative = over_steps(np.moveaxis(moved, 0, 2), driven.run.averaged)
    values = model.output.map(ends)(states, np.repeat(p[:, None], ends, axis=1)).full()
    derivative = np.moveaxis(derivative, 2, 1)
    return Sensitivities(over_steps(values, driven.run.averaged), derivative[:, :, :chosen], derivative[:, :, chosen:])


class Jacobians:
    """Derivatives of rates and readings evaluated at many points of a trajectory at once.

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
