"""Figures of a model against measurements: temperatures, errors in time, and where it fails."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.style import (
    BEST,
    GIVEN,
    MEASURED,
    NOISE,
    OPENING,
    RMSE_MAP,
    SMALL,
    TEXT,
    TINY,
    WIDTH,
    decimated,
    dress,
    new_figure,
    plain,
    rmse_norm,
    time_axis,
)
from lptn.identify.comparison import Comparison, Condition, Prediction
from lptn.report.text import short, significant

# --- Errors by operating condition as the page shows them: long times in minutes ------------------


_LONG = 600.0  # s; longer times are in minutes, as in the figures
_SECONDS, _MINUTES = " [s]", " [min]"


def conditions_of(comparison: Comparison) -> list[Condition]:
    """`Comparison.conditions` with times in the unit in which a person reads them."""
    found = comparison.conditions()
    longest = max((each.upper for each in found if each.quantity.endswith(_SECONDS)), default=0.0)
    return [_in_minutes(each) for each in found] if longest > _LONG else found


def worst(comparison: Comparison) -> Condition | None:
    """The condition in which a model fails worst, `None` where nothing can be binned."""
    return max(conditions_of(comparison), key=lambda each: each.errors.rmse, default=None)


def _in_minutes(each: Condition) -> Condition:
    if not each.quantity.endswith(_SECONDS):
        return each
    quantity = each.quantity.removesuffix(_SECONDS) + _MINUTES
    return replace(each, quantity=quantity, lower=each.lower / 60, upper=each.upper / 60)


# --- The figure of where a model fails: RMSE by node and operating condition ----------------------


_TALLEST = 9.0  # inch; what fits on a printed page
_ROW, _FRAME = 0.29, 0.55  # inch: a node's row, and what surrounds the rows of a panel
_DARK = 0.45  # luminance below which writing must be white


@dataclass(frozen=True)
class Panel:
    """One quantity's cells for one model, and what stands above them."""

    quantity: str
    cells: tuple[Condition, ...]
    heading: str = ""
    colour: str = "black"


Row = tuple[Panel, ...]


def error_maps(given: Comparison, best: Comparison | None = None) -> list[Figure]:
    """Maps of RMSE [K], a row for each quantity; the given model left, the best right, on one colour scale.

    Args:
        given: the given model's comparison.
        best: the best model's on the same runs; without it the given model's quantities stand two in a row.

    Returns:
        Figures that each fit a printed page; none where nothing can be binned.
    """
    rows = map_rows(given, best)
    if not rows:
        return []
    names = nodes_of(rows)
    each = map_height(1, len(names))
    size = max(1, int(_TALLEST / each))
    norm = norm_of(rows, given)
    figures = []
    for first in range(0, len(rows), size):
        chunk = rows[first : first + size]
        figure = new_figure(map_height(len(chunk), len(names)))
        draw_maps(figure, chunk, names, norm)
        figures.append(figure)
    return figures


def map_rows(given: Comparison, best: Comparison | None = None) -> list[Row]:
    """The panels of both models, or of one alone, in rows of two."""
    left = _panels(given, "model as given" if best else "", GIVEN["color"] if best else "black")
    if best is None:
        return [tuple(left[place : place + 2]) for place in range(0, len(left), 2)]
    right = {panel.quantity: panel for panel in _panels(best, "best model", BEST["color"])}
    return [(panel, right[panel.quantity]) for panel in left]


def nodes_of(rows: Sequence[Row]) -> list[str]:
    """The nodes that have a cell, in the model's order."""
    return list(dict.fromkeys(cell.node for row in rows for panel in row for cell in panel.cells))


def norm_of(rows: Sequence[Row], comparison: Comparison) -> Normalize:
    """One colour scale for all panels."""
    largest = max(cell.errors.rmse for row in rows for panel in row for cell in panel.cells)
    return rmse_norm(largest, max(comparison.floor(node) for node in nodes_of(rows)))


def map_height(rows: int, nodes: int) -> float:
    """Height of so many rows of panels with so many nodes [inch]."""
    return rows * (_FRAME + _ROW * nodes)


def draw_maps(figure: FigureBase, rows: Sequence[Row], nodes: Sequence[str], norm: Normalize) -> None:
    """Draw rows of panels with one colour bar beside them."""
    grid = figure.subplots(len(rows), 2, squeeze=False)
    for number, row in enumerate(rows):
        for column in range(2):
            ax = grid[number, column]
            if column < len(row):
                _draw(ax, row[column], nodes, norm, labelled=column == 0 or not row[column].heading)
            else:
                ax.set_axis_off()
    bar = figure.colorbar(ScalarMappable(norm, RMSE_MAP), ax=grid, fraction=0.025, pad=0.01, aspect=30)
    bar.set_label("RMSE [K]", size=TEXT)
    bar.ax.tick_params(labelsize=SMALL)


def _panels(comparison: Comparison, heading: str, colour: str) -> list[Panel]:
    cells = conditions_of(comparison)
    # A quantity that no node splits into bins (a load that is on or off) only repeats the node's own error.
    count = Counter((cell.quantity, cell.node) for cell in cells)
    quantities = dict.fromkeys(cell.quantity for cell in cells if count[cell.quantity, cell.node] > 1)
    return [
        Panel(quantity, tuple(cell for cell in cells if cell.quantity == quantity), heading, colour)
        for quantity in quantities
    ]


def _draw(ax: Axes, panel: Panel, nodes: Sequence[str], norm: Normalize, *, labelled: bool) -> None:
    for row, node in enumerate(nodes):
        cells = [cell for cell in panel.cells if cell.node == node]
        for place, cell in enumerate(cells):
            _draw_cell(ax, cell, place / len(cells), row, 1.0 / len(cells), norm)
    ax.set_xlim(0.0, 1.0)
    ax.set_ylim(len(nodes), 0.0)
    ax.set_xticks([])
    ax.set_yticks([row + 0.5 for row in range(len(nodes))], [plain(node) if labelled else "" for node in nodes])
    ax.tick_params(length=0, labelsize=SMALL)
    ax.spines[:].set_visible(False)
    unit = "" if "[" in panel.quantity else " [as logged]"
    ax.set_title(f"{panel.quantity}{unit}, low to high", size=SMALL, loc="left", pad=3)
    if panel.heading:
        ax.set_title(panel.heading, size=SMALL, loc="right", pad=3, color=panel.colour, weight="bold")


def _draw_cell(ax: Axes, cell: Condition, left: float, top: float, width: float, norm: Normalize) -> None:
    colour = RMSE_MAP(norm(cell.errors.rmse))
    luminance = 0.299 * colour[0] + 0.587 * colour[1] + 0.114 * colour[2]
    ink = "white" if luminance < _DARK else "black"
    ax.add_patch(Rectangle((left, top), width, 1.0, facecolor=colour, edgecolor="white", linewidth=1.0))
    middle = left + width / 2
    ax.text(middle, top + 0.32, significant(cell.errors.rmse, 2), ha="center", va="center", size=SMALL, color=ink)
    ends = f"{short(cell.lower)} to {short(cell.upper)}"
    ax.text(middle, top + 0.76, ends, ha="center", va="center", size=TINY, color=ink)


# --- The figure of measured against predicted temperatures, and the error in time -----------------


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
        if prediction.bound.counted[row].any()
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
        _draw_view(upper, lower, view, given, best)
    figure.legend(
        handles=_legend(given, best, names), loc="outside upper center", ncols=5, frameon=False, fontsize=SMALL
    )


def _columns(count: int) -> int:
    """How many panels stand side by side, so that few places stay empty."""
    return 2 if count in (2, 4) else min(count, 3)


def _draw_view(upper: Axes, lower: Axes, view: View, given: Comparison, best: Comparison | None) -> None:
    prediction = given.predictions[view.run]
    node = given.model.nodes[view.row]
    time, label = time_axis(prediction.bound.run.time)
    _line(upper, time, prediction.bound.measured[view.row], MEASURED)
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
    upper.set_title(plain(f"{node}, run {prediction.segment.run.name}"), size=TEXT, loc="left", pad=3)
    upper.set_ylabel("temperature [°C]", size=SMALL)
    upper.tick_params(labelbottom=False)
    lower.set_ylabel("error [K]", size=SMALL)
    lower.set_xlabel(label, size=SMALL)
    lower.margins(x=0.01)


def opening_end(prediction: Prediction) -> float | None:
    """Where the stretch that found the start ends [s], `None` where it is also what counts."""
    part = prediction.segment
    return None if part.initialisation == part.evaluation else min(part.initialisation[1], float(part.run.time[-1]))


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


# --- One figure of a model against measurements: temperatures, errors, and where it fails ---------


def plot_prediction(comparison: Comparison, node: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw measured and predicted temperatures [°C] of one node in one run over time.

    Args:
        comparison: predictions beside measurements.
        node: its name; by default the node and run with the largest RMSE, with a name that node's worst run.
        ax: where to draw; a new figure of pyplot's by default.

    Raises:
        InputError: no such node, or it is measured in none of the runs.
    """
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.subplots(figsize=(WIDTH, _PANEL), layout="constrained")[1]
    measured = views(comparison)
    known = list(dict.fromkeys(comparison.model.nodes[view.row] for view in measured))
    if node is not None and node not in known:
        raise InputError("plot", "node", repr(node), f"a node that is measured: {', '.join(known)}")
    view = max(
        (view for view in measured if node in (None, comparison.model.nodes[view.row])),
        key=lambda view: _rmse(comparison, view),
    )
    prediction = comparison.predictions[view.run]
    name = comparison.model.nodes[view.row]
    time, label = time_axis(prediction.bound.run.time)
    _line(ax, time, prediction.bound.measured[view.row], MEASURED | {"label": "measured"})
    _line(ax, time, prediction.readings[view.row], GIVEN | {"label": "predicted"})
    ax.set_title(plain(f"{name}, run {prediction.segment.run.name}: RMSE {_rmse(comparison, view):.3g} K"), size=TEXT)
    ax.set_xlabel(label, size=SMALL)
    ax.set_ylabel("temperature [°C]", size=SMALL)
    ax.legend(frameon=False, fontsize=SMALL)
    dress(ax)
    return ax


def comparison_figure(comparison: Comparison) -> Figure:
    """Measured and predicted [°C], error [K] in time, and RMSE [K] by operating condition, for one model.

    At most six nodes and runs are drawn in time: the worst.
    """
    chosen = worst_views(comparison, MOST)
    rows = map_rows(comparison)
    above = panels_height(len(chosen))
    if not rows:
        figure = new_figure(above)
        draw_predictions(figure, chosen, comparison, None)
        return figure
    nodes = nodes_of(rows)
    below = map_height(len(rows), len(nodes))
    figure = new_figure(above + below)
    upper, lower = figure.subfigures(2, 1, height_ratios=[above, below], squeeze=False)[:, 0]
    draw_predictions(upper, chosen, comparison, None)
    draw_maps(lower, rows, nodes, norm_of(rows, comparison))
    return figure
