"""The robot's names and limits, and what it can be told to do; needs no simulator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Activity = Literal["trot", "stand", "rest"]

LEGS = ("FR", "FL", "RR", "RL")
PARTS = ("hip", "thigh", "calf")
JOINTS = tuple(f"{leg}_{part}" for leg in LEGS for part in PARTS)
TORQUE_LIMIT = 33.5  # N·m, the URDF's own


@dataclass(frozen=True)
class Command:
    """What the robot shall do: walk along x at a speed [m/s] with its base at a height [m], stand, or lie down.

    Its feet land below the shoulders, or off them [m]: all of them `ahead` and to the `left`, which moves load between
    the legs, and the front feet ahead and the hind feet back by `splay`, which moves it between knees and thighs.
    """

    activity: Activity = "trot"
    speed: float = 0.5
    height: float = 0.27
    ahead: float = 0.0
    left: float = 0.0
    splay: float = 0.0
