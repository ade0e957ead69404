"""The next experiment: of the runs that the logs show to be possible, the one that best tells rivals apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lptn.arrays import FloatArray
from lptn.diagnose.experiment_difference import Difference, Key, difference
from lptn.diagnose.experiment_moves import Move, moves
from lptn.diagnose.experiment_power import Rivals
from lptn.diagnose.experiment_programs import Program, Stage
from lptn.diagnose.experiment_search import CLEAR, Search, Trial
from lptn.diagnose.experiment_words import instructions, listed, named, unit_of
from lptn.diagnose.refit import Refit
from lptn.logs import Run
from lptn.threads import one_blas_thread

__all__ = ["CLEAR", "Difference", "Experiment", "Move", "possible_moves", "propose"]

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
        return any(each.clear for each in self.differences)

    @property
    def weakest(self) -> Difference:
        """The least clear pair of those that the run separates; if it separates none, of all."""
        clear = [each for each in self.differences if each.clear]
        return (clear or list(self.differences))[-1]

    @property
    def alike(self) -> tuple[tuple[Key, Key], ...]:
        """Pairs that the run leaves undecided."""
        return tuple(each.pair for each in self.differences if not each.clear)

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
            best = f"it leaves {least.kelvin:.2g} K at {least.node}, {least.deviations:.1f} standard deviations"
            return (
                f"No run of {reach} is sure to tell {one} from {other}. The best of {self.tried}: {self.words} "
                f"Whatever the other parameters are, {best}."
            )
        what = "the two predictions" if len(self.rivals) == 2 else listed([named(key) for key in least.pair])
        shown = f"At {least.minute:.0f} min {what} differ by {least.kelvin:.2g} K at {least.node}"
        sure = f"whatever the other parameters are ({least.deviations:.0f} standard deviations)"
        rest = "".join(f" It does not tell apart {listed([named(key) for key in pair])}." for pair in self.alike)
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
                    "pair": [list(key) for key in each.pair],
                    "kelvin": each.kelvin,
                    "kelvin_as_fitted": each.as_fitted,
                    "deviations": each.deviations,
                    "decisive": each.decisive,
                    "node": each.node,
                    "minute": each.minute,
                    "clear": each.clear,
                }
                for each in self.differences
            ],
            "hottest": float(max(readings.max() for readings in self.predictions.values())),
            "limit": self.limit,
            "tried": self.tried,
        }


@one_blas_thread
def propose(
    rivals: Sequence[Refit],
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
    hottest = max(float(np.nanmax(driven.measured)) for driven in fits[0].problem.drives)
    highest = hottest + _BEYOND if limit is None else limit
    search = Search(stage, Rivals(fits), 60.0 * minutes, highest)
    known = possible_moves(rivals) if allowed is None else list(allowed)
    best = search.best(known, _air(stage, ambients))
    return None if best is None else _experiment(rivals, search, best)


def possible_moves(rivals: Sequence[Refit]) -> list[Move]:
    """The moves that a proposal is made of: joints in question, their classes, all; loaded, moving, or both.

    Args:
        rivals: refitted candidates of one baseline.
    """
    return moves(_stage(rivals).logged, [place for rival in rivals for place in rival.candidate.places])


def _stage(rivals: Sequence[Refit]) -> Stage:
    drives = rivals[0].fit.problem.drives
    return Stage([rival.fit.model for rival in rivals], [driven.run for driven in drives])


def _air(stage: Stage, ambients: Sequence[float] | None) -> list[float]:
    if not stage.air_can_change:
        return []
    return [round(stage.ambient) + shift for shift in _OTHER_AIR] if ambients is None else list(ambients)


def _experiment(rivals: Sequence[Refit], search: Search, best: Trial) -> Experiment:
    keys = tuple(rival.candidate.key for rival in rivals)
    run = search.stage.run(best.program)
    predictions = search.rivals.predict(run)
    apart = search.rivals.apart(predictions, run)
    nodes = tuple(search.stage.nodes)
    differences = [
        difference((keys[one], keys[other]), found, predictions[one].readings - predictions[other].readings, nodes)
        for (one, other), found in apart.items()
    ]
    return Experiment(
        keys,
        best.program,
        run,
        tuple(sorted(differences, key=lambda each: -each.decisive)),
        {key: each.readings for key, each in zip(keys, predictions, strict=True)},
        nodes,
        search.limit,
        len(search.trials),
        tuple(_table(best.program, search.stage)),
        instructions(best.program, search.stage.logged),
    )


def _table(program: Program, stage: Stage) -> list[dict[str, object]]:
    """Each move with the values of every input that it sets."""
    return [
        {
            "at": step.move.at,
            "joints": list(step.move.joints),
            "travelling": step.move.travelling,
            "minutes": step.seconds / 60,
            "load_unit": unit_of(stage.logged.loads(step.move)[0]),
            "inputs": {name: stage.logged.value(name, step.move) for name in stage.logged.columns},
        }
        for step in program.steps
    ]
