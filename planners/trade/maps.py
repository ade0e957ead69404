"""What a design does beside its task: on other sinks, at other currents, at other torques and speeds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, log, log1p

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.errors import InputError

from .designs import Design
from .motors import ENAMEL_LIMIT, REFERENCE
from .simulation import Simulator, peak_temperatures
from .study import Option


@dataclass(frozen=True)
class IsoMap:
    """Highest winding temperature [degC] over capacity [J/K] (n,) and resistance [K/W] (m,), shape (m, n)."""

    option: Option
    capacity: FloatArray
    resistance: FloatArray
    winding: FloatArray
    torque: float
    duration: float


def iso_map(design: Design, points: int = 30) -> IsoMap:
    """The design's task on sinks of all sizes within the study's bounds.

    Args:
        design: whose torque and duration are taken; it must have a sink.
        points: along each axis.

    Raises:
        InputError: the design has no sink.
    """
    option, study = design.option, design.option.study
    if not option.has_sink:
        raise InputError(study.origin, "map", f"{option.name}", "a design with a sink")
    capacity, resistance = (np.geomspace(*ends, points) for ends in study.sink.bounds)
    every_c, every_r = (grid.ravel() for grid in np.meshgrid(capacity, resistance))
    peaks = peak_temperatures(option, every_c, every_r, np.full(every_c.size, design.torque), design.duration)
    return IsoMap(option, capacity, resistance, peaks.reshape(points, points), design.torque, design.duration)


@dataclass(frozen=True)
class LimitCurve:
    """Time [s] until the winding reaches its limit [degC] at each constant current [A]; infinite for never."""

    name: str
    limit: float
    current: FloatArray
    time: FloatArray


def limit_curves(design: Design, currents: FloatArray) -> LimitCurve:
    """Time from the start until the winding reaches its limit, for constant currents.

    Args:
        design: the motor and its cooling.
        currents: A, shape (n,).
    """
    option = design.option
    limit = option.limits.get("winding", option.motor.limits.winding or ENAMEL_LIMIT)
    simulator, task = Simulator(option, design.sink, "current"), option.study.task
    n, hardest = currents.size, float(currents.max())
    # Short steps at first: a winding at many times its rating warms within a second.
    first, growth = 0.02, 1.02
    growing = ceil(log1p(task.longest / first * (growth - 1)) / log(growth))  # steps, a geometric sum
    if simulator.is_stiff(task.longest, growing, hardest):
        advance, step = simulator.advance_implicitly, task.longest
    else:
        advance, step = simulator.advance, task.longest / simulator.substeps(task.longest, hardest)
    x = np.full((len(simulator.plant.states), n), task.start)
    time, reached = 0.0, np.full(n, np.inf)
    h = min(step, first)
    while time < task.longest and np.isinf(reached).any():
        before = simulator.winding(x)
        x = advance(x, currents, h)
        after = simulator.winding(x)
        crossed = np.isinf(reached) & (after >= limit)
        reached[crossed] = time + h * ((limit - before[crossed]) / (after[crossed] - before[crossed]))
        time += h
        h = min(step, h * growth)
    return LimitCurve(option.name, limit, currents, reached)


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
    usual = 10.0, 30.0, 60.0, 180.0, 600.0, 1800.0, 3600.0  # s
    durations = np.array([0.0, *(time for time in usual if time < study.task.longest), study.task.longest, np.inf])
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
