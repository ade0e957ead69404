"""A study answered: each discrete choice solved to optimality or refused with its obstacle; the best, the front."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from lptn.errors import InputError

from .designs import Design, Refusal, design_of, refusal_of
from .front import FrontPoint, front_of, sweep_points
from .maps import IsoMap, LimitCurve, iso_map, limit_curves
from .problem import Problem
from .program import Solution
from .study import GOALS, Study

_CURRENT = 40.0  # A; how far curves go where nothing limits the current
Report = Callable[[str], None]


@dataclass(frozen=True)
class StudyResult:
    """Answers for every discrete choice.

    Args:
        study: as asked.
        designs: the feasible ones, best first.
        refusals: the others.
        front: the best value over what was swept; empty without a sweep. Points that are no better than a cheaper
            one are left out.
        each: for every option by name its points of the sweep.
    """

    study: Study
    designs: tuple[Design, ...]
    refusals: tuple[Refusal, ...]
    front: tuple[FrontPoint, ...] = ()
    each: dict[str, tuple[FrontPoint, ...]] = field(default_factory=dict)

    @property
    def best(self) -> Design:
        """The best design.

        Raises:
            InputError: no option is feasible; says which limit of which option is nearest.
        """
        if not self.designs:
            raise self.infeasible()
        return self.designs[0]

    @cached_property
    def curves(self) -> tuple[LimitCurve, ...]:
        """Time to the limit over constant current for each design, best first, up to a third above the most current."""
        most = max(design.option.limits.get("current", _CURRENT) for design in self.designs)
        currents = np.linspace(most / 12, 1.3 * most, 45)
        return tuple(limit_curves(design, currents) for design in self.designs)

    @cached_property
    def iso_map(self) -> IsoMap | None:
        """Temperature over (C, R) for the best design with a sink, `None` where none has one."""
        design = self.with_sink
        return None if design is None else iso_map(design)

    @property
    def with_sink(self) -> Design | None:
        """The best design with a sink."""
        return next((design for design in self.designs if design.option.has_sink), None)

    def infeasible(self) -> InputError:
        """One line for a study without any feasible design."""
        refusal = min(self.refusals, key=lambda each: each.distance)
        expected = f"another limit, the nearest for {refusal.option.name}: {refusal}"
        return InputError(self.study.origin, "limits", "no feasible design", expected)


def solve_study(study: Study, report: Report = lambda _: None) -> StudyResult:
    """Enumerate the discrete choices, solve each, refuse what can't be, sweep.

    Args:
        study: what is asked.
        report: told what is being done.

    Raises:
        InputError: a motor's network can't be driven, or lacks what a sink needs.
    """
    designs: list[Design] = []
    refusals: list[Refusal] = []
    problems: list[tuple[Problem, Solution | None]] = []
    for option in study.options():
        report(f"solving {option.name}")
        problem = Problem(option)
        found = problem.solve()
        if found.success:
            designs.append(design_of(problem, found))
            problems.append((problem, found))
        else:
            refusals.append(refusal_of(problem))
            problems.append((problem, None))
    better = GOALS[study.goal][2]
    designs.sort(key=lambda each: (-each.value if better else each.value, each.mass))
    result = StudyResult(study, tuple(designs), tuple(refusals))
    return result if study.sweep is None else _swept(result, problems, report)


def _swept(result: StudyResult, problems: list[tuple[Problem, Solution | None]], report: Report) -> StudyResult:
    sweep = result.study.sweep
    assert sweep is not None
    each: dict[str, tuple[FrontPoint, ...]] = {}
    for problem, solved in problems:
        report(f"sweeping {sweep.against} for {problem.option.name}")
        each[problem.option.name] = sweep_points(problem, solved, sweep)
    return replace(result, front=front_of(each, result.study, sweep), each=each)
