"""Candidates: every effect of the catalogue at every place where it can stand; what every run may have wrong.

Where several places have an effect in common, each of them may differ: a difference of its own is a candidate there.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from types import SimpleNamespace

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.parameters import Parameter
from lptn.basics.places import EVERYWHERE, class_of, in_run, is_glob, limb_of, matching, run_label
from lptn.effects import Effect, catalogue
from lptn.effects.base import Place, either_sign
from lptn.identify.fitting import Fit
from lptn.logs.resampling import raw_keys
from lptn.model.heat_balance import input_column
from lptn.model.network import EffectDeclaration, Network
from lptn.model.sizes import Sizes
from lptn.simulate.bound_run import default_start, start_from

NONE = 0.01
"""Of its usual size: below it an effect is none."""
USUAL = 2.0
"""Times its typical size that an effect is as often above as below (the scale of Cauchy's density): sizes are stated to
a factor of two or three."""
_OF_A_JOINT = {"torque", "current", "velocity", "powered"}
"""What a log says of a joint as a whole; sun or air that is logged at a place are not its neighbour's."""
_JOINTS = "*_*"  # names such as FR_calf
_ONE_RUN_ONLY = 0.1  # prior odds of what acts in one run and no other, relative to the same in all runs
_LEAST_SHARE = 0.1  # of a mass or time constant that the others have: as little as an own one starts with
_OF_A_STEP = 0.5
"""Share of a log's step. A mass that warms in less is as warm as its node at the end of the step, e⁻² of the difference
aside, and counts as more of the node; each halving of its time constant doubles the Runge-Kutta steps of every fit."""
Words = tuple[tuple[str, str], ...]
"""An effect's options with the words chosen for them, those left out at their defaults."""


@dataclass(frozen=True)
class Candidate:
    """An effect that may be missing, and where.

    Args:
        effect: the effect.
        at: a node, an edge, a class (`"*_calf"`), or `"*"`; with `"@run"` behind it for an effect of one run.
        places: the places that `at` covers.
        run: the only run in which it acts; every run by default.
        words: the effect's options.
        typical: the usual size of its amplitude, in the amplitude's unit: the geometric mean over its places.
        grid: values of the effect's shape at which it is scored, empty for an effect without one.
        shortest: least time constant of a mass that a fit to these steps may try [s]; 0 for what the effect allows.
        difference: whether it is what a place has beside the same effect that it has in common with others.
        common_shape, common_size: of a difference the shape and the amplitude that the place has in common with others.
        one_of_likes: whether it has at one place, beside others like it, what like places have alike.
        windings: for each place the winding whose log columns drive it, where that is not the place itself.
    """

    effect: type[Effect]
    at: str
    places: tuple[str, ...]
    run: str = ""
    words: Words = ()
    typical: float = field(default=1.0, compare=False)  # of the network, as the places are
    grid: tuple[float, ...] = field(default=(), compare=False)  # of the log
    shortest: float = field(default=0.0, compare=False)  # of the log
    difference: bool = False
    common_shape: float = field(default=0.0, compare=False)  # of the fit
    common_size: float = field(default=0.0, compare=False)
    one_of_likes: bool = field(default=False, compare=False)  # of the network
    windings: tuple[str, ...] = field(default=(), compare=False)  # of the network and the log

    @property
    def driven_by(self) -> str:
        """As `EffectDeclaration` says it."""
        return self.windings[0] if len(self.windings) == 1 else EVERYWHERE if self.windings else ""

    @property
    def key(self) -> tuple[str, str]:
        """Effect and place, as reports name them."""
        return self.effect.key, self.at

    @property
    def prior_odds(self) -> float:
        """How often such a thing is met, relative to other candidates: the effect's odds, less for a single run."""
        return self.effect.prior_odds * (_ONE_RUN_ONLY if self.run else 1.0)

    @property
    def amplitude(self) -> Parameter:
        """The parameter that switches the effect off, with the size that is usual at its places."""
        stated = next(parameter for parameter in self.effect.parameters if parameter.off is not None)
        return replace(either_sign(stated) if self.difference else stated, typical=self.typical)

    @property
    def pattern(self) -> str:
        """The place without the run."""
        return self.at.removesuffix(f"@{run_label(self.run)}") if self.run else self.at

    @property
    def shapes(self) -> tuple[float | None, ...]:
        """The values of the effect's shape at which it is scored; `None` alone for an effect without one."""
        return self.grid or (None,)

    def sites(self, shape: float | None) -> dict[str, EffectDeclaration]:
        """What is scored: the effect switched off at each place, at one shape, by the name of its amplitude there."""
        effect, amplitude, found = self.effect(**dict(self.words)), self.effect.amplitude(), {}
        stated = (replace(one.switched_off, share="each") for one in self.effect.stated(self.difference))
        parameters = tuple(replace(one, value=shape) if one.grid and shape is not None else one for one in stated)
        for place, winding in zip(self.places, self.windings or ("",) * len(self.places), strict=True):
            site = EffectDeclaration(
                effect, place, parameters, driven_by=winding, run=self.run, difference=self.difference
            )
            site = site if shape is None else replace(site, label=f"{site.name}@{shape:g}")
            found[site.shared_name(amplitude.name if amplitude else "")] = site
        return found

    def declaration(
        self, amplitude: float | None = None, shape: float | None = None, start: float = 0.3
    ) -> EffectDeclaration:
        """The effect as it is fitted, one amplitude shared by all its places; sizes and shapes have priors.

        Where a place has its own in place of what the others have (`Effect.adds_up`), it starts larger or smaller, or
        where it is all or nothing later or earlier, than they by what the score says.

        Args:
            amplitude: where its size starts, beside where it is off; `start` by default.
            shape: where its shape starts; the middle of its grid by default.
            start: share of the usual size, near none, where the search for one begins.
        """
        shape = self.grid[len(self.grid) // 2] if shape is None and self.grid else shape
        size = start * self.typical if amplitude is None else amplitude
        size = math.copysign(max(abs(size), NONE * self.typical), size)
        difference = self.difference and self.effect.adds_up()
        if self.difference and not difference and shape is not None:
            if self.amplitude.on is None:
                shape, size = self.common_shape, max(self.common_size + size, _LEAST_SHARE * self.common_size)
            else:
                shape = max(self.common_shape + size * shape, _LEAST_SHARE * shape)
        parameters = []
        for one in self.effect.stated(difference):
            lower, upper = one.bounds
            if (none := one.off) is not None:
                one = replace(one, typical=min(max(self.typical, lower), upper)).switched_on
                if one.on is None:
                    one = replace(one, value=min(max(size, lower), upper), prior=(none, USUAL * self.typical))
            elif one.grid and not one.fixed:
                lower = min(max(lower, self.shortest if one.unit == "s" else lower), upper)
                middle = min(max(float(np.exp(np.mean(np.log(self.grid or one.grid)))), lower), upper)
                value, prior = max(one.value if shape is None else shape, lower), (middle, middle)
                one = replace(one, value=value, grid=self.grid or one.grid, bounds=(lower, upper), prior=prior)
            parameters.append(replace(one, share="all"))
        effect = self.effect(**dict(self.words))
        return EffectDeclaration(
            effect, self.pattern, tuple(parameters), driven_by=self.driven_by, run=self.run, difference=difference
        )


def candidates(
    network: Network,
    columns: Collection[str],
    runs: Sequence[str] = (),
    *,
    step: float | None = None,
    duration: float | None = None,
    rms: Mapping[str, float] | None = None,
    rates: FloatArray | None = None,
    effects: Collection[type[Effect]] | None = None,
    single: bool = False,
) -> list[Candidate]:
    """Every effect of the catalogue at every place where the network lacks it and the log has its inputs.

    A place that has the effect in common with others is asked for its own difference, see `EffectDeclaration`.

    Args:
        network: the network as it stands.
        columns: log columns at hand.
        runs: names of the fitted runs. With two or more of them, effects that may well differ from run to run
            are proposed for each run alone as well.
        step: s, of the readings that are scored; with `duration` it says which time constants they can show. Those
            that the effects state by default, which are for logs of an hour.
        duration: s, of the longest run.
        rms: root mean square of each column. With it, heat that columns drive is expected no larger than its place can
            bear: at a rotor's speed the friction of a robot's joint would melt it.
        rates: as for `lptn.model.sizes.Sizes`.
        effects: those to propose; the whole catalogue by default.
        single: whether at one place each, and without a usual size, which takes most of the time.
    """
    sizes, proposed = None if single else Sizes(network, rates), []
    for run in ("", *separate_runs(runs)):
        for effect in catalogue().values():
            if (effects is not None and effect not in effects) or effect.amplitude() is None:
                continue
            if run and not effect.per_run:
                continue
            grid, shortest = _grid(effect.shape(), step, duration), 0.0 if step is None else _OF_A_STEP * step
            for one in [
                *_of_effect(network, effect, columns, run, single),
                *_differences(network, effect, columns, run),
            ]:
                likes = effect.alike and network.sets_apart(EffectDeclaration(effect(), one.pattern))
                usual = 1.0 if sizes is None else _usual_size(one, network, sizes, rms)
                proposed.append(replace(one, typical=usual, grid=grid, shortest=shortest, one_of_likes=likes))
    return proposed


def possible_effects(
    fit: Fit,
    columns: Collection[str],
    names: Sequence[str] = (),
    effects: Collection[type[Effect]] | None = None,
    single: bool = False,
) -> list[Candidate]:
    """Every effect that a fitted model may lack, with time constants that its runs can show.

    Args:
        fit: the fitted model.
        columns: log columns at hand.
        names: of runs, in each of which alone an effect may act; the fitted ones by default.
        effects, single: as for `candidates`.
    """
    model, runs = fit.model, [bound.run for bound in fit.problem.bound_runs]
    columns, names = set(columns), names or [run.name for run in runs]
    step, duration = max(run.step for run in runs), max(len(run) * run.step for run in runs)
    if single:
        return candidates(model.network, columns, names, step=step, duration=duration, effects=effects, single=True)
    squares = {column: [np.nanmean(run.columns[column] ** 2) for run in runs] for column in columns}
    rates = []  # of each run, at its mean readings and inputs
    for bound in fit.problem.bound_runs:
        readings = [row[np.isfinite(row)] for row in bound.measured]
        firsts = zip(readings, default_start(model, bound).tolist(), strict=False)
        means = (float(row.mean()) if row.size else first for row, first in firsts)
        states = start_from(model, bound, dict(zip(model.nodes, means, strict=True)))
        values = model.in_run(bound.run.name, fit.point.values)
        rates.append(model.state_jacobian(states, bound.inputs.mean(axis=1), values).full())
    return candidates(
        model.network,
        columns,
        names,
        step=step,
        duration=duration,
        rms={column: float(np.sqrt(np.mean(of_runs))) for column, of_runs in squares.items()},
        rates=np.asarray(np.mean(rates, axis=0)),
        effects=effects,
    )


def separate_runs(names: Sequence[str]) -> list[str]:
    """What an effect can be confined to: single logs, or the pieces of the one log; nothing if there is but one.

    Args:
        names: of runs; pieces of a split log are `monday#1`, `monday#2`.
    """
    logs = list(dict.fromkeys(name.partition("#")[0] for name in names))
    separate = logs if len(logs) > 1 else list(dict.fromkeys(names))
    return separate if len(separate) > 1 else []


def _of_effect(
    network: Network, effect: type[Effect], columns: Collection[str], run: str, single: bool
) -> list[Candidate]:
    """One effect at all places, with the first of its options whose inputs the log has anywhere.

    Parts that no column names are driven by the columns of the one winding that each is linked to: a joint's friction,
    iron loss and stray losses warm its housing or gearbox as well, and a log names them after the joint, which is the
    winding where winding and housing are apart.
    """
    if effect.one_place_a_pattern:
        return [Candidate(effect, in_run(at, run), (at,), run) for at in _node_groups(network)]
    choices = [tuple(zip(effect.options, words, strict=True)) for words in product(*effect.options.values())]
    for words in [(), *choices[1:]]:  # the defaults first, as an empty choice
        own = effect(**dict(words))
        free = _places_without(network, effect, words, run)
        driving = {place: ends[0] if _logs(columns, own, ends[0]) else "" for place, ends in free}
        logged = {key.partition(".")[0] for feature in own.needed() for key in raw_keys(input_column(feature, "joint"))}
        winding_of = {}
        if own.site == "node" and logged and logged <= _OF_A_JOINT:
            windings = {place: network.windings_at(ends[0]) for place, ends in free if not driving[place]}
            winding_of = {at: of[0] for at, of in windings.items() if len(of) == 1 and _logs(columns, own, *of)}
        proposals = []
        for places in ([place for place, node in driving.items() if node], list(winding_of)):
            groups = [(place, [place]) for place in places] if not effect.whole_robot else []
            groups += [] if single else _groups(effect, places, network, run)
            for at, group in groups:
                driven = tuple(winding_of[place] for place in group if place in winding_of)
                proposals.append(Candidate(effect, in_run(at, run), tuple(group), run, words, windings=driven))
        if proposals:
            return proposals
    return []


def _grid(shape: Parameter | None, step: float | None, duration: float | None) -> tuple[float, ...]:
    """Values of a shape to score: an effect's grid of time constants goes as far as the log is longer than an hour.

    Time constants below half a step act within it, those above the duration are a ramp.
    """
    if shape is None or shape.unit != "s" or step is None or duration is None:
        return shape.grid if shape else ()
    grid = list(shape.grid)
    ratio = (grid[-1] / grid[0]) ** (1 / (len(grid) - 1)) if len(grid) > 1 else 4.0
    slowest = grid[-1] * duration / 3600.0  # effects state theirs for logs of an hour
    while grid[-1] * ratio <= slowest:
        grid.append(grid[-1] * ratio)
    return tuple(value for value in grid if _OF_A_STEP * step <= value <= duration) or (max(grid[0], step),)


def _usual_size(
    one: Candidate, network: Network, sizes: Sizes, rms: Mapping[str, float] | None, most_rise: float = 30.0
) -> float:
    """Of a candidate's amplitude, the geometric mean over its places.

    What would warm its place by more than `most_rise` [K] in the long run, at its usual size, is expected smaller.
    """
    ends, effect = dict(network.places_for(EffectDeclaration(one.effect(), one.pattern))), one.effect(**dict(one.words))
    amplitude, usual = next(own for own in effect.parameters if own.off is not None), []
    for place, winding in zip(one.places, one.windings or ("",) * len(one.places), strict=True):
        size = abs(sizes.typical(amplitude, [ends[place]]))
        if rms is not None and effect.site == "node" and not effect.has_state:
            driving = winding or ends[place][0]
            inputs = {feature: rms[input_column(feature, driving)] for feature in effect.needed()}
            p = {own.name: size if own is amplitude else own.value for own in effect.parameters}
            here = SimpleNamespace(temperatures=(25.0,), inputs=SimpleNamespace(**inputs), p=SimpleNamespace(**p))
            heat = abs(float(effect.heat_into_ends(here)[0])) if inputs else 0.0
            size *= min(1.0, most_rise * sizes.conductance(ends[place]) / max(heat, 1e-12))
        usual.append(math.log(size))
    return math.exp(sum(usual) / len(usual))


def _places_without(network: Network, effect: type[Effect], words: Words, run: str) -> list[Place]:
    """Places where an effect may act and does not, yet."""
    taken = {
        instance.place
        for instance in network.effect_instances
        if instance.effect.key == effect.key and instance.declaration.run == run
    }
    driving: dict[str, list[tuple[str, ...]]] = {}  # input features of the effects whose heat it changes, by node
    for instance in network.effect_instances:
        if instance.effect.key == effect.heat_of:
            driving.setdefault(instance.ends[0], []).append(instance.effect.needed())
    return [
        (place, ends)
        for place, ends in network.places_for(EffectDeclaration(effect(**dict(words)), EVERYWHERE))
        if place not in taken and effect.makes_a_difference(place, network, driving.get(ends[0], []))
    ]


def _logs(columns: Collection[str], effect: Effect, node: str) -> bool:
    """Whether a log has what an effect needs of a node."""
    return all(input_column(feature, node) in columns for feature in effect.needed())


def _differences(network: Network, effect: type[Effect], columns: Collection[str], run: str) -> list[Candidate]:
    """What single places have beside an effect that they have in common with others, in all runs."""
    amplitude = effect.amplitude()
    alike = effect.whole_robot or effect.one_place_a_pattern  # which no place has for itself
    if run or alike or amplitude is None:
        return []
    differing = {
        instance.place
        for instance in network.effect_instances
        if instance.effect.key == effect.key and instance.declaration.difference
    }
    common = {
        instance.place: instance
        for instance in network.in_common(effect.key)
        if instance.place not in differing
        and instance.declaration.driven_by in ("", EVERYWHERE)
        and _logs(columns, instance.effect, instance.driven_by)
    }
    shape = effect.shape()
    values = [parameter.value for parameter in network.parameters]
    return [
        Candidate(
            effect,
            place,
            (place,),
            words=tuple(instance.effect.chosen.items()),
            difference=True,
            common_shape=values[instance.parameters[shape.name]] if shape else 0.0,
            common_size=values[instance.parameters[amplitude.name]],
            windings=() if instance.driven_by == instance.ends[0] else (instance.driven_by,),
        )
        for place, instance in common.items()
    ]


def _patterns(network: Network) -> list[str]:
    """Patterns of nodes that may have something in common: all, those that the model's declarations use, all joints.

    The name of a joint is of two words, `FR_calf`; where a computer or a trunk has such a name too, it is no pattern.
    """
    own = [node.pattern for node in network.nodes] + [declared.at for declared in network.effects]
    joints = matching(_JOINTS, network.dynamic)
    alone = [name for name in joints if len(matching(class_of(name), network.dynamic)) == 1]
    return list(dict.fromkeys([EVERYWHERE, *filter(is_glob, own), *([] if alone else [_JOINTS])]))


def _node_groups(network: Network, fewest: int = 3) -> list[str]:
    """Patterns of several nodes, each as one place that they share: classes of like nodes, and patterns of the model.

    What lies between two nodes is an edge, and needs no mass of its own to be named.
    """
    taken = [frozenset(instance.ends) for instance in network.effect_instances if instance.effect.one_place_a_pattern]
    classes = [class_of(name) for name in network.dynamic]
    covered = {at: frozenset(matching(at, network.dynamic)) for at in [*classes, *_patterns(network)]}
    groups = _one_pattern_a_set({at: nodes for at, nodes in covered.items() if nodes not in taken}, network.dynamic)
    return [at for at in groups if len(covered[at]) >= fewest]


def _groups(effect: type[Effect], places: list[str], network: Network, run: str) -> list[tuple[str, list[str]]]:
    """Several places at once: classes of like places, and patterns of the model."""

    def covers(at: str) -> frozenset[str]:
        return frozenset(place for place, _ in network.places_held(EffectDeclaration(effect(), at, run=run)))

    if effect.single_defect:
        return []
    if effect.whole_robot:
        return [(EVERYWHERE, places)] if places and covers(EVERYWHERE) == set(places) else []
    # A pattern that also matches a place where the effect stands already, or a pair unlike the others, is no name.
    classes: dict[str, set[str]] = {}
    for place in places:
        classes.setdefault(effect.like_places(place, network.dynamic), set()).add(place)
    covered = {at: covers(at) for at, group in classes.items() if len(group) > 1 and covers(at) == group}
    if effect.per_run and not effect.measurement_error:  # what may befall a leg as a whole: cloth, mud, wind
        limbs = dict.fromkeys(map(limb_of, places))
        covered |= {at: group for at in limbs if len(group := covers(at)) > 1 and group < set(places)}
    if effect.in_all_pairs:
        covered |= {at: group for at in _patterns(network) if len(group := covers(at)) > 1 and group <= set(places)}
    else:
        covered = {at: group for at, group in covered.items() if group < set(places)}
    groups = _one_pattern_a_set(covered, places)
    return [(at, [place for place in places if place in covered[at]]) for at in groups]


def _one_pattern_a_set(covered: Mapping[str, frozenset[str]], places: Sequence[str]) -> list[str]:
    """Of patterns that cover the same places the first; `"*"` for what covers all, which comes last."""
    first: dict[frozenset[str], str] = {}
    whole = frozenset(places)
    for at in sorted(covered, key=lambda at: (covered[at] == whole, at != EVERYWHERE and covered[at] == whole)):
        first.setdefault(covered[at], at)
    return list(first.values())


# --- Prior odds: how often a candidate occurs, relative to the others -------------------------------------------


OCCAM = 20.0
"""Times less probable than the best, from which on a model is out of Occam's window [MadiganRaftery1994]. On measured
logs no verdict changes with 13 or 30."""


def in_occams_window(probabilities: FloatArray) -> list[int]:
    """Numbers of the models that the most probable one does not rule out, the most probable first."""
    order = np.argsort(-probabilities, kind="stable")
    return [int(number) for number in order if probabilities[number] * OCCAM >= probabilities[order[0]]]


_ERRORS_ALIKE = 0.1
"""How usual the same error of several sensors is beside an error of one. Defects are of single sensors; to drift
alike, or to be off alike, they need a cause in common, such as the supply of all their bridges."""
_ONE_OF_LIKES = 0.3
"""How usual it is of one place alone, beside others like it, to have what follows from how it is built: as other rare
things are (`Effect.prior_odds`). Like parts are painted alike, and all windings are copper: a joint that loses more
heat than its likes is in a draught rather than the only one that radiates."""


def log_priors(candidates: Sequence[Candidate]) -> FloatArray:
    """Logarithms of the probabilities, beforehand, that it is this candidate that is missing, shape (candidates,).

    An effect's odds are split over its levels (everywhere, a class of nodes, one node), evenly but for errors of
    sensors and for what like places have alike; then evenly over the places of a level. Those of single runs likewise.
    """
    weights = np.zeros(len(candidates))
    for effect in {candidate.effect: None for candidate in candidates}:
        own = {k: candidate for k, candidate in enumerate(candidates) if candidate.effect is effect}
        most = max(len(candidate.places) for candidate in own.values())
        levels = {k: (bool(candidate.run), *_level(candidate, most)) for k, candidate in own.items()}
        for k, (of_run, _, share) in levels.items():
            whole = sum(other[-1] for other in set(levels.values()) if other[0] == of_run)
            weights[k] = own[k].prior_odds * share / whole / list(levels.values()).count(levels[k])
    return np.asarray(np.log(weights / weights.sum()))


def _level(candidate: Candidate, most: int) -> tuple[str, float]:
    """The level of a candidate's place, and how often it occurs relative to the effect's other places."""
    if len(candidate.places) > 1:
        level = "all" if candidate.pattern == EVERYWHERE or len(candidate.places) == most else "class"
    else:
        level = "one of likes" if candidate.one_of_likes else "one"
    if candidate.effect.measurement_error and level != "one":
        return level, _ERRORS_ALIKE
    return level, _ONE_OF_LIKES if level == "one of likes" else 1.0


# --- What every log has wrong in each run, so that no effect stands in for it ------------------------------


AMBIENT_ERROR = 0.3
"""K, one standard deviation: how far an ambient sensor may be off in each run where nothing else is known of it. So
much is allowed to a platinum thermometer of class B at 0 °C [IEC60751], and air a metre away differs by as much."""
TORQUE_ERROR = 0.015
"""Share, one standard deviation: how far a joint's torque or current may be off in each run where nothing else is
known of it. Magnets lose 0.1 % of their flux a kelvin (`lptn.effects.torque_constant_drop`), so that of two runs of
which one is 15 K warmer the torques that currents stand for differ by as much. Losses are off by twice that. Of four
rough legs no verdict changed with 1.0 and 2.3 % (`tests/benchmarks/verdict_sensitivity.py --tiers rough --most 1`)."""
SURFACE_ERROR = 0.03
"""Share, one standard deviation: how far a surface's loss to the air may be off in each run where nothing else is known
of it. In still air it goes with the fourth root of how much warmer the surface is [IncroperaDeWitt], so that of two
runs of which one is an eighth hotter the conductances differ by as much, and a room is not always equally still. Of
six sound legs without lumps two were told to lose 9 % less in one run with none of it, none with 3 or 5 %; with 5 %
a surface that loses 30 % more in one run no longer shows in steps of 1 K (`tests/benchmarks/verdict_trial.py`)."""
