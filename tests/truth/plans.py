"""Plans of runs that only trials use: free sessions to diagnose, trots to a limit, outings with a sensor's fault."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lptn.virtual import QUADRUPED_JOINTS, Bout, Job
from lptn.virtual.leg import Acts, in_random_order
from lptn.virtual.robot import stream
from lptn.virtual.runs import RESUME

from .faults import FAULTS, Fault

SWING = 8.0  # K
TROTS, LOGS = 20, 50  # runs of a forecast's plan; healthy ones, and faulty ones, of a monitor's
TROT_SECONDS, OUTING_SECONDS = 4800, 2400
# Where a long trot at 0.2 m/s ends, degC: without load at 0 degC, per kg and per degC of ambient, from a simulation.
ENDS, ENDS_PER_KG = 52.0, 4.7
WELL_ABOVE = 68.0  # degC: a trot that ends just above 60 would creep up to it, and no forecast could say when

_OUTING: Acts = (
    ("stand", 1.0, (0, 0), (0, 4)),
    ("trot", 1.5, (0.2, 0.8), (0, 2)),
    ("walk", 1.5, (0.2, 0.6), (0, 2)),
    ("rest", 0.7, (0, 0), (0, 0)),
    ("trot", 0.7, (0.2, 1.0), (0, 4)),
    ("rest", 0.7, (0, 0), (0, 0)),
)


# --- free sessions, to try a diagnosis on: loads and speeds apart, groups of joints, a cool-down ---

# A "hold" powers four joints, the next one four others. After three of them the joints are grouped anew, or no data
# could tell the four of a group apart.
_HOLD = ("hold", 0.4, (0.0, 0.0), (8.0, 12.0))
_FIT1: Acts = (
    *(_HOLD,) * 9,
    ("stand", 0.8, (0, 0), (0, 4)),
    ("trot", 1.2, (0.2, 0.4), (1, 3)),
    ("leg_sweep", 1.1, (0.9, 1.2), (0, 0)),
    ("sway", 0.9, (0.9, 1.2), (0, 2)),
    ("trot", 1.0, (1.0, 1.4), (2, 5)),
    ("rest", 1.4, (0, 0), (0, 0)),
)
_FIT2: Acts = (
    *(_HOLD,) * 9,
    ("walk", 1.0, (0.2, 0.6), (3, 6)),
    ("leg_sweep", 1.0, (0.4, 0.7), (0, 0)),
    ("sway", 0.9, (0.5, 0.8), (2, 4)),
    ("trot", 1.2, (0.8, 1.4), (4, 7)),
    ("rest", 0.6, (0, 0), (0, 0)),
    ("squat", 0.8, (0.7, 1.1), (2, 4)),
    ("rest", 1.4, (0, 0), (0, 0)),
)
_HOLDOUT: Acts = (
    *(_HOLD,) * 3,
    ("trot", 1.0, (0.3, 0.6), (1, 3)),
    ("rest", 0.4, (0, 0), (0, 0)),
    ("walk", 1.0, (0.3, 0.8), (0, 3)),
    ("leg_sweep", 0.8, (0.6, 1.1), (0, 0)),
    ("sway", 0.8, (0.7, 1.0), (1, 3)),
    ("rest", 1.2, (0, 0), (0, 0)),
)
_TRIAL = {"fit1": (_FIT1, 22.0), "fit2": (_FIT2, 12.0), "holdout": (_HOLDOUT, 28.0)}


def trial(seed: int = 0, fitted: int = 3600) -> dict[str, Job]:
    """Return "fit1" (60 min, 22 degC), "fit2" (60 min, 12 degC) and "holdout" (40 min, 28 degC), each from cold.

    They tell effects apart: load without speed, speed without load, both, groups of joints, all of them, a cool-down.
    ``fitted``: s of each run to fit.
    """
    seconds = {"fit1": fitted, "fit2": fitted, "holdout": 2400}
    return {
        name: Job(draw_segments(stream(seed, "trial", name), acts, seconds[name]), ambient, cutout=None)
        for name, (acts, ambient) in _TRIAL.items()
    }


def draw_segments(rng: np.random.Generator, acts: Acts, seconds: int) -> tuple[Bout, ...]:
    """Draw segments of these activities in random order, but for the last."""
    ordered = in_random_order(acts, seconds, rng)
    segments, joints = [], [str(joint) for joint in rng.permutation(QUADRUPED_JOINTS)]
    for activity, length, speeds, loads in ordered:
        speed, load = float(rng.uniform(*speeds)), float(rng.uniform(*loads))
        if activity == "hold":
            joints = joints or [str(joint) for joint in rng.permutation(QUADRUPED_JOINTS)]
            segments.append(Bout(activity, length, joints=tuple(joints[:4]), torque=load))
            joints = joints[4:]
        else:
            segments.append(Bout(activity, length, speed, load))
    return tuple(segments)


def swing(seed: int = 0) -> dict[str, Job]:
    """Return the runs of ``trial`` out of doors and in again, where the air is 8 K warmer or colder."""
    return {name: replace(run, swing=SWING) for name, run in trial(seed).items()}


def trots(seed: int = 0) -> dict[str, Job]:
    """Return 20 steady trots, 0 to 6 kg, 5 to 35 degC, 0.2 to 1 m/s, 80 min each, all of them past 60 degC.

    Pairs of load and ambient that end near 60 degC, or below it, are drawn again.
    """
    runs = {}
    for k in range(TROTS):
        rng, ends = stream(seed, "forecast", str(k)), 0.0
        while ends < WELL_ABOVE:
            load, ambient = round(rng.uniform(0, 6), 1), round(rng.uniform(5, 35), 1)
            ends = ENDS + ENDS_PER_KG * load + ambient
        speed = float(rng.choice([0.2, 0.5, 1.0]))
        runs[f"trot_{k:02d}"] = Job((Bout("trot", TROT_SECONDS, speed, load),), ambient)
    return runs


def outings(seed: int = 0) -> tuple[dict[str, Job], dict[str, Fault]]:
    """Return 50 healthy outings of 40 min and 50 with one sensor's fault in the middle half, 10 to 30 degC.

    Drifts of 0.01 to 0.1 K/s, offsets of 4 to 15 K, stuck and missing readings in turn.

    Returns:
        The runs, and of the faulty ones the faults, by name.
    """
    runs, faults = {}, {}
    for state in ("healthy", "faulty"):
        for k in range(LOGS):
            rng = stream(seed, "monitor", state, str(k))
            ambient = round(rng.uniform(10, 30), 1)
            name, segments = f"{state}_{k:02d}", draw_segments(rng, _OUTING, OUTING_SECONDS)
            runs[name] = Job(segments, ambient, resume=RESUME)
            if state == "faulty":
                faults[name] = _fault(FAULTS[k % len(FAULTS)], rng)
    return runs, faults


def _fault(kind: str, rng: np.random.Generator) -> Fault:
    at, time, sign = str(rng.choice(QUADRUPED_JOINTS)), float(rng.integers(600, 1800)), rng.choice([-1.0, 1.0])
    size = {"drift": np.exp(rng.uniform(np.log(0.01), np.log(0.1))), "offset": rng.uniform(4, 15)}.get(kind, 0.0)
    return Fault(kind, at, time, float(sign * size))
