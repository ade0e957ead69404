"""What the command says: tables, progress, JSON, one line for a mistake."""

from __future__ import annotations

import json
import math
import os
import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TextIO, cast

from rich.console import Console
from rich.table import Table

from lptn.basics.files import finite, write_whole
from lptn.diagnose.advice import Advice
from lptn.diagnose.diagnosis import Diagnosis, Finding
from lptn.diagnose.improvement import History
from lptn.identify.comparison import Comparison, Errors, Versus
from lptn.identify.fitting import Fit
from lptn.identify.validation import SymmetryTrial

# --- The line that says what is being done, for how long, and how long it will take where a total is known ---


_QUIET = 2.0  # s without a word about time
_COUNTED = re.compile(r"(\d+) of (\d+)\b")


class ProgressLine:
    """What is being done, as said last, with the time that it took and will take.

    A message with "7 of 20" in it tells how far a count has come: 6 are done, and the 14 left are taken to last as long
    each as those did. The clock of a count starts when its total is first said.

    Args:
        first: what is said at the start.
        clock: seconds from anywhere.
    """

    def __init__(self, first: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._began = clock()
        self._count: tuple[str, float, int] | None = None  # what is counted, since when, from which number
        self._said = first
        self.say(first)

    def say(self, message: str) -> None:
        """Say what is being done now."""
        found = _COUNTED.search(message)
        if found is None:
            self._count = None
        elif self._count is None or self._count[0] != found[2]:
            self._count = (found[2], self._clock(), int(found[1]))
        self._said = message

    def __rich__(self) -> str:
        """The line as it stands now: rich asks for it many times a second."""
        now = self._clock()
        if now - self._began < _QUIET:
            return _plain(self._said)
        left = self._left(now)
        rest = f", about {duration(left)} left" if left is not None else ""
        return _plain(f"{self._said} ({duration(now - self._began)}{rest})")

    def _left(self, now: float) -> float | None:
        found = _COUNTED.search(self._said)
        if found is None or self._count is None:
            return None
        total, since, first = self._count
        done = int(found[1]) - first
        return (now - since) / done * (int(total) - first - done + 1) if done > 0 else None


def duration(seconds: float) -> str:
    """Seconds as a person says them: `8 s`, `3 min 5 s`, `2 h 10 min`."""
    whole = max(0, round(seconds))
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def _plain(text: str) -> str:
    """Brackets are units and names here, not rich's markup."""
    return text.replace("[", r"\[")


# --- Standard output that nobody reads any more, as in `lptn effects | head`: the command goes on and writes its files ---


class _Output:
    """A text stream that drops what nobody reads; whatever else is asked of it, the stream answers."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        try:
            return self._stream.write(text)
        except OSError as error:
            self._let_go(error)
            return len(text)

    def flush(self) -> None:
        try:
            self._stream.flush()
        except OSError as error:
            self._let_go(error)

    def writelines(self, lines: list[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _let_go(self, error: OSError) -> None:
        """Send the rest nowhere, so that Python has nothing to complain of when it ends."""
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)
        if not isinstance(error, BrokenPipeError):
            raise error


@contextmanager
def spared_closed_pipes() -> Iterator[None]:
    """Within it a closed standard output is no error; a full disk behind it still is.

    Raises:
        OSError: standard output can't be written for another reason than that nobody reads it.
    """
    usual = sys.stdout
    if usual is None:  # `lptn … >&-`
        with open(os.devnull, "w") as nowhere:  # noqa: PTH123
            sys.stdout = nowhere
            try:
                yield
            finally:
                sys.stdout = usual
        return
    output = _Output(usual)
    sys.stdout = cast("TextIO", output)
    try:
        yield
    finally:
        sys.stdout = usual
        output.flush()


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


def show_ladder(history: History) -> None:
    """The ladder, rung by rung."""
    table = new_table("rung", "effect", "at", "parameters", "fit", "held out", "max held out")
    proven = any(step.test for step in history.steps)
    if proven:
        table.add_column("proof", justify="right")
    for number, step in enumerate(history.steps):
        at = "* (everywhere)" if step.at == "*" else step.at or ""
        cells = [str(number), step.effect or "(as given)", at, str(step.parameters), _kelvin(step.fit.rmse)]
        holdout, test = step.holdout, step.test
        cells += [_kelvin(holdout.rmse if holdout else None), _kelvin(holdout.max if holdout else None)]
        table.add_row(*cells, *([_kelvin(test.rmse if test else None)] if proven else []))
    out.print(table)
    out.print("fit, held out: RMSE on the data fitted and on those held out; max: the largest error.")
    out.print(f"The model as given is {VERDICTS[history.verdict]}.")
    if len(history.steps) > 1:
        out.print(f"With all that was added it is {_REMAINING[history.remaining]}.")
    out.print(who_chose(history))
    _show_granted(history.best.fit)
    for number, step in enumerate(history.steps):
        if step.effect and step.at:
            told = f"Rung {number}, {_in_words([(step.effect, step.at)])}: "
            if not step.indistinguishable:
                told += "nothing else in the catalogue explains the fitted data as well"
            else:
                told += f"the fitted data alone can't tell it from {_in_words(step.indistinguishable)}"
                told += "; the held-out data chose" if step.holdout else ""
            out.print(f"{told}.", markup=False)
    _show_warnings(history.best.fit)


def _show_granted(fit: Fit) -> None:
    """That each run was granted an error of its own, where it was."""
    spreads = {parameter.declared.prior for parameter in fit.model.parameters if parameter.declared.prior is not None}
    for spread in spreads:
        out.print(f"Each run, held-out ones too, was granted an ambient off by {spread:g} K (standard deviation).")


def who_chose(history: History) -> str:
    """Which data chose the rungs and which proved them."""
    chose = "Effects were chosen on the fitted data."
    if history.steps[0].holdout:
        chose += f" Held-out data chose among {history.considered} models that were tried, and where to end."
    else:
        chose += " No data were held out: the ladder ends by Schwarz's criterion; nothing proves it."
    return chose + (" Proof data chose nothing." if history.steps[0].test else "")


def show_diagnosis(found: Diagnosis) -> None:
    """Verdict, and the candidates that were refitted."""
    lack = ", ".join(f"{node} {value:.2g}" for node, value in found.scores.lack.items())
    out.print(f"The model is {VERDICTS[found.verdict]}.")
    step = found.fit.problem.bound_runs[0].run.step
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
        table.add_row(*cells, " ".join(ranks[key] for key in finding.indistinguishable if key in ranks))
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
    rivals = f"these data can't tell it from {_in_words(first.indistinguishable)}" if first.indistinguishable else ""
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
        parameter = done.model.parameters[index]
        error = done.standard_errors[parameter.name]
        shown = f"{error:.2g}" if math.isfinite(error) else "not determined"
        table.add_row(parameter.name, f"{parameter.value:.4g}", shown, parameter.declared.unit)
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
                table.add_row(prediction.segment.run.name, node, *(_kelvin(cell) for cell in cells))
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


def show_symmetry_trials(trials: Sequence[SymmetryTrial]) -> None:
    """What each left-right weight gave on held-out runs."""
    if not trials:
        return
    table = new_table("left-right weight", "fit", "held out")
    for each in trials:
        table.add_row(f"{each.symmetry_penalty:g}", _kelvin(each.fit.rmse), _kelvin(each.holdout.rmse))
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
