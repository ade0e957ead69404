"""A feasible choice at its best with what it would cost to change it, or a refused one with what is in its way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lptn.arrays import FloatArray

from .plant import CAPACITY, RESISTANCE
from .problem import Problem, Relaxed
from .program import Solution
from .replay import replayed
from .sink import SPECIFIC_HEAT
from .study import Option

_MOVED = 1e-4  # relative; a limit that moved less did not move


@dataclass(frozen=True)
class Design:
    """A feasible choice at its best.

    Args:
        option: the discrete choice.
        value: of the goal, in its unit.
        capacity, resistance: of the sink [J/K, K/W]; `None` without one.
        mass, volume: of motor and cooling [kg, m³].
        torque: peak torque at the motor [N·m].
        duration: of the hold or the cycle [s].
        winding: the highest winding temperature [degC].
        current: the highest current [A].
        binding: names of the constraints that it touches.
        parameters: value and unit of every number of the program, by name.
        prices: derivative of the goal to every parameter, by name, in the goal's unit per the parameter's, the design
            following; Lagrange multipliers of the converged program.
        of_sink: derivative of the goal to the sink's capacity [per J/K], mass [per kg of aluminium] and resistance
            [per K/W] with all else of the design held; empty without a sink, or where that program did not converge.
        checked: the highest winding temperature in a fine simulation of the same design [degC].
        times, states: the course [s], [degC].
    """

    option: Option
    value: float
    capacity: float | None
    resistance: float | None
    mass: float
    volume: float
    torque: float
    duration: float
    winding: float
    current: float
    binding: tuple[str, ...]
    parameters: dict[str, tuple[float, str]]
    prices: dict[str, float]
    of_sink: dict[str, float]
    checked: float
    times: FloatArray
    states: FloatArray

    @property
    def degenerate(self) -> bool:
        """Whether more constraints are touched than can move: then a price holds to one side only, or to neither."""
        study = self.option.study
        sought = study.goal in ("held_torque", "time_to_limit", "worst_temperature")
        touched = len(self.binding) + (study.goal == "worst_temperature")
        return touched > 2 * self.option.has_sink + sought


@dataclass(frozen=True)
class Obstacle:
    """A limit in the way: what it is, what it alone would have to be, and its unit."""

    name: str
    given: float
    needed: float
    unit: str

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
        return sum(abs(each.needed / each.given - 1) for each in chosen) if chosen else float("inf")


def design_of(problem: Problem, found: Solution) -> Design:
    """A converged solution as a design, with what it would cost to change it."""
    option, values = problem.option, found.variables
    sink = (values["capacity"], values["resistance"]) if option.has_sink else None
    winding = problem.plant.states.index(option.motor.winding)
    replay = replayed(option, sink, values["torque"], values["duration"], found.states[:, 0])
    return Design(
        option,
        found.objective,
        sink[0] if sink else None,
        sink[1] if sink else None,
        values["mass"],
        values["volume"],
        values["torque"],
        values["duration"],
        float(found.states[winding].max()),
        replay.current,
        found.binding,
        {name: (value, problem.parameters.units[name]) for name, value in problem.parameters.defaults.items()},
        found.gradient,
        sink_prices(option, sink, found) if sink else {},
        replay.winding,
        found.times,
        found.states,
    )


def sink_prices(option: Option, sink: tuple[float, float], near: Solution) -> dict[str, float]:
    """Derivatives of the goal to the sink's two numbers, the rest of the design held."""
    if option.study.goal in ("mass", "volume"):
        return {}  # at a given sink its mass is given
    held = Problem(option, sink)
    found = held.solve()
    if not found.success:
        return {}
    per_capacity = found.gradient[CAPACITY]
    return {"capacity": per_capacity, "mass": per_capacity * SPECIFIC_HEAT, "resistance": found.gradient[RESISTANCE]}


def refusal_of(problem: Problem) -> Refusal:
    """Each limit that would make an infeasible problem feasible if it alone were moved; else several together."""
    single = []
    for name in _hopeful(problem):
        moved = problem.solve(relax=[name])
        if moved.success:
            single.append(_obstacle(problem, name, moved))
    single.sort(key=lambda each: abs(each.needed / each.given - 1))
    together: list[Obstacle] = []
    if not single:
        moved = problem.solve(relax=problem.relaxable())
        if moved.success:
            together = [_obstacle(problem, name, moved) for name in problem.relaxable()]
            together = [each for each in together if abs(each.needed / each.given - 1) > _MOVED]
    return Refusal(problem.option, tuple(single), tuple(together))


def _hopeful(problem: Problem) -> list[Relaxed]:
    """Limits that could help alone: where there is not even mass for the parts, no other one does."""
    p, names = problem.parameters.defaults, problem.relaxable()
    budgets: tuple[Relaxed, ...] = ("mass", "volume")
    short = [name for name in budgets if p.get(f"limit.{name}", np.inf) < problem.option.least(name)]
    if not short:
        return names
    return short if len(short) == 1 else []


def _obstacle(problem: Problem, name: Relaxed, moved: Solution) -> Obstacle:
    p = problem.parameters
    key = name if name == "torque" else f"limit.{name}"
    return Obstacle(name, p.defaults[key], problem.limit(name, moved), p.units[key])
