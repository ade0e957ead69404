"""Start values without a guess: linear least squares on the integrated heat balance.

Integrating ``C dT/dt = Σ (T_j - T_i)/R + Σ Q`` once along the *measured* temperatures leaves an equation that is
linear in capacitances, conductances and amplitudes of heat: no simulation, no guess, milliseconds. Its error, like
any other, is predicted − measured: the heat that the terms give less the heat that the measured rise has stored.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.identify.bounded_minimum import bounded_minimum
from lptn.model.model import Model
from lptn.simulate.bound_run import BoundRun, default_start
from lptn.simulate.kernel import AtPoints


def integral_start(model: Model, bound_runs: Sequence[BoundRun], sigma: FloatArray) -> FloatArray:
    """Parameter values, shape (m,), that balance the integrated heat; nonlinear ones stay as declared.

    Args:
        model: the model; its values serve where the data say nothing.
        bound_runs: the runs; unmeasured nodes contribute no equation.
        sigma: scatter of each node's readings [K], shape (nodes,).
    """
    system = _LinearBalance(model)
    if not system.chosen:
        return model.values
    products = np.zeros((len(system.chosen) + 1, len(system.chosen) + 1))
    for bound in bound_runs:
        for rows in system.equations(bound, sigma):
            products += rows.T @ rows  # stand for all rows: hours of data take no more memory than minutes
    return system.solve(products[:-1, :-1], products[:-1, -1])


class _LinearBalance:
    """∫q − C·ΔT as an expression linear in transformed parameters w (conductances instead of resistances)."""

    def __init__(self, model: Model) -> None:
        self.model = model
        x, u, p, rates, _ = model.symbols
        capacities = [model.network.capacities[node] for node in model.nodes]
        self._inverse = np.array(
            [not parameter.effect and parameter.declared.name == "resistance" for parameter in model.parameters]
        )
        w = ca.SX.sym("w", len(model.parameters))
        as_declared = ca.vertcat(*(1 / w[i] if inverse else w[i] for i, inverse in enumerate(self._inverse)))
        heat = ca.substitute(rates[: len(capacities)] * p[capacities], p, as_declared)
        self.chosen = [
            i
            for i in model.free
            if (not (own := model.parameters[i]).effect and own.declared.name in ("capacity", "resistance"))
            or model.parameters[i].declared.off is not None
        ]
        self.chosen = _jointly_linear(heat, w, self.chosen)
        self._capacities = capacities
        both = ca.densify(ca.horzcat(heat, ca.jacobian(heat, w[self.chosen])))
        self._heat = AtPoints(ca.Function("heat", [x, u, w], [both]))
        values = model.values
        self._declared = np.where(self._inverse, 1.0 / np.where(self._inverse, values, 1.0), values)

    def equations(self, bound: BoundRun, sigma: FloatArray) -> Iterator[FloatArray]:
        """Rows [∂/∂w, right-hand side] of one run, node by node, in standard deviations.

        Each node's rows share an unknown constant, the noise of its first readings: taking the mean off removes it.
        """
        model, nodes = self.model, len(self.model.nodes)
        temperatures = _filled(bound)
        states = _resting(model, bound, temperatures)
        n = len(bound)
        w0 = model.in_run(bound.run.name, self._declared).copy()
        w0[self.chosen] = 0.0  # leaves the heat that no chosen parameter changes
        # Shape (nodes, 1 + chosen, n): the constant heat, then what each chosen parameter adds a unit of itself.
        rates = np.moveaxis(self._heat(states, bound.inputs, w0), 0, 2)
        integrals = np.zeros(rates.shape)
        np.cumsum(rates[..., :-1], axis=-1, out=integrals[..., 1:])
        integrals *= bound.run.step
        rise = temperatures - temperatures[:, :1]
        most_rows = 400  # instants of each run that enter
        instants = np.unique(np.linspace(0, n - 1, min(n, most_rows)).astype(int))
        for i in range(nodes):
            kept = instants[bound.counted[i][instants]]
            if kept.size == 0:
                continue
            capacity = self._capacities[i]
            block, side = integrals[i, 1:].T[kept], -integrals[i, 0][kept]
            if capacity in self.chosen:
                block[:, self.chosen.index(capacity)] -= rise[i][kept]
            else:
                side = side + self._declared[capacity] * rise[i][kept]
            whole = np.column_stack([block, side]) / (self._declared[capacity] * sigma[i])
            yield whole - whole.mean(axis=0)

    def solve(self, squares: FloatArray, sides: FloatArray) -> FloatArray:
        """Bounded least squares with a weak pull to the declared values, from the normal equations."""
        model, declared, bounds = self.model, self._declared[self.chosen], []
        scale = np.abs(declared)
        for number, index in enumerate(self.chosen):
            parameter = model.parameters[index].declared
            scale[number] = scale[number] or abs(parameter.typical) or 1.0
            lower, upper = parameter.bounds
            bounds.append((1 / upper, 1 / lower if lower > 0 else np.inf) if self._inverse[index] else (lower, upper))
        slope = (squares @ declared - sides) * scale
        ridge = 1.0  # weight of a declared value: so far from it costs as much as one standard deviation of the data
        curvature = squares * np.outer(scale, scale) + ridge**2 * np.eye(len(scale))
        least, most = ((np.array(bounds) - declared[:, None]) / scale[:, None]).T
        w = self._declared.copy()
        w[self.chosen] += bounded_minimum(slope, curvature, least, most) * scale
        faint = 1e-12  # W/K; a link that conducts less is none
        values = np.divide(1.0, np.maximum(w, faint), out=w.copy(), where=self._inverse)
        return np.where(np.isin(np.arange(len(values)), self.chosen), values, model.values)


def _resting(model: Model, bound: BoundRun, temperatures: FloatArray) -> FloatArray:
    """All states in equilibrium with the measured temperatures, shape (states, n).

    A hidden state follows its nodes; one beside a prescribed temperature stays where that begins.
    """
    hidden = model.resting_shares @ temperatures
    beside_prescribed = np.flatnonzero(model.resting_shares.sum(axis=1) == 0)
    start = default_start(model, bound)[len(model.nodes) :]
    hidden[beside_prescribed] = start[beside_prescribed][:, None]
    return np.vstack([temperatures, hidden])


def _jointly_linear(heat: ca.SX, w: ca.SX, chosen: list[int]) -> list[int]:
    """The chosen parameters without those that multiply another one (a gain on a conductance), or themselves."""
    slopes = ca.densify(ca.jacobian(heat, w[chosen]))
    rows, columns = ca.jacobian_sparsity(ca.vec(slopes), w[chosen]).get_triplet()
    multiplied = np.zeros((len(chosen), len(chosen)), dtype=bool)
    multiplied[np.array(rows, dtype=int) // heat.numel(), np.array(columns, dtype=int)] = True
    kept: list[int] = []
    for number in range(len(chosen)):
        if not multiplied[number, [*kept, number]].any():
            kept.append(number)
    return [chosen[number] for number in kept]


def _filled(bound: BoundRun) -> FloatArray:
    """Measured temperatures with gaps bridged; an unmeasured node takes the mean of the others."""
    n = len(bound)
    filled = np.full_like(bound.measured, np.nan)
    for row, readings in enumerate(bound.measured):
        finite = np.isfinite(readings)
        if finite.any():
            filled[row] = np.interp(np.arange(n), np.flatnonzero(finite), readings[finite])
    mean = np.nanmean(filled, axis=0)
    return np.where(np.isnan(filled), mean, filled)
