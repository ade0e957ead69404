"""How much verdicts depend on each constant of the decision: the same cases, one constant a half more, or less.

    python -m tests.benchmarks.verdict_sensitivity --truths leg --tiers clean 1K rough --seeds 1431 --most 4 --first

For each constant it prints how many answers changed, verdict or any effect and place that is told, and how many first
effects were right. A constant whose answers stay the same needs no better reason than the one it has. Cases are those
of `verdict_cases`; seeds below 1500 are for looking at.
"""

from __future__ import annotations

import argparse
import ast
import inspect
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from itertools import repeat
from pathlib import Path
from typing import Any

import lptn
from lptn.basics.processes import one_blas_thread
from lptn.diagnose import composition, diagnosis
from lptn.diagnose.diagnosis import diagnose
from lptn.identify.data import DataSplit
from lptn.identify.fitting import Fit
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network
from tests.benchmarks.verdict_cases import TRUTHS, Case, draw_cases

ROOMS = ("answers", "candidates", "composition", "diagnosis", "evidence", "fit_statistics", "refits")


def numbers_of(module: str) -> list[str]:
    """Names of the numbers that a module holds itself, not of those that it imports."""
    tree = ast.parse(inspect.getsource(import_module(module)))
    names = [
        name.id
        for statement in tree.body
        if isinstance(statement, ast.Assign | ast.AnnAssign)
        for name in (statement.targets if isinstance(statement, ast.Assign) else [statement.target])
        if isinstance(name, ast.Name)
    ]
    held = vars(import_module(module))
    return [f"{module}.{name}" for name in names if name.isupper() and type(held.get(name)) in (int, float)]


CONSTANTS = tuple(name for room in ROOMS for name in numbers_of(f"lptn.diagnose.{room}"))
"""All that a diagnosis depends on, in order of the files."""
FACTORS = (1 / 1.5, 1.5)
ABOVE_ONE = frozenset(("LACKING", "CLEARLY", "OCCAM"))
"""Ratios: what lies above one is changed."""
STEPS = 3

# --- The same fit is made once for a case: most constants judge fits, and change none ---------------------------------

FITTERS = ("fit_segments", "continued")
"""Functions that `diagnosis` and `composition` use, whose result depends on their arguments."""


def fingerprint(thing: object) -> object:
    """What an argument of a fitter is, beside the data of the case."""
    if isinstance(thing, Network):
        return tuple((parameter.name, parameter.value, parameter.declared) for parameter in thing.parameters)
    if isinstance(thing, Fit):
        return fingerprint(thing.model.network), thing.cost
    if isinstance(thing, EffectDeclaration):
        return thing.name, thing.where, thing.difference, thing.parameters
    if isinstance(thing, Model):
        return fingerprint(thing.network)
    return thing if isinstance(thing, float) else str(type(thing))


@contextmanager
def remembered() -> Iterator[None]:
    """Within it a fitter that is asked the same thing of the same case answers from memory."""
    memory: dict[object, Any] = {}

    def once(fitter: Callable[..., Any]) -> Callable[..., Any]:
        def asked(*arguments: Any) -> Any:
            runs = tuple(len(argument) for argument in arguments if isinstance(argument, Sequence))
            key = (fitter.__name__, runs, *map(fingerprint, arguments))
            if key not in memory:
                memory[key] = fitter(*arguments)
            return memory[key]

        return asked

    users = [(module, name) for module in (composition, diagnosis) for name in FITTERS if name in vars(module)]
    before = [getattr(module, name) for module, name in users]
    for (module, name), fitter in zip(users, before, strict=True):
        setattr(module, name, once(fitter))
    try:
        yield
    finally:
        for (module, name), fitter in zip(users, before, strict=True):
            setattr(module, name, fitter)


Said = tuple[str, tuple[tuple[str, str], ...]]
"""The verdict, and effect and place of each step that is told."""


@contextmanager
def changed(constant: str, factor: float) -> Iterator[None]:
    """The constant times a factor, wherever it was imported to."""
    module, _, name = constant.rpartition(".")
    before = getattr(import_module(module), name)
    value = 1 + (before - 1) * factor if name in ABOVE_ONE else before * factor
    holders = [
        imported
        for key, imported in sys.modules.items()
        if key.startswith("lptn.") and vars(imported).get(name) is before
    ]
    for holder in holders:
        setattr(holder, name, type(before)(value))
    try:
        yield
    finally:
        for holder in holders:
            setattr(holder, name, before)


@cache
def question(case: Case) -> tuple[Model, DataSplit]:
    """Model and logs of a case."""
    with tempfile.TemporaryDirectory() as folder:
        files = TRUTHS[case.truth].files(case, Path(folder))
        loaded = lptn.load_model(files.model)
        return loaded.model, lptn.split_data(loaded.runs(files.fit), loaded.runs(files.holdout))


@one_blas_thread
def said(case: Case, first: bool) -> Said:
    """What the program says of a case: of one diagnosis, or of a whole improvement."""
    from lptn.diagnose.candidates import AMBIENT_ERROR, SURFACE_ERROR, TORQUE_ERROR

    model, data = question(case)
    errors: dict[str, Any] = {
        "ambient_error": AMBIENT_ERROR,
        "torque_error": TORQUE_ERROR,
        "surface_error": SURFACE_ERROR,
    }
    if first:
        result = diagnose(model, data, **errors)
        return result.verdict, tuple(step.key for step in result.steps)
    history = lptn.improve(model, data, most=STEPS, **errors)
    return history.verdict, tuple(step.key for step in history.steps[1:])


def right(case: Case, answer: Said) -> bool:
    """Whether the first step is what is hidden; where nothing is, whether nothing was said to be missing."""
    verdict, told = answer
    if case.kind == "nothing":
        return verdict == "adequate"
    return bool(told) and case.right(told[0])


def answers_of(case: Case, constants: Sequence[str], first: bool) -> list[Said]:
    """As things are, then with each constant at each factor."""
    with remembered():
        answers = [said(case, first)]
        for constant in constants:
            for factor in FACTORS:
                with changed(constant, factor):
                    answers.append(said(case, first))
    return answers


def main() -> None:
    """Ask, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--truths", nargs="*", choices=list(TRUTHS), default=["leg"])
    parser.add_argument("--tiers", nargs="*", default=["clean", "1K", "rough"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1431])
    parser.add_argument("--most", type=int, default=4)
    parser.add_argument("--constants", nargs="*", choices=CONSTANTS, default=CONSTANTS)
    parser.add_argument("--first", action="store_true", help="ask for one diagnosis, in a fifth of the time")
    parser.add_argument("--jobs", type=int, default=1)
    chosen = parser.parse_args()
    numbers = {"most": chosen.most, "pairs": 1, "nothing": 1, "outside": 1}
    cases = [case for truth in chosen.truths for case in draw_cases(truth, chosen.tiers, chosen.seeds, **numbers)]
    with ProcessPoolExecutor(chosen.jobs) as executor:
        of_cases = list(executor.map(answers_of, cases, repeat(chosen.constants), repeat(chosen.first)))
    now = [answers[0] for answers in of_cases]
    named = [case.kind != "outside" for case in cases]

    def score(answers: Sequence[Said]) -> str:
        asked = [right(case, answer) for case, answer, wanted in zip(cases, answers, named, strict=True) if wanted]
        return f"{sum(asked)}"

    print(f"{len(cases)} cases, {sum(named)} to be named or adequate; as it is: {score(now)} right")
    print("| constant | changed at ÷ 1.5 | right | changed at × 1.5 | right |", "| --- " * 5 + "|", sep="\n")
    for number, constant in enumerate(chosen.constants):
        cells = []
        for place in range(len(FACTORS)):
            varied = [answers[1 + number * len(FACTORS) + place] for answers in of_cases]
            cells += [str(sum(one != other for one, other in zip(varied, now, strict=True))), score(varied)]
        print(f"| {constant.removeprefix('lptn.diagnose.')} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
