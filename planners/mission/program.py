"""The program of a mission handed to IPOPT: two starts, the better answer, and what each limit is worth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray

from .activities import Mission
from .replay import replay
from .transcription import PARAMETERS, TIME, Transcription

Goal = Literal["time", "work"]
"""Least time; or the most work within the deadline."""
_NO_DEADLINE = 1e6  # s
_STARTS = (0.8, 0.2)  # eager and cautious: how far between the least and the greatest of each choice
_IPOPT = {
    "print_level": 0, "sb": "yes", "tol": 1e-9, "max_iter": 250, "max_cpu_time": 60.0, "bound_relax_factor": 0,
    # The program is scaled as it stands; with the scaling of the linear solver the factors fill in: 25 times slower.
    "mumps_permuting_scaling": 0, "mumps_scaling": 0,
}  # fmt: skip
_OPTIONS: dict[str, Any] = {"print_time": False, "ipopt": _IPOPT}


@dataclass(frozen=True)
class Solution:
    """What IPOPT found.

    Args:
        success: whether it converged; if not, nothing else means anything.
        status: its word.
        time: of each segment [s].
        speed: in each segment [m/s].
        load: in each segment [kg].
        share: of each activity that is done, 0 to 1.
        prices: what one unit more of a parameter adds to the goal [s]: `limit.FR_calf` and `ambient` per kelvin,
            `carry` per kilogram; the goal is the total time, or the work done. Empty unless it converged.
        raw: IPOPT's primal point, to start from.
        iterations: that it took.
    """

    success: bool
    status: str
    time: FloatArray
    speed: FloatArray
    load: FloatArray
    share: FloatArray
    prices: dict[str, float]
    raw: FloatArray
    iterations: int

    @property
    def total(self) -> float:
        """Time of the whole [s]."""
        return float(self.time.sum())

    def work(self, mission: Mission) -> float:
        """Seconds of the activities that are done, each counted as long as it takes at its fastest."""
        return float(self.share @ [activity.work for activity in mission.activities])


class Program:
    """The program of one mission.

    Args:
        mission: what is asked.
    """

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self._written = written = Transcription(mission)
        self.segments = written.segments
        problem = {"x": written.w, "p": written.p, "f": written.f, "g": written.g}
        self._solver = ca.nlpsol("mission", "ipopt", problem, _OPTIONS)

    def solve(
        self,
        goal: Goal = "time",
        *,
        limits: Mapping[str, float] | None = None,
        deadline: float | None = None,
        near: Solution | None = None,
        **changed: float,
    ) -> Solution:
        """Solve it.

        Args:
            goal: what is made best.
            limits: greatest temperature by node [degC], the mission's by default.
            deadline: greatest total time [s], `None` for none.
            near: a solution to start from, in place of the two usual starts.
            changed: `ambient` [degC] or `carry` [kg], where they differ from the mission's.
        """
        mission, written = self.mission, self._written
        given = {"ambient": mission.ambient, "carry": mission.carry, "deadline": deadline or _NO_DEADLINE} | changed
        p = np.array([*(given[name] for name in PARAMETERS), *mission.start, float(goal == "work")])
        ceilings = written.ceilings(mission.limits | dict(limits or {}))
        lower, upper = self._bounds(goal, ceilings)
        if near is not None:
            return self._solve(near.raw, p, lower, upper, goal)
        found = [self._solve(self._guess(eagerness, ceilings), p, lower, upper, goal) for eagerness in _STARTS]
        return max(found, key=lambda each: (each.success, each.work(mission) if goal == "work" else -each.total))

    def peaks(self, found: Solution) -> dict[str, float]:
        """Greatest temperature of each limited node at the program's stages [degC], once the first rest is over."""
        written, mission = self._written, self.mission
        states = found.raw[: written.states * written.stages].reshape(-1, written.states).T
        states = np.where(written.ceilings(mission.limits) < written.range[1], states, -np.inf)
        return {node: float(states[mission.model.nodes.index(node)].max()) for node in mission.limits}

    def _bounds(self, goal: Goal, ceilings: FloatArray) -> tuple[FloatArray, FloatArray]:
        least, most = self._written.choices
        if goal == "work":
            least[-len(self.mission.activities) :] = 0.0
        floor = np.full(ceilings.size, self._written.range[0])
        return np.concatenate([floor, least]), np.concatenate([ceilings.T.ravel(), most])

    def _guess(self, eagerness: float, ceilings: FloatArray) -> FloatArray:
        """A plan between the bounds of its choices, and the temperatures that follow from it as far as they may be."""
        written = self._written
        least, most = written.choices
        mix = np.full(least.size, eagerness)
        mix[: len(self.segments)][[segment.activity < 0 for segment in self.segments]] = 1 - eagerness
        choice = least + mix * (most - least)
        time, speed, load, _ = self._seen(np.concatenate([np.zeros(ceilings.size), choice]))
        course = replay(self.mission, self.segments, time, speed, load)
        clock = written.clock(time)
        states = np.array([np.interp(clock, course.time, row) for row in course.states])
        return np.concatenate([states.clip(written.range[0] + 1, ceilings - 1).T.ravel(), choice])

    def _seen(self, point: Any) -> list[FloatArray]:
        return [each.full().ravel() for each in self._written.look(point)]

    def _solve(self, start: FloatArray, p: FloatArray, lower: FloatArray, upper: FloatArray, goal: Goal) -> Solution:
        rows = int(self._solver.size1_out("g"))
        least = np.concatenate([np.zeros(rows - 2), np.full(2, -np.inf)])
        done = self._solver(x0=start, p=p, lbx=lower, ubx=upper, lbg=least, ubg=np.zeros(rows))
        stats = self._solver.stats()
        time, speed, load, share = self._seen(done["x"])
        return Solution(
            bool(stats["success"]),
            str(stats["return_status"]),
            time,
            speed,
            load,
            share,
            self._prices(done, goal) if stats["success"] else {},
            done["x"].full().ravel(),
            int(stats["iter_count"]),
        )

    def _prices(self, done: Mapping[str, Any], goal: Goal) -> dict[str, float]:
        """Multipliers in seconds. CasADi's carry the opposite sign of the derivative; those of a failed solve lie."""
        unit = TIME if goal == "work" else -TIME
        slope = unit * done["lam_p"].full().ravel()
        prices = dict(zip(PARAMETERS, slope.tolist(), strict=False))
        prices.pop("deadline")
        size = self._written.states * self._written.stages
        ceilings = unit * done["lam_x"].full().ravel()[:size].reshape(-1, self._written.states).clip(min=0.0)
        each = ceilings.sum(axis=0)
        nodes = self.mission.model.nodes
        return prices | {f"limit.{node}": float(each[nodes.index(node)]) for node in self.mission.limits}
