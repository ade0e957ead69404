"""How long a motor holds each torque at each speed, within winding, magnets, current and supply voltage."""

from __future__ import annotations

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
    shape = durations.size, speed.size
    held = _held(design, limits, np.tile(speed, durations.size), np.repeat(durations, speed.size), most)
    # Copper warms before the magnets do: the voltage that is needed may be largest on the way.
    return TorqueSpeed(option.name, speed, durations, np.minimum.accumulate(held.reshape(shape)))


def _held(
    design: Design, limits: dict[str, float], speed: FloatArray, durations: FloatArray, most: float
) -> FloatArray:
    """The torque [N·m] that each speed bears for its duration [s], by halving; NaN where not even none."""
    holds = _Endurance(design, limits, speed, durations)
    low, high = np.zeros(speed.size), np.full(speed.size, most)
    is_held_idle = holds(low)
    for _ in range(14):  # to 1e-4 of the largest torque
        middle = (low + high) / 2
        good = holds(middle)
        low, high = np.where(good, middle, low), np.where(good, high, middle)
    return np.where(is_held_idle, low, np.nan)


class _Endurance:
    """Whether points of torque and speed keep the limits for so long, looked at after each step."""

    def __init__(self, design: Design, limits: dict[str, float], speed: FloatArray, durations: FloatArray) -> None:
        self.simulator, self.limits = Simulator(design.option), limits
        self.speed, self.durations = speed, durations
        self.capacity, self.resistance = (np.full(speed.size, value) for value in design.sink or (1.0, 1.0))
        task = design.option.study.task
        self.ambient = task.ambient
        self.start = np.full((len(self.simulator.plant.states), speed.size), task.start)

    def __call__(self, torque: FloatArray) -> BoolArray:
        drive = np.vstack([torque, self.speed, np.zeros(torque.size)])
        good = self._within(self.start, drive)
        ever = np.isinf(self.durations)
        rows = drive[:, ever], self.capacity[ever], self.resistance[ever]
        good[ever] &= self._within(self.simulator.steady(*rows), drive[:, ever])
        # Beyond a thermal runaway long steps mean nothing; before, short ones have passed a limit.
        x, rows = self.start[:, ~ever], (drive[:, ~ever], self.capacity[~ever], self.resistance[~ever])
        # Shorter steps at the beginning, where a hold changes fastest.
        for share in np.diff((np.arange(61) / 60) ** 2):
            x = self.simulator.advance_implicitly(x, *rows, share * self.durations[~ever])
            good[~ever] &= self._within(x, drive[:, ~ever])
        return good

    def _within(self, x: FloatArray, drive: FloatArray) -> BoolArray:
        simulator = self.simulator
        current, voltage = simulator.electric(np.where(np.isfinite(x), x, self.ambient), drive)
        values = simulator.winding(x), simulator.magnet(x), current, voltage
        reached = dict(zip(("winding", "magnet", "current", "voltage"), values, strict=True))
        within = [value <= self.limits.get(name, np.inf) * (1 + 1e-9) for name, value in reached.items()]
        return np.asarray(np.all(within, axis=0))
