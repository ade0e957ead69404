"""A solid block heated evenly throughout, its ends held at two temperatures: the exact answer, steady and in time.

Source: [BlockLPTN, eq. 2 to 8]. Equation 5 is printed wrong: the maximum lies at L/2 + k (T2 - T1)/(q L), or at the
hotter end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lptn.arrays import FloatArray


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
        from scipy.integrate import solve_ivp

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
        found = solve_ivp(
            lambda _, T: (bands @ T + given) / inertia,
            (0.0, float(times[-1])),
            start,
            "BDF",
            times,
            jac=bands / inertia,
            rtol=1e-8,
            atol=1e-8,
        )
        return np.asarray(found.y.T, dtype=float)
