"""Limits that can't be kept whatever is done, refused before anything is solved."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.model.model import Model


def check_limits_at_rest(
    model: Model,
    origin: str,
    limits: Mapping[str, float],
    start: FloatArray,
    idle: Callable[[float, FloatArray], FloatArray],
    ends: FloatArray,
    air: Mapping[str, float],
) -> None:
    """Refuse a limit that a node passes, or never comes down to, though no joint does anything all the time.

    Args:
        model: the model.
        origin: the task file.
        limits: degC by node.
        start: states [degC].
        idle: (time [s], states) -> rates of the states [K/s] without any load.
        ends: ends of the task's steps [s]; in between the conditions are constant.
        air: hottest of each surrounding temperature [degC] by column.

    Raises:
        InputError: the node, and what warms it.
    """
    x, hottest, before = start, np.full(len(start), -np.inf), 0.0
    first = idle(0.0, start)
    for end in ends:
        x = solve_ivp(idle, (before, end), x, method="LSODA", t_eval=[end], max_step=end - before).y[:, -1]
        hottest, before = np.maximum(hottest, x), float(end)
    for node, limit in limits.items():
        row = model.places.index(node)
        above = start[row] > limit  # then it is enough that it cools
        if above and (first[row] < 0 or x[row] <= limit):
            continue
        if not above and hottest[row] <= limit + 0.01:  # K; less is the integrator's own
            continue
        column, warmest = max(air.items(), key=lambda item: item[1], default=("", -np.inf))
        why = f"{column} of {warmest:g} degC" if warmest > limit else "heat that is there without any load"
        raise InputError(
            origin, f"limits.{node}", f"{limit:g} degC, which {node} passes by {why}, though no joint does anything",
            f"a limit above {max(hottest[row], x[row]):.4g} degC, which it reaches so by the end",
        )  # fmt: skip
