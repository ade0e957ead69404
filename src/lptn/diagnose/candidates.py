"""Every catalogue effect at every place where it can stand."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace

from lptn.effects import Effect, LossEffect, catalogue
from lptn.model import input_column
from lptn.network import EffectDeclaration, Network
from lptn.parameters import Parameter
from lptn.places import EVERYWHERE, class_of, expand_pair


@dataclass(frozen=True)
class Site:
    """One place where one effect, at one shape, can be switched on: the unit that is scored.

    Args:
        effect: the effect.
        place: a node or an edge, as the network names it.
        shape: value of its shape parameter, `None` for an effect without one.
    """

    effect: type[Effect]
    place: str
    shape: float | None

    @property
    def label(self) -> str:
        """What its parameters are named after in the model that holds all sites."""
        return self.effect.key if self.shape is None else f"{self.effect.key}@{self.shape:g}"

    def declaration(self) -> EffectDeclaration:
        """The effect at this place, switched off."""
        parameters = tuple(_shaped(p, self.shape).switched_off for p in self.effect.parameters)
        return EffectDeclaration(self.effect(**_options(self.effect)), self.place, parameters, self.label)


@dataclass(frozen=True)
class Candidate:
    """An effect that may be missing, and where.

    Args:
        effect: the effect.
        at: a node, an edge, a class (`"*_calf"`), or `"*"`.
        places: the places that `at` covers.
    """

    effect: type[Effect]
    at: str
    places: tuple[str, ...]

    @property
    def key(self) -> tuple[str, str]:
        """Effect and place, as reports name them."""
        return self.effect.key, self.at

    def declaration(self, amplitude: float | None, shape: float | None) -> EffectDeclaration:
        """The effect switched on, one amplitude shared by all its places."""
        parameters = []
        for parameter in self.effect.parameters:
            on = replace(_shaped(parameter, shape).switched_on, share="all")
            if amplitude is not None and parameter.off is not None and parameter.on is None:
                lower, upper = parameter.bounds
                on = replace(on, value=min(max(amplitude, lower), upper))
            parameters.append(on)
        return EffectDeclaration(self.effect(**_options(self.effect)), self.at, tuple(parameters))


def candidates(network: Network, columns: Collection[str]) -> list[Candidate]:
    """Every effect of the catalogue at every place where the network lacks it and the log can drive it.

    Args:
        network: the network as it stands.
        columns: log columns at hand.
    """
    found = []
    for effect in catalogue().values():
        if effect.amplitude() is None:
            continue
        places = _free_places(network, effect, columns)
        found += [Candidate(effect, place, (place,)) for place in places]
        found += [Candidate(effect, at, tuple(group)) for at, group in _groups(effect, places, network)]
    return found


def sites(found: Iterable[Candidate]) -> list[Site]:
    """The single places, at each shape of the grid, that candidates are made of."""
    unique: dict[Site, None] = {}
    for candidate in found:
        shape = candidate.effect.shape()
        for place in candidate.places:
            for value in shape.grid if shape else (None,):
                unique[Site(candidate.effect, place, value)] = None
    return list(unique)


def _free_places(network: Network, effect: type[Effect], columns: Collection[str]) -> list[str]:
    declaration = EffectDeclaration(effect(**_options(effect)), EVERYWHERE)
    taken = {use.place for use in network.uses if use.effect.key == effect.key}
    if effect.site == "edge":
        taken |= {link.place for link in network.resistors}
    needed = declaration.effect.needed()
    return [
        place
        for place, ends in network.places_for(declaration)
        if place not in taken
        and all(input_column(feature, ends[0]) in columns for feature in needed)
        and _driven_alike(network, effect, ends[0])
    ]


def _driven_alike(network: Network, effect: type[Effect], node: str) -> bool:
    """A factor on a loss matters only where that loss is computed from what the factor is about."""
    if not issubclass(effect, LossEffect) or not effect.needs:
        return True
    losses = [use for use in network.uses if use.effect.key == effect.acts_on and use.ends[0] == node]
    return any(set(effect.needs) <= set(use.effect.needed()) for use in losses)


def _groups(effect: type[Effect], places: list[str], network: Network) -> list[tuple[str, list[str]]]:
    """Classes of like places, and all of them; a class that is everything is named `"*"`."""
    if len(places) < 2:
        return []
    classes: dict[str, list[str]] = {}
    for place in places:
        classes.setdefault(_class_pattern(effect, place, network), []).append(place)
    groups = [(at, group) for at, group in classes.items() if 1 < len(group) < len(places)]
    # A pattern that also matches a place where the effect stands already can't be added as it is.
    return [(at, group) for at, group in [*groups, (EVERYWHERE, places)] if _covers(effect, at, group, network)]


def _covers(effect: type[Effect], at: str, group: list[str], network: Network) -> bool:
    declaration = EffectDeclaration(effect(**_options(effect)), at)
    return len(network.places_for(declaration)) == len(group)


def _class_pattern(effect: type[Effect], place: str, network: Network) -> str:
    """A pattern that matches the place and its like on the other legs."""
    if effect.site != "edge":
        return class_of(place)
    one, other = place.split("~")
    leg, _, rest = one.partition("_")
    if rest and other.startswith(f"{leg}_"):
        pattern = ("{leg}_" + rest, "{leg}_" + other[len(leg) + 1 :])
        if len(expand_pair(pattern, network.dynamic)) > 1:
            return "~".join(pattern)
    return class_of(place)


def _shaped(parameter: Parameter, shape: float | None) -> Parameter:
    return replace(parameter, value=shape) if parameter.grid and shape is not None else parameter


def _options(effect: type[Effect]) -> dict[str, str]:
    return {name: words[0] for name, words in effect.options.items()}
