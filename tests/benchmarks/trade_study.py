"""How long a trade study takes, and a search over a 200 × 200 grid for the same answer.

`python -m tests.benchmarks.trade_study` from the repository; half a minute. Both searches look only at what can be
built; the second shares no code with the model. Times are CPU seconds of one thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.planners.trade import DesignProblem, Option, load_study, solve_study
from lptn.planners.trade.designs import peak_temperatures
from tests.cooling import plain_sink as plain

CELLS, DURATION, LIMIT = 200, 120.0, 105.0
MASS, VOLUME = 0.55, 450e-6  # kg, m³
STUDY = Path(__file__).parents[2] / "examples" / "u8_trade" / "held_torque.toml"
Result = TypeVar("Result")


def timed(work: Callable[[], Result]) -> tuple[Result, float]:
    """What it returns, and its CPU seconds."""
    begun = time.process_time()
    result = work()
    return result, time.process_time() - begun


def grid() -> tuple[FloatArray, FloatArray]:
    """The (C, R) of the grid that mass, volume and fins allow."""
    c, r = (axis.ravel() for axis in np.meshgrid(np.geomspace(20, 1500, CELLS), np.geomspace(0.05, 10, CELLS)))
    fins, package = plain.fins_and_volume(c, r)
    inside = (fins <= 1) & (plain.mass(c) <= MASS) & (package <= VOLUME)
    return c[inside], r[inside]


def by_the_model(option: Option, c: FloatArray, r: FloatArray) -> FloatArray:
    """Held torque of each design by bisection over the model's own simulation."""
    low, high = np.full(c.size, 1.5), np.full(c.size, 2.0)
    for _ in range(20):
        middle = (low + high) / 2
        fits = peak_temperatures(option, c, r, middle, DURATION) <= LIMIT
        low, high = np.where(fits, middle, low), np.where(fits, high, middle)
    return low


def main() -> None:
    """Print the times and the answers."""
    study = load_study(STUDY)
    option = next(offered for offered in study.options() if offered.name == "U8, passive")
    problem, build = timed(lambda: DesignProblem(option))
    optimum, cold = timed(problem.solve)
    moved, warm = timed(lambda: problem.solve({"limit.mass": 0.6}, near=optimum))
    whole, all_choices = timed(lambda: solve_study(study))
    c, r = grid()
    grids = {
        "200 × 200 grid, the model": timed(lambda: by_the_model(option, c, r)),
        "200 × 200 grid, plain NumPy": timed(lambda: plain.held_torque(c, r, DURATION, LIMIT)),
    }
    print(f"one program: built {1e3 * build:.0f} ms, solved {1e3 * cold:.0f} ms, again nearby {1e3 * warm:.0f} ms")
    print(f"  {optimum.value:.6f} N·m at C = {optimum.capacity:.2f} J/K, ", end="")
    print(f"R = {optimum.resistance:.4f} K/W; at 600 g {moved.value:.6f} N·m")
    print(f"whole study, {len(study.options())} choices and the front: {all_choices:.1f} s, {len(whole.front)} points")
    for name, (torque, seconds) in grids.items():
        best = int(torque.argmax())
        print(f"{name}: {seconds:.1f} s for the {c.size} that can be built, ", end="")
        print(f"{seconds / (build + cold):.0f} times the program with its building, {seconds / cold:.0f} without")
        print(f"  {torque[best]:.6f} N·m at C = {c[best]:.2f} J/K, R = {r[best]:.4f} K/W")


if __name__ == "__main__":
    main()
