"""The figure of a torque plan: asked and admitted, temperatures with their limits, slack."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lptn.report.style import BEST, GIVEN, INK, LIMIT, MEASURED, SMALL, TEXT, dress, new_figure, plain, time_axis

from .heat import heating

if TYPE_CHECKING:
    from .kind import TrackAnswer

_COLUMNS, _MOST = 3, 12
_ROW, _EXTRA = 1.75, 0.5  # inch


def track_figure(found: TrackAnswer) -> Figure:
    """For each joint what was asked and admitted above, its temperature with its limit below; at most twelve joints."""
    task = found.task
    cut = np.argsort(-np.nan_to_num(1 - found.shares), kind="stable")[:_MOST]
    chosen = sorted(int(number) for number in cut)
    rows = -(-len(chosen) // _COLUMNS)
    columns = min(_COLUMNS, len(chosen))
    figure = new_figure(2 * rows * _ROW * 0.8 + _EXTRA)
    axes = figure.subplots(2 * rows, columns, squeeze=False, sharex=True, sharey=False)
    unit = heating(task.model, task.request).unit.replace("*", "·")
    ends, label = time_axis(np.arange(len(task.asked) + 1, dtype=float) * task.period)
    for ax in axes.ravel():
        ax.set_visible(False)
    for place, number in enumerate(chosen):
        row, column = divmod(place, columns)
        upper, lower = axes[2 * row, column], axes[2 * row + 1, column]
        for ax in (upper, lower):
            ax.set_visible(True)
            dress(ax)
        upper.stairs(np.abs(task.asked[:, number]), ends, baseline=None, color=INK, linewidth=MEASURED["linewidth"])
        upper.stairs(np.abs(found.admitted[:, number]), ends, baseline=None, color=BEST["color"], linewidth=1.8)
        upper.set_ylim(bottom=0)
        upper.set_title(plain(found.joints[number]), size=TEXT, loc="left", pad=3)
        _temperature(lower, found, found.joints[number], ends)
        if column == 0:
            upper.set_ylabel(f"{task.request} [{unit}]", size=SMALL)
            lower.set_ylabel("temp. [°C]", size=SMALL)
        if place + columns >= len(chosen):
            lower.set_xlabel(label, size=SMALL)
            lower.tick_params(labelbottom=True)
    figure.legend(handles=_legend(found), loc="outside upper center", ncols=5, fontsize=SMALL, frameon=False)
    return figure


def _temperature(ax: object, found: TrackAnswer, joint: str, ends: object) -> None:
    nodes = found.task.model.nodes
    if joint not in nodes:
        ax.set_visible(False)  # type: ignore[attr-defined]
        return
    values = found.temperatures[nodes.index(joint)]
    ax.plot(ends, values, **GIVEN)  # type: ignore[attr-defined]
    if joint in found.limits:
        limit = found.limits[joint]
        ax.axhline(limit, color=LIMIT, linewidth=1.2)  # type: ignore[attr-defined]
        over = np.maximum(values, limit)
        ax.fill_between(ends, limit, over, color=LIMIT, alpha=0.35, linewidth=0)  # type: ignore[attr-defined]
    ax.margins(y=0.12)  # type: ignore[attr-defined]


def _legend(found: TrackAnswer) -> list[Line2D]:
    lines = [
        Line2D([], [], color=INK, linewidth=0.8, label="requested"),
        Line2D([], [], color=BEST["color"], linewidth=1.8, label="admitted"),
        Line2D([], [], label="temperature", **GIVEN),
        Line2D([], [], color=LIMIT, linewidth=1.2, label="limit"),
    ]
    if found.slack.max(initial=0.0) > 0:
        lines.append(Line2D([], [], color=LIMIT, alpha=0.35, linewidth=6, label="slack"))
    return lines
