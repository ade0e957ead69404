"""A study's answer for people (lines on the terminal) and for programs (JSON)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict

from .answer import StudyResult
from .designs import Design
from .maps import IsoMap, LimitCurve
from .study import GOALS

_AGREES = 0.5  # K between the program's few elements and a fine simulation
_COUNTS = 1e-4  # relative sensitivities below this are solver dust
_SHOWN = 6  # sensitivities that a person is shown
_NOT_A_NUMBER_OF_THE_DESIGN = ("least.", "most.", "weight", "longest", "copper_loss.torque_constant")


def as_json(result: StudyResult) -> dict[str, object]:
    """The whole answer; units are in the names' documentation, all SI and degC."""
    words, unit, more = GOALS[result.study.goal]
    return {
        "study": result.study.name,
        "goal": {"name": result.study.goal, "words": words, "unit": unit, "more_is_better": more},
        "best": result.designs[0].option.name if result.designs else None,
        "designs": [_design(design) for design in result.designs],
        "refused": [
            {
                "option": refusal.option.name,
                "obstacles": [asdict(each) for each in refusal.obstacles],
                "together": [asdict(each) for each in refusal.together],
            }
            for refusal in result.refusals
        ],
        "pareto": {
            "against": result.study.sweep.against if result.study.sweep else None,
            "front": [asdict(point) for point in result.front],
            "options": {name: [asdict(point) for point in points] for name, points in result.each.items()},
        },
        "time_to_limit": [_curve(curve) for curve in result.curves],
        "map": _map(result.iso_map),
    }


def _curve(curve: LimitCurve) -> dict[str, object]:
    """Time to the limit [s] over constant current [A]; null where it is never reached."""
    current, time = curve.current.tolist(), curve.time.tolist()
    return {"option": curve.name, "limit": curve.limit, "current": current, "time": time}


def _map(found: IsoMap | None) -> dict[str, object] | None:
    """Winding temperature over (C, R) for the best choice with a sink; `winding[i][j]` at resistance i, capacity j."""
    if found is None:
        return None
    axes = {"capacity": found.capacity.tolist(), "resistance": found.resistance.tolist()}
    return {"option": found.option.name, "torque": found.torque, **axes, "winding": found.winding.tolist()}


def _design(design: Design) -> dict[str, object]:
    names = ("value", "capacity", "resistance", "mass", "volume", "torque", "duration", "winding", "current", "checked")
    return {
        "option": design.option.name,
        "motor": design.option.motor.name,
        "cooling": design.option.cooling,
        "pipes": design.option.pipes,
        **{name: getattr(design, name) for name in names},
        "fan_power": design.option.study.fan.power if design.option.cooling == "fan" else 0.0,
        "binding": list(design.binding),
        "degenerate": design.degenerate,
        "sensitivities": design.prices,
        "of_sink": design.of_sink,
    }


def lines(result: StudyResult) -> Iterable[str]:
    """What the command prints."""
    words, unit, more = GOALS[result.study.goal]
    yield f"{result.study.name}: {'most' if more else 'least'} {words}, best choice first"
    header = (
        "choice",
        f"{words} [{unit}]",
        "C [J/K]",
        "R [K/W]",
        "mass [g]",
        "volume [cm3]",
        "winding [degC]",
        "touches",
    )
    rows = [header, *(_row(design) for design in result.designs)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(header))]
    for row in rows:
        yield "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip()
    for design in result.designs:
        if abs(design.checked - design.winding) > _AGREES:
            yield f"{design.option.name}: mind that a fine simulation of it reaches {design.checked:.1f} degC"
        if design.degenerate:
            yield f"{design.option.name}: mind that it touches more than can move; its multipliers are not unique"
    for refusal in result.refusals:
        yield f"{refusal.option.name}: no feasible design; it would need {refusal}"
    if result.designs:
        yield from _sensitivities(result.designs[0], words, unit)
        yield from _of_sink(result, unit)
    if result.front:
        first, last = result.front[0], result.front[-1]
        against = result.study.sweep.against if result.study.sweep else ""
        ends = " to ".join(f"{point.value:.4g} {unit} ({point.option})" for point in (first, last))
        yield f"Pareto front over {against}: {len(result.front)} points, {ends}"


def _row(design: Design) -> tuple[str, ...]:
    return (
        design.option.name,
        f"{design.value:.4g}",
        _text(design.capacity),
        _text(design.resistance),
        f"{1e3 * design.mass:.0f}",
        f"{1e6 * design.volume:.0f}",
        f"{design.winding:.1f}",
        ", ".join(design.binding) or "nothing",
    )


def _text(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def strongest(design: Design, most: int = _SHOWN) -> list[tuple[str, float, float]]:
    """Parameters to which the goal answers most: name, derivative, share of the goal per share of the parameter.

    A temperature has no natural zero: 1 K stands for 1 % of it.
    """
    found = []
    for name, slope in design.prices.items():
        if name.startswith(_NOT_A_NUMBER_OF_THE_DESIGN):
            continue
        value, unit = design.parameters[name]
        relative = slope * (100.0 if unit == "degC" else value) / design.value if design.value else 0.0
        if abs(relative) > _COUNTS:
            found.append((name, slope, relative))
    return sorted(found, key=lambda each: -abs(each[2]))[:most]


def _sensitivities(design: Design, words: str, unit: str) -> Iterable[str]:
    yield f"What {words} answers to, {design.option.name}, the design following:"
    for name, slope, relative in strongest(design):
        value, its_unit = design.parameters[name]
        step = "K" if its_unit == "degC" else "%"
        yield f"  {name} {value:.4g} {its_unit}: {slope:+.4g} {unit} per {its_unit} ({relative:+.2f} % per {step})"


def _of_sink(result: StudyResult, unit: str) -> Iterable[str]:
    for design in result.designs:
        if design.of_sink:
            gram, resistance = design.of_sink["mass"] / 1e3, design.of_sink["resistance"]
            kept = "the sink as it is"
            yield f"  {design.option.name}, {kept}: {gram:+.3g} {unit} per g of slab, {resistance:+.3g} {unit} per K/W"
