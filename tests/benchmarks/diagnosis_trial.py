"""Diagnosis trial: a virtual quadruped with something hidden; is it named, with its place, and does the error fall?

Run it with ``python -m tests.benchmarks.diagnosis_trial --seeds 501 --out trial.jsonl``. The truth comes from
`lptn.virtual`, which shares no code with the model; its logs go through files, as a user's would. Cases that the
output file holds already are not run again, so a trial can be stopped and gone on with. ``--tier rough`` adds small
physics that the model never has: a trunk, radiation, natural convection, friction, second masses, and an ambient sensor
that is off by another half kelvin in each run.
"""

from __future__ import annotations

import argparse
import json
import random
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, cast

from lptn.diagnose.answers import NOTHING
from lptn.diagnose.improvement import History, improve
from lptn.identify.data import load_model, split_data
from lptn.virtual import BEYOND
from tests.benchmarks.verdict_cases import (
    AMBIENT_ERROR,
    CATALOGUE,
    IN_ONE_RUN,
    NOISES,
    QUADRUPED_MODEL,
    Key,
    covered,
    drawn_place,
    key,
    three_runs,
    write_quadruped,
)

STEPS = 3
"""Within so many a rough robot's hidden effect is wanted."""
SIZES = {
    "resistance_rise": 0.00393,
    "torque_constant_drop": 0.0012,
    "natural_convection": 0.006,
    "forced_convection": 0.55,
    "coulomb_friction": 0.5,
    "viscous_friction": 0.07,
    "constant_heat": 1.5,
    "gear_loss": 0.1,
    "driver_loss": 0.42,
    "computer_heat": 0.1,
    "battery_heat": 0.01,
    "radiation": 0.008,
    "sensor_offset": 2.0,
    "sensor_drift": 4.0,
    "sensor_position": 0.2,
    "ambient_offset": 2.5,
    "clock_offset": 30.0,
    "surface_scale": 0.3,
    "loss_scale": 0.2,
}
"""True amplitudes at size 1, where truth and model share the parameter."""


@dataclass(frozen=True)
class Case:
    """What is hidden, `effect@place` or `effect@place@run` each, nothing for an empty tuple; and the sensors."""

    hidden: tuple[str, ...]
    seed: int
    noise: str
    tier: str


@dataclass(frozen=True)
class Result:
    """What the forward selection said of a case.

    Args:
        case: the case.
        verdict: on the model as given.
        remaining: on the last step.
        steps: effect and place of each step.
        group: names that the first step can't be told from, itself included.
        holdout: held-out RMSE of each step, the given model first [K].
        nothing: probability that nothing is missing.
        off: fitted minus true amplitude in standard errors, where the one hidden effect was named and both share it.
        seconds: CPU time of the search.
    """

    case: Case
    verdict: str
    remaining: str
    steps: list[Key]
    group: list[Key]
    holdout: list[float]
    nothing: float
    off: float | None
    seconds: float


def run(case: Case) -> Result:
    """Make the logs, read them back, select effects step by step."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_quadruped(folder, case.hidden, case.seed, case.noise, rough=case.tier == "rough")
        files, loaded = three_runs(folder, QUADRUPED_MODEL), load_model(QUADRUPED_MODEL)
        data = split_data(loaded.runs(files.fit), loaded.runs(files.holdout))
    start = time.process_time()
    if case.tier == "rough":
        history = improve(loaded.model, data, most=STEPS, ambient_error=AMBIENT_ERROR)
    else:
        history = improve(loaded.model, data)
    return _result(case, history, time.process_time() - start)


def _result(case: Case, history: History, seconds: float) -> Result:
    steps = [(step.effect, step.at) for step in history.steps[1:] if step.effect and step.at]
    group = [*steps[:1], *(history.steps[1].indistinguishable if steps else ())]
    holdout = [step.holdout.rmse for step in history.steps if step.holdout]
    nothing = dict(history.first.probabilities)[NOTHING]
    return Result(
        case, history.verdict, history.remaining, steps, group, holdout, nothing, _off(case, history), seconds
    )


def _off(case: Case, history: History) -> float | None:
    if len(case.hidden) != 1 or len(history.steps) != 2:
        return None
    declaration = history.steps[1].declaration
    if declaration is None or declaration.effect.key not in SIZES or not case.hidden[0].startswith(declaration.name):
        return None
    amplitude = declaration.effect.amplitude()
    values = {parameter.name: parameter.value for parameter in history.best.fit.model.parameters}
    for name, error in history.best.fit.standard_errors.items():
        if amplitude is not None and name.startswith(f"{declaration.name}.{amplitude.name}.") and error > 0:
            return (values[name] - SIZES[declaration.effect.key]) / error
    return None


def trial(wanted: Sequence[Case], executor: Executor) -> Iterator[Result]:
    """Results of cases as they come, from processes or a cluster."""
    for future in as_completed([executor.submit(run, case) for case in wanted]):
        yield future.result()


def _executor(jobs: int, scheduler: str | None) -> Executor:
    if scheduler is None:
        return ProcessPoolExecutor(jobs)
    from dask import distributed

    client: Any = distributed.Client(scheduler)  # type: ignore[no-untyped-call]
    return cast("Executor", client.get_executor(pure=False))


def cases(chosen: argparse.Namespace) -> list[Case]:
    """Each effect at a place drawn by the seed and the noise; nothing hidden; pairs of effects."""
    drawn = []
    for noise in chosen.noises:
        for seed in chosen.seeds:
            drawn += [
                Case(drawn_place(effect, "quadruped", seed, noise), seed, noise, chosen.tier)
                for effect in chosen.effects
            ]
            for number in range(chosen.pairs):
                rng = random.Random(f"pair {number} {seed} {noise}")
                pair = rng.sample([effect for effect in CATALOGUE if effect not in IN_ONE_RUN], 2)
                hidden = tuple(text for one in pair for text in drawn_place(one, "quadruped", seed + 7 * number, noise))
                drawn.append(Case(hidden, seed + number, noise, chosen.tier))
    return drawn


def judged(done: Result) -> tuple[bool, bool, bool]:
    """Named first; in the first answer group; exactly the right steps and nothing else."""
    wanted = [covered(key(text)) for text in done.case.hidden]
    if not wanted or wanted[0][0] in BEYOND:
        right = done.verdict == ("unexplained" if wanted else "adequate")
        return right, right, right
    steps, group = [covered(step) for step in done.steps], [covered(name) for name in done.group]
    first = bool(steps) and steps[0] in wanted
    return first, any(name in wanted for name in group), sorted(map(str, steps)) == sorted(map(str, wanted))


def row(done: Result) -> str:
    """A line of the table."""
    first, group, exact = judged(done)
    answer = "exact" if exact else "first" if first else "in group" if group else "NO"
    history = ", ".join(f"{effect} at {at}" for effect, at in done.steps) or "–"
    errors = f"{done.holdout[0]:.3f} | {done.holdout[-1]:.3f}"
    hidden = ", ".join(done.case.hidden) or "nothing"
    case, said = done.case, f"{done.verdict}/{done.remaining}"
    return f"| {hidden} | {case.seed} | {case.noise} | {said} | {history} | {answer} | {errors} | {done.seconds:.0f} |"


def summary(results: Sequence[Result]) -> str:
    """Shares by kind of case."""
    kinds: dict[str, list[Result]] = {}
    for done in results:
        hidden = list(map(key, done.case.hidden))
        beyond = bool(hidden) and hidden[0][0] in BEYOND
        kind = "nothing" if not hidden else "outside the catalogue" if beyond else ("one", "two")[len(hidden) - 1]
        kinds.setdefault(f"{done.case.tier}, {kind}", []).append(done)
    lines = []
    for kind, all_of_it in kinds.items():
        answers = [judged(done) for done in all_of_it]
        shares = [sum(answer[k] for answer in answers) / len(answers) for k in range(3)]
        unexplained = sum(done.verdict == "unexplained" for done in all_of_it) / len(all_of_it)
        both = sum({covered(k) for k in map(key, d.case.hidden)} <= {covered(k) for k in d.steps} for d in all_of_it)
        third = sum(any(covered(k) in map(covered, map(key, d.case.hidden)) for k in d.steps[:3]) for d in all_of_it)
        n = len(all_of_it)
        lines.append(
            f"{kind}: {n} cases; first {shares[0]:.2f}, in the first group {shares[1]:.2f}, "
            f"exactly it {shares[2]:.2f}; all of it found {both / n:.2f}; "
            f"within three steps {third / n:.2f}; called unexplained {unexplained:.2f}"
        )
    return "\n".join([*lines, _calibration(results)])


def _calibration(results: Sequence[Result]) -> str:
    """Stated probabilities and intervals against what happened."""
    clean = [done for done in results if done.case.tier == "clean"]
    nothing = [done.nothing for done in clean if not done.case.hidden]
    off = [abs(done.off) for done in clean if done.off is not None]
    alarms = ", ".join(f"{sum(p <= level for p in nothing)} below {level:g}" for level in (0.05, 0.1, 0.5))
    inside = ", ".join(f"{sum(o <= width for o in off)} within {width:g} SE" for width in (1.0, 1.96, 3.0))
    return f"calibration: nothing hidden, {len(nothing)} cases: {alarms}; sizes, {len(off)} cases: {inside}"


def _read(out: Path) -> list[Result]:
    if not out.exists():
        return []
    results = []
    for line in out.read_text(encoding="utf-8").splitlines():
        table = json.loads(line)
        case = table["case"] | {"hidden": tuple(table["case"]["hidden"])}
        if "rungs" in table:  # the name of steps in older files
            table["steps"] = table.pop("rungs")
        keys = {name: [(one, other) for one, other in table[name]] for name in ("steps", "group")}
        results.append(Result(**(table | keys | {"case": Case(**case)})))
    return results


def main() -> None:
    """Run what is missing and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--effects", nargs="*", default=[*CATALOGUE, "none", *BEYOND])
    parser.add_argument("--seeds", nargs="+", type=int, default=[501, 502, 503])
    parser.add_argument("--noises", nargs="+", choices=list(NOISES), default=list(NOISES))
    parser.add_argument("--tier", choices=["clean", "rough"], default="clean")
    parser.add_argument("--pairs", type=int, default=0, help="cases with two hidden effects, for each seed and noise")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--scheduler", help="address of a Dask scheduler whose workers run the cases")
    parser.add_argument("--out", type=Path, required=True, help="results as JSON lines; what it holds is not run again")
    chosen = parser.parse_args()
    done = {result.case: result for result in _read(chosen.out)}
    wanted = cases(chosen)
    missing = [case for case in dict.fromkeys(wanted) if case not in done]
    print("| hidden | seed | sensors | verdict | history | answer | held out before, K | after, K | CPU s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for case in wanted:
        if case in done:
            print(row(done[case]))
    with _executor(chosen.jobs, chosen.scheduler) as executor:
        for result in trial(missing, executor):
            done[result.case] = result
            with chosen.out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(result)) + "\n")
            print(row(result), flush=True)
    print(summary([done[case] for case in wanted]))


if __name__ == "__main__":
    main()
