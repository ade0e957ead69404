"""What robots of a fleet have in common, who stands apart, and who drifts: parameters pooled over robots and days.

A parameter's value of one robot on one day is

.. math:: x = \\mu + \\beta t + a + b \\, (t - t_1) + \\epsilon

in its logarithm, where that is what is searched: the fleet's mean and its drift; what the robot was built with; a
drift of its own since its first day; and the error of the fit, with what days differ by. Robots scatter as
manufactured parts do, a few further; most don't drift. All shares and scatters are estimated from the fleet (empirical
Bayes); each robot's own values and probabilities follow in closed form. A robot whose logs say little gets the
fleet's value, with its error.

Source: random effects [LairdWare1982]; two-component scatter of like parts, as in `lptn.diagnose`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp

from lptn.basics.arrays import FloatArray

MONTH = 30.44  # days

APART = 5.0
"""Times by which a robot that stands apart scatters more than its likes: 3 to 15 standard deviations, beyond which
a robot is apart whatever is said here. Twice or half of any number here, in two fleets of 200: all twenty that age and
all ten that are apart are told by .95 as before, none else; more probable than not 0 to 5 others (4 as it is)."""
DRIFT = 0.2
"""Relative; change over the whole record of a part that ages: friction, paste and bearings change by a tenth to a
half before somebody repairs them."""
SCATTER, DAYS = 0.2, 0.05
"""Relative; what parts of one make scatter by at the most, and days of one robot: half-normal priors, which count
where a fleet is small."""
RARE = 1.0, 19.0  # a Beta prior of the shares that stand apart and that drift: one in twenty, as sure as twenty robots
SURE = 0.95
"""Probability from which on a drift is said to have been seen."""
_LEAST = 1e-4  # relative: no scatter is smaller, for a fit's digits are not


@dataclass(frozen=True)
class Session:
    """One parameter of one robot on one day: its value and standard error, in the coordinate that is pooled."""

    robot: str
    day: date
    value: float
    error: float


@dataclass(frozen=True)
class RobotValue:
    """One robot's value of a parameter, with what its fleet says of it.

    Attributes:
        robot: its name.
        value: on its last day, in the coordinate that is pooled.
        error: its standard error, given the fleet's.
        apart: probability that it is not one of its likes.
        trend: its own drift a month, beside the fleet's.
        trend_error: its standard error.
        drifts: probability that it has one.
        seen: the first day from which on a drift was `SURE`, if it is.
    """

    robot: str
    value: float
    error: float
    apart: float
    trend: float
    trend_error: float
    drifts: float
    seen: date | None


@dataclass(frozen=True)
class FleetParameter:
    """One parameter, or the RMSE, over the robots that determine it.

    Attributes:
        name: the parameter's, or `"rmse"`.
        unit: of its values.
        size: what it is pooled in; 0 for its logarithm.
        mean: of the robots that are alike, on the fleet's last day, in the coordinate that is pooled.
        scatter: standard deviation between them; none of one robot.
        days: standard deviation between days of one robot, beyond the fits' errors; none where no robot has two.
        trend: drift of all of them, a month; of one robot alone it is the robot's.
        robots: each robot's value, by name.
    """

    name: str
    unit: str
    size: float
    mean: float
    scatter: float | None
    days: float | None
    trend: float
    robots: dict[str, RobotValue]

    def value(self, pooled: float) -> float:
        """A pooled number as a value."""
        return pooled * self.size if self.size else math.exp(pooled)

    def as_json(self) -> dict[str, object]:
        """As other tools read it."""
        size = self.size or self.value(self.mean)
        return {
            "unit": self.unit,
            "robots": len(self.robots),
            "mean": self.value(self.mean),
            "scatter": None if self.scatter is None else self.scatter * size,
            "days": None if self.days is None else self.days * size,
            "per_month": self.trend * size,
        }


@dataclass(frozen=True)
class _Shape:
    """What is estimated of a fleet: mean, drift, scatters of robots and days, shares that are apart and that drift."""

    mean: float
    trend: float
    scatter: float
    days: float
    apart: float
    drifting: float

    @classmethod
    def at(cls, point: FloatArray) -> _Shape:
        mean, trend, scatter, days, apart, drifting = point
        shares = 1 / (1 + np.exp(-np.array([apart, drifting])))
        return cls(float(mean), float(trend), float(np.exp(scatter)), float(np.exp(days)), *map(float, shares))

    def log_prior(self, months: float) -> float:
        """Without its constant; of the shares and scatters as they are searched, by logit and logarithm."""
        scatters = -0.5 * ((self.scatter / SCATTER) ** 2 + (self.days / DAYS) ** 2) + np.log(self.scatter * self.days)
        shares = sum(RARE[0] * np.log(x) + RARE[1] * np.log1p(-x) for x in (self.apart, self.drifting))
        return float(scatters + shares - 0.5 * (self.trend * months / DRIFT) ** 2)


class _Fleet:
    """All robots' sessions of one parameter, a row each as long as the longest; what one lacks has no weight.

    Args:
        sessions: of each robot those of one stretch, in order of their days.
        first: the day from which months are counted.
        months: the length of the whole record.
    """

    def __init__(self, sessions: Sequence[Session], first: date, months: float) -> None:
        by_robot: dict[str, list[Session]] = {}
        for session in sessions:
            by_robot.setdefault(session.robot, []).append(session)
        self.robots, self.months = list(by_robot), months
        counts = np.array([len(own) for own in by_robot.values()])
        self.there = np.arange(counts.max()) < counts[:, None]
        self.value, self.error, self.time = np.zeros((3, *self.there.shape))
        self.value[self.there] = [s.value for own in by_robot.values() for s in own]
        self.error[self.there] = [s.error for own in by_robot.values() for s in own]
        self.time[self.there] = [(s.day - first).days / MONTH for own in by_robot.values() for s in own]
        self.own = np.where(self.there, self.time - self.time[:, :1], 0.0)

    @property
    def repeated(self) -> bool:
        """Whether some robot has several days."""
        return bool(self.there.shape[1] > 1)

    def weighed(self, shape: _Shape) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Of each robot, for each of its four ways to be: log probability, state and its covariance.

        The ways: like the others, steady or drifting; apart, steady or drifting. The state is the robot's own
        difference and drift. Shapes (robots, 4), (robots, 4, 2) and (robots, 4, 2, 2).
        """
        variance = np.where(self.there, self.error**2 + shape.days**2, 1.0)
        weight, rest = self.there / variance, self.value - shape.mean - shape.trend * self.time
        design = np.stack([np.ones_like(self.own), self.own], axis=2)
        told = np.einsum("rs,rsi,rsj->rij", weight, design, design)[:, None]
        towards = np.einsum("rs,rsi->ri", weight * rest, design)[:, None]
        alone = (weight * rest**2 + np.log(variance)).sum(axis=1, keepdims=True)
        prior, drift = np.zeros((4, 2, 2)), DRIFT / self.months
        prior[:, 0, 0] = (shape.scatter * np.array([1.0, 1.0, APART, APART])) ** 2
        prior[:, 1, 1] = np.array([0.0, drift, 0.0, drift]) ** 2
        share = np.log(np.outer([1 - shape.apart, shape.apart], [1 - shape.drifting, shape.drifting])).ravel()
        inverse = np.linalg.inv(np.eye(2) + told @ prior)  # (I + A S)^-1: S may be singular
        spread = prior @ inverse
        state = (spread @ towards[..., None])[..., 0]
        fit = (towards * state).sum(axis=2) + np.linalg.slogdet(inverse)[1]
        return 0.5 * (fit - alone) + share, state, spread

    def shape(self) -> _Shape:
        """The most probable one."""

        def cost(point: FloatArray) -> float:
            shape = _Shape.at(point)
            return -float(logsumexp(self.weighed(shape)[0], axis=1).sum()) - shape.log_prior(self.months)

        values = self.value[self.there]
        middle = float(np.median(values))
        spread = 1.4826 * float(np.median(np.abs(values - middle)))  # of a normal distribution's median deviation
        scatters = [np.log(max(spread, 10 * _LEAST)), np.log(DAYS / 5)]
        start = np.array([middle, 0.0, *scatters, *2 * [np.log(RARE[0] / RARE[1])]])
        # Bounds that no fleet comes near. Scatter and days that one day of each, or one robot, can't tell are none.
        wide, small, steep = max(10 * spread, 1.0), np.log(_LEAST), 10 * DRIFT / self.months
        bounds = [(middle - wide, middle + wide), (-steep, steep) if len(self.robots) > 1 else (0.0, 0.0)]
        bounds += [(small, np.log(10.0)), (small, np.log(1.0) if self.repeated else small), (-10.0, 1.0), (-10.0, 1.0)]
        return _Shape.at(minimize(cost, start, method="L-BFGS-B", bounds=bounds).x)

    def values(self, shape: _Shape) -> dict[str, RobotValue]:
        """Each robot's, given the fleet's; without the day on which a drift was seen."""
        log, states, spreads = self.weighed(shape)
        odds = np.exp(log - logsumexp(log, axis=1, keepdims=True))
        # Of the mixture, what the robot differs by on its last day, and its drift: means and standard deviations.
        what = np.zeros((len(odds), 2, 2))
        what[:, 0, 0], what[:, 0, 1], what[:, 1, 1] = 1.0, self.own.max(axis=1), 1.0
        told = np.einsum("rki,rwi->rwk", what, states)
        mean = np.einsum("rw,rwk->rk", odds, told)
        variances = np.einsum("rki,rwij,rkj->rwk", what, spreads, what) + (told - mean[:, None]) ** 2
        error = np.sqrt(np.maximum(np.einsum("rw,rwk->rk", odds, variances), 0.0))
        level = shape.mean + shape.trend * self.time.max(axis=1)
        apart, drifts = (np.minimum(share.sum(axis=1), 1.0) for share in (odds[:, 2:], odds[:, 1::2]))
        columns = level + mean[:, 0], error[:, 0], apart, mean[:, 1], error[:, 1], drifts
        names = "value", "error", "apart", "trend", "trend_error", "drifts"
        rows = np.column_stack(columns).tolist()
        return {
            robot: RobotValue(robot, seen=None, **dict(zip(names, row, strict=True)))
            for robot, row in zip(self.robots, rows, strict=True)
        }


def pool(sessions: Sequence[Session], name: str = "", unit: str = "", size: float = 0.0) -> FleetParameter:
    """Pool one parameter over the robots of a fleet.

    Args:
        sessions: its values by robot and day, with standard errors above 0; at least one.
        name: the parameter's.
        unit: of its values.
        size: what the sessions' values are in; 0 for logarithms.
    """
    ordered = sorted(sessions, key=lambda session: (session.robot, session.day))
    days = [session.day for session in ordered]
    first, last = min(days), max(days)
    months = max((last - first).days / MONTH, 1.0)
    fleet = _Fleet(ordered, first, months)
    shape = fleet.shape()
    robots = fleet.values(shape)
    for robot in (name for name, value in robots.items() if value.drifts > SURE):
        own = [session for session in ordered if session.robot == robot]
        sure = [_Fleet(own[:n], first, months).values(shape)[robot].drifts > SURE for n in range(1, len(own) + 1)]
        since = len(sure) - sure[::-1].index(False) if False in sure else 0  # and ever since
        robots[robot] = replace(robots[robot], seen=own[since].day)
    level = shape.mean + shape.trend * (last - first).days / MONTH
    between, by_day = shape.scatter if len(robots) > 1 else None, shape.days if fleet.repeated else None
    return FleetParameter(name, unit, size, level, between, by_day, shape.trend, robots)
