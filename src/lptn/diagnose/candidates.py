"""Candidates: every effect of the catalogue at every place where it can stand; the ambient bias of single runs."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

from lptn.basics.parameters import Parameter
from lptn.basics.places import EVERYWHERE, class_of, in_run, is_of_run, matching, run_label
from lptn.effects import Effect, catalogue
from lptn.effects.ambient_offset import AmbientOffset
from lptn.identify.data import DataSplit
from lptn.model.heat_balance import input_column
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network

_FEWEST = 3  # nodes that share an unseen mass
Words = tuple[tuple[str, str], ...]
"""An effect's options with the words chosen for them, those left out at their defaults."""


@dataclass(frozen=True)
class Site:
    """One place where one effect, at one shape, can be switched on: the unit that is scored.

    Args:
        effect: the effect.
        place: a node, an edge or a group of nodes, as the network names it.
        shape: value of its shape parameter, `None` for an effect without one.
        run: the only run in which it acts; every run by default.
        words: the effect's options.
    """

    effect: type[Effect]
    place: str
    shape: float | None
    run: str = ""
    words: Words = field(default=(), compare=False)  # the same for all sites of an effect

    @property
    def label(self) -> str:
        """What its parameters are named after in the model that holds all sites."""
        return self.effect.key if self.shape is None else f"{self.effect.key}@{self.shape:g}"

    @property
    def amplitude_name(self) -> str:
        """Full name of its amplitude among the unknowns of the model that holds all sites."""
        amplitude = self.effect.amplitude()
        return in_run(f"{self.label}.{'' if amplitude is None else amplitude.name}.{self.place}", self.run)

    def declaration(self) -> EffectDeclaration:
        """The effect at this place, switched off."""
        parameters = tuple(replace(_shaped(p, self.shape).switched_off, share="each") for p in self.effect.parameters)
        return EffectDeclaration(self.effect(**dict(self.words)), self.place, parameters, self.label, run=self.run)


@dataclass(frozen=True)
class Candidate:
    """An effect that may be missing, and where.

    Args:
        effect: the effect.
        at: a node, an edge, a class (`"*_calf"`), or `"*"`; with `"@run"` behind it for an effect of one run.
        places: the places that `at` covers.
        run: the only run in which it acts; every run by default.
        words: the effect's options.
    """

    effect: type[Effect]
    at: str
    places: tuple[str, ...]
    run: str = ""
    words: Words = ()

    @property
    def key(self) -> tuple[str, str]:
        """Effect and place, as reports name them."""
        return self.effect.key, self.at

    @property
    def pattern(self) -> str:
        """The place without the run."""
        return self.at.removesuffix(f"@{run_label(self.run)}") if self.run else self.at

    @property
    def shapes(self) -> tuple[float | None, ...]:
        """The values of the effect's shape at which it is scored; `None` alone for an effect without one."""
        shape = self.effect.shape()
        return shape.grid if shape else (None,)

    def sites(self, shape: float | None) -> list[Site]:
        """Its single places at one shape."""
        return [Site(self.effect, place, shape, self.run, self.words) for place in self.places]

    def declaration(self, amplitude: float | None, shape: float | None) -> EffectDeclaration:
        """The effect switched on, one amplitude shared by all its places."""
        parameters = []
        for parameter in self.effect.parameters:
            on = replace(_shaped(parameter, shape).switched_on, share="all")
            if amplitude is not None and parameter.off is not None and parameter.on is None:
                lower, upper = parameter.bounds
                on = replace(on, value=min(max(amplitude, lower), upper))
            parameters.append(on)
        return EffectDeclaration(self.effect(**dict(self.words)), self.pattern, tuple(parameters), run=self.run)


def candidates(network: Network, columns: Collection[str], runs: Sequence[str] = ()) -> list[Candidate]:
    """Every effect of the catalogue at every place where the network lacks it and the log has its inputs.

    Args:
        network: the network as it stands.
        columns: log columns at hand.
        runs: names of the fitted runs. With two or more of them, effects that may well differ from run to run
            are proposed for each run alone as well.
    """
    proposed = []
    limits = ("", *separate_runs(runs))
    for effect, run in product(catalogue().values(), limits):
        if effect.amplitude() is not None and (effect.per_run or not run):
            proposed += _of_effect(network, effect, columns, run)
    return sorted(proposed, key=lambda candidate: limits.index(candidate.run))


def sites(candidates: Iterable[Candidate]) -> list[Site]:
    """The single places, at each shape of the grid, that candidates are made of."""
    all_sites = (site for candidate in candidates for shape in candidate.shapes for site in candidate.sites(shape))
    return list(dict.fromkeys(all_sites))


def separate_runs(names: Sequence[str]) -> list[str]:
    """What an effect can be confined to: single logs, or the pieces of the one log; nothing if there is but one.

    Args:
        names: of runs; pieces of a split log are `monday#1`, `monday#2`.
    """
    logs = list(dict.fromkeys(name.partition("#")[0] for name in names))
    separate = logs if len(logs) > 1 else list(dict.fromkeys(names))
    return separate if len(separate) > 1 else []


def _of_effect(network: Network, effect: type[Effect], columns: Collection[str], run: str) -> list[Candidate]:
    """One effect at all places, with the first of its options whose inputs the log has anywhere."""
    for words in _wordings(effect):
        places = _free_places(network, effect, words, columns, run)
        if effect.one_place_a_pattern:
            groups = _node_groups(network, places)
        else:
            groups = [(place, [place]) for place in places] if not effect.whole_robot else []
            groups += _groups(effect, places, network)
        if groups:
            return [Candidate(effect, in_run(at, run), tuple(group), run, words) for at, group in groups]
    return []


def _wordings(effect: type[Effect]) -> list[Words]:
    """All choices of an effect's options, the defaults first and as an empty choice."""
    names = list(effect.options)
    chosen = [tuple(zip(names, words, strict=True)) for words in product(*effect.options.values())]
    return [(), *chosen[1:]]


def _free_places(network: Network, effect: type[Effect], words: Words, columns: Collection[str], run: str) -> list[str]:
    declaration = EffectDeclaration(effect(**dict(words)), EVERYWHERE)
    taken = {
        instance.place
        for instance in network.effect_instances
        if instance.effect.key == effect.key and instance.declaration.run == run
    }
    needed = declaration.effect.needed()
    return [
        place
        for place, ends in network.places_for(declaration)
        if place not in taken
        and all(input_column(feature, ends[0]) in columns for feature in needed)
        and effect.makes_a_difference(place, network.layout, _features_of(network, effect.heat_of, ends[0]))
    ]


def _features_of(network: Network, key: str, node: str) -> list[tuple[str, ...]]:
    """The input features of each effect of one key at a node."""
    return [
        instance.effect.needed()
        for instance in network.effect_instances
        if instance.effect.key == key and instance.ends[0] == node
    ]


def _node_groups(network: Network, free: list[str]) -> list[tuple[str, list[str]]]:
    """Patterns of three nodes or more, each as one place: classes of like nodes, and all of them.

    What lies between two nodes is an edge, and needs no mass of its own to be named.
    """
    classes = dict.fromkeys(class_of(name) for name in network.dynamic)
    sizes = {at: len(matching(at, network.dynamic)) for at in classes}
    proper = [at for at, size in sizes.items() if _FEWEST <= size < len(network.dynamic)]
    whole = [EVERYWHERE] if len(network.dynamic) >= _FEWEST and free == [EVERYWHERE] else []
    taken = {instance.place for instance in network.effect_instances if instance.effect.one_place_a_pattern}
    return [(at, [at]) for at in [*proper, *whole] if at not in taken]


def _groups(effect: type[Effect], places: list[str], network: Network) -> list[tuple[str, list[str]]]:
    """Classes of like places, and all of them; a class that is everything is named `"*"`."""
    if effect.whole_robot:
        return [(EVERYWHERE, places)] if places and _covers(effect, EVERYWHERE, places, network) else []
    if len(places) < 2:
        return []
    classes: dict[str, list[str]] = {}
    for place in places:
        classes.setdefault(effect.like_places(place, network.dynamic), []).append(place)
    groups = [(at, group) for at, group in classes.items() if 1 < len(group) < len(places)]
    if effect.in_all_pairs:
        # Where not every node can have the effect, one of the patterns that declare nodes may name those that can.
        patterns = (EVERYWHERE, *(node.pattern for node in network.nodes))
        groups += [(at, places) for at in patterns if _covers(effect, at, places, network)][:1]
    # A pattern that also matches a place where the effect stands already can't be added as it is.
    return [(at, group) for at, group in groups if _covers(effect, at, group, network)]


def _covers(effect: type[Effect], at: str, group: list[str], network: Network) -> bool:
    declaration = EffectDeclaration(effect(), at)
    return {place for place, _ in network.places_for(declaration)} == set(group)


def _shaped(parameter: Parameter, shape: float | None) -> Parameter:
    return replace(parameter, value=shape) if parameter.grid and shape is not None else parameter


# --- Nuisance parameters: an ambient bias in each run, so that no effect stands in for it ---------


def with_ambient_bias(model: Model, data: DataSplit, spread: float) -> Model:
    """The model with a bias of the ambient sensor in each run, a nuisance parameter with a prior.

    A bias of half a kelvin in each run moves all nodes for hours; without this, constant heat or a sensor's offset
    in one run is named for it, and a held-out run judges its own sensor in place of the model. Biases of fitted runs
    are fitted with the rest; those of other runs whenever one is predicted. With one run alone the bias can't be told
    from the model's own parameters, and is left out.

    Args:
        model: the model.
        data: the runs.
        spread: standard deviation of the biases [K]; 0 for none.
    """
    fitted = [segment.run.name for segment in data.fit]
    runs = separate_runs([*fitted, *(segment.run.name for segment in (*data.holdout, *data.test))])
    if spread <= 0 or not runs:
        return model
    places = [name for name, source in model.network.prescribed.items() if not isinstance(source, int)]
    (offset,) = AmbientOffset.parameters
    free = replace(offset, value=0.0, prior=spread)
    held = replace(free, fixed=True)
    biases = [
        EffectDeclaration(AmbientOffset(), place, (free if _is_one_of(run, fitted) else held,), run=run)
        for place in places
        for run in runs
    ]
    return Model(model.network.with_effects(biases))


def _is_one_of(run: str, names: Sequence[str]) -> bool:
    return any(is_of_run(name, run) for name in names)
