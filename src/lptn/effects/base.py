"""What every physical effect is: a small class with one equation, its parameters and its signature.

`Effect` says what rooms may ask of any effect: where it can stand, and what it changes there. A *kind* of effect
(`NodeEffect`, `LinkEffect` and so on, below) answers these once, in terms of the one equation that an effect of that
kind writes. A new kind is a class in this file; no other room knows the list of kinds.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, ClassVar, Literal, Protocol

from lptn.basics.parameters import Parameter
from lptn.basics.places import EVERYWHERE, class_of, edge, expand_pair, matching
from lptn.effects.excitation import INPUTS_VARY, ExcitationRule

Site = Literal["node", "link", "contact", "edge", "loss", "sensor", "pair", "group", "boundary"]
SITES: Mapping[Site, str] = {
    "node": "a node",
    "link": "a link to the surroundings",
    "contact": 'a link between two nodes, `"a~b"`',
    "edge": 'a pair of nodes `"a~b"` that no link joins',
    "loss": "another effect's heat at a node",
    "sensor": "a sensor",
    "pair": 'a sensor and a neighbour, `"a~b"`',
    "group": "several nodes at once",
    "boundary": "a prescribed temperature",
}
"""What an effect can act on, in words for people."""
Symbol = Any
"""A symbolic scalar (`casadi.SX`) or a plain number: an equation is written once for both."""
Values = SimpleNamespace
"""Of an effect's inputs, or of its parameters, by name."""
Place = tuple[str, tuple[str, ...]]
"""The name of a place, and its ends: the nodes that an effect touches there."""
CLOCK = 1000.0 / 3600.0
"""K/s at which a state rises that keeps the time: so steep that a kelvin in it, from what is given or believed of the
start, moves the time by seconds."""


@dataclass(frozen=True)
class Signature:
    """How an effect shows itself to a person who looks at a model's errors.

    Args:
        looks_like: what the model without it gets wrong.
        separate_by: the experiment that separates it from its rivals.
        confused_with: keys of the effects that look the same on ordinary data.
    """

    looks_like: str
    separate_by: str
    confused_with: tuple[str, ...] = ()


class NetworkPlaces(Protocol):
    """What an effect asks of a network to know where it can stand."""

    @property
    def dynamic(self) -> Sequence[str]:
        """Nodes with a heat capacity."""

    @property
    def prescribed(self) -> Mapping[str, object]:
        """Nodes of a given temperature."""

    @property
    def unlogged(self) -> Collection[str]:
        """Nodes of a given temperature that no log column says, but a number or the start of a run."""

    @property
    def surroundings(self) -> Mapping[str, tuple[str, str]]:
        """Places of exchange with a prescribed node: name -> (node, prescribed node)."""

    @property
    def linked(self) -> Collection[str]:
        """Pairs of places that the network links, by the names of their edges."""

    @property
    def contacts(self) -> Collection[str]:
        """The same with the pairs between which an effect exchanges heat."""

    @property
    def nodes_of_constant_heat(self) -> Collection[str]:
        """Dynamic nodes of which the model takes all heat to be constant."""

    def nodes_with(self, key: str) -> list[str]:
        """Dynamic nodes at which an effect is declared."""


class Conditions(Protocol):
    """What an effect reads at its place; temperatures are in degC, all else is in SI."""

    @property
    def temperatures(self) -> Sequence[Symbol]:
        """Of its ends."""

    @property
    def at_sensor(self) -> Symbol:
        """The temperature where the sensor of its first end sits: the node's, with what `moves_sensor` says."""

    @property
    def given(self) -> Symbol:
        """The temperature of its first end, a prescribed node, as it is logged."""

    @property
    def surroundings(self) -> Symbol | None:
        """The temperature to which its ends give their heat, `None` in a model without any."""

    @property
    def around(self) -> Symbol | None:
        """The temperature round its first end: of the surroundings, or, inside a machine, of what it is linked to.

        Of a node that is held by no link but by effects alone, the surroundings.
        """

    @property
    def warming(self) -> Symbol:
        """Rate of its first end's temperature [K/s]."""

    @property
    def state(self) -> Symbol | None:
        """Its own state, `None` without one."""

    @property
    def inputs(self) -> Values:
        """The input features that it needs, by name."""

    @property
    def p(self) -> Values:
        """Its parameters, by name."""

    def heat_of(self, key: str) -> Symbol:
        """Heat that another effect brings into the same place [W]."""


class Effect(ABC):
    """One physical effect at one place.

    A subclass states its `key`, a `title`, the input features it `needs`, its `parameters`, its
    `signature`, its `source` and the `excitation` that it needs to show, and writes one equation. With its
    amplitude (the parameter that has an off-value) at that value, the equation leaves the model unchanged to the
    last bit.

    An effect with a state of its own (`has_state`) keeps it as a temperature, which starts a run in
    equilibrium with the place that it belongs to. `per_run` marks what may well differ from one run to the
    next (a fan, a door, a clock) and is then also looked for in single runs; `whole_robot` what is the same
    for all places.
    """

    key: ClassVar[str]
    title: ClassVar[str]
    site: ClassVar[Site]
    """What it acts on, in a word."""
    needs: ClassVar[tuple[str, ...]] = ()
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    signature: ClassVar[Signature]
    source: ClassVar[str]
    excitation: ClassVar[ExcitationRule] = INPUTS_VARY
    """What it needs of logs to show."""
    has_state: ClassVar[bool] = False
    rises: ClassVar[float] = 0.0
    """K/s; how fast a state rises that keeps the time since a log began: its later pieces go on where others ended. An
    estimator and an FMU begin anew."""
    options: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    prior_odds: ClassVar[float] = 1.0
    """How often such a thing is met where it can stand, relative to the other effects: prior odds of the evidence.

    1 is what most effects have. An effect that is rare in practice has less, and says why in a sentence below it.
    """
    measurement_error: ClassVar[bool] = False
    """Whether it is an error of what was logged, of a sensor, a clock or the air, and nothing in the robot.

    Such errors are findings, also the same one at all sensors, and never structure.
    """
    common: ClassVar[bool] = False
    """Whether it follows from how a machine is built, so that every part may have it: of the structure of a model."""
    per_run: ClassVar[bool] = False
    whole_robot: ClassVar[bool] = False
    in_one_run: ClassVar[tuple[str, str]] = ("", "")
    """What it means in one run, for an amplitude above and below 0; fields as in `lptn.diagnose.runs_that_differ`."""
    heat_of: ClassVar[str] = ""
    """Key of the effect whose heat at the same node it changes or follows: it can stand nowhere else."""

    def __init__(self, **chosen: str) -> None:
        """Take one of the admissible words for each of the effect's options; the first is the default."""
        self.chosen = {name: words[0] for name, words in self.options.items()} | chosen
        for name, word in chosen.items():
            if word not in self.options.get(name, ()):
                raise ValueError(f"{self.key}: option {name} = {word!r} is not one of {self.options.get(name, ())}")

    @classmethod
    def amplitude(cls) -> Parameter | None:
        """The parameter that switches the effect off, `None` where the effect can't be switched off."""
        return next((parameter for parameter in cls.parameters if parameter.off is not None), None)

    @classmethod
    def shape(cls) -> Parameter | None:
        """The parameter that is scored on a grid, `None` for an effect without a shape."""
        return next((parameter for parameter in cls.parameters if parameter.grid), None)

    @classmethod
    def size(cls) -> Parameter | None:
        """The parameter that states its size: the amplitude, or where that only says whether it is there the shape."""
        amplitude = cls.amplitude()
        return cls.shape() if amplitude is not None and amplitude.on is not None else amplitude

    @classmethod
    def adds_up(cls) -> bool:
        """Whether a place may have more of it than it has in common with others.

        Of what is all or nothing, and of masses, it has its own in place of what the others have.
        """
        amplitude, is_mass = cls.amplitude(), cls.has_state and cls.site != "sensor"
        return amplitude is not None and amplitude.on is None and not is_mass

    @classmethod
    def stated(cls, difference: bool = False) -> tuple[Parameter, ...]:
        """Its parameters, or those of the difference that one place makes to what it has in common with others.

        A difference adds to heat, readings and exchange, and multiplies factors. It may be of either sign.
        """
        return tuple(map(either_sign, cls.parameters)) if difference and cls.adds_up() else cls.parameters

    def needed(self) -> tuple[str, ...]:
        """Input features that the equation reads; an option called `input` names the one."""
        return (self.chosen["input"],) if "input" in self.options else self.needs

    # --- where it can stand ---------------------------------------------------------------------------

    one_place_a_pattern: ClassVar[bool] = False
    """Whether a pattern of nodes is one place, and not one place for each node."""
    single_defect: ClassVar[bool] = False
    """Whether it is a defect of single places, which is tested at each place alone."""
    alike: ClassVar[bool] = False
    """Whether it follows from how parts are built, and what of: one of several like places rarely has it alone."""
    in_all_pairs: ClassVar[bool] = True
    """Whether it may well stand at all its places at once."""

    @classmethod
    def places(cls, at: str, layout: NetworkPlaces) -> list[Place]:
        """The places that a pattern means for this effect; by default nodes, those with the heat that it is about."""
        nodes = layout.nodes_with(cls.heat_of) if cls.heat_of else layout.dynamic
        return [(name, (name,)) for name in matching(at, nodes)]

    @classmethod
    def places_in_words(cls, layout: NetworkPlaces) -> str:
        """What can stand in place of a pattern that means no place."""
        return f"a node that has {cls.heat_of}" if cls.heat_of else f"one of {', '.join(layout.dynamic)}"

    @classmethod
    def makes_a_difference(cls, place: str, layout: NetworkPlaces, driving: Sequence[Sequence[str]]) -> bool:
        """Whether it could change anything at one of its places.

        Args:
            place: the place.
            layout: the network's.
            driving: input features of each effect `heat_of` at the same node.
        """
        return True

    @classmethod
    def like_places(cls, place: str, nodes: Sequence[str]) -> str:
        """A pattern that means a place and its like on the other legs."""
        return _pattern_of_legs(place, nodes) or class_of(place)

    @classmethod
    def rests_with(cls, ends: tuple[str, ...]) -> tuple[str, ...]:
        """Those ends with which its state is in equilibrium when nothing happens."""
        return ends[:1]

    # --- what it changes there; a kind of effect overrides those that it is about ----------------------

    changes_reading: ClassVar[bool] = False
    """Whether it changes what the sensor of its first end reads."""
    moves_sensor: ClassVar[bool] = False
    """Whether it is about where the sensor of its first end sits: what its lag, too, has to follow."""
    delays_readings: ClassVar[bool] = False
    """Whether it changes when the sensor of its first end is read."""
    changes_link: ClassVar[bool] = False
    """Whether it changes what the link between its ends carries."""
    scales_heat: ClassVar[bool] = False
    """Whether it is a factor on the heat of the effect `heat_of`."""
    between_ends: ClassVar[bool] = False
    """Whether the heat that it brings into its first end is taken from its second."""

    def heat_into_ends(self, here: Conditions) -> Sequence[Symbol]:
        """Heat that it brings into each of its ends [W]; none by default."""
        return ()

    def heat_factor(self, here: Conditions) -> Symbol:
        """Factor on the heat of the effect `heat_of` at the same place."""
        return 1.0

    def link_factor(self, here: Conditions) -> Symbol:
        """Factor on the conductance of the link between its ends."""
        return 1.0

    def link_heat(self, here: Conditions) -> Symbol:
        """Heat into the first end [W] that the link between its ends carries besides."""
        return 0.0

    def reading_error(self, here: Conditions) -> Symbol:
        """Reading minus temperature of its first end [K]."""
        return 0.0

    def reading_delay(self, here: Conditions) -> Symbol:
        """How late the readings of its first end come [s]."""
        return 0.0

    def prescribed_error(self, here: Conditions) -> Symbol:
        """What the nodes feel of its first end, a prescribed node, minus what is given [K]."""
        return 0.0

    def state_rate(self, here: Conditions) -> Symbol:
        """Time derivative of its state [K/s]; asked only of an effect that has one."""
        return 0.0


# --- the kinds of effect ------------------------------------------------------------------------------


class NodeEffect(Effect):
    """Heat that an effect brings into a node."""

    site = "node"

    @abstractmethod
    def heat(self, temperature: Symbol, inputs: Values, p: Values) -> Symbol:
        """Heat into the node [W], from its temperature [degC], its inputs and the parameters."""

    def heat_into_ends(self, here: Conditions) -> Sequence[Symbol]:
        return [self.heat(here.temperatures[0], here.inputs, here.p)]


class MassEffect(Effect):
    """A state of its own (degC) beside the node, exchanging heat with it."""

    site = "node"
    has_state = True

    @abstractmethod
    def heat(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        """Heat from the state into the node [W]."""

    @abstractmethod
    def rate(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        """Time derivative of the state [K/s]."""

    def heat_into_ends(self, here: Conditions) -> Sequence[Symbol]:
        return [self.heat(here.temperatures[0], here.state, here.p)]

    def state_rate(self, here: Conditions) -> Symbol:
        return self.rate(here.temperatures[0], here.state, here.p)


class GroupEffect(Effect):
    """One state (degC) beside several nodes, exchanging heat with each of them and with their surroundings."""

    site = "group"
    has_state = True
    one_place_a_pattern = True

    @abstractmethod
    def heat(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        """Heat from the state into one of the nodes [W]."""

    @abstractmethod
    def rate(self, mean: Symbol, state: Symbol, surroundings: Symbol, p: Values) -> Symbol:
        """Time derivative of the state [K/s], from the nodes' mean temperature and that of the surroundings."""

    @classmethod
    def places(cls, at: str, layout: NetworkPlaces) -> list[Place]:
        nodes = matching(at, layout.dynamic)
        return [(at, tuple(nodes))] if nodes else []

    @classmethod
    def rests_with(cls, ends: tuple[str, ...]) -> tuple[str, ...]:
        return ends

    def heat_into_ends(self, here: Conditions) -> Sequence[Symbol]:
        return [self.heat(temperature, here.state, here.p) for temperature in here.temperatures]

    def state_rate(self, here: Conditions) -> Symbol:
        mean = sum(here.temperatures[1:], start=here.temperatures[0]) / len(here.temperatures)
        surroundings = here.state if here.surroundings is None else here.surroundings
        return self.rate(mean, here.state, surroundings, here.p)


class LossEffect(Effect):
    """A factor on the heat of another effect, `heat_of`, at the same node."""

    site = "loss"
    scales_heat = True

    @abstractmethod
    def factor(self, temperature: Symbol, p: Values) -> Symbol:
        """Factor on the heat, 1 when off."""

    @classmethod
    def makes_a_difference(cls, place: str, layout: NetworkPlaces, driving: Sequence[Sequence[str]]) -> bool:
        """It matters only where the heat is computed from what the factor is about, if it is about an input."""
        return not cls.needs or any(set(cls.needs) <= set(features) for features in driving)

    def heat_factor(self, here: Conditions) -> Symbol:
        return self.factor(here.temperatures[0], here.p)


class LinkEffect(Effect):
    """A change of the exchange between a node and its surroundings (ambient, coolant)."""

    site = "link"
    changes_link = True

    def conductance_factor(self, temperature: Symbol, surroundings: Symbol, inputs: Values, p: Values) -> Symbol:
        """Factor on the link's conductance, 1 when off; temperatures in degC."""
        return 1.0

    def extra_heat(self, temperature: Symbol, surroundings: Symbol, p: Values) -> Symbol:
        """Heat from the surroundings into the node [W] beside the link's own."""
        return 0.0

    @classmethod
    def places(cls, at: str, layout: NetworkPlaces) -> list[Place]:
        return [(place, layout.surroundings[place]) for place in matching(at, layout.surroundings)]

    @classmethod
    def places_in_words(cls, layout: NetworkPlaces) -> str:
        names = ", ".join(layout.surroundings)
        return f"one of {names}" if names else "a node linked to a prescribed temperature"

    def link_factor(self, here: Conditions) -> Symbol:
        node, surroundings = here.temperatures
        return self.conductance_factor(node, surroundings, here.inputs, here.p)

    def link_heat(self, here: Conditions) -> Symbol:
        node, surroundings = here.temperatures
        return self.extra_heat(node, surroundings, here.p)


class ContactEffect(Effect):
    """A change of the exchange between two nodes that the network links; not of a link to the face of a body."""

    site = "contact"
    changes_link = True

    @abstractmethod
    def conductance_factor(self, p: Values) -> Symbol:
        """Factor on the link's conductance, 1 when off."""

    @classmethod
    def places(cls, at: str, layout: NetworkPlaces) -> list[Place]:
        return [(edge(*pair), pair) for pair in _pairs(at, layout) if edge(*pair) in layout.linked]

    @classmethod
    def places_in_words(cls, layout: NetworkPlaces) -> str:
        names = ", ".join(place for place, _ in cls.places(EVERYWHERE, layout))
        return f"one of {names}" if names else "a link between two nodes; this model has none"

    def link_factor(self, here: Conditions) -> Symbol:
        return self.conductance_factor(here.p)


class EdgeEffect(Effect):
    """Exchange of heat between two nodes that the network does not link."""

    site = "edge"
    between_ends = True

    @abstractmethod
    def conductance(self, p: Values) -> Symbol:
        """Conductance between the two nodes [W/K]."""

    @classmethod
    def places(cls, at: str, layout: NetworkPlaces) -> list[Place]:
        return [(edge(*pair), pair) for pair in _pairs(at, layout)]

    @classmethod
    def places_in_words(cls, layout: NetworkPlaces) -> str:
        return f'an edge "a~b" between two of {", ".join(layout.dynamic)}'

    @classmethod
    def makes_a_difference(cls, place: str, layout: NetworkPlaces, driving: Sequence[Sequence[str]]) -> bool:
        """Beside a link it would be one more conductance in parallel."""
        return place not in layout.linked

    def heat_into_ends(self, here: Conditions) -> Sequence[Symbol]:
        one, other = here.temperatures
        inward = self.conductance(here.p) * (other - one)
        return [inward, -inward]


class SensorEffect(Effect):
    """A difference between what the sensor reads and the node's temperature."""

    site: ClassVar[Site] = "sensor"
    changes_reading = True

    @abstractmethod
    def error(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        """Reading minus temperature [K]; `state` is `None` for an effect without one."""

    def rate(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        """Time derivative of the sensor's state [K/s], for an effect that has one."""
        return 0.0

    def reading_error(self, here: Conditions) -> Symbol:
        return self.error(here.temperatures[0], here.state, here.p)

    def state_rate(self, here: Conditions) -> Symbol:
        return self.rate(here.temperatures[0], here.state, here.p)


class PairSensorEffect(SensorEffect):
    """A sensor error that comes from another node: place `"a~b"` is the sensor of *a*, disturbed by *b*."""

    site = "pair"
    in_all_pairs = False  # two sensors that each read a share of the other's node: no fault is like that

    @abstractmethod
    def error(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        """Reading minus temperature [K]; `state` is the other node's temperature [degC]."""

    @classmethod
    def places(cls, at: str, layout: NetworkPlaces) -> list[Place]:
        """Pairs of nodes that exchange heat directly, each in the order in which the pattern names it."""
        pairs = _pairs(at, layout)
        if at == EVERYWHERE:
            pairs = [ordered for pair in pairs for ordered in (pair, pair[::-1])]
        return [("~".join(pair), pair) for pair in pairs if edge(*pair) in layout.contacts]

    @classmethod
    def places_in_words(cls, layout: NetworkPlaces) -> str:
        return f'two linked nodes, "a~b" for the sensor of a, of {", ".join(layout.dynamic)}'

    @classmethod
    def like_places(cls, place: str, nodes: Sequence[str]) -> str:
        return _pattern_of_legs(place, nodes) or "~".join(class_of(end) for end in place.split("~"))

    def reading_error(self, here: Conditions) -> Symbol:
        one, other = here.temperatures
        return self.error(one, other, here.p)


class InertialEffect(Effect):
    """An effect with inertia, which follows the heat in its node, or time, but not the temperature.

    Its state is the node's temperature plus an excess, so that it starts a run without any. The heat is that of the
    effect `heat_of`.
    """

    has_state = True

    @abstractmethod
    def excess_rate(self, excess: Symbol, heat: Symbol, p: Values) -> Symbol:
        """Time derivative of state minus temperature [K/s], from that excess [K] and the driving heat [W]."""

    def state_rate(self, here: Conditions) -> Symbol:
        return here.warming + self.excess_rate(self.excess(here), here.heat_of(self.heat_of), here.p)

    @staticmethod
    def excess(here: Conditions) -> Symbol:
        """State minus temperature [K]."""
        return here.state - here.temperatures[0]


class ExcessEffect(InertialEffect, SensorEffect):
    """A sensor error with inertia."""


class ClockEffect(Effect):
    """A time by which readings come late, or early, against the inputs of the same log.

    It is a matter of the log and not of the robot, so it acts where a model is driven by one, and in no FMU and no
    estimator.
    """

    site = "sensor"
    delays_readings = True

    @abstractmethod
    def delay(self, p: Values) -> Symbol:
        """How late the readings come [s]."""

    def reading_delay(self, here: Conditions) -> Symbol:
        return self.delay(here.p)


class BoundaryEffect(Effect):
    """A difference between a prescribed temperature as it is given and as the nodes feel it."""

    site = "boundary"

    @abstractmethod
    def error(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        """What is felt minus what is given [K]; `state` is `None` for an effect without one."""

    def rate(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        """Time derivative of the state [K/s], for an effect that has one."""
        return 0.0

    @classmethod
    def places(cls, at: str, layout: NetworkPlaces) -> list[Place]:
        return [(name, (name,)) for name in matching(at, layout.prescribed)]

    @classmethod
    def places_in_words(cls, layout: NetworkPlaces) -> str:
        names = ", ".join(layout.prescribed)
        return f"one of {names}" if names else "a prescribed temperature; this model has none"

    def prescribed_error(self, here: Conditions) -> Symbol:
        return self.error(here.given, here.state, here.p)

    def state_rate(self, here: Conditions) -> Symbol:
        return self.rate(here.given, here.state, here.p)


def either_sign(parameter: Parameter) -> Parameter:
    """An amplitude as that of a difference, which may be negative; all else as it is."""
    if parameter.off is None or parameter.off > parameter.bounds[0]:
        return parameter
    return replace(parameter, bounds=(2 * parameter.off - parameter.bounds[1], parameter.bounds[1]))


def _pairs(at: str, layout: NetworkPlaces) -> list[tuple[str, str]]:
    """Pairs of dynamic nodes that `"a~b"`, a pattern of it, or `"*"` means."""
    one, _, other = at.partition("~") if at != EVERYWHERE else (EVERYWHERE, "~", EVERYWHERE)
    return expand_pair((one, other), layout.dynamic)


def _pattern_of_legs(place: str, nodes: Sequence[str]) -> str:
    """`{leg}_hip~{leg}_thigh` for a pair on one leg, where there are others like it; else `""`."""
    one, _, other = place.partition("~")
    leg, _, rest = one.partition("_")
    if not rest or not other.startswith(f"{leg}_"):
        return ""
    pattern = ("{leg}_" + rest, "{leg}_" + other[len(leg) + 1 :])
    return "~".join(pattern) if len(expand_pair(pattern, nodes)) > 1 else ""
