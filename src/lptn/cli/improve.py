"""The command `lptn improve`: diagnose, add, refit, step by step."""

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
    ambient_error: AmbientError = None,
    torque_error: TorqueError = None,
    surface_error: SurfaceError = None,
    json: Json = None,
    report: Annotated[Path | None, Option(help="HTML report to write.")] = None,
    jobs: Jobs = 1,
    map: Map = None,  # noqa: A002 - the option's name
    rate: Rate = None,
) -> None:
    """Diagnose, add the missing effect, refit, until nothing is missing; print the history of steps.

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
    """The steps, from the model as given to the best."""
    from lptn.cli.terminal import show_table
    from lptn.report.outcome import headline, left_in_words
    from lptn.report.text import for_people, kelvin
    from lptn.report.words import removed_in_words, size_in_words

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
    print(headline(history))
    if len(history.steps) > 1:
        print(left_in_words(history))
    print(_who_chose(history))
    for number, step in enumerate(history.steps):
        if step.effect and step.at:
            size = size_in_words(step, history.best.fit)
            text = f"Step {number}, {in_words([(step.effect, step.at)])}: {_sure(history, number)}."
            own = [text, f"Its {size}." if size else "", removed_in_words(history, number)]
            print(for_people(" ".join(filter(None, own))))
    if len(history.steps) > 1:
        print("Probable: beside the other steps, and that nothing is missing.")
    for warning in history.best.fit.uncertainty.warnings:
        print(f"Warning: {warning}.")


def _sure(history: History, number: int) -> str:
    """How sure a step is, and what else it might be; without a full stop."""
    from lptn.report.text import percent

    step = history.steps[number]
    if not step.probability:
        return "chosen by hand, and not compared with others"
    text = f"{percent(step.probability)} probable"
    return text + (f"; it may be {in_words(step.indistinguishable)}" if step.indistinguishable else "")


def _who_chose(history: History) -> str:
    """Which data chose the steps, and which only test them."""
    if history.searched_from is None:
        text = "Which effects were added, somebody chose."
    elif len(history.steps) == 1:
        text = "Nothing is missing more probably than not."
    else:
        text = f"The fitted data chose, among {history.considered} models."
        if not history.steps[0].holdout:
            text += " No data were held out: nothing tests the choice."
    return text
