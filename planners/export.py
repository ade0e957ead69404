"""The thermal constraint for optimal control that is yours: CasADi functions, and what acados and do-mpc take.

`ThermalConstraint` makes it of a model and its limits. With a program of your own it is `constraint.step` as the
dynamics of the temperatures and `constraint.over` as the inequality; `to_acados` and `to_do_mpc` write both into the
objects of these packages, neither of which is needed here.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.model.model import Model, rk4

from .heating import Request, heating
from .values import Each, checked_by_place


class ThermalConstraint:
    """The thermal constraint of a model at its values: temperatures under torques or currents, and their limits.

    Args:
        model: the model.
        limits: degC, by node or pattern, or one for all nodes.
        request: `"torque"` [N*m] or `"current"` [A]; by default what the model's log columns hold.
        margin: K that the constraint stays below each limit; `TorqueMPC` finds its own from what is not known.

    Attributes:
        joints: names of u.
        conditions: names of d, the model's other inputs.
        unit: of u.
        limits: degC by node.
        x: temperatures [degC], CasADi symbols, the model's nodes first, shape (states,).
        u: torques [N*m] or currents [A] of either sign, constant or RMS over a step, shape (joints,).
        d: conditions, such as `temperature.ambient`, shape (conditions,).
        rates: dx/dt [K/s], an expression of x, u, d.
        over: by how much each limited node is above its limit [K], an expression of x; at most 0 is admissible.

    Raises:
        InputError: an unknown place, a number that can't be used, a model without currents or torques, or one whose
            joints don't heat independently.
    """

    def __init__(self, model: Model, limits: Each, *, request: Request | None = None, margin: float = 0.0) -> None:
        if not 0 <= margin < float("inf"):
            raise InputError(model.network.origin, "margin", f"{margin:g}", "a number from 0 up [K]")
        heat = heating(model, request)
        self.limits = checked_by_place(limits, model.nodes, "limits")
        if not self.limits:
            raise InputError(model.network.origin, "limits", "no limit", "one of a node at least")
        self.joints, self.conditions, self.unit = heat.joints, heat.conditions, heat.unit
        self.x, self.u, self.d = heat.x, ca.SX.sym("u", len(heat.joints)), heat.d
        self.rates = ca.cse(ca.substitute(heat.rates_at(self.u**2), heat.p, ca.DM(model.values)))
        limited = [model.nodes.index(node) for node in self.limits]
        self.over = heat.x[limited] - (np.array(list(self.limits.values())) - margin)

    def rate(self) -> ca.Function:
        """(x, u, d) -> dx/dt [K/s], for integrators and collocation."""
        return ca.Function("rate", [self.x, self.u, self.d], [self.rates], ["x", "u", "d"], ["rate"])

    def excess(self) -> ca.Function:
        """(x) -> kelvins above each limit, in the order of `limits`; at most 0 is admissible."""
        return ca.Function("excess", [self.x], [self.over], ["x"], ["over"])

    def step(self, seconds: float) -> ca.Function:
        """(x, u, d) -> x after so many seconds with u and d held, by RK4 in parts of 5 s at most.

        Raises:
            ValueError: a step that is not positive.
        """
        if not 0 < seconds < float("inf"):
            raise ValueError(f"found a step of {seconds:g} s; expected a positive one")
        rate, x = self.rate(), self.x
        parts = int(np.ceil(seconds / 5.0))  # RK4 is exact to 1e-4 K so on joints of a minute's time constant
        h = seconds / parts
        for _ in range(parts):
            x = rk4(lambda state: rate(state, self.u, self.d), x, h)
        return ca.Function("step", [self.x, self.u, self.d], [x], ["x", "u", "d"], ["next"])


def to_acados(constraint: ThermalConstraint, ocp: Any, conditions: FloatArray, name: str = "thermal") -> None:
    """Write it into an `AcadosOcp`: model, path and end constraint, all of them soft.

    The conditions become acados' parameters. Cost, horizon, start, bounds of u and prices of the slacks (`ocp.cost.zl`
    and so on, one for each limited node) are yours.

    Args:
        constraint: of the model.
        ocp: an `acados_template.AcadosOcp`.
        conditions: values of the conditions to begin with, shape (conditions,).
        name: of the model: the prefix of the code that acados writes.
    """
    count, model = len(constraint.limits), ocp.model
    moved = ca.SX.sym("xdot", constraint.x.shape)
    model.name, model.x, model.u, model.p, model.xdot = name, constraint.x, constraint.u, constraint.d, moved
    model.f_expl_expr, model.f_impl_expr = constraint.rates, moved - constraint.rates
    model.con_h_expr = model.con_h_expr_e = constraint.over
    ocp.parameter_values = np.asarray(conditions, dtype=float)
    bounds, unbounded = ocp.constraints, np.full(count, -1e8)  # which acados takes for no lower bound
    bounds.lh, bounds.uh, bounds.idxsh = unbounded, np.zeros(count), np.arange(count)
    bounds.lh_e, bounds.uh_e, bounds.idxsh_e = unbounded, np.zeros(count), np.arange(count)


def to_do_mpc(constraint: ThermalConstraint, model: Any) -> tuple[str, ...]:
    """Add it to a continuous `do_mpc.model.Model` of SX symbols, beside what is in it already.

    States are called `temperature`, inputs `torque` or `current`, parameters that vary with time `conditions`.

    Args:
        constraint: of the model.
        model: a `do_mpc.model.Model("continuous", symvar_type="SX")` before its `setup`.

    Returns:
        For each limited node the name of an expression, the kelvins above its limit: after the model's `setup` the
        constraint is `mpc.set_nl_cons(name, model.aux[name], 0.0, soft_constraint=True, …)`.
    """
    quantity = "current" if constraint.unit == "A" else "torque"
    x = model.set_variable("_x", "temperature", constraint.x.shape)
    u = model.set_variable("_u", quantity, (len(constraint.joints), 1))
    d = (
        model.set_variable("_tvp", "conditions", (len(constraint.conditions), 1))
        if constraint.conditions
        else ca.SX(0, 1)
    )
    model.set_rhs("temperature", constraint.rate()(x, u, d))
    over, names = constraint.excess()(x), tuple(f"limit_{node}" for node in constraint.limits)
    for number, name in enumerate(names):
        model.set_expression(name, over[number])
    return names
