"""Reports: one self-contained HTML page from a ladder or a comparison, and the figures in it."""

from lptn.report.comparison_page import comparison_html
from lptn.report.confusion import confusion
from lptn.report.detectability import detectability
from lptn.report.figures import comparison_figure
from lptn.report.heat_line import heat_line
from lptn.report.heatmap import error_maps
from lptn.report.in_short import Proposal
from lptn.report.ladder_curve import ladder_curve
from lptn.report.node_time import node_time_map
from lptn.report.notebook import show
from lptn.report.ranking import ranking
from lptn.report.story import story_html
from lptn.report.timeseries import predictions_figure
from lptn.report.versus_page import versus_figure, versus_html

__all__ = [
    "Proposal",
    "comparison_figure",
    "comparison_html",
    "confusion",
    "detectability",
    "error_maps",
    "heat_line",
    "ladder_curve",
    "node_time_map",
    "predictions_figure",
    "ranking",
    "show",
    "story_html",
    "versus_figure",
    "versus_html",
]
