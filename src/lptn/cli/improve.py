"""The command `lptn improve`: diagnose, add, refit, step by step."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter as Option
from cyclopts import validators

from lptn.cli.diagnose import VERDICTS, as_json, show_advice, show_ambient_bias
from lptn.cli.options import (
    AmbientError,
    Holdout,
    HoldoutAfter,
    Jobs,
    Json,
    Map,
    OptionalOutput,
    Test,
    check_outputs,
    executor_of,
    needs_logs,
    typed,
)

if TYPE_CHECKING:
    from lptn.diagnose.improvement import History

Steps = Annotated[
    int, Option(name=["--steps", "--rungs"], help="Effects to add at most.", validator=validators.Number(gte=0))
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
    ambient_error: AmbientError = 0.0,
    json: Json = None,
    report: Annotated[Path | None, Option(help="HTML report to write.")] = None,
    jobs: Jobs = 1,
    map: Map = None,  # noqa: A002 - the option's name
) -> None:
    """Diagnose, add the missing effect, refit, until nothing is missing; print the history of steps.

    Example: lptn improve leg.toml monday.parquet --holdout friday.parquet -o better.toml --report story.html
    """
    from lptn.cli.terminal import progress, show_written, write_json
    from lptn.study import Study

    needs_logs(logs)
    check_outputs(output, json, report, inputs=(*logs, *(holdout or ()), *(test or ())))
    check_outputs(json, report, inputs=(model,))  # only the better model may take its place
    with progress("reading"), executor_of(jobs) as executor:
        study = Study(
            model,
            logs,
            holdout or (),
            test or (),
            holdout_after=holdout_after,
            columns=map or (),
            ambient_error=ambient_error,
            executor=executor,
        )
        study.improve(steps)
        history, advice = study.selection(), study.advise()
        heat = study.unexplained_stretches()
    show_history(history)
    show_advice(advice, heat)
    if output is not None:
        study.save(output)
    write_json(json, history.as_json() | advice.as_json() | as_json(heat, history.steps))
    if report is not None:
        study.report(report, (typed(),))
    show_written({"the best model": output, "the story; open it in a browser": report})


def show_history(history: History) -> None:
    """The steps, from the model as given to the best."""
    from lptn.cli.terminal import show_table
    from lptn.report.text import capitalised, kelvin, named
    from lptn.report.verdict import certainties, of_given_model, of_held_out_data, of_last_model, sizes_added

    tested = any(step.test for step in history.steps)
    rows = []
    for number, step in enumerate(history.steps):
        at = "* (everywhere)" if step.at == "*" else step.at or ""
        errors = [step.fit.rmse, *((step.holdout.rmse, step.holdout.max) if step.holdout else (None, None))]
        errors += [step.test.rmse if step.test else None] if tested else []
        row = (str(number), step.effect or "(as given)", at, str(step.parameters), *map(kelvin, errors))
        rows.append(row)
    heads = ("step", "effect", "at", ">parameters", ">fit", ">held out", ">max held out")
    show_table((*heads, ">test") if tested else heads, rows)
    print(f"fit, held out{', test' if tested else ''}: RMSE on these data; max: the largest error.")
    print(f"The model as given is {VERDICTS[history.verdict]}.")
    print(f"{capitalised(of_given_model(history))}.")
    if len(history.steps) > 1:
        text = f"With all that was added, {of_last_model(history)}"
        better = "predicts the held-out runs better" if history.best.holdout else "is more probable"
        more = f", but none of the longer models that were tried {better}"
        print(f"{text}{more if history.remaining == 'missing' else ''}.")
    show_ambient_bias(history.best.fit)
    sizes, sure = sizes_added(history), certainties(history)
    for number, step in enumerate(history.steps):
        if step.effect and step.at:
            print(f"Step {number}, {named(*step.key)}: {sure[step.key]}.")
            if step.key in sizes:
                print(f"  Its size: {sizes[step.key].text()}.")
    print(of_held_out_data(history) or "No data were held out, so nothing tests the result.")
    for warning in history.best.fit.uncertainty.warnings:
        print(f"Warning: {warning}.")
