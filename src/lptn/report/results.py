"""What a study returns in a notebook: a comparison or a forecast with its sentences and its figure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from lptn.basics.tables import rows_html
from lptn.identify.comparison import Comparison, Versus
from lptn.report.narrative import comparison_narrative, forecast_narrative, versus_narrative
from lptn.report.sentences import Narrative

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from lptn.online.forecasting import Forecast


class _Told:
    """A result that notebooks show by its sentences."""

    narrative: Callable[[], Narrative]

    def _repr_html_(self) -> str:
        return self.narrative()._repr_html_()


@dataclass(frozen=True, repr=False)
class StudyComparison(_Told, Comparison):
    """A model against measurements, with its sentences and its figure.

    Args:
        as_given: compares the model as given on the same runs, where it is another.
    """

    as_given: Callable[[], Comparison] | None = None

    def narrative(self) -> Narrative:
        """How far the model is off and where most, in the sentences of terminal and report."""
        return comparison_narrative(self)

    def _repr_html_(self) -> str:
        return super()._repr_html_() + rows_html(self.to_pandas())

    def plot(self, node: str | None = None, ax: Axes | None = None) -> Axes:
        """Draw measured and predicted temperatures [°C] of one node over time, the model as given beside the one now.

        Args:
            node: its name; by default the node and run with the largest RMSE.
            ax: where to draw the temperatures alone; by default a new figure of pyplot's, with the errors [K] below.

        Returns:
            The axes of the temperatures.

        Raises:
            InputError: no such node, or it is measured in none of the runs.
        """
        from lptn.basics.style import SMALL, new_panels
        from lptn.report.comparison_figures import plot_errors, plot_temperatures
        from lptn.report.shown import worst_view

        run, node = worst_view(self, node)
        given, best = (self.as_given(), self) if self.as_given else (self, None)
        upper, *lower = new_panels(2.4, 1.4) if ax is None else [ax]
        plot_temperatures(given, node, run, best, upper, ("model as given", "model now"))
        for below in lower:
            upper.set_xlabel("")
            upper.legend(frameon=False, fontsize=SMALL)
            plot_errors(given, node, run, best, below)
        return upper


class StudyVersus(_Told, Versus):
    """A model against another, with its sentences."""

    def narrative(self) -> Narrative:
        """Which model predicts better, in the sentences of terminal and report."""
        return versus_narrative(self)


class StudyForecast(_Told):
    """Temperatures to come, with their sentences and their figure.

    Args:
        result: the forecast.
    """

    def __init__(self, result: Forecast) -> None:
        self.result = result

    def __repr__(self) -> str:
        return repr(self.result)

    def narrative(self) -> Narrative:
        """Which node reaches its limit first, and when, in the sentences of the terminal."""
        return forecast_narrative(self.result)

    def plot(self, node: str | None = None, ax: Axes | None = None) -> Axes:
        """Draw a node's readings so far, its temperatures [°C] to come with their interval, and its limit.

        Args:
            node: its name; by default the first to reach its limit.
            ax: where to draw; a new figure of pyplot's by default.
        """
        from lptn.report.online_figures import plot_forecast

        return plot_forecast(self.result, node or self.result.soonest[0].node, ax=ax)
