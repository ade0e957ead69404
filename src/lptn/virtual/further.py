"""Say which columns a log has beyond the usual ones: what new effects are driven by."""

from __future__ import annotations

from typing import Literal

from .forcing import Common
from .robot import Array, Robot

Columns = Literal["asked", "all"]

# By the field of the robot that makes the column wanted. A log of signed samples has the first two in its samples.
_WANTED = {
    "driver": "torque_abs",
    "gear": "mechanical_power",
    "computer": "power.pc",
    "battery": "power.battery",
    "fanned": "speed.fan",
    "sunlit": "irradiance.global",
}


def wanted(robot: Robot, *, every: bool) -> tuple[str, ...]:
    """Return the columns that this robot's effects ask for, or every further column there is."""
    return tuple(column for field, column in _WANTED.items() if every or getattr(robot, field).any())


def common(shared: Common) -> dict[str, Array]:
    """Return the columns of what all nodes share, of shape (intervals, 1) each."""
    return {
        "power.pc": shared.computer,
        "power.battery": shared.battery,
        "speed.fan": shared.fan,
        "irradiance.global": shared.sun,
    }
