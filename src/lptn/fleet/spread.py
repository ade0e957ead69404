"""How each parameter spreads over a fleet, and which robots stand apart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lptn.arrays import FloatArray
from lptn.fleet.work import Outcome
from lptn.model import Model

FAR = 4.0  # robust standard deviations
RMSE = "rmse"
_MAD_TO_SIGMA = 1.4826
_FEWEST = 5  # robots, below which nobody can be said to stand apart
_ROUNDING = 1e-6  # share of the size by which searches scatter


@dataclass(frozen=True)
class Spread:
    """One parameter over the robots that determine it.

    Args:
        what: the parameter's name, or `"rmse"`.
        unit: of all values here.
        robots: how many determine it.
        median: half of them lie below.
        quartiles: a quarter of them lies below the first, a quarter above the second.
        scale: 1.4826 times the median absolute deviation, of the logarithm where that is what is searched.
        logarithmic: whether robots are told apart by ratios.
    """

    what: str
    unit: str
    robots: int
    median: float
    quartiles: tuple[float, float]
    scale: float
    logarithmic: bool

    def as_json(self) -> dict[str, object]:
        """As other tools read it."""
        low, high = self.quartiles
        return {"unit": self.unit, "robots": self.robots, "median": self.median, "quartiles": [low, high]}


@dataclass(frozen=True)
class Outlier:
    """A robot that stands apart from its fleet.

    Args:
        robot: its name.
        what: the parameter's name, or `"rmse"`.
        value: the robot's.
        median: the fleet's.
        unit: of both.
        z: distance from the median in standard deviations: the fleet's robust one and the robot's own standard error
            together, so that a robot whose logs hardly determine the value does not count as different.
    """

    robot: str
    what: str
    value: float
    median: float
    unit: str
    z: float

    def __str__(self) -> str:
        """One line."""
        ratio = self.value / self.median if self.median else math.nan
        times = f"{ratio:.2g} times the fleet's" if ratio > 0 else "far from the fleet's"
        return (
            f"{self.robot}: {self.what} {times}: {self.value:.3g} against {self.median:.3g} {self.unit} "
            f"(robust z {self.z:+.1f})"
        )

    def as_json(self) -> dict[str, object]:
        """As other tools read it."""
        numbers = {"value": self.value, "median": self.median, "unit": self.unit, "z": self.z}
        return {"robot": self.robot, "parameter": self.what, **numbers}


def spread_of(model: Model, fitted: Sequence[Outcome]) -> tuple[Spread, ...]:
    """Median, quartiles and robust scatter of the RMSE and of each parameter, over robots that determine it.

    Args:
        model: the model that was fitted to each robot.
        fitted: robots with a result.
    """
    logarithmic = {unknown.name: unknown.logarithmic for unknown in model.unknowns} | {RMSE: True}
    names = [RMSE, *dict.fromkeys(name for each in fitted for name in each.parameters)]
    found = []
    for name in names:
        entries = [entry for each in fitted if (entry := _entry(each, name)) is not None]
        if not entries:
            continue
        values = np.array([value for value, _, _ in entries])
        low, median, high = (float(share) for share in np.quantile(values, (0.25, 0.5, 0.75)))
        straight = logarithmic.get(name, False) and bool((values > 0).all())
        apart = _coordinate(values, straight) - _coordinate(np.array([median]), straight)
        scale = _MAD_TO_SIGMA * float(np.median(np.abs(apart)))
        found.append(Spread(name, entries[0][2], len(entries), median, (low, high), scale, straight))
    return tuple(found)


def outliers(spread: Sequence[Spread], fitted: Sequence[Outcome]) -> tuple[Outlier, ...]:
    """Robots further than four robust standard deviations from the median, the furthest first.

    Args:
        spread: of the fleet.
        fitted: its robots.
    """
    found = []
    for each in spread:
        if each.robots < _FEWEST:
            continue
        for outcome in fitted:
            entry = _entry(outcome, each.what)
            if entry is not None and abs(z := _distance(each, *entry[:2])) > FAR:
                found.append(Outlier(outcome.robot, each.what, entry[0], each.median, each.unit, z))
    return tuple(sorted(found, key=lambda each: -abs(each.z)))


def _distance(spread: Spread, value: float, error: float) -> float:
    if spread.logarithmic:
        apart, own = math.log(value / spread.median), error / value
        rounding = _ROUNDING
    else:
        apart, own = value - spread.median, error
        rounding = _ROUNDING * max(abs(spread.median), abs(value))
    return apart / max(math.hypot(spread.scale, own), rounding, 1e-300)


def _entry(outcome: Outcome, name: str) -> tuple[float, float, str] | None:
    """Value, standard error and unit; `None` where the robot's logs don't determine it."""
    if name == RMSE:
        return (outcome.rmse, 0.0, "K") if math.isfinite(outcome.rmse) else None
    found: Any = outcome.parameters.get(name)
    if found is None or found["error"] is None or not math.isfinite(found["error"]):
        return None
    return float(found["value"]), float(found["error"]), str(found["unit"])


def _coordinate(values: FloatArray, logarithmic: bool) -> FloatArray:
    return np.log(values) if logarithmic else values
