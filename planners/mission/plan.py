"""How the plan of a mission is found: the fastest that keeps all limits, or the best of what is possible."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..tasks import Kind
from .answer import COUNTS, EXACT, MissionPlan, Verdict
from .mission import Mission, Schedule, Timed, simulate_plan, with_complete_start
from .mission_file import MissionFile, mission_of
from .program import Goal, MissionProgram, MissionSolution

_DUST = 0.05  # s; shorter pieces are solver dust


def plan_mission(mission: Mission, *, explain: bool = True) -> MissionPlan:
    """Find the fastest plan that keeps all limits, or the best of what is possible.

    Never fails: where not all can be done the verdict says so, and the plan is the safe part of it.

    Args:
        mission: what is asked.
        explain: whether the rise of the limits that would do is sought where something has to be given up, which takes
            ten solves more.
    """
    complete, assumed = with_complete_start(mission)
    return replace(_planned(complete, explain), assumed=assumed)


def _planned(mission: Mission, explain: bool) -> MissionPlan:
    raised: float | None = None
    program, fastest = _solved(mission, "time")
    if fastest.success:
        if mission.deadline is None or fastest.total <= mission.deadline + 1e-6 * mission.deadline:
            return _finished(program, "met", fastest, 0.0)
        raised = _rise(program, fastest) if explain else None
        if mission.gives_up == "deadline":
            return _finished(program, "late", fastest, raised)
    program, part = _solved(mission, "work", mission.deadline)
    if not part.success:
        return _resting(program, part)
    if explain and not fastest.success:
        undone = sum(activity.work for activity in mission.activities) - part.work(mission)  # s
        raised = _rise(program, fastest, guess=undone / max(_slope(part), COUNTS))
    return _finished(program, "cut", part, raised)


def _solved(mission: Mission, goal: Goal, deadline: float | None = None) -> tuple[MissionProgram, MissionSolution]:
    """The program of a mission with the rests that are worth their transitions, and its solution.

    A transition costs the same however short the rest is that it leads to, so that to rest or not is a question of its
    own, which no program of smooth functions answers. Sought are the rests of a plan for which they cost nothing; then,
    with their transitions, fewer and longer ones as long as that is better. Without transitions all rests are in it,
    and it is solved once; with them some four times more.
    """

    def solve(rests: Sequence[int] | None) -> tuple[MissionProgram, MissionSolution]:
        program = MissionProgram(mission, rests)
        return program, program.solve(goal, deadline=deadline)

    def longest_first(solution: MissionSolution, above: float = -1.0) -> list[int]:
        """Numbers of the pieces that a rest precedes, of rests that last longer than so many seconds."""
        rests = [(piece.time, piece.segment.before) for piece in solution.pieces if piece.time > above]
        return [before for _, before in sorted(rests, reverse=True) if before >= 0]

    def worth(solution: MissionSolution) -> float:
        """Seconds of work done, or of time not needed. Of plans that do equally much the faster is meant."""
        return solution.work(mission) - 1e-4 * solution.total if goal == "work" else -solution.total

    program, solution = solve(None)
    if not mission.transitions or not solution.success:  # what can't be done without transitions can't with them
        return program, solution
    every = [segment.before for segment in program.segments if segment.before >= 0]
    for rests in (longest_first(solution, above=_DUST), every, []):
        program, solution = solve(rests)
        if solution.success:
            break
    rests = longest_first(solution) if solution.success else []
    dropped = (len(rests) + 1) // 2
    while dropped:
        fewer, candidate = solve(rests[: len(rests) - dropped])
        if candidate.success and worth(candidate) > worth(solution):
            program, solution, rests = fewer, candidate, longest_first(candidate)
            dropped = min(dropped, len(rests))
        else:
            dropped //= 2
    return program, solution


def _rise(
    program: MissionProgram,
    solution: MissionSolution,
    guess: float = 0.0,
    *,
    solves: int = 14,
    close: float = 0.5,
    fine: float = 0.1,
    farthest: float = 100.0,
) -> float | None:
    """By how much all limits would have to rise for all to be done in time [K].

    Newton's method on the prices of the least time, kept between what proved too little and what proved enough. (The
    most work within the deadline would not do: where all can be done, any plan in time is as good as another.)

    Args:
        program: of the mission.
        solution: of least time; where there is none, it failed.
        guess: rise to begin with where it failed [K].
        solves: at most.
        close: by how much time may miss the deadline [s].
        fine: to which the rise is sought [K, or share of it].
        farthest: rise that is looked at [K].
    """
    mission, raised, little = program.mission, 0.0, 0.0
    if mission.deadline is not None and mission.fastest > mission.deadline:
        return None
    enough: float | None = None
    for _ in range(solves):
        late = solution.total - (mission.deadline or np.inf) if solution.success else np.inf
        if late <= close:
            enough = raised
        else:
            little = raised
        if enough is not None and (abs(late) <= close or enough - little <= max(fine, fine * enough)):
            return enough
        slope = _slope(solution)
        if np.isfinite(late) and slope > COUNTS:
            raised += late / slope
        elif enough is None:
            raised = max(guess, 2 * raised, fine)
        if enough is not None and not little < raised < enough - fine / 2:
            raised = (little + enough) / 2
        raised = min(raised, farthest)
        if raised <= little:
            return enough
        lifted = {node: limit + raised for node, limit in mission.limits.items()}
        solution = program.solve("time", limits=lifted, near=solution if solution.success else None)
    return enough


def _slope(solution: MissionSolution) -> float:
    """What one kelvin more of all limits gains, in the unit of the goal; nothing where the solve failed."""
    return sum(abs(price) for name, price in solution.prices.items() if name.startswith("limit."))


def _finished(
    program: MissionProgram, verdict: Verdict, solution: MissionSolution, raised: float | None
) -> MissionPlan:
    """The plan replayed, and found again for limits a little lower where the replay passes one."""
    mission, lowered = program.mission, 0.0
    plan = _plan(program, verdict, solution, lowered, raised)
    for _ in range(3):
        beyond = max((plan.peaks[node] - limit for node, limit in mission.limits.items()), default=0.0)
        if beyond <= EXACT:
            break
        lowered += beyond + EXACT
        limits = {node: limit - lowered for node, limit in mission.limits.items()}
        goal: Goal = "work" if verdict == "cut" else "time"
        again = program.solve(goal, limits=limits, deadline=mission.deadline if goal == "work" else None, near=solution)
        if not again.success:
            break
        plan = _plan(program, verdict, again, lowered, raised)
    if verdict == "met" and plan.late > 1e-6 * plan.total:
        return replace(plan, verdict="late")
    return plan


def _plan(
    program: MissionProgram, verdict: Verdict, solution: MissionSolution, lowered: float, raised: float | None
) -> MissionPlan:
    schedule = Schedule([piece for piece in solution.pieces if piece.time > _DUST])
    course = simulate_plan(program.mission, schedule)
    return MissionPlan(
        **vars(schedule), mission=program.mission, verdict=verdict, share=solution.share, course=course,
        coarse=program.peaks(solution), lowered=lowered, prices=solution.prices, raise_needed=raised,
        status=solution.status,
    )  # fmt: skip


def _resting(program: MissionProgram, failed: MissionSolution) -> MissionPlan:
    """All drives off until the deadline: the safest plan there is."""
    mission = program.mission
    rests = [segment for segment in program.segments if segment.gait is mission.rest][:1]
    time = mission.deadline or mission.longest_rest
    schedule = Schedule([Timed(rest, time, 0.0, 0.0, tuple(low for low, _ in rest.posture)) for rest in rests])
    return MissionPlan(
        **vars(schedule), mission=mission, verdict="none", share=np.zeros(len(mission.activities)),
        course=simulate_plan(mission, schedule), coarse={}, lowered=0.0, prices={}, raise_needed=None,
        status=failed.status,
    )  # fmt: skip


plan_kind = Kind(MissionFile, mission_of, plan_mission)
