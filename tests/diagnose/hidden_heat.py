"""Three joints in a row as ground truth for hidden heat, by scipy alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray
from lptn.identify.fitting import Fit, fit
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.simulate.bound_run import bind
from tests.builders import LEG, effect, leg, make_run

WINDING, AIR, HOLD = 0.2, 20.0, 60.0  # ohm, degC, s
CAPACITIES = np.array([150.0, 220.0, 300.0])
HIP_THIGH, CALF_THIGH, TO_AIR = 3.0, 2.0, np.array([9.0, 12.0, 6.0])

Heat = Callable[[float], FloatArray]


def nothing(time: float) -> FloatArray:
    """No hidden heat."""
    return np.zeros(3)


def bursts(time: float) -> FloatArray:
    """6 W at the thigh, for five minutes and for two."""
    return np.array([0.0, 6.0 if 1200 <= time < 1500 or 2400 <= time < 2520 else 0.0, 0.0])


def truth_run(seed: int, hidden: Heat, *, length: float = 3600.0, noise: float = 0.1, steps: float = 0.0) -> Run:
    """An hour of random torques and rests, read with noise and in steps of so many kelvin."""
    rng = np.random.default_rng(seed)
    torques = rng.uniform(0.0, 7.0, (3, int(length / HOLD)))
    torques[:, rng.uniform(size=torques.shape[1]) < 0.3] = 0.0
    state, segments = np.full(3, AIR), []
    for number, torque in enumerate(torques.T):
        time = np.arange(number * HOLD, (number + 1) * HOLD + 0.5)

        def rates(t: float, y: FloatArray, copper: FloatArray = WINDING * torque**2) -> FloatArray:
            one, two = (y[0] - y[1]) / HIP_THIGH, (y[1] - y[2]) / CALF_THIGH
            passed = np.array([-one, one - two, two])
            return np.asarray((copper + hidden(t) - (y - AIR) / TO_AIR + passed) / CAPACITIES)

        path = solve_ivp(rates, (time[0], time[-1]), state, t_eval=time, max_step=5.0, rtol=1e-8, atol=1e-8).y
        segments.append(path[:, :-1])
        state = path[:, -1]
    readings = np.hstack(segments)
    readings += noise * rng.standard_normal(readings.shape)
    if steps:
        readings = np.round(readings / steps) * steps
    columns = {"temperature.ambient": np.full(readings.shape[1], AIR)}
    for row, name in enumerate(LEG):
        columns[f"temperature.{name}"] = readings[row]
        columns[f"torque.{name}"] = np.repeat(torques[row], round(HOLD))
    run = make_run(columns, name=f"run{seed}")
    return replace(run, resolution={f"temperature.{name}": steps for name in LEG} if steps else {})


def fitted(*runs: Run) -> Fit:
    """Three joints with copper loss, which know of no hidden heat, fitted to runs."""
    model = Model(leg([effect("copper_loss", "*", resistance=WINDING, torque_constant=1.0)]))
    return fit(model, [bind(model, run) for run in runs])
