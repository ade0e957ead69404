"""Designs simulated in fine steps: a check on the program's few elements, and what maps and curves are made of.

Networks of a few masses take RK4. A motor made from its drawing has time constants of a second or less, which RK4
would have to follow for an hour; maps and curves of it take Rosenbrock steps, which are stable at any length.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.model.array_function import ArrayFunction
from lptn.model.model import rk4

from .plant import Load, Parameters, Plant
from .study import Option

Advance = Callable[[FloatArray, FloatArray, FloatArray | float], FloatArray]
"""States after a step, from the states before it, the drive and the length of the step [s]."""
_HOT = 2000.0  # degC; what runs away is held here instead of overflowing


class Simulator:
    """An option's own rates in fixed steps, for many designs side by side.

    Args:
        option: the discrete choice, with a given ratio of its gear.
        sink: its capacity [J/K] and resistance [K/W], each one for all cases or for each; `None` without a sink.
        driven_by: `"torque"`: a drive is a torque [N·m] behind the gear for each case, shape (cases,), or torque, speed
            [rad/s] and acceleration [rad/s²], shape (3, cases); or `"current"`: the motor's [A], at standstill.
    """

    def __init__(
        self,
        option: Option,
        sink: tuple[FloatArray, FloatArray] | tuple[float, float] | None = None,
        driven_by: str = "torque",
    ) -> None:
        self.option, self._sink = option, [np.atleast_2d(value) for value in sink or (1.0, 1.0)]
        parameters = Parameters()
        capacity, resistance, h = (ca.SX.sym(name) for name in ("capacity", "resistance", "h"))
        self.plant = plant = Plant(option, parameters, capacity, resistance)
        x = ca.SX.sym("x", len(plant.states))
        self._by_torque = driven_by == "torque"
        drive = ca.SX.sym("drive", len(Load._fields)) if self._by_torque else ca.SX.sym("drive")
        load = Load(*ca.vertsplit(drive)) if self._by_torque else None
        numbers = parameters.values()
        rates = plant.rates_at_current(x, drive) if load is None else plant.rates(x, load)
        given = [drive, capacity, resistance]
        f = ca.Function("f", [x, *given, parameters.stacked], [rates])
        rates = f(x, *given, numbers)
        self.step = ca.Function(
            "step", [x, *given, h], [ca.fmin(rk4(lambda state: f(state, *given, numbers), x, h), _HOT)]
        )
        self._rates = ca.Function("rates", [x, *given], [ca.densify(rates)])
        self._jacobian = ca.Function("jacobian", [x, *given], [ca.densify(ca.jacobian(rates, x))])
        amperes, volts = (drive, 0) if load is None else (plant.current(x, load), plant.voltage(x, load))
        electric = ca.substitute(ca.vertcat(amperes, volts), parameters.stacked, numbers)
        self._electric = ca.Function("electric", [x, drive], [ca.densify(electric)])
        self._of_cases: dict[tuple[str, int], ArrayFunction] = {}
        self._winding = [plant.states.index(node) for node in option.motor.winding_nodes]
        self._magnet = [plant.states.index(node) for node in option.motor.magnet_nodes]

    def winding(self, x: FloatArray) -> FloatArray:
        """The winding's highest temperature [degC] for each case, shape (number of cases,)."""
        return np.asarray(x[self._winding].max(axis=0))

    def magnet(self, x: FloatArray) -> FloatArray:
        """The magnets' highest temperature [degC] for each case, shape (number of cases,)."""
        return np.asarray(x[self._magnet].max(axis=0))

    def _drive(self, drive: FloatArray | float) -> FloatArray:
        """Rows of a drive, at standstill where only torques are given."""
        rows = np.atleast_2d(np.asarray(drive, dtype=float))
        still = np.zeros((len(Load._fields) - 1, rows.shape[1]))
        return np.vstack([rows, still]) if self._by_torque and len(rows) == 1 else rows

    def substeps(self, duration: float, drive: float = 0.0) -> int:
        """How many equal steps of RK4 a duration [s] needs for the fastest rate of the smallest sink in the air."""
        cold = np.full(len(self.plant.states), self.option.study.task.ambient)
        jacobian = self._jacobian(cold, self._drive(drive), *(float(values.min()) for values in self._sink)).full()
        fastest = float(np.abs(np.linalg.eigvals(jacobian)).max())  # 1/s
        longest = 0.5 / fastest  # s; RK4 is then good to 1e-4
        return max(1, int(np.ceil(duration / longest)))

    def method(self, duration: float, implicit_steps: int, drive: float = 0.0) -> tuple[Advance, int]:
        """What takes the cases through a duration [s] sooner: so many implicit steps, or RK4 in as many as needed."""
        steps = self.substeps(duration, drive)
        # With 10 to 14 states an implicit step takes the time of two of RK4.
        return (self.advance_implicitly, implicit_steps) if steps > 2 * implicit_steps else (self.advance, steps)

    def advance(self, x: FloatArray, drive: FloatArray, h: FloatArray | float) -> FloatArray:
        """States after one step of RK4, shape (states, cases), from such states; h [s] for each case or all."""
        return self._at(self.step, x, self._drive(drive), *self._sink, np.atleast_2d(h))

    def advance_implicitly(self, x: FloatArray, drive: FloatArray, h: FloatArray | float) -> FloatArray:
        """States after one Rosenbrock step of order 2, arguments and result as for `advance`.

        Source: Verwer, Spee, Blom and Hundsdorfer, SIAM J. Sci. Comput. 20 (1999) 1456: ROS2.
        """
        gamma = 1 - 0.5**0.5  # makes the method L-stable
        rates, slope = self._linearised(x, drive)
        system = np.eye(len(x)) - gamma * np.reshape(h, (-1, 1, 1)) * slope
        first = np.linalg.solve(system, rates)
        middle = np.minimum(x + h * first[:, :, 0].T, _HOT)
        ahead = self._at(self._rates, middle, self._drive(drive), *self._sink).T[:, :, None]
        second = np.linalg.solve(system, ahead - 2 * first)
        return np.minimum(x + h * (1.5 * first + 0.5 * second)[:, :, 0].T, _HOT)

    def _linearised(self, x: FloatArray, drive: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rates [K/s], shape (cases, states, 1), and their slope in the states [1/s], shape (cases, states, states)."""
        (n, cases), rows = x.shape, (self._drive(drive), *self._sink)
        slope = self._at(self._jacobian, x, *rows).reshape(n, cases, n).transpose(1, 0, 2)
        return self._at(self._rates, x, *rows).T[:, :, None], slope

    def steady(self, drive: FloatArray) -> FloatArray:
        """States that no longer change, shape (states, cases); infinite where there are none.

        By Newton's method; beyond runaway the balance has a root below the air's temperature, which is no state.
        """
        ambient = self.option.study.task.ambient
        x = np.full((len(self.plant.states), np.shape(drive)[-1]), ambient + 20.0)
        for _ in range(30):
            rates, slope = self._linearised(x, drive)
            step = np.linalg.solve(slope, rates)[:, :, 0].T
            x = x - step
            if np.abs(step).max() < 1e-9 * np.abs(x).max():
                break
        stable = np.linalg.eigvals(slope).real.max(axis=1) < 0
        return np.where(stable & (x.min(axis=0) > ambient - 1.0), x, np.inf)

    def electric(self, x: FloatArray, drive: FloatArray | float) -> tuple[FloatArray, FloatArray]:
        """Current [A] and supply voltage [V] for each case, each of shape (number of cases,)."""
        current, voltage = self._at(self._electric, x, self._drive(drive))
        return current, voltage

    def _at(self, function: ca.Function, *rows: FloatArray) -> FloatArray:
        """The results of all cases side by side; the first argument has a column for each, others may have one for all.

        Hundreds of short steps of many cases: half of the time went into copying CasADi's matrices.
        """
        cases = rows[0].shape[1]
        key = function.name(), cases
        if key not in self._of_cases:
            self._of_cases[key] = ArrayFunction(function, cases)
        return self._of_cases[key](*(np.broadcast_to(row, (len(row), cases)) for row in rows))
