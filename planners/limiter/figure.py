"""The figure of admissible torques: a group of bars a joint, the present load as a line across it."""

from __future__ import annotations

from math import isinf
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lptn.report.style import INK, SMALL, dress, new_figure, plain

if TYPE_CHECKING:
    from .kind import LimitAnswer

_HEIGHT, _WIDE, _TALLEST = 3.2, 0.84, 1.15


def limit_figure(found: LimitAnswer) -> Figure:
    """Admissible values by joint and horizon; what nothing limits is drawn to the top and marked."""
    limiter = found.task.limiter
    figure = new_figure(_HEIGHT)
    ax = figure.subplots()
    count, places = len(limiter.horizons), np.arange(len(limiter.joints))
    limited = found.admissible[found.admissible < 1e6]
    top = _TALLEST * max(float(limited.max(initial=0.0)), float(np.abs(found.task.load).max(initial=0.0)), 1e-9)
    shades = colormaps["cividis"](np.linspace(0.1, 0.9, count))
    for number, seconds in enumerate(limiter.horizons):
        at = places + _WIDE * ((number + 0.5) / count - 0.5)
        name = "continuous" if isinf(seconds) else f"{seconds:g} s"
        ax.bar(at, np.minimum(found.admissible[:, number], top), _WIDE / count, color=shades[number], label=name)
    ax.hlines(np.abs(found.task.load), places - _WIDE / 2, places + _WIDE / 2, color=INK, linewidth=1.4)
    ax.set_xticks(places, [plain(joint) for joint in limiter.joints], size=SMALL, rotation=30, ha="right")
    ax.set_ylim(0, top)
    ax.set_ylabel(f"admissible {limiter.heating.request} [{limiter.heating.unit.replace('*', '·')}]", size=SMALL)
    handles, _ = ax.get_legend_handles_labels()
    line = Line2D([], [], color=INK, linewidth=1.4, label="load now")
    figure.legend(handles=[*handles, line], loc="outside upper center", ncols=count + 1, fontsize=SMALL, frameon=False)
    dress(ax)
    return figure
