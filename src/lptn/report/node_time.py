"""Maps of nodes by time: where and when a model fails, and where and when it lacks heat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from lptn.arrays import FloatArray
from lptn.compare import Comparison
from lptn.diagnose.unexplained_heat import UnexplainedHeat
from lptn.report.style import BEST, GIVEN, SMALL, TEXT, new_figure, plain, time_axis

MOST_RUNS = 4
"""Runs in one figure."""
_ROW, _FRAME = 0.24, 0.75  # inch: a node's row, and what surrounds the rows of a map
_LEAST = 1.6  # inch; what the colour bar's label needs
_COLUMNS = 150  # blocks of time in one map
_HATCHED = 0.2  # share of the colour scale from which blue is hatched, so that it can be told from red in grey
_DEEP = 2.5  # multiples of that from which the hatching must be white to be seen
_BOTH: Colormap = colormaps["RdBu_r"].with_extremes(bad="0.8")  # red for more, blue for less, grey for not known


@dataclass(frozen=True)
class Field:
    """One run's values at each node over time.

    Args:
        run: its name.
        start: of the first block in the log's clock [s].
        seconds: length of a block.
        nodes: the rows.
        values: shape (nodes, blocks), NaN where not known.
    """

    run: str
    start: float
    seconds: float
    nodes: tuple[str, ...]
    values: FloatArray


def error_fields(comparison: Comparison) -> list[Field]:
    """Predicted minus measured [K] of each run where it counts, means over blocks of time."""
    found = []
    for prediction in comparison.predictions:
        error, run = prediction.error, prediction.part.run
        rows = np.flatnonzero(np.isfinite(error).any(axis=1))
        counted = np.flatnonzero(np.isfinite(error).any(axis=0))
        first, length = int(counted[0]), int(counted[-1] - counted[0]) + 1
        size = max(1, length // _COLUMNS)
        split = error[rows, first : first + length // size * size].reshape(len(rows), -1, size)
        known = np.isfinite(split)
        total = np.where(known, split, 0.0).sum(axis=2)
        means = np.where(known.any(axis=2), total / np.maximum(known.sum(axis=2), 1), np.nan)
        nodes = tuple(comparison.model.nodes[row] for row in rows)
        found.append(Field(run.name, float(run.time[first]), size * run.step, nodes, means))
    return found


def heat_fields(found: Sequence[UnexplainedHeat]) -> list[Field]:
    """Unexplained heat [W] of each run, 0 where zero lies within its band."""
    return [
        Field(
            each.run,
            float(each.time[0] - each.seconds / 2),
            each.seconds,
            each.nodes,
            np.where(np.abs(each.heat) > each.band, each.heat, 0.0),
        )
        for each in found
    ]


def node_time_map(given: Sequence[Field], best: Sequence[Field], label: str, least: float) -> Figure:
    """The worst runs of the given model, above each other; the best model's beside them on one colour scale.

    Args:
        given: of the given model.
        best: of the best model on the same runs; empty where there is none.
        label: of the colour bar, with its unit.
        least: what the colour scale reaches at least, so that noise stays pale.
    """
    chosen = worst_runs(given)
    columns = 2 if best else 1
    heights = [_FRAME + _ROW * len(given[place].nodes) for place in chosen]
    figure = new_figure(max(sum(heights), _LEAST))
    grid = figure.subplots(len(chosen), columns, squeeze=False, height_ratios=heights)
    norm = _norm([*given, *best], least)
    headed = (("model as given", GIVEN["color"], given), ("best model", BEST["color"], best))
    for row, place in enumerate(chosen):
        for column in range(columns):
            heading, colour, fields = headed[column]
            ax = grid[row, column]
            _draw(ax, fields[place], norm, labelled=column == 0)
            if best:
                ax.set_title(heading, size=SMALL, loc="right", pad=3, color=colour, weight="bold")
    bar = figure.colorbar(ScalarMappable(norm, _BOTH), ax=grid, fraction=0.025, pad=0.01, aspect=20)
    bar.set_label(label, size=TEXT)
    bar.ax.tick_params(labelsize=SMALL)
    return figure


def worst_runs(fields: Sequence[Field]) -> list[int]:
    """Numbers of the runs with the largest values, in the order of the runs."""
    order = sorted(range(len(fields)), key=lambda place: -float(np.nanmean(fields[place].values ** 2)))
    return sorted(order[:MOST_RUNS])


def _hatch(ax: Axes, field: Field, span: tuple[float, float], below: float) -> None:
    """Lines over what is clearly negative: blue and red are one grey on a grey printer."""
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


def _norm(fields: Sequence[Field], least: float) -> Normalize:
    largest = max(float(np.nanmax(np.abs(field.values), initial=0.0)) for field in fields)
    return Normalize(-max(largest, least), max(largest, least))


def _draw(ax: Axes, field: Field, norm: Normalize, *, labelled: bool) -> None:
    ends = np.array([field.start, field.start + field.seconds * field.values.shape[1]])
    (first, last), label = time_axis(ends)
    rows = len(field.nodes)
    ax.imshow(
        field.values, aspect="auto", extent=(first, last, rows, 0.0), cmap=_BOTH, norm=norm, interpolation="nearest"
    )
    ax.set_yticks([row + 0.5 for row in range(rows)], [plain(node) if labelled else "" for node in field.nodes])
    _hatch(ax, field, (first, last), _HATCHED * float(norm.vmin or 0.0))
    for row in range(1, rows):
        ax.axhline(row, color="white", linewidth=1.0)
    ax.tick_params(labelsize=SMALL)
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel(label, size=SMALL)
    ax.set_title(plain(f"run {field.run}"), size=SMALL, loc="left", pad=3)
