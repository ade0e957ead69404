"""The command `lptn fit`: one robot, or each robot of a fleet on its own."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter as Option
from cyclopts import validators
from rich.table import Table

from lptn.basics.errors import InputError
from lptn.cli.options import Holdout, HoldoutAfter, Json, Map, SymmetryPenalty, check_outputs, open_by_job
from lptn.cli.terminal import err, out
from lptn.fleet.fleet import Fleet
from lptn.fleet.work import Outcome

# --- What the command says of a fleet -------------------------------------------------------------


_MOST = 20  # lines of outliers and of warnings


def show_failure(outcome: Outcome) -> None:
    """One line for a robot that could not be fitted, as soon as it is known."""
    if outcome.status in ("failed", "interrupted"):
        err.print(f"lptn: {outcome.robot}: not fitted: {outcome.message or outcome.status}", markup=False)


def show_fleet(fleet: Fleet, folder: Path) -> None:
    """The spread of each parameter, robots that stand apart, warnings, and one line that counts."""
    if fleet.fitted:
        out.print(_spread_table(fleet))
    for line in _shortened([str(each) for each in fleet.outliers], "robots that stand apart"):
        out.print(line, markup=False)
    notes = Counter(note for each in fleet.fitted for note in each.result.get("notes", ()))
    for line in _shortened([f"{_robots(count)}: {what}" for what, count in notes.most_common()], "notes on logs"):
        out.print(line, markup=False)
    warnings = Counter(warning for each in fleet.fitted for warning in _subjects(each)).most_common()
    for line in _shortened([f"Warning: {what}, {_robots(count)}." for what, count in warnings], "warnings"):
        out.print(line, markup=False)
    out.print(_count(fleet, folder), markup=False)


def _robots(count: int) -> str:
    return f"{count} robot{'s' * (count != 1)}"


def _spread_table(fleet: Fleet) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False)
    for column in ("parameter", "robots", "25 %", "median", "75 %", "unit"):
        table.add_column(
            column, justify="left" if column in ("parameter", "unit") else "right", no_wrap=True, overflow="fold"
        )
    for each in fleet.spread:
        low, high = each.quartiles
        numbers = (f"{value:.4g}" for value in (low, each.median, high))
        table.add_row(each.what, str(each.robots), *numbers, each.unit)
    return table


def _subjects(outcome: Outcome) -> list[str]:
    """A robot's warnings without its own numbers, so that like ones count together."""
    found = [warning.partition(" (")[0] for warning in outcome.result.get("warnings", ())]
    return found if outcome.converged else [*found, f"search {outcome.result.get('status')}"]


def _shortened(lines: list[str], what: str) -> list[str]:
    rest = len(lines) - _MOST
    return lines if rest <= 0 else [*lines[:_MOST], f"... and {rest} more {what}: see --json"]


def _count(fleet: Fleet, folder: Path) -> str:
    before = sum(each.status == "unchanged" for each in fleet.outcomes)
    words = f"{len(fleet.fitted)} of {len(fleet.outcomes)} robots fitted"
    words += f", {before} of them before" if before else ""
    words += f"; {len(fleet.failed)} not" if fleet.failed else ""
    return f"{words}. Models, records and a table (fleet.csv, fleet.parquet) are in {folder}."


# --- `lptn fit`: one robot, or each robot of a fleet on its own -----------------------------------


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
    symmetry_penalty: SymmetryPenalty = 0.0,
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
        _fit_one(model, logs, output, holdout, holdout_after, symmetry_penalty, json, map)
        return
    if logs or holdout:
        found = "LOGS" if logs else "--holdout"
        raise InputError("command line", "--each", f"{found} beside it", "all logs behind --each, or no --each")
    _fit_each(model, each, output, holdout_after, symmetry_penalty, json, jobs, map)


def _fit_one(
    model: Path,
    logs: tuple[Path, ...],
    output: Path | None,
    holdout: list[Path] | None,
    holdout_after: float | None,
    symmetry_penalty: float | Literal["auto"],
    json: Path | None,
    mapped: list[str] | None,
) -> None:
    from lptn.cli.terminal import out, progress, show_fit, show_holdout, show_symmetry_trials, write_json
    from lptn.identify.fitting import Checkpoint, fingerprint_of
    from lptn.identify.validation import fit_split, holdout_errors

    check_outputs(output, json, inputs=(*logs, *(holdout or ())))
    check_outputs(json, inputs=(model,))  # only the fitted model may take its place
    loaded, data = open_by_job(model, logs, holdout, holdout_after, None, mapped)
    if not loaded.model.free:
        raise InputError(model, "parameters", "none that is free", "one at least without fixed = true")
    digests = [(part.run.name, part.run.fingerprint) for part in data.fit]
    options = {"map": mapped or [], "holdout_after": holdout_after}

    def checkpoint(weight: float) -> Checkpoint:
        kept = Checkpoint(fingerprint_of(loaded.file.text, digests, options | {"mirror_weight": weight}))
        if kept.load(loaded.model, len(data.fit)) is not None:
            out.print("This fit was stopped before: it goes on from the best point that was kept.")
        return kept

    with progress("fitting") as report:
        done, trials = fit_split(loaded.model, data, symmetry_penalty, checkpoint=checkpoint, report=report)
    held = holdout_errors(done, data.holdout)
    show_symmetry_trials(trials)
    show_fit(done)
    show_holdout(held)
    if output is not None:
        loaded.file.with_fit(done.table()).write(output)
    tried = [{"weight": each.symmetry_penalty, "rmse_holdout": each.holdout.rmse} for each in trials]
    write_json(json, done.as_json() | {"rmse_holdout": held.rmse if held else None, "mirror_weights": tried})


def _fit_each(
    model: Path,
    places: list[Path],
    output: Path | None,
    holdout_after: float | None,
    symmetry_penalty: float | Literal["auto"],
    json: Path | None,
    jobs: int,
    mapped: list[str] | None,
) -> None:
    from lptn.cli.terminal import out, progress, write_json
    from lptn.fleet.fleet import fit_each, write_tables
    from lptn.fleet.robots import robots_of
    from lptn.identify.data import load_model

    folder = _folder(output)
    loaded, robots = load_model(model, mapped or ()), robots_of(places)
    check_outputs(json, inputs=(model, *(log for robot in robots for log in robot.logs)))
    if len(robots) == 1 and len(robots[0].logs) > 1:
        out.print(
            f"{places[0]}: {len(robots[0].logs)} logs of one robot (a robot each: --each {places[0]}/*).", markup=False
        )
    done: list[Outcome] = []

    def on_outcome(outcome: Outcome) -> None:
        done.append(outcome)
        show_failure(outcome)

    try:
        with progress("fitting") as report:
            fleet = fit_each(
                loaded,
                robots,
                into=folder,
                jobs=jobs,
                symmetry_penalty=symmetry_penalty,
                holdout_after=holdout_after,
                report=report,
                on_outcome=on_outcome,
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
