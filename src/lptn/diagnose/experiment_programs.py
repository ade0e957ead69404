"""A proposed run: moves one after the other, from the temperature of the air, as a log's columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from lptn.arrays import FloatArray
from lptn.diagnose.experiment_moves import REST, Logged, Move
from lptn.logs import Run
from lptn.model import Model

STEP = 10.0  # s; short against the time constants of a joint
NAME = "experiment"
AMBIENT = "ambient"


@dataclass(frozen=True)
class Step:
    """A move and how long it lasts [s]."""

    move: Move
    seconds: float


@dataclass(frozen=True)
class Program:
    """Moves one after the other.

    Args:
        steps: the moves.
        ambient: temperature of the air, and of the whole robot at the beginning [degC].
        moved_air: whether that is another than the log's.
    """

    steps: tuple[Step, ...]
    ambient: float
    moved_air: bool = field(default=False, compare=False)

    @property
    def seconds(self) -> float:
        """How long it lasts [s]."""
        return sum(step.seconds for step in self.steps)

    @property
    def working(self) -> tuple[Step, ...]:
        """The steps without rest."""
        return tuple(step for step in self.steps if step.move.joints)


def program(parts: Sequence[tuple[Move, float]], seconds: float, ambient: float, moved_air: bool = False) -> Program:
    """Moves that take shares of the time, and rest for what is left.

    Args:
        parts: each move and its share, 0 to 1.
        seconds: the whole duration.
        ambient: temperature of the air [degC].
        moved_air: whether that is another than the log's.
    """
    steps = [Step(move, round(share * seconds / STEP) * STEP) for move, share in parts]
    left = round(seconds / STEP) * STEP - sum(step.seconds for step in steps)
    if left >= STEP:
        steps.append(Step(REST, left))
    return Program(tuple(step for step in steps if step.seconds > 0), ambient, moved_air)


class Stage:
    """Where programs are turned into runs for the models in question.

    Args:
        models: the rivals' models.
        runs: the fitted runs.
    """

    def __init__(self, models: Sequence[Model], runs: Sequence[Run]) -> None:
        columns = dict.fromkeys(name for model in models for name in model.inputs if name not in model.started)
        self.logged = Logged(runs, (name for name in columns if not name.startswith("temperature.")))
        self.given = [name for name in columns if name.startswith("temperature.")]
        self.nodes = list(models[0].nodes)
        self._runs = list(runs)
        self._usual = {
            name: float(np.median(np.concatenate([run.columns[name] for run in runs]))) for name in self.given
        }
        self._air = self._air_column(models[0])

    @property
    def ambient(self) -> float:
        """The usual temperature of the air in the logs [degC]; without its column, of the nodes at the start."""
        if self._air is not None:
            return self._usual[self._air]
        return float(np.median([_first(run, self.nodes) for run in self._runs]))

    @property
    def air_can_change(self) -> bool:
        """Whether the models know of the air's temperature."""
        return self._air is not None or not self.given

    def run(self, wanted: Program) -> Run:
        """The program as a log: inputs, and every node at the air's temperature."""
        counts = [round(step.seconds / STEP) for step in wanted.steps]
        n = sum(counts)

        def held(column: str) -> FloatArray:
            return np.repeat([self.logged.value(column, step.move) for step in wanted.steps], counts).astype(float)

        columns = {name: held(name) for name in self.logged.columns}
        for name in self.given:
            columns[name] = np.full(n, wanted.ambient if name == self._air else self._usual[name])
        columns |= {f"temperature.{node}": np.full(n, wanted.ambient) for node in self.nodes}
        return Run(NAME, STEP, np.arange(n, dtype=np.float64) * STEP, columns, True, "proposed experiment", "")

    def _air_column(self, model: Model) -> str | None:
        """The prescribed temperature that is the air's: the one so named, or the only one."""
        sources = {name: source for name, source in model.network.prescribed.items() if source in self.given}
        chosen = sources.get(AMBIENT, next(iter(sources.values())) if len(sources) == 1 else None)
        return chosen if isinstance(chosen, str) else None


def _first(run: Run, nodes: Sequence[str]) -> float:
    readings = np.array([run.columns[f"temperature.{node}"][0] for node in nodes if run.has(f"temperature.{node}")])
    known = readings[np.isfinite(readings)]
    return float(np.median(known)) if known.size else 25.0
