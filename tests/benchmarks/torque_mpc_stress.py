"""Whether `TorqueMPC` ever gives up: closed loops over random robots, settings, starts, warm starts and requests.

Run it with ``python -m tests.benchmarks.torque_mpc_stress --steps 10000``. Each robot is one of `lptn.virtual`, its
model up to 30 % off; horizon, period, number of stages, recovery, floors, rates, weights and current limits are drawn
anew. Within a loop requests jump (to nothing, to ten times, to another posture, stage by stage), temperatures jump,
readings go missing, and one step in ten begins from a warm start that has nothing to do with the problem.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.planners.mpc import TorqueMPC
from tests.planners.truth import World, conditions, model_of, true_robot

LIMIT, LOOP = 60.0, 50  # degC; steps of one closed loop
_STAGES = (8, 16, 40)
_LEVELS = np.array([[5, 9, 12], [7, 12, 18], [6, 14, 15], [2, 5, 9], [20, 30, 33]], dtype=float)  # N*m


def controller(random: np.random.Generator, seed: int) -> TorqueMPC:
    """A controller with settings at random, of a robot that is not quite its model."""
    period = float(random.choice([1, 2, 5, 10]))
    recovery = float(random.choice([0, 30, 120]))
    return TorqueMPC(
        model_of(true_robot(seed), random.uniform(0, 0.3), seed),
        {"*_*": LIMIT, **({"FR_*": 50.0} if random.random() < 0.3 else {})},
        request="torque",
        period=period,
        horizon=period * random.uniform(10, 120),
        stages=int(random.choice(_STAGES)),
        rates=float(random.choice([0, 0, 0.5, 5])),
        weights={"*": 1.0, "FL_*": float(random.choice([1, 1, 10, 1000]))},
        current_limits=float(random.choice([np.inf, 25, 40])),
        floors={"*": 0.0, "RR_*": float(random.choice([0, 0, 3, 15]))},
        noise=float(random.choice([0.02, 0.1, 0.3])),
        **({"recovery": recovery} if random.random() < 0.7 else {}),
    )  # fmt: skip


def request_of(random: np.random.Generator, stages: int) -> FloatArray:
    """RMS torques of each stage [N*m], shape (stages, 12)."""
    level = np.tile(_LEVELS[random.integers(len(_LEVELS))], 4) * random.uniform(0.8, 1.2, 12)
    kind = random.random()
    if kind < 0.6:
        return np.tile(level, (stages, 1))
    if kind < 0.7:
        return np.tile(level * (random.random(12) < 0.5), (stages, 1))
    if kind < 0.8:
        return np.tile(level * 10 ** random.uniform(-3, 1, 12), (stages, 1))
    return np.asarray(level * random.uniform(0, 2, (stages, 12)) * (random.random((stages, 12)) < 0.8))


def stress(steps: int, seed: int, *, loud: bool = True) -> tuple[list[int], int, int]:
    """Closed loops until so many steps are done.

    Returns:
        Iterations of each step that was solved, steps that were given up, steps in all.
    """
    iterations, given_up, done, robot_seed = list[int](), 0, 0, seed
    while done < steps:
        robot_seed += 1
        random = np.random.default_rng(robot_seed)
        mpc = controller(random, robot_seed)
        low, high = ((20, 60), (55, 62), (50, 75), (20, 120))[random.integers(4)]
        world = World(true_robot(robot_seed), random.uniform(low, high, 13), 0.1, robot_seed)
        count, around = len(mpc.settings.stages), conditions(mpc.conditions)
        asked = request_of(random, count)
        for k in range(min(LOOP, steps - done)):
            if random.random() < 0.1:
                asked = request_of(random, count)
            if random.random() < 0.02:
                world.temperature = random.uniform(low, high, world.temperature.shape)
            if random.random() < 0.1:
                for row in mpc._state.scale:
                    row[:] = random.choice([0.0, 1e-3, 1.0, random.random()], 12).tolist()
            read = world.read()
            read[random.random(len(read)) < 0.01] = np.nan
            plan = mpc.step(read, asked, around)
            if not plan.full:
                iterations.append(plan.iterations)
            if not plan.converged:
                given_up += 1
                if loud:
                    print(f"robot {robot_seed}, step {k}: {plan.iterations} iterations, given up", flush=True)
            world.step(plan.admitted, max(1, round(mpc.settings.stages[0])))
            done += 1
    return iterations, given_up, done


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1000)
    arguments = parser.parse_args()
    before = time.process_time()
    iterations, given_up, done = stress(arguments.steps, arguments.seed)
    spent = time.process_time() - before
    counts = np.array(iterations)
    print(f"{done} steps, {len(counts)} of them solved ({spent:.0f} s of CPU), {given_up} given up")
    print(f"iterations: median {np.median(counts):.0f}, 99 % {np.quantile(counts, 0.99):.0f}, worst {counts.max()}")
    slowest = Counter(int(count) for count in counts if count > 40)
    print("above 40: " + (", ".join(f"{count} x {times}" for count, times in sorted(slowest.items())) or "none"))


if __name__ == "__main__":
    main()
