"""A winding 4 mm thick on an iron core, cooled on one side: its model file, and its truth by finite volumes."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from scipy.linalg import expm

from lptn.basics.arrays import FloatArray
from lptn.model.file import parse_model
from lptn.model.model import Model

THICK, AREA, CONDUCTIVITY, DENSITY, SPECIFIC_HEAT = 0.004, 0.0110, 0.7, 6000.0, 500.0  # m, m², W/(m K), kg/m³, J/(kg K)
CONTACT, IRON, TO_AIR, AIR = 0.05, 150.0, 1.2, 25.0  # K/W, J/K, K/W, degC
RESISTANCE = 0.186  # Ω
SLICES = 100

TEXT = f"""\
[model]
name = "slot"
ambient = "temperature.ambient"

[nodes.winding.element]
kind = "cuboid"
length_x = {THICK}
length_y = 0.1
length_z = {AREA / 0.1}
conductivity = {CONDUCTIVITY}
density = {DENSITY}
specific_heat = {SPECIFIC_HEAT}
hottest = true

[nodes.iron]
capacity = {IRON}

[[links]]
between = ["winding.x0", "iron"]
resistance = {CONTACT}

[[links]]
between = ["iron", "ambient"]
resistance = {TO_AIR}

[[effects]]
kind = "copper_loss"
at = "winding"
input = "current"
resistance = {RESISTANCE}
torque_constant = 0.1
"""


@cache
def model() -> Model:
    """The model under test: two nodes and the winding's hottest point."""
    return Model(parse_model(TEXT, Path("slot.toml")).network)


def truth(currents: FloatArray, step: float, start: float = AIR) -> dict[str, FloatArray]:
    """Mean, hottest slice and iron [degC] at the ends of steps of `step` [s], all at `start` before the first."""
    n = SLICES
    conductances = np.full(n, CONDUCTIVITY * AREA * n / THICK)  # from each slice to the next; the last to the iron
    conductances[-1] = 1 / (1 / (2 * conductances[0]) + CONTACT)
    capacity = np.append(np.full(n, DENSITY * SPECIFIC_HEAT * AREA * THICK / n), IRON)
    flows = np.zeros((n + 1, n + 1))
    for k, g in enumerate(conductances):
        flows[[k, k + 1], [k, k + 1]] -= g
        flows[[k, k + 1], [k + 1, k]] += g
    flows[n, n] -= 1 / TO_AIR
    a = flows / capacity[:, None]
    moved = expm(step * a)
    by_air = -np.linalg.solve(a, np.eye(n + 1)[n] * AIR / TO_AIR / capacity)
    by_watt = -np.linalg.solve(a, np.append(np.full(n, 1.0 / n), 0.0) / capacity)
    T, results = np.full(n + 1, start), []
    for current in currents:
        settled = by_air + RESISTANCE * current**2 * by_watt
        T = settled + moved @ (T - settled)
        results.append([T[:n].mean(), T[:n].max(), T[n]])
    mean, hottest, iron = np.array(results).T
    return {"winding": mean, "winding.hottest": hottest, "iron": iron}
