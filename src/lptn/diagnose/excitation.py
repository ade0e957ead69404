"""How much happens in logs, and which effects of the catalogue they could reveal; a rule of thumb, no fit is made."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.diagnose.candidates import Candidate, candidates
from lptn.effects import Effect, catalogue
from lptn.logs.resampling import ratio, raw_keys
from lptn.logs.run import Run
from lptn.model.heat_balance import input_column
from lptn.model.model import Model

# --- How much happens in logs: levels of load, standstill, cool-downs, ranges of temperature and speed ---


_BLOCK = 60.0  # s: faster changes of load no temperature follows
_LEVEL = 0.1  # of the largest load: levels less far apart are one
_STILL = 0.05  # of the largest load: below it a robot rests
_LOW = 0.5  # of the largest load: below it a hot node may cool
_STEP = 0.3  # of the largest load from one minute to the next
_COOLS = 1.0  # K in a stretch of little load
_LOADS = {"power": 1.0, "current": 2.0, "torque": 2.0}  # exponent that makes it a heat
_AMBIENT = "temperature.ambient"


@dataclass(frozen=True)
class Excitation:
    """What the runs put the robot through.

    Args:
        minutes: length of all runs together.
        runs: how many there are.
        levels: of load, told apart over one-minute means; 0 if no load is logged.
        still: share of the time at rest.
        cool_downs: stretches of less than half the largest load in which a node cools by 1 K and more.
        steps: jumps of the load from one minute to the next by 30 % of the largest.
        rise: K, how far the hottest node gets above its surroundings, or above the start if those aren't logged.
        spread: K, the range of the difference between nodes; 0 with one node.
        ambient: K, range of the surroundings; 0 if they aren't logged.
        coarse: K, the largest step in which a sensor moves; 0 where all are fine.
        ranges: by input column its least and largest one-minute mean.
        together: by place how closely its speed and its load go together, a correlation; where both are logged.
    """

    minutes: float
    runs: int
    levels: int
    still: float
    cool_downs: int
    steps: int
    rise: float
    spread: float
    ambient: float
    coarse: float
    ranges: Mapping[str, tuple[float, float]]
    together: Mapping[str, float]

    def varies(self, column: str, share: float = 0.1) -> bool:
        """Whether an input's one-minute means differ by a share of the largest."""
        low, high = self.ranges.get(column, (0.0, 0.0))
        return high - low > share * max(abs(low), abs(high)) and high - low > 1e-9

    def as_json(self) -> dict[str, object]:
        """For other programs."""
        ranges = {column: list(ends) for column, ends in self.ranges.items()}
        return self.__dict__ | {"ranges": ranges, "together": dict(self.together)}


def excitation(runs: Sequence[Run], nodes: Sequence[str]) -> Excitation:
    """Measure what happens in runs.

    Args:
        runs: at least one.
        nodes: the model's nodes.
    """
    blocks = [_Blocks(run, nodes) for run in runs]
    most = max((float(each.load.max(initial=0.0)) for each in blocks), default=0.0)
    loads = [each.load / most if most > 0 else np.zeros(0) for each in blocks]
    rests = [load < _STILL for load in loads]
    steady = np.concatenate([_steady(load) for load in loads]) if loads else np.zeros(0)
    ambient = np.concatenate([each.means[_AMBIENT] for each in blocks if _AMBIENT in each.means] or [np.zeros(1)])
    columns = dict.fromkeys(column for each in blocks for column in each.means)
    return Excitation(
        minutes=sum(len(run) * run.step for run in runs) / 60,
        runs=len(runs),
        levels=max(_levels(np.sort(steady)), int(most > 0)),
        still=float(np.mean(np.concatenate(rests))) if most > 0 else 0.0,
        cool_downs=sum(_cool_downs(load < _LOW, each.temperatures) for load, each in zip(loads, blocks, strict=True)),
        steps=sum(int((np.abs(np.diff(load)) > _STEP).sum()) for load in loads),
        rise=max((each.rise for each in blocks), default=0.0),
        spread=max((each.spread for each in blocks), default=0.0),
        ambient=float(np.ptp(ambient)),
        coarse=max((step for run in runs for step in run.resolution.values()), default=0.0),
        ranges={column: _range([each.means[column] for each in blocks if column in each.means]) for column in columns},
        together=_together(blocks, nodes),
    )


class _Blocks:
    """One-minute means of a run: inputs by column, the sum of its heats, temperatures (nodes, blocks)."""

    def __init__(self, run: Run, nodes: Sequence[str]) -> None:
        size = max(1, min(round(_BLOCK / run.step), len(run) // 4 or 1))
        self._size = size
        inputs = {
            name: values for name, values in run.columns.items() if name not in {f"temperature.{n}" for n in nodes}
        }
        self.means = {name: self._mean(values) for name, values in inputs.items()}
        measured = [run.columns[f"temperature.{node}"] for node in nodes if run.has(f"temperature.{node}")]
        self.temperatures = np.array([self._mean(values) for values in measured])
        kinds = [
            {
                node: self._mean(np.abs(inputs[f"{kind}.{node}"]) ** power)
                for node in nodes
                if f"{kind}.{node}" in inputs
            }
            for kind, power in _LOADS.items()
        ]
        self.heats = max(kinds, key=len)  # the first of those that most nodes have
        self.load: FloatArray = np.sum(list(self.heats.values()), axis=0) if self.heats else np.zeros(0)
        self.rise, self.spread = 0.0, 0.0
        known = np.isfinite(self.temperatures)
        if known.any():
            around = self.means.get(_AMBIENT, float(self.temperatures[known].min()))
            self.rise = float(np.nanmax(self.temperatures - around)) if np.isfinite(around).any() else 0.0
            whole = self.temperatures[known.all(axis=1)]
            self.spread = float(np.ptp(whole - whole[:1], axis=1).max()) if len(whole) > 1 else 0.0

    def _mean(self, values: FloatArray) -> FloatArray:
        parts = values[: values.size // self._size * self._size].reshape(-1, self._size)
        known = np.isfinite(parts)
        count = known.sum(axis=1)
        total = np.where(known, parts, 0.0).sum(axis=1)
        return ratio(total, count)


def _steady(load: FloatArray) -> FloatArray:
    """The loads of minutes that are like the one before or the one behind: no minute in which the load changed."""
    indistinguishable = np.abs(np.diff(load)) < _LEVEL / 2
    return (
        load[np.concatenate((indistinguishable, [False])) | np.concatenate(([False], indistinguishable))]
        if load.size > 1
        else load
    )


def _levels(loads: FloatArray) -> int:
    """How many levels a sorted row of loads has, each at least a tenth of the largest above the one before it."""
    count, base = 0, -np.inf
    for load in loads[np.isfinite(loads)]:
        if load - base > _LEVEL:
            count, base = count + 1, load
    return count


def _cool_downs(low: BoolArray, temperatures: FloatArray) -> int:
    """Stretches of little load, of two minutes and more, in which some node cools."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], low.astype(int), [0]))))
    count = 0
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        stretch = temperatures[:, start:stop]
        falls = [row[0] - row[-1] for row in stretch if row.size > 1 and np.isfinite(row[[0, -1]]).all()]
        count += int(max(falls, default=0.0) >= _COOLS)
    return count


def _range(parts: Sequence[FloatArray]) -> tuple[float, float]:
    values = np.concatenate(parts)
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)


def _together(blocks: Sequence[_Blocks], nodes: Sequence[str]) -> dict[str, float]:
    """Correlation of speed and load over one-minute means, by place."""
    found = {}
    for node in nodes:
        own = [each for each in blocks if node in each.heats and f"velocity.{node}" in each.means]
        if not own:
            continue
        speed, load = (
            np.concatenate(part) for part in ([e.means[f"velocity.{node}"] for e in own], [e.heats[node] for e in own])
        )
        if speed.size > 2 and speed.std() > 0 and load.std() > 0:
            found[node] = float(np.corrcoef(speed, load)[0, 1])
    return found


# --- Which effects of the catalogue logs could reveal, and which not and why, by what happens in them; a rule of thumb ---


_NODE = "<node>"
_WARM = 10.0  # K of rise before what bends with temperature shows
_APART = 0.5  # K by which nodes have to move against each other
_AMBIENT_RANGE = 1.0  # K by which the surroundings have to change
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
    used = {instance.effect.key for instance in model.network.effect_instances}
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
    bound_runs = {
        input_column(feature, end) for each in sites for feature in _features(effect, each) for end in _ends(each)
    }
    bound_runs = {column for column in bound_runs if column in seen.ranges}
    if bound_runs and not any(seen.varies(column) for column in bound_runs):
        return _constant(bound_runs, seen)
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
    return "" if seen.ambient >= _AMBIENT_RANGE else f"the surroundings change by {seen.ambient:.2g} K only"


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
