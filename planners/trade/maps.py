"""The highest winding temperature over (C, R) of the sink, and the time to the limit over the current."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lptn.arrays import FloatArray
from lptn.errors import InputError

from .designs import Design
from .replay import Simulator
from .study import Option

_LEAST_STEPS = 200


@dataclass(frozen=True)
class IsoMap:
    """Highest winding temperature [degC] over capacity [J/K] (n,) and resistance [K/W] (m,), shape (m, n)."""

    option: Option
    capacity: FloatArray
    resistance: FloatArray
    winding: FloatArray
    torque: float
    duration: float


@dataclass(frozen=True)
class LimitCurve:
    """Time [s] until the winding reaches its limit [degC] at each constant current [A]; infinite for never."""

    name: str
    limit: float
    current: FloatArray
    time: FloatArray


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
    capacity = np.geomspace(*study.sink.capacity, points)
    resistance = np.geomspace(*study.sink.resistance, points)
    every_c, every_r = (grid.ravel() for grid in np.meshgrid(capacity, resistance))
    peaks = peak_temperatures(option, every_c, every_r, np.full(every_c.size, design.torque), design.duration)
    return IsoMap(option, capacity, resistance, peaks.reshape(points, points), design.torque, design.duration)


def peak_temperatures(
    option: Option, capacity: FloatArray, resistance: FloatArray, torque: FloatArray, duration: float
) -> FloatArray:
    """Highest winding temperature [degC] of many designs under a study's task, shape as given.

    Of a cycle that repeats for ever it is the mean over the cycle, from the RMS torque; infinite where it runs away.
    """
    simulator, task = Simulator(option), option.study.task
    if task.cycles is None:
        rms = torque * np.sqrt(np.mean(task.shape**2))
        return np.asarray(simulator.steady(rms, capacity, resistance)[simulator.winding])
    n, part = capacity.size, duration / len(task.shape)
    x = np.full((len(simulator.plant.states), n), task.start)
    hottest = x[simulator.winding].copy()
    stiffest = simulator.substeps(part, float(capacity.min()), float(resistance.min()), float(torque.max()))
    steps = max(stiffest, _LEAST_STEPS if task.hold else 2)
    h = np.full(n, part / steps)
    for share in np.tile(task.shape, task.cycles):
        for _ in range(steps):
            x = simulator.advance(x, torque * share, capacity, resistance, h)
            hottest = np.maximum(hottest, x[simulator.winding])
    return np.asarray(hottest)


def limit_curves(design: Design, currents: FloatArray) -> LimitCurve:
    """Time from the start until the winding reaches its limit, for constant currents.

    Args:
        design: the motor and its cooling.
        currents: A, shape (n,).
    """
    option = design.option
    limit = option.limits.get("winding", option.motor.limits.get("winding", 105.0))
    simulator, task = Simulator(option, "current"), option.study.task
    n = currents.size
    one = np.ones(n)
    capacity, resistance = (design.capacity or 1.0) * one, (design.resistance or 1.0) * one
    step = task.longest / simulator.substeps(task.longest, capacity[0], resistance[0], float(currents.max()))
    x = np.full((len(simulator.plant.states), n), task.start)
    time, reached = 0.0, np.full(n, np.inf)
    h = min(step, 0.02)
    while time < task.longest and np.isinf(reached).any():
        before = x[simulator.winding]
        x = simulator.advance(x, currents, capacity, resistance, h * one)
        after = x[simulator.winding]
        crossed = np.isinf(reached) & (after >= limit)
        reached[crossed] = time + h * ((limit - before[crossed]) / (after[crossed] - before[crossed]))
        time += h
        h = min(step, h * 1.02)
    return LimitCurve(option.name, limit, currents, reached)
