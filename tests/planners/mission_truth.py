"""A leg of three joints that walks: its task file, and its heat balance written here with numpy and scipy alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray
from lptn.model.model import Model
from tests.builders import effect, leg

SPEEDS, LOADS = (0.2, 1.0), (0.0, 4.0)
TORQUE = {"FR_hip": [[2.0, 2.4], [2.6, 3.0]], "FR_thigh": [[3.0, 3.4], [4.0, 4.4]],
          "FR_calf": [[6.0, 7.5], [8.0, 10.0]]}  # fmt: skip
VELOCITY = {"FR_hip": 1.0, "FR_thigh": 3.0, "FR_calf": 5.0}
AMBIENT, LIMIT = 25.0, 60.0
FOLDING = {"FR_hip": 3.0, "FR_thigh": 6.0, "FR_calf": 15.0}  # N*m, RMS while it lies down or gets up

GAITS: dict[str, dict[str, Any]] = {
    "walk": {
        "speeds": list(SPEEDS), "loads": list(LOADS), "torque": TORQUE, "velocity": VELOCITY,
        "velocity_rms": {"*": 0.0} | VELOCITY,
    },
    "stand": {"loads": list(LOADS), "torque": {"*": 2.0, "FR_calf": [5.0, 12.0]}, "velocity": {"*": 0.0}},
    "run": {"speeds": list(SPEEDS), "torque": {"*": 2.0, "FR_calf": [[2.0, 18.0]]}, "velocity": {"*": 0.0}},
    "rest": {},
}  # fmt: skip


def model() -> Model:
    """The model under test."""
    keys = ("copper_loss", "resistance_rise", "coulomb_friction", "viscous_friction", "drive_heat", "forced_convection")
    return Model(leg([effect(key) for key in keys]))


def task(activities: Sequence[dict[str, object]], limit: float = LIMIT, **task: object) -> dict[str, object]:
    """A parsed task file."""
    return {
        "task": {"kind": "mission", "ambient": AMBIENT} | task,
        "limits": {"*": limit},
        "activities": [dict(activity) for activity in activities],
        "gaits": {name: dict(gait) for name, gait in GAITS.items()},
    }


def rates(T: FloatArray, do: str, speed: float, load: float, ambient: float = AMBIENT) -> FloatArray:
    """dT/dt [K/s] of hip, thigh and calf."""
    torque = np.array([_torque(do, joint, speed, load) for joint in VELOCITY])
    turning = np.array(list(VELOCITY.values())) if do == "walk" else np.zeros(3)
    copper = 0.15 * (torque / 0.84) ** 2 * (1 + 0.0039 * (T - 25.0))
    friction = 0.25 * turning + 0.04 * turning**2
    to_air = (T - ambient) / 10.0 * (1 + 0.5 * (speed if do in ("walk", "run") else 0.0))
    along = np.array([(T[1] - T[0]) / 3, (T[0] - T[1]) / 3 + (T[2] - T[1]) / 2, (T[1] - T[2]) / 2])
    return np.asarray((copper + friction + 4.0 * (do != "rest") + along - to_air) / 300.0)


def _torque(do: str, joint: str, speed: float, load: float) -> float:
    if do == "rest":
        return 0.0
    if " to " in do:
        return FOLDING[joint]
    if do == "run":
        return 2.0 + 16.0 * (speed - 0.2) / 0.8 if joint == "FR_calf" else 2.0
    if do == "stand":
        return 5.0 + 7.0 * load / 4.0 if joint == "FR_calf" else 2.0
    fast, full = (speed - 0.2) / 0.8, load / 4.0
    (a, b), (c, d) = TORQUE[joint]
    return float((a + (b - a) * fast) * (1 - full) + (c + (d - c) * fast) * full)


def simulate(
    plan: Sequence[tuple[str, float, float, float]], start: FloatArray, ambient: float = AMBIENT
) -> FloatArray:
    """Temperatures [degC] at 200 points of each piece (activity, seconds, speed, load), shape (3, points)."""
    pieces, now = [np.asarray(start, dtype=float)[:, None]], np.asarray(start, dtype=float)
    for do, seconds, speed, load in plan:

        def slope(_: float, T: FloatArray, do: str = do, speed: float = speed, load: float = load) -> FloatArray:
            return rates(T, do, speed, load, ambient)

        at = np.linspace(0.0, seconds, 200)
        done = solve_ivp(slope, (0.0, seconds), now, rtol=1e-9, atol=1e-9, t_eval=at)
        pieces.append(done.y)
        now = done.y[:, -1]
    return np.hstack(pieces)
