from .comparison_figures import comparison_figure as comparison_figure
from .comparison_figures import plot_conditions as plot_conditions
from .comparison_figures import plot_errors as plot_errors
from .comparison_figures import plot_temperatures as plot_temperatures
from .comparison_figures import predictions_figure as predictions_figure
from .comparison_figures import versus_figure as versus_figure
from .diagnosis_figures import diagnosis_figure as diagnosis_figure
from .diagnosis_figures import plot_detectability as plot_detectability
from .diagnosis_figures import plot_history as plot_history
from .fleet_figure import fleet_figure as fleet_figure
from .heat_figures import heat_figure as heat_figure
from .heat_figures import plot_field as plot_field
from .heat_figures import plot_heat as plot_heat
from .network_drawing import draw_network as draw_network
from .network_drawing import heat_flows as heat_flows
from .online_figures import forecast_figure as forecast_figure
from .online_figures import monitoring_figure as monitoring_figure
from .online_figures import plot_forecast as plot_forecast
from .online_figures import plot_monitored as plot_monitored
from .pages import comparison_html as comparison_html
from .pages import story_html as story_html
from .pages import versus_html as versus_html
from .planning_pages import plan_html as plan_html
from .planning_pages import trade_html as trade_html

__all__: list[str]
