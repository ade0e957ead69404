"""A fleet of single motors as ground truth: one mass each, solved by hand, logs as CSV."""

from __future__ import annotations

from pathlib import Path

import numpy as np

MODEL = """
[model]
name = "motor"
ambient = "temperature.ambient"

[nodes.motor]
capacity = { value = 300, unit = "J/K", bounds = [20, 3000] }

[[links]]
between = ["motor", "ambient"]
resistance = { value = 8, unit = "K/W", bounds = [0.2, 200] }

[[effects]]
kind = "copper_loss"
at = "motor"
input = "torque"
resistance = 0.15
torque_constant = 0.84
"""
CAPACITY, RESISTANCE = 420.0, 5.0  # J/K, K/W: the fleet's medians
_WINDING, _GAIN = 0.15, 0.84  # ohm, N·m/A
_STEP, _HOLD = 4.0, 60  # s; steps that each torque is held


def write_log(path: Path, seed: int, *, capacity: float = CAPACITY, resistance: float = RESISTANCE) -> None:
    """24 min of random loads: between steps of the load the temperature goes to its balance exponentially."""
    rng = np.random.default_rng(seed)
    torque = rng.uniform(0.0, 12.0, 6).repeat(_HOLD)
    air, decay = 20.0 + rng.uniform(-3, 3), np.exp(-_STEP / (capacity * resistance))
    temperature = np.empty(len(torque))
    now = air
    for number, load in enumerate(torque):
        temperature[number] = now
        balance = air + resistance * _WINDING * (load / _GAIN) ** 2
        now = balance + (now - balance) * decay
    temperature += rng.normal(0.0, 0.05, len(torque))
    rows = zip(_STEP * np.arange(len(torque)), temperature, torque, strict=True)
    lines = [f"{t:g},{reading:.4f},{load:.5f},{air:.3f}" for t, reading, load in rows]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("time,temperature.motor,torque.motor,temperature.ambient\n" + "\n".join(lines) + "\n")


def write_fleet(folder: Path, robots: int, bad: int | None = None, odd: int | None = None) -> list[Path]:
    """Logs of so many robots; one of them broken off in a row's middle, one with a resistance three times as large."""
    logs = []
    for number in range(robots):
        rng = np.random.default_rng(1000 + number)
        capacity, resistance = CAPACITY * np.exp(0.05 * rng.normal()), RESISTANCE * np.exp(0.05 * rng.normal())
        log = folder / f"robot_{number:03}.csv"
        write_log(log, number, capacity=capacity, resistance=resistance * (3.0 if number == odd else 1.0))
        logs.append(log)
    if bad is not None:
        logs[bad].write_text(logs[bad].read_text()[:2000] + ",,oh no\n")
    return logs
