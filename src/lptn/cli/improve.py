"""The command `lptn improve`: diagnose, add, refit."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter as Option
from cyclopts import validators

from lptn.cli import options
from lptn.cli.diagnose import show_advice
from lptn.cli.terminal import progress, show_table, show_written, write_json

if TYPE_CHECKING:
    from lptn.diagnose.advice import Advice
    from lptn.diagnose.improvement import History
    from lptn.identify.data import DataSplit


def improve(
    model: Path,
    /,
    *logs: Path,
    output: options.OptionalOutput = None,
    data: options.Data = options.DATA,
    test: options.Test = None,
    steps: Annotated[int, Option(validator=validators.Number(gte=0))] = 6,
    details: options.Details = False,
    json: options.Json = None,
    report: options.Report = None,
    jobs: options.Jobs = 1,
) -> None:
    """Find the missing effects, add them and refit.

    Prints the verdict, what was added, the errors, and what to do next.

    Example: lptn improve leg.toml monday.parquet --holdout friday.parquet -o better.toml --report story.html

    Args:
        steps: Largest number of findings to add; structure is not counted.
    """
    options.needs_logs(logs)
    options.check_outputs(output, json, report, inputs=(*logs, *(data.holdout or ()), *(test or ())))
    options.check_outputs(json, report, inputs=(model,))  # only the better model may take its place
    options.check_inputs(model, *logs, *(data.holdout or ()), *(test or ()))
    with progress("reading"), options.executor_of(jobs) as executor:
        study = data.opening(model, logs, test).study(executor)
        study.improve(steps)
        history, advice = study.selection(), study.advise()
    print(study.narrative())
    if details:
        show_details(history, study.data, advice)
    if output is not None:
        study.save(output)
    write_json(json, history.as_json() | advice.as_json())
    if report is not None:
        study.report(report, (shlex.join(["lptn", *sys.argv[1:]]),))
    show_written({"the best model": output, "open it in a browser": report})


def show_details(history: History, data: DataSplit, advice: Advice) -> None:
    """The table of steps, what stands behind it, what the fit warns of, and all advice."""
    from lptn.report.narrative import details
    from lptn.report.tables import history_table

    print()
    table = history_table(history)
    show_table(*table)
    for sentence in (
        *details(history, data),
        *(f"Warning: {warning}." for warning in history.best.fit.uncertainty.warnings),
    ):
        print(sentence)
    show_advice(advice)
