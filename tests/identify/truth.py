"""Two coupled nodes as ground truth for fits, by scipy alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray
from lptn.logs.run import Run
from lptn.model.network import LinkDeclaration, Network, NodeDeclaration
from tests.builders import AMBIENT, capacity, effect, make_run, resistance

TRUTH = {
    "capacity.a": 120.0,
    "capacity.b": 260.0,
    "resistance.a~b": 2.5,
    "resistance.ambient~b": 4.0,
}
WINDING, HOLD = 0.2, 100.0  # ohm; s that each torque is held
FIRST = {"capacity.a": 300.0, "capacity.b": 300.0, "resistance.a~b": 5.0, "resistance.ambient~b": 5.0}


def network() -> Network:
    """Copper loss heats a, which heats b, which is cooled; all declared values wrong but for the winding's."""
    copper = effect("copper_loss", "a", resistance=WINDING, torque_constant=1.0)
    return Network(
        "two",
        (NodeDeclaration("a", capacity(300.0)), NodeDeclaration("b", capacity(300.0)), AMBIENT),
        (
            LinkDeclaration(("a", "b"), resistance(5.0)),
            LinkDeclaration(("b", "ambient"), resistance(5.0)),
        ),
        (copper,),
    )


def truth_run(length: float = 1800.0, *, step: float = 1.0, noise: float = 0.1, seed: int = 0) -> Run:
    """A run of the true system under random steps of torque, with white sensor noise."""
    rng = np.random.default_rng(seed)
    torques = rng.uniform(0.0, 14.0, int(length / HOLD) + 1)
    c_a, c_b, r_ab, r_b = TRUTH.values()
    air = 18.0 + 2.0 * seed
    x, segments = np.array([air, air]), []
    for number, torque in enumerate(torques):
        time = np.arange(number * HOLD, min((number + 1) * HOLD, length) + step / 2, step)

        def rates(_t: float, y: FloatArray, heat: float = WINDING * float(torque) ** 2) -> list[float]:
            flow = (y[0] - y[1]) / r_ab
            return [(heat - flow) / c_a, (flow - (y[1] - air) / r_b) / c_b]

        if len(time) < 2:
            break
        path = solve_ivp(rates, (time[0], time[-1]), x, t_eval=time, rtol=1e-9, atol=1e-9).y
        segments.append(path[:, :-1])
        x = path[:, -1]
    states = np.hstack(segments)
    n = states.shape[1]
    readings = states + noise * rng.standard_normal(states.shape)
    columns = {
        "temperature.a": readings[0],
        "temperature.b": readings[1],
        "temperature.ambient": np.full(n, air),
        "torque.a": np.repeat(torques, round(HOLD / step))[:n],
    }
    return make_run(columns, step=step, name=f"run{seed}")


def with_garbage(run: Run, seed: int = 0) -> Run:
    """The same run with a long gap at one node and scattered missing readings."""
    rng = np.random.default_rng(seed)
    columns = {name: values.copy() for name, values in run.columns.items()}
    columns["temperature.a"][200:500] = np.nan
    for name in ("temperature.a", "temperature.b"):
        columns[name][rng.uniform(size=len(run)) < 0.1] = np.nan
    return replace(run, columns=columns)
