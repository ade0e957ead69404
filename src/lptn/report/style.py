"""The one visual language: which colour and line means what, and how axes look."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure

from lptn.arrays import FloatArray

WIDTH = 9.0  # inch; fills a laptop's page and still prints legibly on A4
TEXT, SMALL, TINY = 9.0, 8.0, 6.5  # pt
INK, FAINT = "black", "0.55"
OPENING, NOISE = "0.93", "0.85"
LIMIT = "#CC0000"  # of limits and alarms, and of nothing else
RMSE_MAP: Colormap = colormaps["cividis_r"]  # light is good, dark is bad, on a grey printer too

# Blue and green look alike in grey, so each has a dash pattern of its own.
MEASURED: dict[str, Any] = {"color": INK, "linewidth": 0.8, "zorder": 3}
GIVEN: dict[str, Any] = {"color": "#0072B2", "linewidth": 1.8, "linestyle": (0, (5, 1.5))}
BEST: dict[str, Any] = {"color": "#009E73", "linewidth": 2.4, "linestyle": "-"}

_NOISE_IS_LIGHT = 5.0  # multiples of the noise up to which the colour scale reaches at least
_LONG = 600.0  # s; longer time axes are in minutes


def new_figure(height: float) -> Figure:
    """An empty figure as wide as the page.

    Args:
        height: in inch.
    """
    return Figure(figsize=(WIDTH, height), dpi=150, layout="constrained")


def dress(ax: Axes) -> None:
    """Give axes the common look: no box, small ticks."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(labelsize=SMALL)


def plain(text: str) -> str:
    """A user's text for a figure: dollar signs are not mathematics."""
    return text.replace("$", r"\$")


def time_axis(time: FloatArray) -> tuple[FloatArray, str]:
    """Times [s] in the unit that a person reads them in, and the axis label."""
    minutes = time.size > 0 and float(np.ptp(time)) > _LONG
    return (time / 60.0, "time [min]") if minutes else (time, "time [s]")


def rmse_norm(largest: float, noise: float) -> Normalize:
    """The colour scale from no error to the largest error [K] shown; errors like the noise [K] stay light."""
    return Normalize(0.0, max(largest, _NOISE_IS_LIGHT * noise))
