"""Hidden effects on the paths and the stores of heat."""

from __future__ import annotations

from .registry import CLASS, EDGE, NODE, Catalogue, entry, limited, scaled
from .robot import Mass, Robot

PATHS: Catalogue = {}


@entry(PATHS, NODE)
def natural_convection(robot: Robot, node: int, size: float) -> None:
    """Conductance to air × exp(0.006 (T - ambient)) ([QuadrupedLPTN, eq. 3])."""
    robot.natural_convection[node] += 0.006 * size


@entry(PATHS, NODE)
def forced_convection(robot: Robot, node: int, size: float) -> None:
    """Conductance to air × (1 + 0.55 |v|), v the base's speed in m/s ([QuadrupedLPTN, eq. 3])."""
    robot.forced_convection[node] += 0.55 * size


@entry(PATHS, NODE)
def fan(robot: Robot, node: int, size: float) -> None:
    """Conductance to air × (1 + 0.5 s), s the logged share of a fan's full speed."""
    robot.fanned[node] += 0.5 * size


@entry(PATHS, NODE, signed=True, single=True)
def surface_scale(robot: Robot, node: int, size: float) -> None:
    """Conductance to air × 1.3: a fan that no log tells of, a cover taken off.

    Raises:
        ValueError: less than a tenth of the conductance would be left.
    """
    robot.to_air[node] *= scaled("surface_scale", size, 0.3)


@entry(PATHS, EDGE)
def conduction(robot: Robot, one: int, other: int, size: float) -> None:
    """A link of 3 K/W; the size multiplies its conductance."""
    robot.links.append((one, other, size / 3.0))


@entry(PATHS, NODE)
def second_mass(robot: Robot, node: int, size: float) -> None:
    """120 J/K of the node move to an inner mass behind 1.5 K/W, neither measured nor heated.

    Raises:
        ValueError: less than a tenth of the node's capacity would be left.
    """
    inner = 120.0 * size
    limited("second_mass", size, 0.9 * robot.capacity[node] / 120.0, robot.nodes[node])
    if inner > 0:
        robot.capacity[node] -= inner
        robot.masses.append(Mass(inner, node, resistance=1.5))


@entry(PATHS, CLASS)
def shared_mass(robot: Robot, nodes: list[int], size: float) -> None:
    """One frame that no sensor sees, tied to each of the nodes by 17 K/W; for each, it has 120 J/K and 42 K/W to air.

    The size multiplies its conductances and its capacity.
    """
    if size > 0:
        share = size * len(nodes)
        robot.masses.append(Mass(120.0 * share, nodes[0], 17.0 / size, share / 42.0, also=tuple(nodes[1:])))


@entry(PATHS, NODE)
def radiation(robot: Robot, node: int, size: float) -> None:
    """Loss σ εA (T⁴ - ambient⁴), in kelvin, with an emissivity × area of 0.008 m²."""
    robot.emissive_area[node] += 0.008 * size
