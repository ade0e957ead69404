"""The figure of a torque plan: asked and admitted, temperatures with their limits, slack."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lptn.basics.arrays import FloatArray
from lptn.basics.style import BEST, GIVEN, INK, LIMIT, MEASURED, SMALL, TEXT, dress, new_figure, plain, time_axis

from ..heating import heating
from .task import TrackTask


def track_figure(
    task: TrackTask,
    joints: Sequence[str],
    admitted: FloatArray,
    temperatures: FloatArray,
    limits: Mapping[str, float],
) -> Figure:
    """For each joint its request and what is admitted above, its temperature with its limit below.

    Args:
        task: what was asked.
        joints: names, in order; the twelve that get the smallest share are drawn.
        admitted: RMS values, shape (steps, joints).
        temperatures: of the states at the ends of the steps [degC], shape (states, steps + 1).
        limits: degC by node.
    """
    asked = np.abs(task.asked).sum(axis=0)
    shares = np.where(asked > 0, np.abs(admitted).sum(axis=0) / np.where(asked > 0, asked, 1.0), 1.0)
    chosen = sorted(int(number) for number in np.argsort(-(1 - shares), kind="stable")[:12])
    columns = min(3, len(chosen))
    rows = -(-len(chosen) // 3)
    figure = new_figure(2.8 * rows + 0.5)
    axes = figure.subplots(2 * rows, columns, squeeze=False, sharex=True, sharey=False)
    unit = heating(task.model, task.request).unit.replace("*", "·")
    ends, label = time_axis(np.arange(len(task.asked) + 1, dtype=float) * task.period)
    by_node = dict(zip(task.model.places, temperatures, strict=False))
    is_over = any(by_node[node][1:].max() > limit for node, limit in limits.items())
    for ax in axes.ravel():
        ax.set_visible(False)
    for place, number in enumerate(chosen):
        row, column = divmod(place, columns)
        upper, lower = axes[2 * row, column], axes[2 * row + 1, column]
        for ax in (upper, lower):
            ax.set_visible(True)
            dress(ax)
        upper.stairs(np.abs(task.asked[:, number]), ends, baseline=None, color=INK, linewidth=MEASURED["linewidth"])
        upper.stairs(np.abs(admitted[:, number]), ends, baseline=None, color=BEST["color"], linewidth=1.8)
        upper.set_ylim(bottom=0)
        upper.set_title(plain(joints[number]), size=TEXT, loc="left", pad=3)
        _temperature(lower, ends, by_node, limits, joints[number])
        if column == 0:
            upper.set_ylabel(f"{task.request} [{unit}]", size=SMALL)
            lower.set_ylabel("temp. [°C]", size=SMALL)
        if place + columns >= len(chosen):
            lower.set_xlabel(label, size=SMALL)
            lower.tick_params(labelbottom=True)
    figure.legend(handles=_legend(is_over), loc="outside upper center", ncols=5, fontsize=SMALL, frameon=False)
    return figure


def _temperature(
    ax: Axes, ends: FloatArray, by_node: Mapping[str, FloatArray], limits: Mapping[str, float], joint: str
) -> None:
    if joint not in by_node:
        ax.set_visible(False)
        return
    values = by_node[joint]
    ax.plot(ends, values, **GIVEN)
    if joint in limits:
        ax.axhline(limits[joint], color=LIMIT, linewidth=1.2)
        over = np.maximum(values, limits[joint])
        ax.fill_between(ends, limits[joint], over, color=LIMIT, alpha=0.35, linewidth=0)
    ax.margins(y=0.12)


def _legend(is_over: bool) -> list[Line2D]:
    lines = [
        Line2D([], [], color=INK, linewidth=0.8, label="requested"),
        Line2D([], [], color=BEST["color"], linewidth=1.8, label="admitted"),
        Line2D([], [], label="temperature", **GIVEN),
        Line2D([], [], color=LIMIT, linewidth=1.2, label="limit"),
    ]
    if is_over:
        lines.append(Line2D([], [], color=LIMIT, alpha=0.35, linewidth=6, label="slack"))
    return lines
