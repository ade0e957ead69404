"""One run to be watched: what was read, and what the free-running model expects."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from lptn.arrays import BoolArray, FloatArray
from lptn.logs import Run
from lptn.model import Model
from lptn.simulate import drive, simulate

_COLDEST, _HOTTEST = -60.0, 250.0  # degC; what lies beyond is an error code, no temperature
_SAME = 1e-6  # K


@dataclass(frozen=True)
class Scene:
    """Readings and expectation of a run.

    Args:
        run: the run.
        nodes: names of the n nodes, in order.
        measured: readings [degC], NaN where missing or no temperature, shape (nodes, n).
        expected: readings of the model that runs freely from the run's first readings [degC], shape (nodes, n).
    """

    run: Run
    nodes: tuple[str, ...]
    measured: FloatArray
    expected: FloatArray

    @classmethod
    def of(cls, model: Model, run: Run) -> Scene:
        """Let the model run.

        Raises:
            InputError: the run lacks an input, or measures none of the model's nodes.
        """
        driven = drive(model, run)
        return cls(run, tuple(model.nodes), believable(driven.measured), simulate(model, driven).readings)

    @property
    def residual(self) -> FloatArray:
        """Measured minus expected [K], shape (nodes, n)."""
        return self.measured - self.expected

    @property
    def time(self) -> FloatArray:
        """Time of each reading [s, in the log's clock], shape (n,)."""
        return self.run.time

    def after(self, time: float) -> int:
        """Index of the last reading not after a time [s]."""
        return max(0, int(np.searchsorted(self.time, time, side="right")) - 1)

    @cached_property
    def steps(self) -> FloatArray:
        """Step of each sensor [K], 0 for a fine one, shape (nodes,)."""
        return np.array([self.run.resolution.get(f"temperature.{node}", 0.0) for node in self.nodes])

    @cached_property
    def moved(self) -> FloatArray:
        """How far the model moved [K] since each reading last changed, shape (nodes, n).

        A sensor with 1 K steps stands still for minutes when all is well; only where the model moved on is it
        stuck. A missing reading is no change.
        """
        found = np.zeros_like(self.expected)
        for row, path in enumerate(self.expected):
            begins = np.flatnonzero(np.append(self._changed(row), True))
            for begin, end in pairwise(begins):
                stretch = path[begin:end]
                found[row, begin:end] = np.maximum.accumulate(stretch) - np.minimum.accumulate(stretch)
        return np.where(np.isfinite(self.measured), found, 0.0)

    def stands_since(self, row: int, at: int) -> int:
        """Index of the reading since which a sensor's reading has not changed."""
        return int(np.flatnonzero(self._changed(row)[: at + 1])[-1])

    def _changed(self, row: int) -> BoolArray:
        """Where a reading differs from the last one before it that was not missing; the first one does."""
        known = np.isfinite(self.measured[row])
        last = np.maximum.accumulate(np.where(known, np.arange(known.size), 0))
        jumps = np.abs(np.diff(self.measured[row][last]))
        return np.concatenate([[True], jumps > _SAME])


def believable(measured: FloatArray) -> FloatArray:
    """Readings with error codes such as -273 or 999 degC made missing."""
    with np.errstate(invalid="ignore"):
        return np.where((measured > _COLDEST) & (measured < _HOTTEST), measured, np.nan)
