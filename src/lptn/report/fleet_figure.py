"""A fleet on one page: the parameters in which robots differ, over their days."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lptn.basics import style
from lptn.fleet import Fleet, FleetParameter
from lptn.report.text import unit_text

_MOST, _NAMED = 6, 5  # panels on a page; robots with a colour and a name in each
_FRAME, _PANEL = 0.4, 3.0  # inch


def fleet_figure(fleet: Fleet) -> Figure:
    """Up to six parameters, those first in which a robot stands apart or drifts; the others that differ most.

    Args:
        fleet: with one parameter at least.
    """
    told = [deviation.of for deviation in fleet.deviations]
    rest = sorted(fleet.parameters, key=lambda one: -(one.scatter or 0.0))
    shown = list({one.name: one for one in [*told, *rest]}.values())[:_MOST]
    columns = min(len(shown), 2)
    rows = -(-len(shown) // columns)
    figure = style.new_figure(_FRAME + _PANEL * rows)
    for k, parameter in enumerate(shown, start=1):
        _draw(figure.add_subplot(rows, columns, k), fleet, parameter)
    robots = len({robot.of for robot in fleet.robots.values()})
    title = f"{robots} robots: those that stand apart or drift in colour"
    figure.suptitle(title, x=0.01, ha="left", size=style.TEXT)
    return figure


def _draw(ax: Axes, fleet: Fleet, parameter: FleetParameter) -> None:
    """One parameter: each robot's fits over the days, or beside each other; the fleet's mean and scatter behind."""
    named = [one.robot for one in fleet.deviations if one.of.name == parameter.name][:_NAMED]
    days = {robot.day for robot in fleet.robots.values() if robot.day}
    places: dict[str, Any] = {name: k for k, name in enumerate(parameter.robots)}
    if parameter.scatter is not None:
        low, high = (parameter.value(parameter.mean + sign * 2 * parameter.scatter) for sign in (-1, 1))
        ax.axhspan(low, high, color=style.SHADE, linewidth=0, label="95 % of robots, last day")
    courses: dict[str, list[tuple[Any, float, float]]] = {}
    for outcome in fleet.fitted:
        own = fleet.robots[outcome.robot]
        said = outcome.parameters.get(parameter.name) or {"value": outcome.rmse, "error": 0.0}
        if said["error"] is not None and own.of in places:
            at = (own.day or max(days)) if len(days) > 1 else places[own.of]
            courses.setdefault(own.of, []).append((at, said["value"], said["error"]))
    for robot, course in sorted(courses.items(), key=lambda item: item[0] in named):
        look: dict[str, Any] = {"linewidth": 0.5, "color": style.FAINT, "alpha": 0.6}
        if robot in named:
            look = {"linewidth": 1.5, "color": style.PALETTE[named.index(robot)], "label": style.plain(robot)}
        days_of, values, errors = zip(*course, strict=True)
        ax.errorbar(np.array(days_of), values, errors, marker=".", elinewidth=0.5, **look)
    seen = [value for course in courses.values() for _, value, _ in course]
    if not parameter.size and max(seen) > 10 * min(seen):  # else its ticks are few and say less
        ax.set_yscale("log")
    ax.set_title(style.plain(parameter.name), loc="left", size=style.TEXT)
    ax.set_ylabel(unit_text(parameter.unit), size=style.SMALL)
    style.dress(ax)
    if len(days) > 1:
        ax.tick_params(axis="x", rotation=30)
    else:
        ax.set_xlabel("robot, in order of names", size=style.SMALL)
    if ax.get_legend_handles_labels()[1]:
        ax.legend(frameon=False, fontsize=style.SMALL)
