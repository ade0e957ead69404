"""The next experiment: of the runs that the logs show to be possible, the one that best tells rivals apart.

Rivals are effects that the old data can't tell apart. Each rival predicts a proposed run, and may change its parameters
as far as the old data leave them free to meet the other's prediction: Gauss-Newton information of the old data is the
prior, and what the new run adds is solved for together. What is left is how much worse the wrong rival would explain
the new run, in units of the sensors' noise: the noncentrality of the likelihood ratio. Programs are searched for the
one that makes this largest for the pair where it is smallest.

Source: [AtkinsonFedorov1975] (T-optimal design for discrimination), with a prior.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, permutations, product
from math import sqrt
from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.places import EVERYWHERE, class_of, is_glob, matching
from lptn.basics.processes import one_blas_thread
from lptn.basics.words import listed
from lptn.diagnose.answers import Key, Step, named
from lptn.diagnose.fit_statistics import POWER, TIE, fitted_errors, independent_readings
from lptn.identify.fitting import Fit
from lptn.identify.problem import AT_REST, Problem
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import SimulationError, sensitivities

STEP = 10.0
"""s, of a proposed run; short against the time constants of a joint."""
CLEAR = POWER + sqrt(POWER**2 + TIE)
"""Standard deviations of a difference from which on a refit decides in four cases of five: the information
criterion's lead, its expected square with a scatter of twice its root, must exceed what counts as a tie."""
_BEYOND = (
    10.0  # K above the hottest reading that a proposed run may reach: what the logs show is safe, a little more is
)
_OTHER_AIR = (-12.0, 12.0)  # K: a cold room, a warm one


# --- What can be asked of a robot: loads and speeds that its logs have shown --------------------------------


_LOADS = ("torque", "current", "torque_abs", "current_abs")
_SPEEDS = ("velocity", "velocity_rms")
_PRODUCTS = ("mechanical_power",)
_BASE = "speed.base"
_UNITS = {"torque": "N*m", "torque_abs": "N*m", "current": "A", "current_abs": "A", "power": "W", "heat": "W"}
_ORDINARY = 0.95  # quantile of a column while it is in use: high, yet nothing that happened only once
_IN_USE = 0.05  # share of a column's largest value, above what sensors read at rest, from which on it is in use
_LEVELS = (0.5, 1.0)
"""Shares of the high ordinary load and speed: laws that go with different powers of them are told apart by two levels,
and losses that go with the square are a quarter at the lower one."""


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


class Phase(NamedTuple):
    """A move and how long it takes [s]."""

    move: Move
    seconds: float


@dataclass(frozen=True)
class Program:
    """Moves one after the other.

    Args:
        phases: the moves.
        ambient: temperature of the air, and of the whole robot at the beginning [degC].
        moved_air: whether that is another than the log's.
    """

    phases: tuple[Phase, ...]
    ambient: float
    moved_air: bool = field(default=False, compare=False)

    @property
    def seconds(self) -> float:
        """How long it takes [s]."""
        return sum(phase.seconds for phase in self.phases)

    @property
    def working(self) -> tuple[Phase, ...]:
        """The phases without rest."""
        return tuple(phase for phase in self.phases if phase.move.joints)


class Stage:
    """What the logs show of each input, and programs as runs: high ordinary values, and what is usual at work or rest.

    Args:
        models: the rivals' models.
        runs: the fitted runs.
    """

    def __init__(self, models: Sequence[Model], runs: Sequence[Run]) -> None:
        columns = dict.fromkeys(name for model in models for name in model.inputs if name not in model.started)
        self.nodes = list(models[0].nodes)
        self.given = [name for name in columns if name.startswith("temperature.")]
        self.inputs = [name for name in columns if name not in self.given]
        # Loads and speeds that no model asks for say in words what a move is.
        told = (name for name in runs[0].columns if _quantity(name) in (*_LOADS, *_SPEEDS))
        self.columns = dict.fromkeys([*self.inputs, *(name for name in told if all(run.has(name) for run in runs))])
        names = (*self.columns, *self.given)
        self._values = {name: np.concatenate([run.columns[name] for run in runs]) for name in names}
        quantities = dict.fromkeys(map(_quantity, self.inputs))
        heats = [name for name in quantities if name not in (*_SPEEDS, *_PRODUCTS, _quantity(_BASE))]
        self._heating = [load for load in _LOADS if load in quantities] or heats  # as the heat of a heater
        self.joints = list(dict.fromkeys(_place(name) for name in self.inputs if _quantity(name) in self._heating))
        """Places whose load, or heat where no load is logged, can be chosen."""
        self.moving = any(_quantity(name) in (*_SPEEDS, *_PRODUCTS) for name in self.inputs)
        """Whether any model asks for the joints' speeds, or for their power."""
        self.high = {}
        self._works: BoolArray = np.zeros(sum(len(run) for run in runs), dtype=bool)
        for name in self.columns:
            sizes = np.abs(self._values[name])
            in_use = sizes[sizes > _IN_USE * sizes.max(initial=0.0)]
            self.high[name] = float(np.quantile(in_use, _ORDINARY)) if in_use.size else 0.0
            if _quantity(name) in (*self._heating, *_SPEEDS) and self.high[name] > 0:
                self._works |= sizes > _IN_USE * self.high[name]
        prescribed = {name: source for name, source in models[0].network.prescribed.items() if source in self.given}
        air = prescribed.get("ambient", next(iter(prescribed.values())) if len(prescribed) == 1 else None)
        self._air = air if isinstance(air, str) else None
        self.air_can_change = self._air is not None or not self.given
        """Whether the air's temperature is an input of the models, or nothing is prescribed."""
        sensed = [run.columns[f"temperature.{n}"] for n in self.nodes for run in runs if run.has(f"temperature.{n}")]
        firsts = [readings[np.isfinite(readings)][:1] for readings in sensed]
        self.ambient = float(np.median(self._values[self._air] if self._air else np.concatenate(firsts)))
        """The usual temperature of the air in the logs [degC]; without its column, of the nodes at the start."""

    def moves(self, places: Iterable[str]) -> list[Move]:
        """Every move to be considered: the joints in question, their classes, all; loaded, moving, or both.

        Args:
            places: what the question is about: nodes, or edges of two.
        """
        ends = dict.fromkeys(end for place in places for end in place.split("~"))
        asked = [end for end in ends if end in self.joints]
        singles = list({class_of(joint): joint for joint in reversed(asked)}.values()) if len(asked) > 2 else asked
        scopes: dict[tuple[str, ...], str] = {}
        for pattern in dict.fromkeys([*singles, *map(class_of, asked or self.joints), EVERYWHERE]):
            if members := tuple(matching(pattern, self.joints)):
                whole = len(members) == len(self.joints) > 1
                scopes.setdefault(members, EVERYWHERE if whole else pattern)
        proposed = []
        for joints, at in scopes.items():
            proposed += [Move(at, joints, load=load) for load in _LEVELS]
            if self.moving:
                proposed += [Move(at, joints, speed=speed) for speed in _LEVELS]
                proposed += [Move(at, joints, load, speed) for load, speed in product(_LEVELS, _LEVELS)]
            if _BASE in self.inputs and at == EVERYWHERE:
                proposed += [Move(at, joints, 1.0, speed, travelling=True) for speed in _LEVELS]
        return proposed

    def value(self, column: str, move: Move) -> float:
        """An input's value during a move, in its own unit."""
        quantity, place = _quantity(column), _place(column)
        high, chosen = self.high[column], place in move.joints
        if quantity in (*self._heating, *_LOADS):
            return move.load * high * chosen
        if quantity in _SPEEDS:
            return move.speed * high * chosen
        if quantity in _PRODUCTS:
            return move.load * move.speed * high * chosen
        if column == _BASE:
            return move.speed * high * move.travelling
        values = self._values[column]
        if place in self.joints:
            return high if chosen else float(values.min())
        usual = values[self._works == bool(move.joints)]  # what all share: a computer's heat, the sun
        return float(np.median(usual if usual.size else values))

    def run(self, wanted: Program) -> Run:
        """A program as a log: inputs, and every node at the air's temperature."""
        counts = [round(phase.seconds / STEP) for phase in wanted.phases]
        n = sum(counts)
        columns = {
            name: np.repeat([self.value(name, phase.move) for phase in wanted.phases], counts).astype(float)
            for name in self.columns
        }
        for name in self.given:
            columns[name] = np.full(n, wanted.ambient if name == self._air else float(np.median(self._values[name])))
        columns |= {f"temperature.{node}": np.full(n, wanted.ambient) for node in self.nodes}
        return Run("experiment", STEP, np.arange(n, dtype=float) * STEP, columns, True, "proposed experiment", "")

    def as_json(self, wanted: Program) -> list[dict[str, object]]:
        """Each move with the values of every input that it sets."""
        return [
            {
                "at": phase.move.at,
                "joints": list(phase.move.joints),
                "travelling": phase.move.travelling,
                "minutes": phase.seconds / 60,
                "load_unit": " and ".join(dict.fromkeys(_UNITS.get(key, "") for key in self._loads(phase.move))),
                "inputs": {name: self.value(name, phase.move) for name in self.columns},
            }
            for phase in wanted.phases
        ]

    def text(self, wanted: Program) -> str:
        """What to do, a sentence or two that a technician can follow."""
        air = f"With the robot at rest and as warm as the air, {wanted.ambient:.0f} degC"
        air += ", which is not the temperature of the logs" if wanted.moved_air else ""
        phases = [f"{self._doing(phase.move)} for {phase.seconds / 60:.3g} min" for phase in wanted.phases]
        return f"{air}: {', then '.join(phases)}."

    def _doing(self, move: Move) -> str:
        if not move.joints:
            return "leave it unpowered"
        loads = [_range(values, _UNITS.get(key, f"of {key}")) for key, values in self._loads(move).items()]
        load = " and ".join(loads) or "no load"
        where = "all joints" if move.at == EVERYWHERE else f"every {move.at}" if is_glob(move.at) else move.at
        if move.travelling:
            return f"walk at {self.high.get(_BASE, 0.0) * move.speed:.2g} m/s with {load} at {where}"
        if move.speed == 0.0:
            return f"hold {load} at {where}{' standing' if self.moving else ''}"
        speed = next((speed for speed in _SPEEDS if any(_quantity(name) == speed for name in self.columns)), "")
        columns = [f"{speed}.{joint}" for joint in move.joints if f"{speed}.{joint}" in self.high]
        pace = f"{_range([self.value(name, move) for name in columns], 'rad/s')} on average"
        return f"move {where} at {pace} with {load}" if move.load else f"swing {where} without load at {pace}"

    def _loads(self, move: Move) -> dict[str, list[float]]:
        """Values of a move's load, by the quantity that each joint logs it as: torque here, current there."""
        values: dict[str, list[float]] = {}
        for joint in move.joints:
            quantity = next((quantity for quantity in self._heating if f"{quantity}.{joint}" in self.inputs), "")
            if quantity:
                values.setdefault(quantity, []).append(self.value(f"{quantity}.{joint}", move))
        return values


def _range(values: Sequence[float], unit: str) -> str:
    """One value, or the least and the largest where these are told apart by two digits."""
    if not values:
        return f"the usual {unit}"
    if max(values) <= 1.1 * min(values):
        return f"{sum(values) / len(values):.2g} {unit}"
    return f"{min(values):.2g} to {max(values):.2g} {unit}"


def _quantity(column: str) -> str:
    return column.partition(".")[0]


def _place(column: str) -> str:
    return column.partition(".")[2]


# --- How far rivals' predictions of a run lie apart after each has done what it can to agree ------


_UNDETERMINED = 10.0
"""One standard deviation, in the search's own scale (logarithms, typical sizes), of a parameter that no data hold: in
effect none."""
_MODEL_ERROR = 0.03**2 * 600.0  # K²s: 0.03 K for ten minutes; no model of a real robot is better, however many readings


class Separation(NamedTuple):
    """How one rival's prediction differs from another's after the other has adapted.

    Args:
        deviations: square root of the expected rise of the sum of squared weighted residuals.
        left: what is left of the difference [K], shape (nodes, n).
    """

    deviations: float
    left: FloatArray


class RivalPrediction(NamedTuple):
    """A rival's prediction of one run.

    Args:
        readings: degC, shape (nodes, n).
        moved: their derivatives by the rival's parameters and initial states, shape (nodes, n, unknowns).
    """

    readings: FloatArray
    moved: FloatArray


class Rivals:
    """Fits that the old data can't tell apart.

    Args:
        fits: the rivals, all of the same nodes and runs.
    """

    def __init__(self, fits: Sequence[Fit]) -> None:
        self.fits = list(fits)
        self.pairs = list(combinations(range(len(fits)), 2))
        self._density = noise_density(min(self.fits, key=lambda fit: fit.cost))
        self._priors = [self._prior(fit) for fit in self.fits]

    def predict(self, run: Run) -> list[RivalPrediction]:
        """All predictions of a run.

        Raises:
            SimulationError: a model runs away.
        """
        predicted = []
        for fit in self.fits:
            model, free = fit.model, fit.problem.free
            # The fit's own choice of parameters: its stepper, compiled already, is used again.
            simulated = sensitivities(model, bind(model, run), model.values, free)
            moved = simulated.derivatives.copy()
            moved[:, :, : len(free)] *= fit.problem.slope(model.values)
            nodes, starts = len(model.nodes), moved[:, :, len(free) :]
            starts[:, :, :nodes] += starts[:, :, nodes:] @ model.resting_shares
            predicted.append(RivalPrediction(simulated.readings, moved))
        return predicted

    def apart(self, predictions: Sequence[RivalPrediction], run: Run) -> dict[tuple[int, int], Separation]:
        """For each pair the smaller of both ways round: whichever of the two is true, so much is to be seen.

        Args:
            predictions: of one run.
            run: that run.
        """
        weight = np.sqrt(run.step / self._density)[:, None]
        separations: dict[tuple[int, int], Separation] = {}
        for pair in self.pairs:
            weighted = (predictions[pair[0]].readings - predictions[pair[1]].readings) * weight
            both = []
            for wrong in pair:
                rows = (predictions[wrong].moved * weight[:, :, None]).reshape(weighted.size, -1)
                pull = rows.T @ weighted.ravel()
                change = np.linalg.solve(self._priors[wrong] + rows.T @ rows, pull)
                rise = float(np.sum(weighted**2) - pull @ change)
                left = (weighted - (rows @ change).reshape(weighted.shape)) / weight
                both.append(Separation(sqrt(max(rise, 0.0)), left))
            separations[pair] = min(both, key=lambda separation: separation.deviations)
        return separations

    def _prior(self, fit: Fit) -> FloatArray:
        """Information on parameters from the old data, on initial states from the robot's being at rest."""
        old, sigma = fit.problem, np.sqrt(self._density / _mean_step(fit))
        hessian = Problem(old.model, old.bound_runs, sigma, old.symmetry_penalty, old.free).normal(fit.z)[1]
        free, states = len(old.free), len(fit.model.states)
        across, starts = hessian[:free, free:], hessian[free:, free:]
        schur = hessian[:free, :free] - across @ np.linalg.solve(starts, across.T)
        information = np.zeros((free + states, free + states))
        information[:free, :free] = 0.5 * (schur + schur.T) + np.eye(free) / _UNDETERMINED**2
        information[free:, free:] = np.eye(states) / AT_REST**2
        return information


def noise_density(fit: Fit) -> FloatArray:
    """Variance of each node's readings times the time after which they are new information [K²s], shape (nodes,).

    The steps of a coarse sensor repeat their error for as long as the temperature stays within one: such readings
    count as often as their residuals' correlation in time allows. A small, slow error of the model is added: a
    difference of hundredths of a kelvin decides nothing.
    """
    errors = fitted_errors(fit)
    repeated = max(1.0, fit.problem.readings / independent_readings(errors))
    variance = np.empty(len(fit.model.nodes))
    for row, floor in enumerate(fit.noise.floor):
        residual = np.concatenate([error[row][bound.counted[row]] for bound, error in errors])
        variance[row] = max(float(np.mean(residual**2)), floor**2) if residual.size else 1e6  # it says nothing
    return np.asarray(variance * repeated * _mean_step(fit) + _MODEL_ERROR)


def _mean_step(fit: Fit) -> float:
    """Of the runs, each counted by its readings [s]."""
    steps, counts = zip(*((bound.run.step, int(bound.counted.sum())) for bound in fit.problem.bound_runs), strict=True)
    return float(np.average(steps, weights=counts))


# --- The search among runs: single moves first, then pairs and threes, then other air ----------------------


_SHARES = (0.2, 0.4, 0.6, 0.8, 1.0)  # of the time for a single move; rest is left at the end
_BUSY = 0.8  # share of the time for two or three moves together
_KEPT = 6  # moves, pairs, programs that are followed further: some 200 programs in all, a second or two
_NEARLY = 0.85  # share of the best that a simpler run must reach: that is a third more time of the same run


@dataclass(frozen=True)
class ProgramTrial:
    """A program, and how far it sets each pair of rivals apart [standard deviations]."""

    program: Program
    deviations: tuple[float, ...]

    @property
    def effort(self) -> int:
        """What it asks of the people who do it: other air is the most trouble, then a rig that loads a moving joint."""
        moves = [phase.move for phase in self.program.working]
        rigs = sum(move.load > 0 and move.speed > 0 and move.at != EVERYWHERE for move in moves)
        return 2 * self.program.moved_air + max(len(moves) - 1, 0) + rigs


class ProgramSearch:
    """All programs tried so far.

    Args:
        stage: turns programs into runs.
        rivals: the fits.
        seconds: how long a run may last.
        limit: highest temperature that a prediction may reach [degC].
    """

    def __init__(self, stage: Stage, rivals: Rivals, seconds: float, limit: float) -> None:
        self.stage, self.rivals, self.seconds, self.limit = stage, rivals, seconds, limit
        self.trials: dict[Program, ProgramTrial | None] = {}

    def best(self, moves: Sequence[Move], ambients: Sequence[float]) -> ProgramTrial | None:
        """The simplest program of these moves that is nearly as good as the best; `None` if all run too hot.

        Args:
            moves: what can be done.
            ambients: temperatures of the air beside the logs' own [degC].
        """
        air = self.stage.ambient
        self._try([[], *([(move, share)] for move, share in product(moves, _SHARES[2::2]))], air)
        working = (trial.program.working for trial in self._ranked())
        good = list(dict.fromkeys(phases[0].move for phases in working if phases))[:_KEPT]
        self._try([[(move, share)] for move, share in product(good, _SHARES)], air)
        self._try([[(move, _BUSY / 2) for move in pair] for pair in permutations(good, 2)], air)
        working = (trial.program.working for trial in self._ranked())
        pairs = [[phase.move for phase in phases] for phases in working if len(phases) == 2][:_KEPT]
        threes = ([*pair, third] for pair, third in product(pairs, good) if third != pair[1])
        self._try([[(move, _BUSY / 3) for move in three] for three in threes], air)
        kept = [[(phase.move, phase.seconds / self.seconds) for phase in p.program.phases] for p in self._ranked()]
        alone = [[(move, share)] for move, share in product(good, _SHARES[1:])]
        for elsewhere in ambients:
            self._try([[], *kept[:_KEPT], *alone], elsewhere)
        ranked = self._ranked()
        if not ranked:
            return None
        worth = np.minimum(_worth(ranked), 3.0 * CLEAR)  # a run that is clearer is not worth more effort
        near = [index for index in range(len(ranked)) if worth[index] >= _NEARLY * worth[0]]
        return ranked[min(near, key=lambda index: (ranked[index].effort, -worth[index]))]

    def _try(self, programs: Iterable[Sequence[tuple[Move, float]]], ambient: float) -> None:
        """Programs of moves that take shares of the time, and rest for what is left."""
        for shares in programs:
            phases = [Phase(move, round(share * self.seconds / STEP) * STEP) for move, share in shares]
            left = round(self.seconds / STEP) * STEP - sum(phase.seconds for phase in phases)
            phases += [Phase(Move(), left)] if left >= STEP else []
            wanted = Program(tuple(one for one in phases if one.seconds > 0), ambient, ambient != self.stage.ambient)
            if wanted not in self.trials:
                self.trials[wanted] = self._trial(wanted)

    def _trial(self, wanted: Program) -> ProgramTrial | None:
        """`None` for what gets too hot, or runs away."""
        run = self.stage.run(wanted)
        try:
            predictions = self.rivals.predict(run)
        except SimulationError:
            return None
        if max(float(prediction.readings.max()) for prediction in predictions) > self.limit:
            return None
        apart = self.rivals.apart(predictions, run)
        return ProgramTrial(wanted, tuple(separation.deviations for separation in apart.values()))

    def _ranked(self) -> list[ProgramTrial]:
        """Those that stay cool enough, the best first."""
        done = [trial for trial in self.trials.values() if trial is not None]
        return [done[index] for index in np.argsort(-_worth(done), kind="stable")] if done else []


def _worth(trials: Sequence[ProgramTrial]) -> FloatArray:
    """For each program the deviations of its weakest pair, shape (programs,).

    A pair that no program sets apart has no say, unless there is no other.
    """
    deviations = np.array([trial.deviations for trial in trials])
    possible = deviations.max(axis=0) >= CLEAR
    return np.asarray((deviations[:, possible] if possible.any() else deviations).min(axis=1))


# --- The proposal: how two rivals differ in it, by how much, where and when --------------------------------


class Difference(NamedTuple):
    """How two rivals differ in the proposed run.

    Args:
        pair: the rivals, effect and place each; where they differ most the first is the warmer one.
        kelvin: the largest difference that no change of parameters takes away, mean of a minute [K].
        as_fitted: the largest difference of the predictions as the old data leave them [K].
        deviations: of all readings together, in standard deviations.
        node: where it is largest.
        minute: when.
    """

    pair: tuple[Key, Key]
    kelvin: float
    as_fitted: float
    deviations: float
    node: str
    minute: float

    @property
    def clear(self) -> bool:
        """Whether the run decides between the two in four cases of five."""
        return self.deviations >= CLEAR

    def as_json(self) -> dict[str, object]:
        """The difference as other tools read it."""
        return {
            "pair": [list(key) for key in self.pair],
            "kelvin": self.kelvin,
            "kelvin_as_fitted": self.as_fitted,
            "deviations": self.deviations,
            "node": self.node,
            "minute": self.minute,
            "clear": self.clear,
        }


def difference(
    pair: tuple[Key, Key], apart: Separation, fitted: FloatArray, nodes: Sequence[str], measured: BoolArray
) -> Difference:
    """Where and when the two differ most, of what can be seen.

    Args:
        pair: the rivals.
        apart: how far their predictions lie apart.
        fitted: difference of the predictions as the old data leave them [K], shape (nodes, n).
        nodes: names of its rows.
        measured: which of them have a sensor, shape (nodes,).
    """
    per_minute = round(60 / STEP)
    minutes = apart.left.shape[1] // per_minute
    means = apart.left[:, : minutes * per_minute].reshape(len(nodes), minutes, per_minute).mean(axis=2)
    means[~measured] = 0.0
    row, column = np.unravel_index(int(np.argmax(np.abs(means))), means.shape)
    largest, as_fitted = float(means[row, column]), float(np.abs(fitted[measured]).max())
    warmer = pair if largest >= 0 else pair[::-1]
    return Difference(warmer, abs(largest), as_fitted, apart.deviations, nodes[int(row)], float(column + 1))


@dataclass(frozen=True)
class Experiment:
    """A proposed run.

    Args:
        rivals: effect and place of each.
        program: moves, durations and air.
        run: the inputs as a log's columns, in steps of 10 s.
        differences: of each pair of rivals, the clearest first.
        predictions: of each rival [degC], shape (nodes, n); mean over each step.
        nodes: in the order of the predictions.
        limit: the temperature that no prediction passes [degC].
        tried: how many runs were compared.
        moves: the moves as other tools read them.
        words: what to do, a sentence or two.
    """

    rivals: tuple[Key, ...]
    program: Program
    run: Run
    differences: tuple[Difference, ...]
    predictions: Mapping[Key, FloatArray]
    nodes: tuple[str, ...]
    limit: float
    tried: int
    moves: tuple[dict[str, object], ...]
    words: str

    @property
    def separates(self) -> bool:
        """Whether the run decides at least one of the pairs in four cases of five."""
        return any(contrast.clear for contrast in self.differences)

    @property
    def weakest(self) -> Difference:
        """The least clear pair of those that the run separates; if it separates none, of all."""
        return [contrast for contrast in self.differences if contrast.clear or not self.separates][-1]

    @property
    def indistinguishable(self) -> tuple[tuple[Key, Key], ...]:
        """Pairs that the run leaves undecided."""
        return tuple(contrast.pair for contrast in self.differences if not contrast.clear)

    @property
    def time(self) -> FloatArray:
        """Middle of each step of the predictions [s], shape (n,)."""
        return np.asarray(self.run.time + 0.5 * self.run.step)

    def text(self) -> str:
        """What to do, what each rival predicts, and what to conclude."""
        least, minutes = self.weakest, self.program.seconds / 60
        warmer, colder = (named(key) for key in least.pair)
        shown = (
            f"At {least.minute:.0f} min {least.node} is then {least.kelvin:.2g} K warmer if it is {warmer} "
            f"than if it is {colder}, whatever the other parameters are"
        )
        if not self.separates:
            reach = f"{minutes:.0f} min within the loads, speeds and temperatures of these logs"
            if least.deviations < 1.0:
                return (
                    f"No run of {reach} tells {warmer} from {colder}: in the best of {self.tried} they stay within one "
                    "standard deviation of each other, whatever the other parameters are."
                )
            return (
                f"No run of {reach} is sure to tell {warmer} from {colder}. The best of {self.tried} would in fewer "
                f"than four cases of five: {self.words} {shown} ({least.deviations:.1f} standard deviations)."
            )
        pairs = "; ".join(listed([named(key) for key in pair]) for pair in self.indistinguishable)
        rest = f" It does not tell apart {pairs}." if pairs else ""
        decided = "Fit that log as well: the wrong one is then refused."
        return f"{self.words} {shown} ({least.deviations:.0f} standard deviations). {decided}{rest}"

    def as_json(self) -> dict[str, object]:
        """The experiment as other tools read it."""
        return {
            "rivals": [list(key) for key in self.rivals],
            "separates": self.separates,
            "text": self.text(),
            "minutes": self.program.seconds / 60,
            "ambient": self.program.ambient,
            "moves": list(self.moves),
            "differences": [contrast.as_json() for contrast in self.differences],
            "hottest": float(max(readings.max() for readings in self.predictions.values())),
            "limit": self.limit,
            "tried": self.tried,
        }


@one_blas_thread
def propose(
    rivals: Sequence[Step],
    *,
    minutes: float = 20.0,
    ambients: Sequence[float] | None = None,
    limit: float | None = None,
    allowed: Sequence[Move] | None = None,
) -> Experiment | None:
    """The run that best tells rivals apart, of those that the fitted logs show to be possible.

    Each rival's parameters may move as far as the old data let them to meet the other's prediction; what is left
    between the two, in units of the sensors' noise, is made as large as it gets for the pair where it is smallest.

    Args:
        rivals: refitted candidates that the data can't tell apart, of one baseline.
        minutes: how long the run may last.
        ambients: temperatures of the air that can be had [degC] beside the logs' own; by default 12 K colder and
            12 K warmer.
        limit: highest temperature that a prediction may reach [degC]; by default 10 K above the hottest reading.
        allowed: what the robot can do; by default all `possible_moves`.

    Returns:
        The experiment; `None` with fewer than two rivals, or if no run stays below the limit. See
        `Experiment.separates` for whether it decides anything.

    Source: [AtkinsonFedorov1975].
    """
    if len(rivals) < 2:
        return None
    fits, stage, keys = [rival.fit for rival in rivals], _stage(rivals), tuple(rival.key for rival in rivals)
    bound_runs = fits[0].problem.bound_runs
    hottest = max(float(np.nanmax(bound.measured)) for bound in bound_runs)
    search = ProgramSearch(stage, Rivals(fits), 60.0 * minutes, hottest + _BEYOND if limit is None else limit)
    others = [round(stage.ambient) + shift for shift in _OTHER_AIR] if ambients is None else list(ambients)
    moves = possible_moves(rivals) if allowed is None else list(allowed)
    best = search.best(moves, others if stage.air_can_change else ())
    if best is None:
        return None
    run, nodes = stage.run(best.program), tuple(stage.nodes)
    predictions = search.rivals.predict(run)
    measured = np.any([bound.counted.any(axis=1) for bound in bound_runs], axis=0)
    differences = [
        difference(
            (keys[one], keys[other]), apart, predictions[one].readings - predictions[other].readings, nodes, measured
        )
        for (one, other), apart in search.rivals.apart(predictions, run).items()
    ]
    return Experiment(
        keys,
        best.program,
        run,
        tuple(sorted(differences, key=lambda contrast: -contrast.deviations)),
        {key: prediction.readings for key, prediction in zip(keys, predictions, strict=True)},
        nodes,
        search.limit,
        len(search.trials),
        tuple(stage.as_json(best.program)),
        stage.text(best.program),
    )


def possible_moves(rivals: Sequence[Step]) -> list[Move]:
    """The moves that a proposal is made of: joints in question, their classes, all; loaded, moving, or both.

    Args:
        rivals: refitted candidates of one baseline.
    """
    places = [
        instance.place
        for rival in rivals
        for instance in rival.fit.model.network.effect_instances
        if (instance.effect.key, instance.declaration.where) == rival.key
    ]
    return _stage(rivals).moves(places)


def _stage(rivals: Sequence[Step]) -> Stage:
    return Stage([rival.fit.model for rival in rivals], [bound.run for bound in rivals[0].fit.problem.bound_runs])
