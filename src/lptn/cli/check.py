"""The command `lptn check`: what a model's logs hold, what is wrong with them, and what they could reveal."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from lptn import report
from lptn.basics.words import FEW, count_of, few
from lptn.cli import options
from lptn.cli.terminal import progress, show_table, write_json

if TYPE_CHECKING:
    from lptn.basics.arrays import FloatArray
    from lptn.diagnose.excitation import Identifiability
    from lptn.logs.issue import Issue
    from lptn.model.model import Model
    from lptn.simulate.bound_run import BoundRun
    from lptn.workbench.log_content import LogContent


def check(
    model: Path,
    /,
    *logs: Path,
    guess: bool = False,
    drawing: Path | None = None,
    details: options.Details = False,
    json: options.Json = None,
    columns: options.Columns = options.COLUMNS,
) -> None:
    """Check logs for what is wrong or missing.

    Also says what they hold, and how many effects could be found with them.

    Join two logs of one run by a plus: temperatures.csv+currents.csv; @12.4 behind it sets the second clock 12.4 s
    forward.

    Example: lptn check leg.toml monday.parquet

    Args:
        guess: Use the proposed columns, like --map guess.
        drawing: Drawing of the network to write: .svg.
    """
    options.check_outputs(json, drawings=[drawing], inputs=(model, *logs))
    options.check_inputs(model, *logs)
    from lptn.diagnose.excitation import excitation, identifiability
    from lptn.identify.data import GUESS, load_model, warn_of_absent_runs
    from lptn.report.narrative import logs_narrative
    from lptn.report.sentences import Sentence
    from lptn.simulate.bound_run import bind
    from lptn.workbench.log_content import LogContent

    loaded = load_model(model, [*columns.texts, *([GUESS] if guess else [])])
    with progress("reading"):
        contents = [LogContent.of(loaded, log) for log in logs]
    result: dict[str, object] = {"model": str(model), "nodes": loaded.model.nodes, "inputs": loaded.model.inputs}
    result["logs"] = [_as_json(content) for content in contents]
    runs = [run for content in contents for run in content.runs]
    unusable = sum(content.error is not None for content in contents)
    said = logs_narrative(loaded.model, runs, len(contents), unusable)
    of_logs = "Sensors", "Excitation", "Effects"
    held = [sentence for sentence in said if sentence.label in of_logs]
    print(*(sentence for sentence in said if sentence not in held), sep="\n")
    mapped = tuple(text.partition("=")[0] for text in columns.map or ())
    _show_logs(contents, lambda content: _urgent(content, loaded.guessing, mapped, whole=details), whole=details)
    _show_issues(contents, most=None if details else _ALIKE)
    if runs:
        print(*held, Sentence("Next", _next(model, contents)), sep="\n")
        warn_of_absent_runs(loaded.model.network, runs)
    if runs and (details or json is not None):
        excited = excitation(runs, loaded.model.nodes)
        effects = identifiability(loaded.model, runs, excited)
        result |= {"excitation": excited.as_json(), "effects": [asdict(assessment) for assessment in effects]}
        if details:
            bound_runs = [bind(loaded.model, run) for run in runs]
            _show_logs(contents, _notes, whole=True)
            _show_nodes(loaded.model, bound_runs)
            _show_identifiability(effects)
            _show_steps(loaded.model, bound_runs[0])
    for content in contents:
        if content.error is not None:
            raise content.error
    options.write_page(drawing, lambda: report.draw_network(loaded.model))
    write_json(json, result)


# --- what is printed: the model, the logs, and what they could reveal ---------------------------------------


_MANY = 12  # names in a row
_FITTED = 0.7  # share of a single log's time that is proposed for the fit
_ALIKE = 2  # things of one kind that the answer says in full


def _next(model: Path, contents: Sequence[LogContent]) -> str:
    """What to do next."""
    from lptn.report.text import short

    if any(content.error for content in contents):
        return "Correct what is listed above, and check again."
    if any(content.wrong for content in contents):
        return "Compare these lines with what you know of the robot; mend the log, or say it in the model file."
    logs = [str(content.path) for content in contents]
    held_out = ["--holdout", logs[-1]]
    if len(logs) == 1:
        held_out = ["--holdout-after", f"+{short(_FITTED * sum(len(run) * run.step for run in contents[0].runs))}"]
    return shlex.join(["lptn", "improve", str(model), *(logs[:-1] or logs), *held_out, "-o", "better.toml"])


def _as_json(content: LogContent) -> dict[str, object]:
    """What one log holds, for other programs."""
    issues = content.runs[0].issues if content.runs else ()
    return {
        "log": str(content.path),
        "format": content.kind,
        "used": {key: list(columns) for key, columns in content.used.items()},
        "unused": list(content.unused),
        "wrong": [
            {
                "quantity": issue.key,
                "column": issue.column,
                "found": issue.problem,
                "mend": issue.remedy,
                "sure": issue.certain,
                "kind": issue.kind,
                "from": issue.stretch[0] if issue.stretch else None,
                "to": issue.stretch[1] if issue.stretch else None,
            }
            for issue in issues
        ],
        "notes": content.notes,
        "guesses": [
            {"quantity": guess.key, "line": guess.line, "map": guess.option, "why": guess.why}
            for guess in content.guesses
        ],
        "wanting": list(content.missing),
        "runs": [
            {
                "name": run.name,
                "step": run.step,
                "steps": len(run),
                "averaged": run.averaged,
                "sha256": run.fingerprint,
            }
            for run in content.runs
        ],
        "refused": str(content.refused) if content.refused else None,
    }


def _show_logs(contents: Sequence[LogContent], lines_of: Callable[[LogContent], Iterator[str]], *, whole: bool) -> None:
    """Each log with lines of its own; those that all logs have in common, once."""
    lines = [list(lines_of(content)) for content in contents]
    common = set(lines[0]).intersection(*lines[1:]) if len(lines) > 1 else set()
    quiet = 0
    for content, own in zip(contents, lines, strict=True):
        own = [line for line in own if line not in common]
        quiet += not own
        if own or whole or quiet <= FEW:
            print(f"{content.path.name} ({content.kind}): {content.lengths}")
        for line in own:
            print(line)
    if quiet > FEW and not whole:
        print(f"and {count_of(quiet - FEW, 'more log')}")
    if common:
        print("All logs:")
        for line in lines[0]:
            if line in common:
                print(line)


def _show_issues(contents: Sequence[LogContent], most: int | None) -> None:
    """What seems wrong in the logs; of more than `most` things of one kind the first, and where the others are."""
    kinds: dict[str, dict[str, tuple[LogContent, Issue]]] = {}
    for content in contents:
        for issue in content.issues:
            kinds.setdefault(issue.kind, {}).setdefault(f"{content.path} {issue.sentence}", (content, issue))
    for found in kinds.values():
        several, folded = list(found.values()), most is not None and len(found) > most
        for content, issue in several[:1] if folded else several:
            print(f"WRONG? {f'{content.path.name}, ' if len(contents) > 1 else ''}{issue.sentence}")
        if folded:
            others = list(dict.fromkeys(issue.key for _, issue in several[1:]))
            logs = len({content.path for content, _ in several})
            where = f" in {logs} logs" if logs > 1 else ""
            print(f"WRONG? {len(several) - 1} more of this kind{where} ({few(others)}): --details")


def _notes(content: LogContent) -> Iterator[str]:
    """What else was noticed in a log."""
    if content.unused:
        yield f"  {'not used' if content.used else 'columns'}: {few(content.unused, _MANY)}"
    yield from (f"  {note}" for note in content.notes)


def _urgent(content: LogContent, guessing: bool, mapped: Sequence[str], *, whole: bool) -> Iterator[str]:
    """What is wrong with a log, what became of `--map`, and the lines that would map what is missing."""
    from lptn.logs.reading import doubtful

    most = None if whole else FEW
    if content.unused and not content.used:
        yield f"  columns: {few(content.unused, _MANY)}"
    said = {*doubtful(content.notes), *(note for note in content.notes if note.partition(":")[0] in mapped)}
    yield from (f"  {note}" for note in content.notes if note in said and not whole)
    if content.guesses and not guessing and (whole or content.missing):
        use = "what is missing" if content.missing else "speeds, by which `lptn diagnose` can test more effects"
        yield f"  Some columns may be {use}. If so, put into the model file, under [columns]:"
        yield from (f"    {guess.line}   # {guess.why}" for guess in content.guesses[:most])
        if len(content.guesses) > len(content.guesses[:most]):
            yield f"    and {len(content.guesses) - FEW} more: --details"
        else:
            yield f"  or write behind the command: {' '.join(guess.option for guess in content.guesses)}"
        yield "  or write --map guess behind the command, which uses all of them."
    if content.refused is not None:
        yield from _missing_lines(content, () if guessing else tuple(guess.key for guess in content.guesses))


def _missing_lines(content: LogContent, proposed: Sequence[str]) -> Iterator[str]:
    """Quantities that the model needs and no column's name matches, and how to map them."""
    left = [key for key in content.missing if key not in proposed]
    if not left:
        return
    yield f"  The model needs these quantities, and no column's name matches: {few(left, _MANY)}."
    if "time" in left:
        yield "    Rows without times, at one rate? --rate 50, for 50 a second."
    yield f'    Name its column and unit: --map "{left[0]}=COLUMN[UNIT]"'
    if "temperature.ambient" in left:
        yield (
            '    Never logged? In the model file, under [model]: ambient = "start" (the log begins at rest) or '
            "ambient = 22 (°C)."
        )
    if content.currents:
        yield f"    It seems to hold currents instead of torques ({few(content.currents, _MANY)})."
        yield (
            '    Then drive the model by them: input = "current" in place of torque_constant, in each [[effects]] of '
            "kind copper_loss."
        )


def _show_nodes(model: Model, bound_runs: Sequence[BoundRun]) -> None:
    """Each node's temperatures over all runs."""
    import numpy as np

    from lptn.identify.noise import estimate_noise

    noise = estimate_noise(bound_runs, model.nodes)
    rows = []
    for row, node in enumerate(model.nodes):
        readings = np.concatenate([bound.measured[row] for bound in bound_runs])
        if np.isfinite(readings).any():
            ends = f"{np.nanmin(readings):.1f} °C", f"{np.nanmax(readings):.1f} °C"
            missing = _missing([bound.measured[row] for bound in bound_runs])
            rows.append((node, *ends, f"{missing:.0%}", f"{noise.floor[row]:.3g} K"))
        else:
            rows.append((node, "not measured", "", "", ""))
    print()
    show_table(("node", ">from", ">to", ">missing", ">noise floor"), rows)


def _missing(runs: Sequence[FloatArray]) -> float:
    """Share of a sensor's readings that are missing, of those that it would give at its usual interval."""
    import numpy as np

    from lptn.logs.resampling import SEVERAL

    expected = there = 0.0
    for readings in runs:
        read = np.flatnonzero(np.isfinite(readings))
        apart = np.diff(read)
        usual = float(np.mean(apart[apart <= SEVERAL * np.median(apart)])) if apart.size else 1.0  # steps
        expected, there = expected + readings.size / usual, there + read.size
    return max(0.0, 1.0 - there / expected)


def _show_identifiability(effects: Sequence[Identifiability]) -> None:
    """Which effects could show, and which not and why."""
    from lptn.diagnose.excitation import NOT_LOGGED

    could = [assessment.effect for assessment in effects if assessment.identifiable]
    print(f"Could show, if present: {', '.join(could) or 'nothing'}.")
    reasons: dict[str, list[str]] = {}
    not_logged = []
    for assessment in effects:
        if assessment.why.startswith(NOT_LOGGED):
            not_logged.append(f"{assessment.effect} ({assessment.why.removeprefix(NOT_LOGGED)})")
        elif not assessment.identifiable:
            reasons.setdefault(assessment.why, []).append(assessment.effect)
    if reasons or not_logged:
        print("Could not:")
    for why, names in reasons.items():
        print(f"  {', '.join(names)}: {why}")
    if not_logged:
        print(f"  Columns missing: {', '.join(not_logged)}")
    print("These are rules of thumb; `lptn diagnose` computes what the data can show.")


def _show_steps(model: Model, bound: BoundRun) -> None:
    """How fast the network is, and the steps that forward Euler could take with it."""
    import numpy as np

    from lptn.report.text import short
    from lptn.simulate.bound_run import default_start
    from lptn.simulate.state_space import state_space

    form = state_space(model, default_start(model, bound), bound.inputs.mean(axis=1))
    finite = form.time_constants[np.isfinite(form.time_constants)]
    fastest, slowest = f"{form.time_constants[0]:.4g}", f"{finite.max():.4g}"
    spread = f"{fastest} s" if fastest == slowest else f"{fastest} to {slowest} s"
    euler = f"{short(form.euler_stable)} s (within 0.1 K to {short(form.euler_step(0.1))} s)"
    print(f"\nTime constants at the declared values: {spread}; forward Euler is stable with steps to {euler}.")
