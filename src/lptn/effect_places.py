"""Where an effect of each kind of site can stand in a network."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lptn.declarations import EffectDeclaration
from lptn.effects import ExcessEffect, LossEffect
from lptn.places import EVERYWHERE, edge, expand_pair, matching

if TYPE_CHECKING:
    from lptn.network import Network

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
