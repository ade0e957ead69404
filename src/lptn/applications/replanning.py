"""A mission in closed loop: what is left of it is planned anew where the robot turns out other than the plan has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import ceil

import numpy as np
from scipy.stats import norm

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.online import Estimator, ModelError
from lptn.planners.mission.answer import MissionPlan, peaks_of
from lptn.planners.mission.gait import REST, Gait
from lptn.planners.mission.mission import Activity, Mission, Schedule, Timed, simulate_plan
from lptn.planners.mission.plan import plan_mission

_NEGLIGIBLE = 0.5  # s; what takes less is done


@dataclass(frozen=True)
class Order:
    """What the robot shall do now.

    Args:
        name: of the piece, for people: `walk 1, part 2 of 3`, or `walk to rest` on the way to the next.
        do: its gait; on the way to the next piece that one's, with its load and posture.
        speed: [m/s].
        load: [kg].
        posture: by name.
        seconds: how long it goes on as planned.
        finished: whether nothing is left to do.
    """

    name: str
    do: str
    speed: float = 0.0
    load: float = 0.0
    posture: Mapping[str, float] = field(default_factory=dict)
    seconds: float = np.inf
    finished: bool = False


@dataclass(frozen=True)
class Replanned:
    """A plan that took the place of another.

    Args:
        time: since the start of the mission [s].
        why: in words.
        plan: of what was left then.
        total: expected time of the whole mission [s].
    """

    time: float
    why: str
    plan: MissionPlan
    total: float


class MissionControl:
    """Plans a mission, follows the robot while it does it, and plans what is left anew.

    An estimator learns from the sensors how hot each node is and how the model's parameters are off, the torques
    that are measured correct the tables of gaits, rests and transitions, and the air is what its sensor says. Once a
    period the rest of the plan is simulated from there. Where a limit less its margin would be passed, or a plan that
    is held up by heat would stay below all of them, what is left is solved again: speeds, rests, postures, and loads
    of what has not begun. So a plan that was too bold yields before a limit is passed, one that was too careful
    becomes faster.

    Args:
        mission: what is asked.
        level: probability with which a node is to be below its limit a period after it was brought there.
        period: time between two looks at the plan [s].
        apart: by how much a peak may come out other than planned before what is left is planned anew [K].
        noise: standard deviation of a reading [K], its rounding aside.
        resolution: step to which readings are rounded [K].
        model_error: how far the model's free parameters may be off, relative.
        estimator: of the mission's model, in place of one made of these.

    Raises:
        InputError: a number can't be used.

    Example:
        >>> control = MissionControl(mission)  # doctest: +SKIP
        >>> order = control.update(readings, inputs, dt=5.0, moved=2.1)  # doctest: +SKIP
    """

    def __init__(
        self,
        mission: Mission,
        *,
        level: float = 0.95,
        period: float = 60.0,
        apart: float = 0.2,
        noise: float | Mapping[str, float] = 0.1,
        resolution: float | Mapping[str, float] = 0.0,
        model_error: float = 0.2,
        estimator: Estimator | None = None,
    ) -> None:
        for name, value, most in (("level", level, 1.0), ("period", period, np.inf), ("apart", apart, np.inf)):
            if not 0 < value < most:
                raise InputError(mission.origin, name, f"{value:g}", f"a number between 0 and {most:g}")
        model = mission.model
        if estimator is None:
            free = [model.parameters[index].name for index in model.free]
            spread = model_error**2 * np.eye(len(free))
            estimator = Estimator(
                model, noise=noise, step=resolution, error=ModelError(), learn=free, covariance=spread
            )
        self.mission, self.estimator = mission, estimator
        self.replanned: list[Replanned] = []
        """The plans in their order; the first is the one at the start."""
        self.clock = 0.0
        """Time since the start [s]."""
        self._sure, self._period, self._apart = float(norm.ppf(level)), period, apart
        self._left = [
            activity.distance if activity.distance is not None else activity.duration[0]
            for activity in mission.activities
        ]
        self._spent = [0.0] * len(self._left)  # s in each activity
        self._first = 0  # activity that is not over
        self._loads: dict[int, float] = {}  # of what has begun
        self._measured: dict[str, FloatArray] = {}  # by gait: integrals of squares, as measured and by the table
        self._air = mission.ambient
        self._ahead: list[Timed] = []  # of the plan in force, the present one first
        self._gone = 0.0  # s of the present piece, at its planned speed
        self._doing = mission.begins  # the gait that the robot is in
        self._looked = -np.inf
        self._margins = dict.fromkeys(mission.limits, 0.0)

    @property
    def plan(self) -> MissionPlan:
        """The plan in force, of what was left when it was made.

        Raises:
            IndexError: before the first update.
        """
        return self.replanned[-1].plan

    @property
    def done(self) -> dict[str, float]:
        """Share of each activity that is done; of what stays, of its least time."""
        shares = {}
        for name, activity, left in zip(self.mission.names, self.mission.activities, self._left, strict=True):
            whole = activity.distance or activity.duration[0]
            shares[name] = 1 - max(left, 0.0) / whole if whole else 1.0
        return shares

    @property
    def margins(self) -> Mapping[str, float]:
        """What is kept below each limit [K], by node."""
        return dict(self._margins)

    def update(
        self, readings: Mapping[str, float | None], inputs: Mapping[str, float], dt: float, moved: float | None = None
    ) -> Order:
        """Take in what was measured since the last update, and tell what to do now.

        Args:
            readings: temperatures now [degC] by node; NaN, `None` or no entry for a missing one.
            inputs: the model's inputs since then, RMS or means as in a log, by column; the air's temperature too.
            dt: time since then [s]; 0 at the first one.
            moved: distance travelled since then [m]; by default as ordered.

        Raises:
            InputError: as `Estimator.update`.
        """
        estimate = self.estimator.update(inputs, readings, dt)
        self.clock += dt
        air = [inputs[name] for name in self.mission.model.inputs if name.startswith("temperature.") and name in inputs]
        self._air = max(air, default=self._air)
        if dt > 0 and self._ahead:
            self._advance(inputs, dt, moved)
        mission, limits = self.mission, self.mission.limits
        if mission.gives_up == "distance" and self.clock >= (mission.deadline or np.inf):
            self._first = len(self._left)
            self._ahead.clear()
        now = self._ahead[0].segment if self._ahead else None
        too_hot = any(estimate.temperature(node)[0] > limit for node, limit in limits.items())
        works = now is not None and now.gait.name != REST
        due = self.clock >= self._looked + self._period or (works and too_hot)
        if now is None:
            due |= not self.replanned or self.plan.verdict != "none"
        elif now.is_transition:
            due = False  # halfway down is no place to change the plan
        if due and self._first < len(self._left):
            self._look(inputs)
            self._looked = self.clock
        if self._first >= len(self._left):
            return Order("finished", "rest", finished=True)
        if not self._ahead:
            return Order("rest", "rest", seconds=self._period)
        piece = self._ahead[0]
        onto = self._ahead[1] if piece.segment.is_transition and len(self._ahead) > 1 else piece
        gait, speed = onto.segment.gait, piece.speed if onto is piece else 0.0
        posture, seconds = dict(zip(gait.postures, onto.posture, strict=True)), max(piece.time - self._gone, 0.0)
        return Order(piece.segment.name, gait.name, speed, onto.load, posture, seconds)

    # --- how far it is ------------------------------------------------------------------------

    def _advance(self, inputs: Mapping[str, float], dt: float, moved: float | None) -> None:
        """Count what was done. What a plan leaves out is over when the plan goes on to something else, or ends."""
        segment, time, speed, load, posture = self._ahead[0]
        done = dt if not segment.travels or moved is None else moved / speed
        self._gone += done
        if not segment.is_transition:
            self._doing = segment.gait.name
        # What the gait's inputs are, beside what its table says.
        table = _gaits_of(self.mission)[segment.gait.name].at(speed, load, posture)
        sums = self._measured.setdefault(segment.gait.name, np.zeros((2, table.size)))
        measured = np.array([inputs.get(column, np.nan) for column in self.mission.model.inputs])
        finite = np.isfinite(measured)
        sums[:, finite] += dt * np.stack([measured, table])[:, finite] ** 2
        if segment.activity >= 0:
            self._left[segment.activity] -= done * speed if segment.travels else dt
            self._spent[segment.activity] += dt
            self._loads[segment.activity] = load
        if self._gone >= time - _NEGLIGIBLE / 2:
            self._gone = max(self._gone - time, 0.0)
            del self._ahead[0]
            if segment.activity >= 0:
                later = [piece.segment.activity for piece in self._ahead if piece.segment.activity >= 0]
                self._first = later[0] if later else len(self._left)
        while self._first < len(self._left) and self._is_over(self._first):
            self._first += 1
        while self._ahead and 0 <= self._ahead[0].segment.activity < self._first:
            self._gone = 0.0
            del self._ahead[0]

    def _is_over(self, number: int) -> bool:
        activity, left = self.mission.activities[number], self._left[number]
        if activity.distance is not None:
            return bool(left <= _NEGLIGIBLE * activity.speed[0])
        return bool(left <= _NEGLIGIBLE and activity.duration[1] - self._spent[number] <= _NEGLIGIBLE)

    # --- what is left -------------------------------------------------------------------------

    def remaining(self) -> Mission:
        """What is left as a mission of its own, from the estimate, with what was learnt."""
        mission, estimator, gaits = self.mission, self.estimator, self._corrected_gaits()
        activities = tuple(
            self._rest_of(number, gaits) for number in range(self._first, len(self._left)) if not self._is_over(number)
        )
        # Of what has begun the load stands; the rest may round to a hair more than what is left can take.
        carried = sum(load for number, load in self._loads.items() if mission.activities[number].chooses_load)
        room = sum(activity.load[1] for activity in activities if activity.chooses_load)
        return replace(
            mission,
            model=mission.model.with_values(estimator.values),
            activities=activities,
            rest=None if mission.rest is None else gaits[mission.rest.name],
            transitions={
                pair: replace(transition, gait=gaits[transition.gait.name])
                for pair, transition in mission.transitions.items()
            },
            start=estimator.states,
            ambient=self._air,
            deadline=None if mission.deadline is None else max(mission.deadline - self.clock, _NEGLIGIBLE),
            carry=min(max(0.0, mission.carry - carried), room),
            limits={node: limit - self._margins[node] for node, limit in mission.limits.items()},
            utmost=dict(mission.limits),
            begins=self._doing,
        )

    def _corrected_gaits(self) -> dict[str, Gait]:
        """By name what the mission's tables prescribe, with inputs as large as they were measured to be."""
        trusted = 60.0  # s for which a gait's table counts against what is measured
        gaits = _gaits_of(self.mission)
        # No gait prescribes temperatures or the base's speed.
        prescribed = [not column.startswith(("temperature.", "speed.")) for column in self.mission.model.inputs]
        for name, (measured, table) in self._measured.items():
            cells = gaits[name].cells
            typical = trusted * (cells**2).reshape(-1, cells.shape[-1]).mean(axis=0)
            corrected = (typical > 0) & prescribed
            factor = np.ones(typical.size)
            factor[corrected] = np.sqrt((measured + typical)[corrected] / (table + typical)[corrected])
            gaits[name] = replace(gaits[name], cells=cells * factor)
        return gaits

    def _rest_of(self, number: int, gaits: Mapping[str, Gait]) -> Activity:
        activity, left = self.mission.activities[number], self._left[number]
        load = (self._loads[number],) * 2 if number in self._loads else activity.load
        now = replace(activity, gait=gaits[activity.gait.name], load=load)
        if activity.distance is not None:
            pieces = max(1, ceil(activity.pieces * left / activity.distance))
            return replace(now, distance=left, pieces=pieces)
        most = activity.duration[1] - self._spent[number]
        return replace(now, duration=(max(left, 0.0), max(most, left, 0.0)))

    # --- looking and planning -----------------------------------------------------------------

    def _look(self, inputs: Mapping[str, float]) -> None:
        """Plan what is left anew where the plan in force would pass a limit, or is held up by none any more."""
        # What the temperatures may be off by a period from now [K], at most half the way from the air to a limit: a
        # greater margin would forbid what teaches the model.
        deviations, places = self.estimator.deviations_ahead(inputs, self._period), self.mission.model.places
        self._margins = {
            node: min(self._sure * float(deviations[places.index(node)]), 0.5 * max(limit - self._air, 0.0))
            for node, limit in self.mission.limits.items()
        }
        left = self.remaining()
        why = self._reason(left)
        if not why:
            return
        plan = plan_mission(left, explain=not self.replanned)
        self._gone = 0.0
        self.replanned.append(Replanned(self.clock, why, plan, self.clock + plan.total))
        # Its activities are numbered as in what was left, here as in the whole mission.
        undone = [number for number in range(self._first, len(self._left)) if not self._is_over(number)]
        self._ahead = list(plan.pieces)
        for k, piece in enumerate(self._ahead):
            if piece.segment.activity >= 0:
                number = undone[piece.segment.activity]
                self._ahead[k] = piece._replace(
                    segment=replace(piece.segment, activity=number, name=self.mission.names[number])
                )
        if not self._ahead and plan.verdict != "none":
            self._first = len(self._left)  # too little is left, or there is no time for it

    def _reason(self, left: Mission) -> str:
        """Why the plan in force does not do for what is left, in words; nothing where it does."""
        if not self.replanned:
            return "the start"
        if not self._ahead or self.plan.verdict == "none":
            return "the plan had come to its end"
        gaits, rest = _gaits_of(left), []
        for piece in self._ahead:
            gait = piece.segment.gait
            rest.append(piece._replace(segment=replace(piece.segment, gait=gaits.get(gait.name, gait))))
        rest[0] = rest[0]._replace(time=max(rest[0].time - self._gone, _NEGLIGIBLE))
        ahead = Schedule(rest)
        peaks = peaks_of(left, ahead.segments, simulate_plan(left, ahead))
        nearest = min(peaks, key=lambda node: left.limits[node] - peaks[node])
        spare = left.limits[nearest] - peaks[nearest]
        said = f"{nearest} would get to {peaks[nearest]:.1f} degC, {abs(spare):.1f} K"
        its = f"its limit of {self.mission.limits[nearest]:g} degC less a margin of {self._margins[nearest]:.1f} K"
        if spare < -self._apart:
            return f"{said} above {its}"
        time = sum(piece.time for piece in self._ahead) - self._gone
        slower = time > left.fastest + _NEGLIGIBLE or self.plan.verdict == "cut"
        return f"{said} below {its}" if spare > self._apart and slower else ""

    def text(self) -> str:
        """How it went so far, a line for each plan."""
        lines = [f"{event.time:6.0f} s  {event.total / 60:5.1f} min in all, {event.plan.verdict}: {event.why}"
                 for event in self.replanned]  # fmt: skip
        return "\n".join(lines)


def _gaits_of(mission: Mission) -> dict[str, Gait]:
    """By name what the joints do in each activity, in a rest and between them."""
    between = [transition.gait for transition in mission.transitions.values()]
    rest = [] if mission.rest is None else [mission.rest]
    return {gait.name: gait for gait in [*between, *rest, *(activity.gait for activity in mission.activities)]}
