"""What is not known of a design carried to its answer: parameters drawn at random, the design held or made anew."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from lptn.basics.errors import InputError
from lptn.basics.places import matching

from .designs import Design
from .plant import CAPACITY, RESISTANCE
from .problem import DesignProblem
from .study import BUDGETS, StandardError, StudyUncertainty, TradeStudy

Key = tuple[str, str]
"""A parameter that is drawn: of which motor (empty for what all choices share), and its name."""


@dataclass(frozen=True)
class Interval:
    """The answer of one choice under what is not known.

    Args:
        low, high: ends of the interval, in the goal's unit; infinite where too many draws can't be met at all.
        feasible: share of the draws in which all limits can be kept.
        best: share of the draws in which no other choice is better.
    """

    low: float
    high: float
    feasible: float
    best: float


def intervals(
    study: TradeStudy, solved: Sequence[tuple[DesignProblem, Design]], report: Callable[[str], None] = lambda _: None
) -> dict[str, Interval]:
    """Intervals of the goal by the name of the choice.

    A design that is sought at its best (held torque, time to the limit, worst temperature) is kept as it was found,
    with its fins and its metal, and judged in each draw; where the least mass, volume or price is sought, each draw
    tells what it would take. All choices see the same draws (Sobol's sequence).

    Args:
        study: with its uncertainty.
        solved: programs of the feasible choices, and their designs.
        report: called with what is being done.

    Raises:
        InputError: a pattern that fits no parameter, or a share of a temperature.
    """
    uncertainty = study.uncertainty
    if uncertainty is None or not solved:
        return {}
    names = list(dict.fromkeys(name for problem, _ in solved for name in problem.parameters.symbols))
    for pattern in uncertainty.errors:
        if not matching(pattern, names):  # it would be an uncertainty that is silently left out
            expected = f"one of {', '.join(names)}, or a pattern of them"
            raise InputError(study.origin, f'uncertainty.errors."{pattern}"', "no such number", expected)
    errors = [_errors_of(problem, uncertainty) for problem, _ in solved]
    keys = sorted({key for parameters in errors for key in parameters})
    draws = np.zeros((uncertainty.draws, 0))
    if keys:
        # The same draws each time, so that an answer can be had again.
        draws = ndtri(qmc.Sobol(len(keys), seed=1).random(uncertainty.draws))
    worst = -np.inf if study.goal[2] else np.inf
    values = np.full((len(solved), uncertainty.draws), worst)
    for row, ((problem, design), error) in enumerate(zip(solved, errors, strict=True)):
        report(f"sampling the uncertain parameters of {design.option.name}")
        asked, near = (problem, problem.solve()) if study.question.goal in BUDGETS else design.as_built
        columns = [keys.index(key) for key in error]
        for number, draw in enumerate(draws[:, columns]):
            drawn = {name: _drawn(asked, name, of, normal)
                     for (_, name), of, normal in zip(error, error.values(), draw, strict=True)}  # fmt: skip
            solution = asked.solve(_built(asked, drawn), near=near)
            if solution.success:
                values[row, number] = solution.value
    best = values.argmax(axis=0) if worst < 0 else values.argmin(axis=0)
    ends = (1 - uncertainty.level) / 2, (1 + uncertainty.level) / 2
    result = {}
    for row, (_, design) in enumerate(solved):
        low, high = np.quantile(values[row], ends, method="nearest").tolist()
        can = np.isfinite(values[row])
        result[design.option.name] = Interval(low, high, float(can.mean()), float((can & (best == row)).mean()))
    return result


def _errors_of(problem: DesignProblem, uncertainty: StudyUncertainty) -> dict[Key, StandardError]:
    """Standard errors of a program's parameters, and whether each is relative; a fit's unless the study says."""
    motor, names = problem.option.motor, list(problem.parameters.symbols)
    errors = {name: StandardError(error, False) for name, error in motor.standard_errors.items() if name in names}
    for pattern, error in uncertainty.errors.items():
        for name in matching(pattern, names):
            if error.is_relative and problem.parameters.units[name] == "degC":
                place, found = f'uncertainty.errors."{pattern}"', f"{error.size:g} of {name}, a temperature"
                raise InputError(problem.option.study.origin, place, found, '{ value = …, unit = "K" }')
            errors[name] = error
    own = {parameter.name for parameter in problem.plant.model.parameters}
    return {(motor.name if name in own else "", name): error for name, error in errors.items() if error.size > 0}


def _drawn(problem: DesignProblem, name: str, error: StandardError, normal: float) -> float:
    """A parameter as it is in one draw: what is positive by its nature is lognormal with its value as the median."""
    value, (size, relative) = problem.parameters.defaults[name], error
    if problem.parameters.units[name] == "degC" or value <= 0:
        return value + normal * size * (abs(value) if relative else 1.0)
    share = size if relative else size / value
    return value * float(np.exp(normal * np.sqrt(np.log1p(share**2))))


def _built(problem: DesignProblem, drawn: dict[str, float]) -> dict[str, float]:
    """The draw, and what it does to a sink whose fins and metal are given rather than its resistance and capacity."""
    given, now = problem.parameters.defaults, problem.parameters.defaults | drawn
    if RESISTANCE not in given:
        return drawn
    film, heat, density = (now[name] / given[name] for name in ("film", "specific_heat", "density"))
    return drawn | {RESISTANCE: now[RESISTANCE] / film, CAPACITY: now[CAPACITY] * heat * density}
