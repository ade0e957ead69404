"""What `lptn check` prints: the model, the logs, what is wrong with them, and what they could reveal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from lptn.check.excitation import Excitation
from lptn.check.holding import Held
from lptn.check.revealing import Revealed
from lptn.logs import Run
from lptn.model import Model
from lptn.noise import estimate_noise
from lptn.simulate import Drive, default_start, drive
from lptn.state_space import state_space
from lptn.terminal import out

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
    drives = [drive(model, run) for run in runs]
    noise = estimate_noise(drives, model.nodes)
    table = Table(box=None, header_style="bold", pad_edge=False)
    for column in ("node", "from", "to", "missing", "noise floor"):
        table.add_column(column, no_wrap=True, overflow="fold")
    for row, node in enumerate(model.nodes):
        readings = np.concatenate([driven.measured[row] for driven in drives])
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


def show_steps(model: Model, driven: Drive) -> None:
    """How fast the network is, and the steps that forward Euler could take with it."""
    form = state_space(model, default_start(model, driven), driven.inputs.mean(axis=1))
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
