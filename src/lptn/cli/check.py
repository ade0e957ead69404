"""The command `lptn check`: what a model's logs hold, what is wrong with them, and what they could reveal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter as Option
from rich.table import Table

from lptn.basics.errors import InputError
from lptn.cli.options import Json, Map, check_outputs
from lptn.cli.terminal import out
from lptn.diagnose.excitation import Excitation, Revealed
from lptn.identify.data import LoadedModel, optional_columns
from lptn.identify.noise import estimate_noise
from lptn.logs.guess import Guess, guess, missing_keys
from lptn.logs.reading import open_log, select
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.simulate.bound_run import BoundRun, bind, default_start, needed_columns
from lptn.simulate.state_space import state_space

# --- One log as a model sees it: its format, its columns, used and not, and the lines that would map what is missing ---


@dataclass(frozen=True)
class Held:
    """What one log holds.

    Args:
        path: as the user wrote it.
        kind: its format.
        used: for each quantity that is used the columns that it stands in.
        unused: the other columns.
        guesses: columns that may hold what is missing; taken only where the user asked for it.
        runs: what was read; empty if the log can't be used.
        refused: why it can't.
        wanting: quantities that the model needs and that nothing in the log is known to hold.
        currents: columns that may hold the currents of joints whose torques are wanting.
    """

    path: Path
    kind: str
    used: dict[str, tuple[str, ...]]
    unused: tuple[str, ...]
    guesses: tuple[Guess, ...]
    runs: tuple[Run, ...]
    refused: InputError | None = None
    wanting: tuple[str, ...] = ()
    currents: tuple[Guess, ...] = ()

    @property
    def wrong(self) -> list[str]:
        """What can't be right, a sentence each, with the line that would mend it."""
        return list(dict.fromkeys(doubt.sentence for run in self.runs for doubt in run.doubts))

    @property
    def notes(self) -> list[str]:
        """What else was found, and how it was treated."""
        return [
            note for note in dict.fromkeys(note for run in self.runs for note in run.notes) if note not in self.wrong
        ]

    def as_json(self) -> dict[str, object]:
        """For other programs."""
        return {
            "log": str(self.path),
            "format": self.kind,
            "used": {key: list(columns) for key, columns in self.used.items()},
            "unused": list(self.unused),
            "wrong": [
                {
                    "quantity": doubt.key,
                    "column": doubt.column,
                    "found": doubt.found,
                    "mend": doubt.mend,
                    "sure": doubt.sure,
                }
                for doubt in (self.runs[0].doubts if self.runs else ())
            ],
            "notes": self.notes,
            "guesses": [
                {"quantity": each.key, "line": each.line, "map": each.option, "why": each.why} for each in self.guesses
            ],
            "wanting": list(self.wanting),
            "runs": [
                {
                    "name": run.name,
                    "step": run.step,
                    "steps": len(run),
                    "averaged": run.averaged,
                    "sha256": run.fingerprint,
                }
                for run in self.runs
            ],
            "refused": str(self.refused) if self.refused else None,
        }


def held(loaded: LoadedModel, log: Path) -> Held:
    """Look at one log.

    Args:
        opened: the model file that it is for.
        log: its path.

    Raises:
        InputError: it can't be opened at all.
    """
    inputs, outputs = needed_columns(loaded.model)
    table, columns = open_log(log, loaded.columns)
    guesses = tuple(guess(table, columns, inputs, outputs))
    if loaded.guessing:
        columns |= {each.key: each.source for each in guesses}
    wanting = tuple(missing_keys(table, columns, inputs, outputs))
    bound_runs = [key.replace("torque.", "current.") for key in wanting if key.startswith("torque.")]
    currents = tuple(each for each in guess(table, columns, bound_runs, outputs) if each.key in bound_runs)
    used: dict[str, tuple[str, ...]] = {}
    runs: Sequence[Run] = ()
    refused = None
    try:
        chosen = select(table, columns, inputs, outputs, optional_columns(loaded.model))
        used = {key: source.columns for key, source in chosen.sources.items()}
        runs = loaded.runs([log], strict=False)
    except InputError as error:
        refused = error
    taken = {name for names in used.values() for name in names}
    unused = tuple(name for name in dict.fromkeys(table.names) if name not in taken)
    return Held(log, table.kind, used, unused, guesses, tuple(runs), refused, wanting, currents)


# --- What `lptn check` prints: the model, the logs, what is wrong with them, and what they could reveal ---


_MANY = 12


def show_model(model: Model) -> None:
    """What a model needs."""
    free = len(model.free)
    out.print(f"Model {model.network.name}: nodes {', '.join(model.nodes)}; {free} free parameters.", markup=False)
    out.print(f"Inputs: {_some(model.inputs)}.", markup=False)
    for column in model.started:
        out.print(f"{column} is no column of the log: it is taken from each run's first readings.", markup=False)


def show_log(held: Held, guessing: bool) -> None:
    """What a log holds, and what is wrong with it."""
    out.print(f"\n{held.path.name} ({held.kind}): {_lengths(held.runs)}", markup=False)
    if held.unused:
        out.print(f"  not used: {_some(held.unused)}", markup=False)
    for note in held.notes:
        out.print(f"  {note}", markup=False)
    for sentence in held.wrong:
        out.print(f"  WRONG? {sentence}", markup=False)
    if held.guesses and not guessing:
        out.print(
            "  Some columns may be what is missing. If so, put into the model file, under [columns]:", markup=False
        )
        for each in held.guesses:
            out.print(f"    {each.line}   # {each.why}", markup=False)
        options = " ".join(each.option for each in held.guesses)
        out.print(f"  or write behind the command: {options}", markup=False)
        out.print("  or --map guess, which takes them all and says so.", markup=False)
    _show_wanting(held, guessing)


def _show_wanting(held: Held, guessing: bool) -> None:
    """What the model needs and no name points to, and how to say where it stands."""
    proposed = () if guessing else tuple(each.key for each in held.guesses)
    left = [key for key in held.wanting if key not in proposed]
    if not left or held.refused is None:
        return
    out.print(f"  The model needs and no column's name tells: {_some(left)}.", markup=False)
    out.print(f'    Say which column holds it, and its unit: --map "{left[0]}=COLUMN[UNIT]"', markup=False)
    if "temperature.ambient" in left:
        out.print(
            '    Never logged? In the model file, under [model]: ambient = "start" (the log begins at rest) or '
            "ambient = 22 (°C).",
            markup=False,
        )
    if held.currents:
        named = ", ".join(f"{each.key} = {each.source.columns[0]}" for each in held.currents)
        out.print(f"    It seems to hold currents instead of torques ({named}).", markup=False)
        out.print(
            '    Then drive the model by them: input = "current" in place of torque_constant, in each [[effects]] of '
            "kind copper_loss.",
            markup=False,
        )


def show_nodes(model: Model, runs: Sequence[Run]) -> None:
    """Each node's temperatures over all runs."""
    bound_runs = [bind(model, run) for run in runs]
    noise = estimate_noise(bound_runs, model.nodes)
    table = Table(box=None, header_style="bold", pad_edge=False)
    for column in ("node", "from", "to", "missing", "noise floor"):
        table.add_column(column, no_wrap=True, overflow="fold")
    for row, node in enumerate(model.nodes):
        readings = np.concatenate([bound.measured[row] for bound in bound_runs])
        if np.isfinite(readings).any():
            ends = f"{np.nanmin(readings):.1f} °C", f"{np.nanmax(readings):.1f} °C"
            table.add_row(node, *ends, f"{np.isnan(readings).mean():.0%}", f"{noise.floor[row]:.3g} K")
        else:
            table.add_row(node, "not measured", "", "", "")
    out.print()
    out.print(table)


def show_excitation(seen: Excitation) -> None:
    """What happens in the runs."""
    load = f"{_count(seen.levels, 'level')} of load, at rest {seen.still:.0%} of the time" if seen.levels else "no load"
    base = seen.ranges.get("speed.base")
    moving = f"base speed {base[0]:.2g} to {base[1]:.2g} m/s" if base else "base speed not logged"
    out.print(
        f"\nIn {seen.minutes:.3g} min: {load}; {_count(seen.cool_downs, 'cool-down')}; {_count(seen.steps, 'jump')} of "
        f"load; up to {seen.rise:.3g} K above the surroundings, which change by {seen.ambient:.2g} K; {moving}.",
        markup=False,
    )


def show_revealed(told: Sequence[Revealed]) -> None:
    """Which effects could show, and which not and why."""
    could = [each.effect for each in told if each.could]
    out.print(f"Could show, if it is there: {', '.join(could) or 'nothing'}.", markup=False)
    reasons: dict[str, list[str]] = {}
    for each in told:
        if not each.could:
            reasons.setdefault(each.why, []).append(each.effect)
    if reasons:
        out.print("Could not:")
    for why, effects in reasons.items():
        out.print(f"  {', '.join(effects)}: {why}", markup=False)
    out.print(
        "By rules of thumb on what was logged and what happened; `lptn diagnose` works out what the data can tell."
    )


def show_steps(model: Model, bound: BoundRun) -> None:
    """How fast the network is, and the steps that forward Euler could take with it."""
    form = state_space(model, default_start(model, bound), bound.inputs.mean(axis=1))
    slowest = form.time_constants[np.isfinite(form.time_constants)].max()
    spread = f"{form.time_constants[0]:.4g} to {slowest:.4g} s"
    euler = f"stable to {form.euler_stable:.3g} s, within 0.1 K of the exact hold to {form.euler_step(0.1):.2g} s"
    out.print(
        f"\nTime constants {spread} at the declared values. Steps of forward Euler would stay {euler}; "
        "Runge-Kutta steps, used here, are cut finer where they need to be.",
        markup=False,
    )


def _lengths(runs: Sequence[Run]) -> str:
    if not runs:
        return "it can't be used yet"
    steps = sum(len(run) for run in runs)
    first = runs[0]
    kind = "means" if first.averaged else "samples"
    pieces = f" in {len(runs)} runs" if len(runs) > 1 else ""
    return f"{steps} {kind} of {first.step:g} s, {steps * first.step / 60:.3g} min{pieces}"


def _count(number: int, word: str) -> str:
    return f"{number or 'no'} {word}{'' if number == 1 else 's'}"


def _some(names: Sequence[str]) -> str:
    more = len(names) - _MANY
    return ", ".join(names[:_MANY]) + (f" and {more} more" if more > 0 else "")


# --- The command `lptn check` ---------------------------------------------------------------------


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
    from lptn.cli.terminal import progress, write_json
    from lptn.diagnose.excitation import excitation, revealed
    from lptn.identify.data import GUESS, load_model, say_absent_runs
    from lptn.simulate.bound_run import bind

    check_outputs(json, inputs=(model, *logs))
    loaded = load_model(model, [*(map or ()), *([GUESS] if guess else [])])
    with progress("reading"):
        found = [held(loaded, log) for log in logs]
    show_model(loaded.model)
    for each in found:
        show_log(each, loaded.guessing)
    content: dict[str, object] = {"model": str(model), "nodes": loaded.model.nodes, "inputs": loaded.model.inputs}
    content["logs"] = [each.as_json() for each in found]
    runs = [run for each in found for run in each.runs]
    if runs:
        show_nodes(loaded.model, runs)
        seen = excitation(runs, loaded.model.nodes)
        told = revealed(loaded.model, runs, seen)
        show_excitation(seen)
        show_revealed(told)
        show_steps(loaded.model, bind(loaded.model, runs[0]))
        say_absent_runs(loaded.model.network, runs)
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
