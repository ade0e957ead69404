"""Whether a load's column changes what it means within a log: from some row on as much of it makes another heat.

How fast a part warms goes with its load's square, and with how much warmer it is than what surrounds it. In a column
that turns into another unit, or whose amplifier changes its range, the first of these proportions changes at one time.
What else may change then, such as a fan that starts, is left free.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.logs.resampling import means_of_blocks

_PARTS = 120
"""Of a log, in whose means a part's warming stands out of its sensor's noise, and the time of a change is known."""
_LEAST_PARTS = 15
"""On each side of a change, from which six numbers can be told."""
_TIMES = 3.0
"""By which heats differ: friction, iron and a winding that warms change them by less, a unit by the square of more."""
_ERRORS = 4.0
"""Standard errors, at the likeliest of a hundred times at which it may have changed."""
_LOADED = 0.02
"""Of the mean square, on each side: with less load other heat is all that warms a part."""
_OF_ONE_GAIN = 0.5
"""Of the squares that one gain leaves with all else free to change: a load that is another explains half of them."""
_ROWS = 10
"""Of a part: in fewer the mean square of a load that swings is not known."""
_RIDGE = 1e-9
"""Of the squares of a column, so that two temperatures that are one leave the rest to be told."""


class GainChange(NamedTuple):
    """A change of a load's heat.

    Args:
        start: row from which it is another.
        ratio: of the heat that as large a load makes from there on to that before.
    """

    start: int
    ratio: float


def gain_change(
    time: FloatArray,
    load: FloatArray,
    temperature: FloatArray,
    surroundings: Sequence[FloatArray],
    speed: FloatArray | None = None,
) -> GainChange | None:
    """The change of a load's heat within a log; `None` where there is none beyond doubt.

    Args:
        time: (n,) s.
        load: (n,) torque or current.
        temperature: (n,) degC, of the part that it heats.
        surroundings: (n,) degC each, of the air first, and of other parts.
        speed: (n,) of its joint, whose size goes with friction; `None` where it is not logged.
    """
    size = load.size // _PARTS
    if size < _ROWS:
        return None
    times, warm, heat = (means_of_blocks(x, size) for x in (time, temperature, np.square(load)))
    known = [np.ones(warm.size - 1), *(_between(means_of_blocks(x, size) - warm) for x in surroundings)]
    known += [] if speed is None else [_between(means_of_blocks(np.abs(speed), size))]
    columns = np.column_stack([np.diff(warm) / np.diff(times), _between(heat), *known])
    rows = np.flatnonzero(np.isfinite(columns).all(axis=1))
    if rows.size < _PARTS // 2:
        return None
    warming, square = columns[rows, 0], columns[rows, 1]
    design = columns[rows, 1:] / (np.sqrt(np.square(columns[rows, 1:]).sum(axis=0)) + np.finfo(float).tiny)
    changes = np.arange(_LEAST_PARTS, rows.size - _LEAST_PARTS)
    of_late = np.cumsum(square[::-1])[::-1][changes]
    means = of_late / (rows.size - changes), (square.sum() - of_late) / changes
    changes = changes[np.minimum(*means) > _LOADED * np.maximum(*means)]
    if not changes.size:
        return None
    # From each row on the load's heat changes, other heat, and what leaves to the first of the surroundings.
    late = np.where(np.arange(rows.size) >= changes[:, None], 1.0, 0.0)[:, :, None] * design[:, :3]
    designs = np.concatenate([late, np.broadcast_to(design, (changes.size, *design.shape))], axis=2)
    fitted, inverses, squares = _least_squares(designs, warming)
    best = int(squares.argmin())
    if squares[best] > _OF_ONE_GAIN * _least_squares(designs[:, :, 1:], warming)[2].min():
        return None
    both = np.zeros((2, designs.shape[2]))
    both[:, _SQUARE] = both[1, 0] = 1.0
    gains = both @ fitted[best]
    variances = np.einsum("ij,jk,ik->i", both, inverses[best], both) * squares[best] / (rows.size - designs.shape[2])
    errors, (low, high) = np.sqrt(variances), np.argsort(gains)
    if gains[high] - _ERRORS * errors[high] <= _TIMES * (max(gains[low], 0.0) + _ERRORS * errors[low]):
        return None
    return GainChange(int((rows[changes[best]] + 1) * size), float(gains[1] / gains[0]))


_SQUARE = 3  # the column of a design that holds the load's square, behind the three that change


def _least_squares(designs: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of each design (n, columns) the coefficients, the inverse of its normal matrix, and the squares that are left."""
    turned = np.swapaxes(designs, 1, 2)
    inverses = np.linalg.inv(turned @ designs + _RIDGE * np.eye(designs.shape[2]))
    fitted = inverses @ (turned @ values)[:, :, None]
    left: FloatArray = np.square(values - (designs @ fitted)[:, :, 0]).sum(axis=1)
    return fitted[:, :, 0], np.asarray(inverses, dtype=float), left


def _between(values: FloatArray) -> FloatArray:
    """Means of neighbours, shape (n - 1,)."""
    return np.asarray(0.5 * (values[:-1] + values[1:]))
