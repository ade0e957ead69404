"""Terminals of FMI 3: the variables of each place, joined, so that a tool connects them at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .variables import Variable, first_place


@dataclass(frozen=True)
class Terminal:
    """One terminal.

    Args:
        name: the place, as the variables' names begin.
        kind: `lptn.joint` for one that is driven, `lptn.temperature` for a surrounding whose temperature is given,
            `lptn.place` for any other.
        description: what a person reads of it.
        members: member name and variable, in order: the rest of the variable's name, such as `torque`.
    """

    name: str
    kind: str
    description: str
    members: tuple[tuple[str, Variable], ...]


_KINDS = {
    "lptn.joint": "Joint {}: load and speed in, temperature, heat flows and the limiter's share out",
    "lptn.temperature": "Surroundings {}: their temperature in",
    "lptn.place": "{}: what warms or cools it in, temperature and heat flows out",
}


def terminals(variables: Sequence[Variable]) -> list[Terminal]:
    """One terminal for each place that has inputs or outputs."""
    places: dict[str, list[tuple[str, Variable]]] = {}
    for variable in variables:
        if variable.causality in ("input", "output"):
            place, member = first_place(variable.name)
            if member:
                places.setdefault(place, []).append((member, variable))
    joined = []
    for place, members in places.items():
        entrances = {name for name, variable in members if variable.kind == "input"}
        alone = entrances == {"temperature"} and len(members) == 1
        kind = "lptn.joint" if entrances & {"torque", "current"} else "lptn.temperature" if alone else "lptn.place"
        joined.append(Terminal(place, kind, _KINDS[kind].format(place), tuple(members)))
    return joined
