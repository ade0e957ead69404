"""A mission: activities, what may be chosen, what must hold; the pieces of a plan, and its course in fine steps.

Times in s, temperatures in degC, all else SI.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil
from typing import Literal, NamedTuple

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.bounds import Bound
from lptn.model.model import Model
from lptn.simulate.dynamics import longest_step, stepped

from .gait import REST, Gait, with_surroundings

GivesUp = Literal["deadline", "distance"]
Range = tuple[float, float]
_STEPS = Bound(500_000, "steps")  # of a plan: a day by a part of 0.4 s; a mission with so many takes half a minute


@dataclass(frozen=True)
class Activity:
    """One item of the list.

    Args:
        do: the name of its gait.
        gait: what the joints do in it.
        distance: to travel [m]; `None` for one that stays where it is.
        duration: least and most time [s] of one that stays where it is.
        speed: least and most speed [m/s].
        load: least and most load [kg].
        posture: least and most of each posture of its gait, by name.
        pieces: parts that may each have a speed of their own and a rest before them.
    """

    do: str
    gait: Gait
    distance: float | None = None
    duration: Range = (0.0, 0.0)
    speed: Range = (0.0, 0.0)
    load: Range = (0.0, 0.0)
    posture: Mapping[str, Range] = field(default_factory=dict)
    pieces: int = 1

    @property
    def chooses_load(self) -> bool:
        """Whether the load is sought."""
        return self.load[1] > self.load[0]

    @property
    def work(self) -> float:
        """What it counts for [s]: its least time, nothing for a rest."""
        return 0.0 if self.do == REST else self.least_time

    @property
    def least_time(self) -> float:
        """How long it takes if nothing gets hot [s]."""
        return self.duration[0] if self.distance is None else self.distance / self.speed[1]


@dataclass(frozen=True)
class Transition:
    """What it takes to go from one gait to another, as in lying down or getting up.

    Args:
        gait: what the joints do meanwhile, on average over it; at one speed, over the loads.
        duration: [s].
    """

    gait: Gait
    duration: float


@dataclass(frozen=True)
class Mission:
    """A list of activities, a deadline, and bounds of the temperatures.

    Args:
        model: the thermal model.
        activities: in their order.
        rest: the gait of a rest, for rests that the planner inserts; `None` where it may insert none.
        longest_rest: of each inserted rest [s].
        limits: greatest temperature by node [degC].
        start: states at the start [degC], shape (states,); NaN where there is no reading.
        ambient: of the air [degC].
        deadline: of the whole [s], `None` for none.
        carry: least sum of the loads that are sought [kg].
        gives_up: what yields where the deadline can't be met: the deadline, or the distance.
        name: what people call it.
        origin: the file, for messages.
        utmost: what a node may not pass [degC] where `limits` keep a margin below it; `limits` where nothing is said. A
            node that begins within its margin is out of it when the first piece ends, and gets no hotter until then.
        transitions: by the names of the gaits before and after it; where there is none, to change costs nothing.
        begins: the gait in which the robot is at the start, `""` where the first activity may begin at once.
    """

    model: Model
    activities: tuple[Activity, ...]
    rest: Gait | None
    longest_rest: float
    limits: dict[str, float]
    start: FloatArray
    ambient: float
    deadline: float | None = None
    carry: float = 0.0
    gives_up: GivesUp = "deadline"
    name: str = "mission"
    origin: str = "mission"
    utmost: Mapping[str, float] = field(default_factory=dict)
    transitions: Mapping[tuple[str, str], Transition] = field(default_factory=dict)
    begins: str = ""

    @property
    def names(self) -> list[str]:
        """Of the activities, for people: `walk 1`, `stand 1`, `walk 2`."""
        done = [activity.do for activity in self.activities]
        return [f"{do} {1 + done[:number].count(do)}" for number, do in enumerate(done)]

    @property
    def fastest(self) -> float:
        """Time of the whole if nothing gets hot [s]."""
        between = sum(segment.length for segment in segments_of(self, ()) if segment.is_transition)
        return between + sum(activity.least_time for activity in self.activities)


def with_complete_start(mission: Mission) -> tuple[Mission, tuple[str, ...]]:
    """The mission with a temperature for every node, and the nodes that for want of a reading are put at their limit.

    A node without a limit is taken to be as hot as the hottest reading.
    """
    unread = ~np.isfinite(mission.start)
    if not unread.any():
        return mission, ()
    model, read = mission.model, mission.start[~unread]
    hottest = float(read.max()) if read.size else max(mission.ambient, *mission.limits.values())
    owners = [model.nodes[owner] for owner in model.owners]
    assumed = np.array([mission.limits.get(node, hottest) for node in owners])
    nodes = tuple(dict.fromkeys(node for node, missing in zip(owners, unread, strict=True) if missing))
    return replace(mission, start=np.where(unread, assumed, mission.start)), nodes


@dataclass(frozen=True)
class MissionSegment:
    """One piece of the plan with constant speed and load.

    Args:
        name: for people: `walk 1, part 2 of 3`.
        activity: index of its activity, -1 for a transition, and for a rest that the planner inserts.
        gait: what the joints do in it.
        length: distance [m], or least time [s] of what stays.
        travels: whether `length` is a distance.
        time: least and most time [s] where it stays; equal for a given time.
        posture: least and most of each posture of the gait, in its order.
        carries: of a transition, index of the activity whose load it carries.
        before: of a rest that the planner inserts, number of the piece that it precedes.
    """

    name: str
    activity: int
    gait: Gait
    length: float
    travels: bool
    time: Range = field(default=(0.0, 0.0))
    posture: tuple[Range, ...] = ()
    carries: int = -1
    before: int = -1

    @property
    def is_transition(self) -> bool:
        return self.carries >= 0


class Timed(NamedTuple):
    """A segment with what was chosen for it: time [s], speed [m/s], load [kg], a value for each posture of its gait."""

    segment: MissionSegment
    time: float
    speed: float
    load: float
    posture: tuple[float, ...]


@dataclass(frozen=True)
class Schedule:
    """Pieces of a mission one after another.

    Args:
        pieces: each with its time, speed and segment.
    """

    pieces: list[Timed]

    @property
    def segments(self) -> list[MissionSegment]:
        """The segment that each piece is of."""
        return [piece.segment for piece in self.pieces]

    @property
    def time(self) -> FloatArray:
        """Of each piece [s]."""
        return np.array([piece.time for piece in self.pieces])

    @property
    def speed(self) -> FloatArray:
        """In each piece [m/s]."""
        return np.array([piece.speed for piece in self.pieces])

    @property
    def load(self) -> FloatArray:
        """In each piece [kg]."""
        return np.array([piece.load for piece in self.pieces])

    @property
    def total(self) -> float:
        """Time of the whole [s]."""
        return float(self.time.sum())


def segments_of(mission: Mission, rests: Collection[int] | None = None) -> list[MissionSegment]:
    """The pieces of a mission in order, with transitions, and the rests that the planner may insert.

    Args:
        mission: what is asked.
        rests: numbers of the pieces before which a rest may be inserted, with the transitions to it and from it.
            `None`: before any, and around rests no transition: what a plan could do at best.
    """
    segments: list[MissionSegment] = []
    piece = -1
    for number, (named, activity) in enumerate(zip(mission.names, mission.activities, strict=True)):
        for part in range(activity.pieces):
            piece += 1
            allowed = rests is None or piece in rests
            # Neither behind another rest, nor before one whose time is sought.
            rested = bool(segments) and segments[-1].gait is mission.rest
            rested |= activity.gait is mission.rest and activity.duration[1] > activity.duration[0]
            if mission.rest is not None and allowed and not rested:
                still = tuple((float(knots[0]), float(knots[-1])) for knots in mission.rest.postures.values())
                time = (0.0, mission.longest_rest)
                segments.append(MissionSegment("rest", -1, mission.rest, 0.0, False, time, still, before=piece))
            name = named if activity.pieces == 1 else f"{named}, part {part + 1} of {activity.pieces}"
            low, high = (limit / activity.pieces for limit in activity.duration)
            travels = activity.distance is not None
            length = low if activity.distance is None else activity.distance / activity.pieces
            posture = tuple(activity.posture[key] for key in activity.gait.postures)
            segments.append(MissionSegment(name, number, activity.gait, length, travels, (low, high), posture))
    return _with_transitions(mission, segments, free_rests=rests is None)


def _with_transitions(mission: Mission, pieces: list[MissionSegment], *, free_rests: bool) -> list[MissionSegment]:
    """Pieces with what it takes to go from one to the next; around an inserted rest nothing where those are free."""
    segments: list[MissionSegment] = []
    before, carries = mission.begins, 0
    for piece in pieces:
        if piece.activity >= 0 and piece.gait.name != REST:
            carries = piece.activity  # down to a rest it is the load of what came before
        if piece.activity >= 0 or not free_rests:
            transition = mission.transitions.get((before, piece.gait.name))
            if transition is not None:
                time = (transition.duration, transition.duration)
                name = transition.gait.name
                segments.append(MissionSegment(name, -1, transition.gait, time[0], False, time, carries=carries))
            before = piece.gait.name
        segments.append(piece)
    return segments


def limited_later(mission: Mission, segments: Sequence[MissionSegment]) -> dict[str, tuple[int, float]]:
    """Nodes that begin above their limit: after how many pieces it counts, and what they may not pass before [degC].

    One that begins above its utmost has to be below its limit when the rest that comes first ends; one that begins
    within its margin when the first piece ends that is no rest, and it gets no hotter until then.
    """
    rested = 0  # pieces at the beginning that are rest, or the way to it
    for k, segment in enumerate(segments):
        if segment.gait is mission.rest:
            rested = k + 1
        elif not segment.is_transition:
            break
    later = {}
    for node, limit in mission.limits.items():
        begins = float(mission.start[mission.model.places.index(node)])
        if begins > mission.utmost.get(node, limit):
            later[node] = rested, np.inf
        elif begins > limit:
            later[node] = min(rested + 1, len(segments)), begins
    return later


# --- a plan simulated in fine steps ---------------------------------------------------------------


@dataclass(frozen=True)
class Course:
    """Temperatures along a plan.

    Args:
        time: since the start [s], shape (n,).
        states: [degC], shape (states, n).
        ends: index into `time` at which each segment ends.
    """

    time: FloatArray
    states: FloatArray
    ends: list[int]


def simulate_plan(mission: Mission, schedule: Schedule) -> Course:
    """Simulate a plan.

    Args:
        mission: model, start, ambient.
        schedule: the pieces.

    Raises:
        InputError: the model is so fast that the plan would take too many steps.
    """
    model, values, least = mission.model, mission.model.values, 32  # steps in a piece
    time, states, ends = [np.zeros(1)], [mission.start[:, None]], [0]
    for segment, duration, speed, load, posture in schedule.pieces:
        u = with_surroundings(segment.gait.at(speed, load, posture), model.inputs, speed, mission.ambient)
        # A Runge-Kutta step that is half of the fastest time constant is exact to 1e-4.
        step = min(1.0, longest_step(model, states[-1][:, -1], u, values, 0.5))  # s
        steps = max(least, ceil(duration / step))
        why = f"a time constant of {step / 0.5:.2g} s in a plan of {schedule.total:.4g} s"
        _STEPS.check(ends[-1] + steps, model.network.origin, why)
        h, held = duration / steps, np.repeat(u[:, None], steps, axis=1)
        states.append(stepped(model, states[-1][:, -1], held, values, h).ends[:, 1:])
        time.append(time[-1][-1] + h * np.arange(1, steps + 1))
        ends.append(ends[-1] + steps)
    return Course(np.concatenate(time), np.hstack(states), ends[1:])
