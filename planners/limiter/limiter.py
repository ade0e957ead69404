"""The predictive limiter: how much torque each joint may give now, for how long."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from math import inf, isinf
from subprocess import CalledProcessError
from typing import Any

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.model.model import Model

from ..mpc.controller import Values, in_order, requested_by
from ..mpc.heat import Heating, Request, heating
from ..mpc.settings import Each, spread
from ..native import library
from .equations import largest, prepared, steps_for

HORIZONS = (10.0, 60.0, 300.0, inf)
"""Seconds for which a torque is asked; infinite: continuous."""
_UNLIMITED = 1e9  # degC, A


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
        self.heating: Heating = heating(model, requested_by(model) if request is None else request)
        self.joints, self.conditions, self.horizons = self.heating.joints, self.heating.conditions, tuple(horizons)
        bounds = spread(limits, model.nodes, "limits")
        if not bounds:
            raise InputError(model.network.origin, "limits", "none", f"a limit for one of {', '.join(model.nodes)}")
        self.limits = np.array([bounds.get(node, _UNLIMITED) for node in model.nodes])
        most = spread(current_limits, self.joints, "current_limits", endless=True)
        self.most = np.minimum([most.get(joint, inf) for joint in self.joints], _UNLIMITED)
        self.function = self._function()
        self._call = _compiled(self.function)
        self._scales: dict[float, ca.Function] = {}

    def admissible(self, temperatures: Values, load: Values, conditions: Values = ()) -> FloatArray:
        """Admissible torque [N*m] or current [A] of each joint now, shape (joints, horizons).

        Args:
            temperatures: of the nodes [degC], by name or in order; or all states in order.
            load: RMS torque or current of each joint at present, by name or in order.
            conditions: the model's other inputs, by column or in order.

        Returns:
            0 where even no torque does not keep the limits; the current limit where nothing else limits. What follows
            from a NaN is 0.
        """
        arguments = (self._states(temperatures), in_order(load, self.joints, "load", 0.0),
                     in_order(conditions, self.conditions, "conditions", np.nan), self.model.values, self.limits,
                     self.most)  # fmt: skip
        if self._call is not None:
            return self._call(*arguments).reshape(len(self.joints), len(self.horizons))
        return np.asarray(self.function(*arguments)).reshape(len(self.joints), len(self.horizons))

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
            self._scales[seconds] = largest(self.heating, seconds, self._steps(seconds))
        load = in_order(activity, self.joints, "activity", 0.0)
        given = in_order(conditions, self.conditions, "conditions", np.nan)
        x = self._states(temperatures)
        currents = np.abs(load) * np.asarray(self._gain(x, self.model.values)).ravel()
        most = float(((self.most / np.maximum(currents, 1e-12)) ** 2).min())
        ready = prepared(self.heating)(self.model.values)
        z = self._scales[seconds](x, np.zeros(len(load)), load**2, min(most, 1e12), given, ready, self.limits)
        factor = float(z) ** 0.5
        return inf if factor >= 1e6 else factor

    def c_code(self) -> str:
        """`lptn_limiter` as a C function in CasADi's calling convention: see `function`."""
        generator = ca.CodeGenerator("limiter.c", {"with_header": False, "casadi_int": "long long"})
        generator.add(self.function)
        return str(generator.dump())

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
        if isinf(seconds):
            return 0
        typical = [25.0 if name.startswith("temperature") else 0.0 for name in self.conditions]
        return steps_for(self.heating, seconds, np.where(self.limits < _UNLIMITED, self.limits, inf), np.array(typical))

    def _function(self) -> ca.Function:
        """(x, load, d, p, limits, most) -> admissible torques, by joint the horizons."""
        heat, joints = self.heating, len(self.joints)
        names = ("x", "load", "d", "p", "limits", "most")
        sizes = (heat.x.numel(), joints, heat.d.numel(), heat.p.numel(), len(self.limits), joints)
        x, load, d, p, limits, most = (ca.MX.sym(name, size) for name, size in zip(names, sizes, strict=True))
        gain, ready = self._gain(x, p), prepared(heat)(p)
        heats = (most / gain) ** 2
        others = load**2
        base = ca.repmat(others, 1, joints) - ca.diag(others)
        results = []
        for seconds in self.horizons:
            one = largest(heat, seconds, self._steps(seconds))
            z = one.map(joints)(
                ca.repmat(x, 1, joints), base, ca.DM.eye(joints), heats.T, ca.repmat(d, 1, joints),
                ca.repmat(ready, 1, joints), ca.repmat(limits, 1, joints),
            )  # fmt: skip
            some = z > 0  # the root has no slope at 0, but what admits nothing stays so
            results.append(ca.if_else(some, ca.sqrt(ca.if_else(some, z, 1)), 0))
        table = ca.vertcat(*results)
        return ca.Function("lptn_limiter", [x, load, d, p, limits, most], [ca.vec(table)], list(names), ["admissible"])


def _compiled(function: ca.Function) -> _Compiled | None:
    """Machine code where a compiler is there; CasADi's interpreter takes twenty times as long."""
    try:
        return _Compiled(function)
    except (OSError, CalledProcessError):
        return None


class _Compiled:
    """A CasADi function of vectors as machine code, called without copies."""

    def __init__(self, function: ca.Function) -> None:
        generator = ca.CodeGenerator("function.c", {"with_header": False, "casadi_int": "long long"})
        generator.add(function)
        loaded = ctypes.CDLL(str(library({"function.c": generator.dump()}, "function.c")))
        self._function: Any = getattr(loaded, function.name())
        self._arguments = (ctypes.c_void_p * max(1, function.sz_arg()))()
        self._results = (ctypes.c_void_p * max(1, function.sz_res()))()
        self._integers = (ctypes.c_longlong * max(1, function.sz_iw()))()
        self._doubles = (ctypes.c_double * max(1, function.sz_w()))()
        self._size = function.nnz_out(0)

    def __call__(self, *arguments: FloatArray) -> FloatArray:
        kept = [np.ascontiguousarray(each, dtype=float) for each in arguments]
        result = np.empty(self._size)
        for number, each in enumerate(kept):
            self._arguments[number] = each.ctypes.data
        self._results[0] = result.ctypes.data
        self._function(self._arguments, self._results, self._integers, self._doubles, 0)
        return result


__all__ = ["HORIZONS", "Limiter"]
