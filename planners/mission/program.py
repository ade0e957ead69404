"""A mission as one nonlinear program for IPOPT: speeds, rests, loads and all temperatures are sought together.

Direct collocation with Radau IIA of order 5, a few elements for each piece of the mission: it is L-stable, so that a
winding of seconds doesn't ask for small steps in an hour's walk. The program isn't convex: it is solved from two starts
and the better answer is kept. Its multipliers say what each limit is worth.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray

from .mission import Mission, first_rest, segments_of
from .simulation import simulate_plan

Goal = Literal["time", "work"]
"""Least time; or the most work within the deadline."""
_IPOPT = {
    "print_level": 0, "sb": "yes", "tol": 1e-9, "max_iter": 250, "max_cpu_time": 60.0, "bound_relax_factor": 0,
    "mu_strategy": "adaptive",  # half the iterations of the monotone one, to the same optimum
    # The program is scaled as it stands; with the scaling of the linear solver the factors fill in: 25 times slower.
    "mumps_permuting_scaling": 0, "mumps_scaling": 0,
}  # fmt: skip
_NO_PRICE = 1e8
"""Multiplier of a bound, in `TIME` per unit, that none has: 3000 years for a kelvin. On the way to an optimum they
stayed below 1e5; where no plan keeps the limits they grow without end, and a step of IPOPT then takes a minute."""
ELEMENTS, DEGREE = 4, 3
TIME, LOAD = 1000.0, 10.0  # s, kg: sizes that make the program's numbers about one
_HASTE = 1e-4  # of plans that do equally much the faster is meant; too little to show in a price
PARAMETERS = ("ambient", "carry", "deadline")


class Transcription:
    """The expressions of one mission's program.

    Unknowns are the temperatures at the stages, the pace of each segment (speed, or time where it stays), the load
    and the share done of each activity, and the postures of each segment. The temperatures' limits are bounds of the
    first.

    Args:
        mission: what is asked.
        rests: as of `segments_of`.
    """

    def __init__(self, mission: Mission, rests: Collection[int] | None = None) -> None:
        self.mission, self.segments = mission, segments_of(mission, rests)
        self.states = len(mission.model.states)
        self.stages = ELEMENTS * DEGREE * len(self.segments)
        """Points in time at which the temperatures are sought."""
        self._ambient, self._carry, self._deadline = (ca.MX.sym(name) for name in PARAMETERS)
        self._start, self._for_work = ca.MX.sym("start", self.states), ca.MX.sym("for_work")
        activities = len(mission.activities)
        self._pace = ca.MX.sym("pace", len(self.segments))
        self._loads, self._shares = ca.MX.sym("load", activities), ca.MX.sym("share", activities)
        ends = np.cumsum([0, *(len(segment.posture) for segment in self.segments)])
        self._posture = ca.MX.sym("posture", int(ends[-1]))
        self._of_segment = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        self._path()
        self._write()

    @property
    def choices(self) -> tuple[FloatArray, FloatArray]:
        """Least and greatest of what is chosen: paces, loads, shares, postures as shares of their ranges."""
        activities = self.mission.activities
        bounds = [
            activities[segment.activity].speed if segment.travels else (segment.time[0] / TIME, segment.time[1] / TIME)
            for segment in self.segments
        ]
        bounds += [(low / LOAD, high / LOAD) for low, high in (activity.load for activity in activities)]
        bounds += [(1.0, 1.0)] * len(activities)
        bounds += [(0.0, float(high > low)) for segment in self.segments for low, high in segment.posture]
        return np.array([low for low, _ in bounds]), np.array([high for _, high in bounds])

    @property
    def range(self) -> tuple[float, float]:
        """Temperatures [degC] beyond which no solution is sought: beyond runaway the formulas have other roots."""
        given = [self.mission.ambient, *self.mission.start.tolist()]
        return min(given) - 10.0, max(given) + 1000.0

    def ceilings(self, limits: dict[str, float]) -> FloatArray:
        """Greatest temperature of each state at each stage [degC], shape (states, stages).

        What begins too hot has to be below its limit when the rest that comes first ends.
        """
        mission = self.mission
        ceilings = np.full((self.states, self.stages), self.range[1])
        leading = first_rest(mission, self.segments)
        settled = min(leading + 1, len(self.segments)) * ELEMENTS * DEGREE - 1
        for node, limit in limits.items():
            first = max(leading * ELEMENTS * DEGREE - 1, 0) if node in mission.too_hot else 0
            row = mission.model.places.index(node)
            ceilings[row, first:] = limit
            if node in mission.within_margin:
                ceilings[row, :settled] = max(limit, mission.within_margin[node])
        return ceilings

    def clock(self, time: FloatArray) -> FloatArray:
        """When the stages are [s], shape (stages,), for segments that last so long."""
        inside = np.array(ca.collocation_points(DEGREE, "radau"))
        shares = (_grid()[:-1, None] + np.diff(_grid())[:, None] * inside).ravel()
        begins = np.concatenate([[0.0], np.cumsum(time)[:-1]])
        return np.asarray((begins[:, None] + time[:, None] * shares).ravel())

    # --- expressions --------------------------------------------------------------------------

    def _path(self) -> None:
        """Time, speed and load of each segment."""
        times, speeds, loads = [], [], []
        self._postures: list[Any] = []
        for k, segment in enumerate(self.segments):
            inserted, pace = segment.activity < 0, self._pace[k]
            share = ca.MX(1) if inserted else self._shares[segment.activity]
            times.append(share * (segment.length / pace if segment.travels else pace * TIME))
            speeds.append(pace if segment.travels else ca.MX(0))
            of = segment.carries if inserted else segment.activity
            loads.append(ca.MX(0) if of < 0 else self._loads[of] * LOAD)
            low, high = np.array(segment.posture).reshape(-1, 2).T
            chosen = self._posture[self._of_segment[k]]
            self._postures.append(ca.DM(low) + ca.DM(high - low) * chosen if segment.posture else ca.MX(0, 1))
        self._time, self._speed, self._load = ca.vertcat(*times), ca.vertcat(*speeds), ca.vertcat(*loads)

    def _inputs(self) -> Any:
        """The model's inputs in each segment, shape (inputs, segments)."""
        functions: dict[str, Any] = {}
        columns = []
        for k, segment in enumerate(self.segments):
            gait = segment.gait
            if gait.name not in functions:
                v, m, air, q = (ca.SX.sym(*of) for of in (("v",), ("m",), ("air",), ("q", len(gait.postures))))
                u = gait.inputs(v, m, ca.vertsplit(q) if gait.postures else ())
                for row, column in enumerate(self.mission.model.inputs):
                    u[row] = air if column.startswith("temperature.") else v if column == "speed.base" else u[row]
                functions[gait.name] = ca.Function("gait", [v, m, air, q], [u])
            columns.append(functions[gait.name](self._speed[k], self._load[k], self._ambient, self._postures[k]))
        return ca.horzcat(*columns)

    def _element(self) -> Any:
        """(x before, stages, inputs, length) -> how far the stages are from the heat balance."""
        model = self.mission.model
        x, z, h = ca.SX.sym("x", self.states), ca.SX.sym("z", self.states, DEGREE), ca.SX.sym("h")
        u = ca.SX.sym("u", len(model.inputs))
        derivative, _, _ = ca.collocation_coeff(ca.collocation_points(DEGREE, "radau"))
        slopes = ca.mtimes(ca.horzcat(x, z), derivative)
        rates = ca.horzcat(*[model.rhs(z[:, j], u, model.values) for j in range(DEGREE)])
        return ca.Function("element", [x, ca.vec(z), u, h], [ca.vec(slopes - h * rates)])

    def _write(self) -> None:
        rows, count = self.states * DEGREE, ELEMENTS * len(self.segments)
        stages = ca.MX.sym("stages", rows, count)
        before = ca.horzcat(self._start, stages[rows - self.states :, :-1])
        owner = np.repeat(np.arange(len(self.segments)), ELEMENTS).tolist()
        lengths = ca.horzcat(*[self._time[k] * part for k in range(len(self.segments)) for part in np.diff(_grid())])
        balance = self._element().map(count)(before, stages, self._inputs()[:, owner], lengths)
        sought = [k for k, activity in enumerate(self.mission.activities) if activity.chooses_load]
        carried = ca.sum1(self._loads[sought]) if sought else self._carry / LOAD
        total = ca.sum1(self._time) / TIME
        # Rests that were asked for are no work, but kept where they cost nothing.
        counts = [activity.work or 2 * _HASTE * activity.least_time for activity in self.mission.activities]
        work = ca.dot(self._shares, ca.DM(counts)) / TIME
        # Of plans equally fast the one with the smaller loads' squares and middling postures is meant.
        tidy = 1e-7 * (ca.sumsqr(self._loads) + ca.sumsqr(self._posture - 0.5))
        cost = self._for_work * (_HASTE * total - work) + (1 - self._for_work) * total + tidy
        self.w = ca.vertcat(ca.vec(stages), self._pace, self._loads, self._shares, self._posture)
        self.p = ca.vertcat(self._ambient, self._carry, self._deadline, self._start, self._for_work)
        self.f = cost
        self.g = ca.vertcat(ca.vec(balance), total - self._deadline / TIME, self._carry / LOAD - carried)
        """Zero, but for the last two, which are at most zero."""
        chosen = [self._time, self._speed, self._load, self._shares, ca.vertcat(*self._postures)]
        self.look = ca.Function("look", [self.w], chosen)

    def by_segment(self, postures: FloatArray) -> list[tuple[float, ...]]:
        """Postures of all segments in one row, cut into those of each."""
        return [tuple(postures[where].tolist()) for where in self._of_segment]


def _grid() -> FloatArray:
    """Ends of the elements as shares of a segment, nearer at its beginning, where temperatures change fastest."""
    return np.asarray((np.arange(ELEMENTS + 1) / ELEMENTS) ** 1.5)


@dataclass(frozen=True)
class MissionSolution:
    """What IPOPT found.

    Args:
        success: whether it converged; if not, nothing else means anything.
        status: IPOPT's return status, or that its multipliers grew without bound.
        time: of each segment [s].
        speed: in each segment [m/s].
        load: in each segment [kg].
        share: of each activity that is done, 0 to 1.
        posture: in each segment, a value for each posture of its gait.
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
    posture: list[tuple[float, ...]]
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


class _Watch(ca.Callback):
    """Ends a solve whose multipliers grow without bound: no plan keeps the limits."""

    def __init__(self, problem: Mapping[str, Any]) -> None:
        super().__init__()
        rows, columns, given = (problem[key].numel() for key in ("g", "x", "p"))
        self._sizes = {"x": columns, "f": 1, "g": rows, "lam_x": columns, "lam_g": rows, "lam_p": given}
        self.construct("watch", {})

    def get_n_in(self) -> int:
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, number: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self._sizes[ca.nlpsol_out(number)])

    def eval(self, arguments: Sequence[Any]) -> list[int]:
        """1 to stop."""
        prices = arguments[list(self._sizes).index("lam_x")]
        return [int(float(ca.norm_inf(prices)) > _NO_PRICE)]


class MissionProgram:
    """The program of one mission.

    Args:
        mission: what is asked.
        rests: as of `segments_of`.
    """

    def __init__(self, mission: Mission, rests: Collection[int] | None = None) -> None:
        self.mission = mission
        self._written = written = Transcription(mission, rests)
        self.segments = written.segments
        problem = {"x": written.w, "p": written.p, "f": written.f, "g": written.g}
        self._watch = _Watch(problem)
        options: dict[str, Any] = {"print_time": False, "ipopt": _IPOPT, "iteration_callback": self._watch}
        self._solver = ca.nlpsol("mission", "ipopt", problem, options)

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
        mission, written = self.mission, self._written
        given = {"ambient": mission.ambient, "carry": mission.carry, "deadline": deadline or 1e6} | changed
        p = np.array([*(given[name] for name in PARAMETERS), *mission.start, float(goal == "work")])
        ceilings = written.ceilings(mission.limits | dict(limits or {}))
        lower, upper = self._bounds(goal, ceilings)
        if near is not None:
            return self._solve(near.raw, p, lower, upper, goal)
        # An eager and a cautious start: how far between the least and the greatest of each choice.
        solutions = [self._solve(self._guess(eagerness, ceilings), p, lower, upper, goal) for eagerness in (0.8, 0.2)]
        return max(
            solutions,
            key=lambda solution: (solution.success, solution.work(mission) if goal == "work" else -solution.total),
        )

    def peaks(self, solution: MissionSolution) -> dict[str, float]:
        """Greatest temperature of each limited node at the program's stages [degC], once the first rest is over."""
        written, mission = self._written, self.mission
        states = solution.raw[: written.states * written.stages].reshape(-1, written.states).T
        states = np.where(written.ceilings(mission.limits) < written.range[1], states, -np.inf)
        return {node: float(states[mission.model.places.index(node)].max()) for node in mission.limits}

    def _bounds(self, goal: Goal, ceilings: FloatArray) -> tuple[FloatArray, FloatArray]:
        least, most = self._written.choices
        if goal == "work":
            first = len(self._written.segments) + len(self.mission.activities)
            least[first : first + len(self.mission.activities)] = 0.0
        floor = np.full(ceilings.size, self._written.range[0])
        return np.concatenate([floor, least]), np.concatenate([ceilings.T.ravel(), most])

    def _guess(self, eagerness: float, ceilings: FloatArray) -> FloatArray:
        """A plan between the bounds of its choices, and the temperatures that follow from it as far as they may be."""
        written = self._written
        least, most = written.choices
        mix = np.full(least.size, eagerness)
        mix[: len(self.segments)][[segment.activity < 0 for segment in self.segments]] = 1 - eagerness
        choice = least + mix * (most - least)
        time, speed, load, _, posture = self._choices(np.concatenate([np.zeros(ceilings.size), choice]))
        course = simulate_plan(self.mission, self.segments, time, speed, load, written.by_segment(posture))
        clock = written.clock(time)
        states = np.array([np.interp(clock, course.time, row) for row in course.states])
        return np.concatenate([states.clip(written.range[0] + 1, ceilings - 1).T.ravel(), choice])

    def _choices(self, point: Any) -> list[FloatArray]:
        return [value.full().ravel() for value in self._written.look(point)]

    def _solve(
        self, start: FloatArray, p: FloatArray, lower: FloatArray, upper: FloatArray, goal: Goal
    ) -> MissionSolution:
        rows = int(self._solver.size1_out("g"))
        least = np.concatenate([np.zeros(rows - 2), np.full(2, -np.inf)])
        done = self._solver(x0=start, p=p, lbx=lower, ubx=upper, lbg=least, ubg=np.zeros(rows))
        stats = self._solver.stats()
        status = str(stats["return_status"])
        time, speed, load, share, posture = self._choices(done["x"])
        return MissionSolution(
            bool(stats["success"]),
            "Multipliers_Without_Bound" if status == "User_Requested_Stop" else status,
            time,
            speed,
            load,
            share,
            self._written.by_segment(posture),
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
        by_state = ceilings.sum(axis=0)
        places = self.mission.model.places
        return prices | {f"limit.{node}": float(by_state[places.index(node)]) for node in self.mission.limits}
