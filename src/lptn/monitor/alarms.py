"""An alarm: which sensor, which kind of fault, when."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Kind = Literal["drift", "offset", "stuck", "dropout"]


@dataclass(frozen=True)
class Alarm:
    """One sensor's fault as a detector sees it.

    Args:
        node: whose sensor.
        kind: named from the log up to some minutes behind the alarm.
        time: at which it was called [s, in the log's clock].
        onset: at which it seems to have begun [s].
        size: K for an offset, K/s for a drift; `None` for the others.
    """

    node: str
    kind: Kind
    time: float
    onset: float
    size: float | None = None

    def as_json(self) -> dict[str, object]:
        """The alarm as other tools read it."""
        return {"node": self.node, "kind": self.kind, "time": self.time, "onset": self.onset, "size": self.size}


def earliest(alarms: Iterable[Alarm]) -> list[Alarm]:
    """The first alarm at each sensor, in order of time."""
    found: dict[str, Alarm] = {}
    for alarm in sorted(alarms, key=lambda each: each.time):
        found.setdefault(alarm.node, alarm)
    return list(found.values())
