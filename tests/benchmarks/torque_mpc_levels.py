"""How often `TorqueMPC` passes a limit, beside the level that it was told.

Run it with ``python -m tests.benchmarks.torque_mpc_levels --hours 20``: for each level so many hours in closed loop,
half an hour a robot. The robot is one of `lptn.virtual`, every parameter of its model is 20 % off, up or down; it
is told an ambient that is up to 10 K wrong; readings are rounded to 1 K, or have noise of 0.1 or 0.5 K, and the
controller is told which.

Counted are joints and control periods in which the plan holds the joint at its limit (its planned temperature is
within 0.02 K of it, the margin off, or above that): the share of them that were truly above the limit at the period's
end, how far at worst, and the share of all joints and periods. Since noise below a limit is followed in minutes, those
at the limit are the hot end of what it leaves open: the level is to hold there all the same.

``--smoothing 50`` lets shares rise with that time constant. The last two columns are what it is for, and what it costs:
under a heavy request that stays the same for half an hour, the standard deviation of a joint's torque about its mean of
two minutes; and the squares of what was not given over those of what was asked, in the changing tasks.
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
_HEAVY, _SETTLED, _MEAN = 2.0, 120, 24  # times the tasks' RMS; periods until it is warm, and over which means are taken
_WANDERS, _SERVED = 4, 0.98  # robots whose ripple is looked at, at most; share of its request that is nearly all of it


def loop(
    seed: int, level: float, noise: float, resolution: float, smoothing: float = 0.0, *, constant: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Half an hour of one robot.

    Returns:
        Kelvins above the limit at each period's end, whether the plan held the joint at its limit, torque asked for and
        torque admitted [N·m], each of shape (360, 12).
    """
    random, robot = np.random.default_rng(seed), true_robot(seed)
    mpc = TorqueMPC(
        model_of(robot, _ERROR, seed),
        LIMITS,
        request="torque",
        level=level,
        noise=noise,
        resolution=resolution,
        smoothing=smoothing,
    )
    around = conditions(mpc.conditions)
    around[mpc.conditions.index("temperature.ambient")] += random.uniform(-_AMBIENT, _AMBIENT)
    world, asked = World(robot, random.uniform(30, 58), noise, seed), activity(seed, _PERIODS + STAGES)
    if constant:
        asked[:] = _HEAVY * np.sqrt(np.mean(asked**2, axis=0))
    over, held, given = np.empty((_PERIODS, 12)), np.empty((_PERIODS, 12), dtype=bool), np.empty((_PERIODS, 12))
    for k in range(_PERIODS):
        read = world.read()
        if resolution:
            read = resolution * np.round(read / resolution)
        plan = mpc.step(read, asked[k], around)
        given[k] = plan.admitted
        over[k] = world.step(plan.admitted, PERIOD)[-1, :12] - LIMIT
        held[k] = plan.temperatures[:12, 1] > LIMIT - plan.margin - _HELD
    return over, held, asked[:_PERIODS], given


def ripple(seed: int, level: float, noise: float, resolution: float, smoothing: float) -> float:
    """Standard deviation of torque about its mean of two minutes, over it, of joints that do not get all."""
    _, _, asked, given = loop(seed, level, noise, resolution, smoothing, constant=True)
    asked, given = asked[_SETTLED:], given[_SETTLED:]
    means = given.reshape(-1, _MEAN, 12).mean(axis=1)
    about = given / np.repeat(means, _MEAN, axis=0) - 1
    return float(about[:, given.mean(axis=0) < _SERVED * asked.mean(axis=0)].std())


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--smoothing", type=float, default=0.0)
    parser.add_argument("--levels", type=float, nargs="+", default=LEVELS)
    parser.add_argument("--sensors", nargs="+", choices=SENSORS, default=list(SENSORS))
    arguments = parser.parse_args()
    robots = max(1, round(2 * arguments.hours))
    print(
        f"{'sensors':14} {'level':>6} {'hours':>6} {'may pass':>9} {'at limit':>9} {'of all':>8} {'worst K':>8}"
        f" {'ripple':>7} {'tracking':>9}"
    )
    for name in arguments.sensors:
        noise, resolution = SENSORS[name]
        for level in arguments.levels:
            runs = [
                loop(arguments.seed + number, level, noise, resolution, arguments.smoothing) for number in range(robots)
            ]
            over, held, asked, given = (np.concatenate(parts) for parts in zip(*runs, strict=True))
            wander = [
                ripple(arguments.seed + number, level, noise, resolution, arguments.smoothing)
                for number in range(min(robots, _WANDERS))
            ]
            cost = float(((asked - given) ** 2).sum() / (asked**2).sum())
            passed = over > 0
            at = passed[held].mean() if held.any() else np.nan
            print(
                f"{name:14} {level:6.0%} {robots / 2:6g} {1 - level:9.1%} {at:9.2%} {passed.mean():8.2%} "
                f"{over.max():8.3f} {np.mean(wander):7.2%} {cost:9.4f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
