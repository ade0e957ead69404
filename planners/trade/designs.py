"""A feasible choice at its best, simulated in fine steps: a check on the program's few elements, maps and curves.

By Rosenbrock steps, which are stable at any length: a motor made from its drawing has time constants of a second or
less, which RK4 would have to follow for an hour.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil

import casadi as ca
import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.errors import InputError
from lptn.model.array_function import ArrayFunction

from .motors import ENAMEL_LIMIT, REFERENCE
from .plant import CAPACITY, RESISTANCE, Load, Parameters, Plant
from .problem import DesignProblem, DesignSolution
from .study import BUDGETS, Option

_LEAST_STEPS, _MOST_STEPS = 2, 10
"""In each part of a cycle: at least, and for maps at most, where the network has faster rates."""
_HIGHEST_LIMIT = 500.0  # degC, of a study's file
_HOT = 2 * _HIGHEST_LIMIT  # what runs away is held here instead of overflowing


class Simulator:
    """An option's own rates in fixed steps, for many designs side by side.

    Args:
        option: the discrete choice, with a given ratio of its gear.
        sink: its capacity [J/K] and resistance [K/W], each one for all cases or for each; `None` without a sink.
        driven_by: `"torque"`: a drive is a torque [N·m] behind the gear for each case, shape (cases,), or torque, speed
            [rad/s] and acceleration [rad/s²], shape (3, cases); or `"current"`: the motor's [A], at standstill.

    Attributes:
        rates: (x, drive, sink's capacity, resistance) -> dx/dt [K/s], of one case.
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
        slope = ca.densify(ca.jacobian(rates, x))
        self.rates = ca.Function("rates", [x, *given], [ca.densify(rates)])
        self._jacobian = ca.Function("jacobian", [x, *given], [slope])
        self._newton = ca.Function("newton", [x, *given], [ca.cse(ca.densify(ca.solve(slope, rates)))])
        # ROS2 of Verwer, Spee, Blom and Hundsdorfer, SIAM J. Sci. Comput. 20 (1999) 1456.
        gamma = 1 - 0.5**0.5  # makes the method L-stable
        system = ca.SX.eye(len(plant.states)) - gamma * h * slope
        first = ca.solve(system, rates)
        second = ca.solve(system, self.rates(ca.fmin(x + h * first, _HOT), *given) - 2 * first)
        following = ca.fmin(x + h * (1.5 * first + 0.5 * second), _HOT)
        self._step = ca.Function("step", [x, *given, h], [ca.cse(following)])
        amperes, volts = (drive, 0) if load is None else (plant.current(x, load), plant.voltage(x, load))
        electric = ca.substitute(ca.vertcat(amperes, volts), parameters.stacked, numbers)
        self._electric = ca.Function("electric", [x, drive], [ca.densify(electric)])
        at = Load(*(ca.SX.sym(name) for name in ("torque", "speed")))
        through = ca.substitute(plant.through(at), parameters.stacked, numbers)
        self._through = ca.Function("through", [at.torque, at.speed], [through])
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

    def substeps(self, duration: float, drive: float) -> int:
        """How many equal steps a duration [s] needs to follow the fastest rate of the smallest sink in the air."""
        cold = np.full(len(self.plant.states), self.option.study.task.ambient)
        jacobian = self._jacobian(cold, self._drive(drive), *(float(values.min()) for values in self._sink)).full()
        return ceil(2 * duration * float(np.abs(np.linalg.eigvals(jacobian)).max()))

    def advance(self, x: FloatArray, drive: FloatArray, h: FloatArray | float) -> FloatArray:
        """States after a step of order 2, shape (states, cases), from such states; h [s] for each case or all."""
        return self._at(self._step, x, self._drive(drive), *self._sink, np.atleast_2d(h))

    def steady(self, drive: FloatArray) -> FloatArray:
        """States that no longer change, shape (states, cases); infinite where there are none below the highest limit.

        By Newton's method; beyond runaway the balance has a root below the air's temperature, which is no state.
        """
        ambient = self.option.study.task.ambient
        x = np.full((len(self.plant.states), np.shape(drive)[-1]), ambient + 20.0)
        for _ in range(30):
            before, step = x, self._at(self._newton, x, self._drive(drive), *self._sink)
            # Not beyond: a film that grows with temperature overflows there.
            x = np.clip(np.nan_to_num(x - step, nan=_HOT), ambient - 5.0, _HOT)
            moved = np.abs(x - before).max(axis=0)
            if moved.max() < 1e-9 * np.abs(x).max():
                break
        n, cases = x.shape
        slope = self._at(self._jacobian, x, self._drive(drive), *self._sink).reshape(n, cases, n).transpose(1, 0, 2)
        stable = np.linalg.eigvals(slope).real.max(axis=1) < 0
        found = stable & (moved < 1e-6) & (x.min(axis=0) > ambient - 1.0) & (x.max(axis=0) < _HIGHEST_LIMIT)
        return np.where(found, x, np.inf)

    def equivalent(self, torque: FloatArray) -> FloatArray:
        """The steady load, shape (3, n), that needs the cycle's RMS torque of the rotor at its RMS speed, for peak
        torques (n,)."""
        task, ratio = self.option.study.task, self.option.gear.ratio[0]
        before = torque[:, None] * task.shape  # the gear
        through = self._through(before.reshape(1, -1), np.tile(task.motion, (1, torque.size)))
        at_rotor = (
            before * through.full().reshape(before.shape) / ratio
            + self.option.motor.rotor_inertia * ratio * task.accelerations
        )
        wanted = np.sqrt(np.mean(at_rotor**2, axis=1)) * ratio
        speed = np.full(torque.size, np.sqrt(np.mean(task.motion**2)))
        load = wanted
        for _ in range(1 if self.option.gear.map is None else 30):
            load = wanted / self._through(load[None], speed[None]).full().ravel()
        return np.vstack([load, speed, np.zeros(torque.size)])

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


# --- designs ----------------------------------------------------------------------------------------


@dataclass(frozen=True, repr=False)
class Design(DesignSolution):
    """A feasible choice at its best: a solution that converged, and further.

    Args:
        option: the discrete choice, its gear's ratio as it was found.
        winding: the highest winding temperature [degC].
        current: the highest current [A].
        parameters: value and unit of every number of the program, by name.
        checked: the highest winding temperature in a fine simulation of the same design [degC].
    """

    option: Option
    winding: float
    current: float
    parameters: dict[str, tuple[float, str]]
    checked: float

    def __repr__(self) -> str:
        held = f"{self.torque:.4g} N*m for {self.duration:g} s"
        return f"<Design {self.option.name}: {held}, {1e3 * self.mass:.0f} g, winding {self.winding:.1f} degC>"

    @cached_property
    def as_built(self) -> tuple[DesignProblem, DesignSolution]:
        """Its program with the sink as it was found, and what IPOPT finds then."""
        problem = DesignProblem(self.option, self.sink)
        return problem, problem.solve()

    @cached_property
    def sink_sensitivities(self) -> dict[str, float]:
        """Derivative of the goal to the sink's capacity [per J/K], mass [per kg of its metal] and resistance [per K/W].

        All else of the design is held. Empty without a sink, where mass, volume or price is sought (at a given sink its
        mass is given), and where that program did not converge.
        """
        if self.sink is None or self.option.study.question.goal in BUDGETS:
            return {}
        slopes = self.as_built[1].sensitivities
        if not slopes:
            return {}
        per_mass = slopes[CAPACITY] * self.option.metal.specific_heat
        return {"capacity": slopes[CAPACITY], "mass": per_mass, "resistance": slopes[RESISTANCE]}

    @property
    def degenerate(self) -> bool:
        """Whether more constraints are active than the design has freedom: then its sensitivities are not unique."""
        study = self.option.study
        sought = study.question.goal in ("held_torque", "time_to_limit", "worst_temperature")
        active = len(self.binding) + (study.question.goal == "worst_temperature")
        return active > 2 * self.option.has_sink + sought + ("most.ratio" in self.parameters)


def design_of(problem: DesignProblem, solution: DesignSolution) -> Design:
    """A converged solution as a design, checked in fine steps."""
    option = replace(problem.option, gear=problem.option.gear.model_copy(update={"ratio": [solution.ratio] * 2}))
    winding = [problem.plant.states.index(node) for node in option.motor.winding_nodes]
    hottest, current = check_design(option, solution)
    parameters = {name: (value, problem.parameters.units[name]) for name, value in problem.parameters.defaults.items()}
    return Design(**vars(solution), option=option, winding=float(solution.states[winding].max()), current=current,
                  parameters=parameters, checked=hottest)  # fmt: skip


def check_design(option: Option, design: DesignSolution) -> tuple[float, float]:
    """The task of a study on one design: highest winding temperature [degC] and highest current [A].

    A task that repeats for ever starts from the periodic state that was found, and runs one cycle.
    """
    simulator, task = Simulator(option, design.sink), option.study.task
    hottest, most = float(simulator.winding(design.states[:, :1])[0]), 0.0
    fastest = simulator.substeps(design.duration / len(task.shape), design.torque)
    steps = max(fastest, 400 if task.is_hold else _LEAST_STEPS)
    for x, drive in _course(simulator, design.states[:, :1], np.array([design.torque]), design.duration, steps):
        hottest = max(hottest, float(simulator.winding(x)[0]))
        most = max(most, abs(float(simulator.electric(x, drive)[0][0])))
    return hottest, most


def _course(
    simulator: Simulator, x: FloatArray, torque: FloatArray, duration: float, steps: int
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """States and drives after each of so many steps in a part of a study's task, from states x, at peak torques."""
    task = simulator.option.study.task
    part = duration / len(task.shape)
    for share, *motion in np.tile(task.operation, (task.repeats or 1, 1)):
        drive = np.vstack([torque * share, *(np.full(torque.size, value) for value in motion)])
        for _ in range(steps):
            x = simulator.advance(x, drive, part / steps)
            yield x, drive


def peak_temperatures(
    option: Option,
    capacity: FloatArray,
    resistance: FloatArray,
    torque: FloatArray,
    duration: float,
) -> FloatArray:
    """Highest winding temperature [degC] of many designs under a study's task, shape as given.

    Of a cycle that repeats for ever it is the mean over the cycle, from the RMS current; infinite where it runs away.
    """
    simulator, task = Simulator(option, (capacity, resistance)), option.study.task
    if task.repeats is None:
        return simulator.winding(simulator.steady(simulator.equivalent(torque)))
    start = np.full((len(simulator.plant.states), capacity.size), task.start)
    hottest = simulator.winding(start)
    fastest = simulator.substeps(duration / len(task.shape), float(torque.max()))
    steps = 200 if task.is_hold else min(max(fastest, _LEAST_STEPS), _MOST_STEPS)
    for x, _ in _course(simulator, start, torque, duration, steps):
        hottest = np.maximum(hottest, simulator.winding(x))
    return np.asarray(hottest)


# --- what a design does beside its task: on other sinks, at other currents, torques and speeds ------


@dataclass(frozen=True)
class IsoMap:
    """Highest winding temperature [degC] over capacity [J/K] (n,) and resistance [K/W] (m,), shape (m, n)."""

    option: Option
    capacity: FloatArray
    resistance: FloatArray
    winding: FloatArray
    torque: float
    duration: float


def iso_map(design: Design, points: int = 30) -> IsoMap:
    """The design's task on sinks of all sizes within the study's bounds.

    Args:
        design: whose torque and duration are taken; it must have a sink.
        points: along each axis.

    Raises:
        InputError: the design has no sink.
    """
    option, study = design.option, design.option.study
    if not option.has_sink:
        raise InputError(study.origin, "map", f"{option.name}", "a design with a sink")
    capacity, resistance = study.sink.grid(points)
    every_c, every_r = (grid.ravel() for grid in np.meshgrid(capacity, resistance))
    peaks = peak_temperatures(option, every_c, every_r, np.full(every_c.size, design.torque), design.duration)
    return IsoMap(option, capacity, resistance, peaks.reshape(points, points), design.torque, design.duration)


@dataclass(frozen=True)
class LimitCurve:
    """Time [s] until the winding reaches its limit [degC] at each constant current [A]; infinite for never."""

    name: str
    limit: float
    current: FloatArray
    time: FloatArray


def limit_curves(design: Design, currents: FloatArray) -> LimitCurve:
    """Time from the start until the winding reaches its limit, for constant currents.

    Args:
        design: the motor and its cooling.
        currents: A, shape (n,).
    """
    option = design.option
    limit = option.limits.get("winding", option.motor.limits.winding or ENAMEL_LIMIT)
    simulator, task = Simulator(option, design.sink, "current"), option.study.task
    x = np.full((len(simulator.plant.states), currents.size), task.start)
    time, reached = 0.0, np.full(currents.size, np.inf)
    h, growth = 0.02, 1.02  # s: short steps at first, for a winding at many times its rating warms within a second
    while time < task.longest and np.isinf(reached).any():
        before = simulator.winding(x)
        x = simulator.advance(x, currents, h)
        after = simulator.winding(x)
        crossed = np.isinf(reached) & (after >= limit)
        reached[crossed] = time + h * ((limit - before[crossed]) / (after[crossed] - before[crossed]))
        time += h
        h *= growth
    return LimitCurve(option.name, limit, currents, reached)


@dataclass(frozen=True)
class TorqueSpeed:
    """What a design can do, behind its gear.

    Args:
        name: of the choice.
        speed: rad/s, shape (n,), up to where nothing is left.
        durations: s, shape (k,), from 0 (a moment, at the start's temperature) to infinity (for ever).
        torque: that can be held so long, from the start of the study's task [N·m], shape (k, n); NaN where the speed
            can't be held at all.
    """

    name: str
    speed: FloatArray
    durations: FloatArray
    torque: FloatArray


def torque_speed(design: Design, speeds: int = 49, unlimited: float = 40.0) -> TorqueSpeed:
    """The torque that can be held for each of some durations at each speed.

    A point can be held as long as winding and magnets stay below their limits and current and voltage suffice, with
    the magnets and the copper as warm as they are then.

    Args:
        design: the motor, its gear and its cooling.
        speeds: how many.
        unlimited: largest current [A] that is looked at where nothing limits it.

    Raises:
        InputError: neither the voltage nor the speed is limited.
    """
    option, study = design.option, design.option.study
    ratio = option.gear.ratio[0]
    limits = option.motor.limits.given | option.limits
    magnets = option.motor.torque_constant * (1 + option.motor.magnet_coefficient * (study.task.start - REFERENCE))
    ends = [limits["speed"]] if "speed" in limits else []
    ends += [limits["voltage"] / magnets] if "voltage" in limits else []
    if not ends:
        expected = "voltage = … or speed = …, where the diagram ends"
        raise InputError(study.origin, "limits", "no voltage and no speed", expected)
    speed = np.linspace(0.0, min(ends) / ratio, speeds)
    usual = 10.0, 30.0, 60.0, 180.0, 600.0, 1800.0, 3600.0  # s
    durations = np.array([0.0, *(time for time in usual if time < study.task.longest), study.task.longest, np.inf])
    most = limits.get("current", unlimited) * option.motor.torque_constant * ratio
    holds = _endurance(design, limits, np.tile(speed, durations.size), np.repeat(durations, speed.size))
    low, high = np.zeros(durations.size * speed.size), np.full(durations.size * speed.size, most)
    held_idle = holds(low)
    for _ in range(14):  # halvings: to 1e-4 of the largest torque
        middle = (low + high) / 2
        good = holds(middle)
        low, high = np.where(good, middle, low), np.where(good, high, middle)
    held = np.where(held_idle, low, np.nan).reshape(durations.size, speed.size)
    # Copper warms before the magnets do: the voltage that is needed may be largest on the way.
    return TorqueSpeed(option.name, speed, durations, np.minimum.accumulate(held))


def _endurance(
    design: Design, limits: dict[str, float], speed: FloatArray, durations: FloatArray
) -> Callable[[FloatArray], BoolArray]:
    """Whether torques [N·m] at these speeds keep the limits for so long, looked at after each step."""
    simulator, task = Simulator(design.option, design.sink), design.option.study.task
    start = np.full((len(simulator.plant.states), speed.size), task.start)
    ever = np.isinf(durations)

    def within(x: FloatArray, drive: FloatArray) -> BoolArray:
        current, voltage = simulator.electric(np.where(np.isfinite(x), x, task.ambient), drive)
        reached = {
            "winding": simulator.winding(x),
            "magnet": simulator.magnet(x),
            "current": current,
            "voltage": voltage,
        }
        kept = [value <= limits.get(name, np.inf) * (1 + 1e-9) for name, value in reached.items()]
        return np.asarray(np.all(kept, axis=0))

    def holds(torque: FloatArray) -> BoolArray:
        drive = np.vstack([torque, speed, np.zeros(torque.size)])
        good = within(start, drive)
        lasting, short = drive[:, ever], drive[:, ~ever]
        good[ever] &= within(simulator.steady(lasting), lasting)
        x = start[:, ~ever]
        # Beyond a thermal runaway long steps mean nothing; before, short ones have passed a limit. A hold changes
        # fastest at the beginning, where steps are shorter.
        for share in np.diff((np.arange(61) / 60) ** 2):
            x = simulator.advance(x, short, share * durations[~ever])
            good[~ever] &= within(x, short)
        return good

    return holds
