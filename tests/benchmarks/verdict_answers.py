"""Ask a version of the program through its command line, and keep what it answered in a file.

Nothing here says what is right: `verdict_trial`, `special_cases` and `measured_verdicts` do, each with its own cases.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import re
import resource
import signal
import subprocess
import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from tests.benchmarks.verdict_cases import Case, Files, Key, second_masses

LIMIT = 900.0  # s of processor time that a version has for a case
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
TWO_MASSES = "two masses"
"""The name under which a result file holds the network made by hand."""
# --- one question to one version ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Answer:
    """What a version said, as it said it; nothing here is judged.

    Args:
        verdict, remaining: on the model as given, and with all that was added; "" where the command failed.
        steps: effect and place of each step.
        group: names that the first step can't be told from, itself included.
        names: the steps, and all that any of them can't be told from.
        probabilities: effect, place and probability of what the model as given lacks, the most probable first;
            two empty strings for nothing. `None` where the version states none.
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
    names: list[Key] = field(default_factory=list)
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
        answer = read_answer(json.loads(out.read_text(encoding="utf-8")), text, seconds)
        if not better.exists():
            return answer
        at_bound = sorted({*answer.at_bound, *_at_bounds(better)})
        return replace(answer, parameters=_fitted(better), at_bound=at_bound)


def ask_first(lptn: Path, files: Files, *, limit: float = LIMIT) -> Answer:
    """Let a version diagnose the model as given, in a tenth of the time: its first answers, and how probable they are.

    Args:
        lptn: the version's command.
        files: of the case.
        limit: s of processor time.
    """
    with tempfile.TemporaryDirectory() as name:
        out = Path(name) / "out.json"
        holdout = ["--holdout", *map(str, files.holdout)] if files.holdout else []
        text, error, seconds = _run(
            lptn, ["diagnose", files.model, *files.fit, *holdout, *files.options, "--json", out], limit
        )
        if error or not out.exists():
            return Answer(text=text, error=error or "no result", seconds=seconds)
        table = json.loads(out.read_text(encoding="utf-8"))
        candidates = table["candidates"][:1] if table["verdict"] != "adequate" else []
        history = [{"rmse_holdout": table["rmse_holdout"]}]
        history += [{**candidate, "rmse_holdout": candidate["rmse_holdout_after"]} for candidate in candidates]
        return read_answer({**table, "remaining": table["verdict"], "history": history}, text, seconds)


def read_answer(table: Mapping[str, Any], text: str, seconds: float) -> Answer:
    """An answer from what `lptn improve` wrote as JSON, whichever version it was, and from what it printed."""
    given, *history = table["history"] if "history" in table else table["ladder"]
    # What sets one apart is asked for before what all have in common, whatever a version tells first.
    steps = [*table["findings"], *table["structure"]] if "findings" in table else history
    keys = [(step["effect"], step["at"]) for step in steps]
    others = [[(one, other) for one, other in step.get("indistinguishable_from", ())] for step in steps]
    group = [*keys[:1], *(others[0] if others else ())]
    stated = table.get("probabilities")
    return Answer(
        table["verdict"],
        table["remaining"],
        keys,
        group,
        list(dict.fromkeys([*keys, *(name for rivals in others for name in rivals)])),
        None if stated is None else [(one["effect"] or "", one["at"] or "", one["probability"]) for one in stated],
        [step["rmse_holdout"] for step in (given, *history) if step["rmse_holdout"] is not None],
        {},
        re.findall(r"^Warning: (\S+): (?:ends at|would go to) its bound", re.sub(r"\n +", " ", text), re.MULTILINE),
        [(run["effect"] or "", run["at"] or "") for run in table.get("runs_that_differ") or ()],
        text,
        "",
        seconds,
    )


def with_two_masses(lptn: Path, files: Files, *, limit: float = LIMIT) -> Answer:
    """What a person gets who puts a second mass at every node and fits: the held-out error alone is of interest."""
    with tempfile.TemporaryDirectory() as name:
        out, model = Path(name) / "out.json", Path(name) / "two_masses.toml"
        given = files.model.read_text(encoding="utf-8")
        model.write_text(given if "second_mass" in given else given + second_masses(files.share), encoding="utf-8")
        words = ["fit", model, *files.fit, "--holdout", *files.holdout, "--json", out]
        text, error, seconds = _run(lptn, words, limit)
        if error or not out.exists():
            return Answer(text=text, error=error or "no result", seconds=seconds)
        table = json.loads(out.read_text(encoding="utf-8"))
        return Answer("two masses", holdout=[table["rmse_holdout"]], seconds=seconds)


def _fitted(model: Path) -> dict[str, tuple[float, float]]:
    """Fitted values and standard errors from a model file that `lptn` wrote, of this version or an older one."""
    import tomllib

    from lptn.basics.errors import InputError
    from lptn.identify.data import load_model

    fit = tomllib.loads(model.read_text(encoding="utf-8")).get("fit", {})
    if "parameters" in fit:  # values and errors stood together
        return {name: (one["value"], one.get("error", float("nan"))) for name, one in fit["parameters"].items()}
    try:
        parameters = load_model(model).model.parameters
    except InputError:  # of another version
        return {}
    errors = fit.get("standard_errors", {})
    return {
        parameter.name: (parameter.value, errors[parameter.name])
        for parameter in parameters
        if parameter.name in errors
    }


def _at_bounds(model: Path) -> list[str]:
    """Free parameters that stand at a bound in a model file, whether the version says so or not.

    An effect that ended where it vanishes is left out. The catalogue's bounds are those of the version under test here.
    """
    from lptn.basics.errors import InputError
    from lptn.identify.data import load_model

    try:
        parameters = load_model(model).model.parameters
    except InputError:  # of another version
        return []
    names = []
    for parameter in parameters:
        lower, upper = parameter.declared.bounds
        near = parameter.value >= NEARLY * upper or (lower > 0 and parameter.value <= lower / NEARLY)
        if parameter.free and near and parameter.value != parameter.declared.off:
            names.append(parameter.name)
    return names


def _run(lptn: Path, words: Sequence[object], limit: float) -> tuple[str, str, float]:
    """What a command printed, what it complained of in the end, and its processor time [s]."""

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit) + 5))

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


# --- sizes at a bound, or that no robot has ---------------------------------------------------------------------------


SILLY = ("sensor_drift", "clock_offset", "ambient_offset", "ambient_lag", "ambient_drift")
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
NEARLY = 0.999
"""Share of a bound from which on a parameter is at it."""


def out_of_bounds(answer: Answer) -> list[str]:
    """Parameters at a bound in a model that was added to, and sizes of what was added that no robot has."""
    if not answer.steps:
        return []
    added = tuple(f"{effect}." for effect, _ in answer.steps)
    names = set(answer.at_bound)
    for name, (value, _) in answer.parameters.items():
        effect, _, rest = name.partition(".")
        limit = FARTHEST.get(f"{effect}.{rest.partition('.')[0]}")
        if limit is not None and name.startswith(added) and abs(value) >= NEARLY * limit:
            names.add(name)
    return sorted(names)


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
        for name in ("steps", "group", "names", "differing"):
            said[name] = [(one, other) for one, other in said.get(name, ())]
        if said["probabilities"] is not None:
            said["probabilities"] = [(effect, at, p) for effect, at, p in said["probabilities"]]
        said["parameters"] = {name: (value, error) for name, (value, error) in said["parameters"].items()}
        results[case, entry["version"]] = Answer(**said)
    return results


def run_missing(
    cases: Mapping[Case, Callable[[Path], Files]],
    versions: Mapping[str, Path],
    two_masses: Path | None,
    out: Path,
    *,
    jobs: int = 1,
    limit: float = LIMIT,
    question: Callable[..., Answer] = ask,
) -> None:
    """Ask what the result file does not hold yet; each answer is written and said as it comes.

    Args:
        cases: what makes the files of each in a folder.
        versions: commands by name.
        two_masses: the command that fits a network with two masses a node; `None` for none.
        out: the result file.
        jobs: cases at a time.
        limit: s of processor time for an answer.
        question: what each version is asked.

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
            files, said = cases[case](Path(name)), []
            for version in missing:
                asking = with_two_masses if version == TWO_MASSES else question
                answer = asking(asked[version], files, limit=limit)
                entry = {"case": asdict(case), "version": version, "answer": asdict(answer)}
                with writing, out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(entry) + "\n")
                said.append(f"{version}: {in_short(answer)}")
        return f"{case.truth}, {case.tier}, {', '.join(case.hidden) or 'nothing'}, {case.seed}: {'; '.join(said)}"

    with ThreadPoolExecutor(jobs) as executor:
        for future in as_completed([executor.submit(one, case) for case in cases]):
            if line := future.result():
                print(line, flush=True)


def in_short(answer: Answer) -> str:
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
