"""One discrete choice of a study as a nonlinear program for IPOPT.

Every limit and every number of the model is a parameter of the program: one solve gives the sensitivities to all of
them, and a limit can be moved without building anything again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, cast

import casadi as ca
import numpy as np

from lptn.arrays import FloatArray

from .course import transcribe
from .plant import CAPACITY, RESISTANCE, Parameters, Plant
from .program import Program, Solution
from .study import LIMITS, Option

_TIDY = 1e-6  # of two designs equally good the lighter one is meant; small enough not to show in a sensitivity
_TOUCHES = 1e-5  # relative; nearer to its limit than this a constraint is called binding
_WORST_SCALE = 100.0  # K
_OPTIONS: dict[str, Any] = {
    "print_time": False,
    "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-10, "max_iter": 200, "bound_relax_factor": 0},
}
_INFEASIBLE = "Infeasible_Problem_Detected"
Relaxed = Literal["winding", "magnet", "current", "pipe_power", "mass", "volume", "torque"]


class Problem:
    """The program of one option.

    Args:
        option: the discrete choice.
        given_design: hold the sink's capacity [J/K] and resistance [K/W] as parameters instead of seeking them.

    Raises:
        InputError: the motor's network can't be driven, or lacks what a sink needs.
    """

    def __init__(self, option: Option, given_design: tuple[float, float] | None = None) -> None:
        self.option = option
        self.parameters, self._program = Parameters(), Program()
        self._slack: dict[str, Any] = {}
        self._given = given_design is not None and option.has_sink
        capacity, resistance = self._design(given_design)
        self.plant = Plant(option, self.parameters, capacity, resistance)
        self._limits = {
            name: self.parameters.add(f"limit.{name}", value, LIMITS[name]) for name, value in option.limits.items()
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
        sink, found = self.option.study.sink, []
        for name, unit, (least, most) in (("capacity", "J/K", sink.capacity), ("resistance", "K/W", sink.resistance)):
            low = self.parameters.add(f"least.{name}", least, unit)
            high = self.parameters.add(f"most.{name}", most, unit)
            ends = np.log([least, most])
            logarithm = self._program.variable(name, float(ends.mean()), float(ends[0]) - 3, float(ends[1]) + 3)
            self._program.constrain(ca.log(low) - logarithm, f"least.{name}")
            self._program.constrain(logarithm - ca.log(high), f"most.{name}")
            found.append(ca.exp(logarithm))
        return found[0], found[1]

    def _task(self) -> None:
        """Torque and duration, each given or sought."""
        task = self.option.study.task
        self._torque_scale, self._time_scale = self.option.motor.torque_constant * 10.0, task.longest / 10
        self._slack["torque"] = self._program.variable("slack.torque", 0.0, 0.0, 0.0)
        if task.torque is None:
            self._torque = self._program.variable("torque", 1.0, 0.0, 1e3) * self._torque_scale
        else:
            self._torque = (
                self.parameters.add("torque", task.torque, "N*m") - self._slack["torque"] * self._torque_scale
            )
        if task.duration is None:
            most = self.parameters.add("longest", task.longest, "s")
            logarithm = self._program.variable("duration", float(np.log(10.0)), -5.0, float(np.log(task.longest)) + 1)
            self._program.constrain(logarithm - ca.log(most), "longest")
            self._duration = ca.exp(logarithm)
        else:
            self._duration = self.parameters.add("duration", task.duration, "s")

    def _limit(self, name: str, values: Any) -> None:
        """`values` at most the limit of this name, which a slack can move by multiples of its size."""
        if name in self._limits:
            self._slack[name] = self._program.variable(f"slack.{name}", 0.0, 0.0, 0.0)
            self._program.constrain((values - self._limits[name]) / self._size(name) - self._slack[name], name)

    def _size(self, name: str) -> float:
        if name == "torque":
            return self._torque_scale
        return max(abs(self.parameters.defaults[f"limit.{name}"]), 1e-6)

    def _limit_all(self) -> None:
        plant, motor, goal, ends = self.plant, self.option.motor, self.option.study.goal, self._course.ends
        windings = ca.vertcat(*[plant.temperature(x, motor.winding) for x, _ in ends])
        self._limit("winding", windings)
        self._limit("magnet", ca.vertcat(*[plant.temperature(x, motor.magnet) for x, _ in ends]))
        self._limit("current", ca.vertcat(*[plant.current(x, torque) for x, torque in ends]))
        if self.option.has_sink:
            self._limit("pipe_power", ca.vertcat(*[plant.pipe_power(x) for x, _ in ends]))
        if goal == "worst_temperature":
            self._worst = self._program.variable("worst", 0.6, -1.0, 20.0)
            self._program.constrain(windings / _WORST_SCALE - self._worst, "worst")
        if self._given:
            return  # its mass and volume are what they are
        self._limit("mass", plant.mass)
        self._limit("volume", plant.volume)
        if self.option.has_sink:
            self._program.constrain(plant.fin_share - 1, "fins")

    def _objective(self) -> tuple[Any, float]:
        """What is minimised, and the factor that turns it back into the goal's own unit."""
        goal = self.option.study.goal
        if goal == "held_torque":
            return -self._torque / self._torque_scale, -self._torque_scale
        if goal == "time_to_limit":
            return -self._duration / self._time_scale, -self._time_scale
        if goal == "worst_temperature":
            return self._worst, _WORST_SCALE
        return (self.plant.mass, 1.0) if goal == "mass" else (self.plant.volume * 1e3, 1e-3)

    def _build(self) -> None:
        objective, self._unit = self._objective()
        weight = self.parameters.add("weight", 1.0, "1")  # 0 while the least relaxation is sought
        tidy = 0 if self._given else _TIDY * self.plant.mass
        cost = weight * (objective + tidy) + (1 - weight) * ca.sum1(ca.vertcat(*self._slack.values()))
        w, p, g = self._program.w, self.parameters.stacked, self._program.g
        self._solver = ca.nlpsol("trade", "ipopt", {"x": w, "p": p, "f": cost, "g": g}, _OPTIONS)
        plant = self.plant
        shown = {
            "objective": objective * self._unit, "mass": plant.mass, "volume": plant.volume, "torque": self._torque,
            "duration": self._duration, "capacity": plant.capacity, "resistance": plant.resistance,
        }  # fmt: skip
        self._shown = list(shown)
        self._look = ca.Function("look", [w, p], [ca.vertcat(*shown.values()), ca.horzcat(*self._course.states), g])

    # --- solving ------------------------------------------------------------------------------

    def solve(
        self,
        changed: Mapping[str, float] | None = None,
        relax: Sequence[Relaxed] = (),
        near: Solution | None = None,
    ) -> Solution:
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
            upper[self._program.index(f"slack.{name}")] = self._most_slack(name)
        p, equal = self.parameters.values(changed), self._program.equal
        starts = [] if near is None else [near.raw]
        for start in (*starts, self._program.start, self._second_start()):
            done = self._solver(
                x0=start, p=p, lbx=lower, ubx=upper, lbg=np.where(equal, 0.0, -np.inf), ubg=np.zeros(equal.size)
            )
            found = self._read(done, p)
            # A relaxation that IPOPT calls infeasible is not tried again: what matters then is what does help.
            if found.success or (relax and found.status == _INFEASIBLE):
                break
        return found

    def _most_slack(self, name: Relaxed) -> float:
        """How far a limit is looked for, in multiples of its size."""
        if name == "torque":
            return 0.999 * self.parameters.defaults["torque"] / self._torque_scale
        return 5.0 if name in ("winding", "magnet") else 20.0

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

    def _read(self, done: Mapping[str, Any], p: FloatArray) -> Solution:
        stats = self._solver.stats()
        shown, path, g = self._look(done["x"], p)
        values = dict(zip(self._shown, shown.full().ravel().tolist(), strict=True))
        point = done["x"].full().ravel()
        success = bool(stats["success"])
        # CasADi's multipliers of parameters carry the opposite sign of the derivative; those of a failed solve lie.
        slope = -done["lam_p"].full().ravel() * self._unit
        gradient = dict(zip(self.parameters.symbols, slope.tolist(), strict=True)) if success else {}
        touched = self._program.touched(g.full().ravel(), _TOUCHES)
        return Solution(
            success,
            str(stats["return_status"]),
            values.pop("objective"),
            values,
            {name: float(point[self._program.index(f"slack.{name}")]) * self._size(name) for name in self._slack},
            gradient,
            tuple(name for name in touched if name != "worst"),
            path.full(),
            self._course.share * values["duration"],
            point,
        )

    def relaxable(self) -> list[Relaxed]:
        """Limits that can be moved, and the torque where it is given."""
        given = "torque" in self.parameters.symbols
        return [cast(Relaxed, name) for name in self._slack if given or name != "torque"]

    def limit(self, name: Relaxed, moved: Solution) -> float:
        """What a limit, or the torque, would have to be."""
        if name == "torque":
            return self.parameters.defaults["torque"] - moved.slack["torque"]
        return self.parameters.defaults[f"limit.{name}"] + moved.slack[name]
