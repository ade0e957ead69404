"""One node a joint, as MuJoCo's `dcmotor` has it: its attributes from a network, and the error that this costs."""

from __future__ import annotations

from types import ModuleType
from typing import NamedTuple

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.model.model import Model

AIR = 25.0  # degC, a room's
RISE = 60.0  # K, what robots' motors are usually allowed
HOUR, STEP = 3600.0, 20.0  # s
SLOWEST = 1e-8  # 1/s, by which a network settles in three years
_STANDING = {"temperature": AIR, "powered": 1.0}  # what is not zero in a robot that stands still and bears no load


class Motor(NamedTuple):
    r"""A joint's motor in the network, and as MuJoCo has it.

    .. math:: C \dot T = (\tau / K)^2 R_w [1 + \alpha (T - 25 °C)] - (T - T_0) / R

    Attributes:
        joint: its name.
        column: number of the input that is its torque.
        state: number of the state that its winding's heat warms most.
        constant: K [N*m/A].
        winding: R_w [ohm], by which a squared ampere of `constant` heats in air of 25 degC.
        alpha: 1/K.
        resistance: R [K/W].
        capacity: C [J/K].
        idle: T_0, at which the winding settles in air of 25 degC while the robot stands without load [degC].
        rises: of all states where a watt in the winding has settled [K/W].
    """

    joint: str
    column: int
    state: int
    constant: float
    winding: float
    alpha: float
    resistance: float
    capacity: float
    idle: float
    rises: FloatArray

    def after(self, start: float, torque: FloatArray, seconds: float) -> FloatArray:
        """Its temperature [degC], begun at `start`, after so many seconds of constant torques [N*m], of any shape."""
        watts = (torque / self.constant) ** 2 * self.winding
        rate = (1 / self.resistance - self.alpha * watts) / self.capacity
        settled = self.idle + watts * (1 + self.alpha * (self.idle - AIR)) / (rate * self.capacity)
        return np.asarray(settled + (start - settled) * np.exp(-rate * seconds))


def motors(model: Model) -> list[Motor]:
    r"""The joints' motors as one node each.

    Where all nodes are half `RISE` above the air, the network is taken for linear, with rates A x + b q. A watt in a
    winding warms it by R there, with the mean delay RC. [Elmore1948]

    .. math:: R = -(A^{-1} b)_i, \qquad R^2 C = (A^{-2} b)_i

    Args:
        model: at the values to take.

    Raises:
        InputError: no copper loss by torque, or heat that has no way out.
    """
    x, u, p, rates, _ = model.symbols
    air, standing = np.full(len(model.states), AIR), _standing(model)
    warm = air + RISE / 2
    slopes = model.state_jacobian(warm, standing, model.values).full()
    if np.linalg.eigvals(slopes).real.max() > -SLOWEST:
        raise InputError(model.network.origin, "links", "heat without a way out", "links to the air")
    idle = warm - np.linalg.solve(slopes, model.rhs(warm, standing, model.values).full().ravel())
    found = []
    for instance in model.network.effect_instances:
        kind, always = instance.effect, not instance.declaration.run
        if kind.key != "copper_loss" or "torque" not in kind.needed() or not always:
            continue
        column = model.inputs.index(f"torque.{instance.driven_by}")
        by_square = [
            ca.jacobian(ca.jacobian(of, u[column]), u[column]) / 2
            for of in (model.balance.flows[instance.label], rates)
        ]
        terms = ca.Function("terms", [x, u, p], [*by_square, ca.jacobian(by_square[0], x)])
        watts, warming, risen = (term.full().ravel() for term in terms(air, standing, model.values))
        rises = -np.linalg.solve(slopes, warming / watts)
        delays = -np.linalg.solve(slopes, rises)
        state = int(warming.argmax())
        constant = float(model.values[instance.parameters["torque_constant"]])
        found.append(
            Motor(
                joint=instance.driven_by,
                column=column,
                state=state,
                constant=constant,
                winding=float(watts[0]) * constant**2,
                alpha=float(risen[state] / watts[0]),
                resistance=float(rises[state]),
                capacity=float(delays[state] / rises[state] ** 2),
                idle=float(idle[state]),
                rises=rises,
            )
        )
    if not found:
        raise InputError(model.network.origin, "effects", "no copper loss by torque", "one for each motor of MuJoCo's")
    return found


def errors(found: list[Motor], model: Model, heat: ModuleType) -> FloatArray:
    """The largest errors of one node in an hour of constant torques, one node less network [K], shape (2, motors).

    The first row is of each joint's torque alone, the second of all at once, with the same heat in each winding. The
    hottest winding would settle `RISE` above the air, were the network linear.

    Args:
        found: the motors.
        model: their network.
        heat: its functions for NumPy.
    """
    states, columns = [motor.state for motor in found], [motor.column for motor in found]
    left = np.array([max(AIR + RISE - motor.idle, 0.0) for motor in found])
    together = np.sum([motor.rises[states] for motor in found], axis=0)
    alone = np.diag(left / [motor.resistance for motor in found])
    watts = np.vstack([alone, np.full(len(found), (left / together).min())])
    torques = np.sqrt(watts / [motor.winding for motor in found]) * [motor.constant for motor in found]
    inputs = np.tile(_standing(model), (len(torques), 1))
    inputs[:, columns] = torques
    params = np.tile(heat.VALUES, (len(torques), 1))
    state, worst = heat.initial(params, AIR), np.zeros_like(torques)
    for time in np.arange(STEP, HOUR + STEP, STEP):
        state = heat.step(state, inputs, params, STEP)
        nodes = [motor.after(AIR, torque, time) for motor, torque in zip(found, torques.T, strict=True)]
        error = np.transpose(nodes) - state.temperature[:, states]
        worst = np.where(np.abs(error) > np.abs(worst), error, worst)
    return np.array([worst.diagonal(), worst[-1]])


def _standing(model: Model) -> FloatArray:
    return np.array([_STANDING.get(column.partition(".")[0], 0.0) for column in model.inputs])
