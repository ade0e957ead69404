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
import contextlib
import json
import os
import re
import resource
import signal
import statistics
import subprocess
import tempfile
import threading
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from tests.benchmarks.verdict_cases import TRUTHS, Case, Files, Key, draw_cases, second_masses

LIMIT = 900.0  # s of processor time that a version has for a case
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
CREDIBLE = 0.9
"""Probability that the set of answers, the most probable first, has to reach."""
NOTHING: Key = ("", "")
"""The answer that nothing is missing."""
SILLY = ("sensor_drift", "clock_offset", "ambient_offset", "ambient_lag")
"""Effects that are rarely true and easily fitted: errors of a sensor, a clock, the ambient."""
FARTHEST = {
    "sensor_drift.rate": 30.0,  # K/h
    "sensor_offset.offset": 10.0,  # K
    "ambient_offset.offset": 20.0,  # K
    "clock_offset.delay": 120.0,  # s
    "ambient_lag.time_constant": 50_000.0,  # s
    "second_mass.time_constant": 20_000.0,  # s
    "shared_mass.time_constant": 50_000.0,  # s
    "sensor_lag.time_constant": 1000.0,  # s
    "hot_spot.time_constant": 300.0,  # s
    "natural_convection.beta": 0.05,  # 1/K
    "resistance_rise.alpha": 0.02,  # 1/K
    "torque_constant_drop.kappa": 0.005,  # 1/K
    "radiation.area": 10.0,  # m²
}
"""Sizes that no robot reaches: the bounds that the catalogue had once. Without a bound such a size is as silly."""


# --- one question to one version ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Answer:
    """What a version said, as it said it; nothing here is judged.

    Args:
        verdict, remaining: on the model as given, and with all that was added; "" where the command failed.
        steps: effect and place of each step.
        group: names that the first step can't be told from, itself included.
        probabilities: effect, place and probability of what the model as given lacks, the most probable first;
            `NOTHING` for nothing. `None` where the version states none.
        holdout: held-out RMSE of each step, the given model first [K].
        parameters: fitted value and standard error of each free parameter of the last step.
        at_bound: names of those that the version says to end at a bound.
        differing: effect and place of each held-out run that is said to differ.
        text: what the command printed.
        error: the last line that it complained with; "" where it ended well.
        seconds: processor time of the command.
    """

    verdict: str = ""
    remaining: str = ""
    steps: list[Key] = field(default_factory=list)
    group: list[Key] = field(default_factory=list)
    probabilities: list[tuple[str, str, float]] | None = None
    holdout: list[float] = field(default_factory=list)
    parameters: dict[str, tuple[float, float]] = field(default_factory=dict)
    at_bound: list[str] = field(default_factory=list)
    differing: list[Key] = field(default_factory=list)
    text: str = ""
    error: str = ""
    seconds: float = 0.0


def ask(lptn: Path, files: Files, *, limit: float = LIMIT) -> Answer:
    """Let a version improve a model.

    Args:
        lptn: the version's command.
        files: of the case; results go to a folder of their own.
        limit: s of processor time.
    """
    with tempfile.TemporaryDirectory() as name:
        out, better = Path(name) / "out.json", Path(name) / "better.toml"
        holdout = ["--holdout", *map(str, files.holdout)] if files.holdout else []
        words = ["improve", files.model, *files.fit, *holdout, *files.options, "--json", out, "-o", better]
        text, error, seconds = _run(lptn, words, limit)
        if error or not out.exists():
            return Answer(text=text, error=error or "no result", seconds=seconds)
        parameters = _fitted(better.read_text(encoding="utf-8")) if better.exists() else {}
        return read_answer(json.loads(out.read_text(encoding="utf-8")), text, parameters, seconds)


def read_answer(
    table: Mapping[str, Any], text: str, parameters: dict[str, tuple[float, float]], seconds: float
) -> Answer:
    """An answer from what `lptn improve` wrote as JSON, whichever version it was, and from what it printed."""
    given, *steps = table["history"] if "history" in table else table["ladder"]
    keys = [(step["effect"], step["at"]) for step in steps]
    group = [*keys[:1], *((one, other) for one, other in (steps[0]["indistinguishable_from"] if steps else ()))]
    stated = table.get("probabilities")
    return Answer(
        table["verdict"],
        table["remaining"],
        keys,
        group,
        None if stated is None else [(one["effect"] or "", one["at"] or "", one["probability"]) for one in stated],
        [step["rmse_holdout"] for step in (given, *steps) if step["rmse_holdout"] is not None],
        parameters,
        re.findall(r"^Warning: (\S+): ends at its bound", re.sub(r"\n +", " ", text), re.MULTILINE),
        [(run["effect"] or "", run["at"] or "") for run in table.get("runs_that_differ") or ()],
        text,
        "",
        seconds,
    )


def with_two_masses(lptn: Path, files: Files, share: str, *, limit: float = LIMIT) -> Answer:
    """What a person gets who puts a second mass at every node and fits: the held-out error alone is of interest."""
    with tempfile.TemporaryDirectory() as name:
        out, model = Path(name) / "out.json", Path(name) / "two_masses.toml"
        given = files.model.read_text(encoding="utf-8")
        model.write_text(given if "second_mass" in given else given + second_masses(share), encoding="utf-8")
        words = ["fit", model, *files.fit, "--holdout", *files.holdout, "--json", out]
        text, error, seconds = _run(lptn, words, limit)
        if error or not out.exists():
            return Answer(text=text, error=error or "no result", seconds=seconds)
        table = json.loads(out.read_text(encoding="utf-8"))
        return Answer("two masses", holdout=[table["rmse_holdout"]], seconds=seconds)


def _fitted(text: str) -> dict[str, tuple[float, float]]:
    """Fitted values and standard errors from a model file that `lptn` wrote."""
    import tomllib

    fitted = tomllib.loads(text).get("fit", {}).get("parameters", {})
    return {name: (one["value"], one.get("error", float("nan"))) for name, one in fitted.items()}


def _run(lptn: Path, words: Sequence[object], limit: float) -> tuple[str, str, float]:
    """What a command printed, what it complained of in the end, and its processor time [s]."""

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit) + 5))
        os.nice(10)

    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        process = subprocess.Popen(
            [str(lptn), *map(str, words)],
            stdout=out,
            stderr=err,
            env=os.environ | ONE_THREAD,
            start_new_session=True,
            preexec_fn=limited,
        )
        # One that waits for something for ever uses no processor.
        watch = threading.Timer(10 * limit, _end, (process.pid,))
        watch.start()
        try:
            _, status, usage = os.wait4(process.pid, 0)
        finally:
            watch.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        seconds = usage.ru_utime + usage.ru_stime
        for file in (out, err):
            file.seek(0)
        text, complaints = out.read(), err.read().strip().splitlines()
    if process.returncode == 0:
        return text, "", seconds
    if seconds >= limit - 1:
        return text, f"not done within {limit:.0f} s", seconds
    return text, complaints[-1] if complaints else f"exit status {process.returncode}", seconds


def _end(group: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(group, signal.SIGKILL)


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
        silly: a step is an error of a sensor, a clock or the ambient that isn't there.
        at_bound: an added effect ended at a bound, or where no robot gets.
        alarm: nothing is hidden, and something was said to be missing.
        unexplained: the verdict on the model as given, or on the last step, is "unexplained".
        stated: probability of the most probable answer, `None` where none is stated.
        true: whether that answer is right, or true of this robot whatever was hidden.
    """

    first: bool
    in_set: bool
    in_three: bool
    silly: bool
    at_bound: bool
    alarm: bool
    unexplained: bool
    stated: float | None
    true: bool


def judged(case: Case, answer: Answer) -> Judged:
    """An answer held against the truth; one that failed is wrong, and not silly."""
    kind, always = case.kind, TRUTHS[case.truth].always
    failed, unexplained = bool(answer.error), "unexplained" in (answer.verdict, answer.remaining)

    def right(named: Key) -> bool:
        return named == NOTHING if kind == "nothing" else named != NOTHING and case.right(named)

    beside = [step for step in answer.steps if step[0] not in always]
    alarm = kind == "nothing" and not failed and bool(beside or (answer.verdict != "adequate" and not answer.steps))
    names = answer.steps[:3] or ([NOTHING] if answer.verdict == "adequate" else [])
    first = bool(names) and right(names[0])
    in_set = any(map(right, credible_set(answer)))
    if kind == "nothing":
        first = in_set = not failed and not alarm
    if kind == "outside":
        first = in_set = unexplained
    stated, true = None, False
    if answer.probabilities:
        effect, at, stated = answer.probabilities[0]
        true = right((effect, at)) or effect in always
    return Judged(
        first=first,
        in_set=in_set,
        in_three=first if kind in ("nothing", "outside") else any(map(right, names)),
        silly=any(step[0] in SILLY and not case.right(step) for step in answer.steps),
        at_bound=bool(out_of_bounds(answer)),
        alarm=alarm,
        unexplained=unexplained,
        stated=stated,
        true=true,
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


def out_of_bounds(answer: Answer) -> list[str]:
    """Parameters of added effects at a bound, or as large as no robot has them."""
    added = tuple({f"{effect}." for effect, _ in answer.steps})
    names = [name for name in answer.at_bound if name.startswith(added)] if added else []
    for name, (value, _) in answer.parameters.items():
        effect, _, rest = name.partition(".")
        limit = FARTHEST.get(f"{effect}.{rest.partition('.')[0]}")
        if limit is not None and added and name.startswith(added) and abs(value) >= 0.999 * limit:
            names.append(name)
    return sorted(set(names))


# --- tables ---------------------------------------------------------------------------------------------------------

Results = Mapping[tuple[Case, str], Answer]
TWO_MASSES = "two masses"
"""The name under which a result file holds the network made by hand."""


def table(results: Results, cases: Sequence[Case], versions: Sequence[str]) -> str:
    """Shares of right answers by truth, tier and kind of case, the versions side by side, as Markdown."""
    common = [case for case in cases if all((case, version) in results for version in versions)]
    names = " · ".join(versions)
    lines = [
        f"Each cell: {names}; {len(common)} cases that all were asked. Errors: medians, held out, before → after.",
        "",
        "| truth | sensors | hidden | cases | first | in the 90 % set | in three steps | silly | at a bound "
        "| false alarm | unexplained | failed | error, K | two masses, K | CPU s |",
        "| --- " * 15 + "|",
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
    marks = [[judged(case, answer) for case, answer in zip(cases, each, strict=True)] for each in said]
    names = ("first", "in_set", "in_three", "silly", "at_bound", "alarm", "unexplained")
    shares = [[statistics.mean(getattr(mark, name) for mark in each) for each in marks] for name in names]
    shares.append([statistics.mean(bool(answer.error) for answer in each) for each in said])
    before, after = ([_median(a.holdout[k] for a in each if a.holdout) for each in said] for k in (0, -1))
    by_hand = [results[case, TWO_MASSES].holdout for case in cases if (case, TWO_MASSES) in results]
    return [
        *(" · ".join(f"{one:.2f}" for one in each) for each in shares),
        " · ".join(f"{one} → {other}" for one, other in zip(before, after, strict=True)),
        _median(values[0] for values in by_hand if values),
        " · ".join(_median(answer.seconds for answer in each) for each in said),
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
        words.append("in three" if mark.in_three else "in the set" if mark.in_set else "not named")
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
    """The diagram: observed frequency over stated probability, with intervals and the number of answers in each bin.

    Args:
        bins: of each truth.
        file: .svg or .png.
    """
    from lptn.basics.style import BEST, FAINT, GIVEN, INK, SMALL, dress, new_figure

    figure = new_figure(4.5)
    ax = figure.add_subplot()
    ax.plot([0, 1], [0, 1], color=FAINT, linewidth=0.8)
    looks = [
        {"color": INK, "marker": "o"},
        {"color": GIVEN["color"], "marker": "s"},
        {"color": BEST["color"], "marker": "^"},
    ]
    for k, (name, each) in enumerate(bins.items()):
        stated, observed = [one.stated for one in each], [one.right / one.count for one in each]
        spread = [
            [value - one.lower for value, one in zip(observed, each, strict=True)],
            [one.upper - value for value, one in zip(observed, each, strict=True)],
        ]
        label = f"{name}, {sum(one.count for one in each)} answers"
        ax.errorbar(stated, observed, spread, label=label, capsize=3, linestyle="", **looks[k % len(looks)])
        for one, value in zip(each, observed, strict=True):
            ax.annotate(str(one.count), (one.stated, value), (4, 4), textcoords="offset points", fontsize=SMALL)
    ax.set(
        xlim=(0, 1.02), ylim=(0, 1.02), xlabel="stated probability of the first answer", ylabel="share that was right"
    )
    ax.set_aspect("equal")
    ax.legend(fontsize=SMALL, frameon=False, loc="upper left")
    dress(ax)
    figure.savefig(file)


def calibration(results: Results, cases: Sequence[Case], version: str) -> dict[str, list[Bin]]:
    """Bins of a version's stated probabilities, of all truths together and of each."""
    pairs: dict[str, list[tuple[float, bool]]] = {}
    for case in cases:
        answer = results.get((case, version))
        mark = judged(case, answer) if answer is not None else None
        if mark is not None and mark.stated is not None:
            name = "finite volumes" if case.truth.startswith("finite") else "the catalogue's formulas"
            for group in ("all", name):
                pairs.setdefault(group, []).append((mark.stated, mark.true))
    return {name: reliability(each) for name, each in pairs.items()}


# --- the result file ------------------------------------------------------------------------------------------------


def read_results(file: Path) -> dict[tuple[Case, str], Answer]:
    """The answers that a file holds, by case and version; of one asked twice, the later."""
    results: dict[tuple[Case, str], Answer] = {}
    if not file.exists():
        return results
    for line in file.read_text(encoding="utf-8").splitlines():
        entry = json.loads(line)
        case = Case(**entry["case"] | {"hidden": tuple(entry["case"]["hidden"])})
        said = entry["answer"]
        for name in ("steps", "group", "differing"):
            said[name] = [(one, other) for one, other in said[name]]
        if said["probabilities"] is not None:
            said["probabilities"] = [(effect, at, p) for effect, at, p in said["probabilities"]]
        said["parameters"] = {name: (value, error) for name, (value, error) in said["parameters"].items()}
        results[case, entry["version"]] = Answer(**said)
    return results


def run_missing(
    cases: Sequence[Case], versions: Mapping[str, Path], two_masses: Path | None, out: Path, *, jobs: int, limit: float
) -> None:
    """Ask what the result file does not hold yet; each answer is written as it comes.

    Raises:
        OSError: the file can't be written to.
    """
    done, writing = read_results(out), threading.Lock()
    asked = dict(versions) | ({TWO_MASSES: two_masses} if two_masses is not None else {})

    def one(case: Case) -> str:
        missing = [version for version in asked if (case, version) not in done]
        if not missing:
            return ""
        with tempfile.TemporaryDirectory() as name:
            files = TRUTHS[case.truth].files(case, Path(name))
            said = []
            for version in missing:
                share = "class" if case.truth == "quadruped" else "each"
                by_hand = version == TWO_MASSES
                lptn = asked[version]
                answer = with_two_masses(lptn, files, share, limit=limit) if by_hand else ask(lptn, files, limit=limit)
                entry = {"case": asdict(case), "version": version, "answer": asdict(answer)}
                with writing, out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(entry) + "\n")
                said.append(f"{version}: {_line(answer)}")
        return f"{case.truth}, {case.tier}, {', '.join(case.hidden) or 'nothing'}, {case.seed}: {'; '.join(said)}"

    with ThreadPoolExecutor(jobs) as executor:
        for future in as_completed([executor.submit(one, case) for case in cases]):
            if line := future.result():
                print(line, flush=True)


def _line(answer: Answer) -> str:
    """An answer in a few words."""
    if answer.error:
        return f"failed after {answer.seconds:.0f} s: {answer.error}"
    steps = ", ".join(f"{effect}@{at}" for effect, at in answer.steps)
    errors = " → ".join(f"{answer.holdout[k]:.3g}" for k in (0, -1)) if answer.holdout else "–"
    return f"{answer.verdict} [{steps}] {errors} K, {answer.seconds:.0f} s"


def command_of(text: str) -> tuple[str, Path]:
    """`name=command` as typed."""
    name, _, path = text.partition("=")
    if not path or not Path(path).exists():
        raise argparse.ArgumentTypeError(f"found {text!r}; expected NAME=COMMAND, a command that exists")
    return name, Path(path)


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
    parser.add_argument("--figure", type=Path, help="reliability diagram to write, .svg or .png")
    chosen = parser.parse_args()
    numbers = {name: getattr(chosen, name) for name in ("most", "pairs", "nothing", "outside")}
    cases = [case for truth in chosen.truths for case in draw_cases(truth, chosen.tiers, chosen.seeds, **numbers)]
    if chosen.versions or chosen.two_masses:
        run_missing(cases, dict(chosen.versions), chosen.two_masses, chosen.out, jobs=chosen.jobs, limit=chosen.limit)
    results = read_results(chosen.out)
    versions = [name for name in chosen.judge if any((case, name) in results for case in cases)]
    print(table(results, cases, versions), misses(results, cases, versions), sep="\n\n")
    for version in versions:
        bins = calibration(results, cases, version)
        for name, each in bins.items():
            print(f"\nStated by {version}, {name}:")
            for one in each:
                print(f"  {one.stated:.2f}: {one.right} of {one.count} right, {one.lower:.2f} to {one.upper:.2f}")
        if bins and chosen.figure:
            draw_reliability({name: each for name, each in bins.items() if name != "all"}, chosen.figure)


if __name__ == "__main__":
    main()
