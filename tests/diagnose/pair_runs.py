"""A model of two joints, and runs of it drawn by hand."""

from __future__ import annotations

import numpy as np
import pandas as pd

from lptn.logs.run import Run

MODEL = """
[model]
name = "pair"
ambient = "temperature.ambient"

[nodes.a]
capacity = 300

[nodes.b]
capacity = 300

[[links]]
between = ["*", "ambient"]
resistance = 3

[[effects]]
kind = "copper_loss"
at = "*"
resistance = 0.15
"""


def table(minutes: int = 40, *, cool: bool = True, speed: float = 0.8, apart: float = 10.0) -> pd.DataFrame:
    """Two joints at 1 Hz: rest, two loads, and rest again; temperatures drawn by hand, with noise."""
    n = 60 * minutes
    time = np.arange(float(n))
    share = time / n
    torque = np.select([share < 0.1, share < 0.4, share < 0.7], [0.0, 6.0, 10.0], 0.0 if cool else 10.0)
    warm = np.interp(share, [0, 0.1, 0.7, 1.0], [22, 22, 52, 35 if cool else 60])
    noise = np.random.default_rng(0).normal(0, 0.05, (2, n))
    return pd.DataFrame(
        {
            "time": time,
            "temperature.a": warm + noise[0],
            "temperature.b": warm + apart * (warm - 22) / 30 + noise[1],
            "temperature.ambient": 22.0,
            "torque.a": torque,
            "torque.b": torque[::-1],
            "velocity.a": np.where(torque > 0, 3.0, 0.0) + 2.0 * (share > 0.5),
            "velocity.b": 2.0 + np.sin(time / 200),
            "speed.base": np.where(torque > 0, speed, 0.0),
        }
    )


def run(data: pd.DataFrame, name: str = "log") -> Run:
    """The table as a run, with what a reader would derive from torque and velocity."""
    columns = {str(column): data[column].to_numpy(float) for column in data if column != "time"}
    for joint in "ab":
        if f"velocity.{joint}" in columns and f"torque.{joint}" in columns:
            columns[f"velocity_rms.{joint}"] = np.abs(columns[f"velocity.{joint}"])
            columns[f"mechanical_power.{joint}"] = columns[f"velocity.{joint}"] * columns[f"torque.{joint}"]
    return Run(name, 1.0, data["time"].to_numpy(float), columns, True, f"{name}.csv", name)
