"""How requested currents or torques heat a model: all that follows from a decided one is decided with it.

A joint's |I|, |torque| and |torque x speed| are expressions of the one amount that is asked of it, so that losses with
any power of it are those of what is admitted, and not of what flows now or was asked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from functools import partial
from typing import Any, Literal

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.places import in_listed_order
from lptn.model.model import Model

from .values import Values, in_order

Request = Literal["current", "torque"]
_SAME: dict[str, Request] = {"current": "current", "current_abs": "current", "torque": "torque", "torque_abs": "torque"}
"""What each of a joint's inputs is: of a constant current RMS and mean magnitude are one, else the mean is less."""
_POWER = "mechanical_power"


class Heating:
    """A model seen from the amounts that are requested of its joints.

    Args:
        model: the model.
        request: what is asked of a joint.
        all_speeds: whether the speeds of all joints are among the conditions.

    Attributes:
        joints: places of the controlled inputs, in the network's order.
        conditions: the model's other inputs, in order; they are given, not chosen. For a joint's mechanical power its
            speed stands here, `velocity.<joint>`, whose magnitude counts.
        decided: inputs of the model that follow from the amounts.
        x: states.
        amount: magnitudes of the requested torques or currents, N*m or A, constant or RMS.
        d: conditions.
        p: parameters.
        inputs: the model's inputs.
        rates: d states / dt [K/s].
        gain: currents per unit requested [A], at the states.
        torque: torques per unit requested [N*m], at the states; NaN where nobody knows.

    Raises:
        InputError: the model has no such input, or the heat of one joint depends on what another gives.
    """

    def __init__(self, model: Model, request: Request, all_speeds: bool = False) -> None:
        self.model, self.request = model, request
        self.x, u, self.p, rates, _ = model.symbols
        parts = {column: column.partition(".")[::2] for column in model.inputs}
        driven = dict.fromkeys(place for what, place in parts.values() if what in _SAME)
        self.joints = joints = tuple(in_listed_order(driven, model.network.order))
        if not joints:
            raise InputError(
                model.network.origin, "effects", "no torque or current that heats a joint", "a copper_loss"
            )
        self.amount = amount = ca.SX.sym("amount", len(joints))
        constants = [_torque_constant(model, joint, self.x, self.p) for joint in joints]
        # A joint without a copper loss is told of by its own input alone.
        nan, one = ca.SX(np.nan), ca.SX(1)
        per_unit: dict[Request, list[Any]] = {
            "torque": [one if request == "torque" else nan if k is None else k for k in constants],
            "current": [one if request == "current" else nan if k is None else 1 / k for k in constants],
        }
        own = {column: number for number, column in enumerate(model.inputs)}
        decided, inputs = [], [u[number] for number in own.values()]
        speeds: dict[str, Any] = {}
        for column, (what, place) in parts.items():
            if place not in joints or (what not in _SAME and what != _POWER):
                continue
            number, given = joints.index(place), _SAME.get(what, "torque")
            if given != request and constants[number] is None:
                problem = f"no copper_loss, so no torque constant to plan a {request}"
                raise InputError(model.network.origin, column, problem, f'request = "{given}"')
            inputs[own[column]] = amount[number] * per_unit[given][number]
            if what == _POWER:
                speed = f"velocity.{place}"
                speeds[speed] = u[own[speed]] if speed in own else ca.SX.sym(speed)
                inputs[own[column]] *= ca.fabs(speeds[speed])
            decided.append(column)
        others = {column: u[number] for column, number in own.items() if column not in decided}
        if all_speeds:
            speeds |= {
                name: ca.SX.sym(name) for joint in joints if (name := f"velocity.{joint}") not in others | speeds
            }
            if unknown := [joint for joint, k in zip(joints, per_unit["torque"], strict=True) if k is nan]:
                problem = f"no copper_loss at {unknown[0]}, so no torque of its current"
                raise InputError(model.network.origin, "power_limit", problem, 'request = "torque"')
        self.conditions = tuple(model.network.columns_in_order(others | speeds))
        self.decided = tuple(decided)
        self.d = ca.vertcat(ca.SX(0, 1), *((others | speeds)[column] for column in self.conditions))
        self.inputs = ca.vertcat(*inputs)
        self.rates = ca.substitute(rates, u, self.inputs)
        gain = [one if k is None else value for k, value in zip(constants, per_unit["current"], strict=True)]
        self.gain, self.torque = ca.vertcat(*gain), ca.vertcat(*per_unit["torque"])
        _check_joints_independent(model, self.rates, amount)

    @property
    def unit(self) -> str:
        """Of a request."""
        return "A" if self.request == "current" else "N*m"

    def conditions_from(self, given: Values, asked: FloatArray) -> FloatArray:
        """Conditions in order, NaN for those left out.

        By name also what is decided may be given: it is passed over, but for a mechanical power without a speed. That
        is taken as the power of what is asked beside it, and tells the speed; 0 where nothing is asked.

        Args:
            given: by column, or in order.
            asked: what the joints are asked for beside it, shape (joints,).

        Raises:
            InputError: an unknown name, or a wrong number of values.
        """
        if isinstance(given, Mapping) and not given.keys().isdisjoint(self.decided):
            kept = {column: value for column, value in given.items() if column not in self.decided}
            powers = [column.partition(".")[2] for column in given.keys() - kept.keys() if column.startswith(_POWER)]
            if unsaid := [joint for joint in powers if f"velocity.{joint}" not in kept]:
                make = lambda: ca.Function("torque", [self.x, self.p], [self.torque])  # noqa: E731
                per_unit = self.model.made_once(("torque per unit", self.request), make)
                at_room = np.asarray(per_unit(np.full(self.x.numel(), 25.0), self.model.values)).ravel()
                torques = dict(zip(self.joints, np.abs(asked) * at_room, strict=True))
                for joint in unsaid:
                    power = abs(given[f"{_POWER}.{joint}"])
                    kept[f"velocity.{joint}"] = power / torques[joint] if torques[joint] else 0.0
            given = kept
        return in_order(given, self.conditions, "conditions", np.nan)

    def function(self) -> ca.Function:
        """(x, heat, d, p) -> rates at no heat [K/s]; their slope in x at the heat, transposed; their slope in the heat
        and what the heat adds, by state and joint, transposed; and the gain. The three in between are sparse.

        `heat` are the squares of the amounts: what goes with the square, as most of it does, is linear in it.
        """

        def make() -> ca.Function:
            heat = ca.SX.sym("heat", len(self.joints))
            root = _root_of(heat)
            none, added = _added(self.rates, self.amount)
            by_amount = ca.jacobian(self.rates, self.amount)
            slope = ca.jacobian(self.rates, self.x)
            by_heat = ca.mtimes(by_amount, ca.diag(1 / (2 * root)))
            expressions = [ca.densify(none), slope.T, by_heat.T, added.T, ca.densify(self.gain)]
            results = ca.cse(ca.substitute(expressions, [self.amount], [root]))
            return ca.Function("lptn_heat", [self.x, heat, self.d, self.p], results)

        return self.model.made_once(("heat and slopes", self.request, self.conditions), make)

    @property
    def in_squares(self) -> bool:
        """Whether all that the joints heat goes with the squares of the amounts."""
        function, size = self.function(), len(self.joints)
        point = np.full(self.x.numel(), 40.0), np.full(self.d.numel(), 40.0)  # degC, and any conditions
        small, large = (
            np.asarray(function(point[0], np.full(size, heat), point[1], self.model.values)[2].full())
            for heat in (1.0, 10.0)
        )
        return bool(np.allclose(small, large, rtol=1e-7, atol=0.0))

    def power_function(self) -> ca.Function:
        """(x, heat, d, p) -> what each joint takes from the supply [W], and its slope in the squares of the amounts.

        That is all that its amount heats, and its mechanical power, as much as if the load never drove it.
        """

        def make() -> ca.Function:
            heat, network, joints = ca.SX.sym("heat", len(self.joints)), self.model.network, range(len(self.joints))
            capacities = ca.vertcat(*(self.p[index] for index in network.capacities.values()))
            _, added = _added(self.rates, self.amount)
            electric = ca.mtimes(capacities.T, added[: capacities.numel(), :]).T
            speeds = ca.vertcat(*(self.d[self.conditions.index(f"velocity.{joint}")] for joint in self.joints))
            power = electric + ca.fabs(self.torque * speeds) * self.amount
            slope = ca.vertcat(*(ca.jacobian(power[j], self.amount[j]) for j in joints)) / (2 * self.amount)
            found = ca.substitute([ca.densify(power), ca.densify(slope)], [self.amount], [_root_of(heat)])
            return ca.Function("lptn_power", [self.x, heat, self.d, self.p], ca.cse(found))

        return self.model.made_once(("power", self.request, self.conditions), make)

    def rate_function(self) -> ca.Function:
        """(x, heat, d, p) -> rates [K/s]; `heat` are the squares of the amounts."""
        heat = ca.SX.sym("heat", len(self.joints))
        return self.model.made_once(
            ("heated rates", self.request, self.conditions),
            lambda: ca.Function("heated", [self.x, heat, self.d, self.p], [self.rates_at(heat)]),
        )

    def rates_at(self, heat: Any) -> Any:
        """The rates at squares of the amounts."""
        return ca.substitute(self.rates, self.amount, _root_of(heat))


def heating(model: Model, request: Request | None = None, speeds: bool = False) -> Heating:
    """A model seen from its requested torques or currents; with `speeds` all joints' are among the conditions.

    By default what the model's log columns hold is requested: currents where one of them is a current, else torques.
    Where the model's input is the other of the two, the torque constant of the joint's copper loss converts, falling
    with temperature where the model says so ([Chen2017, eq. 2.6]).

    Raises:
        InputError: the model has no such input, or the heat of one joint depends on what another gives.
    """
    if request is None:
        quantities = {column.partition(".")[0] for column in model.inputs}
        request = "torque" if {"torque", "torque_abs"} & quantities and "current" not in quantities else "current"
    made = copy(model.made_once(("heating", request, speeds), partial(Heating, model, request, speeds)))
    made.model = model  # its expressions are shared with copies at other values, its values are not
    return made


def _torque_constant(model: Model, joint: str, x: Any, p: Any) -> Any:
    """N*m per ampere of the joint's copper loss at its temperature, `None` where the model does not know it."""
    instances = model.network.effect_instances
    instance = next((i for i in instances if i.effect.key == "copper_loss" and i.driven_by == joint), None)
    if instance is None:
        return None
    constant = p[instance.parameters["torque_constant"]]
    for other in instances:
        if other.effect.key == "torque_constant_drop" and other.ends == instance.ends:
            warm = x[model.nodes.index(instance.ends[0])] - p[other.parameters["reference"]]
            constant = constant * (1 - p[other.parameters["kappa"]] * warm)
    return constant


def _root_of(heat: Any) -> Any:
    """Amounts from their squares; a root has a slope at 0, too, for 1e-6 A or N*m are below what any drive resolves."""
    return ca.sqrt(heat + 1e-6**2)


def _added(rates: Any, amount: Any) -> tuple[Any, Any]:
    """Rates at no amount, and what each joint's amount adds to them, shape (states, joints), as sparse as can be."""
    zero = ca.SX.zeros(amount.shape)
    none = ca.substitute(rates, amount, zero)
    columns = []
    for number in range(amount.numel()):
        alone = ca.SX.zeros(amount.shape)
        alone[number] = amount[number]
        columns.append(ca.substitute(rates, amount, alone) - none)
    return none, ca.project(ca.horzcat(*columns), ca.jacobian(rates, amount).sparsity())


def _check_joints_independent(model: Model, rates: Any, amount: Any) -> None:
    """Refuse rates whose slope in the amount of one joint depends on that of another.

    Raises:
        InputError: the joints together heat otherwise than one by one.
    """
    slopes = ca.densify(ca.jacobian(rates, amount))
    rows, joints = ca.jacobian_sparsity(ca.vec(slopes), amount).get_triplet()
    if any(row // slopes.shape[0] != joint for row, joint in zip(rows, joints, strict=True)):
        raise InputError(
            model.network.origin, "effects", "heat of one joint that depends on the torque of another",
            "effects of torque and current that act at one joint each",
        )  # fmt: skip
