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
from dataclasses import dataclass
from itertools import combinations
from math import sqrt
from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.places import EVERYWHERE
from lptn.basics.processes import one_blas_thread
from lptn.basics.words import listed
from lptn.diagnose.answers import Key, Step, named
from lptn.diagnose.experiment_runs import (
    STEP,
    Move,
    Program,
    ProgramRuns,
    instructions,
    moves,
    program,
    unit_of,
)
from lptn.diagnose.fit_statistics import (
    POWER,
    TIE,
    block_misfits,
    block_numbers,
    criterion_difference,
    fitted_errors,
    independent_readings,
)
from lptn.identify.fitting import Fit
from lptn.identify.problem import Problem
from lptn.logs.run import Run
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import SimulationError, sensitivities

_BEYOND = 10.0  # K above the hottest reading that a proposed run may reach
_OTHER_AIR = (-12.0, 12.0)  # K: a cold room, a warm one


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
        clear = [contrast for contrast in self.differences if contrast.clear]
        return (clear or list(self.differences))[-1]

    @property
    def indistinguishable(self) -> tuple[tuple[Key, Key], ...]:
        """Pairs that the run leaves undecided."""
        return tuple(contrast.pair for contrast in self.differences if not contrast.clear)

    @property
    def time(self) -> FloatArray:
        """Middle of each step of the predictions [s], shape (n,)."""
        return np.asarray(self.run.time + 0.5 * self.run.step)

    def text(self) -> str:
        """What to do and what it will show, in two or three sentences."""
        least, minutes = self.weakest, self.program.seconds / 60
        if not self.separates:
            one, other = (named(key) for key in least.pair)
            reach = f"{minutes:.0f} min within the loads, speeds and temperatures of these logs"
            if least.deviations < _NOTHING_SEEN:
                return (
                    f"No run of {reach} tells {one} from {other}: in the best of {self.tried} they stay within one "
                    "standard deviation of each other, whatever the other parameters are."
                )
            return (
                f"No run of {reach} is sure to tell {one} from {other}. The best of {self.tried} would in fewer "
                f"than four cases of five: {self.words} At {least.node} the two predictions then differ by "
                f"{least.kelvin:.2g} K, whatever the other parameters are ({least.deviations:.1f} standard deviations)."
            )
        what = "the two predictions" if len(self.rivals) == 2 else listed([named(key) for key in least.pair])
        shown = f"At {least.minute:.0f} min {what} differ by {least.kelvin:.2g} K at {least.node}"
        sure = f"whatever the other parameters are ({least.deviations:.0f} standard deviations)"
        pairs = "; ".join(listed([named(key) for key in pair]) for pair in self.indistinguishable)
        rest = f" It does not tell apart {pairs}." if pairs else ""
        return f"{self.words} {shown}, {sure}.{rest}"

    def as_json(self) -> dict[str, object]:
        """The experiment as other tools read it."""
        return {
            "rivals": [list(key) for key in self.rivals],
            "separates": self.separates,
            "text": self.text(),
            "minutes": self.program.seconds / 60,
            "ambient": self.program.ambient,
            "moves": list(self.moves),
            "differences": [
                {
                    "pair": [list(key) for key in contrast.pair],
                    "kelvin": contrast.kelvin,
                    "kelvin_as_fitted": contrast.as_fitted,
                    "deviations": contrast.deviations,
                    "decisive": contrast.decisive,
                    "node": contrast.node,
                    "minute": contrast.minute,
                    "clear": contrast.clear,
                }
                for contrast in self.differences
            ],
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
    fits = [rival.fit for rival in rivals]
    stage = _stage(rivals)
    hottest = max(float(np.nanmax(bound.measured)) for bound in fits[0].problem.bound_runs)
    highest = hottest + _BEYOND if limit is None else limit
    search = ProgramSearch(stage, Rivals(fits), 60.0 * minutes, highest)
    considered = possible_moves(rivals) if allowed is None else list(allowed)
    best = search.best(considered, _air(stage, ambients))
    return None if best is None else _experiment(rivals, search, best)


def possible_moves(rivals: Sequence[Step]) -> list[Move]:
    """The moves that a proposal is made of: joints in question, their classes, all; loaded, moving, or both.

    Args:
        rivals: refitted candidates of one baseline.
    """
    return moves(_stage(rivals).logged, [place for rival in rivals for place in _places(rival)])


def _places(rival: Step) -> list[str]:
    """The single places where a rival's effect acts."""
    instances = rival.fit.model.network.effect_instances
    return [instance.place for instance in instances if (instance.effect.key, instance.declaration.where) == rival.key]


def _stage(rivals: Sequence[Step]) -> ProgramRuns:
    bound_runs = rivals[0].fit.problem.bound_runs
    return ProgramRuns([rival.fit.model for rival in rivals], [bound.run for bound in bound_runs])


def _air(stage: ProgramRuns, ambients: Sequence[float] | None) -> list[float]:
    if not stage.air_can_change:
        return []
    return [round(stage.ambient) + shift for shift in _OTHER_AIR] if ambients is None else list(ambients)


def _experiment(rivals: Sequence[Step], search: ProgramSearch, best: ProgramTrial) -> Experiment:
    keys = tuple(rival.key for rival in rivals)
    run = search.stage.run(best.program)
    predictions = search.rivals.predict(run)
    apart = search.rivals.apart(predictions, run)
    nodes = tuple(search.stage.nodes)
    measured = np.any([bound.counted.any(axis=1) for bound in rivals[0].fit.problem.bound_runs], axis=0)
    differences = []
    for (one, other), separation in apart.items():
        fitted = predictions[one].readings - predictions[other].readings
        differences.append(difference((keys[one], keys[other]), separation, fitted, nodes, measured))
    return Experiment(
        keys,
        best.program,
        run,
        tuple(sorted(differences, key=lambda contrast: -contrast.decisive)),
        {key: prediction.readings for key, prediction in zip(keys, predictions, strict=True)},
        nodes,
        search.limit,
        len(search.trials),
        tuple(_table(best.program, search.stage)),
        instructions(best.program, search.stage.logged),
    )


def _table(program: Program, stage: ProgramRuns) -> list[dict[str, object]]:
    """Each move with the values of every input that it sets."""
    return [
        {
            "at": phase.move.at,
            "joints": list(phase.move.joints),
            "travelling": phase.move.travelling,
            "minutes": phase.seconds / 60,
            "load_unit": " and ".join(dict.fromkeys(map(unit_of, stage.logged.loads(phase.move)))),
            "inputs": {name: stage.logged.value(name, phase.move) for name in stage.logged.columns},
        }
        for phase in program.phases
    ]


# --- How far rivals' predictions of a run lie apart after each has done what it can to agree ------


_START_SPREAD = 5.0  # K; a state's initial temperature may lie so far from the air's
_UNDETERMINED = 10.0  # prior in the search's own scale (logarithms, typical sizes) of a parameter that no data hold
_MODEL_ERROR, _MODEL_ERROR_TIME = 0.03, 600.0  # K, s: no model of a real robot is better, however many readings
_EVEN = 3.3  # a difference so many times its scatter from block to block; from 3 on two fits differ clearly
_NO_SENSOR = 1e3  # K; noise of a node that isn't measured: it says nothing


@dataclass(frozen=True)
class RivalPrediction:
    """A rival's prediction of one run.

    Args:
        readings: degC, shape (nodes, n).
        moved: their derivatives by the rival's parameters and initial states, shape (nodes, n, unknowns).
    """

    readings: FloatArray
    moved: FloatArray


@dataclass(frozen=True)
class Separation:
    """How one rival's prediction differs from another's after the other has adapted.

    Args:
        deviations: square root of the expected rise of the sum of squared weighted residuals.
        decisive: the same, less where few blocks of the run hold all of the difference: what shows but once may be
            anything, and a refit calls such rivals tied.
        left: what is left of the difference [K], shape (nodes, n).
    """

    deviations: float
    decisive: float
    left: FloatArray


class Rivals:
    """Fits that the old data can't tell apart.

    Args:
        fits: the rivals, all of the same nodes and runs.
    """

    def __init__(self, fits: Sequence[Fit]) -> None:
        self.fits = list(fits)
        self._density = noise_density(min(self.fits, key=lambda fit: fit.cost))
        self._misfits = [block_misfits(fitted_errors(fit), fit.problem.sigma)[0].sum(axis=1) for fit in self.fits]
        self._priors = [self._prior(fit) for fit in self.fits]
        self._open = {pair: self._orders(pair) for pair in self.pairs}

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Each two of them once."""
        return list(combinations(range(len(self.fits)), 2))

    def predict(self, run: Run) -> list[RivalPrediction]:
        """All predictions of a run.

        Raises:
            SimulationError: a model runs away.
        """
        return [_predicted(fit, run) for fit in self.fits]

    def apart(self, predictions: Sequence[RivalPrediction], run: Run) -> dict[tuple[int, int], Separation]:
        """For each pair the less decisive of both ways round: whichever of the two is true, so much is to be seen.

        Args:
            predictions: of one run.
            run: that run.
        """
        weight = np.sqrt(run.step / self._density)
        rows = [
            (prediction.moved * weight[:, None, None]).reshape(-1, prediction.moved.shape[2])
            for prediction in predictions
        ]
        information = [prior + jacobian.T @ jacobian for prior, jacobian in zip(self._priors, rows, strict=True)]
        separations = {}
        for pair in self.pairs:
            difference = predictions[pair[0]].readings - predictions[pair[1]].readings
            both = []
            for true, wrong in self._open[pair]:
                rise, left = _absorbed(rows[wrong], information[wrong], difference, weight)
                before = self._misfits[wrong] - self._misfits[true]
                both.append(self._separation(rise, left, weight, run, before))
            separations[pair] = min(both, key=lambda separation: separation.decisive)
        return separations

    def _orders(self, pair: tuple[int, int]) -> list[tuple[int, int]]:
        """Which of a pair may be the true one and which the wrong one, where the old data have not decided that."""
        better, worse = sorted(pair, key=lambda number: self.fits[number].cost)
        undecided = criterion_difference(self.fits[worse], self.fits[better]) <= TIE
        return [(better, worse), (worse, better)] if undecided else [(better, worse)]

    def _separation(
        self, rise: float, left: FloatArray, weight: FloatArray, run: Run, before: FloatArray
    ) -> Separation:
        """How decisive a difference is, together with what the old data say, block by block."""
        best = self.fits[0]
        repeats = run.step / _mean_step(best)
        squares = np.sum((left / best.problem.sigma[:, None]) ** 2, axis=0) * repeats
        new = np.bincount(block_numbers(bind(best.model, run)), squares)
        # What adapting to the new run costs on the old data shows all over them.
        seen = float(np.sum((left * weight[:, None]) ** 2))
        cost = new.sum() * max(rise - seen, 0.0) / seen if seen > 0 else 0.0
        rises = np.concatenate([new, before + cost / len(before)])
        scatter = float(np.sqrt(np.sum((rises - rises.mean()) ** 2)))
        share = min(max(float(rises.sum()) / (_EVEN * scatter), 0.0), 1.0) if scatter > 0 else 1.0
        deviations = float(np.sqrt(max(rise, 0.0)))
        return Separation(deviations, share * deviations, left)

    def _prior(self, done: Fit) -> FloatArray:
        """Information on parameters from the old data, on initial states from the robot's being at rest."""
        old = done.problem
        sigma = np.sqrt(self._density / _mean_step(done))
        hessian = Problem(old.model, old.bound_runs, sigma, old.symmetry_penalty, old.free).normal(done.z)[1]
        free, states = len(old.free), len(done.model.states)
        across, starts = hessian[:free, free:], hessian[free:, free:]
        information = np.zeros((free + states, free + states))
        schur = hessian[:free, :free] - across @ np.linalg.solve(starts, across.T)
        information[:free, :free] = 0.5 * (schur + schur.T) + np.eye(free) / _UNDETERMINED**2
        information[free:, free:] = np.eye(states) / _START_SPREAD**2
        return information


def noise_density(done: Fit) -> FloatArray:
    """Variance of each node's readings times the time after which they are new information [K²s], shape (nodes,).

    The steps of a coarse sensor repeat their error for as long as the temperature stays within one: such readings
    count as often as their residuals' correlation in time allows. A small, slow error of the model is added: a
    difference of hundredths of a kelvin decides nothing.
    """
    bound_runs, errors = done.problem.bound_runs, done.residuals
    repeated = max(1.0, done.problem.readings / independent_readings(fitted_errors(done)))
    variance = np.empty(len(done.model.nodes))
    for row, floor in enumerate(done.noise.floor):
        residual = np.concatenate(
            [error[row][bound.counted[row]] for error, bound in zip(errors, bound_runs, strict=True)]
        )
        variance[row] = max(float(np.mean(residual**2)), floor**2) if residual.size else _NO_SENSOR**2
    return np.asarray(variance * repeated * _mean_step(done) + _MODEL_ERROR**2 * _MODEL_ERROR_TIME)


def _mean_step(done: Fit) -> float:
    """Of the runs, each counted by its readings [s]."""
    bound_runs = done.problem.bound_runs
    counts = [int(bound.counted.sum()) for bound in bound_runs]
    return float(np.average([bound.run.step for bound in bound_runs], weights=counts))


def _predicted(done: Fit, run: Run) -> RivalPrediction:
    model, free = done.model, done.problem.free
    # The fit's own choice of parameters: its stepper, compiled already, is used again.
    simulated = sensitivities(model, bind(model, run), model.values, free)
    moved = simulated.derivatives.copy()
    moved[:, :, : len(free)] *= done.problem.slope(model.values)
    nodes, starts = len(model.nodes), moved[:, :, len(free) :]
    starts[:, :, :nodes] += starts[:, :, nodes:] @ model.resting_shares
    return RivalPrediction(simulated.readings, moved)


def _absorbed(
    rows: FloatArray, information: FloatArray, difference: FloatArray, weight: FloatArray
) -> tuple[float, FloatArray]:
    """The rise of the sum of squares that no change of a rival's parameters avoids, and the difference left [K]."""
    weighted = (difference * weight[:, None]).ravel()
    pull = rows.T @ weighted
    change = np.linalg.solve(information, pull)
    left = (weighted - rows @ change).reshape(difference.shape) / weight[:, None]
    return float(weighted @ weighted - pull @ change), left


# --- The search among runs: single moves first, then durations, pairs and threes, then other air --


_NOTHING_SEEN = 1.0  # standard deviations below which a run is not worth a proposal
CLEAR = POWER + sqrt(POWER**2 + TIE)
"""Standard deviations of a difference from which on a refit decides in four cases of five: the information
criterion's lead, its expected square with a scatter of twice its root, must exceed what counts as a tie."""
_ENOUGH = 3.0 * CLEAR  # standard deviations beyond which a run is not worth more effort
_NEARLY = 0.85  # share of the best that a simpler run must reach to be preferred
_FIRST_SHARES, _MORE_SHARES = (0.6, 1.0), (0.2, 0.4, 0.8)  # of the time for a single move, first and for good ones
_IN_PAIRS, _IN_THREES = 0.4, 0.3  # of the time for each of two or three moves; rest is left at the end
_KEPT_MOVES, _KEPT_PAIRS, _KEPT_PROGRAMS = 6, 4, 10  # followed further: some 150 programs in all


@dataclass(frozen=True)
class ProgramTrial:
    """A program, and how far it decisively sets each pair of rivals apart [standard deviations]."""

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

    def __init__(self, stage: ProgramRuns, rivals: Rivals, seconds: float, limit: float) -> None:
        self.stage, self.rivals, self.seconds, self.limit = stage, rivals, seconds, limit
        self.trials: dict[Program, ProgramTrial | None] = {}

    def best(self, moves: Sequence[Move], ambients: Sequence[float]) -> ProgramTrial | None:
        """The best program of these moves; `None` if all run too hot.

        Args:
            moves: what can be done.
            ambients: temperatures of the air beside the logs' own [degC].
        """
        air = self.stage.ambient
        self._try(self._program([(move, share)], air) for move in moves for share in _FIRST_SHARES)
        self._try([self._program([], air)])
        good = self._best_moves()
        self._try(self._program([(move, share)], air) for move in good for share in _MORE_SHARES)
        pairs = ((one, other) for one in good for other in good if one != other)
        self._try(self._program([(one, _IN_PAIRS), (other, _IN_PAIRS)], air) for one, other in pairs)
        self._try(self._program([(move, _IN_THREES) for move in three], air) for three in self._threes(good))
        kept = [trial.program for trial in self._ranked()[:_KEPT_PROGRAMS]]
        for other_air in ambients:
            elsewhere = [self._program([(s.move, s.seconds / self.seconds) for s in p.phases], other_air) for p in kept]
            hot = [self._program([(move, share)], other_air) for move in good for share in (*_FIRST_SHARES, 0.4)]
            self._try([*elsewhere, *hot, self._program([], other_air)])
        return self._chosen()

    def _program(self, shares: Sequence[tuple[Move, float]], ambient: float) -> Program:
        return program(shares, self.seconds, ambient, ambient != self.stage.ambient)

    def _try(self, programs: Iterable[Program]) -> None:
        for wanted in programs:
            if wanted not in self.trials:
                self.trials[wanted] = self._trial(wanted)

    def _trial(self, wanted: Program) -> ProgramTrial | None:
        try:
            run = self.stage.run(wanted)
            predictions = self.rivals.predict(run)
        except SimulationError:
            return None
        if max(float(prediction.readings.max()) for prediction in predictions) > self.limit:
            return None
        apart = self.rivals.apart(predictions, run)
        return ProgramTrial(wanted, tuple(separation.decisive for separation in apart.values()))

    def _ranked(self) -> list[ProgramTrial]:
        """Those that stay cool enough, the best first."""
        done = [trial for trial in self.trials.values() if trial is not None]
        if not done:
            return []
        worth = _worth(np.array([trial.deviations for trial in done]))
        return [done[index] for index in np.argsort(-worth, kind="stable")]

    def _best_moves(self) -> list[Move]:
        working = (trial.program.working for trial in self._ranked())
        return list(dict.fromkeys(phases[0].move for phases in working if phases))[:_KEPT_MOVES]

    def _threes(self, good: Sequence[Move]) -> list[tuple[Move, ...]]:
        """The best pairs of moves, each with a third one behind it."""
        pairs = [trial.program.working for trial in self._ranked() if len(trial.program.working) == 2][:_KEPT_PAIRS]
        return [(one.move, other.move, third) for one, other in pairs for third in good if third != other.move]

    def _chosen(self) -> ProgramTrial | None:
        """The simplest of those that are nearly as good as the best, or good enough."""
        ranked = self._ranked()
        if not ranked:
            return None
        worth = np.minimum(_worth(np.array([trial.deviations for trial in ranked])), _ENOUGH)
        near = [index for index in range(len(ranked)) if worth[index] >= _NEARLY * worth[0]]
        return ranked[min(near, key=lambda index: (ranked[index].effort, -worth[index]))]


def _worth(deviations: FloatArray) -> FloatArray:
    """For each program the deviations of its weakest pair, shape (programs,).

    A pair that no program sets apart has no say, unless there is no other.

    Args:
        deviations: shape (programs, pairs).
    """
    possible = deviations.max(axis=0) >= CLEAR
    counted = deviations[:, possible] if possible.any() else deviations
    return np.asarray(counted.min(axis=1))


# --- How two rivals differ in a proposed run: by how much, where, when, and whether that decides ---


class Difference(NamedTuple):
    """How two rivals differ in the proposed run.

    Args:
        pair: the rivals, effect and place each.
        kelvin: the largest difference that no change of parameters takes away, mean of a minute [K].
        as_fitted: the largest difference of the predictions as the old data leave them [K].
        deviations: of all readings together, in standard deviations.
        decisive: the same, less where few blocks of the run hold all of the difference.
        node: where it is largest.
        minute: when.
    """

    pair: tuple[Key, Key]
    kelvin: float
    as_fitted: float
    deviations: float
    decisive: float
    node: str
    minute: float

    @property
    def clear(self) -> bool:
        """Whether the run decides between the two in four cases of five."""
        return self.decisive >= CLEAR


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
    means = np.abs(apart.left[:, : minutes * per_minute].reshape(len(nodes), minutes, per_minute).mean(axis=2))
    means[~measured] = 0.0
    row, column = np.unravel_index(int(np.argmax(means)), means.shape)
    largest, as_fitted = float(means[row, column]), float(np.abs(fitted[measured]).max())
    return Difference(pair, largest, as_fitted, apart.deviations, apart.decisive, nodes[int(row)], float(column + 1))
