"""A study answered: each choice solved to optimality or refused with its obstacle; best design and Pareto front."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from lptn.basics.errors import InputError

from .designs import Design, IsoMap, LimitCurve, TorqueSpeed, design_of, iso_map, limit_curves, torque_speed
from .problem import DesignNumbers, DesignProblem, DesignSolution, Refusal
from .study import BUDGETS, SWEPT, Sweep, TradeStudy
from .uncertainty import Interval, intervals

Report = Callable[[str], None]


@dataclass(frozen=True)
class FrontPoint(DesignNumbers):
    """The best design at one amount of what was swept, and by which choice."""

    amount: float
    option: str


@dataclass(frozen=True, repr=False)
class StudyResult:
    """Answers for every discrete choice.

    Args:
        study: as asked.
        designs: the feasible ones, best first.
        refusals: the others.
        front: the best value over what was swept; empty without a sweep. Points that are no better than a cheaper
            one are left out.
        by_option: for every option by name its points of the sweep.
        intervals: of the goal under what is not known, for every feasible option by name; empty where all is known.
    """

    study: TradeStudy
    designs: tuple[Design, ...]
    refusals: tuple[Refusal, ...]
    front: tuple[FrontPoint, ...] = ()
    by_option: dict[str, tuple[FrontPoint, ...]] = field(default_factory=dict)
    intervals: dict[str, Interval] = field(default_factory=dict)

    def __repr__(self) -> str:
        counts = f"{len(self.designs)} of {len(self.designs) + len(self.refusals)} choices feasible"
        if not self.designs:
            return f"<StudyResult: {counts}>"
        words, unit, _ = self.study.goal
        return f"<StudyResult: {counts}, best {self.best.option.name}, {words} {self.best.value:.4g} {unit}>"

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
        """Time to the limit over constant current for each design, best first, up to a third above the most current.

        That is 40 A where nothing limits the current.
        """
        most = max(design.option.limits.get("current", 40.0) for design in self.designs)
        currents = np.linspace(most / 12, 1.3 * most, 45)
        return tuple(limit_curves(design, currents) for design in self.designs)

    @cached_property
    def torque_speed(self) -> tuple[TorqueSpeed, ...]:
        """How long the six best designs hold each torque at each speed, in some seconds for each.

        Empty without a limit of voltage or speed.
        """
        drawn = [design for design in self.designs if {"voltage", "speed"} & {*design.option.limits}]
        return tuple(torque_speed(design) for design in drawn[:6])

    @cached_property
    def iso_map(self) -> IsoMap | None:
        """Temperature over (C, R) for the best design with a sink, `None` where none has one."""
        design = self.with_sink
        return None if design is None else iso_map(design)

    @cached_property
    def drawn(self) -> tuple[str, ...]:
        """Names of the choices in figures: the best one, the best one with a sink, the front's, the next best.

        Six at most, which a reader tells apart in one diagram.
        """
        best = [design.option.name for design in self.designs]
        sunk = [] if self.with_sink is None else [self.with_sink.option.name]
        return tuple(dict.fromkeys([*best[:1], *sunk, *(point.option for point in self.front), *best]))[:6]

    @property
    def with_sink(self) -> Design | None:
        """The best design with a sink."""
        return next((design for design in self.designs if design.option.has_sink), None)

    def infeasible(self) -> InputError:
        """One line for a study without any feasible design."""
        refusal = min(self.refusals, key=lambda refusal: refusal.distance)
        expected = f"another limit, the nearest for {refusal.option.name}: {refusal}"
        return InputError(self.study.origin, "limits", "no feasible design", expected)


def solve_study(study: TradeStudy, report: Report = lambda _: None) -> StudyResult:
    """Enumerate the discrete choices, solve each, refuse what can't be, sweep.

    Args:
        study: what is asked.
        report: called with what is being done.

    Raises:
        InputError: a motor's network can't be driven, or lacks what a sink needs.
    """
    solved: list[tuple[DesignProblem, Design]] = []
    refusals: list[Refusal] = []
    tried: list[tuple[DesignProblem, DesignSolution]] = []
    for option in study.options():
        report(f"solving {option.name}")
        problem = DesignProblem(option)
        solution = problem.solve()
        tried.append((problem, solution))
        if solution.success:
            solved.append((problem, design_of(problem, solution)))
        else:
            refusals.append(problem.refusal())
    better = study.goal[2]
    solved.sort(key=lambda pair: (-pair[1].value if better else pair[1].value, pair[1].mass))
    designs = tuple(design for _, design in solved)
    result = StudyResult(study, designs, tuple(refusals), intervals=intervals(study, solved, report))
    if study.sweep is None:
        return result
    by_option: dict[str, tuple[FrontPoint, ...]] = {}
    for problem, near in tried:
        report(f"sweeping {study.sweep.against} for {problem.option.name}")
        by_option[problem.option.name] = _sweep_points(problem, near, study.sweep)
    points = [point for points in by_option.values() for point in points]
    return replace(result, front=_front_of(points, better, SWEPT[study.sweep.against].eases), by_option=by_option)


def _front_of(points: list[FrontPoint], more_is_better: bool, cheap_first: int) -> tuple[FrontPoint, ...]:
    """The points that no other beats in both the amount and the goal; the best of each amount that costs nothing.

    A point that is better by less than 1e-4 adds nothing.
    """
    sign = 1.0 if more_is_better else -1.0
    if not cheap_first:
        best = {point.amount: point for point in sorted(points, key=lambda point: sign * point.value)}
        return tuple(best[amount] for amount in sorted(best))
    front: list[FrontPoint] = []
    for point in sorted(points, key=lambda point: (cheap_first * point.amount, -sign * point.value)):
        if not front or sign * (point.value - front[-1].value) > 1e-4 * abs(front[-1].value):
            front.append(point)
    return tuple(sorted(front, key=lambda point: point.amount))


def _sweep_points(problem: DesignProblem, near: DesignSolution, sweep: Sweep) -> tuple[FrontPoint, ...]:
    """One option's answers; where more is harder, or less is, up to the first amount that is too hard."""
    against, study = sweep.against, problem.option.study
    parameter = {"torque": "torque", "duration": "duration", "ratio": "gear.ratio"}.get(against, f"limit.{against}")
    if parameter not in problem.parameters.symbols:
        if against == "ratio":
            return ()  # a choice without a gear, or whose ratio is sought
        expected = f"limits.{against} = …, to be swept"
        raise InputError(study.origin, "pareto.against", f'"{against}" without a limit', expected)
    points, eases = [], SWEPT[against].eases
    for amount in (sweep.values[::-1] if eases > 0 else sweep.values).tolist():
        if against in BUDGETS and amount < problem.option.least(against):
            break
        solution = problem.solve({parameter: amount}, near=near)
        if not solution.success:
            if eases:
                break
            continue
        near = solution
        if against in BUDGETS:
            amount = getattr(solution, against)  # a design need not use up its budget
        points.append(FrontPoint(**solution.numbers, amount=amount, option=problem.option.name))
    by_amount = {round(point.amount, 6 if against == "mass" else 9): point for point in points}
    return tuple(sorted(by_amount.values(), key=lambda point: point.amount))
