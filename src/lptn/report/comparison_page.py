"""A short page on one model against logs: where it fails, without a diagnosis."""

from __future__ import annotations

from lptn.compare import Comparison
from lptn.evidence import Evidence
from lptn.report import captions
from lptn.report.figures import comparison_figure
from lptn.report.page import picture, render
from lptn.report.tables import condition_table, data_table, error_table
from lptn.report.text import kelvin


def comparison_html(comparison: Comparison, title: str) -> str:
    """One self-contained HTML page on a comparison.

    Args:
        comparison: the result of `lptn.compare.compare`.
        title: heads the page, such as the model's name.

    Returns:
        HTML text; the same arguments give the same text.
    """
    everything = comparison.all
    return render(
        "comparison.html.j2",
        title=title,
        rmse=kelvin(everything.rmse),
        largest=kelvin(everything.max),
        figure=picture(captions.of_one_model(comparison), comparison_figure(comparison)),
        errors=error_table(comparison),
        conditions=condition_table(comparison),
        data=data_table(Evidence((), tuple(each.part for each in comparison.predictions))),
    )
