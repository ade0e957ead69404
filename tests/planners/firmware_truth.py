"""Motors as plain matrices, the limiters of drives as a drive runs them, and the worst histories by linear programs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.optimize import linprog

from lptn.basics.arrays import FloatArray
from lptn.model.model import Model
from lptn.model.network import Network
from tests.builders import AMBIENT, effect, link, node

REFERENCE = 25.0  # degC, of the copper's resistance


@dataclass(frozen=True)
class Motors:
    """Windings, each with a housing, housings in a row; each housing has its way to the air.

    Args:
        winding, housing: capacities [J/K], shape (motors,).
        inside, outside: resistances winding~housing and housing~air [K/W].
        beside: resistance from each housing to the next [K/W], shape (motors - 1,).
        ohms: of the windings at 25 degC.
        alpha, beta: of the copper's resistance and of natural convection [1/K].

    Of several robots at once (`together`) all have one more axis, robots, which is the last of temperatures, too.
    """

    winding: FloatArray
    housing: FloatArray
    inside: FloatArray
    outside: FloatArray
    beside: FloatArray
    ohms: FloatArray
    alpha: float
    beta: float

    @classmethod
    def together(cls, robots: Sequence[Motors]) -> Motors:
        """Robots of as many motors each, for `rates` and `step`."""
        values: dict[str, Any] = {
            field.name: np.stack([getattr(robot, field.name) for robot in robots], axis=-1) for field in fields(cls)
        }
        return cls(**values)

    @property
    def count(self) -> int:
        return len(self.winding)

    def model(self, **errors: float) -> Model:
        """The same as a network of this package, with relative standard errors by kind of parameter."""
        names = [(f"w{k}", f"h{k}") for k in range(self.count)]
        nodes = [node(name, value) for pair, *values in zip(names, self.winding, self.housing, strict=True)
                 for name, value in zip(pair, values, strict=True)]  # fmt: skip
        links = [link(w, h, value) for (w, h), value in zip(names, self.inside, strict=True)]
        links += [link(h, "ambient", value) for (_, h), value in zip(names, self.outside, strict=True)]
        links += [link(names[k][1], names[k + 1][1], value) for k, value in enumerate(self.beside)]
        effects = [
            part
            for (w, _), ohms in zip(names, self.ohms, strict=True)
            for part in (effect("copper_loss", w, resistance=ohms), effect("resistance_rise", w, alpha=self.alpha))
        ]
        effects += [effect("natural_convection", "h*", beta=self.beta)]
        network = Network("motors", (*nodes, AMBIENT), tuple(links), tuple(effects))
        plain = Model(network)
        told = {p.name: errors[p.name.partition(".")[0]] * p.value for p in plain.parameters
                if p.name.partition(".")[0] in errors}  # fmt: skip
        return Model(network, told)

    def rates(self, T: FloatArray, squares: FloatArray, air: FloatArray | float) -> FloatArray:
        """Of windings, then housings [K/s]; `T` of shape (2 motors, ...)."""
        n = self.count
        w, h = T[:n], T[n:]

        def column(values: FloatArray) -> FloatArray:
            return values.reshape(*values.shape, *[1] * (T.ndim - values.ndim))

        inside = (w - h) / column(self.inside)
        lost = (h - air) * np.exp(self.beta * (h - air)) / column(self.outside)
        between = np.zeros_like(h)
        if n > 1:
            flow = (h[:-1] - h[1:]) / column(self.beside)
            between[:-1] += flow
            between[1:] -= flow
        heat = column(self.ohms) * (1 + self.alpha * (w - REFERENCE)) * squares
        return np.concatenate(
            [(heat - inside) / column(self.winding), (inside - lost - between) / column(self.housing)]
        )

    def step(self, T: FloatArray, squares: FloatArray, air: FloatArray | float, dt: FloatArray | float) -> FloatArray:
        """Temperatures after a step of the classical Runge-Kutta scheme."""
        k1 = self.rates(T, squares, air)
        k2 = self.rates(T + dt / 2 * k1, squares, air)
        k3 = self.rates(T + dt / 2 * k2, squares, air)
        return np.asarray(T + dt / 6 * (k1 + 2 * k2 + 2 * k3 + self.rates(T + dt * k3, squares, air)))

    def linear(self) -> tuple[FloatArray, FloatArray]:
        """A and B of windings and housings, where nothing depends on temperature."""
        n = self.count
        air, zero = 0.0, np.zeros((n, 1))
        unit = self.rates(np.eye(2 * n), np.zeros((n, 2 * n)), air)
        by_square = np.array([self.rates(np.zeros((2 * n, 1)), np.eye(n)[:, [j]], air).ravel() for j in range(n)]).T
        return unit, by_square - self.rates(np.zeros((2 * n, 1)), zero, air)


@dataclass
class Drive:
    """What a drive does with what is wanted of it; with arrays, what several do, all of the same limiters.

    Args:
        peak: current [A].
        time_constant, continuous: of i²t [s, A]; infinite: none.
        warning, trip, restart: of the reading [degC]; a trip of infinity: none.
        derates: whether the current falls in a line from the warning to the trip, too.
    """

    peak: FloatArray | float
    time_constant: FloatArray | float = np.inf
    continuous: FloatArray | float = np.inf
    warning: FloatArray | float = np.inf
    trip: FloatArray | float = np.inf
    restart: FloatArray | float = -np.inf
    derates: bool = False

    def __post_init__(self) -> None:
        self.sum = np.square(self.continuous)  # A²; a drive that was just switched on may be as hot as can be
        self.tripped = np.isfinite(self.restart)  # as hot as can be

    def admitted(self, wanted: FloatArray | float, reading: FloatArray | float, dt: FloatArray | float) -> FloatArray:
        """The magnitude of the current that flows for `dt` seconds [A]."""
        square = np.minimum(np.abs(wanted), self.peak) ** 2
        unsafe = (reading >= self.trip) | ~np.greater(reading, -np.inf)
        self.tripped = unsafe | (self.tripped & ~np.less_equal(reading, self.restart))
        if self.derates:
            slope = (self.trip - reading) / (self.trip - self.warning)
            square = np.where(reading > self.warning, np.minimum(square, (self.peak * slope) ** 2), square)
        square = np.where(self.tripped, 0.0, square)
        if np.all(np.isfinite(self.continuous)):
            share = -np.expm1(-dt / self.time_constant)
            square = np.minimum(square, self.sum + (np.square(self.continuous) - self.sum) / share)
            self.sum = self.sum + share * (square - self.sum)
        return np.asarray(np.sqrt(np.maximum(square, 0.0)))


def hottest(
    motors: Motors, drives: list[Drive], wanted: Callable[[int], FloatArray], steps: int, dt: FloatArray | float,
    air: float, start: FloatArray,
) -> FloatArray:  # fmt: skip
    """Hottest winding of several histories at once [degC], shape as `wanted` gives."""
    T, most = start, start[: motors.count]
    for k in range(steps):
        squares = np.array([d.admitted(each, 0.0, dt) ** 2 for d, each in zip(drives, wanted(k), strict=True)])
        T = motors.step(T, squares, air, dt)
        most = np.maximum(most, T[: motors.count])
    return most


def worst_rise(motors: Motors, tau: float, theta: float, peak: float, steps: int = 500) -> float:
    """The largest rise of the only winding by any history that i²t admits, from a linear program [K].

    Currents are constant in steps that grow towards the past, so it is a history, and no bound.
    """
    A, B = motors.linear()
    speeds = -np.linalg.eigvals(A).real
    edges = np.concatenate([[0.0], np.geomspace(2e-3 / speeds.max(), 12 / speeds.min(), steps)])
    response = np.array([np.linalg.solve(A, (expm(A * t) - np.eye(2)) @ B[:, 0])[0] for t in edges])
    lengths = np.diff(edges)[::-1]  # in the order of time
    decay = np.exp(-lengths / tau)
    # E after each step by each step's square
    after = np.zeros((steps, steps))
    for k in range(steps):
        if k:
            after[k] = after[k - 1] * decay[k]
        after[k, k] += 1 - decay[k]
    answer = linprog(-np.diff(response)[::-1], after, np.full(steps, theta), bounds=(0, peak**2))
    return float(-np.array(answer.fun))
