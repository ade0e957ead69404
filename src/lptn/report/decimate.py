"""Long series thinned for drawing, without losing a peak."""

from __future__ import annotations

import numpy as np

from lptn.arrays import FloatArray

MOST = 900  # points a line; a panel is some 300 pt wide


def decimated(time: FloatArray, values: FloatArray, most: int = MOST) -> tuple[FloatArray, FloatArray]:
    """A line that looks the same with at most about `most` points.

    Each block of samples keeps its smallest and its largest value, at their own times. A block without any
    value keeps one NaN, so that a gap stays a gap.

    Args:
        time: shape (n,).
        values: shape (n,), NaN where missing.
        most: about how many points to keep.
    """
    if time.size <= most:
        return time, values
    kept: list[int] = []
    for block in np.array_split(np.arange(time.size), max(1, most // 2)):
        finite = block[np.isfinite(values[block])]
        if finite.size == 0:
            kept.append(int(block[0]))
        else:
            extremes = finite[np.argmin(values[finite])], finite[np.argmax(values[finite])]
            kept += sorted({int(index) for index in extremes})
    return time[kept], values[kept]
