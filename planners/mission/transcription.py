"""A mission written as one nonlinear program: speeds, rests, loads and all temperatures are sought together.

Direct collocation with Radau IIA of order 5, a few elements for each piece of the mission: it is L-stable, so that a
winding of seconds doesn't ask for small steps in an hour's walk.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray

from .activities import Mission, segments_of

ELEMENTS, DEGREE, _GRADING = 4, 3, 1.5  # the temperatures change fastest when a piece begins
TIME, LOAD = 1000.0, 10.0  # s, kg: sizes that make the program's numbers about one
_TIDY = 1e-7  # of plans equally fast the one with the smaller loads' squares is meant
_HASTE = 1e-4  # of plans that do equally much the faster is meant; too little to show in a price
_COLD, _HOT = 10.0, 1000.0  # K below and above what is given: beyond runaway the formulas have other roots
PARAMETERS = ("ambient", "carry", "deadline")


class Transcription:
    """The expressions of one mission's program.

    Unknowns are the temperatures at the stages, the pace of each segment (speed, or time where it stays), the load
    and the share done of each activity. The temperatures' limits are bounds of the first.

    Args:
        mission: what is asked.
    """

    def __init__(self, mission: Mission) -> None:
        self.mission, self.segments = mission, segments_of(mission)
        self.states = len(mission.model.states)
        self.stages = ELEMENTS * DEGREE * len(self.segments)
        """Points in time at which the temperatures are sought."""
        self._ambient, self._carry, self._deadline = (ca.MX.sym(name) for name in PARAMETERS)
        self._start, self._for_work = ca.MX.sym("start", self.states), ca.MX.sym("for_work")
        activities = len(mission.activities)
        self._pace = ca.MX.sym("pace", len(self.segments))
        self._loads, self._shares = ca.MX.sym("load", activities), ca.MX.sym("share", activities)
        self._path()
        self._write()

    @property
    def choices(self) -> tuple[FloatArray, FloatArray]:
        """Least and greatest of what is chosen: paces, loads, shares; shape (segments + 2 activities,)."""
        activities = self.mission.activities
        bounds = [
            activities[each.activity].speed if each.travels else (each.time[0] / TIME, each.time[1] / TIME)
            for each in self.segments
        ]
        bounds += [(low / LOAD, high / LOAD) for low, high in (activity.load for activity in activities)]
        bounds += [(1.0, 1.0)] * len(activities)
        return np.array([low for low, _ in bounds]), np.array([high for _, high in bounds])

    @property
    def range(self) -> tuple[float, float]:
        """Temperatures [degC] beyond which nothing is looked for."""
        given = [self.mission.ambient, *self.mission.start.tolist()]
        return min(given) - _COLD, max(given) + _HOT

    def ceilings(self, limits: dict[str, float]) -> FloatArray:
        """Greatest temperature of each state at each stage [degC], shape (states, stages).

        What begins too hot has to be below its limit when the rest that comes first ends.
        """
        mission = self.mission
        found = np.full((self.states, self.stages), self.range[1])
        leading = next((k for k, each in enumerate(self.segments) if each.gait is not mission.rest), len(self.segments))
        for node, limit in limits.items():
            first = max(leading * ELEMENTS * DEGREE - 1, 0) if node in mission.too_hot else 0
            found[mission.model.nodes.index(node), first:] = limit
        return found

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
        for k, segment in enumerate(self.segments):
            inserted, pace = segment.activity < 0, self._pace[k]
            share = ca.MX(1) if inserted else self._shares[segment.activity]
            times.append(share * (segment.length / pace if segment.travels else pace * TIME))
            speeds.append(pace if segment.travels else ca.MX(0))
            loads.append(ca.MX(0) if inserted else self._loads[segment.activity] * LOAD)
        self._time, self._speed, self._load = ca.vertcat(*times), ca.vertcat(*speeds), ca.vertcat(*loads)

    def _inputs(self) -> Any:
        """The model's inputs in each segment, shape (inputs, segments)."""
        functions: dict[str, Any] = {}
        columns = []
        for k, segment in enumerate(self.segments):
            gait = segment.gait
            if gait.name not in functions:
                v, m, air = ca.SX.sym("v"), ca.SX.sym("m"), ca.SX.sym("air")
                u = gait.inputs(v, m)
                for row, column in enumerate(self.mission.model.inputs):
                    u[row] = air if column.startswith("temperature.") else v if column == "speed.base" else u[row]
                functions[gait.name] = ca.Function("gait", [v, m, air], [u])
            columns.append(functions[gait.name](self._speed[k], self._load[k], self._ambient))
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
        counts = [each.work or 2 * _HASTE * each.least_time for each in self.mission.activities]
        work = ca.dot(self._shares, ca.DM(counts)) / TIME
        cost = self._for_work * (_HASTE * total - work) + (1 - self._for_work) * total + _TIDY * ca.sumsqr(self._loads)
        self.w = ca.vertcat(ca.vec(stages), self._pace, self._loads, self._shares)
        self.p = ca.vertcat(self._ambient, self._carry, self._deadline, self._start, self._for_work)
        self.f = cost
        self.g = ca.vertcat(ca.vec(balance), total - self._deadline / TIME, self._carry / LOAD - carried)
        """Zero, but for the last two, which are at most zero."""
        self.look = ca.Function("look", [self.w], [self._time, self._speed, self._load, self._shares])


def _grid() -> FloatArray:
    """Ends of the elements as shares of a segment."""
    return np.asarray((np.arange(ELEMENTS + 1) / ELEMENTS) ** _GRADING)
