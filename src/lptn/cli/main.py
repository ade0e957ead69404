"""The command `lptn`: a thin face on the library."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import cyclopts
from cyclopts import Parameter as Option
from cyclopts import validators

from lptn.basics.errors import InputError, one_line
from lptn.basics.processes import heard_interrupts
from lptn.cli.check import check
from lptn.cli.compare import compare
from lptn.cli.completion import install_completion
from lptn.cli.fit import fit
from lptn.cli.fmu import cosim, fmu
from lptn.cli.forecast import forecast
from lptn.cli.monitor import monitor
from lptn.cli.motor import motor
from lptn.cli.options import (
    AmbientError,
    Holdout,
    HoldoutAfter,
    Jobs,
    Json,
    Map,
    OptionalOutput,
    Output,
    Test,
    check_outputs,
    executor_of,
    open_by_job,
    typed,
)
from lptn.cli.planners import plan, trade
from lptn.cli.terminal import spared_closed_pipes

app = cyclopts.App(
    name="lptn",
    help="""Thermal networks of electric robot joints: fit, compare, and find the physical effect that is missing.

    Example: lptn improve leg.toml monday.parquet --holdout friday.parquet -o better.toml --report story.html""",
    help_format="plaintext",
    suppress_keyboard_interrupt=False,  # `main` says what becomes of the files
)


@app.command
def new(
    preset: str | None = None,
    /,
    *,
    model: Annotated[str | None, Option(help="Another model of the same robot, such as single-node.")] = None,
    output: OptionalOutput = None,
) -> None:
    """Write a ready model file; without a name, list them.

    Example: lptn new quadruped --model single-node -o baseline.toml
    """
    from lptn.basics.files import write_whole
    from lptn.robots.presets import preset_text, presets, variants

    if preset is None:
        for name in presets():
            print(name, *(f"{name} --model {other}" for other in variants(name)), sep="\n")
        return
    text = preset_text(preset, model)
    if output is None:
        print(text, end="")
    else:
        write_whole(output, text)


app.command(check)
app.command(fit)


@app.command
def diagnose(
    model: Path,
    /,
    *logs: Path,
    holdout: Holdout = None,
    holdout_after: HoldoutAfter = None,
    ambient_error: AmbientError = 0.0,
    json: Json = None,
    jobs: Jobs = 1,
    map: Map = None,  # noqa: A002
) -> None:
    """Say which effect is missing, where, how sure, and what else would look the same.

    Example: lptn diagnose leg.toml monday.parquet --holdout friday.parquet --json found.json
    """
    from lptn.cli.terminal import progress, show_advice, show_diagnosis, write_json
    from lptn.diagnose.advice import advise
    from lptn.diagnose.diagnosis import diagnose as question
    from lptn.diagnose.diagnosis import for_search

    check_outputs(json, inputs=(model, *logs, *(holdout or ())))
    loaded, data = open_by_job(model, logs, holdout, holdout_after, None, map)
    with progress("reading") as report, executor_of(jobs) as executor:
        found = question(loaded.model, data, ambient_error=ambient_error, executor=executor, report=report)
        advice = advise(found, found.fit, for_search(data), report)
    show_diagnosis(found)
    show_advice(advice)
    write_json(json, found.as_json() | advice.as_json())


@app.command
def add(
    model: Path,
    effect: str,
    /,
    *,
    at: Annotated[str, Option(help='Node, edge "a~b", pattern such as "*_calf", or "*".')],
    output: Output,
) -> None:
    """Add an effect to a model file, at its typical size.

    Example: lptn add leg.toml forced_convection --at "*" -o next.toml
    """
    from lptn.model.file import added, read_model_file

    added(read_model_file(model), effect, at).write(output)


@app.command
def improve(
    model: Path,
    /,
    *logs: Path,
    output: OptionalOutput = None,
    holdout: Holdout = None,
    holdout_after: HoldoutAfter = None,
    test: Test = None,
    steps: Annotated[
        int, Option(name=["--steps", "--rungs"], help="Effects to add at most.", validator=validators.Number(gte=0))
    ] = 6,
    ambient_error: AmbientError = 0.0,
    json: Json = None,
    report: Annotated[Path | None, Option(help="HTML report to write.")] = None,
    jobs: Jobs = 1,
    map: Map = None,  # noqa: A002
) -> None:
    """Diagnose, add the missing effect, refit, until nothing is missing; print the ladder.

    Example: lptn improve leg.toml monday.parquet --holdout friday.parquet -o better.toml --report story.html
    """
    from lptn.basics.files import write_whole
    from lptn.cli.terminal import progress, show_advice, show_ladder, show_written, write_json
    from lptn.diagnose.advice import advise
    from lptn.diagnose.diagnosis import for_search
    from lptn.diagnose.improvement import improve as climb

    check_outputs(output, json, report, inputs=(*logs, *(holdout or ()), *(test or ())))
    check_outputs(json, report, inputs=(model,))  # only the better model may take its place
    loaded, data = open_by_job(model, logs, holdout, holdout_after, test, map)
    with progress("reading") as say, executor_of(jobs) as executor:
        history = climb(loaded.model, data, most=steps, ambient_error=ambient_error, executor=executor, report=say)
        advice = advise(history.first, history.last.fit, for_search(data), say)
    show_ladder(history)
    show_advice(advice)
    if output is not None:
        loaded.file.with_effects(history.declarations()).with_fit(history.best.fit.table()).write(output)
    write_json(json, history.as_json() | advice.as_json())
    if report is not None:
        from lptn.report.pages import story_html

        page = story_html(history, data, loaded.model.network.name, (typed(),), advice.experiment)
        write_whole(report, page)
    show_written({"the best model": output, "the story; open it in a browser": report})


@app.command
def effects(
    key: str | None = None,
    /,
    *,
    markdown: Annotated[Path | None, Option(help="Write the whole catalogue as a page of Markdown.")] = None,
    json: Json = None,
) -> None:
    """List the catalogue of effects, or show one.

    Example: lptn effects forced_convection
    """
    from lptn.cli.effects import catalogue_json, show_effects
    from lptn.cli.terminal import write_json

    check_outputs(markdown, json)
    if markdown is None or key is not None:
        show_effects(key)
    write_json(json, catalogue_json(key))
    if markdown is None:
        return
    from lptn.basics.files import write_whole
    from lptn.cli.effects import catalogue_markdown

    write_whole(markdown, catalogue_markdown())


@app.command
def simulate(model: Path, log: Path, /, *, output: Output, json: Json = None, map: Map = None) -> None:  # noqa: A002
    """Predict a log's temperatures and write them as a log (.csv or .parquet).

    Example: lptn simulate fitted.toml friday.parquet -o predicted.csv
    """
    from lptn.cli.terminal import progress, write_json
    from lptn.identify.comparison import check_ending, write_predictions
    from lptn.identify.comparison import compare as against
    from lptn.identify.data import load_model, split_data

    check_outputs(output, json, inputs=(model, log))
    check_ending(output)
    with progress("predicting"):
        loaded = load_model(model, map or ())
        predicted = against(loaded.model, split_data((), loaded.runs([log])).holdout)
        write_predictions(predicted, output)
    write_json(json, predicted.as_json())


@app.command
def report(
    model: Path,
    /,
    *logs: Path,
    output: Output,
    holdout: Holdout = None,
    holdout_after: HoldoutAfter = None,
    test: Test = None,
    jobs: Jobs = 1,
    map: Map = None,  # noqa: A002
) -> None:
    """Tell the whole story in one HTML file: log, fit, where it fails, what is missing, proof.

    Example: lptn report leg.toml monday.parquet --holdout friday.parquet -o story.html
    """
    improve(
        model,
        *logs,
        holdout=holdout,
        holdout_after=holdout_after,
        test=test,
        report=output,
        jobs=jobs,
        map=map,
    )


for _command in (compare, forecast, monitor, fmu, cosim, trade, plan, motor):
    app.command(_command)
app.command(install_completion, name="--install-completion")


def _say(message: object) -> None:
    """One line on the error stream; nothing is imported, for it may be said in the middle of an import."""
    print(f"lptn: {one_line(message)}", file=sys.stderr)


def main(words: Sequence[str] | None = None) -> None:
    """Run the command line; a user's mistake is one line and exit status 2.

    Args:
        words: what stands behind `lptn`; by default what the shell gave.
    """
    try:
        with spared_closed_pipes(), heard_interrupts():
            app(sys.argv[1:] if words is None else words, exit_on_error=False, print_error=False)
    except InputError as error:
        _say(error)
        sys.exit(2)
    except cyclopts.CycloptsError as error:
        _say(f"{error} (`lptn --help` shows how)")
        sys.exit(2)
    except OSError as error:  # the system's, not the user's: a full disk, a folder that went away
        _say(f"{error.filename or 'system'}: {error.strerror or error}")
        sys.exit(2)
    except MemoryError:
        _say("not enough memory")
        sys.exit(2)
    except KeyboardInterrupt:
        _say("stopped; nothing was written")
        sys.exit(130)


if __name__ == "__main__":
    main()
