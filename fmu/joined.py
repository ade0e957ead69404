"""Variables of FMI 3 joined: one quantity at several places as an array, all of one place as a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from .codegen import Dependent, Structure
from .variables import Variable, first_place

_KNOWN = ("order", "dependent", "tunable", "constant")  # from the least to the most that is known of a dependency


# --- arrays: the torques of twelve joints as one variable ------------------------------------------


def arrays(variables: Sequence[Variable]) -> list[Variable]:
    """The arrays that variables form, with value references behind those of all variables.

    What has the same kind, quantity, unit and range at two or more places is one array, in the network's order of
    places, which the states have; hidden states and what stands at one place alone stay scalar. No two arrays get the
    same name: states come first.
    """
    groups: dict[tuple[str, tuple[object, ...]], list[Variable]] = {}
    states = {variable.reference: variable for variable in variables if variable.kind == "state"}
    order = {place: number for number, place in enumerate(dict.fromkeys(places_of(states.values())))}
    for variable in variables:
        source = states[variable.of] if variable.of is not None else variable
        _, member = first_place(source.name)
        if not member or source.kind in ("time", "clock") or (source.kind == "state" and source.hidden):
            continue
        name = f"der({member})" if variable.kind == "rate" else member
        alike = (variable.kind, variable.unit, variable.minimum, variable.maximum, variable.hidden)
        groups.setdefault((name, alike), []).append(variable)
    taken = {variable.name for variable in variables}
    made: list[Variable] = []
    for (name, _), elements in groups.items():
        if len(elements) > 1 and name not in taken:
            taken.add(name)
            elements.sort(key=lambda element: order.get(places_of([element])[0], len(order)))
            made.append(_joined(name, len(variables) + len(made), elements, made))
    return made


def _joined(name: str, reference: int, elements: Sequence[Variable], made: Sequence[Variable]) -> Variable:
    first = elements[0]
    places = ", ".join(places_of(elements))
    state = next((array.reference for array in made if first.of in {one.reference for one in array.elements}), first.of)
    text = first.description.replace(places_of(elements[:1])[0], "each place")
    return replace(
        first,
        name=name,
        reference=reference,
        start=None,
        description=f"{text}, in this order: {places}",
        of=state,
        elements=tuple(elements),
    )


def places_of(elements: Iterable[Variable]) -> list[str]:
    """The place of each element of an array, as it stands in the element's name."""
    return [first_place(element.name.removeprefix("der("))[0] for element in elements]


def shown(variables: Sequence[Variable], joined: Sequence[Variable]) -> list[Variable]:
    """The variables as an importer sees them: each array where its first element stood."""
    arrays_by_first = {array.elements[0].reference: array for array in joined}
    inside = {element.reference for array in joined for element in array.elements}
    return [
        arrays_by_first.get(variable.reference, variable)
        for variable in variables
        if variable.reference in arrays_by_first or variable.reference not in inside
    ]


def structure_of_arrays(structure: Structure, joined: Sequence[Variable]) -> Structure:
    """The dependencies of arrays: those of all their elements, each the weakest that is known of any."""
    array_of = {element.reference: array for array in joined for element in array.elements}
    return Structure(*(_merged(entries, array_of) for entries in vars(structure).values()))


def _merged(entries: Iterable[Dependent], array_of: Mapping[int, Variable]) -> tuple[Dependent, ...]:
    merged: dict[int, tuple[Variable, dict[int, str]]] = {}
    for entry in entries:
        variable = array_of.get(entry.variable.reference, entry.variable)
        _, kinds = merged.setdefault(variable.reference, (variable, {}))
        for reference, kind in zip(entry.dependencies, entry.kinds, strict=True):
            source = array_of[reference].reference if reference in array_of else reference
            kinds[source] = min(kinds.get(source, kind), kind, key=_KNOWN.index)
    return tuple(
        Dependent(variable, tuple(sorted(kinds)), tuple(kinds[dependency] for dependency in sorted(kinds)))
        for variable, kinds in merged.values()
    )


# --- terminals: what a tool connects at once -------------------------------------------------------


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


_TERMINALS = {
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
        joined.append(Terminal(place, kind, _TERMINALS[kind].format(place), tuple(members)))
    return joined
