"""A feasible choice at its best, and its sensitivities; or a refused choice and the limits in its way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lptn.basics.arrays import FloatArray

from .plant import CAPACITY, RESISTANCE
from .problem import DesignNumbers, DesignProblem, DesignSolution
from .simulation import check_design
from .study import Option
from .tables import BUDGETS


@dataclass(frozen=True, repr=False)
class Design(DesignNumbers):
    """A feasible choice at its best: its numbers, and further.

    Args:
        option: the discrete choice, its gear's ratio as it was found.
        winding: the highest winding temperature [degC].
        current: the highest current [A].
        binding: names of the active constraints.
        parameters: value and unit of every number of the program, by name.
        sensitivities: derivative of the goal to every parameter, by name, in the goal's unit per the parameter's, the
            design re-optimised; Lagrange multipliers of the converged program.
        checked: the highest winding temperature in a fine simulation of the same design [degC].
        times, states: the course [s], [degC].
    """

    option: Option
    winding: float
    current: float
    binding: tuple[str, ...]
    parameters: dict[str, tuple[float, str]]
    sensitivities: dict[str, float]
    checked: float
    times: FloatArray
    states: FloatArray

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
        gradient = self.as_built[1].gradient
        if not gradient:
            return {}
        per_mass = gradient[CAPACITY] * self.option.metal.specific_heat
        return {"capacity": gradient[CAPACITY], "mass": per_mass, "resistance": gradient[RESISTANCE]}

    @property
    def degenerate(self) -> bool:
        """Whether more constraints are active than the design has freedom: then its sensitivities are not unique."""
        study = self.option.study
        sought = study.question.goal in ("held_torque", "time_to_limit", "worst_temperature")
        active = len(self.binding) + (study.question.goal == "worst_temperature")
        return active > 2 * self.option.has_sink + sought + ("most.ratio" in self.parameters)


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


def design_of(problem: DesignProblem, solution: DesignSolution) -> Design:
    """A converged solution as a design, with its sensitivities."""
    gear = problem.option.gear.model_copy(update={"ratio": [solution.ratio] * 2})
    option = replace(problem.option, gear=gear)
    winding = [problem.plant.states.index(node) for node in option.motor.winding_nodes]
    hottest, current = check_design(option, solution)
    return Design(
        **solution.numbers,
        option=option,
        winding=float(solution.states[winding].max()),
        current=current,
        binding=solution.binding,
        parameters={
            name: (value, problem.parameters.units[name]) for name, value in problem.parameters.defaults.items()
        },
        sensitivities=solution.gradient,
        checked=hottest,
        times=solution.times,
        states=solution.states,
    )


def refusal_of(problem: DesignProblem) -> Refusal:
    """Each limit that would make an infeasible problem feasible if it alone were moved; else several together."""
    given, units, names = problem.parameters.defaults, problem.parameters.units, problem.relaxable()

    def obstacles(relaxed: list[str]) -> list[Obstacle]:
        """These limits where the least relaxation moves them; none where it does not help."""
        moved = problem.solve(relax=relaxed)
        keys = {name: name if name == "torque" else f"limit.{name}" for name in relaxed if moved.success}
        signs = {"torque": -1.0}  # less torque is easier, more of a limit
        return [
            Obstacle(name, given[key], given[key] + signs.get(name, 1.0) * moved.slack[name], units[key])
            for name, key in keys.items()
        ]

    # Where there is not even mass for the parts, no other limit could help alone.
    short = [name for name in BUDGETS if given.get(f"limit.{name}", np.inf) < problem.option.least(name)]
    alone = names if not short else short if len(short) == 1 else []
    single = [obstacle for name in alone for obstacle in obstacles([name])]
    single.sort(key=lambda obstacle: obstacle.move)
    together = [] if single else [obstacle for obstacle in obstacles(names) if obstacle.move > 1e-4]  # others stayed
    return Refusal(problem.option, tuple(single), tuple(together))
