"""The command `lptn compare`: a model against measurements, and against another model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter as Option

from lptn.cli.options import (
    COLUMNS,
    Columns,
    Details,
    Json,
    Picture,
    check_inputs,
    check_outputs,
    needs_logs,
    write_figure,
)

if TYPE_CHECKING:
    from lptn.identify.comparison import Comparison, Versus

_WORST = 6  # rows of a table in the answer; the details have all


def compare(
    model: Path,
    /,
    *logs: Path,
    against: Annotated[Path | None, Option(help="Model file to compare with, on the same logs.")] = None,
    details: Details = False,
    json: Json = None,
    plot: Picture = None,
    report: Annotated[Path | None, Option(help="HTML report to write.")] = None,
    columns: Columns = COLUMNS,
) -> None:
    """Predict logs, and show the errors.

    With --against: how much better the model predicts them than another.

    Example: lptn compare fitted.toml friday.parquet --plot friday.png

    Example: lptn compare whole-body.toml friday.parquet --against single-nodes.toml --report versus.html
    """
    needs_logs(logs)
    check_outputs(json, report, pictures=[plot], inputs=(model, *logs, *(() if against is None else (against,))))
    check_inputs(model, *logs)
    from lptn.basics.files import write_whole
    from lptn.cli.terminal import is_quiet, progress, write_json
    from lptn.identify.comparison import Versus
    from lptn.study import Study

    with progress("reading"):
        studies = [Study(file, holdout=logs, columns=columns.texts) for file in (model, against) if file is not None]
    with progress("comparing"):
        result = studies[0].compare(*studies[1:])
    print(result.narrative())
    if isinstance(result, Versus):
        if not is_quiet():
            _show_versus(result)
        write_json(json, result.model.as_json() | {"against": result.as_json()})
    else:
        if not is_quiet():
            _show_comparison(result, details)
        write_json(json, result.as_json())
    if plot is not None:
        from lptn.report.comparison_figures import comparison_figure, versus_figure

        write_figure(versus_figure(result) if isinstance(result, Versus) else comparison_figure(result), plot)
    if report is not None:
        from lptn.report.pages import comparison_html, versus_html

        if isinstance(result, Versus):
            write_whole(report, versus_html(result, " against ".join(result.names)))
        else:
            write_whole(report, comparison_html(result, studies[0].model.network.name))


def _show_comparison(comparison: Comparison, details: bool) -> None:
    """Errors by run and node, and among the details the conditions in which the model fails worst."""
    from lptn.cli.terminal import show_table
    from lptn.report.tables import condition_table, error_table

    table = error_table(comparison, None if details else _WORST)
    show_table(table.columns, table.rows)
    worst = condition_table(comparison)
    if worst.rows and details:
        show_table(worst.columns, worst.rows, "Worst by operating condition:")
    print("error = predicted − measured; noise alone: RMSE from sensor noise alone.")


def _show_versus(result: Versus) -> None:
    """Two models' errors by class of nodes and by run."""
    from lptn.cli.terminal import show_table
    from lptn.report.tables import versus_table

    print(f"Errors (predicted − measured) of {' / '.join(result.names)}, and the reduction of the largest:")
    classes = result.classes[:1] if len(result.classes) == 2 else result.classes  # of one class and all
    runs = result.runs if len(result.runs) > 1 else []  # errors of one run are those of all nodes
    for what, pairs in (("nodes", classes), *([("run", runs)] if runs else [])):
        table = versus_table(what, pairs)
        show_table(table.columns, table.rows)
