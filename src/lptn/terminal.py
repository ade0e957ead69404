"""What the command says: tables, progress, JSON, one line for a mistake."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.table import Table

from lptn.advice import Advice
from lptn.compare import Comparison, Errors
from lptn.diagnose import Diagnosis, Finding
from lptn.files import write_whole
from lptn.for_json import finite
from lptn.identify import Fit
from lptn.ladder import Ladder
from lptn.on_evidence import MirrorTrial
from lptn.progress_line import ProgressLine
from lptn.versus import Versus

out = Console(highlight=False, soft_wrap=True)
err = Console(stderr=True, highlight=False, soft_wrap=True)

VERDICTS = {
    "adequate": "adequate: what is left is no more than the sensors' noise",
    "missing": "missing something: the catalogue explains most of what the model gets wrong",
    "unexplained": "unexplained: the model is wrong by more than noise, and the catalogue explains little of it",
}

_FEW = 3  # rivals named in a sentence
_LONG = "what it is"  # the one column that may wrap

_REMAINING = {
    "adequate": "adequate: what is left is no more than the sensors' noise",
    "missing": "still wrong by more than noise; further effects fitted the fitted runs, but did not help elsewhere",
    "unexplained": "still wrong by more than noise, and the catalogue explains little of the rest",
}


@contextmanager
def progress(first: str) -> Iterator[Callable[[str], None]]:
    """A line that says what is being done, from 2 s on with its time; silent where nobody watches.

    What is said as "7 of 20" also gets the time that is left.
    """
    if not err.is_terminal:
        yield lambda _: None
        return
    line = ProgressLine(first)
    with err.status(line):
        yield line.say


def write_json(path: Path | None, content: object) -> None:
    """Write a result for other programs; numbers that are not finite become null."""
    if path is not None:
        write_whole(path, json.dumps(finite(content), indent=2) + "\n")


def show_ladder(ladder: Ladder) -> None:
    """The ladder, rung by rung."""
    table = new_table("rung", "effect", "at", "parameters", "fit", "held out", "max held out")
    proven = any(rung.proof for rung in ladder.rungs)
    if proven:
        table.add_column("proof", justify="right")
    for number, rung in enumerate(ladder.rungs):
        at = "* (everywhere)" if rung.at == "*" else rung.at or ""
        cells = [str(number), rung.effect or "(as given)", at, str(rung.parameters), _kelvin(rung.fit.rmse)]
        holdout, proof = rung.holdout, rung.proof
        cells += [_kelvin(holdout.rmse if holdout else None), _kelvin(holdout.max if holdout else None)]
        table.add_row(*cells, *([_kelvin(proof.rmse if proof else None)] if proven else []))
    out.print(table)
    out.print("fit, held out: RMSE on the data fitted and on those held out; max: the largest error.")
    out.print(f"The model as given is {VERDICTS[ladder.verdict]}.")
    if len(ladder.rungs) > 1:
        out.print(f"With all that was added it is {_REMAINING[ladder.remaining]}.")
    out.print(who_chose(ladder))
    _show_granted(ladder.best.fit)
    for number, rung in enumerate(ladder.rungs):
        if rung.effect and rung.at:
            told = f"Rung {number}, {_in_words([(rung.effect, rung.at)])}: "
            if not rung.alike:
                told += "nothing else in the catalogue explains the fitted data as well"
            else:
                told += f"the fitted data alone can't tell it from {_in_words(rung.alike)}"
                told += "; the held-out data chose" if rung.holdout else ""
            out.print(f"{told}.", markup=False)
    _show_warnings(ladder.best.fit)


def _show_granted(fit: Fit) -> None:
    """That each run was granted an error of its own, where it was."""
    spreads = {unknown.declared.prior for unknown in fit.model.unknowns if unknown.declared.prior is not None}
    for spread in spreads:
        out.print(f"Each run, held-out ones too, was granted an ambient off by {spread:g} K (standard deviation).")


def who_chose(ladder: Ladder) -> str:
    """Which data chose the rungs and which proved them."""
    chose = "Effects were chosen on the fitted data."
    if ladder.rungs[0].holdout:
        chose += f" Held-out data chose among {ladder.considered} models that were tried, and where to end."
    else:
        chose += " No data were held out: the ladder ends by Schwarz's criterion; nothing proves it."
    return chose + (" Proof data chose nothing." if ladder.rungs[0].proof else "")


def show_diagnosis(found: Diagnosis) -> None:
    """Verdict, and the candidates that were refitted."""
    lack = ", ".join(f"{node} {value:.2g}" for node, value in found.scores.lack.items())
    out.print(f"The model is {VERDICTS[found.verdict]}.")
    step = found.fit.problem.drives[0].run.step
    out.print(f"RMSE {_kelvin(found.rmse_fit)} on the fitted runs{_held_out(found)}, in steps of {step:g} s.")
    out.print(f"Misfit over one-minute means, 1 being the most that noise would leave: {lack}.")
    _show_granted(found.fit)
    if not found.helpful:
        return
    if found.verdict == "missing":
        _show_first(found)
    table = new_table("rank", "effect", "at", "fit", "held out", "p", "like")
    ranks = {finding.key: str(rank) for rank, finding in enumerate(found.helpful, start=1)}
    for rank, finding in enumerate(found.helpful, start=1):
        effect, at = finding.key
        held = finding.holdout.rmse if finding.holdout else None
        chance = f"{'≤ ' if _finest(found, finding) else ''}{finding.p_value:.2g}"
        cells = [str(rank), effect, at, _kelvin(finding.rmse_fit), _kelvin(held), chance]
        table.add_row(*cells, " ".join(ranks[key] for key in finding.alike if key in ranks))
    out.print(table)
    out.print("fit, held out: RMSE once the effect is added. p: how often chance alone would score as much.")
    runs = any("@" in finding.key[1] for finding in found.helpful)
    told = f"at: * is everywhere.{' NODE@RUN is in that run alone.' if runs else ''}"
    out.print(f"{told} like: ranks that these data can't tell from it.", markup=False)
    if found.verdict == "missing":
        out.print("To add it, fit again, and look for more: `lptn improve` with the same model and logs.", markup=False)


def _show_first(found: Diagnosis) -> None:
    """The first answer in words: what, where, how much better, how sure."""
    first = found.helpful[0]
    told = f"Missing first of all: {_in_words([first.key])}. With it the RMSE goes from {_kelvin(found.rmse_fit)} to "
    told += f"{_kelvin(first.rmse_fit)} on the fitted runs"
    if found.holdout and first.holdout:
        told += f", from {_kelvin(found.holdout.rmse)} to {_kelvin(first.holdout.rmse)} on the held-out ones"
    chance = f"{'at most ' if _finest(found, first) else ''}{100 * first.p_value:.2g} %"
    told += f". Chance alone would score as much in {chance} of logs; "
    rivals = f"these data can't tell it from {_in_words(first.alike)}" if first.alike else ""
    out.print(f"{told}{rivals or 'nothing else in the catalogue explains them as well'}.", markup=False)


def _finest(found: Diagnosis, finding: Finding) -> bool:
    """Whether none of the simulated logs scored as much, so that the share by chance is only an upper bound."""
    return finding.p_value <= (1 + 1e-9) / (1 + len(found.scores.chance))


def show_advice(advice: Advice) -> None:
    """What to do next, a sentence or two each."""
    from lptn.report.text import for_people

    for told in advice.sentences:
        out.print(for_people(told), markup=False)


def show_written(files: Mapping[str, Path | None]) -> None:
    """Which files were written, each with what it is."""
    written = [f"{path} ({what})" for what, path in files.items() if path is not None]
    if written:
        out.print(f"Written: {', '.join(written)}.", markup=False)


def show_fit(done: Fit) -> None:
    """Values with standard errors, and what the data leave open."""
    table = new_table("parameter", "value", "± standard error", "unit")
    for index in done.problem.free:
        unknown = done.model.unknowns[index]
        error = done.errors[unknown.name]
        shown = f"{error:.2g}" if math.isfinite(error) else "not determined"
        table.add_row(unknown.name, f"{unknown.value:.4g}", shown, unknown.declared.unit)
    out.print(table)
    floor = ", ".join(f"{node} {value:.2g}" for node, value in zip(done.model.nodes, done.noise.floor, strict=True))
    out.print(f"RMSE {_kelvin(done.rmse)}; the sensors' noise alone: {floor} K. Search: {done.status}.")
    _show_warnings(done)


def _show_warnings(done: Fit) -> None:
    for warning in done.uncertainty.warnings:
        out.print(f"Warning: {warning}.", markup=False)


def show_comparison(comparison: Comparison) -> None:
    """Errors by run and node, and the conditions in which the model fails worst."""
    table = new_table("run", "node", "RMSE", "max", "mean error", "noise floor")
    for prediction in comparison.predictions:
        for node in comparison.model.nodes:
            errors = comparison.node(node, prediction)
            if errors.count:
                cells = (errors.rmse, errors.max, errors.mean, comparison.floor(node))
                table.add_row(prediction.part.run.name, node, *(_kelvin(cell) for cell in cells))
    out.print(table)
    out.print(f"All: RMSE {_kelvin(comparison.all.rmse)}, max {_kelvin(comparison.all.max)}.")
    worst = sorted(comparison.conditions(), key=lambda each: -each.errors.rmse)[:5]
    if worst:
        out.print("It fails worst where:")
    for each in worst:
        text = f"  {each.node}, {each.quantity} from {each.lower:.4g} to {each.upper:.4g}: "
        out.print(text + f"RMSE {_kelvin(each.errors.rmse)}, mean error {each.errors.mean:+#.2g} K", markup=False)


def show_versus(found: Versus) -> None:
    """Two models' errors by class of nodes and by run."""
    out.print(f"{found.names[0]} / {found.names[1]}", markup=False)
    for what, pairs in (("nodes", found.classes), ("run", found.runs)):
        table = new_table(what, "mean |error|", "max", "less", "mean square")
        for pair in pairs:
            cells = [f"{mine:.2f} / {others:.2f} {unit}" for mine, others, unit in pair.figures]
            table.add_row(pair.what, cells[0], cells[1], f"{pair.reduction:.0%}", cells[2])
        out.print(table)
    out.print("less: by how much the first model's largest error is below the second's.")


def show_mirror_trials(trials: Sequence[MirrorTrial]) -> None:
    """What each left-right weight gave on held-out runs."""
    if not trials:
        return
    table = new_table("left-right weight", "fit", "held out")
    for each in trials:
        table.add_row(f"{each.weight:g}", _kelvin(each.fit.rmse), _kelvin(each.holdout.rmse))
    out.print(table)


def show_holdout(errors: Errors | None) -> None:
    """Errors on runs that the fit never saw."""
    if errors is not None:
        out.print(f"Held out: RMSE {_kelvin(errors.rmse)}, max {_kelvin(errors.max)}.")


def _held_out(found: Diagnosis) -> str:
    return f", {_kelvin(found.holdout.rmse)} on the held-out ones" if found.holdout else ""


def _in_words(keys: Sequence[tuple[str, str]]) -> str:
    """Effects and their places; of many the first few, for all of them stand in the JSON and on the page."""
    from lptn.report.text import listed, named

    names = [named(*key) for key in keys]
    return listed(names if len(names) <= _FEW + 1 else [*names[:_FEW], f"{len(names) - _FEW} others"])


def _kelvin(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:#.3g}".rstrip(".") + " K"


def new_table(*columns: str) -> Table:
    """A table without lines; numbers stand to the right."""
    table = Table(box=None, header_style="bold", pad_edge=False)
    for column in columns:
        numeric = column in {
            "parameters",
            "fit",
            "held out",
            "max held out",
            "RMSE",
            "max",
            "less",
            "mean error",
            "mean |error|",
            "mean square",
            "value",
            "p",
        }
        table.add_column(column, justify="right" if numeric else "left", no_wrap=column != _LONG, overflow="fold")
    return table
