"""The command `lptn improve`: diagnose, add, refit, step by step."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter as Option
from cyclopts import validators

from lptn.cli.diagnose import in_words, show_advice, show_what_runs_have_of_their_own
from lptn.cli.options import (
    AmbientError,
    Holdout,
    HoldoutAfter,
    Jobs,
    Json,
    Map,
    OptionalOutput,
    Rate,
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
    from lptn.diagnose.diagnosis import LIKELY
    from lptn.report.outcome import headline, left_in_words
    from lptn.report.text import for_people, kelvin, percent
    from lptn.report.words import outweighed_in_words, removed_in_words, size_in_words

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
    show_what_runs_have_of_their_own(history.best.fit, history.differing)
    added = {step.key for step in history.steps}
    for number, step in enumerate(history.steps):
        if step.effect and step.at:
            # What was added as well, later or before, is no other name for it any more.
            others = [key for key in step.indistinguishable if key not in added]
            likeliest = max(history.first.refits, key=lambda each: each.probability, default=step)
            share = percent(step.probability)
            if number == 1 and likeliest.probability > step.probability:
                share += f", {in_words([likeliest.key])} {percent(likeliest.probability)}"
            if not step.probability:
                sentence = "chosen by hand, and not compared with others"
            elif others and step.probability < LIKELY:
                sentence = f"the fitted data alone leave several answers open (this one {share}), among them "
                sentence += in_words(others) + ("; the held-out data chose it" if step.holdout else "")
            else:
                sentence = f"by the fitted data {share} probable; "
                if others:
                    sentence += f"they don't rule out {in_words(others)}"
                elif step.indistinguishable:
                    sentence += "what explains the fitted data as well was added, too"
                elif step.outweighed:
                    sentence += outweighed_in_words(step)
                else:
                    sentence += "nothing else in the catalogue explains the fitted data as well"
            size = size_in_words(step, history.best.fit)
            text = f"Step {number}, {in_words([(step.effect, step.at)])}: {sentence}."
            own = [text, f"Its {size}." if size else "", removed_in_words(history, number)]
            print(for_people(" ".join(filter(None, own))))
    if any(step.probability for step in history.steps):
        print("Probable: given that one of the answers that were refitted at that step is right.")
    for warning in history.best.fit.uncertainty.warnings:
        print(f"Warning: {warning}.")


def _who_chose(history: History) -> str:
    """Which data chose the steps, and which only test them."""
    text = "Effects were chosen on the fitted data."
    if history.searched_from is None:
        text = "Which effects were added, somebody chose."
    elif history.considered == 1:
        text = "No effect was proposed beyond chance."
    elif history.steps[0].holdout:
        text += f" Held-out data chose among {history.considered} models that were tried, and where to end."
    else:
        text += " No data were held out: the steps end by Schwarz's criterion, and nothing tests them."
    return text + (" Test data chose nothing." if history.steps[0].test else "")
