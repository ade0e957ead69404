"""A short page on one model against logs: where it fails, without a diagnosis."""

from __future__ import annotations

from lptn.compare import Comparison
from lptn.evidence import Evidence
from lptn.report import captions
from lptn.report.heatmap import error_maps
from lptn.report.page import picture, render
from lptn.report.tables import condition_table, data_table, error_table
from lptn.report.text import kelvin
from lptn.report.timeseries import predictions_figure


def comparison_html(comparison: Comparison, title: str) -> str:
    """One self-contained HTML page on a comparison.

    Args:
        comparison: the result of `lptn.compare.compare`.
        title: heads the page, such as the model's name.

    Returns:
        HTML text; the same arguments give the same text.
    """
    everything, parts = comparison.all, tuple(each.part for each in comparison.predictions)
    maps = error_maps(comparison)
    return render(
        "comparison.html.j2",
        title=title,
        rmse=kelvin(everything.rmse),
        largest=kelvin(everything.max),
        predictions=picture(
            captions.of_predictions(comparison, None, Evidence(()), "compared"), predictions_figure(comparison)
        ),
        maps=picture(captions.of_maps(comparison, None, "compared"), *maps) if maps else None,
        errors=error_table(comparison),
        conditions=condition_table(comparison),
        data=data_table({"compared": parts}),
    )
