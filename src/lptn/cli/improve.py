"""The command `lptn improve`: diagnose, add, refit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter as Option
from cyclopts import validators

from lptn.cli.diagnose import in_words, show_advice
from lptn.cli.options import (
    AmbientError,
    Holdout,
    HoldoutAfter,
    Jobs,
    Json,
    Map,
    OptionalOutput,
    Rate,
    SurfaceError,
    Test,
    TorqueError,
    check_inputs,
    check_outputs,
    column_options,
    executor_of,
    needs_logs,
    typed,
)

if TYPE_CHECKING:
    from lptn.diagnose.answers import Step
    from lptn.diagnose.improvement import History

Steps = Annotated[
    int,
    Option(name="--steps", help="Findings to add at most, beside structure.", validator=validators.Number(gte=0)),
]


def improve(
    model: Path,
    /,
    *logs: Path,
    output: OptionalOutput = None,
    holdout: Holdout = None,
    holdout_after: HoldoutAfter = None,
    test: Test = None,
    steps: Steps = 6,
    ambient_error: AmbientError = None,
    torque_error: TorqueError = None,
    surface_error: SurfaceError = None,
    json: Json = None,
    report: Annotated[Path | None, Option(help="HTML report to write.")] = None,
    jobs: Jobs = 1,
    map: Map = None,  # noqa: A002 - the option's name
    rate: Rate = None,
) -> None:
    """Find what the model lacks, add it, refit; print the steps: what is wrong, then what every part has.

    Example: lptn improve leg.toml monday.parquet --holdout friday.parquet -o better.toml --report story.html
    """
    needs_logs(logs)
    check_outputs(output, json, report, inputs=(*logs, *(holdout or ()), *(test or ())))
    check_outputs(json, report, inputs=(model,))  # only the better model may take its place
    check_inputs(model, *logs, *(holdout or ()), *(test or ()))
    from lptn.cli.terminal import progress, show_written, write_json
    from lptn.study import Study

    with progress("reading"), executor_of(jobs) as executor:
        study = Study(
            model,
            logs,
            holdout or (),
            test or (),
            holdout_after=holdout_after,
            columns=column_options(map, rate),
            ambient_error=ambient_error,
            torque_error=torque_error,
            surface_error=surface_error,
            executor=executor,
        )
        study.improve(steps)
        history, advice = study.selection(), study.advise()
    show_history(history)
    show_advice(advice, history.remaining)
    if output is not None:
        study.save(output)
    write_json(json, history.as_json() | advice.as_json())
    if report is not None:
        study.report(report, (typed(),))
    show_written({"the best model": output, "the story; open it in a browser": report})


def show_history(history: History) -> None:
    """The steps, from the model as given to the best, the errors, and what the data can't tell apart."""
    from lptn.cli.terminal import show_table
    from lptn.report.outcome import headline, left_in_words
    from lptn.report.text import kelvin, size_told

    tested = any(step.test for step in history.steps)
    rows = []
    for number, step in enumerate(history.steps):
        what = step.key if step.effect else ("(as given)", "")
        size = size_told(step, history.best.fit), _sure(step)
        errors = [step.fit.rmse, step.holdout.rmse if step.holdout else None]
        errors += [step.test.rmse if step.test else None] if tested else []
        rows.append((str(number), *what, *size, *map(kelvin, errors)))
    heads = ("step", "effect", "at", "size", ">probable", ">fit", ">held out")
    show_table((*heads, ">test") if tested else heads, rows)
    print(headline(history))
    if len(history.steps) > 1:
        print(left_in_words(history))
        if not history.steps[0].holdout:
            print("No data were held out: nothing tests the choice.")
    for number, step in enumerate(history.steps):
        if step.indistinguishable:
            print(f"Step {number} can't be told from {in_words(step.indistinguishable)}.")
    for warning in history.best.fit.uncertainty.warnings:
        print(f"Warning: {warning}.")


def _sure(step: Step) -> str:
    """How probable a step is, short enough for a column; nothing of what somebody chose."""
    from lptn.report.text import percent

    return percent(step.probability).replace("more than", ">").replace("less than", "<") if step.probability else ""
