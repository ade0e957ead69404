"""Say what an entry of the catalogue of hidden effects is, and how one is entered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

JOINT, NODE, EDGE, LINKED, CLASS, AMBIENT, WHOLE = "joint", "node", "edge", "linked", "class", "ambient", "whole"


@dataclass(frozen=True)
class Effect:
    """How to set one effect, and where it can stand.

    set: function of the robot, of what the kind says, and of the size. kind: "joint" or "node" (anything with a
    sensor), one index a call; "edge" (two nodes that the baseline doesn't link) or "linked" (two that it links, in
    either order), two indices; "class", the indices of all its nodes; "ambient" or "whole", no index.
    beyond: nothing a diagnosis has a name for. signed: the size may be negative. single: may act in one run only.
    """

    set: Callable[..., None]
    kind: str
    beyond: bool = False
    signed: bool = False
    single: bool = False


Catalogue = dict[str, Effect]
Setter = Callable[..., None]


def entry(
    catalogue: Catalogue, kind: str, *, beyond: bool = False, signed: bool = False, single: bool = False
) -> Callable[[Setter], Setter]:
    """Enter the function below into this catalogue, under its own name; see ``Effect``."""

    def keep(setter: Setter) -> Setter:
        catalogue[setter.__name__] = Effect(setter, kind, beyond, signed, single)
        return setter

    return keep


def limited(effect: str, size: float, largest: float, where: str) -> None:
    """Refuse a size that physics has no room for.

    Raises:
        ValueError: the size is above the largest.
    """
    if size > largest:
        raise ValueError(f"size of {effect}: found {size:g}; expected at most {largest:.2f} at {where}")


def scaled(effect: str, size: float, step: float) -> float:
    """Return the factor 1 + step × size.

    Raises:
        ValueError: less than a tenth would be left.
    """
    if 1 + step * size < 0.1:
        raise ValueError(f"size of {effect}: found {size:g}; expected {-0.9 / step:.2f} or above")
    return 1 + step * size
