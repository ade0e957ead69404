"""Nodes, links and effects: what a model file or a script declares, spread over the robot's places."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from lptn.bodies import Bodies, Conductor
from lptn.effects import Effect, LossEffect
from lptn.elements import Element
from lptn.errors import InputError
from lptn.parameters import Parameter, Unknown
from lptn.places import class_of, edge, expand_pair, is_glob, matching, mirrored

_NO_NAME = re.compile(r"[\s.~{}]|^$")
START = "start"
"""Prescribed temperature taken from the start of each run, for logs without an ambient column."""


@dataclass(frozen=True)
class NodeDeclaration:
    """Nodes of one kind: a capacitance, or a prescribed temperature.

    Args:
        pattern: a name, or a glob over the model's joints.
        capacity: heat capacity [J/K] of a dynamic node.
        temperature: for a prescribed node a log column (`"temperature.ambient"`), `"start"`, or a
            parameter [degC].
        element: for a dynamic node its body; links attach to the faces, `"stator.outer"`, and the node's
            temperature is the body's mean.
    """

    pattern: str
    capacity: Parameter | None = None
    temperature: str | Parameter | None = None
    element: Element | None = None


@dataclass(frozen=True)
class LinkDeclaration:
    """Thermal resistance [K/W] between places; `{leg}` in both patterns means the same leg.

    A resistance of `None` is perfect contact: a face has the temperature of what it touches.
    """

    between: tuple[str, str]
    resistance: Parameter | None


@dataclass(frozen=True)
class EffectDeclaration:
    """An effect at the places that a pattern matches.

    Args:
        effect: the effect, with its options chosen.
        at: a node, an edge `"a~b"`, a glob, or `"*"`.
        parameters: its parameters with this model's values; those left out take the effect's own.
        label: what its parameters are named after, by default the effect's key.
        driven_by: the place whose log columns drive it, where that is not its own: one motor's current heats
            every piece of the winding.
    """

    effect: Effect
    at: str
    parameters: tuple[Parameter, ...] = ()
    label: str = ""
    driven_by: str = ""

    @property
    def name(self) -> str:
        """What its parameters are named after."""
        return self.label or self.effect.key

    @property
    def resolved(self) -> dict[str, Parameter]:
        """All parameters of the effect, this model's values first."""
        own = {parameter.name: parameter for parameter in self.parameters}
        return {parameter.name: own.get(parameter.name, parameter) for parameter in self.effect.parameters}


@dataclass(frozen=True)
class Link:
    """Two places and the index of the resistance between them."""

    place: str
    ends: tuple[str, str]
    resistance: int


@dataclass(frozen=True)
class Use:
    """One effect at one place: the nodes it touches and the indices of its parameters."""

    declaration: EffectDeclaration
    place: str
    ends: tuple[str, ...]
    parameters: dict[str, int]

    @property
    def effect(self) -> Effect:
        return self.declaration.effect


@dataclass(frozen=True)
class Network:
    """A thermal network as declared, with its places and unknowns worked out.

    Args:
        name: what the model is called.
        nodes: dynamic and prescribed nodes.
        links: resistances between them.
        effects: everything beyond capacitances and resistances.
        joints: the names that globs in `nodes` choose from.
        origin: the file it came from, for messages.
        values: parameter values that replace the declared ones, by the unknowns' names (a fit's result).

    Raises:
        InputError: a place matches nothing, two declarations claim one place, a node is isolated.
    """

    name: str
    nodes: tuple[NodeDeclaration, ...]
    links: tuple[LinkDeclaration, ...] = ()
    effects: tuple[EffectDeclaration, ...] = ()
    joints: tuple[str, ...] = ()
    origin: str = "model"
    values: Mapping[str, float] = field(default_factory=dict)
    _assembly: _Assembly = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        # The network's own questions (`places_for`) are answered from what is assembled so far.
        object.__setattr__(self, "_assembly", _Assembly(self.origin, self.values))
        self._assembly.build(self)

    @property
    def dynamic(self) -> list[str]:
        """Names of the nodes with a heat capacity, in order."""
        return list(self._assembly.capacities)

    @property
    def prescribed(self) -> dict[str, str | int]:
        """For each prescribed node its log column, `"start"`, or the index of its parameter."""
        return self._assembly.prescribed

    @property
    def capacities(self) -> dict[str, int]:
        """For each dynamic node the index of its capacitance."""
        return self._assembly.capacities

    @property
    def resistors(self) -> list[Link]:
        """Every link of the network."""
        return self._assembly.links

    @property
    def conductors(self) -> list[Conductor]:
        """Conduction between the mean temperatures and faces of elements."""
        return self._assembly.bodies.conductors

    @property
    def massless(self) -> dict[str, str]:
        """Faces of elements that have a temperature of their own but no capacitance: name -> the element."""
        return self._assembly.bodies.massless

    @property
    def uses(self) -> list[Use]:
        """Every effect at every place where it acts."""
        return self._assembly.uses

    @property
    def unknowns(self) -> list[Unknown]:
        """All parameters of the model, free and fixed."""
        return self._assembly.unknowns

    @cached_property
    def surroundings(self) -> dict[str, tuple[str, str]]:
        """Places of exchange with a prescribed node: name -> (node, prescribed node).

        A node with one such link lends it its name; a node with several names them by edge.
        """
        pairs = [
            (one, other)
            for link in self.resistors
            for one, other in (link.ends, link.ends[::-1])
            if (one in self.capacities or one in self.massless) and other in self.prescribed
        ]
        count = {node: sum(one == node for one, _ in pairs) for node, _ in pairs}
        return {(node if count[node] == 1 else edge(node, other)): (node, other) for node, other in pairs}

    def with_effects(self, extra: Iterable[EffectDeclaration]) -> Network:
        """The same network and more effects."""
        return replace(self, effects=(*self.effects, *extra))

    def with_values(self, values: Mapping[str, float]) -> Network:
        """The same network with parameter values replaced, by the names of its unknowns."""
        return replace(self, values={**self.values, **values})

    def without_effect(self, key: str, at: str) -> Network:
        """The same network less the effect declared with this key and place."""
        return replace(self, effects=tuple(each for each in self.effects if (each.effect.key, each.at) != (key, at)))

    def places_for(self, declaration: EffectDeclaration) -> list[tuple[str, tuple[str, ...]]]:
        """Where a declared effect acts: (place, nodes it touches)."""
        at, site = declaration.at, declaration.effect.site
        if site == "edge":
            return [(edge(*pair), pair) for pair in self._edges(at)]
        if site == "link":
            return [(place, self.surroundings[place]) for place in matching(at, self.surroundings)]
        nodes = self.dynamic
        if isinstance(declaration.effect, LossEffect):
            nodes = self.nodes_with(declaration.effect.acts_on)
        return [(name, (name,)) for name in matching(at, nodes)]

    def nodes_with(self, key: str) -> list[str]:
        """Dynamic nodes at which an effect is declared."""
        patterns = [effect.at for effect in self.effects if effect.effect.key == key]
        return [name for name in self.dynamic if any(matching(pattern, [name]) for pattern in patterns)]

    def _edges(self, at: str) -> list[tuple[str, str]]:
        if at == "*":
            return expand_pair(("*", "*"), self.dynamic)
        one, _, other = at.partition("~")
        return expand_pair((one, other), self.dynamic)


class _Assembly:
    """Works out places and unknowns of a network, in the order of its declarations."""

    def __init__(self, origin: str, values: Mapping[str, float]) -> None:
        self.origin, self.values = origin, values
        self.unknowns: list[Unknown] = []
        self.capacities: dict[str, int] = {}
        self.prescribed: dict[str, str | int] = {}
        self.links: list[Link] = []
        self.uses: list[Use] = []
        self.bodies = Bodies(origin)
        self._elements: dict[str, tuple[str, Element]] = {}
        self._index: dict[str, int] = {}

    def build(self, network: Network) -> None:
        for node in network.nodes:
            self._add_node(node, network.joints)
        self._join(network.links)
        for number, link in enumerate(network.links):
            self._add_link(link, number)
        self._refuse_isolated(network)
        self.bodies.lay_conductors(self._conductivity)
        for number, effect in enumerate(network.effects):
            self._add_effect(effect, number, network)

    def _unknown(self, prefix: str, place: str, pattern: str, declared: Parameter) -> int:
        owner = {"class": class_of(place), "all": pattern}.get(declared.share, place)
        name = f"{prefix}.{owner}"
        if name not in self._index:
            other = mirrored(place) if declared.share == "sides" else None
            self._index[name] = len(self.unknowns)
            if name in self.values:
                declared = self._revalued(name, declared, self.values[name])
            self.unknowns.append(Unknown(name, declared, None if other is None else f"{prefix}.{other}"))
        return self._index[name]

    def _revalued(self, name: str, declared: Parameter, value: float) -> Parameter:
        lower, upper = declared.bounds
        slack = 1e-9 * max(abs(value), 1.0)
        if not lower - slack <= value <= upper + slack:
            raise InputError(
                self.origin, f'fit.parameters."{name}"', f"{value!r}", f"a value from {lower!r} to {upper!r}"
            )
        return replace(declared, value=min(max(value, lower), upper))

    def _add_node(self, node: NodeDeclaration, joints: Sequence[str]) -> None:
        names = matching(node.pattern, joints) if is_glob(node.pattern) else [node.pattern]
        where = f'nodes."{node.pattern}"'
        if not names:
            known = f"one of {', '.join(joints)}" if joints else "joints listed in [model] joints = [...]"
            raise InputError(self.origin, where, "a pattern that matches no joint", known)
        for name in names:
            if _NO_NAME.search(name):
                raise InputError(self.origin, where, f'the name "{name}"', "a name without blanks, dots, ~ or braces")
            if name in self.capacities or name in self.prescribed:
                raise InputError(self.origin, where, f"node {name} declared twice", "each node once")
            if node.capacity is not None:
                self.capacities[name] = self._unknown("capacity", name, node.pattern, node.capacity)
                if node.element is not None:
                    self.bodies.add(name, node.element.shape)
                    self._elements[name] = node.pattern, node.element
            elif isinstance(node.temperature, Parameter):
                self.prescribed[name] = self._unknown("temperature", name, node.pattern, node.temperature)
            elif node.temperature is not None:
                self.prescribed[name] = node.temperature
            else:
                raise InputError(self.origin, where, "neither", "a capacity or a temperature")

    def _conductivity(self, name: str, direction: str) -> int:
        pattern, element = self._elements[name]
        parameter = element.conductivity[direction]
        return self._unknown(parameter.name, name, pattern, parameter)

    def _pairs(self, link: LinkDeclaration, number: int) -> list[tuple[str, str]]:
        """Places that a link stands for; only a pattern with a dot means faces."""
        names = [*self.capacities, *self.prescribed]
        where = f"links[{number}].between"
        pairs = [
            pair
            for pair in expand_pair(link.between, [*names, *self.bodies.faces])
            if all(("." in end) == ("." in pattern) for end, pattern in zip(pair, link.between, strict=True))
        ]
        if not pairs:
            raise InputError(
                self.origin,
                where,
                f"{link.between[0]} and {link.between[1]}, which match no pair of nodes",
                f"two of {', '.join(self.bodies.linkable(names))}, or patterns of them",
            )
        for end in (end for pair in pairs for end in pair if end in self.bodies.shapes):
            expected = f"one of its faces: {', '.join(self.bodies.faces_of(end))}"
            raise InputError(self.origin, where, f"a link to the middle of element {end}", expected)
        return pairs

    def _join(self, links: Sequence[LinkDeclaration]) -> None:
        """Perfect contacts come before all others, for they say where those others end."""
        for number, link in enumerate(links):
            if link.resistance is None:
                for pair in self._pairs(link, number):
                    self.bodies.join(*pair, f"links[{number}].between")

    def _add_link(self, link: LinkDeclaration, number: int) -> None:
        if link.resistance is None:
            return
        where = f"links[{number}].between"
        pairs = self._pairs(link, number)
        pattern = edge(*link.between)
        taken = {known.place for known in self.links}
        for pair in pairs:
            place = edge(*pair)
            if place in taken:
                raise InputError(self.origin, where, f"a second link {place}", "each pair of nodes linked once")
            self.bodies.touch(*pair)
            ends = self.bodies.where(pair[0]), self.bodies.where(pair[1])
            if ends[0] == ends[1] or (ends[0] in self.prescribed and ends[1] in self.prescribed):
                continue  # heat between two given temperatures changes nothing
            self.links.append(Link(place, ends, self._unknown("resistance", place, pattern, link.resistance)))

    def _refuse_isolated(self, network: Network) -> None:
        touched = {end for link in self.links for end in link.ends} | self.bodies.touched_places()
        for effect in network.effects:
            if effect.effect.site == "edge":
                touched |= {end for _, ends in network.places_for(effect) for end in ends}
        for name in self.capacities:
            if name not in touched:
                raise InputError(
                    self.origin,
                    f'nodes."{name}"',
                    "an isolated node, whose heat has no way out",
                    "a link to it, such as between = "
                    f'["{self.bodies.linkable([name])[0]}", "{next(iter(self.prescribed), "ambient")}"]',
                )

    def _add_effect(self, effect: EffectDeclaration, number: int, network: Network) -> None:
        where = f"effects[{number}].at"
        places = network.places_for(effect)
        if not places:
            raise InputError(
                self.origin,
                where,
                f'"{effect.at}", which matches no place for {effect.effect.key}',
                _places_in_words(effect, network),
            )
        taken = {(use.declaration.name, use.place) for use in self.uses}
        for place, ends in places:
            if (effect.name, place) in taken:
                raise InputError(
                    self.origin, where, f"a second {effect.name} at {place}", "each effect once at each place"
                )
            indices = {
                name: self._unknown(f"{effect.name}.{name}", place, effect.at, declared)
                for name, declared in effect.resolved.items()
            }
            self.uses.append(Use(effect, place, ends, indices))


def _places_in_words(declaration: EffectDeclaration, network: Network) -> str:
    site = declaration.effect.site
    if site == "edge":
        return f'an edge "a~b" between two of {", ".join(network.dynamic)}'
    if site == "link":
        names = list(network.surroundings)
        return f"one of {', '.join(names)}" if names else "a node linked to a prescribed temperature"
    if isinstance(declaration.effect, LossEffect):
        return f"a node that has {declaration.effect.acts_on}"
    return f"one of {', '.join(network.dynamic)}"
