"""Name the hidden effects and their places."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

from .catalogue import EFFECTS
from .layouts import CASE, LAYOUTS
from .registry import AMBIENT, CLASS, EDGE, JOINT, LINKED, WHOLE, Effect
from .robot import Robot

__all__ = ["BEYOND", "EFFECTS", "SINGLE", "Hidden", "places"]

EVERYWHERE = "*"
BEYOND = tuple(name for name, effect in EFFECTS.items() if effect.beyond)
SINGLE = tuple(name for name, effect in EFFECTS.items() if effect.single)
FEW = 30  # places that a message lists


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
        if self.effect not in EFFECTS:
            raise ValueError(f"effect: found {self.effect!r}; expected one of {', '.join(EFFECTS)}")
        known, effect = places(self.effect, self.robot), EFFECTS[self.effect]
        if self.at not in (*known, *_cases(effect, self.robot)):
            raise ValueError(f"place of {self.effect}: found {self.at!r}; expected {_allowed(effect, known)}")
        if not (math.isfinite(self.size) and (self.size >= 0 or effect.signed)):
            allowed = "a finite number" + ", 0 or above" * (not effect.signed)
            raise ValueError(f"size of {self.effect}: found {self.size:g}; expected {allowed}")
        if self.run and not effect.single:
            few = ", ".join(SINGLE)
            raise ValueError(f"run of {self.effect}: found {self.run!r}; expected none, which only {few} may have")

    def set_in(self, robot: Robot) -> None:
        """Set the effect in this robot, in place; one of a single run waits for ``Robot.in_run``.

        Raises:
            ValueError: a size or a place that this robot has no room for.
        """
        if self.run:
            robot.later.append((self.run, replace(self, run="").set_in))
            return
        effect = EFFECTS[self.effect]
        if effect.kind in (AMBIENT, WHOLE):
            effect.set(robot, self.size)
        elif effect.kind == EDGE:
            effect.set(robot, *sorted(robot.nodes.index(end) for end in self.at.split("~")), self.size)
        elif effect.kind == LINKED:
            one, other = self.at.split("~")
            effect.set(
                robot, robot.nodes.index(one), -1 if other.endswith(CASE) else robot.nodes.index(other), self.size
            )
        else:
            self._set_at_nodes(effect, robot)

    def _set_at_nodes(self, effect: Effect, robot: Robot) -> None:
        count = robot.joints if effect.kind == JOINT else robot.sensed
        found = [i for i, node in enumerate(robot.nodes[:count]) if fnmatchcase(node, self.at)]
        if effect.kind == CLASS:
            effect.set(robot, found, self.size)
            return
        for i in found:
            effect.set(robot, i, self.size)


def places(effect: str, robot: str = "leg") -> tuple[str, ...]:
    """Return the places where this effect may be put: nodes, classes and ``"*"``, edges, or ``"ambient"``.

    Edges that the baseline lacks are in alphabetical order; those that it has come in both orders.

    Raises:
        ValueError: unknown robot.
    """
    if robot not in LAYOUTS:
        raise ValueError(f"robot: found {robot!r}; expected one of {', '.join(LAYOUTS)}")
    layout, kind = LAYOUTS[robot], EFFECTS[effect].kind
    known = {
        EDGE: layout.unlinked,
        LINKED: layout.either_way,
        CLASS: (*layout.classes, EVERYWHERE),
        AMBIENT: (AMBIENT,),
        WHOLE: (EVERYWHERE,),
    }
    alone = layout.joints if kind == JOINT else layout.nodes
    return known.get(kind, (*alone, *layout.classes, EVERYWHERE))


def _cases(effect: Effect, robot: str) -> tuple[str, ...]:
    """Return the places that only full physics has."""
    wound = effect.kind == LINKED and robot == "quadruped"
    return tuple(f"{joint}~{joint}{CASE}" for joint in LAYOUTS[robot].joints) if wound else ()


def _allowed(effect: Effect, known: tuple[str, ...]) -> str:
    if len(known) < FEW:
        return f"one of {', '.join(known)}"
    return f"an edge such as {known[-1]}, " + ("not yet linked" if effect.kind == EDGE else "linked")
