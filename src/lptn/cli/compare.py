"""`lptn compare`: a model against measurements, and against another model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter as Option

from lptn.cli.options import Json, Map, check_outputs, check_picture, needs_logs, write_figure


def compare(
    model: Path,
    /,
    *logs: Path,
    against: Annotated[Path | None, Option(help="Another model file, to predict the same logs with.")] = None,
    json: Json = None,
    plot: Annotated[Path | None, Option(help="Picture to write: .png, .svg or .pdf.")] = None,
    report: Annotated[Path | None, Option(help="HTML report to write.")] = None,
    map: Map = None,  # noqa: A002 - the option's name
) -> None:
    """Predict logs and show where the model fails, or how much better it is than another.

    Example: lptn compare fitted.toml friday.parquet --plot friday.png

    Example: lptn compare whole-body.toml friday.parquet --against single-nodes.toml --report versus.html
    """
    needs_logs(logs)
    check_outputs(json, plot, report, inputs=(model, *logs, *(() if against is None else (against,))))
    check_picture(plot)
    if against is None:
        _alone(model, logs, json, plot, report, map or [])
    else:
        _versus(model, logs, against, json, plot, report, map or [])


def _alone(
    model: Path, logs: Sequence[Path], json: Path | None, plot: Path | None, report: Path | None, mapped: list[str]
) -> None:
    from lptn.basics.files import write_whole
    from lptn.cli.terminal import progress, show_comparison, write_json
    from lptn.identify.comparison import compare as measured
    from lptn.identify.data import load_model, say_absent_runs, split_data
    from lptn.report.figures import comparison_figure
    from lptn.report.pages import comparison_html

    with progress("comparing"):
        loaded = load_model(model, mapped)
        runs = loaded.runs(logs)
        found = measured(loaded.model, split_data((), runs).holdout)
    say_absent_runs(loaded.model.network, runs)
    show_comparison(found)
    write_json(json, found.as_json())
    if plot is not None:
        write_figure(comparison_figure(found), plot)
    if report is not None:
        write_whole(report, comparison_html(found, loaded.model.network.name))


def _versus(
    model: Path,
    logs: Sequence[Path],
    against: Path,
    json: Path | None,
    plot: Path | None,
    report: Path | None,
    mapped: list[str],
) -> None:
    from lptn.basics.files import write_whole
    from lptn.cli.terminal import progress, show_versus, write_json
    from lptn.identify.comparison import versus
    from lptn.identify.data import load_model, split_data
    from lptn.report.pages import versus_figure, versus_html

    with progress("comparing"):
        one, other = load_model(model, mapped), load_model(against, mapped)
        parts = [split_data((), loaded.runs(logs)).holdout for loaded in (one, other)]
        found = versus(one.model, other.model, *parts)
    show_versus(found)
    write_json(json, found.model.as_json() | {"against": found.as_json()})
    if plot is not None:
        write_figure(versus_figure(found), plot)
    if report is not None:
        write_whole(report, versus_html(found, " against ".join(found.names)))
