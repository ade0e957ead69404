"""Which rests are worth lying down for.

A transition costs the same however short the rest is that it leads to, so that to rest or not is a question of its
own, which no program of smooth functions answers. Sought are the rests of a plan for which they cost nothing; then,
with their transitions, fewer and longer ones as long as that is better.
"""

from __future__ import annotations

from .mission import Mission
from .program import Goal, MissionProgram, MissionSolution


def solved(mission: Mission, goal: Goal, deadline: float | None = None) -> tuple[MissionProgram, MissionSolution]:
    """The program of a mission with the rests that are worth their transitions, and its solution.

    Without transitions all rests are in it, and it is solved once; with them some four times more.

    Args:
        mission: what is asked.
        goal: what is made best.
        deadline: greatest total time [s], `None` for none.
    """
    program = MissionProgram(mission)
    solution = program.solve(goal, deadline=deadline)
    if not mission.transitions or not solution.success:  # what can't be done without transitions can't with them
        return program, solution
    every = [segment.before for segment in program.segments if segment.before >= 0]
    # Rests of less than 0.05 s are solver dust.
    for rests in (_longest_first(program, solution, above=0.05), every, []):
        program = MissionProgram(mission, rests)
        solution = program.solve(goal, deadline=deadline)
        if solution.success:
            break
    rests = _longest_first(program, solution) if solution.success else []
    dropped = (len(rests) + 1) // 2
    while dropped:
        fewer = MissionProgram(mission, rests[: len(rests) - dropped])
        candidate = fewer.solve(goal, deadline=deadline)
        if candidate.success and _worth(mission, candidate, goal) > _worth(mission, solution, goal):
            program, solution, rests = fewer, candidate, _longest_first(fewer, candidate)
            dropped = min(dropped, len(rests))
        else:
            dropped //= 2
    return program, solution


def _longest_first(program: MissionProgram, solution: MissionSolution, above: float = -1.0) -> list[int]:
    """Numbers of the pieces that a rest precedes, of rests that last longer than so many seconds."""
    rests = [
        (time, segment.before)
        for segment, time in zip(program.segments, solution.time.tolist(), strict=True)
        if segment.before >= 0 and time > above
    ]
    return [before for _, before in sorted(rests, reverse=True)]


def _worth(mission: Mission, solution: MissionSolution, goal: Goal) -> float:
    """Seconds of work done, or of time not needed. Of plans that do equally much the faster is meant."""
    return solution.work(mission) - 1e-4 * solution.total if goal == "work" else -solution.total
