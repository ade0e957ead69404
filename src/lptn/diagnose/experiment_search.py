"""The search among runs: single moves first, then durations, pairs and threes, then other temperatures of the air."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from lptn.arrays import FloatArray
from lptn.diagnose.experiment_moves import Move
from lptn.diagnose.experiment_power import Rivals
from lptn.diagnose.experiment_programs import Program, Stage, program
from lptn.diagnose.refit import TIE
from lptn.places import EVERYWHERE
from lptn.simulate import SimulationError

_POWER = 0.84  # standard deviations that four cases of five stay above
CLEAR = _POWER + sqrt(_POWER**2 + TIE)
"""Standard deviations of a difference from which on a refit decides in four cases of five: the information
criterion's lead, its expected square with a scatter of twice its root, must exceed what counts as a tie."""
_ENOUGH = 3.0 * CLEAR  # beyond this a run is not worth more effort
_NEARLY = 0.85  # share of the best that a simpler run must reach to be preferred
_FIRST_SHARES, _MORE_SHARES, _IN_PAIRS, _IN_THREES = (0.6, 1.0), (0.2, 0.4, 0.8), 0.4, 0.3
_KEPT_MOVES, _KEPT_PAIRS, _KEPT_PROGRAMS = 6, 4, 10


@dataclass(frozen=True)
class Trial:
    """A program, and how far it decisively sets each pair of rivals apart [standard deviations]."""

    program: Program
    deviations: tuple[float, ...]

    @property
    def effort(self) -> int:
        """What it asks of the people who do it: other air is the most trouble, then a rig that loads a moving joint."""
        moves = [step.move for step in self.program.working]
        rigs = sum(move.load > 0 and move.speed > 0 and move.at != EVERYWHERE for move in moves)
        return 2 * self.program.moved_air + max(len(moves) - 1, 0) + rigs


class Search:
    """All programs tried so far.

    Args:
        stage: turns programs into runs.
        rivals: the fits.
        seconds: how long a run may last.
        limit: highest temperature that a prediction may reach [degC].
    """

    def __init__(self, stage: Stage, rivals: Rivals, seconds: float, limit: float) -> None:
        self.stage, self.rivals, self.seconds, self.limit = stage, rivals, seconds, limit
        self.trials: dict[Program, Trial | None] = {}

    def best(self, moves: Sequence[Move], ambients: Sequence[float]) -> Trial | None:
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
            elsewhere = [self._program([(s.move, s.seconds / self.seconds) for s in p.steps], other_air) for p in kept]
            hot = [self._program([(move, share)], other_air) for move in good for share in (*_FIRST_SHARES, 0.4)]
            self._try([*elsewhere, *hot, self._program([], other_air)])
        return self._chosen()

    def _program(self, parts: Sequence[tuple[Move, float]], ambient: float) -> Program:
        return program(parts, self.seconds, ambient, ambient != self.stage.ambient)

    def _try(self, programs: Iterable[Program]) -> None:
        for wanted in programs:
            if wanted not in self.trials:
                self.trials[wanted] = self._trial(wanted)

    def _trial(self, wanted: Program) -> Trial | None:
        try:
            run = self.stage.run(wanted)
            predictions = self.rivals.predict(run)
        except SimulationError:
            return None
        if max(float(each.readings.max()) for each in predictions) > self.limit:
            return None
        apart = self.rivals.apart(predictions, run)
        return Trial(wanted, tuple(each.decisive for each in apart.values()))

    def _ranked(self) -> list[Trial]:
        """Those that stay cool enough, the best first."""
        done = [trial for trial in self.trials.values() if trial is not None]
        if not done:
            return []
        worth = _worth(np.array([trial.deviations for trial in done]))
        return [done[index] for index in np.argsort(-worth, kind="stable")]

    def _best_moves(self) -> list[Move]:
        working = (trial.program.working for trial in self._ranked())
        return list(dict.fromkeys(steps[0].move for steps in working if steps))[:_KEPT_MOVES]

    def _threes(self, good: Sequence[Move]) -> list[tuple[Move, ...]]:
        """The best pairs of moves, each with a third one behind it."""
        pairs = [trial.program.working for trial in self._ranked() if len(trial.program.working) == 2][:_KEPT_PAIRS]
        return [(one.move, other.move, third) for one, other in pairs for third in good if third != other.move]

    def _chosen(self) -> Trial | None:
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
