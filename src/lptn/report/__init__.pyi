from .diagnosis_figures import confusion as confusion
from .diagnosis_figures import detectability as detectability
from .diagnosis_figures import ladder_curve as ladder_curve
from .diagnosis_figures import ranking as ranking
from .figures import comparison_figure as comparison_figure
from .figures import error_maps as error_maps
from .figures import predictions_figure as predictions_figure
from .heat_figures import heat_line as heat_line
from .heat_figures import node_time_map as node_time_map
from .pages import comparison_html as comparison_html
from .pages import story_html as story_html
from .pages import versus_figure as versus_figure
from .pages import versus_html as versus_html
from .words import Proposal as Proposal

__all__: list[str]
