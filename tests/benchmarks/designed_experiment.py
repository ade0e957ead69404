"""Rival effects on a sensor of 1 K steps: decided by an hour of walking, by the proposed run, by more walking?

Run it with ``python tests/benchmarks/designed_experiment.py --seeds 101 102 --jobs 2 --out rivals.jsonl``. One effect
of each pair is hidden in a virtual quadruped; both are refitted, first to 60 min of ordinary walking, then to that and
the proposed 20 min as the virtual robot does them, then to that and 20 min more of walking. Decided rightly means:
the hidden one explains the data best, and the other is not tied with it. ``--out`` keeps each pair that is done;
with the same file a run goes on where it was stopped. The truth comes from `lptn.virtual`, which shares no code with
the model; logs go through files, as a user's would.
"""

from __future__ import annotations

import argparse
import json
import random
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from lptn import virtual
from lptn.basics.places import EVERYWHERE, matching
from lptn.diagnose.answers import Step
from lptn.diagnose.candidates import candidates
from lptn.diagnose.diagnosis import for_search
from lptn.diagnose.experiment import Experiment, Move, Stage, propose
from lptn.diagnose.fit_statistics import criterion_difference
from lptn.diagnose.refits import refit
from lptn.identify.data import LoadedModel, load_model, split_data
from lptn.identify.fitting import Fit, finished
from lptn.identify.validation import fit_segments
from lptn.robots.presets import preset_text
from lptn.virtual import Bout, Hidden

NOISE, STEPS, AMBIENT = 0.15, 1.0, 22.0
TIE = 10.0  # of information criteria; closer ones decide nothing [BurnhamAnderson2002]
BODY, LOADED, MOST_LOAD = 12.0, 4.0, 20.0  # kg, as the virtual robot's activities have it
STAND = {"hip": 1.3, "thigh": 2.2, "calf": 5.6}  # N·m with LOADED on the back
TROT = {"hip": 2.242, "thigh": 3.767, "calf": 8.078}
TROT_SWEEP = {"hip": 1.5, "thigh": 6.0, "calf": 10.41}  # rad/s, amplitude of a sine
SWEEP = {"hip": 8.0, "thigh": 8.0, "calf": 9.0}

# Two effects, their place ("?" is a joint drawn by the seed), and how many times its usual size the hidden one has:
# enough to be noticed by an hour of walking. Iron loss is no rival here: with its free exponent it holds both laws of
# friction, and no data could tell it from them.
PAIRS: tuple[tuple[str, str, str, float], ...] = (
    ("radiation", "natural_convection", "*", 3.0),
    ("radiation", "natural_convection", "*_calf", 3.0),
    ("coulomb_friction", "viscous_friction", "*", 1.0),
    ("coulomb_friction", "viscous_friction", "*_calf", 1.0),
    ("coulomb_friction", "viscous_friction", "?", 2.0),
    ("gear_loss", "coulomb_friction", "*_calf", 1.0),
    ("sensor_offset", "constant_heat", "?", 1.5),
    ("gear_loss", "coulomb_friction", "*", 1.0),
    ("gear_loss", "viscous_friction", "*_thigh", 2.0),
    ("driver_loss", "constant_heat", "*", 1.0),
    ("driver_loss", "loss_scale", "*_calf", 2.0),
    ("forced_convection", "natural_convection", "*", 1.0),
    ("resistance_rise", "natural_convection", "*", 1.0),
    ("constant_heat", "computer_heat", "?", 2.0),
)


@dataclass(frozen=True)
class Outcome:
    """One pair: what was hidden, and for each set of data whether it was decided rightly, wrongly, or not.

    Args:
        pair: number in `PAIRS`.
        hidden: the true effect.
        rival: the other.
        at: the place of both.
        seed: of the robot.
        before: the answer from the hour of walking.
        designed: from that and the proposed run.
        walking: from that and more walking.
        leads: of the hidden effect before its rival by the information criterion alone, on the same three sets of data.
        gain: of the better rival over the baseline before; an effect below 10 was hardly there to be seen.
        expected: standard deviations that the proposal promises.
        kelvin: the difference that it promises.
        separates: whether it says that the run decides.
        tried: how many runs it compared.
        proposing: seconds that it took.
        seconds: for all of it.
        text: the proposal.
    """

    pair: int
    hidden: str
    rival: str
    at: str
    seed: int
    before: str
    designed: str
    walking: str
    leads: tuple[float, float, float]
    gain: float
    expected: float
    kelvin: float
    separates: bool
    tried: int
    proposing: float
    seconds: float
    text: str


def walking(seconds: int, seed: str) -> tuple[Bout, ...]:
    """Ordinary walking: walks and trots at changing speeds and loads, now and then a stand or a rest."""
    draw = random.Random(f"walking {seed}")
    kinds = ["walk", "trot", "walk", "trot", "stand", "rest"] * max(1, seconds // 1800)
    draw.shuffle(kinds)
    duration = seconds // len(kinds)
    return tuple(_walked(kind, duration, draw) for kind in kinds)


def _walked(kind: str, seconds: int, draw: random.Random) -> Bout:
    speed, load = draw.uniform(0.2, 1.2), draw.uniform(0.0, 5.0)
    return Bout(kind, seconds, speed * (kind in ("walk", "trot")), load * (kind != "rest"))


def segments(experiment: Experiment, at: str) -> tuple[Bout, ...]:
    """The proposed run in the virtual robot's words; where it moves all joints at once, those at `at` are as asked."""
    table = zip(experiment.program.phases, experiment.stage.as_json(experiment.program), strict=True)
    return tuple(_segment(move, round(seconds), entry["inputs"], at) for (move, seconds), entry in table)


def feasible(move: Move) -> bool:
    """What the virtual robot can do: any joints push; all swing without load; all walk under load."""
    return move.speed == 0.0 or move.at == EVERYWHERE


def _segment(move: Move, seconds: int, inputs: object, at: str) -> Bout:
    if not isinstance(inputs, dict) or not move.joints:
        return Bout("rest", seconds)
    asked = matching(at, move.joints) or list(move.joints)
    torque = {joint: float(inputs[f"torque.{joint}"]) for joint in asked}
    pace = {joint: float(inputs[f"velocity.{joint}"]) for joint in asked}
    if move.load > 0.0 and move.speed > 0.0:
        base = float(inputs["speed.base"]) if move.travelling else (_ratio(pace, TROT_SWEEP, 2 / np.pi) - 0.6) / 0.4
        speed = float(np.clip(base, 0.0, 3.0))
        return Bout("trot", seconds, speed, _load(_ratio(torque, TROT, 1 + 0.15 * speed)))
    if move.speed > 0.0:
        return Bout("leg_sweep", seconds, min(_ratio(pace, SWEEP, 2 / np.pi), 3.0))
    if move.at == EVERYWHERE:
        return Bout("stand", seconds, 0.0, _load(_ratio(torque, STAND, 1.0)))
    size = float(np.sqrt(np.mean([inputs[f"torque.{joint}"] ** 2 for joint in move.joints])))
    return Bout("hold", seconds, joints=move.joints, torque=min(size, 33.5))


def _ratio(wanted: dict[str, float], usual: dict[str, float], factor: float) -> float:
    """How many times the virtual robot's usual values, times a factor, the wanted ones are, in the mean square."""
    at_one = {joint: factor * usual[joint.split("_")[1]] for joint in wanted}
    return float(np.sqrt(sum(x**2 for x in wanted.values()) / sum(x**2 for x in at_one.values())))


def _load(ratio: float) -> float:
    """The load [kg] at which the torques are so many times those with the usual load."""
    return float(np.clip(ratio * (BODY + LOADED) - BODY, 0.0, MOST_LOAD))


def lead(hidden: str, found: Sequence[Step]) -> float:
    """By how much the information criterion prefers the hidden effect to its rival; below 0 it prefers the rival."""
    first, second = sorted(found, key=lambda step: step.effect != hidden)
    return criterion_difference(second.fit, first.fit)


def judged(hidden: str, found: Sequence[Step]) -> str:
    """Decided `right` or `wrong`, or `tied`."""
    if len(found) < 2:
        return "tied"
    first, second = found[:2]
    if criterion_difference(second.fit, first.fit) <= TIE:
        return "tied"
    return "right" if first.effect == hidden else "wrong"


def refits(loaded: LoadedModel, logs: Sequence[Path], rivals: Sequence[str], at: str) -> tuple[Fit, list[Step]]:
    """The model without them and the rivals, fitted to these logs, the one that explains more first."""
    data = for_search(split_data(loaded.runs(logs)))
    base = fit_segments(loaded.model, data.fit)
    columns = set.intersection(*(set(segment.run.columns) for segment in data.fit))
    # All that can have the effect: every node, or every joint.
    names = ("*", "*_*") if at == EVERYWHERE else (at,)
    proposed = candidates(loaded.model.network, columns)
    widest = {
        candidate.effect.key: candidate
        for name in reversed(names)
        for candidate in proposed
        if candidate.at == name and not candidate.run
    }
    chosen = [widest[rival] for rival in rivals if rival in widest]
    if len(chosen) != len(rivals):
        raise ValueError(f"rivals {rivals} at {at}: the model has room for {[candidate.key for candidate in chosen]}")
    steps = [Step(finished(refit(base, one)), one) for one in (rival.declaration() for rival in chosen)]
    return base, sorted(steps, key=lambda step: step.fit.cost)


def trial(number: int, seed: int) -> Outcome:
    """One pair of `PAIRS` on one robot."""
    pair = PAIRS[number]
    begin, draw = time.perf_counter(), random.Random(f"{pair[:3]} {seed}")
    at = draw.choice(virtual.places("coulomb_friction", "quadruped")[:12]) if pair[2] == "?" else pair[2]
    hidden, rival = draw.sample(pair[:2], 2)
    rivals = (hidden, rival)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "quadruped.toml").write_text(preset_text("quadruped", "coupled"))
        loaded = load_model(folder / "quadruped.toml")

        def log(what: str, segments: tuple[Bout, ...], ambient: float) -> Path:
            effect = Hidden(hidden, at, pair[3], "quadruped")
            runs = {what: virtual.Job(segments, ambient, cutout=None)}
            logs = virtual.quadruped_logs(
                [effect], seed=seed, runs=runs, physics="plain", noise=NOISE, quantisation=STEPS, columns="all"
            )
            return virtual.write_logs(folder, logs)[0]

        base = log("base", walking(3600, f"{seed}"), AMBIENT)
        given, first = refits(loaded, [base], rivals, at)
        moves = [move for move in Stage(first).moves() if feasible(move)]
        asked = time.process_time()
        experiment = propose(first, allowed=moves)
        proposing = time.process_time() - asked
        if experiment is None:
            raise ValueError(f"{rivals} at {at}, seed {seed}: every run is too hot")
        designed = log("designed", segments(experiment, at), experiment.program.ambient)
        more = log("more", walking(1200, f"more {seed}"), AMBIENT)
        weakest = experiment.weakest
        refitted = (first, *(refits(loaded, [base, other], rivals, at)[1] for other in (designed, more)))
        before, after, control = (judged(hidden, steps) for steps in refitted)
        leads = (lead(hidden, refitted[0]), lead(hidden, refitted[1]), lead(hidden, refitted[2]))
        return Outcome(
            number,
            hidden,
            rival,
            at,
            seed,
            before,
            after,
            control,
            leads,
            max(criterion_difference(given, step.fit) for step in first),
            weakest.deviations,
            weakest.kelvin,
            experiment.separates,
            experiment.tried,
            proposing,
            time.perf_counter() - begin,
            experiment.text(),
        )


def row(done: Outcome) -> str:
    """A line of the table."""
    said = "yes" if done.separates else "no"
    return (
        f"| {done.hidden} | {done.rival} | {done.at} | {done.seed} | {done.gain:.0f} "
        f"| {done.before}, {done.leads[0]:.0f} | {done.designed}, {done.leads[1]:.0f} "
        f"| {done.walking}, {done.leads[2]:.0f} "
        f"| {said}, {done.expected:.1f} sd, {done.kelvin:.2f} K | {done.text} |"
    )


def summary(outcomes: Sequence[Outcome]) -> str:
    """Shares of the pairs decided rightly and wrongly."""
    lines = []
    data = (("before", "60 min walking"), ("designed", "+ proposed"), ("walking", "+ 20 min walking"))
    for number, (what, label) in enumerate(data):
        answers = [getattr(done, what) for done in outcomes]
        shares = ", ".join(f"{word} {answers.count(word) / len(answers):.2f}" for word in ("right", "tied", "wrong"))
        alone = np.mean([done.leads[number] > TIE for done in outcomes])
        lines.append(f"{label}: {shares} (right by the criterion alone {alone:.2f})")
    for said in (True, False):
        chosen = [done.designed for done in outcomes if done.separates == said]
        promise = "promised to separate" if said else "said that nothing separates"
        lines.append(f"{promise}: {len(chosen)}, of these right after the run {chosen.count('right')}")
    lines.append(f"median {np.median([done.proposing for done in outcomes]):.1f} s of CPU a proposal")
    return f"{len(outcomes)} pairs; " + "; ".join(lines)


def _kept(file: Path | None) -> Iterator[Outcome]:
    if file is not None and file.exists():
        for line in file.read_text(encoding="utf-8").splitlines():
            yield Outcome(**json.loads(line))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", nargs="+", type=int, default=[101, 102])
    parser.add_argument("--pairs", nargs="+", type=int, default=list(range(len(PAIRS))), help="numbers in PAIRS")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path)
    chosen = parser.parse_args()
    done = {(kept.pair, kept.seed): kept for kept in _kept(chosen.out)}
    wanted = [(number, seed) for seed in chosen.seeds for number in chosen.pairs]
    print("Each answer with the lead of the hidden effect by the information criterion.\n")
    print("| hidden | rival | at | seed | gain | before | after proposed | after walking | promised | proposal |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for earlier in done.values():
        print(row(earlier))
    with ProcessPoolExecutor(chosen.jobs) as pool:
        tasks = [pool.submit(trial, *task) for task in wanted if task not in done]
        for task in as_completed(tasks):
            outcome = task.result()
            done[outcome.pair, outcome.seed] = outcome
            print(row(outcome), flush=True)
            if chosen.out is not None:
                with chosen.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(outcome)) + "\n")
    print(summary(list(done.values())))


if __name__ == "__main__":
    main()
