"""A study answered: each choice solved or refused, best design and Pareto front; in lines, tables and JSON."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property

import numpy as np

from lptn.basics.errors import InputError
from lptn.basics.words import few, listed

from .designs import Design, IsoMap, LimitCurve, TorqueSpeed, design_of, iso_map, limit_curves, torque_speed
from .problem import DesignNumbers, DesignProblem, DesignSolution, Refusal
from .study import BUDGETS, SWEPT, Sweep, TradeStudy
from .uncertainty import Interval, intervals

Report = Callable[[str], None]


@dataclass(frozen=True)
class FrontPoint(DesignNumbers):
    """The best design at one amount of what was swept, or at one each of two quantities, and by which choice."""

    amount: float
    option: str
    also: float | None = None


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
        InputError: a motor's network can't be driven, lacks what a sink needs, or reads no such column of the task.
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
    columns = dict.fromkeys(column for problem, _ in tried for column in problem.plant.model.inputs)
    for unused in study.task.inputs.keys() - columns.keys():
        expected = f"one of {', '.join(columns)}"
        raise InputError(study.origin, f'task.inputs."{unused}"', "a column that no model reads", expected)
    better = study.goal[2]
    solved.sort(key=lambda pair: (-pair[1].value if better else pair[1].value, pair[1].mass))
    designs = tuple(design for _, design in solved)
    result = StudyResult(study, designs, tuple(refusals), intervals=intervals(study, solved, report))
    if study.sweep is None:
        return result
    by_option: dict[str, tuple[FrontPoint, ...]] = {}
    for problem, near in tried:
        report(f"sweeping {study.sweep.against} for {problem.option.name}")
        levels = [None] if study.sweep.also is None else study.sweep.also.values.tolist()
        by_option[problem.option.name] = tuple(
            point for level in levels for point in _sweep_points(problem, near, study.sweep, level)
        )
    points = [point for points in by_option.values() for point in points]
    return replace(result, front=_front_of(points, better, study.sweep), by_option=by_option)


def _front_of(points: list[FrontPoint], more_is_better: bool, sweep: Sweep) -> tuple[FrontPoint, ...]:
    """The points that no other beats in the amounts and in the goal; the best of each amount that costs nothing.

    A point that is better by less than 1e-4 adds nothing.
    """
    sign, eases = 1.0 if more_is_better else -1.0, [SWEPT[axis.against].eases for axis in sweep.axes]

    def dearness(point: FrontPoint) -> list[float]:
        """Of each amount, the least first; what costs nothing is like itself alone."""
        return [ease * amount if ease else amount for ease, amount in zip(eases, _amounts(point), strict=False)]

    def adds(point: FrontPoint, to: FrontPoint) -> bool:
        pairs = zip(eases, dearness(point), dearness(to), strict=True)
        cheaper = any(own < other if ease else own != other for ease, own, other in pairs)
        return cheaper or sign * (point.value - to.value) > 1e-4 * abs(to.value)

    front: list[FrontPoint] = []
    for point in sorted(points, key=lambda point: (dearness(point), -sign * point.value)):
        if all(adds(point, other) for other in front):
            front.append(point)
    return tuple(sorted(front, key=_amounts))


def _amounts(point: FrontPoint) -> list[float]:
    return [point.amount] if point.also is None else [point.amount, point.also]


def _parameter(problem: DesignProblem, against: str) -> str:
    """What a swept quantity is in the problem; empty of a choice without a gear, or whose ratio is sought."""
    name = {"torque": "torque", "duration": "duration", "ratio": "gear.ratio"}.get(against, f"limit.{against}")
    if name in problem.parameters.symbols:
        return name
    if against == "ratio":
        return ""
    expected = f"limits.{against} = …, to be swept"
    raise InputError(problem.option.study.origin, "pareto.against", f'"{against}" without a limit', expected)


def _sweep_points(
    problem: DesignProblem, near: DesignSolution, sweep: Sweep, level: float | None
) -> tuple[FrontPoint, ...]:
    """One option's answers at a level of the second quantity; where more is harder, or less is, up to the first amount
    that is too hard."""
    against, parameters = sweep.against, [_parameter(problem, axis.against) for axis in sweep.axes]
    if not all(parameters):
        return ()
    points, eases = [], SWEPT[against].eases
    for amount in (sweep.values[::-1] if eases > 0 else sweep.values).tolist():
        given = {axis.against: value for axis, value in zip(sweep.axes, (amount, level), strict=False)}
        if any(value < problem.option.least(name) for name, value in given.items() if name in BUDGETS):
            break
        solution = problem.solve(dict(zip(parameters, given.values(), strict=True)), near=near)
        if not solution.success:
            if eases:
                break
            continue
        near = solution
        if against in BUDGETS:
            amount = getattr(solution, against)  # a design need not use up its budget
        points.append(FrontPoint(**solution.numbers, amount=amount, option=problem.option.name, also=level))
    by_amount = {round(point.amount, 6 if against == "mass" else 9): point for point in points}
    return tuple(sorted(by_amount.values(), key=lambda point: point.amount))


# --- for people and for programs --------------------------------------------------------------------


def as_json(result: StudyResult) -> dict[str, object]:
    """The whole answer, all SI and degC; numbers that are not finite become null when it is written."""
    words, unit, more = result.study.goal
    grid = result.iso_map
    return {
        "study": result.study.question.name,
        "currency": result.study.question.currency,
        "goal": {"name": result.study.question.goal, "words": words, "unit": unit, "more_is_better": more},
        "best": result.designs[0].option.name if result.designs else None,
        "designs": [_design(design, result.intervals) for design in result.designs],
        "refused": [
            {
                "option": refusal.option.name,
                "obstacles": [asdict(obstacle) for obstacle in refusal.obstacles],
                "together": [asdict(obstacle) for obstacle in refusal.together],
            }
            for refusal in result.refusals
        ],
        "pareto": {
            "against": result.study.sweep.against if result.study.sweep else None,
            "also": result.study.sweep.also.against if result.study.sweep and result.study.sweep.also else None,
            "front": [asdict(point) for point in result.front],
            "options": {name: [asdict(point) for point in points] for name, points in result.by_option.items()},
        },
        "time_to_limit": [  # over constant current
            {"option": curve.name, "limit": curve.limit, **_lists(curve, "current", "time")} for curve in result.curves
        ],
        # Winding temperature over (C, R) for the best choice with a sink; `winding[i][j]` at resistance i, capacity j.
        "map": grid
        and {"option": grid.option.name, "torque": grid.torque, **_lists(grid, "capacity", "resistance", "winding")},
        # Torque [N·m] that is held for each duration [s] at each speed [rad/s]: for ever null, null for none.
        "torque_speed": [
            {"option": diagram.name, **_lists(diagram, "speed", "durations", "torque")}
            for diagram in result.torque_speed
        ],
    }


def _lists(of: object, *names: str) -> dict[str, object]:
    """Arrays by name, as JSON takes them."""
    return {name: getattr(of, name).tolist() for name in names}


def _design(design: Design, intervals: Mapping[str, Interval]) -> dict[str, object]:
    interval = intervals.get(design.option.name)
    return {
        "option": design.option.name,
        "motor": design.option.motor.name,
        "cooling": design.option.cooling,
        "pipes": design.option.pipes,
        "gear": design.option.gear.name,
        "material": design.option.material if design.option.has_sink else None,
        **design.numbers,
        **{name: getattr(design, name) for name in ("winding", "current", "checked")},
        "fan_power": design.option.study.fan.power if design.option.cooling == "fan" else 0.0,
        "binding": list(design.binding),
        "degenerate": design.degenerate,
        "sensitivities": design.sensitivities,
        "of_sink": design.sink_sensitivities,
        "interval": interval and asdict(interval),  # its ends are infinite where limits can't be kept
    }


def headline(result: StudyResult) -> str:
    """What was sought."""
    words, _, more = result.study.goal
    return f"{result.study.question.name}: {'largest' if more else 'smallest'} {words}, best choice first"


def table(result: StudyResult, *, brief: bool = False) -> list[tuple[str, ...]]:
    """A row of heads, then one for each feasible choice; `brief`: the goal and how sure it is, without the design."""
    columns = _columns(result)
    if brief:
        columns = dict(list(columns.items())[: 2 if result.study.uncertainty is None else 4])
    return [tuple(columns), *(tuple(write(design) for write in columns.values()) for design in result.designs)]


def summary(result: StudyResult) -> Iterator[str]:
    """Cautions, the best choice's limits, what was refused, the largest sensitivities and the ends of the front."""
    yield from _cautions(result)
    best = result.designs[0]
    if best.binding:
        yield f"{best.option.name}: limited by {listed(best.binding)}."
    if result.refusals:
        names = [f"'{refusal.option.name}'" for refusal in result.refusals]
        yield f"No feasible design: {few(names, 2)}."
    slopes = [f"{name} {relative:+.2g} % per {_step(best, name)}" for name, _, relative in strongest(best, 3)]
    if slopes:
        yield f"Most sensitive to: {', '.join(slopes)}."
    yield from _front_ends(result)


def remarks(result: StudyResult) -> Iterator[str]:
    """Cautions, what was refused and why, sensitivities of the best choice and of each sink, the ends of the front."""
    words, unit, _ = result.study.goal
    yield from _cautions(result)
    for refusal in result.refusals:
        yield f"{refusal.option.name}: no feasible design; it would need {refusal}"
    for best in result.designs[:1]:
        yield f"Sensitivities of {words}, {best.option.name}, the design re-optimised:"
        for name, slope, relative in strongest(best):
            value, its_unit = best.parameters[name]
            share = f"{relative:+.2f} % per {_step(best, name)}"
            yield f"  {name} {value:.4g} {its_unit}: {slope:+.4g} {unit} per {its_unit} ({share})"
    for design in result.designs:
        if design.sink_sensitivities and design.option.name in result.drawn:
            gram, resistance = design.sink_sensitivities["mass"] / 1e3, design.sink_sensitivities["resistance"]
            numbers = f"{gram:+.3g} {unit} per g of slab, {resistance:+.3g} {unit} per K/W"
            yield f"  {design.option.name}, the sink as it is: {numbers}"
    yield from _front_ends(result)


def _step(design: Design, name: str) -> str:
    """Of what a parameter's sensitivity is given as a share: a temperature has no natural zero."""
    return "K" if design.parameters[name][1] == "degC" else "%"


def _cautions(result: StudyResult) -> Iterator[str]:
    for design in result.designs:
        if abs(design.checked - design.winding) > 0.5:  # K between the program's few elements and fine steps
            yield f"{design.option.name}: caution, a simulation in fine steps reaches {design.checked:.1f} degC"
        limit = design.option.motor.limits.winding
        if limit is not None and design.winding > limit + 0.05:  # K; no more digits are shown
            yield f"{design.option.name}: caution, its data sheet allows a winding of {limit:g} degC"
        if design.degenerate:
            why = "more constraints are active than it has freedom"
            yield f"{design.option.name}: caution, {why}; its sensitivities are not unique"


def _front_ends(result: StudyResult) -> Iterator[str]:
    unit = result.study.goal[1]
    if result.front:
        first, last = result.front[0], result.front[-1]
        against = " and ".join(axis.against for axis in result.study.sweep.axes) if result.study.sweep else ""
        ends = " to ".join(f"{point.value:.4g} {unit} ({point.option})" for point in (first, last))
        yield f"Pareto front over {against}: {len(result.front)} points, {ends}"


def _columns(result: StudyResult) -> dict[str, Callable[[Design], str]]:
    """The table's columns: those that the study asks about."""
    words, unit, _ = result.study.goal
    columns: dict[str, Callable[[Design], str]] = {
        "choice": lambda design: design.option.name,
        f"{words} [{unit}]": lambda design: f"{design.value:.4g}",
    }
    if result.study.uncertainty is not None:
        level, intervals = result.study.uncertainty.level, result.intervals
        columns[f"{level:.0%} interval"] = lambda design: _range(intervals[design.option.name])
        columns["best in"] = lambda design: f"{intervals[design.option.name].best:.0%}"
    if any(gear.name for gear in result.study.gears):
        columns["ratio"] = lambda design: f"{design.ratio:.4g}"
    columns |= {"C [J/K]": lambda design: _text(design.capacity), "R [K/W]": lambda design: _text(design.resistance)}
    goal = result.study.question.goal  # which has a column already
    if goal != "mass":
        columns["mass [g]"] = lambda design: f"{1e3 * design.mass:.0f}"
    if goal != "volume":
        columns["volume [cm3]"] = lambda design: f"{1e6 * design.volume:.0f}"
    if result.study.asks_for_prices and goal != "price":
        columns[f"price [{result.study.question.currency}]"] = lambda design: f"{design.price:.4g}"
    columns["winding [degC]"] = lambda design: f"{design.winding:.1f}"
    columns["active constraints"] = lambda design: ", ".join(design.binding) or "nothing"
    return columns


def _range(interval: Interval) -> str:
    """Such as 1.5 to 1.8; none at an end where limits can't be kept."""
    low, high = (f"{end:.4g}" if np.isfinite(end) else "none" for end in (interval.low, interval.high))
    return f"{low} to {high}" + (f" ({interval.feasible:.0%} feasible)" if interval.feasible < 1 else "")


def _text(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def strongest(design: Design, most: int = 6, least: float = 1e-4) -> list[tuple[str, float, float]]:
    """Parameters to which the goal is most sensitive: name, derivative, share of the goal per share of the parameter.

    A temperature has no natural zero: 1 K stands for 1 % of it. Shares below the least are solver dust.
    """
    not_of_the_design = ("least.", "most.", "weight", "longest", "copper_loss.torque_constant")
    sensitivities = []
    for name, slope in design.sensitivities.items():
        if name.startswith(not_of_the_design):
            continue
        value, unit = design.parameters[name]
        relative = slope * (100.0 if unit == "degC" else value) / design.value if design.value else 0.0
        if abs(relative) > least:
            sensitivities.append((name, slope, relative))
    return sorted(sensitivities, key=lambda sensitivity: -abs(sensitivity[2]))[:most]
