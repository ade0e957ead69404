"""A thermal network: what a model file or a script declares, spread over the robot's places."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from lptn.assembly import Assembly
from lptn.bodies import Conductor
from lptn.declarations import START, EffectDeclaration, Link, LinkDeclaration, NodeDeclaration, Use
from lptn.effect_places import places_for
from lptn.parameters import Unknown
from lptn.places import edge, matching

__all__ = ["START", "EffectDeclaration", "Link", "LinkDeclaration", "Network", "NodeDeclaration", "Use"]


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
    def uses(self) -> list[Use]:
        """Every effect at every place where it acts."""
        return self._assembly.uses

    @property
    def unknowns(self) -> list[Unknown]:
        """All parameters of the model, free and fixed."""
        return self._assembly.unknowns

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

    def around(self, use: Use) -> str | None:
        """The prescribed node that the nodes of a use give their heat to, `None` without any."""
        near = [other for node, other in self.surroundings.values() if node in use.ends]
        return next(iter([*near, *self.prescribed]), None)
