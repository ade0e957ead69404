"""Reference results inside an FMU: an experiment that an importer can repeat, as FMI-LS-REF lays it out.

Source: FMI-LS-REF 1.0.0-alpha.1 for the manifest, MA-HS-Experiments (its draft of 2026) for the experiment.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray

from .component import Component
from .variables import Variable

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
_HOLD = 20.0  # s between jumps of the inputs
_LARGEST = 6.0  # of torques [N·m], currents [A] and speeds: what a joint of a quadruped sees


def experiment(component: Component, step: float, stretches: int = 15) -> dict[str, Any]:
    """What the templates show of the experiment, with its tables of inputs and reference results as CSV texts.

    The results come from SciPy's DOP853 at a tolerance of 1e-12 and the model's expressions, not from the FMU's own
    solver and code.

    Args:
        component: what is exported, without arrays.
        step: longest inner step of the FMU [s].
        stretches: of held inputs.
    """
    inputs, states, p = component.of("input"), component.of("state"), component.starts("parameter")
    rates = ca.Function("rates", [component.x, component.u, component.p], [component.rates])
    rows, solution = _inputs(inputs, stretches), [component.starts("state")]

    def held(_: float, x: FloatArray, u: FloatArray) -> FloatArray:
        return np.asarray(rates(x, u, p).full()).ravel()

    for row in rows:
        end = solve_ivp(held, (0.0, _HOLD), solution[-1], method="DOP853", rtol=1e-12, atol=1e-12, args=(row,))
        solution.append(end.y[:, -1])
    times = _HOLD * np.arange(stretches + 1)
    jumps = np.column_stack([np.repeat(times, 2)[1:-1], np.repeat(rows, 2, axis=0)])
    seen = [row for row, state in enumerate(states) if not state.hidden]
    results = np.column_stack([times, np.array(solution)[:, seen]])
    tolerance = 1e-4  # K that an importer may differ by: a tenth of what a fine sensor resolves
    return {
        "stop": float(times[-1]),
        "hold": _HOLD,
        "step": step,
        "tolerance": tolerance,
        "tables": {
            "inputs.csv": _csv(["time", *(variable.name for variable in inputs)], jumps),
            "results.csv": _csv(["time", *(states[row].name for row in seen)], results),
        },
    }


def _inputs(variables: list[Variable], stretches: int) -> FloatArray:
    """Inputs of each stretch, shape (stretches, inputs), in the FMU's units."""
    seed = 20260101  # any fixed one, so that the same model gives the same bytes
    rng = np.random.default_rng(seed)
    rows = np.round(rng.uniform(-_LARGEST, _LARGEST, (stretches, len(variables))), 3)
    room = 295.0  # K, about which surroundings drift by 2 K
    for column, variable in enumerate(variables):
        if variable.celsius:
            rows[:, column] = np.round(room + 2.0 * np.sin(np.arange(stretches) / 4), 3)
        elif variable.minimum == 0.0:  # a share, such as whether a drive is on
            rows[:, column] = np.round(np.abs(rows[:, column]) / _LARGEST, 3)
        elif (variable.start or 0.0) < 0:  # a mean that is formed from other inputs while it is not connected
            rows[:, column] = variable.start or 0.0
    return rows


def _csv(names: list[str], table: FloatArray) -> str:
    header = ",".join(f'"{name}"' for name in names)
    return "\n".join([header, *(",".join(f"{value:.12g}" for value in row) for row in table)]) + "\n"


def related(entries: Mapping[str, bytes]) -> list[dict[str, str]]:
    """What the manifest says of each file, the model file among them where it is there."""
    kinds = {
        f"{FOLDER}/smoke-test.exp": (
            "application/x-ma-hs-experiments",
            "experiment/smoke-test",
            "Inputs that jump, from the start values",
        ),
        f"{FOLDER}/inputs.csv": ("text/csv", "other", "Inputs of the experiment"),
        f"{FOLDER}/results.csv": ("text/csv", "result", "Temperatures by SciPy's DOP853 at a tolerance of 1e-12"),
        "resources/model.toml": ("application/toml", "model", "Model file of lptn"),
    }
    return [
        {
            "source": path.removeprefix(f"{FOLDER}/") if path.startswith(FOLDER) else f"../../{path}",
            "type": kind,
            "role": role,
            "description": text,
            "checksum": hashlib.sha3_256(entries[path]).hexdigest(),
        }
        for path, (kind, role, text) in kinds.items()
        if path in entries
    ]
