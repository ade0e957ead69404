"""What is asked of a robot in an episode: phases of rest and work whose torque no motor could give for ever."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.places import matching
from lptn.planners.heating import Heating
from lptn.planners.limiter import Limiter
from lptn.planners.values import SINE

Range = tuple[float, float]

_CONDITIONS: Mapping[str, Range] = {
    "temperature.*": (15.0, 30.0),  # degC
    "velocity.*": (0.5, 3.0),  # rad/s
    "speed.*": (0.0, 1.0),  # m/s
    "powered.*": (1.0, 1.0),
    "power.*": (16.0, 26.0),  # W: the quadruped's onboard computer
}


@dataclass(frozen=True)
class Task:
    """Episodes of phases: in each the robot rests, or works at a random load.

    Args:
        seconds: of an episode.
        phase: shortest and longest phase [s].
        rest: share of phases in which nothing is asked.
        load: torque of a working phase as a multiple of what all joints together could give for ever.
        scatter: by how much a joint's share of the load differs from phase to phase, relative, uniform.
        start: by how much the robot is warmer than the air at the beginning [K].
        conditions: ranges of the model's other inputs by column or pattern; air is drawn once an episode, the rest
            once a phase. RMS velocities follow mean ones as in a sine.
    """

    seconds: float = 1800.0
    phase: Range = (60.0, 420.0)
    rest: float = 0.3
    load: Range = (0.5, 2.0)
    scatter: float = 0.3
    start: Range = (0.0, 15.0)
    conditions: Mapping[str, Range] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("phase", "load", "start"):
            low, high = getattr(self, name)
            if not 0 <= low <= high < inf or (name == "phase" and low <= 0):
                raise InputError("task", name, f"({low:g}, {high:g})", "two rising numbers, none below 0")
        if not 0 < self.seconds < inf or not 0 <= self.rest < 1 or not 0 <= self.scatter < 1:
            values = f"{self.seconds:g}, {self.rest:g}, {self.scatter:g}"
            raise InputError("task", "seconds, rest, scatter", values, "seconds above 0, shares from 0 to below 1")

    def ranges(self, heating: Heating) -> FloatArray:
        """Least and most of each of the model's conditions, shape (conditions, 2).

        Raises:
            InputError: a condition without a range, or a pattern without a condition.
        """
        spans: dict[str, Range] = {}
        for pattern, span in (*_CONDITIONS.items(), *self.conditions.items()):
            names = matching(pattern, heating.conditions)
            if not names and pattern in self.conditions:
                raise InputError("task", f'conditions."{pattern}"', "no such column", ", ".join(heating.conditions))
            spans |= dict.fromkeys(names, span)
        ranges = np.empty((len(heating.conditions), 2))
        for row, column in enumerate(heating.conditions):
            if column in spans:
                ranges[row] = spans[column]
            elif (mean := _mean_of(column)) is not None:
                ranges[row] = SINE * np.array(spans.get(mean, _CONDITIONS["velocity.*"]))
            else:
                raise InputError("task", "conditions", f"no range for {column}", f'{{"{column}": (least, most)}}')
        return ranges

    def draw(
        self, rng: np.random.Generator, heating: Heating, rated: FloatArray, ranges: FloatArray, period: float
    ) -> tuple[FloatArray, FloatArray]:
        """One episode: what is asked [N·m or A], shape (steps, joints), and the conditions, shape (steps, conditions).

        Args:
            rng: draws it.
            heating: the model.
            rated: what each joint could give for ever, all of them at once, shape (joints,).
            ranges: see `ranges`.
            period: seconds of a step.
        """
        steps, columns = max(1, round(self.seconds / period)), heating.conditions
        asked, conditions = np.zeros((steps, len(rated))), np.zeros((steps, len(ranges)))
        air = [column.startswith("temperature.") for column in columns]
        moves = [column.startswith(("velocity", "speed.")) for column in columns]
        kept, begin = rng.uniform(*ranges.T), 0
        while begin < steps:
            end = min(steps, begin + max(1, round(rng.uniform(*self.phase) / period)))
            works = rng.random() >= self.rest
            shares = rng.uniform(*self.load) * rng.uniform(1 - self.scatter, 1 + self.scatter, len(rated))
            drawn = np.where(air, kept, rng.uniform(*ranges.T))
            if not works:
                drawn[moves] = 0.0  # who rests doesn't move
            for row, column in enumerate(columns):
                if (mean := _mean_of(column)) in columns:
                    drawn[row] = SINE * drawn[columns.index(mean)]
            asked[begin:end] = works * shares * rated
            conditions[begin:end] = drawn
            begin = end
        return asked, conditions


def _mean_of(column: str) -> str | None:
    """The mean speed's column of an RMS one, `None` of another."""
    return column.replace("velocity_rms.", "velocity.") if column.startswith("velocity_rms.") else None


def rated_load(heating: Heating, limits: Mapping[str, float], ranges: FloatArray) -> FloatArray:
    """What every joint could give for ever at once [N·m or A], shape (joints,), in the middle of the conditions.

    Raises:
        InputError: nothing limits it.
    """
    limiter = Limiter(heating.model, limits, request=heating.request, horizons=(inf,))
    middle = ranges.mean(axis=1)
    air = [value for column, value in zip(heating.conditions, middle, strict=True) if "temperature." in column]
    states = np.full(len(heating.model.states), float(np.mean(air)) if air else 25.0)
    together = limiter.largest_scale(states, np.ones(len(heating.joints)), inf, middle)
    if not 0 < together < inf:
        raise InputError(heating.model.network.origin, "limits", f"{together:g} {heating.unit} for ever",
                         "limits that some torque keeps and some other passes")  # fmt: skip
    return np.full(len(heating.joints), together)
