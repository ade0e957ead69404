"""The inner step of Co-Simulation, checked against the model's fastest time constant."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import casadi as ca
import numpy as np

from lptn.arrays import FloatArray
from lptn.errors import InputError

from .component import Component
from .variables import Kind

Solver = Literal["rk4", "ros2"]
_EXACT = 0.05  # step over fastest time constant at which RK4 errs by 5e-8 of a mode
_LONGEST = 1.0  # s; no robot's load keeps still for longer
_ROS2_STEP = 0.1  # s; of second order, so no longer than this where nobody says
_REACH = 0.5  # step over fastest time constant that RK4 is let go to
_MOST_PARTS = 1000  # a finer division means a stiff network: that is what ROS2 is for


@dataclass(frozen=True)
class Integration:
    """How Co-Simulation integrates.

    Args:
        solver: `rk4` or `ros2`.
        step: longest inner step [s].
        fastest: fastest time constant at the start values [s].
        notes: what was changed or should be known, a sentence each.
    """

    solver: Solver
    step: float
    fastest: float
    notes: tuple[str, ...] = ()


def integration(component: Component, solver: str, step: float | None) -> Integration:
    """The inner step: as asked, divided where the fastest time constant needs it, or a fitting one.

    Args:
        solver: `rk4`, order 4 and explicit, or `ros2`, order 2 and L-stable, for stiff networks.
        step: longest inner step [s]; by default a fitting one.

    Raises:
        InputError: an unknown solver, a step that is no positive number, or one that RK4 would need 1000 parts of.
    """
    origin = component.model.network.origin
    if solver not in get_args(Solver):
        raise InputError(origin, "solver", f"'{solver}'", " or ".join(get_args(Solver)))
    if step is not None and not (step > 0 and math.isfinite(step)):
        raise InputError(origin, "step", f"{step!r}", "a positive number of seconds")
    fastest = 1 / _fastest_rate(component)
    if solver == "ros2":
        return Integration("ros2", step or _ROS2_STEP, fastest)
    if step is None:
        return Integration("rk4", _round(min(_LONGEST, _EXACT * fastest)), fastest)
    parts = math.ceil(step / (_REACH * fastest) - 1e-9)
    if parts <= 1:
        return Integration("rk4", step, fastest)
    said = f"a step of {step:g} s with a fastest time constant of {fastest:.3g} s"
    if parts > _MOST_PARTS:
        raise InputError(origin, "step", said, "solver ros2, or a shorter step")
    note = f"{said}: divided into {parts} inner steps of {step / parts:.3g} s"
    return Integration("rk4", step / parts, fastest, (note,))


def _fastest_rate(component: Component) -> float:
    """The largest eigenvalue at the start values, with each input at rest and at a usual size [1/s]."""
    arguments = [component.x, component.u, component.p]
    jacobian = ca.Function("jacobian", arguments, [ca.densify(ca.jacobian(component.rates, component.x))])
    x, u, p = (_starts(component, kind) for kind in ("state", "input", "parameter"))
    hot = np.array([variable.celsius for variable in component.of("input")], dtype=bool)
    rates = []
    for size in (0.0, 1.0, 3.0):
        usual = np.where(hot, u, size) if u.size else u
        values = jacobian(x + 10 * size, usual, p).full()
        rates.append(float(np.abs(np.linalg.eigvals(values)).max()))
    return max(*rates, 1e-12)


def _starts(component: Component, kind: Kind) -> FloatArray:
    return np.array([variable.start for variable in component.of(kind)], dtype=float)


def _round(value: float) -> float:
    """The next smaller number of the row 1, 2, 5, 10."""
    power = 10.0 ** math.floor(math.log10(value) + 1e-12)
    return float(f"{max(factor for factor in (1, 2, 5) if factor * power <= value * (1 + 1e-9)) * power:.6g}")
