"""One figure of a model against measurements: temperatures, errors, and where it fails."""

from __future__ import annotations

from matplotlib.figure import Figure

from lptn.compare import Comparison
from lptn.report.heatmap import draw_maps, map_height, map_rows, nodes_of, norm_of
from lptn.report.style import new_figure
from lptn.report.timeseries import MOST, draw_predictions, panels_height, worst_views


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
