"""The command `lptn compare`: a model against measurements, and against another model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from lptn import report as drawn
from lptn.cli import options
from lptn.cli.terminal import is_quiet, progress, show_table, write_json

if TYPE_CHECKING:
    from lptn.identify.comparison import Comparison, Versus
    from lptn.report.tables import ReportTable


def compare(
    model: Path,
    /,
    *logs: Path,
    against: Path | None = None,
    details: options.Details = False,
    json: options.Json = None,
    plot: options.Picture = None,
    report: options.Report = None,
    columns: options.Columns = options.COLUMNS,
) -> None:
    """Predict logs, and show the errors.

    With --against: how much better the model predicts them than another.

    Example: lptn compare fitted.toml friday.parquet --plot friday.png

    Example: lptn compare whole-body.toml friday.parquet --against single-nodes.toml --report versus.html

    Args:
        against: Model file to compare with, on the same logs.
    """
    options.needs_logs(logs)
    options.check_outputs(
        json, report, pictures=[plot], inputs=(model, *logs, *(() if against is None else (against,)))
    )
    options.check_inputs(model, *logs)
    from lptn.identify.comparison import Versus
    from lptn.study import Study

    with progress("reading"):
        studies = [Study(file, holdout=logs, columns=columns.texts) for file in (model, against) if file is not None]
    with progress("comparing"):
        result = studies[0].compare(*studies[1:])
    print(result.narrative())
    if not is_quiet():
        for title, table in _tables(result, details):
            show_table(*table, title, None if details else options.ROWS)
    if isinstance(result, Versus):
        write_json(json, result.model.as_json() | {"against": result.as_json()})
        options.write_figure(plot, lambda: drawn.versus_figure(result))
        options.write_page(report, lambda: drawn.versus_html(result, " against ".join(result.names)))
    else:
        write_json(json, result.as_json())
        options.write_figure(plot, lambda: drawn.comparison_figure(result))
        options.write_page(report, lambda: drawn.comparison_html(result, studies[0].model.network.name))


def _tables(result: Comparison | Versus, details: bool) -> list[tuple[str, ReportTable]]:
    """Errors by run and node, or two models' by class of nodes and by run, each with the line above it."""
    from lptn.identify.comparison import Versus
    from lptn.report.tables import condition_table, error_table, versus_table

    if isinstance(result, Versus):
        title = f"Errors (predicted − measured) of {' / '.join(result.names)}, and the reduction of the largest:"
        classes = result.classes[:1] if len(result.classes) == 2 else result.classes  # of one class and all
        tables = [(title, versus_table("nodes", classes))]
        # Errors of one run are those of all nodes.
        return [*tables, ("", versus_table("run", result.runs))] if len(result.runs) > 1 else tables
    title = "Errors (predicted − measured), and the RMSE that sensor noise alone would leave:"
    tables, worst = [(title, error_table(result, None if details else options.ROWS))], condition_table(result)
    return [*tables, ("Worst by operating condition:", worst)] if details and worst.rows else tables
