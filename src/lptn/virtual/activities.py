"""Name what the quadruped can do, and how hard it is."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .quadruped_truth import JOINTS

BODY = 12.0  # kg: torque grows as body and load together
LOADED = 4.0  # kg, the load at which the torques below are given

_TROT = (0.0, 0.5, 0.5, 0.0)  # of FR, FL, RR, RL
_WALK = (0.0, 0.5, 0.75, 0.25)
_TOGETHER = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Activity:
    """A way of moving. Triples are hip, thigh, calf.

    torque: RMS with a load of 4 kg, at speed 0, N·m. growth: of the torque with speed, relative, s/m.
    bias: constant part of the torque's pattern, beside a sine of size 1. sweep: amplitude of the joints' speed at
    speed 1, rad/s, and reach_at_zero the share of it at speed 0. stride: Hz at speed 0, and its growth with speed.
    phases: of the legs, in cycles. travels: whether the speed is the base's, in m/s; else a factor on sweep.
    """

    torque: tuple[float, float, float] = (0.0, 0.0, 0.0)
    growth: float = 0.0
    bias: float = 0.6
    sweep: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reach_at_zero: float = 0.0
    stride: tuple[float, float] = (0.5, 0.0)
    phases: tuple[float, float, float, float] = _TOGETHER
    travels: bool = False
    powered: bool = True

    def reach(self, speed: float) -> float:
        """Return the factor on the sweep at this speed."""
        return self.reach_at_zero + (1 - self.reach_at_zero) * speed


ACTIVITIES = {
    "rest": Activity(powered=False),
    "stand": Activity((1.3, 2.2, 5.6), bias=8.0, stride=(0.3, 0.0)),
    "trot": Activity((2.242, 3.767, 8.078), 0.15, 0.6, (1.5, 6.0, 10.41), 0.6, (1.6, 1.2), _TROT, travels=True),
    "walk": Activity((2.0, 3.4, 7.0), 0.15, 0.8, (1.2, 5.0, 8.0), 0.5, (1.0, 0.9), _WALK, travels=True),
    "squat": Activity((1.5, 4.5, 8.0), 0.0, 1.2, (0.3, 2.5, 4.0), 0.0, (0.4, 0.0)),
    "sway": Activity((7.0, 3.5, 5.0), 0.0, 0.6, (6.0, 2.5, 3.0), 0.0, (0.5, 0.0)),
    "leg_sweep": Activity((0.6, 0.6, 0.5), 0.0, 0.0, (8.0, 8.0, 9.0), 0.0, (0.9, 0.4)),
    "hold": Activity(bias=12.0, stride=(0.5, 0.0)),
}


@dataclass(frozen=True)
class Segment:
    """One activity for whole seconds.

    Args:
        activity: a key of ``ACTIVITIES``; "rest" has all drives off, "hold" powers ``joints`` alone.
        seconds: 1 or above.
        speed: m/s for trot and walk; for squat, sway and leg_sweep a factor on the joints' speed.
        load: kg on the back, 0 to 20.
        joints: for "hold", which joints push.
        torque: for "hold", RMS torque of each, N·m.

    Raises:
        ValueError: a value outside its range.
    """

    activity: str
    seconds: int
    speed: float = 0.0
    load: float = 0.0
    joints: tuple[str, ...] = ()
    torque: float = 0.0

    def __post_init__(self) -> None:
        if self.activity not in ACTIVITIES:
            raise ValueError(f"activity: found {self.activity!r}; expected one of {', '.join(ACTIVITIES)}")
        if self.seconds != int(self.seconds) or self.seconds < 1:
            raise ValueError(f"seconds of {self.activity}: found {self.seconds:g}; expected a whole number, 1 or above")
        for name, top, unit in (("speed", 3.0, "m/s"), ("load", 20.0, "kg"), ("torque", 33.5, "N·m")):
            value = getattr(self, name)
            if not (math.isfinite(value) and 0 <= value <= top):
                raise ValueError(f"{name} of {self.activity}: found {value:g}; expected 0 to {top:g} {unit}")
        if (self.activity == "hold") != bool(self.joints):
            raise ValueError(
                f"joints of {self.activity}: found {len(self.joints)}; expected joints for hold, else none"
            )
        if unknown := [joint for joint in self.joints if joint not in JOINTS]:
            raise ValueError(f"joints of hold: found {unknown[0]!r}; expected some of {', '.join(JOINTS)}")
