"""Pages on plans and cooling studies: the answer in words, and its lines and Pareto front to zoom and hover."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.lines import thinned, time_unit
from lptn.basics.style import inline_svg
from lptn.planners.limiter.task import LimitAnswer
from lptn.planners.mission.answer import MissionPlan
from lptn.planners.mpc.answer import TrackAnswer
from lptn.planners.tasks import Answer
from lptn.planners.trade.answer import FrontPoint, StudyResult, headline, remarks, table
from lptn.planners.trade.figures import RPM, axis_of, duration_words, front_lines, number_of, study_figure
from lptn.report.charts import POINTS, ChartPanel, Charts, Line, View
from lptn.report.document import Picture, render
from lptn.report.tables import ReportTable
from lptn.report.text import for_people, unit_text

_TEMPERATURE = ChartPanel(
    "temperature [°C]", "°C", (Line("temperature", "temperature", "given"), Line("limit", "limit", "limit")), 210
)


def plan_html(answer: Answer, title: str) -> str:
    """One self-contained HTML page on the answer to a task of `lptn plan`.

    Args:
        answer: of any kind of task.
        title: heads the page.

    Returns:
        HTML text, with all joints to look through.
    """
    charts, lines = _charts_of(answer), [for_people(line) for line in answer.text().splitlines() if line]
    what = f"The plan in one figure{'; on screen all joints, one at a time' if charts else ''}."
    return render(
        "planning.html.j2",
        title=title,
        said=[line for line in lines if not _is_row(line)],
        rows=[line for line in lines if _is_row(line)],
        charts=[charts.html("plan")] if charts else [],
        headings=["Over time" if not isinstance(answer, LimitAnswer) else "Admissible load by its duration"],
        still=Picture(what, inline_svg(answer.figure(), title)),
    )


def _is_row(line: str) -> bool:
    """Whether a line is one of a table, whose cells stand apart; such lines are never broken."""
    return "  " in line.strip()


def _charts_of(answer: Answer) -> Charts | None:
    """What can be looked through; `None` for kinds of task that are not ours."""
    if isinstance(answer, TrackAnswer):
        return _track(answer)
    if isinstance(answer, MissionPlan):
        return _mission(answer)
    return _limit(answer) if isinstance(answer, LimitAnswer) else None


def _track(answer: TrackAnswer) -> Charts:
    task, heat = answer.task, answer.task.heating
    ends = task.period * np.arange(len(task.asked) + 1, dtype=float)
    nodes = list(heat.model.places)
    lines: dict[str, dict[str, FloatArray]] = {name: {} for name in [*heat.joints, *nodes]}
    for number, name in enumerate(heat.joints):
        for key, column in (("requested", np.abs(task.asked)), ("admitted", np.abs(answer.admitted))):
            lines[name][key] = np.append(column[:, number], np.nan)
    for row, name in enumerate(nodes):
        lines[name] |= {"temperature": answer.temperatures[row]} | _limit_line(answer.limits, name, ends)
    unit = unit_text(heat.unit)
    asked = Line("requested", "requested", "measured", steps=True), Line("admitted", "admitted", "best", steps=True)
    return _over_time(ends, lines, (ChartPanel(f"{heat.request} [{unit}]", unit, asked, 170), _TEMPERATURE), "joint")


def _mission(plan: MissionPlan) -> Charts:
    time = np.asarray(plan.course.time, dtype=float)
    piece = np.clip(np.searchsorted(np.cumsum(plan.time), time, side="right"), 0, max(len(plan.time) - 1, 0))
    common = {"speed": plan.speed[piece], "load": plan.load[piece]} if plan.time.size else {}
    lines = {
        node: {"temperature": plan.course.states[row], **_limit_line(plan.mission.limits, node, time), **common}
        for row, node in enumerate(plan.mission.model.places)
    }
    speed = ChartPanel("speed [m/s]", "m/s", (Line("speed", "speed", "measured", steps=True),), 110, zero=True)
    load = ChartPanel("load [kg]", "kg", (Line("load", "load", "given", steps=True),), 100, zero=True)
    return _over_time(time, lines, (_TEMPERATURE, speed, load), "node")


def _over_time(
    time: FloatArray, lines: Mapping[str, Mapping[str, FloatArray]], panels: tuple[ChartPanel, ...], choice: str
) -> Charts:
    """Lines over time [s], a view for each place, which the reader chooses."""
    unit, label = time_unit(float(time[-1]) if time.size else 0.0)
    values, views = {}, []
    for name, own in lines.items():
        at, thin = thinned(time, np.array(list(own.values())), POINTS)
        values[name] = at / unit
        views.append(View((name,), name, name, dict(zip(own, thin, strict=True))))
    return Charts(label, panels, views, values, {choice: list(lines)})


def _limit(answer: LimitAnswer) -> Charts | None:
    limiter = answer.limiter
    horizons = np.array(limiter.horizons, dtype=float)
    finite = np.isfinite(horizons)
    if finite.sum() < 2:
        return None
    unit = unit_text(limiter.heating.unit)
    views = []
    for number, joint in enumerate(limiter.joints):
        admissible = np.where(np.isfinite(answer.admissible[number]), answer.admissible[number], np.nan)[finite]
        lines = {"admissible": admissible, "load": np.full(int(finite.sum()), answer.load[number])}
        views.append(View((joint,), joint, "horizon", lines))
    shown = Line("admissible", "admissible", "best", dots=True), Line("load", "load now", "measured")
    panel = ChartPanel(f"admissible {limiter.heating.request} [{unit}]", unit, shown, 240, zero=True)
    return Charts("duration [s]", (panel,), views, {"horizon": horizons[finite]}, {"joint": list(limiter.joints)}, True)


def _limit_line(limits: Mapping[str, float], name: str, time: FloatArray) -> dict[str, FloatArray]:
    return {"limit": np.full(time.size, limits[name])} if name in limits else {}


# --- cooling studies ------------------------------------------------------------------------------------------


def trade_html(result: StudyResult) -> str:
    """One self-contained HTML page on a cooling trade study.

    Args:
        result: of `lptn.planners.trade.solve_study`; something in it must be feasible.

    Returns:
        HTML text, with the Pareto front and the times to the limit to hover.
    """
    heads, *rows = table(result)
    charts = {"Time to the limit": _curves(result).html("curves")}
    if result.front:
        charts = {"Pareto front: the best choice at each amount": _front(result).html("front")} | charts
    if result.torque_speed:
        charts["How long each torque can be held at each speed"] = _torque_speed(result).html("torque-speed")
    return render(
        "planning.html.j2",
        title=result.study.question.name,
        said=[for_people(line) for line in remarks(result)],
        rows=[],
        lead=for_people(headline(result).removeprefix(f"{result.study.question.name}: ")),
        table=ReportTable(tuple(for_people(head) for head in heads), tuple(rows)),
        charts=list(charts.values()),
        headings=list(charts),
        still=Picture("The study in one figure.", inline_svg(study_figure(result), result.study.question.name)),
    )


def _front(result: StudyResult) -> Charts:
    assert result.study.sweep is not None  # a front comes from a sweep
    factor, label = axis_of(result.study.sweep.against, result.study)
    scale, goal = axis_of(result.study.question.goal, result.study)
    every = front_lines(result)
    amounts = np.unique([point.amount for points in [*every.values(), result.front] for point in points])
    shown: dict[str, FloatArray] = {}
    panels: list[ChartPanel] = []
    drawn: list[tuple[str, str, int, Callable[[FrontPoint], float]]] = [
        (goal, goal.partition("[")[2].rstrip("]"), 380, lambda point: scale * point.value)
    ]
    if any(gear.is_sought for gear in result.study.gears):  # below the goal, what the designs are
        drawn.append(("gear ratio", "", 120, lambda point: point.ratio))
    if result.with_sink is not None:
        drawn.append(("C [J/K]", "J/K", 120, lambda point: np.nan if point.capacity is None else point.capacity))
        drawn.append(("R_h [K/W]", "K/W", 120, lambda point: np.nan if point.resistance is None else point.resistance))
    for label_up, unit, height, value in drawn:
        lines = []
        for name, points in [*every.items(), *([("", result.front)] if result.study.sweep.also is None else [])]:
            key = f"{label_up}, {name}"
            shown[key] = np.full(amounts.size, np.nan)
            shown[key][np.searchsorted(amounts, [point.amount for point in points])] = [
                value(point) for point in points
            ]
            if name:
                lines.append(Line(key, name, colour=number_of(result, name), dots=True))
            elif not panels:  # the design of the front is that of its choice
                lines.append(Line(key, "Pareto front", "points"))
        panels.append(ChartPanel(label_up, unit, tuple(lines), height))
    view = View(("",), "", "amount", shown)
    return Charts(label, tuple(panels), [view], {"amount": factor * amounts})


def _torque_speed(result: StudyResult) -> Charts:
    diagrams = result.torque_speed
    durations = [duration_words(duration) for duration in diagrams[0].durations.tolist()]
    drawn = tuple(Line(words, words, colour=number) for number, words in enumerate(durations))
    views = [
        View((diagram.name,), diagram.name, diagram.name, dict(zip(durations, diagram.torque, strict=True)))
        for diagram in diagrams
    ]
    across = {diagram.name: RPM * diagram.speed for diagram in diagrams}
    panel = ChartPanel("torque held [N·m]", "N·m", drawn, 380, zero=True)
    return Charts("speed [rpm]", (panel,), views, across, {"choice": list(across)})


def _curves(result: StudyResult) -> Charts:
    currents = result.curves[0].current
    shown = {
        curve.name: np.where(np.isfinite(curve.time), curve.time, np.nan)
        for curve in result.curves
        if curve.name in result.drawn
    }
    drawn = tuple(Line(name, name, colour=number_of(result, name)) for name in shown)
    panel = ChartPanel(f"time to {result.curves[0].limit:.0f} °C [s]", "s", drawn, 320, log=True)
    return Charts("constant current [A]", (panel,), [View(("",), "", "current", shown)], {"current": currents})
