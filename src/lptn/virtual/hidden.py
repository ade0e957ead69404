"""Name the hidden effects, their places and their default strengths.

Each function below the line sets one effect in a ``Leg``, at one joint; its name is the effect's key.
Strengths were chosen by simulating: the effect at one joint moves some temperature by about 1 to 5 K at most.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from .truth import CALF, HIP, JOINTS, Leg, Mass

EVERYWHERE = "*"
EDGE = f"{JOINTS[CALF]}~{JOINTS[HIP]}"


@dataclass(frozen=True)
class Hidden:
    """One effect that the truth has and the baseline lacks.

    Args:
        effect: a key of ``EFFECTS``.
        at: a joint, or ``"*"`` for all; for ``conduction`` the edge ``"FR_calf~FR_hip"``.
        size: multiplies the default strength; 0 switches the effect off.

    Raises:
        ValueError: unknown effect or place, or a size that is negative or not finite.
    """

    effect: str
    at: str
    size: float = 1.0

    def __post_init__(self) -> None:
        if self.effect not in EFFECTS:
            raise ValueError(f"effect: found {self.effect!r}; expected one of {', '.join(EFFECTS)}")
        if self.at not in places(self.effect):
            allowed = ", ".join(places(self.effect))
            raise ValueError(f"place of {self.effect}: found {self.at!r}; expected one of {allowed}")
        if not (math.isfinite(self.size) and self.size >= 0):
            raise ValueError(f"size of {self.effect}: found {self.size:g}; expected a finite number, 0 or above")

    def set_in(self, leg: Leg) -> None:
        """Set the effect in this leg, in place."""
        targets = range(len(JOINTS)) if self.at == EVERYWHERE else [HIP if self.at == EDGE else JOINTS.index(self.at)]
        for joint in targets:
            EFFECTS[self.effect](leg, joint, self.size)


def places(effect: str) -> tuple[str, ...]:
    """Return the places where this effect may be put."""
    return (EDGE,) if effect == "conduction" else (*JOINTS, EVERYWHERE)


# ---- the catalogue ------------------------------------------------------------------------


def resistance_rise(leg: Leg, joint: int, size: float) -> None:
    """Copper: the winding's resistance × (1 + 0.00393 (T - 25)) (source S0, row E6)."""
    leg.resistance_rise[joint] += 0.00393 * size


def torque_constant_drop(leg: Leg, joint: int, size: float) -> None:
    """Magnets: the torque constant × (1 - 0.0012 (T - 25))."""
    leg.torque_constant_drop[joint] += 0.0012 * size


def natural_convection(leg: Leg, joint: int, size: float) -> None:
    """Conductance to air × exp(0.006 (T - ambient)) (source S0, row E3)."""
    leg.natural_convection[joint] += 0.006 * size


def forced_convection(leg: Leg, joint: int, size: float) -> None:
    """Conductance to air × (1 + 0.55 |v|), v the base's speed in m/s (source S0, row E3)."""
    leg.forced_convection[joint] += 0.55 * size


def coulomb_friction(leg: Leg, joint: int, size: float) -> None:
    """Heat 0.5 |ω|: 0.5 N·m at the joint (source S0, row E8, as power)."""
    leg.coulomb[joint] += 0.5 * size


def viscous_friction(leg: Leg, joint: int, size: float) -> None:
    """Heat 0.07 ω²: 0.07 N·m·s at the joint (source S0, row E8, as power)."""
    leg.viscous[joint] += 0.07 * size


def constant_heat(leg: Leg, joint: int, size: float) -> None:
    """Heat of 1.5 W, always on."""
    leg.constant[joint] += 1.5 * size


def conduction(leg: Leg, joint: int, size: float) -> None:
    """A link hip~calf of 3 K/W; the size multiplies its conductance."""
    leg.links.append((joint, CALF, size / 3.0))


def second_mass(leg: Leg, joint: int, size: float) -> None:
    """120 J/K of the node move to an inner mass behind 1.5 K/W, neither measured nor heated.

    Raises:
        ValueError: less than a tenth of the node's capacity would be left.
    """
    inner = 120.0 * size
    if inner > 0.9 * leg.capacity[joint]:
        largest = 0.9 * leg.capacity[joint] / 120.0
        raise ValueError(f"size of second_mass: found {size:g}; expected at most {largest:.2f} at {JOINTS[joint]}")
    if inner > 0:
        leg.capacity[joint] -= inner
        leg.masses.append(Mass(inner, joint, resistance=1.5))


def sensor_lag(leg: Leg, joint: int, size: float) -> None:
    """The reading follows the node as a first-order lag of 20 s."""
    leg.lag[joint] += 20.0 * size


def sensor_offset(leg: Leg, joint: int, size: float) -> None:
    """The reading is 2 K too high."""
    leg.offset[joint] += 2.0 * size


def iron_loss(leg: Leg, joint: int, size: float) -> None:
    """Heat 0.2 |ω|^1.5."""
    leg.iron[joint] += 0.2 * size


def radiation(leg: Leg, joint: int, size: float) -> None:
    """Loss σ εA (T⁴ - ambient⁴), in kelvin, with an emissivity × area of 0.008 m²."""
    leg.emissive_area[joint] += 0.008 * size


# ---- beyond the catalogue: nothing a diagnosis has a name for -----------------------------


def heat_bursts(leg: Leg, joint: int, size: float) -> None:
    """Bursts of 6 W, each 1 to 3 min, at random times."""
    leg.bursts[joint] += 6.0 * size


def sensor_step(leg: Leg, joint: int, size: float) -> None:
    """The reading jumps up by 3 K at a random time of each run; the next run starts without it."""
    leg.step[joint] += 3.0 * size


def splash(leg: Leg, joint: int, size: float) -> None:
    """400 J are taken away within a second, at random times."""
    leg.splash[joint] += 400.0 * size


BEYOND = (heat_bursts.__name__, sensor_step.__name__, splash.__name__)
EFFECTS: dict[str, Callable[[Leg, int, float], None]] = {
    setter.__name__: setter
    for setter in (
        resistance_rise,
        torque_constant_drop,
        natural_convection,
        forced_convection,
        coulomb_friction,
        viscous_friction,
        constant_heat,
        conduction,
        second_mass,
        sensor_lag,
        sensor_offset,
        iron_loss,
        radiation,
        heat_bursts,
        sensor_step,
        splash,
    )
}
