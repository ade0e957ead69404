"""One discrete choice of a study as a nonlinear program for IPOPT: a solution, or the limits in the way of any.

Every limit and every number of the model is a parameter of the program: one solve gives the sensitivities to all of
them, and a limit can be moved without building anything again.

The temperatures along the task are unknowns of the program, held together by the model's heat balance: direct
collocation with Radau IIA of order 5. It is L-stable, so that a long hold needs no small steps, and a winding near
thermal runaway does no harm, since the states are found together with the design.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray

from .plant import CAPACITY, RESISTANCE, Load, Parameters, Plant
from .study import BUDGETS, LIMITS, Option

_WORST_SCALE = 100.0  # K
_OPTIONS: dict[str, Any] = {
    "print_time": False,
    "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-10, "max_iter": 200, "bound_relax_factor": 0},
}


@dataclass
class NonlinearProgram:
    """A nonlinear program as it is gathered: variables by name, and expressions that must be zero or at most zero."""

    symbols: dict[str, Any] = field(default_factory=dict)
    numbers: list[tuple[float, float, float]] = field(default_factory=list)
    """Start, least and greatest of each variable."""
    expressions: list[Any] = field(default_factory=list)
    rows: list[tuple[str, bool]] = field(default_factory=list)
    """For each scalar row of the expressions its label, and whether it must be zero."""

    def variable(self, name: str, start: float, least: float, greatest: float) -> Any:
        """A new variable's symbol."""
        self.symbols[name] = ca.SX.sym(name)
        self.numbers.append((start, least, greatest))
        return self.symbols[name]

    def constrain(self, expression: Any, label: str, *, equal: bool = False) -> None:
        """Demand an expression to be at most zero, or zero."""
        self.expressions.append(expression)
        self.rows += [(label, equal)] * int(expression.shape[0])

    def index(self, name: str) -> int:
        """Where a variable stands."""
        return list(self.symbols).index(name)

    def active(self, values: FloatArray, tolerance: float = 1e-5) -> list[str]:
        """Labels of the inequalities that reach zero but for a relative tolerance, without repetition."""
        reached = [label for (label, equal), value in zip(self.rows, values, strict=True)
                   if not equal and value > -tolerance]  # fmt: skip
        return list(dict.fromkeys(reached))


@dataclass(frozen=True)
class DesignNumbers:
    """What a design is in numbers.

    Args:
        value: of the goal, in its unit.
        capacity, resistance: of the sink [J/K, K/W]; `None` without one.
        ratio: of the gear.
        mass, volume, price: of motor, gear and cooling [kg, m³].
        torque: peak torque behind the gear [N·m].
        duration: of the hold or the cycle [s].
    """

    value: float
    capacity: float | None
    resistance: float | None
    ratio: float
    mass: float
    volume: float
    price: float
    torque: float
    duration: float

    @property
    def sink(self) -> tuple[float, float] | None:
        """Its capacity [J/K] and resistance [K/W], `None` without one."""
        if self.capacity is None or self.resistance is None:
            return None
        return self.capacity, self.resistance

    @property
    def numbers(self) -> dict[str, Any]:
        """Those of the design alone, by name."""
        return {each.name: getattr(self, each.name) for each in fields(DesignNumbers)}


@dataclass(frozen=True)
class DesignSolution(DesignNumbers):
    """What IPOPT found: a design's numbers, and further.

    Args:
        success: whether it converged; if not, nothing else means anything.
        status: IPOPT's return status.
        slack: by how much each limit was moved, in its unit.
        sensitivities: derivative of the goal to every parameter, by name, in the goal's unit per the parameter's, the
            design re-optimised; Lagrange multipliers of the converged program. Empty unless it converged.
        binding: names of the active constraints.
        states: at the ends of the elements [degC], shape (number of states, elements + 1).
        raw: IPOPT's primal point, to start from.
    """

    success: bool
    status: str
    slack: dict[str, float]
    sensitivities: dict[str, float]
    binding: tuple[str, ...]
    states: FloatArray
    raw: FloatArray


@dataclass(frozen=True)
class Obstacle:
    """A limit in the way: what it is, what it alone would have to be, and its unit."""

    name: str
    given: float
    needed: float
    unit: str

    @property
    def move(self) -> float:
        """By how much it would have to change, relative."""
        return abs(self.needed / self.given - 1)

    def __str__(self) -> str:
        return f"{self.name} {self.given:.4g} -> {self.needed:.4g} {self.unit}"


@dataclass(frozen=True)
class Refusal:
    """A choice without a feasible design.

    Args:
        option: the discrete choice.
        obstacles: the limits that would each make it feasible alone, the nearest first.
        together: where no single one would, those that would together, by the least sum of relative moves.
    """

    option: Option
    obstacles: tuple[Obstacle, ...]
    together: tuple[Obstacle, ...] = ()

    def __str__(self) -> str:
        if self.obstacles:
            return " or ".join(str(obstacle) for obstacle in self.obstacles)
        return " with ".join(str(obstacle) for obstacle in self.together) or "no limit would help"

    @property
    def distance(self) -> float:
        """Relative move of the nearest obstacle, or of those that must move together."""
        chosen = self.obstacles[:1] or self.together
        return sum(obstacle.move for obstacle in chosen) if chosen else float("inf")


class DesignProblem:
    """The program of one option.

    Args:
        option: the discrete choice.
        given_design: hold the sink's capacity [J/K] and resistance [K/W] as parameters instead of seeking them.

    Raises:
        InputError: the motor's network can't be driven, or lacks what a sink needs.
    """

    def __init__(self, option: Option, given_design: tuple[float, float] | None = None) -> None:
        self.option = option
        self.parameters, self._program = Parameters(), NonlinearProgram()
        add, sink = self.parameters.add, option.study.sink
        self._slack: dict[str, Any] = {}
        self._given = given_design is not None and option.has_sink
        capacity = resistance = ca.SX(1.0)
        if given_design is not None and option.has_sink:
            capacity, resistance = add(CAPACITY, given_design[0], "J/K"), add(RESISTANCE, given_design[1], "K/W")
        elif option.has_sink:
            capacity = self._sought("capacity", sink.capacity, "J/K")
            resistance = self._sought("resistance", sink.resistance, "K/W")
        ratio = self._sought("ratio", option.gear.ratio, "1") if option.gear.is_sought else None
        self.plant = Plant(option, self.parameters, capacity, resistance, ratio)
        self._limits = {
            name: add(f"limit.{name}", value, LIMITS[name] or option.study.question.currency)
            for name, value in option.limits.items()
        }
        self._task()
        self._transcribe()
        self._limit_all()
        self._build()

    # --- building -----------------------------------------------------------------------------

    def _sought(self, name: str, bounds: Sequence[float], unit: str) -> Any:
        """A number of the design between two bounds, which are parameters.

        As a logarithm it is positive, and well scaled.
        """
        low, high = (self.parameters.add(f"{end}.{name}", bounds[k], unit) for k, end in enumerate(("least", "most")))
        ends = np.log(bounds)
        logarithm = self._program.variable(name, float(ends.mean()), float(ends[0]) - 3, float(ends[1]) + 3)
        self._program.constrain(ca.log(low) - logarithm, f"least.{name}")
        self._program.constrain(logarithm - ca.log(high), f"most.{name}")
        return ca.exp(logarithm)

    def _task(self) -> None:
        """Torque and duration, each given or sought."""
        task = self.option.study.task
        geared = float(np.sqrt(self.option.gear.ratio[0] * self.option.gear.ratio[1]))
        self._torque_scale, self._time_scale = self.option.motor.torque_constant * 10.0 * geared, task.longest / 10
        self._slack["torque"] = self._program.variable("slack.torque", 0.0, 0.0, 0.0)
        torque = self.option.study.torque
        if torque is None:
            self._torque = self._program.variable("torque", 1.0, 0.0, 1e3) * self._torque_scale
        else:
            self._torque = self.parameters.add("torque", torque, "N*m") - self._slack["torque"] * self._torque_scale
        if task.time is None:
            most = self.parameters.add("longest", task.longest, "s")
            logarithm = self._program.variable("duration", float(np.log(10.0)), -5.0, float(np.log(task.longest)) + 1)
            self._program.constrain(logarithm - ca.log(most), "longest")
            self._duration = ca.exp(logarithm)
        else:
            self._duration = self.parameters.add("duration", task.time, "s")

    def _transcribe(self) -> None:
        """States at the ends of the elements, the load in each, the ends' times as shares of the duration; and the
        heat balance that holds the states together."""
        task, n = self.option.study.task, len(self.plant.states)
        degree, hold_elements = 3, 16
        grading = 1.6 if task.is_hold else 1.0  # shorter elements at the beginning, where a hold changes fastest
        parts = np.tile(task.operation, (hold_elements if task.is_hold else task.repeats or 1, 1))
        self._share = (np.arange(len(parts) + 1) / len(parts)) ** grading * (task.repeats or 1)
        # K below and above the air: beyond runaway the steady state's formula turns negative.
        low, high = min(task.ambient, task.start) - 5.0, max(task.ambient, task.start) + 1000.0
        warm = task.ambient + 20.0  # to start from

        def state(name: str) -> Any:
            return ca.vertcat(*[self._program.variable(f"{name}.{i}", warm, low, high) for i in range(n)])

        derivative, _, _ = ca.collocation_coeff(ca.collocation_points(degree, "radau"))
        start = self.parameters.add("start", task.start, "degC")
        self._states = [state("x0") if task.repeats is None else ca.repmat(start, n, 1)]
        self._loads = [Load(self._torque * share, *motion) for share, *motion in parts.tolist()]
        for k, load in enumerate(self._loads):
            stages = [state(f"x{k + 1}s{j}") for j in range(degree)]
            h = self._duration * float(self._share[k + 1] - self._share[k])
            for j in range(degree):
                slope = ca.mtimes(ca.horzcat(self._states[-1], *stages), derivative[:, j])
                self._program.constrain(slope - h * self.plant.rates(stages[j], load), "heat balance", equal=True)
            self._states.append(stages[-1])
        if task.repeats is None:
            self._program.constrain(self._states[-1] - self._states[0], "heat balance", equal=True)

    def _limit(self, name: str, values: Callable[[], Any]) -> None:
        """`values` at most the limit of this name where there is one; a slack can move it by multiples of its size."""
        if name in self._limits:
            self._slack[name] = self._program.variable(f"slack.{name}", 0.0, 0.0, 0.0)
            self._program.constrain((values() - self._limits[name]) / self._size(name) - self._slack[name], name)

    def _size(self, name: str) -> float:
        if name == "torque":
            return self._torque_scale
        return max(abs(self.parameters.defaults[f"limit.{name}"]), 1e-6)

    def _limit_all(self) -> None:
        plant, motor, task = self.plant, self.option.motor, self.option.study.task
        begins, ends = (list(zip(states, self._loads, strict=True)) for states in (self._states[:-1], self._states[1:]))

        def of_all(quantity: Callable[[Any, Load], Any], at: Sequence[Any] = ends, signed: bool = False) -> Any:
            values = [quantity(*moment) for moment in at]
            return ca.vertcat(*values, *([-value for value in values] if signed else []))

        windings = of_all(lambda x, _: plant.temperatures(x, motor.winding_nodes))
        self._limit("winding", lambda: windings)
        self._limit("magnet", lambda: of_all(lambda x, _: plant.temperatures(x, motor.magnet_nodes)))
        self._limit("current", lambda: of_all(plant.current, signed=bool(task.accelerations.any())))
        self._limit("voltage", lambda: of_all(plant.voltage, [*begins, *ends], signed=bool((task.motion < 0).any())))
        self._limit("speed", lambda: plant.ratio * float(np.abs(task.motion).max()))
        self._limit("pipe_power", lambda: of_all(plant.pipe_power))
        if self.option.study.question.goal == "worst_temperature":
            self._worst = self._program.variable("worst", 0.6, -1.0, 20.0)
            self._program.constrain(windings / _WORST_SCALE - self._worst, "worst")
        if self._given:
            return  # its mass and volume are what they are
        for name in BUDGETS:
            self._limit(name, partial(plant.spent.get, name))
        if self.option.has_sink:
            self._program.constrain(plant.sink.fin_share(plant.capacity, plant.resistance) - 1, "fins")

    def _build(self) -> None:
        plant, dear = self.plant, max(self.option.fixed["price"], 1.0)
        # What is minimised, and the factor that turns it back into the goal's own unit.
        objective, self._unit = {
            "held_torque": lambda: (-self._torque / self._torque_scale, -self._torque_scale),
            "time_to_limit": lambda: (-self._duration / self._time_scale, -self._time_scale),
            "worst_temperature": lambda: (self._worst, _WORST_SCALE),
            "mass": lambda: (plant.spent["mass"], 1.0),
            "volume": lambda: (plant.spent["volume"] / 1e-3, 1e-3),
            "price": lambda: (plant.spent["price"] / dear, dear),
        }[self.option.study.question.goal]()
        weight = self.parameters.add("weight", 1.0, "1")  # 0 while the least relaxation is sought
        # Of two designs equally good the lighter one is meant; its weight is too small to show in a sensitivity.
        tidy = 0 if self._given else 1e-6 * plant.spent["mass"]
        cost = weight * (objective + tidy) + (1 - weight) * ca.sum1(ca.vertcat(*self._slack.values()))
        w, g = ca.vertcat(*self._program.symbols.values()), ca.vertcat(*self._program.expressions)
        p = self.parameters.stacked
        self._solver = ca.nlpsol("trade", "ipopt", {"x": w, "p": p, "f": cost, "g": g}, _OPTIONS)
        numbers = (objective * self._unit, plant.capacity, plant.resistance, plant.ratio, *plant.spent.values(),
                   self._torque, self._duration)  # fmt: skip
        self._look = ca.Function("look", [w, p], [ca.vertcat(*numbers), ca.horzcat(*self._states), g])

    # --- solving ------------------------------------------------------------------------------

    def solve(
        self,
        changed: Mapping[str, float] | None = None,
        relax: Sequence[str] = (),
        near: DesignSolution | None = None,
    ) -> DesignSolution:
        """Solve it.

        Args:
            changed: parameters by name that differ from the study's.
            relax: find instead the least relaxation of these limits (or of the torque asked for), as a sum of shares
                of their sizes, that makes the rest possible.
            near: a solution to start from; one that failed is passed over.
        """
        start, lower, upper = np.array(self._program.numbers).T
        for name in relax:
            changed = {**(changed or {}), "weight": 0.0}
            # How far a limit is looked for, in multiples of its size.
            most = 5.0 if name in ("winding", "magnet") else 20.0
            if name == "torque":
                most = 0.999 * self.parameters.defaults["torque"] / self._torque_scale
            upper[self._program.index(f"slack.{name}")] = most
        p = self.parameters.values(changed)
        least = np.where([equal for _, equal in self._program.rows], 0.0, -np.inf)
        for begin in (*([near.raw] if near and near.success else []), start, self._second_start(start)):
            done = self._solver(x0=begin, p=p, lbx=lower, ubx=upper, lbg=least, ubg=0.0)
            solution = self._read(done, p)
            # A relaxation that IPOPT calls infeasible is not tried again: what matters then is what does help.
            if solution.success or (relax and solution.status == "Infeasible_Problem_Detected"):
                break
        return solution

    def _second_start(self, start: FloatArray) -> FloatArray:
        """Everything hot, the sink as large as may be, the demand low."""
        start, sink = start.copy(), self.option.study.sink
        best = {"capacity": float(np.log(sink.capacity[1])), "resistance": float(np.log(sink.resistance[0]))}
        for index, name in enumerate(self._program.symbols):
            if name.startswith("x"):
                start[index] += 40.0
            elif name in ("torque", "duration"):
                start[index] -= 0.7
            start[index] = best.get(name, start[index])
        return start

    def _read(self, done: Mapping[str, Any], p: FloatArray) -> DesignSolution:
        stats = self._solver.stats()
        success, point = bool(stats["success"]), done["x"].full().ravel()
        values, path, g = (value.full() for value in self._look(done["x"], p))
        names = [each.name for each in fields(DesignNumbers)]
        numbers: dict[str, Any] = dict(zip(names, values.ravel().tolist(), strict=True))
        if not self.option.has_sink:
            numbers |= {"capacity": None, "resistance": None}
        # CasADi's multipliers of parameters carry the opposite sign of the derivative; those of a failed solve lie.
        slope = -done["lam_p"].full().ravel() * self._unit
        return DesignSolution(
            **numbers,
            success=success,
            status=str(stats["return_status"]),
            slack={name: float(point[self._program.index(f"slack.{name}")]) * self._size(name) for name in self._slack},
            sensitivities=dict(zip(self.parameters.symbols, slope.tolist(), strict=True)) if success else {},
            binding=tuple(name for name in self._program.active(g.ravel()) if name != "worst"),
            states=path,
            raw=point,
        )  # fmt: skip

    def refusal(self) -> Refusal:
        """Each limit that would make an infeasible problem feasible if it alone were moved; else several together."""
        given, units = self.parameters.defaults, self.parameters.units
        names = [name for name in self._slack if name != "torque" or name in given]

        def obstacles(relaxed: list[str]) -> list[Obstacle]:
            """These limits where the least relaxation moves them; none where it does not help."""
            moved = self.solve(relax=relaxed)
            keys = {name: name if name == "torque" else f"limit.{name}" for name in relaxed if moved.success}
            signs = {"torque": -1.0}  # less torque is easier, more of a limit
            return [
                Obstacle(name, given[key], given[key] + signs.get(name, 1.0) * moved.slack[name], units[key])
                for name, key in keys.items()
            ]

        # Where there is not even mass for the parts, no other limit could help alone.
        short = [name for name in BUDGETS if given.get(f"limit.{name}", np.inf) < self.option.least(name)]
        alone = names if not short else short if len(short) == 1 else []
        single = sorted((each for name in alone for each in obstacles([name])), key=lambda each: each.move)
        together = [] if single else [each for each in obstacles(names) if each.move > 1e-4]  # others stayed
        return Refusal(self.option, tuple(single), tuple(together))
