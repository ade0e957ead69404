"""The noise of a coarse sensor, which hides in its steps, from how often its reading flickers between two of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lptn.arrays import FloatArray
from lptn.simulate import Drive

_SAFE = 0.3  # of a step: too much noise costs a filter little, too little makes it sure of what is wrong
_SMOOTH = 60  # readings over which a movement of the temperature itself is told from flicker
_FEWEST = 600  # readings
_LEAST = 0.02  # of a step


def coarse_noise(drives: Sequence[Drive], row: int, step: float) -> float:
    r"""Standard deviation of the noise before rounding [K], of one node's sensor.

    White noise of standard deviation :math:`\sigma` changes the reading from one sample to the next with probability
    :math:`2\sigma / (q\sqrt\pi)`, averaged over a cell of width q; what the temperature's own movement adds is
    taken off. Readings that were averaged after rounding don't show it: then a share of the step serves.
    """
    single = [_whole(driven.measured[row], step) for driven in drives if not driven.run.averaged]
    pairs = sum(max(0, readings.size - _SMOOTH) for readings in single)
    if pairs < _FEWEST:
        return _SAFE * step
    changes = sum(float(np.abs(np.diff(readings)).clip(max=step).sum()) for readings in single)
    moved = sum(float(np.abs(readings[_SMOOTH:] - readings[:-_SMOOTH]).sum()) / _SMOOTH for readings in single)
    return float(max(np.sqrt(np.pi) / 2 * (changes - moved) / pairs, _LEAST * step))


def _whole(readings: FloatArray, step: float) -> FloatArray:
    """Readings without gaps; none where they don't lie on the sensor's steps."""
    known = readings[np.isfinite(readings)]
    off = np.abs((known - known[:1]) / step - np.round((known - known[:1]) / step))
    return known if known.size > _SMOOTH and off.max() < 0.02 else known[:0]
