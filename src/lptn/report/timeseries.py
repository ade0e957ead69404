"""The figure of measured against predicted temperatures, and the error in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from lptn.arrays import FloatArray
from lptn.compare import Comparison, Prediction
from lptn.report.decimate import decimated
from lptn.report.style import (
    BEST,
    GIVEN,
    MEASURED,
    NOISE,
    OPENING,
    SMALL,
    TEXT,
    dress,
    new_figure,
    plain,
    time_axis,
)

MOST = 6
"""Panels in one figure."""
_PANEL = 2.9  # inch
_LEGEND = 0.35  # inch
NOISE_BAND = 2.0
"""Half-width of the band of noise, in multiples of the RMSE that noise alone would leave."""


@dataclass(frozen=True)
class View:
    """One node in one run: which prediction, which row."""

    run: int
    row: int


def views(comparison: Comparison) -> list[View]:
    """Every node measured in a run, run by run."""
    return [
        View(number, row)
        for number, prediction in enumerate(comparison.predictions)
        for row in range(len(comparison.model.nodes))
        if prediction.drive.counted[row].any()
    ]


def worst_views(comparison: Comparison, most: int = MOST) -> list[View]:
    """The views with the largest RMSE, in the order of runs and nodes."""
    found = views(comparison)
    chosen = sorted(found, key=lambda view: -_rmse(comparison, view))[:most]
    return [view for view in found if view in chosen]


def predictions_figure(
    given: Comparison,
    best: Comparison | None = None,
    most: int = MOST,
    names: tuple[str, str] = ("model as given", "best model"),
) -> Figure:
    """Measured and predicted temperature [°C] with the error [K] below, for each node and run.

    Args:
        given: the given model's comparison.
        best: the best model's on the same runs.
        most: how many panels at most; the given model's worst are chosen.
        names: of the two models.
    """
    chosen = worst_views(given, most)
    figure = new_figure(panels_height(len(chosen)))
    draw_predictions(figure, chosen, given, best, names)
    return figure


def panels_height(count: int) -> float:
    """Height of so many panels [inch]."""
    return _LEGEND + _PANEL * ceil(count / _columns(count))


def draw_predictions(
    figure: FigureBase,
    chosen: Sequence[View],
    given: Comparison,
    best: Comparison | None,
    names: tuple[str, str] = ("model as given", "best model"),
) -> None:
    """Draw panels under one legend."""
    columns = _columns(len(chosen))
    rows = ceil(len(chosen) / columns)
    grid = figure.subplots(2 * rows, columns, squeeze=False, gridspec_kw={"height_ratios": [2, 1.15] * rows})
    for ax in grid.ravel():
        ax.set_axis_off()
    for place, view in enumerate(chosen):
        row, column = 2 * (place // columns), place % columns
        upper, lower = grid[row, column], grid[row + 1, column]
        upper.set_axis_on()
        lower.set_axis_on()
        lower.sharex(upper)
        _draw(upper, lower, view, given, best)
    figure.legend(
        handles=_legend(given, best, names), loc="outside upper center", ncols=5, frameon=False, fontsize=SMALL
    )


def _columns(count: int) -> int:
    """How many panels stand side by side, so that few places stay empty."""
    return 2 if count in (2, 4) else min(count, 3)


def _draw(upper: Axes, lower: Axes, view: View, given: Comparison, best: Comparison | None) -> None:
    prediction = given.predictions[view.run]
    node = given.model.nodes[view.row]
    time, label = time_axis(prediction.drive.run.time)
    _line(upper, time, prediction.drive.measured[view.row], MEASURED)
    band = NOISE_BAND * given.floor(node)
    lower.axhspan(-band, band, color=NOISE, linewidth=0)
    for comparison, style in ((given, GIVEN), (best, BEST)):
        if comparison is not None:
            shown = comparison.predictions[view.run]
            _line(upper, time, shown.readings[view.row], style)
            _line(lower, time, shown.error[view.row], style | {"linewidth": 0.8})
    opening = opening_end(prediction)
    for ax in (upper, lower):
        if opening is not None:
            per_second = 1.0 if label.endswith("[s]") else 1 / 60
            ax.axvspan(float(time[0]), opening * per_second, color=OPENING, zorder=0, linewidth=0)
        dress(ax)
    upper.set_title(plain(f"{node}, run {prediction.part.run.name}"), size=TEXT, loc="left", pad=3)
    upper.set_ylabel("temperature [°C]", size=SMALL)
    upper.tick_params(labelbottom=False)
    lower.set_ylabel("error [K]", size=SMALL)
    lower.set_xlabel(label, size=SMALL)
    lower.margins(x=0.01)


def opening_end(prediction: Prediction) -> float | None:
    """Where the stretch that found the start ends [s], `None` where it is also what counts."""
    part = prediction.part
    return None if part.opening == part.counted else min(part.opening[1], float(part.run.time[-1]))


def _line(ax: Axes, time: FloatArray, values: FloatArray, style: dict[str, Any]) -> None:
    ax.plot(*decimated(time, values), **style)


def _rmse(comparison: Comparison, view: View) -> float:
    prediction = comparison.predictions[view.run]
    return float(np.sqrt(np.nanmean(prediction.error[view.row] ** 2)))


def _legend(given: Comparison, best: Comparison | None, names: tuple[str, str]) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = [
        Line2D([], [], label="measured", **MEASURED),
        Line2D([], [], label=plain(names[0]) if best else "model", **GIVEN),
    ]
    if best is not None:
        handles.append(Line2D([], [], label=plain(names[1]), **BEST))
    if any(opening_end(prediction) is not None for prediction in given.predictions):
        handles.append(Patch(color=OPENING, label="opening: finds the start"))
    handles.append(Patch(color=NOISE, label="sensor noise"))
    return handles
