"""A model's rates of change: linearised, held exactly over a step, and stepped by Runge-Kutta with exact derivatives.

Everything that linearises a model stands on this file: the fit and its sensitivities, the state-space form, the filter
behind forecasts and monitoring, and the search for unexplained heat. `kernel.py` takes the same steps in
machine code.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import ceil, log2

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray, IntArray
from lptn.model.array_function import ArrayFunction
from lptn.model.model import Model
from lptn.simulate.kernel import MEAN_OF_A_STEP, AtPoints, Steps, differentiated_with, kernel

# --- The linearised rates dx/dt = f(x, u, p) ------------------------------------------------------

RATE_OF_A_STEP = 1.0
"""Largest product of a Runge-Kutta step and the fastest rate. Then e⁻¹ comes out as 0.375, 0.7 % of a transient's jump
too large; RK4 is stable up to 2.78."""


def longest_step(
    model: Model, x: FloatArray, u: FloatArray, p: FloatArray, rate_of_a_step: float = RATE_OF_A_STEP
) -> float:
    """The longest Runge-Kutta step at a point [s], shapes (states,), (inputs,), (m,)."""
    fastest = float(np.abs(np.linalg.eigvals(model.state_jacobian(x, u, p).full())).max())
    return rate_of_a_step / max(fastest, 1e-12)


def slopes_at_points(model: Model, x: FloatArray, u: FloatArray, p: FloatArray) -> FloatArray:
    """Derivatives of the rates by the states at n points [1/s], shape (n, states, states).

    Args:
        x: shape (states, n).
        u: shape (inputs, n).
        p: shape (m,).
    """
    compiled = kernel(model)
    if compiled is not None:
        return compiled.slopes(x, u, p)
    return model.made_once("slopes at points", lambda: AtPoints(model.state_jacobian))(x, u, p)


class Linearisation:
    """Derivatives of a model's rates and readings at many points of a trajectory at once.

    Args:
        model: the model to differentiate.
        core: how many leading states count; those behind them must not act back on these.
        chosen: indices of the parameters to differentiate by.
    """

    def __init__(self, model: Model, core: int, chosen: Sequence[int]) -> None:
        self._symbols, self._core, self._chosen = model.symbols, core, list(chosen)

    def rates(self, x: FloatArray, u: FloatArray, p: FloatArray) -> FloatArray:
        """[A B] at n points: d rates/dx beside d rates/dp, shape (n, core, core + chosen).

        Args:
            x: states, shape (states, n).
            u: inputs, shape (inputs, n).
            p: parameters, shape (m,).
        """
        return self._rates(x, u, p)

    def readings(self, x: FloatArray, p: FloatArray) -> FloatArray:
        """[C D] at n points: d readings/dx beside d readings/dp, shape (n, nodes, core + chosen)."""
        slopes = np.zeros((x.shape[1], *self._of_readings.shape))
        slopes[:, *self.nonzeros] = self.nonzeros_of_readings(x, p)
        return slopes

    def nonzeros_of_readings(self, x: FloatArray, p: FloatArray) -> FloatArray:
        """Those of [C D] that are not zero everywhere, shape (n, nonzeros); `nonzeros` says where they stand."""
        return self._nonzeros(x, np.zeros((0, x.shape[1])), p)[:, :, 0]

    @cached_property
    def nonzeros(self) -> tuple[IntArray, IntArray]:
        """Rows and columns of [C D] that are not zero everywhere, shape (nonzeros,) each."""
        rows, columns = self._of_readings.sparsity().get_triplet()
        return np.array(rows), np.array(columns)

    @cached_property
    def _of_readings(self) -> ca.SX:
        x, _, p, _, readings = self._symbols
        return ca.jacobian(readings, ca.vertcat(x[: self._core], p[self._chosen]))

    @cached_property
    def _nonzeros(self) -> AtPoints:
        x, _, p, _, _ = self._symbols
        nonzeros = ca.vertcat(*self._of_readings.nonzeros())  # type: ignore[call-overload]
        return AtPoints(ca.Function("readings", [x, ca.SX(0, 1), p], [nonzeros]))

    @cached_property
    def _rates(self) -> AtPoints:
        x, u, p, rates, _ = self._symbols
        slopes = ca.jacobian(rates[: self._core], ca.vertcat(x[: self._core], p[self._chosen]))
        return AtPoints(ca.Function("rates", [x, u, p], [ca.densify(slopes)]))


_SCALED, _TAYLOR_ORDER = 0.5, 14  # the first term of the series that is left out is below 1e-17 of the first


def zero_order_hold(a: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    r"""The exact step of :math:`\dot x = A x + v` with v held: :math:`x(h) = e^{Ah} x(0) + \int_0^h e^{As} ds\, v`.

    By scaling and squaring of a Taylor series of :math:`\varphi(z) = (e^z - 1)/z`, for a stack of matrices at once.
    SciPy's exponential of a larger matrix [VanLoan1978] says the same; it takes a third of a second to import.

    Args:
        a: A [1/s], shape (..., n, n).
        step: h [s].

    Returns:
        Transition and integral [s], each of A's shape; not a number where A is not finite.
    """
    identity = np.eye(a.shape[-1])
    norm = step * float(np.abs(a).sum(axis=-1).max(initial=0.0))
    if not np.isfinite(norm):
        return np.full(a.shape, np.nan), np.full(a.shape, np.nan)
    squarings = max(0, ceil(log2(max(norm, _SCALED) / _SCALED)))
    z = a * (step / 2**squarings)
    phi = np.broadcast_to(identity, a.shape)
    for order in range(_TAYLOR_ORDER, 1, -1):
        phi = identity + z @ phi / order
    transition = identity + z @ phi
    for _ in range(squarings):
        phi = (phi + transition @ phi) / 2
        transition = transition @ transition
    return transition, step * phi


def runge_kutta_derivative(
    slopes: Sequence[FloatArray], step: float, weights: Sequence[float] = (1 / 6, 1 / 3, 1 / 3, 1 / 6)
) -> FloatArray:
    """Exact derivative of one RK4 step by state and parameters, shape (..., n, n + m).

    Args:
        slopes: the derivatives [A B] of the rates at each of the step's four stages, shape (..., n, n + m).
        step: s.
        weights: of the four slopes; `MEAN_OF_A_STEP` for the mean over the step.
    """
    n = slopes[0].shape[-2]
    stage, total = slopes[0], weights[0] * slopes[0]
    for share, weight, slope in zip((step / 2, step / 2, step), weights[1:], slopes[1:], strict=True):
        stage = slope + share * (slope[..., :n] @ stage)
        total += weight * stage
    total *= step
    total[..., range(n), range(n)] += 1.0
    return total


# --- A model stepped along its inputs, in machine code where a C compiler is there ----------------

_CHUNK = 256  # steps that the interpreter differentiates at once: more need memory and are no faster


class Stepper:
    """Runge-Kutta steps of one model, with derivatives by the same parameters each time.

    Args:
        model: the model.
        core: how many leading states to differentiate; those behind them must not act back on these.
        chosen: indices of the parameters to differentiate by.
    """

    def __init__(self, model: Model, core: int, chosen: Sequence[int]) -> None:
        self.model, self.core, self.chosen = model, core, tuple(chosen)

    @cached_property
    def linearisation(self) -> Linearisation:
        """Derivatives of the model's rates and readings at single points."""
        return Linearisation(self.model, self.core, self.chosen)

    def run(
        self,
        start: FloatArray,
        derivative: FloatArray,
        inputs: FloatArray,
        p: FloatArray,
        step: float,
        substeps: int,
        averaged: bool,
    ) -> Steps:
        """Steps through n rows, with derivatives; arguments as for `Kernel.run`."""
        compiled = kernel(self.model, self.core, self.chosen)
        if compiled is not None:
            return compiled.run(start, inputs, p, step, substeps, averaged, derivative)
        core, chosen, n, h = self.core, len(self.chosen), inputs.shape[1], step / substeps
        fine = np.repeat(inputs, substeps, axis=1)
        states = _path(self.model, start, fine, p, h)
        derivatives = np.zeros((n, *derivative.shape))

        def moved(of_step: FloatArray) -> FloatArray:
            following = of_step[:, :core] @ derivative
            following[:, :chosen] += of_step[:, core:]
            return np.asarray(following)

        for first in range(0, n * substeps, _CHUNK):
            window = slice(first, min(first + _CHUNK, n * substeps))
            slopes = self._slopes(states[:, window], fine[:, window], p, h)
            of_steps, of_means = runge_kutta_derivative(slopes, h), runge_kutta_derivative(slopes, h, MEAN_OF_A_STEP)
            for k, (of_step, of_mean) in enumerate(zip(of_steps, of_means, strict=True), start=first):
                if averaged:
                    derivatives[k // substeps] += moved(of_mean) / substeps
                elif k % substeps == 0:
                    derivatives[k // substeps] = derivative
                derivative = moved(of_step)
        held = _means(self.model, states[:, :-1], fine, p, h, substeps) if averaged else states[:, :-1:substeps]
        return Steps(states[:, ::substeps], held, derivatives, derivative)

    def of_readings(
        self, states: FloatArray, p: FloatArray, derivatives: FloatArray, asked: slice | IntArray
    ) -> FloatArray:
        """Derivatives of what sensors read, shape (n, asked nodes, chosen + core), from those of the core states.

        Args:
            states: shape (states, n).
            p: parameters, shape (m,).
            derivatives: shape (n, core, chosen + core).
            asked: of which nodes.
        """
        # An index in brackets would put the nodes first in memory, and each use of the derivatives would copy them.
        of_nodes = derivatives[:, : len(self.model.nodes)]
        of_nodes = of_nodes[:, asked] if isinstance(asked, slice) else of_nodes.take(asked, 1)
        if self.model.reads_directly:
            return of_nodes
        of_readings, slopes = of_nodes.copy(), self._shared
        values = slopes.nonzeros_of_readings(states, p).T
        place = {int(node): row for row, node in enumerate(np.arange(len(self.model.nodes))[asked])}
        terms = [term for term in zip(*slopes.nonzeros, values, strict=True) if term[0] in place]
        # Nearly all sensors read their node's state, as it is.
        own = {node: value for node, column, value in terms if node == column}
        for node, row in place.items():
            value = own.get(node, np.zeros(1))
            if not (value == 1.0).all():
                of_readings[:, row] *= value[:, None]
        for node, column, value in terms:
            if column < self.core and column != node:
                of_readings[:, place[node]] += value[:, None] * derivatives[:, column]
            elif column >= self.core and (number := self._numbers.get(column - self.core)) is not None:
                of_readings[:, place[node], number] += value
        return of_readings

    @cached_property
    def _shared(self) -> Linearisation:
        """The linearisation by all parameters that derivatives are made by, in common with other choices of them."""
        parameters = differentiated_with(self.model, self.chosen)
        key = ("linearisation", self.core, tuple(parameters))
        return self.model.made_once(key, lambda: Linearisation(self.model, self.core, parameters))

    @cached_property
    def _numbers(self) -> dict[int, int]:
        """The numbers among the chosen parameters of those in common."""
        parameters = differentiated_with(self.model, self.chosen)
        return {parameters.index(index): number for number, index in enumerate(self.chosen)}

    def _slopes(self, x: FloatArray, u: FloatArray, p: FloatArray, h: float) -> list[FloatArray]:
        """[A B] at the four stages of n RK4 steps, shape (n, core, core + chosen) each."""
        rates = _rates(self.model, x.shape[1])
        point, slopes = x, [self.linearisation.rates(x, u, p)]
        for share in (h / 2, h / 2, h):
            point = x + share * rates(point, u, p)
            slopes.append(self.linearisation.rates(point, u, p))
        return slopes


def stepper(model: Model, core: int, chosen: Sequence[int]) -> Stepper:
    """The stepper of a model, made once for it and all its copies at other values."""
    return model.made_once(("stepper", core, tuple(chosen)), lambda: Stepper(model, core, chosen))


def stepped(
    model: Model,
    start: FloatArray,
    inputs: FloatArray,
    p: FloatArray,
    step: float,
    substeps: int = 1,
    averaged: bool = False,
) -> Steps:
    """Steps through n rows without derivatives; arguments as for `Kernel.run`."""
    compiled = kernel(model)
    if compiled is not None:
        return compiled.run(start, inputs, p, step, substeps, averaged)
    fine = np.repeat(inputs, substeps, axis=1)
    states = _path(model, start, fine, p, step / substeps)
    starts = states[:, :-1]
    held = _means(model, starts, fine, p, step / substeps, substeps) if averaged else starts[:, ::substeps]
    return Steps(states[:, ::substeps], held, np.empty((0, 0, 0)), np.empty((0, 0)))


def _path(model: Model, start: FloatArray, inputs: FloatArray, p: FloatArray, h: float) -> FloatArray:
    """States at the n + 1 ends of n Runge-Kutta steps by the interpreter, shape (states, n + 1)."""
    n = inputs.shape[1]
    path = model.made_once(("path", n), lambda: ArrayFunction(model.run(n)))(start, inputs, p, h)
    return np.hstack([start[:, None], path])


def _means(model: Model, starts: FloatArray, inputs: FloatArray, p: FloatArray, h: float, substeps: int) -> FloatArray:
    """Means over rows of so many Runge-Kutta steps, by the interpreter; shapes (states or inputs, steps)."""
    rates, point, means = _rates(model, starts.shape[1]), starts, starts.copy()
    for share, weight in zip((h / 2, h / 2, h, 0.0), MEAN_OF_A_STEP, strict=True):
        slope = rates(point, inputs, p)
        means += h * weight * slope
        point = starts + share * slope
    return np.asarray(means.reshape(len(means), -1, substeps).mean(axis=2))


def _rates(model: Model, n: int) -> ArrayFunction:
    return model.made_once(("rates", n), lambda: ArrayFunction(model.rhs, n, common=(2,)))
