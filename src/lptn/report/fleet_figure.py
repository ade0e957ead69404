"""A fleet on one page: the parameters in which robots differ, over their days."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from lptn.report.text import unit_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from lptn.fleet import Fleet, FleetParameter

_MOST, _NAMED = 6, 5  # panels on a page; robots with a colour and a name in each


def fleet_figure(fleet: Fleet) -> Figure:
    """Up to six parameters, those first in which a robot stands apart or drifts; the others that differ most.

    Args:
        fleet: with one parameter at least.
    """
    told = [deviation.of for deviation in fleet.deviations]
    rest = sorted(fleet.parameters, key=lambda one: -(one.scatter or 0.0))
    shown = list({one.name: one for one in [*told, *rest]}.values())[:_MOST]
    rows = -(-len(shown) // 2)
    figure = Figure(figsize=(8.3, 1 + 3.2 * rows), layout="constrained")  # A4's width, in
    for k, parameter in enumerate(shown):
        _draw(figure.add_subplot(rows, min(len(shown), 2), k + 1), fleet, parameter)
    robots = len({robot.of for robot in fleet.robots.values()})
    figure.suptitle(f"{robots} robots: those that stand apart or drift in colour", x=0.01, ha="left", fontsize=11)
    return figure


def _draw(ax: Axes, fleet: Fleet, parameter: FleetParameter) -> None:
    """One parameter: each robot's fits over the days, or beside each other; the fleet's mean and scatter behind."""
    named = [one.robot for one in fleet.deviations if one.of.name == parameter.name][:_NAMED]
    days = {robot.day for robot in fleet.robots.values() if robot.day}
    dated = len(days) > 1
    places = {name: k for k, name in enumerate(parameter.robots)}
    if parameter.scatter is not None:
        low, high = (parameter.value(parameter.mean + sign * 2 * parameter.scatter) for sign in (-1, 1))
        ax.axhspan(low, high, color="0.9", lw=0, label="95 % of robots, last day")
    courses: dict[str, list[tuple[Any, float, float]]] = {}
    for outcome in fleet.fitted:
        own = fleet.robots[outcome.robot]
        said = outcome.parameters.get(parameter.name) or {"value": outcome.rmse, "error": 0.0}
        if said["error"] is not None and own.of in places:
            at = (own.day or max(days)) if dated else places[own.of]
            courses.setdefault(own.of, []).append((at, said["value"], said["error"]))
    for robot, course in sorted(courses.items(), key=lambda item: item[0] in named):
        x, values, errors = zip(*course, strict=True)
        style: dict[str, Any] = {"lw": 0.5, "color": "0.6"} if robot not in named else {"lw": 1.5, "label": robot}
        ax.errorbar(np.array(x), values, errors, marker=".", elinewidth=0.5, **style)
    seen = [value for course in courses.values() for _, value, _ in course]
    if not parameter.size and max(seen) > 10 * min(seen):  # else its ticks are few and say less
        ax.set_yscale("log")
    ax.set_title(parameter.name, loc="left", fontsize=9)
    ax.set_ylabel(unit_text(parameter.unit))
    ax.tick_params(axis="x", rotation=30 if dated else 0, labelsize=7)
    ax.tick_params(axis="y", which="both", labelsize=7)
    if not dated:
        ax.set_xlabel("robot, in order of names", fontsize=8)
    if ax.get_legend_handles_labels()[1]:
        ax.legend(fontsize=7, framealpha=0.8, edgecolor="none")
