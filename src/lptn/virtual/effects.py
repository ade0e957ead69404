"""The hidden effects: what the truth has and the baseline lacks, and where each can stand.

To add one: a field in ``Robot`` where it is kept (zero when off); its physics in ``heat`` (the balance of heat),
``surroundings`` (the ambient, random events) or ``sensors`` (what they show); and a line in ``EFFECTS``.
Strengths were chosen by simulating: the effect at one joint moves some temperature by about 1 to 5 K at most.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from itertools import combinations
from typing import Literal

from .robot import CASE, LAYOUTS, Mass, Robot, check_one_of, edge

JOINT, NODE, EDGE, LINKED, CLASS, AMBIENT, WHOLE = "joint", "node", "edge", "linked", "class", "ambient", "whole"
EVERYWHERE = "*"
LISTED_PLACES = 30  # how many a message lists; of more it gives an example

Columns = Literal["asked", "all"]
# By the field of the robot that makes the column wanted. A log of signed samples has the first two in its samples.
_COLUMNS = {
    "driver": "torque_abs",
    "gear": "mechanical_power",
    "computer": "power.pc",
    "battery": "power.battery",
    "fanned": "speed.fan",
    "sunlit": "irradiance.global",
}


@dataclass(frozen=True)
class HiddenEffect:
    """How to set one effect, and where it can stand.

    set: function of the robot, of what the kind says, and of the size; changes the robot in place. kind: "joint" or
    "node" (anything with a sensor), one index a call; "edge" (two nodes that the baseline doesn't link) or "linked"
    (two that it links, in either order), two indices; "class", the indices of all its nodes; "ambient" or "whole", no
    index. beyond: nothing a diagnosis has a name for. signed: the size may be negative. single: may act in one run
    only.
    """

    set: Callable[..., None]
    kind: str
    beyond: bool = False
    signed: bool = False
    single: bool = False


def _added(field: str, strength: float) -> Callable[..., None]:
    """Return what adds strength × size to the node's entry in this field of the robot."""

    def add(robot: Robot, node: int, size: float) -> None:
        getattr(robot, field)[node] += strength * size

    return add


def _check_size(effect: str, size: float, largest: float, where: str) -> None:
    if size > largest:
        raise ValueError(f"size of {effect}: found {size:g}; expected at most {largest:.2f} at {where}")


def _scaled(effect: str, field: str, strength: float, power: float = 1.0) -> Callable[..., None]:
    """Return what multiplies the node's entry in this field by a power of 1 + strength × size."""

    def scale(robot: Robot, node: int, size: float) -> None:
        if 1 + strength * size < 0.1:
            raise ValueError(f"size of {effect}: found {size:g}; expected {-0.9 / strength:.2f} or above")
        getattr(robot, field)[node] *= (1 + strength * size) ** power

    return scale


def _raised(field: str, strength: float) -> Callable[..., None]:
    """Return what adds strength × size to this number of the robot."""
    return lambda robot, size: setattr(robot, field, getattr(robot, field) + strength * size)


def _conduction(robot: Robot, one: int, other: int, size: float) -> None:
    """A link of 3 K/W; the size multiplies its conductance."""
    robot.links.append((one, other, size / 3.0))


def _second_mass(robot: Robot, node: int, size: float) -> None:
    """120 J/K of the node move to an inner mass behind 1.5 K/W, neither measured nor heated."""
    inner = 120.0 * size
    _check_size("second_mass", size, 0.9 * robot.capacity[node] / 120.0, robot.nodes[node])
    if inner > 0:
        robot.capacity[node] -= inner
        robot.masses.append(Mass(inner, node, resistance=1.5))


def _shared_mass(robot: Robot, nodes: list[int], size: float) -> None:
    """One frame that no sensor sees, tied to each of the nodes by 17 K/W; for each, it has 120 J/K and 42 K/W to air.

    The size multiplies its conductances and its capacity.
    """
    if size > 0:
        share = size * len(nodes)
        robot.masses.append(Mass(120.0 * share, nodes[0], 17.0 / size, share / 42.0, also=tuple(nodes[1:])))


def _sensor_position(robot: Robot, one: int, other: int, size: float) -> None:
    """The reading of "one~other" is 0.8 of the one's temperature and 0.2 of the other's."""
    _check_size("sensor_position", size, 5.0, robot.nodes[one])
    if other < 0 and not robot.winding[one]:
        raise ValueError(
            f"place of sensor_position: found the case of {robot.nodes[one]}; expected full physics for it"
        )
    robot.positions.append((one, other, 0.2 * size))


def _ambient_lag(robot: Robot, size: float) -> None:
    """The true ambient follows the logged one as a first-order lag of 1200 s (walls, the body's own air).

    The robot goes out of doors and in again, 8 K apart unless the run says how far.
    """
    if size > 0:
        robot.ambient_lag += 1200.0 * size
        robot.ambient_swing = 8.0


EFFECTS: dict[str, HiddenEffect] = {
    # Copper: the winding's resistance × (1 + 0.00393 (T - 25)) [QuadrupedLPTN, eq. 6].
    "resistance_rise": HiddenEffect(_added("resistance_rise", 0.00393), JOINT),
    # Magnets: the torque constant × (1 - 0.0012 (T - 25)).
    "torque_constant_drop": HiddenEffect(_added("torque_constant_drop", 0.0012), JOINT),
    # Wrong torque constant: the copper loss is 1.2 times what torque, data sheet and resistance say.
    "loss_scale": HiddenEffect(_scaled("loss_scale", "torque_constant", 0.2, -0.5), JOINT, signed=True, single=True),
    # Heat 0.5 |ω|: 0.5 N·m at the joint; heat 0.07 ω²: 0.07 N·m·s ([QuadrupedLPTN, eq. 8], as power); heat 0.2 |ω|^1.5.
    "coulomb_friction": HiddenEffect(_added("coulomb", 0.5), JOINT),
    "viscous_friction": HiddenEffect(_added("viscous", 0.07), JOINT),
    "iron_loss": HiddenEffect(_added("iron", 0.2), JOINT),
    # Heat 0.1 |τ ω|: a tenth of the mechanical power.
    "gear_loss": HiddenEffect(_added("gear", 0.1), JOINT),
    # Heat 0.5 |τ|, in W and N·m: transistors with a constant voltage, current going with torque.
    "driver_loss": HiddenEffect(_added("driver", 0.5), JOINT),
    # Heat of 1.5 W, always on.
    "constant_heat": HiddenEffect(_added("constant", 1.5), NODE, single=True),
    # 0.1 times the computer's logged power, beside what its own node gets; 0.01 times what the battery gives.
    "computer_heat": HiddenEffect(_added("computer", 0.1), JOINT),
    "battery_heat": HiddenEffect(_added("battery", 0.01), NODE),
    # The sun on 0.005 m², clouds coming and going.
    "solar": HiddenEffect(_added("sunlit", 0.005), NODE),
    # Conductance to air × exp(0.006 (T - ambient)); × (1 + 0.55 |v|), v the base's speed in m/s [QuadrupedLPTN, eq. 3];
    # × (1 + 0.5 s), s the logged share of a fan's full speed.
    "natural_convection": HiddenEffect(_added("natural_convection", 0.006), NODE),
    "forced_convection": HiddenEffect(_added("forced_convection", 0.55), NODE),
    "fan": HiddenEffect(_added("fanned", 0.5), NODE),
    # Conductance to air × 1.3: a fan that no log has, a cover taken off.
    "surface_scale": HiddenEffect(_scaled("surface_scale", "to_air", 0.3), NODE, signed=True, single=True),
    "conduction": HiddenEffect(_conduction, EDGE),
    "second_mass": HiddenEffect(_second_mass, NODE),
    "shared_mass": HiddenEffect(_shared_mass, CLASS),
    # Loss σ εA (T⁴ - ambient⁴), in kelvin, with an emissivity × area of 0.008 m².
    "radiation": HiddenEffect(_added("emissive_area", 0.008), NODE),
    # The reading follows the node as a first-order lag of 20 s; is 2 K too high; rises by 4 K in an hour, from the true
    # one at each run's beginning.
    "sensor_lag": HiddenEffect(_added("lag", 20.0), NODE),
    "sensor_offset": HiddenEffect(_added("offset", 2.0), NODE, signed=True, single=True),
    "sensor_drift": HiddenEffect(_added("drift", 4.0 / 3600), NODE, signed=True, single=True),
    "sensor_position": HiddenEffect(_sensor_position, LINKED),
    # The sensor sits in the winding, 0.12 K/W of its copper loss above the rest, 3 s behind that loss.
    "hot_spot": HiddenEffect(_added("hot_spot", 0.12), JOINT),
    # The true ambient is 2.5 K above the logged one.
    "ambient_offset": HiddenEffect(_raised("ambient_offset", 2.5), AMBIENT, signed=True, single=True),
    "ambient_lag": HiddenEffect(_ambient_lag, AMBIENT),
    # The temperatures' clock is wrong: what their rows show was so 30 s before the row's time.
    "clock_offset": HiddenEffect(_raised("clock", 30.0), WHOLE, signed=True, single=True),
    # Bursts of 6 W, each 1 to 3 min, at random times.
    "heat_bursts": HiddenEffect(_added("bursts", 6.0), NODE, beyond=True),
    # The reading jumps up by 3 K at a random time of each run; the next run starts without it.
    "sensor_step": HiddenEffect(_added("step", 3.0), NODE, beyond=True),
    # 400 J are taken away within a second, at random times.
    "splash": HiddenEffect(_added("splash", 400.0), NODE, beyond=True),
}
BEYOND = tuple(name for name, effect in EFFECTS.items() if effect.beyond)
SINGLE = tuple(name for name, effect in EFFECTS.items() if effect.single)


def places(effect: str, robot: str = "leg") -> tuple[str, ...]:
    """Return the places where this effect may be put: nodes, classes and ``"*"``, edges, or ``"ambient"``.

    Edges that the baseline lacks are in alphabetical order; those that it has come in both orders.

    Raises:
        ValueError: unknown robot.
    """
    check_one_of("robot", robot, LAYOUTS)
    layout, kind = LAYOUTS[robot], EFFECTS[effect].kind
    edges = (edge(*pair) for pair in combinations(layout.nodes, 2))
    linked = sorted(tuple(name.split("~")) for name in layout.linked)
    by_kind = {
        JOINT: (*layout.joints, *layout.classes, EVERYWHERE),
        NODE: (*layout.nodes, *layout.classes, EVERYWHERE),
        EDGE: tuple(name for name in edges if name not in layout.linked),
        LINKED: tuple(name for one, other in linked for name in (f"{one}~{other}", f"{other}~{one}")),
        CLASS: (*layout.classes, EVERYWHERE),
        AMBIENT: (AMBIENT,),
        WHOLE: (EVERYWHERE,),
    }
    return by_kind[kind]


@dataclass(frozen=True)
class Hidden:
    """One effect that the truth has and the baseline lacks.

    Args:
        effect: a key of ``EFFECTS``.
        at: a node, a class such as ``"*_calf"`` (the quadruped), or ``"*"`` for all nodes where the effect can stand;
            for ``conduction`` an edge that the baseline lacks, ``"FR_calf~FR_hip"`` in the leg; for ``sensor_position``
            the sensor's node and one that the baseline links it to, or on the full quadruped a joint and its case,
            ``"FR_calf~FR_calf_case"``; for the errors of the ambient ``"ambient"``.
        size: multiplies the default strength; 0 switches the effect off; below 0 only where either sign makes sense.
        robot: "leg" or "quadruped".
        run: the run in which alone it acts, for an effect of ``SINGLE``; "" for all runs.

    Raises:
        ValueError: unknown effect, place or robot, a size that is not finite or can't be negative, or an effect that
            can't act in one run alone.
    """

    effect: str
    at: str
    size: float = 1.0
    robot: str = "leg"
    run: str = ""

    def __post_init__(self) -> None:
        check_one_of("effect", self.effect, EFFECTS)
        allowed, effect = places(self.effect, self.robot), EFFECTS[self.effect]
        cased = effect.kind == LINKED and self.robot == "quadruped"  # only full physics has cases
        cases = [f"{joint}~{joint}{CASE}" for joint in LAYOUTS[self.robot].joints] if cased else []
        if self.at not in (*allowed, *cases):
            expected = f"one of {', '.join(allowed)}"
            if len(allowed) >= LISTED_PLACES:
                expected = f"an edge such as {allowed[-1]}, " + ("not yet linked" if effect.kind == EDGE else "linked")
            raise ValueError(f"place of {self.effect}: found {self.at!r}; expected {expected}")
        if not (math.isfinite(self.size) and (self.size >= 0 or effect.signed)):
            expected = "a finite number" + ", 0 or above" * (not effect.signed)
            raise ValueError(f"size of {self.effect}: found {self.size:g}; expected {expected}")
        if self.run and not effect.single:
            few = ", ".join(SINGLE)
            raise ValueError(f"run of {self.effect}: found {self.run!r}; expected none, which only {few} may have")

    def set_in(self, robot: Robot) -> None:
        """Set the effect in this robot, in place; one of a single run waits for ``Robot.in_run``.

        Raises:
            ValueError: a size or a place that this robot has no room for.
        """
        if self.run:
            robot.single_run.append((self.run, replace(self, run="").set_in))
            return
        effect, index = EFFECTS[self.effect], robot.nodes.index
        count = robot.joints if effect.kind == JOINT else robot.sensed
        nodes = [i for i, node in enumerate(robot.nodes[:count]) if fnmatchcase(node, self.at)]
        if effect.kind in (AMBIENT, WHOLE):
            effect.set(robot, self.size)
        elif effect.kind == EDGE:
            effect.set(robot, *sorted(index(end) for end in self.at.split("~")), self.size)
        elif effect.kind == LINKED:
            one, other = self.at.split("~")
            effect.set(robot, index(one), -1 if other.endswith(CASE) else index(other), self.size)
        elif effect.kind == CLASS:
            effect.set(robot, nodes, self.size)
        else:
            for i in nodes:
                effect.set(robot, i, self.size)


def extra_columns(robot: Robot, columns: Columns) -> tuple[str, ...]:
    """Return the columns beyond the usual ones: those that drive this robot's effects, or all that there are."""
    return tuple(column for field, column in _COLUMNS.items() if columns == "all" or getattr(robot, field).any())
