"""Any robot in a simulator, its joints' temperatures beside it: in what a policy sees, and as a cost."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.logs.resampling import raw_keys, reduce_blocks, sample_values
from lptn.model.model import Model
from lptn.planners.values import Each, limits_of

from .torque import LARGEST, UNIT, Robots

Columns = Callable[[gymnasium.Env[Any, Any]], Mapping[str, float]]
"""What a log of the robot would hold at this moment: `torque.FR_calf` [N·m], `velocity.FR_calf`, `speed.base`, …"""


class ThermalWrapper(gymnasium.Wrapper[npt.NDArray[Any], Any, npt.NDArray[Any], Any]):
    """An environment with a thermal network beside it.

    What the simulator does is sampled at each step and reduced to the network's inputs as a log is (torque as its RMS,
    so that no heat is lost), and every `period` the network takes a step. The observation grows by the margins of
    limited nodes, `(limit - T)/10 K`; `info` by `temperature` [degC] and `cost`, how far the hottest of them is above
    its limit [K]. Reward and action stay as they are.

    Joints warm up for minutes, episodes last seconds: `start` draws how warm the robot is at the beginning, and
    `faster` lets thermal time pass so many times as fast.

    Args:
        env: with a `Box` of one dimension as its observations.
        model: the network.
        limits: degC by node or pattern.
        columns: reads the simulator.
        seconds: of one step of the environment.
        period: of one step of the network [s].
        start: coldest and hottest beginning [degC]; every joint is as warm.
        ambient: of the air, unless `columns` tells it [degC].
        faster: thermal seconds per simulated second.

    Raises:
        InputError: other observations, an unknown place, or an input of the network that `columns` doesn't tell.
    """

    def __init__(
        self,
        env: gymnasium.Env[npt.NDArray[Any], Any],
        *,
        model: Model,
        limits: Each,
        columns: Columns,
        seconds: float,
        period: float = 0.5,
        start: tuple[float, float] = (25.0, 25.0),
        ambient: float = 25.0,
        faster: float = 1.0,
    ) -> None:
        super().__init__(env)
        inner = env.observation_space
        if not isinstance(inner, spaces.Box) or len(inner.shape) != 1:
            raise InputError("environment", "observation_space", str(inner), "a Box of one dimension")
        bounds = limits_of(limits, model)
        self._limited = np.array([model.places.index(node) for node in bounds])
        self._limits = np.array(list(bounds.values()))
        self._columns, self._start, self._ambient = columns, start, ambient
        self._samples = max(1, round(period / seconds))
        self._model = model
        fastest = np.array([_FASTEST.get(column.partition(".")[0], 0.0) for column in model.inputs])
        self._robots = Robots(model, 1, faster * self._samples * seconds, fastest)
        self._window: list[Mapping[str, float]] = []
        more = np.full(len(bounds), LARGEST, dtype=inner.dtype)
        self.observation_space = spaces.Box(
            np.concatenate([inner.low, -more]), np.concatenate([inner.high, more]), dtype=inner.dtype.type
        )

    @property
    def temperature(self) -> FloatArray:
        """Of each node [degC]."""
        return self._robots.states[: len(self._model.nodes), 0]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[npt.NDArray[Any], dict[str, Any]]:
        """Begin anew; `options={"temperature": 45}` says how warm the robot is [degC]."""
        observation, info = self.env.reset(seed=seed, options=options)
        drawn = self.unwrapped.np_random.uniform(*self._start)
        warm = float((options or {}).get("temperature", drawn))
        self._robots.draw(0, warm, self.unwrapped.np_random)
        self._window = []
        return self._seen(observation), info | self._thermal_info()

    def step(self, action: Any) -> tuple[npt.NDArray[Any], Any, bool, bool, dict[str, Any]]:
        """One step of the environment, and of the network where one is due."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._window.append(self._columns(self.env))
        if len(self._window) == self._samples:
            self._robots.advance(self._inputs()[:, None])
            self._window = []
        return self._seen(observation), reward, terminated, truncated, info | self._thermal_info()

    def _inputs(self) -> FloatArray:
        """The window's samples reduced to the network's inputs."""
        air = [column for column in self._model.inputs if column.startswith("temperature.")]
        raw = {column: np.full(len(self._window), self._ambient) for column in air}
        raw |= {name: np.array([sample[name] for sample in self._window]) for name in self._window[0]}
        values = []
        for column in self._model.inputs:
            missing = [key for key in raw_keys(column, raw) if key not in raw]
            if missing:
                raise InputError("columns", column, f"no {missing[0]}", "every input of the network")
            values.append(float(reduce_blocks(column, sample_values(column, raw), len(self._window))[0]))
        return np.array(values)

    def _seen(self, observation: npt.NDArray[Any]) -> npt.NDArray[Any]:
        margins = (self._limits - self._robots.states[self._limited, 0]) / UNIT
        return np.concatenate([observation, margins.clip(-LARGEST, LARGEST).astype(observation.dtype)])

    def _thermal_info(self) -> dict[str, Any]:
        above = float((self._robots.states[self._limited, 0] - self._limits).max())
        return {"cost": max(0.0, above), "temperature": self.temperature.copy()}


_FASTEST = {"speed": 3.0, "velocity": 20.0, "velocity_rms": 20.0, "torque": 30.0, "temperature": 40.0, "powered": 1.0}
"""Speeds [m/s, rad/s], torques [N·m] and air [degC] at which a legged robot's network is at its fastest."""


def mujoco_columns(joints: Mapping[str, str], constant: Mapping[str, float] | None = None) -> Columns:
    """What a MuJoCo environment's log would hold: torque and velocity of its joints, speed of its free joint.

    Args:
        joints: MuJoCo's names of the hinges by the network's places, `{"FR_calf": "FR_calf_joint"}`.
        constant: further columns, such as `{"power.pc": 20.0}`; drives are powered unless said otherwise.

    Returns:
        A function of the environment, whose `unwrapped` has MuJoCo's `model` and `data`.
    """
    fixed = {**{f"powered.{joint}": 1.0 for joint in joints}, **(constant or {})}
    torques, velocities = ([f"{quantity}.{joint}" for joint in joints] for quantity in ("torque", "velocity"))
    places: dict[int, tuple[list[int], bool]] = {}

    def columns(env: gymnasium.Env[Any, Any]) -> Mapping[str, float]:
        inner: Any = env.unwrapped
        model, data = inner.model, inner.data
        if id(model) not in places:
            free = model.njnt > 0 and model.jnt_type[0] == 0  # mjJNT_FREE
            places.clear()
            places[id(model)] = [int(model.joint(name).dofadr[0]) for name in joints.values()], free
        at, free = places[id(model)]
        velocity = data.qvel
        sample = dict(fixed)
        sample.update(zip(torques, data.qfrc_actuator[at].tolist(), strict=True))
        sample.update(zip(velocities, velocity[at].tolist(), strict=True))
        sample["speed.base"] = float(np.hypot(velocity[0], velocity[1])) if free else 0.0
        return sample

    return columns
