"""How often `TorqueMPC` passes a limit, beside the level that it was told.

Run it with ``python -m tests.benchmarks.torque_mpc_levels --hours 20``: for each level so many hours in closed loop,
half an hour a robot. The robot is one of `lptn.virtual`, every parameter of its model is 20 % off, up or down; it
is told an ambient that is up to 10 K wrong; readings are rounded to 1 K, or have noise of 0.1 or 0.5 K, and the
controller is told which.

Counted are joints and control periods in which the plan holds the joint at its limit (its planned temperature is
within 0.02 K of it, the margin off, or above that): the share of them that were truly above the limit at the period's
end, how far at worst, and the share of all joints and periods.
"""

from __future__ import annotations

import argparse

import numpy as np

from lptn.planners.mpc import TorqueMPC
from tests.benchmarks.torque_mpc import LIMIT, LIMITS, PERIOD, STAGES, activity
from tests.planners.truth import World, conditions, model_of, true_robot

LEVELS = (0.80, 0.95, 0.99)
SENSORS = {"1 K steps": (0.1, 1.0), "noise 0.1 K": (0.1, 0.0), "noise 0.5 K": (0.5, 0.0)}
_PERIODS, _ERROR, _AMBIENT, _HELD = 360, 0.2, 10.0, 0.02  # half an hour; relative; K; K


def loop(seed: int, level: float, noise: float, resolution: float) -> tuple[np.ndarray, np.ndarray]:
    """Half an hour of one robot.

    Returns:
        Kelvins above the limit at each period's end, and whether the plan held the joint at its limit, shape (360, 12).
    """
    random, robot = np.random.default_rng(seed), true_robot(seed)
    mpc = TorqueMPC(
        model_of(robot, _ERROR, seed), LIMITS, request="torque", level=level, noise=noise, resolution=resolution
    )
    around = conditions(mpc.conditions)
    around[mpc.conditions.index("temperature.ambient")] += random.uniform(-_AMBIENT, _AMBIENT)
    world, asked = World(robot, random.uniform(30, 58), noise, seed), activity(seed, _PERIODS + STAGES)
    over, held = np.empty((_PERIODS, 12)), np.empty((_PERIODS, 12), dtype=bool)
    for k in range(_PERIODS):
        read = world.read()
        if resolution:
            read = resolution * np.round(read / resolution)
        plan = mpc.step(read, asked[k], around)
        over[k] = world.step(plan.admitted, PERIOD)[-1, :12] - LIMIT
        held[k] = plan.temperatures[:12, 1] > LIMIT - plan.margin - _HELD
    return over, held


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=100)
    told = parser.parse_args()
    robots = max(1, round(2 * told.hours))
    print(f"{'sensors':14} {'level':>6} {'hours':>6} {'may pass':>9} {'at limit':>9} {'of all':>8} {'worst K':>8}")
    for name, (noise, resolution) in SENSORS.items():
        for level in LEVELS:
            runs = [loop(told.seed + number, level, noise, resolution) for number in range(robots)]
            over, held = (np.concatenate(parts) for parts in zip(*runs, strict=True))
            passed = over > 0
            at = passed[held].mean() if held.any() else np.nan
            print(
                f"{name:14} {level:6.0%} {robots / 2:6g} {1 - level:9.1%} {at:9.2%} {passed.mean():8.2%} "
                f"{over.max():8.3f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
