"""What happens in one log, and the sets of runs that go by a name: [QuadrupedLPTN, table 1, 3] and free sessions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from .motion import Segment
from .robot import QUADRUPED_JOINTS, check_one_of, stream

CUTOUT, RESUME = 65.0, 50.0  # degC
GAP, PAUSE = 60, 3600  # s, between runs of the protocol and of the tests
RUN_SECONDS = 1800  # of the protocol and of the tests
WARM_UP = 420  # s of trot with 4 kg, without a log, before the robot is left to cool
HOLDOUT_SECONDS = 2400  # of the trial


# --- one run -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Run:
    """What happens in one log.

    Args:
        segments: what the robot does.
        ambient: measured temperature of the air, degC, when the run begins.
        swing: K by which it changes as the robot goes out of doors and in again, 0 to 20.
        carried: begin with the temperatures that the run before left, after ``gap`` s of rest; else with all masses
            at ``start``.
        gap: s.
        lead: what it does between that and the log's beginning.
        start: degC; ``None`` for the ambient.
        cutout: degC at which a joint's winding switches all drives off; ``None`` for never.
        resume: degC below which all of them must be to switch on again; ``None`` for never in this run.
    """

    segments: tuple[Segment, ...]
    ambient: float = 25.0
    carried: bool = False
    gap: int = GAP
    lead: tuple[Segment, ...] = ()
    start: float | None = None
    cutout: float | None = CUTOUT
    resume: float | None = None
    swing: float = 0.0

    def __post_init__(self) -> None:
        if not self.segments:
            raise ValueError("segments: found none; expected at least one")
        if not (math.isfinite(self.ambient) and -40 <= self.ambient <= 60):
            raise ValueError(f"ambient: found {self.ambient:g}; expected -40 to 60 degC")
        if not 0 <= self.swing <= 20:
            raise ValueError(f"swing: found {self.swing:g}; expected 0 to 20 K")

    @property
    def seconds(self) -> int:
        """How long it lasts."""
        return sum(segment.seconds for segment in self.segments)


# --- protocol and tests of [QuadrupedLPTN] ---------------------------------------------------------------------------

# The words of [QuadrupedLPTN]: abduction, hip and knee are the URDF's hip, thigh and calf; L and R before F and R.
_WORDS = {"abd": "hip", "hip": "thigh", "knee": "calf"}
_TORQUES = {"abd": (2, 4, 6), "hip": (2, 4, 6), "knee": (2, 4, 6, 10)}
_DIAGONALS = {"RF_LR": ("FR", "RL"), "LF_RR": ("FL", "RR")}
_TROTS = {"trot_low": 0.2, "trot_medium": 0.5, "trot_high": 1.0}


def protocol(seed: int = 0) -> dict[str, Run]:
    """Return the 25 runs of [QuadrupedLPTN, table 1], 1800 s each, one after the other.

    "unpowered"; "<joint>_<diagonal>_<torque>Nm" for abd, hip and knee (the URDF's hip, thigh and calf) of the
    diagonals RF_LR and LF_RR; "trot_low", "trot_medium" and "trot_high" without load, spread over them; "cooling"
    right after a loaded trot that has no log. At 65 degC a trot is over; single joints pause until they are
    below 50 degC.
    """
    single: dict[str, Segment] = {}
    for diagonal, legs in _DIAGONALS.items():
        for word, part in _WORDS.items():
            joints = tuple(f"{leg}_{part}" for leg in legs)
            for torque in _TORQUES[word]:
                single[f"{word}_{diagonal}_{torque}Nm"] = Segment(
                    "hold", RUN_SECONDS, joints=joints, torque=float(torque)
                )
    acts, names = {"unpowered": Segment("rest", RUN_SECONDS)}, list(single)
    # A trot after seven single joints: so each begins with a body that the one before hasn't left hot.
    for k, (name, speed) in enumerate(_TROTS.items()):
        acts |= {one: single[one] for one in names[7 * k : 7 * k + 7]}
        acts[name] = Segment("trot", RUN_SECONDS, speed)
    acts["cooling"] = Segment("rest", RUN_SECONDS)
    return _in_turn({name: (act,) for name, act in acts.items()}, seed, "protocol", GAP)


def conditions(seed: int = 0) -> dict[str, Run]:
    """Return the conditions of [QuadrupedLPTN, table 3; multi-gait test].

    Another day, with an hour of rest before each, and a loaded trot without a log before "cooling".
    """
    multi = (("stand", 0.0, 0.0), ("stand", 0.0, 4.0), ("trot", 0.2, 2.0), ("trot", 0.2, 4.0), ("walk", 0.2, 4.0))
    acts = {
        "stand": (Segment("stand", RUN_SECONDS),),
        "trot_0kg_low": (Segment("trot", RUN_SECONDS, 0.2),),
        "trot_0kg_high": (Segment("trot", RUN_SECONDS, 1.0),),
        "trot_4kg_low": (Segment("trot", RUN_SECONDS, 0.2, 4.0),),
        "walk_4kg": (Segment("walk", RUN_SECONDS, 0.2, 4.0),),
        "cooling": (Segment("rest", RUN_SECONDS),),
        "multi_gait": tuple(Segment(act, RUN_SECONDS // 5, speed, load) for act, speed, load in multi),
    }
    return _in_turn(acts, seed, "tests", PAUSE)


def _in_turn(acts: dict[str, tuple[Segment, ...]], seed: int, day: str, gap: int) -> dict[str, Run]:
    """Return runs that carry their temperatures over; the room warms and cools by 1.5 K over the day."""
    morning = 24.5 + stream(seed, "day", day).uniform(-1, 1)
    runs = {}
    for k, (name, segments) in enumerate(acts.items()):
        ambient = round(morning + 1.5 * math.sin(math.pi * k / len(acts)), 1)
        lead = (Segment("trot", WARM_UP, 0.2, 4.0),) if name == "cooling" else ()
        resume = RESUME if segments[0].activity == "hold" else None
        runs[name] = Run(segments, ambient, carried=k > 0, gap=gap, lead=lead, resume=resume)
    return runs


# --- free sessions, to try a diagnosis on ---------------------------------------------------------------------------

# Activity, share of the time, ranges of speed and load. A "hold" powers four joints, the next one four others. After
# three of them the joints are grouped anew, or no data could tell the four of a group apart.
Acts = tuple[tuple[str, float, tuple[float, float], tuple[float, float]], ...]
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


def trial(seed: int = 0, fitted: int = 3600) -> dict[str, Run]:
    """Return "fit1" (60 min, 22 degC), "fit2" (60 min, 12 degC) and "holdout" (40 min, 28 degC), each from cold.

    They tell effects apart: load without speed, speed without load, both, groups of joints, all of them, a cool-down.
    ``fitted``: s of each run to fit.
    """
    seconds = {"fit1": fitted, "fit2": fitted, "holdout": HOLDOUT_SECONDS}
    return {
        name: Run(draw_segments(stream(seed, "trial", name), acts, seconds[name]), ambient, cutout=None)
        for name, (acts, ambient) in _TRIAL.items()
    }


def in_random_order(
    acts: Acts, seconds: int, rng: np.random.Generator
) -> list[tuple[str, int, tuple[float, float], tuple[float, float]]]:
    """Return activity, whole seconds, ranges of speed and load: in random order, but for the last."""
    order = [*rng.permutation(len(acts) - 1), len(acts) - 1]
    share = np.array([acts[i][1] for i in order]) * rng.uniform(0.8, 1.2, len(order))
    ends = np.rint(seconds * np.cumsum(share) / share.sum()).astype(int)
    lengths = np.diff(ends, prepend=0)
    return [(acts[i][0], int(length), *acts[i][2:]) for i, length in zip(order, lengths, strict=True)]


def draw_segments(rng: np.random.Generator, acts: Acts, seconds: int) -> tuple[Segment, ...]:
    """Draw segments of these activities in random order, but for the last."""
    ordered = in_random_order(acts, seconds, rng)
    segments, joints = [], [str(joint) for joint in rng.permutation(QUADRUPED_JOINTS)]
    for activity, length, speeds, loads in ordered:
        speed, load = float(rng.uniform(*speeds)), float(rng.uniform(*loads))
        if activity == "hold":
            joints = joints or [str(joint) for joint in rng.permutation(QUADRUPED_JOINTS)]
            segments.append(Segment(activity, length, joints=tuple(joints[:4]), torque=load))
            joints = joints[4:]
        else:
            segments.append(Segment(activity, length, speed, load))
    return tuple(segments)


Plan = Literal["protocol", "tests", "trial"]

PLANS: dict[str, Callable[[int], dict[str, Run]]] = {
    "protocol": protocol,
    "tests": conditions,
    "trial": trial,
}


def plan(name: Plan, seed: int = 0) -> dict[str, Run]:
    """Return the runs of this name.

    Args:
        name: "protocol" ([QuadrupedLPTN, table 1]), "tests" (table 3 and the multi-gait test) or "trial".
        seed: 0 or above; draws ambients and the order of things.

    Raises:
        ValueError: unknown name, negative seed.
    """
    check_one_of("runs", name, PLANS)
    return PLANS[name](seed)
