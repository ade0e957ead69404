"""The temperatures along a task as unknowns of the program, held together by the model's heat balance.

Direct collocation with Radau IIA of order 5. It is L-stable, so that a long hold needs no small steps, and it takes
the runaway of a winding in its stride, since the states are found together with the design.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from lptn.arrays import FloatArray

from .plant import Plant
from .program import Program

_DEGREE = 3
_HOLD_ELEMENTS, _GRADING = 16, 1.6  # shorter ones at the beginning, where a hold changes fastest
_COLD, _HOT = 5.0, 1000.0  # K below and above the air: beyond runaway the steady state's formula turns negative
_WARM = 20.0  # K above the air, to start from


@dataclass(frozen=True)
class Course:
    """States at the ends of the elements, torque in each, and the ends' times as shares of the duration."""

    states: list[Any]
    torques: list[Any]
    share: FloatArray

    @property
    def ends(self) -> list[tuple[Any, Any]]:
        """State and torque at the end of each element."""
        return list(zip(self.states[1:], self.torques, strict=True))


def transcribe(program: Program, plant: Plant, torque: Any, duration: Any) -> Course:
    """Add a task's states and heat balance to a program.

    Args:
        program: gains variables and equalities.
        plant: rates and states.
        torque: peak torque [N·m], an expression.
        duration: of the hold or the cycle [s], an expression.
    """
    task = plant.option.study.task
    shape = np.ones(_HOLD_ELEMENTS) if task.hold else np.tile(task.shape, task.cycles or 1)
    elements, n = len(shape), len(plant.states)
    share = (np.arange(elements + 1) / elements) ** (_GRADING if task.hold else 1.0) * (task.cycles or 1)
    low, high = min(task.ambient, task.start) - _COLD, max(task.ambient, task.start) + _HOT

    def state(name: str) -> Any:
        return ca.vertcat(*[program.variable(f"{name}.{i}", task.ambient + _WARM, low, high) for i in range(n)])

    derivative, _, _ = ca.collocation_coeff(ca.collocation_points(_DEGREE, "radau"))
    start = plant.parameters.add("start", task.start, "degC")
    path = [state("x0") if task.cycles is None else ca.repmat(start, n, 1)]
    torques = [torque * float(part) for part in shape]
    for k, drive in enumerate(torques):
        stages = [state(f"x{k + 1}s{j}") for j in range(_DEGREE)]
        h = duration * float(share[k + 1] - share[k])
        for j in range(_DEGREE):
            slope = ca.mtimes(ca.horzcat(path[-1], *stages), derivative[:, j])
            program.constrain(slope - h * plant.rates(stages[j], drive), "heat balance", equal=True)
        path.append(stages[-1])
    if task.cycles is None:
        program.constrain(path[-1] - path[0], "heat balance", equal=True)
    return Course(path, torques, share)
