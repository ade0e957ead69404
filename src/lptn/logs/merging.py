"""Columns with times of their own put on the union of their times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lptn.arrays import FloatArray


def on_one_time(
    parts: Sequence[tuple[NDArray[Any], Mapping[str, FloatArray]]],
) -> tuple[NDArray[Any], dict[str, FloatArray]]:
    """All times, (m,) increasing, and each column on them, (m,), NaN at the times of others.

    Where a part has several values of a column at one time the first counts: messages of one stamp may hold a part of
    the joints each.

    Args:
        parts: times, (n,), and columns by name, (n,) each; all times in the same unit.
    """
    time = np.unique(np.concatenate([own for own, _ in parts]))
    columns: dict[str, FloatArray] = {}
    for own, values in parts:
        at = np.searchsorted(time, own)
        for name, column in values.items():
            backwards = np.flatnonzero(~np.isnan(column))[::-1]
            columns[name] = np.full(time.size, np.nan)
            columns[name][at[backwards]] = column[backwards]
    return time, columns
