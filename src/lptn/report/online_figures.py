"""Figures of forecasts and of monitored runs."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, isfinite
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from lptn.basics import style
from lptn.online.forecasting import Forecast, NodeForecast
from lptn.online.monitoring import MonitoredRun, Monitoring
from lptn.report.tables import time_to_limit
from lptn.report.text import percent

# --- forecasts: temperatures so far and to come, with their interval and the limit --------------------------


_COLUMNS = 3
_MOST = 12  # nodes
_PANEL = 2.1  # inch
_LEGEND = 0.4  # inch
_BEYOND = 1.4  # times the last interval's end that is shown
_LEAST = 60.0  # s to come that are shown at least


def plot_forecast(
    forecast: Forecast, node: str, span: tuple[float, float] | None = None, ax: Axes | None = None
) -> Axes:
    """Readings [°C] of a node so far, expected temperatures with their interval, and the limit.

    Args:
        forecast: the forecast.
        node: one with a limit.
        span: from when to when to show, in s from the end of the log; by default what this node needs.
        ax: where to draw; by default new axes.
    """
    ax = ax or style.new_axes(3.0)
    one = forecast.nodes[node]
    span = span or _span(forecast, [one])
    row, minutes = forecast.names.index(node), forecast.time / 60
    shown = forecast.time <= span[1] * 1.05
    past = forecast.log >= span[0]
    low, high = forecast.low[row][shown], forecast.high[row][shown]
    ax.fill_between(minutes[shown], low, high, color=style.GIVEN["color"], alpha=0.25, linewidth=0)
    ax.plot(forecast.log[past] / 60, forecast.measured[row][past], **style.MEASURED)
    ax.plot(minutes[shown], forecast.temperature[row][shown], **style.GIVEN)
    ax.axhline(one.limit, color=style.LIMIT, linewidth=1.2)
    ax.axvline(0.0, color=style.FAINT, linewidth=0.8)
    if one.reaches and one.time_to_limit > 0:
        latest = one.high if isfinite(one.high) else span[1] * 1.05
        ax.plot([one.low / 60, latest / 60], [one.limit] * 2, color=style.INK, linewidth=3.0, solid_capstyle="butt")
        ax.plot([one.time_to_limit / 60], [one.limit], "o", color=style.INK, markersize=4)
    ax.set_xlim(span[0] / 60, span[1] / 60)
    settles = "" if one.reaches or not isfinite(one.steady) else f"; settles at {one.steady:.0f} °C"
    ax.set_title(style.plain(f"{node}: {time_to_limit(one)}{settles}"), size=style.TEXT, loc="left", pad=3)
    ax.set_ylabel("temperature [°C]", size=style.SMALL)
    ax.set_xlabel("time from now [min]", size=style.SMALL)
    ax.margins(y=0.08)
    style.dress(ax)
    return ax


def forecast_figure(forecast: Forecast) -> Figure:
    """Readings [°C] so far, expected temperatures with their interval, and the limit; the twelve soonest nodes."""
    chosen = [node for node in forecast.nodes.values() if node in forecast.soonest[:_MOST]]
    columns = min(_COLUMNS, len(chosen))
    rows = ceil(len(chosen) / columns)
    figure = style.new_figure(rows * _PANEL + _LEGEND)
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    span = _span(forecast, chosen)
    for ax, one in zip(grid.ravel(), chosen, strict=False):
        plot_forecast(forecast, one.node, span, ax)
    for ax in grid.ravel()[len(chosen) :]:
        ax.set_visible(False)
    for place, ax in enumerate(grid.ravel()[: len(chosen)]):
        if place % columns:
            ax.set_ylabel("")
        lowest = place + columns >= len(chosen)
        ax.tick_params(labelbottom=lowest)
        if not lowest:
            ax.set_xlabel("")
    handles = [
        Line2D([], [], label="measured", **style.MEASURED),
        Line2D([], [], label="predicted", **style.GIVEN),
        Patch(color=style.GIVEN["color"], alpha=0.25, label=f"{percent(forecast.coverage)} interval"),
        Line2D([], [], color=style.LIMIT, linewidth=1.2, label="limit"),
        Line2D([], [], color=style.INK, linewidth=3.0, marker="o", markersize=4, label="time to the limit, interval"),
    ]
    style.legend_above(figure, handles)
    return figure


def _span(forecast: Forecast, chosen: Sequence[NodeForecast]) -> tuple[float, float]:
    """From when to when to show [s]: all that is reached with its interval, else until little moves."""
    ends = [node.high if isfinite(node.high) else 1.5 * node.time_to_limit for node in chosen if node.reaches]
    until = min(_BEYOND * max(ends), float(forecast.time[-1])) if ends else float(forecast.time[-1])
    until = max(until, _LEAST)
    return max(float(forecast.log[0]), -until), until


# --- monitored runs: readings and predictions, their difference, and when each detector called --------------


_MOST_SENSORS = 6
_MONITOR_PANEL, _MONITOR_LEGEND = 2.9, 0.35  # inch
_THRESHOLD: dict[str, Any] = {"color": style.LIMIT, "linewidth": 1.0, "linestyle": (0, (1, 1))}
_THRESHOLD_ALARM: dict[str, Any] = {"color": style.LIMIT, "linewidth": 1.4}
_STATISTICAL_ALARM: dict[str, Any] = {"color": style.LIMIT, "linewidth": 1.4, "linestyle": (0, (5, 2))}


def plot_monitored(monitored: MonitoredRun, node: str, threshold: float | None = None, ax: Axes | None = None) -> Axes:
    """Readings and predictions [°C] of a sensor over a run, and when each detector called it faulty.

    Args:
        monitored: the run.
        node: the sensor's node.
        threshold: of the plain detector [K]; with one, the error (predicted − measured) is drawn instead.
        ax: where to draw; by default new axes.
    """
    ax = ax or style.new_axes(2.6)
    row = monitored.nodes.index(node)
    lines = [(monitored.measured[row], style.MEASURED), (monitored.predicted[row], style.GIVEN)]
    if threshold is not None:
        lines = [(monitored.error[row], style.MEASURED | {"linewidth": 0.7})]
    unit = style.draw_over_time(ax, monitored.run.elapsed, lines)
    ax.set_ylabel("temperature [°C]" if threshold is None else style.ERROR, size=style.SMALL)
    if threshold is not None:
        for limit in (-threshold, threshold):
            ax.axhline(limit, **_THRESHOLD)
        top = 1.15 * max(threshold, float(np.nanmax(np.abs(monitored.error[row]), initial=0.0)))
        ax.set_ylim(-top, top)
    alarms = ((monitored.threshold_alarms, _THRESHOLD_ALARM), (monitored.statistical_alarms, _STATISTICAL_ALARM))
    for called, look in alarms:
        for alarm in called:
            if alarm.node == node:
                ax.axvline((alarm.time - monitored.run.origin) / unit, **look)
    every = (*monitored.statistical_alarms, *monitored.threshold_alarms)
    kinds = dict.fromkeys(alarm.kind for alarm in every if alarm.node == node)
    title = f"{node}, run {monitored.run.name}: {' or '.join(kinds) or 'no alarm'}"
    ax.set_title(style.plain(title), size=style.TEXT, loc="left", pad=3)
    return ax


def monitoring_figure(result: Monitoring) -> Figure:
    """Readings and predictions [°C], and the error [K], of the sensors with alarms.

    At most six sensors are drawn; where there was no alarm, those whose error is largest.
    """
    chosen = _chosen(result.runs)
    columns = min(len(chosen), 2)
    rows = -(-len(chosen) // columns)
    figure = style.new_figure(_MONITOR_LEGEND + _MONITOR_PANEL * rows)
    pairs = style.stacked_axes(figure, len(chosen), columns)
    for (monitored, node), (upper, lower) in zip(chosen, pairs, strict=True):
        plot_monitored(monitored, node, ax=upper).set_xlabel("")
        plot_monitored(monitored, node, result.threshold, lower).set_title("", loc="left")
    handles = [
        Line2D([], [], label="measured; error", **style.MEASURED),
        Line2D([], [], label="model, running freely", **style.GIVEN),
        Line2D([], [], label="statistical alarm", **_STATISTICAL_ALARM),
        Line2D([], [], label="threshold alarm", **_THRESHOLD_ALARM),
        Line2D([], [], label=f"threshold ±{result.threshold:g} K", **_THRESHOLD),
    ]
    style.legend_above(figure, handles)
    return figure


def _chosen(runs: Sequence[MonitoredRun]) -> list[tuple[MonitoredRun, str]]:
    called = [
        (monitored, node)
        for monitored in runs
        for node in monitored.nodes
        if any(alarm.node == node for alarm in (*monitored.threshold_alarms, *monitored.statistical_alarms))
    ]
    worst = [(monitored, max(monitored.largest_error, key=monitored.largest_error.__getitem__)) for monitored in runs]
    return (called or worst)[:_MOST_SENSORS]
