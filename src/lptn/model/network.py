"""A thermal network: what a model file or a script declares, worked out for each place of the robot."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property

from lptn.basics.bounds import NODES, Bound
from lptn.basics.errors import InputError
from lptn.basics.parameters import Parameter, ParameterInstance
from lptn.basics.places import (
    EVERYWHERE,
    class_of,
    edge,
    expand_pair,
    in_listed_order,
    in_run,
    is_glob,
    limb_of,
    matching,
    mirrored,
    run_label,
)
from lptn.effects import Effect
from lptn.effects.base import Place
from lptn.logs.columns import START
from lptn.model.bodies import Bodies, Conductor, Element, HottestPoint

# --- What a model declares: nodes, links and effects, each perhaps for many places -----------------

_COPPER_LOSS = "copper_loss"  # what makes a node a winding
_CONSTANT_HEAT = "constant_heat"
_LOGGED_HEAT = "heat_input"  # what makes it a computer, or another part whose power a log tells
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

    Example:
        >>> import lptn
        >>> lptn.NodeDeclaration("ambient", temperature="temperature.ambient").pattern
        'ambient'
    """

    pattern: str
    capacity: Parameter | None = None
    temperature: str | Parameter | None = None
    element: Element | None = None


@dataclass(frozen=True)
class LinkDeclaration:
    """Thermal resistance [K/W] between places; `{leg}` in both patterns means the same leg.

    A resistance of `None` is perfect contact: a face has the temperature of what it touches.

    Args:
        between: two nodes, faces of bodies, or patterns.
        resistance: K/W.

    Example:
        >>> import lptn
        >>> lptn.LinkDeclaration(("rotor.outer", "housing"), None).between
        ('rotor.outer', 'housing')
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
            every piece of the winding. With `"*"` each node by the winding that it is linked to: a joint's friction
            warms its housing.
        run: name of the only run in which the effect acts, or a glob of such names; every run by default. A log
            that was split into pieces `monday#1`, `monday#2` is meant as a whole by `monday`.
        difference: it is what a place has beside the same effect that it has in common with others: heat that adds to
            the common heat, a factor that multiplies the common factor. Its parameters are named after it,
            `constant_heat_difference.power.FR_calf`, and it may be negative.

    Example:
        >>> import lptn
        >>> from lptn.effects import catalogue
        >>> lptn.EffectDeclaration(catalogue()["fan"](), "*_calf", run="monday").where
        '*_calf@monday'
    """

    effect: Effect
    at: str
    parameters: tuple[Parameter, ...] = ()
    label: str = ""
    driven_by: str = ""
    run: str = ""
    difference: bool = False

    @property
    def name(self) -> str:
        """What its parameters are named after."""
        return self.label or (f"{self.effect.key}_difference" if self.difference else self.effect.key)

    def instance_label(self, place: str) -> str:
        """What it is called at one of its places, after which its state there is named."""
        return in_run(f"{self.name}.{place}", self.run)

    @property
    def where(self) -> str:
        """Place, and run if there is one: `"*_calf"`, `"*_calf@monday"`."""
        return in_run(self.at, self.run)

    def shared_name(self, parameter: str) -> str:
        """What a parameter is called among the model's, where all places of the effect have it in common."""
        return f"{self.name}.{parameter}.{self.where}"

    def in_place_of(self, other: EffectDeclaration) -> bool:
        """Whether it is what one place has of an effect in place of what it would have in common with others."""
        alike = self.effect.key == other.effect.key and self.run == other.run
        return alike and not self.difference and self.at != other.at and bool(matching(other.at, [self.at]))

    @property
    def resolved(self) -> dict[str, Parameter]:
        """All parameters of the effect, this model's values first."""
        own = {parameter.name: parameter for parameter in self.parameters}
        stated = self.effect.stated(self.difference)
        return {parameter.name: own.get(parameter.name, parameter) for parameter in stated}


# --- What becomes of the declarations: links and effects, each at one place ---


@dataclass(frozen=True)
class Link:
    """Two places and the index of the resistance between them."""

    place: str
    ends: tuple[str, str]
    resistance: int


@dataclass(frozen=True)
class EffectInstance:
    """One effect at one place.

    It has the nodes that it touches, the indices of its parameters and of its run's indicator, and the place whose log
    columns drive it.
    """

    declaration: EffectDeclaration
    place: str
    ends: tuple[str, ...]
    parameters: dict[str, int]
    indicator: int | None
    driven_by: str

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
        return self.declaration.instance_label(self.place)


# --- The network -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Network:
    """A thermal network as declared, with its places and parameters worked out.

    Args:
        name: what the model is called.
        nodes: dynamic and prescribed nodes.
        links: resistances between them.
        effects: everything beyond capacitances and resistances.
        joints: the names that globs in `nodes` choose from. In their order stand nodes, inputs of one quantity, and
            all arrays of joints that are made of the model; names that are not listed come behind, as declared.
        origin: the file it came from, for messages.
        values: parameter values that replace the declared ones, by the parameters' names.
        priors: means and standard deviations that replace theirs, likewise.

    Attributes:
        capacities: for each dynamic node the index of its capacitance.
        prescribed: for each prescribed node its log column, `"start"`, or the index of its parameter.
        resistors: every link of the network.
        conductors: conduction between the mean temperatures and faces of elements.
        massless: faces of elements that have a temperature of their own but no capacitance: name -> the element.
        hottest: hottest points of elements that are places of their own.
        effect_instances: every effect at every place where it acts.
        parameters: all parameters of the model, free and fixed.
        declared_at: for each key of a declaration, such as `("nodes", "*_calf", "capacity")`, the names of its
            parameters, and the place or group of places that owns each.
        runs: for each run, or glob of runs, that an effect is confined to, the index of its indicator.

    Raises:
        InputError: a place matches nothing, two declarations claim one place, a node is isolated.

    Example:
        >>> import lptn
        >>> from lptn.effects import catalogue
        >>> network = lptn.Network(
        ...     "motor",
        ...     nodes=(
        ...         lptn.NodeDeclaration("motor", capacity=lptn.Parameter("capacity", 300.0, "J/K", (1.0, 1e5))),
        ...         lptn.NodeDeclaration("ambient", temperature="temperature.ambient"),
        ...     ),
        ...     links=(
        ...         lptn.LinkDeclaration(("motor", "ambient"), lptn.Parameter("resistance", 2.0, "K/W", (0.01, 100.0))),
        ...     ),
        ...     effects=(lptn.EffectDeclaration(catalogue()["copper_loss"](), "motor"),),
        ... )
        >>> lptn.Model(network)
        <Model motor: 1 state, 2 inputs, 2 free parameters>
    """

    name: str
    nodes: tuple[NodeDeclaration, ...]
    links: tuple[LinkDeclaration, ...] = ()
    effects: tuple[EffectDeclaration, ...] = ()
    joints: tuple[str, ...] = ()
    origin: str = "model"
    values: Mapping[str, float] = field(default_factory=dict)
    priors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    capacities: dict[str, int] = field(init=False, repr=False, compare=False)
    prescribed: dict[str, str | int] = field(init=False, repr=False, compare=False)
    resistors: list[Link] = field(init=False, repr=False, compare=False)
    conductors: list[Conductor] = field(init=False, repr=False, compare=False)
    massless: dict[str, str] = field(init=False, repr=False, compare=False)
    hottest: list[HottestPoint] = field(init=False, repr=False, compare=False)
    effect_instances: list[EffectInstance] = field(init=False, repr=False, compare=False)
    parameters: list[ParameterInstance] = field(init=False, repr=False, compare=False)
    declared_at: dict[Key, dict[str, str]] = field(init=False, repr=False, compare=False)
    runs: dict[str, int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Nodes first, then links, then what conducts inside elements, then effects: so parameters are numbered."""
        own, parameters = vars(self), _Parameters(self.origin, self.values, self.priors)
        capacities, prescribed, elements = _nodes(self.origin, self.nodes, self.joints, parameters)
        capacities = {name: capacities[name] for name in in_listed_order(capacities, self.joints)}
        bodies = Bodies(self.origin)
        for name, (_, element) in elements.items():
            bodies.add(name, element.shape)
        resistors = _links(self.origin, self.links, capacities, prescribed, bodies, parameters)

        def conductivity(name: str, direction: str) -> int:
            pattern, element = elements[name]
            declared = element.conductivity[direction]
            key = ("nodes", pattern, "element", declared.name)
            return parameters.index(key, declared.name, name, pattern, declared)

        bodies.lay_conductors(conductivity, [name for name, (_, element) in elements.items() if element.hottest])
        own.update(capacities=capacities, prescribed=prescribed, resistors=resistors)
        own.update(conductors=bodies.conductors, massless=bodies.massless, hottest=bodies.hottest)
        _LINKS.check(len(resistors), self.origin, "links")
        _refuse_isolated(self, bodies)
        instances, runs = _effects(self, parameters)
        _PLACES.check(len(instances), self.origin, "effects")
        own.update(effect_instances=instances, runs=runs)
        own.update(parameters=parameters.instances, declared_at=parameters.declared_at)
        # An effect that is taken out takes its values along: should it come back, it starts as it is declared then.
        names = {parameter.name for parameter in parameters.instances}
        own.update(values={name: value for name, value in self.values.items() if name in names})

    @property
    def dynamic(self) -> list[str]:
        """Names of the nodes with a heat capacity, in order."""
        return list(self.capacities)

    @property
    def order(self) -> tuple[str, ...]:
        """Places in the one order in which arrays hold them: the joints as they are listed, then other nodes."""
        return tuple(dict.fromkeys((*self.joints, *self.dynamic)))

    def columns_in_order(self, columns: Iterable[str]) -> list[str]:
        """Log columns, those of one quantity together, in the order of places."""
        parts = [column.partition(".") for column in columns]
        quantities = dict.fromkeys(quantity for quantity, _, _ in parts)
        places = dict.fromkeys((*self.order, *(place for _, _, place in parts)))
        listed = [f"{quantity}.{place}" for quantity in quantities for place in places]
        return in_listed_order(map("".join, parts), listed)

    @property
    def unlogged(self) -> list[str]:
        """Prescribed nodes whose temperature no log column says, but a number or the start of a run."""
        return [name for name, source in self.prescribed.items() if isinstance(source, int) or source == START]

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

    @cached_property
    def linked(self) -> set[str]:
        """Pairs of places that the network links, by the names of their edges."""
        return {link.place for link in self.resistors}

    @cached_property
    def contacts(self) -> set[str]:
        """The same with the pairs between which an effect exchanges heat."""
        between = (declared for declared in self.effects if declared.effect.between_ends)
        return self.linked | {place for declared in between for place, _ in self.places_for(declared)}

    def places_for(self, declared: EffectDeclaration) -> list[Place]:
        """Where a declared effect may act: (place, nodes it touches)."""
        return declared.effect.places(declared.at, self)

    def places_held(self, declared: EffectDeclaration) -> list[Place]:
        """Where it acts beside the declared ones.

        Where two declarations of an effect cover a place, the one that covers fewer places applies: `"*"` beside
        `"FR_calf"` is everywhere else.
        """
        places = self.places_for(declared)
        fewest = self._fewest_places
        return [place for place in places if len(places) <= fewest.get(declared.instance_label(place[0]), len(places))]

    @cached_property
    def _fewest_places(self) -> dict[str, int]:
        """For each effect at each place the number of places of the narrowest declaration that covers it."""
        fewest: dict[str, int] = {}
        for declared in self.effects:
            places = self.places_for(declared)
            for place, _ in places:
                label = declared.instance_label(place)
                fewest[label] = min(fewest.get(label, len(places)), len(places))
        return fewest

    def windings_at(self, node: str) -> list[str]:
        """Nodes with copper loss among a node and those that it is linked to; the node alone where it is one."""
        windings = self.nodes_with(_COPPER_LOSS)
        near = {name for link in self.resistors if node in link.ends for name in link.ends}
        return [node] if node in windings else [name for name in windings if name in near]

    def nodes_with(self, key: str) -> list[str]:
        """Dynamic nodes at which an effect is declared."""
        return self._declared_at.get(key, [])

    @cached_property
    def nodes_of_constant_heat(self) -> set[str]:
        """Dynamic nodes of which the model takes all heat to be constant: nothing that is logged drives any there."""
        logged = [declared for declared in self.effects if declared.effect.site == "node" and declared.effect.needed()]
        driven = {name for declared in logged for _, ends in self.places_for(declared) for name in ends}
        return set(self.nodes_with(_CONSTANT_HEAT)) - driven

    @cached_property
    def _declared_at(self) -> dict[str, list[str]]:
        """The dynamic nodes of each effect."""
        nodes: dict[str, set[str]] = {}
        for declared in self.effects:
            nodes.setdefault(declared.effect.key, set()).update(matching(declared.at, self.dynamic))
        return {key: [name for name in self.dynamic if name in names] for key, names in nodes.items()}

    def sets_apart(self, declared: EffectDeclaration) -> bool:
        """Whether an effect acts in one run alone, or at one place of three or more, or limb, and others are like it.

        What a class of like places has in common is how they are built, and so is what the only computer or plate of a
        machine has.
        """
        here, everywhere = (self.places_for(replace(declared, at=at)) for at in (declared.at, EVERYWHERE))
        inside = [place for place, _ in here]
        others = [self._kinds_of(ends) for place, ends in everywhere if place not in inside]
        one = len(here) == 1 and len(everywhere) > 2
        limb = len(here) > 1 and all(limb_of(place) == declared.at for place in inside)
        return bool(declared.run) or ((one or limb) and all(self._kinds_of(ends) in others for _, ends in here))

    def _kinds_of(self, ends: Sequence[str]) -> list[tuple[bool, bool, int, str]]:
        """What the ends of a place are, in an order that like places have: windings, what a log heats, what they touch.

        Of each whether it is a winding, whether a logged power heats it, how many windings it is linked to, and, but
        for joints, its class: two housings are alike, a gearbox and an inverter are not.
        """
        windings, heated = self.nodes_with(_COPPER_LOSS), self.nodes_with(_LOGGED_HEAT)
        return sorted(
            (
                end in windings,
                end in heated,
                len(self.windings_at(end)),
                "" if end in self.joints else class_of(end),
            )
            for end in ends
        )

    def in_common(self, key: str) -> list[EffectInstance]:
        """Where an effect stands, in all runs, whose amplitude another place has in common with it."""
        shared = [
            (instance, instance.parameters[amplitude.name])
            for instance in self.effect_instances
            if instance.effect.key == key and not instance.declaration.run and not instance.declaration.difference
            if (amplitude := instance.effect.amplitude()) is not None
        ]
        places = Counter(index for _, index in shared)
        return [instance for instance, index in shared if places[index] > 1]

    def instead_of(self, own: EffectDeclaration) -> EffectDeclaration | None:
        """What places have in common, in whose place one has an effect of its own; `None` where they have nothing."""
        return next(filter(own.in_place_of, self.effects), None)

    def with_effects(self, extra: Iterable[EffectDeclaration]) -> Network:
        """The same network and more effects."""
        return replace(self, effects=(*self.effects, *extra))

    def with_values(self, values: Mapping[str, float]) -> Network:
        """The same network with parameter values replaced, by the parameters' names."""
        other = copy(self)  # working out all places and parameters anew would take much of a search's time
        parameters = [
            replace(
                parameter, declared=_revalued(self.origin, parameter.name, parameter.declared, values[parameter.name])
            )
            if parameter.name in values
            else parameter
            for parameter in self.parameters
        ]
        object.__setattr__(other, "values", {**self.values, **values})
        object.__setattr__(other, "parameters", parameters)
        return other

    def without_effect(self, key: str, at: str) -> Network:
        """The same network less the effect declared with this key and place (`"*_calf"`, `"*_calf@monday"`)."""
        kept = (one for one in self.effects if (one.effect.key, one.where) != (key, at))
        return replace(self, effects=tuple(kept))


# --- From the declarations to the network -----------------------------------------------------------

Key = tuple[str | int, ...]
"""A key of a declaration: `("nodes", "*_calf", "capacity")`, `("effects", 2, "gamma")`."""
_NO_NAME = re.compile(r"[\s.~{}]|^$")
_LINKS = Bound(2_000, "links")
"""Of a network, four a node. With 5,000 between 100 nodes `check` takes 20 s, a forecast minutes."""
_PLACES = Bound(5_000, "places")
"""Of a network's effects: a humanoid has some hundred. With 20,000 an FMU took more than a minute."""
ROUNDING = 1e-9  # of a value: it may lie so far outside its bounds, as numbers do that were printed and read


class _Parameters:
    """The parameters of a network, numbered in the order in which its declarations name them."""

    def __init__(self, origin: str, values: Mapping[str, float], priors: Mapping[str, tuple[float, float]]) -> None:
        self.origin, self.values, self.priors = origin, values, priors
        self.instances: list[ParameterInstance] = []
        self.declared_at: dict[Key, dict[str, str]] = {}
        self._index: dict[str, int] = {}

    def index(
        self, key: Key, quantity: str, place: str, pattern: str, declared: Parameter, effect: str = "", run: str = ""
    ) -> int:
        """The number of a declared parameter at a place, which it may have in common with others."""
        if declared.name != quantity:  # in Python it may be called anything
            declared = replace(declared, name=quantity)
        owner = {"class": class_of(place), "all": pattern}.get(declared.share, place)
        other = mirrored(place) if declared.share == "sides" else None
        instance = ParameterInstance(declared, in_run(owner, run), effect, in_run(other, run) if other else "")
        name = instance.name
        self.declared_at.setdefault(key, {})[name] = owner
        if name not in self._index:
            if name in self.values:
                declared = _revalued(self.origin, name, declared, self.values[name])
            if name in self.priors:
                declared = replace(declared, prior=self.priors[name])
            instance = replace(instance, declared=declared)
            self._index[name] = len(self.instances)
            self.instances.append(instance)
        return self._index[name]


def _revalued(origin: str, name: str, declared: Parameter, value: float) -> Parameter:
    lower, upper = declared.bounds
    slack = ROUNDING * max(abs(value), 1.0)
    if not lower - slack <= value <= upper + slack:
        expected = f"a value from {lower!r} to {upper!r}"
        raise InputError(origin, f'fit.parameters."{name}"', f"{value!r}", expected)
    return replace(declared, value=min(max(value, lower), upper))


def _nodes(
    origin: str, nodes: Sequence[NodeDeclaration], joints: Sequence[str], parameters: _Parameters
) -> tuple[dict[str, int], dict[str, str | int], dict[str, tuple[str, Element]]]:
    """Capacities, prescribed temperatures, and for each element the pattern that declares it."""
    capacities: dict[str, int] = {}
    prescribed: dict[str, str | int] = {}
    elements: dict[str, tuple[str, Element]] = {}
    for node in nodes:
        names = matching(node.pattern, joints) if is_glob(node.pattern) else [node.pattern]
        where = f'nodes."{node.pattern}"'
        if not names:
            known = f"a pattern of {', '.join(joints)}, or " if joints else ""
            expected = f"{known}the joint listed in [model] joints = [...]"
            raise InputError(origin, where, "a pattern that matches no joint", expected)
        for name in names:
            if _NO_NAME.search(name):
                raise InputError(origin, where, f'the name "{name}"', "a name without blanks, dots, ~ or braces")
            if name in capacities or name in prescribed:
                raise InputError(origin, where, f"node {name} declared twice", "each node once")
            if node.capacity is not None:
                key = ("nodes", node.pattern, "capacity")
                capacities[name] = parameters.index(key, "capacity", name, node.pattern, node.capacity)
                if node.element is not None:
                    elements[name] = node.pattern, node.element
            elif isinstance(node.temperature, Parameter):
                key = ("nodes", node.pattern, "temperature")
                prescribed[name] = parameters.index(key, "temperature", name, node.pattern, node.temperature)
            elif node.temperature is not None:
                prescribed[name] = node.temperature
            else:
                raise InputError(origin, where, "neither", "a capacity or a temperature")
    NODES.check(len(capacities) + len(prescribed), origin, "nodes")
    return capacities, prescribed, elements


def _links(
    origin: str,
    links: Sequence[LinkDeclaration],
    capacities: Mapping[str, int],
    prescribed: Mapping[str, str | int],
    bodies: Bodies,
    parameters: _Parameters,
) -> list[Link]:
    """Every link; perfect contacts are taken up by the bodies, before all others, for they say where those end."""
    names = [*capacities, *prescribed]
    resistors: list[Link] = []
    taken: set[str] = set()
    numbered = sorted(enumerate(links), key=lambda item: item[1].resistance is not None)
    for number, link in numbered:
        where = f"links[{number}].between"
        for pair in _pairs(origin, where, link, names, bodies):
            if link.resistance is None:
                bodies.join(*pair, where)
                continue
            place = edge(*pair)
            if place in taken:
                raise InputError(origin, where, f"a second link {place}", "each pair of nodes linked once")
            bodies.touch(*pair)
            ends = bodies.where(pair[0]), bodies.where(pair[1])
            if ends[0] == ends[1] or (ends[0] in prescribed and ends[1] in prescribed):
                continue  # heat between two given temperatures changes nothing
            taken.add(place)
            key = ("links", number, "resistance")
            index = parameters.index(key, "resistance", place, edge(*link.between), link.resistance)
            resistors.append(Link(place, ends, index))
    return resistors


def _pairs(
    origin: str, where: str, link: LinkDeclaration, names: Sequence[str], bodies: Bodies
) -> list[tuple[str, str]]:
    """Places that a link stands for; only a pattern with a dot means faces."""
    pairs = [
        pair
        for pair in expand_pair(link.between, [*names, *bodies.faces])
        if all(("." in end) == ("." in pattern) for end, pattern in zip(pair, link.between, strict=True))
    ]
    if not pairs:
        problem = f"{link.between[0]} and {link.between[1]}, which match no pair of nodes"
        raise InputError(origin, where, problem, f"two of {', '.join(bodies.linkable(names))}, or patterns of them")
    for end in (end for pair in pairs for end in pair if end in bodies.shapes):
        expected = f"one of its faces: {', '.join(bodies.faces_of(end))}"
        raise InputError(origin, where, f"a link to the middle of element {end}", expected)
    return pairs


def _refuse_isolated(network: Network, bodies: Bodies) -> None:
    """A node without link, contact or edge effect would only ever warm."""
    touched = {end for link in network.resistors for end in link.ends} | bodies.touched_places()
    for declared in network.effects:
        if declared.effect.between_ends and not declared.run:
            touched |= {end for _, ends in network.places_for(declared) for end in ends}
    for name in network.capacities:
        if name not in touched:
            ends = f'["{bodies.linkable([name])[0]}", "{next(iter(network.prescribed), "ambient")}"]'
            problem, expected = "an isolated node, whose heat has no way out", f"a link to it, such as between = {ends}"
            raise InputError(network.origin, f'nodes."{name}"', problem, expected)


def _effects(network: Network, parameters: _Parameters) -> tuple[list[EffectInstance], dict[str, int]]:
    """Every effect at every place where it acts, and the indicators of the runs that some are confined to."""
    instances: list[EffectInstance] = []
    labels: set[str] = set()
    runs: dict[str, int] = {}
    for number, declared in enumerate(network.effects):
        where = f"effects[{number}].at"
        if not network.places_for(declared):
            problem = f'"{declared.at}", which matches no place for {declared.effect.key}'
            raise InputError(network.origin, where, problem, declared.effect.places_in_words(network))
        if run := declared.run:
            # 1 in the run, and 0 wherever no run is simulated: in an FMU, an estimator, a forecast.
            indicator = Parameter(RUN, 0.0, "1", (0.0, 1.0), title=f"1 in run {run}", fixed=True)
            runs[run] = parameters.index((RUN, run), RUN, run_label(run), run, indicator)
        if not (held := network.places_held(declared)):
            problem = f'"{declared.at}", of whose places each has a declaration of fewer places'
            raise InputError(network.origin, where, problem, f"a place for {declared.effect.key}")
        for place, ends in held:
            indices = {
                name: parameters.index(
                    ("effects", number, name), name, place, declared.at, parameter, declared.name, run
                )
                for name, parameter in declared.resolved.items()
            }
            driven_by = _driving(network, f"effects[{number}].driven_by", declared, ends[0])
            instance = EffectInstance(declared, place, ends, indices, runs.get(run), driven_by)
            if instance.label in labels:
                expected = (
                    "each effect once at each place, or difference = true for what one place has beside a common one"
                )
                raise InputError(network.origin, where, f"a second {instance.name} at {place}", expected)
            labels.add(instance.label)
            instances.append(instance)
    return instances, runs


def _driving(network: Network, where: str, declared: EffectDeclaration, node: str) -> str:
    """The place whose log columns drive an effect at a node."""
    if declared.driven_by != EVERYWHERE:
        return declared.driven_by or node
    windings = network.windings_at(node)
    if len(windings) != 1:
        problem = f'"*", but {node} is linked to {" and ".join(windings) or "no winding"}'
        raise InputError(network.origin, where, problem, "one winding, a node with copper_loss, beside each place")
    return windings[0]
