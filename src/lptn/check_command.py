"""The command `lptn check`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter as Option

from lptn.cli_support import Json, Map, check_outputs
from lptn.errors import InputError

if TYPE_CHECKING:
    from lptn.check import Held

Guessing = Annotated[bool, Option(name="--guess", help="Take the proposed columns, as --map guess does.", negative="")]


def check(
    model: Path,
    /,
    *logs: Path,
    guess: Guessing = False,
    json: Json = None,
    map: Map = None,  # noqa: A002 - the option's name
) -> None:
    """Say what a model file and logs hold, what is wrong with them, and which effects they could reveal.

    Two logs of one run with clocks of their own are one: temperatures.csv+currents.csv

    Example: lptn check leg.toml monday.parquet
    """
    from lptn.check import excitation, held, revealed
    from lptn.check.showing import show_excitation, show_log, show_model, show_nodes, show_revealed, show_steps
    from lptn.opening import GUESS, open_model
    from lptn.run_names import say_absent_runs
    from lptn.simulate import drive
    from lptn.terminal import progress, write_json

    check_outputs(json, inputs=(model, *logs))
    opened = open_model(model, [*(map or ()), *([GUESS] if guess else [])])
    with progress("reading"):
        found = [held(opened, log) for log in logs]
    show_model(opened.model)
    for each in found:
        show_log(each, opened.guessing)
    content: dict[str, object] = {"model": str(model), "nodes": opened.model.nodes, "inputs": opened.model.inputs}
    content["logs"] = [each.as_json() for each in found]
    runs = [run for each in found for run in each.runs]
    if runs:
        show_nodes(opened.model, runs)
        seen = excitation(runs, opened.model.nodes)
        told = revealed(opened.model, runs, seen)
        show_excitation(seen)
        show_revealed(told)
        show_steps(opened.model, drive(opened.model, runs[0]))
        say_absent_runs(opened.model.network, runs)
        content |= {"excitation": seen.as_json(), "effects": [each.__dict__ for each in told]}
    _refuse(found)
    write_json(json, content)


def _refuse(found: list[Held]) -> None:
    """Say of the first log that no other command would take why that is.

    Raises:
        InputError: if there is one.
    """
    for each in found:
        if each.refused is not None:
            raise each.refused
        for doubt in (doubt for run in each.runs for doubt in run.doubts if doubt.sure):
            raise InputError(each.path, f"column '{doubt.column}'", doubt.found, doubt.mend)
