"""`lptn fit`: one robot, or each robot of a fleet on its own."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter as Option
from cyclopts import validators

from lptn.cli_support import (
    Holdout,
    HoldoutAfter,
    Json,
    Map,
    MirrorWeight,
    check_outputs,
    open_by_job,
)
from lptn.errors import InputError

Each = Annotated[
    list[Path] | None,
    Option(
        name="--each",
        help="Fit each robot on its own: a log file, a folder of one robot's logs, or a folder of such folders.",
        negative="",
        consume_multiple=True,
    ),
]
FitJobs = Annotated[
    int, Option(name="--jobs", help="With --each: processes that fit robots.", validator=validators.Number(gte=1))
]
FitOutput = Annotated[
    Path | None, Option(name=["--output", "-o"], help="File to write the model to; with --each, a folder.")
]


def fit(
    model: Path,
    /,
    *logs: Path,
    output: FitOutput = None,
    each: Each = None,
    holdout: Holdout = None,
    holdout_after: HoldoutAfter = None,
    mirror_weight: MirrorWeight = 0.0,
    json: Json = None,
    jobs: FitJobs = 1,
    map: Map = None,  # noqa: A002
) -> None:
    """Fit the free parameters; Ctrl-C keeps the best point so far, and the same command goes on from it.

    With --each, one model a robot goes into the folder as it comes, then a
    table of all. A robot that can't be fitted is told in one line, and the exit
    status is 1. The same command goes on where it was stopped.

    Example: lptn fit leg.toml monday.parquet --holdout friday.parquet -o fitted.toml

    Example: lptn fit leg.toml --each logs/* -o fleet --jobs 8
    """
    if each is None:
        if jobs > 1:
            raise InputError("command line", "--jobs", "no --each beside it", "one process for one fit")
        _fit_one(model, logs, output, holdout, holdout_after, mirror_weight, json, map)
        return
    if logs or holdout:
        found = "LOGS" if logs else "--holdout"
        raise InputError("command line", "--each", f"{found} beside it", "all logs behind --each, or no --each")
    _fit_each(model, each, output, holdout_after, mirror_weight, json, jobs, map)


def _fit_one(
    model: Path,
    logs: tuple[Path, ...],
    output: Path | None,
    holdout: list[Path] | None,
    holdout_after: float | None,
    mirror_weight: float | Literal["auto"],
    json: Path | None,
    mapped: list[str] | None,
) -> None:
    from lptn.checkpoint import Checkpoint, fingerprint_of
    from lptn.on_evidence import fit_evidence
    from lptn.terminal import out, progress, show_fit, show_holdout, show_mirror_trials, write_json

    check_outputs(output, json, inputs=(*logs, *(holdout or ())))
    check_outputs(json, inputs=(model,))  # only the fitted model may take its place
    opened, data = open_by_job(model, logs, holdout, holdout_after, None, mapped)
    if not opened.model.free:
        raise InputError(model, "parameters", "none that is free", "one at least without fixed = true")
    digests = [(part.run.name, part.run.fingerprint) for part in data.fit]
    options = {"map": mapped or [], "holdout_after": holdout_after}

    def checkpoint(weight: float) -> Checkpoint:
        kept = Checkpoint(fingerprint_of(opened.file.text, digests, options | {"mirror_weight": weight}))
        if kept.load(opened.model, len(data.fit)) is not None:
            out.print("This fit was stopped before: it goes on from the best point that was kept.")
        return kept

    with progress("fitting") as report:
        found = fit_evidence(opened.model, data, mirror_weight, checkpoint=checkpoint, report=report)
    done, held = found.fit, found.holdout
    show_mirror_trials(found.trials)
    show_fit(done)
    show_holdout(held)
    if output is not None:
        opened.file.with_fit(done.table()).write(output)
    tried = [{"weight": each.weight, "rmse_holdout": each.holdout.rmse} for each in found.trials]
    write_json(json, done.as_json() | {"rmse_holdout": held.rmse if held else None, "mirror_weights": tried})


def _fit_each(
    model: Path,
    places: list[Path],
    output: Path | None,
    holdout_after: float | None,
    mirror_weight: float | Literal["auto"],
    json: Path | None,
    jobs: int,
    mapped: list[str] | None,
) -> None:
    from lptn.fleet import Outcome, fit_each, robots_of
    from lptn.fleet.table import write_tables
    from lptn.fleet.terminal import show_failure, show_fleet
    from lptn.opening import open_model
    from lptn.terminal import out, progress, write_json

    folder = _folder(output)
    opened, robots = open_model(model, mapped or ()), robots_of(places)
    check_outputs(json, inputs=(model, *(log for robot in robots for log in robot.logs)))
    if len(robots) == 1 and len(robots[0].logs) > 1:
        out.print(
            f"{places[0]}: {len(robots[0].logs)} logs of one robot (a robot each: --each {places[0]}/*).", markup=False
        )
    done: list[Outcome] = []

    def told(outcome: Outcome) -> None:
        done.append(outcome)
        show_failure(outcome)

    try:
        with progress("fitting") as report:
            fleet = fit_each(
                opened,
                robots,
                into=folder,
                jobs=jobs,
                mirror_weight=mirror_weight,
                holdout_after=holdout_after,
                report=report,
                told=told,
            )
    except KeyboardInterrupt:
        kept = sum(each.status in ("fitted", "unchanged") for each in done)
        print(
            f"lptn: stopped; {kept} of {len(robots)} robots are kept in {folder}, the same command goes on from there",
            file=sys.stderr,
        )
        sys.exit(130)
    write_tables(fleet, folder)
    write_json(json, fleet.as_json())
    show_fleet(fleet, folder)
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
