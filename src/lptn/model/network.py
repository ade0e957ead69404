"""A thermal network: what a model file or a script declares, spread over the robot's places."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from lptn.basics.errors import InputError
from lptn.basics.parameters import Parameter, ParameterInstance
from lptn.basics.places import EVERYWHERE, class_of, edge, expand_pair, in_run, is_glob, matching, mirrored, run_label
from lptn.effects import Effect, ExcessEffect, LossEffect
from lptn.model.bodies import Bodies, Conductor, Element

# --- What a model declares: nodes, links and effects, each perhaps for many places, and what becomes of them ---


START = "start"
"""Prescribed temperature taken from the start of each run, for logs without an ambient column."""
RUN = "run"
"""Indicators of runs are parameters of this name: 1 in the run, else 0."""


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
        run: name of the only run in which the effect acts, or a glob of such names; every run by default. A log
            that was split into pieces `monday#1`, `monday#2` is meant as a whole by `monday`.
    """

    effect: Effect
    at: str
    parameters: tuple[Parameter, ...] = ()
    label: str = ""
    driven_by: str = ""
    run: str = ""

    @property
    def name(self) -> str:
        """What its parameters are named after."""
        return self.label or self.effect.key

    @property
    def where(self) -> str:
        """Place, and run if there is one: `"*_calf"`, `"*_calf@monday"`."""
        return in_run(self.at, self.run)

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
class EffectInstance:
    """One effect at one place: the nodes it touches, the indices of its parameters and of its run's indicator."""

    declaration: EffectDeclaration
    place: str
    ends: tuple[str, ...]
    parameters: dict[str, int]
    indicator: int | None = None

    @property
    def effect(self) -> Effect:
        return self.declaration.effect

    @property
    def name(self) -> str:
        """The effect's name, and the run's if there is one: `"sensor_offset@monday"`."""
        return in_run(self.declaration.name, self.declaration.run)

    @property
    def label(self) -> str:
        """What its state is called."""
        return in_run(f"{self.declaration.name}.{self.place}", self.declaration.run)


# --- Where an effect of each kind of site can stand in a network ----------------------------------


Place = tuple[str, tuple[str, ...]]
"""The name of a place and the nodes that an effect touches there."""


def places_for(network: Network, declaration: EffectDeclaration) -> list[Place]:
    """Where a declared effect acts: (place, nodes it touches)."""
    at, site = declaration.at, declaration.effect.site
    if site == "edge":
        return [(edge(*pair), pair) for pair in _pairs(at, network.dynamic)]
    if site == "pair":
        return _touching(at, network)
    if site == "link":
        return [(place, network.surroundings[place]) for place in matching(at, network.surroundings)]
    if site == "boundary":
        return [(name, (name,)) for name in matching(at, network.prescribed)]
    nodes = matching(at, _heated(network, declaration))
    if site == "group":
        return [(at, tuple(nodes))] if nodes else []
    return [(name, (name,)) for name in nodes]


def _heated(network: Network, declaration: EffectDeclaration) -> list[str]:
    """The nodes that have the heat which the effect is about."""
    effect = declaration.effect
    needed = effect.acts_on if isinstance(effect, LossEffect) else ""
    needed = effect.heat_of if isinstance(effect, ExcessEffect) else needed
    return network.nodes_with(needed) if needed else network.dynamic


def _pairs(at: str, names: list[str]) -> list[tuple[str, str]]:
    if at == EVERYWHERE:
        return expand_pair((EVERYWHERE, EVERYWHERE), names)
    one, _, other = at.partition("~")
    return expand_pair((one, other), names)


def _touching(at: str, network: Network) -> list[Place]:
    """Pairs of nodes that exchange heat directly, each in the order in which the pattern names it."""
    linked = {link.place for link in network.resistors}
    for effect in network.effects:
        if effect.effect.site == "edge":
            linked |= {place for place, _ in places_for(network, effect)}
    pairs = _pairs(at, network.dynamic)
    if at == EVERYWHERE:
        pairs = [ordered for pair in pairs for ordered in (pair, pair[::-1])]
    return [("~".join(pair), pair) for pair in pairs if edge(*pair) in linked]


def places_in_words(declaration: EffectDeclaration, network: Network) -> str:
    """What could have stood in place of an `at` that matches nothing."""
    site, effect = declaration.effect.site, declaration.effect
    names, what = network.dynamic, "one of "
    if site == "edge":
        names, what = network.dynamic, 'an edge "a~b" between two of '
    elif site == "pair":
        names, what = network.dynamic, 'two linked nodes, "a~b" for the sensor of a, of '
    elif site == "link":
        names, what = list(network.surroundings), "one of "
        if not names:
            return "a node linked to a prescribed temperature"
    elif site == "boundary":
        names = list(network.prescribed)
        if not names:
            return "a prescribed temperature, which this model lacks"
    elif isinstance(effect, LossEffect):
        return f"a node that has {effect.acts_on}"
    elif isinstance(effect, ExcessEffect) and effect.heat_of:
        return f"a node that has {effect.heat_of}"
    return what + ", ".join(names)


# --- Places and unknowns of a network, worked out from its declarations ---------------------------


_NO_NAME = re.compile(r"[\s.~{}]|^$")


class Assembly:
    """Works out places and unknowns of a network, in the order of its declarations."""

    def __init__(self, origin: str, values: Mapping[str, float]) -> None:
        self.origin, self.values = origin, values
        self.parameters: list[ParameterInstance] = []
        self.capacities: dict[str, int] = {}
        self.prescribed: dict[str, str | int] = {}
        self.links: list[Link] = []
        self.effect_instances: list[EffectInstance] = []
        self._labels: set[str] = set()
        self.runs: dict[str, int] = {}
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

    def _unknown(self, prefix: str, place: str, pattern: str, declared: Parameter, run: str = "") -> int:
        owner = {"class": class_of(place), "all": pattern}.get(declared.share, place)
        name = in_run(f"{prefix}.{owner}", run)
        if name not in self._index:
            other = mirrored(place) if declared.share == "sides" else None
            self._index[name] = len(self.parameters)
            if name in self.values:
                declared = self._revalued(name, declared, self.values[name])
            mirror = None if other is None else in_run(f"{prefix}.{other}", run)
            self.parameters.append(ParameterInstance(name, declared, mirror))
        return self._index[name]

    def _indicator(self, run: str) -> int | None:
        """The parameter that is 1 in a run and 0 wherever no run is driven: in an FMU, an estimator, a forecast."""
        if not run:
            return None
        declared = Parameter(RUN, 0.0, "1", (0.0, 1.0), title=f"1 in run {run}", fixed=True)
        self.runs[run] = self._unknown(RUN, run_label(run), run, declared)
        return self.runs[run]

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
            if effect.effect.site == "edge" and not effect.run:
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
                places_in_words(effect, network),
            )
        indicator = self._indicator(effect.run)
        for place, ends in places:
            indices = {
                name: self._unknown(f"{effect.name}.{name}", place, effect.at, declared, effect.run)
                for name, declared in effect.resolved.items()
            }
            instance = EffectInstance(effect, place, ends, indices, indicator)
            if instance.label in self._labels:
                raise InputError(
                    self.origin, where, f"a second {instance.name} at {place}", "each effect once at each place"
                )
            self._labels.add(instance.label)
            self.effect_instances.append(instance)


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
    _assembly: Assembly = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        # The network's own questions (`places_for`) are answered from what is assembled so far.
        object.__setattr__(self, "_assembly", Assembly(self.origin, self.values))
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
    def effect_instances(self) -> list[EffectInstance]:
        """Every effect at every place where it acts."""
        return self._assembly.effect_instances

    @property
    def parameters(self) -> list[ParameterInstance]:
        """All parameters of the model, free and fixed."""
        return self._assembly.parameters

    @property
    def runs(self) -> dict[str, int]:
        """For each run, or glob of runs, that an effect is confined to, the index of its indicator."""
        return self._assembly.runs

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
        """The same network less the effect declared with this key and place (`"*_calf"`, `"*_calf@monday"`)."""
        kept = tuple(each for each in self.effects if (each.effect.key, each.where) != (key, at))
        return replace(self, effects=kept)

    def places_for(self, declaration: EffectDeclaration) -> list[tuple[str, tuple[str, ...]]]:
        """Where a declared effect acts: (place, nodes it touches)."""
        return places_for(self, declaration)

    def nodes_with(self, key: str) -> list[str]:
        """Dynamic nodes at which an effect is declared."""
        patterns = [effect.at for effect in self.effects if effect.effect.key == key]
        return [name for name in self.dynamic if any(matching(pattern, [name]) for pattern in patterns)]

    def around(self, instance: EffectInstance) -> str | None:
        """The prescribed node that the nodes of a use give their heat to, `None` without any."""
        near = [other for node, other in self.surroundings.values() if node in instance.ends]
        return next(iter([*near, *self.prescribed]), None)
