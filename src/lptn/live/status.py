"""What is known of a robot now, for every sink."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import inf, isfinite

from lptn.basics.files import finite
from lptn.online.fault_bank import Alarm

BAND = 10.0
"""K below the limit where torque is to be scaled down, as in FMUs."""


@dataclass(frozen=True)
class NodeStatus:
    """One node, or hottest point.

    Args:
        node: its name.
        temperature: estimated [degC].
        low: end of its interval on the cold side [degC].
        high: on the hot side [degC].
        reading: the newest [degC]; NaN where none came in the last step.
        limit: degC; `None` where it has none.
        time_to_limit: s, infinite for never; `None` while nothing can be said.
        earliest: end of its interval on the early side [s].
        latest: on the late side [s].
        trust: of its sensor: "trusted", "not yet", "none", or why it is not used.
    """

    node: str
    temperature: float
    low: float
    high: float
    reading: float
    limit: float | None
    time_to_limit: float | None
    earliest: float | None
    latest: float | None
    trust: str

    @property
    def torque_scale(self) -> float | None:
        """Factor on the torque that is wanted: 1 up to `BAND` below the limit, 0 at it, by the interval's hot end."""
        return None if self.limit is None else min(max((self.limit - self.high) / BAND, 0.0), 1.0)


@dataclass(frozen=True)
class Status:
    """A robot at one time.

    Args:
        time: s, of the source's clock.
        nodes: in the model's order.
        alarms: faults of sensors and inputs that `lptn.monitor` finds in the last hours.
        assessed: s since forecast and alarms were made; infinite before the first.
        missing: inputs that are silent, so that the rest stands still.
        counts: of messages, dropped ones, bad ones, late ones, jumps of the clock, gaps, rows.
        changed: s of that clock, since when the robot is not as its model; `None` while it is.
        events: what happened since the last status, a sentence each.
    """

    time: float
    nodes: tuple[NodeStatus, ...]
    alarms: tuple[Alarm, ...] = ()
    assessed: float = inf
    missing: tuple[str, ...] = ()
    counts: Mapping[str, int] | None = None
    changed: float | None = None
    events: tuple[str, ...] = ()

    @property
    def soonest(self) -> NodeStatus | None:
        """The node that reaches its limit first; `None` where none does."""
        ahead = [one for one in self.nodes if one.time_to_limit is not None and isfinite(one.time_to_limit)]
        return min(ahead, key=lambda one: one.time_to_limit or 0.0, default=None)

    def as_json(self) -> dict[str, object]:
        """The status as other tools read it: s, degC; what is never reached, or not known, is null."""
        nodes = {
            one.node: {key: value for key, value in asdict(one).items() if key != "node"}
            | {"torque_scale": one.torque_scale}
            for one in self.nodes
        }
        content: dict[str, object] = finite(
            {
                "time": self.time,
                "nodes": nodes,
                "alarms": [alarm.as_json() for alarm in self.alarms],
                "seconds_since_assessment": self.assessed,
                "missing": list(self.missing),
                "counts": dict(self.counts or {}),
                "changed": self.changed,
                "events": list(self.events),
            }
        )
        return content
