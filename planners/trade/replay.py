"""A design simulated in fine steps: a check on the program's few elements, and what maps and curves are made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from lptn.arrays import FloatArray

from .plant import Parameters, Plant
from .study import Option

_RATE = 0.5  # a step times the fastest rate; RK4 is then good to 1e-4
_HOT = 2000.0  # degC; what runs away is held here instead of overflowing


@dataclass(frozen=True)
class Replay:
    """Highest winding temperature [degC] and highest current [A]."""

    winding: float
    current: float


class Simulator:
    """An option's own rates in fixed steps of RK4, for many designs side by side.

    Args:
        option: the discrete choice.
        driven_by: `"torque"` or `"current"`.
    """

    def __init__(self, option: Option, driven_by: str = "torque") -> None:
        self.option = option
        parameters = Parameters()
        capacity, resistance, drive, h = (ca.SX.sym(name) for name in ("capacity", "resistance", "drive", "h"))
        self.plant = plant = Plant(option, parameters, capacity, resistance)
        x = ca.SX.sym("x", len(plant.states))
        rates = plant.rates if driven_by == "torque" else plant.rates_at_current
        f = ca.Function("f", [x, drive, capacity, resistance, parameters.stacked], [rates(x, drive)])
        numbers = parameters.values()

        def slope(state: Any) -> Any:
            return f(state, drive, capacity, resistance, numbers)

        k1 = slope(x)
        k2 = slope(x + h / 2 * k1)
        k3 = slope(x + h / 2 * k2)
        k4 = slope(x + h * k3)
        following = ca.fmin(x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), _HOT)
        names = [x, drive, capacity, resistance, h]
        self._step = ca.Function("step", names, [following])
        current = plant.current(x, drive) if driven_by == "torque" else drive
        self._current = ca.Function("current", [x, drive], [ca.substitute(current, parameters.stacked, numbers)])
        jacobian = ca.jacobian(slope(x), x)
        self._rates = ca.Function("rates", [x, drive, capacity, resistance], [slope(x)])
        self._jacobian = ca.Function("jacobian", [x, drive, capacity, resistance], [ca.densify(jacobian)])
        self.winding = plant.states.index(option.motor.winding)

    def substeps(self, duration: float, capacity: float, resistance: float, drive: float = 0.0) -> int:
        """How many equal steps a duration [s] needs for the fastest rate of a design."""
        cold = np.full(len(self.plant.states), self.option.study.task.ambient)
        jacobian = self._jacobian(cold, drive, capacity, resistance).full()
        return max(1, int(np.ceil(duration * np.abs(np.linalg.eigvals(jacobian)).max() / _RATE)))

    def advance(
        self, x: FloatArray, drive: FloatArray, capacity: FloatArray, resistance: FloatArray, h: FloatArray
    ) -> FloatArray:
        """States after one step, shape (number of states, number of cases), all arguments for all cases."""
        rows = (values[None, :] for values in (drive, capacity, resistance, h))
        return np.asarray(self._step(x, *rows).full())

    def steady(self, drive: FloatArray, capacity: FloatArray, resistance: FloatArray) -> FloatArray:
        """States that no longer change, shape (number of states, number of cases); infinite where there are none.

        By Newton's method; beyond runaway the balance has a root below the air's temperature, which is no state.
        """
        n, cases = len(self.plant.states), drive.size
        x = np.full((n, cases), self.option.study.task.ambient + 20.0)
        rows = [values[None, :] for values in (drive, capacity, resistance)]
        for _ in range(30):
            slope = self._jacobian(x, *rows).full().reshape(n, cases, n).transpose(1, 0, 2)
            step = np.linalg.solve(slope, self._rates(x, *rows).full().T[:, :, None])[:, :, 0].T
            x = x - step
            if np.abs(step).max() < 1e-9 * np.abs(x).max():
                break
        stable = np.linalg.eigvals(slope).real.max(axis=1) < 0
        return np.where(stable & (x.min(axis=0) > self.option.study.task.ambient - 1.0), x, np.inf)

    def current(self, x: FloatArray, drive: float) -> FloatArray:
        """Current [A] for each case."""
        return np.asarray(self._current(x, drive).full().ravel())


def replayed(
    option: Option, sink: tuple[float, float] | None, torque: float, duration: float, start: FloatArray
) -> Replay:
    """The task of a study on one design, from its starting temperatures [degC], shape (number of states,).

    A task that repeats for ever starts from the periodic state that was found, and runs one cycle.
    """
    simulator = Simulator(option)
    task = option.study.task
    capacity, resistance = sink or (1.0, 1.0)
    part = duration / len(task.shape)
    steps = max(simulator.substeps(part, capacity, resistance, torque), 400 if task.hold else 2)
    x = start[:, None]
    hottest, most = float(x[simulator.winding, 0]), 0.0
    run = simulator._step.mapaccum(steps)
    for _ in range(task.cycles or 1):
        for share in task.shape:
            ones = np.ones((1, steps))
            path = run(x, torque * share * ones, capacity * ones, resistance * ones, part / steps * ones).full()
            x = path[:, -1:]
            hottest = max(hottest, float(path[simulator.winding].max()))
            most = max(most, float(simulator.current(x, torque * share).max()))
    return Replay(hottest, most)
