"""What a forecast says: time to the limit of each node, and the temperatures to come."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

from lptn.arrays import FloatArray


@dataclass(frozen=True)
class Window:
    """The end of the log that is taken to go on.

    Args:
        seconds: its length.
        cycles: gait cycles in it, `None` where no gait was found.
        period: of the gait [s], `None` likewise.
        steady: how long the operating point has been unchanged [s].
        why: what it is, in words.
    """

    seconds: float
    cycles: int | None
    period: float | None
    steady: float
    why: str


@dataclass(frozen=True)
class NodeForecast:
    """When a node reaches its limit; infinite for never.

    Args:
        node: its name.
        limit: degC.
        now: expected reading at the end of the log [degC].
        time_to_limit: s from the end of the log, 0 where the limit is passed already.
        low: end of the interval on the early side [s].
        high: on the late side [s].
        chance: probability that the limit is passed at all while the operating point stays.
        steady: where the temperature settles [degC], infinite where it runs away.
        steady_low: end of its interval on the cold side [degC].
        steady_high: on the hot side [degC].
    """

    node: str
    limit: float
    now: float
    time_to_limit: float
    low: float
    high: float
    chance: float
    steady: float
    steady_low: float
    steady_high: float

    @property
    def reaches(self) -> bool:
        """Whether the limit is expected to be reached."""
        return isfinite(self.time_to_limit)


@dataclass(frozen=True)
class Forecast:
    """Temperatures to come with the operating point held.

    Args:
        nodes: one for each node with a limit, by name.
        names: of all nodes of the model.
        time: s from the end of the log, shape (n,).
        temperature: expected readings [degC], shape (names, n).
        low: lower end of their interval [degC], shape (names, n).
        high: upper end [degC], shape (names, n).
        coverage: of all intervals.
        window: the end of the log that is taken to go on.
        trust: where the uncertainty of the model is from, in words.
        log: time [s] until the end of the log, 0 there, shape (k,).
        measured: its readings [degC], shape (names, k), NaN where missing.
    """

    nodes: dict[str, NodeForecast]
    names: tuple[str, ...]
    time: FloatArray
    temperature: FloatArray
    low: FloatArray
    high: FloatArray
    coverage: float
    window: Window
    trust: str
    log: FloatArray
    measured: FloatArray

    def as_json(self) -> dict[str, object]:
        """The forecast as other tools read it: s and degC; what is never reached is null."""
        return {
            "coverage": self.coverage,
            "trust": self.trust,
            "window": {
                "seconds": self.window.seconds,
                "cycles": self.window.cycles,
                "gait_period": self.window.period,
                "steady": self.window.steady,
                "why": self.window.why,
            },
            "nodes": {name: _json(each) for name, each in self.nodes.items()},
            "path": {
                "time": self.time.tolist(),
                "temperature": dict(zip(self.names, self.temperature.tolist(), strict=True)),
                "low": dict(zip(self.names, self.low.tolist(), strict=True)),
                "high": dict(zip(self.names, self.high.tolist(), strict=True)),
            },
        }


def _json(one: NodeForecast) -> dict[str, object]:
    numbers = {
        "limit": one.limit,
        "now": one.now,
        "time_to_limit": one.time_to_limit,
        "low": one.low,
        "high": one.high,
        "chance": one.chance,
        "steady": one.steady,
        "steady_low": one.steady_low,
        "steady_high": one.steady_high,
    }
    return {"reaches": one.reaches, **{name: value if isfinite(value) else None for name, value in numbers.items()}}
