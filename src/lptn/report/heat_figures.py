"""Maps of nodes by time, of errors and of unexplained heat; one node's heat above the inputs that it goes with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from lptn.basics.arrays import FloatArray
from lptn.basics.style import (
    BEST,
    FAINT,
    GIVEN,
    INK,
    SHADE,
    SMALL,
    TEXT,
    decimated,
    dress,
    new_axes,
    new_figure,
    plain,
    time_axis,
)
from lptn.diagnose.unexplained_heat import HeatPeak, UnexplainedHeat
from lptn.logs.run import Run
from lptn.report.shown import Field, InputLink, worst_runs
from lptn.report.text import for_people, unit_of

# --- maps of nodes by time: where and when a model fails, and where and when it lacks heat ------------------


_ROW, _FRAME = 0.24, 0.75  # inch: a node's row, and what surrounds the rows of a map
_LEAST = 1.6  # inch; what the colour bar's label needs
_HATCHED = 0.2  # share of the colour scale from which blue is hatched, so that it can be told from red in grey
_DEEP = 2.5  # multiples of that from which the hatching must be white to be seen
_BOTH: Colormap = colormaps["RdBu_r"].with_extremes(bad="0.8")  # red for more, blue for less, grey for unknown


def plot_field(field: Field, norm: Normalize | None = None, ax: Axes | None = None) -> Axes:
    """One run's map of nodes by time; what is clearly negative is hatched, for a grey printer.

    Args:
        field: the values.
        norm: the colour scale; by default one of this field.
        ax: where to draw; by default new axes.
    """
    ax = new_axes(_height(field)) if ax is None else ax
    norm = norm or _norm([field], 0.0)
    ends = np.array([field.start, field.start + field.seconds * field.values.shape[1]])
    (first, last), label = time_axis(ends)
    rows = len(field.nodes)
    extent = (first, last, rows, 0.0)
    ax.imshow(field.values, aspect="auto", extent=extent, cmap=_BOTH, norm=norm, interpolation="nearest")
    _hatch(ax, field, (first, last), _HATCHED * float(norm.vmin or 0.0))
    for row in range(1, rows):
        ax.axhline(row, color="white", linewidth=1.0)
    ax.set_yticks([row + 0.5 for row in range(rows)], [plain(node) for node in field.nodes])
    ax.tick_params(labelsize=SMALL)
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel(label, size=SMALL)
    ax.set_title(plain(f"run {field.run}"), size=SMALL, loc="left", pad=3)
    return ax


def fields_figure(given: Sequence[Field], best: Sequence[Field], label: str, least: float) -> Figure:
    """The worst runs of the given model, above each other; the best model's beside them on one colour scale.

    Args:
        given: of the given model.
        best: of the best model on the same runs; empty where there is none.
        label: of the colour bar, with its unit.
        least: what the colour scale reaches at least, so that noise stays pale.
    """
    chosen = worst_runs(given)
    heights = [_height(given[place]) for place in chosen]
    figure = new_figure(max(sum(heights), _LEAST))
    grid = figure.subplots(len(chosen), 2 if best else 1, squeeze=False, height_ratios=heights)
    norm = _norm([*given, *best], least)
    for axes, place in zip(grid, chosen, strict=True):
        plot_field(given[place], norm, axes[0])
        if best:
            plot_field(best[place], norm, axes[1]).set_yticklabels([])
            for ax, heading, style in zip(axes, ("model as given", "best model"), (GIVEN, BEST), strict=True):
                ax.set_title(heading, size=SMALL, loc="right", pad=3, color=style["color"], weight="bold")
    bar = figure.colorbar(ScalarMappable(norm, _BOTH), ax=grid, fraction=0.025, pad=0.01, aspect=20)
    bar.set_label(label, size=SMALL)
    bar.ax.tick_params(labelsize=SMALL)
    return figure


def _height(field: Field) -> float:
    return _FRAME + _ROW * len(field.nodes)


def _norm(fields: Sequence[Field], least: float) -> Normalize:
    largest = max(least, *(float(np.nanmax(np.abs(field.values), initial=0.0)) for field in fields))
    return Normalize(-largest, largest)


def _hatch(ax: Axes, field: Field, span: tuple[float, float], below: float) -> None:
    width = (span[1] - span[0]) / field.values.shape[1]
    for row, values in enumerate(field.values):
        low = np.concatenate([[False], values < below, [False]]).astype(np.int8)
        edges = np.flatnonzero(np.diff(low)).reshape(-1, 2)
        for start, stop in edges:
            ink = "white" if float(np.mean(values[start:stop])) < _DEEP * below else "0.25"
            corner = (span[0] + start * width, row)
            ax.add_patch(
                Rectangle(corner, (stop - start) * width, 1.0, fill=False, hatch="///", edgecolor=ink, linewidth=0)
            )


# --- one node's unexplained heat over time, above the inputs that it goes with ------------------------------


_HEAT, _INPUT = 2.3, 0.95  # inch


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
    ax = new_axes(_HEAT) if ax is None else ax
    unit, label = _time_unit(given.time)
    if peak is not None:
        ax.axvspan(peak.elapsed[0] / unit, peak.elapsed[1] / unit, color=SHADE, zorder=0)
    for heat, style, name in ((given, GIVEN, "model as given" if best else "model"), (best, BEST, "best model")):
        if heat is not None and node in heat.nodes:
            row = heat.nodes.index(node)
            low, high = heat.heat[row] - heat.sure_band[row], heat.heat[row] + heat.sure_band[row]
            ax.fill_between((heat.time - heat.origin) / unit, low, high, color=style["color"], alpha=0.18, linewidth=0)
            line: dict[str, Any] = style | {"linewidth": 1.4, "label": f"{name} with its 95 % band"}
            ax.plot((heat.time - heat.origin) / unit, heat.heat[row], **line)
    ax.axhline(0.0, color=FAINT, linewidth=0.8)
    ax.set_ylabel("unexplained heat [W]", size=SMALL)
    ax.set_xlabel(label, size=SMALL)
    ax.set_xlim((given.time[0] - given.origin) / unit, (given.time[-1] - given.origin) / unit)
    ax.set_title(plain(f"{node}, run {given.run}"), size=TEXT, loc="left", pad=3)
    ax.legend(frameon=False, fontsize=SMALL, loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2)
    dress(ax)
    return ax


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
    heights = [_HEAT, *(_INPUT for _ in links)]
    figure = new_figure(sum(heights) + 0.3)
    axes = figure.subplots(len(heights), 1, squeeze=False, sharex=True, height_ratios=heights)[:, 0]
    label = plot_heat(given, node, best, peak, axes[0]).get_xlabel()
    unit, _ = _time_unit(given.time)
    for ax, link in zip(axes[1:], links, strict=True):
        if peak is not None:
            ax.axvspan(peak.elapsed[0] / unit, peak.elapsed[1] / unit, color=SHADE, zorder=0)
        ax.plot(*decimated(run.elapsed / unit, run.columns[link.column]), color=INK, linewidth=0.7)
        ax.set_ylabel(f"[{unit_of(link.column)}]", size=SMALL)
        what = f"{link.column}, whose square" if link.squared else f"{link.column}, which"
        title = for_people(f"{what} correlates with the heat by {link.correlation:+.2f}")
        ax.set_title(plain(title), size=SMALL, loc="left", pad=2)
        dress(ax)
    axes[0].set_xlabel("")
    axes[-1].set_xlabel(label, size=SMALL)
    figure.align_ylabels(axes)
    return figure


def _time_unit(time: FloatArray) -> tuple[float, str]:
    """Seconds in a unit of the time axis, and the axis label."""
    label = time_axis(time)[1]
    return 60.0 if label.endswith("[min]") else 1.0, label
