"""Reports: one self-contained HTML page from a ladder or a comparison, and the figures in it."""

from lptn.report.comparison_page import comparison_html
from lptn.report.figures import comparison_figure
from lptn.report.heatmap import error_maps
from lptn.report.ladder_curve import ladder_curve
from lptn.report.ranking import ranking
from lptn.report.story import story_html
from lptn.report.timeseries import predictions_figure
from lptn.report.versus_page import versus_figure, versus_html

__all__ = [
    "comparison_figure",
    "comparison_html",
    "error_maps",
    "ladder_curve",
    "predictions_figure",
    "ranking",
    "story_html",
    "versus_figure",
    "versus_html",
]
