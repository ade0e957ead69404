"""What a walking robot does when its joints grow hot: stand taller, then lie down."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from a1_task import TORQUE_LIMIT, Command, FloatArray

TALL = 0.35  # m, straight knees need the least torque
SLOW = 0.2  # m/s

Limiter = Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True)
class Steps:
    """At which torque scales of the hottest joint the governor acts.

    Args:
        tall: full height at the first, the task's height from the second on.
        slow: least speed at the first, the task's speed from the second on; never slower by default.
        rest: lie down below it.
        again: get up above it.
    """

    tall: tuple[float, float] = (0.5, 0.9)
    slow: tuple[float, float] | None = None
    rest: float = 0.1
    again: float = 0.6


class Governor:
    """Turns the thermal limiter's torque scales into a task that the joints can bear.

    The torque of a leg that carries weight can't simply be cut: the robot would fall. What can be changed is the task.
    Heat goes with the square of the torque, and the knee's torque with the lever arm of a bent leg: the cheap measure
    is a taller stance. What remains hardly depends on the speed, since it is weight that the knees carry; so the robot
    doesn't slow down, which would only give fewer metres for the same heat. Lying down without torque never fails.

    Args:
        task: what the robot shall do while it is cool.
        steps: when to do what.
    """

    def __init__(self, task: Command, steps: Steps | None = None) -> None:
        self.task = task
        self.steps = steps or Steps()
        self._activity = task.activity

    def command(self, scale: FloatArray) -> Command:
        """The task at these torque scales, shape (12,), 1 for a cool joint and 0 at the limit."""
        least, steps, task = float(np.min(scale)), self.steps, self.task
        if least < steps.rest:
            self._activity = "rest"
        elif least > steps.again:
            self._activity = task.activity
        height = task.height + (1 - _ramp(least, steps.tall)) * max(0.0, TALL - task.height)
        slow = min(SLOW, task.speed)
        speed = task.speed if steps.slow is None else slow + _ramp(least, steps.slow) * (task.speed - slow)
        return replace(task, activity=self._activity, height=height, speed=speed)


class Unmoved:
    """No governor: the task, however hot the joints are."""

    def __init__(self, task: Command) -> None:
        self.task = task

    def command(self, scale: FloatArray) -> Command:
        """The task."""
        return self.task


def cut(torque: FloatArray, scale: FloatArray) -> FloatArray:
    """The plain limiter of a drive: no more than the scale's share of the peak torque [N·m], shape (12,)."""
    bound = TORQUE_LIMIT * scale
    return np.clip(torque, -bound, bound)


def leave(torque: FloatArray, scale: FloatArray) -> FloatArray:
    """No limiter."""
    return torque


def _ramp(value: float, between: tuple[float, float]) -> float:
    low, high = between
    return float(np.clip((value - low) / (high - low), 0.0, 1.0))
