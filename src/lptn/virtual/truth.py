"""Draw the true parameters of the virtual leg.

The nominal values are plausible for a quadruped of the size of a Unitree A1: gear 9.1, torque constant 0.0927 N·m/A
and 0.15 ohm give 0.211 W/(N·m)² at the joint.
"""

from __future__ import annotations

import numpy as np

from .robot import Array, Mass, Robot
from .streams import stream

Leg = Robot

__all__ = ["JOINTS", "Array", "Leg", "Mass", "draw_leg", "roughen"]

JOINTS = ("FR_hip", "FR_thigh", "FR_calf")
HIP, THIGH, CALF = range(3)
COUNT = len(JOINTS)

GEAR = 9.1
MOTOR_CONSTANT = 0.0927  # N·m/A
WINDING_RESISTANCE = 0.15  # ohm
CAPACITY = (300.0, 290.0, 290.0)  # J/K
TO_AIR = (13.0, 11.0, 10.0)  # K/W
LINKS = ((HIP, THIGH, 2.0), (THIGH, CALF, 1.6))  # K/W

ROUGH_SCATTER = 0.10
ROUGH_EMISSIVE_AREA = 0.002  # m², at every joint


# Heavy and far from the hip: its time constant of about an hour is what a model without it can't follow.
TRUNK = Mass(capacity=2600.0, joint=HIP, resistance=12.0, to_air=1 / 1.4, heat=3.0)


def draw_leg(seed: int, scatter: float) -> Leg:
    """Draw a baseline leg.

    Args:
        seed: integer, 0 or above; equal seeds give equal legs.
        scatter: relative half-width of the uniform scatter of every parameter, 0 to 0.5.

    Raises:
        ValueError: the scatter lies outside that range.
    """
    if not 0 <= scatter <= 0.5:
        raise ValueError(f"scatter: found {scatter:g}; expected 0 to 0.5")
    rng = stream(seed, "leg")

    def scattered(values: tuple[float, ...]) -> Array:
        return np.asarray(values) * (1 + scatter * rng.uniform(-1, 1, len(values)))

    capacity, to_air = scattered(CAPACITY), 1 / scattered(TO_AIR)
    between = 1 / scattered(tuple(link[2] for link in LINKS))
    return Leg(
        nodes=JOINTS,
        capacity=capacity,
        to_air=to_air,
        links=[(i, j, float(g)) for (i, j, _), g in zip(LINKS, between, strict=True)],
        resistance=scattered((WINDING_RESISTANCE,) * COUNT),
        torque_constant=scattered((GEAR * MOTOR_CONSTANT,) * COUNT),
    )


def roughen(leg: Leg) -> None:
    """Add, in place, the small physics that no model under test has: a trunk and weak radiation."""
    leg.masses.append(TRUNK)
    leg.emissive_area += ROUGH_EMISSIVE_AREA
