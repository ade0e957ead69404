"""The predictive limiter: how much torque each joint may give now, for how long.

A joint's torque is the largest constant one that, beside those of the others, keeps every limited node below its limit
until a horizon. The temperatures' course under torques `base + z direction` is followed in steps of RK4 together with
its exact slope in z; Newton's method takes the least root of all nodes at all steps. It works on z to the power with
which the heat goes there, between 1 for |torque| and 2 for its square, so that the course is nearly linear in it. For
an infinite horizon it is the steady state instead. The number of operations is fixed, so that the same function can run
as C on a robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, inf, isinf
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.bounds import Bound
from lptn.basics.files import write_folder
from lptn.model.model import Model, rk4

from ..compiled import c_code, c_files, compiled_function
from ..heating import Heating, Request, heating
from ..values import Each, Values, checked_by_place, in_order, limits_of

HORIZONS = (10.0, 60.0, 300.0, inf)
"""Seconds for which a torque is asked; infinite: continuous."""
_UNLIMITED = 1e9  # degC, A
_LARGEST_SCALE = 1e6  # a factor on the load above which nothing limits it
_ROUNDING = 1e-9  # K; of a course of thousands of sums
_STEPS = Bound(1000, "steps")  # of RK4 in a horizon, each machine code of its own that takes 5 ms to compile
_NEVER = 1e30  # K or a torque: a limit that is never met
_RISES = 1e-12  # K per unit of torque; less is none


class Limiter:
    """Admissible torques (or currents) of each joint, and the largest scale of an activity, from temperatures now.

    The admissible torque of a joint for a time is the largest constant RMS value with which no limited node
    passes its limit until then, the other joints going on at their present load. Continuous: with which every
    limited node settles below its limit. Newton's method on RK4 courses of the model, with exact slopes; a fixed
    number of operations.

    Args:
        model: the model, at the values to use.
        limits: degC, by node or pattern, or one for all nodes.
        request: `"torque"` [N*m] or `"current"` [A]; by default what the model's log columns hold.
        current_limits: of the joints [A].
        horizons: seconds, infinite for continuous.

    Raises:
        InputError: an unknown place, or a model without torques or currents.
        ValueError: a horizon that is not positive.
    """

    def __init__(
        self,
        model: Model,
        limits: Each,
        *,
        request: Request | None = None,
        current_limits: Each = inf,
        horizons: Sequence[float] = HORIZONS,
    ) -> None:
        if not horizons or not all(seconds > 0 for seconds in horizons):
            raise ValueError(f"horizons: found {list(horizons)}; expected positive seconds")
        self.model = model
        self.heating = heating(model, request)
        self.joints, self.conditions, self.horizons = self.heating.joints, self.heating.conditions, tuple(horizons)
        bounds = limits_of(limits, model)
        self.limits = np.array([bounds.get(place, _UNLIMITED) for place in model.places])
        most = checked_by_place(current_limits, self.joints, "current_limits", infinite=True)
        self.most = np.minimum([most.get(joint, inf) for joint in self.joints], _UNLIMITED)
        self.function = self._function()
        self._call = compiled_function(self.function)
        self._scales: dict[float, ca.Function] = {}

    def admissible(self, temperatures: Values, load: Values, conditions: Values = ()) -> FloatArray:
        """Admissible torque [N*m] or current [A] of each joint now, shape (joints, horizons).

        Args:
            temperatures: of the nodes [degC], by name or in order; or all states in order.
            load: RMS torque or current of each joint at present, by name or in order.
            conditions: the model's other inputs, by column or in order. What follows from the torques, such as
                |current|, is decided with them and not looked at; a mechanical power tells the speed at `load`.

        Returns:
            0 where even no torque does not keep the limits; where nothing else limits, the current limit, or
            infinity. What follows from a NaN is 0. Every value was tried on the course: it is never above the
            largest that keeps the limits (by RK4), and in the cases tried at most 1e-8 of it below.
        """
        now = in_order(load, self.joints, "load", 0.0)
        arguments = (self._states(temperatures), now, self.heating.conditions_from(conditions, now),
                     self.model.values, self.limits, self.most)  # fmt: skip
        return self._call(*arguments).reshape(len(self.joints), len(self.horizons))

    def largest_scale(self, temperatures: Values, activity: Values, seconds: float, conditions: Values = ()) -> float:
        """The largest constant factor on all joints' torques with which an activity can go on for a time.

        Args:
            temperatures: as for `admissible`.
            activity: RMS torque or current of each joint.
            seconds: for how long; infinite: for ever.
            conditions: the model's other inputs.

        Returns:
            Factor, 0 where even standing still gets too hot; infinite where nothing limits it.
        """
        if seconds not in self._scales:
            self._scales[seconds] = _largest(self.heating, seconds, self._steps(seconds))
        load = np.abs(in_order(activity, self.joints, "activity", 0.0))
        given = self.heating.conditions_from(conditions, load)
        x = self._states(temperatures)
        currents = load * np.asarray(self._gain(x, self.model.values)).ravel()
        most = min(float((self.most / np.maximum(currents, 1e-12)).min()), _LARGEST_SCALE)
        ready = _prepared(self.heating)(self.model.values)
        factor = float(self._scales[seconds](x, np.zeros(len(load)), load, most, given, ready, self.limits))
        return inf if factor >= _LARGEST_SCALE else factor

    def emit(self, folder: Path, x: FloatArray, load: FloatArray, conditions: FloatArray) -> list[Path]:
        """Write it as C files for a robot into a folder, made where it is missing; the arrays are its example.

        Returns:
            The files, in the order in which a person reads them.

        Raises:
            InputError: the folder can't be written.
        """
        function, heat = self.function, self.heating
        names = [f"temperature.{state} [degC]" for state in self.model.states]
        names += [f"{heat.request}.{joint} [{heat.unit}]" for joint in self.joints] + list(self.conditions)
        lasting = ", ".join("ever" if isinf(seconds) else f"{seconds:g} s" for seconds in self.horizons)
        sizes = {
            "NX": len(x), "NU": len(load), "ND": len(conditions), "HORIZONS": len(self.horizons),
            "ARGUMENTS": function.sz_arg(), "RESULTS": function.sz_res(), "INTEGERS": max(1, function.sz_iw()),
            "DOUBLES": max(1, function.sz_w()),
        }  # fmt: skip
        numbers = {"parameters": self.model.values, "limits": self.limits, "most": self.most}
        return write_folder(folder, {
            **c_files("limiter", ("main.c", "admissible.h", "admissible.c")),
            "limiter_sizes.h": "\n".join([
                f"/* Sizes of one model's limiter: admissible {heat.request} [{heat.unit}] for {lasting}. */",
                *(f"#define LPTN_{name} {value}" for name, value in sizes.items()), "",
            ]),
            "limiter_numbers.h": "\n".join([
                "/* The model's parameters; limits of its places [degC] and of the joints' currents [A]. */",
                *(f"static const double {name}[] = {{{', '.join(map(repr, values.tolist()))}}};"
                  for name, values in numbers.items()), "",
            ]),
            "limiter.inc": c_code("limiter.c", function),
            "names.txt": "\n".join([*names, ""]),
            "example.txt": " ".join(f"{value:.17g}" for value in [*x, *load, *conditions]) + "\n",
        })  # fmt: skip

    def _states(self, temperatures: Values) -> FloatArray:
        if not isinstance(temperatures, dict) and len(temperatures) == len(self.model.states):
            return np.asarray(temperatures, dtype=float)
        nodes = in_order(temperatures, self.model.nodes, "temperatures", np.nan)
        return np.asarray(nodes[np.array(self.model.owners)])

    @property
    def _gain(self) -> ca.Function:
        heat = self.heating
        return ca.Function("gain", [heat.x, heat.p], [heat.gain])

    def _steps(self, seconds: float) -> int:
        """How many RK4 steps a horizon needs, from the fastest rate with every node at its limit; 0 for no end."""
        if isinf(seconds):
            return 0
        heat, model = self.heating, self.model
        typical = np.array([25.0 if name.startswith("temperature") else 0.0 for name in self.conditions])
        hot = np.where(self.limits < _UNLIMITED, self.limits, 60.0)[np.array(model.owners)]  # degC
        slope = np.asarray(heat.function()(hot, np.zeros(len(self.joints)), typical, model.values)[1].full())
        fastest = float(np.abs(slope).sum(axis=0).max())
        steps = max(3, ceil(seconds * fastest))  # at most one of the fastest time constant each
        _STEPS.check(steps, model.network.origin, f"horizon {seconds:g} s, fastest time constant {1 / fastest:.2g} s")
        return steps

    def _function(self) -> ca.Function:
        """(x, load, d, p, limits, most) -> admissible torques, by joint the horizons."""
        heat, joints = self.heating, len(self.joints)
        names = ("x", "load", "d", "p", "limits", "most")
        sizes = (heat.x.numel(), joints, heat.d.numel(), heat.p.numel(), len(self.limits), joints)
        x, load, d, p, limits, most = (ca.MX.sym(name, size) for name, size in zip(names, sizes, strict=True))
        gain, ready = self._gain(x, p), _prepared(heat)(p)
        mosts, others = most / gain, ca.fabs(load)
        base = ca.repmat(others, 1, joints) - ca.diag(others)
        results = []
        for seconds in self.horizons:
            one = _largest(heat, seconds, self._steps(seconds))
            z = one.map(joints)(
                ca.repmat(x, 1, joints), base, ca.DM.eye(joints), mosts.T, ca.repmat(d, 1, joints),
                ca.repmat(ready, 1, joints), ca.repmat(limits, 1, joints),
            )  # fmt: skip
            results.append(z)
        table = ca.vertcat(*results)
        return ca.Function("lptn_limiter", [x, load, d, p, limits, most], [ca.vec(table)], list(names), ["admissible"])


# --- the largest torque ---------------------------------------------------------------------------


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


def _prepared(heating: Heating) -> ca.Function:
    """p -> p with reciprocals of what is divided by (capacitances, resistances): divisions take most of the time."""
    p = ca.SX(heating.p)
    for index in _divisors(heating):
        p[index] = 1 / p[index]
    return ca.Function("prepared", [heating.p], [p])


def _largest(heating: Heating, seconds: float, steps: int) -> ca.Function:
    """(x, base, direction, most, d, p, limits) -> the largest z up to `most` with amounts base + z direction.

    p are `prepared` parameters.

    All nodes stay below their limits (degC, by node) at the end of every RK4 step until `seconds`; for an infinite
    horizon, in the steady state. Each iteration takes the least root of all temperatures, each linear in a power of z.
    """
    s = _symbols(heating, ca.MX)
    z, most = _steady_root(heating, s) if isinf(seconds) else _root(heating, seconds, steps, s)
    # What is not limited at the heat above which the model says nothing is limited by nothing.
    z = ca.if_else(ca.logic_and(z >= most, most < s.most), inf, z)
    # C's minimum passes over what is no number; a sum does not.
    sound = ca.fabs(ca.sum1(s.x) + ca.sum1(s.base) + ca.sum1(s.d)) < _NEVER
    return ca.Function("largest", [s.x, s.base, s.direction, s.most, s.d, s.p, s.limits], [ca.if_else(sound, z, 0)])


def _root(heating: Heating, seconds: float, steps: int, s: _Symbols, iterations: int = 4) -> tuple[Any, Any]:
    """The largest z that was tried and keeps the limits, and the most that was considered.

    The hottest excess over a limit is convex in z where losses grow with it and with temperature, so Newton's method
    comes to the root from above, on the unsafe side, and a chord from below. All are tried, and only what was seen to
    keep the limits is an answer, whatever the shape. Each iteration squares the error.
    """
    rest = (s.base, s.direction, s.d, s.p, s.limits)
    course, excess, heats = (
        _course(heating, seconds, steps),
        _course(heating, seconds, steps, slopes=False),
        _heats(heating),
    )
    z = before = _start(heats, seconds, s)
    step = most = high = s.most
    low = ca.MX(0)
    for number in range(iterations):
        over, room, slope = course(s.x, z, *rest)
        power = heats(s.x, z, *rest[:-1])[1]
        if not number:
            most = high = _molten(z, slope, power, s.most)
        fits = over <= _ROUNDING
        low, high = ca.if_else(fits, ca.fmax(low, z), low), ca.if_else(fits, high, ca.fmin(high, z))
        better = _moved(z, room, power, most)
        # A step from where the course overflows, or past what was tried before, is none. Then it is the geometric
        # mean of the least that was too much and the most that was not, at least a sixteenth of it.
        good = ca.logic_and(over < _NEVER, ca.logic_and(better >= low, better <= high))
        better = ca.if_else(good, better, ca.sqrt(ca.fmax(low, high / 16) * high))
        z, step, before = better, ca.fabs(better - z), step
    # Newton's error falls with the square of its step: twice what the next one would be is below the root.
    below = ca.fmax(0, z - 2 * step * ca.fmin(1, step / ca.fmax(before, _RISES)))
    over, over_below = excess(s.x, z, *rest), excess(s.x, below, *rest)
    chord = below + (z - below) * over_below / ca.fmin(over_below - over, -_RISES)
    for tried, excess_there in ((below, over_below), (chord, excess(s.x, chord, *rest)), (z, over)):
        low = ca.if_else(excess_there <= _ROUNDING, ca.fmax(low, tried), low)
    return low, most


def _steady_root(heating: Heating, s: _Symbols, iterations: int = 9) -> tuple[Any, Any]:
    """Likewise for the steady state: what the last iteration still changed is taken off, for its error is less.

    But for 0.5 % at most: near thermal runaway iterations jump.
    """
    settle, heats = _steady(heating), _heats(heating)
    z, at, most = _start(heats, 300.0, s), s.x, s.most  # s, in which a joint about settles
    before = z
    for number in range(iterations):
        before = z
        power = heats(s.x, z, s.base, s.direction, s.d, s.p)[1]
        given = (at, z, power, s.base, s.direction)
        if not number:
            most = _molten(z, settle(*given, s.most, s.d, s.p, s.limits)[2], power, s.most)
        z, at, _ = settle(*given, most, s.d, s.p, s.limits)
    # What still falls by a third finds no steady state below the limits: the others alone are too much.
    return ca.if_else(z > 0.7 * before, z - ca.fmin(ca.fabs(z - before), 5e-3 * z), 0), most


def _heats(heating: Heating) -> ca.Function:
    """(x, z, base, direction, d, p) -> how fast the heat that z adds warms all nodes together [K/s], and the power of z
    with which it goes there."""
    s = _symbols(heating, ca.SX)
    rates, _ = _rates(heating, s)
    heat = ca.sum1((rates - ca.substitute(rates, s.z, 0))[: len(heating.model.nodes)])
    some = heat > 0
    power = ca.if_else(some, s.z * ca.jacobian(heat, s.z) / ca.if_else(some, heat, 1), 2)
    results = ca.cse([heat, ca.fmax(0.5, ca.fmin(power, 4.0))])  # no heat goes with less, or with more
    return ca.Function("heats", [s.x, s.z, s.base, s.direction, s.d, s.p], results)


def _start(heats: ca.Function, seconds: float, s: _Symbols) -> Any:
    """The z whose heat would take the node next to its limit there in the time, if nothing flowed away."""
    room = ca.fmax(ca.mmin(s.limits - s.x[: s.limits.numel()]), 0.01)  # K
    z = ca.MX(1)
    for _ in range(3):
        heat, power = heats(s.x, z, s.base, s.direction, s.d, s.p)
        z = z * (room / seconds / ca.fmax(heat, _RISES)) ** (1 / power)
    return ca.fmin(z, s.most)


def _molten(z: Any, slope: Any, power: Any, most: Any) -> Any:
    """The z above which the model says nothing: it would warm a node by 1000 K, and copper melts at 1085 degC.

    A node's rise goes with the power, at z with the slope.
    """
    return ca.fmin(most, z * (1000.0 * power / ca.fmax(slope * z, _RISES)) ** (1 / power))


def _moved(z: Any, room: Any, power: Any, most: Any) -> Any:
    """Newton's step on the power of z, from the step on z; never to 0, from where none leads away."""
    share = ca.fmax(1 + power * room / z, 1e-12)
    return ca.fmin(z * share ** (1 / power), most)


def _divisors(heating: Heating) -> list[int]:
    network = heating.model.network
    return sorted({*network.capacities.values(), *(link.resistance for link in network.resistors)})


def _symbols(heating: Heating, kind: Any) -> _Symbols:
    joints, states = len(heating.joints), heating.x.numel()
    sizes = (1, joints, joints, 1, states, heating.d.numel(), heating.p.numel(), len(heating.model.places))
    return _Symbols(*(kind.sym(name, size) for name, size in zip(_Symbols._fields, sizes, strict=True)))


def _rates(heating: Heating, s: _Symbols) -> tuple[Any, Any]:
    """Rates at amounts base + z direction, and their slope in z alone."""
    p = ca.SX(s.p)
    for index in _divisors(heating):
        p[index] = 1 / s.p[index]
    before, after = ca.vertcat(heating.x, heating.d, heating.p), ca.vertcat(s.x, s.d, p)
    rates = ca.substitute(heating.rates, before, after)
    pushed = ca.jtimes(rates, heating.amount, s.direction)
    amount = s.base + s.z * s.direction
    return ca.substitute(rates, heating.amount, amount), ca.substitute(pushed, heating.amount, amount)


def _room(x: Any, change: Any, limits: Any) -> Any:
    """The least change of z that takes a node to its limit; a node too hot whatever z leaves no room at all."""
    least = ca.SX(_NEVER)
    for k in range(limits.numel()):
        over, rises = limits[k] - x[k], change[k] > _RISES
        root = ca.if_else(rises, over / ca.if_else(rises, change[k], 1), ca.if_else(over < 0, -_NEVER, _NEVER))
        least = ca.fmin(least, root)
    return least


def _course(heating: Heating, seconds: float, steps: int, *, slopes: bool = True) -> ca.Function:
    """(x, z, base, direction, d, p, limits) -> by how much the hottest node at its hottest passes its limit [K];
    with slopes also Newton's change of z, and the rise of the hottest node by a unit of z at the end."""
    s = _symbols(heating, ca.SX)
    states, room, over = s.x.numel(), ca.SX.sym("room"), ca.SX.sym("over")
    moved = ca.SX.sym("moved", states)
    rates, pushed = _rates(heating, s)
    rest = (s.z, s.base, s.direction, s.d, s.p)
    faster = ca.jtimes(rates, s.x, moved) + pushed if slopes else ca.SX.zeros(states)
    both = ca.Function("both", [s.x, moved, *rest], [rates, faster])

    def rate(together: Any) -> Any:
        return ca.vertcat(*both(*ca.vertsplit(together, states), *rest))

    following, change = ca.vertsplit(rk4(rate, ca.vertcat(s.x, moved), seconds / steps), states)
    hottest = ca.mmax(ca.vertcat(over, following[: s.limits.numel()] - s.limits))
    least = ca.fmin(room, _room(following, change, s.limits)) if slopes else room
    results = ca.cse([following, change, least, hottest])
    one = ca.Function("one", [s.x, moved, room, over, *rest, s.limits], results)
    m = _symbols(heating, ca.MX)
    at, slope, left, worst = m.x, ca.MX(ca.DM.zeros(states)), ca.MX(_NEVER), ca.MX(-_NEVER)
    for _ in range(steps):
        at, slope, left, worst = one(at, slope, left, worst, m.z, m.base, m.direction, m.d, m.p, m.limits)
    # C's maximum passes over what is no number; a sum does not.
    worst = ca.if_else(ca.fabs(ca.sum1(at)) < _NEVER, worst, _NEVER)
    results = [worst, left, ca.mmax(slope)] if slopes else [worst]
    return ca.Function("course", [m.x, m.z, m.base, m.direction, m.d, m.p, m.limits], results)


def _steady(heating: Heating) -> ca.Function:
    """(x, z, power, base, direction, most, d, p, limits) -> a better z, the temperatures at which that settles, and the
    rise of the hottest node by a unit of z."""
    s, n = _symbols(heating, ca.SX), ca.SX.sym("power")
    rates, pushed = _rates(heating, s)
    ones = ca.SX.ones(s.x.numel())
    both = ca.solve(ca.jacobian(rates, s.x), ca.horzcat(-rates, -pushed, -ones))
    settled, change = s.x + both[:, 0], both[:, 1]
    better = _moved(s.z, _room(settled, change, s.limits), n, s.most)
    # Heat goes from hot to cold, so the balance is stable just where steady heat everywhere warms every node;
    # beyond thermal runaway it has a root, too, but a cold one.
    stable = ca.mmin(both[:, 2]) > 0
    at = ca.if_else(stable, settled + change * s.z / n * ((better / s.z) ** n - 1), s.x)
    results = ca.cse([ca.if_else(stable, better, s.z / 2), at, ca.mmax(change)])
    return ca.Function("steady", [s.x, s.z, n, s.base, s.direction, s.most, s.d, s.p, s.limits], results)
