"""Two motors in still air whose temperatures are known in closed form, with the model file of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

AIR, CAPACITY, RESISTANCE, PER_TORQUE = 22.0, 300.0, 5.0, 0.15 / 0.84**2  # degC, J/K, K/W, W/(N m)^2
MODEL = f"""
[model]
name = "two motors"
ambient = "temperature.ambient"

[nodes.knee]
capacity = {CAPACITY}

[nodes.hip]
capacity = {CAPACITY}

[[links]]
between = ["*", "ambient"]
resistance = {RESISTANCE}

[[effects]]
kind = "copper_loss"
at = "*"
resistance = 0.15
torque_constant = 0.84

[fit]
rmse = 0.1
"""
TORQUES = {"knee": (9.0, 3.0), "hip": (4.0, 10.0)}  # N m, before and behind the middle of a log


def model_file(folder: Path, more: str = "", step: float | None = None) -> Path:
    """The model file, with more behind it, or of another step [s]."""
    path = folder / "motors.toml"
    text = MODEL if step is None else MODEL.replace("[model]", f"[model]\nstep = {step}", 1)
    path.write_text(text + more)
    return path


def log(seconds: int = 600, rate: float = 1.0, noise: float = 0.05, seed: int = 0) -> pd.DataFrame:
    """Both motors from the air's temperature on: torques that alternate in sign, exact temperatures, and noise."""
    time = np.arange(round(seconds * rate)) / rate
    columns = {"time": time, "temperature.ambient": np.full(time.size, AIR)}
    rng, fading = np.random.default_rng(seed), np.exp(-1 / rate / (RESISTANCE * CAPACITY))
    for joint, (first, second) in TORQUES.items():
        size = np.where(time < seconds / 2, first, second)
        columns[f"torque.{joint}"] = size * np.where(np.arange(time.size) % 2, 1.0, -1.0)
        settled = AIR + RESISTANCE * PER_TORQUE * size**2
        temperature = np.full(time.size, AIR)
        for k in range(1, time.size):
            temperature[k] = settled[k - 1] + (temperature[k - 1] - settled[k - 1]) * fading
        columns[f"temperature.{joint}"] = temperature + noise * rng.standard_normal(time.size)
    return pd.DataFrame(columns)


FIT = """
[fit.standard_errors]
"capacity.knee" = 3.0
"capacity.hip" = 3.0
"resistance.ambient~knee" = 0.03
"resistance.ambient~hip" = 0.03
"""
STEP = 5.0  # s


def worn(seconds: int, since: float, resistance: float, seed: int = 0) -> pd.DataFrame:
    """Both motors under loads that change every few minutes; from a time on the knee's loss is that of another
    resistance."""
    time, rng = np.arange(0.0, seconds, STEP), np.random.default_rng(seed)
    columns = {"time": time, "temperature.ambient": np.full(time.size, AIR)}
    for joint, most in (("knee", 7.8), ("hip", 6.5)):
        loads = np.repeat(rng.uniform(0.4, 1.0, time.size // 40 + 1), 40)[: time.size]
        torque = most * loads
        temperature = np.full(time.size, AIR)
        for k in range(1, time.size):
            own = resistance if joint == "knee" and time[k] > since else RESISTANCE
            settled = AIR + own * PER_TORQUE * torque[k - 1] ** 2
            temperature[k] = settled + (temperature[k - 1] - settled) * np.exp(-STEP / (own * CAPACITY))
        columns[f"torque.{joint}"] = torque
        columns[f"temperature.{joint}"] = temperature + 0.05 * rng.standard_normal(time.size)
    return pd.DataFrame(columns)
