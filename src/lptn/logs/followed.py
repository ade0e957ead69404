r"""Does each joint's temperature follow its own torque? A check of columns that were guessed from their numbers.

Of joint i's temperature and joint j's torque or current, by block means over the log,

.. math:: T_i(t) \approx a + b t + k \int q_j - m \int (T_i - T_i(0)), \quad k \ge 0, \quad q_j = \tau_j^2

by least squares, with the mean square error :math:`e_{ij}`. The assignment of torques to temperatures with the least
sum of :math:`\log e_{ij}` is compared with the guess: the statistic is the mean of
:math:`\log (e_{ii} / e_{i \pi(i)})` over the joints that change. Joints that work alike give next to 0, whatever
their order, and heat from a neighbour does not matter, since it would have to fit both ways.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np

from lptn.basics.arrays import FloatArray, IntArray
from lptn.basics.errors import InputError
from lptn.logs.columns import ColumnSource, toml_line
from lptn.logs.guess import Guess

_BOUND = 0.3
"""Of the statistic: the other order leaves a quarter less of the squared error. On 180 healthy logs of virtual
quadrupeds and legs it was at most 0.14; of joints exchanged by kind, where loads changed, at least 0.28."""
_BLOCKS, _SHORTEST, _FEWEST = 200, 10.0, 10  # blocks of a log, s of one, and blocks at least
_FLOOR = 1e-3  # K²: what no sensor's means over a block are better than
_DRIVES = ("torque", "current")


def refuse_exchanged(
    path: Path,
    guesses: Collection[Guess],
    sources: Mapping[str, ColumnSource],
    time: FloatArray,
    values: Mapping[str, FloatArray],
) -> None:
    """Refuse numbered guesses by which temperatures follow other joints' torques clearly better than their own.

    Args:
        path: the log.
        guesses: what was guessed.
        sources: where the quantities stand.
        time: (n,) s.
        values: the quantities, (n,) each, NaN where missing.

    Raises:
        InputError: they do; it has the lines by which each would follow its own.
    """
    numbered = {guess.key for guess in guesses if guess.numbered}
    for quantity in _DRIVES:
        places = [
            place
            for key in values
            for place in [key.partition(".")[2]]
            if key.startswith("temperature.") and f"{quantity}.{place}" in values
        ]
        keys = {f"{name}.{place}" for place in places for name in (quantity, "temperature")}
        if len(places) < 2 or numbered.isdisjoint(keys):
            continue
        warm = [values[f"temperature.{place}"] for place in places]
        other, gain = better_order(time, warm, [values[f"{quantity}.{place}"] for place in places])
        if gain < _BOUND:
            continue
        followed = dict(zip(places, (places[k] for k in other), strict=True))
        moved = [place for place in places if followed[place] != place]
        if any(f"{quantity}.{place}" in numbered for place in moved):
            lines = {f"{quantity}.{place}": f"{quantity}.{of}" for place, of in followed.items()}
        else:
            lines = {f"temperature.{of}": f"temperature.{place}" for place, of in followed.items()}
        problem = f"numbered columns by which {len(moved)} temperatures follow the {quantity} of another joint better "
        problem += f"than that of their own (squared error × {np.exp(-gain):.2g})"
        written = "; ".join(toml_line(key, sources[of]) for key, of in lines.items())
        raise InputError(path, "guess", problem, f"lines under [columns] that say whose they are, perhaps {written}")


def better_order(time: FloatArray, warm: list[FloatArray], drives: list[FloatArray]) -> tuple[list[int], float]:
    """For each temperature the drive that it follows, all assigned once, and the statistic; 0 for the given order.

    Args:
        time: (n,) s, increasing.
        warm: temperatures, (n,) each, NaN where missing.
        drives: torques or currents of the same joints, in the same order, (n,) each, NaN where missing.
    """
    from scipy.optimize import linear_sum_assignment  # here, since it takes a while to import

    own = list(range(len(warm)))
    count = int(min(_BLOCKS, (time[-1] - time[0]) / _SHORTEST))
    if count < _FEWEST:
        return own, 0.0
    edges = np.linspace(time[0], time[-1], count + 1)
    block = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, count - 1)
    heats = [_filled(_means(block, drive**2, count)) for drive in drives]
    errors = np.zeros((len(warm), len(drives)))
    for i, readings in enumerate(warm):
        means = _filled(_means(block, readings, count))
        errors[i] = [_error(means, heat) for heat in heats]
    costs = np.log(errors + _FLOOR)
    order = linear_sum_assignment(costs)[1]
    moved = np.flatnonzero(order != own)
    gain = float(np.mean(costs[moved, moved] - costs[moved, order[moved]])) if moved.size else 0.0
    return order.tolist(), gain


def _means(block: IntArray, values: FloatArray, count: int) -> FloatArray:
    there = np.isfinite(values)
    total = np.bincount(block[there], values[there], count)
    number = np.bincount(block[there], minlength=count)
    return np.asarray(np.divide(total, number, out=np.full(count, np.nan), where=number > 0))


def _filled(means: FloatArray) -> FloatArray:
    """Without holes: between its neighbours; 0 where there is nothing at all."""
    there, place = np.isfinite(means), np.arange(means.size)
    return np.asarray(np.interp(place, place[there], means[there])) if there.any() else np.zeros(means.size)


def _error(means: FloatArray, heat: FloatArray) -> float:
    """Mean square error, K², of a temperature that follows a heat; without it where it would cool."""
    rise, put_in = np.cumsum(means - means[0]), np.cumsum(heat) - heat / 2
    base = [np.ones(means.size), np.linspace(0, 1, means.size), rise / (np.abs(rise).max() or 1.0)]
    for columns in ([*base, put_in / (np.abs(put_in).max() or 1.0)], base):
        matrix = np.column_stack(columns)
        coefficients = np.linalg.lstsq(matrix, means, rcond=None)[0]
        if len(columns) == len(base) or coefficients[-1] > 0:
            break
    return float(np.mean((means - matrix @ coefficients) ** 2))
