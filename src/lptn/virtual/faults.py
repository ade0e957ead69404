"""Spoil the readings of single temperature sensors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .quadruped_truth import NODES
from .robot import Array

KINDS = ("drift", "offset", "stuck", "dropout")


@dataclass(frozen=True)
class Fault:
    """One fault of one sensor.

    Args:
        kind: "drift" (K/s), "offset" (K), "stuck" (the reading stays as it is) or "dropout" (no reading).
        at: a joint, or "pc".
        time: s from the run's beginning at which it starts.
        size: K/s or K, of either sign; means nothing for the others.
        until: s at which it ends.

    Raises:
        ValueError: a value outside its range.
    """

    kind: str
    at: str
    time: float
    size: float = 0.0
    until: float = math.inf

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"fault: found {self.kind!r}; expected one of {', '.join(KINDS)}")
        if self.at not in NODES:
            raise ValueError(f"place of {self.kind}: found {self.at!r}; expected one of {', '.join(NODES)}")
        if not 0 <= self.time < self.until:
            raise ValueError(f"time of {self.kind}: found {self.time:g}; expected 0 s or above, before its end")
        if not math.isfinite(self.size):
            raise ValueError(f"size of {self.kind}: found {self.size:g}; expected a finite number")


def shift(faults: Sequence[Fault], time: Array, shown: Array) -> None:
    """Add drifts and offsets, in place, to what the sensors would show at these times, of shape (rows, nodes)."""
    for fault in faults:
        on = (time >= fault.time) & (time < fault.until)
        if fault.kind == "drift":
            shown[:, NODES.index(fault.at)] += fault.size * (time - fault.time) * on
        elif fault.kind == "offset":
            shown[:, NODES.index(fault.at)] += fault.size * on


def spoil(faults: Sequence[Fault], time: Array, readings: Array, frozen: Array) -> None:
    """Put in, in place, readings that are stuck or missing; ``frozen`` has one reading a fault."""
    for fault, held in zip(faults, frozen, strict=True):
        on = (time >= fault.time) & (time < fault.until)
        if fault.kind in ("stuck", "dropout"):
            readings[on, NODES.index(fault.at)] = held if fault.kind == "stuck" else np.nan
