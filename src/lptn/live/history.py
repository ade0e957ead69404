"""The rows of the last hours, in bounded memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray

_FEW = 1024  # rows for which there is room at first


class History:
    """Rows of the same quantities, the oldest forgotten.

    Args:
        names: of the quantities.
        seconds: that are kept.
        most: rows that are kept.
    """

    def __init__(self, names: Sequence[str], seconds: float, most: int) -> None:
        self.names, self._seconds, self._most = list(names), seconds, most
        self._table = np.empty((_FEW, len(self.names) + 2))  # and time, and whether nothing is known before
        self._begin = self._end = 0

    def __len__(self) -> int:
        return self._end - self._begin

    def add(self, time: float, row: Mapping[str, float], *, first: bool) -> None:
        """Add a row of a time [s]; `first` behind a gap."""
        if self._end == len(self._table):
            kept = self._table[self._begin : self._end].copy()
            if 2 * len(kept) > len(self._table):
                self._table = np.empty((2 * len(self._table), self._table.shape[1]))
            self._table[: len(kept)] = kept
            self._begin, self._end = 0, len(kept)
        self._table[self._end] = [time, first, *(row[name] for name in self.names)]
        self._end += 1
        oldest = np.searchsorted(self.time, time - self._seconds)
        self._begin += max(int(oldest), len(self) - self._most)

    @property
    def time(self) -> FloatArray:
        """Where each row begins, (n,) s."""
        return self._table[self._begin : self._end, 0]

    @property
    def first(self) -> BoolArray:
        """Rows behind a gap, (n,)."""
        return np.asarray(self._table[self._begin : self._end, 1] > 0)

    def columns(self) -> dict[str, FloatArray]:
        """Each quantity, (n,), as it is now."""
        part = self._table[self._begin : self._end, 2:].copy()
        return dict(zip(self.names, part.T, strict=True))

    def last(self, name: str) -> float:
        """The newest value of a quantity; NaN of one that is not kept."""
        return float(self._table[self._end - 1, 2 + self.names.index(name)]) if name in self.names else np.nan

    def state(self) -> dict[str, FloatArray]:
        """All of it, as plain arrays."""
        return {"names": np.array(self.names), "table": self._table[self._begin : self._end]}

    def restore(self, state: Mapping[str, FloatArray]) -> None:
        """Take up what `state` gave."""
        self.names, table = [str(name) for name in state["names"]], state["table"]
        self._table = np.empty((max(_FEW, 2 * len(table)), table.shape[1]))
        self._table[: len(table)] = table
        self._begin, self._end = 0, len(table)
