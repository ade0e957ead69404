"""The true robots: a three-joint leg and a quadruped at the scale of a Unitree A1, with every true parameter.

All values are plausible choices for a robot of that size, none are the maker's data: gear 9.1, torque constant
0.0927 N·m/A and 0.15 ohm make 0.211 W/(N·m)² at the joint. The quadruped is the robot of [QuadrupedLPTN].
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import combinations
from typing import Any, Literal, get_args
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
KNOT = 8.0  # s between the knots of what wanders slowly
Physics = Literal["full", "plain"]
Level = Literal["none", "default", "strong"]


def stream(seed: int, *names: str) -> np.random.Generator:
    """Return the random generator of one named thing under one seed, so that changing one leaves the others alone.

    A log with a hidden effect and the log without it then share parameters, movements and sensor noise:
    their difference is the effect and nothing else.

    Args:
        seed: integer, 0 or above.
        names: what is drawn, such as ``"protocol", "fit1"``.

    Raises:
        ValueError: the seed is negative.
    """
    if seed < 0:
        raise ValueError(f"seed: found {seed}; expected an integer, 0 or above")
    return np.random.default_rng([seed, *(crc32(name.encode()) for name in names)])


def check_one_of(name: str, value: object, allowed: Collection[object], unit: str = "") -> None:
    """Refuse a value that is not among those allowed.

    Raises:
        ValueError: one line with the name, the value and all that is allowed.
    """
    if value not in allowed:
        numbers = isinstance(value, int | float)
        choices = ", ".join(f"{choice:g}" if numbers else str(choice) for choice in allowed)
        raise ValueError(f"{name}: found {f'{value:g}' if numbers else repr(value)}; expected one of {choices}{unit}")


def wandering(end: float, at: Array, deviation: float, count: int, rng: np.random.Generator) -> Array:
    """Return factors around 1 that wander slowly, of shape (times, count).

    Args:
        end: s, up to which they are drawn.
        at: s, where they are wanted.
        deviation: standard deviation.
        count: how many, each on its own.
        rng: what they are drawn from.
    """
    knots = np.arange(0.0, end + 2 * KNOT, KNOT)
    factors = rng.normal(1, deviation, (count, len(knots))).clip(0.5, 1.5)
    return np.column_stack([np.interp(at, knots, one) for one in factors])


# --- nodes and links -----------------------------------------------------------------------------------------------

LEGS = ("FR", "FL", "RR", "RL")
PARTS = ("hip", "thigh", "calf")
PC = "pc"
TRUNK = "trunk"
CASE = "_case"  # ends the name of a housing apart from its winding


def edge(one: str, other: str) -> str:
    """Return the name of the edge between two nodes: ``"a~b"``, in alphabetical order."""
    return "~".join(sorted((one, other)))


@dataclass(frozen=True)
class RobotLayout:
    """A robot's nodes that have a sensor, those that are joints, classes of like joints, and the baseline's links."""

    nodes: tuple[str, ...]
    joints: tuple[str, ...]
    classes: tuple[str, ...]
    linked: frozenset[str]


def _joints(leg: str) -> tuple[str, ...]:
    return tuple(f"{leg}_{part}" for part in PARTS)


LEG_JOINTS = _joints("FR")
QUADRUPED_JOINTS = tuple(joint for leg in LEGS for joint in _joints(leg))
QUADRUPED_NODES = (*QUADRUPED_JOINTS, PC)

LAYOUTS = {
    "leg": RobotLayout(
        LEG_JOINTS, LEG_JOINTS, (), frozenset({edge("FR_hip", "FR_thigh"), edge("FR_thigh", "FR_calf")})
    ),
    "quadruped": RobotLayout(
        QUADRUPED_NODES,
        QUADRUPED_JOINTS,
        tuple(f"*_{part}" for part in PARTS),
        frozenset(
            [
                *(edge(*pair) for leg in LEGS for pair in combinations(_joints(leg), 2)),
                *(edge(f"{leg}_hip", PC) for leg in LEGS),
                edge("FL_hip", "FR_hip"),
                edge("RL_hip", "RR_hip"),
            ]
        ),
    ),
}

# --- the truth about a robot ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Mass:
    """A mass that no sensor sees, tied to one node, or to several alike.

    capacity: J/K. joint: index of the node. resistance: to each node, K/W. to_air: conductance to the ambient, W/K.
    heat: its own, W. also: indices of further nodes.
    """

    capacity: float
    joint: int
    resistance: float
    to_air: float = 0.0
    heat: float = 0.0
    also: tuple[int, ...] = ()

    @property
    def ends(self) -> list[int]:
        """The nodes that it is tied to."""
        return [self.joint, *self.also]


_OFF: Any = ()  # zero at each node


@dataclass
class Robot:
    """The truth about one robot. Arrays have one entry a node, in the order of ``nodes``.

    The first six fields are the baseline. All below is zero there: it is what richer physics and hidden effects set.
    """

    nodes: tuple[str, ...]  # joints first, then other nodes with a sensor, then nodes without one
    capacity: Array  # J/K
    to_air: Array  # conductance to the ambient, W/K
    links: list[tuple[int, int, float]]  # (node, node, conductance in W/K)
    resistance: Array  # winding resistance at 25 degC, ohm; 0 where there is no motor
    torque_constant: Array  # torque at the joint per ampere at 25 degC, N·m/A; 1 where there is no motor

    joints: int = -1  # how many of the nodes are joints; -1 for all
    sensed: int = -1  # how many of the nodes have a sensor; -1 for all
    drive: Array = _OFF  # W, while the joint is powered
    # J/K of a winding apart from the node, which then is the housing: it makes the copper's heat and has the sensor;
    # 0 where winding and housing are one
    winding: Array = _OFF
    inside: Array = _OFF  # K/W between winding and housing
    resistance_rise: Array = _OFF  # 1/K
    torque_constant_drop: Array = _OFF  # 1/K
    natural_convection: Array = _OFF  # 1/K, in exp(beta (T - ambient))
    forced_convection: Array = _OFF  # s/m, in 1 + gamma |v|^exponent
    wind_exponent: float = 1.0
    emissive_area: Array = _OFF  # emissivity × area, m²
    coulomb: Array = _OFF  # N·m
    viscous: Array = _OFF  # N·m·s
    iron: Array = _OFF  # W/(rad/s)^1.5
    gear: Array = _OFF  # share of the mechanical power |τ ω|
    driver: Array = _OFF  # W/(N·m), on |τ|
    computer: Array = _OFF  # share of the computer's power that comes beside what its own node gets
    battery: Array = _OFF  # share of the battery's power
    sunlit: Array = _OFF  # absorptivity × area towards the sun, m²
    fanned: Array = _OFF  # in 1 + gamma × the fan's share of its full speed
    constant: Array = _OFF  # W
    masses: list[Mass] = field(default_factory=list)
    lag: Array = _OFF  # time constant of the sensor, s
    offset: Array = _OFF  # K, on the reading
    drift: Array = _OFF  # K/s, on the reading, from each run's beginning
    hot_spot: Array = _OFF  # K/W of copper loss, on the reading
    # (node, other, share of the other in the node's reading); the other is -1 for the node's own housing
    positions: list[tuple[int, int, float]] = field(default_factory=list)
    clock: float = 0.0  # s by which the temperatures in the rows are old
    ambient_offset: float = 0.0  # K, of the true ambient above the logged one
    ambient_lag: float = 0.0  # time constant with which the true ambient follows the logged one, s
    ambient_swing: float = 0.0  # K by which the logged ambient changes out of doors, in runs that don't say
    bursts: Array = _OFF  # W, while a burst lasts
    step: Array = _OFF  # K, on the reading after the step
    splash: Array = _OFF  # J taken away by each splash
    # (run, what sets an effect in the robot of that run)
    single_run: list[tuple[str, Callable[[Robot], None]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        count = len(self.nodes)
        self.joints = count if self.joints < 0 else self.joints
        self.sensed = count if self.sensed < 0 else self.sensed
        for one in fields(self):
            if getattr(self, one.name) is _OFF:
                setattr(self, one.name, np.zeros(count))

    def in_run(self, run: str) -> Robot:
        """Return the robot as it is in this run: a copy with what acts in it alone."""
        own = copy.deepcopy(replace(self, single_run=[]))
        for name, set_in in self.single_run:
            if name == run:
                set_in(own)
        return own

    def check_runs(self, runs: Collection[str]) -> None:
        """Refuse an effect in a run that there isn't.

        Raises:
            ValueError: it acts in a run that is not among these.
        """
        for name, _ in self.single_run:
            check_one_of("run", name, runs)


# --- both robots' motors -------------------------------------------------------------------------------------------

GEAR = 9.1
MOTOR_CONSTANT = 0.0927  # N·m/A
WINDING_RESISTANCE = 0.15  # ohm
PC_IDLE, PC_BUSY = 16.0, 26.0  # W, of the computer: at rest, and while the robot walks

# --- the leg -------------------------------------------------------------------------------------------------------

LEG_CAPACITY = (300.0, 290.0, 290.0)  # J/K, hip, thigh, calf
LEG_TO_AIR = (13.0, 11.0, 10.0)  # K/W
LEG_LINKS = ((0, 1, 2.0), (1, 2, 1.6))  # K/W, hip~thigh, thigh~calf


def draw_leg(seed: int, scatter: float) -> Robot:
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

    def scattered(values: Sequence[float]) -> Array:
        return np.asarray(values) * (1 + scatter * rng.uniform(-1, 1, len(values)))

    capacity, to_air = scattered(LEG_CAPACITY), 1 / scattered(LEG_TO_AIR)
    between = 1 / scattered([resistance for _, _, resistance in LEG_LINKS])
    return Robot(
        nodes=LEG_JOINTS,
        capacity=capacity,
        to_air=to_air,
        links=[(i, j, float(g)) for (i, j, _), g in zip(LEG_LINKS, between, strict=True)],
        resistance=scattered((WINDING_RESISTANCE,) * len(LEG_JOINTS)),
        torque_constant=scattered((GEAR * MOTOR_CONSTANT,) * len(LEG_JOINTS)),
    )


# --- the quadruped -------------------------------------------------------------------------------------------------

HIPS = [len(PARTS) * leg for leg in range(len(LEGS))]

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
TRUNK_CAPACITY, TRUNK_TO_AIR, TRUNK_FORCED, BATTERY = 2600.0, 1.4, 0.25, 12.0  # J/K, K/W, s/m, W
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
    check_one_of("physics", physics, get_args(Physics))
    if not 0 <= scatter <= 2:
        raise ValueError(f"scatter: found {scatter:g}; expected 0 to 2")

    def drawn(name: str, kind: str, values: Sequence[float]) -> Array:
        # A stream for each parameter: both physics share what they have in common.
        deviations = stream(seed, "quadruped", name).standard_normal(len(values)).clip(-FARTHEST, FARTHEST)
        return np.asarray(values) * (1 + scatter * SPREAD[kind] * deviations)

    joints, legs = len(QUADRUPED_JOINTS), len(LEGS)
    plain = physics == "plain"
    housing, winding = drawn("housing", "mass", HOUSING * legs), drawn("winding", "mass", (WINDING,) * joints)
    pc = float(drawn("pc", "mass", (PC_CAPACITY,))[0])
    to_air = (*PLAIN_TO_AIR * legs, PLAIN_PC_TO_AIR) if plain else (*TO_AIR * legs, PC_TO_AIR)
    pairs = [pair for hip in HIPS for pair in ((hip, hip + 1), (hip + 1, hip + 2), (hip + 2, hip))]
    pairs += [(HIPS[0], HIPS[1]), (HIPS[2], HIPS[3])]
    between = [*drawn("along", "link", ALONG * legs), *drawn("across", "link", (ACROSS,) * 2)]
    robot = Robot(
        nodes=QUADRUPED_NODES,
        capacity=np.append(housing + winding if plain else housing, pc),
        to_air=1 / drawn("air", "air", to_air),
        links=[(i, j, float(1 / r)) for (i, j), r in zip(pairs, between, strict=True)],
        resistance=np.append(drawn("resistance", "resistance", (WINDING_RESISTANCE,) * joints), 0.0),
        torque_constant=np.array([GEAR * MOTOR_CONSTANT] * joints + [1.0]),
        joints=joints,
        drive=np.array([DRIVE] * joints + [0.0]),
    )
    if plain:
        to_pc = drawn("body", "link", (PLAIN_HIP_TO_PC,) * legs)
        robot.links += [(hip, joints, float(1 / r)) for hip, r in zip(HIPS, to_pc, strict=True)]
        return robot
    robot.winding[:joints] = winding
    robot.inside[:joints] = drawn("inside", "inside", (INSIDE,) * joints)
    robot.coulomb[:joints] = drawn("coulomb", "friction", (COULOMB,) * joints)
    # Eddy currents go with ω², as viscous friction does.
    robot.viscous[:joints] = drawn("viscous", "friction", (VISCOUS,) * joints) + EDDY
    robot.resistance_rise[:joints] = RISE
    robot.natural_convection[:joints] = NATURAL
    robot.forced_convection[:joints] = FORCED
    robot.emissive_area[:joints] = EMISSIVE_AREA
    return _with_trunk(robot, drawn("body", "link", (TO_TRUNK,) * (legs + 1)))


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


def draw_run_errors(robot: Robot, level: Level, seed: int, run: str) -> tuple[Robot, float]:
    """Draw what differs from run to run and no sensor shows.

    Returns:
        The robot of this run, and what the true ambient has above the measured one, K.

    Raises:
        ValueError: unknown level.
    """
    check_one_of("level", level, LEVELS)
    ambient, air, battery = np.array(LEVELS[level]) * stream(seed, "errors", run).standard_normal(3).clip(
        -FARTHEST, FARTHEST
    )
    constant, to_air = robot.constant.copy(), robot.to_air.copy()
    to_air[: robot.joints] *= np.exp(air)
    if TRUNK in robot.nodes:
        constant[robot.nodes.index(TRUNK)] *= 1 + battery
    return replace(robot, to_air=to_air, constant=constant), float(ambient)
