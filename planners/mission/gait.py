"""What the joints do in an activity: RMS torques, speeds and powers over base speed and load, as smooth functions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from scipy.interpolate import CubicSpline

from lptn.basics.arrays import FloatArray

_LOOKED_AT = 25  # points a direction at which a table is looked at between its cells


@dataclass(frozen=True)
class Gait:
    """The inputs of a model over base speed and load.

    Between the cells a natural cubic spline in each direction: smooth, as a solver needs it, and straight where there
    are two cells. [QuadrupedLPTN, eq. 15] logs torques as RMS over a second; heat goes with their square.

    Args:
        name: what the task file calls it.
        speeds: base speeds of the cells [m/s], rising; one where it has none to choose.
        loads: loads of the cells [kg], rising.
        cells: inputs in the model's order, SI, shape (loads, speeds, inputs).
    """

    name: str
    speeds: FloatArray
    loads: FloatArray
    cells: FloatArray

    def inputs(self, speed: Any, load: Any) -> Any:
        """The model's inputs as expressions of speed and load, shape (inputs,)."""
        by_speed, by_load = basis(speed, self.speeds), basis(load, self.loads)
        flat = self.cells.reshape(-1, self.cells.shape[2]).T
        return ca.mtimes(ca.DM(flat), ca.vec(ca.mtimes(by_speed, by_load.T)))

    def at(self, speed: float, load: float) -> FloatArray:
        """The model's inputs at one speed and load, shape (inputs,)."""
        weights = np.outer(weights_at(load, self.loads), weights_at(speed, self.speeds))
        found: FloatArray = np.einsum("ij,ijk->k", weights, self.cells)
        return found

    def least(self) -> FloatArray:
        """The least value of each input anywhere between the cells, shape (inputs,)."""
        speeds = np.linspace(self.speeds[0], self.speeds[-1], _LOOKED_AT)
        loads = np.linspace(self.loads[0], self.loads[-1], _LOOKED_AT)
        by_speed, by_load = weights_at(speeds, self.speeds), weights_at(loads, self.loads)
        return np.asarray(np.einsum("ai,bj,ijk->abk", by_load, by_speed, self.cells).min(axis=(0, 1)))


def gait(name: str, speeds: FloatArray, loads: FloatArray, columns: Mapping[str, FloatArray]) -> Gait:
    """A gait from one table of shape (loads, speeds) for each of the model's inputs, in order."""
    cells = np.stack([np.broadcast_to(table, (loads.size, speeds.size)) for table in columns.values()], axis=2)
    return Gait(name, speeds, loads, np.ascontiguousarray(cells, dtype=float))


def weights_at(value: Any, knots: FloatArray) -> FloatArray:
    """How much each cell counts at a value, or at many; shape (…, knots)."""
    if knots.size == 1:
        return np.ones((*np.shape(value), 1))
    return np.asarray(_spline(knots)(value))


def basis(value: Any, knots: FloatArray) -> Any:
    """`weights_at` as an expression, shape (knots,)."""
    if knots.size == 1:
        return ca.SX.ones(1)
    pieces = np.asarray(_spline(knots).c)  # (order, piece, knot)
    found = None
    for number in range(knots.size - 1):
        away = value - float(knots[number])
        here = ca.DM(pieces[0, number])
        for row in pieces[1:, number]:
            here = here * away + ca.DM(row)
        found = here if found is None else ca.if_else(away >= 0, here, found)
    return found


def _spline(knots: FloatArray) -> CubicSpline:
    return CubicSpline(knots, np.eye(knots.size), bc_type="natural")
