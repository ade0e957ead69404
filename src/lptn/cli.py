"""The command `lptn`: a thin face on the library."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import cyclopts
from cyclopts import Parameter as Option
from cyclopts import validators

from lptn.cli_support import (
    AmbientError,
    Holdout,
    HoldoutAfter,
    Jobs,
    Json,
    Map,
    MirrorWeight,
    OptionalOutput,
    Output,
    Proof,
    check_outputs,
    executor_of,
    open_by_job,
    typed,
)
from lptn.compare_command import compare
from lptn.errors import InputError
from lptn.fmu.commands import cosim, fmu
from lptn.forecast_command import forecast
from lptn.interrupts import heard_interrupts
from lptn.monitor_command import monitor
from lptn.motor_command import motor
from lptn.planners.commands import plan, trade

app = cyclopts.App(
    name="lptn",
    help="Thermal networks of electric robot joints: fit, compare, and find the physical effect that is missing.",
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
    from lptn.files import write_whole
    from lptn.robots import preset_text, presets, variants

    if preset is None:
        for name in presets():
            print(name, *(f"{name} --model {other}" for other in variants(name)), sep="\n")
        return
    text = preset_text(preset, model)
    if output is None:
        print(text, end="")
    else:
        write_whole(output, text)


@app.command
def check(model: Path, /, *logs: Path, map: Map = None) -> None:  # noqa: A002 - the option's name
    """Say what a model file and logs hold, and what is wrong with them.

    Example: lptn check leg.toml monday.parquet
    """
    from lptn.opening import open_model
    from lptn.terminal import show_check

    opened = open_model(model, map or ())
    show_check(opened.model, opened.runs(logs))


@app.command
def fit(
    model: Path,
    /,
    *logs: Path,
    output: OptionalOutput = None,
    holdout: Holdout = None,
    holdout_after: HoldoutAfter = None,
    mirror_weight: MirrorWeight = 0.0,
    json: Json = None,
    map: Map = None,  # noqa: A002
) -> None:
    """Fit the free parameters; Ctrl-C keeps the best point so far.

    Example: lptn fit leg.toml monday.parquet --holdout friday.parquet -o fitted.toml
    """
    from lptn.on_evidence import fit_parts, holdout_errors, mirror_trials
    from lptn.terminal import progress, show_fit, show_holdout, show_mirror_trials, write_json

    check_outputs(output, json)
    opened, data = open_by_job(model, logs, holdout, holdout_after, None, map)
    if not opened.model.free:
        raise InputError(model, "parameters", "none that is free", "one at least without fixed = true")
    with progress("fitting") as report:
        trials = mirror_trials(opened.model, data, report=report) if mirror_weight == "auto" else []
        best = min(trials, key=lambda each: each.holdout.rmse) if trials else None
        done = fit_parts(
            opened.model,
            data.fit,
            best.fit.point if best else None,
            mirror_weight=best.weight if best else float(mirror_weight),
            progress=lambda number, rms: report(f"fitting: iteration {number}, weighted residual {rms:.4g}"),
        )
    held = holdout_errors(done, data.holdout)
    show_mirror_trials(trials)
    show_fit(done)
    show_holdout(held)
    if output is not None:
        opened.file.with_fit(done.table()).write(output)
    tried = [{"weight": each.weight, "rmse_holdout": each.holdout.rmse} for each in trials]
    write_json(json, done.as_json() | {"rmse_holdout": held.rmse if held else None, "mirror_weights": tried})


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
    from lptn.advice import advise
    from lptn.diagnose import diagnose as question
    from lptn.diagnose import for_search
    from lptn.terminal import progress, show_advice, show_diagnosis, write_json

    check_outputs(json)
    opened, data = open_by_job(model, logs, holdout, holdout_after, None, map)
    with progress("reading") as report, executor_of(jobs) as executor:
        found = question(opened.model, data, ambient_error=ambient_error, executor=executor, report=report)
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
    from lptn.adding import added
    from lptn.model_file import load_model

    added(load_model(model), effect, at).write(output)


@app.command
def improve(
    model: Path,
    /,
    *logs: Path,
    output: OptionalOutput = None,
    holdout: Holdout = None,
    holdout_after: HoldoutAfter = None,
    proof: Proof = None,
    rungs: Annotated[int, Option(help="Effects to add at most.", validator=validators.Number(gte=0))] = 6,
    ambient_error: AmbientError = 0.0,
    json: Json = None,
    report: Annotated[Path | None, Option(help="HTML report to write.")] = None,
    jobs: Jobs = 1,
    map: Map = None,  # noqa: A002
) -> None:
    """Diagnose, add the missing effect, refit, until nothing is missing; print the ladder.

    Example: lptn improve leg.toml monday.parquet --holdout friday.parquet -o better.toml --report story.html
    """
    from lptn.advice import advise
    from lptn.diagnose import for_search
    from lptn.files import write_whole
    from lptn.ladder import improve as climb
    from lptn.terminal import progress, show_advice, show_ladder, write_json

    check_outputs(output, json, report)
    opened, data = open_by_job(model, logs, holdout, holdout_after, proof, map)
    with progress("reading") as say, executor_of(jobs) as executor:
        ladder = climb(opened.model, data, most=rungs, ambient_error=ambient_error, executor=executor, report=say)
        advice = advise(ladder.first, ladder.last.fit, for_search(data), say)
    show_ladder(ladder)
    show_advice(advice)
    if output is not None:
        opened.file.with_effects(ladder.declarations()).with_fit(ladder.best.fit.table()).write(output)
    write_json(json, ladder.as_json() | advice.as_json())
    if report is not None:
        from lptn.report import story_html

        page = story_html(ladder, data, opened.model.network.name, (typed(),), advice.experiment)
        write_whole(report, page)


@app.command
def effects(key: str | None = None, /) -> None:
    """List the catalogue of effects, or show one.

    Example: lptn effects forced_convection
    """
    from lptn.terminal import show_effects

    show_effects(key)


@app.command
def simulate(model: Path, log: Path, /, *, output: Output, map: Map = None) -> None:  # noqa: A002
    """Predict a log's temperatures and write them as a log (.csv or .parquet).

    Example: lptn simulate fitted.toml friday.parquet -o predicted.csv
    """
    from lptn.compare import compare as against
    from lptn.evidence import evidence
    from lptn.opening import open_model
    from lptn.predicted_log import write_predictions

    opened = open_model(model, map or ())
    write_predictions(against(opened.model, evidence((), opened.runs([log])).holdout), output)


@app.command
def report(
    model: Path,
    /,
    *logs: Path,
    output: Output,
    holdout: Holdout = None,
    holdout_after: HoldoutAfter = None,
    proof: Proof = None,
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
        proof=proof,
        report=output,
        jobs=jobs,
        map=map,
    )


for _command in (compare, forecast, monitor, fmu, cosim, trade, plan, motor):
    app.command(_command)


def _say(message: object) -> None:
    """One line on the error stream; nothing is imported, for it may be said in the middle of an import."""
    print(f"lptn: {' '.join(str(message).split())}", file=sys.stderr)


def main(words: Sequence[str] | None = None) -> None:
    """Run the command line; a user's mistake is one line and exit status 2.

    Args:
        words: what stands behind `lptn`; by default what the shell gave.
    """
    try:
        with heard_interrupts():
            app(sys.argv[1:] if words is None else words, exit_on_error=False, print_error=False)
    except InputError as error:
        _say(error)
        sys.exit(2)
    except cyclopts.CycloptsError as error:
        _say(f"{error} (`lptn --help` shows how)")
        sys.exit(2)
    except KeyboardInterrupt:
        _say("stopped; nothing was written")
        sys.exit(130)


if __name__ == "__main__":
    main()
