"""Load sharing against equal sharing: a quadruped stands with 4 kg in three postures until its first joint is hot.

The planner's model is the preset `quadruped` as it stands; the truth is another robot, `lptn.virtual`'s, with windings
and housings apart, radiation and a trunk. Where MuJoCo and the A1's URDF are installed they confirm the statics.

    python -m tests.benchmarks.load_sharing
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

from lptn.applications.load_sharing import LoadSharing, Sharing, Stance, load_body, statics
from lptn.basics.arrays import FloatArray
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.robots.presets import preset_text
from lptn.virtual import Balance, Robot, draw_quadruped
from lptn.virtual import Forcing as Drive

LIMIT, AMBIENT, LOAD, COMPUTER = 60.0, 25.0, 4.0, 16.0  # degC, degC, kg, W
LONGEST, SEEDS = 5400, (0, 1, 2)  # s
METHODS = ("equal", "least_torque", "share")


def postures() -> dict[str, Stance]:
    """Standing tall, crouching, and nose down with the load over the front legs."""
    tall, crouch = (Stance(np.tile([0.0, thigh, -2 * thigh], 4), load=LOAD) for thigh in (0.7, 1.15))
    nose = Stance([0.0, 1.15, -2.3] * 2 + [0.0, 0.75, -1.5] * 2, load=LOAD,
                  load_at=(0.08, 0.0, 0.1))  # fmt: skip
    return {"tall": tall, "crouching": crouch, "nose down": on_the_level(nose)}


def on_the_level(stance: Stance) -> Stance:
    """The same posture with the trunk so pitched that front and rear feet are on level ground."""
    legs = zip(load_body().legs, np.reshape(stance.angles, (-1, 3)), strict=True)
    feet = [leg.statics(angles, [0.0, 0.0, 1.0], 0.0)[0].full().ravel() for leg, angles in legs]
    ahead = (feet[0] + feet[1] - feet[2] - feet[3]) / 2
    return replace(stance, pitch=float(np.arctan2(ahead[2], ahead[0])))


def true_time(robot: Robot, torques: FloatArray) -> float:
    """When the first joint's sensor is at the limit [s], in the virtual robot; infinite where none gets there."""
    network, joints = Balance(robot, AMBIENT), robot.joints
    copper = np.zeros(len(robot.nodes))
    copper[:joints] = robot.resistance[:joints] * (torques / robot.torque_constant[:joints]) ** 2
    other = robot.constant + robot.drive * (robot.winding == 0)
    other[robot.nodes.index("pc")] += COMPUTER
    other = np.concatenate([other, robot.drive[robot.winding > 0]])
    held = (np.tile(constant, (LONGEST, 1)) for constant in (copper, other, robot.to_air))
    path = network.solve(Drive(*held), network.start(np.full(len(robot.nodes), AMBIENT)))
    hottest = path[:, network.sensed[:joints]].max(axis=1)
    over = np.flatnonzero(hottest >= LIMIT)
    if over.size == 0:
        return float("inf")
    k = int(over[0])
    return float(k - 1 + (LIMIT - hottest[k - 1]) / (hottest[k] - hottest[k - 1]))


def in_mujoco(stance: Stance, found: Sharing) -> str:
    """What MuJoCo says of a sharing: inverse dynamics at rest, and a second of standing on a floor."""
    try:
        from tests.benchmarks.load_sharing_stand import at_rest, stands
    except ModuleNotFoundError as error:
        return f"not confirmed: {error}"
    trunk, torques = at_rest(replace(stance, load=0.0), found.forces)
    bare = statics(load_body(), replace(stance, load=0.0))
    left = bare.weight - bare.balance @ found.forces.ravel()
    forces, applied = stands(stance, found.torques)
    return (
        f"at rest: torques to {np.abs(torques - found.torques).max():.1e} N·m, trunk to "
        f"{np.abs(trunk - left).max():.1e} N; standing: forces to {np.abs(forces - found.forces).max():.2f} N, "
        f"torques to {np.abs(applied - found.torques).max():.2f} N·m"
    )


def main() -> None:
    """Print times to the limit, and what MuJoCo makes of the forces."""
    model = Model(parse_model(preset_text("quadruped"), Path("quadruped.toml")).network)
    sharing = LoadSharing(model, load_body("a1"), {"*_*": LIMIT}, ambient=AMBIENT, inputs={"power.pc": COMPUTER})
    robots = [draw_quadruped(seed, "full") for seed in SEEDS]
    for name, stance in postures().items():
        print(f"{name}: pitch {np.degrees(stance.pitch):.1f} degrees, load at {stance.load_at}")
        base: list[float] = []
        for how in METHODS:
            began = perf_counter()
            result: Sharing = getattr(sharing, how)(stance, AMBIENT)
            took = perf_counter() - began
            times = [true_time(robot, result.torques) for robot in robots]
            base = base or times
            gains = [100 * (time / peer - 1) for time, peer in zip(times, base, strict=True)]
            print(
                f"  {how:12s} model {result.time:6.0f} s ({result.first}), truth "
                f"{' '.join(f'{time:6.0f}' for time in times)} s = {' '.join(f'{gain:+5.1f}' for gain in gains)} %; "
                f"knees {' '.join(f'{t:.2f}' for t in result.torques[2::3])} N·m, grip {result.grip:.2f}; {took:.2f} s"
            )
        print(f"  MuJoCo, share: {in_mujoco(stance, result)}")


if __name__ == "__main__":
    main()
