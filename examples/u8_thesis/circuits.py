"""Networks of the stalled U8 that conserve energy, in plain NumPy: the consistent truth beside the thesis's circuit.

Node 0 is the winding. At a constant current the network is linear, since the copper loss grows linearly with the
winding's temperature, so its answer is a sum of exponentials: no time steps, nothing shared with `lptn.model.model`.
Ours, not the thesis's: C_w T_w' = I²R (1 + α (T_w - T_a)) - …
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]
AMBIENT, RESISTANCE, ALPHA = 21.5, 0.186, 0.0039  # degC, ohm, 1/K


@dataclass(frozen=True)
class Circuit:
    """Capacities [J/K] (n,), conductances between nodes [W/K] (n, n) symmetric, to the air [W/K] (n,)."""

    capacities: Array
    between: Array
    to_air: Array
    housing: int

    def system(self, current: float) -> tuple[Array, Array]:
        """A [1/s] (n, n) and b [K/s] (n,) of x' = A x + b, x in K above the ambient, at a current [A]."""
        exchange = self.between - np.diag(self.between.sum(axis=1) + self.to_air)
        loss = current**2 * RESISTANCE
        exchange[0, 0] += ALPHA * loss
        drive = np.zeros(len(self.capacities))
        drive[0] = loss
        return exchange / self.capacities[:, None], drive / self.capacities

    def rise(self, current: float, times: Array, start: Array | None = None) -> Array:
        """Temperatures above the ambient [K], shape (n, number of times), from `start` [K] (n,) or from rest."""
        a, b = self.system(current)
        start = np.zeros(len(b)) if start is None else start
        steady = -np.linalg.solve(a, b)
        rates, modes = np.linalg.eig(a)
        weights = np.linalg.solve(modes, (start - steady).astype(complex))
        path = steady[:, None] + ((modes * weights) @ np.exp(np.outer(rates, times))).real
        return np.asarray(path, dtype=float)

    def steady(self, current: float) -> float:
        """Winding temperature in the end [degC]; infinite where the copper loss outgrows the cooling."""
        a, b = self.system(current)
        if np.linalg.eigvals(a).real.max() >= 0:
            return math.inf
        return AMBIENT + float(-np.linalg.solve(a, b)[0])

    def time_to(self, level: float, current: float, longest: float = 3000.0) -> float:
        """When the winding reaches a level [degC] from rest [s]; infinite where it takes longer than `longest`."""
        grid = np.concatenate([[0.0], np.geomspace(0.05, longest, 400)])
        over = np.flatnonzero(self.rise(current, grid)[0] >= level - AMBIENT)
        if over.size == 0:
            return math.inf
        between = grid[over[0] - 1], grid[over[0]]
        return float(brentq(lambda t: self.rise(current, np.array([t]))[0, 0] + AMBIENT - level, *between))

    def runaway_current(self) -> float:
        """The current [A] above which no steady state exists."""
        return float(brentq(lambda i: np.linalg.eigvals(self.system(i)[0]).real.max(), 1.0, 200.0))


def two_nodes(c_w: float, r_wh: float, c_h: float, r_ha: float) -> Circuit:
    """Winding and housing; J/K and K/W."""
    return chain([c_w, c_h], [r_wh], r_ha)


def chain(capacities: list[float], resistances: list[float], r_air: float) -> Circuit:
    """Nodes in a row from the winding to the housing, the last one cooled by the air."""
    n = len(capacities)
    between = np.zeros((n, n))
    for i, resistance in enumerate(resistances):
        between[i, i + 1] = between[i + 1, i] = 1 / resistance
    to_air = np.zeros(n)
    to_air[-1] = 1 / r_air
    return Circuit(np.array(capacities), between, to_air, n - 1)


def with_sink(circuit: Circuit, at: int, r_pipes: float, c_sink: float, r_sink: float) -> Circuit:
    """The same network with a heat sink [J/K, K/W] behind heat pipes [K/W] at one of its nodes."""
    n = len(circuit.capacities)
    between = np.zeros((n + 1, n + 1))
    between[:n, :n] = circuit.between
    between[at, n] = between[n, at] = 1 / r_pipes
    capacities, to_air = np.append(circuit.capacities, c_sink), np.append(circuit.to_air, 1 / r_sink)
    return Circuit(capacities, between, to_air, circuit.housing)
