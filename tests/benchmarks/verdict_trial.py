"""Verdict trial: two versions of the program are asked the same questions, through their command line.

    python -m tests.benchmarks.verdict_trial --out trial.jsonl --versions old=OLD/bin/lptn new=NEW/bin/lptn \
        --two-masses NEW/bin/lptn --truths leg quadruped --seeds 1401 --most 4 --figure reliability.svg

Each case of `verdict_cases` becomes a model file and log files in a folder; each version runs `lptn improve` there,
alone and on one thread, with a limit on its processor time, and what it answered is a line of the output file. Cases
that the file holds already are not run again, so a trial can be stopped and gone on with; without `--versions` nothing
is run and the file is judged. Judged are only cases that all versions have answered.

Seeds 101, 102, 501 to 503, 701, 702, 731 and 741 to 743 were looked at while versions before this trial were made.
Those from 1401 to 1499 are for looking at while something is changed; from 1500 on they are for a table, and looked
at once.
"""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path

from tests.benchmarks.verdict_answers import (
    LIMIT,
    SILLY,
    TWO_MASSES,
    Answer,
    ask,
    ask_first,
    command_of,
    out_of_bounds,
    read_results,
    run_missing,
)
from tests.benchmarks.verdict_cases import TRUTHS, Case, Files, Key, draw_cases, with_bounds

CREDIBLE = 0.9
"""Probability that the set of answers, the most probable first, has to reach."""
NOTHING: Key = ("", "")
"""The answer that nothing is missing."""


# --- judging an answer ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Judged:
    """One answer held against the truth.

    Args:
        first: the first step is right; where nothing is hidden, nothing was said to be missing; outside the catalogue,
            it was called unexplained.
        in_set: a right answer is in the set that holds 90 % of the probability, or in the group of the first step where
            no probability is stated.
        in_three: a right answer is among the first three steps.
        placed: one of the first three steps that are of one place, not of all, is where something is hidden; where that
            is everywhere, a right answer is among the first three steps.
        named: a right answer is among all steps.
        left_open: a right answer is among all steps and what the data can't tell from one of them.
        silly: a step is an error of a sensor, a clock or the ambient that isn't there.
        at_bound: something was added, and a parameter ended at a bound, or a size where no robot has it.
        alarm: nothing is hidden, and something was said to be missing.
        unexplained: the verdict on the model as given, or on the last step, is "unexplained".
        stated: probability of the most probable answer, `None` where none is stated.
        true: whether that answer is right, or true of this robot whatever was hidden.
        told: of each effect that is not true of every such robot its probability, and whether it is right.
    """

    first: bool
    in_set: bool
    in_three: bool
    placed: bool
    named: bool
    left_open: bool
    silly: bool
    at_bound: bool
    alarm: bool
    unexplained: bool
    stated: float | None
    true: bool
    told: tuple[tuple[float, bool], ...]


def judged(case: Case, answer: Answer) -> Judged:
    """An answer held against the truth; one that failed is wrong, and not silly."""
    kind = case.kind
    failed, unexplained = bool(answer.error), "unexplained" in (answer.verdict, answer.remaining)

    def right(named: Key) -> bool:
        return named == NOTHING if kind == "nothing" else named != NOTHING and case.right(named)

    def at_hidden(named: Key) -> bool:
        ends = named[1].partition("@")[0].split("~")
        places = [text.split("@")[1].split("~") for text in case.hidden]
        return any(sorted(ends) == sorted(place) or ends[0:1] == place for place in places)

    beside = [step for step in answer.steps if not case.natural(step)]
    alarm = kind == "nothing" and not failed and bool(beside or (answer.verdict != "adequate" and not answer.steps))
    names = answer.steps[:3] or ([NOTHING] if answer.verdict == "adequate" else [])
    first = bool(names) and right(names[0])
    in_set = any(map(right, credible_set(answer)))
    if kind == "nothing":
        first = in_set = not failed and not alarm
    if kind == "outside":
        first = in_set = unexplained
    in_three = first if kind in ("nothing", "outside") else any(map(right, names))
    local = [step for step in answer.steps if "*" not in step[1]][:3]
    everywhere = kind in ("nothing", "outside") or any("*" in text for text in case.hidden)
    stated, true = None, False
    if answer.probabilities:
        effect, at, stated = answer.probabilities[0]
        # Beside "unexplained" nothing means nothing of the catalogue.
        true = unexplained if kind == "outside" and not effect else right((effect, at)) or case.natural((effect, at))
    return Judged(
        first=first,
        in_set=in_set,
        in_three=in_three,
        placed=in_three if everywhere else any(map(at_hidden, local)),
        named=first if kind in ("nothing", "outside") else any(map(right, [*names, *answer.steps])),
        left_open=first if kind in ("nothing", "outside") else any(map(right, [*names, *answer.steps, *answer.names])),
        silly=any(step[0] in SILLY and not (case.right(step) or case.natural(step)) for step in answer.steps),
        at_bound=bool(out_of_bounds(answer)),
        alarm=alarm,
        unexplained=unexplained,
        stated=stated,
        true=true,
        told=tuple(
            (share, right((effect, at)))
            for effect, at, share in answer.probabilities or ()
            if effect and not case.natural((effect, at))
        ),
    )


def credible_set(answer: Answer) -> list[Key]:
    """The most probable answers that hold 90 % together; the group of the first step where no probability is stated."""
    if answer.probabilities is None:
        return answer.group or ([NOTHING] if answer.verdict == "adequate" else [])
    chosen: list[Key] = []
    total = 0.0
    for effect, at, probability in answer.probabilities:
        if total >= CREDIBLE:
            break
        chosen.append((effect, at))
        total += probability
    return chosen


# --- tables ---------------------------------------------------------------------------------------------------------

Results = Mapping[tuple[Case, str], Answer]


def table(results: Results, cases: Sequence[Case], versions: Sequence[str]) -> str:
    """Shares of right answers by truth, tier and kind of case, the versions side by side, as Markdown."""
    common = [case for case in cases if all((case, version) in results for version in versions)]
    names = " · ".join(versions)
    lines = [
        f"Each cell: {names}; {len(common)} cases that all were asked. Errors: medians, held out, before → after.",
        "",
        "| truth | sensors | hidden | cases | first | in the 90 % set | in three steps "
        "| place in three findings | named | left open | silly "
        "| at a bound | false alarm | unexplained | failed | error, K | two masses, K | CPU s |",
        "| --- " * 18 + "|",
    ]
    groups: dict[tuple[str, str, str], list[Case]] = {}
    for case in common:
        groups.setdefault((case.truth, case.tier, case.kind), []).append(case)
        groups.setdefault((case.truth, "all", case.kind), []).append(case)
    for (truth, tier, kind), members in sorted(groups.items()):
        if tier == "all" and len({case.tier for case in members}) == 1:
            continue
        cells = [truth, tier, kind, str(len(members)), *_cells(results, members, versions)]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _cells(results: Results, cases: Sequence[Case], versions: Sequence[str]) -> list[str]:
    """A row's cells, from "first" on."""
    said = [[results[case, version] for case in cases] for version in versions]
    marks = [[judged(case, answer) for case, answer in zip(cases, answers, strict=True)] for answers in said]
    names = ("first", "in_set", "in_three", "placed", "named", "left_open", "silly", "at_bound", "alarm", "unexplained")
    shares = [[statistics.mean(getattr(mark, name) for mark in verdicts) for verdicts in marks] for name in names]
    shares.append([statistics.mean(bool(answer.error) for answer in answers) for answers in said])
    before, after = ([_median(a.holdout[k] for a in answers if a.holdout) for answers in said] for k in (0, -1))
    by_hand = [results[case, TWO_MASSES].holdout for case in cases if (case, TWO_MASSES) in results]
    return [
        *(" · ".join(f"{one:.2f}" for one in row) for row in shares),
        " · ".join(f"{one} → {other}" for one, other in zip(before, after, strict=True)),
        _median(values[0] for values in by_hand if values),
        " · ".join(_median(answer.seconds for answer in answers) for answers in said),
    ]


def _median(values: Iterable[float]) -> str:
    numbers = list(values)
    return f"{statistics.median(numbers):.3g}" if numbers else "–"


def misses(results: Results, cases: Sequence[Case], versions: Sequence[str]) -> str:
    """Every answer that is wrong or silly, as a Markdown table."""
    lines = [
        "| version | truth | sensors | hidden | seed | verdict | steps | what is wrong | error, K | CPU s |",
        "| --- " * 10 + "|",
    ]
    for case in cases:
        for version in versions:
            answer = results.get((case, version))
            if answer is None:
                continue
            wrong = _wrong(case, answer)
            if not wrong:
                continue
            steps = ", ".join(f"{effect}@{at}" for effect, at in answer.steps) or "–"
            errors = " → ".join(f"{answer.holdout[k]:.3g}" for k in (0, -1)) if answer.holdout else "–"
            hidden = ", ".join(case.hidden) or "nothing"
            said = f"{answer.verdict}/{answer.remaining}"
            lines.append(
                f"| {version} | {case.truth} | {case.tier} | {hidden} | {case.seed} | {said} | {steps} "
                f"| {', '.join(wrong)} | {errors} | {answer.seconds:.0f} |"
            )
    return "\n".join(lines)


def _wrong(case: Case, answer: Answer) -> list[str]:
    """What is wrong with an answer, in words; nothing for a right one."""
    if answer.error:
        return [f"failed: {answer.error}"]
    mark, words = judged(case, answer), []
    if mark.alarm:
        words.append("false alarm")
    elif case.kind == "outside" and not mark.unexplained:
        words.append("not called unexplained")
    elif not mark.first:
        words.append(
            "in three"
            if mark.in_three
            else "named later"
            if mark.named
            else "in the set"
            if mark.in_set
            else "not named"
        )
    words += ["silly"] * mark.silly
    return words + [f"at a bound: {', '.join(out_of_bounds(answer))}"] * mark.at_bound


# --- stated against observed probability ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Bin:
    """Answers with like stated probability: how many, their mean probability, how many were right, and the interval
    (95 %, Clopper and Pearson) of the observed frequency."""

    count: int
    stated: float
    right: int
    lower: float
    upper: float


BINS = (0.0, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0)
"""Edges; finer where answers are sure, since these are believed."""


def reliability(answers: Iterable[tuple[float, bool]]) -> list[Bin]:
    """Bins of stated probability and what was observed in each; empty ones are left out.

    Args:
        answers: stated probability, and whether the answer was right.
    """
    from scipy.stats import binomtest

    pairs, bins = list(answers), []
    for lower, upper in pairwise(BINS):
        inside = [(p, true) for p, true in pairs if lower <= p < upper or (upper == BINS[-1] and p >= upper)]
        if inside:
            right = sum(true for _, true in inside)
            interval = binomtest(right, len(inside)).proportion_ci(0.95, "exact")
            stated = statistics.mean(p for p, _ in inside)
            bins.append(Bin(len(inside), stated, right, interval.low, interval.high))
    return bins


def draw_reliability(bins: Mapping[str, Sequence[Bin]], file: Path) -> None:
    """The diagram: observed frequency over stated probability, with intervals and how many answers there are.

    Args:
        bins: of each truth, a panel each.
        file: .svg or .png.
    """
    from lptn.basics.style import FAINT, GIVEN, INK, SMALL, TINY, dress, new_figure

    figure = new_figure(4.2)
    for ax, (name, group) in zip(figure.subplots(1, len(bins), squeeze=False)[0], bins.items(), strict=True):
        ax.plot([0, 1], [0, 1], color=FAINT, linewidth=0.8)
        for one in group:
            ax.plot([one.stated] * 2, [one.lower, one.upper], color=GIVEN["color"], linewidth=1.2)
            ax.plot(one.stated, one.right / one.count, color=INK, marker="o", markersize=4)
            ax.annotate(
                str(one.count),
                (one.stated, one.lower),
                (0, -3),
                textcoords="offset points",
                ha="center",
                va="top",
                fontsize=TINY,
            )
        ax.set(xlim=(0, 1.03), ylim=(0, 1.03), xlabel="stated probability of the first answer")
        ax.set_ylabel("share that was right, and its 95 % interval")
        ax.set_title(f"{name}: {sum(one.count for one in group)} answers", fontsize=SMALL)
        ax.set_aspect("equal")
        dress(ax)
    figure.savefig(file)


def calibration(results: Results, cases: Sequence[Case], version: str) -> dict[str, list[Bin]]:
    """Bins of a version's stated probabilities: of the first answers, all and of each truth; of all effects told."""
    pairs: dict[str, list[tuple[float, bool]]] = {}
    for case in cases:
        answer = results.get((case, version))
        if answer is None:
            continue
        mark = judged(case, answer)
        if mark.told:
            pairs.setdefault("effects told", []).extend(mark.told)
        if mark.stated is not None:
            name = "finite volumes" if case.truth.startswith("finite") else "the catalogue's formulas"
            for group in ("all", name):
                pairs.setdefault(group, []).append((mark.stated, mark.true))
    return {name: reliability(outcomes) for name, outcomes in pairs.items()}


def _files(case: Case, folder: Path, *, bounds: bool) -> Files:
    files = TRUTHS[case.truth].files(case, folder)
    return with_bounds(files) if bounds else files


def main() -> None:
    """Run what is missing, then print table, misses and calibration."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--out", type=Path, required=True, help="answers as JSON lines; what it holds is not asked again"
    )
    parser.add_argument("--versions", nargs="*", type=command_of, default=[], help="NAME=COMMAND; none: only judge")
    parser.add_argument(
        "--judge", nargs="*", default=["old", "new"], help="versions to show; those without answers aren't"
    )
    parser.add_argument("--two-masses", type=Path, help="command that fits a network with two masses a node")
    parser.add_argument("--truths", nargs="*", choices=list(TRUTHS), default=list(TRUTHS))
    tiers = list(dict.fromkeys(tier for truth in TRUTHS.values() for tier in truth.tiers))
    parser.add_argument("--tiers", nargs="*", choices=tiers, default=tiers)
    parser.add_argument("--seeds", nargs="+", type=int, default=[1401])
    parser.add_argument(
        "--most", type=int, default=1000, help="cases with one thing hidden, for each truth, tier, seed"
    )
    parser.add_argument("--pairs", type=int, default=2, help="cases with two things hidden")
    parser.add_argument("--nothing", type=int, default=2, help="cases with nothing hidden")
    parser.add_argument("--outside", type=int, default=2, help="cases with what no catalogue has")
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time")
    parser.add_argument("--limit", type=float, default=LIMIT, help="s of processor time for an answer")
    parser.add_argument("--bounds", action="store_true", help="models without priors, which older versions don't read")
    parser.add_argument("--first", action="store_true", help="ask `lptn diagnose`: the first answer alone")
    parser.add_argument("--figure", type=Path, help="reliability diagram to write, .svg or .png")
    chosen = parser.parse_args()
    numbers = {name: getattr(chosen, name) for name in ("most", "pairs", "nothing", "outside")}
    cases = [case for truth in chosen.truths for case in draw_cases(truth, chosen.tiers, chosen.seeds, **numbers)]
    if chosen.versions or chosen.two_masses:
        files = {case: partial(_files, case, bounds=chosen.bounds) for case in cases}
        question = ask_first if chosen.first else ask
        limits = {"jobs": chosen.jobs, "limit": chosen.limit}
        run_missing(files, dict(chosen.versions), chosen.two_masses, chosen.out, **limits, question=question)
    results = read_results(chosen.out)
    versions = [name for name in chosen.judge if any((case, name) in results for case in cases)]
    print(table(results, cases, versions), misses(results, cases, versions), sep="\n\n")
    for version in versions:
        bins = calibration(results, cases, version)
        for name, group in bins.items():
            print(f"\nStated by {version}, {name}:")
            for one in group:
                print(f"  {one.stated:.2f}: {one.right} of {one.count} right, {one.lower:.2f} to {one.upper:.2f}")
        if bins and chosen.figure:
            names = [name for name in bins if name not in ("all", "effects told")]
            draw_reliability({name: bins[name] for name in names}, chosen.figure)


if __name__ == "__main__":
    main()
