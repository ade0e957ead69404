"""Places and unknowns of a network, worked out from its declarations."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from lptn.bodies import Bodies
from lptn.declarations import RUN, EffectDeclaration, Link, LinkDeclaration, NodeDeclaration, Use
from lptn.effect_places import places_in_words
from lptn.elements import Element
from lptn.errors import InputError
from lptn.parameters import Parameter, Unknown
from lptn.places import class_of, edge, expand_pair, in_run, is_glob, matching, mirrored, run_label

if TYPE_CHECKING:
    from lptn.network import Network

_NO_NAME = re.compile(r"[\s.~{}]|^$")


class Assembly:
    """Works out places and unknowns of a network, in the order of its declarations."""

    def __init__(self, origin: str, values: Mapping[str, float]) -> None:
        self.origin, self.values = origin, values
        self.unknowns: list[Unknown] = []
        self.capacities: dict[str, int] = {}
        self.prescribed: dict[str, str | int] = {}
        self.links: list[Link] = []
        self.uses: list[Use] = []
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
            self._index[name] = len(self.unknowns)
            if name in self.values:
                declared = self._revalued(name, declared, self.values[name])
            mirror = None if other is None else in_run(f"{prefix}.{other}", run)
            self.unknowns.append(Unknown(name, declared, mirror))
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
            use = Use(effect, place, ends, indices, indicator)
            if use.label in self._labels:
                raise InputError(
                    self.origin, where, f"a second {use.name} at {place}", "each effect once at each place"
                )
            self._labels.add(use.label)
            self.uses.append(use)
