"""Draw the true parameters of the virtual quadruped: the robot of [QuadrupedLPTN] at the scale of a Unitree A1.

All values are plausible choices, none are the maker's data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from .layouts import LAYOUTS, LEGS, PARTS, PC
from .robot import Array, Robot
from .streams import stream
from .truth import GEAR, MOTOR_CONSTANT, WINDING_RESISTANCE

Physics = Literal["full", "plain"]
Level = Literal["none", "default", "strong"]

NODES = LAYOUTS["quadruped"].nodes
JOINTS = LAYOUTS["quadruped"].joints
TRUNK = "trunk"
HIPS = [3 * k for k in range(len(LEGS))]

HOUSING = (231.0, 210.0, 210.0)  # J/K, hip, thigh, calf
WINDING, INSIDE = 80.0, 0.7  # J/K; K/W to the housing
TO_AIR = (13.75, 11.0, 10.45)  # K/W
ALONG = (0.8, 0.5, 2.5)  # K/W: hip~thigh, thigh~calf, calf~hip
ACROSS = 14.0  # K/W, between the two hips of one end
DRIVE = 4.0  # W
NATURAL, FORCED, WIND_EXPONENT = 0.006, 0.55, 0.8
EMISSIVE_AREA = 0.012  # m²
RISE = 0.0039  # 1/K, copper
COULOMB, VISCOUS, EDDY = 0.25, 0.04, 0.004  # N·m, N·m·s, W/(rad/s)²
PC_CAPACITY, PC_TO_AIR = 420.0, 2.4  # J/K, K/W
PC_IDLE, PC_BUSY = 16.0, 26.0  # W
TRUNK_CAPACITY, TRUNK_TO_AIR, TRUNK_FORCED, BATTERY = 2600.0, 1.4, 0.25, 12.0
TO_TRUNK = 1.6  # K/W, from each hip and from the computer

# One mass a joint and no trunk: the conductances that replace radiation, natural convection and trunk near 30 K above
# the ambient.
PLAIN_TO_AIR = (7.0, 5.8, 5.5)  # K/W
PLAIN_PC_TO_AIR, PLAIN_HIP_TO_PC = 1.9, 8.0  # K/W

# Standard deviations over the legs, relative, and over the runs.
SPREAD = {"resistance": 0.04, "mass": 0.03, "inside": 0.04, "link": 0.06, "air": 0.06, "friction": 0.1}
FARTHEST = 2.5  # standard deviations
LEVELS: dict[str, tuple[float, float, float]] = {
    "none": (0.0, 0.0, 0.0),
    "default": (1.0, 0.15, 0.3),
    "strong": (2.0, 0.25, 0.4),
}  # of the ambient's sensor, K; of the joints' conductances to air, relative; of the battery's heat, relative


def draw_quadruped(seed: int, physics: Physics = "full", scatter: float = 1.0) -> Robot:
    """Draw a quadruped.

    Args:
        seed: integer, 0 or above; equal seeds give equal robots.
        physics: "full": winding and housing apart, trunk and battery, radiation, natural and forced convection,
            friction, copper's resistance rising. "plain": one mass a joint and the computer, links, drive heat.
        scatter: multiplies the scatter of the parameters over the legs; 0 for the nominal robot.

    Raises:
        ValueError: unknown physics, or a scatter outside 0 to 2.
    """
    if physics not in get_args(Physics):
        raise ValueError(f"physics: found {physics!r}; expected one of {', '.join(get_args(Physics))}")
    if not 0 <= scatter <= 2:
        raise ValueError(f"scatter: found {scatter:g}; expected 0 to 2")

    def drawn(name: str, kind: str, values: Sequence[float]) -> Array:
        # A stream for each parameter: both physics share what they have in common.
        luck = stream(seed, "quadruped", name).standard_normal(len(values)).clip(-FARTHEST, FARTHEST)
        return np.asarray(values) * (1 + scatter * SPREAD[kind] * luck)

    joints = len(JOINTS)
    common = {
        "links": _links(drawn("along", "link", ALONG * len(LEGS)), drawn("across", "link", (ACROSS,) * 2)),
        "resistance": np.append(drawn("resistance", "resistance", (WINDING_RESISTANCE,) * joints), 0.0),
        "torque_constant": np.array([GEAR * MOTOR_CONSTANT] * joints + [1.0]),
        "drive": np.array([DRIVE] * joints + [0.0]),
    }
    housing = drawn("housing", "mass", HOUSING * len(LEGS))
    winding = drawn("winding", "mass", (WINDING,) * joints)
    pc = float(drawn("pc", "mass", (PC_CAPACITY,))[0])
    if physics == "plain":
        to_air = drawn("air", "air", (*PLAIN_TO_AIR * len(LEGS), PLAIN_PC_TO_AIR))
        robot = Robot(NODES, np.append(housing + winding, pc), 1 / to_air, joints=joints, **common)  # type: ignore[arg-type]
        to_pc = drawn("body", "link", (PLAIN_HIP_TO_PC,) * len(LEGS))
        robot.links += [(hip, joints, float(1 / r)) for hip, r in zip(HIPS, to_pc, strict=True)]
        return robot
    robot = Robot(
        NODES,
        np.append(housing, pc),
        1 / drawn("air", "air", (*TO_AIR * len(LEGS), PC_TO_AIR)),
        joints=joints,
        **common,  # type: ignore[arg-type]
    )
    robot.winding[:joints] = winding
    robot.inside[:joints] = drawn("inside", "inside", (INSIDE,) * joints)
    robot.coulomb[:joints] = drawn("coulomb", "friction", (COULOMB,) * joints)
    # Eddy currents go with ω², as viscous friction does.
    robot.viscous[:joints] = drawn("viscous", "friction", (VISCOUS,) * joints) + EDDY
    for law, value in (("resistance_rise", RISE), ("natural_convection", NATURAL), ("forced_convection", FORCED)):
        getattr(robot, law)[:joints] = value
    robot.emissive_area[:joints] = EMISSIVE_AREA
    return _with_trunk(robot, drawn("body", "link", (TO_TRUNK,) * (len(LEGS) + 1)))


def _links(along: Array, across: Array) -> list[tuple[int, int, float]]:
    """Return the links of all legs and between the hips, from their resistances in K/W."""
    links = []
    for leg in range(len(LEGS)):
        hip, thigh, calf = (len(PARTS) * leg + k for k in range(len(PARTS)))
        pairs = ((hip, thigh), (thigh, calf), (calf, hip))
        links += [(i, j, float(1 / r)) for (i, j), r in zip(pairs, along[3 * leg : 3 * leg + 3], strict=True)]
    ends = ((HIPS[0], HIPS[1]), (HIPS[2], HIPS[3]))
    return links + [(i, j, float(1 / r)) for (i, j), r in zip(ends, across, strict=True)]


def _with_trunk(robot: Robot, resistances: Array) -> Robot:
    """Return the robot with a trunk that no sensor sees, tied to hips and computer, heated by the battery."""
    own = {"capacity": TRUNK_CAPACITY, "to_air": 1 / TRUNK_TO_AIR, "torque_constant": 1.0, "constant": BATTERY}
    own["forced_convection"] = TRUNK_FORCED
    arrays = {
        name: np.append(value, own.get(name, 0.0))
        for name, value in vars(robot).items()
        if isinstance(value, np.ndarray)
    }
    trunk = len(robot.nodes)
    ends = [*HIPS, robot.nodes.index(PC)]
    ties = [(end, trunk, float(1 / r)) for end, r in zip(ends, resistances, strict=True)]
    nodes, links = (*robot.nodes, TRUNK), robot.links + ties
    return replace(robot, nodes=nodes, links=links, wind_exponent=WIND_EXPONENT, **arrays)  # type: ignore[arg-type]


def draw_errors(robot: Robot, level: Level, seed: int, run: str) -> tuple[Robot, float]:
    """Draw what differs from run to run and no sensor tells.

    Returns:
        The robot of this run, and what the true ambient has above the measured one, K.

    Raises:
        ValueError: unknown level.
    """
    if level not in LEVELS:
        raise ValueError(f"level: found {level!r}; expected one of {', '.join(LEVELS)}")
    ambient, air, battery = np.array(LEVELS[level]) * stream(seed, "errors", run).standard_normal(3).clip(-2.5, 2.5)
    constant, to_air = robot.constant.copy(), robot.to_air.copy()
    to_air[: robot.joints] *= np.exp(air)
    if TRUNK in robot.nodes:
        constant[robot.nodes.index(TRUNK)] *= 1 + battery
    return replace(robot, to_air=to_air, constant=constant), float(ambient)
