"""Truth by finite volumes, NumPy and SciPy only: boxes and rings with heat inside, any face held or fed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

Array = NDArray[np.float64]
Kind = TypeVar("Kind", bound=np.generic)


@dataclass(frozen=True)
class Grid:
    """A box of cells.

    Args:
        edges: for each axis where its cells begin and end [m].
        conductivity: along each axis [W/(m K)].
        ring: whether the first axis is a radius and the others are angle and axis; a plain box otherwise.
    """

    edges: Sequence[Array]
    conductivity: Sequence[float]
    ring: bool = False

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(len(edge) - 1 for edge in self.edges)

    def volumes(self) -> Array:
        """Of each cell [m³]."""
        return np.asarray(self._across(0) * self._widths(0))

    def _widths(self, axis: int) -> Array:
        """Of each cell along an axis [m], for a ring's radius the logarithmic mean radius taken out."""
        size = np.diff(self.edges[axis])
        if self.ring and axis == 0:
            size = np.diff(self.edges[0] ** 2) / 2.0
        return np.asarray(size.reshape([-1 if a == axis else 1 for a in range(3)]) * np.ones(self.shape))

    def _across(self, axis: int) -> Array:
        """Product of the sizes along the other axes."""
        area = np.ones(self.shape)
        for other in range(3):
            if other != axis:
                area = area * self._widths(other)
        return area

    def half(self, axis: int, side: int) -> Array:
        """Conductance from the middle of each cell to its low (0) or high (1) face along an axis [W/K]."""
        if self.ring and axis == 0:
            edge = self.edges[0]
            middle = np.sqrt((edge[1:] ** 2 + edge[:-1] ** 2) / 2.0)
            gap = np.log(edge[1:] / middle) if side else np.log(middle / edge[:-1])
            gap = gap.reshape(-1, 1, 1) * np.ones(self.shape)
            return np.asarray(self.conductivity[0] * self._across(0) / gap)
        if self.ring and axis == 1:
            logs = np.log(self.edges[0][1:] / self.edges[0][:-1]).reshape(-1, 1, 1)
            return np.asarray(self.conductivity[1] * logs * self._widths(2) / (self._widths(1) / 2.0))
        return np.asarray(self.conductivity[axis] * self._across(axis) / (self._widths(axis) / 2.0))


Face = tuple[int, int]
"""Axis and side: 0 low, 1 high."""


@dataclass(frozen=True)
class Answer:
    """Mean temperature [degC]; mean temperature of each face [degC] and heat out through it [W]."""

    mean: float
    faces: dict[Face, float]
    heat: dict[Face, float]


def solve(grid: Grid, power: float, held: dict[Face, float], fed: dict[Face, float]) -> Answer:
    """Steady state with `power` [W] spread evenly; faces held at [degC], fed evenly with [W], or insulated."""
    index = np.arange(int(np.prod(grid.shape))).reshape(grid.shape)
    volume = grid.volumes()
    rows, columns, entries = [], [], []
    diagonal, side = np.zeros(index.size), (power * volume / volume.sum()).ravel()
    for axis in range(3):
        high, low = grid.half(axis, 1), grid.half(axis, 0)
        one, other = _ends(index, axis, slice(None, -1)), _ends(index, axis, slice(1, None))
        a, b = _ends(high, axis, slice(None, -1)), _ends(low, axis, slice(1, None))
        between = (a * b / (a + b)).ravel()
        rows += [one.ravel(), other.ravel()]
        columns += [other.ravel(), one.ravel()]
        entries += [-between, -between]
        np.add.at(diagonal, one.ravel(), between)
        np.add.at(diagonal, other.ravel(), between)
    for face, temperature in held.items():
        cells, conductance = _boundary(grid, index, face)
        diagonal[cells] += conductance
        side[cells] += conductance * temperature
    if not held:  # heat in and out balance, so a cell held at 0 lets none through
        diagonal[0] += diagonal[0]
    for face, heat in fed.items():
        cells, _ = _boundary(grid, index, face)
        side[cells] += heat * _share(grid, face)
    rows.append(index.ravel())
    columns.append(index.ravel())
    entries.append(diagonal)
    matrix = coo_array((np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns)))).tocsc()
    temperatures = np.asarray(spsolve(matrix, side))
    faces, out = {}, {}
    for face in [(axis, end) for axis in range(3) for end in (0, 1)]:
        cells, conductance = _boundary(grid, index, face)
        if face in held:
            faces[face], out[face] = held[face], float((conductance * (temperatures[cells] - held[face])).sum())
        else:
            share = _share(grid, face)
            inward = fed.get(face, 0.0) * share
            faces[face], out[face] = (
                float((share * (temperatures[cells] + inward / conductance)).sum()),
                -fed.get(face, 0.0),
            )
    return Answer(float((temperatures * volume.ravel()).sum() / volume.sum()), faces, out)


def refined(grids: Sequence[Grid], power: float, held: dict[Face, float], fed: dict[Face, float]) -> Answer:
    """Two answers, the second grid twice as fine, their error of second order extrapolated away."""
    coarse, fine = (solve(grid, power, held, fed) for grid in grids)
    return Answer(
        (4.0 * fine.mean - coarse.mean) / 3.0,
        {face: (4.0 * fine.faces[face] - coarse.faces[face]) / 3.0 for face in fine.faces},
        {face: (4.0 * fine.heat[face] - coarse.heat[face]) / 3.0 for face in fine.heat},
    )


def _ends(values: NDArray[Kind], axis: int, part: slice) -> NDArray[Kind]:
    return values[tuple(part if a == axis else slice(None) for a in range(3))]


def _boundary(grid: Grid, index: NDArray[np.intp], face: Face) -> tuple[NDArray[np.intp], Array]:
    axis, end = face
    part = slice(-1, None) if end else slice(0, 1)
    return _ends(index, axis, part).ravel(), _ends(grid.half(axis, end), axis, part).ravel()


def _share(grid: Grid, face: Face) -> Array:
    """Each boundary cell's share of the face's area."""
    axis, end = face
    part = slice(-1, None) if end else slice(0, 1)
    area = _ends(grid._across(axis), axis, part).ravel()
    return np.asarray(area / area.sum())
