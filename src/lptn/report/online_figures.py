"""Figures of forecasts and monitored runs."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, isfinite
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from lptn.basics.style import (
    BEST,
    GIVEN,
    INK,
    LIMIT,
    MEASURED,
    SMALL,
    TEXT,
    decimated,
    dress,
    new_figure,
    plain,
    time_axis,
)
from lptn.online.forecasting import Forecast, NodeForecast
from lptn.online.monitoring import Monitoring, Watched

# --- The figure of a forecast: temperatures so far and to come, with the interval's fan and the limit ---


_COLUMNS = 3
_MOST = 12
_PANEL = 2.1  # inch
_LEGEND = 0.4  # inch
_BEYOND = 1.4  # times the last interval's end that is shown


def forecast_figure(found: Forecast) -> Figure:
    """Readings [°C] so far, expected temperatures with their interval, and the limit; the twelve soonest nodes."""
    soonest = sorted(found.nodes.values(), key=lambda each: (each.time_to_limit, each.low, -each.steady))[:_MOST]
    chosen = [each for each in found.nodes.values() if each in soonest]
    columns = min(_COLUMNS, len(chosen))
    rows = ceil(len(chosen) / columns)
    figure = new_figure(rows * _PANEL + _LEGEND)
    axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    span = _span(found, chosen)
    for ax, one in zip(axes.ravel(), chosen, strict=False):
        _panel(ax, found, one, span)
    for ax in axes.ravel()[len(chosen) :]:
        ax.set_visible(False)
    for ax in axes[:, 0]:
        ax.set_ylabel("temperature [°C]", size=SMALL)
    for column in range(columns):
        lowest = max(row for row in range(rows) if row * columns + column < len(chosen))
        axes[lowest, column].set_xlabel("time from now [min]", size=SMALL)
        axes[lowest, column].tick_params(labelbottom=True)
    figure.legend(handles=_legend(found), loc="outside upper center", ncols=5, fontsize=SMALL, frameon=False)
    return figure


def _span(found: Forecast, chosen: list[NodeForecast]) -> tuple[float, float]:
    """From when to when to show [s]: all that is reached with its interval, else until little moves."""
    ends = [each.high if isfinite(each.high) else 1.5 * each.time_to_limit for each in chosen if each.reaches]
    until = min(_BEYOND * max(ends), float(found.time[-1])) if ends else float(found.time[-1])
    until = max(until, 60.0)
    return max(float(found.log[0]), -until), until


def _panel(ax: Axes, found: Forecast, one: NodeForecast, span: tuple[float, float]) -> None:
    row, minutes = found.names.index(one.node), found.time / 60
    shown = found.time <= span[1] * 1.05
    past = found.log >= span[0]
    ax.fill_between(
        minutes[shown], found.low[row][shown], found.high[row][shown], color=GIVEN["color"], alpha=0.25, linewidth=0
    )
    ax.plot(found.log[past] / 60, found.measured[row][past], **MEASURED)
    ax.plot(minutes[shown], found.temperature[row][shown], **GIVEN)
    ax.axhline(one.limit, color=LIMIT, linewidth=1.2)
    ax.axvline(0.0, color="0.6", linewidth=0.8)
    if one.reaches and one.time_to_limit > 0:
        high = one.high if isfinite(one.high) else span[1] * 1.05
        ax.plot([one.low / 60, high / 60], [one.limit] * 2, color=INK, linewidth=3.0, solid_capstyle="butt")
        ax.plot([one.time_to_limit / 60], [one.limit], "o", color=INK, markersize=4)
    ax.set_xlim(span[0] / 60, span[1] / 60)
    ax.set_title(plain(f"{one.node}: {_said(one)}"), size=TEXT, loc="left", pad=3)
    ax.margins(y=0.08)
    dress(ax)


def _said(one: NodeForecast) -> str:
    if one.time_to_limit == 0:
        return "at its limit"
    if one.reaches:
        return f"{one.time_to_limit / 60:.1f} min"
    return f"never, {one.steady:.0f} °C" if isfinite(one.steady) else "never"


def _legend(found: Forecast) -> list[Line2D | Patch]:
    return [
        Line2D([], [], label="measured", **MEASURED),
        Line2D([], [], label="expected", **GIVEN),
        Patch(color=GIVEN["color"], alpha=0.25, label=f"{found.coverage:.0%} interval"),
        Line2D([], [], color=LIMIT, linewidth=1.2, label="limit"),
        Line2D([], [], color=INK, linewidth=3.0, marker="o", markersize=4, label="time to the limit, interval"),
    ]


# --- The picture of a monitored run: readings and expectation, their difference, and when each detector called ---


_MOST_PANELS = 6
_MONITOR_PANEL, _MONITOR_LEGEND = 2.9, 0.35  # inch
_LIMIT: dict[str, Any] = {"color": LIMIT, "linewidth": 1.0, "linestyle": (0, (1, 1))}
_CALLED: dict[str, Any] = {"color": LIMIT, "linewidth": 1.4}
_EARLY: dict[str, Any] = {"color": BEST["color"], "linewidth": 1.4, "linestyle": (0, (4, 2))}


def monitoring_figure(found: Monitoring) -> Figure:
    """Readings and expectation [°C], and their difference [K], of the sensors with alarms.

    At most six sensors are drawn; where there was no alarm, those whose residual is largest.
    """
    chosen = _chosen(found.runs)
    columns = min(len(chosen), 2)
    rows = -(-len(chosen) // columns)
    figure = new_figure(_MONITOR_LEGEND + _MONITOR_PANEL * rows)
    grid = figure.subplots(2 * rows, columns, squeeze=False, gridspec_kw={"height_ratios": [2, 1.15] * rows})
    if len(chosen) < rows * columns:
        for ax in grid[-2:, -1]:
            ax.set_axis_off()
    for place, (watched, row) in enumerate(chosen):
        line, column = 2 * (place // columns), place % columns
        _draw(grid[line, column], grid[line + 1, column], watched, row, found.threshold)
    figure.legend(
        handles=_monitor_legend(found.threshold), loc="outside upper center", ncols=5, frameon=False, fontsize=SMALL
    )
    return figure


def _chosen(runs: Sequence[Watched]) -> list[tuple[Watched, int]]:
    called = [
        (watched, row)
        for watched in runs
        for row, node in enumerate(watched.scene.nodes)
        if any(alarm.node == node for alarm in (*watched.direct, *watched.statistical))
    ]
    if called:
        return called[:_MOST_PANELS]
    worst = [
        (watched, watched.scene.nodes.index(max(watched.largest, key=watched.largest.__getitem__))) for watched in runs
    ]
    return worst[:_MOST_PANELS]


def _draw(upper: Axes, lower: Axes, watched: Watched, row: int, threshold: float) -> None:
    scene = watched.scene
    node = scene.nodes[row]
    time, label = time_axis(scene.time)
    per_second = (time[-1] - time[0]) / (scene.time[-1] - scene.time[0])
    upper.plot(*decimated(time, scene.measured[row]), **MEASURED)
    upper.plot(*decimated(time, scene.expected[row]), **GIVEN)
    lower.plot(*decimated(time, scene.residual[row]), **(MEASURED | {"linewidth": 0.7}))
    for limit in (-threshold, threshold):
        lower.axhline(limit, **_LIMIT)
    for alarms, style in ((watched.direct, _CALLED), (watched.statistical, _EARLY)):
        for alarm in alarms:
            if alarm.node == node:
                at = time[0] + (alarm.time - scene.time[0]) * per_second
                for ax in (upper, lower):
                    ax.axvline(float(at), **style)
    kinds = dict.fromkeys(alarm.kind for alarm in (*watched.statistical, *watched.direct) if alarm.node == node)
    named = f": {' or '.join(kinds)}" if kinds else ": no alarm"
    upper.set_title(plain(f"{node}, run {scene.run.name}{named}"), size=TEXT, loc="left", pad=3)
    upper.set_ylabel("temperature [°C]", size=SMALL)
    upper.tick_params(labelbottom=False)
    lower.set_ylabel("residual [K]", size=SMALL)
    lower.set_xlabel(label, size=SMALL)
    largest = float(np.nanmax(np.abs(scene.residual[row]), initial=0.0))
    lower.set_ylim(-1.15 * max(threshold, largest), 1.15 * max(threshold, largest))
    lower.sharex(upper)
    for ax in (upper, lower):
        dress(ax)


def _monitor_legend(threshold: float) -> list[Line2D]:
    return [
        Line2D([], [], label="measured; measured − model", **MEASURED),
        Line2D([], [], label="model, running freely", **GIVEN),
        Line2D([], [], label="statistical alarm", **_EARLY),
        Line2D([], [], label="threshold alarm", **_CALLED),
        Line2D([], [], label=f"threshold ±{threshold:g} K", **_LIMIT),
    ]
