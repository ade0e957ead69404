"""Cases that version 7adde6c answered wrongly, each with what a right answer is: asked of two versions.

    python -m tests.benchmarks.special_cases --out special.jsonl --versions old=OLD/bin/lptn new=NEW/bin/lptn

Each is made anew from a seed; those that average shipped logs need the folder `examples`. What is printed: who said
what, and what of it falls short of the expectation. The seeds and the file are those of `verdict_trial`.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from lptn.robots.presets import presets
from lptn.virtual import LAYOUTS, Hidden, leg_logs, write_logs
from tests.benchmarks.verdict_answers import LIMIT, SILLY, Answer, command_of, in_short, read_results, run_missing
from tests.benchmarks.verdict_cases import (
    QUADRUPED_MODEL,
    Case,
    Files,
    Key,
    covered,
    three_runs,
    write_quadruped,
)

EXAMPLES = Path(__file__).parents[2] / "examples"
FAR_OFF = 1.0
"""K; the virtual sensors' noise is 0.1 K: a model that is this far off in a held-out run is not adequate."""

Check = Callable[[Answer], str]
"""What of an answer falls short, in words; "" for nothing."""


@dataclass(frozen=True)
class Special:
    """One case.

    Args:
        about: what the user did.
        expected: what a right answer is.
        files: makes them from a seed in a folder.
        checks: of the answer.
    """

    about: str
    expected: str
    files: Callable[[int, Path], Files]
    checks: tuple[Check, ...]


# --- what may fall short --------------------------------------------------------------------------------------------


def runs(answer: Answer) -> str:
    """The command ends well, or says in one line of its own what the user has to change."""
    crashed = re.match(r"[\w.]*(Error|Exception|exit status)", answer.error) or answer.error.startswith("not done")
    inside = "effects[" in answer.error  # of a model that the program itself put together
    return f"failed: {answer.error}" if crashed or inside else ""


def ends_well(answer: Answer) -> str:
    """The command has an answer."""
    return f"failed: {answer.error}" if answer.error else ""


def names(*wanted: Key, nodes: Sequence[str], within: int = 3) -> Check:
    """One of these is among the first steps."""

    def check(answer: Answer) -> str:
        said = [covered(step, nodes) for step in answer.steps[:within]]
        short = " or ".join(f"{effect} at {at}" for effect, at in wanted)
        return "" if any(covered(key, nodes) in said for key in wanted) else f"not named in {within}: {short}"

    return check


def not_silly(answer: Answer) -> str:
    """No step is an error of a sensor, a clock or the ambient."""
    said = [effect for effect, _ in answer.steps if effect in SILLY]
    return f"silly: {', '.join(said)}" if said else ""


def honest(answer: Answer) -> str:
    """A model that misses the held-out run by far is not called adequate."""
    adequate = "adequate" in (answer.remaining, answer.verdict if not answer.steps else "")
    far = bool(answer.holdout) and answer.holdout[-1] > FAR_OFF
    return f"adequate with {answer.holdout[-1]:.2g} K held out" if adequate and far else ""


def adequate(answer: Answer) -> str:
    """The model is right as it was given."""
    return "" if answer.verdict == "adequate" and not answer.steps else f"{answer.verdict}; {len(answer.steps)} steps"


def explained(answer: Answer) -> str:
    """What is left is not called unexplained: it is in the held-out run alone."""
    return "unexplained" if answer.remaining == "unexplained" else ""


def differs(answer: Answer) -> str:
    """The held-out run is said to lose heat at another rate."""
    said = [effect for effect, _ in answer.differing]
    return "" if "surface_scale" in said else f"the held-out run's fan is not named ({', '.join(said) or 'nothing is'})"


def close(kelvin: float) -> Check:
    """The held-out error is below so many kelvin."""

    def check(answer: Answer) -> str:
        error = answer.holdout[-1] if answer.holdout else np.nan
        return "" if error < kelvin else f"held out {error:.2g} K, not below {kelvin:g} K"

    return check


# --- virtual legs ---------------------------------------------------------------------------------------------------

LEG = LAYOUTS["leg"].nodes


def _leg(seed: int, folder: Path, hidden: Sequence[Hidden], model: str = "") -> dict[str, pd.DataFrame]:
    """A leg's logs; writes them and its model."""
    logs = leg_logs(hidden, seed=seed, noise=0.1, columns="all")
    (folder / "leg.toml").write_text(presets()["leg"] + model, encoding="utf-8")
    write_logs(folder, logs)
    return logs


def two_minutes(hidden: Sequence[Hidden], seed: int, folder: Path) -> Files:
    """Fitted to two minutes, predicted for half an hour."""
    logs = _leg(seed, folder, hidden)
    short = logs["fit1"][logs["fit1"]["time"] < 120]
    write_logs(folder, {"short": short})
    return Files(folder / "leg.toml", (folder / "short.parquet",), (folder / "holdout.parquet",))


def fan_in_holdout(hidden: Sequence[Hidden], seed: int, folder: Path) -> Files:
    """Somebody had a fan on in the held-out run: it loses heat 2.2 times as fast."""
    _leg(seed, folder, [*hidden, Hidden("surface_scale", "*", 4.0, run="holdout")])
    return three_runs(folder, folder / "leg.toml")


def pruned_edge(seed: int, folder: Path) -> Files:
    """Hip and calf touch, and the calf's sensor reads 0.3 of the hip: an edge is added, then an effect on it."""
    logs = _leg(seed, folder, [Hidden("conduction", "FR_calf~FR_hip", 0.3)])
    for log in logs.values():
        log["temperature.FR_calf"] = 0.7 * log["temperature.FR_calf"] + 0.3 * log["temperature.FR_hip"]
    write_logs(folder, logs)
    return three_runs(folder, folder / "leg.toml")


STANDBY = """
[[effects]]
kind = "constant_heat"
at = "*"
share = "all"
"""


def own_standby(seed: int, folder: Path) -> Files:
    """All boards draw 1.5 W, one 3 W more; the model has one standby heat that all joints share."""
    _leg(seed, folder, [Hidden("constant_heat", "*"), Hidden("constant_heat", "FR_thigh", 2.0)], STANDBY)
    return three_runs(folder, folder / "leg.toml")


def forced_with_computer(seed: int, folder: Path) -> Files:
    """A quadruped's joints are cooled by the air that it travels through, its computer is not."""
    hidden = [f"forced_convection@*_{part}" for part in ("hip", "thigh", "calf")]
    write_quadruped(folder, hidden, seed, "0.1K", rough=False)
    return three_runs(folder, QUADRUPED_MODEL)


# --- slow logs ------------------------------------------------------------------------------------------------------


def _averaged(log: pd.DataFrame, seconds: float) -> pd.DataFrame:
    """A log of one reading in so many seconds: means over them, at the middle of each."""
    block = np.floor((log["time_s"] - log["time_s"].iloc[0]) / seconds)
    return log.groupby(block.to_numpy()).mean(numeric_only=True)


def slow_motor(minutes: float, _seed: int, folder: Path) -> Files:
    """Two hours of a motor's winding."""
    _averaged(pd.read_csv(EXAMPLES / "pmsm" / "log.csv"), 60 * minutes).to_csv(folder / "slow.csv", index=False)
    return Files(EXAMPLES / "pmsm" / "winding.toml", (folder / "slow.csv",), (), ("--holdout-after", "4400"))


def slow_arm(minutes: float, _seed: int, folder: Path) -> Files:
    """An arm's morning and its day."""
    for name in ("warm_up", "later"):
        log = _averaged(pd.read_parquet(EXAMPLES / "ur3" / f"{name}.parquet"), 60 * minutes)
        log.to_parquet(folder / f"{name}.parquet")
    return Files(EXAMPLES / "ur3" / "coupled.toml", (folder / "warm_up.parquet",), (folder / "later.parquet",))


# --- a wall ---------------------------------------------------------------------------------------------------------

ROOM = """
[model]
name = "room"
ambient = "temperature.ambient"

[nodes.room]
capacity = { value = 1e6, unit = "J/K", bounds = [1e4, 1e9] }

[[links]]
between = ["room", "ambient"]
resistance = { value = 0.05, unit = "K/W", bounds = [1e-4, 10] }

[[effects]]
kind = "heat_input"
at = "room"
gain = { value = 1, fixed = true }
"""
ROWS_ARE_MEANS = """
[columns]
time = { column = "time", rows = "means around" }
"""
DAYS = {"fit1": 10, "holdout": 5}
LAYERS = 14
AREA, THICKNESS = 12.0, 0.35  # m², m: of a wall of concrete, insulated outside
CONCRETE_HEAT, CONCRETE_CONDUCTIVITY = 2300 * 880.0, 1.6  # J/(m³ K), W/(m K): 8.5 MJ/K in all, some 6 h to go through
INSIDE_FILM, OUTSIDE, WINDOW = 8.0, 0.3, 6.0  # W/(m² K), W/(m² K) with the insulation, W/K straight to the air
AIR_AND_FURNITURE = 0.4e6  # J/K


def wall(minutes: float, columns: str, seed: int, folder: Path) -> Files:
    """A room with a wall of 8.5 MJ/K, heated now and then for ten days; five more are held out."""
    seconds = 60.0 * minutes
    slab = THICKNESS / LAYERS
    between = CONCRETE_CONDUCTIVITY * AREA / slab
    faces = [1 / (1 / (film * AREA) + 1 / (2 * between)) for film in (INSIDE_FILM, OUTSIDE)]
    ends = [WINDOW, faces[0], *[between] * (LAYERS - 1), faces[1]]  # air | room | wall … | air
    capacity = np.array([AIR_AND_FURNITURE, *[CONCRETE_HEAT * AREA * slab] * LAYERS])
    count = len(capacity)
    balance = np.zeros((count, count))
    for k, conductance in enumerate(ends[1:-1]):
        balance[[k, k + 1], [k, k + 1]] -= conductance
        balance[k, k + 1] += conductance
        balance[k + 1, k] += conductance
    to_air = np.zeros(count)
    to_air[[0, -1]] = ends[0], ends[-1]
    implicit = np.linalg.inv(np.eye(count) - 60.0 * (balance - np.diag(to_air)) / capacity[:, None])
    for number, (name, days) in enumerate(DAYS.items()):
        rng, steps = np.random.default_rng([seed, number]), days * 24 * 60
        hours = np.arange(steps) / 60
        weather = np.interp(hours, np.arange(0, hours[-1] + 24, 24), rng.normal(0, 2, days + 1))
        air = 5 + weather + 4 * np.sin(2 * np.pi * (hours - 9) / 24)
        heat = (rng.uniform(0, 1, days * 8) > 0.5).repeat(180) * 900.0  # W, for three hours each
        state, readings = np.full(count, air[0] + 10.0), np.empty(steps)
        for k in range(steps):
            readings[k] = state[0]
            state = implicit @ (state + 60.0 * (to_air * air[k] + np.eye(count)[0] * heat[k]) / capacity)
        log = pd.DataFrame(
            {"time_s": 60.0 * np.arange(steps), "temperature.room": readings + rng.normal(0, 0.1, steps)}
        )
        log["temperature.ambient"], log["power.room"] = air, heat
        _averaged(log, seconds).rename(columns={"time_s": "time"}).to_csv(folder / f"{name}.csv", index=False)
    (folder / "room.toml").write_text(ROOM + columns, encoding="utf-8")
    return Files(folder / "room.toml", (folder / "fit1.csv",), (folder / "holdout.csv",))


# --- all of them ----------------------------------------------------------------------------------------------------

FRICTION = (Hidden("coulomb_friction", "FR_calf"),)
RUNS = "it runs, or says in one line what the user has to change"

SPECIAL: dict[str, Special] = {
    "two minutes": Special(
        "two minutes fitted, half an hour held out; nothing is hidden",
        "not called adequate while the held-out run is missed by far; nothing silly",
        partial(two_minutes, ()),
        (ends_well, honest, not_silly),
    ),
    "two minutes, friction": Special(
        "the same, and the calf's gear rubs",
        "not called adequate while the held-out run is missed by far; nothing silly",
        partial(two_minutes, FRICTION),
        (ends_well, honest, not_silly),
    ),
    "a fan in the held-out run": Special(
        "the calf's gear rubs in all runs; in the held-out one a fan was on",
        "friction at the calf; the held-out run loses heat faster; nothing unexplained besides",
        partial(fan_in_holdout, FRICTION),
        (ends_well, names(("coulomb_friction", "FR_calf"), nodes=LEG, within=1), explained, differs, not_silly),
    ),
    "only a fan in the held-out run": Special(
        "nothing is hidden in the fitted runs; in the held-out one a fan was on",
        "adequate for the fitted runs; the held-out run loses heat faster",
        partial(fan_in_holdout, ()),
        (ends_well, adequate, differs),
    ),
    "motor, 5 min a reading": Special(
        "examples/pmsm averaged to 5 min", RUNS, partial(slow_motor, 5.0), (runs, not_silly)
    ),
    "motor, 30 min a reading": Special(
        "examples/pmsm averaged to 30 min", RUNS, partial(slow_motor, 30.0), (runs, not_silly)
    ),
    "arm, 5 min a reading": Special("examples/ur3 averaged to 5 min", RUNS, partial(slow_arm, 5.0), (runs, not_silly)),
    "arm, 3 min a reading": Special("examples/ur3 averaged to 3 min", RUNS, partial(slow_arm, 3.0), (runs, not_silly)),
    "an edge that is needed later": Special(
        "hip and calf touch, and the calf's sensor reads 0.3 of the hip",
        "conduction between them or the sensor's position, and no crash as steps are taken out",
        pruned_edge,
        (
            ends_well,
            names(
                ("conduction", "FR_calf~FR_hip"),
                ("sensor_position", "FR_calf~FR_hip"),
                nodes=LEG,
            ),
            not_silly,
        ),
    ),
    "wall, 5 min a reading": Special(
        "ten days of a room with a wall of 8.5 MJ/K",
        "a second mass; held out below 0.5 K",
        partial(wall, 5.0, ""),
        (ends_well, names(("second_mass", "room"), nodes=("room",)), not_silly, close(0.5)),
    ),
    "wall, 30 min a reading": Special(
        "the same, averaged to 30 min",
        "a second mass; held out below 0.5 K",
        partial(wall, 30.0, ""),
        (ends_well, names(("second_mass", "room"), nodes=("room",)), not_silly, close(0.5)),
    ),
    "wall, 30 min a reading, said to be means": Special(
        "the same, and the model file says that rows are means around their time",
        "a second mass; held out below 0.5 K",
        partial(wall, 30.0, ROWS_ARE_MEANS),
        (ends_well, names(("second_mass", "room"), nodes=("room",)), not_silly, close(0.5)),
    ),
    "one joint's own standby heat": Special(
        "all boards draw 1.5 W, the thigh's 3 W more; the model has one standby heat for all",
        "constant heat at the thigh",
        own_standby,
        (ends_well, names(("constant_heat", "FR_thigh"), ("drive_heat", "FR_thigh"), nodes=LEG, within=1), not_silly),
    ),
    "forced convection beside a computer": Special(
        "the air cools all joints of a quadruped as it travels, not its computer",
        "forced convection on all joints; held out below 0.15 K",
        forced_with_computer,
        (ends_well, names(("forced_convection", "*_*"), nodes=LAYOUTS["quadruped"].nodes, within=1), close(0.15)),
    ),
}


def short_of(name: str, answer: Answer) -> str:
    """What of an answer to a case falls short; of one that failed only that."""
    short = [text for check in SPECIAL[name].checks if (text := check(answer))]
    return "; ".join(short[:1] if answer.error else short) or "–"


def main() -> None:
    """Ask what is missing, then print who said what."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--out", type=Path, required=True, help="answers as JSON lines; what it holds is not asked again"
    )
    parser.add_argument("--versions", nargs="*", type=command_of, default=[], help="NAME=COMMAND; none: only judge")
    parser.add_argument("--judge", nargs="*", default=["old", "new"], help="versions to show")
    parser.add_argument("--cases", nargs="*", choices=list(SPECIAL), default=list(SPECIAL))
    parser.add_argument("--seeds", nargs="+", type=int, default=[1401])
    parser.add_argument("--limit", type=float, default=LIMIT, help="s of processor time for an answer")
    chosen = parser.parse_args()
    asked = {
        Case("special", name, (), seed): partial(SPECIAL[name].files, seed)
        for name in chosen.cases
        for seed in chosen.seeds
    }
    run_missing(asked, dict(chosen.versions), None, chosen.out, limit=chosen.limit)
    results = read_results(chosen.out)
    print("| case | seed | version | said | falls short |", "| --- " * 5 + "|", sep="\n")
    for case in asked:
        for version in chosen.judge:
            if (answer := results.get((case, version))) is not None:
                print(f"| {case.tier} | {case.seed} | {version} | {in_short(answer)} | {short_of(case.tier, answer)} |")
    print(
        "\nExpected:",
        *(f"- {name}: {SPECIAL[name].about}. {SPECIAL[name].expected}." for name in chosen.cases),
        sep="\n",
    )


if __name__ == "__main__":
    main()
