"""The equations of the limiter: the largest heat along a direction that keeps every node below its limit."""

from __future__ import annotations

from math import ceil, isinf
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray

from ..mpc.heat import Heating

_ITERATIONS = 3  # of Newton's method; it starts from no heat and squares its error each time
_STEADY = 5
_LEAST_STEPS = 3
_RATE = 1.0  # product of an RK4 step and a bound of the fastest rate
_NEVER = 1e30
_RISES = 1e-12  # K per unit of heat; less is none


class _Symbols(NamedTuple):
    """z and what it depends on; `p` stands for `prepared` parameters."""

    z: Any
    base: Any
    direction: Any
    most: Any
    x: Any
    d: Any
    p: Any
    limits: Any


def steps_for(heating: Heating, seconds: float, limits: FloatArray, conditions: FloatArray) -> int:
    """How many RK4 steps a horizon needs, from the fastest rate with every node at its limit.

    Args:
        heating: the model.
        seconds: horizon.
        limits: degC by node, infinite for none.
        conditions: the model's other inputs.
    """
    model = heating.model
    hot = np.where(np.isfinite(limits), limits, 60.0)[np.array(model.owners)]
    slope = np.asarray(heating.function()(hot, np.zeros(len(heating.joints)), conditions, model.values)[1].full())
    fastest = float(np.abs(slope).sum(axis=0).max())
    return max(_LEAST_STEPS, ceil(seconds * fastest / _RATE))


def prepared(heating: Heating) -> ca.Function:
    """p -> p with reciprocals of what is divided by (capacitances, resistances): divisions take most of the time."""
    p = ca.SX(heating.p)
    for index in _divisors(heating):
        p[index] = 1 / p[index]
    return ca.Function("prepared", [heating.p], [p])


def largest(heating: Heating, seconds: float, steps: int) -> ca.Function:
    """(x, base, direction, most, d, p, limits) -> the largest z up to `most` with heat base + z direction.

    p are `prepared` parameters.

    All nodes stay below their limits (degC, by node) at the end of every RK4 step until `seconds`; for an infinite
    horizon, in the steady state. Each iteration takes the least root of all temperatures, each linear in z.
    """
    s = _symbols(heating, ca.MX)
    z, at = ca.MX(0), s.x
    if isinf(seconds):
        settle = _steady(heating)
        for _ in range(_STEADY):
            z, at = settle(at, z, s.base, s.direction, s.most, s.d, s.p, s.limits)
    else:
        better = _course(heating, seconds, steps)
        for _ in range(_ITERATIONS):
            z = better(s.x, z, s.base, s.direction, s.most, s.d, s.p, s.limits)
    # C's minimum passes over what is no number; a sum does not.
    sound = ca.fabs(ca.sum1(s.x) + ca.sum1(s.base) + ca.sum1(s.d)) < _NEVER
    return ca.Function("largest", [s.x, s.base, s.direction, s.most, s.d, s.p, s.limits], [ca.if_else(sound, z, 0)])


def _divisors(heating: Heating) -> list[int]:
    network = heating.model.network
    return sorted({*network.capacities.values(), *(link.resistance for link in network.resistors)})


def _symbols(heating: Heating, kind: Any) -> _Symbols:
    joints, states = len(heating.joints), heating.x.numel()
    sizes = (1, joints, joints, 1, states, heating.d.numel(), heating.p.numel(), len(heating.model.nodes))
    return _Symbols(*(kind.sym(name, size) for name, size in zip(_Symbols._fields, sizes, strict=True)))


def _rates(heating: Heating, s: _Symbols) -> tuple[Any, Any]:
    """Rates at base + z direction, and their slope in z alone."""
    p = ca.SX(s.p)
    for index in _divisors(heating):
        p[index] = 1 / s.p[index]
    before, after = ca.vertcat(heating.x, heating.d, heating.p), ca.vertcat(s.x, s.d, p)
    rates = ca.substitute(heating.rates, before, after)
    pushed = ca.jtimes(rates, heating.heat, s.direction)
    heat = s.base + s.z * s.direction
    return ca.substitute(rates, heating.heat, heat), ca.substitute(pushed, heating.heat, heat)


def _room(x: Any, change: Any, limits: Any) -> Any:
    """The least change of z that takes a node to its limit; what no heat can mend counts as no room at all."""
    found = ca.SX(_NEVER)
    for k in range(limits.numel()):
        over, rises = limits[k] - x[k], change[k] > _RISES
        root = ca.if_else(rises, over / ca.if_else(rises, change[k], 1), ca.if_else(over < 0, -_NEVER, _NEVER))
        found = ca.fmin(found, root)
    return found


def _bounded(z: Any, most: Any) -> Any:
    return ca.fmax(0, ca.fmin(z, most))


def _course(heating: Heating, seconds: float, steps: int) -> ca.Function:
    """(x, z, base, direction, most, d, p, limits) -> a better z, by the course of the temperatures and its slope."""
    s = _symbols(heating, ca.SX)
    h, moved, room = seconds / steps, ca.SX.sym("moved", s.x.numel()), ca.SX.sym("room")
    rates, pushed = _rates(heating, s)
    rest = (s.z, s.base, s.direction, s.d, s.p)
    both = ca.Function("both", [s.x, moved, *rest], [rates, ca.jtimes(rates, s.x, moved) + pushed])
    k1, m1 = both(s.x, moved, *rest)
    k2, m2 = both(s.x + h / 2 * k1, moved + h / 2 * m1, *rest)
    k3, m3 = both(s.x + h / 2 * k2, moved + h / 2 * m2, *rest)
    k4, m4 = both(s.x + h * k3, moved + h * m3, *rest)
    following, change = s.x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), moved + h / 6 * (m1 + 2 * m2 + 2 * m3 + m4)
    least = ca.fmin(room, _room(following, change, s.limits))
    one = ca.Function("one", [s.x, moved, room, *rest, s.limits], ca.cse([following, change, least]))
    m = _symbols(heating, ca.MX)
    at, slope, left = m.x, ca.MX(ca.DM.zeros(s.x.numel())), ca.MX(_NEVER)
    for _ in range(steps):
        at, slope, left = one(at, slope, left, m.z, m.base, m.direction, m.d, m.p, m.limits)
    better = _bounded(m.z + left, m.most)
    return ca.Function("course", [m.x, m.z, m.base, m.direction, m.most, m.d, m.p, m.limits], [better])


def _steady(heating: Heating) -> ca.Function:
    """(x, z, base, direction, most, d, p, limits) -> a better z and the temperatures at which that heat settles."""
    s = _symbols(heating, ca.SX)
    rates, pushed = _rates(heating, s)
    ones = ca.SX.ones(s.x.numel())
    both = ca.solve(ca.jacobian(rates, s.x), ca.horzcat(-rates, -pushed, -ones))
    settled, change = s.x + both[:, 0], both[:, 1]
    better = _bounded(s.z + _room(settled, change, s.limits), s.most)
    # Heat goes from hot to cold, so the balance is stable just where steady heat everywhere warms every node;
    # beyond thermal runaway it has a root, too, but a cold one.
    stable = ca.mmin(both[:, 2]) > 0
    at = ca.if_else(stable, settled + change * (better - s.z), s.x)
    results = ca.cse([ca.if_else(stable, better, 0), at])
    return ca.Function("steady", [s.x, s.z, s.base, s.direction, s.most, s.d, s.p, s.limits], results)
