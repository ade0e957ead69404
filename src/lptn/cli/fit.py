"""The command `lptn fit`: one robot, or each robot of a fleet on its own."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter as Option
from cyclopts import validators

from lptn.basics.errors import InputError
from lptn.basics.words import FEW, count_of
from lptn.cli.options import HELD_OUT, Details, HeldOut, Json, SymmetryPenalty, check_inputs, check_outputs, needs_logs

if TYPE_CHECKING:
    from lptn.fleet.fleet import Fleet
    from lptn.fleet.work import Outcome
    from lptn.identify.fitting import Checkpoint

Each = Annotated[
    list[Path] | None,
    Option(
        help="Fit each robot on its own: a log file, a folder of one robot's logs, or a folder of such folders.",
        consume_multiple=True,
    ),
]
FitJobs = Annotated[int, Option(help="With --each: number of processes.", validator=validators.Number(gte=1))]
FitOutput = Annotated[
    Path | None, Option(name=["--output", "-o"], help="File to write the model to; with --each, a folder.")
]


def fit(
    model: Path,
    /,
    *logs: Path,
    output: FitOutput = None,
    each: Each = None,
    held: HeldOut = HELD_OUT,
    symmetry_penalty: SymmetryPenalty = 0.0,
    details: Details = False,
    json: Json = None,
    jobs: FitJobs = 1,
) -> None:
    """Fit the free parameters of a model.

    Ctrl-C keeps the best point so far; the same command continues from it.

    With --each, each robot is fitted on its own: a model for each and a table of all are written into the folder.
    A robot that can't be fitted is named in one line, and the exit status is 1.

    Example: lptn fit leg.toml monday.parquet --holdout friday.parquet -o fitted.toml

    Example: lptn fit leg.toml --each logs/* -o fleet --jobs 8
    """
    if each is not None:
        _fit_each(model, logs, each, output, held, symmetry_penalty, details, json, jobs)
        return
    if jobs > 1:
        raise InputError("command line", "--jobs", "no --each beside it", "one process for one fit")
    needs_logs(logs)
    holdout = held.holdout or []
    check_outputs(output, json, inputs=(*logs, *holdout))
    check_outputs(json, inputs=(model,))  # only the fitted model may take its place
    check_inputs(model, *logs, *holdout)
    from lptn.cli.terminal import is_quiet, progress, show_table, show_written, write_json
    from lptn.identify.fitting import Checkpoint, fingerprint_of
    from lptn.report.narrative import fit_narrative
    from lptn.report.tables import parameter_table
    from lptn.report.text import kelvin
    from lptn.study import Study

    with progress("reading"):
        study = Study(model, logs, holdout, holdout_after=held.holdout_after, columns=held.texts)
    given, segments = study.model, study.data.fit
    if not given.free:
        raise InputError(model, "parameters", "none that is free", "one at least without fixed = true")
    digests = [(segment.run.name, segment.run.fingerprint) for segment in segments]
    text, options = study.file.text, {"map": held.texts, "holdout_after": held.holdout_after}

    def checkpoint(penalty: float) -> Checkpoint:
        kept = Checkpoint(fingerprint_of(text, digests, options | {"mirror_weight": penalty}))
        if kept.load(given, len(segments)) is not None:
            print("This fit was stopped before; it continues from the best saved point.")
        return kept

    with progress("fitting"):
        done = study.fit(symmetry_penalty=symmetry_penalty, checkpoint=checkpoint)
    held_out, most, trials = study.steps[-1].holdout, None if details else FEW, study.symmetry_trials
    print(fit_narrative(study.steps[-1], most))
    if not is_quiet():
        if trials:
            rows = [(f"{one.symmetry_penalty:g}", kelvin(one.fit.rmse), kelvin(one.holdout.rmse)) for one in trials]
            show_table((">symmetry penalty", ">fit", ">held out"), rows)
        if most is not None and len(done.free) > most:
            print(f"The {most} least certain of {len(done.free)} parameters:")
        table = parameter_table(done, most=most)
        kept = [place for place, head in enumerate(table.columns) if head != "what it is"]
        show_table([table.columns[place] for place in kept], [[row[place] for place in kept] for row in table.rows])
    if output is not None:
        study.save(output)
    show_written({"the fitted model": output})
    tried = [{"weight": trial.symmetry_penalty, "rmse_holdout": trial.holdout.rmse} for trial in trials]
    more = {"rmse_holdout": held_out.rmse if held_out else None, "symmetry_trials": tried}
    write_json(json, done.as_json() | more)


# --- each robot of a fleet --------------------------------------------------------------------------------


def _fit_each(
    model: Path,
    logs: tuple[Path, ...],
    places: list[Path],
    output: Path | None,
    held: HeldOut,
    symmetry_penalty: float | Literal["auto"],
    details: bool,
    json: Path | None,
    jobs: int,
) -> None:
    from lptn.cli.terminal import complain, progress, write_json
    from lptn.fleet.fleet import fit_each, write_tables
    from lptn.fleet.robots import robots_of
    from lptn.identify.data import load_model

    if logs or held.holdout:
        beside = "LOGS" if logs else "--holdout"
        raise InputError("command line", "--each", f"{beside} beside it", "all logs behind --each, or no --each")
    folder = _folder(output)
    loaded, robots = load_model(model, held.texts), robots_of(places)
    check_outputs(json, inputs=(model, *(log for robot in robots for log in robot.logs)))
    if len(robots) == 1 and len(robots[0].logs) > 1:
        print(f"{places[0]}: {len(robots[0].logs)} logs of one robot; for a robot each: --each {places[0]}/*")
    outcomes: list[Outcome] = []

    def on_outcome(outcome: Outcome) -> None:
        outcomes.append(outcome)
        if outcome.status in ("failed", "interrupted"):
            complain(f"{outcome.robot}: not fitted: {outcome.message or outcome.status}")

    try:
        with progress("fitting") as report:
            fleet = fit_each(
                loaded,
                robots,
                into=folder,
                jobs=jobs,
                symmetry_penalty=symmetry_penalty,
                holdout_after=held.holdout_after,
                report=report,
                on_outcome=on_outcome,
            )
    except KeyboardInterrupt:
        kept = sum(outcome.fitted for outcome in outcomes)
        complain(f"stopped; {kept} of {len(robots)} robots are kept in {folder}, the same command goes on from there")
        sys.exit(130)
    write_tables(fleet, folder)
    write_json(json, fleet.as_json())
    _show_fleet(fleet, folder, details)
    if fleet.failed:
        sys.exit(1)


def _folder(output: Path | None) -> Path:
    if output is None:
        raise InputError("command line", "--output", "none", "a folder for one model a robot, with -o FOLDER")
    if output.exists() and not output.is_dir():
        raise InputError(output, "output", "a file", "a folder, since --each writes one model a robot")
    if not output.absolute().parent.is_dir():
        raise InputError(output, "output", "no such folder above it", "a folder in a folder that exists")
    return output


def _show_fleet(fleet: Fleet, folder: Path, details: bool) -> None:
    """The spread of each parameter, robots that stand apart, warnings, and one line that counts."""
    from lptn.cli.terminal import show_table

    spreads, most = list(fleet.spread), None if details else FEW
    if most is not None and len(spreads) > most + 1:
        width = {one.what: (one.quartiles[1] - one.quartiles[0]) / max(abs(one.median), 1e-300) for one in spreads}
        spreads = [spreads[0], *sorted(spreads[1:], key=lambda one: -width[one.what])[:most]]
        print(f"The RMSE, and the {most} of {len(fleet.spread) - 1} parameters that differ most between robots:")
    rows = []
    for spread in spreads:
        numbers = (f"{value:.4g}" for value in (spread.quartiles[0], spread.median, spread.quartiles[1]))
        rows.append((spread.what, str(spread.robots), *numbers, spread.unit))
    if fleet.fitted:
        show_table(("parameter", ">robots", ">25 %", ">median", ">75 %", "unit"), rows)
    notes = Counter(note for outcome in fleet.fitted for note in outcome.result.get("notes", ()))
    warnings = Counter(warning for outcome in fleet.fitted for warning in _warnings_of(outcome))
    for what, lines in (
        ("robots that stand apart", [str(outlier) for outlier in fleet.outliers]),
        ("notes on logs", [f"{count_of(count, 'robot')}: {note}" for note, count in notes.most_common()]),
        ("warnings", [f"Warning: {what}, {count_of(count, 'robot')}." for what, count in warnings.most_common()]),
    ):
        for line in lines[:most]:
            print(line)
        if len(lines) > len(lines[:most]):
            print(f"... and {len(lines) - len(lines[:most])} more {what}: --details")
    before = sum(outcome.status == "unchanged" for outcome in fleet.outcomes)
    words = f"{len(fleet.fitted)} of {len(fleet.outcomes)} robots fitted"
    words += f", {before} of them before" if before else ""
    words += f"; {len(fleet.failed)} not" if fleet.failed else ""
    print(f"{words}. Models, records and a table (fleet.csv, fleet.parquet) are in {folder}.")


def _warnings_of(outcome: Outcome) -> list[str]:
    """A robot's warnings without its own numbers, so that like ones count together."""
    warnings = [warning.partition(" (")[0] for warning in outcome.result.get("warnings", ())]
    return warnings if outcome.converged else [*warnings, f"search {outcome.result.get('status')}"]
