"""Which effects of the catalogue logs could reveal, and which not and why, by what happens in them; a rule of thumb."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from lptn.check.excitation import Excitation
from lptn.diagnose.candidates import Candidate, candidates
from lptn.effects import Effect, catalogue
from lptn.logs import Run
from lptn.logs.features import raw_keys
from lptn.model import Model, input_column

_NODE = "<node>"
_WARM = 10.0  # K of rise before what bends with temperature shows
_APART = 0.5  # K by which nodes have to move against each other
_AMBIENT = 1.0  # K by which the surroundings have to change
_LONG = 30.0  # min in which a sensor can drift
_ALIKE = 0.97  # correlation beyond which speed and load are one thing


@dataclass(frozen=True)
class Revealed:
    """What logs could say of one effect.

    Args:
        effect: its key.
        could: whether they could reveal it.
        why: why not; '' where they could.
        places: at how many places it was looked for.
    """

    effect: str
    could: bool
    why: str
    places: int


def revealed(model: Model, runs: Sequence[Run], seen: Excitation) -> list[Revealed]:
    """Every effect of the catalogue that the model does not have everywhere, with what the runs could say of it.

    The rules look at what was logged and at what happened, and at no model's sensitivities: what passes may still be
    beyond the data, which `lptn diagnose` works out.

    Args:
        model: the model as it stands.
        runs: at least one.
        seen: what happens in them.
    """
    columns = set.intersection(*(set(run.columns) for run in runs)) | set(model.inputs)
    found: dict[str, list[Candidate]] = {}
    for candidate in candidates(model.network, columns, [run.name for run in runs]):
        found.setdefault(candidate.effect.key, []).append(candidate)
    used = {use.effect.key for use in model.network.uses}
    left_out = (note.partition(": ")[0] for run in runs for note in run.notes if "has gaps, and" in note)
    spared = {column for names in left_out for column in names.split(", ")}
    told = []
    for key, effect in catalogue().items():
        if effect.amplitude() is None:
            continue
        sites = found.get(key, [])
        if not sites and key in used:
            continue
        why = _why_not(effect, sites, seen) if sites else _not_logged(effect, model, columns, spared)
        why = why or ("" if sites else "the model has no place for it")
        told.append(Revealed(key, not why, why, len({place for each in sites for place in each.places})))
    return told


def _why_not(effect: type[Effect], sites: Sequence[Candidate], seen: Excitation) -> str:
    """What is missing for an effect to show, in a few words; '' if nothing is."""
    drives = {
        input_column(feature, end) for each in sites for feature in _features(effect, each) for end in _ends(each)
    }
    drives = {column for column in drives if column in seen.ranges}
    if drives and not any(seen.varies(column) for column in drives):
        return _constant(drives, seen)
    rule = _RULES.get(effect.key)
    return rule(seen, {place for each in sites for place in each.places}) if rule else ""


def _features(effect: type[Effect], candidate: Candidate) -> tuple[str, ...]:
    return effect(**dict(candidate.words)).needed()


def _ends(candidate: Candidate) -> set[str]:
    return {end for place in candidate.places for end in place.split("~")}


def _not_logged(effect: type[Effect], model: Model, columns: set[str], spared: set[str]) -> str:
    """The columns that an effect would need, where the log has none of them."""
    choices: list[tuple[str, ...]] = [(word,) for word in effect.options.get("input", ())]
    choices = choices or [effect.needs]
    if not any(choices):
        return ""
    lacking = []
    for features in choices:
        keys = dict.fromkeys(key for feature in features for key in raw_keys(input_column(feature, _NODE)))
        absent = [key for key in keys if not columns.intersection(_at_nodes(key, model))]
        own = {column for feature in features for column in _at_nodes(input_column(feature, _NODE), model)}
        if own & columns or not (absent or own & spared):
            return ""
        there = [key for key in absent if spared.intersection(_at_nodes(key, model))]
        if there == absent:
            return f"logged with gaps, so left out: {' and '.join(absent or keys)}"
        lacking.append(" and ".join(key for key in absent if key not in there))
    return f"not logged: {' or '.join(dict.fromkeys(lacking))}"


def _at_nodes(key: str, model: Model) -> set[str]:
    return {key.replace(_NODE, node) for node in model.nodes}


def _constant(columns: set[str], seen: Excitation) -> str:
    one = min(columns)
    low, high = seen.ranges[one]
    more = " and its like" if len(columns) > 1 else ""
    if max(abs(low), abs(high)) < 1e-9:
        return f"{one}{more} is 0 throughout"
    return f"{one}{more} hardly changes: {low:.3g} to {high:.3g} from minute to minute"


Rule = Callable[[Excitation, set[str]], str]


def _warm(seen: Excitation, _: set[str]) -> str:
    return "" if seen.rise >= _WARM else f"the hottest node gets only {seen.rise:.2g} K above its surroundings"


def _bends(seen: Excitation, places: set[str]) -> str:
    if said := _warm(seen, places):
        return said
    return "" if seen.cool_downs or seen.levels > 1 else "one level of load and no cool-down"


def _jumps(seen: Excitation, _: set[str]) -> str:
    return "" if seen.steps or seen.cool_downs else "no jump of the load from one minute to the next"


def _rests(seen: Excitation, _: set[str]) -> str:
    if seen.cool_downs or seen.still > 0.02 or seen.levels > 1:
        return ""
    return "no standstill and one level of load: it looks like more heat"


def _moves(seen: Excitation, places: set[str]) -> str:
    own = [seen.together[place] for place in places if place in seen.together]
    if own and min(own) > _ALIKE:
        return f"speed and load go together (correlation {min(own):.2f}): it looks like more copper loss"
    return ""


def _apart(seen: Excitation, _: set[str]) -> str:
    enough = max(_APART, 2 * seen.coarse)
    return (
        "" if seen.spread >= enough else f"the nodes' temperatures differ by {seen.spread:.2g} K more or less, no more"
    )


def _outdoors(seen: Excitation, _: set[str]) -> str:
    return "" if seen.ambient >= _AMBIENT else f"the surroundings change by {seen.ambient:.2g} K only"


def _long(seen: Excitation, _: set[str]) -> str:
    return "" if seen.minutes >= _LONG else f"{seen.minutes:.3g} min are too short for a drift"


def _several(seen: Excitation, places: set[str]) -> str:
    return "" if seen.runs > 1 or len(places) > 1 else "one run and one place: a fitted parameter takes it up"


_RULES: Mapping[str, Rule] = {
    "radiation": _bends,
    "natural_convection": _bends,
    "resistance_rise": _bends,
    "torque_constant_drop": _bends,
    "second_mass": _jumps,
    "shared_mass": _jumps,
    "sensor_lag": _jumps,
    "clock_offset": _jumps,
    "hot_spot": _jumps,
    "sensor_offset": _rests,
    "constant_heat": _rests,
    "ambient_offset": _rests,
    "coulomb_friction": _moves,
    "viscous_friction": _moves,
    "iron_loss": _moves,
    "gear_loss": _moves,
    "conduction": _apart,
    "sensor_position": _apart,
    "ambient_lag": _outdoors,
    "sensor_drift": _long,
    "loss_scale": _several,
    "surface_scale": _several,
}
