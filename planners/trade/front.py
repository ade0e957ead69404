"""The Pareto front: a study solved again over amounts of mass, volume, torque or time."""

from __future__ import annotations

from dataclasses import dataclass

from lptn.errors import InputError

from .parts import Sweep
from .problem import Problem
from .program import Solution
from .study import GOALS, Option, Study

_BUDGETS = ("mass", "volume")
_BETTER = 1e-4  # relative; a point that is better by less adds nothing to a front


@dataclass(frozen=True)
class FrontPoint:
    """The best value at one amount of what was swept, and by which choice."""

    amount: float
    value: float
    option: str
    capacity: float | None
    resistance: float | None
    mass: float
    volume: float


def front_of(each: dict[str, tuple[FrontPoint, ...]], study: Study, sweep: Sweep) -> tuple[FrontPoint, ...]:
    """The points that no other beats in both the amount and the goal."""
    sign = 1.0 if GOALS[study.goal][2] else -1.0
    cheap_first = 1.0 if sweep.against in _BUDGETS else -1.0
    points = [point for points in each.values() for point in points]
    front: list[FrontPoint] = []
    for point in sorted(points, key=lambda point: (cheap_first * point.amount, -sign * point.value)):
        if not front or sign * (point.value - front[-1].value) > _BETTER * abs(front[-1].value):
            front.append(point)
    return tuple(sorted(front, key=lambda point: point.amount))


def _easiest_first(sweep: Sweep) -> tuple[float, ...]:
    """More mass or volume allows more; more torque or time asks for more."""
    return sweep.values[::-1] if sweep.against in _BUDGETS else sweep.values


def sweep_points(problem: Problem, near: Solution | None, sweep: Sweep) -> tuple[FrontPoint, ...]:
    """One option's answers, up to the first amount that is too hard: all that follow are harder."""
    points = []
    for amount in _easiest_first(sweep):
        if sweep.against in _BUDGETS and amount < problem.option.least(sweep.against):
            break
        found = problem.solve({swept_parameter(problem, sweep.against): amount}, near=near)
        if not found.success:
            break
        near = found
        points.append(_point(problem.option, sweep.against, amount, found))
    by_amount = {round(point.amount, 6 if sweep.against == "mass" else 9): point for point in points}
    return tuple(sorted(by_amount.values(), key=lambda point: point.amount))


def swept_parameter(problem: Problem, against: str) -> str:
    """The parameter that a sweep moves; a limit that the study left open is a mistake of the study."""
    name = f"limit.{against}" if against in _BUDGETS else against
    if name not in problem.parameters.symbols:
        origin = problem.option.study.origin
        raise InputError(origin, "pareto.against", f'"{against}" without a limit', f"limits.{against} = …, to be swept")
    return name


def _point(option: Option, against: str, amount: float, found: Solution) -> FrontPoint:
    values = found.variables
    amount = values[against] if against in _BUDGETS else amount  # a design need not use up its budget
    capacity, resistance = (values[name] if option.has_sink else None for name in ("capacity", "resistance"))
    return FrontPoint(amount, found.objective, option.name, capacity, resistance, values["mass"], values["volume"])
