"""What a thermal controller answers: admitted torques or currents, the plan behind them, and what was given up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lptn.basics.arrays import FloatArray

if TYPE_CHECKING:
    from .controller import TorqueMPC

_MEANING = {
    2: "a temperature is missing or absurd; the model's prediction stands in for it",
    4: "a request is no number; taken as zero",
    64: "a condition is no number; the last good one, else zero, stands in for it",
    8: "a request lies above the current limit and is cut to it",
    32: "the solver did not converge; one constant scale for all joints instead",
}
_SHORTCUT, _TOO_HOT, _FALLBACK = 1, 16, 32


@dataclass(frozen=True)
class Plan:
    """One step's answer.

    Args:
        joints: names, in order.
        admitted: for the coming period, in the request's unit, shape (joints,).
        currents: planned for each stage, in the request's unit, shape (stages, joints).
        temperatures: expected at the n + 1 ends of the stages [degC], shape (states, stages + 1).
        slack: by how much each limit less its margin is passed at the end of each stage [K], shape (stages, limited
            nodes).
        cost: 0 for all that was requested, 1 for nothing.
        iterations: of the solver, 0 where the full request stays cool.
        status: bits of `c/lptn_mpc.h`.
        limited: names of the limited nodes.
        error: change of the last linearisation [K].
    """

    joints: tuple[str, ...]
    admitted: FloatArray
    currents: FloatArray
    temperatures: FloatArray
    slack: FloatArray
    cost: float
    iterations: int
    status: int
    limited: tuple[str, ...]
    error: float

    @classmethod
    def of(cls, controller: TorqueMPC, result: Any) -> Plan:
        """A copy of what the C step wrote."""
        return cls(
            controller.joints,
            np.array(result.admitted),
            np.array(result.plan),
            np.array(result.x).T,
            np.array(result.slack),
            result.cost,
            result.iterations,
            result.status,
            tuple(controller.settings.limits),
            result.error,
        )

    @property
    def full(self) -> bool:
        """Whether the full request stays cool, so that nothing had to be solved."""
        return bool(self.status & _SHORTCUT)

    @property
    def converged(self) -> bool:
        """Whether this is the optimum, not a fallback."""
        return not self.status & _FALLBACK

    @property
    def given_up(self) -> tuple[str, ...]:
        """In words, what could not be had; empty where all limits and inputs were good."""
        said = [text for bit, text in _MEANING.items() if self.status & bit]
        if self.status & _TOO_HOT:
            worst = self.slack.max(axis=0)
            where = ", ".join(
                f"{node} by {over:.2g} K" for node, over in zip(self.limited, worst, strict=True) if over > 1e-3
            )
            said.insert(0, f"a limit less its margin can't be met: {where}")
        return tuple(said)
