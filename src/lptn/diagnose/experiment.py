"""The next experiment: of the runs that the logs show to be possible, the one that best separates two hypotheses.

Rivals are effects that the old data can't tell apart. Each rival predicts a proposed run, and may change its parameters
as far as the old data leave them free to meet the other's prediction: their covariance beside all else (`Evidence`) is
the prior, and what the new run adds is solved for together. What is left is how much worse the wrong rival would
explain the new run, in units of its errors: the noncentrality of the likelihood ratio. Programs are searched for the
one that decides most pairs.

Source: [AtkinsonFedorov1975] (T-optimal design for discrimination), with a prior.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, groupby, product
from math import log, sqrt
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from lptn.basics.arrays import FloatArray
from lptn.basics.places import EVERYWHERE, class_of, is_glob, matching
from lptn.basics.processes import one_blas_thread
from lptn.basics.words import listed, short_size
from lptn.diagnose.answers import Key, Step, named
from lptn.diagnose.candidates import OCCAM
from lptn.diagnose.evidence import Evidence
from lptn.identify.problem import AT_REST
from lptn.logs.columns import column_unit, place_of, quantity_of
from lptn.logs.resampling import means_of_blocks
from lptn.logs.run import Run
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import Sensitivities, SimulationError, sensitivities

STEP = 10.0
"""s, of a proposed run; short against the time constants of a joint."""
POWER = 0.8
"""Statistical power: the share of logs in which the planned difference should show, as usual in such designs."""


# --- What a robot can do: loads and speeds that its logs have shown --------------------------------


_LOADS = ("torque", "current", "torque_abs", "current_abs")
_SPEEDS = ("velocity", "velocity_rms")
_POWER = "mechanical_power"
_BASE = "speed.base"


@dataclass(frozen=True)
class Move:
    """One thing to do: some joints work, all other motors are off.

    Args:
        at: a joint, a class (`"*_calf"`), or `"*"`; empty for rest with all motors off.
        joints: the joints that work.
        load: share of each joint's high ordinary load, 0 to 1.
        speed: the same of its speed, and of the base's where that moves.
        travelling: whether the base moves.
    """

    at: str = ""
    joints: tuple[str, ...] = ()
    load: float = 0.0
    speed: float = 0.0
    travelling: bool = False


class Program(NamedTuple):
    """Moves one after the other.

    Args:
        phases: the moves, and how long each takes [s].
        ambient: temperature of the air, and of the whole robot at the beginning [degC].
    """

    phases: tuple[tuple[Move, float], ...]
    ambient: float

    def effort(self, usual: float) -> int:
        """How many things it asks for: other air than usual [degC] is two, a rig that loads a moving joint another."""
        work = [move for move, _ in self.phases if move.joints]
        rigs = sum(move.load > 0 and move.speed > 0 and move.at != EVERYWHERE for move in work)
        return 2 * (self.ambient != usual) + max(len(work) - 1, 0) + rigs


class Stage:
    """What the logs show of each input, and programs as runs: high ordinary values, and what is usual.

    Args:
        rivals: refitted candidates of one baseline.
        ordinary: quantile of a column while it is not zero: high, yet nothing that happened only once.
    """

    def __init__(self, rivals: Sequence[Step], *, ordinary: float = 0.95) -> None:
        models, runs = [step.fit.model for step in rivals], [one.run for one in rivals[0].fit.problem.bound_runs]
        self._rivals, self.nodes = rivals, models[0].nodes
        asked = dict.fromkeys(name for model in models for name in model.inputs if name not in model.started)
        self.given = [name for name in asked if name.startswith("temperature.")]
        self.inputs = [name for name in asked if name not in self.given]
        # Loads and speeds that no model asks for say in words what a move is.
        shown = [name for name in runs[0].columns if quantity_of(name) in (*_LOADS, *_SPEEDS)]
        self.columns = dict.fromkeys([*self.inputs, *(name for name in shown if all(run.has(name) for run in runs))])
        self._values = {
            name: np.concatenate([run.columns[name] for run in runs]) for name in (*self.columns, *self.given)
        }
        sizes = {name: np.abs(self._values[name]) for name in self.columns}
        self.high = {
            name: float(np.quantile(own[own > 0], ordinary)) if own.any() else 0.0 for name, own in sizes.items()
        }
        quantities = dict.fromkeys(map(quantity_of, self.inputs))
        heats = [name for name in quantities if name not in (*_SPEEDS, _POWER, quantity_of(_BASE))]
        self._heating = [load for load in _LOADS if load in quantities] or heats  # as the heat of a heater
        self.joints = list(dict.fromkeys(place_of(name) for name in self.inputs if quantity_of(name) in self._heating))
        """Places whose load, or heat where no load is logged, can be chosen."""
        self.moving = any(quantity_of(name) in (*_SPEEDS, _POWER) for name in self.inputs)
        """Whether any model needs the joints' speeds, or their power."""
        prescribed = {name: source for name, source in models[0].network.prescribed.items() if source in self.given}
        self._air = prescribed.get("ambient", next(iter(prescribed.values())) if len(prescribed) == 1 else None)
        self.air_can_change = self._air is not None or not self.given
        """Whether the air's temperature is an input of the models, or nothing is prescribed."""
        sensed = [run.columns[f"temperature.{n}"] for n in self.nodes for run in runs if run.has(f"temperature.{n}")]
        firsts = [readings[np.isfinite(readings)][:1] for readings in sensed]
        self.ambient = float(np.median(self._values[str(self._air)] if self._air else np.concatenate(firsts)))
        """The usual temperature of the air in the logs [degC]; without its column, of the nodes at the start."""

    def moves(self, levels: Sequence[float] = (0.5, 1.0)) -> list[Move]:
        """Every move to be considered: the joints where rivals act, their classes, all; loaded, moving, or both.

        Args:
            levels: shares of the high ordinary load and speed: laws that go with different powers of them are told
                apart by two levels, and losses that go with the square are a quarter at the lower one.
        """
        acting = [
            one.place
            for rival in self._rivals
            for one in rival.fit.model.network.effect_instances
            if (one.effect.key, one.declaration.where) == rival.key
        ]
        asked = [end for end in dict.fromkeys("~".join(acting).split("~")) if end in self.joints]
        singles = list({class_of(joint): joint for joint in reversed(asked)}.values()) if len(asked) > 2 else asked
        scopes: dict[tuple[str, ...], str] = {}
        for pattern in dict.fromkeys([*singles, *map(class_of, asked or self.joints), EVERYWHERE]):
            if members := tuple(matching(pattern, self.joints)):
                whole = len(members) == len(self.joints) > 1
                scopes.setdefault(members, EVERYWHERE if whole else pattern)
        shares = list(product((0.0, *levels), (0.0, *levels) if self.moving else (0.0,)))[1:]
        proposed = []
        for joints, at in scopes.items():
            proposed += [Move(at, joints, load, speed) for load, speed in shares]
            if _BASE in self.inputs and at == EVERYWHERE:
                proposed += [Move(at, joints, 1.0, speed, travelling=True) for speed in levels]
        return proposed

    def value(self, column: str, move: Move) -> float:
        """An input's value during a move, in its own unit."""
        high, place = self.high[column], place_of(column)
        chosen = place in move.joints
        if column == _BASE:
            return move.speed * high * move.travelling
        shares = dict.fromkeys(_SPEEDS, move.speed) | {_POWER: move.load * move.speed}
        shares |= dict.fromkeys((*self._heating, *_LOADS), move.load)
        if (share := shares.get(quantity_of(column))) is not None:
            return share * high * chosen
        if place in self.joints:
            return high if chosen else float(self._values[column].min())
        return float(np.median(self._values[column]))  # what all share: a computer's heat, the sun

    def run(self, program: Program) -> Run:
        """A program as a log: inputs, and every node at the air's temperature."""
        moves, counts = zip(*((move, round(seconds / STEP)) for move, seconds in program.phases), strict=True)
        n, columns = sum(counts), dict[str, FloatArray]()
        for name in self.columns:
            columns[name] = np.repeat([self.value(name, move) for move in moves], counts).astype(float)
        for name in self.given:
            columns[name] = np.full(n, program.ambient if name == self._air else float(np.median(self._values[name])))
        columns |= {f"temperature.{node}": np.full(n, program.ambient) for node in self.nodes}
        return Run("experiment", STEP, np.arange(n, dtype=float) * STEP, columns, True, "proposed experiment", "")

    def as_json(self, program: Program) -> list[dict[str, object]]:
        """Each move with the values of every input that it sets."""
        return [
            {
                "at": move.at,
                "joints": list(move.joints),
                "travelling": move.travelling,
                "minutes": seconds / 60,
                "load_unit": " and ".join(self._loads(move)),
                "inputs": {name: self.value(name, move) for name in self.columns},
            }
            for move, seconds in program.phases
        ]

    def text(self, program: Program) -> str:
        """What to do, a sentence or two that a technician can follow."""
        air = f"With the robot at rest and as warm as the air, {program.ambient:.0f} degC"
        air += ", which is not the temperature of the logs" if program.ambient != self.ambient else ""
        phases = [f"{self._doing(move)} for {seconds / 60:.3g} min" for move, seconds in program.phases]
        return f"{air}: {', then '.join(phases)}."

    def _doing(self, move: Move) -> str:
        if not move.joints:
            return "leave it unpowered"
        load = " and ".join(_range(values, unit) for unit, values in self._loads(move).items()) or "no load"
        where = "all joints" if move.at == EVERYWHERE else f"every {move.at}" if is_glob(move.at) else move.at
        if move.travelling:
            return f"walk at {self.high.get(_BASE, 0.0) * move.speed:.2g} m/s with {load} at {where}"
        if move.speed == 0.0:
            return f"hold {load} at {where}{' standing' if self.moving else ''}"
        names = [[f"{speed}.{joint}" for joint in move.joints if f"{speed}.{joint}" in self.high] for speed in _SPEEDS]
        pace = f"{_range([self.value(name, move) for name in names[0] or names[1]], 'rad/s')} on average"
        return f"move {where} at {pace} with {load}" if move.load else f"swing {where} without load at {pace}"

    def _loads(self, move: Move) -> dict[str, list[float]]:
        """Values of a move's load, by their unit: each joint logs its own, torque here, current there."""
        loads: dict[str, list[float]] = {}
        for joint in move.joints:
            logged = (name for quantity in self._heating if (name := f"{quantity}.{joint}") in self.inputs)
            if name := next(logged, ""):
                unit = column_unit(name)
                unit = f"of {quantity_of(name)}" if unit in ("", "1") else unit
                loads.setdefault(unit, []).append(self.value(name, move))
        return loads


def _range(values: Sequence[float], unit: str) -> str:
    """One value, or the least and the largest where these are told apart by two digits."""
    if not values:
        return f"the usual {unit}"
    if max(values) <= 1.1 * min(values):
        return f"{short_size(sum(values) / len(values))} {unit}"
    return f"{short_size(min(values))} to {short_size(max(values))} {unit}"


# --- How far rivals' predictions of a run lie apart after each has done what it can to agree ------


class Difference(NamedTuple):
    """How two rivals' predictions of a run differ after the wrong one has been refitted.

    Args:
        pair: the rivals, effect and place each; where they differ most the first is the warmer one.
        kelvin: the largest difference that no change of parameters takes away, mean of a minute [K].
        kelvin_as_fitted: the largest difference of the predictions as the old data leave them [K].
        deviations: of all readings together, square root of the expected rise of the sum of squared weighted residuals.
        node: where it is largest, of those that have a sensor.
        minute: when.
    """

    pair: tuple[Key, Key]
    kelvin: float
    kelvin_as_fitted: float
    deviations: float
    node: str
    minute: float

    @property
    def clear(self) -> bool:
        """Whether the run decides between the two in four cases of five."""
        return bool(_power(self.deviations) >= POWER)


class Rivals:
    """Fits that the previous data can't distinguish.

    Args:
        steps: the rivals, all of the same nodes and runs.
    """

    def __init__(self, steps: Sequence[Step]) -> None:
        from scipy.linalg import block_diag  # heavy, and few commands need it

        self.keys, self.fits = [step.key for step in steps], [step.fit for step in steps]
        known = [Evidence(fit, ()) for fit in self.fits]
        self._roots = []
        for own in known:
            squares, axes = np.linalg.eigh(own.covariance)
            root = axes * np.sqrt(np.maximum(squares, 0.0))
            self._roots.append(block_diag(root, AT_REST * np.eye(len(own.fit.model.states))))
        best = min(known, key=lambda own: own.fit.cost)
        problem = best.fit.problem
        lengths, counts = zip(*((one.run.step, one.counted.sum()) for one in problem.bound_runs), strict=True)
        self.density: FloatArray = problem.sigma**2 / best.precision * np.average(lengths, weights=counts)
        """Variance of each node's readings times the time after which they are new information [K²s], (nodes,)."""
        self._measured = problem.measured

    def predict(self, run: Run) -> list[Sensitivities]:
        """Each rival's prediction of a run, with its derivatives by independent standard deviations of what it may
        change: parameters as the old data leave them, and how far the states are from rest.

        Raises:
            SimulationError: a model runs away.
        """
        predicted = []
        for fit, root in zip(self.fits, self._roots, strict=True):
            model, free, nodes = fit.model, fit.problem.free, len(fit.model.nodes)
            # The fit's own choice of parameters: its stepper, compiled already, is used again.
            simulated = sensitivities(model, bind(model, run), model.values, free)
            moved = simulated.derivatives.copy()
            moved[:, :, : len(free)] *= fit.problem.slope(model.values)
            starts = moved[:, :, len(free) :]
            starts[:, :, :nodes] += starts[:, :, nodes:] @ model.resting_shares
            predicted.append(replace(simulated, derivatives=moved @ root))
        return predicted

    def apart(self, predictions: Sequence[Sensitivities], run: Run) -> list[Difference]:
        """For each pair the smaller of both ways round: whichever of the two is true, so much is to be seen.

        Args:
            predictions: of one run.
            run: that run.
        """
        weight, differences = np.sqrt(run.step / self.density)[:, None] * self._measured[:, None], []
        for one, other in combinations(range(len(self.fits)), 2):
            fitted = predictions[one].readings - predictions[other].readings
            both = list[tuple[float, FloatArray]]()
            for wrong in (one, other):
                derivatives = predictions[wrong].derivatives
                rows = (derivatives * weight[:, :, None]).reshape(fitted.size, -1)
                pull = rows.T @ (fitted * weight).ravel()
                change = np.linalg.solve(np.eye(rows.shape[1]) + rows.T @ rows, pull)
                rise = float(np.sum((fitted * weight) ** 2) - pull @ change)
                both.append((sqrt(max(rise, 0.0)), fitted - derivatives @ change))
            deviations, left = min(both, key=lambda way: way[0])
            minutes = means_of_blocks(left, round(60 / STEP)) * self._measured[:, None]
            row, minute = np.unravel_index(int(np.argmax(np.abs(minutes))), minutes.shape)
            pair, most = (self.keys[one], self.keys[other]), float(minutes[row, minute])
            pair = pair if most >= 0 else pair[::-1]
            apart, node = float(np.abs(fitted[self._measured]).max()), self.fits[0].model.nodes[int(row)]
            differences.append(Difference(pair, abs(most), apart, deviations, node, float(minute + 1)))
        return differences


@dataclass(frozen=True)
class Experiment:
    """A proposed run.

    Args:
        rivals: effect and place of each.
        program: moves, durations and air.
        run: the inputs as a log's columns, in steps of 10 s.
        differences: of each pair of rivals, the clearest first.
        predictions: of each rival [degC], shape (nodes, n) as in the models; mean over each step.
        limit: the temperature that no prediction passes [degC].
        stage: what the logs show of each input.
        tried: how many runs were compared.
    """

    rivals: tuple[Key, ...]
    program: Program
    run: Run
    differences: tuple[Difference, ...]
    predictions: Mapping[Key, FloatArray]
    limit: float
    stage: Stage
    tried: int = 1

    @property
    def separates(self) -> bool:
        """Whether the run decides at least one of the pairs in four cases of five."""
        return any(contrast.clear for contrast in self.differences)

    @property
    def weakest(self) -> Difference:
        """The least clear pair of those that the run separates; if it separates none, of all."""
        return [contrast for contrast in self.differences if contrast.clear or not self.separates][-1]

    def text(self) -> str:
        """What to do, what each rival predicts, and what to conclude."""
        least = self.weakest
        warmer, colder = (named(key) for key in least.pair)
        shown = (
            f"{self.stage.text(self.program)} At {least.minute:.0f} min {least.node} is then {least.kelvin:.2g} K "
            f"warmer if it is {warmer} than if it is {colder}, whatever the other parameters are"
        )
        if self.separates:
            undecided = (contrast.pair for contrast in self.differences if not contrast.clear)
            pairs = "; ".join(listed([named(key) for key in pair]) for pair in undecided)
            rest = f" It does not separate {pairs}." if pairs else ""
            decided = "Add that log to the fit: it rules out the wrong one."
            return f"{shown} ({least.deviations:.0f} standard deviations). {decided}{rest}"
        reach = f"{len(self.run) * STEP / 60:.0f} min within the loads, speeds and temperatures of these logs"
        if least.deviations < 1.0:
            return (
                f"No run of {reach} separates {warmer} from {colder}: in the best of {self.tried} their predictions "
                "differ by less than one standard deviation, whatever the other parameters are."
            )
        return (
            f"No run of {reach} reliably separates {warmer} from {colder}. The best of {self.tried} does so in less "
            f"than 80 % of all cases: {shown} ({least.deviations:.1f} standard deviations)."
        )

    def as_json(self) -> dict[str, object]:
        """The experiment as other tools read it."""
        return {
            "rivals": [list(key) for key in self.rivals],
            "separates": self.separates,
            "text": self.text(),
            "minutes": len(self.run) * STEP / 60,
            "ambient": self.program.ambient,
            "moves": self.stage.as_json(self.program),
            "differences": [contrast._asdict() | {"clear": contrast.clear} for contrast in self.differences],
            "hottest": float(max(readings.max() for readings in self.predictions.values())),
            "limit": self.limit,
            "tried": self.tried,
        }


# --- The proposal: single moves, then one move more behind the best, in each air -------------------------------


@one_blas_thread
def propose(
    rivals: Sequence[Step],
    *,
    minutes: float = 20.0,
    ambients: Sequence[float] | None = None,
    limit: float | None = None,
    allowed: Sequence[Move] | None = None,
    most: int = 4,
    beyond: float = 10.0,
    longest: int = 3,
    kept: int = 6,
    simpler: float = 0.85,
    reserve: float = 3.0,
) -> Experiment | None:
    """The run that best separates rivals, of those that the fitted logs show to be possible.

    Each rival's parameters may move as far as the old data let them to meet the other's prediction; what is left
    between the two, in units of the sensors' noise, is made to decide as many pairs as it may. Of programs that are
    nearly as good as the best it is the simplest.

    Args:
        rivals: refitted candidates that the data can't tell apart, of one baseline.
        minutes: how long the run may last.
        ambients: temperatures of the air that can be had [degC] beside the logs' own; by default `beyond` colder and
            as much warmer.
        limit: highest temperature that a prediction may reach [degC]; by default `beyond` above the hottest reading.
        allowed: what the robot can do; by default all `Stage.moves`.
        most: of the rivals, the most probable first, among which the run has to decide.
        beyond: K, how far a run may go beyond what the logs show to be safe.
        longest: moves of a program, each as long as the others.
        kept: moves, and programs of each length, that are followed further.
        simpler: share of the pairs that a simpler run must decide beside one that asks for one thing more: it may last
            a third longer, and then sets rivals apart by 15 % more deviations.
        reserve: effects may be so many times smaller than they were fitted, or the log be so much worse.

    Returns:
        The experiment; `None` with fewer than two rivals, or if no run stays below the limit. See
        `Experiment.separates` for whether it decides anything.

    Source: [AtkinsonFedorov1975].
    """
    if len(rivals := rivals[:most]) < 2:
        return None
    stage, fitted = Stage(rivals), Rivals(rivals)
    hottest = max(float(np.nanmax(bound.measured)) for bound in rivals[0].fit.problem.bound_runs)
    limit = hottest + beyond if limit is None else limit
    others = [round(stage.ambient) + shift for shift in (-beyond, beyond)] if ambients is None else ambients
    seconds, single = 60.0 * minutes, stage.moves() if allowed is None else allowed
    tried: dict[Program, Experiment | None] = {}  # none of what runs too hot

    def decided(experiment: Experiment) -> tuple[float, float]:
        """The number of pairs that it is expected to decide, and the deviations of all."""
        deviations = [difference.deviations for difference in experiment.differences]
        return sum(_power(own / reserve) for own in deviations), sum(deviations)

    def best(some: Iterable[tuple[Move, ...]], ambient: float) -> list[tuple[Move, ...]]:
        """Of some moves one after the other, each as long as the others, those that decide most, the best first."""
        worth = {}
        for moves in some:
            ends = np.round(np.linspace(0.0, seconds / 60, len(moves) + 1)) * 60  # whole minutes, as people take them
            ends[-1] = round(seconds / STEP) * STEP
            parts = [(move, list(own)) for move, own in groupby(range(len(moves)), key=moves.__getitem__)]
            phases = tuple((move, float(ends[own[-1] + 1] - ends[own[0]])) for move, own in parts)
            if (program := Program(phases, ambient)) not in tried:
                tried[program] = _experiment(stage, fitted, program, limit)
            if (experiment := tried[program]) is not None:
                worth[moves] = decided(experiment)
        return sorted(worth, key=worth.__getitem__, reverse=True)[:kept]

    rest = (Move(),)
    for ambient in (stage.ambient, *(others if stage.air_can_change else ())):
        longer = good = best([rest, *((move,) for move in single)], ambient)
        for _ in range(1, longest):
            longer = best([some + one for some, one in product(longer, dict.fromkeys([*good, rest]))], ambient)

    def less_its_effort(experiment: Experiment) -> tuple[float, ...]:
        return tuple(simpler ** experiment.program.effort(stage.ambient) * own for own in decided(experiment))

    found = max(filter(None, tried.values()), key=less_its_effort, default=None)
    return found and replace(found, tried=len(tried))


def _experiment(stage: Stage, rivals: Rivals, program: Program, limit: float) -> Experiment | None:
    """A program with what the rivals predict of it, `None` where it gets too hot."""
    run = stage.run(program)
    try:
        predictions = rivals.predict(run)
    except SimulationError:
        return None
    readings = {key: prediction.readings for key, prediction in zip(rivals.keys, predictions, strict=True)}
    if max(float(own.max()) for own in readings.values()) > limit:
        return None
    differences = sorted(rivals.apart(predictions, run), key=lambda contrast: -contrast.deviations)
    return Experiment(tuple(rivals.keys), program, run, tuple(differences), readings, limit, stage)


def _power(deviations: float) -> float:
    """The probability that a refit rules out the wrong one of two rivals that a run sets so far apart.

    Twice the logarithm of the odds is expected to be the square, with a scatter of twice the deviations; it must be
    beyond Occam's window.
    """
    return float(ndtr(0.5 * deviations - log(OCCAM) / deviations)) if deviations > 0 else 0.0
