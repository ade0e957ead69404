"""Figures of a model against measurements: temperatures and errors in time, where it fails, two models' errors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from lptn.basics.style import (
    BEST,
    ERROR,
    GIVEN,
    MEASURED,
    NOISE,
    RMSE_MAP,
    SHADE,
    SMALL,
    TEXT,
    TINY,
    decimated,
    dress,
    new_axes,
    new_figure,
    plain,
    rmse_norm,
    time_axis,
)
from lptn.identify.comparison import Comparison, Condition, Pair, Prediction, Versus
from lptn.report.shown import MOST, NOISE_BAND, View, initialisation_end, worst_view, worst_views
from lptn.report.tables import conditions_of
from lptn.report.text import kelvin, short, significant

NAMES = ("model as given", "best model")
"""What two models are called in a figure unless they have names."""


# --- temperatures and errors in time ----------------------------------------------------------------------


def plot_temperatures(
    given: Comparison,
    node: str | None = None,
    run: int | None = None,
    best: Comparison | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Measured and predicted temperature [°C] of a node over a run; the readings that find the start are shaded.

    Args:
        given: a model's comparison.
        node: its name; by default the node with the largest RMSE.
        run: the number of the run in the comparison; by default the node's worst.
        best: another model's comparison on the same runs.
        ax: where to draw; by default new axes.

    Raises:
        InputError: the node is not measured there.
    """
    run, node = worst_view(given, node, run)
    with_legend = ax is None
    ax = new_axes(2.6) if ax is None else ax
    prediction = given.predictions[run]
    time, label = _shaded_time(ax, prediction)
    measured = prediction.bound.measured[given.model.nodes.index(node)]
    ax.plot(*decimated(time, measured), label="measured", **MEASURED)
    for comparison, style in ((given, GIVEN), (best, BEST)):
        if comparison is not None:
            readings = comparison.predictions[run].readings[comparison.model.nodes.index(node)]
            rmse = kelvin(comparison.node(node, comparison.predictions[run]).rmse)
            ax.plot(*decimated(time, readings), label=f"predicted, RMSE {rmse}", **style)
    if with_legend:
        ax.legend(frameon=False, fontsize=SMALL)
    ax.set_title(plain(f"{node}, run {prediction.segment.run.name}"), size=TEXT, loc="left", pad=3)
    ax.set_ylabel("temperature [°C]", size=SMALL)
    ax.set_xlabel(label, size=SMALL)
    return ax


def plot_errors(
    given: Comparison,
    node: str | None = None,
    run: int | None = None,
    best: Comparison | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Error, predicted − measured [K], of a node over a run, and the band of its sensor's noise.

    Args and Raises: as for `plot_temperatures`.
    """
    run, node = worst_view(given, node, run)
    ax = new_axes(2.0) if ax is None else ax
    time, label = _shaded_time(ax, given.predictions[run])
    band = NOISE_BAND * given.floor(node)
    ax.axhspan(-band, band, color=NOISE, linewidth=0)
    for comparison, style in ((given, GIVEN), (best, BEST)):
        if comparison is not None:
            error = comparison.predictions[run].error[comparison.model.nodes.index(node)]
            ax.plot(*decimated(time, error), **style | {"linewidth": 0.8})
    ax.set_ylabel(ERROR, size=SMALL)
    ax.set_xlabel(label, size=SMALL)
    ax.margins(x=0.01)
    return ax


def _shaded_time(ax: Axes, prediction: Prediction) -> tuple[Any, str]:
    """The run's time in the unit of the axis, and the axis label; the initialisation window is shaded."""
    time, label = time_axis(prediction.bound.run.elapsed)
    end = initialisation_end(prediction)
    if end is not None:
        stop = end / (60 if label.endswith("[min]") else 1)
        ax.axvspan(float(time[0]), stop, color=SHADE, zorder=0, linewidth=0, label="finds the start")
    dress(ax)
    return time, label


_PANEL, _LEGEND = 2.9, 0.35  # inch


def predictions_figure(
    given: Comparison, best: Comparison | None = None, most: int = MOST, names: tuple[str, str] = NAMES
) -> Figure:
    """Measured and predicted temperature [°C] with the error [K] below, for each node and run.

    Args:
        given: the given model's comparison.
        best: the best model's on the same runs.
        most: how many panels at most; the given model's worst are chosen.
        names: of the two models.
    """
    chosen = worst_views(given, most)
    figure = new_figure(_predictions_height(len(chosen)))
    _draw_predictions(figure, chosen, given, best, names)
    return figure


def _predictions_height(count: int) -> float:
    return _LEGEND + _PANEL * ceil(count / _columns(count))


def _columns(count: int) -> int:
    """How many panels stand side by side, so that few places stay empty."""
    return 2 if count in (2, 4) else min(count, 3)


def _draw_predictions(
    figure: FigureBase, chosen: Sequence[View], given: Comparison, best: Comparison | None, names: tuple[str, str]
) -> None:
    columns = _columns(len(chosen))
    rows = ceil(len(chosen) / columns)
    grid = figure.subplots(2 * rows, columns, squeeze=False, gridspec_kw={"height_ratios": [2, 1.15] * rows})
    for ax in grid.ravel():
        ax.set_axis_off()
    for place, (run, node) in enumerate(chosen):
        row, column = 2 * (place // columns), place % columns
        upper, lower = grid[row, column], grid[row + 1, column]
        for ax in (upper, lower):
            ax.set_axis_on()
        lower.sharex(upper)
        plot_temperatures(given, node, run, best, upper).set_xlabel("")
        upper.tick_params(labelbottom=False)
        plot_errors(given, node, run, best, lower)
    handles: list[Line2D | Patch] = [Line2D([], [], label="measured", **MEASURED)]
    handles.append(Line2D([], [], label=plain(names[0]) if best else "model", **GIVEN))
    handles += [Line2D([], [], label=plain(names[1]), **BEST)] if best else []
    if any(initialisation_end(prediction) is not None for prediction in given.predictions):
        handles.append(Patch(color=SHADE, label="finds the start"))
    handles.append(Patch(color=NOISE, label="sensor noise"))
    figure.legend(handles=handles, loc="outside upper center", ncols=5, frameon=False, fontsize=SMALL)


# --- where a model fails: RMSE by node and operating condition ----------------------------------------------


_TALLEST = 9.0  # inch; what fits on a printed page
_ROW, _FRAME = 0.29, 0.55  # inch: a node's row, and what surrounds the rows of a panel
_DARK = 0.45  # luminance below which writing must be white


def plot_conditions(
    comparison: Comparison, quantity: str, ax: Axes | None = None, norm: Normalize | None = None
) -> Axes:
    """RMSE [K] of each node in bins of an operating condition, from low to high.

    Args:
        comparison: the model's comparison.
        quantity: the condition, as in `comparison.conditions()`, long times in minutes.
        ax: where to draw; by default new axes.
        norm: the colour scale; by default one of these cells.
    """
    cells = [cell for cell in conditions_of(comparison) if cell.quantity == quantity]
    nodes = list(dict.fromkeys(cell.node for cell in cells))
    ax = new_axes(_height(1, len(nodes))) if ax is None else ax
    _draw_cells(ax, quantity, cells, nodes, norm or _norm(comparison, cells))
    return ax


def condition_figures(given: Comparison, best: Comparison | None = None) -> list[Figure]:
    """Maps of RMSE [K], a row for each quantity; the given model left, the best right, on one colour scale.

    Args:
        given: the given model's comparison.
        best: the best model's on the same runs; without it the given model's quantities stand two in a row.

    Returns:
        Figures that each fit a printed page; none where nothing can be binned.
    """
    rows, nodes = _rows(given, best)
    if not rows:
        return []
    norm = _norm(given, [cell for row in rows for panel in row for cell in panel.cells])
    size = max(1, int(_TALLEST / _height(1, len(nodes))))
    figures = []
    for first in range(0, len(rows), size):
        chunk = rows[first : first + size]
        figures.append(new_figure(_height(len(chunk), len(nodes))))
        _draw_rows(figures[-1], chunk, nodes, norm)
    return figures


@dataclass(frozen=True)
class _Panel:
    """One quantity's cells for one model, and what stands above them."""

    quantity: str
    cells: tuple[Condition, ...]
    heading: str = ""
    colour: str = "black"


def _rows(given: Comparison, best: Comparison | None = None) -> tuple[list[tuple[_Panel, ...]], list[str]]:
    """The panels of both models, or of one alone, in rows of two; and the nodes that have a cell."""
    left = _panels(given, NAMES[0] if best else "", GIVEN["color"] if best else "black")
    nodes = list(dict.fromkeys(cell.node for panel in left for cell in panel.cells))
    if best is None:
        return [tuple(left[place : place + 2]) for place in range(0, len(left), 2)], nodes
    right = {panel.quantity: panel for panel in _panels(best, NAMES[1], BEST["color"])}
    return [(panel, right[panel.quantity]) for panel in left], nodes


def _panels(comparison: Comparison, heading: str, colour: str) -> list[_Panel]:
    cells = conditions_of(comparison)
    # A quantity that no node splits into bins (a load that is on or off) only repeats the node's own error.
    count = Counter((cell.quantity, cell.node) for cell in cells)
    quantities = dict.fromkeys(cell.quantity for cell in cells if count[cell.quantity, cell.node] > 1)
    return [
        _Panel(quantity, tuple(cell for cell in cells if cell.quantity == quantity), heading, colour)
        for quantity in quantities
    ]


def _norm(comparison: Comparison, cells: Sequence[Condition]) -> Normalize:
    """One colour scale for all cells."""
    return rmse_norm(max(cell.errors.rmse for cell in cells), max(comparison.floor(cell.node) for cell in cells))


def _height(rows: int, nodes: int) -> float:
    return rows * (_FRAME + _ROW * nodes)


def _draw_rows(figure: FigureBase, rows: Sequence[tuple[_Panel, ...]], nodes: Sequence[str], norm: Normalize) -> None:
    grid = figure.subplots(len(rows), 2, squeeze=False)
    for number, row in enumerate(rows):
        for column in range(2):
            ax = grid[number, column]
            if column == len(row):
                ax.set_axis_off()
                continue
            panel = row[column]
            _draw_cells(ax, panel.quantity, panel.cells, nodes, norm)
            if panel.heading:
                ax.set_title(panel.heading, size=SMALL, loc="right", pad=3, color=panel.colour, weight="bold")
                ax.set_yticklabels([plain(node) if column == 0 else "" for node in nodes])
    bar = figure.colorbar(ScalarMappable(norm, RMSE_MAP), ax=grid, fraction=0.025, pad=0.01, aspect=30)
    bar.set_label("RMSE [K]", size=TEXT)
    bar.ax.tick_params(labelsize=SMALL)


def _draw_cells(ax: Axes, quantity: str, cells: Sequence[Condition], nodes: Sequence[str], norm: Normalize) -> None:
    for row, node in enumerate(nodes):
        of_node = [cell for cell in cells if cell.node == node]
        for place, cell in enumerate(of_node):
            _draw_cell(ax, cell, place / len(of_node), row, 1.0 / len(of_node), norm)
    ax.set_xlim(0.0, 1.0)
    ax.set_ylim(len(nodes), 0.0)
    ax.set_xticks([])
    ax.set_yticks([row + 0.5 for row in range(len(nodes))], [plain(node) for node in nodes])
    ax.tick_params(length=0, labelsize=SMALL)
    ax.spines[:].set_visible(False)
    unit = "" if "[" in quantity else " [as logged]"
    ax.set_title(f"{quantity}{unit}, low to high", size=SMALL, loc="left", pad=3)


def _draw_cell(ax: Axes, cell: Condition, left: float, top: float, width: float, norm: Normalize) -> None:
    colour = RMSE_MAP(norm(cell.errors.rmse))
    luminance = 0.299 * colour[0] + 0.587 * colour[1] + 0.114 * colour[2]
    ink = "white" if luminance < _DARK else "black"
    ax.add_patch(Rectangle((left, top), width, 1.0, facecolor=colour, edgecolor="white", linewidth=1.0))
    middle = left + width / 2
    ax.text(middle, top + 0.32, significant(cell.errors.rmse, 2), ha="center", va="center", size=SMALL, color=ink)
    ends = f"{short(cell.lower)} to {short(cell.upper)}"
    ax.text(middle, top + 0.76, ends, ha="center", va="center", size=TINY, color=ink)


def comparison_figure(comparison: Comparison) -> Figure:
    """Measured and predicted [°C], error [K] in time, and RMSE [K] by operating condition, for one model.

    At most six nodes and runs are drawn in time: the worst.
    """
    chosen = worst_views(comparison)
    rows, nodes = _rows(comparison)
    above, below = _predictions_height(len(chosen)), _height(len(rows), len(nodes))
    figure = new_figure(above + below)
    if not rows:
        _draw_predictions(figure, chosen, comparison, None, NAMES)
        return figure
    upper, lower = figure.subfigures(2, 1, height_ratios=[above, below], squeeze=False)[:, 0]
    _draw_predictions(upper, chosen, comparison, None, NAMES)
    _draw_rows(lower, rows, nodes, _norm(comparison, [cell for row in rows for panel in row for cell in panel.cells]))
    return figure


# --- two models: who is better, by class of joints and by run -----------------------------------------------


def plot_pairs(
    pairs: Sequence[Pair], sizes: Sequence[tuple[float, float]], names: tuple[str, str], ax: Axes | None = None
) -> Axes:
    """Errors of two models side by side, as bars.

    Args:
        pairs: what is compared.
        sizes: both models' errors for each of them.
        names: of the two models.
        ax: where to draw; by default new axes.
    """
    ax = new_axes(0.9 + 0.32 * len(pairs)) if ax is None else ax
    places = np.arange(len(pairs))[::-1]
    # Hatching separates the two on a grey printer.
    styles = ((BEST["color"], "", 0.2), (GIVEN["color"], "////", -0.2))
    for which, (colour, hatch, shift) in enumerate(styles):
        values = [size[which] for size in sizes]
        bars = ax.barh(
            places + shift, values, 0.38, color=colour, hatch=hatch, edgecolor="white", label=plain(names[which])
        )
        ax.bar_label(bars, fmt="%.2f", padding=2, fontsize=SMALL)
    ax.set_yticks(places, [plain(pair.what) for pair in pairs], fontsize=SMALL)
    ax.margins(x=0.14)
    dress(ax)
    return ax


def versus_figure(result: Versus) -> Figure:
    """Mean absolute error by class and largest error by run, both models side by side."""
    figure = new_figure(1.9 + 0.32 * max(len(result.classes), len(result.runs)))
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.5))
    plot_pairs(result.classes, [pair.mean for pair in result.classes], result.names, left)
    plot_pairs(result.runs, [pair.max for pair in result.runs], result.names, right)
    left.set_xlabel("mean |predicted − measured| [K]", size=TEXT)
    right.set_xlabel("max |predicted − measured| [K]", size=TEXT)
    bars, names = left.get_legend_handles_labels()
    figure.legend(bars, names, frameon=False, fontsize=SMALL, loc="outside upper center", ncols=2)
    return figure
