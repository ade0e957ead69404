"""What happens in one log, and the sets of runs of [QuadrupedLPTN, table 1, 3]."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from .motion import Bout
from .robot import check_one_of, stream

CUTOUT, RESUME = 65.0, 50.0  # degC
GAP, PAUSE = 60, 3600  # s, between runs of the protocol and of the tests
RUN_SECONDS = 1800  # of the protocol and of the tests
WARM_UP = 420  # s of trot with 4 kg, without a log, before the robot is left to cool


# --- one run -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Job:
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

    segments: tuple[Bout, ...]
    ambient: float = 25.0
    carried: bool = False
    gap: int = GAP
    lead: tuple[Bout, ...] = ()
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


def protocol(seed: int = 0) -> dict[str, Job]:
    """Return the 25 runs of [QuadrupedLPTN, table 1], 1800 s each, one after the other.

    "unpowered"; "<joint>_<diagonal>_<torque>Nm" for abd, hip and knee (the URDF's hip, thigh and calf) of the
    diagonals RF_LR and LF_RR; "trot_low", "trot_medium" and "trot_high" without load, spread over them; "cooling"
    right after a loaded trot that has no log. At 65 degC a trot is over; single joints pause until they are
    below 50 degC.
    """
    single: dict[str, Bout] = {}
    for diagonal, legs in _DIAGONALS.items():
        for word, part in _WORDS.items():
            joints = tuple(f"{leg}_{part}" for leg in legs)
            for torque in _TORQUES[word]:
                single[f"{word}_{diagonal}_{torque}Nm"] = Bout("hold", RUN_SECONDS, joints=joints, torque=float(torque))
    acts, names = {"unpowered": Bout("rest", RUN_SECONDS)}, list(single)
    # A trot after seven single joints: so each begins with a body that the one before hasn't left hot.
    for k, (name, speed) in enumerate(_TROTS.items()):
        acts |= {one: single[one] for one in names[7 * k : 7 * k + 7]}
        acts[name] = Bout("trot", RUN_SECONDS, speed)
    acts["cooling"] = Bout("rest", RUN_SECONDS)
    return _in_turn({name: (act,) for name, act in acts.items()}, seed, "protocol", GAP)


def conditions(seed: int = 0) -> dict[str, Job]:
    """Return the conditions of [QuadrupedLPTN, table 3; multi-gait test].

    Another day, with an hour of rest before each, and a loaded trot without a log before "cooling".
    """
    multi = (("stand", 0.0, 0.0), ("stand", 0.0, 4.0), ("trot", 0.2, 2.0), ("trot", 0.2, 4.0), ("walk", 0.2, 4.0))
    acts = {
        "stand": (Bout("stand", RUN_SECONDS),),
        "trot_0kg_low": (Bout("trot", RUN_SECONDS, 0.2),),
        "trot_0kg_high": (Bout("trot", RUN_SECONDS, 1.0),),
        "trot_4kg_low": (Bout("trot", RUN_SECONDS, 0.2, 4.0),),
        "walk_4kg": (Bout("walk", RUN_SECONDS, 0.2, 4.0),),
        "cooling": (Bout("rest", RUN_SECONDS),),
        "multi_gait": tuple(Bout(act, RUN_SECONDS // 5, speed, load) for act, speed, load in multi),
    }
    return _in_turn(acts, seed, "tests", PAUSE)


def _in_turn(acts: dict[str, tuple[Bout, ...]], seed: int, day: str, gap: int) -> dict[str, Job]:
    """Return runs that carry their temperatures over; the room warms and cools by 1.5 K over the day."""
    morning = 24.5 + stream(seed, "day", day).uniform(-1, 1)
    runs = {}
    for k, (name, segments) in enumerate(acts.items()):
        ambient = round(morning + 1.5 * math.sin(math.pi * k / len(acts)), 1)
        lead = (Bout("trot", WARM_UP, 0.2, 4.0),) if name == "cooling" else ()
        resume = RESUME if segments[0].activity == "hold" else None
        runs[name] = Job(segments, ambient, carried=k > 0, gap=gap, lead=lead, resume=resume)
    return runs


Plan = Literal["protocol", "tests"]
PLANS: dict[str, Callable[[int], dict[str, Job]]] = {"protocol": protocol, "tests": conditions}


def plan(name: Plan, seed: int = 0) -> dict[str, Job]:
    """Return the runs of this name.

    Args:
        name: "protocol" ([QuadrupedLPTN, table 1]) or "tests" (table 3 and the multi-gait test).
        seed: 0 or above; draws ambients and the order of things.

    Raises:
        ValueError: unknown name, negative seed.
    """
    check_one_of("runs", name, PLANS)
    return PLANS[name](seed)
