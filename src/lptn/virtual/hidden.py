"""Name the hidden effects and their places."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fnmatch import fnmatchcase

from .catalogue import EDGE, EFFECTS, JOINT
from .layouts import LAYOUTS
from .robot import Robot

__all__ = ["BEYOND", "EFFECTS", "Hidden", "places"]

EVERYWHERE = "*"
BEYOND = tuple(name for name, effect in EFFECTS.items() if effect.beyond)
FEW = 30  # places that a message lists


@dataclass(frozen=True)
class Hidden:
    """One effect that the truth has and the baseline lacks.

    Args:
        effect: a key of ``EFFECTS``.
        at: a node, a class such as ``"*_calf"`` (the quadruped), or ``"*"`` for all nodes where the effect can stand;
            for ``conduction`` an edge that the baseline lacks, ``"FR_calf~FR_hip"`` in the leg.
        size: multiplies the default strength; 0 switches the effect off.
        robot: "leg" or "quadruped".

    Raises:
        ValueError: unknown effect, place or robot, or a size that is negative or not finite.
    """

    effect: str
    at: str
    size: float = 1.0
    robot: str = "leg"

    def __post_init__(self) -> None:
        if self.effect not in EFFECTS:
            raise ValueError(f"effect: found {self.effect!r}; expected one of {', '.join(EFFECTS)}")
        known = places(self.effect, self.robot)
        if self.at not in known:
            allowed = (
                f"one of {', '.join(known)}" if len(known) < FEW else f"an edge such as {known[-1]}, not yet linked"
            )
            raise ValueError(f"place of {self.effect}: found {self.at!r}; expected {allowed}")
        if not (math.isfinite(self.size) and self.size >= 0):
            raise ValueError(f"size of {self.effect}: found {self.size:g}; expected a finite number, 0 or above")

    def set_in(self, robot: Robot) -> None:
        """Set the effect in this robot, in place."""
        effect = EFFECTS[self.effect]
        if effect.kind == EDGE:
            effect.set(robot, *sorted(robot.nodes.index(end) for end in self.at.split("~")), self.size)
            return
        count = robot.joints if effect.kind == JOINT else robot.sensed
        for i, node in enumerate(robot.nodes[:count]):
            if fnmatchcase(node, self.at):
                effect.set(robot, i, self.size)


def places(effect: str, robot: str = "leg") -> tuple[str, ...]:
    """Return the places where this effect may be put: nodes, classes and ``"*"``, or edges in alphabetical order.

    Raises:
        ValueError: unknown robot.
    """
    if robot not in LAYOUTS:
        raise ValueError(f"robot: found {robot!r}; expected one of {', '.join(LAYOUTS)}")
    layout, kind = LAYOUTS[robot], EFFECTS[effect].kind
    if kind == EDGE:
        return layout.unlinked
    return (*(layout.joints if kind == JOINT else layout.nodes), *layout.classes, EVERYWHERE)
