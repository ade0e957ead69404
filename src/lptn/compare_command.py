"""`lptn compare`: a model against measurements, and against another model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter as Option

from lptn.cli_support import Json, Map, check_outputs, check_picture, needs_logs, write_figure


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
    from lptn.compare import compare as measured
    from lptn.evidence import evidence
    from lptn.files import write_whole
    from lptn.opening import open_model
    from lptn.report import comparison_figure, comparison_html
    from lptn.run_names import say_absent_runs
    from lptn.terminal import progress, show_comparison, write_json

    with progress("comparing"):
        opened = open_model(model, mapped)
        runs = opened.runs(logs)
        found = measured(opened.model, evidence((), runs).holdout)
    say_absent_runs(opened.model.network, runs)
    show_comparison(found)
    write_json(json, found.as_json())
    if plot is not None:
        write_figure(comparison_figure(found), plot)
    if report is not None:
        write_whole(report, comparison_html(found, opened.model.network.name))


def _versus(
    model: Path,
    logs: Sequence[Path],
    against: Path,
    json: Path | None,
    plot: Path | None,
    report: Path | None,
    mapped: list[str],
) -> None:
    from lptn.evidence import evidence
    from lptn.files import write_whole
    from lptn.opening import open_model
    from lptn.report import versus_figure, versus_html
    from lptn.terminal import progress, show_versus, write_json
    from lptn.versus import versus

    with progress("comparing"):
        one, other = open_model(model, mapped), open_model(against, mapped)
        parts = [evidence((), opened.runs(logs)).holdout for opened in (one, other)]
        found = versus(one.model, other.model, *parts)
    show_versus(found)
    write_json(json, found.model.as_json() | {"against": found.as_json()})
    if plot is not None:
        write_figure(versus_figure(found), plot)
    if report is not None:
        write_whole(report, versus_html(found, " against ".join(found.names)))
