"""Designs simulated in fine steps: a check on the program's few elements, and what maps and curves are made of.

Networks of a few masses take RK4. A motor made from its drawing has time constants of a second or less, which RK4
would have to follow for an hour; maps and curves of it take Rosenbrock steps, which are stable at any length.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.model.array_function import ArrayFunction
from lptn.model.model import rk4

from .plant import Load, Parameters, Plant
from .problem import DesignSolution
from .study import Option

_CYCLE_STEPS = 2  # of RK4 at least, in each part of a cycle
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

    def is_stiff(self, duration: float, implicit_steps: int, drive: float = 0.0) -> bool:
        """Whether so many implicit steps take the cases through a duration [s] sooner than RK4 would."""
        # With 10 to 14 states an implicit step takes the time of two of RK4.
        return self.substeps(duration, drive) > 2 * implicit_steps

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


def check_design(option: Option, design: DesignSolution) -> tuple[float, float]:
    """The task of a study on one design: highest winding temperature [degC] and highest current [A].

    A task that repeats for ever starts from the periodic state that was found, and runs one cycle.
    """
    simulator, task = Simulator(option, design.sink), option.study.task
    part = design.duration / len(task.shape)
    loads = task.operation * (design.torque, 1.0, 1.0)
    steps = max(simulator.substeps(part, design.torque), 400 if task.is_hold else _CYCLE_STEPS)
    x = design.states[:, :1]
    hottest, most = float(simulator.winding(x)[0]), 0.0
    run = simulator.step.mapaccum(steps)
    for _ in range(task.repeats or 1):
        for load in loads:
            path = run(x, np.tile(load[:, None], steps), *(design.sink or (1.0, 1.0)), part / steps).full()
            x = path[:, -1:]
            hottest = max(hottest, float(simulator.winding(path).max()))
            most = max(most, float(np.abs(simulator.electric(x, load[:, None])[0]).max()))
    return hottest, most


def peak_temperatures(
    option: Option,
    capacity: FloatArray,
    resistance: FloatArray,
    torque: FloatArray,
    duration: float,
    hold_steps: int = 200,
) -> FloatArray:
    """Highest winding temperature [degC] of many designs under a study's task, shape as given.

    Of a cycle that repeats for ever it is the mean over the cycle, from the RMS current; infinite where it runs away.
    """
    simulator, task = Simulator(option, (capacity, resistance)), option.study.task
    if task.repeats is None:
        return simulator.winding(simulator.steady(_equivalent(option, torque)))
    n, part = capacity.size, duration / len(task.shape)
    x = np.full((len(simulator.plant.states), n), task.start)
    hottest = simulator.winding(x)
    hardest = float(torque.max())
    implicit_steps = hold_steps if task.is_hold else 10  # of order 2, and so shorter than RK4 would need them
    if simulator.is_stiff(part, implicit_steps, hardest):
        advance, steps = simulator.advance_implicitly, implicit_steps
    else:
        advance = simulator.advance
        steps = max(simulator.substeps(part, hardest), hold_steps if task.is_hold else _CYCLE_STEPS)
    for share, *motion in np.tile(task.operation, (task.repeats, 1)):
        drive = np.vstack([torque * share, *(np.full(n, value) for value in motion)])
        for _ in range(steps):
            x = advance(x, drive, part / steps)
            hottest = np.maximum(hottest, simulator.winding(x))
    return np.asarray(hottest)


def _equivalent(option: Option, torque: FloatArray) -> FloatArray:
    """The steady load, shape (3, n), that needs the cycle's RMS current at its RMS speed, for peak torques (n,)."""
    task, gear = option.study.task, option.gear
    through = np.where(task.motion < 0, gear.efficiency, 1 / gear.efficiency)
    at_rotor = torque[:, None] * task.shape * through / gear.ratio[0]
    at_rotor = at_rotor + option.motor.rotor_inertia * gear.ratio[0] * task.accelerations
    rms = np.sqrt(np.mean(at_rotor**2, axis=1)) * gear.ratio[0] * gear.efficiency
    return np.vstack([rms, np.full(torque.size, np.sqrt(np.mean(task.motion**2))), np.zeros(torque.size)])
