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
from dataclasses import dataclass, replace
from itertools import combinations, permutations, product
from math import sqrt
from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.places import EVERYWHERE, class_of, is_glob, matching
from lptn.basics.processes import one_blas_thread
from lptn.basics.words import listed
from lptn.diagnose.answers import Key, Step, named
from lptn.diagnose.excitation import STILL
from lptn.diagnose.fit_statistics import POWER, TIE, fitted_errors, independent_readings
from lptn.identify.fitting import Fit
from lptn.identify.problem import AT_REST, Problem
from lptn.logs.columns import column_unit, place_of, quantity_of
from lptn.logs.resampling import means_of_blocks
from lptn.logs.run import Run
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import Sensitivities, SimulationError, sensitivities

STEP = 10.0
"""s, of a proposed run; short against the time constants of a joint."""
CLEAR = POWER + sqrt(POWER**2 + TIE)
"""Standard deviations of a difference from which on a refit decides in four cases of five: the information
criterion's lead, its expected square with a scatter of twice its root, must exceed what counts as a tie."""
_BEYOND = 10.0  # K above the hottest reading that a proposed run may reach: a little more than the logs show is safe
_OTHER_AIR = (-12.0, 12.0)  # K: a cold room, a warm one


# --- What can be asked of a robot: loads and speeds that its logs have shown --------------------------------


_LOADS = ("torque", "current", "torque_abs", "current_abs")
_SPEEDS = ("velocity", "velocity_rms")
_PRODUCTS = ("mechanical_power",)
_BASE = "speed.base"
_ORDINARY = 0.95  # quantile of a column while it is in use: high, yet nothing that happened only once
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


class Program(NamedTuple):
    """Moves one after the other.

    Args:
        phases: the moves.
        ambient: temperature of the air, and of the whole robot at the beginning [degC].
    """

    phases: tuple[Phase, ...]
    ambient: float

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
        rivals: refitted candidates of one baseline.
    """

    def __init__(self, rivals: Sequence[Step]) -> None:
        models = [rival.fit.model for rival in rivals]
        runs = [bound.run for bound in rivals[0].fit.problem.bound_runs]
        acts = [(rival.key, one) for rival in rivals for one in rival.fit.model.network.effect_instances]
        places = [one.place for key, one in acts if (one.effect.key, one.declaration.where) == key]
        self._asked = dict.fromkeys(end for place in places for end in place.split("~"))
        columns = dict.fromkeys(name for model in models for name in model.inputs if name not in model.started)
        self.nodes = models[0].nodes
        self.given = [name for name in columns if name.startswith("temperature.")]
        self.inputs = [name for name in columns if name not in self.given]
        # Loads and speeds that no model asks for say in words what a move is.
        told = (name for name in runs[0].columns if quantity_of(name) in (*_LOADS, *_SPEEDS))
        self.columns = dict.fromkeys([*self.inputs, *(name for name in told if all(run.has(name) for run in runs))])
        names = (*self.columns, *self.given)
        self._values = {name: np.concatenate([run.columns[name] for run in runs]) for name in names}
        quantities = dict.fromkeys(map(quantity_of, self.inputs))
        heats = [name for name in quantities if name not in (*_SPEEDS, *_PRODUCTS, quantity_of(_BASE))]
        self._heating = [load for load in _LOADS if load in quantities] or heats  # as the heat of a heater
        self.joints = list(dict.fromkeys(place_of(name) for name in self.inputs if quantity_of(name) in self._heating))
        """Places whose load, or heat where no load is logged, can be chosen."""
        self.moving = any(quantity_of(name) in (*_SPEEDS, *_PRODUCTS) for name in self.inputs)
        """Whether any model asks for the joints' speeds, or for their power."""
        self.high = {}
        self._works: BoolArray = np.zeros(sum(len(run) for run in runs), dtype=bool)
        for name in self.columns:
            sizes = np.abs(self._values[name])
            in_use = sizes[sizes > STILL * sizes.max(initial=0.0)]
            self.high[name] = float(np.quantile(in_use, _ORDINARY)) if in_use.size else 0.0
            if quantity_of(name) in (*self._heating, *_SPEEDS) and self.high[name] > 0:
                self._works |= sizes > STILL * self.high[name]
        prescribed = {name: source for name, source in models[0].network.prescribed.items() if source in self.given}
        air = prescribed.get("ambient", next(iter(prescribed.values())) if len(prescribed) == 1 else None)
        self._air = air if isinstance(air, str) else None
        self.air_can_change = self._air is not None or not self.given
        """Whether the air's temperature is an input of the models, or nothing is prescribed."""
        sensed = [run.columns[f"temperature.{n}"] for n in self.nodes for run in runs if run.has(f"temperature.{n}")]
        firsts = [readings[np.isfinite(readings)][:1] for readings in sensed]
        self.ambient = float(np.median(self._values[self._air] if self._air else np.concatenate(firsts)))
        """The usual temperature of the air in the logs [degC]; without its column, of the nodes at the start."""

    def moves(self) -> list[Move]:
        """Every move to be considered: the joints where rivals act, their classes, all; loaded, moving, or both."""
        asked = [end for end in self._asked if end in self.joints]
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
        quantity, place = quantity_of(column), place_of(column)
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
                "load_unit": " and ".join(self._loads(phase.move)),
                "inputs": {name: self.value(name, phase.move) for name in self.columns},
            }
            for phase in wanted.phases
        ]

    def text(self, wanted: Program) -> str:
        """What to do, a sentence or two that a technician can follow."""
        air = f"With the robot at rest and as warm as the air, {wanted.ambient:.0f} degC"
        air += ", which is not the temperature of the logs" if wanted.ambient != self.ambient else ""
        phases = [f"{self._doing(phase.move)} for {phase.seconds / 60:.3g} min" for phase in wanted.phases]
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
        speed = next((speed for speed in _SPEEDS if any(quantity_of(name) == speed for name in self.columns)), "")
        columns = [f"{speed}.{joint}" for joint in move.joints if f"{speed}.{joint}" in self.high]
        pace = f"{_range([self.value(name, move) for name in columns], 'rad/s')} on average"
        return f"move {where} at {pace} with {load}" if move.load else f"swing {where} without load at {pace}"

    def _loads(self, move: Move) -> dict[str, list[float]]:
        """Values of a move's load, by their unit: each joint logs its own, torque here, current there."""
        loads: dict[str, list[float]] = {}
        for joint in move.joints:
            names = [name for quantity in self._heating if (name := f"{quantity}.{joint}") in self.inputs]
            for name in names[:1]:
                unit = column_unit(name)
                unit = f"of {quantity_of(name)}" if unit in ("", "1") else unit
                loads.setdefault(unit, []).append(self.value(name, move))
        return loads


def _range(values: Sequence[float], unit: str) -> str:
    """One value, or the least and the largest where these are told apart by two digits."""
    if not values:
        return f"the usual {unit}"
    if max(values) <= 1.1 * min(values):
        return f"{sum(values) / len(values):.2g} {unit}"
    return f"{min(values):.2g} to {max(values):.2g} {unit}"


# --- How far rivals' predictions of a run lie apart after each has done what it can to agree ------


_UNDETERMINED = 10.0
"""One standard deviation, in the search's own scale (logarithms, typical sizes), of a parameter that no data hold: in
effect none."""
_MODEL_ERROR = 0.03**2 * 600.0  # K²s: 0.03 K for ten minutes; no model of a real robot is better, however many readings


class Difference(NamedTuple):
    """How two rivals' predictions of a run differ after the one that is wrong has done what it can to agree.

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
        return self.deviations >= CLEAR

    def as_json(self) -> dict[str, object]:
        """The difference as other tools read it."""
        return self._asdict() | {"clear": self.clear}


class Rivals:
    """Fits that the old data can't tell apart.

    Args:
        steps: the rivals, all of the same nodes and runs.
    """

    def __init__(self, steps: Sequence[Step]) -> None:
        self.keys, self.fits = [step.key for step in steps], [step.fit for step in steps]
        self._density = noise_density(min(self.fits, key=lambda fit: fit.cost))
        self._priors = [self._prior(fit) for fit in self.fits]
        bound_runs = self.fits[0].problem.bound_runs
        self._measured = np.any([bound.counted.any(axis=1) for bound in bound_runs], axis=0)

    def predict(self, run: Run) -> list[Sensitivities]:
        """Each rival's prediction of a run, with its derivatives by the search's coordinates and the states at rest.

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
            predicted.append(replace(simulated, derivatives=moved))
        return predicted

    def apart(self, predictions: Sequence[Sensitivities], run: Run) -> list[Difference]:
        """For each pair the smaller of both ways round: whichever of the two is true, so much is to be seen.

        Args:
            predictions: of one run.
            run: that run.
        """
        weight, differences = np.sqrt(run.step / self._density)[:, None], []
        for pair in combinations(range(len(self.fits)), 2):
            fitted = predictions[pair[0]].readings - predictions[pair[1]].readings
            weighted, both = fitted * weight, list[tuple[float, FloatArray]]()
            for wrong in pair:
                rows = (predictions[wrong].derivatives * weight[:, :, None]).reshape(weighted.size, -1)
                pull = rows.T @ weighted.ravel()
                change = np.linalg.solve(self._priors[wrong] + rows.T @ rows, pull)
                rise = max(float(np.sum(weighted**2) - pull @ change), 0.0)
                both.append((sqrt(rise), (weighted - (rows @ change).reshape(weighted.shape)) / weight))
            deviations, left = min(both, key=lambda way: way[0])
            minutes = means_of_blocks(left, round(60 / STEP)) * self._measured[:, None]
            row, column = np.unravel_index(int(np.argmax(np.abs(minutes))), minutes.shape)
            keys, most = (self.keys[pair[0]], self.keys[pair[1]]), float(minutes[row, column])
            differences.append(
                Difference(
                    keys if most >= 0 else keys[::-1],
                    abs(most),
                    float(np.abs(fitted[self._measured]).max()),
                    deviations,
                    self.fits[0].model.nodes[int(row)],
                    float(column + 1),
                )
            )
        return differences

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


_SHARES = (0.2, 0.4, 0.6, 0.8, 1.0)  # of the time for a single move; rest is left at the end. Several take four fifths
_KEPT = 6  # moves, pairs, programs that are followed further: some 200 programs in all, a second or two
_NEARLY = 0.85  # share of the best that a simpler run must reach: that is a third more time of the same run


def best_program(
    stage: Stage, rivals: Rivals, moves: Sequence[Move], ambients: Iterable[float], seconds: float, limit: float
) -> tuple[Program | None, int]:
    """The simplest program that is nearly as good as the best, `None` if all run too hot; and how many were tried.

    Args:
        stage: turns programs into runs.
        rivals: the fits.
        moves: what can be done.
        ambients: temperatures of the air beside the logs' own [degC].
        seconds: how long a run may last.
        limit: highest temperature that a prediction may reach [degC].
    """
    tried: dict[Program, list[float]] = {}  # deviations of each pair; none for what gets too hot, or runs away

    def attempt(programs: Iterable[Sequence[tuple[Move, float]]], ambient: float) -> None:
        """Programs of moves that take shares of the time, and rest for what is left."""
        for shares in programs:
            phases = [Phase(move, round(share * seconds / STEP) * STEP) for move, share in shares]
            left = round(seconds / STEP) * STEP - sum(phase.seconds for phase in phases)
            phases += [Phase(Move(), left)] if left >= STEP else []
            program = Program(tuple(one for one in phases if one.seconds > 0), ambient)
            if program in tried:
                continue
            run, tried[program] = stage.run(program), []
            try:
                predictions = rivals.predict(run)
            except SimulationError:
                continue
            if max(float(prediction.readings.max()) for prediction in predictions) <= limit:
                tried[program] = [difference.deviations for difference in rivals.apart(predictions, run)]

    def ranked() -> list[tuple[Program, float]]:
        """Those that stay cool, the best first, with the deviations of its weakest pair.

        A pair that no program sets apart has no say, unless there is no other.
        """
        cool = [program for program, deviations in tried.items() if deviations]
        if not cool:
            return []
        deviations = np.array([tried[program] for program in cool])
        possible = deviations.max(axis=0) >= CLEAR
        worth = (deviations[:, possible] if possible.any() else deviations).min(axis=1)
        return [(cool[k], float(worth[k])) for k in np.argsort(-worth, kind="stable")]

    def effort(program: Program) -> int:
        """What it asks of people: other air is the most trouble, then a rig that loads a moving joint."""
        work = [phase.move for phase in program.working]
        rigs = sum(move.load > 0 and move.speed > 0 and move.at != EVERYWHERE for move in work)
        return 2 * (program.ambient != stage.ambient) + max(len(work) - 1, 0) + rigs

    attempt([[], *([(move, share)] for move, share in product(moves, _SHARES[2::2]))], stage.ambient)
    working = (program.working for program, _ in ranked())
    good = list(dict.fromkeys(phases[0].move for phases in working if phases))[:_KEPT]
    attempt([[(move, share)] for move, share in product(good, _SHARES)], stage.ambient)
    attempt([[(move, _SHARES[-2] / 2) for move in pair] for pair in permutations(good, 2)], stage.ambient)
    working = (program.working for program, _ in ranked())
    pairs = [[phase.move for phase in phases] for phases in working if len(phases) == 2][:_KEPT]
    threes = ([*pair, third] for pair, third in product(pairs, good) if third != pair[1])
    attempt([[(move, _SHARES[-2] / 3) for move in three] for three in threes], stage.ambient)
    kept = [[(phase.move, phase.seconds / seconds) for phase in program.phases] for program, _ in ranked()[:_KEPT]]
    alone = [[(move, share)] for move, share in product(good, _SHARES[1:])]
    for elsewhere in ambients:
        attempt([[], *kept, *alone], elsewhere)
    # A run that is clearer is not worth more effort.
    worth = {program: min(deviations, 3.0 * CLEAR) for program, deviations in ranked()}
    near = [program for program in worth if worth[program] >= _NEARLY * max(worth.values())]
    return min(near, key=lambda program: (effort(program), -worth[program]), default=None), len(tried)


# --- The proposal: how rivals differ in it, by how much, where and when ----------------------------------------


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
        tried: how many runs were compared.
        moves: the moves as other tools read them.
        words: what to do, a sentence or two.
    """

    rivals: tuple[Key, ...]
    program: Program
    run: Run
    differences: tuple[Difference, ...]
    predictions: Mapping[Key, FloatArray]
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
    stage, fitted = Stage(rivals), Rivals(rivals)
    if limit is None:
        limit = _BEYOND + max(float(np.nanmax(bound.measured)) for bound in rivals[0].fit.problem.bound_runs)
    others = [round(stage.ambient) + shift for shift in _OTHER_AIR] if ambients is None else ambients
    moves = stage.moves() if allowed is None else allowed
    best, tried = best_program(stage, fitted, moves, others if stage.air_can_change else (), 60.0 * minutes, limit)
    if best is None:
        return None
    run = stage.run(best)
    predictions = fitted.predict(run)
    differences = sorted(fitted.apart(predictions, run), key=lambda contrast: -contrast.deviations)
    return Experiment(
        tuple(fitted.keys),
        best,
        run,
        tuple(differences),
        {key: prediction.readings for key, prediction in zip(fitted.keys, predictions, strict=True)},
        limit,
        tried,
        tuple(stage.as_json(best)),
        stage.text(best),
    )


def possible_moves(rivals: Sequence[Step]) -> list[Move]:
    """The moves that a proposal is made of, for two and more refitted candidates of one baseline; see `propose`."""
    return Stage(rivals).moves()
