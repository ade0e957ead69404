"""A leg with what no model has: a trunk at the hip, weak radiation, and errors of each run that no sensor shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd

from lptn.virtual import LEG_JOINTS, Hidden, Mass, Robot, leg_logs
from lptn.virtual.robot import stream

AMBIENT, TORQUE = 0.5, 0.02  # standard deviations over runs: of the ambient's sensor, K; of each torque's scale
# Heavy and far from the hip: its time constant of about an hour is what a model without it can't follow.
TRUNK = Mass(capacity=2600.0, joint=0, resistance=12.0, to_air=1 / 1.4, heat=3.0)


def roughen(leg: Robot) -> None:
    """Add a trunk and weak radiation, in place."""
    leg.masses.append(TRUNK)
    leg.emissive_area += 0.002  # m², at every joint


def rough_leg_logs(hidden: Sequence[Hidden] = (), *, seed: int, **options: Any) -> dict[str, pd.DataFrame]:
    """Return `leg_logs` of such a leg, its parameters scattered by 10 %; a seed's noise is that of its clean leg."""
    logs = leg_logs([roughen, *hidden], seed=seed, scatter=0.1, **options)
    for name, log in logs.items():
        rng = stream(seed, "sensors", name)
        log["temperature.ambient"] += AMBIENT * rng.standard_normal()
        log[[f"torque.{joint}" for joint in LEG_JOINTS]] *= 1 + TORQUE * rng.standard_normal(len(LEG_JOINTS))
    return logs
