"""The figure of where a model fails: RMSE by node and operating condition."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure, FigureBase
from matplotlib.patches import Rectangle

from lptn.compare import Comparison, Condition
from lptn.report.conditions import conditions_of
from lptn.report.style import BEST, GIVEN, RMSE_MAP, SMALL, TEXT, TINY, new_figure, plain, rmse_norm
from lptn.report.text import short, significant

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
