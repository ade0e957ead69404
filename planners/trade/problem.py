"""One discrete choice of a study as a nonlinear program for IPOPT: variables, heat balance, limits, goal, solution.

Every limit and every number of the model is a parameter of the program: one solve gives the sensitivities to all of
them, and a limit can be moved without building anything again.

The temperatures along the task are unknowns of the program, held together by the model's heat balance: direct
collocation with Radau IIA of order 5. It is L-stable, so that a long hold needs no small steps, and a winding near
thermal runaway does no harm, since the states are found together with the design.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, cast

import casadi as ca
import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray

from .plant import CAPACITY, RESISTANCE, Load, Parameters, Plant
from .study import Option
from .tables import LIMITS

_WORST_SCALE = 100.0  # K
_OPTIONS: dict[str, Any] = {
    "print_time": False,
    "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-10, "max_iter": 200, "bound_relax_factor": 0},
}
Relaxed = Literal["winding", "magnet", "current", "voltage", "speed", "pipe_power", "mass", "volume", "price", "torque"]


@dataclass
class NonlinearProgram:
    """A nonlinear program as it is gathered by name: variables, and expressions that must be zero or at most zero."""

    names: list[str] = field(default_factory=list)
    symbols: list[Any] = field(default_factory=list)
    starts: list[float] = field(default_factory=list)
    lowers: list[float] = field(default_factory=list)
    uppers: list[float] = field(default_factory=list)
    expressions: list[Any] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)
    equalities: list[bool] = field(default_factory=list)

    def variable(self, name: str, start: float, lower: float, upper: float) -> Any:
        """A new variable's symbol."""
        symbol = ca.SX.sym(name)
        self.names.append(name)
        self.symbols.append(symbol)
        self.starts.append(start)
        self.lowers.append(lower)
        self.uppers.append(upper)
        return symbol

    def constrain(self, expression: Any, label: str, *, equal: bool = False) -> None:
        """Demand an expression to be at most zero, or zero."""
        rows = int(expression.shape[0])
        self.expressions.append(expression)
        self.equalities += [equal] * rows
        self.labels += [label] * rows

    def index(self, name: str) -> int:
        """Where a variable stands."""
        return self.names.index(name)

    @property
    def w(self) -> Any:
        return ca.vertcat(*self.symbols)

    @property
    def g(self) -> Any:
        return ca.vertcat(*self.expressions)

    @property
    def equal(self) -> BoolArray:
        return np.array(self.equalities)

    @property
    def start(self) -> FloatArray:
        return np.array(self.starts)

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Least and greatest of each variable, fresh copies."""
        return np.array(self.lowers), np.array(self.uppers)

    def active(self, values: FloatArray, tolerance: float = 1e-5) -> list[str]:
        """Labels of the inequalities that reach zero but for a relative tolerance, without repetition."""
        rows = zip(self.labels, self.equalities, values, strict=True)
        return list(dict.fromkeys(label for label, equal, value in rows if not equal and value > -tolerance))


@dataclass(frozen=True)
class DesignSolution:
    """What IPOPT found.

    Args:
        success: whether it converged; if not, nothing else means anything.
        status: IPOPT's return status.
        objective: the goal's value in its unit.
        variables: mass, volume, price, torque, duration, capacity, resistance, ratio.
        slack: by how much each limit was moved, in its unit.
        gradient: derivative of the goal to each parameter by name; empty unless it converged.
        binding: names of the active constraints.
        states: at the ends of the elements [degC], shape (number of states, elements + 1).
        times: of those [s].
        raw: IPOPT's primal point, to start from.
    """

    success: bool
    status: str
    objective: float
    variables: dict[str, float]
    slack: dict[str, float]
    gradient: dict[str, float]
    binding: tuple[str, ...]
    states: FloatArray
    times: FloatArray
    raw: FloatArray


@dataclass(frozen=True)
class DesignTrajectory:
    """States at the ends of the elements, load in each, and the ends' times as shares of the duration."""

    states: list[Any]
    loads: list[Load]
    share: FloatArray

    @property
    def ends(self) -> list[tuple[Any, Load]]:
        """State and load at the end of each element."""
        return list(zip(self.states[1:], self.loads, strict=True))

    @property
    def both_ends(self) -> list[tuple[Any, Load]]:
        """State and load at the beginning and at the end of each element."""
        return [*zip(self.states[:-1], self.loads, strict=True), *self.ends]


def transcribe(program: NonlinearProgram, plant: Plant, torque: Any, duration: Any) -> DesignTrajectory:
    """Add a task's states and heat balance to a program.

    Args:
        program: gains variables and equalities.
        plant: rates and states.
        torque: peak torque behind the gear [N·m], an expression.
        duration: of the hold or the cycle [s], an expression.
    """
    task = plant.option.study.task
    degree, hold_elements = 3, 16
    grading = 1.6 if task.is_hold else 1.0  # shorter elements at the beginning, where a hold changes fastest
    parts = np.tile(task.operation, (hold_elements if task.is_hold else task.repeats or 1, 1))
    elements, n = len(parts), len(plant.states)
    share = (np.arange(elements + 1) / elements) ** grading * (task.repeats or 1)
    # K below and above the air: beyond runaway the steady state's formula turns negative.
    low, high = min(task.ambient, task.start) - 5.0, max(task.ambient, task.start) + 1000.0
    warm = task.ambient + 20.0  # to start from

    def state(name: str) -> Any:
        return ca.vertcat(*[program.variable(f"{name}.{i}", warm, low, high) for i in range(n)])

    derivative, _, _ = ca.collocation_coeff(ca.collocation_points(degree, "radau"))
    start = plant.parameters.add("start", task.start, "degC")
    path = [state("x0") if task.repeats is None else ca.repmat(start, n, 1)]
    loads = [Load(torque * share, *motion) for share, *motion in parts.tolist()]
    for k, load in enumerate(loads):
        stages = [state(f"x{k + 1}s{j}") for j in range(degree)]
        h = duration * float(share[k + 1] - share[k])
        for j in range(degree):
            slope = ca.mtimes(ca.horzcat(path[-1], *stages), derivative[:, j])
            program.constrain(slope - h * plant.rates(stages[j], load), "heat balance", equal=True)
        path.append(stages[-1])
    if task.repeats is None:
        program.constrain(path[-1] - path[0], "heat balance", equal=True)
    return DesignTrajectory(path, loads, share)


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
        self._slack: dict[str, Any] = {}
        self._given = given_design is not None and option.has_sink
        capacity, resistance = self._design(given_design)
        gear = option.gear
        ratio = self._sought("ratio", gear.ratio, "1") if gear.is_sought else None
        self.plant = Plant(option, self.parameters, capacity, resistance, ratio)
        self._limits = {
            name: self.parameters.add(f"limit.{name}", value, LIMITS[name] or option.study.question.currency)
            for name, value in option.limits.items()
        }
        self._task()
        self._course = transcribe(self._program, self.plant, self._torque, self._duration)
        self._limit_all()
        self._build()

    # --- building -----------------------------------------------------------------------------

    def _design(self, given: tuple[float, float] | None) -> tuple[Any, Any]:
        """Capacity and resistance of the sink; sought ones as logarithms, which are well scaled and positive."""
        if not self.option.has_sink:
            return ca.SX(1.0), ca.SX(1.0)
        if given is not None:
            return self.parameters.add(CAPACITY, given[0], "J/K"), self.parameters.add(RESISTANCE, given[1], "K/W")
        sink = self.option.study.sink
        return self._sought("capacity", sink.capacity, "J/K"), self._sought("resistance", sink.resistance, "K/W")

    def _sought(self, name: str, bounds: Sequence[float], unit: str) -> Any:
        """A number of the design between two bounds, which are parameters."""
        low, high = (
            self.parameters.add(f"{end}.{name}", value, unit)
            for end, value in zip(("least", "most"), bounds, strict=True)
        )
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

    def _limit(self, name: str, values: Any) -> None:
        """`values` at most the limit of this name, which a slack can move by multiples of its size."""
        if name in self._limits:
            self._slack[name] = self._program.variable(f"slack.{name}", 0.0, 0.0, 0.0)
            self._program.constrain((values - self._limits[name]) / self._size(name) - self._slack[name], name)

    def _limit_size(self, name: str, values: list[Any], signed: bool) -> None:
        """The same for the size of values that may have either sign."""
        self._limit(name, ca.vertcat(*values, *([-value for value in values] if signed else [])))

    def _size(self, name: str) -> float:
        if name == "torque":
            return self._torque_scale
        return max(abs(self.parameters.defaults[f"limit.{name}"]), 1e-6)

    def _limit_all(self) -> None:
        plant, motor, goal, ends = self.plant, self.option.motor, self.option.study.question.goal, self._course.ends
        windings = ca.vertcat(*[plant.temperatures(x, motor.winding_nodes) for x, _ in ends])
        self._limit("winding", windings)
        self._limit("magnet", ca.vertcat(*[plant.temperatures(x, motor.magnet_nodes) for x, _ in ends]))
        task = self.option.study.task
        self._limit_size("current", [plant.current(x, load) for x, load in ends], bool(task.accelerations.any()))
        reverses = bool((task.motion < 0).any())
        self._limit_size("voltage", [plant.voltage(x, load) for x, load in self._course.both_ends], reverses)
        self._limit("speed", plant.ratio * float(np.abs(task.motion).max()))
        if self.option.has_sink:
            self._limit("pipe_power", ca.vertcat(*[plant.pipe_power(x, load) for x, load in ends]))
        if goal == "worst_temperature":
            self._worst = self._program.variable("worst", 0.6, -1.0, 20.0)
            self._program.constrain(windings / _WORST_SCALE - self._worst, "worst")
        if self._given:
            return  # its mass and volume are what they are
        self._limit("mass", plant.mass)
        self._limit("volume", plant.volume)
        self._limit("price", plant.price)
        if self.option.has_sink:
            self._program.constrain(plant.fin_share - 1, "fins")

    def _objective(self) -> tuple[Any, float]:
        """What is minimised, and the factor that turns it back into the goal's own unit."""
        goal = self.option.study.question.goal
        if goal == "held_torque":
            return -self._torque / self._torque_scale, -self._torque_scale
        if goal == "time_to_limit":
            return -self._duration / self._time_scale, -self._time_scale
        if goal == "worst_temperature":
            return self._worst, _WORST_SCALE
        scale = {"mass": 1.0, "volume": 1e-3, "price": max(self.option.fixed_price, 1.0)}[goal]
        return {"mass": self.plant.mass, "volume": self.plant.volume, "price": self.plant.price}[goal] / scale, scale

    def _build(self) -> None:
        objective, self._unit = self._objective()
        weight = self.parameters.add("weight", 1.0, "1")  # 0 while the least relaxation is sought
        # Of two designs equally good the lighter one is meant; its weight is too small to show in a sensitivity.
        tidy = 0 if self._given else 1e-6 * self.plant.mass
        cost = weight * (objective + tidy) + (1 - weight) * ca.sum1(ca.vertcat(*self._slack.values()))
        w, p, g = self._program.w, self.parameters.stacked, self._program.g
        self._solver = ca.nlpsol("trade", "ipopt", {"x": w, "p": p, "f": cost, "g": g}, _OPTIONS)
        plant = self.plant
        shown = {
            "objective": objective * self._unit, "mass": plant.mass, "volume": plant.volume, "price": plant.price,
            "torque": self._torque, "duration": self._duration, "capacity": plant.capacity,
            "resistance": plant.resistance, "ratio": plant.ratio,
        }  # fmt: skip
        self._shown = list(shown)
        self._look = ca.Function("look", [w, p], [ca.vertcat(*shown.values()), ca.horzcat(*self._course.states), g])

    # --- solving ------------------------------------------------------------------------------

    def solve(
        self,
        changed: Mapping[str, float] | None = None,
        relax: Sequence[Relaxed] = (),
        near: DesignSolution | None = None,
    ) -> DesignSolution:
        """Solve it.

        Args:
            changed: parameters by name that differ from the study's.
            relax: find instead the least relaxation of these limits (or of the torque asked for), as a sum of shares
                of their sizes, that makes the rest possible.
            near: a solution to start from.
        """
        lower, upper = self._program.bounds
        for name in relax:
            changed = {**(changed or {}), "weight": 0.0}
            # How far a limit is looked for, in multiples of its size.
            most = 5.0 if name in ("winding", "magnet") else 20.0
            if name == "torque":
                most = 0.999 * self.parameters.defaults["torque"] / self._torque_scale
            upper[self._program.index(f"slack.{name}")] = most
        p, equal = self.parameters.values(changed), self._program.equal
        starts = [] if near is None else [near.raw]
        for start in (*starts, self._program.start, self._second_start()):
            done = self._solver(
                x0=start, p=p, lbx=lower, ubx=upper, lbg=np.where(equal, 0.0, -np.inf), ubg=np.zeros(equal.size)
            )
            solution = self._read(done, p)
            # A relaxation that IPOPT calls infeasible is not tried again: what matters then is what does help.
            if solution.success or (relax and solution.status == "Infeasible_Problem_Detected"):
                break
        return solution

    def _second_start(self) -> FloatArray:
        """Everything hot, the sink as large as may be, the demand low."""
        start, sink = self._program.start, self.option.study.sink
        best = {"capacity": float(np.log(sink.capacity[1])), "resistance": float(np.log(sink.resistance[0]))}
        for index, name in enumerate(self._program.names):
            if name.startswith("x"):
                start[index] += 40.0
            elif name in ("torque", "duration"):
                start[index] -= 0.7
            start[index] = best.get(name, start[index])
        return start

    def _read(self, done: Mapping[str, Any], p: FloatArray) -> DesignSolution:
        stats = self._solver.stats()
        shown, path, g = self._look(done["x"], p)
        values = dict(zip(self._shown, shown.full().ravel().tolist(), strict=True))
        point = done["x"].full().ravel()
        success = bool(stats["success"])
        # CasADi's multipliers of parameters carry the opposite sign of the derivative; those of a failed solve lie.
        slope = -done["lam_p"].full().ravel() * self._unit
        gradient = dict(zip(self.parameters.symbols, slope.tolist(), strict=True)) if success else {}
        active = self._program.active(g.full().ravel())
        return DesignSolution(
            success,
            str(stats["return_status"]),
            values.pop("objective"),
            values,
            {name: float(point[self._program.index(f"slack.{name}")]) * self._size(name) for name in self._slack},
            gradient,
            tuple(name for name in active if name != "worst"),
            path.full(),
            self._course.share * values["duration"],
            point,
        )

    def relaxable(self) -> list[Relaxed]:
        """Limits that can be moved, and the torque where it is given."""
        given = "torque" in self.parameters.symbols
        return [cast(Relaxed, name) for name in self._slack if given or name != "torque"]

    def limit(self, name: Relaxed, moved: DesignSolution) -> float:
        """What a limit, or the torque, would have to be."""
        if name == "torque":
            return self.parameters.defaults["torque"] - moved.slack["torque"]
        return self.parameters.defaults[f"limit.{name}"] + moved.slack[name]
