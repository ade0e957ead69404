"""Measured data that are shipped with the project: what versions of the program say of them, step by step.

    python -m tests.benchmarks.measured_verdicts --out measured.jsonl --versions old=OLD/bin/lptn new=NEW/bin/lptn

Nobody knows the truth here. So each step is printed with its sizes beside the usual ones, and with what makes it
doubtful: an error of a sensor, a clock or the ambient; a size at a bound or not told from zero; an error in the
held-out data that it did not lower. `--shared FOLDER` adds two logs that the project does not ship.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from tests.benchmarks.verdict_answers import (
    LIMIT,
    SILLY,
    Answer,
    command_of,
    in_short,
    out_of_bounds,
    read_results,
    run_missing,
)
from tests.benchmarks.verdict_cases import Case, Files

EXAMPLES = Path(__file__).parents[2] / "examples"
UNUSUAL = 10.0
"""A size this many times the catalogue's usual one, or this many times smaller, is marked."""
COOLING_FROM = 250.0  # s: in Run3u the power, which nobody logged, has ended by then, and the fall of 9 K with it

# --- the data -------------------------------------------------------------------------------------------------------


def _tclab(_folder: Path) -> Files:
    return Files(_at("tclab", "two_heaters.toml"), (_at("tclab", "log.csv"),), (), ("--holdout-after", "300"))


def _motor(model: str, _folder: Path) -> Files:
    return Files(_at("pmsm", f"{model}.toml"), (_at("pmsm", "log.csv"),), (), ("--holdout-after", "4400"))


def _stator(model: str, fitted: str, held_out: str, _folder: Path) -> Files:
    logs, others = (tuple(_at("bldc_stators", f"Run{number}.csv") for number in text) for text in (fitted, held_out))
    return Files(_at("bldc_stators", f"{model}.toml"), logs, others)


def _arm(model: str, _folder: Path) -> Files:
    return Files(_at("ur3", f"{model}.toml"), (_at("ur3", "warm_up.parquet"),), (_at("ur3", "later.parquet"),))


def _one_step(shared: Path, folder: Path) -> Files:
    """Another board: one heater is switched on, and stays on."""
    log = pd.read_csv(shared / "tclab" / "tclab_step_nd.csv").drop_duplicates("time_s")
    log.assign(Q2_pct=0.0).to_csv(folder / "step.csv", index=False)
    return Files(_at("tclab", "two_heaters.toml"), (folder / "step.csv",), (), ("--holdout-after", "400"))


def _cool_down(shared: Path, folder: Path) -> Files:
    """A stator that cools in still air is predicted from three heatings."""
    log = pd.read_csv(shared / "bldc_stator_heating" / "Run3u_daq.csv")
    log = log[log["time_s"] >= COOLING_FROM]
    log = log.groupby(np.floor(log["time_s"])).mean().drop(columns="time_s").reset_index()
    log = log.rename(columns={"T_stator_body": "T_body"}).assign(power_W=0.0)
    log.to_csv(folder / "Run3u.csv", index=False)
    heatings = _stator("two_nodes", "135", "", folder)
    return Files(heatings.model, heatings.fit, (folder / "Run3u.csv",))


def _at(*names: str) -> Path:
    return EXAMPLES.joinpath(*names)


MEASURED: dict[str, Callable[[Path], Files]] = {
    "TCLab": _tclab,
    "PMSM, winding": partial(_motor, "winding"),
    "PMSM, four nodes": partial(_motor, "four_nodes"),
    "stator, run 5 held out": partial(_stator, "two_nodes", "13", "5"),
    "stator, run 3 held out": partial(_stator, "two_nodes", "15", "3"),
    "stator, run 1 held out": partial(_stator, "two_nodes", "35", "1"),
    "stator, a run with a fan held out": partial(_stator, "two_nodes", "135", "4"),
    "stator, own surfaces, run 5 held out": partial(_stator, "own_surfaces", "13", "5"),
    "stator, own surfaces, a run with a fan held out": partial(_stator, "own_surfaces", "135", "4"),
    "UR3, single nodes": partial(_arm, "single_nodes"),
    "UR3, coupled": partial(_arm, "coupled"),
}
SHARED: dict[str, Callable[[Path, Path], Files]] = {
    "TCLab, one step on another board": _one_step,
    "stator, a cool-down held out": _cool_down,
}
"""From data that are not in the project."""


# --- what is said of them -------------------------------------------------------------------------------------------


def story(answer: Answer) -> str:
    """An answer's steps, a line each, with sizes and with what makes them doubtful."""
    if answer.error:
        return f"- {in_short(answer)}"
    held_out = [f"{error:.3g}" for error in answer.holdout] or ["–"]
    lines = [
        f"- {answer.verdict}, at last {answer.remaining}; held out {' → '.join(held_out)} K; {answer.seconds:.0f} s"
    ]
    if answer.probabilities:
        most = [f"{effect or 'nothing'} at {at} {p:.2f}" for effect, at, p in answer.probabilities[:4]]
        lines.append(f"  - probable: {'; '.join(most)}")
    for number, (effect, at) in enumerate(answer.steps, 1):
        doubts = ["an error of sensor, clock or ambient"] * (effect in SILLY)
        if len(answer.holdout) > number and answer.holdout[number] > answer.holdout[number - 1]:
            doubts.append("held-out error rises")
        sizes = "; ".join(_sizes(answer, effect, at)) or "no free size"
        lines.append(f"  - {number}. {effect} at {at}: {sizes}{' **' + ', '.join(doubts) + '**' if doubts else ''}")
    for effect, at in answer.differing:
        lines.append(f"  - a held-out run differs: {f'{effect} at {at}' if effect else 'nothing names how'}")
    others = [name for name in out_of_bounds(answer) if not any(name.startswith(f"{key}.") for key, _ in answer.steps)]
    lines += [f"  - **of the given model at a bound: {', '.join(others)}**"] * bool(others)
    sentences = re.findall(r"^(?:Step|Rung) \d+[, ].*(?:\n  .*)*", answer.text, re.MULTILINE)
    lines += [f"  - says: {' '.join(sentence.split())}" for sentence in sentences]
    return "\n".join(lines)


def _sizes(answer: Answer, effect: str, at: str) -> list[str]:
    """Fitted sizes of one step: value, standard error, how many times the usual size, and doubts."""
    from lptn.effects import catalogue

    kinds, sizes = catalogue(), []
    declared = {parameter.name: parameter for parameter in kinds[effect].parameters} if effect in kinds else {}
    for name, (value, error) in answer.parameters.items():
        own, _, rest = name.partition(".")
        short, _, owner = rest.partition(".")
        # A step at a pattern has a size at each of its places, or one under the pattern's own name.
        if own != effect or short not in declared or not _stands_at(owner, at):
            continue
        parameter = declared[short]
        times = abs(value / parameter.typical) if parameter.typical else math.nan
        doubts = [f"{times:.2g} times the usual"] * (not 1 / UNUSUAL < times < UNUSUAL)
        doubts += ["at a bound"] * (name in out_of_bounds(answer))
        doubts += ["not told from zero"] * (not abs(value) > 2 * error and parameter.off is not None)
        marked = f" **{', '.join(doubts)}**" if doubts else ""
        sizes.append(f"{short} {value:.3g} ± {error:.2g} {parameter.unit}{marked}")
    return sizes


def _stands_at(owner: str, at: str) -> bool:
    from fnmatch import fnmatchcase

    return owner == at or fnmatchcase(owner, at) or fnmatchcase(owner.partition("@")[0], at)


def summary(answers: Mapping[str, Answer]) -> str:
    """A version's answers in one line each, as a Markdown table."""
    lines = ["| data | steps | silly | at a bound | verdict | held out, K | CPU s |", "| --- " * 7 + "|"]
    for name, answer in answers.items():
        steps = ", ".join(f"{effect}@{at}" for effect, at in answer.steps) or answer.error or "–"
        silly = ", ".join(effect for effect, _ in answer.steps if effect in SILLY) or "–"
        bound = ", ".join(out_of_bounds(answer)) or "–"
        error = " → ".join(f"{answer.holdout[k]:.3g}" for k in (0, -1)) if answer.holdout else "–"
        said = f"{answer.verdict}/{answer.remaining}"
        lines.append(f"| {name} | {steps} | {silly} | {bound} | {said} | {error} | {answer.seconds:.0f} |")
    return "\n".join(lines)


def main() -> None:
    """Ask what is missing, then print stories and a table for each version."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--out", type=Path, required=True, help="answers as JSON lines; what it holds is not asked again"
    )
    parser.add_argument("--versions", nargs="*", type=command_of, default=[], help="NAME=COMMAND; none: only print")
    parser.add_argument("--judge", nargs="*", default=["old", "new"], help="versions to show")
    parser.add_argument("--shared", type=Path, help="folder of measured data that the project does not ship")
    parser.add_argument("--only", nargs="*", default=[], help="parts of names of the data; none: all")
    parser.add_argument("--limit", type=float, default=LIMIT, help="s of processor time for an answer")
    chosen = parser.parse_args()
    sources = dict(MEASURED)
    if chosen.shared is not None:
        sources |= {name: partial(files, chosen.shared) for name, files in SHARED.items()}
    wanted = {
        name: files for name, files in sources.items() if not chosen.only or any(one in name for one in chosen.only)
    }
    asked = {Case("measured", name, (), 0): files for name, files in wanted.items()}
    run_missing(asked, dict(chosen.versions), None, chosen.out, limit=chosen.limit)
    results = read_results(chosen.out)
    for case in asked:
        print(f"\n{case.tier}")
        for version in chosen.judge:
            if (case, version) in results:
                print(f"\n{version}:", story(results[case, version]), sep="\n")
    for version in chosen.judge:
        answers = {case.tier: results[case, version] for case in asked if (case, version) in results}
        if answers:
            print(f"\n{version}:\n", summary(answers), sep="\n")


if __name__ == "__main__":
    main()
