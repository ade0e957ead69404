"""Name the nodes and the links of each virtual robot: where an effect can stand."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

LEGS = ("FR", "FL", "RR", "RL")
PARTS = ("hip", "thigh", "calf")
PC = "pc"
CASE = "_case"  # ends the name of a housing apart from its winding


def edge(one: str, other: str) -> str:
    """Return the name of the edge between two nodes: ``"a~b"``, in alphabetical order."""
    return "~".join(sorted((one, other)))


@dataclass(frozen=True)
class Layout:
    """A robot's nodes that have a sensor, those that are joints, classes of like joints, and the baseline's links."""

    nodes: tuple[str, ...]
    joints: tuple[str, ...]
    classes: tuple[str, ...]
    linked: frozenset[str]

    @property
    def unlinked(self) -> tuple[str, ...]:
        """The edges that the baseline lacks."""
        edges = (edge(*pair) for pair in combinations(self.nodes, 2))
        return tuple(name for name in edges if name not in self.linked)

    @property
    def either_way(self) -> tuple[str, ...]:
        """The edges that the baseline has, from either end."""
        pairs = sorted(tuple(name.split("~")) for name in self.linked)
        return tuple(name for one, other in pairs for name in (f"{one}~{other}", f"{other}~{one}"))


def _leg(side: str, *, closed: bool) -> list[str]:
    hip, thigh, calf = (f"{side}_{part}" for part in PARTS)
    return [edge(hip, thigh), edge(thigh, calf)] + [edge(calf, hip)] * closed


_FR = tuple(f"FR_{part}" for part in PARTS)
_ALL = tuple(f"{leg}_{part}" for leg in LEGS for part in PARTS)
_BODY = [edge("FL_hip", "FR_hip"), edge("RL_hip", "RR_hip"), *(edge(f"{leg}_hip", PC) for leg in LEGS)]

LAYOUTS = {
    "leg": Layout(_FR, _FR, (), frozenset(_leg("FR", closed=False))),
    "quadruped": Layout(
        (*_ALL, PC),
        _ALL,
        tuple(f"*_{part}" for part in PARTS),
        frozenset([*(name for leg in LEGS for name in _leg(leg, closed=True)), *_BODY]),
    ),
}
