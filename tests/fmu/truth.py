"""Input sequences for FMUs, and the temperatures that a solver of its own gives for them."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from lptn.basics.arrays import FloatArray
from lptn.model.model import Model

ZERO = 273.15
ROOM = 25.0


def steps(model: Model, n: int, seed: int = 0) -> FloatArray:
    """Inputs that jump at each step, shape (n, inputs), in the model's units; the ambient moves too."""
    rng = np.random.default_rng(seed)
    rows = rng.uniform(-5.0, 5.0, (n, len(model.inputs)))
    for column, name in enumerate(model.inputs):
        if name.startswith("temperature."):
            rows[:, column] = rng.uniform(10.0, 30.0, n)
        if name.startswith(("powered", "power.")):
            rows[:, column] = rng.uniform(0.0, 1.0, n)
        if name.startswith(("velocity_rms.", "torque_abs.", "mechanical_power.", "fan.", "irradiance.")):
            rows[:, column] = np.abs(rows[:, column])  # means of magnitudes; negative ones are not connected
    return rows


def in_kelvin(model: Model, inputs: FloatArray) -> FloatArray:
    """The same inputs as the FMU takes them."""
    shift = [ZERO if name.startswith("temperature.") else 0.0 for name in model.inputs]
    return np.asarray(inputs + np.array(shift))


def solved(
    model: Model, inputs: FloatArray, step: float, ramps: bool = False, values: FloatArray | None = None
) -> FloatArray:
    """States after each step [degC], shape (n, states), by SciPy at 1e-12, restarted at every jump.

    The rates are the model's; that these are right is tested without it elsewhere.
    """
    rhs, p = model.rhs, model.values if values is None else values
    state, states = np.full(len(model.states), ROOM), []
    for k, row in enumerate(inputs):
        slope = (inputs[min(k + 1, len(inputs) - 1)] - row) / step if ramps else np.zeros_like(row)

        def rates(t: float, x: FloatArray, row: FloatArray = row, slope: FloatArray = slope) -> FloatArray:
            return np.asarray(rhs(x, row + slope * t, p).full().ravel())

        state = solve_ivp(rates, (0.0, step), state, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        states.append(state)
    return np.array(states)


def leg_by_hand(inputs: FloatArray, step: float) -> FloatArray:
    """The preset `leg` written out: temperatures after each step [degC], shape (n, 3); in: ambient, three torques."""
    capacity, to_air, between = 300.0, 10.0, 3.0
    state, states = np.full(3, ROOM), []
    for ambient, *torques in inputs:
        heat = 0.15 * (np.array(torques) / 0.84357) ** 2

        def rates(_: float, x: FloatArray, ambient: float = ambient, heat: FloatArray = heat) -> FloatArray:
            run_filter = np.array([x[1] - x[0], x[0] - 2 * x[1] + x[2], x[1] - x[2]]) / between
            return np.asarray((heat + (ambient - x) / to_air + run_filter) / capacity)

        state = solve_ivp(rates, (0.0, step), state, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        states.append(state)
    return np.array(states)


def bead_and_motor_by_hand(inputs: FloatArray, step: float) -> FloatArray:
    """The network `stiff` written out and solved by the matrix exponential, shape (n, 2). Inputs: ambient, torque."""
    rates = np.array([[-1 / 4 / 0.005, 1 / 4 / 0.005], [1 / 4 / 200, -(1 / 4 + 1 / 3) / 200]])
    state, states = np.full(2, ROOM), []
    for ambient, torque in inputs:
        heat = np.array([0.0, (0.15 * (torque / 0.84) ** 2 + ambient / 3) / 200])
        rest = np.linalg.solve(rates, -heat)
        state = rest + expm(rates * step) @ (state - rest)
        states.append(state)
    return np.array(states)
