"""Truth for a motor's model: half a slot pitch in finite volumes (radius, angle, axis), NumPy and SciPy only.

Teeth and slots keep their angle over the radius. Rings cover the whole half pitch; in front of and behind the stack
there are end windings only. Everything is per sector: 1/(2 slots) of the motor.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass
class Sector:
    """Cells of one sector, some of them void, and extra points that link faces.

    Args:
        r: edges along the radius [m].
        a: edges along the angle [rad].
        z: edges along the axis [m].
    """

    r: Array
    a: Array
    z: Array
    k: Array = field(init=False)
    """conductivity along radius, angle and axis, shape (3, cells along r, a, z); zero where nothing is"""
    extra: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        self.shape = (len(self.r) - 1, len(self.a) - 1, len(self.z) - 1)
        self.k = np.zeros((3, *self.shape))
        self.source = np.zeros(self.shape)
        self.index = np.arange(int(np.prod(self.shape))).reshape(self.shape)
        self._rows: list[Index] = []
        self._columns: list[Index] = []
        self._entries: list[Array] = []
        self._side: dict[int, float] = {}
        self.skin: dict[tuple[int, int], float] = {}
        """area resistance [m² K/W] of the joint above (axis, number of the cell below it)"""
        self.cut = np.zeros((3, *self.shape), dtype=bool)
        """joints above a cell through which nothing passes"""

    def sizes(self, axis: int) -> Array:
        """Of each cell along an axis; along the radius (r₂² - r₁²)/2."""
        edges = (self.r**2 / 2.0, self.a, self.z)[axis]
        return np.asarray(np.diff(edges).reshape([-1 if i == axis else 1 for i in range(3)]) * np.ones(self.shape))

    @property
    def volume(self) -> Array:
        """Of each cell [m³]."""
        return self.sizes(0) * self.sizes(1) * self.sizes(2)

    def half(self, axis: int, side: int) -> Array:
        """Conductance from a cell's middle to its low (0) or high (1) face [W/K]."""
        k = self.k[axis]
        if axis == 0:
            middle = np.sqrt((self.r[1:] ** 2 + self.r[:-1] ** 2) / 2.0)
            gap = np.log(self.r[1:] / middle) if side else np.log(middle / self.r[:-1])
            return np.asarray(k * self.sizes(1) * self.sizes(2) / gap.reshape(-1, 1, 1))
        if axis == 1:
            logs = np.log(self.r[1:] / self.r[:-1]).reshape(-1, 1, 1)
            return np.asarray(k * logs * self.sizes(2) / (self.sizes(1) / 2.0))
        return np.asarray(k * self.sizes(0) * self.sizes(1) / (self.sizes(2) / 2.0))

    def area(self, axis: int, side: int) -> Array:
        """Of a cell's low (0) or high (1) face [m²]."""
        if axis == 0:
            radius = self.r[1:] if side else self.r[:-1]
            return np.asarray(radius.reshape(-1, 1, 1) * self.sizes(1) * self.sizes(2))
        return np.asarray(self.sizes(0) * self.sizes(1))

    def link(self, one: tuple[Index, int, int], other: tuple[Index, int, int] | None, resistance: float) -> None:
        """A resistance [K/W] between the mean temperatures of two faces, or a face and the surroundings at 0."""
        share = 1.0 if other is None else 0.5
        point = -1
        if other is not None:
            point = self.index.size + self.extra
            self.extra += 1
        for end in (one, other):
            if end is None:
                continue
            cells, axis, side = end
            area = self.area(axis, side).ravel()[cells]
            film = area / area.sum() / (resistance * share)
            through = 1.0 / (1.0 / self.half(axis, side).ravel()[cells] + 1.0 / film)
            self._couple(cells, np.full_like(cells, point), through)

    def _couple(self, one: Index, other: Index, conductance: Array) -> None:
        """Conductances between cells; -1 is the surroundings."""
        inside = other >= 0
        self._rows += [one, one[inside], other[inside], other[inside]]
        self._columns += [one, other[inside], one[inside], other[inside]]
        self._entries += [conductance, -conductance[inside], -conductance[inside], conductance[inside]]

    def solve(self) -> Array:
        """Temperatures above the surroundings [K], NaN where nothing is."""
        for axis in range(3):
            low, high = self._pair(axis)
            a, b = self.half(axis, 1).ravel()[low], self.half(axis, 0).ravel()[high]
            joint = np.zeros(self.shape)
            area = self.area(axis, 1) if axis != 1 else np.ones(self.shape)
            for (of, number), skin in self.skin.items():
                if of == axis:
                    part = tuple(number if i == axis else slice(None) for i in range(3))
                    joint[part] = skin / area[part]
            open_ = (a > 0) & (b > 0) & ~self.cut[axis].ravel()[low]
            low, high, a, b = low[open_], high[open_], a[open_], b[open_]
            self._couple(low, high, 1.0 / (1.0 / a + 1.0 / b + joint.ravel()[low]))
        n = self.index.size + self.extra
        there = np.append((self.k.max(axis=0) > 0).ravel(), np.ones(self.extra, dtype=bool))
        entries = np.concatenate(self._entries)
        matrix = coo_array((entries, (np.concatenate(self._rows), np.concatenate(self._columns))), shape=(n, n)).tocsr()
        heat = np.append((self.source * self.volume).ravel(), np.zeros(self.extra))
        temperatures = np.full(n, np.nan)
        kept = np.flatnonzero(there)
        temperatures[kept] = spsolve(matrix[kept][:, kept].tocsc(), heat[kept])
        return np.asarray(temperatures[: self.index.size].reshape(self.shape))

    def _pair(self, axis: int) -> tuple[Index, Index]:
        """Cells and their neighbours above along an axis."""
        parts = [[slice(None)] * 3, [slice(None)] * 3]
        parts[0][axis], parts[1][axis] = slice(None, -1), slice(1, None)
        low, high = (self.index[tuple(part)].ravel() for part in parts)
        return low, high

    def mean(self, found: Array, cells: tuple[slice, slice, slice]) -> float:
        """Mean temperature of a block of cells."""
        return float((found[cells] * self.volume[cells]).sum() / self.volume[cells].sum())
