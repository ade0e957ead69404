r"""Does each joint's temperature follow its own torque? A check of columns that were guessed from their numbers.

With the mean error :math:`e_{ij}` that the law of joint i's temperature (`law.py`) leaves where joint j's torque or
current heats it, the assignment of torques to temperatures with the least sum of :math:`\log e_{ij}^2` is compared
with the guess: the statistic is the mean of :math:`\log (e_{ii}^2 / e_{i \pi(i)}^2)` over the joints that change.
Joints that work alike give next to 0, whatever their order, and heat from a neighbour does not matter, since it would
have to fit both ways.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.logs.columns import ColumnSource, toml_line
from lptn.logs.guess import Guess
from lptn.logs.law import Blocks

_BOUND = 0.3
"""Of the statistic: the other order leaves a quarter less of the squared error. On virtual quadrupeds and legs it is 0
in the right order; of joints exchanged, at least 0.39 with sensors of 1 K steps, 1.5 with others."""
_FLOOR = 1e-3  # K: what no sensor's means over a block are better than
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
        other, gain = better_order({key: values[key] for key in sorted(keys)} | {"time": time}, places, quantity)
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


def better_order(values: Mapping[str, FloatArray], places: Sequence[str], quantity: str) -> tuple[list[int], float]:
    """For each temperature the load that it follows, all assigned once, and the statistic; 0 for the given order.

    Args:
        values: time [s], temperatures and loads, (n,) each, NaN where missing.
        places: of the joints.
        quantity: torque or current.
    """
    from scipy.optimize import linear_sum_assignment  # here, since it takes a while to import

    blocks, own = Blocks(values), list(range(len(places)))
    errors = np.zeros((len(places), len(places)))
    for i, part in enumerate(places):
        for j, place in enumerate(places):
            warming = blocks.warming(f"temperature.{part}", f"{quantity}.{place}")
            if warming is None:
                return own, 0.0
            errors[i, j] = np.mean(np.abs(warming.off(np.ones(warming.rate.size, dtype=bool))))
    costs = 2 * np.log(errors + _FLOOR)
    order = linear_sum_assignment(costs)[1]
    moved = np.flatnonzero(order != own)
    return order.tolist(), float(np.mean(costs[moved, moved] - costs[moved, order[moved]])) if moved.size else 0.0
