"""Which readings of a run are to be believed: those of sensors that are alive (`living_sensors`), one by one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.errors import InputError
from lptn.logs.run import Run
from lptn.online.estimator import Estimate, Estimator, run_filter
from lptn.simulate.bound_run import BoundRun


@dataclass(frozen=True)
class Doubt:
    """A sensor that is not believed.

    Args:
        node: whose sensor.
        since: s of the log's clock; readings from then on are left out.
        why: in words.
    """

    node: str
    since: float
    why: str

    def __str__(self) -> str:
        return f"{self.node}: {self.why}"


def without(run: Run, nodes: tuple[str, ...], left_out: BoolArray) -> Run:
    """A run without the readings that are `left_out`, shape (nodes, n)."""
    columns = dict(run.columns)
    for node, rows in zip(nodes, left_out, strict=True):
        if rows.any():
            columns[f"temperature.{node}"] = np.where(rows, np.nan, columns[f"temperature.{node}"])
    return replace(run, columns=columns)


def not_alive(estimator: Estimator, bound: BoundRun) -> tuple[BoolArray, list[Doubt]]:
    """Readings of sensors that are not alive, shape (nodes, n); and the sensors that are not at the end.

    Args:
        estimator: fresh, one that watches its sensors.
        bound: the run.
    """
    if estimator.sensors is None:
        raise ValueError("estimator: found one that does not watch its sensors; expected watch=True")
    time, left_out = bound.run.time, np.zeros(bound.measured.shape, dtype=bool)
    estimate: Estimate | None = None
    once_trusted, lost, stood = (np.zeros(len(left_out), dtype=bool) for _ in range(3))
    for k, latest in enumerate(run_filter(estimator, bound)):
        estimate, sensors = latest, estimator.sensors
        once_trusted |= sensors.trusted
        for node in np.flatnonzero((sensors.lost & ~lost) | (sensors.stands & ~stood)):
            # No reading of a sensor that was never alive was one; of one that stands the first was.
            since = sensors.since[node] - sensors.clock + time[k] if sensors.stands[node] else time[k]
            left_out[node, : k + 1] |= (time[: k + 1] > since) | ~once_trusted[node]
        lost, stood = sensors.lost.copy(), sensors.stands.copy()
        left_out[lost, k] = True
    reasons = {} if estimate is None else estimate.untrusted
    nodes = estimator.model.nodes
    return left_out, [Doubt(node, _since(left_out[nodes.index(node)], time), why) for node, why in reasons.items()]


def _since(rows: BoolArray, time: FloatArray) -> float:
    """Since when all readings have been left out [s]."""
    kept = np.flatnonzero(~rows)
    return float(time[min(kept[-1] + 1, time.size - 1)] if kept.size else time[0])


def refuse_none(run: Run, nodes: tuple[str, ...], doubts: list[Doubt]) -> None:
    """Refuse a run in which no sensor is alive.

    Raises:
        InputError: it is such a one.
    """
    readings = [run.columns[f"temperature.{node}"] for node in nodes if run.has(f"temperature.{node}")]
    if not any(np.isfinite(column).any() for column in readings):
        raise InputError(run.source, "temperature columns", "; ".join(map(str, doubts)), "a sensor that is alive")
