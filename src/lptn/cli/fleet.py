"""The command `lptn fleet`: one model fitted to each robot on its own, and what the robots have in common."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from lptn import report as drawn
from lptn.basics.errors import InputError
from lptn.basics.words import FEW, count_of
from lptn.cli import options
from lptn.cli.terminal import complain, progress, show_table, write_json

if TYPE_CHECKING:
    from lptn.fleet import Fleet, FleetParameter
    from lptn.fleet.work import Outcome


def fleet(
    model: Path,
    /,
    *robots: Path,
    output: Annotated[Path | None, options.WRITES] = None,
    held: options.HeldOut = options.HELD_OUT,
    symmetry_penalty: options.SymmetryPenalty = 0.0,
    jobs: options.Jobs = 1,
    details: options.Details = False,
    json: options.Json = None,
    plot: options.Picture = None,
) -> None:
    """Fit each robot of a fleet, and say which stand apart or drift.

    A robot is a log, or a folder of logs; a folder of such folders is a fleet. Where all logs of a robot have a date
    in their names, as walk_2026-03-14.csv has, each day is fitted on its own, and drifts over months are told.

    The same command goes on where it was stopped, and fits only what is new. A robot that can't be fitted is named in
    one line, and the exit status is 1.

    Example: lptn fleet leg.toml robots/*/ -o fleet --jobs 8 --plot fleet.pdf

    Args:
        output: Folder for models, records and a table.
    """
    options.needs_logs(robots)
    if held.holdout:
        raise InputError("command line", "--holdout", "logs", "--holdout-after: of each robot's own logs")
    folder = _folder(output)
    from lptn.basics.tables import write_table
    from lptn.fleet.fleet import fit_each, table_of
    from lptn.fleet.robots import by_day, robots_of
    from lptn.identify.data import load_model

    loaded, found = load_model(model, held.texts), by_day(robots_of(robots))
    options.check_outputs(json, pictures=[plot], inputs=(model, *(log for robot in found for log in robot.logs)))
    outcomes: list[Outcome] = []

    def on_outcome(outcome: Outcome) -> None:
        outcomes.append(outcome)
        if outcome.status in ("failed", "interrupted"):
            complain(f"{outcome.robot}: not fitted: {outcome.message or outcome.status}")

    try:
        with progress("fitting") as report:
            done = fit_each(
                loaded,
                found,
                into=folder,
                jobs=jobs,
                symmetry_penalty=symmetry_penalty,
                holdout_after=held.holdout_after,
                report=report,
                on_outcome=on_outcome,
            )
    except KeyboardInterrupt:
        kept = sum(outcome.fitted for outcome in outcomes)
        complain(f"stopped; {kept} of {len(found)} fits are kept in {folder}, the same command goes on from there")
        sys.exit(130)
    for name in ("fleet.csv", "fleet.parquet"):
        write_table(folder / name, table_of(done))
    write_json(json, done.as_json())
    _show(done, folder, details)
    options.write_figure(plot if done.parameters else None, lambda: drawn.fleet_figure(done))
    if done.failed:
        sys.exit(1)


def _folder(output: Path | None) -> Path:
    if output is None:
        raise InputError("command line", "--output", "none", "a folder for one model a robot, with -o FOLDER")
    if output.exists() and not output.is_dir():
        raise InputError(output, "output", "a file", "a folder for one model a robot")
    if not output.absolute().parent.is_dir():
        raise InputError(output, "output", "no such folder above it", "a folder in a folder that exists")
    return output


def _show(fleet: Fleet, folder: Path, details: bool) -> None:
    """Robots that stand apart or drift, each parameter over the fleet, warnings, and one line that counts."""
    most = None if details else FEW
    robots = {robot.of for robot in fleet.robots.values()}
    days = {robot.day for robot in fleet.robots.values() if robot.day}
    often = Counter(robot.of for robot in fleet.robots.values() if robot.day)
    before = sum(outcome.status == "unchanged" for outcome in fleet.outcomes)
    words = f"{len(fleet.fitted)} of {count_of(len(fleet.outcomes), 'fit')} of {count_of(len(robots), 'robot')}"
    words += f" on {len(days)} days" if len(days) > 1 else ""
    words += f", {before} of them made before" if before else ""
    apart = len({one.robot for one in fleet.deviations})
    print(f"Fleet: {words}; {count_of(apart, 'robot')} stand{'s' * (apart == 1)} apart or drift{'s' * (apart == 1)}.")
    _print_some([str(deviation) for deviation in fleet.deviations], most, "deviations")
    parameters = list(fleet.parameters)
    if most is not None and len(parameters) > most + 1:
        differ = sorted(parameters[1:], key=lambda one: -(one.scatter or 0.0))[:most]
        parameters, which = [parameters[0], *differ], " that differ most between robots" * (len(robots) > 1)
        print(f"The RMSE, and {most} of {len(fleet.parameters) - 1} parameters{which}:")
    if parameters:
        heads = ("parameter", ">robots", ">mean", ">± robots", ">± days", ">a month", "unit")
        show_table(heads, [_row(parameter) for parameter in parameters])
    notes = Counter(note for outcome in fleet.fitted for note in outcome.result.get("notes", ()))
    _print_some([f"{count_of(count, 'fit')}: {note}" for note, count in notes.most_common()], most, "notes on logs")
    warnings = Counter[str]()
    for outcome in fleet.fitted:  # without a robot's own numbers, so that like ones count together
        warnings.update(warning.partition(" (")[0] for warning in outcome.result.get("warnings", ()))
        warnings.update([] if outcome.converged else [f"search {outcome.result.get('status')}"])
    said = [f"Warning: {what}, {count_of(count, 'fit')}." for what, count in warnings.most_common()]
    _print_some(said, most, "warnings")
    if max(often.values(), default=0) < 2:
        print("No drifts are told: that needs a folder for each robot, with logs of names such as walk_2026-03-14.csv.")
    print(f"Models, records and a table (fleet.csv, fleet.parquet) are in {folder}.")


def _row(parameter: FleetParameter) -> tuple[str, ...]:
    from lptn.report.text import unit_text

    said = parameter.as_json()
    values = (said[name] for name in ("mean", "scatter", "days", "per_month"))
    numbers = ("–" if value is None else f"{value:.4g}" for value in values)
    return (parameter.name, str(said["robots"]), *numbers, unit_text(parameter.unit))


def _print_some(lines: Sequence[str], most: int | None, what: str) -> None:
    for line in lines[:most]:
        print(line)
    if len(lines) > len(lines[:most]):
        print(f"... and {len(lines) - len(lines[:most])} more {what}: --details")
