"""Maps of nodes by time, of errors and of unexplained heat; one node's heat above the inputs that it goes with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path

from lptn.basics import style
from lptn.basics.arrays import FloatArray
from lptn.basics.lines import time_axis
from lptn.diagnose.learned_heat import LearnedCurve
from lptn.diagnose.unexplained_heat import HeatPeak, UnexplainedHeat
from lptn.logs.run import Run
from lptn.report.comparison_figures import NAMES
from lptn.report.shown import Field, InputLink, worst_runs
from lptn.report.text import for_people, unit_of

# --- maps of nodes by time: where and when a model fails, and where and when it lacks heat ------------------


_ROW, _FRAME, _LEGEND = 0.24, 0.65, 0.3  # inch: a node's row, what surrounds the rows of a map, the colours' meaning
_HATCHED = 0.2  # share of the colour scale from which blue is hatched, so that it can be told from red in grey


def plot_field(field: Field, most: float | None = None, ax: Axes | None = None) -> Axes:
    """One run's map of nodes by time: too much red, too little blue, hatched where that is clear, for a grey printer.

    Args:
        field: the values.
        most: the value that the strongest colours stand for; by default the largest.
        ax: where to draw; by default new axes.
    """
    ax = ax or style.new_axes(field_height(field))
    most = most or float(np.nanmax(np.abs(field.values), initial=0.0)) or 1.0
    rows, columns = field.values.shape
    edges, label = time_axis(field.start + field.seconds * np.arange(columns + 1))
    shares = np.sign(field.values) * np.vectorize(style.strength)(np.abs(field.values) / most)
    boxes: dict[float, list[list[tuple[float, float]]]] = {}  # of one strength; `inf` where nothing is known
    for row, own in enumerate(np.where(np.isfinite(shares), shares, np.inf)):
        starts = np.flatnonzero(np.append(True, own[1:] != own[:-1]))
        for start, stop in zip(starts, [*starts[1:], columns], strict=True):
            left, right, top, low = edges[start], edges[stop], row + 0.03, row + 0.97
            boxes.setdefault(float(own[start]), []).append([(left, top), (right, top), (right, low), (left, low)])
    for share, corners in boxes.items():
        if share:
            path = Path.make_compound_path(*(Path([*box, box[0]], closed=True) for box in corners))
            for patch in _colours(share):
                ax.add_patch(PathPatch(path, **patch))
    for row in range(rows):
        ax.axhline(row, color=style.RULE, linewidth=0.5, zorder=0)
    ax.set_xlim(edges[0], edges[-1])
    ax.set_ylim(rows, 0.0)
    ax.set_yticks([row + 0.5 for row in range(rows)], [style.plain(node) for node in field.nodes])
    style.dress(ax)
    ax.spines["left"].set_visible(False)
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel(label, size=style.SMALL)
    ax.set_title(style.plain(f"run {field.run}"), size=style.SMALL, loc="left", pad=3)
    return ax


_BOX: dict[str, Any] = {"linewidth": 0, "antialiased": False}  # no seams between neighbours


def _colours(share: float) -> list[dict[str, Any]]:
    """How boxes of a strength are filled, those of too little with hatching on top."""
    if np.isinf(share):
        return [_BOX | {"facecolor": style.RULE}]
    filled: list[dict[str, Any]] = [_BOX | {"facecolor": style.HOT if share > 0 else style.COLD, "alpha": abs(share)}]
    hatch: dict[str, Any] = {"fill": False, "hatch": "////", "edgecolor": style.PAPER, "linewidth": 0}
    return [*filled, hatch] if share < -_HATCHED else filled


def field_figures(given: Sequence[Field], best: Sequence[Field], unit: str, least: float) -> list[Figure]:
    """The worst runs of the given model, a figure each; the best model's beside them on one colour scale.

    Args:
        given: of the given model.
        best: of the best model on the same runs; empty where there is none.
        unit: of the values.
        least: what the colour scale reaches at least, so that noise stays pale.
    """
    chosen = worst_runs(given)
    heights = [field_height(given[place]) + _LEGEND * (place == chosen[-1]) for place in chosen]
    figures = [style.new_figure(height) for height in heights]
    draw_fields(figures, given, best, unit, least)
    return figures


def draw_fields(
    figures: Sequence[FigureBase],
    given: Sequence[Field],
    best: Sequence[Field],
    unit: str,
    least: float,
    names: tuple[str, str] = NAMES,
) -> None:
    """Draw the worst runs, one into each figure; arguments as for `field_figures`."""
    most = max(least, *(float(np.nanmax(np.abs(field.values), initial=0.0)) for field in [*given, *best])) or 1.0
    for figure, place in zip(figures, worst_runs(given), strict=False):
        axes = figure.subplots(1, 2 if best else 1, squeeze=False)[0]
        plot_field(given[place], most, axes[0])
        if best:
            plot_field(best[place], most, axes[1]).set_yticklabels([])
            for ax, heading, look in zip(axes, names, (style.GIVEN, style.BEST), strict=True):
                ax.set_title(heading, size=style.SMALL, loc="right", pad=3, color=look["color"], weight="bold")
    steps = (-1.0, -0.5, -0.25, 0.25, 0.5, 1.0)
    handles: list[Any] = [tuple(Patch(**patch) for patch in _colours(share)) for share in steps]
    values = [f"{share * most:+.2g} {unit}".replace("-", "−") for share in steps]
    figures[-1].legend(handles, values, loc="outside lower center", ncols=6, frameon=False, fontsize=style.SMALL)


def field_height(field: Field) -> float:
    """How high a map is drawn [inch]."""
    return _FRAME + _ROW * len(field.nodes)


# --- one node's unexplained heat over time, above the inputs that it goes with ------------------------------


HEAT, _INPUT = 2.3, 0.95
"""Height of axes of heat, and of the inputs below them [inch]."""


def plot_heat(
    given: UnexplainedHeat,
    node: str,
    best: UnexplainedHeat | None = None,
    peak: HeatPeak | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Unexplained heat [W] of a node over a run, with its 95 % band.

    Args:
        given: of the model as given.
        node: its name.
        best: of the best model in the same run.
        peak: the interval to shade.
        ax: where to draw; by default new axes.
    """
    ax = ax or style.new_axes(HEAT)
    unit = style.draw_over_time(ax, given.time - given.origin)
    _shade(ax, peak, unit)
    for heat, look, name in ((given, style.GIVEN, NAMES[0] if best else "model"), (best, style.BEST, NAMES[1])):
        if heat is not None and node in heat.nodes:
            row = heat.nodes.index(node)
            _band(ax, (heat.time - heat.origin) / unit, heat.heat[row], heat.sure_band[row], look, name)
    ax.set_title(style.plain(f"{node}, run {given.run}"), size=style.TEXT, loc="left", pad=3)
    return ax


def _shade(ax: Axes, peak: HeatPeak | None, unit: float) -> None:
    if peak is not None:
        ax.axvspan(peak.elapsed[0] / unit, peak.elapsed[1] / unit, color=style.SHADE, zorder=0, linewidth=0)


def _band(ax: Axes, x: FloatArray, heat: FloatArray, band: FloatArray, look: dict[str, Any], name: str) -> None:
    """Unexplained heat [W] with its 95 % band, and what they are called."""
    ax.fill_between(x, heat - band, heat + band, color=look["color"], alpha=0.2, linewidth=0)
    ax.plot(x, heat, **look | {"linewidth": 1.4, "label": f"{name} with its 95 % band"})
    ax.axhline(0.0, color=style.FAINT, linewidth=0.8)
    ax.set_ylabel("unexplained heat [W]", size=style.SMALL)
    ax.legend(frameon=False, fontsize=style.SMALL, loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2)
    style.dress(ax)


def heat_figure(
    run: Run,
    given: UnexplainedHeat,
    node: str,
    best: UnexplainedHeat | None = None,
    peak: HeatPeak | None = None,
    links: Sequence[InputLink] = (),
) -> Figure:
    """Heat [W] with its band at one node, and below it the inputs, in one run.

    Args:
        run: the run.
        given: the heat that the model as given lacks in it.
        node: the node.
        best: the heat that the best model lacks.
        peak: the interval to shade.
        links: the inputs to draw, closest first.
    """
    heights = [HEAT, *(_INPUT for _ in links)]
    figure = style.new_figure(sum(heights) + 0.3)
    axes = figure.subplots(len(heights), 1, squeeze=False, sharex=True, height_ratios=heights)[:, 0]
    plot_heat(given, node, best, peak, axes[0])
    ends = float(given.time[0] - given.origin), float(given.time[-1] - given.origin)
    inside = (run.elapsed >= ends[0]) & (run.elapsed <= ends[1])
    for above, ax, link in zip(axes, axes[1:], links, strict=False):
        above.set_xlabel("")
        line = run.columns[link.column][inside], {"color": style.INK, "linewidth": 0.7}
        _shade(ax, peak, style.draw_over_time(ax, run.elapsed[inside], [line], ends))
        ax.set_ylabel(f"[{unit_of(link.column)}]", size=style.SMALL)
        what = f"{link.column}, whose square" if link.squared else f"{link.column}, which"
        title = for_people(f"{what} correlates with the heat by {link.correlation:+.2f}")
        ax.set_title(style.plain(title), size=style.SMALL, loc="left", pad=2)
    figure.align_ylabels(axes)
    return figure


def plot_learned(curve: LearnedCurve, ax: Axes | None = None) -> Axes:
    """Unexplained heat [W] as a curve over the input that it goes with, with its 95 % band.

    Args:
        curve: of `lptn.diagnose.learned_heat`.
        ax: where to draw; by default new axes.
    """
    ax = ax or style.new_axes(HEAT)
    _band(ax, curve.values, curve.heat, curve.band, style.BEST, "learned")
    column = curve.inputs[0].column
    ax.set_xlabel(style.plain(f"{column} [{unit_of(column)}]"), size=style.SMALL)
    ax.set_title(style.plain(curve.inputs[0].node), size=style.TEXT, loc="left", pad=3)
    return ax
