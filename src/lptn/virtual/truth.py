"""Hold the true parameters of the virtual leg: what a tool under test may not see.

The nominal values follow the virtual robot of source S0: gear 9.1, torque constant 0.0927 N·m/A and
0.15 ohm give 0.211 W/(N·m)² at the joint.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .streams import stream

Array = NDArray[np.float64]

JOINTS = ("FR_hip", "FR_thigh", "FR_calf")
HIP, THIGH, CALF = range(3)

GEAR = 9.1
MOTOR_CONSTANT = 0.0927  # N·m/A
WINDING_RESISTANCE = 0.15  # ohm
CAPACITY = (300.0, 290.0, 290.0)  # J/K
TO_AIR = (13.0, 11.0, 10.0)  # K/W
LINKS = ((HIP, THIGH, 2.0), (THIGH, CALF, 1.6))  # K/W

ROUGH_SCATTER = 0.10
ROUGH_EMISSIVE_AREA = 0.002  # m², at every joint


@dataclass(frozen=True)
class Mass:
    """A mass that no sensor sees, tied to one joint.

    capacity: J/K. resistance: to the joint, K/W. to_air: conductance to the ambient, W/K. heat: its own, W.
    """

    capacity: float
    joint: int
    resistance: float
    to_air: float = 0.0
    heat: float = 0.0


# Heavy and far from the hip: its time constant of about an hour is what a model without it can't follow.
TRUNK = Mass(capacity=2600.0, joint=HIP, resistance=12.0, to_air=1 / 1.4, heat=3.0)


def _none() -> Array:
    return np.zeros(len(JOINTS))


@dataclass
class Leg:
    """The truth about one leg. Arrays have one entry a joint, in the order of ``JOINTS``.

    The first five fields are the baseline. All below them is zero there: it is what hidden effects set.
    """

    capacity: Array
    """J/K"""
    to_air: Array
    """conductance to the ambient, W/K"""
    links: list[tuple[int, int, float]]
    """(joint, joint, conductance in W/K)"""
    resistance: Array
    """winding resistance at 25 degC, ohm"""
    torque_constant: Array
    """torque at the joint per ampere at 25 degC, N·m/A"""

    resistance_rise: Array = field(default_factory=_none)
    """1/K"""
    torque_constant_drop: Array = field(default_factory=_none)
    """1/K"""
    natural_convection: Array = field(default_factory=_none)
    """1/K, in exp(beta (T - ambient))"""
    forced_convection: Array = field(default_factory=_none)
    """s/m, in 1 + gamma |v|"""
    emissive_area: Array = field(default_factory=_none)
    """emissivity × area, m²"""
    coulomb: Array = field(default_factory=_none)
    """N·m"""
    viscous: Array = field(default_factory=_none)
    """N·m·s"""
    iron: Array = field(default_factory=_none)
    """W/(rad/s)^1.5"""
    constant: Array = field(default_factory=_none)
    """W"""
    masses: list[Mass] = field(default_factory=list)
    lag: Array = field(default_factory=_none)
    """time constant of the sensor, s"""
    offset: Array = field(default_factory=_none)
    """K, on the reading"""
    bursts: Array = field(default_factory=_none)
    """W, while a burst lasts"""
    step: Array = field(default_factory=_none)
    """K, on the reading after the step"""
    splash: Array = field(default_factory=_none)
    """J taken away by each splash"""


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

    count = len(JOINTS)
    capacity, to_air = scattered(CAPACITY), 1 / scattered(TO_AIR)
    between = 1 / scattered(tuple(link[2] for link in LINKS))
    return Leg(
        capacity=capacity,
        to_air=to_air,
        links=[(i, j, float(g)) for (i, j, _), g in zip(LINKS, between, strict=True)],
        resistance=scattered((WINDING_RESISTANCE,) * count),
        torque_constant=scattered((GEAR * MOTOR_CONSTANT,) * count),
    )


def roughen(leg: Leg) -> None:
    """Add, in place, the small physics that no model under test has: a trunk and weak radiation."""
    leg.masses.append(TRUNK)
    leg.emissive_area += ROUGH_EMISSIVE_AREA
