"""How long a motor holds each torque at each speed, within winding, magnets, current and supply voltage."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.errors import InputError

from .designs import Design
from .motors import REFERENCE
from .simulation import Simulator

_DURATIONS = (10.0, 30.0, 60.0, 180.0, 600.0, 1800.0, 3600.0)  # s


@dataclass(frozen=True)
class TorqueSpeed:
    """What a design can do, behind its gear.

    Args:
        name: of the choice.
        speed: rad/s, shape (n,), up to where nothing is left.
        durations: s, shape (k,), from 0 (a moment, at the start's temperature) to infinity (for ever).
        torque: that can be held so long, from the start of the study's task [N·m], shape (k, n); NaN where the speed
            can't be held at all.
    """

    name: str
    speed: FloatArray
    durations: FloatArray
    torque: FloatArray


def torque_speed(design: Design, speeds: int = 49, unlimited: float = 40.0) -> TorqueSpeed:
    """The torque that can be held for each of some durations at each speed.

    A point can be held as long as winding and magnets stay below their limits and current and voltage suffice, with
    the magnets and the copper as warm as they are then.

    Args:
        design: the motor, its gear and its cooling.
        speeds: how many.
        unlimited: largest current [A] that is looked at where nothing limits it.

    Raises:
        InputError: neither the voltage nor the speed is limited.
    """
    option, study = design.option, design.option.study
    ratio = option.gear.ratio[0]
    limits = option.motor.limits.given | option.limits
    magnets = option.motor.torque_constant * (1 + option.motor.magnet_coefficient * (study.task.start - REFERENCE))
    ends = [limits["speed"]] if "speed" in limits else []
    ends += [limits["voltage"] / magnets] if "voltage" in limits else []
    if not ends:
        expected = "voltage = … or speed = …, where the diagram ends"
        raise InputError(study.origin, "limits", "no voltage and no speed", expected)
    speed = np.linspace(0.0, min(ends) / ratio, speeds)
    durations = np.array([0.0, *(time for time in _DURATIONS if time < study.task.longest), study.task.longest, np.inf])
    most = limits.get("current", unlimited) * option.motor.torque_constant * ratio
    holds = _endurance(design, limits, np.tile(speed, durations.size), np.repeat(durations, speed.size))
    low, high = np.zeros(durations.size * speed.size), np.full(durations.size * speed.size, most)
    held_idle = holds(low)
    for _ in range(14):  # halvings: to 1e-4 of the largest torque
        middle = (low + high) / 2
        good = holds(middle)
        low, high = np.where(good, middle, low), np.where(good, high, middle)
    held = np.where(held_idle, low, np.nan).reshape(durations.size, speed.size)
    # Copper warms before the magnets do: the voltage that is needed may be largest on the way.
    return TorqueSpeed(option.name, speed, durations, np.minimum.accumulate(held))


def _endurance(
    design: Design, limits: dict[str, float], speed: FloatArray, durations: FloatArray
) -> Callable[[FloatArray], BoolArray]:
    """Whether torques [N·m] at these speeds keep the limits for so long, looked at after each step."""
    simulator, task = Simulator(design.option, design.sink), design.option.study.task
    start = np.full((len(simulator.plant.states), speed.size), task.start)
    ever = np.isinf(durations)

    def within(x: FloatArray, drive: FloatArray) -> BoolArray:
        current, voltage = simulator.electric(np.where(np.isfinite(x), x, task.ambient), drive)
        reached = {
            "winding": simulator.winding(x),
            "magnet": simulator.magnet(x),
            "current": current,
            "voltage": voltage,
        }
        kept = [value <= limits.get(name, np.inf) * (1 + 1e-9) for name, value in reached.items()]
        return np.asarray(np.all(kept, axis=0))

    def holds(torque: FloatArray) -> BoolArray:
        drive = np.vstack([torque, speed, np.zeros(torque.size)])
        good = within(start, drive)
        lasting, short = drive[:, ever], drive[:, ~ever]
        good[ever] &= within(simulator.steady(lasting), lasting)
        x = start[:, ~ever]
        # Beyond a thermal runaway long steps mean nothing; before, short ones have passed a limit. A hold changes
        # fastest at the beginning, where steps are shorter.
        for share in np.diff((np.arange(61) / 60) ** 2):
            x = simulator.advance_implicitly(x, short, share * durations[~ever])
            good[~ever] &= within(x, short)
        return good

    return holds
