"""What happens in logs, measured, and which effects of the catalogue could show in them; no fit is made.

What is measured is `lptn.effects.excitation.Excitation`; what an effect needs of it, each effect says itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.diagnose.candidates import Candidate, candidates
from lptn.diagnose.fit_statistics import BLOCK
from lptn.effects import Effect, catalogue
from lptn.effects.excitation import CHANGE, ZERO, Excitation
from lptn.logs.channels import spans
from lptn.logs.resampling import means_of_blocks, raw_keys
from lptn.logs.run import Run
from lptn.model.heat_balance import input_column
from lptn.model.model import Model

# --- What happens in logs: levels of load, standstill, cool-downs, ranges of temperature and speed ------

NOT_LOGGED = "not logged: "
"""How the reason of an effect begins that lacks columns of the log."""

_LOADS = {"power": 1.0, "current": 2.0, "torque": 2.0}  # exponent that makes it a heat


def excitation(
    runs: Sequence[Run],
    nodes: Sequence[str],
    *,
    still: float = 0.05,
    low: float = 0.5,
    jump: float = 0.3,
    cools: float = 1.0,
) -> Excitation:
    """Measure what happens in runs.

    Args:
        runs: at least one.
        nodes: the model's nodes.
        still: share of the largest load's heat, of all nodes together, below which a robot rests, but for what holds
            its weight and what sensors read.
        low: share of a node's largest below which what had settled cools to half its rise.
        jump: share of a node's largest from one minute to the next that is beyond what a gait makes.
        cools: K in a time of little load: a step of a coarse sensor.
    """
    minutes = [_Minutes(run, nodes) for run in runs]
    most = max(float(own.load.max(initial=0.0)) for own in minutes)
    loads = [own.load / most if most > 0 else np.zeros(0) for own in minutes]
    # Of a robot whose joints work in turns each has its own levels; what one sees most of is what logs can show.
    levels, cool_downs, steps = int(most > 0), 0, 0
    for node in nodes:
        heated = [own for own in minutes if node in own.heats]
        largest = max((float(own.heats[node].max(initial=0.0)) for own in heated), default=0.0)
        if largest > 0:
            of_node = [own.heats[node] / largest for own in heated]
            levels = max(levels, _levels(of_node))
            lows = zip(of_node, heated, strict=True)
            cool_downs = max(cool_downs, sum(_cool_downs(load < low, own.cooling(node), cools) for load, own in lows))
            steps = max(steps, sum(int((np.abs(np.diff(load)) > jump).sum()) for load in of_node))
    means: dict[str, list[FloatArray]] = {}
    for own in minutes:
        for column, values in own.means.items():
            means.setdefault(column, []).append(values[np.isfinite(values)])
    ranges = {column: np.concatenate(values) for column, values in means.items()}
    together = {}
    for node in nodes:
        key = f"velocity.{node}"
        logged = [own for own in minutes if key in own.means and node in own.heats]
        both = [np.array([own.means[key], own.heats[node]]) for own in logged]
        speed, load = np.hstack([np.zeros((2, 0)), *both])
        if speed.size > 2 and speed.std() > 0 and load.std() > 0:
            together[node] = float(np.corrcoef(speed, load)[0, 1])
    return Excitation(
        minutes=sum(len(run) * run.step for run in runs) / 60,
        runs=len(runs),
        levels=levels,
        still=float(np.mean(np.concatenate(loads) < still)) if most > 0 else 0.0,
        cool_downs=cool_downs,
        steps=steps,
        rise=max(own.rise for own in minutes),
        spread=max(own.spread for own in minutes),
        ambient=max((float(np.ptp(air)) for own in minutes for air in own.surroundings), default=0.0),
        coarse=max((step for run in runs for step in run.resolution.values()), default=0.0),
        ranges={key: (float(own.min()), float(own.max())) if own.size else (0.0, 0.0) for key, own in ranges.items()},
        together=together,
    )


class _Minutes:
    """One-minute means of a run: inputs by column, heats of loads and their sum, temperatures (nodes, minutes)."""

    def __init__(self, run: Run, nodes: Sequence[str]) -> None:
        size = max(1, min(round(BLOCK / run.step), len(run) // 4 or 1))
        own = {f"temperature.{node}" for node in nodes}
        inputs = {name: values for name, values in run.columns.items() if name not in own}
        self.means = {name: means_of_blocks(values, size) for name, values in inputs.items()}
        # Whatever it is called: a temperature that is given and not predicted.
        self.surroundings = [means for name, means in self.means.items() if name.startswith("temperature.")]
        measured = {node: run.columns[f"temperature.{node}"] for node in nodes if run.has(f"temperature.{node}")}
        self._rows = {node: row for row, node in enumerate(measured)}
        self.temperatures = np.array([means_of_blocks(values, size) for values in measured.values()])
        kinds = [
            {
                node: means_of_blocks(np.abs(inputs[f"{kind}.{node}"]) ** power, size)
                for node in nodes
                if f"{kind}.{node}" in inputs
            }
            for kind, power in _LOADS.items()
        ]
        self.heats = max(kinds, key=len)  # the first of those that most nodes have
        self.load: FloatArray = np.sum(list(self.heats.values()), axis=0) if self.heats else np.zeros(0)
        self.rise, self.spread = 0.0, 0.0
        finite = np.isfinite(self.temperatures)
        if finite.any():
            lowest = float(self.temperatures[finite].min())
            around = np.min(self.surroundings, axis=0) if self.surroundings else np.full(finite.shape[1], lowest)
            self.rise = float(np.nanmax(self.temperatures - around)) if np.isfinite(around).any() else 0.0
            whole = self.temperatures[finite.all(axis=1)]
            self.spread = float(np.ptp(whole - whole[:1], axis=1).max()) if len(whole) > 1 else 0.0

    def cooling(self, node: str) -> FloatArray:
        """Temperatures of a node, shape (1, minutes); of all that are measured where its own is not."""
        row = self._rows.get(node)
        return self.temperatures if row is None else self.temperatures[[row]]


def _levels(loads: Sequence[FloatArray]) -> int:
    """Levels of the loads in minutes without change, each a tenth of the largest above the one before it."""
    settled = [loads[0][:0]]
    for load in loads:
        same = np.abs(np.diff(load)) < CHANGE / 2  # as the minute before, or the one behind
        settled.append(load[np.append(same, load.size == 1) | np.append(load.size == 1, same)] if load.size else load)
    count, base = 0, -np.inf
    for level in np.sort(np.concatenate(settled)):
        if level - base > CHANGE:
            count, base = count + 1, level
    return count


def _cool_downs(low: BoolArray, temperatures: FloatArray, cools: float) -> int:
    """Times of little load, of two minutes and more, in which some node cools."""
    count = 0
    for start, stop in spans(low):
        ends = temperatures[:, [start, stop - 1]] if stop - start > 1 else np.zeros((1, 2))
        count += bool((ends[:, 0] - ends[:, 1] >= cools).any())
    return count


# --- Which effects of the catalogue could show in logs, and which not and why -----------------------

_NODE = "<node>"


@dataclass(frozen=True)
class Identifiability:
    """What logs could say of one effect.

    Args:
        effect: its key.
        identifiable: whether it could show in them.
        why: why not; '' where it could.
        places: at how many places it was looked for.
    """

    effect: str
    identifiable: bool
    why: str
    places: int


def identifiability(model: Model, runs: Sequence[Run], measured: Excitation) -> list[Identifiability]:
    """Every effect of the catalogue that the model does not have everywhere, with what the runs could say of it.

    An effect can show where its inputs are logged and change, and where its own rule (`Effect.excitation`) is met. No
    model's sensitivities are looked at: what passes may still be beyond the data, which `lptn diagnose` works out.

    Args:
        model: the model as it stands.
        runs: at least one.
        measured: what happens in them.
    """
    columns = set.intersection(*(set(run.columns) for run in runs)) | set(model.inputs)
    by_effect: dict[str, list[Candidate]] = {}
    for candidate in candidates(model.network, columns, [run.name for run in runs]):
        if not candidate.difference:
            by_effect.setdefault(candidate.effect.key, []).append(candidate)
    used = {instance.effect.key for instance in model.network.effect_instances}
    notes = (note.partition(": ")[0] for run in runs for note in run.notes if "has gaps, and" in note)
    left_out = {column for names in notes for column in names.split(", ")}
    effects = []
    for key, effect in catalogue().items():
        if effect.amplitude() is None:
            continue
        sites = by_effect.get(key, [])
        if not sites and key in used:
            continue
        why = _why_not(effect, sites, measured) if sites else _not_logged(effect, model, columns, left_out)
        why = why or ("" if sites else "no place in the model")
        places = {place for candidate in sites for place in candidate.places}
        effects.append(Identifiability(key, not why, why, len(places)))
    return effects


def _why_not(effect: type[Effect], sites: Sequence[Candidate], measured: Excitation) -> str:
    """What is missing for an effect to show, in a few words; '' if nothing is."""
    columns = set()
    for candidate in sites:
        features = effect(**dict(candidate.words)).needed()
        ends = set(candidate.windings) or {end for place in candidate.places for end in place.split("~")}
        columns |= {input_column(feature, end) for feature in features for end in ends}
    columns &= set(measured.ranges)
    if columns and not any(measured.varies(column) for column in columns):
        one, more = min(columns), " and its like" if len(columns) > 1 else ""
        low, high = measured.ranges[one]
        if max(abs(low), abs(high)) < ZERO:
            return f"{one}{more} is 0 throughout"
        return f"{one}{more} hardly changes: {low:.3g} to {high:.3g} from minute to minute"
    return effect.excitation.lacking(measured, {place for candidate in sites for place in candidate.places})


def _not_logged(effect: type[Effect], model: Model, columns: set[str], left_out: set[str]) -> str:
    """The columns that an effect would need, where the log has none of them."""
    choices: list[tuple[str, ...]] = [(word,) for word in effect.options.get("input", ())]
    choices = choices or [effect.needs]
    if not any(choices):
        return ""

    def at_nodes(key: str) -> set[str]:
        return {key.replace(_NODE, node) for node in model.nodes}

    lacking = []
    for features in choices:
        keys = dict.fromkeys(key for feature in features for key in raw_keys(input_column(feature, _NODE)))
        absent = [key for key in keys if not columns & at_nodes(key)]
        own = {column for feature in features for column in at_nodes(input_column(feature, _NODE))}
        if own & columns or not (absent or own & left_out):
            return ""
        with_gaps = [key for key in absent if left_out & at_nodes(key)]
        if with_gaps == absent:
            return f"logged with gaps, so left out: {' and '.join(absent or keys)}"
        lacking.append(" and ".join(key for key in absent if key not in with_gaps))
    return f"{NOT_LOGGED}{' or '.join(dict.fromkeys(lacking))}"
