"""How requested currents or torques heat a model: heat goes with their square, which makes planning convex."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import casadi as ca
import numpy as np

from lptn.basics.errors import InputError
from lptn.basics.places import in_listed_order
from lptn.model.model import Model
from lptn.model.network import EffectInstance

Request = Literal["current", "torque"]
_RANDOM_POINTS, _TOLERANCE = 5, 1e-7  # of the check that heat goes with the square; the tolerance is relative


@dataclass(frozen=True)
class Heating:
    """A model whose controlled inputs are squares of what is requested.

    Args:
        model: the model.
        request: what is asked of a joint.
        joints: places of the controlled inputs, in the network's order.
        conditions: the model's other inputs, in order; they are given, not chosen.
        x: states.
        heat: squares of the requested torques or currents, `(N*m)^2` or `A^2`.
        d: conditions.
        p: parameters.
        rates: d states / dt [K/s].
        gain: currents per unit requested [A], at the states.
    """

    model: Model
    request: Request
    joints: tuple[str, ...]
    conditions: tuple[str, ...]
    x: Any
    heat: Any
    d: Any
    p: Any
    rates: Any
    gain: Any

    @property
    def unit(self) -> str:
        """Of a request."""
        return "A" if self.request == "current" else "N*m"

    def function(self) -> ca.Function:
        """(x, heat, d, p) -> rates at no heat [K/s]; their slope in x at the heat, transposed; what a unit of heat adds
        to the rates, transposed; and the gain. The two in between are sparse."""
        none = ca.substitute(self.rates, self.heat, ca.SX.zeros(self.heat.shape))
        slope = ca.jacobian(self.rates, self.x).T
        controlled = ca.jacobian(self.rates, self.heat).T
        results = ca.cse([ca.densify(none), slope, controlled, ca.densify(self.gain)])
        return ca.Function("lptn_heat", [self.x, self.heat, self.d, self.p], results)

    def rate_function(self) -> ca.Function:
        """(x, heat, d, p) -> rates [K/s]."""
        return self.model.made_once(
            ("heated rates", self.request),
            lambda: ca.Function("heated", [self.x, self.heat, self.d, self.p], [self.rates]),
        )


def requested_by(model: Model) -> Request:
    """What a model's log columns hold: `"current"` where one of them is a current, else `"torque"`."""
    return "current" if any(column.startswith("current.") for column in model.inputs) else "torque"


def heating(model: Model, request: Request) -> Heating:
    """A model seen from its requested torques or currents.

    Where the model's input is the other of the two, the torque constant of the joint's copper loss converts, falling
    with temperature where the model says so ([Chen2017, eq. 2.6]).

    Raises:
        InputError: the model has no such input, or its heat does not go with the square of it.
    """
    made = model.made_once(("heating", request), lambda: _make(model, request))
    return replace(made, model=model)  # its expressions are shared with copies at other values, its values are not


def _make(model: Model, request: Request) -> Heating:
    x, u, p, rates, _ = model.symbols
    effect_instances = {
        _column(instance): instance
        for instance in model.network.effect_instances
        if instance.effect.key == "copper_loss"
    }
    controlled = [column for column in model.inputs if column.partition(".")[0] in ("torque", "current")]
    if not controlled:
        raise InputError(model.network.origin, "effects", "no torque or current that heats a joint", "a copper_loss")
    controlled = in_listed_order(
        controlled, [f"{given}.{place}" for place in model.network.order for given in get_args(Request)]
    )
    joints = [column.partition(".")[2] for column in controlled]
    if len(set(joints)) < len(joints):
        twice = next(joint for joint in joints if joints.count(joint) > 1)
        columns = f"torque.{twice} and current.{twice}"
        raise InputError(model.network.origin, "effects", columns, "one of the two a joint")
    square = ca.SX.sym("heat", len(joints))
    requested = ca.SX.sym("requested", len(joints))
    inputs, gain = [], [ca.SX(1)] * len(joints)
    for column in model.inputs:
        if column in controlled:
            number = controlled.index(column)
            per_ampere = _torque_constant(model, effect_instances.get(column), x, p)
            given = column.partition(".")[0]
            if per_ampere is None and given != request:
                problem = f"no copper_loss, so no torque constant to plan a {request}"
                raise InputError(model.network.origin, column, problem, f'request = "{given}"')
            if request == "torque" and per_ampere is not None:
                gain[number] = 1 / per_ampere
            factor = ca.SX(1) if given == request else per_ampere if given == "torque" else 1 / per_ampere
            inputs.append(requested[number] * factor)
        else:
            inputs.append(u[model.inputs.index(column)])
    seen = ca.substitute(rates, u, ca.vertcat(*inputs))
    others = [u[index] for index, column in enumerate(model.inputs) if column not in controlled]
    conditions = tuple(column for column in model.inputs if column not in controlled)
    d = ca.vertcat(*others) if others else ca.SX(0, 1)
    squared = _in_squares(model, seen, requested, square, [x, d, p])
    return Heating(model, request, tuple(joints), conditions, x, square, d, p, squared, ca.vertcat(*gain))


def _column(instance: EffectInstance) -> str:
    place = instance.declaration.driven_by or instance.ends[0]
    return f"{instance.effect.needed()[0]}.{place}"


def _torque_constant(model: Model, instance: EffectInstance | None, x: Any, p: Any) -> Any:
    """N*m per ampere at the node's temperature, `None` where the model does not know it."""
    if instance is None:
        return None
    constant = p[instance.parameters["torque_constant"]]
    for other in model.network.effect_instances:
        if other.effect.key == "torque_constant_drop" and other.ends == instance.ends:
            warm = x[model.nodes.index(instance.ends[0])] - p[other.parameters["reference"]]
            constant = constant * (1 - p[other.parameters["kappa"]] * warm)
    return constant


def _in_squares(model: Model, rates: Any, requested: Any, square: Any, others: list[Any]) -> Any:
    """The rates as a linear function of squares; the last of `others` are the parameters.

    Raises:
        InputError: they are none.
    """
    zero = ca.SX.zeros(requested.shape)
    none = ca.substitute(rates, requested, zero)
    columns = []
    for number in range(requested.numel()):
        unit = ca.SX.zeros(requested.shape)
        unit[number] = 1
        columns.append(ca.substitute(rates, requested, unit) - none)
    squared = none + ca.mtimes(ca.horzcat(*columns), square)
    check = ca.Function("check", [requested, *others], [rates - ca.substitute(squared, square, requested**2), rates])
    random = np.random.default_rng(0)
    for _ in range(_RANDOM_POINTS):
        point = [random.uniform(-3, 3, requested.numel())]
        point += [random.uniform(20.0, 60.0, other.numel()) for other in others[:-1]] + [model.values]
        difference, size = (np.asarray(value.full()).ravel() for value in check(*point))
        if not np.all(np.abs(difference) <= _TOLERANCE * (1 + np.abs(size))):
            raise InputError(
                model.network.origin, "effects", "heat that does not go with the square of torque or current",
                "copper_loss and stray_load_loss as the only effects of torque and current",
            )  # fmt: skip
    return squared
