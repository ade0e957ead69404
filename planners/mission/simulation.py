"""A plan simulated in fine steps, to check the few steps of the program, and to give it temperatures to start from."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.bounds import Bound
from lptn.simulate.dynamics import longest_step

from .gait import with_surroundings
from .mission import Mission, Schedule

_BLOCK = 32  # steps that one call takes
_STEPS = Bound(500_000, "steps")  # of a plan: a day by a part of 0.4 s; a mission with so many takes half a minute


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
    model, values = mission.model, mission.model.values
    run = model.run(_BLOCK)
    clock, states, ends = [0.0], [mission.start[:, None]], []
    count = 0
    for segment, duration, speed, load, posture in schedule.pieces():
        u = with_surroundings(segment.gait.at(speed, load, posture), model.inputs, speed, mission.ambient)
        # A Runge-Kutta step that is half of the fastest time constant is exact to 1e-4.
        step = min(1.0, longest_step(model, states[-1][:, -1], u, values, 0.5))  # s
        blocks = max(1, ceil(duration / (_BLOCK * step)))
        why = f"a time constant of {step / 0.5:.2g} s in a plan of {schedule.total:.4g} s"
        _STEPS.check(count + blocks * _BLOCK, model.network.origin, why)
        h = duration / (_BLOCK * blocks)
        begin = clock[-1]
        for block in range(blocks):
            path = run(states[-1][:, -1], np.repeat(u[:, None], _BLOCK, axis=1), values, h).full()
            states.append(path)
            clock += (begin + h * (block * _BLOCK + np.arange(1, _BLOCK + 1))).tolist()
        count += blocks * _BLOCK
        ends.append(count)
    return Course(np.array(clock), np.hstack(states), ends)
