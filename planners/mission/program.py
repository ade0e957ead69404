"""A mission as one nonlinear program for IPOPT: speeds, rests, loads and all temperatures are sought together.

Direct collocation with Radau IIA of order 5, a few elements for each piece of the mission: it is L-stable, so that a
winding of seconds doesn't ask for small steps in an hour's walk. The program isn't convex: it is solved from two starts
and the better answer is kept. Its multipliers say what each limit is worth.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.model.array_function import solver_watch

from .gait import Gait, with_surroundings
from .mission import Mission, Schedule, Timed, limited_later, segments_of, simulate_plan

Goal = Literal["time", "work"]
"""Least time; or the most work within the deadline."""
_IPOPT = {
    "print_level": 0, "sb": "yes", "tol": 1e-9, "max_iter": 250, "max_cpu_time": 60.0, "bound_relax_factor": 0,
    "mu_strategy": "adaptive",  # half the iterations of the monotone one, to the same optimum
    # The program is scaled as it stands; with the scaling of the linear solver the factors fill in: 25 times slower.
    "mumps_permuting_scaling": 0, "mumps_scaling": 0,
}  # fmt: skip
ELEMENTS, DEGREE = 4, 3
TIME, LOAD = 1000.0, 10.0  # s, kg: sizes that make the program's numbers about one
_HASTE = 1e-4  # of plans that do equally much the faster is meant; too little to show in a price
_PRICED = ("ambient", "carry", "deadline")
_GRID = (np.arange(ELEMENTS + 1) / ELEMENTS) ** 1.5
"""Ends of the elements as shares of a segment, nearer at its beginning, where temperatures change fastest."""


@dataclass(frozen=True)
class MissionSolution(Schedule):
    """What IPOPT found: all segments of the program, those of no length too, and further.

    Args:
        success: whether it converged; if not, nothing else means anything.
        status: IPOPT's return status, or that its multipliers grew without bound.
        share: of each activity that is done, 0 to 1.
        prices: what one unit more of a parameter adds to the goal [s]: `limit.FR_calf` and `ambient` per kelvin,
            `carry` per kilogram; the goal is the total time, or the work done. Empty unless it converged.
        raw: IPOPT's primal point, to start from.
    """

    success: bool
    status: str
    share: FloatArray
    prices: dict[str, float]
    raw: FloatArray

    def work(self, mission: Mission) -> float:
        """Seconds of the activities that are done, each counted as long as it takes at its fastest."""
        return float(self.share @ [activity.work for activity in mission.activities])


class MissionProgram:
    """The program of one mission.

    Unknowns are the temperatures at the stages, the pace of each segment (speed, or time where it stays), the load
    and the share done of each activity, and the postures of each segment. The temperatures' limits are bounds of the
    first.

    Args:
        mission: what is asked.
        rests: as of `segments_of`.
    """

    def __init__(self, mission: Mission, rests: Collection[int] | None = None) -> None:
        self.mission, self.segments = mission, segments_of(mission, rests)
        self._states = len(mission.model.states)
        self._stages = ELEMENTS * DEGREE * len(self.segments)  # points in time at which temperatures are sought
        given = [mission.ambient, *mission.start.tolist()]
        self._range = min(given) - 10.0, max(given) + 1000.0
        """Temperatures [degC] beyond which no solution is sought: beyond runaway the formulas have other roots."""
        ends = np.cumsum([0, *(len(segment.posture) for segment in self.segments)])
        self._postures_of = [slice(int(a), int(b)) for a, b in pairwise(ends)]  # each segment, in a row of all
        problem = self._problem(int(ends[-1]))
        self._watch = solver_watch(problem, _no_price)
        options: dict[str, Any] = {"print_time": False, "ipopt": _IPOPT, "iteration_callback": self._watch}
        self._solver = ca.nlpsol("mission", "ipopt", problem, options)

    # --- expressions --------------------------------------------------------------------------

    def _problem(self, postures: int) -> dict[str, Any]:
        """Unknowns x, parameters p, cost f, and g: zero, but for the last two, which are at most zero."""
        mission, segments = self.mission, self.segments
        ambient, carry, deadline = (ca.MX.sym(name) for name in _PRICED)
        start, for_work = ca.MX.sym("start", self._states), ca.MX.sym("for_work")
        pace = ca.MX.sym("pace", len(segments))
        load, share = (ca.MX.sym(name, len(mission.activities)) for name in ("load", "share"))
        posture = ca.MX.sym("posture", postures)
        times, speeds, loads, chosen = [], [], [], []
        for k, segment in enumerate(segments):
            inserted = segment.activity < 0
            done = ca.MX(1) if inserted else share[segment.activity]
            times.append(done * (segment.length / pace[k] if segment.travels else pace[k] * TIME))
            speeds.append(pace[k] if segment.travels else ca.MX(0))
            of = segment.carries if inserted else segment.activity
            loads.append(ca.MX(0) if of < 0 else load[of] * LOAD)
            low, high = np.array(segment.posture).reshape(-1, 2).T
            part = posture[self._postures_of[k]]
            chosen.append(ca.DM(low) + ca.DM(high - low) * part if segment.posture else ca.MX(0, 1))
        time = ca.vertcat(*times)
        rows, count = self._states * DEGREE, ELEMENTS * len(segments)
        stages = ca.MX.sym("stages", rows, count)
        before = ca.horzcat(start, stages[rows - self._states :, :-1])
        gaits = {segment.gait.name: segment.gait for segment in reversed(segments)}
        of_gait = {name: self._inputs_of(gait) for name, gait in gaits.items()}
        drive = zip(segments, speeds, loads, chosen, strict=True)
        inputs = ca.horzcat(*(of_gait[segment.gait.name](v, m, ambient, q) for segment, v, m, q in drive))
        owner = np.repeat(np.arange(len(segments)), ELEMENTS).tolist()
        lengths = ca.horzcat(*[time[k] * part for k in range(len(segments)) for part in np.diff(_GRID)])
        balance = self._element().map(count)(before, stages, inputs[:, owner], lengths)
        sought = [k for k, activity in enumerate(mission.activities) if activity.chooses_load]
        carried = ca.sum1(load[sought]) if sought else carry / LOAD
        total = ca.sum1(time) / TIME
        # Rests that were asked for are no work, but kept where they cost nothing.
        counts = [activity.work or 2 * _HASTE * activity.least_time for activity in mission.activities]
        work = ca.dot(share, ca.DM(counts)) / TIME
        # Of plans equally fast the one with the smaller loads' squares and middling postures is meant.
        tidy = 1e-7 * (ca.sumsqr(load) + ca.sumsqr(posture - 0.5))
        x = ca.vertcat(ca.vec(stages), pace, load, share, posture)
        self._look = ca.Function(
            "look", [x], [time, ca.vertcat(*speeds), ca.vertcat(*loads), share, ca.vertcat(*chosen)]
        )
        return {
            "x": x,
            "p": ca.vertcat(ambient, carry, deadline, start, for_work),
            "f": for_work * (_HASTE * total - work) + (1 - for_work) * total + tidy,
            "g": ca.vertcat(ca.vec(balance), total - deadline / TIME, carry / LOAD - carried),
        }

    def _inputs_of(self, gait: Gait) -> ca.Function:
        """(speed, load, ambient, postures) -> the model's inputs in a gait, shape (inputs,)."""
        v, m, air, q = (ca.SX.sym(*of) for of in (("v",), ("m",), ("air",), ("q", len(gait.postures))))
        u = gait.inputs(v, m, ca.vertsplit(q) if gait.postures else ())
        return ca.Function("gait", [v, m, air, q], [with_surroundings(u, self.mission.model.inputs, v, air)])

    def _element(self) -> ca.Function:
        """(x before, stages, inputs, length) -> how far the stages are from the heat balance."""
        model = self.mission.model
        x, z, h = ca.SX.sym("x", self._states), ca.SX.sym("z", self._states, DEGREE), ca.SX.sym("h")
        u = ca.SX.sym("u", len(model.inputs))
        derivative, _, _ = ca.collocation_coeff(ca.collocation_points(DEGREE, "radau"))
        slopes = ca.mtimes(ca.horzcat(x, z), derivative)
        rates = ca.horzcat(*[model.rhs(z[:, j], u, model.values) for j in range(DEGREE)])
        return ca.Function("element", [x, ca.vec(z), u, h], [ca.vec(slopes - h * rates)])

    # --- solving ------------------------------------------------------------------------------

    def solve(
        self,
        goal: Goal = "time",
        *,
        limits: Mapping[str, float] | None = None,
        deadline: float | None = None,
        near: MissionSolution | None = None,
        **changed: float,
    ) -> MissionSolution:
        """Solve it.

        Args:
            goal: what is made best.
            limits: greatest temperature by node [degC], the mission's by default.
            deadline: greatest total time [s], `None` for none.
            near: a solution to start from, in place of the two usual starts.
            changed: `ambient` [degC] or `carry` [kg], where they differ from the mission's.
        """
        mission = self.mission
        given = {"ambient": mission.ambient, "carry": mission.carry, "deadline": deadline or 1e6} | changed
        p = np.array([*(given[name] for name in _PRICED), *mission.start, float(goal == "work")])
        ceilings = self._ceilings(mission.limits | dict(limits or {}))
        least, most = self._choices(goal)
        lower = np.concatenate([np.full(ceilings.size, self._range[0]), least])
        upper = np.concatenate([ceilings.T.ravel(), most])
        if near is not None:
            return self._solved(near.raw, p, lower, upper, goal)
        # An eager and a cautious start: how far between the least and the greatest of each choice.
        starts = [self._guess(eagerness, ceilings) for eagerness in (0.8, 0.2)]
        solutions = [self._solved(start, p, lower, upper, goal) for start in starts]
        return max(
            solutions,
            key=lambda solution: (solution.success, solution.work(mission) if goal == "work" else -solution.total),
        )

    def peaks(self, solution: MissionSolution) -> dict[str, float]:
        """Greatest temperature of each limited node at the program's stages [degC], once the first rest is over."""
        mission = self.mission
        states = solution.raw[: self._states * self._stages].reshape(-1, self._states).T
        states = np.where(self._ceilings(mission.limits) < self._range[1], states, -np.inf)
        return {node: float(states[mission.model.places.index(node)].max()) for node in mission.limits}

    def _choices(self, goal: Goal = "time") -> tuple[FloatArray, FloatArray]:
        """Least and greatest of what is chosen: paces, loads, shares, postures as shares of their ranges."""
        activities = self.mission.activities
        bounds = [
            activities[segment.activity].speed if segment.travels else (segment.time[0] / TIME, segment.time[1] / TIME)
            for segment in self.segments
        ]
        bounds += [(low / LOAD, high / LOAD) for low, high in (activity.load for activity in activities)]
        bounds += [(0.0 if goal == "work" else 1.0, 1.0)] * len(activities)
        bounds += [(0.0, float(high > low)) for segment in self.segments for low, high in segment.posture]
        return np.array([low for low, _ in bounds]), np.array([high for _, high in bounds])

    def _ceilings(self, limits: dict[str, float]) -> FloatArray:
        """Greatest temperature of each state at each stage [degC], shape (states, stages)."""
        ceilings = np.full((self._states, self._stages), self._range[1])
        later = limited_later(self.mission, self.segments)
        for node, limit in limits.items():
            pieces, until = later.get(node, (0, limit))
            row, first = self.mission.model.places.index(node), max(pieces * ELEMENTS * DEGREE - 1, 0)
            ceilings[row, :first] = min(max(limit, until), self._range[1])
            ceilings[row, first:] = limit
        return ceilings

    def _guess(self, eagerness: float, ceilings: FloatArray) -> FloatArray:
        """A plan between the bounds of its choices, and the temperatures that follow from it as far as they may be."""
        least, most = self._choices()
        mix = np.full(least.size, eagerness)
        mix[: len(self.segments)][[segment.activity < 0 for segment in self.segments]] = 1 - eagerness
        choice = least + mix * (most - least)
        schedule, _ = self._schedule(np.concatenate([np.zeros(ceilings.size), choice]))
        course = simulate_plan(self.mission, schedule)
        inside = np.array(ca.collocation_points(DEGREE, "radau"))
        shares = (_GRID[:-1, None] + np.diff(_GRID)[:, None] * inside).ravel()
        begins = np.concatenate([[0.0], np.cumsum(schedule.time)[:-1]])
        stages = (begins[:, None] + schedule.time[:, None] * shares).ravel()  # s
        states = np.array([np.interp(stages, course.time, row) for row in course.states])
        return np.concatenate([states.clip(self._range[0] + 1, ceilings - 1).T.ravel(), choice])

    def _schedule(self, point: Any) -> tuple[Schedule, FloatArray]:
        """A point of the program's unknowns as a schedule, and the share done of each activity."""
        time, speed, load, share, postures = (value.full().ravel() for value in self._look(point))
        numbers = time.tolist(), speed.tolist(), load.tolist()
        posture = [tuple(postures[own].tolist()) for own in self._postures_of]
        return Schedule([Timed(*row) for row in zip(self.segments, *numbers, posture, strict=True)]), share

    def _solved(
        self, start: FloatArray, p: FloatArray, lower: FloatArray, upper: FloatArray, goal: Goal
    ) -> MissionSolution:
        rows = int(self._solver.size1_out("g"))
        least = np.concatenate([np.zeros(rows - 2), np.full(2, -np.inf)])
        done = self._solver(x0=start, p=p, lbx=lower, ubx=upper, lbg=least, ubg=np.zeros(rows))
        stats = self._solver.stats()
        success, status = bool(stats["success"]), str(stats["return_status"])
        plan, share = self._schedule(done["x"])
        return MissionSolution(
            **vars(plan),
            success=success,
            status="Multipliers_Without_Bound" if status == "User_Requested_Stop" else status,
            share=share,
            prices=self._prices(done, goal) if success else {},
            raw=done["x"].full().ravel(),
        )

    def _prices(self, done: Mapping[str, Any], goal: Goal) -> dict[str, float]:
        """Multipliers in seconds. CasADi's carry the opposite sign of the derivative; those of a failed solve lie."""
        unit = TIME if goal == "work" else -TIME
        ambient, carry, *_ = (unit * done["lam_p"].full().ravel()).tolist()
        size = self._states * self._stages
        ceilings = unit * done["lam_x"].full().ravel()[:size].reshape(-1, self._states).clip(min=0.0)
        by_state, places = ceilings.sum(axis=0), self.mission.model.places
        limits = {f"limit.{node}": float(by_state[places.index(node)]) for node in self.mission.limits}
        return {"ambient": ambient, "carry": carry, **limits}


def _no_price(results: dict[str, Any]) -> bool:
    """Whether multipliers grow without bound: no plan keeps the limits, and each step then takes a minute."""
    # Multiplier of a bound, in `TIME` per unit, that none has: 3000 years for a kelvin. On the way to an optimum they
    # stayed below 1e5.
    most = 1e8
    return float(ca.norm_inf(results["lam_x"])) > most
