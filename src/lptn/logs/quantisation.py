"""The step of a coarse temperature sensor, found from its readings."""

from __future__ import annotations

import numpy as np

from lptn.arrays import FloatArray

_SMALLEST, _LARGEST = 0.02, 5.0  # K; finer is the file's rounding, coarser is a fault code such as 85 or 0


def quantisation_step(values: FloatArray) -> float:
    """The step, K, of the regular grid on which raw readings sit; 0.0 if there is none.

    A grid is believed when each level returns three times on average, and all levels fit it within 2 %.

    Args:
        values: (n,) raw readings, K or degC; NaN is left out.
    """
    readings = values[np.isfinite(values)]
    levels = np.unique(np.round(readings, 4))  # float32 and unit conversion blur the last digits
    if levels.size < 2 or readings.size < 3 * levels.size:
        return 0.0
    jumps = np.diff(levels)
    step = float(np.median(jumps[jumps < 1.5 * jumps.min()]))
    counts = np.round(jumps / step)
    step = float(jumps.sum() / counts.sum())
    regular = np.abs(jumps - counts * step).max() <= 0.02 * step
    return float(f"{step:.4g}") if regular and _SMALLEST <= step <= _LARGEST else 0.0
