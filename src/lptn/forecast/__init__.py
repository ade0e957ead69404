"""Time until a temperature limit, with its uncertainty, if the robot goes on as it does."""

from lptn.forecast.forecasting import forecast
from lptn.forecast.gait import Gait, find_gait
from lptn.forecast.knowledge import Knowledge
from lptn.forecast.result import Forecast, NodeForecast, Window

__all__ = ["Forecast", "Gait", "Knowledge", "NodeForecast", "Window", "find_gait", "forecast"]
