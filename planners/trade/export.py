"""A study's answer for people (lines on the terminal) and for programs (JSON)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict

import numpy as np

from lptn.basics.words import few, listed

from .answer import StudyResult
from .designs import Design
from .uncertainty import Interval

_NOT_OF_THE_DESIGN = ("least.", "most.", "weight", "longest", "copper_loss.torque_constant")


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
        if design.degenerate:
            why = "more constraints are active than it has freedom"
            yield f"{design.option.name}: caution, {why}; its sensitivities are not unique"


def _front_ends(result: StudyResult) -> Iterator[str]:
    unit = result.study.goal[1]
    if result.front:
        first, last = result.front[0], result.front[-1]
        against = result.study.sweep.against if result.study.sweep else ""
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
    sensitivities = []
    for name, slope in design.sensitivities.items():
        if name.startswith(_NOT_OF_THE_DESIGN):
            continue
        value, unit = design.parameters[name]
        relative = slope * (100.0 if unit == "degC" else value) / design.value if design.value else 0.0
        if abs(relative) > least:
            sensitivities.append((name, slope, relative))
    return sorted(sensitivities, key=lambda sensitivity: -abs(sensitivity[2]))[:most]
