"""N·m per ampere that a log of both shows, beside the torque constant that the model holds.

A drive that logs torque and current tells what its ampere is: the constant of a data sheet is for another one, RMS or
peak, motor or joint, where the two differ by the factor between them. A constant that is held wrong scales all losses
by the square of that factor, and all capacities and conductances with them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lptn.logs.run import Run
from lptn.model.model import Model

FACTORS = {
    "RMS and peak": 2**0.5,
    "power-invariant and RMS": 3**0.5,
    "power-invariant and peak": 1.5**0.5,
}
"""Ratios of the amperes that one current is counted in: a sinusoid's peak is √2 RMS; the q axis of a power-invariant
transform √3 RMS and √1.5 peak."""
TOLERANCE = 0.1
"""Relative; how far a data sheet's constant may be off a motor's. Magnets and cold or warm windings make some 10 %."""
_PROPORTIONAL = 0.95
"""Correlation of torque² with current², by which one is the other's measure: friction and ripple leave more."""


def torque_per_ampere(model: Model, runs: Sequence[Run]) -> dict[str, tuple[float, float]]:
    """Of each joint whose torque heats its winding: N·m per ampere as logged, and as the model says.

    Joints whose current isn't logged, or doesn't go with the torque, are left out.

    Args:
        model: the model, whose torque constants are as it says.
        runs: what was logged.
    """
    constants = {}
    for instance in model.network.effect_instances:
        if instance.effect.key != "copper_loss" or instance.effect.chosen["input"] != "torque":
            continue
        torque, current = (f"{quantity}.{instance.driven_by}" for quantity in ("torque", "current"))
        both = [run.columns for run in runs if torque in run.columns and current in run.columns]
        if not both or instance.driven_by in constants:
            continue
        squares = np.array([np.concatenate([columns[key] for columns in both]) for key in (torque, current)]) ** 2
        squares = squares[:, np.isfinite(squares).all(axis=0)]
        if squares.size and squares.std(axis=1).min() > 0 and np.corrcoef(squares)[0, 1] > _PROPORTIONAL:
            logged = float(np.sqrt(squares[0].sum() / squares[1].sum()))
            constants[instance.driven_by] = logged, float(model.values[instance.parameters["torque_constant"]])
    return constants


def apart(logged: float, said: float) -> str:
    """By what two constants may differ, `"as RMS and peak amperes do"`; empty within `TOLERANCE`."""
    ratio = max(logged, said) / min(logged, said)
    if ratio <= 1 + TOLERANCE:
        return ""
    geared = 3.0  # the smallest ratio of usual gears
    near = [name for name, factor in FACTORS.items() if abs(np.log(ratio / factor)) < np.log(1 + TOLERANCE) / 2]
    between = f", as {near[0]} amperes are" if near else ", as torque before and behind a gear is" * (ratio >= geared)
    return f"{ratio:.2f} times apart{between}"
