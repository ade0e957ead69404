"""What the thesis's one-node circuit lacks: logs of a consistent network, its circuit as baseline, `lptn` asked why.

`python examples/u8_thesis/missing_mass.py FOLDER` writes the logs and the improved model there and prints the steps.
The logs come from `scipy.integrate.solve_ivp` on the two-node network that meets the thesis's unaltered facts.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from circuits import ALPHA, AMBIENT, RESISTANCE
from scipy.integrate import solve_ivp

from lptn.diagnose.improvement import History, improve
from lptn.identify.data import load_model, split_data

C_W, R_WH, C_H, R_HA = 56.8, 2.107, 246.0, 0.869  # J/K, K/W; `facts.fit_two_nodes` on the unaltered motor
NOISE = 0.15  # K
Steps = Sequence[tuple[float, float]]  # duration [s], current [A]
FITTED: Steps = ((120, 11.0), (900, 0.0), (50, 15.0), (600, 0.0), (300, 6.0), (400, 8.0), (600, 0.0))
"""The thesis's protocol (11 A to 55 degC, cool down), a run at 15 A, two at 6 and 8 A."""
HELD_OUT: Steps = ((200, 0.0), *((1, 35.0), (29, 0.0)) * 12, (600, 0.0), (240, 9.5), (600, 0.0))
"""Rest, so that the start is known; the thesis's application, 35 A for 1 s at a time; then one heating."""


def truth(steps: Steps, seed: int) -> pd.DataFrame:
    """A log of winding temperature [degC] at 1 s, with the sensor's noise."""

    def rates(_: float, x: np.ndarray, current: float) -> list[float]:
        loss = current**2 * RESISTANCE * (1 + ALPHA * x[0])
        inward = (x[0] - x[1]) / R_WH
        return [(loss - inward) / C_W, (inward - x[1] / R_HA) / C_H]

    state, temperatures, currents = np.zeros(2), [], []
    for duration, current in steps:
        times = np.arange(0.0, duration + 0.5)
        path = solve_ivp(rates, (0.0, duration), state, args=(current,), t_eval=times, rtol=1e-9, atol=1e-9).y
        temperatures.append(path[0, :-1])
        currents.append(np.full(int(duration), current))
        state = path[:, -1]
    rise = np.concatenate(temperatures)
    read = AMBIENT + rise + NOISE * np.random.default_rng(seed).standard_normal(rise.size)
    columns = {"temperature.winding": read, "current.winding": np.concatenate(currents)}
    return pd.DataFrame({"time": np.arange(float(rise.size)), **columns, "temperature.ambient": AMBIENT})


def write_logs(folder: Path) -> None:
    """`fit.csv` and `holdout.csv`."""
    for name, steps, seed in (("fit", FITTED, 1), ("holdout", HELD_OUT, 2)):
        truth(steps, seed).to_csv(folder / f"{name}.csv", index=False)


def ask(folder: Path) -> History:
    """The steps from the thesis's structure, found on the logs in a folder as `lptn improve` finds them."""
    loaded = load_model(Path(__file__).parent / "one_node.toml")
    runs, held = (loaded.runs([folder / f"{name}.csv"]) for name in ("fit", "holdout"))
    history = improve(loaded.model, split_data(runs, held))
    better = loaded.file.with_effects(history.declarations()).with_fit(history.best.fit.table())
    better.write(folder / "better.toml")
    return history


def main(folder: Path) -> None:
    """Write, ask, print."""
    write_logs(folder)
    print(ask(folder))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
