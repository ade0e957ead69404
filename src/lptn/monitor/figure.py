"""The picture of a monitored run: readings and expectation, their difference, and when each detector called."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lptn.monitor.monitoring import Monitoring, Watched
from lptn.report.decimate import decimated
from lptn.report.style import BEST, GIVEN, LIMIT, MEASURED, SMALL, TEXT, dress, new_figure, plain, time_axis

_MOST = 6
_PANEL, _LEGEND = 2.9, 0.35  # inch
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
    figure = new_figure(_LEGEND + _PANEL * rows)
    grid = figure.subplots(2 * rows, columns, squeeze=False, gridspec_kw={"height_ratios": [2, 1.15] * rows})
    if len(chosen) < rows * columns:
        for ax in grid[-2:, -1]:
            ax.set_axis_off()
    for place, (watched, row) in enumerate(chosen):
        line, column = 2 * (place // columns), place % columns
        _draw(grid[line, column], grid[line + 1, column], watched, row, found.threshold)
    figure.legend(handles=_legend(found.threshold), loc="outside upper center", ncols=5, frameon=False, fontsize=SMALL)
    return figure


def _chosen(runs: Sequence[Watched]) -> list[tuple[Watched, int]]:
    called = [
        (watched, row)
        for watched in runs
        for row, node in enumerate(watched.scene.nodes)
        if any(alarm.node == node for alarm in (*watched.direct, *watched.statistical))
    ]
    if called:
        return called[:_MOST]
    worst = [
        (watched, watched.scene.nodes.index(max(watched.largest, key=watched.largest.__getitem__))) for watched in runs
    ]
    return worst[:_MOST]


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


def _legend(threshold: float) -> list[Line2D]:
    return [
        Line2D([], [], label="measured; measured − model", **MEASURED),
        Line2D([], [], label="model, running freely", **GIVEN),
        Line2D([], [], label="statistical alarm", **_EARLY),
        Line2D([], [], label="threshold alarm", **_CALLED),
        Line2D([], [], label=f"threshold ±{threshold:g} K", **_LIMIT),
    ]
