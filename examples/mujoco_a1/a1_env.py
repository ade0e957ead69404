"""The Unitree A1 as a gymnasium environment: joint angles are asked 50 times a second, forward speed is paid for.

A body for `lptn.applications.gym.ThermalWrapper`, no tuned benchmark. `python examples/mujoco_a1/a1_env.py` checks it
and counts steps per second beside MuJoCo's own.
"""

from __future__ import annotations

import time
import warnings
from typing import Any

import gymnasium
import mujoco
import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from a1_robot import TIME_STEP, OneNode, build
from a1_task import JOINTS, TORQUE_LIMIT
from a1_thermal import quadruped
from lptn.applications.gym import ThermalWrapper, mujoco_columns

STEPS = 10  # of MuJoCo a step of the environment: 50 a second
SECONDS = 10.0  # an episode
POSTURE = np.array([0.0, 0.9, -1.8] * 4)  # rad
REACH = 0.5  # rad, how far an action moves a joint's target from the posture
STIFFNESS, DAMPING = 60.0, 1.5  # N·m/rad, N·m·s/rad
HEIGHT, LOWEST = 0.28, 0.15  # m, of the base: where it begins, and where it has fallen
WANTED = 0.5  # m/s

Array = npt.NDArray[np.float64]


class A1Env(gymnasium.Env[Array, npt.NDArray[np.float32]]):
    """A walking robot.

    *Action*: joints' targets about a standing posture, -1 to 1. *Observation*: height, quaternion, joint angles,
    velocities of the base and the joints. *Reward*: forward speed up to 0.5 m/s, less a little for torque.

    Args:
        payload: [kg].
    """

    metadata = {"render_modes": []}  # noqa: RUF012  # gymnasium's own type

    def __init__(self, payload: float = 0.0) -> None:
        self.model = build(OneNode(), payload)
        self.data = mujoco.MjData(self.model)
        self.action_space = spaces.Box(-1.0, 1.0, (12,), np.float32)
        self.observation_space = spaces.Box(-100.0, 100.0, (self.model.nq - 2 + self.model.nv,), np.float64)
        self._steps = 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Stand up, joints a little off."""
        super().reset(seed=seed)
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[2], self.data.qpos[7:19] = HEIGHT, POSTURE + self.np_random.uniform(-0.05, 0.05, 12)
        mujoco.mj_forward(self.model, self.data)
        self._steps = 0
        return self._seen(), {}

    def step(self, action: npt.NDArray[np.float32]) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """A fiftieth of a second."""
        target = POSTURE + REACH * np.clip(action, -1.0, 1.0)
        for _ in range(STEPS):
            asked = STIFFNESS * (target - self.data.qpos[7:19]) - DAMPING * self.data.qvel[6:]
            self.data.ctrl[:] = asked.clip(-TORQUE_LIMIT, TORQUE_LIMIT)
            mujoco.mj_step(self.model, self.data)
        self._steps += 1
        effort = float((self.data.actuator_force**2).mean()) / TORQUE_LIMIT**2
        reward = min(float(self.data.qvel[0]), WANTED) / WANTED - 0.1 * effort
        return self._seen(), reward, bool(self.data.qpos[2] < LOWEST), self._steps * STEPS * TIME_STEP >= SECONDS, {}

    def _seen(self) -> Array:
        return np.concatenate([self.data.qpos[2:], self.data.qvel]).clip(-100.0, 100.0)


def warm_a1(**options: Any) -> ThermalWrapper:
    """The robot with its thermal network: joints begin at 25 to 60 degC, 60 degC is the limit."""
    columns = mujoco_columns({joint: f"{joint}_joint" for joint in JOINTS}, {"power.pc": 20.0})
    return ThermalWrapper(
        A1Env(**options), model=quadruped(), limits={"*_*": 60.0}, columns=columns, seconds=STEPS * TIME_STEP,
        start=(25.0, 60.0),
    )  # fmt: skip


def steps_per_second(env: gymnasium.Env[Any, Any], seconds: float) -> float:
    """Of CPU time, under random actions."""
    env.reset(seed=0)
    env.action_space.seed(0)
    began, steps = time.process_time(), 0
    while time.process_time() - began < seconds:
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        steps += 1
        if terminated or truncated:
            env.reset()
    return steps / (time.process_time() - began)


def main() -> None:
    """Check, and count."""
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*is different from the unwrapped version")  # it is a wrapper
        for name, made in {"A1-v0": "A1Env", "WarmA1-v0": "warm_a1"}.items():
            entry = f"a1_env:{made}"
            gymnasium.register(name, entry_point=entry, order_enforce=False, disable_env_checker=True)
            check_env(gymnasium.make(name))
    print("gymnasium's checker has nothing to say")
    measurements: dict[str, list[float]] = {"MuJoCo's A1": [], "with its thermal network": []}
    for _ in range(3):  # in turns: what else the machine does meets both
        for (_, rates), env in zip(measurements.items(), (A1Env(), warm_a1()), strict=True):
            rates.append(steps_per_second(env, 2.0))
    for name, rates in measurements.items():
        print(f"{name}: {np.median(rates):.0f} steps of 20 ms a second of CPU")
    plain, warm = (float(np.median(rates)) for rates in measurements.values())
    print(f"the network takes {1e6 * (1 / warm - 1 / plain):.0f} µs a step, {1 - warm / plain:.1%} of the time")


if __name__ == "__main__":
    main()
