"""Figures of a model against measurements: temperatures and errors in time, where it fails, two models' errors."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from math import ceil, sqrt
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from lptn.basics import style
from lptn.basics.arrays import FloatArray
from lptn.identify.comparison import Comparison, Condition, Pair, Prediction, Versus
from lptn.report.shown import MOST, NOISE_BAND, View, initialisation_end, worst_view, worst_views
from lptn.report.tables import conditions_by_quantity
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
    names: tuple[str, str] = NAMES,
) -> Axes:
    """Measured and predicted temperature [°C] of a node over a run; readings that set its start are shaded.

    Args:
        given: a model's comparison.
        node: its name; by default the node with the largest RMSE.
        run: the number of the run in the comparison; by default the node's worst.
        best: another model's comparison on the same runs.
        ax: where to draw; by default new axes.
        names: of the two models.

    Raises:
        InputError: the node is not measured there.
    """
    run, node = worst_view(given, node, run)
    alone, ax = ax is None, ax or style.new_axes(2.6)
    prediction = given.predictions[run]
    lines = [(prediction.bound.measured[given.model.nodes.index(node)], style.MEASURED | {"label": "measured"})]
    for comparison, look in _models(given, best, names):
        lines.append((comparison.predictions[run].readings[comparison.model.nodes.index(node)], look))
    _draw_over_run(ax, prediction, lines)
    if alone:
        ax.legend(frameon=False, fontsize=style.SMALL)
    ax.set_title(style.plain(f"{node}, run {prediction.segment.run.name}"), size=style.TEXT, loc="left", pad=3)
    ax.set_ylabel("temperature [°C]", size=style.SMALL)
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
    ax = ax or style.new_axes(2.0)
    band = NOISE_BAND * given.floor(node)
    ax.axhspan(-band, band, color=style.NOISE, linewidth=0, label="sensor noise")
    lines, errors = [], []
    for comparison, look in _models(given, best, NAMES):
        prediction = comparison.predictions[run]
        lines.append(
            (prediction.error[comparison.model.nodes.index(node)], look | {"linewidth": 0.8, "linestyle": "-"})
        )
        errors.append(kelvin(comparison.node(node, prediction).rmse))
    _draw_over_run(ax, given.predictions[run], lines)
    ax.set_title(f"RMSE {' → '.join(errors)}", size=style.SMALL, loc="right", pad=2)
    ax.set_ylabel(style.ERROR, size=style.SMALL)
    return ax


def _models(
    given: Comparison, best: Comparison | None, names: tuple[str, str]
) -> list[tuple[Comparison, dict[str, Any]]]:
    """One or two comparisons, each with the look of its lines and what they are called."""
    if best is None:
        return [(given, style.GIVEN | {"label": "model"})]
    called = [{"label": style.plain(name)} for name in names]
    return [(given, style.GIVEN | called[0]), (best, style.BEST | called[1])]


def _draw_over_run(ax: Axes, prediction: Prediction, lines: Sequence[tuple[FloatArray, dict[str, Any]]]) -> None:
    """Lines over a run's time, the initialisation window shaded."""
    elapsed = prediction.bound.run.elapsed
    unit = style.draw_over_time(ax, elapsed, lines)
    end = initialisation_end(prediction)
    if end is not None:
        ax.axvspan(elapsed[0] / unit, end / unit, color=style.SHADE, zorder=0, linewidth=0, label="initialisation")


_PANEL, _LEGEND = 2.9, 0.35  # inch
_LETTERS = 36  # that fit above one of three panels side by side


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
    figure = style.new_figure(predictions_height(len(chosen)))
    draw_predictions(figure, chosen, given, best, names)
    return figure


def predictions_height(count: int) -> float:
    """How high so many panels are drawn [inch]."""
    return _LEGEND + _PANEL * ceil(count / _columns(count))


def _columns(count: int) -> int:
    """Number of panels side by side, chosen so that few places stay empty."""
    return 2 if count in (2, 4) else min(count, 3)


def draw_predictions(
    figure: FigureBase, chosen: Sequence[View], given: Comparison, best: Comparison | None, names: tuple[str, str]
) -> None:
    """`predictions_figure` of chosen nodes and runs, within a figure."""
    columns = _columns(len(chosen))
    pairs = style.stacked_axes(figure, len(chosen), columns)
    for place, ((run, node), (upper, lower)) in enumerate(zip(chosen, pairs, strict=True)):
        plot_temperatures(given, node, run, best, upper, names).set_xlabel("")
        plot_errors(given, node, run, best, lower)
        most, title = _LETTERS * 3 // columns, f"{node}, run {given.predictions[run].segment.run.name}"
        title = title if len(title) <= most else f"{title[: most - 1]}…"
        upper.set_title(style.plain(title), size=style.TEXT, loc="left", pad=3)
        if place % columns:
            upper.set_ylabel("")
            lower.set_ylabel("")
    handles: list[Line2D | Patch] = [Line2D([], [], label="measured", **style.MEASURED)]
    handles += [Line2D([], [], **look) for _, look in _models(given, best, names)]
    if any(initialisation_end(prediction) is not None for prediction in given.predictions):
        handles.append(Patch(color=style.SHADE, label="initialisation"))
    handles.append(Patch(color=style.NOISE, label="sensor noise"))
    style.legend_above(figure, handles)


# --- where a model fails: RMSE by node and operating condition ----------------------------------------------


_ROW, _FRAME = 0.3, 0.35  # inch: a node's row, and what surrounds the rows of a map
_NOISE_IS_LIGHT = 2.0  # multiples of the noise up to which the scale of colours, which begins there, reaches at least
_ON_DARK = 0.55  # strength of a colour from which writing on it takes the paper's colour


def plot_conditions(
    comparison: Comparison, cells: Sequence[Condition], most: float | None = None, ax: Axes | None = None
) -> Axes:
    """RMSE [K] of each node in bins of an operating condition, from low to high; the stronger the colour, the larger.

    Args:
        comparison: the model's comparison.
        cells: of one quantity, as in `comparison.conditions()`.
        most: RMSE beyond the noise that the strongest colour stands for [K]; by default the largest of these cells.
        ax: where to draw; by default new axes.
    """
    nodes = list(dict.fromkeys(cell.node for cell in cells))
    ax = ax or style.new_axes(_FRAME + _ROW * len(nodes))
    most = most or _scale(comparison, cells)
    for row, node in enumerate(nodes):
        of_node = [cell for cell in cells if cell.node == node]
        width = 1.0 / len(of_node)
        for place, cell in enumerate(of_node):
            share = style.strength(_beyond_noise(comparison, cell) / most)
            ax.add_patch(Rectangle((place * width, row), width, 1.0, facecolor=style.BAD, alpha=share, linewidth=0))
            ink, middle = style.PAPER if share > _ON_DARK else style.INK, (place + 0.5) * width
            ends = f"{short(cell.lower)} to {short(cell.upper)}"
            for text, down, size in ((significant(cell.errors.rmse, 2), 0.32, style.SMALL), (ends, 0.76, style.TINY)):
                ax.text(middle, row + down, text, ha="center", va="center", size=size, color=ink, in_layout=False)
            if place:
                ax.plot([place * width] * 2, [row, row + 1], color=style.PAPER, linewidth=1.0)
    for row in range(1, len(nodes)):
        ax.axhline(row, color=style.PAPER, linewidth=1.0)
    ax.set_xlim(0.0, 1.0)
    ax.set_ylim(len(nodes), 0.0)
    ax.set_xticks([])
    ax.set_yticks([row + 0.5 for row in range(len(nodes))], [style.plain(node) for node in nodes])
    ax.tick_params(length=0, labelsize=style.SMALL)
    ax.spines[:].set_visible(False)
    unit = "" if "[" in cells[0].quantity else " [as logged]"
    ax.set_title(f"{cells[0].quantity}{unit}, low to high", size=style.SMALL, loc="left", pad=3)
    return ax


def condition_figures(given: Comparison, best: Comparison | None = None) -> list[Figure]:
    """Maps of RMSE [K] by node and operating condition, all on one scale of colours.

    Args:
        given: the given model's comparison.
        best: the best model's on the same runs.

    Returns:
        A figure for each quantity, the given model left and the best one right; without a best one, two quantities
        side by side. None where nothing can be sorted into bins.
    """
    rows, most = _condition_rows(given, best)
    figures = []
    for row in rows:
        figures.append(style.new_figure(_row_height(row)))
        axes = figures[-1].subplots(1, 2)
        _draw_row(axes, given, row, most)
        if best:
            axes[1].set_yticks([])
            for ax, heading, look in zip(axes, NAMES, (style.GIVEN, style.BEST), strict=True):
                ax.set_title(heading, size=style.SMALL, loc="right", pad=3, color=look["color"], weight="bold")
    return figures


_Row = Sequence[list[Condition]]
"""One or two maps side by side."""


def _condition_rows(given: Comparison, best: Comparison | None = None) -> tuple[list[_Row], float]:
    """The maps of both models, or of one alone, in rows of two; RMSE that the strongest colour stands for [K]."""
    left, right = conditions_by_quantity(given), conditions_by_quantity(best) if best else {}
    cells = [cell for of_quantity in (*left.values(), *right.values()) for cell in of_quantity]
    maps = list(left.values())
    rows: list[_Row] = [maps[place : place + 2] for place in range(0, len(maps), 2)]
    if best:
        rows = [(left[quantity], right[quantity]) for quantity in left if quantity in right]
    return rows, _scale(given, cells) if rows else 1.0


def _scale(comparison: Comparison, cells: Sequence[Condition]) -> float:
    least = _NOISE_IS_LIGHT * max(comparison.floor(cell.node) for cell in cells)
    return max(least, *(_beyond_noise(comparison, cell) for cell in cells))


def _beyond_noise(comparison: Comparison, cell: Condition) -> float:
    return sqrt(max(cell.errors.rmse**2 - comparison.floor(cell.node) ** 2, 0.0))


def _row_height(row: _Row) -> float:
    return _FRAME + _ROW * max(len({cell.node for cell in cells}) for cells in row)


def _draw_row(axes: Sequence[Axes], comparison: Comparison, row: _Row, most: float) -> None:
    for ax, cells in zip_longest(axes, row):
        if cells:
            plot_conditions(comparison, cells, most, ax)
        else:
            ax.set_axis_off()


def comparison_figure(comparison: Comparison) -> Figure:
    """Measured and predicted [°C], error [K] in time, and RMSE [K] by operating condition, for one model.

    At most six nodes and runs are drawn in time: the worst.
    """
    chosen = worst_views(comparison)
    rows, most = _condition_rows(comparison)
    heights = [predictions_height(len(chosen)), *map(_row_height, rows)]
    figure = style.new_figure(sum(heights))
    upper, *lower = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    draw_predictions(upper, chosen, comparison, None, NAMES)
    for below, row in zip(lower, rows, strict=True):
        _draw_row(below.subplots(1, 2), comparison, row, most)
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
    ax = ax or style.new_axes(0.9 + 0.32 * len(pairs))
    places = np.arange(len(pairs))[::-1]
    # Hatching separates the two on a grey printer.
    looks = ({"color": style.BEST["color"]}, {"color": style.GIVEN["color"], "hatch": "////"})
    for values, shift, look, name in zip(zip(*sizes, strict=True), (0.2, -0.2), looks, names, strict=True):
        bars = ax.barh(places + shift, values, 0.38, edgecolor=style.PAPER, label=style.plain(name), **look)
        ax.bar_label(bars, fmt="%.2f", padding=2, fontsize=style.SMALL)
    ax.set_yticks(places, [style.plain(pair.what) for pair in pairs], fontsize=style.SMALL)
    ax.margins(x=0.14)
    style.dress(ax)
    return ax


def versus_figure(result: Versus) -> Figure:
    """Mean absolute error by class and largest error by run, both models side by side."""
    rows = max(len(result.classes), len(result.runs))
    figure = style.new_figure(0.9 + 0.4 * rows)
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.5))
    plot_pairs(result.classes, [pair.mean for pair in result.classes], result.names, left)
    plot_pairs(result.runs, [pair.max for pair in result.runs], result.names, right)
    for ax, pairs in ((left, result.classes), (right, result.runs)):
        ax.set_ylim(len(pairs) - rows - 0.5, len(pairs) - 0.5)  # bars of both are as thick, and begin at the top
    left.set_xlabel("mean |predicted − measured| [K]", size=style.TEXT)
    right.set_xlabel("max |predicted − measured| [K]", size=style.TEXT)
    bars, names = left.get_legend_handles_labels()
    figure.legend(bars, names, frameon=False, fontsize=style.SMALL, loc="outside upper center", ncols=2)
    return figure
