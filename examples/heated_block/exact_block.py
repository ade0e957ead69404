"""A solid block heated evenly: the exact answer, and chains of T-networks that approximate it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from lptn.basics.arrays import FloatArray

# --- The block, its ends held at two temperatures: the exact answer, steady and in time --------------
# Source: [BlockLPTN, eq. 2 to 8]. Equation 5 is printed wrong: the maximum lies at L/2 + k (T2 - T1)/(q L), or at the
# hotter end.


@dataclass(frozen=True)
class HeatedBlock:
    """A block that conducts along its length only.

    Args:
        heat: volumetric heat [W/m³].
        left: temperature T1 of the end x = 0 [degC].
        right: temperature T2 of the end x = L [degC].
        length: L [m].
        area: section A [m²].
        conductivity: k [W/(m K)].
        density: [kg/m³].
        specific_heat: [J/(kg K)].
    """

    heat: float = 1e5
    left: float = 20.0
    right: float = 20.0
    length: float = 0.1
    area: float = 1e-3
    conductivity: float = 10.0
    density: float = 7000.0
    specific_heat: float = 500.0

    @property
    def power(self) -> float:
        """Heat generated [W]."""
        return self.heat * self.area * self.length

    @property
    def capacity(self) -> float:
        """Heat capacity [J/K]."""
        return self.density * self.specific_heat * self.area * self.length

    @property
    def rise(self) -> float:
        """q L²/(8k) [K]: the middle above the mean of the ends."""
        return self.heat * self.length**2 / (8.0 * self.conductivity)

    @property
    def time_constant(self) -> float:
        """L²/(π² a) of the slowest mode [s], a being the diffusivity."""
        return (self.length / np.pi) ** 2 * self.density * self.specific_heat / self.conductivity

    def temperature(self, x: FloatArray | float) -> FloatArray:
        """Steady temperature at x [degC] [BlockLPTN, eq. 4]."""
        place = np.asarray(x, dtype=float)
        linear = self.left + (self.right - self.left) * place / self.length
        return np.asarray(linear + self.heat / (2.0 * self.conductivity) * place * (self.length - place))

    @property
    def mean(self) -> float:
        """Steady mean temperature [degC] ([BlockLPTN, eq. 8], for any ends)."""
        return (self.left + self.right) / 2.0 + self.heat * self.length**2 / (12.0 * self.conductivity)

    @property
    def hottest_place(self) -> float:
        """Where the maximum lies [m] ([BlockLPTN, eq. 5], corrected)."""
        if self.heat == 0.0:
            return 0.0 if self.left >= self.right else self.length
        shift = self.conductivity * (self.right - self.left) / (self.heat * self.length)
        return min(max(self.length / 2.0 + shift, 0.0), self.length)

    @property
    def printed_hottest_place(self) -> float:
        """[BlockLPTN, eq. 5] as it is printed; kept to show that it is wrong."""
        difference = self.left - self.right
        return self.length * difference / (self.heat * self.length**2 / (2.0 * self.conductivity) + difference)

    @property
    def maximum(self) -> float:
        """Highest steady temperature [degC]."""
        return float(self.temperature(self.hottest_place))

    def slices(self, n: int, times: FloatArray) -> FloatArray:
        """Temperatures of `n` finite volumes after the heat is switched on, shape (len(times), n).

        The block starts in the steady state that it has without heat. Plain SciPy; nothing of the networks is in it.
        """
        width = self.length / n
        between = self.conductivity / width
        inertia = self.density * self.specific_heat * width
        bands = -between * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
        bands[0, 0] = bands[-1, -1] = -3.0 * between  # half a width to the end
        given = np.full(n, self.heat * width)
        given[0] += 2.0 * between * self.left
        given[-1] += 2.0 * between * self.right
        x = (np.arange(n) + 0.5) * width
        start = self.left + (self.right - self.left) * x / self.length
        path = solve_ivp(
            lambda _, T: (bands @ T + given) / inertia,
            (0.0, float(times[-1])),
            start,
            "BDF",
            times,
            jac=bands / inertia,
            rtol=1e-8,
            atol=1e-8,
        )
        return np.asarray(path.y.T, dtype=float)


# --- The block as a chain of n T-networks: plain, with a halved source, with a resistance in the foot ---
# A cell is two resistances L/(2kA) in a row. Their star point carries source and capacity, or it is massless and a
# foot resistance leads from it to the node that carries them. Source:
# [BlockLPTN, sec. 2.1; eq. 9; sec. 2.3]: half the source, with the node shifted; foot -L/(6kA); n nodes.


Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Method:
    """How a cell stands for its piece of the block.

    Args:
        title: what it is called.
        source: share of the heat that is put in.
        foot: resistance from the star point to the node, in L/(kA) of the cell.
        shifted: whether the (single) node stands where the block is hottest.
        star: share of the capacity that is put on the star point; for the harm it does.
    """

    title: str
    source: float = 1.0
    foot: float = 0.0
    shifted: bool = False
    star: float = 0.0


PLAIN = Method("plain T-network")
HALVED = Method("halved source", source=0.5)
SHIFTED = Method("halved source, node shifted", source=0.5, shifted=True)
NEGATIVE = Method("resistance -L/(6kA)", foot=-1 / 6)
PEAK = Method("resistance -L/(8kA)", foot=-1 / 8)


@dataclass(frozen=True)
class BlockNetwork:
    """Temperatures T of the nodes follow C dT/dt = source + ends·(T1, T2) - matrix·T.

    Args:
        block: what it stands for.
        places: where the nodes stand [m], shape (n,).
        matrix: conductances [W/K], massless points eliminated, shape (n, n).
        ends: conductances to the two ends [W/K], shape (n, 2).
        between_ends: conductance straight from end to end [W/K].
        source: heat into each node [W], shape (n,).
        capacity: of each node [J/K], shape (n,).
    """

    block: HeatedBlock
    places: FloatArray
    matrix: FloatArray
    ends: FloatArray
    between_ends: float
    source: FloatArray
    capacity: FloatArray

    @property
    def _given(self) -> FloatArray:
        return np.asarray(self.source + self.ends @ np.array([self.block.left, self.block.right]))

    def steady(self) -> FloatArray:
        """Steady temperatures of the nodes [degC], shape (n,)."""
        return np.asarray(np.linalg.solve(self.matrix, self._given))

    def heat_to_ends(self) -> FloatArray:
        """Steady heat into the two ends [W], shape (2,)."""
        left, right = self.block.left, self.block.right
        straight = self.between_ends * (right - left)
        held = self.ends.sum(axis=0) * np.array([left, right])
        return np.asarray(self.ends.T @ self.steady() - held + np.array([straight, -straight]))

    def rates(self) -> FloatArray:
        """Eigenvalues [1/s]; a positive one grows without end."""
        return np.asarray(np.sort(np.linalg.eigvals(-self.matrix / self.capacity[:, None]).real))

    def after(self, times: FloatArray) -> FloatArray:
        """Temperatures after the heat is switched on, equally spaced times from 0, shape (len(times), n).

        The nodes start in the steady state that they have without heat.
        """
        n = len(self.places)
        start = np.linalg.solve(self.matrix, self._given - self.source)
        system = np.zeros((n + 1, n + 1))
        system[:n, :n] = -self.matrix / self.capacity[:, None]
        system[:n, n] = self._given / self.capacity
        step = expm(system * (times[1] - times[0]))
        states = [np.append(start, 1.0)]
        for _ in times[1:]:
            states.append(step @ states[-1])
        return np.array(states)[:, :n]


def block_network(block: HeatedBlock, n: int, method: Method = PLAIN) -> BlockNetwork:
    """A chain of `n` equal cells.

    Raises:
        ValueError: a shifted node is asked for with more than one cell, or stands on an end.
    """
    if method.shifted:
        return _shifted(block, n, method)
    cell = block.length / n
    arm, foot = cell / (2.0 * block.conductivity * block.area), method.foot * 2.0
    stars, nodes = np.arange(n), np.arange(n) + (n if method.foot else 0)
    faces = nodes[-1] + 1 + np.arange(n + 1)
    full = np.zeros((faces[-1] + 1, faces[-1] + 1))
    for i in range(n):
        _link(full, stars[i], faces[i], 1.0 / arm)
        _link(full, stars[i], faces[i + 1], 1.0 / arm)
        if method.foot:
            _link(full, stars[i], nodes[i], 1.0 / (arm * foot))
    capacity = np.full(n, block.capacity / n)
    source = np.full(n, method.source * block.power / n)
    kept, places = nodes, np.asarray((stars + 0.5) * cell, dtype=np.float64)
    if method.star:
        kept = np.concatenate([nodes, stars])
        capacity = np.concatenate([capacity * (1.0 - method.star), capacity * method.star])
        source, places = np.concatenate([source, np.zeros(n)]), np.tile(places, 2)
    return _reduced(block, places, full, kept, faces[[0, -1]], source, capacity)


def _shifted(block: HeatedBlock, n: int, method: Method) -> BlockNetwork:
    place = block.hottest_place
    if n != 1 or not 0.0 < place < block.length:
        raise ValueError("a shifted node stands alone, inside the block")
    full = np.zeros((3, 3))
    for end, length in ((1, place), (2, block.length - place)):
        _link(full, 0, end, block.conductivity * block.area / length)
    source, capacity = np.array([method.source * block.power]), np.array([block.capacity])
    return _reduced(block, np.array([place]), full, np.array([0]), np.array([1, 2]), source, capacity)


def _link(full: FloatArray, one: int, other: int, conductance: float) -> None:
    full[[one, other], [one, other]] += conductance
    full[[one, other], [other, one]] -= conductance


def _reduced(
    block: HeatedBlock,
    places: FloatArray,
    full: FloatArray,
    kept: Indices,
    ends: Indices,
    source: FloatArray,
    capacity: FloatArray,
) -> BlockNetwork:
    """Massless points eliminated: the Schur complement on the nodes and the two ends."""
    stay = np.concatenate([kept, ends])
    leave = np.setdiff1d(np.arange(len(full)), stay)
    left = full[np.ix_(stay, stay)]
    if leave.size:
        cross = full[np.ix_(stay, leave)]
        left = left - cross @ np.linalg.solve(full[np.ix_(leave, leave)], cross.T)
    n = len(kept)
    return BlockNetwork(block, places, left[:n, :n], -left[:n, n:], -float(left[n, n + 1]), source, capacity)


@dataclass(frozen=True)
class SteadyErrors:
    """A network against the exact answer.

    Args:
        node: largest error of a node against the block's temperature at its place [K].
        maximum: highest node less the block's maximum [K].
        mean: mean of the nodes less the block's mean [K].
        heat: share of the heat that arrives at the ends.
    """

    node: float
    maximum: float
    mean: float
    heat: float


def steady_errors(network: BlockNetwork) -> SteadyErrors:
    """How far a network's steady state is from the block's."""
    block, nodes = network.block, network.steady()
    errors = nodes - block.temperature(network.places)
    return SteadyErrors(
        float(errors[np.abs(errors).argmax()]),
        float(nodes.max()) - block.maximum,
        float(nodes.mean()) - block.mean,
        float(network.heat_to_ends().sum()) / block.power,
    )


def order(n: FloatArray, errors: FloatArray) -> float:
    """Order of convergence: minus the slope of log error over log n."""
    return -float(np.polyfit(np.log(n), np.log(np.abs(errors)), 1)[0])
