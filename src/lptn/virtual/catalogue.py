"""Hold the catalogue of hidden effects and their default strengths.

Each function below sets one effect in a ``Robot``, in place: at one node of the given index, or between two. Its name
is the effect's key. To add one: a field in ``Robot`` where it is kept (zero when off), its physics in ``solve.act``
(air, heat that does not depend on temperature), ``Network`` and ``Exponential`` (heat that does) or ``rows`` (what the
sensors show), and a function here.
Strengths were chosen by simulating: the effect at one joint moves some temperature by about 1 to 5 K at most.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .robot import Mass, Robot

JOINT, NODE, EDGE = "joint", "node", "edge"


@dataclass(frozen=True)
class Effect:
    """How to set one effect, and where it can stand.

    set: function of the robot, one index (two for an edge) and the size. kind: "joint", "node" (anything with a
    sensor) or "edge". beyond: nothing a diagnosis has a name for.
    """

    set: Callable[..., None]
    kind: str
    beyond: bool = False


EFFECTS: dict[str, Effect] = {}


def _effect(kind: str, *, beyond: bool = False) -> Callable[[Callable[..., None]], Callable[..., None]]:
    def keep(setter: Callable[..., None]) -> Callable[..., None]:
        EFFECTS[setter.__name__] = Effect(setter, kind, beyond)
        return setter

    return keep


@_effect(JOINT)
def resistance_rise(robot: Robot, node: int, size: float) -> None:
    """Copper: the winding's resistance × (1 + 0.00393 (T - 25)) (source S0, row E6)."""
    robot.resistance_rise[node] += 0.00393 * size


@_effect(JOINT)
def torque_constant_drop(robot: Robot, node: int, size: float) -> None:
    """Magnets: the torque constant × (1 - 0.0012 (T - 25))."""
    robot.torque_constant_drop[node] += 0.0012 * size


@_effect(NODE)
def natural_convection(robot: Robot, node: int, size: float) -> None:
    """Conductance to air × exp(0.006 (T - ambient)) (source S0, row E3)."""
    robot.natural_convection[node] += 0.006 * size


@_effect(NODE)
def forced_convection(robot: Robot, node: int, size: float) -> None:
    """Conductance to air × (1 + 0.55 |v|), v the base's speed in m/s (source S0, row E3)."""
    robot.forced_convection[node] += 0.55 * size


@_effect(JOINT)
def coulomb_friction(robot: Robot, node: int, size: float) -> None:
    """Heat 0.5 |ω|: 0.5 N·m at the joint (source S0, row E8, as power)."""
    robot.coulomb[node] += 0.5 * size


@_effect(JOINT)
def viscous_friction(robot: Robot, node: int, size: float) -> None:
    """Heat 0.07 ω²: 0.07 N·m·s at the joint (source S0, row E8, as power)."""
    robot.viscous[node] += 0.07 * size


@_effect(NODE)
def constant_heat(robot: Robot, node: int, size: float) -> None:
    """Heat of 1.5 W, always on."""
    robot.constant[node] += 1.5 * size


@_effect(EDGE)
def conduction(robot: Robot, one: int, other: int, size: float) -> None:
    """A link of 3 K/W; the size multiplies its conductance."""
    robot.links.append((one, other, size / 3.0))


@_effect(NODE)
def second_mass(robot: Robot, node: int, size: float) -> None:
    """120 J/K of the node move to an inner mass behind 1.5 K/W, neither measured nor heated.

    Raises:
        ValueError: less than a tenth of the node's capacity would be left.
    """
    inner = 120.0 * size
    if inner > 0.9 * robot.capacity[node]:
        largest = 0.9 * robot.capacity[node] / 120.0
        raise ValueError(f"size of second_mass: found {size:g}; expected at most {largest:.2f} at {robot.nodes[node]}")
    if inner > 0:
        robot.capacity[node] -= inner
        robot.masses.append(Mass(inner, node, resistance=1.5))


@_effect(NODE)
def sensor_lag(robot: Robot, node: int, size: float) -> None:
    """The reading follows the node as a first-order lag of 20 s."""
    robot.lag[node] += 20.0 * size


@_effect(NODE)
def sensor_offset(robot: Robot, node: int, size: float) -> None:
    """The reading is 2 K too high."""
    robot.offset[node] += 2.0 * size


@_effect(JOINT)
def iron_loss(robot: Robot, node: int, size: float) -> None:
    """Heat 0.2 |ω|^1.5."""
    robot.iron[node] += 0.2 * size


@_effect(NODE)
def radiation(robot: Robot, node: int, size: float) -> None:
    """Loss σ εA (T⁴ - ambient⁴), in kelvin, with an emissivity × area of 0.008 m²."""
    robot.emissive_area[node] += 0.008 * size


@_effect(NODE, beyond=True)
def heat_bursts(robot: Robot, node: int, size: float) -> None:
    """Bursts of 6 W, each 1 to 3 min, at random times."""
    robot.bursts[node] += 6.0 * size


@_effect(NODE, beyond=True)
def sensor_step(robot: Robot, node: int, size: float) -> None:
    """The reading jumps up by 3 K at a random time of each run; the next run starts without it."""
    robot.step[node] += 3.0 * size


@_effect(NODE, beyond=True)
def splash(robot: Robot, node: int, size: float) -> None:
    """400 J are taken away within a second, at random times."""
    robot.splash[node] += 400.0 * size
