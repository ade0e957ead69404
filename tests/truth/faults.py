"""Faults of one of the quadruped's temperature sensors: drift, offset, stuck and missing readings."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd

from lptn.virtual import QUADRUPED_NODES
from lptn.virtual.robot import check_one_of

FAULTS = ("drift", "offset", "stuck", "dropout")


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
        check_one_of("fault", self.kind, FAULTS)
        check_one_of(f"place of {self.kind}", self.at, QUADRUPED_NODES)
        if not 0 <= self.time < self.until:
            raise ValueError(f"time of {self.kind}: found {self.time:g}; expected 0 s or above, before its end")

    def shown(self, log: pd.DataFrame, quantisation: float = 0.0) -> pd.DataFrame:
        """Return a log with this fault in it, and its sensors' readings rounded.

        Args:
            log: of the quadruped, without rounding (``quantisation=0``): a drift shifts what is rounded.
            quantisation: step that the sensors' readings are rounded to, K; 0 for none.
        """
        faulty, column, time = log.copy(), f"temperature.{self.at}", log["time"].to_numpy()
        acts = (time >= self.time) & (time < self.until)
        if self.kind in ("drift", "offset"):
            faulty[column] += acts * self.size * (time - self.time if self.kind == "drift" else 1.0)
        elif acts.any():
            faulty.loc[acts, column] = log[column][acts].iloc[0] if self.kind == "stuck" else np.nan
        if quantisation:
            readings = [f"temperature.{node}" for node in QUADRUPED_NODES]
            faulty[readings] = (faulty[readings] / quantisation).round() * quantisation
        return faulty
